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

mod cube;
mod equirect;
mod lobe;

use std::path::{Path, PathBuf};

use bevy::prelude::Image;
use image::{DynamicImage, ImageError, ImageReader};
use thiserror::Error;

use cube::{Cube, MAX_HALF, Source, cube_image};
use equirect::Equirect;
use lobe::{Lobe, irradiance_over_pi};

/// Edge of the smallest level of the specular cube, in texels; smaller ones cannot hold the lobe of
/// roughness 1 with linear filtering.
const SMALLEST_SPECULAR_FACE: u32 = 4;

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
    #[error("cannot read environment map {}: {source}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is not an image, or not one that can be decoded.
    #[error("cannot decode environment map {}: {source}", .path.display())]
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

#[cfg(test)]
mod tests {
    use super::cube::cube_direction;
    use super::equirect::equirect_direction;
    use super::*;
    use bevy::math::{Vec2, Vec3};
    use bevy::render::render_resource::TextureViewDimension;
    use half::f16;

    /// 64 by 32 pixels of a function of the direction.
    pub(super) fn maps_of(radiance: impl Fn(Vec3) -> Vec3) -> EnvironmentMaps {
        let uv = |i: usize| Vec2::new((i % 64) as f32 + 0.5, (i / 64) as f32 + 0.5) / Vec2::new(64.0, 32.0);
        let pixels: Vec<[f32; 3]> =
            (0..64 * 32).map(|i| radiance(equirect_direction(uv(i))).to_array()).collect();
        let small = EnvironmentSettings { skybox_face: 64, specular_face: 64, ..Default::default() };
        environment_maps_from_equirect(64, 32, &pixels, small).expect("valid")
    }

    /// The texels of one layer of one level, as the graphics card finds them in layer-major order.
    pub(super) fn texels(image: &Image, layer: usize, level: usize) -> Vec<Vec3> {
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

    pub(super) fn levels(image: &Image) -> usize {
        image.texture_descriptor.mip_level_count as usize
    }

    /// The mean over all directions: texels weighted by their solid angle.
    pub(super) fn mean(image: &Image, level: usize) -> Vec3 {
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
