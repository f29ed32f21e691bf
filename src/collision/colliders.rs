//! From mesh assets to colliders: built once per mesh, in the background.

use std::sync::Arc;

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};

use super::{MeshBvh, MeshTriangles, TriangleError, TriangleReport};
use crate::overlay::Weatherable;

/// The BVH of this entity's mesh. Added to every [`Weatherable`] entity once it is built.
#[derive(Component, Clone)]
pub struct SurfaceCollider(pub Arc<MeshBvh>);

/// Why a [`Weatherable`] entity got no collider. Reported once; remove it to try again.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotWeatherable(pub TriangleError);

/// Which triangles of this entity's mesh cannot be hit. Reported once.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColliderReport(pub TriangleReport);

/// The BVHs of all meshes in use.
#[derive(Resource, Default)]
pub struct MeshColliders {
    meshes: HashMap<AssetId<Mesh>, Build>,
}

enum Build {
    Running(Task<Result<Arc<MeshBvh>, TriangleError>>),
    Done(Result<Arc<MeshBvh>, TriangleError>),
}

impl MeshColliders {
    /// How many meshes are being built right now.
    pub fn building(&self) -> usize {
        self.meshes.values().filter(|build| matches!(build, Build::Running(_))).count()
    }

    /// The finished BVH of a mesh.
    pub fn get(&self, mesh: AssetId<Mesh>) -> Option<&Arc<MeshBvh>> {
        match self.meshes.get(&mesh)? {
            Build::Done(Ok(bvh)) => Some(bvh),
            _ => None,
        }
    }
}

/// Entities that want a collider and have neither got one nor been refused.
type Waiting = (With<Weatherable>, Without<SurfaceCollider>, Without<NotWeatherable>);

/// Forgets the BVH of a mesh that changed or is gone; the entities that show it get a new one.
pub(super) fn forget_changed_meshes(
    mut commands: Commands,
    mut events: MessageReader<AssetEvent<Mesh>>,
    mut colliders: ResMut<MeshColliders>,
    entities: Query<(Entity, &Mesh3d), With<Weatherable>>,
    moved: Query<(Entity, &Mesh3d, &SurfaceCollider), Changed<Mesh3d>>,
) {
    for event in events.read() {
        let (AssetEvent::Modified { id } | AssetEvent::Removed { id }) = event else { continue };
        if colliders.meshes.remove(id).is_some() {
            for (entity, _) in entities.iter().filter(|(_, mesh)| mesh.id() == *id) {
                commands.entity(entity).remove::<(SurfaceCollider, NotWeatherable, ColliderReport)>();
            }
        }
    }
    for (entity, mesh, collider) in &moved {
        if colliders.get(mesh.id()).is_none_or(|bvh| !Arc::ptr_eq(bvh, &collider.0)) {
            commands.entity(entity).remove::<(SurfaceCollider, ColliderReport)>();
        }
    }
}

/// Starts building for meshes that are wanted and new, and collects what is finished.
pub(super) fn build_colliders(
    meshes: Res<Assets<Mesh>>,
    mut colliders: ResMut<MeshColliders>,
    waiting: Query<&Mesh3d, Waiting>,
) {
    for handle in &waiting {
        let Some(mesh) = meshes.get(handle) else { continue };
        colliders.meshes.entry(handle.id()).or_insert_with(|| match MeshTriangles::from_mesh(mesh) {
            Ok(triangles) => Build::Running(
                AsyncComputeTaskPool::get().spawn(async move { Ok(Arc::new(MeshBvh::build(triangles))) }),
            ),
            Err(error) => Build::Done(Err(error)),
        });
    }
    for build in colliders.meshes.values_mut() {
        if let Build::Running(task) = build
            && let Some(result) = check_ready(task)
        {
            *build = Build::Done(result);
        }
    }
}

/// Gives finished BVHs to the entities that wait for them, and tells what is wrong with the others.
pub(super) fn attach_colliders(
    mut commands: Commands,
    colliders: Res<MeshColliders>,
    waiting: Query<(Entity, &Mesh3d, Option<&Name>), Waiting>,
) {
    for (entity, mesh, name) in &waiting {
        let Some(Build::Done(result)) = colliders.meshes.get(&mesh.id()) else { continue };
        let name = name.map_or_else(|| entity.to_string(), ToString::to_string);
        match result {
            Ok(bvh) => {
                let report = bvh.triangles().report;
                if report.skipped() > 0 {
                    warn!(
                        "{name}: {} of {} triangles cannot be hit ({} degenerate, {} not finite, {} out of range)",
                        report.skipped(),
                        report.total,
                        report.degenerate,
                        report.non_finite,
                        report.out_of_range
                    );
                }
                commands.entity(entity).insert((SurfaceCollider(bvh.clone()), ColliderReport(report)));
            }
            Err(error) => {
                error!("{name} cannot be weathered: {error}");
                commands.entity(entity).insert(NotWeatherable(*error));
            }
        }
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
        for _ in 0..2 {
            update_until_built(&mut app);
        }
        assert!((top(&app) - 2.0).abs() < 1e-3, "{}", top(&app));
    }
}
