//! Opening scenes while the program runs: by the list, by a path, or dropped on the window.
//!
//! A scene is read on another thread while the old one goes on; when all is there, it takes the old one's place.

use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use bevy::window::FileDragAndDrop;
use bevy_weathering::effect::EffectTable;
use bevy_weathering::scenario::{
    LoadedScenario, PreparedScenario, Scenario, ScenarioStatus, switch_scenario,
};

use super::ui::Note;
use super::{export, model, record, saving, split};

/// What is open.
#[derive(Resource)]
pub struct Opened {
    /// The scenario, or that of a model by itself.
    pub loaded: LoadedScenario,
    /// Rows of the effect table that belong to it.
    pub effects: usize,
}

/// What is being opened.
#[derive(Resource, Default)]
pub struct Opening(Option<(PathBuf, Task<Result<PreparedScenario, String>>)>);

impl Opening {
    /// The file that is being read.
    pub fn file(&self) -> Option<&Path> {
        self.0.as_ref().map(|(file, _)| file.as_path())
    }
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
    let task = AsyncComputeTaskPool::get().spawn(async move {
        let loaded = load(&path, None)?;
        PreparedScenario::new(loaded, true).map_err(|error| error.to_string())
    });
    world.resource_mut::<Opening>().0 = Some((file.to_owned(), task));
}

/// Shows what has been read.
fn finish(world: &mut World) {
    let Some((file, mut task)) = world.resource_mut::<Opening>().0.take() else { return };
    match check_ready(&mut task) {
        None => world.resource_mut::<Opening>().0 = Some((file, task)),
        Some(Ok(prepared)) => {
            let (loaded, is_model) = (prepared.scenario().clone(), model::is_model(&file));
            record::finish(world);
            saving::give_up(world);
            export::give_up(world);
            split::end(world);
            switch_scenario(world, prepared);
            model::light_shade(world, is_model);
            let effects = world.resource::<EffectTable>().rows().len();
            world.insert_resource(Opened { loaded, effects });
            world.resource_mut::<Note>().tell(format!("opened {}", file.display()));
        }
        Some(Err(error)) => world.resource_mut::<Note>().complain(error),
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
    use super::*;

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
