//! Scene 1, for the library and for the baseline: a hose on a ball and a bunny on paving.
//!
//! | surface | triangles | where |
//! |---|---|---|
//! | ground, 6 m by 6 m | 1,584 | the origin |
//! | sphere, 0.32 m | 936 | left of the bunny |
//! | bunny | 1,000 | in the middle |
//!
//! [`Sim`] is a headless app with the library's plugins, no renderer and exactly one tick a frame. The baseline
//! gets the same triangles in world space, the same living particles and the same births ([`Sim::recorded`]).

use std::time::{Duration, Instant};

use bevy::asset::AssetPlugin;
use bevy::math::UVec2;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::collision::{MeshTriangles, SurfaceCollider};
use bevy_weathering::effect::{EffectIndex, EffectTable, WeatherEffect};
use bevy_weathering::emitter::{Emitter, EmitterShape};
use bevy_weathering::overlay::{
    CpuOverlayPlugin, GpuOverlayPlugin, SplatQueue, TexelAreas, Weatherable, Wrap,
};
use bevy_weathering::particle::{Lifespan, ParticleCounts, Position, Sequence, Velocity};
use bevy_weathering::scenes::meshes;
use bevy_weathering::schedule::WeatheringSystems;

use crate::glb;
use crate::hoff::{HoffParticle, HoffReject, HoffSystem};

/// Ticks per second; the library's default.
pub const HZ: u32 = 60;

/// m/s², the library's default.
pub const GRAVITY: Vec3 = Vec3::new(0.0, -9.81, 0.0);

/// Seconds until a particle that hit nothing is retired.
pub const LIFETIME: f32 = 3.0;

/// Ticks after which as many particles die as are born, since none lives longer.
pub const STEADY_TICKS: u32 = 3 * HZ;

const HOSE_AT: Vec3 = Vec3::new(2.2, 1.0, 2.4);
const HOSE_AIM: Vec3 = Vec3::new(-0.25, 0.9, 0.1);

/// Colliders are built in milliseconds; this long means that they never will be.
const PATIENCE: Duration = Duration::from_secs(60);

/// A mesh, where it stands, and the maps it gets.
pub fn surfaces() -> [(Mesh, Vec3, Weatherable); 3] {
    let maps = |map_size, wrap_u| Weatherable { map_size, wrap_u, wrap_v: Wrap::Clamp };
    let ground = meshes::ground(Vec2::splat(6.0), UVec2::new(24, 33)).expect("sizes are positive");
    let sphere = meshes::uv_sphere(0.32, 26, 19).expect("sizes are positive");
    [
        (ground, Vec3::ZERO, maps(1024, Wrap::Clamp)),
        (sphere, Vec3::new(-0.95, 0.32, 0.15), maps(512, Wrap::Repeat)),
        (glb::mesh(glb::BUNNY_1000), Vec3::new(0.2, 0.0, 0.0), maps(1024, Wrap::Clamp)),
    ]
}

/// The scene for the baseline.
pub fn hoff(reject: HoffReject) -> HoffSystem {
    let (objects, uvs): (Vec<_>, Vec<_>) = surfaces()
        .into_iter()
        .map(|(mesh, at, _)| {
            let mut triangles = MeshTriangles::from_mesh(&mesh).expect("the meshes have triangles and uvs");
            triangles.positions.iter_mut().flatten().for_each(|corner| *corner += at);
            (triangles.positions, triangles.uvs)
        })
        .unzip();
    let mut system = HoffSystem::new(&objects, &uvs, reject);
    system.lifetime = LIFETIME;
    system
}

/// The water of the hose.
pub fn water() -> WeatherEffect {
    WeatherEffect::from_ron(include_bytes!("../assets/effects/hose.effect.ron")).expect("the effect is valid")
}

/// What differs between simulations of scene 1.
#[derive(Clone, Copy)]
pub struct Setup {
    /// Particles per second.
    pub rate: f32,
    /// Air slows the water down. The baseline has no air; the formula costs the same either way.
    pub drag: bool,
    /// Splats are painted on the CPU. Otherwise [`Sim`] throws them away, as a renderer would take them.
    pub cpu_painter: bool,
}

/// Scene 1 in a headless app.
pub struct Sim {
    app: App,
    queues: QueryState<&'static mut SplatQueue>,
    effect: EffectIndex,
}

/// What the baseline needs to carry on where a [`Sim`] is.
pub struct Recorded {
    /// Particles in flight.
    pub living: Vec<HoffParticle>,
    /// Births, tick by tick.
    pub births: Vec<Vec<HoffParticle>>,
}

#[derive(Resource, Default)]
struct Births(Vec<Vec<HoffParticle>>);

impl Sim {
    /// The scene before its first tick, with all colliders built.
    pub fn new(Setup { rate, drag, cpu_painter }: Setup) -> Self {
        let mut app = App::new();
        app.add_plugins(MinimalPlugins)
            .add_plugins((TransformPlugin, AssetPlugin::default(), MeshPlugin))
            .add_plugins(WeatheringPlugins.build().disable::<GpuOverlayPlugin>());
        if cpu_painter {
            app.add_plugins(CpuOverlayPlugin);
        }
        app.finish();
        app.cleanup();

        let world = app.world_mut();
        let mut water = water();
        if !drag {
            water.terminal_speed = 0.0;
        }
        let handle = world.resource_mut::<Assets<WeatherEffect>>().add(water.clone());
        let effect = world.resource_mut::<EffectTable>().insert(handle.clone(), water);
        let effect = effect.expect("the table has room");
        for (mesh, at, maps) in surfaces() {
            let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
            let transform = Transform::from_translation(at);
            world.spawn((maps, Mesh3d(mesh), transform, GlobalTransform::from(transform)));
        }
        let transform = Transform::from_translation(HOSE_AT).looking_at(HOSE_AIM, Vec3::Y);
        let hose = Emitter {
            effect: handle,
            rate,
            shape: EmitterShape::Cone { radius: 0.008 },
            speed: 8.8,
            spread: 4.0_f32.to_radians(),
            lifetime: LIFETIME,
            enabled: rate > 0.0,
            ..default()
        };
        world.spawn((hose, transform, GlobalTransform::from(transform)));
        let queues = world.query();
        wait_for_colliders(&mut app);
        Self { app, queues, effect }
    }

    /// The scene in its steady state.
    pub fn steady(setup: Setup) -> Self {
        let mut sim = Self::new(setup);
        for _ in 0..STEADY_TICKS {
            sim.frame();
        }
        sim
    }

    /// Runs a scene into its steady state and tells who was born on the way and who is in flight at the end.
    pub fn recorded(setup: Setup) -> Recorded {
        let mut sim = Self::new(setup);
        sim.app.init_resource::<Births>().add_systems(
            FixedUpdate,
            // As they left the nozzle, before their first step.
            note_births.after(WeatheringSystems::Emit).before(WeatheringSystems::Integrate),
        );
        for _ in 0..STEADY_TICKS {
            sim.frame();
        }
        let mut particles = sim.app.world_mut().query::<(&Position, &Velocity, &Lifespan)>();
        let living = particles.iter(sim.app.world()).map(|(position, velocity, lifespan)| HoffParticle {
            position: position.0,
            velocity: velocity.0,
            age: LIFETIME - f32::from(lifespan.ticks_left) / HZ as f32,
        });
        let living = living.collect();
        let births = std::mem::take(&mut sim.app.world_mut().resource_mut::<Births>().0);
        Recorded { living, births }
    }

    /// One frame of the app, which holds one tick. Returns how many particles are alive.
    pub fn frame(&mut self) -> usize {
        self.app.update();
        self.empty_queues();
        self.alive()
    }

    /// The schedules of one tick and nothing else. Returns how many particles are alive.
    pub fn tick(&mut self) -> usize {
        let world = self.app.world_mut();
        world.run_schedule(FixedFirst);
        world.run_schedule(FixedUpdate);
        // What `App::update` does at its end; without it the list of removed components would grow.
        world.clear_trackers();
        self.empty_queues();
        self.alive()
    }

    /// What particles of the hose point to.
    pub fn effect(&self) -> EffectIndex {
        self.effect
    }

    /// For benches that put particles where they want them.
    pub fn world_mut(&mut self) -> &mut World {
        self.app.world_mut()
    }

    fn alive(&self) -> usize {
        self.app.world().resource::<ParticleCounts>().alive as usize
    }

    fn empty_queues(&mut self) {
        for mut queue in self.queues.iter_mut(self.app.world_mut()) {
            queue.clear();
        }
    }
}

fn note_births(mut births: ResMut<Births>, born: Query<(&Position, &Velocity), Added<Sequence>>) {
    let born = born.iter().map(|(position, velocity)| HoffParticle {
        position: position.0,
        velocity: velocity.0,
        age: 0.0,
    });
    births.0.push(born.collect());
}

/// Colliders are built in the background, in frames; no tick happens meanwhile.
fn wait_for_colliders(app: &mut App) {
    type Unfinished = (With<Weatherable>, Or<(Without<SurfaceCollider>, Without<TexelAreas>)>);
    let mut unfinished = app.world_mut().query_filtered::<Entity, Unfinished>();
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    let begun = Instant::now();
    while unfinished.iter(app.world()).next().is_some() {
        assert!(begun.elapsed() < PATIENCE, "a surface got no collider");
        app.update();
        std::thread::sleep(Duration::from_millis(1));
    }
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
}

/// Even numbers without a crate: the generator of Numerical Recipes, its upper bits.
pub struct Random(u32);

impl Random {
    /// The same numbers every time.
    pub fn new() -> Self {
        Self(1)
    }

    /// In [-1, 1).
    pub fn signed(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    /// In the cube [-1, 1)³.
    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
}
