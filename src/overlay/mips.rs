//! Mip maps of the colour maps: how they look from afar.
//!
//! Each level is the one above it halved, a texel the mean of four. Maps are premultiplied, so the mean of a colour is weighted by
//! what it covers, and that of a relief is the mean of its slopes. It is taken in integers, rounded to the nearest, so that
//! the GPU, which halves what was painted after every pass (`gpu/mips.rs`, `shaders/mips.wgsl`), and [`mip_chain`] agree to the
//! bit.
//!
//! Where stamps lie in the space of the mesh, nothing is ever painted beside its uv islands and their gutter. Such texels do not
//! count ([`Lying`]): else what fell on an island would pale along its borders the farther it is away. The gutter itself
//! gets narrower with each level; from the third on, what lies between two islands may have none.
//!
//! The last level is the first whose side is odd: one texel where `map_size` is a power of two.

use super::SurfaceFrames;

/// Levels of a map with `size` texels along each side, itself included; 5 or more for a multiple of 16.
pub fn mip_levels(size: u32) -> u32 {
    if size == 0 { 1 } else { size.trailing_zeros() + 1 }
}

/// Which texels of each level lie on a mesh or in its gutter: on lower levels, those that have one above them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lying {
    size: u32,
    /// Level after level from a word of its own, row by row, a bit a texel from the lowest.
    words: Vec<u32>,
}

impl Lying {
    /// Of texels of known places.
    pub fn new(frames: &SurfaceFrames) -> Self {
        let texels = frames.texels();
        Self::of(texels.len().isqrt() as u32, |texel| texels[texel as usize].place().is_some())
    }

    /// Of a map with `size` texels along each side; `lies` is asked row by row.
    fn of(size: u32, lies: impl Fn(u32) -> bool) -> Self {
        let mut words = Vec::new();
        let mut level: Vec<bool> = (0..size * size).map(lies).collect();
        for number in 0..mip_levels(size) {
            let side = size >> number;
            if number > 0 {
                level = (0..side * side)
                    .map(|texel| four_above(texel, side).into_iter().any(|above| level[above]))
                    .collect();
            }
            let word = |bits: &[bool]| bits.iter().rev().fold(0, |word, &lies| word << 1 | u32::from(lies));
            words.extend(level.chunks(32).map(word));
        }
        Self { size, words }
    }

    /// The bits.
    pub(super) fn words(&self) -> &[u32] {
        &self.words
    }

    /// The word with which a level begins.
    pub(super) fn first_word(size: u32, level: u32) -> u32 {
        (0..level).map(|level| (size >> level).pow(2).div_ceil(32)).sum()
    }

    fn lies(&self, level: u32, texel: usize) -> bool {
        let word = Self::first_word(self.size, level) as usize + texel / 32;
        self.words[word] >> (texel % 32) & 1 != 0
    }
}

/// The four texels that one of a level with `side` texels along each side is the mean of, in the level above.
fn four_above(texel: u32, side: u32) -> [usize; 4] {
    let first = (texel / side * 4 * side + texel % side * 2) as usize;
    let row = 2 * side as usize;
    [first, first + 1, first + row, first + row + 1]
}

/// The mean of what there is of four texels, rounded to the nearest: a channel's `sum` over `count` of them, 0 of none.
pub fn mean(sum: u32, count: u32) -> u32 {
    (sum + count / 2) / count.max(1)
}

/// The levels of a map below the map itself, row by row. `map`: `size` times `size` texels, premultiplied; `lying`: of a map
/// of that size, where it is known.
pub fn mip_chain(map: &[[u8; 4]], size: u32, lying: Option<&Lying>) -> Vec<Vec<[u8; 4]>> {
    let mut levels: Vec<Vec<[u8; 4]>> = Vec::new();
    for level in 1..mip_levels(size) {
        let below = halved(levels.last().map_or(map, Vec::as_slice), size, level, lying);
        levels.push(below);
    }
    levels
}

/// A level of a map with `size` texels along each side, from the level `above` it.
pub(super) fn halved(above: &[[u8; 4]], size: u32, level: u32, lying: Option<&Lying>) -> Vec<[u8; 4]> {
    let side = size >> level;
    let texel_below = |texel: u32| {
        let (mut sum, mut count) = ([0u32; 4], 0);
        for texel in four_above(texel, side) {
            if lying.is_none_or(|lying| lying.lies(level - 1, texel)) {
                sum.iter_mut().zip(above[texel]).for_each(|(sum, channel)| *sum += u32::from(channel));
                count += 1;
            }
        }
        sum.map(|sum| mean(sum, count) as u8)
    };
    (0..side * side).map(texel_below).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(size: u32) -> Vec<[u8; 4]> {
        let byte = |texel: u32, channel: u32| {
            (texel.wrapping_mul(2_654_435_761).wrapping_add(channel.wrapping_mul(40_503)) >> 13) as u8
        };
        (0..size * size).map(|texel| [0, 1, 2, 3].map(|channel| byte(texel, channel))).collect()
    }

    #[test]
    fn levels_end_where_a_side_cannot_be_halved() {
        assert_eq!([16, 48, 96, 512, 2048].map(mip_levels), [5, 5, 6, 10, 12]);
        for size in [16, 48, 64] {
            let sides: Vec<usize> =
                mip_chain(&noise(size), size, None).iter().map(|level| level.len().isqrt()).collect();
            let expected: Vec<usize> = (1..mip_levels(size)).map(|level| (size >> level) as usize).collect();
            assert_eq!(sides, expected);
        }
    }

    #[test]
    fn a_level_is_the_mean_of_the_one_above() {
        let map = noise(48);
        let level = &mip_chain(&map, 48, None)[0];
        for (texel, got) in level.iter().enumerate() {
            let (x, y) = (texel % 24 * 2, texel / 24 * 2);
            for (channel, got) in got.iter().enumerate() {
                let at = |x: usize, y: usize| f32::from(map[y * 48 + x][channel]);
                let expected = (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1)) / 4.0;
                assert!((f32::from(*got) - expected).abs() <= 0.5, "{texel}: {got} {expected}");
            }
        }
    }

    #[test]
    fn what_is_the_same_everywhere_is_so_from_afar() {
        let map = vec![[7, 130, 128, 255]; 64 * 64];
        for level in mip_chain(&map, 64, None) {
            assert!(level.iter().all(|texel| *texel == map[0]));
        }
    }

    #[test]
    fn what_lies_beside_an_island_does_not_pale_it() {
        // An island of 5 by 64 texels that is covered.
        let island = |texel: u32| texel % 64 < 5;
        let lying = Lying::of(64, island);
        let map: Vec<[u8; 4]> =
            (0..64 * 64).map(|texel| if island(texel) { [200; 4] } else { [0; 4] }).collect();
        for (level, texels) in (1..).zip(mip_chain(&map, 64, Some(&lying))) {
            let side = 64usize >> level;
            for (texel, color) in texels.iter().enumerate() {
                let holds_some = (texel % side) << level < 5;
                assert_eq!(*color, [if holds_some { 200 } else { 0 }; 4], "level {level}, {texel}");
                assert_eq!(lying.lies(level, texel), holds_some);
            }
        }
        // Without knowing, it would.
        assert!(mip_chain(&map, 64, None)[3][0][0] < 70);
    }

    #[test]
    fn every_level_begins_with_a_word_of_its_own() {
        let lying = Lying::of(48, |_| true);
        let words: Vec<u32> = (0..6).map(|level| Lying::first_word(48, level)).collect();
        // 2304, 576, 144, 36 and 9 texels.
        assert_eq!(words, [0, 72, 90, 95, 97, 98]);
        assert_eq!(lying.words().len(), 98);
    }
}
