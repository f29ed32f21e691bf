//! The meshes of a glTF, read without an asset server: for tools that need shapes and nothing else.
//!
//! The `gltf` crate parses and checks the JSON. Its readers of vertex data trust the file, though, and panic
//! where an accessor says one thing and its buffer another, so numbers are fetched here: every offset, stride
//! and count is held against the bytes that are there. Buffers are the binary chunk of a `.glb`, `data:`
//! URIs, or files beside the glTF; what lies outside its folder is not read. An accessor without a buffer view,
//! zero but for a sparse part, is refused: a few bytes could ask for any amount of memory.
//!
//! [`read_meshes`] has the shapes of a scene, a mesh for each node; [`read_layout`] has its nodes and primitives without their
//! numbers, for those who have them loaded by Bevy.
//!
//! What this does not do: skins and morph targets stay in their bind pose, compressed meshes are refused,
//! materials are not looked at.
//!
//! Khronos Group 2021, *glTF 2.0 specification*.

mod file;
mod layout;
#[cfg(test)]
pub(crate) mod test_file;
mod uri;

use std::path::{Path, PathBuf};

use bevy::math::{Affine3A, Mat4};
use bevy::mesh::Mesh;

use self::file::GltfFile;
pub(crate) use self::layout::plain_name;
pub use self::layout::{SceneLayout, SceneNode, ScenePart, SceneSkin, read_layout, read_parts};
pub(crate) use self::uri::{data_uri, percent_decoded, read_capped, read_uri};
use crate::collision::MeshTriangles;

/// A mesh where it stands in its scene.
#[derive(Debug, Clone)]
pub struct NamedMesh {
    /// Name of its node or, if that has none, of the mesh; else `mesh` and its number.
    pub name: String,
    /// Name of the mesh, which several nodes may show.
    pub mesh_name: Option<String>,
    /// The triangles of all its primitives, in the space of the mesh.
    pub triangles: MeshTriangles,
    /// From the space of the mesh to that of the scene.
    pub transform: Affine3A,
    /// Whether all of it has texture coordinates. Without them, those of `triangles` are 0: it can be in the
    /// way, but has no map.
    pub has_uvs: bool,
}

/// Why the meshes of a glTF could not be read. Every variant names the file.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum GltfMeshError {
    /// A file cannot be read.
    #[error("{}: cannot be read: {source}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file is too large.
    #[error("{}: has {size} bytes; at most {max} are read (MAX_FILE_BYTES)", .path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Bytes.
        size: u64,
        /// The cap.
        max: u64,
    },
    /// A file is no glTF, or breaks its rules.
    #[error("{}: not a glTF that can be read: {reason}", .path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Where and what.
        reason: String,
    },
    /// A buffer that lies outside the folder of the glTF.
    #[error("{}: `{field}` is \"{uri}\", which is outside the folder of the file", .path.display())]
    Outside {
        /// The file.
        path: PathBuf,
        /// Path of the field.
        field: String,
        /// The URI.
        uri: String,
    },
    /// Something in the file cannot be used.
    #[error("{}: `{field}` {reason}", .path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Path of the field.
        field: String,
        /// What is wrong with it.
        reason: String,
    },
}

/// The largest file that is read, and the largest buffer.
pub const MAX_FILE_BYTES: u64 = 2 << 30;

/// The most vertices of a mesh, and the most indices.
const MAX_ELEMENTS: usize = 100_000_000;

/// Every mesh of the default scene (the first, if none is) that has triangles, in the order of its nodes.
///
/// # Errors
/// [`GltfMeshError`]; also if there is no such mesh.
pub fn read_meshes(path: &Path) -> Result<Vec<NamedMesh>, GltfMeshError> {
    let file = GltfFile::open(path)?;
    let document = &file.gltf.document;
    let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) else {
        return Err(file.content("scenes", "is empty"));
    };
    let mut waiting: Vec<(gltf::Node, Mat4)> = scene.nodes().map(|node| (node, Mat4::IDENTITY)).collect();
    // The next is taken from the end.
    waiting.reverse();
    let mut seen = vec![false; document.nodes().count()];
    let mut meshes = Vec::new();
    let mut elements = 0;
    while let Some((node, scene_from_parent)) = waiting.pop() {
        let field = format!("nodes[{}]", node.index());
        if std::mem::replace(&mut seen[node.index()], true) {
            // A tree, by the specification; in a ring this would go on for ever.
            return Err(file.content(&field, "is in the scene twice"));
        }
        let scene_from_node = scene_from_parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        if !scene_from_node.is_finite() {
            return Err(file.content(&field, "has a transform that is not finite"));
        }
        if let Some(mesh) = node.mesh()
            && let Some((triangles, has_uvs)) = file.triangles(&mesh, mesh.primitives())?
        {
            // A mesh that many nodes show is read for each of them.
            elements += triangles.positions.len() * 3;
            if elements > MAX_ELEMENTS {
                return Err(
                    file.content(&field, format!("and those before show more than {MAX_ELEMENTS} corners"))
                );
            }
            let name = node.name().or(mesh.name()).map(String::from);
            meshes.push(NamedMesh {
                name: name.unwrap_or_else(|| format!("mesh{}", mesh.index())),
                mesh_name: mesh.name().map(String::from),
                triangles,
                transform: Affine3A::from_mat4(scene_from_node),
                has_uvs,
            });
        }
        let below = waiting.len();
        waiting.extend(node.children().map(|child| (child, scene_from_node)));
        waiting[below..].reverse();
    }
    if meshes.is_empty() { Err(file.content("nodes", "show no mesh of triangles")) } else { Ok(meshes) }
}

/// The first primitive of the first mesh in its own space, which is what Bevy calls `Mesh0/Primitive0`.
///
/// # Errors
/// [`GltfMeshError`]; also if it has no triangles or no texture coordinates.
pub fn read_first_primitive(path: &Path) -> Result<MeshTriangles, GltfMeshError> {
    let file = GltfFile::open(path)?;
    let Some(mesh) = file.gltf.document.meshes().next() else {
        return Err(file.content("meshes", "is empty"));
    };
    let field = "meshes[0].primitives[0]";
    match file.triangles(&mesh, mesh.primitives().take(1))? {
        Some((triangles, true)) => Ok(triangles),
        Some((_, false)) => Err(file.content(field, "has no `TEXCOORD_0`")),
        None => Err(file.content(field, "has no triangles")),
    }
}

/// The same with its vertices and the texture coordinates that it has, first or second: what it takes to unwrap it as Bevy's
/// would be.
///
/// # Errors
/// [`GltfMeshError`]; also if it has no triangles.
pub fn read_first_primitive_mesh(path: &Path) -> Result<Mesh, GltfMeshError> {
    let file = GltfFile::open(path)?;
    let Some(mesh) = file.gltf.document.meshes().next() else {
        return Err(file.content("meshes", "is empty"));
    };
    file.mesh(&mesh, mesh.primitives().take(1))?
        .ok_or_else(|| file.content("meshes[0].primitives[0]", "has no triangles"))
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;

    /// Three corners as floats, indices as bytes (padded), uvs as normalized bytes with a stride of 4.
    fn triangle_bytes() -> Vec<u8> {
        let mut bytes: Vec<u8> = Vec::new();
        for value in [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend([0, 1, 2, 0]);
        bytes.extend([0, 0, 9, 9, 255, 0, 9, 9, 0, 51, 9, 9]);
        bytes
    }

    /// A scene in which a node carries another one that shows the triangle; `edit` makes it another file.
    fn file(folder: &Path, edit: impl FnOnce(&mut serde_json::Value)) -> PathBuf {
        let mut json = serde_json::json!({
            "asset": { "version": "2.0" },
            "scenes": [{ "nodes": [0] }],
            "nodes": [
                { "name": "carrier", "translation": [0.0, 5.0, 0.0], "children": [1] },
                { "name": "leaf", "mesh": 0, "scale": [2.0, 2.0, 2.0] },
            ],
            "meshes": [{ "name": "shape", "primitives": [
                { "attributes": { "POSITION": 0, "TEXCOORD_0": 2 }, "indices": 1 }
            ] }],
            "buffers": [{ "uri": "some%20data.bin", "byteLength": 52 }],
            "bufferViews": [
                { "buffer": 0, "byteOffset": 0, "byteLength": 36 },
                { "buffer": 0, "byteOffset": 36, "byteLength": 4 },
                { "buffer": 0, "byteOffset": 40, "byteLength": 12, "byteStride": 4 },
            ],
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                  "min": [0.0, 0.0, 0.0], "max": [1.0, 1.0, 0.0] },
                { "bufferView": 1, "componentType": 5121, "count": 3, "type": "SCALAR" },
                { "bufferView": 2, "componentType": 5121, "normalized": true, "count": 3, "type": "VEC2" },
            ],
        });
        edit(&mut json);
        std::fs::write(folder.join("some data.bin"), triangle_bytes()).unwrap();
        let path = folder.join("scene.gltf");
        std::fs::write(&path, json.to_string()).unwrap();
        path
    }

    #[test]
    fn meshes_stand_where_their_nodes_put_them() {
        let folder = tempfile::tempdir().unwrap();
        let meshes = read_meshes(&file(folder.path(), |_| {})).unwrap();
        let [mesh] = meshes.as_slice() else { panic!("{} meshes", meshes.len()) };
        assert_eq!((mesh.name.as_str(), mesh.mesh_name.as_deref()), ("leaf", Some("shape")));
        assert!(mesh.has_uvs);
        assert_eq!(mesh.triangles.positions, [[Vec3::ZERO, Vec3::X, Vec3::Y]]);
        let [a, b, c] = mesh.triangles.uvs[0].map(|uv| uv.to_array());
        assert_eq!((a, b, c), ([0.0, 0.0], [1.0, 0.0], [0.0, 0.2]));
        assert_eq!(mesh.transform.transform_point3(Vec3::X), Vec3::new(2.0, 5.0, 0.0));
        let first = read_first_primitive(&folder.path().join("scene.gltf")).unwrap();
        assert_eq!(first, mesh.triangles);
    }

    #[test]
    fn data_uris_fans_and_missing_uvs_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = file(folder.path(), |json| {
            // The nine floats alone, which a fan of three corners needs.
            let floats = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
            let uri = format!("data:application/octet-stream;base64,{floats}");
            json["buffers"][0] = serde_json::json!({ "uri": uri, "byteLength": 36 });
            json["meshes"][0]["primitives"][0] =
                serde_json::json!({ "attributes": { "POSITION": 0 }, "mode": 6 });
        });
        let meshes = read_meshes(&path).unwrap();
        assert_eq!(meshes[0].triangles.positions, [[Vec3::ZERO, Vec3::X, Vec3::Y]]);
        assert!(!meshes[0].has_uvs);
        assert!(read_first_primitive(&path).unwrap_err().to_string().contains("TEXCOORD_0"));
    }

    #[test]
    fn a_binary_file_of_the_repository_is_read_whole() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/bunny_1000.glb");
        let triangles = read_first_primitive(&path).unwrap();
        assert!(triangles.positions.len() > 900, "{}", triangles.positions.len());
        assert_eq!(read_meshes(&path).unwrap()[0].triangles, triangles);
    }

    /// Nothing but a sparse part is left of an accessor.
    fn without_view(json: &mut serde_json::Value, accessor: usize) {
        let accessor = &mut json["accessors"][accessor];
        accessor.as_object_mut().unwrap().remove("bufferView");
        accessor["sparse"] = serde_json::json!({
            "count": 1,
            "indices": { "bufferView": 1, "componentType": 5121 },
            "values": { "bufferView": 0 },
        });
    }

    #[test]
    fn what_is_damaged_is_named_and_does_not_panic() {
        let folder = tempfile::tempdir().unwrap();
        type Edit = fn(&mut serde_json::Value);
        let edits: [(Edit, &str); 15] = [
            (|json| without_view(json, 0), "`POSITION` that has no `bufferView`"),
            (|json| without_view(json, 1), "`indices` whose accessor has no `bufferView`"),
            (|json| without_view(json, 2), "`TEXCOORD_0` that has no `bufferView`"),
            (|json| json["buffers"][0]["uri"] = "some%ffdata.bin".into(), "escapes"),
            (|json| json["buffers"][0]["uri"] = "../some data.bin".into(), "buffers[0].uri"),
            (|json| json["buffers"][0]["uri"] = "/etc/hostname".into(), "outside"),
            (|json| json["buffers"][0]["uri"] = "gone.bin".into(), "gone.bin"),
            (|json| json["buffers"][0]["uri"] = "data:x;base64,*".into(), "base64"),
            (|json| json["buffers"][0]["byteLength"] = 53.into(), "longer than its data"),
            (|json| json["buffers"][0] = serde_json::json!({ "byteLength": 52 }), "binary chunk"),
            (|json| json["accessors"][0]["count"] = 4.into(), "POSITION"),
            (|json| json["accessors"][1]["componentType"] = 5126.into(), "indices"),
            (|json| json["accessors"][2]["type"] = "VEC3".into(), "TEXCOORD_0"),
            (|json| json["nodes"][1]["children"] = serde_json::json!([0]), "nodes[0]"),
            (|json| json["nodes"][1]["mesh"] = 7.into(), "scene.gltf"),
        ];
        for (edit, named) in edits {
            let error = read_meshes(&file(folder.path(), edit)).unwrap_err().to_string();
            assert!(error.contains("scene.gltf") || error.contains("gone.bin"), "{error}");
            assert!(error.contains(named), "{named}: {error}");
        }
        let torn: [&[u8]; 5] = [b"glTF", b"glTF\x02\0\0\0\0\0\0\0", b"glTF\x02\0\0\0\xff\xff\0\0", b"{", b""];
        for torn in torn {
            let path = folder.path().join("torn.glb");
            std::fs::write(&path, torn).unwrap();
            let error = read_meshes(&path).unwrap_err().to_string();
            assert!(error.contains("torn.glb"), "{error}");
        }
        assert!(read_meshes(&folder.path().join("nowhere.glb")).is_err());
    }
}
