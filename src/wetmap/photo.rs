//! A wet map from two photographs of one surface, dry and wet.
//!
//! The photographs are taken from the same place, in any light: what counts is the ratio of wet to dry in
//! each pixel, and a light that changed as a whole changes all ratios alike. Both are blurred a little first,
//! because the ratio of two noisy dark pixels is nothing but noise, and the logarithm of the ratio goes
//! through a median, which keeps edges. A threshold between its two levels (`levels.rs`) then says which
//! pixels are wet. Highlights on wet places and pinholes are filled, specks dropped, and each connected spot
//! gets a gradient from its rim to its middle ([`WetMask::gradients`]), so that it dries from the rim.
//!
//! What this does not do: it does not register the photographs, and it cannot tell a surface that got wet all
//! over from one whose light changed. A threshold of one's own can.
//!
//! Hnat et al. 2006, *Real-time wetting of porous media*; Otsu 1979 for the threshold.

use image::Rgb32FImage;

use super::file::luminance;
use super::levels::{LEAST_CONTRAST, Levels};
use super::mask::WetMask;
use super::{GreyMap, WetMapError, check_range, check_size};

/// How a pair of photographs becomes a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotoOptions {
    /// How far a spot falls from its middle to its rim, 0..=1.
    pub gradient: f32,
    /// Spots of fewer pixels are taken for noise.
    pub min_area: u32,
    /// Holes of up to this many pixels are filled; highlights are at any size.
    pub max_hole: u32,
    /// Wet over dry, linear, below which a pixel is wet: .01 to 2. `None` finds it.
    pub threshold: Option<f32>,
}

impl Default for PhotoOptions {
    fn default() -> Self {
        Self { gradient: 1.0, min_area: 24, max_hole: 64, threshold: None }
    }
}

/// The least pixels along a side of a photograph.
const MIN_SIDE: u32 = 8;

/// Darker than this part of the photograph's mean, a pixel says nothing.
const BLACK: f32 = 1.0e-3;

/// The wet map of two photographs in linear RGB that lie exactly on each other. Dry pixels are 0. Wet spots
/// rise from their rims to 1; see [`WetMask::gradients`]. An unchanged pair gives an empty map.
///
/// # Errors
/// [`WetMapError::Parameter`]; [`WetMapError::Sizes`], [`WetMapError::Size`] and [`WetMapError::TooSmall`]
/// for their sizes; [`WetMapError::NothingToCompare`] if one is black or not finite throughout.
pub fn from_photos(
    dry: &Rgb32FImage,
    wet: &Rgb32FImage,
    options: &PhotoOptions,
) -> Result<GreyMap, WetMapError> {
    check_range("gradient", options.gradient, 0.0..=1.0)?;
    wet_mask(dry, wet, options)?.gradients(options.gradient)
}

/// Which pixels of two photographs in linear RGB got wet; the first half of [`from_photos`].
///
/// # Errors
/// As [`from_photos`].
pub fn wet_mask(
    dry: &Rgb32FImage,
    wet: &Rgb32FImage,
    options: &PhotoOptions,
) -> Result<WetMask, WetMapError> {
    if let Some(threshold) = options.threshold {
        check_range("threshold", threshold, 0.01..=2.0)?;
    }
    let (width, height) = dry.dimensions();
    if (width, height) != wet.dimensions() {
        let (other_width, other_height) = wet.dimensions();
        return Err(WetMapError::Sizes { width, height, other_width, other_height });
    }
    check_size(width, height)?;
    if width < MIN_SIDE || height < MIN_SIDE {
        return Err(WetMapError::TooSmall { width, height, min: MIN_SIDE });
    }
    let ratios = median(&log_ratios(dry, wet)?, width as usize);
    let levels = Levels::new(&ratios, options.min_area.into()).ok_or(WetMapError::NothingToCompare)?;
    let Some(threshold) = options.threshold.map(f32::ln).or(levels.threshold()) else {
        return WetMask::new(width, height, vec![false; ratios.len()]);
    };
    // NaN, what is not known, is neither wet nor glossy.
    let mut mask = WetMask::new(width, height, ratios.iter().map(|&ratio| ratio < threshold).collect())?;
    let highlight = levels.dry + LEAST_CONTRAST.max(4.0 * levels.noise);
    let glossy: Vec<bool> = ratios.iter().map(|&ratio| ratio > highlight).collect();
    mask.fill_highlights(&glossy);
    mask.fill_holes(options.max_hole);
    mask.drop_specks(options.min_area);
    Ok(mask)
}

/// The logarithm of wet over dry of each pixel; NaN where one of them is not finite or black.
fn log_ratios(dry: &Rgb32FImage, wet: &Rgb32FImage) -> Result<Vec<f32>, WetMapError> {
    let (dry, wet) = (blurred_luminance(dry), blurred_luminance(wet));
    let black = |values: &[f32]| {
        let known = values.iter().filter(|value| value.is_finite());
        let (sum, count) =
            known.fold((0.0, 0u32), |(sum, count), &value| (sum + f64::from(value), count + 1));
        BLACK * (sum / f64::from(count.max(1))) as f32
    };
    let (black_dry, black_wet) = (black(&dry), black(&wet));
    let ratio = |(&dry, &wet): (&f32, &f32)| {
        // Written so that NaN and pictures that are all black fail.
        let known = dry > black_dry && dry > 0.0 && black_wet > 0.0 && dry.is_finite() && wet.is_finite();
        if known { (wet.max(black_wet) / dry).ln() } else { f32::NAN }
    };
    let ratios: Vec<f32> = dry.iter().zip(&wet).map(ratio).collect();
    if ratios.iter().any(|ratio| ratio.is_finite()) { Ok(ratios) } else { Err(WetMapError::NothingToCompare) }
}

/// Luminance, weighed 1 2 1 along both axes. Pixels that are not finite do not count; where there are only
/// such, NaN.
fn blurred_luminance(photo: &Rgb32FImage) -> Vec<f32> {
    let width = photo.width() as usize;
    let sharp: Vec<f32> = photo.pixels().map(|pixel| luminance(pixel.0)).collect();
    let mut blurred = Vec::with_capacity(sharp.len());
    for at in 0..sharp.len() {
        let (mut sum, mut weights) = (0.0, 0.0);
        around(at, width, sharp.len(), 1, |next, dx, dy| {
            let weight = (2 - dx.unsigned_abs()) as f32 * (2 - dy.unsigned_abs()) as f32;
            if sharp[next].is_finite() {
                sum += weight * sharp[next];
                weights += weight;
            }
        });
        blurred.push(if weights > 0.0 { sum / weights } else { f32::NAN });
    }
    blurred
}

/// The median of the five by five values around each, as far as they are known.
fn median(values: &[f32], width: usize) -> Vec<f32> {
    let mut window = Vec::with_capacity(25);
    let mut medians = Vec::with_capacity(values.len());
    for at in 0..values.len() {
        window.clear();
        around(at, width, values.len(), 2, |next, _, _| {
            if values[next].is_finite() {
                window.push(values[next]);
            }
        });
        let middle = window.len() / 2;
        medians.push(if window.is_empty() {
            f32::NAN
        } else {
            *window.select_nth_unstable_by(middle, f32::total_cmp).1
        });
    }
    medians
}

/// Calls `visit(index, dx, dy)` for the square of pixels around one, less those beyond the edges.
fn around(at: usize, width: usize, count: usize, radius: i32, mut visit: impl FnMut(usize, i32, i32)) {
    let (x, y) = ((at % width) as i32, (at / width) as i32);
    let (columns, rows) = (width as i32, (count / width) as i32);
    for dy in -radius..=radius {
        for dx in -radius..=radius {
            if (0..columns).contains(&(x + dx)) && (0..rows).contains(&(y + dy)) {
                visit(((y + dy) * columns + x + dx) as usize, dx, dy);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;
    use crate::scenes::noise::{hash, unit};

    const SIDE: u32 = 160;

    /// Sensor noise: standard deviation .02.
    fn noise(seed: u32, x: u32, y: u32) -> f32 {
        let sum: f32 = (0..12).map(|i| unit(hash([seed * 16 + i, x, y]))).sum();
        (sum - 6.0) * 0.02
    }

    /// A stone: grains of four pixels, grit of one.
    fn base(x: u32, y: u32) -> [f32; 3] {
        let tone = 0.6 + 0.5 * unit(hash([1, x / 4, y / 4])) + 0.3 * unit(hash([2, x, y]));
        [0.45, 0.30, 0.22].map(|channel| channel * tone)
    }

    /// How wet a pixel is: a dozen splats with soft rims.
    fn wetness(x: u32, y: u32) -> f32 {
        let splat = |i: u32| {
            let random = |j: u32| unit(hash([i, j, 77]));
            let (middle_x, middle_y) = (160.0 * random(0), 160.0 * random(1));
            let radius = 7.0 + 12.0 * random(2);
            let away = (x as f32 + 0.5 - middle_x).hypot(y as f32 + 0.5 - middle_y);
            ((radius - away) / 3.0 + 0.5).clamp(0.0, 1.0)
        };
        (0..12).map(splat).fold(0.0, f32::max)
    }

    /// A photograph: light on the stone, `wet` times as wet as it can be, with a highlight on what is wet.
    fn photo(seed: u32, light: f32, wet: f32, highlight: f32) -> Rgb32FImage {
        Rgb32FImage::from_fn(SIDE, SIDE, |x, y| {
            let wetness = wet * wetness(x, y);
            // In one of the splats.
            let (dx, dy) = (x as f32 - 117.0, y as f32 - 111.0);
            let mirrored = highlight * wetness * (-(dx * dx + dy * dy) / 50.0).exp();
            let mut channel = 0;
            Rgb(base(x, y).map(|albedo| {
                channel += 1;
                let seen = light * albedo * (1.0 - 0.4 * wetness) + mirrored;
                seen + noise(seed * 4 + channel, x, y)
            }))
        })
    }

    fn intersection_over_union(mask: &WetMask) -> f32 {
        let (mut both, mut either) = (0.0, 0.0);
        for (i, &found) in mask.wet.iter().enumerate() {
            let known = wetness(i as u32 % SIDE, i as u32 / SIDE) >= 0.5;
            both += f32::from(u8::from(found && known));
            either += f32::from(u8::from(found || known));
        }
        both / either
    }

    #[test]
    fn a_known_mask_is_recovered_in_any_light() {
        for light in [1.0, 0.7, 1.5] {
            let pair = (photo(1, 1.0, 0.0, 0.0), photo(2, light, 1.0, 0.0));
            let mask = wet_mask(&pair.0, &pair.1, &PhotoOptions::default()).unwrap();
            let iou = intersection_over_union(&mask);
            assert!(iou >= 0.95, "{light}: {iou}");
            let map = from_photos(&pair.0, &pair.1, &PhotoOptions::default()).unwrap();
            assert!(map.values.iter().zip(&mask.wet).all(|(&value, &wet)| (value > 0.0) == wet));
            assert!(map.values.contains(&1.0));
        }
    }

    #[test]
    fn highlights_tear_no_holes() {
        let pair = (photo(1, 1.0, 0.0, 0.0), photo(2, 1.0, 1.0, 1.0));
        let iou = intersection_over_union(&wet_mask(&pair.0, &pair.1, &PhotoOptions::default()).unwrap());
        assert!(iou >= 0.95, "{iou}");
    }

    #[test]
    fn nothing_changed_nothing_wet() {
        let dry = photo(1, 1.0, 0.0, 0.0);
        for (seed, light) in [(1, 1.0), (2, 1.0), (3, 0.6), (4, 1.4)] {
            let map = from_photos(&dry, &photo(seed, light, 0.0, 0.0), &PhotoOptions::default()).unwrap();
            assert!(map.values.iter().all(|&value| value == 0.0), "{seed} {light}");
        }
    }

    #[test]
    fn a_threshold_of_ones_own_is_kept() {
        let even = |value: f32| Rgb32FImage::from_pixel(20, 16, Rgb([value; 3]));
        let options = |threshold| PhotoOptions { threshold: Some(threshold), ..PhotoOptions::default() };
        let coverage = |threshold| {
            wet_mask(&even(0.5), &even(0.35), &options(threshold)).map(|mask| mask.coverage()).unwrap()
        };
        assert_eq!((coverage(0.69), coverage(0.71)), (0.0, 1.0));
    }

    #[test]
    fn pixels_that_are_not_known_do_not_spread() {
        let (mut dry, mut wet) = (photo(1, 1.0, 0.0, 0.0), photo(2, 1.0, 1.0, 0.0));
        for i in 0..SIDE {
            dry[(i, 40)] = Rgb([f32::NAN; 3]);
            wet[(70, i)] = Rgb([0.1, f32::INFINITY, 0.1]);
        }
        let mask = wet_mask(&dry, &wet, &PhotoOptions::default()).unwrap();
        let iou = intersection_over_union(&mask);
        assert!(iou >= 0.93, "{iou}");
    }

    #[test]
    fn photographs_that_are_no_pair_say_why() {
        let options = PhotoOptions::default();
        let even = |side: u32, value: f32| Rgb32FImage::from_pixel(side, side, Rgb([value; 3]));
        let error = |dry: &Rgb32FImage, wet: &Rgb32FImage, options: &PhotoOptions| {
            from_photos(dry, wet, options).unwrap_err().to_string()
        };
        let grey = even(16, 0.5);
        assert!(error(&grey, &even(17, 0.5), &options).contains("17"));
        assert!(error(&even(7, 0.5), &even(7, 0.5), &options).contains("at least 8"));
        for nothing in [f32::NAN, f32::NEG_INFINITY, 0.0] {
            assert!(error(&grey, &even(16, nothing), &options).contains("compared"), "{nothing}");
            assert!(error(&even(16, nothing), &grey, &options).contains("compared"), "{nothing}");
        }
        let steep = PhotoOptions { gradient: 1.5, ..options };
        assert!(error(&grey, &grey, &steep).contains("`gradient` is 1.5"));
        for threshold in [0.0, -1.0, f32::NAN, 3.0] {
            let options = PhotoOptions { threshold: Some(threshold), ..options };
            assert!(error(&grey, &grey, &options).contains("`threshold`"), "{threshold}");
        }
    }
}
