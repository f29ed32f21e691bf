//! Drops that leave a surface become particles again.

use bevy::math::Affine3A;
use bevy::prelude::*;

use super::geometry::{Link, Side};
use super::{TexelGeometry, WetGeometry};
use crate::clock::WeatheringClock;
use crate::collision::{MeshTriangles, SurfaceCollider};
use crate::effect::{EffectIndex, EffectTable, WeatherEffect};
use crate::emitter::NewParticles;
use crate::particle::{Lifespan, Particle};

/// A drop that is about to fall.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Drip {
    /// The texel it leaves.
    pub texel: u32,
    /// From where on it.
    pub site: DripSite,
    /// Nanolitres.
    pub water_nl: u32,
}

/// Why water leaves a texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DripSite {
    /// The mesh ends on this side, which is lower.
    Edge(Side),
    /// It hangs.
    Overhang,
}

/// The effect whose particles drips are.
#[derive(Resource, Debug, Clone, Default)]
pub struct DripEffect {
    /// Its asset; changed, it is another drip's from then on.
    pub handle: Handle<WeatherEffect>,
    /// Its row.
    pub index: Option<EffectIndex>,
}

/// A drop of 3.6 mm.
pub fn drip_effect() -> WeatherEffect {
    WeatherEffect {
        volume_mm3: 25.0,
        terminal_speed: Some(8.3),
        stamp_radius: Some(0.011),
        stamp_radius_jitter: 0.3,
        ..default()
    }
}

/// Metres from the surface at which a drop starts.
const CLEARANCE: f32 = 0.003;
/// Seconds a drip may fall.
const LIFETIME: f32 = 6.0;

/// Hands the drips of this tick to the emitters' queue, surface by surface: they are born in the next tick.
pub(super) fn shed_drips(
    clock: Res<WeatheringClock>,
    mut effect: ResMut<DripEffect>,
    mut effects: ResMut<EffectTable>,
    mut new: ResMut<NewParticles>,
    mut order: Local<Vec<Entity>>,
    mut surfaces: Query<(Entity, &mut super::Dripping, &WetGeometry, &SurfaceCollider, &GlobalTransform)>,
) {
    order.clear();
    order.extend(surfaces.iter().filter(|(_, drips, ..)| !drips.0.is_empty()).map(|(entity, ..)| entity));
    if order.is_empty() {
        return;
    }
    order.sort_unstable();
    let handle = effect.handle.clone();
    let index = *effect.index.get_or_insert(effects.index_of(&handle).unwrap_or(EffectIndex(0)));
    let ticks_left = (LIFETIME * clock.hz() as f32).min(f32::from(Lifespan::MAX_TICKS)) as u16;
    for &entity in order.iter() {
        let Ok((_, mut drips, geometry, collider, transform)) = surfaces.get_mut(entity) else { continue };
        for drip in drips.0.drain(..) {
            let start = start_of(&drip, &geometry.0, collider.0.triangles(), &transform.affine());
            new.push(|sequence| Particle {
                position: start,
                velocity: Vec3::ZERO,
                lifespan: Lifespan { ticks_left, born_at: 0 },
                volume_nl: drip.water_nl,
                sequence,
                effect: index,
                class: 0,
            });
        }
    }
}

/// Where a drop begins to fall: in front of what is steep, beyond the edge of what is flat, below what overhangs.
fn start_of(
    drip: &Drip,
    geometry: &TexelGeometry,
    triangles: &MeshTriangles,
    world_from_mesh: &Affine3A,
) -> Vec3 {
    let at = |texel| geometry.point(texel, triangles, world_from_mesh);
    let Some((point, normal)) = at(drip.texel) else { return Vec3::ZERO };
    let off = normal * CLEARANCE;
    match drip.site {
        DripSite::Edge(side) if geometry.facing_up(drip.texel) > 0.5 => {
            let behind = match geometry.link(drip.texel, side.opposite()) {
                Link::Texel(behind) => at(behind),
                Link::Edge => None,
            };
            let out = behind.map_or(Vec3::ZERO, |(behind, _)| (point - behind).normalize_or_zero());
            point + out * (0.5 * geometry.distance(drip.texel, side) + CLEARANCE) + off
        }
        _ => point + off,
    }
}
