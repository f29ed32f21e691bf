//! The window's title says which scene it is, whether it loads, runs or stands still, and what is held back if the machine
//! cannot keep up.

use std::fmt::Write;

use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_weathering::overlay::SplatStats;
use bevy_weathering::overload::LiveLoad;
use bevy_weathering::scenario::ScenarioStatus;

use super::open::{Opened, Opening};

/// Seconds between two looks at the load: a title that flickers cannot be read.
const PATIENCE: f32 = 0.5;

pub fn plugin(app: &mut App) {
    app.add_systems(PostUpdate, name_window);
}

/// What the title says beside the name.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shown {
    state: &'static str,
    held_back: HeldBack,
}

/// What the machine cannot do.
#[derive(Debug, Clone, Copy, PartialEq)]
struct HeldBack {
    /// How fast weather time goes, %.
    speed_percent: u32,
    /// Of a thousand particles, how many are sent.
    particles_permille: u32,
    /// Thousands of splats that wait.
    splats_thousand: u64,
}

impl Default for HeldBack {
    fn default() -> Self {
        Self { speed_percent: 100, particles_permille: 1000, splats_thousand: 0 }
    }
}

impl HeldBack {
    fn new(load: &LiveLoad, splats: &SplatStats) -> Self {
        Self {
            speed_percent: (load.speed * 100.0).round() as u32,
            // Never none: that would read as if it had stopped.
            particles_permille: (load.governor.factor() * 1000.0).ceil() as u32,
            splats_thousand: splats.pending() / 1000,
        }
    }

    /// Begins with a comma, or is empty.
    fn text(self) -> String {
        let mut text = String::new();
        // Writing into a string cannot fail.
        if self.speed_percent < 95 {
            let _ = write!(text, ", time at {} %", self.speed_percent);
        }
        if self.particles_permille < 1000 {
            let percent = f64::from(self.particles_permille) / 10.0;
            let _ = write!(text, ", {percent} % of the particles");
        }
        if self.splats_thousand > 0 {
            let _ = write!(text, ", {} 000 splats wait", self.splats_thousand);
        }
        text
    }
}

fn name_window(
    opened: Res<Opened>,
    opening: Res<Opening>,
    status: Res<ScenarioStatus>,
    time: Res<Time<Virtual>>,
    real: Res<Time<Real>>,
    load: Res<LiveLoad>,
    splats: Res<SplatStats>,
    mut window: Single<&mut Window, With<PrimaryWindow>>,
    mut shown: Local<Option<Shown>>,
    mut looked_at: Local<f32>,
) {
    let state = match *status {
        ScenarioStatus::Ready if opening.is_first() => "opening",
        ScenarioStatus::Ready if time.is_paused() => "paused",
        ScenarioStatus::Ready => "running",
        ScenarioStatus::Failed(_) => "failed",
        ScenarioStatus::Loading => "loading",
    };
    let mut held_back = shown.map_or_else(HeldBack::default, |shown| shown.held_back);
    if real.elapsed_secs() - *looked_at >= PATIENCE {
        *looked_at = real.elapsed_secs();
        held_back = HeldBack::new(&load, &splats);
    }
    let now = Shown { state, held_back };
    if shown.replace(now) != Some(now) || opened.is_changed() {
        let file = opened.loaded.file.display();
        window.title = format!("weathering - {file}{} ({state})", held_back.text());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_held_back_is_told() {
        assert_eq!(HeldBack::default().text(), "");
        let all = HeldBack { speed_percent: 40, particles_permille: 8, splats_thousand: 1200 };
        assert_eq!(all.text(), ", time at 40 %, 0.8 % of the particles, 1200 000 splats wait");
        assert_eq!(HeldBack::new(&LiveLoad::default(), &SplatStats::default()), HeldBack::default());
    }
}
