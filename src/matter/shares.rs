//! Who gets how much of what an impact brings: by the coverage of its stamp, or under a round bump.
//!
//! **By its stamp.** Each texel of the patch reads how much of it the stamp covers, as painters do, and is noted down with the
//! coverage of all up to it, itself included. Of the volume it gets what falls between two such sums: these differences telescope, so
//! the shares add up to the volume to the nanolitre, and what is rounded off one texel is its successor's.
//!
//! **Under a bump.** Where there is no stamp, or the patch is so small that a stamp would have no shape on it: differences of the
//! bump's integral, as for water ([`kernel`](crate::overlay::kernel)). It needs no sum beforehand, and lies between texels as well as
//! on one.
//!
//! Integers alone, so the shares are the same on any machine.

use super::settle::{Deposit, DepositStamp};
use crate::overlay::kernel::{SUBTEXELS, axis_coverage, axis_offset, share, turned};
use crate::overlay::{Splat, StampAtlas, Wrap};
use crate::stamps::StampTexel;
use crate::stamps::sample::{StampCorners, mix4, on_stamp, stamp_corners};

/// Half the width of the smallest patch that a stamp is seen on, 1/256 texel: two texels.
const LEAST_STAMPED: i32 = 2 * SUBTEXELS;

/// Buffers that keep their memory from impact to impact.
#[derive(Debug, Default)]
pub(super) struct ShareScratch {
    columns: Vec<(u32, [u32; 2])>,
    offsets: Vec<(u32, i32)>,
    covered: Vec<(u32, u32)>,
}

/// Shares out a deposit on a map of this size with these edges. `give`: a texel over which some of it falls, and how much that is,
/// nanolitres above 0; together it is the volume.
pub(super) fn share_out(
    deposit: &Deposit,
    stamps: Option<&StampAtlas>,
    (size, wrap): (u32, [Wrap; 2]),
    scratch: &mut ShareScratch,
    mut give: impl FnMut(u32, u32),
) {
    let patch = Splat { center: deposit.center, radius: deposit.radius, ..bytemuck::Zeroable::zeroed() };
    if let (Some(lies), Some(stamps)) = (&deposit.stamp, stamps)
        && deposit.radius.iter().all(|&radius| radius >= LEAST_STAMPED)
    {
        cover(&patch, lies, stamps.stamp(lies.number), (size, wrap), scratch);
        if by_coverage(deposit.volume_nl, &scratch.covered, &mut give) {
            return;
        }
    }
    let axes = [0, 1].map(|axis: usize| patch.axis(axis, size, wrap));
    let columns = &mut scratch.columns;
    columns.clear();
    columns.extend(patch.texels(0, size, wrap).map(|x| (x, axis_coverage(axes[0], x as i32))));
    for y in patch.texels(1, size, wrap) {
        let in_row = share(deposit.volume_nl, axis_coverage(axes[1], y as i32));
        for &(x, column) in columns.iter() {
            let nl = share(in_row, column);
            if nl > 0 {
                give(y * size + x, nl);
            }
        }
    }
}

/// Notes down the texels of a patch that a stamp covers, each with the coverage of all up to it.
fn cover(
    patch: &Splat,
    lies: &DepositStamp,
    stamp: &[StampTexel],
    (size, wrap): (u32, [Wrap; 2]),
    scratch: &mut ShareScratch,
) {
    let ShareScratch { offsets, covered, .. } = scratch;
    let whole = Splat { radius: lies.radius, ..*patch };
    let axes = [0, 1].map(|axis: usize| whole.axis(axis, size, wrap));
    offsets.clear();
    offsets.extend(patch.texels(0, size, wrap).map(|x| (x, axis_offset(axes[0], x as i32))));
    covered.clear();
    if stamp.is_empty() {
        return;
    }
    // Of all texels of the largest map it is 1.1 · 10⁹.
    let mut sum = 0;
    for y in patch.texels(1, size, wrap) {
        let along_v = axis_offset(axes[1], y as i32);
        for &(x, along_u) in offsets.iter() {
            let coverage = coverage_at(stamp, lies.rows.map(|row| turned(row, [along_u, along_v])));
            if coverage > 0 {
                sum += coverage;
                covered.push((y * size + x, sum));
            }
        }
    }
}

/// How much a stamp covers at an offset along its own axes, 1/256 radius: 0..=255.
fn coverage_at(stamp: &[StampTexel], offset: [i32; 2]) -> u32 {
    if !on_stamp(offset) {
        return 0;
    }
    let StampCorners { texels, weights: [along_u, along_v] } = stamp_corners(offset);
    let [a, b, c, d] = texels.map(|corner| stamp[corner as usize].diffuse);
    mix4(a, b, c, d, along_u, along_v) >> 24
}

/// Shares a volume out by coverage, if there is any.
fn by_coverage(volume_nl: u32, covered: &[(u32, u32)], give: &mut impl FnMut(u32, u32)) -> bool {
    let Some(&(_, all)) = covered.last() else { return false };
    // One division for all; the last texel makes up for what it leaves over.
    let per_coverage = (u64::from(volume_nl) << 32) / u64::from(all);
    let mut given = 0;
    for &(texel, until) in covered {
        let until_nl =
            if until == all { volume_nl } else { ((per_coverage * u64::from(until)) >> 32) as u32 };
        if until_nl > given {
            give(texel, until_nl - given);
        }
        given = until_nl;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matter::MatterKind;
    use crate::matter::test_world::bump;
    use crate::overlay::CpuMaps;
    use crate::stamps::{Stamp, StampKind, StampOptions, StampSet, stamps};

    const SIZE: u32 = 64;

    fn deposit(radius: i32, volume_nl: u32, stamp: Option<DepositStamp>) -> Deposit {
        let center = [32 * 256 + 77, 31 * 256 + 5];
        Deposit { stamp, ..bump(MatterKind::Dust, volume_nl, center, [radius; 2]) }
    }

    /// As it lies, turned by an angle.
    fn turned_by(angle: f32, number: u32, radius: i32) -> Option<DepositStamp> {
        let (sin, cos) = angle.sin_cos();
        let rows = [[cos, sin], [-sin, cos]].map(|row| row.map(|part| (part * 1024.0).round() as i32));
        Some(DepositStamp { number, radius: [radius; 2], rows })
    }

    /// What each texel of the map gets.
    fn shares(deposit: &Deposit, atlas: &StampAtlas, wrap: Wrap) -> Vec<u32> {
        let mut texels = vec![0; (SIZE * SIZE) as usize];
        share_out(deposit, Some(atlas), (SIZE, [wrap; 2]), &mut ShareScratch::default(), |texel, nl| {
            assert!(nl > 0);
            texels[texel as usize] += nl;
        });
        texels
    }

    /// The stamps of a kind, and the number of the first.
    fn atlas(kind: StampKind) -> (StampAtlas, u32) {
        let made = stamps(kind, &StampOptions::default()).unwrap();
        let set = StampSet::from_images(Some(&made.diffuse), None, None, 4).unwrap();
        let mut atlas = StampAtlas::default();
        let first = atlas.add(&set).unwrap();
        (atlas, first)
    }

    #[test]
    fn the_shares_of_a_stamp_add_up_to_the_nanolitre_wherever_it_lies() {
        for kind in StampKind::ALL {
            let (atlas, first) = atlas(kind);
            for radius in [128, 511, 512, 900, 3000, 63 * 128] {
                for variant in 0..4 {
                    let number = StampAtlas::number(first, variant, [radius; 2], 1.0);
                    let stamp = turned_by(variant as f32 * 1.3, number, radius);
                    for volume_nl in [1, 2, 999, 1_200_007, u32::MAX] {
                        for center in [[0, 0], [SIZE as i32 * 256 - 1, 40], [8000, 7001]] {
                            for wrap in [Wrap::Clamp, Wrap::Repeat] {
                                let deposit = Deposit { center, ..deposit(radius, volume_nl, stamp) };
                                let sum: u64 =
                                    shares(&deposit, &atlas, wrap).into_iter().map(u64::from).sum();
                                assert_eq!(sum, u64::from(volume_nl), "{kind:?} {radius} {center:?}");
                            }
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_texel_gets_what_its_stamp_covers_of_it_turned_as_it_is_painted() {
        // Its left half; a stamp that is kept in one size, as it would be for a large mark.
        let texel = |column: usize| StampTexel {
            diffuse: if column < 32 { 0xff00_0000 } else { 0 },
            ..StampTexel::default()
        };
        let half = Stamp { texels: (0..4096).map(|at| texel(at % 64)).collect() };
        let mut atlas = StampAtlas::default();
        let first = atlas.add(&StampSet { size: 64, variants: vec![half] }).unwrap();
        let radius = 20 * 256;
        let middle = 32 * 256;
        let cases: [(f32, fn(i32, i32) -> bool); 2] = [
            (0.0, |x, _| x < 0),
            // Its first axis lies along v of the map, so what was on its left is above.
            (std::f32::consts::FRAC_PI_2, |_, y| y < 0),
        ];
        for (turn, is_covered) in cases {
            let stamped = deposit(radius, 4_000_000, turned_by(turn, first, radius));
            let stamped = Deposit { center: [middle; 2], ..stamped };
            for (at, nl) in (0..).zip(shares(&stamped, &atlas, Wrap::Clamp)) {
                let (x, y) = (at % SIZE as i32 - 32, at / SIZE as i32 - 32);
                let is_near = [x, y].iter().all(|along| (-20..20).contains(along));
                // Of 800 texels.
                let expected = if is_near && is_covered(x, y) { 5000 } else { 0u32 };
                assert!(nl.abs_diff(expected) <= 1, "{x} {y}: {nl}");
            }
        }
    }

    #[test]
    fn matter_lies_as_thick_as_its_stamp_is_painted() {
        let (atlas, first) = atlas(StampKind::Splat);
        let radius = 12 * 256;
        let stamp = turned_by(0.7, StampAtlas::number(first, 1, [radius; 2], 1.0), radius);
        let stamped = deposit(radius, 9_000_000, stamp);
        let DepositStamp { number, rows, .. } = stamp.unwrap();
        let [row_s, row_t] = rows.map(|[along_u, along_v]| [along_u, along_v, 0]);
        let splat = Splat {
            center: stamped.center,
            radius: stamped.radius,
            // Opaque.
            diffuse: 0xff00_0000,
            stamp: number,
            row_s,
            row_t,
            ..bytemuck::Zeroable::zeroed()
        };
        let mut maps = CpuMaps::of_size(SIZE, [Wrap::Clamp; 2]);
        maps.paint(&[splat], &atlas, None);
        let painted = maps.diffuse.iter().map(|texel| u64::from(texel[3]));
        let all: u64 = painted.clone().sum();
        for (nl, coverage) in shares(&stamped, &atlas, Wrap::Clamp).into_iter().zip(painted) {
            assert!(u64::from(nl).abs_diff(9_000_000 * coverage / all) <= 2, "{nl} {coverage}");
        }
    }

    #[test]
    fn without_a_stamp_that_covers_anything_it_is_a_bump() {
        let mut atlas = StampAtlas::default();
        let clear = Stamp { texels: vec![StampTexel::default(); 4096] };
        let first = atlas.add(&StampSet { size: 64, variants: vec![clear] }).unwrap();
        let bump = shares(&deposit(2000, 5001, None), &atlas, Wrap::Clamp);
        // Clear, and not there at all.
        for number in [first, 999] {
            let stamped = deposit(2000, 5001, turned_by(0.0, number, 2000));
            assert_eq!(shares(&stamped, &atlas, Wrap::Clamp), bump);
        }
        // Too small to be seen.
        let (flakes, first) = self::atlas(StampKind::Flakes);
        let small = LEAST_STAMPED - 1;
        let stamped = deposit(small, 5001, turned_by(0.0, first, small));
        let bump = shares(&deposit(small, 5001, None), &flakes, Wrap::Clamp);
        assert_eq!(shares(&stamped, &flakes, Wrap::Clamp), bump);
        let seen =
            |radius| shares(&deposit(radius, 5001, turned_by(0.0, first, radius)), &flakes, Wrap::Clamp);
        assert_ne!(seen(LEAST_STAMPED), shares(&deposit(LEAST_STAMPED, 5001, None), &flakes, Wrap::Clamp));
    }
}
