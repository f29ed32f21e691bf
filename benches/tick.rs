//! A tick of scene 1 in the steady state, against the brute force of 2007.
//!
//! Both start from the same living particles and get the same births tick by tick. Drag is off, since the
//! baseline has none; the formula costs the library the same. The library is timed as the schedules of a tick
//! alone and as a whole frame of the app, each with its splats thrown away (what remains to a CPU whose GPU
//! paints) and painted on the CPU. The baseline only collides: it makes no splats and paints nothing.
//!
//! At 1,000 particles a second a few hundred are in flight, and the library's tick is for a large part the
//! fixed price of running systems. At 100,000 that price is spread; there both are timed by turns alone, as a
//! brute-force tick takes too long for criterion's samples.

use bevy::prelude::*;
use bevy::tasks::ComputeTaskPool;
use criterion::Criterion;

use crate::hoff::{HoffParticle, HoffReject, HoffSystem};
use crate::measure::{self, Contender};
use crate::scene::{self, GRAVITY, HZ};
use crate::sim::{Recorded, Setup, Sim};

/// The baseline in scene 1, with births that repeat.
struct Brute<'a> {
    system: HoffSystem,
    births: &'a [Vec<HoffParticle>],
    next: usize,
}

impl<'a> Brute<'a> {
    fn new(reject: HoffReject, Recorded { living, births }: &'a Recorded) -> Self {
        let mut system = scene::hoff(reject);
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

/// The baselines come first, then what [`OURS`] names.
fn contenders(rate: f32, recorded: &Recorded) -> [Contender<'_>; 6] {
    let brute = |reject| {
        let mut brute = Brute::new(reject, recorded);
        move || brute.tick()
    };
    let steady = |cpu_painter| Sim::steady(Setup { rate, drag: false, cpu_painter });
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

/// Times by turns, prints the ratios.
fn compare(group: &str, contenders: &mut [Contender<'_>; 6], rounds: u32, calls: u32) {
    let [no_reject, sphere_reject, ours @ ..] =
        measure::means(group, "particles alive", contenders, rounds, calls);
    for (name, ours) in OURS.into_iter().zip(ours) {
        measure::ratio(&format!("{group}/{name} against hoff_no_reject"), ours, no_reject);
        measure::ratio(&format!("{group}/{name} against hoff_sphere_reject"), ours, sphere_reject);
    }
}

/// Runs the group.
pub fn bench(criterion: &mut Criterion) {
    if !measure::wanted("tick") {
        return;
    }
    let recorded = |rate| Sim::recorded(Setup { rate, drag: false, cpu_painter: false });
    let sparse = recorded(1_000.0);
    let mut sparse = contenders(1_000.0, &sparse);
    let mut group = criterion.benchmark_group("tick");
    for contender in &mut sparse {
        contender.bench(&mut group);
    }
    group.finish();
    if measure::measuring() {
        println!("compute threads: {}", ComputeTaskPool::get().thread_num());
        compare("tick", &mut sparse, 10, 30);
        drop(sparse);
        let dense = recorded(100_000.0);
        compare("tick at 100,000/s", &mut contenders(100_000.0, &dense), 5, 2);
    }
}
