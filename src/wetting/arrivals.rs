//! Water of a tick, gathered before it is put down.
//!
//! Under a hose hundreds of stamps lie over each other, each over a thousand texels. Summing them texel by texel would be
//! most of the cost of a tick. So a stamp that is large is summed on a coarser grid, in which it is [`LEAST_CELLS`] to twice as
//! many cells from its middle to its rim. Once all have been gathered, each grid is shared out to the next finer one by the
//! subdivision of the quadratic B-spline (Chaikin 1974): of its water a cell keeps 3/4 along each axis for its own two
//! halves, and gives 1/8 to the half on either side. In the limit every cell becomes a smooth bump, the one that a stamp is
//! made of. It is wider than the cell by a known variance, which is taken off the stamp's own: so the patch is as wide as
//! if it had been summed in texels.
//!
//! All amounts are whole nanolitres. A cell is cut into parts that add up to it, so not one is lost on the way.
//!
//! - Chaikin 1974, *An algorithm for high-speed curve generation*.

use crate::overlay::{TILE_SIZE, Wrap};

/// Cells from the middle of a stamp to its rim, at least, where it is gathered on a coarser grid.
pub(crate) const LEAST_CELLS: i32 = 4;

/// The coarsest grid has cells of 16 texels.
const COARSEST: u32 = 4;

const TILE_CELLS: usize = (TILE_SIZE * TILE_SIZE) as usize;

/// Water in a cell, and with what it came.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Parcel {
    /// Nanolitres.
    pub(crate) nl: u64,
    /// The texel that was hit: of the last drop. Where the cell lies beside the surface's islands, the water goes there.
    pub(crate) home: u32,
    /// The highest speed, cm/s.
    pub(crate) speed_cm: u16,
    /// Some of it is of a jet.
    pub(crate) is_jet: bool,
}

impl Parcel {
    fn add(&mut self, other: Self) {
        *self = Self {
            nl: self.nl + other.nl,
            home: other.home,
            speed_cm: self.speed_cm.max(other.speed_cm),
            is_jet: self.is_jet | other.is_jet,
        };
    }

    /// What goes to the four halves from the left neighbour's right one to the right neighbour's left one: 1, 3, 3 and 1
    /// eighths, rounded so that they add up.
    fn halves(self) -> [Self; 4] {
        let outer = self.nl / 8;
        let inner = (self.nl - 2 * outer) / 2;
        let part = |nl| Self { nl, ..self };
        [part(outer), part(self.nl - 2 * outer - inner), part(inner), part(outer)]
    }
}

/// One grid. Only tiles of it that got water have memory.
#[derive(Debug, Default)]
pub(crate) struct Grid {
    /// Tiles along each side.
    across: u32,
    /// For each tile, where its cells begin, in tiles and from 1; 0 for none.
    slots: Vec<u32>,
    /// Tiles that have cells, in the order of their slots.
    touched: Vec<u32>,
    /// Tile by tile, row by row within.
    cells: Vec<Parcel>,
}

impl Grid {
    fn begin(&mut self, side: u32) {
        self.across = side.div_ceil(TILE_SIZE);
        let tiles = self.across.pow(2) as usize;
        if self.slots.len() < tiles {
            self.slots.resize(tiles, 0);
        }
    }

    /// Adds water to a cell.
    pub(crate) fn add(&mut self, [x, y]: [u32; 2], parcel: Parcel) {
        let tile = y / TILE_SIZE * self.across + x / TILE_SIZE;
        let slot = &mut self.slots[tile as usize];
        if *slot == 0 {
            self.touched.push(tile);
            self.cells.resize(self.cells.len() + TILE_CELLS, Parcel::default());
            *slot = self.touched.len() as u32;
        }
        let local = y % TILE_SIZE * TILE_SIZE + x % TILE_SIZE;
        self.cells[(*slot as usize - 1) * TILE_CELLS + local as usize].add(parcel);
    }

    /// Hands over every cell that holds water, with its column and row, by ascending tiles, and is empty then.
    fn drain(&mut self, mut each: impl FnMut([u32; 2], Parcel)) {
        self.touched.sort_unstable();
        for tile in self.touched.drain(..) {
            let slot = std::mem::take(&mut self.slots[tile as usize]) as usize - 1;
            let corner = [tile % self.across, tile / self.across].map(|at| at * TILE_SIZE);
            let cells = &self.cells[slot * TILE_CELLS..(slot + 1) * TILE_CELLS];
            for (local, parcel) in (0..).zip(cells).filter(|(_, parcel)| parcel.nl > 0) {
                each([corner[0] + local % TILE_SIZE, corner[1] + local / TILE_SIZE], *parcel);
            }
        }
        self.cells.clear();
    }
}

/// The water of one tick on one surface, on grids of 1, 2, 4, 8 and 16 texels a cell. Keeps its memory from tick to tick
/// and from surface to surface.
#[derive(Debug, Default)]
pub(crate) struct Arrivals {
    grids: [Grid; COARSEST as usize + 1],
}

impl Arrivals {
    /// The grid for a stamp with these half axes in 1/256 texel, as the binary logarithm of its cells' size in texels. Only grids
    /// that divide a map of this size.
    pub(crate) fn level(radius: [i32; 2], size: u32) -> u32 {
        let cells = radius[0].min(radius[1]) / (256 * LEAST_CELLS);
        cells.max(1).ilog2().min(COARSEST).min(size.trailing_zeros())
    }

    /// Half axis of a stamp on its grid, in 1/256 cell: smaller by what the subdivision will add. A B-spline of half width
    /// r has the variance r²/9; summing over cells adds a twelfth of a cell's square, sharing out a quarter.
    pub(crate) fn gathered_radius(radius: i32, level: u32) -> i32 {
        if level == 0 {
            return radius;
        }
        let cell = f64::from(256 << level);
        let narrowed = (f64::from(radius).powi(2) - 3.0 * cell * cell).max(0.0).sqrt();
        ((narrowed * 256.0 / cell) as i32).max(1)
    }

    /// Makes room for a surface with so many texels along each side.
    pub(crate) fn begin(&mut self, size: u32) {
        for (level, grid) in self.grids.iter_mut().enumerate() {
            grid.begin(size >> level);
        }
    }

    /// One of the grids; the first is that of texels.
    pub(crate) fn grid(&mut self, level: u32) -> &mut Grid {
        &mut self.grids[level as usize]
    }

    /// Shares everything out among texels. `lay`: puts water that comes over a texel where it goes.
    pub(crate) fn share_out(
        &mut self,
        size: u32,
        wrap: [Wrap; 2],
        lay: impl Fn(&mut Grid, [u32; 2], Parcel),
    ) {
        for level in (1..=COARSEST).rev() {
            let (finer, coarser) = self.grids.split_at_mut(level as usize);
            let fine = &mut finer[level as usize - 1];
            let halves = size >> (level - 1);
            coarser[0].drain(|[column, row], parcel| {
                let columns = halves_at(column, halves, wrap[0]);
                let rows = halves_at(row, halves, wrap[1]);
                for (y, in_row) in rows.into_iter().zip(parcel.halves()) {
                    for (x, part) in columns.into_iter().zip(in_row.halves()) {
                        match part.nl {
                            0 => {}
                            _ if level == 1 => lay(fine, [x, y], part),
                            _ => fine.add([x, y], part),
                        }
                    }
                }
            });
        }
    }

    /// Hands over what has come to each texel, by ascending tiles.
    pub(crate) fn drain(&mut self, each: impl FnMut([u32; 2], Parcel)) {
        self.grids[0].drain(each);
    }
}

/// The halves of a cell and of those beside it that get its water, on an axis of so many halves.
fn halves_at(cell: u32, halves: u32, wrap: Wrap) -> [u32; 4] {
    let first = 2 * cell;
    let (before, after) = match wrap {
        Wrap::Repeat => ((first + halves - 1) % halves, (first + 2) % halves),
        Wrap::Clamp => (first.saturating_sub(1), (first + 2).min(halves - 1)),
    };
    [before, first, first + 1, after]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: u32 = 64;

    fn shared_out(level: u32, cell: u32, nl: u64, wrap: [Wrap; 2]) -> Vec<u64> {
        let mut arrivals = Arrivals::default();
        arrivals.begin(SIZE);
        let across = SIZE >> level;
        let parcel = Parcel { nl, home: 3, speed_cm: 7, is_jet: true };
        arrivals.grid(level).add([cell % across, cell / across], parcel);
        arrivals.share_out(SIZE, wrap, |texels, texel, parcel| texels.add(texel, parcel));
        let mut texels = vec![0; (SIZE * SIZE) as usize];
        arrivals.drain(|[x, y], parcel| {
            assert_eq!((parcel.speed_cm, parcel.is_jet, parcel.home), (7, true, 3));
            texels[(y * SIZE + x) as usize] += parcel.nl;
        });
        for grid in &arrivals.grids {
            assert!(grid.touched.is_empty() && grid.cells.is_empty());
            assert!(grid.slots.iter().all(|slot| *slot == 0));
        }
        texels
    }

    #[test]
    fn what_is_shared_out_adds_up_on_every_grid_in_corners_too() {
        for wrap in [[Wrap::Clamp; 2], [Wrap::Repeat; 2], [Wrap::Clamp, Wrap::Repeat]] {
            for level in 0..=COARSEST {
                let across = SIZE >> level;
                for cell in [0, across - 1, across * across - 1, across + 1] {
                    for nl in [1, 7, 8, 1_000_003, u64::from(u32::MAX) * 9] {
                        assert_eq!(shared_out(level, cell, nl, wrap).iter().sum::<u64>(), nl);
                    }
                }
            }
        }
    }

    #[test]
    fn a_cell_becomes_a_smooth_bump_around_its_middle() {
        // The third cell of the third row of 4 x 4.
        let texels = shared_out(COARSEST, 10, 1_000_000_000, [Wrap::Repeat; 2]);
        let profile: Vec<f64> = (0..SIZE)
            .map(|x| (0..SIZE).map(|y| texels[(y * SIZE + x) as usize] as f64).sum::<f64>() / 1.0e9)
            .collect();
        let mean: f64 = profile.iter().enumerate().map(|(x, part)| (x as f64 + 0.5) * part).sum();
        let variance: f64 =
            profile.iter().enumerate().map(|(x, part)| (x as f64 + 0.5 - mean).powi(2) * part).sum();
        assert!((mean - 40.0).abs() < 1e-3, "{mean}");
        // A quarter of the square of 16 texels; a little less, since the subdivision stops at texels.
        assert!((variance / 64.0 - 1.0).abs() < 0.01, "{variance}");
        let steepest = profile.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
        assert!(steepest < 0.005, "{steepest}");
    }

    #[test]
    fn a_large_stamp_is_gathered_on_a_grid_that_it_covers_with_few_cells() {
        let level = |texels: i32| Arrivals::level([texels * 256, 300 * 256], 1024);
        assert_eq!([1, 7, 8, 15, 16, 32, 64, 500].map(level), [0, 0, 1, 1, 2, 3, 4, 4]);
        // 48 is three times sixteen.
        assert_eq!(Arrivals::level([100 * 256; 2], 48), 4);
        assert_eq!(Arrivals::level([100 * 256; 2], 40), 3);
    }
}
