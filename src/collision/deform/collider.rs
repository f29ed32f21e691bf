//! Which surfaces are posed, and what each was posed by.

use std::sync::Arc;

use bevy::math::Affine3A;
use bevy::mesh::morph::MeshMorphWeights;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::prelude::*;

use super::{Deformer, PosedMesh};
use crate::collision::{MeshBvh, SurfaceCollider};

/// The posed shape of a surface whose mesh is skinned or morphed. Added besides its [`SurfaceCollider`].
#[derive(Component)]
pub struct DeformingCollider {
    posed: Arc<PosedMesh>,
    /// What it was posed by; `None` before the first time.
    pose: Option<Pose>,
    /// What it will be posed by, if `stale`.
    next: Pose,
    stale: bool,
}

/// What a surface is posed by.
#[derive(Default, PartialEq)]
struct Pose {
    /// World from mesh by each joint; none if the surface is not skinned.
    joints: Vec<Affine3A>,
    morph_weights: Vec<f32>,
}

impl DeformingCollider {
    /// Of a surface that shows this mesh; `None` if the mesh cannot be posed.
    pub fn new(mesh: Arc<MeshBvh>) -> Option<Self> {
        let posed = Arc::new(PosedMesh::new(mesh)?);
        Some(Self { posed, pose: None, next: default(), stale: false })
    }

    /// The shape it has now; `None` until it is known.
    pub fn posed(&self) -> Option<&Arc<PosedMesh>> {
        self.pose.as_ref().map(|_| &self.posed)
    }

    /// Where its shape lies, if the surface has this transform, and the shape; `None` until it is known.
    pub(in crate::collision) fn placed(
        &self,
        transform: &GlobalTransform,
    ) -> Option<(Affine3A, Arc<PosedMesh>)> {
        let posed = self.posed()?.clone();
        Some((if posed.is_in_world() { Affine3A::IDENTITY } else { transform.affine() }, posed))
    }

    fn is_of(&self, mesh: &Arc<MeshBvh>) -> bool {
        Arc::ptr_eq(self.posed.mesh(), mesh)
    }

    pub(super) fn is_skinned(&self) -> bool {
        self.posed.mesh().deformer().is_some_and(Deformer::is_skinned)
    }

    /// Notes the next pose. Returns whether it is another than the last; one that is not a number always is.
    pub(super) fn note(&mut self, joints: impl Iterator<Item = Affine3A>, morph_weights: &[f32]) -> bool {
        self.next.joints.clear();
        self.next.joints.extend(joints);
        self.next.morph_weights.clear();
        self.next.morph_weights.extend_from_slice(morph_weights);
        self.stale = self.pose.as_ref() != Some(&self.next);
        self.stale
    }

    /// Whether it has to be posed.
    pub(super) fn is_stale(&self) -> bool {
        self.stale
    }

    /// Takes the pose that was noted.
    pub(super) fn take_pose(&mut self) {
        let pose = self.pose.get_or_insert_default();
        std::mem::swap(pose, &mut self.next);
        self.stale = false;
        // In place, since the scene has let go of it; whoever else still looks at the old shape keeps that.
        Arc::make_mut(&mut self.posed).pose(&pose.joints, &pose.morph_weights);
    }
}

/// Gives surfaces that are skinned or morphed a [`DeformingCollider`], and takes it from those that are not any more.
pub(in crate::collision) fn attach_deforming(
    mut commands: Commands,
    surfaces: Query<
        (
            Entity,
            Option<&SurfaceCollider>,
            Has<SkinnedMesh>,
            Has<MeshMorphWeights>,
            Option<&DeformingCollider>,
        ),
        Or<(With<SkinnedMesh>, With<MeshMorphWeights>, With<DeformingCollider>)>,
    >,
) {
    for (entity, collider, has_skin, has_weights, deforming) in &surfaces {
        let applies = |deformer: &Deformer| {
            (has_skin && deformer.is_skinned()) || (has_weights && deformer.is_morphed())
        };
        let mesh = collider.map(|collider| &collider.0);
        match (mesh.filter(|mesh| mesh.deformer().is_some_and(applies)), deforming) {
            (Some(mesh), Some(deforming)) if deforming.is_of(mesh) => {}
            (Some(mesh), _) => {
                if let Some(deforming) = DeformingCollider::new(mesh.clone()) {
                    commands.entity(entity).insert(deforming);
                }
            }
            (None, Some(_)) => {
                commands.entity(entity).remove::<DeformingCollider>();
            }
            (None, None) => {}
        }
    }
}
