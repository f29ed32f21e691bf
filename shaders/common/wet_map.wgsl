// What the maps of a surface say about a point: how wet it is now, and what lies over its material.

#define_import_path bevy_weathering::wet_map

#import bevy_weathering::hnat::wet_tau

// Constants of a surface; the twin of `PorousUniform` in `src/material/extension.rs`.
struct PorousUniform {
    // Part of the surface that is pores, 0..=1.
    alpha_poro: f32,
    // Shape of a pore, 0..=1.
    s_p: f32,
    // RMS slope, 0..=1.
    m: f32,
    // Part of the light that the dry surface scatters back, 0..=1.
    k_s: f32,
    // Strength of the water's own reflection, 0..=1.
    k_w: f32,
    // Seconds from the first water until a texel looks wet.
    t_fill: f32,
    // Nanolitres that make a texel look fully wet.
    capacity_nl: f32,
    // Texels along each side of the maps.
    size: u32,
    // Sum of the FLAG_ constants.
    flags: u32,
}

// The twin of `TexelState` in `src/overlay/maps.rs`.
struct TexelState {
    // Nanolitres.
    water_nl: u32,
    // Tick of the first water, 0 if dry ever since.
    wet_since: u32,
}

// Ticks since the start, and ticks per second.
struct Clock {
    tick: u32,
    hz: u32,
}

const FLAG_SQRT_K: u32 = 1u;
const FLAG_SOLID: u32 = 2u;
const FLAG_BLINN_PHONG: u32 = 4u;
const FLAG_CLAMP_U: u32 = 8u;
const FLAG_CLAMP_V: u32 = 16u;

@group(#{MATERIAL_BIND_GROUP}) @binding(100) var<uniform> porous: PorousUniform;
@group(#{MATERIAL_BIND_GROUP}) @binding(101) var diffuse_map: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(102) var map_sampler: sampler;
@group(#{MATERIAL_BIND_GROUP}) @binding(103) var specular_map: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(104) var normal_map: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(105) var<storage, read> state: array<TexelState>;
@group(#{MATERIAL_BIND_GROUP}) @binding(106) var<storage, read> clock: Clock;

fn has_flag(flag: u32) -> bool {
    return (porous.flags & flag) != 0u;
}

// A texel's index along one axis, by the edge behaviour of the surface.
fn wrapped(texel: i32, clamped: bool) -> i32 {
    let size = i32(porous.size);
    return select(((texel % size) + size) % size, clamp(texel, 0, size - 1), clamped);
}

// How wet one texel looks now: the paper's tau, scaled by how much water it has of what it can show.
fn texel_wetness(texel: vec2<i32>) -> f32 {
    let at = vec2(wrapped(texel.x, has_flag(FLAG_CLAMP_U)), wrapped(texel.y, has_flag(FLAG_CLAMP_V)));
    let held = state[at.y * i32(porous.size) + at.x];
    if held.water_nl == 0u {
        return 0.0;
    }
    // In ticks first: a difference of large floats would stutter after some hours.
    let since = f32(i32(clock.tick - held.wet_since)) / f32(clock.hz);
    let filled = min(f32(held.water_nl) / porous.capacity_nl, 1.0);
    return filled * wet_tau(since, 0.0, porous.t_fill);
}

// How wet a point looks now, 0..=1; bilinear between texels.
fn wetness_at(uv: vec2<f32>) -> f32 {
    let position = uv * f32(porous.size) - 0.5;
    let corner = floor(position);
    let part = position - corner;
    let texel = vec2<i32>(corner);
    let upper = mix(texel_wetness(texel), texel_wetness(texel + vec2(1, 0)), part.x);
    let lower = mix(texel_wetness(texel + vec2(0, 1)), texel_wetness(texel + vec2(1, 1)), part.x);
    return mix(upper, lower, part.y);
}
