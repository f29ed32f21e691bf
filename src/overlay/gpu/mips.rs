//! Halving what was painted, level by level.
//!
//! After a pass, every tile it touched is halved into the next level, then the tiles that hold those, and so on to the last.
//! A map on which nothing fell costs nothing. Levels are views of the maps' textures; they are bound once for a surface and kept
//! until it gets other maps.

use bevy::asset::io::AssetSourceId;
use bevy::asset::{AssetPath, embedded_path};
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_storage_2d, uniform_buffer,
};
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, Buffer, BufferUsages,
    CachedComputePipelineId, CommandEncoder, ComputePassDescriptor, ComputePipelineDescriptor,
    DynamicUniformBuffer, PipelineCache, RawBufferVec, ShaderStages, ShaderType, StorageTextureAccess,
    TextureFormat, TextureId, TextureSampleType, TextureView, TextureViewDescriptor,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;

use crate::overlay::TileHeader;
use crate::overlay::mips::Lying;

/// One level of one surface. `MipStep` in `shaders/mips.wgsl` has the same fields.
#[derive(ShaderType, Debug, Clone, Copy)]
pub struct MipStep {
    /// Texels along each side of the level that is made.
    pub size: u32,
    /// The step's first row in the tile buffer.
    pub first_tile: u32,
    /// The word of the surface's mask with which the level above begins.
    pub first_word: u32,
    /// 1 if the surface has a mask, else 0.
    pub masked: u32,
}

/// The compiled pass.
#[derive(Resource)]
pub(super) struct MipPipeline {
    frame_layout: BindGroupLayoutDescriptor,
    surface_layout: BindGroupLayoutDescriptor,
    pub(super) pipeline: CachedComputePipelineId,
}

pub(super) fn init_mip_pipeline(mut commands: Commands, assets: Res<AssetServer>, cache: Res<PipelineCache>) {
    let read_only = || storage_buffer_read_only_sized(false, None);
    let frame_layout = BindGroupLayoutDescriptor::new(
        "weathering mip steps",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (uniform_buffer::<MipStep>(true), read_only()),
        ),
    );
    let above = || texture_2d(TextureSampleType::Float { filterable: false });
    let made = || texture_storage_2d(TextureFormat::Rgba8Unorm, StorageTextureAccess::WriteOnly);
    let surface_layout = BindGroupLayoutDescriptor::new(
        "weathering mips",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (above(), above(), above(), made(), made(), made(), read_only()),
        ),
    );
    let shader = assets.load(
        AssetPath::from_path_buf(embedded_path!("../../../shaders/mips.wgsl"))
            .with_source(AssetSourceId::from("embedded")),
    );
    let pipeline = cache.queue_compute_pipeline(ComputePipelineDescriptor {
        label: Some("halve maps".into()),
        layout: vec![frame_layout.clone(), surface_layout.clone()],
        shader,
        entry_point: Some("halve_maps".into()),
        ..default()
    });
    commands.insert_resource(MipPipeline { frame_layout, surface_layout, pipeline });
}

/// The levels of a surface's maps.
pub(super) struct SurfaceLevels {
    textures: [TextureId; 3],
    masked: bool,
    /// The maps themselves, without what is below them: what is painted.
    pub(super) painted: [TextureView; 3],
    /// From each level to the next.
    steps: Vec<BindGroup>,
}

impl SurfaceLevels {
    /// Binds the levels of three maps of one size. `lying`: the mask, or a word where there is none (`masked`).
    pub(super) fn new(
        maps: [&GpuImage; 3],
        lying: &Buffer,
        masked: bool,
        pipeline: &MipPipeline,
        cache: &PipelineCache,
        device: &RenderDevice,
    ) -> Self {
        let level_of = |level| {
            maps.map(|map| {
                map.texture.create_view(&TextureViewDescriptor {
                    base_mip_level: level,
                    mip_level_count: Some(1),
                    ..default()
                })
            })
        };
        let count = maps.iter().map(|map| map.texture_descriptor.mip_level_count).min().unwrap_or(1);
        let levels: Vec<[TextureView; 3]> = (0..count).map(level_of).collect();
        let layout = cache.get_bind_group_layout(&pipeline.surface_layout);
        let bind = |(above, made): (&[TextureView; 3], &[TextureView; 3])| {
            device.create_bind_group(
                "weathering mips",
                &layout,
                &BindGroupEntries::sequential((
                    &above[0],
                    &above[1],
                    &above[2],
                    &made[0],
                    &made[1],
                    &made[2],
                    lying.as_entire_buffer_binding(),
                )),
            )
        };
        Self {
            textures: maps.map(|map| map.texture.id()),
            masked,
            painted: level_of(0),
            steps: levels.iter().zip(levels.iter().skip(1)).map(bind).collect(),
        }
    }

    /// Whether these are the levels of these maps.
    pub(super) fn are_of(&self, maps: [&GpuImage; 3], masked: bool) -> bool {
        self.textures == maps.map(|map| map.texture.id()) && self.masked == masked
    }
}

/// What this frame's pass will halve.
#[derive(Resource)]
pub(super) struct MipBatches {
    steps: DynamicUniformBuffer<MipStep>,
    /// Column of a tile, and row above it; 16 bits each.
    tiles: RawBufferVec<u32>,
    /// Tiles of the level at hand.
    touched: Vec<u32>,
    /// The buffers above.
    frame: Option<BindGroup>,
    jobs: Vec<MipJob>,
}

/// One dispatch.
struct MipJob {
    levels: BindGroup,
    step_offset: u32,
    tiles: u32,
}

impl Default for MipBatches {
    fn default() -> Self {
        Self {
            steps: DynamicUniformBuffer::default(),
            tiles: RawBufferVec::new(BufferUsages::STORAGE),
            touched: Vec::new(),
            frame: None,
            jobs: Vec::new(),
        }
    }
}

impl MipBatches {
    /// Forgets the last frame.
    pub(super) fn clear(&mut self) {
        self.steps.clear();
        self.tiles.clear();
        self.jobs.clear();
    }

    /// Adds a surface with maps of `size` texels along each side, of which some tiles will be painted.
    pub(super) fn add(&mut self, levels: &SurfaceLevels, size: u32, painted: &[TileHeader]) {
        let Self { steps, tiles, touched, jobs, .. } = self;
        touched.clear();
        touched.extend(painted.iter().map(|tile| tile.x | tile.y << 16));
        for (level, bound) in (0..).zip(&levels.steps) {
            if level > 0 {
                holders(touched);
            }
            let step = MipStep {
                size: size >> (level + 1),
                first_tile: tiles.len() as u32,
                first_word: Lying::first_word(size, level),
                masked: u32::from(levels.masked),
            };
            tiles.values_mut().extend_from_slice(touched);
            let step_offset = steps.push(&step);
            jobs.push(MipJob { levels: bound.clone(), step_offset, tiles: touched.len() as u32 });
        }
    }

    /// Uploads what was added.
    pub(super) fn write(
        &mut self,
        pipeline: &MipPipeline,
        cache: &PipelineCache,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) {
        self.steps.write_buffer(device, queue);
        self.tiles.write_buffer(device, queue);
        let (Some(steps), Some(tiles)) = (self.steps.binding(), self.tiles.binding()) else { return };
        self.frame = Some(device.create_bind_group(
            "weathering mip steps",
            &cache.get_bind_group_layout(&pipeline.frame_layout),
            &BindGroupEntries::sequential((steps, tiles)),
        ));
    }

    /// Dispatches this frame's steps, each after the one before it.
    pub(super) fn halve(&self, encoder: &mut CommandEncoder, cache: &PipelineCache, pipeline: &MipPipeline) {
        let (Some(pipeline), Some(frame)) = (cache.get_compute_pipeline(pipeline.pipeline), &self.frame)
        else {
            return;
        };
        let mut pass = encoder
            .begin_compute_pass(&ComputePassDescriptor { label: Some("halve maps"), timestamp_writes: None });
        pass.set_pipeline(pipeline);
        for job in &self.jobs {
            pass.set_bind_group(0, frame, &[job.step_offset]);
            pass.set_bind_group(1, &job.levels, &[]);
            pass.dispatch_workgroups(job.tiles, 1, 1);
        }
    }
}

/// From tiles of a level to those of the next that hold them, each once, in order of rows and columns.
fn holders(tiles: &mut Vec<u32>) {
    // Both halves at once: the mask takes away the bit of a row that fell into its column.
    tiles.iter_mut().for_each(|tile| *tile = *tile >> 1 & 0x7fff_7fff);
    tiles.sort_unstable();
    tiles.dedup();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_are_held_by_one_of_the_next_level() {
        let packed = |tiles: &[(u32, u32)]| tiles.iter().map(|(x, y)| x | y << 16).collect::<Vec<u32>>();
        let mut tiles = packed(&[(0, 0), (1, 0), (6, 0), (127, 0), (0, 1), (1, 3), (127, 127)]);
        holders(&mut tiles);
        assert_eq!(tiles, packed(&[(0, 0), (3, 0), (63, 0), (0, 1), (63, 63)]));
        for _ in 0..6 {
            holders(&mut tiles);
        }
        assert_eq!(tiles, [0]);
    }
}
