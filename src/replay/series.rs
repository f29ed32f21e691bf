//! What becomes of a scenario over time: a row of numbers every so often.
//!
//! The row is taken at the end of the tick that is due, whatever frames that tick is in, so that `series.csv` is the same
//! for any frame rate and any number of threads, with and without a renderer. How long ticks took is not the same from run
//! to run; it is kept apart, in `timings.csv`.
//!
//! A run that goes on from a saved scene keeps the rows that lie in its folder from before.

use std::path::Path;

use bevy::prelude::*;

use super::report::{SurfaceAccounts, WaterReport, water_report};
use super::table::Table;
use super::{ReplayError, ReplayOptions, Run, write_atomic};
use crate::clock::WeatheringClock;
use crate::material::PorousMaterial;
use crate::matter::SurfaceMatter;
use crate::overlay::{MapLoss, SurfaceTotals};
use crate::overload::{STAGES, StageMark, StageTimes, StageTimesPlugin, end_stage};
use crate::particle::ParticleCounts;
use crate::scenario::{Scenario, ScenarioSurface};
use crate::schedule::WeatheringTick;
use crate::weather::DryingClock;
use crate::wetting::query::summary;
use crate::wetting::{Exposure, Now, SurfaceWater, SurfaceWetness, WetGeometry};

/// What is written of the numbers.
pub(super) const SERIES_FILE: &str = "series.csv";
pub(super) const TIMINGS_FILE: &str = "timings.csv";

/// The columns that every scenario has. Amounts of water since the start and where they are now, ml; see [`WaterReport`].
const TOTALS: [&str; 17] = [
    "tick",
    "seconds",
    "particles_alive",
    "particles_emitted",
    "particles_hit",
    "particles_expired",
    "particles_refused",
    "emitted_ml",
    "melted_ml",
    "painted_ml",
    "on_surfaces_ml",
    "evaporated_ml",
    "run_off_ml",
    "wiped_ml",
    "missed_ml",
    "in_flight_ml",
    "evicted_ml",
];

/// The columns of each surface, behind its name and a dot. `film_mm` and `absorbed_mm` are means over its area; `received_ml`,
/// `evaporated_ml` and `dripped_ml` are since the start, snow is in ml of water.
const OF_SURFACE: [&str; 12] = [
    "wet_fraction",
    "film_mm",
    "absorbed_mm",
    "film_ml",
    "absorbed_ml",
    "received_ml",
    "evaporated_ml",
    "dripped_ml",
    "dust_ml",
    "mud_ml",
    "snow_ml",
    "impacts",
];

/// The columns of `timings.csv` beside a `<stage>_ms` for each stage. `ticks` is how many ran since the row before; times are
/// means over these, in ms a tick, and `outside_ms` is all that is in no stage, pictures included.
const TIMINGS: [&str; 4] = ["tick", "seconds", "ticks", "outside_ms"];

/// The most numbers that are kept.
const MAX_CELLS: usize = 10_000_000;

/// The numbers so far.
#[derive(Resource)]
struct Series {
    /// Ticks between two rows.
    every: u32,
    rows: Table,
    timings: Table,
    /// When the last row of timings was taken.
    mark: StageMark,
}

/// The numbers of a whole run.
pub(super) struct SeriesTables {
    pub(super) rows: Table,
    pub(super) timings: Table,
}

impl Run<'_> {
    /// Takes the first row and has the others taken, one after so many ticks.
    pub(super) fn begin_series(&mut self, every: u32) {
        let timings = TIMINGS.into_iter().map(String::from);
        let stages = STAGES.into_iter().map(|stage| format!("{stage}_ms"));
        // Not by `add_plugins`: the app is finished.
        StageTimesPlugin.build(&mut self.app);
        let mark = self.app.world().resource::<StageTimes>().mark();
        self.app.insert_resource(Series {
            every,
            rows: Table::new(columns(&self.options.scenario.scenario)),
            timings: Table::new(timings.chain(stages).collect()),
            mark,
        });
        // What it takes to look at the surfaces belongs to no stage.
        self.app.add_systems(WeatheringTick, take_due_row.after(end_stage::<6>));
        take_row(self.app.world_mut());
    }

    /// All rows, the last of them of the last tick.
    pub(super) fn end_series(&mut self) -> Option<SeriesTables> {
        let world = self.app.world_mut();
        let tick = f64::from(world.resource::<WeatheringClock>().tick());
        let series = world.get_resource::<Series>()?;
        if series.rows.rows().last().and_then(|row| row.first()) != Some(&tick) {
            take_row(world);
        }
        let Series { rows, timings, .. } = world.remove_resource()?;
        Some(SeriesTables { rows, timings })
    }
}

impl SeriesTables {
    /// What an earlier run left in a folder; nothing for what is no such file.
    pub(super) fn read(folder: &Path) -> Self {
        let table = |file| {
            let text = std::fs::read_to_string(folder.join(file)).ok();
            text.and_then(|text| Table::from_csv(&text)).unwrap_or_default()
        };
        Self { rows: table(SERIES_FILE), timings: table(TIMINGS_FILE) }
    }

    /// Puts the rows of the run that this one goes on with in front.
    pub(super) fn put_before(&mut self, earlier: &Self) {
        self.rows.put_before(&earlier.rows);
        self.timings.put_before(&earlier.timings);
    }

    pub(super) fn write(&self, folder: &Path) -> Result<(), ReplayError> {
        for (file, table) in [(SERIES_FILE, &self.rows), (TIMINGS_FILE, &self.timings)] {
            write_atomic(&folder.join(file), table.to_csv().as_bytes())?;
        }
        Ok(())
    }
}

impl ReplayOptions {
    /// Ticks between two rows of the series.
    ///
    /// # Errors
    /// [`ReplayError::Option`] if `every` is no time, or so short that the rows would fill the memory.
    pub(super) fn series_ticks(&self) -> Result<u32, ReplayError> {
        let scenario = &self.scenario.scenario;
        let hz = f64::from(scenario.tick_hz);
        let ticks = f64::from(self.seconds.unwrap_or(scenario.seconds)) * hz;
        let most_rows = (MAX_CELLS / columns(scenario).len()).max(2) - 1;
        let least = (ticks / most_rows as f64).ceil().max(1.0);
        let Some(every) = self.every else { return Ok(hz.max((least / hz).ceil() * hz) as u32) };
        let every_ticks = (f64::from(every) * hz).round();
        // Written so that NaN fails.
        if every_ticks >= least && every <= Scenario::MAX_SECONDS {
            return Ok(every_ticks as u32);
        }
        let expected = format!("{} to {} seconds", least / hz, Scenario::MAX_SECONDS);
        Err(ReplayError::Option { option: "every", value: every.to_string(), expected })
    }
}

fn columns(scenario: &Scenario) -> Vec<String> {
    let of_surfaces =
        scenario.surface_names().flat_map(|name| OF_SURFACE.map(|column| format!("{name}.{column}")));
    TOTALS.into_iter().map(String::from).chain(of_surfaces).collect()
}

fn take_due_row(world: &mut World) {
    let tick = world.resource::<WeatheringClock>().tick();
    if world.get_resource::<Series>().is_some_and(|series| tick.is_multiple_of(series.every)) {
        take_row(world);
    }
}

fn take_row(world: &mut World) {
    let clock = *world.resource::<WeatheringClock>();
    let time = [f64::from(clock.tick()), clock.seconds()];
    let row = row(world, time);
    let times = *world.resource::<StageTimes>();
    let mut series = world.resource_mut::<Series>();
    let means = times.take_since(&mut series.mark);
    series.rows.push(row);
    if let Some(means) = means {
        let counted = [f64::from(means.ticks), means.outside_ms];
        series.timings.push(time.into_iter().chain(counted).chain(means.stages_ms));
    }
}

type Surface = (
    (&'static ScenarioSurface, &'static SurfaceTotals, &'static SurfaceWater, &'static WetGeometry),
    (Option<&'static Exposure>, Option<&'static PorousMaterial>, &'static SurfaceMatter, &'static MapLoss),
);

/// The numbers of this moment.
fn row(world: &mut World, time: [f64; 2]) -> Vec<f64> {
    let mut query = world.query::<Surface>();
    let world: &World = world;
    let clock = world.resource::<WeatheringClock>();
    let drying = world.resource::<DryingClock>();
    let default = PorousMaterial::default();
    let mut surfaces = Vec::new();
    for ((surface, totals, water, geometry), (exposure, material, matter, loss)) in query.iter(world) {
        let material = material.unwrap_or(&default);
        let now = Now::new(clock.tick(), clock.hz(), drying, &geometry.0, exposure, material);
        let accounts = SurfaceAccounts { water, stock: water.stock(&now), matter, loss };
        // Not asked of those that never got any water, since it looks at every texel.
        let over = if water.is_wet() { summary(water, &now) } else { SurfaceWetness::default() };
        surfaces.push((surface.index as usize, of_surface(&accounts, totals, &over), accounts));
    }
    surfaces.sort_by_key(|(index, ..)| *index);
    let (numbers, accounts): (Vec<_>, Vec<_>) =
        surfaces.into_iter().map(|(index, numbers, accounts)| ((index, numbers), accounts)).unzip();

    let mut row = time.to_vec();
    row.extend(of_particles(world.resource::<ParticleCounts>()));
    row.extend(of_water(&water_report(world, &accounts)));
    for (index, numbers) in numbers {
        // Where its number says, also if one before it is missing.
        row.resize(TOTALS.len() + index * OF_SURFACE.len(), 0.0);
        row.extend(numbers);
    }
    row
}

fn of_particles(counts: &ParticleCounts) -> [f64; 5] {
    let ParticleCounts { emitted, alive, hit, expired, refused, .. } = *counts;
    [alive, emitted, hit, expired, refused].map(|count| count as f64)
}

fn of_water(water: &WaterReport) -> [f64; 10] {
    [
        water.emitted_mm3,
        water.melted_mm3,
        water.painted_mm3,
        water.on_surfaces_mm3,
        water.evaporated_mm3,
        water.run_off_mm3,
        water.wiped_mm3,
        water.missed_mm3,
        water.in_flight_mm3,
        water.evicted_mm3,
    ]
    .map(|mm3| mm3 / 1000.0)
}

fn of_surface(
    accounts: &SurfaceAccounts,
    totals: &SurfaceTotals,
    over: &SurfaceWetness,
) -> [f64; OF_SURFACE.len()] {
    let ml = |units| accounts.water.units().mm3(units) / 1000.0;
    let (film, absorbed) = (ml(accounts.stock.film), ml(accounts.stock.pores));
    // 1 l/m² is 1 mm.
    let area_m2 = f64::from(over.area_m2);
    let mean_mm = |ml: f64| if area_m2 > 0.0 { ml / 1000.0 / area_m2 } else { 0.0 };
    let matter = accounts.matter.stock();
    [
        f64::from(over.wet_fraction),
        mean_mm(film),
        mean_mm(absorbed),
        film,
        absorbed,
        totals.water_nl as f64 / 1.0e6,
        ml(accounts.stock.evaporated),
        ml(accounts.water.ledger().dripped),
        ml(matter.dust),
        ml(matter.mud),
        ml(matter.snow),
        totals.impacts as f64,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(seconds: f32, hz: u32, every: Option<f32>) -> ReplayOptions {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("scene.ron");
        let scenario = format!(
            r#"(
                seconds: {seconds:?},
                tick_hz: {hz},
                camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
                materials: {{"plain": ()}},
                surfaces: [(
                    name: "ground",
                    mesh: Ground(size: (1.0, 1.0), cells: (2, 2)),
                    material: "plain",
                )],
            )"#
        );
        std::fs::write(&file, scenario).unwrap();
        ReplayOptions { every, ..ReplayOptions::new(Scenario::load(&file).unwrap()) }
    }

    #[test]
    fn every_column_has_its_name() {
        let columns = columns(&options(1.0, 60, None).scenario.scenario);
        assert_eq!(columns.len(), 29);
        let of_time = 2;
        assert_eq!(TOTALS.len(), of_time + of_particles(&ParticleCounts::default()).len() + 10);
        assert_eq!((columns[0].as_str(), columns[17].as_str()), ("tick", "ground.wet_fraction"));
    }

    #[test]
    fn rows_come_every_second_or_as_told() {
        let ticks = |seconds, hz, every| options(seconds, hz, every).series_ticks();
        assert_eq!(ticks(10.0, 60, None).unwrap(), 60);
        assert_eq!(ticks(10.0, 60, Some(0.5)).unwrap(), 30);
        assert_eq!(ticks(10.0, 60, Some(3600.0)).unwrap(), 216_000);
        assert_eq!(ticks(10.0, 60, Some(0.02)).unwrap(), 1);
        for wrong in [0.0, -1.0, f32::NAN, f32::INFINITY, 0.001] {
            let error = ticks(10.0, 60, Some(wrong)).unwrap_err().to_string();
            assert!(error.contains("`every`"), "{error}");
        }
    }

    #[test]
    fn a_day_of_rows_does_not_fill_the_memory() {
        let (day, hz) = (86_400.0f32, 1000);
        assert_eq!(options(day, hz, None).series_ticks().unwrap(), 1000);
        assert!(options(day, hz, Some(0.001)).series_ticks().is_err());
        let mut crowd = options(day, 60, None);
        let surface = crowd.scenario.scenario.surfaces[0].clone();
        crowd.scenario.scenario.surfaces = vec![surface; 10_000];
        let every = f64::from(crowd.series_ticks().unwrap());
        let rows = f64::from(day) * 60.0 / every;
        assert!(every % 60.0 == 0.0 && (rows + 1.0) * 120_017.0 <= MAX_CELLS as f64, "{every}");
    }
}
