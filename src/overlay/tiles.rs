//! Sorting splats into tiles, so that the GPU touches each texel once.

use bytemuck::{Pod, Zeroable};

use super::frames::SurfaceFrames;
use super::kernel::SUBTEXELS;
use super::{Splat, Wrap};

/// Texels along each side of a tile: one workgroup.
pub const TILE_SIZE: u32 = 16;

/// One touched tile: a row of the GPU's tile buffer.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct TileHeader {
    /// Column of the tile.
    pub x: u32,
    /// Row of the tile.
    pub y: u32,
    /// Where its splats begin in the list.
    pub start: u32,
    /// How many they are.
    pub count: u32,
}

/// For every tile that a batch of splats touches, which splats, in their order. Reuses its memory from batch to batch.
#[derive(Debug, Default)]
pub struct TileBins {
    /// Splats per tile of the current map; all zero between batches.
    counts: Vec<u32>,
    /// Tiles with a count above zero.
    touched: Vec<u32>,
    /// (tile, splat), in splat order.
    pairs: Vec<(u32, u32)>,
}

impl TileBins {
    /// Appends the tiles of one surface that its first splats touch to `headers`, and those splats to `list`, as numbers from
    /// `first_splat` on: one splat, and as many more as begin within so many [bytes](Self::bytes). Returns how many. What paints
    /// nothing touches the tile on which it fell. `frames`: where the texels lie; without them, splats in space touch nothing. Tiles
    /// come in ascending order, splats within a tile in theirs.
    pub fn bin_within(
        &mut self,
        bytes: usize,
        splats: &[Splat],
        size: u32,
        wrap: [Wrap; 2],
        frames: Option<&SurfaceFrames>,
        first_splat: u32,
        headers: &mut Vec<TileHeader>,
        list: &mut Vec<u32>,
    ) -> usize {
        let side = (size / TILE_SIZE) as usize;
        if self.counts.len() < side * side {
            self.counts.resize(side * side, 0);
        }
        let Self { counts, touched, pairs } = self;
        let mut taken = 0;
        for (splat, number) in splats.iter().zip(first_splat..) {
            if taken > 0 && Self::bytes(taken, touched.len(), pairs.len()) >= bytes {
                break;
            }
            taken += 1;
            let mut touch = |tile: u32| {
                let count = &mut counts[tile as usize];
                if *count == 0 {
                    touched.push(tile);
                }
                *count += 1;
                pairs.push((tile, number));
            };
            if !splat.paints() {
                let tile = |middle: i32| (middle / (SUBTEXELS * TILE_SIZE as i32)).clamp(0, side as i32 - 1);
                let [column, row] = splat.center.map(tile);
                touch((row * side as i32 + column) as u32);
            } else if splat.in_space == 0 {
                for row in tiles_on_axis(splat, 1, side, wrap[1]) {
                    tiles_on_axis(splat, 0, side, wrap[0])
                        .for_each(|column| touch((row * side + column) as u32));
                }
            } else if let Some(frames) = frames {
                frames.0.tiles_near(splat.origin, splat.reach / 2, touch);
            }
        }
        // A counting sort: `counts` turns into the place where a tile's next splat goes.
        self.touched.sort_unstable();
        let mut start = list.len() as u32;
        list.resize(list.len() + self.pairs.len(), 0);
        for &tile in &self.touched {
            let count = std::mem::replace(&mut self.counts[tile as usize], start);
            headers.push(TileHeader { x: tile % side as u32, y: tile / side as u32, start, count });
            start += count;
        }
        for &(tile, splat) in &self.pairs {
            let place = &mut self.counts[tile as usize];
            list[*place as usize] = splat;
            *place += 1;
        }
        for tile in self.touched.drain(..) {
            self.counts[tile as usize] = 0;
        }
        self.pairs.clear();
        taken
    }

    /// Bytes of so many splats, tiles and entries of the list.
    pub fn bytes(splats: usize, tiles: usize, entries: usize) -> usize {
        splats * size_of::<Splat>() + tiles * size_of::<TileHeader>() + entries * size_of::<u32>()
    }
}

/// Tiles a splat touches along one axis, each once.
fn tiles_on_axis(splat: &Splat, axis: usize, side: usize, wrap: Wrap) -> impl Iterator<Item = usize> + Clone {
    let tile = TILE_SIZE as i32;
    let (first, last) = splat.span(axis);
    wrap.cells(first.div_euclid(tile), last.div_euclid(tile), side as u32).map(|tile| tile as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn splat(center: [i32; 2], radius: i32) -> Splat {
        Splat {
            center: center.map(|c| c * 256),
            radius: [radius * 256; 2],
            diffuse: u32::MAX,
            ..Splat::zeroed()
        }
    }

    fn tiles_of(splats: &[Splat], size: u32, wrap: [Wrap; 2]) -> Vec<((u32, u32), Vec<u32>)> {
        let (mut bins, mut headers, mut list) = (TileBins::default(), vec![], vec![]);
        for _ in 0..2 {
            headers.clear();
            list.clear();
            bins.bin_within(usize::MAX, splats, size, wrap, None, 0, &mut headers, &mut list);
        }
        assert!(bins.counts.iter().all(|&count| count == 0), "bins are clean between batches");
        headers.iter().map(|h| ((h.x, h.y), list[h.start as usize..][..h.count as usize].to_vec())).collect()
    }

    #[test]
    fn a_corner_stamp_touches_the_four_corners() {
        let tiles = tiles_of(&[splat([0, 0], 3)], 64, [Wrap::Repeat; 2]);
        let touched: Vec<_> = tiles.iter().map(|(tile, _)| *tile).collect();
        assert_eq!(touched, [(0, 0), (3, 0), (0, 3), (3, 3)]);
        assert_eq!(tiles_of(&[splat([0, 0], 3)], 64, [Wrap::Clamp; 2]), [((0, 0), vec![0])]);
    }

    #[test]
    fn clear_water_touches_the_tile_on_which_it_fell() {
        let water = Splat { diffuse: 0, water_nl: 7, ..splat([16, 47], 3) };
        assert_eq!(tiles_of(&[water], 64, [Wrap::Repeat; 2]), [((1, 2), vec![0])]);
    }

    #[test]
    fn splats_keep_their_order_within_a_tile() {
        let splats = [splat([8, 8], 2), splat([40, 8], 2), splat([9, 9], 2), splat([16, 8], 2)];
        let tiles = tiles_of(&splats, 64, [Wrap::Repeat; 2]);
        assert_eq!(tiles, [((0, 0), vec![0, 2, 3]), ((1, 0), vec![3]), ((2, 0), vec![1])]);
    }

    #[test]
    fn a_stamp_as_large_as_the_map_is_in_every_tile_once() {
        let largest = Splat { center: [77, 0], radius: [63 * 128; 2], ..splat([0; 2], 0) };
        let tiles = tiles_of(&[largest], 64, [Wrap::Repeat; 2]);
        assert_eq!(tiles.len(), 16);
        assert!(tiles.iter().all(|(_, splats)| splats == &[0]));
    }

    #[test]
    fn a_batch_ends_where_its_bytes_are_used_up() {
        let splats = [splat([8, 8], 2), splat([16, 8], 2), splat([9, 9], 2)];
        // The second lies in two tiles.
        let two = TileBins::bytes(2, 2, 3);
        for (bytes, expected) in
            [(0, 1), (TileBins::bytes(1, 1, 1), 1), (two, 2), (two + 1, 3), (usize::MAX, 3)]
        {
            let (mut bins, mut headers, mut list) = (TileBins::default(), vec![], vec![]);
            let wrap = [Wrap::Repeat; 2];
            let taken = bins.bin_within(bytes, &splats, 64, wrap, None, 0, &mut headers, &mut list);
            assert_eq!(taken, expected, "{bytes}");
            assert!(list.iter().all(|&number| (number as usize) < taken));
            assert_eq!(headers.iter().map(|tile| tile.count).sum::<u32>() as usize, list.len());
        }
    }
}
