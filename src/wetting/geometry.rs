//! What water needs to know about each texel of a map to run over the real surface.

use std::sync::Arc;

use bevy::math::{Affine3A, Vec2, Vec3};

use super::Units;
use super::gutters::{Gutters, Tip};
use super::islands::Islands;
use super::landings::Landing;
use super::links::Links;
use super::ownership::NOBODY;
use super::slopes::Slopes;
use crate::collision::MeshTriangles;

pub use super::grid::Side;
pub use super::links::Link;

/// Marks a number among triangles. There are fewer triangles than this.
pub(super) const STAND_IN: u32 = 1 << 31;

/// Where the texels of a map lie in the world, and who lies beside whom on the mesh.
///
/// Texels are numbered row by row from v = 0. One that lies on a triangle is *owned* by it: by the first that
/// covers its middle or, if none does, by a triangle too small to cover any middle.
///
/// The mesh is that of one moment: move, turn or scale it, and this must be made anew (which takes a second or
/// two for the largest map); [`Self::posed`] takes it to another pose of the same triangles for less. It does
/// not know of gaps too narrow for a texel, nor of edges that touch without sharing their corners: the mesh ends
/// there.
///
/// Methods that take a texel panic if the map has no such texel.
pub struct TexelGeometry {
    pub(super) layout: Arc<TexelLayout>,
    pub(super) slopes: Slopes,
}

/// What does not change when the mesh takes another pose.
pub(crate) struct TexelLayout {
    pub(super) size: u32,
    pub(super) area_mm2: Vec<f32>,
    pub(super) mean_mm2: f32,
    /// By texel: its triangle, or [`STAND_IN`] and where in `stand_ins` to look, or [`NOBODY`].
    pub(super) owner: Vec<u32>,
    /// The texel that stands in for one that nobody owns, and the island next to which that lies.
    pub(super) stand_ins: Vec<[u32; 2]>,
    pub(super) islands: Islands,
    pub(super) links: Links,
    pub(super) gutters: Gutters,
    /// A tile, and another with texels that show what the first one holds; ascending.
    pub(super) gutter_tiles: Vec<(u32, u32)>,
    /// Length of a mean texel, metres, for those without a triangle.
    pub(super) mean_length: f32,
}

impl TexelGeometry {
    /// What it has in common with the same surface in other poses.
    pub(crate) fn layout(&self) -> &Arc<TexelLayout> {
        &self.layout
    }

    /// Texels along each side of the map.
    pub fn size(&self) -> u32 {
        self.layout.size
    }

    /// World area that each texel stands for, mm²; the values of [`TexelAreas`](crate::overlay::TexelAreas). 0 where nothing lies.
    pub fn area_mm2(&self) -> &[f32] {
        &self.layout.area_mm2
    }

    /// Mean area of the texels that stand for anything, mm².
    pub fn mean_mm2(&self) -> f32 {
        self.layout.mean_mm2
    }

    /// How high each texel's middle lies above the lowest of the surface, metres along `up`. 0 where nothing
    /// lies.
    pub fn height(&self) -> &[f32] {
        self.slopes.height()
    }

    /// Cosine of the angle between up and the front of a texel's triangle, -1..=1 in steps of 1/127: 1 on a
    /// floor, 0 on a wall, -1 on a ceiling. 0 where nothing lies.
    #[inline]
    pub fn facing_up(&self, texel: u32) -> f32 {
        self.slopes.facing_up(texel)
    }

    /// The triangle that a texel lies on, an index into the lists of [`MeshTriangles`].
    #[inline]
    pub fn owner(&self, texel: u32) -> Option<u32> {
        Some(self.layout.owner[texel as usize]).filter(|&owner| owner < STAND_IN)
    }

    /// Whether the mesh lies at a texel. Not in its gutter.
    #[inline]
    pub fn lies(&self, texel: u32) -> bool {
        let TexelLayout { owner, area_mm2, .. } = &*self.layout;
        let texel = texel as usize;
        owner.get(texel).is_some_and(|&owner| owner < STAND_IN)
            || area_mm2.get(texel).is_some_and(|&area| area > 0.0)
    }

    /// What lies on a side of a texel on the mesh, over seams between islands, too. [`Link::Edge`] where the
    /// mesh ends, and on all sides of a texel on which nothing lies.
    ///
    /// Links mostly lead back on the opposite side. Over a seam, where islands may be turned and scaled, they
    /// may lead back on another side or to a texel beside.
    #[inline]
    pub fn link(&self, texel: u32, side: Side) -> Link {
        self.layout.links.get(texel, side)
    }

    /// Metres on the surface from a texel's middle to that of its neighbour in the image, by the density of
    /// the texel's own triangle; above 0.
    #[inline]
    pub fn distance(&self, texel: u32, side: Side) -> f32 {
        let lengths = self.slopes.lengths(self.layout.owner[texel as usize]);
        lengths.map_or(self.layout.mean_length, |lengths| lengths[side.axis()])
    }

    /// The texel that stands for the surface at this one: itself if a triangle owns it; else, up to 8 texels
    /// off an island (columns plus rows), the one that a way over the mesh straight across the island's
    /// border leads to. Where the mesh ends at that border, the texel of the border. None further out, but for texels
    /// that bilinear filtering of a triangle reads: those have the nearest one on the mesh or, if none is near, one of the
    /// island's.
    pub fn stand_in(&self, texel: u32) -> Option<u32> {
        match self.layout.owner[texel as usize] {
            NOBODY => None,
            number if number >= STAND_IN => Some(self.layout.stand_ins[(number - STAND_IN) as usize][0]),
            _ => Some(texel),
        }
    }

    /// The island of the map that a stamp must be kept to whose middle lies over a texel: None if all of these columns and
    /// rows, from first to last, lie on that island, or if it is not known.
    pub(crate) fn island_to_keep_to(&self, texel: u32, columns: (i32, i32), rows: (i32, i32)) -> Option<u32> {
        let layout = &self.layout;
        if layout.islands.is_one(columns, rows) {
            return None;
        }
        match layout.owner[texel as usize] {
            NOBODY => None,
            number if number >= STAND_IN => Some(layout.stand_ins[(number - STAND_IN) as usize][1]),
            triangle => Some(layout.islands.of(triangle)),
        }
    }

    /// Who gets what falls over a texel from a stamp that is kept to an island: the texel itself if it is of that island. Else
    /// the one to which a way leads straight over the island's border and on over the mesh; where the mesh ends, that of the
    /// border. Far out it is the island's nearest in the row or the column, towards `home`, or `home` if there is none.
    pub(crate) fn on_island(&self, island: u32, texel: u32, home: u32) -> u32 {
        let layout = &self.layout;
        let islands = &layout.islands;
        match layout.owner[texel as usize] {
            NOBODY => {}
            number if number >= STAND_IN => {
                let [other, next_to] = layout.stand_ins[(number - STAND_IN) as usize];
                if next_to == island {
                    return other;
                }
            }
            triangle if islands.of(triangle) == island => return texel,
            _ => {}
        }
        let is_of_island = |other: u32| self.owner(other).is_some_and(|owner| islands.of(owner) == island);
        islands.stray(island, texel).or_else(|| islands.towards(home, texel, is_of_island)).unwrap_or(home)
    }

    /// Who gets what falls over a texel from a stamp that is kept to an island, or lies on one alone (`None`): as
    /// [`Self::on_island`] or [`Self::stand_in`] has it, but over seams shared out among the texels under its image there. None where
    /// nothing stands for the surface.
    #[inline]
    pub(crate) fn landing(&self, island: Option<u32>, over: u32, home: u32) -> Option<Landing<'_>> {
        let layout = &*self.layout;
        let number = layout.owner[over as usize];
        if number < STAND_IN && island.is_none_or(|island| layout.islands.of(number) == island) {
            return Some(Landing::One(over));
        }
        self.landing_beside(island, over, home)
    }

    /// The same for a texel that is not of the island.
    fn landing_beside(&self, island: Option<u32>, over: u32, home: u32) -> Option<Landing<'_>> {
        let layout = &*self.layout;
        let next_to = match layout.owner[over as usize] {
            number if (STAND_IN..NOBODY).contains(&number) => {
                Some(layout.stand_ins[(number - STAND_IN) as usize][1])
            }
            _ => None,
        };
        let shared = island.or(next_to).and_then(|island| layout.islands.shared(island, over));
        shared.or_else(|| match island {
            Some(island) => Some(Landing::One(self.on_island(island, over, home))),
            None => self.stand_in(over).map(Landing::One),
        })
    }

    /// For a texel that nobody owns but that lies within 2 columns and 2 rows of one that somebody does: the
    /// nearest such texel in the image. For one that bilinear filtering reads from a triangle whose island has none so near: the nearest
    /// on the mesh or, if none is near, one of the island's. None for all others.
    pub fn gutter_source(&self, texel: u32) -> Option<u32> {
        self.layout.gutters.source(texel)
    }

    /// Texels beside islands so thin that they own none near them.
    pub(crate) fn tips(&self) -> &[Tip] {
        self.layout.gutters.tips()
    }

    /// Adds the tiles that show anything of these, beyond their own texels.
    pub(super) fn add_gutter_tiles(&self, tiles: &mut Vec<u32>) {
        for index in 0..tiles.len() {
            let own = tiles[index];
            let from = self.layout.gutter_tiles.partition_point(|&(tile, _)| tile < own);
            let showing = self.layout.gutter_tiles[from..].iter().take_while(|&&(tile, _)| tile == own);
            tiles.extend(showing.map(|&(_, other)| other));
        }
    }

    /// Where a texel's middle lies in the world, and the normal of its triangle; None if nothing lies there.
    /// `triangles` and `world_from_mesh` as in [`Self::new`]; if the mesh has moved since, where it is now.
    pub fn point(
        &self,
        texel: u32,
        triangles: &MeshTriangles,
        world_from_mesh: &Affine3A,
    ) -> Option<(Vec3, Vec3)> {
        let owner = self.owner(texel)? as usize;
        let corners = triangles.positions.get(owner)?.map(|corner| world_from_mesh.transform_point3(corner));
        let mirrored = world_from_mesh.matrix3.determinant() < 0.0;
        Some(self.point_on(texel, triangles.uvs.get(owner)?, corners, mirrored))
    }

    /// Where a texel's middle lies on its triangle, and the normal of that, by the triangle's corners as they are now.
    /// `mirrored`: they have come there by a mirror, which turns the winding round.
    pub(crate) fn point_on(
        &self,
        texel: u32,
        uvs: &[Vec2; 3],
        [a, b, c]: [Vec3; 3],
        mirrored: bool,
    ) -> (Vec3, Vec3) {
        let [to_b, to_c] = self.weights(texel, uvs);
        let normal = (b - a).cross(c - a).normalize_or(Vec3::Y);
        (a + (b - a) * to_b + (c - a) * to_c, if mirrored { -normal } else { normal })
    }

    /// Weights of the second and third corner of a texel's triangle, with these uvs, at the texel's middle.
    pub(crate) fn weights(&self, texel: u32, &[uv_a, uv_b, uv_c]: &[Vec2; 3]) -> [f32; 2] {
        let size = self.layout.size;
        let middle = Vec2::new((texel % size) as f32 + 0.5, (texel / size) as f32 + 0.5);
        // The copy of the map that the triangle lies in: its points are nearer to the middle of its box than to any other's.
        let center = (uv_a.min(uv_b).min(uv_c) + uv_a.max(uv_b).max(uv_c)) / 2.0;
        let uv = middle / size as f32;
        let uv = uv + (center - uv).round();
        let (ab, ac, at) = (uv_b - uv_a, uv_c - uv_a, uv - uv_a);
        let area = ab.perp_dot(ac);
        let inside = |part: f32| if part.is_finite() { part.clamp(0.0, 1.0) } else { 1.0 / 3.0 };
        let (to_b, to_c) = (inside(at.perp_dot(ac) / area), inside(ab.perp_dot(at) / area));
        // A triangle that is too small to cover the middle is not left for it.
        let sum = (to_b + to_c).max(1.0);
        [to_b / sum, to_c / sum]
    }

    /// Depth of a unit on a texel, mm. Where nothing lies, a texel counts as one of mean size.
    pub fn unit_mm(&self, units: Units, texel: u32) -> f64 {
        let area = self.layout.area_mm2[texel as usize];
        units.mm_on(if area > 0.0 { area } else { self.layout.mean_mm2 }.max(1e-6))
    }

    /// Memory held, bytes.
    pub fn bytes(&self) -> usize {
        let layout = &self.layout;
        layout.area_mm2.capacity() * size_of::<f32>()
            + layout.owner.capacity() * size_of::<u32>()
            + layout.stand_ins.capacity() * size_of::<[u32; 2]>()
            + layout.islands.bytes()
            + layout.links.bytes()
            + layout.gutters.bytes()
            + self.slopes.bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::super::points::surface_points;
    use super::super::test_meshes::{Cube, cylinder, floor, joined, sheet};
    use super::*;
    use crate::overlay::{TexelAreas, Wrap};

    const REPEAT: [Wrap; 2] = [Wrap::Repeat; 2];
    const SLOPE: f32 = std::f32::consts::FRAC_PI_6;

    /// 2 m x 2 m, sloped by 30 degrees: v goes down.
    fn slope(cells: u32) -> MeshTriangles {
        sheet(cells, |point| floor(point) * 2.0 - Vec3::Y * 2.0 * SLOPE.tan() * point.y, |point| point)
    }

    #[test]
    fn heights_and_distances_are_those_of_the_slope() {
        let far = Affine3A::from_translation(Vec3::new(1e4, -2e3, 5.0));
        for (cells, place) in [(1, Affine3A::IDENTITY), (5, far)] {
            let geometry = TexelGeometry::new(&slope(cells), &place, Vec3::Y * 3.0, 32, REPEAT);
            assert_eq!(geometry.size(), 32);
            let step = 2.0 / 32.0;
            for texel in 0..32 * 32 {
                let height = (31 - texel / 32) as f32 * step * SLOPE.tan();
                assert!((geometry.height()[texel as usize] - height).abs() < 1e-5, "{texel}");
                assert!((geometry.facing_up(texel) + SLOPE.cos()).abs() < 0.005);
                for (side, expected) in
                    Side::ALL.into_iter().zip([1.0, 1.0, 1.0 / SLOPE.cos(), 1.0 / SLOPE.cos()])
                {
                    let distance = geometry.distance(texel, side);
                    assert!((distance - expected * step).abs() < 1e-5, "{texel} {side:?} {distance}");
                }
            }
        }
    }

    #[test]
    fn another_pose_has_heights_slopes_and_distances_of_its_own() {
        let rest = slope(5);
        let geometry = TexelGeometry::new(&rest, &Affine3A::IDENTITY, Vec3::Y, 32, REPEAT);
        let turned = Affine3A::from_translation(Vec3::Y * 30.0) * Affine3A::from_rotation_x(0.9);
        let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        for (pose, mirrored) in [(turned, false), (turned * mirror, true)] {
            let to_world = |corners: &[Vec3; 3]| corners.map(|corner| pose.transform_point3(corner));
            let corners: Vec<_> = rest.positions.iter().map(to_world).collect();
            let posed = geometry.posed(&rest.uvs, &corners, mirrored, Vec3::Y);
            let anew = TexelGeometry::new(&rest, &pose, Vec3::Y, 32, REPEAT);
            assert!(Arc::ptr_eq(posed.layout(), geometry.layout()));
            for texel in 0..32 * 32 {
                let height = |geometry: &TexelGeometry| geometry.height()[texel as usize];
                assert!((height(&posed) - height(&anew)).abs() < 1e-4, "{texel}");
                assert!((posed.facing_up(texel) - anew.facing_up(texel)).abs() < 0.01, "{texel}");
                for side in Side::ALL {
                    let (one, other) = (posed.distance(texel, side), anew.distance(texel, side));
                    assert!((one - other).abs() < 1e-5, "{texel} {side:?}: {one} {other}");
                }
            }
        }
        // Flattened to a line, and no number at all.
        for corner in [Vec3::X, Vec3::NAN, Vec3::splat(f32::INFINITY)] {
            let posed = geometry.posed(&rest.uvs, &vec![[corner; 3]; rest.positions.len()], false, Vec3::Y);
            for texel in 0..32 * 32 {
                assert_eq!((posed.height()[texel as usize], posed.facing_up(texel)), (0.0, 0.0));
                let distances = Side::ALL.map(|side| posed.distance(texel, side));
                assert!(distances.iter().all(|&distance| distance > 0.0 && distance.is_finite()));
            }
        }
    }

    #[test]
    fn scale_and_mirrors_count() {
        let mirrored = Affine3A::from_scale(Vec3::new(-3.0, 1.0, 0.5));
        let plain = TexelGeometry::new(&slope(4), &Affine3A::IDENTITY, Vec3::Y, 32, REPEAT);
        let scaled = TexelGeometry::new(&slope(4), &mirrored, Vec3::Y, 32, REPEAT);
        for texel in 0..32 * 32 {
            let height = |geometry: &TexelGeometry| geometry.height()[texel as usize];
            assert!((height(&plain) - height(&scaled)).abs() < 1e-5);
            assert!(scaled.facing_up(texel) < -0.5, "a mirror does not turn the front round");
            let along_u = scaled.distance(texel, Side::PlusU) / plain.distance(texel, Side::PlusU);
            assert!((along_u - 3.0).abs() < 1e-3);
            assert!(Side::ALL.into_iter().all(|side| plain.link(texel, side) == scaled.link(texel, side)));
        }
        let sideways = TexelGeometry::new(&slope(4), &Affine3A::IDENTITY, Vec3::X, 32, REPEAT);
        assert!((sideways.height()[31] - 31.0 * 2.0 / 32.0).abs() < 1e-5);
    }

    #[test]
    fn areas_are_those_of_the_texels_and_so_are_the_owners() {
        let cube = Cube { cells: 3, size: 64, island: 15.3, first: 2.2, pitch: 20.0, turned: true };
        let small = sheet(90, floor, |point| point * 0.9);
        let tiled = sheet(5, floor, |point| point * 3.0 - Vec2::splat(1.2));
        for mesh in [cube.mesh(), cylinder(12), small, tiled] {
            for wrap in [REPEAT, [Wrap::Clamp; 2]] {
                let geometry = TexelGeometry::new(&mesh, &Affine3A::IDENTITY, Vec3::Y, 64, wrap);
                let areas = TexelAreas::new(&mesh, &Affine3A::IDENTITY, 64, wrap);
                assert_eq!(geometry.area_mm2(), areas.mm2);
                assert_eq!(geometry.mean_mm2(), areas.mean_mm2);
                let points = surface_points(&mesh, &Affine3A::IDENTITY, 64, wrap);
                let mut points = points.iter().peekable();
                for texel in 0..64 * 64 {
                    let owner = geometry.owner(texel);
                    assert_eq!(owner.is_some(), geometry.area_mm2()[texel as usize] > 0.0, "{texel}");
                    let point = points.next_if(|point| point.texel == texel);
                    assert_eq!(point.map(|point| point.triangle), owner);
                }
            }
        }
    }

    #[test]
    fn points_lie_under_their_texels_on_an_undivided_square_too() {
        for (cells, tile) in [(1, Vec2::ZERO), (1, Vec2::new(2.0, -1.0)), (3, Vec2::ZERO)] {
            let mesh = sheet(cells, floor, |point| point + tile);
            let geometry = TexelGeometry::new(&mesh, &Affine3A::IDENTITY, Vec3::Y, 32, REPEAT);
            for texel in 0..32 * 32 {
                let (point, _) = geometry.point(texel, &mesh, &Affine3A::IDENTITY).unwrap();
                let expected = Vec3::new((texel % 32) as f32 + 0.5, 0.0, (texel / 32) as f32 + 0.5) / 32.0;
                assert!((point - expected).length() < 1e-4, "{texel}: {point} {expected}");
            }
        }
    }

    #[test]
    fn nothing_and_nonsense_are_measured() {
        let nothing = TexelGeometry::new(&MeshTriangles::default(), &Affine3A::IDENTITY, Vec3::Y, 16, REPEAT);
        assert_eq!((nothing.owner(5), nothing.stand_in(5), nothing.facing_up(5)), (None, None, 0.0));
        assert_eq!(nothing.link(5, Side::PlusU), Link::Edge);
        let point = sheet(2, floor, |_| Vec2::splat(0.4));
        let huge = sheet(2, floor, |point| point * -1e9);
        let mesh = joined([point, huge, cylinder(5)]);
        let flat = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
        for place in [Affine3A::IDENTITY, flat, Affine3A::from_scale(Vec3::ZERO)] {
            let geometry = TexelGeometry::new(&mesh, &place, Vec3::ZERO, 32, [Wrap::Repeat, Wrap::Clamp]);
            assert!(geometry.bytes() >= 32 * 32 * 14);
            for texel in 0..32 * 32 {
                let distances = Side::ALL.map(|side| geometry.distance(texel, side));
                assert!(distances.iter().all(|&distance| distance > 0.0 && distance.is_finite()));
                assert!(geometry.height()[texel as usize] >= 0.0);
            }
        }
    }
}
