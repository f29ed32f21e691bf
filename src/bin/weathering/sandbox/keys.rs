//! Space pauses, R starts over, F12 takes a picture, Escape leaves.

use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy_weathering::replay::write_png;
use bevy_weathering::scenario::{ScenarioStatus, reset_scenario};

use super::ScreenshotFolder;

pub fn plugin(app: &mut App) {
    app.add_systems(Update, (pause, reset, take_screenshot, leave));
}

fn pause(keys: Res<ButtonInput<KeyCode>>, status: Res<ScenarioStatus>, mut time: ResMut<Time<Virtual>>) {
    if keys.just_pressed(KeyCode::Space) && matches!(*status, ScenarioStatus::Ready) {
        if time.is_paused() {
            time.unpause()
        } else {
            time.pause()
        }
        info!("{}", if time.is_paused() { "paused" } else { "running" });
    }
}

fn reset(keys: Res<ButtonInput<KeyCode>>, mut commands: Commands) {
    if keys.just_pressed(KeyCode::KeyR) {
        commands.queue(reset_scenario);
        info!("started over");
    }
}

fn take_screenshot(
    keys: Res<ButtonInput<KeyCode>>,
    folder: Res<ScreenshotFolder>,
    mut commands: Commands,
    mut count: Local<u32>,
) {
    if keys.just_pressed(KeyCode::F12) {
        let path = loop {
            let path = folder.0.join(format!("screenshot_{:03}.png", *count));
            *count += 1;
            if !path.exists() {
                break path;
            }
        };
        commands.spawn(Screenshot::primary_window()).observe(move |captured: On<ScreenshotCaptured>| {
            match write_png(&path, captured.image.clone()) {
                Ok(()) => info!("saved {}", path.display()),
                Err(error) => error!("{error}"),
            }
        });
    }
}

fn leave(keys: Res<ButtonInput<KeyCode>>, mut exit: MessageWriter<AppExit>) {
    if keys.just_pressed(KeyCode::Escape) {
        exit.write(AppExit::Success);
    }
}
