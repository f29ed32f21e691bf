//! The meshes of a glTF, read without an asset server: for tools that need shapes and nothing else.
//!
//! The `gltf` crate parses and checks the JSON. Its readers of vertex data trust the file, though, and panic
//! where an accessor says one thing and its buffer another, so numbers are fetched here: every offset, stride
//! and count is held against the bytes that are there. Buffers are the binary chunk of a `.glb`, `data:`
//! URIs, or files beside the glTF; what lies outside its folder is not read.
//!
//! What this does not do: skins and morph targets stay in their bind pose, compressed meshes are refused,
//! materials are not looked at.
//!
//! Khronos Group 2021, *glTF 2.0 specification*.

use std::path::{Component, Path, PathBuf};

use bevy::asset::RenderAssetUsages;
use bevy::math::{Affine3A, Mat4};
use bevy::mesh::{Indices, Mesh, PrimitiveTopology};
use gltf::accessor::sparse::IndexType;
use gltf::accessor::{Accessor, DataType, Dimensions};
use gltf::buffer::{Source, View};
use gltf::mesh::{Mode, Semantic};

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

/// A parsed file with all its bytes.
struct GltfFile<'a> {
    path: &'a Path,
    gltf: gltf::Gltf,
    buffers: Vec<Vec<u8>>,
}

/// Primitives of a mesh, put together.
#[derive(Default)]
struct Shape {
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    indices: Vec<u32>,
    /// Some of it has no texture coordinates.
    lacks_uvs: bool,
}

impl<'a> GltfFile<'a> {
    fn open(path: &'a Path) -> Result<Self, GltfMeshError> {
        let parse = |reason: String| GltfMeshError::Parse { path: path.into(), reason };
        let bytes = read_capped(path)?;
        // The length that a `.glb` claims, from which the parser takes its header off without asking.
        let claimed = bytes.get(8..12).map_or(0, |length| whole(DataType::U32, length));
        if bytes.starts_with(b"glTF") && claimed < 12 {
            return Err(parse("it is shorter than its header".into()));
        }
        let mut gltf = gltf::Gltf::from_slice(&bytes).map_err(|error| parse(error.to_string()))?;
        let mut binary_chunk = gltf.blob.take();
        let mut buffers = Vec::new();
        for buffer in gltf.document.buffers() {
            let field = format!("buffers[{}]", buffer.index());
            let content = |reason: &str| {
                Err(GltfMeshError::Content { path: path.into(), field: field.clone(), reason: reason.into() })
            };
            let bytes = match buffer.source() {
                Source::Uri(uri) => read_uri(path, &field, uri)?,
                Source::Bin => match binary_chunk.take() {
                    Some(bytes) => bytes,
                    None => return content("has no `uri`, and there is no binary chunk for it"),
                },
            };
            if bytes.len() < buffer.length() {
                return content("is longer than its data");
            }
            buffers.push(bytes);
        }
        Ok(Self { path, gltf, buffers })
    }

    fn content(&self, field: &str, reason: impl ToString) -> GltfMeshError {
        GltfMeshError::Content { path: self.path.into(), field: field.into(), reason: reason.to_string() }
    }

    /// Primitives of a mesh as one, and whether all have texture coordinates; `None` if none is made of
    /// triangles.
    fn triangles<'g>(
        &self,
        mesh: &gltf::Mesh<'g>,
        primitives: impl Iterator<Item = gltf::Primitive<'g>>,
    ) -> Result<Option<(MeshTriangles, bool)>, GltfMeshError> {
        let mut shape = Shape::default();
        for primitive in primitives {
            let field = format!("meshes[{}].primitives[{}]", mesh.index(), primitive.index());
            self.add(&mut shape, &primitive).map_err(|reason| self.content(&field, reason))?;
        }
        if shape.indices.is_empty() {
            return Ok(None);
        }
        let has_uvs = !shape.lacks_uvs;
        let mesh_of_all = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::MAIN_WORLD)
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, shape.positions)
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, shape.uvs)
            .with_inserted_indices(Indices::U32(shape.indices));
        let triangles = MeshTriangles::from_mesh(&mesh_of_all)
            .map_err(|error| self.content(&format!("meshes[{}]", mesh.index()), error))?;
        Ok(Some((triangles, has_uvs)))
    }

    /// Adds the triangles of a primitive; points and lines have none.
    fn add(&self, shape: &mut Shape, primitive: &gltf::Primitive) -> Result<(), String> {
        let mode = primitive.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(());
        }
        let positions = primitive.get(&Semantic::Positions).ok_or("has no `POSITION`")?;
        let positions: Vec<[f32; 3]> =
            self.vectors(&positions).map_err(|reason| format!("has a `POSITION` that {reason}"))?;
        let uvs = match primitive.get(&Semantic::TexCoords(0)) {
            Some(uvs) => self.vectors(&uvs).map_err(|reason| format!("has a `TEXCOORD_0` that {reason}"))?,
            None => {
                shape.lacks_uvs = true;
                vec![[0.0; 2]; positions.len()]
            }
        };
        if uvs.len() != positions.len() {
            return Err("has not as many `TEXCOORD_0` as `POSITION`".into());
        }
        let corners = match primitive.indices() {
            Some(indices) => {
                self.indices(&indices).map_err(|reason| format!("has `indices` whose accessor {reason}"))?
            }
            None => (0..positions.len() as u32).collect(),
        };
        if shape.positions.len().max(shape.indices.len()) > MAX_ELEMENTS {
            return Err(format!("belongs to a mesh of more than {MAX_ELEMENTS} vertices or indices"));
        }
        let (first, count) = (shape.positions.len() as u32, positions.len() as u32);
        // What lies beyond these vertices must not become one of the next primitive's.
        let place = |corner: u32| if corner < count { first + corner } else { u32::MAX };
        let mut push = |triangle: [u32; 3]| shape.indices.extend(triangle.map(place));
        match mode {
            Mode::Triangles => corners.chunks_exact(3).for_each(|c| push([c[0], c[1], c[2]])),
            // Every second triangle of a strip is wound the other way.
            Mode::TriangleStrip => corners.windows(3).enumerate().for_each(|(number, c)| {
                push(if number % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] });
            }),
            _ => corners.windows(2).skip(1).for_each(|c| push([corners[0], c[0], c[1]])),
        }
        shape.positions.extend(positions);
        shape.uvs.extend(uvs);
        Ok(())
    }

    /// The vectors of an accessor.
    fn vectors<const N: usize>(&self, accessor: &Accessor) -> Result<Vec<[f32; N]>, String> {
        let parts = accessor.dimensions().multiplicity();
        if parts != N {
            return Err(format!("has {parts} numbers to a vertex, not {N}"));
        }
        let (kind, normalized) = (accessor.data_type(), accessor.normalized());
        let size = kind.size();
        self.elements(accessor, size * N, |bytes| {
            std::array::from_fn(|i| number(kind, normalized, &bytes[i * size..]))
        })
    }

    /// The whole numbers of an accessor.
    fn indices(&self, accessor: &Accessor) -> Result<Vec<u32>, String> {
        let kind = accessor.data_type();
        if accessor.dimensions() != Dimensions::Scalar
            || !matches!(kind, DataType::U8 | DataType::U16 | DataType::U32)
        {
            return Err("does not hold whole numbers".into());
        }
        self.elements(accessor, kind.size(), |bytes| whole(kind, bytes))
    }

    /// The elements of an accessor, `size` bytes each, sparse or not.
    fn elements<T: Clone>(
        &self,
        accessor: &Accessor,
        size: usize,
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, String> {
        let count = accessor.count();
        if count > MAX_ELEMENTS {
            return Err(format!("has {count} elements; at most {MAX_ELEMENTS} are read"));
        }
        let mut values = match accessor.view() {
            Some(view) => self
                .read(&view, accessor.offset(), size, count, &decode)
                .ok_or("does not fit into its buffer view, or that not into its buffer")?,
            // Zero everywhere but for what the sparse part says.
            None => vec![decode(&vec![0u8; size]); count],
        };
        if let Some(sparse) = accessor.sparse() {
            let (indices, replacing) = (sparse.indices(), sparse.values());
            let kind = match indices.index_type() {
                IndexType::U8 => DataType::U8,
                IndexType::U16 => DataType::U16,
                IndexType::U32 => DataType::U32,
            };
            let places = self.read(&indices.view(), indices.offset(), kind.size(), sparse.count(), |bytes| {
                whole(kind, bytes)
            });
            let replacing = self.read(&replacing.view(), replacing.offset(), size, sparse.count(), &decode);
            let (Some(places), Some(replacing)) = (places, replacing) else {
                return Err("has a sparse part that does not fit into its buffer view".into());
            };
            for (place, value) in places.into_iter().zip(replacing) {
                *values.get_mut(place as usize).ok_or("has a sparse part that points beyond its end")? =
                    value;
            }
        }
        Ok(values)
    }

    /// `count` elements of a buffer view; `None` if they are not all there.
    fn read<T>(
        &self,
        view: &View,
        offset: usize,
        size: usize,
        count: usize,
        decode: impl Fn(&[u8]) -> T,
    ) -> Option<Vec<T>> {
        let buffer = self.buffers.get(view.buffer().index())?;
        let bytes = buffer.get(view.offset()..view.offset().checked_add(view.length())?)?.get(offset..)?;
        let stride = view.stride().unwrap_or(size);
        let needed = if count == 0 { 0 } else { stride.checked_mul(count - 1)?.checked_add(size)? };
        let fits = stride >= size && needed <= bytes.len();
        fits.then(|| (0..count).map(|i| decode(&bytes[i * stride..i * stride + size])).collect())
    }
}

/// A number of at least as many bytes as its kind has.
fn number(kind: DataType, normalized: bool, bytes: &[u8]) -> f32 {
    let (value, most) = match kind {
        DataType::I8 => (f32::from(bytes[0] as i8), 127.0),
        DataType::U8 => (f32::from(bytes[0]), 255.0),
        DataType::I16 => (f32::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32_767.0),
        DataType::U16 => (f32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65_535.0),
        DataType::U32 => (whole(kind, bytes) as f32, 1.0),
        DataType::F32 => (f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]), 1.0),
    };
    let is_float = matches!(kind, DataType::F32);
    if normalized && !is_float { (value / most).max(-1.0) } else { value }
}

/// A whole number of at least as many bytes as its kind has; 0 for kinds that are not.
fn whole(kind: DataType, bytes: &[u8]) -> u32 {
    match kind {
        DataType::U8 => bytes[0].into(),
        DataType::U16 => u16::from_le_bytes([bytes[0], bytes[1]]).into(),
        DataType::U32 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        _ => 0,
    }
}

fn read_capped(path: &Path) -> Result<Vec<u8>, GltfMeshError> {
    let read = |source| GltfMeshError::Read { path: path.into(), source };
    let size = std::fs::metadata(path).map_err(read)?.len();
    if size > MAX_FILE_BYTES {
        return Err(GltfMeshError::TooLarge { path: path.into(), size, max: MAX_FILE_BYTES });
    }
    std::fs::read(path).map_err(read)
}

/// The bytes that a URI stands for.
fn read_uri(path: &Path, field: &str, uri: &str) -> Result<Vec<u8>, GltfMeshError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let bytes = data.split_once(";base64,").and_then(|(_, encoded)| base64_decoded(encoded));
        let reason = "has a `data:` URI that is not base64".into();
        return bytes.ok_or(GltfMeshError::Content { path: path.into(), field: field.into(), reason });
    }
    let outside =
        || GltfMeshError::Outside { path: path.into(), field: format!("{field}.uri"), uri: uri.into() };
    let decoded = percent_decoded(uri).ok_or_else(outside)?;
    let relative = Path::new(&decoded);
    let plain = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
    if decoded.is_empty() || !relative.components().all(plain) {
        return Err(outside());
    }
    let read = |path: &Path, source| GltfMeshError::Read { path: path.into(), source };
    let file = path.canonicalize().map_err(|source| read(path, source))?;
    let folder = file.parent().unwrap_or(Path::new("/"));
    let named = folder.join(relative);
    let buffer = named.canonicalize().map_err(|source| read(&named, source))?;
    // A link may lead anywhere.
    if buffer.starts_with(folder) { read_capped(&buffer) } else { Err(outside()) }
}

/// A URI without its `%XX`; `None` if what they stand for is no text.
fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        let hex = (*first == b'%').then(|| std::str::from_utf8(tail.get(..2)?).ok()).flatten();
        if let Some(byte) = hex.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            bytes.push(byte);
            rest = &tail[2..];
        } else {
            bytes.push(*first);
            rest = tail;
        }
    }
    String::from_utf8(bytes).ok()
}

/// RFC 4648, with or without padding; `None` if a letter is none of its.
fn base64_decoded(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0u32, 0u32);
    for letter in text.trim_end_matches('=').bytes() {
        let value = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = (bits << 6) | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    Some(bytes)
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

    #[test]
    fn what_is_damaged_is_named_and_does_not_panic() {
        let folder = tempfile::tempdir().unwrap();
        type Edit = fn(&mut serde_json::Value);
        let edits: [(Edit, &str); 11] = [
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

    #[test]
    fn base64_and_escapes_are_decoded() {
        let cases: [(&str, &[u8]); 5] =
            [("", b""), ("Zg==", b"f"), ("Zm8=", b"fo"), ("Zm9v", b"foo"), ("+/8", b"\xfb\xff")];
        for (text, bytes) in cases {
            assert_eq!(base64_decoded(text).as_deref(), Some(bytes), "{text}");
        }
        assert_eq!(base64_decoded("Zm9v!"), None);
        assert_eq!(percent_decoded("a%20b%2Fc%").as_deref(), Some("a b/c%"));
    }
}
