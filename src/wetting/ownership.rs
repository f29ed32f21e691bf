//! Which triangle each texel of a map lies on, and where on it.

use std::ops::Range;

use bevy::math::Vec2;

use super::adjacency::{is_collapsed, weld_distance};
use super::grid::Grid;
use crate::collision::MeshTriangles;
use crate::overlay::{Footprint, Wrap};

/// The owner of texels on which no triangle lies.
pub(super) const NOBODY: u32 = u32::MAX;

/// How far from its middle, in tiles, a triangle larger than the map is looked at. One that is not a needle
/// covers every texel within that.
const TILES_AROUND: i32 = 3;

/// Columns and rows are counted up to this one: by then an f32 cannot tell neighbours apart.
const FARTHEST_TEXEL: f32 = 1e9;

/// How often, for each texel of the map, all triangles larger than the map together may be asked whether they
/// cover it. Real meshes need a few; only those without sense come to the end of it.
const QUESTIONS_PER_TEXEL: u64 = 64;

/// The triangles that texels belong to.
///
/// A texel belongs to the first triangle that covers its middle in any tile. What is left goes, in the order
/// of the triangles, to those that cover no middle (the texel to which [`TexelAreas`] adds their area) and to
/// what lies beyond a clamped edge. So a texel has an owner exactly if it has an area, with two exceptions:
/// the area of a triangle that reaches over more than the whole map goes to all texels alike, and one with
/// two corners in the same place, as around the poles of a sphere, owns nothing, however much of the map it
/// covers.
///
/// [`TexelAreas`]: crate::overlay::TexelAreas
pub(super) struct Ownership {
    /// The triangle of each texel, or [`NOBODY`].
    pub(super) triangle: Vec<u32>,
    /// Barycentric weights of that triangle's second and third corner: where the texel's middle lies on it
    /// or, if it does not cover the middle, its point closest to that on the map.
    pub(super) weights: Vec<[f32; 2]>,
}

impl Ownership {
    /// Finds the owners.
    pub(super) fn new(triangles: &MeshTriangles, grid: Grid) -> Self {
        let texels = grid.texels();
        let owners = Self { triangle: vec![NOBODY; texels], weights: vec![[0.0; 2]; texels] };
        let questions = QUESTIONS_PER_TEXEL * texels as u64;
        let mut painter = Painter { grid, owners, free: texels, questions };
        let mut left_over = Vec::new();
        let weld_distance = weld_distance(&triangles.positions);
        for (triangle, (corners, uvs)) in (0u32..).zip(triangles.positions.iter().zip(&triangles.uvs)) {
            if is_collapsed(corners, weld_distance) {
                continue;
            }
            let outline = Outline::new(uvs, grid.size);
            if outline.is_larger_than(grid.size) {
                painter.tile(triangle, &outline);
                continue;
            }
            let covered = painter.cover(triangle, &outline, true);
            if covered.middles == 0 || covered.beyond_the_map {
                left_over.push((triangle, covered.middles > 0));
            }
        }
        for (triangle, has_middles) in left_over {
            let outline = Outline::new(&triangles.uvs[triangle as usize], grid.size);
            if has_middles {
                painter.cover(triangle, &outline, false);
            } else {
                painter.claim(triangle, &outline);
            }
        }
        painter.owners
    }

    /// The triangle of a texel.
    pub(super) fn of(&self, texel: u32) -> Option<u32> {
        Some(self.triangle[texel as usize]).filter(|&triangle| triangle != NOBODY)
    }
}

/// What a triangle covers.
struct Covered {
    /// Middles of texels, once per tile.
    middles: u32,
    /// Whether some lie beyond a clamped edge.
    beyond_the_map: bool,
}

/// Gives texels away.
struct Painter {
    grid: Grid,
    owners: Ownership,
    /// Texels without an owner.
    free: usize,
    /// How many texels may still be looked at for triangles larger than the map.
    questions: u64,
}

impl Painter {
    fn take(&mut self, texel: u32, triangle: u32, weights: [f32; 2]) {
        let owner = &mut self.owners.triangle[texel as usize];
        if *owner == NOBODY {
            *owner = triangle;
            self.owners.weights[texel as usize] = weights;
            self.free -= 1;
        }
    }

    /// Takes the texels whose middles a triangle covers, with or without those beyond a clamped edge.
    fn cover(&mut self, triangle: u32, outline: &Outline, only_inside: bool) -> Covered {
        let mut covered = Covered { middles: 0, beyond_the_map: false };
        if outline.is_a_line() {
            return covered;
        }
        for row in outline.low.y.floor() as i32..=outline.high.y.floor() as i32 {
            for column in outline.low.x.floor() as i32..=outline.high.x.floor() as i32 {
                let middle = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                if !outline.footprint.covers(middle) {
                    continue;
                }
                covered.middles += 1;
                let inside = self.grid.holds(column, row);
                covered.beyond_the_map |= !inside;
                if inside || !only_inside {
                    self.take(self.grid.texel(column, row), triangle, outline.weights(middle));
                }
            }
        }
        covered
    }

    /// Takes the texel in which a triangle that covers no middle lies.
    fn claim(&mut self, triangle: u32, outline: &Outline) {
        let middle = ((outline.low + outline.high) / 2.0).floor();
        let texel = self.grid.texel(middle.x as i32, middle.y as i32);
        self.take(texel, triangle, outline.closest_weights(middle + Vec2::splat(0.5)));
    }

    /// Takes what a triangle larger than the map covers, once each.
    fn tile(&mut self, triangle: u32, outline: &Outline) {
        if outline.is_a_line() || self.free == 0 {
            return;
        }
        let [columns, rows] = [0, 1].map(|axis| self.window(outline, axis));
        let size = self.grid.size as i32;
        let mut tiles: Vec<[i32; 2]> = (-rows.tiles_around..=rows.tiles_around)
            .flat_map(|row| (-columns.tiles_around..=columns.tiles_around).map(move |column| [column, row]))
            .collect();
        tiles.sort_by_key(|[column, row]| column * column + row * row);
        for row in rows.texels.clone() {
            for column in columns.texels.clone() {
                if self.questions == 0 {
                    return;
                }
                self.questions -= 1;
                let texel = self.grid.texel(column, row);
                if self.owners.triangle[texel as usize] != NOBODY {
                    continue;
                }
                let middle = tiles.iter().find_map(|[columns, rows]| {
                    self.questions = self.questions.saturating_sub(1);
                    let (column, row) = (column + columns * size, row + rows * size);
                    let middle = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                    outline.footprint.covers(middle).then_some(middle)
                });
                if let Some(middle) = middle {
                    self.take(texel, triangle, outline.weights(middle));
                }
            }
        }
    }

    /// Where to look for the texels of a triangle larger than the map. Along an axis on which it is larger,
    /// that is the one tile around its middle, so that what lies beside them on the map is, as far as
    /// possible, the same triangle once more.
    fn window(&self, outline: &Outline, axis: usize) -> Window {
        let texel = |place: f32| place.floor().clamp(-FARTHEST_TEXEL, FARTHEST_TEXEL) as i32;
        let size = self.grid.size as i32;
        let (low, high) = (outline.low.to_array()[axis], outline.high.to_array()[axis]);
        match self.grid.wrap[axis] {
            Wrap::Clamp => {
                Window { texels: texel(low).max(0)..texel(high).min(size - 1) + 1, tiles_around: 0 }
            }
            Wrap::Repeat if high - low < size as f32 => {
                Window { texels: texel(low)..texel(high) + 1, tiles_around: 0 }
            }
            Wrap::Repeat => {
                let [a, b, c] = outline.corners.map(|corner| corner.to_array()[axis] / 3.0);
                let first = texel(a + b + c) - size / 2;
                Window { texels: first..first + size, tiles_around: TILES_AROUND }
            }
        }
    }
}

/// The texels along an axis that may belong to a triangle.
struct Window {
    /// Columns or rows, of any tile.
    texels: Range<i32>,
    /// How many tiles to either side are to be tried, if not these.
    tiles_around: i32,
}

/// A triangle on the map, in texels.
pub(super) struct Outline {
    corners: [Vec2; 3],
    footprint: Footprint,
    pub(super) low: Vec2,
    pub(super) high: Vec2,
    /// Twice the area with the sign of the winding, inverted.
    inverse_area: f32,
}

impl Outline {
    fn new(uvs: &[Vec2; 3], size: u32) -> Self {
        Self::of(uvs.map(|uv| uv * size as f32))
    }

    /// With these corners, in texels.
    pub(super) fn of(corners: [Vec2; 3]) -> Self {
        let footprint = Footprint::new(corners);
        let (low, high) = footprint.bounds();
        let [a, b, c] = corners;
        Self { corners, footprint, low, high, inverse_area: (b - a).perp_dot(c - a).recip() }
    }

    /// Whether its area is none, or none that can be counted with.
    fn is_a_line(&self) -> bool {
        !self.inverse_area.is_finite() || self.inverse_area == 0.0
    }

    /// Whether its box is larger than the map by more than a texel, as `TexelAreas` sees it.
    pub(super) fn is_larger_than(&self, size: u32) -> bool {
        let extent = self.high - self.low;
        extent.max_element() > size as f32 + 1.0
    }

    /// Whether any point of it lies less than a texel from this one, along u and along v.
    pub(super) fn reaches(&self, point: Vec2) -> bool {
        let corners = self.corners.map(|corner| corner - point);
        let is_in_box = (self.low - point).max_element() < 1.0 && (self.high - point).min_element() > -1.0;
        is_in_box
            && [(0, 1), (1, 2), (2, 0)].into_iter().all(|(from, to)| {
                // What boxes do not tell apart, a line along an edge does.
                let across = (corners[to] - corners[from]).perp();
                let reach = across.abs().element_sum();
                let sides = corners.map(|corner| corner.dot(across));
                sides.iter().any(|&side| side <= reach) && sides.iter().any(|&side| side >= -reach)
            })
    }

    /// Weights of the second and third corner at a point that it covers.
    fn weights(&self, point: Vec2) -> [f32; 2] {
        let [a, b, c] = self.corners;
        let second = ((point - a).perp_dot(c - a) * self.inverse_area).clamp(0.0, 1.0);
        let third = ((b - a).perp_dot(point - a) * self.inverse_area).clamp(0.0, 1.0 - second);
        [second, third]
    }

    /// Weights of the second and third corner at the point of its edges that is closest to `point`.
    pub(super) fn closest_weights(&self, point: Vec2) -> [f32; 2] {
        // Of a triangle that is a point on the map, any will do.
        let mut closest = (f32::INFINITY, [1.0 / 3.0; 3]);
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            let (start, edge) = (self.corners[from], self.corners[to] - self.corners[from]);
            let share = ((point - start).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
            let distance = point.distance_squared(start + edge * share);
            // False for an edge without length, whose share is not a number.
            if distance < closest.0 {
                let mut weights = [0.0; 3];
                weights[from] = 1.0 - share;
                weights[to] = share;
                closest = (distance, weights);
            }
        }
        let [_, second, third] = closest.1;
        [second, third]
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_meshes::{floor, joined, sheet};
    use super::*;
    use bevy::math::Vec3;

    fn owners(mesh: &MeshTriangles, size: u32, wrap: [Wrap; 2]) -> Ownership {
        Ownership::new(mesh, Grid { size, wrap })
    }

    #[test]
    fn no_texel_is_lost_between_triangles() {
        // Middles lie on their edges, give or take rounding.
        for cells in 1..50 {
            let owners = owners(&sheet(cells, floor, |point| point), 32, [Wrap::Clamp; 2]);
            assert!(owners.triangle.iter().all(|&triangle| triangle != NOBODY), "{cells}");
        }
    }

    #[test]
    fn the_first_one_has_it() {
        let mesh = joined([1.0, 0.5, 1.0].map(|size| sheet(1, floor, move |point| point * size)));
        let owners = owners(&mesh, 16, [Wrap::Repeat; 2]);
        assert!((0..256).all(|texel| owners.of(texel).is_some_and(|triangle| triangle < 2)));
    }

    #[test]
    fn tiles_of_a_large_triangle_hang_together() {
        let stripe = |point: Vec2| Vec2::new(point.x * 7.5, point.y * 0.25 + 0.3);
        for wrap in [[Wrap::Repeat; 2], [Wrap::Repeat, Wrap::Clamp]] {
            let owners = owners(&sheet(1, floor, stripe), 64, wrap);
            for (texel, &triangle) in owners.triangle.iter().enumerate() {
                let in_stripe = (0.3..0.55).contains(&((texel / 64) as f32 / 64.0 + 0.5 / 64.0));
                assert_eq!(triangle != NOBODY, in_stripe, "{texel}");
            }
        }
    }

    #[test]
    fn what_has_two_corners_in_one_place_owns_nothing() {
        let mut mesh = sheet(1, floor, |point| point);
        mesh.positions[0][1] = mesh.positions[0][0] + Vec3::X * 1e-7;
        let owners = owners(&mesh, 16, [Wrap::Repeat; 2]);
        assert!(owners.triangle.iter().all(|&triangle| triangle != 0));
        assert!(owners.triangle.contains(&1));
    }
}
