//! The lobes that blur the light: GGX by importance samples, the cosine by spherical harmonics.

use std::f32::consts::{PI, TAU};

use bevy::math::{Vec2, Vec3};

use super::cube::Source;

/// One sample of a [`Lobe`].
struct LobeSample {
    /// Light direction, z along the reflected ray.
    direction: Vec3,
    /// Share of the whole lobe.
    weight: f32,
    /// Mip level of the source.
    level: f32,
}

/// The GGX lobe of one roughness with view direction = normal, the same for every texel.
pub(super) struct Lobe(Vec<LobeSample>);

impl Lobe {
    /// `face` is the edge of the source's first level.
    ///
    /// With `alpha` the square of the perceptual roughness and N = V: half vectors have the density
    /// `D N.H`, so light has `D N.H / (4 V.H) = D / 4`. One of `n` samples stands for the solid angle
    /// `1 / (n D / 4)`, a texel of the source for `4 pi / (6 face^2)`; the level is half the binary
    /// logarithm of their ratio, plus one so that neighbouring samples overlap.
    pub(super) fn new(perceptual_roughness: f32, samples: u32, face: u32) -> Self {
        let alpha2 = perceptual_roughness.powi(4);
        if alpha2 == 0.0 {
            return Self(vec![LobeSample { direction: Vec3::Z, weight: 1.0, level: 0.0 }]);
        }
        let texel = 4.0 * PI / (6.0 * (face * face) as f32);
        let mut lobe: Vec<LobeSample> = (0..samples)
            .filter_map(|i| {
                let Vec2 { x, y } = hammersley(i, samples);
                let cos2 = (1.0 - y) / (1.0 + (alpha2 - 1.0) * y);
                let (sin_around, cos_around) = (TAU * x).sin_cos();
                let sin = (1.0 - cos2).max(0.0).sqrt();
                let half = Vec3::new(sin * cos_around, sin * sin_around, cos2.sqrt());
                let light = 2.0 * half.z * half - Vec3::Z;
                let density = alpha2 / (PI * (cos2 * (alpha2 - 1.0) + 1.0).powi(2)) / 4.0;
                let level = 0.5 * (1.0 / (samples as f32 * density * texel)).log2() + 1.0;
                (light.z > 0.0).then_some(LobeSample { direction: light, weight: light.z, level })
            })
            .collect();
        let total: f32 = lobe.iter().map(|sample| sample.weight).sum();
        for sample in &mut lobe {
            sample.weight /= total;
        }
        Self(lobe)
    }

    /// The blurred radiance around a unit direction.
    pub(super) fn radiance(&self, direction: Vec3, source: &Source) -> Vec3 {
        let (x, y) = direction.any_orthonormal_pair();
        let light = |local: Vec3| x * local.x + y * local.y + direction * local.z;
        self.0.iter().map(|sample| source.sample(light(sample.direction), sample.level) * sample.weight).sum()
    }
}

/// The `i`-th of `n` evenly spread points in the unit square; the second coordinate is never 0 or 1.
fn hammersley(i: u32, n: u32) -> Vec2 {
    let radical_inverse = i.reverse_bits() as f32 / 4_294_967_296.0;
    Vec2::new(radical_inverse, (i as f32 + 0.5) / n as f32)
}

/// Real spherical harmonics up to order 2 for a unit vector, as Ramamoorthi and Hanrahan number them.
pub(super) fn harmonic_basis(d: Vec3) -> [f32; 9] {
    [
        0.282_095,
        0.488_603 * d.y,
        0.488_603 * d.z,
        0.488_603 * d.x,
        1.092_548 * d.x * d.y,
        1.092_548 * d.y * d.z,
        0.315_392 * (3.0 * d.z * d.z - 1.0),
        1.092_548 * d.x * d.z,
        0.546_274 * (d.x * d.x - d.y * d.y),
    ]
}

/// `E(n) / pi = sum over l, m of (A_l / pi) L_lm Y_lm(n)`, with `A = (pi, 2 pi / 3, pi / 4)` the cosine lobe.
pub(super) fn irradiance_over_pi(harmonics: &[Vec3; 9], normal: Vec3) -> Vec3 {
    const LOBE: [f32; 9] = [1.0, 2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 0.25, 0.25, 0.25, 0.25, 0.25];
    let basis = harmonic_basis(normal);
    let sum: Vec3 = (0..9).map(|i| harmonics[i] * (LOBE[i] * basis[i])).sum();
    sum.max(Vec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{levels, maps_of, mean, texels};
    use bevy::math::{Vec2, Vec3};

    #[test]
    fn light_from_above_lights_what_faces_up() {
        let maps = maps_of(|direction| Vec3::splat(if direction.y > 0.0 { 1.0 } else { 0.0 }));
        let middle = |layer| texels(&maps.diffuse, layer, 0)[8 * 16 + 8].x;
        let (up, side, down) = (middle(2), middle(4), middle(3));
        assert!((up - 1.0).abs() < 0.03 && (side - 0.5).abs() < 0.06 && down < 0.03, "{up} {side} {down}");
    }

    #[test]
    fn blurring_neither_makes_nor_loses_light() {
        let sun = Vec3::new(0.3, 0.8, -0.5).normalize();
        let maps = maps_of(|direction| {
            let glow = if direction.dot(sun) > 0.97 { 30.0 } else { 0.0 };
            Vec3::new(1.0, 0.7 + 0.3 * direction.y, 0.5) + glow
        });
        let whole = mean(&maps.skybox, 0);
        for level in 0..levels(&maps.specular) {
            let ratio = mean(&maps.specular, level) / whole;
            assert!(ratio.abs_diff_eq(Vec3::ONE, 0.01), "level {level}: {ratio}");
        }
        let ratio = mean(&maps.diffuse, 0) / whole;
        assert!(ratio.abs_diff_eq(Vec3::ONE, 0.02), "diffuse: {ratio}");
    }

    #[test]
    fn a_small_sun_becomes_one_round_spot() {
        let maps = maps_of(|direction| Vec3::splat(if direction.y > 0.995 { 60.0 } else { 0.0 }));
        for level in 1..4 {
            let face = 64 >> level;
            let mut spot: Vec<(f32, f32)> = texels(&maps.specular, 2, level)
                .into_iter()
                .enumerate()
                .map(|(i, texel)| {
                    let at = Vec2::new((i % face) as f32, (i / face) as f32) + 0.5 - face as f32 / 2.0;
                    (at.length(), texel.x)
                })
                .collect();
            spot.sort_by(|a, b| a.0.total_cmp(&b.0));
            let peak = spot[0].1;
            for pair in spot.windows(2) {
                assert!(pair[1].1 <= pair[0].1 + 0.06 * peak, "level {level}: {pair:?} of {peak}");
            }
        }
    }
}
