//! Where a hose has to point so that what it sends out comes down at what is pointed at: water falls on its way, and air slows it
//! down.
//!
//! The flight is run through in short steps, as particles fly, and the hose pointed higher by as much as it came down too low, a
//! few times. Wind is left out, as whoever holds a hose sees what it does. What lies too far off is sprayed at as far as it goes.

use bevy::prelude::*;
use bevy_weathering::effect::WeatherEffect;
use bevy_weathering::effect::drops::SIZE_CLASSES;
use bevy_weathering::emitter::Emitter;
use bevy_weathering::particle::Forces;

/// Seconds of a step.
const STEP: f32 = 1.0 / 120.0;
/// Steps after which nothing has come as far.
const MOST_STEPS: usize = 720;
/// How often it is pointed anew.
const ROUNDS: usize = 8;
/// Slower than this it is held straight, m/s: what hardly moves by itself is dropped, or carried by air.
const SLOWEST: f32 = 1.0;
/// Drag by which a speed is lost within less than a metre is of flakes and dust, which fly where air goes, 1/m.
const MOST_DRAG: f32 = 1.0;

/// How what is sent out flies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flight {
    /// At the nozzle, m/s.
    pub speed: f32,
    /// m/s².
    pub gravity: Vec3,
    /// Quadratic drag over mass, 1/m.
    pub drag: f32,
}

impl Flight {
    /// Of an emitter; straight, if its effect is not known.
    pub fn new(emitter: &Emitter, effect: Option<&WeatherEffect>, forces: &Forces) -> Self {
        let Some(effect) = effect else {
            return Self { speed: emitter.speed, gravity: Vec3::ZERO, drag: 0.0 };
        };
        // At their terminal speed, drag is as strong as gravity: of drops in the middle of their sizes.
        let terminal = effect.terminal_speeds()[SIZE_CLASSES / 2];
        let drag = if terminal > 0.0 { Forces::default().gravity.length() / terminal.powi(2) } else { 0.0 };
        Self { speed: emitter.speed, gravity: forces.gravity * effect.gravity_scale, drag }
    }

    /// The direction from a place at a target, another place.
    pub fn aim(&self, from: Vec3, target: Vec3) -> Dir3 {
        let Ok(straight) = Dir3::new(target - from) else { return Dir3::NEG_Z };
        if self.speed < SLOWEST || self.drag > MOST_DRAG || self.gravity == Vec3::ZERO {
            return straight;
        }
        let up = -self.gravity.normalize_or_zero();
        // Half way between there and straight up, nothing goes farther.
        let Ok(farthest) = Dir3::new(*straight + up) else { return straight };
        let is_too_high = |way: Dir3| way.dot(up) > farthest.dot(up);
        let (mut way, mut aim) = (straight, target);
        for _ in 0..ROUNDS {
            let Some(passed) = self.passes(from, way, target) else { return farthest };
            aim += target - passed;
            way = match Dir3::new(aim - from) {
                Ok(way) if !is_too_high(way) => way,
                _ => return farthest,
            };
        }
        way
    }

    /// Where it passes a target that it is sent towards, if it comes as far.
    fn passes(&self, from: Vec3, way: Dir3, target: Vec3) -> Option<Vec3> {
        let line = (target - from).try_normalize()?;
        let distance = from.distance(target);
        let (mut place, mut velocity) = (from, *way * self.speed);
        for _ in 0..MOST_STEPS {
            let braking = self.drag * velocity.length() * STEP;
            velocity = (velocity + self.gravity * STEP) / (1.0 + braking);
            let next = place + velocity * STEP;
            let [before, after] = [place, next].map(|place| (place - from).dot(line));
            if after >= distance {
                let part = (distance - before) / (after - before).max(f32::EPSILON);
                return Some(place.lerp(next, part.clamp(0.0, 1.0)));
            }
            place = next;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use bevy_weathering::effect::{Carries, DropSizes};

    use super::*;

    const GRAVITY: f32 = 9.81;

    fn flight(speed: f32, drag: f32) -> Flight {
        Flight { speed, gravity: Vec3::NEG_Y * GRAVITY, drag }
    }

    #[test]
    fn a_jet_without_drag_follows_a_parabola_to_what_it_is_aimed_at() {
        let from = Vec3::new(0.3, 1.5, -2.0);
        for (ahead, up) in
            [(1.0, 0.0), (3.0, -1.0), (5.0, 0.5), (4.0, -1.5), (1.0, 2.0), (0.3, 3.0), (2.0, 2.5)]
        {
            let way = flight(10.0, 0.0).aim(from, from + Vec3::new(0.0, up, -ahead));
            let (along, rise) = (-way.z, way.y);
            let seconds = ahead / (along * 10.0);
            let height = rise * 10.0 * seconds - 0.5 * GRAVITY * seconds * seconds;
            assert!((height - up).abs() < 0.05, "{ahead} {up}: {height}");
            assert!(way.x.abs() < 1e-4);
        }
    }

    #[test]
    fn drag_has_it_pointed_higher_and_what_is_too_far_is_sprayed_at_as_far_as_it_goes() {
        let target = Vec3::new(0.0, 0.0, -4.0);
        let [free, braked] = [0.0, 0.05].map(|drag| flight(10.0, drag).aim(Vec3::ZERO, target));
        assert!(0.0 < free.y && free.y < braked.y && braked.y < 0.6, "{free:?} {braked:?}");
        for distance in [40.0, 1000.0] {
            let far = flight(10.0, 0.05).aim(Vec3::ZERO, Vec3::NEG_Z * distance);
            assert!((far.y - 0.5f32.sqrt()).abs() < 1e-3, "{far:?}");
        }
        // Straight up and straight down there is nothing to correct.
        for way in [Dir3::Y, Dir3::NEG_Y] {
            let aim = flight(10.0, 0.0).aim(Vec3::ZERO, way * 2.0);
            assert!(aim.dot(*way) > 0.999, "{aim:?}");
        }
    }

    #[test]
    fn what_flies_where_air_goes_is_sent_straight_ahead() {
        let target = Vec3::new(2.0, 1.0, -2.0);
        let straight = Dir3::new(target).unwrap();
        for other in [flight(0.5, 0.0), flight(10.0, 9.0)] {
            assert_eq!(other.aim(Vec3::ZERO, target), straight);
        }
        let emitter = Emitter { speed: 5.0, ..default() };
        assert_eq!(Flight::new(&emitter, None, &Forces::default()).aim(Vec3::ZERO, target), straight);
        let effect = WeatherEffect { terminal_speed: Some(9.81), ..default() };
        let known = Flight::new(&emitter, Some(&effect), &Forces::default());
        assert!((known.drag - 1.0 / 9.81).abs() < 1e-5 && known.speed == 5.0, "{known:?}");
        // Of grains by what they are.
        let dust = WeatherEffect { carries: Carries::Dust, drops: DropSizes::Same(0.05), ..default() };
        assert!(Flight::new(&emitter, Some(&dust), &Forces::default()).drag > MOST_DRAG);
    }
}
