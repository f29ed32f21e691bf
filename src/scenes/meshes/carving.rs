//! What is carved into a bas-relief, as a height over the plate.
//!
//! A moulded frame with a row of pearls, and in it a niche below a round arch: its head is a shell, before
//! which the face of a sun hangs among its rays; below stands a palmette between two scrolls. A sill
//! carries the niche on dentils, and a rose fills each corner above the arch. Every shape is a distance to
//! its outline, taken through the profile of a moulding; shapes are put over each other by taking the
//! greater height, so the stone is never undercut.
//!
//! Lengths are in units of half the width of a plate of the usual proportions, `y` from the lower edge up;
//! heights from 0, the deepest cut, to 1, the face of the block.

use std::f32::consts::{FRAC_PI_2, TAU};

use bevy::math::Vec2;
use fastnoise_lite::FastNoiseLite;

use super::noise;

/// Height of a plate of the usual proportions, 3 to 4.
const USUAL_HEIGHT: f32 = 8.0 / 3.0;
/// Width of the frame.
const FRAME: f32 = 0.2;
/// Height of the flat ground between frame and arch.
const FIELD: f32 = 0.36;
/// Upper side of the sill, on which the niche stands.
const SILL: f32 = 0.46;
/// Middle of the arch ...
const SPRING: Vec2 = Vec2::new(0.0, 1.66);
/// ... and its radius inside.
const ARCH: f32 = 0.6;
/// Width of the moulding around the niche.
const ARCHIVOLT: f32 = 0.16;
/// Radius of the sun's face.
const SUN: f32 = 0.285;

/// The carving of one plate.
pub(super) struct Carving {
    /// Metres per unit.
    unit: f32,
    /// Half the width and the whole height of the plate.
    extent: Vec2,
    noise: FastNoiseLite,
}

impl Carving {
    /// For a plate of `size` metres; `seed` is another hand, with other marks and other wear.
    pub(super) fn new(size: Vec2, seed: u32) -> Self {
        let unit = (size.x / 2.0).min(size.y / USUAL_HEIGHT);
        Self { unit, extent: Vec2::new(size.x / 2.0, size.y) / unit, noise: noise(seed, 3) }
    }

    /// The height, 0 to 1, at a point in metres from the middle of the lower edge.
    pub(super) fn height(&self, at: Vec2) -> f32 {
        let at = at / self.unit;
        // What stands in the frame is in the middle of a plate of any proportions.
        let inner = at - Vec2::new(0.0, (self.extent.y - USUAL_HEIGHT) / 2.0);
        let depth = niche_depth(inner);
        let mut height = FIELD;
        height = height.max(archivolt(inner, depth));
        if depth > 0.0 {
            let ground = niche_ground(inner).max(ray_heights(inner)).max(plant(inner));
            // The wall of the niche is a little inclined, as a chisel leaves it.
            let wall = (0.66 - depth / 0.045).max(0.0);
            height = ground.max(wall);
        }
        height = height.max(face(inner)).max(rose(inner)).max(sill(inner));
        height = height.max(self.frame(at));
        (height - self.wear(at, height)).clamp(0.0, 1.0)
    }

    /// The moulding along the edges of the plate.
    fn frame(&self, at: Vec2) -> f32 {
        const PEARL: f32 = 0.031;
        let Vec2 { x: half, y: top } = self.extent;
        // Distance to each pair of edges; the nearer one decides, so corners are mitred.
        let to_edge = Vec2::new(half - at.x.abs(), at.y.min(top - at.y));
        let inside = to_edge.min_element();
        if inside > FRAME {
            return 0.0;
        }
        let profile = if inside < 0.016 {
            0.88 + 0.12 * inside / 0.016
        } else if inside < 0.06 {
            1.0
        } else if inside < 0.165 {
            // A cavetto: a quarter of a hollow ellipse.
            let across = (inside - 0.06) / 0.105;
            1.0 - 0.5 * (1.0 - (1.0 - across) * (1.0 - across)).max(0.0).sqrt()
        } else {
            0.6 - 0.6 * step(0.182, FRAME, inside)
        };
        // Pearls lie along the hollow, a whole number between the middles of two corners.
        let (along, length) = if to_edge.x < to_edge.y {
            (at.y - 0.115, top - 0.23)
        } else {
            (at.x + half - 0.115, 2.0 * half - 0.23)
        };
        let pitch = length / (length / 0.085).round().max(1.0);
        let off = Vec2::new(along - (along / pitch).round() * pitch, inside - 0.115);
        profile.max(0.5 * bulge(off.length() / PEARL) + 0.38 * step(1.0, 0.9, off.length() / PEARL))
    }

    /// What time took: hardly anything from the hollows, more from what stands out, here and there a chip.
    fn wear(&self, at: Vec2, height: f32) -> f32 {
        let sample = |scale: f32| self.noise.get_noise_2d(at.x * scale, at.y * scale);
        // A toothed chisel's marks stay where nobody polished: on the ground.
        let marks = 0.003 * (at.x * 70.0 + at.y * 110.0 + 4.0 * sample(2.0)).sin();
        // Only the arris of the plate is knocked off.
        let to_edge = Vec2::new(self.extent.x - at.x.abs(), at.y.min(self.extent.y - at.y)).min_element();
        let chip = (0.5 * sample(3.0) + 0.5 * sample(9.0) - 0.3).max(0.0) * step(0.06, 0.0, to_edge);
        0.012 * (1.0 + sample(6.0)) + marks * (1.0 - height) + 1.4 * chip
    }
}

/// 0 before `from`, 1 after `to`, smooth in between; also with `to` before `from`.
fn step(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A half-round from 1 in the middle to 0 at a distance of 1.
fn bulge(distance: f32) -> f32 {
    (1.0 - distance * distance).max(0.0).sqrt()
}

/// A soft hill from 1 in the middle to 0 far away.
fn hill(at: Vec2, radii: Vec2) -> f32 {
    (-(at / radii).length_squared()).exp()
}

/// Distance to the outline of the niche, positive inside.
fn niche_depth(at: Vec2) -> f32 {
    if at.y > SPRING.y { ARCH - at.distance(SPRING) } else { (ARCH - at.x.abs()).min(at.y - SILL) }
}

/// The moulding around the niche, with blocks where the arch begins and a keystone.
fn archivolt(at: Vec2, depth: f32) -> f32 {
    if at.y < SILL - 0.02 {
        return 0.0;
    }
    let out = -depth;
    let band = step(-0.005, 0.0, out) * step(ARCHIVOLT, ARCHIVOLT - 0.03, out);
    let mut height = band * (0.58 + 0.32 * bulge((out - 0.044) / 0.038) + 0.2 * bulge((out - 0.124) / 0.025));
    // A bevelled box by its distance inside.
    let block = |half: Vec2, off: Vec2, high: f32| {
        let inside = (half - off.abs()).min_element();
        high * step(0.0, 0.03, inside)
    };
    let impost = Vec2::new(at.x.abs() - ARCH - ARCHIVOLT / 2.0, at.y - SPRING.y);
    height = height.max(block(Vec2::new(0.115, 0.045), impost, 0.97));
    height = height.max(block(Vec2::new(0.095, 0.085), impost, 0.8));
    // The keystone narrows towards the middle of the arch.
    let from = at - SPRING;
    let key = Vec2::new(from.x, from.length() - ARCH - 0.06);
    height.max(block(Vec2::new(0.075 + 0.1 * key.y, 0.115), key, 0.98))
}

/// The hollow of the niche: half a cylinder below, above it a shell.
fn niche_ground(at: Vec2) -> f32 {
    let from = at - SPRING;
    if from.y < 0.0 {
        return 0.24 - 0.2 * bulge(from.x / ARCH);
    }
    const LOBES: f32 = 13.0;
    let radius = from.length() / ARCH;
    let angle = from.y.atan2(from.x);
    // Ribs are round, the lines between them deep; the shell opens from the line where the arch begins.
    let rib = (angle * LOBES).sin().abs().sqrt() - 0.5;
    let open = step(0.0, 0.35, from.y / ARCH) * step(0.2, 0.7, radius);
    0.24 - 0.2 * bulge(radius) + 0.17 * rib * open * radius
}

/// The rays of the sun, straight and waved by turns.
fn ray_heights(at: Vec2) -> f32 {
    const RAYS: f32 = 16.0;
    let from = at - SPRING;
    let radius = from.length();
    let turn = (from.x.atan2(from.y) / TAU + 1.0) * RAYS;
    let number = turn.round();
    let waved = (number as i32) % 2 == 1;
    let length = if waved { 0.48 } else { 0.54 };
    let along = (radius - SUN) / (length - SUN);
    if !(0.0..1.0).contains(&along) {
        return 0.0;
    }
    let sway = if waved { 0.016 * (along * TAU * 1.1).sin() } else { 0.0 };
    let across = ((turn - number) * TAU / RAYS * radius - sway).abs();
    let half = (0.008 + 0.046 * (1.0 - along).powf(0.8)) * (if waved { 0.9 } else { 1.1 });
    let inside = half - across;
    // Roofs with a ridge, higher where they leave the face.
    step(0.0, 0.024, inside) * (0.3 + 0.14 * (1.0 - along) + 4.0 * inside.max(0.0))
}

/// A face as of a sun: calm, its eyes closed.
fn face(at: Vec2) -> f32 {
    let at = (at - SPRING) / SUN;
    // Narrower at the chin.
    let narrow = 0.9 + 0.06 * at.y.clamp(-1.0, 0.6);
    let round = Vec2::new(at.x / narrow, at.y).length();
    // A rolled rim between face and rays.
    let rim = 0.6 * bulge((round - 1.05) / 0.1) * step(1.15, 1.08, round);
    if round >= 1.0 {
        return rim;
    }
    let side = Vec2::new(at.x.abs(), at.y);
    let mut height = 0.38 + 0.3 * bulge(round * 0.98);
    // Sockets, the brows above them, cheeks below.
    height -= 0.2 * hill(side - Vec2::new(0.34, 0.15), Vec2::new(0.25, 0.17));
    let arch = at.y - 0.37 + 0.9 * (side.x - 0.3).powi(2);
    height += 0.09 * hill(Vec2::new(side.x - 0.34, arch), Vec2::new(0.3, 0.07));
    height += 0.09 * hill(side - Vec2::new(0.42, -0.24), Vec2::new(0.22, 0.2));
    // Eyes: balls under lids, whose seam hangs down in the middle.
    let eye = side - Vec2::new(0.35, 0.11);
    height += 0.2 * bulge((eye / Vec2::new(0.21, 0.15)).length());
    let seam = eye.y + 0.07 - 1.6 * eye.x * eye.x;
    height -= 0.07 * step(0.24, 0.17, eye.x.abs()) * hill(Vec2::new(0.0, seam), Vec2::new(1.0, 0.03));
    // Nose: a wedge from the brows to a round tip with wings.
    let down = ((0.4 - at.y) / 0.62).clamp(0.0, 1.0);
    let bridge = step(0.44, 0.3, at.y) * step(-0.29, -0.2, at.y);
    height += bridge * (0.1 + 0.2 * down) * hill(Vec2::new(at.x, 0.0), Vec2::new(0.08 + 0.05 * down, 1.0));
    height += 0.1 * hill(side - Vec2::new(0.11, -0.19), Vec2::new(0.08, 0.07));
    // Mouth: two lips and the line between them, its corners a little up.
    let mouth = at.y + 0.47 - 0.3 * at.x * at.x;
    let wide = step(0.31, 0.16, side.x);
    height += 0.1 * wide * hill(Vec2::new(0.0, mouth - 0.06), Vec2::new(1.0, 0.05));
    height += 0.13 * wide * hill(Vec2::new(at.x, mouth + 0.075), Vec2::new(0.2, 0.06));
    height -= 0.1 * step(0.34, 0.26, side.x) * hill(Vec2::new(0.0, mouth), Vec2::new(1.0, 0.026));
    height -= 0.07 * hill(at - Vec2::new(0.0, -0.63), Vec2::new(0.22, 0.05));
    height += 0.12 * hill(at - Vec2::new(0.0, -0.79), Vec2::new(0.17, 0.12));
    height.max(rim)
}

/// A palmette of nine leaves between two scrolls.
fn plant(at: Vec2) -> f32 {
    const ROOT: Vec2 = Vec2::new(0.0, SILL + 0.1);
    /// Leaves on one side of the middle one, and the angle between two.
    const PAIRS: f32 = 4.0;
    const APART: f32 = 0.32;
    let from = at - ROOT;
    let side = Vec2::new(from.x.abs(), from.y);
    let mut height = scroll(side);
    // Only the two leaves beside this place reach it. The nearer the middle, the longer and the further in
    // front.
    let below = (side.x.atan2(side.y) / APART).floor();
    for pair in [below, below + 1.0] {
        if pair <= PAIRS {
            let up = 1.0 - pair / PAIRS;
            height = height.max(leaf(side, pair * APART, 0.4 + 0.16 * up, 0.12 * up));
        }
    }
    // The cup and the knot from which everything grows.
    height = height.max(0.5 * bulge((from / Vec2::new(0.26, 0.2)).length()));
    height.max(0.82 * bulge((from / Vec2::new(0.13, 0.075)).length()))
}

/// A spoon-shaped leaf that grows from the origin, `turn` radians from upright: hollow on both sides of its
/// rib, and curled forwards at its tip.
fn leaf(at: Vec2, turn: f32, length: f32, lift: f32) -> f32 {
    const WIDEST: f32 = 0.76;
    let (sin, cos) = turn.sin_cos();
    let along = (at.x * sin + at.y * cos) / length;
    if !(0.0..1.0).contains(&along) {
        return 0.0;
    }
    // Bends outwards on its way.
    let across = (at.x * cos - at.y * sin + 0.25 * length * sin * (along * along - along)).abs();
    let tip = bulge(((along - WIDEST) / (1.0 - WIDEST)).max(0.0));
    let half = length * 0.145 * (0.25 + 0.75 * step(0.0, WIDEST, along)) * tip;
    let inside = half - across;
    if inside <= 0.0 {
        return 0.0;
    }
    let hollow = (1.0 - (2.0 * across / half - 1.0).powi(2)) * step(0.3, 0.6, along);
    let rise = 0.34 + lift + 0.34 * step(0.2, 0.9, along) - 0.16 * hollow;
    rise * step(0.0, 0.03, inside)
}

/// A band that leaves the root sideways and winds up into a spiral with a boss in its middle.
fn scroll(at: Vec2) -> f32 {
    const MIDDLE: Vec2 = Vec2::new(0.41, 0.09);
    const OUTER: f32 = 0.15;
    const PER_TURN: f32 = 0.08;
    const BAND: f32 = 0.03;
    let from = at - MIDDLE;
    let radius = from.length();
    let boss = 0.66 * bulge(radius / 0.042);
    // The band ends where it comes from: below, towards the root.
    let angle = (from.y.atan2(from.x) + FRAC_PI_2).rem_euclid(TAU) / TAU;
    let winding = (OUTER - radius) / PER_TURN - angle;
    let off = (winding - winding.round()) * PER_TURN;
    let mut height = 0.0f32;
    if winding.round() >= 0.0 && radius > 0.05 {
        height = 0.26 + 0.3 * bulge(off / BAND);
        height *= step(BAND, 0.7 * BAND, off.abs());
    }
    // The stem, from the root along the sill to the outermost winding.
    let stem = Vec2::new((at.x - 0.2).abs() - 0.2, at.y - MIDDLE.y + OUTER);
    if stem.x < 0.0 {
        height = height.max((0.26 + 0.3 * bulge(stem.y / BAND)) * step(BAND, 0.7 * BAND, stem.y.abs()));
    }
    height.max(boss)
}

/// A rose in each upper corner of the frame.
fn rose(at: Vec2) -> f32 {
    const MIDDLE: Vec2 = Vec2::new(0.645, 2.29);
    const SIZE: f32 = 0.15;
    let from = (Vec2::new(at.x.abs(), at.y) - MIDDLE) / SIZE;
    let radius = from.length();
    if radius > 1.0 {
        return 0.0;
    }
    let angle = from.y.atan2(from.x);
    let ring = |petals: f32, turn: f32, size: f32, high: f32| {
        let lobe = (angle * petals / 2.0 + turn).cos().abs();
        let edge = size * (0.72 + 0.28 * lobe.sqrt());
        let inside = edge - radius;
        // Petals are hollow, and rise to their rims.
        let hollow = 0.12 * (radius / edge).powi(2) + 0.1 * lobe.sqrt();
        if inside > 0.0 { (high + hollow) * step(0.0, 0.12, inside) } else { 0.0 }
    };
    let heart = 0.85 * bulge(radius / 0.24);
    ring(5.0, 0.0, 1.0, 0.48).max(ring(5.0, FRAC_PI_2, 0.62, 0.6)).max(heart)
}

/// The sill below the niche: a slab with a round nose, a hollow below it, and dentils.
fn sill(at: Vec2) -> f32 {
    let below = SILL - at.y;
    if !(0.0..0.26).contains(&below) || at.x.abs() > 0.9 {
        return 0.0;
    }
    let slab = if below < 0.025 {
        0.98 * (below / 0.025)
    } else if below < 0.07 {
        0.98
    } else {
        // Falls back in a hollow to the ground.
        FIELD + (0.98 - FIELD) * (1.0 - bulge(1.0 - ((below - 0.07) / 0.06).min(1.0)))
    };
    let pitch = 0.075;
    let off = (at.x - (at.x / pitch).round() * pitch).abs();
    let tooth = (0.026 - off).min(below - 0.1).min(0.19 - below);
    slab.max(0.74 * step(0.0, 0.012, tooth))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_carving_is_the_same_on_both_sides_but_for_wear() {
        let carving = Carving::new(Vec2::new(2.0, USUAL_HEIGHT), 5);
        // Within the arris, which is chipped.
        for y in 4..=96 {
            for x in 0..=45 {
                let at = Vec2::new(x as f32 / 50.0, y as f32 / 100.0 * USUAL_HEIGHT);
                // The waved rays all turn the same way.
                if at.distance(SPRING) < 0.56 {
                    continue;
                }
                let (right, left) = (carving.height(at), carving.height(Vec2::new(-at.x, at.y)));
                assert!((0.0..=1.0).contains(&right) && (right - left).abs() < 0.04, "{at}: {left} {right}");
            }
        }
    }

    #[test]
    fn every_leaf_and_every_ray_is_there() {
        for number in -4..=4 {
            let (sin, cos) = (0.32 * number as f32).sin_cos();
            let at = Vec2::new(0.0, SILL + 0.1) + 0.28 * Vec2::new(sin, cos);
            assert!(plant(at) > 0.35, "leaf {number}: {}", plant(at));
        }
        for number in 0..16 {
            let (sin, cos) = (TAU / 16.0 * number as f32).sin_cos();
            let at = SPRING + 0.34 * Vec2::new(sin, cos);
            assert!(ray_heights(at) > 0.3, "ray {number}: {}", ray_heights(at));
        }
    }

    #[test]
    fn mouldings_lie_over_each_other_as_a_mason_would_have_them() {
        let carving = Carving::new(Vec2::new(2.0, USUAL_HEIGHT), 5);
        let height = |x: f32, y: f32| carving.height(Vec2::new(x, y));
        let nose = height(0.0, SPRING.y - 0.2 * SUN);
        let cheek = height(0.42 * SUN, SPRING.y - 0.24 * SUN);
        let ground = height(0.3, SILL + 0.75);
        assert!(nose > cheek + 0.1 && cheek > ground + 0.3, "{nose} {cheek} {ground}");
        let (frame, field, sill) = (height(0.96, 1.0), height(0.79, 1.3), height(0.3, SILL - 0.05));
        assert!(frame > 0.95 && sill > 0.9 && field < 0.45 && ground < 0.15, "{frame} {sill} {field}");
    }
}
