//! Drops that leave a surface become particles again.

use bevy::math::Affine3A;
use bevy::prelude::*;

use super::geometry::{Link, Side};
use super::{Dripping, SurfaceWater, TexelGeometry, WetGeometry};
use crate::clock::WeatheringClock;
use crate::collision::{DeformingCollider, MeshTriangles, SurfaceCollider};
use crate::effect::{Carries, EffectIndex, ParticleLook, Sprite, WeatherEffect};
use crate::emitter::{NewParticles, Source};
use crate::matter::FallingSnow;
use crate::matter::wash::MUDDY_WATER;
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
    /// Grains that it takes along, nanolitres beside its water.
    pub soil_nl: u32,
}

/// Why water leaves a texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DripSite {
    /// The mesh ends on this side, which is lower.
    Edge(Side),
    /// It hangs.
    Overhang,
}

/// The effects whose particles drips are, snow that falls off an edge, and drips with grains in them.
#[derive(Resource, Debug, Clone, Default)]
pub struct DripEffect {
    /// Their assets; they may be edited.
    pub handles: [Handle<WeatherEffect>; 3],
    /// Their rows; none while there is no [`EffectTable`](crate::effect::EffectTable).
    pub rows: Option<[EffectIndex; 3]>,
}

/// A drop of 3.6 mm.
pub fn drip_effect() -> WeatherEffect {
    WeatherEffect {
        volume_mm3: 25.0,
        terminal_speed: Some(8.3),
        stamp_radius: Some(0.011),
        // To which a drop of that size spreads at that speed, of a fall of 1.3 m.
        stamp_speed: Some(5.0),
        stamp_radius_jitter: 0.3,
        ..default()
    }
}

/// A drop with grains in it: a part of them to three of water.
pub fn muddy_drip_effect() -> WeatherEffect {
    let water = MUDDY_WATER as f32;
    WeatherEffect {
        carries: Carries::Mud(water / (water + 1.0)),
        look: ParticleLook { color: [0.16, 0.11, 0.07, 0.8], ..default() },
        ..drip_effect()
    }
}

/// A lump of snow.
pub fn snow_fall_effect() -> WeatherEffect {
    WeatherEffect {
        carries: Carries::Snow,
        volume_mm3: 2000.0,
        terminal_speed: Some(9.0),
        stamp_radius: Some(0.03),
        stamp_radius_jitter: 0.4,
        look: ParticleLook {
            color: [0.92, 0.94, 0.97, 1.0],
            width: 0.02,
            exposure: 0.0,
            sprite: Sprite::Clod,
            splash: 0.0,
        },
        ..default()
    }
}

/// Metres from the surface at which a drop starts.
const CLEARANCE: f32 = 0.003;
/// Grains with which a drip is muddy, nanolitres: with less they are lost on the way.
const LEAST_SOIL_NL: u32 = 10;
/// Seconds a drip may fall.
const LIFETIME: f32 = 6.0;

/// Hands the drips of this tick, and the snow that falls off, to the emitters' queue, surface by surface: they are born in
/// the next tick.
pub(super) fn shed_drips(
    clock: Res<WeatheringClock>,
    effects: Res<DripEffect>,
    mut new: ResMut<NewParticles>,
    mut order: Local<Vec<Entity>>,
    mut surfaces: Query<Shedding>,
) {
    order.clear();
    let sheds = |(_, drips, snow, ..): &(Entity, &Dripping, &FallingSnow, _, _, _, _, _)| {
        !drips.0.is_empty() || !snow.0.is_empty()
    };
    order.extend(surfaces.iter().filter(sheds).map(|(entity, ..)| entity));
    let Some([drop, lump, mud]) = effects.rows else { return };
    order.sort_unstable();
    let ticks_left = (LIFETIME * clock.hz() as f32).min(f32::from(Lifespan::MAX_TICKS)) as u16;
    for &entity in order.iter() {
        let Ok((_, mut drips, mut snow, water, geometry, collider, transform, deforming)) =
            surfaces.get_mut(entity)
        else {
            continue;
        };
        let stance = Stance::new(&geometry.0, collider.0.triangles(), transform, deforming);
        let mut shed = |site: DripSite, texel: u32, volume_nl: u32, effect: EffectIndex| {
            new.attribute_to(water.origins.source(texel));
            let (position, velocity) = (stance.start_of(site, texel), stance.velocity(texel, &clock));
            let lifespan = Lifespan { ticks_left, born_at: 0 };
            new.push(|sequence| Particle {
                position,
                velocity,
                lifespan,
                volume_nl,
                sequence,
                effect,
                class: 0,
            });
        };
        for drip in drips.0.drain(..) {
            // Its grains come down in a part of its water.
            let soil_nl = if drip.soil_nl < LEAST_SOIL_NL { 0 } else { drip.soil_nl };
            let muddy_nl = MUDDY_WATER * soil_nl;
            if soil_nl > 0 {
                shed(drip.site, drip.texel, muddy_nl + soil_nl, mud);
            }
            if drip.water_nl > muddy_nl {
                shed(drip.site, drip.texel, drip.water_nl - muddy_nl, drop);
            }
        }
        for fall in snow.0.drain(..) {
            let volume_nl = u32::try_from(water.units.whole_nl(u64::from(fall.units))).unwrap_or(u32::MAX);
            if volume_nl > 0 {
                shed(fall.site, fall.texel, volume_nl, lump);
            }
        }
    }
    new.attribute_to(Source::UNKNOWN);
}

type Shedding = (
    Entity,
    &'static mut Dripping,
    &'static mut FallingSnow,
    &'static SurfaceWater,
    &'static WetGeometry,
    &'static SurfaceCollider,
    &'static GlobalTransform,
    Option<&'static DeformingCollider>,
);

/// A surface as it stands now.
struct Stance<'a> {
    geometry: &'a TexelGeometry,
    triangles: &'a MeshTriangles,
    world_from_mesh: Affine3A,
    /// If it is posed: the pose, and where that lies.
    posed: Option<(&'a DeformingCollider, Affine3A)>,
}

impl<'a> Stance<'a> {
    fn new(
        geometry: &'a TexelGeometry,
        triangles: &'a MeshTriangles,
        transform: &GlobalTransform,
        deforming: Option<&'a DeformingCollider>,
    ) -> Self {
        let is_known = |deforming: &&DeformingCollider| deforming.posed().is_some();
        let posed = deforming.filter(is_known).map(|pose| (pose, pose.world_from_shape(transform)));
        Self { geometry, triangles, world_from_mesh: transform.affine(), posed }
    }

    /// Where a texel's middle lies in the world, and the normal there. In a pose that is not a number, where it lies at rest.
    fn point(&self, texel: u32) -> Option<(Vec3, Vec3)> {
        self.posed_point(texel)
            .or_else(|| self.geometry.point(texel, self.triangles, &self.world_from_mesh))
            .filter(|(point, _)| point.is_finite())
    }

    fn posed_point(&self, texel: u32) -> Option<(Vec3, Vec3)> {
        let (pose, world_from_shape) = self.posed?;
        let (posed, owner) = (pose.posed()?, self.geometry.owner(texel)? as usize);
        let uvs = posed.triangles().uvs.get(owner)?;
        let corners = posed.corners(owner).map(|corner| world_from_shape.transform_point3(corner));
        let mirrored = world_from_shape.matrix3.determinant() < 0.0;
        let found = self.geometry.point_on(texel, uvs, corners, mirrored);
        (found.0.is_finite() && found.1.is_finite()).then_some(found)
    }

    /// How fast that place moves with its pose, m/s. What moves as a whole lets its drops go as if it stood still.
    fn velocity(&self, texel: u32, clock: &WeatheringClock) -> Vec3 {
        let velocity = || {
            let (pose, world_from_shape) = self.posed?;
            let owner = self.geometry.owner(texel)? as usize;
            let weights = self.geometry.weights(texel, pose.posed()?.triangles().uvs.get(owner)?);
            Some(world_from_shape.transform_vector3(pose.velocity(owner, weights, clock)))
        };
        velocity().filter(|velocity| velocity.is_finite()).unwrap_or_default()
    }

    /// Where a drop begins to fall: in front of what is steep, beyond the edge of what is flat, below what overhangs.
    fn start_of(&self, site: DripSite, texel: u32) -> Vec3 {
        let geometry = self.geometry;
        let Some((point, normal)) = self.point(texel) else { return Vec3::ZERO };
        let off = normal * CLEARANCE;
        match site {
            DripSite::Edge(side) if geometry.facing_up(texel) > 0.5 => {
                let behind = match geometry.link(texel, side.opposite()) {
                    Link::Texel(behind) => self.point(behind),
                    Link::Edge => None,
                };
                let out = behind.map_or(Vec3::ZERO, |(behind, _)| (point - behind).normalize_or_zero());
                point + out * (0.5 * geometry.distance(texel, side) + CLEARANCE) + off
            }
            _ => point + off,
        }
    }
}
