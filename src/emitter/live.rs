//! Emission that a machine can keep up with, where somebody watches.
//!
//! A scene may ask for more particles than a machine can move. In a run without a window that only takes longer. In a window
//! it would be the end: ticks that take longer than they stand for leave more and more ticks to do. [`LiveBudgetPlugin`]
//! measures what ticks take and, where it is too much, lets emitters send out fewer particles that carry more each
//! ([`EmissionScale`]): no water is lost, it only comes in coarser pieces. It also limits how many ticks a frame may
//! catch up on, so that time goes slower rather than the window stands still.
//!
//! How much is held back depends on the wall clock, so such a run cannot be repeated to the digest. It is therefore not among
//! [`WeatheringPlugins`](crate::WeatheringPlugins): games and the sandbox add it, replays do not.

use std::time::{Duration, Instant};

use bevy::app::{RunFixedMainLoop, RunFixedMainLoopSystems};
use bevy::prelude::*;

use crate::clock::WeatheringClock;
use crate::overlay::SplatStats;

/// Part of the particles that emitters send out, in (0, 1], or 0 while painting is too far behind. Each carries so much more
/// that the amount stays the same. 1 unless something steers it.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource)]
pub struct EmissionScale(pub f32);

impl Default for EmissionScale {
    fn default() -> Self {
        Self(1.0)
    }
}

/// What weathering may cost while it is watched.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource)]
pub struct LiveBudget {
    /// Milliseconds that a tick may take, above 0.
    pub tick_ms: f32,
    /// Milliseconds of ticks in a frame, above 0; at least one tick.
    pub frame_ms: f32,
    /// Splats that may wait to be painted before emitters pause.
    pub most_waiting: u64,
}

impl Default for LiveBudget {
    fn default() -> Self {
        Self { tick_ms: 12.0, frame_ms: 50.0, most_waiting: 2_000_000 }
    }
}

/// What it costs, and what that led to.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq, Default)]
#[reflect(Resource)]
pub struct LiveLoad {
    /// Milliseconds that a tick takes, of late.
    pub tick_ms: f32,
    /// Seconds since the scale was last changed.
    since: f32,
}

/// The least part of the particles, other than none.
const LEAST_SCALE: f32 = 1.0 / 1024.0;
/// Seconds between two changes: what has been sent out takes about so long to land.
const PATIENCE: f32 = 0.5;
/// What is added after each of these, while a tick takes less than `EASY` of its budget.
const RISE: f32 = 0.02;
const EASY: f32 = 0.8;

/// The next [`EmissionScale`], where a tick took `load` times its budget: additive increase, multiplicative decrease
/// (Chiu and Jain 1989), which neither rises into overload nor stays below what is possible for good.
pub fn next_scale(scale: f32, load: f32) -> f32 {
    let scale = scale.clamp(LEAST_SCALE, 1.0);
    if load.is_nan() || load <= EASY {
        // In proportion, where there is little left: from a thousandth on, steps of a fiftieth would be leaps.
        return (scale + RISE.min(0.25 * scale)).min(1.0);
    }
    if load <= 1.0 {
        return scale;
    }
    (scale * (0.9 / load).clamp(0.25, 0.9)).max(LEAST_SCALE)
}

/// Ticks that a frame may catch up on, and a little more, so that rounding does not cost one.
fn most_delta(tick_ms: f32, frame_ms: f32, tick: Duration) -> Duration {
    let ticks = (frame_ms.max(1.0) / tick_ms.max(0.01)).floor().clamp(1.0, 15.0);
    tick.mul_f32(ticks + 0.01)
}

/// Holds emission back where a machine cannot keep up.
pub struct LiveBudgetPlugin;

impl Plugin for LiveBudgetPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<LiveBudget>()
            .register_type::<LiveLoad>()
            .init_resource::<LiveBudget>()
            .init_resource::<LiveLoad>()
            .init_resource::<TicksBegun>()
            .add_systems(
                RunFixedMainLoop,
                (
                    begin_ticks.in_set(RunFixedMainLoopSystems::BeforeFixedMainLoop),
                    steer_emission.in_set(RunFixedMainLoopSystems::AfterFixedMainLoop),
                ),
            );
    }
}

/// When the ticks of this frame began, and after which.
#[derive(Resource, Default)]
struct TicksBegun(Option<(Instant, u32)>);

fn begin_ticks(clock: Res<WeatheringClock>, mut begun: ResMut<TicksBegun>) {
    begun.0 = Some((Instant::now(), clock.tick()));
}

fn steer_emission(
    clock: Res<WeatheringClock>,
    budget: Res<LiveBudget>,
    stats: Option<Res<SplatStats>>,
    mut begun: ResMut<TicksBegun>,
    mut load: ResMut<LiveLoad>,
    mut scale: ResMut<EmissionScale>,
    mut time: ResMut<Time<Virtual>>,
) {
    let Some((begun, first)) = begun.0.take() else { return };
    let ticks = clock.tick().saturating_sub(first);
    if ticks == 0 {
        return;
    }
    let each_ms = begun.elapsed().as_secs_f32() * 1000.0 / ticks as f32;
    // One slow tick is no reason, the second is.
    load.tick_ms += (each_ms - load.tick_ms) * 0.3;
    load.since += ticks as f32 * clock.delta_secs();
    let tick = Duration::from_secs_f32(clock.delta_secs());
    let most = most_delta(load.tick_ms, budget.frame_ms, tick);
    if time.max_delta() != most {
        time.set_max_delta(most);
    }
    let is_behind = stats.is_some_and(|stats| stats.waiting() > budget.most_waiting);
    if is_behind {
        scale.set_if_neq(EmissionScale(0.0));
    } else if load.since >= PATIENCE || scale.0 == 0.0 {
        load.since = 0.0;
        let next = next_scale(scale.0, load.tick_ms / budget.tick_ms.max(0.1));
        scale.set_if_neq(EmissionScale(next));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Load in each half second of a machine on which a tick costs `cost` budgets per part of the particles that are in flight;
    /// these follow what is sent out within about a second.
    fn loads(cost: f32, steps: usize) -> Vec<(f32, f32)> {
        let (mut scale, mut in_flight) = (1.0, 0.0);
        let step = |_| {
            in_flight += (scale - in_flight) * 0.4;
            let load = 0.1 + cost * in_flight;
            scale = next_scale(scale, load);
            (load, scale)
        };
        (0..steps).map(step).collect()
    }

    #[test]
    fn a_machine_that_keeps_up_is_left_alone() {
        assert!(loads(0.5, 100).iter().all(|&(_, scale)| scale == 1.0));
    }

    #[test]
    fn a_hundred_times_too_much_is_held_back_and_what_can_be_done_is_done() {
        for cost in [2.0, 10.0, 100.0] {
            let run = loads(cost, 400);
            let late = &run[100..];
            assert!(late.iter().all(|&(load, _)| load < 1.35), "{cost}: {late:?}");
            let mean = late.iter().map(|(load, _)| load).sum::<f32>() / late.len() as f32;
            assert!((0.5..1.0).contains(&mean), "{cost}: {mean}");
            // It does not swing.
            let scales = || late.iter().map(|&(_, scale)| scale);
            let (low, high) = (scales().fold(1.0, f32::min), scales().fold(0.0, f32::max));
            assert!(high / low < 3.0, "{cost}: {low} {high}");
        }
    }

    #[test]
    fn nonsense_keeps_it_within_bounds() {
        for scale in [0.0, -1.0, 5.0, 1.0e-9] {
            for load in [0.0, f32::NAN, f32::INFINITY, 1.0e30, -1.0] {
                let next = next_scale(scale, load);
                assert!((LEAST_SCALE..=1.0).contains(&next), "{scale} {load}: {next}");
            }
        }
    }

    #[test]
    fn a_frame_catches_up_on_what_its_time_allows() {
        let tick = Duration::from_millis(16);
        let ticks = |tick_ms| most_delta(tick_ms, 50.0, tick).as_millis() / 16;
        assert_eq!([0.0, 1.0, 10.0, 49.0, 51.0, 900.0].map(ticks), [15, 15, 5, 1, 1, 1]);
    }
}
