//! Pores and a film over the solid between them, in one surface.
//!
//! Filled pores are dark because light does not come out of them; the solid between them is dark because the film on it
//! sends light down again. The two share the surface: `α G` of it is pore mouth, the rest is solid, so each part is
//! darkened once. The pores' share is [`hnat`](super::hnat)'s, the solid's is [`lekner_dorf`](super::lekner_dorf)'s.
//!
//! The function has a twin of the same name in `shaders/common/film_on_pores.wgsl`.

use super::lekner_dorf::wet_diffuse;

/// What the film takes off the diffuse coefficient, `(kd - wet kd)(1 - α G) c`.
///
/// `kd`: of the solid; `alpha_poro`, `g`: part of the surface that is pore mouths; `x`, `p`: of the film, see
/// [`LiquidFilm`](super::lekner_dorf::LiquidFilm); `coverage`: `c`, part of the solid under the film.
pub fn film_darkening(kd: f64, alpha_poro: f64, g: f64, x: f64, p: f64, coverage: f64) -> f64 {
    (kd - wet_diffuse(kd, x, p)) * (1.0 - alpha_poro * g) * coverage
}

#[cfg(test)]
mod tests {
    use super::super::hnat::{PorousParams, hnat_terms};
    use super::super::lekner_dorf::{LiquidFilm, N_WATER};
    use super::*;

    fn blended(alpha_poro: f64, coverage: f64, tau: f64) -> f64 {
        let film = LiquidFilm::new(N_WATER, 1.5);
        let params = PorousParams { alpha_poro, s_p: 0.05, m: 0.3, k_w: 0.9, sqrt_k: false };
        let terms = hnat_terms(params, 0.04, 0.4, 1.0, 1.0, 0.0, 0.0, tau);
        terms.kd_wet - film_darkening(0.4, alpha_poro, terms.g, film.x, film.p, coverage)
    }

    #[test]
    fn its_ends_are_the_two_models() {
        let film = LiquidFilm::new(N_WATER, 1.5);
        // All solid: a film alone. All pores: nothing is left to cover.
        assert!((blended(0.0, 1.0, 1.0) - wet_diffuse(0.4, film.x, film.p)).abs() < 1e-12);
        assert_eq!(blended(1.0, 1.0, 1.0), blended(1.0, 0.0, 1.0));
        // No film: pores alone.
        let params = PorousParams { alpha_poro: 0.4, s_p: 0.05, m: 0.3, k_w: 0.9, sqrt_k: false };
        assert_eq!(blended(0.4, 0.0, 0.7), hnat_terms(params, 0.04, 0.4, 1.0, 1.0, 0.0, 0.0, 0.7).kd_wet);
    }

    #[test]
    fn each_part_is_darkened_once() {
        // Never darker than the film makes the solid, where pores keep a share of the light they get.
        let film = LiquidFilm::new(N_WATER, 1.5);
        for alpha_poro in [0.0, 0.2, 0.5, 0.9] {
            let floor = (1.0 - alpha_poro) * wet_diffuse(0.4, film.x, film.p);
            assert!(blended(alpha_poro, 1.0, 1.0) >= floor - 1e-12, "{alpha_poro}");
            for coverage in [0.0, 0.5] {
                assert!(blended(alpha_poro, coverage, 1.0) >= blended(alpha_poro, 1.0, 1.0));
            }
        }
    }
}
