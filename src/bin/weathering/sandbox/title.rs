//! The window's title says which scenario it is and whether it loads, runs or stands still.

use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_weathering::scenario::ScenarioStatus;

/// Name of what is shown.
#[derive(Resource)]
pub struct ScenarioName(pub String);

pub fn plugin(app: &mut App) {
    app.add_systems(PostUpdate, name_window);
}

fn name_window(
    name: Res<ScenarioName>,
    status: Res<ScenarioStatus>,
    time: Res<Time<Virtual>>,
    mut window: Single<&mut Window, With<PrimaryWindow>>,
    mut shown: Local<Option<&'static str>>,
) {
    let state = match *status {
        ScenarioStatus::Ready if time.is_paused() => "paused",
        ScenarioStatus::Ready => "running",
        ScenarioStatus::Failed(_) => "failed",
        ScenarioStatus::Loading => "loading",
    };
    if shown.replace(state) != Some(state) {
        window.title = format!("weathering - {} ({state})", name.0);
    }
}
