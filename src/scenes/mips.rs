//! Mip maps for 8-bit textures, which Bevy uploads but does not make.
//!
//! Each level is the one above it averaged over the area of its texels, the last one a single texel. The
//! average is taken where averaging means something: of light, so sRGB is decoded first; of directions, so
//! normals are summed as vectors and made unit length again. A level of odd size shares its middle texels
//! between two neighbours instead of dropping the last one, so every level has the mean of the first.
//!
//! What this does not do: it does not widen roughness where normals are averaged away, it does not filter
//! across the edge of the image (the area average never needs to), and it knows no compressed format.

use bevy::image::{ImageAddressMode, ImageSampler, ImageSamplerDescriptor};
use bevy::prelude::Image;
use bevy::render::render_resource::{TextureDimension, TextureFormat};
use thiserror::Error;

/// What the texels mean, which decides how they are averaged. Alpha is always averaged as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MipContent {
    /// Colour or quantities: decoded from sRGB if the format says so, averaged, encoded again.
    Values,
    /// Tangent-space normals, `0..=255` for `-1..=1`: averaged as vectors and normalised.
    Normals,
}

/// Why mip maps could not be made.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MipError {
    /// Only `Rgba8Unorm` and `Rgba8UnormSrgb` are understood.
    #[error("mip maps are made for Rgba8Unorm and Rgba8UnormSrgb images, this one is {0:?}")]
    Format(TextureFormat),
    /// The image is not a plain two-dimensional one with a single mip level.
    #[error("mip maps are made for a flat image without any, this one has {layers} layers, {levels} levels")]
    Shape {
        /// Array layers, or depth.
        layers: u32,
        /// Mip levels it has already.
        levels: u32,
    },
    /// The texels are missing (moved to the render world) or do not fill the image.
    #[error("an image of {width} by {height} needs {needed} bytes, this one has {got}")]
    Data {
        /// Width in texels.
        width: u32,
        /// Height in texels.
        height: u32,
        /// Bytes needed.
        needed: usize,
        /// Bytes there.
        got: usize,
    },
}

/// The image with its full chain of mip maps, for generated textures and loaded photographs alike.
///
/// Size, format, sampler and usages stay as they are; see [`tiling_sampler`] for a sampler that reads the
/// new levels, which Bevy's default one for a hand-made image may not.
///
/// # Errors
/// [`MipError::Format`] for anything but 8-bit RGBA, [`MipError::Shape`] for arrays, cubes, volumes and
/// images that have mip maps, [`MipError::Data`] if the texels are not there.
pub fn with_mips(mut image: Image, content: MipContent) -> Result<Image, MipError> {
    let descriptor = &image.texture_descriptor;
    let size = descriptor.size;
    let srgb = match descriptor.format {
        TextureFormat::Rgba8UnormSrgb => true,
        TextureFormat::Rgba8Unorm => false,
        other => return Err(MipError::Format(other)),
    };
    let (layers, levels) = (size.depth_or_array_layers, descriptor.mip_level_count);
    if descriptor.dimension != TextureDimension::D2 || layers != 1 || levels != 1 {
        return Err(MipError::Shape { layers, levels });
    }
    let needed = size.width as usize * size.height as usize * 4;
    let got = image.data.as_ref().map_or(0, Vec::len);
    let Some(data) = image.data.take_if(|data| needed > 0 && data.len() == needed) else {
        return Err(MipError::Data { width: size.width, height: size.height, needed, got });
    };
    let (chain, levels) = mip_chain(data, size.width, size.height, content, srgb);
    image.data = Some(chain);
    image.texture_descriptor.mip_level_count = levels;
    Ok(image)
}

/// A sampler for textures that repeat: trilinear, and 8 samples along the direction of a slanted view.
///
/// Renderers that know no anisotropic filtering fall back to trilinear.
pub fn tiling_sampler() -> ImageSampler {
    ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: ImageAddressMode::Repeat,
        address_mode_v: ImageAddressMode::Repeat,
        anisotropy_clamp: 8,
        ..ImageSamplerDescriptor::linear()
    })
}

/// All levels of an 8-bit RGBA image one after the other, and how many they are.
///
/// `texels` is the first level, `width * height * 4` bytes.
pub(crate) fn mip_chain(
    texels: Vec<u8>,
    width: u32,
    height: u32,
    content: MipContent,
    srgb: bool,
) -> (Vec<u8>, u32) {
    let (mut width, mut height) = (width as usize, height as usize);
    let mut level: Vec<[f32; 4]> =
        texels.chunks_exact(4).map(|t| decode([t[0], t[1], t[2], t[3]], content, srgb)).collect();
    let mut chain = texels;
    let mut levels = 1;
    // The levels stay in floating point all the way down, so no rounding is carried from one to the next.
    while width > 1 || height > 1 {
        let (narrow, low) = ((width / 2).max(1), (height / 2).max(1));
        level = halved(&transposed(&halved(&level, width, narrow), narrow), height, low);
        level = transposed(&level, low);
        (width, height) = (narrow, low);
        chain.extend(level.iter().flat_map(|&texel| encode(texel, content, srgb)));
        levels += 1;
    }
    (chain, levels)
}

/// Rows of `from` texels averaged down to rows of `to`, by the area each new texel covers.
fn halved(texels: &[[f32; 4]], from: usize, to: usize) -> Vec<[f32; 4]> {
    let scale = from as f32 / to as f32;
    let average = |row: &[[f32; 4]], i: usize| {
        let (start, end) = (i as f32 * scale, (i + 1) as f32 * scale);
        let mut sum = [0.0; 4];
        for (j, texel) in row.iter().enumerate().take(end.ceil() as usize).skip(start as usize) {
            let weight = (end.min((j + 1) as f32) - start.max(j as f32)).max(0.0) / scale;
            for (sum, value) in sum.iter_mut().zip(texel) {
                *sum += weight * value;
            }
        }
        sum
    };
    texels.chunks_exact(from).flat_map(|row| (0..to).map(move |i| average(row, i))).collect()
}

/// Columns for rows, of an image `width` texels wide.
fn transposed(texels: &[[f32; 4]], width: usize) -> Vec<[f32; 4]> {
    (0..width).flat_map(|x| texels.iter().skip(x).step_by(width).copied()).collect()
}

fn decode(texel: [u8; 4], content: MipContent, srgb: bool) -> [f32; 4] {
    let [r, g, b, a] = texel.map(|byte| f32::from(byte) / 255.0);
    match content {
        MipContent::Normals => [r * 2.0 - 1.0, g * 2.0 - 1.0, b * 2.0 - 1.0, a],
        MipContent::Values if srgb => [linear_from_srgb(r), linear_from_srgb(g), linear_from_srgb(b), a],
        MipContent::Values => [r, g, b, a],
    }
}

fn encode(texel: [f32; 4], content: MipContent, srgb: bool) -> [u8; 4] {
    let [x, y, z, a] = texel;
    let encoded = match content {
        MipContent::Normals => {
            // Normals that cancel each other say nothing: flat.
            let length = (x * x + y * y + z * z).sqrt();
            let [x, y, z] = if length > 1e-6 { [x, y, z].map(|v| v / length) } else { [0.0, 0.0, 1.0] };
            [x * 0.5 + 0.5, y * 0.5 + 0.5, z * 0.5 + 0.5, a]
        }
        MipContent::Values if srgb => [srgb_from_linear(x), srgb_from_linear(y), srgb_from_linear(z), a],
        MipContent::Values => texel,
    };
    encoded.map(unorm8)
}

/// A byte for `0..=1`, rounded to nearest; what lies outside is clamped.
pub(crate) fn unorm8(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// IEC 61966-2-1: light, `0..=1`, from an encoded value, `0..=1`.
pub(crate) fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// IEC 61966-2-1: an encoded value, `0..=1`, from light, `0..=1`.
pub(crate) fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::asset::RenderAssetUsages;
    use bevy::render::render_resource::Extent3d;

    fn image(width: u32, height: u32, format: TextureFormat, texel: impl Fn(u32, u32) -> [u8; 4]) -> Image {
        let data = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y));
        Image::new(
            Extent3d { width, height, depth_or_array_layers: 1 },
            TextureDimension::D2,
            data.collect(),
            format,
            RenderAssetUsages::default(),
        )
    }

    fn last_texel(image: &Image) -> [u8; 4] {
        let data = image.data.as_ref().expect("texels");
        [0, 1, 2, 3].map(|i| data[data.len() - 4 + i])
    }

    #[test]
    fn the_chain_goes_down_to_one_texel() {
        for (width, height, levels, texels) in
            [(8, 8, 4, 85), (8, 2, 4, 16 + 4 + 2 + 1), (5, 3, 3, 15 + 2 + 1)]
        {
            let image = image(width, height, TextureFormat::Rgba8Unorm, |_, _| [1, 2, 3, 4]);
            let image = with_mips(image, MipContent::Values).expect("valid");
            assert_eq!(image.texture_descriptor.mip_level_count, levels);
            assert_eq!(image.data.as_ref().expect("texels").len(), texels * 4);
            assert_eq!(last_texel(&image), [1, 2, 3, 4]);
        }
    }

    #[test]
    fn colour_is_averaged_as_light() {
        let checker = |x: u32, y: u32| if (x + y).is_multiple_of(2) { [255; 4] } else { [0, 0, 0, 255] };
        let srgb = with_mips(image(4, 4, TextureFormat::Rgba8UnormSrgb, checker), MipContent::Values);
        assert_eq!(last_texel(&srgb.expect("valid")), [188, 188, 188, 255]);
        let linear = with_mips(image(4, 4, TextureFormat::Rgba8Unorm, checker), MipContent::Values);
        assert_eq!(last_texel(&linear.expect("valid")), [128, 128, 128, 255]);
    }

    #[test]
    fn odd_sizes_keep_the_mean() {
        let stripes =
            image(7, 5, TextureFormat::Rgba8Unorm, |x, y| [if x == 6 { 210 } else { 0 }, y as u8 * 50, 0, 0]);
        assert_eq!(last_texel(&with_mips(stripes, MipContent::Values).expect("valid")), [30, 100, 0, 0]);
    }

    #[test]
    fn normals_stay_unit_length() {
        let tilted = |x: u32, _| if x == 0 { [255, 128, 128, 255] } else { [128, 255, 128, 255] };
        let image = with_mips(image(2, 2, TextureFormat::Rgba8Unorm, tilted), MipContent::Normals);
        let normal = last_texel(&image.expect("valid")).map(|byte| f32::from(byte) / 127.5 - 1.0);
        let length = normal[..3].iter().map(|v| v * v).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 0.01, "{normal:?}");
        assert!((normal[0] - normal[1]).abs() < 0.01, "{normal:?}");
    }

    #[test]
    fn other_images_are_refused() {
        let mut twice = with_mips(image(4, 4, TextureFormat::Rgba8Unorm, |_, _| [0; 4]), MipContent::Values);
        twice = with_mips(twice.expect("valid"), MipContent::Values);
        assert_eq!(twice, Err(MipError::Shape { layers: 1, levels: 3 }));
        let bgra = image(2, 2, TextureFormat::Bgra8Unorm, |_, _| [0; 4]);
        assert_eq!(with_mips(bgra, MipContent::Values), Err(MipError::Format(TextureFormat::Bgra8Unorm)));
        let mut gone = image(2, 2, TextureFormat::Rgba8Unorm, |_, _| [0; 4]);
        gone.data = None;
        assert!(matches!(with_mips(gone, MipContent::Values), Err(MipError::Data { got: 0, .. })));
    }
}
