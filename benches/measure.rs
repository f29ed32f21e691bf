//! What all groups share: which of them are asked for, means with the contenders taking turns, and ratios.
//!
//! Criterion measures one function after the other, so a ratio of two of its numbers holds whatever the
//! machine did in between. [`means`] lets the contenders take turns, a few calls each; its plain means are
//! what ratios are made of. Both kinds of numbers come from the same run and stand beside each other in the
//! output.

use std::time::{Duration, Instant};

use criterion::BenchmarkGroup;
use criterion::measurement::WallTime;

/// Options of criterion that take a value: the argument behind them is no filter.
const OPTIONS_WITH_VALUE: [&str; 18] = [
    "-c",
    "--color",
    "-s",
    "--save-baseline",
    "-b",
    "--baseline",
    "--baseline-lenient",
    "--load-baseline",
    "--format",
    "--output-format",
    "--profile-time",
    "--sample-size",
    "--warm-up-time",
    "--measurement-time",
    "--nresamples",
    "--noise-threshold",
    "--confidence-level",
    "--significance-level",
];

/// Whether criterion's filter lets anything of this group through; setting a group up costs more than a
/// glance. Understands filters that begin with the group's name, or are a part of it.
pub fn wanted(group: &str) -> bool {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let filter = arguments.iter().enumerate().find(|&(i, argument)| {
        let is_value = i > 0 && OPTIONS_WITH_VALUE.contains(&arguments[i - 1].as_str());
        !argument.starts_with('-') && !is_value
    });
    filter.is_none_or(|(_, filter)| filter.starts_with(group) || group.contains(filter.as_str()))
}

/// Whether numbers are asked for: not under `cargo test --benches` and not for `--list`.
pub fn measuring() -> bool {
    let given = |option: &str| std::env::args().any(|argument| argument == option);
    given("--bench") && !given("--test") && !given("--list")
}

/// One of several ways to do the same work.
pub struct Contender<'a> {
    name: &'static str,
    run: Box<dyn FnMut() -> usize + 'a>,
}

impl<'a> Contender<'a> {
    /// `run` does the work once and returns a count that depends on it: particles alive, segments that hit.
    pub fn new(name: &'static str, run: impl FnMut() -> usize + 'a) -> Self {
        Self { name, run: Box::new(run) }
    }

    /// Lets criterion measure it.
    pub fn bench(&mut self, group: &mut BenchmarkGroup<'_, WallTime>) {
        group.bench_function(self.name, |bencher| bencher.iter(&mut self.run));
    }
}

/// Mean seconds of a call of each contender. They take turns: `rounds` times `calls` calls each. Prints the
/// means and what the last calls `counted`, which has to be alike for a fair comparison.
pub fn means<const N: usize>(
    group: &str,
    counted: &str,
    contenders: &mut [Contender<'_>; N],
    rounds: u32,
    calls: u32,
) -> [f64; N] {
    let mut spent = [Duration::ZERO; N];
    let mut counts = [0; N];
    for _ in 0..rounds {
        for (i, contender) in contenders.iter_mut().enumerate() {
            let begun = Instant::now();
            for _ in 0..calls {
                counts[i] = (contender.run)();
            }
            spent[i] += begun.elapsed();
        }
    }
    let means = spent.map(|spent| spent.as_secs_f64() / f64::from(rounds * calls));
    for ((contender, mean), count) in contenders.iter().zip(means).zip(counts) {
        let (name, micros, calls) = (contender.name, mean * 1e6, rounds * calls);
        println!("mean {group}/{name}: {micros:.2} us over {calls} calls; last: {count} {counted}");
    }
    means
}

/// Prints how many times longer the baseline takes; both in the same unit.
pub fn ratio(name: &str, ours: f64, baseline: f64) {
    println!("ratio {name}: baseline/ours = {:.2}", baseline / ours);
}
