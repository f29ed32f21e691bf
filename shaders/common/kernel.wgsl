// The arithmetic of a stamp, in 32-bit integers: the twin of `src/overlay/kernel.rs`, function by function. Positions
// are in 1/256 texel.

#define_import_path bevy_weathering::kernel

const SUBTEXELS: i32 = 256;
const CDF_STEPS: u32 = 768u;
const CDF_ONE: u32 = 65536u;

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

// Integral of the quadratic B-spline up to `step` of 768 steps across it: 0..=65536.
fn coverage_cdf(step: u32) -> u32 {
    let t = min(step, CDF_STEPS);
    let rest = CDF_STEPS - t;
    var scaled = 6u * 16777216u - rest * rest * rest;
    if t < 256u {
        scaled = t * t * t;
    } else if t < 512u {
        scaled = (9u * 256u * t * t + 3u * 16777216u) - (2u * t * t * t + 9u * 65536u * t);
    }
    return scaled / 1536u;
}

// value * part / 65536, rounded down, for part up to 65536.
fn scale_floor(value: u32, part: u32) -> u32 {
    return (value >> 16u) * part + (((value & 0xffffu) * part) >> 16u);
}

// The number of a texel in the row of texels that begins where the stamp begins.
fn unwrapped(axis: Axis, texel: i32) -> i32 {
    if axis.clamped {
        return texel;
    }
    let first = (axis.center - axis.radius) >> 8u;
    return first + (texel - first + 2 * axis.size) % axis.size;
}

// Parts of a stamp before the texel and before its end, along one axis.
fn axis_coverage(axis: Axis, texel: i32) -> vec2<u32> {
    let at = unwrapped(axis, texel);
    let first_texel = axis.clamped && texel == 0;
    let last_texel = axis.clamped && texel == axis.size - 1;
    let before = select(coverage_cdf(cdf_step(axis, at * SUBTEXELS)), 0u, first_texel);
    let until = select(coverage_cdf(cdf_step(axis, (at + 1) * SUBTEXELS)), CDF_ONE, last_texel);
    return vec2(before, until);
}

// How far across the bump an edge lies, in steps of `coverage_cdf`.
fn cdf_step(axis: Axis, edge: i32) -> u32 {
    let into = clamp(edge - (axis.center - axis.radius), 0, 2 * axis.radius);
    return u32(into) * CDF_STEPS / (2u * u32(axis.radius));
}

// Water that a texel gets from a stamp of `volume`.
fn share(volume: u32, column: vec2<u32>, row: vec2<u32>) -> u32 {
    let in_row = scale_floor(volume, row.y) - scale_floor(volume, row.x);
    return scale_floor(in_row, column.y) - scale_floor(in_row, column.x);
}

// Distance of the texel's middle from the stamp's along one axis; 256 is the radius.
fn axis_offset(axis: Axis, texel: i32) -> i32 {
    let from_center = unwrapped(axis, texel) * SUBTEXELS + SUBTEXELS / 2 - axis.center;
    return clamp(from_center, -2 * axis.radius, 2 * axis.radius) * 256 / axis.radius;
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

// One channel over another, 0..=255, premultiplied.
fn blend_over(source: u32, alpha: u32, under: u32) -> u32 {
    return (source * alpha + under * (255u - alpha) + 127u) / 255u;
}

// The slope of a dome of height `bump` (-127..=127) at an offset, as a colour: 128 is flat.
fn slope_color(bump: i32, offset: i32) -> u32 {
    return u32(128 + clamp(bump * offset / 256, -127, 127));
}
