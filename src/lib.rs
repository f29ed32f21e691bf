// The README's links are relative to the repository, and would lead nowhere from its documentation. Of two definitions of a
// link Markdown takes the first, so these come before its own. Pictures stand inline, for those who read it as a file.
//! [minimal]: https://github.com/bevy-weathering/bevy_weathering/blob/main/examples/minimal.rs
//! [guide]: https://github.com/bevy-weathering/bevy_weathering/blob/main/docs/README.md
//! [gallery]: https://github.com/bevy-weathering/bevy_weathering/blob/main/GALLERY.md
//! [scenarios]: https://github.com/bevy-weathering/bevy_weathering/blob/main/docs/scenarios.md
//! [batch]: https://github.com/bevy-weathering/bevy_weathering/blob/main/docs/batch.md
//! [export]: https://github.com/bevy-weathering/bevy_weathering/blob/main/docs/export.md
//! [sandbox]: https://github.com/bevy-weathering/bevy_weathering/blob/main/docs/sandbox.md
//! [notes]: https://github.com/bevy-weathering/bevy_weathering/blob/main/benches/NOTES.md
//! [hose scenario]: https://github.com/bevy-weathering/bevy_weathering/blob/main/assets/scenarios/hose.ron
//! [architecture]: https://github.com/bevy-weathering/bevy_weathering/blob/main/ARCHITECTURE.md
//! [credits]: https://github.com/bevy-weathering/bevy_weathering/blob/main/assets/CREDITS.md
//!
#![doc = include_str!("../README.md")]

pub mod bake;
pub mod brush;
pub mod clock;
pub mod collision;
pub mod effect;
pub mod emitter;
pub mod export;
mod input;
pub mod material;
pub mod matter;
pub mod offscreen;
pub mod output;
pub mod overlay;
pub mod overload;
pub mod particle;
pub mod picture;
pub mod record;
pub mod replay;
pub mod save;
pub mod scenario;
pub mod scenes;
pub mod schedule;
pub mod stamps;
#[cfg(test)]
mod test_random;
pub mod unwrap;
pub mod weather;
pub mod wetmap;
pub mod wetting;

use bevy::app::PluginGroupBuilder;
use bevy::prelude::*;

/// What a Bevy app needs to get things wet.
pub mod prelude {
    pub use crate::WeatheringPlugins;
    pub use crate::brush::{Brush, BrushKind, BrushQueue, Stroke};
    pub use crate::clock::{ShownTime, WeatheringClock};
    pub use crate::collision::{ReportImpacts, SurfaceImpact};
    pub use crate::effect::{Carries, WeatherEffect};
    pub use crate::emitter::{Emitter, EmitterShape, Flow};
    pub use crate::material::{
        DryMaterial, Flood, PlayedWetMap, PorousMaterial, StandingWater, WettingModel, WettingTextures,
    };
    pub use crate::matter::MatterLook;
    pub use crate::overlay::{MapBudget, OverlayUv, StampSpace, Weatherable, Wrap};
    pub use crate::overload::{LiveBudget, LiveBudgetPlugin};
    pub use crate::particle::Forces;
    pub use crate::schedule::{WeatheringSystems, WeatheringTick};
    pub use crate::weather::Weather;
    pub use crate::wetting::{BecameWet, Dried, SurfaceReady, SurfaceRefused, WatchWetness, WetnessQuery};
}

/// Everything: particles, collision, splats, wet materials. Each part can be [set](PluginGroup::set), and those with a word in the
/// last column can be [left out](PluginGroupBuilder::disable); the others need each other.
///
/// | plugin | does | needs a render app | without it |
/// |---|---|---|---|
/// | [`WeatheringSchedulePlugin`](schedule::WeatheringSchedulePlugin) | orders the sets of a tick | no | |
/// | [`ClockPlugin`](clock::ClockPlugin) | counts ticks | no | |
/// | [`WeatherPlugin`](weather::WeatherPlugin) | how warm, dry, windy and sunny it is | no | nothing dries |
/// | [`EffectPlugin`](effect::EffectPlugin) | loads what falls | no | |
/// | [`EmitterPlugin`](emitter::EmitterPlugin) | sends particles out | no | only what drips, is thrown up, or is made by others falls |
/// | [`ParticlePlugin`](particle::ParticlePlugin) | spawns, moves and retires them | no | |
/// | [`UnwrapPlugin`](unwrap::UnwrapPlugin) | gives meshes whose uvs overlap unique ones | no | surfaces have the uvs of their meshes |
/// | [`CollisionPlugin`](collision::CollisionPlugin) | finds what they hit | no | |
/// | [`DepositPlugin`](overlay::DepositPlugin) | turns impacts into splats | no | |
/// | [`MatterPlugin`](matter::MatterPlugin) | lets dust, mud and snow look as you say | no | they look as they do by default |
/// | [`WettingPlugin`](wetting::WettingPlugin) | absorbs, moves and dries water, and what it meets | no | only marks in colour stay |
/// | [`BrushPlugin`](brush::BrushPlugin) | wets, dries, dirties and cleans by hand | no | there is no [`BrushQueue`](brush::BrushQueue) |
/// | [`OverloadDiagnosticsPlugin`](overload::OverloadDiagnosticsPlugin) | counts what was held back | no | there are no diagnostics |
/// | [`GpuOverlayPlugin`](overlay::GpuOverlayPlugin) | paints splats into maps | yes | put [`CpuOverlayPlugin`](overlay::CpuOverlayPlugin) in its place |
/// | [`WaterUploadPlugin`](wetting::gpu::WaterUploadPlugin) | sends water to be drawn | yes | water is not seen |
/// | [`ParticleDrawPlugin`](particle::ParticleDrawPlugin) | draws particles in flight | yes | they are not seen |
/// | [`PorousMaterialPlugin`](material::PorousMaterialPlugin) | draws wet surfaces | yes | surfaces look dry and clean |
///
/// Without a render app the last four do nothing; add [`CpuOverlayPlugin`](overlay::CpuOverlayPlugin) to have colour maps,
/// too. [Scenarios](scenario) and [replays](replay) need all that needs no render app.
pub struct WeatheringPlugins;

impl PluginGroup for WeatheringPlugins {
    fn build(self) -> PluginGroupBuilder {
        PluginGroupBuilder::start::<Self>()
            .add(schedule::WeatheringSchedulePlugin)
            .add(clock::ClockPlugin::default())
            .add(weather::WeatherPlugin)
            .add(effect::EffectPlugin)
            .add(emitter::EmitterPlugin)
            .add(particle::ParticlePlugin)
            .add(unwrap::UnwrapPlugin)
            .add(collision::CollisionPlugin)
            .add(overlay::DepositPlugin)
            .add(matter::MatterPlugin)
            .add(wetting::WettingPlugin)
            .add(brush::BrushPlugin)
            .add(overload::OverloadDiagnosticsPlugin)
            .add(overlay::GpuOverlayPlugin)
            .add(wetting::gpu::WaterUploadPlugin)
            .add(particle::ParticleDrawPlugin)
            .add(material::PorousMaterialPlugin)
    }
}

/// The code in `docs/` compiles, too.
#[cfg(doctest)]
mod guide {
    #[doc = include_str!("../docs/start.md")]
    #[doc = include_str!("../docs/concepts.md")]
    #[doc = include_str!("../docs/effects.md")]
    #[doc = include_str!("../docs/materials.md")]
    #[doc = include_str!("../docs/performance.md")]
    #[doc = include_str!("../docs/export.md")]
    struct Guide;
}
