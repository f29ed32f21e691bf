//! The frames that saving and going on take.

use std::path::Path;

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, futures::check_ready};
use bevy_weathering::clock::ShownTime;
use bevy_weathering::export::{ColorReadback, SurfaceColors};
use bevy_weathering::overlay::MapSize;
use bevy_weathering::record;
use bevy_weathering::save::{ColorMaps, SavedScene};
use bevy_weathering::scenario::{LoadedScenario, ScenarioSurface, reset_scenario};

use super::super::added;
use super::super::hose::InHand;
use super::super::leave::{Leaving, Unsaved};
use super::super::open::Opened;
use super::super::ui::Note;
use super::super::undo::Undo;
use super::{Purpose, SETTLE, Saving, Step, panel};

/// What of the sandbox's own is not to be saved, nor in the way of what was.
fn put_tools_away(world: &mut World) {
    let mut hoses = world.query_filtered::<Entity, With<InHand>>();
    for hose in hoses.iter(world).collect::<Vec<_>>() {
        world.despawn(hose);
    }
}

pub(super) fn begin(world: &mut World, folder: &Path) {
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
///
/// # Errors
/// What is wrong; then nothing has happened.
pub(super) fn begin_restoring(world: &mut World, folder: &Path) -> Result<(), String> {
    let scene = Box::new(SavedScene::read(folder).map_err(|error| error.to_string())?);
    // All scenarios have the same folder at first.
    let loaded = &world.resource::<Opened>().loaded;
    scene.check_scenario(loaded, folder).map_err(|error| error.to_string())?;
    if !scene.has_emitters() && added::is_any(world) {
        return Err("Remove the emitters that were added: it says nothing of emitters".into());
    }
    put_tools_away(world);
    world.resource_mut::<Time<Virtual>>().pause();
    reset_scenario(world);
    world.resource_mut::<Undo>().forget_strokes();
    world.insert_resource(ShownTime::Now);
    world.resource_mut::<Saving>().0 = Some(Step::Clearing { folder: folder.into(), scene, frames: SETTLE });
    Ok(())
}

fn restore(world: &mut World, folder: &Path, scene: &SavedScene) {
    // One may have been taken in hand since.
    put_tools_away(world);
    let scenario = world.resource::<Opened>().loaded.clone();
    let restored = scene.restore(world, &scenario, folder);
    // It was about the scene that was there.
    world.resource_mut::<Undo>().clear();
    if restored.is_ok() {
        world.resource_mut::<Unsaved>().0 = false;
    }
    let mut note = world.resource_mut::<Note>();
    match restored {
        Ok(()) => note.tell(format!("went on from {}, paused", folder.display())),
        Err(error) => note.complain(error.to_string()),
    }
}

/// The colour maps of all surfaces, in the order of the scenario; empty ones where nothing has been painted, and of those that have
/// no maps.
fn in_order(world: &mut World, SurfaceColors(read): SurfaceColors) -> Vec<ColorMaps> {
    let mut query = world.query::<(Entity, &ScenarioSurface, Option<&MapSize>)>();
    let mut all: Vec<(u32, ColorMaps)> = query
        .iter(world)
        .map(|(entity, surface, size)| {
            let found = read.iter().find(|(other, _)| *other == entity).map(|(_, colors)| colors.clone());
            let empty = || vec![0; size.map_or(0, MapSize::texels).pow(2) as usize * 4];
            let none = || ColorMaps { diffuse: empty(), specular: empty(), normal: empty() };
            (surface.index, found.unwrap_or_else(none))
        })
        .collect();
    all.sort_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, colors)| colors).collect()
}

pub(super) fn advance(world: &mut World) {
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
                    world.resource_mut::<Unsaved>().0 = true;
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
    // One may have been taken in hand since; time has stood still.
    put_tools_away(world);
    let scenario: LoadedScenario = world.resource::<Opened>().loaded.clone();
    let scene = match panel::obstacle(world) {
        // Somebody has been quick.
        Some(why) => Err(why.to_owned()),
        // Sliders have been at them.
        None => SavedScene::capture(world, &scenario, colors)
            .with_materials(world)
            .with_emitters(world)
            .map_err(|error| error.to_string()),
    };
    let scene = match scene {
        Ok(scene) => scene,
        Err(why) => {
            world.resource_mut::<Leaving>().0 = false;
            world.resource_mut::<Note>().complain(why);
            return None;
        }
    };
    // What is done from now on is not in it.
    world.resource_mut::<Unsaved>().0 = false;
    let to = folder.clone();
    let task = AsyncComputeTaskPool::get().spawn(async move { scene.write(&to) });
    Some(Step::Writing { folder, task })
}
