//! Where the water of a texel came from, and since when it is wet.
//!
//! Kept while [`TrackSources`] is there, beside the texels and in no need of them. Water that comes from outside takes a texel
//! over, whatever lay there before. Water that moves on the surface mixes: what a texel holds then is of one source or the
//! other with the probability of its part, decided by a hash of place and time. So a run carries its source along, shares of
//! many texels are right, and a trickle does not rename a puddle.
//!
//! Snow that melts on the dry is water of no known source. Nothing of this is saved.

use bevy::prelude::*;

use super::SurfaceWater;
use super::surface::jitter;
use crate::emitter::{Source, TrackSources};

/// Where the water of a texel came from.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Default)]
pub struct Origin {
    /// Whose the last of it was.
    pub source: Source,
    /// Tick since which it has not been dry; 0 if it was wet before anybody asked.
    pub since: u32,
}

/// Origins of all texels of a surface. Both lists are empty or have an entry for each texel.
#[derive(Debug, Clone, Default)]
pub(crate) struct Origins {
    /// Somebody wants to know, also while there are no texels yet.
    is_asked: bool,
    sources: Vec<Source>,
    since: Vec<u32>,
}

impl Origins {
    /// Whether they are kept.
    pub(crate) fn is_kept(&self) -> bool {
        !self.sources.is_empty()
    }

    /// Whose the water of a texel is.
    pub(crate) fn source(&self, texel: u32) -> Source {
        self.sources.get(texel as usize).copied().unwrap_or_default()
    }

    /// Water of this source has come to a texel.
    pub(crate) fn take_over(&mut self, texel: u32, source: Source) {
        if let Some(there) = self.sources.get_mut(texel as usize) {
            *there = source;
        }
    }

    /// A texel that was dry is wet.
    pub(crate) fn begin(&mut self, texel: u32, source: Source, tick: u32) {
        self.take_over(texel, source);
        if let Some(since) = self.since.get_mut(texel as usize) {
            *since = tick;
        }
    }

    /// So much of the water of one texel goes to another, beside what is there.
    fn mix(&mut self, [from, to]: [u32; 2], units: u32, there: u64, tick: u32) {
        let (comes, stays) = (self.source(from), self.source(to));
        // Of two that give to the same texel in a tick, each draws its own lot.
        let lot = || jitter(to.wrapping_add(from.wrapping_mul(0x2c1b_3c6d)), tick);
        let all = there as f64 + f64::from(units);
        if comes != stays && lot() * all < f64::from(units) {
            self.take_over(to, comes);
        }
    }

    /// Makes room for so many texels, if anybody asks, or takes it away.
    pub(crate) fn ask(&mut self, is_asked: bool, texels: usize) {
        self.is_asked = is_asked;
        let wanted = if is_asked { texels } else { 0 };
        if self.sources.len() != wanted {
            self.sources = vec![Source::UNKNOWN; wanted];
            self.since = vec![0; wanted];
        }
    }

    /// Bytes it holds.
    pub(crate) fn bytes(&self) -> usize {
        self.sources.capacity() * size_of::<Source>() + self.since.capacity() * size_of::<u32>()
    }
}

impl SurfaceWater {
    /// Where the water of a texel came from; `None` unless [`TrackSources`] was there when it came, or if there is no such
    /// texel. Whether any of it is left is [`WetnessQuery`](super::WetnessQuery)'s to say.
    pub fn origin(&self, texel: u32) -> Option<Origin> {
        let index = texel as usize;
        Some(Origin { source: *self.origins.sources.get(index)?, since: *self.origins.since.get(index)? })
    }

    /// As many texels as there are by now.
    pub(super) fn make_room_for_origins(&mut self) {
        self.origins.ask(self.origins.is_asked, self.texels.len());
    }

    /// So much of the film of a texel goes to another, and has not been added there yet.
    pub(super) fn film_goes(&mut self, from: u32, to: u32, units: u32, tick: u32) {
        self.water_goes([from, to], units, u64::from(self.texels[to as usize].film), tick);
    }

    /// So much of what a texel has absorbed goes to another, and has not been added there yet. Under a film it is not seen.
    pub(super) fn pores_give(&mut self, from: u32, to: u32, units: u32, tick: u32) {
        let there = self.texels[to as usize];
        if there.film == 0 {
            self.water_goes([from, to], units, u64::from(there.pores), tick);
        }
    }

    fn water_goes(&mut self, [from, to]: [u32; 2], units: u32, there: u64, tick: u32) {
        if units == 0 || !self.origins.is_kept() {
            return;
        }
        if self.texels[to as usize].is_dry() {
            self.origins.begin(to, self.origins.source(from), tick);
        } else {
            self.origins.mix([from, to], units, there, tick);
        }
    }
}

/// Lets surfaces know whether somebody asks.
pub(super) fn ask_for_origins(track: Option<Res<TrackSources>>, mut surfaces: Query<&mut SurfaceWater>) {
    for mut water in &mut surfaces {
        // What is drawn does not change.
        let water = water.bypass_change_detection();
        let texels = water.texels.len();
        water.origins.ask(track.is_some(), texels);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::overlay::Wrap;

    const ONE: Source = Source(1);
    const OTHER: Source = Source(2);

    fn water(is_asked: bool) -> SurfaceWater {
        let mut water = SurfaceWater::of_size(16, [Wrap::Clamp; 2], 1.0);
        water.origins.ask(is_asked, 0);
        water.wake(false);
        water
    }

    #[test]
    fn nothing_is_kept_unless_somebody_asks() {
        let mut ignored = water(false);
        ignored.origins.begin(3, ONE, 7);
        ignored.film_goes(3, 4, 100, 8);
        assert_eq!((ignored.origin(3), ignored.origins.bytes()), (None, 0));
        let mut asked = water(true);
        asked.origins.begin(3, ONE, 7);
        assert_eq!(asked.origin(3), Some(Origin { source: ONE, since: 7 }));
        assert_eq!((asked.origin(5), asked.origin(256)), (Some(Origin::default()), None));
        // Nobody asks any more, and then again.
        for (is_asked, expected) in [(false, None), (true, Some(Origin::default()))] {
            asked.origins.ask(is_asked, 256);
            assert_eq!(asked.origin(3), expected);
        }
    }

    #[test]
    fn what_runs_onto_the_dry_takes_its_source_along() {
        let mut water = water(true);
        water.origins.begin(3, ONE, 7);
        water.film_goes(3, 4, 100, 9);
        assert_eq!(water.origin(4), Some(Origin { source: ONE, since: 9 }));
        // Nothing comes of nothing.
        water.film_goes(3, 5, 0, 9);
        assert_eq!(water.origin(5), Some(Origin::default()));
    }

    #[test]
    fn mixed_water_is_of_either_source_by_its_part() {
        let mut water = water(true);
        let mut taken = 0;
        for tick in 1..=4000 {
            for (texel, source) in [(3, ONE), (4, OTHER)] {
                water.origins.begin(texel, source, 1);
            }
            water.texels[4].film = 300;
            water.texels[4].pores = 9000;
            water.film_goes(3, 4, 100, tick);
            assert_eq!(water.origin(4).map(|origin| origin.since), Some(1));
            taken += u32::from(water.origins.source(4) == ONE);
        }
        assert!((taken as f32 / 4000.0 - 0.25).abs() < 0.03, "{taken}");
        // What is soaked up from the side does not show under a film.
        water.origins.begin(4, OTHER, 1);
        (1..100).for_each(|tick| water.pores_give(3, 4, 1_000_000, tick));
        assert_eq!(water.origins.source(4), OTHER);
        water.texels[4].film = 0;
        (1..100).for_each(|tick| water.pores_give(3, 4, 1_000_000, tick));
        assert_eq!(water.origins.source(4), ONE);
    }
}
