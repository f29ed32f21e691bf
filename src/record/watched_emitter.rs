//! An emitter whose changes are found, taken back and done again, as `watch` does it with all that is watched.

use bevy::prelude::*;

use super::watch::{Complaints, note};
use crate::emitter::Emitter;
use crate::scenario::{Action, ByHand, EmitterAdjustment, EmitterMove};

/// Moves of an emitter a second, at most; in between it goes straight.
const MOVES_PER_SECOND: u32 = 15;
/// Metres before an emitter at which it aims.
const AIM: f32 = 4.0;

/// An emitter as events have made it, and what it is to become.
pub(super) struct WatchedEmitter {
    pub(super) entity: Entity,
    pub(super) emitter: Emitter,
    pub(super) transform: Transform,
    pub(super) wanted: EmitterAdjustment,
    pub(super) switch: Option<bool>,
    /// Position and target.
    pub(super) pose: Option<(Vec3, Vec3)>,
    /// The tick of its last move.
    pub(super) moved: u32,
    /// The tick in which it was added; 0 from the start.
    pub(super) since: u32,
    /// The tick in which it was removed.
    pub(super) gone: Option<u32>,
}

impl WatchedEmitter {
    /// An emitter as it is, that has been there from the start.
    pub(super) fn new(world: &World, entity: Entity) -> Option<Self> {
        let found = world.get_entity(entity).ok()?;
        let name = found.get::<Name>().map(ToString::to_string).unwrap_or_default();
        Some(Self {
            entity,
            emitter: found.get::<Emitter>()?.clone(),
            transform: *found.get::<Transform>()?,
            wanted: EmitterAdjustment { emitter: name, ..default() },
            switch: None,
            pose: None,
            moved: 0,
            since: 0,
            gone: None,
        })
    }

    pub(super) fn take_back(&mut self, world: &mut World, wants: bool, complaints: &mut Complaints) {
        let Ok(mut entity) = world.get_entity_mut(self.entity) else {
            complaints.flaws.push("an emitter was taken away");
            return;
        };
        // A hand takes over by events, which its motion follows.
        let is_taken = entity.take::<ByHand>().is_some();
        let transform = entity.get::<Transform>().copied().unwrap_or_default();
        let is_moved = transform != self.transform;
        if is_moved {
            entity.insert((self.transform, GlobalTransform::from(self.transform)));
        }
        let Some(mut emitter) = entity.get_mut::<Emitter>() else { return };
        let was = &self.emitter;
        if wants {
            if is_moved || is_taken {
                let from = if is_moved { transform } else { self.transform };
                self.pose = Some((from.translation, from.translation + from.forward() * AIM));
            }
            note(&mut self.switch, emitter.enabled, was.enabled);
            note(&mut self.wanted.rate, emitter.rate, was.rate);
            note(&mut self.wanted.flow, emitter.flow, was.flow);
            note(&mut self.wanted.shape, emitter.shape, was.shape);
            note(&mut self.wanted.speed, emitter.speed, was.speed);
            note(&mut self.wanted.lifetime, emitter.lifetime, was.lifetime);
            if emitter.spread != was.spread {
                self.wanted.spread_deg = Some(emitter.spread.to_degrees());
            }
            if emitter.effect != was.effect {
                complaints.refused.push("effects of emitters are not exchanged while a session is recorded");
            }
        }
        if !is_same(&emitter, was) {
            *emitter = was.clone();
        }
    }

    pub(super) fn take_actions(&mut self, tick: u32, hz: u32, actions: &mut Vec<Action>) {
        if !self.wanted.is_empty() {
            let emitter = self.wanted.emitter.clone();
            let nothing = EmitterAdjustment { emitter, ..default() };
            actions.push(Action::Adjust(std::mem::replace(&mut self.wanted, nothing)));
        }
        let name = &self.wanted.emitter;
        let starts = self.switch == Some(true) && !self.emitter.enabled;
        let step = (hz / MOVES_PER_SECOND).max(1);
        if let Some((position, target)) = self.pose
            && (starts || (self.emitter.enabled && tick >= self.moved.saturating_add(step)))
        {
            // What begins somewhere does not come from elsewhere.
            let over = if starts { 0.0 } else { step as f32 / hz as f32 };
            actions.push(Action::Move(EmitterMove { emitter: name.clone(), position, target, over }));
            (self.pose, self.moved) = (None, tick);
        }
        match self.switch.take() {
            Some(true) if !self.emitter.enabled => actions.push(Action::Start(name.clone())),
            Some(false) if self.emitter.enabled => actions.push(Action::Stop(name.clone())),
            _ => {}
        }
    }
}

/// Whether two emitters do the same.
fn is_same(one: &Emitter, other: &Emitter) -> bool {
    let numbers = |emitter: &Emitter| [emitter.rate, emitter.speed, emitter.spread, emitter.lifetime];
    numbers(one) == numbers(other)
        && (one.enabled, one.flow, one.shape) == (other.enabled, other.flow, other.shape)
        && one.effect == other.effect
}
