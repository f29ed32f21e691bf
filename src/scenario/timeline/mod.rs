//! What happens when: the events of a scenario, by ticks.
//!
//! Events are worked out once, into lists in order of their ticks ([`Timeline`]); what an emitter or the camera does becomes
//! part of their own keys. In the first set of each tick (`apply`) what is due acts, found by its tick alone: nothing is
//! remembered from tick to tick, so a run that is started over or gone on with needs only to know its tick. What acts goes
//! into the [`Digest`](super::Digest), too. At the end of each tick expectations are looked at ([`expect`](Expectations)).
//!
//! An event at second `at` acts in the first tick that begins then or later, as an emitter's `start` does; what only looks
//! sees the end of the first tick that ends then or later. So an expectation sees nothing of what happens at its own time.

mod append;
mod apply;
mod check;
mod events;
mod expect;

use bevy::prelude::*;

use super::motion::{EmitterMotion, Leg, pose};
use super::{CameraKey, EmitterKey, EmitterSpec, MadeOf, Scenario};
use crate::brush::Brush;
use crate::material::{PorousMaterial, StandingWater};
use crate::weather::Weather;

pub use events::{
    Action, BrushEvent, CameraMove, EmitterAdjustment, EmitterMove, EventSpec, Expectation, MaterialChange,
    Quantity, WeatherChange,
};
pub use expect::{ExpectationOutcome, Expectations};

pub(crate) use append::append_events;
pub(super) use apply::{MaterialHandles, apply_events_plugin, insert_events};
pub(crate) use apply::{exchange_events, rewind};

/// How much of a tick a time may be off by rounding.
const ROUNDING: f64 = 1.0e-6;

/// The tick whose end is the first at this second or later; 0 is the start.
pub(crate) fn tick_at(seconds: f64, hz: u32) -> u32 {
    // Saturates, and takes NaN for 0.
    (seconds * f64::from(hz) - ROUNDING).ceil().max(0.0) as u32
}

/// The tick that is the first to begin at this second or later.
pub(crate) fn tick_from(seconds: f64, hz: u32) -> u32 {
    tick_at(seconds, hz).saturating_add(1)
}

/// The second at which a tick begins: what happens then happens in it.
pub(crate) fn beginning_of(tick: u32, hz: u32) -> f64 {
    f64::from(tick.saturating_sub(1)) / f64::from(hz)
}

/// Weather that changes from one tick to another.
#[derive(Debug, Clone, Copy, PartialEq)]
struct WeatherStep {
    /// The first tick with any of it.
    first: u32,
    /// The first tick with all of it.
    last: u32,
    /// Before.
    from: Weather,
    /// After.
    to: Weather,
}

/// What a surface is made of from a tick on.
#[derive(Debug, Clone, PartialEq)]
struct MaterialStep {
    tick: u32,
    /// Its number.
    surface: u32,
    /// Number of its material, in the order of their names, if that changes.
    material: Option<usize>,
    porous: PorousMaterial,
    water: StandingWater,
}

/// What an emitter sends out from a tick on.
#[derive(Debug, Clone, PartialEq)]
struct EmitterStep {
    tick: u32,
    /// Its number.
    emitter: u32,
    spec: EmitterSpec,
}

/// A touch of a brush.
#[derive(Debug, Clone, Copy, PartialEq)]
struct BrushStep {
    tick: u32,
    brush: Brush,
    surface: Option<u32>,
}

/// What happens, each list in order of its ticks.
#[derive(Resource, Debug, Clone, Default, PartialEq)]
pub(super) struct Timeline {
    /// At tick 0.
    weather: Weather,
    /// No two at a time, but for those of a single tick.
    changes: Vec<WeatherStep>,
    /// Of surfaces that change at all, what they are made of at first comes with tick 0.
    materials: Vec<MaterialStep>,
    /// Of emitters that are adjusted at all, what they are at first comes with tick 0.
    emitters: Vec<EmitterStep>,
    strokes: Vec<BrushStep>,
    /// Hashes of all that acts.
    acts: Vec<(u32, [u8; 32])>,
}

/// Those of a list in order of ticks that are due in one.
fn due<T>(list: &[T], tick: u32, of: impl Fn(&T) -> u32) -> &[T] {
    let first = list.partition_point(|item| of(item) < tick);
    let count = list[first..].partition_point(|item| of(item) == tick);
    &list[first..first + count]
}

/// The events in order of time; those at the same time as they are written.
fn in_order(scenario: &Scenario) -> Vec<(usize, &EventSpec)> {
    let mut events: Vec<_> = scenario.events.iter().enumerate().collect();
    events.sort_by(|(_, a), (_, b)| a.at.total_cmp(&b.at));
    events
}

/// Whether the weather is on its way from one state to another in a tick of the scenario that runs.
pub(crate) fn weather_is_changing(world: &World, tick: u32) -> bool {
    let changes = world.get_resource::<Timeline>().map_or(&[][..], |timeline| &timeline.changes[..]);
    changes.iter().any(|step| step.last > step.first && (step.first..=step.last).contains(&tick))
}

impl WeatherStep {
    /// The change of `from` that begins with tick `first`.
    fn new(change: &WeatherChange, from: Weather, first: u32, hz: u32) -> Self {
        let ticks = (change.over.max(0.0) * hz as f32).round() as u32;
        let to = Weather {
            wind: change.wind.unwrap_or(from.wind),
            temperature_c: change.temperature_c.unwrap_or(from.temperature_c),
            humidity: change.humidity.unwrap_or(from.humidity),
            sun_w_per_m2: change.sun_w_per_m2.unwrap_or(from.sun_w_per_m2),
            drying_speed: change.drying_speed.unwrap_or(from.drying_speed),
            ..from
        };
        Self { first, last: first.saturating_add(ticks.saturating_sub(1)), from, to }
    }

    /// The weather of a tick from its first to its last.
    fn at(&self, tick: u32) -> Weather {
        if tick >= self.last {
            return self.to;
        }
        let (Self { from, to, .. }, done) = (self, tick.saturating_sub(self.first) as f32 + 1.0);
        let part = done / ((self.last - self.first) as f32 + 1.0);
        let mix = |from: f32, to: f32| from + (to - from) * part;
        Weather {
            wind: from.wind.lerp(to.wind, part),
            temperature_c: mix(from.temperature_c, to.temperature_c),
            humidity: mix(from.humidity, to.humidity),
            sun_w_per_m2: mix(from.sun_w_per_m2, to.sun_w_per_m2),
            drying_speed: mix(from.drying_speed, to.drying_speed),
            ..*to
        }
    }
}

impl Timeline {
    /// What happens in a scenario that has been checked.
    pub(super) fn new(scenario: &Scenario) -> Self {
        let mut timeline = Self { weather: scenario.weather(), ..default() };
        for (_, event) in in_order(scenario) {
            timeline.add(scenario, event);
        }
        timeline.sort();
        timeline
    }

    /// Adds an event behind all others that change what it changes. Then the lists have to be sorted.
    fn add(&mut self, scenario: &Scenario, EventSpec { at, what }: &EventSpec) {
        let hz = scenario.tick_hz;
        let tick = tick_from(*at, hz);
        if what.acts() {
            self.acts.push((tick, hash(what)));
        }
        match what {
            Action::Weather(change) => {
                let weather = self.changes.last().map_or(self.weather, |step| step.to);
                self.changes.push(WeatherStep::new(change, weather, tick, hz));
            }
            Action::Brush(event) => {
                let surface = event.surface.as_deref().and_then(|name| scenario.surface_number(name));
                self.strokes.push(BrushStep { tick, brush: event.brush(), surface });
            }
            Action::Material(change) => self.add_material(scenario, change, tick),
            Action::Adjust(adjustment) => self.add_adjustment(scenario, adjustment, tick),
            _ => {}
        }
    }

    /// Puts the lists in order of ticks; what is of the same one stays as it came. Weather is in order always.
    fn sort(&mut self) {
        // What surfaces and emitters are at first was put in when they first changed.
        self.materials.sort_by_key(|step| step.tick);
        self.emitters.sort_by_key(|step| step.tick);
        self.strokes.sort_by_key(|step| step.tick);
        self.acts.sort_by_key(|(tick, _)| *tick);
    }

    fn add_material(&mut self, scenario: &Scenario, change: &MaterialChange, tick: u32) {
        let Some(surface) = scenario.surface_number(&change.surface) else { return };
        let made_of = |name: &String| {
            let index = scenario.materials.keys().position(|other| other == name)?;
            Some((index, scenario.materials.get(name)?))
        };
        let current = self.materials.iter().rev().find(|step| step.surface == surface).cloned();
        let current = current.or_else(|| {
            let MadeOf { material, porous, water } = scenario.made_of(surface)?;
            let first = MaterialStep { tick: 0, surface, material, porous, water };
            self.materials.push(first.clone());
            Some(first)
        });
        let Some(current) = current else { return };
        let mut step = MaterialStep { tick, material: None, ..current };
        if let Some((index, spec)) = change.material.as_ref().and_then(made_of) {
            step = MaterialStep { material: Some(index), porous: spec.porous, water: spec.water, ..step };
        }
        if let Some(porous) = change.porous {
            step.porous = porous;
        }
        if let Some(model) = change.model {
            step.porous.model = model;
        }
        if let Some(water) = change.water {
            step.water = water;
        }
        self.materials.push(step);
    }

    fn add_adjustment(&mut self, scenario: &Scenario, adjustment: &EmitterAdjustment, tick: u32) {
        let Some(index) = scenario.emitters.iter().position(|spec| spec.name == adjustment.emitter) else {
            return;
        };
        let emitter = index as u32;
        let current = self.emitters.iter().rev().find(|step| step.emitter == emitter);
        let mut spec = current.map(|step| step.spec.clone()).unwrap_or_else(|| {
            let first = scenario.emitters[index].clone();
            self.emitters.push(EmitterStep { tick: 0, emitter, spec: first.clone() });
            first
        });
        adjustment.make(&mut spec);
        self.emitters.push(EmitterStep { tick, emitter, spec });
    }
}

/// What stands for an event in the digest.
fn hash(what: &Action) -> [u8; 32] {
    // Numbers are written so that they are read as the same bits; what acts has no number that cannot be.
    let text = serde_json::to_vec(what).unwrap_or_default();
    *blake3::hash(&text).as_bytes()
}

/// The keys of the camera, with those of events.
pub(super) fn camera_keys(scenario: &Scenario) -> Vec<CameraKey> {
    let of_events = scenario.events.iter().filter_map(|event| match event.what {
        Action::Camera(CameraMove { eye, target }) => Some(CameraKey { t: event.at as f32, eye, target }),
        _ => None,
    });
    let mut keys: Vec<_> = scenario.camera.keys.iter().copied().chain(of_events).collect();
    keys.sort_by(|a, b| a.t.total_cmp(&b.t));
    keys
}

/// The names of pictures that are to be taken, and after which tick; in order.
pub(crate) fn captures(scenario: &Scenario) -> Vec<(u32, &str)> {
    named(scenario, |what| match what {
        Action::Capture(name) => Some(name),
        _ => None,
    })
}

/// The names under which the scene is to be exported, and after which tick; in order.
pub(crate) fn exports(scenario: &Scenario) -> Vec<(u32, &str)> {
    named(scenario, |what| match what {
        Action::Export(name) => Some(name),
        _ => None,
    })
}

/// The names that events give, and the ticks whose ends they see.
fn named<'a>(
    scenario: &'a Scenario,
    name_of: impl Fn(&'a Action) -> Option<&'a String>,
) -> Vec<(u32, &'a str)> {
    let named = in_order(scenario)
        .into_iter()
        .filter_map(|(_, event)| Some((tick_at(event.at, scenario.tick_hz), name_of(&event.what)?.as_str())));
    named.collect()
}

/// When an emitter works and where it is, with what events say of it.
pub(super) fn emitter_motion(scenario: &Scenario, spec: &EmitterSpec) -> EmitterMotion {
    let (keys, stop) = (spec.keys.clone(), spec.stop.unwrap_or(scenario.seconds));
    let mut motion = EmitterMotion { keys, legs: Vec::new(), start: spec.start, stop, switches: Vec::new() };
    for (_, event) in in_order(scenario) {
        motion.add(&spec.name, event, scenario.tick_hz);
    }
    motion
}

impl EmitterMotion {
    /// Adds an event behind all others, if it is about the emitter of this name.
    fn add(&mut self, emitter: &str, EventSpec { at, what }: &EventSpec, hz: u32) {
        match what {
            Action::Start(name) if name == emitter => self.switches.push((tick_from(*at, hz), true)),
            Action::Stop(name) if name == emitter => self.switches.push((tick_from(*at, hz), false)),
            Action::Move(step) if step.emitter == emitter => {
                let t = *at as f32;
                // A move that is under way ends here; what was before is not touched.
                let Some((position, target)) = pose(&self.keys, &self.legs, t) else { return };
                // What is at once is done by the end of the first tick that begins then, and not before.
                let arrives = t + step.over.max(0.5 / hz as f32);
                self.legs.push(Leg {
                    from: EmitterKey { t, position, target },
                    to: EmitterKey { t: arrives, position: step.position, target: step.target },
                });
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::load::ron_options;
    use super::super::{Scenario, ScenarioPart};
    use super::*;

    /// Two surfaces of two materials and an emitter, at 10 ticks a second.
    pub(super) fn scenario(events: &str) -> Scenario {
        let text = format!(
            r#"(
                seconds: 10.0,
                tick_hz: 10,
                wind: (1.0, 0.0, 0.0),
                camera: (keys: [(t: 0.0, eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0)),
                                (t: 4.0, eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
                materials: {{"clay": (porous: (capacity_mm: 0.1)), "sand": (porous: (capacity_mm: 0.5))}},
                surfaces: [
                    (name: "a", mesh: Ground(size: (1.0, 1.0), cells: (1, 1)), material: "clay"),
                    (name: "b", mesh: Ground(size: (1.0, 1.0), cells: (1, 1)), material: "sand"),
                ],
                emitters: [(name: "rain", effect: "e", rate: 1.0, speed: 1.0,
                            keys: [(position: (0.0, 2.0, 0.0), target: (0.0, 0.0, 0.0))])],
                events: {events},
            )"#
        );
        let part: ScenarioPart = ron_options().from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
        part.complete().unwrap()
    }

    #[test]
    fn ticks_begin_and_end_where_seconds_do() {
        for (seconds, hz, ends) in
            [(0.0, 60, 0), (0.3, 60, 18), (2.0, 60, 120), (2.001, 60, 121), (0.1, 10, 1)]
        {
            assert_eq!((tick_at(seconds, hz), tick_from(seconds, hz)), (ends, ends + 1), "{seconds}");
        }
        // What happened in a tick, written down by its beginning, happens in that tick again.
        for tick in 1..2000 {
            assert_eq!(tick_from(f64::from(tick - 1) / 60.0, 60), tick);
        }
    }

    #[test]
    fn what_is_due_is_found_by_its_tick() {
        let list = [1, 3, 3, 3, 7];
        let found = |tick| due(&list, tick, |item| *item).len();
        assert_eq!([0, 1, 2, 3, 7, 8].map(found), [0, 1, 0, 3, 1, 0]);
    }

    #[test]
    fn weather_changes_step_by_step_and_stays() {
        let timeline = Timeline::new(&scenario(
            "[(at: 3.0, what: Weather(humidity: 0.9)),
              (at: 1.0, what: Weather(wind: (1.0, 0.0, 4.0), temperature_c: 0.0, over: 0.4))]",
        ));
        let [first, second] = timeline.changes[..] else { panic!("{timeline:?}") };
        assert_eq!((first.first, first.last, second.first, second.last), (11, 14, 31, 31));
        let winds = [11, 12, 13, 14].map(|tick| first.at(tick).wind.z);
        assert_eq!(winds, [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(first.at(12).wind.x, 1.0);
        assert_eq!(
            (second.at(31).humidity, second.at(31).wind.z, second.at(31).temperature_c),
            (0.9, 4.0, 0.0)
        );
        assert_eq!(timeline.weather.wind.z, 0.0);
        assert_eq!(timeline.acts.iter().map(|(tick, _)| *tick).collect::<Vec<_>>(), [11, 31]);
    }

    #[test]
    fn surfaces_remember_what_they_were_made_of() {
        let timeline = Timeline::new(&scenario(
            r#"[(at: 2.0, what: Material(surface: "a", material: "sand")),
                (at: 1.0, what: Material(surface: "a", model: Lagarde(porosity: 0.5))),
                (at: 4.0, what: Material(surface: "b", material: "clay"))]"#,
        ));
        let steps: Vec<_> = timeline
            .materials
            .iter()
            .map(|step| (step.tick, step.surface, step.material, step.porous.capacity_mm))
            .collect();
        let expected = [
            (0, 0, Some(0), 0.1),
            (0, 1, Some(1), 0.5),
            (11, 0, None, 0.1),
            (21, 0, Some(1), 0.5),
            (41, 1, Some(0), 0.1),
        ];
        assert_eq!(steps, expected);
        assert_ne!(timeline.materials[2].porous.model, timeline.materials[0].porous.model);
        assert_eq!(timeline.materials[3].porous.model, timeline.materials[1].porous.model);
    }

    #[test]
    fn emitters_are_switched_and_moved_in_the_ticks_that_begin_then() {
        let scenario = scenario(
            r#"[(at: 1.0, what: Start("rain")), (at: 2.0, what: Stop("rain")),
                (at: 3.0, what: Move(emitter: "rain", position: (1.0, 2.0, 0.0), target: (0.0, 0.0, 0.0))),
                (at: 4.0, what: Move(emitter: "rain", position: (3.0, 2.0, 0.0), target: (0.0, 0.0, 0.0), over: 2.0))]"#,
        );
        let motion = emitter_motion(&scenario, &scenario.emitters[0]);
        assert_eq!(motion.switches, [(11, true), (21, false)]);
        let x_at = |tick: u32| pose(&motion.keys, &motion.legs, tick as f32 / 10.0).unwrap().0.x;
        for (tick, x) in [(1, 0.0), (30, 0.0), (31, 1.0), (40, 1.0), (50, 2.0), (60, 3.0), (90, 3.0)] {
            assert!((x_at(tick) - x).abs() < 1e-5, "{tick}: {}", x_at(tick));
        }
    }

    #[test]
    fn a_move_changes_nothing_of_what_was_before_it() {
        let from = |moves: usize| {
            let all: Vec<_> = (0..moves)
                .map(|index| {
                    let at = 0.7 + 0.3 * index as f32;
                    format!(
                        r#"(at: {at:?}, what: Move(emitter: "rain", position: ({at:?}, 2.1, 0.3), target: (0.0, 0.0, 0.0), over: 0.9))"#
                    )
                })
                .collect();
            let scenario = scenario(&format!("[{}]", all.join(", ")));
            emitter_motion(&scenario, &scenario.emitters[0])
        };
        let (some, more) = (from(5), from(12));
        let poses = |motion: &EmitterMotion, ticks: std::ops::RangeInclusive<u32>| -> Vec<_> {
            let at = |tick| pose(&motion.keys, &motion.legs, tick as f32 / 10.0).unwrap();
            ticks.map(at).collect()
        };
        // The sixth begins at 2.2 seconds.
        assert_eq!(poses(&some, 1..=22), poses(&more, 1..=22));
        assert_ne!(poses(&some, 23..=23), poses(&more, 23..=23));
    }

    #[test]
    fn emitters_remember_what_they_were() {
        let timeline = Timeline::new(&scenario(
            r#"[(at: 2.0, what: Adjust(emitter: "rain", rate: 7.0)),
                (at: 1.0, what: Adjust(emitter: "rain", spread_deg: 10.0, flow: LitresPerMinute(2.0)))]"#,
        ));
        let steps: Vec<_> =
            timeline.emitters.iter().map(|step| (step.tick, step.spec.rate, step.spec.spread_deg)).collect();
        assert_eq!(steps, [(0, 1.0, 0.0), (11, 1.0, 10.0), (21, 7.0, 10.0)]);
        assert_eq!(timeline.emitters[2].spec.initial_speed(), 1.0);
    }

    #[test]
    fn the_camera_pictures_and_exports_have_their_times() {
        let scenario = scenario(
            r#"[(at: 2.0, what: Camera(eye: (5.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))),
                (at: 10.0, what: Capture("end")), (at: 0.0, what: Capture("start")),
                (at: 0.25, what: Export("early"))]"#,
        );
        let keys = camera_keys(&scenario);
        assert_eq!(
            keys.iter().map(|key| (key.t, key.eye.x)).collect::<Vec<_>>(),
            [(0.0, 0.0), (2.0, 5.0), (4.0, 0.0)]
        );
        assert_eq!(captures(&scenario), [(0, "start"), (100, "end")]);
        assert_eq!(exports(&scenario), [(3, "early")]);
        assert!(Timeline::new(&scenario).acts.is_empty());
    }
}
