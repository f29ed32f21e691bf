//! Tileable close-ups of stone, of ground and of cloth, grown from noise: terracotta, sandstone, concrete,
//! brickwork, beach sand, asphalt and linen.
//!
//! One tile is a patch [`Stone::tile_mm`] wide. For every texel a recipe adds up what is seen on such a patch,
//! coarse to fine, as colour and as height in millimetres: bedding, mottling, turning marks, pits, and at
//! the end single grains with a colour and a dome each, or threads that go over and under. Hollows, where
//! the height lies below its own blur, are darkened by the light they lose. The normal map is the slope of
//! that same height, so relief, colour and occlusion belong together. At last the colours are scaled to the mean albedo of [`Stone::albedo`].
//! How water acts from place to place follows from the height as well, see [`StoneMaps::surface_map`].
//!
//! Tiling. Bricks and threads are numbered, grains, pits and spots live in numbered cells, and the numbers
//! wrap, so they repeat exactly, as do ripples, of which a tile holds a whole number. The noise does not
//! repeat by itself: over the last quarter of the tile, along either axis, it is exchanged smoothly for the
//! noise from before the tile's first edge. Uncorrelated noises lose contrast when averaged; the sum is
//! divided by the root of its squared weights, which gives it back (Heitz and Neyret, "High-performance
//! by-example noise using a histogram-preserving blending operator", 2018).
//!
//! What this does not do: it does not measure a stone, the recipes were chosen by eye; and it does not
//! hide repetition, a wall of many tiles shows its pattern as a photograph would.

mod brick;
mod grounds;
mod kinds;
mod noise;
mod relief;

use bevy::asset::RenderAssetUsages;
use bevy::math::{DVec3, Vec2, Vec3};
use bevy::prelude::Image;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mips::{MipContent, mip_chain, srgb_from_linear, tiling_sampler, unorm8};
use brick::brick;
use grounds::{asphalt, linen, sand};
use kinds::{Texel, concrete, sandstone, terracotta};
use noise::Layers;
use relief::{normals, occlusion, span_mm};

/// A kind of stone, or of ground or cloth.
#[derive(Serialize, Deserialize, JsonSchema, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stone {
    /// Fired clay from the wheel: fine, mottled, turning marks along u, specks of temper, a few scratches.
    Terracotta,
    /// Warm sand, grain by grain, bedded along u, with iron spots and pits.
    Sandstone,
    /// Grey cement skin with the pores that air bubbles leave.
    Concrete,
    /// Moulded bricks, 215 by 65 mm, in running bond with recessed joints of sandy mortar: a wall with its
    /// courses along u, or paving.
    Brick,
    /// Dry beach sand, grain by grain, quartz and ochre with a few dark grains and bits of shell; soft wind
    /// ripples, 57 mm from one to the next and 3 mm high, with their crests along u.
    Sand,
    /// A road: stones of 3 to 11 mm packed in bitumen, their tops worn bare, with a few hairline cracks.
    Asphalt,
    /// Off-white linen in plain weave, a thread a millimetre, uneven as it was spun; one way along u, the
    /// other along v.
    Linen,
}

impl Stone {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Terracotta,
        Self::Sandstone,
        Self::Concrete,
        Self::Brick,
        Self::Sand,
        Self::Asphalt,
        Self::Linen,
    ];

    /// Mean diffuse albedo of the dry stone, linear RGB, `0..=1`. For brickwork that includes the mortar; the
    /// faces of the bricks alone come to (0.42, 0.20, 0.13).
    pub fn albedo(self) -> Vec3 {
        match self {
            Self::Terracotta => Vec3::new(0.50, 0.23, 0.13),
            Self::Sandstone => Vec3::new(0.45, 0.36, 0.25),
            Self::Concrete => Vec3::new(0.40, 0.38, 0.35),
            Self::Brick => Vec3::new(0.415, 0.225, 0.155),
            Self::Sand => Vec3::new(0.48, 0.39, 0.27),
            Self::Asphalt => Vec3::new(0.12, 0.12, 0.12),
            Self::Linen => Vec3::new(0.62, 0.58, 0.50),
        }
    }

    /// Edge of a tile in millimetres; the relief has natural slopes at that scale.
    pub fn tile_mm(self) -> f32 {
        match self {
            Self::Terracotta | Self::Sandstone | Self::Concrete | Self::Sand => 400.0,
            Self::Brick => brick::TILE_MM,
            Self::Asphalt => 600.0,
            Self::Linen => 100.0,
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

    /// How water acts from place to place, for [`WettingTextures`](crate::material::WettingTextures):
    /// `Rgba8Unorm` with mip maps and a repeating sampler, linear.
    ///
    /// Green is the height, from 0 at the hundredth of the texels that lie lowest to 1 at the hundredth that
    /// lie highest, over [`StoneMaps::relief_mm`]. Red is the porosity, `0.3..=1`: recesses, where dust and
    /// loose grains gather, soak up more than tops, which are worn or burnt dense. Blue is 0, alpha 1.
    pub fn surface_map(&self) -> Image {
        let (low, high) = span_mm(&self.height);
        let span = (high - low).max(f32::MIN_POSITIVE);
        let texels = self.height.iter().flat_map(|height| {
            let height = ((height - low) / span).clamp(0.0, 1.0);
            [unorm8(1.0 - 0.7 * height), unorm8(height), 0, 255]
        });
        let size = self.height.len().isqrt() as u32;
        texture(texels.collect(), size, TextureFormat::Rgba8Unorm, MipContent::Values)
    }

    /// What the height in [`StoneMaps::surface_map`] spans from 0 to 1, in millimetres.
    pub fn relief_mm(&self) -> f32 {
        let (low, high) = span_mm(&self.height);
        high - low
    }
}

/// Grows a stone.
///
/// `size` is the edge of the maps in texels, held within 16 and 4096. Below 1024 the finest grains are
/// drawn larger instead of being lost, below 400 threads too. The result depends on the arguments alone;
/// 1024 takes one to two seconds on one core.
pub fn stone_maps(stone: Stone, size: u32, seed: u32) -> StoneMaps {
    let size = size.clamp(16, 4096);
    let layers = Layers { seed, finest: size as f32 / 3.0, tile_mm: stone.tile_mm() };
    let texels: Vec<Texel> = match stone {
        Stone::Terracotta => every_texel(size, terracotta(layers)),
        Stone::Sandstone => every_texel(size, sandstone(layers)),
        Stone::Concrete => every_texel(size, concrete(layers)),
        Stone::Brick => every_texel(size, brick(layers)),
        Stone::Sand => every_texel(size, sand(layers)),
        Stone::Asphalt => every_texel(size, asphalt(layers)),
        Stone::Linen => every_texel(size, linen(layers)),
    };
    let width = size as usize;
    let mut height: Vec<f32> = texels.iter().map(|texel| texel.height_mm).collect();
    // Sums are in double precision: 16 million texels are too many for single.
    let mean = (height.iter().copied().map(f64::from).sum::<f64>() / height.len() as f64) as f32;
    for height in &mut height {
        *height -= mean;
    }
    let occlusion = occlusion(&height, width);
    let colours: Vec<Vec3> =
        texels.iter().zip(&occlusion).map(|(texel, light)| texel.albedo * *light).collect();
    let sum: DVec3 = colours.iter().map(|colour| colour.as_dvec3()).sum();
    let gain = stone.albedo() / (sum / colours.len() as f64).as_vec3();

    let albedo = colours.iter().flat_map(|&colour| {
        let [r, g, b] = (colour * gain).to_array().map(|value| unorm8(srgb_from_linear(value)));
        [r, g, b, 255]
    });
    let normal = normals(&height, width, stone.tile_mm()).into_iter().flat_map(|normal| {
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
    fn bricks_stand_out_of_rougher_mortar() {
        for seed in [1, 11] {
            let maps = stone_maps(Stone::Brick, SIZE as u32, seed);
            let (albedo, roughness) = (texels(&maps.albedo), texels(&maps.roughness));
            // Share of the tile, mean albedo and mean roughness where the relief is within the bounds.
            let mean = |least: f32, most: f32| {
                let here: Vec<usize> =
                    (0..SIZE * SIZE).filter(|&i| (least..most).contains(&maps.height_mm()[i])).collect();
                let count = here.len() as f32;
                let linear = |&i: &usize| Vec3::from_array(albedo[i].to_array().map(linear_from_srgb));
                let rough = here.iter().map(|&i| roughness[i].y).sum::<f32>() / count;
                (count / (SIZE * SIZE) as f32, here.iter().map(linear).sum::<Vec3>() / count, rough)
            };
            let (faces, brick, brick_rough) = mean(-0.8, 9.0);
            let (joints, mortar, mortar_rough) = mean(-9.0, -2.0);
            assert!((0.7..0.85).contains(&faces) && (0.1..0.25).contains(&joints), "{faces} and {joints}");
            assert!(brick.abs_diff_eq(Vec3::new(0.42, 0.20, 0.13), 0.03), "{brick}");
            assert!(mortar.z > 0.5 * mortar.x && mortar.z > 1.5 * brick.z, "{mortar}");
            assert!(mortar_rough > brick_rough + 0.05, "{mortar_rough} and {brick_rough}");
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
    fn normals_are_the_slope_of_the_relief() {
        for (stone, maps) in every_stone() {
            let two_texels_mm = 2.0 * stone.tile_mm() / SIZE as f32;
            let height = |x: usize, y: usize| maps.height_mm()[(y % SIZE) * SIZE + x % SIZE];
            for (i, texel) in texels(&maps.normal).into_iter().enumerate() {
                let (x, y) = (i % SIZE + SIZE, i / SIZE + SIZE);
                let right = (height(x + 1, y) - height(x - 1, y)) / two_texels_mm;
                let down = (height(x, y + 1) - height(x, y - 1)) / two_texels_mm;
                let expected = Vec3::new(-right, down, 1.0).normalize();
                let normal = texel * 2.0 - 1.0;
                assert!(normal.abs_diff_eq(expected, 0.01), "{stone:?} {i}: {normal}, slope {expected}");
            }
        }
    }

    #[test]
    fn images_are_ready_to_use() {
        for (stone, maps) in every_stone() {
            let surface = maps.surface_map();
            for image in [&maps.albedo, &maps.normal, &maps.roughness, &surface] {
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
    fn surface_maps_hold_the_relief_and_what_it_does_to_porosity() {
        for (stone, maps) in every_stone() {
            let (image, relief) = (maps.surface_map(), maps.relief_mm());
            assert_eq!(image.texture_descriptor.format, TextureFormat::Rgba8Unorm, "{stone:?}");
            let data = image.data.as_ref().expect("texels");
            let (mut lowest, mut highest) = (0, 0);
            // Where the height is not cut off: what 0 stands for.
            let (mut least, mut most) = (f32::MAX, f32::MIN);
            for (texel, &height) in data.chunks_exact(4).zip(maps.height_mm()) {
                let (porosity, level) = (f32::from(texel[0]), f32::from(texel[1]));
                assert!((porosity - (255.0 - 0.7 * level)).abs() <= 1.0, "{stone:?}: {texel:?}");
                assert_eq!(texel[2..], [0, 255], "{stone:?}");
                match texel[1] {
                    0 => lowest += 1,
                    255 => highest += 1,
                    _ => {
                        let base = height - relief * level / 255.0;
                        (least, most) = (least.min(base), most.max(base));
                    }
                }
            }
            assert!((0.0..1.1 / 255.0).contains(&((most - least) / relief)), "{stone:?}: {least} to {most}");
            for cut in [lowest, highest] {
                let share = cut as f32 / (SIZE * SIZE) as f32;
                assert!((0.009..0.1).contains(&share), "{stone:?}: {share}");
            }
        }
    }

    #[test]
    fn grounds_have_the_relief_they_promise() {
        for size in [64, SIZE as u32] {
            for (stone, expected) in
                [(Stone::Sand, 3.0..6.0), (Stone::Asphalt, 2.0..3.0), (Stone::Linen, 0.25..0.4)]
            {
                let relief = stone_maps(stone, size, 11).relief_mm();
                assert!(expected.contains(&relief), "{stone:?} at {size}: {relief} mm");
            }
        }
    }

    #[test]
    fn the_seed_decides_and_nothing_else() {
        for stone in Stone::ALL {
            let of = |seed| stone_maps(stone, 64, seed).albedo.data;
            assert_eq!(of(1), of(1), "{stone:?}");
            assert_ne!(of(1), of(2), "{stone:?}");
        }
        let tiny = stone_maps(Stone::Concrete, 0, 1);
        assert_eq!(tiny.albedo.width(), 16);
    }
}
