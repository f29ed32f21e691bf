//! How large the maps of surfaces are, so that all fit into the budget. Pure: numbers in, numbers out.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::MapBudget;
use crate::matter::GpuTexelMatter;
use crate::overlay::{RainRing, TILE_SIZE, TexelFrame};
use crate::wetting::gpu::GpuTexelWater;

/// Which maps a surface has, or may come to have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MapNeed {
    /// Three colour maps.
    pub colors: bool,
    /// Rings of drops.
    pub rings: bool,
    /// Water.
    pub water: bool,
    /// Dust, mud and snow.
    pub matter: bool,
    /// Where its texels lie.
    pub frames: bool,
}

impl MapNeed {
    /// Bytes on the GPU, of maps with this many texels along each side.
    pub fn bytes(self, side: u32) -> u64 {
        // Three images, and a third of that again for their mip maps.
        const COLORS: usize = 4 * size_of::<[u8; 4]>();
        let of = |needed: bool, bytes: usize| if needed { bytes as u64 } else { 0 };
        let a_texel = of(self.colors, COLORS)
            + of(self.water, size_of::<GpuTexelWater>())
            + of(self.matter, size_of::<GpuTexelMatter>())
            + of(self.frames, size_of::<TexelFrame>());
        let a_tile = of(self.rings, RainRing::PER_TILE as usize * size_of::<RainRing>());
        u64::from(side).pow(2) * a_texel + u64::from(side / TILE_SIZE).pow(2) * a_tile
    }
}

/// A surface that asks for maps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wish {
    /// Place in the order of spawning.
    pub(super) order: u64,
    /// The most texels along a side.
    pub(super) limit: u32,
    /// Length of a side in the world, metres; 0 if that is not known.
    pub(super) extent: f64,
    pub(super) need: MapNeed,
}

impl Wish {
    /// The fewest texels along a side.
    pub(super) fn smallest(&self) -> u32 {
        MapBudget::SMALLEST_SIDE.min(self.limit)
    }

    /// The side that makes texels this wide in the world, metres, as far as it is allowed to.
    pub(super) fn side(&self, texel: Option<f32>) -> u32 {
        // Written so that NaN is no wish.
        let Some(texel) = texel.filter(|&texel| texel > 0.0) else { return self.limit };
        let texels = (self.extent / f64::from(texel)).ceil().min(f64::from(self.limit)) as u32;
        texels.next_multiple_of(TILE_SIZE).clamp(self.smallest(), self.limit)
    }

    /// Half of a side, or the smallest.
    fn halved(&self, side: u32) -> u32 {
        (side / 2).next_multiple_of(TILE_SIZE).max(self.smallest()).min(side)
    }
}

/// The finest is the greatest; of two alike, the one that came last.
struct Finest {
    texel: f64,
    order: u64,
    index: usize,
}

impl Finest {
    fn new(wishes: &[Wish], index: usize, side: u32) -> Self {
        let Wish { order, extent, .. } = wishes[index];
        Self { texel: extent / f64::from(side), order, index }
    }
}

impl Ord for Finest {
    fn cmp(&self, other: &Self) -> Ordering {
        other.texel.total_cmp(&self.texel).then(self.order.cmp(&other.order))
    }
}

impl PartialOrd for Finest {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Finest {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Finest {}

/// The side of each, in the order of `wishes`: as wished, or halved from the finest on until all take at most `room` bytes
/// or are the smallest.
pub(super) fn fit(wishes: &[Wish], texel: Option<f32>, room: u64) -> Vec<u32> {
    let mut sides: Vec<u32> = wishes.iter().map(|wish| wish.side(texel)).collect();
    let mut bytes: u64 = wishes.iter().zip(&sides).map(|(wish, &side)| wish.need.bytes(side)).sum();
    if bytes <= room {
        return sides;
    }
    let mut finest: BinaryHeap<Finest> =
        sides.iter().enumerate().map(|(index, &side)| Finest::new(wishes, index, side)).collect();
    while bytes > room
        && let Some(Finest { index, .. }) = finest.pop()
    {
        let (wish, side) = (&wishes[index], sides[index]);
        let half = wish.halved(side);
        if half < side {
            bytes -= wish.need.bytes(side) - wish.need.bytes(half);
            sides[index] = half;
            finest.push(Finest::new(wishes, index, half));
        }
    }
    sides
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: MapNeed = MapNeed { colors: true, rings: true, water: true, matter: true, frames: true };

    fn wishes(count: u64) -> Vec<Wish> {
        let wish = |order| Wish {
            order,
            limit: 512,
            // Half a metre to 4 m, in no order.
            extent: 0.5 + (order * 7919 % 1000) as f64 * 0.0035,
            need: ALL,
        };
        (0..count).map(wish).collect()
    }

    fn bytes(wishes: &[Wish], sides: &[u32]) -> u64 {
        wishes.iter().zip(sides).map(|(wish, &side)| wish.need.bytes(side)).sum()
    }

    #[test]
    fn a_texel_costs_what_its_rows_take() {
        assert_eq!(ALL.bytes(16), 256 * (16 + 16 + 8 + 16) + 64);
        assert_eq!(MapNeed::default().bytes(2048), 0);
    }

    #[test]
    fn wishes_that_fit_are_granted() {
        let wishes = wishes(8);
        assert_eq!(fit(&wishes, None, 256 << 20), [512; 8]);
        for (wish, side) in wishes.iter().zip(fit(&wishes, Some(0.01), 256 << 20)) {
            let texel = wish.extent / f64::from(side);
            assert!(side % TILE_SIZE == 0 && (64..=512).contains(&side), "{side}");
            assert!(texel <= 0.01 || side == 512, "{texel}");
            assert!(texel > 0.01 * 0.7 || side == 64, "{texel}");
        }
        for senseless in [f32::NAN, 0.0, -1.0] {
            assert_eq!(fit(&wishes, Some(senseless), 256 << 20), [512; 8]);
        }
    }

    #[test]
    fn five_hundred_fit_with_texels_alike_in_the_world() {
        let wishes = wishes(500);
        let room = 256 << 20;
        let sides = fit(&wishes, None, room);
        let taken = bytes(&wishes, &sides);
        // Not more, and not much less.
        assert!(taken <= room && taken > room / 2, "{taken}");
        // What could be halved is not finer than half of the coarsest that was.
        let texel = |(wish, &side): (&Wish, &u32)| wish.extent / f64::from(side);
        let reduced = wishes.iter().zip(&sides).filter(|(_, side)| **side < 512).map(texel);
        let coarsest = reduced.fold(0.0, f64::max);
        let free = wishes.iter().zip(&sides).filter(|(_, side)| **side > 64).map(texel);
        let finest = free.fold(f64::INFINITY, f64::min);
        assert!(finest >= coarsest / 2.0 - 1e-9, "{finest} {coarsest}");
    }

    #[test]
    fn sides_do_not_depend_on_the_order_in_which_surfaces_are_found() {
        let mut wishes = wishes(100);
        // Many alike, so that the order of spawning has to decide.
        wishes.iter_mut().for_each(|wish| wish.extent = wish.extent.ceil());
        let by_order = |wishes: &[Wish]| {
            let mut sides: Vec<(u64, u32)> =
                wishes.iter().map(|wish| wish.order).zip(fit(wishes, None, 64 << 20)).collect();
            sides.sort_unstable();
            sides
        };
        let forwards = by_order(&wishes);
        wishes.reverse();
        assert_eq!(by_order(&wishes), forwards);
        wishes.rotate_left(37);
        assert_eq!(by_order(&wishes), forwards);
    }

    #[test]
    fn nothing_gets_smaller_than_the_smallest() {
        let mut wishes = wishes(20);
        wishes[3].limit = 32;
        let sides = fit(&wishes, None, 0);
        for (wish, side) in wishes.iter().zip(sides) {
            assert_eq!(side, wish.smallest());
        }
        assert_eq!((wishes[3].smallest(), wishes[4].smallest()), (32, 64));
        assert_eq!([wishes[4].halved(80), wishes[4].halved(64), wishes[3].halved(32)], [64, 64, 32]);
    }
}
