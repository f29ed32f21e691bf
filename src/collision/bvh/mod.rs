//! BVHs: the only folder that knows obvhs.
//!
//! | file | casts against |
//! |---|---|
//! | `mod` | [`MeshBvh`]: the triangles of a mesh at rest, built once, shared by all that show it |
//! | `deforming` | [`DeformingBvh`]: the triangles of one surface that is posed, refitted when it moves |
//! | `boxes` | [`BoxBvh`]: the boxes of all surfaces |
//! | `wide` | whatever is in the leaves of an eight-wide tree, which `mod` and `boxes` have; `collapse` builds it |
//! | `packs` | four triangles at once |
//! | `overlaps` | nothing: [`BoxOverlaps`] tells which of many boxes overlap one |
//! | `levels` | nothing: the boxes of a tree, to be looked at |
//! | `within` | nothing: the triangles of a mesh that are in a box |
//!
//! obvhs has a glam of its own version; values cross over as arrays, so that no lock file can make them differ.

mod boxes;
mod collapse;
mod deforming;
mod levels;
mod overlaps;
mod packs;
mod wide;
mod within;

use bevy::prelude::*;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::ray::{Ray, RayHit};
use obvhs::rt_triangle::RtTriangle;

use self::collapse::build_wide;
use self::packs::{PACK, TrianglePack};
use self::wide::{WideBvh, WideRay};
use super::{Deformer, MeshTriangles};

pub(super) use boxes::BoxBvh;
pub(super) use deforming::DeformingBvh;
pub(crate) use overlaps::BoxOverlaps;

/// Above this many triangles a faster build is worth a slower cast.
const FAST_BUILD_TRIANGLES: usize = 200_000;

/// Triangles of a mesh under an eight-wide BVH. Read-only; shared by all instances of the mesh.
pub struct MeshBvh {
    tree: WideBvh,
    /// The leaves.
    packs: Vec<TrianglePack>,
    triangles: MeshTriangles,
    /// If the mesh can be posed: how, and the BVH that poses begin with.
    deforming: Option<(Deformer, DeformingBvh)>,
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
        let positions = &triangles.positions;
        let around = |&[a, b, c]: &[Vec3; 3]| Aabb {
            min: a.min(b).min(c).to_array().into(),
            max: a.max(b).max(c).to_array().into(),
        };
        let boxes = padded(positions.iter().map(around).collect());
        let mut packs = Vec::with_capacity(positions.len() / 2);
        let tree = build_wide(&boxes, quality(positions.len()), PACK as u32, |numbers| {
            packs.push(TrianglePack::new(positions, numbers));
            packs.len() as u32 - 1
        });
        packs.shrink_to_fit();
        Self { tree, packs, triangles, deforming: None }
    }

    /// Adds what surfaces need that show this mesh skinned or morphed, and the BVH that theirs begin with: once more the
    /// time of [`Self::build`]. The deformer has to be that of the same mesh.
    pub fn with_deformer(mut self, deformer: Option<Deformer>) -> Self {
        self.deforming = deformer.map(|deformer| {
            let rest = DeformingBvh::build(deformer.corners().clone(), deformer.rest());
            (deformer, rest)
        });
        self
    }

    /// How the mesh is posed; `None` if it has neither joints nor morph targets.
    pub fn deformer(&self) -> Option<&Deformer> {
        self.deforming.as_ref().map(|(deformer, _)| deformer)
    }

    /// The deformer, and the BVH of the mesh at rest that can follow it.
    pub(super) fn deforming(&self) -> Option<&(Deformer, DeformingBvh)> {
        self.deforming.as_ref()
    }

    /// The triangles under the BVH.
    pub fn triangles(&self) -> &MeshTriangles {
        &self.triangles
    }

    /// Smallest and largest corner of everything that can be hit, with some rounding errors to spare.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.tree.bounds.unwrap_or_default()
    }

    /// The closest hit on the segment from `start` to `end`, from either side; of several in one place the triangle of the
    /// lowest number. A segment that is not finite or has no length hits nothing.
    pub fn cast(&self, start: Vec3, end: Vec3) -> Option<LocalHit> {
        self.cast_within(Segment::new(start, end)?, 1.0)
    }

    /// As [`Self::cast`], but only up to a fraction of the segment.
    #[inline]
    pub(super) fn cast_within(&self, segment: Segment, fraction: f32) -> Option<LocalHit> {
        let (ray, end) = (WideRay::new(segment), HEAD_START + fraction);
        // Nothing is lower: what lies at the very end does not count.
        let mut triangle = 0;
        let closest = self
            .tree
            .traverse(&ray, end, |pack, end| self.packs[pack as usize].cast(&ray, end, &mut triangle));
        (closest < end).then_some(LocalHit { fraction: closest - HEAD_START, triangle })
    }
}

impl LocalHit {
    /// From what a tree over triangles in this order says of the ray of a [`Segment`].
    #[inline]
    fn new(hit: &RayHit, triangles: &[u32]) -> Self {
        Self { fraction: hit.t - HEAD_START, triangle: triangles[hit.primitive_id as usize] }
    }
}

/// How long to think about a tree over so many triangles.
fn quality(triangles: usize) -> BvhBuildParams {
    if triangles > FAST_BUILD_TRIANGLES {
        BvhBuildParams::fast_build()
    } else {
        BvhBuildParams::medium_build()
    }
}

/// How far outside its edges a triangle can be hit, in barycentric coordinates: more than rounding leaves open between
/// two triangles that share an edge, less than anybody could see.
const EDGE_OVERLAP: f32 = 1.0e-6;

/// Distance to the triangle, from either side, or infinity (Möller & Trumbore 1997, with a precomputed normal).
///
/// In place of `RtTriangle::intersect`, which misses what falls exactly on an edge: there the sign of a zero decides.
#[inline(always)]
fn intersect(triangle: &RtTriangle, ray: &Ray) -> f32 {
    let to_corner = triangle.v0 - ray.origin;
    let across = ray.direction.cross(to_corner);
    let inverse = 1.0 / triangle.ng.dot(ray.direction);
    let u = across.dot(triangle.e2) * inverse;
    let v = across.dot(triangle.e1) * inverse;
    let w = 1.0 - u - v;
    // Written so that the NaN of a parallel ray fails.
    if u >= -EDGE_OVERLAP && v >= -EDGE_OVERLAP && w >= -EDGE_OVERLAP {
        let distance = triangle.ng.dot(to_corner) * inverse;
        if distance >= ray.tmin && distance <= ray.tmax {
            return distance;
        }
    }
    f32::INFINITY
}

/// A segment as a ray whose parameter is 0 at the start and 1 at the end, however the mesh is scaled.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    start: Vec3,
    delta: Vec3,
}

/// obvhs drops boxes that end before the parameter 1e-4, flat ones altogether: rays start this much earlier, and what
/// is hit before the segment begins does not count.
const HEAD_START: f32 = 4.0e-4;

impl Segment {
    /// `None` for a segment without length or with a coordinate that is not finite.
    pub(super) fn new(start: Vec3, end: Vec3) -> Option<Self> {
        // Adding zero takes the sign off a zero, by which obvhs would sort the sides of a box the wrong way round.
        let delta = end - start + Vec3::ZERO;
        (start.is_finite() && delta.is_finite() && delta != Vec3::ZERO).then_some(Self { start, delta })
    }

    /// Where its ray begins.
    #[inline]
    fn origin(&self) -> Vec3 {
        self.start - self.delta * HEAD_START
    }

    #[inline]
    fn ray(&self, fraction: f32) -> Ray {
        Ray::new(
            self.origin().to_array().into(),
            self.delta.to_array().into(),
            HEAD_START,
            HEAD_START + fraction,
        )
    }
}

/// Boxes a few rounding errors larger than they are: else a ray through the edge between two flat boxes may miss both.
fn padded(mut boxes: Vec<Aabb>) -> Vec<Aabb> {
    let pad = pad_within(&boxes.iter().fold(Aabb::INVALID, |all, aabb| all.union(aabb)));
    for aabb in &mut boxes {
        aabb.min -= pad;
        aabb.max += pad;
    }
    boxes
}

/// How much larger boxes have to be that lie within this one.
fn pad_within(all: &Aabb) -> f32 {
    4.0e-6 * all.min.abs().max(all.max.abs()).max_element()
}

fn corners_of(aabb: &Aabb) -> (Vec3, Vec3) {
    (Vec3::from_array(aabb.min.to_array()), Vec3::from_array(aabb.max.to_array()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_random::Random;

    #[test]
    fn flat_meshes_are_hit_at_the_very_start_and_end_of_a_segment_at_any_scale() {
        for scale in [1.0e-3, 1.0, 1.0e3] {
            let grid = crate::scenes::meshes::ground(Vec2::splat(4.0 * scale), UVec2::splat(8)).unwrap();
            let bvh = MeshBvh::build(MeshTriangles::from_mesh(&grid).unwrap());
            for step in 0..=1000 {
                let fraction = step as f32 / 1000.0;
                let length = 0.15 * scale;
                let start = Vec3::new(0.3 * scale, fraction * length, -0.7 * scale);
                let hit = bvh.cast(start, start - Vec3::Y * length).map(|hit| hit.fraction);
                // The ends themselves belong to this segment or to its neighbour.
                if step > 0 && step < 1000 {
                    assert!(
                        hit.is_some_and(|hit| (hit - fraction).abs() < 1e-5),
                        "{scale} {fraction} {hit:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_sign_of_a_zero_does_not_matter() {
        let grid = crate::scenes::meshes::ground(Vec2::splat(4.0), UVec2::splat(8)).unwrap();
        let bvh = MeshBvh::build(MeshTriangles::from_mesh(&grid).unwrap());
        for x in [0.0, -0.0] {
            for z in [0.0, -0.0] {
                assert!(bvh.cast(Vec3::new(0.0, 1.0, 0.0), Vec3::new(x, -1.0, z)).is_some(), "{x} {z}");
                assert!(bvh.cast(Vec3::new(x, 1.0, z), Vec3::new(0.0, -1.0, 0.0)).is_some(), "{x} {z}");
            }
        }
    }

    #[test]
    fn nothing_slips_through_edges_and_corners() {
        let grid = crate::scenes::meshes::ground(Vec2::splat(4.0), UVec2::splat(8)).unwrap();
        let bvh = MeshBvh::build(MeshTriangles::from_mesh(&grid).unwrap());
        // Down along the edges and diagonals of the cells, and through their corners; upright and aslant.
        for step in -15..=15 {
            for other in -15..=15 {
                let point = Vec3::new(step as f32 / 8.0, 0.0, other as f32 / 8.0);
                for lean in [Vec3::ZERO, Vec3::new(0.3, 0.0, -0.0), Vec3::new(-0.125, 0.0, 0.25)] {
                    let (above, below) = (point + Vec3::Y + lean, point - Vec3::Y - lean);
                    assert!(bvh.cast(above, below).is_some(), "{point} {lean}");
                    assert!(bvh.cast(below, above).is_some(), "{point} {lean} from below");
                }
            }
        }
    }

    /// Triangles of any size up to this one, some of them twice.
    fn soup(random: &mut Random, count: usize, size: f32) -> Vec<[Vec3; 3]> {
        let mut soup: Vec<[Vec3; 3]> = Vec::new();
        while soup.len() < count {
            let (middle, size) = (random.in_cube(1.0), size * random.signed());
            let triangle = [0, 1, 2].map(|_| middle + random.in_cube(size));
            soup.push(if soup.len() % 10 == 9 { soup[soup.len() / 2] } else { triangle });
        }
        soup
    }

    fn of(positions: Vec<[Vec3; 3]>) -> MeshBvh {
        MeshBvh::build(MeshTriangles { positions, ..default() })
    }

    /// The closest of all triangles, the lowest number if there are several.
    fn brute(positions: &[[Vec3; 3]], start: Vec3, end: Vec3) -> Option<LocalHit> {
        let ray = Segment::new(start, end)?.ray(1.0);
        let mut closest = (ray.tmax, 0);
        for (number, corners) in (0..).zip(positions) {
            let [v0, v1, v2] = corners.map(|corner| corner.to_array().into());
            let distance = intersect(&RtTriangle::new(v0, v1, v2), &ray);
            if distance < closest.0 {
                closest = (distance, number);
            }
        }
        (closest.0 < ray.tmax).then_some(LocalHit { fraction: closest.0 - HEAD_START, triangle: closest.1 })
    }

    #[test]
    fn hits_are_those_of_brute_force_to_the_bit() {
        let random = &mut Random(5);
        let grid = crate::scenes::meshes::ground(Vec2::splat(2.0), UVec2::splat(16)).unwrap();
        let grid = MeshTriangles::from_mesh(&grid).unwrap().positions;
        for positions in [
            soup(random, 1, 1.0),
            soup(random, 7, 1.0),
            soup(random, 600, 0.4),
            soup(random, 3000, 0.05),
            grid,
        ] {
            let bvh = of(positions.clone());
            let mut hits = 0;
            for round in 0..3000 {
                let corners = positions[round % positions.len()];
                let (start, end) = match round % 6 {
                    // From anywhere; short; through a corner, an edge, along an axis; within the plane of a triangle.
                    0 => (random.in_cube(2.0), random.in_cube(2.0)),
                    1 => (corners[0] + random.in_cube(0.1), corners[1] + random.in_cube(0.1)),
                    2 => {
                        let start = random.in_cube(2.0);
                        (start, start + (corners[2] - start) * 1.5)
                    }
                    3 => {
                        let (start, middle) = (random.in_cube(2.0), (corners[0] + corners[1]) * 0.5);
                        (start, middle * 2.0 - start)
                    }
                    4 => {
                        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
                        let axis = Vec3::AXES[round / 6 % 3] * random.signed();
                        (middle - axis, middle + axis)
                    }
                    _ => (corners[0], corners[1] * 3.0 - corners[0] - corners[2]),
                };
                let hit = bvh.cast(start, end);
                assert_eq!(hit, brute(&positions, start, end), "from {start} to {end}");
                hits += u32::from(hit.is_some());
            }
            assert!(hits > 500, "{hits} of {} triangles", positions.len());
        }
    }

    #[test]
    fn many_triangles_in_one_place_are_a_mesh() {
        let mut positions = vec![[Vec3::ZERO, Vec3::X, Vec3::Z]; 1200];
        positions.push([Vec3::Y, Vec3::Y + Vec3::X, Vec3::Y + Vec3::Z]);
        let bvh = of(positions);
        let hit = |from: f32, to: f32| bvh.cast(Vec3::new(0.25, from, 0.25), Vec3::new(0.25, to, 0.25));
        assert_eq!(hit(0.5, -0.5).map(|hit| hit.triangle), Some(0));
        assert_eq!(hit(2.0, -0.5).map(|hit| hit.triangle), Some(1200));
    }

    #[test]
    fn what_is_no_segment_hits_nothing() {
        let bvh = of(vec![[Vec3::ZERO, Vec3::X, Vec3::Z]]);
        let (above, below) = (Vec3::new(0.25, 0.5, 0.25), Vec3::new(0.25, -0.5, 0.25));
        assert!(bvh.cast(above, below).is_some() && bvh.cast(above, above).is_none());
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for axis in Vec3::AXES {
                let bad = above + axis * bad;
                assert_eq!((bvh.cast(bad, below), bvh.cast(below, bad)), (None, None), "{bad}");
            }
        }
        assert_eq!(of(Vec::new()).cast(above, below), None);
    }
}
