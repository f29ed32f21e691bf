//! An app with everything that renders without a window and without a tick, and what its GPU holds.

use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_asset::RenderAssets;
use bevy::render::renderer::{RenderAdapterInfo, RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::offscreen;
use bevy_weathering::overlay::SplatBudget;

/// Frames hold no tick: what is there stays as it is, and what is timed is drawing alone.
pub fn app() -> App {
    let mut app = App::new();
    app.add_plugins(offscreen::plugins())
        .add_plugins(WeatheringPlugins)
        // What is pushed at once is timed in one frame.
        .insert_resource(SplatBudget::LARGEST)
        .insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    app.finish();
    app.cleanup();
    app
}

/// One frame, until the GPU is done with it.
pub fn frame(app: &mut App) {
    app.update();
    wait(device(app));
}

/// Until the GPU is done with all that it was given.
pub fn wait(device: &wgpu::Device) {
    device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
}

/// The device of an app.
pub fn device(app: &App) -> &wgpu::Device {
    app.world().resource::<RenderDevice>().wgpu_device()
}

/// Its queue.
pub fn queue(app: &App) -> &wgpu::Queue {
    app.world().resource::<RenderQueue>()
}

/// What it runs on.
pub fn adapter(app: &App) -> &str {
    &app.world().resource::<RenderAdapterInfo>().name
}

/// The bytes of an image on the GPU.
pub fn read_image(app: &App, image: &Handle<Image>) -> Vec<u8> {
    let images = app.sub_app(RenderApp).world().resource::<RenderAssets<GpuImage>>();
    let image = images.get(image.id()).expect("it is read after the frame it came in");
    read_texture(device(app), queue(app), &image.texture)
}

/// The bytes of a texture with four of them a texel; the width is a multiple of 64.
pub fn read_texture(device: &wgpu::Device, queue: &wgpu::Queue, texture: &wgpu::Texture) -> Vec<u8> {
    let bytes_per_row = 4 * texture.width();
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read-back"),
        size: u64::from(bytes_per_row) * u64::from(texture.height()),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(bytes_per_row), rows_per_image: None };
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo { buffer: &buffer, layout },
        texture.size(),
    );
    queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |mapped| mapped.unwrap());
    wait(device);
    buffer.get_mapped_range(..).to_vec()
}
