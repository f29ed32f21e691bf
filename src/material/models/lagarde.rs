//! Wet by tweaking parameters: water in the pores scales the albedo down and the gloss up.
//!
//! What games do, with one number per texel: the more porous, the darker and the glossier a surface gets. Metal has no
//! pores. Where nobody painted a porosity, it is guessed from the gloss, since what is polished is not porous.
//!
//! Gloss is the logarithm of a specular power, `n = 2^(11 gloss)`. Each function has a twin of the same name in
//! `shaders/common/lagarde.wgsl`.
//!
//! Not here: puddles and films, which lie above any model.
//!
//! Lagarde 2013, *Water drop 3b: physically based wet surfaces*.

/// Part of its albedo that fully porous matter keeps when wet.
pub const DARKEST: f64 = 0.2;

/// Logarithm of the specular power at gloss 1.
pub const GLOSS_OCTAVES: f64 = 11.0;

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// What soaked matter keeps of its albedo, `f = lerp(1, 0.2, (1 - metalness) porosity)`. Both in `[0, 1]`.
pub fn kept_albedo(porosity: f64, metalness: f64) -> f64 {
    lerp(1.0, DARKEST, (1.0 - metalness) * porosity)
}

/// Albedo when wet by `w`, `albedo lerp(1, f, w)`. `f` from [`kept_albedo`]; all in `[0, 1]`.
pub fn wet_albedo(albedo: f64, f: f64, w: f64) -> f64 {
    albedo * lerp(1.0, f, w)
}

/// Gloss when wet by `w`, `lerp(1, gloss, lerp(1, f, 0.5 w))`. `f` from [`kept_albedo`]; all in `[0, 1]`.
pub fn wet_gloss(gloss: f64, f: f64, w: f64) -> f64 {
    lerp(1.0, gloss, lerp(1.0, f, 0.5 * w))
}

/// Porosity of a surface known by its gloss alone: full up to .1, none from .5 on.
pub fn porosity_from_gloss(gloss: f64) -> f64 {
    (1.25 - 2.5 * gloss).clamp(0.0, 1.0)
}

/// Porosity where a mask, in `[0, 1]`, says what may be porous at all.
pub fn porosity_from_mask(mask: f64, gloss: f64) -> f64 {
    mask * porosity_from_gloss(gloss)
}

/// Metalness of a specular colour, `saturate(1000 · 0.33 (r + g + b) - 500)`: a step at a mean of about one half.
pub fn metalness_from_specular(specular: [f64; 3]) -> f64 {
    (1000.0 * 0.33 * (specular[0] + specular[1] + specular[2]) - 500.0).clamp(0.0, 1.0)
}

/// Perceptual roughness of a gloss, `(2 / (n + 2))^(1/4)` with `n = 2^(11 gloss)`. From .904 down to .177.
pub fn roughness_from_gloss(gloss: f64) -> f64 {
    (2.0 / ((GLOSS_OCTAVES * gloss).exp2() + 2.0)).powf(0.25)
}

/// Gloss of a perceptual roughness in `[0, 1]`: the inverse of [`roughness_from_gloss`] within its range, 0 and 1
/// outside.
pub fn gloss_from_roughness(roughness: f64) -> f64 {
    let square = (roughness * roughness).max(1e-4);
    let power = (2.0 / (square * square) - 2.0).max(1.0);
    (power.log2() / GLOSS_OCTAVES).clamp(0.0, 1.0)
}

/// Perceptual roughness when wet by `w`. What is smoother than any gloss can say stays as it is.
pub fn wet_roughness(roughness: f64, f: f64, w: f64) -> f64 {
    let gloss = gloss_from_roughness(roughness);
    let wet = wet_gloss(gloss, f, w);
    if wet <= gloss { roughness } else { roughness.min(roughness_from_gloss(wet)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_the_reference_vectors() {
        // albedo, gloss, w, porosity, metalness; f, wet albedo, wet gloss.
        let vectors = [
            ([0.4, 0.3, 1.0, 1.0, 0.0], [0.2, 0.08, 0.58]),
            ([0.4, 0.3, 0.5, 1.0, 0.0], [0.2, 0.24, 0.44]),
            ([0.4, 0.3, 1.0, 0.5, 0.0], [0.6, 0.24, 0.44]),
            ([0.5, 0.2, 1.0, 1.0, 1.0], [1.0, 0.5, 0.2]),
        ];
        for ([albedo, gloss, w, porosity, metalness], expected) in vectors {
            let f = kept_albedo(porosity, metalness);
            for (actual, expected) in
                [f, wet_albedo(albedo, f, w), wet_gloss(gloss, f, w)].iter().zip(expected)
            {
                assert!((actual - expected).abs() < 1e-9, "{actual} instead of {expected}");
            }
        }
    }

    #[test]
    fn gloss_and_roughness_are_inverse_to_each_other() {
        for gloss in [0.0, 0.1, 0.37, 0.8, 1.0] {
            assert!((gloss_from_roughness(roughness_from_gloss(gloss)) - gloss).abs() < 1e-12, "{gloss}");
        }
        assert_eq!(gloss_from_roughness(0.0), 1.0);
        assert_eq!(gloss_from_roughness(1.0), 0.0);
    }

    #[test]
    fn porosity_is_guessed_from_gloss() {
        assert_eq!(porosity_from_gloss(0.1), 1.0);
        assert_eq!(porosity_from_gloss(0.5), 0.0);
        assert!((porosity_from_gloss(0.3) - 0.5).abs() < 1e-12);
        assert_eq!(porosity_from_mask(0.5, 0.0), 0.5);
        assert_eq!(metalness_from_specular([0.04; 3]), 0.0);
        assert_eq!(metalness_from_specular([0.9, 0.7, 0.3]), 1.0);
    }

    #[test]
    fn dry_solid_and_metal_stay_and_more_water_is_darker_and_glossier() {
        for roughness in [0.05, 0.3, 0.7, 0.95, 1.0] {
            for (porosity, metalness, w) in [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0)] {
                let f = kept_albedo(porosity, metalness);
                assert_eq!(wet_albedo(0.4, f, w), 0.4);
                assert_eq!(wet_roughness(roughness, f, w), roughness);
            }
            let f = kept_albedo(0.7, 0.0);
            let steps = (0..=10).map(|i| f64::from(i) / 10.0);
            let wet: Vec<_> =
                steps.map(|w| (wet_albedo(0.4, f, w), wet_roughness(roughness, f, w))).collect();
            for pair in wet.windows(2) {
                assert!(pair[1].0 < pair[0].0 && pair[1].1 <= pair[0].1, "{pair:?}");
            }
        }
    }
}
