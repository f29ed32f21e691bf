// Paints a batch of splats into the maps of one surface.
//
// One workgroup per touched tile of 16x16 texels, one invocation per texel. Each walks the tile's list of splats, in
// the order of their impacts, and reads and writes its texel once. Edges of the map are a modulo in `kernel`.

#import bevy_weathering::kernel::{
    Axis, axis_offset, blend_over, bytes_from_color, color_from_bytes, cross_axes, depth_part, dot_axes, facing_part, falloff, framed,
    lay_stamp, slope_color, slope_of, stamp_alpha, stamp_slope, turned, unpack_axis
}
#import bevy_weathering::stamp::{StampTexel, STAMP_TEXELS, mix4, on_stamp, stamp_corners}

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
    // 0 is a round dome, others are stamps of the atlas, from 1.
    stamp: u32,
    // 0: on the map, by center and radius. 1: in the space of the mesh, by what follows.
    in_space: u32,
    // Matrix from the way from the middle to the stamp's own axes.
    row_s: array<i32, 3>,
    row_t: array<i32, 3>,
    row_n: array<i32, 3>,
    // In space: its middle, steps.
    origin: array<i32, 3>,
    // In space: twice its radius, steps.
    reach: i32,
    // In space: the axes, signed bytes.
    axis_s: u32,
    axis_t: u32,
    axis_n: u32,
}

// A texel's place; the twin of `TexelFrame` in `src/overlay/frames.rs`.
struct TexelFrame {
    // x, and y above it; 16 bits each, in steps.
    xy: u32,
    // z, 16 bits; above it 1 if something lies here, and 2 if v grows the other way.
    z: u32,
    // Unit normal of the front, the direction in which u grows; signed bytes.
    normal: u32,
    along_u: u32,
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
@group(0) @binding(4) var<storage, read> stamps: array<StampTexel>;

@group(1) @binding(0) var diffuse_map: texture_storage_2d<rgba8unorm, read_write>;
@group(1) @binding(1) var specular_map: texture_storage_2d<rgba8unorm, read_write>;
@group(1) @binding(2) var normal_map: texture_storage_2d<rgba8unorm, read_write>;
@group(1) @binding(3) var<storage, read_write> rings: array<RainRing>;
// A single one while nothing lies in space.
@group(1) @binding(4) var<storage, read> frames: array<TexelFrame>;

// What a texel of the maps holds, as bytes.
struct Painted {
    diffuse: vec4<u32>,
    specular: vec4<u32>,
    normal: vec4<u32>,
}

// Where a texel lies on a stamp; the twin of `Place` in `src/overlay/cpu.rs`.
struct Place {
    // Along the stamp's own axes, 1/256 radius.
    offset: vec2<i32>,
    // For u and v: their parts along the stamp's axes, in units.
    along_u: vec2<i32>,
    along_v: vec2<i32>,
    unit: i32,
    // How much of the stamp reaches it, 0..=256.
    part: u32,
}

fn place_on_map(splat: Splat, offset: vec2<i32>) -> Place {
    if splat.stamp == 0u {
        return Place(offset, vec2(1, 0), vec2(0, 1), 1, 256u);
    }
    let s = vec2(splat.row_s[0], splat.row_s[1]);
    let t = vec2(splat.row_t[0], splat.row_t[1]);
    // A corner of a turned stamp that hangs out of its box is cut off.
    let part = select(0u, 256u, on_stamp(offset));
    return Place(vec2(turned(s, offset), turned(t, offset)), vec2(s.x, t.x), vec2(s.y, t.y), 1024, part);
}

fn vector(parts: array<i32, 3>) -> vec3<i32> {
    return vec3(parts[0], parts[1], parts[2]);
}

fn place_in_space(splat: Splat, frame: TexelFrame) -> Place {
    if (frame.z >> 16u) == 0u {
        return Place(vec2(0), vec2(0), vec2(0), 1, 0u);
    }
    let at = vec3<i32>(vec3(frame.xy & 0xffffu, frame.xy >> 16u, frame.z & 0xffffu));
    let away = at - vector(splat.origin);
    let s = framed(vector(splat.row_s), away, splat.reach);
    let t = framed(vector(splat.row_t), away, splat.reach);
    let n = framed(vector(splat.row_n), away, splat.reach);
    let normal = unpack_axis(frame.normal);
    let facing = facing_part(dot_axes(normal, unpack_axis(splat.axis_n)));
    let axis_s = unpack_axis(splat.axis_s);
    let axis_t = unpack_axis(splat.axis_t);
    let u = unpack_axis(frame.along_u);
    let v = cross_axes(normal, u) * select(1, -1, ((frame.z >> 16u) & 2u) != 0u);
    let part = select(0u, (depth_part(n) * facing) >> 8u, on_stamp(vec2(s, t)));
    return Place(
        vec2(s, t),
        vec2(dot_axes(u, axis_s), dot_axes(u, axis_t)),
        vec2(dot_axes(v, axis_s), dot_axes(v, axis_t)),
        16129,
        part,
    );
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

// A colour of a stamp over a texel.
fn stamp_over(under: vec4<u32>, color: vec4<u32>, tint: vec3<u32>, opacity: u32) -> vec4<u32> {
    let weight = color.a * opacity;
    return vec4(
        lay_stamp(color.r, tint.r, opacity, weight, under.r),
        lay_stamp(color.g, tint.g, opacity, weight, under.g),
        lay_stamp(color.b, tint.b, opacity, weight, under.b),
        lay_stamp(color.a, 255u, opacity, weight, under.a),
    );
}

// A round dome over a texel.
fn dome_over(under: Painted, splat: Splat, place: Place) -> Painted {
    let dome = falloff(place.offset);
    if dome == 0u {
        return under;
    }
    let paint = unpack_bytes(splat.diffuse);
    let gloss = unpack_bytes(splat.specular);
    let slopes = vec2(
        slope_color(splat.bump, (place.offset.x * place.along_u.x + place.offset.y * place.along_u.y) / place.unit),
        slope_color(splat.bump, (place.offset.x * place.along_v.x + place.offset.y * place.along_v.y) / place.unit),
    );
    return Painted(
        paint_over(under.diffuse, paint.rgb, stamp_alpha((paint.a * place.part) >> 8u, dome)),
        paint_over(under.specular, gloss.rgb, stamp_alpha((gloss.a * place.part) >> 8u, dome)),
        paint_over(under.normal, vec3(slopes, 255u), stamp_alpha((splat.bump_opacity * place.part) >> 8u, dome)),
    );
}

// A stamp of the atlas over a texel.
fn texture_over(under: Painted, splat: Splat, place: Place) -> Painted {
    let first = (splat.stamp - 1u) * STAMP_TEXELS;
    if !on_stamp(place.offset) || splat.stamp > arrayLength(&stamps) / STAMP_TEXELS {
        return under;
    }
    let corners = stamp_corners(place.offset);
    let a = stamps[first + corners.texels.x];
    let b = stamps[first + corners.texels.y];
    let c = stamps[first + corners.texels.z];
    let d = stamps[first + corners.texels.w];
    let w = corners.weights;
    let paint = unpack_bytes(splat.diffuse);
    let gloss = unpack_bytes(splat.specular);
    let diffuse = unpack_bytes(mix4(a.diffuse, b.diffuse, c.diffuse, d.diffuse, w.x, w.y));
    let specular = unpack_bytes(mix4(a.specular, b.specular, c.specular, d.specular, w.x, w.y));
    let normal = unpack_bytes(mix4(a.normal, b.normal, c.normal, d.normal, w.x, w.y));
    let slopes = vec2(slope_of(normal.r, normal.a), slope_of(normal.g, normal.a));
    let leaning = vec4(
        stamp_slope(slopes, place.along_u, place.unit, splat.bump, normal.a),
        stamp_slope(slopes, place.along_v, place.unit, splat.bump, normal.a),
        normal.a,
        normal.a,
    );
    return Painted(
        stamp_over(under.diffuse, diffuse, paint.rgb, (paint.a * place.part) >> 8u),
        stamp_over(under.specular, specular, gloss.rgb, (gloss.a * place.part) >> 8u),
        stamp_over(under.normal, leaning, vec3(255u), (splat.bump_opacity * place.part) >> 8u),
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

    var painted = Painted(
        bytes_from_color(textureLoad(diffuse_map, texel)),
        bytes_from_color(textureLoad(specular_map, texel)),
        bytes_from_color(textureLoad(normal_map, texel)),
    );
    let frame = frames[min(u32(texel.y) * batch.size + u32(texel.x), arrayLength(&frames) - 1u)];
    var changed = false;

    for (var i = tile.start; i < tile.start + tile.count; i += 1u) {
        let splat = splats[splat_list[i]];
        var place: Place;
        if splat.in_space == 0u {
            let u = Axis(splat.center.x, splat.radius.x, size, batch.clamped.x != 0u);
            let v = Axis(splat.center.y, splat.radius.y, size, batch.clamped.y != 0u);
            place = place_on_map(splat, vec2(axis_offset(u, texel.x), axis_offset(v, texel.y)));
        } else {
            place = place_in_space(splat, frame);
        }
        if place.part > 0u {
            if splat.stamp == 0u {
                painted = dome_over(painted, splat, place);
            } else {
                painted = texture_over(painted, splat, place);
            }
            changed = true;
        }
    }

    if all(local.xy == vec2(0u)) {
        remember_drops(tile, batch.size / u32(TILE_SIZE));
    }
    if changed {
        textureStore(diffuse_map, texel, color_from_bytes(painted.diffuse));
        textureStore(specular_map, texel, color_from_bytes(painted.specular));
        textureStore(normal_map, texel, color_from_bytes(painted.normal));
    }
}
