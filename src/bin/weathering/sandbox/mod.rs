//! `weathering sandbox`: scenes in a window, to play with.
//!
//! Each file is a plugin of its own; those that have something to show add a panel to [`ui`].

mod added;
mod aim;
mod boxes;
mod brush;
mod camera;
mod display;
mod effects;
mod emitters;
mod export;
mod heat;
mod hose;
mod keys;
mod leave;
mod maps;
mod materials;
mod model;
mod open;
mod pace;
mod parts;
mod plots;
mod probe;
mod record;
mod reveal;
mod saving;
mod scenes;
mod selection;
mod settings;
mod shades;
mod shortcuts;
mod shots;
mod sources;
mod split;
mod theme;
mod title;
mod ui;
mod undo;
mod views;
mod weather;
mod widgets;

use std::error::Error;
use std::time::Instant;

use bevy::asset::{AssetPlugin, UnapprovedPathMode};
use bevy::light::DirectionalLightShadowMap;
use bevy::log::{BoxedFmtLayer, LogPlugin, tracing_subscriber};
use bevy::prelude::*;
use bevy::render::renderer::RenderAdapterInfo;
use bevy::window::PrimaryWindow;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::effect::WeatherEffect;
use bevy_weathering::emitter::TrackSources;
use bevy_weathering::overlay::SplatBudget;
use bevy_weathering::overload::{LiveBudget, LiveBudgetPlugin, StageTimesPlugin};
use bevy_weathering::replay::{require_adapter, task_pools};
use bevy_weathering::scenario::{AssetTree, ScenarioPlugin};

use crate::cli::SandboxArgs;

pub fn run(arguments: &SandboxArgs) -> Result<(), Box<dyn Error>> {
    let begun = reveal::Begun(Instant::now());
    let loaded = open::load(&arguments.file, arguments.variant.as_deref())?;
    display::require_display()?;
    require_adapter()?;
    // What takes seconds is made while the window is there already.
    let is_slow = open::is_slow(&loaded);
    let first = if is_slow { open::without_content(&loaded) } else { loaded.clone() };
    let scenario = ScenarioPlugin::new(first.clone(), true)?;
    // Seen when there is something to be seen in it.
    let window =
        Window { title: "weathering".into(), resolution: (1280, 720).into(), visible: false, ..default() };
    // Closing the window is leaving, which may have to wait.
    let windows = WindowPlugin { primary_window: Some(window), close_when_requested: false, ..default() };
    let assets = AssetPlugin {
        file_path: loaded.tree.to_string_lossy().into_owned(),
        // Effects, stamps and pictures follow their files while one works on them.
        watch_for_changes_override: Some(true),
        // Scenes that are opened later may lie elsewhere. Each is kept within its own tree before it is shown.
        unapproved_path_mode: UnapprovedPathMode::Allow,
        ..default()
    };
    let logs = LogPlugin { fmt_layer: |_| Some(log_layer()), ..default() };
    let mut app = App::new();
    app.add_plugins(DefaultPlugins.set(task_pools(None)).set(windows).set(assets).set(logs))
        .add_plugins(WeatheringPlugins)
        .insert_resource(LiveBudget { frame_ms: pace::BUDGET_MS, ..default() })
        .add_plugins((LiveBudgetPlugin, StageTimesPlugin))
        // For the probe and the views.
        .init_resource::<TrackSources>()
        .insert_resource(AssetTree(loaded.tree.clone()))
        .add_plugins(scenario);
    model::light_shade(app.world_mut(), model::is_model(&arguments.file));
    app.insert_resource(open::Opened { loaded: first })
        .insert_resource(shots::OutFolder(arguments.out.clone()))
        .insert_resource(begun)
        .add_plugins((ui::plugin, settings::plugin, selection::plugin, camera::plugin))
        // In the order of their panels.
        .add_plugins((hose_and_time, scene_panels))
        .add_plugins((
            shortcuts::plugin,
            keys::plugin,
            title::plugin,
            open::plugin,
            saving::plugin,
            leave::plugin,
            reveal::plugin,
            export::plugin,
            record::plugin,
        ))
        .add_systems(PreUpdate, spare_software_renderers)
        .add_systems(Update, tell_of_reloads);
    if is_slow {
        open::begin(app.world_mut(), loaded);
    }
    let exit = app.run();
    if exit.is_error() { Err("the scene could not be shown; see above".into()) } else { Ok(()) }
}

/// What is told goes to standard error, and where nobody can read it, it is no fault.
fn log_layer() -> BoxedFmtLayer {
    let layer = tracing_subscriber::fmt::Layer::default().with_writer(std::io::stderr);
    Box::new(layer.with_ansi(crate::is_in_color()).log_internal_errors(false))
}

/// What is in the bar.
fn hose_and_time(app: &mut App) {
    app.add_plugins((pace::plugin, scenes::plugin, hose::plugin, brush::plugin, undo::plugin));
}

/// The other panels.
fn scene_panels(app: &mut App) {
    app.add_plugins((weather::plugin, added::plugin, emitters::plugin, effects::plugin, materials::plugin))
        .add_plugins((
            views::plugin,
            shots::plugin,
            probe::plugin,
            maps::plugin,
            plots::plugin,
            split::plugin,
            parts::plugin,
        ));
}

/// Without a GPU, fluency is worth more than smooth edges.
fn spare_software_renderers(
    mut commands: Commands,
    adapter: Res<RenderAdapterInfo>,
    cameras: Query<Entity, Added<Camera3d>>,
    mut windows: Query<&mut Window, With<PrimaryWindow>>,
    mut is_small: Local<bool>,
) {
    if adapter.device_type != wgpu::DeviceType::Cpu {
        return;
    }
    for camera in &cameras {
        commands.entity(camera).insert(Msaa::Off);
    }
    if !*is_small {
        *is_small = true;
        commands.insert_resource(DirectionalLightShadowMap { size: 1024 });
        // A splat takes such a driver some 10 µs (benches/NOTES.md, `overlap`); the others wait.
        commands.insert_resource(SplatBudget { per_frame: 4000, ..default() });
        for mut window in &mut windows {
            window.resolution.set(960.0, 540.0);
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
