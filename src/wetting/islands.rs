//! Islands of a map: triangles that hang together on it, and where what falls over an island's border belongs.
//!
//! Triangles with an edge in common on the mesh and on the map are of one island. So are parts of the mesh that touch along a
//! border, in space as in the image, without sharing edges: planks with one map over all of them, or what meets at a corner in
//! mid-edge.
//!
//! A stamp lies on the map as a square of columns and rows. Beyond the border of its island these lead to texels that are some
//! other island's: beside it in the image, anywhere on the mesh. What belongs there instead is found once, when the mesh is
//! measured. From each island, ring by ring, a way goes straight over its border and on over the mesh; a texel of the rings
//! for which that comes to something else than [`TexelGeometry::stand_in`](super::TexelGeometry::stand_in) is a *stray* of
//! that island. What goes over a seam is shared out among several texels ([`Landings`]). Tiles that lie on one island alone are
//! marked: stamps within them need not ask at all.
//!
//! Not here: what lies further out than the rings goes to the island's nearest texel in its row or column. An atlas of
//! thousands of small islands gets fewer rings, as many as there is memory for.

use super::finder::Finder;
use super::grid::{Grid, Side};
use super::gutters::{Reached, StandIn};
use super::landings::{Landing, Landings, Sharing};
use super::ownership::NOBODY;
use crate::overlay::{TILE_SIZE, Wrap};

/// Rings of texels around each island that are looked at, if there is memory for their strays.
const MOST_RINGS: u64 = 16;

/// How far the nearest texel of an island is sought beyond its rings, in columns or rows.
const FARTHEST_LOOK: i32 = 64;

/// Pairs of texels along a common border from which on two parts of a mesh may count as one.
const LEAST_TOUCHES: usize = 8;

/// How many times as many of these pairs must lie side by side in space as do not.
const TOUCHES_FOR_ONE_APART: usize = 3;

/// Marks tiles that are not of one island alone.
const SHARED: u32 = u32::MAX;

/// The islands of a map, numbered in the order of their first triangles.
pub(super) struct Islands {
    grid: Grid,
    of_triangle: Vec<u32>,
    /// By tile: the island on which, or next to which, all its texels lie; or [`SHARED`].
    tiles: Vec<u32>,
    /// Whether no tile is shared, and all are of the same island.
    is_alone: bool,
    /// For each island where its strays begin, and then where those of the last one end.
    starts: Vec<u32>,
    /// A texel, and the owned one that gets what falls there from this island; ascending within each.
    strays: Vec<(u32, u32)>,
    landings: Landings,
}

impl Islands {
    /// Finds the strays of all islands. `of_triangle`, `count`: by [`number_triangles`]; `stand_ins`: of texels that nobody owns.
    pub(super) fn new(finder: &Finder, of_triangle: Vec<u32>, count: u32, stand_ins: &[StandIn]) -> Self {
        let grid = finder.grid;
        let mut whose: Vec<u32> = finder.owners.triangle.clone();
        for island in whose.iter_mut().filter(|owner| **owner != NOBODY) {
            *island = of_triangle[*island as usize];
        }
        for stand_in in stand_ins {
            whose[stand_in.texel as usize] = of_triangle[stand_in.triangle as usize];
        }
        let tiles = islands_of_tiles(&whose, grid.size);
        let is_alone = tiles.iter().all(|&island| island != SHARED && island == tiles[0]);
        let (starts, strays, landings) = (Vec::new(), Vec::new(), Landings::default());
        let mut islands = Self { grid, of_triangle, tiles, is_alone, starts, strays, landings };
        islands.find_strays(finder, &whose, count as usize);
        islands
    }

    /// The island of a triangle.
    #[inline]
    pub(super) fn of(&self, triangle: u32) -> u32 {
        self.of_triangle[triangle as usize]
    }

    /// Whether these columns and rows, from first to last and wherever the map ends, are known to lie on one island.
    #[inline]
    pub(super) fn is_one(&self, columns: (i32, i32), rows: (i32, i32)) -> bool {
        if self.is_alone {
            return true;
        }
        let across = self.grid.size.div_ceil(TILE_SIZE);
        let tiles_of = |(first, last): (i32, i32), wrap: Wrap| {
            let tile = TILE_SIZE as i32;
            wrap.cells(first.div_euclid(tile), last.div_euclid(tile), across)
        };
        let (columns, rows) = (tiles_of(columns, self.grid.wrap[0]), tiles_of(rows, self.grid.wrap[1]));
        let mut one = None;
        rows.flat_map(|row| columns.clone().map(move |column| row * across + column)).all(|tile| {
            let island = self.tiles[tile as usize];
            island != SHARED && *one.get_or_insert(island) == island
        })
    }

    /// Who gets what falls over a texel that is not of an island from a stamp that is.
    pub(super) fn stray(&self, island: u32, texel: u32) -> Option<u32> {
        let [from, until] = [0, 1].map(|end| self.starts[island as usize + end] as usize);
        let strays = &self.strays[from..until];
        let index = strays.binary_search_by_key(&texel, |&(texel, _)| texel).ok()?;
        Some(strays[index].1)
    }

    /// Who shares what falls over a texel that is not of an island from a stamp that is; None if one gets all.
    pub(super) fn shared(&self, island: u32, texel: u32) -> Option<Landing<'_>> {
        self.landings.get(island, texel)
    }

    /// On the way from a texel to `home` along its row or its column, the nearest one that `is_meant`; none within
    /// [`FARTHEST_LOOK`].
    pub(super) fn towards(&self, home: u32, texel: u32, is_meant: impl Fn(u32) -> bool) -> Option<u32> {
        let (from, to) = (self.grid.cell(texel), self.grid.cell(home));
        let side = self.grid.size as i32;
        let ways = [0, 1].map(|axis| match to[axis] - from[axis] {
            // The other way round it is shorter.
            way if self.grid.wrap[axis] == Wrap::Repeat && 2 * way.abs() > side => way - way.signum() * side,
            way => way,
        });
        let farthest = ways[0].abs().max(ways[1].abs()).min(FARTHEST_LOOK);
        (1..=farthest).find_map(|step| {
            (0..2).filter(|&axis| step <= ways[axis].abs()).find_map(|axis| {
                let mut cell = from;
                cell[axis] += step * ways[axis].signum();
                let other = self.grid.texel(cell[0], cell[1]);
                is_meant(other).then_some(other)
            })
        })
    }

    /// Memory held, bytes.
    pub(super) fn bytes(&self) -> usize {
        (self.of_triangle.capacity() + self.tiles.capacity() + self.starts.capacity()) * size_of::<u32>()
            + self.strays.capacity() * size_of::<(u32, u32)>()
            + self.landings.bytes()
    }

    /// Goes outwards from each of `count` islands, whatever lies there. `whose`: the island that each texel lies on or next to.
    fn find_strays(&mut self, finder: &Finder, whose: &[u32], count: usize) {
        let grid = self.grid;
        let is_of =
            |texel: u32, island: u32| whose[texel as usize] == island && finder.owners.of(texel).is_some();
        let mut borders = Vec::new();
        for texel in (0..grid.texels() as u32).filter(|&texel| finder.owners.of(texel).is_some()) {
            let island = whose[texel as usize];
            let mut around = Side::ALL.into_iter().filter_map(|side| grid.beside(texel, side.offset()));
            if around.any(|other| !is_of(other, island)) {
                borders.push((island, texel));
            }
        }
        borders.sort_unstable();
        let with_texels = borders.chunk_by(|one, other| one.0 == other.0).count();
        let rings_of = |texels: usize| rings_within(texels as u64, borders.len() as u64, with_texels as u64);
        // Half of that for what takes several times as much memory a texel.
        let (rings, shared_rings) = (rings_of(grid.texels()), rings_of(grid.texels() / 2));
        let mut seen = vec![NOBODY; grid.texels()];
        let (mut ring, mut next, mut sharing) = (Vec::new(), Vec::new(), Sharing::default());
        for border in borders.chunk_by(|one, other| one.0 == other.0) {
            let island = border[0].0;
            // Islands without texels have no strays either.
            self.starts.resize(island as usize + 1, self.strays.len() as u32);
            ring.clear();
            ring.extend(border.iter().map(|&(_, texel)| Reached { texel, from: texel, offset: [0; 2] }));
            for number in 0..rings {
                for reached in &ring {
                    for onward in Side::ALL.into_iter().filter_map(|side| reached.onward(grid, side)) {
                        let Reached { texel, from, offset } = onward;
                        let is_new = std::mem::replace(&mut seen[texel as usize], island) != island;
                        if !is_new || is_of(texel, island) {
                            continue;
                        }
                        let (is_stray, is_shared) = (whose[texel as usize] != island, number < shared_rings);
                        let across = if is_stray || is_shared { finder.across(from, offset) } else { None };
                        if is_stray {
                            self.strays.push((texel, finder.stray(from, offset, texel, across.as_ref())));
                        }
                        let image = across.filter(|_| is_shared);
                        if let Some(image) = image.and_then(|across| finder.image(from, offset, &across)) {
                            let area = finder.texel_area(finder.owners.triangle[from as usize]);
                            sharing.add(finder, &self.of_triangle, texel, area, &image);
                        }
                        next.push(onward);
                    }
                }
                std::mem::swap(&mut ring, &mut next);
                next.clear();
            }
            self.strays[self.starts[island as usize] as usize..].sort_unstable();
            self.landings.add(island, &mut sharing);
        }
        self.starts.resize(count + 1, self.strays.len() as u32);
        self.strays.shrink_to_fit();
        self.landings.end(count as u32);
        self.landings.shrink();
    }
}

/// How many rings around `islands` with so many texels at their borders have no more than `texels` together. A ring around
/// what has no bays has four texels more than the one within.
fn rings_within(texels: u64, borders: u64, islands: u64) -> u64 {
    let reached = |rings: u64| borders * rings + 2 * rings * (rings + 1) * islands;
    (0..=MOST_RINGS).rev().find(|&rings| reached(rings) <= texels).unwrap_or(0)
}

/// For each tile the island of all its texels, or [`SHARED`].
fn islands_of_tiles(whose: &[u32], size: u32) -> Vec<u32> {
    let across = size.div_ceil(TILE_SIZE);
    let mut tiles: Vec<Option<u32>> = vec![None; (across * across) as usize];
    for (texel, &island) in (0u32..).zip(whose) {
        let tile = texel / size / TILE_SIZE * across + texel % size / TILE_SIZE;
        // Nobody's number is that of shared tiles.
        let of_tile = tiles[tile as usize].get_or_insert(island);
        if *of_tile != island {
            *of_tile = SHARED;
        }
    }
    tiles.into_iter().map(|island| island.unwrap_or(SHARED)).collect()
}

/// The island of each triangle, and how many islands there are.
pub(super) fn number_triangles(finder: &Finder) -> (Vec<u32>, u32) {
    let triangles = finder.surface.map.len() as u32;
    let mut groups = Groups((0..triangles).collect());
    for triangle in 0..triangles {
        for other in finder.surface.beside(triangle) {
            groups.join(triangle, other);
        }
    }
    for (triangle, other) in touching(finder, &mut groups) {
        groups.join(triangle, other);
    }
    groups.numbers()
}

/// Triangles of different groups that lie side by side, in space as on the map, along a common border.
fn touching(finder: &Finder, groups: &mut Groups) -> Vec<(u32, u32)> {
    let (size, texels) = (finder.grid.size, finder.grid.texels() as u32);
    let mut touches = Vec::new();
    for texel in 0..texels {
        let Some(owner) = finder.owners.of(texel) else { continue };
        // Not over the edges of a map that repeats: there a floor touches its other end, which lies elsewhere.
        let after = (texel % size + 1 < size).then_some(texel + 1);
        let below = Some(texel + size).filter(|&below| below < texels);
        for other in [after, below].into_iter().flatten() {
            let Some(beside) = finder.owners.of(other).filter(|&beside| beside != owner) else { continue };
            let (one, another) = (groups.first(owner), groups.first(beside));
            if one != another {
                let is_near = finder.lie_side_by_side(texel, other);
                touches.push((one.min(another), one.max(another), is_near));
            }
        }
    }
    touches.sort_unstable();
    let pairs = touches.chunk_by(|one, other| (one.0, one.1) == (other.0, other.1));
    pairs
        .filter(|pairs| {
            let near = pairs.iter().filter(|(.., is_near)| *is_near).count();
            near >= LEAST_TOUCHES && near > TOUCHES_FOR_ONE_APART * (pairs.len() - near)
        })
        .map(|pairs| (pairs[0].0, pairs[0].1))
        .collect()
}

/// Triangles in groups (a union-find structure): each knows another of its group with a lower number, the first one itself.
struct Groups(Vec<u32>);

impl Groups {
    /// The first triangle of the group of one.
    fn first(&mut self, mut triangle: u32) -> u32 {
        loop {
            let before = self.0[triangle as usize];
            if before == triangle {
                return triangle;
            }
            // Half the way for the next one who asks.
            self.0[triangle as usize] = self.0[before as usize];
            triangle = before;
        }
    }

    fn join(&mut self, triangle: u32, other: u32) {
        let (one, another) = (self.first(triangle), self.first(other));
        self.0[one.max(another) as usize] = one.min(another);
    }

    /// For each triangle the number of its group, and how many groups there are.
    fn numbers(mut self) -> (Vec<u32>, u32) {
        let mut count = 0;
        for triangle in 0..self.0.len() {
            let before = self.0[triangle] as usize;
            // Those before it have their numbers already.
            self.0[triangle] = if before == triangle {
                count += 1;
                count - 1
            } else {
                self.0[before]
            };
        }
        (self.0, count)
    }
}

#[cfg(test)]
mod tests {
    use super::super::TexelGeometry;
    use super::super::points::surface_points;
    use super::super::test_meshes::{Cube, cylinder, floor, joined, sheet};
    use super::*;
    use crate::collision::MeshTriangles;
    use bevy::math::{Affine3A, Vec2, Vec3};

    const CLAMP: [Wrap; 2] = [Wrap::Clamp; 2];

    fn geometry(mesh: &MeshTriangles, size: u32, wrap: [Wrap; 2]) -> TexelGeometry {
        TexelGeometry::new(mesh, &Affine3A::IDENTITY, Vec3::Y, size, wrap)
    }

    /// The island of a texel of a map on which there are several.
    fn island(geometry: &TexelGeometry, texel: u32) -> Option<u32> {
        let all = (0, geometry.size() as i32 - 1);
        geometry.island_to_keep_to(texel, all, all)
    }

    #[test]
    fn what_falls_over_an_island_that_is_beside_in_the_image_alone_stays_on_its_own() {
        // 28 columns and 56 rows each, two columns apart; 50 m apart in space.
        let part = |column: f32, away: f32| {
            let on_map = move |point: Vec2| (Vec2::new(column, 4.0) + point * Vec2::new(28.0, 56.0)) / 64.0;
            sheet(3, move |point| floor(point) + Vec3::X * away, on_map)
        };
        let geometry = geometry(&joined([part(2.0, 0.0), part(32.0, 50.0)]), 64, CLAMP);
        let at = |column: u32, row: u32| row * 64 + column;
        let [one, other] = [at(20, 20), at(50, 20)].map(|home| (home, island(&geometry, home).unwrap()));
        assert_eq!((one.1, other.1), (0, 1));
        for ((home, island), own) in [(one, 0..18), (other, 18..36)] {
            for texel in 0..64 * 64 {
                let gets = geometry.on_island(island, texel, home);
                assert!(geometry.owner(gets).is_some_and(|owner| own.contains(&owner)), "{island} {texel}");
                let is_own = geometry.owner(texel).is_some_and(|owner| own.contains(&owner));
                assert!(!is_own || gets == texel, "{island} {texel}");
            }
        }
        // Straight back to the border, from the gutter, from the other island, and from beyond the rings.
        for column in [30, 31, 32, 40, 60] {
            assert_eq!(geometry.on_island(0, at(column, 20), one.0), at(29, 20), "{column}");
        }
        assert_eq!(geometry.on_island(1, at(5, 33), other.0), at(32, 33));
        // Tiles of the first columns are of one island, those of the next are not.
        assert_eq!(geometry.island_to_keep_to(one.0, (4, 15), (0, 63)), None);
        assert_eq!(geometry.island_to_keep_to(one.0, (4, 16), (20, 20)), Some(0));
        assert_eq!(geometry.island_to_keep_to(other.0, (31, 33), (20, 20)), Some(1));
        assert_eq!(geometry.island_to_keep_to(other.0, (48, 90), (-9, 90)), None);
        // In the gutter it is the nearer one.
        assert_eq!([at(30, 20), at(31, 20)].map(|texel| island(&geometry, texel)), [Some(0), Some(1)]);
    }

    #[test]
    fn over_the_border_of_a_cubes_face_the_way_leads_to_the_next_face_whatever_lies_in_the_image() {
        for turned in [false, true] {
            let cube = Cube { cells: 2, size: 128, island: 20.0, first: 10.0, pitch: 22.0, turned };
            let (mesh, wrap) = (cube.mesh(), [Wrap::Repeat; 2]);
            let geometry = geometry(&mesh, cube.size, wrap);
            let points = surface_points(&mesh, &Affine3A::IDENTITY, cube.size, wrap);
            for face in 0..6u32 {
                let corner = [10 + face % 3 * 22, 10 + face / 3 * 22];
                let at = |column: i32, row: i32| {
                    let inside = |first: u32, number: i32| (first as i32 + number).rem_euclid(128) as u32;
                    inside(corner[1], row) * 128 + inside(corner[0], column)
                };
                let home = at(10, 10);
                assert_eq!(island(&geometry, home), Some(face));
                let normal = Cube::FACES[face as usize][0];
                for out in 1..=16 {
                    for along in 0..20 {
                        let texels =
                            [at(-out, along), at(19 + out, along), at(along, -out), at(along, 19 + out)];
                        for texel in texels {
                            let gets = geometry.on_island(face, texel, home);
                            let place = points.iter().find(|point| point.texel == gets).unwrap();
                            // As deep below the face as it hangs over.
                            let depth = (0.5 - place.position.dot(normal)) * 20.0;
                            let next = Cube::FACES[cube.face(place.triangle)][0];
                            assert_eq!(next.dot(normal), 0.0);
                            assert!((depth - (out as f32 - 0.5)).abs() < 0.01, "{face} {texel}: {depth}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn what_hangs_together_in_space_and_in_the_image_is_one_island() {
        let all = (0, 63);
        let whole = geometry(&cylinder(12), 64, [Wrap::Repeat; 2]);
        let cut = geometry(&cylinder(12), 64, CLAMP);
        // Corners of one half lie in the middle of the other's edges.
        let half = |cells: u32, from: f32, away: f32| {
            let on_map = move |point: Vec2| Vec2::new(from + point.x * 0.5, point.y);
            sheet(cells, move |point| floor(on_map(point)) + Vec3::Y * away, on_map)
        };
        let touching = geometry(&joined([half(3, 0.0, 0.0), half(4, 0.5, 0.0)]), 64, [Wrap::Repeat; 2]);
        for geometry in [&whole, &cut, &touching] {
            for texel in [0, 31, 32, 63, 64 * 64 - 1] {
                assert_eq!(geometry.island_to_keep_to(texel, all, all), None, "{texel}");
            }
        }
        let apart = geometry(&joined([half(3, 0.0, 0.0), half(4, 0.5, 0.4)]), 64, [Wrap::Repeat; 2]);
        assert_eq!([31, 32].map(|texel| island(&apart, texel)), [Some(0), Some(1)]);
        // Faces that touch in the image alone.
        let cube = Cube { cells: 2, size: 64, island: 16.0, first: 2.0, pitch: 16.0, turned: false };
        let mesh = cube.mesh();
        let geometry = geometry(&mesh, 64, [Wrap::Repeat; 2]);
        for point in surface_points(&mesh, &Affine3A::IDENTITY, 64, [Wrap::Repeat; 2]) {
            assert_eq!(island(&geometry, point.texel), Some(cube.face(point.triangle) as u32));
        }
    }

    #[test]
    fn planks_with_gaps_between_them_are_wetted_as_they_lie() {
        // Two columns wide gaps, in space and on the map.
        let plank = |from: f32| {
            let on_map = move |point: Vec2| Vec2::new((from + point.x * 14.0) / 64.0, point.y);
            sheet(2, move |point| floor(on_map(point)), on_map)
        };
        let geometry = geometry(&joined([0.0, 16.0, 32.0, 48.0].map(plank)), 64, CLAMP);
        let at = |column: u32| 30 * 64 + column;
        assert_eq!([10, 20, 36, 50].map(|column| island(&geometry, at(column))), [0, 1, 2, 3].map(Some));
        // On this small map there are seven rings.
        assert_eq!(
            [16, 18, 20].map(|column| geometry.on_island(0, at(column), at(10))),
            [16, 18, 20].map(at)
        );
        assert_eq!(geometry.on_island(0, at(21), at(10)), at(13));
        assert_eq!(geometry.on_island(0, at(14), at(10)), at(13));
    }

    #[test]
    fn thousands_of_islands_get_no_more_rings_than_there_is_memory_for() {
        assert_eq!(rings_within(512 * 512, 10_000, 40), MOST_RINGS);
        assert_eq!(rings_within(1024 * 1024, 360_000, 10_000), 2);
        assert_eq!(rings_within(64, 64, 64), 0);
        // A texel each.
        let confetti = joined((0..900).map(|number| {
            let corner = Vec2::new((number % 30) as f32, (number / 30) as f32);
            sheet(1, move |point| floor(point + corner * 5.0), move |point| (corner + point) / 32.0)
        }));
        let geometry = geometry(&confetti, 32, CLAMP);
        for number in (0..900).step_by(37) {
            let texel = number / 30 * 32 + number % 30;
            assert_eq!(island(&geometry, texel), Some(number));
            assert!((0..32 * 32).all(|other| geometry.on_island(number, other, texel) == texel));
        }
    }
}
