//! Scenario files that are shipped, held against the schema that others are told.

use std::path::Path;

use serde_json::{Value, json};

use super::{ScenarioPart, schema_json};
use crate::scenario::load::ron_options;

/// What of a value does not fit a schema, and where; as much of the language as `schemars` uses.
fn misfit(root: &Value, schema: &Value, value: &Value, path: &str) -> Option<String> {
    let told = |what: &str| Some(format!("{path} {what}: {value}"));
    if *schema == Value::Bool(false) {
        return told("is not known");
    }
    if let Some(name) = schema["$ref"].as_str() {
        let Some(target) = root.pointer(name.trim_start_matches('#')) else {
            return told("has no definition");
        };
        if let Some(found) = misfit(root, target, value, path) {
            return Some(found);
        }
    }
    for (choice, most) in [("anyOf", usize::MAX), ("oneOf", 1)] {
        let Some(kinds) = schema[choice].as_array() else { continue };
        let fitting = kinds.iter().filter(|kind| misfit(root, kind, value, path).is_none()).count();
        if fitting == 0 || fitting > most {
            return told("is none of its kinds, or several");
        }
    }
    let types: Vec<&str> = match &schema["type"] {
        Value::Array(types) => types.iter().filter_map(Value::as_str).collect(),
        one => one.as_str().into_iter().collect(),
    };
    let is = |kind: &&str| match *kind {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "string" => value.is_string(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        "array" => value.is_array(),
        _ => *kind == "object" && value.is_object(),
    };
    if !types.is_empty() && !types.iter().any(is) {
        return told("is of another type");
    }
    if schema.get("const").is_some_and(|only| only != value) {
        return told("is another constant");
    }
    if let (Some(least), Some(number)) = (schema["minimum"].as_f64(), value.as_f64())
        && number < least
    {
        return told("is too small");
    }
    if let Some(entries) = value.as_array() {
        let count = entries.len() as u64;
        let too_few = schema["minItems"].as_u64().is_some_and(|least| count < least);
        if too_few || schema["maxItems"].as_u64().is_some_and(|most| count > most) {
            return told("has another length");
        }
        let of = |index: usize| schema["prefixItems"].get(index).unwrap_or(&schema["items"]);
        let mut entries = entries.iter().enumerate();
        return entries
            .find_map(|(index, entry)| misfit(root, of(index), entry, &format!("{path}[{index}]")));
    }
    let fields = value.as_object()?;
    let mut required = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str);
    if let Some(missing) = required.find(|name| !fields.contains_key(*name)) {
        return told(&format!("lacks {missing}"));
    }
    let of = |name: &str| schema["properties"].get(name).unwrap_or(&schema["additionalProperties"]);
    fields.iter().find_map(|(name, field)| misfit(root, of(name), field, &format!("{path}.{name}")))
}

#[test]
fn every_scenario_that_is_shipped_fits_the_schema() {
    let schema = schema_json();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let file = entry.unwrap().path();
        let text = std::fs::read_to_string(&file).unwrap();
        let part: ScenarioPart =
            ron_options().from_str(&text).unwrap_or_else(|error| panic!("{}:{error}", file.display()));
        let value = serde_json::to_value(&part).unwrap();
        assert_eq!(misfit(&schema, &schema, &value, &file.display().to_string()), None);
        count += 1;
    }
    assert!(count > 15);
}

#[test]
fn what_no_scenario_can_say_does_not_fit_the_schema() {
    let schema = schema_json();
    let of = |value: Value| misfit(&schema, &schema, &value, "file").unwrap_or_default();
    assert_eq!(of(json!({ "seconds": 2.5, "events": [{ "at": 1.0, "what": { "Stop": "rain" } }] })), "");
    for (value, named) in [
        (json!({ "seconds": "long" }), "file.seconds"),
        (json!({ "second": 1.0 }), "file.second"),
        (json!({ "wind": [1.0, 2.0] }), "file.wind"),
        (json!({ "tick_hz": -1 }), "file.tick_hz"),
        (json!({ "events": [{ "what": { "Stop": "rain" } }] }), "lacks at"),
        (json!({ "events": [{ "at": 1.0, "what": { "Halt": "rain" } }] }), "file.events[0].what"),
    ] {
        let found = of(value);
        assert!(found.contains(named), "{named}: {found:?}");
    }
}
