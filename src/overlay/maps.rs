//! What a texel holds, and how much surface it stands for.

use bevy::math::Affine3A;
use bevy::prelude::*;
use bytemuck::{Pod, Zeroable};

use crate::collision::MeshTriangles;

/// State of one texel. A row of the GPU's state buffer.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct TexelState {
    /// Water, nanolitres; stops at `u32::MAX` (4.29 l).
    pub water_nl: u32,
    /// Tick in which it became wet, 0 if it never did.
    pub wet_since: u32,
}

impl TexelState {
    /// Adds water that arrives in `tick`. What is wet already stays wet since when it was.
    pub fn add_water(&mut self, water_nl: u32, tick: u32) {
        if water_nl > 0 && self.water_nl == 0 {
            self.wet_since = tick;
        }
        self.water_nl = self.water_nl.saturating_add(water_nl);
    }
}

/// World area that each texel of a surface stands for; 0 where no triangle lies.
#[derive(Component, Debug, Clone, PartialEq)]
pub struct TexelAreas {
    /// mm², row by row.
    pub mm2: Vec<f32>,
    /// Sum, mm².
    pub total_mm2: f64,
    /// Mean over the texels that stand for anything, mm².
    pub mean_mm2: f32,
}

impl TexelAreas {
    /// Rasterizes the triangles over their uvs; a texel belongs to the triangles that its middle lies in, and takes
    /// the density of each. Tiled uvs wrap. Triangles smaller than a texel that cover no middle give their area
    /// to the texel they lie in, so that `total_mm2` is the area of the mesh up to overlaps at edges.
    pub fn new(triangles: &MeshTriangles, world_from_mesh: &Affine3A, size: u32) -> Self {
        let mut mm2 = vec![0.0f32; (size * size) as usize];
        let side = size as i32;
        let mut put = |x: i32, y: i32, area: f32| {
            mm2[(y.rem_euclid(side) * side + x.rem_euclid(side)) as usize] += area;
        };
        for (corners, uvs) in triangles.positions.iter().zip(&triangles.uvs) {
            let [a, b, c] = corners.map(|corner| world_from_mesh.transform_point3(corner));
            let area_mm2 = (b - a).cross(c - a).length() * 0.5e6;
            let [p, q, r] = uvs.map(|uv| uv * size as f32);
            let twice_texels = (q - p).perp_dot(r - p);
            let low = p.min(q).min(r);
            let high = p.max(q).max(r);
            // A triangle over a whole map or more (or with no area in uv) says nothing about single texels.
            let (width, height) = (high - low).into();
            let mut covered = 0u32;
            if twice_texels != 0.0 && width <= size as f32 + 1.0 && height <= size as f32 + 1.0 {
                let per_texel = area_mm2 / (twice_texels.abs() * 0.5);
                for y in low.y.floor() as i32..=high.y.floor() as i32 {
                    for x in low.x.floor() as i32..=high.x.floor() as i32 {
                        let middle = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                        let side_of = |from: Vec2, to: Vec2| {
                            (to - from).perp_dot(middle - from) * twice_texels.signum()
                        };
                        if side_of(p, q) >= 0.0 && side_of(q, r) >= 0.0 && side_of(r, p) >= 0.0 {
                            put(x, y, per_texel);
                            covered += 1;
                        }
                    }
                }
            }
            if covered == 0 {
                let middle = (p + q + r) / 3.0;
                put(middle.x.floor() as i32, middle.y.floor() as i32, area_mm2);
            }
        }
        let total_mm2 = mm2.iter().copied().map(f64::from).sum();
        let used = mm2.iter().filter(|&&area| area > 0.0).count().max(1);
        Self { mm2, total_mm2, mean_mm2: (total_mm2 / used as f64) as f32 }
    }

    /// The part of the surface's area, 0..=1, on which `states` hold any water.
    pub fn wet_fraction(&self, states: &[TexelState]) -> f64 {
        let wet: f64 = self
            .mm2
            .iter()
            .zip(states)
            .filter(|(_, state)| state.water_nl > 0)
            .map(|(&area, _)| f64::from(area))
            // Not `sum`, whose nothing is -0.
            .fold(0.0, |sum, area| sum + area);
        if self.total_mm2 > 0.0 { wet / self.total_mm2 } else { 0.0 }
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

    #[test]
    fn a_square_is_shared_evenly_by_its_texels() {
        let areas = TexelAreas::new(&quad(1.0), &Affine3A::IDENTITY, 32);
        // 4 m² over 1024 texels; the diagonal belongs to both triangles.
        let expected = 4.0e6 / 1024.0;
        let once = areas.mm2.iter().filter(|&&area| (area - expected).abs() < 1.0).count();
        assert!(once >= 1024 - 32, "{once}");
        assert!((areas.total_mm2 - 4.0e6).abs() < 4.0e6 * 0.04, "{}", areas.total_mm2);
    }

    #[test]
    fn scale_counts() {
        let doubled = Affine3A::from_scale(Vec3::new(3.0, 1.0, 2.0));
        let plain = TexelAreas::new(&quad(0.5), &Affine3A::IDENTITY, 64);
        let scaled = TexelAreas::new(&quad(0.5), &doubled, 64);
        assert!((scaled.total_mm2 / plain.total_mm2 - 6.0).abs() < 1e-3);
    }

    #[test]
    fn wet_fraction_is_by_area() {
        let areas = TexelAreas { mm2: vec![1.0, 3.0, 0.0, 4.0], total_mm2: 8.0, mean_mm2: 2.0 };
        let wet = TexelState { water_nl: 5, wet_since: 1 };
        let dry = TexelState::default();
        assert_eq!(areas.wet_fraction(&[wet, dry, wet, dry]), 0.125);
    }

    #[test]
    fn water_keeps_its_first_hour_and_stops_at_the_brim() {
        let mut texel = TexelState::default();
        texel.add_water(0, 3);
        assert_eq!(texel, TexelState::default());
        texel.add_water(5, 4);
        texel.add_water(u32::MAX, 9);
        assert_eq!(texel, TexelState { water_nl: u32::MAX, wet_since: 4 });
    }
}
