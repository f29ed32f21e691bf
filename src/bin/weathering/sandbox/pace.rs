//! Time: pause, one tick, speed, and the time that is shown.
//!
//! The speed is Bevy's, of virtual time. That a frame may spend only so long on ticks, and what becomes of speeds that would take
//! longer, is the library's [`LiveBudget`](bevy_weathering::overload::LiveBudget); here it is only told.

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::clock::{ShownTime, WeatheringClock};
use bevy_weathering::overload::LiveLoad;
use bevy_weathering::record::Recording;
use bevy_weathering::scenario::{ScenarioStatus, reset_scenario};
use bevy_weathering::schedule::WeatheringTick;

use super::shortcuts::Shortcuts;
use super::ui::{AddPanel, Note, Place};
use super::undo::Undo;
use super::{export, record, saving, theme};

/// Slowest and fastest.
const SPEEDS: (f64, f64) = (0.1, 100.0);
/// Milliseconds of ticks in a frame.
pub const BUDGET_MS: f32 = 100.0;
/// Below this part of the speed that was asked for, it is told.
const HELD_BACK: f32 = 0.95;

pub fn plugin(app: &mut App) {
    app.add_systems(Update, (pause, step, hurry)).add_panel(Place::Bar, "time", show);
}

/// Twice or half as fast, within [`SPEEDS`].
fn hurry(keys: Res<Shortcuts>, mut time: ResMut<Time<Virtual>>, mut note: ResMut<Note>) {
    let pressed = |key| i32::from(keys.pressed(key));
    let steps = pressed(KeyCode::Period) - pressed(KeyCode::Comma);
    if steps != 0 {
        let speed = stepped(time.relative_speed_f64(), steps);
        time.set_relative_speed_f64(speed);
        note.tell(format!("{speed:.2} times as fast as in the world"));
    }
}

/// A speed so many doublings faster.
fn stepped(speed: f64, doublings: i32) -> f64 {
    let faster = speed * 2f64.powi(doublings);
    // Not past the speed of the world, nor beside it by what was rounded.
    let faster = if (faster - 1.0).abs() < 0.05 { 1.0 } else { faster };
    faster.clamp(SPEEDS.0, SPEEDS.1)
}

fn pause(keys: Res<Shortcuts>, mut commands: Commands) {
    if keys.pressed(KeyCode::Space) {
        commands.queue(toggle);
    }
}

fn step(keys: Res<Shortcuts>, mut commands: Commands) {
    if keys.pressed(KeyCode::KeyN) {
        commands.queue(one_tick);
    }
}

/// Whether no tick may run now but those of whoever holds time.
fn is_held(world: &World) -> bool {
    !matches!(*world.resource::<ScenarioStatus>(), ScenarioStatus::Ready)
        || record::is_travelling(world)
        || saving::is_taking(world)
        || export::is_reading(world)
}

/// Pauses, or goes on, once the scene is there. Where time is held, it goes on, or does not, when that is over.
fn toggle(world: &mut World) {
    if record::toggle_later(world)
        || saving::toggle_later(world)
        || export::toggle_later(world)
        || is_held(world)
    {
        return;
    }
    let mut time = world.resource_mut::<Time<Virtual>>();
    if time.is_paused() {
        time.unpause();
    } else {
        time.pause();
    }
}

/// One tick, and no other after it.
fn one_tick(world: &mut World) {
    if is_held(world) {
        return;
    }
    world.resource_mut::<Time<Virtual>>().pause();
    world.run_schedule(WeatheringTick);
    let clock = world.resource::<WeatheringClock>();
    let told = format!("tick {}, {:.3} s", clock.tick(), clock.seconds());
    world.resource_mut::<Note>().tell(told);
}

/// Dry, at the first tick.
pub fn start_over(world: &mut World) {
    if world.contains_resource::<Recording>() {
        record::travel(world, 0.0);
        return;
    }
    if saving::is_taking(world) || export::is_reading(world) {
        world.resource_mut::<Note>().complain("wait until the scene is saved, or read for the export");
        return;
    }
    reset_scenario(world);
    world.insert_resource(ShownTime::Now);
    // What they were painted on is no more, and neither are they.
    let is_final = world.resource_mut::<Undo>().forget_strokes();
    let told = if is_final { "started over; strokes can no longer be taken back" } else { "started over" };
    world.resource_mut::<Note>().tell(told);
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    let is_ready = matches!(*world.resource::<ScenarioStatus>(), ScenarioStatus::Ready);
    // They stay where they are: a bar of another height would move all panels below it.
    if !is_ready {
        ui.disable();
    }
    let goes_on_later =
        record::goes_on_later(world) || saving::goes_on_later(world) || export::goes_on_later(world);
    let is_paused = world.resource::<Time<Virtual>>().is_paused() && !goes_on_later;
    let (label, about) = if is_paused { ("Run", "Go on (Space)") } else { ("Pause", "Stand still (Space)") };
    if ui.button(label).on_hover_text(about).clicked() {
        toggle(world);
    }
    if ui.button("Step").on_hover_text("One tick (N)").clicked() {
        one_tick(world);
    }
    let about = if world.contains_resource::<Recording>() {
        "To second 0 of the recording (R)"
    } else {
        "Dry, at the first tick; strokes go, too, and cannot be taken back then (R)"
    };
    if ui.button("Start over").on_hover_text(about).clicked() {
        start_over(world);
    }
    // There is little room in the bar.
    ui.spacing_mut().slider_width = 80.0;
    ui.label("speed");
    let mut speed = world.resource::<Time<Virtual>>().relative_speed_f64();
    let slider = egui::Slider::new(&mut speed, SPEEDS.0..=SPEEDS.1).logarithmic(true).suffix(" x");
    // Decimals that are cut off would count as changes.
    let slider = ui.add(slider.custom_formatter(|speed, _| format!("{speed:.2}")));
    let about = "How many times faster weather goes by than in the world (, and .)";
    if slider.on_hover_text(about).changed() {
        world.resource_mut::<Time<Virtual>>().set_relative_speed_f64(speed.clamp(SPEEDS.0, SPEEDS.1));
    }
    show_time(ui, world);
}

/// That the speed that was asked for is not reached. At the end of the bar: it comes and goes, and nothing is to move with it.
pub fn show_load(ui: &mut egui::Ui, world: &World) {
    let time = world.resource::<Time<Virtual>>();
    let part = world.resource::<LiveLoad>().speed;
    let is_ready = matches!(*world.resource::<ScenarioStatus>(), ScenarioStatus::Ready);
    if part < HELD_BACK && is_ready && !time.is_paused() {
        let text = format!("held at {:.2} x", time.relative_speed_f64() * f64::from(part));
        let text = egui::RichText::new(text).color(theme::WARNING);
        ui.label(text).on_hover_text("Ticks, or drawing, take longer than there is time for");
    }
}

/// The time that is shown: the present, or another.
fn show_time(ui: &mut egui::Ui, world: &mut World) {
    let now = world.resource::<WeatheringClock>().seconds();
    let shown = *world.resource::<ShownTime>();
    let mut at = match shown {
        ShownTime::Now => now,
        ShownTime::At(seconds) => seconds,
    };
    // What is shown takes its end no farther: held there it would run away. What dries later can be typed.
    let end = ((now + 600.0) * 1.2).max(at);
    let slider = egui::Slider::new(&mut at, 0.0..=end).logarithmic(true).smallest_positive(1.0).suffix(" s");
    let slider = slider.clamping(egui::SliderClamping::Never);
    // Decimals that are cut off would count as changes.
    ui.label("time");
    let slider = ui.add(slider.custom_formatter(|seconds, _| format!("{seconds:.1}")));
    let about = "The time that is shown: as it was, and as it will be if nothing happens; what is farther ahead \
                 can be typed";
    if slider.on_hover_text(about).changed() {
        world.insert_resource(ShownTime::At(typed(at)));
    }
    if shown != ShownTime::Now && ui.button("Now").on_hover_text("Show the present").clicked() {
        world.insert_resource(ShownTime::Now);
    }
}

/// Seconds after the start: what is typed may be anything.
fn typed(seconds: f64) -> f64 {
    if seconds.is_finite() { seconds.max(0.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame of the slider of the shown time, with what the mouse does in it.
    fn shown(context: &egui::Context, world: &mut World, events: Vec<egui::Event>) -> ShownTime {
        let size = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(400.0, 300.0));
        let input = egui::RawInput { screen_rect: Some(size), events, ..Default::default() };
        let output = context.run_ui(input, |ui| {
            ui.horizontal(|ui| show_time(ui, world));
        });
        output.drop_without_applying_deltas();
        *world.resource::<ShownTime>()
    }

    #[test]
    fn the_shown_time_stays_where_its_slider_is_held() {
        let mut world = World::new();
        world.insert_resource(WeatheringClock::new(60));
        world.insert_resource(ShownTime::Now);
        let context = egui::Context::default();
        // On the slider, behind its label; and past its end.
        let (pos, beyond) = (egui::pos2(80.0, 13.0), egui::pos2(390.0, 13.0));
        let pressed = egui::Event::PointerButton {
            pos,
            button: egui::PointerButton::Primary,
            pressed: true,
            modifiers: egui::Modifiers::NONE,
        };
        shown(&context, &mut world, vec![]);
        shown(&context, &mut world, vec![egui::Event::PointerMoved(pos)]);
        shown(&context, &mut world, vec![pressed]);
        let held = shown(&context, &mut world, vec![egui::Event::PointerMoved(beyond)]);
        assert!(matches!(held, ShownTime::At(seconds) if seconds > 600.0), "{held:?}");
        for _ in 0..10 {
            assert_eq!(shown(&context, &mut world, vec![]), held);
        }
        // What is farther ahead stays, too, and is not pulled back.
        world.insert_resource(ShownTime::At(7200.0));
        let context = egui::Context::default();
        for _ in 0..3 {
            assert_eq!(shown(&context, &mut world, vec![]), ShownTime::At(7200.0));
        }
        assert_eq!([f64::NAN, f64::INFINITY, -3.0, 7200.0].map(typed), [0.0, 0.0, 0.0, 7200.0]);
    }

    #[test]
    fn steps_of_speed_stay_in_range_and_come_back_to_the_worlds() {
        assert_eq!((stepped(1.0, 1), stepped(1.0, -1)), (2.0, 0.5));
        let down = (0..20).fold(1.0, |speed, _| stepped(speed, -1));
        assert_eq!(down, SPEEDS.0);
        let up = (0..20).fold(down, |speed, _| stepped(speed, 1));
        assert_eq!(up, SPEEDS.1);
        // 0.1, 0.2, 0.4, 0.8, 1.6, ... and 1.04, 0.52.
        assert_eq!(stepped(0.52, 1), 1.0);
        assert_eq!(stepped(2.0, -1), 1.0);
    }
}
