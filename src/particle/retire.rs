//! Taking the dead out of the world, all at once.

use bevy::prelude::*;

use super::{Lifespan, ParticleCounts, Sequence, Volume, WaterCounts};
use crate::effect::EffectIndex;

/// Particles that died in this tick; a buffer that keeps its capacity. Empty between ticks.
#[derive(Resource, Debug, Default)]
pub struct Retired {
    particles: Vec<(Sequence, Entity)>,
    hit: u64,
}

/// Finds the particles that hit a surface or whose time ran out, and ends the first tick of the newly born.
pub fn collect_dead(
    mut retired: ResMut<Retired>,
    mut water: ResMut<WaterCounts>,
    mut particles: Query<(Entity, &mut Lifespan, &Sequence, &Volume, &EffectIndex)>,
) {
    let Retired { particles: dead, hit } = &mut *retired;
    for (entity, mut lifespan, &sequence, &volume, &effect) in &mut particles {
        let lifespan = lifespan.bypass_change_detection();
        if lifespan.is_over() {
            dead.push((sequence, entity));
            if lifespan.has_hit() {
                *hit += 1;
            } else {
                water.expire(effect, volume);
            }
        }
        lifespan.born_at = 0;
    }
}

/// Despawns [`Retired`] in the order of their numbers, so that the tables stay the same from run to run.
pub fn retire_particles(world: &mut World) {
    // Taken out and put back, so that the buffer survives.
    let mut retired = std::mem::take(&mut *world.resource_mut::<Retired>());
    retired.particles.sort_unstable_by_key(|&(sequence, _)| sequence);
    for &(_, entity) in &retired.particles {
        world.despawn(entity);
    }
    let mut counts = world.resource_mut::<ParticleCounts>();
    let count = retired.particles.len() as u64;
    counts.alive -= count;
    counts.hit += retired.hit;
    counts.expired += count - retired.hit;

    retired.particles.clear();
    retired.hit = 0;
    *world.resource_mut::<Retired>() = retired;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dead_go_and_are_counted_by_cause() {
        let mut world = World::new();
        world.init_resource::<Retired>();
        world.init_resource::<WaterCounts>();
        world.insert_resource(ParticleCounts { emitted: 4, alive: 4, ..default() });
        let mut spawn = |ticks_left, number| {
            let life = Lifespan { ticks_left, born_at: 77 };
            world.spawn((life, Sequence(number), Volume(10 + number), EffectIndex(1))).id()
        };
        let alive = spawn(3, 0);
        let expired = spawn(0, 1);
        let mut struck = Lifespan { ticks_left: 9, born_at: 0 };
        struck.mark_hit();
        let hit = spawn(struck.ticks_left, 2);
        let also_alive = spawn(1, 3);

        let mut schedule = Schedule::default();
        schedule.add_systems((collect_dead, retire_particles).chain());
        schedule.run(&mut world);
        schedule.run(&mut world);

        assert!(world.get_entity(expired).is_err() && world.get_entity(hit).is_err());
        assert_eq!(world.get::<Lifespan>(alive), Some(&Lifespan { ticks_left: 3, born_at: 0 }));
        assert!(world.get_entity(also_alive).is_ok());
        let expected = ParticleCounts { emitted: 4, alive: 2, hit: 1, expired: 1, refused: 0 };
        assert_eq!(*world.resource::<ParticleCounts>(), expected);
        assert_eq!(world.resource::<WaterCounts>().expired_nl, [0, 11]);
    }
}
