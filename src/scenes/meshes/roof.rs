//! A pitched roof of tiles.

use std::f32::consts::TAU;

use bevy::math::{UVec2, Vec2, Vec3};
use bevy::mesh::Mesh;

use super::grid::{GUTTER, countable, push_grid};
use super::{MeshError, Surface, at_least, positive};

/// Thickness of the roof below its channels, in metres.
const THICKNESS: f32 = 0.04;
/// From the bottom of a channel to the ridge beside it, in widths of a tile.
const WAVE: f32 = 0.16;
/// How far the end of a tile lies above the next one, in lengths of a tile.
const STEP: f32 = 0.04;
/// How far the foot of that end stands out before a plumb line, over its height: nothing drips onto the
/// next course.
const LEAN: f32 = 0.4;
/// Quads from the upper to the lower side.
const EDGE: u32 = 4;
/// The first and the last quad along a tile, in lengths of a tile.
const END: f32 = 0.02;
/// Width of the level strip below the eave, in metres. Water that comes over the eave hangs there and
/// drips; up the slope behind, it could not.
const SOFFIT: f32 = 0.03;
/// How much of the map the lower side gets to a metre, over the upper one: hardly any water comes there.
const UNDERSIDE: f32 = 0.25;

/// A roof that slopes down towards +z. The origin is in the middle of the lower edge of its eave: the roof
/// lies above and behind, and overhangs a wall that stands at a negative z.
///
/// `size` is the extent along x and along the slope in metres, `pitch_deg` the slope, above 0 and below 60
/// degrees. `tiles` is the number of tiles across and up the slope. They are waved like pantiles: water
/// gathers in the channels, one for each tile across, and drips from their ends, `size.x / tiles.x` apart;
/// the outermost ones lie half of that inside the ends, which are high. Each course ends a little above the
/// next one. The roof is 4 centimetres thick below its channels, its eave plumb with a narrow level strip
/// below it, and it is closed all around.
///
/// `cells` is the number of quads across a tile and along it, at least 4. With `rows`, which is
/// `tiles.y * (cells + 1) - 1`, the mesh has `4 * tiles.x * cells * (rows + 4) + 16 * rows` triangles.
///
/// The uvs of ridge, upper side, eave and lower side are one sheet, in this order: `u` grows with x, `v` on
/// the way down, so that water runs over the eave without meeting a seam. The lower side has a quarter of
/// the length it has in the world. To the right of the sheet lie the two gables, the one at -x first, with
/// gutters in between; along their edges they have the same positions as the sheet, as have its first and
/// its last row.
///
/// # Errors
/// [`MeshError::NotPositive`], also for a pitch that is out of range; [`MeshError::TooFew`],
/// [`MeshError::TooMany`].
pub fn roof(size: Vec2, pitch_deg: f32, tiles: UVec2, cells: u32) -> Result<Mesh, MeshError> {
    positive("size.x", size.x)?;
    positive("size.y", size.y)?;
    positive("pitch_deg", pitch_deg)?;
    positive("60 - pitch_deg", 60.0 - pitch_deg)?;
    at_least("tiles.x", 1, tiles.x)?;
    at_least("tiles.y", 1, tiles.y)?;
    at_least("cells", 4, cells)?;
    let too_many = MeshError::TooMany { columns: tiles.x.saturating_mul(cells), rows: tiles.y };
    let columns = tiles.x.checked_mul(cells).ok_or(too_many)?;
    // Both sides and their edges.
    let most_rows = (2 * u64::from(cells) + 2).checked_mul(u64::from(tiles.y));
    countable(columns, 8, most_rows.unwrap_or(u64::MAX), 2 * u64::from(EDGE) + 4)?;

    let tiled = Tiled::new(size, pitch_deg, tiles, cells);
    let rows = tiled.rows.len() as u32 - 1;
    // Metres along the sheet to where each part ends.
    let thick = THICKNESS + tiled.wave;
    let eave = thick + size.y;
    let under = eave + thick;
    let length = under + SOFFIT + UNDERSIDE * size.y;
    let across = (1.0 - 2.0 * GUTTER) * size.x / (size.x + 2.0 * thick);
    let mut surface = Surface::default();
    // How far from the upper to the lower side, 0 to 1.
    let lower = |row: u32| row as f32 / EDGE as f32;
    let down = |along: u32| size.y * tiled.rows[along as usize].down;
    let mut push = |rows: u32, place: &dyn Fn(u32) -> (u32, f32, f32)| {
        push_grid(&mut surface, columns, rows, |column, row| {
            let (along, lower, walked) = place(row);
            let part = column as f32 / columns as f32;
            (tiled.at(part, along, lower), Vec2::new(part * across, (walked / length).min(1.0)))
        });
    };
    push(EDGE, &|row| (0, lower(EDGE - row), thick * lower(row)));
    push(rows, &|row| (row, 0.0, thick + down(row)));
    push(EDGE, &|row| (rows, lower(row), eave + thick * lower(row)));
    push(rows, &|row| {
        let behind = if row > 0 { SOFFIT + UNDERSIDE * (size.y - down(rows - row)) } else { 0.0 };
        (rows - row, 1.0, under + behind)
    });
    let wide = (1.0 - across) / 2.0 - GUTTER;
    for (part, from) in [(0.0, across + GUTTER), (1.0, across + wide + 2.0 * GUTTER)] {
        push_grid(&mut surface, EDGE, rows, |column, along| {
            // Seen from outside, downhill being down, the upper side is on the right of the gable at -x.
            let column = if part > 0.0 { column } else { EDGE - column };
            let lower = lower(column);
            let right = if part > 0.0 { lower } else { 1.0 - lower };
            let uv = Vec2::new(from + right * wide, tiled.rows[along as usize].down);
            (tiled.at(part, along, lower), uv.min(Vec2::ONE))
        });
    }
    surface.into_mesh()
}

/// What is known of a row of vertices: how far down the slope it lies, and how far above the course below.
struct Row {
    /// 0 at the ridge, 1 at the eave.
    down: f32,
    /// Metres.
    raised: f32,
}

/// The shape of the roof.
struct Tiled {
    size: Vec2,
    tiles: UVec2,
    /// From a channel to a ridge, in metres.
    wave: f32,
    /// Unit vectors down the slope and out of the roof.
    downhill: Vec3,
    out: Vec3,
    /// How far the upper side is shifted up the slope against the lower one, in metres: as far as makes the
    /// eave plumb where it is thickest, so that water runs down over it to its lower edge.
    shift: f32,
    rows: Vec<Row>,
}

impl Tiled {
    fn new(size: Vec2, pitch_deg: f32, tiles: UVec2, cells: u32) -> Self {
        let (sin, cos) = pitch_deg.to_radians().sin_cos();
        let course = size.y / tiles.y as f32;
        let step = STEP * course;
        let mut rows = Vec::new();
        for tile in 0..tiles.y {
            // All but the uppermost tile begin where the end of the one above has come down.
            let from = if tile > 0 { STEP * (sin / cos + LEAN) } else { 0.0 };
            for cell in 0..=cells {
                let part = match cell {
                    0 => 0.0,
                    cell if cell == cells => 1.0,
                    cell => END + (1.0 - 2.0 * END) * (cell - 1) as f32 / (cells - 2) as f32,
                };
                let down = (tile as f32 + from + (1.0 - from) * part) / tiles.y as f32;
                rows.push(Row { down, raised: step * part });
            }
        }
        let wave = WAVE * size.x / tiles.x as f32;
        let shift = (THICKNESS + wave + step) * sin / cos;
        let (downhill, out) = (Vec3::new(0.0, -sin, cos), Vec3::new(0.0, cos, sin));
        Self { size, tiles, wave, downhill, out, shift, rows }
    }

    /// At a part of the width, in a row, and a part of the way from the upper to the lower side.
    fn at(&self, part: f32, along: u32, lower: f32) -> Vec3 {
        let row = &self.rows[along as usize];
        let right = Vec3::X * ((part - 0.5) * self.size.x);
        let wave = 0.5 + 0.5 * (part * self.tiles.x as f32 * TAU).cos();
        let up = (row.down - 1.0) * self.size.y;
        let thickness = THICKNESS + self.wave * wave + row.raised;
        let above = self.downhill * (up - self.shift) + self.out * thickness;
        // The last quad of the lower side is the soffit.
        let soffit = if along as usize + 1 < self.rows.len() { Vec3::NEG_Z * SOFFIT } else { Vec3::ZERO };
        let end = &self.rows[self.rows.len() - 2];
        let below = self.downhill * ((row.down / end.down).min(1.0) - 1.0) * self.size.y + soffit;
        right + above.lerp(below, lower)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::meshes::checks::parts;
    use crate::scenes::meshes::grid::checks::{check, islands, open_edges};

    const SIZE: Vec2 = Vec2::new(2.4, 1.2);
    const TILES: UVec2 = UVec2::new(12, 4);

    #[test]
    fn a_roof_is_sound_closed_and_has_three_islands() {
        for (size, pitch, tiles, cells) in [
            (SIZE, 30.0, TILES, 10),
            (SIZE, 5.0, UVec2::ONE, 4),
            (Vec2::new(1.0, 4.0), 55.0, UVec2::new(3, 9), 7),
        ] {
            let parts = parts(&roof(size, pitch, tiles, cells).expect("valid"));
            let rows = tiles.y * (cells + 1) - 1;
            let triangles = 4 * tiles.x * cells * (rows + 4) + 16 * rows;
            assert_eq!(parts.triangles.len(), triangles as usize);
            check(&format!("{size} at {pitch}"), &parts);
            assert_eq!(islands(&parts).len(), 3);
            assert!(open_edges(&parts).is_empty());
            let corners = parts.triangles.iter().map(|triangle| triangle.map(|i| parts.positions[i]));
            let volume: f32 = corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
            assert!(volume > THICKNESS * size.x * size.y, "{volume} m3");
        }
    }

    #[test]
    fn the_eave_is_lowest_in_front_and_its_lower_edge_is_at_the_origin() {
        let positions = parts(&roof(SIZE, 30.0, TILES, 10).expect("valid")).positions;
        let lowest: Vec<&Vec3> = positions.iter().filter(|at| at.y < 1e-6).collect();
        assert!(lowest.len() > 100 && lowest.iter().all(|at| at.y.abs() < 1e-6 && at.z > -1.1 * SOFFIT));
        // The eave stands plumb or falls back above its lower edge: nothing drips but from below it.
        assert!(positions.iter().all(|at| at.z < 1e-4 && at.x.abs() <= SIZE.x / 2.0));
        assert!(lowest.iter().any(|at| at.z < -0.9 * SOFFIT));
    }

    #[test]
    fn channels_drain_to_the_eave_and_lie_between_higher_ends() {
        let tiled = Tiled::new(SIZE, 20.0, TILES, 10);
        for tile in 0..TILES.x {
            let middle = (tile as f32 + 0.5) / TILES.x as f32;
            let y = |along: usize| tiled.at(middle, along as u32, 0.0).y;
            assert!((1..tiled.rows.len()).all(|along| y(along) < y(along - 1)), "tile {tile}");
            for side in [tile, tile + 1] {
                let ridge = tiled.at(side as f32 / TILES.x as f32, 7, 0.0).y;
                assert!(ridge > y(7) + 0.02, "tile {tile}");
            }
        }
    }

    #[test]
    fn bad_arguments_are_errors() {
        for (size, pitch) in
            [(Vec2::new(0.0, 1.0), 30.0), (SIZE, 0.0), (SIZE, 60.0), (SIZE, f32::NAN), (Vec2::NAN, 30.0)]
        {
            assert!(matches!(roof(size, pitch, TILES, 10), Err(MeshError::NotPositive { .. })));
        }
        for (tiles, cells) in [(UVec2::new(0, 1), 10), (UVec2::new(1, 0), 10), (TILES, 3)] {
            assert!(matches!(roof(SIZE, 30.0, tiles, cells), Err(MeshError::TooFew { .. })));
        }
        for (tiles, cells) in [(UVec2::MAX, 10), (TILES, u32::MAX), (UVec2::new(1, u32::MAX), u32::MAX)] {
            assert!(matches!(roof(SIZE, 30.0, tiles, cells), Err(MeshError::TooMany { .. })));
        }
    }
}
