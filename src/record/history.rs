//! Moments of a session that can be gone back to: saved scenes, kept in memory.
//!
//! They take no more than [`History::MOST_BYTES`] and are no more than [`History::MOST`]; where there are too many, those go
//! whose neighbours are closest, so that what is left is spread over the whole session. The start needs none.

use crate::save::SavedScene;

/// A kept moment.
struct Moment {
    tick: u32,
    bytes: usize,
    scene: SavedScene,
}

/// Kept moments, in order of time.
#[derive(Default)]
pub(super) struct History {
    moments: Vec<Moment>,
}

impl History {
    /// The most bytes of all together; the last one is kept whatever it takes.
    pub(super) const MOST_BYTES: usize = 1 << 30;
    /// The most moments.
    pub(super) const MOST: usize = 200;

    /// The last one at or before a tick.
    pub(super) fn before(&self, tick: u32) -> Option<&SavedScene> {
        let count = self.moments.partition_point(|moment| moment.tick <= tick);
        count.checked_sub(1).and_then(|last| self.moments.get(last)).map(|moment| &moment.scene)
    }

    /// Keeps a moment, in place of one of the same tick.
    pub(super) fn keep(&mut self, scene: SavedScene) {
        let (tick, bytes) = (scene.tick(), scene.bytes());
        let moment = Moment { tick, bytes, scene };
        match self.moments.binary_search_by_key(&tick, |moment| moment.tick) {
            Ok(at) => self.moments[at] = moment,
            Err(at) => self.moments.insert(at, moment),
        }
        let bytes = |moments: &[Moment]| moments.iter().map(|moment| moment.bytes).sum::<usize>();
        while self.moments.len() > 1
            && (self.moments.len() > Self::MOST || bytes(&self.moments) > Self::MOST_BYTES)
        {
            let ticks: Vec<u32> = self.moments.iter().map(|moment| moment.tick).collect();
            self.moments.remove(least_missed(&ticks));
        }
    }

    /// Forgets what comes after a tick.
    pub(super) fn forget_after(&mut self, tick: u32) {
        self.moments.retain(|moment| moment.tick <= tick);
    }

    /// Of a session that has so many emitters now.
    pub(super) fn resize_emitters(&mut self, count: usize) {
        self.moments.iter_mut().for_each(|moment| moment.scene.resize_emitters(count));
    }

    /// How many there are, and their bytes.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.moments.len(), self.moments.iter().map(|moment| moment.bytes).sum())
    }
}

/// The one of at least two ticks, but for the last, without which the gap is smallest.
fn least_missed(ticks: &[u32]) -> usize {
    let gap = |index: &usize| {
        let before = index.checked_sub(1).and_then(|before| ticks.get(before)).copied().unwrap_or(0);
        ticks.get(index + 1).map_or(u32::MAX, |after| after - before)
    };
    (0..ticks.len().saturating_sub(1)).min_by_key(gap).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_thinned_out_stays_spread_and_the_last_stays() {
        assert_eq!(least_missed(&[10, 20, 30, 40]), 0);
        assert_eq!(least_missed(&[20, 30, 35, 60]), 1);
        assert_eq!(least_missed(&[10, 11]), 0);
        let mut ticks: Vec<u32> = Vec::new();
        for tick in 1..=1000 {
            ticks.push(tick);
            if ticks.len() > 20 {
                ticks.remove(least_missed(&ticks));
            }
        }
        assert_eq!(ticks.last(), Some(&1000));
        let widest = ticks.windows(2).map(|pair| pair[1] - pair[0]).max();
        assert!(widest.is_some_and(|widest| widest <= 300), "{ticks:?}");
    }
}
