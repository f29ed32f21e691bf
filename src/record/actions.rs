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
    let done = actions
        .iter()
        .map(|Recorded { tick, what, .. }| EventSpec { at: beginning_of(*tick, hz), what: what.clone() });
    kept.chain(done).collect()
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
}
