//! Casting what every particle moved, in parallel, with one order.

use bevy::prelude::*;
use bevy::utils::Parallel;

use super::{CollisionScene, Impact, Impacts};
use crate::clock::WeatheringClock;
use crate::effect::EffectIndex;
use crate::particle::{Lifespan, Position, Sequence, Velocity, Volume, batching, swept_start};

/// Below this many particles one thread is faster than waking others.
const PARALLEL_BATCH: usize = 1024;

/// Asks for a [`SurfaceImpact`] message for each particle that hits this surface.
#[derive(Component, Reflect, Debug, Default, Clone, Copy)]
#[reflect(Component)]
pub struct ReportImpacts;

/// A particle hit a surface that has [`ReportImpacts`].
#[derive(Message, Debug, Clone, Copy, PartialEq)]
pub struct SurfaceImpact(pub Impact);

/// Casts the segment each particle moved in this tick; what hits ends there and becomes an [`Impact`].
pub fn trace_particles(
    clock: Res<WeatheringClock>,
    scene: Res<CollisionScene>,
    mut impacts: ResMut<Impacts>,
    mut per_thread: Local<Parallel<Vec<Impact>>>,
    mut particles: Query<(&Position, &Velocity, &mut Lifespan, &Volume, &Sequence, &EffectIndex)>,
) {
    impacts.0.clear();
    if scene.is_empty() {
        return;
    }
    let tick = clock.delta_secs();
    let found = &*per_thread;
    particles.par_iter_mut().batching_strategy(batching(PARALLEL_BATCH)).for_each_init(
        || found.borrow_local_mut(),
        |found, (position, velocity, mut lifespan, volume, &sequence, &effect)| {
            let end = position.0;
            let start = swept_start(end, velocity.0, tick * lifespan.moving_part());
            let Some(hit) = scene.cast(start, end) else { return };
            lifespan.bypass_change_detection().mark_hit();
            found.push(Impact {
                sequence,
                surface: hit.surface,
                triangle: hit.triangle,
                point: hit.point,
                normal: hit.normal,
                uv: hit.uv,
                uv_per_metre: hit.uv_per_metre,
                velocity: velocity.0,
                effect,
                volume_nl: volume.0,
            });
        },
    );
    for found in per_thread.iter_mut() {
        impacts.0.append(found);
    }
    // Numbers are unique, so this order is the only one.
    impacts.0.sort_unstable_by_key(|impact| impact.sequence);
}

/// Tells those who asked.
pub(super) fn report_impacts(
    impacts: Res<Impacts>,
    listening: Query<(), With<ReportImpacts>>,
    mut messages: MessageWriter<SurfaceImpact>,
) {
    if !listening.is_empty() {
        messages.write_batch(
            impacts.0.iter().filter(|impact| listening.contains(impact.surface)).copied().map(SurfaceImpact),
        );
    }
}
