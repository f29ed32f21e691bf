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
