//! Reads `*.effect.ron` and refuses what makes no sense, by field name.

use std::collections::BTreeMap;

use bevy::asset::{AssetLoader, LoadContext, io::Reader};
use bevy::prelude::*;

use super::{Carries, DropSizes, Paint, WeatherEffect};
use crate::stamps::StampError;

/// Loads a [`WeatherEffect`] from RON.
#[derive(Default, TypePath)]
pub struct WeatherEffectLoader;

/// Why an effect was refused.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum EffectError {
    /// The file could not be read.
    #[error("cannot read the effect: {0}")]
    Io(#[from] std::io::Error),
    /// The file is not RON of the right shape.
    #[error("{0}")]
    Ron(#[from] ron::error::SpannedError),
    /// The file is too large to be an effect.
    #[error("it has {size} bytes; an effect has at most {max} (MAX_FILE_BYTES)")]
    TooLarge {
        /// Bytes.
        size: u64,
        /// The cap.
        max: u64,
    },
    /// An image of its stamps is no PNG, or too large.
    #[error("image `{file}`: {source}")]
    Picture {
        /// As the effect names it.
        file: String,
        /// What is wrong.
        source: image::ImageError,
    },
    /// Its stamps cannot be made of these images.
    #[error("field `stamps`: {0}")]
    Stamps(#[from] StampError),
    /// A number is not finite or out of range.
    #[error("field `{field}` is {value}, but must be {expected}")]
    Value {
        /// Path of the field inside the effect.
        field: &'static str,
        /// What it was.
        value: f32,
        /// What it must be.
        expected: &'static str,
    },
}

impl AssetLoader for WeatherEffectLoader {
    type Asset = WeatherEffect;
    type Settings = ();
    type Error = EffectError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _settings: &(),
        context: &mut LoadContext<'_>,
    ) -> Result<WeatherEffect, EffectError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        let mut effect = WeatherEffect::from_ron(&bytes)?;
        let mut files = BTreeMap::new();
        for file in effect.stamps.files() {
            let unreadable =
                |error: &dyn std::error::Error| std::io::Error::other(format!("{file}: {error}"));
            let path = context.path().resolve_embed_str(file).map_err(|error| unreadable(&error))?;
            let bytes = context.read_asset_bytes(path).await.map_err(|error| unreadable(&error))?;
            files.insert(file.to_owned(), bytes);
        }
        effect.stamp_set = effect.stamps.read(&files)?;
        Ok(effect)
    }

    fn extensions(&self) -> &[&str] {
        &["effect.ron"]
    }
}

impl WeatherEffect {
    /// Parses and validates an effect.
    ///
    /// # Errors
    /// [`EffectError`] names the line or the field.
    pub fn from_ron(bytes: &[u8]) -> Result<Self, EffectError> {
        let (size, max) = (bytes.len() as u64, Self::MAX_FILE_BYTES);
        if size > max {
            return Err(EffectError::TooLarge { size, max });
        }
        let options =
            ron::Options::default().with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME);
        let effect: Self = options.from_bytes(bytes)?;
        effect.validate()?;
        Ok(effect)
    }

    /// The text of an effect file, which [`Self::from_ron`] reads to the same effect, but for its stamps: those are made anew, or
    /// read from the files that it names.
    ///
    /// # Errors
    /// [`ron::Error`]; there is none for an effect that is valid.
    pub fn to_ron(&self) -> Result<String, ron::Error> {
        ron::to_string(self)
    }

    /// Checks every number against the range its field documents.
    ///
    /// # Errors
    /// [`EffectError::Value`] for the first field out of range.
    pub fn validate(&self) -> Result<(), EffectError> {
        let zero_to = |field, value: f32, max: f32, expected| within(field, value, 0.0, max, expected);
        zero_to("volume_mm3", self.volume_mm3, Self::MAX_VOLUME_MM3, "0 to 1000000 (a litre)")?;
        zero_to("terminal_speed", self.terminal_speed.unwrap_or(0.0), 1000.0, "0 to 1000 m/s")?;
        if let Carries::Mud(water) = self.carries {
            within("carries", water, 0.0, 1.0, "0 to 1")?;
        }
        match self.drops {
            DropSizes::Same(mm) => within("drops", mm, 0.001, 100.0, "0.001 to 100 mm")?,
            DropSizes::MarshallPalmer(rate) => within("drops", rate, 0.1, 300.0, "0.1 to 300 mm/h")?,
        }
        zero_to("flutter", self.flutter, 10.0, "0 to 10 m/s")?;
        zero_to("splash", self.splash, 0.5, "0 to 0.5")?;
        within("gravity_scale", self.gravity_scale, -10.0, 10.0, "-10 to 10")?;
        within("stamp_radius", self.stamp_radius.unwrap_or(1.0), 1.0e-6, 100.0, "0.000001 to 100 m")?;
        zero_to("stamp_speed", self.stamp_speed.unwrap_or(0.0), 1000.0, "0 to 1000 m/s")?;
        zero_to("stamp_stretch", self.stamp_stretch, 7.0, "0 to 7")?;
        zero_to("stamp_radius_jitter", self.stamp_radius_jitter, 0.9, "0 to 0.9")?;
        self.diffuse.validate("diffuse.color", "diffuse.opacity")?;
        self.specular.validate("specular.color", "specular.opacity")?;
        within("bump", self.bump, -1.0, 1.0, "-1 to 1")?;
        for channel in self.look.color {
            zero_to("look.color", channel, 1.0, "0 to 1")?;
        }
        zero_to("look.width", self.look.width, 10.0, "0 to 10 m")?;
        zero_to("look.exposure", self.look.exposure, 10.0, "0 to 10 s")?;
        zero_to("look.splash", self.look.splash, 10.0, "0 to 10 m")
    }
}

impl Paint {
    fn validate(&self, color: &'static str, opacity: &'static str) -> Result<(), EffectError> {
        for channel in self.color {
            within(color, channel, 0.0, 1.0, "0 to 1")?;
        }
        within(opacity, self.opacity, 0.0, 1.0, "0 to 1")
    }
}

fn within(
    field: &'static str,
    value: f32,
    min: f32,
    max: f32,
    expected: &'static str,
) -> Result<(), EffectError> {
    // Written so that NaN fails.
    if value >= min && value <= max { Ok(()) } else { Err(EffectError::Value { field, value, expected }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::ShippedEffect;

    #[test]
    fn the_default_is_valid_and_survives_a_round_trip() {
        let effect = WeatherEffect::default();
        let text = ron::to_string(&effect).unwrap();
        assert_eq!(WeatherEffect::from_ron(text.as_bytes()).unwrap(), effect);
    }

    #[test]
    fn what_is_written_is_read_as_it_was() {
        for shipped in ShippedEffect::ALL {
            let effect = WeatherEffect::from_ron(shipped.ron.as_bytes()).unwrap();
            let text = effect.to_ron().unwrap();
            assert_eq!(WeatherEffect::from_ron(text.as_bytes()).unwrap(), effect, "{text}");
        }
    }

    #[test]
    fn errors_name_the_field() {
        for (text, field) in [
            ("(volume_mm3: -1.0)", "volume_mm3"),
            ("(volume_mm3: NaN)", "volume_mm3"),
            ("(stamp_radius: 0.0)", "stamp_radius"),
            ("(stamp_speed: -1.0)", "stamp_speed"),
            ("(stamp_speed: NaN)", "stamp_speed"),
            ("(stamp_speed: 1001.0)", "stamp_speed"),
            ("(diffuse: (opacity: 2.0))", "diffuse.opacity"),
            ("(bump: inf)", "bump"),
        ] {
            let error = WeatherEffect::from_ron(text.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(field), "{text}: {error}");
        }
        let error = WeatherEffect::from_ron(b"(wetness: 1.0)").unwrap_err().to_string();
        assert!(error.contains("wetness"), "{error}");
    }
}
