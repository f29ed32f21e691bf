//! Counters of the pass.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bevy::diagnostic::DiagnosticPath;
use bevy::prelude::*;

/// What the pass has done since the start; the same numbers in the main and in the render world.
#[derive(Resource, Clone, Default)]
pub struct SplatStats(Arc<Counters>);

#[derive(Default)]
struct Counters {
    splats: AtomicU64,
    dispatches: AtomicU64,
    tiles: AtomicU64,
    carried: AtomicU64,
    dropped: AtomicU64,
    lost: AtomicU64,
    pending: AtomicU64,
    moving: AtomicU64,
}

impl SplatStats {
    /// The pass by its name in Bevy's render diagnostics.
    pub(super) const SPAN: &'static str = "paint_splats";

    /// Time of the pass on the GPU, ms: among Bevy's diagnostics, in apps with its `RenderDiagnosticsPlugin` on GPUs that have
    /// timestamps.
    pub const GPU_TIME: DiagnosticPath = DiagnosticPath::const_new("render/paint_splats/elapsed_gpu");

    /// Splats that the pass has dealt with: painted or, of clear water, remembered for the rings around them.
    pub fn splats(&self) -> u64 {
        self.0.splats.load(Ordering::Relaxed)
    }

    /// Batches: one per surface and frame in which splats of it are dealt with.
    pub fn dispatches(&self) -> u64 {
        self.0.dispatches.load(Ordering::Relaxed)
    }

    /// Tiles visited.
    pub fn tiles(&self) -> u64 {
        self.0.tiles.load(Ordering::Relaxed)
    }

    /// Splats that the [budget](crate::overlay::SplatBudget) made wait for a later frame, each counted once.
    pub fn carried(&self) -> u64 {
        self.0.carried.load(Ordering::Relaxed)
    }

    /// Splats that were dropped with the maps they were meant for.
    pub fn dropped(&self) -> u64 {
        self.0.dropped.load(Ordering::Relaxed)
    }

    /// Splats that could not be painted since a shader of the pass did not compile, which the log tells: 0, or the maps lack
    /// something. Time goes on.
    pub fn lost(&self) -> u64 {
        self.0.lost.load(Ordering::Relaxed)
    }

    /// Splats that wait in the render world now, for whatever reason.
    pub fn pending(&self) -> u64 {
        self.0.pending.load(Ordering::Relaxed)
    }

    /// Surfaces whose paint has not moved over to their maps of another size yet.
    pub fn moving(&self) -> u64 {
        self.0.moving.load(Ordering::Relaxed)
    }

    pub(super) fn set_moving(&self, surfaces: usize) {
        self.0.moving.store(surfaces as u64, Ordering::Relaxed);
    }

    pub(super) fn add(&self, splats: usize, tiles: usize) {
        self.0.splats.fetch_add(splats as u64, Ordering::Relaxed);
        self.0.tiles.fetch_add(tiles as u64, Ordering::Relaxed);
        self.0.dispatches.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn carry(&self, splats: usize) {
        self.0.carried.fetch_add(splats as u64, Ordering::Relaxed);
    }

    pub(super) fn drop_splats(&self, splats: usize) {
        self.0.dropped.fetch_add(splats as u64, Ordering::Relaxed);
    }

    pub(crate) fn lose(&self, splats: usize) {
        self.0.lost.fetch_add(splats as u64, Ordering::Relaxed);
    }

    pub(super) fn set_pending(&self, splats: usize) {
        self.0.pending.store(splats as u64, Ordering::Relaxed);
    }
}
