//! What evaporates.

use serde::{Deserialize, Serialize};

/// An amount of water that could evaporate, mm, or a rate of it, mm/h.
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Default)]
pub struct Demand {
    /// By the air, from a free surface; mm or mm/h.
    pub air_mm: f64,
    /// By the sun, from a surface that faces it; mm or mm/h.
    pub sun_mm: f64,
}

impl Demand {
    /// Both, in proportion to what a place is exposed to: parts of the air and of the sun of a free surface, each 0..=1.
    pub fn at(self, air: f64, sun: f64) -> f64 {
        self.air_mm * air + self.sun_mm * sun
    }
}

impl std::ops::Sub for Demand {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { air_mm: self.air_mm - other.air_mm, sun_mm: self.sun_mm - other.sun_mm }
    }
}

/// Water vapour in saturated air at sea level, kg per kg of dry air: 0.622 p / (101,325 Pa - p), with Magnus' formula for
/// the saturation pressure p (Sonntag 1990). `temperature_c` is clamped to -40..=60.
pub fn humidity_ratio(temperature_c: f64) -> f64 {
    let t = temperature_c.clamp(-40.0, 60.0);
    let pressure = 611.2 * (17.62 * t / (243.12 + t)).exp();
    0.622 * pressure / (101_325.0 - pressure)
}

/// Water that evaporates from a free wet surface, mm/h (kg/m² h): `(25 + 19 v)(x_s - x)`, the engineering formula for open
/// water. `humidity` 0..=1, `wind` m/s. Frozen water stays.
pub fn evaporation_mm_per_h(temperature_c: f64, humidity: f64, wind: f64) -> f64 {
    if temperature_c.is_nan() || temperature_c <= 0.0 {
        return 0.0;
    }
    let dryness = 1.0 - humidity.clamp(0.0, 1.0);
    (25.0 + 19.0 * wind.clamp(0.0, 100.0)) * humidity_ratio(temperature_c) * dryness
}

/// Part of the sun's power that ends up in evaporating water; the rest warms wall and air.
const LATENT_SHARE: f64 = 0.5;

/// Water that the sun evaporates, mm/h, from a surface that it shines on squarely with this power, W/m²: half of it over
/// the heat of vaporization, 2.45 MJ/kg.
pub fn sun_mm_per_h(w_per_m2: f64) -> f64 {
    LATENT_SHARE * w_per_m2.clamp(0.0, 1400.0) / 2.45e6 * 3600.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mild_day_takes_a_third_of_a_millimetre_an_hour() {
        assert!((humidity_ratio(20.0) - 0.01466).abs() < 2e-5, "{}", humidity_ratio(20.0));
        let rate = evaporation_mm_per_h(20.0, 0.5, 1.0);
        assert!((rate - 0.33).abs() < 0.01, "{rate}");
    }

    #[test]
    fn warm_dry_and_windy_is_faster_and_frost_and_fog_stop_it() {
        let rate = evaporation_mm_per_h;
        assert!(rate(30.0, 0.5, 1.0) > rate(20.0, 0.5, 1.0));
        assert!(rate(20.0, 0.3, 1.0) > rate(20.0, 0.5, 1.0));
        assert!(rate(20.0, 0.5, 5.0) > rate(20.0, 0.5, 1.0));
        assert_eq!([rate(-3.0, 0.1, 9.0), rate(20.0, 1.0, 9.0), rate(f64::NAN, 0.1, 9.0)], [0.0; 3]);
        assert!((sun_mm_per_h(1000.0) - 0.735).abs() < 0.001);
    }
}
