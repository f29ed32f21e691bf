//! A primitive as triangles, with texture coordinates over which its maps lie.
//!
//! If none of its own are unique, it is cut into charts. Then each new vertex is an old one with a place on the map of its own,
//! and all that the old one had goes along ([`Cut::vertices`]).

use bevy::asset::RenderAssetUsages;
use bevy::math::{Affine3A, Vec2, Vec3, Vec4};
use bevy::mesh::{
    Indices, Mesh, MeshVertexAttribute, PrimitiveTopology, VertexAttributeValues, VertexFormat,
};
use serde_json::Value;

use super::ExportError;
use super::document::{Document, number};
use super::scene::Place;
use crate::collision::UvSet;
use crate::unwrap::{UniqueUvs, UnwrapError, UnwrapOptions, unique_uvs};

/// A primitive in the space of its mesh.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Option<Vec<Vec3>>,
    /// As the file has them, for its first uvs.
    pub(super) tangents: Option<Vec<Vec4>>,
    /// All that the file has, by number.
    pub(super) uvs: Vec<Vec<Vec2>>,
    /// Unique ones, if those of the file are not. Their number is the one behind the last of the file.
    pub(super) cut: Option<Cut>,
    /// Which of `uvs` the maps lie over, if it was not cut.
    unique: usize,
    pub(super) corners: Vec<[u32; 3]>,
}

/// What a shape was cut into.
#[derive(Debug, Clone)]
pub(super) struct Cut {
    /// The vertex of the file that each vertex was.
    pub(super) vertices: Vec<u32>,
    pub(super) uvs: Vec<Vec2>,
}

/// Carries the numbers of vertices through the unwrapper.
const NUMBER: MeshVertexAttribute =
    MeshVertexAttribute::new("ExportedVertex", 0x5765_6174_6865_7201, VertexFormat::Uint32);

/// Most texture coordinates of a vertex that are looked for.
const MAX_UV_SETS: usize = 8;

impl Document {
    /// The shape of a primitive. `None` if none of its triangles has an area.
    pub(super) fn shape(&self, place: &Place, map_size: u32) -> Result<Option<Shape>, ExportError> {
        let field = format!("meshes[{}].primitives[{}]", place.mesh, place.primitive);
        let primitive = &self.entry("meshes", place.mesh)?["primitives"][place.primitive];
        let mut shape = self.read_shape(&field, primitive)?;
        let options = UnwrapOptions { map_size, replace: true, ..UnwrapOptions::default() };
        match unique_uvs(&shape.numbered_mesh(), &options) {
            Ok(UniqueUvs::Given(UvSet::First)) => shape.unique = 0,
            Ok(UniqueUvs::Given(UvSet::Second)) => shape.unique = 1,
            Ok(UniqueUvs::Cut(mesh)) => {
                let lost = || self.content(&*field, "could not be cut into charts");
                shape.cut_like(&mesh).ok_or_else(lost)?;
            }
            Err(UnwrapError::Empty) => return Ok(None),
            Err(source) => {
                let (path, surface) = (self.path.clone(), place.name.clone());
                return Err(ExportError::Unwrap { path, surface, source });
            }
        }
        Ok(Some(shape))
    }

    /// The shape of a primitive whose maps lie over this set of its uvs, as they are.
    pub(super) fn shape_over(&self, place: &Place, set: usize) -> Result<Shape, ExportError> {
        let field = format!("meshes[{}].primitives[{}]", place.mesh, place.primitive);
        let primitive = &self.entry("meshes", place.mesh)?["primitives"][place.primitive];
        let shape = self.read_shape(&field, primitive)?;
        if set >= shape.uvs.len() {
            return Err(self.content(field, format!("has no `TEXCOORD_{set}`")));
        }
        Ok(Shape { unique: set, ..shape })
    }

    fn read_shape(&self, field: &str, primitive: &Value) -> Result<Shape, ExportError> {
        let attributes = &primitive["attributes"];
        let count = match number(&attributes["POSITION"]) {
            Some(accessor) => self.elements(accessor)?.count,
            None => return Err(self.content(field, "has no `POSITION`")),
        };
        let positions = self.attribute::<3>(field, attributes, "POSITION", count)?.unwrap_or_default();
        let normals = self.attribute::<3>(field, attributes, "NORMAL", count)?;
        let tangents = self.attribute::<4>(field, attributes, "TANGENT", count)?;
        let mut uvs: Vec<Vec<Vec2>> = Vec::new();
        while uvs.len() < MAX_UV_SETS
            && let Some(set) =
                self.attribute::<2>(field, attributes, &format!("TEXCOORD_{}", uvs.len()), count)?
        {
            uvs.push(set.into_iter().map(Vec2::from_array).collect());
        }
        let indices = match number(&primitive["indices"]) {
            Some(accessor) => self.elements(accessor)?.indices(),
            None => Some((0..count as u32).collect()),
        };
        let indices =
            indices.ok_or_else(|| self.content(field, "has `indices` that are no whole numbers"))?;
        if indices.iter().any(|&index| index as usize >= count) {
            return Err(self.content(field, "has `indices` beyond its vertices"));
        }
        let vectors = |values: Vec<[f32; 3]>| values.into_iter().map(Vec3::from_array).collect();
        Ok(Shape {
            positions: vectors(positions),
            normals: normals.map(vectors),
            tangents: tangents.map(|values| values.into_iter().map(Vec4::from_array).collect()),
            uvs,
            cut: None,
            unique: 0,
            corners: triangles(primitive["mode"].as_u64().unwrap_or(4), &indices),
        })
    }

    /// Values of an attribute, one for each vertex; `None` if there are none.
    fn attribute<const N: usize>(
        &self,
        field: &str,
        attributes: &Value,
        name: &str,
        count: usize,
    ) -> Result<Option<Vec<[f32; N]>>, ExportError> {
        let Some(accessor) = number(&attributes[name]) else { return Ok(None) };
        let values = self.elements(accessor)?.floats::<N>();
        let values = values.ok_or_else(|| self.content(field, format!("has no `{name}` of {N} numbers")))?;
        if values.len() != count {
            return Err(self.content(field, format!("has not as many `{name}` as `POSITION`")));
        }
        Ok(Some(values))
    }
}

/// The triangles of a list, a strip or a fan.
fn triangles(mode: u64, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        // Every second triangle of a strip is wound the other way.
        5 => {
            let turned = |(number, c): (usize, &[u32])| {
                if number % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] }
            };
            indices.windows(3).enumerate().map(turned).collect()
        }
        6 => indices.windows(2).skip(1).map(|c| [indices[0], c[0], c[1]]).collect(),
        _ => indices.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    }
}

impl Shape {
    /// The texture coordinates over which its maps lie.
    pub(super) fn map_uvs(&self) -> &[Vec2] {
        match &self.cut {
            Some(cut) => &cut.uvs,
            None => self.uvs.get(self.unique).map_or(&[], Vec::as_slice),
        }
    }

    /// Their number.
    pub(super) fn map_set(&self) -> usize {
        if self.cut.is_some() { self.uvs.len() } else { self.unique }
    }

    /// Whether they lie in more than one tile, so that a texel is several places.
    pub(super) fn repeats(&self) -> bool {
        // So far beyond an edge is not meant.
        const ROUNDING: f32 = 1e-3;
        let uvs = self.corners.as_flattened().iter().map(|&corner| self.map_uvs()[corner as usize]);
        let (low, high) =
            uvs.fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), uv| (low.min(uv), high.max(uv)));
        let tile = ((low + high) / 2.0).floor();
        (low - tile).min_element() < -ROUNDING || (high - tile).max_element() > 1.0 + ROUNDING
    }

    /// For colliders, in the world, with the uvs of the maps alone.
    pub(super) fn world_mesh(&self, world_from_mesh: &Affine3A) -> Mesh {
        let position = |&point: &Vec3| world_from_mesh.transform_point3(point).to_array();
        // A mirrored mesh is wound the other way.
        let mirrored = world_from_mesh.matrix3.determinant() < 0.0;
        let wound = |&[a, b, c]: &[u32; 3]| if mirrored { [a, c, b] } else { [a, b, c] };
        let uvs: Vec<[f32; 2]> = self.map_uvs().iter().map(|uv| uv.to_array()).collect();
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::MAIN_WORLD)
            .with_inserted_attribute(
                Mesh::ATTRIBUTE_POSITION,
                self.positions.iter().map(position).collect::<Vec<_>>(),
            )
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs)
            .with_inserted_indices(Indices::U32(self.corners.iter().flat_map(wound).collect()))
    }

    /// Tangents for the uvs of the maps; `None` without normals.
    pub(super) fn map_tangents(&self) -> Option<Vec<[f32; 4]>> {
        let normals: Vec<[f32; 3]> = self.normals.as_ref()?.iter().map(|normal| normal.to_array()).collect();
        let mut mesh =
            self.world_mesh(&Affine3A::IDENTITY).with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals);
        mesh.generate_tangents().ok()?;
        match mesh.remove_attribute(Mesh::ATTRIBUTE_TANGENT)? {
            VertexAttributeValues::Float32x4(tangents) => {
                // A viewer divides by their length.
                let unit = |tangent: [f32; 4]| {
                    let along = Vec4::from_array(tangent).truncate().normalize_or(Vec3::X);
                    along.extend(if tangent[3] < 0.0 { -1.0 } else { 1.0 }).to_array()
                };
                Some(tangents.into_iter().map(unit).collect())
            }
            _ => None,
        }
    }

    /// What is looked at for unique uvs, and unwrapped.
    fn numbered_mesh(&self) -> Mesh {
        let positions: Vec<[f32; 3]> = self.positions.iter().map(|point| point.to_array()).collect();
        let numbers: Vec<u32> = (0..positions.len() as u32).collect();
        let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::MAIN_WORLD)
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
            .with_inserted_attribute(NUMBER, numbers)
            .with_inserted_indices(Indices::U32(self.corners.as_flattened().to_vec()));
        for (set, uvs) in [UvSet::First, UvSet::Second].into_iter().zip(&self.uvs) {
            let uvs: Vec<[f32; 2]> = uvs.iter().map(|uv| uv.to_array()).collect();
            mesh.insert_attribute(set.attribute(), uvs);
        }
        mesh
    }

    /// Takes over how a numbered mesh was cut.
    fn cut_like(&mut self, mesh: &Mesh) -> Option<()> {
        let (
            Some(VertexAttributeValues::Uint32(vertices)),
            Some(VertexAttributeValues::Float32x2(uvs)),
            Some(indices),
        ) = (mesh.attribute(NUMBER), mesh.attribute(Mesh::ATTRIBUTE_UV_1), mesh.indices())
        else {
            return None;
        };
        let corners: Vec<u32> = indices.iter().map(|corner| corner as u32).collect();
        self.corners = corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        self.positions = gathered(&self.positions, vertices);
        self.normals = self.normals.as_ref().map(|values| gathered(values, vertices));
        self.tangents = self.tangents.as_ref().map(|values| gathered(values, vertices));
        self.uvs.iter_mut().for_each(|set| *set = gathered(set, vertices));
        let uvs = uvs.iter().copied().map(Vec2::from_array).collect();
        self.cut = Some(Cut { vertices: vertices.clone(), uvs });
        Some(())
    }
}

fn gathered<T: Copy>(values: &[T], vertices: &[u32]) -> Vec<T> {
    vertices.iter().map(|&vertex| values[vertex as usize]).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A unit square that looks along z, whose uvs are its places times this.
    pub(in crate::export) fn square(tiles: f32) -> Shape {
        let points = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
        Shape {
            positions: points.to_vec(),
            normals: Some(vec![Vec3::Z; 4]),
            tangents: None,
            uvs: vec![points.map(|point| point.truncate() * tiles).to_vec()],
            cut: None,
            unique: 0,
            corners: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    #[test]
    fn strips_and_fans_become_lists() {
        let indices = [0, 1, 2, 3, 4];
        assert_eq!(triangles(4, &indices), [[0, 1, 2]]);
        assert_eq!(triangles(5, &indices), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(triangles(6, &indices), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        assert!(triangles(6, &[]).is_empty());
    }

    #[test]
    fn uvs_repeat_that_lie_in_two_tiles() {
        assert!(!square(1.0).repeats() && square(1.5).repeats());
        let mut shape = square(1.0);
        shape.uvs[0].iter_mut().for_each(|uv| *uv -= 3.0);
        assert!(!shape.repeats());
    }

    #[test]
    fn a_cut_shape_has_for_each_corner_what_it_had() {
        let mut shape = square(3.0);
        let (points, uvs) = (shape.positions.clone(), shape.uvs[0].clone());
        let options = UnwrapOptions { map_size: 64, replace: true, ..UnwrapOptions::default() };
        let Ok(UniqueUvs::Cut(mesh)) = unique_uvs(&shape.numbered_mesh(), &options) else {
            panic!("three tiles are not unique");
        };
        shape.cut_like(&mesh).unwrap();
        assert_eq!((shape.map_set(), shape.corners.len()), (1, 2));
        for (corner, old) in shape.corners.as_flattened().iter().zip([0usize, 1, 2, 0, 2, 3]) {
            let corner = *corner as usize;
            assert_eq!((shape.positions[corner], shape.uvs[0][corner]), (points[old], uvs[old]));
        }
        assert!(shape.map_uvs().iter().all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 1.0));
        let tangents = shape.map_tangents().unwrap();
        assert!(tangents.iter().all(|tangent| tangent[2].abs() < 1e-4), "{tangents:?}");
    }
}
