//! A mesh as a list of triangles that can be hit, and what was wrong with the others.

use bevy::mesh::{Indices, MeshAccessError, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;

use super::UvSet;

/// The triangles of a mesh that can be hit: finite, of an area above zero, with texture coordinates.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeshTriangles {
    /// Corners in the mesh's space.
    pub positions: Vec<[Vec3; 3]>,
    /// Texture coordinates of the corners.
    pub uvs: Vec<[Vec2; 3]>,
    /// Number of each triangle in the mesh, counting also those left out.
    pub source: Vec<u32>,
    /// What was left out.
    pub report: TriangleReport,
}

/// What is farther from the origin, in any direction, is as good as infinite: squares of areas no longer fit an `f32`.
pub(super) const FARTHEST: f32 = 1.0e9;

/// How many triangles a mesh has, and how many of them cannot be hit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TriangleReport {
    /// All triangles of the mesh.
    pub total: u32,
    /// Zero area, or two corners in one point.
    pub degenerate: u32,
    /// A position or uv that is NaN or infinite, or a position farther than 1e9 from the origin: squares of its areas would be.
    pub non_finite: u32,
    /// An index beyond the vertices.
    pub out_of_range: u32,
}

/// Why a mesh cannot be weathered at all.
#[derive(thiserror::Error, Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TriangleError {
    /// There is none.
    #[error("there is no `Mesh3d` on its entity; in a glTF scene, entities below the root have one")]
    NoMesh,
    /// Its asset could not be loaded.
    #[error("it could not be loaded")]
    NotLoaded,
    /// Only the GPU has the data.
    #[error("its data is only on the GPU; load it with `RenderAssetUsages::MAIN_WORLD` too")]
    NotOnCpu,
    /// No positions, or not as three floats.
    #[error("it has no `POSITION` of three floats")]
    NoPositions,
    /// No texture coordinates, or not as two floats.
    #[error("it has no `UV_0`; unwrap it, or leave `Weatherable` off")]
    NoUvs,
    /// No second texture coordinates, or not as two floats.
    #[error("it has no `UV_1`, over which its maps are to lie")]
    NoSecondUvs,
    /// Points or lines.
    #[error("it is made of {0:?}, not of triangles")]
    Topology(PrimitiveTopology),
    /// Nothing left that can be hit.
    #[error("none of its {} triangles can be hit ({} degenerate, {} not finite, {} out of range)",
        .0.total, .0.degenerate, .0.non_finite, .0.out_of_range)]
    Empty(TriangleReport),
}

impl TriangleReport {
    /// Triangles left out.
    pub fn skipped(&self) -> u32 {
        self.degenerate + self.non_finite + self.out_of_range
    }
}

impl MeshTriangles {
    /// Reads the triangles of a list or strip, indexed (`u16`, `u32`) or not, with its first uvs. Bad triangles are left out
    /// and counted.
    ///
    /// # Errors
    /// [`TriangleError`] when nothing of the mesh can be hit.
    pub fn from_mesh(mesh: &Mesh) -> Result<Self, TriangleError> {
        Self::with_uvs(mesh, UvSet::First)
    }

    /// The same with the uvs of a set.
    ///
    /// # Errors
    /// [`TriangleError`] when nothing of the mesh can be hit, or it has no such set.
    pub fn with_uvs(mesh: &Mesh, set: UvSet) -> Result<Self, TriangleError> {
        let topology = mesh.primitive_topology();
        if !matches!(topology, PrimitiveTopology::TriangleList | PrimitiveTopology::TriangleStrip) {
            return Err(TriangleError::Topology(topology));
        }
        let on_cpu = |_: MeshAccessError| TriangleError::NotOnCpu;
        let positions = match mesh.try_attribute_option(Mesh::ATTRIBUTE_POSITION).map_err(on_cpu)? {
            Some(VertexAttributeValues::Float32x3(positions)) => positions.as_slice(),
            _ => return Err(TriangleError::NoPositions),
        };
        let uvs = match mesh.try_attribute_option(set.attribute()).map_err(on_cpu)? {
            Some(VertexAttributeValues::Float32x2(uvs)) if uvs.len() == positions.len() => uvs.as_slice(),
            _ if set == UvSet::Second => return Err(TriangleError::NoSecondUvs),
            _ => return Err(TriangleError::NoUvs),
        };
        let indices = mesh.try_indices_option().map_err(on_cpu)?;
        let count = indices.map_or(positions.len(), Indices::len);
        let index = |corner: usize| match indices {
            None => corner,
            Some(Indices::U16(indices)) => usize::from(indices[corner]),
            Some(Indices::U32(indices)) => indices[corner] as usize,
        };

        let mut triangles = Self::default();
        if topology == PrimitiveTopology::TriangleList {
            for corner in (0..count / 3).map(|triangle| triangle * 3) {
                triangles.push([index(corner), index(corner + 1), index(corner + 2)], positions, uvs);
            }
        } else {
            for corner in 0..count.saturating_sub(2) {
                // Every second triangle of a strip is wound the other way.
                let (second, third) = if corner % 2 == 0 { (1, 2) } else { (2, 1) };
                let corners = [index(corner), index(corner + second), index(corner + third)];
                triangles.push(corners, positions, uvs);
            }
        }
        if triangles.positions.is_empty() {
            return Err(TriangleError::Empty(triangles.report));
        }
        Ok(triangles)
    }

    fn push(&mut self, corners: [usize; 3], positions: &[[f32; 3]], uvs: &[[f32; 2]]) {
        let number = self.report.total;
        self.report.total += 1;
        if corners.iter().any(|&corner| corner >= positions.len()) {
            self.report.out_of_range += 1;
            return;
        }
        let triangle = corners.map(|corner| Vec3::from_array(positions[corner]));
        let uv = corners.map(|corner| Vec2::from_array(uvs[corner]));
        let is_near = |corner: &Vec3| corner.abs().cmple(Vec3::splat(FARTHEST)).all();
        if !triangle.iter().all(is_near) || !uv.iter().all(|p| p.is_finite()) {
            self.report.non_finite += 1;
            return;
        }
        let [a, b, c] = triangle;
        // The square of an area that an f32 can no longer divide by counts as none.
        if (b - a).cross(c - a).length_squared() < f32::MIN_POSITIVE {
            self.report.degenerate += 1;
            return;
        }
        self.positions.push(triangle);
        self.uvs.push(uv);
        self.source.push(number);
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use bevy::asset::RenderAssetUsages;

    pub(crate) fn mesh(
        topology: PrimitiveTopology,
        positions: &[[f32; 3]],
        indices: Option<Indices>,
    ) -> Mesh {
        let uvs: Vec<[f32; 2]> = positions.iter().map(|p| [p[0], p[1]]).collect();
        let mut mesh = Mesh::new(topology, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions.to_vec())
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs);
        if let Some(indices) = indices {
            mesh.insert_indices(indices);
        }
        mesh
    }

    const QUAD: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];

    fn normals(triangles: &MeshTriangles) -> Vec<Vec3> {
        triangles.positions.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a).normalize()).collect()
    }

    #[test]
    fn lists_and_strips_of_any_index_type_are_the_same_quad() {
        use PrimitiveTopology::{TriangleList, TriangleStrip};
        let unrolled: Vec<[f32; 3]> = [0, 1, 2, 2, 1, 3].iter().map(|&i: &usize| QUAD[i]).collect();
        for mesh in [
            mesh(TriangleList, &unrolled, None),
            mesh(TriangleList, &QUAD, Some(Indices::U16(vec![0, 1, 2, 2, 1, 3]))),
            mesh(TriangleList, &QUAD, Some(Indices::U32(vec![0, 1, 2, 2, 1, 3]))),
            mesh(TriangleStrip, &QUAD, None),
            mesh(TriangleStrip, &QUAD, Some(Indices::U16(vec![0, 1, 2, 3]))),
        ] {
            let triangles = MeshTriangles::from_mesh(&mesh).unwrap();
            assert_eq!(triangles.report, TriangleReport { total: 2, ..default() });
            assert_eq!(normals(&triangles), [Vec3::Z, Vec3::Z]);
            let area: f32 = triangles.positions.iter().map(|[a, b, c]| (b - a).cross(c - a).length()).sum();
            assert_eq!(area, 2.0);
        }
    }

    #[test]
    fn bad_triangles_are_left_out_and_counted() {
        let nan = [f32::NAN, 0.0, 0.0];
        let positions = [QUAD[0], QUAD[1], QUAD[2], nan, [2.0, 0.0, 0.0]];
        let indices = Indices::U32(vec![0, 1, 2, 0, 0, 1, 0, 1, 4, 0, 1, 3, 0, 1, 99]);
        let mesh = mesh(PrimitiveTopology::TriangleList, &positions, Some(indices));
        let triangles = MeshTriangles::from_mesh(&mesh).unwrap();
        let expected = TriangleReport { total: 5, degenerate: 2, non_finite: 1, out_of_range: 1 };
        assert_eq!(triangles.report, expected);
        assert_eq!(triangles.source, [0]);
    }

    #[test]
    fn what_is_too_far_to_be_measured_is_left_out() {
        for far in [2.0e9, 1.0e20, 3.0e38] {
            let mut positions = QUAD.to_vec();
            positions.extend([[far, 0.0, 0.0], [0.0, -far, 0.0], [0.0, 0.0, 1.0]]);
            let indices = Indices::U32(vec![0, 1, 2, 4, 5, 6, 0, 5, 1]);
            let mesh = mesh(PrimitiveTopology::TriangleList, &positions, Some(indices));
            let triangles = MeshTriangles::from_mesh(&mesh).unwrap();
            assert_eq!(triangles.report, TriangleReport { total: 3, non_finite: 2, ..default() });
        }
    }

    #[test]
    fn each_set_of_uvs_is_read_where_it_is() {
        let second: Vec<[f32; 2]> = QUAD.iter().map(|p| [0.5 * p[1], 0.5 * p[0]]).collect();
        let both = mesh(PrimitiveTopology::TriangleStrip, &QUAD, None)
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_1, second);
        let [first, second] =
            [UvSet::First, UvSet::Second].map(|set| MeshTriangles::with_uvs(&both, set).unwrap());
        assert_eq!(first, MeshTriangles::from_mesh(&both).unwrap());
        assert_eq!(first.positions, second.positions);
        let turned = |uvs: &[Vec2; 3]| uvs.map(|uv| 0.5 * Vec2::new(uv.y, uv.x));
        assert_eq!(second.uvs, first.uvs.iter().map(turned).collect::<Vec<_>>());
        let bare = both.with_removed_attribute(Mesh::ATTRIBUTE_UV_1);
        let missing = MeshTriangles::with_uvs(&bare, UvSet::Second);
        assert_eq!(missing, Err(TriangleError::NoSecondUvs));
    }

    #[test]
    fn what_cannot_be_hit_says_why() {
        use PrimitiveTopology::{LineList, TriangleList};
        let error = |mesh: &Mesh| MeshTriangles::from_mesh(mesh).unwrap_err();
        assert_eq!(error(&mesh(LineList, &QUAD, None)), TriangleError::Topology(LineList));
        let no_uv = mesh(TriangleList, &QUAD, None).with_removed_attribute(Mesh::ATTRIBUTE_UV_0);
        assert_eq!(error(&no_uv), TriangleError::NoUvs);
        let bare = Mesh::new(TriangleList, RenderAssetUsages::default());
        assert_eq!(error(&bare), TriangleError::NoPositions);
        let point = mesh(TriangleList, &[QUAD[0]; 3], None);
        assert!(matches!(error(&point), TriangleError::Empty(report) if report.degenerate == 1));
        let mut gone = mesh(TriangleList, &QUAD, None);
        gone.take_gpu_data().unwrap();
        assert_eq!(error(&gone), TriangleError::NotOnCpu);
    }
}
