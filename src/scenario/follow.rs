//! Effects that follow their files, in apps whose asset server watches these.
//!
//! Every emitter of a scenario has an effect of its own, read before anything is spawned, so that nothing waits for it and
//! nobody's edit is another's. What is edited in the file is copied to the own effects of all emitters that it belongs to, also
//! of those that send out another one just now.

use bevy::prelude::*;

use super::{AssetTree, LoadedScenario, OwnEffect};
use crate::effect::WeatherEffect;

/// The file of an emitter's effect.
#[derive(Component, Debug, Clone)]
pub(super) struct EffectFile(Handle<WeatherEffect>);

/// Has an emitter of the scenario follow the file of its effect, if the app's asset server reads from the scenario's tree.
pub(super) fn follow_effect(world: &mut World, loaded: &LoadedScenario, index: usize, emitter: Entity) {
    let is_watched = world.get_resource::<AssetTree>().is_some_and(|AssetTree(tree)| *tree == loaded.tree);
    if let Some(spec) = loaded.scenario.emitters.get(index).filter(|_| is_watched)
        && let Some(server) = world.get_resource::<AssetServer>()
    {
        let file = EffectFile(server.load(spec.effect.clone()));
        world.entity_mut(emitter).insert(file);
    }
}

/// Copies effects whose files have been read again to their emitters.
pub(super) fn follow_effect_files(
    mut events: MessageReader<AssetEvent<WeatherEffect>>,
    mut emitters: Query<(&mut OwnEffect, &EffectFile)>,
    mut effects: ResMut<Assets<WeatherEffect>>,
) {
    for event in events.read() {
        let AssetEvent::Modified { id } = *event else { continue };
        for (mut own, EffectFile(file)) in &mut emitters {
            if file.id() == id
                && let Some(effect) = effects.get(id).cloned()
            {
                own.read.clone_from(&effect);
                if let Err(error) = effects.insert(&own.handle, effect) {
                    warn!("an effect was read again, and cannot be used: {error}");
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emitter::Emitter;

    #[test]
    fn emitters_of_a_file_follow_it_and_others_do_not() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default())).init_asset::<WeatherEffect>();
        app.add_systems(PreUpdate, follow_effect_files);
        let of = |volume_mm3| WeatherEffect { volume_mm3, ..default() };
        let mut effects = app.world_mut().resource_mut::<Assets<WeatherEffect>>();
        let [file, own, exchanged, other] = [1.0, 1.0, 1.0, 2.0].map(|volume| effects.add(of(volume)));
        let emitter = |effect: &Handle<WeatherEffect>| Emitter { effect: effect.clone(), ..default() };
        let own_of = |effect: &Handle<WeatherEffect>| OwnEffect { handle: effect.clone(), read: of(1.0) };
        app.world_mut().spawn((emitter(&own), own_of(&own), EffectFile(file.clone())));
        app.world_mut().spawn((emitter(&other), own_of(&exchanged), EffectFile(file.clone())));
        app.world_mut().spawn((emitter(&other), own_of(&other)));
        let volumes = |app: &mut App| {
            app.update();
            app.update();
            let effects = app.world().resource::<Assets<WeatherEffect>>();
            [&own, &exchanged, &other].map(|handle| effects.get(handle).map(|effect| effect.volume_mm3))
        };
        assert_eq!(volumes(&mut app), [Some(1.0), Some(1.0), Some(2.0)]);
        app.world_mut().resource_mut::<Assets<WeatherEffect>>().insert(&file, of(7.0)).unwrap();
        // Also where another is sent out, which stays as it is.
        assert_eq!(volumes(&mut app), [Some(7.0), Some(7.0), Some(2.0)]);
        let mut owned = app.world_mut().query::<(&OwnEffect, Has<EffectFile>)>();
        assert!(owned.iter(app.world()).all(|(own, follows)| (own.read.volume_mm3 == 7.0) == follows));
    }
}
