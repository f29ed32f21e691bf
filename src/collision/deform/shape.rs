//! What an instance in the scene is cast against.

use std::sync::Arc;

use bevy::prelude::*;

use super::PosedMesh;
use crate::collision::bvh::Segment;
use crate::collision::{LocalHit, MeshBvh, MeshTriangles};

/// The shape of a surface.
#[derive(Clone)]
pub enum Shape {
    /// The mesh as it is; shared by all surfaces that show it.
    Rigid(Arc<MeshBvh>),
    /// The mesh in a pose of its own.
    Deforming(Arc<PosedMesh>),
}

impl From<Arc<MeshBvh>> for Shape {
    fn from(mesh: Arc<MeshBvh>) -> Self {
        Self::Rigid(mesh)
    }
}

impl From<Arc<PosedMesh>> for Shape {
    fn from(posed: Arc<PosedMesh>) -> Self {
        Self::Deforming(posed)
    }
}

impl Shape {
    /// Smallest and largest corner of everything that can be hit; `None` if nothing can.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        match self {
            Self::Rigid(mesh) => Some(mesh.bounds()),
            Self::Deforming(posed) => posed.bounds(),
        }
    }

    /// The triangles at rest, with their uvs.
    pub fn triangles(&self) -> &MeshTriangles {
        match self {
            Self::Rigid(mesh) => mesh.triangles(),
            Self::Deforming(posed) => posed.triangles(),
        }
    }

    /// The corners of a triangle as they are now, by its index in [`Self::triangles`].
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        match self {
            Self::Rigid(mesh) => mesh.triangles().positions[triangle],
            Self::Deforming(posed) => posed.corners(triangle),
        }
    }

    /// The closest hit on a part of the segment, from either side.
    #[inline]
    pub(in crate::collision) fn cast_within(&self, segment: Segment, fraction: f32) -> Option<LocalHit> {
        match self {
            Self::Rigid(mesh) => mesh.cast_within(segment, fraction),
            Self::Deforming(posed) => posed.cast_within(segment, fraction),
        }
    }
}
