//! Emitters that the user removes, and what brings them back.

use bevy::prelude::*;
use bevy_weathering::emitter::Emitter;
use bevy_weathering::record::Recording;
use bevy_weathering::save::{AddedEmitter, RemovedEmitter};
use bevy_weathering::scenario::ByHand;

use super::super::ui::Note;
use super::super::undo::Undo;
use super::spawn;

/// What was done to an emitter, to be taken back.
pub enum Done {
    /// It was added; its stream.
    Added(u32),
    /// It had been added, and was removed.
    Gone(Box<(Name, Emitter, Transform)>),
    /// It is the scenario's, and was removed.
    Removed(Removed),
    /// It is the scenario's, and was brought back.
    BroughtBack(Entity),
}

/// An emitter of the scenario before it was removed.
pub struct Removed {
    emitter: Entity,
    was_on: bool,
    was_by_hand: bool,
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
    if let Some(done) = take_away(world, emitter) {
        world.resource_mut::<Undo>().keep_emitter(done);
    }
}

/// Takes an emitter away; what was done, if it was one.
fn take_away(world: &mut World, emitter: Entity) -> Option<Done> {
    let mut entity = world.get_entity_mut(emitter).ok()?;
    let was = entity.get::<Emitter>().cloned()?;
    Some(if entity.contains::<AddedEmitter>() {
        let name = entity.get::<Name>().cloned().unwrap_or_default();
        let transform = entity.get::<Transform>().copied().unwrap_or_default();
        entity.despawn();
        Done::Gone(Box::new((name, was, transform)))
    } else {
        let (was_on, was_by_hand) = (was.enabled, entity.contains::<ByHand>());
        // Or its working hours would switch it on again.
        entity.insert((RemovedEmitter, ByHand, Emitter { enabled: false, ..was }));
        Done::Removed(Removed { emitter, was_on, was_by_hand })
    })
}

impl Done {
    /// Takes it back; tells what was done, and what it takes to have it the other way round again.
    pub fn take_back(self, world: &mut World) -> (&'static str, Option<Self>) {
        let gone = ("the emitter has gone", None);
        match self {
            Self::Added(stream) => {
                let mut added = world.query_filtered::<(Entity, &Emitter), With<AddedEmitter>>();
                let found = added.iter(world).find(|(_, emitter)| emitter.stream == stream);
                let emitter = found.map(|(emitter, _)| emitter);
                let done = emitter.and_then(|emitter| take_away(world, emitter));
                done.map_or(gone, |done| ("took the emitter away", Some(done)))
            }
            Self::Gone(emitter) => {
                let (name, emitter, transform) = *emitter;
                let stream = emitter.stream;
                spawn(world, name, emitter, transform);
                ("brought the emitter back", Some(Self::Added(stream)))
            }
            Self::BroughtBack(emitter) => {
                take_away(world, emitter).map_or(gone, |done| ("took the emitter away", Some(done)))
            }
            Self::Removed(Removed { emitter, was_on, was_by_hand }) => {
                let Ok(mut entity) = world.get_entity_mut(emitter) else { return gone };
                if entity.take::<RemovedEmitter>().is_some() {
                    if let Some(mut emitter) = entity.get_mut::<Emitter>() {
                        emitter.enabled = was_on;
                    }
                    if !was_by_hand {
                        entity.remove::<ByHand>();
                    }
                }
                ("brought the emitter back", Some(Self::BroughtBack(emitter)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy_weathering::scenario::SceneEntity;

    use super::super::super::undo::{redo, undo};
    use super::super::is_any;
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
        // All of it again.
        redo(&mut world);
        let [(_, 7)] = added(&mut world)[..] else { panic!("it was not added again") };
        redo(&mut world);
        assert!(added(&mut world).is_empty());
        redo(&mut world);
        undo(&mut world);
        assert_eq!(added(&mut world).len(), 1);
        assert_eq!(world.resource::<Undo>().counts(), [1, 1]);
        // Something else was done.
        world.resource_mut::<Undo>().keep_emitter(Done::Added(8));
        assert_eq!(world.resource::<Undo>().counts(), [2, 0]);
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
            redo(&mut world);
            assert!(!world.get::<Emitter>(emitter).unwrap().enabled);
            assert!(world.get::<RemovedEmitter>(emitter).is_some());
            undo(&mut world);
            assert!(world.get::<Emitter>(emitter).unwrap().enabled);
            assert_eq!(world.get::<ByHand>(emitter).is_some(), was_by_hand);
        }
    }
}
