//! Where emitters go and when they work: events become part of their motion.

use super::{Action, EventSpec, in_order, tick_from};
use crate::scenario::motion::{EmitterMotion, Leg, pose};
use crate::scenario::{EmitterKey, EmitterSpec, Scenario};

/// When an emitter works and where it is, with what events say of it.
pub(in crate::scenario) fn emitter_motion(scenario: &Scenario, spec: &EmitterSpec) -> EmitterMotion {
    let (keys, stop) = (spec.keys.clone(), spec.stop.unwrap_or(scenario.seconds));
    let mut motion = EmitterMotion { keys, legs: Vec::new(), start: spec.start, stop, switches: Vec::new() };
    for (_, event) in in_order(scenario) {
        motion.add(&spec.name, event, scenario.tick_hz);
    }
    motion
}

impl EmitterMotion {
    /// Adds an event behind all others, if it is about the emitter of this name.
    pub(super) fn add(&mut self, emitter: &str, EventSpec { at, what }: &EventSpec, hz: u32) {
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
    use super::super::tests::scenario;
    use super::*;

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
}
