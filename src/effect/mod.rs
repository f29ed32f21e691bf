//! What falls: rain, a hose, dust, as data.
//!
//! A [`WeatherEffect`] says how a particle flies and what it leaves where it hits. Effects are RON assets
//! (`*.effect.ron`); a new effect needs no Rust. Particles do not hold handles: each holds an index into the
//! [`EffectTable`], whose rows are plain numbers that the hot loops read.

mod loader;
mod table;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

pub use loader::{EffectError, WeatherEffectLoader};
pub use table::{EffectIndex, EffectRow, EffectTable};

/// A kind of particle and the mark it leaves. Loaded from `*.effect.ron`.
#[derive(Asset, Reflect, Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct WeatherEffect {
    /// Water a particle carries, in mm³ (1 mm³ is 1 µl). 0 or more, at most [`Self::MAX_VOLUME_MM3`].
    pub water_mm3: f32,
    /// Speed at which drag balances gravity, in m/s; 0 switches drag (and wind) off.
    pub terminal_speed: f32,
    /// Multiplies gravity: 1 falls, 0 floats.
    pub gravity_scale: f32,
    /// Radius of the mark on the surface, in metres.
    pub stamp_radius: f32,
    /// Each stamp's radius is drawn evenly from `stamp_radius` times 1 ± this; 0..=0.9.
    pub stamp_radius_jitter: f32,
    /// Painted over the surface's colour; linear RGB, 0..=1.
    pub diffuse: Paint,
    /// Painted over the surface's gloss: red = reflectance, green = smoothness (1 - perceptual roughness).
    pub specular: Paint,
    /// Dome that the stamp adds to the normal, -1..=1: the sine of the slope at its rim. Negative is a dent.
    pub bump: f32,
    /// How the particle itself looks.
    pub look: ParticleLook,
}

/// A colour and how much of it a stamp lays over what was there.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct Paint {
    /// Linear RGB, 0..=1.
    pub color: [f32; 3],
    /// Opacity in the middle of the stamp, 0..=1. 0 leaves the map alone.
    pub opacity: f32,
}

/// How a particle in flight is drawn.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct ParticleLook {
    /// Linear RGBA, 0..=1.
    pub color: [f32; 4],
    /// Width of the streak in metres.
    pub width: f32,
    /// Length of the streak as seconds of flight (exposure time); 0 draws a point.
    pub exposure: f32,
}

impl WeatherEffect {
    /// The most water a particle may carry: a litre.
    pub const MAX_VOLUME_MM3: f32 = 1.0e6;
}

impl Default for WeatherEffect {
    /// A 2 mm water drop.
    fn default() -> Self {
        Self {
            water_mm3: 4.19,
            terminal_speed: 6.55,
            gravity_scale: 1.0,
            stamp_radius: 0.005,
            stamp_radius_jitter: 0.0,
            diffuse: Paint::default(),
            specular: Paint::default(),
            bump: 0.0,
            look: ParticleLook::default(),
        }
    }
}

impl Default for Paint {
    fn default() -> Self {
        Self { color: [0.0; 3], opacity: 0.0 }
    }
}

impl Default for ParticleLook {
    fn default() -> Self {
        Self { color: [0.75, 0.82, 0.9, 0.35], width: 0.004, exposure: 0.012 }
    }
}

/// Registers the asset, its loader and the [`EffectTable`].
pub struct EffectPlugin;

impl Plugin for EffectPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<WeatherEffect>()
            .register_asset_loader(WeatherEffectLoader)
            .register_asset_reflect::<WeatherEffect>()
            .init_resource::<EffectTable>()
            .add_systems(PreUpdate, table::refresh_effect_table);
    }
}
