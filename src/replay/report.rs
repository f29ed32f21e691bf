//! What happened, in numbers.

use bevy::prelude::*;
use serde::Serialize;

use super::{ReplayOptions, SurfaceMaps};
use crate::clock::WeatheringClock;
use crate::collision::ColliderReport;
use crate::effect::{EffectIndex, EffectTable};
use crate::emitter::{EmissionSeed, EmitterState, NewParticles};
use crate::matter::SurfaceMatter;
use crate::overlay::{MapLoss, MapPool, SurfaceTotals};
use crate::particle::{Particle, ParticleCounts, Particles, WaterCounts};
use crate::scenario::{Digest, ExpectationOutcome, Expectations, ScenarioSurface, amounts_digest};
use crate::wetting::{DripEffect, Stock, SurfaceWater, WettingStats};

/// `report.json`.
#[derive(Serialize, Debug, Clone)]
pub struct Report {
    /// File name of the scenario.
    pub scenario: String,
    /// The variant of it that was chosen.
    pub variant: Option<String>,
    /// The seed that was used.
    pub seed: u64,
    /// Ticks run.
    pub ticks: u32,
    /// The same as weather time, s.
    pub seconds: f64,
    /// All particles.
    pub particles: ParticleReport,
    /// All water.
    pub water: WaterReport,
    /// What moving it took; of a run that was resumed, from there on.
    pub work: WorkReport,
    /// The maps of all surfaces.
    pub maps: MapPool,
    /// In the order of the scenario.
    pub surfaces: Vec<SurfaceReport>,
    /// What was expected, and what came of it; in order of time.
    pub expectations: Vec<ExpectationOutcome>,
    /// Hash over all impacts and all amounts; see [`amounts_digest`].
    pub digest: String,
    /// Wall-clock time and pictures of this run. Nothing else differs from run to run but `work`, after a resume.
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
    /// Not spawned, for want of room; not part of `emitted`. What they would carry is missing.
    pub refused: u64,
    /// The same of emitters with a flow; others carry what they would.
    pub merged: u64,
}

impl From<ParticleCounts> for ParticleReport {
    fn from(counts: ParticleCounts) -> Self {
        let ParticleCounts { emitted, alive, hit, expired, refused, merged } = counts;
        Self { emitted, alive, hit, expired, refused, merged }
    }
}

/// One surface.
#[derive(Serialize, Debug, Clone, PartialEq)]
pub struct SurfaceReport {
    /// Its name.
    pub name: String,
    /// Triangles of its mesh.
    pub triangles: u32,
    /// Texels along each side of its maps; 0 if it has none, for want of room.
    pub map_size: u32,
    /// Particles that hit it.
    pub impacts: u64,
    /// Water that the particles carried, mm³.
    pub received_mm3: f64,
    /// Film on it, mm³.
    pub film_mm3: f64,
    /// Absorbed, mm³.
    pub absorbed_mm3: f64,
    /// Gone into the air, mm³.
    pub evaporated_mm3: f64,
    /// Left it as drips, mm³.
    pub dripped_mm3: f64,
    /// Water that brushes brought, mm³.
    pub painted_mm3: f64,
    /// Water that brushes took, mm³.
    pub wiped_mm3: f64,
    /// Lost with maps that were taken away or for want of maps, mm³.
    pub evicted_mm3: f64,
    /// Part of its area that looks wet, 0..=1.
    pub wet_fraction: f64,
    /// Loose grains on it, mm³.
    pub dust_mm3: f64,
    /// Bound soil on it, mm³.
    pub mud_mm3: f64,
    /// Snow on it, mm³ of water.
    pub snow_mm3: f64,
    /// Dust and mud that left it with water, mm³.
    pub washed_off_mm3: f64,
    /// Snow that slid off it, mm³ of water.
    pub slid_off_mm3: f64,
    /// Dust and mud that brushes took, mm³.
    pub wiped_soil_mm3: f64,
    /// Snow that brushes took, mm³ of water.
    pub wiped_snow_mm3: f64,
    /// Dust, mud and snow lost with maps, mm³.
    pub evicted_matter_mm3: f64,
}

/// Where all the water is, mm³, in whole nanolitres:
/// `emitted + melted + painted = on_surfaces + evaporated + run_off + wiped + missed + in_flight + evicted`.
#[derive(Serialize, Debug, Clone, Copy, PartialEq)]
pub struct WaterReport {
    /// Sent out by emitters.
    pub emitted_mm3: f64,
    /// Was snow on a surface.
    pub melted_mm3: f64,
    /// Brought by brushes.
    pub painted_mm3: f64,
    /// Film and absorbed.
    pub on_surfaces_mm3: f64,
    /// Gone into the air.
    pub evaporated_mm3: f64,
    /// Dripped off and hit nothing more, or more than a texel can hold.
    pub run_off_mm3: f64,
    /// Taken by brushes.
    pub wiped_mm3: f64,
    /// Sent out and hit nothing.
    pub missed_mm3: f64,
    /// Still in flight.
    pub in_flight_mm3: f64,
    /// Not sent out yet, since a limit left no particle to take it along; no part of the sum.
    pub held_mm3: f64,
    /// Lost with maps that were taken away or for want of maps.
    pub evicted_mm3: f64,
    /// What the sum differs by, in parts of what came.
    pub imbalance: f64,
}

/// Steps that moving water took; see [`WettingStats`].
#[derive(Serialize, Debug, Clone, Copy, PartialEq, Eq)]
pub struct WorkReport {
    /// Drops soaked up.
    pub drops: u64,
    /// Steps of tiles with films that run.
    pub tiles_run: u64,
    /// Steps of tiles whose pores share water.
    pub tiles_spread: u64,
}

/// Where the wall-clock time went.
#[derive(Serialize, Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// Until the first tick.
    pub load_seconds: f64,
    /// From the first to the last tick, pictures included.
    pub run_seconds: f64,
    /// All of it.
    pub total_seconds: f64,
    /// Pictures drawn, without those of the run that this one goes on with.
    pub frames: u32,
    /// Splats that were painted in a later frame than that of their ticks, for want of [budget](ReplayOptions::splats).
    pub carried_splats: u64,
    /// Ticks that had to wait until what was there was painted.
    pub held_ticks: u64,
}

impl Report {
    /// The expectations that were looked at and did not hold.
    pub fn failed(&self) -> impl Iterator<Item = &ExpectationOutcome> {
        self.expectations.iter().filter(|outcome| outcome.holds == Some(false))
    }
}

/// Sums up a finished run.
pub(super) fn report(
    world: &mut World,
    options: &ReplayOptions,
    maps: &[SurfaceMaps],
    timing: Timing,
) -> Report {
    let mut query = world.query::<(&ScenarioSurface, &SurfaceTotals, &ColliderReport)>();
    let mut surfaces: Vec<_> = query
        .iter(world)
        .filter_map(|(surface, totals, collider)| {
            let maps = maps.get(surface.index as usize)?;
            let mm3 = |units| maps.water.units().mm3(units);
            let (loss, lost) = (&maps.loss, MapLoss::mm3);
            let row = SurfaceReport {
                name: surface.name.clone(),
                triangles: collider.0.total,
                map_size: maps.size,
                impacts: totals.impacts,
                received_mm3: totals.water_nl as f64 / 1000.0,
                film_mm3: mm3(maps.stock.film),
                absorbed_mm3: mm3(maps.stock.pores),
                evaporated_mm3: mm3(maps.stock.evaporated) + lost(loss.evaporated),
                dripped_mm3: mm3(maps.water.ledger().dripped) + lost(loss.dripped),
                painted_mm3: mm3(maps.water.ledger().painted) + lost(loss.painted),
                wiped_mm3: mm3(maps.water.ledger().wiped) + lost(loss.wiped),
                evicted_mm3: lost(loss.water),
                wet_fraction: maps.wet_fraction,
                dust_mm3: mm3(maps.matter.stock().dust),
                mud_mm3: mm3(maps.matter.stock().mud),
                snow_mm3: mm3(maps.matter.stock().snow),
                washed_off_mm3: mm3(maps.matter.ledger().washed_off) + lost(loss.washed_off),
                slid_off_mm3: mm3(maps.matter.ledger().slid_off) + lost(loss.slid_off),
                wiped_soil_mm3: mm3(maps.matter.ledger().wiped) + lost(loss.wiped_soil),
                wiped_snow_mm3: mm3(maps.matter.ledger().wiped_snow) + lost(loss.wiped_snow),
                evicted_matter_mm3: lost(loss.soil + loss.snow),
            };
            Some((surface.index, row))
        })
        .collect();
    surfaces.sort_by_key(|(index, _)| *index);
    let accounts: Vec<_> = maps.iter().map(SurfaceMaps::accounts).collect();
    let water = water_report(world, &accounts);

    let clock = *world.resource::<WeatheringClock>();
    let counts = *world.resource::<ParticleCounts>();
    let digest = world.resource::<Digest>();
    let stats = world.resource::<WettingStats>();
    Report {
        scenario: options.scenario.file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        variant: options.scenario.variant.clone(),
        seed: world.resource::<EmissionSeed>().0,
        ticks: clock.tick(),
        seconds: clock.seconds(),
        particles: counts.into(),
        water,
        work: WorkReport {
            drops: stats.drops(),
            tiles_run: stats.tiles_run(),
            tiles_spread: stats.tiles_spread(),
        },
        maps: *world.resource::<MapPool>(),
        surfaces: surfaces.into_iter().map(|(_, row)| row).collect(),
        expectations: world.resource::<Expectations>().outcomes().to_vec(),
        digest: amounts_digest(digest, maps.iter().map(|maps| (&maps.water, &maps.matter))),
        timing,
    }
}

/// The accounts of a surface.
pub(super) struct SurfaceAccounts<'a> {
    pub(super) water: &'a SurfaceWater,
    /// Where that water is now.
    pub(super) stock: Stock,
    pub(super) matter: &'a SurfaceMatter,
    /// What was lost with maps.
    pub(super) loss: &'a MapLoss,
}

impl SurfaceMaps {
    fn accounts(&self) -> SurfaceAccounts<'_> {
        SurfaceAccounts { water: &self.water, stock: self.stock, matter: &self.matter, loss: &self.loss }
    }
}

/// Adds up all water, wherever it is.
pub(super) fn water_report(world: &World, maps: &[SurfaceAccounts]) -> WaterReport {
    let nl = |nl: u64| nl as f64 / 1000.0;
    // There is no such query in a world that has never seen an emitter.
    let held_mm3 = world
        .try_query::<&EmitterState>()
        .map_or(0.0, |mut emitters| emitters.iter(world).map(EmitterState::held_mm3).sum::<f64>() + 0.0);
    let sum = |of: &dyn Fn(&SurfaceAccounts) -> u64| -> f64 {
        maps.iter().map(|maps| maps.water.units().mm3(of(maps))).sum::<f64>() + 0.0
    };
    let lost = |of: &dyn Fn(&MapLoss) -> u64| -> f64 {
        maps.iter().map(|maps| MapLoss::mm3(of(maps.loss))).sum::<f64>() + 0.0
    };
    let effects = world.resource::<EffectTable>();
    let waiting = world.resource::<NewParticles>().waiting().iter().copied();
    let water_of = |particle: Particle| {
        effects.row(particle.effect).map_or(0, |row| u64::from(row.water_nl(particle.volume_nl)))
    };
    let in_flight: u64 = world.resource::<Particles>().iter().chain(waiting).map(water_of).sum();
    let counts = world.resource::<WaterCounts>();
    let drips = world.get_resource::<DripEffect>().and_then(|drips| drips.rows);
    let is_drip =
        |row: usize| drips.is_some_and(|[drop, _, mud]| [drop, mud].contains(&EffectIndex(row as u16)));
    let expired = |dripped: bool| -> u64 {
        let rows = counts.expired_nl.iter().enumerate();
        rows.filter(|&(row, _)| is_drip(row) == dripped).map(|(_, nl)| nl).sum()
    };
    let mut report = WaterReport {
        emitted_mm3: nl(counts.emitted_nl),
        melted_mm3: sum(&|maps| maps.matter.ledger().melted) + lost(&|loss| loss.melted),
        painted_mm3: sum(&|maps| maps.water.ledger().painted) + lost(&|loss| loss.painted),
        on_surfaces_mm3: sum(&|maps| maps.stock.film + maps.stock.pores),
        evaporated_mm3: sum(&|maps| maps.stock.evaporated) + lost(&|loss| loss.evaporated),
        run_off_mm3: nl(expired(true))
            + sum(&|maps| maps.water.ledger().spilled)
            + lost(&|loss| loss.spilled),
        wiped_mm3: sum(&|maps| maps.water.ledger().wiped) + lost(&|loss| loss.wiped),
        missed_mm3: nl(expired(false)),
        in_flight_mm3: nl(in_flight),
        held_mm3,
        evicted_mm3: lost(&|loss| loss.water),
        imbalance: 0.0,
    };
    let found = report.on_surfaces_mm3
        + report.evaporated_mm3
        + report.run_off_mm3
        + report.wiped_mm3
        + report.missed_mm3
        + report.in_flight_mm3
        + report.evicted_mm3;
    let came = report.emitted_mm3 + report.melted_mm3 + report.painted_mm3;
    if came > 0.0 {
        report.imbalance = (came - found) / came;
    }
    report
}

/// The water of a world whose surfaces are all among `maps`.
pub(crate) fn water_of<'m>(world: &World, maps: impl IntoIterator<Item = &'m SurfaceMaps>) -> WaterReport {
    let accounts: Vec<_> = maps.into_iter().map(SurfaceMaps::accounts).collect();
    water_report(world, &accounts)
}
