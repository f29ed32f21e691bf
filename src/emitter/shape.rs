//! Start positions and directions.

use std::f32::consts::TAU;

use bevy::math::{Affine3A, Vec2, Vec3};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::Rng;

use super::{Emitter, EmitterShape};

/// An even number in [0, 1) with 24 random bits, the most an `f32` holds.
pub(super) fn unit(rng: &mut Pcg32) -> f32 {
    (rng.next_u32() >> 8) as f32 / (1 << 24) as f32
}

fn signed_unit(rng: &mut Pcg32) -> f32 {
    unit(rng) * 2.0 - 1.0
}

/// An even point in the unit disc (polar, area-preserving).
fn in_disc(rng: &mut Pcg32) -> Vec2 {
    let (radius, angle) = (unit(rng).sqrt(), TAU * unit(rng));
    Vec2::from_angle(angle) * radius
}

/// A direction within `spread` of -Z, even by solid angle.
fn in_cone(rng: &mut Pcg32, spread: f32) -> Vec3 {
    let z = 1.0 - unit(rng) * (1.0 - spread.cos());
    let flat = Vec2::from_angle(TAU * unit(rng)) * (1.0 - z * z).max(0.0).sqrt();
    flat.extend(-z)
}

impl Emitter {
    /// Start position and velocity of one particle, in world space. Scale moves positions, not speeds.
    /// `fall_speed`: m/s, for those that begin as fast as they fall.
    pub(super) fn sample(
        &self,
        world_from_emitter: &Affine3A,
        rng: &mut Pcg32,
        fall_speed: f32,
    ) -> (Vec3, Vec3) {
        let rotate = |direction: Vec3| {
            world_from_emitter.transform_vector3(direction).normalize_or(Vec3::NEG_Z) * self.speed
        };
        let place = |point: Vec3| world_from_emitter.transform_point3(point);
        match self.shape {
            EmitterShape::Point => (place(Vec3::ZERO), rotate(in_cone(rng, self.spread))),
            EmitterShape::Cone { radius } => {
                let across = in_disc(rng);
                let (sin, cos) = (self.spread * across.length()).sin_cos();
                let direction = (across.normalize_or_zero() * sin).extend(-cos);
                (place((across * radius).extend(0.0)), rotate(direction))
            }
            EmitterShape::Disc { radius } => {
                (place((in_disc(rng) * radius).extend(0.0)), rotate(in_cone(rng, self.spread)))
            }
            EmitterShape::Box { half_size } => {
                let point = Vec3::new(signed_unit(rng), signed_unit(rng), signed_unit(rng)) * half_size;
                (place(point), rotate(in_cone(rng, self.spread)))
            }
            EmitterShape::Sky { half_size } => {
                let offset = Vec3::new(signed_unit(rng) * half_size.x, 0.0, signed_unit(rng) * half_size.y);
                let cone = in_cone(rng, self.spread);
                let down = Vec3::new(cone.x, cone.z, cone.y);
                (place(Vec3::ZERO) + offset, down * if self.speed > 0.0 { self.speed } else { fall_speed })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPES: [EmitterShape; 5] = [
        EmitterShape::Point,
        EmitterShape::Cone { radius: 0.1 },
        EmitterShape::Disc { radius: 0.5 },
        EmitterShape::Box { half_size: Vec3::new(0.5, 0.2, 0.1) },
        EmitterShape::Sky { half_size: Vec2::new(3.0, 2.0) },
    ];

    #[test]
    fn every_shape_stays_inside_itself_and_its_cone() {
        let mut rng = Pcg32::new(1, 2);
        for shape in SHAPES {
            let emitter = Emitter { shape, speed: 2.0, spread: 0.3, ..Default::default() };
            let axis = if matches!(shape, EmitterShape::Sky { .. }) { Vec3::NEG_Y } else { Vec3::NEG_Z };
            let mut mean = Vec3::ZERO;
            for _ in 0..4000 {
                let (position, velocity) = emitter.sample(&Affine3A::IDENTITY, &mut rng, 0.0);
                assert!((velocity.length() - 2.0).abs() < 1e-5, "{shape:?}");
                assert!(velocity.normalize().dot(axis) >= 0.3f32.cos() - 1e-5, "{shape:?} {velocity}");
                let inside = match shape {
                    EmitterShape::Point => position == Vec3::ZERO,
                    EmitterShape::Cone { radius } | EmitterShape::Disc { radius } => {
                        position.length() <= radius && position.z == 0.0
                    }
                    EmitterShape::Box { half_size } => position.abs().cmple(half_size).all(),
                    EmitterShape::Sky { half_size } => {
                        position.y == 0.0
                            && position.x.abs() <= half_size.x
                            && position.z.abs() <= half_size.y
                    }
                };
                assert!(inside, "{shape:?} {position}");
                mean += position / 4000.0;
            }
            assert!(mean.length() < 0.1, "{shape:?} is lopsided: {mean}");
        }
    }

    #[test]
    fn the_transform_turns_and_places_but_does_not_speed_up() {
        let emitter = Emitter { speed: 3.0, ..Default::default() };
        let turned = Affine3A::from_scale_rotation_translation(
            Vec3::splat(4.0),
            bevy::math::Quat::from_rotation_y(std::f32::consts::FRAC_PI_2),
            Vec3::Y,
        );
        let (position, velocity) = emitter.sample(&turned, &mut Pcg32::new(0, 0), 0.0);
        assert_eq!(position, Vec3::Y);
        assert!((velocity - Vec3::NEG_X * 3.0).length() < 1e-5, "{velocity}");
    }
}
