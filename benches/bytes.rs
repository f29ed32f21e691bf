//! Memory of a particle in flight: counted from the sizes of what Bevy keeps for it, and measured.
//!
//! Counted: the components; two change ticks beside each of them; its `Entity` in the table; its row in the
//! archetype (`ArchetypeEntity`: entity and table row, padded); its entry in the world's list of entities.
//! That last type is private, so its size is the sum of its public parts: generation, optional location, tick
//! of its spawn.
//!
//! Measured: how much the resident memory of this process grows when a million are spawned in one batch.
//! Pages that were reserved and never touched do not count. Only where there is a `/proc`. Criterion has no
//! part in it.

use bevy::ecs::archetype::ArchetypeEntity;
use bevy::ecs::change_detection::{MaybeLocation, Tick};
use bevy::ecs::entity::{EntityGeneration, EntityLocation};
use bevy::prelude::*;
use bevy_weathering::effect::EffectIndex;
use bevy_weathering::particle::{
    BYTES_PER_PARTICLE, Lifespan, ParticleBundle, Position, Sequence, Velocity, Volume,
};
use criterion::Criterion;

use crate::measure;

const PARTICLES: u32 = 1_000_000;

/// Of a [`ParticleBundle`].
const COMPONENTS: usize = 6;

fn particle(number: u32) -> ParticleBundle {
    (
        Position(Vec3::splat(number as f32)),
        Velocity(Vec3::NEG_Y),
        Lifespan { ticks_left: 180, born_at: 0 },
        Volume(number),
        Sequence(number),
        EffectIndex(0),
    )
}

/// Resident memory of this process, bytes.
fn resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

/// Growth per particle, bytes.
fn measured() -> Option<f64> {
    let mut world = World::new();
    // Tables and archetypes exist before the first look.
    let first = world.spawn(particle(0)).id();
    let before = resident()?;
    world.spawn_batch((0..PARTICLES).map(particle));
    let after = resident()?;
    // The world has to live until here.
    assert!(world.get_entity(first).is_ok());
    Some(after.saturating_sub(before) as f64 / f64::from(PARTICLES))
}

/// Runs the group. Not measured by criterion, only filtered like its groups.
pub fn bench(_: &mut Criterion) {
    if !measure::wanted("bytes") || !measure::measuring() {
        return;
    }
    let stamp = size_of::<MaybeLocation>() + size_of::<Tick>();
    let rows = [
        ("components", BYTES_PER_PARTICLE),
        ("change ticks", COMPONENTS * (size_of::<MaybeLocation>() + 2 * size_of::<Tick>())),
        ("entity in the table", size_of::<Entity>()),
        ("row in the archetype", size_of::<ArchetypeEntity>()),
        (
            "entry in the entity list",
            size_of::<EntityGeneration>() + size_of::<Option<EntityLocation>>() + stamp,
        ),
    ];
    println!("\nbytes of a particle in flight");
    for (name, bytes) in rows {
        println!("{name:>26} {bytes:>6}");
    }
    let total: usize = rows.iter().map(|(_, bytes)| bytes).sum();
    println!("{:>26} {total:>6}", "counted");
    match measured() {
        Some(bytes) => println!("{:>26} {bytes:>6.1}", "measured"),
        None => println!("{:>26} {:>6}", "measured", "n/a"),
    }
    println!("{:>26} {:>6}", "while being emitted, more", size_of::<ParticleBundle>());
}
