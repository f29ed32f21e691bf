//! The arithmetic of a stamp, in integers.
//!
//! Positions are in 1/256 texel. Every function has a twin of the same name in `shaders/common/kernel.wgsl`; both
//! use 32-bit integers alone, so CPU and GPU agree to the bit on any driver.
//!
//! # Water
//! A stamp spreads its water by a separable bump, the quadratic B-spline along u times that along v, which is
//! nearly round. What a texel gets is a difference of the bump's integral ([`coverage_cdf`]) at its two edges,
//! first for its row, then within the row ([`share`]). The differences telescope: whatever is rounded off one
//! texel is given to its neighbour, and the sum over all texels is exactly the water of the stamp.
//!
//! # Colour
//! Colours lie under a round dome `(1 - d²)²` ([`falloff`]), composited in sequence ([`blend_over`]), premultiplied,
//! rounded to 8 bits after each stamp, so that it does not matter how stamps are split over passes.

/// Units of the fixed-point positions in one texel.
pub const SUBTEXELS: i32 = 256;

/// Steps across the bump in [`coverage_cdf`]: 256 for each of the three pieces of the spline.
pub const CDF_STEPS: u32 = 768;

/// `coverage_cdf` of the whole bump; 1.0 in 16-bit fixed point.
pub const CDF_ONE: u32 = 65_536;

/// Where a stamp lies along one axis; 1/256 texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Axis {
    /// Middle of the stamp: in [0, size), or beyond on a clamped axis.
    pub center: i32,
    /// Half its width, at least 1.
    pub radius: i32,
    /// Texels of the map along this axis.
    pub size: i32,
    /// Edges are clamped; else they repeat.
    pub clamped: bool,
}

/// Integral of the quadratic B-spline from its left end to `step` of [`CDF_STEPS`] steps across it: 0..=[`CDF_ONE`].
///
/// With t = step/256 in [0, 3]: t³/6, then (-2t³ + 9t² - 9t + 3)/6, then 1 - (3-t)³/6. Rises monotonically, since
/// it is an exact integer cubic before the one division.
pub fn coverage_cdf(step: u32) -> u32 {
    let t = step.min(CDF_STEPS);
    // 6 · 256³ · integral, at most 100,663,296.
    let scaled = if t < 256 {
        t * t * t
    } else if t < 512 {
        (9 * 256 * t * t + 3 * 16_777_216) - (2 * t * t * t + 9 * 65_536 * t)
    } else {
        let rest = CDF_STEPS - t;
        6 * 16_777_216 - rest * rest * rest
    };
    scaled / 1536
}

/// `value · part / 65,536`, rounded down, for `part` up to [`CDF_ONE`], without 64-bit numbers.
pub fn scale_floor(value: u32, part: u32) -> u32 {
    (value >> 16) * part + (((value & 0xffff) * part) >> 16)
}

/// The number of the texel `texel` in the row of texels that begins where the stamp begins: the first texel a stamp
/// touches and those after it, across a repeating edge. Equal to `texel` on a clamped axis.
pub fn unwrapped(axis: Axis, texel: i32) -> i32 {
    if axis.clamped {
        return texel;
    }
    // At most one map before the texel, and less than one behind it: a remainder without a division.
    let first = (axis.center - axis.radius) >> 8;
    let onward = texel - first;
    let onward = if onward < 0 { onward + axis.size } else { onward };
    first + if onward >= axis.size { onward - axis.size } else { onward }
}

/// Parts of a stamp that lie before the texel and before its end, along one axis. On a clamped axis the outermost
/// texels own what lies beyond the edge.
pub fn axis_coverage(axis: Axis, texel: i32) -> [u32; 2] {
    let at = unwrapped(axis, texel);
    let first_texel = axis.clamped && texel == 0;
    let last_texel = axis.clamped && texel == axis.size - 1;
    let before = if first_texel { 0 } else { coverage_cdf(cdf_step(axis, at * SUBTEXELS)) };
    let until = if last_texel { CDF_ONE } else { coverage_cdf(cdf_step(axis, (at + 1) * SUBTEXELS)) };
    [before, until]
}

/// How far across the bump `edge` lies, in steps of [`coverage_cdf`].
fn cdf_step(axis: Axis, edge: i32) -> u32 {
    let into = (edge - (axis.center - axis.radius)).clamp(0, 2 * axis.radius);
    into as u32 * CDF_STEPS / (2 * axis.radius as u32)
}

/// The part of `volume` that lies between the two ends of a coverage: of a stamp in a row and, of that, in a texel.
pub fn share(volume: u32, coverage: [u32; 2]) -> u32 {
    scale_floor(volume, coverage[1]) - scale_floor(volume, coverage[0])
}

/// Distance of the texel's middle from the stamp's, along one axis, to the nearest; 256 is the radius. Within 1/2 of that for radii
/// of up to 1024 texels.
pub fn axis_offset(axis: Axis, texel: i32) -> i32 {
    let from_center = unwrapped(axis, texel) * SUBTEXELS + SUBTEXELS / 2 - axis.center;
    // Clamped before scaling: beyond the radius it does not matter by how much. The one division is the same for all texels.
    let near = from_center.clamp(-2 * axis.radius, 2 * axis.radius);
    (near * ((1 << 29) / axis.radius) + (1 << 20)) >> 21
}

/// The dome `(1 - d²)²` at an offset in 1/256 radius: 0..=4096.
pub fn falloff(offset: [i32; 2]) -> u32 {
    let square = (offset[0] * offset[0] + offset[1] * offset[1]) as u32;
    let height = 65_536 - square.min(65_536);
    ((height >> 4) * (height >> 4)) >> 12
}

/// `opacity` (0..=255) under the dome.
pub fn stamp_alpha(opacity: u32, falloff: u32) -> u32 {
    (opacity * falloff + 2048) >> 12
}

/// One channel of `source` over `under`, 0..=255, premultiplied: `source · alpha + under · (1 - alpha)`, rounded.
pub fn blend_over(source: u32, alpha: u32, under: u32) -> u32 {
    (source * alpha + under * (255 - alpha) + 127) / 255
}

/// The slope of a dome of height `bump` (-127..=127) at an offset along one axis, as a colour: 128 is flat.
pub fn slope_color(bump: i32, offset: i32) -> u32 {
    (128 + (bump * offset / 256).clamp(-127, 127)) as u32
}

/// A row of the matrix from an offset in radii to the stamp's own axes, 1/1024, times the offset in 1/256 radius.
pub fn turned(row: [i32; 2], offset: [i32; 2]) -> i32 {
    (row[0] * offset[0] + row[1] * offset[1]) >> 10
}

/// A row of the matrix from steps of the mesh's space to the stamp's own axes, 1/65,536 of 1/256 radius, times the way from
/// the middle of the stamp. `reach`: twice the radius in steps; what is farther off is outside anyway.
pub fn framed(row: [i32; 3], away: [i32; 3], reach: i32) -> i32 {
    let [x, y, z] = away.map(|along| along.clamp(-reach, reach));
    (row[0] * x + row[1] * y + row[2] * z) >> 16
}

/// Three signed bytes, the first in the lowest: a unit vector, 127 for 1.
pub fn unpack_axis(packed: u32) -> [i32; 3] {
    [packed << 24, packed << 16, packed << 8].map(|shifted| shifted as i32 >> 24)
}

/// Of two unit vectors: 16,129 if they are the same.
pub fn dot_axes(a: [i32; 3], b: [i32; 3]) -> i32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// What stands upright on two unit vectors, 127 for 1.
pub fn cross_axes(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    let part = |i: usize, j: usize| (a[i] * b[j] - a[j] * b[i]) / 127;
    [part(1, 2), part(2, 0), part(0, 1)]
}

/// How much of a stamp reaches a texel `depth` (1/256 radius) in front of or behind its plane: 0..=256, all of it up to a
/// quarter of the radius, nothing from a half on.
pub fn depth_part(depth: i32) -> u32 {
    ((128 - depth.abs()) * 4).clamp(0, 256) as u32
}

/// How much of a stamp a texel gets whose normal has this [`dot_axes`] with that of the stamp: 0..=256, all of it up to 73
/// degrees, nothing from 84 on.
pub fn facing_part(dot: i32) -> u32 {
    ((dot - 1613) / 12).clamp(0, 256) as u32
}

/// A channel of a stamp, premultiplied, tinted, over another. `weight`: coverage of the stamp times its opacity, 0..=65,025.
pub fn lay_stamp(channel: u32, tint: u32, opacity: u32, weight: u32, under: u32) -> u32 {
    (channel * tint * opacity + under * (65_025 - weight) + 32_512) / 65_025
}

/// From [`dot_axes`] to 1/1024: 16,129 is 1023.
pub fn axes_part(dot: i32) -> i32 {
    (dot * 65) >> 10
}

/// A slope of a stamp as a premultiplied colour, from its premultiplied slopes along its own axes and how these lie on the
/// map, 1024 for 1; scaled by `bump` of 127.
pub fn stamp_slope(slopes: [i32; 2], along: [i32; 2], bump: i32, coverage: u32) -> u32 {
    let flat = (128 * coverage + 127) / 255;
    let slope = turned(along, slopes) * bump / 127;
    (flat as i32 + slope).clamp(0, coverage as i32) as u32
}

/// How much a premultiplied colour of this coverage slopes: 0 if it is flat.
pub fn slope_of(color: u32, coverage: u32) -> i32 {
    color as i32 - ((128 * coverage + 127) / 255) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_integral_rises_from_nothing_to_one() {
        assert_eq!(coverage_cdf(0), 0);
        assert_eq!(coverage_cdf(CDF_STEPS / 2), CDF_ONE / 2);
        assert_eq!(coverage_cdf(CDF_STEPS), CDF_ONE);
        assert_eq!(coverage_cdf(u32::MAX), CDF_ONE);
        for step in 0..CDF_STEPS {
            let (here, next) = (coverage_cdf(step), coverage_cdf(step + 1));
            assert!(here <= next && next - here < 400, "step {step}: {here} {next}");
            let mirrored = CDF_ONE - coverage_cdf(CDF_STEPS - step);
            assert!(here.abs_diff(mirrored) <= 1, "not symmetric at {step}");
        }
    }

    #[test]
    fn scale_floor_is_a_64_bit_product() {
        for value in [0, 1, 65_535, 65_536, 123_456_789, u32::MAX] {
            for part in [0, 1, 77, 32_768, 65_535, CDF_ONE] {
                let expected = (u64::from(value) * u64::from(part)) >> 16;
                assert_eq!(u64::from(scale_floor(value, part)), expected, "{value} · {part}");
            }
        }
    }

    /// Sum of the water over a whole map.
    fn deposited(u: Axis, v: Axis, volume: u32) -> u64 {
        let column = |x| axis_coverage(u, x);
        (0..v.size)
            .flat_map(|y| (0..u.size).map(move |x| (x, axis_coverage(v, y))))
            .map(|(x, row)| u64::from(share(share(volume, row), column(x))))
            .sum()
    }

    #[test]
    fn every_nanolitre_ends_up_in_the_map_wherever_the_stamp_lies() {
        for clamped in [false, true] {
            for center in [0, 1, 127, 128, 255, 16 * 128, 16 * 256 - 1] {
                for radius in [1, 40, 128, 300, 1000, 1900] {
                    let axis = Axis { center, radius, size: 16, clamped };
                    let other = Axis { center: 2000, radius: 500, size: 16, clamped };
                    for volume in [0, 1, 4189, 1_000_000_000, u32::MAX] {
                        assert_eq!(deposited(axis, other, volume), u64::from(volume), "{axis:?}");
                        assert_eq!(deposited(other, axis, volume), u64::from(volume), "{axis:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_stamp_over_the_edge_is_the_stamp_in_the_middle_moved() {
        let axis = |center| Axis { center, radius: 700, size: 32, clamped: false };
        let middle = axis(16 * 256 + 50);
        let edge = axis(50);
        for texel in 0..32 {
            let moved = (texel + 16) % 32;
            assert_eq!(axis_coverage(edge, texel), axis_coverage(middle, moved));
            assert_eq!(axis_offset(edge, texel), axis_offset(middle, moved));
        }
    }

    #[test]
    fn the_dome_is_round_and_ends_at_the_radius() {
        assert_eq!(falloff([0, 0]), 4096);
        assert_eq!(falloff([256, 0]), 0);
        assert_eq!(falloff([-300, 200]), 0);
        assert!(falloff([181, 0]).abs_diff(1024) < 20);
        assert_eq!(falloff([120, 35]), falloff([-35, 120]));
    }

    #[test]
    fn a_stamp_without_coverage_changes_nothing_and_a_full_one_everything() {
        for under in 0..=255 {
            assert_eq!(lay_stamp(0, 255, 255, 0, under), under);
            assert_eq!(lay_stamp(77, 255, 255, 65_025, under), 77);
            assert_eq!(lay_stamp(255, 77, 255, 65_025, under), 77);
            // A premultiplied grey over the same grey.
            let half = lay_stamp(under * 128 / 255, 255, 255, 128 * 255, under);
            assert!(half.abs_diff(under) <= 1, "{under} {half}");
        }
    }

    #[test]
    fn frames_are_what_the_same_in_floats_is() {
        // A stamp of radius 1,000 steps, turned by 30 degrees about the first axis.
        let scale = 256.0 / 1000.0 * 65_536.0;
        let row = |v: [f64; 3]| v.map(|part| (part * scale).round() as i32);
        let (sin, cos) = (0.5, 0.75f64.sqrt());
        for away in [[0, 0, 0], [300, -200, 640], [-1000, 0, 0], [90_000, -65_535, 4]] {
            let float = away.map(|along: i32| f64::from(along.clamp(-2000, 2000)));
            let rotated = [float[0], cos * float[1] + sin * float[2], cos * float[2] - sin * float[1]];
            for (axis, expected) in
                [[1.0, 0.0, 0.0], [0.0, cos, sin], [0.0, -sin, cos]].into_iter().zip(rotated)
            {
                let got = framed(row(axis), away, 2000);
                assert!((f64::from(got) - expected * 0.256).abs() <= 1.1, "{away:?} {got} {expected}");
            }
        }
    }

    #[test]
    fn axes_and_parts() {
        let pack = |v: [i8; 3]| u32::from_le_bytes([v[0] as u8, v[1] as u8, v[2] as u8, 9]);
        assert_eq!(unpack_axis(pack([127, -127, -3])), [127, -127, -3]);
        assert_eq!(dot_axes([127, 0, 0], [127, 5, 5]), 16_129);
        assert_eq!(
            (facing_part(16_129), facing_part(4700), facing_part(1000), facing_part(-16_129)),
            (256, 256, 0, 0)
        );
        assert_eq!((depth_part(0), depth_part(-64), depth_part(96), depth_part(-128)), (256, 256, 128, 0));
        assert_eq!((turned([1024, 0], [77, -5]), turned([0, -1024], [77, -5])), (77, 5));
        // Flat stays flat, and a slope along the stamp's first axis is one along the map's, if they are the same.
        assert_eq!((slope_of(100, 200), slope_of(110, 200)), (0, 10));
        assert_eq!(stamp_slope([0, 0], [1024, 0], 127, 200), 100);
        assert_eq!(stamp_slope([10, 3], [1024, 0], 127, 200), 110);
        assert_eq!(stamp_slope([10, 3], [0, 1024], -127, 200), 97);
    }

    #[test]
    fn blending_has_the_right_ends() {
        for value in 0..=255 {
            assert_eq!(blend_over(value, 255, 33), value);
            assert_eq!(blend_over(33, 0, value), value);
            assert_eq!(blend_over(value, 128, value), value);
        }
        assert_eq!(stamp_alpha(255, 4096), 255);
        assert_eq!((slope_color(127, 0), slope_color(127, 256), slope_color(-127, 256)), (128, 255, 1));
    }
}
