//! Snow crystals: six arms, each its own mirror image.
//!
//! All of a crystal is drawn within a twelfth of the circle, between an arm and the line midway to the next, and folded
//! round: a hexagonal plate in the middle, an arm with side branches at 60 degrees, and a small plate at its end. Which of
//! them there are, and how large, is the crystal's habit (Nakaya 1954; Libbrecht 2005, *The physics of snow crystals*).

use std::f32::consts::{FRAC_PI_3, FRAC_PI_6};

use bevy::math::Vec2;

use super::sprites::{Texel, smoothstep};

/// What a crystal grew into. Lengths in radii of the whole.
struct Habit {
    /// From the middle to a corner of the plate.
    plate: f32,
    /// Length of an arm.
    arm: f32,
    /// Half its width.
    arm_width: f32,
    /// Side branches on each side of an arm.
    branches: u32,
    /// Where the first begins.
    first: f32,
    /// Length of a branch, in parts of the longest there is room for.
    reach: f32,
    /// Half its width.
    branch_width: f32,
    /// From the middle to a corner of the plate at the end of an arm.
    tip: f32,
}

#[rustfmt::skip]
static HABITS: [Habit; 8] = [
    // A plate with ribs.
    Habit { plate: 0.93, arm: 0.93, arm_width: 0.035, branches: 0, first: 0.0, reach: 0.0, branch_width: 0.0, tip: 0.0 },
    // Six sectors.
    Habit { plate: 0.34, arm: 0.96, arm_width: 0.05, branches: 0, first: 0.0, reach: 0.0, branch_width: 0.0, tip: 0.33 },
    // A dendrite with few branches.
    Habit { plate: 0.14, arm: 1.0, arm_width: 0.05, branches: 3, first: 0.3, reach: 0.75, branch_width: 0.036, tip: 0.0 },
    // A fern.
    Habit { plate: 0.1, arm: 1.0, arm_width: 0.045, branches: 7, first: 0.14, reach: 1.0, branch_width: 0.027, tip: 0.0 },
    // A star of needles.
    Habit { plate: 0.2, arm: 1.0, arm_width: 0.07, branches: 0, first: 0.0, reach: 0.0, branch_width: 0.0, tip: 0.0 },
    // A plate that began to branch.
    Habit { plate: 0.52, arm: 1.0, arm_width: 0.055, branches: 3, first: 0.56, reach: 0.8, branch_width: 0.035, tip: 0.0 },
    // A dendrite whose ends became plates.
    Habit { plate: 0.2, arm: 0.9, arm_width: 0.045, branches: 2, first: 0.24, reach: 0.6, branch_width: 0.032, tip: 0.2 },
    // Broad branches.
    Habit { plate: 0.26, arm: 1.0, arm_width: 0.075, branches: 4, first: 0.3, reach: 0.9, branch_width: 0.052, tip: 0.0 },
];

/// A crystal seen from above.
pub(super) struct Flake(&'static Habit);

/// Half the width of its edge.
const EDGE: f32 = 0.015;
/// Depth within its outline at which it is as thick as it gets.
const BEVEL: f32 = 0.05;

impl Flake {
    pub(super) fn new(variant: u32) -> Self {
        Self(&HABITS[variant as usize % HABITS.len()])
    }

    pub(super) fn at(&self, at: Vec2) -> Texel {
        let outline = self.distance(at);
        let cover = smoothstep(EDGE, -EDGE, outline);
        if cover <= 0.0 {
            return Texel::NONE;
        }
        let height = |at: Vec2| self.height(at);
        let step = 0.02;
        let (right, up) = (Vec2::X * step, Vec2::Y * step);
        let rise = Vec2::new(height(at + right) - height(at - right), height(at + up) - height(at - up));
        let slope = -rise / (2.0 * step);
        let thick = height(at) / (2.0 * BEVEL);
        // Thin plates let light through, ribs hardly.
        Texel { slope: slope * 0.35, shade: 0.55 + 0.45 * thick, cover: cover * (0.55 + 0.45 * thick.sqrt()) }
    }

    /// Thickness: bevelled edges, and the arm as a rib on all that is flat.
    fn height(&self, at: Vec2) -> f32 {
        let bevelled = |depth: f32| depth.clamp(0.0, BEVEL);
        let at_arm = fold(at);
        bevelled(-self.distance(at)) + bevelled(-self.arm(at_arm))
    }

    /// Distance to the outline, negative within.
    fn distance(&self, at: Vec2) -> f32 {
        let habit = self.0;
        let at = fold(at);
        let mut distance = hexagon(at, habit.plate).min(self.arm(at));
        if habit.tip > 0.0 {
            distance = distance.min(hexagon(at - Vec2::X * (habit.arm - habit.tip), habit.tip));
        }
        for branch in 0..habit.branches {
            let part = (branch as f32 + 0.5) / habit.branches as f32;
            let start = habit.first + (habit.arm - habit.first) * part;
            // Longer ones would meet those of the next arm, or be ahead of their own.
            let room = (0.85 * start).min(1.2 * (habit.arm - start));
            let end = Vec2::new(start, 0.0) + Vec2::from_angle(FRAC_PI_3) * (habit.reach * room);
            distance = distance.min(segment(at, Vec2::new(start, 0.0), end) - habit.branch_width);
        }
        distance
    }

    /// Distance to the arm, which ends in a point.
    fn arm(&self, at: Vec2) -> f32 {
        let habit = self.0;
        let beside = at.y - habit.arm_width;
        let beyond = (at - Vec2::X * habit.arm).dot(Vec2::from_angle(FRAC_PI_6));
        beside.max(beyond)
    }
}

/// Into the twelfth beside the arm that points to the right, above it.
fn fold(at: Vec2) -> Vec2 {
    let angle = at.y.atan2(at.x);
    let within = (angle - (angle / FRAC_PI_3).round() * FRAC_PI_3).abs();
    Vec2::from_angle(within) * at.length()
}

/// Distance to a hexagon with a corner on the x axis, for places above the axis.
fn hexagon(at: Vec2, corner: f32) -> f32 {
    let (x, y) = (at.x.abs(), at.y.abs());
    let (sin, cos) = FRAC_PI_6.sin_cos();
    (x * cos + y * sin - corner * cos).max(y - corner * cos)
}

fn segment(at: Vec2, from: Vec2, to: Vec2) -> f32 {
    let along = to - from;
    let part = ((at - from).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
    at.distance(from + along * part)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places() -> impl Iterator<Item = Vec2> {
        (0..900).map(|i| (Vec2::new((i % 30) as f32, (i / 30) as f32) + 0.37) / 15.0 - 1.0)
    }

    #[test]
    fn a_sixth_of_a_turn_changes_nothing() {
        for variant in 0..8 {
            let flake = Flake::new(variant);
            for at in places() {
                let here = flake.at(at);
                let there = flake.at(Vec2::from_angle(FRAC_PI_3).rotate(at));
                assert!((here.cover - there.cover).abs() < 1e-3, "{variant} {at}: {here:?} {there:?}");
                assert!((here.shade - there.shade).abs() < 1e-3, "{variant} {at}: {here:?} {there:?}");
            }
            // A twelfth does.
            let turned = |at| flake.at(Vec2::from_angle(FRAC_PI_6).rotate(at)).cover;
            assert!(places().any(|at| (flake.at(at).cover - turned(at)).abs() > 0.5), "{variant}");
        }
    }

    #[test]
    fn a_crystal_is_its_own_mirror_image() {
        for variant in 0..8 {
            let flake = Flake::new(variant);
            for at in places() {
                let (here, there) = (flake.at(at), flake.at(Vec2::new(at.x, -at.y)));
                assert!((here.cover - there.cover).abs() < 1e-3, "{variant} {at}");
                assert!((here.slope * Vec2::new(1.0, -1.0) - there.slope).length() < 0.05, "{variant} {at}");
            }
        }
    }

    #[test]
    fn arms_reach_out_and_leave_room_between_them() {
        for (variant, habit) in HABITS.iter().enumerate() {
            let flake = Flake::new(variant as u32);
            assert!(flake.at(Vec2::X * (0.8 * habit.arm)).cover > 0.5, "{variant}");
            let between = Vec2::from_angle(FRAC_PI_6) * 0.95;
            assert_eq!(flake.at(between).cover, 0.0, "{variant}");
        }
    }
}
