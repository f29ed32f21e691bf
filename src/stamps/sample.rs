//! Reading between the texels of a stamp, in integers.
//!
//! Every function has a twin of the same name in `shaders/common/stamp.wgsl`; both use 32-bit integers alone, so CPU
//! and GPU agree to the bit on any driver. Texels are premultiplied, see [`StampTexel`](super::StampTexel): so each
//! byte is interpolated for itself, and none comes out greater than alpha that was not so before.

/// Texels along each side of a stamp.
pub const STAMP_SIZE: u32 = 64;

/// Texels of a stamp.
pub const STAMP_TEXELS: u32 = STAMP_SIZE * STAMP_SIZE;

/// Offsets, in 1/256 radius, from one texel to the next: the stamp's side is two radii.
const OFFSETS_PER_TEXEL: i32 = 512 / STAMP_SIZE as i32;

/// The weight of a corner and its opposite along one axis, together.
pub const WEIGHT_ONE: u32 = 16;

/// Four texels about a point, and where it lies between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StampCorners {
    /// Numbers in the stamp, row by row: at the lower u and v, at the higher u, at the higher v, at both. Along the
    /// edges of the stamp some are the same.
    pub texels: [u32; 4],
    /// How much of the way to the higher u and v: 0..=[`WEIGHT_ONE`].
    pub weights: [u32; 2],
}

/// Whether there is anything of a stamp at an offset from its middle, in 1/256 radius.
pub fn on_stamp(offset: [i32; 2]) -> bool {
    offset.iter().all(|axis| (-256..=256).contains(axis))
}

/// What to read of a stamp at an offset from its middle: -256..=256 in 1/256 radius, as
/// [`axis_offset`](crate::overlay::kernel::axis_offset) gives it. What lies beyond is taken as the edge.
pub fn stamp_corners(offset: [i32; 2]) -> StampCorners {
    let (u, v) = (axis_corners(offset[0]), axis_corners(offset[1]));
    let texel = |x: u32, y: u32| y * STAMP_SIZE + x;
    StampCorners {
        texels: [texel(u[0], v[0]), texel(u[1], v[0]), texel(u[0], v[1]), texel(u[1], v[1])],
        weights: [u[2], v[2]],
    }
}

/// The texels before and after along one axis, and the weight of the latter.
fn axis_corners(offset: i32) -> [u32; 3] {
    // From the middle of the first texel, so from -4 to 508.
    let at = offset.clamp(-256, 256) + 256 - OFFSETS_PER_TEXEL / 2;
    let before = at.div_euclid(OFFSETS_PER_TEXEL);
    let last = STAMP_SIZE as i32 - 1;
    let part = at.rem_euclid(OFFSETS_PER_TEXEL) as u32;
    [
        before.clamp(0, last) as u32,
        (before + 1).clamp(0, last) as u32,
        part * (WEIGHT_ONE / OFFSETS_PER_TEXEL as u32),
    ]
}

/// Every other byte, so that none runs over into the next.
const LANES: u32 = 0x00ff_00ff;

/// Four packed texels, in the order of [`StampCorners`], interpolated byte by byte and rounded to the nearest.
/// Weights are 0..=[`WEIGHT_ONE`].
pub fn mix4(a: u32, b: u32, c: u32, d: u32, wx: u32, wy: u32) -> u32 {
    let (rest_x, rest_y) = (WEIGHT_ONE - wx, WEIGHT_ONE - wy);
    let weights = [rest_x * rest_y, wx * rest_y, rest_x * wy, wx * wy];
    let even = weighted([a, b, c, d].map(|texel| texel & LANES), weights);
    let odd = weighted([a, b, c, d].map(|texel| (texel >> 8) & LANES), weights);
    ((even >> 8) & LANES) | (odd & !LANES)
}

/// 256 times the mean of two bytes at once, each in 16 bits, and a half.
fn weighted(lanes: [u32; 4], weights: [u32; 4]) -> u32 {
    // At most 255 · 256 + 128 in either half.
    lanes[0] * weights[0]
        + lanes[1] * weights[1]
        + lanes[2] * weights[2]
        + lanes[3] * weights[3]
        + 0x0080_0080
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_lie_round_the_point() {
        for offset in -256..=256 {
            let StampCorners { texels, weights } = stamp_corners([offset, -offset]);
            let at = |texel: u32, weight: u32| texel as f32 * 8.0 + 4.0 + weight as f32 * 0.5;
            let (x, y) = (at(texels[0] % 64, weights[0]), at(texels[0] / 64, weights[1]));
            // Outside the middles of the outermost texels there is nothing to lie between.
            if offset.abs() <= 252 {
                assert_eq!((x, y), ((offset + 256) as f32, (256 - offset) as f32), "{offset}");
            }
            let columns = texels.map(|texel| texel % 64);
            let rows = texels.map(|texel| texel / 64);
            assert_eq!((columns[0], columns[1]), (columns[2], columns[3]));
            assert_eq!((rows[0], rows[2]), (rows[1], rows[3]));
            assert!(columns[1] - columns[0] <= 1 && rows[2] - rows[0] <= 1, "{offset}");
        }
    }

    #[test]
    fn at_the_edges_it_is_the_outermost_texel() {
        let corners = |u, v| stamp_corners([u, v]).texels;
        assert_eq!(corners(-256, -256), [0; 4]);
        assert_eq!(corners(256, -256), [63; 4]);
        assert_eq!(corners(256, 256), [4095; 4]);
        assert_eq!(stamp_corners([-9000, 400]), stamp_corners([-256, 256]));
        assert!(on_stamp([256, -256]) && !on_stamp([257, 0]) && !on_stamp([0, -257]));
    }

    #[test]
    fn the_middle_of_the_stamp_is_between_its_four_middle_texels() {
        let corners = stamp_corners([0, 0]);
        assert_eq!(corners.texels, [31 * 64 + 31, 31 * 64 + 32, 32 * 64 + 31, 32 * 64 + 32]);
        assert_eq!(corners.weights, [8, 8]);
    }

    #[test]
    fn each_byte_is_the_nearest_to_what_it_should_be() {
        let texels = [0x00ff_80ff, 0xff00_7f01, 0xffff_ffff, 0x1234_5678];
        let [a, b, c, d] = texels;
        for wx in 0..=16 {
            for wy in 0..=16 {
                let mixed = mix4(a, b, c, d, wx, wy).to_le_bytes();
                let (u, v) = (f64::from(wx) / 16.0, f64::from(wy) / 16.0);
                for (byte, mixed) in mixed.into_iter().enumerate() {
                    let [a, b, c, d] = texels.map(|texel| f64::from(texel.to_le_bytes()[byte]));
                    let exact = (a * (1.0 - u) + b * u) * (1.0 - v) + (c * (1.0 - u) + d * u) * v;
                    assert!((f64::from(mixed) - exact).abs() <= 0.5, "{wx} {wy} {byte}: {mixed} for {exact}");
                }
            }
        }
        assert_eq!([(0, 0), (16, 0), (0, 16), (16, 16)].map(|(wx, wy)| mix4(a, b, c, d, wx, wy)), texels);
    }

    #[test]
    fn mixed_with_itself_a_texel_stays() {
        for texel in [0, u32::MAX, 0x8040_20ff, 0x0100_fe7f] {
            for weight in 0..=16 {
                assert_eq!(mix4(texel, texel, texel, texel, weight, 16 - weight), texel);
            }
        }
    }

    #[test]
    fn no_colour_gets_ahead_of_its_alpha() {
        let premultiplied = [[7, 0, 7, 7], [200, 13, 0, 200], [0, 0, 0, 0], [254, 255, 1, 255]];
        let [a, b, c, d] = premultiplied.map(u32::from_le_bytes);
        for weights in 0..17 * 17 {
            let [red, green, blue, alpha] = mix4(a, b, c, d, weights % 17, weights / 17).to_le_bytes();
            assert!(red.max(green).max(blue) <= alpha, "{weights}");
        }
    }
}
