//! What marks are made of: dice, noise, blobs and grains.
//!
//! Angles never pass through a sine or cosine, and nothing but addition, multiplication, division, rounding and
//! square roots is used on numbers: all exactly defined, so that marks are the same on any machine.

use std::f32::consts::FRAC_PI_4;

use bevy::math::Vec2;
use fastnoise_lite::{FastNoiseLite, FractalType, NoiseType};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::Rng;

use crate::material::film::ripples::pcg;

/// The random numbers of one mark.
pub(super) struct Dice(Pcg32);

impl Dice {
    pub(super) fn new(seed: u64, kind: u32, variant: u32) -> Self {
        Self(Pcg32::new(seed, u64::from(kind) << 32 | u64::from(variant)))
    }

    /// From 0 up to, but not including, 1.
    pub(super) fn unit(&mut self) -> f32 {
        unit(self.0.next_u32())
    }

    pub(super) fn between(&mut self, least: f32, most: f32) -> f32 {
        least + (most - least) * self.unit()
    }

    /// A whole number, both ends included.
    pub(super) fn count(&mut self, least: u32, most: u32) -> u32 {
        least + (self.unit() * (most - least + 1) as f32) as u32
    }

    pub(super) fn direction(&mut self) -> Vec2 {
        direction(self.unit())
    }

    /// An even point in the unit disc.
    pub(super) fn in_disc(&mut self) -> Vec2 {
        let radius = self.unit().sqrt();
        self.direction() * radius
    }

    /// Directions all round, as many as `count`, each off its place by at most `jitter` of the way to the next.
    pub(super) fn all_round(&mut self, count: u32, jitter: f32) -> Vec<Vec2> {
        let start = self.unit();
        let turns = |i: u32, off: f32| (i as f32 + off) / count as f32 + start;
        (0..count).map(|i| direction(turns(i, self.between(-jitter, jitter)))).collect()
    }

    /// Fractal Perlin noise, about -1 to 1, with one feature per unit of length.
    pub(super) fn noise(&mut self, octaves: i32) -> Noise {
        // Each octave counts the seed up by one: 24 bits leave room for that.
        let mut source = FastNoiseLite::with_seed((self.0.next_u32() & 0xff_ffff) as i32);
        source.set_noise_type(Some(NoiseType::Perlin));
        source.set_frequency(Some(1.0));
        source.set_fractal_type(Some(FractalType::FBm));
        source.set_fractal_octaves(Some(octaves));
        Noise(source)
    }

    /// Grains, `per_unit` cells to a unit of length.
    pub(super) fn cells(&mut self, per_unit: f32) -> Cells {
        Cells { per_unit, seed: self.0.next_u32() }
    }
}

pub(super) struct Noise(FastNoiseLite);

impl Noise {
    pub(super) fn at(&self, point: Vec2) -> f32 {
        self.0.get_noise_2d(point.x, point.y)
    }

    /// Noise along a circle round the origin, by the direction of a point from there.
    pub(super) fn round(&self, from_middle: Vec2, features: f32) -> f32 {
        // Far from the lattice's origin, where Perlin noise is 0.
        self.at(from_middle / (from_middle.length() + 1e-6) * features + Vec2::new(11.3, 5.7))
    }
}

/// A disc drawn along a line, its radius changing from one end to the other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Blob {
    from: Vec2,
    to: Vec2,
    radii: [f32; 2],
}

impl Blob {
    pub(super) fn new(from: Vec2, to: Vec2, radii: [f32; 2]) -> Self {
        Self { from, to, radii }
    }

    pub(super) fn disc(middle: Vec2, radius: f32) -> Self {
        Self::new(middle, middle, [radius; 2])
    }

    /// How far a point lies outside; negative inside.
    pub(super) fn distance(&self, point: Vec2) -> f32 {
        let run = self.to - self.from;
        let away = point - self.from;
        let along = (away.dot(run) / run.length_squared().max(1e-12)).clamp(0.0, 1.0);
        (away - run * along).length() - mix(self.radii[0], self.radii[1], along)
    }
}

/// How far a point lies outside the nearest of some blobs, `FAR` if there are none.
pub(super) fn nearest(blobs: &[Blob], point: Vec2) -> f32 {
    blobs.iter().map(|blob| blob.distance(point)).fold(FAR, f32::min)
}

const FAR: f32 = 9.0;

/// The smaller of two distances, with a fillet where they differ by less than `fillet` (Quilez, *Smooth minimum*).
pub(super) fn smooth_min(a: f32, b: f32, fillet: f32) -> f32 {
    let near = (fillet - (a - b).abs()).max(0.0) / fillet;
    a.min(b) - near * near * fillet * 0.25
}

/// Points scattered one to a cell, apart from each other.
pub(super) struct Cells {
    per_unit: f32,
    seed: u32,
}

pub(super) struct Grain {
    pub(super) middle: Vec2,
    /// From the point that was asked about, in cells.
    pub(super) distance: f32,
    number: u32,
}

impl Cells {
    /// The grains of the nine cells around a point.
    pub(super) fn around(&self, point: Vec2) -> impl Iterator<Item = Grain> {
        let at = point * self.per_unit;
        let home = at.floor();
        let (per_unit, seed) = (self.per_unit, self.seed);
        (0..9u8).map(move |i| {
            let cell = home + Vec2::new(f32::from(i % 3) - 1.0, f32::from(i / 3) - 1.0);
            let number = pcg(pcg(seed ^ cell.x as i32 as u32) ^ cell.y as i32 as u32);
            let jitter = Vec2::new((number >> 16) as f32, (number & 0xffff) as f32) / 65_536.0;
            // Not up to the cell's edges, which keeps grains apart.
            let middle = cell + 0.15 + 0.7 * jitter;
            Grain { middle: middle / per_unit, distance: at.distance(middle), number }
        })
    }
}

impl Grain {
    /// A random number of the grain's own, `0..1`, one for each `which`.
    pub(super) fn chance(&self, which: u32) -> f32 {
        unit(pcg(self.number.wrapping_add(which)))
    }
}

/// A unit vector, `turns` from +u towards +v. Off by at most 0.0002 rad.
pub(super) fn direction(turns: f32) -> Vec2 {
    let quarter = (turns * 4.0 + 0.5).floor();
    let half_angle = (turns * 4.0 - quarter) * FRAC_PI_4;
    let square = half_angle * half_angle;
    let tangent = half_angle * (1.0 + square * (1.0 / 3.0 + square * (2.0 / 15.0)));
    let scale = 1.0 / (1.0 + tangent * tangent);
    let (cos, sin) = ((1.0 - tangent * tangent) * scale, 2.0 * tangent * scale);
    match quarter.rem_euclid(4.0) as u32 {
        0 => Vec2::new(cos, sin),
        1 => Vec2::new(-sin, cos),
        2 => Vec2::new(-cos, -sin),
        _ => Vec2::new(sin, -cos),
    }
}

pub(super) fn mix(a: f32, b: f32, part: f32) -> f32 {
    a + (b - a) * part
}

pub(super) fn smoothstep(low: f32, high: f32, value: f32) -> f32 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// How much of a point is covered that lies `distance` outside: 1 inside to 0 outside, over `soft` to either side.
pub(super) fn edge(distance: f32, soft: f32) -> f32 {
    smoothstep(soft, -soft, distance)
}

/// 1 at 0, falling to 0 at -1 and 1.
pub(super) fn bump(t: f32) -> f32 {
    let rest = (1.0 - t * t).max(0.0);
    rest * rest
}

/// Rises from 0 at the rim to 1 at a depth of `width`, steeply first.
pub(super) fn dome(depth: f32, width: f32) -> f32 {
    let t = (depth / width).clamp(0.0, 1.0);
    t * (2.0 - t)
}

/// The upper 24 of 32 random bits, the most that an `f32` holds.
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 / 16_777_216.0
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use super::*;

    #[test]
    fn directions_go_round_and_are_of_unit_length() {
        for i in -40..80 {
            let turns = i as f32 / 37.0;
            let (direction, expected) = (direction(turns), Vec2::from_angle(TAU * turns));
            assert!(direction.distance(expected) < 2e-4, "{turns}: {direction} for {expected}");
            assert!((direction.length() - 1.0).abs() < 1e-6, "{turns}");
        }
    }

    #[test]
    fn a_blob_is_a_disc_at_either_end() {
        let blob = Blob::new(Vec2::ZERO, Vec2::new(2.0, 0.0), [0.5, 0.1]);
        for (point, distance) in [
            (Vec2::new(-1.0, 0.0), 0.5),
            (Vec2::new(3.0, 0.0), 0.9),
            (Vec2::new(1.0, 1.0), 0.7),
            (Vec2::ZERO, -0.5),
        ] {
            assert!((blob.distance(point) - distance).abs() < 1e-6, "{point}");
        }
        assert!((Blob::disc(Vec2::ONE, 0.25).distance(Vec2::new(1.0, 2.0)) - 0.75).abs() < 1e-6);
    }

    #[test]
    fn a_fillet_only_ever_adds_and_ends_where_it_should() {
        assert_eq!(smooth_min(1.0, 3.0, 0.5), 1.0);
        assert!((smooth_min(1.0, 1.0, 0.4) - 0.9).abs() < 1e-6);
        assert!(smooth_min(1.0, 1.2, 0.4) < 1.0);
    }

    #[test]
    fn grains_are_known_from_all_places_near_and_keep_apart() {
        let cells = Dice::new(1, 2, 3).cells(8.0);
        let at = |point: Vec2| {
            cells.around(point).map(|grain| (grain.middle.x.to_bits(), grain.middle.y.to_bits()))
        };
        // Two neighbouring cells share six of their nine.
        let here: Vec<_> = at(Vec2::new(-0.05, 0.3)).collect();
        assert_eq!(at(Vec2::new(0.05, 0.3)).filter(|grain| here.contains(grain)).count(), 6);
        let grains: Vec<Vec2> = cells.around(Vec2::ZERO).map(|grain| grain.middle).collect();
        for (i, a) in grains.iter().enumerate() {
            assert!(grains[..i].iter().all(|b| a.distance(*b) > 0.25 / 8.0));
        }
    }
}
