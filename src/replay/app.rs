//! The app of a replay, with and without a renderer.

use bevy::app::{TaskPoolOptions, TaskPoolPlugin, TaskPoolThreadAssignmentPolicy};
use bevy::asset::AssetPlugin;
use bevy::gltf::GltfPlugin;
use bevy::image::{CompressedImageFormatSupport, CompressedImageFormats, ImagePlugin};
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::tasks::block_on;
use bevy::world_serialization::WorldSerializationPlugin;

use super::{ReplayError, ReplayOptions, failure};
use crate::WeatheringPlugins;
use crate::clock::WeatheringClock;
use crate::offscreen;
use crate::overlay::{CpuOverlayPlugin, GpuOverlayPlugin};
use crate::scenario::ScenarioPlugin;
use crate::wetting::MeasureTiming;

/// Checks that there is a graphics driver: a clear error instead of a panic deep inside the renderer.
///
/// # Errors
/// [`ReplayError::NoAdapter`].
pub fn require_adapter() -> Result<(), ReplayError> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapters = block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    if adapters.is_empty() { Err(ReplayError::NoAdapter) } else { Ok(()) }
}

/// Thread pools with exactly `threads` threads for the systems of a tick, or as many as there are cores. Bevy's default
/// leaves a machine of two cores one.
pub fn task_pools(threads: Option<usize>) -> TaskPoolPlugin {
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let exactly = |threads: usize| TaskPoolThreadAssignmentPolicy {
        min_threads: threads,
        max_threads: threads,
        percent: 1.0,
        on_thread_spawn: None,
        on_thread_destroy: None,
    };
    TaskPoolPlugin {
        task_pool_options: TaskPoolOptions {
            io: exactly(1),
            async_compute: exactly(1),
            compute: exactly(threads.unwrap_or_else(cores)),
            ..default()
        },
    }
}

/// An app that runs when told to.
pub(super) fn build(options: &ReplayOptions, scenario: ScenarioPlugin) -> App {
    let mut app;
    let tasks = task_pools(options.threads);
    let assets = AssetPlugin { file_path: options.scenario.tree.to_string_lossy().into_owned(), ..default() };
    if options.render {
        app = App::new();
        app.add_plugins(offscreen::plugins().set(tasks).set(assets))
            .add_plugins((WeatheringPlugins, failure::plugin))
            .insert_resource(options.splats);
    } else {
        app = headless(tasks, assets);
    }
    app.add_plugins(scenario);
    // A quarter of a second: long enough that a frame seldom has to wait.
    let hz = app.world().resource::<WeatheringClock>().hz();
    app.insert_resource(MeasureTiming::AfterTicks((hz / 4).max(1)));
    // A frame may be as long as it likes.
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(std::time::Duration::from_secs(86_400));
    app.finish();
    app.cleanup();
    app
}

/// An app with no renderer, which paints on the CPU. It has not been finished yet.
pub(crate) fn headless(tasks: TaskPoolPlugin, assets: AssetPlugin) -> App {
    let mut app = App::new();
    app.add_plugins(MinimalPlugins.set(tasks))
        .add_plugins((
            TransformPlugin,
            assets,
            WorldSerializationPlugin,
            ImagePlugin::default(),
            MeshPlugin,
            GltfPlugin::default(),
        ))
        // Nothing is drawn: no compressed texture is needed.
        .insert_resource(CompressedImageFormatSupport(CompressedImageFormats::NONE))
        .init_asset::<AnimationClip>()
        .add_plugins(WeatheringPlugins.build().disable::<GpuOverlayPlugin>())
        .add_plugins(CpuOverlayPlugin);
    app
}
