//! Texture coordinates of their own for surfaces whose mesh has none that are unique.
//!
//! Maps lie over the uvs of a mesh. Where those tile, or halves of a mesh share them, a drop on one place shows at
//! another. [`measure_overlap`] finds such meshes, [`unwrapped`] gives them a second set, [`Mesh::ATTRIBUTE_UV_1`], and
//! leaves the first for textures.
//!
//! A surface that asks for it ([`OverlayUv::Unique`]) gets a copy of its mesh with that set: made in the background, once
//! for each mesh and size of map, and shared by all surfaces that show it. Until then it has no collider
//! ([`AwaitsUnwrap`]). [`UnwrappedFrom`] remembers what it showed, and what it shows again when it asks no more. A mesh
//! that changes is unwrapped again, and its copy changes in place.
//!
//! Not here: what reads the second set; a choice where seams go.

mod mesh;
mod overlap;

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};

pub use mesh::{UnwrapError, UnwrapOptions, unwrapped};
pub use overlap::{UvOverlap, measure_overlap};

use crate::collision::{BuildColliders, ColliderReport, NotWeatherable, SurfaceCollider};
use crate::overlay::{OverlayUv, Weatherable};

/// The mesh that this surface showed before it got an unwrapped copy.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct UnwrappedFrom(pub Handle<Mesh>);

/// This surface's mesh is being unwrapped. It cannot be hit: what fell on it would lie in the wrong place.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub struct AwaitsUnwrap;

/// Why a surface that asked for unique texture coordinates keeps those of its mesh. Reported once.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct NotUnwrapped(pub UnwrapError);

/// What this module knows of a surface.
type Unwrapping = (UnwrappedFrom, AwaitsUnwrap, NotUnwrapped);

/// Surfaces that are new, have changed what they ask for, or show another mesh.
type Wanting = (With<Weatherable>, Or<(Changed<Weatherable>, Changed<Mesh3d>)>);

/// In `PreUpdate`, before colliders: meshes are unwrapped, and surfaces get them.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct UnwrapMeshes;

/// A mesh, and how it is unwrapped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    mesh: AssetId<Mesh>,
    options: UnwrapOptions,
}

/// The unwrapped copies of all meshes in use.
#[derive(Resource, Default)]
pub struct Unwraps {
    jobs: BTreeMap<Key, Job>,
    /// What each copy was made from.
    made: BTreeMap<AssetId<Mesh>, Key>,
    /// Something was finished in this frame.
    news: bool,
}

/// A copy of a mesh. The last one stays in use while the next is being made.
#[derive(Default)]
struct Job {
    task: Option<Task<Result<Mesh, UnwrapError>>>,
    /// The mesh has changed since the last task began.
    stale: bool,
    outcome: Option<Result<AssetId<Mesh>, UnwrapError>>,
    /// Keeps a new copy until surfaces do.
    fresh: Option<Handle<Mesh>>,
}

impl Unwraps {
    /// How many meshes are being unwrapped right now, or will be.
    pub fn working(&self) -> usize {
        self.jobs.values().filter(|job| job.task.is_some() || job.stale).count()
    }

    /// Whether this mesh is an unwrapped copy, so that its [`Mesh::ATTRIBUTE_UV_1`] is unique.
    pub fn is_unwrapped(&self, mesh: AssetId<Mesh>) -> bool {
        self.made.contains_key(&mesh)
    }

    /// What a surface that shows a mesh asks for: a copy of it or, if it is one already, of what that was made from.
    fn key(&self, shown: AssetId<Mesh>, options: UnwrapOptions, meshes: &Assets<Mesh>) -> Key {
        match self.made.get(&shown) {
            Some(made) if made.options == options || meshes.contains(made.mesh) => {
                Key { mesh: made.mesh, options }
            }
            _ => Key { mesh: shown, options },
        }
    }

    fn forget(&mut self, gone: AssetId<Mesh>) {
        if let Some(key) = self.made.remove(&gone)
            && self.jobs.get(&key).is_some_and(|job| job.outcome == Some(Ok(gone)))
        {
            self.jobs.remove(&key);
        }
        // A copy may be shown for longer than what it was made from.
        self.jobs.retain(|key, job| key.mesh != gone || matches!(job.outcome, Some(Ok(_))));
    }
}

impl Job {
    fn finish(&mut self, result: Result<Mesh, UnwrapError>, meshes: &mut Assets<Mesh>) {
        let mesh = match result {
            Ok(mesh) => mesh,
            Err(error) => {
                self.outcome = Some(Err(error));
                return;
            }
        };
        if let Some(Ok(shown)) = self.outcome
            && let Some(mut shown) = meshes.get_mut(shown)
        {
            *shown = mesh;
            return;
        }
        let copy = meshes.add(mesh);
        self.outcome = Some(Ok(copy.id()));
        self.fresh = Some(copy);
    }
}

/// Gives surfaces texture coordinates of their own.
pub struct UnwrapPlugin;

impl Plugin for UnwrapPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Unwraps>().add_observer(release_surface).add_systems(
            PreUpdate,
            (watch_meshes, run_unwraps, exchange_meshes)
                .chain()
                .in_set(UnwrapMeshes)
                // A surface is hit in the mesh that it shows from now on.
                .before(BuildColliders),
        );
    }
}

fn options(surface: &Weatherable) -> UnwrapOptions {
    UnwrapOptions { map_size: surface.texels(), ..default() }
}

/// Notes which meshes changed or are gone.
fn watch_meshes(mut events: MessageReader<AssetEvent<Mesh>>, mut unwraps: ResMut<Unwraps>) {
    for event in events.read() {
        match event {
            AssetEvent::Modified { id } => {
                let of_it = unwraps.jobs.iter_mut().filter(|(key, _)| key.mesh == *id);
                of_it.for_each(|(_, job)| job.stale = true);
            }
            // Loaded at last.
            AssetEvent::Added { id } => {
                let of_it = unwraps.jobs.iter_mut().filter(|(key, _)| key.mesh == *id);
                of_it.for_each(|(_, job)| job.stale |= matches!(job.outcome, Some(Err(_))));
            }
            AssetEvent::Removed { id } => unwraps.forget(*id),
            _ => {}
        }
    }
}

/// Starts unwrapping meshes that are wanted and new, or changed, and collects what is finished.
fn run_unwraps(
    mut meshes: ResMut<Assets<Mesh>>,
    assets: Option<Res<AssetServer>>,
    mut unwraps: ResMut<Unwraps>,
    wanting: Query<(&Weatherable, &Mesh3d), Wanting>,
) {
    for (surface, mesh) in &wanting {
        if surface.uv != OverlayUv::Unique {
            continue;
        }
        let key = unwraps.key(mesh.id(), options(surface), &meshes);
        let job = unwraps.jobs.entry(key).or_insert_with(|| Job { stale: true, ..default() });
        // Nobody showed the copy any more.
        if matches!(job.outcome, Some(Ok(copy)) if !meshes.contains(copy)) {
            (job.outcome, job.stale) = (None, true);
        }
    }
    let Unwraps { jobs, made, news } = &mut *unwraps;
    for (key, job) in jobs.iter_mut() {
        if let Some(task) = &mut job.task
            && let Some(result) = check_ready(task)
        {
            (job.task, *news) = (None, true);
            job.finish(result, &mut meshes);
            if let Some(copy) = &job.fresh {
                made.insert(copy.id(), *key);
            }
        }
        // A mesh that changes every frame is unwrapped as fast as it goes, one time after the other.
        if !job.stale || job.task.is_some() {
            continue;
        }
        let load = || assets.as_ref().and_then(|assets| assets.get_load_state(key.mesh));
        if let Some(mesh) = meshes.get(key.mesh) {
            let (mesh, options) = (mesh.clone(), key.options);
            let unwrap = async move { unwrapped(&mesh, &options) };
            (job.stale, job.task) = (false, Some(AsyncComputeTaskPool::get().spawn(unwrap)));
        } else if load().is_some_and(|state| state.is_failed()) {
            (job.stale, job.outcome, *news) = (false, Some(Err(UnwrapError::NotLoaded)), true);
        }
    }
}

/// Gives unwrapped copies to the surfaces that asked for them, and tells what is wrong with the others.
fn exchange_meshes(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut unwraps: ResMut<Unwraps>,
    wanting: Query<(), Wanting>,
    surfaces: Query<(
        Entity,
        &Weatherable,
        &Mesh3d,
        Option<&UnwrappedFrom>,
        Has<AwaitsUnwrap>,
        Option<&NotUnwrapped>,
        Option<&Name>,
    )>,
) {
    if !std::mem::take(&mut unwraps.news) && wanting.is_empty() {
        return;
    }
    for (entity, surface, shown, from, waits, refused, name) in &surfaces {
        let label = || name.map_or_else(|| entity.to_string(), ToString::to_string);
        let mut entity = commands.entity(entity);
        // What it showed before, if it shows a copy now.
        let before = from.filter(|_| unwraps.is_unwrapped(shown.id())).map(|from| &from.0);
        if surface.uv != OverlayUv::Unique {
            if let Some(before) = before {
                entity.insert(Mesh3d(before.clone()));
            }
            if from.is_some() || waits || refused.is_some() {
                entity.remove::<Unwrapping>();
            }
            continue;
        }
        let key = unwraps.key(shown.id(), options(surface), &meshes);
        let Some(job) = unwraps.jobs.get(&key) else { continue };
        match &job.outcome {
            None if waits => {}
            None => {
                // It may have been hit in another shape.
                entity
                    .remove::<(SurfaceCollider, ColliderReport, NotWeatherable, NotUnwrapped)>()
                    .insert(AwaitsUnwrap);
            }
            Some(Ok(copy)) if *copy == shown.id() && from.is_some() && !waits && refused.is_none() => {}
            Some(Ok(copy)) => {
                let source = match before {
                    Some(before) if before.id() == key.mesh => Some(before.clone()),
                    _ if key.mesh == shown.id() => Some(shown.0.clone()),
                    // Somebody gave it a copy that another surface shows.
                    _ => meshes.get_strong_handle(key.mesh),
                };
                if *copy != shown.id()
                    && let Some(copy) = meshes.get_strong_handle(*copy)
                {
                    if has_second_uvs(&meshes, key.mesh) {
                        warn!("{}: its mesh's `UV_1` is replaced; what else reads it goes wrong", label());
                    }
                    entity.insert(Mesh3d(copy));
                }
                if let Some(source) = source {
                    entity.insert(UnwrappedFrom(source));
                }
                entity.remove::<(AwaitsUnwrap, NotUnwrapped)>();
            }
            Some(Err(error)) if refused.is_none_or(|refused| refused.0 != *error) => {
                error!("{} keeps the texture coordinates of its mesh: {error}", label());
                if let Some(before) = before {
                    entity.insert(Mesh3d(before.clone()));
                }
                entity.remove::<(UnwrappedFrom, AwaitsUnwrap)>().insert(NotUnwrapped(error.clone()));
            }
            Some(Err(_)) => {}
        }
    }
    // From here on surfaces keep the copies, or nobody wants them.
    unwraps.jobs.values_mut().for_each(|job| job.fresh = None);
}

fn has_second_uvs(meshes: &Assets<Mesh>, mesh: AssetId<Mesh>) -> bool {
    let contains = |mesh: &Mesh| matches!(mesh.try_contains_attribute(Mesh::ATTRIBUTE_UV_1), Ok(true));
    meshes.get(mesh).is_some_and(contains)
}

/// A surface that is not [`Weatherable`] any more shows its own mesh again.
fn release_surface(
    removed: On<Remove, Weatherable>,
    mut commands: Commands,
    unwraps: Res<Unwraps>,
    surfaces: Query<(&Mesh3d, &UnwrappedFrom)>,
) {
    let mut entity = commands.entity(removed.entity);
    if let Ok((shown, from)) = surfaces.get(removed.entity)
        && unwraps.is_unwrapped(shown.id())
    {
        entity.try_insert(Mesh3d(from.0.clone()));
    }
    entity.try_remove::<Unwrapping>();
}

#[cfg(test)]
mod tests {
    use bevy::asset::{AssetPlugin, RenderAssetUsages};
    use bevy::mesh::{MeshPlugin, PrimitiveTopology};

    use super::*;
    use crate::collision::{CollisionPlugin, MeshColliders};

    fn app() -> App {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin, UnwrapPlugin));
        app
    }

    fn add(app: &mut App, mesh: impl Into<Mesh>) -> Handle<Mesh> {
        app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh.into())
    }

    fn surface(uv: OverlayUv) -> Weatherable {
        Weatherable { map_size: 64, uv, ..default() }
    }

    fn spawn(app: &mut App, mesh: &Handle<Mesh>, uv: OverlayUv) -> Entity {
        app.world_mut().spawn((surface(uv), Mesh3d(mesh.clone()))).id()
    }

    fn update_until_done(app: &mut App) {
        app.update();
        while app.world().resource::<Unwraps>().working() > 0 {
            app.update();
        }
        app.update();
    }

    fn shown(app: &App, entity: Entity) -> AssetId<Mesh> {
        app.world().get::<Mesh3d>(entity).unwrap().id()
    }

    fn source(app: &App, entity: Entity) -> Option<AssetId<Mesh>> {
        app.world().get::<UnwrappedFrom>(entity).map(|from| from.0.id())
    }

    fn mesh(app: &App, id: AssetId<Mesh>) -> &Mesh {
        app.world().resource::<Assets<Mesh>>().get(id).unwrap()
    }

    /// Upper end of a mesh.
    fn top(mesh: &Mesh) -> f32 {
        let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).unwrap().as_float3().unwrap();
        positions.iter().fold(f32::MIN, |top, position| top.max(position[1]))
    }

    #[test]
    fn instances_share_one_copy_and_others_keep_the_mesh() {
        let mut app = app();
        let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
        let [one, two] = [OverlayUv::Unique; 2].map(|uv| spawn(&mut app, &cube, uv));
        let plain = spawn(&mut app, &cube, OverlayUv::Mesh);
        app.update();
        assert_eq!(app.world().resource::<Unwraps>().working(), 1);
        assert!(app.world().get::<AwaitsUnwrap>(one).is_some() && shown(&app, one) == cube.id());
        update_until_done(&mut app);

        let copy = shown(&app, one);
        assert!(copy != cube.id() && shown(&app, two) == copy && shown(&app, plain) == cube.id());
        assert_eq!([one, two, plain].map(|entity| source(&app, entity).is_some()), [true, true, false]);
        assert_eq!(source(&app, one), Some(cube.id()));
        assert!([one, two].iter().all(|&entity| app.world().get::<AwaitsUnwrap>(entity).is_none()));
        assert!(mesh(&app, copy).contains_attribute(Mesh::ATTRIBUTE_UV_1));
        assert!(!mesh(&app, cube.id()).contains_attribute(Mesh::ATTRIBUTE_UV_1));
        let unwraps = app.world().resource::<Unwraps>();
        assert!(unwraps.is_unwrapped(copy) && !unwraps.is_unwrapped(cube.id()));

        // One that comes later takes it as well, whichever of the two meshes it is given.
        let late = spawn(&mut app, &cube, OverlayUv::Unique);
        let handed = app.world().get::<Mesh3d>(one).unwrap().0.clone();
        let later = spawn(&mut app, &handed, OverlayUv::Unique);
        update_until_done(&mut app);
        assert!([late, later].iter().all(|&entity| shown(&app, entity) == copy));
        assert!([late, later].iter().all(|&entity| source(&app, entity) == Some(cube.id())));
        assert_eq!(app.world().resource::<Assets<Mesh>>().len(), 2);
    }

    #[test]
    fn each_size_of_map_has_a_copy_of_its_own() {
        let mut app = app();
        let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
        let [small, large] = [OverlayUv::Unique; 2].map(|uv| spawn(&mut app, &cube, uv));
        app.world_mut().get_mut::<Weatherable>(large).unwrap().map_size = 256;
        update_until_done(&mut app);
        assert_ne!(shown(&app, small), shown(&app, large));
        let of_small = shown(&app, small);
        app.world_mut().get_mut::<Weatherable>(large).unwrap().map_size = 64;
        update_until_done(&mut app);
        assert_eq!(shown(&app, large), of_small);
        assert_eq!(source(&app, large), Some(cube.id()));
    }

    #[test]
    fn a_surface_that_shows_another_mesh_gets_a_copy_of_that() {
        let mut app = app();
        let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
        let tower = add(&mut app, Cuboid::new(1.0, 6.0, 1.0));
        let surface = spawn(&mut app, &cube, OverlayUv::Unique);
        update_until_done(&mut app);
        app.world_mut().entity_mut(surface).insert(Mesh3d(tower.clone()));
        app.update();
        assert!(app.world().get::<AwaitsUnwrap>(surface).is_some());
        update_until_done(&mut app);
        assert!(app.world().get::<AwaitsUnwrap>(surface).is_none());
        assert_eq!(source(&app, surface), Some(tower.id()));
        assert_eq!(top(mesh(&app, shown(&app, surface))), 3.0);
    }

    #[test]
    fn a_mesh_that_changes_changes_its_copy_in_place() {
        let mut app = app();
        let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
        let surface = spawn(&mut app, &cube, OverlayUv::Unique);
        update_until_done(&mut app);
        let copy = shown(&app, surface);
        let mut meshes = app.world_mut().resource_mut::<Assets<Mesh>>();
        meshes.insert(cube.id(), Cuboid::new(1.0, 6.0, 1.0).into()).unwrap();
        // The message is sent at the end of a frame.
        app.update();
        update_until_done(&mut app);
        assert_eq!((shown(&app, surface), source(&app, surface)), (copy, Some(cube.id())));
        assert_eq!(top(mesh(&app, copy)), 3.0);
    }

    #[test]
    fn what_cannot_be_unwrapped_keeps_its_mesh_until_it_can() {
        let mut app = app();
        let lines = Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[0.0f32; 3]; 2]);
        let lines = add(&mut app, lines);
        let surface = spawn(&mut app, &lines, OverlayUv::Unique);
        update_until_done(&mut app);
        let refused = NotUnwrapped(UnwrapError::Topology(PrimitiveTopology::LineList));
        assert_eq!(app.world().get::<NotUnwrapped>(surface), Some(&refused));
        assert!(app.world().get::<AwaitsUnwrap>(surface).is_none());
        assert_eq!((shown(&app, surface), source(&app, surface)), (lines.id(), None));

        let mut meshes = app.world_mut().resource_mut::<Assets<Mesh>>();
        meshes.insert(lines.id(), Cuboid::new(1.0, 1.0, 1.0).into()).unwrap();
        app.update();
        update_until_done(&mut app);
        assert!(app.world().get::<NotUnwrapped>(surface).is_none());
        assert_eq!(source(&app, surface), Some(lines.id()));

        // And back: the copy is of a mesh that is not there any more.
        let gone = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default());
        app.world_mut().resource_mut::<Assets<Mesh>>().insert(lines.id(), gone).unwrap();
        app.update();
        update_until_done(&mut app);
        let refused = NotUnwrapped(UnwrapError::NoPositions);
        assert_eq!(app.world().get::<NotUnwrapped>(surface), Some(&refused));
        assert_eq!((shown(&app, surface), source(&app, surface)), (lines.id(), None));
    }

    #[test]
    fn a_surface_that_asks_no_more_shows_its_own_mesh() {
        let mut app = app();
        let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
        let [turned, released] = [OverlayUv::Unique; 2].map(|uv| spawn(&mut app, &cube, uv));
        update_until_done(&mut app);
        assert_ne!(shown(&app, turned), cube.id());
        app.world_mut().get_mut::<Weatherable>(turned).unwrap().uv = OverlayUv::Mesh;
        app.world_mut().entity_mut(released).remove::<Weatherable>();
        app.update();
        for entity in [turned, released] {
            assert_eq!((shown(&app, entity), source(&app, entity)), (cube.id(), None));
        }
    }

    #[test]
    fn copies_go_with_the_last_surface_that_shows_them() {
        let mut app = app();
        let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
        let surface = spawn(&mut app, &cube, OverlayUv::Unique);
        drop(cube);
        update_until_done(&mut app);
        assert_eq!(app.world().resource::<Assets<Mesh>>().len(), 2);
        app.world_mut().despawn(surface);
        for _ in 0..4 {
            app.update();
        }
        let unwraps = app.world().resource::<Unwraps>();
        assert!(unwraps.jobs.is_empty() && unwraps.made.is_empty());
        assert!(app.world().resource::<Assets<Mesh>>().is_empty());
    }

    #[test]
    fn a_surface_that_waits_is_not_hit() {
        let mut app = app();
        app.add_plugins((crate::clock::ClockPlugin::default(), crate::effect::EffectPlugin))
            .add_plugins((crate::particle::ParticlePlugin, CollisionPlugin));
        let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
        let [surface, other] = [OverlayUv::Mesh; 2].map(|uv| spawn(&mut app, &cube, uv));
        let hit = |app: &App, entity| app.world().get::<SurfaceCollider>(entity).is_some();
        while !hit(&app, surface) {
            app.update();
        }
        // The collider of its old mesh is there, and another surface goes on using it.
        app.world_mut().get_mut::<Weatherable>(surface).unwrap().uv = OverlayUv::Unique;
        while source(&app, surface).is_none() {
            app.update();
            assert!(hit(&app, other));
            let waits = app.world().get::<AwaitsUnwrap>(surface).is_some();
            assert!(!waits || !hit(&app, surface));
        }
        while !hit(&app, surface) {
            app.update();
        }
        let bvh = |entity| app.world().get::<SurfaceCollider>(entity).unwrap().0.clone();
        let built = app.world().resource::<MeshColliders>().get(shown(&app, surface)).unwrap();
        assert!(std::sync::Arc::ptr_eq(&bvh(surface), built));
        assert!(!std::sync::Arc::ptr_eq(&bvh(surface), &bvh(other)));
    }
}
