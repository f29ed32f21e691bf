//! An orbit camera: left button turns, right button moves, the wheel comes closer.

use bevy::input::mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll};
use bevy::prelude::*;
use bevy_weathering::scenario::ScenarioCamera;

/// Radians per pixel.
const TURN: f32 = 0.005;
/// Part of the distance per pixel.
const MOVE: f32 = 0.0015;
/// Part of the distance per notch.
const ZOOM: f32 = 0.1;

#[derive(Component, Debug, Clone, Copy)]
struct Orbit {
    target: Vec3,
    distance: f32,
    yaw: f32,
    pitch: f32,
}

impl Orbit {
    fn new(eye: Vec3, target: Vec3) -> Self {
        let offset = eye - target;
        let distance = offset.length().max(0.01);
        let pitch = (offset.y / distance).clamp(-1.0, 1.0).asin();
        Self { target, distance, yaw: offset.x.atan2(offset.z), pitch }
    }

    fn transform(&self) -> Transform {
        let rotation = Quat::from_euler(EulerRot::YXZ, self.yaw, -self.pitch, 0.0);
        Transform { translation: self.target + rotation * (Vec3::Z * self.distance), rotation, ..default() }
    }
}

pub fn plugin(app: &mut App) {
    app.add_systems(Startup, take_over).add_systems(Update, orbit);
}

/// Begins where the scenario's camera begins, and is free from then on.
fn take_over(mut commands: Commands, cameras: Query<(Entity, &ScenarioCamera)>) {
    for (entity, camera) in &cameras {
        if let Some(key) = camera.keys.first() {
            let orbit = Orbit::new(key.eye, key.target);
            commands.entity(entity).remove::<ScenarioCamera>().insert((orbit, orbit.transform()));
        }
    }
}

fn orbit(
    buttons: Res<ButtonInput<MouseButton>>,
    motion: Res<AccumulatedMouseMotion>,
    scroll: Res<AccumulatedMouseScroll>,
    mut cameras: Query<(&mut Orbit, &mut Transform)>,
) {
    for (mut orbit, mut transform) in &mut cameras {
        if buttons.pressed(MouseButton::Left) {
            orbit.yaw -= motion.delta.x * TURN;
            orbit.pitch = (orbit.pitch + motion.delta.y * TURN).clamp(-1.5, 1.5);
        } else if buttons.pressed(MouseButton::Right) {
            let across = transform.right() * -motion.delta.x + transform.up() * motion.delta.y;
            let distance = orbit.distance;
            orbit.target += across * (distance * MOVE);
        }
        orbit.distance = (orbit.distance * (1.0 - scroll.delta.y.clamp(-5.0, 5.0) * ZOOM)).clamp(0.05, 500.0);
        transform.set_if_neq(orbit.transform());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_orbit_begins_where_it_is_told() {
        let (eye, target) = (Vec3::new(3.0, 2.0, -4.0), Vec3::new(0.5, 0.5, 0.0));
        let transform = Orbit::new(eye, target).transform();
        assert!((transform.translation - eye).length() < 1e-5);
        assert!(transform.forward().dot((target - eye).normalize()) > 0.9999);
    }
}
