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
use egui_plot::{Line, Plot, PlotPoints};

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

/// Of the lines of a chart, in their order.
const COLOURS: [egui::Color32; 7] = [
    egui::Color32::from_rgb(240, 120, 110),
    egui::Color32::from_rgb(110, 170, 240),
    egui::Color32::from_rgb(150, 205, 95),
    egui::Color32::from_rgb(220, 130, 220),
    egui::Color32::from_rgb(90, 205, 190),
    egui::Color32::from_rgb(235, 185, 80),
    egui::Color32::from_rgb(170, 140, 245),
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

    /// By seconds before the last sample.
    fn line(&self, index: usize) -> PlotPoints<'static> {
        let last = self.samples.back().map_or(0.0, |(at, _)| *at);
        self.samples.iter().map(|(at, values)| [*at - last, values[index]]).collect()
    }

    /// What was measured last.
    fn last(&self, index: usize) -> f64 {
        self.samples.back().map_or(0.0, |(_, values)| values[index])
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
    let room = ((ui.available_width() / NARROWEST) as usize).max(1);
    ui.horizontal_wrapped(|ui| {
        for (index, (_, name)) in CHARTS.into_iter().enumerate() {
            ui.toggle_value(&mut shown[index], name);
        }
        let chosen = shown.iter().filter(|is_shown| **is_shown).count();
        if chosen > room {
            ui.small(format!("there is room for {room} of {chosen}"));
        }
    });
    if world.resource::<Settings>().charts != shown {
        world.resource_mut::<Settings>().charts = shown;
    }
    let mut charts: Vec<_> = CHARTS.into_iter().zip(shown).filter(|(_, is_shown)| *is_shown).collect();
    // Better fewer than none that can be read.
    charts.truncate(room);
    if charts.is_empty() {
        return;
    }
    let history = world.resource::<History>();
    ui.columns(charts.len(), |columns| {
        for (column, ((chart, name), _)) in columns.iter_mut().zip(charts) {
            let lines = LINES.iter().enumerate().filter(|(_, (_, of))| *of == chart);
            let lines: Vec<_> =
                lines.zip(COLOURS).map(|((index, (name, _)), colour)| (index, *name, colour)).collect();
            // Above the lines, and not on them: charts are narrow beside open panels.
            column.horizontal_wrapped(|ui| {
                for &(index, name, colour) in &lines {
                    let text = egui::RichText::new(format!("{name}: {}", short(history.last(index))));
                    ui.label(text.small().color(colour));
                }
            });
            let plot = Plot::new(name)
                .height(column.available_height().max(40.0))
                .include_y(0.0)
                .allow_scroll(false)
                .allow_drag(false)
                .allow_zoom(false)
                .x_axis_formatter(|mark, _| format!("{:.0} s", mark.value));
            let lines: Vec<_> = lines
                .into_iter()
                .map(|(index, name, colour)| Line::new(name, history.line(index)).color(colour))
                .collect();
            plot.show(column, |plot| lines.into_iter().for_each(|line| plot.line(line)));
        }
    });
}

/// As many digits as say something.
fn short(value: f64) -> String {
    match value.abs() {
        size if size >= 100.0 => format!("{value:.0}"),
        size if size >= 1.0 => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    }
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
        let points = history.line(0);
        let ends = [points.points().first(), points.points().last()].map(|point| point.map(|point| point.x));
        assert_eq!((points.points().len(), ends), (KEPT, [Some(1.0 - KEPT as f64), Some(0.0)]));
        assert_eq!((history.last(3), History::default().last(3)), ((KEPT + 49) as f64, 0.0));
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
    fn every_chart_has_lines_of_colours_of_their_own() {
        for (chart, name) in CHARTS {
            let lines = LINES.iter().filter(|(_, of)| *of == chart).count();
            assert!((1..=COLOURS.len()).contains(&lines), "{name}: {lines}");
        }
        assert_eq!([0.0, 0.126, 2.34, 512.4].map(short), ["0.00", "0.13", "2.3", "512"]);
    }
}
