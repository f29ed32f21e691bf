//! Makes an eight-wide tree of a binary one.
//!
//! Each node of the binary tree can be dissolved, so that its children become those of a node above it, or not; small ones
//! can become leaves. Bottom up, the cheapest way is found for each to be handed over as one child, as two, and so on up to
//! seven: cost is the area of the boxes, a measure of how many rays enter them, times what entering one costs. Top down, the
//! cheapest ways are followed. (Ylitie, Karras, Laine 2017, "Efficient incoherent ray traversal on GPUs through compressed
//! wide BVHs", 3.1.)
//!
//! Many boxes in one place make a binary tree as deep as they are many. What lies too deep is shared out evenly instead: no
//! tree is deeper than a ray's stack has room for.

use bevy::prelude::*;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use super::corners_of;
use super::wide::{Child, DEEPEST, Node, WIDTH, WideBvh};

/// What it costs to test the content of a leaf, in tests of a node. Four triangles take about as long as eight boxes.
const LEAF_COST: f32 = 1.0;

/// Builds a tree over boxes that are not empty. `leaf` is given the numbers of up to `most` of them, in no order, and says by
/// which number their leaf is to be known, below 2^31.
pub(super) fn build_wide(
    boxes: &[Aabb],
    quality: BvhBuildParams,
    most: u32,
    leaf: impl FnMut(&mut [u32]) -> u32,
) -> WideBvh {
    if boxes.is_empty() {
        return WideBvh::default();
    }
    // Leaves are made here.
    let quality = BvhBuildParams {
        max_prims_per_leaf: 1,
        post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
        ..quality
    };
    let mut tree = build_bvh2(boxes, quality, &mut default());
    // Then children come after their parents.
    tree.reorder_in_stack_traversal_order();
    let mut collapse = Collapse {
        costs: vec![[0.0; WIDTH - 1]; tree.nodes.len()],
        counts: vec![1; tree.nodes.len()],
        nodes: Vec::with_capacity(boxes.len() / 8 + 1),
        tree,
        boxes,
        most,
        leaf,
    };
    collapse.weigh();
    let bounds = collapse.corners(0);
    collapse.node(0, 0);
    let mut nodes = collapse.nodes;
    nodes.shrink_to_fit();
    WideBvh { nodes, bounds: Some(bounds) }
}

struct Collapse<'a, L> {
    /// One box to a leaf.
    tree: Bvh2,
    boxes: &'a [Aabb],
    most: u32,
    leaf: L,
    /// Of each node of the binary tree, what it costs at least as at most one child, two, and so on.
    costs: Vec<[f32; WIDTH - 1]>,
    /// Boxes below it.
    counts: Vec<u32>,
    nodes: Vec<Node>,
}

impl<L: FnMut(&mut [u32]) -> u32> Collapse<'_, L> {
    /// Works out counts and costs.
    fn weigh(&mut self) {
        for index in (0..self.tree.nodes.len()).rev() {
            let node = &self.tree.nodes[index];
            if !node.is_leaf() {
                let first = node.first_index as usize;
                self.counts[index] = self.counts[first] + self.counts[first + 1];
            }
            let mut cost = self.leaf_cost(index).min(self.inner_cost(index));
            self.costs[index][0] = cost;
            for among in 2..WIDTH {
                cost = cost.min(self.dissolved(index, among).0);
                self.costs[index][among - 1] = cost;
            }
        }
    }

    fn area(&self, index: usize) -> f32 {
        self.tree.nodes[index].aabb().half_area()
    }

    /// Of a node as a leaf.
    fn leaf_cost(&self, index: usize) -> f32 {
        if self.counts[index] <= self.most { self.area(index) * LEAF_COST } else { f32::INFINITY }
    }

    /// Of a node that has children of its own.
    fn inner_cost(&self, index: usize) -> f32 {
        self.area(index) + self.dissolved(index, WIDTH).0
    }

    /// The least cost of a node's two children handed over as at most so many, and how many of them go to the first.
    fn dissolved(&self, index: usize, among: usize) -> (f32, usize) {
        let node = &self.tree.nodes[index];
        if node.is_leaf() {
            return (f32::INFINITY, 0);
        }
        let first = node.first_index as usize;
        let (one, other) = (&self.costs[first], &self.costs[first + 1]);
        let mut best = (f32::INFINITY, 1);
        for share in 1..among {
            let cost = one[share - 1] + other[among - share - 1];
            if cost < best.0 {
                best = (cost, share);
            }
        }
        best
    }

    /// Nodes of the binary tree that become the children of one that is dissolved, at most so many.
    fn dissolve(&self, index: usize, among: usize, into: &mut Vec<usize>) {
        let node = &self.tree.nodes[index];
        let costs = &self.costs[index];
        let mut among = among;
        while among > 1 && among < WIDTH && costs[among - 2] <= costs[among - 1] {
            among -= 1;
        }
        if among == 1 || node.is_leaf() {
            into.push(index);
            return;
        }
        let (first, share) = (node.first_index as usize, self.dissolved(index, among).1);
        self.dissolve(first, share, into);
        self.dissolve(first + 1, among - share, into);
    }

    fn is_leaf(&self, index: usize) -> bool {
        self.leaf_cost(index) <= self.inner_cost(index)
    }

    /// Adds a node, and all that is below it. Returns its index.
    fn node(&mut self, index: usize, depth: usize) -> u32 {
        let mut below = Vec::with_capacity(WIDTH);
        if self.is_leaf(index) {
            // The root alone.
            below.push(index);
        } else {
            self.dissolve(index, WIDTH, &mut below);
        }
        let added = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        for (place, &index) in below.iter().enumerate() {
            let child = if self.is_leaf(index) {
                let mut content = self.content(index);
                Child::Leaf((self.leaf)(&mut content))
            } else if depth + 1 < DEEPEST {
                Child::Inner(self.node(index, depth + 1))
            } else {
                let mut content = self.content(index);
                self.share_out(&mut content).0
            };
            let corners = self.corners(index);
            self.nodes[added].set(place, corners, child);
        }
        added as u32
    }

    /// A tree over these boxes in the order they have; and the corners of all of them.
    fn share_out(&mut self, content: &mut [u32]) -> (Child, (Vec3, Vec3)) {
        if content.len() <= self.most as usize {
            let around = content.iter().map(|&number| self.boxes[number as usize]);
            let around = around.fold(Aabb::INVALID, |all, aabb| all.union(&aabb));
            return (Child::Leaf((self.leaf)(content)), corners_of(&around));
        }
        let added = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        let mut all = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (place, part) in content.chunks_mut(content.len().div_ceil(WIDTH)).enumerate() {
            let (child, (low, high)) = self.share_out(part);
            all = (all.0.min(low), all.1.max(high));
            self.nodes[added].set(place, (low, high), child);
        }
        (Child::Inner(added as u32), all)
    }

    /// The numbers of the boxes below a node.
    fn content(&self, index: usize) -> Vec<u32> {
        let (mut found, mut waiting) = (Vec::new(), vec![index]);
        while let Some(index) = waiting.pop() {
            let node = &self.tree.nodes[index];
            let first = node.first_index as usize;
            if node.is_leaf() {
                found.push(self.tree.primitive_indices[first]);
            } else {
                waiting.extend([first + 1, first]);
            }
        }
        found
    }

    fn corners(&self, index: usize) -> (Vec3, Vec3) {
        corners_of(self.tree.nodes[index].aabb())
    }
}

#[cfg(test)]
mod tests {
    use super::super::wide::{DEEPEST_BELOW, WideRay};
    use super::super::{HEAD_START, Segment, padded};
    use super::*;
    use crate::test_random::Random;

    fn around((low, high): (Vec3, Vec3)) -> Aabb {
        Aabb { min: low.to_array().into(), max: high.to_array().into() }
    }

    /// Boxes here and there, small and large.
    fn scattered(count: usize) -> Vec<Aabb> {
        let mut random = Random(11);
        let mut random = || random.unit();
        let some_box = |_| {
            let low = Vec3::new(random(), random(), random()) * 10.0;
            around((low, low + Vec3::new(random(), 0.1 * random(), random() * random())))
        };
        (0..count).map(some_box).collect()
    }

    /// Boxes that all begin in the same place, each larger than the one before by the same factor.
    fn nested(count: usize) -> Vec<Aabb> {
        (0..count).map(|n| around((Vec3::ZERO, Vec3::splat(1.3_f32.powi(n as i32 % 200 - 100))))).collect()
    }

    fn same(count: usize) -> Vec<Aabb> {
        vec![around((Vec3::ZERO, Vec3::ONE)); count]
    }

    /// A tree over the boxes, and what is in its leaves.
    fn build(boxes: &[Aabb], most: u32) -> (WideBvh, Vec<Vec<u32>>) {
        let mut leaves = Vec::new();
        let tree = build_wide(boxes, BvhBuildParams::medium_build(), most, |content| {
            assert!(!content.is_empty() && content.len() <= most as usize);
            leaves.push(content.to_vec());
            leaves.len() as u32 - 1
        });
        (tree, leaves)
    }

    /// Goes through all that is below a node, whose box it is given. Fails where a box does not hold what is in it.
    fn check(
        tree: &WideBvh,
        leaves: &[Vec<u32>],
        boxes: &[Aabb],
        node: u32,
        (low, high): (Vec3, Vec3),
    ) -> (usize, Vec<u32>) {
        let (mut depth, mut found) = (0, Vec::new());
        let holds = |low: Vec3, high: Vec3, (inner_low, inner_high): (Vec3, Vec3)| {
            assert!(low.cmple(inner_low).all() && high.cmpge(inner_high).all());
        };
        for (child, corners) in tree.children(node) {
            holds(low, high, corners);
            match child {
                Child::Inner(index) => {
                    let (below, content) = check(tree, leaves, boxes, index, corners);
                    depth = depth.max(below);
                    found.extend(content);
                }
                Child::Leaf(number) => {
                    let content = &leaves[number as usize];
                    content.iter().for_each(|&n| holds(corners.0, corners.1, corners_of(&boxes[n as usize])));
                    found.extend(content);
                }
            }
        }
        (depth + 1, found)
    }

    #[test]
    fn every_box_is_in_one_leaf_and_in_all_boxes_above_it_and_no_tree_is_too_deep() {
        for boxes in [1, 2, 3, 4, 5, 9, 100, 3000].map(scattered).into_iter().chain([nested(600), same(1200)])
        {
            for most in [1, 4] {
                let (tree, leaves) = build(&boxes, most);
                let (depth, mut found) = check(&tree, &leaves, &boxes, 0, tree.bounds.unwrap());
                found.sort_unstable();
                assert!(found.into_iter().eq(0..boxes.len() as u32), "{} {most}", boxes.len());
                assert!(depth <= DEEPEST + DEEPEST_BELOW, "{depth} for {} {most}", boxes.len());
            }
        }
    }

    #[test]
    fn most_nodes_and_leaves_are_full() {
        let cell = |n: u32| {
            around((
                Vec3::new((n % 70) as f32, 0.0, (n / 70) as f32),
                Vec3::new((n % 70 + 1) as f32, 0.1, (n / 70 + 1) as f32),
            ))
        };
        let boxes: Vec<Aabb> = (0..4900).map(cell).collect();
        let (tree, leaves) = build(&boxes, 4);
        let children: usize = (0..tree.nodes.len()).map(|node| tree.children(node as u32).count()).sum();
        assert!(children > 5 * tree.nodes.len(), "{children} in {}", tree.nodes.len());
        assert!(2 * leaves.len() < boxes.len(), "{}", leaves.len());
    }

    #[test]
    fn a_ray_visits_all_boxes_it_meets_even_if_many_wait() {
        for (boxes, most) in [(scattered(2000), 1), (scattered(2000), 4), (same(1200), 1), (nested(600), 4)] {
            let boxes = padded(boxes);
            let (tree, leaves) = build(&boxes, most);
            for (start, end) in [
                (Vec3::splat(-1.0), Vec3::splat(11.0)),
                (Vec3::new(5.0, 11.0, 5.0), Vec3::new(5.0, -1.0, 5.0)),
                (Vec3::new(9.0, 0.5, 0.5), Vec3::new(-9.0, 0.5, 0.5)),
            ] {
                let ray = WideRay::new(Segment::new(start, end).unwrap());
                let mut visited = vec![false; boxes.len()];
                let last = tree.traverse(&ray, HEAD_START + 1.0, |leaf, last| {
                    leaves[leaf as usize].iter().for_each(|&number| visited[number as usize] = true);
                    last
                });
                assert_eq!(last, HEAD_START + 1.0);
                let delta = (end - start).as_dvec3();
                for (aabb, visited) in boxes.iter().zip(visited) {
                    let (low, high) = corners_of(aabb);
                    // By doubles, and without any that the ray hardly touches.
                    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
                    for axis in 0..3 {
                        let at = |side: f32| (f64::from(side) - f64::from(start[axis])) / delta[axis];
                        let (one, other) = (at(low[axis]), at(high[axis]));
                        if delta[axis] != 0.0 {
                            (enter, leave) = (enter.max(one.min(other)), leave.min(one.max(other)));
                        } else if start[axis] < low[axis] || start[axis] > high[axis] {
                            leave = -1.0;
                        }
                    }
                    assert!(visited || enter > leave - 1e-6, "{low} {high} from {start} to {end}");
                }
            }
        }
    }

    #[test]
    fn nothing_is_a_tree_that_no_ray_meets() {
        let (tree, _) = build(&[], 4);
        let ray = WideRay::new(Segment::new(Vec3::ZERO, Vec3::ONE).unwrap());
        assert!(tree.bounds.is_none() && tree.children(0).count() == 0);
        assert_eq!(tree.traverse(&ray, 1.0, |_, _| 0.0), 1.0);
    }
}
