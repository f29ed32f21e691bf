//! How open to the air and to the sun a surface lies: what makes it dry faster here than there.

use std::f32::consts::FRAC_PI_2;

use bevy::math::Vec3;

use super::rays::{Lobe, Rays, per_point, samples};
use crate::collision::CollisionScene;
use crate::wetting::SurfacePoint;

/// Of each point, the part of the half-space above it that is free up to `reach_metres`, 0..=1, weighed by
/// the cosine to its normal: 1 on a ball, less in a groove. `rays` are taken as at least 1; a reach of 0 or
/// less leaves everything free, one that is not finite has no end.
///
/// The same on any number of cores.
pub fn accessibility(
    scene: &CollisionScene,
    points: &[SurfacePoint],
    rays: u32,
    reach_metres: f32,
) -> Vec<f32> {
    let (count, rays) = (rays.max(1), Rays::new(scene));
    let free = |point: &SurfacePoint| {
        let start = rays.start(point);
        // NaN and infinity are no shorter than the way to the end of the scene.
        let reach = reach_metres.min(rays.reach(start));
        let lobe = Lobe::new(point.normal, FRAC_PI_2);
        let is_free = |direction: Vec3| reach <= 0.0 || rays.is_free(start, start + direction * reach);
        let free = samples(count, point.texel).filter(|&sample| is_free(lobe.direction(sample))).count();
        free as f32 / count as f32
    };
    per_point(points, free, |_| {})
}

/// How much sun each point gets, 0..=1: the cosine between its normal and `towards_sun`, or 0 in the shade.
/// The direction need not be of unit length; without any there is no sun.
///
/// The same on any number of cores.
pub fn sun_visibility(scene: &CollisionScene, points: &[SurfacePoint], towards_sun: Vec3) -> Vec<f32> {
    let rays = Rays::new(scene);
    let towards_sun = towards_sun.normalize_or_zero();
    let lit = |point: &SurfacePoint| {
        let facing = point.normal.dot(towards_sun);
        let start = rays.start(point);
        let end = start + towards_sun * rays.reach(start);
        if facing > 0.0 && rays.is_free(start, end) { facing.min(1.0) } else { 0.0 }
    };
    per_point(points, lit, |_| {})
}

#[cfg(test)]
mod tests {
    use bevy::math::{Affine3A, Vec2};

    use super::super::rays::tests::{at, ground, squares};
    use super::*;

    /// A ground of 8 m by 8 m, and a wall at x = -2.01, 100 m high and 200 m long.
    fn walled() -> CollisionScene {
        let upright = Affine3A::from_rotation_z(FRAC_PI_2);
        let wall = Affine3A::from_translation(Vec3::X * -2.01)
            * upright
            * Affine3A::from_scale(Vec3::new(100.0, 1.0, 100.0));
        squares(&[at(Vec3::ZERO, Vec2::splat(4.0)), wall])
    }

    #[test]
    fn a_wall_takes_half_of_the_air_beside_it_and_none_beyond_reach() {
        let points = ground(16);
        let free = accessibility(&walled(), &points, 256, f32::INFINITY);
        // The first of a row lies .135 m beside the wall.
        let (beside, middle) = (8 * 16, 8 * 16 + 8);
        assert!((free[beside] - 0.5).abs() < 0.05, "{}", free[beside]);
        let near = accessibility(&walled(), &points, 256, 1.0);
        assert_eq!(near[middle], 1.0);
        assert!(near[beside] > 0.5 && near[beside] < 0.7, "{}", near[beside]);
        assert!(accessibility(&walled(), &points, 0, 0.0).iter().all(|&free| free == 1.0));
        assert_eq!(accessibility(&walled(), &points, 256, f32::NAN), free);
    }

    #[test]
    fn the_sun_shines_by_the_cosine_and_not_through_walls() {
        let points = ground(16);
        let noon = sun_visibility(&walled(), &points, Vec3::Y * 7.0);
        assert!(noon.iter().all(|&lit| (lit - 1.0).abs() < 1e-5));
        let from = |towards_sun| sun_visibility(&walled(), &points, towards_sun)[8 * 16 + 8];
        assert!((from(Vec3::new(3.0, 4.0, 0.0)) - 0.8).abs() < 1e-5);
        assert_eq!(from(Vec3::new(-3.0, 4.0, 0.0)), 0.0);
        assert_eq!((from(Vec3::NEG_Y), from(Vec3::ZERO), from(Vec3::NAN)), (0.0, 0.0, 0.0));
    }
}
