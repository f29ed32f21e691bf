//! What particles in sight cost: 10,000 and 200,000 drops of rain in flight, as streaks, in a picture of 640 by 360.
//!
//! All are in sight, even over the picture, 2 to 20 m away, in the light of one sun and an environment map. No tick runs:
//! a frame writes the rows of all particles, uploads them and draws them, as every frame of a game does.
//!
//! | contender | rows written, uploaded | drawn |
//! |---|---|---|
//! | `none`: an app without any | - | - |
//! | `unseen`: on a layer that the camera does not show | yes | - |
//! | `streaks` | yes | yes |
//! | `instances`: in their place, as many entities with one rectangle of a streak's size and one unlit, blended material, which Bevy draws as instances | - | yes |
//!
//! The instances do not move, so that nothing is written for them; they are not lit, not turned to the camera, not faded into
//! what is near, and may be thinner than a pixel.
//!
//! Each number has apps of its own: buffers and meshes grow by powers of two and never shrink. Frames are timed until the GPU
//! is done, the contenders taking turns.

use std::cell::RefCell;
use std::time::{Duration, Instant};

use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy_weathering::effect::{EffectTable, WeatherEffect};
use bevy_weathering::offscreen::Stage;
use bevy_weathering::particle::{Lifespan, Particle, ParticleMesh, Particles, Sequence};
use criterion::Criterion;

use crate::headless;
use crate::measure::{self, Contender};
use crate::scene::Random;

const SIZE: UVec2 = UVec2::new(640, 360);
const ROUNDS: u32 = 3;
const COUNTS: [u32; 2] = [10_000, 200_000];

/// m in front of the camera.
const NEAREST: f32 = 2.0;
const FARTHEST: f32 = 20.0;

/// m/s; what most drops of this rain fall with.
const VELOCITY: Vec3 = Vec3::new(0.0, -6.5, 0.0);

/// Shaders are loaded in the background; this long means that they never will be.
const PATIENCE: Duration = Duration::from_secs(60);

/// What the camera shows, and what it does not.
const SEEN: usize = 0;
const UNSEEN: usize = 1;

/// A place in the picture, seen from the origin.
fn place(random: &mut Random) -> Vec3 {
    let PerspectiveProjection { fov, .. } = PerspectiveProjection::default();
    let at = random.vector();
    let depth = NEAREST + (FARTHEST - NEAREST) * 0.5 * (at.z + 1.0);
    let half_height = depth * (0.5 * fov).tan();
    let half_width = half_height * SIZE.x as f32 / SIZE.y as f32;
    Vec3::new(at.x * half_width, at.y * half_height, -depth)
}

fn rain() -> WeatherEffect {
    WeatherEffect::from_ron(include_bytes!("../assets/effects/rain.effect.ron")).unwrap()
}

fn add_particles(world: &mut World, count: u32) {
    let effect = rain();
    let volume_nl = (effect.volume_mm3 * 1000.0).round() as u32;
    let handle = world.resource_mut::<Assets<WeatherEffect>>().add(effect.clone());
    let effect = world.resource_mut::<EffectTable>().insert(handle, effect).expect("the table has room");
    let lifespan = Lifespan { ticks_left: Lifespan::MAX_TICKS, born_at: 0 };
    let mut random = Random::new();
    let born: Vec<Particle> = (0..count)
        .map(|number| {
            let (position, sequence) = (place(&mut random), Sequence(number));
            Particle { position, velocity: VELOCITY, lifespan, volume_nl, sequence, effect, class: 0 }
        })
        .collect();
    world.resource_mut::<Particles>().spawn(born.into_iter());
}

fn add_instances(world: &mut World, count: u32) {
    let look = rain().look;
    let [red, green, blue, alpha] = look.color;
    let material = StandardMaterial {
        base_color: Color::linear_rgba(red, green, blue, alpha),
        unlit: true,
        alpha_mode: AlphaMode::Blend,
        ..default()
    };
    let material = MeshMaterial3d(world.resource_mut::<Assets<StandardMaterial>>().add(material));
    let streak = Rectangle::new(look.width, look.width + VELOCITY.length() * look.exposure);
    let mesh = Mesh3d(world.resource_mut::<Assets<Mesh>>().add(streak));
    let mut random = Random::new();
    let places: Vec<Transform> =
        (0..count).map(|_| Transform::from_translation(place(&mut random))).collect();
    world.spawn_batch(places.into_iter().map(move |place| (mesh.clone(), material.clone(), place)));
}

/// A camera, and what hangs in the air before it.
struct Air {
    app: App,
    target: Handle<Image>,
    /// What all particles are drawn as.
    mesh: Entity,
    instances: usize,
}

impl Air {
    fn new(particles: u32, instances: u32) -> Self {
        let mut app = headless::app();
        let world = app.world_mut();
        let sun = DirectionalLight { illuminance: 5000.0, ..default() };
        let stage = Stage::new(world, SIZE, sun, Vec3::NEG_ONE);
        world.spawn(stage.camera(Transform::default()));
        add_particles(world, particles);
        add_instances(world, instances);
        // The mesh comes with the first frame.
        headless::frame(&mut app);
        let world = app.world_mut();
        let mesh = world.query_filtered::<Entity, With<ParticleMesh>>().single(world).unwrap();
        Self { app, target: stage.target, mesh, instances: instances as usize }
    }

    /// One frame, with the particles on this layer. Returns how many of either kind there are.
    fn frame(&mut self, layer: usize) -> usize {
        self.app.world_mut().entity_mut(self.mesh).insert(RenderLayers::layer(layer));
        headless::frame(&mut self.app);
        self.app.world().resource::<Particles>().len() + self.instances
    }

    /// What there is to see.
    fn picture(&mut self, layer: usize) -> Vec<u8> {
        // What is new in a frame may be drawn from the next one on.
        self.frame(layer);
        self.frame(layer);
        headless::read_image(&self.app, &self.target)
    }

    /// Frames until the picture is another than this one. Returns it.
    fn picture_unlike(&mut self, other: &[u8]) -> Vec<u8> {
        let begun = Instant::now();
        loop {
            let picture = self.picture(SEEN);
            if picture != other {
                return picture;
            }
            assert!(begun.elapsed() < PATIENCE, "nothing is drawn");
        }
    }
}

fn contender<'a>(name: &'static str, air: &'a RefCell<Air>, layer: usize) -> Contender<'a> {
    Contender::new(name, move || air.borrow_mut().frame(layer))
}

/// Runs the group.
pub fn bench(_: &mut Criterion) {
    if !measure::wanted("drawing") || !measure::measuring() {
        return;
    }
    let mut none = Air::new(0, 0);
    println!("drawing: on {}", headless::adapter(&none.app));
    let nothing = vec![0; 4 * (SIZE.x * SIZE.y) as usize];
    let sky = none.picture_unlike(&nothing);
    let [few, many] = COUNTS.map(|count| {
        let ours = Air::new(count, 0);
        let plain = Air::new(0, count);
        [("streaks", ours), ("instances", plain)].map(|(what, mut air)| {
            let picture = air.picture_unlike(&sky);
            let pixels = picture.chunks_exact(4).zip(sky.chunks_exact(4));
            let changed = pixels.filter(|(with, without)| with != without).count();
            println!("drawing: {count} {what} change {changed} of {} pixels", SIZE.x * SIZE.y);
            RefCell::new(air)
        })
    });
    let none = RefCell::new(none);
    let mut contenders = [
        contender("none", &none, SEEN),
        contender("10,000, unseen", &few[0], UNSEEN),
        contender("10,000, streaks", &few[0], SEEN),
        contender("10,000, instances", &few[1], SEEN),
        contender("200,000, unseen", &many[0], UNSEEN),
        contender("200,000, streaks", &many[0], SEEN),
        contender("200,000, instances", &many[1], SEEN),
    ];
    let [none, rows @ ..] = measure::means("drawing", "in the air", &mut contenders, ROUNDS, 1);
    println!("| in sight | none ms | unseen ms | streaks ms | instances ms | ns a streak | ns an instance |");
    println!("|---|---|---|---|---|---|---|");
    for (count, row) in COUNTS.iter().zip(rows.as_chunks::<3>().0) {
        let [unseen_ms, streaks_ms, instances_ms] = row.map(|seconds| seconds * 1e3);
        let [_, streak, instance] = row.map(|seconds| (seconds - none) * 1e9 / f64::from(*count));
        println!(
            "| {count} | {:.1} | {unseen_ms:.1} | {streaks_ms:.1} | {instances_ms:.1} | {streak:.0} | {instance:.0} |",
            none * 1e3
        );
        let group = format!("drawing, {count}: streaks against instances");
        measure::ratio(&group, row[1], row[2]);
        measure::ratio(&format!("{group}, without the empty frame"), row[1] - none, row[2] - none);
    }
}
