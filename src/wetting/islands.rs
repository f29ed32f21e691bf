//! Islands of a map, and where a stamp goes on that hangs over the border of one.
//!
//! A stamp lies round the texel that was hit, in the image. What it covers of that texel's island, and of the gutter round it, is
//! the surface there. What it covers of another island, which may lie close by in the image, is another place: there the stamp goes
//! on where a way of as many texels over the mesh leads, over the border and round as the islands are turned ([`Ways`]).
//!
//! Not here: arms of one island that lie close to each other in the image, but not on the mesh.

use super::finder::Finder;
use super::geometry::TexelGeometry;
use super::grid::{Grid, Side};
use super::links::{Link, Links};
use crate::overlay::Wrap;

/// Of texels that belong to none.
const NONE: u16 = 0;

/// Of all islands that come after so many; taken for any.
const ANY: u16 = u16::MAX;

/// The longest way that is gone along each axis, in texels.
const LONGEST_WAY: i32 = 64;

/// To which island each texel of a map belongs.
pub(super) struct Islands {
    of: Vec<u16>,
}

impl Islands {
    /// Finds the islands: texels that lie side by side in the image and on the mesh. `links`: those of the finder's texels.
    pub(super) fn new(finder: &Finder, links: &Links) -> Self {
        let grid = finder.grid;
        let mut of = vec![NONE; grid.texels()];
        let (mut island, mut open) = (NONE, Vec::new());
        for first in 0..grid.texels() as u32 {
            if of[first as usize] != NONE || finder.owners.of(first).is_none() {
                continue;
            }
            island = island.saturating_add(1);
            of[first as usize] = island;
            open.push(first);
            while let Some(texel) = open.pop() {
                for side in Side::ALL {
                    let Some(other) = grid.beside(texel, side.offset()) else { continue };
                    if of[other as usize] != NONE || finder.owners.of(other).is_none() {
                        continue;
                    }
                    // Edges that touch without sharing their corners are no links, but no border, either.
                    if links.get(texel, side) == Link::Texel(other) || finder.lie_side_by_side(texel, other) {
                        of[other as usize] = island;
                        open.push(other);
                    }
                }
            }
        }
        Self { of }
    }

    /// Gives a texel on which nothing lies to the island of another.
    pub(super) fn add_gutter(&mut self, texel: u32, from: u32) {
        self.of[texel as usize] = self.of[from as usize];
    }

    /// Whether two texels belong to one island, as far as is known.
    #[inline]
    pub(super) fn are_one(&self, texel: u32, other: u32) -> bool {
        let [one, other] = [texel, other].map(|texel| self.of[texel as usize]);
        one == other || [one, other].iter().any(|&island| island == NONE || island == ANY)
    }

    /// Memory held, bytes.
    pub(super) fn bytes(&self) -> usize {
        self.of.capacity() * size_of::<u16>()
    }
}

/// Ways over the mesh, from texel to texel.
pub(super) struct Ways<'a> {
    geometry: &'a TexelGeometry,
    grid: Grid,
}

impl<'a> Ways<'a> {
    /// On a map with these edges.
    pub(super) fn new(geometry: &'a TexelGeometry, wrap: [Wrap; 2]) -> Self {
        Self { geometry, grid: Grid { size: geometry.size(), wrap } }
    }

    /// Where a way leads that goes from a texel as many columns and rows as another lies away in the image; where the mesh ends, it
    /// keeps to its border.
    pub(super) fn end(&self, from: u32, image: u32) -> u32 {
        let way = self.way(from, image);
        let steps = way.map(|steps| steps.abs().min(LONGEST_WAY));
        let mut gone = [0; 2];
        // Where columns and rows of the first island lead to on the present one.
        let mut axes = [Side::PlusU, Side::PlusV];
        let mut texel = from;
        for _ in 0..steps[0] + steps[1] {
            // As straight as steps allow.
            let axis = usize::from((2 * gone[0] + 1) * steps[1] > (2 * gone[1] + 1) * steps[0]);
            gone[axis] += 1;
            let side = if way[axis] > 0 { axes[axis] } else { axes[axis].opposite() };
            let Link::Texel(next) = self.geometry.link(texel, side) else { continue };
            if self.grid.beside(texel, side.offset()) != Some(next) {
                let [ahead, across] = self.over_border([texel, next], side, axes[1 - axis]);
                axes[axis] = if way[axis] > 0 { ahead } else { ahead.opposite() };
                axes[1 - axis] = across;
            }
            texel = next;
        }
        texel
    }

    /// Columns and rows from a texel to another, the shorter way round.
    fn way(&self, from: u32, to: u32) -> [i32; 2] {
        let size = self.grid.size as i32;
        let [from, to] = [from, to].map(|texel| self.grid.cell(texel));
        [0, 1].map(|axis| {
            let straight = to[axis] - from[axis];
            let is_longer = straight.abs() * 2 > size && self.grid.wrap[axis] == Wrap::Repeat;
            if is_longer { straight - size * straight.signum() } else { straight }
        })
    }

    /// What `side`, by which a way goes from one island to the next, and `across` are there.
    fn over_border(&self, [texel, next]: [u32; 2], side: Side, across: Side) -> [Side; 2] {
        let is_beside = |other: u32| {
            let away = self.way(texel, other);
            away.iter().all(|along| along.abs() <= 2)
        };
        let leads_back = |back: &Side| match self.geometry.link(next, *back) {
            Link::Texel(other) => other == texel || !self.is_beside_in_image(next, other) && is_beside(other),
            Link::Edge => false,
        };
        let Some(back) = Side::ALL.into_iter().find(leads_back) else { return [side, across] };
        let ahead = back.opposite();
        let as_turned = turned(across, quarters(ahead) - quarters(side));
        // A mirrored island goes the other way across: the neighbours' links tell.
        let neighbour = |texel: u32, side: Side| match self.geometry.link(texel, side) {
            Link::Texel(other) => Some(other),
            Link::Edge => None,
        };
        let beside_next = neighbour(texel, across).and_then(|beside| neighbour(beside, side));
        let is_mirrored = beside_next.is_some() && neighbour(next, as_turned.opposite()) == beside_next;
        [ahead, if is_mirrored { as_turned.opposite() } else { as_turned }]
    }

    fn is_beside_in_image(&self, texel: u32, other: u32) -> bool {
        Side::ALL.into_iter().any(|side| self.grid.beside(texel, side.offset()) == Some(other))
    }
}

/// Quarter turns from +u, by way of +v.
fn quarters(side: Side) -> i32 {
    match side {
        Side::PlusU => 0,
        Side::PlusV => 1,
        Side::MinusU => 2,
        Side::MinusV => 3,
    }
}

fn turned(side: Side, by: i32) -> Side {
    match (quarters(side) + by).rem_euclid(4) {
        0 => Side::PlusU,
        1 => Side::PlusV,
        2 => Side::MinusU,
        _ => Side::MinusV,
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::{Affine3A, Vec2, Vec3};

    use super::super::points::surface_points;
    use super::super::test_meshes::{Cube, cylinder, floor, joined, sheet};
    use super::*;
    use crate::collision::MeshTriangles;

    const SIZE: u32 = 64;

    fn geometry(mesh: &MeshTriangles, wrap: [Wrap; 2]) -> TexelGeometry {
        TexelGeometry::new(mesh, &Affine3A::IDENTITY, Vec3::Y, SIZE, wrap)
    }

    fn at(column: u32, row: u32) -> u32 {
        row * SIZE + column
    }

    #[test]
    fn what_lies_beside_in_the_image_alone_gets_nothing() {
        // Two squares, ten metres apart, and two texels apart on the map.
        let square = |along: f32, column: f32| {
            let on_map = move |point: Vec2| (Vec2::new(column, 8.0) + point * 24.0) / SIZE as f32;
            sheet(2, move |point| floor(point) + Vec3::X * along, on_map)
        };
        let mesh = joined([square(0.0, 4.0), square(10.0, 30.0)]);
        let wrap = [Wrap::Clamp; 2];
        let geometry = geometry(&mesh, wrap);
        let home = at(26, 20);
        for column in 18..40 {
            let got = geometry.under_stamp(home, at(column, 22), wrap);
            // The border takes what hangs over it.
            assert_eq!(got, Some(at(column.min(27), 22)), "{column}");
        }
        let other = at(31, 20);
        assert_eq!(geometry.under_stamp(other, at(25, 20), wrap), Some(at(30, 20)));
        assert_eq!(geometry.under_stamp(other, at(28, 20), wrap), Some(at(30, 20)));
    }

    #[test]
    fn cracks_and_the_edge_of_a_map_that_repeats_are_no_borders() {
        // The second half has other corners along the crack than the first.
        let half = |cells: u32, from: f32| {
            let part = move |point: Vec2| Vec2::new(from + 0.5 * point.x, point.y);
            sheet(cells, move |point| floor(part(point)), part)
        };
        let mesh = joined([half(2, 0.0), half(3, 0.5)]);
        let wrap = [Wrap::Clamp; 2];
        let cracked = geometry(&mesh, wrap);
        assert_eq!(cracked.under_stamp(at(30, 20), at(34, 21), wrap), Some(at(34, 21)));
        let wrap = [Wrap::Repeat, Wrap::Clamp];
        let round = geometry(&cylinder(12), wrap);
        assert_eq!(round.under_stamp(at(62, 20), at(2, 21), wrap), Some(at(2, 21)));
    }

    #[test]
    fn over_a_border_it_goes_on_as_deep_on_the_next_face_of_a_cube() {
        for turned in [false, true] {
            // Islands of 18 texels, two apart: a stamp reaches from one into the next.
            let cube = Cube { cells: 2, size: SIZE, island: 18.0, first: 2.0, pitch: 20.0, turned };
            let (mesh, wrap) = (cube.mesh(), [Wrap::Clamp; 2]);
            let geometry = geometry(&mesh, wrap);
            let mut places = vec![None; (SIZE * SIZE) as usize];
            for point in surface_points(&mesh, &Affine3A::IDENTITY, SIZE, wrap) {
                places[point.texel as usize] = Some(point.position);
            }
            let face = |texel: u32| geometry.owner(texel).map(|owner| cube.face(owner));
            // On the first island, three texels from the border to the second.
            let home = at(16, 11);
            let here = Cube::FACES[0][0];
            for column in 22..26 {
                let image = at(column, 11);
                assert_eq!(face(image), Some(1), "it lies on the second island");
                let got = geometry.under_stamp(home, image, wrap).expect("somewhere");
                let to = face(got).expect("owned");
                assert_eq!(Cube::FACES[to][0].dot(here), 0.0, "{turned}: on a face that meets the first");
                // As far from home as it lies away in the image, round the edge.
                let place = places[got as usize].expect("owned");
                let depth = (0.5 - place.dot(here)) * 18.0;
                assert!((depth - (column as f32 - 19.5)).abs() < 0.01, "{turned} {column}: {depth}");
            }
            // And one row aside, so that a wrong turn would be seen.
            let start = places[home as usize].expect("owned");
            let got = geometry.under_stamp(home, at(24, 14), wrap).expect("somewhere");
            let place = places[got as usize].expect("owned");
            let edge = Cube::FACES[face(got).expect("owned")][0].cross(here);
            let aside = ((place - start).dot(edge) * 18.0).abs();
            assert!((aside - 3.0).abs() < 0.01, "{turned}: {aside}");
        }
    }

    #[test]
    fn a_quarter_turn_takes_u_to_v() {
        for (number, side) in [Side::PlusU, Side::PlusV, Side::MinusU, Side::MinusV].into_iter().enumerate() {
            assert_eq!(quarters(side), number as i32);
            assert_eq!(turned(side, 2), side.opposite());
            assert_eq!(turned(turned(side, 1), -1), side);
        }
        assert_eq!(turned(Side::MinusV, 1), Side::PlusU);
    }
}
