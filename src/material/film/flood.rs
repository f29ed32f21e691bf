//! Where water stands: from a flood level, a height map and painted vertices to a depth, and from there to the four
//! looks of a wet ground.
//!
//! Two laws. The painter's: every texel that lies low enough in the relief, or that is painted, accumulates water, all
//! of it at once as the level rises. The physical: relief and painted basin are one height, and water stands where
//! the level is above it, as deep as the difference. Both go through the same film: dry, wet, drenched and puddle are not
//! drawn apart, they are what more and more water looks like.
//!
//! Each function has a twin of the same name in `shaders/common/flood.wgsl`.
//!
//! Lagarde 2013, *Water drop 2b: dynamic rain and its effects*.

/// Range of the painted channel over which a rising level soaks in from the rim to the middle.
pub const PAINT_SOFTNESS: f64 = 0.4;

/// Accumulated water in `[0, 1]` by the painter's law, `max(min(cracks, 1 - height), saturate((puddles - paint) / 0.4))`.
///
/// `cracks` and `puddles`: flood levels, `[0, 1]`; `height`: of the relief, 1 is on top; `paint`: 1 never floods.
pub fn accumulated(cracks: f64, puddles: f64, height: f64, paint: f64) -> f64 {
    cracks.min(1.0 - height).max(((puddles - paint) / PAINT_SOFTNESS).clamp(0.0, 1.0))
}

/// Depth of the water in mm by the physical law, `max(0, level - (paint basin + height relief))`.
///
/// `level_mm`: above the lowest point there can be; `basin_mm`, `relief_mm`: what `paint` and `height` in `[0, 1]` span.
pub fn flood_depth(level_mm: f64, basin_mm: f64, relief_mm: f64, height: f64, paint: f64) -> f64 {
    (level_mm - (paint * basin_mm + height * relief_mm)).max(0.0)
}

/// How much of each look a point has: dry, wet, drenched, puddle; their sum is 1. All arguments in `[0, 1]`: wetness of
/// the matter, [coverage](super::layer::film_coverage) and [levelness](super::layer::film_levelness) of the film.
pub fn region_weights(wetness: f64, coverage: f64, levelness: f64) -> [f64; 4] {
    let puddle = coverage * levelness;
    let drenched = coverage - puddle;
    let wet = (1.0 - coverage) * wetness;
    [(1.0 - coverage) * (1.0 - wetness), wet, drenched, puddle]
}

#[cfg(test)]
mod tests {
    use super::super::layer::{film_coverage, film_levelness};
    use super::*;

    #[test]
    fn the_painters_law_floods_cracks_and_painted_places() {
        assert_eq!(accumulated(0.0, 0.0, 0.0, 1.0), 0.0);
        // All cracks below the level hold the same, high places only what is left up to the top.
        assert_eq!(accumulated(0.3, 0.0, 0.1, 1.0), 0.3);
        assert!((accumulated(0.3, 0.0, 0.9, 1.0) - 0.1).abs() < 1e-12);
        // The painted rim comes later than the middle.
        assert!((accumulated(0.0, 0.4, 1.0, 0.2) - 0.5).abs() < 1e-12);
        assert_eq!(accumulated(0.0, 0.4, 1.0, 0.0), 1.0);
        assert_eq!(accumulated(0.0, 0.4, 1.0, 0.4), 0.0);
    }

    #[test]
    fn the_physical_law_is_a_level_surface() {
        let (level, basin, relief) = (3.0, 10.0, 2.0);
        for (height, paint) in [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.2, 0.15), (0.0, 0.3), (1.0, 1.0)] {
            let ground = paint * basin + height * relief;
            let depth = flood_depth(level, basin, relief, height, paint);
            assert!(depth == 0.0 || (ground + depth - level).abs() < 1e-12);
            assert_eq!(depth > 0.0, ground < level);
        }
    }

    #[test]
    fn looks_share_a_point() {
        for wetness in [0.0, 0.4, 1.0] {
            for film_mm in [0.0, 0.02, 0.1, 0.5, 3.0] {
                let weights = region_weights(wetness, film_coverage(film_mm), film_levelness(film_mm, 0.5));
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                assert!(weights.iter().all(|weight| (0.0..=1.0).contains(weight)));
            }
        }
        let look = |wetness, film_mm: f64| {
            let weights = region_weights(wetness, film_coverage(film_mm), film_levelness(film_mm, 0.5));
            (0..4).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).unwrap()
        };
        assert_eq!([look(0.1, 0.0), look(1.0, 0.0), look(1.0, 0.15), look(1.0, 3.0)], [0, 1, 2, 3]);
    }
}
