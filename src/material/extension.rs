//! The bindings of the extension.

use bevy::asset::io::AssetSourceId;
use bevy::asset::{AssetPath, embedded_path};
use bevy::pbr::{ExtendedMaterial, MaterialExtension};
use bevy::prelude::*;
use bevy::render::render_resource::{AsBindGroup, ShaderType};
use bevy::render::storage::ShaderBuffer;
use bevy::shader::ShaderRef;

use super::{BaseBrdf, PorousMaterial, TextureMeaning};
use crate::overlay::{Overlays, Weatherable, Wrap};

/// A `StandardMaterial` that gets wet.
pub type WeatheredMaterial = ExtendedMaterial<StandardMaterial, PorousExtension>;

/// What a weathered material adds to its `StandardMaterial`. Bindings from 100 on.
#[derive(Asset, AsBindGroup, Reflect, Debug, Clone)]
pub struct PorousExtension {
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
}

/// [`PorousMaterial`] as the shader reads it: `PorousUniform` in `shaders/common/wet_map.wgsl`.
#[derive(ShaderType, Reflect, Debug, Clone, Copy, Default, PartialEq)]
pub struct PorousUniform {
    /// [`PorousMaterial::alpha_poro`].
    pub alpha_poro: f32,
    /// [`PorousMaterial::s_p`].
    pub s_p: f32,
    /// [`PorousMaterial::m`].
    pub m: f32,
    /// [`PorousMaterial::k_s`].
    pub k_s: f32,
    /// [`PorousMaterial::k_w`].
    pub k_w: f32,
    /// [`PorousMaterial::t_fill`], seconds.
    pub t_fill: f32,
    /// Nanolitres in a texel of mean size that make it look fully wet.
    pub capacity_nl: f32,
    /// Texels along each side of the maps.
    pub size: u32,
    /// Sum of the `FLAG_` constants.
    pub flags: u32,
}

impl PorousUniform {
    /// [`PorousMaterial::sqrt_k`].
    pub const FLAG_SQRT_K: u32 = 1;
    /// [`TextureMeaning::Solid`].
    pub const FLAG_SOLID: u32 = 2;
    /// [`BaseBrdf::BlinnPhong`].
    pub const FLAG_BLINN_PHONG: u32 = 4;
    /// [`Wrap::Clamp`] along u.
    pub const FLAG_CLAMP_U: u32 = 8;
    /// [`Wrap::Clamp`] along v.
    pub const FLAG_CLAMP_V: u32 = 16;

    /// Constants for a surface whose texels are `texel_mm2` large on average.
    pub fn new(porous: &PorousMaterial, surface: &Weatherable, texel_mm2: f32) -> Self {
        let flag = |set: bool, flag: u32| if set { flag } else { 0 };
        let unit = |value: f32| value.clamp(0.0, 1.0);
        Self {
            alpha_poro: unit(porous.alpha_poro),
            s_p: unit(porous.s_p),
            m: unit(porous.m),
            k_s: unit(porous.k_s),
            k_w: unit(porous.k_w),
            t_fill: porous.t_fill.max(0.0),
            // 1 mm on 1 mm² is 1 µl.
            capacity_nl: (porous.capacity_mm * texel_mm2 * 1000.0).max(1.0),
            size: surface.texels(),
            flags: flag(porous.sqrt_k, Self::FLAG_SQRT_K)
                | flag(porous.texture == TextureMeaning::Solid, Self::FLAG_SOLID)
                | flag(porous.brdf == BaseBrdf::BlinnPhong, Self::FLAG_BLINN_PHONG)
                | flag(surface.wrap_u == Wrap::Clamp, Self::FLAG_CLAMP_U)
                | flag(surface.wrap_v == Wrap::Clamp, Self::FLAG_CLAMP_V),
        }
    }
}

impl PorousExtension {
    /// Binds the maps of a surface.
    pub fn new(params: PorousUniform, maps: &Overlays, clock: Handle<ShaderBuffer>) -> Self {
        Self {
            params,
            diffuse: maps.diffuse.clone(),
            specular: maps.specular.clone(),
            normal: maps.normal.clone(),
            state: maps.state.clone(),
            clock,
        }
    }
}

impl MaterialExtension for PorousExtension {
    fn fragment_shader() -> ShaderRef {
        let path = AssetPath::from_path_buf(embedded_path!("../../shaders/weathered.wgsl"));
        path.with_source(AssetSourceId::from("embedded")).into()
    }
}
