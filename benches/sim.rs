//! A scene as a headless app: the library's plugins, no renderer, exactly one tick a frame.
//!
//! [`Sim::frame`] is a whole frame, [`Sim::tick`] only the schedules of the tick. [`Sim::record`] tells the
//! baseline who is in flight in the steady state and who is born, so that both start from the same particles
//! and get the same emission.
//!
//! A simulation is handed out when all that is worked out in the background is there: colliders, the shape and the exposure
//! of texels. Nothing of it runs beside what is timed.

use std::time::{Duration, Instant};

use bevy::asset::AssetPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, block_on};
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::collision::SurfaceCollider;
use bevy_weathering::effect::{EffectIndex, EffectTable, WeatherEffect};
use bevy_weathering::emitter::{Emitter, Flow};
use bevy_weathering::overlay::{CpuOverlayPlugin, GpuOverlayPlugin, SplatQueue, TexelArea, Weatherable};
use bevy_weathering::particle::{Particle, ParticleCounts, Particles};
use bevy_weathering::replay::task_pools;
use bevy_weathering::schedule::{WeatheringSystems, WeatheringTick};
use bevy_weathering::wetting::Exposure;

use crate::hoff::HoffParticle;
use crate::scene::{HZ, LIFETIME, Placed, Scene};

/// Ticks after which nobody is in flight who was there at the start: as many die as are born.
const STEADY_TICKS: u32 = 3 * HZ;

/// Colliders are built in milliseconds, of ten million triangles in seconds; this long means that they never will be.
const PATIENCE: Duration = Duration::from_secs(240);

/// What differs between simulations.
#[derive(Clone, Copy)]
pub struct Setup {
    /// What is hit, and by what.
    pub scene: Scene,
    /// Particles per second.
    pub rate: f32,
    /// Air slows the water down. The baseline has no air; the formula costs the same either way.
    pub drag: bool,
    /// Particles carry water, which is absorbed, runs, drips and splashes. Otherwise they carry nothing, as the baseline's.
    pub water: bool,
    /// Splats are painted on the CPU. Otherwise [`Sim`] throws them away, as a renderer would take them.
    pub cpu_painter: bool,
}

impl Default for Setup {
    /// Scene 1 at 1,000 particles a second, as comparable to the baseline as a whole tick can be.
    fn default() -> Self {
        Self { scene: Scene::One, rate: 1_000.0, drag: false, water: true, cpu_painter: false }
    }
}

/// How long a scene took to be ready, from its first frame on.
#[derive(Clone, Copy, Debug)]
pub struct Readiness {
    /// Until all surfaces could be hit.
    pub hit: Duration,
    /// Until all knew the shape and exposure of their texels.
    pub wetted: Duration,
}

/// A scene in a headless app.
pub struct Sim {
    app: App,
    queues: QueryState<&'static mut SplatQueue>,
    effect: EffectIndex,
    emitter: Entity,
    readiness: Readiness,
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
    /// The scene before anything is emitted.
    pub fn new(setup: Setup) -> Self {
        Self::with(setup, setup.scene.surfaces(), |effect, rate| setup.scene.emitter(effect, rate))
    }

    /// The same with other surfaces and another emitter, which is told the effect and the rate.
    pub fn with(
        Setup { scene, rate, drag, water, cpu_painter }: Setup,
        surfaces: Vec<Placed>,
        emitter: impl FnOnce(Handle<WeatherEffect>, f32) -> (Emitter, Transform),
    ) -> Self {
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
        let mut particle = scene.effect();
        if !drag {
            particle.terminal_speed = Some(0.0);
        }
        if !water {
            particle.volume_mm3 = 0.0;
        }
        let handle = world.resource_mut::<Assets<WeatherEffect>>().add(particle.clone());
        let effect = world.resource_mut::<EffectTable>().insert(handle.clone(), particle);
        let effect = effect.expect("the table has room");
        for (mesh, at, maps) in surfaces {
            let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
            let transform = Transform::from_translation(at);
            world.spawn((maps, Mesh3d(mesh), transform, GlobalTransform::from(transform)));
        }
        let readiness = wait_for_surfaces(&mut app);

        // Behind that, so that nothing was emitted meanwhile.
        let world = app.world_mut();
        let (mut emitter, transform) = emitter(handle, rate);
        if !water {
            // What the effect says, which is nothing.
            emitter.flow = Flow::Effect;
        }
        let emitter = world.spawn((emitter, transform, GlobalTransform::from(transform))).id();
        let queues = world.query();
        Self { app, queues, effect, emitter, readiness }
    }

    /// The scene in its steady state.
    pub fn steady(setup: Setup) -> Self {
        let mut sim = Self::new(setup);
        sim.steady_at(setup.rate);
        sim
    }

    /// Emits so many particles per second from now on, until as many die as are born. What surfaces hold, they keep.
    pub fn steady_at(&mut self, rate: f32) {
        let mut emitter = self.app.world_mut().get_mut::<Emitter>(self.emitter).expect("it stays");
        (emitter.rate, emitter.enabled) = (rate, rate > 0.0);
        for _ in 0..STEADY_TICKS {
            self.frame();
        }
    }

    /// The scene before anything is emitted, for [`Self::record`].
    pub fn recorder(setup: Setup) -> Self {
        let mut sim = Self::new(setup);
        sim.app.init_resource::<Births>().add_systems(
            WeatheringTick,
            // As they left the nozzle, before their first step.
            note_births.after(WeatheringSystems::Emit).before(WeatheringSystems::Integrate),
        );
        sim
    }

    /// Runs a recorder into its steady state at a rate and tells who was born on the way and who is in flight at the end.
    pub fn record(&mut self, rate: f32) -> Recorded {
        self.app.world_mut().resource_mut::<Births>().0.clear();
        self.steady_at(rate);
        let particles = self.app.world().resource::<Particles>();
        let living = particles.iter().map(as_baseline).collect();
        let births = std::mem::take(&mut self.app.world_mut().resource_mut::<Births>().0);
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

    /// What its particles point to.
    pub fn effect(&self) -> EffectIndex {
        self.effect
    }

    /// How long it took to be ready.
    pub fn readiness(&self) -> Readiness {
        self.readiness
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
    births.0.push(particles.newborn().map(as_baseline).collect());
}

/// As old as it takes to die when ours does: splashes live shorter than what an emitter sends out.
fn as_baseline(particle: Particle) -> HoffParticle {
    HoffParticle {
        position: particle.position,
        velocity: particle.velocity,
        age: LIFETIME - f32::from(particle.lifespan.ticks_left) / HZ as f32,
    }
}

/// What surfaces have to know is worked out in the background, in frames; but for one tick, in which the scene is put
/// together from them, no time passes.
fn wait_for_surfaces(app: &mut App) -> Readiness {
    type NoCollider = (With<Weatherable>, Or<(Without<SurfaceCollider>, Without<TexelArea>)>);
    type NoExposure = (With<Weatherable>, Without<Exposure>);
    let mut no_collider = app.world_mut().query_filtered::<(), NoCollider>();
    let mut no_exposure = app.world_mut().query_filtered::<(), NoExposure>();
    let begun = Instant::now();
    let wait = |app: &mut App| {
        assert!(begun.elapsed() < PATIENCE, "a surface got no collider, or no exposure");
        app.update();
        std::thread::sleep(Duration::from_millis(1));
    };
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    while no_collider.iter(app.world()).next().is_some() {
        wait(app);
    }
    let hit = begun.elapsed();
    while no_exposure.iter(app.world()).next().is_some() {
        wait(app);
    }
    let wetted = begun.elapsed();
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    app.update();
    // One thread does such work, in the order it was asked for: when this is done, so is all the rest. The next frame
    // collects it.
    block_on(AsyncComputeTaskPool::get().spawn(async {}));
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    app.update();
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    Readiness { hit, wetted }
}
