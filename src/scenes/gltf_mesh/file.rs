//! A parsed file: numbers are fetched only where there are bytes for them.

use std::path::Path;

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, Mesh, PrimitiveTopology};
use gltf::accessor::sparse::IndexType;
use gltf::accessor::{Accessor, DataType, Dimensions};
use gltf::buffer::{Source, View};
use gltf::mesh::{Mode, Semantic};

use super::uri::{read_capped, read_uri};
use super::{GltfMeshError, MAX_ELEMENTS};
use crate::collision::MeshTriangles;

/// A parsed file with all its bytes.
pub(super) struct GltfFile<'a> {
    pub(super) path: &'a Path,
    pub(super) gltf: gltf::Gltf,
    buffers: Vec<Vec<u8>>,
}

/// Primitives of a mesh, put together.
#[derive(Default)]
struct Shape {
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    second_uvs: Vec<[f32; 2]>,
    indices: Vec<u32>,
    /// Some of it has no texture coordinates.
    lacks_uvs: bool,
    /// Some of it has no second ones that can be read.
    lacks_second_uvs: bool,
    /// Some of its lists of triangles have no normals.
    lacks_normals: bool,
}

impl<'a> GltfFile<'a> {
    pub(super) fn open(path: &'a Path) -> Result<Self, GltfMeshError> {
        let parse = |reason: String| GltfMeshError::Parse { path: path.into(), reason };
        let bytes = read_capped(path)?;
        // The length that a `.glb` claims, from which the parser takes its header off without asking.
        let claimed = bytes.get(8..12).map_or(0, |length| whole(DataType::U32, length));
        if bytes.starts_with(b"glTF") && claimed < 12 {
            return Err(parse("it is shorter than its header".into()));
        }
        // Its checks panic, in version 1.4, where positions are an accessor that is not there.
        let unchecked = gltf::Gltf::from_slice_without_validation(&bytes);
        let unchecked = unchecked.map_err(|error| parse(error.to_string()))?;
        let json = unchecked.document.as_json();
        let mut primitives = json.meshes.iter().flat_map(|mesh| &mesh.primitives);
        if primitives.any(|part| part.attributes.values().any(|index| index.value() >= json.accessors.len()))
        {
            return Err(parse("a primitive has an accessor that is not there".into()));
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

    pub(super) fn content(&self, field: &str, reason: impl ToString) -> GltfMeshError {
        GltfMeshError::Content { path: self.path.into(), field: field.into(), reason: reason.to_string() }
    }

    /// Primitives of a mesh as one, and whether all have texture coordinates; `None` if none is made of
    /// triangles.
    pub(super) fn triangles<'g>(
        &self,
        mesh: &gltf::Mesh<'g>,
        primitives: impl Iterator<Item = gltf::Primitive<'g>>,
    ) -> Result<Option<(MeshTriangles, bool)>, GltfMeshError> {
        let Some(shape) = self.shape(mesh, primitives)? else { return Ok(None) };
        let has_uvs = !shape.lacks_uvs;
        let mesh_of_all = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::MAIN_WORLD)
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, shape.positions)
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, shape.uvs)
            .with_inserted_indices(Indices::U32(shape.indices));
        let triangles = MeshTriangles::from_mesh(&mesh_of_all)
            .map_err(|error| self.content(&format!("meshes[{}]", mesh.index()), error))?;
        Ok(Some((triangles, has_uvs)))
    }

    /// The same with its vertices as Bevy has them, and with the texture coordinates that there are.
    pub(super) fn mesh<'g>(
        &self,
        mesh: &gltf::Mesh<'g>,
        primitives: impl Iterator<Item = gltf::Primitive<'g>>,
    ) -> Result<Option<Mesh>, GltfMeshError> {
        let Some(shape) = self.shape(mesh, primitives)? else { return Ok(None) };
        let whole = shape.indices.iter().all(|&corner| (corner as usize) < shape.positions.len());
        let mut of_all = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::MAIN_WORLD)
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, shape.positions)
            .with_inserted_indices(Indices::U32(shape.indices));
        if !shape.lacks_uvs {
            of_all.insert_attribute(Mesh::ATTRIBUTE_UV_0, shape.uvs);
        }
        if !shape.lacks_second_uvs {
            of_all.insert_attribute(Mesh::ATTRIBUTE_UV_1, shape.second_uvs);
        }
        // Bevy makes them flat.
        if shape.lacks_normals && whole {
            of_all.duplicate_vertices();
        }
        Ok(Some(of_all))
    }

    /// Primitives of a mesh, put together; `None` if none is made of triangles.
    fn shape<'g>(
        &self,
        mesh: &gltf::Mesh<'g>,
        primitives: impl Iterator<Item = gltf::Primitive<'g>>,
    ) -> Result<Option<Shape>, GltfMeshError> {
        let mut shape = Shape::default();
        for primitive in primitives {
            let field = format!("meshes[{}].primitives[{}]", mesh.index(), primitive.index());
            self.add(&mut shape, &primitive).map_err(|reason| self.content(&field, reason))?;
        }
        Ok((!shape.indices.is_empty()).then_some(shape))
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
        let second_uvs = primitive
            .get(&Semantic::TexCoords(1))
            .and_then(|uvs| self.vectors::<2>(&uvs).ok())
            .filter(|uvs| uvs.len() == positions.len());
        shape.lacks_second_uvs |= second_uvs.is_none();
        shape.lacks_normals |= mode == Mode::Triangles && primitive.get(&Semantic::Normals).is_none();
        let corners = match primitive.indices() {
            Some(indices) => {
                self.indices(&indices).map_err(|reason| format!("has `indices` whose accessor {reason}"))?
            }
            None => (0..positions.len() as u32).collect(),
        };
        let more = match mode {
            Mode::Triangles => corners.len(),
            _ => 3 * corners.len().saturating_sub(2),
        };
        if (shape.positions.len() + positions.len()).max(shape.indices.len() + more) > MAX_ELEMENTS {
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
        shape.second_uvs.extend(second_uvs.unwrap_or_default());
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

    /// The elements of an accessor with a buffer view, `size` bytes each, sparse or not.
    fn elements<T>(
        &self,
        accessor: &Accessor,
        size: usize,
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, String> {
        let count = accessor.count();
        if count > MAX_ELEMENTS {
            return Err(format!("has {count} elements; at most {MAX_ELEMENTS} are read"));
        }
        let view = accessor.view().ok_or("has no `bufferView`")?;
        let mut values = self
            .read(&view, accessor.offset(), size, count, &decode)
            .ok_or("does not fit into its buffer view, or that not into its buffer")?;
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
