//! Textures of a running app, as pictures.

use std::collections::BTreeMap;

use bevy::image::{ImageAddressMode, ImageFilterMode, ImageSampler};
use bevy::prelude::*;
use bevy::render::render_resource::{TextureDimension, TextureFormat};
use image::{DynamicImage, RgbImage, RgbaImage};
use serde_json::{Value, json};

use crate::export::ExportError;
use crate::export::document::Document;
use crate::scenes::mips::{linear_from_srgb, srgb_from_linear};

/// How a texture is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Meaning {
    /// Colours, as sRGB.
    Color,
    /// Numbers, as they are.
    Data,
    /// Normals whose green grows down the image: it is turned over.
    FlippedNormals,
}

/// Textures, each once.
#[derive(Debug, Clone, Default)]
pub(super) struct LiveTextures {
    numbers: BTreeMap<(AssetId<Image>, Meaning), usize>,
    all: Vec<LiveTexture>,
}

#[derive(Debug, Clone)]
struct LiveTexture {
    picture: DynamicImage,
    sampler: Value,
}

impl LiveTextures {
    /// Takes a texture in; its number.
    ///
    /// # Errors
    /// Why it cannot be a picture.
    pub(super) fn add(
        &mut self,
        images: Option<&Assets<Image>>,
        handle: &Handle<Image>,
        meaning: Meaning,
    ) -> Result<usize, String> {
        if let Some(&number) = self.numbers.get(&(handle.id(), meaning)) {
            return Ok(number);
        }
        let image = images.and_then(|images| images.get(handle)).ok_or("is not loaded")?;
        let texture = LiveTexture { picture: picture(image, meaning)?, sampler: sampler(&image.sampler) };
        self.all.push(texture);
        let number = self.all.len() - 1;
        self.numbers.insert((handle.id(), meaning), number);
        Ok(number)
    }

    /// Writes them, in their order, into a document that has none.
    pub(super) fn push(&self, document: &mut Document) -> Result<(), ExportError> {
        for (number, LiveTexture { picture, sampler }) in self.all.iter().enumerate() {
            let known = document.list("samplers").iter().position(|known| known == sampler);
            let sampler = known.unwrap_or_else(|| document.push("samplers", sampler.clone()));
            document.push_texture(&format!("texture{number}"), picture, sampler)?;
        }
        Ok(())
    }
}

/// The first mip level of an image.
fn picture(image: &Image, meaning: Meaning) -> Result<DynamicImage, String> {
    let descriptor = &image.texture_descriptor;
    let size = descriptor.size;
    if descriptor.dimension != TextureDimension::D2 || size.depth_or_array_layers != 1 {
        return Err("is not a flat picture".into());
    }
    let channels = match descriptor.format {
        TextureFormat::R8Unorm => 1,
        TextureFormat::Rgba8Unorm
        | TextureFormat::Rgba8UnormSrgb
        | TextureFormat::Bgra8Unorm
        | TextureFormat::Bgra8UnormSrgb => 4,
        other => return Err(format!("is {other:?}; 8-bit RGBA and red are written")),
    };
    let data = image.data.as_deref();
    let data = data.ok_or("is only on the GPU; keep it with `RenderAssetUsages::MAIN_WORLD`, too")?;
    let length = size.width as usize * size.height as usize * channels;
    let mut texels =
        data.get(..length).filter(|_| length > 0).ok_or("has not as many texels as it says")?.to_vec();
    if matches!(descriptor.format, TextureFormat::Bgra8Unorm | TextureFormat::Bgra8UnormSrgb) {
        texels.chunks_exact_mut(4).for_each(|texel| texel.swap(0, 2));
    }
    recode(&mut texels, channels, descriptor.format.is_srgb(), meaning);
    let (width, height) = (size.width, size.height);
    let lost = "has not as many texels as it says";
    if channels == 1 {
        // A shader reads it as red alone; a grey picture would be all three.
        let red = texels.iter().flat_map(|&red| [red, 0, 0]).collect();
        return RgbImage::from_raw(width, height, red).map(DynamicImage::from).ok_or(lost.into());
    }
    if texels.chunks_exact(4).all(|texel| texel[3] == 255) {
        let opaque = texels.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect();
        return RgbImage::from_raw(width, height, opaque).map(DynamicImage::from).ok_or(lost.into());
    }
    RgbaImage::from_raw(width, height, texels).map(DynamicImage::from).ok_or(lost.into())
}

/// Colours as sRGB and numbers as they are, whatever a renderer would have made of the bytes. Alpha stays.
fn recode(texels: &mut [u8], channels: usize, is_srgb: bool, meaning: Meaning) {
    let convert: Option<fn(f32) -> f32> = match (is_srgb, meaning == Meaning::Color) {
        (true, false) => Some(linear_from_srgb),
        (false, true) => Some(srgb_from_linear),
        _ => None,
    };
    if let Some(convert) = convert {
        let table: [u8; 256] =
            std::array::from_fn(|byte| (convert(byte as f32 / 255.0).clamp(0.0, 1.0) * 255.0).round() as u8);
        for texel in texels.chunks_exact_mut(channels) {
            texel.iter_mut().take(3).for_each(|channel| *channel = table[usize::from(*channel)]);
        }
    }
    if meaning == Meaning::FlippedNormals && channels > 1 {
        // 128 is flat.
        let turned = |green: u8| (256 - u16::from(green)).min(255) as u8;
        texels.chunks_exact_mut(channels).for_each(|texel| texel[1] = turned(texel[1]));
    }
}

fn sampler(sampler: &ImageSampler) -> Value {
    let linear = ImageFilterMode::Linear;
    let (edges, [near, far]) = match sampler {
        ImageSampler::Default => ([ImageAddressMode::ClampToEdge; 2], [linear; 2]),
        ImageSampler::Descriptor(descriptor) => (
            [descriptor.address_mode_u, descriptor.address_mode_v],
            [descriptor.mag_filter, descriptor.min_filter],
        ),
    };
    let [s, t] = edges.map(|edge| match edge {
        ImageAddressMode::Repeat => 10_497,
        ImageAddressMode::MirrorRepeat => 33_648,
        ImageAddressMode::ClampToEdge | ImageAddressMode::ClampToBorder => 33_071,
    });
    let near = if near == linear { 9729 } else { 9728 };
    // Between mip maps in any case: a reader makes them.
    let far = if far == linear { 9987 } else { 9986 };
    json!({ "magFilter": near, "minFilter": far, "wrapS": s, "wrapT": t })
}

#[cfg(test)]
mod tests {
    use bevy::asset::RenderAssetUsages;
    use bevy::render::render_resource::Extent3d;

    use super::*;

    fn image(format: TextureFormat, data: Vec<u8>) -> Image {
        let size = Extent3d { width: 2, height: 1, depth_or_array_layers: 1 };
        Image::new(size, TextureDimension::D2, data, format, RenderAssetUsages::default())
    }

    #[test]
    fn colours_are_srgb_and_numbers_are_what_they_are() {
        let texels = vec![128, 0, 255, 255, 10, 20, 30, 40];
        let of =
            |format, meaning| picture(&image(format, texels.clone()), meaning).unwrap().to_rgba8().into_raw();
        assert_eq!(of(TextureFormat::Rgba8UnormSrgb, Meaning::Color), texels);
        assert_eq!(of(TextureFormat::Rgba8Unorm, Meaning::Data), texels);
        assert_eq!(of(TextureFormat::Rgba8Unorm, Meaning::Color)[..4], [188, 0, 255, 255]);
        assert_eq!(of(TextureFormat::Bgra8UnormSrgb, Meaning::Color)[..4], [255, 0, 128, 255]);
        assert_eq!(of(TextureFormat::Rgba8Unorm, Meaning::FlippedNormals)[4..], [10, 236, 30, 40]);
        // What has one channel has no green and no blue: a grey metallic-roughness map would be metal.
        let red = picture(&image(TextureFormat::R8Unorm, vec![9, 200]), Meaning::Data).unwrap();
        assert_eq!(red.to_rgb8().into_raw(), [9, 0, 0, 200, 0, 0]);
    }

    #[test]
    fn only_the_first_level_is_taken_and_what_cannot_be_is_named() {
        let mut mapped = image(TextureFormat::Rgba8UnormSrgb, vec![9, 9, 9, 255, 9, 9, 9, 255]);
        mapped.data.as_mut().unwrap().extend([1, 1, 1, 255]);
        let written = picture(&mapped, Meaning::Color).unwrap();
        assert_eq!((written.width(), written.height(), written.color()), (2, 1, image::ColorType::Rgb8));
        mapped.data = None;
        assert!(picture(&mapped, Meaning::Color).unwrap_err().contains("MAIN_WORLD"));
        let float = image(TextureFormat::R32Float, vec![0; 8]);
        assert!(picture(&float, Meaning::Data).unwrap_err().contains("R32Float"));
    }

    #[test]
    fn sharp_texels_stay_sharp() {
        let soft = json!({ "magFilter": 9729, "minFilter": 9987, "wrapS": 33_071, "wrapT": 33_071 });
        assert_eq!(sampler(&ImageSampler::Default), soft);
        assert_eq!(sampler(&ImageSampler::linear()), soft);
        let sharp = json!({ "magFilter": 9728, "minFilter": 9986, "wrapS": 33_071, "wrapT": 33_071 });
        assert_eq!(sampler(&ImageSampler::nearest()), sharp);
    }

    #[test]
    fn a_texture_is_there_once_for_each_meaning() {
        let mut images = Assets::<Image>::default();
        let handle = images.add(image(TextureFormat::Rgba8Unorm, vec![7; 8]));
        let mut textures = LiveTextures::default();
        let mut add = |meaning| textures.add(Some(&images), &handle, meaning);
        assert_eq!([add(Meaning::Data), add(Meaning::Color), add(Meaning::Data)], [Ok(0), Ok(1), Ok(0)]);
        assert!(textures.add(None, &Handle::default(), Meaning::Data).is_err());
    }
}
