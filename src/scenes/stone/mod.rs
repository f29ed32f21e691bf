//! Tileable close-ups of stone: terracotta, sandstone and concrete, grown from noise.
//!
//! One tile is a patch [`TILE_MM`] wide. For every texel a recipe adds up what is seen on such a patch,
//! coarse to fine, as colour and as height in millimetres: bedding, mottling, turning marks, pits, and at
//! the end single grains with a colour and a dome each. Hollows, where the height lies below its own blur,
//! are darkened by the light they lose. The normal map is the slope of that same height, so relief, colour
//! and occlusion belong together. At last the colours are scaled to the mean albedo of [`Stone::albedo`].
//!
//! Tiling. Grains, pits and spots live in cells whose numbers wrap, so they repeat exactly. The noise does
//! not repeat by itself: over the last quarter of the tile, along either axis, it is exchanged smoothly for
//! the noise from before the tile's first edge. Uncorrelated noises lose contrast when averaged; the sum is
//! divided by the root of its squared weights, which gives it back (Heitz and Neyret, "High-performance
//! by-example noise using a histogram-preserving blending operator", 2018).
//!
//! What this does not do: it does not measure a stone, the recipes were chosen by eye; and it does not
//! hide repetition, a wall of many tiles shows its pattern as a photograph would.

mod kinds;
mod noise;
mod relief;

use bevy::asset::RenderAssetUsages;
use bevy::math::{Vec2, Vec3};
use bevy::prelude::Image;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use serde::{Deserialize, Serialize};

use super::mips::{MipContent, mip_chain, srgb_from_linear, tiling_sampler, unorm8};
use kinds::{Texel, concrete, sandstone, terracotta};
use noise::Layers;
use relief::{normals, occlusion};

/// Edge of a tile in millimetres of stone; the relief has natural slopes at that scale.
pub const TILE_MM: f32 = 400.0;

/// A kind of stone.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stone {
    /// Fired clay from the wheel: fine, mottled, turning marks along u, specks of temper, a few scratches.
    Terracotta,
    /// Warm sand, grain by grain, bedded along u, with iron spots and pits.
    Sandstone,
    /// Grey cement skin with the pores that air bubbles leave.
    Concrete,
}

impl Stone {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Terracotta, Self::Sandstone, Self::Concrete];

    /// Mean diffuse albedo of the dry stone, linear RGB, `0..=1`.
    pub fn albedo(self) -> Vec3 {
        match self {
            Self::Terracotta => Vec3::new(0.50, 0.23, 0.13),
            Self::Sandstone => Vec3::new(0.45, 0.36, 0.25),
            Self::Concrete => Vec3::new(0.40, 0.38, 0.35),
        }
    }
}

/// The textures of one stone: square, tileable, with mip maps and a repeating sampler.
#[derive(Clone, Debug)]
pub struct StoneMaps {
    /// Diffuse albedo, `Rgba8UnormSrgb`.
    pub albedo: Image,
    /// Tangent-space normals, `Rgba8Unorm`, +Y towards the top of the image as in glTF.
    pub normal: Image,
    /// `Rgba8Unorm`: red ambient occlusion, green perceptual roughness, blue metallic (0), as in glTF.
    pub roughness: Image,
    height: Vec<f32>,
}

impl StoneMaps {
    /// The relief behind the maps in millimetres, row by row from the top left; 0 is the mean surface.
    pub fn height_mm(&self) -> &[f32] {
        &self.height
    }
}

/// Grows a stone.
///
/// `size` is the edge of the maps in texels, held within 16 and 4096. Below 1024 the finest grains are
/// drawn larger instead of being lost. The result depends on the arguments alone; 1024 takes one to
/// two seconds on one core.
pub fn stone_maps(stone: Stone, size: u32, seed: u32) -> StoneMaps {
    let size = size.clamp(16, 4096);
    let layers = Layers { seed, finest: size as f32 / 3.0 };
    let texels: Vec<Texel> = match stone {
        Stone::Terracotta => every_texel(size, terracotta(layers)),
        Stone::Sandstone => every_texel(size, sandstone(layers)),
        Stone::Concrete => every_texel(size, concrete(layers)),
    };
    let width = size as usize;
    let mut height: Vec<f32> = texels.iter().map(|texel| texel.height_mm).collect();
    let mean = height.iter().sum::<f32>() / height.len() as f32;
    for height in &mut height {
        *height -= mean;
    }
    let occlusion = occlusion(&height, width);
    let colours: Vec<Vec3> =
        texels.iter().zip(&occlusion).map(|(texel, light)| texel.albedo * *light).collect();
    let gain = stone.albedo() * colours.len() as f32 / colours.iter().copied().sum::<Vec3>();

    let albedo = colours.iter().flat_map(|&colour| {
        let [r, g, b] = (colour * gain).to_array().map(|value| unorm8(srgb_from_linear(value)));
        [r, g, b, 255]
    });
    let normal = normals(&height, width).into_iter().flat_map(|normal| {
        let [x, y, z] = (normal * 0.5 + 0.5).to_array().map(unorm8);
        [x, y, z, 255]
    });
    let roughness = texels
        .iter()
        .zip(&occlusion)
        .flat_map(|(texel, light)| [unorm8(*light), unorm8(texel.roughness), 0, 255]);
    let (linear, srgb) = (TextureFormat::Rgba8Unorm, TextureFormat::Rgba8UnormSrgb);
    StoneMaps {
        albedo: texture(albedo.collect(), size, srgb, MipContent::Values),
        normal: texture(normal.collect(), size, linear, MipContent::Normals),
        roughness: texture(roughness.collect(), size, linear, MipContent::Values),
        height,
    }
}

fn every_texel(size: u32, recipe: impl Fn(Vec2) -> Texel) -> Vec<Texel> {
    let places = (0..size).flat_map(|y| (0..size).map(move |x| Vec2::new(x as f32, y as f32) + 0.5));
    places.map(|place| recipe(place / size as f32)).collect()
}

fn texture(texels: Vec<u8>, size: u32, format: TextureFormat, content: MipContent) -> Image {
    let srgb = format == TextureFormat::Rgba8UnormSrgb;
    let (data, levels) = mip_chain(texels, size, size, content, srgb);
    let extent = Extent3d { width: size, height: size, depth_or_array_layers: 1 };
    let mut image = Image::new_uninit(extent, TextureDimension::D2, format, RenderAssetUsages::default());
    image.data = Some(data);
    image.texture_descriptor.mip_level_count = levels;
    image.sampler = tiling_sampler();
    image
}

#[cfg(test)]
mod tests {
    use super::super::mips::linear_from_srgb;
    use super::*;
    use bevy::image::{ImageAddressMode, ImageSampler};

    const SIZE: usize = 256;

    fn every_stone() -> impl Iterator<Item = (Stone, StoneMaps)> {
        Stone::ALL.into_iter().map(|stone| (stone, stone_maps(stone, SIZE as u32, 11)))
    }

    /// The texels of the first level, channels `0..=1`.
    fn texels(image: &Image) -> Vec<Vec3> {
        let data = image.data.as_ref().expect("texels");
        let texel = |t: &[u8]| Vec3::new(f32::from(t[0]), f32::from(t[1]), f32::from(t[2])) / 255.0;
        data.chunks_exact(4).take(SIZE * SIZE).map(texel).collect()
    }

    #[test]
    fn stones_have_the_albedo_they_promise() {
        for (stone, maps) in every_stone() {
            let linear = |texel: Vec3| Vec3::from_array(texel.to_array().map(linear_from_srgb));
            let sum: Vec3 = texels(&maps.albedo).into_iter().map(linear).sum();
            let mean = sum / (SIZE * SIZE) as f32;
            assert!(mean.abs_diff_eq(stone.albedo(), 0.03), "{stone:?}: {mean}");
        }
    }

    #[test]
    fn tiles_meet_without_a_seam() {
        for (stone, maps) in every_stone() {
            for (name, image) in
                [("albedo", &maps.albedo), ("normal", &maps.normal), ("roughness", &maps.roughness)]
            {
                let texels = texels(image);
                // Difference between a column (or row) and the next one; after the last comes the first.
                let step = |i: usize, columns: bool| -> f32 {
                    let index = |i: usize, j: usize| if columns { j * SIZE + i } else { i * SIZE + j };
                    (0..SIZE).map(|j| texels[index(i, j)].distance(texels[index((i + 1) % SIZE, j)])).sum()
                };
                for columns in [true, false] {
                    let inside = (0..SIZE - 1).map(|i| step(i, columns)).sum::<f32>() / (SIZE - 1) as f32;
                    let across = step(SIZE - 1, columns);
                    assert!(across < 1.5 * inside, "{stone:?} {name} {columns}: {across} against {inside}");
                }
            }
        }
    }

    #[test]
    fn normals_are_unit_length_and_face_out() {
        for (stone, maps) in every_stone() {
            let mut mean = Vec3::ZERO;
            for normal in texels(&maps.normal).into_iter().map(|texel| texel * 2.0 - 1.0) {
                assert!((normal.length() - 1.0).abs() < 0.012 && normal.z > 0.1, "{stone:?}: {normal}");
                mean += normal / (SIZE * SIZE) as f32;
            }
            assert!(mean.truncate().length() < 0.02, "{stone:?} leans: {mean}");
        }
    }

    #[test]
    fn images_are_ready_to_use() {
        for (stone, maps) in every_stone() {
            for image in [&maps.albedo, &maps.normal, &maps.roughness] {
                assert_eq!(image.texture_descriptor.mip_level_count, 9, "{stone:?}");
                let bytes = image.data.as_ref().expect("texels").len();
                assert_eq!(bytes, (0..9).map(|level| (SIZE >> level).pow(2) * 4).sum::<usize>());
                let ImageSampler::Descriptor(sampler) = &image.sampler else { panic!("{stone:?}") };
                assert!(matches!(sampler.address_mode_u, ImageAddressMode::Repeat));
                assert!(matches!(sampler.address_mode_v, ImageAddressMode::Repeat));
            }
            for texel in texels(&maps.roughness) {
                assert!(
                    texel.x > 0.2 && (0.5..=1.0).contains(&texel.y) && texel.z == 0.0,
                    "{stone:?}: {texel}"
                );
            }
            let mean = maps.height_mm().iter().sum::<f32>() / (SIZE * SIZE) as f32;
            assert!(maps.height_mm().len() == SIZE * SIZE && mean.abs() < 1e-3, "{stone:?}: {mean}");
        }
    }

    #[test]
    fn the_seed_decides_and_nothing_else() {
        let of = |seed| stone_maps(Stone::Sandstone, 64, seed).albedo.data;
        assert_eq!(of(1), of(1));
        assert_ne!(of(1), of(2));
        let tiny = stone_maps(Stone::Concrete, 0, 1);
        assert_eq!(tiny.albedo.width(), 16);
    }
}
