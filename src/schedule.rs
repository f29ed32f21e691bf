//! The order in which a tick happens: the only place where sets are configured.
//!
//! A tick runs in [`FixedUpdate`], so a frame may hold none, one or several. Each set belongs to the plugin
//! that fills it; systems of yours order themselves against the sets:
//!
//! ```
//! # use bevy::prelude::*;
//! # use bevy_weathering::prelude::*;
//! # fn count_impacts() {}
//! # let mut app = App::new();
//! app.add_systems(FixedUpdate, count_impacts.in_set(WeatheringSystems::Last));
//! ```

use bevy::prelude::*;

/// The stages of one weathering tick, in the order they run.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum WeatheringSystems {
    /// Empty, for systems that want to run before the tick.
    First,
    /// Emitters spawn particles.
    Emit,
    /// Forces change the velocity of particles, and particles move.
    Integrate,
    /// The segment each particle moved is cast against the surfaces; the dead are retired.
    Trace,
    /// Impacts become splats on the surfaces they hit.
    Deposit,
    /// Empty, for systems that want to see the finished tick.
    Last,
}

/// Configures [`WeatheringSystems`] and advances the clock they share.
pub struct WeatheringSchedulePlugin;

impl Plugin for WeatheringSchedulePlugin {
    fn build(&self, app: &mut App) {
        use WeatheringSystems::*;
        app.configure_sets(FixedUpdate, (First, Emit, Integrate, Trace, Deposit, Last).chain());
    }
}
