//! Meshes made from a few numbers: things to lie on the ground, stand on it and hang above it.
//!
//! | file | makes |
//! |---|---|
//! | `flat` | [`ground`], [`road`] with basins for puddles in its vertex colours, [`cloth`] with folds |
//! | `ball` | [`uv_sphere`], and [`rock`], a sphere that noise has dented |
//! | `lathe` | [`vase`] and [`flowerpot`], turned from the splines of `profile` |
//! | `relief` | [`bas_relief`], a plate with what `carving` designs |
//! | `stair` | [`stair`], a flight of worn steps |
//! | `roof` | [`roof`], a slope of tiles |
//! | `car` | [`car`](fn@car), the body of a hatchback |
//!
//! Every mesh is an indexed triangle list with positions, unit normals, UVs and tangents, wound
//! counter-clockwise as seen from outside. A closed surface is cut open along one meridian: the vertices of
//! that column exist twice, with `u = 0` and `u = 1` at the same place. Seen from outside, `u` grows to the
//! right and `v` downwards, as glTF has it, so that a texture is not mirrored.
//!
//! What noise shapes takes a seed, and is the same on every run.

mod ball;
mod car;
mod carving;
#[cfg(test)]
mod checks;
mod flat;
mod grid;
mod lathe;
mod profile;
mod relief;
mod roof;
mod stair;

pub use ball::{rock, uv_sphere};
pub use car::car;
pub use flat::{cloth, ground, road};
pub use lathe::{flowerpot, vase};
pub use relief::bas_relief;
pub use roof::roof;
pub use stair::stair;

use std::f32::consts::TAU;

use bevy::asset::RenderAssetUsages;
use bevy::math::{Vec2, Vec3, Vec4};
use bevy::mesh::{GenerateTangentsError, Indices, Mesh, PrimitiveTopology};
use fastnoise_lite::{FastNoiseLite, FractalType};
use thiserror::Error;

/// Why a mesh could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A length was zero, negative or not a number.
    #[error("{what} must be a positive number of metres, got {got}")]
    NotPositive {
        /// The argument's name.
        what: &'static str,
        /// What was passed.
        got: f32,
    },
    /// There are too few pieces to make the shape.
    #[error("{what} must be at least {least}, got {got}")]
    TooFew {
        /// The argument's name.
        what: &'static str,
        /// The smallest number that works.
        least: u32,
        /// What was passed.
        got: u32,
    },
    /// The vertices cannot be counted with 32 bits.
    #[error("a mesh of {columns} by {rows} pieces has more vertices than 32-bit indices can name")]
    TooMany {
        /// Pieces along `u`.
        columns: u32,
        /// Pieces along `v`.
        rows: u32,
    },
    /// The tangents could not be computed.
    #[error("the mesh has no tangents")]
    Tangents(#[from] GenerateTangentsError),
}

/// The horizontal unit vector of a column: +Z first, then towards +X, to the right as seen from outside.
/// The last column is the first one again, to the bit.
fn meridian(column: u32, columns: u32) -> Vec3 {
    let (sin, cos) = (TAU * (column % columns) as f32 / columns as f32).sin_cos();
    Vec3::new(sin, 0.0, cos)
}

/// Fractal noise between -1 and 1 whose widest features are about one unit wide.
fn noise(seed: u32, octaves: i32) -> FastNoiseLite {
    // Each octave adds one to the seed, which must not overflow.
    let mut noise = FastNoiseLite::with_seed((seed as i32).min(i32::MAX - octaves));
    noise.set_frequency(Some(1.0));
    noise.set_fractal_type(Some(FractalType::FBm));
    noise.set_fractal_octaves(Some(octaves));
    noise
}

fn positive(what: &'static str, got: f32) -> Result<(), MeshError> {
    if got > 0.0 && got.is_finite() { Ok(()) } else { Err(MeshError::NotPositive { what, got }) }
}

fn at_least(what: &'static str, least: u32, got: u32) -> Result<(), MeshError> {
    if got >= least { Ok(()) } else { Err(MeshError::TooFew { what, least, got }) }
}

/// Vertices and triangles on their way to a [`Mesh`].
#[derive(Default)]
struct Surface {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    /// Linear; one for each vertex, or none at all.
    colors: Vec<Vec4>,
    indices: Vec<u32>,
}

impl Surface {
    /// The triangles of `columns` by `rows` quads, whose vertices are still to be pushed row by row, each
    /// row to the right and the next one below it as seen from outside.
    fn with_lattice(columns: u32, rows: u32) -> Result<Self, MeshError> {
        let too_many = MeshError::TooMany { columns, rows };
        let stride = columns.checked_add(1);
        // Two rows more, for the poles of a sphere.
        let vertices = rows.checked_add(3).zip(stride).and_then(|(rows, stride)| rows.checked_mul(stride));
        let (Some(stride), Some(_)) = (stride, vertices) else { return Err(too_many) };
        let mut surface = Self::default();
        for row in 0..rows {
            for column in 0..columns {
                let a = row * stride + column;
                let (b, c, d) = (a + 1, a + stride, a + stride + 1);
                surface.indices.extend([a, c, b, b, c, d]);
            }
        }
        Ok(surface)
    }

    fn push(&mut self, position: Vec3, normal: Vec3, uv: Vec2) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.uvs.push(uv);
        self.positions.len() as u32 - 1
    }

    fn into_mesh(self) -> Result<Mesh, MeshError> {
        let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, self.positions)
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, self.normals)
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, self.uvs)
            .with_inserted_indices(Indices::U32(self.indices))
            .with_generated_tangents()?;
        if !self.colors.is_empty() {
            mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, self.colors);
        }
        Ok(mesh)
    }
}
