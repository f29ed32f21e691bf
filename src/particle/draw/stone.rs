//! Grains of sand and lumps of earth.
//!
//! A grain is what some planes cut out of space, its edges worn: facets that catch the light one after the other. A clod is
//! a few balls that stick together, with noise on their surface; crumbs hang on it.

use std::f32::consts::TAU;

use bevy::math::{Vec2, Vec3};
use fastnoise_lite::{FastNoiseLite, FractalType};

use super::sprites::{Texel, random, smoothstep};

/// A broken crystal.
pub(super) struct Grain {
    /// Outward normals, and distances from the middle.
    planes: Vec<(Vec3, f32)>,
    seed: u32,
}

/// Planes of a grain.
const PLANES: u32 = 16;
/// Depth by which a neighbouring facet may lie behind and still round the edge.
const WEAR: f32 = 0.04;

impl Grain {
    pub(super) fn new(variant: u32) -> Self {
        let seed = variant + 100;
        let stretch = Vec3::new(1.0, 0.72 + 0.28 * random(seed, 1), 0.8);
        let planes = (0..PLANES).map(|i| {
            // Evenly round the sphere, then stirred.
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / PLANES as f32;
            let around = i as f32 * 2.399_963 + TAU * random(seed, 2);
            let jitter =
                Vec3::new(random(seed, 3 * i + 10), random(seed, 3 * i + 11), random(seed, 3 * i + 12));
            let ring = (1.0 - z * z).sqrt();
            let even = Vec3::new(around.cos() * ring, around.sin() * ring, z);
            let normal = (even + (jitter - 0.5) * 0.9).normalize_or(Vec3::Z);
            let distance = (0.64 + 0.2 * random(seed, i + 70)) * (normal * stretch).length();
            (normal, distance)
        });
        Self { planes: planes.collect(), seed }
    }

    pub(super) fn at(&self, at: Vec2) -> Texel {
        let (mut front, mut back) = (f32::MAX, f32::MIN);
        // Where a line of sight passes each plane; the grain lies behind those that face the eye.
        let depth = |normal: Vec3, distance: f32| (distance - normal.truncate().dot(at)) / normal.z;
        for &(normal, distance) in &self.planes {
            if normal.z > 0.0 {
                front = front.min(depth(normal, distance));
            } else {
                back = back.max(depth(normal, distance));
            }
        }
        if front <= back {
            return Texel::NONE;
        }
        let (mut normal, mut shade, mut weight) = (Vec3::ZERO, 0.0, 0.0);
        for (i, &(facet, distance)) in (0..).zip(&self.planes).filter(|(_, (facet, _))| facet.z > 0.0) {
            let near = (-(depth(facet, distance) - front) / WEAR).exp();
            normal += facet * near;
            shade += (0.7 + 0.3 * random(self.seed, i + 200)) * near;
            weight += near;
        }
        let normal = normal.normalize_or(Vec3::Z);
        Texel { slope: normal.truncate(), shade: shade / weight, cover: 1.0 }
    }
}

/// Wet earth.
pub(super) struct Clod {
    /// Middles and radii.
    balls: Vec<(Vec2, f32)>,
    noise: FastNoiseLite,
}

/// Balls of a clod; the last ones are crumbs.
const BALLS: u32 = 8;

impl Clod {
    pub(super) fn new(variant: u32) -> Self {
        let seed = variant + 300;
        let ball = |i: u32| {
            let crumb = i >= 5;
            let out = if crumb { 0.66 + 0.2 * random(seed, 2 * i) } else { 0.34 * random(seed, 2 * i) };
            let radius =
                if crumb { 0.1 + 0.1 * random(seed, i + 40) } else { 0.36 + 0.26 * random(seed, i + 40) };
            (Vec2::from_angle(TAU * random(seed, 2 * i + 1)) * out, radius)
        };
        let mut noise = FastNoiseLite::with_seed(seed as i32);
        noise.set_frequency(Some(2.2));
        noise.set_fractal_type(Some(FractalType::FBm));
        noise.set_fractal_octaves(Some(4));
        Self { balls: (0..BALLS).map(ball).collect(), noise }
    }

    pub(super) fn at(&self, at: Vec2) -> Texel {
        let height = self.height(at);
        if height <= 0.0 {
            return Texel::NONE;
        }
        let step = 0.02;
        let (right, up) = (Vec2::X * step, Vec2::Y * step);
        let rise = Vec2::new(
            self.height(at + right) - self.height(at - right),
            self.height(at + up) - self.height(at - up),
        );
        let normal = (-rise / (2.0 * step)).extend(1.0).normalize_or(Vec3::Z);
        // Hollows hold less light, and lumps differ.
        let lump = self.noise.get_noise_2d(1.4 * at.x + 20.0, 1.4 * at.y - 7.0);
        let shade = (0.62 + 0.3 * smoothstep(0.0, 0.6, height) + 0.25 * lump).clamp(0.2, 1.0);
        Texel { slope: normal.truncate(), shade, cover: smoothstep(0.0, 0.06, height) }
    }

    /// Above the plane of the tile, 0 outside.
    fn height(&self, at: Vec2) -> f32 {
        let rough = self.noise.get_noise_2d(at.x, at.y);
        let ball = |&(middle, radius): &(Vec2, f32)| {
            let fits = 1.0 - at.distance_squared(middle) / (radius * radius) + 0.55 * rough;
            fits.max(0.0).sqrt() * radius
        };
        self.balls.iter().map(ball).fold(0.0, f32::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places() -> impl Iterator<Item = Vec2> {
        (0..1600).map(|i| (Vec2::new((i % 40) as f32, (i / 40) as f32) + 0.5) / 20.0 - 1.0)
    }

    #[test]
    fn grains_are_convex() {
        for variant in 0..8 {
            let grain = Grain::new(variant);
            let inside: Vec<Vec2> = places().filter(|at| grain.at(*at).cover > 0.0).collect();
            assert!(inside.len() > 400, "{variant}: {}", inside.len());
            for pair in inside.iter().zip(inside.iter().rev()) {
                let middle = (*pair.0 + *pair.1) * 0.5;
                assert!(grain.at(middle).cover > 0.0, "{variant} {middle}");
            }
        }
    }

    #[test]
    fn grains_have_facets_of_their_own_brightness() {
        for variant in 0..8 {
            let grain = Grain::new(variant);
            let shades =
                places().map(|at| grain.at(at)).filter(|texel| texel.cover > 0.0).map(|texel| texel.shade);
            let (low, high) =
                shades.fold((1.0f32, 0.0f32), |(low, high), shade| (low.min(shade), high.max(shade)));
            assert!(high - low > 0.05, "{variant}: {low} {high}");
        }
    }

    #[test]
    fn clods_are_not_round() {
        for variant in 0..8 {
            let clod = Clod::new(variant);
            let reach = |turn: u32| {
                let along = Vec2::from_angle(TAU * turn as f32 / 24.0);
                (0..100)
                    .rev()
                    .map(|i| i as f32 / 80.0)
                    .find(|r| clod.at(along * *r).cover > 0.0)
                    .unwrap_or(0.0)
            };
            let (near, far) = (0..24).map(reach).fold((9.0f32, 0.0f32), |(a, b), r| (a.min(r), b.max(r)));
            assert!(far > 1.25 * near && near > 0.1, "{variant}: {near} {far}");
        }
    }
}
