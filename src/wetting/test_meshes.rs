//! Meshes for the tests of water, and of what lies beside it.

use std::f32::consts::TAU;

use bevy::math::{Affine3A, Vec2, Vec3};

use super::TexelGeometry;
use crate::collision::MeshTriangles;
use crate::overlay::Wrap;

/// The unit square, cut into `cells` x `cells` quads, put into space and on the map.
pub(super) fn sheet(
    cells: u32,
    in_space: impl Fn(Vec2) -> Vec3,
    on_map: impl Fn(Vec2) -> Vec2,
) -> MeshTriangles {
    let mut triangles = MeshTriangles::default();
    let corner = |column: u32, row: u32| Vec2::new(column as f32, row as f32) / cells as f32;
    for row in 0..cells {
        for column in 0..cells {
            let [a, b] = [corner(column, row), corner(column + 1, row)];
            let [c, d] = [corner(column + 1, row + 1), corner(column, row + 1)];
            for corners in [[a, b, c], [a, c, d]] {
                triangles.source.push(triangles.source.len() as u32);
                triangles.positions.push(corners.map(&in_space));
                triangles.uvs.push(corners.map(&on_map));
            }
        }
    }
    triangles
}

/// Several meshes as one.
pub(super) fn joined(parts: impl IntoIterator<Item = MeshTriangles>) -> MeshTriangles {
    let mut whole = MeshTriangles::default();
    for part in parts {
        whole.positions.extend(part.positions);
        whole.uvs.extend(part.uvs);
    }
    whole.source = (0..whole.positions.len() as u32).collect();
    whole
}

/// The unit square on the floor, facing up; v grows towards +z.
pub(super) fn floor(point: Vec2) -> Vec3 {
    Vec3::new(point.x, 0.0, point.y)
}

/// Half of the first quarter of a map of 16 texels, on the floor; the rest of the map lies beside the mesh.
pub(crate) fn corner_of_a_map() -> TexelGeometry {
    let corners = [Vec2::ZERO, Vec2::X, Vec2::Y];
    let triangle = MeshTriangles {
        positions: vec![corners.map(floor)],
        uvs: vec![corners.map(|at| at * 0.5)],
        source: vec![0],
        ..MeshTriangles::default()
    };
    TexelGeometry::new(&triangle, &Affine3A::IDENTITY, Vec3::Y, 16, [Wrap::Clamp; 2])
}

/// Two squares of a metre side by side along x, of 32 triangles each, on a map of 128 texels: an island of 36 texels, and one of 1.3 times
/// as many along each side that is turned by 30 degrees. The seam between them lies at x = 1, 40.3 columns from the left.
pub(super) fn turned_neighbours() -> MeshTriangles {
    let first = sheet(4, floor, |point| (Vec2::new(4.3, 10.0) + point * 36.0) / 128.0);
    let turned = |point: Vec2| Vec2::from_angle(TAU / 12.0).rotate(point) * (36.0 * 1.3);
    let second = sheet(
        4,
        |point| floor(point) + Vec3::X,
        move |point| (Vec2::new(80.3, 45.7) + turned(point)) / 128.0,
    );
    joined([first, second])
}

/// [`sheet`] is wound so that it faces down there; this turns a mesh round.
pub(super) fn turned_round(mut mesh: MeshTriangles) -> MeshTriangles {
    mesh.positions.iter_mut().for_each(|corners| corners.swap(1, 2));
    mesh.uvs.iter_mut().for_each(|corners| corners.swap(1, 2));
    mesh
}

/// A cylinder around the y axis, 1 m high, with a radius of 1 m, whose map goes round it once.
pub(super) fn cylinder(cells: u32) -> MeshTriangles {
    let in_space = |point: Vec2| {
        // The last column is the first again, but for rounding.
        let angle = TAU * point.x;
        Vec3::new(angle.cos(), 1.0 - point.y, -angle.sin())
    };
    sheet(cells, in_space, |point| point)
}

/// A cube around the origin, with edges of 1 m and six islands, three in a row.
pub(super) struct Cube {
    /// Quads along each edge.
    pub(super) cells: u32,
    /// Texels along each side of the map.
    pub(super) size: u32,
    /// Texels along each side of an island.
    pub(super) island: f32,
    /// First column and row of the first island, in texels.
    pub(super) first: f32,
    /// From island to island, in texels.
    pub(super) pitch: f32,
    /// Whether islands are turned by a quarter each, and every second one mirrored.
    pub(super) turned: bool,
}

impl Cube {
    /// A face's normal and the directions of its island's u and v.
    pub(super) const FACES: [[Vec3; 3]; 6] = [
        [Vec3::X, Vec3::NEG_Z, Vec3::Y],
        [Vec3::NEG_X, Vec3::Z, Vec3::Y],
        [Vec3::Y, Vec3::X, Vec3::NEG_Z],
        [Vec3::NEG_Y, Vec3::X, Vec3::Z],
        [Vec3::Z, Vec3::X, Vec3::Y],
        [Vec3::NEG_Z, Vec3::NEG_X, Vec3::Y],
    ];

    /// Its triangles, the faces one after the other.
    pub(super) fn mesh(&self) -> MeshTriangles {
        joined((0..6).map(|face| {
            let [normal, right, up] = Self::FACES[face];
            let in_space = |point: Vec2| normal * 0.5 + right * (point.x - 0.5) + up * (point.y - 0.5);
            let corner = Vec2::new((face % 3) as f32, (face / 3) as f32) * self.pitch;
            let on_map = |mut point: Vec2| {
                for _ in 0..if self.turned { face } else { 0 } {
                    point = Vec2::new(1.0 - point.y, point.x);
                }
                if self.turned && face % 2 == 1 {
                    point.x = 1.0 - point.x;
                }
                (Vec2::splat(self.first) + corner + point * self.island) / self.size as f32
            };
            sheet(self.cells, in_space, on_map)
        }))
    }

    /// The face that a triangle belongs to.
    pub(super) fn face(&self, triangle: u32) -> usize {
        (triangle / (2 * self.cells * self.cells)) as usize
    }
}
