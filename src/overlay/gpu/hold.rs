//! Holding ticks while too much waits to be painted.

use bevy::prelude::*;

use super::SplatStats;
use crate::overlay::{SplatBudget, SplatQueue};
use crate::schedule::TickHold;

/// Lets no tick begin while as many splats wait as the budget allows: memory stays bounded and no splat is lost. Where none can
/// ever be painted, none waits. Runs before the ticks of a frame, which sees what has been painted, and in each tick, which sees
/// what has come.
pub(super) fn hold_ticks(
    budget: Res<SplatBudget>,
    stats: Res<SplatStats>,
    queues: Query<&SplatQueue>,
    mut hold: ResMut<TickHold>,
) {
    let queued: u64 = queues.iter().map(|queue| queue.splats().len() as u64).sum();
    let waiting = queued + stats.pending();
    let is_held = budget.is_exceeded_by(waiting);
    if is_held && !hold.is_held {
        warn_once!("time is held: {waiting} splats wait to be painted, {} may", budget.most_waiting);
    }
    hold.is_held = is_held;
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::overlay::Splat;
    use crate::schedule::{WeatheringSchedulePlugin, WeatheringTick, run_tick};

    #[test]
    fn ticks_are_held_while_too_much_waits_wherever_it_does() {
        let mut world = World::new();
        world.insert_resource(SplatBudget { most_waiting: 10, ..default() });
        world.init_resource::<SplatStats>();
        world.init_resource::<TickHold>();
        let surface = world.spawn(SplatQueue::default()).id();
        let mut schedule = Schedule::default();
        schedule.add_systems(hold_ticks);
        for (queued, pending, expected) in [(9, 0, false), (10, 0, true), (4, 6, true), (4, 5, false)] {
            let mut queue = world.get_mut::<SplatQueue>(surface).unwrap();
            queue.clear();
            (0..queued).for_each(|_| queue.push(Splat::zeroed()));
            world.resource::<SplatStats>().set_pending(pending);
            schedule.run(&mut world);
            assert_eq!(world.resource::<TickHold>().is_held, expected, "{queued} {pending}");
        }
    }

    #[derive(Resource, Default)]
    struct Ran(u32);

    #[test]
    fn a_pause_lasts_though_nothing_waits() {
        let mut app = App::new();
        app.add_plugins(WeatheringSchedulePlugin)
            .init_resource::<SplatBudget>()
            .init_resource::<SplatStats>()
            .init_resource::<Ran>()
            .add_systems(PreUpdate, hold_ticks)
            .add_systems(WeatheringTick, |mut ran: ResMut<Ran>| ran.0 += 1);
        for (is_paused, expected) in [(true, 0), (false, 1)] {
            app.world_mut().resource_mut::<TickHold>().is_paused = is_paused;
            app.world_mut().run_schedule(PreUpdate);
            run_tick(app.world_mut());
            assert_eq!(app.world().resource::<Ran>().0, expected);
        }
    }
}
