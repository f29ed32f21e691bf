//! The ingredients of a recipe: noise, grains, spots and scratches, all of which repeat over the tile.

use bevy::math::{IVec2, Vec2};
use fastnoise_lite::NoiseType;

pub(super) use crate::scenes::noise::{Noise, hash, smoothstep, unit};

/// Makes the ingredients of a recipe, each with its own random numbers.
#[derive(Clone, Copy)]
pub(super) struct Layers {
    pub(super) seed: u32,
    /// The most cells per tile that the texels can still show.
    pub(super) finest: f32,
    /// Edge of the tile, for what is measured in millimetres.
    pub(super) tile_mm: f32,
}

impl Layers {
    /// Noise with `cycles` features per tile along u and v and `octaves` finer ones.
    pub(super) fn noise(self, layer: u32, cycles: Vec2, octaves: i32) -> Noise {
        let cycles = cycles.min(Vec2::splat(self.finest));
        Noise::new(NoiseType::OpenSimplex2, hash([self.seed, layer, 0]), cycles, octaves)
    }

    /// `per_side * per_side` cells per tile.
    pub(super) fn cells(self, layer: u32, per_side: f32) -> Cells {
        let per_side = per_side.min(self.finest).max(1.0) as i32;
        Cells { per_side, cell_mm: self.tile_mm / per_side as f32, seed: hash([self.seed, layer, 1]) }
    }

    pub(super) fn scratches(self, layer: u32, count: u32) -> Scratches {
        let scratch = |i: u32| {
            let random = |j: u32| unit(hash([self.seed ^ layer, i, j]));
            let angle = (random(0) - 0.5) * 2.4;
            Scratch {
                middle: Vec2::new(random(1), random(2)),
                along: Vec2::from_angle(angle),
                half_length: 0.02 + 0.16 * random(3) * random(4),
                half_width: 0.0006 + 0.0008 * random(5),
                strength: 0.3 + 0.7 * random(6),
            }
        };
        Scratches((0..count).map(scratch).collect())
    }
}

/// Points scattered one to a cell over the unit square, repeating.
pub(super) struct Cells {
    per_side: i32,
    cell_mm: f32,
    seed: u32,
}

/// The point next to a place.
pub(super) struct Grain {
    /// Distances to the nearest point and to the one after it, in cells.
    nearest: f32,
    second: f32,
    number: u32,
}

impl Grain {
    /// 0 where it meets the next, towards 1 in the middle of a large one.
    pub(super) fn inside(&self) -> f32 {
        // All points within one cell's width are known, of those beyond only some.
        self.second.min(1.0) - self.nearest.min(1.0)
    }

    /// Height of a dome over the grain, 0 where it meets the next, at most 1.
    pub(super) fn dome(&self) -> f32 {
        1.0 - (1.0 - self.inside()).powi(2)
    }

    /// A random number of the grain's own, `0..1`, one for each `which`.
    pub(super) fn chance(&self, which: u32) -> f32 {
        unit(hash([self.number, which, 2]))
    }
}

impl Cells {
    /// The points of the nine cells around a place: distance in cells, and number.
    fn around(&self, uv: Vec2) -> impl Iterator<Item = (f32, u32)> {
        let at = uv * self.per_side as f32;
        let home = at.floor().as_ivec2();
        let (per_side, seed) = (self.per_side, self.seed);
        (0..9).map(move |i| {
            let cell = home + IVec2::new(i % 3 - 1, i / 3 - 1);
            let (x, y) = (cell.x.rem_euclid(per_side) as u32, cell.y.rem_euclid(per_side) as u32);
            let number = hash([seed, x, y]);
            let jitter = Vec2::new((number >> 16) as f32, (number & 0xffff) as f32) / 65536.0;
            (at.distance(cell.as_vec2() + jitter), number)
        })
    }

    pub(super) fn nearest(&self, uv: Vec2) -> Grain {
        let mut grain = Grain { nearest: f32::MAX, second: f32::MAX, number: 0 };
        for (distance, number) in self.around(uv) {
            if distance < grain.nearest {
                grain = Grain { nearest: distance, second: grain.nearest, number };
            } else {
                grain.second = grain.second.min(distance);
            }
        }
        grain
    }

    /// Height of a grain in millimetres, 0 where it meets the next; `rise` is in widths of a cell.
    pub(super) fn dome_mm(&self, grain: &Grain, rise: f32) -> f32 {
        rise * self.cell_mm * grain.dome()
    }

    /// How far it is at least to where the grain meets the next, in millimetres: exactly so far on the line
    /// from the one's point to the other's.
    pub(super) fn border_mm(&self, grain: &Grain) -> f32 {
        0.5 * self.cell_mm * grain.inside()
    }

    /// Round spots, 1 in the middle and 0 at the edge and outside. `share` of the cells have one, with a
    /// radius between `least` and `most` cells (below 0.5), small ones more often.
    pub(super) fn spot(&self, uv: Vec2, share: f32, least: f32, most: f32) -> f32 {
        let spot = |(distance, number): (f32, u32)| {
            if distance >= most || unit(hash([number, 4, 4])) >= share {
                return 0.0;
            }
            let radius = least + (most - least) * unit(hash([number, 5, 5])).powi(2);
            (1.0 - distance / radius).max(0.0)
        };
        self.around(uv).map(spot).fold(0.0, f32::max)
    }
}

/// A straight, shallow groove.
struct Scratch {
    middle: Vec2,
    along: Vec2,
    half_length: f32,
    half_width: f32,
    strength: f32,
}

pub(super) struct Scratches(Vec<Scratch>);

impl Scratches {
    /// 0 beside the scratches to 1 in the deepest.
    pub(super) fn depth(&self, uv: Vec2) -> f32 {
        let depth = |scratch: &Scratch| {
            let away = uv - scratch.middle;
            let away = away - away.round();
            let along = away.dot(scratch.along).abs() / scratch.half_length;
            let across = away.perp_dot(scratch.along).abs() / scratch.half_width;
            scratch.strength * (1.0 - across).max(0.0) * (1.0 - along * along).max(0.0)
        };
        self.0.iter().map(depth).fold(0.0, f32::max)
    }
}
