//! Looking at meshes, and unwrapping them, in the background.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task};

use super::{UniqueUvs, UnwrapError, UnwrapOptions, Wanting, unique_uvs};
use crate::collision::UvSet;
use crate::overlay::{OverlayUv, Weatherable};
use crate::wetting::MeasureTimer;

/// A mesh, and how it is unwrapped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key {
    pub(super) mesh: AssetId<Mesh>,
    pub(super) options: UnwrapOptions,
}

/// What is known of the meshes of all surfaces that want unique uvs, and the copies that have them.
#[derive(Resource, Default)]
pub struct Unwraps {
    pub(super) jobs: BTreeMap<Key, Job>,
    /// What each copy was made from.
    pub(super) made: BTreeMap<AssetId<Mesh>, Key>,
    /// Something was finished in this frame.
    pub(super) news: bool,
}

/// A mesh that is looked at. What was found last holds while the mesh, changed, is looked at again.
#[derive(Default)]
pub(super) struct Job {
    task: Option<Task<Result<UniqueUvs, UnwrapError>>>,
    /// The tick in which `task` was begun.
    asked_at: u32,
    /// The mesh has changed since the last task began.
    stale: bool,
    pub(super) outcome: Option<Outcome>,
    /// Keeps a new copy until surfaces do.
    pub(super) fresh: Option<Handle<Mesh>>,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Outcome {
    /// The mesh has unique uvs.
    Given(UvSet),
    /// A copy has.
    Cut(AssetId<Mesh>),
    /// There are none.
    Refused(UnwrapError),
}

impl Outcome {
    fn copy(&self) -> Option<AssetId<Mesh>> {
        match self {
            Self::Cut(copy) => Some(*copy),
            _ => None,
        }
    }
}

impl Unwraps {
    /// How many meshes are being looked at or unwrapped right now, or will be.
    pub fn working(&self) -> usize {
        self.jobs.values().filter(|job| job.task.is_some() || job.stale).count()
    }

    /// Whether this mesh is an unwrapped copy, so that its [`Mesh::ATTRIBUTE_UV_1`] is unique.
    pub fn is_unwrapped(&self, mesh: AssetId<Mesh>) -> bool {
        self.made.contains_key(&mesh)
    }

    /// What a surface that shows a mesh asks for: a copy of it or, if it is one already, of what that was made from.
    pub(super) fn key(&self, shown: AssetId<Mesh>, options: UnwrapOptions, meshes: &Assets<Mesh>) -> Key {
        match self.made.get(&shown) {
            Some(made) if made.options == options || meshes.contains(made.mesh) => {
                Key { mesh: made.mesh, options }
            }
            _ => Key { mesh: shown, options },
        }
    }

    /// The job for a key: begun with what is known of the mesh for maps of any size, or with nothing.
    fn job(&mut self, key: Key) -> &mut Job {
        let of_mesh = self.jobs.iter().filter(|(other, _)| other.mesh == key.mesh);
        let given = of_mesh.filter(|(_, job)| !job.stale && job.task.is_none()).find_map(|(_, job)| {
            let given = matches!(job.outcome, Some(Outcome::Given(_)));
            given.then(|| job.outcome.clone()).flatten()
        });
        let new = || Job { stale: given.is_none(), outcome: given, ..default() };
        self.jobs.entry(key).or_insert_with(new)
    }

    fn forget(&mut self, gone: AssetId<Mesh>) {
        if let Some(key) = self.made.remove(&gone)
            && self.jobs.get(&key).is_some_and(|job| job.copy() == Some(gone))
        {
            self.jobs.remove(&key);
        }
        // A copy may be shown for longer than what it was made from.
        self.jobs.retain(|key, job| key.mesh != gone || job.copy().is_some());
    }
}

impl Job {
    fn copy(&self) -> Option<AssetId<Mesh>> {
        self.outcome.as_ref().and_then(Outcome::copy)
    }

    fn finish(&mut self, result: Result<UniqueUvs, UnwrapError>, meshes: &mut Assets<Mesh>) {
        self.outcome = Some(match result {
            Err(error) => Outcome::Refused(error),
            Ok(UniqueUvs::Given(set)) => Outcome::Given(set),
            Ok(UniqueUvs::Cut(mesh)) => {
                if let Some(copy) = self.copy()
                    && let Some(mut shown) = meshes.get_mut(copy)
                {
                    *shown = *mesh;
                    Outcome::Cut(copy)
                } else {
                    let copy = meshes.add(*mesh);
                    let outcome = Outcome::Cut(copy.id());
                    self.fresh = Some(copy);
                    outcome
                }
            }
        });
    }
}

/// Notes which meshes changed or are gone.
pub(super) fn watch_meshes(mut events: MessageReader<AssetEvent<Mesh>>, mut unwraps: ResMut<Unwraps>) {
    for event in events.read() {
        match event {
            AssetEvent::Modified { id } => {
                let of_it = unwraps.jobs.iter_mut().filter(|(key, _)| key.mesh == *id);
                of_it.for_each(|(_, job)| job.stale = true);
            }
            // Loaded at last.
            AssetEvent::Added { id } => {
                let of_it = unwraps.jobs.iter_mut().filter(|(key, _)| key.mesh == *id);
                of_it.for_each(|(_, job)| job.stale |= matches!(job.outcome, Some(Outcome::Refused(_))));
            }
            AssetEvent::Removed { id } => unwraps.forget(*id),
            _ => {}
        }
    }
}

/// Starts looking at meshes that are wanted and new, or changed, and collects what is finished.
pub(super) fn run_unwraps(
    mut meshes: ResMut<Assets<Mesh>>,
    assets: Option<Res<AssetServer>>,
    timer: MeasureTimer,
    mut unwraps: ResMut<Unwraps>,
    wanting: Query<(&Weatherable, &Mesh3d), Wanting>,
) {
    for (surface, mesh) in &wanting {
        if surface.wanted_uv() == OverlayUv::Mesh {
            continue;
        }
        let key = unwraps.key(mesh.id(), surface.unwrap_options(), &meshes);
        let job = unwraps.job(key);
        // Nobody showed the copy any more.
        if job.copy().is_some_and(|copy| !meshes.contains(copy)) {
            (job.outcome, job.stale) = (None, true);
        }
    }
    let Unwraps { jobs, made, news } = &mut *unwraps;
    for (key, job) in jobs.iter_mut() {
        if let Some(result) = timer.take(&mut job.task, job.asked_at) {
            *news = true;
            job.finish(result, &mut meshes);
            if let Some(copy) = &job.fresh {
                made.insert(copy.id(), *key);
            }
        }
        // A mesh that changes every frame is looked at as fast as it goes, one time after the other.
        if !job.stale || job.task.is_some() {
            continue;
        }
        let load = || assets.as_ref().and_then(|assets| assets.get_load_state(key.mesh));
        if let Some(mesh) = meshes.get(key.mesh) {
            let (mesh, options) = (mesh.clone(), key.options);
            let look = async move { unique_uvs(&mesh, &options) };
            (job.stale, job.asked_at) = (false, timer.tick());
            job.task = Some(AsyncComputeTaskPool::get().spawn(look));
        } else if load().is_some_and(|state| state.is_failed()) {
            (job.stale, *news) = (false, true);
            job.outcome = Some(Outcome::Refused(UnwrapError::NotLoaded));
        }
    }
}
