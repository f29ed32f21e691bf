//! Keys, and the list of them.

use bevy::prelude::*;
use bevy_egui::egui;

use super::pace::start_over;
use super::settings::{Settings, Tool};
use super::ui::{Help, keyboard_is_free};

/// Every key and mouse button, and what it does.
const KEYS: &[(&str, &str)] = &[
    ("Left button", "what the tool does: spray, probe, paint"),
    ("Right button", "turn the camera"),
    ("Middle button", "move the camera"),
    ("Wheel", "closer, farther; faster, slower in flight"),
    ("W A S D Q E", "fly (Shift: faster)"),
    ("C", "orbit or flight"),
    ("F", "look at all of the scene"),
    ("H, I", "hose, probe"),
    ("1 2 3 4", "brushes: wet, dry, dirty, clean"),
    ("Ctrl+Z", "take a stroke, or an emitter, back"),
    ("Ctrl+S", "save the scene"),
    ("Space", "pause, go on"),
    ("N", "one tick"),
    (", .", "time half, twice as fast"),
    ("R", "start over"),
    ("U", "hide panels, show them"),
    ("M, P", "maps, plots"),
    ("V", "what surfaces show: look, wetness, film, saturation, source"),
    ("X", "export the scene as it is"),
    ("F9", "record a session; write it and end"),
    ("F12", "picture"),
    ("F11", "begin, end a sequence of pictures"),
    ("? or F1", "this list"),
    ("Escape", "close this list; leave"),
];

pub fn plugin(app: &mut App) {
    app.add_systems(Update, (reset, choose).run_if(keyboard_is_free));
}

fn reset(keys: Res<ButtonInput<KeyCode>>, mut commands: Commands) {
    if keys.just_pressed(KeyCode::KeyR) {
        commands.queue(start_over);
    }
}

/// Keys that change settings.
fn choose(keys: Res<ButtonInput<KeyCode>>, mut settings: ResMut<Settings>, mut help: ResMut<Help>) {
    let pressed = |key| keys.just_pressed(key);
    if pressed(KeyCode::F1) || pressed(KeyCode::Slash) {
        help.0 = !help.0;
    }
    if pressed(KeyCode::KeyU) {
        settings.panels = !settings.panels;
    }
    if pressed(KeyCode::KeyM) {
        settings.maps = !settings.maps;
    }
    if pressed(KeyCode::KeyP) {
        settings.plots = !settings.plots;
    }
    if pressed(KeyCode::KeyV) {
        settings.views.shade = settings.views.shade.following();
    }
    if pressed(KeyCode::KeyC) {
        settings.flies = !settings.flies;
    }
    for (key, tool) in [
        (KeyCode::KeyH, Tool::Hose),
        (KeyCode::KeyI, Tool::Probe),
        (KeyCode::Digit1, Tool::Wet),
        (KeyCode::Digit2, Tool::Dry),
        (KeyCode::Digit3, Tool::Dirty),
        (KeyCode::Digit4, Tool::Clean),
    ] {
        if pressed(key) {
            settings.tool = tool;
        }
    }
}

/// The list of all keys.
pub fn show_help(context: &egui::Context, open: &mut bool) {
    // Where panels are large, the list is longer than the window is high.
    let most = (context.viewport_rect().height() - 110.0).max(80.0);
    let window = egui::Window::new("Keys").open(open).resizable(false).default_pos([340.0, 60.0]);
    window.show(context, |ui| {
        egui::ScrollArea::vertical().max_height(most).show(ui, |ui| {
            egui::Grid::new("keys").num_columns(2).striped(true).show(ui, |ui| {
                for (key, does) in KEYS {
                    ui.strong(*key);
                    ui.label(*does);
                    ui.end_row();
                }
            });
        });
    });
}
