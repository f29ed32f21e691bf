//! Which meshes a scene shows, and where.

use std::collections::BTreeSet;

use bevy::math::{Affine3A, Mat4, Quat, Vec3};
use serde_json::Value;

use super::ExportError;
use super::document::{Document, number};

/// A primitive that a node shows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Place {
    /// Of a file, and of no other place.
    pub(super) name: String,
    pub(super) node: usize,
    pub(super) mesh: usize,
    pub(super) primitive: usize,
    pub(super) world_from_mesh: Affine3A,
}

impl Document {
    /// All primitives of triangles that the default scene shows (the first, if none is), in the order of its nodes. A mesh
    /// with a skin stands as its first joint puts it, in its bind pose.
    pub(super) fn places(&self) -> Result<Vec<Place>, ExportError> {
        let nodes = self.walk()?;
        let mut worlds = vec![None; self.list("nodes").len()];
        for &(node, world) in &nodes {
            worlds[node] = Some(world);
        }
        let (mut places, mut names) = (Vec::new(), BTreeSet::new());
        for &(node, world) in &nodes {
            let entry = self.entry("nodes", node)?;
            let Some(mesh) = number(&entry["mesh"]) else { continue };
            let mesh_entry = self.entry("meshes", mesh)?;
            let world = match number(&entry["skin"]) {
                Some(skin) => self.bind_pose(skin, &worlds)?.unwrap_or(world),
                None => world,
            };
            let given = [entry, mesh_entry].into_iter().find_map(|entry| entry["name"].as_str());
            let given = file_name(given.unwrap_or_default());
            let base = if given.is_empty() { format!("mesh{mesh}") } else { given };
            let primitives = mesh_entry["primitives"].as_array().map_or(&[][..], Vec::as_slice);
            for (primitive, entry) in primitives.iter().enumerate() {
                // Lists, strips and fans of triangles.
                if !(4..=6).contains(&entry["mode"].as_u64().unwrap_or(4)) {
                    continue;
                }
                let part = if primitives.len() > 1 { format!("_{primitive}") } else { String::new() };
                let mut name = format!("{base}{part}");
                // Names of nodes need not differ; their numbers do.
                if !names.insert(name.clone()) {
                    name = format!("{base}_node{node}{part}");
                    while !names.insert(name.clone()) {
                        name.push('_');
                    }
                }
                places.push(Place { name, node, mesh, primitive, world_from_mesh: world });
            }
        }
        if places.is_empty() { Err(ExportError::NoMesh { path: self.path.clone() }) } else { Ok(places) }
    }

    /// The nodes of the default scene, parents first, and where they stand.
    fn walk(&self) -> Result<Vec<(usize, Affine3A)>, ExportError> {
        let all = self.list("nodes");
        let scene = number(&self.json["scene"]).unwrap_or(0);
        let roots = match self.list("scenes").get(scene) {
            Some(scene) => numbers(&scene["nodes"]),
            None => {
                let children: BTreeSet<_> = all.iter().flat_map(|node| numbers(&node["children"])).collect();
                (0..all.len()).filter(|node| !children.contains(node)).collect()
            }
        };
        let mut waiting: Vec<_> = roots.into_iter().rev().map(|node| (node, Affine3A::IDENTITY)).collect();
        let (mut seen, mut found) = (vec![false; all.len()], Vec::new());
        while let Some((node, world_from_parent)) = waiting.pop() {
            let entry = self.entry("nodes", node)?;
            if std::mem::replace(&mut seen[node], true) {
                return Err(self.content(format!("nodes[{node}]"), "is there twice: nodes must be a tree"));
            }
            let world = world_from_parent * local(entry);
            found.push((node, world));
            let children = numbers(&entry["children"]);
            waiting.extend(children.into_iter().rev().map(|child| (child, world)));
        }
        Ok(found)
    }

    /// Where the first joint of a skin puts its mesh.
    fn bind_pose(&self, skin: usize, worlds: &[Option<Affine3A>]) -> Result<Option<Affine3A>, ExportError> {
        let entry = self.entry("skins", skin)?;
        let joint = numbers(&entry["joints"]).first().and_then(|&joint| *worlds.get(joint)?);
        let Some(world_from_joint) = joint else { return Ok(None) };
        let joint_from_mesh = match number(&entry["inverseBindMatrices"]) {
            None => Affine3A::IDENTITY,
            Some(accessor) => {
                let matrices = self.elements(accessor)?.floats::<16>();
                let first = matrices.as_ref().and_then(|matrices| matrices.first());
                let first = first.ok_or_else(|| {
                    self.content(format!("skins[{skin}].inverseBindMatrices"), "holds no matrices")
                })?;
                Affine3A::from_mat4(Mat4::from_cols_array(first))
            }
        };
        Ok(Some(world_from_joint * joint_from_mesh))
    }
}

/// A list of numbers; what is none is left out.
fn numbers(value: &Value) -> Vec<usize> {
    value.as_array().into_iter().flatten().filter_map(number).collect()
}

/// Of a node in its parent.
fn local(node: &Value) -> Affine3A {
    if let Some(matrix) = vector::<16>(&node["matrix"]) {
        return Affine3A::from_mat4(Mat4::from_cols_array(&matrix));
    }
    let scale = vector(&node["scale"]).unwrap_or([1.0; 3]);
    let rotation = vector(&node["rotation"]).unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let translation = vector(&node["translation"]).unwrap_or([0.0; 3]);
    Affine3A::from_scale_rotation_translation(
        Vec3::from_array(scale),
        Quat::from_array(rotation).normalize(),
        Vec3::from_array(translation),
    )
}

/// So many numbers; `None` if there are fewer or more.
pub(super) fn vector<const N: usize>(value: &Value) -> Option<[f32; N]> {
    let values = value.as_array()?.iter().map(|value| value.as_f64().map(|value| value as f32));
    values.collect::<Option<Vec<_>>>()?.try_into().ok()
}

/// What of a name can be in the name of a file, with room for what comes behind it: those have 255 bytes.
fn file_name(name: &str) -> String {
    const MOST_BYTES: usize = 192;
    let plain = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_') { c } else { '_' };
    let mut kept: String = name.chars().take(64).map(plain).collect();
    kept.truncate(kept.floor_char_boundary(MOST_BYTES));
    kept
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn document(json: Value) -> Document {
        Document { path: "scene.gltf".into(), json, bytes: Vec::new() }
    }

    fn scene() -> Value {
        let triangles = json!({ "attributes": {} });
        json!({
            "scenes": [{ "nodes": [0] }],
            "nodes": [
                { "translation": [0.0, 5.0, 0.0], "children": [2, 1] },
                { "name": "a/b", "mesh": 0, "scale": [2.0, 2.0, -2.0] },
                { "name": "a/b", "mesh": 0 },
                { "name": "elsewhere", "mesh": 0 },
            ],
            "meshes": [{ "primitives": [triangles.clone(), { "mode": 1 }, triangles] }],
        })
    }

    #[test]
    fn every_primitive_of_every_instance_has_a_place_and_a_name() {
        let places = document(scene()).places().unwrap();
        let found: Vec<_> =
            places.iter().map(|place| (place.name.as_str(), place.node, place.primitive)).collect();
        let expected = [("a_b_0", 2, 0), ("a_b_2", 2, 2), ("a_b_node1_0", 1, 0), ("a_b_node1_2", 1, 2)];
        assert_eq!(found, expected);
        let at = |place: &Place| place.world_from_mesh.transform_point3(Vec3::ONE);
        assert_eq!(at(&places[2]), Vec3::new(2.0, 7.0, -2.0));
    }

    #[test]
    fn names_are_short_enough_for_files_in_any_script() {
        assert_eq!(file_name("a/b c-d_é"), "a_b_c-d_é");
        assert_eq!(file_name(&"a".repeat(80)).len(), 64);
        let letter = "\u{20000}";
        assert_eq!(file_name(&letter.repeat(80)), letter.repeat(48));
        assert_eq!(file_name(&format!("a{}", letter.repeat(80))).len(), 189);
    }

    #[test]
    fn without_a_scene_all_nodes_that_are_no_children_are_shown() {
        let mut json = scene();
        json.as_object_mut().unwrap().remove("scenes");
        assert_eq!(document(json).places().unwrap().len(), 6);
    }

    #[test]
    fn circles_and_nodes_that_are_not_there_are_errors() {
        let mut json = scene();
        json["nodes"][2]["children"] = json!([0]);
        assert!(document(json.clone()).places().unwrap_err().to_string().contains("nodes[0]"));
        json["nodes"][2]["children"] = json!([9]);
        assert!(document(json.clone()).places().unwrap_err().to_string().contains("nodes[9]"));
        json["nodes"] = json!([{}]);
        assert!(matches!(document(json).places(), Err(ExportError::NoMesh { .. })));
    }

    #[test]
    fn a_skinned_mesh_stands_as_its_first_joint_puts_it() {
        let mut json = scene();
        json["nodes"][2]["skin"] = 0.into();
        json["skins"] = json!([{ "joints": [1] }]);
        let places = document(json).places().unwrap();
        assert_eq!(places[0].world_from_mesh, places[2].world_from_mesh);
    }
}
