//! Leaving: by the key, by the window's button, or because nothing can be drawn any more. Never while a scene is on its way to the
//! disk. The key is near others, and closes what is in front, too: where something would be lost it has to be pressed twice.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::render::error_handler::{RenderError, RenderErrorHandler, RenderErrorPolicy};
use bevy::window::WindowCloseRequested;
use bevy_weathering::record::Recording;
use bevy_weathering::replay::describe_render_error;

use super::export::Exporting;
use super::hose::Pointed;
use super::open::Opened;
use super::saving::Saving;
use super::settings::{Settings, Tool};
use super::shortcuts::Shortcuts;
use super::ui::{Help, Note, UiInput};

/// The program ends as soon as nothing is being saved or exported.
#[derive(Resource, Default)]
pub struct Leaving(pub bool);

/// Whether something has been sprayed or painted that no saved scene has.
#[derive(Resource, Default)]
pub struct Unsaved(pub bool);

/// How long the key is remembered to have been pressed.
const PATIENCE: Duration = Duration::from_secs(15);

pub fn plugin(app: &mut App) {
    app.init_resource::<Leaving>()
        .init_resource::<Unsaved>()
        .insert_resource(RenderErrorHandler(give_up))
        .add_systems(Update, (notice.run_if(resource_exists::<Opened>), press, close).chain())
        .add_systems(PostUpdate, leave)
        .add_systems(Last, finish_writing);
}

/// Follows whether there is something to lose. That a scene is saved is told by those who do it.
fn notice(
    pointed: Res<Pointed>,
    settings: Res<Settings>,
    opened: Res<Opened>,
    recording: Option<Res<Recording>>,
    mut unsaved: ResMut<Unsaved>,
) {
    // A recording is written anyhow.
    if pointed.held && recording.is_none() && settings.tool != Tool::Probe {
        unsaved.0 = true;
    }
    if opened.is_changed() {
        unsaved.0 = false;
    }
}

fn press(
    keys: Res<Shortcuts>,
    input: Res<UiInput>,
    unsaved: Res<Unsaved>,
    saving: Res<Saving>,
    mut help: ResMut<Help>,
    mut note: ResMut<Note>,
    mut leaving: ResMut<Leaving>,
    mut exit: MessageWriter<AppExit>,
    mut asked: Local<Option<Instant>>,
) {
    if !keys.pressed(KeyCode::Escape) || input.popup {
        return;
    }
    let is_lost = unsaved.0 && !saving.will_take() && !leaving.0;
    // What is in front goes first.
    if help.0 {
        help.0 = false;
    } else if is_lost && !asked.is_some_and(|asked| asked.elapsed() < PATIENCE) {
        *asked = Some(Instant::now());
        note.complain("Escape once more leaves; what was done is not saved (Ctrl+S)");
    } else {
        ask(&mut leaving, &mut exit);
    }
}

fn close(
    mut closed: MessageReader<WindowCloseRequested>,
    mut leaving: ResMut<Leaving>,
    mut exit: MessageWriter<AppExit>,
) {
    if closed.read().count() > 0 {
        ask(&mut leaving, &mut exit);
    }
}

/// Whoever asks a second time does not want to wait for maps that may never come.
fn ask(leaving: &mut Leaving, exit: &mut MessageWriter<AppExit>) {
    if leaving.0 {
        exit.write(AppExit::Success);
    }
    leaving.0 = true;
}

fn leave(
    leaving: Res<Leaving>,
    saving: Res<Saving>,
    exporting: Res<Exporting>,
    mut note: ResMut<Note>,
    mut exit: MessageWriter<AppExit>,
) {
    if !leaving.0 {
        return;
    }
    if !saving.is_saving() && !exporting.is_exporting() {
        exit.write(AppExit::Success);
    } else if leaving.is_changed() {
        let done = if saving.is_saving() { "saved" } else { "exported" };
        note.tell(format!("leaves when the scene is {done}"));
    }
}

/// However it ends: the threads that write would end with the program.
fn finish_writing(
    mut exits: MessageReader<AppExit>,
    mut saving: ResMut<Saving>,
    mut exporting: ResMut<Exporting>,
) {
    if exits.read().count() > 0 {
        saving.finish();
        exporting.finish();
    }
}

/// Ends the program in place of showing the same picture for ever. No schedule runs any more after that.
fn give_up(error: &RenderError, main_world: &mut World, _render_world: &mut World) -> RenderErrorPolicy {
    error!("{}; nothing can be drawn any more", describe_render_error(error));
    if let Some(mut saving) = main_world.get_resource_mut::<Saving>() {
        saving.finish();
    }
    if let Some(mut exporting) = main_world.get_resource_mut::<Exporting>() {
        exporting.finish();
    }
    main_world.write_message(AppExit::error());
    RenderErrorPolicy::StopRendering
}
