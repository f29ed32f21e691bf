//! Which tiles of a surface are busy, and where they lie on its map.

use crate::overlay::TILE_SIZE;

/// Which tiles have something to do. One byte of flags for each, and lists of those that are set, in ascending order
/// whenever they are read.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tiles {
    pub(crate) flags: Vec<u8>,
    /// How often a tile with films that may run has doubled the time between its steps.
    pub(crate) patience: Vec<u8>,
    /// Films that may run.
    pub(crate) running: Vec<u32>,
    /// Pores that may share what they hold.
    pub(crate) spreading: Vec<u32>,
    /// Changed since they were last sent to be drawn.
    pub(crate) dirty: Vec<u32>,
}

impl Tiles {
    pub(crate) const RUNNING: u8 = 1;
    pub(crate) const SPREADING: u8 = 2;
    pub(crate) const DIRTY: u8 = 4;
    /// Has a film that is free to move, but nowhere to go.
    pub(crate) const POOL: u8 = 8;
    /// Has ever held water.
    pub(crate) const WET: u8 = 16;
    /// Got water since its rims were measured.
    pub(crate) const RENEWED: u8 = 32;

    fn set(list: &mut Vec<u32>, flags: &mut u8, flag: u8, tile: u32) {
        if *flags & flag == 0 {
            *flags |= flag;
            list.push(tile);
        }
    }

    pub(crate) fn run(&mut self, tile: u32) {
        Self::set(&mut self.running, &mut self.flags[tile as usize], Self::RUNNING, tile);
    }

    pub(crate) fn spread(&mut self, tile: u32) {
        Self::set(&mut self.spreading, &mut self.flags[tile as usize], Self::SPREADING, tile);
    }

    #[inline]
    pub(crate) fn touch(&mut self, tile: u32) {
        self.flags[tile as usize] |= Self::WET;
        Self::set(&mut self.dirty, &mut self.flags[tile as usize], Self::DIRTY, tile);
    }

    /// Has a tile sent as it is, though it never was wet.
    pub(crate) fn send(&mut self, tile: u32) {
        Self::set(&mut self.dirty, &mut self.flags[tile as usize], Self::DIRTY, tile);
    }

    pub(crate) fn renew(&mut self, tile: u32) {
        self.flags[tile as usize] |= Self::RENEWED;
    }

    /// Takes those out of a list whose flag is gone. A tile that came to rest and was woken again in the same tick is there twice,
    /// and stays once.
    pub(crate) fn prune(list: &mut Vec<u32>, flags: &[u8], flag: u8) {
        list.retain(|&tile| flags[tile as usize] & flag != 0);
        list.sort_unstable();
        list.dedup();
    }

    pub(crate) fn has(&self, tile: u32, flag: u8) -> bool {
        self.flags[tile as usize] & flag != 0
    }
}

/// The tile of a column and row of texels.
#[inline]
pub(crate) fn tile_at(size: u32, x: u32, y: u32) -> u32 {
    (y / TILE_SIZE) * (size / TILE_SIZE) + x / TILE_SIZE
}

/// A texel of a tile, by its number within it, row by row.
pub(crate) fn texel_in(size: u32, tile: u32, local: usize) -> u32 {
    let across = size / TILE_SIZE;
    let (x, y) = (local as u32 % TILE_SIZE, local as u32 / TILE_SIZE);
    (tile / across * TILE_SIZE + y) * size + tile % across * TILE_SIZE + x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_that_is_woken_in_the_tick_of_its_rest_is_busy_once() {
        let mut tiles = Tiles { flags: vec![0; 4], ..Tiles::default() };
        [3, 1, 2].into_iter().for_each(|tile| tiles.run(tile));
        tiles.flags[1] &= !Tiles::RUNNING;
        tiles.flags[3] &= !Tiles::RUNNING;
        tiles.run(1);
        Tiles::prune(&mut tiles.running, &tiles.flags, Tiles::RUNNING);
        assert_eq!(tiles.running, [1, 2]);
    }
}
