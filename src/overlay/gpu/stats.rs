//! What painting may cost, and what it has cost.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bevy::prelude::*;

/// What the pass has done since the start; the same numbers in the main and in the render world.
#[derive(Resource, Clone, Default)]
pub struct SplatStats(Arc<Counters>);

#[derive(Default)]
struct Counters {
    splats: AtomicU64,
    dispatches: AtomicU64,
    tiles: AtomicU64,
    dropped: AtomicU64,
    waiting: AtomicU64,
    carried: AtomicU64,
}

/// What painting may cost in one frame.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Resource)]
pub struct SplatBudget {
    /// Splats of all surfaces, 1 or more. The others wait for the next frames, in their order: none is left out.
    pub splats: u32,
}

impl SplatBudget {
    /// All of them at once, where nobody waits for the frame.
    pub const UNLIMITED: Self = Self { splats: u32::MAX };
}

impl Default for SplatBudget {
    fn default() -> Self {
        Self { splats: 100_000 }
    }
}

impl SplatStats {
    /// Splats painted.
    pub fn splats(&self) -> u64 {
        self.0.splats.load(Ordering::Relaxed)
    }

    /// Dispatches: one per surface and frame with new splats.
    pub fn dispatches(&self) -> u64 {
        self.0.dispatches.load(Ordering::Relaxed)
    }

    /// Tiles visited.
    pub fn tiles(&self) -> u64 {
        self.0.tiles.load(Ordering::Relaxed)
    }

    /// Splats that were dropped with the maps they were meant for.
    pub fn dropped(&self) -> u64 {
        self.0.dropped.load(Ordering::Relaxed)
    }

    /// Splats that the last frame left for later ones.
    pub fn waiting(&self) -> u64 {
        self.0.waiting.load(Ordering::Relaxed)
    }

    /// How often a splat was left for a later frame, because of the [`SplatBudget`].
    pub fn carried(&self) -> u64 {
        self.0.carried.load(Ordering::Relaxed)
    }

    pub(super) fn carry(&self, splats: u64) {
        self.0.waiting.store(splats, Ordering::Relaxed);
        self.0.carried.fetch_add(splats, Ordering::Relaxed);
    }

    pub(super) fn drop_splats(&self, splats: usize) {
        self.0.dropped.fetch_add(splats as u64, Ordering::Relaxed);
    }

    pub(super) fn add(&self, splats: usize, tiles: usize) {
        self.0.splats.fetch_add(splats as u64, Ordering::Relaxed);
        self.0.tiles.fetch_add(tiles as u64, Ordering::Relaxed);
        self.0.dispatches.fetch_add(1, Ordering::Relaxed);
    }
}
