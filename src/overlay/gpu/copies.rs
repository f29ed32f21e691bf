//! Colour maps of another size: what has been painted moves over to them on the GPU.
//!
//! A smaller map is there already, as a level of the larger one's mip maps: its levels are copied, those below it, too. To a larger
//! one, all levels move down by one, and a shader makes the map itself, each texel four times. Until that is done the old maps are
//! kept, and splats for the new ones wait.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use bevy::asset::io::AssetSourceId;
use bevy::asset::{AssetPath, embedded_path};
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{texture_2d, texture_storage_2d};
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, CachedComputePipelineId,
    CommandEncoder, ComputePassDescriptor, ComputePipelineDescriptor, Extent3d, Origin3d, PipelineCache,
    ShaderStages, StorageTextureAccess, TexelCopyTextureInfo, Texture, TextureAspect, TextureFormat,
    TextureSampleType, TextureView, TextureViewDescriptor,
};
use bevy::render::renderer::{RenderContext, RenderDevice};
use bevy::render::texture::GpuImage;

use super::SplatStats;
use super::maps::Overlays;
use super::pass::has_failed;
use crate::overlay::mip_levels;

/// What moves from maps that a surface had to others, one after the other. Keeps the old ones until it has.
#[derive(Component, Default)]
pub(super) struct MapCopies(Vec<MapCopy>);

struct MapCopy {
    from: [Handle<Image>; 3],
    to: [Handle<Image>; 3],
    /// Texels along each side: before, and now.
    sizes: [u32; 2],
    done: Arc<AtomicBool>,
}

fn ids(images: &[Handle<Image>; 3]) -> [AssetId<Image>; 3] {
    images.each_ref().map(Handle::id)
}

impl MapCopies {
    /// What has been painted on the old maps moves over to the new ones, which are open. Only to ones of twice the side, or a half,
    /// a quarter and so on.
    pub(super) fn push(&mut self, old: &Overlays, new: &Overlays) {
        let images = |maps: &Overlays| [maps.diffuse.clone(), maps.specular.clone(), maps.normal.clone()];
        let done = Arc::new(AtomicBool::new(false));
        self.0.push(MapCopy { from: images(old), to: images(new), sizes: [old.size, new.size], done });
    }

    /// Whether what was painted on these maps gets to those others.
    pub(super) fn lead(&self, from: [AssetId<Image>; 3], to: [AssetId<Image>; 3]) -> bool {
        let follow =
            |at: [AssetId<Image>; 3], copy: &MapCopy| if ids(&copy.from) == at { ids(&copy.to) } else { at };
        self.0.iter().fold(from, follow) == to
    }
}

/// Lets go of maps whose paint has moved over.
pub(super) fn forget_copies(mut commands: Commands, mut surfaces: Query<(Entity, &mut MapCopies)>) {
    for (entity, mut copies) in &mut surfaces {
        copies.0.retain(|copy| !copy.done.load(Ordering::Acquire));
        if copies.0.is_empty() {
            commands.entity(entity).try_remove::<MapCopies>();
        }
    }
}

/// What is to be moved in this frame, in the render world.
#[derive(Resource, Default)]
pub(super) struct PendingCopies(Vec<PendingCopy>);

struct PendingCopy {
    from: [AssetId<Image>; 3],
    to: [AssetId<Image>; 3],
    sizes: [u32; 2],
    done: Arc<AtomicBool>,
    /// If all that it takes is there.
    job: Option<Job>,
}

struct Job {
    from: [Texture; 3],
    to: [Texture; 3],
    /// For larger maps.
    doubling: Option<[BindGroup; 3]>,
}

impl PendingCopies {
    /// Whether a surface whose colours are in this image has to wait for what was painted before.
    pub(super) fn hold(&self, diffuse: AssetId<Image>) -> bool {
        self.0.iter().any(|copy| copy.to[0] == diffuse && copy.job.is_none())
    }
}

/// Takes over what has not been moved yet.
pub(super) fn extract_copies(
    surfaces: Extract<Query<&MapCopies>>,
    stats: Res<SplatStats>,
    mut pending: ResMut<PendingCopies>,
) {
    pending.0.clear();
    for copy in surfaces.iter().flat_map(|copies| &copies.0) {
        if !copy.done.load(Ordering::Acquire) {
            let (from, to, done) = (ids(&copy.from), ids(&copy.to), copy.done.clone());
            pending.0.push(PendingCopy { from, to, sizes: copy.sizes, done, job: None });
        }
    }
    stats.set_moving(pending.0.len());
}

/// What makes a map of twice the side.
#[derive(Resource)]
pub(super) struct DoublePipeline {
    layout: BindGroupLayoutDescriptor,
    pipeline: CachedComputePipelineId,
}

pub(super) fn init_double_pipeline(
    mut commands: Commands,
    assets: Res<AssetServer>,
    cache: Res<PipelineCache>,
) {
    let layout = BindGroupLayoutDescriptor::new(
        "weathering larger maps",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                texture_2d(TextureSampleType::Float { filterable: false }),
                texture_storage_2d(TextureFormat::Rgba8Unorm, StorageTextureAccess::WriteOnly),
            ),
        ),
    );
    let shader = assets.load(
        AssetPath::from_path_buf(embedded_path!("../../../shaders/resize.wgsl"))
            .with_source(AssetSourceId::from("embedded")),
    );
    let pipeline = cache.queue_compute_pipeline(ComputePipelineDescriptor {
        label: Some("double maps".into()),
        layout: vec![layout.clone()],
        shader,
        entry_point: Some("double_map".into()),
        ..default()
    });
    commands.insert_resource(DoublePipeline { layout, pipeline });
}

/// Finds the textures of what is to be moved.
pub(super) fn prepare_copies(
    mut pending: ResMut<PendingCopies>,
    pipeline: Res<DoublePipeline>,
    cache: Res<PipelineCache>,
    images: Res<RenderAssets<GpuImage>>,
    device: Res<RenderDevice>,
) {
    let mut late: Vec<[AssetId<Image>; 3]> = Vec::new();
    for copy in &mut pending.0 {
        let find = |ids: [AssetId<Image>; 3]| {
            let [diffuse, specular, normal] = ids.map(|id| images.get(id).map(|image| image.texture.clone()));
            Some([diffuse?, specular?, normal?])
        };
        let grows = copy.sizes[1] > copy.sizes[0];
        if grows && has_failed(pipeline.pipeline, &cache) {
            error_once!(
                "the shader that makes maps larger did not compile: what was painted on some is gone"
            );
            copy.done.store(true, Ordering::Release);
            // Nothing is moved, and nobody waits for it.
            copy.to = copy.from;
            continue;
        }
        let is_ready = !grows || cache.get_compute_pipeline(pipeline.pipeline).is_some();
        // What is moved to its old maps comes first.
        let textures =
            (is_ready && !late.contains(&copy.from)).then(|| Some((find(copy.from)?, find(copy.to)?)));
        let Some((from, to)) = textures.flatten() else {
            late.push(copy.to);
            continue;
        };
        let bind = |(from, to): (&Texture, &Texture)| {
            device.create_bind_group(
                "weathering larger map",
                &cache.get_bind_group_layout(&pipeline.layout),
                &BindGroupEntries::sequential((&first_level(from), &first_level(to))),
            )
        };
        let doubling = grows.then(|| [0, 1, 2].map(|map| bind((&from[map], &to[map]))));
        copy.job = Some(Job { from, to, doubling });
    }
}

/// A map without what is below it.
fn first_level(map: &Texture) -> TextureView {
    map.create_view(&TextureViewDescriptor { base_mip_level: 0, mip_level_count: Some(1), ..default() })
}

/// The levels of maps that become levels of others: from which, to which, and their side. `sizes`: before and now.
fn moved_levels([from, to]: [u32; 2]) -> impl Iterator<Item = (u32, u32, u32)> {
    let (up, down) = if to < from { ((from / to).ilog2(), 0) } else { (0, (to / from).ilog2()) };
    let count = mip_levels(from).saturating_sub(up).min(mip_levels(to).saturating_sub(down));
    (0..count).map(move |level| (level + up, level + down, from >> (level + up)))
}

/// Moves what has been painted.
pub(super) fn move_maps(
    mut context: RenderContext,
    cache: Res<PipelineCache>,
    pipeline: Res<DoublePipeline>,
    stats: Res<SplatStats>,
    mut pending: ResMut<PendingCopies>,
) {
    if pending.0.iter().all(|copy| copy.job.is_none()) {
        return;
    }
    let encoder = context.command_encoder();
    for copy in &pending.0 {
        let Some(job) = &copy.job else { continue };
        copy_levels(encoder, job, copy.sizes);
        if let Some(doubling) = &job.doubling
            && let Some(pipeline) = cache.get_compute_pipeline(pipeline.pipeline)
        {
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor {
                label: Some("double maps"),
                timestamp_writes: None,
            });
            pass.set_pipeline(pipeline);
            for map in doubling {
                pass.set_bind_group(0, map, &[]);
                let groups = copy.sizes[1].div_ceil(8);
                pass.dispatch_workgroups(groups, groups, 1);
            }
        }
        copy.done.store(true, Ordering::Release);
    }
    // Done once.
    pending.0.retain(|copy| copy.job.is_none() && !copy.done.load(Ordering::Acquire));
    stats.set_moving(pending.0.len());
}

fn copy_levels(encoder: &mut CommandEncoder, job: &Job, sizes: [u32; 2]) {
    for (from, to) in job.from.iter().zip(&job.to) {
        for (above, below, side) in moved_levels(sizes) {
            let (origin, aspect) = (Origin3d::ZERO, TextureAspect::All);
            encoder.copy_texture_to_texture(
                TexelCopyTextureInfo { texture: from, mip_level: above, origin, aspect },
                TexelCopyTextureInfo { texture: to, mip_level: below, origin, aspect },
                Extent3d { width: side, height: side, depth_or_array_layers: 1 },
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::asset::uuid::Uuid;

    use super::*;

    #[test]
    fn levels_go_where_they_have_the_same_side() {
        for sizes in [[512, 256], [512, 64], [64, 128], [48, 96], [96, 48]] {
            let [from, to] = sizes;
            let moved: Vec<_> = moved_levels(sizes).collect();
            for &(above, below, side) in &moved {
                assert_eq!((from >> above, to >> below), (side, side));
                assert!(above < mip_levels(from) && below < mip_levels(to));
            }
            // All of the smaller one's.
            assert_eq!(moved.len() as u32, mip_levels(from.min(to)));
        }
    }

    #[test]
    fn what_was_painted_is_followed_from_maps_to_maps() {
        let maps = |number: u128| {
            let image = Handle::Uuid(Uuid::from_u128(number), std::marker::PhantomData);
            Overlays { diffuse: image, ..Overlays::bare(64) }
        };
        let images = |maps: &Overlays| ids(&[maps.diffuse.clone(), default(), default()]);
        let [first, second, third] = [1, 2, 3].map(maps);
        let mut copies = MapCopies::default();
        copies.push(&first, &second);
        copies.push(&second, &third);
        assert!(copies.lead(images(&first), images(&third)) && copies.lead(images(&second), images(&third)));
        assert!(
            !copies.lead(images(&third), images(&second)) && !copies.lead(images(&first), images(&second))
        );
    }
}
