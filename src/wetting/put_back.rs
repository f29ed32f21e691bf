//! Taking a surface back to what it held before.
//!
//! What is kept is the water and matter of one surface, and the texels that it lies on. If its maps have got another size
//! meanwhile, it is brought to the present and shared out among the new texels as when maps are resized, to the unit.
//!
//! Not here: colour maps, which stay as they are; what is falling, or waits to be soaked up.

use std::sync::Arc;

use bevy::prelude::*;

use super::tiles::Tiles;
use super::{Exposure, Now, Shares, SurfaceWater, TexelGeometry, WetGeometry};
use crate::clock::WeatheringClock;
use crate::collision::{MeshBvh, SurfaceCollider};
use crate::material::PorousMaterial;
use crate::matter::{SurfaceMatter, bind_dried};
use crate::overlay::{Unmapped, is_reached};
use crate::weather::DryingClock;

/// Why a surface cannot be as it was; goes on from its name.
#[derive(thiserror::Error, Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NotPutBack {
    /// It was taken away.
    #[error("is no more")]
    Gone,
    /// It is being measured, which passes.
    #[error("is being measured")]
    Measured,
    /// It has no maps: others needed the room.
    #[error("has no maps now")]
    Unmapped,
    /// It has another mesh, or its maps have other edges, or a side that is no halving or doubling of what it was.
    #[error("has another shape by now")]
    Reshaped,
}

/// What a surface holds at a moment, to be [put back](Self::put_back) later.
#[derive(Clone)]
pub struct KeptSurface {
    water: SurfaceWater,
    matter: SurfaceMatter,
    /// Of the maps that it had.
    geometry: Arc<TexelGeometry>,
    bvh: Arc<MeshBvh>,
}

impl KeptSurface {
    /// What is on a surface of this shape.
    pub fn new(
        water: &SurfaceWater,
        matter: &SurfaceMatter,
        geometry: &WetGeometry,
        collider: &SurfaceCollider,
    ) -> Self {
        Self {
            water: water.clone(),
            matter: matter.clone(),
            geometry: geometry.0.clone(),
            bvh: collider.0.clone(),
        }
    }

    /// What is on a surface; `None` if it is not measured, or has no maps.
    pub fn of(world: &World, surface: Entity) -> Option<Self> {
        let surface = world.get_entity(surface).ok()?;
        Some(Self::new(surface.get()?, surface.get()?, surface.get()?, surface.get()?))
    }

    /// Bytes of water and matter. What the surface is measured by is shared with it as long as its maps keep their size.
    pub fn bytes(&self) -> usize {
        self.water.bytes() + self.matter.bytes()
    }

    /// Takes the surface's water and matter back to these, accounts included: whatever came, left or moved since then has not.
    /// What was there dries and is absorbed as if it had been left alone. May be done any number of times.
    ///
    /// # Errors
    /// [`NotPutBack`]; then nothing has happened.
    pub fn put_back(&self, world: &mut World, surface: Entity) -> Result<(), NotPutBack> {
        let Ok(entity) = world.get_entity(surface) else { return Err(NotPutBack::Gone) };
        if entity.contains::<Unmapped>() {
            return Err(NotPutBack::Unmapped);
        }
        let (Some(there), Some(geometry), Some(collider)) =
            (entity.get::<SurfaceWater>(), entity.get::<WetGeometry>(), entity.get::<SurfaceCollider>())
        else {
            return Err(NotPutBack::Measured);
        };
        let is_like = there.wrap == self.water.wrap && is_reached(self.water.size, there.size);
        if !is_like || !Arc::ptr_eq(&collider.0, &self.bvh) {
            return Err(NotPutBack::Reshaped);
        }
        if [geometry.0.size(), self.geometry.size()] != [there.size, self.water.size] {
            return Err(NotPutBack::Measured);
        }
        let (water, matter) = if there.size == self.water.size {
            (self.water.clone(), self.matter.clone())
        } else {
            let geometry = geometry.0.clone();
            self.resized(world, surface, &geometry)
        };
        let mut contents = world.query::<(&mut SurfaceWater, &mut SurfaceMatter)>();
        let Ok((mut there, mut beside)) = contents.get_mut(world, surface) else {
            return Err(NotPutBack::Measured);
        };
        there.become_again(&mut beside, water, matter);
        Ok(())
    }

    /// As it is by now, on the maps that the surface has now.
    fn resized(&self, world: &World, surface: Entity, to: &TexelGeometry) -> (SurfaceWater, SurfaceMatter) {
        let (mut water, mut matter) = (self.water.clone(), self.matter.clone());
        let mut from = self.geometry.clone();
        if let (Some(clock), Some(drying)) =
            (world.get_resource::<WeatheringClock>(), world.get_resource::<DryingClock>())
            && water.is_wet()
        {
            let material = world.get::<PorousMaterial>(surface).copied().unwrap_or_default();
            let exposure = world.get::<Exposure>(surface).map(|now| now.resized(to.size(), from.size()));
            water.settle_all(&Now::new(
                clock.tick(),
                clock.hz(),
                drying,
                &from,
                exposure.as_ref(),
                &material,
            ));
        }
        bind_dried(&mut water, &mut matter);
        // Maps grow by steps, and texels are shared out step by step.
        let affine = world.get::<GlobalTransform>(surface).map(GlobalTransform::affine).unwrap_or_default();
        while 2 * from.size() < to.size() {
            let (triangles, size) = (self.bvh.triangles(), 2 * from.size());
            let between = TexelGeometry::new(triangles, &affine, Vec3::Y, size, water.wrap);
            matter = matter.resized(&Shares::new(from.size(), &between));
            water = water.resized(&from, &between);
            from = Arc::new(between);
        }
        (water.resized(&from, to), matter.resized(&Shares::new(from.size(), to)))
    }
}

impl SurfaceWater {
    /// Becomes what it was, on maps of the size and the edges that it has, and the matter beside it, too.
    fn become_again(
        &mut self,
        matter: &mut SurfaceMatter,
        water_before: SurfaceWater,
        matter_before: SurfaceMatter,
    ) {
        let shown: Vec<u32> = (0..self.tiles.flags.len() as u32)
            .filter(|&tile| self.tiles.has(tile, Tiles::WET) || self.tiles.has(tile, Tiles::DIRTY))
            .collect();
        // There is room on the GPU by now, and it shows what is forgotten.
        let (has_marks, has_matter) = (!self.marks.is_empty(), !matter.is_empty());
        *self = water_before;
        *matter = matter_before;
        if has_matter {
            matter.wake(self.size);
        }
        if !shown.is_empty() || has_marks || has_matter {
            self.wake(has_marks);
        }
        if !matter.is_empty() {
            self.notes_dried = true;
        }
        for tile in shown {
            self.tiles.touch(tile);
        }
        // Those, too, that nothing is known of where it is drawn.
        for tile in 0..self.tiles.flags.len() as u32 {
            if self.tiles.has(tile, Tiles::WET) {
                self.tiles.touch(tile);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Affine3A;

    use super::*;
    use crate::collision::MeshTriangles;
    use crate::matter::MatterKind;
    use crate::overlay::Wrap;
    use crate::weather::Weather;

    const WRAP: [Wrap; 2] = [Wrap::Clamp; 2];

    /// A plate with dry maps.
    struct Plate {
        world: World,
        surface: Entity,
        bvh: Arc<MeshBvh>,
    }

    impl Plate {
        fn new(size: u32) -> Self {
            let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
            let bvh = Arc::new(MeshBvh::build(MeshTriangles::from_mesh(&mesh).unwrap()));
            let mut world = World::new();
            let parts = (SurfaceCollider(bvh.clone()), GlobalTransform::IDENTITY, SurfaceMatter::default());
            let surface = world.spawn(parts).id();
            let mut plate = Self { world, surface, bvh };
            let geometry = plate.geometry(size);
            let water = SurfaceWater::of_size(size, WRAP, geometry.mean_mm2());
            plate.world.entity_mut(surface).insert((water, WetGeometry(Arc::new(geometry))));
            plate
        }

        fn geometry(&self, size: u32) -> TexelGeometry {
            TexelGeometry::new(self.bvh.triangles(), &Affine3A::IDENTITY, Vec3::Y, size, WRAP)
        }

        fn water(&self) -> &SurfaceWater {
            self.world.get::<SurfaceWater>(self.surface).unwrap()
        }

        fn edit(&mut self) -> Mut<'_, SurfaceWater> {
            self.world.get_mut::<SurfaceWater>(self.surface).unwrap()
        }

        /// Film and water in the pores, units.
        fn held(&self) -> [u64; 2] {
            self.water().texels().iter().fold([0; 2], |[film, pores], texel| {
                [film + u64::from(texel.film), pores + u64::from(texel.pores)]
            })
        }

        /// More water on all of it.
        fn cover(&mut self, film_mm: f32, absorbed_mm: f32, tick: u32) {
            let geometry = self.world.get::<WetGeometry>(self.surface).unwrap().0.clone();
            self.edit().cover(&geometry, film_mm, absorbed_mm, tick);
        }

        /// All that has changed is drawn.
        fn draw(&mut self) {
            let mut water = self.edit();
            water.tiles.dirty.clear();
            water.tiles.flags.iter_mut().for_each(|flags| *flags &= !Tiles::DIRTY);
        }

        /// Moves what is on it to maps of another size.
        fn resize(&mut self, size: u32) {
            let before = self.world.get::<WetGeometry>(self.surface).unwrap().0.clone();
            let to = self.geometry(size);
            let moved = self.water().resized(&before, &to);
            *self.edit() = moved;
            self.world.entity_mut(self.surface).insert(WetGeometry(Arc::new(to)));
        }

        fn kept(&self) -> KeptSurface {
            KeptSurface::of(&self.world, self.surface).unwrap()
        }

        fn put_back(&mut self, kept: &KeptSurface) -> Result<(), NotPutBack> {
            kept.put_back(&mut self.world, self.surface)
        }
    }

    #[test]
    fn what_was_there_before_comes_back_and_all_that_changed_is_drawn_anew() {
        let mut plate = Plate::new(32);
        let dry = plate.kept();
        plate.cover(0.1, 0.02, 5);
        let wet = plate.kept();
        plate.cover(0.3, 0.0, 9);
        let wetter = plate.kept();
        plate.draw();
        let tiles = plate.water().tiles.flags.len();
        assert!(tiles > 0);
        // There and back again.
        for kept in [&wet, &wetter, &wet] {
            assert_eq!(plate.put_back(kept), Ok(()));
            let water = plate.water();
            assert_eq!((water.texels(), water.ledger()), (kept.water.texels(), kept.water.ledger()));
            assert_eq!(water.tiles.dirty.len(), tiles);
        }
        assert_eq!(plate.put_back(&dry), Ok(()));
        assert_eq!(plate.held(), [0, 0]);
        let water = plate.water();
        assert_eq!((water.ledger(), water.tiles.dirty.len()), (dry.water.ledger(), tiles));
        // Dry, but there to be drawn.
        assert!(water.is_wet());
    }

    #[test]
    fn water_that_comes_back_to_maps_of_which_nothing_was_ever_drawn_is_drawn() {
        let mut plate = Plate::new(32);
        plate.cover(0.1, 0.02, 5);
        plate.draw();
        let wet = plate.kept();
        plate.edit().reset();
        assert_eq!(plate.put_back(&wet), Ok(()));
        let water = plate.water();
        assert!(!water.tiles.dirty.is_empty() && water.tiles.dirty.len() == water.tiles.flags.len());
    }

    #[test]
    fn on_maps_of_another_size_it_is_as_much_to_the_unit() {
        for (from, to) in [(64, 32), (64, 16), (32, 64), (16, 64)] {
            let mut plate = Plate::new(from);
            plate.cover(0.1, 0.02, 5);
            let (kept, held) = (plate.kept(), plate.held());
            assert!(held[0] > 0 && held[1] > 0);
            plate.cover(0.3, 0.1, 9);
            if from < to / 2 {
                plate.resize(2 * from);
            }
            plate.resize(to);
            let wetter = plate.kept();
            assert_ne!(plate.held(), held);
            assert_eq!(plate.put_back(&kept), Ok(()), "{from} {to}");
            assert_eq!((plate.water().size(), plate.held()), (to, held), "{from} {to}");
            let ledger = plate.water().ledger();
            assert_eq!(ledger.received, held[0] + held[1], "{ledger:?}");
            let tiles = plate.water().tiles.flags.len();
            assert_eq!(plate.water().tiles.dirty.len(), tiles, "{from} {to}");
            // And forth again.
            let wettest = wetter.water.texels().to_vec();
            assert_eq!(plate.put_back(&wetter), Ok(()));
            assert_eq!(plate.water().texels(), wettest);
        }
    }

    #[test]
    fn a_surface_that_was_dry_is_dry_again_on_maps_of_another_size() {
        let mut plate = Plate::new(64);
        let dry = plate.kept();
        plate.cover(0.1, 0.02, 5);
        plate.resize(32);
        assert_eq!(plate.put_back(&dry), Ok(()));
        assert_eq!((plate.held(), plate.water().ledger()), ([0, 0], Default::default()));
        assert_eq!(plate.water().tiles.dirty.len(), plate.water().tiles.flags.len());
    }

    #[test]
    fn what_dries_meanwhile_is_dry_on_maps_of_another_size_and_its_dust_is_there() {
        let mut plate = Plate::new(64);
        let mut drying = DryingClock::default();
        drying.change(&Weather { drying_speed: 30.0, ..default() }, 0, 60);
        plate.world.insert_resource(drying);
        plate.world.insert_resource(WeatheringClock::new(60));
        plate.cover(0.1, 0.02, 0);
        let matter = |plate: &mut Plate, edit: &dyn Fn(&mut SurfaceMatter)| {
            let mut matter = plate.world.get_mut::<SurfaceMatter>(plate.surface).unwrap();
            edit(&mut matter);
            let stock = matter.stock();
            stock.dust + stock.mud
        };
        let soil = matter(&mut plate, &|matter| {
            matter.wake(64);
            (0..64 * 64).for_each(|texel| matter.receive(texel, MatterKind::Dust, 1000));
        });
        let (kept, held) = (plate.kept(), plate.held());
        plate.world.resource_mut::<WeatheringClock>().go_to(600);
        plate.resize(32);
        matter(&mut plate, &|matter| {
            matter.wake(32);
            matter.receive(5, MatterKind::Mud, 7);
        });
        assert_eq!(plate.put_back(&kept), Ok(()));
        let (ledger, left) = (plate.water().ledger(), plate.held());
        assert!(ledger.evaporated > 0 && left[0] < held[0], "{ledger:?}");
        assert_eq!(left[0] + left[1] + ledger.evaporated, ledger.received);
        assert_eq!(matter(&mut plate, &|_| {}), soil);
    }

    #[test]
    fn what_cannot_come_back_says_why_and_nothing_happens() {
        let mut plate = Plate::new(32);
        let dry = plate.kept();
        plate.cover(0.1, 0.02, 5);
        let held = plate.held();
        let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
        let other = Arc::new(MeshBvh::build(MeshTriangles::from_mesh(&mesh).unwrap()));
        plate.world.entity_mut(plate.surface).insert(SurfaceCollider(other));
        assert_eq!(plate.put_back(&dry), Err(NotPutBack::Reshaped));
        assert_eq!(plate.held(), held);
        plate.world.entity_mut(plate.surface).insert(SurfaceCollider(plate.bvh.clone()));
        let water = plate.world.entity_mut(plate.surface).take::<SurfaceWater>().unwrap();
        assert_eq!(plate.put_back(&dry), Err(NotPutBack::Measured));
        plate.world.entity_mut(plate.surface).insert(Unmapped::Evicted);
        assert_eq!(plate.put_back(&dry), Err(NotPutBack::Unmapped));
        plate.world.entity_mut(plate.surface).remove::<Unmapped>().insert(water);
        assert_eq!(plate.put_back(&dry), Ok(()));
        // No halving or doubling leads from these maps to those.
        let geometry = plate.geometry(48);
        let water = SurfaceWater::of_size(48, WRAP, geometry.mean_mm2());
        plate.world.entity_mut(plate.surface).insert((water, WetGeometry(Arc::new(geometry))));
        assert_eq!(plate.put_back(&dry), Err(NotPutBack::Reshaped));
        plate.world.despawn(plate.surface);
        assert_eq!(plate.put_back(&dry), Err(NotPutBack::Gone));
    }
}
