//! Recording what is done, as a scenario that replays to the same digest; going back in it, and branching off.
//!
//! A recording begins with the scene started over: what is open, as it is set, is written into a folder of its own and opened from
//! there, with the hose in the hand, the rain over the scene and emitters that were added as emitters of it. What is done then is
//! found and written down by the library's `record`; here are the buttons, the time bar, and the frames that going back takes.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use bevy_egui::egui;
use bevy_weathering::clock::{ShownTime, WeatheringClock};
use bevy_weathering::emitter::Emitter;
use bevy_weathering::record::{self, Beginning, RecordError, Recording};
use bevy_weathering::scenario::{
    Action, CameraKey, CameraMove, LoadedScenario, PreparedScenario, Scenario, ScenarioStatus, SceneEntity,
    switch_scenario,
};
use bevy_weathering::schedule::run_tick;

use super::camera::View;
use super::hose::{self, InHand};
use super::open::{Opened, Opening};
use super::settings::Settings;
use super::shortcuts::Shortcuts;
use super::shots::{OutFolder, free_name};
use super::split::Split;
use super::ui::{AddPanel, Note, Place};
use super::undo::Undo;
use super::weather::{self, OwnRain};
use super::{added, export, model, saving, theme};

/// Frames between starting over and putting a moment back, in which surfaces get their new, empty maps.
const SETTLE: u32 = 4;
/// How long a frame may run ticks to reach a second that is gone to.
const PATIENCE: Duration = Duration::from_millis(60);
/// Seconds between two keys of the camera.
const CAMERA_SECONDS: f64 = 0.5;

/// What the hose in the hand and the rain over the scene are called, if there are any. A recording of a recording has those of
/// the first, too, as emitters like others.
type Tools = [Option<String>; 2];

type Prepared = Result<(LoadedScenario, PreparedScenario, Tools), String>;

/// The base of a recording, while it is being written and read.
#[derive(Resource, Default)]
struct Preparing(Option<Task<Prepared>>);

/// On the way to another second.
#[derive(Resource, Default)]
struct Travel {
    /// So many frames until a moment is put back.
    frames: u32,
    /// Time goes on when it is reached.
    goes_on: bool,
    is_under_way: bool,
}

/// Where the time bar is being dragged to.
#[derive(Resource, Default)]
struct Bar(Option<f64>);

/// The last key of the camera.
#[derive(Resource, Default)]
struct LastView(Option<(f64, CameraMove)>);

pub fn plugin(app: &mut App) {
    app.add_plugins(record::RecordPlugin)
        .init_resource::<Preparing>()
        .init_resource::<Travel>()
        .init_resource::<Bar>()
        .init_resource::<LastView>()
        // No tick may run by itself on the way to another second.
        .add_systems(PreUpdate, stand_still)
        .add_systems(Update, (press, advance))
        .add_systems(Last, write_at_the_end)
        .add_panel(Place::Bar, "record", show_bar);
}

/// Whether the scene is on its way to another second: no tick runs then but those of the way.
pub fn is_travelling(world: &World) -> bool {
    world.resource::<Travel>().is_under_way
}

/// Whether time stands still only until another second is reached.
pub fn goes_on_later(world: &World) -> bool {
    let travel = world.resource::<Travel>();
    travel.is_under_way && travel.goes_on
}

/// On the way to another second: whether time goes on there is the other way round from now on.
pub fn toggle_later(world: &mut World) -> bool {
    let mut travel = world.resource_mut::<Travel>();
    if travel.is_under_way {
        travel.goes_on = !travel.goes_on;
    }
    travel.is_under_way
}

/// Whether a scene is on its way to the disk, and must not change.
fn is_busy(world: &World) -> bool {
    saving::is_busy(world) || export::is_reading(world)
}

fn stand_still(travel: Res<Travel>, mut time: ResMut<Time<Virtual>>) {
    if travel.is_under_way && !time.is_paused() {
        time.pause();
    }
}

fn press(keys: Res<Shortcuts>, mut commands: Commands) {
    if keys.pressed(KeyCode::F9) {
        commands.queue(toggle);
    }
}

/// Begins to record, or writes what was recorded and ends.
fn toggle(world: &mut World) {
    if world.contains_resource::<Recording>() {
        end_by_hand(world);
    } else {
        begin(world);
    }
}

/// Why nothing can be recorded.
fn obstacle(world: &World) -> Option<&'static str> {
    if world.contains_resource::<Split>() {
        return Some("End the comparison first: the copy is no part of the scenario.");
    }
    // What stands for the first scene has nothing in it.
    let is_there = matches!(world.resource::<ScenarioStatus>(), ScenarioStatus::Ready);
    if !is_there || world.resource::<Opening>().is_first() {
        return Some("Wait until the scene is there.");
    }
    if is_busy(world) {
        return Some("Wait until the scene is saved, or read for the export.");
    }
    None
}

/// Begins to write and read what a recording begins with.
fn begin(world: &mut World) {
    if world.resource::<Preparing>().0.is_some() {
        return;
    }
    if let Some(why) = obstacle(world) {
        world.resource_mut::<Note>().complain(why);
        return;
    }
    let mut beginning = Beginning::of(world);
    let mut views = world.query::<&View>();
    beginning.view = views.iter(world).next().map(|view| {
        let (eye, target) = view.line();
        CameraKey { t: 0.0, eye, target }
    });
    let added = match added::to_record(world) {
        Ok(added) => added,
        Err(why) => return world.resource_mut::<Note>().complain(why),
    };
    let tools = [hose::to_record(&world.resource::<Settings>().hose), weather::to_record(world)];
    let loaded = world.resource::<Opened>().loaded.clone();
    let mut behind = loaded.scenario.emitters.len()..;
    let places = tools.each_ref().map(|tool| tool.as_ref().and_then(|_| behind.next()));
    beginning.emitters = tools.into_iter().flatten().chain(added).collect();
    let folder: PathBuf = free_name(&world.resource::<OutFolder>().0, "recorded", "");
    let task = AsyncComputeTaskPool::get().spawn(async move {
        let base = record::prepare(&loaded, beginning, &folder).map_err(|error| error.to_string())?;
        // Where their names were taken, they have got others.
        let tools = places.map(|place| Some(base.scenario.emitters.get(place?)?.name.clone()));
        let prepared = PreparedScenario::new(base.clone(), true).map_err(|error| error.to_string())?;
        Ok::<_, String>((base, prepared, tools))
    });
    world.resource_mut::<Preparing>().0 = Some(task);
}

/// Shows the base and records from its first tick on.
fn start(world: &mut World, base: LoadedScenario, prepared: PreparedScenario, tools: &Tools) {
    // They are emitters of the scenario from now on.
    let mut own = world.query_filtered::<Entity, Or<(With<InHand>, With<OwnRain>)>>();
    for tool in own.iter(world).collect::<Vec<_>>() {
        world.despawn(tool);
    }
    switch_scenario(world, prepared);
    // It was about the scene that was there.
    world.resource_mut::<Undo>().clear();
    model::light_shade(world, false);
    let mut emitters = world.query_filtered::<(Entity, &Name), (With<Emitter>, With<SceneEntity>)>();
    let [hose, rain] = tools.each_ref().map(|tool| {
        let name = tool.as_deref()?;
        emitters.iter(world).find(|(_, other)| other.as_str() == name).map(|(emitter, _)| emitter)
    });
    if let Some(hose) = hose {
        world.entity_mut(hose).insert(InHand);
    }
    if let Some(rain) = rain {
        world.entity_mut(rain).insert(OwnRain);
    }
    world.insert_resource(Opened { loaded: base.clone() });
    let told = format!("recording into {}", base.file.display());
    record::begin(world, base);
    world.insert_resource(LastView::default());
    world.resource_mut::<Note>().tell(told);
}

/// Ends it, unless it cannot be written: then it goes on, and somebody may make room.
fn end_by_hand(world: &mut World) {
    match record::save(world) {
        Ok(_) => finish(world),
        Err(error) => world.resource_mut::<Note>().complain(format!("{error}; the recording goes on")),
    }
}

/// Writes what is being recorded, if anything is, and ends. What was about to begin does not.
pub fn finish(world: &mut World) {
    world.resource_mut::<Preparing>().0 = None;
    if !world.contains_resource::<Recording>() {
        return;
    }
    saving::give_up_moment(world);
    let file = write(world);
    added::keep_stays(world);
    record::end(world);
    // It is what runs, and what is saved from now on fits the file as it is now.
    match file.map(|file| Scenario::load(&file)) {
        Some(Ok(loaded)) => world.resource_mut::<Opened>().loaded = loaded,
        Some(Err(error)) => world.resource_mut::<Note>().complain(error.to_string()),
        None => {}
    }
    let travel = std::mem::take(&mut *world.resource_mut::<Travel>());
    if travel.is_under_way && travel.goes_on {
        world.resource_mut::<Time<Virtual>>().unpause();
    }
    // They stay, as emitters of the scenario like others. Nobody would close a hose that nobody holds.
    let mut hoses = world.query_filtered::<&mut Emitter, (With<SceneEntity>, With<InHand>)>();
    hoses.iter_mut(world).for_each(|mut hose| hose.enabled = false);
    let mut tools = world.query_filtered::<Entity, (With<SceneEntity>, Or<(With<InHand>, With<OwnRain>)>)>();
    for tool in tools.iter(world).collect::<Vec<_>>() {
        world.entity_mut(tool).remove::<(InHand, OwnRain)>();
    }
    weather::let_go(world);
}

/// Writes what was recorded so far; the file, unless it could not be written.
fn write(world: &mut World) -> Option<PathBuf> {
    let flaws = world.resource::<Recording>().flaws().count();
    let written = record::save(world);
    let mut note = world.resource_mut::<Note>();
    match &written {
        Ok(file) if flaws == 0 => note.tell(format!("recorded {}", file.display())),
        Ok(file) => note.complain(format!("recorded {}, but it will not replay as it was", file.display())),
        Err(error) => note.complain(error.to_string()),
    }
    written.ok()
}

fn write_at_the_end(mut exits: MessageReader<AppExit>, mut commands: Commands) {
    if exits.read().count() > 0 {
        commands.queue(finish);
    }
}

/// Goes to a second that has been recorded.
pub fn travel(world: &mut World, seconds: f64) {
    let gone = if is_busy(world) { Err(RecordError::Busy) } else { record::go_to(world, seconds) };
    match gone {
        Ok(()) => set_out(world),
        Err(error) => world.resource_mut::<Note>().complain(error.to_string()),
    }
}

/// Runs the session again without the last stroke.
pub fn take_back_stroke(world: &mut World) {
    let taken = if is_busy(world) { Err(RecordError::Busy) } else { record::take_back_stroke(world) };
    match taken {
        // It was only about to be painted.
        Ok(true) if world.resource::<Recording>().is_live() => {
            world.resource_mut::<Note>().tell("took a stroke back");
        }
        Ok(true) => set_out(world),
        Ok(false) => world.resource_mut::<Note>().tell("no stroke to take back"),
        Err(error) => world.resource_mut::<Note>().complain(error.to_string()),
    }
}

fn set_out(world: &mut World) {
    let mut time = world.resource_mut::<Time<Virtual>>();
    let goes_on = !time.is_paused();
    time.pause();
    world.insert_resource(Travel { frames: SETTLE, goes_on, is_under_way: true });
    world.insert_resource(ShownTime::Now);
}

fn advance(world: &mut World) {
    if let Some(mut task) = world.resource_mut::<Preparing>().0.take() {
        match check_ready(&mut task) {
            None => world.resource_mut::<Preparing>().0 = Some(task),
            Some(Ok((base, prepared, tools))) => match obstacle(world) {
                // Something else was opened meanwhile.
                Some(why) => world.resource_mut::<Note>().complain(why),
                None => start(world, base, prepared, &tools),
            },
            Some(Err(error)) => world.resource_mut::<Note>().complain(error),
        }
    }
    let Some(mut recording) = world.get_resource_mut::<Recording>() else { return };
    let notes = recording.take_notes();
    let (is_clearing, is_catching_up, wants_moment) =
        (recording.is_clearing(), recording.is_catching_up(), recording.wants_moment());
    for note in notes {
        world.resource_mut::<Note>().complain(note);
    }
    if is_clearing {
        clear(world);
    } else if is_catching_up {
        catch_up(world);
    } else if world.resource::<Travel>().is_under_way {
        arrive(world);
    } else if wants_moment && !export::is_reading(world) {
        keep_moment(world);
    } else {
        follow_view(world);
    }
}

fn clear(world: &mut World) {
    let mut travel = world.resource_mut::<Travel>();
    travel.frames = travel.frames.saturating_sub(1);
    if travel.frames == 0
        && let Err(error) = record::put_back(world)
    {
        world.resource_mut::<Note>().complain(error.to_string());
    }
}

/// Runs ticks for as long as a frame may take.
fn catch_up(world: &mut World) {
    let begun = Instant::now();
    while begun.elapsed() < PATIENCE && world.resource::<Recording>().is_catching_up() {
        let before = world.resource::<WeatheringClock>().tick();
        run_tick(world);
        if world.resource::<WeatheringClock>().tick() == before {
            // It is held until what waits has been painted.
            return;
        }
    }
}

fn arrive(world: &mut World) {
    let travel = std::mem::take(&mut *world.resource_mut::<Travel>());
    if travel.goes_on {
        world.resource_mut::<Time<Virtual>>().unpause();
    }
    let seconds = world.resource::<WeatheringClock>().seconds();
    world.resource_mut::<Note>().tell(format!("at second {seconds:.2}"));
}

/// Keeps a moment, and writes what was recorded, so that little is lost with a program that is killed.
fn keep_moment(world: &mut World) {
    match record::colors_at_hand(world) {
        Some(colors) => {
            if let Err(error) = record::keep_moment(world, colors) {
                world.resource_mut::<Note>().complain(error.to_string());
            }
        }
        None => saving::keep_moment(world),
    }
    if let Err(error) = record::save(world) {
        world.resource_mut::<Note>().complain(error.to_string());
    }
}

/// Where it was seen from, now and then: replays are seen from there, too.
fn follow_view(world: &mut World) {
    let seconds = world.resource::<WeatheringClock>().seconds();
    let last = world.resource::<LastView>().0;
    if last.is_some_and(|(at, _)| (at..at + CAMERA_SECONDS).contains(&seconds)) {
        return;
    }
    let mut views = world.query::<&View>();
    let Some((eye, target)) = views.iter(world).next().map(View::line) else { return };
    let view = CameraMove { eye, target };
    if last.is_none_or(|(_, last)| last != view) {
        world.resource_mut::<Recording>().add(Action::Camera(view));
    }
    world.resource_mut::<LastView>().0 = Some((seconds, view));
}

/// The button, and the time bar of a recording.
fn show_bar(ui: &mut egui::Ui, world: &mut World) {
    let is_preparing = world.resource::<Preparing>().0.is_some();
    let Some(recording) = world.get_resource::<Recording>() else {
        let button = ui.add_enabled(!is_preparing, egui::Button::new("Record"));
        let about = "Starts the scene over, and writes down what is done (F9)";
        if button.on_hover_text(about).clicked() {
            begin(world);
        }
        return;
    };
    let (end, is_flawed, is_live) =
        (recording.seconds(), recording.flaws().next().is_some(), recording.is_live());
    if ui.button("End").on_hover_text("Writes what was recorded (F9)").clicked() {
        end_by_hand(world);
        return;
    }
    let text = egui::RichText::new(format!("rec {end:.1} s"));
    ui.label(if is_flawed { text.color(theme::WARNING) } else { text });
    if !is_live || is_travelling(world) {
        ui.spinner();
        return;
    }
    let now = world.resource::<WeatheringClock>().seconds();
    let mut at = world.resource::<Bar>().0.unwrap_or(now);
    let slider = egui::Slider::new(&mut at, 0.0..=end.max(0.1)).show_value(false);
    let about = "Drag to go to a second that is recorded; what you do there is a branch";
    let slider = ui.add(slider).on_hover_text(about);
    world.resource_mut::<Bar>().0 = slider.dragged().then_some(at);
    if slider.drag_stopped() || (slider.changed() && !slider.dragged()) {
        travel(world, at.min(end));
    }
}

/// What is known of the recording.
pub fn show(ui: &mut egui::Ui, world: &mut World) {
    ui.heading("Recording");
    let Some(recording) = world.get_resource::<Recording>() else {
        match obstacle(world) {
            Some(why) => ui.label(why),
            None => ui.label("Record, in the bar above, starts the scene over and writes down what is done."),
        };
        return;
    };
    ui.small(recording.file().display().to_string());
    let (moments, bytes) = recording.moments();
    ui.label(format!("{} things done in {:.1} s", recording.len(), recording.seconds()));
    ui.label(format!("{moments} moments kept, {} MiB", bytes >> 20));
    for (at, flaw) in recording.flaws() {
        ui.colored_label(theme::WARNING, format!("{at:.1} s: {flaw}; it will not replay as it was"));
    }
    if ui.button("Write now").on_hover_text("And go on recording").clicked() {
        write(world);
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use bevy_weathering::weather::Weather;

    use super::*;

    #[test]
    fn a_recording_that_cannot_be_written_goes_on() {
        let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios/hose.ron");
        let mut base = Scenario::load(&scenario).unwrap();
        let folder = tempfile::tempdir().unwrap();
        // Where its folder was there is a file.
        let place = folder.path().join("recorded_000");
        std::fs::write(&place, "").unwrap();
        base.file = place.join("hose_recorded.ron");
        let mut world = World::new();
        world.init_resource::<WeatheringClock>();
        world.init_resource::<Weather>();
        world.init_resource::<Note>();
        record::begin(&mut world, base);
        toggle(&mut world);
        assert!(world.contains_resource::<Recording>());
        let (told, is_wrong) = world.resource::<Note>().shown().unwrap();
        assert!(is_wrong && told.ends_with("the recording goes on"), "{told}");
    }
}
