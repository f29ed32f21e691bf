//! The app of a replay, driven frame by frame.

use std::path::Path;
use std::time::Instant;

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;

use super::{ReplayError, ReplayOptions, app, capture, failure, require_adapter};
use crate::clock::WeatheringClock;
use crate::save::SavedScene;
use crate::scenario::{ScenarioPlugin, ScenarioStatus};

/// Seconds of wall-clock time after which loading or reading back is given up.
const PATIENCE_SECONDS: u64 = 300;

/// A replay under way.
pub(super) struct Run<'a> {
    pub(super) options: &'a ReplayOptions,
    pub(super) app: App,
    pub(super) target: Option<Handle<Image>>,
    /// Why one of the exports on the way is not there.
    pub(super) failed_export: Option<ReplayError>,
}

impl ReplayOptions {
    /// With the scenario as long as the run, if that is longer: what goes on to the end of the one goes on to that of the other. A
    /// shorter run leaves it as it is, since it may be gone on with. What was saved fits: that is decided by the file.
    pub(super) fn with_scenario_to_the_end(&self) -> Self {
        let mut options = self.clone();
        if let Some(seconds) = self.seconds {
            let scenario = &mut options.scenario.scenario;
            scenario.seconds = scenario.seconds.max(seconds);
        }
        options
    }
}

impl<'a> Run<'a> {
    /// Builds the app and waits until the scene is there.
    pub(super) fn load(options: &'a ReplayOptions) -> Result<Self, ReplayError> {
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
    pub(super) fn resume(&mut self, saved: &SavedScene, folder: &Path) -> Result<(), ReplayError> {
        saved.restore(self.app.world_mut(), &self.options.scenario, folder)?;
        for _ in 0..3 {
            self.step(0)?;
        }
        Ok(())
    }

    pub(super) fn tick(&self) -> u32 {
        self.app.world().resource::<WeatheringClock>().tick()
    }

    /// Goes on to the end of a tick: to the next quarter of a second at a time, so that progress can be told. Wherever it begins, frames
    /// are those of a run from the start: some things take effect at the start of a frame.
    pub(super) fn go_on(&mut self, end: u32, mut tell: impl FnMut(u32)) -> Result<(), ReplayError> {
        let quarter = (self.app.world().resource::<WeatheringClock>().hz() / 4).max(1);
        while self.tick() < end {
            let tick = self.tick();
            self.advance((quarter - tick % quarter).min(end - tick))?;
            tell(self.tick());
        }
        Ok(())
    }

    /// A frame of `ticks` ticks, and its picture. If not all of it could be painted in one frame, the picture is taken once more
    /// when it is, in place of the first.
    pub(super) fn picture(&mut self, file: String, ticks: u32) -> Result<(), ReplayError> {
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
    pub(super) fn advance(&mut self, ticks: u32) -> Result<bool, ReplayError> {
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
    pub(super) fn step(&mut self, ticks: u32) -> Result<(), ReplayError> {
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(ticks));
        self.app.update();
        failure::check(self.app.world())?;
        if self.options.render {
            failure::wait_for_gpu(self.app.world())?;
        }
        self.write_captures()
    }
}

pub(super) fn give_up_after(begun: Instant, what: &'static str) -> Result<(), ReplayError> {
    if begun.elapsed().as_secs() < PATIENCE_SECONDS {
        return Ok(());
    }
    Err(ReplayError::TimedOut { what, seconds: PATIENCE_SECONDS })
}
