//! More than the machine can do: nothing is lost, and a window stays responsive.
//!
//! | what is too much | what happens | where it is counted |
//! |---|---|---|
//! | particles in flight | emitters are cut alike; those with a flow send its water with fewer ([`ParticleConfig`](crate::particle::ParticleConfig)) | [`ParticleCounts`](crate::particle::ParticleCounts) |
//! | splats in a frame | the rest waits for the next frames ([`SplatBudget`](crate::overlay::SplatBudget)) | [`SplatStats`](crate::overlay::SplatStats) |
//! | splats that wait | weather time is held until there is room ([`TickHold`](crate::schedule::TickHold)) | there |
//! | time that ticks take, in a window | fewer particles ([`governor`]), and weather time slows down ([`LiveBudget`]) | [`LiveLoad`] |
//!
//! The first three depend on nothing but what is simulated. The last looks at the wall clock, so no two runs need be alike: it is
//! no part of [`WeatheringPlugins`](crate::WeatheringPlugins), and no replay has it. Add [`LiveBudgetPlugin`] to what is watched.
//! [`StageTimesPlugin`] tells what in a tick takes the time.

mod diagnostics;
pub mod governor;
mod live;
mod stages;

pub use diagnostics::OverloadDiagnosticsPlugin;
pub use governor::{Governor, TickReading};
pub use live::{LiveBudget, LiveBudgetPlugin, LiveLoad};
pub(crate) use stages::end_stage;
pub use stages::{STAGES, StageMark, StageMeans, StageTimes, StageTimesPlugin};
