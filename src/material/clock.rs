//! The numbers that change every tick, shared by all weathered materials, so that none of them has to be touched: the time,
//! and the drying clock.

use bevy::asset::RenderAssetUsages;
use bevy::prelude::*;
use bevy::render::extract_resource::{ExtractResource, ExtractResourcePlugin};
use bevy::render::render_asset::RenderAssets;
use bevy::render::renderer::RenderQueue;
use bevy::render::storage::{GpuShaderBuffer, ShaderBuffer};
use bevy::render::{Render, RenderApp, RenderSystems};
use bytemuck::{Pod, Zeroable};

use crate::clock::{ShownTime, WeatheringClock};
use crate::weather::DryingClock;

/// Buffer of the time and the drying clock: `Clock` in `shaders/common/wet_map.wgsl`.
#[derive(Resource, ExtractResource, Clone)]
pub struct ClockBuffer(pub Handle<ShaderBuffer>);

/// A [`DryingPoint`](crate::weather::DryingPoint) as the shader reads it: `DryingPoint` in
/// `shaders/common/wet_map.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct GpuDryingPoint {
    /// When.
    pub tick: u32,
    /// Until then by the air, mm.
    pub air_mm: f32,
    /// Until then by the sun, mm.
    pub sun_mm: f32,
    /// From then on by the air, mm a tick.
    pub air_per_tick: f32,
    /// From then on by the sun, mm a tick.
    pub sun_per_tick: f32,
}

/// What is written: tick, ticks per second, number of points, 0; then the points.
#[derive(Resource, ExtractResource, Clone, PartialEq, Default)]
struct RenderClock {
    time: [u32; 4],
    points: Vec<GpuDryingPoint>,
}

const HEADER: usize = size_of::<[u32; 4]>();

impl FromWorld for ClockBuffer {
    fn from_world(world: &mut World) -> Self {
        let bytes = HEADER + DryingClock::MAX_POINTS * size_of::<GpuDryingPoint>();
        let buffer = ShaderBuffer::with_size(bytes, RenderAssetUsages::RENDER_WORLD);
        Self(world.resource_mut::<Assets<ShaderBuffer>>().add(buffer))
    }
}

pub(super) fn plugin(app: &mut App) {
    app.init_resource::<ClockBuffer>()
        .add_plugins((
            ExtractResourcePlugin::<ClockBuffer>::default(),
            ExtractResourcePlugin::<RenderClock>::default(),
        ))
        .init_resource::<RenderClock>()
        .add_systems(PostUpdate, copy_clock);
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app.add_systems(Render, write_clock.in_set(RenderSystems::PrepareResources));
}

fn copy_clock(
    clock: Res<WeatheringClock>,
    shown: Res<ShownTime>,
    drying: Option<Res<DryingClock>>,
    mut copy: ResMut<RenderClock>,
) {
    let count = drying.as_ref().map_or(1, |drying| drying.points().len());
    let time = [shown.tick(&clock), clock.hz(), count as u32, 0];
    if copy.time != time {
        copy.time = time;
    }
    if drying.as_ref().is_some_and(|drying| drying.is_changed()) {
        copy.points.clear();
        copy.points.extend(drying.iter().flat_map(|drying| drying.points()).map(|point| GpuDryingPoint {
            tick: point.tick,
            air_mm: point.total.air_mm as f32,
            sun_mm: point.total.sun_mm as f32,
            air_per_tick: point.per_tick.air_mm as f32,
            sun_per_tick: point.per_tick.sun_mm as f32,
        }));
    }
}

/// Writes into the buffer itself: its asset, and so every bind group, stays as it is. What did not change is not written.
fn write_clock(
    clock: Option<Res<RenderClock>>,
    buffer: Option<Res<ClockBuffer>>,
    buffers: Res<RenderAssets<GpuShaderBuffer>>,
    queue: Res<RenderQueue>,
    mut written: Local<Option<RenderClock>>,
) {
    let (Some(clock), Some(buffer)) = (clock, buffer) else { return };
    let Some(buffer) = buffers.get(&buffer.0) else { return };
    if written.as_ref() == Some(&*clock) {
        return;
    }
    queue.write_buffer(&buffer.buffer, 0, bytemuck::bytes_of(&clock.time));
    if written.as_ref().is_none_or(|written| written.points != clock.points) {
        queue.write_buffer(&buffer.buffer, HEADER as u64, bytemuck::cast_slice(&clock.points));
    }
    *written = Some(clock.clone());
}
