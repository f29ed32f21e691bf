//! A second set of texture coordinates for a mesh, in which nothing lies on anything else.
//!
//! `uvunwrap` cuts the mesh into charts, flattens them and packs them. Here its charts become a mesh again: a vertex
//! that lies on the border of charts is there once for each of them, with all that it had before. This file alone knows
//! that crate.
//!
//! Texels are square: the charts are not stretched to fill the map, so that what is round on the mesh is round on the
//! map. Nor are they mirrored: what is on the left in front of the mesh is on the left in the image. The same mesh gives
//! the same bytes.

use bevy::mesh::morph::MorphAttributes;
use bevy::mesh::{Indices, MeshAccessError, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use uvunwrap::Density;

use super::UnwrapError;

/// How a mesh is unwrapped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct UnwrapOptions {
    /// Texels along each side of the map that the charts are packed for.
    pub map_size: u32,
    /// Empty texels of that map around each chart, and to the edges of the map; so twice as many between two charts.
    pub gutter: u32,
    /// Whether a `UV_1` that the mesh has is replaced; otherwise such a mesh is refused, as something may be drawn by it.
    pub replace: bool,
}

impl Default for UnwrapOptions {
    fn default() -> Self {
        Self { map_size: 512, gutter: 2, replace: false }
    }
}

/// The same triangles in the same order, as an indexed list, with [`Mesh::ATTRIBUTE_UV_1`] in [0, 1] in which no two
/// points of the surface share a place. Every other attribute, joints and morph targets too, has for each corner of each
/// triangle the value that it had; a `UV_1` that was there is replaced, if it may be.
///
/// # Errors
/// [`UnwrapError`]: a mesh that is not made of triangles or is not whole, a map too small for it, a `UV_1` that is to stay.
pub fn unwrapped(mesh: &Mesh, options: &UnwrapOptions) -> Result<Mesh, UnwrapError> {
    if !options.replace && mesh.try_contains_attribute(Mesh::ATTRIBUTE_UV_1).map_err(on_cpu)? {
        return Err(UnwrapError::SecondUvsTaken);
    }
    let positions = match mesh.try_attribute_option(Mesh::ATTRIBUTE_POSITION).map_err(on_cpu)? {
        Some(VertexAttributeValues::Float32x3(positions)) => positions.as_slice(),
        _ => return Err(UnwrapError::NoPositions),
    };
    let corners = corners(mesh, positions.len())?;
    let charts = Charts::new(positions, &corners, options)?;
    charts.applied_to(mesh, positions.len())
}

fn on_cpu(_: MeshAccessError) -> UnwrapError {
    UnwrapError::NotOnCpu
}

/// Three vertices for each triangle.
fn corners(mesh: &Mesh, vertices: usize) -> Result<Vec<u32>, UnwrapError> {
    let indices = mesh.try_indices_option().map_err(on_cpu)?;
    let mut all: Vec<u32> = match indices {
        None => (0..vertices as u32).collect(),
        Some(Indices::U16(indices)) => indices.iter().copied().map(u32::from).collect(),
        Some(Indices::U32(indices)) => indices.clone(),
    };
    match mesh.primitive_topology() {
        PrimitiveTopology::TriangleList => {
            all.truncate(all.len() / 3 * 3);
            Ok(all)
        }
        PrimitiveTopology::TriangleStrip => {
            let restart = match indices {
                None => None,
                Some(Indices::U16(_)) => Some(u32::from(u16::MAX)),
                Some(Indices::U32(_)) => Some(u32::MAX),
            };
            Ok(strip_corners(&all, restart))
        }
        topology => Err(UnwrapError::Topology(topology)),
    }
}

/// The triangles of a strip; `restart` is the index that begins another one.
fn strip_corners(indices: &[u32], restart: Option<u32>) -> Vec<u32> {
    let mut corners = Vec::with_capacity(indices.len().saturating_sub(2) * 3);
    let (mut last, mut length) = ([0; 2], 0);
    for &index in indices {
        if restart == Some(index) {
            length = 0;
            continue;
        }
        if length >= 2 {
            let [a, b] = last;
            // Every second triangle of a strip is wound the other way.
            corners.extend(if length % 2 == 0 { [a, b, index] } else { [a, index, b] });
        }
        (last, length) = ([last[1], index], length + 1);
    }
    corners
}

/// A mesh cut into charts: its new vertices, and the triangles between them.
struct Charts {
    /// The old vertex that each new one is.
    vertices: Vec<u32>,
    /// Of each new vertex.
    uvs: Vec<[f32; 2]>,
    /// Three new vertices for each triangle, in the old order.
    corners: Vec<u32>,
}

impl Charts {
    fn new(positions: &[[f32; 3]], corners: &[u32], options: &UnwrapOptions) -> Result<Self, UnwrapError> {
        let UnwrapOptions { map_size, gutter, .. } = *options;
        if map_size <= gutter.saturating_mul(2) {
            return Err(UnwrapError::MapTooSmall { map_size, gutter });
        }
        let settings = uvunwrap::Options {
            density: Density::Auto { page_size: map_size },
            padding: gutter,
            // A chart is cut where its triangles get more than this times their share of the map, or less than one
            // by it: its texels stand for much the same area.
            max_area_distortion: 2.0,
            ..uvunwrap::Options::default()
        };
        let atlas = uvunwrap::generate(&[uvunwrap::MeshInput::new(positions, corners)], &settings).map_err(
            |error| match error {
                uvunwrap::Error::ChartTooLarge { .. } => UnwrapError::MapTooSmall { map_size, gutter },
                error => UnwrapError::BadMesh(error.to_string()),
            },
        )?;
        let Some(pieces) = atlas.meshes.first().filter(|_| atlas.chart_count > 0) else {
            return Err(UnwrapError::Empty);
        };
        // The atlas ends where its last chart does; uvs are parts of what is left of it.
        let scale = [atlas.width, atlas.height].map(|texels| texels as f32 / map_size as f32);
        if atlas.page_count > 1 || scale.iter().any(|&part| part > 1.0) {
            return Err(UnwrapError::DoesNotFit { charts: atlas.chart_count, map_size });
        }
        Ok(Self {
            vertices: pieces.vertices.iter().map(|vertex| vertex.xref).collect(),
            // It lets v grow upwards, images have their first row on top.
            uvs: pieces.vertices.iter().map(|v| [v.uv[0] * scale[0], 1.0 - v.uv[1] * scale[1]]).collect(),
            corners: pieces.indices.clone(),
        })
    }

    /// The mesh, with a vertex for each of ours.
    fn applied_to(self, mesh: &Mesh, vertices: usize) -> Result<Mesh, UnwrapError> {
        let mut cut = Mesh::new(PrimitiveTopology::TriangleList, mesh.asset_usage);
        for (attribute, values) in mesh.try_attributes().map_err(on_cpu)? {
            if attribute.id == Mesh::ATTRIBUTE_UV_1.id {
                continue;
            }
            if values.len() != vertices {
                let (name, found) = (attribute.name, values.len());
                return Err(UnwrapError::AttributeLength { name, found, vertices });
            }
            cut.try_insert_attribute(*attribute, values.clone()).map_err(on_cpu)?;
        }
        if mesh.try_has_morph_targets().map_err(on_cpu)? {
            let targets = mesh.try_morph_targets().map_err(on_cpu)?;
            cut.try_set_morph_targets(self.morphed(targets, vertices)?).map_err(on_cpu)?;
        }
        if let Some(names) = mesh.try_morph_target_names().map_err(on_cpu)? {
            cut.try_set_morph_target_names(names.to_vec()).map_err(on_cpu)?;
        }
        let short = matches!(mesh.try_indices_option().map_err(on_cpu)?, Some(Indices::U16(_)))
            && self.vertices.len() <= usize::from(u16::MAX);
        let corners = if short {
            Indices::U16(self.corners.iter().map(|&corner| corner as u16).collect())
        } else {
            Indices::U32(self.corners)
        };
        // Bevy's way to give each index a vertex of its own knows all formats of attributes.
        cut.try_insert_indices(Indices::U32(self.vertices)).map_err(on_cpu)?;
        cut.try_duplicate_vertices().map_err(on_cpu)?;
        cut.try_insert_attribute(Mesh::ATTRIBUTE_UV_1, self.uvs).map_err(on_cpu)?;
        cut.try_insert_indices(corners).map_err(on_cpu)?;
        cut.enable_raytracing = mesh.enable_raytracing;
        cut.final_aabb = mesh.final_aabb;
        cut.set_skinned_mesh_bounds(mesh.skinned_mesh_bounds().cloned());
        Ok(cut)
    }

    /// Rows of morph targets, one target after the other, for our vertices.
    fn morphed(
        &self,
        rows: &[MorphAttributes],
        vertices: usize,
    ) -> Result<Vec<MorphAttributes>, UnwrapError> {
        if !rows.len().is_multiple_of(vertices) {
            return Err(UnwrapError::MorphTargets { found: rows.len(), vertices });
        }
        let targets = rows.chunks_exact(vertices);
        Ok(targets.flat_map(|target| self.vertices.iter().map(move |&old| target[old as usize])).collect())
    }
}
