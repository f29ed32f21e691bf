//! Opening scenes while the program runs: by the list, by a path, or dropped on the window.
//!
//! A scene is read on a thread of its own while the old one goes on; when all is there, it takes the old one's place. Not on those of
//! Bevy's pools: pipelines are compiled there, and there may be one only.

use std::path::{Path, PathBuf};
use std::thread::{JoinHandle, spawn};

use bevy::prelude::*;
use bevy::window::FileDragAndDrop;
use bevy_weathering::scenario::{
    LoadedScenario, PreparedScenario, Scenario, ScenarioStatus, TextureSpec, switch_scenario,
};

use super::leave::Leaving;
use super::ui::Note;
use super::undo::Undo;
use super::{export, model, record, saving, split};

/// What is open.
#[derive(Resource)]
pub struct Opened {
    /// The scenario, or that of a model by itself.
    pub loaded: LoadedScenario,
}

/// What is being opened.
#[derive(Resource, Default)]
pub struct Opening(Option<Coming>);

/// A scene that is being read.
struct Coming {
    file: PathBuf,
    thread: JoinHandle<Result<PreparedScenario, String>>,
    /// Nothing was there before it.
    is_first: bool,
}

impl Opening {
    /// The file that is being read.
    pub fn file(&self) -> Option<&Path> {
        self.0.as_ref().map(|coming| coming.file.as_path())
    }

    /// Whether that is what the program was started with.
    pub fn is_first(&self) -> bool {
        self.0.as_ref().is_some_and(|coming| coming.is_first)
    }
}

/// Whether it takes seconds until all of a scene is there: stones are grown, light is gathered from pictures.
pub fn is_slow(loaded: &LoadedScenario) -> bool {
    let scenario = &loaded.scenario;
    scenario.environment.is_some()
        || scenario.materials.values().any(|material| material.texture != TextureSpec::default())
}

/// The same scene with nothing in it.
pub fn without_content(loaded: &LoadedScenario) -> LoadedScenario {
    let mut empty = loaded.clone();
    let scenario = &mut empty.scenario;
    scenario.surfaces.clear();
    scenario.scenes.clear();
    scenario.materials.clear();
    scenario.emitters.clear();
    scenario.events.clear();
    scenario.environment = None;
    empty
}

/// Begins to make all of the first scene, in place of an empty one.
pub fn begin(world: &mut World, loaded: LoadedScenario) {
    let file = loaded.file.clone();
    let thread = spawn(move || PreparedScenario::new(loaded, true).map_err(|error| error.to_string()));
    world.resource_mut::<Opening>().0 = Some(Coming { file, thread, is_first: true });
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Opening>().add_systems(Update, (take_dropped, finish, tell_failure));
}

/// Reads a scenario, or makes the one of a model by itself.
///
/// # Errors
/// What is wrong, with the file.
pub fn load(file: &Path, variant: Option<&str>) -> Result<LoadedScenario, String> {
    let loaded = if model::is_model(file) {
        LoadedScenario::of_model(file)
    } else {
        Scenario::load_variant(file, variant)
    };
    loaded.map_err(|error| error.to_string())
}

/// Begins to open a file. One that is being opened already is given up.
pub fn open(world: &mut World, file: &Path) {
    let path = file.to_owned();
    let thread = spawn(move || {
        let loaded = load(&path, None)?;
        PreparedScenario::new(loaded, true).map_err(|error| error.to_string())
    });
    world.resource_mut::<Opening>().0 = Some(Coming { file: file.to_owned(), thread, is_first: false });
}

/// Shows what has been read.
fn finish(world: &mut World) {
    let Some(coming) = world.resource_mut::<Opening>().0.take() else { return };
    // Whoever leaves wants no other scene any more, but maybe this one saved.
    if !coming.thread.is_finished() || world.resource::<Leaving>().0 {
        world.resource_mut::<Opening>().0 = Some(coming);
        return;
    }
    let Coming { file, thread, is_first } = coming;
    let crashed = |_| Err(format!("{} could not be made", file.display()));
    match thread.join().unwrap_or_else(crashed) {
        Ok(prepared) => {
            let (loaded, is_model) = (prepared.scenario().clone(), model::is_model(&file));
            record::finish(world);
            saving::give_up(world);
            export::give_up(world);
            split::end(world);
            switch_scenario(world, prepared);
            world.resource_mut::<Undo>().clear();
            model::light_shade(world, is_model);
            world.insert_resource(Opened { loaded });
            world.resource_mut::<Note>().tell(format!("opened {}", file.display()));
        }
        Err(error) if is_first => {
            error!("{error}");
            world.write_message(AppExit::error());
        }
        Err(error) => world.resource_mut::<Note>().complain(error),
    }
}

/// Opens what is dropped on the window; of several files the last.
fn take_dropped(mut dropped: MessageReader<FileDragAndDrop>, mut commands: Commands) {
    let files = dropped.read().filter_map(|drop| match drop {
        FileDragAndDrop::DroppedFile { path_buf, .. } => Some(path_buf.clone()),
        _ => None,
    });
    if let Some(file) = files.last() {
        commands.queue(move |world: &mut World| open(world, &file));
    }
}

/// What cannot be shown ends the program if it was the first, and is told of later.
fn tell_failure(
    status: Res<ScenarioStatus>,
    mut note: ResMut<Note>,
    mut exit: MessageWriter<AppExit>,
    mut has_shown: Local<bool>,
) {
    if !status.is_changed() {
        return;
    }
    match &*status {
        ScenarioStatus::Ready => *has_shown = true,
        ScenarioStatus::Loading => {}
        ScenarioStatus::Failed(error) => {
            note.complain(error.to_string());
            if !*has_shown {
                exit.write(AppExit::error());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::saving::Saving;
    use super::*;

    #[test]
    fn scenes_of_stone_come_after_the_window_and_others_with_it() {
        let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios");
        let hose = load(&scenarios.join("hose.ron"), None).unwrap();
        assert!(is_slow(&hose));
        let empty = without_content(&hose);
        assert!(!is_slow(&empty) && empty.scenario.surface_count() == 0);
        assert_eq!(
            (&empty.file, empty.scenario.camera.keys.len()),
            (&hose.file, hose.scenario.camera.keys.len())
        );
        let model = load(&scenarios.join("../models/bunny_1000.glb"), None).unwrap();
        assert!(!is_slow(&model));
    }

    #[test]
    fn a_scene_that_comes_while_one_leaves_takes_nothing_from_what_is_being_saved() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios/hose.ron");
        let empty = without_content(&load(&file, None).unwrap());
        let prepared = PreparedScenario::new(empty, false).unwrap();
        let thread = spawn(move || Ok(prepared));
        while !thread.is_finished() {
            std::thread::yield_now();
        }
        let mut world = World::new();
        world.insert_resource(Opening(Some(Coming { file, thread, is_first: false })));
        world.insert_resource(Leaving(true));
        world.insert_resource(Saving::settling());
        finish(&mut world);
        assert!(world.resource::<Saving>().is_saving());
        // If the scene cannot be saved, nobody leaves, and the other one comes.
        assert!(world.resource::<Opening>().file().is_some());
    }

    #[test]
    fn what_cannot_be_opened_is_named() {
        for file in ["none/such.ron", "none/such.glb"] {
            let error = load(Path::new(file), None).unwrap_err();
            assert!(error.contains("such"), "{error}");
        }
        let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios/hose.ron");
        assert!(!load(&scenario, None).unwrap().scenario.surfaces.is_empty());
        let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/bunny_1000.glb");
        assert_eq!(load(&model, None).unwrap().scenario.surface_count(), 1);
    }
}
