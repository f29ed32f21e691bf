//! Keeping a window responsive.

use std::time::Duration;

use bevy::platform::time::Instant;
use bevy::prelude::*;
use bevy::time::TimeSystems;

use super::governor::{Governor, TickReading, ticks_in_a_frame};
use crate::clock::WeatheringClock;
use crate::emitter::EmissionDetail;
use crate::particle::ParticleCounts;
use crate::schedule::run_tick;

/// How much time ticks may take where somebody watches.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource, Default)]
pub struct LiveBudget {
    /// Part of real time that ticks may take, above 0; the rest is for drawing. At 60 ticks a second, 0.7 are 11.7 ms a tick.
    /// Where they take more, there are fewer particles.
    pub load: f32,
    /// Milliseconds that the ticks of a frame may take, above 0; but one tick at least. What does not fit is left out: weather
    /// time slows down, and no frame has to make up for the one before.
    pub frame_ms: f32,
    /// The longest real time that a frame makes up for, ms, above 0.
    pub longest_ms: f32,
}

impl Default for LiveBudget {
    fn default() -> Self {
        Self { load: 0.7, frame_ms: 25.0, longest_ms: 250.0 }
    }
}

impl LiveBudget {
    /// Milliseconds that a tick may take.
    pub fn tick_ms(&self, clock: &WeatheringClock) -> f32 {
        self.load.max(1e-3) * 1000.0 / clock.hz() as f32
    }

    /// The longest real time that a frame may make up for, if a tick takes `tick_ms` and virtual time goes `speed` times as fast
    /// as real time.
    fn longest_delta(&self, clock: &WeatheringClock, tick_ms: f32, speed: f64) -> Duration {
        let ticks = f64::from(ticks_in_a_frame(self.frame_ms, tick_ms));
        let seconds = ticks / f64::from(clock.hz()) / speed.max(1e-3);
        // Zero is not allowed, and no number gives the least: a tick of any rate, a hundred times as fast, is more.
        Duration::from_secs_f64(seconds.min(f64::from(self.longest_ms) / 1000.0).clamp(1e-6, 3600.0))
    }
}

/// How much there is to do, and what is done about it.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource, Default)]
pub struct LiveLoad {
    /// Steers the number of particles.
    pub governor: Governor,
    /// How fast weather time goes, in parts of what it should; smoothed, 0..=1.
    pub speed: f32,
    /// Real time that was left out so far.
    pub left_out: Duration,
}

impl Default for LiveLoad {
    fn default() -> Self {
        Self { governor: Governor::default(), speed: 1.0, left_out: Duration::ZERO }
    }
}

/// What was there before a tick.
#[derive(Resource, Debug, Default)]
struct BeforeTick {
    at: Option<Instant>,
    tick: u32,
    counts: ParticleCounts,
}

/// Measures ticks, and keeps them within a [`LiveBudget`]: by fewer particles, through [`EmissionDetail`], and by slower time,
/// through the `max_delta` of Bevy's virtual time, which it sets in each frame: all that goes by that time slows down, too. Add it
/// after [`WeatheringPlugins`](crate::WeatheringPlugins) where a window is; runs are no longer the same to the bit then, unless the
/// machine copes.
pub struct LiveBudgetPlugin;

impl Plugin for LiveBudgetPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<LiveBudget>()
            .register_type::<LiveLoad>()
            .init_resource::<LiveBudget>()
            .init_resource::<LiveLoad>()
            .init_resource::<BeforeTick>()
            .init_resource::<EmissionDetail>()
            // Limits the time that is about to be measured.
            .add_systems(First, pace.before(TimeSystems))
            // Around the whole tick, and nothing else.
            .add_systems(FixedUpdate, (begin_tick.before(run_tick), end_tick.after(run_tick)));
    }
}

/// Limits what the frame that begins may make up for.
fn pace(
    budget: Res<LiveBudget>,
    clock: Res<WeatheringClock>,
    real: Res<Time<Real>>,
    mut time: ResMut<Time<Virtual>>,
    mut load: ResMut<LiveLoad>,
) {
    let (passed, most) = (real.delta(), time.max_delta());
    if !time.is_paused() && !passed.is_zero() {
        let part = (most.as_secs_f32() / passed.as_secs_f32()).min(1.0);
        load.speed += (part - load.speed) / 8.0;
        load.left_out += passed.saturating_sub(most);
    }
    let longest = budget.longest_delta(&clock, load.governor.tick_ms(), time.relative_speed_f64());
    if longest != most {
        time.set_max_delta(longest);
    }
}

fn begin_tick(clock: Res<WeatheringClock>, counts: Res<ParticleCounts>, mut before: ResMut<BeforeTick>) {
    *before = BeforeTick { at: Some(Instant::now()), tick: clock.tick(), counts: *counts };
}

fn end_tick(
    budget: Res<LiveBudget>,
    clock: Res<WeatheringClock>,
    counts: Res<ParticleCounts>,
    before: Res<BeforeTick>,
    mut load: ResMut<LiveLoad>,
    mut detail: ResMut<EmissionDetail>,
) {
    let Some(begun) = before.at else { return };
    // A tick that was held says nothing.
    if clock.tick() == before.tick {
        return;
    }
    let gone = |counts: &ParticleCounts| counts.hit + counts.expired;
    let tick = TickReading {
        ms: begun.elapsed().as_secs_f32() * 1000.0,
        alive: counts.alive,
        born: counts.emitted.saturating_sub(before.counts.emitted),
        died: gone(&counts).saturating_sub(gone(&before.counts)),
    };
    let factor = load.governor.steer(&tick, budget.tick_ms(&clock));
    if detail.factor() != factor {
        detail.set_factor(factor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_makes_up_for_as_many_ticks_as_it_has_time_for() {
        let (budget, clock) = (LiveBudget::default(), WeatheringClock::new(60));
        let ticks =
            |tick_ms: f32, speed: f64| budget.longest_delta(&clock, tick_ms, speed).as_secs_f64() * 60.0;
        assert!((ticks(60.0, 1.0) - 1.0).abs() < 1e-3);
        assert!((ticks(12.0, 1.0) - 2.0).abs() < 1e-3);
        assert!((ticks(0.1, 1.0) - 15.0).abs() < 1e-3, "no more than Bevy does");
        // Ten times as fast, two ticks are a tenth of the real time.
        assert!((ticks(12.0, 10.0) - 0.2).abs() < 1e-3);
        // A tick that takes ten seconds: one a frame, also where they are short and time is fast.
        let fast = WeatheringClock::new(1000);
        let longest = budget.longest_delta(&fast, 10_000.0, 100.0).as_secs_f64();
        assert!((longest * 100.0 * 1000.0 - 1.0).abs() < 1e-3, "{longest}");
        assert!((budget.tick_ms(&clock) - 11.667).abs() < 0.01);
        let odd = LiveBudget { load: 0.0, frame_ms: f32::NAN, longest_ms: 0.0 };
        assert!(odd.longest_delta(&clock, f32::NAN, f64::NAN) > Duration::ZERO && odd.tick_ms(&clock) > 0.0);
    }
}
