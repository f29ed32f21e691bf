//! Four triangles side by side, so that one instruction works on all of them.

use bevy::prelude::*;

use super::wide::WideRay;
use super::{EDGE_OVERLAP, HEAD_START};

/// Triangles of a leaf.
pub(super) const PACK: usize = 4;

/// In place of a triangle.
const NO_TRIANGLE: u32 = u32::MAX;

/// Up to four triangles. The normals are left out: working them out anew is faster than reading them. So aligned, it never lies
/// in more cache lines than it has to.
#[repr(align(32))]
pub(super) struct TrianglePack {
    /// x, y and z of the first corners.
    corner: [Vec4; 3],
    /// From the second corner to the first.
    edge: [Vec4; 3],
    /// From the first corner to the third.
    other_edge: [Vec4; 3],
    /// Ascending; then [`NO_TRIANGLE`], which has no edges, so that all rays are parallel to it.
    numbers: [u32; PACK],
}

impl TrianglePack {
    /// Of the corners of a mesh's triangles, the ones with these numbers, at most four. Sorts them.
    pub(super) fn new(positions: &[[Vec3; 3]], numbers: &mut [u32]) -> Self {
        numbers.sort_unstable();
        let none = [Vec4::ZERO; 3];
        let mut pack = Self { corner: none, edge: none, other_edge: none, numbers: [NO_TRIANGLE; PACK] };
        for (place, &number) in numbers.iter().enumerate() {
            let [a, b, c] = positions[number as usize];
            let (edge, other_edge) = (a - b, c - a);
            for axis in 0..3 {
                pack.corner[axis][place] = a[axis];
                pack.edge[axis][place] = edge[axis];
                pack.other_edge[axis][place] = other_edge[axis];
            }
            pack.numbers[place] = number;
        }
        pack
    }

    /// The numbers of the triangles.
    pub(super) fn numbers(&self) -> impl Iterator<Item = u32> {
        self.numbers.into_iter().filter(|&number| number != NO_TRIANGLE)
    }

    /// Where the ray hits the first of them before `end`, or else `end`. Writes down which. Of several in one place, and of
    /// them and the one that is written down if that is at `end`, it is the one of the lowest number.
    ///
    /// As `intersect`, operation by operation, so that distances are the same to the bit.
    #[inline(always)]
    pub(super) fn cast(&self, ray: &WideRay, end: f32, closest: &mut u32) -> f32 {
        let to_corner = [0, 1, 2].map(|axis: usize| self.corner[axis] - ray.origin[axis]);
        let normal = cross(&self.edge, &self.other_edge);
        let across = cross(&ray.direction, &to_corner);
        let inverse = Vec4::ONE / dot(&normal, &ray.direction);
        let u = dot(&across, &self.other_edge) * inverse;
        let v = dot(&across, &self.edge) * inverse;
        let w = Vec4::ONE - u - v;
        let distance = dot(&normal, &to_corner) * inverse;
        // The NaN of a parallel ray fails.
        let edge = Vec4::splat(-EDGE_OVERLAP);
        let is_within = u.cmpge(edge) & v.cmpge(edge) & w.cmpge(edge);
        let is_before = distance.cmpge(Vec4::splat(HEAD_START)) & distance.cmple(Vec4::splat(end));
        let mut hit = (is_within & is_before).bitmask();
        let mut end = end;
        if hit != 0 {
            let distances = distance.to_array();
            while hit != 0 {
                let place = hit.trailing_zeros() as usize % PACK;
                hit &= hit - 1;
                let (distance, number) = (distances[place], self.numbers[place]);
                if distance < end || (distance == end && number < *closest) {
                    (end, *closest) = (distance, number);
                }
            }
        }
        end
    }
}

#[inline(always)]
fn cross(a: &[Vec4; 3], b: &[Vec4; 3]) -> [Vec4; 3] {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}

#[inline(always)]
fn dot(a: &[Vec4; 3], b: &[Vec4; 3]) -> Vec4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use obvhs::rt_triangle::RtTriangle;

    use super::super::{Segment, intersect};
    use super::*;
    use crate::test_random::Random;

    #[test]
    fn a_pack_says_what_its_triangles_say_one_by_one_to_the_bit() {
        let mut random = Random(3);
        let mut point = || random.in_cube(1.0);
        let mut hits = 0;
        for round in 0..20_000 {
            let mut positions: Vec<[Vec3; 3]> =
                (0..=round % PACK).map(|_| [point(), point(), point()]).collect();
            if round % 7 == 0 {
                // Through a corner, and through something without area.
                let corner = positions[0][1];
                positions[0][2] = corner;
            }
            let mut numbers: Vec<u32> = (0..positions.len() as u32).rev().collect();
            let pack = TrianglePack::new(&positions, &mut numbers);
            assert!(pack.numbers().eq(0..positions.len() as u32));
            let (start, end) = (point() * 2.0, if round % 5 == 0 { positions[0][1] } else { point() * 2.0 });
            let segment = Segment::new(start, end).unwrap();
            let ray = segment.ray(1.0);
            let one_by_one = positions.iter().map(|corners| {
                let [v0, v1, v2] = corners.map(|corner| corner.to_array().into());
                intersect(&RtTriangle::new(v0, v1, v2), &ray)
            });
            let mut expected = (HEAD_START + 1.0, 0);
            for (number, distance) in (0..).zip(one_by_one) {
                if distance < expected.0 {
                    expected = (distance, number);
                }
            }
            hits += u32::from(expected.0 < HEAD_START + 1.0);
            let mut closest = 0;
            let distance = pack.cast(&WideRay::new(segment), HEAD_START + 1.0, &mut closest);
            assert_eq!((distance.to_bits(), closest), (expected.0.to_bits(), expected.1), "{round}");
        }
        assert!(hits > 1000, "{hits}");
    }

    #[test]
    fn of_several_in_one_place_the_lowest_number_is_hit() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Z];
        let segment = Segment::new(Vec3::new(0.25, 0.5, 0.25), Vec3::new(0.25, -0.5, 0.25)).unwrap();
        let ray = WideRay::new(segment);
        let positions = [corners; 9];
        let cast = |numbers: &mut [u32], end: f32, mut closest: u32| {
            let end = TrianglePack::new(&positions, numbers).cast(&ray, end, &mut closest);
            (end, closest)
        };
        let (end, closest) = cast(&mut [7, 5, 8, 6], 2.0, 0);
        assert_eq!(closest, 5);
        assert_eq!(cast(&mut [6, 8], end, 5), (end, 5));
        assert_eq!(cast(&mut [4, 3], end, 5), (end, 3));
        // What lies at the very end does not count.
        assert_eq!(cast(&mut [4, 3], end, 0), (end, 0));
    }
}
