//! The BVH over the boxes of all surfaces.

use bevy::prelude::*;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;

use super::collapse::build_wide;
use super::wide::{WideBvh, WideRay};
use super::{HEAD_START, Segment, padded};

/// A BVH over boxes, for the instances of a scene.
#[derive(Default)]
pub(in crate::collision) struct BoxBvh {
    tree: WideBvh,
}

impl BoxBvh {
    pub(in crate::collision) fn build(boxes: &[(Vec3, Vec3)]) -> Self {
        let boxes: Vec<Aabb> = boxes
            .iter()
            .map(|(min, max)| Aabb { min: min.to_array().into(), max: max.to_array().into() })
            .collect();
        let quality = BvhBuildParams::fastest_build();
        Self {
            tree: build_wide(&padded(boxes), quality, 1, |alone| alone.first().copied().unwrap_or_default()),
        }
    }

    /// Smallest and largest corner of everything; an empty box if there is nothing.
    pub(in crate::collision) fn bounds(&self) -> (Vec3, Vec3) {
        self.tree.bounds.unwrap_or((Vec3::INFINITY, Vec3::NEG_INFINITY))
    }

    /// Up to eight boxes that together hold everything.
    pub(in crate::collision) fn first_boxes(&self) -> impl Iterator<Item = (Vec3, Vec3)> {
        self.tree.children(0).map(|(_, bounds)| bounds)
    }

    /// Calls `cast(box, closest)` for the boxes on the segment, with the closest fraction found so far, and
    /// keeps the fraction it returns, if any.
    #[inline]
    pub(in crate::collision) fn visit(
        &self,
        segment: Segment,
        mut cast: impl FnMut(u32, f32) -> Option<f32>,
    ) {
        self.tree.traverse(&WideRay::new(segment), HEAD_START + 1.0, |instance, end| {
            cast(instance, end - HEAD_START).map_or(end, |fraction| end.min(fraction + HEAD_START))
        });
    }
}
