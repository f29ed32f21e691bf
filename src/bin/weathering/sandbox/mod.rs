//! `weathering sandbox`: a scenario in a window.

mod camera;
mod keys;
mod title;

use std::error::Error;
use std::path::PathBuf;

use bevy::asset::AssetPlugin;
use bevy::light::DirectionalLightShadowMap;
use bevy::prelude::*;
use bevy::render::renderer::RenderAdapterInfo;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::effect::WeatherEffect;
use bevy_weathering::overload::LiveBudgetPlugin;
use bevy_weathering::replay::{require_adapter, task_pools};
use bevy_weathering::scenario::{Scenario, ScenarioPlugin, ScenarioStatus};

use crate::cli::SandboxArgs;

/// Where screenshots go.
#[derive(Resource)]
struct ScreenshotFolder(PathBuf);

pub fn run(arguments: &SandboxArgs) -> Result<(), Box<dyn Error>> {
    let loaded = Scenario::load_variant(&arguments.file, arguments.variant.as_deref())?;
    require_adapter()?;
    if cfg!(target_os = "linux") && std::env::var_os("DISPLAY").is_none() {
        return Err("no display: DISPLAY is not set; use `weathering replay`, or start one (Xvfb)".into());
    }
    let scenario = ScenarioPlugin::new(loaded.clone(), true)?;
    let window = Window { title: "weathering".into(), resolution: (1280, 720).into(), ..default() };
    let exit = App::new()
        .add_plugins(
            DefaultPlugins
                .set(task_pools(None))
                .set(WindowPlugin { primary_window: Some(window), ..default() })
                .set(AssetPlugin {
                    file_path: loaded.tree.to_string_lossy().into_owned(),
                    // Effects, stamps and pictures follow their files while one works on them.
                    watch_for_changes_override: Some(true),
                    ..default()
                }),
        )
        .add_plugins(WeatheringPlugins)
        .add_plugins(LiveBudgetPlugin)
        .add_plugins(scenario)
        .insert_resource(ScreenshotFolder(arguments.out.clone()))
        .insert_resource(title::ScenarioName(arguments.file.display().to_string()))
        .add_plugins((camera::plugin, keys::plugin, title::plugin))
        .add_systems(Startup, spare_software_renderers)
        .add_systems(Update, (quit_on_failure, tell_of_reloads))
        .run();
    if exit.is_error() { Err("the scenario could not be shown; see above".into()) } else { Ok(()) }
}

/// Without a GPU, fluency is worth more than smooth edges.
fn spare_software_renderers(
    mut commands: Commands,
    adapter: Res<RenderAdapterInfo>,
    cameras: Query<Entity, With<Camera3d>>,
    mut windows: Query<&mut Window>,
) {
    if adapter.device_type == wgpu::DeviceType::Cpu {
        commands.insert_resource(DirectionalLightShadowMap { size: 1024 });
        for camera in &cameras {
            commands.entity(camera).insert(Msaa::Off);
        }
        for mut window in &mut windows {
            window.resolution.set(800.0, 450.0);
        }
    }
}

/// Whoever edits an effect wants to know that it was read again; that it could not be is told by the asset server.
fn tell_of_reloads(mut events: MessageReader<AssetEvent<WeatherEffect>>, server: Res<AssetServer>) {
    for event in events.read() {
        if let AssetEvent::Modified { id } = event
            && let Some(path) = server.get_path(*id)
        {
            info!("read again: {path}");
        }
    }
}

fn quit_on_failure(status: Res<ScenarioStatus>, mut exit: MessageWriter<AppExit>) {
    if let ScenarioStatus::Failed(error) = &*status {
        error!("{error}");
        exit.write(AppExit::error());
    }
}
