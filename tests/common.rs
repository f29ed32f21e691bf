//! What several modules need: random numbers, the same everywhere, and meshes without an asset server.

use std::path::Path;

use bevy::math::Vec3;
use bytemuck::Pod;
use serde_json::Value;

/// SplitMix64 (Steele, Lea, Flood 2014): the same numbers on every machine.
pub struct Random(pub u64);

impl Random {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A whole number below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }

    /// A point in the cube of this half width around the origin.
    pub fn in_cube(&mut self, half: f32) -> Vec3 {
        let mut axis = || ((self.bits() >> 40) as f32 / (1u64 << 23) as f32 - 1.0) * half;
        Vec3::new(axis(), axis(), axis())
    }
}

/// The first primitive of a `.glb`: what of it can be hit.
pub struct GlbMesh {
    /// Metres.
    pub positions: Vec<[f32; 3]>,
    /// One for each position.
    pub uvs: Vec<[f32; 2]>,
    /// Three for each triangle.
    pub indices: Vec<u16>,
}

/// Reads a `.glb` of the repository, given from its root, that keeps positions and uvs as floats, indices as
/// `u16`, and everything in its own binary chunk.
///
/// # Panics
/// If it is anything else.
pub fn read_glb(path: &str) -> GlbMesh {
    const HEADERS: usize = 20;
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    let bytes = std::fs::read(&file).expect("the model is in the repository");
    let length: [u8; 4] = bytes[12..16].try_into().expect("four bytes");
    let json_end = HEADERS + u32::from_le_bytes(length) as usize;
    let json: Value = serde_json::from_slice(&bytes[HEADERS..json_end]).expect("the first chunk is JSON");
    // Length and type of the second chunk come first.
    let binary = &bytes[json_end + 8..];
    let primitive = &json["meshes"][0]["primitives"][0];
    GlbMesh {
        positions: accessor(&json, binary, &primitive["attributes"]["POSITION"], "VEC3"),
        uvs: accessor(&json, binary, &primitive["attributes"]["TEXCOORD_0"], "VEC2"),
        indices: accessor(&json, binary, &primitive["indices"], "SCALAR"),
    }
}

fn accessor<T: Pod>(json: &Value, binary: &[u8], index: &Value, shape: &str) -> Vec<T> {
    let number = |value: &Value| value.as_u64().expect("a whole number") as usize;
    let accessor = &json["accessors"][number(index)];
    assert_eq!(accessor["type"], shape);
    let view = &json["bufferViews"][number(&accessor["bufferView"])];
    let start = view["byteOffset"].as_u64().unwrap_or(0) as usize;
    let length = number(&view["byteLength"]);
    assert_eq!(length, number(&accessor["count"]) * size_of::<T>(), "tightly packed");
    bytemuck::pod_collect_to_vec(&binary[start..start + length])
}
