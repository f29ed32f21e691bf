#define_import_path bevy_weathering::lekner_dorf

// Wet by a film of liquid over rough matter. Each function has a double-precision twin of the same name in
// `material::models::lekner_dorf`, where the story is told; p and x are computed there, once per material. No units.
//
// Lekner and Dorf 1988, "Why some things are darker when wet".

// Absorption of the matter under the liquid at one encounter, a = ad ((1 - ad) x + ad) with ad = 1 - albedo.
// albedo: of the dry matter, in [0, 1]; x: how much more gets in from the liquid than from air.
fn wet_absorption(albedo: vec3<f32>, x: f32) -> vec3<f32> {
    let dry = saturate(1.0 - albedo);
    return min(dry * ((1.0 - dry) * x + dry), vec3(1.0));
}

// Diffuse albedo of the wet matter, (1 - p) r / (1 - p r) with r = 1 - a, of the light that got into the film.
// p: internal reflection of the film, in [0, 1).
fn wet_diffuse(albedo: vec3<f32>, x: f32, p: f32) -> vec3<f32> {
    let r = 1.0 - wet_absorption(albedo, x);
    return (1.0 - p) * r / (1.0 - p * r);
}
