//! A sheet, its weather, and what lies on it, for the tests of this folder and of brushes.

use std::sync::Arc;

use bevy::math::{Affine3A, Vec2, Vec3};

use super::advance::{MatterScratch, advance_matter};
use super::settle::{self, Deposit, deposit};
use super::{MatterKind, SurfaceMatter};
use crate::collision::MeshTriangles;
use crate::emitter::Source;
use crate::material::PorousMaterial;
use crate::overlay::{Weatherable, Wrap};
use crate::weather::{DryingClock, Weather};
use crate::wetting::{Drop, Now, RunScratch, SoakScratch, SurfaceWater, TexelGeometry, run_off, soak};

/// A square sheet in its weather.
#[derive(Clone)]
pub(crate) struct Place {
    pub(crate) triangles: MeshTriangles,
    pub(crate) geometry: Arc<TexelGeometry>,
    pub(crate) material: PorousMaterial,
    pub(crate) weather: Weather,
    drying: DryingClock,
    surface: Weatherable,
}

impl Place {
    pub(super) const HZ: u32 = 60;

    /// Glazed; 20 °C, and nothing dries. v goes down the slope; texels are so many metres wide.
    pub(super) fn slope(degrees: f32, size: u32, texel: f32) -> Self {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let side = size as f32 * texel;
        let at = |uv: Vec2| Vec3::new(uv.x, (1.0 - uv.y) * sine, uv.y * cosine) * side;
        let [a, b, c, d] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        let corners = [[a, c, b], [a, d, c]];
        let triangles = MeshTriangles {
            positions: corners.map(|corners| corners.map(at)).to_vec(),
            uvs: corners.to_vec(),
            source: vec![0, 1],
            ..Default::default()
        };
        let wrap = [Wrap::Clamp; 2];
        let geometry = TexelGeometry::new(&triangles, &Affine3A::IDENTITY, Vec3::Y, size, wrap);
        let material = PorousMaterial { capacity_mm: 0.0, retained_mm: 0.04, ..PorousMaterial::default() };
        let place = Self {
            triangles,
            geometry: Arc::new(geometry),
            material,
            weather: Weather::default(),
            drying: DryingClock::default(),
            surface: Weatherable { map_size: size, wrap_u: wrap[0], wrap_v: wrap[1], ..Default::default() },
        };
        place.with(|weather| weather.drying_speed = 0.0)
    }

    /// A floor.
    pub(crate) fn flat(size: u32, texel: f32) -> Self {
        Self::slope(0.0, size, texel)
    }

    /// The same in other weather, from the start.
    pub(super) fn with(self, change: impl FnOnce(&mut Weather)) -> Self {
        Self { drying: DryingClock::default(), ..self }.with_from(0, change)
    }

    /// The same in other weather, from a tick on.
    pub(super) fn with_from(mut self, tick: u32, change: impl FnOnce(&mut Weather)) -> Self {
        change(&mut self.weather);
        self.drying.change(&self.weather, tick, Self::HZ);
        self
    }

    pub(crate) fn now(&self, tick: u32) -> Now<'_> {
        Now::new(tick, Self::HZ, &self.drying, &self.geometry, None, &self.material)
    }

    pub(super) fn texels(&self) -> u32 {
        self.geometry.size() * self.geometry.size()
    }
}

/// Matter that comes as a round bump: nanolitres; where, and half of its width and height, in 1/256 texel.
pub(crate) fn bump(kind: MatterKind, volume_nl: u32, center: [i32; 2], radius: [i32; 2]) -> Deposit {
    Deposit { center, radius, kind, volume_nl, stamp: None }
}

/// What lies on it.
pub(crate) struct Ground {
    pub(crate) water: SurfaceWater,
    pub(crate) matter: SurfaceMatter,
    pub(super) scratch: MatterScratch,
    run: RunScratch,
    soak: SoakScratch,
    drops: u32,
}

impl Ground {
    /// Nothing has ever come.
    pub(crate) fn dry(place: &Place) -> Self {
        Self {
            water: SurfaceWater::new(&place.surface, place.geometry.mean_mm2()),
            matter: SurfaceMatter::default(),
            scratch: MatterScratch::default(),
            run: RunScratch::default(),
            soak: SoakScratch::default(),
            drops: 0,
        }
    }

    /// With room for both.
    pub(super) fn new(place: &Place) -> Self {
        let mut ground = Self::dry(place);
        settle::wake(&mut ground.water, &mut ground.matter, &place.now(1));
        ground
    }

    /// Units of so many mm on a texel.
    pub(super) fn film_mm(&self, place: &Place, texel: u32, mm: f64) -> u64 {
        (mm / place.geometry.unit_mm(self.water.units, texel)).round() as u64
    }

    pub(super) fn put(&mut self, place: &Place, tick: u32, what: Deposit) {
        let (water, matter) = (&mut self.water, &mut self.matter);
        deposit(water, matter, &place.now(tick), &place.weather, &what, None, &mut self.scratch);
    }

    /// So many drops of 2 mm, all over.
    pub(super) fn rain(&mut self, place: &Place, tick: u32, count: u32) {
        let across = place.geometry.size() * 256;
        for _ in 0..count {
            self.drops += 1;
            // Spread evenly (Roberts 2018).
            let along =
                |step: u32| ((u64::from(self.drops.wrapping_mul(step)) * u64::from(across)) >> 32) as i32;
            let center = [along(3_242_174_889), along(2_447_445_414)];
            let (water_nl, speed_mm, source) = (4189, 6500, Source::UNKNOWN);
            self.pour(place, tick, Drop { center, radius: [384; 2], water_nl, speed_mm, jet: None, source });
        }
    }

    /// One drop.
    pub(super) fn pour(&mut self, place: &Place, tick: u32, drop: Drop) {
        self.water.wake(false);
        let matter = self.matter.awake(place.geometry.size());
        soak(&mut self.water, &place.now(tick), &[drop], &mut self.soak, matter, &place.weather);
    }

    /// A tick of water and matter; how many tiles took a step.
    pub(super) fn step(&mut self, place: &Place, tick: u32) -> u32 {
        let now = place.now(tick);
        let mut drips = Vec::new();
        let tiles = if self.water.is_wet() {
            let matter = self.matter.awake(place.geometry.size());
            run_off(&mut self.water, &now, &mut self.run, &mut drips, matter)
        } else {
            0
        };
        tiles + advance_matter(&mut self.water, &mut self.matter, &now, &place.weather, &mut self.scratch)
    }

    /// Before the weather or the material changes.
    pub(super) fn settle_all(&mut self, place: &Place, tick: u32) {
        self.water.settle_all(&place.now(tick));
    }

    pub(super) fn assert_water_balanced(&self, place: &Place, tick: u32) {
        let stock = self.water.stock(&place.now(tick));
        let ledger = self.water.ledger();
        let found = stock.film + stock.pores + stock.evaporated + ledger.dripped + ledger.spilled;
        assert_eq!(ledger.received, found, "{stock:?} {ledger:?}");
    }
}

/// What came is on the surface, or the ledger says where it went.
pub(crate) fn assert_balanced(matter: &SurfaceMatter) {
    let (stock, ledger) = (matter.stock(), matter.ledger());
    let soil = ledger.received_dust + ledger.received_mud;
    let gone = ledger.washed_off + ledger.wiped;
    assert_eq!(soil, stock.dust + stock.mud + gone, "{stock:?} {ledger:?}");
    let gone = ledger.melted + ledger.slid_off + ledger.wiped_snow;
    assert_eq!(ledger.received_snow, stock.snow + gone, "{stock:?} {ledger:?}");
}
