//! How large rain drops are, how fast drops and grains fall, and what a drop leaves where it hits.
//!
//! Sources: Marshall and Palmer 1948 for the sizes, Atlas et al. 1973 for the speeds of drops, Schiller and Naumann 1935 for
//! those of grains, Clanet et al. 2004 for how far a drop spreads.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// How large the drops are that particles of an effect stand for.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
#[reflect(Default)]
pub enum DropSizes {
    /// All alike, mm across.
    Same(f32),
    /// Rain of this rate, mm/h, 0.1 to 300: particles of [`SIZE_CLASSES`] sizes, each of which brings as much water as the
    /// others.
    MarshallPalmer(f32),
}

impl Default for DropSizes {
    fn default() -> Self {
        Self::Same(2.0)
    }
}

/// Sizes of the drops of an effect.
pub const SIZE_CLASSES: usize = 16;

/// The largest drops that do not break up, mm.
const LARGEST_MM: f64 = 6.0;

impl DropSizes {
    /// Diameters of the drops of each class, mm. Of as much water each, by what falls on the ground.
    pub fn diameters_mm(self) -> [f32; SIZE_CLASSES] {
        let rate = match self {
            Self::Same(diameter) => return [diameter; SIZE_CLASSES],
            Self::MarshallPalmer(rate) => f64::from(rate.clamp(0.1, 300.0)),
        };
        let slope = 4.1 * rate.powf(-0.21);
        // Volume that falls on the ground, but for a constant, by diameter.
        let flux = |mm: f64| (-slope * mm).exp() * mm.powi(3) * fall_speed(mm).max(0.0);
        const STEPS: usize = 6000;
        let step = LARGEST_MM / STEPS as f64;
        let middle = |number: usize| (number as f64 + 0.5) * step;
        let total: f64 = (0..STEPS).map(|number| flux(middle(number))).sum();
        let (mut sum, mut class) = (0.0, 0);
        let mut diameters = [LARGEST_MM as f32; SIZE_CLASSES];
        for number in 0..STEPS {
            sum += flux(middle(number));
            // The drop in the middle of the class: half of its water comes in smaller ones.
            while class < SIZE_CLASSES && sum >= total * (class as f64 + 0.5) / SIZE_CLASSES as f64 {
                diameters[class] = middle(number) as f32;
                class += 1;
            }
        }
        diameters
    }
}

/// Fall speed of a drop in still air, m/s, from its diameter, mm: `9.65 - 10.3 exp(-0.6 D)`; never negative.
pub fn fall_speed(diameter_mm: f64) -> f64 {
    (9.65 - 10.3 * (-0.6 * diameter_mm).exp()).max(0.0)
}

/// Fall speed of a grain of rock in still air, m/s, from its diameter, mm: where its weight is the drag of a ball,
/// `24/Re (1 + 0.15 Re^0.687)`. Dust, silt and fine sand: up to 0.5 mm; what is coarser falls slower than this says.
pub fn settling_speed(grain_mm: f64) -> f64 {
    /// Of rock and of air at 20 °C, kg/m³.
    const DENSITIES: [f64; 2] = [2650.0, 1.2];
    /// Viscosity of air, m²/s.
    const NU: f64 = 1.5e-5;
    let metres = grain_mm.max(0.0) * 1e-3;
    // Stokes' law: that of grains so fine that the air around them does not whirl. The others fall slower.
    let stokes = (DENSITIES[0] / DENSITIES[1] - 1.0) * 9.81 * metres.powi(2) / (18.0 * NU);
    let (mut low, mut high) = (0.0, stokes);
    // Halved until no f32 could tell both ends apart.
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        let reynolds = middle * metres / NU;
        if middle * (1.0 + 0.15 * reynolds.powf(0.687)) < stokes { low = middle } else { high = middle }
    }
    high
}

/// Water in a drop, mm³.
pub fn drop_mm3(diameter_mm: f32) -> f32 {
    std::f32::consts::FRAC_PI_6 * diameter_mm.powi(3)
}

/// Diameter to which a drop spreads on a wall, mm: `D We^(1/4)`, at least its own. Speed in m/s, along the wall's normal.
pub fn spread_mm(diameter_mm: f32, speed: f32) -> f32 {
    /// Density over surface tension of water, s²/m³.
    const RHO_OVER_SIGMA: f32 = 998.0 / 0.0728;
    let weber = RHO_OVER_SIGMA * speed * speed * diameter_mm * 1e-3;
    diameter_mm * weber.max(1.0).sqrt().sqrt()
}

/// Whether a drop splashes: `We^(1/2) Re^(1/4) > 57.7` (Mundo et al. 1995). Speed in m/s, along the wall's normal.
pub fn splashes(diameter_mm: f32, speed: f32) -> bool {
    let (metres, viscosity) = (diameter_mm * 1e-3, 1.0e-6);
    let weber = 998.0 / 0.0728 * speed * speed * metres;
    let reynolds = speed * metres / viscosity;
    weber.sqrt() * reynolds.powf(0.25) > 57.7
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drops_fall_as_atlas_measured() {
        for (mm, speed) in [(1.0, 4.00), (2.0, 6.55), (3.0, 7.95), (5.0, 9.14)] {
            assert!((fall_speed(mm) - speed).abs() < 0.006, "{mm}: {}", fall_speed(mm));
        }
        assert_eq!(fall_speed(0.05), 0.0);
    }

    #[test]
    fn grains_settle_as_fast_as_they_are_coarse() {
        for (um, speed) in [(20.0, 0.031), (50.0, 0.18), (100.0, 0.58), (200.0, 1.5)] {
            let settles = settling_speed(um * 1e-3);
            assert!((settles / speed - 1.0).abs() < 0.04, "{um}: {settles}");
        }
        assert_eq!(settling_speed(0.0), 0.0);
        assert!(settling_speed(100.0).is_finite());
    }

    #[test]
    fn a_drop_of_two_millimetres_spreads_to_five_times_its_size() {
        let spread = spread_mm(2.0, fall_speed(2.0) as f32);
        assert!((spread / 2.0 - 5.9).abs() < 0.2, "{spread}");
        assert_eq!(spread_mm(2.0, 0.0), 2.0);
        assert!(splashes(3.0, 7.95) && !splashes(0.3, 1.2));
    }

    #[test]
    fn heavier_rain_has_larger_drops_and_classes_are_in_order() {
        let light = DropSizes::MarshallPalmer(1.0).diameters_mm();
        let heavy = DropSizes::MarshallPalmer(50.0).diameters_mm();
        assert!(light.is_sorted() && heavy.is_sorted());
        assert!(light.iter().zip(heavy).all(|(light, heavy)| *light < heavy));
        // Half the water of 10 mm/h comes in drops below 1.8 to 2 mm.
        let median = DropSizes::MarshallPalmer(10.0).diameters_mm()[7..9].iter().sum::<f32>() / 2.0;
        assert!((1.7..2.1).contains(&median), "{median}");
        assert_eq!(DropSizes::Same(2.5).diameters_mm(), [2.5; SIZE_CLASSES]);
    }
}
