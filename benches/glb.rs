//! The bunnies, read without an asset server and a renderer's plugins.

use std::path::Path;

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Mesh, PrimitiveTopology};
use bevy_weathering::collision::MeshTriangles;
use bevy_weathering::scenes::gltf_mesh::read_first_primitive;

/// The bunny of scene 1, 1,000 triangles.
pub const BUNNY_1000: &str = "assets/models/bunny_1000.glb";

/// The same bunny with 5,648 triangles.
pub const BUNNY: &str = "assets/models/bunny.glb";

/// The triangles of a model, given from the root of the repository.
pub fn triangles(model: &str) -> MeshTriangles {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(model);
    read_first_primitive(&file).expect("the model is in the repository")
}

/// The same as a mesh: three vertices to a triangle.
pub fn mesh(model: &str) -> Mesh {
    let MeshTriangles { positions, uvs, .. } = triangles(model);
    let positions: Vec<[f32; 3]> = positions.as_flattened().iter().map(|at| at.to_array()).collect();
    let uvs: Vec<[f32; 2]> = uvs.as_flattened().iter().map(|at| at.to_array()).collect();
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs)
}
