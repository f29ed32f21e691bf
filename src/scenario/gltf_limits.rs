//! What a glTF may ask of whoever loads all of it: a few bytes could ask for any amount of memory, or for any depth of the
//! stack.

use serde_json::Value;

/// The most elements of accessors that meshes, skins and animations read, all together: each reader makes a copy.
const MAX_ELEMENTS: u64 = 100_000_000;

/// The most nodes from a root down to a leaf.
const MAX_NODE_DEPTH: usize = 256;

/// The most textures, and the most images.
const MAX_TEXTURES: usize = 1024;

/// Checks the JSON of a glTF. An error is a field, and what is wrong with it.
pub(super) fn check(json: &Value) -> Result<(), (String, String)> {
    for list in ["textures", "images"] {
        let count = entries(&json[list]).len();
        if count > MAX_TEXTURES {
            return Err((list.into(), format!("there are {count}; at most {MAX_TEXTURES} are read")));
        }
    }
    check_positions(json)?;
    let elements = read_elements(json);
    if elements > MAX_ELEMENTS {
        return Err(("accessors".into(), format!("{elements} elements; at most {MAX_ELEMENTS} are read")));
    }
    check_nodes(entries(&json["nodes"]))
}

/// The gltf crate, 1.4, panics where the positions of a primitive are an accessor that is not there.
fn check_positions(json: &Value) -> Result<(), (String, String)> {
    let count = entries(&json["accessors"]).len() as u64;
    for (number, mesh) in entries(&json["meshes"]).iter().enumerate() {
        for (part, primitive) in entries(&mesh["primitives"]).iter().enumerate() {
            if let Some(index) = primitive["attributes"]["POSITION"].as_u64()
                && index >= count
            {
                let field = format!("meshes[{number}].primitives[{part}].attributes.POSITION");
                return Err((field, format!("is accessor {index} of {count}")));
            }
        }
    }
    Ok(())
}

fn entries(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

/// Elements of all accessors, as often as they are referred to.
fn read_elements(json: &Value) -> u64 {
    let accessors = entries(&json["accessors"]);
    let count = |accessor: &Value| {
        let accessor = accessor.as_u64().and_then(|index| accessors.get(usize::try_from(index).ok()?));
        accessor.and_then(|accessor| accessor["count"].as_u64()).unwrap_or(0)
    };
    let of_all = |object: &Value| -> u64 {
        let values = object.as_object().into_iter().flat_map(|object| object.values());
        values.map(count).fold(0, u64::saturating_add)
    };
    let mut sum = 0u64;
    let mut add = |elements: u64| sum = sum.saturating_add(elements);
    for primitive in entries(&json["meshes"]).iter().flat_map(|mesh| entries(&mesh["primitives"])) {
        add(of_all(&primitive["attributes"]));
        add(count(&primitive["indices"]));
        entries(&primitive["targets"]).iter().for_each(|target| add(of_all(target)));
    }
    entries(&json["skins"]).iter().for_each(|skin| add(count(&skin["inverseBindMatrices"])));
    for sampler in entries(&json["animations"]).iter().flat_map(|animation| entries(&animation["samplers"])) {
        add(count(&sampler["input"]));
        add(count(&sampler["output"]));
    }
    sum
}

/// Nodes are trees, by the specification, and not deeper than a recursive loader can go.
fn check_nodes(nodes: &[Value]) -> Result<(), (String, String)> {
    let count = nodes.len();
    let children = |node: usize| {
        let children = entries(&nodes[node]["children"]).iter().filter_map(Value::as_u64);
        children.filter_map(|child| usize::try_from(child).ok()).filter(move |&child| child < count)
    };
    let mut has_parent = vec![false; nodes.len()];
    for child in (0..nodes.len()).flat_map(children) {
        if std::mem::replace(&mut has_parent[child], true) {
            return Err((format!("nodes[{child}]"), "is a child twice".into()));
        }
    }
    let mut seen = vec![false; nodes.len()];
    // Rings have no roots.
    let roots = (0..nodes.len()).filter(|&node| !has_parent[node]);
    for start in roots.chain(0..nodes.len()) {
        let mut waiting = vec![(start, 1)];
        while let Some((node, depth)) = waiting.pop() {
            if std::mem::replace(&mut seen[node], true) {
                continue;
            }
            if depth > MAX_NODE_DEPTH {
                return Err((
                    format!("nodes[{node}]"),
                    format!("lies more than {MAX_NODE_DEPTH} nodes deep"),
                ));
            }
            waiting.extend(children(node).map(|child| (child, depth + 1)));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn refusal(json: &Value) -> String {
        check(json).map_or_else(|(field, reason)| format!("{field} {reason}"), |()| String::new())
    }

    #[test]
    fn a_small_file_cannot_ask_for_all_memory() {
        let accessor = |count: u64| json!({ "count": count, "componentType": 5126, "type": "VEC3" });
        let alone = json!({ "accessors": [accessor(4_000_000_000)] });
        assert_eq!(refusal(&alone), "", "nobody reads it");
        let read = json!({
            "accessors": [accessor(4_000_000_000)],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        });
        assert!(refusal(&read).contains("4000000000 elements"), "{}", refusal(&read));
        let primitives = vec![json!({ "attributes": { "POSITION": 0 }, "indices": 0 }); 1000];
        let shared = json!({ "accessors": [accessor(100_000)], "meshes": [{ "primitives": primitives }] });
        assert!(refusal(&shared).contains("200000000 elements"), "{}", refusal(&shared));
        let images = json!({ "images": vec![json!({}); 1025] });
        assert!(refusal(&images).starts_with("images"), "{}", refusal(&images));
    }

    #[test]
    fn positions_that_are_not_there_are_told_before_anybody_asks_for_them() {
        let of = |index: u64| {
            let primitive = json!({ "attributes": { "POSITION": index } });
            json!({ "accessors": [{}], "meshes": [{ "primitives": [primitive] }] })
        };
        assert_eq!(refusal(&of(0)), "");
        assert!(refusal(&of(u64::from(u32::MAX))).starts_with("meshes[0].primitives[0].attributes.POSITION"));
    }

    #[test]
    fn nodes_are_trees_of_some_depth() {
        let chain = |count: usize, last: Value| {
            let mut nodes: Vec<_> = (1..count).map(|child| json!({ "children": [child] })).collect();
            nodes.push(last);
            json!({ "nodes": nodes })
        };
        assert_eq!(refusal(&chain(256, json!({}))), "");
        assert!(refusal(&chain(257, json!({}))).contains("nodes[256]"));
        // A ring.
        assert!(refusal(&chain(100_000, json!({ "children": [0] }))).contains("deep"));
        assert!(refusal(&chain(3, json!({ "children": [1] }))).contains("nodes[1] is a child twice"));
        // What is not there is told by whoever loads it.
        assert_eq!(refusal(&json!({ "nodes": [{ "children": [7, "x", -1] }, 3] })), "");
    }
}
