//! What happened, in numbers.

use bevy::prelude::*;
use serde::Serialize;

use super::{ReplayOptions, SurfaceMaps};
use crate::clock::WeatheringClock;
use crate::collision::ColliderReport;
use crate::emitter::EmissionSeed;
use crate::overlay::{SurfaceTotals, TexelAreas};
use crate::particle::ParticleCounts;
use crate::scenario::{Digest, ScenarioSurface, amounts_digest};

/// `report.json`.
#[derive(Serialize, Debug, Clone)]
pub struct Report {
    /// File name of the scenario.
    pub scenario: String,
    /// The seed that was used.
    pub seed: u64,
    /// Ticks run.
    pub ticks: u32,
    /// The same as weather time.
    pub seconds: f64,
    /// All particles.
    pub particles: ParticleReport,
    /// In the order of the scenario.
    pub surfaces: Vec<SurfaceReport>,
    /// Hash over all impacts and all amounts; see [`amounts_digest`].
    pub digest: String,
    /// Wall-clock time; the one part that differs from run to run.
    pub timing: Timing,
}

/// `emitted == alive + hit + expired`.
#[derive(Serialize, Debug, Clone, Copy, PartialEq, Eq)]
pub struct ParticleReport {
    /// Spawned.
    pub emitted: u64,
    /// Still in flight.
    pub alive: u64,
    /// Hit a surface.
    pub hit: u64,
    /// Ran out of time.
    pub expired: u64,
    /// Not spawned, for want of room; not part of `emitted`.
    pub refused: u64,
}

/// One surface.
#[derive(Serialize, Debug, Clone, PartialEq)]
pub struct SurfaceReport {
    /// Its name.
    pub name: String,
    /// Triangles of its mesh.
    pub triangles: u32,
    /// Particles that hit it.
    pub impacts: u64,
    /// Water in its map, mm³.
    pub water_mm3: f64,
    /// Water that the particles carried, mm³; the same unless a texel overflowed.
    pub received_mm3: f64,
    /// Part of its area with any water, 0..=1.
    pub wet_fraction: f64,
}

/// Where the time went.
#[derive(Serialize, Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// Until the first tick.
    pub load_seconds: f64,
    /// From the first to the last tick, pictures included.
    pub run_seconds: f64,
    /// All of it.
    pub total_seconds: f64,
    /// Pictures drawn.
    pub frames: u32,
}

/// Sums up a finished run.
pub(super) fn report(
    world: &mut World,
    options: &ReplayOptions,
    maps: &[SurfaceMaps],
    timing: Timing,
) -> Report {
    let mut query = world.query::<(&ScenarioSurface, &SurfaceTotals, &TexelAreas, &ColliderReport)>();
    let mut surfaces: Vec<_> = query
        .iter(world)
        .map(|(surface, totals, areas, collider)| {
            let state = maps.get(surface.index as usize).map_or(&[][..], |maps| &maps.state);
            let water_nl: u64 = state.iter().map(|texel| u64::from(texel.water_nl)).sum();
            let row = SurfaceReport {
                name: surface.name.clone(),
                triangles: collider.0.total,
                impacts: totals.impacts,
                water_mm3: water_nl as f64 / 1000.0,
                received_mm3: totals.water_nl as f64 / 1000.0,
                wet_fraction: areas.wet_fraction(state),
            };
            (surface.index, row)
        })
        .collect();
    surfaces.sort_by_key(|(index, _)| *index);

    let clock = *world.resource::<WeatheringClock>();
    let counts = *world.resource::<ParticleCounts>();
    let digest = world.resource::<Digest>();
    Report {
        scenario: options.scenario.file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        seed: world.resource::<EmissionSeed>().0,
        ticks: clock.tick(),
        seconds: clock.seconds(),
        particles: ParticleReport {
            emitted: counts.emitted,
            alive: counts.alive,
            hit: counts.hit,
            expired: counts.expired,
            refused: counts.refused,
        },
        surfaces: surfaces.into_iter().map(|(_, row)| row).collect(),
        digest: amounts_digest(digest, maps.iter().map(|maps| maps.state.as_slice())),
        timing,
    }
}
