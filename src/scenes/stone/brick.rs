//! The recipe for brickwork: running bond, every brick its own piece, mortar between them.
//!
//! A brick of the common British format shows 215 by 65 mm, a joint is 10 mm: four bricks and twelve
//! courses, an even number, fill a tile exactly. The tile's edges run through the middle of a course and
//! through the quarters of bricks, so no joint lies along them.

use bevy::math::{FloatExt, IVec2, Vec2, Vec3};

use super::kinds::Texel;
use super::noise::{Layers, hash, smoothstep, unit};

pub(super) const TILE_MM: f32 = 900.0;
const PER_COURSE: i32 = 4;
const COURSES: i32 = 12;
const BRICKS: usize = (PER_COURSE * COURSES) as usize;
/// A brick and its share of the joints.
const PITCH_MM: Vec2 = Vec2::new(TILE_MM / PER_COURSE as f32, TILE_MM / COURSES as f32);
const JOINT_MM: f32 = 10.0;
const CORNER_MM: f32 = 4.0;
/// How far the mortar lies below the faces.
const RECESS_MM: f32 = 4.5;
// Otherwise the last course would not be shifted against the first of the next tile.
const _: () = assert!(COURSES % 2 == 0);

/// What sets one brick apart from the others.
struct Brick {
    /// Where it lies off its place, in millimetres.
    off: Vec2,
    half: Vec2,
    turn: Vec2,
    /// Rise of its face to the right and down, in millimetres per millimetre.
    tilt: Vec2,
    proud_mm: f32,
    /// Width of the rounding of its edges.
    arris_mm: f32,
    albedo: Vec3,
    /// Darkening towards its right end, or its left if negative, from lying bare to the fire.
    flash: f32,
    /// How much of its clay has sintered, which leaves it smoother.
    burnt: f32,
    /// Lime left on it by the bricklayer.
    film: f32,
    /// Which part of the noise it is cut from.
    cut: Vec2,
}

/// A place on the wall.
struct Place {
    brick: usize,
    /// From the middle of the brick's place, to the right and down.
    mm: Vec2,
}

fn place(uv: Vec2) -> Place {
    let at = uv * TILE_MM / PITCH_MM + Vec2::new(0.25, 0.5);
    let course = at.y.floor();
    let at = at + Vec2::new(0.5 * course.rem_euclid(2.0), 0.0);
    let cell = at.floor().as_ivec2();
    let IVec2 { x: column, y: course } = cell.rem_euclid(IVec2::new(PER_COURSE, COURSES));
    Place { brick: (course * PER_COURSE + column) as usize, mm: (at - at.floor() - 0.5) * PITCH_MM }
}

fn bricks(layers: Layers) -> Vec<Brick> {
    let random = |brick: usize, which: u32| unit(hash([layers.seed, brick as u32, 64 + which]));
    // A tile holds too few bricks to draw colours by lot: they are dealt out, so that any seed has all.
    let mut order: Vec<usize> = (0..BRICKS).collect();
    order.sort_by(|&a, &b| random(a, 0).total_cmp(&random(b, 0)));
    let mut dealt = [0.0; BRICKS];
    for (rank, &brick) in order.iter().enumerate() {
        dealt[brick] = (rank as f32 + 0.5) / BRICKS as f32;
    }
    let brick = |(brick, share): (usize, f32)| {
        let random = |which| random(brick, which);
        let either = |which| 2.0 * random(which) - 1.0;
        let (albedo, burnt) = match share {
            dark if dark < 0.09 => (Vec3::new(0.175, 0.105, 0.085), 1.0),
            brown if brown < 0.22 => (Vec3::new(0.330, 0.175, 0.120), 0.5),
            orange if orange < 0.52 => (Vec3::new(0.505, 0.247, 0.147), 0.0),
            deep if deep < 0.70 => (Vec3::new(0.370, 0.145, 0.095), 0.3),
            _ => (Vec3::new(0.470, 0.200, 0.128), 0.1),
        };
        let warmth = Vec3::new(1.0, 1.0 + 0.07 * either(1), 1.0 + 0.10 * either(1));
        Brick {
            off: Vec2::new(0.9 * either(2), 0.7 * either(3)),
            half: (PITCH_MM - JOINT_MM) / 2.0 + Vec2::new(0.8 * either(4), 0.7 * either(5)),
            turn: Vec2::from_angle(0.005 * either(6)),
            tilt: Vec2::new(0.004 * either(7), 0.010 * either(8)),
            proud_mm: 0.5 * either(9),
            arris_mm: 2.6 + 2.0 * random(10),
            albedo: albedo * warmth * (1.0 + 0.14 * either(11)),
            flash: if random(12) < 0.4 { 0.5 * either(13) } else { 0.0 },
            burnt,
            film: (random(14) - 0.5).max(0.0) * 0.9,
            cut: Vec2::new(random(15), random(16)),
        }
    };
    dealt.into_iter().enumerate().map(brick).collect()
}

impl Brick {
    /// How far inside its outline a place is, in millimetres; the middle of its place is the origin.
    fn inside_mm(&self, mm: Vec2) -> f32 {
        let beyond = self.turn.rotate(mm - self.off).abs() - (self.half - CORNER_MM);
        CORNER_MM - beyond.max(Vec2::ZERO).length() - beyond.max_element().min(0.0)
    }

    /// How far its surface lies below its face, so far inside its outline.
    fn rounded_mm(&self, inside: f32) -> f32 {
        0.8 * self.arris_mm * (1.0 - inside / self.arris_mm).max(0.0).powi(2)
    }
}

/// What a place on a brick shares with the mortar beside it.
struct Wear {
    /// How far inside the worn outline it is, in millimetres.
    inside: f32,
    /// Fine noise, about -1 to 1.
    skin: f32,
    /// How much of the edge has broken off here, `0..=1`.
    chip: f32,
}

pub(super) fn brick(layers: Layers) -> impl Fn(Vec2) -> Texel {
    let bricks = bricks(layers);
    let wander = layers.noise(1, Vec2::new(28.0, 28.0), 3);
    let skin = layers.noise(2, Vec2::new(170.0, 170.0), 3);
    let chips = layers.cells(3, 44.0);
    let (face, mortar) = (face(layers), mortar(layers));
    move |uv| {
        let Place { brick, mm } = place(uv);
        let brick = &bricks[brick];
        let (ragged, skin) = (wander.at(uv), skin.at(uv));
        let outline = brick.inside_mm(mm) + 1.5 * ragged + 0.35 * skin;
        let edge = uv + 0.0025 * Vec2::new(skin, ragged);
        // Only what is knocked at an edge breaks off.
        let chip = smoothstep(0.0, 0.6, chips.spot(edge, 0.42, 0.10, 0.49)) * smoothstep(10.0, 1.0, outline);
        let inside = outline - 3.0 * chip;
        let wear = Wear { inside, skin, chip };
        // Deep in a brick or out in a joint only one of the two can show.
        if inside > 8.0 {
            return face(brick, uv, mm, &wear);
        }
        let joint = mortar(uv, inside);
        if inside < -4.0 {
            return joint;
        }
        let face = face(brick, uv, mm, &wear);
        let bare = smoothstep(-0.4, 0.4, face.height_mm - joint.height_mm);
        Texel {
            albedo: joint.albedo.lerp(face.albedo, bare),
            height_mm: joint.height_mm.lerp(face.height_mm, bare),
            roughness: joint.roughness.lerp(face.roughness, bare),
        }
    }
}

fn face(layers: Layers) -> impl Fn(&Brick, Vec2, Vec2, &Wear) -> Texel {
    let clouds = layers.noise(11, Vec2::new(6.0, 9.0), 4);
    let mottle = layers.noise(12, Vec2::new(36.0, 44.0), 3);
    let creases = layers.noise(13, Vec2::new(14.0, 60.0), 3);
    let clay = layers.cells(14, 640.0);
    let (grog, pits, holes) = (layers.cells(15, 210.0), layers.cells(16, 130.0), layers.cells(17, 36.0));
    move |brick, uv, mm, wear| {
        let &Wear { inside, skin, chip } = wear;
        let uv = uv + brick.cut;
        let (clouds, mottle) = (clouds.at(uv), mottle.at(uv));
        let crease = smoothstep(0.15, 0.75, creases.at(uv + Vec2::new(0.0, 0.006 * mottle)));
        let grain = clay.nearest(uv);
        let edge = uv + 0.0012 * Vec2::new(skin, mottle);
        let grog = smoothstep(0.0, 0.5, grog.spot(edge, 0.20, 0.08, 0.32));
        let pit = smoothstep(0.0, 0.5, pits.spot(edge, 0.16, 0.07, 0.32));
        let hole = smoothstep(0.0, 0.4, holes.spot(edge, 0.14, 0.04, 0.14));

        let mut albedo = brick.albedo * (1.0 + 0.20 * clouds + 0.16 * mottle + 0.14 * skin);
        albedo *= 0.86 + 0.28 * grain.chance(1);
        // The end that lay bare to the fire.
        let end = smoothstep(0.0, 1.0, mm.x * brick.flash.signum() / brick.half.x + 0.5 * clouds);
        let fired = Vec3::new(0.55, 0.58, 0.72);
        albedo *= Vec3::ONE.lerp(fired, end * brick.flash.abs() * 1.6);
        let speck = if grain.chance(2) < 0.35 { Vec3::new(1.30, 1.36, 1.36) } else { Vec3::splat(0.62) };
        albedo *= Vec3::ONE.lerp(speck, 0.8 * grog);
        albedo *= 1.0 - 0.30 * pit - 0.40 * hole - 0.14 * crease;
        albedo *= Vec3::ONE.lerp(Vec3::new(1.20, 1.28, 1.24), chip);
        // Lime smeared over the edges by the trowel and washed in since.
        let lime = brick.film * smoothstep(16.0, 0.0, inside) + 0.10 * smoothstep(5.0, 0.0, inside);
        let lime = lime * smoothstep(-0.5, 0.6, mottle + skin) * (1.0 - chip);
        albedo = albedo.lerp(Vec3::new(0.52, 0.44, 0.36), lime.min(0.6));

        let height_mm = brick.proud_mm + brick.tilt.dot(mm) - brick.rounded_mm(inside)
            + 0.40 * clouds
            + 0.26 * mottle
            + 0.20 * skin
            + clay.dome_mm(&grain, 0.10)
            + 0.10 * grog
            - 0.7 * crease
            - 0.8 * pit
            - 2.2 * hole
            - 1.6 * chip;
        Texel {
            albedo,
            height_mm,
            roughness: 0.86 - 0.14 * brick.burnt + 0.05 * mottle + 0.05 * lime + 0.05 * chip,
        }
    }
}

fn mortar(layers: Layers) -> impl Fn(Vec2, f32) -> Texel {
    let beds = layers.noise(21, Vec2::new(26.0, 26.0), 4);
    let crumbs = layers.noise(22, Vec2::new(190.0, 190.0), 3);
    let (sand, voids) = (layers.cells(23, 480.0), layers.cells(24, 120.0));
    move |uv, inside| {
        let (bed, crumb) = (beds.at(uv), crumbs.at(uv));
        let grit = sand.nearest(uv);
        let void = smoothstep(0.0, 0.5, voids.spot(uv + 0.001 * crumb, 0.18, 0.08, 0.42));

        let mut albedo = Vec3::new(0.52, 0.445, 0.355) * (1.0 + 0.16 * bed + 0.12 * crumb);
        albedo *= match grit.chance(1) {
            dark if dark < 0.05 => Vec3::new(0.58, 0.54, 0.50),
            ochre if ochre < 0.22 => Vec3::new(1.02, 0.92, 0.80),
            _ => Vec3::splat(0.87 + 0.26 * grit.chance(2)),
        };
        albedo *= 1.0 - 0.35 * void;

        // It clings to the bricks, is drawn hollow between them and goes on behind them.
        let height_mm = 1.1 * smoothstep(-2.5, 0.5, inside) - 0.8 * inside.max(0.0) - RECESS_MM
            + 1.3 * bed
            + 0.5 * crumb
            + sand.dome_mm(&grit, 0.15) * (0.4 + 0.9 * grit.chance(3))
            - 0.9 * void;
        Texel { albedo, height_mm, roughness: 0.95 + 0.03 * crumb }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_brick_is_laid_once_and_bonds_with_the_next_course() {
        let mut laid = [0; BRICKS];
        for course in 0..COURSES {
            for column in 0..PER_COURSE {
                // Brick middles of the even courses; odd ones are half a brick to the left.
                let shift = if course % 2 == 0 { 0.25 } else { -0.25 };
                let middle = Vec2::new(column as f32 + shift, course as f32);
                let uv = middle * PITCH_MM / TILE_MM;
                let here = place(uv);
                laid[here.brick] += 1;
                assert!(here.mm.length() < 0.01, "{middle}: {}", here.mm);
                let below = place(uv + Vec2::new(0.0, PITCH_MM.y / TILE_MM));
                assert!(below.mm.x.abs() > 0.49 * PITCH_MM.x, "{middle}: {}", below.mm);
                for next in [Vec2::X, Vec2::Y] {
                    assert_eq!(place(uv + next).brick, here.brick, "{middle}");
                }
            }
        }
        assert_eq!(laid, [1; BRICKS]);
    }

    #[test]
    fn outlines_keep_their_joint() {
        for seed in 0..8 {
            for brick in bricks(Layers { seed, finest: 300.0, tile_mm: TILE_MM }) {
                assert!(brick.inside_mm(Vec2::ZERO) > 30.0);
                for way in [Vec2::X, Vec2::NEG_X, Vec2::Y, Vec2::NEG_Y] {
                    let boundary = brick.inside_mm(way * PITCH_MM / 2.0);
                    assert!((-7.0..-3.0).contains(&boundary), "{way}: {boundary}");
                }
                assert!(brick.rounded_mm(-3.0) > RECESS_MM + 1.0 && brick.rounded_mm(10.0) == 0.0);
            }
        }
    }
}
