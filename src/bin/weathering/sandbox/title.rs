//! The window's title says which scene it is and whether it loads, runs or stands still.

use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_weathering::scenario::ScenarioStatus;

use super::open::Opened;

pub fn plugin(app: &mut App) {
    app.add_systems(PostUpdate, name_window);
}

fn name_window(
    opened: Res<Opened>,
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
    if shown.replace(state) != Some(state) || opened.is_changed() {
        window.title = format!("weathering - {} ({state})", opened.loaded.file.display());
    }
}
