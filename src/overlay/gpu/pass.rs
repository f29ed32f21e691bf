//! The pipeline and the pass itself.

use bevy::asset::AssetPath;
use bevy::asset::embedded_path;
use bevy::asset::io::AssetSourceId;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_storage_2d, uniform_buffer,
};
use bevy::render::render_resource::{
    BindGroupLayoutDescriptor, BindGroupLayoutEntries, CachedComputePipelineId, ComputePassDescriptor,
    ComputePipelineDescriptor, PipelineCache, ShaderStages, StorageTextureAccess, TextureFormat,
};
use bevy::render::renderer::RenderContext;

use super::mips::{MipBatches, MipPipeline};
use super::prepare::{SplatBatches, SurfaceBatch};
use super::stats::SplatStats;

/// The compiled pass.
#[derive(Resource)]
pub(super) struct SplatPipeline {
    pub(super) frame_layout: BindGroupLayoutDescriptor,
    pub(super) surface_layout: BindGroupLayoutDescriptor,
    pub(super) pipeline: CachedComputePipelineId,
}

pub(super) fn init_splat_pipeline(
    mut commands: Commands,
    assets: Res<AssetServer>,
    cache: Res<PipelineCache>,
) {
    let read_only = || storage_buffer_read_only_sized(false, None);
    let frame_layout = BindGroupLayoutDescriptor::new(
        "weathering splats",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (uniform_buffer::<SurfaceBatch>(true), read_only(), read_only(), read_only(), read_only()),
        ),
    );
    let map = || texture_storage_2d(TextureFormat::Rgba8Unorm, StorageTextureAccess::ReadWrite);
    let surface_layout = BindGroupLayoutDescriptor::new(
        "weathering surface",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (map(), map(), map(), storage_buffer_sized(false, None), read_only()),
        ),
    );
    let shader = assets.load(
        AssetPath::from_path_buf(embedded_path!("../../../shaders/splat.wgsl"))
            .with_source(AssetSourceId::from("embedded")),
    );
    let pipeline = cache.queue_compute_pipeline(ComputePipelineDescriptor {
        label: Some("paint splats".into()),
        layout: vec![frame_layout.clone(), surface_layout.clone()],
        shader,
        entry_point: Some("paint_splats".into()),
        ..default()
    });
    commands.insert_resource(SplatPipeline { frame_layout, surface_layout, pipeline });
}

/// Dispatches this frame's jobs, then the halving of what they painted.
pub(super) fn paint_splats(
    mut context: RenderContext,
    cache: Res<PipelineCache>,
    pipeline: Res<SplatPipeline>,
    batches: Res<SplatBatches>,
    mip_pipeline: Res<MipPipeline>,
    mips: Res<MipBatches>,
) {
    if batches.jobs.is_empty() {
        return;
    }
    let (Some(pipeline), Some(frame)) = (cache.get_compute_pipeline(pipeline.pipeline), &batches.frame)
    else {
        return;
    };
    // Nothing, unless the app has Bevy's `RenderDiagnosticsPlugin`.
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = context.command_encoder();
    let span = diagnostics.time_span(encoder, SplatStats::SPAN);
    let mut pass = encoder
        .begin_compute_pass(&ComputePassDescriptor { label: Some("paint splats"), timestamp_writes: None });
    pass.set_pipeline(pipeline);
    for job in &batches.jobs {
        pass.set_bind_group(0, frame, &[job.batch_offset]);
        pass.set_bind_group(1, &job.surface, &[]);
        pass.dispatch_workgroups(job.tiles, 1, 1);
    }
    drop(pass);
    mips.halve(encoder, &cache, &mip_pipeline);
    span.end(encoder);
}
