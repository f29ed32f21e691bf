//! A flight of stone steps that many feet have hollowed.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use bevy::math::{UVec2, Vec2, Vec3};
use bevy::mesh::Mesh;
use fastnoise_lite::FastNoiseLite;

use super::grid::{GUTTER, countable, push_grid};
use super::{MeshError, Surface, at_least, noise, positive};

/// Quads around the nose of a step, from the tread to the slope below it.
const NOSE: u32 = 6;
/// Quads along a step that are not counted in cells: one at either end of the corner between tread and riser,
/// the nose, and the slope below it.
const EXTRA: u32 = NOSE + 3;
/// The length of those at the corner, in lengths of a step: short, so that the corner is shaded as one.
const CORNER: f32 = 0.02;
/// How far the nose stands out over the riser, and how round it is, in lengths of a step.
const OVERHANG: f32 = 0.12;
const ROUNDING: f32 = 0.08;
/// Slope of the treads towards the front.
const FALL: f32 = 0.012;
/// Depth of the wear at the nose, over that of the hollow behind it.
const LIP: f32 = 0.35;
/// How much of the sides' map there is to a metre, over that of the steps: nobody looks at them closely.
const SIDES: f32 = 0.5;

/// A straight flight of steps that climbs towards -z and faces +z; its foot is at `y = 0` and `z = 0`.
///
/// `width`, `rise` and `going`, the depth of a tread, are in metres; the flight is centred on `x = 0`.
/// Treads fall a little over 1 % to the front; noses are round and stand out by about an eighth of the rise.
/// In the middle of its tread each step is hollowed by up to `hollow` metres, 0.006 to 0.01 as a rule, and
/// worn a third as deep at its nose: water gathers in the hollow, and what is too much for it runs over the
/// middle of the nose. Where and how deep the hollow is, `seed` says. The flight is closed at both sides,
/// where the steps are not worn, and open behind and below.
///
/// `cells` is the number of quads across the width and along a tread. With `rows`, which is
/// `cells.y + cells.y.div_ceil(2) + 9`, the mesh has
/// `2 * steps * (cells.x * rows + rows + 3) - 2` triangles.
///
/// The uvs of treads and risers are one sheet, unfolded along the flight: `u` grows with x, `v` on the way
/// down. To the right of it lie the sides, the one at +x above the other, with a gutter in between; along
/// their upper edges they have the same positions as the sheet.
///
/// # Errors
/// [`MeshError::NotPositive`], also for a `hollow` deeper than a quarter of the rise;
/// [`MeshError::TooFew`], [`MeshError::TooMany`].
pub fn stair(
    width: f32,
    steps: u32,
    rise: f32,
    going: f32,
    hollow: f32,
    cells: UVec2,
    seed: u32,
) -> Result<Mesh, MeshError> {
    for (what, length) in [("width", width), ("rise", rise), ("going", going), ("hollow", hollow)] {
        positive(what, length)?;
    }
    positive("rise - 4 * hollow", rise - 4.0 * hollow)?;
    at_least("steps", 1, steps)?;
    at_least("cells.x", 1, cells.x)?;
    at_least("cells.y", 1, cells.y)?;
    // The sides have about two vertices for each row.
    let most_rows = (2 * u64::from(cells.y) + u64::from(EXTRA)).checked_mul(u64::from(steps));
    countable(cells.x, 8, most_rows.unwrap_or(u64::MAX), 0)?;

    let flight = Flight { width, steps, rise, going, hollow, noise: noise(seed, 3) };
    let profile = flight.profile(cells.y);
    // Arc length along the profile, metres.
    let mut walked = vec![0.0];
    for pair in profile.windows(2) {
        walked.push(walked[walked.len() - 1] + pair[0].flat.distance(pair[1].flat));
    }
    let (rows, length) = (profile.len() - 1, walked[walked.len() - 1]);
    // The sides begin behind the gutter.
    let run = going * steps as f32 + OVERHANG * flight.unit();
    let across = (1.0 - GUTTER) * width / (width + SIDES * run);
    let x = |column: u32| (column as f32 / cells.x as f32 - 0.5) * width;
    let mut surface = Surface::default();
    push_grid(&mut surface, cells.x, rows as u32, |column, row| {
        let (point, walked) = (&profile[row as usize], walked[row as usize]);
        let uv = Vec2::new(column as f32 / cells.x as f32 * across, (walked / length).min(1.0));
        (flight.at(point, x(column)), uv)
    });
    let top = rise * steps as f32 + FALL * going;
    for (column, normal, above) in [(cells.x, Vec3::X, 0.0), (0, Vec3::NEG_X, 0.5 + GUTTER / 2.0)] {
        let edge: Vec<Vec3> = profile.iter().map(|point| flight.at(point, x(column))).collect();
        push_side(&mut surface, &flight, &edge, normal, |at| {
            // The nose of the lowest step lies before the foot.
            let behind = (OVERHANG * flight.unit() - at.z) / run;
            let right = if normal.x > 0.0 { behind } else { 1.0 - behind };
            let part = Vec2::new(right, 1.0 - at.y / top).clamp(Vec2::ZERO, Vec2::ONE);
            let (corner, size) =
                (Vec2::new(across + GUTTER, above), Vec2::new(1.0, above + 0.5 - GUTTER / 2.0));
            corner + part * (size - corner)
        });
    }
    surface.into_mesh()
}

/// A flight of steps.
struct Flight {
    width: f32,
    steps: u32,
    rise: f32,
    going: f32,
    hollow: f32,
    noise: FastNoiseLite,
}

/// A point of the profile.
struct Point {
    /// z and y without wear.
    flat: Vec2,
    /// 0 for the lowest.
    step: u32,
    /// How much of the wear in the hollow and of that at the nose acts here.
    wear: Vec2,
}

impl Flight {
    /// The length of a step, by which its nose is measured.
    fn unit(&self) -> f32 {
        self.rise.min(self.going / 2.0)
    }

    /// From the back of the uppermost tread down to the foot, each step with the same number of points.
    fn profile(&self, cells: u32) -> Vec<Point> {
        let unit = self.unit();
        let (nose, radius, corner) = (OVERHANG * unit, ROUNDING * unit, CORNER * unit);
        let (fall, riser) = (FALL * self.going, cells.div_ceil(2));
        let mut points = Vec::new();
        for step in (0..self.steps).rev() {
            let foot = Vec2::new(-self.going * step as f32, self.rise * step as f32);
            let mut push = |z: f32, y: f32, wear: Vec2| {
                points.push(Point { flat: foot + Vec2::new(z, y), step, wear });
            };
            let deep = self.going + nose - radius - corner;
            // The back of the tread; of all but the uppermost it is the foot of the riser above.
            if step + 1 == self.steps {
                push(-self.going, self.rise + fall, Vec2::ZERO);
            }
            for cell in 0..=cells {
                let part = cell as f32 / cells as f32;
                let wear = Vec2::new((part * PI).sin().powi(2), part * part * (3.0 - 2.0 * part));
                push(corner - self.going + part * deep, self.rise + fall * (1.0 - part), wear);
            }
            let last = FRAC_PI_2 + FRAC_PI_4;
            for cell in 1..=NOSE {
                let part = cell as f32 / NOSE as f32;
                let (sin, cos) = (part * last).sin_cos();
                // The lip's wear ends with the nose.
                push(nose - radius + radius * sin, self.rise - radius + radius * cos, Vec2::Y * (1.0 - part));
            }
            // From the end of the nose back to the riser, at 45 degrees.
            let back = nose - radius + radius * FRAC_PI_4.sin();
            let under = self.rise - radius - radius * FRAC_PI_4.sin() - back;
            // All but the lowest riser stand on the back of a tread.
            let low = if step > 0 { fall } else { 0.0 };
            for cell in 0..=riser {
                let part = cell as f32 / riser as f32;
                push(0.0, under + part * (low + corner - under), Vec2::ZERO);
            }
            push(0.0, low, Vec2::ZERO);
        }
        points
    }

    /// A point at `x` metres from the middle, worn.
    fn at(&self, point: &Point, x: f32) -> Vec3 {
        // Other places and depths for each step; the noise is between -1 and 1.
        let pick = |what: f32| self.noise.get_noise_2d(7.3 * point.step as f32 + 0.37, what);
        let off = (x / self.width - 0.06 * pick(0.0)) / 0.43;
        let walked = (1.0 - off * off).max(0.0).powi(2) * (1.0 + 0.2 * pick(30.0));
        // Small unevenness, so that no puddle has a smooth shore; the ends of the steps are as they were cut.
        let ends = 1.0 - (2.0 * x / self.width).powi(6);
        let uneven = 0.15 * ends * self.noise.get_noise_2d(x * 9.0, point.flat.x * 9.0);
        let worn = point.wear.x * (walked + uneven) + LIP * point.wear.y * walked;
        Vec3::new(x, point.flat.y - self.hollow * worn, point.flat.x)
    }
}

/// Closes a side below `edge`, the profile from the top: in each step a fan around its middle, from which
/// all of its outline is seen.
fn push_side(surface: &mut Surface, flight: &Flight, edge: &[Vec3], normal: Vec3, uv: impl Fn(Vec3) -> Vec2) {
    let (x, rows) = (edge[0].x, (edge.len() - 1) / flight.steps as usize);
    for (down, step) in (0..flight.steps).rev().enumerate() {
        let (back, front) = (-flight.going * (step + 1) as f32, -flight.going * step as f32);
        let first = surface.positions.len() as u32;
        let mut push = |at: Vec3| surface.push(at, normal, uv(at));
        push(Vec3::new(x, flight.rise * (step as f32 + 0.5), (back + front) / 2.0));
        // Along the tread to the front, down the riser, and back along the ground.
        edge[down * rows..=(down + 1) * rows].iter().for_each(|&at| _ = push(at));
        if step > 0 {
            push(Vec3::new(x, 0.0, front));
        }
        let last = push(Vec3::new(x, 0.0, back));
        for a in first + 1..=last {
            let b = if a == last { first + 1 } else { a + 1 };
            surface.indices.extend(if normal.x > 0.0 { [first, a, b] } else { [first, b, a] });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::meshes::checks::{Parts, parts};
    use crate::scenes::meshes::grid::checks::{check, islands, open_edges};

    fn flight(steps: u32, cells: UVec2, seed: u32) -> Parts {
        parts(&stair(1.8, steps, 0.16, 0.32, 0.009, cells, seed).expect("valid"))
    }

    #[test]
    fn a_stair_is_sound_and_open_only_behind_and_below() {
        for (steps, cells, seed) in
            [(5, UVec2::new(96, 24), 1), (1, UVec2::ONE, 2), (9, UVec2::new(30, 11), 3)]
        {
            let parts = flight(steps, cells, seed);
            let rows = cells.y + cells.y.div_ceil(2) + 9;
            let triangles = 2 * steps * (cells.x * rows + rows + 3) - 2;
            assert_eq!(parts.triangles.len(), triangles as usize, "{steps} steps");
            check(&format!("{steps} steps"), &parts);
            assert_eq!(islands(&parts).len(), 3);
            let back = -0.32 * steps as f32;
            for [a, b] in open_edges(&parts) {
                let both = |f: &dyn Fn(Vec3) -> bool| f(a) && f(b);
                assert!(both(&|at| at.y == 0.0) || both(&|at| (at.z - back).abs() < 1e-5), "{a} {b}");
            }
        }
    }

    #[test]
    fn every_tread_holds_a_puddle_that_spills_over_the_middle_of_its_nose() {
        for seed in 0..4 {
            let flight = Flight {
                width: 1.8,
                steps: 5,
                rise: 0.16,
                going: 0.32,
                hollow: 0.009,
                noise: noise(seed, 3),
            };
            let profile = flight.profile(24);
            let rows = (profile.len() - 1) / 5;
            for (down, tread) in profile.chunks(rows).take(5).enumerate() {
                let y = |point: &Point, x: i32| flight.at(point, x as f32 * 0.01).y;
                // Where the water leaves: the lowest place along the nose, whose top is the last point of
                // the tread.
                let spill = (-90..=90).map(|x| (y(&tread[25], x), x));
                let (spill, x) = spill.fold((f32::MAX, 0), |low, at| if at.0 < low.0 { at } else { low });
                assert!(x.abs() < 30, "seed {seed}, step {down} spills at {x} cm");
                let depth = |x: i32| tread[..25].iter().map(|point| spill - y(point, x)).fold(0.0, f32::max);
                let deepest = (-90..=90).map(depth).fold(0.0, f32::max);
                assert!((0.004..0.011).contains(&deepest), "seed {seed}, step {down}: {deepest} m deep");
                let ends = [y(&tread[12], -90), y(&tread[12], 90)];
                assert!(ends.iter().all(|&end| end > spill), "the ends are not worn");
            }
        }
    }

    #[test]
    fn steps_stand_where_they_should_and_each_seed_wears_them_its_own_way() {
        let parts = flight(5, UVec2::new(24, 8), 1);
        let (low, high) = parts
            .positions
            .iter()
            .fold((Vec3::MAX, Vec3::MIN), |(low, high), &at| (low.min(at), high.max(at)));
        assert!(low.abs_diff_eq(Vec3::new(-0.9, 0.0, -1.6), 1e-5), "{low}");
        assert!((high.y - 0.8).abs() < 0.005 && high.z > 0.015 && high.z < 0.025, "{high}");
        let other = flight(5, UVec2::new(24, 8), 2);
        assert_ne!(parts.positions, other.positions);
        assert_eq!(parts.positions, flight(5, UVec2::new(24, 8), 1).positions);
    }

    #[test]
    fn bad_arguments_are_errors() {
        let cells = UVec2::splat(4);
        let not_positive = |result| matches!(result, Err(MeshError::NotPositive { .. }));
        assert!(not_positive(stair(0.0, 3, 0.16, 0.3, 0.008, cells, 0)));
        assert!(not_positive(stair(1.0, 3, f32::NAN, 0.3, 0.008, cells, 0)));
        assert!(not_positive(stair(1.0, 3, 0.16, -0.3, 0.008, cells, 0)));
        assert!(not_positive(stair(1.0, 3, 0.16, 0.3, 0.04, cells, 0)));
        let too_few = |result| matches!(result, Err(MeshError::TooFew { .. }));
        assert!(too_few(stair(1.0, 0, 0.16, 0.3, 0.008, cells, 0)));
        assert!(too_few(stair(1.0, 3, 0.16, 0.3, 0.008, UVec2::new(0, 1), 0)));
        assert!(too_few(stair(1.0, 3, 0.16, 0.3, 0.008, UVec2::new(1, 0), 0)));
        let too_many = |result| matches!(result, Err(MeshError::TooMany { .. }));
        assert!(too_many(stair(1.0, 3, 0.16, 0.3, 0.008, UVec2::MAX, 0)));
        assert!(too_many(stair(1.0, u32::MAX, 0.16, 0.3, 0.008, UVec2::MAX, 0)));
        assert!(too_many(stair(1.0, u32::MAX, 0.16, 0.3, 0.008, UVec2::ONE, 0)));
    }
}
