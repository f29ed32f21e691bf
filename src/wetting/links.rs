//! Which texels lie side by side on the mesh, for every texel of a map.
//!
//! Nearly all do so in the image, too, and share a triangle: nothing needs to be looked for, and two bits say
//! so. At the edges between triangles a walk over the mesh finds who lies there ([`Finder`]), mostly the
//! texel beside in the image again. What is left, along the seams and the edges of the map, is kept in a
//! sorted list.

use super::finder::Finder;
use super::grid::Side;
use super::ownership::NOBODY;

/// What lies on a side of a texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Link {
    /// This texel; never the same one.
    Texel(u32),
    /// The mesh ends there.
    Edge,
}

/// The texel beside it in the image lies there, and the edge of the map does not lie between.
const BESIDE: u8 = 0;
/// The list says who lies there.
const LISTED: u8 = 1;
/// The mesh ends there.
const EDGE: u8 = 2;

/// The neighbours of each texel.
pub(super) struct Links {
    size: u32,
    /// Two bits for each side of each texel: [`BESIDE`], [`LISTED`] or [`EDGE`].
    codes: Vec<u8>,
    /// Four times the texel plus the side, and who lies there; ascending.
    listed: Vec<(u32, u32)>,
}

impl Links {
    /// Finds all neighbours.
    pub(super) fn new(finder: &Finder) -> Self {
        let grid = finder.grid;
        let mut links = Self { size: grid.size, codes: vec![0; grid.texels()], listed: Vec::new() };
        for texel in 0..grid.texels() as u32 {
            let owner = finder.owners.triangle[texel as usize];
            let [column, row] = grid.cell(texel);
            let mut codes = 0;
            for side in Side::ALL {
                let [columns, rows] = side.offset();
                let map = 0..grid.size as i32;
                let inside = map.contains(&(column + columns)) && map.contains(&(row + rows));
                let beside = inside.then(|| grid.texel(column + columns, row + rows));
                let code = match beside {
                    _ if owner == NOBODY => EDGE,
                    // Two middles in one triangle: so is the way between them.
                    Some(other) if finder.owners.triangle[other as usize] == owner => BESIDE,
                    _ => match finder.link(texel, side) {
                        Link::Texel(other) if beside == Some(other) => BESIDE,
                        Link::Texel(other) => {
                            links.listed.push((texel * 4 + side as u32, other));
                            LISTED
                        }
                        Link::Edge => EDGE,
                    },
                };
                codes |= code << (2 * side as u8);
            }
            links.codes[texel as usize] = codes;
        }
        links.listed.shrink_to_fit();
        links
    }

    /// What lies on a side of a texel.
    #[inline]
    pub(super) fn get(&self, texel: u32, side: Side) -> Link {
        match self.codes[texel as usize] >> (2 * side as u8) & 3 {
            BESIDE => Link::Texel(match side {
                Side::MinusU => texel - 1,
                Side::PlusU => texel + 1,
                Side::MinusV => texel - self.size,
                Side::PlusV => texel + self.size,
            }),
            LISTED => self.look_up(texel, side),
            _ => Link::Edge,
        }
    }

    fn look_up(&self, texel: u32, side: Side) -> Link {
        let key = texel * 4 + side as u32;
        match self.listed.binary_search_by_key(&key, |&(key, _)| key) {
            Ok(index) => Link::Texel(self.listed[index].1),
            Err(_) => Link::Edge,
        }
    }

    /// Memory held, bytes.
    pub(super) fn bytes(&self) -> usize {
        self.codes.capacity() + self.listed.capacity() * size_of::<(u32, u32)>()
    }
}

#[cfg(test)]
mod tests {
    use super::super::geometry::TexelGeometry;
    use super::super::points::surface_points;
    use super::super::test_meshes::{Cube, cylinder, floor, joined, sheet};
    use super::*;
    use crate::collision::MeshTriangles;
    use crate::overlay::Wrap;
    use bevy::math::{Affine3A, Vec2, Vec3};
    use std::f32::consts::{PI, TAU};

    const REPEAT: [Wrap; 2] = [Wrap::Repeat; 2];

    fn geometry(mesh: &MeshTriangles, size: u32, wrap: [Wrap; 2]) -> TexelGeometry {
        TexelGeometry::new(mesh, &Affine3A::IDENTITY, Vec3::Y, size, wrap)
    }

    /// Every owned texel and side, with what lies there.
    fn all_links(geometry: &TexelGeometry) -> Vec<(u32, Side, Link)> {
        let owned = (0..geometry.size() * geometry.size()).filter(|&texel| geometry.owner(texel).is_some());
        owned.flat_map(|texel| Side::ALL.map(|side| (texel, side, geometry.link(texel, side)))).collect()
    }

    fn beside(texel: u32, side: Side, size: u32) -> u32 {
        let [columns, rows] = side.offset();
        let wrapped = |number: u32, step: i32| number.wrapping_add_signed(step) % size;
        wrapped(texel / size, rows) * size + wrapped(texel % size, columns)
    }

    #[test]
    fn on_a_sheet_it_is_the_texel_beside_or_the_edge() {
        for cells in [1, 7, 40] {
            for wrap in [REPEAT, [Wrap::Clamp; 2]] {
                let sheet = geometry(&sheet(cells, floor, |point| point), 32, wrap);
                for (texel, side, link) in all_links(&sheet) {
                    let [columns, rows] = side.offset();
                    let inside = (0..32).contains(&((texel % 32) as i32 + columns))
                        && (0..32).contains(&((texel / 32) as i32 + rows));
                    let expected = if inside { Link::Texel(beside(texel, side, 32)) } else { Link::Edge };
                    assert_eq!(link, expected, "{cells} {texel} {side:?}");
                }
            }
        }
    }

    #[test]
    fn on_a_cylinder_the_last_column_leads_to_the_first() {
        for cells in [6, 16, 50] {
            let cylinder = geometry(&cylinder(cells), 32, REPEAT);
            for (texel, side, link) in all_links(&cylinder) {
                let rim = matches!((texel / 32, side), (0, Side::MinusV) | (31, Side::PlusV));
                let expected = if rim { Link::Edge } else { Link::Texel(beside(texel, side, 32)) };
                assert_eq!(link, expected, "{cells} {texel} {side:?}");
            }
        }
    }

    #[test]
    fn a_sphere_ends_nowhere() {
        // The triangles at the poles have two corners in one place, but for rounding at one of them.
        let on_ball = |point: Vec2| {
            let (longitude, latitude) = (point.x * TAU, point.y * PI);
            let radius = 1.0 + 0.1 * (longitude * 3.0).sin() * latitude.sin();
            let along = Vec3::new(longitude.cos(), 0.0, -longitude.sin());
            (along * latitude.sin() + Vec3::Y * latitude.cos()) * radius
        };
        for cells in [4, 12, 30] {
            for (texel, side, link) in all_links(&geometry(&sheet(cells, on_ball, |point| point), 64, REPEAT))
            {
                assert_ne!(link, Link::Edge, "{cells} {texel} {side:?}");
            }
        }
    }

    #[test]
    fn tiled_and_stretched_maps_lead_to_the_texel_beside() {
        let stretch = |point: Vec2| Vec2::new(point.x * point.x, point.y) * 3.0;
        for mesh in [sheet(1, floor, |point| point * 3.0), sheet(1, floor, stretch)] {
            for (texel, side, link) in all_links(&geometry(&mesh, 16, REPEAT)) {
                assert_eq!(link, Link::Texel(beside(texel, side, 16)), "{texel} {side:?}");
            }
        }
        // From one triangle to the next the density changes by half, and the mesh is folded.
        let folded = sheet(
            5,
            |point| Vec3::new(point.x, (point.x * 5.0) % 2.0, point.y),
            |point| Vec2::new(point.x * point.x, point.y),
        );
        for (texel, side, link) in all_links(&geometry(&folded, 64, [Wrap::Clamp; 2])) {
            if let Link::Texel(other) = link {
                assert_eq!(other, beside(texel, side, 64), "{texel} {side:?}");
            } else {
                let (column, row) = (texel % 64, texel / 64);
                assert!([0, 63].contains(&column) || [0, 63].contains(&row), "{texel} {side:?}");
            }
        }
    }

    /// Longest link over an edge, in texel lengths, and the part of those links that lead back.
    fn check_cube(cube: &Cube, wrap: [Wrap; 2]) -> (f32, f32) {
        let mesh = cube.mesh();
        let geometry = geometry(&mesh, cube.size, wrap);
        let texels = (cube.size * cube.size) as usize;
        let mut places = vec![Vec3::ZERO; texels];
        for point in surface_points(&mesh, &Affine3A::IDENTITY, cube.size, wrap) {
            places[point.texel as usize] = point.position;
        }
        let face = |texel: u32| geometry.owner(texel).map(|owner| cube.face(owner));
        let (mut over, mut back, mut longest) = (0, 0, 0.0f32);
        for (texel, side, link) in all_links(&geometry) {
            let Link::Texel(other) = link else { panic!("{texel} {side:?}: the cube has no edge") };
            let length = places[texel as usize].distance(places[other as usize]) * cube.island;
            if face(other) == face(texel) {
                assert_eq!(other, beside(texel, side, cube.size), "{texel} {side:?}");
                continue;
            }
            // The faces that meet at an edge are not opposite.
            let [from, to] = [texel, other].map(|texel| Cube::FACES[face(texel).unwrap()][0]);
            assert_eq!(from.dot(to), 0.0, "{texel} {side:?} {other}");
            longest = longest.max(length);
            over += 1;
            let known = Side::ALL.map(|side| Link::Texel(beside(texel, side, cube.size)));
            let leads_back = |link: Link| link == Link::Texel(texel) || known.contains(&link);
            back += u32::from(Side::ALL.iter().any(|&side| leads_back(geometry.link(other, side))));
        }
        // Each border texel of each face leads over at least one edge.
        assert!(over as f32 > 6.0 * 4.0 * (cube.island - 2.0), "{over}");
        (longest, back as f32 / over as f32)
    }

    #[test]
    fn on_a_cube_borders_lead_to_the_next_face_and_back() {
        for (cells, turned) in [(1, false), (1, true), (3, true), (40, false)] {
            let cube = Cube { cells, size: 64, island: 16.0, first: 2.0, pitch: 20.0, turned };
            for wrap in [REPEAT, [Wrap::Clamp; 2]] {
                let (longest, back) = check_cube(&cube, wrap);
                assert!(longest < 1.01 && back == 1.0, "{cells} {turned}: {longest} {back}");
            }
        }
    }

    #[test]
    fn borders_between_texels_lead_over_too() {
        for first in [2.1, 2.3, 2.49, 2.5, 2.7, 2.9] {
            for (island, turned) in [(16.0, false), (16.0, true), (15.37, false), (15.37, true)] {
                let cube = Cube { cells: 2, size: 64, island, first, pitch: 20.0, turned };
                let (longest, back) = check_cube(&cube, REPEAT);
                // Middles may lie a whole texel inside on both sides.
                assert!(longest < 2.1 && back > 0.9, "{first} {island} {turned}: {longest} {back}");
            }
        }
    }

    #[test]
    fn islands_that_touch_in_the_image_alone_are_not_taken_for_neighbours() {
        let cube = Cube { cells: 1, size: 64, island: 16.3, first: 2.0, pitch: 16.3, turned: true };
        let (longest, back) = check_cube(&cube, REPEAT);
        assert!(longest < 2.1 && back > 0.9, "{longest} {back}");
    }

    #[test]
    fn islands_on_top_of_each_other_share_their_texels() {
        // Mirrored at x = 0, as the halves of a body are.
        let half = |mirror: f32| {
            sheet(
                4,
                move |point| Vec3::new(point.x * mirror, 0.0, point.y),
                |point| point * 0.5 + Vec2::splat(0.25),
            )
        };
        let mesh = joined([half(1.0), half(-1.0)]);
        let geometry = geometry(&mesh, 32, REPEAT);
        for (texel, side, link) in all_links(&geometry) {
            let (column, row) = (texel % 32, texel / 32);
            let border = match side {
                Side::MinusU => false,
                Side::PlusU => column == 23,
                Side::MinusV => row == 8,
                Side::PlusV => row == 23,
            };
            match link {
                Link::Edge => assert!(border, "{texel} {side:?}"),
                // Over the mirror the way leads into the image of the same texels.
                Link::Texel(other) if column == 8 && side == Side::MinusU => assert_eq!(other, texel + 1),
                Link::Texel(other) => assert_eq!(other, beside(texel, side, 32), "{texel} {side:?}"),
            }
        }
    }

    #[test]
    fn no_mesh_leads_to_itself_or_to_nobody() {
        let nonsense = [
            sheet(3, floor, |_| Vec2::splat(0.3)),
            sheet(3, floor, |point| Vec2::splat(point.x)),
            sheet(3, floor, |point| point * 1e9),
            sheet(3, floor, |point| Vec2::new(point.x * 2.5, point.y * 1e-3)),
            // Hundreds of triangles in each texel.
            sheet(200, floor, |point| point * 0.3),
            sheet(200, floor, |point| Vec2::new((point.x * 977.0).fract(), (point.y * 613.0).fract())),
        ];
        let all = joined(nonsense.clone());
        let mut count = 0;
        for (number, mesh) in nonsense.iter().chain([&all]).enumerate() {
            for wrap in [REPEAT, [Wrap::Clamp; 2]] {
                let geometry = geometry(mesh, 16, wrap);
                for (texel, side, link) in all_links(&geometry) {
                    if let Link::Texel(other) = link {
                        assert_ne!(other, texel, "{number} {side:?}");
                        assert!(geometry.owner(other).is_some(), "{number} {texel} {side:?}");
                        count += 1;
                    }
                }
            }
        }
        assert!(count > 100, "{count}");
    }
}
