// Paints a batch of splats into the maps of one surface.
//
// One workgroup per touched tile of 16x16 texels, one invocation per texel. Each walks the tile's list of splats, in
// the order of their impacts, and reads and writes its texel once. Edges of the map are a modulo in `kernel`.

#import bevy_weathering::kernel::{
    Axis, axis_offset, blend_over, falloff, slope_color, stamp_alpha
}

// A stamp; the twin of `Splat` in `src/overlay/splat.rs`.
struct Splat {
    // Middle, 1/256 texel.
    center: vec2<i32>,
    // Half width and height, 1/256 texel.
    radius: vec2<i32>,
    // Water, nanolitres.
    water_nl: u32,
    // Tick of the impact.
    tick: u32,
    // RGB and opacity, 8 bits each, red lowest.
    diffuse: u32,
    // Reflectance, smoothness, unused, opacity.
    specular: u32,
    // Slope at the rim, -127..=127.
    bump: i32,
    // 0..=255.
    bump_opacity: u32,
    pad: vec2<u32>,
}

// The twin of `TileHeader` in `src/overlay/tiles.rs`.
struct TileHeader {
    x: u32,
    y: u32,
    // Where the tile's splats begin in `splat_list`.
    start: u32,
    count: u32,
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

// Texels along each side of a tile.
const TILE_SIZE: i32 = 16;
// Drops that a tile remembers, the newest first.
const RINGS_PER_TILE: u32 = 4u;

// The twin of `SurfaceBatch` in `src/overlay/gpu/prepare.rs`.
struct SurfaceBatch {
    // Texels along each side of the maps.
    size: u32,
    // The batch's first row in `tiles`.
    first_tile: u32,
    // Edges along u and v: 1 clamps, 0 repeats.
    clamped: vec2<u32>,
}

@group(0) @binding(0) var<uniform> batch: SurfaceBatch;
@group(0) @binding(1) var<storage, read> splats: array<Splat>;
@group(0) @binding(2) var<storage, read> tiles: array<TileHeader>;
@group(0) @binding(3) var<storage, read> splat_list: array<u32>;

@group(1) @binding(0) var diffuse_map: texture_storage_2d<rgba8unorm, read_write>;
@group(1) @binding(1) var specular_map: texture_storage_2d<rgba8unorm, read_write>;
@group(1) @binding(2) var normal_map: texture_storage_2d<rgba8unorm, read_write>;
@group(1) @binding(3) var<storage, read_write> rings: array<RainRing>;

fn bytes_from_color(color: vec4<f32>) -> vec4<u32> {
    return vec4<u32>(color * 255.0 + 0.5);
}

fn color_from_bytes(bytes: vec4<u32>) -> vec4<f32> {
    return vec4<f32>(bytes) / 255.0;
}

// A colour over a texel, premultiplied.
fn paint_over(under: vec4<u32>, color: vec3<u32>, alpha: u32) -> vec4<u32> {
    return vec4(
        blend_over(color.r, alpha, under.r),
        blend_over(color.g, alpha, under.g),
        blend_over(color.b, alpha, under.b),
        blend_over(255u, alpha, under.a),
    );
}

fn unpack_bytes(packed: u32) -> vec4<u32> {
    return vec4(packed, packed >> 8u, packed >> 16u, packed >> 24u) & vec4(0xffu);
}

// Puts the newest drops that fell into a tile before those it remembers.
fn remember_drops(tile: TileHeader, tiles_along: u32) {
    let first = (tile.y * tiles_along + tile.x) * RINGS_PER_TILE;
    var fallen: array<RainRing, RINGS_PER_TILE>;
    var count = 0u;
    for (var i = tile.count; i > 0u && count < RINGS_PER_TILE; i -= 1u) {
        let splat = splats[splat_list[tile.start + i - 1u]];
        let home = splat.center >> vec2(8u);
        if splat.water_nl > 0u && all(home / TILE_SIZE == vec2(i32(tile.x), i32(tile.y))) {
            fallen[count] = RainRing(splat.center, splat.tick, splat.water_nl);
            count += 1u;
        }
    }
    for (var slot = RINGS_PER_TILE; slot > count; slot -= 1u) {
        rings[first + slot - 1u] = rings[first + slot - 1u - count];
    }
    for (var slot = 0u; slot < count; slot += 1u) {
        rings[first + slot] = fallen[slot];
    }
}

@compute @workgroup_size(16, 16)
fn paint_splats(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let tile = tiles[batch.first_tile + workgroup.x];
    let texel = vec2<i32>(vec2(tile.x, tile.y) * 16u + local.xy);
    let size = i32(batch.size);

    var diffuse = bytes_from_color(textureLoad(diffuse_map, texel));
    var specular = bytes_from_color(textureLoad(specular_map, texel));
    var normal = bytes_from_color(textureLoad(normal_map, texel));
    var changed = false;

    for (var i = tile.start; i < tile.start + tile.count; i += 1u) {
        let splat = splats[splat_list[i]];
        let u = Axis(splat.center.x, splat.radius.x, size, batch.clamped.x != 0u);
        let v = Axis(splat.center.y, splat.radius.y, size, batch.clamped.y != 0u);
        let offset = vec2(axis_offset(u, texel.x), axis_offset(v, texel.y));
        let dome = falloff(offset);
        if dome > 0u {
            let paint = unpack_bytes(splat.diffuse);
            diffuse = paint_over(diffuse, paint.rgb, stamp_alpha(paint.a, dome));
            let gloss = unpack_bytes(splat.specular);
            specular = paint_over(specular, gloss.rgb, stamp_alpha(gloss.a, dome));
            let slope = vec3(slope_color(splat.bump, offset.x), slope_color(splat.bump, offset.y), 255u);
            normal = paint_over(normal, slope, stamp_alpha(splat.bump_opacity, dome));
            changed = true;
        }
    }

    if all(local.xy == vec2(0u)) {
        remember_drops(tile, batch.size / u32(TILE_SIZE));
    }
    if changed {
        textureStore(diffuse_map, texel, color_from_bytes(diffuse));
        textureStore(specular_map, texel, color_from_bytes(specular));
        textureStore(normal_map, texel, color_from_bytes(normal));
    }
}
