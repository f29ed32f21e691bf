//! What happens, over time: frames and ticks, particles and hits, and where the water is.

use std::collections::VecDeque;
use std::time::Instant;

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::particle::{ParticleCounts, WaterCounts};
use bevy_weathering::wetting::{SurfaceWater, WettingStats};
use egui_plot::{Legend, Line, Plot, PlotPoints};

use super::pace::Pace;
use super::ui::{AddPanel, Place};

/// Seconds between two samples.
const EVERY: f64 = 0.1;
/// Samples that are kept: a minute.
const KEPT: usize = 600;

/// What is measured; each is a line.
const LINES: [(&str, Chart); 11] = [
    ("frame, ms", Chart::Time),
    ("tick, ms", Chart::Time),
    ("ticks a frame", Chart::Time),
    ("in flight", Chart::Particles),
    ("hits/s", Chart::Particles),
    ("tiles that run/s", Chart::Particles),
    ("sent out, ml", Chart::Water),
    ("came to surfaces, ml", Chart::Water),
    ("on them and in them, ml", Chart::Water),
    ("evaporated, ml", Chart::Water),
    ("dripped or run off, ml", Chart::Water),
];

/// Which lines are in one picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Chart {
    Time,
    Particles,
    Water,
}

/// The samples of the last minute.
#[derive(Resource)]
struct History {
    begun: Instant,
    /// When, in seconds, and the values of [`LINES`].
    samples: VecDeque<(f64, [f64; LINES.len()])>,
    frames: Frames,
    /// Counters at the last sample.
    hits: u64,
    tiles: u64,
}

/// Frames since the last sample.
#[derive(Default)]
struct Frames {
    count: u32,
    first_tick: u32,
}

impl Default for History {
    fn default() -> Self {
        Self {
            begun: Instant::now(),
            samples: VecDeque::with_capacity(KEPT),
            frames: Frames::default(),
            hits: 0,
            tiles: 0,
        }
    }
}

impl History {
    /// Adds a sample, and forgets the oldest.
    fn push(&mut self, at: f64, values: [f64; LINES.len()]) {
        if self.samples.len() == KEPT {
            self.samples.pop_front();
        }
        self.samples.push_back((at, values));
    }

    fn line(&self, index: usize) -> PlotPoints<'static> {
        self.samples.iter().map(|(at, values)| [*at, values[index]]).collect()
    }
}

pub fn plugin(app: &mut App) {
    app.init_resource::<History>().add_systems(Last, measure).add_panel(Place::Plots, "plots", show);
}

/// Came, is there, evaporated, dripped or ran off; ml. As far as it is booked: what evaporates at rest is booked later.
fn budget(surfaces: &Query<&SurfaceWater>) -> [f64; 4] {
    surfaces.iter().fold([0.0; 4], |[came, there, dried, left], water| {
        // A unit is 2^-shift nanolitres, of which a million are a millilitre.
        let ml = |units: u64| units as f64 * 0.5f64.powi(water.units().shift as i32) * 1e-6;
        let ledger = water.ledger();
        let gone = ledger.dripped + ledger.spilled;
        let rest = ledger.received.saturating_sub(ledger.evaporated + gone);
        [came + ml(ledger.received), there + ml(rest), dried + ml(ledger.evaporated), left + ml(gone)]
    })
}

fn measure(
    clock: Res<bevy_weathering::clock::WeatheringClock>,
    counts: Res<ParticleCounts>,
    water: Res<WaterCounts>,
    stats: Res<WettingStats>,
    pace: Res<Pace>,
    surfaces: Query<&SurfaceWater>,
    mut history: ResMut<History>,
) {
    let history = &mut *history;
    history.frames.count += 1;
    let at = history.begun.elapsed().as_secs_f64();
    let since = at - history.samples.back().map_or(0.0, |(at, _)| *at);
    if since < EVERY {
        return;
    }
    let frames = f64::from(history.frames.count);
    // Counters go back to 0 with the scene.
    let ticks = f64::from(clock.tick().saturating_sub(history.frames.first_tick));
    let hits = counts.hit.saturating_sub(history.hits) as f64;
    let tiles = stats.tiles_run().saturating_sub(history.tiles) as f64;
    let [came, there, dried, left] = budget(&surfaces);
    let values = [
        since / frames * 1e3,
        pace.tick_seconds * 1e3,
        ticks / frames,
        counts.alive as f64,
        hits / since,
        tiles / since,
        water.emitted_nl as f64 * 1e-6,
        came,
        there,
        dried,
        left,
    ];
    history.push(at, values);
    history.frames = Frames { count: 0, first_tick: clock.tick() };
    (history.hits, history.tiles) = (counts.hit, stats.tiles_run());
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    let history = world.resource::<History>();
    let height = ui.available_height();
    ui.columns(3, |columns| {
        for (column, (chart, name)) in columns.iter_mut().zip([
            (Chart::Time, "time"),
            (Chart::Particles, "particles"),
            (Chart::Water, "water"),
        ]) {
            let plot = Plot::new(name)
                .height(height)
                .legend(Legend::default())
                .include_y(0.0)
                .allow_scroll(false)
                .allow_drag(false)
                .allow_zoom(false)
                .x_axis_label("s");
            let lines = LINES.iter().enumerate().filter(|(_, (_, of))| *of == chart);
            let lines: Vec<_> =
                lines.map(|(index, (name, _))| Line::new(*name, history.line(index))).collect();
            plot.show(column, |plot| lines.into_iter().for_each(|line| plot.line(line)));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_minute_is_kept_and_no_more() {
        let mut history = History::default();
        for sample in 0..KEPT + 50 {
            history.push(sample as f64, [sample as f64; LINES.len()]);
        }
        assert_eq!(history.samples.len(), KEPT);
        assert_eq!(history.samples.front().map(|(at, _)| *at), Some(50.0));
        assert_eq!(history.line(0).points().len(), KEPT);
    }
}
