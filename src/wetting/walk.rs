//! Straight ways over a mesh, from triangle to triangle.
//!
//! A way starts at a point with a step on the map. Inside a triangle it is a straight line, in space as on
//! the map. Over an edge it goes on in one of two manners. Where the map goes on as well (both triangles have
//! the edge at the same place of the map, or whole tiles away, and lie on different sides of it), the step on
//! the map stays what it is: the way ends at the texel beside, however the density changes on it. Everywhere
//! else, at the seams between islands, it goes on as on paper folded along the edge: the part of the step
//! that is left is turned about the edge into the plane of the next triangle, be it rotated, mirrored or
//! scaled on the map.
//!
//! Points are kept as barycentric weights, which neither leave the surface nor lose digits far from the
//! origin.

use bevy::math::{Affine3A, DVec2, DVec3, Vec2, Vec3};

use super::adjacency::{Adjacency, Beyond, inward};
use super::grid::Grid;
use crate::collision::MeshTriangles;

/// Triangles that a way may cross. Around a corner it touches all that meet there.
const MAX_LEGS: u32 = 256;

/// How far apart the corners of an edge may lie on the map, in texels, to be no seam.
const SEAM_TEXELS: f64 = 1.0 / 64.0;

/// A mesh in space and on its map, and how its triangles hang together.
pub(super) struct Surface {
    /// Corners in metres, in the directions of world space, from an origin of the mesh's own.
    pub(super) space: Vec<[Vec3; 3]>,
    /// The same on the map, in texels of any tile.
    pub(super) map: Vec<[Vec2; 3]>,
    adjacency: Adjacency,
    grid: Grid,
}

/// A point of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// The triangle it lies on.
    pub(super) triangle: u32,
    /// Weights of its corners; their sum is 1.
    pub(super) weights: [f64; 3],
}

/// The part of a way that lies on one triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leg {
    /// Where it starts.
    pub(super) from: Place,
    /// Where it ends, on the same triangle.
    pub(super) to: Place,
    /// Whether a seam lies between the start of the way and this leg.
    pub(super) over_seam: bool,
    /// Whether the mesh ends at `to`, before the way does.
    pub(super) mesh_ends: bool,
}

/// A way over the surface, as its legs. The last one ends where the way does, or the mesh.
pub(super) struct Walk<'a> {
    surface: &'a Surface,
    at: Place,
    /// What the whole step would change the weights by.
    rates: [f64; 3],
    /// The corner over against the edge on which the leg starts.
    came_over: Option<usize>,
    /// How much of the step is left, 0..=1.
    left: f64,
    legs: u32,
    over_seam: bool,
}

impl Surface {
    /// The surface of a mesh that stands in the world by this transform.
    pub(super) fn new(triangles: &MeshTriangles, world_from_mesh: &Affine3A, grid: Grid) -> Self {
        // Far from the origin of the world, nothing would be left of the digits for a texel.
        let origin = triangles.positions.first().map_or(Vec3::ZERO, |corners| corners[0]);
        let in_space = |corner: Vec3| world_from_mesh.transform_vector3(corner - origin);
        let space: Vec<_> = triangles.positions.iter().map(|corners| corners.map(in_space)).collect();
        let map = triangles.uvs.iter().map(|uvs| uvs.map(|uv| uv * grid.size as f32)).collect();
        let adjacency = Adjacency::new(&triangles.positions, &space);
        Self { space, map, adjacency, grid }
    }

    /// A place in metres, from the surface's own origin.
    pub(super) fn in_space(&self, place: &Place) -> DVec3 {
        let corners = self.space[place.triangle as usize].map(|corner| corner.as_dvec3());
        sum(place.weights, corners, |corner, weight| corner * weight)
    }

    /// A place on the map, in texels of any tile.
    pub(super) fn on_map(&self, place: &Place) -> DVec2 {
        let corners = self.map[place.triangle as usize].map(|corner| corner.as_dvec2());
        sum(place.weights, corners, |corner, weight| corner * weight)
    }

    /// What a step on the map, in texels, is in space: metres, in the triangle's plane. None if the triangle
    /// has no area on the map.
    pub(super) fn step_in_space(&self, triangle: u32, step: DVec2) -> Option<DVec3> {
        Some(self.rates_in_space(triangle, rates_of_map(&self.map[triangle as usize], step)?))
    }

    /// The way from a place by a step on its triangle's map, in texels. None if the triangle has no area
    /// there.
    pub(super) fn walk(&self, at: Place, step: DVec2) -> Option<Walk<'_>> {
        let rates = rates_of_map(&self.map[at.triangle as usize], step)?;
        Some(Walk { surface: self, at, rates, came_over: None, left: 1.0, legs: 0, over_seam: false })
    }

    /// The triangles beyond a triangle's edges, where the map goes on there as well.
    pub(super) fn beside(&self, triangle: u32) -> impl Iterator<Item = u32> {
        (0..3).filter_map(move |edge| {
            let beyond = self.adjacency.beyond(triangle, edge)?;
            let near = [edge, (edge + 1) % 3, (edge + 2) % 3];
            (!self.is_seam(triangle, near, beyond)).then_some(beyond.triangle)
        })
    }

    /// Whether an edge lies on the map in two places. `near` as in [`Self::turn`].
    fn is_seam(&self, triangle: u32, near: [usize; 3], beyond: Beyond) -> bool {
        let (map, far_map) = (&self.map[triangle as usize], &self.map[beyond.triangle as usize]);
        let shifts = [0, 1].map(|end| (far_map[beyond.corners[end]] - map[near[end]]).as_dvec2());
        (shifts[0] - shifts[1]).abs().max_element() > SEAM_TEXELS
            || !self.grid.is_whole_tiles(shifts[0], SEAM_TEXELS)
    }

    fn rates_in_space(&self, triangle: u32, rates: [f64; 3]) -> DVec3 {
        let corners = self.space[triangle as usize];
        // Rates have the sum 0, so any origin will do; a corner is the most exact.
        sum(rates, corners, |corner, rate| (corner - corners[0]).as_dvec3() * rate)
    }

    /// The rates on the far side of an edge at which a way goes on that has `rates` on `triangle`, and
    /// whether it is a seam. `near` are the corners of the edge's start and end and the third one.
    fn turn(
        &self,
        triangle: u32,
        near: [usize; 3],
        rates: [f64; 3],
        beyond: Beyond,
    ) -> Option<([f64; 3], bool)> {
        let far = beyond.corners;
        let (map, far_map) = (&self.map[triangle as usize], &self.map[beyond.triangle as usize]);
        if !self.is_seam(triangle, near, beyond) {
            let step = sum(rates, *map, |corner, rate| (corner - map[0]).as_dvec2() * rate);
            // Not where the map is folded back along the edge: the way would lead out again at once.
            let inside = |rates: &[f64; 3]| rates[far[2]] > 0.0;
            if let Some(rates) = rates_of_map(far_map, step).filter(inside) {
                return Some((rates, false));
            }
        }
        let (space, far_space) = (&self.space[triangle as usize], &self.space[beyond.triangle as usize]);
        let along = |corners: &[Vec3; 3], [start, end, _]: [usize; 3]| {
            (corners[end] - corners[start]).as_dvec3().try_normalize()
        };
        let step = self.rates_in_space(triangle, rates);
        let outwards = -step.dot(inward(space, near)?);
        let step =
            along(far_space, far)? * step.dot(along(space, near)?) + inward(far_space, far)? * outwards;
        Some((rates_of_space(far_space, step)?, true))
    }
}

impl Walk<'_> {
    /// How much of the step leads to the edge at which the way leaves the triangle, and the corner over
    /// against it. The edge it came over does not count: by rounding it might seem to lead back.
    fn exit(&self) -> Option<(f64, usize)> {
        let leaves = |&corner: &usize| self.rates[corner] < 0.0 && self.came_over != Some(corner);
        let share = |corner: usize| (self.at.weights[corner].max(0.0) / -self.rates[corner], corner);
        (0..3).filter(leaves).map(share).min_by(|one, other| one.0.total_cmp(&other.0))
    }

    /// The place after a part of the step.
    fn after(&self, share: f64) -> Place {
        let weight = |corner: usize| self.at.weights[corner] + self.rates[corner] * share;
        Place { triangle: self.at.triangle, weights: [0, 1, 2].map(weight) }
    }

    /// Goes over the edge over against a corner. False if the mesh ends there.
    fn cross(&mut self, on_edge: Place, third: usize) -> bool {
        let near = [(third + 1) % 3, (third + 2) % 3, third];
        let Some(beyond) = self.surface.adjacency.beyond(on_edge.triangle, near[0]) else { return false };
        let Some((rates, is_seam)) = self.surface.turn(on_edge.triangle, near, self.rates, beyond) else {
            return false;
        };
        let [start, end] = [0, 1].map(|end| on_edge.weights[near[end]].max(0.0));
        let share = if start + end > 0.0 { end / (start + end) } else { 0.5 };
        let mut weights = [0.0; 3];
        weights[beyond.corners[0]] = 1.0 - share;
        weights[beyond.corners[1]] = share;
        self.at = Place { triangle: beyond.triangle, weights };
        self.rates = rates;
        self.came_over = Some(beyond.corners[2]);
        self.over_seam |= is_seam;
        true
    }
}

impl Iterator for Walk<'_> {
    type Item = Leg;

    fn next(&mut self) -> Option<Leg> {
        if self.left <= 0.0 || self.legs == MAX_LEGS {
            return None;
        }
        self.legs += 1;
        let (from, over_seam) = (self.at, self.over_seam);
        match self.exit() {
            Some((share, third)) if share < self.left => {
                let to = self.after(share);
                self.left -= share;
                let mesh_ends = !self.cross(to, third);
                if mesh_ends {
                    self.left = 0.0;
                }
                Some(Leg { from, to, over_seam, mesh_ends })
            }
            _ => {
                let to = self.after(self.left);
                self.left = 0.0;
                Some(Leg { from, to, over_seam, mesh_ends: false })
            }
        }
    }
}

impl Leg {
    /// The place at a part of the leg: 0 is `from`, 1 is `to`.
    pub(super) fn at(&self, share: f64) -> Place {
        let weight = |corner: usize| {
            let (from, to) = (self.from.weights[corner], self.to.weights[corner]);
            from + (to - from) * share
        };
        Place { triangle: self.from.triangle, weights: [0, 1, 2].map(weight) }
    }
}

/// The sum over the corners of a triangle.
fn sum<C: Copy, S: std::ops::Add<Output = S>>(
    weights: [f64; 3],
    corners: [C; 3],
    term: impl Fn(C, f64) -> S,
) -> S {
    term(corners[0], weights[0]) + term(corners[1], weights[1]) + term(corners[2], weights[2])
}

/// What a step on the map changes the weights of a triangle's corners by.
fn rates_of_map(corners: &[Vec2; 3], step: DVec2) -> Option<[f64; 3]> {
    let [ab, ac] = [1, 2].map(|corner| corners[corner].as_dvec2() - corners[0].as_dvec2());
    let area = ab.perp_dot(ac);
    finite_rates(step.perp_dot(ac) / area, ab.perp_dot(step) / area)
}

/// What a step in the plane of a triangle changes the weights of its corners by.
fn rates_of_space(corners: &[Vec3; 3], step: DVec3) -> Option<[f64; 3]> {
    let [ab, ac] = [1, 2].map(|corner| corners[corner].as_dvec3() - corners[0].as_dvec3());
    let normal = ab.cross(ac);
    let area = normal.length_squared();
    finite_rates(step.cross(ac).dot(normal) / area, ab.cross(step).dot(normal) / area)
}

fn finite_rates(second: f64, third: f64) -> Option<[f64; 3]> {
    (second.is_finite() && third.is_finite()).then_some([-second - third, second, third])
}
