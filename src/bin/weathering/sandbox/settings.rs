//! What the sandbox remembers from one time to the next: a RON file in the user's configuration folder.
//!
//! A file that cannot be read is told of and left out; numbers out of range are brought back into it, and where another version
//! knows an effect that this one does not, the usual one takes its place. It is written whole or not at all, a moment after
//! something has changed and when the program ends.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Instant;

use bevy::prelude::*;
use bevy_weathering::output::write_atomic;
use serde::{Deserialize, Serialize};

use super::theme;

/// All that is remembered.
#[derive(Resource, Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(default)]
pub struct Settings {
    /// Of the panels; see [`theme::ZOOM`].
    pub zoom: f32,
    /// The panels are shown.
    pub panels: bool,
    /// They are in pictures and sequences, too.
    pub panels_in_pictures: bool,
    /// The maps of the selected surface are shown.
    pub maps: bool,
    /// The plots are shown.
    pub plots: bool,
    /// Which of the plots.
    pub charts: [bool; 4],
    /// Title of the open panel.
    pub panel: String,
    /// What the left mouse button does.
    pub tool: Tool,
    /// The hose in the hand.
    pub hose: HoseSettings,
    /// The brushes.
    pub brush: BrushSettings,
    /// The camera flies, and does not turn around a point.
    pub flies: bool,
    /// What is drawn over the scene.
    pub views: DebugViews,
}

/// What the left mouse button does in the scene.
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tool {
    /// Sprays.
    #[default]
    Hose,
    /// Asks how wet it is, and selects the surface.
    Probe,
    /// Brings water.
    Wet,
    /// Takes water away.
    Dry,
    /// Brings dust.
    Dirty,
    /// Takes dust, mud and snow away.
    Clean,
}

/// The brushes.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(default)]
pub struct BrushSettings {
    /// Metres.
    pub radius: f32,
    /// How much a touch does, 0..=1.
    pub strength: f32,
}

impl BrushSettings {
    /// Ranges of radius and strength.
    pub const RANGES: [(f32, f32); 2] = [(0.005, 5.0), (0.01, 1.0)];
}

impl Default for BrushSettings {
    fn default() -> Self {
        Self { radius: 0.12, strength: 0.3 }
    }
}

/// The hose in the hand.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(default)]
pub struct HoseSettings {
    /// Name of what it sprays; see [`effects`](super::effects).
    pub effect: String,
    /// l/min; of matter litres of it.
    pub litres_per_minute: f32,
    /// Diameter of its nozzle, mm.
    pub nozzle_mm: f32,
    /// Half-angle, degrees.
    pub spread_deg: f32,
    /// Particles a second.
    pub rate: f32,
}

impl HoseSettings {
    /// Ranges of flow, nozzle, spread and rate.
    pub const RANGES: [(f32, f32); 4] = [(0.1, 100.0), (1.0, 100.0), (0.0, 60.0), (1.0, 20_000.0)];
}

impl Default for HoseSettings {
    fn default() -> Self {
        Self { effect: "hose".into(), litres_per_minute: 15.0, nozzle_mm: 6.0, spread_deg: 3.0, rate: 600.0 }
    }
}

/// What is drawn over the scene.
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[serde(default)]
pub struct DebugViews {
    /// Boxes of the surfaces' BVHs.
    pub boxes: bool,
    /// How far below the outermost box.
    pub level: u32,
    /// Edges at which uvs break.
    pub seams: bool,
    /// Emitters, and where they point.
    pub emitters: bool,
    /// The wind.
    pub wind: bool,
    /// How many particles are where.
    pub particles: bool,
    /// What surfaces hold.
    pub shade: Shade,
}

/// What of their water surfaces show in false colours.
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shade {
    /// Nothing: they look as they look.
    #[default]
    Off,
    /// How wet it looks.
    Wetness,
    /// Film.
    Film,
    /// Part of the pores that is full.
    Saturation,
    /// Which emitter it came from.
    Source,
}

impl Shade {
    /// The one after it; after the last the first.
    pub fn following(self) -> Self {
        match self {
            Self::Off => Self::Wetness,
            Self::Wetness => Self::Film,
            Self::Film => Self::Saturation,
            Self::Saturation => Self::Source,
            Self::Source => Self::Off,
        }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            zoom: 1.0,
            panels: true,
            panels_in_pictures: false,
            maps: false,
            plots: false,
            charts: [true; 4],
            panel: "Scenes".into(),
            tool: Tool::default(),
            hose: HoseSettings::default(),
            brush: BrushSettings::default(),
            flies: false,
            views: DebugViews::default(),
        }
    }
}

impl Settings {
    /// Brought into range.
    fn repaired(mut self) -> Self {
        let within = |value: f32, (least, most): (f32, f32), default: f32| {
            if value.is_finite() { value.clamp(least, most) } else { default }
        };
        self.zoom = within(self.zoom, theme::ZOOM, 1.0);
        let (hose, default) = (&mut self.hose, HoseSettings::default());
        let [flow, nozzle, spread, rate] = HoseSettings::RANGES;
        hose.litres_per_minute = within(hose.litres_per_minute, flow, default.litres_per_minute);
        hose.nozzle_mm = within(hose.nozzle_mm, nozzle, default.nozzle_mm);
        hose.spread_deg = within(hose.spread_deg, spread, default.spread_deg);
        hose.rate = within(hose.rate, rate, default.rate);
        if super::effects::text(&hose.effect).is_none() {
            hose.effect = default.effect;
        }
        let (brush, default) = (&mut self.brush, BrushSettings::default());
        let [radius, strength] = BrushSettings::RANGES;
        brush.radius = within(brush.radius, radius, default.radius);
        brush.strength = within(brush.strength, strength, default.strength);
        self.views.level = self.views.level.min(super::boxes::DEEPEST);
        self
    }

    /// As they were left; the default, with a warning, where they cannot be read.
    fn read(file: &Path) -> Self {
        let text = match std::fs::read_to_string(file) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Self::default(),
            Err(error) => {
                warn!("settings are not remembered: {}: {error}", file.display());
                return Self::default();
            }
        };
        match ron::from_str::<Self>(&text) {
            Ok(settings) => settings.repaired(),
            Err(error) => {
                warn!("settings are left out: {}:{error}", file.display());
                Self::default()
            }
        }
    }

    fn write(&self, file: &Path) {
        let pretty = ron::ser::PrettyConfig::default();
        let written = ron::ser::to_string_pretty(self, pretty).map_err(std::io::Error::other);
        if let Err(error) = written.and_then(|text| write_atomic(file, text.as_bytes())) {
            warn!("settings are not remembered: {}: {error}", file.display());
        }
    }
}

/// Where they are kept, and what is kept there now.
#[derive(Resource)]
struct Kept {
    file: Option<PathBuf>,
    settings: Settings,
    looked: Instant,
}

/// `$XDG_CONFIG_HOME`, or `~/.config`.
fn settings_file(config: Option<OsString>, home: Option<OsString>) -> Option<PathBuf> {
    // A relative path there is to be left out, says the XDG specification.
    let config = config.map(PathBuf::from).filter(|path| path.is_absolute());
    let home = || home.map(PathBuf::from).filter(|path| path.is_absolute()).map(|home| home.join(".config"));
    Some(config.or_else(home)?.join("bevy_weathering/settings.ron"))
}

pub fn plugin(app: &mut App) {
    let file = settings_file(std::env::var_os("XDG_CONFIG_HOME"), std::env::var_os("HOME"));
    let settings = file.as_deref().map(Settings::read).unwrap_or_default();
    app.insert_resource(Kept { file, settings: settings.clone(), looked: Instant::now() })
        .insert_resource(settings)
        .add_systems(Last, remember);
}

/// Writes what has changed, at most every two seconds, and at the end.
fn remember(settings: Res<Settings>, mut kept: ResMut<Kept>, mut exits: MessageReader<AppExit>) {
    let ends = exits.read().count() > 0;
    if !ends && kept.looked.elapsed().as_secs_f32() < 2.0 {
        return;
    }
    kept.looked = Instant::now();
    if kept.settings != *settings {
        kept.settings = settings.clone();
        if let Some(file) = &kept.file {
            settings.write(file);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_and_nonsense_is_repaired_or_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("new/settings.ron");
        assert_eq!(Settings::read(&file), Settings::default());
        let settings = Settings {
            zoom: 2.0,
            panels_in_pictures: true,
            plots: true,
            panel: "Weather".into(),
            tool: Tool::Probe,
            hose: HoseSettings { effect: "mud".into(), litres_per_minute: 3.0, ..default() },
            views: DebugViews { seams: true, level: 3, shade: Shade::Source, ..default() },
            ..default()
        };
        settings.write(&file);
        assert_eq!(Settings::read(&file), settings);
        let nonsense =
            r#"(zoom: NaN, hose: (effect: "slime", rate: -5.0), views: (level: 99), of_a_later_version: 3)"#;
        std::fs::write(&file, nonsense).unwrap();
        let repaired = Settings::read(&file);
        assert_eq!((repaired.zoom, repaired.hose.rate, repaired.hose.effect.as_str()), (1.0, 1.0, "hose"));
        assert_eq!(repaired.views.level, super::super::boxes::DEEPEST);
        std::fs::write(&file, "(zoom: 1.0").unwrap();
        assert_eq!(Settings::read(&file), Settings::default());
    }

    #[test]
    fn the_file_is_where_the_system_wants_it() {
        let file = |config: Option<&str>, home: Option<&str>| {
            settings_file(config.map(OsString::from), home.map(OsString::from))
        };
        let expected = |path: &str| Some(PathBuf::from(path));
        assert_eq!(file(Some("/c"), Some("/h")), expected("/c/bevy_weathering/settings.ron"));
        assert_eq!(file(None, Some("/h")), expected("/h/.config/bevy_weathering/settings.ron"));
        assert_eq!(file(Some("relative"), Some("/h")), expected("/h/.config/bevy_weathering/settings.ron"));
        assert_eq!(file(None, None), None);
    }
}
