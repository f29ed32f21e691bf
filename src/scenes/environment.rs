//! A skybox and image-based light from one equirectangular photograph of the surroundings.
//!
//! The photograph is resampled to a cube. From there the light takes two ways, because a surface asks for
//! it in two ways. What a matt surface sees is so smooth that nine numbers hold it: the photograph is
//! projected on the spherical harmonics up to order 2, convolved with the cosine lobe, and written to a
//! small cube. What a glossy surface sees is the environment blurred by the GGX lobe of its roughness: mip
//! level `m` of `n` holds perceptual roughness `m / (n - 1)`, where Bevy looks for it. A few dozen
//! importance samples make that blur, each read from a mip level of the source cube as coarse as the share
//! of the lobe it stands for, which is what keeps a small sun from turning into dots.
//!
//! Directions. The middle of the photograph is world -Z, Bevy's forward, its right edge turns towards +X,
//! its top row is +Y: seen from inside it is not mirrored. Bevy negates z before it samples a cube map,
//! for the skybox and for both kinds of light alike, so the cubes are written in that mirrored space and
//! reflections agree with what is seen.
//!
//! Units. The radiance of the photograph is kept as it is; `EnvironmentMapLight::intensity` and
//! `Skybox::brightness` turn it into cd/m2. The diffuse map holds irradiance divided by pi, so white
//! surroundings of radiance 1 make every texel of every map 1.
//!
//! What this does not do: the view direction is taken to be the normal (the split-sum approximation), so
//! reflections do not stretch at grazing angles. Order 2 rings opposite a very bright light; the negative
//! values that leaves are cut to zero.
//!
//! - Ramamoorthi and Hanrahan, "An efficient representation for irradiance environment maps", 2001
//! - Karis, "Real shading in Unreal Engine 4", 2013 (split sum, weighting by N.L)
//! - Colbert and Krivanek, "GPU-based importance sampling", GPU Gems 3, chapter 20, 2007 (filtered samples)

use std::f32::consts::{PI, TAU};
use std::path::{Path, PathBuf};

use bevy::asset::RenderAssetUsages;
use bevy::image::ImageSampler;
use bevy::math::{Vec2, Vec3};
use bevy::prelude::Image;
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use half::f16;
use image::{DynamicImage, ImageError, ImageReader};
use thiserror::Error;

/// Edge of the smallest level of the specular cube, in texels; smaller ones cannot hold the lobe of
/// roughness 1 with linear filtering.
const SMALLEST_SPECULAR_FACE: u32 = 4;
/// Largest finite half float.
const MAX_HALF: f32 = 65504.0;

/// The cube images of one environment, ready for `EnvironmentMapLight` and `Skybox`.
///
/// All are `Rgba16Float` with six layers, alpha 1, and live in the render world only.
#[derive(Clone, Debug)]
pub struct EnvironmentMaps {
    /// What is seen directly, one level.
    pub skybox: Image,
    /// Irradiance divided by pi, for the direction of the surface normal, one level.
    pub diffuse: Image,
    /// Radiance blurred by the GGX lobe, perceptual roughness 0 in the first level to 1 in the last.
    pub specular: Image,
}

/// Sizes and quality of [`environment_maps_from_equirect`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvironmentSettings {
    /// Edge of a skybox face in texels, 1 to 4096.
    pub skybox_face: u32,
    /// Edge of a face of the diffuse cube in texels, 1 to 4096.
    pub diffuse_face: u32,
    /// Edge of a face of the first specular level in texels, a power of two from 8 to 4096.
    pub specular_face: u32,
    /// Samples of the GGX lobe per texel, 1 to 65,536.
    pub specular_samples: u32,
    /// Brighter light than this (largest channel, in the units of the photograph) is scaled down to it in
    /// the diffuse and specular maps, hue kept. The sun's disc is orders of magnitude brighter than the
    /// rest and belongs to a directional light, which casts shadows. The skybox keeps it.
    pub max_radiance: f32,
}

impl Default for EnvironmentSettings {
    fn default() -> Self {
        Self {
            skybox_face: 256,
            diffuse_face: 16,
            specular_face: 128,
            specular_samples: 128,
            max_radiance: 64.0,
        }
    }
}

/// Why an environment could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EnvironmentError {
    /// The file cannot be opened or read.
    #[error("cannot read environment map {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is not an image, or not one that can be decoded.
    #[error("cannot decode environment map {}", path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// What the decoder says.
        source: ImageError,
    },
    /// The file holds 8 or 16 bit integers, not light.
    #[error("environment map {} holds {found}, not floating-point radiance", path.display())]
    NotRadiance {
        /// The file.
        path: PathBuf,
        /// The colour type found.
        found: String,
    },
    /// The image is not twice as wide as high.
    #[error("an equirectangular image is twice as wide as high, this one is {width} by {height}")]
    NotEquirect {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// The number of pixels is not the width times the height.
    #[error("{width} by {height} pixels were announced, {got} came")]
    PixelCount {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Pixels passed.
        got: usize,
    },
    /// A setting is out of its range.
    #[error("environment setting {name} must be {range}, got {got}")]
    Setting {
        /// The field of [`EnvironmentSettings`].
        name: &'static str,
        /// What it must be.
        range: &'static str,
        /// What it is.
        got: f32,
    },
}

/// Reads an equirectangular image: width, height and linear RGB radiance, row by row from the top left.
///
/// OpenEXR is always understood (not DWA-compressed), Radiance HDR where the `image` crate is built with it.
///
/// # Errors
/// [`EnvironmentError::Read`], [`EnvironmentError::Decode`] and [`EnvironmentError::NotRadiance`].
pub fn load_equirect(path: &Path) -> Result<(u32, u32, Vec<[f32; 3]>), EnvironmentError> {
    let read = |source| EnvironmentError::Read { path: path.into(), source };
    let decode = |source| EnvironmentError::Decode { path: path.into(), source };
    let reader = ImageReader::open(path).map_err(read)?.with_guessed_format().map_err(read)?;
    let image = reader.decode().map_err(decode)?;
    if !matches!(image, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_)) {
        return Err(EnvironmentError::NotRadiance {
            path: path.into(),
            found: format!("{:?}", image.color()),
        });
    }
    let image = image.into_rgb32f();
    let (width, height) = image.dimensions();
    Ok((width, height, image.pixels().map(|pixel| pixel.0).collect()))
}

/// The skybox and the image-based light of an equirectangular image.
///
/// `pixels` are linear RGB radiance, `width * height` of them, row by row from the top left. Pixels that
/// are negative or not a number count as black, infinite ones as the brightest allowed. The result
/// depends on the arguments alone. A 512 by 256 source takes a few tenths of a second on one core.
///
/// # Errors
/// [`EnvironmentError::NotEquirect`], [`EnvironmentError::PixelCount`] and [`EnvironmentError::Setting`].
pub fn environment_maps_from_equirect(
    width: u32,
    height: u32,
    pixels: &[[f32; 3]],
    settings: EnvironmentSettings,
) -> Result<EnvironmentMaps, EnvironmentError> {
    check(width, height, pixels, &settings)?;
    let seen = Equirect::new(width, pixels, MAX_HALF);
    let light = Equirect::new(width, pixels, settings.max_radiance);
    let levels = (settings.specular_face / SMALLEST_SPECULAR_FACE).ilog2() + 1;
    let source = Source::new(light.cube(settings.specular_face));
    let specular: Vec<Cube> = (0..levels)
        .map(|level| {
            let roughness = level as f32 / (levels - 1) as f32;
            let lobe = Lobe::new(roughness, settings.specular_samples, settings.specular_face);
            Cube::new(settings.specular_face >> level, 1, |direction| lobe.radiance(direction, &source))
        })
        .collect();
    let harmonics = light.harmonics();
    let diffuse = Cube::new(settings.diffuse_face, 1, |normal| irradiance_over_pi(&harmonics, normal));
    Ok(EnvironmentMaps {
        skybox: cube_image("skybox", &[seen.cube(settings.skybox_face)]),
        diffuse: cube_image("diffuse environment", &[diffuse]),
        specular: cube_image("specular environment", &specular),
    })
}

fn check(
    width: u32,
    height: u32,
    pixels: &[[f32; 3]],
    settings: &EnvironmentSettings,
) -> Result<(), EnvironmentError> {
    if height == 0 || height.checked_mul(2) != Some(width) {
        return Err(EnvironmentError::NotEquirect { width, height });
    }
    if u64::from(width) * u64::from(height) != pixels.len() as u64 {
        return Err(EnvironmentError::PixelCount { width, height, got: pixels.len() });
    }
    let EnvironmentSettings { skybox_face, diffuse_face, specular_face, specular_samples, max_radiance } =
        *settings;
    let faces = "from 1 to 4096";
    let rows = [
        ("skybox_face", faces, skybox_face as f32, (1..=4096).contains(&skybox_face)),
        ("diffuse_face", faces, diffuse_face as f32, (1..=4096).contains(&diffuse_face)),
        (
            "specular_face",
            "a power of two from 8 to 4096",
            specular_face as f32,
            specular_face.is_power_of_two() && (8..=4096).contains(&specular_face),
        ),
        (
            "specular_samples",
            "from 1 to 65536",
            specular_samples as f32,
            (1..=65536).contains(&specular_samples),
        ),
        (
            "max_radiance",
            "above 0 and at most 65504",
            max_radiance,
            max_radiance > 0.0 && max_radiance <= MAX_HALF,
        ),
    ];
    match rows.into_iter().find(|row| !row.3) {
        Some((name, range, got, _)) => Err(EnvironmentError::Setting { name, range, got }),
        None => Ok(()),
    }
}

/// Where a world direction lies in an equirectangular image, `0..=1` from the left and from the top.
fn equirect_uv(direction: Vec3) -> Vec2 {
    let d = direction.normalize();
    Vec2::new(0.5 + d.x.atan2(-d.z) / TAU, d.y.clamp(-1.0, 1.0).acos() / PI)
}

/// The world direction of a place in an equirectangular image; [`equirect_uv`] the other way.
fn equirect_direction(uv: Vec2) -> Vec3 {
    let (sin_longitude, cos_longitude) = ((uv.x - 0.5) * TAU).sin_cos();
    let (sin_polar, cos_polar) = (uv.y * PI).sin_cos();
    Vec3::new(sin_polar * sin_longitude, cos_polar, -sin_polar * cos_longitude)
}

/// The world direction, not normalised, of a place on a layer of a cube image; `uv` beyond `0..=1` goes on
/// in the plane of the face. Layers and their axes as in every graphics interface, seen through Bevy's
/// negated z.
fn cube_direction(layer: usize, uv: Vec2) -> Vec3 {
    let Vec2 { x: u, y: v } = uv * 2.0 - 1.0;
    let cube = match layer {
        0 => Vec3::new(1.0, -v, -u),
        1 => Vec3::new(-1.0, -v, u),
        2 => Vec3::new(u, 1.0, v),
        3 => Vec3::new(u, -1.0, -v),
        4 => Vec3::new(u, -v, 1.0),
        _ => Vec3::new(-u, -v, -1.0),
    };
    Vec3::new(cube.x, cube.y, -cube.z)
}

/// The layer and the place on it that a world direction hits; [`cube_direction`] the other way.
fn cube_uv(direction: Vec3) -> (usize, Vec2) {
    let d = Vec3::new(direction.x, direction.y, -direction.z);
    let a = d.abs();
    let (layer, u, v, major) = if a.x >= a.y && a.x >= a.z {
        if d.x > 0.0 { (0, -d.z, -d.y, a.x) } else { (1, d.z, -d.y, a.x) }
    } else if a.y >= a.z {
        if d.y > 0.0 { (2, d.x, d.z, a.y) } else { (3, d.x, -d.z, a.y) }
    } else if d.z > 0.0 {
        (4, d.x, -d.y, a.z)
    } else {
        (5, -d.x, -d.y, a.z)
    };
    (layer, Vec2::new(u, v) / major * 0.5 + 0.5)
}

/// The photograph: finite, not negative, and no brighter than asked for.
struct Equirect {
    width: usize,
    pixels: Vec<Vec3>,
}

impl Equirect {
    fn new(width: u32, pixels: &[[f32; 3]], max_radiance: f32) -> Self {
        let clean = |pixel: &[f32; 3]| {
            // `max` drops NaN; the scaling below must not meet an infinity.
            let pixel = Vec3::from_array(pixel.map(|value| value.max(0.0).min(f32::MAX)));
            pixel * (max_radiance / pixel.max_element().max(max_radiance))
        };
        Self { width: width as usize, pixels: pixels.iter().map(clean).collect() }
    }

    fn height(&self) -> usize {
        self.width / 2
    }

    /// Bilinear, round the edge on the left and right.
    fn sample(&self, direction: Vec3) -> Vec3 {
        let (width, height) = (self.width as isize, self.height() as isize);
        let at = equirect_uv(direction) * Vec2::new(width as f32, height as f32) - 0.5;
        let (floor, part) = (at.floor(), at - at.floor());
        let row = |y: isize| {
            let y = y.clamp(0, height - 1);
            let pixel = |x: isize| self.pixels[(y * width + x.rem_euclid(width)) as usize];
            pixel(floor.x as isize).lerp(pixel(floor.x as isize + 1), part.x)
        };
        row(floor.y as isize).lerp(row(floor.y as isize + 1), part.y)
    }

    /// The photograph on a cube, averaged where the cube is coarser.
    fn cube(&self, face: u32) -> Cube {
        // A texel in the middle of a face covers 2 / face radians, a pixel on the horizon 2 pi / width.
        let pixels_per_texel = self.width as f32 / (PI * face as f32);
        Cube::new(face, pixels_per_texel.ceil().max(1.0) as u32, |direction| self.sample(direction))
    }

    /// The radiance projected on the nine spherical harmonics of [`harmonic_basis`].
    fn harmonics(&self) -> [Vec3; 9] {
        let (width, height) = (self.width as f32, self.height() as f32);
        let mut sum = [Vec3::ZERO; 9];
        for (y, row) in self.pixels.chunks_exact(self.width).enumerate() {
            let polar = |y: usize| y as f32 / height * PI;
            let solid_angle = TAU / width * (polar(y).cos() - polar(y + 1).cos());
            // One sum per row first: adding small to large loses less.
            let mut of_row = [Vec3::ZERO; 9];
            for (x, &radiance) in row.iter().enumerate() {
                let uv = Vec2::new((x as f32 + 0.5) / width, (y as f32 + 0.5) / height);
                let basis = harmonic_basis(equirect_direction(uv));
                for (sum, basis) in of_row.iter_mut().zip(basis) {
                    *sum += radiance * basis;
                }
            }
            for (sum, of_row) in sum.iter_mut().zip(of_row) {
                *sum += of_row * solid_angle;
            }
        }
        sum
    }
}

/// Real spherical harmonics up to order 2 for a unit vector, as Ramamoorthi and Hanrahan number them.
fn harmonic_basis(d: Vec3) -> [f32; 9] {
    [
        0.282_095,
        0.488_603 * d.y,
        0.488_603 * d.z,
        0.488_603 * d.x,
        1.092_548 * d.x * d.y,
        1.092_548 * d.y * d.z,
        0.315_392 * (3.0 * d.z * d.z - 1.0),
        1.092_548 * d.x * d.z,
        0.546_274 * (d.x * d.x - d.y * d.y),
    ]
}

/// `E(n) / pi = sum over l, m of (A_l / pi) L_lm Y_lm(n)`, with `A = (pi, 2 pi / 3, pi / 4)` the cosine lobe.
fn irradiance_over_pi(harmonics: &[Vec3; 9], normal: Vec3) -> Vec3 {
    const LOBE: [f32; 9] = [1.0, 2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 0.25, 0.25, 0.25, 0.25, 0.25];
    let basis = harmonic_basis(normal);
    let sum: Vec3 = (0..9).map(|i| harmonics[i] * (LOBE[i] * basis[i])).sum();
    sum.max(Vec3::ZERO)
}

/// One level of a cube image: six layers of `face * face` texels.
struct Cube {
    face: u32,
    layers: [Vec<Vec3>; 6],
}

impl Cube {
    /// Asks `radiance` for the unit direction of every texel, or of `samples * samples` places in each.
    fn new(face: u32, samples: u32, radiance: impl Fn(Vec3) -> Vec3) -> Self {
        let texel = |layer: usize, x: u32, y: u32| {
            let places = (0..samples).flat_map(|j| (0..samples).map(move |i| (i, j)));
            let sum: Vec3 = places
                .map(|(i, j)| {
                    let inside = (Vec2::new(i as f32, j as f32) + 0.5) / samples as f32;
                    let uv = (Vec2::new(x as f32, y as f32) + inside) / face as f32;
                    radiance(cube_direction(layer, uv).normalize())
                })
                .sum();
            sum / (samples * samples) as f32
        };
        let layer =
            |layer| (0..face).flat_map(|y| (0..face).map(move |x| (x, y))).map(move |(x, y)| (layer, x, y));
        Self {
            face,
            layers: [0, 1, 2, 3, 4, 5].map(|i| layer(i).map(|(layer, x, y)| texel(layer, x, y)).collect()),
        }
    }

    /// The next level, each texel the mean of four by the solid angles they cover. A plain mean would give
    /// the corners of a face, which are far away, up to five times their due.
    fn halved(&self) -> Self {
        let (from, to) = (self.face as usize, self.face as usize / 2);
        let layer = |layer: usize| {
            let weighted = |x: usize, y: usize| {
                let uv = (Vec2::new(x as f32, y as f32) + 0.5) / from as f32;
                let solid_angle = cube_direction(layer, uv).length().powi(-3);
                (self.layers[layer][y * from + x] * solid_angle).extend(solid_angle)
            };
            let pair = |x: usize, y: usize| weighted(x, y) + weighted(x + 1, y);
            let mean = |x: usize, y: usize| {
                let sum = pair(2 * x, 2 * y) + pair(2 * x, 2 * y + 1);
                sum.truncate() / sum.w
            };
            (0..to * to).map(|i| mean(i % to, i / to)).collect()
        };
        Self { face: to as u32, layers: [0, 1, 2, 3, 4, 5].map(layer) }
    }

    /// Each layer with a border of one texel taken from its neighbours, for [`Padded::sample`].
    fn padded(&self) -> Padded {
        let face = self.face as f32;
        let texel = |layer: usize, x: f32, y: f32| {
            let uv = (Vec2::new(x, y) + 0.5) / face;
            let (layer, uv) = if uv.min_element() < 0.0 || uv.max_element() > 1.0 {
                cube_uv(cube_direction(layer, uv))
            } else {
                (layer, uv)
            };
            let at = (uv * face).floor().clamp(Vec2::ZERO, Vec2::splat(face - 1.0));
            self.layers[layer][(at.y * face + at.x) as usize]
        };
        let stride = self.face as usize + 2;
        let texels = (0..6 * stride * stride)
            .map(|i| {
                texel(i / (stride * stride), (i % stride) as f32 - 1.0, (i / stride % stride) as f32 - 1.0)
            })
            .collect();
        Padded { face: self.face, texels }
    }
}

/// A [`Cube`] that can be read with linear filtering across the edges of its faces.
struct Padded {
    face: u32,
    texels: Vec<Vec3>,
}

impl Padded {
    fn sample(&self, direction: Vec3) -> Vec3 {
        let stride = self.face as usize + 2;
        let (layer, uv) = cube_uv(direction);
        let at = (uv * self.face as f32 + 0.5).clamp(Vec2::ZERO, Vec2::splat(self.face as f32 + 0.999));
        let (x, y) = (at.x as usize, at.y as usize);
        let part = at - Vec2::new(x as f32, y as f32);
        let first = (layer * stride + y) * stride + x;
        let row = |first: usize| self.texels[first].lerp(self.texels[first + 1], part.x);
        row(first).lerp(row(first + stride), part.y)
    }
}

/// The unblurred environment and its mip maps, down to one texel a face.
struct Source {
    levels: Vec<Padded>,
}

impl Source {
    fn new(mut cube: Cube) -> Self {
        let mut levels = vec![cube.padded()];
        while cube.face > 1 {
            cube = cube.halved();
            levels.push(cube.padded());
        }
        Self { levels }
    }

    fn sample(&self, direction: Vec3, level: f32) -> Vec3 {
        let level = level.clamp(0.0, self.levels.len() as f32 - 1.0);
        let (fine, part) = (level as usize, level.fract());
        let sharp = self.levels[fine].sample(direction);
        match self.levels.get(fine + 1) {
            Some(coarse) if part > 0.0 => sharp.lerp(coarse.sample(direction), part),
            _ => sharp,
        }
    }
}

/// One sample of a [`Lobe`].
struct LobeSample {
    /// Light direction, z along the reflected ray.
    direction: Vec3,
    /// Share of the whole lobe.
    weight: f32,
    /// Mip level of the source.
    level: f32,
}

/// The GGX lobe of one roughness with view direction = normal, the same for every texel.
struct Lobe(Vec<LobeSample>);

impl Lobe {
    /// `face` is the edge of the source's first level.
    ///
    /// With `alpha` the square of the perceptual roughness and N = V: half vectors have the density
    /// `D N.H`, so light has `D N.H / (4 V.H) = D / 4`. One of `n` samples stands for the solid angle
    /// `1 / (n D / 4)`, a texel of the source for `4 pi / (6 face^2)`; the level is half the binary
    /// logarithm of their ratio, plus one so that neighbouring samples overlap.
    fn new(perceptual_roughness: f32, samples: u32, face: u32) -> Self {
        let alpha2 = perceptual_roughness.powi(4);
        if alpha2 == 0.0 {
            return Self(vec![LobeSample { direction: Vec3::Z, weight: 1.0, level: 0.0 }]);
        }
        let texel = 4.0 * PI / (6.0 * (face * face) as f32);
        let mut lobe: Vec<LobeSample> = (0..samples)
            .filter_map(|i| {
                let Vec2 { x, y } = hammersley(i, samples);
                let cos2 = (1.0 - y) / (1.0 + (alpha2 - 1.0) * y);
                let (sin_around, cos_around) = (TAU * x).sin_cos();
                let sin = (1.0 - cos2).max(0.0).sqrt();
                let half = Vec3::new(sin * cos_around, sin * sin_around, cos2.sqrt());
                let light = 2.0 * half.z * half - Vec3::Z;
                let density = alpha2 / (PI * (cos2 * (alpha2 - 1.0) + 1.0).powi(2)) / 4.0;
                let level = 0.5 * (1.0 / (samples as f32 * density * texel)).log2() + 1.0;
                (light.z > 0.0).then_some(LobeSample { direction: light, weight: light.z, level })
            })
            .collect();
        let total: f32 = lobe.iter().map(|sample| sample.weight).sum();
        for sample in &mut lobe {
            sample.weight /= total;
        }
        Self(lobe)
    }

    /// The blurred radiance around a unit direction.
    fn radiance(&self, direction: Vec3, source: &Source) -> Vec3 {
        let (x, y) = direction.any_orthonormal_pair();
        let light = |local: Vec3| x * local.x + y * local.y + direction * local.z;
        self.0.iter().map(|sample| source.sample(light(sample.direction), sample.level) * sample.weight).sum()
    }
}

/// The `i`-th of `n` evenly spread points in the unit square; the second coordinate is never 0 or 1.
fn hammersley(i: u32, n: u32) -> Vec2 {
    let radical_inverse = i.reverse_bits() as f32 / 4_294_967_296.0;
    Vec2::new(radical_inverse, (i as f32 + 0.5) / n as f32)
}

/// A cube image of these levels, layer by layer with the levels of a layer together, as Bevy's default
/// data order has it.
fn cube_image(label: &'static str, levels: &[Cube]) -> Image {
    let face = levels.first().map_or(1, |cube| cube.face);
    let mut data = Vec::new();
    for layer in 0..6 {
        for texel in levels.iter().flat_map(|level| &level.layers[layer]) {
            let rgba = [texel.x, texel.y, texel.z, 1.0];
            data.extend(rgba.into_iter().flat_map(|value| f16::from_f32(value.min(MAX_HALF)).to_le_bytes()));
        }
    }
    let mut image = Image::new_uninit(
        Extent3d { width: face, height: face, depth_or_array_layers: 6 },
        TextureDimension::D2,
        TextureFormat::Rgba16Float,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.data = Some(data);
    image.texture_descriptor.label = Some(label);
    image.texture_descriptor.mip_level_count = levels.len() as u32;
    image.texture_view_descriptor =
        Some(TextureViewDescriptor { dimension: Some(TextureViewDimension::Cube), ..Default::default() });
    image.sampler = ImageSampler::linear();
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 64 by 32 pixels of a function of the direction.
    fn maps_of(radiance: impl Fn(Vec3) -> Vec3) -> EnvironmentMaps {
        let uv = |i: usize| Vec2::new((i % 64) as f32 + 0.5, (i / 64) as f32 + 0.5) / Vec2::new(64.0, 32.0);
        let pixels: Vec<[f32; 3]> =
            (0..64 * 32).map(|i| radiance(equirect_direction(uv(i))).to_array()).collect();
        let small = EnvironmentSettings { skybox_face: 64, specular_face: 64, ..Default::default() };
        environment_maps_from_equirect(64, 32, &pixels, small).expect("valid")
    }

    /// The texels of one layer of one level, as the graphics card finds them in layer-major order.
    fn texels(image: &Image, layer: usize, level: usize) -> Vec<Vec3> {
        let face = image.texture_descriptor.size.width as usize;
        let area = |level: usize| (face >> level) * (face >> level);
        let whole: usize = (0..image.texture_descriptor.mip_level_count as usize).map(area).sum();
        let start = layer * whole + (0..level).map(area).sum::<usize>();
        let data = image.data.as_ref().expect("texels");
        assert_eq!(data.len(), whole * 6 * 8);
        let channel = |i: usize| f16::from_le_bytes([data[2 * i], data[2 * i + 1]]).to_f32();
        (start..start + area(level))
            .map(|i| {
                assert_eq!(channel(4 * i + 3), 1.0);
                Vec3::new(channel(4 * i), channel(4 * i + 1), channel(4 * i + 2))
            })
            .collect()
    }

    fn levels(image: &Image) -> usize {
        image.texture_descriptor.mip_level_count as usize
    }

    /// The mean over all directions: texels weighted by their solid angle.
    fn mean(image: &Image, level: usize) -> Vec3 {
        let face = image.texture_descriptor.size.width as usize >> level;
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for layer in 0..6 {
            for (i, &texel) in texels(image, layer, level).iter().enumerate() {
                let uv = (Vec2::new((i % face) as f32, (i / face) as f32) + 0.5) / face as f32;
                let weight = cube_direction(layer, uv).length().powi(-3);
                sum += texel * weight;
                weights += weight;
            }
        }
        sum / weights
    }

    #[test]
    fn white_surroundings_make_every_map_white() {
        let maps = maps_of(|_| Vec3::ONE);
        assert_eq!(levels(&maps.specular), 5);
        for image in [&maps.skybox, &maps.diffuse, &maps.specular] {
            let view = image.texture_view_descriptor.as_ref().expect("a view");
            assert_eq!(view.dimension, Some(TextureViewDimension::Cube));
            for (layer, level) in (0..6).flat_map(|layer| (0..levels(image)).map(move |level| (layer, level)))
            {
                for texel in texels(image, layer, level) {
                    assert!(texel.abs_diff_eq(Vec3::ONE, 0.01), "{layer} {level}: {texel}");
                }
            }
        }
    }

    #[test]
    fn light_from_above_lights_what_faces_up() {
        let maps = maps_of(|direction| Vec3::splat(if direction.y > 0.0 { 1.0 } else { 0.0 }));
        let middle = |layer| texels(&maps.diffuse, layer, 0)[8 * 16 + 8].x;
        let (up, side, down) = (middle(2), middle(4), middle(3));
        assert!((up - 1.0).abs() < 0.03 && (side - 0.5).abs() < 0.06 && down < 0.03, "{up} {side} {down}");
    }

    #[test]
    fn directions_survive_the_way_there_and_back() {
        for layer in 0..6 {
            for i in 0..64 {
                let uv = (Vec2::new((i % 8) as f32, (i / 8) as f32) + 0.5) / 8.0;
                let direction = cube_direction(layer, uv).normalize();
                let back = equirect_direction(equirect_uv(direction));
                assert!(back.abs_diff_eq(direction, 1e-5), "{layer} {uv}: {direction} {back}");
                let (same, again) = cube_uv(back);
                assert!(same == layer && again.abs_diff_eq(uv, 1e-5), "{layer} {uv}: {same} {again}");
            }
        }
    }

    #[test]
    fn the_photograph_is_where_bevy_looks_for_it() {
        let ahead = equirect_uv(Vec3::NEG_Z);
        assert!(ahead.abs_diff_eq(Vec2::splat(0.5), 1e-6), "{ahead}");
        assert!(equirect_uv(Vec3::new(0.1, 0.1, -1.0)).x > 0.5, "right is to the right");
        assert!(equirect_uv(Vec3::new(0.1, 0.1, -1.0)).y < 0.5, "up is at the top");
        // Colours that name the direction; the layers are those of the direction with z negated.
        let maps = maps_of(|direction| direction * 0.5 + 0.5);
        let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::NEG_Z, Vec3::Z];
        for (layer, axis) in axes.into_iter().enumerate() {
            for (image, face) in [(&maps.skybox, 64), (&maps.specular, 64)] {
                let texel = texels(image, layer, 0)[face / 2 * face + face / 2];
                assert!(texel.abs_diff_eq(axis * 0.5 + 0.5, 0.04), "{layer} {axis}: {texel}");
            }
            // Order 1 comes back with 2/3 of its amplitude.
            let texel = texels(&maps.diffuse, layer, 0)[8 * 16 + 8];
            assert!(texel.abs_diff_eq(axis / 3.0 + 0.5, 0.04), "{layer} {axis}: {texel}");
        }
    }

    #[test]
    fn blurring_neither_makes_nor_loses_light() {
        let sun = Vec3::new(0.3, 0.8, -0.5).normalize();
        let maps = maps_of(|direction| {
            let glow = if direction.dot(sun) > 0.97 { 30.0 } else { 0.0 };
            Vec3::new(1.0, 0.7 + 0.3 * direction.y, 0.5) + glow
        });
        let whole = mean(&maps.skybox, 0);
        for level in 0..levels(&maps.specular) {
            let ratio = mean(&maps.specular, level) / whole;
            assert!(ratio.abs_diff_eq(Vec3::ONE, 0.01), "level {level}: {ratio}");
        }
        let ratio = mean(&maps.diffuse, 0) / whole;
        assert!(ratio.abs_diff_eq(Vec3::ONE, 0.02), "diffuse: {ratio}");
    }

    #[test]
    fn a_small_sun_becomes_one_round_spot() {
        let maps = maps_of(|direction| Vec3::splat(if direction.y > 0.995 { 60.0 } else { 0.0 }));
        for level in 1..4 {
            let face = 64 >> level;
            let mut spot: Vec<(f32, f32)> = texels(&maps.specular, 2, level)
                .into_iter()
                .enumerate()
                .map(|(i, texel)| {
                    let at = Vec2::new((i % face) as f32, (i / face) as f32) + 0.5 - face as f32 / 2.0;
                    (at.length(), texel.x)
                })
                .collect();
            spot.sort_by(|a, b| a.0.total_cmp(&b.0));
            let peak = spot[0].1;
            for pair in spot.windows(2) {
                assert!(pair[1].1 <= pair[0].1 + 0.06 * peak, "level {level}: {pair:?} of {peak}");
            }
        }
    }

    #[test]
    fn the_sun_is_tamed_in_the_light_but_not_in_the_sky() {
        let maps = maps_of(|direction| {
            if direction.y > 0.9 {
                Vec3::new(5e5, 2.5e5, f32::NAN)
            } else {
                Vec3::new(-1.0, 0.5, f32::INFINITY)
            }
        });
        let sun = texels(&maps.specular, 2, 0)[32 * 64 + 32];
        assert!(sun.abs_diff_eq(Vec3::new(64.0, 32.0, 0.0), 0.1), "{sun}");
        assert!(texels(&maps.skybox, 2, 0)[32 * 64 + 32].x > 6e4);
        for image in [&maps.skybox, &maps.diffuse, &maps.specular] {
            let all = (0..6).flat_map(|layer| texels(image, layer, 0));
            assert!(all.into_iter().all(|texel| texel.is_finite() && texel.min_element() >= 0.0));
        }
    }

    #[test]
    fn bad_input_is_an_error() {
        let make = |width, height, count, settings| {
            environment_maps_from_equirect(width, height, &vec![[1.0; 3]; count], settings).map(|_| ())
        };
        let fine = EnvironmentSettings::default();
        assert!(matches!(make(8, 8, 64, fine), Err(EnvironmentError::NotEquirect { .. })));
        assert!(matches!(make(0, 0, 0, fine), Err(EnvironmentError::NotEquirect { .. })));
        assert!(matches!(make(8, 4, 31, fine), Err(EnvironmentError::PixelCount { got: 31, .. })));
        let setting = |settings, name| match make(8, 4, 32, settings) {
            Err(EnvironmentError::Setting { name: got, .. }) => assert_eq!(got, name),
            other => panic!("{other:?}"),
        };
        setting(EnvironmentSettings { specular_face: 100, ..fine }, "specular_face");
        setting(EnvironmentSettings { diffuse_face: 0, ..fine }, "diffuse_face");
        setting(EnvironmentSettings { specular_samples: 0, ..fine }, "specular_samples");
        setting(EnvironmentSettings { max_radiance: f32::NAN, ..fine }, "max_radiance");
    }

    #[test]
    fn files_are_read_or_refused_by_name() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let exr = folder.path().join("sky.exr");
        let written = image::Rgb32FImage::from_fn(4, 2, |x, y| image::Rgb([x as f32, y as f32, 300.0]));
        written.save(&exr).expect("written");
        let (width, height, pixels) = load_equirect(&exr).expect("read");
        assert_eq!((width, height, pixels[7]), (4, 2, [3.0, 1.0, 300.0]));
        let png = folder.path().join("sky.png");
        image::RgbImage::new(4, 2).save(&png).expect("written");
        assert!(matches!(load_equirect(&png), Err(EnvironmentError::NotRadiance { .. })));
        std::fs::write(&exr, b"not an image").expect("written");
        assert!(matches!(load_equirect(&exr), Err(EnvironmentError::Decode { .. })));
        let missing = load_equirect(&folder.path().join("none.exr")).expect_err("missing");
        assert!(missing.to_string().contains("none.exr"), "{missing}");
    }
}
