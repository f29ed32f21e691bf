//! Texels between the islands of a map: no triangle lies on them, but stamps do, and the filter of a sampler.
//!
//! Who stands for them is found ring by ring around the texels that triangles own. What the filter reaches from tips of
//! islands so thin that no ring comes there, or that of another island first, is added afterwards ([`touched`]).

use bevy::math::Vec2;

use super::finder::Finder;
use super::grid::{Grid, Side};
use super::touched::{Touched, touched};
use crate::overlay::TILE_SIZE;

/// Rings of texels around the islands that have a stand-in.
const STAND_IN_RINGS: i32 = 8;

/// How far from an island a texel has a source, in texels along each axis.
const SOURCE_TEXELS: i32 = 2;

/// Who takes the place of texels that no triangle owns.
pub(super) struct Gutters {
    /// Ascending by texel.
    stand_ins: Vec<StandIn>,
    /// A texel, and the owned one nearest to it in the image, or on the mesh if it is one of the tips; ascending.
    sources: Vec<(u32, u32)>,
    /// Ascending by texel.
    tips: Vec<Tip>,
}

/// A texel that the filter of a sampler reaches from a triangle whose island owns none near it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tip {
    pub(crate) texel: u32,
    /// The owned texel that it shows.
    pub(crate) source: u32,
    /// The triangle, and the weights of its second and third corner at its point closest to the texel's middle.
    pub(crate) triangle: u32,
    pub(crate) weights: [f32; 2],
    /// The way from there to the middle, in texels.
    pub(crate) away: Vec2,
}

/// Who stands for the surface at a texel that no triangle owns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct StandIn {
    pub(super) texel: u32,
    /// The owned texel that continues the surface there.
    pub(super) other: u32,
    /// A triangle of the nearest island, from which the way led there.
    pub(super) triangle: u32,
}

/// A texel of a ring.
pub(super) struct Reached {
    pub(super) texel: u32,
    /// The owned texel from which it was reached.
    pub(super) from: u32,
    /// The way from there, in columns and rows.
    pub(super) offset: [i32; 2],
}

impl Reached {
    /// The texel on a side of this one in the image, reached over it.
    pub(super) fn onward(&self, grid: Grid, side: Side) -> Option<Self> {
        let [columns, rows] = side.offset();
        let texel = grid.beside(self.texel, [columns, rows])?;
        Some(Self { texel, from: self.from, offset: [self.offset[0] + columns, self.offset[1] + rows] })
    }
}

impl Gutters {
    /// Tiles and the other tiles that have texels whose sources lie in them; ascending.
    pub(super) fn tiles(&self, size: u32) -> Vec<(u32, u32)> {
        let tile = |texel: u32| texel / size / TILE_SIZE * (size / TILE_SIZE) + texel % size / TILE_SIZE;
        let mut tiles: Vec<(u32, u32)> = self
            .sources
            .iter()
            .map(|&(texel, source)| (tile(source), tile(texel)))
            .filter(|(source, texel)| source != texel)
            .collect();
        tiles.sort_unstable();
        tiles.dedup();
        tiles
    }

    /// Goes outwards from the islands ring by ring, over the sides of texels. What continues the surface at a
    /// texel is found by a walk from the island straight over its border. `islands`: of all triangles.
    pub(super) fn new(finder: &Finder, islands: &[u32]) -> Self {
        let grid = finder.grid;
        let mut seen: Vec<bool> =
            (0..grid.texels() as u32).map(|texel| finder.owners.of(texel).is_some()).collect();
        let borders = |texel: &u32| {
            let beside = |side: Side| grid.beside(*texel, side.offset());
            seen[*texel as usize]
                && Side::ALL.into_iter().filter_map(beside).any(|other| !seen[other as usize])
        };
        let mut ring: Vec<Reached> = (0..grid.texels() as u32)
            .filter(borders)
            .map(|texel| Reached { texel, from: texel, offset: [0, 0] })
            .collect();
        let mut gutters = Self { stand_ins: Vec::new(), sources: Vec::new(), tips: Vec::new() };
        for number in 1..=STAND_IN_RINGS {
            let mut next = Vec::new();
            for reached in &ring {
                for onward in Side::ALL.into_iter().filter_map(|side| reached.onward(grid, side)) {
                    if !std::mem::replace(&mut seen[onward.texel as usize], true) {
                        next.push(onward);
                    }
                }
            }
            next.sort_unstable_by_key(|reached| reached.texel);
            for reached in &next {
                let &Reached { texel, from, offset } = reached;
                let (other, triangle) =
                    (finder.stand_in(from, offset), finder.owners.triangle[from as usize]);
                gutters.stand_ins.push(StandIn { texel, other, triangle });
                // No ring beyond that of the corners has a part in the square.
                if number <= 2 * SOURCE_TEXELS
                    && let Some(source) = nearest_in_image(finder, reached.texel)
                {
                    gutters.sources.push((reached.texel, source));
                }
            }
            ring = next;
        }
        gutters.stand_ins.sort_unstable();
        gutters.sources.sort_unstable();
        gutters.add_tips(finder, islands);
        gutters.sources.shrink_to_fit();
        gutters
    }

    /// Adds what triangles reach but no ring of their island does, or that of another one first though it lies further away.
    fn add_tips(&mut self, finder: &Finder, islands: &[u32]) {
        let beside = |texel: u32| self.stand_ins.binary_search_by_key(&texel, |stand_in| stand_in.texel).ok();
        let is_beside = |texel: u32, triangle: u32| {
            beside(texel).is_some_and(|index| {
                islands[self.stand_ins[index].triangle as usize] == islands[triangle as usize]
            })
        };
        let (mut stand_ins, mut sources, mut tips) = (Vec::new(), Vec::new(), Vec::new());
        for Touched { texel, place, away } in touched(finder, is_beside) {
            let triangle = place.triangle;
            let is_own = |owner: u32| islands[owner as usize] == islands[triangle as usize];
            let is_known = is_beside(texel, triangle);
            let shown = self.source(texel).and_then(|source| finder.owners.of(source));
            let is_shown = shown.is_some_and(is_own);
            if is_known && is_shown {
                continue;
            }
            let Some(other) = finder.nearest_to(&place, texel, is_own) else { continue };
            if !is_known {
                stand_ins.push(StandIn { texel, other, triangle });
            }
            if !is_shown {
                sources.push((texel, other));
                let weights = [place.weights[1], place.weights[2]].map(|weight| weight as f32);
                tips.push(Tip { texel, source: other, triangle, weights, away: away.as_vec2() });
            }
        }
        put_instead(&mut self.stand_ins, stand_ins, |stand_in| stand_in.texel);
        put_instead(&mut self.sources, sources, |&(texel, _)| texel);
        self.tips = tips;
    }

    /// Texels of thin tips, ascending; all of them have sources.
    pub(super) fn tips(&self) -> &[Tip] {
        &self.tips
    }

    /// Who stands for unowned texels, ascending; afterwards nobody does.
    pub(super) fn take_stand_ins(&mut self) -> Vec<StandIn> {
        std::mem::take(&mut self.stand_ins)
    }

    /// The owned texel that an unowned one shows.
    pub(super) fn source(&self, texel: u32) -> Option<u32> {
        look_up(&self.sources, texel)
    }

    /// Memory held, bytes.
    pub(super) fn bytes(&self) -> usize {
        self.stand_ins.capacity() * size_of::<StandIn>()
            + self.sources.capacity() * size_of::<(u32, u32)>()
            + self.tips.capacity() * size_of::<Tip>()
    }
}

/// Puts rows into a list that ascends by texel, in place of those of the same texels.
fn put_instead<T>(list: &mut Vec<T>, rows: Vec<T>, texel: impl Fn(&T) -> u32) {
    let mut added = Vec::new();
    for row in rows {
        match list.binary_search_by_key(&texel(&row), &texel) {
            Ok(index) => list[index] = row,
            Err(_) => added.push(row),
        }
    }
    list.append(&mut added);
    list.sort_unstable_by_key(texel);
}

fn look_up(list: &[(u32, u32)], texel: u32) -> Option<u32> {
    let index = list.binary_search_by_key(&texel, |&(texel, _)| texel).ok()?;
    Some(list[index].1)
}

/// The nearest owned texel in the square around one; the first of several.
fn nearest_in_image(finder: &Finder, texel: u32) -> Option<u32> {
    let span = || -SOURCE_TEXELS..=SOURCE_TEXELS;
    let cell = finder.grid.cell(texel);
    let around = span().flat_map(|rows| span().map(move |columns| [columns, rows]));
    around
        .filter_map(|offset| {
            let other = finder.grid.beside_cell(cell, offset)?;
            let [columns, rows] = offset;
            finder.owners.of(other).map(|_| (columns * columns + rows * rows, other))
        })
        .min_by_key(|&(distance, _)| distance)
        .map(|(_, other)| other)
}

#[cfg(test)]
mod tests {
    use super::super::geometry::TexelGeometry;
    use super::super::points::surface_points;
    use super::super::test_meshes::{Cube, floor, sheet};
    use crate::overlay::Wrap;
    use bevy::math::{Affine3A, Vec2, Vec3};

    fn cells(texel: u32, size: u32) -> [i32; 2] {
        [(texel % size) as i32, (texel / size) as i32]
    }

    #[test]
    fn a_stamp_over_the_border_of_a_cubes_face_lands_on_the_next_face() {
        for turned in [false, true] {
            let cube = Cube { cells: 2, size: 128, island: 20.0, first: 10.0, pitch: 40.0, turned };
            let (mesh, wrap) = (cube.mesh(), [Wrap::Repeat; 2]);
            let geometry = TexelGeometry::new(&mesh, &Affine3A::IDENTITY, Vec3::Y, cube.size, wrap);
            let mut places = vec![None; 128 * 128];
            for point in surface_points(&mesh, &Affine3A::IDENTITY, cube.size, wrap) {
                places[point.texel as usize] = Some(point.position);
                assert_eq!(geometry.stand_in(point.texel), Some(point.texel));
                assert_eq!(geometry.gutter_source(point.texel), None);
            }
            let mut count = 0;
            for texel in (0..128 * 128).filter(|&texel| geometry.owner(texel).is_none()) {
                let [column, row] = cells(texel, 128);
                // How far out of the island it lies, along u and v.
                let [out_u, out_v] = [column, row].map(|number| {
                    let within = (number - 10).rem_euclid(40);
                    if within < 20 { 0 } else { (within - 19).min(40 - within) }
                });
                let beside_an_island = column < 119 && row < 79;
                let stand_in = geometry.stand_in(texel);
                if !beside_an_island || out_u + out_v > 8 {
                    continue;
                }
                count += 1;
                let stand_in = stand_in.expect("within 8 rings");
                let place = places[stand_in as usize].expect("owned");
                // The island that it hangs over from, and the border there.
                let home = |number: i32| (number - 10 + 10).div_euclid(40);
                let face = (home(row) * 3 + home(column)) as usize;
                let normal = Cube::FACES[face][0];
                let depth = (0.5 - place.dot(normal)) * 20.0;
                if out_u == 0 || out_v == 0 {
                    // Straight over the border: as deep on the next face as it hangs over.
                    let next = Cube::FACES[cube.face(geometry.owner(stand_in).expect("owned"))][0];
                    assert_eq!(next.dot(normal), 0.0);
                    assert!((depth - ((out_u + out_v) as f32 - 0.5)).abs() < 0.01, "{column} {row} {depth}");
                }
                let near = out_u <= 2 && out_v <= 2;
                assert_eq!(geometry.gutter_source(texel).is_some(), near, "{column} {row}");
                if let Some(source) = geometry.gutter_source(texel) {
                    let [source_column, source_row] = cells(source, 128);
                    let distance = [(column - source_column).abs(), (row - source_row).abs()];
                    assert_eq!(distance, [out_u, out_v]);
                }
            }
            assert!(count > 6 * 4 * 20 * 8, "{count}");
        }
    }

    #[test]
    fn where_the_mesh_ends_the_border_takes_what_hangs_over() {
        let mesh = sheet(3, floor, |point| Vec2::splat(0.25) + point * 0.5);
        let wrap = [Wrap::Clamp; 2];
        let geometry = TexelGeometry::new(&mesh, &Affine3A::IDENTITY, Vec3::Y, 64, wrap);
        let at = |column: u32, row: u32| row * 64 + column;
        assert_eq!(geometry.stand_in(at(15, 20)), Some(at(16, 20)));
        assert_eq!(geometry.stand_in(at(8, 20)), Some(at(16, 20)));
        assert_eq!(geometry.stand_in(at(7, 20)), None);
        assert_eq!(geometry.stand_in(at(30, 50)), Some(at(30, 47)));
        assert_eq!(geometry.gutter_source(at(14, 14)), Some(at(16, 16)));
        assert_eq!(geometry.gutter_source(at(13, 20)), None);
    }
}
