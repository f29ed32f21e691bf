//! The bindings of the extension.

use bevy::asset::io::AssetSourceId;
use bevy::asset::{AssetPath, embedded_path};
use bevy::mesh::MeshVertexBufferLayoutRef;
use bevy::pbr::{ExtendedMaterial, MaterialExtension, MaterialExtensionKey, MaterialExtensionPipeline};
use bevy::prelude::*;
use bevy::render::render_resource::{
    AsBindGroup, RenderPipelineDescriptor, ShaderType, SpecializedMeshPipelineError,
};
use bevy::render::storage::ShaderBuffer;
use bevy::shader::ShaderRef;

use super::{PorousKey, WettingTextures};
use crate::matter::MatterLook;
use crate::overlay::Overlays;

/// A `StandardMaterial` that gets wet.
pub type WeatheredMaterial = ExtendedMaterial<StandardMaterial, PorousExtension>;

/// What a weathered material adds to its `StandardMaterial`. Bindings from 100 on.
#[derive(Asset, AsBindGroup, Reflect, Debug, Clone)]
#[bind_group_data(PorousKey)]
pub struct PorousExtension {
    /// What is compiled in.
    pub key: PorousKey,
    /// Constants of the surface.
    #[uniform(100)]
    pub params: PorousUniform,
    /// See [`Overlays::diffuse`].
    #[texture(101)]
    #[sampler(102)]
    pub diffuse: Handle<Image>,
    /// See [`Overlays::specular`].
    #[texture(103)]
    pub specular: Handle<Image>,
    /// See [`Overlays::normal`].
    #[texture(104)]
    pub normal: Handle<Image>,
    /// See [`Overlays::state`].
    #[storage(105, read_only, visibility(fragment))]
    pub state: Handle<ShaderBuffer>,
    /// See [`ClockBuffer`](super::ClockBuffer).
    #[storage(106, read_only, visibility(fragment))]
    pub clock: Handle<ShaderBuffer>,
    /// See [`Overlays::rings`].
    #[storage(107, read_only, visibility(fragment))]
    pub rings: Handle<ShaderBuffer>,
    /// See [`WettingTextures::surface`].
    #[texture(108)]
    #[sampler(109)]
    pub surface: Option<Handle<Image>>,
    /// See [`WettingTextures::wet_color`].
    #[texture(110)]
    #[sampler(111)]
    pub wet_color: Option<Handle<Image>>,
    /// See [`PlayedWetMap::map`](super::PlayedWetMap::map).
    #[texture(112)]
    #[sampler(113)]
    pub played: Option<Handle<Image>>,
    /// See [`Overlays::matter`].
    #[storage(114, read_only, visibility(fragment))]
    pub matter: Handle<ShaderBuffer>,
    /// See [`MatterLook`](crate::matter::MatterLook).
    #[uniform(115)]
    pub look: MatterUniform,
}

/// [`MatterLook`](crate::matter::MatterLook) as the shader reads it: `MatterUniform` in `shaders/common/wet_map.wgsl`, where the
/// fields are told.
#[derive(ShaderType, Reflect, Debug, Clone, Copy, Default, PartialEq)]
#[reflect(Default)]
#[expect(missing_docs, reason = "told in the shader; tests/layout.rs compares the two")]
pub struct MatterUniform {
    pub dust_color: Vec3,
    pub dust_roughness: f32,
    pub mud_color: Vec3,
    pub mud_roughness: f32,
    pub snow_color: Vec3,
    pub snow_roughness: f32,
    pub grain_mm: f32,
    pub flake_mm: f32,
}

impl From<&MatterLook> for MatterUniform {
    fn from(look: &MatterLook) -> Self {
        let color = |color: [f32; 3]| Vec3::from_array(color).clamp(Vec3::ZERO, Vec3::ONE);
        let part = |part: f32| part.clamp(0.0, 1.0);
        Self {
            dust_color: color(look.dust_color),
            dust_roughness: part(look.dust_roughness),
            mud_color: color(look.mud_color),
            mud_roughness: part(look.mud_roughness),
            snow_color: color(look.snow_color),
            snow_roughness: part(look.snow_roughness),
            grain_mm: look.grain_mm.max(1e-3),
            flake_mm: look.flake_mm.max(1e-3),
        }
    }
}

/// [`PorousMaterial`](super::PorousMaterial) and [`StandingWater`](super::StandingWater) as the shader reads them:
/// `PorousUniform` in `shaders/common/wet_map.wgsl`, where the fields are told.
#[derive(ShaderType, Reflect, Debug, Clone, Copy, Default, PartialEq)]
#[reflect(Default)]
#[expect(missing_docs, reason = "told in the shader; tests/layout.rs compares the two")]
pub struct PorousUniform {
    pub wet_color: Vec3,
    pub wet_roughness: f32,
    pub absorption_per_mm: Vec3,
    pub wet_reflectance: f32,
    pub flood: Vec3,
    pub levelling_mm: f32,
    pub porosity: f32,
    pub s_p: f32,
    pub m: f32,
    pub k_s: f32,
    pub k_w: f32,
    pub film_p: f32,
    pub film_x: f32,
    pub backscatter: f32,
    pub t_fill: f32,
    pub capacity_mm: f32,
    pub visible_mm: f32,
    pub sorptivity_squared: f32,
    pub reserve_mm: f32,
    pub efflorescence: f32,
    pub tide_mark: f32,
    pub map_ticks: f32,
    pub map_fill: f32,
    pub map_tick: u32,
    pub wet_translucency: f32,
    pub rain_mm_per_h: f32,
    pub ripple_cell: f32,
    pub size: u32,
    pub flags: u32,
}

impl PorousExtension {
    /// Binds the maps of a surface.
    pub fn new(
        key: PorousKey,
        params: PorousUniform,
        maps: &Overlays,
        textures: &WettingTextures,
        played: Option<Handle<Image>>,
        clock: Handle<ShaderBuffer>,
        look: &MatterLook,
    ) -> Self {
        Self {
            key,
            params,
            diffuse: maps.diffuse.clone(),
            specular: maps.specular.clone(),
            normal: maps.normal.clone(),
            state: maps.state.clone(),
            clock,
            rings: maps.rings.clone(),
            surface: textures.surface.clone(),
            wet_color: textures.wet_color.clone(),
            played,
            matter: maps.matter.clone(),
            look: look.into(),
        }
    }
}

impl MaterialExtension for PorousExtension {
    fn fragment_shader() -> ShaderRef {
        let path = AssetPath::from_path_buf(embedded_path!("../../shaders/weathered.wgsl"));
        path.with_source(AssetSourceId::from("embedded")).into()
    }

    fn specialize(
        _: &MaterialExtensionPipeline,
        descriptor: &mut RenderPipelineDescriptor,
        layout: &MeshVertexBufferLayoutRef,
        key: MaterialExtensionKey<Self>,
    ) -> Result<(), SpecializedMeshPipelineError> {
        let Some(fragment) = &mut descriptor.fragment else { return Ok(()) };
        fragment.shader_defs.extend(key.bind_group_data.shader_defs());
        // While meshes are exchanged, one may not have the uvs that are asked for.
        let second = key.bind_group_data.second_uvs && layout.0.contains(Mesh::ATTRIBUTE_UV_1);
        if second {
            fragment.shader_defs.push("WEATHERED_UVS_B".into());
        }
        if second || layout.0.contains(Mesh::ATTRIBUTE_UV_0) {
            fragment.shader_defs.push("WEATHERED_UVS".into());
        }
        Ok(())
    }
}
