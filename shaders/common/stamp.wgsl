// Reading between the texels of a stamp, in 32-bit integers: twins of functions in `src/stamps/sample.rs`.

#define_import_path bevy_weathering::stamp

// A texel of a stamp: three premultiplied RGBA colours, red in the lowest byte. The twin of `StampTexel` in
// `src/stamps/read.rs`.
struct StampTexel {
    // Tint and coverage.
    diffuse: u32,
    // Reflectance, smoothness, unused, coverage.
    specular: u32,
    // Slope along u and v (128 is flat), height, coverage.
    normal: u32,
    pad: u32,
}

// Four texels about a point, and where it lies between them.
struct StampCorners {
    // At the lower u and v, at the higher u, at the higher v, at both.
    texels: vec4<u32>,
    // How much of the way to the higher u and v: 0..=16.
    weights: vec2<u32>,
}

// Texels along each side of a stamp.
const STAMP_SIZE: u32 = 64u;
// Texels of a stamp.
const STAMP_TEXELS: u32 = 4096u;
// The weights along one axis, together.
const WEIGHT_ONE: u32 = 16u;
// Every other byte.
const LANES: u32 = 0x00ff00ffu;

// Whether there is anything of a stamp at an offset from its middle, in 1/256 radius.
fn on_stamp(offset: vec2<i32>) -> bool {
    return all(offset >= vec2(-256)) && all(offset <= vec2(256));
}

// The texels before and after along one axis, and the weight of the latter.
fn axis_corners(offset: i32) -> vec3<u32> {
    // From the middle of the first texel, 8 to a texel. The shift and the mask round down, also below 0.
    let at = clamp(offset, -256, 256) + 252;
    let before = at >> 3u;
    return vec3(
        u32(clamp(before, 0, 63)),
        u32(clamp(before + 1, 0, 63)),
        2u * u32(at & 7),
    );
}

// What to read of a stamp at an offset from its middle, in 1/256 radius.
fn stamp_corners(offset: vec2<i32>) -> StampCorners {
    let u = axis_corners(offset.x);
    let v = axis_corners(offset.y);
    let rows = v.xy * STAMP_SIZE;
    return StampCorners(
        vec4(rows.x + u.x, rows.x + u.y, rows.y + u.x, rows.y + u.y),
        vec2(u.z, v.z),
    );
}

// 256 times the mean of two bytes at once, each in 16 bits, and a half.
fn weighted(lanes: vec4<u32>, weights: vec4<u32>) -> u32 {
    return lanes.x * weights.x + lanes.y * weights.y + lanes.z * weights.z + lanes.w * weights.w + 0x00800080u;
}

// Four packed texels, in the order of `StampCorners`, interpolated byte by byte and rounded to the nearest.
fn mix4(a: u32, b: u32, c: u32, d: u32, wx: u32, wy: u32) -> u32 {
    let corners = vec4(a, b, c, d);
    let rest = vec2(WEIGHT_ONE) - vec2(wx, wy);
    let weights = vec4(rest.x * rest.y, wx * rest.y, rest.x * wy, wx * wy);
    let even = weighted(corners & vec4(LANES), weights);
    let odd = weighted((corners >> vec4(8u)) & vec4(LANES), weights);
    return ((even >> 8u) & LANES) | (odd & ~LANES);
}
