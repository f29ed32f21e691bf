//! Which surfaces are posed, and what each was posed by.

use std::sync::Arc;

use bevy::math::Affine3A;
use bevy::mesh::morph::MeshMorphWeights;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::prelude::*;

use super::{Deformer, PosedMesh};
use crate::clock::WeatheringClock;
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
    /// Tick in which it took its pose.
    posed_at: u32,
    /// Tick in which it took the pose before; none if that cannot be compared.
    posed_before: Option<u32>,
}

/// Parts of a second. What has not been posed for longer than that stood still, and then jumped.
const SLOWEST_POSES: u32 = 4;

/// What moves faster than this has jumped, m/s.
const FASTEST: f32 = 60.0;

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
        Some(Self { posed, pose: None, next: default(), stale: false, posed_at: 0, posed_before: None })
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
        Some((self.world_from_shape(transform), posed))
    }

    /// Where its shape lies, if the surface has this transform.
    pub(crate) fn world_from_shape(&self, transform: &GlobalTransform) -> Affine3A {
        if self.posed.is_in_world() { Affine3A::IDENTITY } else { transform.affine() }
    }

    /// How fast a point of a triangle is moved by poses, m/s in the space of the shape; 0 at rest, after a jump, and where it is
    /// not known. `weights`: of the second and third corner. Several ticks may share a pose, that of their frame.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub(crate) fn velocity(&self, triangle: usize, weights: [f32; 2], clock: &WeatheringClock) -> Vec3 {
        let ticks = self.posed_before.map_or(0, |before| self.posed_at.saturating_sub(before));
        let is_moving = ticks > 0
            && ticks <= (clock.hz() / SLOWEST_POSES).max(1)
            && clock.tick().saturating_sub(self.posed_at) < ticks;
        if !is_moving {
            return Vec3::ZERO;
        }
        let ([a, b, c], [to_b, to_c]) = (self.posed.moved(triangle), weights);
        let velocity = (a + (b - a) * to_b + (c - a) * to_c) * (clock.hz() as f32 / ticks as f32);
        // Not a number is not slower, either.
        if velocity.length() < FASTEST { velocity } else { Vec3::ZERO }
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

    /// Takes the pose that was noted, in this tick.
    pub(super) fn take_pose(&mut self, tick: u32) {
        let before = self.pose.is_some().then_some((self.posed_at, self.posed.is_in_world()));
        let pose = self.pose.get_or_insert_default();
        std::mem::swap(pose, &mut self.next);
        self.stale = false;
        // In place, since the scene has let go of it; whoever else still looks at the old shape keeps that.
        Arc::make_mut(&mut self.posed).pose(&pose.joints, &pose.morph_weights);
        let in_world = self.posed.is_in_world();
        self.posed_before = before.filter(|&(_, space)| space == in_world).map(|(tick, _)| tick);
        self.posed_at = tick;
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
