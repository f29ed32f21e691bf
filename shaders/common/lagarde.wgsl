#define_import_path bevy_weathering::lagarde

// Wet by tweaking parameters. Each function has a double-precision twin of the same name in
// `material::models::lagarde`, where the story is told. No units.
//
// Lagarde 2013, "Water drop 3b: physically based wet surfaces".

// Part of its albedo that fully porous matter keeps when wet.
const DARKEST: f32 = 0.2;
// Logarithm of the specular power at gloss 1.
const GLOSS_OCTAVES: f32 = 11.0;

// What soaked matter keeps of its albedo, f = lerp(1, 0.2, (1 - metalness) porosity). Both in [0, 1].
fn kept_albedo(porosity: f32, metalness: f32) -> f32 {
    return mix(1.0, DARKEST, (1.0 - metalness) * porosity);
}

// Albedo when wet by w, albedo lerp(1, f, w). f from `kept_albedo`; all in [0, 1].
fn wet_albedo(albedo: vec3<f32>, f: f32, w: f32) -> vec3<f32> {
    return albedo * mix(1.0, f, w);
}

// Gloss when wet by w, lerp(1, gloss, lerp(1, f, 0.5 w)). f from `kept_albedo`; all in [0, 1].
fn wet_gloss(gloss: f32, f: f32, w: f32) -> f32 {
    return mix(1.0, gloss, mix(1.0, f, 0.5 * w));
}

// Porosity of a surface known by its gloss alone: full up to .1, none from .5 on.
fn porosity_from_gloss(gloss: f32) -> f32 {
    return saturate(1.25 - 2.5 * gloss);
}

// Porosity where a mask, in [0, 1], says what may be porous at all.
fn porosity_from_mask(mask: f32, gloss: f32) -> f32 {
    return mask * porosity_from_gloss(gloss);
}

// Metalness of a specular colour: a step at a mean of about one half.
fn metalness_from_specular(specular: vec3<f32>) -> f32 {
    return saturate(1000.0 * 0.33 * (specular.r + specular.g + specular.b) - 500.0);
}

// Perceptual roughness of a gloss, (2 / (n + 2))^(1/4) with n = 2^(11 gloss).
fn roughness_from_gloss(gloss: f32) -> f32 {
    return sqrt(sqrt(2.0 / (exp2(GLOSS_OCTAVES * gloss) + 2.0)));
}

// Gloss of a perceptual roughness in [0, 1]: the inverse within its range, 0 and 1 outside.
fn gloss_from_roughness(roughness: f32) -> f32 {
    let square = max(roughness * roughness, 1e-4);
    let power = max(2.0 / (square * square) - 2.0, 1.0);
    return saturate(log2(power) / GLOSS_OCTAVES);
}

// Perceptual roughness when wet by w. What is smoother than any gloss can say stays as it is.
fn wet_roughness(roughness: f32, f: f32, w: f32) -> f32 {
    let gloss = gloss_from_roughness(roughness);
    let wet = wet_gloss(gloss, f, w);
    return select(min(roughness, roughness_from_gloss(wet)), roughness, wet <= gloss);
}
