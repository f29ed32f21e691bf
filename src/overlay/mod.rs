//! The maps of a surface, and painting impacts into them.
//!
//! Every [`Weatherable`] mesh gets overlay maps over its uv square, or over that of a second set of uvs ([`OverlayUv`]):
//! three colour maps that lie over its material's own: diffuse, specular, normal. An impact becomes a [`Splat`] ([`deposit`]), and splats are painted in the order of their
//! impacts. Their water goes another way, to [`wetting`](crate::wetting).
//!
//! Two painters do the same arithmetic, in integers, so that they agree to the bit: a compute pass
//! ([`GpuOverlayPlugin`]) that sorts splats into tiles and visits each touched texel once, and a plain loop over
//! splats ([`CpuOverlayPlugin`]) for runs without a renderer and as the reference for tests. The arithmetic is
//! in [`kernel`], with a WGSL twin. What is drawn has mip maps: what was painted is halved, level by level (`mips.rs`).
//!
//! # Wraparound
//! A stamp over the edge of the map continues at the opposite edge ([`Wrap::Repeat`]) or ends there
//! ([`Wrap::Clamp`]).
//!
//! # How large maps are
//! All maps share a [`MapBudget`]. A surface has none until that gives it a [`MapSize`] (`pool`).

mod atlas;
mod budget;
mod cpu;
pub mod deposit;
mod frames;
mod gpu;
pub mod kernel;
mod maps;
mod mips;
mod pool;
mod resample;
mod site;
mod splat;
mod stamping;
mod tiles;

use bevy::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use atlas::StampAtlas;
pub use budget::SplatBudget;
pub use cpu::{CpuMaps, CpuOverlayPlugin};
pub(crate) use deposit::measure_texels;
pub use deposit::{DepositPlugin, SplatQueue, StampSystems, SurfaceTotals, SurfaceTraces};
pub(crate) use frames::FramesWork;
pub use frames::{SurfaceFrames, TexelFrame};
pub use gpu::{GpuOverlayPlugin, MipStep, Overlays, SplatStats, SurfaceBatch};
pub(crate) use maps::Footprint;
pub use maps::{RainRing, TexelArea, TexelAreas};
pub use mips::{Lying, mip_chain, mip_levels};
pub use pool::{
    MapBudget, MapLoss, MapNeed, MapPool, MapSize, MapSizeSystems, SurfaceEvicted, SurfaceResized, Unmapped,
};
pub(crate) use pool::{
    can_put_size, can_resume_resizing, is_resizing, put_first_size, put_size, resizing_of, resume_resizing,
};
pub(crate) use resample::is_reached;
pub use splat::Splat;
pub use tiles::{TILE_SIZE, TileBins, TileHeader};

/// Makes a mesh entity weatherable: it can be hit, and shows what hit it.
///
/// Goes on the entity that has the `Mesh3d`, and needs a mesh with texture coordinates, or one that can be unwrapped
/// ([`OverlayUv`]). Where a `StandardMaterial` is on the entity, it is exchanged for its weathered form with the same settings.
#[derive(Component, Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default)]
#[serde(deny_unknown_fields, default)]
pub struct Weatherable {
    /// The most texels along each side of the maps; a multiple of [`TILE_SIZE`] from 16 to [`Self::MAX_MAP_SIZE`]. As many
    /// as there are, unless [`MapBudget`] makes do with fewer: see [`MapSize`].
    pub map_size: u32,
    /// What happens at the left and right edge of the maps.
    pub wrap_u: Wrap,
    /// What happens at the upper and lower edge of the maps.
    pub wrap_v: Wrap,
    /// Where stamps lie.
    pub stamps: StampSpace,
    /// Which texture coordinates the maps lie over. For setting up: what has fallen already keeps its place on the map, not
    /// on the mesh.
    pub uv: OverlayUv,
}

/// Which texture coordinates the maps of a surface lie over. Textures of its material keep the ones they have.
///
/// A mesh that gets unique ones is shown as a copy that has them as `UV_1`
/// ([`unwrap`](crate::unwrap)); stamps on the map of such a surface ([`StampSpace::Map`]) end best at its edges
/// ([`Wrap::Clamp`]), since what lies at the opposite one is another part of the mesh.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Default)]
pub enum OverlayUv {
    /// Unique ones, if those of the mesh are not: if they tile, lie on each other or in single points, or are not there. Then a
    /// `UV_1` of the mesh that is unique is taken as it is; one that is not is left alone, as something may be drawn by it, and
    /// so are uvs that cannot be unwrapped, with a warning. Uvs inside 0..1 that do not lie on each other stay, and so do those
    /// under stamps on the map ([`StampSpace::Map`]): who asks for these wants them in every tile.
    #[default]
    Auto,
    /// `UV_0` of the mesh, whatever it is like: what falls on one place of a tiled mesh shows in all its tiles.
    Mesh,
    /// Like `Auto`, but also under stamps on the map and in place of a `UV_1` that is not unique, and an error where it cannot
    /// be.
    Unique,
}

/// Where the stamps of a surface lie.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Default)]
pub enum StampSpace {
    /// On the surface: round whatever the uvs do to it, across the borders of uv islands and never on a neighbour in the
    /// image. Takes 16 bytes a texel once something is painted, twice with a renderer. On surfaces that are posed a stamp is round
    /// in the pose in which it came to be, and moves and stretches with the surface from then on.
    #[default]
    Surface,
    /// On the map: over its edges by [`Wrap`], into every tile of tiled uvs.
    Map,
}

/// What happens to a stamp at an edge of the map.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Default)]
pub enum Wrap {
    /// It goes on at the opposite edge; uvs outside 0..1 tile.
    #[default]
    Repeat,
    /// It ends; uvs outside 0..1 are taken as the edge.
    Clamp,
}

impl Weatherable {
    /// The largest map: 16,384 tiles.
    pub const MAX_MAP_SIZE: u32 = 2048;

    /// `map_size`, brought into the range that is allowed.
    pub fn texels(&self) -> u32 {
        self.map_size.clamp(TILE_SIZE, Self::MAX_MAP_SIZE).next_multiple_of(TILE_SIZE)
    }

    /// What `uv` comes to with these `stamps`: [`OverlayUv::Auto`] leaves stamps on the map the uvs of the mesh.
    pub fn wanted_uv(&self) -> OverlayUv {
        match (self.uv, self.stamps) {
            (OverlayUv::Auto, StampSpace::Map) => OverlayUv::Mesh,
            (wanted, _) => wanted,
        }
    }

    /// Edge behaviour along u and v.
    pub fn wrap(&self) -> [Wrap; 2] {
        [self.wrap_u, self.wrap_v]
    }
}

impl Default for Weatherable {
    fn default() -> Self {
        Self {
            map_size: 512,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            stamps: StampSpace::default(),
            uv: OverlayUv::default(),
        }
    }
}
