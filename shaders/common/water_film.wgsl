#define_import_path bevy_weathering::water_film

// Water as a layer of its own above any model. Each function has a double-precision twin of the same name in
// `material::film::layer`, where the story is told. Depths in mm, the rest without unit.
//
// Schlick 1994, "An inexpensive BRDF model for physically-based rendering". Lagarde 2013, "Water drop 2b" and "3b".

// Reflectance of water at normal incidence.
const WATER_REFLECTANCE: f32 = 0.02;
// Refractive index of water.
const N_WATER: f32 = 1.33;
// Depth of water that covers all but 1/e of a rough surface.
const COVERAGE_MM: f32 = 0.05;

// Fresnel's reflectance in Schlick's approximation. reflectance at normal incidence; cosine to the normal or to the
// half vector, clamped to [0, 1].
fn fresnel(reflectance: f32, cosine: f32) -> f32 {
    let slant = 1.0 - saturate(cosine);
    let square = slant * slant;
    return reflectance + (1.0 - reflectance) * (square * square * slant);
}

// Mean of `fresnel` over the hemisphere, weighted by the cosine: F0 + (1 - F0) / 21.
fn mean_fresnel(reflectance: f32) -> f32 {
    return reflectance + (1.0 - reflectance) / 21.0;
}

// Reflectance at normal incidence of matter under water, from that in air, n = (1 + sqrt F0) / (1 - sqrt F0),
// ((n - 1.33) / (n + 1.33))^2. reflectance in [0, 1], of a dielectric.
fn reflectance_under_water(reflectance: vec3<f32>) -> vec3<f32> {
    let root = sqrt(saturate(reflectance));
    let above = 1.0 + root;
    let below = N_WATER * (1.0 - root);
    let under = (above - below) / (above + below);
    return under * under;
}

// Part of a point that water covers, 1 - exp(-h / 0.05 mm).
fn film_coverage(film_mm: f32) -> f32 {
    return 1.0 - exp(-max(film_mm, 0.0) / COVERAGE_MM);
}

// How level the water lies, 1 - exp(-h / levelling): 0 follows the relief, 1 is flat. levelling_mm > 0.
fn film_levelness(film_mm: f32, levelling_mm: f32) -> f32 {
    return 1.0 - exp(-max(film_mm, 0.0) / levelling_mm);
}

// What gets through the water's surface at one cosine on the way in and another on the way out.
fn through(cos_in: f32, cos_out: f32) -> f32 {
    return (1.0 - fresnel(WATER_REFLECTANCE, cos_in)) * (1.0 - fresnel(WATER_REFLECTANCE, cos_out));
}

// What the water leaves of a highlight below it, 1 - c + c (1 - F)(1 - F). coverage: c, in [0, 1].
fn film_transmission(cos_in: f32, cos_out: f32, coverage: f32) -> f32 {
    return 1.0 - coverage + coverage * through(cos_in, cos_out);
}

// The same of diffuse light, 1 - c + c (1 - F)(1 - F) / (1 - mean F): of the light that got in, all comes out but for
// what the matter absorbs.
fn film_diffuse_transmission(cos_in: f32, cos_out: f32, coverage: f32) -> f32 {
    return 1.0 - coverage + coverage * through(cos_in, cos_out) / (1.0 - mean_fresnel(WATER_REFLECTANCE));
}

// Cosine below the water's surface of a direction above it (Snell).
fn refracted(cosine: f32) -> f32 {
    let above = saturate(cosine);
    return sqrt(1.0 - (1.0 - above * above) / (N_WATER * N_WATER));
}

// What murky water leaves on the way down and up, exp(-sigma h (1 / cos' + 1 / cos')); cosines are refracted.
// absorption_per_mm: sigma, per channel, at least 0.
fn murk(absorption_per_mm: vec3<f32>, film_mm: f32, cos_in: f32, cos_out: f32) -> vec3<f32> {
    return exp(-absorption_per_mm * film_mm * (1.0 / refracted(cos_in) + 1.0 / refracted(cos_out)));
}
