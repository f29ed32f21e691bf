//! Stamps that cover only a few texels.
//!
//! A painter reads a stamp at one point for each texel of the map. Where these lie wider apart than the stamp's own texels, most
//! of it would fall between them: a run of water would be several times as strong or not there at all, by where it lies. So a
//! stamp is kept [`LEVELS`] times, each time as means over squares twice as wide as before, and a splat takes the one whose
//! squares are about as wide as a texel of its map ([`level`]). Squares that lie side by side leave nothing out and count
//! nothing twice, so a mark is as strong wherever it lies, and nothing is blurred further than a texel of the map does.
//!
//! Texels are premultiplied: the mean of a colour is weighted by what it covers, that of a relief is the mean of its slopes.

use super::sample::{STAMP_SIZE, STAMP_TEXELS};
use super::{Stamp, StampTexel};
use crate::overlay::kernel::SUBTEXELS;

/// How often a stamp is kept: as it is, and as means over 2, 4, 8, 16 and 32 texels along each side.
pub const LEVELS: u32 = 6;

/// Which of its [`LEVELS`] a stamp is read from. `radius`: half its width and height on the map, 1/256 texel, above 0;
/// `stretch`: how much longer than wide it is drawn within that, 1 or more.
pub fn level(radius: [i32; 2], stretch: f32) -> u32 {
    // A texel of the map is as wide as so many of the stamp: 2^level, give or take the root of two.
    let half = f64::from(STAMP_SIZE as i32 / 2 * SUBTEXELS);
    let area = f64::from(radius[0]) * f64::from(radius[1]) / f64::from(stretch.max(1.0));
    let is_finer = |level: u32| area * f64::from(1u32 << (2 * level)) <= 2.0 * half * half;
    (1..LEVELS).take_while(|&level| is_finer(level)).count() as u32
}

/// Bytes of a texel's three colours.
type Lanes = [u32; 12];

/// A stamp whose texels are means over squares around them, `1 << level` texels wide. Beyond its edges there is nothing.
pub(crate) fn widened(stamp: &Stamp, level: u32) -> Stamp {
    if level == 0 {
        return stamp.clone();
    }
    let half = 1 << (level - 1);
    let lanes: Vec<Lanes> = stamp.texels.iter().map(lanes_of).collect();
    let lanes = summed(&summed(&lanes, half, 1), half, STAMP_SIZE as i32);
    // Of the weights along both axes.
    let total = 16 * (half * half) as u32;
    Stamp { texels: lanes.iter().map(|lanes| texel_of(lanes.map(|sum| (sum + total / 2) / total))).collect() }
}

/// Sums over `half` texels to either side and the texel itself, along rows (`step` 1) or columns. The outermost lie half in the
/// square and count once, the others twice.
fn summed(texels: &[Lanes], half: i32, step: i32) -> Vec<Lanes> {
    let side = STAMP_SIZE as i32;
    let around = |texel: i32| {
        let at = texel / step % side;
        let mut sum = [0; 12];
        for away in -half..=half {
            let other = usize::try_from(texel + away * step).ok().and_then(|other| texels.get(other));
            if let Some(other) = other.filter(|_| (0..side).contains(&(at + away))) {
                let weight = if away.abs() == half { 1 } else { 2 };
                sum.iter_mut().zip(other).for_each(|(sum, lane)| *sum += lane * weight);
            }
        }
        sum
    };
    (0..(texels.len() as u32).min(STAMP_TEXELS) as i32).map(around).collect()
}

fn lanes_of(texel: &StampTexel) -> Lanes {
    let mut lanes = [0; 12];
    let bytes = [texel.diffuse, texel.specular, texel.normal].map(u32::to_le_bytes);
    lanes.iter_mut().zip(bytes.as_flattened()).for_each(|(lane, byte)| *lane = u32::from(*byte));
    lanes
}

fn texel_of(lanes: Lanes) -> StampTexel {
    let color = |first: usize| u32::from_le_bytes([0, 1, 2, 3].map(|channel| lanes[first + channel] as u8));
    StampTexel { diffuse: color(0), specular: color(4), normal: color(8), pad: 0 }
}

#[cfg(test)]
mod tests {
    use super::super::{StampKind, StampOptions, StampSet, stamps};
    use super::*;

    fn made(kind: StampKind) -> Stamp {
        let made = stamps(kind, &StampOptions { variants: 1, ..Default::default() }).unwrap();
        let set =
            StampSet::from_images(Some(&made.diffuse), Some(&made.specular), Some(&made.normal), 1).unwrap();
        set.variants[0].clone()
    }

    #[test]
    fn the_smaller_a_stamp_the_wider_the_squares() {
        let at = |texels: i32| level([texels * SUBTEXELS; 2], 1.0);
        assert_eq!([1000, 32, 24, 22, 16, 11, 8, 4, 2, 1].map(at), [0, 0, 0, 1, 1, 2, 2, 3, 4, 5]);
        assert_eq!(level([1, 1], 1.0), LEVELS - 1);
        // Half as wide as long counts as a circle of its area; so does one that is drawn out within its box.
        assert_eq!(level([32 * SUBTEXELS, 8 * SUBTEXELS], 1.0), at(16));
        assert_eq!(level([32 * SUBTEXELS; 2], 4.0), at(16));
        assert_eq!(level([8 * SUBTEXELS; 2], f32::NAN), at(8));
    }

    #[test]
    fn what_is_the_same_all_round_stays() {
        let texel = StampTexel { diffuse: 0xff40_2010, specular: 0x8000_3307, normal: 0xfefe_8081, pad: 0 };
        let stamp = Stamp { texels: vec![texel; STAMP_TEXELS as usize] };
        for level in 0..LEVELS {
            let wide = widened(&stamp, level);
            assert_eq!(wide.texels.len(), STAMP_TEXELS as usize);
            assert_eq!(wide.texels[32 * 64 + 32], texel, "{level}");
        }
    }

    #[test]
    fn a_single_texel_is_spread_over_its_square() {
        let mut stamp = Stamp { texels: vec![StampTexel::default(); STAMP_TEXELS as usize] };
        stamp.texels[30 * 64 + 20].diffuse = 0xff00_00ff;
        let wide = widened(&stamp, 1);
        let red = |x: usize, y: usize| wide.texels[y * 64 + x].diffuse & 0xff;
        // A quarter of 255, less by half for each axis along which it lies half in the square.
        assert_eq!([red(20, 30), red(21, 30), red(21, 31), red(22, 30), red(20, 28)], [64, 32, 16, 0, 0]);
    }

    #[test]
    fn as_much_is_covered_and_no_colour_gets_ahead_of_its_alpha() {
        for kind in StampKind::ALL {
            let stamp = made(kind);
            let alpha = |stamp: &Stamp| stamp.texels.iter().map(|texel| texel.diffuse >> 24).sum::<u32>();
            for level in 1..LEVELS {
                let wide = widened(&stamp, level);
                let part = f64::from(alpha(&wide)) / f64::from(alpha(&stamp));
                // The widest squares reach beyond the stamp's edges.
                let least = if level < 5 { 0.97 } else { 0.85 };
                assert!((least..1.02).contains(&part), "{kind:?} {level}: {part}");
                for texel in &wide.texels {
                    for color in [texel.diffuse, texel.specular, texel.normal] {
                        let [r, g, b, alpha] = color.to_le_bytes();
                        assert!(r.max(g).max(b) <= alpha, "{kind:?} {level}: {color:08x}");
                    }
                }
            }
        }
    }
}
