//! An eight-wide BVH for closest hits of short segments.
//!
//! A node holds the boxes of up to eight children, side by side, so that one instruction tests four of them. They are plain
//! numbers: compressed ones would be half as large, but took longer to read than the cache misses they spared, even for a
//! million triangles. A ray goes on with the child that it enters first. The others wait on a stack, with the place where it
//! enters them, and are dropped if something has been hit before that place.
//!
//! What is in a leaf is up to the one who asks: a tree only has their numbers. How it is built is told in `collapse`.
//!
//! Wald, Benthin, Boulos 2008, "Getting rid of packets"; for the rounding Ize 2013, "Robust BVH ray traversal".

use bevy::prelude::*;

use super::{HEAD_START, Segment};

/// Children of a node.
pub(super) const WIDTH: usize = 8;

/// Levels of a tree that follow its binary tree.
pub(super) const DEEPEST: usize = 24;

/// Levels below those: eight times as many boxes in each, enough for as many as there are numbers.
pub(super) const DEEPEST_BELOW: usize = 11;

/// Children that may wait. Of short segments hardly ever more than a few do, and a small stack is faster made ready.
const FEW_WAIT: usize = 16;

/// All but one child of each node on the way may wait.
const MOST_WAIT: usize = 256;
const _: () = assert!((DEEPEST + DEEPEST_BELOW) * (WIDTH - 1) <= MOST_WAIT);

/// Marks the number of a leaf among the numbers of nodes.
const LEAF: u32 = 1 << 31;

/// In place of a child.
const NO_CHILD: u32 = u32::MAX;

/// Far sides of boxes are taken so much farther off, for the roundings on the way there.
const ROUNDING: f32 = 1.0 + 4.0e-7;

/// Largest inverse of a direction. With a factor to spare, so that it times 0 is never infinity times 0.
const MOST_INVERSE: f32 = 1.0e37;

/// A BVH over numbered leaves. Without a node it is empty.
#[derive(Default)]
pub(super) struct WideBvh {
    /// The root first.
    pub(super) nodes: Vec<Node>,
    /// Smallest and largest corner of everything, if there is anything.
    pub(super) bounds: Option<(Vec3, Vec3)>,
}

/// What is below a node.
pub(super) enum Child {
    /// A node, by its index.
    Inner(u32),
    /// A leaf, by its number.
    Leaf(u32),
}

/// The boxes of up to eight children, and what is in them. Starts at a cache line.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// Of each axis the smallest coordinates of all children and the largest, four to a vector. The wrong way round where
    /// there is no child: nothing hits that.
    sides: [[[Vec4; 2]; 2]; 3],
    /// Index of a node, or number of a leaf with [`LEAF`] added, or [`NO_CHILD`].
    children: [u32; WIDTH],
}

/// Where a ray enters the children of a node.
#[repr(align(16))]
struct Entries([f32; WIDTH]);

impl Node {
    /// No children.
    pub(super) const EMPTY: Self =
        Self { sides: [[[Vec4::INFINITY; 2], [Vec4::NEG_INFINITY; 2]]; 3], children: [NO_CHILD; WIDTH] };

    /// Puts a child into a place below [`WIDTH`].
    pub(super) fn set(&mut self, place: usize, (low, high): (Vec3, Vec3), child: Child) {
        for (axis, [lows, highs]) in self.sides.iter_mut().enumerate() {
            lows[place / 4][place % 4] = low[axis];
            highs[place / 4][place % 4] = high[axis];
        }
        self.children[place] = match child {
            Child::Inner(index) => index,
            Child::Leaf(number) => LEAF | number,
        };
    }

    /// The children with the smallest and the largest corner of their boxes.
    pub(super) fn children(&self) -> impl Iterator<Item = (Child, (Vec3, Vec3))> {
        let corner = |place: usize, side: usize| {
            Vec3::from_array([0, 1, 2].map(|axis: usize| self.sides[axis][side][place / 4][place % 4]))
        };
        let children = self.children.iter().enumerate().filter(|&(_, &child)| child != NO_CHILD);
        children.map(move |(place, &child)| {
            let is_leaf = child & LEAF != 0;
            let child = if is_leaf { Child::Leaf(child & !LEAF) } else { Child::Inner(child) };
            (child, (corner(place, 0), corner(place, 1)))
        })
    }

    /// Where the ray enters the children, and a bit for each that it enters before the end.
    #[inline(always)]
    fn enter(&self, ray: &WideRay, end: f32) -> (Entries, u32) {
        let end = Vec4::splat(end * ROUNDING);
        let (first, first_bits) = self.enter_four(0, ray, end);
        let (second, second_bits) = self.enter_four(1, ray, end);
        let ([a, b, c, d], [e, f, g, h]) = (first.to_array(), second.to_array());
        (Entries([a, b, c, d, e, f, g, h]), first_bits | second_bits << 4)
    }

    #[inline(always)]
    fn enter_four(&self, four: usize, ray: &WideRay, end: Vec4) -> (Vec4, u32) {
        let near = |axis: usize| {
            let side = self.sides[axis][ray.near_side[axis]][four];
            (side - ray.origin[axis]) * ray.inverse[axis]
        };
        let far = |axis: usize| {
            let side = self.sides[axis][1 - ray.near_side[axis]][four];
            (side - ray.origin[axis]) * ray.far_inverse[axis]
        };
        let near = near(0).max(near(1)).max(near(2).max(Vec4::splat(HEAD_START)));
        let far = far(0).min(far(1)).min(far(2).min(end));
        (near, near.cmple(far).bitmask())
    }
}

impl WideBvh {
    /// The children of a node.
    pub(super) fn children(&self, node: u32) -> impl Iterator<Item = (Child, (Vec3, Vec3))> {
        self.nodes.get(node as usize).into_iter().flat_map(Node::children)
    }

    /// Calls `visit` with the leaves that the ray meets before `end`, roughly the nearest first, and with the end as it is by
    /// then: what `visit` returns is the end from there on. Returns the last one. A leaf may be visited twice.
    #[inline(always)]
    pub(super) fn traverse(&self, ray: &WideRay, end: f32, mut visit: impl FnMut(u32, f32) -> f32) -> f32 {
        let mut end = end;
        if !self.walk::<FEW_WAIT>(ray, &mut end, &mut visit) {
            self.walk_deep(ray, &mut end, &mut visit);
        }
        end
    }

    /// Once more from the start, with room for all.
    #[cold]
    #[inline(never)]
    fn walk_deep(&self, ray: &WideRay, end: &mut f32, visit: &mut impl FnMut(u32, f32) -> f32) {
        self.walk::<MOST_WAIT>(ray, end, visit);
    }

    /// Whether there was room for all that had to wait.
    #[inline(always)]
    fn walk<const ROOM: usize>(
        &self,
        ray: &WideRay,
        end: &mut f32,
        visit: &mut impl FnMut(u32, f32) -> f32,
    ) -> bool {
        // Where it is entered in the upper half, the child in the lower. What is not negative sorts by its bits.
        let mut waiting = [0_u64; ROOM];
        let mut count = 0;
        let mut current = 0;
        loop {
            if current & LEAF != 0 {
                *end = visit(current & !LEAF, *end);
            } else {
                let Some(node) = self.nodes.get(current as usize) else { return true };
                let (entries, mut hit) = node.enter(ray, *end);
                if hit != 0 {
                    let place = hit.trailing_zeros() as usize % WIDTH;
                    hit &= hit - 1;
                    current = node.children[place];
                    if hit == 0 {
                        continue;
                    }
                    let entry = |place: usize| {
                        u64::from(entries.0[place].to_bits()) << 32 | u64::from(node.children[place])
                    };
                    let mut first = entry(place);
                    while hit != 0 {
                        let other = entry(hit.trailing_zeros() as usize % WIDTH);
                        hit &= hit - 1;
                        let Some(place) = waiting.get_mut(count) else { return false };
                        *place = first.max(other);
                        count += 1;
                        first = first.min(other);
                    }
                    current = first as u32;
                    continue;
                }
            }
            loop {
                if count == 0 {
                    return true;
                }
                count -= 1;
                let next = waiting[count % ROOM];
                // Not only before the end: what is hit in the same place has to be seen, whichever tree it is in. With the same
                // room for roundings as where it was entered.
                if f32::from_bits((next >> 32) as u32) <= *end * ROUNDING {
                    current = next as u32;
                    break;
                }
            }
        }
    }
}

/// A segment as a ray, as [`Segment::ray`]; all numbers four times.
pub(super) struct WideRay {
    pub(super) origin: [Vec4; 3],
    pub(super) direction: [Vec4; 3],
    inverse: [Vec4; 3],
    /// Times [`ROUNDING`].
    far_inverse: [Vec4; 3],
    /// Of each axis: which side of a box it enters, 0 the one with the smaller coordinate.
    near_side: [usize; 3],
}

impl WideRay {
    #[inline(always)]
    pub(super) fn new(segment: Segment) -> Self {
        let four = |vector: Vec3| vector.to_array().map(Vec4::splat);
        let most = Vec4::splat(MOST_INVERSE);
        let inverse = (Vec4::ONE / segment.delta.extend(1.0)).clamp(-most, most).truncate();
        Self {
            origin: four(segment.origin()),
            direction: four(segment.delta),
            inverse: four(inverse),
            far_inverse: four(inverse * ROUNDING),
            near_side: inverse.to_array().map(|inverse| usize::from(inverse < 0.0)),
        }
    }
}
