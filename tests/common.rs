//! What several modules need: random numbers, the same everywhere, meshes without an asset server, apps that run scenarios.

use std::path::Path;
use std::time::Duration;

use bevy::asset::AssetPlugin;
use bevy::gltf::GltfPlugin;
use bevy::image::{CompressedImageFormatSupport, CompressedImageFormats, ImagePlugin};
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy::world_serialization::WorldSerializationPlugin;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::collision::MeshTriangles;
use bevy_weathering::overlay::{CpuOverlayPlugin, GpuOverlayPlugin};
use bevy_weathering::record::RecordPlugin;
use bevy_weathering::scenario::{LoadedScenario, ScenarioPlugin, ScenarioStatus, ScenarioSurface};
use bevy_weathering::scenes::gltf_mesh::read_first_primitive;

/// SplitMix64 (Steele, Lea, Flood 2014): the same numbers on every machine.
pub struct Random(pub u64);

impl Random {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A whole number below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }

    /// A point in the cube of this half width around the origin.
    pub fn in_cube(&mut self, half: f32) -> Vec3 {
        let mut axis = || ((self.bits() >> 40) as f32 / (1u64 << 23) as f32 - 1.0) * half;
        Vec3::new(axis(), axis(), axis())
    }
}

/// Whether tests that draw are left out, by `WEATHERING_SKIP_GPU=1`: then it is printed.
pub fn skips_gpu() -> bool {
    let skips = std::env::var("WEATHERING_SKIP_GPU").is_ok_and(|value| value == "1");
    if skips {
        eprintln!("skipped: needs a GPU, and WEATHERING_SKIP_GPU=1");
    }
    skips
}

/// The bunny of 1,000 triangles.
pub fn bunny() -> MeshTriangles {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/bunny_1000.glb");
    read_first_primitive(&file).expect("the model is in the repository")
}

/// An app without a renderer in which a scenario loads, and which can be recorded; no tick runs by itself.
pub fn scenario_app(loaded: LoadedScenario) -> App {
    let assets = AssetPlugin { file_path: loaded.tree.to_string_lossy().into_owned(), ..default() };
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, assets, WorldSerializationPlugin))
        .add_plugins((ImagePlugin::default(), MeshPlugin, GltfPlugin::default()))
        .insert_resource(CompressedImageFormatSupport(CompressedImageFormats::NONE))
        .init_asset::<AnimationClip>()
        .add_plugins(WeatheringPlugins.build().disable::<GpuOverlayPlugin>())
        .add_plugins((CpuOverlayPlugin, ScenarioPlugin::new(loaded, false).unwrap(), RecordPlugin))
        .insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::from_secs(3600));
    app.finish();
    app.cleanup();
    app
}

/// Until the scene is there.
pub fn wait_until_ready(app: &mut App) {
    for _ in 0..10_000 {
        app.update();
        match app.world().resource::<ScenarioStatus>() {
            ScenarioStatus::Ready => {
                // Who records sees in the next frame that it is live.
                app.update();
                return;
            }
            ScenarioStatus::Loading => std::thread::sleep(Duration::from_millis(1)),
            ScenarioStatus::Failed(error) => panic!("{error}"),
        }
    }
    panic!("never ready");
}

/// A surface of a scenario, by its name.
pub fn scenario_surface(world: &mut World, name: &str) -> Entity {
    let mut surfaces = world.query::<(Entity, &ScenarioSurface)>();
    surfaces.iter(world).find(|(_, surface)| surface.name == name).unwrap().0
}
