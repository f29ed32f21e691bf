//! One time for everything that gets wet and dries.
//!
//! [`WeatheringClock`] counts ticks. Seconds are derived from the count, never summed, so that a run of an hour
//! is as exact as its first second and a replay lands on the same bits whatever its frame rate was.

use bevy::prelude::*;

use crate::schedule::{WeatheringSystems, WeatheringTick, run_tick};

/// Counts fixed ticks and tells their length. Advanced once per tick, before [`WeatheringSystems::First`].
///
/// The rate is a whole number of ticks per second, so that everything derived from it can be exact.
///
/// [`WeatheringSystems::First`]: crate::schedule::WeatheringSystems::First
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct WeatheringClock {
    tick: u32,
    hz: u32,
}

impl Default for WeatheringClock {
    fn default() -> Self {
        Self::new(Self::DEFAULT_HZ)
    }
}

impl WeatheringClock {
    /// Ticks per second unless told otherwise.
    pub const DEFAULT_HZ: u32 = 60;
    /// The highest tick rate that makes sense: a millisecond a tick.
    pub const MAX_HZ: u32 = 1000;

    /// A clock at tick 0; `hz` is clamped to 1..=[`Self::MAX_HZ`].
    pub fn new(hz: u32) -> Self {
        Self { tick: 0, hz: hz.clamp(1, Self::MAX_HZ) }
    }

    /// Ticks since the start; the first tick that runs sees 1.
    pub fn tick(&self) -> u32 {
        self.tick
    }

    /// Ticks per second.
    pub fn hz(&self) -> u32 {
        self.hz
    }

    /// Length of a tick in seconds.
    pub fn delta_secs(&self) -> f32 {
        1.0 / self.hz as f32
    }

    /// Weather time in seconds since the start.
    pub fn seconds(&self) -> f64 {
        f64::from(self.tick) / f64::from(self.hz)
    }

    /// Back to tick 0.
    pub fn reset(&mut self) {
        self.tick = 0;
    }

    /// To a tick that was reached in another run.
    pub(crate) fn go_to(&mut self, tick: u32) {
        self.tick = tick;
    }

    /// One tick on.
    pub fn advance(&mut self) {
        self.tick += 1;
    }
}

/// The time that is drawn. What surfaces hold is a closed form of time, so they can be shown as they were and as they will
/// be if nothing happens, back and forth, while the simulation stands still or goes on; it is not touched by that.
///
/// Before the last event of a texel, it is shown dry: maps remember the last event, not all of them.
#[derive(Resource, Reflect, Debug, Default, Clone, Copy, PartialEq)]
#[reflect(Resource, Default)]
pub enum ShownTime {
    /// The present.
    #[default]
    Now,
    /// So many seconds after the start, 0 or more.
    At(f64),
}

impl ShownTime {
    /// The tick that is drawn.
    pub fn tick(self, clock: &WeatheringClock) -> u32 {
        match self {
            Self::Now => clock.tick(),
            // Saturates, and takes NaN for 0.
            Self::At(seconds) => (seconds * f64::from(clock.hz())).round() as u32,
        }
    }
}

/// Adds [`WeatheringClock`] and runs `FixedUpdate`, and so the ticks and all else that is in there, at its rate: whatever rate
/// Bevy's `Time<Fixed>` had before. A game that needs another gives it to this plugin. Where the two differ later on, weather goes
/// faster or slower than the game, and a warning says so.
pub struct ClockPlugin {
    /// Ticks per second, 1..=[`WeatheringClock::MAX_HZ`].
    pub hz: u32,
}

impl Default for ClockPlugin {
    fn default() -> Self {
        Self { hz: WeatheringClock::DEFAULT_HZ }
    }
}

impl Plugin for ClockPlugin {
    fn build(&self, app: &mut App) {
        self.insert_clock(app.world_mut());
        app.register_type::<WeatheringClock>().register_type::<ShownTime>().init_resource::<ShownTime>();
        // Every stage of a tick sees its number.
        app.add_systems(WeatheringTick, advance_clock.before(WeatheringSystems::First));
        // By the rate of the tick that is about to run.
        app.add_systems(FixedUpdate, tell_other_rate.before(run_tick));
    }
}

impl ClockPlugin {
    /// Sets the clock of an app that has the plugin already.
    pub(crate) fn insert_clock(&self, world: &mut World) {
        let clock = WeatheringClock::new(self.hz);
        world.insert_resource(Time::<Fixed>::from_hz(f64::from(clock.hz())));
        world.insert_resource(clock);
    }
}

/// Ticks that take longer or shorter than they count would be weather at another speed.
fn tell_other_rate(clock: Res<WeatheringClock>, fixed: Option<Res<Time<Fixed>>>) {
    if let Some(fixed) = fixed
        && is_other_rate(&clock, &fixed)
    {
        warn_once!(
            "`FixedUpdate` runs every {:?}, but a tick of the weather counts as 1/{} s: set the rate by `ClockPlugin`, not by \
             `Time<Fixed>`",
            fixed.timestep(),
            clock.hz()
        );
    }
}

/// Whether `FixedUpdate` runs at another rate than ticks are counted by.
fn is_other_rate(clock: &WeatheringClock, fixed: &Time<Fixed>) -> bool {
    // A time step is whole nanoseconds.
    (fixed.timestep().as_secs_f64() * f64::from(clock.hz()) - 1.0).abs() > 1e-3
}

/// One tick on. Runs before every stage of the tick.
pub fn advance_clock(mut clock: ResMut<WeatheringClock>) {
    clock.advance();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_do_not_drift() {
        let mut clock = WeatheringClock::new(60);
        for _ in 0..216_000 {
            clock.advance();
        }
        assert_eq!(clock.seconds(), 3600.0);
    }

    #[test]
    fn the_rate_of_the_plugin_is_that_of_its_ticks_and_another_is_seen() {
        let mut world = World::new();
        for hz in [0, 1, 7, 60, 144, 1000, u32::MAX] {
            ClockPlugin { hz }.insert_clock(&mut world);
            let (clock, fixed) = (world.resource::<WeatheringClock>(), world.resource::<Time<Fixed>>());
            assert!(!is_other_rate(clock, fixed), "{hz}");
        }
        let clock = WeatheringClock::new(60);
        // Bevy's own, and those of games.
        for fixed in
            [Time::<Fixed>::default(), Time::<Fixed>::from_hz(30.0), Time::<Fixed>::from_seconds(0.1)]
        {
            assert!(is_other_rate(&clock, &fixed), "{:?}", fixed.timestep());
        }
    }

    #[test]
    fn rates_out_of_range_are_clamped() {
        assert_eq!(WeatheringClock::new(0).hz(), 1);
        assert_eq!(WeatheringClock::new(u32::MAX).hz(), WeatheringClock::MAX_HZ);
    }
}
