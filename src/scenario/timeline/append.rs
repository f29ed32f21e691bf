//! Events that come while a scenario runs: what is recorded.
//!
//! Somebody who holds a hose or drags a slider makes a dozen of them a second. They come behind what has acted, so they are
//! added to what is worked out already; only where something that they change changes once more later, all of it is worked out
//! anew.

use bevy::prelude::*;

use super::{Action, EventSpec, Timeline, tick_from};
use crate::emitter::Emitter;
use crate::scenario::Scenario;
use crate::scenario::motion::EmitterMotion;

/// Lets more events happen in the scenario that runs: of a tick that begins, in order. None of the emitters that they switch or
/// move may have such an event later. `scenario`: without them.
///
/// `false` if what they change changes later, too, or something comes behind them in their tick: then nothing has been added, and
/// all events have to be [exchanged](super::exchange_events).
pub(crate) fn append_events(world: &mut World, scenario: &Scenario, events: &[EventSpec]) -> bool {
    let hz = scenario.tick_hz;
    let Some(mut timeline) = world.get_resource_mut::<Timeline>() else { return false };
    // What is rounded to the same tick may come behind it all the same.
    let is_before =
        |at: f64, other: &EventSpec| other.at > at && tick_from(other.at, hz) <= tick_from(at, hz);
    let is_last = |EventSpec { at, what }: &EventSpec| {
        timeline.is_last(scenario, what, tick_from(*at, hz))
            && !scenario.events.iter().any(|other| is_before(*at, other))
    };
    if !events.iter().all(is_last) {
        return false;
    }
    for event in events {
        timeline.add(scenario, event);
    }
    timeline.sort();
    let mut emitters = world.query::<(&Emitter, &mut EmitterMotion)>();
    for (emitter, mut motion) in emitters.iter_mut(world) {
        let Some(spec) = scenario.emitters.get(emitter.stream as usize) else { continue };
        for event in events {
            motion.add(&spec.name, event, hz);
        }
    }
    true
}

impl Timeline {
    /// Whether nothing that is known changes, later than this tick, what an event changes.
    fn is_last(&self, scenario: &Scenario, what: &Action, tick: u32) -> bool {
        match what {
            Action::Weather(_) => self.changes.last().is_none_or(|step| step.first <= tick),
            Action::Material(change) => {
                let surface = scenario.surface_number(&change.surface);
                let last = self.materials.iter().rev().find(|step| Some(step.surface) == surface);
                last.is_none_or(|step| step.tick <= tick)
            }
            Action::Adjust(adjustment) => {
                let emitter = scenario.emitters.iter().position(|spec| spec.name == adjustment.emitter);
                let last = self.emitters.iter().rev().find(|step| Some(step.emitter as usize) == emitter);
                last.is_none_or(|step| step.tick <= tick)
            }
            _ => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::load::ron_options;
    use super::super::tests::scenario;
    use super::super::{emitter_motion, insert_events};
    use super::*;

    /// A world in which a scenario runs.
    fn world(scenario: &Scenario) -> World {
        let mut world = World::new();
        insert_events(&mut world, scenario);
        world.spawn((Emitter::default(), emitter_motion(scenario, &scenario.emitters[0])));
        world
    }

    /// That a world knows what is worked out at once.
    fn assert_known(world: &mut World, scenario: &Scenario) {
        assert_eq!(*world.resource::<Timeline>(), Timeline::new(scenario));
        let expected = emitter_motion(scenario, &scenario.emitters[0]);
        let mut motions = world.query::<&EmitterMotion>();
        let motion = motions.single(world).unwrap();
        assert_eq!((&motion.switches, &motion.legs), (&expected.switches, &expected.legs));
    }

    fn events(text: &str) -> Vec<EventSpec> {
        ron_options().from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
    }

    const ONE_OF_EACH: &str = r#"[
        (at: 3.0, what: Start("rain")),
        (at: 3.0, what: Weather(humidity: 0.9)),
        (at: 3.1, what: Move(emitter: "rain", position: (1.0, 2.0, 0.0), target: (0.0, 0.0, 0.0), over: 0.5)),
        (at: 3.3, what: Move(emitter: "rain", position: (2.0, 2.0, 0.0), target: (0.0, 0.0, 0.0))),
        (at: 3.3, what: Adjust(emitter: "rain", rate: 7.0)),
        (at: 3.4, what: Brush(kind: Wet, point: (0.0, 0.0, 0.0), radius: 0.1, strength: 0.5, surface: "a")),
        (at: 3.5, what: Material(surface: "b", model: Lagarde(porosity: 0.5))),
        (at: 3.6, what: Material(surface: "a", material: "sand")),
        (at: 3.6, what: Adjust(emitter: "rain", spread_deg: 3.0)),
        (at: 3.7, what: Weather(temperature_c: 3.0)),
        (at: 3.8, what: Stop("rain")),
    ]"#;

    #[test]
    fn what_comes_one_by_one_is_what_is_worked_out_at_once() {
        // Others, before and after, that change none of it.
        let mut scenario = scenario(
            r#"[(at: 1.0, what: Weather(wind: (1.0, 0.0, 4.0))),
                (at: 9.0, what: Brush(kind: Dry, point: (0.0, 0.0, 0.0), radius: 0.1, strength: 0.5))]"#,
        );
        let mut world = world(&scenario);
        for event in events(ONE_OF_EACH) {
            assert!(append_events(&mut world, &scenario, std::slice::from_ref(&event)), "{event:?}");
            scenario.events.push(event);
            assert_known(&mut world, &scenario);
        }
    }

    #[test]
    fn what_changes_once_more_later_is_not_added_to() {
        let scenario = scenario(
            r#"[(at: 5.0, what: Weather(wind: (1.0, 0.0, 4.0))),
                (at: 5.0, what: Material(surface: "a", material: "sand")),
                (at: 5.0, what: Adjust(emitter: "rain", rate: 7.0))]"#,
        );
        for event in [
            r#"[(at: 3.0, what: Weather(humidity: 0.9))]"#,
            r#"[(at: 3.0, what: Material(surface: "a", model: Lagarde(porosity: 0.5)))]"#,
            r#"[(at: 3.0, what: Start("rain")), (at: 3.0, what: Adjust(emitter: "rain", spread_deg: 3.0))]"#,
        ] {
            let mut world = world(&scenario);
            assert!(!append_events(&mut world, &scenario, &events(event)), "{event}");
            assert_known(&mut world, &scenario);
        }
        // Ten nanoseconds late is in time for the tick that begins.
        let late = self::scenario(
            r#"[(at: 0.30000001, what: Brush(kind: Dry, point: (0.0, 0.0, 0.0), radius: 0.1, strength: 0.5))]"#,
        );
        assert_eq!(tick_from(0.30000001, 10), tick_from(0.3, 10));
        let mut other = world(&late);
        assert!(!append_events(&mut other, &late, &events(r#"[(at: 0.3, what: Start("rain"))]"#)));
        assert!(append_events(&mut other, &late, &events(r#"[(at: 0.4, what: Start("rain"))]"#)));
        let mut world = world(&scenario);
        let of_another = r#"[(at: 3.0, what: Material(surface: "b", material: "clay"))]"#;
        assert!(append_events(&mut world, &scenario, &events(of_another)));
    }
}
