//! Porous reflectance and its wet extension: a post-process over any base BRDF that splits into a diffuse and
//! a specular part.
//!
//! A porous surface is a solid with holes in it. A fraction `alpha_poro` of the area is pore mouth, of which
//! the microfacets around it leave the part `G` visible. Light that falls on the solid meets the base BRDF.
//! Light that enters a pore bounces about `nb` times, loses the part `ka` at each bounce, and what comes out
//! again is diffuse. Water fills the pores from the fraction `tau = 0` to `tau = 1`: a filled pore gives back
//! no diffuse light, its mouth is a small mirror of water. So a wet surface is darker and shinier, and how
//! much so follows from its pores.
//!
//! Colours are handled one channel at a time; the specular coefficient is one number for all channels. Each
//! function has a twin of the same name in `shaders/common/hnat.wgsl`, where the diffuse terms are RGB.
//!
//! Not here: the base BRDF, the Fresnel term and the shape of the water lobe, a water film above the surface,
//! and when a texel gets wet.
//!
//! - Hnat, Porquet, Mérillou, Ghazanfarpour 2006, *Real-time wetting of porous media*.
//! - Mérillou, Dischler, Ghazanfarpour 2000, the dry porous post-process that the former extends.
//! - Schlick 1994, *An inexpensive BRDF model for physically-based rendering*, for the masking term.

use std::f64::consts::{FRAC_PI_2, PI};

/// What the pores of a material look like; the material's colours are not part of it.
///
/// `alpha_poro = 0` is a solid without pores, for which every term equals the base BRDF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PorousParams {
    /// Surface porosity: area of the pore mouths over area of the surface. No unit, in `[0, 1]`. Visible
    /// wetting needs about 0.3 to 0.5. Mérillou et al. 2000.
    pub alpha_poro: f64,
    /// Pore size `sp`: how deep and closed the pores are, which sets how often light bounces in them. No
    /// unit, in `(0, 1]`. Pores above about 0.15 are nearly black when dry, so wetting them shows little.
    /// Mérillou et al. 2000.
    pub s_p: f64,
    /// Root-mean-square slope of the microfacets around the pores. No unit, from 0 for smooth to about 1.
    /// Schlick 1994.
    pub m: f64,
    /// Strength `kw` of the water lobe of a full pore, before its Fresnel term. No unit, in `[0, 1]`; above 1
    /// a white wet surface would reflect more light than it gets. Hnat et al. 2006.
    pub k_w: f64,
    /// `true` for the square-root form of the masking constant, see [`smith_k`].
    pub sqrt_k: bool,
}

/// Everything a light loop needs from one point, one pair of directions and one colour channel. No units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HnatTerms {
    /// Number of bounces in a pore, see [`bounces`].
    pub nb: f64,
    /// Light lost in a pore `A`, see [`pore_loss`].
    pub a: f64,
    /// Masking and shadowing `G`, see [`masking`].
    pub g: f64,
    /// Specular coefficient when dry, see [`porous_ks`].
    pub ks_dry: f64,
    /// Diffuse coefficient when dry, see [`porous_kd`].
    pub kd_dry: f64,
    /// Total specular coefficient when wet, see [`wet_ks`]: the base lobe at `ks_dry` plus the water lobe.
    pub ks_wet: f64,
    /// Diffuse coefficient when wet, see [`wet_kd`].
    pub kd_wet: f64,
    /// Strength of the separate water lobe, see [`water_lobe`].
    pub water: f64,
}

/// Part of the light that the solid absorbs at one bounce, `ka = clamp(1 - ks - kd, 0, 1)`.
///
/// `ks` and `kd` are the specular and diffuse coefficients of the solid, each in `[0, 1]`; a sum above 1
/// counts as no absorption. Hnat et al. 2006.
pub fn absorption(ks: f64, kd: f64) -> f64 {
    (1.0 - ks - kd).clamp(0.0, 1.0)
}

/// Constant of the masking term, `k = 2 m² / π` as printed by Hnat et al. 2006, or `k = sqrt(2 m² / π)` as in
/// Schlick 1994 when `sqrt_k` is set.
///
/// `m` is the root-mean-square slope, any real number; its sign does not matter.
pub fn smith_k(m: f64, sqrt_k: bool) -> f64 {
    let k = 2.0 * m * m / PI;
    if sqrt_k { k.sqrt() } else { k }
}

/// Part of the surface that one direction sees, `G1(c) = c / (c - k c + k)`.
///
/// `c` is the cosine to the normal, clamped to `[0, 1]`; `k >= 0` comes from [`smith_k`]. A direction at or
/// below the horizon sees nothing, which also settles the 0/0 of a smooth surface seen edge-on. Schlick 1994.
pub fn smith_g_one(c: f64, k: f64) -> f64 {
    let c = c.clamp(0.0, 1.0);
    if c <= 0.0 { 0.0 } else { c / (c - k * c + k) }
}

/// Masking and shadowing, `G = G1(N·S) G1(N·V)`, in `[0, 1]`.
///
/// `n_dot_s` and `n_dot_v` are the cosines of the light and of the viewer, clamped to `[0, 1]`; `k >= 0`
/// comes from [`smith_k`]. Schlick 1994.
pub fn masking(n_dot_s: f64, n_dot_v: f64, k: f64) -> f64 {
    smith_g_one(n_dot_s, k) * smith_g_one(n_dot_v, k)
}

/// Mean number of bounces in a pore, `nb = sp (3.7 - (θi + θr) + 4π / (sp + 6))`.
///
/// `s_p` is the pore size, in `(0, 1]`, negative values count as 0. `theta_i` and `theta_r` are the angles of
/// the light and of the viewer to the normal in radians, clamped to `[0, π/2]`. Hnat et al. 2006.
pub fn bounces(s_p: f64, theta_i: f64, theta_r: f64) -> f64 {
    let s_p = s_p.max(0.0);
    let angles = theta_i.clamp(0.0, FRAC_PI_2) + theta_r.clamp(0.0, FRAC_PI_2);
    s_p * (3.7 - angles + 4.0 * PI / (s_p + 6.0))
}

/// Part of the light that enters a pore and is lost there, `A = 1 - (1 - ka)^nb`, in `[0, 1]`.
///
/// `ka` is the absorption per bounce, in `[0, 1]`; `nb >= 0` the number of bounces. No bounce loses nothing,
/// even in a black pore. The series that Hnat et al. 2006 print is geometric and sums to this.
pub fn pore_loss(ka: f64, nb: f64) -> f64 {
    if nb <= 0.0 { 0.0 } else { 1.0 - (1.0 - ka).powf(nb) }
}

/// Specular coefficient of the dry porous surface, `ks' = ks (1 - α G)`: pore mouths have no highlight.
///
/// `ks` is the coefficient of the solid, `alpha_poro` the porosity, `g` the masking term, all in `[0, 1]`.
/// Mérillou et al. 2000.
pub fn porous_ks(ks: f64, alpha_poro: f64, g: f64) -> f64 {
    ks * (1.0 - alpha_poro * g)
}

/// Diffuse coefficient of the dry porous surface, `kd' = kd (1 - α G A) + ks α G (1 - A)`: what leaves a pore
/// is diffuse, whichever way it was reflected inside.
///
/// `ks` and `kd` are the coefficients of the solid, `alpha_poro` the porosity, `g` the masking term, `a` the
/// loss from [`pore_loss`], all in `[0, 1]`. Mérillou et al. 2000.
pub fn porous_kd(ks: f64, kd: f64, alpha_poro: f64, g: f64, a: f64) -> f64 {
    kd * (1.0 - alpha_poro * g * a) + ks * alpha_poro * g * (1.0 - a)
}

/// Fraction of the pores that is full of water, `τ = clamp((t - t0) / t_fill, 0, 1)`.
///
/// `t` is the time, `t_start` the `t0` when the first drop enters, `t_fill` how long filling takes, all in
/// one unit of time. A `t_fill` of 0 or less is a step at `t >= t0`. Hnat et al. 2006.
pub fn wet_tau(t: f64, t_start: f64, t_fill: f64) -> f64 {
    if t_fill <= 0.0 {
        return if t >= t_start { 1.0 } else { 0.0 };
    }
    ((t - t_start) / t_fill).clamp(0.0, 1.0)
}

/// Diffuse coefficient of the wet porous surface, `kd_w = kd (1 - α G) + α G (kd + ks)(1 - A)(1 - τ)`.
///
/// `ks` and `kd` are the coefficients of the solid, `alpha_poro` the porosity, `g` the masking term, `a` the
/// loss from [`pore_loss`], `tau` the fill from [`wet_tau`], all in `[0, 1]`. It falls as `tau` grows, and at
/// `tau = 0` equals [`porous_kd`]. Hnat et al. 2006.
pub fn wet_kd(ks: f64, kd: f64, alpha_poro: f64, g: f64, a: f64, tau: f64) -> f64 {
    let mouth = alpha_poro * g;
    kd * (1.0 - mouth) + mouth * (kd + ks) * (1.0 - a) * (1.0 - tau)
}

/// Strength of the water lobe, `kw α G τ`: the mirror of the filled pore mouths, before its Fresnel term.
///
/// `alpha_poro` is the porosity, `g` the masking term, `k_w` the strength of a full pore, `tau` the fill from
/// [`wet_tau`], all in `[0, 1]`. It is a lobe of its own, much narrower than the one of the base BRDF. Hnat
/// et al. 2006.
pub fn water_lobe(alpha_poro: f64, g: f64, k_w: f64, tau: f64) -> f64 {
    k_w * alpha_poro * g * tau
}

/// Total specular coefficient of the wet porous surface, `ks_w = ks (1 - α G) + kw α G τ`, the sum of
/// [`porous_ks`] and [`water_lobe`].
///
/// It serves energy balances. Shading needs the two parts apart, because their lobes differ. Arguments as for
/// the two parts. Hnat et al. 2006.
pub fn wet_ks(ks: f64, alpha_poro: f64, g: f64, k_w: f64, tau: f64) -> f64 {
    porous_ks(ks, alpha_poro, g) + water_lobe(alpha_poro, g, k_w, tau)
}

/// All terms for one point, one pair of directions and one colour channel.
///
/// `ks` and `kd` are the coefficients of the solid, in `[0, 1]`; `n_dot_s`, `n_dot_v` the cosines and
/// `theta_i`, `theta_r` the angles in radians of the light and of the viewer to the normal, clamped to
/// `[0, 1]` and `[0, π/2]`; `tau` the fill from [`wet_tau`], in `[0, 1]`. Hnat et al. 2006.
#[expect(clippy::too_many_arguments, reason = "the same flat list as in the WGSL twin")]
pub fn hnat_terms(
    params: PorousParams,
    ks: f64,
    kd: f64,
    n_dot_s: f64,
    n_dot_v: f64,
    theta_i: f64,
    theta_r: f64,
    tau: f64,
) -> HnatTerms {
    let nb = bounces(params.s_p, theta_i, theta_r);
    let a = pore_loss(absorption(ks, kd), nb);
    let g = masking(n_dot_s, n_dot_v, smith_k(params.m, params.sqrt_k));
    HnatTerms {
        nb,
        a,
        g,
        ks_dry: porous_ks(ks, params.alpha_poro, g),
        kd_dry: porous_kd(ks, kd, params.alpha_poro, g, a),
        ks_wet: wet_ks(ks, params.alpha_poro, g, params.k_w, tau),
        kd_wet: wet_kd(ks, kd, params.alpha_poro, g, a, tau),
        water: water_lobe(params.alpha_poro, g, params.k_w, tau),
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_3, FRAC_PI_4, FRAC_PI_6, FRAC_PI_8};

    use super::*;

    /// Terms for directions given by their angles alone.
    fn terms(params: PorousParams, ks: f64, kd: f64, theta_i: f64, theta_r: f64, tau: f64) -> HnatTerms {
        hnat_terms(params, ks, kd, theta_i.cos(), theta_r.cos(), theta_i, theta_r, tau)
    }

    fn assert_close(actual: f64, expected: f64, tolerance: f64, what: &str) {
        let error = (actual - expected).abs();
        assert!(error <= tolerance, "{what}: {actual} instead of {expected}, off by {error:e}");
    }

    /// Calls `check` with every combination of ordinary and extreme materials, angles and fills.
    fn for_each_case(mut check: impl FnMut(PorousParams, f64, f64, f64, f64, f64)) {
        const ANGLES: [f64; 3] = [0.0, 0.7, FRAC_PI_2];
        let colours = [(0.0, 0.0), (0.04, 0.3), (0.3, 0.1), (0.4, 0.6), (1.0, 0.0), (0.0, 1.0)];
        for alpha_poro in [0.0, 0.3, 1.0] {
            for s_p in [1e-12, 0.02, 0.5, 1.0] {
                for (m, sqrt_k) in [(0.0, false), (0.3, false), (0.3, true), (1.0, true)] {
                    let params = PorousParams { alpha_poro, s_p, m, k_w: 0.9, sqrt_k };
                    for (ks, kd) in colours {
                        for theta_i in ANGLES {
                            for theta_r in ANGLES {
                                for tau in [0.0, 0.4, 1.0] {
                                    check(params, ks, kd, theta_i, theta_r, tau);
                                }
                            }
                        }
                    }
                }
            }
        }
    }

    /// One line of the reference table, computed independently in double precision.
    struct Vector {
        name: &'static str,
        ks: f64,
        kd: f64,
        params: PorousParams,
        theta_i: f64,
        theta_r: f64,
        tau: f64,
        /// `nb`, `A`, `G`, `ks'`, `kd'`, `ks_w`, `kd_w`.
        expected: [f64; 7],
    }

    #[test]
    fn matches_the_reference_vectors() {
        let small = PorousParams { alpha_poro: 0.3, s_p: 0.5, m: 0.3, k_w: 0.02, sqrt_k: false };
        let large = PorousParams { alpha_poro: 0.4, s_p: 0.8, m: 0.5, k_w: 0.9, sqrt_k: false };
        let first = Vector {
            name: "1, dry",
            ks: 0.04,
            kd: 0.30,
            params: small,
            theta_i: 0.0,
            theta_r: 0.0,
            tau: 0.0,
            expected: [2.816643893412, 0.952099179480, 1.0, 0.028, 0.214885883693, 0.028, 0.214885883693],
        };
        let dry = first.expected;
        let fourth = Vector {
            name: "4, printed k",
            ks: 0.10,
            kd: 0.50,
            params: large,
            theta_i: FRAC_PI_6,
            theta_r: FRAC_PI_4,
            tau: 0.25,
            expected: [
                3.391198991669,
                0.823124881432,
                0.915609522072,
                0.063375619117,
                0.355745745852,
                0.145780476104,
                0.346028833286,
            ],
        };
        let vectors = [
            Vector {
                name: "2, half full",
                tau: 0.5,
                expected: [dry[0], dry[1], dry[2], dry[3], dry[4], 0.031, 0.212442941847],
                ..first
            },
            Vector {
                name: "3, full",
                tau: 1.0,
                expected: [dry[0], dry[1], dry[2], dry[3], dry[4], 0.034, 0.21],
                ..first
            },
            Vector {
                name: "4, square-root k",
                params: PorousParams { sqrt_k: true, ..large },
                expected: [
                    fourth.expected[0],
                    fourth.expected[1],
                    0.808301327033,
                    0.067667946919,
                    0.372652148927,
                    0.140415066352,
                    0.364074045344,
                ],
                ..fourth
            },
            Vector {
                name: "5, oblique",
                theta_i: FRAC_PI_3,
                theta_r: FRAC_PI_3,
                tau: 0.75,
                expected: [
                    2.762880460951,
                    0.756186120783,
                    0.744246870052,
                    0.070230125198,
                    0.394700477945,
                    0.271176780112,
                    0.362038088979,
                ],
                ..fourth
            },
            Vector {
                name: "6, rough",
                ks: 0.05,
                kd: 0.12,
                params: PorousParams { alpha_poro: 0.15, s_p: 0.3, m: 0.8, k_w: 0.02, sqrt_k: false },
                theta_i: FRAC_PI_4,
                theta_r: FRAC_PI_8,
                tau: 0.6,
                expected: [
                    1.354969427155,
                    0.909367947401,
                    0.827814027577,
                    0.043791394793,
                    0.107012522858,
                    0.045281460043,
                    0.105864617645,
                ],
            },
            first,
            fourth,
        ];
        for vector in vectors {
            let Vector { name, ks, kd, params, theta_i, theta_r, tau, expected } = vector;
            let t = terms(params, ks, kd, theta_i, theta_r, tau);
            let actual = [t.nb, t.a, t.g, t.ks_dry, t.kd_dry, t.ks_wet, t.kd_wet];
            let columns = ["nb", "A", "G", "ks'", "kd'", "ks_w", "kd_w"];
            for (column, (actual, expected)) in columns.into_iter().zip(actual.into_iter().zip(expected)) {
                assert_close(actual, expected, 1e-9, &format!("vector {name}, {column}"));
            }
        }
    }

    #[test]
    fn pores_always_bounce() {
        for s_p in [1e-12, 1e-3, 0.1, 0.5, 1.0] {
            for theta_i in [0.0, 0.8, FRAC_PI_2] {
                for theta_r in [0.0, 0.8, FRAC_PI_2] {
                    assert!(bounces(s_p, theta_i, theta_r) > 0.0, "s_p {s_p}, angles {theta_i}, {theta_r}");
                }
            }
        }
        assert_eq!(bounces(0.0, 0.0, 0.0), 0.0);
        assert_eq!(bounces(-6.0, 0.0, 0.0), 0.0);
    }

    #[test]
    fn light_and_viewer_may_be_exchanged() {
        for_each_case(|params, ks, kd, theta_i, theta_r, tau| {
            assert_eq!(
                terms(params, ks, kd, theta_i, theta_r, tau),
                terms(params, ks, kd, theta_r, theta_i, tau)
            );
        });
    }

    #[test]
    fn dry_pores_take_away_only_what_they_absorb() {
        for_each_case(|params, ks, kd, theta_i, theta_r, tau| {
            let t = terms(params, ks, kd, theta_i, theta_r, tau);
            let expected = (ks + kd) * (1.0 - params.alpha_poro * t.g * t.a);
            assert_close(t.ks_dry + t.kd_dry, expected, 1e-12, "ks' + kd'");
        });
    }

    #[test]
    fn an_empty_pore_is_a_dry_pore() {
        for_each_case(|params, ks, kd, theta_i, theta_r, _| {
            let t = terms(params, ks, kd, theta_i, theta_r, 0.0);
            assert_close(t.kd_wet, t.kd_dry, 1e-12, "kd_w at tau 0");
            assert_eq!(t.ks_wet, t.ks_dry);
            assert_eq!(t.water, 0.0);
        });
    }

    #[test]
    fn the_water_lobe_is_the_whole_wet_highlight_beyond_the_dry_one() {
        for_each_case(|params, ks, kd, theta_i, theta_r, tau| {
            let t = terms(params, ks, kd, theta_i, theta_r, tau);
            assert_eq!(t.ks_wet, t.ks_dry + t.water);
        });
    }

    #[test]
    fn a_wet_surface_reflects_too_much_only_above_unit_k_w() {
        let wet_sum = |k_w, tau| {
            let params = PorousParams { alpha_poro: 0.4, s_p: 0.1, m: 0.3, k_w, sqrt_k: false };
            let t = terms(params, 0.3, 0.7, 0.4, 0.9, tau);
            t.ks_wet + t.kd_wet
        };
        for tau in [0.1, 0.5, 1.0] {
            assert!(wet_sum(0.5, tau) < 1.0);
            assert_close(wet_sum(1.0, tau), 1.0, 1e-12, "wet sum of a white solid");
            assert!(wet_sum(1.01, tau) > 1.0);
        }
        for_each_case(|params, ks, kd, theta_i, theta_r, tau| {
            let t = terms(PorousParams { k_w: 1.0, ..params }, ks, kd, theta_i, theta_r, tau);
            assert!(t.ks_wet + t.kd_wet <= 1.0 + 1e-12, "{params:?} ks {ks} kd {kd} tau {tau}: {t:?}");
        });
    }

    #[test]
    fn no_pores_leave_the_base_untouched() {
        for_each_case(|params, ks, kd, theta_i, theta_r, tau| {
            let t = terms(PorousParams { alpha_poro: 0.0, ..params }, ks, kd, theta_i, theta_r, tau);
            assert_eq!([t.ks_dry, t.kd_dry, t.ks_wet, t.kd_wet, t.water], [ks, kd, ks, kd, 0.0]);
        });
    }

    #[test]
    fn water_darkens_and_more_water_darkens_more() {
        for_each_case(|params, ks, kd, theta_i, theta_r, _| {
            let mut last = terms(params, ks, kd, theta_i, theta_r, 0.0).kd_dry;
            for step in 0..=8 {
                let kd_wet = terms(params, ks, kd, theta_i, theta_r, f64::from(step) / 8.0).kd_wet;
                assert!(kd_wet <= last + 1e-15, "{params:?} ks {ks} kd {kd}: {kd_wet} after {last}");
                last = kd_wet;
            }
        });
        let brick = PorousParams { alpha_poro: 0.3, s_p: 0.1, m: 0.4, k_w: 0.9, sqrt_k: false };
        let kd_wet = |tau| terms(brick, 0.04, 0.3, 0.3, 0.6, tau).kd_wet;
        assert!(kd_wet(1.0) < kd_wet(0.5) && kd_wet(0.5) < kd_wet(0.0));
    }

    #[test]
    fn large_pores_hide_the_wetting() {
        for (s_p, expected) in [(0.02, 0.50), (0.1, 0.62), (0.2, 0.75), (0.5, 0.95)] {
            let params = PorousParams { alpha_poro: 0.5, s_p, m: 0.3, k_w: 0.02, sqrt_k: false };
            let t = terms(params, 0.04, 0.30, 0.0, 0.0, 1.0);
            assert_close(t.kd_wet / t.kd_dry, expected, 0.005, &format!("wet over dry at s_p {s_p}"));
        }
    }

    #[test]
    fn degenerate_input_stays_finite() {
        for_each_case(|params, ks, kd, theta_i, theta_r, tau| {
            let t = terms(params, ks, kd, theta_i, theta_r, tau);
            let all = [t.nb, t.a, t.g, t.ks_dry, t.kd_dry, t.ks_wet, t.kd_wet, t.water];
            assert!(all.iter().all(|x| x.is_finite() && *x >= 0.0), "{params:?} ks {ks} kd {kd}: {t:?}");
            assert!(t.a <= 1.0 && t.g <= 1.0, "{t:?}");
        });
        assert_eq!(smith_g_one(0.0, 0.0), 0.0);
        assert_eq!(smith_g_one(1e-300, 0.0), 1.0);
        assert_eq!(smith_g_one(1.0, 0.7), 1.0);
        assert_eq!(pore_loss(1.0, 0.0), 0.0);
        assert_eq!(pore_loss(1.0, 1e-12), 1.0);
        assert_eq!(pore_loss(0.0, 5.0), 0.0);
    }

    #[test]
    fn arguments_out_of_range_are_clamped() {
        assert_eq!(absorption(0.8, 0.9), 0.0);
        assert_eq!(absorption(0.0, 0.0), 1.0);
        assert_eq!(masking(1.5, 0.5, 0.2), masking(1.0, 0.5, 0.2));
        assert_eq!(masking(0.5, -0.5, 0.2), 0.0);
        assert_eq!(bounces(0.5, -1.0, 9.0), bounces(0.5, 0.0, FRAC_PI_2));
    }

    #[test]
    fn filling_takes_t_fill() {
        assert_eq!(wet_tau(0.2, 0.3, 0.4), 0.0);
        assert_eq!(wet_tau(0.5, 0.25, 0.5), 0.5);
        assert_eq!(wet_tau(2.0, 0.3, 0.4), 1.0);
        for step in [0.0, -1.0] {
            assert_eq!(wet_tau(0.29, 0.3, step), 0.0);
            assert_eq!(wet_tau(0.3, 0.3, step), 1.0);
        }
    }
}
