//! Exporting the scene as it is now, for other engines, with `src/export`: by a button, or by X.
//!
//! Time stands still until what has been painted is read back. Then it goes on, while the scene is baked and written on another
//! thread.

use std::path::PathBuf;

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, block_on, futures::check_ready};
use bevy_egui::egui;
use bevy_weathering::export::{ColorReadback, ExportError, Snapshot};
use bevy_weathering::scenario::ScenarioStatus;

use super::leave::Leaving;
use super::open::Opened;
use super::shortcuts::Shortcuts;
use super::shots::{OutFolder, free_name};
use super::split::Split;
use super::ui::Note;
use super::{record, saving};

/// Frames that time stands still before anything is read.
const SETTLE: u32 = 4;

/// A scene that is being exported.
#[derive(Resource, Default)]
pub struct Exporting(Option<Step>);

enum Step {
    /// So many frames until the maps are read. `goes_on`: time ran before.
    Settling { frames: u32, goes_on: bool },
    /// On their way from the GPU.
    Reading { colors: ColorReadback, goes_on: bool },
    /// On another thread; the file that it becomes.
    Writing(Task<Result<PathBuf, ExportError>>),
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Exporting>().add_systems(Update, (key, advance).chain());
}

impl Exporting {
    /// A scene is on its way to the disk.
    pub fn is_exporting(&self) -> bool {
        self.0.is_some()
    }

    /// Waits for what is being written; what is not that far yet is given up.
    pub fn finish(&mut self) {
        if let Some(Step::Writing(task)) = self.0.take() {
            match block_on(task) {
                Ok(scene) => info!("exported {}", scene.display()),
                Err(error) => error!("{error}"),
            }
        }
    }

    /// As it is right after the key.
    #[cfg(test)]
    pub fn settling() -> Self {
        Self(Some(Step::Settling { frames: SETTLE, goes_on: false }))
    }

    /// As it is while another thread is at it.
    #[cfg(test)]
    pub fn writing(task: Task<Result<PathBuf, ExportError>>) -> Self {
        Self(Some(Step::Writing(task)))
    }
}

/// Whether the scene has to stay as it is.
pub fn is_reading(world: &World) -> bool {
    matches!(world.resource::<Exporting>().0, Some(Step::Settling { .. } | Step::Reading { .. }))
}

/// Whether time stands still only until it is read.
pub fn goes_on_later(world: &World) -> bool {
    matches!(
        world.resource::<Exporting>().0,
        Some(Step::Settling { goes_on: true, .. } | Step::Reading { goes_on: true, .. })
    )
}

/// If time stands still until it is read: whether it goes on then is the other way round from now on.
pub fn toggle_later(world: &mut World) -> bool {
    let mut exporting = world.resource_mut::<Exporting>();
    let (Some(Step::Settling { goes_on, .. }) | Some(Step::Reading { goes_on, .. })) = &mut exporting.0
    else {
        return false;
    };
    *goes_on = !*goes_on;
    true
}

/// Another scene takes the place of this one: what is not read of it yet never will be.
pub fn give_up(world: &mut World) {
    let mut exporting = world.resource_mut::<Exporting>();
    let (Some(Step::Settling { goes_on, .. }) | Some(Step::Reading { goes_on, .. })) = exporting.0 else {
        return;
    };
    exporting.0 = None;
    if goes_on {
        world.resource_mut::<Time<Virtual>>().unpause();
    }
    world.resource_mut::<Note>().complain("not exported: another scene was opened");
}

/// The button.
pub fn show(ui: &mut egui::Ui, world: &mut World) {
    ui.heading("For other engines");
    if world.resource::<Exporting>().0.is_some() {
        ui.horizontal(|ui| {
            ui.spinner();
            ui.label("at work");
        });
        return;
    }
    match obstacle(world) {
        Some(why) => {
            ui.label(why);
        }
        None => {
            let about = "The surfaces as they are now, dry and wet, as a .glb with its maps and a report (X)";
            if ui.button("Export").on_hover_text(about).clicked() {
                begin(world);
            }
        }
    }
    ui.small(format!("into {}", world.resource::<OutFolder>().0.display()));
}

/// Why the scene cannot be exported now.
fn obstacle(world: &World) -> Option<&'static str> {
    if !matches!(*world.resource::<ScenarioStatus>(), ScenarioStatus::Ready) {
        return Some("The scene is not there yet.");
    }
    if world.contains_resource::<Split>() {
        return Some("End the comparison first: the copy is no part of the scene.");
    }
    if record::is_travelling(world) {
        return Some("Wait until the second is reached.");
    }
    saving::is_busy(world).then_some("Wait until the scene is saved.")
}

fn key(keys: Res<Shortcuts>, mut commands: Commands) {
    if keys.pressed(KeyCode::KeyX) {
        commands.queue(begin);
    }
}

fn begin(world: &mut World) {
    if world.resource::<Exporting>().0.is_some() {
        return;
    }
    if let Some(why) = obstacle(world) {
        world.resource_mut::<Note>().complain(why);
        return;
    }
    let mut time = world.resource_mut::<Time<Virtual>>();
    let goes_on = !time.is_paused();
    time.pause();
    world.resource_mut::<Exporting>().0 = Some(Step::Settling { frames: SETTLE, goes_on });
}

fn advance(world: &mut World) {
    let Some(step) = world.resource_mut::<Exporting>().0.take() else { return };
    let next = match step {
        Step::Settling { frames: 0, goes_on } => {
            Some(Step::Reading { colors: ColorReadback::begin(world), goes_on })
        }
        Step::Settling { frames, goes_on } => {
            let frames = if ColorReadback::is_painted(world) { frames - 1 } else { SETTLE };
            Some(Step::Settling { frames, goes_on })
        }
        Step::Reading { colors, goes_on } if colors.is_done() => write(world, &colors, goes_on),
        Step::Reading { colors, goes_on } => Some(Step::Reading { colors, goes_on }),
        Step::Writing(mut task) => match check_ready(&mut task) {
            None => Some(Step::Writing(task)),
            Some(written) => {
                match written {
                    Ok(scene) => {
                        world.resource_mut::<Note>().tell(format!("exported {}", scene.display()));
                    }
                    Err(error) => fail(world, &error),
                }
                None
            }
        },
    };
    world.resource_mut::<Exporting>().0 = next;
}

/// Whoever was about to leave may want to mend what is wrong first.
fn fail(world: &mut World, error: &ExportError) {
    world.resource_mut::<Leaving>().0 = false;
    world.resource_mut::<Note>().complain(error.to_string());
}

/// Takes the state, lets time go on, and has the scene made.
fn write(world: &mut World, colors: &ColorReadback, goes_on: bool) -> Option<Step> {
    let file = world.resource::<Opened>().loaded.file.clone();
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let taken = Snapshot::take(world, &name, &colors.finish());
    if goes_on {
        world.resource_mut::<Time<Virtual>>().unpause();
    }
    let snapshot = match taken {
        Ok(snapshot) => snapshot,
        Err(error) => {
            fail(world, &error);
            return None;
        }
    };
    let folder = free_name(&world.resource::<OutFolder>().0, "export", "");
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let task = AsyncComputeTaskPool::get()
        .spawn(async move { snapshot.bake(None)?.write(&folder, &stem).map(|[scene, _]| scene) });
    Some(Step::Writing(task))
}
