//! What a scenario file may say: a [`ScenarioPart`], which with all that it includes makes a [`Scenario`]. Every struct
//! refuses fields it does not know.

#[cfg(test)]
mod checks;
mod emitter;
mod part;
mod scene;
mod surface;

use std::collections::BTreeMap;

use bevy::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EventSpec;
use crate::overlay::MapBudget;
use crate::weather::Weather;

pub use emitter::{EmitterKey, EmitterSpec};
pub(in crate::scenario) use part::replace;
pub use part::{EmitterChange, ScenarioPart, WeatherPart};
pub use scene::SceneSpec;
pub use surface::{MaterialSpec, MeshSpec, SurfaceSpec, SurfaceTextureSpec, TextureSpec, WetMapSpec};

/// A scene and what happens in it. Lengths in metres, angles in degrees, time in seconds.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Seeds everything random.
    #[serde(default)]
    pub seed: u64,
    /// Ticks per second, 1..=1000.
    #[serde(default = "default_hz")]
    pub tick_hz: u32,
    /// Length, up to [`Self::MAX_SECONDS`]; rounded to ticks, of which there is at least one.
    pub seconds: f32,
    /// m/s².
    #[serde(default = "default_gravity")]
    pub gravity: Vec3,
    /// m/s.
    #[serde(default)]
    pub wind: Vec3,
    /// What dries. The wind is `wind`, the direction of the sun that of `sun`.
    #[serde(default)]
    pub weather: WeatherSpec,
    /// The most particles in flight, up to [`Self::MAX_PARTICLES`].
    #[serde(default = "default_max_particles")]
    pub max_particles: u32,
    /// What the maps of all surfaces may take, and how fine they are; left out, it is the app's to say.
    #[serde(default)]
    pub map_budget: Option<MapBudgetSpec>,
    /// Where it is seen from.
    pub camera: CameraSpec,
    /// The one light with shadows.
    #[serde(default)]
    pub sun: SunSpec,
    /// What is all around.
    #[serde(default)]
    pub environment: Option<EnvironmentSpec>,
    /// Materials by name.
    pub materials: BTreeMap<String, MaterialSpec>,
    /// What can get wet, at most [`Self::MAX_SURFACES`] with those of `scenes`.
    pub surfaces: Vec<SurfaceSpec>,
    /// Whole glTFs that can get wet, at most [`Self::MAX_SCENES`]. Their surfaces come behind the others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scenes: Vec<SceneSpec>,
    /// What makes it wet, at most [`Self::MAX_EMITTERS`].
    #[serde(default)]
    pub emitters: Vec<EmitterSpec>,
    /// What happens when, at most [`Self::MAX_EVENTS`]. In any order; of those at the same time the first comes first.
    #[serde(default)]
    pub events: Vec<EventSpec>,
    /// Of a recorded session: what was done in it that events cannot say, so that a replay comes out differently.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub flaws: Vec<String>,
}

impl Scenario {
    /// The longest run: a day.
    pub const MAX_SECONDS: f32 = 86_400.0;
    /// The most particles in flight.
    pub const MAX_PARTICLES: u32 = 10_000_000;
    /// The most surfaces.
    pub const MAX_SURFACES: usize = 10_000;
    /// The most glTF scenes.
    pub const MAX_SCENES: usize = 256;
    /// The most emitters.
    pub const MAX_EMITTERS: usize = 4096;
    /// The most events.
    pub const MAX_EVENTS: usize = 10_000;
    /// The most particles an emitter sends per second.
    pub const MAX_RATE: f32 = 10_000_000.0;
    /// The most triangles of a generated mesh.
    pub const MAX_TRIANGLES: u64 = 20_000_000;
    /// The most triangles of all generated meshes together.
    pub const MAX_ALL_TRIANGLES: u64 = 100_000_000;
    /// The most texels of the maps of all surfaces together: 256 of the largest.
    pub const MAX_TEXELS: u64 = 1 << 30;
    /// The most materials: each has textures of its own, which a thread makes.
    pub const MAX_MATERIALS: usize = 256;
    /// The most texels along a side of a picture that is a texture or a wet map.
    pub const MAX_TEXTURE: u32 = 8192;
}

/// The JSON Schema of scenario files. RON's `Kind(field: 1)` is `{"Kind": {"field": 1}}` there, `(field: 1)` an object.
pub fn schema_json() -> serde_json::Value {
    schemars::schema_for!(ScenarioPart).into()
}

fn default_hz() -> u32 {
    crate::clock::WeatheringClock::DEFAULT_HZ
}

fn default_gravity() -> Vec3 {
    crate::particle::Forces::default().gravity
}

fn default_max_particles() -> u32 {
    crate::particle::ParticleConfig::default().max_alive
}

/// A camera that moves along its keys.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct CameraSpec {
    /// Vertical field of view.
    #[serde(default = "default_fov")]
    pub fov_deg: f32,
    /// Exposure value at ISO 100: 15 in bright sun, 12 overcast, 7 indoors.
    #[serde(default = "default_ev100")]
    pub ev100: f32,
    /// In order of time; one is enough. Smooth in between.
    pub keys: Vec<CameraKey>,
}

fn default_fov() -> f32 {
    40.0
}

fn default_ev100() -> f32 {
    12.0
}

/// Where the camera is at a time.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct CameraKey {
    /// Seconds.
    #[serde(default)]
    pub t: f32,
    /// Position of the eye.
    #[schemars(with = "[f32; 3]")]
    pub eye: Vec3,
    /// What it looks at.
    #[schemars(with = "[f32; 3]")]
    pub target: Vec3,
}

/// The sun.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct SunSpec {
    /// Where it shines to.
    #[schemars(with = "[f32; 3]")]
    pub direction: Vec3,
    /// Lux.
    pub illuminance: f32,
    /// Linear RGB.
    pub color: [f32; 3],
    /// Casts shadows.
    pub shadows: bool,
}

impl Default for SunSpec {
    fn default() -> Self {
        Self {
            direction: Vec3::new(-0.5, -1.0, -0.4),
            illuminance: 10_000.0,
            color: [1.0, 0.95, 0.88],
            shadows: true,
        }
    }
}

/// What the weather takes; see [`Weather`].
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct WeatherSpec {
    /// °C, -40..=60.
    pub temperature_c: f32,
    /// Relative, 0..=1.
    pub humidity: f32,
    /// W/m², 0..=1400.
    pub sun_w_per_m2: f32,
    /// How many times faster things dry than in the world, 0..=100,000.
    pub drying_speed: f32,
}

impl Default for WeatherSpec {
    fn default() -> Self {
        let Weather { temperature_c, humidity, sun_w_per_m2, drying_speed, .. } = Weather::default();
        Self { temperature_c, humidity, sun_w_per_m2, drying_speed }
    }
}

impl Scenario {
    /// The weather of the run.
    pub fn weather(&self) -> Weather {
        let WeatherSpec { temperature_c, humidity, sun_w_per_m2, drying_speed } = self.weather;
        let (wind, sun_direction) = (self.wind, self.sun.direction);
        Weather { temperature_c, humidity, wind, sun_direction, sun_w_per_m2, drying_speed }
    }
}

/// What the maps of all surfaces may take; see [`MapBudget`].
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct MapBudgetSpec {
    /// MiB on the GPU, above 0 up to [`Self::MAX_MIB`].
    pub mib: f32,
    /// Width of a texel in the world, mm, above 0 up to [`Self::MAX_TEXEL_MM`]; maps are as large as their surfaces say if
    /// left out.
    pub texel_mm: Option<f32>,
}

impl MapBudgetSpec {
    /// The largest budget: 64 GiB.
    pub const MAX_MIB: f32 = 65_536.0;
    /// The widest texel.
    pub const MAX_TEXEL_MM: f32 = 10_000.0;
}

impl Default for MapBudgetSpec {
    fn default() -> Self {
        let MapBudget { bytes, texel } = MapBudget::default();
        Self { mib: bytes as f32 / (1u32 << 20) as f32, texel_mm: texel.map(|texel| texel * 1000.0) }
    }
}

impl Scenario {
    /// The budget of the run, if the file has one.
    pub fn map_budget(&self) -> Option<MapBudget> {
        let MapBudgetSpec { mib, texel_mm } = self.map_budget?;
        let bytes = (f64::from(mib) * f64::from(1u32 << 20)) as u64;
        Some(MapBudget { bytes, texel: texel_mm.map(|mm| mm / 1000.0) })
    }
}

/// A photograph of everything around.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct EnvironmentSpec {
    /// Equirectangular `.exr`.
    pub map: String,
    /// cd/m² of a texel of value 1.
    #[serde(default = "default_intensity")]
    pub intensity: f32,
    /// Turns the map around the vertical axis.
    #[serde(default)]
    pub turn_deg: f32,
    /// Shows it behind the scene.
    #[serde(default = "default_true")]
    pub skybox: bool,
}

fn default_intensity() -> f32 {
    3_000.0
}

fn default_true() -> bool {
    true
}
