//! Effects of a saved scene: their numbers, and the texts of those that are in no file as they are.
//!
//! Particles and emitters of a saved scene name their effects by number: first those that drips have, then the scenario's, an emitter
//! after the other, then those that nobody but the session has, whose texts are kept. In another world the rows of the
//! [`EffectTable`] may be in another order; so numbers are found by handles when a scene is taken, and rows by numbers when it is
//! put back. Texts of the scenario's own effects are kept where somebody has edited them.

use std::path::Path;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::SaveError;
use super::maps::{STATE, value};
use crate::effect::{EffectError, EffectTable, WeatherEffect};
use crate::emitter::Emitter;
use crate::particle::SavedParticle;
use crate::scenario::OwnEffect;
use crate::wetting::DripEffect;

/// Where texts are.
const FIELD: &str = "settings.effects";

/// The text of an effect of the scenario's own that is not as in its file.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct EditedEffect {
    /// Of the emitter that it belongs to.
    stream: u32,
    text: String,
}

/// Effects that have been read from their texts.
pub(super) struct Effects {
    /// What the scenario's own are, an emitter after the other.
    own: Vec<(Handle<WeatherEffect>, WeatherEffect)>,
    /// Those behind them.
    others: Vec<WeatherEffect>,
    /// How many have numbers.
    pub(super) numbers: usize,
}

/// The scenario's own, an emitter after the other, with their streams.
fn own_effects(world: &mut World) -> Vec<(u32, OwnEffect)> {
    let mut emitters = world.query::<(&Emitter, &OwnEffect)>();
    let mut order: Vec<_> =
        emitters.iter(world).map(|(emitter, own)| (emitter.stream, own.clone())).collect();
    order.sort_by_key(|(stream, _)| *stream);
    order
}

/// The effects that have numbers without a text, in the order of these.
fn first_numbers(world: &World, own: &[(u32, OwnEffect)]) -> Vec<Handle<WeatherEffect>> {
    let drips = world.get_resource::<DripEffect>().filter(|drips| drips.rows.is_some());
    let drips = drips.into_iter().flat_map(|drips| drips.handles.iter().cloned());
    drips.chain(own.iter().map(|(_, own)| own.handle.clone())).collect()
}

/// Numbers of effects.
pub(super) struct Numbers {
    own: Vec<(u32, OwnEffect)>,
    /// By number.
    handles: Vec<Handle<WeatherEffect>>,
    /// How many of them need no text.
    first: usize,
    /// By row of the table: what was found already.
    of_rows: Vec<Option<u16>>,
}

impl Numbers {
    pub(super) fn new(world: &mut World) -> Self {
        let own = own_effects(world);
        let handles = first_numbers(world, &own);
        let rows = world.resource::<EffectTable>().rows().len();
        Self { own, first: handles.len(), handles, of_rows: vec![None; rows] }
    }

    pub(super) fn of(&mut self, handle: &Handle<WeatherEffect>) -> u16 {
        let found = self.handles.iter().position(|other| other == handle);
        found.unwrap_or_else(|| {
            self.handles.push(handle.clone());
            self.handles.len() - 1
        }) as u16
    }

    pub(super) fn of_row(&mut self, row: u16, table: &EffectTable) -> u16 {
        let at = usize::from(row);
        let Some(effect) = table.rows().get(at) else { return row };
        if let Some(known) = self.of_rows[at] {
            return known;
        }
        let number = self.of(&effect.handle);
        self.of_rows[at] = Some(number);
        number
    }

    /// The texts of those that need one, and of the scenario's own that were edited.
    pub(super) fn texts(&self, world: &World) -> Result<(Vec<String>, Vec<EditedEffect>), SaveError> {
        let others = self.handles[self.first..].iter().map(|handle| {
            let missing = || value(Path::new(STATE), FIELD, "not loaded", "effects that are there".into());
            now(world, handle).ok_or_else(missing).and_then(|effect| text_of(effect, None))
        });
        let edited = self.own.iter().filter_map(|(stream, own)| {
            let effect = now(world, &own.handle).filter(|effect| !is_same(effect, &own.read))?;
            Some(text_of(effect, Some(own)).map(|text| EditedEffect { stream: *stream, text }))
        });
        Ok((others.collect::<Result<Vec<_>, _>>()?, edited.collect::<Result<Vec<_>, _>>()?))
    }
}

/// An effect as it is now.
fn now<'a>(world: &'a World, handle: &Handle<WeatherEffect>) -> Option<&'a WeatherEffect> {
    let asset = world.get_resource::<Assets<WeatherEffect>>().and_then(|effects| effects.get(handle));
    asset.or_else(|| {
        let rows = world.resource::<EffectTable>().rows();
        rows.iter().find(|row| row.handle == *handle)?.effect.as_ref()
    })
}

/// Whether two effects say the same. Stamps follow from what they say.
fn is_same(one: &WeatherEffect, other: &WeatherEffect) -> bool {
    let said = |effect: &WeatherEffect| WeatherEffect { stamp_set: None, ..effect.clone() };
    said(one) == said(other)
}

/// The text of an effect. `own`: what it was edited from, whose pictures are where the scenario is.
fn text_of(effect: &WeatherEffect, own: Option<&OwnEffect>) -> Result<String, SaveError> {
    let path = Path::new(STATE);
    let is_there = own.is_some_and(|own| own.read.stamps == effect.stamps);
    if let Some(file) = effect.stamps.files().next().filter(|_| !is_there) {
        let expected = "an effect that names no pictures, which no saved scene takes along";
        return Err(value(path, FIELD, file, expected.into()));
    }
    effect.to_ron().map_err(|source| SaveError::Encode { path: path.into(), source: source.into() })
}

/// The effect of a text, with its stamps.
fn effect_of(text: &str, own: Option<&OwnEffect>) -> Result<WeatherEffect, EffectError> {
    let effect = WeatherEffect::from_ron(text.as_bytes())?;
    match own.filter(|own| own.read.stamps == effect.stamps) {
        Some(own) => Ok(WeatherEffect { stamp_set: own.read.stamp_set.clone(), ..effect }),
        None => effect.with_stamps(),
    }
}

impl Effects {
    /// Reads and checks the texts of a scene that is to be put into a world.
    pub(super) fn read(
        world: &mut World,
        texts: &[String],
        edited: &[EditedEffect],
        path: &Path,
    ) -> Result<Self, SaveError> {
        let rows = world.resource::<EffectTable>().rows().len();
        if rows + texts.len() > usize::from(u16::MAX) {
            return Err(value(path, FIELD, texts.len(), "few enough for the table of effects".into()));
        }
        let unusable = |field: &str, error: EffectError| {
            value(path, field, "unusable", format!("the text of an effect that can be used: {error}"))
        };
        let mut others = Vec::new();
        for (index, text) in texts.iter().enumerate() {
            let field = format!("{FIELD}[{index}]");
            others.push(effect_of(text, None).map_err(|error| unusable(&field, error))?);
        }
        let owns = own_effects(world);
        let numbers = first_numbers(world, &owns).len() + others.len();
        let mut own: Vec<_> = owns.iter().map(|(_, own)| (own.handle.clone(), own.read.clone())).collect();
        for (index, EditedEffect { stream, text }) in edited.iter().enumerate() {
            let field = |name: &str| format!("settings.edited[{index}].{name}");
            let Some(at) = owns.iter().position(|(other, _)| other == stream) else {
                return Err(value(
                    path,
                    &field("stream"),
                    stream,
                    "that of an emitter of the scenario".into(),
                ));
            };
            let effect = effect_of(text, Some(&owns[at].1));
            own[at].1 = effect.map_err(|error| unusable(&field("text"), error))?;
        }
        Ok(Self { own, others, numbers })
    }

    /// Makes the effects of a world what they were; returns those that have numbers, in the order of these.
    pub(super) fn restore(self, world: &mut World) -> Vec<Handle<WeatherEffect>> {
        let mut handles = {
            let own = own_effects(world);
            first_numbers(world, &own)
        };
        for (handle, effect) in self.own {
            if now(world, &handle).is_some_and(|now| is_same(now, &effect)) {
                continue;
            }
            let mut effects = world.resource_mut::<Assets<WeatherEffect>>();
            if let Err(error) = effects.insert(&handle, effect.clone()) {
                warn!("an effect that was edited cannot be put back: {error}");
                continue;
            }
            world.resource_mut::<EffectTable>().insert(handle, effect);
        }
        let first = handles.len();
        for effect in self.others {
            let handle = handle_of(world, &handles[..first], effect);
            handles.push(handle);
        }
        handles
    }
}

/// An effect that is none of the scenario's: one that is there already, from an earlier time, or a new one.
fn handle_of(
    world: &mut World,
    first: &[Handle<WeatherEffect>],
    effect: WeatherEffect,
) -> Handle<WeatherEffect> {
    let rows = world.resource::<EffectTable>().rows();
    let mut others = rows.iter().filter(|row| !first.contains(&row.handle));
    if let Some(known) = others.find(|row| row.effect.as_ref() == Some(&effect)) {
        return known.handle.clone();
    }
    let handle = world.resource_mut::<Assets<WeatherEffect>>().add(effect.clone());
    world.resource_mut::<EffectTable>().insert(handle.clone(), effect);
    handle
}

/// A particle whose effect is a row of a world. `rows`: of all effects that have numbers; without, it is one already.
pub(super) fn with_row(mut particle: SavedParticle, rows: Option<&[u16]>) -> SavedParticle {
    if let Some(row) = rows.and_then(|rows| rows.get(usize::from(particle.effect))) {
        particle.effect = *row;
    }
    particle
}
