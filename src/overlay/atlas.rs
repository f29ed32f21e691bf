//! All stamps in use, in one array.

use std::sync::Arc;

use bevy::prelude::*;

use crate::stamps::sample::STAMP_TEXELS;
use crate::stamps::small::{LEVELS, level, widened};
use crate::stamps::{StampSet, StampTexel};

/// The stamps of all effects, one after the other; a splat names one by its number, from 1. Each is there [`LEVELS`] times, for
/// marks of all sizes. Grows only, so numbers stay true; a set that is there already is not added again.
#[derive(Resource, Debug, Clone, Default)]
pub struct StampAtlas {
    texels: Arc<Vec<StampTexel>>,
    /// The number of the first stamp of each set, and how many there are.
    sets: Vec<(u32, u32)>,
}

impl StampAtlas {
    /// The most stamps, each level counted: 256 MiB.
    pub const MAX_STAMPS: u32 = 4096;

    /// Adds the variants of a set; the number of the first, or none if there is no more room.
    pub fn add(&mut self, set: &StampSet) -> Option<u32> {
        if let Some(first) = self.first_of(set) {
            return Some(first);
        }
        let (first, count) = (self.len() + 1, set.variants.len() as u32);
        if first + count * LEVELS > Self::MAX_STAMPS + 1 {
            return None;
        }
        let texels = Arc::make_mut(&mut self.texels);
        for stamp in &set.variants {
            (0..LEVELS).for_each(|level| texels.extend_from_slice(&widened(stamp, level).texels));
        }
        self.sets.push((first, count));
        Some(first)
    }

    /// The number of the first stamp of a set that is there.
    fn first_of(&self, set: &StampSet) -> Option<u32> {
        let is_same = |&&(first, count): &&(u32, u32)| {
            let mut variants = set.variants.iter().zip(0..count);
            set.variants.len() as u32 == count
                && variants
                    .all(|(stamp, number)| self.stamp(first + number * LEVELS) == stamp.texels.as_slice())
        };
        self.sets.iter().find(is_same).map(|&(first, _)| first)
    }

    /// The number of a variant for a mark of this size; see [`level`]. `first`: what [`Self::add`] returned.
    pub fn number(first: u32, variant: u32, radius: [i32; 2], stretch: f32) -> u32 {
        first + variant * LEVELS + level(radius, stretch)
    }

    /// How many numbers there are.
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
    use bytemuck::Zeroable;

    use super::super::{CpuMaps, Splat, Weatherable};
    use super::*;
    use crate::stamps::{Stamp, StampKind, StampOptions, stamps};

    fn set(values: &[u32]) -> StampSet {
        let stamp = |&diffuse: &u32| Stamp {
            texels: vec![StampTexel { diffuse, ..default() }; STAMP_TEXELS as usize],
        };
        StampSet { size: 64, variants: values.iter().map(stamp).collect() }
    }

    #[test]
    fn numbers_stay_true() {
        let mut atlas = StampAtlas::default();
        assert!(atlas.stamp(0).is_empty() && atlas.stamp(1).is_empty());
        assert_eq!(atlas.add(&set(&[7, 8])), Some(1));
        assert_eq!(atlas.add(&set(&[9])), Some(1 + 2 * LEVELS));
        let whole = [1000 * 256; 2];
        let first = |first, variant| {
            atlas.stamp(StampAtlas::number(first, variant, whole, 1.0)).first().map(|texel| texel.diffuse)
        };
        assert_eq!(
            [(1, 0), (1, 1), (13, 0), (13, 1)].map(|(a, b)| first(a, b)),
            [Some(7), Some(8), Some(9), None]
        );
        assert_eq!(atlas.len(), 3 * LEVELS);
    }

    #[test]
    fn a_set_that_comes_again_takes_no_more_room() {
        let mut atlas = StampAtlas::default();
        let firsts = [&[7, 8][..], &[9], &[7, 8], &[7], &[9]].map(|values| atlas.add(&set(values)));
        assert_eq!(firsts, [1, 13, 1, 19, 13].map(Some));
        assert_eq!(atlas.len(), 4 * LEVELS);
    }

    #[test]
    fn a_set_for_which_there_is_no_room_changes_nothing() {
        let mut atlas = StampAtlas::default();
        assert_eq!(atlas.add(&set(&vec![0; (StampAtlas::MAX_STAMPS / LEVELS + 1) as usize])), None);
        assert!(atlas.is_empty());
    }

    #[test]
    fn a_small_mark_is_as_strong_wherever_it_lies_between_texels() {
        for kind in [StampKind::Drop, StampKind::Drops, StampKind::Splat, StampKind::Runnel] {
            let made = stamps(kind, &StampOptions { variants: 2, ..default() }).unwrap();
            let set = StampSet::from_images(Some(&made.diffuse), None, None, 2).unwrap();
            let mut atlas = StampAtlas::default();
            let first = atlas.add(&set).unwrap();
            for (variant, stamp) in set.variants.iter().enumerate() {
                let whole: u32 = stamp.texels.iter().map(|texel| texel.diffuse >> 24).sum();
                for texels in [2, 4, 8] {
                    let radius = [texels * 256; 2];
                    let expected = f64::from(whole) / 4096.0 * f64::from(4 * texels * texels);
                    for place in 0..16 {
                        let splat = Splat {
                            center: [8192 + place * 83 % 256, 8192 + place * 151 % 256],
                            radius,
                            diffuse: 0xffff_ffff,
                            stamp: StampAtlas::number(first, variant as u32, radius, 1.0),
                            row_s: [1024, 0, 0],
                            row_t: [0, 1024, 0],
                            ..Splat::zeroed()
                        };
                        let mut maps = CpuMaps::new(&Weatherable { map_size: 64, ..default() });
                        maps.paint(&[splat], &atlas, None);
                        let painted: u32 = maps.diffuse.iter().map(|texel| u32::from(texel[3])).sum();
                        let part = f64::from(painted) / expected;
                        // Of single texels of the stamp it would be anything from a third to one and a half.
                        assert!((0.92..1.08).contains(&part), "{kind:?} {variant} {texels} {place}: {part}");
                    }
                }
            }
        }
    }
}
