//! What holds for [`hnat`](super::hnat), and its reference vectors.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_4, FRAC_PI_6, FRAC_PI_8};

use super::hnat::*;

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
