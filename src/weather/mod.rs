//! The weather: one resource that says how warm, dry, windy and sunny it is, and what that dries.
//!
//! Drying runs on a clock of its own. The [`Weather`] gives an evaporative [`Demand`] in mm of water an hour; its integral
//! over time, the [`DryingClock`], is one number for everything there is. A texel remembers the tick at which its amounts
//! were true and asks how much the clock has gone on since: weather that changes touches no texel.
//!
//! The air asks everywhere for the same, less in hollows; the sun only where it shines. So the clock has two hands, and
//! each texel its [exposure](crate::wetting::Exposure) to both.
//!
//! Not here: clouds, temperature of the surface, condensation.

mod demand;
mod drying_clock;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::schedule::{WeatheringSystems, WeatheringTick};

pub use demand::{Demand, evaporation_mm_per_h, humidity_ratio, sun_mm_per_h};
pub use drying_clock::{DryingClock, DryingPoint, advance_drying_clock};

/// How the weather is, everywhere. May be changed at any time; what has dried until then stays dry.
#[derive(Resource, Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource, Default)]
pub struct Weather {
    /// °C, -40..=60. At 0 and below nothing evaporates here.
    pub temperature_c: f32,
    /// Relative humidity, 0..=1.
    pub humidity: f32,
    /// Moves particles and carries vapour away, m/s.
    pub wind: Vec3,
    /// Where the sun shines to, in world space. Need not be of length 1; zero is no sun.
    pub sun_direction: Vec3,
    /// Power of the sun on a surface that faces it, W/m², 0..=1400.
    pub sun_w_per_m2: f32,
    /// How many times faster things dry and melt than in the world, where it takes hours, 0..=1,000,000; 0 stops it.
    pub drying_speed: f32,
}

impl Default for Weather {
    /// A mild day without sun or wind.
    fn default() -> Self {
        Self {
            temperature_c: 20.0,
            humidity: 0.5,
            wind: Vec3::ZERO,
            sun_direction: Vec3::new(-0.5, -1.0, -0.4),
            sun_w_per_m2: 0.0,
            drying_speed: 1.0,
        }
    }
}

impl Weather {
    /// What it takes from a free, wet surface, mm/h; from the air and, where it shines squarely, the sun.
    pub fn demand_mm_per_h(&self) -> Demand {
        let speed = f64::from(self.drying_speed.clamp(0.0, 1.0e6));
        let (temperature, humidity) = (f64::from(self.temperature_c), f64::from(self.humidity));
        let wind = f64::from(self.wind.length());
        Demand {
            air_mm: evaporation_mm_per_h(temperature, humidity, wind) * speed,
            sun_mm: sun_mm_per_h(f64::from(self.sun_w_per_m2)) * speed,
        }
    }

    /// The direction to the sun, of length 1; `None` if there is none.
    pub fn towards_sun(&self) -> Option<Vec3> {
        if self.sun_w_per_m2 > 0.0 { (-self.sun_direction).try_normalize() } else { None }
    }
}

/// Adds [`Weather`] and the [`DryingClock`].
pub struct WeatherPlugin;

impl Plugin for WeatherPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<Weather>().init_resource::<Weather>().init_resource::<DryingClock>().add_systems(
            WeatheringTick,
            advance_drying_clock
                // The clock counts before any stage, and what users change in `First` holds from the next tick on.
                .after(crate::clock::advance_clock)
                .before(WeatheringSystems::First),
        );
    }
}
