//! Taking the dead out, all at once.

use bevy::prelude::*;

use super::{ParticleCounts, Particles, WaterCounts};
use crate::effect::EffectTable;

/// Takes out the particles that hit a surface or whose time ran out, and ends the first tick of the newly born.
pub(super) fn retire_particles(
    mut particles: ResMut<Particles>,
    mut counts: ResMut<ParticleCounts>,
    mut water: ResMut<WaterCounts>,
    effects: Res<EffectTable>,
) {
    let counts = counts.bypass_change_detection();
    // What others have added or taken out since the last tick.
    let here = particles.len() as u64;
    counts.emitted += here.saturating_sub(counts.alive);
    counts.expired += counts.alive.saturating_sub(here);
    counts.alive = here;
    particles.bypass_change_detection().retire(|dead| {
        counts.alive -= 1;
        if dead.lifespan.has_hit() {
            counts.hit += 1;
        } else {
            counts.expired += 1;
            let water_nl = effects.row(dead.effect).map_or(0, |row| row.water_nl(dead.volume_nl));
            water.expire(dead.effect, water_nl);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::super::{Lifespan, Particle, Sequence};
    use super::*;
    use crate::effect::{EffectIndex, WeatherEffect};

    fn particle(ticks_left: u16, number: u32) -> Particle {
        Particle {
            position: Vec3::ZERO,
            velocity: Vec3::ZERO,
            lifespan: Lifespan { ticks_left, born_at: 77 },
            volume_nl: 10 + number,
            sequence: Sequence(number),
            effect: EffectIndex(1),
            class: 0,
        }
    }

    #[test]
    fn what_others_add_and_take_out_is_counted_too() {
        let mut world = World::new();
        world.init_resource::<WaterCounts>();
        world.init_resource::<EffectTable>();
        world.init_resource::<Particles>();
        world.insert_resource(ParticleCounts { emitted: 4, alive: 4, ..default() });
        let mut schedule = Schedule::default();
        schedule.add_systems(retire_particles);
        // All four are gone, as on another level.
        schedule.run(&mut world);
        let gone = ParticleCounts { emitted: 4, expired: 4, ..default() };
        assert_eq!(*world.resource::<ParticleCounts>(), gone);
        // Two that no emitter sent, of which one dies at once.
        let others = [particle(0, 0), particle(9, 1)];
        world.resource_mut::<Particles>().spawn(others.into_iter());
        schedule.run(&mut world);
        let expected = ParticleCounts { emitted: 6, alive: 1, expired: 5, ..default() };
        assert_eq!(*world.resource::<ParticleCounts>(), expected);
    }

    #[test]
    fn the_dead_go_and_are_counted_by_cause() {
        let mut world = World::new();
        world.init_resource::<WaterCounts>();
        let mut effects = EffectTable::default();
        effects.insert(Handle::default(), WeatherEffect::default());
        let other = Handle::Uuid(bevy::asset::uuid::Uuid::from_u128(7), std::marker::PhantomData);
        effects.insert(other, WeatherEffect::default());
        world.insert_resource(effects);
        world.init_resource::<Particles>();
        world.insert_resource(ParticleCounts { emitted: 4, alive: 4, ..default() });
        let mut struck = particle(9, 2);
        struck.lifespan.mark_hit();
        let born = [particle(3, 0), particle(0, 1), struck, particle(1, 3)];
        world.resource_mut::<Particles>().spawn(born.into_iter());

        let mut schedule = Schedule::default();
        schedule.add_systems(retire_particles);
        schedule.run(&mut world);
        schedule.run(&mut world);

        let mut left: Vec<Particle> = world.resource::<Particles>().iter().collect();
        left.sort_unstable_by_key(|particle| particle.sequence);
        assert_eq!(left.iter().map(|particle| particle.sequence.0).collect::<Vec<_>>(), [0, 3]);
        assert_eq!(left[0].lifespan, Lifespan { ticks_left: 3, born_at: 0 });
        let expected = ParticleCounts { emitted: 4, alive: 2, hit: 1, expired: 1, ..default() };
        assert_eq!(*world.resource::<ParticleCounts>(), expected);
        assert_eq!(world.resource::<WaterCounts>().expired_nl, [0, 11]);
    }
}
