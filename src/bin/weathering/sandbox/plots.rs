//! What happens, over time: frames and ticks and what in them takes the time, particles and hits, and where the water is.

use std::collections::VecDeque;
use std::time::Instant;

use bevy::diagnostic::DiagnosticsStore;
use bevy::prelude::*;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;
use bevy_egui::egui;
use bevy_weathering::overlay::SplatStats;
use bevy_weathering::overload::{STAGES, StageMark, StageMeans, StageTimes};
use bevy_weathering::particle::{ParticleCounts, WaterCounts};
use bevy_weathering::wetting::{SurfaceWater, WettingStats};
use egui_plot::{Legend, Line, Plot, PlotPoints};

use super::settings::Settings;
use super::ui::{AddPanel, Place};

/// Seconds between two samples.
const EVERY: f64 = 0.1;
/// Samples that are kept: a minute.
const KEPT: usize = 600;

/// The narrowest chart that can be read, points.
const NARROWEST: f32 = 210.0;
/// A measurement of the GPU that is older than this, in seconds, is of something that is over.
const STALE: f32 = 1.0;

/// What is measured; each is a line.
const LINES: [(&str, Chart); 18] = [
    ("frame, ms", Chart::Time),
    ("tick, ms", Chart::Time),
    ("ticks a frame", Chart::Time),
    ("emit", Chart::Stages),
    ("move", Chart::Stages),
    ("collide", Chart::Stages),
    ("deposit", Chart::Stages),
    ("water and matter", Chart::Stages),
    ("rest of the frame", Chart::Stages),
    ("splats, on the GPU", Chart::Stages),
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
    /// Parts of a frame, ms.
    Stages,
    Particles,
    Water,
}

/// Charts with their titles, in the order in which they are shown.
const CHARTS: [(Chart, &str); 4] = [
    (Chart::Time, "time"),
    (Chart::Stages, "ms a frame"),
    (Chart::Particles, "particles"),
    (Chart::Water, "water"),
];

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
    /// Stages of ticks at the last sample.
    stages: Option<StageMark>,
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
            stages: None,
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
    // Measures passes on the GPU, where it has timestamps.
    app.add_plugins(RenderDiagnosticsPlugin).init_resource::<History>().add_systems(Last, measure).add_panel(
        Place::Plots,
        "plots",
        show,
    );
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

/// Of a mean frame that takes `frame_ms`: emit, move, collide, deposit, water and matter, and the rest of it; ms. `ticks`: of
/// that frame.
fn parts_of_a_frame(means: Option<StageMeans>, ticks: f64, frame_ms: f64) -> [f64; 6] {
    let of = |stage: &str| {
        let index = STAGES.iter().position(|known| *known == stage);
        index.zip(means).map_or(0.0, |(index, means)| means.stages_ms[index] * ticks)
    };
    let stages = ["emit", "integrate", "trace", "deposit", "flow"].map(of);
    let [emit, integrate, trace, deposit, flow] = stages;
    let rest = (frame_ms - stages.iter().sum::<f64>()).max(0.0);
    [emit, integrate, trace, deposit, flow, rest]
}

/// What the pass that paints splats took on the GPU of late, ms; 0 where it is not known, or has nothing to do.
fn splats_ms(diagnostics: &DiagnosticsStore) -> f64 {
    let last = diagnostics.get(&SplatStats::GPU_TIME).and_then(|told| told.measurement());
    last.filter(|last| last.time.elapsed().as_secs_f32() < STALE).map_or(0.0, |last| last.value)
}

fn measure(
    clock: Res<bevy_weathering::clock::WeatheringClock>,
    counts: Res<ParticleCounts>,
    water: Res<WaterCounts>,
    stats: Res<WettingStats>,
    times: Res<StageTimes>,
    diagnostics: Res<DiagnosticsStore>,
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
    let means = history.stages.as_mut().and_then(|mark| times.take_since(mark));
    history.stages.get_or_insert_with(|| times.mark());
    let frame_ms = since / frames * 1e3;
    let [emit, moved, collide, deposit, flow, rest] = parts_of_a_frame(means, ticks / frames, frame_ms);
    let values = [
        frame_ms,
        means.map_or(0.0, |means| means.stages_ms.iter().sum()),
        ticks / frames,
        emit,
        moved,
        collide,
        deposit,
        flow,
        rest,
        splats_ms(&diagnostics),
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
    let mut shown = world.resource::<Settings>().charts;
    ui.horizontal(|ui| {
        for (index, (_, name)) in CHARTS.into_iter().enumerate() {
            ui.toggle_value(&mut shown[index], name);
        }
    });
    if world.resource::<Settings>().charts != shown {
        world.resource_mut::<Settings>().charts = shown;
    }
    let mut charts: Vec<_> = CHARTS.into_iter().zip(shown).filter(|(_, is_shown)| *is_shown).collect();
    // Better fewer than none that can be read.
    charts.truncate(((ui.available_width() / NARROWEST) as usize).max(1));
    if charts.is_empty() {
        return;
    }
    let history = world.resource::<History>();
    let height = ui.available_height();
    ui.columns(charts.len(), |columns| {
        for (column, ((chart, name), _)) in columns.iter_mut().zip(charts) {
            // Small, and in the order of the lines: charts are narrow beside open panels.
            let legend = Legend::default()
                .text_style(egui::TextStyle::Small)
                .background_alpha(0.6)
                .follow_insertion_order(true);
            let plot = Plot::new(name)
                .height(height)
                .legend(legend)
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

    #[test]
    fn parts_of_a_frame_are_the_frame() {
        let stages_ms = [9.0, 1.0, 2.0, 3.0, 4.0, 5.0, 9.0];
        let means = StageMeans { ticks: 6, stages_ms, outside_ms: 1.0 };
        // Two ticks a frame, 50 ms.
        assert_eq!(parts_of_a_frame(Some(means), 2.0, 50.0), [2.0, 4.0, 6.0, 8.0, 10.0, 20.0]);
        assert_eq!(parts_of_a_frame(None, 0.0, 50.0), [0.0, 0.0, 0.0, 0.0, 0.0, 50.0]);
        // What was measured a moment apart may be more.
        assert_eq!(parts_of_a_frame(Some(means), 2.0, 10.0)[5], 0.0);
    }

    #[test]
    fn every_chart_has_lines() {
        assert!(CHARTS.iter().all(|(chart, _)| LINES.iter().any(|(_, of)| of == chart)));
    }
}
