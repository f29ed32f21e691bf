//! Emitters as somebody has set them, and those that were added: what no scenario says.
//!
//! Particles and emitters of a saved scene name their effects by number: first those that drips have, then the scenario's, an emitter
//! after the other, then those that nobody but the session has, whose texts are kept. In another world the rows of the
//! [`EffectTable`] may be in another order; so numbers are found by handles when a scene is taken, and rows by numbers when it is
//! put back.

use std::f32::consts::PI;
use std::path::Path;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::maps::{STATE, value};
use super::{SaveError, SceneState, emitters_in_order};
use crate::effect::{EffectTable, WeatherEffect};
use crate::emitter::{Emitter, EmitterShape, Flow};
use crate::particle::SavedParticle;
use crate::scenario::{ByHand, OwnEffect, Scenario, SceneEntity};
use crate::wetting::DripEffect;

/// The largest length and the farthest place, metres.
const FAR: f32 = 1.0e5;

/// An emitter beside those of the scenario, with a [`stream`](Emitter::stream) behind theirs. It goes with the scene.
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component)]
#[require(SceneEntity)]
pub struct AddedEmitter;

/// An emitter of the scenario that was removed: it is there still, switched off, since a saved scene has all of them.
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component)]
pub struct RemovedEmitter;

/// What `state.ron` says of what emitters are.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct EmitterSettings {
    /// Texts of effects, in the order of their numbers behind the scenario's.
    effects: Vec<String>,
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

/// The effects that need no text, in the order of their numbers.
fn own_effects(world: &mut World) -> Vec<Handle<WeatherEffect>> {
    let mut emitters = world.query::<(&Emitter, &OwnEffect)>();
    let mut order: Vec<_> = emitters.iter(world).map(|(emitter, own)| (emitter.stream, own)).collect();
    order.sort_by_key(|(stream, _)| *stream);
    let drips = world.get_resource::<DripEffect>().filter(|drips| drips.rows.is_some());
    let drips = drips.into_iter().flat_map(|drips| drips.handles.iter().cloned());
    drips.chain(order.into_iter().map(|(_, own)| own.0.clone())).collect()
}

/// Numbers of effects.
struct Numbers {
    /// By number.
    handles: Vec<Handle<WeatherEffect>>,
    /// By row of the table: what was found already.
    of_rows: Vec<Option<u16>>,
}

impl Numbers {
    fn of(&mut self, handle: &Handle<WeatherEffect>) -> u16 {
        let found = self.handles.iter().position(|other| other == handle);
        found.unwrap_or_else(|| {
            self.handles.push(handle.clone());
            self.handles.len() - 1
        }) as u16
    }

    fn of_row(&mut self, row: u16, table: &EffectTable) -> u16 {
        let at = usize::from(row);
        let Some(effect) = table.rows().get(at) else { return row };
        if let Some(known) = self.of_rows[at] {
            return known;
        }
        let number = self.of(&effect.handle);
        self.of_rows[at] = Some(number);
        number
    }
}

/// Adds to a scene that has just been taken what its emitters are, and gives its effects their numbers.
pub(super) fn take(world: &mut World, state: &mut SceneState) -> Result<(), SaveError> {
    let own = own_effects(world);
    let (count, order) = (own.len(), emitters_in_order(world));
    let table = world.resource::<EffectTable>();
    let mut numbers = Numbers { handles: own, of_rows: vec![None; table.rows().len()] };
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
    for particle in state.particles.iter_mut().chain(&mut state.waiting) {
        particle.effect = numbers.of_row(particle.effect, table);
    }
    let texts = numbers.handles[count..].iter().map(|handle| text_of(world, handle));
    let effects = texts.collect::<Result<Vec<_>, _>>()?;
    state.settings = Some(EmitterSettings { effects, emitters });
    Ok(())
}

/// The text of an effect as it is now.
fn text_of(world: &World, handle: &Handle<WeatherEffect>) -> Result<String, SaveError> {
    let path = Path::new(STATE);
    let refused = |what: &str, expected: &str| value(path, "settings.effects", what, expected.into());
    let asset = world.get_resource::<Assets<WeatherEffect>>().and_then(|effects| effects.get(handle));
    let in_table = || {
        let rows = world.resource::<EffectTable>().rows();
        rows.iter().find(|row| row.handle == *handle)?.effect.as_ref()
    };
    let effect = asset.or_else(in_table).ok_or_else(|| refused("not loaded", "effects that are there"))?;
    if let Some(file) = effect.stamps.files().next() {
        return Err(refused(file, "an effect that names no pictures, which no saved scene takes along"));
    }
    effect.to_ron().map_err(|source| SaveError::Encode { path: path.into(), source: source.into() })
}

impl EmitterSettings {
    /// How many emitters are not the scenario's.
    pub(super) fn added(&self) -> usize {
        self.emitters.iter().filter(|setting| setting.role == Role::Added).count()
    }

    /// Checks all of it for a world that has so many emitters of a scenario; returns the effects that the texts are, and how many
    /// effects have numbers. `states`: how many emitters the scene has.
    pub(super) fn check(
        &self,
        world: &mut World,
        (scenario, states): (usize, usize),
        path: &Path,
    ) -> Result<(Vec<WeatherEffect>, usize), SaveError> {
        let of_all = |what: &str, count: usize, expected: String| {
            Err(value(path, &format!("settings.{what}"), count, expected))
        };
        let (count, added) = (self.emitters.len(), self.added());
        if count != states || count - added != scenario || added > Scenario::MAX_EMITTERS {
            let expected = format!("{states} of them, {scenario} of the scenario's");
            return of_all("emitters", count, expected);
        }
        let rows = world.resource::<EffectTable>().rows().len();
        if rows + self.effects.len() > usize::from(u16::MAX) {
            return of_all("effects", self.effects.len(), "few enough for the table of effects".into());
        }
        let mut effects = Vec::new();
        for (index, text) in self.effects.iter().enumerate() {
            let read = WeatherEffect::from_ron(text.as_bytes()).and_then(WeatherEffect::with_stamps);
            let field = format!("settings.effects[{index}]");
            effects.push(read.map_err(|error| {
                value(path, &field, "unusable", format!("the text of an effect that can be used: {error}"))
            })?);
        }
        let numbers = own_effects(world).len() + effects.len();
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
        Ok((effects, numbers))
    }

    /// Makes the emitters of a world what they were. `effects`: those that [`Self::check`] has read. Returns the rows of all
    /// effects that have numbers.
    pub(super) fn restore(&self, world: &mut World, effects: Vec<WeatherEffect>) -> Vec<u16> {
        let mut added = world.query_filtered::<Entity, With<AddedEmitter>>();
        for emitter in added.iter(world).collect::<Vec<_>>() {
            world.despawn(emitter);
        }
        let mut handles = own_effects(world);
        let own = handles.len();
        for effect in effects {
            let handle = handle_of(world, &handles[..own], effect);
            handles.push(handle);
        }
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

/// An effect that is none of the scenario's: one that is there already, from an earlier time, or a new one.
fn handle_of(
    world: &mut World,
    own: &[Handle<WeatherEffect>],
    effect: WeatherEffect,
) -> Handle<WeatherEffect> {
    let rows = world.resource::<EffectTable>().rows();
    let mut others = rows.iter().filter(|row| !own.contains(&row.handle));
    if let Some(known) = others.find(|row| row.effect.as_ref() == Some(&effect)) {
        return known.handle.clone();
    }
    let handle = world.resource_mut::<Assets<WeatherEffect>>().add(effect.clone());
    world.resource_mut::<EffectTable>().insert(handle.clone(), effect);
    handle
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

/// A particle whose effect is a row of a world. `rows`: of all effects that have numbers; without, it is one already.
pub(super) fn with_row(mut particle: SavedParticle, rows: Option<&[u16]>) -> SavedParticle {
    if let Some(row) = rows.and_then(|rows| rows.get(usize::from(particle.effect))) {
        particle.effect = *row;
    }
    particle
}
