//! Meshes of a running app, as a glTF has them.

use std::collections::BTreeMap;

use bevy::math::{Affine3A, Mat3A, Vec3A};
use bevy::mesh::{Indices, MeshAccessError, MeshVertexAttribute, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use serde_json::{Value, json};

use crate::collision::{TriangleError, TriangleReport};
use crate::export::document::Document;

/// A mesh whose vertices are all numbers, and whose triangles all have an area.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct LiveMesh {
    positions: Vec<[f32; 3]>,
    /// Unit vectors, or none.
    normals: Vec<[f32; 3]>,
    tangents: Vec<[f32; 4]>,
    uvs: Vec<Vec<[f32; 2]>>,
    colors: Vec<[f32; 4]>,
    corners: Vec<[u32; 3]>,
}

impl LiveMesh {
    /// With at least so many sets of uvs: those that the mesh has not are 0 everywhere, as they are for whoever draws it.
    /// `paint`: its vertex colours are no colours.
    ///
    /// # Errors
    /// [`TriangleError`] if there is nothing to show.
    pub(super) fn new(mesh: &Mesh, uv_sets: usize, paint: bool) -> Result<Self, TriangleError> {
        let topology = mesh.primitive_topology();
        let on_cpu = |_: MeshAccessError| TriangleError::NotOnCpu;
        let values = |attribute: MeshVertexAttribute| mesh.try_attribute_option(attribute).map_err(on_cpu);
        let Some(VertexAttributeValues::Float32x3(positions)) = values(Mesh::ATTRIBUTE_POSITION)? else {
            return Err(TriangleError::NoPositions);
        };
        let count = positions.len();
        let corners: Vec<u32> = match mesh.try_indices_option().map_err(on_cpu)? {
            None => (0..count as u32).collect(),
            Some(Indices::U16(corners)) => corners.iter().map(|&corner| u32::from(corner)).collect(),
            Some(Indices::U32(corners)) => corners.clone(),
        };
        let mut read = Self {
            positions: finite(positions),
            corners: triangles(topology, &corners).ok_or(TriangleError::Topology(topology))?,
            ..default()
        };
        let total = read.corners.len() as u32;
        read.corners.retain(|corners| has_area(positions, corners));
        if read.corners.is_empty() {
            return Err(TriangleError::Empty(TriangleReport { total, degenerate: total, ..default() }));
        }
        if let Some(VertexAttributeValues::Float32x3(normals)) = values(Mesh::ATTRIBUTE_NORMAL)?
            && normals.len() == count
        {
            read.normals = normals.iter().map(|&normal| unit(Vec3::from_array(normal), Vec3::Y)).collect();
        }
        if let Some(VertexAttributeValues::Float32x4(tangents)) = values(Mesh::ATTRIBUTE_TANGENT)?
            && tangents.len() == read.normals.len()
        {
            read.tangents = tangents.iter().map(|&tangent| unit_tangent(tangent)).collect();
        }
        let sets: [MeshVertexAttribute; 2] = [Mesh::ATTRIBUTE_UV_0, Mesh::ATTRIBUTE_UV_1];
        for (set, attribute) in sets.into_iter().enumerate() {
            match values(attribute)? {
                Some(VertexAttributeValues::Float32x2(uvs)) if uvs.len() == count => {
                    read.set_uvs(set, finite(uvs))
                }
                _ if set < uv_sets => read.set_uvs(set, vec![[0.0; 2]; count]),
                _ => {}
            }
        }
        if !paint
            && let Some(VertexAttributeValues::Float32x4(colors)) = values(Mesh::ATTRIBUTE_COLOR)?
            && colors.len() == count
        {
            read.colors =
                finite(colors).into_iter().map(|color| color.map(|part| part.clamp(0.0, 1.0))).collect();
        }
        Ok(read)
    }

    /// Sets skip no number.
    fn set_uvs(&mut self, set: usize, uvs: Vec<[f32; 2]>) {
        while self.uvs.len() < set {
            self.uvs.push(vec![[0.0; 2]; self.positions.len()]);
        }
        self.uvs.push(uvs);
    }

    /// In another pose. Normals follow the surface: vertices that had the place and the normal of each other at rest have one in
    /// common, the mean of the triangles around, so creases stay. There are no tangents then.
    pub(super) fn posed(mut self, positions: &[Vec3]) -> Self {
        if positions.len() != self.positions.len() {
            return self;
        }
        let places: Vec<[f32; 3]> = positions.iter().map(|position| position.to_array()).collect();
        let same = |vertex: usize| {
            let normal = self.normals.get(vertex).copied().unwrap_or_default();
            (self.positions[vertex].map(f32::to_bits), normal.map(f32::to_bits))
        };
        let mut sums: BTreeMap<_, Vec3> = BTreeMap::new();
        for corners in &self.corners {
            let [a, b, c] = corners.map(|corner| positions[corner as usize]);
            let twice_area = (b - a).cross(c - a);
            if twice_area.is_finite() {
                corners
                    .iter()
                    .for_each(|&corner| *sums.entry(same(corner as usize)).or_default() += twice_area);
            }
        }
        let normal_of = |vertex| unit(sums.get(&same(vertex)).copied().unwrap_or_default(), Vec3::Y);
        let normals = (0..self.normals.len()).map(normal_of).collect();
        self.positions = finite(&places);
        self.normals = normals;
        self.tangents.clear();
        self
    }

    /// Moved as a whole, as no node can move it.
    pub(super) fn moved(mut self, by: &Affine3A) -> Self {
        let point = |point: &mut [f32; 3]| *point = by.transform_point3(Vec3::from_array(*point)).to_array();
        self.positions.iter_mut().for_each(point);
        // Of what is flattened there is no inverse.
        let across =
            if by.matrix3.determinant() == 0.0 { Mat3A::IDENTITY } else { by.matrix3.inverse().transpose() };
        for normal in &mut self.normals {
            *normal = unit((across * Vec3A::from_array(*normal)).into(), Vec3::Y);
        }
        for tangent in &mut self.tangents {
            let [x, y, z, sign] = *tangent;
            let along = by.matrix3 * Vec3A::new(x, y, z);
            // A mirrored one goes on along the same v.
            let sign = if by.matrix3.determinant() < 0.0 { -sign } else { sign };
            *tangent = unit_tangent([along.x, along.y, along.z, sign]);
        }
        if by.matrix3.determinant() < 0.0 {
            self.corners.iter_mut().for_each(|corners| corners.swap(1, 2));
        }
        self.positions = finite(&self.positions);
        self
    }

    /// Writes its vertices and corners; a primitive without a material.
    pub(super) fn push(&self, document: &mut Document) -> Value {
        let mut attributes = json!({ "POSITION": document.push_points(&self.positions) });
        if !self.normals.is_empty() {
            attributes["NORMAL"] = document.push_floats(&self.normals).into();
        }
        if !self.tangents.is_empty() {
            attributes["TANGENT"] = document.push_floats(&self.tangents).into();
        }
        for (set, uvs) in self.uvs.iter().enumerate() {
            attributes[format!("TEXCOORD_{set}")] = document.push_floats(uvs).into();
        }
        if !self.colors.is_empty() {
            attributes["COLOR_0"] = document.push_floats(&self.colors).into();
        }
        let corners = document.push_corners(&self.corners);
        json!({ "attributes": attributes, "indices": corners })
    }
}

/// The triangles of a list or a strip; `None` of anything else.
fn triangles(topology: PrimitiveTopology, corners: &[u32]) -> Option<Vec<[u32; 3]>> {
    match topology {
        PrimitiveTopology::TriangleList => {
            let (triangles, _) = corners.as_chunks::<3>();
            Some(triangles.to_vec())
        }
        // Every second one is wound the other way.
        PrimitiveTopology::TriangleStrip => {
            let wound = |(number, c): (usize, &[u32])| {
                if number % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] }
            };
            Some(corners.windows(3).enumerate().map(wound).collect())
        }
        _ => None,
    }
}

fn has_area(positions: &[[f32; 3]], corners: &[u32; 3]) -> bool {
    let point = |corner: u32| positions.get(corner as usize).copied().map(Vec3::from_array);
    let [Some(a), Some(b), Some(c)] = corners.map(point) else { return false };
    // NaN is not greater.
    a.is_finite() && b.is_finite() && c.is_finite() && (b - a).cross(c - a).length_squared() > 0.0
}

/// What is no number is of a vertex that no triangle has, but has to be one in a file.
fn finite<const N: usize>(values: &[[f32; N]]) -> Vec<[f32; N]> {
    let number = |part: f32| if part.is_finite() { part } else { 0.0 };
    values.iter().map(|value| value.map(number)).collect()
}

fn unit(vector: Vec3, otherwise: Vec3) -> [f32; 3] {
    vector.try_normalize().unwrap_or(otherwise).to_array()
}

fn unit_tangent([x, y, z, sign]: [f32; 4]) -> [f32; 4] {
    let [x, y, z] = unit(Vec3::new(x, y, z), Vec3::X);
    [x, y, z, if sign < 0.0 { -1.0 } else { 1.0 }]
}

#[cfg(test)]
mod tests {
    use bevy::asset::RenderAssetUsages;

    use super::*;

    fn square() -> Mesh {
        Mesh::new(PrimitiveTopology::TriangleStrip, RenderAssetUsages::default())
            .with_inserted_attribute(
                Mesh::ATTRIBUTE_POSITION,
                vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [f32::NAN; 3]],
            )
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, vec![[0.0, 0.0, 2.0]; 5])
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_1, vec![[0.5, 0.25]; 5])
            .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, vec![[2.0, 0.5, 0.0, 1.0]; 5])
    }

    #[test]
    fn a_strip_becomes_a_list_of_what_is_finite_and_has_an_area() {
        let mesh = LiveMesh::new(&square(), 0, false).unwrap();
        assert_eq!(mesh.corners, [[0, 1, 2], [1, 3, 2]]);
        assert_eq!(
            (mesh.positions[4], mesh.normals[0], mesh.colors[0]),
            ([0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.5, 0.0, 1.0])
        );
        // The first uvs are not there, but the second may not be without them.
        assert_eq!((mesh.uvs.len(), mesh.uvs[0][0], mesh.uvs[1][0]), (2, [0.0; 2], [0.5, 0.25]));
        assert!(LiveMesh::new(&square(), 0, true).unwrap().colors.is_empty());
        let points = Mesh::new(PrimitiveTopology::PointList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[0.0f32; 3]; 3]);
        assert!(matches!(LiveMesh::new(&points, 0, false), Err(TriangleError::Topology(_))));
        let flat = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[1.0f32; 3]; 3]);
        assert!(matches!(LiveMesh::new(&flat, 0, false), Err(TriangleError::Empty(_))));
    }

    #[test]
    fn normals_follow_a_pose_and_what_no_node_can_do() {
        let mesh = LiveMesh::new(&square(), 1, false).unwrap();
        // Turned about x: what was up is along z.
        let turned: Vec<_> = mesh.positions.iter().map(|&[x, y, _]| Vec3::new(x, 0.0, y)).collect();
        let posed = mesh.clone().posed(&turned);
        assert_eq!((posed.positions[2], posed.normals[0]), ([0.0, 0.0, 1.0], [0.0, -1.0, 0.0]));
        let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        let mirrored = mesh.clone().moved(&mirror);
        assert_eq!((mirrored.positions[1], mirrored.corners[0]), ([-1.0, 0.0, 0.0], [0, 2, 1]));
        let sheared = Affine3A::from_mat3(Mat3::from_cols(Vec3::X, Vec3::new(0.0, 1.0, 1.0), Vec3::Z));
        let normal = Vec3::from_array(mesh.moved(&sheared).normals[0]);
        assert!(normal.abs_diff_eq(Vec3::new(0.0, -1.0, 1.0).normalize(), 1e-6), "{normal}");
    }
}
