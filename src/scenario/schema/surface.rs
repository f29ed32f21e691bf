//! What can get wet: materials, meshes, maps.

use bevy::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::material::{PorousMaterial, StandingWater};
use crate::overlay::Weatherable;
use crate::scenes::stone::Stone;

/// How a surface looks dry and takes up water.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct MaterialSpec {
    /// Linear RGB, 0..=1; multiplies the texture.
    pub color: [f32; 3],
    /// Colour, normal and roughness maps.
    pub texture: TextureSpec,
    /// Repeats of the texture over the uv square, above 0 to 10,000.
    #[schemars(with = "[f32; 2]")]
    pub tiles: Vec2,
    /// Perceptual roughness, 0..=1; multiplies the texture's.
    pub roughness: f32,
    /// Bevy's reflectance, 0..=1: F0 = 0.16 reflectance².
    pub reflectance: f32,
    /// How much of it is metal, which takes up no water, 0..=1.
    pub metallic: f32,
    /// Part of the diffuse light that comes out at the back, dry, 0..=1.
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
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq, Default)]
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
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq, Default)]
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
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct SurfaceSpec {
    /// Unique; names its maps and its row in the report.
    pub name: String,
    /// Its shape.
    pub mesh: MeshSpec,
    /// Name of its material.
    pub material: String,
    /// Position of its origin, metres.
    #[serde(default)]
    #[schemars(with = "[f32; 3]")]
    pub position: Vec3,
    /// Turns around Y, then X, then Z, degrees.
    #[serde(default)]
    #[schemars(with = "[f32; 3]")]
    pub rotation_deg: Vec3,
    /// Times as large, per axis; not 0.
    #[serde(default = "default_scale")]
    #[schemars(with = "[f32; 3]")]
    pub scale: Vec3,
    /// Its maps.
    #[serde(default)]
    pub maps: Weatherable,
    /// A wet map that is played on it, besides what falls.
    #[serde(default)]
    pub wet_map: Option<WetMapSpec>,
}

/// A wet map that is played; see [`PlayedWetMap`](crate::material::PlayedWetMap).
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct WetMapSpec {
    /// `.png`, as `weathering wetmap` makes them.
    pub map: String,
    /// Seconds from dry to wet or back, above 0 to a day.
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
        placed(self.position, self.rotation_deg, self.scale)
    }
}

/// A place as scenarios tell it.
pub(super) fn placed(position: Vec3, rotation_deg: Vec3, scale: Vec3) -> Transform {
    let turn = rotation_deg.map(f32::to_radians);
    let rotation = Quat::from_euler(EulerRot::YXZ, turn.y, turn.x, turn.z);
    Transform { translation: position, rotation, scale }
}

pub(super) fn default_scale() -> Vec3 {
    Vec3::ONE
}

/// Where a mesh comes from.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
pub enum MeshSpec {
    /// A horizontal grid: 2 · cells.x · cells.y triangles.
    Ground {
        /// Along x and z.
        #[schemars(with = "[f32; 2]")]
        size: Vec2,
        /// Along x and z.
        #[schemars(with = "[u32; 2]")]
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
        #[schemars(with = "[f32; 2]")]
        size: Vec2,
        /// Along x and z.
        #[schemars(with = "[u32; 2]")]
        cells: UVec2,
        /// Another one, other basins.
        seed: u32,
    },
    /// A cloth that hangs above its origin in folds and faces +z: 2 · cells.x · cells.y triangles.
    Cloth {
        /// Along x and y.
        #[schemars(with = "[f32; 2]")]
        size: Vec2,
        /// Along x and y.
        #[schemars(with = "[u32; 2]")]
        cells: UVec2,
    },
    /// An upright carved stone plate that faces +z, its lower edge at the origin.
    BasRelief {
        /// Along x and y.
        #[schemars(with = "[f32; 2]")]
        size: Vec2,
        /// Of the carving, metres.
        depth: f32,
        /// Along x and y, over the front.
        #[schemars(with = "[u32; 2]")]
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
        #[schemars(with = "[u32; 2]")]
        cells: UVec2,
        /// Another one, worn elsewhere.
        seed: u32,
    },
    /// A slope of tiles that goes down towards +z.
    Roof {
        /// Along x and down the slope.
        #[schemars(with = "[f32; 2]")]
        size: Vec2,
        /// Slope.
        pitch_deg: f32,
        /// Along x and down the slope.
        #[schemars(with = "[u32; 2]")]
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
