//! Pictures of what flies: a texture array made in code.
//!
//! Each [`Sprite`] has [`VARIANTS`] tiles, a layer each: drops and stones that differ, or the frames of a splash. A tile
//! is drawn by a plain function of the place on it, in a file per matter, so that nothing is loaded and everything comes
//! out the same. It holds no light, only what light needs: the normal, how bright the place is by itself, and how much of
//! it is covered, which also weighs the rest so that all may be averaged. Mip maps are averages within a tile; layers
//! do not bleed into each other.

use bevy::asset::RenderAssetUsages;
use bevy::image::{ImageSampler, ImageSamplerDescriptor};
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};

use super::crown::Crown;
use super::flake::Flake;
use super::stone::{Clod, Grain};
use super::water;

/// What a tile shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Sprite {
    /// A drop that falls while the shutter is open.
    Streak,
    /// A drop.
    Drop,
    /// A snow crystal.
    Flake,
    /// A grain of sand.
    Grain,
    /// A lump of earth.
    Clod,
    /// A drop that hits; its variants are the frames of its life.
    Splash,
}

impl Sprite {
    /// All, in the order of their tiles.
    pub const ALL: [Self; 6] = [Self::Streak, Self::Drop, Self::Flake, Self::Grain, Self::Clod, Self::Splash];
}

impl From<crate::effect::Sprite> for Sprite {
    fn from(sprite: crate::effect::Sprite) -> Self {
        use crate::effect::Sprite as Look;
        match sprite {
            Look::Streak => Self::Streak,
            Look::Drop => Self::Drop,
            Look::Flake => Self::Flake,
            Look::Grain => Self::Grain,
            Look::Clod => Self::Clod,
        }
    }
}

/// Tiles of a [`Sprite`]. The shader has it, too.
pub(super) const VARIANTS: u32 = 8;
/// Texels along a tile.
const SIDE: usize = 64;
/// Part of a tile that a thing fills along either side; the rest keeps it off the border. The shader has it, too.
pub(super) const FILL: f32 = 0.875;
/// Places looked at within a texel, along either side.
const SAMPLES: usize = 2;

/// What there is at a place of a tile.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Texel {
    /// Normal along the tile's right and up, at most 1 long; the rest of it looks at the eye.
    pub(super) slope: Vec2,
    /// How bright it is by itself, 0..=1. Of water, 0.5 is as bright as what it refracts.
    pub(super) shade: f32,
    /// Part of it that is covered, 0..=1.
    pub(super) cover: f32,
}

impl Texel {
    /// Nothing.
    pub(super) const NONE: Self = Self { slope: Vec2::ZERO, shade: 0.0, cover: 0.0 };

    /// As it is stored: slope around 0.5 and shade, times cover; cover.
    fn premultiplied(self) -> Vec4 {
        let slope = self.slope.clamp_length_max(1.0) * 0.5 + 0.5;
        Vec4::new(slope.x, slope.y, self.shade, 1.0) * self.cover
    }
}

/// One of the tiles, `at` from -1 to 1 where the thing ends, y upwards.
pub(super) fn draw_tile(sprite: Sprite, variant: u32) -> Vec<Vec4> {
    match sprite {
        Sprite::Streak => paint(|at| water::streak(variant, at)),
        Sprite::Drop => paint(|at| water::drop(variant, at)),
        Sprite::Flake => {
            let flake = Flake::new(variant);
            paint(|at| flake.at(at))
        }
        Sprite::Grain => {
            let grain = Grain::new(variant);
            paint(|at| grain.at(at))
        }
        Sprite::Clod => {
            let clod = Clod::new(variant);
            paint(|at| clod.at(at))
        }
        Sprite::Splash => {
            let crown = Crown::new((variant as f32 + 0.5) / VARIANTS as f32);
            paint(|at| crown.at(at))
        }
    }
}

fn paint(shape: impl Fn(Vec2) -> Texel) -> Vec<Vec4> {
    let texel = |x: usize, y: usize| {
        let mut sum = Vec4::ZERO;
        for sample in 0..SAMPLES * SAMPLES {
            let inside = Vec2::new((sample % SAMPLES) as f32, (sample / SAMPLES) as f32) + 0.5;
            let place = (Vec2::new(x as f32, y as f32) + inside / SAMPLES as f32) * (2.0 / SIDE as f32) - 1.0;
            // In texels; the outermost are left empty, so that nothing is cut off where the quad ends.
            let from_border = (1.0 - place.abs().max_element()) * (SIDE as f32 * 0.5);
            let at = Vec2::new(place.x, -place.y) / FILL;
            sum += shape(at).premultiplied() * (from_border - 1.0).clamp(0.0, 1.0);
        }
        sum / (SAMPLES * SAMPLES) as f32
    };
    (0..SIDE * SIDE).map(|i| texel(i % SIDE, i / SIDE)).collect()
}

/// The next level of a tile, half as wide.
fn halved(level: &[Vec4], side: usize) -> Vec<Vec4> {
    let pair = |x: usize, y: usize| level[y * side + x] + level[y * side + x + 1];
    let half = side / 2;
    let mean = |x: usize, y: usize| (pair(2 * x, 2 * y) + pair(2 * x, 2 * y + 1)) / 4.0;
    (0..half * half).map(|i| mean(i % half, i / half)).collect()
}

/// All tiles, the layer of one being `sprite * VARIANTS + variant`.
pub(super) fn sprite_atlas() -> Image {
    let levels = SIDE.ilog2() + 1;
    let mut data = Vec::new();
    for sprite in Sprite::ALL {
        for variant in 0..VARIANTS {
            let (mut level, mut side) = (draw_tile(sprite, variant), SIDE);
            loop {
                let byte = |value: f32| (value * 255.0).round().clamp(0.0, 255.0) as u8;
                data.extend(level.iter().flat_map(|texel| texel.to_array().map(byte)));
                if side == 1 {
                    break;
                }
                level = halved(&level, side);
                side /= 2;
            }
        }
    }
    let layers = Sprite::ALL.len() as u32 * VARIANTS;
    let mut image = Image::new_uninit(
        Extent3d { width: SIDE as u32, height: SIDE as u32, depth_or_array_layers: layers },
        TextureDimension::D2,
        TextureFormat::Rgba8Unorm,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.data = Some(data);
    image.texture_descriptor.label = Some("particle sprites");
    image.texture_descriptor.mip_level_count = levels;
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        // A streak is some pixels wide and hundreds long.
        anisotropy_clamp: 16,
        ..ImageSamplerDescriptor::linear()
    });
    image
}

/// A number from 0 up to, but not including, 1, for each pair.
pub(super) fn random(seed: u32, which: u32) -> f32 {
    let mut h = seed.wrapping_mul(0x9e37_79b9) ^ which.wrapping_mul(0xcc9e_2d51) ^ 0x27d4_eb2f;
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^= h >> 16;
    (h >> 8) as f32 / 16_777_216.0
}

/// 0 up to `from`, 1 beyond `to`, without a kink; `from` may be the larger.
pub(super) fn smoothstep(from: f32, to: f32, at: f32) -> f32 {
    let part = ((at - from) / (to - from)).clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tiles() -> impl Iterator<Item = (Sprite, u32, Vec<Vec4>)> {
        let all = Sprite::ALL.into_iter().flat_map(|sprite| (0..VARIANTS).map(move |i| (sprite, i)));
        all.map(|(sprite, i)| (sprite, i, draw_tile(sprite, i)))
    }

    fn covered(tile: &[Vec4]) -> f32 {
        tile.iter().map(|texel| texel.w).sum::<f32>() / tile.len() as f32
    }

    #[test]
    fn tiles_hold_something_and_end_before_their_border() {
        for (sprite, variant, tile) in tiles() {
            for i in 0..SIDE {
                for at in [i, (SIDE - 1) * SIDE + i, i * SIDE, i * SIDE + SIDE - 1] {
                    assert_eq!(tile[at], Vec4::ZERO, "{sprite:?} {variant} {at}");
                }
            }
            let covered = covered(&tile);
            assert!(covered > 0.008 && covered < 0.9, "{sprite:?} {variant}: {covered}");
        }
    }

    #[test]
    fn texels_can_be_stored_and_averaged() {
        for (sprite, variant, tile) in tiles() {
            for texel in tile {
                assert!(texel.is_finite(), "{sprite:?} {variant}");
                assert!(texel.min_element() >= 0.0 && texel.w <= 1.0 + 1e-6, "{sprite:?} {variant}: {texel}");
                // Premultiplied: none is more than what is covered.
                assert!(texel.truncate().max_element() <= texel.w + 1e-5, "{sprite:?} {variant}: {texel}");
            }
        }
    }

    #[test]
    fn no_two_tiles_of_a_sprite_are_alike() {
        let all: Vec<_> = tiles().collect();
        for (sprite, variant, tile) in &all {
            for (_, other, against) in all.iter().filter(|(kind, other, _)| kind == sprite && other < variant)
            {
                let apart: f32 = tile.iter().zip(against).map(|(a, b)| (*a - *b).abs().max_element()).sum();
                assert!(apart / tile.len() as f32 > 1e-3, "{sprite:?} {other} {variant}: {apart}");
            }
        }
    }

    #[test]
    fn levels_keep_what_is_covered() {
        let tile = draw_tile(Sprite::Flake, 3);
        let small = halved(&halved(&tile, SIDE), SIDE / 2);
        assert_eq!(small.len(), (SIDE / 4).pow(2));
        assert!((covered(&small) - covered(&tile)).abs() < 1e-4);
    }

    #[test]
    fn the_atlas_has_a_layer_for_each_tile_with_all_its_levels() {
        let atlas = sprite_atlas();
        let texels: usize = (0..=SIDE.ilog2()).map(|level| (SIDE >> level).pow(2)).sum();
        let layers = atlas.texture_descriptor.size.depth_or_array_layers;
        assert_eq!(layers, 6 * VARIANTS);
        assert_eq!(atlas.texture_descriptor.mip_level_count, SIDE.ilog2() + 1);
        assert_eq!(atlas.data.unwrap().len(), layers as usize * texels * 4);
    }

    #[test]
    fn the_shader_counts_tiles_as_they_are_laid_out() {
        let shader = include_str!("../../../shaders/particles.wgsl");
        let has = |line: String| assert!(shader.lines().any(|found| found == line), "{line}");
        has(format!("const VARIANTS: u32 = {VARIANTS}u;"));
        has(format!("const FILL: f32 = {FILL};"));
        for (number, sprite) in Sprite::ALL.into_iter().enumerate() {
            assert_eq!(sprite as usize, number);
            has(format!("const {}: u32 = {number}u;", format!("{sprite:?}").to_uppercase()));
        }
    }
}
