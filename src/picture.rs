//! Pictures in files: read up to a size, written whole or not at all.

use std::fs::File;
use std::io::{BufReader, Cursor};
use std::path::{Path, PathBuf};

use image::error::{ImageError, ParameterError, ParameterErrorKind};
use image::{DynamicImage, ImageBuffer, ImageDecoder, ImageFormat, ImageReader, Limits, Pixel};

use crate::input::require_file;
use crate::output::write_atomic;

/// Why a picture could not be read or written. Every variant names the file.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum PictureError {
    /// The file cannot be read or written.
    #[error("{}: {source}", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is no picture, or the picture cannot be encoded.
    #[error("{}: {source}", .path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ImageError,
    },
    /// The picture is too large.
    #[error("{}: a picture of {width} by {height} pixels: each side may have at most {max}", .path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// Pixels along a row.
        width: u32,
        /// Rows.
        height: u32,
        /// The cap.
        max: u32,
    },
}

/// The most memory a decoder may ask for.
const MAX_BYTES: u64 = 4 << 30;

/// Reads a picture of up to `max_side` pixels a side.
///
/// # Errors
/// [`PictureError`].
pub fn read_picture(path: &Path, format: ImageFormat, max_side: u32) -> Result<DynamicImage, PictureError> {
    let image = |source| PictureError::Image { path: path.into(), source };
    let unreadable = |source| PictureError::File { path: path.into(), source };
    require_file(path).map_err(unreadable)?;
    let file = File::open(path).map_err(unreadable)?;
    let mut reader = ImageReader::with_format(BufReader::new(file), format);
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(image)?;
    // Asked here and not left to the reader's limits, whose error does not say what is allowed.
    let (width, height) = decoder.dimensions();
    if width.max(height) > max_side {
        return Err(PictureError::Size { path: path.into(), width, height, max: max_side });
    }
    DynamicImage::from_decoder(decoder).map_err(image)
}

/// Writes a picture, whole or not at all; makes missing folders.
///
/// # Errors
/// [`PictureError::File`], [`PictureError::Image`].
pub fn write_picture(path: &Path, picture: &DynamicImage, format: ImageFormat) -> Result<(), PictureError> {
    let mut bytes = Cursor::new(Vec::new());
    picture
        .write_to(&mut bytes, format)
        .map_err(|source| PictureError::Image { path: path.into(), source })?;
    write_atomic(path, bytes.get_ref()).map_err(|source| PictureError::File { path: path.into(), source })
}

/// A picture of `size` by `size` pixels from their channels, row by row. `path` is for messages.
///
/// # Errors
/// [`PictureError::Image`] if they are not as many.
pub(crate) fn square<P: Pixel>(
    path: &Path,
    size: u32,
    channels: Vec<P::Subpixel>,
) -> Result<DynamicImage, PictureError>
where
    DynamicImage: From<ImageBuffer<P, Vec<P::Subpixel>>>,
{
    let is_full = channels.len() == (size as usize).pow(2) * usize::from(P::CHANNEL_COUNT);
    let picture = is_full.then(|| ImageBuffer::<P, _>::from_raw(size, size, channels)).flatten();
    picture.map(DynamicImage::from).ok_or_else(|| {
        let wrong = ParameterError::from_kind(ParameterErrorKind::DimensionMismatch);
        PictureError::Image { path: path.into(), source: ImageError::Parameter(wrong) }
    })
}

#[cfg(test)]
mod tests {
    use image::{ColorType, Luma, LumaA, Rgba};

    use super::*;

    #[test]
    fn pictures_of_any_depth_come_back_and_leave_nothing_beside_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/picture.png");
        let pictures = [
            (square::<Rgba<u8>>(&path, 2, (0..16).collect()).unwrap(), ColorType::Rgba8),
            (square::<LumaA<u8>>(&path, 2, (0..8).collect()).unwrap(), ColorType::La8),
            (square::<Luma<u16>>(&path, 2, vec![0, 1, 256, 65_535]).unwrap(), ColorType::L16),
        ];
        for (picture, color) in pictures {
            write_picture(&path, &picture, ImageFormat::Png).unwrap();
            let read = read_picture(&path, ImageFormat::Png, 2).unwrap();
            assert_eq!((&read, read.color()), (&picture, color));
        }
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn what_is_no_picture_or_too_large_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        let error = |max_side| read_picture(&path, ImageFormat::Png, max_side).unwrap_err();
        assert!(matches!(error(9), PictureError::File { .. }));
        std::fs::write(&path, "no picture").unwrap();
        assert!(matches!(error(9), PictureError::Image { .. }));
        write_picture(&path, &square::<Luma<u16>>(&path, 9, vec![7; 81]).unwrap(), ImageFormat::Png).unwrap();
        assert!(read_picture(&path, ImageFormat::Png, 9).is_ok());
        let wide = error(8).to_string();
        assert!(
            wide.contains("picture.png") && wide.contains("9 by 9") && wide.contains("at most 8"),
            "{wide}"
        );
        for count in [0, 80, 82] {
            let torn = square::<Luma<u16>>(&path, 9, vec![7; count]).unwrap_err();
            assert!(matches!(torn, PictureError::Image { .. }), "{count}");
        }
    }
}
