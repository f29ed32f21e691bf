// Paints a batch of splats into the maps of one surface.
//
// One workgroup per touched tile of 16x16 texels; each invocation paints four of them, eight texels apart, so that a splat is
// fetched and taken apart once for four. It walks the tile's list of splats, in the order of their impacts, and reads and writes
// its texels once. Edges of the map are a remainder in `kernel`.
//
// What a batch holds is known before it is painted: ON_MAP, IN_SPACE, DOMES and STAMPS say so, at least one of either two. Without
// any of them there would be branches, of which some drivers always run both sides.

#import bevy_weathering::kernel::{
    Axis, axes_part, axis_offset, blend_pairs, bytes_from_color, color_from_bytes, cross_axes, depth_part, dot_axes, facing_part,
    falloff, framed, lay_stamp, pairs, slope_color, slope_of, stamp_alpha, stamp_slope, turned, unpack_axis, unpaired
}
#import bevy_weathering::stamp::{StampTexel, STAMP_SIZE, mix4, on_stamp, stamp_corners}

// A stamp; the twin of `Splat` in `src/overlay/splat.rs`.
struct Splat {
    // Middle, 1/256 texel.
    center: vec2<i32>,
    // Half width and height, 1/256 texel.
    radius: vec2<i32>,
    // RGB and opacity, 8 bits each.
    diffuse: vec4<u32>,
    // Reflectance, smoothness, unused, opacity.
    specular: vec4<u32>,
    // Slope at the rim, -127..=127.
    bump: i32,
    // 0..=255.
    bump_opacity: u32,
    // 0 is a round dome, others are stamps of the atlas, from 1.
    stamp: u32,
    // 0: on the map, by center and radius. 1: in the space of the mesh, by what follows.
    in_space: u32,
    // Matrix from the way from the middle to the stamp's own axes.
    row_s: vec3<i32>,
    row_t: vec3<i32>,
    row_n: vec3<i32>,
    // In space: its middle, steps.
    origin: vec3<i32>,
    // In space: twice its radius, steps.
    reach: i32,
    // In space: the axes, 127 for 1.
    axis_s: vec3<i32>,
    axis_t: vec3<i32>,
    axis_n: vec3<i32>,
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
// Texels between two that an invocation paints.
const STRIDE: i32 = 8;
// Texels of a splat, and of a row of `splats`.
const SPLAT_TEXELS: u32 = 7u;
const SPLAT_ROW_BITS: u32 = 10u;
// Entries in a row of `splat_list`.
const LIST_ROW_BITS: u32 = 12u;
// Stamps in a row of the atlas.
const STAMPS_ALONG: u32 = 32u;
// Drops that a tile remembers, the newest first.
const RINGS_PER_TILE: u32 = 4u;

// The twin of `SurfaceBatch` in `src/overlay/gpu/prepare.rs`.
struct SurfaceBatch {
    // Texels along each side of the maps.
    size: u32,
    // The batch's first row in `tiles`.
    first_tile: u32,
    // How many rows it has there.
    tiles: u32,
    // Edges along u and v: 1 clamps, 0 repeats.
    clamped: vec2<u32>,
}

@group(0) @binding(0) var<uniform> batch: SurfaceBatch;
// Seven texels a splat, one row after the other: of buffers, some drivers read one number of one invocation at a time.
@group(0) @binding(1) var splats: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> tiles: array<TileHeader>;
@group(0) @binding(3) var splat_list: texture_2d<u32>;
// The atlas: `StampTexel`s, STAMPS_ALONG stamps beside each other.
@group(0) @binding(4) var stamps: texture_2d<u32>;

@group(1) @binding(0) var diffuse_map: texture_storage_2d<rgba8unorm, read_write>;
@group(1) @binding(1) var specular_map: texture_storage_2d<rgba8unorm, read_write>;
@group(1) @binding(2) var normal_map: texture_storage_2d<rgba8unorm, read_write>;
@group(1) @binding(3) var<storage, read_write> rings: array<RainRing>;
// A single one while nothing lies in space.
@group(1) @binding(4) var<storage, read> frames: array<TexelFrame>;

// What a texel of the maps holds: of each colour red and blue, green and alpha, a byte in each half.
struct Painted {
    diffuse: vec2<u32>,
    specular: vec2<u32>,
    normal: vec2<u32>,
}

// Where a texel lies on a stamp; the twin of `Place` in `src/overlay/cpu.rs`.
struct Place {
    // Along the stamp's own axes, 1/256 radius.
    offset: vec2<i32>,
    // For u and v: their parts along the stamp's axes, 1024 for 1.
    along_u: vec2<i32>,
    along_v: vec2<i32>,
    // How much of the stamp reaches it, 0..=256.
    part: u32,
}

// The number of a splat, from the lists of all tiles.
fn listed(entry: u32) -> u32 {
    return textureLoad(splat_list, vec2(entry & ((1u << LIST_ROW_BITS) - 1u), entry >> LIST_ROW_BITS), 0).r;
}

// One of the texels of a splat.
fn splat_texel(index: u32, texel: u32) -> vec4<u32> {
    let at = index * SPLAT_TEXELS + texel;
    return textureLoad(splats, vec2(at & ((1u << SPLAT_ROW_BITS) - 1u), at >> SPLAT_ROW_BITS), 0);
}

// What this batch needs of a splat; the rest is 0.
fn splat_at(index: u32) -> Splat {
    let paint = splat_texel(index, 1u);
    let shape = splat_texel(index, 2u);
    var splat: Splat;
    splat.diffuse = unpack_bytes(paint.x);
    splat.specular = unpack_bytes(paint.y);
    splat.bump = i32(paint.z);
    splat.bump_opacity = paint.w;
    splat.stamp = shape.x;
    splat.in_space = shape.y;
#ifdef ON_MAP
    let place = vec4<i32>(splat_texel(index, 0u));
    splat.center = place.xy;
    splat.radius = place.zw;
#endif
#ifdef IN_SPACE
    let n = splat_texel(index, 5u);
    let middle = splat_texel(index, 6u);
    splat.row_n = vec3<i32>(n.xyz);
    splat.axis_t = unpack_axis(n.w);
    splat.origin = vec3<i32>(middle.xyz);
    splat.axis_n = unpack_axis(middle.w);
#endif
    // Domes on the map have no axes.
#ifdef NEEDS_AXES
    let s = splat_texel(index, 3u);
    let t = splat_texel(index, 4u);
    splat.row_s = vec3<i32>(s.xyz);
    splat.reach = i32(s.w);
    splat.row_t = vec3<i32>(t.xyz);
    splat.axis_s = unpack_axis(t.w);
#endif
    return splat;
}

// Of a splat on the map: where a texel lies whose middle is so far from the splat's.
fn place_on_map(splat: Splat, offset: vec2<i32>) -> Place {
#ifdef STAMPS
    let s = splat.row_s.xy;
    let t = splat.row_t.xy;
    // A corner of a turned stamp that hangs out of its box is cut off.
    let part = select(0u, 256u, on_stamp(offset));
    let stamp = Place(vec2(turned(s, offset), turned(t, offset)), vec2(s.x, t.x), vec2(s.y, t.y), part);
#endif
    let dome = Place(offset, vec2(1024, 0), vec2(0, 1024), 256u);
#ifdef STAMPS
#ifdef DOMES
    if splat.stamp == 0u {
        return dome;
    }
#endif
    return stamp;
#else
    return dome;
#endif
}

// What of a texel's frame all splats need.
struct Standing {
    at: vec3<i32>,
    normal: vec3<i32>,
    u: vec3<i32>,
    v: vec3<i32>,
    // 256 if anything lies here, else 0.
    part: u32,
}

fn standing_at(frame: TexelFrame) -> Standing {
    let normal = unpack_axis(frame.normal);
    let u = unpack_axis(frame.along_u);
    let marks = frame.z >> 16u;
    return Standing(
        vec3<i32>(vec3(frame.xy & 0xffffu, frame.xy >> 16u, frame.z & 0xffffu)),
        normal,
        u,
        cross_axes(normal, u) * select(1, -1, (marks & 2u) != 0u),
        select(256u, 0u, marks == 0u),
    );
}

fn place_in_space(splat: Splat, texel: Standing) -> Place {
    let away = texel.at - splat.origin;
    let s = framed(splat.row_s, away, splat.reach);
    let t = framed(splat.row_t, away, splat.reach);
    let n = framed(splat.row_n, away, splat.reach);
    let facing = facing_part(dot_axes(texel.normal, splat.axis_n));
    let part = select(0u, (depth_part(n) * facing) >> 8u, on_stamp(vec2(s, t)));
    return Place(
        vec2(s, t),
        vec2(axes_part(dot_axes(texel.u, splat.axis_s)), axes_part(dot_axes(texel.u, splat.axis_t))),
        vec2(axes_part(dot_axes(texel.v, splat.axis_s)), axes_part(dot_axes(texel.v, splat.axis_t))),
        (part * texel.part) >> 8u,
    );
}

// A colour over a texel, premultiplied.
fn paint_over(under: vec2<u32>, color: vec3<u32>, alpha: u32) -> vec2<u32> {
    return blend_pairs(pairs(vec4(color, 255u)), alpha, under);
}

// A colour of a stamp over a texel.
fn stamp_over(under: vec2<u32>, color: vec4<u32>, tint: vec3<u32>, opacity: u32) -> vec2<u32> {
    let weight = color.a * opacity;
    let bytes = unpaired(under);
    return pairs(vec4(
        lay_stamp(color.r, tint.r, opacity, weight, bytes.r),
        lay_stamp(color.g, tint.g, opacity, weight, bytes.g),
        lay_stamp(color.b, tint.b, opacity, weight, bytes.b),
        lay_stamp(color.a, 255u, opacity, weight, bytes.a),
    ));
}

// A round dome over a texel.
fn dome_over(under: Painted, splat: Splat, place: Place) -> Painted {
    let dome = falloff(place.offset);
    let paint = splat.diffuse;
    let gloss = splat.specular;
    let slopes = vec2(
        slope_color(splat.bump, turned(place.along_u, place.offset)),
        slope_color(splat.bump, turned(place.along_v, place.offset)),
    );
    return Painted(
        paint_over(under.diffuse, paint.rgb, stamp_alpha((paint.a * place.part) >> 8u, dome)),
        paint_over(under.specular, gloss.rgb, stamp_alpha((gloss.a * place.part) >> 8u, dome)),
        paint_over(under.normal, vec3(slopes, 255u), stamp_alpha((splat.bump_opacity * place.part) >> 8u, dome)),
    );
}

// A texel of the atlas.
fn stamp_texel(stamp: u32, index: u32) -> StampTexel {
    let tile = vec2(stamp % STAMPS_ALONG, stamp / STAMPS_ALONG);
    let texel = textureLoad(stamps, tile * STAMP_SIZE + vec2(index % STAMP_SIZE, index / STAMP_SIZE), 0);
    return StampTexel(texel.x, texel.y, texel.z, texel.w);
}

// A stamp of the atlas over a texel.
fn texture_over(under: Painted, splat: Splat, place: Place) -> Painted {
    let corners = stamp_corners(place.offset);
    let count = textureDimensions(stamps).y / STAMP_SIZE * STAMPS_ALONG;
    let stamp = min(splat.stamp, count) - 1u;
    let a = stamp_texel(stamp, corners.texels.x);
    let b = stamp_texel(stamp, corners.texels.y);
    let c = stamp_texel(stamp, corners.texels.z);
    let d = stamp_texel(stamp, corners.texels.w);
    let w = corners.weights;
    let paint = splat.diffuse;
    let gloss = splat.specular;
    let part = select(0u, place.part, on_stamp(place.offset) && splat.stamp <= count);
    let diffuse = unpack_bytes(mix4(a.diffuse, b.diffuse, c.diffuse, d.diffuse, w.x, w.y));
    let specular = unpack_bytes(mix4(a.specular, b.specular, c.specular, d.specular, w.x, w.y));
    let normal = unpack_bytes(mix4(a.normal, b.normal, c.normal, d.normal, w.x, w.y));
    let slopes = vec2(slope_of(normal.r, normal.a), slope_of(normal.g, normal.a));
    let leaning = vec4(
        stamp_slope(slopes, place.along_u, splat.bump, normal.a),
        stamp_slope(slopes, place.along_v, splat.bump, normal.a),
        normal.a,
        normal.a,
    );
    return Painted(
        stamp_over(under.diffuse, diffuse, paint.rgb, (paint.a * part) >> 8u),
        stamp_over(under.specular, specular, gloss.rgb, (gloss.a * part) >> 8u),
        stamp_over(under.normal, leaning, vec3(255u), (splat.bump_opacity * part) >> 8u),
    );
}

// A splat over a texel. Where it does not reach, its part is 0, which leaves the texel as it is.
fn splat_over(under: Painted, splat: Splat, place: Place) -> Painted {
#ifdef DOMES
#ifdef STAMPS
    if splat.stamp == 0u {
        return dome_over(under, splat, place);
    }
    return texture_over(under, splat, place);
#else
    return dome_over(under, splat, place);
#endif
#else
    return texture_over(under, splat, place);
#endif
}

fn unpack_bytes(packed: u32) -> vec4<u32> {
    return vec4(packed, packed >> 8u, packed >> 16u, packed >> 24u) & vec4(0xffu);
}

// Puts the newest drops that fell into a tile before those it remembers: one invocation for each tile.
@compute @workgroup_size(64)
fn remember_drops(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= batch.tiles {
        return;
    }
    let tile = tiles[batch.first_tile + id.x];
    let first = (tile.y * (batch.size / u32(TILE_SIZE)) + tile.x) * RINGS_PER_TILE;
    var fallen: array<RainRing, RINGS_PER_TILE>;
    var count = 0u;
    for (var i = tile.count; i > 0u && count < RINGS_PER_TILE; i -= 1u) {
        let index = listed(tile.start + i - 1u);
        let center = vec2<i32>(splat_texel(index, 0u).xy);
        let shape = splat_texel(index, 2u);
        let home = center >> vec2(8u);
        if shape.z > 0u && all(home / TILE_SIZE == vec2(i32(tile.x), i32(tile.y))) {
            fallen[count] = RainRing(center, shape.w, shape.z);
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

fn painted_at(texel: vec2<i32>) -> Painted {
    return Painted(
        pairs(bytes_from_color(textureLoad(diffuse_map, texel))),
        pairs(bytes_from_color(textureLoad(specular_map, texel))),
        pairs(bytes_from_color(textureLoad(normal_map, texel))),
    );
}

fn store(texel: vec2<i32>, painted: Painted) {
    textureStore(diffuse_map, texel, color_from_bytes(unpaired(painted.diffuse)));
    textureStore(specular_map, texel, color_from_bytes(unpaired(painted.specular)));
    textureStore(normal_map, texel, color_from_bytes(unpaired(painted.normal)));
}

fn frame_at(texel: vec2<i32>) -> Standing {
    return standing_at(frames[min(u32(texel.y) * batch.size + u32(texel.x), arrayLength(&frames) - 1u)]);
}

@compute @workgroup_size(8, 8)
fn paint_splats(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let tile = tiles[batch.first_tile + workgroup.x];
    let size = i32(batch.size);
    // The four texels: a, to its right b, above it c, d.
    let a = vec2<i32>(vec2(tile.x, tile.y) * u32(TILE_SIZE) + local.xy);
    let b = a + vec2(STRIDE, 0);
    let c = a + vec2(0, STRIDE);
    let d = a + vec2(STRIDE, STRIDE);
    var painted_a = painted_at(a);
    var painted_b = painted_at(b);
    var painted_c = painted_at(c);
    var painted_d = painted_at(d);
#ifdef IN_SPACE
    let standing_a = frame_at(a);
    let standing_b = frame_at(b);
    let standing_c = frame_at(c);
    let standing_d = frame_at(d);
#endif

    for (var i = tile.start; i < tile.start + tile.count; i += 1u) {
        let splat = splat_at(listed(i));
        var place_a: Place;
        var place_b: Place;
        var place_c: Place;
        var place_d: Place;
#ifdef ON_MAP
        let u = Axis(splat.center.x, splat.radius.x, size, batch.clamped.x != 0u);
        let v = Axis(splat.center.y, splat.radius.y, size, batch.clamped.y != 0u);
        let near = vec2(axis_offset(u, a.x), axis_offset(v, a.y));
        let far = vec2(axis_offset(u, d.x), axis_offset(v, d.y));
        place_a = place_on_map(splat, near);
        place_b = place_on_map(splat, vec2(far.x, near.y));
        place_c = place_on_map(splat, vec2(near.x, far.y));
        place_d = place_on_map(splat, far);
#endif
#ifdef IN_SPACE
#ifdef ON_MAP
        if splat.in_space != 0u {
#endif
            place_a = place_in_space(splat, standing_a);
            place_b = place_in_space(splat, standing_b);
            place_c = place_in_space(splat, standing_c);
            place_d = place_in_space(splat, standing_d);
#ifdef ON_MAP
        }
#endif
#endif
        painted_a = splat_over(painted_a, splat, place_a);
        painted_b = splat_over(painted_b, splat, place_b);
        painted_c = splat_over(painted_c, splat, place_c);
        painted_d = splat_over(painted_d, splat, place_d);
    }

    store(a, painted_a);
    store(b, painted_b);
    store(c, painted_c);
    store(d, painted_d);
}
