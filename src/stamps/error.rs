//! What can be wrong with stamps.

use std::fmt::{self, Display, Formatter};

use crate::picture::PictureError;

/// Why stamps could not be made, taken from images or written.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum StampError {
    /// An option is out of range.
    #[error("`{name}` is {value}, but must be {expected}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// What it is.
        value: u32,
        /// What it must be.
        expected: &'static str,
    },
    /// No map at all.
    #[error("none of the diffuse, specular and normal maps is there")]
    NoMaps,
    /// An image that is no strip of so many squares.
    #[error(
        "the {map} map has {width} by {height} texels, but must be {variants} times as wide as high: \
        a strip of {variants} square variants"
    )]
    Strip {
        /// Which image.
        map: StampMap,
        /// Texels along a row.
        width: u32,
        /// Rows.
        height: u32,
        /// How many variants were asked for.
        variants: u32,
    },
    /// Stamps too small, too large, or between two powers of two.
    #[error(
        "the {map} map's stamps have {size} texels along each side, but must have 16, 32, 64, 128 or 256"
    )]
    Size {
        /// Which image.
        map: StampMap,
        /// Texels along each side.
        size: u32,
    },
    /// As many pixels as texels are needed.
    #[error("the {map} map of {width} by {height} texels needs {needed} pixels, there are {got}")]
    Count {
        /// Which image.
        map: StampMap,
        /// Texels along a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Pixels needed.
        needed: usize,
        /// Pixels there.
        got: usize,
    },
    /// Two images of one stamp have different sizes.
    #[error(
        "the {map} map's stamps have {size} texels along each side, those of the {other} map {other_size}: \
        they must be of one size"
    )]
    Sizes {
        /// Which image.
        map: StampMap,
        /// Its texels along each side.
        size: u32,
        /// The image that came before it.
        other: StampMap,
        /// Texels along each side of that.
        other_size: u32,
    },
    /// A file could not be written or encoded.
    #[error(transparent)]
    Picture(#[from] PictureError),
}

/// One of the three images of a stamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StampMap {
    /// Colour.
    Diffuse,
    /// Reflectance and smoothness.
    Specular,
    /// Slopes and height.
    Normal,
}

impl StampMap {
    /// As in the names of files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Diffuse => "diffuse",
            Self::Specular => "specular",
            Self::Normal => "normal",
        }
    }
}

impl Display for StampMap {
    fn fmt(&self, formatter: &mut Formatter) -> fmt::Result {
        formatter.write_str(self.name())
    }
}
