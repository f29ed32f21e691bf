//! One budget for the maps of all surfaces.
//!
//! A surface gets its [`MapSize`] before anything is measured for it, and everything that has texels is made for that size:
//! colour maps, water, matter, frames. What decides it:
//!
//! 1. Each surface wishes for a side: [`Weatherable::map_size`], or as many texels as make them [`MapBudget::texel`] wide
//!    in the world, where that is fewer.
//! 2. If all wishes fit into the budget, they are granted at once. Else everything that is there is waited for, and sides are
//!    halved, those with the finest texels in the world first, until they fit (`plan`).
//! 3. A surface that comes later gets what is left. If not even the smallest maps are, the surface that was hit longest ago
//!    loses its own (`release`): they are dropped, what lay on it is entered in its [`MapLoss`], and a warning and
//!    [`SurfaceEvicted`] say so. It gets new ones when there is room.
//! 4. Where nothing can be taken from anybody, a surface stays [`Unmapped`], which is an error in the log. What falls on it
//!    is entered as lost, too.
//!
//! What a surface is charged with is all that it may come to hold on the GPU by the effects that there are: so maps that are
//! only made when the first drop falls cannot fail then. All of this is decided from the main world's state alone: the same
//! with and without a renderer, and in the order in which surfaces were spawned.
//!
//! Not here: maps that are moved to another size with what is on them.

mod loss;
mod plan;
mod release;
mod size;
mod tally;

use bevy::prelude::*;
use serde::Serialize;

use super::{Weatherable, Wrap};
use crate::collision::BuildColliders;
use crate::effect::RefreshEffects;

pub use loss::MapLoss;
pub use plan::MapNeed;

/// How much memory of the GPU the maps of all surfaces may take, and how fine they are. May be changed at any time: what
/// does not fit any more is evicted.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource)]
pub struct MapBudget {
    /// Bytes of all maps and of the water and matter that is drawn.
    pub bytes: u64,
    /// Width of a texel in the world, metres, above 0. Maps are as large as that takes, but not larger than
    /// [`Weatherable::map_size`]; `None` makes them that large.
    pub texel: Option<f32>,
}

impl MapBudget {
    /// The fewest texels along a side that a surface's maps are reduced to.
    pub const SMALLEST_SIDE: u32 = 64;
}

impl Default for MapBudget {
    fn default() -> Self {
        Self { bytes: 256 << 20, texel: None }
    }
}

/// The size of a surface's maps, from when it is decided until they are taken away.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Component)]
pub struct MapSize {
    texels: u32,
    /// What the surface's own settings were, so that a change of them is seen.
    limit: u32,
    wrap: [Wrap; 2],
}

impl MapSize {
    /// As large as the surface's settings allow.
    pub fn whole(surface: &Weatherable) -> Self {
        Self::reduced(surface, surface.texels())
    }

    fn reduced(surface: &Weatherable, texels: u32) -> Self {
        Self { texels, limit: surface.texels(), wrap: surface.wrap() }
    }

    /// Texels along each side; a multiple of [`TILE_SIZE`](super::TILE_SIZE).
    pub fn texels(&self) -> u32 {
        self.texels
    }

    fn is_for(&self, surface: &Weatherable) -> bool {
        (self.limit, self.wrap) == (surface.texels(), surface.wrap())
    }
}

/// A surface that has no maps: nothing that falls on it stays.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Component)]
pub enum Unmapped {
    /// There was no room for it.
    Refused,
    /// Its maps were taken for another.
    Evicted,
}

/// A surface's place in the order in which surfaces were spawned.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
struct SurfaceOrder(u64);

/// The maps of all surfaces, in numbers. Brought to the present once a frame.
#[derive(Resource, Reflect, Serialize, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Resource)]
pub struct MapPool {
    /// Bytes on the GPU of what surfaces hold. Without a renderer: what it would be with one.
    pub used: u64,
    /// Bytes that surfaces are charged with: what they may come to hold.
    pub reserved: u64,
    /// Surfaces that have maps.
    pub mapped: u32,
    /// Surfaces that have none, for want of room.
    pub unmapped: u32,
    /// Times that a surface lost its maps to the budget.
    pub evictions: u64,
    /// Surfaces that were refused maps.
    pub refusals: u64,
    /// Number of the next surface that is spawned.
    #[serde(skip)]
    next_order: u64,
    /// Bytes that the first of the surfaces without maps needs; 0 if it should be tried.
    #[serde(skip)]
    next_bytes: u64,
    /// By which surfaces are charged.
    #[serde(skip)]
    falling: size::Falling,
}

/// A surface has lost its maps to the budget.
#[derive(Message, Reflect, Debug, Clone, Copy, PartialEq)]
pub struct SurfaceEvicted {
    /// The surface.
    pub surface: Entity,
    /// What was on it.
    pub lost: MapLoss,
}

/// In `PreUpdate`, after colliders: surfaces get the size of their maps, or lose them.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SizeMaps;

pub(super) fn plugin(app: &mut App) {
    app.register_type::<MapBudget>()
        .register_type::<MapPool>()
        .register_type::<MapSize>()
        .register_type::<Unmapped>()
        .register_type::<MapLoss>()
        .register_required_components::<Weatherable, MapLoss>()
        .init_resource::<MapBudget>()
        .init_resource::<MapPool>()
        .add_message::<SurfaceEvicted>()
        .add_observer(number_surface)
        .add_observer(release_pool)
        .add_systems(
            PreUpdate,
            size::size_surfaces
                .in_set(SizeMaps)
                // By their area in the world.
                .after(BuildColliders)
                // By what may fall on them.
                .after(RefreshEffects)
                // Which numbers the stamps of the same effects.
                .before(super::PrepareStamps),
        )
        // Packing touches the water that is counted here.
        .add_systems(PostUpdate, tally::tally.before(crate::wetting::gpu::PackWater));
}

/// Spawn order, since that of entities and of queries says nothing.
fn number_surface(added: On<Add, Weatherable>, mut commands: Commands, mut pool: ResMut<MapPool>) {
    commands.entity(added.entity).try_insert(SurfaceOrder(pool.next_order));
    pool.next_order += 1;
}

/// A surface that is not [`Weatherable`] any more has no maps any more. Whoever made some for a [`MapSize`] drops them when
/// that goes.
fn release_pool(removed: On<Remove, Weatherable>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<(MapSize, Unmapped, SurfaceOrder, MapLoss)>();
}
