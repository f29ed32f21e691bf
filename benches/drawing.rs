//! How many particles a frame can show: 0 to 500,000 drops of rain in flight, in a picture of 1280 by 720.
//!
//! All are in sight, even over the picture, 2 to 20 m away, in the light of one sun and an environment map. No tick runs:
//! a frame writes the rows of all particles, uploads them and draws them, as every frame of a game does. Three ways to look
//! at them tell what the time goes into:
//!
//! | | rows written, uploaded | vertices | what is in the picture |
//! |---|---|---|---|
//! | `unseen`: on a layer that the camera does not show | yes | - | - |
//! | `beside`: the camera stands 1 km to the side | yes | yes | - |
//! | `seen` | yes | yes | triangles set up, filled and blended |
//!
//! Each number of particles has an app of its own: buffers and meshes grow by powers of two and never shrink. Frames are
//! timed until the GPU is done, the ways and the numbers taking turns. What particles cost is the difference to the frame
//! without any.

use std::cell::RefCell;
use std::time::{Duration, Instant};

use bevy::asset::RenderAssetUsages;
use bevy::camera::RenderTarget;
use bevy::camera::visibility::RenderLayers;
use bevy::light::EnvironmentMapLight;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy_weathering::effect::{EffectTable, WeatherEffect};
use bevy_weathering::particle::{Lifespan, Particle, ParticleMesh, Particles, Sequence};
use criterion::Criterion;

use crate::headless;
use crate::measure::{self, Contender};
use crate::scene::Random;

const SIZE: UVec2 = UVec2::new(1280, 720);
const ROUNDS: u32 = 4;

/// m in front of the camera.
const NEAREST: f32 = 2.0;
const FARTHEST: f32 = 20.0;

/// m/s; what most drops of this rain fall with.
const VELOCITY: Vec3 = Vec3::new(0.0, -6.5, 0.0);

/// Shaders are loaded in the background; this long means that they never will be.
const PATIENCE: Duration = Duration::from_secs(60);

const COUNTS: [u32; 4] = [0, 10_000, 100_000, 500_000];
const SIGHTS: [Sight; 3] = [Sight::Unseen, Sight::Beside, Sight::Seen];
/// By number and way.
const NAMES: [[&str; 3]; 4] = [
    ["none, unseen", "none, beside", "none, seen"],
    ["10,000, unseen", "10,000, beside", "10,000, seen"],
    ["100,000, unseen", "100,000, beside", "100,000, seen"],
    ["500,000, unseen", "500,000, beside", "500,000, seen"],
];

/// How the camera looks at the particles.
#[derive(Clone, Copy)]
enum Sight {
    /// They are on another layer.
    Unseen,
    /// They are outside the picture.
    Beside,
    /// They are in it.
    Seen,
}

/// Particles that hang in the air, and a camera.
struct Rain {
    app: App,
    count: u32,
    camera: Entity,
    mesh: Entity,
    target: Handle<Image>,
}

/// Where a particle is that the camera sees from the origin.
fn place(random: &mut Random) -> Vec3 {
    let PerspectiveProjection { fov, .. } = PerspectiveProjection::default();
    let at = random.vector();
    let depth = NEAREST + (FARTHEST - NEAREST) * 0.5 * (at.z + 1.0);
    let half_height = depth * (0.5 * fov).tan();
    let half_width = half_height * SIZE.x as f32 / SIZE.y as f32;
    Vec3::new(at.x * half_width, at.y * half_height, -depth)
}

fn add_particles(world: &mut World, count: u32) {
    let effect = WeatherEffect::from_ron(include_bytes!("../assets/effects/rain.effect.ron")).unwrap();
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

impl Rain {
    fn new(count: u32) -> Self {
        let mut app = headless::app();
        let world = app.world_mut();
        let mut target = Image::new_uninit(
            Extent3d { width: SIZE.x, height: SIZE.y, depth_or_array_layers: 1 },
            TextureDimension::D2,
            TextureFormat::Rgba8UnormSrgb,
            RenderAssetUsages::RENDER_WORLD,
        );
        target.texture_descriptor.usage |= TextureUsages::RENDER_ATTACHMENT;
        let mut images = world.resource_mut::<Assets<Image>>();
        let target = images.add(target);
        let environment = EnvironmentMapLight {
            intensity: 400.0,
            ..EnvironmentMapLight::hemispherical_gradient(
                &mut images,
                Color::linear_rgb(0.5, 0.7, 1.0),
                Color::linear_rgb(0.8, 0.8, 0.8),
                Color::linear_rgb(0.25, 0.2, 0.15),
            )
        };
        world.spawn((
            DirectionalLight { illuminance: 5000.0, ..default() },
            Transform::default().looking_to(Vec3::new(-1.0, -1.0, -1.0), Vec3::Y),
        ));
        let camera = world
            .spawn((
                Camera3d::default(),
                Msaa::Off,
                RenderTarget::from(target.clone()),
                environment,
                Transform::default(),
            ))
            .id();
        add_particles(world, count);
        // The mesh comes with the first frame.
        headless::frame(&mut app);
        let world = app.world_mut();
        let mesh = world.query_filtered::<Entity, With<ParticleMesh>>().single(world).unwrap();
        let mut rain = Self { app, count, camera, mesh, target };
        rain.warm_up();
        rain
    }

    /// One frame. Returns how many particles are in flight.
    fn frame(&mut self, sight: Sight) -> usize {
        let (layer, aside) = match sight {
            Sight::Unseen => (1, 0.0),
            Sight::Beside => (0, 1000.0),
            Sight::Seen => (0, 0.0),
        };
        let world = self.app.world_mut();
        world.entity_mut(self.mesh).insert(RenderLayers::layer(layer));
        world.entity_mut(self.camera).insert(Transform::from_xyz(aside, 0.0, 0.0));
        headless::frame(&mut self.app);
        self.app.world().resource::<Particles>().len()
    }

    /// What there is to see.
    fn picture(&mut self, sight: Sight) -> Vec<u8> {
        // What is new in a frame may be drawn from the next one on.
        self.frame(sight);
        self.frame(sight);
        headless::read_image(&self.app, &self.target)
    }

    /// Pixels that particles change.
    fn covered(&mut self) -> usize {
        let (without, with) = (self.picture(Sight::Unseen), self.picture(Sight::Seen));
        without.chunks_exact(4).zip(with.chunks_exact(4)).filter(|(a, b)| a != b).count()
    }

    /// Frames until all that is drawn is there; then looks whether the three ways show what they should.
    fn warm_up(&mut self) {
        let begun = Instant::now();
        while self.picture(Sight::Unseen).iter().all(|&byte| byte == 0) {
            assert!(begun.elapsed() < PATIENCE, "the camera draws nothing");
        }
        while self.count > 0 && self.covered() == 0 {
            assert!(begun.elapsed() < PATIENCE, "no particle is drawn");
        }
        let pictures_agree = self.picture(Sight::Beside) == self.picture(Sight::Unseen);
        assert!(pictures_agree, "particles are seen that are not in the picture");
        let (count, covered) = (self.count, self.covered());
        println!("drawing: {count} particles change {covered} of {} pixels", SIZE.x * SIZE.y);
    }
}

/// Runs the group.
pub fn bench(_: &mut Criterion) {
    if !measure::wanted("drawing") || !measure::measuring() {
        return;
    }
    let rains = COUNTS.map(|count| RefCell::new(Rain::new(count)));
    println!("drawing: on {}", headless::adapter(&rains[0].borrow().app));
    let mut contenders: [Contender<'_>; COUNTS.len() * SIGHTS.len()] = std::array::from_fn(|number| {
        let (row, way) = (number / SIGHTS.len(), number % SIGHTS.len());
        let (rain, sight) = (&rains[row], SIGHTS[way]);
        Contender::new(NAMES[row][way], move || rain.borrow_mut().frame(sight))
    });
    let means = measure::means("drawing", "particles", &mut contenders, ROUNDS, 1);
    println!(
        "| particles | unseen ms | beside ms | seen ms | ns each: unseen | beside | seen | million/s, seen |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let (rows, _) = means.as_chunks::<3>();
    for (&count, row) in COUNTS.iter().zip(rows) {
        let [unseen_ms, beside_ms, seen_ms] = row.map(|seconds| seconds * 1e3);
        print!("| {count} | {unseen_ms:.1} | {beside_ms:.1} | {seen_ms:.1} |");
        if count == 0 {
            println!(" - | - | - | - |");
            continue;
        }
        let each: [f64; 3] = std::array::from_fn(|way| (row[way] - rows[0][way]) * 1e9 / f64::from(count));
        let millions = f64::from(count) / row[2] / 1e6;
        println!(" {:.0} | {:.0} | {:.0} | {millions:.2} |", each[0], each[1], each[2]);
    }
}
