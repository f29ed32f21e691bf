//! Emitters that come and go in a session.
//!
//! A scenario has all its emitters from the start. So one that is added comes behind those that are there, is switched on by an
//! event of the tick in which it was added, and is off before; one that is removed is switched off for good. In the seconds in
//! which it is not there yet, or no more, nothing that is done to it counts, and [`Recording::has_emitter`] says so. A branch from
//! before its time knows nothing of it; the file of its effect stays, since the file of the old branch names it.

use std::ops::Range;
use std::path::Path;

use bevy::prelude::*;

use super::file::write;
use super::watch::Watched;
use super::watched_emitter::WatchedEmitter;
use super::{ExtraEmitter, Recording};
use crate::effect::WeatherEffect;
use crate::scenario::{Action, EmitterAdjustment, EmitterSpec, Scenario, spawn_emitter};

/// What is wanted of the next tick.
pub(super) enum Change {
    Add(Box<ExtraEmitter>),
    Remove(Entity),
}

/// What an emitter's effect is called in the folder of a recording.
fn effect_file(emitter: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    format!("recorded_{}.effect.ron", emitter.chars().map(plain).collect::<String>())
}

/// `name`, `name 2`, ...: the first that is free.
pub(super) fn free_name(name: &str, is_taken: impl Fn(&str) -> bool) -> String {
    let numbered = |number: u32| if number < 2 { name.to_owned() } else { format!("{name} {number}") };
    (1..).map(numbered).find(|name| !is_taken(name)).unwrap_or_else(|| numbered(0))
}

impl Recording {
    /// Adds an emitter in the next tick. Where its name is taken, it gets a number, too. What is wrong with it is told by
    /// [`Self::take_notes`]; then there is none.
    pub fn add_emitter(&mut self, emitter: ExtraEmitter) {
        self.want(Change::Add(Box::new(emitter)));
    }

    /// Removes an emitter in the next tick, whose entity stays: going back in time, it is there again.
    pub fn remove_emitter(&mut self, emitter: Entity) {
        self.want(Change::Remove(emitter));
    }

    /// Whether an emitter of the session is there at this time: was added, if it was not from the start, and not removed.
    pub fn has_emitter(&self, emitter: Entity) -> bool {
        self.watched.emitter(emitter).is_some_and(|watched| watched.is_there(self.tick))
    }

    /// The ticks in which an emitter of the session is there: from that in which it was added, 0 if it was from the start, to before
    /// that in which it was removed, [`u32::MAX`] if it was not. None for an emitter that is not the session's.
    pub fn ticks_of(&self, emitter: Entity) -> Option<Range<u32>> {
        self.watched.emitter(emitter).map(WatchedEmitter::ticks)
    }

    fn want(&mut self, change: Change) {
        if self.is_live() {
            self.changes.push(change);
        } else {
            self.add_note("emitters come and go when the scene is there, and no time is being gone back in");
        }
    }

    /// Lets emitters come and go in a tick that begins; returns what has to happen in it for that.
    pub(super) fn change_emitters(&mut self, world: &mut World, tick: u32) -> Vec<Action> {
        let mut actions = Vec::new();
        for change in std::mem::take(&mut self.changes) {
            // On and off again, at most.
            if self.len() + self.base.len() + actions.len() + 2 > Self::MAX_EVENTS {
                self.add_note(format!("no more is recorded: there are {} events", Self::MAX_EVENTS));
                break;
            }
            match change {
                Change::Add(emitter) => match self.prepared(*emitter, tick) {
                    Ok((spec, effect, is_on)) => {
                        self.branch_off(world, tick);
                        let name = spec.name.clone();
                        self.insert_emitter(world, spec, effect, tick);
                        // What begins by being switched on has been off.
                        actions.push(Action::Start(name.clone()));
                        if !is_on {
                            actions.push(Action::Stop(name));
                        }
                    }
                    Err(why) => self.add_note(why),
                },
                Change::Remove(emitter) => {
                    if self.has_emitter(emitter) {
                        self.branch_off(world, tick);
                        // Also one that is off: events of the scenario may not switch it on again.
                        actions.extend(self.watched.remove_emitter(emitter, tick).map(Action::Stop));
                    }
                }
            }
        }
        actions
    }

    /// What comes is another branch, if this tick has been recorded already.
    fn branch_off(&mut self, world: &mut World, tick: u32) {
        if tick <= self.end {
            self.branch(world, tick);
            // This tick is not recorded yet, and what is done in it does not begin a branch once more.
            self.end = tick.saturating_sub(1);
        }
    }

    /// What an emitter is in the scenario, its effect, and whether it is on; the file of the effect has been written.
    fn prepared(
        &self,
        emitter: ExtraEmitter,
        tick: u32,
    ) -> Result<(EmitterSpec, WeatherEffect, bool), String> {
        let ExtraEmitter { mut spec, effect: text, is_on } = emitter;
        // A branch forgets those that came later, which are the last.
        let stays = |watched: &&WatchedEmitter| tick > self.end || watched.since < tick;
        let left = self.watched.emitters.iter().take_while(stays).count();
        let others = || self.loaded.scenario.emitters.iter().take(left);
        if left >= Scenario::MAX_EMITTERS {
            return Err(format!("no more emitters: there are {} (MAX_EMITTERS)", Scenario::MAX_EMITTERS));
        }
        let unusable =
            |why: &dyn std::fmt::Display| format!("the effect of {} cannot be used: {why}", spec.name);
        let effect = WeatherEffect::from_ron(text.as_bytes()).map_err(|error| unusable(&error))?;
        if effect.stamps.files().next().is_some() {
            return Err(unusable(&"it names pictures, which no recording takes along"));
        }
        let effect = effect.with_stamps().map_err(|error| unusable(&error))?;
        spec.name = free_name(&spec.name, |name| others().any(|other| other.name == name));
        (spec.start, spec.stop) = (0.0, None);
        let file = free_file(&self.loaded.tree, &spec.name);
        let path = self.loaded.tree.join(&file);
        write(&path, text.as_bytes()).map_err(|error| error.to_string())?;
        spec.effect = file;
        match self.loaded.validate_emitter("emitters[_]", &spec) {
            Ok(()) => Ok((spec, effect, is_on)),
            Err(error) => {
                std::fs::remove_file(path).ok();
                Err(error.to_string())
            }
        }
    }

    fn insert_emitter(&mut self, world: &mut World, spec: EmitterSpec, effect: WeatherEffect, tick: u32) {
        let emitters = &mut self.loaded.scenario.emitters;
        let index = emitters.len();
        emitters.push(spec);
        // It has sent nothing at any moment that is kept.
        self.history.resize_emitters(index + 1);
        if let Some(entity) = spawn_emitter(world, &self.loaded.scenario, index, effect) {
            self.watched.add_emitter(world, entity, tick);
        }
    }

    /// Emitters that were added in this tick or later have never been.
    pub(super) fn forget_emitters(&mut self, world: &mut World, tick: u32) {
        let left = self.watched.forget_emitters(world, tick);
        self.loaded.scenario.emitters.truncate(left);
        self.history.resize_emitters(left);
    }
}

/// A name that no file of a folder has, for the effect of an emitter.
pub(super) fn free_file(folder: &Path, emitter: &str) -> String {
    let is_taken = |name: &str| folder.join(effect_file(name)).exists();
    effect_file(&free_name(emitter, is_taken))
}

impl WatchedEmitter {
    /// The ticks by whose ends it has been added and not removed.
    fn ticks(&self) -> Range<u32> {
        self.since..self.gone.unwrap_or(u32::MAX)
    }

    /// Whether it has been added and not removed by the end of a tick.
    pub(super) fn is_there(&self, tick: u32) -> bool {
        self.ticks().contains(&tick)
    }
}

impl Watched {
    fn emitter(&self, entity: Entity) -> Option<&WatchedEmitter> {
        self.emitters.iter().find(|watched| watched.entity == entity)
    }

    /// Watches one more, whose stream is behind all others. `tick`: in which it was added.
    fn add_emitter(&mut self, world: &World, entity: Entity, tick: u32) {
        if let Some(mut watched) = WatchedEmitter::new(world, entity) {
            watched.since = tick;
            self.emitters.push(watched);
        }
    }

    /// From this tick on it is no more there, and nothing is wanted of it; returns its name.
    fn remove_emitter(&mut self, entity: Entity, tick: u32) -> Option<String> {
        let watched = self.emitters.iter_mut().find(|watched| watched.entity == entity)?;
        let name = watched.wanted.emitter.clone();
        watched.wanted = EmitterAdjustment { emitter: name.clone(), ..default() };
        (watched.switch, watched.pose, watched.gone) = (None, None, Some(tick));
        Some(name)
    }

    /// Despawns those that came in this tick or later; those that went are there. Returns how many there are.
    fn forget_emitters(&mut self, world: &mut World, tick: u32) -> usize {
        self.emitters.retain(|watched| {
            let stays = watched.since < tick;
            if !stays && let Ok(emitter) = world.get_entity_mut(watched.entity) {
                emitter.despawn();
            }
            stays
        });
        for watched in &mut self.emitters {
            watched.gone = watched.gone.filter(|gone| *gone < tick);
        }
        self.emitters.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_given_once_and_lead_nowhere() {
        let taken = ["hose", "hose 2"];
        assert_eq!(free_name("hose", |name| taken.contains(&name)), "hose 3");
        assert_eq!(free_name("rain", |name| taken.contains(&name)), "rain");
        assert_eq!(effect_file("../my hose"), "recorded____my_hose.effect.ron");
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(free_file(folder.path(), "hose"), "recorded_hose.effect.ron");
        std::fs::write(folder.path().join("recorded_hose.effect.ron"), "()").unwrap();
        assert_eq!(free_file(folder.path(), "hose"), "recorded_hose_2.effect.ron");
    }
}
