//! The one number that changes every tick, shared by all weathered materials, so that none of them has to be touched.

use bevy::asset::RenderAssetUsages;
use bevy::prelude::*;
use bevy::render::extract_resource::{ExtractResource, ExtractResourcePlugin};
use bevy::render::render_asset::RenderAssets;
use bevy::render::renderer::RenderQueue;
use bevy::render::storage::{GpuShaderBuffer, ShaderBuffer};
use bevy::render::{Render, RenderApp, RenderSystems};

use crate::clock::WeatheringClock;

/// Buffer of two `u32`: tick and ticks per second.
#[derive(Resource, ExtractResource, Clone)]
pub struct ClockBuffer(pub Handle<ShaderBuffer>);

#[derive(Resource, ExtractResource, Clone, Copy, PartialEq)]
struct RenderClock(WeatheringClock);

impl FromWorld for ClockBuffer {
    fn from_world(world: &mut World) -> Self {
        let buffer = ShaderBuffer::with_size(8, RenderAssetUsages::RENDER_WORLD);
        Self(world.resource_mut::<Assets<ShaderBuffer>>().add(buffer))
    }
}

pub(super) fn plugin(app: &mut App) {
    app.init_resource::<ClockBuffer>()
        .add_plugins((
            ExtractResourcePlugin::<ClockBuffer>::default(),
            ExtractResourcePlugin::<RenderClock>::default(),
        ))
        .insert_resource(RenderClock(WeatheringClock::default()))
        .add_systems(PostUpdate, copy_clock);
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app.add_systems(Render, write_clock.in_set(RenderSystems::PrepareResources));
}

fn copy_clock(clock: Res<WeatheringClock>, mut copy: ResMut<RenderClock>) {
    copy.set_if_neq(RenderClock(*clock));
}

/// Writes into the buffer itself: its asset, and so every bind group, stays as it is.
fn write_clock(
    clock: Option<Res<RenderClock>>,
    buffer: Option<Res<ClockBuffer>>,
    buffers: Res<RenderAssets<GpuShaderBuffer>>,
    queue: Res<RenderQueue>,
    mut written: Local<Option<[u32; 2]>>,
) {
    let (Some(clock), Some(buffer)) = (clock, buffer) else { return };
    let Some(buffer) = buffers.get(&buffer.0) else { return };
    let now = [clock.0.tick(), clock.0.hz()];
    if *written != Some(now) {
        queue.write_buffer(&buffer.buffer, 0, bytemuck::bytes_of(&now));
        *written = Some(now);
    }
}
