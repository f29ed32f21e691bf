#define_import_path bevy_weathering::hnat

// Porous reflectance and its wet extension, a post-process over any base BRDF that splits into a diffuse and
// a specular part. Each function has a double-precision twin of the same name in `material::hnat`, where the
// story is told; diffuse terms are RGB here, the specular coefficient is one number.
//
// No name here ends in a digit, because the composer writes modules back to text and renames those.
//
// Hnat, Porquet, Merillou, Ghazanfarpour 2006, "Real-time wetting of porous media".
// Merillou, Dischler, Ghazanfarpour 2000, the dry porous post-process.
// Schlick 1994, "An inexpensive BRDF model for physically-based rendering", for the masking term.

const HNAT_PI: f32 = 3.14159265358979;
const HNAT_HALF_PI: f32 = 1.57079632679490;

// What the pores of a material look like. A function argument, not a layout shared with the host.
struct PorousParams {
    // Surface porosity: area of the pore mouths over area of the surface. No unit, in [0, 1].
    alpha_poro: f32,
    // Pore size sp. No unit, in (0, 1].
    s_p: f32,
    // Root-mean-square slope of the microfacets around the pores. No unit, from 0 to about 1.
    m: f32,
    // Strength kw of the water lobe of a full pore, before its Fresnel term. No unit, in [0, 1].
    k_w: f32,
    // 0 for the printed masking constant, otherwise its square-root form, see `smith_k`.
    sqrt_k: u32,
}

// Everything a light loop needs from one point and one pair of directions. No units.
struct HnatTerms {
    // Diffuse coefficient when dry, see `porous_kd`.
    kd_dry: vec3<f32>,
    // Diffuse coefficient when wet, see `wet_kd`.
    kd_wet: vec3<f32>,
    // Specular coefficient when dry, see `porous_ks`.
    ks_dry: f32,
    // Total specular coefficient when wet, see `wet_ks`: the base lobe at `ks_dry` plus the water lobe.
    ks_wet: f32,
    // Strength of the separate water lobe, see `water_lobe`.
    water: f32,
    // Masking and shadowing G, see `masking`.
    g: f32,
    // Number of bounces in a pore, see `bounces`.
    nb: f32,
    // Light lost in a pore A, see `pore_loss`.
    a: vec3<f32>,
}

// Part of the light that the solid absorbs at one bounce, ka = clamp(1 - ks - kd, 0, 1).
// ks, kd: coefficients of the solid, in [0, 1].
fn absorption(ks: f32, kd: vec3<f32>) -> vec3<f32> {
    return saturate(1.0 - ks - kd);
}

// Constant of the masking term, k = 2 m^2 / pi as printed, or its square root as in Schlick 1994.
// m: root-mean-square slope, any real number.
fn smith_k(m: f32, sqrt_k: u32) -> f32 {
    let k = 2.0 * m * m / HNAT_PI;
    return select(k, sqrt(k), sqrt_k != 0u);
}

// Part of the surface that one direction sees, G1(c) = c / (c - k c + k).
// c: cosine to the normal, clamped to [0, 1]; k >= 0. At or below the horizon it is 0, which also settles the
// 0/0 of a smooth surface seen edge-on.
fn smith_g_one(c: f32, k: f32) -> f32 {
    let cosine = saturate(c);
    if cosine <= 0.0 {
        return 0.0;
    }
    return cosine / (cosine - k * cosine + k);
}

// Masking and shadowing, G = G1(N.S) G1(N.V), in [0, 1].
// n_dot_s, n_dot_v: cosines of the light and of the viewer, clamped to [0, 1]; k from `smith_k`.
fn masking(n_dot_s: f32, n_dot_v: f32, k: f32) -> f32 {
    return smith_g_one(n_dot_s, k) * smith_g_one(n_dot_v, k);
}

// Mean number of bounces in a pore, nb = sp (3.7 - (ti + tr) + 4 pi / (sp + 6)).
// s_p: pore size, in (0, 1], negative values count as 0; theta_i, theta_r: angles of the light and of the
// viewer to the normal in radians, clamped to [0, pi/2].
fn bounces(s_p: f32, theta_i: f32, theta_r: f32) -> f32 {
    let size = max(s_p, 0.0);
    let angles = clamp(theta_i, 0.0, HNAT_HALF_PI) + clamp(theta_r, 0.0, HNAT_HALF_PI);
    return size * (3.7 - angles + 4.0 * HNAT_PI / (size + 6.0));
}

// Part of the light that enters a pore and is lost there, A = 1 - (1 - ka)^nb, in [0, 1].
// ka: absorption per bounce, in [0, 1]; nb >= 0: number of bounces. A black solid is kept out of pow,
// whose result need not be exact at 0; the loss is clamped, because pow(1, x) may miss 1 by a rounding step.
fn pore_loss(ka: vec3<f32>, nb: f32) -> vec3<f32> {
    if nb <= 0.0 {
        return vec3<f32>(0.0);
    }
    let kept = 1.0 - ka;
    let black = kept <= vec3<f32>(0.0);
    let power = pow(select(kept, vec3<f32>(1.0), black), vec3<f32>(nb));
    return saturate(1.0 - select(power, vec3<f32>(0.0), black));
}

// Specular coefficient of the dry porous surface, ks' = ks (1 - alpha G): pore mouths have no highlight.
// All arguments in [0, 1].
fn porous_ks(ks: f32, alpha_poro: f32, g: f32) -> f32 {
    return ks * (1.0 - alpha_poro * g);
}

// Diffuse coefficient of the dry porous surface, kd' = kd (1 - alpha G A) + ks alpha G (1 - A).
// a: loss from `pore_loss`. All arguments in [0, 1].
fn porous_kd(ks: f32, kd: vec3<f32>, alpha_poro: f32, g: f32, a: vec3<f32>) -> vec3<f32> {
    return kd * (1.0 - alpha_poro * g * a) + ks * alpha_poro * g * (1.0 - a);
}

// Fraction of the pores that is full of water, tau = clamp((t - t0) / t_fill, 0, 1).
// t: time; t_start: the t0 when the first drop enters; t_fill: how long filling takes; all in one unit of
// time. A t_fill of 0 or less is a step at t >= t0.
fn wet_tau(t: f32, t_start: f32, t_fill: f32) -> f32 {
    if t_fill <= 0.0 {
        return select(0.0, 1.0, t >= t_start);
    }
    return saturate((t - t_start) / t_fill);
}

// Diffuse coefficient of the wet porous surface,
// kd_w = kd (1 - alpha G) + alpha G (kd + ks)(1 - A)(1 - tau).
// a: loss from `pore_loss`; tau: fill from `wet_tau`. All arguments in [0, 1].
fn wet_kd(ks: f32, kd: vec3<f32>, alpha_poro: f32, g: f32, a: vec3<f32>, tau: f32) -> vec3<f32> {
    let mouth = alpha_poro * g;
    return kd * (1.0 - mouth) + mouth * (kd + ks) * (1.0 - a) * (1.0 - tau);
}

// Strength of the water lobe, kw alpha G tau: the mirror of the filled pore mouths, before its Fresnel term.
// A lobe of its own, much narrower than the one of the base BRDF. All arguments in [0, 1].
fn water_lobe(alpha_poro: f32, g: f32, k_w: f32, tau: f32) -> f32 {
    return k_w * alpha_poro * g * tau;
}

// Total specular coefficient of the wet porous surface, ks_w = ks (1 - alpha G) + kw alpha G tau.
// For energy balances; shading needs `porous_ks` and `water_lobe` apart, because their lobes differ.
fn wet_ks(ks: f32, alpha_poro: f32, g: f32, k_w: f32, tau: f32) -> f32 {
    return porous_ks(ks, alpha_poro, g) + water_lobe(alpha_poro, g, k_w, tau);
}

// All terms for one point and one pair of directions.
// ks, kd: coefficients of the solid, in [0, 1]; n_dot_s, n_dot_v: cosines, and theta_i, theta_r: angles in
// radians of the light and of the viewer to the normal, clamped to [0, 1] and [0, pi/2]; tau in [0, 1].
fn hnat_terms(
    params: PorousParams,
    ks: f32,
    kd: vec3<f32>,
    n_dot_s: f32,
    n_dot_v: f32,
    theta_i: f32,
    theta_r: f32,
    tau: f32,
) -> HnatTerms {
    let nb = bounces(params.s_p, theta_i, theta_r);
    let a = pore_loss(absorption(ks, kd), nb);
    let g = masking(n_dot_s, n_dot_v, smith_k(params.m, params.sqrt_k));

    var terms: HnatTerms;
    terms.kd_dry = porous_kd(ks, kd, params.alpha_poro, g, a);
    terms.kd_wet = wet_kd(ks, kd, params.alpha_poro, g, a, tau);
    terms.ks_dry = porous_ks(ks, params.alpha_poro, g);
    terms.ks_wet = wet_ks(ks, params.alpha_poro, g, params.k_w, tau);
    terms.water = water_lobe(params.alpha_poro, g, params.k_w, tau);
    terms.g = g;
    terms.nb = nb;
    terms.a = a;
    return terms;
}
