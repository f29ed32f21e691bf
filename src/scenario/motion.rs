//! What moves by the clock: emitters and the camera.

use bevy::prelude::*;

use super::{CameraKey, EmitterKey};
use crate::clock::WeatheringClock;
use crate::emitter::Emitter;

/// Keys and working hours of a scenario's emitter.
#[derive(Component, Debug)]
pub(super) struct EmitterMotion {
    pub(super) keys: Vec<EmitterKey>,
    /// In order of time; from the first on `keys` are not looked at.
    pub(super) legs: Vec<Leg>,
    pub(super) start: f32,
    pub(super) stop: f32,
    /// The first ticks in which it is on, or off, in order; in place of `start` and `stop` if there are any.
    pub(super) switches: Vec<(u32, bool)>,
}

/// A way of an emitter, from one key to another, where it stays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Leg {
    pub(super) from: EmitterKey,
    pub(super) to: EmitterKey,
}

/// Position and target of an emitter at a time: on the last leg that begins before, or, before the first one, by its keys.
pub(super) fn pose(keys: &[EmitterKey], legs: &[Leg], t: f32) -> Option<(Vec3, Vec3)> {
    let begun = legs.partition_point(|leg| leg.from.t < t);
    let time = |key: &EmitterKey| key.t;
    let (from, to, part) = match begun.checked_sub(1).and_then(|last| legs.get(last)) {
        Some(leg) => between(&[leg.from, leg.to], time, t),
        None => between(keys, time, t),
    }?;
    Some((from.position.lerp(to.position, part), from.target.lerp(to.target, part)))
}

impl EmitterMotion {
    /// Whether it works in the tick that the clock shows.
    fn is_on(&self, clock: &WeatheringClock) -> bool {
        let before = self.switches.partition_point(|(tick, _)| *tick <= clock.tick());
        match (before.checked_sub(1).and_then(|last| self.switches.get(last)), self.switches.first()) {
            (Some((_, on)), _) => *on,
            // What begins by being switched off has been on.
            (None, Some((_, first))) => !first,
            (None, None) => {
                let t = clock.seconds() as f32;
                // The tick that ends at `stop` is the last one, the tick that begins at `start` the first.
                t > self.start && t <= self.stop + 0.5 * clock.delta_secs()
            }
        }
    }
}

/// An emitter of the scenario that somebody has taken in hand: neither its keys nor its working hours apply any more.
#[derive(Component, Debug, Default, Clone, Copy)]
pub struct ByHand;

/// The scenario's camera. Follows its keys unless the component is removed.
#[derive(Component, Debug)]
pub struct ScenarioCamera {
    /// In order of time.
    pub keys: Vec<CameraKey>,
}

/// A pose that looks from one point at another, level with the horizon.
fn look(from: Vec3, at: Vec3) -> Transform {
    let up = if (at - from).normalize_or_zero().y.abs() > 0.999 { Vec3::X } else { Vec3::Y };
    Transform::from_translation(from).looking_at(at, up)
}

/// The two keys around `t` and how far it is between them.
pub(super) fn between<K: Copy>(keys: &[K], time: impl Fn(&K) -> f32, t: f32) -> Option<(K, K, f32)> {
    let next = keys.partition_point(|key| time(key) <= t);
    let (Some(after), Some(before)) = (keys.get(next), next.checked_sub(1).map(|i| keys[i])) else {
        let end = if next == 0 { keys.first() } else { keys.last() };
        return end.map(|&key| (key, key, 0.0));
    };
    let span = time(after) - time(&before);
    Some((before, *after, if span > 0.0 { (t - time(&before)) / span } else { 0.0 }))
}

/// Moves and switches emitters at the start of a tick; writes their global transform, since the tick needs it now.
pub(super) fn move_emitters(
    clock: Res<WeatheringClock>,
    mut emitters: Query<
        (&EmitterMotion, &mut Emitter, &mut Transform, &mut GlobalTransform),
        Without<ByHand>,
    >,
) {
    let t = clock.seconds() as f32;
    for (motion, mut emitter, mut transform, mut global) in &mut emitters {
        emitter.enabled = motion.is_on(&clock);
        if let Some((position, target)) = pose(&motion.keys, &motion.legs, t) {
            *transform = look(position, target);
            *global = GlobalTransform::from(*transform);
        }
    }
}

/// Moves the camera once per frame, smoothly.
pub(super) fn move_camera(
    clock: Res<WeatheringClock>,
    mut cameras: Query<(&ScenarioCamera, &mut Transform)>,
) {
    for (camera, mut transform) in &mut cameras {
        if let Some((from, to, part)) = between(&camera.keys, |key| key.t, clock.seconds() as f32) {
            let part = part * part * (3.0 - 2.0 * part);
            transform.set_if_neq(look(from.eye.lerp(to.eye, part), from.target.lerp(to.target, part)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(t: f32, x: f32) -> EmitterKey {
        EmitterKey { t, position: Vec3::X * x, target: Vec3::X * x + Vec3::NEG_Z }
    }

    #[test]
    fn keys_hold_before_the_first_and_after_the_last_and_blend_between() {
        let keys = [key(1.0, 0.0), key(3.0, 10.0), key(3.0, 20.0)];
        let x_at = |t| {
            let (from, to, part) = between(&keys, |key| key.t, t).unwrap();
            from.position.lerp(to.position, part).x
        };
        assert_eq!([x_at(0.0), x_at(2.0), x_at(3.0), x_at(9.0)], [0.0, 5.0, 20.0, 20.0]);
        assert!(between(&[] as &[EmitterKey], |key| key.t, 0.0).is_none());
    }

    #[test]
    fn switches_take_the_place_of_hours() {
        let on = |switches: &[(u32, bool)]| {
            let switches = switches.to_vec();
            let motion = EmitterMotion { keys: vec![], legs: vec![], start: 0.0, stop: 1.0, switches };
            let mut clock = WeatheringClock::new(2);
            [(); 5].map(|()| {
                clock.advance();
                motion.is_on(&clock)
            })
        };
        assert_eq!(on(&[]), [true, true, false, false, false]);
        assert_eq!(on(&[(2, true), (4, false)]), [false, true, true, false, false]);
        assert_eq!(on(&[(3, false)]), [true, true, false, false, false]);
        assert_eq!(on(&[(3, false), (3, true)]), [true; 5]);
    }

    #[test]
    fn emitters_work_their_hours_and_point_where_they_should() {
        let mut world = World::new();
        world.insert_resource(WeatheringClock::new(2));
        let (keys, legs, switches) = (vec![key(0.0, 4.0)], vec![], vec![]);
        let motion = EmitterMotion { keys, legs, start: 1.0, stop: 2.0, switches };
        let emitter = world.spawn((motion, Emitter::default(), GlobalTransform::default())).id();
        let mut schedule = Schedule::default();
        schedule.add_systems(move_emitters);
        let mut on = vec![];
        for _ in 0..6 {
            world.resource_mut::<WeatheringClock>().advance();
            schedule.run(&mut world);
            on.push(world.get::<Emitter>(emitter).unwrap().enabled);
        }
        assert_eq!(on, [false, false, true, true, false, false]);
        let global = world.get::<GlobalTransform>(emitter).unwrap();
        assert_eq!(global.translation(), Vec3::X * 4.0);
        assert!((global.forward().as_vec3() - Vec3::NEG_Z).length() < 1e-6);
    }
}
