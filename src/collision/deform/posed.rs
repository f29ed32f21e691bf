//! A mesh in the pose of one surface.

use std::sync::Arc;

use bevy::math::Affine3A;
use bevy::prelude::*;

use crate::collision::bvh::{DeformingBvh, Segment};
use crate::collision::{LocalHit, MeshBvh, MeshTriangles};

/// A mesh as one surface shows it, with its posed vertices under a BVH. Triangles, uvs and their numbers are those of the
/// mesh at rest; only places change.
#[derive(Clone)]
pub struct PosedMesh {
    mesh: Arc<MeshBvh>,
    positions: Vec<Vec3>,
    /// In the pose before.
    previous: Vec<Vec3>,
    bvh: DeformingBvh,
    in_world: bool,
}

impl PosedMesh {
    /// The mesh at rest; `None` if it is none that can be posed.
    pub fn new(mesh: Arc<MeshBvh>) -> Option<Self> {
        let (deformer, rest) = mesh.deforming()?;
        let (positions, bvh) = (deformer.rest().to_vec(), rest.clone());
        Some(Self { mesh, previous: positions.clone(), positions, bvh, in_world: false })
    }

    /// Takes a pose: joints and weights as [`Deformer::pose`](super::Deformer::pose) wants them. Nothing is allocated,
    /// unless the BVH has to be built anew or there are so many vertices that threads share them.
    pub fn pose(&mut self, joints: &[Affine3A], morph_weights: &[f32]) {
        let Some((deformer, _)) = self.mesh.deforming() else { return };
        std::mem::swap(&mut self.positions, &mut self.previous);
        deformer.pose(joints, morph_weights, &mut self.positions);
        self.in_world = deformer.is_skinned() && !joints.is_empty();
        self.bvh.refit(&self.positions);
    }

    /// The mesh that is posed.
    pub fn mesh(&self) -> &Arc<MeshBvh> {
        &self.mesh
    }

    /// Whether it lies in world space, wherever its entity is: joints have put it there. Else it lies in mesh space.
    pub fn is_in_world(&self) -> bool {
        self.in_world
    }

    /// The triangles at rest, with their uvs.
    pub fn triangles(&self) -> &MeshTriangles {
        self.mesh.triangles()
    }

    /// The posed vertices.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// The vertices of each triangle, in the order of [`Self::triangles`].
    pub fn vertices(&self) -> &[[u32; 3]] {
        self.mesh.deformer().map_or(&[][..], |deformer| &deformer.corners()[..])
    }

    /// The posed corners of a triangle, by its index in [`Self::triangles`].
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.vertices()[triangle].map(|vertex| self.positions[vertex as usize])
    }

    /// How far the corners of a triangle have come since the pose before this one; nonsense if that was in another space.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub(super) fn moved(&self, triangle: usize) -> [Vec3; 3] {
        let moved = |vertex: u32| self.positions[vertex as usize] - self.previous[vertex as usize];
        self.vertices()[triangle].map(moved)
    }

    /// Smallest and largest corner of everything that can be hit; `None` if nothing can.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        self.bvh.bounds()
    }

    /// Boxes so many levels below the outermost one, as [`MeshBvh::boxes`]; but the tree is binary: three of its levels are about
    /// one of the other.
    pub fn boxes(&self, level: u32, most: usize) -> Vec<(Vec3, Vec3)> {
        self.bvh.boxes(level, most)
    }

    /// The closest hit on the segment from `start` to `end`, as [`MeshBvh::cast`].
    pub fn cast(&self, start: Vec3, end: Vec3) -> Option<LocalHit> {
        self.cast_within(Segment::new(start, end)?, 1.0)
    }

    /// As [`Self::cast`], but only up to a fraction of the segment.
    #[inline]
    pub(in crate::collision) fn cast_within(&self, segment: Segment, fraction: f32) -> Option<LocalHit> {
        self.bvh.cast_within(segment, fraction)
    }
}
