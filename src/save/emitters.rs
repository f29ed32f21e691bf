//! Emitters as somebody has set them, and those that were added: what no scenario says.

use std::f32::consts::PI;
use std::path::Path;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::effects::{EditedEffect, Effects, Numbers};
use super::maps::value;
use super::{SaveError, SceneState, emitters_in_order};
use crate::effect::{EffectTable, WeatherEffect};
use crate::emitter::{Emitter, EmitterShape, Flow};
use crate::scenario::{ByHand, Scenario, SceneEntity};

/// The largest length and the farthest place, metres.
const FAR: f32 = 1.0e5;

/// An emitter beside those of the scenario, with a [`stream`](Emitter::stream) behind theirs. It goes with the scene.
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default)]
#[require(SceneEntity)]
pub struct AddedEmitter;

/// An emitter of the scenario that was removed: it is there still, switched off, since a saved scene has all of them.
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default)]
pub struct RemovedEmitter;

/// What `state.ron` says of what emitters are.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct EmitterSettings {
    /// Texts of effects, in the order of their numbers behind the scenario's.
    effects: Vec<String>,
    /// Of the scenario's own, those that somebody has edited.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    edited: Vec<EditedEffect>,
    /// In the order of their streams.
    emitters: Vec<EmitterSetting>,
}

#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
struct EmitterSetting {
    name: String,
    stream: u32,
    role: Role,
    enabled: bool,
    /// Number of its effect.
    effect: u16,
    rate: f32,
    shape: EmitterShape,
    flow: Flow,
    speed: f32,
    /// Radians.
    spread: f32,
    lifetime: f32,
    position: Vec3,
    rotation: Quat,
}

/// Who says what an emitter does.
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    /// The scenario: where it is, and whether it is on.
    Scripted,
    /// Somebody who has taken it in hand.
    ByHand,
    /// Nobody any more.
    Removed,
    /// It is none of the scenario's.
    Added,
}

/// Adds to a scene that has just been taken what its emitters are, and gives its effects their numbers.
pub(super) fn take(world: &mut World, state: &mut SceneState) -> Result<(), SaveError> {
    let (mut numbers, order) = (Numbers::new(world), emitters_in_order(world));
    let mut emitters = Vec::new();
    for entity in order {
        let of = world.entity(entity);
        let Some(emitter) = of.get::<Emitter>() else { continue };
        let place = of.get::<Transform>().copied().unwrap_or_default();
        let role = if of.contains::<AddedEmitter>() {
            Role::Added
        } else if of.contains::<RemovedEmitter>() {
            Role::Removed
        } else if of.contains::<ByHand>() {
            Role::ByHand
        } else {
            Role::Scripted
        };
        emitters.push(EmitterSetting {
            name: of.get::<Name>().map(ToString::to_string).unwrap_or_default(),
            stream: emitter.stream,
            role,
            enabled: emitter.enabled && role != Role::Removed,
            effect: numbers.of(&emitter.effect),
            rate: emitter.rate,
            shape: emitter.shape,
            flow: emitter.flow,
            speed: emitter.speed,
            spread: emitter.spread,
            lifetime: emitter.lifetime,
            position: place.translation,
            rotation: place.rotation,
        });
    }
    let table = world.resource::<EffectTable>();
    for particle in state.particles.iter_mut().chain(&mut state.waiting) {
        particle.effect = numbers.of_row(particle.effect, table);
    }
    let (effects, edited) = numbers.texts(world)?;
    state.settings = Some(EmitterSettings { effects, edited, emitters });
    Ok(())
}

impl EmitterSettings {
    /// How many emitters are not the scenario's.
    pub(super) fn added(&self) -> usize {
        self.emitters.iter().filter(|setting| setting.role == Role::Added).count()
    }

    /// Checks all of it for a world that has so many emitters of a scenario; returns the effects that the texts are. `states`: how
    /// many emitters the scene has.
    pub(super) fn check(
        &self,
        world: &mut World,
        (scenario, states): (usize, usize),
        path: &Path,
    ) -> Result<Effects, SaveError> {
        let (count, added) = (self.emitters.len(), self.added());
        if count != states || count - added != scenario || added > Scenario::MAX_EMITTERS {
            let expected = format!("{states} of them, {scenario} of the scenario's");
            return Err(value(path, "settings.emitters", count, expected));
        }
        let effects = Effects::read(world, &self.effects, &self.edited, path)?;
        let numbers = effects.numbers;
        let mut least = 0;
        for (index, setting) in self.emitters.iter().enumerate() {
            let field = |name: &str| format!("settings.emitters[{index}].{name}");
            // The scenario's are numbered, and come first.
            let is_own = index < scenario;
            if is_own == (setting.role == Role::Added) {
                let expected = if is_own { "one of the scenario's" } else { "Added" };
                return Err(value(path, &field("role"), format!("{:?}", setting.role), expected.into()));
            }
            if setting.stream < least || (is_own && setting.stream as usize != index) {
                let expected = format!("{least} or more, in order");
                return Err(value(path, &field("stream"), setting.stream, expected));
            }
            least = setting.stream.saturating_add(1);
            if usize::from(setting.effect) >= numbers {
                return Err(value(path, &field("effect"), setting.effect, format!("below {numbers}")));
            }
            if let Some((name, number, (least, most))) = setting.out_of_range() {
                return Err(value(path, &field(name), number, format!("{least} to {most}")));
            }
            if !setting.rotation.is_normalized() {
                return Err(value(path, &field("rotation"), setting.rotation, "of length 1".into()));
            }
        }
        Ok(effects)
    }

    /// Makes the emitters of a world what they were. `effects`: those that [`Self::check`] has read. Returns the rows of all
    /// effects that have numbers.
    pub(super) fn restore(&self, world: &mut World, effects: Effects) -> Vec<u16> {
        let mut added = world.query_filtered::<Entity, With<AddedEmitter>>();
        for emitter in added.iter(world).collect::<Vec<_>>() {
            world.despawn(emitter);
        }
        let handles = effects.restore(world);
        let mut scenario = emitters_in_order(world).into_iter();
        for setting in &self.emitters {
            let emitter = if setting.role == Role::Added {
                Some(world.spawn((AddedEmitter, Name::new(setting.name.clone()))).id())
            } else {
                scenario.next()
            };
            let (Some(entity), Some(effect)) = (emitter, handles.get(usize::from(setting.effect))) else {
                continue;
            };
            setting.apply(&mut world.entity_mut(entity), effect.clone());
        }
        let mut table = world.resource_mut::<EffectTable>();
        // There is room: that was checked.
        handles.iter().map(|handle| table.index_of(handle).map_or(0, |row| row.0)).collect()
    }
}

impl EmitterSetting {
    /// The first number that no emitter can have, and its range.
    fn out_of_range(&self) -> Option<(&'static str, f32, (f32, f32))> {
        let far = (-FAR, FAR);
        let size = (0.0, FAR);
        let shape = match self.shape {
            EmitterShape::Point => [0.0; 3],
            EmitterShape::Cone { radius } | EmitterShape::Disc { radius } => [radius, 0.0, 0.0],
            EmitterShape::Box { half_size } => half_size.abs().to_array(),
            EmitterShape::Sky { half_size } => [half_size.x, half_size.y, 0.0],
        };
        let flow = match self.flow {
            Flow::Effect => 0.0,
            Flow::MmPerHour(flow) | Flow::LitresPerMinute(flow) => flow,
        };
        let [width, height, depth] = shape;
        let [x, y, z] = self.position.to_array();
        let numbers = [
            ("rate", self.rate, (0.0, Scenario::MAX_RATE)),
            ("flow", flow, (0.0, 10_000.0)),
            ("speed", self.speed, (0.0, 1000.0)),
            // Half a turn, as rounded on the way from degrees.
            ("spread", self.spread, (0.0, PI + 1.0e-5)),
            ("lifetime", self.lifetime, (0.0, 3600.0)),
            ("shape", width, size),
            ("shape", height, size),
            ("shape", depth, size),
            ("position", x, far),
            ("position", y, far),
            ("position", z, far),
        ];
        numbers.into_iter().find(|(_, number, (least, most))| !(*least..=*most).contains(number))
    }

    /// Makes an emitter what it was.
    fn apply(&self, emitter: &mut EntityWorldMut, effect: Handle<WeatherEffect>) {
        let transform = Transform::from_translation(self.position).with_rotation(self.rotation);
        let settings = Emitter {
            effect,
            rate: self.rate,
            shape: self.shape,
            flow: self.flow,
            speed: self.speed,
            spread: self.spread,
            lifetime: self.lifetime,
            stream: self.stream,
            enabled: self.enabled,
        };
        // A tick may come before transforms are propagated.
        emitter.insert((settings, transform, GlobalTransform::from(transform)));
        emitter.remove::<(ByHand, RemovedEmitter)>();
        match self.role {
            Role::Scripted | Role::Added => {}
            Role::ByHand => {
                emitter.insert(ByHand);
            }
            // Or its working hours would switch it on again.
            Role::Removed => {
                emitter.insert((ByHand, RemovedEmitter));
            }
        }
    }
}
