//! `weathering check` and `weathering schema`.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

use bevy_weathering::scenario::{LoadedScenario, Scenario, ScenarioError, schema_json};

use crate::cli::{CheckArgs, refuse_model};
use crate::{print, tell};

/// Checks all files; exit code 2 if one of them cannot be run.
pub fn run(arguments: &CheckArgs) -> Result<ExitCode, Box<dyn Error>> {
    let mut code = ExitCode::SUCCESS;
    for file in &arguments.files {
        match check(file, arguments.variant.as_deref()) {
            Ok(summaries) => summaries.iter().try_for_each(print)?,
            Err(error) => {
                tell(format_args!("error: {error}"));
                code = ExitCode::from(2);
            }
        }
    }
    Ok(code)
}

/// Prints the schema.
pub fn print_schema() -> Result<ExitCode, Box<dyn Error>> {
    print(serde_json::to_string_pretty(&schema_json())?)?;
    Ok(ExitCode::SUCCESS)
}

/// A summary of the file with a variant or, without one, of the file alone and with each of them.
fn check(file: &Path, variant: Option<&str>) -> Result<Vec<String>, Box<dyn Error>> {
    refuse_model(file)?;
    let loaded = Scenario::load_variant(file, variant)?;
    let mut summaries = vec![summary(&loaded)?];
    if variant.is_none() {
        for variant in &loaded.variants {
            summaries.push(summary(&Scenario::load_variant(file, Some(variant))?)?);
        }
    }
    Ok(summaries)
}

/// A count and what is counted.
fn counted(count: usize, one: &str, more: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { more })
}

fn summary(loaded: &LoadedScenario) -> Result<String, ScenarioError> {
    let triangles = loaded.check_content()?;
    let scenario = &loaded.scenario;
    let variant = loaded.variant.as_ref().map(|name| format!(" [{name}]")).unwrap_or_default();
    let mut parts = vec![
        format!("{} s at {} ticks/s", scenario.seconds, scenario.tick_hz),
        format!("{} of {triangles} triangles", counted(scenario.surface_count(), "surface", "surfaces")),
        counted(scenario.emitters.len(), "emitter", "emitters"),
    ];
    if !scenario.events.is_empty() {
        let mut kinds: BTreeMap<&str, usize> = BTreeMap::new();
        scenario.events.iter().for_each(|event| *kinds.entry(event.what.kind()).or_default() += 1);
        let kinds: Vec<_> = kinds.iter().map(|(kind, count)| format!("{kind} {count}")).collect();
        parts.push(format!("{} ({})", counted(scenario.events.len(), "event", "events"), kinds.join(", ")));
    }
    if !scenario.flaws.is_empty() {
        parts.push(format!(
            "recorded with {}: {}",
            counted(scenario.flaws.len(), "flaw", "flaws"),
            scenario.flaws.join("; ")
        ));
    }
    if !loaded.included.is_empty() {
        parts.push(format!("{} included", counted(loaded.included.len(), "file", "files")));
    }
    Ok(format!("{}{variant}: {}", loaded.file.display(), parts.join(", ")))
}
