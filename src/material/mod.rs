//! Wet porous surfaces on the screen.
//!
//! A weathered surface is drawn with [`WeatheredMaterial`]: Bevy's `StandardMaterial`, extended. The extension reads
//! the surface's [maps](crate::overlay), works out how wet each texel is at this moment, and changes the diffuse
//! and specular coefficients *per light* by the porous BRDF post-process of Hnat et al. ([`hnat`](models::hnat)), since masking
//! and pore depth depend on where the light stands. A separate, nearly mirror-like lobe is the water in the pores. Lights,
//! shadows, clusters, fog and the environment map are Bevy's own.
//!
//! What lies on a surface, and the waves of water, lean over its own normal map by reoriented normal mapping ([`normals`],
//! which tells the conventions of normal maps, too).
//!
//! With porosity 0 or where nothing is wet, a surface looks as its `StandardMaterial` does.
//!
//! They are drawn forward, also beside deferred surfaces: a G-buffer has no room for pores.
//!
//! Not here: rectangular lights, specular transmission, contact shadows and screen-space reflections on wet surfaces.

mod clock;
mod exchange;
mod extension;
pub mod film;
pub mod footprint;
mod key;
pub mod models;
pub mod normals;
mod played;
mod porous;
pub mod presets;
mod ranges;
mod standing;
mod uniform;
mod warm_up;

use bevy::asset::{AssetEventSystems, embedded_asset};
use bevy::pbr::MaterialPlugin;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::shader::load_shader_library;

use crate::matter::MatterLook;
use crate::overlay::deposit::note_traces;
use crate::wetting::gpu::WaterUploadSystems;

pub use clock::{ClockBuffer, GpuDryingPoint};
pub use exchange::DryMaterial;
pub use extension::{MatterUniform, PorousExtension, PorousUniform, WeatheredMaterial};
pub use key::{ModelKind, PorousKey};
pub use played::{PlayedWetMap, Playing};
pub use porous::{
    BaseBrdf, Coated, Grains, Pores, PorositySource, PorousMaterial, TextureMeaning, Tweaked, WetLook,
    WettingModel, WettingTextures,
};
pub use ranges::{OutOfRange, range_of};
pub use standing::{Flood, StandingWater};
pub use warm_up::Understudy;

/// Draws weathered surfaces. Does nothing without a render app.
pub struct PorousMaterialPlugin;

impl Plugin for PorousMaterialPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<PorousMaterial>()
            .register_type::<WettingTextures>()
            .register_type::<StandingWater>()
            .register_type::<PlayedWetMap>()
            .register_type::<DryMaterial>();
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        load_shader_library!(app, "../../shaders/common/hnat.wgsl");
        load_shader_library!(app, "../../shaders/common/lagarde.wgsl");
        load_shader_library!(app, "../../shaders/common/lekner_dorf.wgsl");
        load_shader_library!(app, "../../shaders/common/twomey.wgsl");
        load_shader_library!(app, "../../shaders/common/film_on_pores.wgsl");
        load_shader_library!(app, "../../shaders/common/authored.wgsl");
        load_shader_library!(app, "../../shaders/common/water_film.wgsl");
        load_shader_library!(app, "../../shaders/common/flood.wgsl");
        load_shader_library!(app, "../../shaders/common/ripples.wgsl");
        load_shader_library!(app, "../../shaders/common/drying.wgsl");
        load_shader_library!(app, "../../shaders/common/matter.wgsl");
        load_shader_library!(app, "../../shaders/common/normals.wgsl");
        load_shader_library!(app, "../../shaders/common/footprint.wgsl");
        load_shader_library!(app, "../../shaders/common/wet_map.wgsl");
        load_shader_library!(app, "../../shaders/common/wet_surface.wgsl");
        load_shader_library!(app, "../../shaders/common/wet_layers.wgsl");
        load_shader_library!(app, "../../shaders/common/wet_lighting.wgsl");
        embedded_asset!(app, "../../shaders/weathered.wgsl");
        app.add_plugins(MaterialPlugin::<WeatheredMaterial>::default())
            .add_plugins((clock::plugin, warm_up::plugin))
            .init_resource::<MatterLook>()
            .add_observer(exchange::release_surface)
            .add_observer(exchange::note_removed)
            .add_systems(
                PostUpdate,
                (
                    exchange::exchange_materials,
                    exchange::follow_dry_materials,
                    exchange::follow_surfaces,
                    exchange::follow_matter_look,
                )
                    .chain()
                    // The first water is drawn in the frame in which it comes.
                    .after(note_traces)
                    // A surface that gets room for its water is bound to it at once.
                    .after(WaterUploadSystems)
                    // What is added here is drawn in this frame.
                    .before(AssetEventSystems),
            );
    }
}
