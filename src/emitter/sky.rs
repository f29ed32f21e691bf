//! What falls on a whole scene: so much on each square metre, whatever the number of particles.

use bevy::prelude::*;

use super::{Emitter, EmitterShape, Flow};
use crate::effect::WeatherEffect;

/// The fewest and the most particles a second that these emitters begin with.
const RATES: (f32, f32) = (500.0, 5000.0);

/// From the sky. All of them fall from a level rectangle in the plane of the emitter's position, whatever its rotation, as fast as
/// their drops do in still air. [`Emitter::rate`] is chosen so that a particle carries about what those of the shipped effect do,
/// from 500 to 5000 a second; it may be changed, and only says how fine the same amount falls. Under wind, put the rectangle to
/// windward, or make it larger.
impl Emitter {
    /// Rain of so many mm/h on the ground below a rectangle of this half size, metres, along world X and Z: 10 mm/h on 6 m by 6 m
    /// are 6 l/min. Light rain has 1 mm/h, a cloudburst 50. Its effect is [`WeatherEffect::RAIN`], below a millimetre an hour
    /// [`WeatherEffect::DRIZZLE`], or one of yours. A drop that hits nothing flies for 10 s, 20 m at least.
    pub fn rain(effect: Handle<WeatherEffect>, mm_per_hour: f32, half_size: Vec2) -> Self {
        Self { lifetime: 10.0, ..Self::falling(effect, mm_per_hour, half_size, 33.5) }
    }

    /// Snow, in mm of water an hour, each of which is about a centimetre of fresh snow; else as [`Self::rain`]. A heavy snowfall
    /// has 5 mm/h; more makes hours go by in minutes. It lies where [`Weather::temperature_c`] is not above 0. Its effect is
    /// [`WeatherEffect::SNOW`], or one of yours. A flake that hits nothing flies for 30 s, some 30 m.
    ///
    /// [`Weather::temperature_c`]: crate::weather::Weather::temperature_c
    pub fn snow(effect: Handle<WeatherEffect>, water_mm_per_hour: f32, half_size: Vec2) -> Self {
        Self { lifetime: 30.0, ..Self::falling(effect, water_mm_per_hour, half_size, 60.0) }
    }

    /// Dust, in mm of solid grains an hour, without the air between them; else as [`Self::rain`]. Of rock, of 2650 kg/m³, a
    /// millimetre weighs 2.65 kg/m². Its effect is [`WeatherEffect::DUST`], or one of yours. A grain that hits nothing flies for
    /// 60 s, some 10 m.
    pub fn dust(effect: Handle<WeatherEffect>, mm_per_hour: f32, half_size: Vec2) -> Self {
        Self { lifetime: 60.0, ..Self::falling(effect, mm_per_hour, half_size, 1.2) }
    }

    /// With particles of about `particle_mm3`.
    fn falling(effect: Handle<WeatherEffect>, mm_per_hour: f32, half_size: Vec2, particle_mm3: f32) -> Self {
        let (shape, flow) = (EmitterShape::Sky { half_size }, Flow::MmPerHour(mm_per_hour));
        let emitter = Self { effect, shape, flow, speed: 0.0, ..Self::default() };
        let wanted = emitter.mm3_per_second().unwrap_or(0.0) / particle_mm3;
        Self { rate: wanted.clamp(RATES.0, RATES.1), ..emitter }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_millimetre_an_hour_on_a_square_metre_is_a_litre_an_hour() {
        let effect = WeatherEffect::default();
        type Make = fn(Handle<WeatherEffect>, f32, Vec2) -> Emitter;
        let makers: [Make; 3] = [Emitter::rain, Emitter::snow, Emitter::dust];
        for make in makers {
            // From a drizzle on a table to a cloudburst over a field.
            for (mm_per_hour, half_size) in
                [(0.2, Vec2::splat(0.5)), (10.0, Vec2::new(3.0, 1.5)), (80.0, Vec2::splat(10.0))]
            {
                let emitter = make(Handle::default(), mm_per_hour, half_size);
                let litres_per_hour = mm_per_hour * (2.0 * half_size.x) * (2.0 * half_size.y);
                let sent_mm3 = emitter.particle_mm3(&effect) * emitter.rate;
                let expected_mm3 = litres_per_hour * 1.0e6 / 3600.0;
                assert!((sent_mm3 / expected_mm3 - 1.0).abs() < 1e-5, "{sent_mm3} for {expected_mm3}");
                assert!((RATES.0..=RATES.1).contains(&emitter.rate) && emitter.speed == 0.0);
                assert_eq!(emitter.shape, EmitterShape::Sky { half_size });
            }
        }
        // In between, a particle is one of the effect.
        let shower = Emitter::rain(Handle::default(), 10.0, Vec2::splat(3.0));
        assert!((shower.particle_mm3(&effect) - 33.5).abs() < 0.01, "{}", shower.rate);
    }
}
