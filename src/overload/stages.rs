//! How long each stage of a tick takes, by the clock on the wall. Measured between the sets of the tick's schedule; what is
//! simulated does not see it.
//!
//! Times are sums since the app began. Whoever wants to know takes a [`StageMark`] and asks later what has passed since, so
//! that several may ask beside each other.

use std::time::{Duration, Instant};

use bevy::prelude::*;

use crate::schedule::{WeatheringSystems, WeatheringTick};

/// The stages, in the order they run: the sets of [`WeatheringSystems`].
pub const STAGES: [&str; 7] = ["first", "emit", "integrate", "trace", "deposit", "flow", "last"];

/// Wall-clock time of all ticks so far. Resource of [`StageTimesPlugin`].
#[derive(Resource, Debug, Clone, Copy)]
pub struct StageTimes {
    /// When the last stage ended, or the tick began.
    since: Instant,
    ticks: u32,
    spent: [Duration; STAGES.len()],
}

/// A moment from which on time is summed.
#[derive(Debug, Clone, Copy)]
pub struct StageMark {
    at: Instant,
    ticks: u32,
    spent: [Duration; STAGES.len()],
}

/// Where the wall-clock time of some ticks went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageMeans {
    /// Ticks that were run, at least one.
    pub ticks: u32,
    /// Mean of each stage, ms a tick.
    pub stages_ms: [f64; STAGES.len()],
    /// Mean of all else, drawing and waiting included, ms a tick.
    pub outside_ms: f64,
}

impl Default for StageTimes {
    fn default() -> Self {
        Self { since: Instant::now(), ticks: 0, spent: default() }
    }
}

impl StageTimes {
    /// Now.
    pub fn mark(&self) -> StageMark {
        StageMark { at: Instant::now(), ticks: self.ticks, spent: self.spent }
    }

    /// What was measured since a mark, which becomes now; `None` if no tick has run.
    pub fn take_since(&self, mark: &mut StageMark) -> Option<StageMeans> {
        let before = std::mem::replace(mark, self.mark());
        let ticks = self.ticks.wrapping_sub(before.ticks);
        let mean_ms = |time: Duration| time.as_secs_f64() * 1000.0 / f64::from(ticks);
        let mut spent = self.spent;
        for (spent, before) in spent.iter_mut().zip(before.spent) {
            *spent = spent.saturating_sub(before);
        }
        let inside: Duration = spent.iter().sum();
        (ticks > 0).then(|| StageMeans {
            ticks,
            stages_ms: spent.map(mean_ms),
            outside_ms: mean_ms(mark.at.saturating_duration_since(before.at).saturating_sub(inside)),
        })
    }
}

/// Measures the stages of ticks. No part of [`WeatheringPlugins`](crate::WeatheringPlugins), after which it is added.
pub struct StageTimesPlugin;

impl Plugin for StageTimesPlugin {
    fn build(&self, app: &mut App) {
        use WeatheringSystems::*;
        app.init_resource::<StageTimes>().add_systems(
            WeatheringTick,
            // Between the sets, so that all of a stage and nothing else is in its time.
            (
                begin_tick.before(First),
                end_stage::<0>.after(First).before(Emit),
                end_stage::<1>.after(Emit).before(Integrate),
                end_stage::<2>.after(Integrate).before(Trace),
                end_stage::<3>.after(Trace).before(Deposit),
                end_stage::<4>.after(Deposit).before(Flow),
                end_stage::<5>.after(Flow).before(Last),
                end_stage::<6>.after(Last),
            )
                .chain(),
        );
    }
}

fn begin_tick(mut times: ResMut<StageTimes>) {
    times.ticks = times.ticks.wrapping_add(1);
    times.since = Instant::now();
}

/// The stage of this number is over. Also orders what follows the last one.
pub(crate) fn end_stage<const STAGE: usize>(mut times: ResMut<StageTimes>) {
    let now = Instant::now();
    let spent = now - times.since;
    times.spent[STAGE] += spent;
    times.since = now;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schedule::WeatheringSchedulePlugin;

    const SLOW: Duration = Duration::from_millis(5);

    #[test]
    fn time_is_booked_on_the_stage_it_was_spent_in_for_each_who_asks() {
        let mut app = App::new();
        app.add_plugins((WeatheringSchedulePlugin, StageTimesPlugin))
            .add_systems(WeatheringTick, (|| std::thread::sleep(SLOW)).in_set(WeatheringSystems::Trace));
        let times = |app: &App| *app.world().resource::<StageTimes>();
        let begun = Instant::now();
        let (mut early, mut late) = (times(&app).mark(), times(&app).mark());
        assert_eq!(times(&app).take_since(&mut early), None);
        for _ in 0..3 {
            app.world_mut().run_schedule(WeatheringTick);
        }
        let means = times(&app).take_since(&mut early).unwrap();
        assert_eq!(means.ticks, 3);
        // A sleep is never shorter than it was asked to be.
        assert!(means.stages_ms[3] >= 5.0, "{means:?}");
        // And nothing is booked twice.
        let booked = 3.0 * (means.outside_ms + means.stages_ms.iter().sum::<f64>());
        assert!(booked <= begun.elapsed().as_secs_f64() * 1000.0 + 1e-6, "{means:?}");
        assert_eq!(times(&app).take_since(&mut early), None);
        app.world_mut().run_schedule(WeatheringTick);
        let ticks = |mark: &mut StageMark| times(&app).take_since(mark).map(|means| means.ticks);
        assert_eq!((ticks(&mut early), ticks(&mut late)), (Some(1), Some(4)));
    }
}
