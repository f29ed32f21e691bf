//! Keys, and the list of them.

use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::prelude::*;
use bevy_egui::egui;

use super::pace::start_over;
use super::settings::{Settings, Tool};
use super::shortcuts::{self, Shortcuts};
use super::ui::Help;

/// Every key and mouse button, and what it does.
const KEYS: &[(&str, &str)] = &[
    ("Left button", "what the tool does: spray, probe, paint"),
    ("Right button", "turn the camera"),
    ("Middle button", "move the camera"),
    ("Wheel", "closer, farther; in flight also slower, faster"),
    ("W A S D Q E", "fly (Shift: faster)"),
    ("C", "right button: orbit or fly"),
    ("F", "look at all of the scene"),
    ("H, I", "hose, probe"),
    ("1 2 3 4", "brushes: wet, dry, dirty, clean"),
    ("Ctrl+Z", "take a stroke, or an emitter, back"),
    ("Ctrl+Shift+Z", "do it again"),
    ("Ctrl+S", "save the scene"),
    ("Space", "pause, go on"),
    ("N", "one tick"),
    (", .", "time half, twice as fast"),
    ("R", "start over; strokes are gone for good"),
    ("U", "hide panels, show them"),
    ("M, P", "maps, plots"),
    ("PageUp PageDown", "the panel before, after"),
    ("V", "false colours: wetness, film, saturation, source"),
    ("X", "export the scene as it is"),
    ("F9", "record a session; write it and end"),
    ("F12", "picture"),
    ("F11", "begin, end a sequence of pictures"),
    ("? or F1", "this list"),
    ("Escape", "close this list; leave (twice, if not saved)"),
];

/// Width of a column of the list, points.
const COLUMN: f32 = 430.0;

pub fn plugin(app: &mut App) {
    app.add_systems(Update, reset)
        // Before tools do anything: a slow frame may see one chosen and used.
        .add_systems(PreUpdate, choose.after(shortcuts::listen));
}

fn reset(keys: Res<Shortcuts>, mut commands: Commands) {
    if keys.pressed(KeyCode::KeyR) {
        commands.queue(start_over);
    }
}

/// Whether somebody has typed a question mark, wherever it is on their keyboard.
pub fn asks(input: &KeyboardInput) -> bool {
    input.state.is_pressed() && !input.repeat && input.logical_key == Key::Character("?".into())
}

/// Keys that change settings.
fn choose(keys: Res<Shortcuts>, mut settings: ResMut<Settings>, mut help: ResMut<Help>) {
    let pressed = |key| keys.pressed(key);
    if pressed(KeyCode::F1) || keys.is_asked() {
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

/// The list of all keys, in two columns where there is room for them.
pub fn show_help(context: &egui::Context, open: &mut bool) {
    let screen = context.viewport_rect();
    let columns = if screen.width() >= 2.0 * COLUMN + 60.0 { 2 } else { 1 };
    // Where panels are large, the list is longer than the window is high.
    let most = (screen.height() - 110.0).max(80.0);
    let width = (COLUMN * columns as f32).min(screen.width() - 40.0);
    let window = egui::Window::new("Keys").open(open).resizable(false).collapsible(false);
    let window = window.pivot(egui::Align2::CENTER_CENTER).default_pos(screen.center()).default_width(width);
    window.show(context, |ui| {
        // Bars that float are not seen before they are needed.
        ui.spacing_mut().scroll = egui::style::ScrollStyle::solid();
        egui::ScrollArea::vertical().max_height(most).show(ui, |ui| {
            ui.set_width(width);
            ui.columns(columns, |uis| {
                let lists = KEYS.chunks(KEYS.len().div_ceil(columns));
                for ((index, list), ui) in lists.enumerate().zip(uis) {
                    egui::Grid::new(("keys", index)).num_columns(2).striped(true).show(ui, |ui| {
                        for (key, does) in list {
                            ui.strong(*key);
                            ui.label(*does);
                            ui.end_row();
                        }
                    });
                }
            });
        });
    });
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use bevy::input::ButtonState;

    use super::*;

    /// Names of the keys of an entry of the list, as Bevy has them; words that are none stay what they are.
    fn names(keys: &str) -> Vec<String> {
        let name = |word: &str| match word {
            "," => "Comma".to_owned(),
            "." => "Period".to_owned(),
            "Ctrl" => "ControlLeft".to_owned(),
            "Shift" => "ShiftLeft".to_owned(),
            _ if word.len() == 1 && word.chars().all(char::is_alphabetic) => format!("Key{word}"),
            _ if word.len() == 1 && word.chars().all(char::is_numeric) => format!("Digit{word}"),
            _ => word.to_owned(),
        };
        let words = keys.split([' ', '+']);
        words
            .map(|word| name(if word.len() > 1 { word.trim_end_matches([',', ':']) } else { word }))
            .collect()
    }

    #[test]
    fn every_key_that_does_something_is_listed() {
        let mut listed: BTreeSet<String> = KEYS.iter().flat_map(|(keys, _)| names(keys)).collect();
        let about = KEYS.iter().map(|(_, does)| does.replace('(', ""));
        listed.extend(about.flat_map(|does| names(&does)));
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/bin/weathering/sandbox");
        let (mut used, mut paths) = (BTreeSet::new(), vec![folder]);
        while let Some(path) = paths.pop() {
            if path.is_dir() {
                paths.extend(std::fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()));
                continue;
            }
            let text = std::fs::read_to_string(path).unwrap();
            let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
            let letters = code.split("with_control").skip(1).filter_map(|rest| rest.split('\'').nth(1));
            let letters = letters.filter(|letter| letter.len() == 1);
            used.extend(letters.map(|letter| format!("Key{}", letter.to_uppercase())));
            let keys = code.split("KeyCode::").skip(1);
            let keys = keys.map(|rest| rest.split(|letter: char| !letter.is_alphanumeric()).next());
            // Those at the right do what those at the left do.
            used.extend(keys.flatten().map(|key| key.replace("Right", "Left")).filter(|key| !key.is_empty()));
        }
        // It stands for none.
        used.remove("F35");
        assert!(used.len() > 25, "{used:?}");
        let missing: Vec<_> = used.difference(&listed).collect();
        assert!(missing.is_empty(), "not in the list of keys: {missing:?}");
    }

    #[test]
    fn a_question_mark_is_one_on_every_keyboard() {
        let input = |key_code, typed: &str, state, repeat| KeyboardInput {
            key_code,
            logical_key: Key::Character(typed.into()),
            state,
            text: None,
            repeat,
            window: Entity::PLACEHOLDER,
        };
        assert!(asks(&input(KeyCode::Slash, "?", ButtonState::Pressed, false)));
        assert!(asks(&input(KeyCode::Minus, "?", ButtonState::Pressed, false)));
        assert!(!asks(&input(KeyCode::Slash, "-", ButtonState::Pressed, false)));
        assert!(!asks(&input(KeyCode::Slash, "?", ButtonState::Released, false)));
        assert!(!asks(&input(KeyCode::Slash, "?", ButtonState::Pressed, true)));
    }
}
