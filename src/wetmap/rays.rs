//! Rays from points of a surface into the scene around it.
//!
//! Directions are Hammersley points, shifted round the unit square by a random amount of the texel's own
//! (Cranley, Patterson 1976): evenly spread for each texel, and without the pattern that all texels would
//! share.

use std::f32::consts::TAU;

use bevy::math::{Vec2, Vec3};

use super::parallel::fill;
use crate::collision::CollisionScene;
use crate::scenes::noise::{hash, unit};
use crate::wetting::SurfacePoint;

/// Points that a thread takes at a time.
const CHUNK: usize = 256;

/// A value for each point, by all cores. `progress` is told how many more are done, from any thread.
pub(super) fn per_point<T: Default + Clone + Send>(
    points: &[SurfacePoint],
    value: impl Fn(&SurfacePoint) -> T + Sync,
    progress: impl Fn(u64) + Sync,
) -> Vec<T> {
    let mut values = vec![T::default(); points.len()];
    fill(&mut values, CHUNK, |first, chunk| {
        for (out, point) in chunk.iter_mut().zip(&points[first..]) {
            *out = value(point);
        }
        progress(chunk.len() as u64);
    });
    values
}

/// `count` points in the unit square, the same for the same texel.
pub(super) fn samples(count: u32, texel: u32) -> impl Iterator<Item = Vec2> {
    let shift = Vec2::new(unit(hash([texel, 0, 6])), unit(hash([texel, 1, 6])));
    (0..count).map(move |i| {
        let point = Vec2::new((i as f32 + 0.5) / count as f32, unit(i.reverse_bits())) + shift;
        point - point.floor()
    })
}

/// Directions in a cone, more of them near its axis: by the cosine of the angle to it.
pub(super) struct Lobe {
    axis: Vec3,
    across: (Vec3, Vec3),
    /// Square of the sine of the half-angle.
    sin_squared: f32,
}

impl Lobe {
    /// Around a unit vector; the half-angle is 0 to a quarter turn.
    pub(super) fn new(axis: Vec3, half_angle: f32) -> Self {
        Self { axis, across: axis.any_orthonormal_pair(), sin_squared: half_angle.sin().powi(2) }
    }

    /// The unit vector that a point of the unit square stands for.
    pub(super) fn direction(&self, sample: Vec2) -> Vec3 {
        let sin_squared = sample.x * self.sin_squared;
        let around = Vec2::from_angle(TAU * sample.y) * sin_squared.sqrt();
        let (tangent, bitangent) = self.across;
        tangent * around.x + bitangent * around.y + self.axis * (1.0 - sin_squared).max(0.0).sqrt()
    }
}

/// Asks a scene what is in the way.
pub(super) struct Rays<'a> {
    scene: &'a CollisionScene,
    /// The middle of all that can be hit, and how far anything lies from it at most.
    middle: Vec3,
    radius: f32,
    /// How far above its surface a ray starts, metres: more than rounding, so that no triangle is in its own
    /// way.
    lift: f32,
}

impl<'a> Rays<'a> {
    pub(super) fn new(scene: &'a CollisionScene) -> Self {
        let (min, max) = scene.bounds();
        if !(min.is_finite() && max.is_finite()) {
            // Nothing can be hit.
            return Self { scene, middle: Vec3::ZERO, radius: 1.0, lift: 0.0 };
        }
        let size = (max - min).length();
        let farthest = min.abs().max(max.abs()).max_element();
        Self { scene, middle: (min + max) * 0.5, radius: size * 0.5, lift: 2.0e-5 * size + 4.0e-6 * farthest }
    }

    /// Where rays from a point start.
    pub(super) fn start(&self, point: &SurfacePoint) -> Vec3 {
        point.position + point.normal * self.lift
    }

    /// Beyond this distance from `start` there is nothing, metres.
    pub(super) fn reach(&self, start: Vec3) -> f32 {
        1.01 * (start.distance(self.middle) + self.radius)
    }

    /// Whether nothing is in the way.
    pub(super) fn is_free(&self, start: Vec3, end: Vec3) -> bool {
        self.scene.cast(start, end).is_none()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::Arc;

    use bevy::math::Affine3A;
    use bevy::prelude::{Entity, Mesh, Plane3d};

    use super::*;
    use crate::collision::{MeshBvh, MeshTriangles};

    /// A scene of horizontal squares, each from -1 to 1 along x and z before it is moved.
    pub(in crate::wetmap) fn squares(transforms: &[Affine3A]) -> CollisionScene {
        let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
        let bvh = Arc::new(MeshBvh::build(MeshTriangles::from_mesh(&mesh).unwrap()));
        let surface = |i: usize| Entity::from_raw_u32(i as u32 + 1).unwrap();
        CollisionScene::new(transforms.iter().enumerate().map(|(i, &at)| (surface(i), at, bvh.clone())))
    }

    /// A square of the scene: its middle, and half its size along x and z.
    pub(in crate::wetmap) fn at(middle: Vec3, half_size: Vec2) -> Affine3A {
        Affine3A::from_translation(middle) * Affine3A::from_scale(Vec3::new(half_size.x, 1.0, half_size.y))
    }

    /// Points on the ground that face up, `size` along x and z from -2 to 2: texels row by row from -z.
    pub(in crate::wetmap) fn ground(size: u32) -> Vec<SurfacePoint> {
        let place = |i: u32| (i as f32 + 0.5) / size as f32 * 4.0 - 2.0;
        let point = |texel: u32| SurfacePoint {
            texel,
            triangle: 0,
            position: Vec3::new(place(texel % size), 0.0, place(texel / size)),
            normal: Vec3::Y,
        };
        (0..size * size).map(point).collect()
    }

    #[test]
    fn samples_fill_the_square_evenly() {
        for texel in [0, 1, 77] {
            let points: Vec<Vec2> = samples(64, texel).collect();
            assert!(points.iter().all(|p| p.cmpge(Vec2::ZERO).all() && p.cmplt(Vec2::ONE).all()));
            // Four to each sixteenth, give or take what the shift cuts.
            for cell in 0..16 {
                let inside = |p: &&Vec2| (p.x * 4.0) as i32 == cell % 4 && (p.y * 4.0) as i32 == cell / 4;
                let count = points.iter().filter(inside).count();
                assert!((1..=7).contains(&count), "{texel} {cell}: {count}");
            }
        }
        assert_ne!(samples(1, 0).next(), samples(1, 1).next());
    }

    #[test]
    fn lobes_stay_in_their_cones_and_lean_to_no_side() {
        for axis in [Vec3::Y, Vec3::NEG_Z, Vec3::new(0.6, -0.48, 0.64)] {
            for half_angle in [0.0, 0.3, std::f32::consts::FRAC_PI_2] {
                let lobe = Lobe::new(axis, half_angle);
                let mut mean = Vec3::ZERO;
                for sample in samples(1024, 3) {
                    let direction = lobe.direction(sample);
                    assert!((direction.length() - 1.0).abs() < 1e-5);
                    assert!(direction.dot(axis) >= half_angle.cos() - 1e-5);
                    mean += direction / 1024.0;
                }
                // The mean cosine, weighed by the cosine.
                let expected = if half_angle == 0.0 {
                    1.0
                } else {
                    2.0 / 3.0 * (1.0 - half_angle.cos().powi(3)) / half_angle.sin().powi(2)
                };
                assert!((mean - axis * expected).length() < 0.01, "{axis} {half_angle}: {mean}");
            }
        }
    }

    #[test]
    fn no_surface_is_in_its_own_way() {
        for scale in [0.01, 1.0, 100.0] {
            let ground_only = squares(&[at(Vec3::Y * scale, Vec2::splat(2.0 * scale))]);
            let rays = Rays::new(&ground_only);
            let lobe = Lobe::new(Vec3::Y, std::f32::consts::FRAC_PI_2);
            for mut point in ground(8) {
                point.position = point.position * scale + Vec3::Y * scale;
                let start = rays.start(&point);
                for sample in samples(64, point.texel) {
                    assert!(rays.is_free(start, start + lobe.direction(sample) * rays.reach(start)));
                }
                assert!(!rays.is_free(start + Vec3::Y * 0.1 * scale, start - Vec3::Y * rays.reach(start)));
            }
        }
        let empty = CollisionScene::default();
        assert!(Rays::new(&empty).is_free(Vec3::ZERO, Vec3::Y));
    }
}
