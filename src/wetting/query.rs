//! Asking how wet it is, from game code.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::{Exposure, Now, SurfaceWater, WetGeometry};
use crate::clock::WeatheringClock;
use crate::collision::CollisionScene;
use crate::material::PorousMaterial;
use crate::overlay::Splat;
use crate::weather::DryingClock;

/// How wet a place is.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Default)]
#[reflect(Default)]
pub struct Wetness {
    /// How wet it looks, 0..=1: 1 where a film lies.
    pub wetness: f32,
    /// Film on it, mm.
    pub film_mm: f32,
    /// Absorbed, mm.
    pub absorbed_mm: f32,
    /// Part of its pores that is full, 0..=1.
    pub saturation: f32,
}

/// How wet a whole surface is.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Default)]
#[reflect(Default)]
pub struct SurfaceWetness {
    /// Part of its area that looks wetter than a half, 0..=1.
    pub wet_fraction: f32,
    /// Mean of [`Wetness::wetness`] by area, 0..=1.
    pub wetness: f32,
    /// Film on it, ml.
    pub film_ml: f32,
    /// Absorbed, ml.
    pub absorbed_ml: f32,
    /// Its area, m².
    pub area_m2: f32,
}

/// Tells how wet surfaces are, at once: the water is simulated where game code runs, so nothing is waited for.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_weathering::prelude::*;
/// # #[derive(Component)] struct Player;
/// fn slip(wetness: WetnessQuery, floors: Query<Entity, With<Weatherable>>, player: Single<&Transform, With<Player>>) {
///     for floor in &floors {
///         if wetness.at_point(floor, player.translation).is_some_and(|here| here.film_mm > 0.1) {
///             info!("slippery");
///         }
///     }
/// }
/// # bevy::ecs::system::assert_is_system(slip);
/// ```
#[derive(SystemParam)]
pub struct WetnessQuery<'w, 's> {
    clock: Res<'w, WeatheringClock>,
    drying: Res<'w, DryingClock>,
    scene: Res<'w, CollisionScene>,
    surfaces: Query<'w, 's, Wet>,
}

type Wet =
    (&'static SurfaceWater, &'static WetGeometry, Option<&'static Exposure>, Option<&'static PorousMaterial>);

impl WetnessQuery<'_, '_> {
    /// How far from a surface a world point may be, metres.
    pub const REACH: f32 = 0.25;

    /// How wet a surface is at a uv; `None` if it is no surface, or not measured yet.
    pub fn at_uv(&self, surface: Entity, uv: Vec2) -> Option<Wetness> {
        let (water, ..) = self.surfaces.get(surface).ok()?;
        let [x, y] = Splat::center_from_uv(uv, water.size(), water.wrap).map(|middle| (middle >> 8) as u32);
        self.of_texel(surface, y * water.size() + x)
    }

    /// How wet a surface is where it is nearest to a point in world space, whatever else lies there; `None` if that is farther
    /// than [`Self::REACH`].
    pub fn at_point(&self, surface: Entity, point: Vec3) -> Option<Wetness> {
        let mut nearest: Option<(f32, Vec2)> = None;
        for direction in DIRECTIONS {
            let reach = direction.normalize() * Self::REACH;
            // Through the point from both sides: it may lie on the surface, or behind it.
            for (start, end) in [(point - reach * 0.02, point + reach), (point + reach * 0.02, point - reach)]
            {
                let Some(hit) = self.scene.cast_on(surface, start, end) else { continue };
                let distance = hit.point.distance_squared(point);
                if nearest.is_none_or(|(least, _)| distance < least) {
                    nearest = Some((distance, hit.uv));
                }
            }
        }
        self.at_uv(surface, nearest?.1)
    }

    /// How wet a surface is all over. Looks at all its texels.
    pub fn over(&self, surface: Entity) -> Option<SurfaceWetness> {
        let (water, geometry, exposure, material) = self.surfaces.get(surface).ok()?;
        let default = PorousMaterial::default();
        let material = material.unwrap_or(&default);
        let now = self.now(geometry, exposure, material);
        Some(summary(water, &now))
    }

    fn now<'a>(
        &'a self,
        geometry: &'a WetGeometry,
        exposure: Option<&'a Exposure>,
        material: &'a PorousMaterial,
    ) -> Now<'a> {
        Now::new(self.clock.tick(), self.clock.hz(), &self.drying, &geometry.0, exposure, material)
    }

    fn of_texel(&self, surface: Entity, texel: u32) -> Option<Wetness> {
        let (water, geometry, exposure, material) = self.surfaces.get(surface).ok()?;
        let default = PorousMaterial::default();
        let material = material.unwrap_or(&default);
        let now = self.now(geometry, exposure, material);
        // As with drops: what fell beside an island is on the texel that stands in for it.
        Some(wetness_of(water, &now, geometry.0.stand_in(texel).unwrap_or(texel)))
    }
}

/// The axes of an icosahedron and a cube: no surface lies askew to all of them.
const DIRECTIONS: [Vec3; 10] = {
    const PHI: f32 = 1.618_034;
    [
        Vec3::new(0.0, 1.0, PHI),
        Vec3::new(0.0, -1.0, PHI),
        Vec3::new(1.0, PHI, 0.0),
        Vec3::new(-1.0, PHI, 0.0),
        Vec3::new(PHI, 0.0, 1.0),
        Vec3::new(PHI, 0.0, -1.0),
        Vec3::Y,
        Vec3::X,
        Vec3::Z,
        Vec3::new(1.0, 1.0, 1.0),
    ]
};

pub(crate) fn wetness_of(water: &SurfaceWater, now: &Now, texel: u32) -> Wetness {
    let Some(state) = water.texels().get(texel as usize) else { return Wetness::default() };
    let amounts = now.amounts(&now.scale(water.units(), texel), texel, state);
    let look = now.look(&amounts, state);
    let covered = crate::material::film::layer::film_coverage(amounts.film_mm * look.film);
    let capacity = now.matter.capacity_mm;
    Wetness {
        wetness: look.wetness.max(covered) as f32,
        film_mm: amounts.film_mm as f32,
        absorbed_mm: amounts.pores_mm as f32,
        saturation: if capacity > 0.0 { (amounts.pores_mm / capacity).min(1.0) as f32 } else { 0.0 },
    }
}

pub(crate) fn summary(water: &SurfaceWater, now: &Now) -> SurfaceWetness {
    let areas = now.geometry.area_mm2();
    let (mut area, mut wet, mut sum, mut film, mut pores) = (0.0f64, 0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for (texel, &mm2) in areas.iter().enumerate() {
        let mm2 = f64::from(mm2);
        area += mm2;
        if water.texels().get(texel).is_none_or(|state| state.is_dry()) {
            continue;
        }
        let here = wetness_of(water, now, texel as u32);
        let part = f64::from(here.wetness);
        wet += if part > 0.5 { mm2 } else { 0.0 };
        sum += part * mm2;
        film += f64::from(here.film_mm) * mm2;
        pores += f64::from(here.absorbed_mm) * mm2;
    }
    let of_area = |value: f64| if area > 0.0 { (value / area) as f32 } else { 0.0 };
    SurfaceWetness {
        wet_fraction: of_area(wet),
        wetness: of_area(sum),
        film_ml: (film / 1000.0) as f32,
        absorbed_ml: (pores / 1000.0) as f32,
        area_m2: (area / 1e6) as f32,
    }
}

/// Asks for [`BecameWet`] and [`Dried`] messages about this surface, by [`SurfaceWetness::wet_fraction`].
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default)]
pub struct WatchWetness {
    /// It has become wet when more than this part of its area is, 0..=1.
    pub wet_above: f32,
    /// It has dried when less than this part of its area is wet, 0..=1; below `wet_above`.
    pub dry_below: f32,
    /// Seconds of weather between two looks; each looks at all texels.
    pub every: f32,
    /// What was told last.
    pub is_wet: bool,
}

impl Default for WatchWetness {
    fn default() -> Self {
        Self { wet_above: 0.2, dry_below: 0.05, every: 0.5, is_wet: false }
    }
}

/// A surface with [`WatchWetness`] has become wet.
#[derive(Message, Reflect, Debug, Clone, Copy, PartialEq)]
pub struct BecameWet {
    /// The surface.
    pub surface: Entity,
    /// Part of its area that is wet, 0..=1.
    pub wet_fraction: f32,
}

/// A surface with [`WatchWetness`] has dried.
#[derive(Message, Reflect, Debug, Clone, Copy, PartialEq)]
pub struct Dried {
    /// The surface.
    pub surface: Entity,
    /// Part of its area that is still wet, 0..=1.
    pub wet_fraction: f32,
}

/// Looks at watched surfaces every now and then.
pub(super) fn watch_wetness(
    clock: Res<WeatheringClock>,
    wetness: WetnessQuery,
    mut watched: Query<(Entity, &mut WatchWetness)>,
    mut wet: MessageWriter<BecameWet>,
    mut dried: MessageWriter<Dried>,
) {
    for (surface, mut watch) in &mut watched {
        let every = (watch.every * clock.hz() as f32).max(1.0) as u32;
        if !clock.tick().is_multiple_of(every) {
            continue;
        }
        let Some(over) = wetness.over(surface) else { continue };
        if !watch.is_wet && over.wet_fraction > watch.wet_above {
            watch.is_wet = true;
            wet.write(BecameWet { surface, wet_fraction: over.wet_fraction });
        } else if watch.is_wet && over.wet_fraction < watch.dry_below {
            watch.is_wet = false;
            dried.write(Dried { surface, wet_fraction: over.wet_fraction });
        }
    }
}
