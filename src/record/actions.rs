//! What was done, and the events that it makes together with those of the scenario.

use std::collections::BTreeMap;

use crate::scenario::{Action, EventSpec, beginning_of, tick_from};

/// Something that was done in a session.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Recorded {
    /// The tick in which it acted.
    pub(super) tick: u32,
    pub(super) what: Action,
    /// Number of the brush stroke that it is a touch of; 0 for what is none.
    pub(super) stroke: u32,
}

/// The emitter that an event switches or moves.
fn handled(what: &Action) -> Option<&str> {
    match what {
        Action::Start(name) | Action::Stop(name) => Some(name),
        Action::Move(step) => Some(&step.emitter),
        _ => None,
    }
}

/// The event of something that was done.
fn event_of(Recorded { tick, what, .. }: &Recorded, hz: u32) -> EventSpec {
    EventSpec { at: beginning_of(*tick, hz), what: what.clone() }
}

/// Events of what was done behind all else, if they can be added to those that there are: not if a hand takes an emitter over
/// with them, from which on events of the scenario are left out.
pub(super) fn new_events(
    scenario: &[EventSpec],
    before: &[Recorded],
    new: &[Recorded],
    hz: u32,
) -> Option<Vec<EventSpec>> {
    let takes_over = |action: &Recorded| {
        let Some(name) = handled(&action.what) else { return false };
        let is_of_it = |what: &Action| handled(what) == Some(name);
        let is_left_out = |event: &EventSpec| is_of_it(&event.what) && tick_from(event.at, hz) >= action.tick;
        // Those that were taken over already have been left out since.
        scenario.iter().any(is_left_out) && !before.iter().rev().any(|action| is_of_it(&action.what))
    };
    let events = || new.iter().map(|action| event_of(action, hz)).collect();
    (!new.iter().any(takes_over)).then(events)
}

/// All events: the scenario's, but for those of emitters that a hand has taken over by then, and what was done.
pub(super) fn all_events(scenario: &[EventSpec], actions: &[Recorded], hz: u32) -> Vec<EventSpec> {
    let mut taken: BTreeMap<&str, u32> = BTreeMap::new();
    for action in actions {
        if let Some(name) = handled(&action.what) {
            // The first one comes first.
            taken.entry(name).or_insert(action.tick);
        }
    }
    let is_kept = |event: &&EventSpec| {
        let by_hand = handled(&event.what).and_then(|name| taken.get(name));
        by_hand.is_none_or(|&tick| tick_from(event.at, hz) < tick)
    };
    let kept = scenario.iter().filter(is_kept).cloned();
    kept.chain(actions.iter().map(|action| event_of(action, hz))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hands_take_over_from_the_scenario_and_from_then_on() {
        let event = |at: f64, what: Action| EventSpec { at, what };
        let (start, stop) = (|| Action::Start("rain".into()), || Action::Stop("rain".into()));
        let scenario = [
            event(1.0, start()),
            event(2.0, stop()),
            event(3.0, start()),
            event(4.0, Action::Start("snow".into())),
        ];
        let actions = [Recorded { tick: 16, what: stop(), stroke: 0 }];
        let all = all_events(&scenario, &actions, 10);
        let expected = [event(1.0, start()), event(4.0, Action::Start("snow".into())), event(1.5, stop())];
        assert_eq!(all, expected);
        assert_eq!(all_events(&scenario, &[], 10), scenario);
    }

    #[test]
    fn what_is_new_is_added_unless_a_hand_takes_over() {
        let event = |at: f64, what: Action| EventSpec { at, what };
        let action = |tick: u32, name: &str| Recorded { tick, what: Action::Stop(name.into()), stroke: 0 };
        let scenario = [event(1.0, Action::Start("rain".into())), event(3.0, Action::Stop("rain".into()))];
        let added = |before: &[Recorded], new: &[Recorded]| {
            let events = new_events(&scenario, before, new, 10)?;
            // As if all were worked out at once.
            let all = [before, new].concat();
            let mut expected = all_events(&scenario, before, 10);
            expected.extend(events.iter().cloned());
            assert_eq!(all_events(&scenario, &all, 10), expected);
            Some(events.len())
        };
        assert_eq!(added(&[], &[action(16, "hose"), action(16, "hose")]), Some(2));
        assert_eq!(added(&[], &[action(16, "hose"), action(16, "rain")]), None);
        assert_eq!(added(&[action(16, "rain")], &[action(17, "rain")]), Some(1));
        // Behind all of its events.
        assert_eq!(added(&[], &[action(32, "rain")]), Some(1));
        assert_eq!(added(&[action(16, "rain")], &[]), Some(0));
    }
}
