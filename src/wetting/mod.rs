//! Water in and on matter: it arrives, is absorbed, runs, spreads and dries.
//!
//! Impacts leave [`Drop`]s, which are shared out among the texels under their stamps, in exact volumes (`soak`). From then
//! on a texel holds a film and absorbed water, true at its reference tick; what it holds now is a closed form of time
//! ([`evolve`]), worked out where somebody asks: here, when water moves, and in the shader. So matter absorbs and dries
//! without any work, and a surface at rest costs nothing.
//!
//! Only what moves takes steps, on the tiles where it does: films run over the mesh (`flow`, `run_off`), leave it as drips that
//! are particles again, and pores share what they hold ([`spread`]). When a shower is over, wet patches learn where their
//! rim is, which dries first. [`Exposure`] says how well air and sun get at each texel, by rays.
//!
//! All of this is in the main world, in the tick, with and without a renderer: one owner, whole numbers, no way back from the
//! GPU to wait for. What is drawn gets the tiles that changed ([`gpu`]).
//!
//! On meshes that are posed, water runs by the slopes of their pose (`posed`) and drips from where they are; areas and exposure
//! are those of the mesh at rest.
//!
//! What it does to dust, mud and snow is told in [`matter`](crate::matter). Which emitter it came from is kept for those who
//! ask ([`Origin`]).
//!
//! Not here: water under the surface of a pool that flows; evaporation that cools.

mod adjacency;
mod arrivals;
mod by_hand;
mod drip;
pub mod evolve;
mod exposure;
mod finder;
mod flow;
mod geometry;
pub mod gpu;
mod grid;
mod gutters;
mod islands;
mod landings;
mod links;
pub mod look;
mod marks;
mod measure;
mod now;
mod origin;
mod ownership;
mod points;
mod posed;
mod prepare;
mod put_back;
pub(crate) mod query;
mod ready;
mod resize;
mod rim;
mod run_off;
mod slopes;
mod soak;
pub mod spread;
mod surface;
#[cfg(test)]
pub(crate) mod test_meshes;
mod texel;
mod tick;
mod tiles;
mod timing;
mod touched;
mod walk;

use bevy::prelude::*;

use crate::effect::{EffectTable, WeatherEffect};
use crate::matter::{FallingSnow, MatterQueue, SurfaceMatter};
use crate::overlay::Weatherable;
use crate::schedule::{WeatheringSystems, WeatheringTick};
use crate::weather::{DryingClock, Weather};

pub use drip::{Drip, DripEffect, DripSite, drip_effect, muddy_drip_effect, snow_fall_effect};
pub use exposure::{Exposure, ExposureProgress};
pub use geometry::{Link, Side, TexelGeometry};
pub use marks::Marks;
pub use origin::Origin;
pub use points::{SurfacePoint, surface_points};
pub(crate) use posed::forget_poses;
pub(crate) use prepare::{ExchangeMatter, Measured, put_matter};
pub use prepare::{MeasureProgress, WetGeometry};
pub use put_back::{KeptSurface, NotPutBack};
pub use query::{BecameWet, Dried, SurfaceWetness, WatchWetness, Wetness, WetnessQuery};
pub use ready::{Refusal, SurfaceReady, SurfaceRefused};
pub(crate) use resize::Shares;
pub use soak::Drop;
pub use surface::{Ledger, Stock, SurfaceWater};
pub use texel::{Scale, TexelWater, Units};
pub use tick::WettingStats;
pub(crate) use timing::MeasureTimer;
pub use timing::MeasureTiming;

pub(crate) use geometry::TexelLayout;
pub(crate) use now::Now;
#[cfg(test)]
pub(crate) use run_off::{RunScratch, run_off};
#[cfg(test)]
pub(crate) use soak::{SoakScratch, soak};
pub(crate) use soak::{note_arrival, texel_under};
pub(crate) use surface::jitter;
pub(crate) use tiles::{Tiles, texel_in};

/// Drips of this tick, of one surface.
#[derive(Component, Debug, Default)]
pub struct Dripping(pub Vec<Drip>);

/// Water that waits to be soaked up, of one surface, in the order of its impacts.
#[derive(Component, Debug, Default)]
pub struct DropQueue(pub Vec<Drop>);

/// In `PreUpdate`, after colliders: surfaces learn their shape, texel by texel.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct MeasureSystems;

/// Simulates water on surfaces, and the dust, mud and snow that it meets there. Needs no render app.
pub struct WettingPlugin;

impl Plugin for WettingPlugin {
    fn build(&self, app: &mut App) {
        app.register_required_components::<Weatherable, SurfaceMatter>()
            // Queues are there where somebody empties them.
            .register_required_components::<Weatherable, MatterQueue>()
            .register_required_components::<Weatherable, FallingSnow>()
            .register_required_components::<Weatherable, DropQueue>()
            .register_required_components::<Weatherable, Dripping>()
            .register_type::<WatchWetness>()
            .register_type::<Origin>()
            .register_type::<MeasureTiming>()
            .init_resource::<MeasureTiming>()
            .init_resource::<MeasureProgress>()
            .init_resource::<WettingStats>()
            .init_resource::<DripEffect>()
            .init_resource::<ExposureProgress>()
            .init_resource::<DryingClock>()
            .init_resource::<Weather>()
            .add_message::<BecameWet>()
            .add_message::<Dried>()
            .add_message::<SurfaceReady>()
            .add_message::<SurfaceRefused>()
            .add_observer(ready::tell_ready)
            .add_observer(ready::tell_refused_mesh)
            .add_observer(ready::tell_refused_maps)
            .add_observer(prepare::release_surface)
            .add_observer(prepare::release_maps)
            .add_systems(
                PreUpdate,
                (
                    prepare::settle_before_new_material,
                    prepare::measure_surfaces,
                    posed::measure_posed_slopes,
                    exposure::bake_exposure,
                    origin::ask_for_origins,
                )
                    .chain()
                    .in_set(MeasureSystems)
                    .after(crate::collision::ColliderSystems)
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
        let shed = [drip_effect(), snow_fall_effect(), muddy_drip_effect()];
        let handles = match app.world_mut().get_resource_mut::<Assets<WeatherEffect>>() {
            Some(mut effects) => shed.each_ref().map(|effect| effects.add(effect.clone())),
            // Three that differ: the table knows effects by their handles.
            None => [1, 2, 3].map(|number| {
                let number = 0x7765_6174_6865_7200 + number;
                Handle::Uuid(bevy::asset::uuid::Uuid::from_u128(number), std::marker::PhantomData)
            }),
        };
        if let Some(mut table) = app.world_mut().get_resource_mut::<EffectTable>() {
            let [drop, lump, mud] = shed;
            let drop = table.insert(handles[0].clone(), drop);
            let lump = table.insert(handles[1].clone(), lump);
            let mud = table.insert(handles[2].clone(), mud);
            let rows = drop.zip(lump).zip(mud).map(|((drop, lump), mud)| [drop, lump, mud]);
            app.insert_resource(DripEffect { handles, rows });
        }
    }
}
