//! Brushes: while the left button is held, what is below the cursor is wetted, dried, dirtied or cleaned.
//!
//! Touches follow each other by time and by way, and wait for the next tick, so that they act by the clock. Only while time
//! stands still they are painted at once.

use std::time::Instant;

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::brush::{Brush, BrushKind, BrushQueue, Stroke, paint_strokes};
use bevy_weathering::collision::{CollisionScene, SurfaceCollider};
use bevy_weathering::matter::SurfaceMatter;
use bevy_weathering::record::Recording;
use bevy_weathering::wetting::{KeptSurface, SurfaceWater, WetGeometry};

use super::hose::Pointed;
use super::probe::hit;
use super::settings::{BrushSettings, Settings, Tool};
use super::split::Split;
use super::ui::{AddPanel, Place, UiInput};
use super::undo::{Undo, redo, undo};
use super::widgets::number;

/// Seconds between two touches of one place.
const EVERY: f32 = 0.1;
/// Part of the radius between two touches on the way.
const SPACING: f32 = 0.35;

/// The last touch of the stroke that is being painted.
#[derive(Resource, Default)]
struct Last(Option<(Instant, Vec3)>);

pub fn plugin(app: &mut App) {
    app.init_resource::<Last>().add_systems(Update, (paint, draw)).add_panel(Place::Side, "Brushes", show);
}

impl Tool {
    /// What it does, if it is a brush.
    pub fn brush(self) -> Option<BrushKind> {
        match self {
            Self::Wet => Some(BrushKind::Wet),
            Self::Dry => Some(BrushKind::Dry),
            Self::Dirty => Some(BrushKind::Dirty),
            Self::Clean => Some(BrushKind::Clean),
            Self::Hose | Self::Probe => None,
        }
    }
}

/// Ends the stroke that is being painted, if one is: the button has to be pressed again to paint on.
pub fn let_go(world: &mut World) {
    let is_painting = world.get_resource_mut::<Last>().is_some_and(|mut last| last.0.take().is_some());
    if is_painting && let Some(mut pointed) = world.get_resource_mut::<Pointed>() {
        pointed.held = false;
    }
}

/// How much a touch does: mm of water or dust, or a part of what is there.
fn strength(kind: BrushKind, settings: &BrushSettings) -> f32 {
    let most = match kind {
        BrushKind::Wet => 1.0,
        BrushKind::Dirty => 0.2,
        BrushKind::Dry | BrushKind::Clean => 1.0,
    };
    settings.strength * most
}

fn paint(
    pointed: Res<Pointed>,
    settings: Res<Settings>,
    scene: Res<CollisionScene>,
    split: Option<Res<Split>>,
    time: Res<Time<Virtual>>,
    surfaces: Query<(&SurfaceWater, &SurfaceMatter, &WetGeometry, &SurfaceCollider)>,
    mut queue: ResMut<BrushQueue>,
    mut last: ResMut<Last>,
    mut undo: ResMut<Undo>,
    mut recording: Option<ResMut<Recording>>,
    mut commands: Commands,
) {
    let Some(kind) = settings.tool.brush().filter(|_| pointed.held) else {
        if last.0.take().is_some() {
            undo.end_stroke();
        }
        return;
    };
    let Some(hit) = pointed.ray.and_then(|ray| hit(&scene, split.as_deref(), ray)) else { return };
    let radius = settings.brush.radius;
    let is_due = last.0.is_none_or(|(when, place)| {
        when.elapsed().as_secs_f32() >= EVERY || place.distance(hit.point) >= SPACING * radius
    });
    if !is_due {
        return;
    }
    // A surface that is not measured yet cannot be touched.
    let Ok((water, matter, geometry, collider)) = surfaces.get(hit.surface) else { return };
    match &mut recording {
        // A recording takes strokes back in its own way.
        Some(recording) if last.0.is_none() => recording.begin_stroke(),
        Some(_) => {}
        None => undo.keep(hit.surface, || KeptSurface::new(water, matter, geometry, collider)),
    }
    last.0 = Some((Instant::now(), hit.point));
    let brush = Brush { kind, point: hit.point, radius, strength: strength(kind, &settings.brush) };
    // Of one surface only: what is taken back is what was kept.
    queue.0.push(Stroke { brush, surface: Some(hit.surface) });
    // What is recorded acts in ticks alone.
    if time.is_paused() && recording.is_none() {
        commands.run_system_cached(paint_strokes);
    }
}

/// A ring where the brush would touch.
fn draw(
    pointed: Res<Pointed>,
    settings: Res<Settings>,
    input: Res<UiInput>,
    scene: Res<CollisionScene>,
    split: Option<Res<Split>>,
    mut gizmos: Gizmos,
) {
    let Some(kind) = settings.tool.brush().filter(|_| !input.pointer) else { return };
    let Some(hit) = pointed.ray.and_then(|ray| hit(&scene, split.as_deref(), ray)) else { return };
    let color = match kind {
        BrushKind::Wet => Color::srgb(0.3, 0.6, 1.0),
        BrushKind::Dry => Color::srgb(1.0, 0.75, 0.3),
        BrushKind::Dirty => Color::srgb(0.6, 0.4, 0.2),
        BrushKind::Clean => Color::srgb(0.9, 0.95, 0.9),
    };
    let turn = Quat::from_rotation_arc(Vec3::Z, hit.normal);
    gizmos.circle(Isometry3d::new(hit.point + hit.normal * 0.003, turn), settings.brush.radius, color);
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    let mut settings = world.resource_mut::<Settings>();
    let settings = &mut *settings;
    ui.label("Choose one, and hold the left button in the scene.");
    ui.horizontal_wrapped(|ui| {
        for (tool, name, about) in [
            (Tool::Wet, "Wet", "Brings water (1)"),
            (Tool::Dry, "Dry", "Takes water away, out of the pores, too (2)"),
            (Tool::Dirty, "Dirty", "Brings dust (3)"),
            (Tool::Clean, "Clean", "Takes dust, mud and snow away (4)"),
        ] {
            ui.selectable_value(&mut settings.tool, tool, name).on_hover_text(about);
        }
    });
    let brush = &mut settings.brush;
    let [radius, strength] = BrushSettings::RANGES;
    number(ui, "radius, m", &mut brush.radius, radius, "Most in the middle, nothing at the rim");
    number(ui, "strength", &mut brush.strength, strength, "Of 1 mm of water, .2 mm of dust, or all there is");
    let recording = world.get_resource::<Recording>();
    let [count, undone] =
        recording.map_or_else(|| world.resource::<Undo>().counts(), |recording| [recording.strokes(), 0]);
    ui.horizontal_wrapped(|ui| {
        let button = ui.add_enabled(count > 0, egui::Button::new("Take back"));
        let about = "The last stroke, with all that its surfaces got since; or emitter (Ctrl+Z)";
        if button.on_hover_text(about).clicked() {
            undo(world);
        }
        let button = ui.add_enabled(undone > 0, egui::Button::new("Do again"));
        if button.on_hover_text("What was taken back last (Ctrl+Shift+Z)").clicked() {
            redo(world);
        }
        ui.small(format!("{count} to take back"));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_brush_is_within_what_the_library_takes() {
        for tool in [Tool::Wet, Tool::Dry, Tool::Dirty, Tool::Clean] {
            let kind = tool.brush().unwrap();
            let [(least, most), (weak, strong)] = BrushSettings::RANGES;
            for (radius, by) in [(least, weak), (most, strong)] {
                let settings = BrushSettings { radius, strength: by };
                let strength = strength(kind, &settings);
                let brush = Brush { kind, point: Vec3::ZERO, radius, strength };
                assert_eq!(brush.validate(), Ok(()));
            }
        }
        assert!([Tool::Hose, Tool::Probe].iter().all(|tool| tool.brush().is_none()));
    }

    #[test]
    fn a_stroke_that_is_taken_back_is_not_painted_on_and_an_open_hose_sprays_on() {
        for last in [None, Some((Instant::now(), Vec3::ZERO))] {
            let mut world = World::new();
            world.insert_resource(Pointed { held: true, ..default() });
            world.insert_resource(Last(last));
            let_go(&mut world);
            assert_eq!(world.resource::<Pointed>().held, last.is_none());
            assert!(world.resource::<Last>().0.is_none());
        }
    }
}
