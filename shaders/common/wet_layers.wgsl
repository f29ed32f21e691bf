// The layers of a point that light falls on: matter with pores, and water in them and above it.
//
// For each light, `matter_coefficients` sets the coefficients of the base BRDF, `through_water` tells how much of the point
// mirrors and what the water leaves of the rest, and `add_water` puts both together.

#define_import_path bevy_weathering::wet_layers

#import bevy_pbr::{
    lighting,
    lighting::LAYER_BASE,
    pbr_types::PbrInput,
}
#import bevy_weathering::{
    film_on_pores::film_darkening,
    hnat::{PorousParams, hnat_terms},
    water_film::{
        fresnel, film_diffuse_transmission, film_transmission, murk, reflectance_under_water, WATER_REFLECTANCE,
    },
    wet_map::{porous, has_flag, FLAG_SOLID, FLAG_SQRT_K},
    wet_surface::Water,
}

const PI: f32 = 3.14159265358979;
// Perceptual roughness of water in pores, and of a film: nearly mirrors.
const PORE_ROUGHNESS: f32 = 0.12;
const FILM_ROUGHNESS: f32 = 0.089;
// How far water in pores levels out the normal of what it fills.
const PORE_LEVELLING: f32 = 0.6;
// Mean cosine of light that comes from everywhere.
const AMBIENT_COSINE: f32 = 0.6666667;

// What a point keeps for all lights.
struct Point {
    water: Water,
    // Colour of the matter, and its reflectance under the water that covers it.
    diffuse: vec3<f32>,
    reflectance: vec3<f32>,
    // Part of the point that is pores; 0 for models without.
    alpha_poro: f32,
    // The water's layer.
    surface: lighting::LayerLightingInput,
}

// What the water does with one light.
struct Through {
    // Strength of the mirror, 0..=1, before its Fresnel term.
    mirror: f32,
    // What is left of the base's reflection.
    base: vec3<f32>,
}

// The point as it is before any light. `normal`: of the water's surface where it is level.
fn point_from_pbr(in: PbrInput, input: lighting::LightingInput, water: Water, normal: vec3<f32>) -> Point {
    var point: Point;
    point.water = water;
    point.diffuse = input.diffuse_color;
    point.reflectance = mix(input.F0_dielectric, reflectance_under_water(input.F0_dielectric), water.coverage);
    var levelled = water.levelness;
#ifdef WEATHERED_PORES
    point.alpha_poro = porous.porosity * (1.0 - in.material.metallic);
    levelled = max(levelled, PORE_LEVELLING * water.gloss * (1.0 - water.coverage));
#endif
    point.surface.N = normalize(mix(in.N, normal, levelled));
    point.surface.R = reflect(-in.V, point.surface.N);
    point.surface.NdotV = max(dot(point.surface.N, in.V), 0.0001);
    let roughness = mix(PORE_ROUGHNESS, FILM_ROUGHNESS, water.coverage);
    point.surface.perceptual_roughness = roughness;
    point.surface.roughness = lighting::perceptualRoughnessToRoughness(roughness);
    return point;
}

// Sets the coefficients of the base BRDF for light at a cosine to the matter's normal; returns the strength of the
// mirror that the filled pores are.
fn matter_coefficients(point: Point, input: ptr<function, lighting::LightingInput>, n_dot_s: f32) -> f32 {
    (*input).diffuse_color = point.diffuse;
    (*input).F0_dielectric = point.reflectance;
#ifdef WEATHERED_PORES
    let n_dot_v = (*input).layers[LAYER_BASE].NdotV;
    let params = PorousParams(point.alpha_poro, porous.s_p, porous.m, porous.k_w, u32(has_flag(FLAG_SQRT_K)));
    let terms = hnat_terms(params, porous.k_s, point.diffuse, n_dot_s, n_dot_v,
        acos(clamp(n_dot_s, 0.0, 1.0)), acos(clamp(n_dot_v, 0.0, 1.0)), point.water.wetness);
    var kd = terms.kd_wet;
#ifdef WEATHERED_FILM_ON_PORES
    kd -= film_darkening(point.diffuse, point.alpha_poro, terms.g, porous.film_x, porous.film_p, point.water.coverage);
#endif
    if has_flag(FLAG_SOLID) {
        (*input).diffuse_color = kd;
        // k_s' / k_s, also where k_s is 0.
        (*input).F0_dielectric *= 1.0 - point.alpha_poro * terms.g;
    } else {
        (*input).diffuse_color *= kd / max(terms.kd_dry, vec3(1e-6));
    }
    // The mirror goes before the darkening; it grows evenly with what is filled.
    let mirror = terms.water * point.water.gloss / max(point.water.wetness, 1e-4);
    return mirror * (1.0 - point.water.coverage);
#else
    return 0.0;
#endif
}

// What the water does with light at a cosine to its surface, once the matter's coefficients are set.
fn through_water(point: Point, input: ptr<function, lighting::LightingInput>, pores: f32, water_dot_s: f32) -> Through {
    let coverage = point.water.coverage;
    let water_dot_v = point.surface.NdotV;
    let highlight = film_transmission(water_dot_s, water_dot_v, coverage);
    let spread = film_diffuse_transmission(water_dot_s, water_dot_v, coverage);
    // Bevy's functions return both parts in one sum: the diffuse one goes in with what it gets more.
    (*input).diffuse_color *= spread / max(highlight, 1e-6);
    let around_pores = 1.0 - pores * fresnel(WATER_REFLECTANCE, water_dot_v);
    return Through(coverage + pores, clearness(point, water_dot_s) * (highlight * around_pores));
}

// What murky water leaves of light at a cosine to its surface.
fn clearness(point: Point, water_dot_s: f32) -> vec3<f32> {
    let left = murk(porous.absorption_per_mm, point.water.film_mm, water_dot_s, point.surface.NdotV);
    return mix(vec3(1.0), left, point.water.coverage);
}

// Light of a direction that the water mirrors, for an irradiance of 1.
fn water_specular(point: Point, V: vec3<f32>, L: vec3<f32>) -> f32 {
    let N = point.surface.N;
    let H = normalize(L + V);
    let n_dot_l = saturate(dot(N, L));
    let distribution = lighting::D_GGX(point.surface.roughness, saturate(dot(N, H)));
    let visibility = lighting::V_SmithGGXCorrelated(point.surface.roughness, point.surface.NdotV, max(n_dot_l, 1e-4));
    return distribution * visibility * fresnel(WATER_REFLECTANCE, dot(L, H)) * n_dot_l;
}

// Puts the water over what the base reflects of one light. `base` includes the irradiance.
fn add_water(point: Point, through: Through, V: vec3<f32>, L: vec3<f32>, base: vec3<f32>, irradiance: vec3<f32>) -> vec3<f32> {
    var light = base * through.base;
    if through.mirror > 0.0 {
        light += irradiance * (through.mirror * water_specular(point, V, L));
    }
    return light;
}

// Normalized Blinn-Phong over Lambert, for an irradiance of 1 (n + 8 over 8 pi: Akenine-Moller et al. 2008, 7.6).
fn blinn_phong(input: ptr<function, lighting::LightingInput>, L: vec3<f32>) -> vec3<f32> {
    let N = (*input).layers[LAYER_BASE].N;
    let roughness = (*input).layers[LAYER_BASE].roughness;
    let exponent = max(2.0 / (roughness * roughness) - 2.0, 0.0);
    let n_dot_h = max(dot(N, normalize(L + (*input).V)), 1e-4);
    let F0 = mix((*input).F0_dielectric, (*input).F0_metallic, (*input).metallic);
    let specular = F0 * ((exponent + 8.0) / 8.0 * pow(n_dot_h, exponent));
    return ((*input).diffuse_color + specular) * (saturate(dot(N, L)) / PI);
}
