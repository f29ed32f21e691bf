//! Water on its way to be drawn: the tiles that changed, and nothing else.
//!
//! The shader works out what a texel holds at the moment it is drawn, so only what was *moved* has to be sent: a surface at
//! rest sends nothing, however fast it dries. Texels are packed as depths, 16 bytes each, tile after tile, so that a tile is
//! one piece of the buffer. Texels beside an island show what the nearest one on it holds, so that no dry seam is seen where
//! the shader blends across the border.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bevy::asset::RenderAssetUsages;
use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::renderer::RenderQueue;
use bevy::render::storage::{GpuShaderBuffer, ShaderBuffer};
use bevy::render::{ExtractSchedule, MainWorld, Render, RenderApp, RenderSystems};
use bytemuck::{Pod, Zeroable};
use half::f16;

use super::tiles::{Tiles, texel_in};
use super::{Exposure, Marks, SurfaceWater, WetGeometry};
use crate::matter::{GpuTexelMatter, SurfaceMatter, pack_matter};
use crate::overlay::{MapSize, Overlays, TILE_SIZE};

/// A texel as the shader reads it: `TexelWater` in `shaders/common/wet_map.wgsl` has the same fields.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct GpuTexelWater {
    /// Film (low) and absorbed water, mm, as two `f16`; [`Self::BESIDE`] where the mesh does not lie.
    pub amounts: u32,
    /// Reference tick; 0 if it never was wet.
    pub tick: u32,
    /// From the lowest byte: how wet it looked then, exposure to air, exposure to the sun, reserve.
    pub bytes: u32,
    /// From the lowest byte: efflorescence, tide mark, how much of the film was to be seen, nearness to a rim.
    pub marks: u32,
}

impl GpuTexelWater {
    /// `amounts` where neither the mesh lies nor its gutter: no film, with a sign. From afar such texels are left out.
    pub const BESIDE: u32 = 0x8000;
}

/// Texels of a tile.
const TILE_TEXELS: usize = (TILE_SIZE * TILE_SIZE) as usize;

/// Sends changed tiles to the GPU. Does nothing without a render app.
pub struct WaterUploadPlugin;

impl Plugin for WaterUploadPlugin {
    fn build(&self, app: &mut App) {
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        let stats = UploadStats::default();
        app.insert_resource(stats.clone()).add_observer(release_tiles).add_systems(
            PostUpdate,
            pack_tiles.in_set(WaterUploadSystems).after(crate::overlay::deposit::note_traces),
        );
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app
            .insert_resource(stats)
            .init_resource::<PendingTiles>()
            .add_systems(ExtractSchedule, extract_tiles)
            .add_systems(Render, write_tiles.in_set(RenderSystems::PrepareResources));
    }
}

/// In `PostUpdate`: water is made ready to be drawn.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct WaterUploadSystems;

/// What has been sent since the start; the same numbers in the main and in the render world.
#[derive(Resource, Clone, Default)]
pub struct UploadStats(Arc<[AtomicU64; 2]>);

impl UploadStats {
    /// Tiles sent.
    pub fn tiles(&self) -> u64 {
        self.0[0].load(Ordering::Relaxed)
    }

    /// Writes: one for each row of tiles that changed side by side.
    pub fn writes(&self) -> u64 {
        self.0[1].load(Ordering::Relaxed)
    }
}

/// Packed tiles of a surface: never more than it has, however long they wait.
#[derive(Component, Debug, Default, PartialEq)]
pub(super) struct PackedTiles {
    /// Ascending, each once.
    tiles: Vec<u32>,
    texels: Vec<GpuTexelWater>,
    /// Of the same texels; none while no matter has come.
    matter: Vec<GpuTexelMatter>,
}

impl PackedTiles {
    fn clear(&mut self) {
        self.tiles.clear();
        self.texels.clear();
        self.matter.clear();
    }

    /// Adds tiles that were packed later, for the same buffers: those that are here already are as they were then. Leaves `later`
    /// empty.
    fn take_over(&mut self, later: &mut Self) {
        if later.tiles.is_empty() {
            return;
        }
        if self.tiles.is_empty() {
            // What was cleared keeps its memory for the next ones.
            std::mem::swap(self, later);
            return;
        }
        let earlier = std::mem::take(self);
        let (mut old, mut new) = (0, 0);
        loop {
            let (waiting, coming) = (earlier.tiles.get(old), later.tiles.get(new));
            let is_later = match (waiting, coming) {
                (Some(waiting), Some(coming)) => coming <= waiting,
                (None, Some(_)) => true,
                (Some(_), None) => false,
                (None, None) => break,
            };
            if is_later {
                self.push(later, new);
                old += usize::from(waiting == coming);
                new += 1;
            } else {
                self.push(&earlier, old);
                old += 1;
            }
        }
        later.clear();
    }

    /// Adds one tile of others.
    fn push(&mut self, other: &Self, slot: usize) {
        let texels = slot * TILE_TEXELS..(slot + 1) * TILE_TEXELS;
        self.tiles.push(other.tiles[slot]);
        self.texels.extend_from_slice(&other.texels[texels.clone()]);
        if !other.matter.is_empty() {
            self.matter.extend_from_slice(&other.matter[texels]);
        }
    }
}

/// Nothing is sent for maps that are gone.
fn release_tiles(removed: On<Remove, MapSize>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<PackedTiles>();
}

/// Packs what changed, and makes room on the GPU for a surface's first water.
fn pack_tiles(
    mut commands: Commands,
    mut buffers: ResMut<Assets<ShaderBuffer>>,
    mut surfaces: Query<
        (
            (Entity, &mut SurfaceWater, &SurfaceMatter, &WetGeometry),
            (Option<&Exposure>, &mut Overlays, Option<&mut PackedTiles>),
        ),
        Or<(Changed<SurfaceWater>, Changed<Overlays>)>,
    >,
    mut fresh: Local<PackedTiles>,
) {
    for ((entity, mut water, matter, geometry), (exposure, mut overlays, mut packed)) in &mut surfaces {
        if !water.is_wet() || overlays.size != water.size {
            continue;
        }
        let water = water.bypass_change_detection();
        let lacks_matter = !matter.is_empty() && !overlays.has_matter_room;
        if !overlays.has_room || lacks_matter {
            let mut room =
                |bytes| buffers.add(ShaderBuffer::with_size(bytes, RenderAssetUsages::RENDER_WORLD));
            overlays.state = room(water.texels.len() * size_of::<GpuTexelWater>());
            overlays.has_room = true;
            if lacks_matter {
                overlays.matter = room(water.texels.len() * size_of::<GpuTexelMatter>());
                overlays.has_matter_room = true;
            }
            // All that was sent before is gone with the old buffer, and what waits was meant for that.
            if let Some(packed) = &mut packed {
                packed.clear();
            }
            for tile in 0..water.tiles.flags.len() as u32 {
                // What lies beside the mesh shows from afar, whether anything near it is wet or not.
                let lies_beside = || {
                    (0..TILE_TEXELS).any(|local| {
                        let texel = texel_in(water.size, tile, local);
                        !geometry.0.lies(texel) && geometry.0.gutter_source(texel).is_none()
                    })
                };
                if water.tiles.has(tile, Tiles::WET) {
                    water.tiles.touch(tile);
                } else if lies_beside() {
                    water.tiles.send(tile);
                }
            }
        }
        if water.tiles.dirty.is_empty() {
            continue;
        }
        let mut dirty = std::mem::take(&mut water.tiles.dirty);
        geometry.0.add_gutter_tiles(&mut dirty);
        dirty.sort_unstable();
        dirty.dedup();
        for &tile in &dirty {
            water.tiles.flags[tile as usize] &= !Tiles::DIRTY;
            fresh.tiles.push(tile);
            let shown = |local| {
                let texel = texel_in(water.size, tile, local);
                geometry.0.gutter_source(texel).unwrap_or(texel)
            };
            let texels = (0..TILE_TEXELS).map(shown);
            fresh.texels.extend(texels.clone().map(|texel| pack_texel(water, &geometry.0, exposure, texel)));
            if overlays.has_matter_room {
                let units = water.units;
                fresh.matter.extend(texels.map(|texel| pack_matter(matter, units, &geometry.0, texel)));
            }
        }
        dirty.clear();
        water.tiles.dirty = dirty;
        match &mut packed {
            Some(packed) => packed.take_over(&mut fresh),
            None => {
                commands.entity(entity).insert(std::mem::take(&mut *fresh));
            }
        }
    }
}

/// A texel as it is drawn.
pub(super) fn pack_texel(
    water: &SurfaceWater,
    geometry: &super::TexelGeometry,
    exposure: Option<&Exposure>,
    texel: u32,
) -> GpuTexelWater {
    if !geometry.lies(texel) {
        return GpuTexelWater { amounts: GpuTexelWater::BESIDE, ..default() };
    }
    let state = &water.texels[texel as usize];
    let marks = water.marks.get(texel as usize).copied().unwrap_or_default();
    let Marks { efflorescence, tide } = marks;
    let byte = |part: f32| (part * 255.0).round().clamp(0.0, 255.0) as u8;
    let marks = u32::from_le_bytes([byte(efflorescence), byte(tide), state.filmed, state.rim]);
    if state.is_dry() {
        return GpuTexelWater { marks, ..default() };
    }
    let unit_mm = geometry.unit_mm(water.units, texel);
    let depth = |units: u32| u32::from(f16::from_f64((f64::from(units) * unit_mm).min(60_000.0)).to_bits());
    let [air, sun] = exposure.map_or(Exposure::FREE, |exposure| exposure.bytes_at(texel));
    GpuTexelWater {
        amounts: depth(state.film) | depth(state.pores) << 16,
        tick: state.tick,
        bytes: u32::from_le_bytes([state.shown, air, sun, state.reserve]),
        marks,
    }
}

/// Tiles in the render world that are not written yet, by surface.
#[derive(Resource, Default)]
struct PendingTiles {
    surfaces: EntityHashMap<Pending>,
}

struct Pending {
    buffer: AssetId<ShaderBuffer>,
    matter_buffer: AssetId<ShaderBuffer>,
    packed: PackedTiles,
}

/// Moves packed tiles into the render world, each once.
fn extract_tiles(
    mut main_world: ResMut<MainWorld>,
    mut pending: ResMut<PendingTiles>,
    mut query: Local<Option<QueryState<(Entity, &'static Overlays, &'static mut PackedTiles)>>>,
) {
    let query = query.get_or_insert_with(|| main_world.query());
    for (entity, overlays, mut packed) in query.iter_mut(&mut main_world) {
        let packed = packed.bypass_change_detection();
        if !overlays.has_room {
            // Packed for maps that are gone: those that came in their place may have seen no water yet.
            packed.clear();
        }
        if packed.tiles.is_empty() {
            continue;
        }
        let (buffer, matter_buffer) = (overlays.state.id(), overlays.matter.id());
        let waiting = pending.surfaces.entry(entity).or_insert(Pending {
            buffer,
            matter_buffer,
            packed: PackedTiles::default(),
        });
        if waiting.buffer != buffer {
            // Meant for maps that are gone.
            *waiting = Pending { buffer, matter_buffer, packed: PackedTiles::default() };
        }
        waiting.packed.take_over(packed);
    }
    // Gone, or without maps.
    pending.surfaces.retain(|entity, _| main_world.get::<Overlays>(*entity).is_some());
}

/// Writes tiles into their buffers; neighbours in one go. The order of surfaces does not matter: each has its own.
fn write_tiles(
    mut pending: ResMut<PendingTiles>,
    buffers: Res<RenderAssets<GpuShaderBuffer>>,
    queue: Res<RenderQueue>,
    stats: Res<UploadStats>,
) {
    for waiting in pending.surfaces.values_mut().filter(|waiting| !waiting.packed.tiles.is_empty()) {
        let Pending { buffer, matter_buffer, packed } = waiting;
        let (Some(buffer), Some(matter_buffer)) = (buffers.get(*buffer), buffers.get(*matter_buffer)) else {
            continue;
        };
        let texels: &[u8] = bytemuck::cast_slice(&packed.texels);
        let matter: &[u8] = bytemuck::cast_slice(&packed.matter);
        let (texel_bytes, matter_bytes) =
            (TILE_TEXELS * size_of::<GpuTexelWater>(), TILE_TEXELS * size_of::<GpuTexelMatter>());
        let mut first = 0;
        while first < packed.tiles.len() {
            let mut end = first + 1;
            while end < packed.tiles.len() && packed.tiles[end] == packed.tiles[end - 1] + 1 {
                end += 1;
            }
            let write = |buffer: &GpuShaderBuffer, bytes: &[u8], tile_bytes: usize| {
                let offset = u64::from(packed.tiles[first]) * tile_bytes as u64;
                queue.write_buffer(&buffer.buffer, offset, &bytes[first * tile_bytes..end * tile_bytes]);
                stats.0[1].fetch_add(1, Ordering::Relaxed);
            };
            write(buffer, texels, texel_bytes);
            if !matter.is_empty() {
                write(matter_buffer, matter, matter_bytes);
            }
            first = end;
        }
        stats.0[0].fetch_add(packed.tiles.len() as u64, Ordering::Relaxed);
        packed.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_meshes::corner_of_a_map;
    use super::*;
    use crate::overlay::{Weatherable, Wrap};

    /// Tiles whose texels say which they are, and when they were packed.
    fn packed(tiles: &[u32], when: u32, has_matter: bool) -> PackedTiles {
        let mut packed = PackedTiles { tiles: tiles.to_vec(), ..default() };
        for &tile in tiles {
            let water = GpuTexelWater { tick: when, marks: tile, ..default() };
            packed.texels.extend([water; TILE_TEXELS]);
            if has_matter {
                packed.matter.extend([GpuTexelMatter { dust_mud: when, snow: tile }; TILE_TEXELS]);
            }
        }
        packed
    }

    #[test]
    fn tiles_that_wait_are_there_once_as_they_were_last() {
        for has_matter in [false, true] {
            let mut waiting = PackedTiles::default();
            waiting.take_over(&mut packed(&[2, 5, 9], 1, has_matter));
            let mut later = packed(&[0, 5, 6, 11], 2, has_matter);
            waiting.take_over(&mut later);
            assert_eq!(later, PackedTiles::default());
            assert_eq!(waiting.tiles, [0, 2, 5, 6, 9, 11]);
            for (slot, when) in [2, 1, 2, 2, 1, 2].into_iter().enumerate() {
                let tile = packed(&[waiting.tiles[slot]], when, has_matter);
                let texels = slot * TILE_TEXELS..(slot + 1) * TILE_TEXELS;
                assert_eq!(waiting.texels[texels.clone()], tile.texels);
                assert_eq!(waiting.matter.get(texels).unwrap_or_default(), tile.matter);
            }
        }
    }

    #[test]
    fn nothing_grows_while_nothing_is_drawn() {
        let mut waiting = PackedTiles::default();
        for frame in 0..50 {
            waiting.take_over(&mut packed(&[0, 1, 2, 3 + frame % 2], frame, true));
        }
        assert_eq!(waiting.tiles, [0, 1, 2, 3, 4]);
        assert_eq!((waiting.texels.len(), waiting.matter.len()), (5 * TILE_TEXELS, 5 * TILE_TEXELS));
    }

    #[test]
    fn maps_without_room_get_nothing_that_was_packed_for_those_before() {
        for (has_room, sent) in [(false, 0), (true, 1)] {
            let mut main = MainWorld::default();
            let maps = Overlays { has_room, has_matter_room: has_room, ..Overlays::bare(512) };
            let surface = main.spawn((maps, packed(&[76], 1, true))).id();
            let mut render = World::new();
            render.insert_resource(main);
            render.init_resource::<PendingTiles>();
            let mut schedule = Schedule::default();
            schedule.add_systems(extract_tiles);
            schedule.run(&mut render);
            let pending = &render.resource::<PendingTiles>().surfaces;
            assert_eq!(pending.values().map(|waiting| waiting.packed.tiles.len()).sum::<usize>(), sent);
            // Nor does anything stay behind for later.
            let left = render.resource::<MainWorld>().get::<PackedTiles>(surface);
            assert_eq!(left, Some(&PackedTiles::default()));
        }
    }

    #[test]
    fn what_lies_beside_the_mesh_is_marked_and_holds_nothing() {
        let geometry = corner_of_a_map();
        let surface = Weatherable { map_size: 16, wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, ..default() };
        let mut water = SurfaceWater::new(&surface, geometry.mean_mm2());
        water.cover(&geometry, 1.0, 0.0, 7);
        let pack = |texel| pack_texel(&water, &geometry, None, texel);
        let film_mm = |texel: GpuTexelWater| f16::from_bits(texel.amounts as u16).to_f32();
        let wet = pack(16 + 2);
        assert!(wet.tick == 7 && (film_mm(wet) - 1.0).abs() < 0.01, "{wet:?}");
        for beside in [15, 16 * 12 + 12].map(pack) {
            assert_eq!(beside, GpuTexelWater { amounts: GpuTexelWater::BESIDE, ..default() });
            assert_eq!(film_mm(beside), 0.0);
        }
    }
}
