// The arithmetic of a stamp, in 32-bit integers: twins of functions in `src/overlay/kernel.rs`. Positions
// are in 1/256 texel.

#define_import_path bevy_weathering::kernel

const SUBTEXELS: i32 = 256;

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
    let first = (axis.center - axis.radius) >> 8u;
    return first + (texel - first + 2 * axis.size) % axis.size;
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
