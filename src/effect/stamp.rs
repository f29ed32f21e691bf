//! The stamps of an effect: made by kind, or read from images beside its file.

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{EffectError, WeatherEffect};
use crate::stamps::{RgbaStrip, StampKind, StampOptions, StampSet, stamps};

/// Where the shapes of an effect's marks come from.
#[derive(Reflect, Serialize, Deserialize, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Default)]
pub enum StampSource {
    /// Round domes.
    #[default]
    Dome,
    /// Stamps of a kind, four of them.
    Kind(StampKind),
    /// PNG strips of so many variants side by side, relative to the effect's file. See [`stamps`](crate::stamps) for what
    /// their channels are. A map without a file is left alone.
    Images {
        /// Tint and coverage.
        diffuse: Option<String>,
        /// Reflectance, smoothness.
        specular: Option<String>,
        /// Slopes and height.
        normal: Option<String>,
        /// 1..=16.
        variants: u32,
    },
}

/// How the stamp of an impact is turned about the surface's normal.
#[derive(Reflect, Serialize, Deserialize, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Default)]
pub enum StampTurn {
    /// At random.
    #[default]
    Random,
    /// Its v axis along the way the particle flew.
    Flight,
    /// Its v axis downhill.
    Downhill,
}

impl StampSource {
    /// The files it needs.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        let files = match self {
            Self::Images { diffuse, specular, normal, .. } => {
                [diffuse, specular, normal].map(Option::as_deref)
            }
            Self::Dome | Self::Kind(_) => [None; 3],
        };
        files.into_iter().flatten()
    }

    /// The stamps, of the bytes of its files; none of a dome.
    ///
    /// # Errors
    /// [`EffectError::Picture`], [`EffectError::Stamps`].
    pub fn read(&self, files: &BTreeMap<String, Vec<u8>>) -> Result<Option<Arc<StampSet>>, EffectError> {
        let strips = match self {
            Self::Dome => return Ok(None),
            Self::Kind(kind) => {
                let options = StampOptions::default();
                let made = stamps(*kind, &options)?;
                let set = StampSet::from_images(
                    Some(&made.diffuse),
                    Some(&made.specular),
                    Some(&made.normal),
                    options.variants,
                )?;
                return Ok(Some(Arc::new(set)));
            }
            Self::Images { diffuse, specular, normal, .. } => [diffuse, specular, normal],
        };
        let mut read: [Option<RgbaStrip>; 3] = [None, None, None];
        for (strip, file) in read.iter_mut().zip(strips) {
            let Some(file) = file else { continue };
            *strip = Some(decoded(file, files.get(file).map_or(&[], Vec::as_slice))?);
        }
        let [diffuse, specular, normal] = &read;
        let Self::Images { variants, .. } = self else { return Ok(None) };
        let set = StampSet::from_images(diffuse.as_ref(), specular.as_ref(), normal.as_ref(), *variants)?;
        Ok(Some(Arc::new(set)))
    }

    /// The stamps of an effect that came without any; none of a dome, and none, with a warning, where files would be needed.
    pub(super) fn made(&self) -> Option<Arc<StampSet>> {
        self.read(&BTreeMap::new()).unwrap_or_else(|error| {
            warn!("an effect made in code paints domes, as images are only read beside a file of its own: {error}");
            None
        })
    }
}

/// The largest strip: 16 stamps of 256 texels.
const MAX_SIDE: u32 = 4096;

fn decoded(file: &str, bytes: &[u8]) -> Result<RgbaStrip, EffectError> {
    let refused = |source| EffectError::Picture { file: file.to_owned(), source };
    let mut reader = image::ImageReader::with_format(std::io::Cursor::new(bytes), image::ImageFormat::Png);
    let mut limits = image::Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    reader.limits(limits);
    let picture = reader.decode().map_err(refused)?.into_rgba8();
    let (width, height) = picture.dimensions();
    Ok(RgbaStrip { width, height, pixels: picture.into_raw().as_chunks::<4>().0.to_vec() })
}

impl WeatherEffect {
    /// Makes the stamps of its kind now, rather than in the frame in which it is first used; loaded effects have theirs.
    ///
    /// # Errors
    /// As [`StampSource::read`].
    pub fn with_stamps(mut self) -> Result<Self, EffectError> {
        self.stamp_set = self.stamps.read(&BTreeMap::new())?;
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_made_and_bad_images_are_named() {
        let effect = WeatherEffect { stamps: StampSource::Kind(StampKind::Drop), ..default() };
        assert_eq!(effect.with_stamps().unwrap().stamp_set.unwrap().variants.len(), 4);
        let missing = StampSource::Images {
            diffuse: Some("spots.png".into()),
            specular: None,
            normal: None,
            variants: 2,
        };
        assert_eq!(missing.files().collect::<Vec<_>>(), ["spots.png"]);
        let error = missing.read(&BTreeMap::new()).unwrap_err().to_string();
        assert!(error.contains("spots.png"), "{error}");
    }
}
