//! Which triangles of a mesh share an edge.

use std::iter;

use bevy::math::{DVec3, Vec3};
use bevy::platform::collections::HashMap;

/// The distance up to which corners count as one, as a part of the mesh's extent. Rounding moves a corner by
/// less; a texel of the largest map is 500 times as wide.
const WELD: f64 = 1e-6;

/// How many triangles on an edge are compared with each of them.
const RIVALS: usize = 32;

/// Edges that lead nowhere.
const NOWHERE: u32 = u32::MAX;

/// How much flatter than its rival a triangle with its front on the other side must lie, to be the next one.
const BACK_TO_FRONT: f64 = 1e-3;

/// For each edge of each triangle, the triangle beyond it.
///
/// Edge `i` of a triangle runs from its corner `i` to the next one. Corners in the same place are the same
/// corner, whatever their uvs. Triangles with two corners in one place, as there are around the poles of many
/// spheres, are left out: their neighbours are each other's.
pub(super) struct Adjacency {
    /// Numbers of each triangle's corners, after welding.
    corners: Vec<[u32; 3]>,
    /// The edge beyond each edge, as three times the triangle plus the edge, or [`NOWHERE`].
    beyond: Vec<[u32; 3]>,
}

/// The far side of an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Beyond {
    /// The triangle there.
    pub(super) triangle: u32,
    /// Which of its corners lies where the edge starts, seen from the near side, which one where it ends, and
    /// the one that is not on the edge.
    pub(super) corners: [usize; 3],
}

impl Adjacency {
    /// Welds the corners by their positions in the mesh (`positions`), and pairs the edges. Where three
    /// triangles or more meet, the way goes on to the one that makes the flattest turn in the world (`world`,
    /// any origin).
    pub(super) fn new(positions: &[[Vec3; 3]], world: &[[Vec3; 3]]) -> Self {
        let corners = weld(positions);
        let mut edges: Vec<(u32, u32, u32)> = Vec::with_capacity(corners.len() * 3);
        for (triangle, numbers) in (0u32..).zip(&corners) {
            let &[a, b, c] = numbers;
            if a == b || b == c || c == a {
                continue;
            }
            for (edge, (from, to)) in (0u32..).zip([(a, b), (b, c), (c, a)]) {
                edges.push((from.min(to), from.max(to), triangle * 3 + edge));
            }
        }
        edges.sort_unstable();
        let mut mesh = Self { beyond: vec![[NOWHERE; 3]; corners.len()], corners };
        for shared in edges.chunk_by(|one, other| (one.0, one.1) == (other.0, other.1)) {
            for (index, &(_, _, edge)) in shared.iter().enumerate() {
                // Enough for any mesh that is meant, and no square of the number of triangles for the others.
                let rivals = &shared[index.saturating_sub(RIVALS)..shared.len().min(index + RIVALS + 1)];
                let others = rivals.iter().map(|&(_, _, other)| other).filter(|other| other / 3 != edge / 3);
                if let Some(next) = mesh.flattest(edge, others, world) {
                    mesh.beyond[(edge / 3) as usize][(edge % 3) as usize] = next;
                }
            }
        }
        mesh
    }

    /// What lies beyond an edge, 0..=2, of a triangle; None if the mesh ends there.
    pub(super) fn beyond(&self, triangle: u32, edge: usize) -> Option<Beyond> {
        let next = self.beyond[triangle as usize][edge];
        if next == NOWHERE {
            return None;
        }
        let (other, first) = (next / 3, (next % 3) as usize);
        let second = (first + 1) % 3;
        let (start, end) = if self.same_direction(triangle * 3 + edge as u32, next) {
            (first, second)
        } else {
            (second, first)
        };
        Some(Beyond { triangle: other, corners: [start, end, (first + 2) % 3] })
    }

    /// The edge, out of those that lie in the same place, whose triangle continues that of `edge` most
    /// evenly.
    fn flattest(
        &self,
        edge: u32,
        mut others: impl Iterator<Item = u32> + Clone,
        world: &[[Vec3; 3]],
    ) -> Option<u32> {
        let first = others.next()?;
        if others.clone().next().is_none() {
            return Some(first);
        }
        let inward = |edge: u32| {
            let start = (edge % 3) as usize;
            inward(&world[(edge / 3) as usize], [start, (start + 1) % 3, (start + 2) % 3])
        };
        let outward = -inward(edge)?;
        let flatness = |other: u32| {
            // Two sheets that lie back to back: on the front the way leads to the front.
            let turned = if self.same_direction(edge, other) { BACK_TO_FRONT } else { 0.0 };
            inward(other).map_or(f64::NEG_INFINITY, |inward| outward.dot(inward) - turned)
        };
        let mut best = (first, flatness(first));
        for other in others {
            let flatness = flatness(other);
            if flatness > best.1 {
                best = (other, flatness);
            }
        }
        Some(best.0)
    }

    /// Whether two edges in the same place start at the same corner. Neighbours with the same front do not.
    fn same_direction(&self, edge: u32, other: u32) -> bool {
        let start = |edge: u32| self.corners[(edge / 3) as usize][(edge % 3) as usize];
        start(edge) == start(other)
    }
}

/// Unit vector in a triangle's plane, at right angles to the edge between two of its corners, to the side of
/// the third. None if the triangle has no area.
pub(super) fn inward(triangle: &[Vec3; 3], [from, to, third]: [usize; 3]) -> Option<DVec3> {
    let [from, to, third] = [from, to, third].map(|corner| triangle[corner].as_dvec3());
    let along = (to - from).try_normalize()?;
    let across = third - from;
    (across - along * across.dot(along)).try_normalize()
}

/// The distance, along each axis, up to which corners of a mesh count as one.
pub(super) fn weld_distance(positions: &[[Vec3; 3]]) -> f64 {
    let (low, high) = bounds(positions);
    ((high - low).max_element() * WELD).max(f64::MIN_POSITIVE)
}

/// Whether two corners of a triangle are closer than [`weld_distance`]. It is none of the surface then.
pub(super) fn is_collapsed(&[a, b, c]: &[Vec3; 3], weld_distance: f64) -> bool {
    let apart = |one: Vec3, other: Vec3| f64::from((other - one).abs().max_element()) > weld_distance;
    !(apart(a, b) && apart(b, c) && apart(c, a))
}

fn bounds(positions: &[[Vec3; 3]]) -> (DVec3, DVec3) {
    let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let all = positions.iter().flatten();
    let (low, high) = all.fold(none, |(low, high), &corner| (low.min(corner), high.max(corner)));
    (low.as_dvec3(), high.as_dvec3())
}

/// Numbers the corners of triangles by their places.
fn weld(positions: &[[Vec3; 3]]) -> Vec<[u32; 3]> {
    let (low, _) = bounds(positions);
    let distance = weld_distance(positions);
    // Cells are twice as wide as the distance: what is within it of a corner lies in one of the cells of the
    // points half a cell away.
    let half = |corner: u32, axis: u32| if corner >> axis & 1 == 0 { -0.5 } else { 0.5 };
    let shifts = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| DVec3::new(half(i, 0), half(i, 1), half(i, 2)));
    let mut numbers: HashMap<[i32; 3], u32> = HashMap::default();
    let mut number = |corner: Vec3| {
        let scaled = (corner.as_dvec3() - low) / (2.0 * distance);
        let cell = |shift: DVec3| (scaled + shift).floor().to_array().map(|number| number as i32);
        let own = cell(DVec3::ZERO);
        let mut cells = iter::once(own).chain(shifts.iter().map(|&shift| cell(shift)));
        if let Some(number) = cells.find_map(|cell| numbers.get(&cell).copied()) {
            return number;
        }
        let number = numbers.len() as u32;
        numbers.insert(own, number);
        number
    };
    positions.iter().map(|triangle| triangle.map(&mut number)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles that share the edge from the origin along z, each with its third corner in another
    /// direction.
    fn book(pages: &[Vec3]) -> Vec<[Vec3; 3]> {
        pages.iter().map(|&page| [Vec3::ZERO, Vec3::Z, page]).collect()
    }

    fn neighbour(mesh: &Adjacency, triangle: u32, edge: usize) -> Option<u32> {
        mesh.beyond(triangle, edge).map(|beyond| beyond.triangle)
    }

    #[test]
    fn corners_weld_if_they_are_closer_than_rounding() {
        let nudge = Vec3::new(4e-7, -4e-7, 4e-7);
        let triangles = [
            [Vec3::ZERO, Vec3::X, Vec3::Y],
            [Vec3::X + nudge, Vec3::X + Vec3::Y, Vec3::Y - nudge],
            // A gap of a thousandth is one.
            [Vec3::new(1.001, 0.0, 0.0), Vec3::new(1.001, 1.0, 0.0), Vec3::new(2.0, 0.0, 0.0)],
        ];
        let mesh = Adjacency::new(&triangles, &triangles);
        let beyond = Beyond { triangle: 1, corners: [0, 2, 1] };
        assert_eq!(mesh.beyond(0, 1), Some(beyond));
        assert_eq!(mesh.beyond(1, 2), Some(Beyond { triangle: 0, corners: [2, 1, 0] }));
        for (triangle, edge) in [(0, 0), (0, 2), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)] {
            assert_eq!(mesh.beyond(triangle, edge), None, "{triangle} {edge}");
        }
    }

    #[test]
    fn where_many_meet_the_way_goes_straight_on() {
        let slope = Vec3::new(-1.0, 0.4, 0.0);
        let pages = book(&[Vec3::X, Vec3::Y, slope, Vec3::NEG_Y]);
        let mesh = Adjacency::new(&pages, &pages);
        assert_eq!(neighbour(&mesh, 0, 0), Some(2));
        assert_eq!(neighbour(&mesh, 1, 0), Some(3));
        assert_eq!(neighbour(&mesh, 3, 0), Some(1));
        assert_eq!(neighbour(&mesh, 2, 0), Some(0));
    }

    #[test]
    fn sheets_back_to_back_keep_to_their_side_and_meet_at_the_rim() {
        let [a, b, c, d] = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
        let triangles = [[a, b, c], [a, c, d], [c, b, a], [d, c, a]];
        let mesh = Adjacency::new(&triangles, &triangles);
        assert_eq!(neighbour(&mesh, 0, 2), Some(1));
        assert_eq!(neighbour(&mesh, 2, 2), Some(3));
        assert_eq!(neighbour(&mesh, 3, 1), Some(2));
        assert_eq!(neighbour(&mesh, 0, 0), Some(2));
    }

    #[test]
    fn thousands_of_triangles_on_one_edge_and_corners_in_one_place_end() {
        let angles = (0..20_000).map(|page| page as f32 * 1e-4);
        let pages: Vec<Vec3> = angles.map(|angle| Vec3::new(angle.cos(), angle.sin(), 0.0)).collect();
        let mesh = Adjacency::new(&book(&pages), &book(&pages));
        assert!(neighbour(&mesh, 7, 0).is_some());
        let point = [[Vec3::ONE; 3]; 4];
        assert_eq!(neighbour(&Adjacency::new(&point, &point), 0, 0), None);
    }
}
