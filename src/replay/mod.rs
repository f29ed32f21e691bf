//! Running a scenario without a window, as fast as it goes, to pictures, maps and a report.
//!
//! Frames are driven by hand: between two pictures exactly as many ticks run as the clock says, so what happens does
//! not depend on the frame rate, nor on whether anything is drawn at all. Without a renderer splats are painted on
//! the CPU by the same integer arithmetic, and the digest over impacts and amounts comes out the same.
//!
//! Nothing is written before the scene is loaded; each file is written under a temporary name and then renamed.
//!
//! | file | what it holds |
//! |---|---|
//! | `frame_00000.png`, ... | pictures |
//! | `capture_<name>.png`, `export_<name>/` | pictures and exports that events ask for |
//! | `maps/` | all maps of all surfaces at the end |
//! | `series.csv`, `timings.csv` | a row every so often: amounts and particles; how long ticks took |
//! | `plots/*.svg` | these rows as lines |
//! | `video.mp4` or `video.apng`, `sheet.png` | the pictures, if asked for |
//! | `report.json` | the numbers at the end; written last |
//!
//! The scene as it is at the end can be [exported](crate::export::Snapshot) into a folder of its own, too.

mod app;
mod capture;
mod error;
mod export;
mod failure;
mod files;
mod maps;
mod moments;
mod options;
mod plot;
mod plots;
mod report;
mod run;
mod series;
mod sheet;
mod table;
mod video;

use std::collections::BTreeSet;
use std::time::Instant;

use crate::clock::WeatheringClock;
use crate::export::Export;
use crate::overlay::SplatStats;
use crate::save::{ColorMaps, SavedScene};
use crate::scenario::ticks_in;
use crate::schedule::TickHold;

pub(crate) use app::headless;
pub use app::{require_adapter, task_pools};
pub use capture::write_png;
pub use error::ReplayError;
pub use failure::describe_render_error;
pub use files::{DONE_FILE, write_atomic};
pub(crate) use maps::write_maps;
pub use maps::{SurfaceMaps, without_padding};
use moments::Moment;
pub use options::ReplayOptions;
pub(crate) use report::water_of;
pub use report::{ParticleReport, Report, SurfaceReport, Timing, WaterReport, WorkReport};
use run::{Run, give_up_after};
use series::SeriesTables;

/// How far a replay is: ticks done, of all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Ticks done.
    pub tick: u32,
    /// Ticks in all.
    pub ticks: u32,
}

/// Runs a scenario from beginning to end.
///
/// # Errors
/// [`ReplayError`]; then nothing half-written is left, though pictures that were finished before stay.
pub fn replay(options: &ReplayOptions, mut progress: impl FnMut(Progress)) -> Result<Report, ReplayError> {
    let begun = Instant::now();
    let every = options.check()?;
    let options = &options.with_scenario_to_the_end();
    let saved = options.resume.as_deref().map(SavedScene::read).transpose()?;
    let mut run = Run::load(options)?;
    if let (Some(saved), Some(folder)) = (&saved, &options.resume) {
        run.resume(saved, folder)?;
    }
    let clock = *run.app.world().resource::<WeatheringClock>();
    let seconds = options.seconds.unwrap_or(options.scenario.scenario.seconds);
    let ticks = ticks_in(seconds, clock.hz());
    let mut tick = clock.tick();
    if ticks < tick {
        let expected = format!("at least {}, the time of the saved scene", clock.seconds());
        return Err(ReplayError::Option { option: "seconds", value: seconds.to_string(), expected });
    }
    // The first picture that is due at a tick or later.
    let frame_at =
        |tick: u32| (u64::from(tick) * u64::from(options.fps)).div_ceil(u64::from(clock.hz())) as u32;
    // Those before were drawn before it was saved.
    let frames = frame_at(tick)..(if options.render { frame_at(ticks) } else { 0 });
    let (made, mut asked_for) = moments::asked_for(&options.scenario.scenario, tick);
    if let Some(folder) = &options.save {
        SavedScene::check_folder(folder)?;
    }
    if let Some(folder) = &options.export {
        Export::check_folder(folder, &options.stem())?;
    }
    let mut earlier = None;
    if let Some(out) = &options.out {
        let surfaces: BTreeSet<String> =
            options.scenario.scenario.surface_names().map(String::from).collect();
        let inputs = options.scenario.named_files()?;
        files::refuse_inputs(&inputs, out, frames.start, &made, &surfaces)?;
        files::require_writable(out)?;
        earlier = options.resume.is_some().then(|| SeriesTables::read(out));
        files::remove_earlier_outputs(out, earlier.is_some())?;
        files::remove_earlier_run(out, frames.start, &made, &surfaces)?;
        run.begin_series(every);
    }
    let loaded = begun.elapsed();

    let due_at = |frame: u32| (u64::from(frame) * u64::from(clock.hz()) / u64::from(options.fps)) as u32;
    let mut moments: Vec<_> =
        frames.clone().map(|frame| (due_at(frame), Moment::Picture(files::frame_file(frame)))).collect();
    asked_for.retain(|(due, moment)| *due <= ticks && moment.is_made(options));
    moments.extend(asked_for);
    moments.sort_by_key(|(due, _)| *due);
    let mut tell = |tick: u32| progress(Progress { tick, ticks });
    for (due, moment) in moments {
        match moment {
            Moment::Picture(file) => run.picture(file, due - tick)?,
            Moment::Export(folder) => {
                run.go_on(due, &mut tell)?;
                run.export_into(&folder)?;
            }
        }
        tick = due;
        tell(tick);
    }
    run.go_on(ticks, &mut tell)?;
    run.finish_captures()?;
    let mut series = run.end_series();
    if let (Some(series), Some(earlier)) = (&mut series, &earlier) {
        series.put_before(earlier);
    }
    let simulated = begun.elapsed() - loaded;

    let maps = run.read_maps()?;
    let timing = Timing {
        load_seconds: loaded.as_secs_f64(),
        run_seconds: simulated.as_secs_f64(),
        total_seconds: begun.elapsed().as_secs_f64(),
        frames: frames.len() as u32,
        carried_splats: run.app.world().get_resource::<SplatStats>().map_or(0, SplatStats::carried),
        held_ticks: run.app.world().resource::<TickHold>().ticks,
    };
    let report = report::report(run.app.world_mut(), options, &maps, timing);
    // That it fails is no reason to lose the rest.
    let export = options.export.is_some().then(|| run.export(&maps));
    if let Some(out) = &options.out {
        write_maps(&out.join("maps"), &maps)?;
        if let Some(series) = &series {
            series.write(out)?;
            plots::write_plots(out, &report.scenario, series)?;
        }
        options.write_pictures(out)?;
        write_atomic(&out.join("report.json"), &serde_json::to_vec_pretty(&report)?)?;
    }
    if let Some(folder) = &options.save {
        let colors = maps.into_iter().map(|maps| ColorMaps {
            diffuse: maps.diffuse,
            specular: maps.specular,
            normal: maps.normal,
        });
        let world = run.app.world_mut();
        let mut scene = SavedScene::capture(world, &options.scenario, colors.collect());
        if let Some(saved) = &saved {
            scene = scene.with_all_of(world, saved)?;
        }
        scene.write(folder)?;
    }
    if let (Some(export), Some(folder)) = (export, &options.export) {
        export?.write(folder, &options.stem())?;
    }
    run.failed_export.map_or(Ok(report), Err)
}
