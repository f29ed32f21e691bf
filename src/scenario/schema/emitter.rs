//! What makes it wet.

use bevy::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::emitter::{EmitterShape, Flow, nozzle_speed};

/// An emitter that moves along its keys.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct EmitterSpec {
    /// For messages.
    pub name: String,
    /// `.effect.ron`.
    pub effect: String,
    /// Particles per second, 0..=10,000,000.
    pub rate: f32,
    /// Where on it they start.
    #[serde(default)]
    pub shape: EmitterShape,
    /// How much it sends out.
    #[serde(default)]
    pub flow: Flow,
    /// m/s, 0..=1000. Not given: of a hose that of its flow, under a sky as fast as its drops fall.
    #[serde(default)]
    pub speed: Option<f32>,
    /// Half-angle of the cone of directions, degrees, 0..=180.
    #[serde(default)]
    pub spread_deg: f32,
    /// Seconds until a particle that hits nothing is removed; above 0 to 3600, and at most 65,534 ticks.
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

impl EmitterSpec {
    /// m/s; 0 under a sky is as fast as the drops fall.
    pub fn initial_speed(&self) -> f32 {
        self.speed.unwrap_or(match (self.flow, self.shape) {
            (Flow::LitresPerMinute(litres), EmitterShape::Cone { radius }) => nozzle_speed(litres, radius),
            _ => 0.0,
        })
    }
}

fn default_lifetime() -> f32 {
    5.0
}

/// Where an emitter is at a time.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct EmitterKey {
    /// Seconds.
    #[serde(default)]
    pub t: f32,
    /// Its position, metres.
    #[schemars(with = "[f32; 3]")]
    pub position: Vec3,
    /// What it aims at, metres.
    #[schemars(with = "[f32; 3]")]
    pub target: Vec3,
}
