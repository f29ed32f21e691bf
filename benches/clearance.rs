//! What the clearance grid saves: a scene that keeps still knows how far off its surfaces are at least, and a segment that comes to
//! its end in leaps as long as that is not cast.
//!
//! There is no switch for it. A [`CollisionScene`] that has just been put together has none until frames have gone by, and here
//! none do; so the same surfaces are put together once more. Timed are ticks at 100,000 dry particles a second, and the casts
//! alone, of the segments that the particles in flight would move next. Hits have to be the same.

use bevy::prelude::*;
use bevy_weathering::collision::{CollisionScene, SurfaceCollider};
use bevy_weathering::particle::Particles;
use criterion::Criterion;

use crate::measure::{self, Contender};
use crate::scene::{HZ, Scene};
use crate::sim::{Setup, Sim};

/// Particles a second.
const RATE: f32 = 100_000.0;

/// The same surfaces, without clearance.
fn without_clearance(world: &mut World) -> CollisionScene {
    let mut surfaces = world.query::<(Entity, &GlobalTransform, &SurfaceCollider)>();
    let surfaces = surfaces.iter(world).map(|(surface, at, bvh)| (surface, at.affine(), bvh.0.clone()));
    CollisionScene::new(surfaces)
}

/// Where each particle would go in the next tick.
fn segments(world: &World) -> Vec<(Vec3, Vec3)> {
    let particles = world.resource::<Particles>();
    let moves = particles.positions().iter().zip(particles.velocities());
    moves.map(|(&start, &velocity)| (start, start + velocity / HZ as f32)).collect()
}

/// Casts them all on one core; how many hit.
fn hits(scene: &CollisionScene, segments: &[(Vec3, Vec3)]) -> usize {
    segments.iter().filter(|(start, end)| scene.cast(*start, *end).is_some()).count()
}

fn compare(scene: Scene, number: u32) {
    let setup = Setup { scene, rate: RATE, water: false, ..default() };
    let (mut with, mut without) = (Sim::steady(setup), Sim::steady(setup));

    let segments = segments(with.world());
    let bare = without_clearance(with.world_mut());
    let clear = with.world().resource::<CollisionScene>();
    assert_eq!(hits(clear, &segments), hits(&bare, &segments), "clearance must not change what is hit");
    let mut casts = [
        Contender::new("with", || hits(clear, &segments)),
        Contender::new("without", || hits(&bare, &segments)),
    ];
    let label = format!("clearance, scene {number}, {} casts", segments.len());
    let [ours, bare] = measure::means(&label, "hits", &mut casts, 10, 5);
    let nanos = |seconds: f64| seconds * 1e9 / segments.len() as f64;
    println!("{label}: {:.1} ns each with it, {:.1} without", nanos(ours), nanos(bare));
    measure::ratio(&format!("{label}, with against without"), ours, bare);
    drop(casts);

    let bare = without_clearance(without.world_mut());
    without.world_mut().insert_resource(bare);
    let mut ticks = [Contender::new("with", || with.tick()), Contender::new("without", || without.tick())];
    let label = format!("clearance, scene {number}, ticks at {RATE}/s");
    let [ours, bare] = measure::means(&label, "particles alive", &mut ticks, 10, 10);
    measure::ratio(&format!("{label}, with against without"), ours, bare);
}

/// Runs the group. Not measured by criterion, only filtered like its groups.
pub fn bench(_: &mut Criterion) {
    if !measure::wanted("clearance") || !measure::measuring() {
        return;
    }
    compare(Scene::One, 1);
    compare(Scene::Two, 2);
}
