//! All stamps in use, in one array.

use std::sync::Arc;

use bevy::prelude::*;

use crate::stamps::sample::STAMP_TEXELS;
use crate::stamps::small::{LEVELS, level, widened};
use crate::stamps::{StampSet, StampTexel};

/// The stamps of all effects, one after the other; a splat names one by its number, from 1. Each is there [`LEVELS`] times, for
/// marks of all sizes. A set that is there already is not added again.
///
/// Numbers stay true while an effect has the set. One that none has any more, as after an edit, stays until its place is needed:
/// it may come back, and splats that name it may still wait for the GPU. What has been out of use the longest goes first.
#[derive(Resource, Debug, Clone, Default)]
pub struct StampAtlas {
    texels: Arc<Vec<StampTexel>>,
    /// Those in use.
    sets: Vec<Place>,
    /// Those out of use, the oldest first.
    retired: Vec<Place>,
}

/// Where a set lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place {
    /// The number of its first stamp.
    first: u32,
    /// How many variants it has, each [`LEVELS`] times.
    variants: u32,
}

impl Place {
    /// The first number behind it.
    fn end(self) -> u32 {
        self.first + self.variants * LEVELS
    }
}

impl StampAtlas {
    /// The most stamps, each level counted: 256 MiB.
    pub const MAX_STAMPS: u32 = 4096;

    /// Adds the variants of a set; the number of the first, or none if there is no more room.
    pub fn add(&mut self, set: &StampSet) -> Option<u32> {
        if let Some(place) = self.sets.iter().find(|place| self.holds(**place, set)) {
            return Some(place.first);
        }
        if let Some(index) = self.retired.iter().position(|&place| self.holds(place, set)) {
            let place = self.retired.remove(index);
            self.sets.push(place);
            return Some(place.first);
        }
        let variants = u32::try_from(set.variants.len()).ok()?;
        let first = self.room_for(variants.checked_mul(LEVELS)?)?;
        let place = Place { first, variants };
        let texels = Arc::make_mut(&mut self.texels);
        let end = (place.end() - 1) as usize * STAMP_TEXELS as usize;
        if texels.len() < end {
            texels.resize(end, StampTexel::default());
        }
        let from = (first - 1) as usize * STAMP_TEXELS as usize;
        let levels =
            set.variants.iter().flat_map(|stamp| (0..LEVELS).map(move |level| widened(stamp, level)));
        for (target, stamp) in texels[from..end].chunks_exact_mut(STAMP_TEXELS as usize).zip(levels) {
            target.fill(StampTexel::default());
            target.iter_mut().zip(&stamp.texels).for_each(|(target, texel)| *target = *texel);
        }
        self.sets.push(place);
        Some(first)
    }

    /// Retires the sets whose first number is not `in_use`.
    pub(crate) fn retire_unless(&mut self, in_use: impl Fn(u32) -> bool) {
        let Self { sets, retired, .. } = self;
        retired.extend(sets.extract_if(.., |place| !in_use(place.first)));
    }

    /// Whether a set lies at a place.
    fn holds(&self, place: Place, set: &StampSet) -> bool {
        let mut variants = set.variants.iter().zip(0..place.variants);
        set.variants.len() == place.variants as usize
            && variants
                .all(|(stamp, number)| self.stamp(place.first + number * LEVELS) == stamp.texels.as_slice())
    }

    /// The first of so many free numbers in a row. Where there are none, retired sets have to go, the oldest first; all of them
    /// stay if that would be in vain.
    fn room_for(&mut self, numbers: u32) -> Option<u32> {
        let mut kept = self.retired.len();
        loop {
            let retired = &self.retired[self.retired.len() - kept..];
            let mut taken: Vec<Place> = self.sets.iter().chain(retired).copied().collect();
            taken.sort_unstable_by_key(|place| place.first);
            let mut first = 1;
            for place in taken {
                if place.first.saturating_sub(first) >= numbers {
                    break;
                }
                first = place.end();
            }
            if numbers <= (Self::MAX_STAMPS + 1).saturating_sub(first) {
                self.retired.drain(..self.retired.len() - kept);
                return Some(first);
            }
            kept = kept.checked_sub(1)?;
        }
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

    /// Whether nothing has been written since one became a clone of the other.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.texels, &other.texels)
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

    use super::super::deposit::number_stamps;
    use super::super::{CpuMaps, Splat, Weatherable};
    use super::*;
    use crate::effect::{EffectTable, StampSource, WeatherEffect};
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

    /// The place of the first sets of [`full`], by what is in them.
    fn place(value: u32) -> u32 {
        1 + value * LEVELS
    }

    /// Ten sets of one variant, and one that takes the rest.
    fn full() -> StampAtlas {
        let mut atlas = StampAtlas::default();
        for value in 0..10 {
            assert_eq!(atlas.add(&set(&[value])), Some(place(value)));
        }
        // Only noted down: it would take a quarter of a gigabyte.
        atlas.sets.push(Place { first: place(10), variants: StampAtlas::MAX_STAMPS / LEVELS - 10 });
        assert_eq!(atlas.add(&set(&[1_000_000])), None);
        atlas
    }

    #[test]
    fn places_out_of_use_are_given_to_others_once_there_is_no_more_room() {
        let mut atlas = full();
        let before = atlas.clone();
        // Out of use: first the fifth alone, then the third, the fourth and the ninth.
        atlas.retire_unless(|first| first != place(5));
        atlas.retire_unless(|first| ![3, 4, 9].map(place).contains(&first));
        // One that comes back is where it was.
        assert_eq!(atlas.add(&set(&[9])), Some(place(9)));
        assert!(atlas.is_same(&before));
        // Two variants have room only where three sets lay side by side, the last of which goes last.
        assert_eq!(atlas.add(&set(&[500, 501])), Some(place(3)));
        assert_eq!(atlas.add(&set(&[502])), Some(place(5)));
        assert_eq!(atlas.add(&set(&[503])), None);
        let first = |value| atlas.stamp(place(value))[0].diffuse;
        assert_eq!([2, 3, 4, 5, 6, 9].map(first), [2, 500, 501, 502, 6, 9]);
        assert_eq!(atlas.texels().len(), before.texels().len());
        assert!(!atlas.is_same(&before));
    }

    #[test]
    fn what_is_out_of_use_stays_while_there_is_room_and_if_its_place_is_too_narrow() {
        let mut atlas = StampAtlas::default();
        let [a, b] = [7, 8].map(|value| atlas.add(&set(&[value])));
        atlas.retire_unless(|_| false);
        assert_eq!(atlas.add(&set(&[9])), Some(1 + 2 * LEVELS));
        assert_eq!([8, 7].map(|value| atlas.add(&set(&[value]))), [b, a]);

        let mut atlas = full();
        atlas.retire_unless(|first| first != 1);
        assert_eq!(atlas.add(&set(&[500, 501])), None);
        assert_eq!(atlas.add(&set(&[0])), Some(1));
    }

    #[test]
    fn what_an_edit_leaves_behind_is_retired() {
        let mut world = World::new();
        world.init_resource::<StampAtlas>();
        world.init_resource::<EffectTable>();
        let mut schedule = Schedule::default();
        schedule.add_systems(number_stamps);
        let after = |kind| {
            let stamps = StampSource::Kind(kind);
            let effect = WeatherEffect { stamps, stamp_radius: Some(0.02), ..default() };
            world.resource_mut::<EffectTable>().insert(Handle::default(), effect);
            schedule.run(&mut world);
            let atlas = world.resource::<StampAtlas>();
            (atlas.sets.len(), atlas.retired.len())
        };
        let edits = [StampKind::Splat, StampKind::Drop, StampKind::Splat];
        assert_eq!(edits.map(after), [(1, 0), (1, 1), (1, 1)]);
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
