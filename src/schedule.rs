//! The order in which a tick happens: the only place where sets are configured.
//!
//! A tick is a schedule of its own, [`WeatheringTick`], that runs once in each [`FixedUpdate`]; a frame may hold none,
//! one or several. Its stages need each other's results, so they run one after the other, on one thread; what is
//! parallel is the loop over particles or surfaces inside a system. For a few hundred particles, handing a dozen systems
//! to other threads would cost several times what they do.
//!
//! Each set belongs to the plugin that fills it; systems of yours order themselves against the sets:
//!
//! ```
//! # use bevy::prelude::*;
//! # use bevy_weathering::prelude::*;
//! # fn count_impacts() {}
//! # let mut app = App::new();
//! app.add_systems(WeatheringTick, count_impacts.in_set(WeatheringSystems::Last));
//! ```

use bevy::ecs::schedule::{ScheduleLabel, SingleThreadedExecutor};
use bevy::prelude::*;

/// The schedule of one weathering tick. Runs in [`FixedUpdate`].
#[derive(ScheduleLabel, Debug, Clone, PartialEq, Eq, Hash)]
pub struct WeatheringTick;

/// The stages of one weathering tick, in the order they run.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum WeatheringSystems {
    /// Brushes paint and events of scenarios act; for systems that want to run before the tick.
    First,
    /// Emitters spawn particles.
    Emit,
    /// Forces change the velocity of particles, and particles move.
    Integrate,
    /// The segment each particle moved is cast against the surfaces; the dead are retired.
    Trace,
    /// Impacts become splats, and drops of water, on the surfaces they hit.
    Deposit,
    /// Water is absorbed, runs, spreads and drips.
    Flow,
    /// For systems that want to see the finished tick.
    Last,
}

/// The last step of [`WeatheringSystems::Trace`]: what hit or expired leaves its columns.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct RetireSystems;

/// Adds [`WeatheringTick`] and configures [`WeatheringSystems`].
pub struct WeatheringSchedulePlugin;

impl Plugin for WeatheringSchedulePlugin {
    fn build(&self, app: &mut App) {
        use WeatheringSystems::*;
        app.edit_schedule(WeatheringTick, |tick| {
            tick.set_executor(SingleThreadedExecutor::new());
        })
        .configure_sets(WeatheringTick, (First, Emit, Integrate, Trace, Deposit, Flow, Last).chain())
        .configure_sets(WeatheringTick, RetireSystems.in_set(Trace))
        .register_type::<TickHold>()
        .init_resource::<TickHold>()
        .add_systems(FixedUpdate, run_tick);
    }
}

/// Lets ticks be left out. Weather time stands still then, whatever Bevy's fixed time does: nothing is emitted, nothing dries and
/// nothing is lost.
#[derive(Resource, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct TickHold {
    /// Whether ticks are left out until you say otherwise. Yours alone: nobody else sets it.
    pub is_paused: bool,
    /// Whether the next tick is left out. Set, and set back, by those who cannot keep up: so that maps are painted whole,
    /// [`GpuOverlayPlugin`](crate::overlay::GpuOverlayPlugin), before each tick.
    pub is_held: bool,
    /// Ticks that were held so far. Those of a pause are not among them: nobody lags behind.
    pub ticks: u64,
}

/// The whole tick, as one system that others in [`FixedUpdate`] can be ordered against.
pub fn run_tick(world: &mut World) {
    if let Some(mut hold) = world.get_resource_mut::<TickHold>() {
        if hold.is_paused {
            return;
        }
        if hold.is_held {
            hold.ticks += 1;
            return;
        }
    }
    world.run_schedule(WeatheringTick);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Resource, Default)]
    struct Ran(u32);

    #[test]
    fn held_ticks_are_counted_and_not_run_and_those_of_a_pause_are_neither() {
        let mut app = App::new();
        app.add_plugins(WeatheringSchedulePlugin)
            .init_resource::<Ran>()
            .add_systems(WeatheringTick, |mut ran: ResMut<Ran>| ran.0 += 1);
        for (is_held, is_paused, expected) in [
            (false, false, (1, 0)),
            (true, false, (1, 1)),
            (true, false, (1, 2)),
            (true, true, (1, 2)),
            (false, true, (1, 2)),
            (false, false, (2, 2)),
        ] {
            let mut hold = app.world_mut().resource_mut::<TickHold>();
            (hold.is_held, hold.is_paused) = (is_held, is_paused);
            run_tick(app.world_mut());
            assert_eq!((app.world().resource::<Ran>().0, app.world().resource::<TickHold>().ticks), expected);
        }
    }
}
