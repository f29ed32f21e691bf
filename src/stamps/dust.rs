//! Dust where it settled: a thin haze with grains in it, thicker in clumps, ragged towards its edge.

use bevy::math::Vec2;

use super::field::{Matter, Shape};
use super::shapes::{Cells, Dice, Noise, bump, mix, smoothstep};

pub(super) struct Dust {
    clumps: Noise,
    mottle: Noise,
    fine: Layer,
    coarse: Layer,
}

/// Grains of about one size. Radii are in cells.
struct Layer {
    cells: Cells,
    per_unit: f32,
    radius: [f32; 2],
    /// Part of the cells that have a grain, where dust is thick.
    share: f32,
}

impl Dust {
    pub(super) fn new(dice: &mut Dice) -> Self {
        let (fine, coarse) = (26.0, 13.0);
        Self {
            clumps: dice.noise(3),
            mottle: dice.noise(2),
            fine: Layer { cells: dice.cells(fine), per_unit: fine, radius: [0.20, 0.46], share: 1.28 },
            coarse: Layer { cells: dice.cells(coarse), per_unit: coarse, radius: [0.14, 0.30], share: 0.74 },
        }
    }

    /// How thick it lies, 0..=1; 0 from a radius of 0.95 on.
    fn thickness(&self, point: Vec2) -> f32 {
        let clumps = self.clumps.at(point * 1.7);
        let towards_edge = (1.0 - point.length_squared() * 1.12).max(0.0);
        (towards_edge * (0.55 + 0.55 * towards_edge + 1.5 * clumps)).clamp(0.0, 1.0)
    }
}

impl Shape for Dust {
    fn at(&self, point: Vec2) -> Matter {
        let haze = self.thickness(point);
        let mut matter = Matter {
            height: 0.012 * haze,
            cover: haze * (0.50 + 0.22 * self.mottle.at(point * 14.0)),
            tint: [0.93; 3],
            reflectance: 0.45,
            smoothness: 0.06,
        };
        for layer in [&self.fine, &self.coarse] {
            for grain in layer.cells.around(point) {
                let thickness = self.thickness(grain.middle);
                if grain.chance(1) >= layer.share * thickness {
                    continue;
                }
                let large = grain.chance(2);
                let radius = mix(layer.radius[0], layer.radius[1], large * large);
                let cover = smoothstep(1.15, 0.55, grain.distance / radius)
                    * (0.55 + 0.40 * (1.6 * thickness).min(1.0));
                if cover > matter.cover {
                    matter.cover = cover;
                    matter.tint = [mix(0.72, 1.0, grain.chance(3)); 3];
                }
                let dome = bump((grain.distance / (1.15 * radius)).min(1.0));
                matter.height = matter.height.max(0.55 * radius / layer.per_unit * dome);
            }
        }
        matter
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_thins_out_towards_its_edge() {
        for variant in 0..6 {
            let dust = Dust::new(&mut Dice::new(9, 3, variant));
            let covered = |least: f32, most: f32| {
                let points = (0..10_000).map(|i| Vec2::new((i % 100) as f32, (i / 100) as f32) / 50.0 - 0.99);
                let points: Vec<Vec2> =
                    points.filter(|point| (least..most).contains(&point.length())).collect();
                points.iter().map(|&point| dust.at(point).cover).sum::<f32>() / points.len() as f32
            };
            let (inner, outer) = (covered(0.0, 0.5), covered(0.7, 0.9));
            assert!(inner > 2.0 * outer && outer > 0.0 && inner < 0.8, "{variant}: {inner} {outer}");
            assert_eq!(dust.thickness(Vec2::new(0.6, 0.75)), 0.0);
        }
    }
}
