//! Maps and photographs in files.
//!
//! A map is data, not a colour: its values are stored as they are, in a grey `.png` of 16 bits or in an
//! `.exr`, where all three channels are the same (the encoder knows no grey ones). A photograph is light: a
//! `.png` is decoded from sRGB, an `.exr` is linear already.

use std::path::Path;

use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, Rgb32FImage};

use super::{GreyMap, WetMapError};
use crate::picture::{read_picture, write_picture};
use crate::scenes::mips::linear_from_srgb;

/// Of linear sRGB: how bright each channel looks.
const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Luminance of a linear colour; of a grey one exactly its value.
pub(super) fn luminance([r, g, b]: [f32; 3]) -> f32 {
    if r == g && g == b { r } else { LUMINANCE[0] * r + LUMINANCE[1] * g + LUMINANCE[2] * b }
}

/// Reads a map: `.png` of 8 or 16 bits or `.exr`, up to [`GreyMap::MAX_SIZE`] texels a side. Of a coloured
/// one the luminance of its values counts, as they are; transparency does not.
///
/// # Errors
/// [`WetMapError::Extension`], [`WetMapError::Picture`]; [`WetMapError::Content`] if a value is NaN or outside
/// 0..=1.
pub fn read_map(path: &Path) -> Result<GreyMap, WetMapError> {
    let picture = read(path)?;
    let (width, height) = (picture.width(), picture.height());
    let values = if picture.color().has_color() {
        picture.into_rgb32f().pixels().map(|pixel| luminance(pixel.0)).collect()
    } else {
        picture.to_luma32f().into_raw()
    };
    GreyMap::new(width, height, values)
        .map_err(|source| WetMapError::Content { path: path.into(), source: Box::new(source) })
}

/// Reads a photograph as linear RGB: `.png` in sRGB or linear `.exr`, up to [`GreyMap::MAX_SIZE`] pixels a
/// side.
///
/// # Errors
/// [`WetMapError::Extension`], [`WetMapError::Picture`].
pub fn read_photo(path: &Path) -> Result<Rgb32FImage, WetMapError> {
    let is_light = format_of(path)? == ImageFormat::OpenExr;
    let mut photo = read(path)?.into_rgb32f();
    if !is_light {
        for pixel in photo.pixels_mut() {
            pixel.0 = pixel.0.map(linear_from_srgb);
        }
    }
    Ok(photo)
}

/// Writes a map, whole or not at all: by its name a grey `.png` of 16 bits, or an `.exr`, which keeps every
/// bit.
///
/// # Errors
/// [`WetMapError::Extension`], [`WetMapError::Picture`]; [`WetMapError::Content`] if its values are not as many as
/// its texels.
pub fn write_map(path: &Path, map: &GreyMap) -> Result<(), WetMapError> {
    let format = format_of(path)?;
    let content = |source| WetMapError::Content { path: path.into(), source: Box::new(source) };
    let missing = || WetMapError::Count {
        width: map.width,
        height: map.height,
        needed: map.width as usize * map.height as usize,
        got: map.values.len(),
    };
    let picture: DynamicImage = if format == ImageFormat::Png {
        let values = map.values.iter().map(|value| (value.clamp(0.0, 1.0) * 65535.0).round() as u16);
        let picture: Option<ImageBuffer<Luma<u16>, Vec<u16>>> =
            ImageBuffer::from_raw(map.width, map.height, values.collect());
        picture.ok_or_else(|| content(missing()))?.into()
    } else {
        let values = map.values.iter().flat_map(|&value| [value; 3]).collect();
        Rgb32FImage::from_raw(map.width, map.height, values).ok_or_else(|| content(missing()))?.into()
    };
    Ok(write_picture(path, &picture, format)?)
}

/// That a map can be written under this name: better before the work than after it.
///
/// # Errors
/// [`WetMapError::Extension`].
pub fn check_map_name(path: &Path) -> Result<(), WetMapError> {
    format_of(path).map(drop)
}

fn format_of(path: &Path) -> Result<ImageFormat, WetMapError> {
    let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
    match extension.as_deref() {
        Some("png") => Ok(ImageFormat::Png),
        Some("exr") => Ok(ImageFormat::OpenExr),
        _ => Err(WetMapError::Extension { path: path.into() }),
    }
}

fn read(path: &Path) -> Result<DynamicImage, WetMapError> {
    Ok(read_picture(path, format_of(path)?, GreyMap::MAX_SIZE)?)
}

#[cfg(test)]
mod tests {
    use image::{GrayImage, RgbImage};

    use super::*;

    fn ramp() -> GreyMap {
        let values = (0..48).map(|i| i as f32 / 47.0).collect();
        GreyMap::new(8, 6, values).unwrap()
    }

    #[test]
    fn maps_come_back() {
        let folder = tempfile::tempdir().unwrap();
        for (name, tolerance) in [("a/map.png", 0.51 / 65535.0), ("a/map.EXR", 0.0)] {
            let path = folder.path().join(name);
            write_map(&path, &ramp()).unwrap();
            let map = read_map(&path).unwrap();
            assert_eq!((map.width, map.height), (8, 6));
            for (value, expected) in map.values.iter().zip(&ramp().values) {
                assert!((value - expected).abs() <= tolerance, "{name}: {value} for {expected}");
            }
        }
    }

    #[test]
    fn bytes_and_colours_are_maps_too() {
        let folder = tempfile::tempdir().unwrap();
        let grey = folder.path().join("grey.png");
        GrayImage::from_fn(4, 1, |x, _| Luma([85 * x as u8])).save(&grey).unwrap();
        let values = read_map(&grey).unwrap().values;
        assert!(values.iter().zip([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-6));
        let color = folder.path().join("color.png");
        RgbImage::from_pixel(2, 2, image::Rgb([0, 255, 0])).save(&color).unwrap();
        assert!(read_map(&color).unwrap().values.iter().all(|value| (value - 0.7152).abs() < 1e-5));
    }

    #[test]
    fn photographs_are_light() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.png");
        RgbImage::from_pixel(2, 2, image::Rgb([188, 255, 0])).save(&path).unwrap();
        let [r, g, b] = read_photo(&path).unwrap()[(1, 1)].0;
        assert!((r - 0.503).abs() < 2e-3 && (g - 1.0).abs() < 1e-6 && b == 0.0, "{r} {g} {b}");
        let path = folder.path().join("photo.exr");
        Rgb32FImage::from_pixel(2, 2, image::Rgb([0.5, 7.0, 0.0])).save(&path).unwrap();
        assert_eq!(read_photo(&path).unwrap()[(0, 1)].0, [0.5, 7.0, 0.0]);
    }

    #[test]
    fn what_is_no_map_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = |name: &str| read_map(&folder.path().join(name)).unwrap_err().to_string();
        assert!(error("nowhere.png").contains("nowhere.png"));
        assert!(error("map.tif").contains("map.tif") && error("map.tif").contains(".png or .exr"));
        std::fs::write(folder.path().join("text.png"), "no picture").unwrap();
        assert!(error("text.png").contains("text.png"));
        std::fs::write(folder.path().join("text.exr"), "no picture").unwrap();
        assert!(error("text.exr").contains("text.exr"));
        GrayImage::new(GreyMap::MAX_SIZE + 1, 1).save(folder.path().join("wide.png")).unwrap();
        let wide = error("wide.png");
        assert!(wide.contains("wide.png") && wide.contains("8193") && wide.contains("8192"), "{wide}");
        let nan = Rgb32FImage::from_fn(2, 2, |x, _| image::Rgb([if x == 0 { 0.5 } else { f32::NAN }; 3]));
        nan.save(folder.path().join("nan.exr")).unwrap();
        let nan = error("nan.exr");
        assert!(nan.contains("nan.exr") && nan.contains("(1, 0)") && nan.contains("NaN"), "{nan}");
    }

    #[test]
    fn a_map_that_is_not_full_is_not_written() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["map.png", "map.exr"] {
            let path = folder.path().join(name);
            let torn = GreyMap { values: vec![0.0; 5], ..ramp() };
            assert!(write_map(&path, &torn).unwrap_err().to_string().contains("need 48 values"));
            assert!(!path.exists());
        }
        assert!(check_map_name(Path::new("map")).is_err());
        assert!(check_map_name(Path::new("map.PNG")).is_ok());
    }
}
