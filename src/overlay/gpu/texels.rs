//! Splats and stamps as textures of whole numbers, four to a texel.
//!
//! Every invocation of a tile reads the same splat. Graphics cards do not care what it is read from; software drivers read a
//! buffer one number of one invocation at a time, but textures by vectors.

use bevy::prelude::*;
use bevy::render::render_resource::{
    Extent3d, Origin3d, TexelCopyBufferLayout, TexelCopyTextureInfo, Texture, TextureAspect,
    TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView, TextureViewDescriptor,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};

use crate::overlay::{Splat, SplatBudget, StampAtlas};
use crate::stamps::StampTexel;
use crate::stamps::sample::{STAMP_SIZE, STAMP_TEXELS};

const TEXEL_BYTES: u32 = 16;
/// Texels in a row of the splats; `SPLAT_ROW_BITS` in `shaders/splat.wgsl`.
const SPLAT_ROW: u32 = 1 << 10;
/// Stamps in a row of the atlas; `STAMPS_ALONG` in `shaders/splat.wgsl`.
const STAMPS_ALONG: u32 = 32;
/// What every machine can do.
const MAX_SIDE: u32 = 8192;

const _: () = assert!(StampAtlas::MAX_STAMPS / STAMPS_ALONG * STAMP_SIZE as u32 <= MAX_SIDE);
const _: () = assert!(SplatBudget::LARGEST.upload_bytes / (SPLAT_ROW * TEXEL_BYTES) <= MAX_SIDE);
const _: () = assert!(size_of::<StampTexel>() as u32 == TEXEL_BYTES);
const _: () = assert!(size_of::<Splat>() as u32 == 7 * TEXEL_BYTES, "`SPLAT_TEXELS` in `shaders/splat.wgsl`");

fn texture(device: &RenderDevice, label: &'static str, width: u32, height: u32) -> (Texture, TextureView) {
    let texture = device.create_texture(&TextureDescriptor {
        label: Some(label),
        size: Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format: TextureFormat::Rgba32Uint,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let view = texture.create_view(&TextureViewDescriptor::default());
    (texture, view)
}

/// Writes a block of texels; `bytes` are as many as it takes.
fn write(queue: &RenderQueue, texture: &Texture, [x, y]: [u32; 2], [width, height]: [u32; 2], bytes: &[u8]) {
    queue.write_texture(
        TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: Origin3d { x, y, z: 0 },
            aspect: TextureAspect::All,
        },
        bytes,
        TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(width * TEXEL_BYTES),
            rows_per_image: Some(height),
        },
        Extent3d { width, height, depth_or_array_layers: 1 },
    );
}

/// The splats of a frame.
#[derive(Default)]
pub(super) struct SplatTexels {
    pub(super) splats: Vec<Splat>,
    /// The bytes of the last row, filled up.
    last_row: Vec<u8>,
    texture: Option<(Texture, TextureView)>,
}

impl SplatTexels {
    /// Uploads them, into a larger texture if they are more than ever.
    pub(super) fn upload(&mut self, device: &RenderDevice, queue: &RenderQueue) -> &TextureView {
        let bytes: &[u8] = bytemuck::cast_slice(&self.splats);
        let row_bytes = (SPLAT_ROW * TEXEL_BYTES) as usize;
        let rows = bytes.len().div_ceil(row_bytes) as u32;
        let has_room = |(texture, _): &(Texture, TextureView)| texture.height() >= rows;
        let kept = self.texture.take().filter(has_room);
        let height = rows.next_power_of_two();
        let (texture, view) = self
            .texture
            .insert(kept.unwrap_or_else(|| texture(device, "weathering splats", SPLAT_ROW, height)));
        let (whole, rest) = bytes.split_at(bytes.len() / row_bytes * row_bytes);
        let whole_rows = (whole.len() / row_bytes) as u32;
        if whole_rows > 0 {
            write(queue, texture, [0, 0], [SPLAT_ROW, whole_rows], whole);
        }
        if !rest.is_empty() {
            self.last_row.clear();
            self.last_row.extend_from_slice(rest);
            self.last_row.resize(row_bytes, 0);
            write(queue, texture, [0, whole_rows], [SPLAT_ROW, 1], &self.last_row);
        }
        view
    }
}

/// The atlas as a texture; of an empty one a row of stamps with nothing on them.
pub(super) fn stamp_texture(atlas: &StampAtlas, device: &RenderDevice, queue: &RenderQueue) -> TextureView {
    let side = STAMP_SIZE as u32;
    let rows = atlas.len().div_ceil(STAMPS_ALONG).max(1);
    let (texture, view) = texture(device, "weathering stamps", STAMPS_ALONG * side, rows * side);
    for (stamp, number) in atlas.texels().chunks_exact(STAMP_TEXELS as usize).zip(0..) {
        let corner = [number % STAMPS_ALONG, number / STAMPS_ALONG].map(|along| along * side);
        write(queue, &texture, corner, [side; 2], bytemuck::cast_slice(stamp));
    }
    view
}
