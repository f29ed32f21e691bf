//! A number that two runs share exactly when everything that mattered was the same.

use bevy::platform::collections::HashMap;
use bevy::prelude::*;

use super::ScenarioSurface;
use crate::clock::WeatheringClock;
use crate::collision::Impacts;
use crate::matter::SurfaceMatter;
use crate::wetting::SurfaceWater;

/// Hash over all impacts so far: tick, particle, surface, triangle, uv, water; and over all events that acted. Needs no
/// renderer.
///
/// A chain: each tick's hash is over the one before and what happened in it. So it can be kept and gone on with.
#[derive(Resource, Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct Digest(pub [u8; 32]);

impl Digest {
    /// The hash, 64 hexadecimal digits.
    pub fn to_hex(&self) -> String {
        blake3::Hash::from_bytes(self.0).to_hex().to_string()
    }
}

/// Hash over the impacts and over the water and the matter of all surfaces, in the order of the scenario: the same with and without a
/// renderer.
pub fn amounts_digest<'a>(
    impacts: &Digest,
    surfaces: impl IntoIterator<Item = (&'a SurfaceWater, &'a SurfaceMatter)>,
) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&impacts.0);
    for (water, matter) in surfaces {
        hasher.update(bytemuck::cast_slice(water.texels()));
        hasher.update(bytemuck::cast_slice(water.marks()));
        hasher.update(bytemuck::cast_slice(matter.texels()));
        hasher.update(bytemuck::cast_slice(matter.stirred()));
    }
    hasher.finalize().to_hex().to_string()
}

/// [`amounts_digest`] of the scenario that runs in a world. Without a [`Digest`] there it is as if nothing had been hit.
pub fn scene_digest(world: &mut World) -> String {
    let impacts = world.get_resource::<Digest>().copied().unwrap_or_default();
    let mut surfaces = world.query::<(&ScenarioSurface, &SurfaceWater, &SurfaceMatter)>();
    let mut order: Vec<_> = surfaces.iter(world).collect();
    order.sort_by_key(|(surface, ..)| surface.index);
    amounts_digest(&impacts, order.into_iter().map(|(_, water, matter)| (water, matter)))
}

/// Adds this tick's impacts, which come in the order of their particles.
pub(super) fn digest_impacts(
    clock: Res<WeatheringClock>,
    impacts: Res<Impacts>,
    surfaces: Query<&ScenarioSurface>,
    mut digest: ResMut<Digest>,
    mut numbers: Local<HashMap<Entity, u32>>,
) {
    if impacts.0.is_empty() {
        return;
    }
    let mut hasher = blake3::Hasher::new();
    hasher.update(&digest.0);
    for impact in &impacts.0 {
        let number = *numbers
            .entry(impact.surface)
            .or_insert_with(|| surfaces.get(impact.surface).map_or(u32::MAX, |surface| surface.index));
        let [u, v] = impact.uv.to_array().map(f32::to_bits);
        let row = [clock.tick(), impact.sequence.0, number, impact.triangle, u, v, impact.volume_nl];
        hasher.update(bytemuck::cast_slice(&row));
    }
    digest.0 = *hasher.finalize().as_bytes();
}
