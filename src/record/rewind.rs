//! Going back in a session.

use bevy::prelude::*;

use super::session::Phase;
use super::{RecordError, Recording};
use crate::clock::WeatheringClock;
use crate::overlay::{CpuMaps, MapSize, Overlays, SurfaceTraces};
use crate::save::{ColorMaps, SavedScene};
use crate::scenario::{ScenarioSurface, reset_scenario};

/// Colour maps of all surfaces, in the order of the scenario, as far as they are in main memory: all of them in an app without a
/// renderer, and where nothing has been painted yet. `None` if they have to be read back from the GPU.
pub fn colors_at_hand(world: &mut World) -> Option<Vec<ColorMaps>> {
    let mut surfaces = world.query::<(
        &ScenarioSurface,
        Option<&SurfaceTraces>,
        Option<&Overlays>,
        Option<&CpuMaps>,
        Option<&MapSize>,
    )>();
    let mut all = Vec::new();
    for (surface, traces, overlays, cpu, size) in surfaces.iter(world) {
        let is_painted = traces.is_some_and(|traces| traces.paint);
        let colors = match (cpu, overlays) {
            (Some(cpu), _) => ColorMaps {
                diffuse: cpu.diffuse.as_flattened().to_vec(),
                specular: cpu.specular.as_flattened().to_vec(),
                normal: cpu.normal.as_flattened().to_vec(),
            },
            (None, Some(_)) if is_painted => return None,
            (None, Some(_)) => ColorMaps::default(),
            (None, None) => {
                let empty = || vec![0; 4 * size.map_or(0, MapSize::texels).pow(2) as usize];
                ColorMaps { diffuse: empty(), specular: empty(), normal: empty() }
            }
        };
        all.push((surface.index, colors));
    }
    all.sort_by_key(|(index, _)| *index);
    Some(all.into_iter().map(|(_, colors)| colors).collect())
}

/// Keeps the moment between two ticks, to be gone back to. `colors`: the colour maps of all surfaces, in the order of the
/// scenario; see [`colors_at_hand`].
///
/// # Errors
/// [`RecordError::NotRecording`], [`RecordError::Busy`].
pub fn keep_moment(world: &mut World, colors: Vec<ColorMaps>) -> Result<(), RecordError> {
    let recording = world.get_resource::<Recording>().ok_or(RecordError::NotRecording)?;
    if !recording.is_live() {
        return Err(RecordError::Busy);
    }
    let loaded = recording.loaded.clone();
    let scene = SavedScene::capture(world, &loaded, colors);
    if let Some(mut recording) = world.get_resource_mut::<Recording>() {
        recording.history.keep(scene);
    }
    Ok(())
}

/// Begins to go to a second that has been recorded: takes the scene back to its start. Then a frame or more without a tick has to
/// go by, in which everybody sees that; then [`put_back`]; then ticks run as long as [`Recording::is_catching_up`], as fast as
/// they can. No others may run in between.
///
/// # Errors
/// [`RecordError::NotRecorded`], [`RecordError::NotRecording`], [`RecordError::Busy`]; then nothing has happened.
pub fn go_to(world: &mut World, seconds: f64) -> Result<(), RecordError> {
    let recording = world.get_resource::<Recording>().ok_or(RecordError::NotRecording)?;
    let target = (seconds * f64::from(recording.hz())).round();
    // Written so that NaN fails.
    if !(target >= 0.0 && target <= f64::from(recording.end)) {
        return Err(RecordError::NotRecorded { seconds, recorded: recording.seconds() });
    }
    go_to_tick(world, target as u32)
}

fn go_to_tick(world: &mut World, target: u32) -> Result<(), RecordError> {
    let Some(mut recording) = world.remove_resource::<Recording>() else {
        return Err(RecordError::NotRecording);
    };
    let is_live = recording.is_live();
    if is_live {
        recording.forget_wishes();
        reset_scenario(world);
        recording.watched.look(world);
        recording.tick = 0;
        recording.phase = Phase::Clearing { target };
    }
    world.insert_resource(recording);
    if is_live { Ok(()) } else { Err(RecordError::Busy) }
}

/// Puts the last kept moment before the second back that is [gone to](go_to).
///
/// # Errors
/// [`RecordError::NotRecording`]; [`RecordError::Busy`] if nothing waits for it; [`RecordError::Save`] if a moment does not fit any
/// more: then the way leads from the start.
pub fn put_back(world: &mut World) -> Result<(), RecordError> {
    let Some(mut recording) = world.remove_resource::<Recording>() else {
        return Err(RecordError::NotRecording);
    };
    let Phase::Clearing { target } = recording.phase else {
        world.insert_resource(recording);
        return Err(RecordError::Busy);
    };
    let scene = recording.history.before(target);
    let restored = scene
        .map_or(Ok(()), |scene| scene.restore(world, &recording.loaded, recording.loaded.file.as_path()));
    recording.watched.look(world);
    recording.tick = world.resource::<WeatheringClock>().tick();
    recording.phase = if recording.tick >= target { Phase::Live } else { Phase::CatchingUp { target } };
    world.insert_resource(recording);
    restored.map_err(RecordError::from)
}

/// Takes the last stroke of a brush back: the session is gone through again, from before it to the present, without it. Goes on as
/// [`go_to`] does; or, if all of it still waits for the next tick, it is dropped, and the session stays
/// [live](Recording::is_live). `false` if there is none.
///
/// # Errors
/// As [`go_to`].
pub fn take_back_stroke(world: &mut World) -> Result<bool, RecordError> {
    let Some(mut recording) = world.remove_resource::<Recording>() else {
        return Err(RecordError::NotRecording);
    };
    recording.number_touches(world);
    let (now, is_live, last) = (recording.tick, recording.is_live(), recording.last_stroke());
    let first = recording.actions.iter().find(|action| Some(action.stroke) == last).map(|first| first.tick);
    if let (Some(stroke), true) = (last, is_live) {
        // Those of an earlier stroke may go on waiting.
        recording.drop_touches(world, stroke);
    }
    if let (Some(stroke), Some(first), true) = (last, first, is_live) {
        recording.actions.retain(|action| action.stroke != stroke);
        recording.history.forget_after(first.saturating_sub(1));
        recording.update_events(world);
    }
    world.insert_resource(recording);
    // Nothing has come of what was not painted yet.
    let has_acted = first.is_some();
    if last.is_some() && (has_acted || !is_live) {
        go_to_tick(world, now)?;
    }
    Ok(last.is_some())
}
