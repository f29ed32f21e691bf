//! How the default scene of a glTF hangs together: its nodes, and what each of them shows. No vertex is looked at.
//!
//! Whoever wants the scene in an app has its meshes loaded by Bevy, by their numbers, and puts them where this says; so which
//! mesh comes first, and what it is called, is known before anything is loaded.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use bevy::math::{Affine3A, Mat4, Quat, Vec3};
use bevy::mesh::Mesh;
use bevy::transform::components::Transform;
use gltf::mesh::{Mode, Semantic};

use super::file::GltfFile;
use super::{GltfMeshError, MAX_ELEMENTS};

/// The most primitives that the nodes of a scene may show, all together.
const MAX_PARTS: usize = 10_000;

/// The most joints of a skin, and the most morph targets of a primitive: each part has a list of its own.
const MAX_LISTED: usize = 1024;

/// The longest name of a node in the names of its parts, bytes.
const MAX_NAME: usize = 48;

/// The default scene of a glTF (the first, if none is).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SceneLayout {
    /// Its nodes, each behind the one that it hangs from, in the order of [`read_meshes`](super::read_meshes).
    pub nodes: Vec<SceneNode>,
    /// What they show, in the order of the nodes and then of the primitives.
    pub parts: Vec<ScenePart>,
}

/// A node of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneNode {
    /// The node that it hangs from, as a place in [`SceneLayout::nodes`]; of a root none.
    pub parent: Option<usize>,
    /// In the space of that node, as Bevy takes it.
    pub transform: Transform,
}

/// A primitive of triangles that a node shows.
#[derive(Debug, Clone, PartialEq)]
pub struct ScenePart {
    /// Unique in the scene, of letters, digits, `_` and `-`: the name of the node or, if that has none, of the mesh, else `mesh`
    /// and its number. What it may not hold becomes `_`. Where nodes share a name, `-n` and the number of the node in the file
    /// follow; where the node shows several primitives, a dot and the number of this one.
    pub name: String,
    /// The node that shows it, as a place in [`SceneLayout::nodes`].
    pub node: usize,
    /// Number of the mesh in the file.
    pub mesh: usize,
    /// Number of the primitive in the mesh.
    pub primitive: usize,
    /// Number of the material in the file; none is the default one of the format.
    pub material: Option<usize>,
    /// Whether its node turns it inside out: then the other sides of its triangles are seen.
    pub is_mirrored: bool,
    /// The box around it, as the file says, in the space of its mesh.
    pub corners: [Vec3; 2],
    /// What bends it.
    pub skin: Option<SceneSkin>,
    /// Weights of its morph targets; empty if it has none.
    pub weights: Vec<f32>,
}

/// The joints that bend a part.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneSkin {
    /// Number of the skin in the file.
    pub index: usize,
    /// Its joints, as places in [`SceneLayout::nodes`].
    pub joints: Vec<usize>,
}

impl SceneLayout {
    /// From the space of a node to that of the scene.
    pub fn scene_from_node(&self, node: usize) -> Affine3A {
        let mut whole = Affine3A::IDENTITY;
        let mut next = self.nodes.get(node);
        // Each hangs from one before it, so this ends.
        while let Some(SceneNode { parent, transform }) = next {
            whole = transform.compute_affine() * whole;
            next = parent.and_then(|parent| self.nodes.get(parent));
        }
        whole
    }

    /// The corners of the box around a part, in the space of the scene. Skins are not bent for it.
    pub fn box_of(&self, part: &ScenePart) -> [Vec3; 8] {
        let scene_from_node = self.scene_from_node(part.node);
        let [low, high] = part.corners;
        std::array::from_fn(|corner| {
            let pick = |bit: usize| if (corner >> bit) & 1 == 0 { low } else { high };
            scene_from_node.transform_point3(Vec3::new(pick(0).x, pick(1).y, pick(2).z))
        })
    }
}

/// Reads how a scene hangs together.
///
/// # Errors
/// [`GltfMeshError`]; also if no node shows triangles, more than 10,000 primitives are shown, a skin or a primitive has
/// more than 1024 joints or morph targets, names repeat, or a primitive has no box or a skin a joint from elsewhere: Bevy could not
/// load it.
pub fn read_layout(path: &Path) -> Result<SceneLayout, GltfMeshError> {
    let file = GltfFile::open(path)?;
    let document = &file.gltf.document;
    let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) else {
        return Err(file.content("scenes", "is empty"));
    };
    let mut layout = SceneLayout::default();
    let mut shown: Vec<gltf::Node> = Vec::new();
    // Where a node of the file is in the layout.
    let mut places: Vec<Option<usize>> = vec![None; document.nodes().count()];
    let mut waiting: Vec<Waiting> =
        scene.nodes().map(|node| Waiting { node, parent: None, above: Transform::IDENTITY }).collect();
    // The next is taken from the end.
    waiting.reverse();
    let (mut scales, mut wholes) = (Vec::new(), Vec::<Affine3A>::new());
    while let Some(Waiting { node, parent, above }) = waiting.pop() {
        let field = format!("nodes[{}]", node.index());
        let place = layout.nodes.len();
        if places[node.index()].replace(place).is_some() {
            // A tree, by the specification; in a ring this would go on for ever.
            return Err(file.content(&field, "is in the scene twice"));
        }
        let transform = transform_of(&node);
        // Multiplied as Bevy does to find out what is turned inside out.
        let whole = above * transform;
        layout.nodes.push(SceneNode { parent, transform });
        let above = parent.map_or(Affine3A::IDENTITY, |parent| wholes[parent]);
        wholes.push(above * transform.compute_affine());
        if !wholes[place].is_finite() {
            return Err(file.content(&field, "has a transform that is not finite"));
        }
        let below = waiting.len();
        waiting.extend(node.children().map(|node| Waiting { node, parent: Some(place), above: whole }));
        waiting[below..].reverse();
        scales.push(whole.scale);
        shown.push(node);
    }
    let names = names_of(&shown);
    for (place, node) in shown.iter().enumerate() {
        let Some(mesh) = node.mesh() else { continue };
        let skin = match node.skin() {
            Some(skin) => {
                let field = format!("skins[{}].joints", skin.index());
                if skin.joints().count() > MAX_LISTED {
                    return Err(file.content(&field, format!("are more than {MAX_LISTED}")));
                }
                let joints = skin.joints().map(|joint| places.get(joint.index()).copied().flatten());
                let joints = joints.collect::<Option<Vec<usize>>>();
                let joints = joints.ok_or_else(|| file.content(&field, "has a node of another scene"))?;
                Some(SceneSkin { index: skin.index(), joints })
            }
            None => None,
        };
        let of_triangles = |mode| matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan);
        let count = mesh.primitives().filter(|part| of_triangles(part.mode())).count();
        for primitive in mesh.primitives().filter(|part| of_triangles(part.mode())) {
            let field = format!("meshes[{}].primitives[{}]", mesh.index(), primitive.index());
            if layout.parts.len() >= MAX_PARTS {
                return Err(file.content("nodes", format!("show more than {MAX_PARTS} primitives")));
            }
            let corners = corners_of(&primitive)
                .ok_or_else(|| file.content(&field, "has a `POSITION` without `min` and `max`"))?;
            let targets = primitive.morph_targets().count();
            if targets > MAX_LISTED {
                return Err(file.content(&field, format!("has more than {MAX_LISTED} morph targets")));
            }
            let mut weights = mesh.weights().unwrap_or_default().to_vec();
            weights.resize(targets, 0.0);
            let mut name = names[place].clone();
            if count > 1 {
                name = format!("{name}.{}", primitive.index());
            }
            layout.parts.push(ScenePart {
                name,
                node: place,
                mesh: mesh.index(),
                primitive: primitive.index(),
                material: primitive.material().index(),
                is_mirrored: scales[place].is_negative_bitmask().count_ones() % 2 == 1,
                corners,
                skin: skin.clone(),
                weights,
            });
        }
    }
    let mut seen = BTreeSet::new();
    let repeated = layout.parts.iter().position(|part| !seen.insert(part.name.as_str()));
    drop(seen);
    if let Some(part) = repeated.map(|repeated| &layout.parts[repeated]) {
        let index = shown.get(part.node).map_or(0, gltf::Node::index);
        let reason = format!("makes a second `{}`; give it a name of its own", part.name);
        return Err(file.content(&format!("nodes[{index}].name"), reason));
    }
    if layout.parts.is_empty() { Err(file.content("nodes", "show no mesh of triangles")) } else { Ok(layout) }
}

/// The meshes of parts of a scene, with their vertices and the texture coordinates that they have, as Bevy would load them.
///
/// # Errors
/// [`GltfMeshError`]; also if one of them is not in the file.
pub fn read_parts(path: &Path, parts: &[ScenePart]) -> Result<Vec<Mesh>, GltfMeshError> {
    let file = GltfFile::open(path)?;
    let mut elements = 0;
    let read = |part: &ScenePart| {
        let field = format!("meshes[{}].primitives[{}]", part.mesh, part.primitive);
        let missing = || file.content(&field, "has no triangles");
        let mesh = file.gltf.document.meshes().nth(part.mesh).ok_or_else(missing)?;
        let primitive = mesh.primitives().skip(part.primitive).take(1);
        let read = file.mesh(&mesh, primitive)?.ok_or_else(missing)?;
        // A mesh that many nodes show is read for each of them.
        elements += read.count_vertices();
        if elements > MAX_ELEMENTS {
            return Err(
                file.content(&field, format!("and those before have more than {MAX_ELEMENTS} corners"))
            );
        }
        Ok(read)
    };
    parts.iter().map(read).collect()
}

/// A node that is still to be looked at.
struct Waiting<'a> {
    node: gltf::Node<'a>,
    parent: Option<usize>,
    /// From the space of that one to the scene's.
    above: Transform,
}

fn transform_of(node: &gltf::Node) -> Transform {
    match node.transform() {
        gltf::scene::Transform::Matrix { matrix } => {
            Transform::from_matrix(Mat4::from_cols_array_2d(&matrix))
        }
        gltf::scene::Transform::Decomposed { translation, rotation, scale } => Transform {
            translation: Vec3::from(translation),
            rotation: Quat::from_array(rotation),
            scale: Vec3::from(scale),
        },
    }
}

/// The box of a primitive, if the file has one.
fn corners_of(primitive: &gltf::Primitive) -> Option<[Vec3; 2]> {
    let positions = primitive.get(&Semantic::Positions)?;
    let corner = |value: Option<serde_json::Value>| {
        let numbers: [f32; 3] = serde_json::from_value(value?).ok()?;
        Some(Vec3::from(numbers))
    };
    Some([corner(positions.min())?, corner(positions.max())?])
}

/// What the parts of each node are called, but for the number of the primitive.
fn names_of(nodes: &[gltf::Node]) -> Vec<String> {
    let plain = |node: &gltf::Node| {
        let mesh = node.mesh();
        let number = || mesh.as_ref().map_or(String::new(), |mesh| format!("mesh{}", mesh.index()));
        let name = node.name().or(mesh.as_ref().and_then(gltf::Mesh::name));
        plain_name(name.unwrap_or_default()).unwrap_or_else(number)
    };
    let names: Vec<String> = nodes.iter().map(plain).collect();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for (name, _) in names.iter().zip(nodes).filter(|(_, node)| node.mesh().is_some()) {
        *counts.entry(name).or_default() += 1;
    }
    let numbered = |(name, node): (&String, &gltf::Node)| match counts.get(name.as_str()) {
        Some(2..) => format!("{name}-n{}", node.index()),
        _ => name.clone(),
    };
    names.iter().zip(nodes).map(numbered).collect()
}

/// A name with nothing but letters, digits, `_` and `-`; `None` if nothing is left of it.
pub(crate) fn plain_name(name: &str) -> Option<String> {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let name: String = name.chars().take(MAX_NAME).map(plain).collect();
    name.chars().any(|c| c != '_').then_some(name)
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use serde_json::{Value, json};

    use super::super::test_file::write_with_triangle;
    use super::*;

    /// A triangle that nodes show; `edit` makes it another file.
    fn file(folder: &Path, edit: impl FnOnce(&mut Value)) -> PathBuf {
        let json = json!({
            "scenes": [{ "nodes": [0] }],
            "nodes": [
                { "name": "carrier", "translation": [0.0, 5.0, 0.0], "children": [1, 2] },
                { "name": "left leaf", "mesh": 0, "scale": [-2.0, 2.0, 2.0] },
                { "mesh": 1 },
            ],
            "meshes": [
                { "name": "shape", "primitives": [{ "attributes": { "POSITION": 0 } }] },
                { "primitives": [
                    { "attributes": { "POSITION": 0 } },
                    { "attributes": { "POSITION": 0 }, "mode": 0 },
                    { "attributes": { "POSITION": 0 }, "material": 0 },
                ] },
            ],
            "materials": [{}],
        });
        write_with_triangle(&folder.join("scene.gltf"), json, edit)
    }

    fn names(edit: impl FnOnce(&mut Value)) -> Result<Vec<String>, String> {
        let folder = tempfile::tempdir().unwrap();
        let layout = read_layout(&file(folder.path(), edit)).map_err(|error| error.to_string())?;
        Ok(layout.parts.into_iter().map(|part| part.name).collect())
    }

    #[test]
    fn parts_come_in_the_order_of_nodes_with_plain_names_and_lines_are_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = file(folder.path(), |_| {});
        let layout = read_layout(&path).unwrap();
        let parts: Vec<_> = layout
            .parts
            .iter()
            .map(|part| (part.name.as_str(), part.node, part.mesh, part.primitive, part.material))
            .collect();
        assert_eq!(
            parts,
            [("left_leaf", 1, 0, 0, None), ("mesh1.0", 2, 1, 0, None), ("mesh1.2", 2, 1, 2, Some(0)),]
        );
        assert!(layout.parts[0].is_mirrored && !layout.parts[1].is_mirrored);
        assert_eq!(layout.nodes.iter().map(|node| node.parent).collect::<Vec<_>>(), [None, Some(0), Some(0)]);
        let around = layout.box_of(&layout.parts[0]);
        let low = around.into_iter().reduce(Vec3::min).unwrap();
        let high = around.into_iter().reduce(Vec3::max).unwrap();
        assert_eq!((low, high), (Vec3::new(-2.0, 5.0, 0.0), Vec3::new(0.0, 7.0, 0.0)));
        // As those who want shapes read it, in the same order.
        let meshes = super::super::read_meshes(&path).unwrap();
        assert_eq!(meshes.len(), 2);
        for (mesh, part) in meshes.iter().zip([0, 1]) {
            let node = layout.scene_from_node(layout.parts[part].node);
            assert!(mesh.transform.abs_diff_eq(node, 1e-6), "{}", mesh.name);
        }
        let read = read_parts(&path, &layout.parts).unwrap();
        assert_eq!(read.iter().map(Mesh::count_vertices).collect::<Vec<_>>(), [3, 3, 3]);
    }

    #[test]
    fn nodes_of_one_name_are_told_apart_and_what_is_left_is_refused() {
        let twice = |json: &mut Value| {
            json["nodes"][2] = json!({ "name": "left leaf", "mesh": 0 });
        };
        assert_eq!(names(twice).unwrap(), ["left_leaf-n1", "left_leaf-n2"]);
        let nameless = |json: &mut Value| {
            json["nodes"][1] = json!({ "mesh": 0 });
            json["nodes"][2] = json!({ "mesh": 0, "name": "///" });
        };
        assert_eq!(names(nameless).unwrap(), ["shape", "mesh0"]);
        let clash = |json: &mut Value| {
            json["nodes"][0]["children"] = json!([1, 2, 3]);
            json["nodes"][2] = json!({ "name": "left leaf", "mesh": 0 });
            json["nodes"].as_array_mut().unwrap().push(json!({ "name": "left_leaf-n1", "mesh": 0 }));
        };
        let error = names(clash).unwrap_err();
        assert!(error.contains("nodes[3].name") && error.contains("left_leaf-n1"), "{error}");
    }

    #[test]
    fn what_cannot_be_loaded_is_named() {
        type Edit = fn(&mut Value);
        let edits: [(Edit, &str); 6] = [
            (|json| json["scenes"] = json!([]), "scenes"),
            (|json| json["scenes"][0]["nodes"] = json!([]), "`nodes` show no mesh"),
            (|json| json["nodes"][2]["children"] = json!([0]), "nodes[0]"),
            (|json| json["nodes"][0]["scale"] = json!([1e38, 1e38, 1e38]), "nodes["),
            (|json| json["accessors"][0]["max"] = json!([1.0]), "meshes[0].primitives[0]"),
            (
                |json| {
                    json["nodes"].as_array_mut().unwrap().push(json!({}));
                    json["skins"] = json!([{ "joints": [3] }]);
                    json["nodes"][1]["skin"] = 0.into();
                },
                "skins[0].joints",
            ),
        ];
        for (edit, named) in edits {
            // Not every number overflows on its own.
            let edit = |json: &mut Value| {
                edit(json);
                if named == "nodes[" {
                    json["nodes"][1]["scale"] = json!([1e38, 1e38, 1e38]);
                }
            };
            let error = names(edit).unwrap_err();
            assert!(error.contains("scene.gltf") && error.contains(named), "{named}: {error}");
        }
    }
}
