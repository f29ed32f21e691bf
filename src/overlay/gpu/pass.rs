//! The pipelines and the pass itself.

use bevy::asset::AssetPath;
use bevy::asset::embedded_path;
use bevy::asset::io::AssetSourceId;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_storage_2d, uniform_buffer,
};
use bevy::render::render_resource::{
    BindGroupLayoutDescriptor, BindGroupLayoutEntries, CachedComputePipelineId, CachedPipelineState,
    ComputePassDescriptor, ComputePipelineDescriptor, PipelineCache, ShaderStages,
    SpecializedComputePipeline, SpecializedComputePipelines, StorageTextureAccess, TextureFormat,
    TextureSampleType,
};
use bevy::render::renderer::RenderContext;
use bevy::shader::{ShaderCacheError, ShaderDefVal};

use super::mips::{MipBatches, MipPipeline};
use super::prepare::{SplatBatches, SurfaceBatch};
use super::stats::SplatStats;
use crate::overlay::Splat;

/// What a batch of splats holds, if any of it paints. The pipeline that paints it does nothing else.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub(super) struct SplatKinds {
    on_map: bool,
    in_space: bool,
    domes: bool,
    stamps: bool,
}

impl SplatKinds {
    /// Whatever there may be.
    pub(super) const ALL: Self = Self { on_map: true, in_space: true, domes: true, stamps: true };

    /// None if there is nothing to paint.
    pub(super) fn of(splats: &[Splat]) -> Option<Self> {
        let kinds = splats.iter().fold(Self::default(), |kinds, splat| {
            let (in_space, dome) = (splat.in_space != 0, splat.stamp == 0);
            Self {
                on_map: kinds.on_map | !in_space,
                in_space: kinds.in_space | in_space,
                domes: kinds.domes | dome,
                stamps: kinds.stamps | !dome,
            }
        });
        splats.iter().any(Splat::paints).then_some(kinds)
    }

    pub(super) fn in_space(self) -> bool {
        self.in_space
    }

    fn shader_defs(self) -> Vec<ShaderDefVal> {
        let Self { on_map, in_space, domes, stamps } = self;
        [
            (on_map, "ON_MAP"),
            (in_space, "IN_SPACE"),
            (domes, "DOMES"),
            (stamps, "STAMPS"),
            (in_space || stamps, "NEEDS_AXES"),
        ]
        .into_iter()
        .filter(|&(there, _)| there)
        .map(|(_, name)| name.into())
        .collect()
    }
}

/// What the pipelines are made of.
#[derive(Resource)]
pub(super) struct SplatPipeline {
    pub(super) frame_layout: BindGroupLayoutDescriptor,
    pub(super) surface_layout: BindGroupLayoutDescriptor,
    shader: Handle<Shader>,
    /// Puts drops among those that a tile remembers.
    rings: CachedComputePipelineId,
    /// For [`SplatKinds::ALL`]: compiled first, in use until the one for what is there has been.
    all: CachedComputePipelineId,
}

impl SpecializedComputePipeline for SplatPipeline {
    type Key = SplatKinds;

    fn specialize(&self, kinds: SplatKinds) -> ComputePipelineDescriptor {
        ComputePipelineDescriptor {
            label: Some("paint splats".into()),
            layout: vec![self.frame_layout.clone(), self.surface_layout.clone()],
            shader: self.shader.clone(),
            shader_defs: kinds.shader_defs(),
            entry_point: Some("paint_splats".into()),
            ..default()
        }
    }
}

impl SplatPipeline {
    /// Whether anything can be painted yet.
    pub(super) fn is_ready(&self, cache: &PipelineCache) -> bool {
        [self.all, self.rings].iter().all(|&pipeline| cache.get_compute_pipeline(pipeline).is_some())
    }

    /// Whether nothing will ever be painted, unless the shader is edited.
    pub(super) fn has_failed(&self, cache: &PipelineCache) -> bool {
        [self.all, self.rings].iter().any(|&pipeline| has_failed(pipeline, cache))
    }

    /// The narrowest pipeline that is ready; all of them paint the same to the bit.
    pub(super) fn painting(
        &self,
        kinds: SplatKinds,
        pipelines: &mut SpecializedComputePipelines<Self>,
        cache: &PipelineCache,
    ) -> CachedComputePipelineId {
        let own = pipelines.specialize(cache, self, kinds);
        if cache.get_compute_pipeline(own).is_some() { own } else { self.all }
    }
}

/// Whether a pipeline did not compile. What only waits for files has not failed.
pub(super) fn has_failed(pipeline: CachedComputePipelineId, cache: &PipelineCache) -> bool {
    matches!(
        cache.get_compute_pipeline_state(pipeline),
        CachedPipelineState::Err(
            ShaderCacheError::ProcessShaderError(_) | ShaderCacheError::CreateShaderModule(_)
        )
    )
}

pub(super) fn init_splat_pipeline(
    mut commands: Commands,
    mut pipelines: ResMut<SpecializedComputePipelines<SplatPipeline>>,
    assets: Res<AssetServer>,
    cache: Res<PipelineCache>,
) {
    let read_only = || storage_buffer_read_only_sized(false, None);
    let numbers = || texture_2d(TextureSampleType::Uint);
    let frame_layout = BindGroupLayoutDescriptor::new(
        "weathering splats",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (uniform_buffer::<SurfaceBatch>(true), numbers(), read_only(), numbers(), numbers()),
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
    let rings = cache.queue_compute_pipeline(ComputePipelineDescriptor {
        label: Some("remember drops".into()),
        layout: vec![frame_layout.clone(), surface_layout.clone()],
        shader: shader.clone(),
        shader_defs: SplatKinds::ALL.shader_defs(),
        entry_point: Some("remember_drops".into()),
        ..default()
    });
    let all = CachedComputePipelineId::INVALID;
    let mut pipeline = SplatPipeline { frame_layout, surface_layout, shader, rings, all };
    pipeline.all = pipelines.specialize(&cache, &pipeline, SplatKinds::ALL);
    commands.insert_resource(pipeline);
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
    let (Some(frame), false) = (&batches.frame, batches.jobs.is_empty()) else { return };
    let Some(rings) = cache.get_compute_pipeline(pipeline.rings) else { return };
    // Nothing, unless the app has Bevy's `RenderDiagnosticsPlugin`.
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = context.command_encoder();
    let span = diagnostics.time_span(encoder, SplatStats::SPAN);
    let mut pass = encoder
        .begin_compute_pass(&ComputePassDescriptor { label: Some("paint splats"), timestamp_writes: None });
    for job in &batches.jobs {
        pass.set_bind_group(0, frame, &[job.batch_offset]);
        pass.set_bind_group(1, &job.surface, &[]);
        if let Some(painting) = job.painting {
            // Prepared this frame, so it is there.
            let Some(pipeline) = cache.get_compute_pipeline(painting) else { continue };
            pass.set_pipeline(pipeline);
            pass.dispatch_workgroups(job.tiles, 1, 1);
        }
        pass.set_pipeline(rings);
        pass.dispatch_workgroups(job.tiles.div_ceil(64), 1, 1);
    }
    drop(pass);
    mips.halve(encoder, &cache, &mip_pipeline);
    span.end(encoder);
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    #[test]
    fn a_batch_is_painted_by_a_pipeline_that_knows_all_of_it() {
        let splat = |in_space, stamp| Splat { in_space, stamp, diffuse: u32::MAX, ..Splat::zeroed() };
        let kinds = |splats: &[Splat]| SplatKinds::of(splats).unwrap().shader_defs();
        let names = |names: &[&str]| names.iter().map(|&name| name.into()).collect::<Vec<ShaderDefVal>>();
        assert_eq!(kinds(&[splat(0, 0), splat(0, 0)]), names(&["ON_MAP", "DOMES"]));
        assert_eq!(kinds(&[splat(0, 3)]), names(&["ON_MAP", "STAMPS", "NEEDS_AXES"]));
        assert_eq!(kinds(&[splat(1, 0)]), names(&["IN_SPACE", "DOMES", "NEEDS_AXES"]));
        assert_eq!(SplatKinds::of(&[splat(1, 3), splat(0, 0)]), Some(SplatKinds::ALL));
        // Clear water needs none.
        let water = Splat { water_nl: 7, ..Splat::zeroed() };
        assert_eq!(SplatKinds::of(&[water, water]), None);
        assert_eq!(
            kinds(&[water, splat(1, 3)]),
            names(&["ON_MAP", "IN_SPACE", "DOMES", "STAMPS", "NEEDS_AXES"])
        );
    }
}
