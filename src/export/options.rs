//! How a scene is rained on and baked.

use super::ExportError;
use crate::clock::WeatheringClock;
use crate::effect::{ShippedEffect, WeatherEffect};
use crate::material::PorousMaterial;
use crate::overlay::{TILE_SIZE, Weatherable};
use crate::replay::ReplayOptions;
use crate::scenario::check_weather;
use crate::weather::Weather;

/// How a scene is rained on and baked.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportOptions {
    /// Water on level ground, mm/h, 0.1 to 300; less over a scene of kilometres.
    pub rain_mm_per_h: f32,
    /// How long it rains, minutes, above 0 and up to [`Self::MAX_MINUTES`].
    pub minutes: f32,
    /// The wind, and what dries meanwhile.
    pub weather: Weather,
    /// What falls. Its flow is that of `rain_mm_per_h`; drops of Marshall and Palmer's sizes get those of that rain. Stamps
    /// from files must have been read.
    pub effect: WeatherEffect,
    /// What all surfaces are made of.
    pub material: PorousMaterial,
    /// Texels along each side of a surface's maps, a multiple of 16 from 16 to [`Weatherable::MAX_MAP_SIZE`].
    pub map_size: u32,
    /// Texels along each side of the baked textures, 16 to [`Self::MAX_TEXTURE_SIZE`]. None: as many as the largest texture
    /// of the material has, but from `map_size` to 2048.
    pub texture_size: Option<u32>,
    /// Ticks a second, 1 to [`WeatheringClock::MAX_HZ`]. Films run at most one texel a tick.
    pub tick_hz: u32,
    /// Particles that fall on the ground below the scene each second, above 0 and up to 100,000; each stands for many drops.
    pub particles_per_second: f32,
    /// Seed of the rain.
    pub seed: u64,
    /// Threads to compute ticks with, 1 to [`Self::MAX_THREADS`]; all cores if `None`. The first app of a process decides for
    /// all that follow.
    pub threads: Option<usize>,
}

impl Default for ExportOptions {
    /// Ten minutes of rain of 10 mm/h, without wind.
    fn default() -> Self {
        Self {
            rain_mm_per_h: 10.0,
            minutes: 10.0,
            weather: Weather::default(),
            effect: rain(),
            material: PorousMaterial::default(),
            map_size: 512,
            texture_size: None,
            tick_hz: 30,
            particles_per_second: 1000.0,
            seed: 1,
            threads: None,
        }
    }
}

/// The rain that is shipped.
fn rain() -> WeatherEffect {
    // A test says that it can be read.
    ShippedEffect::named("rain").and_then(|rain| rain.read().ok()).unwrap_or_default()
}

impl ExportOptions {
    /// The longest rain, minutes.
    pub const MAX_MINUTES: f32 = 1440.0;
    /// The largest texture, texels along each side.
    pub const MAX_TEXTURE_SIZE: u32 = 8192;
    /// The most threads; no system starts any number of them.
    pub const MAX_THREADS: usize = ReplayOptions::MAX_THREADS;

    /// Ticks that it rains.
    pub(super) fn ticks(&self) -> u32 {
        (f64::from(self.minutes) * 60.0 * f64::from(self.tick_hz)).round().max(1.0) as u32
    }

    /// Checks a size of textures.
    pub(super) fn check_texture_size(size: Option<u32>) -> Result<(), ExportError> {
        match size {
            Some(size) if !(TILE_SIZE..=Self::MAX_TEXTURE_SIZE).contains(&size) => Err(ExportError::Option {
                option: "texture-size",
                value: size.to_string(),
                expected: format!("{TILE_SIZE} to {}", Self::MAX_TEXTURE_SIZE),
            }),
            _ => Ok(()),
        }
    }

    /// Checks all that can be checked without the scene.
    ///
    /// # Errors
    /// [`ExportError::Option`], [`ExportError::Effect`].
    pub fn check(&self) -> Result<(), ExportError> {
        let wrong = |option, value: String, expected: String| ExportError::Option { option, value, expected };
        let numbers = [
            ("rain", self.rain_mm_per_h, 0.1, 300.0),
            ("minutes", self.minutes, 1e-3, Self::MAX_MINUTES),
            ("particles", self.particles_per_second, 1e-3, 100_000.0),
        ];
        for (option, value, least, most) in numbers {
            // Written so that NaN fails.
            if !(value >= least && value <= most) {
                return Err(wrong(option, value.to_string(), format!("{least} to {most}")));
            }
        }
        if let Err(out) = check_weather(&self.weather).and_then(|()| self.material.validate()) {
            let expected = format!("{} to {}", out.least, out.most);
            return Err(wrong(out.field, out.value.to_string(), expected));
        }
        let sizes = [
            ("size", self.map_size, TILE_SIZE, Weatherable::MAX_MAP_SIZE),
            ("hz", self.tick_hz, 1, WeatheringClock::MAX_HZ),
        ];
        for (option, value, least, most) in sizes {
            if !(least..=most).contains(&value) {
                return Err(wrong(option, value.to_string(), format!("{least} to {most}")));
            }
        }
        Self::check_texture_size(self.texture_size)?;
        if !self.map_size.is_multiple_of(TILE_SIZE) {
            return Err(wrong("size", self.map_size.to_string(), format!("a multiple of {TILE_SIZE}")));
        }
        if let Some(threads) = self.threads
            && !(1..=Self::MAX_THREADS).contains(&threads)
        {
            return Err(wrong("threads", threads.to_string(), format!("1 to {}", Self::MAX_THREADS)));
        }
        Ok(self.effect.validate()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::DropSizes;

    #[test]
    fn the_rain_that_is_shipped_can_be_read() {
        assert!(matches!(rain().drops, DropSizes::MarshallPalmer(_)));
        ExportOptions::default().check().unwrap();
        assert_eq!(ExportOptions { minutes: 0.5, ..Default::default() }.ticks(), 900);
    }

    #[test]
    fn what_is_out_of_range_is_named() {
        type Edit = fn(&mut ExportOptions);
        let edits: [(Edit, &str); 9] = [
            (|options| options.rain_mm_per_h = 0.0, "`rain`"),
            (|options| options.minutes = f32::NAN, "`minutes`"),
            (|options| options.particles_per_second = -1.0, "`particles`"),
            (|options| options.weather.wind.y = f32::INFINITY, "`wind.y`"),
            (|options| options.map_size = 100, "`size`"),
            (|options| options.texture_size = Some(1), "`texture-size`"),
            (|options| options.tick_hz = 0, "`hz`"),
            (|options| options.threads = Some(0), "`threads`"),
            (|options| options.threads = Some(1025), "1 to 1024"),
        ];
        for (edit, named) in edits {
            let mut options = ExportOptions::default();
            edit(&mut options);
            let error = options.check().unwrap_err().to_string();
            assert!(error.contains(named), "{named}: {error}");
        }
    }
}
