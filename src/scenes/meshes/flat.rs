//! Sheets of quads: the ground, a road with basins, and a cloth that hangs.

use std::f32::consts::TAU;

use bevy::math::{UVec2, Vec2, Vec3, Vec4};
use bevy::mesh::Mesh;
use fastnoise_lite::FastNoiseLite;

use super::{MeshError, Surface, at_least, noise, positive};

/// A horizontal grid at `y = 0`, centred on the origin and facing up.
///
/// `size` is the extent along x and z in metres, `cells` the number of quads along each; the mesh has
/// `2 * cells.x * cells.y` triangles. `u` runs from 0 to 1 with x, `v` from 0 to 1 with z.
///
/// # Errors
/// [`MeshError::NotPositive`] and [`MeshError::TooFew`] for a grid without area, [`MeshError::TooMany`].
pub fn ground(size: Vec2, cells: UVec2) -> Result<Mesh, MeshError> {
    level_sheet(size, cells)?.into_mesh()
}

/// A [`ground`] that knows where water would gather: its vertex colours hold a terrain, the mesh is flat.
///
/// The green channel of [`Mesh::ATTRIBUTE_COLOR`] says how high a vertex lies in that terrain, from 0 at the
/// bottom of the deepest basin to 1 on the high ground; red, blue and alpha are 1. Several basins lie along
/// each length of the shorter side, scattered by `seed`. About 30 % of the area is lower than 0.35, and the
/// edges of the road are at 1, so that no puddle ends in a straight line there. The terrain belongs to the
/// road and not to its vertices, which only sample it: `cells` should give a basin several quads.
///
/// `StandardMaterial` multiplies vertex colours into its base colour, which would tint the basins magenta:
/// draw a road with a shader that reads the terrain and leaves the colour alone.
///
/// # Errors
/// Those of [`ground`].
pub fn road(size: Vec2, cells: UVec2, seed: u32) -> Result<Mesh, MeshError> {
    let mut surface = level_sheet(size, cells)?;
    let terrain = Terrain::new(size, seed);
    surface.colors = surface.uvs.iter().map(|&uv| Vec4::new(1.0, terrain.height(uv), 1.0, 1.0)).collect();
    surface.into_mesh()
}

/// A cloth that hangs in the x-y plane and faces +z, from its upper edge at `y = size.y` down to `y = 0`.
///
/// `size` is the extent along x and y in metres, centred on `x = 0`; `cells` is the number of quads along
/// each, and about 64 across show the folds; the mesh has `2 * cells.x * cells.y` triangles. The folds run
/// downwards and get deeper on the way, to about 2 % of the width to either side of `z = 0`. `u` runs from 0
/// to 1 with x, `v` from 0 at the top to 1.
///
/// The cloth has no thickness and no back: to be seen from behind, its material must not cull.
///
/// # Errors
/// Those of [`ground`].
pub fn cloth(size: Vec2, cells: UVec2) -> Result<Mesh, MeshError> {
    // How many folds there are over the width, their depth at the bottom in widths, their phase in radians.
    const FOLDS: [[f32; 3]; 3] = [[2.3, 0.011, 0.4], [5.1, 0.010, 2.0], [8.7, 0.004, 4.5]];
    // The share of that depth at the top, where something holds the cloth.
    const AT_THE_TOP: f32 = 0.2;
    let hang = |uv: Vec2| {
        let (mut wave, mut slope) = (0.0, 0.0);
        for [folds, depth, phase] in FOLDS {
            let (sin, cos) = (TAU * folds * uv.x + phase).sin_cos();
            wave += depth * sin;
            slope += depth * TAU * folds * cos;
        }
        let share = AT_THE_TOP + (1.0 - AT_THE_TOP) * uv.y;
        let position = Vec3::new((uv.x - 0.5) * size.x, (1.0 - uv.y) * size.y, share * wave * size.x);
        // dz/dx and dz/dy of that surface; y runs against v.
        let across = share * slope;
        let upwards = -(1.0 - AT_THE_TOP) * wave * size.x / size.y;
        (position, Vec3::new(-across, -upwards, 1.0).normalize())
    };
    sheet(size, cells, hang)?.into_mesh()
}

fn level_sheet(size: Vec2, cells: UVec2) -> Result<Surface, MeshError> {
    sheet(size, cells, |uv| {
        let at = (uv - 0.5) * size;
        (Vec3::new(at.x, 0.0, at.y), Vec3::Y)
    })
}

/// Rows of vertices whose positions and normals depend on where in the sheet they are.
fn sheet(size: Vec2, cells: UVec2, place: impl Fn(Vec2) -> (Vec3, Vec3)) -> Result<Surface, MeshError> {
    positive("size.x", size.x)?;
    positive("size.y", size.y)?;
    at_least("cells.x", 1, cells.x)?;
    at_least("cells.y", 1, cells.y)?;
    let mut surface = Surface::with_lattice(cells.x, cells.y)?;
    for row in 0..=cells.y {
        for column in 0..=cells.x {
            let uv = Vec2::new(column as f32 / cells.x as f32, row as f32 / cells.y as f32);
            let (position, normal) = place(uv);
            surface.push(position, normal, uv);
        }
    }
    Ok(surface)
}

/// Heights over the unit square, 0 to 1, high along its edges and with basins in between.
struct Terrain {
    noise: FastNoiseLite,
    /// Of the road, in lengths of its shorter side.
    extent: Vec2,
    /// The depth that becomes height 0.
    deepest: f32,
    /// The exponent that spreads the heights.
    bend: f32,
}

impl Terrain {
    /// How much of the road is low ...
    const LOW_SHARE: f32 = 0.3;
    /// ... and below which height that is.
    const LOW: f32 = 0.35;
    /// Features of the noise along the shorter side.
    const FEATURES: f32 = 2.0;
    /// How far the high edge reaches inwards, in lengths of the shorter side.
    const MARGIN: f32 = 0.12;
    /// Beyond this ratio of its sides a road gets longer basins, not more; larger numbers are too coarse.
    const LONGEST: f32 = 1000.0;

    fn new(size: Vec2, seed: u32) -> Self {
        const SAMPLES_PER_SIDE: u32 = 64;
        let extent = (size / size.min_element()).min(Vec2::splat(Self::LONGEST));
        let mut terrain = Self { noise: noise(seed, 2), extent, deepest: 1.0, bend: 1.0 };
        let mut depths: Vec<f32> = (0..SAMPLES_PER_SIDE * SAMPLES_PER_SIDE)
            .map(|i| {
                let cell = Vec2::new((i % SAMPLES_PER_SIDE) as f32, (i / SAMPLES_PER_SIDE) as f32);
                terrain.depth((cell + 0.5) / SAMPLES_PER_SIDE as f32)
            })
            .collect();
        depths.sort_unstable_by(f32::total_cmp);
        // Every seed has other basins, and all of them get the same share of low ground.
        let low = depths[((1.0 - Self::LOW_SHARE) * depths.len() as f32) as usize];
        terrain.deepest = depths[depths.len() - 1];
        terrain.bend = (1.0 - Self::LOW).ln() / (low / terrain.deepest).ln();
        terrain
    }

    fn height(&self, uv: Vec2) -> f32 {
        1.0 - (self.depth(uv) / self.deepest).clamp(0.0, 1.0).powf(self.bend)
    }

    /// 0 at the edges, more in the basins; neither scaled nor spread yet.
    fn depth(&self, uv: Vec2) -> f32 {
        let at = uv * self.extent;
        let to_the_edge = at.min(self.extent - at).min_element();
        let t = (to_the_edge / Self::MARGIN).clamp(0.0, 1.0);
        let at = at * Self::FEATURES;
        t * t * (3.0 - 2.0 * t) * (0.5 + 0.5 * self.noise.get_noise_2d(at.x, at.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::meshes::checks::parts;
    use bevy::mesh::VertexAttributeValues;

    fn colors(mesh: &Mesh) -> &[[f32; 4]] {
        match mesh.attribute(Mesh::ATTRIBUTE_COLOR) {
            Some(VertexAttributeValues::Float32x4(colors)) => colors,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_road_is_ground_with_high_edges_and_a_share_of_low_places() {
        let (size, cells) = (Vec2::new(9.0, 5.0), UVec2::new(90, 50));
        let ground = ground(size, cells).expect("valid");
        assert!(ground.attribute(Mesh::ATTRIBUTE_COLOR).is_none());
        for seed in [0, 1, 2, 3, u32::MAX / 2, u32::MAX] {
            let road = road(size, cells, seed).expect("valid");
            let (road_parts, ground_parts) = (parts(&road), parts(&ground));
            assert_eq!(road_parts.positions, ground_parts.positions);
            assert_eq!(colors(&road).len(), road_parts.positions.len());
            let mut fifths = [0; 5];
            for (uv, &[red, green, blue, alpha]) in road_parts.uvs.iter().zip(colors(&road)) {
                assert_eq!([red, blue, alpha], [1.0; 3]);
                assert!((0.0..=1.0).contains(&green), "seed {seed}, {uv}: {green}");
                let edge = uv.min(1.0 - *uv).min_element() == 0.0;
                assert!(!edge || green > 0.8, "seed {seed}, {uv}: {green}");
                fifths[((green * 5.0) as usize).min(4)] += 1;
            }
            let share = |count: usize| count as f32 / colors(&road).len() as f32;
            let low = share(colors(&road).iter().filter(|color| color[1] < 0.35).count());
            assert!((0.25..0.35).contains(&low), "seed {seed}: {low} of the road is low");
            assert!(fifths.iter().all(|&count| share(count) > 0.05), "seed {seed}: {fifths:?}");
        }
    }

    #[test]
    fn a_road_has_several_basins_and_each_seed_has_its_own() {
        let cells = UVec2::splat(64);
        let road = |seed| road(Vec2::splat(6.0), cells, seed).expect("valid");
        let (first, second) = (road(1), road(2));
        assert_eq!(colors(&first), colors(&road(1)));
        assert_ne!(colors(&first), colors(&second));
        for mesh in [&first, &second] {
            let height = |x: u32, z: u32| colors(mesh)[(z * (cells.x + 1) + x) as usize][1];
            let mut bottoms = 0;
            for (x, z) in (1..cells.x).flat_map(|x| (1..cells.y).map(move |z| (x, z))) {
                let around = (0..9).map(|i| height(x + i % 3 - 1, z + i / 3 - 1));
                let lowest = around.fold(f32::INFINITY, f32::min);
                bottoms += u32::from(height(x, z) < 0.35 && height(x, z) == lowest);
            }
            assert!((3..40).contains(&bottoms), "{bottoms} basins");
        }
    }

    #[test]
    fn roads_of_any_proportion_have_heights() {
        for size in [Vec2::new(1.0e-30, 1.0e3), Vec2::new(500.0, 1.0), Vec2::splat(1.0e-3)] {
            let terrain = Terrain::new(size, 3);
            for i in 0..=100 {
                let uv = Vec2::new(i as f32 / 100.0, 0.5);
                assert!((0.0..=1.0).contains(&terrain.height(uv)), "{size}, {uv}");
            }
        }
    }

    #[test]
    fn a_cloth_hangs_from_its_upper_edge_and_its_folds_deepen() {
        let (size, cells) = (Vec2::new(1.2, 1.6), UVec2::new(64, 40));
        let parts = parts(&cloth(size, cells).expect("valid"));
        let stride = cells.x as usize + 1;
        let depth = |row: &[Vec3]| row.iter().map(|at| at.z.abs()).fold(0.0, f32::max);
        let rows: Vec<&[Vec3]> = parts.positions.chunks_exact(stride).collect();
        assert!(rows.windows(2).all(|pair| depth(pair[0]) < depth(pair[1]) && pair[0][0].y > pair[1][0].y));
        assert!(rows[0].iter().all(|at| at.y == size.y) && rows[40].iter().all(|at| at.y == 0.0));
        assert!(depth(rows[0]) < 0.3 * depth(rows[40]));
        assert!((0.01..0.03).contains(&(depth(rows[40]) / size.x)), "{}", depth(rows[40]));
        assert_eq!((rows[0][0].x, rows[0][stride - 1].x), (-size.x / 2.0, size.x / 2.0));
        assert!(parts.normals.iter().all(|normal| normal.z > 0.7));
    }

    #[test]
    fn the_normals_of_a_cloth_are_those_of_its_folds() {
        let cells = UVec2::new(256, 24);
        let parts = parts(&cloth(Vec2::new(2.0, 1.0), cells).expect("valid"));
        let stride = cells.x as usize + 1;
        for row in 1..cells.y as usize {
            for column in 1..stride - 1 {
                let i = row * stride + column;
                let along = |step: usize| (parts.positions[i + step] - parts.positions[i - step]).normalize();
                assert!(along(1).dot(parts.normals[i]).abs() < 0.01, "row {row}, column {column}");
                assert!(along(stride).dot(parts.normals[i]).abs() < 1e-3, "row {row}, column {column}");
            }
        }
    }
}
