//! Particles: a structure of arrays, by the hundred thousand.
//!
//! Particles are no entities: they live in the columns of one resource, [`Particles`], are born at its end and leave it by
//! being overwritten with the last. One tick moves them by the forces of their [effect](crate::effect); the segment each
//! moved is what [collision](crate::collision) casts. Velocity is constant over a tick, so the segment's start is not
//! stored: it is [`swept_start`].
//!
//! | column | bytes |
//! |---|---|
//! | position | 12 |
//! | velocity | 12 |
//! | [`Lifespan`] | 4 |
//! | volume | 4 |
//! | [`Sequence`] | 4 |
//! | [`EffectIndex`] | 2 |
//! | size class | 1 |

mod draw;
mod integrate;
mod pool;
mod retire;
mod rows;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::effect::EffectIndex;
use crate::emitter::{NewParticles, spawn_particles};
use crate::schedule::{RetireSystems, WeatheringSystems, WeatheringTick};
use crate::weather::Weather;

pub use draw::{
    GpuFrame, GpuLook, GpuParticle, ParticleDrawPlugin, ParticleMaterial, ParticleMesh, Splash, SplashConfig,
    Splashes,
};
pub use integrate::integrate_particles;
pub use pool::{Particle, Particles};
pub(crate) use pool::{SavedParticle, chunk_len, for_each_chunk};
use retire::retire_particles;
pub(crate) use rows::{BoxRows, ROW, WayRows};

/// How long a particle has left, and when within its first tick it was born.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lifespan {
    /// Ticks until it expires; at most [`Self::MAX_TICKS`].
    pub ticks_left: u16,
    /// In the tick of its birth: the part of the tick that had passed by then, in 1/65,536; 0 afterwards.
    pub born_at: u16,
}

/// A number no other living particle has. Gives impacts one order, whatever the threads do.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Sequence(pub u32);

impl Lifespan {
    /// The longest life: 18 minutes at 60 ticks a second.
    pub const MAX_TICKS: u16 = u16::MAX - 1;
    const HIT: u16 = u16::MAX;

    /// Ends the life of a particle that hit a surface.
    pub fn mark_hit(&mut self) {
        self.ticks_left = Self::HIT;
    }

    /// Whether [`Self::mark_hit`] ended it.
    pub fn has_hit(self) -> bool {
        self.ticks_left == Self::HIT
    }

    /// Whether the particle hit something or ran out of time.
    pub fn is_over(self) -> bool {
        self.ticks_left == 0 || self.has_hit()
    }

    /// The part of a tick that a particle moves: less than 1 only in the tick of its birth.
    pub fn moving_part(self) -> f32 {
        1.0 - f32::from(self.born_at) / 65_536.0
    }
}

/// Where the segment that ended at `position` began. The way back is longer by 1e-4 of the segment than the way
/// there, so that consecutive segments overlap and nothing slips between them.
pub fn swept_start(position: Vec3, velocity: Vec3, seconds_moved: f32) -> Vec3 {
    position - velocity * swept_seconds(seconds_moved)
}

/// How long the way back of [`swept_start`] takes.
pub(crate) fn swept_seconds(seconds_moved: f32) -> f32 {
    seconds_moved * 1.0001
}

/// Gravity, the same everywhere. The wind is the [`Weather`]'s.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource, Default)]
pub struct Forces {
    /// m/s².
    pub gravity: Vec3,
}

impl Default for Forces {
    fn default() -> Self {
        Self { gravity: Vec3::new(0.0, -9.81, 0.0) }
    }
}

/// What has happened to all particles so far. `emitted == alive + hit + expired` after every tick, of whatever you put into
/// [`Particles`], too: each tick counts what is there.
#[derive(Resource, Reflect, Serialize, Deserialize, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct ParticleCounts {
    /// Particles spawned.
    pub emitted: u64,
    /// Particles in flight.
    pub alive: u64,
    /// Particles that hit a surface.
    pub hit: u64,
    /// Particles whose lifetime ran out, or that were taken out ([`Particles::clear`]).
    pub expired: u64,
    /// Particles of emitters without a [`Flow`](crate::emitter::Flow) that were not spawned, for want of room
    /// ([`ParticleConfig::max_alive`]) or detail ([`EmissionDetail`](crate::emitter::EmissionDetail)); not part of `emitted`.
    /// What they would carry is missing.
    pub refused: u64,
    /// The same of emitters with a flow; others carry what they would.
    #[serde(default)]
    pub merged: u64,
}

/// The water of all particles so far, nanolitres. `emitted` and what surfaces dripped is what they received, what expired,
/// and what is still in flight, as long as nobody else adds or takes out [`Particles`].
#[derive(Resource, Serialize, Deserialize, Debug, Default, Clone, PartialEq, Eq)]
pub struct WaterCounts {
    /// Sent out by emitters.
    pub emitted_nl: u64,
    /// Carried by particles whose lifetime ran out, by [`EffectIndex`].
    pub expired_nl: Vec<u64>,
}

impl WaterCounts {
    fn expire(&mut self, effect: EffectIndex, water_nl: u32) {
        let row = usize::from(effect.0);
        if self.expired_nl.len() <= row {
            self.expired_nl.resize(row + 1, 0);
        }
        self.expired_nl[row] += u64::from(water_nl);
    }
}

/// Limits on particles.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct ParticleConfig {
    /// The most particles that may be in flight. What emitters would add beyond it is cut from all alike, and counted as
    /// [refused](ParticleCounts::refused) or [merged](ParticleCounts::merged). Drips always fall: emitters make room for
    /// them.
    pub max_alive: u32,
}

impl Default for ParticleConfig {
    fn default() -> Self {
        Self { max_alive: 2_000_000 }
    }
}

/// Spawns, moves and retires particles, whoever made them.
pub struct ParticlePlugin;

impl Plugin for ParticlePlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<Forces>()
            .register_type::<ParticleConfig>()
            .register_type::<ParticleCounts>()
            .init_resource::<Forces>()
            .init_resource::<Weather>()
            .init_resource::<ParticleConfig>()
            .init_resource::<ParticleCounts>()
            .init_resource::<WaterCounts>()
            .init_resource::<Particles>()
            .init_resource::<NewParticles>()
            .add_systems(
                WeatheringTick,
                (
                    spawn_particles.in_set(WeatheringSystems::Emit),
                    integrate_particles.in_set(WeatheringSystems::Integrate),
                    retire_particles.in_set(RetireSystems),
                ),
            );
    }
}
