//! What falls: rain, a hose, dust, as data.
//!
//! A [`WeatherEffect`] says how a particle flies and what it leaves where it hits. Effects are RON assets
//! (`*.effect.ron`); a new effect needs no Rust. Some are built in ([`ShippedEffect`]). Particles do not hold handles: each holds an
//! index into the [`EffectTable`], whose rows are plain numbers that the hot loops read.

pub mod drops;
mod loader;
mod shipped;
mod stamp;
mod table;

use std::sync::Arc;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::stamps::StampSet;

pub use drops::DropSizes;
use drops::{SIZE_CLASSES, fall_speed, settling_speed};
pub use loader::{EffectError, WeatherEffectLoader};
pub use shipped::ShippedEffect;
pub use stamp::{StampSource, StampTurn};
pub use table::{EffectIndex, EffectRow, EffectTable};

/// A kind of particle and the mark it leaves. Loaded from `*.effect.ron`.
#[derive(Asset, Reflect, Serialize, Deserialize, Debug, Clone, PartialEq)]
#[reflect(Default)]
#[serde(deny_unknown_fields, default)]
pub struct WeatherEffect {
    /// What a particle carries, in mm³ (1 mm³ is 1 µl), if its emitter has no flow of its own. 0 or more, at most
    /// [`Self::MAX_VOLUME_MM3`].
    pub volume_mm3: f32,
    /// What that is.
    pub carries: Carries,
    /// How large the drops or grains are that it stands for. Their speed is what air slows them down to, if `terminal_speed` is
    /// none.
    pub drops: DropSizes,
    /// Speed at which drag balances gravity, m/s, 0..=1000; 0 switches drag (and wind) off. Not given: that of its drops
    /// ([`fall_speed`]) or, of dust, of its grains ([`settling_speed`]).
    pub terminal_speed: Option<f32>,
    /// How fast it is swayed to and fro in still air, m/s; 0..=10. Flakes flutter. Needs drag.
    pub flutter: f32,
    /// Part of its water that an impact throws up again as two drops, 0..=0.5, if its drops are so large and fast that they
    /// splash ([`splashes`](drops::splashes)). Only where it carries nothing but water.
    pub splash: f32,
    /// Whether its particles are pieces of one jet, as of a hose, and not drops: where they hit they push the film aside, and
    /// sweep along outwards and forwards what they lift ([`matter::jet`](crate::matter::jet)).
    pub jet: bool,
    /// Multiplies gravity, -10..=10: 1 falls, 0 floats.
    pub gravity_scale: f32,
    /// Shapes of the mark on the surface: of what is painted, and by which dust, mud and snow lie where they came. Of an effect made
    /// in code, stamps of a kind are made when it is first used.
    pub stamps: StampSource,
    /// Radius of the mark of a particle with `volume_mm3` or more that strikes with `stamp_speed`, metres,
    /// 1e-6..=100. With less it is
    /// smaller, by (V/V₀)^(5/12), and of water and mud it goes by (v/v₀)^(1/2): as drops spread, to D We^(1/4). Not given: of a
    /// round patch as large as what its drops spread to ([`spread_mm`](drops::spread_mm)), all of them together.
    pub stamp_radius: Option<f32>,
    /// Speed along the surface's normal, m/s, at which what carries water or mud leaves a mark of `stamp_radius`; 0..=1000. Slower it
    /// is smaller, faster it is larger, from [`Self::LEAST_BY_SPEED`] to [`Self::MOST_BY_SPEED`] times. At 0 it is as large at any
    /// speed, and so it always is for dust and snow, which do not spread. Not given: that of its fall.
    pub stamp_speed: Option<f32>,
    /// Each stamp's radius is drawn evenly from `stamp_radius` times 1 ± this; 0..=0.9.
    pub stamp_radius_jitter: f32,
    /// How the mark is turned.
    pub stamp_turn: StampTurn,
    /// How much longer than wide a mark may get by an impact aslant, 0..=7: drawn out along the flight by 1 / cos of the angle to
    /// the normal, up to 1 + this.
    pub stamp_stretch: f32,
    /// Painted over the surface's colour; linear RGB, 0..=1.
    pub diffuse: Paint,
    /// Painted over the surface's gloss, 0..=1: red = reflectance, green = smoothness (1 - perceptual roughness).
    pub specular: Paint,
    /// Dome that the stamp adds to the normal, -1..=1: the sine of the slope at its rim. Negative is a dent.
    pub bump: f32,
    /// How the particle itself looks.
    pub look: ParticleLook,
    /// The stamps of `stamps`, if they are there: loaded with the effect, or made ahead by [`Self::with_stamps`]. While this is
    /// `None`, those of `stamps` are made where they are needed.
    #[serde(skip)]
    #[reflect(ignore)]
    pub stamp_set: Option<Arc<StampSet>>,
}

/// What particles of an effect are made of.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Default)]
#[reflect(Default)]
pub enum Carries {
    /// Water.
    #[default]
    Water,
    /// Dry grains; their volume without pores.
    Dust,
    /// Soil and water; the part of it that is water, 0..=1.
    Mud(f32),
    /// Snow; the volume of its water.
    Snow,
}

impl Carries {
    /// Of a particle's volume what is water, and what is not. To the nanolitre.
    pub fn parts_nl(self, volume_nl: u32) -> (u32, u32) {
        let water = match self {
            Self::Water => volume_nl,
            Self::Dust | Self::Snow => 0,
            Self::Mud(part) => (u64::from(volume_nl) * (part.clamp(0.0, 1.0) * 256.0) as u64 / 256) as u32,
        };
        (water, volume_nl - water)
    }
}

/// A colour and how much of it a stamp lays over what was there.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
#[reflect(Default)]
#[serde(deny_unknown_fields, default)]
pub struct Paint {
    /// Linear RGB, 0..=1.
    pub color: [f32; 3],
    /// Opacity in the middle of the stamp, 0..=1. 0 leaves the map alone.
    pub opacity: f32,
}

/// How a particle in flight is drawn.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
#[reflect(Default)]
#[serde(deny_unknown_fields, default)]
pub struct ParticleLook {
    /// Linear RGBA, 0..=1.
    pub color: [f32; 4],
    /// Width of the streak, metres, 0..=10.
    pub width: f32,
    /// Length of the streak as seconds of flight (exposure time), 0..=10; 0 draws a point.
    pub exposure: f32,
    /// What it looks like.
    pub sprite: Sprite,
    /// Height of the splash where it hits, when it is largest, metres, 0..=10; 0 for none.
    pub splash: f32,
}

/// What a particle looks like.
#[derive(Reflect, Serialize, Deserialize, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Default)]
pub enum Sprite {
    /// A drop that falls while the shutter is open.
    #[default]
    Streak,
    /// A drop.
    Drop,
    /// A snow crystal.
    Flake,
    /// A grain of sand.
    Grain,
    /// A lump of earth.
    Clod,
}

impl WeatherEffect {
    /// The most a particle may carry: a litre.
    pub const MAX_VOLUME_MM3: f32 = 1.0e6;
    /// The largest effect that is read.
    pub const MAX_FILE_BYTES: u64 = 1 << 20;
    /// The largest file of its stamps that is read: twice what the largest takes without compression.
    pub const MAX_PICTURE_BYTES: u64 = 128 << 20;
    /// No mark is narrower for its speed than by this: of a sixteenth of `stamp_speed` or less. There a drop hardly spreads, and has
    /// a size of its own.
    pub const LEAST_BY_SPEED: f32 = 0.25;
    /// No mark is wider for its speed than by this: of four times `stamp_speed` or more. What is so fast breaks up.
    pub const MOST_BY_SPEED: f32 = 2.0;

    /// How fast its drops or grains fall in still air, m/s, by size class: as it says or, where it says nothing, by their diameters.
    /// 0 is no drag.
    pub fn terminal_speeds(&self) -> [f32; SIZE_CLASSES] {
        self.drops.diameters_mm().map(|mm| match (self.terminal_speed, self.carries) {
            (Some(given), _) => given,
            (None, Carries::Dust) => settling_speed(f64::from(mm)) as f32,
            (None, Carries::Water | Carries::Mud(_) | Carries::Snow) => fall_speed(f64::from(mm)) as f32,
        })
    }

    /// Whether it leaves colour, gloss or relief.
    pub fn paints(&self) -> bool {
        self.diffuse.opacity > 0.0 || self.specular.opacity > 0.0 || self.bump != 0.0
    }
}

impl Default for WeatherEffect {
    /// A 2 mm water drop.
    fn default() -> Self {
        Self {
            volume_mm3: 4.19,
            carries: Carries::Water,
            drops: DropSizes::default(),
            terminal_speed: None,
            flutter: 0.0,
            splash: 0.0,
            jet: false,
            gravity_scale: 1.0,
            stamps: StampSource::default(),
            stamp_radius: None,
            stamp_speed: None,
            stamp_radius_jitter: 0.0,
            stamp_turn: StampTurn::default(),
            stamp_stretch: 0.0,
            diffuse: Paint::default(),
            specular: Paint::default(),
            bump: 0.0,
            look: ParticleLook::default(),
            stamp_set: None,
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
        let color = [0.75, 0.82, 0.9, 0.35];
        Self { color, width: 0.004, exposure: 0.012, sprite: Sprite::Streak, splash: 0.0 }
    }
}

/// In `PreUpdate`: the [`EffectTable`] follows its assets.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct EffectSystems;

/// Registers the asset, its loader, the effects that are built in, and the [`EffectTable`].
pub struct EffectPlugin;

impl Plugin for EffectPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<WeatherEffect>()
            .register_asset_loader(WeatherEffectLoader)
            .register_asset_reflect::<WeatherEffect>()
            .init_resource::<EffectTable>()
            .add_systems(PreUpdate, table::refresh_effect_table.in_set(EffectSystems));
        shipped::embed(app.world());
    }
}
