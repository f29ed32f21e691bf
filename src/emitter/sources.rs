//! Which emitter it was.
//!
//! Kept while the resource [`TrackSources`] is there, and paid for by nobody else. Particles have no column for it: they are
//! numbered in the order in which they are born, emitter by emitter, so a list of runs, one for each emitter and tick, tells
//! whose a [`Sequence`](crate::particle::Sequence) is. An impact looks it up once; from there the [`Source`] goes with the
//! [`Drop`](crate::wetting::Drop) to the texels that it wets ([`Origin`](crate::wetting::Origin)). What drips off or is
//! thrown up is of the source of its water.
//!
//! Nothing that is simulated depends on it, and it is not saved: what was in flight when a run is gone on with, or when
//! somebody began to ask, is of [`Source::UNKNOWN`].

use std::collections::VecDeque;

use bevy::prelude::*;

/// Where water came from, as a number: that of an emitter in [`TrackSources`], or one of the constants.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[reflect(Default)]
pub struct Source(pub u16);

impl Source {
    /// Nobody knows.
    pub const UNKNOWN: Self = Self(0);
    /// A [brush](crate::brush).
    pub const BY_HAND: Self = Self(u16::MAX);
}

/// Asks for the source of all water: insert it to know which emitter wetted a texel, and remove it to save six bytes a
/// texel. Holds the emitters that have sent anything since, in the order of their first particle.
#[derive(Resource, Reflect, Debug, Default, Clone)]
#[reflect(Resource, Default)]
pub struct TrackSources {
    emitters: Vec<Entity>,
}

impl TrackSources {
    /// The most emitters that are told from each other; what others send is of [`Source::UNKNOWN`].
    pub const MOST: usize = u16::MAX as usize - 1;

    /// The emitter; `None` if it is none. It may have been despawned since.
    pub fn emitter(&self, source: Source) -> Option<Entity> {
        let index = usize::from(source.0).checked_sub(1)?;
        self.emitters.get(index).copied()
    }

    /// All emitters; the first is that of `Source(1)`.
    pub fn emitters(&self) -> &[Entity] {
        &self.emitters
    }

    /// The number of an emitter that may be `known` by one already.
    pub(super) fn number(&mut self, emitter: Entity, known: Source) -> Source {
        if self.emitter(known) == Some(emitter) {
            return known;
        }
        let index = self.emitters.iter().position(|&other| other == emitter).unwrap_or_else(|| {
            if self.emitters.len() < Self::MOST {
                self.emitters.push(emitter);
                self.emitters.len() - 1
            } else {
                Self::MOST
            }
        });
        if index < Self::MOST { Source(index as u16 + 1) } else { Source::UNKNOWN }
    }
}

/// Particles of one source that were born one after the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Run {
    /// Number of the first.
    first: u32,
    source: Source,
    /// Tick in which it began.
    tick: u32,
}

/// The most particles of a run: one that never ended could not be forgotten, and numbers start again some time.
const LONGEST_RUN: u32 = 1 << 24;

/// Whose the particles in flight are, by their numbers. Empty while nobody asks.
#[derive(Debug, Default)]
pub(super) struct Births {
    is_asked: bool,
    /// Of what is born from now on.
    current: Source,
    tick: u32,
    /// The longest life so far, ticks.
    longest: u16,
    runs: VecDeque<Run>,
}

impl Births {
    /// A tick begins: runs of which none can be in flight any more are forgotten.
    pub(super) fn begin_tick(&mut self, is_asked: bool, tick: u32) {
        if !is_asked {
            if self.is_asked {
                *self = Self::default();
            }
            return;
        }
        (self.is_asked, self.tick) = (true, tick);
        // One was over when the next began. What waits is born a tick later than it is noted.
        let oldest = u32::from(self.longest) + 2;
        while self.runs.get(1).is_some_and(|next| tick.saturating_sub(next.tick) > oldest) {
            self.runs.pop_front();
        }
    }

    /// Whose everything is that is noted from now on.
    pub(super) fn attribute_to(&mut self, source: Source) {
        self.current = source;
    }

    /// The particle of this number lives for at most so many ticks.
    pub(super) fn note(&mut self, sequence: u32, ticks_left: u16) {
        if !self.is_asked {
            return;
        }
        self.longest = self.longest.max(ticks_left);
        let goes_on = self
            .runs
            .back()
            .is_some_and(|run| run.source == self.current && sequence.wrapping_sub(run.first) < LONGEST_RUN);
        if !goes_on {
            self.runs.push_back(Run { first: sequence, source: self.current, tick: self.tick });
        }
    }

    /// Whose a particle is. `next`: the number that none has yet.
    pub(super) fn source_of(&self, sequence: u32, next: u32) -> Source {
        let Some(begin) = self.runs.front().map(|run| run.first) else { return Source::UNKNOWN };
        // Numbers start again at 0; what is older than the first run is far off then.
        let since = sequence.wrapping_sub(begin);
        if since >= next.wrapping_sub(begin) {
            return Source::UNKNOWN;
        }
        let behind = self.runs.partition_point(|run| run.first.wrapping_sub(begin) <= since);
        behind.checked_sub(1).and_then(|index| self.runs.get(index)).map_or(Source::UNKNOWN, |run| run.source)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three emitters send one, two and three particles a tick, from a number on; how it looks after so many ticks.
    fn after(ticks: u32, first: u32, ticks_left: u16) -> (Births, u32) {
        let (mut births, mut next) = (Births::default(), first);
        for tick in 1..=ticks {
            births.begin_tick(true, tick);
            for emitter in 1..=3 {
                births.attribute_to(Source(emitter));
                for _ in 0..emitter {
                    births.note(next, ticks_left);
                    next = next.wrapping_add(1);
                }
            }
        }
        (births, next)
    }

    #[test]
    fn particles_are_known_by_their_numbers_also_where_these_start_again() {
        for first in [0, 7, u32::MAX - 30] {
            let (births, next) = after(10, first, 1000);
            for number in 0..60 {
                let expected = [1, 2, 2, 3, 3, 3][number as usize % 6];
                assert_eq!(births.source_of(first.wrapping_add(number), next), Source(expected), "{number}");
            }
            // One that was born before, and one that is not born yet.
            assert_eq!(births.source_of(first.wrapping_sub(1), next), Source::UNKNOWN);
            assert_eq!(births.source_of(next, next), Source::UNKNOWN);
        }
    }

    #[test]
    fn what_cannot_fly_any_more_is_forgotten_and_a_lone_emitter_is_one_run() {
        let (births, next) = after(1000, 0, 20);
        assert!(births.runs.len() <= 3 * 24, "{}", births.runs.len());
        // All of the last twenty ticks.
        assert!((next - 20 * 6..next).all(|number| births.source_of(number, next) != Source::UNKNOWN));

        let mut births = Births::default();
        for tick in 1..=1000 {
            births.begin_tick(true, tick);
            births.attribute_to(Source(4));
            births.note(tick, 20);
        }
        assert_eq!(births.runs.len(), 1);
        // Nobody asks any more.
        births.begin_tick(false, 1001);
        assert!(births.runs.is_empty() && births.source_of(999, 1001) == Source::UNKNOWN);
        births.note(1001, 20);
        assert!(births.runs.is_empty());
    }

    #[test]
    fn an_emitter_keeps_its_number() {
        let [one, other] = [1, 2].map(|index| Entity::from_raw_u32(index).unwrap());
        let mut track = TrackSources::default();
        let first = track.number(one, Source::UNKNOWN);
        assert_eq!((first, track.number(other, Source::UNKNOWN)), (Source(1), Source(2)));
        // Also one that has forgotten it, or has one of another world.
        assert_eq!(track.number(one, Source::UNKNOWN), first);
        assert_eq!(track.number(one, Source(2)), first);
        assert_eq!(track.emitter(first), Some(one));
        assert_eq!((track.emitter(Source::UNKNOWN), track.emitter(Source::BY_HAND)), (None, None));
        assert_eq!(track.emitters(), [one, other]);
    }
}
