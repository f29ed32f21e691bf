//! The texels of a map as a grid: which lie side by side in the image, and which one a point of the map falls
//! into.

use bevy::math::DVec2;

use crate::overlay::Wrap;

/// A side of a texel in the image of the map.
#[repr(u8)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Side {
    /// Towards smaller u.
    MinusU = 0,
    /// Towards larger u.
    PlusU = 1,
    /// Towards smaller v.
    MinusV = 2,
    /// Towards larger v.
    PlusV = 3,
}

impl Side {
    /// All four, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::MinusU, Self::PlusU, Self::MinusV, Self::PlusV];

    /// The side over against this one.
    pub fn opposite(self) -> Self {
        match self {
            Self::MinusU => Self::PlusU,
            Self::PlusU => Self::MinusU,
            Self::MinusV => Self::PlusV,
            Self::PlusV => Self::MinusV,
        }
    }

    /// 0 along u, 1 along v.
    pub(super) fn axis(self) -> usize {
        match self {
            Self::MinusU | Self::PlusU => 0,
            Self::MinusV | Self::PlusV => 1,
        }
    }

    /// The way to the texel on this side, in columns and rows.
    pub(super) fn offset(self) -> [i32; 2] {
        match self {
            Self::MinusU => [-1, 0],
            Self::PlusU => [1, 0],
            Self::MinusV => [0, -1],
            Self::PlusV => [0, 1],
        }
    }
}

/// A square map of texels, numbered row by row from v = 0.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    /// Texels along each side, at least 1.
    pub(super) size: u32,
    /// What lies beyond the edges, along u and v.
    pub(super) wrap: [Wrap; 2],
}

impl Grid {
    /// Number of texels.
    pub(super) fn texels(&self) -> usize {
        self.size as usize * self.size as usize
    }

    /// The texel in this column and row, where those beyond the map go where [`Wrap`] says.
    pub(super) fn texel(&self, column: i32, row: i32) -> u32 {
        let side = self.size as i32;
        let inside = |number: i32, wrap| match wrap {
            // A division is slow, and mostly for nothing.
            _ if (0..side).contains(&number) => number,
            Wrap::Repeat => number.rem_euclid(side),
            Wrap::Clamp => number.clamp(0, side - 1),
        };
        (inside(row, self.wrap[1]) * side + inside(column, self.wrap[0])) as u32
    }

    /// Column and row of a texel.
    pub(super) fn cell(&self, texel: u32) -> [i32; 2] {
        [(texel % self.size) as i32, (texel / self.size) as i32]
    }

    /// Whether a column and row exist, once those of repeated axes are brought into the map.
    pub(super) fn holds(&self, column: i32, row: i32) -> bool {
        let inside = |number: i32, wrap| wrap == Wrap::Repeat || (0..self.size as i32).contains(&number);
        inside(column, self.wrap[0]) && inside(row, self.wrap[1])
    }

    /// The texel into which a point of the map falls, in texels, of any tile.
    pub(super) fn at(&self, point: DVec2) -> u32 {
        // The conversion ends at the limits of an i32: uvs without sense give some texel.
        self.texel(point.x.floor() as i32, point.y.floor() as i32)
    }

    /// The texel so many columns and rows away in the image; None beyond a clamped edge.
    pub(super) fn beside(&self, texel: u32, offset: [i32; 2]) -> Option<u32> {
        self.beside_cell(self.cell(texel), offset)
    }

    /// The texel so many columns and rows away from this column and row; None beyond a clamped edge.
    pub(super) fn beside_cell(&self, [column, row]: [i32; 2], [columns, rows]: [i32; 2]) -> Option<u32> {
        let (column, row) = (column + columns, row + rows);
        self.holds(column, row).then(|| self.texel(column, row))
    }

    /// Whether a distance on the map, in texels, leads from a point to the same texel of another tile (or
    /// nowhere), give or take `tolerance`.
    pub(super) fn is_whole_tiles(&self, distance: DVec2, tolerance: f64) -> bool {
        let side = f64::from(self.size);
        let whole = |distance: f64, wrap| match wrap {
            Wrap::Repeat => (distance - (distance / side).round() * side).abs() < tolerance,
            Wrap::Clamp => distance.abs() < tolerance,
        };
        whole(distance.x, self.wrap[0]) && whole(distance.y, self.wrap[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_come_in_pairs() {
        for (number, side) in Side::ALL.into_iter().enumerate() {
            assert_eq!(side as usize, number);
            assert_eq!(side.opposite().opposite(), side);
            assert_eq!(side.axis(), side.opposite().axis());
            let ([x, y], [back_x, back_y]) = (side.offset(), side.opposite().offset());
            assert_eq!([x + back_x, y + back_y], [0, 0]);
        }
    }

    #[test]
    fn each_axis_wraps_in_its_own_way() {
        let grid = Grid { size: 16, wrap: [Wrap::Repeat, Wrap::Clamp] };
        assert_eq!(grid.texel(-1, -1), 15);
        assert_eq!(grid.texel(33, 40), 15 * 16 + 1);
        assert_eq!(grid.beside(0, Side::MinusU.offset()), Some(15));
        assert_eq!(grid.beside(0, Side::MinusV.offset()), None);
        assert_eq!(grid.beside(15 * 16, Side::PlusV.offset()), None);
        assert_eq!(grid.at(DVec2::new(-0.5, 3.5)), 3 * 16 + 15);
        assert!(grid.is_whole_tiles(DVec2::new(-32.0, 0.0), 0.01));
        assert!(!grid.is_whole_tiles(DVec2::new(0.0, 16.0), 0.01));
        // No panic, whatever it gives.
        grid.at(DVec2::new(f64::NAN, 1e300));
    }
}
