//! What can be wrong with a wet map.

use std::path::PathBuf;

use crate::picture::PictureError;

/// Why a wet map could not be made, read or written.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum WetMapError {
    /// An option is out of range.
    #[error("`{name}` is {value}, but must be {expected}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// What it is.
        value: String,
        /// What it must be.
        expected: String,
    },
    /// A map or photograph without texels, or with too many.
    #[error("a map of {width} by {height} texels: each side must have 1 to {max} (MAX_SIZE)")]
    Size {
        /// Texels along u.
        width: u32,
        /// Texels along v.
        height: u32,
        /// The cap.
        max: u32,
    },
    /// As many values as texels are needed.
    #[error("{width} by {height} texels need {needed} values, there are {got}")]
    Count {
        /// Texels along u.
        width: u32,
        /// Texels along v.
        height: u32,
        /// Values needed.
        needed: usize,
        /// Values there.
        got: usize,
    },
    /// A value that is NaN or outside 0..=1.
    #[error("the texel at ({x}, {y}) is {value}, but must be 0 to 1")]
    Value {
        /// Along u.
        x: u32,
        /// Along v.
        y: u32,
        /// What it is.
        value: f32,
    },
    /// Two maps or photographs that belong together have different sizes.
    #[error(
        "one has {width} by {height} texels, the other {other_width} by {other_height}: \
        they must be of one size"
    )]
    Sizes {
        /// Texels along u of the first.
        width: u32,
        /// Texels along v of the first.
        height: u32,
        /// Texels along u of the second.
        other_width: u32,
        /// Texels along v of the second.
        other_height: u32,
    },
    /// Photographs too small to tell a spot from noise.
    #[error("photographs of {width} by {height} pixels: each side must have at least {min}")]
    TooSmall {
        /// Pixels along a row.
        width: u32,
        /// Rows.
        height: u32,
        /// The least.
        min: u32,
    },
    /// Nothing in two photographs can be compared.
    #[error("no pixel can be compared: wherever one looks, a photograph is black, NaN or infinite")]
    NothingToCompare,
    /// No texel of the map lies on the surface.
    #[error("no texel of the map lies on the surface: its texture coordinates cover nothing")]
    NoSurface,
    /// A file of a kind that is no map.
    #[error("{}: a map or photograph ends in .png or .exr", .path.display())]
    Extension {
        /// The file.
        path: PathBuf,
    },
    /// A file could not be read or written, is no picture, or too large a one.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// A file is a picture, but no map.
    #[error("{}: {source}", .path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<WetMapError>,
    },
}
