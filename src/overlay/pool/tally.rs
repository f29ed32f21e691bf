//! What all surfaces hold, in numbers.

use bevy::prelude::*;

use super::resize::Resizing;
use super::{MapNeed, MapPool, MapSize, Unmapped};
use crate::collision::{DeformingCollider, NotWeatherable};
use crate::matter::SurfaceMatter;
use crate::overlay::{SurfaceFrames, SurfaceTotals, SurfaceTraces, Weatherable};
use crate::wetting::SurfaceWater;

type Holder = (
    (&'static MapSize, &'static Weatherable, Has<DeformingCollider>, Option<&'static Resizing>),
    (
        &'static SurfaceTotals,
        &'static SurfaceTraces,
        Option<&'static SurfaceWater>,
        Option<&'static SurfaceMatter>,
        Has<SurfaceFrames>,
    ),
);

/// Counts what is held.
pub(super) fn tally(
    mut pool: ResMut<MapPool>,
    surfaces: Query<Holder, Without<NotWeatherable>>,
    unmapped: Query<(), (With<Unmapped>, Without<NotWeatherable>)>,
) {
    let mut counts = MapPool { used: 0, reserved: 0, mapped: 0, reduced: 0, ..*pool };
    counts.unmapped = unmapped.iter().len() as u32;
    for ((size, surface, is_posed, resizing), (totals, traces, water, matter, has_frames)) in &surfaces {
        let hit = totals.last_tick > 0;
        let held = MapNeed {
            colors: traces.paint,
            rings: hit,
            water: water.is_some_and(SurfaceWater::is_wet),
            matter: matter.is_some_and(|matter| !matter.is_empty()),
            frames: hit && has_frames,
        };
        counts.mapped += 1;
        counts.used += held.bytes(size.texels);
        counts.reduced += u32::from(size.is_reduced());
        let charged = resizing.map_or(0, |resizing| resizing.to).max(size.texels);
        counts.reserved += counts.falling.need(surface, is_posed).bytes(charged);
    }
    pool.set_if_neq(counts);
}
