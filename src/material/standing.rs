//! Water that stands on a surface without having fallen there.

use bevy::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Standing water and what rain that is not simulated does to it. Optional, on an entity with
/// [`Weatherable`](crate::overlay::Weatherable); what particles bring comes on top.
#[derive(Component, Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default)]
#[serde(deny_unknown_fields, default)]
pub struct StandingWater {
    /// Where it stands.
    pub flood: Flood,
    /// Depth in mm over which water gets level: the film follows the relief well below it, and is flat well above.
    pub levelling_mm: f32,
    /// Rain whose drops are not simulated, mm/h: ripples, on what lies level. 25 is all there is to see.
    pub rain_mm_per_h: f32,
    /// Side of the cells in which one drop after the other falls, metres.
    pub ripple_cell: f32,
    /// What murky water takes away per mm, per channel.
    pub absorption_per_mm: [f32; 3],
}

impl Default for StandingWater {
    fn default() -> Self {
        Self {
            flood: Flood::None,
            levelling_mm: 0.5,
            rain_mm_per_h: 0.0,
            ripple_cell: 0.25,
            absorption_per_mm: [0.0; 3],
        }
    }
}

/// A law that says where water stands. Height is the green channel of
/// [`WettingTextures::surface`](super::WettingTextures::surface), paint that of the vertex colours; both are 1 where
/// they are missing. On a surface with a flood, vertex colours are not seen as colours.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Default)]
#[reflect(Default)]
pub enum Flood {
    /// Nowhere.
    #[default]
    None,
    /// Lagarde's accumulation, see [`accumulated`](super::film::flood::accumulated).
    Accumulation {
        /// Fills low texels, 0..=1.
        cracks: f32,
        /// Fills painted vertices, from the darkest, 0..=2; from 1.4 on all of them.
        puddles: f32,
    },
    /// True depth, see [`flood_depth`](super::film::flood::flood_depth); mm.
    Level {
        /// Above the lowest point there can be.
        level_mm: f32,
        /// What the paint spans.
        basin_mm: f32,
        /// What the height spans.
        relief_mm: f32,
    },
}
