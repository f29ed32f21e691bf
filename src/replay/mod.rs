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
mod export;
mod failure;
mod files;
mod maps;
mod moments;
mod plot;
mod plots;
mod report;
mod series;
mod sheet;
mod table;
mod video;

use std::path::{Path, PathBuf};
use std::time::Instant;

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;

use crate::clock::WeatheringClock;
use crate::export::{Export, ExportError};
use crate::overlay::{SplatBudget, SplatStats};
use crate::picture::PictureError;
use crate::save::{ColorMaps, SaveError, SavedScene};
use crate::scenario::{LoadedScenario, ScenarioError, ScenarioPlugin, ScenarioStatus};
use crate::schedule::TickHold;

pub(crate) use app::headless;
pub use app::{require_adapter, task_pools};
pub use capture::write_png;
pub use failure::describe_render_error;
pub use files::{DONE_FILE, write_atomic};
pub(crate) use maps::write_maps;
pub use maps::{SurfaceMaps, without_padding};
use moments::Moment;
pub(crate) use report::water_of;
pub use report::{ParticleReport, Report, SurfaceReport, Timing, WaterReport, WorkReport};
use series::SeriesTables;

/// What to run and what to write.
#[derive(Debug, Clone)]
pub struct ReplayOptions {
    /// The scenario.
    pub scenario: LoadedScenario,
    /// Folder for all that is written; made if missing. `None` writes nothing.
    pub out: Option<PathBuf>,
    /// Pictures per second of weather time; at least 1. Without a renderer there are none.
    pub fps: u32,
    /// Size of the pictures in pixels, up to [`Self::MAX_SIZE`] each way.
    pub size: UVec2,
    /// In place of the scenario's length. Counted from its start, also with `resume`.
    pub seconds: Option<f32>,
    /// In place of the scenario's seed. Not with `resume`: a saved scene goes on with its own.
    pub seed: Option<u64>,
    /// Threads to compute ticks with; all cores if `None`. The first replay of a process decides for all that follow.
    /// Exposure to air and sun is found out by a thread of the operating system for each core, whatever this says.
    pub threads: Option<usize>,
    /// Draw pictures.
    pub render: bool,
    /// A [saved scene](crate::save) to go on from.
    pub resume: Option<PathBuf>,
    /// Folder to save the scene into at the end. Of its own: neither `out` nor one that holds it.
    pub save: Option<PathBuf>,
    /// What a frame may paint. Where it is not enough for the ticks of a frame, there are more frames: pictures and maps show
    /// all, whatever it is.
    pub splats: SplatBudget,
    /// Seconds of weather time between two rows of the series, at least a tick; without, one, or more if a run is so long
    /// that the rows would be too many.
    pub every: Option<f32>,
    /// Make a video of the pictures: with ffmpeg, or else an animated PNG. Needs `out` and `render`.
    pub video: bool,
    /// Make a contact sheet of so many pictures, up to [`Self::MAX_SHEET`]. Needs `out` and `render`.
    pub sheet: Option<u32>,
    /// Folder to [export](Export::write) the scene into as it is at the end. Not `out`, and not in `save`.
    pub export: Option<PathBuf>,
}

impl ReplayOptions {
    /// The widest and highest picture.
    pub const MAX_SIZE: u32 = 8192;
    /// The most pictures on a contact sheet.
    pub const MAX_SHEET: u32 = 400;

    /// A run of `scenario` that draws small pictures at 24 a second.
    pub fn new(scenario: LoadedScenario) -> Self {
        Self {
            scenario,
            out: None,
            fps: 24,
            size: UVec2::new(640, 360),
            seconds: None,
            seed: None,
            threads: None,
            render: true,
            resume: None,
            save: None,
            splats: SplatBudget::LARGEST,
            every: None,
            video: false,
            sheet: None,
            export: None,
        }
    }
}

/// Why a replay did not finish.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum ReplayError {
    /// The scenario, or something it names, cannot be used.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// An option is out of range.
    #[error("option `{option}` is {value}, but must be {expected}")]
    Option {
        /// Its name.
        option: &'static str,
        /// What it is.
        value: String,
        /// What it must be.
        expected: String,
    },
    /// No graphics driver.
    #[error(
        "no graphics adapter found; install a Vulkan driver (Debian/Ubuntu: mesa-vulkan-drivers has one that needs \
         no GPU), or run with --no-render"
    )]
    NoAdapter,
    /// A file could not be written.
    #[error("cannot write {}: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A picture or a map could not be written.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The graphics driver failed in the middle: the device was lost, or refused what it was given.
    #[error("{0}; nothing can be drawn any more")]
    Renderer(String),
    /// The renderer did not answer.
    #[error("gave up after {seconds} s waiting for {what}")]
    TimedOut {
        /// What did not come.
        what: &'static str,
        /// How long it was waited for.
        seconds: u64,
    },
    /// The scene could not be saved or restored.
    #[error(transparent)]
    Save(#[from] SaveError),
    /// The scene could not be exported.
    #[error("the export: {0}")]
    Export(#[source] Box<ExportError>),
    /// The report could not be written as JSON.
    #[error("cannot write the report: {0}")]
    Report(#[from] serde_json::Error),
}

/// How far a replay is: ticks done, of all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Ticks done.
    pub tick: u32,
    /// Ticks in all.
    pub ticks: u32,
}

/// Seconds of wall-clock time after which loading or reading back is given up.
const PATIENCE_SECONDS: u64 = 300;

/// Runs a scenario from beginning to end.
///
/// # Errors
/// [`ReplayError`]; then nothing half-written is left, though pictures that were finished before stay.
pub fn replay(options: &ReplayOptions, mut progress: impl FnMut(Progress)) -> Result<Report, ReplayError> {
    let begun = Instant::now();
    let every = options.check()?;
    let saved = options.resume.as_deref().map(SavedScene::read).transpose()?;
    let mut run = Run::load(options)?;
    if let (Some(saved), Some(folder)) = (&saved, &options.resume) {
        run.resume(saved, folder)?;
    }
    let clock = *run.app.world().resource::<WeatheringClock>();
    let seconds = options.seconds.unwrap_or(options.scenario.scenario.seconds);
    let ticks = (f64::from(seconds) * f64::from(clock.hz())).round() as u32;
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
        Export::check_folder(folder)?;
    }
    let mut earlier = None;
    if let Some(out) = &options.out {
        files::require_writable(out)?;
        earlier = options.resume.is_some().then(|| SeriesTables::read(out));
        files::remove_earlier_outputs(out)?;
        files::remove_earlier_run(out, frames.start, &made)?;
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
        SavedScene::capture(run.app.world_mut(), &options.scenario, colors.collect()).write(folder)?;
    }
    if let (Some(export), Some(folder)) = (export, &options.export) {
        export?.write(folder, &options.stem())?;
    }
    run.failed_export.map_or(Ok(report), Err)
}

impl ReplayOptions {
    /// What is made of the pictures in the folder.
    fn write_pictures(&self, out: &Path) -> Result<(), ReplayError> {
        if !self.video && self.sheet.is_none() {
            return Ok(());
        }
        let frames = files::frames(out);
        if let Some(count) = self.sheet {
            let seconds = |number: u32| f64::from(number) / f64::from(self.fps);
            let pictures: Vec<_> =
                frames.iter().map(|(number, path)| (seconds(*number), path.clone())).collect();
            sheet::write_sheet(out, &pictures, count)?;
        }
        if self.video {
            let files: Vec<_> = frames.into_iter().map(|(_, path)| path).collect();
            video::write_video(out, &files, self.fps)?;
        }
        Ok(())
    }

    /// Checks all options, and tells how many ticks apart the rows of the series are.
    fn check(&self) -> Result<u32, ReplayError> {
        let wrong =
            |option, value: String, expected: String| Err(ReplayError::Option { option, value, expected });
        if self.fps == 0 || self.fps > WeatheringClock::MAX_HZ {
            return wrong("fps", self.fps.to_string(), format!("1 to {}", WeatheringClock::MAX_HZ));
        }
        if self.size.min_element() == 0 || self.size.max_element() > Self::MAX_SIZE {
            let value = format!("{}x{}", self.size.x, self.size.y);
            return wrong("size", value, format!("1x1 to {0}x{0}", Self::MAX_SIZE));
        }
        let most = crate::scenario::Scenario::MAX_SECONDS;
        if let Some(seconds) = self.seconds
            && !(seconds > 0.0 && seconds <= most)
        {
            return wrong("seconds", seconds.to_string(), format!("above 0 and at most {most}"));
        }
        if self.threads == Some(0) {
            return wrong("threads", "0".into(), "at least 1".into());
        }
        if let (Some(seed), Some(_)) = (self.seed, &self.resume) {
            return wrong(
                "seed",
                seed.to_string(),
                "left out with `resume`: a saved scene has its own".into(),
            );
        }
        let place = |folder: &Path| std::path::absolute(folder).unwrap_or_else(|_| folder.into());
        if let (Some(save), Some(out)) = (&self.save, &self.out)
            && place(out).join("maps").starts_with(place(save))
        {
            let value = save.display().to_string();
            return wrong("save", value, "a folder of its own, beside those of `out` or in them".into());
        }
        if let Some(export) = &self.export {
            let is_same = self.out.as_ref().is_some_and(|out| place(out) == place(export));
            if is_same || self.save.as_ref().is_some_and(|save| place(export).starts_with(place(save))) {
                let value = export.display().to_string();
                return wrong("export", value, "another folder than `out`, and not in `save`".into());
            }
        }
        if let Some(count) = self.sheet
            && !(1..=Self::MAX_SHEET).contains(&count)
        {
            return wrong("sheet", count.to_string(), format!("1 to {}", Self::MAX_SHEET));
        }
        for (option, is_set) in [("video", self.video), ("sheet", self.sheet.is_some())] {
            if is_set && (self.out.is_none() || !self.render) {
                return wrong(option, "set".into(), "used with `out` and with `render`".into());
            }
        }
        self.series_ticks()
    }
}

/// A replay under way.
struct Run<'a> {
    options: &'a ReplayOptions,
    app: App,
    target: Option<Handle<Image>>,
    /// Why one of the exports on the way is not there.
    failed_export: Option<ReplayError>,
}

impl<'a> Run<'a> {
    /// Builds the app and waits until the scene is there.
    fn load(options: &'a ReplayOptions) -> Result<Self, ReplayError> {
        if options.render {
            require_adapter()?;
        }
        let mut scenario = if options.exports() && !options.render {
            ScenarioPlugin::with_materials(options.scenario.clone())?
        } else {
            ScenarioPlugin::new(options.scenario.clone(), options.render)?
        };
        scenario.seed = options.seed;
        let mut app = app::build(options, scenario);
        let target = options.render.then(|| capture::add_target(app.world_mut(), options.size));
        let mut run = Self { options, app, target, failed_export: None };
        let begun = Instant::now();
        loop {
            run.step(0)?;
            match run.app.world_mut().resource_mut::<ScenarioStatus>().as_mut() {
                ScenarioStatus::Ready => break,
                ScenarioStatus::Loading => {}
                failed => {
                    if let ScenarioStatus::Failed(error) = std::mem::take(failed) {
                        return Err(error.into());
                    }
                }
            }
            give_up_after(begun, "the scene to load")?;
            // Loading goes on in other threads.
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        // Materials are exchanged and drawn in the frames after; the first picture must not miss them.
        for _ in 0..3 {
            run.step(0)?;
        }
        Ok(run)
    }

    /// Puts a saved scene in place of the fresh one.
    fn resume(&mut self, saved: &SavedScene, folder: &Path) -> Result<(), ReplayError> {
        saved.restore(self.app.world_mut(), &self.options.scenario, folder)?;
        for _ in 0..3 {
            self.step(0)?;
        }
        Ok(())
    }

    fn tick(&self) -> u32 {
        self.app.world().resource::<WeatheringClock>().tick()
    }

    /// Goes on to the end of a tick: a quarter of a second at a time, so that progress can be told.
    fn go_on(&mut self, end: u32, mut tell: impl FnMut(u32)) -> Result<(), ReplayError> {
        let quarter = (self.app.world().resource::<WeatheringClock>().hz() / 4).max(1);
        while self.tick() < end {
            self.advance(quarter.min(end - self.tick()))?;
            tell(self.tick());
        }
        Ok(())
    }

    /// A frame of `ticks` ticks, and its picture. If not all of it could be painted in one frame, the picture is taken once more
    /// when it is, in place of the first.
    fn picture(&mut self, file: String, ticks: u32) -> Result<(), ReplayError> {
        self.capture(file.clone())?;
        if !self.advance(ticks)? && self.options.out.is_some() {
            self.finish_captures()?;
            self.finish_painting()?;
            self.capture(file)?;
            self.step(0)?;
        }
        Ok(())
    }

    /// So many ticks, in one frame, or in more where ticks are held until what waits is painted. Returns whether one frame did
    /// and painted all.
    fn advance(&mut self, ticks: u32) -> Result<bool, ReplayError> {
        let end = self.tick() + ticks;
        self.step(ticks)?;
        let whole = self.tick() == end && self.waiting() == 0;
        let (mut begun, mut tick) = (Instant::now(), self.tick());
        while tick < end {
            self.finish_painting()?;
            self.step(end - tick)?;
            if self.tick() > tick {
                (begun, tick) = (Instant::now(), self.tick());
            }
            give_up_after(begun, "time to go on")?;
        }
        Ok(whole)
    }

    /// One frame that holds `ticks` ticks.
    fn step(&mut self, ticks: u32) -> Result<(), ReplayError> {
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(ticks));
        self.app.update();
        failure::check(self.app.world())?;
        if self.options.render {
            failure::wait_for_gpu(self.app.world())?;
        }
        self.write_captures()
    }
}

fn give_up_after(begun: Instant, what: &'static str) -> Result<(), ReplayError> {
    if begun.elapsed().as_secs() < PATIENCE_SECONDS {
        return Ok(());
    }
    Err(ReplayError::TimedOut { what, seconds: PATIENCE_SECONDS })
}
