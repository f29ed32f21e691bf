//! A stone plate with a bas-relief.

use bevy::math::{UVec2, Vec2, Vec3};
use bevy::mesh::Mesh;

use super::carving::Carving;
use super::grid::{countable, push_grid};
use super::{MeshError, Surface, at_least, positive};

/// Quads from the front to the back of the plate.
const ACROSS_THE_EDGE: u32 = 6;
/// The steepest the stone stands, as a slope of the front: 58 degrees. A grid cannot shade what is steeper.
const STEEPEST: f32 = 1.6;
/// Slope of the upper side: 4 degrees.
const FALL: f32 = 0.07;

/// An upright stone plate that faces +z, its lower edge at `y = 0` and its back at `z = 0`, with a
/// bas-relief.
///
/// A moulded frame, and in it a niche with a shell, the face of a sun and a palmette; each `seed` has other
/// marks of the chisel and other wear. `size` is the extent in metres along x, with 0 in the middle, and
/// along y. The carving fills a plate of 3 to 4; in others it stands in the middle. `depth` is how far the
/// face lies above the deepest hollow, in metres; a twentieth of the width looks right. The plate is as
/// thick again behind that hollow: it reaches to `z = 2 * depth`. Its upper side falls 4 degrees to the
/// front, so rain that lies there runs down over the carving. There is no back: it stands against a wall.
///
/// `cells` is the number of quads along x and y over the front, and 192 by 256 show the carving. The mesh
/// has `2 * (cells.x * cells.y + 12 * (cells.x + cells.y))` triangles.
///
/// The uvs are the plate unfolded: the front in the middle, each of its four edges folded out from it, so
/// that water runs from the upper edge down over the front without meeting a seam. Only from one edge to
/// the next, around a corner of the plate, is there one, with the same positions on both sides. `u` grows
/// with x and `v` downwards; a metre is as long in `u` everywhere, and as long in `v`, but for the slopes
/// of the carving.
///
/// # Errors
/// [`MeshError::NotPositive`] and [`MeshError::TooFew`] for a plate without area, [`MeshError::TooMany`].
pub fn bas_relief(size: Vec2, depth: f32, cells: UVec2, seed: u32) -> Result<Mesh, MeshError> {
    positive("size.x", size.x)?;
    positive("size.y", size.y)?;
    positive("depth", depth)?;
    at_least("cells.x", 1, cells.x)?;
    at_least("cells.y", 1, cells.y)?;
    let edges = 2 * u64::from(ACROSS_THE_EDGE) + 5;
    countable(cells.x, edges, u64::from(cells.y), edges)?;

    let front = Front::new(size, depth, cells, seed);
    let folded = 2.0 * depth;
    let unfolded = size + 2.0 * folded;
    // Distances from the upper left corner of the unfolded plate, in metres.
    let uv = |right: f32, down: f32| (Vec2::new(right, down) / unfolded).clamp(Vec2::ZERO, Vec2::ONE);
    let (right_of, below) = (folded + size.x, folded + size.y);
    let mut surface = Surface::default();
    push_grid(&mut surface, cells.x, cells.y, |column, row| {
        let at = front.at(column, row);
        (at, uv(folded + (at.x + size.x / 2.0), folded + (size.y - at.y)))
    });
    // How far towards the back, 0 to 1.
    let back = |step: u32| step as f32 / ACROSS_THE_EDGE as f32;
    // Lifts what lies behind, more the higher it is, so that the upper side falls to the front.
    let lift = FALL * folded / size.y;
    let behind = |at: Vec3, part: f32| Vec3::new(at.x, at.y * (1.0 + lift * part), at.z * (1.0 - part));
    let (last_column, last_row) = (cells.x, cells.y);
    push_grid(&mut surface, cells.x, ACROSS_THE_EDGE, |column, row| {
        let (at, part) = (front.at(column, 0), back(ACROSS_THE_EDGE - row));
        (behind(at, part), uv(folded + (at.x + size.x / 2.0), folded * (1.0 - part)))
    });
    push_grid(&mut surface, cells.x, ACROSS_THE_EDGE, |column, row| {
        let (at, part) = (front.at(column, last_row), back(row));
        (behind(at, part), uv(folded + (at.x + size.x / 2.0), below + folded * part))
    });
    push_grid(&mut surface, ACROSS_THE_EDGE, cells.y, |column, row| {
        let (at, part) = (front.at(0, row), back(ACROSS_THE_EDGE - column));
        (behind(at, part), uv(folded * (1.0 - part), folded + (size.y - at.y)))
    });
    push_grid(&mut surface, ACROSS_THE_EDGE, cells.y, |column, row| {
        let (at, part) = (front.at(last_column, row), back(column));
        (behind(at, part), uv(right_of + folded * part, folded + (size.y - at.y)))
    });
    surface.into_mesh()
}

/// The vertices of the front.
struct Front {
    size: Vec2,
    cells: UVec2,
    /// z of the vertices, row by row from the top, in metres.
    z: Vec<f32>,
}

impl Front {
    fn new(size: Vec2, depth: f32, cells: UVec2, seed: u32) -> Self {
        let mut front = Self { size, cells, z: Vec::new() };
        let carving = Carving::new(size, seed);
        for row in 0..=cells.y {
            for column in 0..=cells.x {
                front.z.push(depth * (1.0 + carving.height(front.flat(column, row))));
            }
        }
        front.lean_walls();
        front.smooth();
        front
    }

    /// x and y of a vertex.
    fn flat(&self, column: u32, row: u32) -> Vec2 {
        let part =
            Vec2::new(column as f32 / self.cells.x as f32 - 0.5, 1.0 - row as f32 / self.cells.y as f32);
        part * self.size
    }

    fn at(&self, column: u32, row: u32) -> Vec3 {
        let index = row as usize * (self.cells.x as usize + 1) + column as usize;
        self.flat(column, row).extend(self.z[index])
    }

    /// Cuts down what stands steeper than [`STEEPEST`] above what lies beside it, in the two sweeps of a
    /// distance transform (Borgefors, "Distance transformations in digital images", 1986).
    fn lean_walls(&mut self) {
        let stride = self.cells.x as usize + 1;
        let cell = self.size / self.cells.as_vec2();
        let rise = [cell.x, cell.y, cell.length()].map(|run| run * STEEPEST);
        let (columns, count) = (stride as isize, self.z.len() as isize);
        for forwards in [true, false] {
            let sign = if forwards { -1 } else { 1 };
            for step in 0..count {
                let i = if forwards { step } else { count - 1 - step };
                for (dx, dy, rise) in
                    [(sign, 0, rise[0]), (0, sign, rise[1]), (sign, sign, rise[2]), (-sign, sign, rise[2])]
                {
                    let (column, near) = (i % columns + dx, i + dx + dy * columns);
                    if (0..columns).contains(&column) && (0..count).contains(&near) {
                        self.z[i as usize] = self.z[i as usize].min(self.z[near as usize] + rise);
                    }
                }
            }
        }
    }

    /// A tent over three vertices along each axis: what is finer than the cells would end in teeth. Beyond
    /// the edges the edge goes on.
    fn smooth(&mut self) {
        let stride = self.cells.x as usize + 1;
        let count = self.z.len();
        let sharp = self.z.clone();
        let tent = |before: f32, here: f32, after: f32| 0.25 * before + 0.5 * here + 0.25 * after;
        let along: Vec<f32> = (0..count)
            .map(|i| {
                let (first, last) = (i - i % stride, i - i % stride + stride - 1);
                tent(sharp[i.max(first + 1) - 1], sharp[i], sharp[(i + 1).min(last)])
            })
            .collect();
        for (i, z) in self.z.iter_mut().enumerate() {
            let (above, below) = (i.checked_sub(stride).unwrap_or(i), i + stride);
            *z = tent(along[above], along[i], along[if below < count { below } else { i }]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::meshes::checks::{Parts, parts};
    use crate::scenes::meshes::grid::checks::{check, islands, open_edges};

    const SIZE: Vec2 = Vec2::new(0.9, 1.2);
    const DEPTH: f32 = 0.05;

    fn relief(cells: UVec2, seed: u32) -> Parts {
        parts(&bas_relief(SIZE, DEPTH, cells, seed).expect("valid"))
    }

    #[test]
    fn a_relief_is_sound_and_unfolds_to_one_island() {
        for (cells, seed) in [(UVec2::new(96, 128), 0), (UVec2::new(192, 256), 1), (UVec2::new(31, 17), 7)] {
            let parts = relief(cells, seed);
            let triangles = 2 * (cells.x * cells.y + 12 * (cells.x + cells.y));
            assert_eq!(parts.triangles.len(), triangles as usize);
            check(&format!("{cells}, seed {seed}"), &parts);
            assert_eq!(islands(&parts).len(), 1);
            // Nothing is open but the back.
            assert!(open_edges(&parts).iter().flatten().all(|at| at.z == 0.0));
        }
    }

    #[test]
    fn the_carving_uses_its_depth_and_no_more() {
        for seed in 0..3 {
            let cells = UVec2::new(96, 128);
            let parts = relief(cells, seed);
            let front = &parts.positions[..(97 * 129)];
            let (low, high) = front.iter().fold((1.0f32, 0.0f32), |(l, h), at| (l.min(at.z), h.max(at.z)));
            assert!((DEPTH..1.1 * DEPTH).contains(&low), "seed {seed}: {low}");
            assert!(high <= 2.0 * DEPTH && high > 1.95 * DEPTH, "seed {seed}: {high}");
            let normals = &parts.normals[..front.len()];
            assert!(normals.iter().all(|normal| normal.z > 0.2), "no undercuts, no cliffs");
        }
    }

    #[test]
    fn the_upper_side_faces_up_and_falls_to_the_front() {
        let cells = UVec2::new(24, 32);
        let parts = relief(cells, 1);
        let first = 25 * 33;
        let top = first..first + 25 * 7;
        assert!(parts.normals[top.clone()].iter().all(|n| n.y > 0.99 && n.z > 0.05 && n.z < 0.1));
        for at in &parts.positions[top] {
            assert!(at.y >= SIZE.y && at.y < SIZE.y + 0.1 * (2.0 * DEPTH - at.z) + 1e-6, "{at}");
        }
        let low = parts.positions.iter().map(|at| at.y).fold(1.0, f32::min);
        assert_eq!(low, 0.0);
    }

    #[test]
    fn each_seed_has_its_own_wear_over_the_same_carving() {
        let z =
            |seed| -> Vec<f32> { relief(UVec2::new(48, 64), seed).positions.iter().map(|at| at.z).collect() };
        let (one, other) = (z(1), z(2));
        assert_eq!(one, z(1));
        assert_ne!(one, other);
        let apart: f32 = one.iter().zip(&other).map(|(a, b)| (a - b).abs()).sum::<f32>() / one.len() as f32;
        assert!(apart < 0.05 * DEPTH, "{apart}");
    }

    #[test]
    fn any_proportions_and_the_fewest_cells_have_area() {
        for size in [Vec2::new(3.0, 0.5), Vec2::new(0.2, 2.0), Vec2::splat(1.0)] {
            for cells in [UVec2::ONE, UVec2::new(2, 3), UVec2::new(40, 40)] {
                let parts = parts(&bas_relief(size, 0.04, cells, 3).expect("valid"));
                check(&format!("{size}, {cells}"), &parts);
            }
        }
    }

    #[test]
    fn bad_arguments_are_errors() {
        let cells = UVec2::splat(4);
        for (size, depth) in [(Vec2::new(0.0, 1.0), 0.1), (Vec2::new(1.0, f32::NAN), 0.1), (Vec2::ONE, -0.1)]
        {
            assert!(matches!(bas_relief(size, depth, cells, 0), Err(MeshError::NotPositive { .. })));
        }
        let few = bas_relief(Vec2::ONE, 0.1, UVec2::new(0, 1), 0);
        assert!(matches!(few, Err(MeshError::TooFew { .. })));
        let many = bas_relief(Vec2::ONE, 0.1, UVec2::MAX, 0);
        assert!(matches!(many, Err(MeshError::TooMany { .. })));
    }
}
