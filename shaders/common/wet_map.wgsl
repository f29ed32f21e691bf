// What the maps of a surface say about a point: how wet it is now, how deep water stands on it, and what falls on it.

#define_import_path bevy_weathering::wet_map

#import bevy_weathering::drying::{Amounts, evolve, water_look}
#import bevy_weathering::footprint::{Taps, axis_taps}
#import bevy_weathering::hnat::wet_tau
#import bevy_weathering::matter::{TexelMatter, heap_fall, lies, matter_depths, settled_soil}
#import bevy_weathering::ripples::{ring_slope, RING_SECONDS}

// Constants of a surface; the twin of `PorousUniform` in `src/material/extension.rs`.
struct PorousUniform {
    // Linear colour when wet, of a painted look.
    wet_color: vec3<f32>,
    // Perceptual roughness when wet, of a painted look.
    wet_roughness: f32,
    // What murky water takes away per mm.
    absorption_per_mm: vec3<f32>,
    // Bevy's reflectance when wet, of a painted look.
    wet_reflectance: f32,
    // Accumulation: levels of cracks and puddles, 0..=1. Level: level, basin, relief, mm.
    flood: vec3<f32>,
    // Depth over which water gets level, mm.
    levelling_mm: f32,
    // Part of the surface that takes up water, 0..=1; alpha_poro of a model with pores.
    porosity: f32,
    // Shape of a pore, 0..=1.
    s_p: f32,
    // RMS slope, 0..=1.
    m: f32,
    // Part of the light that the dry surface scatters back, 0..=1.
    k_s: f32,
    // Strength of the water's own reflection in pores, 0..=1.
    k_w: f32,
    // Internal reflection of a film, 0..1.
    film_p: f32,
    // How much more light gets into the solid from the film than from air.
    film_x: f32,
    // How much less light a grain turns back in water, above 0.
    backscatter: f32,
    // Seconds from the first water until a texel looks wet.
    t_fill: f32,
    // What the pores hold, mm.
    capacity_mm: f32,
    // Absorbed water that looks fully wet, mm, above 0.
    visible_mm: f32,
    // The square of the sorptivity, mm^2/s.
    sorptivity_squared: f32,
    // What 255 of a texel's reserve stand for, mm.
    reserve_mm: f32,
    // Strength of efflorescence and tide marks, 0..=1.
    efflorescence: f32,
    tide_mark: f32,
    // A played wet map: ticks it takes from dry to wet, t_fill as a part of that, and the tick it began at.
    map_ticks: f32,
    map_fill: f32,
    map_tick: u32,
    // Diffuse transmission when soaked, 0..=1.
    wet_translucency: f32,
    // Rain whose drops are not simulated, mm/h.
    rain_mm_per_h: f32,
    // Side of the cells of that rain, metres.
    ripple_cell: f32,
    // Texels along each side of the maps.
    size: u32,
    // Sum of the FLAG_ constants.
    flags: u32,
}

// The twin of `GpuTexelWater` in `src/wetting/gpu.rs`.
struct TexelWater {
    // Film and absorbed water, mm, two halves; BESIDE where neither the mesh lies nor its gutter.
    amounts: u32,
    // Reference tick; 0 if it never was wet.
    tick: u32,
    // From the lowest byte: how wet it looked then, exposure to air and to the sun, reserve.
    bytes: u32,
    // Efflorescence, tide mark, how much of the film was to be seen, nearness to a rim.
    marks: u32,
}

// From a tick on, the weather takes so much a tick; until then it took so much. mm. The twin of `GpuDryingPoint` in
// `src/material/clock.rs`.
struct DryingPoint {
    tick: u32,
    air_mm: f32,
    sun_mm: f32,
    air_per_tick: f32,
    sun_per_tick: f32,
}

// How dust, mud and snow look; the twin of `MatterUniform` in `src/material/extension.rs`.
struct MatterUniform {
    // Linear colours and perceptual roughnesses, 0..=1.
    dust_color: vec3<f32>,
    dust_roughness: f32,
    mud_color: vec3<f32>,
    mud_roughness: f32,
    snow_color: vec3<f32>,
    snow_roughness: f32,
    // Width of a grain and of a flake, mm.
    grain_mm: f32,
    flake_mm: f32,
}

// The time, and the integral of what the weather takes.
struct Clock {
    // Ticks since the start, and ticks per second.
    tick: u32,
    hz: u32,
    // Points, at least 1, in order.
    count: u32,
    pad: u32,
    points: array<DryingPoint>,
}

// A drop that fell not long ago; the twin of `RainRing` in `src/overlay/maps.rs`.
struct RainRing {
    // Where, 1/256 texel.
    center: vec2<i32>,
    // When; 0 is never.
    tick: u32,
    // Water, nanolitres.
    water_nl: u32,
}

// Amounts of a texel beside the mesh: no film, with a sign. As in `src/wetting/gpu.rs`.
const BESIDE: u32 = 0x8000u;

const FLAG_SQRT_K: u32 = 1u;
const FLAG_SOLID: u32 = 2u;
const FLAG_BLINN_PHONG: u32 = 4u;
const FLAG_CLAMP_U: u32 = 8u;
const FLAG_CLAMP_V: u32 = 16u;
const FLAG_ACCUMULATION: u32 = 32u;
const FLAG_LEVEL: u32 = 64u;
const FLAG_POROSITY_TEXTURE: u32 = 128u;
const FLAG_POROSITY_GLOSS: u32 = 256u;
const FLAG_METALNESS_FROM_SPECULAR: u32 = 512u;
const FLAG_MAP_DRIES: u32 = 1024u;

// Texels along each side of a tile, and drops that a tile remembers.
const TILE_SIZE: i32 = 16;
const RINGS_PER_TILE: i32 = 4;
// How far a ring gets, and half its width, in texels: with both it stays inside the tiles around its own.
const RING_REACH_TEXELS: f32 = 11.0;
const RING_WIDTH_TEXELS: f32 = 4.0;
// Water of a drop whose ring is as steep as can be, nanolitres: 5 mm across.
const STEEPEST_DROP_NL: f32 = 65000.0;

@group(#{MATERIAL_BIND_GROUP}) @binding(100) var<uniform> porous: PorousUniform;
@group(#{MATERIAL_BIND_GROUP}) @binding(101) var diffuse_map: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(102) var map_sampler: sampler;
@group(#{MATERIAL_BIND_GROUP}) @binding(103) var specular_map: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(104) var normal_map: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(105) var<storage, read> state: array<TexelWater>;
@group(#{MATERIAL_BIND_GROUP}) @binding(106) var<storage, read> clock: Clock;
@group(#{MATERIAL_BIND_GROUP}) @binding(107) var<storage, read> rings: array<RainRing>;
@group(#{MATERIAL_BIND_GROUP}) @binding(108) var surface_texture: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(109) var surface_sampler: sampler;
@group(#{MATERIAL_BIND_GROUP}) @binding(110) var wet_color_texture: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(111) var wet_color_sampler: sampler;
@group(#{MATERIAL_BIND_GROUP}) @binding(112) var played_map: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(113) var played_sampler: sampler;
@group(#{MATERIAL_BIND_GROUP}) @binding(114) var<storage, read> matter: array<TexelMatter>;
@group(#{MATERIAL_BIND_GROUP}) @binding(115) var<uniform> matter_look: MatterUniform;

fn has_flag(flag: u32) -> bool {
    return (porous.flags & flag) != 0u;
}

// An index along one axis of a map of `size` texels or tiles, by the edge behaviour of the surface.
fn wrapped(index: i32, size: i32, clamped: bool) -> i32 {
    return select(((index % size) + size) % size, clamp(index, 0, size - 1), clamped);
}

// Seconds from a tick until now. In ticks first: a difference of large floats would stutter after some hours.
fn seconds_since(tick: u32) -> f32 {
    return f32(i32(clock.tick - tick)) / f32(clock.hz);
}

// What the weather could have taken until a tick, from air and sun.
fn demand_until(tick: u32) -> vec2<f32> {
    let point = clock.points[point_at(tick)];
    // Before the first point nothing was taken.
    let ticks = f32(max(tick, point.tick) - point.tick);
    return vec2(point.air_mm, point.sun_mm) + vec2(point.air_per_tick, point.sun_per_tick) * ticks;
}

// The last point at or before a tick.
fn point_at(tick: u32) -> u32 {
    var low = 0u;
    var high = clock.count;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if clock.points[middle].tick <= tick {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// The same from a tick until now. While the weather stays, a product: a difference of large sums would stutter.
fn demand_since(tick: u32) -> vec2<f32> {
    let now = max(clock.tick, tick);
    let last = clock.points[clock.count - 1u];
    if tick >= last.tick {
        return vec2(last.air_per_tick, last.sun_per_tick) * f32(now - tick);
    }
    return demand_until(now) - demand_until(tick);
}

// Water at a point as it is held and looks.
struct Held {
    // 1 where the mesh or its gutter lies, else 0.
    there: f32,
    // How wet, how glossy, film in mm.
    look: vec3<f32>,
    // Efflorescence and tide mark, 0..=1.
    marks: vec2<f32>,
    // Loose and bound soil, snow, mm.
    matter: vec3<f32>,
}

// Water that has to dry in one place until there is no more efflorescence to see, mm, and what a cycle adds to a tide mark:
// as in `src/wetting/marks.rs`.
const MARK_FULL_MM: f32 = 2.0;
const TIDE_PER_CYCLE: f32 = 0.35;

// Where the state and the matter of a texel are stored: tile after tile, each row by row.
fn texel_index(texel: vec2<i32>) -> i32 {
    let size = i32(porous.size);
    let x = wrapped(texel.x, size, has_flag(FLAG_CLAMP_U));
    let y = wrapped(texel.y, size, has_flag(FLAG_CLAMP_V));
    let tile = (y / TILE_SIZE) * (size / TILE_SIZE) + x / TILE_SIZE;
    return tile * TILE_SIZE * TILE_SIZE + (y % TILE_SIZE) * TILE_SIZE + x % TILE_SIZE;
}

// What a texel holds now.
fn texel_held(texel: vec2<i32>) -> Held {
    let index = texel_index(texel);
    let stored = state[index];
    var held: Held;
    held.there = select(1.0, 0.0, stored.amounts == BESIDE);
    let marks = unpack4x8unorm(stored.marks);
    held.marks = marks.xy;
#ifdef WEATHERED_MATTER
    held.matter = matter_depths(matter[index]);
#endif
    if stored.tick == 0u || stored.tick > clock.tick {
        return held;
    }
    let depths = unpack2x16float(stored.amounts);
    let bytes = unpack4x8unorm(stored.bytes);
    let before = Amounts(depths.x, depths.y, bytes.w * porous.reserve_mm);
    let seconds = seconds_since(stored.tick);
    // The byte of the air's share is 128 where it is 1.
    let demand = dot(demand_since(stored.tick), vec2(bytes.y * (255.0 / 128.0), bytes.z));
    let now = evolve(before, porous.sorptivity_squared, porous.capacity_mm, seconds, demand);
    let shown = vec2(bytes.x, marks.z);
    held.look = water_look(now.pores_mm, porous.visible_mm, shown, seconds, porous.t_fill);
    held.look.z *= now.film_mm;
#ifdef WEATHERED_MATTER
    held.matter = vec3(settled_soil(held.matter.x, held.matter.y, before.film_mm, now.film_mm), held.matter.z);
#endif
#ifdef WEATHERED_MARKS
    let dried = max(before.pores_mm - now.film_mm - now.pores_mm, 0.0);
    let cycle = min(dried / porous.visible_mm, 1.0) * marks.w;
    held.marks = min(held.marks + vec2(dried / MARK_FULL_MM, TIDE_PER_CYCLE * cycle), vec2(1.0));
#endif
    return held;
}

// A texel that a pixel reads, and its weight.
struct Tap {
    texel: vec2<i32>,
    weight: f32,
}

// One of the four that a pixel reads. u, v: of `axis_taps`.
fn tap_of(u: Taps, v: Taps, number: i32) -> Tap {
    let is_high = vec2(number % 2 == 1, number / 2 == 1);
    let along = select(1.0 - vec2(u.part, v.part), vec2(u.part, v.part), is_high);
    return Tap(select(vec2(u.low, v.low), vec2(u.high, v.high), is_high), along.x * along.y);
}

// What a point holds and how it looks now; bilinear between texels, spread over the pixel where it covers more of them.
fn held_at(uv: vec2<f32>) -> Held {
    let size = f32(porous.size);
    let covered = fwidth(uv) * size;
    let u = axis_taps(uv.x * size, covered.x);
    let v = axis_taps(uv.y * size, covered.y);
    var sum: Held;
    for (var i = 0; i < 4; i += 1) {
        let tap = tap_of(u, v, i);
        let held = texel_held(tap.texel);
        // From afar a pixel may reach beyond the gutter of its island: what lies beside it is not dry, but not there.
        let weight = tap.weight * held.there;
        sum.there += weight;
        sum.look += weight * held.look;
        sum.marks += weight * held.marks;
        sum.matter += weight * held.matter;
    }
    if sum.there <= 0.0 {
        // An island smaller than that.
        return texel_held(vec2<i32>(floor(uv * size)));
    }
    return Held(1.0, sum.look / sum.there, sum.marks / sum.there, sum.matter / sum.there);
}

// Depth of snow and soil at a texel, mm, for slopes; below 0 where the mesh does not lie.
fn heap_mm(texel: vec2<i32>) -> f32 {
    let stored = matter[texel_index(texel)];
    let depths = matter_depths(stored);
    return select(-1.0, depths.x + depths.y + depths.z, lies(stored));
}

// How fast what lies here falls, metres per unit of u and of v.
fn heap_falls(uv: vec2<f32>) -> vec2<f32> {
    let size = f32(porous.size);
    let covered = fwidth(uv) * size;
    let u = axis_taps(uv.x * size, covered.x);
    let v = axis_taps(uv.y * size, covered.y);
    // Where a pixel covers many texels, falls over as many of them.
    let reach = max(vec2<i32>(0.5 * min(covered, vec2(size))), vec2(1));
    var sum = vec2(0.0);
    var weights = 0.0;
    for (var i = 0; i < 4; i += 1) {
        let tap = tap_of(u, v, i);
        let at = tap.texel;
        let here = heap_mm(at);
        // As in `held_at`.
        let weight = select(tap.weight, 0.0, here < 0.0);
        let fall = vec2(
            heap_fall(heap_mm(at - vec2(reach.x, 0)), here, heap_mm(at + vec2(reach.x, 0))),
            heap_fall(heap_mm(at - vec2(0, reach.y)), here, heap_mm(at + vec2(0, reach.y))),
        );
        sum += weight * fall / vec2<f32>(reach);
        weights += weight;
    }
    return sum / max(weights, 1e-6) * size / 2000.0;
}

// Most places along each side of a pixel at which it reads a played map.
const MOST_PLAYED_TAPS: i32 = 4;

// How wet the played map says a point is, 0..=1. Grey g wets at (1 - g)(1 - t_fill), 0 never; drying is that backwards. A mean
// over what a pixel covers, of how wet it is and not of greys: half of it soaked is not all of it half wet.
fn played_at(uv: vec2<f32>) -> f32 {
    var time = f32(i32(clock.tick - porous.map_tick)) / porous.map_ticks;
    if has_flag(FLAG_MAP_DRIES) {
        time = 1.0 - time;
    }
    let pixel = fwidth(uv);
    let texels = pixel * vec2<f32>(textureDimensions(played_map));
    let covered = max(texels.x, texels.y);
    let taps = clamp(i32(ceil(covered)), 1, MOST_PLAYED_TAPS);
    // Maps that have mip maps are read from those for the rest.
    let level = log2(max(covered / f32(taps), 1.0));
    var wet = 0.0;
    for (var i = 0; i < taps * taps; i += 1) {
        let away = (vec2(f32(i % taps), f32(i / taps)) + 0.5) / f32(taps) - 0.5;
        let grey = textureSampleLevel(played_map, played_sampler, uv + away * pixel, level).r;
        wet += select(wet_tau(time, (1.0 - grey) * (1.0 - porous.map_fill), porous.map_fill), 0.0, grey <= 0.0);
    }
    return wet / f32(taps * taps);
}

// Slopes along u and v of the rings around drops that fell not long ago.
fn drop_slopes(uv: vec2<f32>) -> vec2<f32> {
    let size = i32(porous.size);
    let tiles = size / TILE_SIZE;
    // While nothing has fallen there is room for those of one tile alone.
    if i32(arrayLength(&rings)) < tiles * tiles * RINGS_PER_TILE {
        return vec2<f32>(0.0, 0.0);
    }
    let position = uv * f32(size);
    let home = vec2<i32>(floor(position / f32(TILE_SIZE)));
    var sum = vec2(0.0);
    for (var i = 0; i < 9; i += 1) {
        let tile = home + vec2(i % 3 - 1, i / 3 - 1);
        let x = wrapped(tile.x, tiles, has_flag(FLAG_CLAMP_U));
        let y = wrapped(tile.y, tiles, has_flag(FLAG_CLAMP_V));
        // A clamped surface ends where its map does.
        if (has_flag(FLAG_CLAMP_U) && x != tile.x) || (has_flag(FLAG_CLAMP_V) && y != tile.y) {
            continue;
        }
        for (var slot = 0; slot < RINGS_PER_TILE; slot += 1) {
            let ring = rings[(y * tiles + x) * RINGS_PER_TILE + slot];
            let age = seconds_since(ring.tick) / RING_SECONDS;
            if ring.tick == 0u || age >= 1.0 {
                continue;
            }
            // The tile's copy that is nearest, on a map that repeats.
            let center = vec2<f32>(ring.center) / 256.0 + vec2<f32>((tile - vec2(x, y)) * TILE_SIZE);
            let away = position - center;
            let distance = length(away);
            let strength = sqrt(min(f32(ring.water_nl) / STEEPEST_DROP_NL, 1.0));
            let slope = strength * ring_slope(distance, age, RING_REACH_TEXELS, RING_WIDTH_TEXELS);
            sum += away * select(slope / distance, 0.0, distance <= 0.0);
        }
    }
    return sum;
}
