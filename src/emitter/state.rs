//! What an emitter remembers from tick to tick.

use bevy::prelude::*;
use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};

use super::Source;
use crate::effect::WeatherEffect;

/// What an [`Emitter`](super::Emitter) has sent out and still owes.
#[derive(Component, Serialize, Deserialize, Debug, Clone, Default, PartialEq)]
pub struct EmitterState {
    /// Particles owed, times the tick rate: stays exact in `f64` for any `f32` rate.
    pub(super) owed: f64,
    /// Water owed below a whole nanolitre.
    owed_nl: f64,
    /// Of a flow: water, nanolitres, of particles that were not sent and that no other could take along yet.
    #[serde(default)]
    held_nl: f64,
    pub(super) rng: Option<Pcg32>,
    /// Its number, where sources are tracked.
    #[serde(skip)]
    pub(super) source: Source,
    /// Particles sent out so far.
    pub emitted: u64,
}

impl EmitterState {
    /// Whether it owes less than a particle, and less than a nanolitre, at this tick rate, and holds water that there can be: as
    /// after every tick.
    pub(crate) fn is_sound(&self, hz: u32) -> bool {
        // What is left may be rounded to just below 0. Written so that NaN fails.
        (-1.0..=f64::from(hz)).contains(&self.owed)
            && (0.0..=1.0).contains(&self.owed_nl)
            && (0.0..f64::INFINITY).contains(&self.held_nl)
    }

    /// Adds one tick's worth of `rate` and takes out the whole particles. Also returns when within the tick the
    /// first is born, and the time between two, both in ticks.
    pub(super) fn due(&mut self, rate: f32, hz: u32) -> (u32, f64, f64) {
        let (rate, hz) = (f64::from(rate), f64::from(hz));
        let before = self.owed;
        self.owed += rate;
        let count = (self.owed / hz).floor();
        // Exact: both are multiples of the last bit of `rate`, far above that of an f64.
        self.owed -= count * hz;
        (count as u32, (hz - before) / rate, hz / rate)
    }

    /// What each of `count` particles of a flow stands for, nanolitres, if `due` of `each_nl` were to be sent: all their water,
    /// and what was held before. At most what a particle may carry; the rest is held.
    pub(super) fn share_nl(&mut self, due: u32, count: u32, each_nl: f64) -> f64 {
        if count == due && self.held_nl == 0.0 {
            return each_nl;
        }
        self.held_nl += f64::from(due) * each_nl;
        if count == 0 {
            return 0.0;
        }
        let most = f64::from(WeatherEffect::MAX_VOLUME_MM3) * 1000.0;
        let share = self.held_nl / f64::from(count);
        if share <= most {
            self.held_nl = 0.0;
            return share;
        }
        self.held_nl -= most * f64::from(count);
        most
    }

    /// Of a flow: water of particles that limits kept from being sent and that no other has taken along yet, mm³.
    pub fn held_mm3(&self) -> f64 {
        self.held_nl / 1000.0
    }

    /// Whole nanolitres of the next particle; what is cut off goes to the one after.
    pub(super) fn water_nl(&mut self, water_nl: f64) -> u32 {
        self.owed_nl += water_nl;
        let whole = self.owed_nl.floor();
        self.owed_nl -= whole;
        whole as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_emitter_owes_or_holds_is_not_sound() {
        assert!(EmitterState::default().is_sound(60));
        assert!(EmitterState { owed: 59.0, owed_nl: 0.5, held_nl: 1.0e12, ..default() }.is_sound(60));
        for bad in [-2.0, f64::NAN, f64::INFINITY] {
            assert!(!EmitterState { owed: bad, ..default() }.is_sound(60), "{bad}");
            assert!(!EmitterState { owed_nl: bad, ..default() }.is_sound(60), "{bad}");
            assert!(!EmitterState { held_nl: bad, ..default() }.is_sound(60), "{bad}");
        }
    }
}
