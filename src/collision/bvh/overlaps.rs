//! Which of many boxes overlap one.

use bevy::prelude::*;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

/// Boxes that can be asked which of them overlap another.
pub(crate) struct BoxOverlaps {
    bvh: Bvh2,
    boxes: Vec<Aabb>,
}

impl BoxOverlaps {
    pub(crate) fn build(boxes: &[(Vec3, Vec3)]) -> Self {
        let boxes: Vec<Aabb> = boxes.iter().map(|&corners| aabb(corners)).collect();
        let bvh = if boxes.is_empty() {
            Bvh2::default()
        } else {
            build_bvh2(&boxes, BvhBuildParams::fast_build(), &mut default())
        };
        Self { bvh, boxes }
    }

    /// Calls `found` with the number of each box that overlaps this one, in no order.
    pub(crate) fn visit(&self, corners: (Vec3, Vec3), mut found: impl FnMut(u32)) {
        let wanted = aabb(corners);
        self.bvh.aabb_traverse(wanted, |bvh, node| {
            let node = &bvh.nodes[node as usize];
            let first = node.first_index as usize;
            for &number in &bvh.primitive_indices[first..first + node.prim_count as usize] {
                if self.boxes[number as usize].intersect_aabb(&wanted) {
                    found(number);
                }
            }
            true
        });
    }
}

fn aabb((min, max): (Vec3, Vec3)) -> Aabb {
    Aabb { min: min.to_array().into(), max: max.to_array().into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_random::Random;

    #[test]
    fn every_overlap_is_found_once() {
        let mut random = Random(7);
        let mut some_box = |size: f32| {
            let mut place = || Vec3::new(random.unit(), random.unit(), random.unit());
            let low = place() * 10.0;
            (low, low + place() * size)
        };
        for count in [0, 1, 2, 300] {
            let boxes: Vec<_> = (0..count).map(|_| some_box(1.0)).collect();
            let all = BoxOverlaps::build(&boxes);
            for _ in 0..200 {
                let wanted = some_box(3.0);
                let mut found = Vec::new();
                all.visit(wanted, |number| found.push(number));
                found.sort_unstable();
                let overlaps =
                    |&(low, high): &(Vec3, Vec3)| low.cmple(wanted.1).all() && high.cmpge(wanted.0).all();
                let expected: Vec<u32> =
                    (0..count).filter(|&number| overlaps(&boxes[number as usize])).collect();
                assert_eq!(found, expected);
            }
        }
    }
}
