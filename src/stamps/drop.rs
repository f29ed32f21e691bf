//! Water that dried where it fell: one drop, or several.
//!
//! A spot has a raised rim, where the water carried what was in it (Deegan et al. 1997, *Capillary flow as the cause
//! of ring stains from dried liquid drops*), thin and blotchy inside, with a fainter line where the edge rested a
//! while on its way in. Its outline shows the fingers of the splash: `N = sqrt(We sqrt(Re) / 48)` of them (Aziz and
//! Chandra 2000, *Impact, recoil and splashing of molten metal droplets*).

use bevy::math::Vec2;

use super::field::{Matter, Shape};
use super::shapes::{Blob, Dice, Noise, bump, dome, edge, nearest, smooth_min};

/// Reflectance of water: F0 is 0.02.
pub(super) const WATER_REFLECTANCE: f32 = 0.354;

/// More fingers than these cannot be told apart.
const MAX_FINGERS: f32 = 24.0;

/// Spots of drops.
pub(super) struct Spots {
    spots: Vec<Spot>,
    stain: Noise,
    soft: f32,
}

struct Spot {
    middle: Vec2,
    radius: f32,
    /// Half as wide as the rim.
    rim: f32,
    outline: Noise,
    fingers: Vec<Blob>,
    satellites: Vec<Blob>,
}

impl Spots {
    /// One drop of 0.7 to 1.3 mm at the speed of its fall.
    pub(super) fn one(dice: &mut Dice, soft: f32) -> Self {
        let diameter_mm = dice.between(0.7, 1.3);
        // Within 0.1 m/s of Atlas et al. 1973 between these diameters.
        let speed = 2.88 + (diameter_mm - 0.7) * 3.42;
        let fingers = finger_count(diameter_mm * 0.001, speed).clamp(5.0, MAX_FINGERS).round() as u32;
        let middle = dice.in_disc() * 0.03;
        let satellites = dice.count(2, 4);
        let spot = Spot::new(dice, middle, 0.70, fingers, satellites);
        Self { spots: vec![spot], stain: dice.noise(3), soft }
    }

    /// 5 to 12 drops, mostly small, that hardly touch.
    pub(super) fn several(dice: &mut Dice, soft: f32) -> Self {
        let count = dice.count(5, 12) as usize;
        let mut spots: Vec<Spot> = Vec::with_capacity(count);
        // So many tries are enough: the spots of twelve cover a third of the stamp.
        for _ in 0..400 {
            if spots.len() == count {
                break;
            }
            let large = dice.unit();
            let radius = if spots.is_empty() { 0.28 + 0.08 * large } else { 0.08 + 0.20 * large * large };
            let middle = dice.in_disc() * (0.92 - radius);
            let apart = |spot: &Spot| middle.distance(spot.middle) > (radius + spot.radius) * 0.97;
            if spots.iter().all(apart) {
                let fingers = if radius > 0.19 { dice.count(7, 11) } else { 0 };
                spots.push(Spot::new(dice, middle, radius, fingers, 0));
            }
        }
        Self { spots, stain: dice.noise(3), soft }
    }
}

/// Fingers of a water drop that hits a wall.
fn finger_count(diameter: f32, speed: f32) -> f32 {
    let weber = 1000.0 * speed * speed * diameter / 0.0728;
    let reynolds = speed * diameter / 1.0e-6;
    (weber * reynolds.sqrt() / 48.0).sqrt()
}

impl Spot {
    fn new(dice: &mut Dice, middle: Vec2, radius: f32, fingers: u32, satellites: u32) -> Self {
        let outline = dice.noise(2);
        let directions = dice.all_round(fingers, 0.45);
        let fingers = directions.into_iter().map(|direction| {
            let size = radius * 1.8 / fingers.max(6) as f32 * dice.between(0.45, 1.25);
            let long = dice.unit();
            Blob::disc(middle + direction * (radius * (1.01 + 0.12 * long * long) - size), size)
        });
        let fingers = fingers.collect();
        let satellites = (0..satellites).map(|_| {
            let away = dice.direction() * radius * dice.between(1.18, 1.25);
            Blob::disc(middle + away, radius * dice.between(0.04, 0.085))
        });
        let satellites = satellites.collect();
        Self { middle, radius, rim: (radius * 0.14).max(0.03), outline, fingers, satellites }
    }

    fn distance(&self, point: Vec2) -> f32 {
        let away = point - self.middle;
        let round = away.length() - self.radius * (0.97 + 0.11 * self.outline.round(away, 0.8));
        let joined =
            |distance, finger: &Blob| smooth_min(distance, finger.distance(point), self.radius * 0.14);
        self.fingers.iter().fold(round, joined)
    }
}

impl Shape for Spots {
    fn at(&self, point: Vec2) -> Matter {
        let stain = self.stain.at(point * 4.0);
        let mut matter = Matter { reflectance: WATER_REFLECTANCE, smoothness: 0.80, ..Matter::NOTHING };
        for spot in &self.spots {
            let depth = -spot.distance(point);
            let stray = -nearest(&spot.satellites, point);
            let ridge = bump((depth - spot.rim) / spot.rim);
            let inside = dome(depth, 2.0 * spot.rim);
            if depth > 0.0 {
                let floor = 0.03 * spot.radius * inside * (1.0 + 0.5 * stain);
                matter.height = matter.height.max(0.42 * spot.rim * ridge + floor);
            }
            matter.height = matter.height.max(0.025 * dome(stray, 0.05));

            let ring = bump((depth - 0.6 * spot.rim) / (1.05 * spot.rim));
            let rested = bump((depth - spot.rim * (2.9 + 1.6 * stain)) / (0.65 * spot.rim));
            let middle = (0.44 + 0.22 * stain + 0.12 * rested).max(0.0);
            let here = edge(-depth, self.soft);
            let cover = middle.max(ring * (0.88 + 0.2 * stain)).min(1.0) * here;
            matter.cover = matter.cover.max(cover).max(0.85 * edge(-stray, self.soft));
            matter.smoothness = matter.smoothness.max(0.80 + 0.12 * ring * here);
        }
        matter
    }
}

#[cfg(test)]
mod tests {
    use super::super::shapes::direction;
    use super::*;

    #[test]
    fn fingers_are_more_the_harder_it_hits() {
        // We 220, Re 4000.
        let count = finger_count(0.001, 4.0);
        assert!((count - 17.0).abs() < 0.3, "{count}");
        assert!(finger_count(0.0013, 4.93) > count && finger_count(0.0007, 2.88) < count);
    }

    #[test]
    fn a_spot_is_highest_and_densest_along_its_rim() {
        for variant in 0..8 {
            let spots = Spots::one(&mut Dice::new(5, 0, variant), 0.04);
            let middle = spots.at(spots.spots[0].middle);
            for turn in 0..12 {
                let outwards = direction(turn as f32 / 12.0);
                let along = (0..100).map(|i| spots.at(spots.spots[0].middle + outwards * 0.01 * i as f32));
                let ridge = along.clone().map(|matter| matter.height).fold(0.0, f32::max);
                let dense = along.map(|matter| matter.cover).fold(0.0, f32::max);
                assert!(ridge > 1.5 * middle.height, "{variant} {turn}: {ridge} {}", middle.height);
                assert!(dense > middle.cover + 0.1, "{variant} {turn}: {dense} {}", middle.cover);
            }
        }
    }

    #[test]
    fn several_are_five_to_twelve_that_keep_within_the_stamp() {
        for variant in 0..50 {
            let spots = Spots::several(&mut Dice::new(0, 1, variant), 0.04).spots;
            assert!((5..=12).contains(&spots.len()), "{variant}: {}", spots.len());
            assert!(spots.iter().all(|spot| spot.middle.length() + spot.radius < 0.93), "{variant}");
        }
    }
}
