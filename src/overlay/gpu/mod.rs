//! Painting splats on the GPU: one compute pass before the cameras draw.
//!
//! Main world: every surface gets textures and buffers ([`Overlays`]), of full size once there is something to put there: rings
//! with the first splat, colour maps with the first that paints. Extract moves the waiting splats over (each exactly once, however
//! many ticks the frame held). Prepare sorts them into tiles and uploads them; until the pipeline and the maps exist, they wait,
//! and so does what is beyond the frame's [`SplatBudget`]. If the pipeline can never exist, they are counted as
//! [lost](SplatStats::lost) and time goes on. The pass dispatches one workgroup per touched tile, if anything in the batch paints,
//! and remembers drops: a surface without new splats costs nothing, which [`SplatStats`] shows. Then the touched tiles are halved
//! into the mip maps of the colour maps (`mips.rs`). Maps of another size get what was painted on the old ones (`copies.rs`).

mod backlog;
mod copies;
mod hold;
mod maps;
mod mips;
mod pass;
mod prepare;
mod stats;
mod texels;

use bevy::asset::embedded_asset;
use bevy::core_pipeline::schedule::camera_driver;
use bevy::prelude::*;
use bevy::render::render_resource::SpecializedComputePipelines;
use bevy::render::renderer::RenderGraph;
use bevy::render::{ExtractSchedule, Render, RenderApp, RenderStartup, RenderSystems};
use bevy::shader::load_shader_library;

use super::deposit::{deposit_splats, note_traces};
use super::{MapSizeSystems, SplatBudget, SplatQueue};
use crate::schedule::{TickHold, WeatheringSystems, WeatheringTick};

pub use maps::Overlays;
pub use mips::MipStep;
pub use prepare::SurfaceBatch;
pub use stats::SplatStats;

/// Paints splats with a compute pass. Needs a render app; without one it throws splats away. To keep what falls there,
/// put [`CpuOverlayPlugin`](super::CpuOverlayPlugin) in its place.
pub struct GpuOverlayPlugin;

impl Plugin for GpuOverlayPlugin {
    fn build(&self, app: &mut App) {
        if app.get_sub_app(RenderApp).is_none() {
            app.add_systems(PostUpdate, discard_splats.after(note_traces));
            return;
        }
        load_shader_library!(app, "../../../shaders/common/kernel.wgsl");
        load_shader_library!(app, "../../../shaders/common/stamp.wgsl");
        embedded_asset!(app, "../../../shaders/splat.wgsl");
        embedded_asset!(app, "../../../shaders/mips.wgsl");
        embedded_asset!(app, "../../../shaders/resize.wgsl");

        let stats = SplatStats::default();
        app.insert_resource(stats.clone())
            .register_type::<SplatBudget>()
            .init_resource::<SplatBudget>()
            .init_resource::<TickHold>()
            .add_observer(maps::release_overlays)
            .add_systems(
                PreUpdate,
                (
                    // Of maps whose size has been decided; what has waited since the last tick gets its room at once.
                    (copies::forget_copies, maps::add_overlays, maps::open_overlays)
                        .chain()
                        .after(MapSizeSystems),
                    // What is taken away with its maps waits no more.
                    hold::hold_ticks.after(MapSizeSystems),
                ),
            )
            .add_systems(
                WeatheringTick,
                // Counts what this tick has put down.
                hold::hold_ticks.after(deposit_splats).in_set(WeatheringSystems::Deposit),
            );

        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app
            .insert_resource(stats)
            .init_resource::<prepare::PendingSplats>()
            .init_resource::<prepare::SplatBatches>()
            .init_resource::<prepare::StampTexture>()
            .init_resource::<mips::MipBatches>()
            .init_resource::<copies::PendingCopies>()
            .init_resource::<SpecializedComputePipelines<pass::SplatPipeline>>()
            .add_systems(
                RenderStartup,
                (pass::init_splat_pipeline, mips::init_mip_pipeline, copies::init_double_pipeline),
            )
            .add_systems(
                ExtractSchedule,
                (prepare::extract_splats, prepare::extract_stamps, copies::extract_copies).chain(),
            )
            .add_systems(
                Render,
                // Splats wait for what was painted before them.
                (copies::prepare_copies, prepare::prepare_splats)
                    .chain()
                    .in_set(RenderSystems::PrepareBindGroups),
            )
            // Splats are painted over what was there before.
            .add_systems(RenderGraph, copies::move_maps.before(pass::paint_splats))
            // Materials sample the maps that this pass writes.
            .add_systems(RenderGraph, pass::paint_splats.before(camera_driver));
    }
}

/// So that queues do not grow without end where nobody paints.
fn discard_splats(mut queues: Query<&mut SplatQueue>) {
    for mut queue in &mut queues {
        if !queue.is_empty() {
            queue.clear();
        }
    }
}
