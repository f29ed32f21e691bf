//! What a particle costs that nothing is near, per tick: 100,000 of them, falling 50 m above scene 1.
//!
//! The library moves them, finds that they are outside the scene's box, and looks whether they are dead;
//! nobody is born or dies. Against it stands the least that a CPU could do: two arrays and the same drag
//! formula, without entities, effects or lifetimes. Every 2 s of weather all particles are put back to where
//! they were, so that they never arrive; that is timed with the rest, once in 120 ticks for both.

use std::hint::black_box;

use bevy::prelude::*;
use bevy_weathering::particle::{Lifespan, Particle, ParticleCounts, Particles, Sequence};
use criterion::{Criterion, Throughput};

use crate::measure::{self, Contender};
use crate::scene::{self, GRAVITY, HZ, Random};
use crate::sim::{Setup, Sim};

const PARTICLES: usize = 100_000;

/// m above the ground, at the start of each fall.
const HEIGHT: f32 = 50.0;

/// At the start of each fall.
const VELOCITY: Vec3 = Vec3::new(0.5, -6.0, -0.5);

/// 2 s at less than 14 m/s: nobody falls below 20 m.
const FALL_TICKS: u32 = 2 * HZ;

fn start(random: &mut Random) -> Vec3 {
    Vec3::new(3.0 * random.signed(), HEIGHT, 3.0 * random.signed())
}

/// The library's particles.
fn ours() -> impl FnMut() -> usize {
    let mut sim = Sim::new(Setup { rate: 0.0, drag: true, ..default() });
    let effect = sim.effect();
    let world = sim.world_mut();
    let mut random = Random::new();
    let lifespan = Lifespan { ticks_left: Lifespan::MAX_TICKS, born_at: 0 };
    let born: Vec<Particle> = (0..PARTICLES as u32)
        .map(|number| {
            let (position, sequence) = (start(&mut random), Sequence(number));
            Particle { position, velocity: VELOCITY, lifespan, volume_nl: 1000, sequence, effect, class: 0 }
        })
        .collect();
    world.resource_mut::<Particles>().spawn(born.into_iter());
    // So that the books balance.
    let mut counts = world.resource_mut::<ParticleCounts>();
    counts.emitted += PARTICLES as u64;
    counts.alive += PARTICLES as u64;
    let mut tick = 0;
    move || {
        if tick == FALL_TICKS {
            tick = 0;
            let mut particles = sim.world_mut().resource_mut::<Particles>();
            particles.positions_mut().iter_mut().for_each(|position| position.y = HEIGHT);
            particles.velocities_mut().fill(VELOCITY);
        }
        tick += 1;
        sim.tick()
    }
}

/// Two arrays and a formula.
fn bare() -> impl FnMut() -> usize {
    let mut random = Random::new();
    let mut positions: Vec<Vec3> = (0..PARTICLES).map(|_| start(&mut random)).collect();
    let mut velocities = vec![VELOCITY; PARTICLES];
    // As the library has it: quadratic drag over mass, g / v_terminal².
    let drag = 9.81 / scene::water().terminal_speed.unwrap_or_default().powi(2);
    let (wind, dt) = (black_box(Vec3::ZERO), 1.0 / HZ as f32);
    let mut tick = 0;
    move || {
        if tick == FALL_TICKS {
            tick = 0;
            positions.iter_mut().for_each(|position| position.y = HEIGHT);
            velocities.fill(VELOCITY);
        }
        tick += 1;
        for (position, velocity) in positions.iter_mut().zip(&mut velocities) {
            let braking = drag * (*velocity - wind).length() * dt;
            *velocity = (*velocity + GRAVITY * dt + wind * braking) / (1.0 + braking);
            *position += *velocity * dt;
        }
        black_box(&positions).len()
    }
}

/// Runs the group.
pub fn bench(criterion: &mut Criterion) {
    if !measure::wanted("far") {
        return;
    }
    let mut contenders = [Contender::new("schedule", ours()), Contender::new("bare_arrays", bare())];
    let mut group = criterion.benchmark_group("far");
    group.throughput(Throughput::Elements(PARTICLES as u64));
    for contender in &mut contenders {
        contender.bench(&mut group);
    }
    group.finish();
    if measure::measuring() {
        let [ours, bare] = measure::means("far", "particles", &mut contenders, 10, 30);
        let nanos = |seconds: f64| seconds * 1e9 / PARTICLES as f64;
        println!("far: {:.2} ns per particle and tick; bare arrays {:.2} ns", nanos(ours), nanos(bare));
        measure::ratio("far/schedule against bare_arrays", ours, bare);
    }
}
