//! The BVH of one mesh: the only file that knows obvhs.
//!
//! obvhs has a glam of its own version; values cross over as arrays, so that no lock file can make them differ.

use bevy::prelude::*;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::{build_cwbvh, build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;

use super::MeshTriangles;

/// Above this many triangles a faster build is worth a slower cast.
const FAST_BUILD_TRIANGLES: usize = 200_000;

/// Triangles of a mesh under an eight-wide compressed BVH. Read-only; shared by all instances of the mesh.
pub struct MeshBvh {
    bvh: CwBvh,
    /// In the order of the leaves, so that a leaf reads its triangles in a row.
    leaves: Vec<RtTriangle>,
    triangles: MeshTriangles,
}

/// The closest hit of a segment in the space of its mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalHit {
    /// 0 at the start of the segment, 1 at its end.
    pub fraction: f32,
    /// Index into [`MeshBvh::triangles`].
    pub triangle: u32,
}

impl MeshBvh {
    /// Builds the BVH: about 1 µs per triangle on one core.
    pub fn build(triangles: MeshTriangles) -> Self {
        let corners: Vec<Triangle> = triangles
            .positions
            .iter()
            .map(|[a, b, c]| Triangle {
                v0: a.to_array().into(),
                v1: b.to_array().into(),
                v2: c.to_array().into(),
            })
            .collect();
        let quality = if corners.len() > FAST_BUILD_TRIANGLES {
            BvhBuildParams::fast_build()
        } else {
            BvhBuildParams::medium_build()
        };
        let bvh = build_cwbvh_from_tris(&corners, quality, &mut default());
        let leaves =
            bvh.primitive_indices.iter().map(|&triangle| (&corners[triangle as usize]).into()).collect();
        Self { bvh, leaves, triangles }
    }

    /// The triangles under the BVH.
    pub fn triangles(&self) -> &MeshTriangles {
        &self.triangles
    }

    /// Smallest and largest corner of everything that can be hit.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        corners_of(&self.bvh.total_aabb)
    }

    /// The closest hit on the segment from `start` to `end`, from either side. A segment that is not finite or
    /// has no length hits nothing.
    pub fn cast(&self, start: Vec3, end: Vec3) -> Option<LocalHit> {
        self.cast_within(Segment::new(start, end)?, 1.0)
    }

    /// As [`Self::cast`], but only up to a fraction of the segment.
    #[inline]
    pub(super) fn cast_within(&self, segment: Segment, fraction: f32) -> Option<LocalHit> {
        let mut hit = RayHit::none();
        let ray = segment.ray(fraction);
        self.bvh.ray_traverse(ray, &mut hit, |ray, leaf| self.leaves[leaf].intersect(ray)).then(|| LocalHit {
            fraction: hit.t / segment.length,
            triangle: self.bvh.primitive_indices[hit.primitive_id as usize],
        })
    }
}

/// A segment as direction and length: the intersections are computed in units of its mesh, however it is scaled.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    start: Vec3,
    direction: Vec3,
    length: f32,
}

impl Segment {
    pub(super) fn new(start: Vec3, end: Vec3) -> Option<Self> {
        let (direction, length) = (end - start).normalize_and_length();
        (length > 0.0 && length.is_finite() && start.is_finite()).then_some(Self { start, direction, length })
    }

    #[inline]
    fn ray(&self, fraction: f32) -> Ray {
        let (start, direction) = (self.start.to_array(), self.direction.to_array());
        Ray::new(start.into(), direction.into(), 0.0, self.length * fraction)
    }
}

/// A BVH over boxes, for the instances of a scene.
#[derive(Default)]
pub(super) struct BoxBvh {
    bvh: CwBvh,
}

impl BoxBvh {
    pub(super) fn build(boxes: &[(Vec3, Vec3)]) -> Self {
        if boxes.is_empty() {
            return Self::default();
        }
        let boxes: Vec<Aabb> = boxes
            .iter()
            .map(|(min, max)| Aabb { min: min.to_array().into(), max: max.to_array().into() })
            .collect();
        Self { bvh: build_cwbvh(&boxes, BvhBuildParams::fastest_build(), &mut default()) }
    }

    /// Smallest and largest corner of everything; an empty box if there is nothing.
    pub(super) fn bounds(&self) -> (Vec3, Vec3) {
        if self.bvh.nodes.is_empty() {
            return (Vec3::INFINITY, Vec3::NEG_INFINITY);
        }
        corners_of(&self.bvh.total_aabb)
    }

    /// Calls `cast(box, closest)` for the boxes on the segment, with the closest fraction found so far, and
    /// keeps the fraction it returns, if any.
    #[inline]
    pub(super) fn visit(&self, segment: Segment, mut cast: impl FnMut(u32, f32) -> Option<f32>) {
        let mut hit = RayHit::none();
        self.bvh.ray_traverse(segment.ray(1.0), &mut hit, |ray, leaf| {
            let instance = self.bvh.primitive_indices[leaf];
            cast(instance, ray.tmax / segment.length).map_or(f32::INFINITY, |f| f * segment.length)
        });
    }
}

fn corners_of(aabb: &Aabb) -> (Vec3, Vec3) {
    (Vec3::from_array(aabb.min.to_array()), Vec3::from_array(aabb.max.to_array()))
}
