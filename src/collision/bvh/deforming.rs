//! The BVH of one surface that is posed.
//!
//! Built once over the mesh at rest. When the surface moves, [`DeformingBvh::refit`] writes the triangles anew and walks
//! the tree once from the leaves up, so that every box fits what is below it; which triangles share a leaf stays as it
//! was. That costs a fraction of a build, but boxes of triangles that have moved apart overlap. The cost of the tree, the
//! area of all its boxes over that of the outermost, tells by how much: what has become twice as bad as when it was built
//! is built anew. Hits do not depend on the tree.
//!
//! Binary: built anew in the middle of a tick, it is not made wide first, as that of [`MeshBvh`](super::MeshBvh) is.

use std::sync::Arc;

use bevy::prelude::*;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;

use super::{LocalHit, Segment, corners_of, intersect, pad_within, padded, quality};

/// A tree that costs this many times what it did when it was built is built anew.
const REBUILD_COST: f64 = 2.0;

/// Triangles that move, under a binary BVH.
#[derive(Clone)]
pub(in crate::collision) struct DeformingBvh {
    /// Parents come before their children.
    bvh: Bvh2,
    /// In the order of the leaves. One that cannot be hit now has no edges: every ray is parallel to it.
    leaves: Vec<RtTriangle>,
    /// Vertices of each triangle.
    corners: Arc<[[u32; 3]]>,
    /// Of everything that can be hit, padded.
    bounds: Option<(Vec3, Vec3)>,
    /// Area of all boxes over that of the outermost one.
    cost: f64,
    /// The cost when the tree was built.
    built_cost: f64,
}

impl DeformingBvh {
    /// Builds the BVH of these triangles, given by their vertices. About 1 µs per triangle on one core.
    pub(in crate::collision) fn build(corners: Arc<[[u32; 3]]>, positions: &[Vec3]) -> Self {
        let quality = quality(corners.len());
        let leaves = vec![RtTriangle::default(); corners.len()];
        let bvh = Bvh2::default();
        let mut built = Self { bvh, leaves, corners, bounds: None, cost: 0.0, built_cost: 0.0 };
        built.rebuild(positions, quality);
        built
    }

    /// Follows the vertices to other places. What is not finite or has no area there is not hit while that lasts.
    pub(in crate::collision) fn refit(&mut self, positions: &[Vec3]) {
        self.fit(positions);
        if self.cost > REBUILD_COST * self.built_cost {
            // In the middle of a tick: a quick tree will do.
            self.rebuild(positions, BvhBuildParams::fast_build());
        }
    }

    /// The tree, the root first; empty while nothing can be hit.
    pub(super) fn nodes(&self) -> &[Bvh2Node] {
        if self.bounds.is_some() { &self.bvh.nodes } else { &[] }
    }

    /// Smallest and largest corner of everything that can be hit, with some rounding errors to spare; `None` if nothing
    /// can.
    pub(in crate::collision) fn bounds(&self) -> Option<(Vec3, Vec3)> {
        self.bounds
    }

    /// The closest hit on a part of the segment, from either side, as `MeshBvh::cast_within` finds it; but of several triangles in
    /// one place it may be any.
    #[inline]
    pub(in crate::collision) fn cast_within(&self, segment: Segment, fraction: f32) -> Option<LocalHit> {
        // Nothing to hit: the boxes are not up to date.
        self.bounds?;
        let mut hit = RayHit::none();
        let ray = segment.ray(fraction);
        self.bvh
            .ray_traverse(ray, &mut hit, |ray, leaf| intersect(&self.leaves[leaf], ray))
            .then(|| LocalHit::new(&hit, &self.bvh.primitive_indices))
    }

    fn rebuild(&mut self, positions: &[Vec3], quality: BvhBuildParams) {
        let around = |&corners| triangle(corners, positions).map_or(Aabb::INVALID, |(_, aabb)| aabb);
        let mut boxes: Vec<Aabb> = self.corners.iter().map(around).collect();
        let mut all = boxes.iter().fold(Aabb::INVALID, |all, aabb| all.union(aabb));
        if !all.valid() {
            all = Aabb::new([0.0; 3].into(), [1.0; 3].into());
        }
        // The builder wants a place for what has none. It gets points of its own: many boxes in one place make a
        // tree as deep as they are many.
        let count = boxes.len() as f32;
        for (index, aabb) in boxes.iter_mut().enumerate().filter(|(_, aabb)| !aabb.valid()) {
            *aabb = Aabb::from_point(all.min + all.diagonal() * (index as f32 / count));
        }
        self.bvh = build_bvh2(&padded(boxes), quality, &mut default());
        self.bvh.reorder_in_stack_traversal_order();
        self.fit(positions);
        self.built_cost = self.cost;
    }

    /// Writes triangles and boxes, from the last node to the first, so that children come before their parents.
    fn fit(&mut self, positions: &[Vec3]) {
        let Self { bvh, leaves, corners, .. } = self;
        let Bvh2 { nodes, primitive_indices, .. } = bvh;
        for index in (0..nodes.len()).rev() {
            let node = nodes[index];
            let first = node.first_index as usize;
            let fitted = if node.is_leaf() {
                let mut around = Aabb::INVALID;
                for leaf in first..first + node.prim_count as usize {
                    leaves[leaf] = match triangle(corners[primitive_indices[leaf] as usize], positions) {
                        Some((triangle, aabb)) => {
                            around = around.union(&aabb);
                            triangle
                        }
                        None => RtTriangle::default(),
                    };
                }
                around
            } else {
                nodes[first].aabb().union(nodes[first + 1].aabb())
            };
            nodes[index].set_aabb(fitted);
        }

        let all = nodes.first().map(|root| *root.aabb()).filter(Aabb::valid);
        let Some(all) = all else {
            (self.bounds, self.cost) = (None, 0.0);
            return;
        };
        let pad = pad_within(&all);
        let mut area = 0.0;
        for node in nodes.iter_mut() {
            let mut aabb = *node.aabb();
            if aabb.valid() {
                aabb.min -= pad;
                aabb.max += pad;
                area += f64::from(aabb.half_area());
            } else {
                // Nothing below it can be hit; inside out it would be in the way of every ray.
                aabb = Aabb::from_point(all.min);
            }
            node.set_aabb(aabb);
        }
        let root = *nodes[0].aabb();
        self.bounds = Some(corners_of(&root));
        self.cost = area / f64::from(root.half_area());
    }
}

/// The triangle between three vertices and its box, if it can be hit, by the rule of `MeshTriangles`.
fn triangle(corners: [u32; 3], positions: &[Vec3]) -> Option<(RtTriangle, Aabb)> {
    let corner = |index: usize| positions.get(corners[index] as usize).map(Vec3::to_array);
    let (v0, v1, v2) = (corner(0)?.into(), corner(1)?.into(), corner(2)?.into());
    let triangle = Triangle { v0, v1, v2 };
    let prepared = RtTriangle::from(&triangle);
    let twice_area_squared = prepared.ng.length_squared();
    // Written so that NaN fails.
    let can_be_hit = (f32::MIN_POSITIVE..f32::INFINITY).contains(&twice_area_squared);
    can_be_hit.then(|| (prepared, triangle.aabb()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::deform::test_bar::{Bar, bent, matrices, segment};
    use crate::collision::{Deformer, MeshBvh, MeshTriangles};
    use crate::test_random::Random;

    fn deformer(mesh: &Mesh) -> Deformer {
        Deformer::from_mesh(mesh, &MeshTriangles::from_mesh(mesh).unwrap()).unwrap()
    }

    fn cast(bvh: &DeformingBvh, start: Vec3, end: Vec3) -> Option<LocalHit> {
        bvh.cast_within(Segment::new(start, end)?, 1.0)
    }

    /// A bar at rest, and where its vertices are when it is bent.
    fn bar() -> (Bar, Deformer, DeformingBvh, Vec<Vec3>) {
        let bar = Bar::new();
        let deformer = deformer(&bar.to_mesh());
        let rest = DeformingBvh::build(deformer.corners().clone(), deformer.rest());
        let mut posed = Vec::new();
        deformer.pose(&matrices(&bent(Vec3::new(0.5, -0.25, 1.0))), &[], &mut posed);
        (bar, deformer, rest, posed)
    }

    #[test]
    fn a_refitted_tree_hits_what_a_new_one_and_a_static_one_hit() {
        let (bar, deformer, mut refitted, posed) = bar();
        refitted.refit(&posed);
        let new = DeformingBvh::build(deformer.corners().clone(), &posed);
        let lists: Vec<[f32; 3]> = posed.iter().map(Vec3::to_array).collect();
        let still = bar.to_mesh().with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, lists);
        let still = MeshBvh::build(MeshTriangles::from_mesh(&still).unwrap());
        let triangles = bar.triangles(&bent(Vec3::new(0.5, -0.25, 1.0)));
        let mut random = Random(7);
        let mut hits = 0;
        for _ in 0..10_000 {
            let (start, end) = segment(&mut random, &triangles);
            let hit = cast(&refitted, start, end);
            hits += u32::from(hit.is_some());
            // Two that share an edge may be hit in the same place.
            let fraction = hit.map(|hit| hit.fraction);
            assert_eq!(fraction, cast(&new, start, end).map(|hit| hit.fraction), "{start} {end}");
            assert_eq!(fraction, still.cast(start, end).map(|hit| hit.fraction), "{start} {end}");
        }
        assert!(hits > 1000, "{hits}");
    }

    #[test]
    fn only_what_lies_before_the_fraction_is_hit_and_either_side_counts() {
        let (.., rest, _) = bar();
        let (start, end) = (Vec3::new(0.5, 1.0, 0.03), Vec3::new(0.5, -1.0, 0.03));
        let segment = Segment::new(start, end).unwrap();
        let hit = |fraction| rest.cast_within(segment, fraction).map(|hit| hit.fraction);
        assert!(hit(1.0).is_some_and(|fraction| (fraction - 0.45).abs() < 1e-5));
        assert!(hit(0.46).is_some() && hit(0.44).is_none());
        // From within, the far wall.
        let inside = cast(&rest, Vec3::new(0.5, 0.0, 0.03), end).unwrap();
        assert!((inside.fraction - 0.1).abs() < 1e-5);
        assert_eq!(cast(&rest, start, Vec3::NAN), None);
    }

    #[test]
    fn a_tree_that_has_become_bad_is_built_anew() {
        // Small triangles in a row along x, each with vertices of its own.
        const COUNT: u32 = 1000;
        let place = |slot: u32| [Vec3::ZERO, Vec3::Y, Vec3::Z].map(|v| v * 0.4 + Vec3::X * slot as f32);
        let corners: Arc<[[u32; 3]]> = (0..COUNT).map(|n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
        let positions =
            |slot: fn(u32) -> u32| -> Vec<Vec3> { (0..COUNT).flat_map(|n| place(slot(n))).collect() };
        let mut bvh = DeformingBvh::build(corners, &positions(|n| n));
        let built_cost = bvh.built_cost;
        bvh.refit(&positions(|n| COUNT - 1 - n));
        assert_eq!(bvh.built_cost, built_cost, "the other way round the same tree is as good");
        // 387 and 1000 share no factor: each slot is taken once, and neighbours are far apart.
        let shuffled = positions(|n| n * 387 % COUNT);
        let mut stretched = bvh.clone();
        stretched.fit(&shuffled);
        assert!(stretched.cost > 4.0 * built_cost, "{} {built_cost}", stretched.cost);
        bvh.refit(&shuffled);
        assert!(bvh.cost < 2.0 * built_cost, "{} {built_cost}", bvh.cost);
        for n in 0..COUNT {
            let x = (n * 387 % COUNT) as f32;
            let hit = cast(&bvh, Vec3::new(x - 0.5, 0.1, 0.1), Vec3::new(x + 0.4, 0.1, 0.1)).unwrap();
            assert_eq!(hit.triangle, n);
        }
    }

    #[test]
    fn what_is_not_a_number_is_not_hit_and_comes_back() {
        let (bar, _, mut bvh, posed) = bar();
        let triangles = bar.triangles(&bent(Vec3::new(0.5, -0.25, 1.0)));
        bvh.refit(&posed);
        let whole = bvh.clone();
        // The far half of the bar is gone, the rest is where it was.
        let mut spoilt = posed.clone();
        let half = spoilt.len() / 2;
        spoilt[half..].fill(Vec3::new(0.0, f32::NAN, f32::INFINITY));
        bvh.refit(&spoilt);
        let (mut left, mut gone) = (0, 0);
        let mut random = Random(11);
        let segments: Vec<_> = (0..3000).map(|_| segment(&mut random, &triangles)).collect();
        for &(start, end) in &segments {
            let (before, after) = (cast(&whole, start, end), cast(&bvh, start, end));
            let Some(before) = before else {
                assert_eq!(after, None);
                continue;
            };
            let corners = bvh.corners[before.triangle as usize];
            if corners.iter().all(|&vertex| (vertex as usize) < half) {
                left += 1;
                assert_eq!(after.map(|hit| hit.fraction), Some(before.fraction));
            } else {
                gone += 1;
                let beyond =
                    |after: LocalHit| after.triangle != before.triangle && after.fraction >= before.fraction;
                assert!(after.is_none_or(beyond));
            }
        }
        assert!(left > 100 && gone > 100, "{left} {gone}");
        bvh.refit(&vec![Vec3::NAN; posed.len()]);
        assert_eq!(bvh.bounds(), None);
        bvh.refit(&vec![Vec3::ONE; posed.len()]);
        assert_eq!(bvh.bounds(), None);
        assert!(segments.iter().all(|&(start, end)| cast(&bvh, start, end).is_none()));
        bvh.refit(&posed);
        for &(start, end) in &segments {
            let fraction = |bvh| cast(bvh, start, end).map(|hit| hit.fraction);
            assert_eq!(fraction(&bvh), fraction(&whole));
        }
    }

    #[test]
    fn trees_of_nothing_and_of_one_triangle_are_trees() {
        let nothing = DeformingBvh::build(Arc::new([]), &[]);
        assert_eq!(nothing.bounds(), None);
        assert_eq!(cast(&nothing, Vec3::Y, Vec3::NEG_Y), None);
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Z];
        // Built from nothing that could be hit, then moved to where it can.
        let mut one = DeformingBvh::build(Arc::new([[0, 1, 2]]), &[Vec3::NAN; 3]);
        assert_eq!(one.bounds(), None);
        one.refit(&corners.map(|corner| corner + Vec3::Y * 5.0));
        let above = Vec3::new(0.25, 6.0, 0.25);
        let hit = cast(&one, above, above - Vec3::Y * 2.0).unwrap();
        assert!((hit.fraction - 0.5).abs() < 1e-5 && hit.triangle == 0);
    }
}
