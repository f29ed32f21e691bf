//! Mud that was thrown: a thick body with fingers that radiate from it, and what flew on ahead of them.
//!
//! Where it hit there is a crater, through which the ground shows, with a crown round it. The surface is lumpy and,
//! where it is thin, dry: lighter and rough.

use bevy::math::Vec2;

use super::field::{Matter, Shape};
use super::shapes::{Blob, Dice, Noise, bump, dome, edge, mix, nearest, smooth_min};

pub(super) struct Mud {
    middle: Vec2,
    radius: f32,
    fingers: Vec<Finger>,
    satellites: Vec<Blob>,
    /// Bends everything a little.
    warp: [Noise; 2],
    outline: Noise,
    crumbs: Noise,
    lumps: Noise,
    soft: f32,
}

struct Finger {
    stem: Blob,
    tip: Blob,
}

/// How far from the stamp's middle anything may lie.
const REACH: f32 = 0.88;

impl Mud {
    pub(super) fn new(dice: &mut Dice, soft: f32) -> Self {
        let middle = dice.in_disc() * 0.06;
        let radius = dice.between(0.42, 0.49);
        let count = dice.count(9, 14);
        let (mut fingers, mut satellites) = (Vec::new(), Vec::new());
        for direction in dice.all_round(count, 0.4) {
            let reach = mix(1.12 * radius, 0.84, dice.unit());
            let tip = dice.between(0.026, 0.055);
            let stem = [dice.between(0.07, 0.13), 0.75 * tip];
            let end = middle + direction * reach;
            fingers.push(Finger {
                stem: Blob::new(middle + direction * radius * 0.75, end, stem),
                tip: Blob::disc(end, 1.15 * tip),
            });
            // What tore off its tip, a little aside and drawn out along its way.
            let [gap, size, long, aside] =
                [(0.08, 0.20), (0.016, 0.036), (0.0, 0.05), (-0.05, 0.05)].map(|(a, b)| dice.between(a, b));
            let away = (reach + gap).min(REACH - size - long);
            if dice.unit() < 0.75 && away > reach + tip + size {
                let aside = middle + direction.perp() * aside;
                let ends = [away - long, away + long].map(|away| aside + direction * away);
                satellites.push(Blob::new(ends[0], ends[1], [size, 0.7 * size]));
            }
        }
        for _ in 0..dice.count(4, 9) {
            let away = dice.direction() * dice.between(0.55, REACH);
            satellites.push(Blob::disc(middle + away, dice.between(0.010, 0.024)));
        }
        Self {
            middle,
            radius,
            fingers,
            satellites,
            warp: [dice.noise(2), dice.noise(2)],
            outline: dice.noise(3),
            crumbs: dice.noise(3),
            lumps: dice.noise(3),
            soft,
        }
    }

    /// How far a point lies outside the body and its fingers.
    fn distance(&self, point: Vec2) -> f32 {
        let away = point - self.middle;
        let round = away.length() - self.radius * (1.0 + 0.20 * self.outline.round(away, 1.4));
        self.fingers.iter().fold(round, |distance, Finger { stem, tip }| {
            smooth_min(smooth_min(distance, stem.distance(point), 0.09), tip.distance(point), 0.05)
        })
    }
}

impl Shape for Mud {
    fn at(&self, point: Vec2) -> Matter {
        let [bent_u, bent_v] = [0, 1].map(|axis| self.warp[axis].at(point * 3.0));
        let bent = point + 0.055 * Vec2::new(bent_u, bent_v);
        let (crumbs, lumps) = (self.crumbs.at(point * 9.0), self.lumps.at(point * 4.5));
        let depth = -self.distance(bent) - 0.016 * crumbs;
        let stray = -nearest(&self.satellites, bent);

        let from_crown = bent.distance(self.middle) - 0.80 * self.radius;
        let crater = bump((1.0 + from_crown / (0.80 * self.radius)).min(1.0));
        let crown = bump(from_crown / (0.38 * self.radius));
        let rise = dome(depth, 0.11);
        let body = 0.045 + 0.045 * dome(depth, 0.30) + 0.050 * crown - 0.060 * crater;
        let height = (rise * (body * (1.0 + 0.45 * lumps) + 0.020 * crumbs)).max(0.025 * dome(stray, 0.03));

        let shows = 0.55 * crater * (0.6 + 1.1 * lumps).clamp(0.0, 1.0);
        let cover = edge(-depth, 0.8 * self.soft).max(0.95 * edge(-stray, 0.7 * self.soft)) * (1.0 - shows);
        let dry = (1.0 - height / 0.13 + 0.35 * crumbs).clamp(0.0, 1.0);
        let shade = mix(0.62, 1.0, dry);
        Matter {
            height,
            cover,
            // Dry mud is not only lighter but greyer; this is over the mud's own colour, so wet is a little warmer.
            tint: [shade, shade * mix(0.97, 1.0, dry), shade * mix(0.93, 1.0, dry)],
            reflectance: 0.40,
            smoothness: (0.42 - 0.30 * dry + 0.06 * lumps).clamp(0.0, 1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::shapes::direction;
    use super::*;

    #[test]
    fn there_is_a_crater_within_a_crown() {
        for variant in 0..8 {
            let mud = Mud::new(&mut Dice::new(3, 2, variant), 0.04);
            let ring = |radius: f32| {
                let at = |i: u32| mud.middle + direction(i as f32 / 32.0) * radius;
                (0..32).map(|i| mud.at(at(i)).height).sum::<f32>() / 32.0
            };
            let (middle, crown, rim) = (ring(0.05), ring(0.75 * mud.radius), ring(1.4 * mud.radius));
            assert!(crown > 2.0 * middle && crown > 2.0 * rim, "{variant}: {middle} {crown} {rim}");
        }
    }

    #[test]
    fn where_it_is_thin_it_is_dry() {
        let mud = Mud::new(&mut Dice::new(3, 2, 0), 0.04);
        let mut points: Vec<Matter> = (0..4096)
            .map(|i| mud.at(Vec2::new((i % 64) as f32, (i / 64) as f32) / 32.0 - 1.0))
            .filter(|matter| matter.cover > 0.9)
            .collect();
        points.sort_by(|a, b| a.height.total_cmp(&b.height));
        let mean = |points: &[Matter], of: fn(&Matter) -> f32| {
            points.iter().map(of).sum::<f32>() / points.len() as f32
        };
        let (thin, thick) = points.split_at(points.len() / 2);
        assert!(mean(thin, |matter| matter.tint[0]) > 0.05 + mean(thick, |matter| matter.tint[0]));
        assert!(mean(thin, |matter| matter.smoothness) < mean(thick, |matter| matter.smoothness) - 0.05);
    }
}
