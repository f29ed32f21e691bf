//! How long each stage of a tick takes, by the clock on the wall. Measured between the sets of the tick's schedule; what is
//! simulated does not see it.

use std::time::{Duration, Instant};

use bevy::prelude::*;

use crate::schedule::{WeatheringSystems, WeatheringTick};

/// The stages, in the order they run.
pub(super) const STAGES: [&str; 7] = ["first", "emit", "integrate", "trace", "deposit", "flow", "last"];

/// Wall-clock time since the last [`Self::take`].
#[derive(Resource, Debug)]
pub(super) struct StageTimes {
    /// When the time that is summed here began.
    begun: Instant,
    /// When the last stage ended, or the tick began.
    since: Instant,
    ticks: u32,
    spent: [Duration; STAGES.len()],
}

/// Where the wall-clock time of some ticks went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StageMeans {
    /// Ticks that were run.
    pub(super) ticks: u32,
    /// Mean of each stage, ms a tick.
    pub(super) stages_ms: [f64; STAGES.len()],
    /// Mean of all else, pictures included, ms a tick.
    pub(super) outside_ms: f64,
}

impl Default for StageTimes {
    fn default() -> Self {
        let now = Instant::now();
        Self { begun: now, since: now, ticks: 0, spent: default() }
    }
}

impl StageTimes {
    /// What was measured since the last time, and starts anew; `None` if no tick has run.
    pub(super) fn take(&mut self) -> Option<StageMeans> {
        let Self { begun, ticks, spent, .. } = std::mem::take(self);
        let mean_ms = |time: Duration| time.as_secs_f64() * 1000.0 / f64::from(ticks);
        let inside: Duration = spent.iter().sum();
        (ticks > 0).then(|| StageMeans {
            ticks,
            stages_ms: spent.map(mean_ms),
            outside_ms: mean_ms(begun.elapsed().saturating_sub(inside)),
        })
    }
}

/// Adds the measuring to an app that has the tick's schedule.
pub(super) fn measure_stages(app: &mut App) {
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

fn begin_tick(mut times: ResMut<StageTimes>) {
    times.ticks += 1;
    times.since = Instant::now();
}

/// The stage of this number is over. Also orders what follows the last one.
pub(super) fn end_stage<const STAGE: usize>(mut times: ResMut<StageTimes>) {
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
    fn time_is_booked_on_the_stage_it_was_spent_in() {
        let mut app = App::new();
        app.add_plugins(WeatheringSchedulePlugin)
            .add_systems(WeatheringTick, (|| std::thread::sleep(SLOW)).in_set(WeatheringSystems::Trace));
        measure_stages(&mut app);
        app.world_mut().resource_mut::<StageTimes>().take();
        for _ in 0..3 {
            app.world_mut().run_schedule(WeatheringTick);
        }
        let means = app.world_mut().resource_mut::<StageTimes>().take().unwrap();
        assert_eq!(means.ticks, 3);
        // A sleep is never shorter than it was asked to be.
        assert!(means.stages_ms[3] >= 5.0, "{means:?}");
        assert!(means.outside_ms >= 0.0 && means.stages_ms.iter().all(|&ms| ms >= 0.0), "{means:?}");
        assert_eq!(app.world_mut().resource_mut::<StageTimes>().take(), None);
    }
}
