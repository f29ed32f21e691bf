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
//! by-example noise using a histogram-preserving blending operator", 2018, section 4).
//!
//! What this does not do: it does not measure a stone, the recipes were chosen by eye; and it does not
//! hide repetition, a wall of many tiles shows its pattern as a photograph would.

use bevy::asset::RenderAssetUsages;
use bevy::math::{IVec2, Vec2, Vec3};
use bevy::prelude::Image;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use fastnoise_lite::{FastNoiseLite, FractalType};

use super::mips::{MipContent, mip_chain, srgb_from_linear, tiling_sampler, unorm8};

/// Edge of a tile in millimetres of stone; the relief has natural slopes at that scale.
pub const TILE_MM: f32 = 400.0;

/// A kind of stone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
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
/// drawn larger instead of being lost. The result depends on the arguments alone; 1024 takes about a
/// second on one core.
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
    height.iter_mut().for_each(|height| *height -= mean);
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

/// What a recipe says about one place.
struct Texel {
    /// Linear, before occlusion and before the scaling to the stone's mean.
    albedo: Vec3,
    height_mm: f32,
    roughness: f32,
}

fn every_texel(size: u32, recipe: impl Fn(Vec2) -> Texel) -> Vec<Texel> {
    let places = (0..size).flat_map(|y| (0..size).map(move |x| Vec2::new(x as f32, y as f32) + 0.5));
    places.map(|place| recipe(place / size as f32)).collect()
}

fn sandstone(layers: Layers) -> impl Fn(Vec2) -> Texel {
    let warp = layers.noise(1, Vec2::new(2.0, 2.0), 3);
    let beds = layers.noise(2, Vec2::new(0.6, 9.0), 4);
    let laminae = layers.noise(3, Vec2::new(1.5, 60.0), 3);
    let mottle = layers.noise(4, Vec2::new(5.0, 5.0), 4);
    let ragged = layers.noise(5, Vec2::new(28.0, 28.0), 3);
    let rough = layers.noise(6, Vec2::new(70.0, 70.0), 3);
    let (grains, fine_grains) = (layers.cells(7, 230.0), layers.cells(8, 420.0));
    let (iron, pits, small_pits) = (layers.cells(9, 9.0), layers.cells(10, 26.0), layers.cells(11, 75.0));
    move |uv| {
        // Beds are tilted and bent a little, spots and pits have ragged outlines.
        let bent = uv + Vec2::new(0.0, 0.018 * warp.at(uv));
        let edge = uv + 0.0035 * Vec2::new(ragged.at(uv), ragged.at(uv + 0.5));
        let bed = beds.at(bent);
        let lamina = laminae.at(bent);
        let mottle = mottle.at(uv);
        let ragged = ragged.at(uv);
        let grain = grains.nearest(uv);
        let fine = fine_grains.nearest(uv);
        let iron = iron.spot(edge, 0.30, 0.03, 0.20);
        let pit = pits.spot(edge, 0.16, 0.06, 0.36);
        let small_pit = small_pits.spot(edge, 0.28, 0.08, 0.34);

        let ochre = smoothstep(-0.55, 0.65, bed + 0.35 * lamina + 0.25 * mottle);
        let mut albedo = Vec3::new(0.52, 0.43, 0.305).lerp(Vec3::new(0.47, 0.34, 0.205), ochre);
        albedo *= 1.0 + 0.10 * lamina + 0.10 * mottle + 0.06 * ragged;
        // Quartz is pale, feldspar pinkish, a few grains are dark minerals.
        let tint = match grain.chance(1) {
            dark if dark < 0.012 => Vec3::new(0.46, 0.40, 0.36),
            pink if pink < 0.16 => Vec3::new(1.08, 0.94, 0.84),
            pale if pale < 0.36 => Vec3::new(1.24, 1.24, 1.22),
            _ => Vec3::splat(0.80 + 0.40 * grain.chance(2)),
        };
        let speck = if fine.chance(2) < 0.02 { 0.50 } else { 0.84 + 0.32 * fine.chance(1) };
        albedo *= tint * speck;
        let rust = smoothstep(0.0, 0.7, iron + 0.35 * ragged * iron.signum());
        albedo = albedo.lerp(albedo * Vec3::new(0.54, 0.34, 0.24), 0.65 * rust);
        let hollow = smoothstep(0.0, 0.45, pit);
        // Where the cement between the grains is weak, they have fallen out in swarms.
        let small_hollow = smoothstep(0.0, 0.5, small_pit) * smoothstep(0.0, 0.5, mottle + 0.4 * bed);
        albedo *= 1.0 - 0.30 * hollow - 0.22 * small_hollow;

        let height_mm = 0.30 * bed
            + 0.16 * lamina
            + 0.14 * rough.at(uv)
            + 0.2 * ragged * 0.5
            + grains.dome_mm(&grain, 0.20) * (0.6 + 0.8 * grain.chance(3))
            + fine_grains.dome_mm(&fine, 0.12)
            + 0.15 * rust
            - 1.5 * hollow
            - 0.6 * small_hollow;
        let glint = if (0.16..0.36).contains(&grain.chance(1)) { 0.12 } else { 0.0 };
        Texel { albedo, height_mm, roughness: 0.90 - glint + 0.04 * mottle }
    }
}

fn terracotta(layers: Layers) -> impl Fn(Vec2) -> Texel {
    let clouds = layers.noise(1, Vec2::new(2.5, 3.5), 4);
    let mottle = layers.noise(2, Vec2::new(14.0, 18.0), 4);
    let turning = layers.noise(3, Vec2::new(0.35, 22.0), 2);
    let combing = layers.noise(4, Vec2::new(0.9, 90.0), 2);
    let skin = layers.noise(5, Vec2::new(90.0, 90.0), 3);
    let bloom = layers.noise(6, Vec2::new(4.0, 3.0), 5);
    let wobble = layers.noise(7, Vec2::new(3.0, 3.0), 2);
    let clay = layers.cells(8, 430.0);
    let (temper, lime, pores) = (layers.cells(9, 120.0), layers.cells(10, 34.0), layers.cells(11, 60.0));
    let scratches = layers.scratches(12, 28);
    move |uv| {
        let edge = uv + 0.0012 * Vec2::new(skin.at(uv), skin.at(uv + 0.5));
        let bent = uv + Vec2::new(0.0, 0.004 * wobble.at(uv));
        let (clouds, mottle, skin) = (clouds.at(uv), mottle.at(uv), skin.at(uv));
        let (turning, combing) = (turning.at(bent), combing.at(bent));
        let clay_grain = clay.nearest(uv);
        let temper = temper.spot(edge, 0.30, 0.10, 0.30);
        let lime = lime.spot(edge, 0.10, 0.04, 0.12);
        let pore = pores.spot(edge, 0.14, 0.05, 0.20);
        let scratch = scratches.depth(bent + 0.002 * Vec2::splat(mottle));

        let fired = smoothstep(-0.7, 0.7, clouds + 0.5 * mottle);
        let mut albedo = Vec3::new(0.46, 0.205, 0.112).lerp(Vec3::new(0.545, 0.258, 0.148), fired);
        albedo *= 1.0 + 0.06 * mottle + 0.03 * turning + 0.03 * combing + 0.07 * skin;
        albedo *= 0.84 + 0.32 * clay_grain.chance(1);
        // Salts carried out by water while it dried.
        let pale = smoothstep(0.1, 1.0, bloom.at(uv) + 0.5 * mottle + 0.9 * skin);
        albedo = albedo.lerp(Vec3::new(0.66, 0.43, 0.30), 0.20 * pale);
        let speck = smoothstep(0.0, 0.5, temper);
        let dark = if clay_grain.chance(2) < 0.5 { 0.32 } else { 0.16 };
        albedo *= 1.0 - dark * speck;
        albedo = albedo.lerp(Vec3::new(0.72, 0.58, 0.45), 0.8 * smoothstep(0.0, 0.4, lime));
        let hollow = smoothstep(0.0, 0.5, pore);
        albedo *= 1.0 - 0.35 * hollow;
        albedo = albedo.lerp(albedo * Vec3::new(1.22, 1.30, 1.34), scratch);

        let height_mm = 0.55 * turning
            + 0.07 * combing
            + 0.10 * mottle
            + 0.07 * skin
            + clay.dome_mm(&clay_grain, 0.10)
            + 0.05 * speck
            - 0.45 * hollow
            - 0.12 * scratch;
        Texel { albedo, height_mm, roughness: 0.80 + 0.05 * mottle + 0.05 * pale + 0.06 * hollow }
    }
}

fn concrete(layers: Layers) -> impl Fn(Vec2) -> Texel {
    let stain = layers.noise(1, Vec2::new(2.0, 2.0), 5);
    let mottle = layers.noise(2, Vec2::new(9.0, 9.0), 5);
    let trowel = layers.noise(3, Vec2::new(3.0, 14.0), 3);
    let skin = layers.noise(4, Vec2::new(60.0, 60.0), 4);
    let (sand, cement) = (layers.cells(5, 150.0), layers.cells(6, 430.0));
    let bubbles = [
        (layers.cells(7, 8.0), 0.40, 0.03, 0.17, 2.6),
        (layers.cells(8, 22.0), 0.38, 0.05, 0.20, 1.4),
        (layers.cells(9, 60.0), 0.34, 0.07, 0.24, 0.7),
    ];
    move |uv| {
        let edge = uv + 0.0018 * Vec2::new(skin.at(uv), skin.at(uv + 0.5));
        let (stain, mottle, trowel, skin) = (stain.at(uv), mottle.at(uv), trowel.at(uv), skin.at(uv));
        let (sand_grain, cement_grain) = (sand.nearest(edge), cement.nearest(uv));
        let mut albedo = Vec3::new(0.40, 0.38, 0.35).lerp(Vec3::new(0.47, 0.46, 0.44), 0.5 + 0.7 * stain);
        albedo *= 1.0 + 0.10 * mottle + 0.05 * trowel + 0.08 * skin;
        // Sand shows through the cement where the skin is thin.
        let bare = smoothstep(-0.1, 0.7, mottle + 0.4 * skin);
        let tint = Vec3::new(1.0, 0.97, 0.92) * (0.72 + 0.56 * sand_grain.chance(1));
        albedo *= Vec3::ONE.lerp(tint, 0.25 + 0.45 * bare);
        albedo *= 0.91 + 0.18 * cement_grain.chance(1);
        let mut height_mm = 0.25 * trowel
            + 0.12 * mottle
            + 0.14 * skin
            + sand.dome_mm(&sand_grain, 0.05) * (0.5 + bare)
            + cement.dome_mm(&cement_grain, 0.07);
        for (cells, share, least, most, depth) in &bubbles {
            let bubble = cells.spot(edge, *share, *least, *most);
            let hollow = smoothstep(0.0, 0.35, bubble);
            albedo *= 1.0 - 0.38 * hollow;
            height_mm -= depth * hollow;
        }
        Texel { albedo, height_mm, roughness: 0.86 + 0.06 * mottle + 0.03 * skin - 0.06 * stain.max(0.0) }
    }
}

/// Makes the ingredients of a recipe, each with its own random numbers.
#[derive(Clone, Copy)]
struct Layers {
    seed: u32,
    /// The most cells per tile that the texels can still show.
    finest: f32,
}

impl Layers {
    /// Noise with `cycles` features per tile along u and v and `octaves` finer ones.
    fn noise(self, layer: u32, cycles: Vec2, octaves: i32) -> Noise {
        let mut source = FastNoiseLite::with_seed(hash([self.seed, layer, 0]) as i32);
        source.set_frequency(Some(1.0));
        source.set_fractal_type(Some(FractalType::FBm));
        source.set_fractal_octaves(Some(octaves));
        Noise { source, cycles: cycles.min(Vec2::splat(self.finest)) }
    }

    /// `per_side * per_side` cells per tile.
    fn cells(self, layer: u32, per_side: f32) -> Cells {
        Cells { per_side: per_side.min(self.finest).max(1.0) as i32, seed: hash([self.seed, layer, 1]) }
    }

    fn scratches(self, layer: u32, count: u32) -> Scratches {
        let scratch = |i: u32| {
            let random = |j: u32| unit(hash([self.seed ^ layer, i, j]));
            let angle = (random(0) - 0.5) * 2.4;
            Scratch {
                middle: Vec2::new(random(1), random(2)),
                along: Vec2::from_angle(angle),
                half_length: 0.02 + 0.16 * random(3) * random(4),
                half_width: 0.0006 + 0.0008 * random(5),
                strength: 0.3 + 0.7 * random(6),
            }
        };
        Scratches((0..count).map(scratch).collect())
    }
}

/// Fractal noise that repeats over the unit square, about -1 to 1; see the module's notes on tiling.
struct Noise {
    source: FastNoiseLite,
    cycles: Vec2,
}

impl Noise {
    fn at(&self, uv: Vec2) -> f32 {
        let uv = uv - uv.floor();
        let late = Vec2::new(smoothstep(0.75, 1.0, uv.x), smoothstep(0.75, 1.0, uv.y));
        let early = 1.0 - late;
        let mut sum = 0.0;
        for (shift, weight) in [
            (Vec2::ZERO, early.x * early.y),
            (Vec2::X, late.x * early.y),
            (Vec2::Y, early.x * late.y),
            (Vec2::ONE, late.x * late.y),
        ] {
            if weight > 0.0 {
                let at = (uv - shift) * self.cycles;
                sum += weight * self.source.get_noise_2d(at.x, at.y);
            }
        }
        // Less than a cycle away, noise still resembles itself and loses less.
        let alike = (1.0 - self.cycles).max(Vec2::ZERO);
        let variance = early * early + late * late + 2.0 * alike * early * late;
        sum / (variance.x * variance.y).sqrt()
    }
}

/// Points scattered one to a cell over the unit square, repeating.
struct Cells {
    per_side: i32,
    seed: u32,
}

/// The point next to a place.
struct Grain {
    /// Distances to the nearest point and to the one after it, in cells.
    nearest: f32,
    second: f32,
    number: u32,
}

impl Grain {
    /// A random number of the grain's own, `0..1`, one for each `which`.
    fn chance(&self, which: u32) -> f32 {
        unit(hash([self.number, which, 2]))
    }
}

impl Cells {
    /// The points of the nine cells around a place: distance in cells, and number.
    fn around(&self, uv: Vec2) -> impl Iterator<Item = (f32, u32)> {
        let at = uv * self.per_side as f32;
        let home = at.floor().as_ivec2();
        let (per_side, seed) = (self.per_side, self.seed);
        (0..9).map(move |i| {
            let cell = home + IVec2::new(i % 3 - 1, i / 3 - 1);
            let (x, y) = (cell.x.rem_euclid(per_side) as u32, cell.y.rem_euclid(per_side) as u32);
            let number = hash([seed, x, y]);
            let jitter = Vec2::new((number >> 16) as f32, (number & 0xffff) as f32) / 65536.0;
            (at.distance(cell.as_vec2() + jitter), number)
        })
    }

    fn nearest(&self, uv: Vec2) -> Grain {
        let mut grain = Grain { nearest: f32::MAX, second: f32::MAX, number: 0 };
        for (distance, number) in self.around(uv) {
            if distance < grain.nearest {
                grain = Grain { nearest: distance, second: grain.nearest, number };
            } else {
                grain.second = grain.second.min(distance);
            }
        }
        grain
    }

    /// Height of a grain in millimetres, 0 where it meets the next; `rise` is in widths of a cell.
    fn dome_mm(&self, grain: &Grain, rise: f32) -> f32 {
        let inside = (grain.second - grain.nearest).clamp(0.0, 1.0);
        rise * TILE_MM / self.per_side as f32 * (1.0 - (1.0 - inside).powi(2))
    }

    /// Round spots, 1 in the middle and 0 at the edge and outside. `share` of the cells have one, with a
    /// radius between `least` and `most` cells (below 0.5), small ones more often.
    fn spot(&self, uv: Vec2, share: f32, least: f32, most: f32) -> f32 {
        let spot = |(distance, number): (f32, u32)| {
            if distance >= most || unit(hash([number, 4, 4])) >= share {
                return 0.0;
            }
            let radius = least + (most - least) * unit(hash([number, 5, 5])).powi(2);
            (1.0 - distance / radius).max(0.0)
        };
        self.around(uv).map(spot).fold(0.0, f32::max)
    }
}

/// A straight, shallow groove.
struct Scratch {
    middle: Vec2,
    along: Vec2,
    half_length: f32,
    half_width: f32,
    strength: f32,
}

struct Scratches(Vec<Scratch>);

impl Scratches {
    /// 0 beside the scratches to 1 in the deepest.
    fn depth(&self, uv: Vec2) -> f32 {
        let depth = |scratch: &Scratch| {
            let away = uv - scratch.middle;
            let away = away - away.round();
            let along = away.dot(scratch.along).abs() / scratch.half_length;
            let across = away.perp_dot(scratch.along).abs() / scratch.half_width;
            scratch.strength * (1.0 - across).max(0.0) * (1.0 - along * along).max(0.0)
        };
        self.0.iter().map(depth).fold(0.0, f32::max)
    }
}

/// How much of the sky's light reaches each texel, `0..=1`: less, the further it lies below its
/// surroundings, at two scales.
fn occlusion(height: &[f32], width: usize) -> Vec<f32> {
    let texels_per_mm = width as f32 / TILE_MM;
    let near = blurred(height, width, (0.8 * texels_per_mm).ceil() as usize);
    let far = blurred(height, width, (3.0 * texels_per_mm).ceil() as usize);
    let light = |i: usize| {
        let below = (near[i] - height[i]).max(0.0) * 0.35 + (far[i] - height[i]).max(0.0) * 0.22;
        1.0 / (1.0 + below)
    };
    (0..height.len()).map(light).collect()
}

/// The mean over a square of `2 * radius + 1` texels, round the edges; `radius` is below `width`.
fn blurred(values: &[f32], width: usize, radius: usize) -> Vec<f32> {
    // One axis at a time: blur along rows and write as columns, twice.
    let pass = |values: &[f32]| {
        let mut out = vec![0.0; values.len()];
        for (y, row) in values.chunks_exact(width).enumerate() {
            let wrapped: Vec<f32> =
                [&row[width - radius..], row, &row[..radius]].into_iter().flatten().copied().collect();
            for (x, window) in wrapped.windows(2 * radius + 1).enumerate() {
                out[x * width + y] = window.iter().sum::<f32>() / window.len() as f32;
            }
        }
        out
    };
    pass(&pass(values))
}

/// Unit normals of a height field in millimetres: x to the right, y to the top, by central differences
/// round the edges.
fn normals(height: &[f32], width: usize) -> Vec<Vec3> {
    let two_texels_mm = 2.0 * TILE_MM / width as f32;
    let at = |x: usize, y: usize| height[(y % width) * width + x % width];
    let normal = |(x, y): (usize, usize)| {
        let right = (at(x + 1, y) - at(x + width - 1, y)) / two_texels_mm;
        // Rows go down, y goes up.
        let up = (at(x, y + width - 1) - at(x, y + 1)) / two_texels_mm;
        Vec3::new(-right, -up, 1.0).normalize()
    };
    (0..width * width).map(|i| normal((i % width, i / width))).collect()
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

fn smoothstep(low: f32, high: f32, value: f32) -> f32 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Three numbers stirred into one: the finaliser of MurmurHash3 after each.
fn hash(numbers: [u32; 3]) -> u32 {
    numbers.into_iter().fold(0x9e37_79b9, |hash, number| {
        let mut h = hash ^ number.wrapping_mul(0xcc9e_2d51);
        h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
        h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
        h ^ (h >> 16)
    })
}

/// A hash as a number from 0 up to, but not including, 1.
fn unit(hash: u32) -> f32 {
    (hash >> 8) as f32 / 16_777_216.0
}
