//! From mesh assets to colliders: built once per mesh, in the background.

use std::sync::Arc;

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task};

use super::{AwaitsUvs, Deformer, MeshBvh, MeshTriangles, TriangleError, TriangleReport, UvSet};
use crate::overlay::Weatherable;
use crate::wetting::MeasureTimer;

/// The BVH of this entity's mesh. Added to every [`Weatherable`] entity once it is built.
#[derive(Component, Clone)]
pub struct SurfaceCollider(pub Arc<MeshBvh>);

/// Why a [`Weatherable`] entity got no collider. Reported once; gone when it shows a mesh that will do.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotWeatherable(pub TriangleError);

/// Which triangles of this entity's mesh cannot be hit. Reported once.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColliderReport(pub TriangleReport);

type Built = Result<Arc<MeshBvh>, TriangleError>;

/// The BVHs of all meshes in use.
#[derive(Resource, Default)]
pub struct MeshColliders {
    meshes: HashMap<(AssetId<Mesh>, UvSet), MeshCollider>,
    /// Something was built in this frame.
    news: bool,
}

/// The BVH of one mesh. The last one stays in use while the next is being built.
#[derive(Default)]
struct MeshCollider {
    built: Option<Built>,
    task: Option<Task<Built>>,
    /// The tick in which `task` was begun.
    asked_at: u32,
    /// The mesh has changed since the last build began.
    stale: bool,
}

impl MeshColliders {
    /// How many meshes are being built right now, or will be.
    pub fn building(&self) -> usize {
        self.meshes.values().filter(|mesh| mesh.task.is_some() || mesh.stale).count()
    }

    /// The finished BVH of a mesh with the uvs of a set.
    pub fn get(&self, mesh: AssetId<Mesh>, uvs: UvSet) -> Option<&Arc<MeshBvh>> {
        self.meshes.get(&(mesh, uvs))?.built.as_ref()?.as_ref().ok()
    }
}

/// Surfaces that want a collider and have neither got one nor been refused, or show another mesh or have other uvs now.
type Wanting = (
    With<Weatherable>,
    Without<AwaitsUvs>,
    Or<((Without<SurfaceCollider>, Without<NotWeatherable>), Changed<Mesh3d>, Changed<UvSet>)>,
);

type Surface = (
    Entity,
    &'static Mesh3d,
    Option<&'static UvSet>,
    Option<&'static SurfaceCollider>,
    Option<&'static NotWeatherable>,
    Option<&'static Name>,
);

/// Notes which meshes changed or are gone.
pub(super) fn watch_meshes(
    mut events: MessageReader<AssetEvent<Mesh>>,
    mut colliders: ResMut<MeshColliders>,
) {
    for event in events.read() {
        match event {
            AssetEvent::Modified { id } => {
                for uvs in [UvSet::First, UvSet::Second] {
                    if let Some(mesh) = colliders.meshes.get_mut(&(*id, uvs)) {
                        mesh.stale = true;
                    }
                }
            }
            AssetEvent::Removed { id } => {
                for uvs in [UvSet::First, UvSet::Second] {
                    colliders.news |= colliders.meshes.remove(&(*id, uvs)).is_some();
                }
            }
            _ => {}
        }
    }
}

/// Starts building for meshes that are wanted and new, or changed, and collects what is finished.
pub(super) fn build_colliders(
    meshes: Res<Assets<Mesh>>,
    assets: Option<Res<AssetServer>>,
    timer: MeasureTimer,
    mut colliders: ResMut<MeshColliders>,
    wanting: Query<(&Mesh3d, Option<&UvSet>), Wanting>,
) {
    let MeshColliders { meshes: known, news } = &mut *colliders;
    for (handle, uvs) in &wanting {
        let key = (handle.id(), uvs.copied().unwrap_or_default());
        known.entry(key).or_insert_with(|| MeshCollider { stale: true, ..default() });
    }
    // One that never came and that nobody waits for any more would be waited for by all others.
    known.retain(|key, collider| {
        let is_idle = collider.stale && collider.task.is_none() && collider.built.is_none();
        let is_wanted =
            || wanting.iter().any(|(mesh, uvs)| (mesh.id(), uvs.copied().unwrap_or_default()) == *key);
        !is_idle || is_wanted()
    });
    for ((id, uvs), collider) in known.iter_mut() {
        if let Some(built) = timer.take(&mut collider.task, collider.asked_at) {
            (collider.built, *news) = (Some(built), true);
        }
        // A mesh that changes every frame is built as fast as it goes, one after the other.
        if !collider.stale || collider.task.is_some() {
            continue;
        }
        let load = || assets.as_ref().and_then(|assets| assets.get_load_state(*id));
        if let Some(mesh) = meshes.get(*id) {
            collider.stale = false;
            match MeshTriangles::with_uvs(mesh, *uvs) {
                Ok(triangles) => {
                    let deformer = Deformer::from_mesh(mesh, &triangles);
                    let build =
                        async move { Ok(Arc::new(MeshBvh::build(triangles).with_deformer(deformer))) };
                    collider.task = Some(AsyncComputeTaskPool::get().spawn(build));
                    collider.asked_at = timer.tick();
                }
                Err(error) => (collider.built, *news) = (Some(Err(error)), true),
            }
        } else if load().is_some_and(|state| state.is_failed()) {
            (collider.stale, collider.built, *news) = (false, Some(Err(TriangleError::NotLoaded)), true);
        }
    }
}

/// Gives finished BVHs to the surfaces that show their meshes, and tells what is wrong with the others.
pub(super) fn attach_colliders(
    mut commands: Commands,
    mut colliders: ResMut<MeshColliders>,
    wanting: Query<(), Wanting>,
    surfaces: Query<Surface, (With<Weatherable>, Without<AwaitsUvs>)>,
) {
    if !std::mem::take(&mut colliders.news) && wanting.is_empty() {
        return;
    }
    for (entity, mesh, uvs, collider, refused, name) in &surfaces {
        let label = || name.map_or_else(|| entity.to_string(), ToString::to_string);
        let mut entity = commands.entity(entity);
        let key = (mesh.id(), uvs.copied().unwrap_or_default());
        match colliders.meshes.get(&key).and_then(|mesh| mesh.built.as_ref()) {
            Some(Ok(bvh)) if collider.is_none_or(|collider| !Arc::ptr_eq(&collider.0, bvh)) => {
                let report = bvh.triangles().report;
                warn_of_skipped(report, label);
                entity
                    .remove::<NotWeatherable>()
                    .insert((SurfaceCollider(bvh.clone()), ColliderReport(report)));
            }
            Some(Err(error)) if refused != Some(&NotWeatherable(*error)) => {
                error!("{} cannot be weathered: {error}", label());
                entity.remove::<(SurfaceCollider, ColliderReport)>().insert(NotWeatherable(*error));
            }
            Some(_) => {}
            // Another mesh or other uvs, whose BVH is not there yet: the old one is not its shape.
            None if collider.is_some() || refused.is_some() => {
                entity.remove::<(SurfaceCollider, ColliderReport, NotWeatherable)>();
            }
            None => {}
        }
    }
}

/// Surfaces that have nothing that could be hit, which has not been told.
type Bare = (Without<Mesh3d>, Without<SurfaceCollider>, Without<NotWeatherable>);

/// Tells of surfaces that have no mesh. Those that are new may get one in the same frame.
pub(super) fn refuse_bare(
    mut commands: Commands,
    bare: Query<(Entity, Ref<Weatherable>, Option<&Name>), Bare>,
) {
    for (entity, surface, name) in &bare {
        if surface.is_added() {
            continue;
        }
        let label = name.map_or_else(|| entity.to_string(), ToString::to_string);
        let error = TriangleError::NoMesh;
        error!("{label} cannot be weathered: {error}");
        commands.entity(entity).try_insert(NotWeatherable(error));
    }
}

/// A surface that is not [`Weatherable`] any more is not hit any more.
pub(super) fn release_surface(removed: On<Remove, Weatherable>, mut commands: Commands) {
    let mut entity = commands.entity(removed.entity);
    entity.try_remove::<(SurfaceCollider, ColliderReport, NotWeatherable)>();
}

fn warn_of_skipped(report: TriangleReport, label: impl Fn() -> String) {
    if report.skipped() > 0 {
        warn!(
            "{}: {} of {} triangles cannot be hit ({} degenerate, {} not finite, {} out of range)",
            label(),
            report.skipped(),
            report.total,
            report.degenerate,
            report.non_finite,
            report.out_of_range
        );
    }
}

#[cfg(test)]
mod tests {
    use bevy::asset::AssetPlugin;
    use bevy::mesh::MeshPlugin;

    use super::*;
    use crate::collision::CollisionPlugin;

    fn app() -> App {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin))
            .add_plugins((crate::clock::ClockPlugin::default(), crate::effect::EffectPlugin))
            .add_plugins((crate::particle::ParticlePlugin, CollisionPlugin));
        app
    }

    fn add(app: &mut App, mesh: Mesh) -> Mesh3d {
        Mesh3d(app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh))
    }

    fn update_until_built(app: &mut App) {
        app.update();
        while app.world().resource::<MeshColliders>().building() > 0 {
            app.update();
        }
        app.update();
    }

    #[test]
    fn instances_share_one_bvh_and_bad_meshes_are_refused_once() {
        let mut app = app();
        let ball = add(&mut app, Sphere::new(1.0).into());
        let bare = add(&mut app, Mesh::from(Sphere::new(1.0)).with_removed_attribute(Mesh::ATTRIBUTE_UV_0));
        let spawn = |app: &mut App, mesh: &Mesh3d| {
            app.world_mut().spawn((Weatherable::default(), mesh.clone(), Transform::default())).id()
        };
        let (one, two, refused) = (spawn(&mut app, &ball), spawn(&mut app, &ball), spawn(&mut app, &bare));
        update_until_built(&mut app);
        let bvh = |entity| app.world().get::<SurfaceCollider>(entity).map(|collider| collider.0.clone());
        assert!(Arc::ptr_eq(&bvh(one).unwrap(), &bvh(two).unwrap()));
        assert!(bvh(refused).is_none());
        assert_eq!(app.world().get::<NotWeatherable>(refused), Some(&NotWeatherable(TriangleError::NoUvs)));
    }

    #[test]
    fn nobody_waits_for_a_mesh_whose_surface_went_before_it_came() {
        let mut app = app();
        let never = Mesh3d(app.world().resource::<Assets<Mesh>>().reserve_handle());
        let surface = app.world_mut().spawn((Weatherable::default(), never, Transform::default())).id();
        app.update();
        assert_eq!(app.world().resource::<MeshColliders>().building(), 1);
        app.world_mut().despawn(surface);
        app.update();
        assert_eq!(app.world().resource::<MeshColliders>().building(), 0);
    }

    #[test]
    fn a_changed_mesh_gets_a_new_bvh() {
        let mut app = app();
        let mesh = add(&mut app, Cuboid::new(1.0, 1.0, 1.0).into());
        let surface =
            app.world_mut().spawn((Weatherable::default(), mesh.clone(), Transform::default())).id();
        update_until_built(&mut app);
        let top = |app: &App| app.world().get::<SurfaceCollider>(surface).unwrap().0.bounds().1.y;
        assert!((top(&app) - 0.5).abs() < 1e-3);
        let taller = Mesh::from(Cuboid::new(1.0, 4.0, 1.0));
        app.world_mut().resource_mut::<Assets<Mesh>>().insert(mesh.id(), taller).unwrap();
        // Until then the old one is hit: there is never none.
        let mut frames = 0;
        while (top(&app) - 2.0).abs() > 1e-3 {
            app.update();
            frames += 1;
            assert!(frames < 10_000, "{}", top(&app));
        }
    }

    #[test]
    fn a_surface_that_shows_another_mesh_is_not_hit_in_its_old_shape() {
        let mut app = app();
        let (ball, bare) = (
            add(&mut app, Sphere::new(1.0).into()),
            add(&mut app, Mesh::from(Sphere::new(1.0)).with_removed_attribute(Mesh::ATTRIBUTE_UV_0)),
        );
        let surface = app.world_mut().spawn((Weatherable::default(), bare, Transform::default())).id();
        update_until_built(&mut app);
        assert!(app.world().get::<NotWeatherable>(surface).is_some());
        app.world_mut().entity_mut(surface).insert(ball);
        update_until_built(&mut app);
        assert!(app.world().get::<NotWeatherable>(surface).is_none());
        let height = app.world().get::<SurfaceCollider>(surface).unwrap().0.bounds().1.y;
        assert!((height - 1.0).abs() < 1e-2);
        let box_ = add(&mut app, Cuboid::new(1.0, 4.0, 1.0).into());
        app.world_mut().entity_mut(surface).insert(box_);
        app.update();
        assert!(app.world().get::<SurfaceCollider>(surface).is_none_or(|c| c.0.bounds().1.y > 1.9));
    }
}
