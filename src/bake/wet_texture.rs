//! A wet version of a base colour texture.

use std::path::Path;

use image::{DynamicImage, ImageFormat};

use super::spectrum::{Observer, spectrum_from_rgb, wet_spectrum};
use crate::material::models::lekner_dorf::{LiquidFilm, N_WATER};
use crate::material::models::{lagarde, lekner_dorf, twomey};
use crate::picture::{PictureError, read_picture, write_picture};
use crate::scenes::mips::{linear_from_srgb, srgb_from_linear};

/// How a texture gets wet. Porosities are 0..=1: how much of the change is applied.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WetTexture {
    /// Shifted and drawn towards water in the spectrum; see [`wet_spectrum`].
    Spectral {
        /// Taken from each bin, 0..=1.
        shift: f64,
        /// Part of the way towards water, 0..=1.
        lerp: f64,
    },
    /// A film over rough matter; see [`lekner_dorf`].
    LeknerDorf {
        /// Part that takes the film.
        porosity: f64,
    },
    /// Water between grains; see [`twomey`].
    Twomey {
        /// Part that is grains.
        porosity: f64,
    },
    /// Darker, the more porous; see [`lagarde`].
    Lagarde {
        /// Of the matter.
        porosity: f64,
    },
}

/// Why a wet texture could not be made.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum TextureError {
    /// A parameter is out of range.
    #[error("`{name}` is {value}, but must be 0 to 1")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// What it is.
        value: f64,
    },
    /// A file could not be read or written, is no picture, or too large a one.
    #[error(transparent)]
    Picture(#[from] PictureError),
}

impl WetTexture {
    /// The wet colour of a dry one, both linear, each channel in `[0, 1]`.
    fn wet(&self, observer: &Observer, film: LiquidFilm, rgb: [f64; 3]) -> [f64; 3] {
        let toward = |dry: f64, wet: f64, porosity: f64| dry + (wet - dry) * porosity;
        match *self {
            Self::Spectral { shift, lerp } => {
                observer.rgb_from_spectrum(&wet_spectrum(&spectrum_from_rgb(rgb), shift, lerp))
            }
            Self::LeknerDorf { porosity } => {
                rgb.map(|dry| toward(dry, lekner_dorf::wet_diffuse(dry, film.x, film.p), porosity))
            }
            Self::Twomey { porosity } => {
                rgb.map(|dry| toward(dry, twomey::wet_albedo(dry, twomey::WATER_BACKSCATTER), porosity))
            }
            Self::Lagarde { porosity } => {
                let f = lagarde::kept_albedo(porosity, 0.0);
                rgb.map(|dry| lagarde::wet_albedo(dry, f, 1.0))
            }
        }
    }

    fn validate(&self) -> Result<(), TextureError> {
        let parameters = match *self {
            Self::Spectral { shift, lerp } => vec![("shift", shift), ("lerp", lerp)],
            Self::LeknerDorf { porosity } | Self::Twomey { porosity } | Self::Lagarde { porosity } => {
                vec![("porosity", porosity)]
            }
        };
        // Written so that NaN fails.
        match parameters.into_iter().find(|(_, value)| !(0.0..=1.0).contains(value)) {
            Some((name, value)) => Err(TextureError::Parameter { name, value }),
            None => Ok(()),
        }
    }
}

/// The wet version of an sRGB texture, with as many bits per channel; alpha stays.
///
/// # Errors
/// [`TextureError::Parameter`].
pub fn wet_texture(dry: &DynamicImage, how: &WetTexture) -> Result<DynamicImage, TextureError> {
    how.validate()?;
    let (observer, film) = (Observer::new(), LiquidFilm::new(N_WATER, 1.5));
    let wet = |[r, g, b]: [f32; 3]| {
        let linear = [r, g, b].map(|encoded| f64::from(linear_from_srgb(encoded)));
        how.wet(&observer, film, linear).map(|value| srgb_from_linear((value as f32).clamp(0.0, 1.0)))
    };
    let deep = dry.color().bytes_per_pixel() / dry.color().channel_count() > 1;
    let mut pixels = dry.to_rgba32f();
    for pixel in pixels.pixels_mut() {
        let [r, g, b, alpha] = pixel.0;
        let [r, g, b] = wet([r, g, b]);
        pixel.0 = [r, g, b, alpha];
    }
    let pixels = DynamicImage::from(pixels);
    Ok(match (deep, dry.color().has_alpha()) {
        (false, false) => pixels.to_rgb8().into(),
        (false, true) => pixels.to_rgba8().into(),
        (true, false) => pixels.to_rgb16().into(),
        (true, true) => pixels.to_rgba16().into(),
    })
}

/// The widest and highest texture that is read.
const MAX_SIDE: u32 = 16_384;

/// Reads a `.png`, up to 16,384 pixels a side.
///
/// # Errors
/// [`TextureError::Picture`].
pub fn read_texture(path: &Path) -> Result<DynamicImage, TextureError> {
    Ok(read_picture(path, ImageFormat::Png, MAX_SIDE)?)
}

/// Writes a `.png`, whole or not at all.
///
/// # Errors
/// [`TextureError::Picture`].
pub fn write_texture(path: &Path, texture: &DynamicImage) -> Result<(), TextureError> {
    Ok(write_picture(path, texture, ImageFormat::Png)?)
}

#[cfg(test)]
mod tests {
    use image::{ImageBuffer, Rgba};

    use super::*;

    const ALL: [WetTexture; 4] = [
        WetTexture::Spectral { shift: 0.05, lerp: 0.025 },
        WetTexture::LeknerDorf { porosity: 1.0 },
        WetTexture::Twomey { porosity: 1.0 },
        WetTexture::Lagarde { porosity: 1.0 },
    ];

    fn clay() -> DynamicImage {
        let encode = |value: f32| (srgb_from_linear(value) * 255.0).round() as u8;
        let colour = Rgba([encode(0.45), encode(0.22), encode(0.15), 77]);
        ImageBuffer::from_pixel(3, 2, colour).into()
    }

    #[test]
    fn wet_is_darker_and_alpha_stays() {
        for how in ALL {
            let wet = wet_texture(&clay(), &how).unwrap();
            let (before, after) = (clay().to_rgba8()[(1, 1)], wet.to_rgba8()[(1, 1)]);
            assert!((0..3).all(|i| after[i] < before[i]), "{how:?}: {before:?} to {after:?}");
            assert_eq!(after[3], 77);
            assert_eq!((wet.width(), wet.height(), wet.color()), (3, 2, clay().color()));
        }
    }

    #[test]
    fn nothing_porous_nothing_changed() {
        for how in [
            WetTexture::Lagarde { porosity: 0.0 },
            WetTexture::Twomey { porosity: 0.0 },
            WetTexture::LeknerDorf { porosity: 0.0 },
        ] {
            assert_eq!(wet_texture(&clay(), &how).unwrap(), clay());
        }
    }

    #[test]
    fn depth_and_grey_are_kept_sensibly() {
        let deep = DynamicImage::from(clay().to_rgb16());
        assert_eq!(wet_texture(&deep, &ALL[1]).unwrap().color(), image::ColorType::Rgb16);
        let grey = DynamicImage::from(clay().to_luma8());
        assert_eq!(wet_texture(&grey, &ALL[0]).unwrap().color(), image::ColorType::Rgb8);
    }

    #[test]
    fn nonsense_is_named() {
        let error = wet_texture(&clay(), &WetTexture::Lagarde { porosity: f64::NAN }).unwrap_err();
        assert!(error.to_string().contains("`porosity` is NaN"), "{error}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("text.png");
        std::fs::write(&path, "no picture").unwrap();
        let error = read_texture(&path).unwrap_err().to_string();
        assert!(error.contains("text.png"), "{error}");
    }

    #[test]
    fn files_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("clay.png");
        write_texture(&path, &clay()).unwrap();
        assert_eq!(read_texture(&path).unwrap(), clay());
    }
}
