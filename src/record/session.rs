//! The session that is recorded.

use std::path::{Path, PathBuf};

use bevy::prelude::*;

use super::RecordError;
use super::actions::{Recorded, all_events, new_events};
use super::emitters::Change;
use super::file::{text_of, write};
use super::history::History;
use super::watch::{Complaints, Watched};
use crate::brush::{BrushQueue, Stroke};
use crate::clock::WeatheringClock;
use crate::effect::WeatherEffect;
use crate::emitter::EmissionDetail;
use crate::save::SavedScene;
use crate::scenario::{
    Action, BrushEvent, EventSpec, LoadedScenario, Scenario, ScenarioStatus, ScenarioSurface, WeatherChange,
    append_events, beginning_of, check_weather, exchange_events, scene_digest, tick_from,
    weather_is_changing,
};
use crate::weather::Weather;

/// What a session is about to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// The scene is being loaded.
    Loading,
    /// What is done is recorded.
    Live,
    /// All has been taken back to the start, which has to be seen before a moment can be put back.
    Clearing { target: u32 },
    /// Ticks run by what was recorded.
    CatchingUp { target: u32 },
}

/// A session that is being recorded.
#[derive(Resource)]
pub struct Recording {
    /// The scenario that runs, with the events of now.
    pub(super) loaded: LoadedScenario,
    /// Those that it had at the start.
    pub(super) base: Vec<EventSpec>,
    /// In order of their ticks.
    pub(super) actions: Vec<Recorded>,
    /// Some of them are no more, and their events still are.
    is_stale: bool,
    /// Waiting for the next tick; added by the app.
    others: Vec<Action>,
    /// Emitters that come or go in the next tick.
    pub(super) changes: Vec<Change>,
    /// Number of the stroke that is being painted, or was last; 1 or more.
    stroke: u32,
    /// Numbers of the strokes that touches which wait are of, as far as they have been seen.
    waiting: Vec<u32>,
    flaws: Vec<(u32, &'static str)>,
    notes: Vec<String>,
    pub(super) watched: Watched,
    pub(super) phase: Phase,
    /// The last tick that has run.
    pub(super) tick: u32,
    /// The last tick that is recorded.
    pub(super) end: u32,
    pub(super) history: History,
}

impl Recording {
    /// The most events that are recorded, those of the scenario included.
    pub const MAX_EVENTS: usize = Scenario::MAX_EVENTS;
    /// Seconds between two moments that are kept.
    pub const MOMENT_SECONDS: u32 = 5;

    /// The file that [`save`] writes.
    pub fn file(&self) -> &Path {
        &self.loaded.file
    }

    /// The scenario that runs, with what has been done so far.
    pub fn scenario(&self) -> &LoadedScenario {
        &self.loaded
    }

    /// What was done that events cannot say, with the second: a replay comes out differently.
    pub fn flaws(&self) -> impl Iterator<Item = (f64, &'static str)> {
        let hz = f64::from(self.hz());
        self.flaws.iter().map(move |(tick, flaw)| (f64::from(*tick) / hz, *flaw))
    }

    /// What was not done because it cannot be recorded, since this was last asked for.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// What was done so far: number of events.
    pub fn len(&self) -> usize {
        self.actions.len()
    }

    /// Whether nothing was done yet.
    pub fn is_empty(&self) -> bool {
        self.actions.is_empty()
    }

    /// Seconds that are recorded.
    pub fn seconds(&self) -> f64 {
        f64::from(self.end) / f64::from(self.hz())
    }

    /// Number of kept moments, and their bytes.
    pub fn moments(&self) -> (usize, usize) {
        self.history.size()
    }

    /// Whether what is done now is recorded: the scene is there, and no time is being gone back in.
    pub fn is_live(&self) -> bool {
        self.phase == Phase::Live
    }

    /// Whether all that is recorded has run: what comes now is new.
    pub fn is_at_end(&self) -> bool {
        self.is_live() && self.tick >= self.end
    }

    /// Whether surfaces have been taken back to the start, and a frame has to go by before [`put_back`](super::put_back).
    pub fn is_clearing(&self) -> bool {
        matches!(self.phase, Phase::Clearing { .. })
    }

    /// Whether ticks have to run until a second that is gone to is reached.
    pub fn is_catching_up(&self) -> bool {
        matches!(self.phase, Phase::CatchingUp { .. })
    }

    /// Whether a moment should be kept before the next tick; see [`keep_moment`](super::keep_moment).
    pub fn wants_moment(&self) -> bool {
        let every = Self::MOMENT_SECONDS.saturating_mul(self.hz());
        // The start needs none.
        let last = self.history.before(self.tick).map_or(0, SavedScene::tick);
        self.is_live() && self.tick.saturating_sub(last) >= every
    }

    /// Records something that is not found by itself: where the camera is. What acts on the scene is left to those who do it
    /// there. In what has been recorded already, nothing is added.
    pub fn add(&mut self, action: Action) {
        if !action.acts() && self.is_at_end() {
            self.others.push(action);
        }
    }

    /// What is painted from now on is another stroke, to be [taken back](super::take_back_stroke) by itself.
    pub fn begin_stroke(&mut self) {
        self.stroke += 1;
    }

    /// Number of strokes that can be taken back: of those before the present, and of those that wait for the next tick.
    pub fn strokes(&self) -> usize {
        // Later ones have higher numbers, so each is a run.
        let mut last = 0;
        let begins = |stroke: &u32| *stroke > 0 && std::mem::replace(&mut last, *stroke) != *stroke;
        self.painted().chain(self.waiting.iter().copied()).filter(begins).count()
    }

    /// Numbers of the strokes that what was done until now is of, 0 for what is no touch.
    fn painted(&self) -> impl Iterator<Item = u32> {
        self.actions.iter().filter(|action| action.tick <= self.tick).map(|action| action.stroke)
    }

    /// Number of the last stroke that was painted, or waits to be.
    pub(super) fn last_stroke(&self) -> Option<u32> {
        self.painted().chain(self.waiting.iter().copied()).max().filter(|stroke| *stroke > 0)
    }

    /// Touches that have come since this was done last are of the stroke that is being painted.
    pub(super) fn number_touches(&mut self, world: &World) {
        let count = world.get_resource::<BrushQueue>().map_or(0, |queue| queue.0.len());
        self.waiting.resize(count, self.stroke);
    }

    /// Touches of a stroke, and of those after it, that wait for the next tick do not happen.
    pub(super) fn drop_touches(&mut self, world: &mut World, stroke: u32) {
        let kept = self.waiting.partition_point(|number| *number < stroke);
        self.waiting.truncate(kept);
        if let Some(mut queue) = world.get_resource_mut::<BrushQueue>() {
            queue.0.truncate(kept);
        }
    }

    pub(super) fn hz(&self) -> u32 {
        self.loaded.scenario.tick_hz
    }

    pub(super) fn uses(&self, effect: AssetId<WeatherEffect>) -> bool {
        self.phase != Phase::Loading && self.watched.uses(effect)
    }

    /// Each is told once, and is as old as the earliest tick in which it was found, also by somebody who has gone back.
    pub(super) fn add_flaw(&mut self, flaw: &'static str) {
        if let Some((tick, _)) = self.flaws.iter_mut().find(|(_, other)| *other == flaw) {
            *tick = self.tick.min(*tick);
            return;
        }
        let seconds = f64::from(self.tick) / f64::from(self.hz());
        warn!("{flaw}: the recording does not replay as it was from {seconds:.1} s on");
        self.flaws.push((self.tick, flaw));
    }

    pub(super) fn add_note(&mut self, note: impl Into<String>) {
        let note = note.into();
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    fn tell(&mut self, complaints: Complaints) {
        complaints.refused.into_iter().for_each(|note| self.add_note(note));
        complaints.flaws.into_iter().for_each(|flaw| self.add_flaw(flaw));
    }

    /// What waits for the next tick does not happen: in another second it would be a branch that nobody wanted.
    /// Strokes that wait go with the reset.
    pub(super) fn forget_wishes(&mut self) {
        self.others.clear();
        self.changes.clear();
        self.waiting.clear();
        self.watched.forget_wishes();
    }

    /// Takes back what was changed since events last acted, for the next tick.
    fn take_back(&mut self, world: &mut World) {
        self.number_touches(world);
        if self.phase == Phase::Loading && matches!(world.resource::<ScenarioStatus>(), ScenarioStatus::Ready)
        {
            self.phase = Phase::Live;
        }
        let is_live = self.is_live();
        let mut complaints = Complaints::default();
        self.watched.take_back(world, is_live, self.tick, &mut complaints);
        if is_live {
            self.watched.look_for_strangers(world, &mut complaints);
            self.tell(complaints);
        }
    }

    /// What is wanted in a tick, with the numbers of strokes, 0 for what is none.
    fn take_actions(&mut self, world: &mut World, tick: u32) -> Vec<(Action, u32)> {
        let mut actions = self.change_emitters(world, tick);
        self.watched.take_actions(tick, self.hz(), &mut actions);
        if let Some(change) = self.watched.take_weather() {
            match self.refusal_of(world, &change, tick) {
                None => actions.push(Action::Weather(change)),
                Some(note) => self.add_note(note),
            }
        }
        let mut actions: Vec<_> = actions.into_iter().map(|action| (action, 0)).collect();
        let numbers = std::mem::take(&mut self.waiting);
        for (Stroke { brush, surface }, number) in take_strokes(world).into_iter().zip(numbers) {
            let name = surface
                .map(|surface| world.get::<ScenarioSurface>(surface).map(|surface| surface.name.clone()));
            if name == Some(None) {
                self.add_note("only surfaces of the scenario are painted while a session is recorded");
                continue;
            }
            let touch = BrushEvent {
                kind: brush.kind,
                point: brush.point,
                radius: brush.radius,
                strength: brush.strength,
                surface: name.flatten(),
            };
            actions.push((Action::Brush(touch), number));
        }
        actions.extend(self.others.drain(..).map(|action| (action, 0)));
        actions
    }

    /// Why the weather cannot change so.
    fn refusal_of(&self, world: &World, change: &WeatherChange, tick: u32) -> Option<String> {
        if weather_is_changing(world, tick) {
            return Some("the scenario is changing the weather just now".into());
        }
        let was = self.watched.weather();
        let becomes = Weather {
            wind: change.wind.unwrap_or(was.wind),
            temperature_c: change.temperature_c.unwrap_or(was.temperature_c),
            humidity: change.humidity.unwrap_or(was.humidity),
            sun_w_per_m2: change.sun_w_per_m2.unwrap_or(was.sun_w_per_m2),
            drying_speed: change.drying_speed.unwrap_or(was.drying_speed),
            ..*was
        };
        check_weather(&becomes).err().map(|wrong| wrong.to_string())
    }

    /// Lets things happen in a tick, and from then on be recorded.
    fn record(&mut self, world: &mut World, tick: u32, actions: Vec<(Action, u32)>) {
        let at = beginning_of(tick, self.hz());
        let (mut is_past, mut count) = (tick <= self.end, 0);
        for (what, stroke) in actions {
            let event = EventSpec { at, what };
            if let Err(error) = self.loaded.validate_new_event("events[_]", &event) {
                self.add_note(error.to_string());
                continue;
            }
            // What a branch leaves behind makes room.
            let left = self.actions.iter().rev().take_while(|action| is_past && action.tick >= tick).count();
            if self.base.len() + self.actions.len() - left >= Self::MAX_EVENTS {
                self.add_note(format!("no more is recorded: there are {} events", Self::MAX_EVENTS));
                break;
            }
            if std::mem::take(&mut is_past) {
                self.branch(world, tick);
            }
            self.actions.push(Recorded { tick, what: event.what, stroke });
            count += 1;
        }
        if !self.add_events(world, count) {
            self.update_events(world);
        }
    }

    /// Lets the last so many actions happen, too; `false` if all events have to be worked out anew.
    fn add_events(&mut self, world: &mut World, count: usize) -> bool {
        let (before, new) = self.actions.split_at(self.actions.len() - count);
        let events = new_events(&self.base, before, new, self.hz()).filter(|_| !self.is_stale);
        match events {
            Some(events) if append_events(world, &self.loaded.scenario, &events) => {
                self.loaded.scenario.events.extend(events);
                true
            }
            _ => false,
        }
    }

    /// Lets what was done, and nothing else, happen from here on.
    pub(super) fn update_events(&mut self, world: &mut World) {
        self.loaded.scenario.events = all_events(&self.base, &self.actions, self.hz());
        exchange_events(world, &self.loaded.scenario);
        self.is_stale = false;
    }

    /// What was done in this tick or later is no more; it is written into a file of its own.
    pub(super) fn branch(&mut self, world: &mut World, tick: u32) {
        let kept = self.actions.partition_point(|action| action.tick < tick);
        if kept < self.actions.len() {
            let old = free_file(&self.loaded.file);
            let written = self.text_at(world, &old, self.end).and_then(|text| write(&old, text.as_bytes()));
            self.add_note(match written {
                Ok(()) => format!("a branch; what was recorded after it is in {}", old.display()),
                Err(error) => format!("a branch; what was recorded after it is lost: {error}"),
            });
        }
        self.actions.truncate(kept);
        self.is_stale = true;
        self.flaws.retain(|(at, _)| *at < tick);
        self.history.forget_after(tick.saturating_sub(1));
        self.forget_emitters(world, tick);
        self.end = tick;
    }

    /// The file that says what was done up to a tick.
    fn text_at(&self, world: &mut World, file: &Path, end: u32) -> Result<String, RecordError> {
        let hz = self.hz();
        let mut scenario = self.loaded.scenario.clone();
        let seconds = (f64::from(end.max(1)) / f64::from(hz)) as f32;
        scenario.seconds = seconds;
        scenario
            .events
            .retain(|event| event.at <= f64::from(seconds) && tick_from(event.at, hz) <= end.max(1));
        scenario.flaws.extend(self.flaws().map(|(at, flaw)| format!("{at:.2} s: {flaw}")));
        let mut remark = String::new();
        if end == world.resource::<WeatheringClock>().tick() && self.is_live() {
            remark = format!("Digest after {end} ticks: {}", scene_digest(world));
        }
        text_of(&scenario, file, &remark)
    }
}

/// Strokes that wait.
fn take_strokes(world: &mut World) -> Vec<Stroke> {
    world.get_resource_mut::<BrushQueue>().map(|mut queue| std::mem::take(&mut queue.0)).unwrap_or_default()
}

/// `name_1.ron`, `name_2.ron`, ...: the first that is not there beside a file.
fn free_file(file: &Path) -> PathBuf {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let named = |number: u32| file.with_file_name(format!("{stem}_{number}.ron"));
    (1..).map(named).find(|path| !path.exists()).unwrap_or_else(|| named(0))
}

/// Begins to record: `base` is what [`prepare`](super::prepare) has made, and has just become the scenario of the world, which
/// still loads it. Emission has full detail until the [`end`].
pub fn begin(world: &mut World, base: LoadedScenario) {
    if let Some(mut detail) = world.get_resource_mut::<EmissionDetail>() {
        detail.fix(true);
    }
    take_strokes(world);
    let watched = Watched::new(world);
    world.insert_resource(Recording {
        base: base.scenario.events.clone(),
        loaded: base,
        actions: Vec::new(),
        is_stale: false,
        others: Vec::new(),
        changes: Vec::new(),
        stroke: 1,
        waiting: Vec::new(),
        flaws: Vec::new(),
        notes: Vec::new(),
        watched,
        phase: Phase::Loading,
        tick: 0,
        end: 0,
        history: History::default(),
    });
}

/// Writes what was recorded so far, whole or not at all; returns the file, which `weathering replay` runs to the same digest.
///
/// # Errors
/// [`RecordError`]. The recording goes on.
pub fn save(world: &mut World) -> Result<PathBuf, RecordError> {
    let Some(recording) = world.remove_resource::<Recording>() else { return Err(RecordError::NotRecording) };
    let file = recording.loaded.file.clone();
    let text = recording.text_at(world, &file, recording.end);
    world.insert_resource(recording);
    write(&file, text?.as_bytes())?;
    Ok(file)
}

/// Ends a recording without writing anything. What was done goes on as it is.
pub fn end(world: &mut World) {
    world.remove_resource::<Recording>();
    if let Some(mut detail) = world.get_resource_mut::<EmissionDetail>() {
        detail.fix(false);
    }
}

/// What the last frame has changed.
pub(super) fn between_ticks(world: &mut World) {
    world.resource_scope(|world, mut recording: Mut<Recording>| recording.take_back(world));
}

/// Lets what was wanted happen in the tick that begins.
pub(super) fn begin_tick(world: &mut World) {
    world.resource_scope(|world, mut recording: Mut<Recording>| {
        let recording = &mut *recording;
        recording.take_back(world);
        let tick = world.resource::<WeatheringClock>().tick();
        if recording.is_live() && tick != recording.tick.saturating_add(1) {
            recording
                .add_flaw("the scene was started over, or gone on with, by other ways than the recording's");
        }
        recording.tick = tick;
        if !recording.is_live() {
            take_strokes(world);
            recording.waiting.clear();
            return;
        }
        let actions = recording.take_actions(world, tick);
        if !actions.is_empty() {
            recording.record(world, tick, actions);
        }
        recording.end = recording.end.max(tick);
    });
}

/// What events have made of it.
pub(super) fn end_tick(world: &mut World) {
    world.resource_scope(|world, mut recording: Mut<Recording>| {
        let recording = &mut *recording;
        recording.watched.look(world);
        if let Phase::CatchingUp { target } = recording.phase
            && recording.tick >= target
        {
            recording.phase = Phase::Live;
        }
    });
}
