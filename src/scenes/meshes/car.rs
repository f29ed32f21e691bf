//! The body of a small car.

use bevy::math::{Vec2, Vec3, vec2};
use bevy::mesh::Mesh;

use super::grid::{countable, push_grid};
use super::{MeshError, Surface, at_least, positive};

// All of the shape is in lengths of the car.

/// Half the width, and the height.
const HALF: f32 = 0.21;
const HEIGHT: f32 = 0.36;
/// The outline seen from +z, in three curves with corners in between: up the tail to the edge of the roof,
/// over roof, windscreen and bonnet to its lip, and down the nose. What bulges is added to it.
const TAIL: [Vec2; 5] =
    [vec2(-0.465, 0.0), vec2(-0.483, 0.07), vec2(-0.483, 0.17), vec2(-0.474, 0.21), vec2(-0.425, 0.333)];
const TOP: [Vec2; 5] =
    [vec2(-0.425, 0.333), vec2(-0.18, 0.344), vec2(0.02, 0.33), vec2(0.21, 0.215), vec2(0.468, 0.165)];
const NOSE: [Vec2; 4] = [vec2(0.468, 0.165), vec2(0.483, 0.11), vec2(0.483, 0.05), vec2(0.46, 0.0)];
/// Distance of the samples that round the corners within a curve.
const BLUR: f32 = 0.012;
/// How wide the edges along the outline are rounded, and how far they fall there, on top and on the sides.
const ROUND: f32 = 0.03;
const ROUND_TOP: f32 = 0.009;
const ROUND_SIDE: f32 = 0.012;
/// How far the middle of the roof bulges.
const CROWN: f32 = 0.008;
/// Height below which tail, nose and sills are drawn in.
const FOOT: f32 = 0.05;
/// Where the wheels turn: x of the rear and the front axle, and their height.
const AXLES: [f32; 2] = [-0.29, 0.31];
const AXLE: f32 = 0.07;
/// Radii where arches and wheels begin, how wide the slopes there are, and how deep or high they go.
const ARCH: [f32; 3] = [0.108, 0.024, 0.018];
const WHEEL: [f32; 3] = [0.076, 0.016, 0.011];
/// Columns of a side to a row.
const COLUMNS: u32 = 3;
/// Free space between the islands, in uv.
const APART: f32 = 0.02;

/// A hatchback that stands on `y = 0`, centred on the origin, its nose towards +x.
///
/// `length` is in metres; the car is 0.42 as wide and 0.36 as high, within a hundredth. Bonnet,
/// windscreen, roof and tailgate are one skin with rounded edges. The cabin narrows upwards; in the sides
/// are half-round arches, and in these the wheels, all shallow. It is closed below by a level floor.
///
/// `cells` is the number of quads across the width and up a side, at least 4; a side has three times as many
/// along the car. Wheels and arches show from about 16. The mesh has `28 * cells * cells` triangles.
///
/// The uvs are four islands, all as large to the metre and a fiftieth of the map apart. On the left is the
/// skin, with `v` from the foot of the tail over the roof down to the foot of the nose, so that water runs
/// from the windscreen over the bonnet without meeting a seam. Right of it lie, one below the other, the side
/// at +z, the one at -z and the floor. Along their borders islands have the same positions, and edges that
/// are shaded as such.
///
/// # Errors
/// [`MeshError::NotPositive`], [`MeshError::TooFew`], [`MeshError::TooMany`].
pub fn car(length: f32, cells: u32) -> Result<Mesh, MeshError> {
    positive("length", length)?;
    at_least("cells", 4, cells)?;
    // Skin, sides and floor have `14 * cells + 4` rows of `cells + 1` vertices.
    countable(cells, 0, 14 * u64::from(cells), 3)?;

    let body = Body::new(cells);
    let (columns, skin_rows) = (COLUMNS * cells, body.outline.len() as u32 - 1);
    // Arc length along the outline.
    let mut walked = vec![0.0];
    for pair in body.outline.windows(2) {
        walked.push(walked[walked.len() - 1] + pair[0].distance(pair[1]));
    }
    // How much of the map one length of the car is: what fits across, and down on the left and on the right.
    let across = (1.0 - APART) / (2.0 * HALF + 1.0);
    let down = (1.0 - 2.0 * APART) / (2.0 * HEIGHT + 2.0 * HALF);
    let scale = across.min(1.0 / walked[walked.len() - 1]).min(down);
    let right = 2.0 * HALF * scale + APART;
    let uv = |u: f32, v: f32| vec2(u, v).clamp(Vec2::ZERO, Vec2::ONE);

    let mut surface = Surface::default();
    push_grid(&mut surface, cells, skin_rows, |column, row| {
        let at = body.skin(column, row);
        (at * length, uv((HALF - at.z) * scale, walked[row as usize] * scale))
    });
    for (side, above) in [(1.0, 0.0), (-1.0, HEIGHT * scale + APART)] {
        push_grid(&mut surface, columns, cells, |column, row| {
            let at = body.side(if side > 0.0 { column } else { columns - column }, row);
            let uv = uv(right + (0.5 + at.x * side) * scale, above + (HEIGHT - at.y) * scale);
            (Vec3::new(at.x, at.y, at.z * side) * length, uv)
        });
    }
    let above = 2.0 * (HEIGHT * scale + APART);
    push_grid(&mut surface, columns, cells, |column, row| {
        let at = match column {
            0 => body.skin(row, 0),
            column if column == columns => body.skin(row, skin_rows),
            column => body.side(column, cells) * Vec3::new(1.0, 1.0, body.across(row)),
        };
        (at * length, uv(right + (0.5 + at.x) * scale, above + (HALF - at.z) * scale))
    });
    surface.into_mesh()
}

/// The shape of the car, one unit long.
struct Body {
    cells: u32,
    /// Seen from +z, from the foot of the tail to that of the nose: `cells` pieces up to the roof,
    /// `COLUMNS * cells` to the lip of the bonnet, `cells` down to the ground.
    outline: Vec<Vec2>,
}

impl Body {
    fn new(cells: u32) -> Self {
        let mut outline = curve(&TAIL, cells);
        outline.extend(curve(&TOP, COLUMNS * cells).into_iter().skip(1));
        outline.extend(curve(&NOSE, cells).into_iter().skip(1));
        Self { cells, outline }
    }

    /// A column's place between the sides, 1 at +z and -1 at -z, in narrower steps where the edges are round.
    fn across(&self, column: u32) -> f32 {
        let even = 1.0 - 2.0 * column as f32 / self.cells as f32;
        0.5 * even * (3.0 - even * even)
    }

    /// On the skin over nose, roof and tail; columns from +z to -z, rows along the outline.
    fn skin(&self, column: u32, row: u32) -> Vec3 {
        let (row, across) = (row as usize, self.across(column));
        let (at, last) = (self.outline[row], self.outline.len() - 1);
        let half = half_width(at);
        // 0 in the middle, 1 at the sides, to the bit.
        let edge = ((across.abs() - 1.0) * half / ROUND + 1.0).max(0.0);
        let bulge = ROUND_TOP * (1.0 - edge * edge) + CROWN * (1.0 - across * across);
        let ahead = self.outline[(row + 1).min(last)] - self.outline[row.saturating_sub(1)];
        // Level on the ground, where the floor begins.
        let out = ahead.perp().normalize_or_zero() * vec2(1.0, (at.y / FOOT).min(1.0));
        (at + bulge * out).extend(half * across)
    }

    /// On the side at +z; columns from the tail to the nose, rows from the top.
    fn side(&self, column: u32, row: u32) -> Vec3 {
        let (cells, columns) = (self.cells, COLUMNS * self.cells);
        let edge = |row: u32| self.outline[row as usize];
        let at = match (column, row) {
            (0, row) => edge(cells - row),
            (column, row) if column == columns => edge(cells + columns + row),
            (column, 0) => edge(cells + column),
            // Between the four edges as in Coons, "Surfaces for computer-aided design of space forms", 1967.
            _ => {
                let (u, v) = (column as f32 / columns as f32, row as f32 / cells as f32);
                let (tail, nose) = (edge(cells - row), edge(cells + columns + row));
                let corners = edge(cells).lerp(edge(cells + columns), u);
                tail.lerp(nose, u) + (1.0 - v) * (edge(cells + column) - corners)
            }
        };
        at.extend(half_width(at))
    }
}

/// `pieces` of equal length along `points`, with round corners.
fn curve(points: &[Vec2], pieces: u32) -> Vec<Vec2> {
    let length: f32 = points.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let last = points.len() - 1;
    let at = |mut walked: f32| {
        let mut i = 0;
        // Beyond the ends it goes straight on.
        while i + 1 < last && walked > points[i].distance(points[i + 1]) {
            walked -= points[i].distance(points[i + 1]);
            i += 1;
        }
        points[i].lerp(points[i + 1], walked / points[i].distance(points[i + 1]))
    };
    let smooth = |piece: u32| {
        let walked = length * piece as f32 / pieces as f32;
        [-2.0f32, -1.0, 0.0, 1.0, 2.0].map(|off| at(walked + off * BLUR)).iter().sum::<Vec2>() / 5.0
    };
    // The ends to the bit: there the curves meet.
    [points[0]].into_iter().chain((1..pieces).map(smooth)).chain([points[last]]).collect()
}

/// Half the width of the car at a place seen from the side.
fn half_width(at: Vec2) -> f32 {
    let squared = |part: f32| part.max(0.0).powi(2);
    let ends = 0.03 * squared((at.x.abs() - 0.3) / 0.2);
    let cabin = 1.3 * squared(at.y - 0.17);
    let sill = 0.015 * squared(1.0 - at.y / FOOT);
    let curves: [&[Vec2]; 3] = [&TAIL, &TOP, &NOSE];
    let pairs = curves.into_iter().flat_map(|curve| curve.windows(2));
    let distances = pairs.map(|pair| {
        let along = pair[1] - pair[0];
        let part = (at - pair[0]).dot(along) / along.length_squared();
        at.distance(pair[0] + along * part.clamp(0.0, 1.0))
    });
    let rim = distances.fold(f32::MAX, f32::min);
    let round = ROUND_SIDE * squared(1.0 - rim / ROUND);
    let smooth = |[from, wide, high]: [f32; 3], radius: f32| {
        let part = ((from - radius) / wide).clamp(0.0, 1.0);
        high * part * part * (3.0 - 2.0 * part)
    };
    let wheels = AXLES.map(|x| {
        let off = at - vec2(x, AXLE);
        // Arches are open to the ground.
        smooth(ARCH, vec2(off.x, off.y.max(0.0)).length()) - smooth(WHEEL, off.length())
    });
    HALF - ends - cabin - sill - round - wheels[0] - wheels[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::meshes::checks::parts;
    use crate::scenes::meshes::grid::checks::{check, islands, open_edges};

    #[test]
    fn a_car_is_sound_closed_and_has_four_islands_well_apart() {
        for (length, cells) in [(4.0, 4), (0.3, 7), (4.0, 16), (4.2, 33), (4.0, 64)] {
            let parts = parts(&car(length, cells).expect("valid"));
            assert_eq!(parts.triangles.len(), (28 * cells * cells) as usize);
            check(&format!("{cells} cells"), &parts);
            assert!(open_edges(&parts).is_empty());
            let islands = islands(&parts);
            assert_eq!(islands.len(), 4);
            for (i, (low, high)) in islands.iter().enumerate() {
                let gaps = islands[i + 1..].iter().map(|other| (*low - other.1).max(other.0 - *high));
                assert!(gaps.map(Vec2::max_element).all(|gap| gap > 0.0199), "{cells} cells");
            }
            let corners = parts.triangles.iter().map(|triangle| triangle.map(|i| parts.positions[i]));
            let volume: f32 = corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
            assert!((0.1..0.125).contains(&(volume / length.powi(3))), "{cells} cells: {volume} m3");
        }
    }

    #[test]
    fn it_stands_on_the_ground_in_the_middle_with_its_proportions() {
        for cells in [4, 33] {
            let positions = parts(&car(4.0, cells).expect("valid")).positions;
            let low = positions.iter().fold(Vec3::MAX, |low, &at| low.min(at));
            let high = positions.iter().fold(Vec3::MIN, |high, &at| high.max(at));
            assert!(low.y == 0.0 && low.z == -high.z && (low.x + high.x).abs() < 0.02, "{low} {high}");
            let part = (high - low) / (4.0 * Vec3::new(1.0, HEIGHT, 2.0 * HALF));
            assert!((part - Vec3::ONE).abs().max_element() < 0.01, "{part}");
        }
    }

    #[test]
    fn a_metre_is_about_as_long_everywhere_in_the_map() {
        let parts = parts(&car(4.0, 32).expect("valid"));
        let densities = parts.triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.map(|i| parts.positions[i]);
            let [p, q, r] = triangle.map(|i| parts.uvs[i]);
            ((q - p).perp_dot(r - p).abs() / (b - a).cross(c - a).length()).sqrt()
        });
        let mut densities: Vec<f32> = densities.collect();
        densities.sort_by(f32::total_cmp);
        // All but the corners at the lip of the bonnet and at the edge of the roof.
        let part = |percent: usize| densities[densities.len() * percent / 100];
        assert!(part(99) < 1.4 * part(1), "{} to {}", part(1), part(99));
    }

    #[test]
    fn wheels_stand_in_arches_and_the_cabin_is_narrower_than_the_doors() {
        let door = half_width(vec2(0.0, 0.15));
        for x in AXLES {
            let (arch, wheel) = (half_width(vec2(x, 0.15)), half_width(vec2(x, AXLE)));
            assert!(door > wheel + 0.004 && wheel > arch + 0.009, "{door} {wheel} {arch}");
        }
        assert!(half_width(vec2(-0.2, 0.33)) < door - 0.03);
    }

    #[test]
    fn bad_arguments_are_errors() {
        for length in [0.0, -4.0, f32::NAN, f32::INFINITY] {
            assert!(matches!(car(length, 16), Err(MeshError::NotPositive { .. })));
        }
        assert!(matches!(car(4.0, 3), Err(MeshError::TooFew { .. })));
        assert!(matches!(car(4.0, u32::MAX), Err(MeshError::TooMany { .. })));
    }
}
