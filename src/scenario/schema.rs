//! What a scenario file may say. Every struct refuses fields it does not know.

use std::collections::BTreeMap;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::emitter::{EmitterShape, Flow, nozzle_speed};
use crate::material::{PorousMaterial, StandingWater};
use crate::overlay::Weatherable;
use crate::scenes::stone::Stone;
use crate::weather::Weather;

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
    /// Length, up to [`Self::MAX_SECONDS`].
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
    /// What can get wet, at most [`Self::MAX_SURFACES`].
    pub surfaces: Vec<SurfaceSpec>,
    /// What makes it wet, at most [`Self::MAX_EMITTERS`].
    #[serde(default)]
    pub emitters: Vec<EmitterSpec>,
}

impl Scenario {
    /// The longest run: a day.
    pub const MAX_SECONDS: f32 = 86_400.0;
    /// The most particles in flight.
    pub const MAX_PARTICLES: u32 = 10_000_000;
    /// The most surfaces.
    pub const MAX_SURFACES: usize = 10_000;
    /// The most emitters.
    pub const MAX_EMITTERS: usize = 4096;
    /// The most particles an emitter sends per second.
    pub const MAX_RATE: f32 = 10_000_000.0;
    /// The most triangles of a generated mesh.
    pub const MAX_TRIANGLES: u64 = 20_000_000;
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
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
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
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct CameraKey {
    /// Seconds.
    #[serde(default)]
    pub t: f32,
    /// Position of the eye.
    pub eye: Vec3,
    /// What it looks at.
    pub target: Vec3,
}

/// The sun.
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct SunSpec {
    /// Where it shines to.
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

/// A photograph of everything around.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
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

/// How a surface looks dry and takes up water.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct MaterialSpec {
    /// Linear RGB; multiplies the texture.
    pub color: [f32; 3],
    /// Colour, normal and roughness maps.
    pub texture: TextureSpec,
    /// Repeats of the texture over the uv square.
    pub tiles: Vec2,
    /// Perceptual roughness; multiplies the texture's.
    pub roughness: f32,
    /// Bevy's reflectance: F0 = 0.16 reflectance².
    pub reflectance: f32,
    /// Metal: takes up no water.
    pub metallic: f32,
    /// Part of the diffuse light that comes out at the back, dry.
    pub translucency: f32,
    /// Seen from both sides.
    pub double_sided: bool,
    /// How porous and how high the texture is from place to place.
    pub surface: SurfaceTextureSpec,
    /// Colour when wet of `model: Authored`, `.png`.
    pub wet_color: Option<String>,
    /// How it gets wet.
    pub porous: PorousMaterial,
    /// Water that stands on it.
    pub water: StandingWater,
}

impl Default for MaterialSpec {
    fn default() -> Self {
        Self {
            color: [1.0; 3],
            texture: TextureSpec::Plain,
            tiles: Vec2::ONE,
            roughness: 0.9,
            reflectance: 0.5,
            metallic: 0.0,
            translucency: 0.0,
            double_sided: false,
            surface: SurfaceTextureSpec::Even,
            wet_color: None,
            porous: PorousMaterial::default(),
            water: StandingWater::default(),
        }
    }
}

/// Where the maps of a material come from.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq, Default)]
pub enum TextureSpec {
    /// No maps.
    #[default]
    Plain,
    /// A colour photograph, `.png`.
    Photo(String),
    /// Generated colour, normal and roughness.
    Stone {
        /// Which stone.
        kind: Stone,
        /// Texels along each side.
        size: u32,
        /// Another piece of the same stone.
        seed: u32,
    },
}

/// Where porosity (red) and height (green) of a material come from.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq, Default)]
pub enum SurfaceTextureSpec {
    /// The same everywhere: as porous as can be, and on top.
    #[default]
    Even,
    /// The relief of the generated stone, whose hollows are more porous.
    Relief,
    /// A `.png`.
    File(String),
}

/// A mesh that can get wet.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct SurfaceSpec {
    /// Unique; names its maps and its row in the report.
    pub name: String,
    /// Its shape.
    pub mesh: MeshSpec,
    /// Name of its material.
    pub material: String,
    /// Position of its origin.
    #[serde(default)]
    pub position: Vec3,
    /// Turns around Y, then X, then Z.
    #[serde(default)]
    pub rotation_deg: Vec3,
    /// Per axis, not 0.
    #[serde(default = "default_scale")]
    pub scale: Vec3,
    /// Its maps.
    #[serde(default)]
    pub maps: Weatherable,
    /// A wet map that is played on it, besides what falls.
    #[serde(default)]
    pub wet_map: Option<WetMapSpec>,
}

/// A wet map that is played; see [`PlayedWetMap`](crate::material::PlayedWetMap).
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct WetMapSpec {
    /// `.png`, as `weathering wetmap` makes them.
    pub map: String,
    /// From dry to wet or back.
    pub seconds: f32,
    /// Softness of the wet border, 0..=1.
    #[serde(default = "default_map_fill")]
    pub t_fill: f32,
    /// Seconds at which it begins.
    #[serde(default)]
    pub start: f32,
    /// Dries instead of wetting.
    #[serde(default)]
    pub dries: bool,
}

fn default_map_fill() -> f32 {
    0.2
}

impl SurfaceSpec {
    /// Where it stands.
    pub fn transform(&self) -> Transform {
        let turn = self.rotation_deg.map(f32::to_radians);
        Transform {
            translation: self.position,
            rotation: Quat::from_euler(EulerRot::YXZ, turn.y, turn.x, turn.z),
            scale: self.scale,
        }
    }
}

fn default_scale() -> Vec3 {
    Vec3::ONE
}

/// Where a mesh comes from.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
pub enum MeshSpec {
    /// A horizontal grid: 2 · cells.x · cells.y triangles.
    Ground {
        /// Along x and z.
        size: Vec2,
        /// Along x and z.
        cells: UVec2,
    },
    /// Sectors around, stacks from pole to pole.
    Sphere {
        /// Metres.
        radius: f32,
        /// At least 3.
        sectors: u32,
        /// At least 2.
        stacks: u32,
    },
    /// A turned vase: 2 · segments · rings triangles.
    Vase {
        /// Metres.
        height: f32,
        /// Around.
        segments: u32,
        /// Along the profile.
        rings: u32,
    },
    /// A flowerpot: 2 · segments · rings triangles.
    Flowerpot {
        /// Metres.
        height: f32,
        /// Around, at least 3.
        segments: u32,
        /// Along the profile, at least 40.
        rings: u32,
    },
    /// A dented sphere that lies on the ground when 0.45 radii above it.
    Rock {
        /// Metres.
        radius: f32,
        /// At least 3.
        sectors: u32,
        /// At least 2.
        stacks: u32,
        /// Another one, another rock.
        seed: u32,
    },
    /// A horizontal grid like `Ground` that knows in its vertex colours where puddles form.
    Road {
        /// Along x and z.
        size: Vec2,
        /// Along x and z.
        cells: UVec2,
        /// Another one, other basins.
        seed: u32,
    },
    /// A cloth that hangs above its origin in folds and faces +z: 2 · cells.x · cells.y triangles.
    Cloth {
        /// Along x and y.
        size: Vec2,
        /// Along x and y.
        cells: UVec2,
    },
    /// An upright carved stone plate that faces +z, its lower edge at the origin.
    BasRelief {
        /// Along x and y.
        size: Vec2,
        /// Of the carving, metres.
        depth: f32,
        /// Along x and y, over the front.
        cells: UVec2,
        /// Another one, other wear.
        seed: u32,
    },
    /// A flight of worn stone steps that goes down towards +z.
    Stair {
        /// Along x, metres.
        width: f32,
        /// How many.
        steps: u32,
        /// Height of a step, metres.
        rise: f32,
        /// Depth of a tread, metres.
        going: f32,
        /// How deep the treads are worn, metres.
        hollow: f32,
        /// Across the width and along a tread.
        cells: UVec2,
        /// Another one, worn elsewhere.
        seed: u32,
    },
    /// A slope of tiles that goes down towards +z.
    Roof {
        /// Along x and down the slope.
        size: Vec2,
        /// Slope.
        pitch_deg: f32,
        /// Along x and down the slope.
        tiles: UVec2,
        /// Across a tile and along it.
        cells: u32,
    },
    /// The body of a small car, its nose towards +x.
    Car {
        /// Metres.
        length: f32,
        /// Quads across its width, at least 4.
        cells: u32,
    },
    /// The first mesh of a `.glb` or `.gltf`.
    File(String),
}

impl EmitterSpec {
    /// m/s; 0 under a sky is as fast as the drops fall.
    pub fn initial_speed(&self) -> f32 {
        self.speed.unwrap_or(match (self.flow, self.shape) {
            (Flow::LitresPerMinute(litres), EmitterShape::Cone { radius }) => nozzle_speed(litres, radius),
            _ => 0.0,
        })
    }
}

/// An emitter that moves along its keys.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct EmitterSpec {
    /// For messages.
    pub name: String,
    /// `.effect.ron`.
    pub effect: String,
    /// Particles per second.
    pub rate: f32,
    /// Where on it they start.
    #[serde(default)]
    pub shape: EmitterShape,
    /// How much it sends out.
    #[serde(default)]
    pub flow: Flow,
    /// m/s. Not given: of a hose that of its flow, under a sky as fast as its drops fall.
    #[serde(default)]
    pub speed: Option<f32>,
    /// Half-angle of the cone of directions.
    #[serde(default)]
    pub spread_deg: f32,
    /// Seconds until a particle that hits nothing is removed.
    #[serde(default = "default_lifetime")]
    pub lifetime: f32,
    /// Seconds at which it starts.
    #[serde(default)]
    pub start: f32,
    /// Seconds at which it stops; the end of the run if left out.
    #[serde(default)]
    pub stop: Option<f32>,
    /// In order of time; one is enough. Linear in between.
    pub keys: Vec<EmitterKey>,
}

fn default_lifetime() -> f32 {
    5.0
}

/// Where an emitter is at a time.
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct EmitterKey {
    /// Seconds.
    #[serde(default)]
    pub t: f32,
    /// Its position.
    pub position: Vec3,
    /// What it aims at.
    pub target: Vec3,
}
