//! A number that two runs share exactly when everything that mattered was the same.

use bevy::platform::collections::HashMap;
use bevy::prelude::*;

use crate::clock::WeatheringClock;
use crate::collision::Impacts;
use crate::overlay::TexelState;

use super::ScenarioSurface;

/// Hash over all impacts so far: tick, particle, surface, triangle, uv, water. Needs no renderer.
#[derive(Resource, Default, Clone)]
pub struct Digest(blake3::Hasher);

impl Digest {
    /// The hash, 64 hexadecimal digits.
    pub fn to_hex(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}

/// Hash over the impacts and over all texels of all surfaces, in the order of the scenario. The texels are integers that
/// GPU and CPU agree on, so this too is the same with and without a renderer.
pub fn amounts_digest<'a>(impacts: &Digest, surfaces: impl IntoIterator<Item = &'a [TexelState]>) -> String {
    let mut hasher = impacts.0.clone();
    for texels in surfaces {
        hasher.update(bytemuck::cast_slice(texels));
    }
    hasher.finalize().to_hex().to_string()
}

/// Adds this tick's impacts, which come in the order of their particles.
pub(super) fn digest_impacts(
    clock: Res<WeatheringClock>,
    impacts: Res<Impacts>,
    surfaces: Query<&ScenarioSurface>,
    mut digest: ResMut<Digest>,
    mut numbers: Local<HashMap<Entity, u32>>,
) {
    for impact in &impacts.0 {
        let number = *numbers
            .entry(impact.surface)
            .or_insert_with(|| surfaces.get(impact.surface).map_or(u32::MAX, |surface| surface.index));
        let [u, v] = impact.uv.to_array().map(f32::to_bits);
        let row = [clock.tick(), impact.sequence.0, number, impact.triangle, u, v, impact.volume_nl];
        digest.0.update(bytemuck::cast_slice(&row));
    }
}
