//! Where particles come from.
//!
//! An [`Emitter`] sits on an entity with a `Transform` and sends particles along the entity's forward axis
//! (local -Z). How many it owes is kept as an exact remainder: 1,000/s for 10 s are 10,000 particles at any tick
//! rate. Within a tick they are born evenly spread, so a jet is a jet and no row of clouds. Where there is no room for
//! all, fewer stand for more ([`EmissionDetail`]). Each emitter has its own random stream, seeded by [`EmissionSeed`]
//! and the emitter's number; nothing else draws from it. Which emitter it was that wetted a place is known to those who ask
//! ([`TrackSources`]).
//!
//! [`Emitter::hose`], [`Emitter::rain`], [`Emitter::snow`] and [`Emitter::dust`] are what is wanted most.

mod detail;
mod emit;
mod place;
mod shape;
mod silent;
mod sky;
mod sources;
mod state;

use bevy::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::WeatherEffect;
use crate::schedule::{WeatheringSystems, WeatheringTick};

pub use detail::EmissionDetail;
pub use emit::NewParticles;
use emit::emit_particles;
pub(crate) use emit::spawn_particles;
pub use silent::NotEmitting;
pub use sources::{Source, TrackSources};
pub use state::EmitterState;

/// Sends out particles of one effect. Configuration only; see [`EmitterState`] for what it has done.
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(Component, Default)]
#[require(Transform, EmitterState)]
pub struct Emitter {
    /// What it sends out. Nothing is emitted (nor owed) before the asset is loaded; if it cannot be, the log and
    /// [`NotEmitting`] say so.
    pub effect: Handle<WeatherEffect>,
    /// Particles per second, 0 or more.
    pub rate: f32,
    /// Where on the emitter they start.
    pub shape: EmitterShape,
    /// How much it sends out; what a particle carries follows from that.
    pub flow: Flow,
    /// Initial speed in m/s along the emitter's forward axis. 0 under a sky: as fast as its drops fall.
    pub speed: f32,
    /// Half-angle in radians of the cone of directions, 0..=π.
    pub spread: f32,
    /// Seconds until a particle that hits nothing is removed; at most [`Lifespan::MAX_TICKS`] ticks.
    ///
    /// [`Lifespan::MAX_TICKS`]: crate::particle::Lifespan::MAX_TICKS
    pub lifetime: f32,
    /// Number of its random stream. Emitters take their turns in this order; of those with the same, in the
    /// order of their entities, so give each its own where a run must not depend on that.
    pub stream: u32,
    /// Switches it off without losing what it owes.
    pub enabled: bool,
}

impl Default for Emitter {
    fn default() -> Self {
        Self {
            effect: Handle::default(),
            rate: 1000.0,
            shape: EmitterShape::Point,
            flow: Flow::Effect,
            speed: 5.0,
            spread: 0.0,
            lifetime: 5.0,
            stream: 0,
            enabled: true,
        }
    }
}

/// How much an emitter sends out.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Default)]
#[reflect(Default)]
pub enum Flow {
    /// Each particle what its effect says.
    #[default]
    Effect,
    /// So much on the ground below a [`EmitterShape::Sky`], mm/h; from other shapes what the effect says.
    MmPerHour(f32),
    /// A hose.
    LitresPerMinute(f32),
}

impl Emitter {
    /// A hose of so many litres a minute through a nozzle of this diameter, metres: 15 l/min through 6 mm leave it at 8.8 m/s.
    /// Its effect is [`WeatherEffect::HOSE`], or one of yours.
    pub fn hose(effect: Handle<WeatherEffect>, litres_per_minute: f32, nozzle: f32) -> Self {
        let speed = nozzle_speed(litres_per_minute, nozzle / 2.0);
        let shape = EmitterShape::Cone { radius: nozzle / 2.0 };
        Self { effect, flow: Flow::LitresPerMinute(litres_per_minute), shape, speed, ..Self::default() }
    }

    /// What it sends out, mm³/s, if that is given; else what it sends out depends on its rate.
    fn mm3_per_second(&self) -> Option<f32> {
        match (self.flow, self.shape) {
            // A millimetre on a square metre is a litre.
            (Flow::MmPerHour(rate), EmitterShape::Sky { half_size }) => {
                Some(rate * 4.0 * half_size.x * half_size.y * 1.0e6 / 3600.0)
            }
            (Flow::LitresPerMinute(litres), _) => Some(litres * 1.0e6 / 60.0),
            _ => None,
        }
    }

    /// Whether how much it sends out is given, whatever the number of its particles.
    pub fn has_flow(&self) -> bool {
        self.mm3_per_second().is_some()
    }

    /// Whether what says when, where and how fast its particles begin are numbers.
    fn is_finite(&self) -> bool {
        let shape = match self.shape {
            EmitterShape::Point => true,
            EmitterShape::Cone { radius } | EmitterShape::Disc { radius } => radius.is_finite(),
            EmitterShape::Box { half_size } => half_size.is_finite(),
            EmitterShape::Sky { half_size } => half_size.is_finite(),
        };
        shape && [self.rate, self.speed, self.spread].into_iter().all(f32::is_finite)
    }

    /// What a particle carries, mm³, if all that are due are sent: 0 to [`WeatherEffect::MAX_VOLUME_MM3`], and 0 if it is no finite
    /// number.
    pub fn particle_mm3(&self, effect: &WeatherEffect) -> f32 {
        let mm3 = match self.mm3_per_second() {
            Some(mm3_per_second) => mm3_per_second / self.rate.max(1e-6),
            None => effect.volume_mm3,
        };
        if mm3.is_finite() { mm3.clamp(0.0, WeatherEffect::MAX_VOLUME_MM3) } else { 0.0 }
    }
}

/// Speed, m/s, at which so many litres a minute leave a nozzle of this radius, metres.
pub fn nozzle_speed(litres_per_minute: f32, radius: f32) -> f32 {
    litres_per_minute * 1.0e-3 / 60.0 / (std::f32::consts::PI * (radius * radius).max(1e-12))
}

/// Where on an emitter particles start. Lengths in metres, in the emitter's space; forward is -Z.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Default)]
#[reflect(Default)]
pub enum EmitterShape {
    /// All from the origin.
    #[default]
    Point,
    /// A nozzle of this radius. Directions fan out from the axis: straight in the middle, [`Emitter::spread`] at
    /// the rim. A hose.
    Cone {
        /// Radius of the nozzle.
        radius: f32,
    },
    /// Anywhere on a disc across the axis.
    Disc {
        /// Its radius.
        radius: f32,
    },
    /// Anywhere in a box.
    Box {
        /// Half its size per axis.
        #[schemars(with = "[f32; 3]")]
        half_size: Vec3,
    },
    /// A horizontal rectangle in world space, whatever the emitter's rotation, from which particles start
    /// downwards (leaning with [`Emitter::spread`]): rain and snow.
    Sky {
        /// Half its size along world X and Z.
        #[schemars(with = "[f32; 2]")]
        half_size: Vec2,
    },
}

/// Seeds every emitter's random stream. Changing it does not reseed streams already begun.
#[derive(Resource, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct EmissionSeed(pub u64);

/// Lets all [`Emitter`]s write the particles that they owe.
pub struct EmitterPlugin;

impl Plugin for EmitterPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<Emitter>()
            .register_type::<EmissionSeed>()
            .register_type::<EmissionDetail>()
            .register_type::<TrackSources>()
            .register_type::<NotEmitting>()
            .init_resource::<EmissionSeed>()
            .init_resource::<EmissionDetail>()
            .init_resource::<NewParticles>()
            .add_systems(
                WeatheringTick,
                // What is owed in a tick is born in it.
                (place::place_new, emit_particles)
                    .chain()
                    .before(spawn_particles)
                    .in_set(WeatheringSystems::Emit),
            )
            // When all that a frame loads and spawns is there.
            .add_systems(Last, silent::tell_silent);
    }
}
