//! Time: pause, one tick, speed, and the time that is shown.
//!
//! A frame may spend only so long on ticks. What takes longer at the speed that was asked for goes slower, and says so; the
//! window answers all the same.

use std::time::Instant;

use bevy::app::{RunFixedMainLoop, RunFixedMainLoopSystems};
use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::clock::{ShownTime, WeatheringClock};
use bevy_weathering::record::Recording;
use bevy_weathering::scenario::{ScenarioStatus, reset_scenario};
use bevy_weathering::schedule::WeatheringTick;

use super::ui::{AddPanel, Note, Place, keyboard_is_free};
use super::{record, theme};

/// Slowest and fastest.
const SPEEDS: (f64, f64) = (0.1, 100.0);
/// Seconds of ticks in a frame.
pub const BUDGET: f64 = 0.1;
/// What virtual time follows of a frame, at most, seconds; Bevy's default.
const LONGEST_FRAME: f64 = 0.25;

/// How fast weather goes by.
#[derive(Resource)]
pub struct Pace {
    /// Times as fast as in the world.
    wanted: f64,
    /// It goes slower than wanted.
    held_back: bool,
    /// Seconds that a tick takes, of late.
    pub tick_seconds: f64,
    begun: Option<(Instant, u32)>,
}

impl Default for Pace {
    fn default() -> Self {
        Self { wanted: 1.0, held_back: false, tick_seconds: 0.0, begun: None }
    }
}

/// The fastest that ticks of this cost may go by, if one stands for `tick` seconds of weather and a frame takes `frame`: at
/// least one tick a frame. Seconds, all of them.
fn fastest(cost: f64, tick: f64, frame: f64) -> f64 {
    let ticks = (BUDGET / cost.max(1e-9)).max(1.0);
    ticks * tick / frame.clamp(1e-3, LONGEST_FRAME)
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Pace>()
        .add_systems(
            RunFixedMainLoop,
            (
                begin.in_set(RunFixedMainLoopSystems::BeforeFixedMainLoop),
                keep_pace.in_set(RunFixedMainLoopSystems::AfterFixedMainLoop),
            ),
        )
        .add_systems(Update, (pause, step).run_if(keyboard_is_free))
        .add_panel(Place::Bar, "time", show);
}

fn begin(clock: Res<WeatheringClock>, mut pace: ResMut<Pace>) {
    pace.begun = Some((Instant::now(), clock.tick()));
}

fn keep_pace(
    clock: Res<WeatheringClock>,
    real: Res<Time<Real>>,
    mut pace: ResMut<Pace>,
    mut time: ResMut<Time<Virtual>>,
) {
    let Some((begun, first)) = pace.begun.take() else { return };
    let ticks = clock.tick().saturating_sub(first);
    if ticks > 0 {
        let cost = begun.elapsed().as_secs_f64() / f64::from(ticks);
        // One slow tick is no reason, the second is.
        pace.tick_seconds += (cost - pace.tick_seconds) * 0.3;
    }
    let most = fastest(pace.tick_seconds, f64::from(clock.delta_secs()), real.delta_secs_f64());
    pace.held_back = most < pace.wanted;
    time.set_relative_speed_f64(pace.wanted.min(most));
}

fn pause(keys: Res<ButtonInput<KeyCode>>, mut commands: Commands) {
    if keys.just_pressed(KeyCode::Space) {
        commands.queue(toggle);
    }
}

fn step(keys: Res<ButtonInput<KeyCode>>, mut commands: Commands) {
    if keys.just_pressed(KeyCode::KeyN) {
        commands.queue(one_tick);
    }
}

/// Pauses, or goes on, once the scene is there.
fn toggle(world: &mut World) {
    if !matches!(*world.resource::<ScenarioStatus>(), ScenarioStatus::Ready) || record::is_travelling(world) {
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
    if matches!(*world.resource::<ScenarioStatus>(), ScenarioStatus::Ready) && !record::is_travelling(world) {
        world.resource_mut::<Time<Virtual>>().pause();
        world.run_schedule(WeatheringTick);
    }
}

/// Dry, at the first tick.
pub fn start_over(world: &mut World) {
    if world.contains_resource::<Recording>() {
        record::travel(world, 0.0);
        return;
    }
    reset_scenario(world);
    world.insert_resource(ShownTime::Now);
    world.resource_mut::<Note>().tell("started over");
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    let is_ready = matches!(*world.resource::<ScenarioStatus>(), ScenarioStatus::Ready);
    if !is_ready {
        ui.spinner();
        ui.label("loading");
        return;
    }
    let is_paused = world.resource::<Time<Virtual>>().is_paused();
    let (label, about) = if is_paused { ("Run", "Go on (Space)") } else { ("Pause", "Stand still (Space)") };
    if ui.button(label).on_hover_text(about).clicked() {
        toggle(world);
    }
    if ui.button("Step").on_hover_text("One tick (N)").clicked() {
        one_tick(world);
    }
    if ui.button("Start over").on_hover_text("Dry, at the first tick (R)").clicked() {
        start_over(world);
    }
    let mut pace = world.resource_mut::<Pace>();
    let speed = egui::Slider::new(&mut pace.wanted, SPEEDS.0..=SPEEDS.1).logarithmic(true).suffix(" x");
    ui.add(speed).on_hover_text("How many times faster weather goes by than in the world");
    if pace.held_back && !is_paused {
        let reached = world.resource::<Time<Virtual>>().relative_speed_f64();
        let text = egui::RichText::new(format!("held at {reached:.2} x")).color(theme::WARNING);
        ui.label(text).on_hover_text("Ticks take longer than a frame has for them");
    }
    show_time(ui, world);
}

/// The time that is shown: the present, or another.
fn show_time(ui: &mut egui::Ui, world: &mut World) {
    let now = world.resource::<WeatheringClock>().seconds();
    let shown = *world.resource::<ShownTime>();
    let mut at = match shown {
        ShownTime::Now => now,
        ShownTime::At(seconds) => seconds,
    };
    // So far ahead that what is wet has dried.
    let end = (now + 600.0).max(at) * 1.2;
    let slider = egui::Slider::new(&mut at, 0.0..=end).logarithmic(true).smallest_positive(1.0).suffix(" s");
    // Decimals that are cut off would count as changes.
    let slider = ui.add(slider.custom_formatter(|seconds, _| format!("{seconds:.1}")));
    let slider =
        slider.on_hover_text("The time that is shown: as it was, and as it will be if nothing happens");
    if slider.changed() {
        world.insert_resource(ShownTime::At(at));
    }
    if shown != ShownTime::Now && ui.button("Now").on_hover_text("Show the present").clicked() {
        world.insert_resource(ShownTime::Now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_dear_goes_slower_but_never_stops() {
        // 60 ticks a second, 60 frames a second: a tick of a millisecond may run a hundred times a frame.
        let speed = |cost: f64, frame: f64| fastest(cost, 1.0 / 60.0, frame);
        assert!((speed(1e-3, 1.0 / 60.0) - 100.0).abs() < 1e-6);
        assert!((speed(0.05, 1.0 / 60.0) - 2.0).abs() < 1e-6);
        // A tick that takes ten seconds: one a frame.
        assert!((speed(10.0, LONGEST_FRAME) * LONGEST_FRAME - 1.0 / 60.0).abs() < 1e-9);
        for (cost, frame) in [(0.0, 0.0), (0.0, 1e9), (1e9, 0.0)] {
            let speed = speed(cost, frame);
            assert!(speed.is_finite() && speed > 0.0, "{cost} {frame}: {speed}");
        }
    }
}
