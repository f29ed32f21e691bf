//! The photograph: where a direction lies in it, and what is taken from it.

use std::f32::consts::{PI, TAU};

use bevy::math::{Vec2, Vec3};

use super::cube::Cube;
use super::lobe::harmonic_basis;

/// Where a world direction lies in an equirectangular image, `0..=1` from the left and from the top.
pub(super) fn equirect_uv(direction: Vec3) -> Vec2 {
    let d = direction.normalize();
    Vec2::new(0.5 + d.x.atan2(-d.z) / TAU, d.y.clamp(-1.0, 1.0).acos() / PI)
}

/// The world direction of a place in an equirectangular image; [`equirect_uv`] the other way.
pub(super) fn equirect_direction(uv: Vec2) -> Vec3 {
    let (sin_longitude, cos_longitude) = ((uv.x - 0.5) * TAU).sin_cos();
    let (sin_polar, cos_polar) = (uv.y * PI).sin_cos();
    Vec3::new(sin_polar * sin_longitude, cos_polar, -sin_polar * cos_longitude)
}

/// The photograph: finite, not negative, and no brighter than asked for.
pub(super) struct Equirect {
    width: usize,
    pixels: Vec<Vec3>,
}

impl Equirect {
    pub(super) fn new(width: u32, pixels: &[[f32; 3]], max_radiance: f32) -> Self {
        let clean = |pixel: &[f32; 3]| {
            // NaN is not above zero, and the scaling below must not meet an infinity.
            let finite = |value: f32| if value > 0.0 { value.min(f32::MAX) } else { 0.0 };
            let pixel = Vec3::from_array(pixel.map(finite));
            pixel * (max_radiance / pixel.max_element().max(max_radiance))
        };
        Self { width: width as usize, pixels: pixels.iter().map(clean).collect() }
    }

    fn height(&self) -> usize {
        self.width / 2
    }

    /// Bilinear, round the edge on the left and right.
    fn sample(&self, direction: Vec3) -> Vec3 {
        let (width, height) = (self.width as isize, self.height() as isize);
        let at = equirect_uv(direction) * Vec2::new(width as f32, height as f32) - 0.5;
        let (floor, part) = (at.floor(), at - at.floor());
        let row = |y: isize| {
            let y = y.clamp(0, height - 1);
            let pixel = |x: isize| self.pixels[(y * width + x.rem_euclid(width)) as usize];
            pixel(floor.x as isize).lerp(pixel(floor.x as isize + 1), part.x)
        };
        row(floor.y as isize).lerp(row(floor.y as isize + 1), part.y)
    }

    /// The photograph on a cube, averaged where the cube is coarser.
    pub(super) fn cube(&self, face: u32) -> Cube {
        // A texel in the middle of a face covers 2 / face radians, a pixel on the horizon 2 pi / width.
        let pixels_per_texel = self.width as f32 / (PI * face as f32);
        Cube::new(face, pixels_per_texel.ceil().max(1.0) as u32, |direction| self.sample(direction))
    }

    /// The radiance projected on the nine spherical harmonics of [`harmonic_basis`].
    pub(super) fn harmonics(&self) -> [Vec3; 9] {
        let (width, height) = (self.width as f32, self.height() as f32);
        let mut sum = [Vec3::ZERO; 9];
        for (y, row) in self.pixels.chunks_exact(self.width).enumerate() {
            let polar = |y: usize| y as f32 / height * PI;
            let solid_angle = TAU / width * (polar(y).cos() - polar(y + 1).cos());
            // One sum per row first: adding small to large loses less.
            let mut of_row = [Vec3::ZERO; 9];
            for (x, &radiance) in row.iter().enumerate() {
                let uv = Vec2::new((x as f32 + 0.5) / width, (y as f32 + 0.5) / height);
                let basis = harmonic_basis(equirect_direction(uv));
                for (sum, basis) in of_row.iter_mut().zip(basis) {
                    *sum += radiance * basis;
                }
            }
            for (sum, of_row) in sum.iter_mut().zip(of_row) {
                *sum += of_row * solid_angle;
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{maps_of, texels};
    use super::*;

    #[test]
    fn the_photograph_is_where_bevy_looks_for_it() {
        let ahead = equirect_uv(Vec3::NEG_Z);
        assert!(ahead.abs_diff_eq(Vec2::splat(0.5), 1e-6), "{ahead}");
        assert!(equirect_uv(Vec3::new(0.1, 0.1, -1.0)).x > 0.5, "right is to the right");
        assert!(equirect_uv(Vec3::new(0.1, 0.1, -1.0)).y < 0.5, "up is at the top");
        // Colours that name the direction; the layers are those of the direction with z negated.
        let maps = maps_of(|direction| direction * 0.5 + 0.5);
        let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::NEG_Z, Vec3::Z];
        for (layer, axis) in axes.into_iter().enumerate() {
            for (image, face) in [(&maps.skybox, 64), (&maps.specular, 64)] {
                let texel = texels(image, layer, 0)[face / 2 * face + face / 2];
                assert!(texel.abs_diff_eq(axis * 0.5 + 0.5, 0.04), "{layer} {axis}: {texel}");
            }
            // Order 1 comes back with 2/3 of its amplitude.
            let texel = texels(&maps.diffuse, layer, 0)[8 * 16 + 8];
            assert!(texel.abs_diff_eq(axis / 3.0 + 0.5, 0.04), "{layer} {axis}: {texel}");
        }
    }
}
