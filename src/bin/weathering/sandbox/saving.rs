//! Saving the scene into a folder and going on from one, with `src/save`.
//!
//! Colour maps live on the GPU: time is paused, they are read back, and then all is written on another thread. What has been
//! saved here is a scenario's state and goes on in `weathering replay --resume`, too; so nothing of the sandbox's own may be in
//! it.

use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, block_on, futures::check_ready};
use bevy_egui::egui;
use bevy_weathering::clock::ShownTime;
use bevy_weathering::export::{ColorReadback, SurfaceColors};
use bevy_weathering::overlay::Overlays;
use bevy_weathering::particle::Particles;
use bevy_weathering::record::{self, Recording};
use bevy_weathering::save::{ColorMaps, SaveError, SavedScene};
use bevy_weathering::scenario::{LoadedScenario, ScenarioStatus, ScenarioSurface, reset_scenario};

use super::added;
use super::export;
use super::hose::InHand;
use super::leave::Leaving;
use super::open::Opened;
use super::shots::OutFolder;
use super::split::Split;
use super::ui::{Note, keyboard_is_free};
use super::weather::OwnRain;

/// Frames between pausing and reading, in which the last splats are painted.
const SETTLE: u32 = 4;

/// The folder that is named in the panel.
#[derive(Resource, Default)]
struct Folder(Option<String>);

/// What the state that is taken is for.
enum Purpose {
    /// A folder.
    Folder(PathBuf),
    /// A moment of a session that is recorded; time goes on then, if it did before.
    Moment { goes_on: bool },
}

/// A scene that is being saved, or gone on with.
#[derive(Resource, Default)]
pub struct Saving(Option<Step>);

enum Step {
    /// So many frames until the maps are read.
    Settling {
        purpose: Purpose,
        frames: u32,
    },
    Reading {
        purpose: Purpose,
        colors: ColorReadback,
    },
    /// So many frames until surfaces that were reset have their new, empty maps.
    Clearing {
        folder: PathBuf,
        scene: Box<SavedScene>,
        frames: u32,
    },
    /// On another thread.
    Writing {
        folder: PathBuf,
        task: Task<Result<(), SaveError>>,
    },
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Folder>()
        .init_resource::<Saving>()
        .add_systems(Update, (press.run_if(keyboard_is_free), advance).chain());
}

impl Saving {
    /// A scene is on its way to the disk.
    pub fn is_saving(&self) -> bool {
        matches!(self.0, Some(Step::Settling { .. } | Step::Reading { .. } | Step::Writing { .. }))
    }

    /// Waits for what is being written; what is not that far yet is given up.
    pub fn finish(&mut self) {
        if let Some(Step::Writing { folder, task }) = self.0.take() {
            match block_on(task) {
                Ok(()) => info!("saved {}", folder.display()),
                Err(error) => error!("{error}"),
            }
        }
    }
}

fn press(keys: Res<ButtonInput<KeyCode>>, mut commands: Commands) {
    // Also where a slow frame has seen it pressed and let go of.
    let control = [KeyCode::ControlLeft, KeyCode::ControlRight];
    if (keys.any_pressed(control) || keys.any_just_pressed(control)) && keys.just_pressed(KeyCode::KeyS) {
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

/// Whether a scene is being saved, or gone on with.
pub fn is_busy(world: &World) -> bool {
    world.resource::<Saving>().0.is_some()
}

/// Whether the scene has to stay as it is, or is being put back: what is on its way to the disk already may be left behind.
pub fn is_taking(world: &World) -> bool {
    let step = &world.resource::<Saving>().0;
    matches!(step, Some(Step::Settling { .. } | Step::Reading { .. } | Step::Clearing { .. }))
}

/// Whether time stands still only until a moment is kept.
pub fn goes_on_later(world: &World) -> bool {
    matches!(
        world.resource::<Saving>().0,
        Some(
            Step::Settling { purpose: Purpose::Moment { goes_on: true }, .. }
                | Step::Reading { purpose: Purpose::Moment { goes_on: true }, .. }
        )
    )
}

/// If time stands still for a moment that is kept: whether it goes on then is the other way round from now on.
pub fn toggle_later(world: &mut World) -> bool {
    let mut saving = world.resource_mut::<Saving>();
    let (Some(Step::Settling { purpose, .. }) | Some(Step::Reading { purpose, .. })) = &mut saving.0 else {
        return false;
    };
    let Purpose::Moment { goes_on } = purpose else { return false };
    *goes_on = !*goes_on;
    true
}

/// Another scene takes the place of this one: what is not taken of it yet never will be.
pub fn give_up(world: &mut World) {
    give_up_moment(world);
    if is_taking(world) {
        world.resource_mut::<Saving>().0 = None;
        world.resource_mut::<Note>().complain("not saved, or gone on with: another scene was opened");
    }
}

/// Why the scene cannot be saved as it is.
fn obstacle(world: &mut World) -> Option<&'static str> {
    if export::is_reading(world) {
        return Some("Wait until the scene is read for the export.");
    }
    let rows = world.resource::<Opened>().effects;
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
    if added::is_any(world) {
        return Some("Remove the emitters that were added: they are no part of the scenario.");
    }
    let particles = world.resource::<Particles>().effects();
    let is_strange = particles.iter().any(|effect| usize::from(effect.0) >= rows);
    is_strange.then_some("Wait until what the hose in the hand has sprayed has landed.")
}

/// Buttons to save and to go on.
pub fn show(ui: &mut egui::Ui, world: &mut World) {
    ui.heading("The scene");
    let mut folder = named_folder(world);
    ui.horizontal(|ui| {
        ui.label("folder");
        ui.text_edit_singleline(&mut folder);
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
    let is_alone = !world.contains_resource::<Split>()
        && !world.contains_resource::<Recording>()
        && !added::is_any(world);
    let is_saved = is_alone && path.join("state.ron").is_file();
    if is_saved
        && ui.button("Go on from there").on_hover_text("Of the same scenario only").clicked()
        && let Err(error) = begin_restoring(world, &path)
    {
        world.resource_mut::<Note>().complain(error.to_string());
    }
}

/// What of the sandbox's own is not to be saved, nor in the way of what was.
fn put_tools_away(world: &mut World) {
    let mut hoses = world.query_filtered::<Entity, With<InHand>>();
    for hose in hoses.iter(world).collect::<Vec<_>>() {
        world.despawn(hose);
    }
}

fn begin(world: &mut World, folder: &Path) {
    if let Err(error) = SavedScene::check_folder(folder) {
        world.resource_mut::<Note>().complain(error.to_string());
        return;
    }
    put_tools_away(world);
    world.resource_mut::<Time<Virtual>>().pause();
    world.resource_mut::<Saving>().0 =
        Some(Step::Settling { purpose: Purpose::Folder(folder.into()), frames: SETTLE });
}

/// Keeps this moment of the session that is recorded, once its colour maps are read back; time stands still until then.
pub fn keep_moment(world: &mut World) {
    if world.resource::<Saving>().0.is_some() {
        return;
    }
    let mut time = world.resource_mut::<Time<Virtual>>();
    let goes_on = !time.is_paused();
    time.pause();
    world.resource_mut::<Saving>().0 =
        Some(Step::Settling { purpose: Purpose::Moment { goes_on }, frames: SETTLE });
}

/// Gives up to keep a moment.
pub fn give_up_moment(world: &mut World) {
    let mut saving = world.resource_mut::<Saving>();
    let (Some(Step::Settling { purpose, .. }) | Some(Step::Reading { purpose, .. })) = &saving.0 else {
        return;
    };
    let Purpose::Moment { goes_on } = *purpose else { return };
    saving.0 = None;
    if goes_on {
        world.resource_mut::<Time<Virtual>>().unpause();
    }
}

/// Reads a scene, and takes this one back to its beginning.
fn begin_restoring(world: &mut World, folder: &Path) -> Result<(), SaveError> {
    let scene = Box::new(SavedScene::read(folder)?);
    put_tools_away(world);
    world.resource_mut::<Time<Virtual>>().pause();
    reset_scenario(world);
    world.insert_resource(ShownTime::Now);
    world.resource_mut::<Saving>().0 = Some(Step::Clearing { folder: folder.into(), scene, frames: SETTLE });
    Ok(())
}

fn restore(world: &mut World, folder: &Path, scene: &SavedScene) {
    let scenario = world.resource::<Opened>().loaded.clone();
    let restored = scene.restore(world, &scenario, folder);
    let mut note = world.resource_mut::<Note>();
    match restored {
        Ok(()) => note.tell(format!("went on from {}, paused", folder.display())),
        Err(error) => note.complain(error.to_string()),
    }
}

/// The colour maps of all surfaces that have maps, in the order of the scenario; empty ones where nothing has been painted.
fn in_order(world: &mut World, SurfaceColors(read): SurfaceColors) -> Vec<ColorMaps> {
    let mut query = world.query::<(Entity, &ScenarioSurface, &Overlays)>();
    let mut all: Vec<(u32, ColorMaps)> = query
        .iter(world)
        .map(|(entity, surface, overlays)| {
            let found = read.iter().find(|(other, _)| *other == entity).map(|(_, colors)| colors.clone());
            let empty = || vec![0; overlays.size.pow(2) as usize * 4];
            let none = || ColorMaps { diffuse: empty(), specular: empty(), normal: empty() };
            (surface.index, found.unwrap_or_else(none))
        })
        .collect();
    all.sort_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, colors)| colors).collect()
}

fn advance(world: &mut World) {
    let Some(step) = world.resource_mut::<Saving>().0.take() else { return };
    let next = match step {
        Step::Settling { purpose, frames: 0 } => {
            Some(Step::Reading { purpose, colors: ColorReadback::begin(world) })
        }
        Step::Settling { purpose, frames } => {
            let frames = if ColorReadback::is_painted(world) { frames - 1 } else { SETTLE };
            Some(Step::Settling { purpose, frames })
        }
        Step::Reading { purpose, colors } if colors.is_done() => {
            let colors = in_order(world, colors.finish());
            take(world, purpose, colors)
        }
        Step::Reading { purpose, colors } => Some(Step::Reading { purpose, colors }),
        Step::Clearing { folder, scene, frames: 0 } => {
            restore(world, &folder, &scene);
            None
        }
        Step::Clearing { folder, scene, frames } => {
            Some(Step::Clearing { folder, scene, frames: frames - 1 })
        }
        Step::Writing { folder, mut task } => match check_ready(&mut task) {
            None => Some(Step::Writing { folder, task }),
            Some(written) => {
                if written.is_err() {
                    // There may be another folder to save it into.
                    world.resource_mut::<Leaving>().0 = false;
                }
                let mut note = world.resource_mut::<Note>();
                match written {
                    Ok(()) => note.tell(format!("saved {}", folder.display())),
                    Err(error) => note.complain(error.to_string()),
                }
                None
            }
        },
    };
    world.resource_mut::<Saving>().0 = next;
}

/// Takes the state, and keeps it or has it written.
fn take(world: &mut World, purpose: Purpose, colors: Vec<ColorMaps>) -> Option<Step> {
    let folder = match purpose {
        Purpose::Folder(folder) => folder,
        Purpose::Moment { goes_on } => {
            if let Err(error) = record::keep_moment(world, colors) {
                world.resource_mut::<Note>().complain(error.to_string());
            }
            if goes_on {
                world.resource_mut::<Time<Virtual>>().unpause();
            }
            return None;
        }
    };
    let scenario: LoadedScenario = world.resource::<Opened>().loaded.clone();
    // Sliders have been at them.
    let scene = SavedScene::capture(world, &scenario, colors).with_materials(world);
    let to = folder.clone();
    let task = AsyncComputeTaskPool::get().spawn(async move { scene.write(&to) });
    Some(Step::Writing { folder, task })
}

#[cfg(test)]
mod tests {
    use bevy::window::WindowCloseRequested;

    use super::super::leave;
    use super::super::ui::{Help, UiInput};
    use super::*;

    fn app() -> App {
        let mut app = App::new();
        app.add_message::<WindowCloseRequested>()
            .init_resource::<ButtonInput<KeyCode>>()
            .init_resource::<UiInput>()
            .init_resource::<Help>()
            .init_resource::<Note>()
            .init_resource::<Saving>();
        leave::plugin(&mut app);
        app
    }

    fn close(app: &mut App) {
        app.world_mut().write_message(WindowCloseRequested { window: Entity::PLACEHOLDER });
        app.update();
    }

    fn settling() -> Saving {
        Saving(Some(Step::Settling { purpose: Purpose::Folder("saved".into()), frames: SETTLE }))
    }

    #[test]
    fn a_window_that_is_closed_while_a_scene_is_saved_stays_until_it_is() {
        let mut app = app();
        app.insert_resource(settling());
        close(&mut app);
        for _ in 0..3 {
            assert_eq!(app.should_exit(), None);
            app.update();
        }
        app.insert_resource(Saving(None));
        app.update();
        assert_eq!(app.should_exit(), Some(AppExit::Success));
    }

    #[test]
    fn who_insists_leaves_at_once_and_without_anything_to_save_so_does_everyone() {
        for (saving, times) in [(settling(), 2), (Saving(None), 1)] {
            let mut app = app();
            app.insert_resource(saving);
            for _ in 0..times {
                assert_eq!(app.should_exit(), None);
                close(&mut app);
            }
            assert_eq!(app.should_exit(), Some(AppExit::Success));
        }
    }

    #[test]
    fn escape_closes_a_list_that_is_in_front_before_it_leaves() {
        let mut app = app();
        app.insert_resource(UiInput { popup: true, ..default() });
        app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(KeyCode::Escape);
        app.update();
        assert_eq!(app.should_exit(), None);
        app.insert_resource(UiInput::default());
        app.update();
        assert_eq!(app.should_exit(), Some(AppExit::Success));
    }

    #[test]
    fn a_pause_while_a_moment_is_kept_comes_after_it() {
        let mut world = World::new();
        let purpose = Purpose::Moment { goes_on: true };
        world.insert_resource(Saving(Some(Step::Settling { purpose, frames: SETTLE })));
        assert!(is_taking(&world) && goes_on_later(&world));
        assert!(toggle_later(&mut world) && !goes_on_later(&world));
        assert!(toggle_later(&mut world) && goes_on_later(&world));
        // What is saved into a folder stays paused then.
        world.insert_resource(settling());
        assert!(is_taking(&world) && !toggle_later(&mut world) && !goes_on_later(&world));
    }

    #[test]
    fn of_a_scene_that_another_has_replaced_nothing_is_saved() {
        let mut world = World::new();
        world.init_resource::<Note>();
        world.insert_resource(settling());
        give_up(&mut world);
        assert!(!is_busy(&world));
    }

    #[test]
    fn the_program_does_not_end_before_a_file_that_is_being_written() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("late");
        let to = file.clone();
        let pool = AsyncComputeTaskPool::get_or_init(Default::default);
        let task = pool.spawn(async move {
            std::thread::sleep(std::time::Duration::from_millis(200));
            std::fs::write(to, "whole").map_err(|source| SaveError::Write { path: "late".into(), source })
        });
        let mut app = app();
        app.insert_resource(Saving(Some(Step::Writing { folder: folder.path().into(), task })));
        // In the way of a signal or a lost device, which wait for nothing.
        app.world_mut().write_message(AppExit::error());
        app.update();
        assert_eq!(std::fs::read_to_string(file).unwrap(), "whole");
    }
}
