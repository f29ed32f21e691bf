//! Water in and on matter: it arrives, is absorbed, runs, spreads and dries.
//!
//! Impacts leave [`Drop`]s, which are shared out among the texels under their stamps, in exact volumes (`soak`). From then
//! on a texel holds a film and absorbed water, true at its reference tick; what it holds now is a closed form of time
//! ([`evolve`]), worked out where somebody asks: here, when water moves, and in the shader. So matter absorbs and dries
//! without any work, and a surface at rest costs nothing.
//!
//! Only what moves takes steps, on the tiles where it does: films run over the mesh (`run_off`), leave it as drips that
//! are particles again, and pores share what they hold ([`spread`]). When a shower is over, wet patches learn where their
//! rim is, which dries first. [`Exposure`] says how well air and sun get at each texel, by rays.
//!
//! All of this is in the main world, in the tick, with and without a renderer: one owner, whole numbers, no way back from the
//! GPU to wait for. What is drawn gets the tiles that changed ([`gpu`]).
//!
//! Not here: dust, snow and mud; water under the surface of a pool that flows; evaporation that cools.

mod adjacency;
mod drip;
pub mod evolve;
mod exposure;
mod finder;
mod geometry;
pub mod gpu;
mod grid;
mod gutters;
mod links;
pub mod look;
mod marks;
mod ownership;
mod points;
mod prepare;
pub(crate) mod query;
mod rim;
mod run_off;
mod soak;
pub mod spread;
mod surface;
#[cfg(test)]
mod test_meshes;
mod texel;
mod tick;
mod walk;

use bevy::prelude::*;

use crate::effect::{EffectTable, WeatherEffect};
use crate::overlay::Weatherable;
use crate::schedule::{WeatheringSystems, WeatheringTick};

pub use drip::{Drip, DripEffect, DripSite, drip_effect};
pub use exposure::{Exposure, ExposureProgress};
pub use geometry::{Link, Side, TexelGeometry};
pub use marks::Marks;
pub use points::{SurfacePoint, surface_points};
pub use prepare::WetGeometry;
pub use query::{BecameWet, Dried, SurfaceWetness, WatchWetness, Wetness, WetnessQuery};
pub use soak::Drop;
pub use surface::{Ledger, Stock, SurfaceWater};
pub use texel::{Scale, TexelWater, Units};
pub use tick::WettingStats;

pub(crate) use surface::Now;

/// Drips of this tick, of one surface.
#[derive(Component, Debug, Default)]
pub struct Dripping(pub Vec<Drip>);

/// Water that waits to be soaked up, of one surface, in the order of its impacts.
#[derive(Component, Debug, Default)]
pub struct DropQueue(pub Vec<Drop>);

/// In `PreUpdate`, after colliders: surfaces learn their shape, texel by texel.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct MeasureSurfaces;

/// Simulates water on surfaces. Needs no render app.
pub struct WettingPlugin;

impl Plugin for WettingPlugin {
    fn build(&self, app: &mut App) {
        app.register_required_components::<Weatherable, DropQueue>()
            .register_required_components::<Weatherable, Dripping>()
            .register_type::<WatchWetness>()
            .init_resource::<WettingStats>()
            .init_resource::<DripEffect>()
            .init_resource::<ExposureProgress>()
            .add_message::<BecameWet>()
            .add_message::<Dried>()
            .add_observer(prepare::release_surface)
            .add_systems(
                PreUpdate,
                (prepare::settle_before_new_material, prepare::measure_surfaces, exposure::bake_exposure)
                    .chain()
                    .in_set(MeasureSurfaces)
                    .after(crate::collision::BuildColliders)
                    .after(crate::overlay::measure_texels),
            )
            .add_systems(
                WeatheringTick,
                (
                    (tick::advance_water, drip::shed_drips).chain().in_set(WeatheringSystems::Flow),
                    // Sees the finished tick.
                    query::watch_wetness.in_set(WeatheringSystems::Flow).after(drip::shed_drips),
                ),
            );
        let handle = match app.world_mut().get_resource_mut::<Assets<WeatherEffect>>() {
            Some(mut effects) => effects.add(drip_effect()),
            None => Handle::default(),
        };
        if let Some(mut table) = app.world_mut().get_resource_mut::<EffectTable>() {
            let index = table.insert(handle.clone(), drip_effect());
            app.insert_resource(DripEffect { handle, index });
        }
    }
}
