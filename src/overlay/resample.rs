//! Colour maps of another size: halved as for what is seen from afar, or each texel four times.

use super::CpuMaps;
use super::mips::{Lying, halved};

impl CpuMaps {
    /// What has been painted, on maps with `size` texels along each side: twice as many, or a half, a quarter and so on.
    /// `lying`: which texels of the present map count, where it is known.
    ///
    /// Each smaller map is the next level of [`mip_chain`](super::mip_chain), which the GPU has already; each larger one the same
    /// texels again, so that nothing is gained by going to and fro, and nothing more lost.
    pub(crate) fn resized(&self, size: u32, lying: Option<&Lying>) -> Self {
        let map = |map: &[[u8; 4]]| {
            let mut map = map.to_vec();
            let mut level = 0;
            while self.size >> level > size {
                level += 1;
                map = halved(&map, self.size, level, lying);
            }
            let mut side = self.size >> level;
            while side < size {
                map = doubled(&map, side);
                side *= 2;
            }
            map
        };
        Self {
            size,
            wrap: self.wrap,
            diffuse: map(&self.diffuse),
            specular: map(&self.specular),
            normal: map(&self.normal),
        }
    }
}

/// Each texel of a map with `side` texels along each side four times.
fn doubled(map: &[[u8; 4]], side: u32) -> Vec<[u8; 4]> {
    let rows = map.chunks_exact(side.max(1) as usize);
    rows.flat_map(|row| [row, row]).flatten().flat_map(|texel| [*texel; 2]).collect()
}

/// Whether one size leads to another by halving or doubling.
pub(crate) fn is_reached(from: u32, to: u32) -> bool {
    let (small, large) = (from.min(to), from.max(to));
    small > 0 && large.is_multiple_of(small) && (large / small).is_power_of_two()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::overlay::{Wrap, mip_chain};

    fn painted(size: u32) -> CpuMaps {
        let mut maps = CpuMaps::of_size(size, [Wrap::Repeat; 2]);
        for (texel, color) in (0u32..).zip(&mut maps.diffuse) {
            *color = texel.wrapping_mul(2_654_435_761).to_le_bytes();
        }
        maps.normal = maps.diffuse.iter().rev().copied().collect();
        maps
    }

    #[test]
    fn a_smaller_map_is_what_is_seen_from_afar() {
        let maps = painted(64);
        for (level, size) in [(0, 32), (1, 16)] {
            let half = maps.resized(size, None);
            assert_eq!((half.size, half.wrap), (size, maps.wrap));
            assert_eq!(half.diffuse, mip_chain(&maps.diffuse, 64, None)[level]);
            assert_eq!(half.normal, mip_chain(&maps.normal, 64, None)[level]);
            assert!(half.specular.iter().all(|texel| *texel == [0; 4]));
        }
        assert_eq!(maps.resized(64, None), maps);
    }

    #[test]
    fn a_larger_map_looks_the_same_and_halves_to_what_it_was() {
        let maps = painted(32);
        let twice = maps.resized(64, None);
        for (texel, color) in (0u32..).zip(&twice.diffuse) {
            let (x, y) = (texel % 64, texel / 64);
            assert_eq!(*color, maps.diffuse[(y / 2 * 32 + x / 2) as usize]);
        }
        assert_eq!(twice.resized(32, None), maps);
    }
}
