//! Reads the one shape of GLB that the models here have: one mesh of one primitive, floats and 16-bit
//! indices.
//!
//! Not a glTF reader: what is not there is a panic. It spares the benches an asset server and a renderer's
//! plugins.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, Mesh, PrimitiveTopology};
use serde_json::Value;

/// The bunny of scene 1, 1,000 triangles.
pub const BUNNY_1000: &[u8] = include_bytes!("../assets/models/bunny_1000.glb");

/// The same bunny with 5,648 triangles.
pub const BUNNY: &[u8] = include_bytes!("../assets/models/bunny.glb");

/// File header, and the header of the JSON chunk behind it.
const BEFORE_JSON: usize = 12 + 8;

/// Header of the binary chunk.
const BEFORE_BINARY: usize = 8;

/// Positions, uvs and indices of a GLB's first primitive.
pub fn mesh(file: &[u8]) -> Mesh {
    let length: u32 = bytemuck::pod_read_unaligned(&file[12..16]);
    let (json, rest) = file[BEFORE_JSON..].split_at(length as usize);
    let json: Value = serde_json::from_slice(json).expect("the first chunk of a GLB is JSON");
    let binary = &rest[BEFORE_BINARY..];

    let bytes = |accessor: usize| {
        let accessor = &json["accessors"][accessor];
        let view = &json["bufferViews"][number(&accessor["bufferView"])];
        // Both offsets are 0 where they are not written.
        let start = number(&view["byteOffset"]) + number(&accessor["byteOffset"]);
        &binary[start..][..number(&view["byteLength"])]
    };
    let primitive = &json["meshes"][0]["primitives"][0];
    let positions: Vec<[f32; 3]> = bytes(number(&primitive["attributes"]["POSITION"]))
        .chunks_exact(12)
        .map(bytemuck::pod_read_unaligned)
        .collect();
    let uvs: Vec<[f32; 2]> = bytes(number(&primitive["attributes"]["TEXCOORD_0"]))
        .chunks_exact(8)
        .map(bytemuck::pod_read_unaligned)
        .collect();
    let indices: Vec<u16> =
        bytes(number(&primitive["indices"])).chunks_exact(2).map(bytemuck::pod_read_unaligned).collect();

    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs)
        .with_inserted_indices(Indices::U16(indices))
}

fn number(value: &Value) -> usize {
    value.as_u64().unwrap_or(0) as usize
}
