//! What brushes do to texels.

use bevy::ecs::system::SystemParam;
use bevy::math::Affine3A;
use bevy::prelude::*;

use super::footprint::Touched;
use super::{Brush, BrushKind, BrushQueue, Stroke};
use crate::clock::WeatheringClock;
use crate::collision::{MeshBvh, SurfaceCollider};
use crate::material::PorousMaterial;
use crate::matter::snow::rain_on_snow;
use crate::matter::{MatterKind, SurfaceMatter, put, wake};
use crate::weather::{DryingClock, Weather};
use crate::wetting::{Exposure, Now, SurfaceWater, WetGeometry};

type Surface = (
    Entity,
    &'static mut SurfaceWater,
    &'static mut SurfaceMatter,
    &'static WetGeometry,
    &'static SurfaceCollider,
    &'static GlobalTransform,
    Option<&'static Exposure>,
    Option<&'static PorousMaterial>,
);

/// All that can be touched, and what has to be known for it.
#[derive(SystemParam)]
pub struct BrushSurfaces<'w, 's> {
    clock: Res<'w, WeatheringClock>,
    drying: Res<'w, DryingClock>,
    weather: Res<'w, Weather>,
    surfaces: Query<'w, 's, Surface>,
    touched: Local<'s, Touched>,
}

impl BrushSurfaces<'_, '_> {
    /// Paints a stroke at once; how many texels it touched. Surfaces that are not measured yet are left out.
    pub fn paint(&mut self, stroke: &Stroke) -> u32 {
        let Self { clock, drying, weather, surfaces, touched } = self;
        let mut count = 0;
        // Surfaces share nothing: their order does not matter.
        for (entity, mut water, mut matter, geometry, collider, transform, exposure, material) in surfaces {
            if stroke.surface.is_some_and(|only| only != entity) || geometry.0.size() != water.size {
                continue;
            }
            let default = PorousMaterial::default();
            let material = material.unwrap_or(&default);
            let now = Now::new(clock.tick(), clock.hz(), drying, &geometry.0, exposure, material);
            let (water, matter) = (&mut *water, &mut *matter);
            let canvas = Canvas { water, matter, now: &now, weather };
            count += canvas.paint(&stroke.brush, &collider.0, &transform.affine(), touched);
        }
        count
    }
}

/// A surface under a brush.
pub(super) struct Canvas<'a> {
    pub(super) water: &'a mut SurfaceWater,
    pub(super) matter: &'a mut SurfaceMatter,
    pub(super) now: &'a Now<'a>,
    pub(super) weather: &'a Weather,
}

impl Canvas<'_> {
    /// Touches what lies under the brush; how many texels that were. `touched` is memory to work in.
    pub(super) fn paint(
        mut self,
        brush: &Brush,
        mesh: &MeshBvh,
        world_from_mesh: &Affine3A,
        touched: &mut Touched,
    ) -> u32 {
        touched.find(brush, self.now.geometry, mesh, world_from_mesh, self.water.wrap);
        for &(texel, part) in &touched.texels {
            let strength = f64::from(brush.strength) * f64::from(part);
            match brush.kind {
                BrushKind::Wet => self.wet(texel, strength),
                BrushKind::Dry => {
                    self.water.wipe(self.now, texel, strength);
                }
                BrushKind::Dirty => self.dirty(texel, strength),
                BrushKind::Clean => self.clean(texel, strength),
            }
        }
        touched.texels.len() as u32
    }

    fn wet(&mut self, texel: u32, mm: f64) {
        let Self { water, matter, now, weather } = self;
        let units = (mm / now.scale(water.units, texel).unit_mm).round() as u64;
        if units == 0 {
            return;
        }
        water.paint(now, texel, units);
        if let Some(matter) = matter.awake(water.size) {
            rain_on_snow(water, matter, now, weather, texel, units);
        }
    }

    fn dirty(&mut self, texel: u32, mm: f64) {
        let Self { water, matter, now, weather } = self;
        // A mm³ is 1000 nl.
        let nl = (mm * f64::from(now.geometry.area_mm2()[texel as usize]) * 1000.0).round() as u32;
        if nl > 0 {
            wake(water, matter, now);
            put(water, matter, now, weather, MatterKind::Dust, texel, nl);
        }
    }

    fn clean(&mut self, texel: u32, part: f64) {
        let Self { water, matter, .. } = self;
        let Some(matter) = matter.awake(water.size) else { return };
        if matter.wipe(texel, part) > 0 {
            let tile = water.tile_of(texel);
            water.tiles.touch(tile);
        }
    }
}

/// Paints what waits, in order.
pub fn paint_strokes(mut queue: ResMut<BrushQueue>, mut surfaces: BrushSurfaces) {
    if queue.0.is_empty() {
        return;
    }
    for stroke in queue.0.drain(..) {
        match stroke.brush.validate() {
            Ok(()) => {
                surfaces.paint(&stroke);
            }
            Err(wrong) => warn!("a brush was not used: {wrong}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matter::test_world::{Ground, Place, assert_balanced};

    /// A floor of a square metre with 64 texels a side, in still and dry air that takes nothing.
    struct Floor {
        place: Place,
        ground: Ground,
        mesh: MeshBvh,
    }

    impl Floor {
        fn new() -> Self {
            let mut place = Place::flat(64, 1.0 / 64.0);
            place.material = PorousMaterial { capacity_mm: 0.0, ..default() };
            Self { ground: Ground::dry(&place), mesh: MeshBvh::build(place.triangles.clone()), place }
        }

        fn paint(&mut self, kind: BrushKind, strength: f32) -> u32 {
            let brush = Brush { kind, point: Vec3::new(0.5, 0.0, 0.5), radius: 0.2, strength };
            let now = self.place.now(7);
            let (water, matter) = (&mut self.ground.water, &mut self.ground.matter);
            let canvas = Canvas { water, matter, now: &now, weather: &self.place.weather };
            canvas.paint(&brush, &self.mesh, &Affine3A::IDENTITY, &mut Touched::default())
        }

        fn film(&self) -> u64 {
            self.ground.water.texels().iter().map(|texel| u64::from(texel.film)).sum()
        }

        fn assert_balanced(&self) {
            let ledger = self.ground.water.ledger();
            assert_eq!(ledger.received + ledger.painted, self.film() + ledger.spilled + ledger.wiped);
            assert_balanced(&self.ground.matter);
        }
    }

    #[test]
    fn water_that_is_painted_has_the_volume_of_its_bump_and_is_booked() {
        let mut floor = Floor::new();
        assert!(floor.paint(BrushKind::Wet, 0.5) > 400);
        floor.assert_balanced();
        // The integral of (1 - (d/r)²)² over the disc is a third of its area.
        let expected = 0.5 * std::f64::consts::PI * 200.0 * 200.0 / 3.0;
        let painted = floor.ground.water.units().mm3(floor.ground.water.ledger().painted);
        assert!((painted / expected - 1.0).abs() < 0.01, "{painted} {expected}");
        assert!(!floor.ground.water.is_at_rest() && !floor.ground.water.tiles.dirty.is_empty());
    }

    #[test]
    fn what_is_dried_is_gone_and_booked() {
        let mut floor = Floor::new();
        assert!(floor.paint(BrushKind::Dry, 1.0) > 0, "texels lie there");
        assert_eq!(floor.ground.water.ledger().wiped, 0, "but nothing was on them");
        floor.paint(BrushKind::Wet, 0.5);
        let before = floor.film();
        floor.paint(BrushKind::Dry, 1.0);
        floor.assert_balanced();
        assert!(floor.film() < before / 2 && floor.ground.water.ledger().wiped > before / 2);
        let middle = floor.ground.water.texels()[32 * 64 + 32];
        assert!(f64::from(middle.film) < 0.02 * before as f64 / 400.0, "{middle:?}");
    }

    #[test]
    fn dust_is_loose_on_dry_ground_and_bound_on_wet_and_can_be_cleaned_off() {
        let mut floor = Floor::new();
        floor.paint(BrushKind::Clean, 1.0);
        assert!(floor.ground.matter.is_empty());
        floor.paint(BrushKind::Dirty, 0.1);
        let stock = floor.ground.matter.stock();
        assert!(stock.dust > 0 && stock.mud == 0, "{stock:?}");
        floor.paint(BrushKind::Wet, 1.0);
        floor.paint(BrushKind::Dirty, 0.1);
        floor.assert_balanced();
        assert!(floor.ground.matter.stock().mud > 0);
        let before = floor.ground.matter.stock();
        floor.paint(BrushKind::Clean, 0.5);
        floor.assert_balanced();
        let after = floor.ground.matter.stock();
        assert!(after.dust + after.mud < before.dust + before.mud && after.dust + after.mud > 0);
        assert_eq!(floor.ground.matter.ledger().wiped, before.dust + before.mud - after.dust - after.mud);
    }
}
