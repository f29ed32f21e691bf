//! Scene 1 as a headless app: the library's plugins, no renderer, exactly one tick a frame.
//!
//! [`Sim::frame`] is a whole frame, [`Sim::tick`] only the schedules of the tick. [`Sim::recorded`] tells the
//! baseline who is in flight in the steady state and who is born, so that both start from the same particles
//! and get the same emission.

use std::time::{Duration, Instant};

use bevy::asset::AssetPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::collision::SurfaceCollider;
use bevy_weathering::effect::{EffectIndex, EffectTable, WeatherEffect};
use bevy_weathering::overlay::{CpuOverlayPlugin, GpuOverlayPlugin, SplatQueue, TexelArea, Weatherable};
use bevy_weathering::particle::{ParticleCounts, Particles};
use bevy_weathering::replay::task_pools;
use bevy_weathering::schedule::{WeatheringSystems, WeatheringTick};

use crate::hoff::HoffParticle;
use crate::scene::{self, HZ, LIFETIME};

/// Ticks after which nobody is in flight who was there at the start: as many die as are born.
const STEADY_TICKS: u32 = 3 * HZ;

/// Colliders are built in milliseconds; this long means that they never will be.
const PATIENCE: Duration = Duration::from_secs(60);

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
        app.add_plugins(MinimalPlugins.set(task_pools(None)))
            .add_plugins((TransformPlugin, AssetPlugin::default(), MeshPlugin))
            .add_plugins(WeatheringPlugins.build().disable::<GpuOverlayPlugin>());
        if cpu_painter {
            app.add_plugins(CpuOverlayPlugin);
        }
        app.finish();
        app.cleanup();

        let world = app.world_mut();
        let mut water = scene::water();
        if !drag {
            water.terminal_speed = Some(0.0);
        }
        let handle = world.resource_mut::<Assets<WeatherEffect>>().add(water.clone());
        let effect = world.resource_mut::<EffectTable>().insert(handle.clone(), water);
        let effect = effect.expect("the table has room");
        for (mesh, at, maps) in scene::surfaces() {
            let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
            let transform = Transform::from_translation(at);
            world.spawn((maps, Mesh3d(mesh), transform, GlobalTransform::from(transform)));
        }
        let (hose, transform) = scene::hose(handle, rate);
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
            WeatheringTick,
            // As they left the nozzle, before their first step.
            note_births.after(WeatheringSystems::Emit).before(WeatheringSystems::Integrate),
        );
        for _ in 0..STEADY_TICKS {
            sim.frame();
        }
        let particles = sim.app.world().resource::<Particles>();
        let living = particles.iter().map(|particle| HoffParticle {
            position: particle.position,
            velocity: particle.velocity,
            age: LIFETIME - f32::from(particle.lifespan.ticks_left) / HZ as f32,
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

    /// The schedule of one tick and nothing else. Returns how many particles are alive.
    pub fn tick(&mut self) -> usize {
        let world = self.app.world_mut();
        world.run_schedule(WeatheringTick);
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

fn note_births(mut births: ResMut<Births>, particles: Res<Particles>) {
    let born = particles.newborn().map(|particle| HoffParticle {
        position: particle.position,
        velocity: particle.velocity,
        age: 0.0,
    });
    births.0.push(born.collect());
}

/// Colliders are built in the background, in frames; no tick happens meanwhile.
fn wait_for_colliders(app: &mut App) {
    type Unfinished = (With<Weatherable>, Or<(Without<SurfaceCollider>, Without<TexelArea>)>);
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
