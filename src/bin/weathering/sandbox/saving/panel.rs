//! What is pressed: the folder, the buttons and their key, and why nothing can be saved.

use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::record::Recording;
use bevy_weathering::scenario::ScenarioStatus;

use super::super::export;
use super::super::open::Opening;
use super::super::shortcuts::Shortcuts;
use super::super::shots::OutFolder;
use super::super::split::Split;
use super::super::ui::Note;
use super::super::weather::OwnRain;
use super::is_busy;
use super::steps::{begin, begin_restoring};

/// The folder that is named in the panel.
#[derive(Resource, Default)]
pub(super) struct Folder(Option<String>);

pub(super) fn press(keys: Res<Shortcuts>, mut commands: Commands) {
    if keys.with_control('s') {
        commands.queue(save);
    }
}

/// The folder that is named in the panel, or the one that is there at first.
fn named_folder(world: &World) -> String {
    let first = || world.resource::<OutFolder>().0.join("saved").to_string_lossy().into_owned();
    world.resource::<Folder>().0.clone().unwrap_or_else(first)
}

/// As the button does, where there is one.
fn save(world: &mut World) {
    let is_ready = matches!(*world.resource::<ScenarioStatus>(), ScenarioStatus::Ready);
    if !is_ready || is_busy(world) {
        return;
    }
    match obstacle(world) {
        Some(why) => world.resource_mut::<Note>().complain(why),
        None => {
            let folder = named_folder(world);
            begin(world, Path::new(folder.trim()));
        }
    }
}

/// Why the scene cannot be saved as it is.
pub(super) fn obstacle(world: &mut World) -> Option<&'static str> {
    if export::is_reading(world) {
        return Some("Wait until the scene is read for the export.");
    }
    // What stands for it has nothing in it, but its name.
    if world.resource::<Opening>().is_first() {
        return Some("Wait until the scene is there.");
    }
    if world.contains_resource::<Recording>() {
        return Some("End the recording first: it keeps moments of its own.");
    }
    if world.contains_resource::<Split>() {
        return Some("End the comparison first: the copy is no part of the scenario.");
    }
    let mut rain = world.query_filtered::<(), With<OwnRain>>();
    if rain.iter(world).next().is_some() {
        return Some("Switch the rain over the scene off: it is no part of the scenario.");
    }
    None
}

/// Buttons to save and to go on.
pub fn show(ui: &mut egui::Ui, world: &mut World) {
    ui.heading("The scene");
    let mut folder = named_folder(world);
    ui.horizontal(|ui| {
        ui.label("folder");
        ui.add(egui::TextEdit::singleline(&mut folder).desired_width(f32::INFINITY));
    });
    let path = PathBuf::from(folder.trim());
    world.resource_mut::<Folder>().0 = Some(folder);
    if is_busy(world) || export::is_reading(world) {
        ui.horizontal(|ui| {
            ui.spinner();
            ui.label("at work");
        });
        return;
    }
    if !matches!(*world.resource::<ScenarioStatus>(), ScenarioStatus::Ready) {
        return;
    }
    match obstacle(world) {
        Some(why) => {
            ui.label(why);
        }
        None => {
            if ui.button("Save").on_hover_text("Replaces what was saved there (Ctrl+S)").clicked() {
                begin(world, &path);
            }
        }
    }
    let is_there = !world.resource::<Opening>().is_first();
    let is_alone = !world.contains_resource::<Split>() && !world.contains_resource::<Recording>();
    let is_saved = is_there && is_alone && path.join("state.ron").is_file();
    if is_saved
        && ui.button("Go on from there").on_hover_text("Of the same scenario only").clicked()
        && let Err(error) = begin_restoring(world, &path)
    {
        world.resource_mut::<Note>().complain(error);
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::open;
    use super::*;

    #[test]
    fn what_stands_for_the_first_scene_is_not_saved_as_it() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios/hose.ron");
        let empty = open::without_content(&open::load(&file, None).unwrap());
        let mut world = World::new();
        world.init_resource::<export::Exporting>();
        world.init_resource::<Opening>();
        assert_eq!(obstacle(&mut world), None);
        open::begin(&mut world, empty);
        assert_eq!(obstacle(&mut world), Some("Wait until the scene is there."));
    }
}
