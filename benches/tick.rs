//! A tick in the steady state, against the brute force of 2007.
//!
//! Both start from the same living particles and get the same births tick by tick. Drag is off, since the
//! baseline has none; the formula costs the library the same. The library is timed as the schedules of a tick
//! alone and as a whole frame of the app, each with its splats thrown away (what remains to a CPU whose GPU
//! paints) and painted on the CPU. The baseline only collides: it makes no splats and paints nothing.
//!
//! First scene 1 at 1,000 particles a second, all of that. Then the schedule alone in both scenes at several rates, twice: with
//! particles that carry water, which is absorbed, runs, drips and splashes, and with such that carry none, as the baseline's.
//! Each has a baseline of its own, since splashes and drips are particles, too.
//!
//! At 1,000 particles a second a few hundred are in flight, and the library's tick is for a large part the
//! fixed price of running systems. At 100,000 that price is spread. The rates are timed by turns alone, as many a
//! brute-force tick takes too long for criterion's samples.

use bevy::prelude::*;
use bevy::tasks::ComputeTaskPool;
use criterion::Criterion;

use crate::hoff::{HoffParticle, HoffReject, HoffSystem};
use crate::measure::{self, Contender};
use crate::scene::{GRAVITY, HZ, Scene};
use crate::sim::{Recorded, Setup, Sim};

/// Particles a second in both scenes.
const RATES: [f32; 4] = [100.0, 250.0, 500.0, 1_000.0];

/// Particles a second in scene 1 alone.
const DENSE: f32 = 100_000.0;

/// The baseline in a scene, with births that repeat.
struct Brute<'a> {
    system: HoffSystem,
    births: &'a [Vec<HoffParticle>],
    next: usize,
}

impl<'a> Brute<'a> {
    fn new(scene: Scene, reject: HoffReject, Recorded { living, births }: &'a Recorded) -> Self {
        let mut system = scene.hoff(reject);
        system.emit(living.len(), |i| living[i]);
        Self { system, births, next: 0 }
    }

    /// Returns how many particles are alive.
    fn tick(&mut self) -> usize {
        let born = &self.births[self.next];
        self.next = (self.next + 1) % self.births.len();
        self.system.emit(born.len(), |i| born[i]);
        self.system.tick(1.0 / HZ as f32, GRAVITY);
        self.system.particles().len()
    }
}

/// The baselines, then what [`OURS`] names.
fn contenders(recorded: &Recorded) -> [Contender<'_>; 6] {
    let brute = |reject| {
        let mut brute = Brute::new(Scene::One, reject, recorded);
        move || brute.tick()
    };
    let steady = |cpu_painter| Sim::steady(Setup { cpu_painter, ..default() });
    let schedule = |cpu_painter| {
        let mut sim = steady(cpu_painter);
        move || sim.tick()
    };
    let frame = |cpu_painter| {
        let mut sim = steady(cpu_painter);
        move || sim.frame()
    };
    [
        Contender::new("hoff_no_reject", brute(HoffReject::Nothing)),
        Contender::new("hoff_sphere_reject", brute(HoffReject::BoundingSphere)),
        Contender::new(OURS[0], schedule(false)),
        Contender::new(OURS[1], schedule(true)),
        Contender::new(OURS[2], frame(false)),
        Contender::new(OURS[3], frame(true)),
    ]
}

const OURS: [&str; 4] = ["schedule", "schedule_cpu_painter", "frame", "frame_cpu_painter"];

/// Prints how many times faster than both baselines.
fn ratios(name: &str, ours: f64, no_reject: f64, sphere_reject: f64) {
    measure::ratio(&format!("{name} against hoff_no_reject"), ours, no_reject);
    measure::ratio(&format!("{name} against hoff_sphere_reject"), ours, sphere_reject);
}

/// The schedule of a tick at each rate. The same two simulations go through all rates, so surfaces keep what came before.
fn compare_rates(scene: Scene, water: bool) {
    let setup = Setup { scene, water, ..default() };
    let (mut recorder, mut ours) = (Sim::recorder(setup), Sim::new(setup));
    let (number, kind) = (if scene == Scene::One { 1 } else { 2 }, if water { "water" } else { "dry" });
    let dense = (scene == Scene::One).then_some(DENSE);
    for rate in RATES.into_iter().chain(dense) {
        let recorded = &recorder.record(rate);
        ours.steady_at(rate);
        let (rounds, calls) = if rate < DENSE { (10, 5) } else { (3, 2) };
        let brute = |reject| {
            let mut brute = Brute::new(scene, reject, recorded);
            move || brute.tick()
        };
        let mut contenders = [
            Contender::new("hoff_no_reject", brute(HoffReject::Nothing)),
            Contender::new("hoff_sphere_reject", brute(HoffReject::BoundingSphere)),
            Contender::new("schedule", || ours.tick()),
        ];
        let label = format!("tick, scene {number}, {kind}, {rate}/s");
        let [no_reject, sphere_reject, schedule] =
            measure::means(&label, "particles alive", &mut contenders, rounds, calls);
        ratios(&format!("{label}/schedule"), schedule, no_reject, sphere_reject);
    }
}

/// Runs the group.
pub fn bench(criterion: &mut Criterion) {
    if !measure::wanted("tick") {
        return;
    }
    let setup = Setup::default();
    let recorded = Sim::recorder(setup).record(setup.rate);
    let mut sparse = contenders(&recorded);
    let mut group = criterion.benchmark_group("tick");
    for contender in &mut sparse {
        contender.bench(&mut group);
    }
    group.finish();
    if !measure::measuring() {
        return;
    }
    println!("compute threads: {}", ComputeTaskPool::get().thread_num());
    let [no_reject, sphere_reject, ours @ ..] =
        measure::means("tick", "particles alive", &mut sparse, 10, 30);
    for (name, ours) in OURS.into_iter().zip(ours) {
        ratios(&format!("tick/{name}"), ours, no_reject, sphere_reject);
    }
    drop(sparse);
    for scene in [Scene::One, Scene::Two] {
        for water in [false, true] {
            compare_rates(scene, water);
        }
    }
}
