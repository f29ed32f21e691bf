//! Water that ran: a slug broke up at the upper end and runs down (+v) from there, wide first, to a heavy toe.
//!
//! As a drop it leaves a rim, on both sides of its way, and little between.

use bevy::math::Vec2;

use super::drop::WATER_REFLECTANCE;
use super::field::{Matter, Shape};
use super::shapes::{Blob, Dice, Noise, bump, dome, edge, mix, nearest, smooth_min};

pub(super) struct Runnel {
    /// Where it hit.
    head: Vec2,
    outline: Noise,
    /// Fingers, pieces of the runs and their toes, each with its fillet.
    pieces: Vec<(Blob, f32)>,
    toes: Vec<Toe>,
    satellites: Vec<Blob>,
    bend: Noise,
    stain: Noise,
    soft: f32,
}

struct Toe {
    middle: Vec2,
    radius: f32,
}

/// Pieces of a run.
const PIECES: u32 = 9;

/// Half as wide as the rim.
const RIM: f32 = 0.055;

const HEAD_RADIUS: f32 = 0.27;

impl Runnel {
    pub(super) fn new(dice: &mut Dice, soft: f32) -> Self {
        let head = Vec2::new(dice.between(-0.05, 0.05), -0.52);
        let count = dice.count(5, 8);
        let fingers = dice.all_round(count, 0.4).into_iter().map(|direction| {
            let size = dice.between(0.03, 0.06);
            (Blob::disc(head + direction * dice.between(0.24, 0.31), size), 0.06)
        });
        let mut runnel = Self {
            head,
            pieces: fingers.collect(),
            toes: Vec::new(),
            satellites: Vec::new(),
            outline: dice.noise(2),
            bend: dice.noise(2),
            stain: dice.noise(3),
            soft,
        };
        let [aside, end] = [dice.between(-0.05, 0.05), dice.between(0.70, 0.82)];
        runnel.run(dice, aside, 0.115, end);
        // Lesser ones beside it, which stop earlier.
        let mut side = if dice.unit() < 0.5 { 1.0 } else { -1.0 };
        for _ in 0..dice.count(1, 2) {
            let [aside, width, end] =
                [(0.20, 0.30), (0.05, 0.07), (-0.15, 0.40)].map(|(a, b)| dice.between(a, b));
            runnel.run(dice, side * aside, width, end);
            side = -side;
        }
        for _ in 0..dice.count(3, 6) {
            let middle = head + dice.direction() * dice.between(0.36, 0.40);
            runnel.satellites.push(Blob::disc(middle, dice.between(0.014, 0.032)));
        }
        runnel
    }

    /// Lets water run from the head, `aside` of it, down to `end`.
    fn run(&mut self, dice: &mut Dice, aside: f32, half_width: f32, end: f32) {
        let drift = dice.noise(2);
        let head = self.head;
        let start = head + Vec2::new(0.55 * aside, 0.06);
        // Narrows over its first half.
        let width = |along: f32| half_width * (1.25 - 0.55 * (2.0 * along).min(1.0));
        let place = |along: f32| {
            let off = 0.16 * along * drift.at(Vec2::new(2.3 * along, 0.5));
            Vec2::new(head.x + aside * (0.55 + 1.2 * along).min(1.0) + off, mix(start.y, end, along))
        };
        let mut last = start;
        for i in 1..=PIECES {
            let [before, here] = [i - 1, i].map(|i| i as f32 / PIECES as f32);
            let next = place(here);
            self.pieces.push((Blob::new(last, next, [width(before), width(here)]), 0.05));
            last = next;
        }
        let radius = 1.18 * half_width;
        let middle = last - Vec2::new(0.0, 0.5 * radius);
        self.pieces.push((Blob::disc(middle, radius), 0.06));
        self.toes.push(Toe { middle, radius });
    }

    fn distance(&self, point: Vec2) -> f32 {
        let away = (point - self.head) * Vec2::new(1.0, 1.1);
        let round = away.length() - HEAD_RADIUS * (1.0 + 0.22 * self.outline.round(away, 1.3));
        let joined =
            |distance, &(piece, fillet): &(Blob, f32)| smooth_min(distance, piece.distance(point), fillet);
        self.pieces.iter().fold(round, joined)
    }
}

impl Shape for Runnel {
    fn at(&self, point: Vec2) -> Matter {
        let bent = point + Vec2::new(0.035 * self.bend.at(point * 3.2), 0.0);
        let stain = self.stain.at(point * Vec2::new(6.0, 2.5));
        let depth = -self.distance(bent);
        let stray = -nearest(&self.satellites, bent);

        let mut height = 0.012 * dome(stray, 0.025);
        if depth > 0.0 {
            let inside = dome(depth, 0.07);
            let ridge = bump((depth - RIM) / RIM);
            let swollen = |toe: &Toe| {
                let away = (bent - toe.middle) * Vec2::new(1.0, 0.7);
                0.42 * toe.radius * bump((away.length() / (1.6 * toe.radius)).min(1.0))
            };
            let toes: f32 = self.toes.iter().map(swollen).sum();
            height = height.max(0.016 * ridge + inside * (0.018 * (1.0 + 0.3 * stain) + toes));
        }
        let ring = bump((depth - 0.5 * RIM) / (0.9 * RIM));
        let cover = (0.52 + 0.20 * stain).max(0.92 * ring) * edge(-depth, self.soft);
        Matter {
            height,
            cover: cover.max(0.85 * edge(-stray, 0.7 * self.soft)),
            tint: [1.0; 3],
            reflectance: WATER_REFLECTANCE,
            smoothness: 0.82 + 0.10 * ring,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_longer_than_wide_and_ends_in_a_toe() {
        for variant in 0..8 {
            let runnel = Runnel::new(&mut Dice::new(1, 5, variant), 0.04);
            let points = (0..10_000).map(|i| Vec2::new((i % 100) as f32, (i / 100) as f32) / 50.0 - 0.99);
            let covered: Vec<Vec2> = points.filter(|&point| runnel.at(point).cover > 0.3).collect();
            let extent = |of: fn(&Vec2) -> f32| {
                let values = covered.iter().map(of);
                values.clone().fold(f32::MIN, f32::max) - values.fold(f32::MAX, f32::min)
            };
            let (wide, long) = (extent(|point| point.x), extent(|point| point.y));
            assert!(long > 1.4 * wide && long > 1.3, "{variant}: {wide} {long}");
            let toe = &runnel.toes[0];
            let [heavy, thin] = [toe.middle, runnel.head].map(|point| runnel.at(point).height);
            assert!(heavy > 1.5 * thin, "{variant}: {heavy} {thin}");
        }
    }
}
