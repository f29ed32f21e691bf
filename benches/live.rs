//! The highest emission at which a 60 Hz tick of scene 1 stays inside its 16.67 ms.
//!
//! Whole frames of one tick each, with drag, without a painter. Each rate runs for 2 s of weather until as
//! many particles die as are born, then for up to 300 timed ticks. A rate holds if the 95th percentile is
//! within the budget, so once 16 ticks were over it, it cannot hold any more and is given up after a minimum
//! of ticks. Not criterion's: a mean says nothing about dropped frames.

use std::time::{Duration, Instant};

use bevy::tasks::ComputeTaskPool;
use criterion::Criterion;

use crate::measure;
use crate::scene::HZ;
use crate::sim::{Setup, Sim};

/// Particles per second.
const RATES: [u32; 5] = [100_000, 200_000, 400_000, 700_000, 1_000_000];

const WARM_UP_TICKS: u32 = 2 * HZ;
const TICKS: usize = 300;

/// Ticks of a rate that does not hold, at least; enough for a mean.
const LEAST_TICKS: usize = 60;

/// Ticks that may be over the budget: the part beyond the 95th percentile.
const MAY_BE_OVER: usize = TICKS / 20;

const BUDGET: Duration = Duration::from_nanos(1_000_000_000 / HZ as u64);

/// Runs the group. Not measured by criterion, only filtered like its groups.
pub fn bench(_: &mut Criterion) {
    if !measure::wanted("live") || !measure::measuring() {
        return;
    }
    println!("\nlive: one-tick frames of scene 1, budget {:.2} ms", BUDGET.as_secs_f64() * 1e3);
    let mut highest = 0;
    for (number, rate) in RATES.into_iter().enumerate() {
        let mut sim = Sim::new(Setup { rate: rate as f32, drag: true, ..Setup::default() });
        if number == 0 {
            println!("compute threads: {}", ComputeTaskPool::get().thread_num());
            println!(
                "{:>12} {:>10} {:>9} {:>9} {:>6}  held",
                "particles/s", "alive", "mean ms", "p95 ms", "ticks"
            );
        }
        for _ in 0..WARM_UP_TICKS {
            sim.frame();
        }
        let (alive, mut spent) = measure_ticks(&mut sim);
        spent.sort_unstable();
        let mean = spent.iter().sum::<Duration>() / spent.len() as u32;
        // The smallest time that 95 % of the ticks stay within.
        let p95 = spent[(spent.len() * 95).div_ceil(100) - 1];
        let held = spent.len() == TICKS && p95 <= BUDGET;
        if held {
            highest = highest.max(rate);
        }
        let millis = |time: Duration| time.as_secs_f64() * 1e3;
        println!(
            "{rate:>12} {alive:>10} {:>9.2} {:>9.2} {:>6}  {}",
            millis(mean),
            millis(p95),
            spent.len(),
            if held { "yes" } else { "no" }
        );
    }
    println!("highest emission that held: {highest} particles/s");
}

/// Particles alive at the end, and how long each frame took.
fn measure_ticks(sim: &mut Sim) -> (usize, Vec<Duration>) {
    let mut spent = Vec::with_capacity(TICKS);
    let (mut alive, mut over) = (0, 0);
    while spent.len() < TICKS && (over <= MAY_BE_OVER || spent.len() < LEAST_TICKS) {
        let begun = Instant::now();
        alive = sim.frame();
        let time = begun.elapsed();
        over += usize::from(time > BUDGET);
        spent.push(time);
    }
    (alive, spent)
}
