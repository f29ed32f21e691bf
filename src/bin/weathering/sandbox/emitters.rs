//! All emitters: how much, how wide, of what, on or off; and others, to be added and removed.

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::emitter::{Emitter, EmitterShape, EmitterState, Flow};
use bevy_weathering::particle::{ParticleConfig, ParticleCounts};
use bevy_weathering::record::Recording;
use bevy_weathering::save::{AddedEmitter, RemovedEmitter};
use bevy_weathering::scenario::{ByHand, SceneEntity};

use super::added::{self, Stay};
use super::effects;
use super::hose::InHand;
use super::split::CopyOf;
use super::ui::{AddPanel, Place};
use super::weather::OwnRain;
use super::widgets::number;

pub fn plugin(app: &mut App) {
    app.add_panel(Place::Side, "Emitters", show);
}

/// Those in the hand and over the scene have panels of their own.
type Listed = (Without<InHand>, Without<OwnRain>, Without<CopyOf>, Without<RemovedEmitter>);

fn show(ui: &mut egui::Ui, world: &mut World) {
    let counts = *world.resource::<ParticleCounts>();
    ui.label(format!("{} particles in flight, {} hits", counts.alive, counts.hit));
    if counts.refused > 0 {
        let most = world.resource::<ParticleConfig>().max_alive;
        ui.label(format!("{} not sent: at most {most} may be in flight", counts.refused));
    }
    if counts.merged > 0 {
        ui.label(format!("{} fewer were sent, each with more in it, to keep up", counts.merged));
    }
    added::show(ui, world);
    let mut query =
        world.query_filtered::<(Entity, &Emitter, Option<&Name>, Option<&Stay>, Has<ByHand>), Listed>();
    let tick = world.resource::<WeatheringClock>().tick();
    let recording = world.get_resource::<Recording>();
    let mut all: Vec<(u32, Entity, String)> = query
        .iter(world)
        .filter(|(entity, ..)| recording.is_none_or(|recording| recording.has_emitter(*entity)))
        .filter(|(.., stay, is_by_hand)| added::is_there(*stay, *is_by_hand, tick))
        .map(|(entity, emitter, name, ..)| {
            (emitter.stream, entity, name.map_or_else(|| "emitter".to_owned(), ToString::to_string))
        })
        .collect();
    all.sort_unstable();
    if all.is_empty() {
        ui.label("The scene has no emitters.");
    }
    for (_, entity, name) in all {
        egui::CollapsingHeader::new(name).id_salt(entity).default_open(true).show(ui, |ui| {
            show_emitter(ui, world, entity);
        });
    }
}

fn show_emitter(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    let Some(before) = world.get::<Emitter>(entity).cloned() else { return };
    let mut emitter = before.clone();
    let mut by_hand = world.get::<ByHand>(entity).is_some();
    // What is done to a recorded one becomes an event: it is taken over by that.
    let is_recorded = world.contains_resource::<Recording>();
    let is_of_scene =
        world.get::<SceneEntity>(entity).is_some() && world.get::<AddedEmitter>(entity).is_none();
    let is_scripted = is_of_scene && !is_recorded;
    if is_scripted {
        let about = "Its keys and working hours do not apply while it is in your hand";
        if ui.checkbox(&mut by_hand, "by hand").on_hover_text(about).changed() {
            set_by_hand(world, entity, by_hand);
        }
    }
    ui.add_enabled_ui(by_hand || !is_scripted, |ui| {
        ui.checkbox(&mut emitter.enabled, "on");
    });
    number(
        ui,
        "particles/s",
        &mut emitter.rate,
        (0.0, 100_000.0),
        "Each stands for more, the fewer there are",
    );
    match &mut emitter.flow {
        Flow::Effect => {}
        Flow::MmPerHour(rate) => number(ui, "rain, mm/h", rate, (0.0, 300.0), "On level ground below it"),
        Flow::LitresPerMinute(litres) => number(ui, "flow, l/min", litres, (0.0, 200.0), ""),
    }
    let mut spread_deg = emitter.spread.to_degrees();
    number(ui, "spread, degrees", &mut spread_deg, (0.0, 90.0), "Half-angle of the cone of directions");
    if spread_deg != before.spread.to_degrees() {
        emitter.spread = spread_deg.to_radians();
    }
    let about = "At the start; under a sky 0 is as fast as its drops fall";
    number(ui, "speed, m/s", &mut emitter.speed, (0.0, 60.0), about);
    number(ui, "lifetime, s", &mut emitter.lifetime, (0.1, 60.0), "What hits nothing until then is removed");
    shape(ui, &mut emitter.shape);
    // Before that its keys say where it is.
    ui.add_enabled_ui(by_hand || !is_scripted, |ui| show_place(ui, world, entity));
    ui.add_enabled_ui(!is_recorded, |ui| {
        egui::ComboBox::from_label("effect").selected_text("exchange").show_ui(ui, |ui| {
            for name in effects::names() {
                if ui.selectable_label(false, name).clicked()
                    && let Some(effect) = effects::shipped(world, name)
                {
                    emitter.effect = effect;
                }
            }
        });
    });
    if let Some(state) = world.get::<EmitterState>(entity) {
        ui.small(format!("{} sent so far", state.emitted));
    }
    let is_removed = ui.button("Remove").on_hover_text("What it has sent stays").clicked();
    if is_changed(&before, &emitter)
        && let Some(mut there) = world.get_mut::<Emitter>(entity)
    {
        *there = emitter;
    }
    if is_removed {
        added::remove(world, entity);
    }
}

/// Where it is and which way it points.
fn show_place(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    let Some(before) = world.get::<Transform>(entity).copied() else { return };
    let [mut place, aim] = [before.translation, before.forward().as_vec3()];
    let (mut heading_deg, mut up_deg) = angles(aim);
    let shown = (heading_deg, up_deg);
    ui.horizontal(|ui| {
        for (value, name) in [&mut place.x, &mut place.y, &mut place.z].into_iter().zip(["x ", "y ", "z "]) {
            let drag = egui::DragValue::new(value).speed(0.02).range(-1000.0..=1000.0).prefix(name);
            ui.add(drag).on_hover_text("Metres; drag, or click and type");
        }
        ui.label("place, m");
    });
    number(ui, "towards, degrees", &mut heading_deg, (-180.0, 180.0), "0 is -z, 90 is +x");
    number(ui, "upwards, degrees", &mut up_deg, (-89.0, 89.0), "Rain falls straight down whatever this is");
    let mut after = before.with_translation(place);
    if (heading_deg, up_deg) != shown {
        after = after.looking_to(way(heading_deg, up_deg), Vec3::Y);
    }
    // It is where it is shown to be, and a tick comes before transforms are propagated.
    if after != before
        && let Ok(mut entity) = world.get_entity_mut(entity)
    {
        entity.insert((after, GlobalTransform::from(after)));
    }
}

/// Of a direction: where it goes to along the ground, and how far up; degrees.
fn angles(way: Vec3) -> (f32, f32) {
    (way.x.atan2(-way.z).to_degrees(), way.y.clamp(-1.0, 1.0).asin().to_degrees())
}

/// The direction of such angles.
fn way(heading_deg: f32, up_deg: f32) -> Vec3 {
    let (up, along) = up_deg.to_radians().sin_cos();
    let (sin, cos) = heading_deg.to_radians().sin_cos();
    Vec3::new(sin * along, up, -cos * along)
}

fn set_by_hand(world: &mut World, entity: Entity, by_hand: bool) {
    let mut entity = world.entity_mut(entity);
    if by_hand {
        entity.insert(ByHand);
    } else {
        entity.remove::<ByHand>();
    }
}

fn is_changed(one: &Emitter, other: &Emitter) -> bool {
    let numbers = |emitter: &Emitter| [emitter.rate, emitter.speed, emitter.spread, emitter.lifetime];
    numbers(one) != numbers(other)
        || one.flow != other.flow
        || one.shape != other.shape
        || one.effect != other.effect
        || one.enabled != other.enabled
}

/// The measures of where particles start.
fn shape(ui: &mut egui::Ui, shape: &mut EmitterShape) {
    match shape {
        EmitterShape::Point => {}
        EmitterShape::Cone { radius } => number(ui, "nozzle radius, m", radius, (0.001, 0.5), ""),
        EmitterShape::Disc { radius } => number(ui, "radius, m", radius, (0.001, 20.0), ""),
        EmitterShape::Box { half_size } => {
            for (label, value) in ["half length x, m", "half length y, m", "half length z, m"]
                .into_iter()
                .zip([&mut half_size.x, &mut half_size.y, &mut half_size.z])
            {
                number(ui, label, value, (0.0, 20.0), "");
            }
        }
        EmitterShape::Sky { half_size } => {
            number(ui, "half length x, m", &mut half_size.x, (0.01, 100.0), "Along x");
            number(ui, "half length z, m", &mut half_size.y, (0.01, 100.0), "Along z");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_their_angles_belong_together() {
        for (heading, up) in [(-170.0, -80.0), (0.0, 0.0), (90.0, 45.0)] {
            let (heading_again, up_again) = angles(way(heading, up));
            assert!((heading - heading_again).abs() < 1e-2 && (up - up_again).abs() < 1e-2);
        }
        assert!((way(90.0, 0.0) - Vec3::X).length() < 1e-6 && (way(0.0, 0.0) - Vec3::NEG_Z).length() < 1e-6);
        // Straight down is no direction along the ground, but somewhere.
        assert!(angles(Vec3::NEG_Y).0.is_finite());
    }

    #[test]
    fn whatever_is_edited_is_a_change() {
        let before = Emitter::default();
        let edits: [fn(&mut Emitter); 6] = [
            |emitter| emitter.rate += 1.0,
            |emitter| emitter.lifetime += 1.0,
            |emitter| emitter.speed += 1.0,
            |emitter| emitter.flow = Flow::MmPerHour(3.0),
            |emitter| emitter.shape = EmitterShape::Disc { radius: 0.123 },
            |emitter| emitter.enabled = !emitter.enabled,
        ];
        assert!(!is_changed(&before, &before));
        for edit in edits {
            let mut emitter = before.clone();
            edit(&mut emitter);
            assert!(is_changed(&before, &emitter));
        }
    }
}
