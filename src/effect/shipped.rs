//! The effects that come with the library, built into it.
//!
//! Their text is part of the crate, so every app that adds it has them, with and without a renderer. Bevy's asset server hands
//! them out below `embedded://`, beside the app's own files: a path of the app's own is read, and read again when the file
//! changes, as ever. To change one of these, copy its file from `assets/effects` and load the copy.

use std::path::{Path, PathBuf};

use bevy::asset::io::embedded::EmbeddedAssetRegistry;
use bevy::prelude::*;

use super::{EffectError, WeatherEffect};

/// Paths of the effects that come with the library, for the asset server.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_weathering::prelude::*;
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     let rain = Emitter::rain(assets.load(WeatherEffect::RAIN), 10.0, Vec2::splat(3.0));
///     commands.spawn((rain, Transform::from_xyz(0.0, 5.0, 0.0)));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
impl WeatherEffect {
    /// Water from a garden hose, in slugs: for [`Emitter::hose`](crate::emitter::Emitter::hose).
    pub const HOSE: &'static str = "embedded://bevy_weathering/effects/hose.effect.ron";
    /// Drops of the sizes of some 10 mm/h, as fast as they fall: for [`Emitter::rain`](crate::emitter::Emitter::rain).
    pub const RAIN: &'static str = "embedded://bevy_weathering/effects/rain.effect.ron";
    /// Fine drops that drift with the wind and do not splash: for [`Emitter::rain`](crate::emitter::Emitter::rain).
    pub const DRIZZLE: &'static str = "embedded://bevy_weathering/effects/drizzle.effect.ron";
    /// A broad spray that soaks a scene in seconds.
    pub const SOAK: &'static str = "embedded://bevy_weathering/effects/soak.effect.ron";
    /// Flakes that flutter down: for [`Emitter::snow`](crate::emitter::Emitter::snow).
    pub const SNOW: &'static str = "embedded://bevy_weathering/effects/snow.effect.ron";
    /// Grains of 50 micrometres, which go where the wind goes: for [`Emitter::dust`](crate::emitter::Emitter::dust).
    pub const DUST: &'static str = "embedded://bevy_weathering/effects/dust.effect.ron";
    /// Thrown soil with water in it, which leaves raised, coloured marks.
    pub const MUD: &'static str = "embedded://bevy_weathering/effects/mud.effect.ron";
}

/// An effect that comes with the library.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShippedEffect {
    /// As in the name of its file.
    pub name: &'static str,
    /// Its path for the asset server, such as [`WeatherEffect::RAIN`].
    pub path: &'static str,
    /// The text of its file.
    pub ron: &'static str,
}

impl ShippedEffect {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::new("hose", WeatherEffect::HOSE, include_str!("../../assets/effects/hose.effect.ron")),
        Self::new("rain", WeatherEffect::RAIN, include_str!("../../assets/effects/rain.effect.ron")),
        Self::new("drizzle", WeatherEffect::DRIZZLE, include_str!("../../assets/effects/drizzle.effect.ron")),
        Self::new("soak", WeatherEffect::SOAK, include_str!("../../assets/effects/soak.effect.ron")),
        Self::new("snow", WeatherEffect::SNOW, include_str!("../../assets/effects/snow.effect.ron")),
        Self::new("dust", WeatherEffect::DUST, include_str!("../../assets/effects/dust.effect.ron")),
        Self::new("mud", WeatherEffect::MUD, include_str!("../../assets/effects/mud.effect.ron")),
    ];

    const fn new(name: &'static str, path: &'static str, ron: &'static str) -> Self {
        Self { name, path, ron }
    }

    /// The one of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|shipped| shipped.name == name)
    }

    /// The effect, with its stamps, at once and without an asset server: to begin with, if another one is wanted.
    ///
    /// # Errors
    /// As [`WeatherEffect::from_ron`]; a test says that there are none.
    pub fn read(&self) -> Result<WeatherEffect, EffectError> {
        WeatherEffect::from_ron(self.ron.as_bytes())?.with_stamps()
    }

    /// The file it is from, as it would be watched.
    fn file(&self) -> PathBuf {
        PathBuf::from(format!("assets/effects/{}.effect.ron", self.name))
    }

    /// Its path below `embedded://`.
    fn embedded_path(&self) -> &'static Path {
        Path::new(self.path.strip_prefix("embedded://").unwrap_or(self.path))
    }
}

/// Hands the shipped effects to the asset server, if there is one.
pub(super) fn embed(world: &World) {
    let Some(embedded) = world.get_resource::<EmbeddedAssetRegistry>() else { return };
    for shipped in ShippedEffect::ALL {
        embedded.insert_asset(shipped.file(), shipped.embedded_path(), shipped.ron.as_bytes());
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn each_can_be_read_and_has_its_own_path() {
        for shipped in ShippedEffect::ALL {
            let effect = shipped.read().unwrap_or_else(|error| panic!("{}: {error}", shipped.name));
            assert!(effect.volume_mm3 > 0.0, "{}", shipped.name);
            let path = format!("embedded://bevy_weathering/effects/{}.effect.ron", shipped.name);
            assert_eq!(shipped.path, path);
            assert_eq!(ShippedEffect::named(shipped.name), Some(shipped));
        }
        assert_eq!(ShippedEffect::named("hail"), None);
        assert!(ShippedEffect::named("mud").unwrap().read().unwrap().stamp_set.is_some());
    }

    #[test]
    fn no_file_is_forgotten() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/effects");
        let files: BTreeSet<_> =
            std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().file_name()).collect();
        let shipped = ShippedEffect::ALL.map(|shipped| shipped.file().file_name().unwrap().to_owned());
        assert_eq!(files, BTreeSet::from(shipped));
    }
}
