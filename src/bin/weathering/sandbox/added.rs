//! Emitters that the user adds, and those that were there only for a time.
//!
//! One that is added is the sandbox's own, until a recording begins: then it becomes one of the recorded scenario, and what is added
//! or removed from then on is recorded. One of the scenario that is removed stays in the world, switched off, since what is saved
//! has all of them. Of a session whose recording has ended, each is there in its own time ([`Stay`]).

mod removed;

use std::ops::Range;

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::collision::{CollisionScene, SceneHit};
use bevy_weathering::effect::WeatherEffect;
use bevy_weathering::emitter::{Emitter, EmitterShape};
use bevy_weathering::record::{ExtraEmitter, Recording};
use bevy_weathering::save::AddedEmitter;
use bevy_weathering::scenario::{EmitterKey, EmitterSpec, SceneEntity};

use super::camera::View;
use super::split::Split;
use super::ui::Note;
use super::undo::Undo;
use super::{effects, hose, probe};

pub use removed::{Done, remove};

/// Random streams of what is added begin here: behind those of any scenario.
const STREAMS: u32 = 1 << 29;
/// Metres from an emitter to what it aims at, where that is not known.
const AIM: f32 = 4.0;

/// The ticks in which an emitter of a session is there whose recording has ended. In others the session's events have it switched
/// off.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct Stay(Range<u32>);

/// Whether an emitter is there after a tick. What somebody has taken in hand is theirs, whatever its time is.
pub fn is_there(stay: Option<&Stay>, is_by_hand: bool, tick: u32) -> bool {
    is_by_hand || stay.is_none_or(|stay| stay.0.contains(&tick))
}

/// What is added, and where.
#[derive(Resource, Clone)]
struct Choice {
    effect: String,
    place: Spot,
}

/// Where an emitter comes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Spot {
    /// In front of what the camera looks at, aiming at it.
    LookedAt,
    /// At the right hand, aiming at what the camera looks at.
    Beside,
}

pub fn plugin(app: &mut App) {
    app.insert_resource(Choice { effect: "hose".into(), place: Spot::LookedAt });
}

/// Whether there is an emitter that is no part of the scenario.
pub fn is_any(world: &mut World) -> bool {
    world.query_filtered::<(), With<AddedEmitter>>().iter(world).next().is_some()
}

/// A recording is about to end: emitters that were not there all the time stay in their own.
pub fn keep_stays(world: &mut World) {
    let mut emitters = world.query_filtered::<Entity, (With<Emitter>, With<SceneEntity>)>();
    let Some(recording) = world.get_resource::<Recording>() else { return };
    let stay = |emitter: Entity| Some((emitter, Stay(recording.ticks_of(emitter)?)));
    let stays: Vec<_> = emitters.iter(world).filter_map(stay).collect();
    for (emitter, stay) in stays.into_iter().filter(|(_, stay)| stay.0 != (0..u32::MAX)) {
        world.entity_mut(emitter).insert(stay);
    }
}

/// What to add, where, and the button.
pub fn show(ui: &mut egui::Ui, world: &mut World) {
    let mut choice = world.resource::<Choice>().clone();
    let before = (choice.effect.clone(), choice.place);
    egui::ComboBox::from_label("to add").selected_text(choice.effect.as_str()).show_ui(ui, |ui| {
        for name in effects::choices(world) {
            ui.selectable_value(&mut choice.effect, name.clone(), name);
        }
    });
    ui.horizontal_wrapped(|ui| {
        for (place, name, about) in [
            (Spot::LookedAt, "where I look", "In front of the middle of the picture, aiming at it"),
            (Spot::Beside, "beside me", "At the right hand, aiming at the middle of the picture"),
        ] {
            ui.selectable_value(&mut choice.place, place, name).on_hover_text(about);
        }
        if ui.button("Add").on_hover_text("An emitter (Ctrl+Z takes it away again)").clicked() {
            add(world, &choice);
        }
    });
    if before != (choice.effect.clone(), choice.place) {
        world.insert_resource(choice);
    }
}

fn add(world: &mut World, choice: &Choice) {
    let mut views = world.query::<&View>();
    let line = views.iter(world).next().map(View::line);
    let (scene, split) = (world.resource::<CollisionScene>(), world.get_resource::<Split>());
    let Some(transform) = line.and_then(|(eye, target)| {
        let direction = Dir3::new(target - eye).ok()?;
        let ray = Ray3d { origin: eye, direction };
        Some(match choice.place {
            Spot::Beside => hose::aimed(ray),
            Spot::LookedAt => before(probe::hit(scene, split, ray), ray, target),
        })
    }) else {
        return;
    };
    let Some(effect) = effects::named(world, &choice.effect) else {
        world.resource_mut::<Note>().complain(format!("there is no effect {} any more", choice.effect));
        return;
    };
    let emitter = made(&choice.effect, effect);
    let name = format!("{} (added)", choice.effect);
    if world.contains_resource::<Recording>() {
        record(world, &name, &emitter, &transform);
        return;
    }
    let mut others = world.query::<(&Name, &Emitter, Has<AddedEmitter>)>();
    let (mut names, mut stream) = (Vec::new(), STREAMS);
    for (name, other, is_added) in others.iter(world) {
        names.push(name.as_str().to_owned());
        if is_added {
            stream = stream.max(other.stream.saturating_add(1));
        }
    }
    let name = numbered(&name, |name| names.iter().any(|other| other == name));
    spawn(world, Name::new(name), Emitter { stream, ..emitter }, transform);
    world.resource_mut::<Undo>().keep_emitter(Done::Added(stream));
}

/// `name`, `name 2`, ...: the first that is free.
fn numbered(name: &str, is_taken: impl Fn(&str) -> bool) -> String {
    let mut free = name.to_owned();
    let mut number = 1;
    while is_taken(&free) {
        number += 1;
        free = format!("{name} {number}");
    }
    free
}

fn spawn(world: &mut World, name: Name, emitter: Emitter, transform: Transform) {
    world.spawn((AddedEmitter, name, emitter, transform, GlobalTransform::from(transform)));
}

/// Before a place, so near that what comes out there hits it.
fn before(hit: Option<SceneHit>, ray: Ray3d, target: Vec3) -> Transform {
    let (point, normal) = hit.map_or((target, Vec3::Y), |hit| (hit.point, hit.normal));
    let height = (0.4 * ray.origin.distance(point)).clamp(0.05, 1.0);
    let up = if normal.y.abs() > 0.9 { Vec3::X } else { Vec3::Y };
    Transform::from_translation(point + normal * height).looking_at(point, up)
}

/// An emitter to begin with; the panel has its numbers.
fn made(effect: &str, handle: Handle<WeatherEffect>) -> Emitter {
    if effect == "hose" {
        let emitter = Emitter::hose(handle, 15.0, 0.008);
        return Emitter { rate: 600.0, spread: 3f32.to_radians(), lifetime: 6.0, ..emitter };
    }
    Emitter {
        effect: handle,
        rate: 300.0,
        shape: EmitterShape::Disc { radius: 0.15 },
        speed: 3.0,
        spread: 8f32.to_radians(),
        lifetime: 6.0,
        ..default()
    }
}

/// Adds it in the next tick of the session.
fn record(world: &mut World, name: &str, emitter: &Emitter, transform: &Transform) {
    match to_extra(world, name, emitter, transform) {
        Ok(extra) => {
            if let Some(mut recording) = world.get_resource_mut::<Recording>() {
                recording.add_emitter(extra);
            }
            if world.resource::<Time<Virtual>>().is_paused() {
                world.resource_mut::<Note>().tell("it comes when time goes on");
            }
        }
        Err(why) => world.resource_mut::<Note>().complain(why),
    }
}

/// An emitter as one of a recorded scenario.
fn to_extra(
    world: &World,
    name: &str,
    emitter: &Emitter,
    transform: &Transform,
) -> Result<ExtraEmitter, String> {
    let effect =
        effects::of(world, &emitter.effect).ok_or_else(|| format!("the effect of {name} is not there"))?;
    let effect = effect.to_ron().map_err(|error| format!("the effect of {name}: {error}"))?;
    let position = transform.translation;
    let spec = EmitterSpec {
        name: name.into(),
        effect: String::new(),
        rate: emitter.rate,
        shape: emitter.shape,
        flow: emitter.flow,
        speed: Some(emitter.speed),
        spread_deg: emitter.spread.to_degrees(),
        lifetime: emitter.lifetime,
        start: 0.0,
        stop: None,
        keys: vec![EmitterKey { t: 0.0, position, target: position + transform.forward() * AIM }],
    };
    Ok(ExtraEmitter { spec, effect, is_on: emitter.enabled })
}

/// All that were added, as emitters of a recorded scenario, in the order in which they came.
///
/// # Errors
/// What cannot be taken along.
pub fn to_record(world: &mut World) -> Result<Vec<ExtraEmitter>, String> {
    let mut added = world.query_filtered::<(&Emitter, &Name, &Transform), With<AddedEmitter>>();
    let world: &World = world;
    let mut order: Vec<_> = added.iter(world).collect();
    order.sort_by_key(|(emitter, ..)| emitter.stream);
    let extra = |(emitter, name, transform): (&Emitter, &Name, &Transform)| {
        let names_pictures =
            effects::of(world, &emitter.effect).is_some_and(|effect| effect.stamps.files().next().is_some());
        if names_pictures {
            return Err(format!("the effect of {name} names pictures, which no recording takes along"));
        }
        to_extra(world, name.as_str(), emitter, transform)
    };
    order.into_iter().map(extra).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn emitters_of_a_session_are_there_in_their_own_time_or_in_a_hand() {
        let stay = Stay(10..50);
        let there = [0, 9, 10, 49, 50].map(|tick| is_there(Some(&stay), false, tick));
        assert_eq!(there, [false, false, true, true, false]);
        assert!(is_there(Some(&stay), true, 9) && is_there(Some(&stay), true, 60));
        assert!(is_there(None, false, 0));
    }

    #[test]
    fn they_aim_at_what_is_looked_at() {
        let ray = Ray3d { origin: Vec3::new(0.0, 1.0, 2.0), direction: Dir3::NEG_Z };
        for target in [Vec3::ZERO, Vec3::new(0.0, 1.0, -3.0)] {
            let transform = before(None, ray, target);
            assert!(transform.is_finite());
            let way = target - transform.translation;
            assert!(way.length() <= 1.0 + 1e-5 && transform.forward().dot(way.normalize()) > 0.9999);
        }
        assert_eq!(numbered("a", |name| ["a", "a 2"].contains(&name)), "a 3");
    }
}
