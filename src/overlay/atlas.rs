//! All stamps in use, in one array.

use std::sync::Arc;

use bevy::prelude::*;

use crate::stamps::sample::STAMP_TEXELS;
use crate::stamps::{StampSet, StampTexel};

/// The stamps of all effects, one after the other; a splat names one by its number, from 1. Grows only, so numbers stay true.
#[derive(Resource, Debug, Clone, Default)]
pub struct StampAtlas {
    texels: Arc<Vec<StampTexel>>,
}

impl StampAtlas {
    /// The most stamps: 256 MiB.
    pub const MAX_STAMPS: u32 = 4096;

    /// Adds the variants of a set; the number of the first, or none if there is no more room.
    pub fn add(&mut self, set: &StampSet) -> Option<u32> {
        let first = self.len() + 1;
        if first + set.variants.len() as u32 > Self::MAX_STAMPS + 1 {
            return None;
        }
        let texels = Arc::make_mut(&mut self.texels);
        set.variants.iter().for_each(|stamp| texels.extend_from_slice(&stamp.texels));
        Some(first)
    }

    /// How many there are.
    pub fn len(&self) -> u32 {
        (self.texels.len() / STAMP_TEXELS as usize) as u32
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.texels.is_empty()
    }

    /// All texels, stamp by stamp.
    pub fn texels(&self) -> &[StampTexel] {
        &self.texels
    }

    /// The texels of a stamp, by its number; nothing for 0 or a number that is not there.
    pub(crate) fn stamp(&self, number: u32) -> &[StampTexel] {
        let count = STAMP_TEXELS as usize;
        let from = (number as usize).wrapping_sub(1).saturating_mul(count);
        self.texels.get(from..from.saturating_add(count)).unwrap_or(&[])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stamps::Stamp;

    #[test]
    fn numbers_stay_true() {
        let set = |values: &[u32]| StampSet {
            size: 64,
            variants: values
                .iter()
                .map(|&value| Stamp {
                    texels: vec![StampTexel { diffuse: value, ..default() }; STAMP_TEXELS as usize],
                })
                .collect(),
        };
        let mut atlas = StampAtlas::default();
        assert!(atlas.stamp(0).is_empty() && atlas.stamp(1).is_empty());
        assert_eq!(atlas.add(&set(&[7, 8])), Some(1));
        assert_eq!(atlas.add(&set(&[9])), Some(3));
        let first = |number| atlas.stamp(number).first().map(|texel| texel.diffuse);
        assert_eq!([0, 1, 2, 3, 4].map(first), [None, Some(7), Some(8), Some(9), None]);
        assert_eq!(atlas.add(&set(&[0; StampAtlas::MAX_STAMPS as usize])), None);
        assert_eq!(atlas.len(), 3);
    }
}
