//! Wet maps: which part of a surface gets wet first, decided before it rains.
//!
//! A wet map is a grey texture `g`, 0..=1, over the uv square of a surface: where it is 1 water comes first,
//! where it is 0 it never comes. In a shower whose progress goes from 0 to 1, a texel starts to fill at
//! `1 - g` and is full a while later; drying is the same film run backwards. So one picture holds the whole
//! course of a shower, and it costs a texture fetch to show it.
//!
//! There are four ways to one here, all on the CPU and all the same on every run:
//!
//! | made by | from | good for |
//! |---|---|---|
//! | [`from_photos`] | two photographs of one surface, dry and wet | splats that dry from their rims |
//! | [`perlin()`] | a seed | a soaked surface that dries unevenly |
//! | [`exposure()`] | rays towards the rain | shelter under roofs and on the lee side |
//! | [`drops()`] | a seed | the first drops |
//!
//! Maps are put together by [`GreyMap::add`], as drops over exposure. [`read_map`] and [`write_map`] keep
//! them in files. The rays serve drying, too: [`accessibility`] says how open a point lies,
//! [`sun_visibility`] how much sun it gets.
//!
//! What this does not do: it neither shows a map nor runs its clock, and it unwraps nothing. A map belongs to
//! the uv layout that it was made for; a pair of photographs has none but its own.
//!
//! - Hnat, Porquet, Merillou, Ghazanfarpour 2006, *Real-time wetting of porous media*, for the map and its
//!   sources.
//! - Otsu 1979, *A threshold selection method from gray-level histograms*.
//! - Felzenszwalb, Huttenlocher 2012, *Distance transforms of sampled functions*.
//! - Perlin 2002, *Improving noise*.

mod distance;
mod drops;
mod error;
mod exposure;
mod file;
mod gutter;
mod levels;
mod mask;
mod occlusion;
pub(crate) mod parallel;
mod perlin;
mod photo;
mod rays;

use std::fmt::Display;
use std::ops::RangeInclusive;

pub use drops::{DropsOptions, drops};
pub use error::WetMapError;
pub use exposure::{ExposureOptions, RainSource, exposure};
pub use file::{check_map_name, read_map, read_photo, write_map};
pub use mask::{Spot, WetMask};
pub use occlusion::{accessibility, sun_visibility};
pub use perlin::{PerlinOptions, perlin};
pub use photo::{PhotoOptions, from_photos, wet_mask};

/// A grey map: a value in 0..=1 per texel.
#[derive(Debug, Clone, PartialEq)]
pub struct GreyMap {
    /// Texels along u, 1..=[`Self::MAX_SIZE`].
    pub width: u32,
    /// Texels along v, 1..=[`Self::MAX_SIZE`].
    pub height: u32,
    /// `width * height` values in 0..=1, row by row from v = 0, each from u = 0.
    pub values: Vec<f32>,
}

impl GreyMap {
    /// The most texels along a side.
    pub const MAX_SIZE: u32 = 8192;

    /// A map of these values, row by row from v = 0.
    ///
    /// # Errors
    /// [`WetMapError::Size`], [`WetMapError::Count`] if the values are not as many as the texels, and
    /// [`WetMapError::Value`] if one is NaN or outside 0..=1.
    pub fn new(width: u32, height: u32, values: Vec<f32>) -> Result<Self, WetMapError> {
        check_size(width, height)?;
        let needed = width as usize * height as usize;
        if values.len() != needed {
            return Err(WetMapError::Count { width, height, needed, got: values.len() });
        }
        // Written so that NaN fails.
        if let Some(at) = values.iter().position(|value| !(0.0..=1.0).contains(value)) {
            let (x, y) = (at as u32 % width, at as u32 / width);
            return Err(WetMapError::Value { x, y, value: values[at] });
        }
        Ok(Self { width, height, values })
    }

    /// The value of a texel. Beyond the edges the map repeats.
    pub fn get(&self, x: u32, y: u32) -> f32 {
        let (width, height) = (self.width.max(1), self.height.max(1));
        let at = (y % height) as usize * width as usize + (x % width) as usize;
        self.values.get(at).copied().unwrap_or(0.0)
    }

    /// Both together, texel by texel: `min(a + b, 1)`. So drops join what is wet already.
    ///
    /// # Errors
    /// [`WetMapError::Sizes`] if they are not of one size.
    pub fn add(&self, other: &Self) -> Result<Self, WetMapError> {
        let same = self.values.len() == other.values.len();
        if !same || (self.width, self.height) != (other.width, other.height) {
            return Err(WetMapError::Sizes {
                width: self.width,
                height: self.height,
                other_width: other.width,
                other_height: other.height,
            });
        }
        let values = self.values.iter().zip(&other.values).map(|(a, b)| (a + b).min(1.0)).collect();
        Ok(Self { width: self.width, height: self.height, values })
    }
}

/// That a map can have this size.
fn check_size(width: u32, height: u32) -> Result<(), WetMapError> {
    let allowed = 1..=GreyMap::MAX_SIZE;
    if allowed.contains(&width) && allowed.contains(&height) {
        Ok(())
    } else {
        Err(WetMapError::Size { width, height, max: GreyMap::MAX_SIZE })
    }
}

/// That a number lies in a range; NaN lies in none.
fn check_range<T: PartialOrd + Display>(
    name: &'static str,
    value: T,
    range: RangeInclusive<T>,
) -> Result<(), WetMapError> {
    if range.contains(&value) {
        return Ok(());
    }
    let expected = format!("{} to {}", range.start(), range.end());
    Err(WetMapError::Parameter { name, value: value.to_string(), expected })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_what_was_put_in() {
        let map = GreyMap::new(3, 2, vec![0.0, 0.1, 0.2, 0.3, 0.4, 1.0]).unwrap();
        assert_eq!(map.get(1, 0), 0.1);
        assert_eq!(map.get(2, 1), 1.0);
        // Round the edges.
        assert_eq!((map.get(3, 0), map.get(4, 3)), (0.0, 0.4));
    }

    #[test]
    fn what_is_no_map_says_why() {
        let error = |width, height, values| GreyMap::new(width, height, values).unwrap_err().to_string();
        assert!(error(0, 3, vec![]).contains("1 to 8192"), "{}", error(0, 3, vec![]));
        assert!(error(8193, 1, vec![]).contains("8193"));
        assert!(error(2, 2, vec![0.0; 3]).contains("need 4 values"));
        let nan = error(2, 2, vec![0.0, 0.0, f32::NAN, 0.0]);
        assert!(nan.contains("(0, 1)") && nan.contains("NaN"), "{nan}");
        assert!(error(2, 1, vec![0.5, 1.5]).contains("(1, 0) is 1.5"));
    }

    #[test]
    fn sums_stop_at_one_and_need_one_size() {
        let map = |values: [f32; 2]| GreyMap::new(2, 1, values.to_vec()).unwrap();
        let sum = map([0.25, 0.75]).add(&map([0.5, 0.5])).unwrap();
        assert_eq!(sum.values, [0.75, 1.0]);
        let upright = GreyMap::new(1, 2, vec![0.0; 2]).unwrap();
        let error = upright.add(&map([0.0; 2])).unwrap_err().to_string();
        assert!(error.contains("1 by 2") && error.contains("2 by 1"), "{error}");
    }
}
