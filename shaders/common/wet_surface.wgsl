// What water does to a point before any light falls on it: how much there is, which way its surface looks, and the
// wetting models that change the material's parameters.

#define_import_path bevy_weathering::wet_surface

#import bevy_pbr::pbr_functions::calculate_F0
#import bevy_pbr::pbr_types::PbrInput
#import bevy_weathering::{
    authored::authored,
    flood::{accumulated, flood_depth},
    lagarde,
    lekner_dorf,
    ripples::rain_slopes,
    twomey,
    water_film::{film_coverage, film_levelness},
    wet_map::{
        porous, clock, has_flag, seconds_since, held_at, played_at, drop_slopes,
        FLAG_ACCUMULATION, FLAG_LEVEL, FLAG_METALNESS_FROM_SPECULAR, FLAG_POROSITY_GLOSS, FLAG_POROSITY_TEXTURE,
    },
}

// Water at a point.
struct Water {
    // Of the matter, 0..=1: what darkens it.
    wetness: f32,
    // How much of its pores mirrors, 0..=1.
    gloss: f32,
    // Efflorescence and tide mark, 0..=1.
    marks: vec2<f32>,
    // Loose and bound soil, snow, mm.
    matter: vec3<f32>,
    // Depth above the matter, mm.
    film_mm: f32,
    // Part of the point under water, 0..=1.
    coverage: f32,
    // How level the water lies, 0..=1.
    levelness: f32,
}

// Below this nothing of it can be seen.
const LEVEL_ENOUGH_FOR_RIPPLES: f32 = 0.02;
// Depth, in mm, of water that is only known to be all there can be.
const ACCUMULATED_MM: f32 = 5.0;

// Water that fell on a point or stands there. height, paint: see `flood`.
fn water_on(uv: vec2<f32>, height: f32, paint: f32) -> Water {
    var water: Water;
#ifdef WEATHERED_HELD
    let held = held_at(uv);
    water.wetness = held.look.x;
    water.gloss = held.look.y;
    water.film_mm = held.look.z;
    water.marks = held.marks;
    water.matter = held.matter;
#endif
#ifdef WEATHERED_PLAYED_MAP
    let played = played_at(uv);
    water.wetness = max(water.wetness, played);
    water.gloss = max(water.gloss, played);
#endif
#ifdef WEATHERED_STANDING
    if has_flag(FLAG_LEVEL) {
        water.film_mm += flood_depth(porous.flood.x, porous.flood.y, porous.flood.z, height, paint);
    }
#endif
    water.coverage = film_coverage(water.film_mm);
    water.levelness = film_levelness(water.film_mm, porous.levelling_mm);
#ifdef WEATHERED_STANDING
    if has_flag(FLAG_ACCUMULATION) {
        let stands = accumulated(porous.flood.x, porous.flood.y, height, paint);
        water.film_mm = max(water.film_mm, ACCUMULATED_MM * stands);
        water.coverage = max(water.coverage, stands);
        water.levelness = max(water.levelness, stands);
        water.wetness = saturate(water.wetness + stands);
        water.gloss = saturate(water.gloss + stands);
    }
#endif
    // What is under water is wet.
    water.wetness = max(water.wetness, water.coverage);
    water.gloss = max(water.gloss, water.coverage);
    return water;
}

// Slopes of the water's surface by the rings around drops: in x and y along u and v, those of drops that really fell, in
// z and w along world x and z, those of rain that is not simulated.
fn ripples(uv: vec2<f32>, world: vec3<f32>, levelness: f32) -> vec4<f32> {
    var slopes = vec4(0.0);
    if levelness > LEVEL_ENOUGH_FOR_RIPPLES {
#ifdef WEATHERED_WATER
        slopes += vec4(drop_slopes(uv), 0.0, 0.0);
#endif
        if porous.rain_mm_per_h > 0.0 {
            // Wraps after an hour, far above the life of a ring and far below where `f32` loses milliseconds.
            let seconds = f32(clock.tick % (3600u * clock.hz)) / f32(clock.hz);
            slopes += vec4(0.0, 0.0, rain_slopes(world.xz / porous.ripple_cell, seconds, porous.rain_mm_per_h));
        }
    }
    return slopes * levelness;
}

// The models that are a change of parameters; those with pores come with the light. `painted`: porosity or mask of the texture; `wet_color`: of a painted look.
fn apply_model(pbr: ptr<function, PbrInput>, water: ptr<function, Water>, painted: f32, wet_color: vec3<f32>) {
    let base = (*pbr).material.base_color.rgb;
    let metallic = (*pbr).material.metallic;
    let roughness = (*pbr).material.perceptual_roughness;
    let wetness = (*water).wetness;
    let gloss = (*water).gloss;
    let glossy = gloss * porous.porosity * (1.0 - metallic);
    let soaked = wetness * porous.porosity * (1.0 - metallic);
    var color = base;
#ifdef WEATHERED_LAGARDE
    var porosity = porous.porosity;
    if has_flag(FLAG_POROSITY_TEXTURE) {
        porosity *= painted;
    }
    if has_flag(FLAG_POROSITY_GLOSS) {
        porosity *= lagarde::porosity_from_gloss(lagarde::gloss_from_roughness(roughness));
    }
    var metalness = metallic;
    if has_flag(FLAG_METALNESS_FROM_SPECULAR) {
        metalness = lagarde::metalness_from_specular(calculate_F0(base, metallic, (*pbr).material.reflectance));
    }
    let f = lagarde::kept_albedo(porosity, metalness);
    color = lagarde::wet_albedo(base, f, wetness);
    (*pbr).material.perceptual_roughness = lagarde::wet_roughness(roughness, f, gloss);
#endif
#ifdef WEATHERED_LEKNER_DORF
    color = mix(base, lekner_dorf::wet_diffuse(base, porous.film_x, porous.film_p), soaked);
    (*water).coverage = max((*water).coverage, glossy);
#endif
#ifdef WEATHERED_TWOMEY
    color = mix(base, twomey::wet_albedo(base, porous.backscatter), soaked);
#endif
#ifdef WEATHERED_AUTHORED
    color = authored(base, wet_color, soaked);
    (*pbr).material.perceptual_roughness = authored(vec3(roughness), vec3(porous.wet_roughness), glossy).x;
    (*pbr).material.reflectance = authored((*pbr).material.reflectance, vec3(porous.wet_reflectance), glossy);
#endif
    (*pbr).material.base_color = vec4(color, (*pbr).material.base_color.a);
}
