//! What several modules need: random numbers, the same everywhere, and meshes without an asset server.

use std::path::Path;

use bevy::math::Vec3;
use bevy_weathering::collision::MeshTriangles;
use bevy_weathering::scenes::gltf_mesh::read_first_primitive;

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

/// The bunny of 1,000 triangles.
pub fn bunny() -> MeshTriangles {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/bunny_1000.glb");
    read_first_primitive(&file).expect("the model is in the repository")
}
