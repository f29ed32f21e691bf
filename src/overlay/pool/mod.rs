//! One budget for the maps of all surfaces.
//!
//! A surface gets its [`MapSize`] before anything is measured for it, and everything that has texels is made for that size:
//! colour maps, water, matter, frames. What decides it:
//!
//! 1. Each surface wishes for a side: [`Weatherable::map_size`], or as many texels as make them [`MapBudget::texel`] wide
//!    in the world, where that is fewer.
//! 2. If all wishes fit into the budget, they are granted at once. Else everything that is there is waited for, and sides are
//!    halved, those with the finest texels in the world first, until they fit (`plan`).
//! 3. A surface that comes later gets what is left. If not even the smallest maps are, others give way, first the one that was hit
//!    longest ago: its maps are halved, again and again down to the smallest, with all that is on them (`resize`), and not a unit
//!    of its water is lost. [`SurfaceResized`] and, once for each surface, the log say so.
//! 4. Only where that is not enough, or a side cannot be halved into whole tiles, the surface that was hit longest ago loses its maps
//!    (`release`): they are dropped, what lay on it is entered in its [`MapLoss`], and a warning and [`SurfaceEvicted`] say
//!    so. It gets new ones when there is room.
//! 5. Where nothing can be taken from anybody, a surface stays [`Unmapped`], which is an error in the log. What falls on it
//!    is entered as lost, too.
//! 6. Once a second (of ticks), surfaces that are hit and have less than they wish for grow to twice their side (`room`), if there is
//!    room, or if those that have not been hit for [`MapBudget::IDLE_SECONDS`] can give some by being halved: first those that
//!    have given way before, then, the coarsest first, those that never had what they wished for.
//!
//! What a surface is charged with is all that it may come to hold on the GPU by the effects that there are: so maps that are
//! only made when the first drop falls cannot fail then. All of this is decided at the start of frames, from the main world's state
//! alone: the same in runs of the same frames, with and without a renderer, and in the order in which surfaces were spawned.
//!
//! Maps take their new size when its texels are measured, some frames later. What is given up counts as taken until then, and so
//! does what has been granted, so that the budget holds at all times.

mod loss;
mod plan;
mod release;
mod resize;
mod room;
mod size;
mod tally;

use bevy::prelude::*;
use serde::Serialize;

use super::{Weatherable, Wrap};
use crate::collision::ColliderSystems;
use crate::effect::EffectSystems;

pub use loss::MapLoss;
pub use plan::MapNeed;
pub(crate) use resize::{
    can_put_size, can_resume_resizing, is_resizing, put_first_size, put_size, resizing_of, resume_resizing,
};

/// How much memory of the GPU the maps of all surfaces may take, and how fine they are. May be changed at any time: where
/// it becomes too little, maps are halved, and taken away where that is not enough.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource, Default)]
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
    /// Seconds without a hit after which a surface gives way to others that are hit.
    pub const IDLE_SECONDS: u32 = 10;
}

impl Default for MapBudget {
    fn default() -> Self {
        Self { bytes: 256 << 20, texel: None }
    }
}

/// The size of a surface's maps, from when it is decided until they are taken away. It changes with use where the budget is short.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Component)]
pub struct MapSize {
    texels: u32,
    /// What it would have if there were room for all.
    wish: u32,
    /// What it was given first.
    granted: u32,
    /// That it has given way has been told.
    told: bool,
    /// What the surface's own settings were, so that a change of them is seen.
    limit: u32,
    wrap: [Wrap; 2],
}

impl MapSize {
    /// As large as the surface's settings allow.
    pub fn whole(surface: &Weatherable) -> Self {
        Self::reduced(surface, surface.texels(), surface.texels())
    }

    fn reduced(surface: &Weatherable, texels: u32, wish: u32) -> Self {
        let (limit, wrap) = (surface.texels(), surface.wrap());
        Self { texels, wish, granted: texels, told: false, limit, wrap }
    }

    /// Texels along each side; a multiple of [`TILE_SIZE`](super::TILE_SIZE).
    pub fn texels(&self) -> u32 {
        self.texels
    }

    /// Whether it has half of what it wishes for, or less.
    fn is_reduced(&self) -> bool {
        self.texels * 2 <= self.wish
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
#[reflect(Resource, Default)]
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
    /// Times that the maps of a surface became smaller to make room, with all that is on them.
    pub shrinks: u64,
    /// Times that they became larger, since it was hit.
    pub growths: u64,
    /// Surfaces whose maps have half the side that they would have if there were room for all, or less.
    pub reduced: u32,
    /// Number of the next surface that is spawned.
    #[serde(skip)]
    next_order: u64,
    /// Bytes that the first of the surfaces without maps needs; 0 if it should be tried.
    #[serde(skip)]
    next_bytes: u64,
    /// By which surfaces are charged.
    #[serde(skip)]
    falling: size::Falling,
    /// The second in which it was last looked at who could grow.
    #[serde(skip)]
    second: u32,
}

impl MapPool {
    fn count_resize(&mut self, from: u32, to: u32) {
        let count = if to < from { &mut self.shrinks } else { &mut self.growths };
        *count += 1;
    }

    /// Goes on at a tick that it has not counted up to: whether it has looked at who could grow follows from that.
    pub(crate) fn resume_at(&mut self, tick: u32, hz: u32) {
        self.second = tick.saturating_sub(1) / hz.max(1);
    }
}

/// A surface has lost its maps to the budget.
#[derive(Message, Reflect, Debug, Clone, Copy, PartialEq)]
pub struct SurfaceEvicted {
    /// The surface.
    pub surface: Entity,
    /// What was on it.
    pub lost: MapLoss,
}

/// A surface has got maps of another size, with all that was on them.
#[derive(Message, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
pub struct SurfaceResized {
    /// The surface.
    pub surface: Entity,
    /// Texels along each side before.
    pub from: u32,
    /// And now.
    pub to: u32,
}

/// In `PreUpdate`, after colliders: surfaces get the size of their maps, or lose them.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct MapSizeSystems;

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
        .add_message::<SurfaceResized>()
        .add_observer(number_surface)
        .add_observer(release_pool)
        .add_observer(resize::release_resizing)
        .add_systems(
            PreUpdate,
            // What has become free is there for others at once.
            (resize::finish_resizes, size::size_surfaces)
                .chain()
                .in_set(MapSizeSystems)
                // By their area in the world.
                .after(ColliderSystems)
                // By what may fall on them.
                .after(EffectSystems)
                // Which numbers the stamps of the same effects.
                .before(super::StampSystems),
        )
        // Packing touches the water that is counted here.
        .add_systems(
            PostUpdate,
            tally::tally.after(super::deposit::note_traces).before(crate::wetting::gpu::WaterUploadSystems),
        );
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

/// What a surface is called in the log.
fn label(names: &Query<&Name>, entity: Entity) -> String {
    names.get(entity).map_or_else(|_| entity.to_string(), ToString::to_string)
}
