//! A world with surfaces and without a renderer.

use std::time::Duration;

use bevy::app::PluginGroupBuilder;
use bevy::asset::AssetPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::clock::{ClockPlugin, WeatheringClock};
use bevy_weathering::emitter::Source;
use bevy_weathering::overlay::CpuOverlayPlugin;
use bevy_weathering::prelude::*;
use bevy_weathering::weather::Weather;
use bevy_weathering::wetting::{Drop, DropQueue, SurfaceWater, SurfaceWetness, Wetness, WetnessQuery};

/// A world with surfaces, at a tick rate.
pub struct Scene(pub App);

impl Scene {
    pub fn new(hz: u32) -> Self {
        Self::with_assets(hz, AssetPlugin::default())
    }

    /// The same with files of its own.
    pub fn with_assets(hz: u32, assets: AssetPlugin) -> Self {
        Self::with_parts(WeatheringPlugins.set(ClockPlugin { hz }), assets)
    }

    /// The same of some parts.
    pub fn with_parts(parts: PluginGroupBuilder, assets: AssetPlugin) -> Self {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, TransformPlugin, assets, MeshPlugin))
            .add_plugins(parts)
            .add_plugins(CpuOverlayPlugin)
            .insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
        app.world_mut().resource_mut::<Weather>().drying_speed = 0.0;
        app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::from_secs(3600));
        app.finish();
        app.cleanup();
        Self(app)
    }

    /// A surface, when its texels are measured.
    pub fn surface(
        &mut self,
        mesh: Mesh,
        size: u32,
        material: PorousMaterial,
        transform: Transform,
    ) -> Entity {
        let mesh = self.0.world_mut().resource_mut::<Assets<Mesh>>().add(mesh);
        let maps = Weatherable { map_size: size, wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, ..default() };
        let surface = self
            .0
            .world_mut()
            .spawn((maps, material, Mesh3d(mesh), transform, GlobalTransform::from(transform)))
            .id();
        self.wait_for::<SurfaceWater>(surface);
        surface
    }

    /// Runs frames without ticks until an entity has something that is worked out in the background.
    pub fn wait_for<C: Component>(&mut self, entity: Entity) {
        self.wait_until(std::any::type_name::<C>(), |scene| scene.0.world().get::<C>(entity).is_some());
    }

    /// Runs frames without ticks until something is so.
    pub fn wait_until(&mut self, what: &str, mut is_so: impl FnMut(&mut Self) -> bool) {
        for _ in 0..100_000 {
            if is_so(self) {
                return;
            }
            self.0.update();
            std::thread::sleep(Duration::from_millis(1));
        }
        panic!("never came: {what}");
    }

    pub fn emit(&mut self, emitter: Emitter, water_mm3: f32, stamp_radius: f32, at: Vec3) -> Entity {
        let effect = WeatherEffect {
            volume_mm3: water_mm3,
            stamp_radius: Some(stamp_radius),
            stamp_speed: Some(0.0),
            terminal_speed: Some(6.5),
            ..default()
        };
        let effect = self.0.world_mut().resource_mut::<Assets<WeatherEffect>>().add(effect);
        self.0.world_mut().spawn((Emitter { effect, ..emitter }, Transform::from_translation(at))).id()
    }

    pub fn run(&mut self, ticks: u32) {
        self.0.insert_resource(TimeUpdateStrategy::FixedTimesteps(50));
        for _ in 0..ticks / 50 {
            self.0.update();
        }
        self.0.insert_resource(TimeUpdateStrategy::FixedTimesteps(ticks % 50));
        self.0.update();
        self.0.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    }

    /// Water at a uv, without a particle.
    pub fn pour(&mut self, surface: Entity, uv: Vec2, radius: i32, water_nl: u32) {
        let size = self.water(surface).size() as f32;
        let center = [uv.x, uv.y].map(|part| (part * size * 256.0) as i32);
        let mut queue = self.0.world_mut().get_mut::<DropQueue>(surface).unwrap();
        queue.0.push(Drop {
            center,
            radius: [radius * 256; 2],
            water_nl,
            speed_mm: 0,
            jet: None,
            source: Source::UNKNOWN,
        });
    }

    /// Whether a surface comes to rest within so many seconds.
    pub fn rests(&mut self, surface: Entity, seconds: u32) -> bool {
        let hz = self.0.world().resource::<WeatheringClock>().hz();
        for _ in 0..seconds / 30 {
            if self.water(surface).is_at_rest() {
                return true;
            }
            self.run(30 * hz);
        }
        false
    }

    pub fn water(&self, surface: Entity) -> &SurfaceWater {
        self.0.world().get::<SurfaceWater>(surface).unwrap()
    }

    pub fn at(&mut self, surface: Entity, uv: Vec2) -> Wetness {
        let ask = move |query: WetnessQuery| query.at_uv(surface, uv).unwrap();
        self.0.world_mut().run_system_once_with_nothing(ask)
    }

    pub fn over(&mut self, surface: Entity) -> SurfaceWetness {
        let ask = move |query: WetnessQuery| query.over(surface).unwrap();
        self.0.world_mut().run_system_once_with_nothing(ask)
    }
}

/// `run_system_once`, without its error.
pub trait RunOnce {
    fn run_system_once_with_nothing<T: 'static, M>(&mut self, system: impl IntoSystem<(), T, M>) -> T;
}

impl RunOnce for World {
    fn run_system_once_with_nothing<T: 'static, M>(&mut self, system: impl IntoSystem<(), T, M>) -> T {
        use bevy::ecs::system::RunSystemOnce;
        self.run_system_once(system).unwrap()
    }
}
