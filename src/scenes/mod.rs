//! What a scene is made of when no asset file brings it: meshes, stone, and light from a photograph.
//!
//! Everything here is computed on the CPU from a few numbers, is the same on every run, and ends in plain
//! Bevy assets ([`Mesh`](bevy::mesh::Mesh), [`Image`](bevy::image::Image)), so a scene built from it needs
//! no special treatment anywhere else. Nothing in this module spawns entities.
//!
//! | module | makes |
//! |---|---|
//! | [`meshes`] | ground, road, cloth, sphere, rock, vase and flowerpot, with a UV layout to wet |
//! | [`environment`] | a skybox and image-based light from an equirectangular photograph |
//! | [`stone`] | tileable terracotta, sandstone, concrete and brickwork |
//! | [`gltf_mesh`] | the meshes of a glTF file, for tools without an asset server |
//! | [`mips`] | mip maps, which Bevy does not make, for these and for loaded photographs |

pub mod environment;
pub mod gltf_mesh;
pub mod meshes;
pub mod mips;
pub(crate) mod noise;
pub mod stone;
