//! Casting what every particle moved, in parallel, with one order.

use bevy::prelude::*;
use bevy::utils::Parallel;

use super::{CollisionScene, Impact, Impacts};
use crate::clock::WeatheringClock;
use crate::particle::{
    BoxRows, Lifespan, Particles, ROW, WayRows, chunk_len, for_each_chunk, swept_seconds, swept_start,
};

/// Below this many particles one thread is faster than waking others.
const PARALLEL_BATCH: usize = 1024;

/// Asks for a [`SurfaceImpact`] message for each particle that hits this surface.
#[derive(Component, Reflect, Debug, Default, Clone, Copy)]
#[reflect(Component, Default)]
pub struct ReportImpacts;

/// A particle hit a surface that has [`ReportImpacts`].
#[derive(Message, Reflect, Debug, Clone, Copy, PartialEq)]
pub struct SurfaceImpact(pub Impact);

/// Casts the segment each particle moved in this tick; what hits ends there and becomes an [`Impact`].
pub(super) fn trace_particles(
    clock: Res<WeatheringClock>,
    scene: Res<CollisionScene>,
    mut impacts: ResMut<Impacts>,
    mut per_thread: Local<Parallel<Vec<Impact>>>,
    mut boxes: Local<Vec<BoxRows>>,
    mut particles: ResMut<Particles>,
) {
    impacts.0.clear();
    if scene.is_empty() {
        return;
    }
    let tick = clock.delta_secs();
    let longest = swept_seconds(tick);
    let particles = particles.bypass_change_detection();
    let newborn = particles.newborn_from();
    let Particles { positions, velocities, lifespans, volumes_nl, sequences, effects, classes, .. } =
        particles;
    let len = chunk_len(positions.len(), PARALLEL_BATCH);
    let chunks = lifespans.chunks_mut(len).enumerate();
    boxes.clear();
    boxes.extend(scene.first_boxes().map(BoxRows::new));
    let (scene, per_thread_found, boxes) = (&*scene, &*per_thread, &**boxes);
    let reach = BoxRows::new(scene.bounds());
    for_each_chunk(chunks, |(chunk, lifespans)| {
        let mut found = per_thread_found.borrow_local_mut();
        let mut trace = |index: usize, lifespan: &mut Lifespan| {
            let (end, velocity) = (positions[index], velocities[index]);
            let seconds = if index < newborn { tick } else { tick * lifespan.moving_part() };
            let start = swept_start(end, velocity, seconds);
            let Some(hit) = scene.cast(start, end) else { return };
            lifespan.mark_hit();
            found.push(Impact {
                sequence: sequences[index],
                surface: hit.surface,
                triangle: hit.triangle,
                point: hit.point,
                normal: hit.normal,
                uv: hit.uv,
                uv_per_metre: hit.uv_per_metre,
                along: hit.along,
                back: hit.back,
                velocity,
                effect: effects[index],
                class: classes[index],
                volume_nl: volumes_nl[index],
            });
        };
        let here = chunk * len..chunk * len + lifespans.len();
        let (ends, velocities) =
            (positions[here.clone()].as_chunks::<ROW>(), velocities[here.clone()].as_chunks::<ROW>());
        let (rows, rest) = lifespans.as_chunks_mut::<ROW>();
        let first_of_rest = here.end - rest.len();
        for (index, ((ends, velocities), lifespans)) in
            here.step_by(ROW).zip(ends.0.iter().zip(velocities.0).zip(rows))
        {
            // Most are far from everything, or between the surfaces: this is all they cost. The newborn have come less far.
            let ways = WayRows::new(ends, velocities, longest);
            let mut touched = reach.touched(&ways);
            if touched != 0 {
                touched &= boxes.iter().fold(0, |any, near| any | near.touched(&ways));
            }
            if touched != 0 {
                for (lane, lifespan) in lifespans.iter_mut().enumerate() {
                    if touched >> (3 * lane) & 1 == 1 {
                        trace(index + lane, lifespan);
                    }
                }
            }
        }
        for (index, lifespan) in (first_of_rest..).zip(rest) {
            trace(index, lifespan);
        }
    });
    for found in per_thread.iter_mut() {
        impacts.0.append(found);
    }
    // Numbers are unique, so this order is the only one.
    impacts.0.sort_unstable_by_key(|impact| impact.sequence);
}

/// Tells those who asked.
pub(super) fn report_impacts(
    impacts: Res<Impacts>,
    listening: Query<(), With<ReportImpacts>>,
    mut messages: MessageWriter<SurfaceImpact>,
) {
    if !listening.is_empty() {
        messages.write_batch(
            impacts.0.iter().filter(|impact| listening.contains(impact.surface)).copied().map(SurfaceImpact),
        );
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bevy::math::Affine3A;
    use bevy::tasks::ComputeTaskPool;

    use super::*;
    use crate::collision::{MeshBvh, MeshTriangles};
    use crate::effect::EffectIndex;
    use crate::particle::{Lifespan, Particle, Sequence};

    /// A square of 2 m at height 0, uv 0..1 along x and -z.
    fn world() -> (World, Entity) {
        ComputeTaskPool::get_or_init(default);
        let mut world = World::new();
        let surface = world.spawn(ReportImpacts).id();
        let square = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
        let bvh = Arc::new(MeshBvh::build(MeshTriangles::from_mesh(&square).unwrap()));
        world.insert_resource(CollisionScene::new([(surface, Affine3A::IDENTITY, bvh)]));
        world.insert_resource(WeatheringClock::new(10));
        world.init_resource::<Impacts>();
        world.init_resource::<Particles>();
        world.init_resource::<Messages<SurfaceImpact>>();
        (world, surface)
    }

    /// A particle that moved from one point to another in the last tick.
    fn spawn(world: &mut World, from: Vec3, to: Vec3, number: u32) {
        let particle = Particle {
            position: to,
            velocity: (to - from) * 10.0,
            lifespan: Lifespan { ticks_left: 5, born_at: 0 },
            volume_nl: number,
            sequence: Sequence(number),
            effect: EffectIndex(0),
            class: 0,
        };
        world.resource_mut::<Particles>().spawn([particle].into_iter());
    }

    fn run(world: &mut World) {
        let mut schedule = Schedule::default();
        schedule.add_systems((trace_particles, report_impacts).chain());
        schedule.run(world);
    }

    #[test]
    fn what_crossed_the_surface_hits_it_and_the_rest_flies_on() {
        let (mut world, surface) = world();
        spawn(&mut world, Vec3::new(0.5, 0.1, 0.5), Vec3::new(0.5, -0.1, 0.5), 8);
        spawn(&mut world, Vec3::new(-0.5, -0.3, 0.5), Vec3::new(-0.5, 0.1, 0.5), 3);
        spawn(&mut world, Vec3::new(0.0, 0.4, 0.0), Vec3::new(0.0, 0.2, 0.0), 1);
        spawn(&mut world, Vec3::new(1.5, 0.1, 0.0), Vec3::new(1.5, -0.1, 0.0), 2);
        run(&mut world);

        let has_hit: Vec<bool> =
            world.resource::<Particles>().lifespans().iter().map(|life| life.has_hit()).collect();
        assert_eq!(has_hit, [true, true, false, false]);
        let impacts = &world.resource::<Impacts>().0;
        assert_eq!(impacts.iter().map(|impact| impact.sequence.0).collect::<Vec<_>>(), [3, 8]);
        for impact in impacts {
            assert_eq!(impact.surface, surface);
            assert!(impact.point.y.abs() < 1e-4, "{}", impact.point);
            assert!(impact.normal.dot(impact.velocity) < 0.0, "the side it came from");
            let uv = Vec2::new(impact.point.x, impact.point.z) * 0.5 + 0.5;
            assert!((impact.uv - uv).length() < 1e-3, "{} {uv}", impact.uv);
            assert!((impact.uv_per_metre - 0.5).length() < 1e-4);
        }
        assert_eq!(world.resource::<Messages<SurfaceImpact>>().len(), 2);
    }

    #[test]
    fn a_particle_born_late_in_the_tick_did_not_cross_what_lay_before() {
        let (mut world, _) = world();
        spawn(&mut world, Vec3::new(0.0, 0.5, 0.0), Vec3::new(0.0, -0.5, 0.0), 1);
        // It moved only the last quarter: from -0.25 on.
        world.resource_mut::<Particles>().lifespans[0].born_at = 0xC000;
        run(&mut world);
        assert!(world.resource::<Impacts>().0.is_empty());
    }

    #[test]
    fn many_threads_find_the_same_order() {
        let (mut world, _) = world();
        for number in (0..5000).rev() {
            let x = (number as f32 / 2500.0 - 1.0) * 0.99;
            spawn(&mut world, Vec3::new(x, 0.1, 0.2), Vec3::new(x, -0.1, 0.2), number);
        }
        run(&mut world);
        let found: Vec<u32> = world.resource::<Impacts>().0.iter().map(|impact| impact.volume_nl).collect();
        assert_eq!(found, (0..5000).collect::<Vec<_>>());
    }
}
