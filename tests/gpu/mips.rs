//! Mip maps of the colour maps: to the bit what halving them in main memory gives, and only where something was painted.

use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    BufferDescriptor, BufferUsages, CommandEncoderDescriptor, Extent3d, MapMode, PollType,
    TexelCopyBufferInfo, TexelCopyBufferLayout, TexelCopyTextureInfo,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use bevy_weathering::collision::MeshTriangles;
use bevy_weathering::overlay::{
    Lying, Overlays, Splat, SurfaceFrames, Weatherable, Wrap, mip_chain, mip_levels,
};

use super::app::app;
use super::splat::{SIZE, painted, push, random_splats, spawn_surface};

type Level = Vec<[u8; 4]>;

/// The three maps of a surface.
fn maps_of(app: &App, surface: Entity) -> [Handle<Image>; 3] {
    let overlays = app.world().get::<Overlays>(surface).unwrap();
    [overlays.diffuse.clone(), overlays.specular.clone(), overlays.normal.clone()]
}

/// All levels of a map, read back.
fn levels_of(app: &App, map: &Handle<Image>) -> Vec<Level> {
    let world = app.sub_app(RenderApp).world();
    let image = world.resource::<RenderAssets<GpuImage>>().get(map.id()).unwrap();
    let (device, queue) = (world.resource::<RenderDevice>(), world.resource::<RenderQueue>());
    let size = image.texture_descriptor.size.width;
    let read = |level: u32| {
        let side = size >> level;
        let row = (side * 4).next_multiple_of(256);
        let buffer = device.create_buffer(&BufferDescriptor {
            label: Some("level"),
            size: u64::from(row * side),
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            TexelCopyTextureInfo { mip_level: level, ..image.texture.as_image_copy() },
            TexelCopyBufferInfo {
                buffer: &buffer,
                layout: TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
            },
            Extent3d { width: side, height: side, depth_or_array_layers: 1 },
        );
        queue.submit([encoder.finish()]);
        let slice = buffer.slice(..);
        slice.map_async(MapMode::Read, |mapped| mapped.unwrap());
        device.wgpu_device().poll(PollType::Wait { submission_index: None, timeout: None }).unwrap();
        let bytes = slice.get_mapped_range().to_vec();
        let texels = |row: &[u8]| row[..4 * side as usize].as_chunks::<4>().0.to_vec();
        bytes.chunks(row as usize).flat_map(texels).collect()
    };
    (0..image.texture_descriptor.mip_level_count).map(read).collect()
}

#[test]
fn every_level_follows_what_is_painted() {
    let Some(mut app) = app() else { return };
    let mut all = 0;
    for (map_size, wrap) in [(SIZE, Wrap::Repeat), (SIZE, Wrap::Clamp), (48, Wrap::Repeat)] {
        let surface = Weatherable { map_size, wrap_u: wrap, wrap_v: wrap, ..default() };
        let entity = spawn_surface(&mut app, surface);
        let end = map_size as i32 * 256;
        let splats: Vec<Splat> = random_splats(300, 42)
            .into_iter()
            .map(|splat| Splat {
                center: splat.center.map(|center| center % end),
                radius: splat.radius.map(|radius| radius.min(end / 2 - 128)),
                ..splat
            })
            .collect();
        for batch in splats.chunks(200) {
            push(&mut app, entity, batch);
            all += batch.len() as u64;
            painted(&mut app, all);
        }
        for map in maps_of(&app, entity) {
            let levels = levels_of(&app, &map);
            assert_eq!(levels.len(), mip_levels(map_size) as usize);
            assert!(levels[1].iter().filter(|texel| texel[3] > 0).count() > 100);
            let expected = mip_chain(&levels[0], map_size, None);
            for (number, (level, expected)) in levels[1..].iter().zip(&expected).enumerate() {
                assert!(level == expected, "{surface:?}: level {}", number + 1);
            }
        }
    }
}

#[test]
fn only_what_was_painted_is_halved() {
    let Some(mut app) = app() else { return };
    let surface = Weatherable { map_size: SIZE, ..default() };
    let entity = spawn_surface(&mut app, surface);
    let splat = |x: i32, y: i32| Splat {
        center: [x * 256, y * 256],
        radius: [3 * 256; 2],
        diffuse: 0xff20_80c0,
        ..bytemuck::Zeroable::zeroed()
    };
    push(&mut app, entity, &[splat(100, 100)]);
    painted(&mut app, 1);
    // What nobody would paint, all over the first level below the map.
    let [map, ..] = maps_of(&app, entity);
    let side = SIZE / 2;
    {
        let world = app.sub_app(RenderApp).world();
        let image = world.resource::<RenderAssets<GpuImage>>().get(map.id()).unwrap();
        world.resource::<RenderQueue>().write_texture(
            TexelCopyTextureInfo { mip_level: 1, ..image.texture.as_image_copy() },
            &vec![9; (side * side * 4) as usize],
            TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * side), rows_per_image: None },
            Extent3d { width: side, height: side, depth_or_array_layers: 1 },
        );
    }
    // Into the second tile of the second row.
    push(&mut app, entity, &[splat(24, 24)]);
    painted(&mut app, 2);
    let levels = levels_of(&app, &map);
    let expected = mip_chain(&levels[0], SIZE, None);
    for (texel, got) in levels[1].iter().enumerate() {
        let (x, y) = (texel as u32 % side, texel as u32 / side);
        let touched = (8..16).contains(&x) && (8..16).contains(&y);
        assert_eq!(*got, if touched { expected[0][texel] } else { [9; 4] }, "{x} {y}");
    }
    assert!(expected[0][(12 * side + 12) as usize][3] > 100);
}

#[test]
fn islands_do_not_pale_along_their_borders() {
    let Some(mut app) = app() else { return };
    let surface = Weatherable { map_size: SIZE, ..default() };
    let entity = spawn_surface(&mut app, surface);
    // A square in one corner of its map.
    let uvs = vec![[0.4, 0.1], [0.1, 0.1], [0.1, 0.4], [0.4, 0.4]];
    let mesh = Mesh::from(Rectangle::new(1.0, 1.0)).with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs);
    let frames = SurfaceFrames::new(&MeshTriangles::from_mesh(&mesh).unwrap(), SIZE, [Wrap::Repeat; 2]);
    app.world_mut().entity_mut(entity).insert(frames.clone());
    // Larger than the square, flat on it; 65,535 steps are its side.
    let radius = 60_000;
    let row = |axis: IVec3| (axis * (256 * 65_536 / radius)).to_array();
    let splat = Splat {
        in_space: 1,
        origin: [32_767, 32_767, 0],
        reach: 2 * radius,
        row_s: row(IVec3::X),
        row_t: row(IVec3::Y),
        row_n: row(IVec3::Z),
        axis_s: 127,
        axis_t: 127 << 8,
        axis_n: 127 << 16,
        diffuse: 0xff20_80c0,
        specular: 0xff00_4020,
        bump: 100,
        bump_opacity: 255,
        ..bytemuck::Zeroable::zeroed()
    };
    push(&mut app, entity, &[splat]);
    painted(&mut app, 1);
    let lying = Lying::new(&frames);
    for map in maps_of(&app, entity) {
        let levels = levels_of(&app, &map);
        assert!(levels[0].iter().filter(|texel| texel[3] > 0).count() > 1000);
        assert!(levels[1..] == mip_chain(&levels[0], SIZE, Some(&lying)));
        let pale = mip_chain(&levels[0], SIZE, None);
        let covered = |level: &Level| level.iter().map(|texel| u32::from(texel[3])).sum::<u32>();
        assert!(
            covered(&levels[4]) > covered(&pale[3]) * 5 / 4,
            "{} {}",
            covered(&levels[4]),
            covered(&pale[3])
        );
    }
}
