//! Balls cut into sectors and stacks: the sphere, and a rock that lies on the ground.

use std::f32::consts::PI;

use bevy::math::{Vec2, Vec3};
use bevy::mesh::Mesh;
use fastnoise_lite::FastNoiseLite;

use super::{MeshError, Surface, at_least, meridian, noise, positive};

/// A sphere around the origin, cut into `sectors` around and `stacks` from pole to pole.
///
/// `radius` is in metres. The poles are fans: the mesh has `2 * sectors * (stacks - 1)` triangles. A pole
/// has one vertex for each of its triangles, with `u` in the middle of that triangle. `v` is 0 at the top.
///
/// # Errors
/// [`MeshError::NotPositive`], [`MeshError::TooFew`] (3 sectors and 2 stacks make the smallest sphere),
/// [`MeshError::TooMany`].
pub fn uv_sphere(radius: f32, sectors: u32, stacks: u32) -> Result<Mesh, MeshError> {
    positive("radius", radius)?;
    ball(sectors, stacks, |out| (out * radius, out.normalize()))?.into_mesh()
}

/// A rounded rock around the origin; each `seed` makes another one.
///
/// It is a [`uv_sphere`] of `radius` metres whose vertices noise has moved in or out by up to a quarter of
/// the radius, then squashed to three quarters of its height, then flattened below: it touches the plane
/// 0.45 radii below the origin, and lies on the ground if it is placed that high. Triangles, poles and UVs
/// are those of the sphere. The normals are those of the deformed surface and not of the triangles, so a
/// coarse rock is shaded like a fine one.
///
/// # Errors
/// Those of [`uv_sphere`].
pub fn rock(radius: f32, sectors: u32, stacks: u32, seed: u32) -> Result<Mesh, MeshError> {
    positive("radius", radius)?;
    let shape = RockShape { noise: noise(seed, 2) };
    let mut surface = ball(sectors, stacks, |out| {
        let out = out.normalize();
        (shape.at(out) * radius, shape.normal(out))
    })?;
    let lowest = surface.positions.iter().map(|position| position.y).fold(f32::INFINITY, f32::min);
    // The bend leaves a gap of a few percent of the radius above the plane, a different one for each seed.
    let sink = RockShape::FLOOR * radius - lowest;
    surface.positions.iter_mut().for_each(|position| position.y += sink);
    surface.into_mesh()
}

/// A ball whose positions and normals depend on the direction from its middle.
fn ball(sectors: u32, stacks: u32, place: impl Fn(Vec3) -> (Vec3, Vec3)) -> Result<Surface, MeshError> {
    at_least("sectors", 3, sectors)?;
    at_least("stacks", 2, stacks)?;
    // The lattice covers the bands between the poles: stacks - 1 rings, one row of quads fewer.
    let mut surface = Surface::with_lattice(sectors, stacks - 2)?;
    for ring in 1..stacks {
        let v = ring as f32 / stacks as f32;
        let (sin, cos) = (v * PI).sin_cos();
        for column in 0..=sectors {
            let (position, normal) = place(meridian(column, sectors) * sin + Vec3::Y * cos);
            surface.push(position, normal, Vec2::new(column as f32 / sectors as f32, v));
        }
    }
    let last_ring = (stacks - 2) * (sectors + 1);
    let (top, top_normal) = place(Vec3::Y);
    let (bottom, bottom_normal) = place(Vec3::NEG_Y);
    for column in 0..sectors {
        let u = (column as f32 + 0.5) / sectors as f32;
        let top = surface.push(top, top_normal, Vec2::new(u, 0.0));
        surface.indices.extend([top, column, column + 1]);
        let bottom = surface.push(bottom, bottom_normal, Vec2::new(u, 1.0));
        surface.indices.extend([last_ring + column, bottom, last_ring + column + 1]);
    }
    Ok(surface)
}

/// The surface of a rock of radius 1, as a function of the direction from its middle.
struct RockShape {
    noise: FastNoiseLite,
}

impl RockShape {
    /// How far noise moves the surface in or out.
    const ROUGHNESS: f32 = 0.25;
    /// Features of the noise per radius.
    const FEATURES: f32 = 0.6;
    /// What is left of the height.
    const SQUASH: f32 = 0.75;
    /// Height of the plane that flattens the underside.
    const FLOOR: f32 = -0.45;
    /// Within this distance of the plane the underside already bends towards it. Wide, because a sharp rim
    /// would need finer stacks than a rock usually gets.
    const BEND: f32 = 0.5;

    fn at(&self, out: Vec3) -> Vec3 {
        let sample = out * Self::FEATURES;
        let bulge = Self::ROUGHNESS * self.noise.get_noise_3d(sample.x, sample.y, sample.z);
        let at = out * (1.0 + bulge);
        let height = at.y * Self::SQUASH;
        // The greater of height and floor, with a parabola where they meet.
        let near = 1.0 - ((height - Self::FLOOR).abs() / Self::BEND).min(1.0);
        Vec3::new(at.x, height.max(Self::FLOOR) + near * near * Self::BEND / 4.0, at.z)
    }

    /// From central differences. `out` is a unit vector, and equal directions have equal normals.
    fn normal(&self, out: Vec3) -> Vec3 {
        // In radians: far below the features of the noise, far above what rounding does to a difference.
        const STEP: f32 = 0.005;
        let right = out.any_orthonormal_vector();
        let up = out.cross(right);
        let along = |tangent: Vec3| {
            self.at((out + tangent * STEP).normalize()) - self.at((out - tangent * STEP).normalize())
        };
        along(right).cross(along(up)).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::meshes::checks::parts;

    #[test]
    fn sphere_normals_are_radial() {
        let parts = parts(&uv_sphere(0.4, 26, 19).expect("valid"));
        for (position, normal) in parts.positions.iter().zip(&parts.normals) {
            assert!((position.length() - 0.4).abs() < 1e-6 && position.dot(*normal) > 0.4 - 1e-6);
        }
    }

    #[test]
    fn a_rock_lies_flat_on_the_ground_and_is_about_as_large_as_its_sphere() {
        for seed in [0, 1, 2, 3, 4, u32::MAX / 2, u32::MAX] {
            let positions = parts(&rock(0.5, 32, 24, seed).expect("valid")).positions;
            let (low, high) = positions.iter().fold((Vec3::MAX, Vec3::MIN), |(low, high), &position| {
                (low.min(position), high.max(position))
            });
            assert!((low.y + 0.45 * 0.5).abs() < 1e-6, "seed {seed}: {low}");
            // Squashed: clearly lower than wide.
            let size = high - low;
            assert!(size.y > 0.4 && size.y < 0.9 * size.x.min(size.z), "seed {seed}: {size}");
            assert!(size.x.min(size.z) > 0.75 && size.x.max(size.z) < 1.25, "seed {seed}: {size}");
            let nearly_lying = positions.iter().filter(|position| position.y < low.y + 0.02);
            let reach = nearly_lying.map(|at| at.x.hypot(at.z)).fold(0.0, f32::max);
            assert!(reach > 0.15, "seed {seed}: it touches the ground {reach} m around");
        }
    }

    #[test]
    fn each_seed_has_its_own_rock() {
        let rock = |seed| parts(&rock(0.5, 12, 8, seed).expect("valid")).positions;
        assert_eq!(rock(5), rock(5));
        assert_ne!(rock(5), rock(6));
    }

    #[test]
    fn the_normals_of_a_rock_are_those_of_a_finer_one() {
        for seed in 0..4 {
            let parts = parts(&rock(0.5, 128, 96, seed).expect("valid"));
            for triangle in &parts.triangles {
                let [a, b, c] = triangle.map(|i| parts.positions[i]);
                let face = (b - a).cross(c - a).normalize();
                for &i in triangle {
                    let cos = face.dot(parts.normals[i]);
                    assert!(cos > 0.95, "seed {seed}, {triangle:?}: {cos}");
                }
            }
        }
    }

    #[test]
    fn poles_are_one_point_with_one_normal() {
        let parts = parts(&rock(0.5, 16, 12, 9).expect("valid"));
        for v in [0.0, 1.0] {
            let pole: Vec<(Vec3, Vec3)> = (0..parts.uvs.len())
                .filter(|&i| parts.uvs[i].y == v)
                .map(|i| (parts.positions[i], parts.normals[i]))
                .collect();
            assert!(pole.len() == 16 && pole.iter().all(|vertex| *vertex == pole[0]), "v = {v}");
        }
    }
}
