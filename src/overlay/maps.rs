//! How much surface a texel stands for, and what falls on it.

use bevy::math::Affine3A;
use bevy::prelude::*;
use bytemuck::{Pod, Zeroable};

use super::Wrap;
use crate::collision::MeshTriangles;

/// A drop that fell not long ago, for the ring around it. A row of the GPU's ring buffer; each tile of the map remembers
/// its last [`Self::PER_TILE`], the newest first.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct RainRing {
    /// Where it fell, in 1/256 texel of the map.
    pub center: [i32; 2],
    /// When; 0 is never.
    pub tick: u32,
    /// Water, nanolitres.
    pub water_nl: u32,
}

impl RainRing {
    /// Drops that a tile remembers.
    pub const PER_TILE: u32 = 4;
}

/// How much of the world a texel of a surface stands for.
#[derive(Component, Debug, Clone, Copy, PartialEq)]
pub struct TexelArea {
    /// Mean, mm².
    pub mean_mm2: f32,
}

impl TexelArea {
    /// Of the triangles' area in the world and on the map; what lies on it twice counts twice, up to the whole map.
    pub fn new(triangles: &MeshTriangles, world_from_mesh: &Affine3A, size: u32) -> Self {
        let (mut mm2, mut maps) = (0.0, 0.0);
        for (corners, uvs) in triangles.positions.iter().zip(&triangles.uvs) {
            let [a, b, c] = corners.map(|corner| world_from_mesh.transform_point3(corner));
            mm2 += f64::from((b - a).cross(c - a).length()) * 0.5e6;
            maps += f64::from(Footprint::new(*uvs).area());
        }
        let texels = (maps.min(1.0) * f64::from(size * size)).max(1.0);
        Self { mean_mm2: (mm2 / texels) as f32 }
    }
}

/// World area that each texel of a surface stands for; 0 where no triangle lies.
#[derive(Debug, Clone, PartialEq)]
pub struct TexelAreas {
    /// mm², row by row.
    pub mm2: Vec<f32>,
    /// Sum, mm².
    pub total_mm2: f64,
    /// Mean over the texels that stand for anything, mm².
    pub mean_mm2: f32,
}

impl TexelAreas {
    /// Rasterizes the triangles over their uvs; a texel belongs to the triangle that its middle lies in, once per
    /// tile of tiled uvs, and takes its density. Uvs outside the map go where [`Wrap`] says. A triangle that covers no
    /// middle gives its area to the texel it lies in; one that reaches over a whole map, to all texels alike. So
    /// `total_mm2` is the area of the mesh.
    pub fn new(triangles: &MeshTriangles, world_from_mesh: &Affine3A, size: u32, wrap: [Wrap; 2]) -> Self {
        let side = size as i32;
        let mut mm2 = vec![0.0f32; (size * size) as usize];
        let mut put = |x: i32, y: i32, area: f32| {
            let inside = |texel: i32, wrap| match wrap {
                Wrap::Repeat => texel.rem_euclid(side),
                Wrap::Clamp => texel.clamp(0, side - 1),
            };
            mm2[(inside(y, wrap[1]) * side + inside(x, wrap[0])) as usize] += area;
        };
        let (mut everywhere, mut mesh_mm2) = (0.0, 0.0);
        for (corners, uvs) in triangles.positions.iter().zip(&triangles.uvs) {
            let [a, b, c] = corners.map(|corner| world_from_mesh.transform_point3(corner));
            let area_mm2 = (b - a).cross(c - a).length() * 0.5e6;
            mesh_mm2 += f64::from(area_mm2);
            let texels = Footprint::new(uvs.map(|uv| uv * size as f32));
            let (low, high) = texels.bounds();
            if (high - low).max_element() > size as f32 + 1.0 {
                everywhere += f64::from(area_mm2);
                continue;
            }
            let per_texel = area_mm2 / texels.area();
            let mut covered = 0u32;
            if per_texel.is_finite() {
                for y in low.y.floor() as i32..=high.y.floor() as i32 {
                    for x in low.x.floor() as i32..=high.x.floor() as i32 {
                        if texels.covers(Vec2::new(x as f32 + 0.5, y as f32 + 0.5)) {
                            put(x, y, per_texel);
                            covered += 1;
                        }
                    }
                }
            }
            if covered == 0 {
                let middle = (low + high) / 2.0;
                put(middle.x.floor() as i32, middle.y.floor() as i32, area_mm2);
            }
        }
        if everywhere > 0.0 {
            let share = (everywhere / f64::from(size * size)) as f32;
            mm2.iter_mut().for_each(|texel| *texel += share);
        }
        // Middles are counted, not parts of texels: what islands gain or lose at their borders by that is made up for.
        let counted: f64 = mm2.iter().copied().map(f64::from).sum();
        if counted > 0.0 && mesh_mm2.is_finite() {
            let scale = (mesh_mm2 / counted) as f32;
            mm2.iter_mut().for_each(|texel| *texel *= scale);
        }
        let total_mm2 = mm2.iter().copied().map(f64::from).sum();
        let used = mm2.iter().filter(|&&area| area > 0.0).count().max(1);
        Self { mm2, total_mm2, mean_mm2: (total_mm2 / used as f64) as f32 }
    }
}

/// A triangle in the plane of the map, in texels, counter-clockwise.
pub(crate) struct Footprint([Vec2; 3]);

impl Footprint {
    pub(crate) fn new([a, b, c]: [Vec2; 3]) -> Self {
        Self(if (b - a).perp_dot(c - a) < 0.0 { [a, c, b] } else { [a, b, c] })
    }

    pub(crate) fn bounds(&self) -> (Vec2, Vec2) {
        let [a, b, c] = self.0;
        (a.min(b).min(c), a.max(b).max(c))
    }

    pub(crate) fn area(&self) -> f32 {
        let [a, b, c] = self.0;
        (b - a).perp_dot(c - a) * 0.5
    }

    /// Whether a point lies inside; one on an edge lies in one of the two triangles that share it.
    pub(crate) fn covers(&self, point: Vec2) -> bool {
        let [a, b, c] = self.0;
        [(a, b), (b, c), (c, a)].into_iter().all(|(from, to)| {
            let edge = to - from;
            // Measured from the same end for both triangles of an edge: if they rounded differently, a point on it
            // might lie in neither.
            let forward = edge.x > 0.0 || (edge.x == 0.0 && edge.y > 0.0);
            let side = if forward { edge.perp_dot(point - from) } else { edge.perp_dot(point - to) };
            side > 0.0 || (side == 0.0 && (edge.y > 0.0 || (edge.y == 0.0 && edge.x < 0.0)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quad(uv_scale: f32) -> MeshTriangles {
        let p = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Z, Vec3::Z].map(|p| p * 2.0);
        let uv = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y].map(|uv| uv * uv_scale);
        MeshTriangles {
            positions: vec![[p[0], p[1], p[2]], [p[0], p[2], p[3]]],
            uvs: vec![[uv[0], uv[1], uv[2]], [uv[0], uv[2], uv[3]]],
            source: vec![0, 1],
            report: default(),
        }
    }

    const REPEAT: [Wrap; 2] = [Wrap::Repeat; 2];

    #[test]
    fn a_square_is_shared_evenly_by_its_texels() {
        let areas = TexelAreas::new(&quad(1.0), &Affine3A::IDENTITY, 32, REPEAT);
        // 4 m² over 1024 texels, those on the diagonal in one of the triangles.
        let expected = 4.0e6 / 1024.0;
        assert!(areas.mm2.iter().all(|&area| (area - expected).abs() < 1.0), "{:?}", areas.mm2);
        assert!((areas.total_mm2 - 4.0e6).abs() < 1.0, "{}", areas.total_mm2);
    }

    #[test]
    fn texels_of_tiled_uvs_stand_for_all_their_tiles() {
        for tiles in [2.0, 10.0, 10.3] {
            let areas = TexelAreas::new(&quad(tiles), &Affine3A::IDENTITY, 32, REPEAT);
            assert!((areas.total_mm2 - 4.0e6).abs() < 10.0, "{tiles}: {}", areas.total_mm2);
            let mean = f64::from(areas.mean_mm2);
            assert!((mean - 4.0e6 / 1024.0).abs() < 1.0, "{tiles}: {mean}");
            assert!(areas.mm2.iter().all(|&area| area > 0.0));
        }
    }

    #[test]
    fn uvs_outside_a_clamped_map_belong_to_its_edge() {
        let mut shifted = quad(0.5);
        shifted.uvs.iter_mut().flatten().for_each(|uv| uv.x += 0.75);
        let clamped = TexelAreas::new(&shifted, &Affine3A::IDENTITY, 32, [Wrap::Clamp; 2]);
        let column = |x: usize| (0..32).map(|y| f64::from(clamped.mm2[y * 32 + x])).sum::<f64>();
        assert_eq!(column(0), 0.0);
        assert!((clamped.total_mm2 - 4.0e6).abs() < 1.0);
        // Half of the square lies beyond the edge.
        assert!(column(31) > 2.0e6 && column(30) < 0.3e6, "{} {}", column(31), column(30));
    }

    #[test]
    fn scale_counts() {
        let doubled = Affine3A::from_scale(Vec3::new(3.0, 1.0, 2.0));
        let plain = TexelAreas::new(&quad(0.5), &Affine3A::IDENTITY, 64, REPEAT);
        let scaled = TexelAreas::new(&quad(0.5), &doubled, 64, REPEAT);
        assert!((scaled.total_mm2 / plain.total_mm2 - 6.0).abs() < 1e-3);
    }
}
