//! The material of all particles, and the mesh it is drawn on.
//!
//! A mesh of quads whose vertices know nothing but their number; the shader pulls everything else from buffers.

use bevy::asset::io::AssetSourceId;
use bevy::asset::{AssetPath, RenderAssetUsages, embedded_path};
use bevy::mesh::{Indices, MeshVertexAttribute, MeshVertexBufferLayoutRef, PrimitiveTopology, VertexFormat};
use bevy::pbr::{MaterialPipeline, MaterialPipelineKey};
use bevy::prelude::*;
use bevy::render::render_resource::{AsBindGroup, RenderPipelineDescriptor, SpecializedMeshPipelineError};
use bevy::render::storage::ShaderBuffer;
use bevy::shader::ShaderRef;

/// Draws rows of [`GpuParticle`](super::GpuParticle), lit.
#[derive(Asset, AsBindGroup, TypePath, Debug, Clone)]
pub struct ParticleMaterial {
    /// [`GpuParticle`](super::GpuParticle)s.
    #[storage(0, read_only, visibility(vertex))]
    pub rows: Handle<ShaderBuffer>,
    /// [`GpuFrame`](super::GpuFrame), then [`GpuLook`](super::GpuLook)s.
    #[storage(1, read_only, visibility(vertex))]
    pub frame: Handle<ShaderBuffer>,
    /// A layer for each tile.
    #[texture(2, dimension = "2d_array")]
    #[sampler(3)]
    pub sprites: Handle<Image>,
}

/// Number of a vertex. Not the built-in index: that counts from the beginning of a buffer which meshes share.
const ATTRIBUTE_NUMBER: MeshVertexAttribute =
    MeshVertexAttribute::new("Particle_Vertex_Number", 0x7061_7274_6963_6c65, VertexFormat::Uint32);

impl Material for ParticleMaterial {
    fn vertex_shader() -> ShaderRef {
        shader()
    }

    fn fragment_shader() -> ShaderRef {
        shader()
    }

    fn alpha_mode(&self) -> AlphaMode {
        AlphaMode::Premultiplied
    }

    fn enable_prepass() -> bool {
        false
    }

    fn enable_shadows() -> bool {
        false
    }

    fn specialize(
        _: &MaterialPipeline,
        descriptor: &mut RenderPipelineDescriptor,
        layout: &MeshVertexBufferLayoutRef,
        _: MaterialPipelineKey<Self>,
    ) -> Result<(), SpecializedMeshPipelineError> {
        descriptor.vertex.buffers = vec![layout.0.get_layout(&[ATTRIBUTE_NUMBER.at_shader_location(0)])?];
        descriptor.primitive.cull_mode = None;
        Ok(())
    }
}

fn shader() -> ShaderRef {
    let path = AssetPath::from_path_buf(embedded_path!("../../../shaders/particles.wgsl"));
    path.with_source(AssetSourceId::from("embedded")).into()
}

/// So many quads.
pub(super) fn quads(count: u32) -> Mesh {
    let numbers: Vec<u32> = (0..4 * count).collect();
    let corners = |quad: u32| [0, 1, 2, 0, 2, 3].map(|corner| 4 * quad + corner);
    let indices: Vec<u32> = (0..count).flat_map(corners).collect();
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(ATTRIBUTE_NUMBER, numbers)
        .with_inserted_indices(Indices::U32(indices))
}

#[cfg(test)]
mod tests {
    use bevy::mesh::VertexAttributeValues;

    use super::*;

    #[test]
    fn each_quad_is_two_triangles_that_share_an_edge() {
        let mesh = quads(3);
        let Some(VertexAttributeValues::Uint32(numbers)) = mesh.attribute(ATTRIBUTE_NUMBER) else {
            panic!("vertices have numbers")
        };
        assert_eq!(*numbers, (0..12).collect::<Vec<u32>>());
        let indices: Vec<usize> = mesh.indices().unwrap().iter().collect();
        for (quad, corners) in indices.chunks_exact(6).enumerate() {
            assert!(corners.iter().all(|corner| corner / 4 == quad), "{corners:?}");
            let shared = corners[..3].iter().filter(|corner| corners[3..].contains(corner)).count();
            assert_eq!(shared, 2);
        }
        assert_eq!(indices.len(), 18);
    }
}
