// Particles: quads whose places are pulled from a buffer, turned to the eye, and lit.
//
// The mesh holds nothing but the numbers of its vertices, four to a quad. Rust writes the rows in
// `src/particle/draw/rows.rs` and draws the tiles in `src/particle/draw/sprites.rs`.

#import bevy_pbr::{
    mesh_view_bindings as view_bindings,
    view_transformations::position_world_to_clip,
}

#ifdef DEPTH_PREPASS
#import bevy_pbr::{prepass_utils::prepass_depth, view_transformations::depth_ndc_to_view_z}
#endif

#ifdef DISTANCE_FOG
#import bevy_pbr::pbr_functions::apply_fog
#endif

#ifdef ENVIRONMENT_MAP
#import bevy_pbr::environment_map
#import bevy_pbr::clustered_forward::ClusterableObjectIndexRanges
#import bevy_pbr::lighting::LayerLightingInput
#endif

#ifdef TONEMAP_IN_SHADER
#import bevy_core_pipeline::tonemapping::tone_mapping
#endif

// A particle, or a splash. `GpuParticle` in Rust.
struct Particle {
    // World space, metres.
    position: vec3<f32>,
    // From the lowest bit: effect (16), sprite (4), a random number (12).
    kind: u32,
    // m/s; of a splash the normal it stands on.
    velocity: vec3<f32>,
    // Size in metres as an f16 (low); ticks that are left, or of a splash its age, 65,535 being the end (high).
    size_age: u32,
}

// How an effect looks. `GpuLook` in Rust.
struct Look {
    // Linear RGBA.
    color: vec4<f32>,
    // Seconds that the shutter is open.
    exposure: f32,
    // The fastest it turns round itself, rad/s.
    spin: f32,
    pad: vec2<u32>,
}

// `GpuFrame` in Rust, and the looks of all effects.
struct Frame {
    // Rows.
    count: u32,
    // Length of a tick in seconds.
    tick_secs: f32,
    pad: vec2<u32>,
    looks: array<Look>,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(0) var<storage, read> particles: array<Particle>;
@group(#{MATERIAL_BIND_GROUP}) @binding(1) var<storage, read> frame: Frame;
// Normal along right and up around 0.5, and shade, all times cover; cover.
@group(#{MATERIAL_BIND_GROUP}) @binding(2) var sprites: texture_2d_array<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(3) var sprite_sampler: sampler;

const STREAK: u32 = 0u;
const DROP: u32 = 1u;
const FLAKE: u32 = 2u;
const GRAIN: u32 = 3u;
const CLOD: u32 = 4u;
const SPLASH: u32 = 5u;
// Tiles of a sprite.
const VARIANTS: u32 = 8u;
// Part of a tile that a thing fills along either side.
const FILL: f32 = 0.875;
// Pixels: what is thinner would flicker.
const THINNEST: f32 = 1.25;
// What is seen less than this is not drawn.
const FAINTEST: f32 = 0.001;
// Refractive index of water.
const WATER: f32 = 1.33;
// Reflectance of water at normal incidence.
const WATER_REFLECTANCE: f32 = 0.02;
const PI: f32 = 3.14159265;

struct VertexOutput {
    @builtin(position) position: vec4<f32>,
    @location(0) uv: vec2<f32>,
    @location(1) world_position: vec3<f32>,
    @location(2) @interpolate(flat) color: vec4<f32>,
    // Unit vectors along the tile, in world space.
    @location(3) @interpolate(flat) right: vec3<f32>,
    @location(4) @interpolate(flat) up: vec3<f32>,
    // Sprite and layer.
    @location(5) @interpolate(flat) tile: vec2<u32>,
    // Metres in front of a surface over which it fades.
    @location(6) @interpolate(flat) softness: f32,
}

// A quad in world space.
struct Quad {
    middle: vec3<f32>,
    // From the middle to the edges.
    right: vec3<f32>,
    up: vec3<f32>,
    // What is left of it for being smeared or widened.
    strength: f32,
}

// A number from 0 to 1 for each `which`.
fn random(seed: u32, which: u32) -> f32 {
    return f32(((seed + 4096u * which) * 2654435761u) >> 8u) / 16777216.0;
}

fn is_orthographic() -> bool {
    return view_bindings::view.clip_from_view[3].w == 1.0;
}

// Unit vector from a point to the eye.
fn toward_eye(point: vec3<f32>) -> vec3<f32> {
    let back = view_bindings::view.world_from_view[2].xyz;
    let to_eye = view_bindings::view.world_position - point;
    let far = length(to_eye);
    return select(to_eye / max(far, 1e-6), normalize(back), is_orthographic() || far < 1e-6);
}

// The vector without its part along a unit vector, of unit length; `otherwise` if nothing is left.
fn across(vector: vec3<f32>, along: vec3<f32>, otherwise: vec3<f32>) -> vec3<f32> {
    let rest = vector - along * dot(vector, along);
    let far = length(rest);
    return select(rest / max(far, 1e-12), otherwise, far < 1e-6);
}

// Side of a pixel at a depth, metres.
fn pixel_size(depth: f32) -> f32 {
    return 2.0 * abs(depth) / (view_bindings::view.clip_from_view[1].y * view_bindings::view.viewport.w);
}

// A splash stands on what was hit, and leans back a little for those who look down on it.
fn splash_quad(particle: Particle, size: f32, thinnest: f32, V: vec3<f32>, screen_right: vec3<f32>) -> Quad {
    let normal = particle.velocity;
    let right = across(cross(normal, V), V, screen_right);
    let up = normalize(normal - V * (0.5 * dot(normal, V)));
    let reach = 0.5 * max(size, 2.0 * thinnest);
    let strength = size * size / (4.0 * reach * reach);
    return Quad(particle.position + up * reach, right * reach, up * reach, strength);
}

// From where it was when the shutter opened to where it is.
fn smeared_quad(particle: Particle, size: f32, motion: vec3<f32>, thinnest: f32, V: vec3<f32>,
                screen_up: vec3<f32>, fades: bool) -> Quad {
    let up = across(particle.velocity, V, screen_up);
    let right = cross(up, V);
    let seen = dot(motion, up);
    // A streak is as long as the way, a thing longer by itself.
    let long = select(max(seen, size), seen + size, fades);
    let drawn = vec2(max(size, thinnest), max(long, thinnest));
    // In its full depth, if it is seen from the side.
    let along = select(up * drawn.y, motion * (drawn.y / max(seen, 1e-9)), seen > size);
    var strength = size * long / (drawn.x * drawn.y);
    if fades {
        strength *= size / long;
    }
    return Quad(particle.position - 0.5 * motion, right * (0.5 * drawn.x / FILL), along * (0.5 / FILL), strength);
}

// Turning round itself; flakes tumble, too.
fn turning_quad(particle: Particle, size: f32, spin: f32, thinnest: f32, V: vec3<f32>, screen_up: vec3<f32>,
                sprite: u32, seed: u32) -> Quad {
    let seconds = f32(particle.size_age >> 16u) * frame.tick_secs;
    let angle = 2.0 * PI * random(seed, 1u) + seconds * spin * (2.0 * random(seed, 2u) - 1.0);
    let level = cross(screen_up, V);
    let right = level * cos(angle) + screen_up * sin(angle);
    let up = screen_up * cos(angle) - level * sin(angle);
    var drawn = vec2(max(size, thinnest));
    let strength = size * size / (drawn.x * drawn.y);
    if sprite == FLAKE {
        let tilt = 2.0 * PI * random(seed, 3u) + seconds * spin * (0.5 + random(seed, 4u));
        drawn.y *= 0.4 + 0.6 * abs(cos(tilt));
    }
    return Quad(particle.position, right * (0.5 * drawn.x / FILL), up * (0.5 * drawn.y / FILL), strength);
}

@vertex
fn vertex(@location(0) number: u32) -> VertexOutput {
    var out: VertexOutput;
    // Four corners at one place are nothing.
    out.position = vec4(2.0, 2.0, 2.0, 1.0);
    let row = number / 4u;
    if row >= min(frame.count, arrayLength(&particles)) {
        return out;
    }
    let particle = particles[row];
    let size = unpack2x16float(particle.size_age).x;
    let effect = particle.kind & 0xffffu;
    if size <= 0.0 || effect >= arrayLength(&frame.looks) {
        return out;
    }
    let look = frame.looks[effect];
    let sprite = (particle.kind >> 16u) & 15u;
    let seed = particle.kind >> 20u;

    let clip = position_world_to_clip(particle.position);
    let thinnest = THINNEST * pixel_size(clip.w);
    let V = toward_eye(particle.position);
    let screen_up = across(view_bindings::view.world_from_view[1].xyz, V, view_bindings::view.world_from_view[0].xyz);
    let motion = particle.velocity * look.exposure;
    let seen = length(motion - V * dot(motion, V));

    var variant = seed % VARIANTS;
    var quad: Quad;
    out.softness = 0.5 * size;
    if sprite == SPLASH {
        quad = splash_quad(particle, size, thinnest, V, cross(screen_up, V));
        variant = min((particle.size_age >> 16u) * VARIANTS / 65536u, VARIANTS - 1u);
        // It begins at the surface.
        out.softness = 0.02 * size;
    } else if sprite == STREAK || sprite == DROP || seen > 1.5 * size {
        quad = smeared_quad(particle, size, motion, thinnest, V, screen_up, sprite != STREAK);
    } else {
        quad = turning_quad(particle, size, look.spin, thinnest, V, screen_up, sprite, seed);
    }

    var alpha = look.color.a * quad.strength;
    if !is_orthographic() {
        let near = view_bindings::view.clip_from_view[3].z;
        alpha *= smoothstep(near, 4.0 * near, clip.w);
    }
    if alpha < FAINTEST {
        return out;
    }
    let corner = number % 4u;
    let side = vec2(select(-1.0, 1.0, corner == 1u || corner == 2u), select(-1.0, 1.0, corner >= 2u));
    out.world_position = quad.middle + quad.right * side.x + quad.up * side.y;
    out.position = position_world_to_clip(out.world_position);
    // Every other splash is the mirror image.
    let mirror = select(1.0, -1.0, sprite == SPLASH && (seed & 1u) == 1u);
    out.uv = vec2(0.5 + 0.5 * mirror * side.x, 0.5 - 0.5 * side.y);
    out.color = vec4(look.color.rgb, alpha);
    out.right = normalize(quad.right) * mirror;
    out.up = normalize(quad.up);
    out.tile = vec2(sprite, sprite * VARIANTS + variant);
    return out;
}

// The first directional light.
struct Sun {
    // Towards it.
    L: vec3<f32>,
    // On a surface that faces it.
    irradiance: vec3<f32>,
}

fn sun() -> Sun {
    if view_bindings::lights.n_directional_lights == 0u {
        return Sun(vec3(0.0, 1.0, 0.0), vec3(0.0));
    }
    let light = &view_bindings::lights.directional_lights[0];
    return Sun((*light).direction_to_light.xyz, (*light).color.rgb);
}

// What is all around.
struct Surroundings {
    // What a white surface that looks along `N` throws back.
    diffuse: vec3<f32>,
    // From the direction `R`.
    radiance: vec3<f32>,
}

fn surroundings(N: vec3<f32>, R: vec3<f32>, position: vec3<f32>) -> Surroundings {
    let ambient = view_bindings::lights.ambient_color.rgb;
    var around = Surroundings(ambient, ambient);
#ifdef ENVIRONMENT_MAP
    var layer: LayerLightingInput;
    layer.N = N;
    layer.R = R;
    layer.NdotV = 1.0;
    layer.perceptual_roughness = 0.2;
    layer.roughness = 0.04;
    // Of light probes only the view's.
    var nowhere: ClusterableObjectIndexRanges;
    let found = environment_map::compute_radiances(layer, &nowhere, position, false);
    around.diffuse += found.irradiance;
    around.radiance += found.radiance;
#endif
    return around;
}

// Phase function of Henyey and Greenstein, 1/sr, by the cosine between the way of the light before and after. It has no
// limit ahead; the sun has a size.
fn scattered(cosine: f32, g: f32) -> f32 {
    let phase = (1.0 - g * g) / (4.0 * PI * pow(max(1.0 + g * g - 2.0 * g * cosine, 1e-4), 1.5));
    return min(phase, 1.5);
}

// Diffuse light on a rough thing, which reaches round its edge by `wrap`.
fn wrapped(cosine: f32, wrap: f32) -> f32 {
    return saturate((cosine + wrap) / (1.0 + wrap)) / (1.0 + wrap) / PI;
}

// Normalised highlight of Blinn and Phong.
fn highlight(N: vec3<f32>, V: vec3<f32>, L: vec3<f32>, shininess: f32) -> f32 {
    let H = normalize(L + V);
    return (shininess + 8.0) / (8.0 * PI) * pow(saturate(dot(N, H)), shininess) * saturate(dot(N, L));
}

// Where a line of sight goes behind a ball of water that it meets where the normal is `N`.
fn through_ball(N: vec3<f32>, V: vec3<f32>) -> vec3<f32> {
    let inside = refract(-V, N, 1.0 / WATER);
    let exit = normalize(N - 2.0 * dot(inside, N) * inside);
    let out = refract(inside, -exit, WATER);
    return select(normalize(out), inside, dot(out, out) < 1e-6);
}

// How white falling water is for its bubbles and for drops too small to be drawn.
const SPRAY: f32 = 0.9;

// Water shows what is behind it upside down, mirrors a little of what is before it, and throws sunlight ahead.
fn water_color(color: vec3<f32>, shade: f32, N: vec3<f32>, V: vec3<f32>, light: Sun, position: vec3<f32>) -> vec3<f32> {
    let around = surroundings(N, through_ball(N, V), position);
    let fresnel = WATER_REFLECTANCE + (1.0 - WATER_REFLECTANCE) * pow(1.0 - saturate(dot(N, V)), 5.0);
    let refracted = color * mix(around.radiance, around.diffuse, fresnel);
    let ahead = color * scattered(dot(-light.L, V), 0.75);
    let glint = WATER_REFLECTANCE * highlight(N, V, light.L, 150.0);
    let spray = SPRAY * color * (around.diffuse + wrapped(dot(N, light.L), 1.0) * light.irradiance);
    return 2.0 * shade * (refracted + ahead * light.irradiance) + spray + glint * light.irradiance;
}

// Ice is bright from all sides, brightest against the light, and flashes when a face mirrors the sun.
fn flake_color(color: vec3<f32>, shade: f32, N: vec3<f32>, V: vec3<f32>, light: Sun, position: vec3<f32>) -> vec3<f32> {
    let around = surroundings(N, -V, position);
    let spread = 0.7 * wrapped(dot(N, light.L), 1.0) + 0.3 * scattered(dot(-light.L, V), 0.6);
    let flash = 0.03 * highlight(N, V, light.L, 60.0);
    return color * shade * (around.diffuse + spread * light.irradiance) + flash * light.irradiance;
}

// `gloss`: reflectance of the film on it.
fn stone_color(color: vec3<f32>, shade: f32, N: vec3<f32>, V: vec3<f32>, light: Sun, position: vec3<f32>,
               gloss: f32) -> vec3<f32> {
    let around = surroundings(N, reflect(-V, N), position);
    let lit = around.diffuse + wrapped(dot(N, light.L), 0.2) * light.irradiance;
    return color * shade * lit + gloss * (around.radiance + highlight(N, V, light.L, 40.0) * light.irradiance);
}

@fragment
fn fragment(in: VertexOutput) -> @location(0) vec4<f32> {
    let texel = textureSample(sprites, sprite_sampler, in.uv, in.tile.y);
    var alpha = texel.a * in.color.a;
#ifdef DEPTH_PREPASS
    let behind = depth_ndc_to_view_z(max(prepass_depth(in.position, 0u), 1e-7));
    alpha *= saturate((depth_ndc_to_view_z(in.position.z) - behind) / max(in.softness, 1e-5));
#endif
    if alpha < FAINTEST {
        discard;
    }
    let slope = (2.0 * texel.rg - texel.a) / texel.a;
    let shade = texel.b / texel.a;
    let V = toward_eye(in.world_position);
    let facing = sqrt(max(1.0 - dot(slope, slope), 0.0));
    let N = normalize(in.right * slope.x + in.up * slope.y + V * max(facing, 1e-3));

    let light = sun();
    var radiance: vec3<f32>;
    if in.tile.x == FLAKE {
        radiance = flake_color(in.color.rgb, shade, N, V, light, in.world_position);
    } else if in.tile.x == GRAIN {
        radiance = stone_color(in.color.rgb, shade, N, V, light, in.world_position, 0.0);
    } else if in.tile.x == CLOD {
        radiance = stone_color(in.color.rgb, shade, N, V, light, in.world_position, 0.03);
    } else {
        radiance = water_color(in.color.rgb, shade, N, V, light, in.world_position);
    }

    var color = vec4(radiance * view_bindings::view.exposure, alpha);
#ifdef DISTANCE_FOG
    color = apply_fog(view_bindings::fog, color, in.world_position, view_bindings::view.world_position, in.position.xy);
#endif
#ifdef TONEMAP_IN_SHADER
    color = tone_mapping(color, view_bindings::view.color_grading);
#endif
    return vec4(color.rgb * alpha, alpha);
}
