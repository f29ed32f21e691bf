//! A wet map of noise: a soaked surface that dries unevenly, or a damp one that gets wet so.
//!
//! Fractal Perlin noise is laid over the tile, so that the map goes on round its edges. Then each texel is given
//! its rank among all of them for a value. Noise prefers middling values, ranks are spread evenly: played
//! linearly in time, the wet area grows by the same in every second.
//!
//! Perlin 2002, *Improving noise*; Hnat et al. 2006 for the use.

use bevy::math::Vec2;
use fastnoise_lite::NoiseType;

use super::parallel::fill;
use super::{GreyMap, WetMapError, check_range, check_size};
use crate::scenes::noise::{Noise, hash};

/// What a map of noise is like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PerlinOptions {
    /// Texels along each side, 1 to [`GreyMap::MAX_SIZE`].
    pub size: u32,
    /// Another one, another map.
    pub seed: u64,
    /// Features along each side, 0.5 to 1024.
    pub cycles: f32,
    /// Layers of noise, each with features half as large and half as strong as those of the one before: 1 to
    /// 12.
    pub octaves: u32,
    /// Part of the area that ever gets wet, 0..=1.
    pub coverage: f32,
}

impl Default for PerlinOptions {
    fn default() -> Self {
        Self { size: 512, seed: 0, cycles: 6.0, octaves: 5, coverage: 1.0 }
    }
}

/// Rows that a thread takes at a time.
const ROWS: usize = 16;

/// A map of noise that repeats over its edges. `coverage` of its texels are above 0, and those are spread
/// evenly over 0..=1, so that at the time `t` the part `coverage * t` is wet.
///
/// # Errors
/// [`WetMapError::Parameter`]; [`WetMapError::Size`].
pub fn perlin(options: &PerlinOptions) -> Result<GreyMap, WetMapError> {
    let &PerlinOptions { size, seed, cycles, octaves, coverage } = options;
    check_size(size, size)?;
    check_range("cycles", cycles, 0.5..=1024.0)?;
    check_range("octaves", octaves, 1..=12)?;
    check_range("coverage", coverage, 0.0..=1.0)?;
    let seed = hash([seed as u32, (seed >> 32) as u32, 3]);
    let noise = Noise::new(NoiseType::Perlin, seed, Vec2::splat(cycles), octaves as i32);
    let width = size as usize;
    let mut heights = vec![0.0f32; width * width];
    fill(&mut heights, ROWS * width, |first, chunk| {
        for (i, height) in chunk.iter_mut().enumerate() {
            let at = first + i;
            let along = |texel: usize| (texel as f32 + 0.5) / size as f32;
            *height = noise.at(Vec2::new(along(at % width), along(at / width)));
        }
    });
    GreyMap::new(size, size, ranked(&heights, coverage))
}

/// The rank of each value as a number: the lowest are 0 until `coverage` are left, the rest rises evenly to
/// 1. Of equal values the later is the higher.
fn ranked(heights: &[f32], coverage: f32) -> Vec<f32> {
    let mut order: Vec<u32> = (0..heights.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| heights[a as usize].total_cmp(&heights[b as usize]).then(a.cmp(&b)));
    let wet = ((f64::from(coverage) * heights.len() as f64).round() as usize).min(heights.len());
    let mut ranks = vec![0.0; heights.len()];
    for (rank, &at) in order.iter().skip(heights.len() - wet).enumerate() {
        ranks[at as usize] = ((rank + 1) as f64 / wet as f64) as f32;
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> PerlinOptions {
        PerlinOptions { size: 128, ..PerlinOptions::default() }
    }

    #[test]
    fn the_wet_area_grows_evenly_up_to_the_coverage() {
        for coverage in [1.0, 0.6, 0.1, 0.0] {
            let map = perlin(&PerlinOptions { coverage, ..small() }).unwrap();
            let part = |least: f32| {
                let wet = map.values.iter().filter(|&&value| value > least).count();
                wet as f32 / map.values.len() as f32
            };
            assert!((part(0.0) - coverage).abs() < 1e-3, "{coverage}: {}", part(0.0));
            for time in [0.1, 0.25, 0.5, 0.9] {
                let wet = part(1.0 - time);
                assert!((wet - coverage * time).abs() < 1e-3, "{coverage} {time}: {wet}");
            }
        }
    }

    #[test]
    fn the_map_goes_on_round_its_edges() {
        let map = perlin(&PerlinOptions { octaves: 3, ..small() }).unwrap();
        let step = |x: u32, y: u32, dx: u32, dy: u32| (map.get(x, y) - map.get(x + dx, y + dy)).abs();
        let mean = |x: &dyn Fn(u32) -> f32| (0..128).map(x).sum::<f32>() / 128.0;
        let inside = mean(&|i| step(60, i, 1, 0)) + mean(&|i| step(i, 60, 0, 1));
        let across = mean(&|i| step(127, i, 1, 0)) + mean(&|i| step(i, 127, 0, 1));
        assert!(across < 4.0 * inside, "{across} {inside}");
    }

    #[test]
    fn seeds_differ_and_repeat() {
        let map = |seed| perlin(&PerlinOptions { seed, size: 32, ..small() }).unwrap();
        assert_eq!(map(7), map(7));
        assert_ne!(map(7), map(8));
        assert_ne!(map(7), map(7 + (1 << 32)));
    }

    #[test]
    fn more_cycles_have_smaller_features() {
        let steps = |cycles| {
            let map = perlin(&PerlinOptions { cycles, octaves: 1, ..small() }).unwrap();
            map.values.windows(2).map(|pair| (pair[0] - pair[1]).abs()).sum::<f32>()
        };
        assert!(steps(16.0) > 1.5 * steps(4.0));
    }

    #[test]
    fn nonsense_is_named() {
        let error = |options: PerlinOptions| perlin(&options).unwrap_err().to_string();
        assert!(error(PerlinOptions { coverage: 1.1, ..small() }).contains("`coverage` is 1.1"));
        assert!(error(PerlinOptions { coverage: f32::NAN, ..small() }).contains("`coverage` is NaN"));
        assert!(error(PerlinOptions { cycles: 0.0, ..small() }).contains("`cycles`"));
        assert!(error(PerlinOptions { octaves: 13, ..small() }).contains("`octaves` is 13"));
        assert!(error(PerlinOptions { size: 8193, ..small() }).contains("8192"));
    }
}
