//! The app of a replay, with and without a renderer.

use bevy::app::{PanicHandlerPlugin, TaskPoolOptions, TaskPoolPlugin, TerminalCtrlCHandlerPlugin};
use bevy::asset::AssetPlugin;
use bevy::gltf::GltfPlugin;
use bevy::image::ImagePlugin;
use bevy::log::LogPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::PollType;
use bevy::render::renderer::RenderDevice;
use bevy::tasks::block_on;
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy::world_serialization::WorldSerializationPlugin;

use super::{ReplayError, ReplayOptions};
use crate::WeatheringPlugins;
use crate::overlay::{CpuOverlayPlugin, GpuOverlayPlugin};
use crate::scenario::ScenarioPlugin;

/// Checks that there is a graphics driver: a clear error instead of a panic deep inside the renderer.
///
/// # Errors
/// [`ReplayError::NoAdapter`].
pub fn require_adapter() -> Result<(), ReplayError> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapters = block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    if adapters.is_empty() { Err(ReplayError::NoAdapter) } else { Ok(()) }
}

/// An app that runs when told to.
pub(super) fn build(options: &ReplayOptions, scenario: ScenarioPlugin) -> App {
    let mut app = App::new();
    let tasks = TaskPoolPlugin {
        task_pool_options: options.threads.map_or_else(default, TaskPoolOptions::with_num_threads),
    };
    let assets = AssetPlugin { file_path: options.scenario.tree.to_string_lossy().into_owned(), ..default() };
    if options.render {
        let no_window =
            WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
        app.add_plugins(
            DefaultPlugins
                .set(tasks)
                .set(assets)
                .set(no_window)
                .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
                // Driven by hand, on this thread.
                .disable::<WinitPlugin>()
                .disable::<PipelinedRenderingPlugin>()
                // The program's, not a library's, to set up.
                .disable::<LogPlugin>()
                .disable::<PanicHandlerPlugin>()
                .disable::<TerminalCtrlCHandlerPlugin>(),
        )
        .add_plugins(WeatheringPlugins);
    } else {
        app.add_plugins(MinimalPlugins.set(tasks))
            .add_plugins((
                TransformPlugin,
                assets,
                WorldSerializationPlugin,
                ImagePlugin::default(),
                MeshPlugin,
                GltfPlugin::default(),
            ))
            .init_asset::<AnimationClip>()
            .add_plugins(WeatheringPlugins.build().disable::<GpuOverlayPlugin>())
            .add_plugins(CpuOverlayPlugin);
    }
    app.add_plugins(scenario);
    // A frame may be as long as it likes.
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(std::time::Duration::from_secs(86_400));
    app.finish();
    app.cleanup();
    app
}

/// Blocks until the GPU has done all it was given.
pub(super) fn wait_for_gpu(world: &World) {
    if let Some(device) = world.get_resource::<RenderDevice>()
        && let Err(error) =
            device.wgpu_device().poll(PollType::Wait { submission_index: None, timeout: None })
    {
        error!("the graphics device stopped answering: {error}");
    }
}
