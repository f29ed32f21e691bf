//! Wet porous surfaces on the screen.
//!
//! A weathered surface is drawn with [`WeatheredMaterial`]: Bevy's `StandardMaterial`, extended. The extension reads
//! the surface's [maps](crate::overlay), works out how wet each texel is at this moment, and changes the diffuse
//! and specular coefficients *per light* by the porous BRDF post-process of Hnat et al. ([`hnat`](models::hnat)), since masking
//! and pore depth depend on where the light stands. A separate, nearly mirror-like lobe is the water in the pores. Lights,
//! shadows, clusters, fog and the environment map are Bevy's own.
//!
//! With porosity 0 or where nothing is wet, a surface looks as its `StandardMaterial` does.
//!
//! Not here: transmission, contact shadows, and screen-space reflections on weathered surfaces; deferred rendering
//! draws them without wetness.

mod clock;
mod exchange;
mod extension;
pub mod film;
pub mod models;

use bevy::asset::{AssetEventSystems, embedded_asset};
use bevy::pbr::MaterialPlugin;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::shader::load_shader_library;
use serde::{Deserialize, Serialize};

pub use clock::ClockBuffer;
pub use exchange::DryMaterial;
pub use extension::{PorousExtension, PorousUniform, WeatheredMaterial};

/// How a surface takes up water and looks with it. On an entity with [`Weatherable`](crate::overlay::Weatherable);
/// without it, the default is used.
#[derive(Component, Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
#[reflect(Component)]
#[serde(deny_unknown_fields, default)]
pub struct PorousMaterial {
    /// α_poro, the part of the surface that is pores; 0 (glazed) to 1.
    pub alpha_poro: f32,
    /// s_p, shape of a pore from deep (near 0) to shallow (1). Deep pores are dark when dry already, so .005 to
    /// .15 show wetness best.
    pub s_p: f32,
    /// m, RMS slope of the surface between pores, 0..=1.
    pub m: f32,
    /// k_s, the part of the light that the dry surface scatters back without entering it, 0..=1. What of it falls
    /// into pores is a whitish veil over the dry colour, which water takes away: the more, the more saturated wet.
    pub k_s: f32,
    /// k_w, strength of the water's own reflection, 0..=1.
    pub k_w: f32,
    /// Uses k = sqrt(2 m²/π) (Schlick 1994) instead of k = 2 m²/π as printed.
    pub sqrt_k: bool,
    /// Seconds from the first water in a texel until it looks wet; 0 is at once.
    pub t_fill: f32,
    /// Water, in mm, at which a texel looks fully wet.
    pub capacity_mm: f32,
    /// What the base colour shows.
    pub texture: TextureMeaning,
    /// The BRDF that is post-processed.
    pub brdf: BaseBrdf,
}

/// What a base colour texture is a picture of.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TextureMeaning {
    /// The porous surface, dry: a photograph. Wetness multiplies by `kd_w / kd'`.
    #[default]
    DryLook,
    /// The solid between the pores. Porosity darkens it dry, too.
    Solid,
}

/// The BRDF under the post-process.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BaseBrdf {
    /// Bevy's own: GGX and Burley's diffuse.
    #[default]
    Ggx,
    /// Blinn-Phong and Lambert, as in the paper.
    BlinnPhong,
}

impl Default for PorousMaterial {
    /// Terracotta-like.
    fn default() -> Self {
        Self {
            alpha_poro: 0.5,
            s_p: 0.02,
            m: 0.35,
            k_s: 0.04,
            k_w: 0.9,
            sqrt_k: false,
            t_fill: 0.4,
            capacity_mm: 0.05,
            texture: TextureMeaning::DryLook,
            brdf: BaseBrdf::Ggx,
        }
    }
}

/// Draws weathered surfaces. Does nothing without a render app.
pub struct PorousMaterialPlugin;

impl Plugin for PorousMaterialPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<PorousMaterial>();
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        load_shader_library!(app, "../../shaders/common/hnat.wgsl");
        load_shader_library!(app, "../../shaders/common/wet_map.wgsl");
        load_shader_library!(app, "../../shaders/common/wet_lighting.wgsl");
        embedded_asset!(app, "../../shaders/weathered.wgsl");
        app.add_plugins(MaterialPlugin::<WeatheredMaterial>::default())
            .add_plugins(clock::plugin)
            .add_observer(exchange::release_surface)
            .add_systems(
                PostUpdate,
                (
                    exchange::exchange_materials,
                    exchange::follow_dry_materials,
                    exchange::follow_porous_materials,
                )
                    .chain()
                    // What is added here is drawn in this frame.
                    .before(AssetEventSystems),
            );
    }
}
