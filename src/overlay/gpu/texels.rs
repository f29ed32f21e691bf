//! Splats, which of them lie in which tile, and stamps, as textures of whole numbers.
//!
//! Every invocation of a tile reads the same splat. Graphics cards do not care what it is read from; software drivers read a
//! buffer one number of one invocation at a time, but textures by vectors.

use bevy::prelude::*;
use bevy::render::render_resource::{
    Extent3d, Origin3d, TexelCopyBufferLayout, TexelCopyTextureInfo, Texture, TextureAspect,
    TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView, TextureViewDescriptor,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bytemuck::Pod;

use crate::overlay::{Splat, StampAtlas};
use crate::stamps::StampTexel;
use crate::stamps::sample::{STAMP_SIZE, STAMP_TEXELS};

/// Texels in a row of the splats; `SPLAT_ROW_BITS` in `shaders/splat.wgsl`.
const SPLAT_ROW: u32 = 1 << 10;
/// Texels in a row of the list; `LIST_ROW_BITS` in `shaders/splat.wgsl`.
const LIST_ROW: u32 = 1 << 12;
/// Stamps in a row of the atlas; `STAMPS_ALONG` in `shaders/splat.wgsl`.
const STAMPS_ALONG: u32 = 32;
/// What every machine can do.
const MAX_SIDE: u32 = 8192;

const _: () = assert!(StampAtlas::MAX_STAMPS / STAMPS_ALONG * STAMP_SIZE <= MAX_SIDE);
const _: () = assert!(size_of::<StampTexel>() == 16);
const _: () = assert!(size_of::<Splat>() == 7 * 16, "`SPLAT_TEXELS` in `shaders/splat.wgsl`");

fn texture(device: &RenderDevice, label: &'static str, format: TextureFormat, size: [u32; 2]) -> Texture {
    device.create_texture(&TextureDescriptor {
        label: Some(label),
        size: Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    })
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
            bytes_per_row: Some(bytes.len() as u32 / height),
            rows_per_image: Some(height),
        },
        Extent3d { width, height, depth_or_array_layers: 1 },
    );
}

/// Numbers one after the other, row by row.
pub(super) struct TexelRows<T> {
    label: &'static str,
    format: TextureFormat,
    row: u32,
    pub(super) values: Vec<T>,
    /// The bytes of the last row, filled up.
    last_row: Vec<u8>,
    texture: Option<(Texture, TextureView)>,
}

impl TexelRows<Splat> {
    pub(super) fn splats() -> Self {
        Self::new("weathering splats", TextureFormat::Rgba32Uint, SPLAT_ROW)
    }
}

impl TexelRows<u32> {
    pub(super) fn list() -> Self {
        Self::new("weathering splat list", TextureFormat::R32Uint, LIST_ROW)
    }
}

impl<T: Pod> TexelRows<T> {
    fn new(label: &'static str, format: TextureFormat, row: u32) -> Self {
        Self { label, format, row, values: Vec::new(), last_row: Vec::new(), texture: None }
    }

    /// Uploads them, into a larger texture if they are more than ever; [`SplatBudget::LARGEST`](crate::overlay::SplatBudget::LARGEST) fits.
    pub(super) fn upload(&mut self, device: &RenderDevice, queue: &RenderQueue) -> &TextureView {
        let bytes: &[u8] = bytemuck::cast_slice(&self.values);
        let row_bytes = (self.row * self.format.block_copy_size(None).unwrap_or(4)) as usize;
        let rows = bytes.len().div_ceil(row_bytes).max(1) as u32;
        let kept = self.texture.take().filter(|(texture, _)| texture.height() >= rows);
        let (texture, view) = self.texture.insert(kept.unwrap_or_else(|| {
            let height = rows.next_power_of_two().min(MAX_SIDE);
            let texture = texture(device, self.label, self.format, [self.row, height]);
            let view = texture.create_view(&TextureViewDescriptor::default());
            (texture, view)
        }));
        let (whole, rest) = bytes.split_at(bytes.len() / row_bytes * row_bytes);
        let whole_rows = (whole.len() / row_bytes) as u32;
        if whole_rows > 0 {
            write(queue, texture, [0, 0], [self.row, whole_rows], whole);
        }
        if !rest.is_empty() {
            self.last_row.clear();
            self.last_row.extend_from_slice(rest);
            self.last_row.resize(row_bytes, 0);
            write(queue, texture, [0, whole_rows], [self.row, 1], &self.last_row);
        }
        view
    }
}

/// The atlas as a texture; of an empty one a row of stamps with nothing on them.
pub(super) fn stamp_texture(atlas: &StampAtlas, device: &RenderDevice, queue: &RenderQueue) -> TextureView {
    let side = STAMP_SIZE;
    let rows = atlas.len().div_ceil(STAMPS_ALONG).max(1);
    let size = [STAMPS_ALONG * side, rows * side];
    let texture = texture(device, "weathering stamps", TextureFormat::Rgba32Uint, size);
    for (stamp, number) in atlas.texels().chunks_exact(STAMP_TEXELS as usize).zip(0..) {
        let corner = [number % STAMPS_ALONG, number / STAMPS_ALONG].map(|along| along * side);
        write(queue, &texture, corner, [side; 2], bytemuck::cast_slice(stamp));
    }
    texture.create_view(&TextureViewDescriptor::default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::overlay::SplatBudget;

    #[test]
    fn the_largest_frame_fits() {
        let texels = |row: u32| u64::from(row) * u64::from(MAX_SIDE);
        // Splats alone, or a single one in all tiles there are room for.
        let bytes = u64::from(SplatBudget::LARGEST.upload_bytes) + size_of::<Splat>() as u64;
        assert!(bytes <= texels(SPLAT_ROW) * 16);
        assert!(bytes <= texels(LIST_ROW) * 4);
    }
}
