//! What lies on a texel beside its water, in whole numbers.

use bevy::prelude::*;
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Matter on one texel. Volumes in the [`Units`](crate::wetting::Units) of the surface's water: solids without the pores
/// between their grains, snow as the water it melts to, so that melting is a move of whole numbers.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct TexelMatter {
    /// Loose grains: dry dust, or what a film carries.
    pub dust: u32,
    /// Bound soil: dust that got wet, dried crust, thrown mud.
    pub mud: u32,
    /// Snow, as water.
    pub snow: u32,
}

impl TexelMatter {
    /// Whether nothing lies there.
    pub fn is_clean(&self) -> bool {
        *self == Self::default()
    }

    /// Dust and mud, units.
    pub fn soil(&self) -> u64 {
        u64::from(self.dust) + u64::from(self.mud)
    }
}

/// What falls, beside water.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MatterKind {
    /// Dry grains.
    Dust,
    /// The solids of mud; its water comes as water.
    Mud,
    /// Flakes, as the water they melt to.
    Snow,
}

/// Moves up to `units` from one amount to another, no more than there is or fits in; how much it was.
pub(super) fn pour(from: &mut u32, to: &mut u32, units: u64) -> u32 {
    let moved = take(from, units.min(u64::from(u32::MAX - *to)));
    *to += moved;
    moved
}

/// Takes up to `units` away; how much it was.
pub(super) fn take(from: &mut u32, units: u64) -> u32 {
    let taken = units.min(u64::from(*from)) as u32;
    *from -= taken;
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_is_moved_than_there_is_or_fits_in() {
        let (mut from, mut to) = (10, u32::MAX - 4);
        assert_eq!(pour(&mut from, &mut to, 3), 3);
        assert_eq!(pour(&mut from, &mut to, u64::MAX), 1);
        assert_eq!((from, to), (6, u32::MAX));
        assert_eq!([take(&mut from, 4), take(&mut from, 4), from], [4, 2, 0]);
    }
}
