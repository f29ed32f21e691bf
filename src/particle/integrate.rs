//! One step of motion: gravity, wind and drag.

use bevy::math::Vec4;
use bevy::prelude::*;

use super::rows::{MotionRows, ROW, Rows};
use super::{Forces, Particles, Sequence, chunk_len, for_each_chunk};
use crate::clock::WeatheringClock;
use crate::effect::drops::SIZE_CLASSES;
use crate::effect::{EffectIndex, EffectTable, WeatherEffect};
use crate::weather::Weather;

/// Numbers of an effect that motion needs: a scratch row of [`integrate_particles`].
#[derive(Debug, Clone, Copy, Default)]
pub struct Motion {
    /// Acceleration, m/s².
    gravity: Vec3,
    /// Quadratic drag over mass, 1/m: g / v_terminal².
    drag: f32,
    /// Speed of the air that sways it, m/s.
    flutter: f32,
}

impl Motion {
    fn new(forces: &Forces, effect: &WeatherEffect, terminal_speed: f32) -> Self {
        let drag = if terminal_speed > 0.0 { STANDARD_GRAVITY / terminal_speed.powi(2) } else { 0.0 };
        Self { gravity: forces.gravity * effect.gravity_scale, drag, flutter: effect.flutter }
    }

    /// The air that sways a particle, beside the wind: round and round, each in its own way.
    fn sway(&self, sequence: Sequence, seconds: f32) -> Vec3 {
        let hash = sequence.0.wrapping_mul(0x9e37_79b9);
        let (phase, turns) = ((hash >> 16) as f32 / 65_536.0, 0.6 + 0.8 * (hash & 0xffff) as f32 / 65_536.0);
        let handed = if hash & 0x8000 == 0 { 1.0 } else { -1.0 };
        let (sin, cos) = (std::f32::consts::TAU * (phase + turns * seconds)).sin_cos();
        Vec3::new(cos, 0.0, handed * sin) * self.flutter
    }

    /// Velocity after `dt` seconds.
    ///
    /// Semi-implicit in the drag `-c |u| u` on the velocity `u` relative to the wind, so it is stable for any step:
    /// a gust slows a particle down to the wind's speed, never past it.
    fn step(&self, velocity: Vec3, wind: Vec3, dt: f32) -> Vec3 {
        let braking = self.drag * (velocity - wind).length() * dt;
        (velocity + self.gravity * dt + wind * braking) / (1.0 + braking)
    }
}

/// The gravity that [terminal speeds](crate::effect::WeatherEffect::terminal_speed) refer to, m/s².
const STANDARD_GRAVITY: f32 = 9.81;

/// Below this many particles one thread is faster than waking others.
const PARALLEL_BATCH: usize = 16_384;

/// Motions by effect and size class, and the air.
#[derive(Clone, Copy)]
struct Moving<'a> {
    motions: &'a [[Motion; SIZE_CLASSES]],
    wind: Vec3,
    /// Since the beginning.
    seconds: f32,
}

impl Moving<'_> {
    fn motion(&self, effect: EffectIndex, class: u8) -> &Motion {
        &self.motions[usize::from(effect.0)][usize::from(class) % SIZE_CLASSES]
    }

    fn air(&self, motion: &Motion, sequence: Sequence) -> Vec3 {
        if motion.flutter > 0.0 { self.wind + motion.sway(sequence, self.seconds) } else { self.wind }
    }

    fn sways(&self, effects: &[EffectIndex; ROW]) -> bool {
        effects.iter().any(|&effect| self.motion(effect, 0).flutter > 0.0)
    }

    fn rows(
        &self,
        effects: &[EffectIndex; ROW],
        classes: &[u8; ROW],
        sequences: &[Sequence; ROW],
    ) -> MotionRows {
        let motions: [&Motion; ROW] = std::array::from_fn(|lane| self.motion(effects[lane], classes[lane]));
        MotionRows {
            gravity: Rows::of(&motions.map(|motion| motion.gravity)),
            air: Rows::of(&std::array::from_fn(|lane| self.air(motions[lane], sequences[lane]))),
            drag: Vec4::from_array(motions.map(|motion| motion.drag)),
        }
    }
}

/// Accelerates every particle and moves it by what is left of its tick, which is one fewer to live.
pub fn integrate_particles(
    clock: Res<WeatheringClock>,
    forces: Res<Forces>,
    weather: Res<Weather>,
    effects: Res<EffectTable>,
    mut motions: Local<Vec<[Motion; SIZE_CLASSES]>>,
    mut particles: ResMut<Particles>,
) {
    motions.clear();
    motions.extend(effects.rows().iter().map(|row| match &row.effect {
        Some(effect) => std::array::from_fn(|class| Motion::new(&forces, effect, row.terminal_speed(class))),
        None => [Motion::default(); SIZE_CLASSES],
    }));
    let tick = clock.delta_secs();
    // Wraps after some hours, while an `f32` still knows hundredths.
    let seconds = (clock.tick() % (8192 * clock.hz())) as f32 / clock.hz() as f32;
    let moving = Moving { motions: &motions, wind: weather.wind, seconds };
    let particles = particles.bypass_change_detection();
    let newborn = particles.newborn_from();
    let Particles { positions, velocities, lifespans, effects, classes, sequences, .. } = particles;
    let len = chunk_len(positions.len(), PARALLEL_BATCH);
    let columns = positions.chunks_mut(len).zip(velocities.chunks_mut(len)).zip(lifespans.chunks_mut(len));
    let kinds = effects.chunks(len).zip(classes.chunks(len)).zip(sequences.chunks(len));
    for_each_chunk(columns.zip(kinds).enumerate(), |(chunk, (columns, kinds))| {
        let ((positions, velocities), lifespans) = columns;
        let ((effects, classes), sequences) = kinds;
        for lifespan in lifespans.iter_mut() {
            lifespan.ticks_left = lifespan.ticks_left.saturating_sub(1);
        }
        let old = newborn.saturating_sub(chunk * len).min(positions.len());
        let (whole, _) = positions[..old].as_chunks_mut::<ROW>();
        let by_itself = whole.len() * ROW;
        let whole = whole.iter_mut().zip(velocities.as_chunks_mut::<ROW>().0);
        let kinds = effects.as_chunks::<ROW>().0.iter().zip(classes.as_chunks::<ROW>().0);
        let kinds = kinds.zip(sequences.as_chunks::<ROW>().0);
        let (mut kind, mut rows) = (None, MotionRows::default());
        for ((positions, velocities), ((effects, classes), sequences)) in whole.zip(kinds) {
            // Neighbours are mostly of one kind.
            if kind != Some((effects, classes)) {
                rows = moving.rows(effects, classes, sequences);
                // What sways does so each in its own way.
                kind = (!moving.sways(effects)).then_some((effects, classes));
            }
            rows.advance(positions, velocities, tick);
        }
        for index in by_itself..positions.len() {
            let dt = if index < old { tick } else { tick * lifespans[index].moving_part() };
            let motion = moving.motion(effects[index], classes[index]);
            velocities[index] = motion.step(velocities[index], moving.air(motion, sequences[index]), dt);
            positions[index] += velocities[index] * dt;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::super::{Lifespan, Particle};
    use super::*;
    use crate::test_random::Random;

    fn world_with(effect: WeatherEffect, forces: Forces) -> (World, EffectIndex) {
        let mut world = World::new();
        world.insert_resource(WeatheringClock::new(60));
        world.insert_resource(forces);
        world.init_resource::<Weather>();
        world.init_resource::<Particles>();
        let mut table = EffectTable::default();
        let index = table.insert(Handle::default(), effect).unwrap();
        world.insert_resource(table);
        (world, index)
    }

    fn spawn(world: &mut World, velocity: Vec3, effect: EffectIndex, born_at: u16) {
        let lifespan = Lifespan { ticks_left: 9, born_at };
        let (position, sequence) = (Vec3::ZERO, Sequence(0));
        let particle = Particle { position, velocity, lifespan, volume_nl: 1, sequence, effect, class: 0 };
        world.resource_mut::<Particles>().spawn([particle].into_iter());
    }

    fn velocity(world: &World) -> Vec3 {
        world.resource::<Particles>().velocities()[0]
    }

    fn run(world: &mut World, ticks: usize) {
        bevy::tasks::ComputeTaskPool::get_or_init(Default::default);
        let mut schedule = Schedule::default();
        schedule.add_systems(integrate_particles);
        for _ in 0..ticks {
            schedule.run(world);
        }
    }

    #[test]
    fn falls_to_terminal_speed_and_no_faster() {
        let effect = WeatherEffect { terminal_speed: Some(6.55), ..default() };
        let (mut world, index) = world_with(effect, Forces::default());
        spawn(&mut world, Vec3::ZERO, index, 0);
        run(&mut world, 600);
        let speed = velocity(&world).length();
        assert!((speed - 6.55).abs() < 0.01, "{speed}");
    }

    #[test]
    fn without_drag_it_keeps_the_wind_out_and_falls_freely() {
        let effect = WeatherEffect { terminal_speed: Some(0.0), ..default() };
        let (mut world, index) = world_with(effect, Forces::default());
        world.resource_mut::<Weather>().wind = Vec3::X * 50.0;
        spawn(&mut world, Vec3::ZERO, index, 0);
        run(&mut world, 60);
        let velocity = velocity(&world);
        assert!((velocity - Vec3::new(0.0, -9.81, 0.0)).length() < 1e-3, "{velocity}");
    }

    #[test]
    fn a_storm_carries_light_particles_with_it() {
        let effect = WeatherEffect { terminal_speed: Some(0.05), ..default() };
        let (mut world, index) = world_with(effect, Forces::default());
        world.resource_mut::<Weather>().wind = Vec3::X * 30.0;
        spawn(&mut world, Vec3::ZERO, index, 0);
        run(&mut world, 120);
        let velocity = velocity(&world);
        assert!(velocity.x > 29.0 && velocity.x <= 30.0, "{velocity}");
    }

    #[test]
    fn flakes_are_swayed_round_where_they_fall() {
        let effect = WeatherEffect { terminal_speed: Some(1.0), flutter: 0.4, ..default() };
        let (mut world, index) = world_with(effect, Forces::default());
        spawn(&mut world, Vec3::NEG_Y, index, 0);
        let (mut fastest, mut farthest) = (0.0f32, 0.0f32);
        for _ in 0..600 {
            world.resource_mut::<WeatheringClock>().advance();
            run(&mut world, 1);
            let at = world.resource::<Particles>().positions()[0];
            farthest = farthest.max(at.with_y(0.0).length());
            fastest = fastest.max(velocity(&world).with_y(0.0).length());
        }
        assert!((0.2..0.45).contains(&fastest) && (0.02..0.5).contains(&farthest), "{fastest} {farthest}");
        assert!((velocity(&world).y + 1.0).abs() < 0.2, "{}", velocity(&world));
    }

    #[test]
    fn four_together_move_as_each_would_alone() {
        let mut random = Random(1);
        for _ in 0..1000 {
            let mut vector = |scale: f32| random.in_cube(scale);
            let (mut positions, mut velocities) =
                ([(); ROW].map(|()| vector(9.0)), [(); ROW].map(|()| vector(20.0)));
            let airs = [(); ROW].map(|()| vector(15.0));
            let motions =
                [(); ROW].map(|()| Motion { gravity: vector(10.0), drag: vector(2.0).x.abs(), flutter: 0.0 });
            let alone: [(Vec3, Vec3); ROW] = std::array::from_fn(|lane| {
                let velocity = motions[lane].step(velocities[lane], airs[lane], 1.0 / 60.0);
                (positions[lane] + velocity * (1.0 / 60.0), velocity)
            });
            let rows = MotionRows {
                gravity: Rows::of(&motions.map(|motion| motion.gravity)),
                air: Rows::of(&airs),
                drag: Vec4::from_array(motions.map(|motion| motion.drag)),
            };
            rows.advance(&mut positions, &mut velocities, 1.0 / 60.0);
            let together: [(Vec3, Vec3); ROW] =
                std::array::from_fn(|lane| (positions[lane], velocities[lane]));
            assert_eq!(together, alone);
        }
    }

    #[test]
    fn a_crowd_of_many_kinds_moves_as_its_members_do() {
        let effect =
            |speed: f32, flutter: f32| WeatherEffect { terminal_speed: Some(speed), flutter, ..default() };
        let (mut world, first) = world_with(effect(6.0, 0.0), Forces::default());
        let other = Handle::Uuid(bevy::asset::uuid::Uuid::from_u128(9), std::marker::PhantomData);
        let second = world.resource_mut::<EffectTable>().insert(other, effect(1.0, 0.4)).unwrap();
        let particle = |number: u32| Particle {
            position: Vec3::ZERO,
            velocity: Vec3::new(1.0, -(number as f32), 0.5),
            lifespan: Lifespan { ticks_left: 9, born_at: 0 },
            volume_nl: 1,
            sequence: Sequence(number),
            effect: if number % 11 < 8 { first } else { second },
            class: 0,
        };
        let moved = |world: &mut World, number: std::ops::Range<u32>| {
            world.resource_mut::<Particles>().clear();
            world.resource_mut::<Particles>().spawn(number.map(particle));
            // The tick of their birth is over.
            world.resource_mut::<Particles>().retire(|_| {});
            run(world, 1);
            let particles = world.resource::<Particles>();
            particles
                .positions()
                .iter()
                .copied()
                .zip(particles.velocities().iter().copied())
                .collect::<Vec<_>>()
        };
        let together = moved(&mut world, 0..67);
        let alone: Vec<_> = (0..67).flat_map(|number| moved(&mut world, number..number + 1)).collect();
        assert_eq!(together, alone);
    }

    #[test]
    fn a_particle_born_within_the_tick_moves_only_the_rest_of_it() {
        let effect = WeatherEffect { terminal_speed: Some(0.0), gravity_scale: 0.0, ..default() };
        let (mut world, index) = world_with(effect, Forces::default());
        spawn(&mut world, Vec3::X * 60.0, index, 0x4000);
        run(&mut world, 1);
        let moved = world.resource::<Particles>().positions()[0].x;
        assert!((moved - 0.75).abs() < 1e-5, "{moved}");
    }

    #[test]
    fn the_swept_segment_ends_where_it_should_and_begins_a_little_early() {
        let start = super::super::swept_start(Vec3::X, Vec3::X * 10.0, 0.1);
        assert!(start.x < 0.0 && start.x > -2e-4, "{start}");
    }
}
