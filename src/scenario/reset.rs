//! Starting over without loading anything again.

use bevy::prelude::*;

use super::Digest;
use crate::clock::WeatheringClock;
use crate::emitter::{Emitter, EmitterState, NewParticles};
use crate::overlay::{CpuMaps, SplatQueue, SurfaceTotals, Weatherable};
use crate::particle::{ParticleCounts, Particles, WaterCounts};
use crate::weather::DryingClock;
use crate::wetting::{DropQueue, SurfaceWater};

/// Takes a scenario back to tick 0: dry surfaces, no particles, the same random streams. What follows is what
/// followed the first time.
pub fn reset_scenario(world: &mut World) {
    world.resource_mut::<Particles>().clear();
    let mut emitters = world.query_filtered::<&mut EmitterState, With<Emitter>>();
    for mut state in emitters.iter_mut(world) {
        *state = EmitterState::default();
    }
    let mut surfaces = world.query::<(
        &mut Weatherable,
        &mut SplatQueue,
        &mut SurfaceTotals,
        Option<&mut CpuMaps>,
        Option<&mut SurfaceWater>,
        Option<&mut DropQueue>,
    )>();
    for (mut surface, mut queue, mut totals, maps, water, drops) in surfaces.iter_mut(world) {
        if let Some(mut water) = water {
            water.reset();
        }
        if let Some(mut drops) = drops {
            drops.0.clear();
        }
        // A changed surface gets new, empty maps on the GPU.
        surface.set_changed();
        queue.clear();
        *totals = SurfaceTotals::default();
        if let Some(mut maps) = maps {
            *maps = CpuMaps::new(&surface);
        }
    }
    world.resource_mut::<NewParticles>().restart();
    world.resource_mut::<WeatheringClock>().reset();
    world.insert_resource(ParticleCounts::default());
    world.insert_resource(WaterCounts::default());
    world.insert_resource(DryingClock::default());
    world.insert_resource(Digest::default());
}
