//! Emitters that the user adds and removes.
//!
//! One that is added is the sandbox's own, until a recording begins: then it becomes one of the recorded scenario, and what is added
//! or removed from then on is recorded. One of the scenario that is removed stays in the world, switched off, since what is saved
//! has all of them. Of a session whose recording has ended, each is there in its own time ([`Stay`]).

use std::ops::Range;

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::collision::{CollisionScene, SceneHit};
use bevy_weathering::effect::WeatherEffect;
use bevy_weathering::emitter::{Emitter, EmitterShape};
use bevy_weathering::record::{ExtraEmitter, Recording};
use bevy_weathering::save::{AddedEmitter, RemovedEmitter};
use bevy_weathering::scenario::{ByHand, EmitterKey, EmitterSpec, SceneEntity};

use super::camera::View;
use super::ui::Note;
use super::undo::Undo;
use super::{effects, hose, probe};

/// Random streams of what is added begin here: behind those of any scenario.
const STREAMS: u32 = 1 << 29;
/// Metres from an emitter to what it aims at, where that is not known.
const AIM: f32 = 4.0;

/// The ticks in which an emitter of a session is there whose recording has ended. In others the session's events have it switched
/// off.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct Stay(Range<u32>);

impl Stay {
    /// Whether its time has not come yet.
    pub fn is_to_come(&self, tick: u32) -> bool {
        tick < self.0.start
    }
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

/// What was done to an emitter, to be taken back.
pub enum Done {
    /// It was added; its stream.
    Added(u32),
    /// It had been added, and was removed.
    Gone(Box<(Name, Emitter, Transform)>),
    /// It is the scenario's, and was removed.
    Removed(Removed),
}

/// An emitter of the scenario before it was removed.
pub struct Removed {
    emitter: Entity,
    was_on: bool,
    was_by_hand: bool,
    stay: Option<Stay>,
}

pub fn plugin(app: &mut App) {
    app.insert_resource(Choice { effect: "hose".into(), place: Spot::LookedAt })
        // Before panels show who is there.
        .add_systems(PreUpdate, follow_stays);
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

/// Emitters whose time is over have been removed, until the scene is started over.
fn follow_stays(
    clock: Res<WeatheringClock>,
    emitters: Query<(Entity, &Stay, Has<RemovedEmitter>, Has<ByHand>)>,
    mut commands: Commands,
) {
    for (emitter, stay, is_removed, is_by_hand) in &emitters {
        match (clock.tick() >= stay.0.end, is_removed) {
            (false, true) => {
                commands.entity(emitter).remove::<(RemovedEmitter, ByHand)>();
            }
            // What somebody has taken in hand is theirs.
            (true, false) if !is_by_hand => {
                commands.entity(emitter).insert(RemovedEmitter);
            }
            _ => {}
        }
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
    let scene = world.resource::<CollisionScene>();
    let Some(transform) = line.and_then(|(eye, target)| {
        let direction = Dir3::new(target - eye).ok()?;
        let ray = Ray3d { origin: eye, direction };
        Some(match choice.place {
            Spot::Beside => hose::aimed(ray),
            Spot::LookedAt => before(probe::hit(scene, ray), ray, target),
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
            stream = stream.max(other.stream + 1);
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

/// Takes an emitter away.
pub fn remove(world: &mut World, emitter: Entity) {
    if let Some(mut recording) = world.get_resource_mut::<Recording>() {
        recording.remove_emitter(emitter);
        if world.resource::<Time<Virtual>>().is_paused() {
            world.resource_mut::<Note>().tell("it goes when time goes on");
        }
        return;
    }
    let Ok(mut entity) = world.get_entity_mut(emitter) else { return };
    let Some(was) = entity.get::<Emitter>().cloned() else { return };
    let done = if entity.contains::<AddedEmitter>() {
        let name = entity.get::<Name>().cloned().unwrap_or_default();
        let transform = entity.get::<Transform>().copied().unwrap_or_default();
        entity.despawn();
        Done::Gone(Box::new((name, was, transform)))
    } else {
        let (was_on, was_by_hand) = (was.enabled, entity.contains::<ByHand>());
        // For good, whatever its time was.
        let stay = entity.take::<Stay>();
        // Or its working hours would switch it on again.
        entity.insert((RemovedEmitter, ByHand, Emitter { enabled: false, ..was }));
        Done::Removed(Removed { emitter, was_on, was_by_hand, stay })
    };
    world.resource_mut::<Undo>().keep_emitter(done);
}

impl Done {
    /// Takes it back; tells what was done.
    pub fn take_back(self, world: &mut World) -> &'static str {
        match self {
            Self::Added(stream) => {
                let mut added = world.query_filtered::<(Entity, &Emitter), With<AddedEmitter>>();
                let found = added.iter(world).find(|(_, emitter)| emitter.stream == stream);
                if let Some(emitter) = found.map(|(emitter, _)| emitter) {
                    world.despawn(emitter);
                }
                "took the emitter away"
            }
            Self::Gone(emitter) => {
                let (name, emitter, transform) = *emitter;
                spawn(world, name, emitter, transform);
                "brought the emitter back"
            }
            Self::Removed(Removed { emitter, was_on, was_by_hand, stay }) => {
                let Ok(mut entity) = world.get_entity_mut(emitter) else { return "the emitter has gone" };
                if entity.take::<RemovedEmitter>().is_some() {
                    if let Some(mut emitter) = entity.get_mut::<Emitter>() {
                        emitter.enabled = was_on;
                    }
                    if !was_by_hand {
                        entity.remove::<ByHand>();
                    }
                    if let Some(stay) = stay {
                        entity.insert(stay);
                    }
                }
                "brought the emitter back"
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::undo::undo;
    use super::*;

    fn world() -> World {
        let mut world = World::new();
        world.init_resource::<Undo>();
        world.init_resource::<Note>();
        world
    }

    fn added(world: &mut World) -> Vec<(Entity, u32)> {
        let mut added = world.query_filtered::<(Entity, &Emitter), With<AddedEmitter>>();
        added.iter(world).map(|(entity, emitter)| (entity, emitter.stream)).collect()
    }

    #[test]
    fn what_was_added_and_removed_is_taken_back_in_turn() {
        let mut world = world();
        let emitter = Emitter { stream: 7, rate: 3.0, ..default() };
        spawn(&mut world, Name::new("a"), emitter, Transform::from_xyz(1.0, 2.0, 3.0));
        world.resource_mut::<Undo>().keep_emitter(Done::Added(7));
        let [(first, _)] = added(&mut world)[..] else { panic!("one was added") };
        remove(&mut world, first);
        assert!(added(&mut world).is_empty() && !is_any(&mut world));
        undo(&mut world);
        let [(again, 7)] = added(&mut world)[..] else { panic!("it is not back") };
        let (emitter, transform) = (world.get::<Emitter>(again), world.get::<Transform>(again));
        assert_eq!(emitter.map(|emitter| (emitter.rate, emitter.enabled)), Some((3.0, true)));
        assert_eq!(transform.map(|transform| transform.translation), Some(Vec3::new(1.0, 2.0, 3.0)));
        // Another entity than it was, and yet the same emitter.
        undo(&mut world);
        assert!(added(&mut world).is_empty());
        undo(&mut world);
    }

    #[test]
    fn emitters_of_the_scenario_are_switched_off_and_come_back_as_they_were() {
        for was_by_hand in [false, true] {
            let mut world = world();
            let emitter = world.spawn((SceneEntity, Emitter::default())).id();
            if was_by_hand {
                world.entity_mut(emitter).insert(ByHand);
            }
            remove(&mut world, emitter);
            assert!(!world.get::<Emitter>(emitter).unwrap().enabled);
            assert!(world.get::<ByHand>(emitter).is_some() && world.get::<RemovedEmitter>(emitter).is_some());
            undo(&mut world);
            assert!(world.get::<Emitter>(emitter).unwrap().enabled);
            assert!(world.get::<RemovedEmitter>(emitter).is_none());
            assert_eq!(world.get::<ByHand>(emitter).is_some(), was_by_hand);
        }
    }

    /// Whether the panel has it after a tick.
    fn is_there_at(world: &mut World, emitter: Entity, tick: u32) -> bool {
        let mut clock = WeatheringClock::new(60);
        (0..tick).for_each(|_| clock.advance());
        world.insert_resource(clock);
        let mut schedule = Schedule::default();
        schedule.add_systems(follow_stays);
        schedule.run(world);
        world.get::<RemovedEmitter>(emitter).is_none()
    }

    #[test]
    fn what_was_removed_in_a_session_stays_so_when_its_recording_has_ended() {
        let mut world = world();
        let emitter = world.spawn((SceneEntity, Emitter { enabled: false, ..default() }, Stay(10..50))).id();
        let there = [60, 49, 9, 50].map(|tick| is_there_at(&mut world, emitter, tick));
        assert_eq!(there, [false, true, true, false]);
        let stay = world.get::<Stay>(emitter).unwrap();
        assert!(stay.is_to_come(9) && !stay.is_to_come(10));
        // Its events keep it off: nobody has taken it in hand.
        assert!(world.get::<ByHand>(emitter).is_none());
        // In its time it may be removed for good, and that be taken back.
        assert!(is_there_at(&mut world, emitter, 30));
        remove(&mut world, emitter);
        assert!(!is_there_at(&mut world, emitter, 31) && !is_there_at(&mut world, emitter, 60));
        undo(&mut world);
        assert!(is_there_at(&mut world, emitter, 31) && !is_there_at(&mut world, emitter, 60));
        // What is in somebody's hand does not go.
        assert!(is_there_at(&mut world, emitter, 40));
        world.entity_mut(emitter).insert(ByHand);
        assert!(is_there_at(&mut world, emitter, 60));
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
