//! What happens when: the events of a scenario, by ticks.
//!
//! Events are worked out once, into lists in order of their ticks (`steps`); what an emitter or the camera does becomes
//! part of their own keys. In the first set of each tick (`apply`) what is due acts, found by its tick alone: nothing is
//! remembered from tick to tick, so a run that is started over or gone on with needs only to know its tick. What acts goes
//! into the [`Digest`](super::Digest), too. At the end of each tick expectations are looked at ([`expect`](Expectations)).
//!
//! An event at second `at` acts in the first tick that begins then or later, as an emitter's `start` does; what only looks
//! sees the end of the first tick that ends then or later, or of the last one there is: a length is rounded to whole ticks. So an
//! expectation sees nothing of what happens at its own time.

mod append;
mod apply;
mod check;
mod events;
mod expect;
mod moves;
mod steps;

use bevy::prelude::*;

use super::{CameraKey, Scenario};
use steps::Timeline;

pub use events::{
    Action, BrushEvent, CameraMove, EmitterAdjustment, EmitterMove, EventSpec, Expectation, MaterialChange,
    Quantity, WeatherChange,
};
pub use expect::{ExpectationOutcome, Expectations};

pub(crate) use append::append_events;
pub(super) use apply::{MaterialHandles, apply_events_plugin, insert_events};
pub(crate) use apply::{exchange_events, rewind};
pub(super) use moves::emitter_motion;

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

/// Ticks of a run of so many seconds: to the nearest, and one at least.
pub(crate) fn ticks_in(seconds: f32, hz: u32) -> u32 {
    (f64::from(seconds) * f64::from(hz)).round().max(1.0) as u32
}

/// The tick whose end is seen by what looks at this second.
fn seen_at(seconds: f64, scenario: &Scenario) -> u32 {
    // Where half a tick is cut off at the end, what looks in it would never do so.
    tick_at(seconds, scenario.tick_hz).min(ticks_in(scenario.seconds, scenario.tick_hz))
}

/// The second at which a tick begins: what happens then happens in it.
pub(crate) fn beginning_of(tick: u32, hz: u32) -> f64 {
    f64::from(tick.saturating_sub(1)) / f64::from(hz)
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
        .filter_map(|(_, event)| Some((seen_at(event.at, scenario), name_of(&event.what)?.as_str())));
    named.collect()
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
    fn a_run_has_whole_ticks_and_one_at_least() {
        for (seconds, hz, ticks) in [(10.0, 10, 100), (10.04, 10, 100), (10.06, 10, 101), (0.004, 60, 1)] {
            assert_eq!(ticks_in(seconds, hz), ticks, "{seconds}");
        }
        assert_eq!(ticks_in(Scenario::MAX_SECONDS, 1000), 86_400_000);
    }

    #[test]
    fn what_looks_at_the_end_sees_the_last_tick() {
        let events = r#"[(at: 10.04, what: Capture("end")), (at: 9.99, what: Export("end"))]"#;
        let of_length = |seconds: f32| Scenario { seconds, ..scenario(events) };
        let short = of_length(10.04);
        assert_eq!((captures(&short), exports(&short)), (vec![(100, "end")], vec![(100, "end")]));
        // Where there is more to come, the first that ends then or later.
        assert_eq!(captures(&of_length(20.0)), [(101, "end")]);
    }

    #[test]
    fn what_is_due_is_found_by_its_tick() {
        let list = [1, 3, 3, 3, 7];
        let found = |tick| due(&list, tick, |item| *item).len();
        assert_eq!([0, 1, 2, 3, 7, 8].map(found), [0, 1, 0, 3, 1, 0]);
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
