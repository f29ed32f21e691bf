//! The BVH over the boxes of all surfaces.

use bevy::prelude::*;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::RayHit;

use super::{HEAD_START, Segment, corners_of, padded};

/// A BVH over boxes, for the instances of a scene.
#[derive(Default)]
pub(in crate::collision) struct BoxBvh {
    bvh: CwBvh,
}

impl BoxBvh {
    pub(in crate::collision) fn build(boxes: &[(Vec3, Vec3)]) -> Self {
        if boxes.is_empty() {
            return Self::default();
        }
        let boxes: Vec<Aabb> = boxes
            .iter()
            .map(|(min, max)| Aabb { min: min.to_array().into(), max: max.to_array().into() })
            .collect();
        Self { bvh: build_cwbvh(&padded(boxes), BvhBuildParams::fastest_build(), &mut default()) }
    }

    /// Smallest and largest corner of everything; an empty box if there is nothing.
    pub(in crate::collision) fn bounds(&self) -> (Vec3, Vec3) {
        if self.bvh.nodes.is_empty() {
            return (Vec3::INFINITY, Vec3::NEG_INFINITY);
        }
        corners_of(&self.bvh.total_aabb)
    }

    /// Calls `cast(box, closest)` for the boxes on the segment, with the closest fraction found so far, and
    /// keeps the fraction it returns, if any.
    #[inline]
    pub(in crate::collision) fn visit(
        &self,
        segment: Segment,
        mut cast: impl FnMut(u32, f32) -> Option<f32>,
    ) {
        let mut hit = RayHit::none();
        self.bvh.ray_traverse(segment.ray(1.0), &mut hit, |ray, leaf| {
            let instance = self.bvh.primitive_indices[leaf];
            cast(instance, ray.tmax - HEAD_START).map_or(f32::INFINITY, |fraction| fraction + HEAD_START)
        });
    }
}
