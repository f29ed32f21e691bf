//! What was too much, in Bevy's diagnostics.

use bevy::diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic};
use bevy::prelude::*;

use super::LiveLoad;
use crate::emitter::EmissionDetail;
use crate::overlay::SplatStats;
use crate::particle::ParticleCounts;
use crate::schedule::TickHold;

/// Tells Bevy's diagnostics, once a frame, how much there is and what was held back.
pub struct OverloadDiagnosticsPlugin;

impl OverloadDiagnosticsPlugin {
    /// Particles in flight.
    pub const ALIVE: DiagnosticPath = DiagnosticPath::const_new("weathering/particles/alive");
    /// Particles not spawned so far, of emitters without a flow.
    pub const REFUSED: DiagnosticPath = DiagnosticPath::const_new("weathering/particles/refused");
    /// Particles not spawned so far, of emitters with a flow.
    pub const MERGED: DiagnosticPath = DiagnosticPath::const_new("weathering/particles/merged");
    /// Part of the particles that are sent.
    pub const DETAIL: DiagnosticPath = DiagnosticPath::const_new("weathering/particles/detail");
    /// Splats that wait on their way to the GPU.
    pub const PENDING: DiagnosticPath = DiagnosticPath::const_new("weathering/splats/pending");
    /// Splats that had to wait for a later frame so far.
    pub const CARRIED: DiagnosticPath = DiagnosticPath::const_new("weathering/splats/carried");
    /// Splats that could not be painted so far; see [`SplatStats::lost`].
    pub const LOST: DiagnosticPath = DiagnosticPath::const_new("weathering/splats/lost");
    /// Ticks that were held so far.
    pub const HELD: DiagnosticPath = DiagnosticPath::const_new("weathering/ticks/held");
    /// Milliseconds that a tick takes, where a [`LiveBudgetPlugin`](super::LiveBudgetPlugin) measures it.
    pub const TICK_MS: DiagnosticPath = DiagnosticPath::const_new("weathering/ticks/ms");
    /// How fast weather time goes, in parts of what it should.
    pub const SPEED: DiagnosticPath = DiagnosticPath::const_new("weathering/ticks/speed");

    /// All of them.
    pub const ALL: [DiagnosticPath; 10] = [
        Self::ALIVE,
        Self::REFUSED,
        Self::MERGED,
        Self::DETAIL,
        Self::PENDING,
        Self::CARRIED,
        Self::LOST,
        Self::HELD,
        Self::TICK_MS,
        Self::SPEED,
    ];
}

impl Plugin for OverloadDiagnosticsPlugin {
    fn build(&self, app: &mut App) {
        for path in Self::ALL {
            app.register_diagnostic(Diagnostic::new(path));
        }
        app.add_systems(Last, measure);
    }
}

/// Parts that an app has left out have nothing to tell.
fn measure(
    counts: Option<Res<ParticleCounts>>,
    detail: Option<Res<EmissionDetail>>,
    splats: Option<Res<SplatStats>>,
    hold: Option<Res<TickHold>>,
    load: Option<Res<LiveLoad>>,
    mut diagnostics: Diagnostics,
) {
    use OverloadDiagnosticsPlugin as Paths;
    let mut tell = |path: &DiagnosticPath, value: f64| diagnostics.add_measurement(path, || value);
    if let Some(counts) = counts {
        tell(&Paths::ALIVE, counts.alive as f64);
        tell(&Paths::REFUSED, counts.refused as f64);
        tell(&Paths::MERGED, counts.merged as f64);
    }
    if let Some(detail) = detail {
        tell(&Paths::DETAIL, f64::from(detail.factor()));
    }
    if let Some(splats) = splats {
        tell(&Paths::PENDING, splats.pending() as f64);
        tell(&Paths::CARRIED, splats.carried() as f64);
        tell(&Paths::LOST, splats.lost() as f64);
    }
    if let Some(hold) = hold {
        tell(&Paths::HELD, hold.ticks as f64);
    }
    if let Some(load) = load {
        tell(&Paths::TICK_MS, f64::from(load.governor.tick_ms()));
        tell(&Paths::SPEED, f64::from(load.speed));
    }
}
