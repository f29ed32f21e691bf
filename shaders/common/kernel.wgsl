// The arithmetic of a stamp, in 32-bit integers: twins of functions in `src/overlay/kernel.rs`. Positions
// are in 1/256 texel.

#define_import_path bevy_weathering::kernel

const SUBTEXELS: i32 = 256;

// What a texel of an 8-bit map holds, 0..=255 a channel.
fn bytes_from_color(color: vec4<f32>) -> vec4<u32> {
    return vec4<u32>(color * 255.0 + 0.5);
}

fn color_from_bytes(bytes: vec4<u32>) -> vec4<f32> {
    return vec4<f32>(bytes) / 255.0;
}

// Where a stamp lies along one axis; 1/256 texel.
struct Axis {
    // Middle of the stamp.
    center: i32,
    // Half its width, at least 1.
    radius: i32,
    // Texels of the map along this axis.
    size: i32,
    // Edges are clamped; else they repeat.
    clamped: bool,
}

// The number of a texel in the row of texels that begins where the stamp begins.
fn unwrapped(axis: Axis, texel: i32) -> i32 {
    if axis.clamped {
        return texel;
    }
    // At most one map before the texel, and less than one behind it: a remainder without a division.
    let first = (axis.center - axis.radius) >> 8u;
    let onward = texel - first;
    let ahead = onward + select(0, axis.size, onward < 0);
    return first + ahead - select(0, axis.size, ahead >= axis.size);
}

// Distance of the texel's middle from the stamp's along one axis, to the nearest; 256 is the radius.
fn axis_offset(axis: Axis, texel: i32) -> i32 {
    let from_center = unwrapped(axis, texel) * SUBTEXELS + SUBTEXELS / 2 - axis.center;
    let near = clamp(from_center, -2 * axis.radius, 2 * axis.radius);
    return (near * ((1 << 29u) / axis.radius) + (1 << 20u)) >> 21u;
}

// The dome (1 - d^2)^2 at an offset in 1/256 radius: 0..=4096.
fn falloff(offset: vec2<i32>) -> u32 {
    let square = u32(offset.x * offset.x + offset.y * offset.y);
    let height = 65536u - min(square, 65536u);
    return ((height >> 4u) * (height >> 4u)) >> 12u;
}

// Opacity (0..=255) under the dome.
fn stamp_alpha(opacity: u32, dome: u32) -> u32 {
    return (opacity * dome + 2048u) >> 12u;
}

// Two bytes in a number, each in its half.
const PAIR: u32 = 0x00ff00ffu;

// Red and blue, green and alpha of a colour.
fn pairs(bytes: vec4<u32>) -> vec2<u32> {
    return bytes.rg | (bytes.ba << vec2(16u));
}

fn unpaired(pairs: vec2<u32>) -> vec4<u32> {
    return vec4(pairs & vec2(PAIR & 0xffffu), pairs >> vec2(16u));
}

// Four channels over others, 0..=255, premultiplied, two in each multiplication: the twin of `blend_over`, which divides by 255;
// so does, rounded to the nearest, the sum of what is shifted here.
fn blend_pairs(source: vec2<u32>, alpha: u32, under: vec2<u32>) -> vec2<u32> {
    let mixed = source * alpha + under * (255u - alpha) + 0x00800080u;
    return ((mixed + ((mixed >> vec2(8u)) & vec2(PAIR))) >> vec2(8u)) & vec2(PAIR);
}

// The slope of a dome of height `bump` (-127..=127) at an offset, as a colour: 128 is flat.
fn slope_color(bump: i32, offset: i32) -> u32 {
    return u32(128 + clamp(bump * offset / 256, -127, 127));
}

// A row of the matrix from an offset in radii to the stamp's own axes, 1/1024, times the offset in 1/256 radius.
fn turned(row: vec2<i32>, offset: vec2<i32>) -> i32 {
    return (row.x * offset.x + row.y * offset.y) >> 10u;
}

// A row of the matrix from steps of the mesh's space to the stamp's own axes, times the way from the stamp's middle.
fn framed(row: vec3<i32>, away: vec3<i32>, reach: i32) -> i32 {
    let near = clamp(away, vec3(-reach), vec3(reach));
    return (row.x * near.x + row.y * near.y + row.z * near.z) >> 16u;
}

// Three signed bytes, the first in the lowest: a unit vector, 127 for 1.
fn unpack_axis(packed: u32) -> vec3<i32> {
    return vec3<i32>(vec3(packed << 24u, packed << 16u, packed << 8u)) >> vec3(24u);
}

// Of two unit vectors: 16,129 if they are the same.
fn dot_axes(a: vec3<i32>, b: vec3<i32>) -> i32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

// What stands upright on two unit vectors, 127 for 1.
fn cross_axes(a: vec3<i32>, b: vec3<i32>) -> vec3<i32> {
    return (a.yzx * b.zxy - a.zxy * b.yzx) / vec3(127);
}

// How much of a stamp reaches a texel so far in front of or behind its plane: 0..=256.
fn depth_part(depth: i32) -> u32 {
    return u32(clamp((128 - abs(depth)) * 4, 0, 256));
}

// How much of a stamp a texel gets whose normal has this dot product with that of the stamp: 0..=256.
fn facing_part(product: i32) -> u32 {
    return u32(clamp((product - 1613) / 12, 0, 256));
}

// A channel of a stamp, premultiplied, tinted, over another.
fn lay_stamp(channel: u32, tint: u32, opacity: u32, weight: u32, under: u32) -> u32 {
    return (channel * tint * opacity + under * (65025u - weight) + 32512u) / 65025u;
}

// From `dot_axes` to 1/1024: 16,129 is 1023.
fn axes_part(product: i32) -> i32 {
    return (product * 65) >> 10u;
}

// A slope of a stamp as a premultiplied colour.
fn stamp_slope(slopes: vec2<i32>, along: vec2<i32>, bump: i32, coverage: u32) -> u32 {
    let level = (128u * coverage + 127u) / 255u;
    let slope = turned(along, slopes) * bump / 127;
    return u32(clamp(i32(level) + slope, 0, i32(coverage)));
}

// How much a premultiplied colour of this coverage slopes: 0 if it is flat.
fn slope_of(color: u32, coverage: u32) -> i32 {
    return i32(color) - i32((128u * coverage + 127u) / 255u);
}
