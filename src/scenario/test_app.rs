//! An app without a renderer that runs a scenario, for the tests of this folder.

use std::time::Duration;

use bevy::asset::AssetPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;

use super::{LoadedScenario, ScenarioPlugin, ScenarioStatus};
use crate::WeatheringPlugins;
use crate::overlay::{CpuOverlayPlugin, GpuOverlayPlugin};

/// Its scenario is loading; no tick runs by itself.
pub(super) fn app(loaded: LoadedScenario) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin))
        .add_plugins(WeatheringPlugins.build().disable::<GpuOverlayPlugin>())
        .add_plugins((CpuOverlayPlugin, ScenarioPlugin::new(loaded, false).unwrap()))
        .insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::from_secs(3600));
    app.finish();
    app.cleanup();
    app
}

/// Until the scene is there.
pub(super) fn wait(app: &mut App) {
    for _ in 0..10_000 {
        app.update();
        match app.world().resource::<ScenarioStatus>() {
            ScenarioStatus::Ready => return,
            ScenarioStatus::Loading => std::thread::sleep(Duration::from_millis(1)),
            ScenarioStatus::Failed(error) => panic!("{error}"),
        }
    }
    panic!("never ready");
}

/// So many ticks in one frame.
pub(super) fn run_ticks(app: &mut App, ticks: u32) {
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(ticks));
    app.update();
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
}
