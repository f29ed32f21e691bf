//! Memory of a particle in flight: counted from its columns, and measured.
//!
//! Measured: how much the resident memory of this process grows when a million are born. Pages that were reserved and
//! never touched do not count. Only where there is a `/proc`. Criterion has no part in it.

use bevy::prelude::*;
use bevy_weathering::effect::EffectIndex;
use bevy_weathering::particle::{Lifespan, Particle, Particles, Sequence};
use criterion::Criterion;

use crate::measure;

const PARTICLES: u32 = 1_000_000;

fn particle(number: u32) -> Particle {
    Particle {
        position: Vec3::splat(number as f32),
        velocity: Vec3::NEG_Y,
        lifespan: Lifespan { ticks_left: 180, born_at: 0 },
        volume_nl: number,
        sequence: Sequence(number),
        effect: EffectIndex(0),
        class: 0,
    }
}

/// Resident memory of this process, bytes.
pub fn resident() -> Option<u64> {
    kibibytes("/proc/self/status", "VmRSS:")
}

/// Memory that this machine can still give, bytes.
pub fn available() -> Option<u64> {
    kibibytes("/proc/meminfo", "MemAvailable:")
}

/// A line of such a file, in bytes.
fn kibibytes(file: &str, name: &str) -> Option<u64> {
    let lines = std::fs::read_to_string(file).ok()?;
    let line = lines.lines().find_map(|line| line.strip_prefix(name))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

/// Growth per particle, bytes.
fn measured() -> Option<f64> {
    let mut particles = Particles::default();
    let before = resident()?;
    particles.spawn((0..PARTICLES).map(particle));
    let after = resident()?;
    // They have to live until here.
    assert_eq!(particles.len(), PARTICLES as usize);
    Some(after.saturating_sub(before) as f64 / f64::from(PARTICLES))
}

/// Runs the group. Not measured by criterion, only filtered like its groups.
pub fn bench(_: &mut Criterion) {
    if !measure::wanted("bytes") || !measure::measuring() {
        return;
    }
    println!("\nbytes of a particle in flight");
    println!("{:>26} {:>6}", "columns", Particles::BYTES);
    match measured() {
        Some(bytes) => println!("{:>26} {bytes:>6.1}", "measured"),
        None => println!("{:>26} {:>6}", "measured", "n/a"),
    }
    println!("{:>26} {:>6}", "while being emitted, more", size_of::<Particle>());
}
