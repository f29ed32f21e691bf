//! Splats of one surface that wait to be painted.

use crate::overlay::{Splat, SplatQueue};

/// A queue that can be read as a slice. What has been painted stays in front until it is as much as what waits, so that a splat
/// is moved once on average, however small the parts are in which it is taken.
#[derive(Debug, Default)]
pub(super) struct Backlog {
    splats: Vec<Splat>,
    /// So many of them are painted.
    painted: usize,
    /// So many of those that wait, the first ones, have been counted as carried.
    carried: usize,
}

impl Backlog {
    /// Splats whose memory is kept when nothing waits.
    const KEPT: usize = 1 << 18;

    /// Those that wait, in order.
    pub(super) fn waiting(&self) -> &[Splat] {
        &self.splats[self.painted..]
    }

    /// How many wait.
    pub(super) fn len(&self) -> usize {
        self.splats.len() - self.painted
    }

    /// Whether none waits.
    pub(super) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Moves those in a queue behind those that wait.
    pub(super) fn take_from(&mut self, queue: &mut SplatQueue) {
        queue.drain_into(&mut self.splats);
    }

    /// Brings those that wait to maps of another size. `from`, `to`: texels along each side.
    pub(super) fn resize(&mut self, from: u32, to: u32) {
        self.splats[self.painted..].iter_mut().for_each(|splat| *splat = splat.resized(from, to));
    }

    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.splats.clear();
        self.splats.shrink_to(Self::KEPT);
        (self.painted, self.carried) = (0, 0);
    }

    /// The first `count` are painted, the others have to wait for another frame. Returns how many of these did not have to
    /// before.
    pub(super) fn finish(&mut self, count: usize) -> usize {
        self.painted += count.min(self.len());
        let left = self.len();
        let carried = left - self.carried.saturating_sub(count).min(left);
        self.carried = left;
        if left == 0 {
            self.clear();
        } else if self.painted >= left {
            self.splats.drain(..self.painted);
            self.painted = 0;
        }
        carried
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn take(backlog: &mut Backlog, ticks: std::ops::Range<u32>) {
        let mut queue = SplatQueue::default();
        ticks.for_each(|tick| queue.push(Splat { tick, ..Splat::zeroed() }));
        backlog.take_from(&mut queue);
        assert!(queue.is_empty());
    }

    #[test]
    fn all_come_once_in_order_in_whatever_parts() {
        let mut backlog = Backlog::default();
        let (mut came, mut painted, mut carried) = (0, 0, 0);
        for round in 0..500u32 {
            let more = round * 7 % 23;
            take(&mut backlog, came..came + more);
            came += more;
            let part = (round as usize * 5 % 17).min(backlog.len());
            for splat in &backlog.waiting()[..part] {
                assert_eq!(splat.tick, painted);
                painted += 1;
            }
            carried += backlog.finish(part);
            assert_eq!(backlog.len(), (came - painted) as usize);
            assert!(backlog.splats.len() <= 2 * backlog.len() + 1, "{backlog:?}");
        }
        assert!(carried > 0 && carried <= came as usize);
    }

    #[test]
    fn each_is_counted_as_carried_once() {
        let mut backlog = Backlog::default();
        take(&mut backlog, 0..10);
        assert_eq!(backlog.finish(4), 6);
        assert_eq!(backlog.finish(0), 0);
        take(&mut backlog, 10..13);
        assert_eq!(backlog.finish(7), 2);
        assert_eq!(backlog.finish(2), 0);
        assert!(backlog.is_empty());
        take(&mut backlog, 13..15);
        assert_eq!(backlog.finish(1), 1);
    }
}
