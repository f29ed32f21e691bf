//! Splats on their way from the main world to the GPU.

use std::sync::Arc;

use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, Buffer, BufferInitDescriptor, BufferUsages, CachedComputePipelineId,
    DynamicUniformBuffer, PipelineCache, RawBufferVec, ShaderType, SpecializedComputePipelines, TextureView,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::storage::GpuShaderBuffer;
use bevy::render::texture::GpuImage;
use bevy::render::{Extract, MainWorld};

use super::SplatStats;
use super::backlog::Backlog;
use super::copies::{MapCopies, PendingCopies};
use super::maps::{Maps, Overlays};
use super::mips::{MipBatches, MipPipeline, SurfaceLevels};
use super::pass::{SplatKinds, SplatPipeline, has_failed};
use super::texels::{TexelRows, stamp_texture};
use crate::overlay::{
    Lying, Splat, SplatBudget, SplatQueue, StampAtlas, SurfaceFrames, TexelFrame, TileBins, TileHeader, Wrap,
    is_reached,
};

/// What the pass needs to know about one surface. `SurfaceBatch` in `shaders/splat.wgsl` has the same fields.
#[derive(ShaderType, Debug, Clone, Copy)]
pub struct SurfaceBatch {
    /// Texels along each side of the maps.
    pub size: u32,
    /// The batch's first row in the tile buffer.
    pub first_tile: u32,
    /// How many rows it has there.
    pub tiles: u32,
    /// Edges along u and v: 1 clamps, 0 repeats.
    pub clamped: UVec2,
}

/// Splats in the render world that are not painted yet, by surface.
#[derive(Resource, Default)]
pub(super) struct PendingSplats {
    surfaces: Vec<PendingSurface>,
    by_entity: EntityHashMap<usize>,
    budget: SplatBudget,
    /// The surface whose turn it is first.
    first: usize,
}

impl PendingSplats {
    /// How many wait, on all surfaces.
    fn len(&self) -> usize {
        self.surfaces.iter().map(|surface| surface.backlog.len()).sum()
    }

    /// Forgets all that wait.
    fn clear(&mut self) {
        self.surfaces.iter_mut().for_each(|surface| surface.backlog.clear());
    }
}

struct PendingSurface {
    entity: Entity,
    maps: Maps,
    /// Where the texels lie, and that on the GPU once the first splat in space comes; with it, which of them lie anywhere.
    frames: Option<SurfaceFrames>,
    frame_buffer: Option<Buffer>,
    lying: Option<Buffer>,
    /// While the maps stay.
    levels: Option<SurfaceLevels>,
    backlog: Backlog,
}

impl PendingSurface {
    /// Whether maps of another size are those of the same surface, on which nothing was painted: rings alone are not moved over, but
    /// what waits is.
    fn only_clear_water_moves_to(&self, maps: &Maps) -> bool {
        let is_same = self.maps.wrap == maps.wrap && is_reached(self.maps.size, maps.size);
        is_same && !self.backlog.waiting().iter().any(Splat::paints)
    }
}

/// Moves the waiting splats into the render world.
pub(super) fn extract_splats(
    mut main_world: ResMut<MainWorld>,
    mut pending: ResMut<PendingSplats>,
    stats: Res<SplatStats>,
    mut query: Local<
        Option<
            QueryState<(
                Entity,
                &'static Overlays,
                &'static mut SplatQueue,
                Option<&'static SurfaceFrames>,
                Option<&'static MapCopies>,
            )>,
        >,
    >,
) {
    let query = query.get_or_insert_with(|| main_world.query());
    pending.budget = main_world.get_resource::<SplatBudget>().copied().unwrap_or_default();
    let PendingSplats { surfaces, by_entity, .. } = &mut *pending;
    for (entity, overlays, mut queue, frames, copies) in query.iter_mut(&mut main_world) {
        if let Some(&index) = by_entity.get(&entity) {
            let waiting = &mut surfaces[index];
            let maps = Maps::from(overlays);
            if waiting.maps.images != maps.images {
                // Levels hold on to their textures, also those that a surface has no more.
                waiting.levels = None;
            }
            let moves_over = copies.is_some_and(|copies| copies.lead(waiting.maps.images, maps.images))
                || waiting.only_clear_water_moves_to(&maps);
            if waiting.maps.size != maps.size && moves_over {
                // What waits is painted over what was there before, by places on the new maps.
                waiting.backlog.resize(waiting.maps.size, maps.size);
                (waiting.frames, waiting.frame_buffer, waiting.lying) = (frames.cloned(), None, None);
            } else if waiting.maps.rings != maps.rings {
                // New maps: what was meant for the old ones is gone with them.
                stats.drop_splats(waiting.backlog.len());
                waiting.backlog.clear();
            }
            waiting.maps = maps;
        }
        // Splats for which there is no room yet wait where they are.
        if queue.is_empty() || !overlays.is_open_for(&queue) {
            continue;
        }
        let index = *by_entity.entry(entity).or_insert_with(|| {
            let maps = overlays.into();
            surfaces.push(PendingSurface {
                entity,
                maps,
                frames: None,
                frame_buffer: None,
                lying: None,
                levels: None,
                backlog: Backlog::default(),
            });
            surfaces.len() - 1
        });
        let waiting = &mut surfaces[index];
        let place = |frames: &SurfaceFrames| Arc::as_ptr(&frames.0);
        if waiting.frames.as_ref().map(place) != frames.map(place) {
            (waiting.frames, waiting.frame_buffer, waiting.lying) = (frames.cloned(), None, None);
            waiting.levels = None;
        }
        waiting.backlog.take_from(&mut queue);
    }
    // Despawned, or without maps; what is kept here for it goes, too.
    let gone = |waiting: &PendingSurface| main_world.get::<Overlays>(waiting.entity).is_none();
    if surfaces.iter().any(gone) {
        surfaces.retain(|waiting| {
            let gone = gone(waiting);
            if gone {
                stats.drop_splats(waiting.backlog.len());
            }
            !gone
        });
        by_entity.clear();
        by_entity.extend(surfaces.iter().enumerate().map(|(index, waiting)| (waiting.entity, index)));
    }
    stats.set_pending(pending.len());
}

/// The stamps on the GPU.
#[derive(Resource, Default)]
pub(super) struct StampTexture {
    atlas: StampAtlas,
    texture: Option<TextureView>,
}

/// Takes over what has been added to the atlas.
pub(super) fn extract_stamps(atlas: Extract<Option<Res<StampAtlas>>>, mut stamps: ResMut<StampTexture>) {
    if let Some(atlas) = &*atlas
        && !atlas.is_same(&stamps.atlas)
    {
        *stamps = StampTexture { atlas: StampAtlas::clone(atlas), texture: None };
    }
}

/// A buffer that is written once; `one` if there is nothing in it, since none can be empty.
fn fixed_buffer<T: bytemuck::Pod + Default>(device: &RenderDevice, label: &str, rows: &[T]) -> Buffer {
    let one = [T::default()];
    let rows = if rows.is_empty() { &one } else { rows };
    device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some(label),
        contents: bytemuck::cast_slice(rows),
        usage: BufferUsages::STORAGE,
    })
}

/// What this frame's pass will do.
#[derive(Resource)]
pub(super) struct SplatBatches {
    batches: DynamicUniformBuffer<SurfaceBatch>,
    splats: TexelRows<Splat>,
    tiles: RawBufferVec<TileHeader>,
    list: TexelRows<u32>,
    bins: TileBins,
    /// For surfaces on which nothing lies in space.
    no_frames: Option<Buffer>,
    /// For the mip maps of these.
    no_mask: Option<Buffer>,
    /// The buffers above.
    pub(super) frame: Option<BindGroup>,
    pub(super) jobs: Vec<Job>,
}

/// The splats of one surface.
pub(super) struct Job {
    /// The pipeline that paints them; none if they are all clear water.
    pub(super) painting: Option<CachedComputePipelineId>,
    pub(super) surface: BindGroup,
    pub(super) batch_offset: u32,
    pub(super) tiles: u32,
}

impl Default for SplatBatches {
    fn default() -> Self {
        Self {
            batches: DynamicUniformBuffer::default(),
            splats: TexelRows::splats(),
            tiles: RawBufferVec::new(BufferUsages::STORAGE),
            list: TexelRows::list(),
            bins: TileBins::default(),
            no_frames: None,
            no_mask: None,
            frame: None,
            jobs: Vec::new(),
        }
    }
}

/// Sorts what is pending into tiles and uploads it, as much as the budget allows. Surfaces share no texel, so only the order within
/// each matters. The one that the budget cut has its turn last in the next frame: none waits for ever.
pub(super) fn prepare_splats(
    mut pending: ResMut<PendingSplats>,
    mut batches: ResMut<SplatBatches>,
    mut mips: ResMut<MipBatches>,
    mut stamps: ResMut<StampTexture>,
    mut pipelines: ResMut<SpecializedComputePipelines<SplatPipeline>>,
    (stats, copies): (Res<SplatStats>, Res<PendingCopies>),
    pipeline: Res<SplatPipeline>,
    mip_pipeline: Res<MipPipeline>,
    cache: Res<PipelineCache>,
    images: Res<RenderAssets<GpuImage>>,
    buffers: Res<RenderAssets<GpuShaderBuffer>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let SplatBatches { batches, splats, tiles, list, bins, no_frames, no_mask, frame, jobs } = &mut *batches;
    jobs.clear();
    mips.clear();
    if pending.len() == 0 {
        return;
    }
    if pipeline.has_failed(&cache) || has_failed(mip_pipeline.pipeline, &cache) {
        // To wait would be in vain, and stop time.
        error_once!(
            "a shader that paints splats did not compile, as told above: the weather goes on, but leaves no marks on \
             surfaces. `SplatStats::lost` counts them."
        );
        stats.lose(pending.len());
        pending.clear();
        stats.set_pending(0);
        return;
    }
    if !pipeline.is_ready(&cache) || cache.get_compute_pipeline(mip_pipeline.pipeline).is_none() {
        return;
    }
    batches.clear();
    splats.values.clear();
    tiles.clear();
    list.values.clear();
    let (mut room, mut bytes) = pending.budget.of_a_frame();
    let PendingSplats { surfaces, first, .. } = &mut *pending;
    let count = surfaces.len();
    let begin = *first % count;
    let mut next = None;
    for index in (begin..count).chain(0..begin) {
        let waiting = &mut surfaces[index];
        if waiting.backlog.is_empty() {
            continue;
        }
        let Maps { size, wrap, images: [diffuse, specular, normal], rings } = waiting.maps;
        if copies.hold(diffuse) {
            continue;
        }
        let (Some(diffuse), Some(specular), Some(normal), Some(rings)) =
            (images.get(diffuse), images.get(specular), images.get(normal), buffers.get(rings))
        else {
            continue;
        };
        if room == 0 || bytes == 0 {
            stats.carry(waiting.backlog.finish(0));
            continue;
        }
        let first_tile = tiles.len() as u32;
        let first_splat = splats.values.len() as u32;
        let first_entry = list.values.len();
        let frames = waiting.frames.as_ref();
        let batch = waiting.backlog.waiting();
        let batch = &batch[..batch.len().min(room)];
        let (headers, entries) = (tiles.values_mut(), &mut list.values);
        let taken = bins.bin_within(bytes, batch, size, wrap, frames, first_splat, headers, entries);
        let batch = &batch[..taken];
        let kinds = SplatKinds::of(batch);
        if kinds.is_some_and(SplatKinds::in_space)
            && waiting.frame_buffer.is_none()
            && let Some(frames) = frames
        {
            waiting.frame_buffer = Some(fixed_buffer(&device, "weathering frames", frames.texels()));
            waiting.lying = Some(fixed_buffer(&device, "weathering mask", Lying::new(frames).words()));
        }
        let no_frames =
            no_frames.get_or_insert_with(|| fixed_buffer::<TexelFrame>(&device, "no frames", &[]));
        let no_mask = no_mask.get_or_insert_with(|| fixed_buffer::<u32>(&device, "no mask", &[]));
        let frame_buffer = waiting.frame_buffer.as_ref().unwrap_or(no_frames);
        let maps = [diffuse, specular, normal];
        let masked = waiting.lying.is_some();
        let known = waiting.levels.take().filter(|levels| levels.are_of(maps, masked));
        let levels = waiting.levels.insert(known.unwrap_or_else(|| {
            let lying = waiting.lying.as_ref().unwrap_or(no_mask);
            SurfaceLevels::new(maps, lying, masked, &mip_pipeline, &cache, &device)
        }));
        splats.values.extend_from_slice(batch);
        let touched = tiles.len() as u32 - first_tile;
        if kinds.is_some() {
            mips.add(levels, size, &tiles.values()[first_tile as usize..]);
        }
        let clamped = UVec2::from_array(wrap.map(|wrap| u32::from(wrap == Wrap::Clamp)));
        jobs.push(Job {
            painting: kinds.map(|kinds| pipeline.painting(kinds, &mut pipelines, &cache)),
            surface: device.create_bind_group(
                "weathering surface",
                &cache.get_bind_group_layout(&pipeline.surface_layout),
                &BindGroupEntries::sequential((
                    &levels.painted[0],
                    &levels.painted[1],
                    &levels.painted[2],
                    rings.buffer.as_entire_buffer_binding(),
                    frame_buffer.as_entire_buffer_binding(),
                )),
            ),
            batch_offset: batches.push(&SurfaceBatch { size, first_tile, tiles: touched, clamped }),
            tiles: touched,
        });
        stats.add(taken, touched as usize);
        room -= taken;
        bytes =
            bytes.saturating_sub(TileBins::bytes(taken, touched as usize, list.values.len() - first_entry));
        stats.carry(waiting.backlog.finish(taken));
        if !waiting.backlog.is_empty() {
            next = next.or(Some(index + 1));
        }
    }
    *first = next.unwrap_or(begin);
    stats.set_pending(pending.len());
    batches.write_buffer(&device, &queue);
    tiles.write_buffer(&device, &queue);
    mips.write(&mip_pipeline, &cache, &device, &queue);
    let (Some(batches), Some(tiles)) = (batches.binding(), tiles.binding()) else {
        return;
    };
    let StampTexture { atlas, texture } = &mut *stamps;
    let stamps = &*texture.get_or_insert_with(|| stamp_texture(atlas, &device, &queue));
    let (splats, list) = (splats.upload(&device, &queue), list.upload(&device, &queue));
    *frame = Some(device.create_bind_group(
        "weathering splats",
        &cache.get_bind_group_layout(&pipeline.frame_layout),
        &BindGroupEntries::sequential((batches, splats, tiles, list, stamps)),
    ));
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    /// A main world with one surface, inside a render world, as `ExtractSchedule` sees them.
    fn worlds() -> (World, Entity) {
        let mut main = MainWorld::default();
        let overlays = Overlays { has_rings: true, has_colors: true, ..Overlays::bare(512) };
        let surface = main.spawn((overlays, SplatQueue::default())).id();
        let mut render = World::new();
        render.insert_resource(main);
        render.init_resource::<PendingSplats>();
        render.init_resource::<SplatStats>();
        (render, surface)
    }

    fn push(render: &mut World, surface: Entity, ticks: std::ops::Range<u32>) {
        let mut main = render.resource_mut::<MainWorld>();
        let mut queue = main.get_mut::<SplatQueue>(surface).unwrap();
        ticks.for_each(|tick| queue.push(Splat { tick, ..Splat::zeroed() }));
    }

    fn pending(render: &World) -> Vec<u32> {
        let surfaces = &render.resource::<PendingSplats>().surfaces;
        surfaces.iter().flat_map(|surface| surface.backlog.waiting()).map(|splat| splat.tick).collect()
    }

    #[test]
    fn every_splat_is_moved_once_whatever_the_frame_holds() {
        let (mut render, surface) = worlds();
        let mut schedule = Schedule::default();
        schedule.add_systems(extract_splats);
        for frame in [0..0, 0..1, 1..6, 6..6, 6..7] {
            push(&mut render, surface, frame);
            schedule.run(&mut render);
            let main = render.resource::<MainWorld>();
            assert!(main.get::<SplatQueue>(surface).unwrap().is_empty());
        }
        // Nothing was painted: all of it still waits, in order.
        assert_eq!(pending(&render), [0, 1, 2, 3, 4, 5, 6]);
        assert_eq!(render.resource::<SplatStats>().pending(), 7);
    }

    #[test]
    fn new_maps_get_nothing_that_was_meant_for_the_old() {
        let (mut render, surface) = worlds();
        let mut schedule = Schedule::default();
        schedule.add_systems(extract_splats);
        push(&mut render, surface, 0..3);
        schedule.run(&mut render);
        let other = Handle::Uuid(bevy::asset::uuid::Uuid::from_u128(7), std::marker::PhantomData);
        render.resource_mut::<MainWorld>().get_mut::<Overlays>(surface).unwrap().rings = other;
        push(&mut render, surface, 3..4);
        schedule.run(&mut render);
        assert_eq!(pending(&render), [3]);
        assert_eq!(render.resource::<SplatStats>().dropped(), 3);
        // Also if nothing new comes: it could never be painted.
        let other = Handle::Uuid(bevy::asset::uuid::Uuid::from_u128(8), std::marker::PhantomData);
        render.resource_mut::<MainWorld>().get_mut::<Overlays>(surface).unwrap().rings = other;
        schedule.run(&mut render);
        let stats = render.resource::<SplatStats>();
        assert_eq!((pending(&render), stats.pending(), stats.dropped()), (vec![], 0, 4));
    }

    #[test]
    fn maps_of_another_size_get_what_was_meant_for_the_old() {
        let (mut render, surface) = worlds();
        let mut schedule = Schedule::default();
        schedule.add_systems(extract_splats);
        {
            let mut main = render.resource_mut::<MainWorld>();
            let mut queue = main.get_mut::<SplatQueue>(surface).unwrap();
            queue.push(Splat { tick: 1, center: [600, 1000], radius: [512, 512], ..Splat::zeroed() });
        }
        schedule.run(&mut render);
        let image =
            |number| Handle::Uuid(bevy::asset::uuid::Uuid::from_u128(number), std::marker::PhantomData);
        {
            let mut main = render.resource_mut::<MainWorld>();
            let old = main.get::<Overlays>(surface).unwrap().clone();
            let new = Overlays { size: 256, diffuse: image(7), rings: default(), ..old.clone() };
            let mut copies = MapCopies::default();
            copies.push(&old, &new);
            main.entity_mut(surface).insert((new, copies));
        }
        schedule.run(&mut render);
        let waiting = render.resource::<PendingSplats>().surfaces[0].backlog.waiting();
        assert_eq!((waiting.len(), waiting[0].center, waiting[0].radius), (1, [300, 500], [256, 256]));
        assert_eq!(render.resource::<SplatStats>().dropped(), 0);
    }

    #[test]
    fn a_surface_that_is_gone_takes_its_splats_along() {
        let (mut render, surface) = worlds();
        let mut schedule = Schedule::default();
        schedule.add_systems(extract_splats);
        push(&mut render, surface, 0..3);
        schedule.run(&mut render);
        render.resource_mut::<MainWorld>().despawn(surface);
        schedule.run(&mut render);
        assert!(render.resource::<PendingSplats>().surfaces.is_empty());
        assert!(render.resource::<PendingSplats>().by_entity.is_empty());
    }
}
