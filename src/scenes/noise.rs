//! Numbers that look random and are the same everywhere: hashes, and noise that repeats over the unit square.
//!
//! Noise does not repeat by itself. Over the last quarter of either axis it is exchanged smoothly for the noise from
//! before the first edge. Of two independent noises what adds up is their variances, so the sum of both would be
//! flatter than either; it is divided by the root of its squared weights (Heitz and Neyret, "High-performance by-example
//! noise using a histogram-preserving blending operator", 2018).

use bevy::math::Vec2;
use fastnoise_lite::{FastNoiseLite, FractalType, NoiseType};

/// Fractal noise that repeats over the unit square, about -1 to 1.
/// Half a cycle per square is the least: closer, noise resembles itself and gains contrast when exchanged.
pub(crate) struct Noise {
    source: FastNoiseLite,
    cycles: Vec2,
}

impl Noise {
    /// `cycles` features along u and v, and `octaves` layers, each half as large and half as strong as the one before.
    pub(crate) fn new(kind: NoiseType, seed: u32, cycles: Vec2, octaves: i32) -> Self {
        // Each octave counts the seed up by one.
        let seed = (seed as i32).min(i32::MAX - octaves);
        let mut source = FastNoiseLite::with_seed(seed);
        source.set_noise_type(Some(kind));
        source.set_frequency(Some(1.0));
        source.set_fractal_type(Some(FractalType::FBm));
        source.set_fractal_octaves(Some(octaves));
        Self { source, cycles }
    }

    pub(crate) fn at(&self, uv: Vec2) -> f32 {
        let uv = uv - uv.floor();
        let late = Vec2::new(smoothstep(0.75, 1.0, uv.x), smoothstep(0.75, 1.0, uv.y));
        let early = 1.0 - late;
        let mut sum = 0.0;
        for (shift, weight) in [
            (Vec2::ZERO, early.x * early.y),
            (Vec2::X, late.x * early.y),
            (Vec2::Y, early.x * late.y),
            (Vec2::ONE, late.x * late.y),
        ] {
            if weight > 0.0 {
                let at = (uv - shift) * self.cycles;
                sum += weight * self.source.get_noise_2d(at.x, at.y);
            }
        }
        let variance = early * early + late * late;
        sum / (variance.x * variance.y).sqrt()
    }
}

pub(crate) fn smoothstep(low: f32, high: f32, value: f32) -> f32 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Three numbers stirred into one: the finaliser of MurmurHash3 after each.
pub(crate) fn hash(numbers: [u32; 3]) -> u32 {
    numbers.into_iter().fold(0x9e37_79b9, |hash, number| {
        let mut h = hash ^ number.wrapping_mul(0xcc9e_2d51);
        h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
        h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
        h ^ (h >> 16)
    })
}

/// 32 random bits as a number from 0 up to, but not including, 1: the upper 24, the most that an `f32` holds.
pub(crate) fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 / 16_777_216.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exchange_of_noises_keeps_their_contrast() {
        // Perlin's has contrasts of its own from place to place.
        for cycles in [Vec2::splat(9.0), Vec2::new(0.5, 22.0)] {
            // The spread at one u over many seeds and v.
            let spread = |u: f32| {
                let values = (0..150).flat_map(|seed| {
                    let noise = Noise::new(NoiseType::OpenSimplex2, hash([seed, 1, 0]), cycles, 2);
                    (0..40).map(move |i| noise.at(Vec2::new(u, i as f32 / 60.0)))
                });
                values.map(|value| value * value).sum::<f32>().sqrt()
            };
            let ratio = spread(0.875) / spread(0.3);
            assert!((ratio - 1.0).abs() < 0.1, "{cycles}: {ratio}");
        }
    }

    #[test]
    fn the_square_goes_on_at_its_edges() {
        for kind in [NoiseType::OpenSimplex2, NoiseType::Perlin] {
            let noise = Noise::new(kind, u32::MAX / 2, Vec2::new(7.0, 3.0), 3);
            for i in 0..50 {
                let along = i as f32 / 50.0;
                for (before, after) in [
                    (Vec2::new(0.99999, along), Vec2::new(0.00001, along)),
                    (Vec2::new(along, 0.99999), Vec2::new(along, 0.00001)),
                    (Vec2::new(along, 0.25), Vec2::new(along + 3.0, 0.25)),
                ] {
                    let (before, after) = (noise.at(before), noise.at(after));
                    assert!((before - after).abs() < 0.01, "{kind:?} {along}: {before} {after}");
                }
            }
        }
    }
}
