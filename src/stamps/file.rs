//! Strips of stamps in files.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::{RgbaStrip, StampError, StampKind, StampMap, StampStrips};
use crate::output::write_atomic;
use crate::picture::PictureError;

/// Writes `<kind>_diffuse.png`, `<kind>_specular.png` and `<kind>_normal.png` into a folder, which is made if it is
/// missing. They hold numbers, not light: load them as linear. Each is there whole or not at all, and none is
/// written unless all can be encoded.
///
/// # Errors
/// [`StampError::Count`], [`StampError::Picture`].
pub fn write_stamps(
    folder: &Path,
    kind: StampKind,
    strips: &StampStrips,
) -> Result<[PathBuf; 3], StampError> {
    let path = |map: StampMap| folder.join(format!("{}_{map}.png", kind.name()));
    let maps = [
        (StampMap::Diffuse, &strips.diffuse),
        (StampMap::Specular, &strips.specular),
        (StampMap::Normal, &strips.normal),
    ];
    let paths = maps.map(|(map, _)| path(map));
    let mut files = Vec::with_capacity(paths.len());
    for (path, (map, strip)) in paths.iter().zip(maps) {
        // The encoder would panic.
        strip.check_count(map)?;
        files.push(png(strip).map_err(|source| PictureError::Image { path: path.clone(), source })?);
    }
    for (path, bytes) in paths.iter().zip(&files) {
        write_atomic(path, bytes).map_err(|source| PictureError::File { path: path.clone(), source })?;
    }
    Ok(paths)
}

fn png(strip: &RgbaStrip) -> Result<Vec<u8>, image::ImageError> {
    let mut file = Cursor::new(Vec::new());
    PngEncoder::new(&mut file).write_image(
        strip.pixels.as_flattened(),
        strip.width,
        strip.height,
        ExtendedColorType::Rgba8,
    )?;
    Ok(file.into_inner())
}

#[cfg(test)]
mod tests {
    use super::super::{StampOptions, stamps};
    use super::*;

    #[test]
    fn strips_come_back_from_their_files_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let options = StampOptions { size: 16, variants: 3, seed: 1 };
        for kind in StampKind::ALL {
            let strips = stamps(kind, &options).unwrap();
            let paths = write_stamps(&folder.path().join("new"), kind, &strips).unwrap();
            for (path, (map, strip)) in paths.iter().zip([
                ("diffuse", &strips.diffuse),
                ("specular", &strips.specular),
                ("normal", &strips.normal),
            ]) {
                assert!(path.ends_with(format!("new/{}_{map}.png", kind.name())), "{}", path.display());
                let read = image::open(path).unwrap().into_rgba8();
                assert_eq!(read.dimensions(), (48, 16));
                assert_eq!(read.as_raw()[..], *strip.pixels.as_flattened());
            }
        }
    }

    #[test]
    fn what_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("taken"), "x").unwrap();
        let strips = stamps(StampKind::Dust, &StampOptions { size: 16, variants: 1, seed: 0 }).unwrap();
        let error = write_stamps(&folder.path().join("taken"), StampKind::Dust, &strips).unwrap_err();
        assert!(error.to_string().contains("dust_diffuse.png"), "{error}");

        let mut torn = strips;
        torn.normal.pixels.pop();
        let error =
            write_stamps(&folder.path().join("torn"), StampKind::Dust, &torn).unwrap_err().to_string();
        assert!(error.contains("normal") && error.contains("255"), "{error}");
        assert!(!folder.path().join("torn").exists());
    }
}
