//! The law by which particles are thinned out where ticks take too long.
//!
//! What a tick costs grows with the particles in flight, and these follow what is emitted only after a flight. A law that
//! looked at the cost alone would go on cutting for a whole flight and then go on raising for another. So it looks ahead, too: as
//! particles in flight are births times the length of a flight, and deaths are the births of a flight ago (Little's law), the
//! load will come to `load * births / deaths` if births stay as they are.
//!
//! - Too slow now, and not on the way to be fast enough: the factor is cut in one step to where it leads to [`TARGET`], at most
//!   to a half in a tick (multiplicative decrease).
//! - Fast enough now and ahead: the factor grows by [`RAISE`] of itself a tick, up to 1. Evenly on a logarithmic scale: it may
//!   have to come back from a thousandth.
//! - In between it stays.

use bevy::prelude::*;

use crate::emitter::EmissionDetail;

/// Where a cut leads to, in parts of the budget.
pub const TARGET: f32 = 0.8;

/// By how much the factor grows in a tick.
pub const RAISE: f32 = 0.01;

/// Ticks of the longest flight that is reckoned with as long as nothing has died yet.
const LONGEST_FLIGHT: f32 = 1024.0;

/// What a tick was like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TickReading {
    /// How long it took, ms.
    pub ms: f32,
    /// Particles in flight after it.
    pub alive: u64,
    /// Particles born in it.
    pub born: u64,
    /// Particles that hit something or ran out of time in it.
    pub died: u64,
}

/// Steers the [detail](EmissionDetail) of emission by what ticks take. Starts at 1.
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Default)]
pub struct Governor {
    factor: f32,
    /// What a tick takes, smoothed over a few.
    ms: f32,
    /// Births of a tick at factor 1, smoothed over more.
    asked: f32,
    /// Deaths of a tick, smoothed like these.
    died: f32,
    has_begun: bool,
}

impl Default for Governor {
    fn default() -> Self {
        Self { factor: 1.0, ms: 0.0, asked: 0.0, died: 0.0, has_begun: false }
    }
}

impl Governor {
    /// The factor for the next tick, [`EmissionDetail::LEAST`]..=1.
    pub fn factor(&self) -> f32 {
        self.factor
    }

    /// What a tick takes, smoothed, ms.
    pub fn tick_ms(&self) -> f32 {
        self.ms
    }

    /// Takes in a tick that was emitted at [`Self::factor`], and returns the factor for the next.
    pub fn steer(&mut self, tick: &TickReading, budget_ms: f32) -> f32 {
        let asked = tick.born as f32 / self.factor;
        if !self.has_begun {
            (self.ms, self.asked, self.has_begun) = (tick.ms, asked, true);
        }
        self.ms += (tick.ms - self.ms) / 4.0;
        self.asked += (asked - self.asked) / 16.0;
        self.died += (tick.died as f32 - self.died) / 16.0;
        let load = self.ms / budget_ms.max(1e-3);
        let (births, deaths) = (self.asked * self.factor, self.died.max(tick.alive as f32 / LONGEST_FLIGHT));
        self.factor = next_factor(self.factor, load, heading(load, births, deaths));
        self.factor
    }
}

/// The load that births lead to, from the load now, births and deaths; in parts of the budget. Not below the load now while
/// particles do not become fewer.
pub fn heading(load: f32, births: f32, deaths: f32) -> f32 {
    let ahead = load * births / deaths.max(1e-6);
    if births >= deaths { ahead.max(load) } else { ahead }
}

/// The next factor, from the load now and the one it leads to.
pub fn next_factor(factor: f32, load: f32, heading: f32) -> f32 {
    let next = if load > 1.0 && heading > TARGET {
        factor * (TARGET / heading).max(0.5)
    } else if load < 1.0 && heading < TARGET {
        factor * (1.0 + RAISE)
    } else {
        factor
    };
    next.clamp(EmissionDetail::LEAST, 1.0)
}

/// How many ticks a frame may run, at least one: as many as fit into `frame_ms`.
pub fn ticks_in_a_frame(frame_ms: f32, tick_ms: f32) -> u32 {
    // Saturates, also where a tick takes no time.
    ((frame_ms / tick_ms.max(1e-4)) as u32).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BUDGET_MS: f32 = 11.7;

    /// A machine that needs so much for each particle in flight, which all fly equally long.
    struct Machine {
        ms_per_particle: f32,
        flight: usize,
        /// Births of the last ticks, of one flight.
        births: std::collections::VecDeque<u64>,
        credit: f32,
    }

    impl Machine {
        /// Holds 20,000 particles within the budget.
        fn new(flight: usize) -> Self {
            let births = std::iter::repeat_n(0, flight).collect();
            Self { ms_per_particle: BUDGET_MS / 20_000.0, flight, births, credit: 0.0 }
        }

        /// A tick at so many times the rate that it holds.
        fn tick(&mut self, governor: &mut Governor, times: f32) -> f32 {
            let asked = times * 20_000.0 / self.flight as f32;
            self.credit += asked * governor.factor();
            let born = self.credit.floor();
            self.credit -= born;
            self.births.push_back(born as u64);
            let died = self.births.pop_front().unwrap();
            let alive: u64 = self.births.iter().sum();
            let ms = 0.2 + self.ms_per_particle * alive as f32;
            governor.steer(&TickReading { ms, alive, born: born as u64, died }, BUDGET_MS);
            ms / BUDGET_MS
        }
    }

    #[test]
    fn a_machine_that_copes_is_left_alone() {
        for flight in [20, 60, 300] {
            let (mut machine, mut governor) = (Machine::new(flight), Governor::default());
            for tick in 0..1000 {
                machine.tick(&mut governor, 0.9);
                assert_eq!(governor.factor(), 1.0, "flight {flight}, tick {tick}");
            }
        }
    }

    #[test]
    fn any_rate_comes_into_the_budget_after_a_flight_and_stays_there() {
        for times in [2.0, 10.0, 100.0, 1000.0] {
            for flight in [20, 60, 300] {
                let (mut machine, mut governor) = (Machine::new(flight), Governor::default());
                for tick in 0..3000 {
                    let load = machine.tick(&mut governor, times);
                    let factor = governor.factor();
                    if tick > 2 * flight + 60 {
                        assert!(load < 1.1, "{times} times, flight {flight}, tick {tick}: load {load}");
                    }
                    // It is not thinned out more than needed for long, either.
                    if tick > 2000 {
                        assert!(load > 0.6, "{times} times, flight {flight}, tick {tick}: load {load}");
                        let ideal = TARGET / times;
                        assert!((0.5..1.6).contains(&(factor / ideal)), "{times} {flight}: {factor}");
                    }
                }
            }
        }
    }

    #[test]
    fn no_tick_of_a_hundredfold_rate_takes_long() {
        // Also before the law has settled, for flights of a second, a third of that, and five.
        for (flight, most) in [(60, 5.0), (20, 12.0), (300, 4.0)] {
            let (mut machine, mut governor) = (Machine::new(flight), Governor::default());
            let loads = (0..3000).map(|_| machine.tick(&mut governor, 100.0));
            let highest = loads.fold(0.0, f32::max);
            assert!(highest < most, "flight {flight}: {highest}");
        }
    }

    #[test]
    fn when_it_is_over_all_particles_come_back() {
        let (mut machine, mut governor) = (Machine::new(60), Governor::default());
        for _ in 0..2000 {
            machine.tick(&mut governor, 100.0);
        }
        assert!(governor.factor() < 0.02);
        let back = (0..1000).position(|_| {
            let load = machine.tick(&mut governor, 0.3);
            assert!(load < 1.1, "{load}");
            governor.factor() == 1.0
        });
        assert!(back.is_some_and(|ticks| ticks < 600), "{back:?}");
    }

    #[test]
    fn the_factor_stays_in_its_range_whatever_is_measured() {
        for load in [0.0, 0.5, 1.0, 1.5, 1e9, f32::INFINITY] {
            for heading in [0.0, 0.5, 1.0, 1e9, f32::INFINITY] {
                for factor in [EmissionDetail::LEAST, 0.1, 1.0] {
                    let next = next_factor(factor, load, heading);
                    assert!(
                        (EmissionDetail::LEAST..=1.0).contains(&next),
                        "{factor} {load} {heading}: {next}"
                    );
                    assert!(next >= factor / 2.0 && next <= factor * (1.0 + RAISE), "{factor} {next}");
                }
            }
        }
        assert_eq!((ticks_in_a_frame(25.0, 60.0), ticks_in_a_frame(25.0, 12.0)), (1, 2));
        assert!(ticks_in_a_frame(25.0, 0.0) > 1000);
    }
}
