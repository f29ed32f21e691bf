//! Wet by a film of liquid over rough matter.
//!
//! Light that a rough, absorbing surface scatters back meets the film's upper side from below, where all that comes at
//! a slant is reflected down again: it gets further chances to be absorbed. Besides, light enters the matter more easily
//! from a liquid than from air. Two numbers of the liquid and the solid say how much: the internal reflection `p` of the
//! film and the ratio `x` of what gets into the solid. They follow from refractive indices alone, so a material
//! computes them once, and a pixel does algebra.
//!
//! Albedos are handled one channel at a time, and saturation rises by itself: what is dark gets relatively darker.
//! The pixel's functions have twins of the same name in `shaders/common/lekner_dorf.wgsl`.
//!
//! Not here: water inside pores, and the film's own highlight, which is a layer above any model.
//!
//! - Lekner and Dorf 1988, *Why some things are darker when wet*.
//! - Stern 1964, *Transmission of isotropic radiation across an interface between two dielectrics*.

/// Refractive index of water.
pub const N_WATER: f64 = 1.33;

/// What the formulas need of a liquid and a solid. No units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LiquidFilm {
    /// Internal reflection of the film, see [`internal_reflection`].
    pub p: f64,
    /// How much more gets into the solid from the liquid than from air, see [`entry_ratio`].
    pub x: f64,
    /// Reflectance of the film at normal incidence, `((n_l - 1) / (n_l + 1))²`.
    pub r_l: f64,
}

impl LiquidFilm {
    /// Of refractive indices, both above 1: of the liquid and of the solid.
    pub fn new(n_liquid: f64, n_solid: f64) -> Self {
        let root = (n_liquid - 1.0) / (n_liquid + 1.0);
        Self { p: internal_reflection(n_liquid), x: entry_ratio(n_liquid, n_solid), r_l: root * root }
    }
}

/// Reflectance `R(n)` of a smooth interface for isotropic light from the thinner side. `n`: ratio of the refractive
/// indices; ratios below 1 count as their inverse. Stern 1964.
pub fn isotropic_reflectance(n: f64) -> f64 {
    let n = if n < 1.0 { 1.0 / n } else { n };
    // Everything below cancels at 1, where slanting light alone is reflected: R is a third of what n exceeds 1 by.
    if n - 1.0 < 1e-3 {
        return (n - 1.0) / 3.0;
    }
    let n2 = n * n;
    (3.0 * n2 + 2.0 * n + 1.0) / (3.0 * (n + 1.0) * (n + 1.0))
        - 2.0 * n2 * n * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n2 + 1.0) * (n2 - 1.0))
        + n2 * (n2 + 1.0) * n.ln() / ((n2 - 1.0) * (n2 - 1.0))
        - n2 * (n2 - 1.0) * (n2 - 1.0) / (n2 + 1.0).powi(3) * (n * (n + 1.0) / (n - 1.0)).ln()
}

/// Part of the isotropic light in the film that its surface sends down again, `p = 1 - (1 - R(n_l)) / n_l²`.
pub fn internal_reflection(n_liquid: f64) -> f64 {
    1.0 - (1.0 - isotropic_reflectance(n_liquid)) / (n_liquid * n_liquid)
}

/// `x = (1 - R(n_s / n_l)) / (1 - R(n_s))`: light gets into the solid more easily from the liquid.
pub fn entry_ratio(n_liquid: f64, n_solid: f64) -> f64 {
    (1.0 - isotropic_reflectance(n_solid / n_liquid)) / (1.0 - isotropic_reflectance(n_solid))
}

/// Absorption of the matter under the liquid at one encounter, `a = a_d ((1 - a_d) x + a_d)` with
/// `a_d = 1 - albedo`. `albedo`: of the dry matter, in `[0, 1]`.
pub fn wet_absorption(albedo: f64, x: f64) -> f64 {
    let dry = (1.0 - albedo).clamp(0.0, 1.0);
    (dry * ((1.0 - dry) * x + dry)).min(1.0)
}

/// Albedo of the wet matter, `1 - (1 - R_l) a / (1 - p (1 - a))`: with the highlight of the film. For matter darker
/// than about .04 that is more than dry.
pub fn wet_albedo(albedo: f64, film: LiquidFilm) -> f64 {
    let a = wet_absorption(albedo, film.x);
    1.0 - (1.0 - film.r_l) * a / (1.0 - film.p * (1.0 - a))
}

/// Diffuse part of the wet albedo, `(1 - p) r / (1 - p r)` with `r = 1 - a`, of the light that got into the film. Used
/// where the film's highlight is a lobe of its own.
pub fn wet_diffuse(albedo: f64, x: f64, p: f64) -> f64 {
    let r = 1.0 - wet_absorption(albedo, x);
    (1.0 - p) * r / (1.0 - p * r)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(actual: f64, expected: f64, tolerance: f64) {
        assert!((actual - expected).abs() <= tolerance, "{actual} instead of {expected}");
    }

    /// Water over what most minerals are.
    fn water() -> LiquidFilm {
        LiquidFilm::new(N_WATER, 1.5)
    }

    /// Mean over the hemisphere of Fresnel's reflectance of unpolarized light, by the midpoint rule.
    fn averaged_fresnel(n: f64) -> f64 {
        let steps = 200_000;
        let sum: f64 = (0..steps)
            .map(|i| {
                // Equal steps of sin² weight by the cosine.
                let sin2 = (f64::from(i) + 0.5) / f64::from(steps);
                let (cos_i, cos_t) = ((1.0 - sin2).sqrt(), (1.0 - sin2 / (n * n)).sqrt());
                let s = (cos_i - n * cos_t) / (cos_i + n * cos_t);
                let p = (cos_t - n * cos_i) / (cos_t + n * cos_i);
                0.5 * (s * s + p * p)
            })
            .sum();
        sum / f64::from(steps)
    }

    #[test]
    fn the_closed_form_is_the_average_over_the_hemisphere() {
        for n in [1.0005, 1.1, 1.127, 1.33, 1.5, 2.4] {
            assert_close(isotropic_reflectance(n), averaged_fresnel(n), 2e-5);
        }
        assert_eq!(isotropic_reflectance(1.0 / 1.5), isotropic_reflectance(1.5));
    }

    #[test]
    fn matches_the_reference_vectors() {
        let film = water();
        assert_close(isotropic_reflectance(1.33), 0.0659308, 5e-8);
        assert_close(isotropic_reflectance(1.5), 0.0917780, 5e-8);
        assert_close(film.p, 0.4719491, 5e-8);
        assert_close(film.x, 1.0671149, 5e-8);
        assert_close(wet_albedo(0.12, film), 0.0817757, 5e-8);
        let table = [
            (0.05, 0.044830, 0.025278),
            (0.2, 0.127600, 0.109742),
            (0.5, 0.343978, 0.330549),
            (0.8, 0.670903, 0.664167),
        ];
        for (albedo, wet, diffuse) in table {
            assert_close(wet_albedo(albedo, film), wet, 5e-7);
            assert_close(wet_diffuse(albedo, film.x, film.p), diffuse, 5e-7);
        }
        let factor = |albedo: f64| wet_albedo(albedo, film) / albedo;
        assert!(factor(0.0390) > 1.0 && factor(0.0400) < 1.0);
    }

    #[test]
    fn the_whole_is_the_highlight_and_the_diffuse_part_of_the_rest() {
        let film = water();
        for albedo in [0.0, 0.1, 0.5, 0.9, 1.0] {
            let parts = film.r_l + (1.0 - film.r_l) * wet_diffuse(albedo, film.x, film.p);
            assert_close(wet_albedo(albedo, film), parts, 1e-12);
        }
    }

    #[test]
    fn black_and_white_stay_and_all_between_gets_darker_and_more_saturated() {
        let film = water();
        let wet = |albedo| wet_diffuse(albedo, film.x, film.p);
        assert_eq!(wet(0.0), 0.0);
        assert_close(wet(1.0), 1.0, 1e-12);
        for i in 1..100 {
            let albedo = f64::from(i) / 100.0;
            assert!(wet(albedo) < albedo, "{albedo}");
            assert!(wet(albedo) > wet(albedo - 0.01), "{albedo}");
            // Relative darkening falls with the albedo.
            assert!(wet(albedo) / albedo > wet(albedo - 0.005) / (albedo - 0.005), "{albedo}");
        }
    }
}
