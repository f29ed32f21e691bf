//! A clump of snow: crystals with six arms, on grains of broken ones.

use bevy::math::Vec2;

use super::field::{Matter, Shape};
use super::shapes::{Blob, Cells, Dice, Noise, bump, direction, dome, mix, smoothstep};

pub(super) struct Snow {
    heap: Noise,
    grains: Cells,
    crystals: Vec<Crystal>,
    soft: f32,
}

struct Crystal {
    middle: Vec2,
    /// Along one of its arms.
    along: Vec2,
    radius: f32,
    /// How high it lies.
    lift: f32,
    habit: &'static Habit,
    arm: Blob,
    branches: Vec<Blob>,
}

/// What a crystal is like; lengths in its radii.
struct Habit {
    /// Half the width across the flats of the plate in its middle.
    plate: f32,
    /// Half the width of an arm.
    arm: f32,
    /// Where branches leave the arm, and how long they are.
    branches: &'static [(f32, f32)],
}

const HABITS: [Habit; 4] = [
    // A star.
    Habit { plate: 0.16, arm: 0.085, branches: &[(0.45, 0.30), (0.72, 0.22)] },
    // A plate with arms.
    Habit { plate: 0.30, arm: 0.10, branches: &[(0.62, 0.28)] },
    // A plate with short arms.
    Habit { plate: 0.42, arm: 0.11, branches: &[(0.70, 0.16)] },
    // A fern.
    Habit { plate: 0.12, arm: 0.10, branches: &[(0.35, 0.34), (0.58, 0.26), (0.80, 0.14)] },
];

/// Cosine and sine of 30 degrees.
const THIRTY: [f32; 2] = [0.866_025_4, 0.5];

impl Snow {
    pub(super) fn new(dice: &mut Dice, soft: f32) -> Self {
        let heap = dice.noise(2);
        let grains = dice.cells(15.0);
        let count = dice.count(6, 9);
        let crystals = (0..count).map(|i| {
            let radius = if i < 3 { dice.between(0.32, 0.44) } else { dice.between(0.20, 0.32) };
            let middle = dice.in_disc() * (0.92 - radius);
            let raised = (1.0 - middle.length_squared() / 0.6).max(0.0);
            Crystal::new(dice, middle, radius, 0.035 + 0.05 * raised)
        });
        let crystals = crystals.collect();
        Self { heap, grains, crystals, soft }
    }
}

impl Crystal {
    fn new(dice: &mut Dice, middle: Vec2, radius: f32, most_lift: f32) -> Self {
        let habit = &HABITS[dice.count(0, HABITS.len() as u32 - 1) as usize];
        // A sixth of a turn is all there is.
        let along = direction(dice.unit() / 6.0);
        let lift = mix(0.035, most_lift, dice.unit());
        let width = habit.arm * radius;
        let branch = |&(start, length): &(f32, f32)| {
            let start = Vec2::new(start * radius, 0.0);
            // At sixty degrees from the arm.
            let end = start + Vec2::new(THIRTY[1], THIRTY[0]) * length * radius;
            Blob::new(start, end, [0.8 * width, 0.55 * width])
        };
        Self {
            middle,
            along,
            radius,
            lift,
            habit,
            arm: Blob::new(Vec2::ZERO, Vec2::new(radius, 0.0), [width, 0.7 * width]),
            branches: habit.branches.iter().map(branch).collect(),
        }
    }

    /// How far a point lies outside.
    fn distance(&self, point: Vec2) -> f32 {
        let away = point - self.middle;
        let wedge = folded(Vec2::new(away.dot(self.along), self.along.perp_dot(away)));
        let flat = wedge.dot(Vec2::from_array(THIRTY)) - self.habit.plate * self.radius;
        let nearest = |distance: f32, blob: &Blob| distance.min(blob.distance(wedge));
        self.branches.iter().chain([&self.arm]).fold(flat, nearest)
    }
}

/// Brought into the twelfth of a turn beside +u by the mirrors of a hexagon.
fn folded(point: Vec2) -> Vec2 {
    let mut point = point.abs();
    for mirror in [Vec2::new(THIRTY[0], -THIRTY[1]), Vec2::new(THIRTY[1], -THIRTY[0])] {
        point -= 2.0 * point.dot(mirror).min(0.0) * mirror;
    }
    point
}

impl Shape for Snow {
    fn at(&self, point: Vec2) -> Matter {
        let middle = (1.0 - point.length_squared() / 0.40).max(0.0);
        let heap = (middle * (0.85 + 0.9 * self.heap.at(point * 3.0))).clamp(0.0, 1.0);
        let grain = self.grains.around(point).map(|grain| {
            let size = grain.chance(1);
            let share = (0.9 - grain.middle.length_squared() / 0.60).clamp(0.0, 1.0);
            if size < 1.35 * share { bump((grain.distance / (0.45 + 0.3 * size)).min(1.0)) } else { 0.0 }
        });
        let grain = grain.fold(0.0, f32::max);
        let mut height = 0.05 * heap + 0.045 * grain;
        let mut cover = (0.45 * smoothstep(0.10, 0.55, heap)).max(0.62 * smoothstep(0.15, 0.50, grain));
        let mut shade = 0.84 + 0.12 * grain;
        let mut smoothness = 0.22;
        for crystal in &self.crystals {
            let distance = crystal.distance(point);
            let here = smoothstep(0.7 * self.soft, -0.5 * self.soft, distance);
            if here > 0.0 {
                let top = crystal.lift + 0.030 * dome(0.5 * self.soft - distance, 0.05);
                height = height.max(top * smoothstep(0.9 * self.soft, -0.6 * self.soft, distance));
                cover = cover.max(0.97 * here);
                shade = f32::max(shade, 0.80 + 0.20 * here);
                smoothness = f32::max(smoothness, 0.25 + 0.30 * here);
            }
        }
        // Ice is a trace of blue.
        let tint = [0.965, 0.985, 1.0].map(|channel| shade * channel);
        Matter { height, cover, tint, reflectance: 0.35, smoothness }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crystals_are_the_same_after_a_sixth_of_a_turn_and_in_a_mirror() {
        let mut dice = Dice::new(2, 4, 0);
        let sixth = Vec2::new(THIRTY[1], THIRTY[0]);
        for _ in 0..8 {
            let crystal = Crystal::new(&mut dice, Vec2::new(0.1, -0.2), 0.4, 0.05);
            let mut different = false;
            for i in 0..200 {
                let away = dice.in_disc() * 0.5;
                let distance = crystal.distance(crystal.middle + away);
                let turned = crystal.distance(crystal.middle + sixth.rotate(away));
                assert!((distance - turned).abs() < 1e-5, "{i}: {away}");
                let mirrored = away - 2.0 * away.dot(crystal.along.perp()) * crystal.along.perp();
                let mirrored = crystal.distance(crystal.middle + mirrored);
                assert!((distance - mirrored).abs() < 1e-5, "{i}: {away}");
                // But not after any turn.
                let twelfth = Vec2::from_array(THIRTY).rotate(away);
                different |= (distance - crystal.distance(crystal.middle + twelfth)).abs() > 0.02;
            }
            assert!(different);
        }
    }

    #[test]
    fn arms_are_matter_and_the_gaps_between_them_are_not() {
        let mut dice = Dice::new(2, 4, 1);
        for _ in 0..8 {
            let crystal = Crystal::new(&mut dice, Vec2::ZERO, 0.4, 0.05);
            let gap = Vec2::from_array(THIRTY).rotate(crystal.along);
            assert!(crystal.distance(crystal.along * 0.35) < 0.0 && crystal.distance(gap * 0.35) > 0.0);
        }
    }
}
