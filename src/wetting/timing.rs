//! When what is measured in the background takes effect.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::tasks::{Task, block_on, futures::check_ready};

use crate::clock::WeatheringClock;

/// When meshes that are loaded or change are hit as they are, when surfaces that are new, turn, change their size or take another pose
/// run by what was measured of them, when their marks know where on them they lie, when they move over to maps of another size, and when
/// they dry by a sun that has moved. Until then it is the old shape, slopes, maps and shadows that count, and of what is new, none.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Resource, Default)]
pub enum MeasureTiming {
    /// As soon as it is ready: no frame waits for it, and no two runs need be alike.
    #[default]
    WhenReady,
    /// So many ticks after it was asked for, at the start of a frame, which waits for it if need be: the same in every run that has the
    /// same frames. What is asked for before the first tick counts from the next frame on. Replays have this.
    AfterTicks(u32),
}

impl MeasureTiming {
    /// What a task that was begun at tick `asked_at` has found, once, if it is to take effect at tick `now`.
    pub(super) fn take<T: Send + 'static>(
        self,
        task: &mut Option<Task<T>>,
        asked_at: u32,
        now: u32,
    ) -> Option<T> {
        let under_way = task.as_mut()?;
        let found = match self {
            Self::WhenReady => check_ready(under_way)?,
            // A clock that was set back has nothing to wait for.
            Self::AfterTicks(ticks) if asked_at > 0 && now.wrapping_sub(asked_at) < ticks => return None,
            Self::AfterTicks(_) => block_on(under_way),
        };
        *task = None;
        Some(found)
    }
}

/// [`MeasureTiming`] and the time, for systems that may run without either.
#[derive(SystemParam)]
pub(crate) struct MeasureTimer<'w> {
    timing: Option<Res<'w, MeasureTiming>>,
    clock: Option<Res<'w, WeatheringClock>>,
}

impl MeasureTimer<'_> {
    /// The present tick: that in which a task is begun.
    pub(crate) fn tick(&self) -> u32 {
        self.clock.as_deref().map_or(0, WeatheringClock::tick)
    }

    /// As [`MeasureTiming::take`].
    pub(crate) fn take<T: Send + 'static>(&self, task: &mut Option<Task<T>>, asked_at: u32) -> Option<T> {
        self.timing.as_deref().copied().unwrap_or_default().take(task, asked_at, self.tick())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::tasks::AsyncComputeTaskPool;
    use std::sync::mpsc::{Receiver, channel};
    use std::time::{Duration, Instant};

    fn slow(done: Receiver<()>) -> Option<Task<u32>> {
        let pool = AsyncComputeTaskPool::get_or_init(Default::default);
        Some(pool.spawn(async move {
            // Also when nobody says so any more.
            let _ = done.recv();
            7
        }))
    }

    #[test]
    fn at_a_fixed_tick_it_takes_effect_neither_earlier_nor_later() {
        let timing = MeasureTiming::AfterTicks(15);
        // Ready at once, but its time has not come.
        let (finish, done) = channel();
        let mut task = slow(done);
        finish.send(()).unwrap();
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_millis(50) {
            assert_eq!(timing.take(&mut task, 100, 114), None);
        }
        assert_eq!(timing.take(&mut task, 100, 115), Some(7));
        assert!(task.is_none() && timing.take(&mut task, 100, 116).is_none());
        // Not ready when its time has come: it is waited for.
        let (finish, done) = channel();
        let mut task = slow(done);
        let late = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(50));
            finish.send(()).unwrap();
        });
        assert_eq!(timing.take(&mut task, 100, 130), Some(7));
        late.join().unwrap();
        // The clock was set back.
        let (finish, done) = channel();
        let mut task = slow(done);
        drop(finish);
        assert_eq!(timing.take(&mut task, 100, 3), Some(7));
        // It was asked for before the first tick, which has come meanwhile, or not.
        for now in [0, 1] {
            let (finish, done) = channel();
            let mut task = slow(done);
            drop(finish);
            assert_eq!(timing.take(&mut task, 0, now), Some(7));
        }
    }

    #[test]
    fn otherwise_it_is_taken_when_it_is_ready_and_nobody_waits() {
        let (finish, done) = channel();
        let mut task = slow(done);
        assert_eq!(MeasureTiming::WhenReady.take(&mut task, 0, 1000), None);
        finish.send(()).unwrap();
        let begun = Instant::now();
        let mut found = None;
        while found.is_none() {
            found = MeasureTiming::WhenReady.take(&mut task, 0, 0);
            assert!(begun.elapsed() < Duration::from_secs(30), "never ready");
        }
        assert_eq!(found, Some(7));
    }
}
