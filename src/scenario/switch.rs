//! Another scenario in a running app.
//!
//! What the last one spawned goes, with all that fell; clock, weather and limits are those of the new one, as if it had been
//! the first. Reading files and growing stone takes seconds, so that is done before, on any thread
//! ([`PreparedScenario::new`]), and the switch itself is short.

use bevy::prelude::*;

use super::content::{Content, Looks};
use super::spawn::{set_up, spawn_scene};
use super::{LoadedScenario, ScenarioError, SceneEntity, reset_scenario};
use crate::clock::ShownTime;
use crate::effect::EffectTable;
use crate::wetting::DripEffect;

/// A scenario with all that it names, but for meshes from files.
pub struct PreparedScenario {
    loaded: LoadedScenario,
    content: Content,
    looks: Looks,
}

impl PreparedScenario {
    /// Loads what the scenario names. `looks` is false for apps without a renderer.
    ///
    /// # Errors
    /// [`ScenarioError::Content`] for files that cannot be used.
    pub fn new(loaded: LoadedScenario, looks: bool) -> Result<Self, ScenarioError> {
        let looks = Looks::drawn(looks);
        let content = loaded.content(looks)?;
        Ok(Self { loaded, content, looks })
    }

    /// What its file says.
    pub fn scenario(&self) -> &LoadedScenario {
        &self.loaded
    }
}

/// Takes the running scenario away and shows another, in a world with [`ScenarioPlugin`](super::ScenarioPlugin). It is
/// loading until [`ScenarioStatus`](super::ScenarioStatus) says otherwise.
///
/// Entities that the user has spawned stay, surfaces and emitters among them; they are dry and begin anew.
pub fn switch_scenario(world: &mut World, prepared: PreparedScenario) {
    reset_scenario(world);
    let mut parts = world.query_filtered::<Entity, With<SceneEntity>>();
    for part in parts.iter(world).collect::<Vec<_>>() {
        // One may have gone with another that it was a child of.
        if let Ok(entity) = world.get_entity_mut(part) {
            entity.despawn();
        }
    }
    // There are no particles: rows are as in an app that begins with this scenario, whose saved scenes so fit this one.
    let own = world.resource::<DripEffect>().rows.into_iter().flatten();
    let kept = own.map(|row| usize::from(row.0) + 1).max().unwrap_or(0);
    world.resource_mut::<EffectTable>().truncate(kept);
    world.insert_resource(ShownTime::Now);
    let PreparedScenario { loaded, content, looks } = prepared;
    set_up(world, &loaded, None);
    spawn_scene(world, &loaded, content, looks);
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::test_app::{app, run_ticks, wait};
    use super::*;
    use crate::particle::ParticleCounts;
    use crate::scenario::{Scenario, ScenarioSurface, scene_digest};

    /// A floor below a tap. `name`: of the floor.
    fn scenario(folder: &Path, name: &str, hz: u32) -> LoadedScenario {
        std::fs::write(folder.join("tap.effect.ron"), "(stamp_radius: 0.05)").unwrap();
        let text = format!(
            r#"(
                seconds: 3.0,
                tick_hz: {hz},
                camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
                materials: {{"plain": ()}},
                surfaces: [(name: "{name}", mesh: Ground(size: (1.0, 1.0), cells: (2, 2)), material: "plain",
                    maps: (map_size: 32))],
                emitters: [(name: "tap", effect: "tap.effect.ron", rate: 50.0, speed: 1.0, spread_deg: 20.0,
                    keys: [(position: (0.0, 0.5, 0.0), target: (0.0, 0.0, 0.0))])],
            )"#
        );
        let file = folder.join(format!("{name}.ron"));
        std::fs::write(&file, text).unwrap();
        Scenario::load(&file).unwrap()
    }

    /// Seconds of it, and what came of them.
    fn run(app: &mut App, ticks: u32) -> (String, ParticleCounts, String) {
        wait(app);
        run_ticks(app, ticks);
        let world = app.world_mut();
        let digest = scene_digest(world);
        let mut names = world.query::<&ScenarioSurface>();
        let name = names.single(world).unwrap().name.clone();
        (digest, *world.resource::<ParticleCounts>(), name)
    }

    #[test]
    fn a_scenario_that_takes_the_place_of_another_runs_as_it_does_alone() {
        let folder = tempfile::tempdir().unwrap();
        let [first, second] = [("one", 20), ("two", 30)].map(|(name, hz)| scenario(folder.path(), name, hz));
        let alone = run(&mut app(second.clone()), 60);
        assert!(alone.1.hit > 20 && alone.2 == "two", "{alone:?}");
        let mut switched = app(first);
        assert_eq!(run(&mut switched, 40).2, "one");
        let prepared = PreparedScenario::new(second, false).unwrap();
        switch_scenario(switched.world_mut(), prepared);
        assert_eq!(run(&mut switched, 60), alone);
    }
}
