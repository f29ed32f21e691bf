//! Emitters that send nothing, since their effect cannot be had: they say so once.

use std::fmt;
use std::sync::Arc;

use bevy::asset::{AssetLoadError, LoadState};
use bevy::prelude::*;

use super::Emitter;
use crate::effect::{EffectTable, WeatherEffect};

/// On an [`Emitter`] that sends nothing, since this effect of its own cannot be had: its asset failed to load, or there never was
/// one. Reported once; gone when the emitter has an effect.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Eq)]
#[reflect(Component)]
pub struct NotEmitting(pub AssetId<WeatherEffect>);

/// Tells of emitters whose effect cannot be had.
pub(super) fn tell_silent(
    mut commands: Commands,
    table: Res<EffectTable>,
    loaded: Option<Res<Assets<WeatherEffect>>>,
    server: Option<Res<AssetServer>>,
    emitters: Query<(Entity, &Emitter, Option<&NotEmitting>, Option<&Name>)>,
) {
    for (entity, emitter, told, name) in &emitters {
        let id = emitter.effect.id();
        let is_told = told.is_some_and(|told| told.0 == id);
        let has_effect =
            loaded.as_ref().is_some_and(|loaded| loaded.contains(id)) || table.has(&emitter.effect);
        let wrong = if has_effect { None } else { what_is_wrong(emitter, server.as_deref()) };
        match wrong {
            Some(wrong) if !is_told => {
                let label = name.map_or_else(|| entity.to_string(), ToString::to_string);
                warn!("emitter {label} sends nothing: {wrong}");
                commands.entity(entity).try_insert(NotEmitting(id));
            }
            None if told.is_some() => {
                commands.entity(entity).try_remove::<NotEmitting>();
            }
            _ => {}
        }
    }
}

/// Why an emitter will have no effect. Asked for in each frame, put into words once.
enum Wrong<'a> {
    /// It never had one.
    NoEffect,
    /// Its asset failed to load.
    NotLoaded(&'a Emitter, Arc<AssetLoadError>),
}

impl fmt::Display for Wrong<'_> {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoEffect => write!(to, "it has no effect"),
            Self::NotLoaded(emitter, error) => match emitter.effect.path() {
                Some(path) => write!(to, "its effect `{path}` cannot be loaded: {error}"),
                None => write!(to, "its effect cannot be loaded: {error}"),
            },
        }
    }
}

/// Of an emitter without an effect: why there will be none. Nothing while it may still come.
fn what_is_wrong<'a>(emitter: &'a Emitter, server: Option<&AssetServer>) -> Option<Wrong<'a>> {
    if emitter.effect == Handle::default() {
        return emitter.enabled.then_some(Wrong::NoEffect);
    }
    match server?.get_load_state(&emitter.effect)? {
        LoadState::Failed(error) => Some(Wrong::NotLoaded(emitter, error)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(world: &mut World, emitter: Entity) -> Option<NotEmitting> {
        let mut schedule = Schedule::default();
        schedule.add_systems(tell_silent);
        schedule.run(world);
        world.get::<NotEmitting>(emitter).cloned()
    }

    #[test]
    fn an_emitter_that_never_got_an_effect_says_so_until_it_has_one() {
        let mut world = World::new();
        world.init_resource::<EffectTable>();
        let emitter = world.spawn(Emitter::default()).id();
        let off = world.spawn(Emitter { enabled: false, ..default() }).id();
        assert_eq!(told(&mut world, emitter), Some(NotEmitting(AssetId::default())));
        assert_eq!(told(&mut world, off), None);
        // In a table without an asset server, too.
        world.resource_mut::<EffectTable>().insert(Handle::default(), WeatherEffect::default());
        assert_eq!(told(&mut world, emitter), None);
    }

    #[test]
    fn one_that_waits_for_its_effect_says_nothing() {
        let mut world = World::new();
        world.init_resource::<EffectTable>();
        let effect = Handle::Uuid(bevy::asset::uuid::Uuid::from_u128(7), std::marker::PhantomData);
        let emitter = world.spawn(Emitter { effect, ..default() }).id();
        assert_eq!(told(&mut world, emitter), None);
    }

    #[test]
    fn what_is_told_already_is_not_told_again_however_many_frames_go_by() {
        let mut world = World::new();
        world.init_resource::<EffectTable>();
        let emitter = world.spawn(Emitter::default()).id();
        assert!(told(&mut world, emitter).is_some());
        world.clear_trackers();
        assert!(told(&mut world, emitter).is_some());
        let again = world.entity(emitter).get_ref::<NotEmitting>().map(|told| told.is_changed());
        assert_eq!(again, Some(false));
    }

    #[test]
    fn reasons_are_put_into_words_when_they_are_told() {
        let emitter = Emitter::default();
        assert!(matches!(what_is_wrong(&emitter, None), Some(Wrong::NoEffect)));
        assert_eq!(Wrong::NoEffect.to_string(), "it has no effect");
        let failed = Wrong::NotLoaded(&emitter, Arc::new(AssetLoadError::AssetMetaReadError));
        assert!(failed.to_string().starts_with("its effect cannot be loaded: "), "{failed}");
    }
}
