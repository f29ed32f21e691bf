//! What the rain brought, in numbers.

use serde::Serialize;

use super::ExportOptions;
use super::scene::Place;
use super::shape::Shape;
use super::simulate::Outcome;
use super::soaked::Soaked;
use crate::replay::{ParticleReport, SurfaceMaps, WaterReport};

/// `report.json` of an export: where all the water is.
#[derive(Serialize, Debug, Clone, PartialEq)]
pub struct ExportReport {
    /// File name of the scene, or what an app called it.
    pub scene: String,
    /// The seed of the rain.
    pub seed: u64,
    /// Water on level ground, mm/h; `None` of an app that was running, where it came from its own emitters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rain_mm_per_h: Option<f32>,
    /// m/s, at the end.
    pub wind: [f32; 3],
    /// Ticks run.
    pub ticks: u32,
    /// The same as weather time, s.
    pub seconds: f64,
    /// All particles.
    pub particles: ParticleReport,
    /// All water.
    pub water: WaterReport,
    /// In the order of the scene's nodes.
    pub surfaces: Vec<BakedSurface>,
}

/// One surface, a primitive that a node shows.
#[derive(Serialize, Debug, Clone, PartialEq)]
pub struct BakedSurface {
    /// Its name, of which the files of its maps begin.
    pub name: String,
    /// Number of its node in the file.
    pub node: usize,
    /// Number of its mesh in the file that was read; of an app that was running, in the one that was written.
    pub mesh: usize,
    /// Number of the primitive in that mesh.
    pub primitive: usize,
    /// The texture coordinates that its textures lie in, `TEXCOORD_` and this.
    pub tex_coord: usize,
    /// Whether these were made, as none that there were are unique.
    pub unwrapped: bool,
    /// Texels along each side of its maps.
    pub map_size: u32,
    /// Texels along each side of its textures.
    pub texture_size: u32,
    /// Triangles.
    pub triangles: u32,
    /// m².
    pub area_m2: f64,
    /// Particles that hit it.
    pub impacts: u64,
    /// Water that they carried, mm³.
    pub received_mm3: f64,
    /// Film on it, mm³.
    pub film_mm3: f64,
    /// Absorbed, mm³.
    pub absorbed_mm3: f64,
    /// Gone into the air, mm³.
    pub evaporated_mm3: f64,
    /// Left it as drips, mm³.
    pub dripped_mm3: f64,
    /// Part of its area that looks wet, 0..=1.
    pub wet_fraction: f64,
}

impl ExportReport {
    pub(super) fn new(
        scene: String,
        options: &ExportOptions,
        outcome: &Outcome,
        surfaces: Vec<BakedSurface>,
    ) -> Self {
        Self {
            scene,
            seed: options.seed,
            rain_mm_per_h: Some(options.rain_mm_per_h),
            wind: options.weather.wind.to_array(),
            ticks: outcome.ticks,
            seconds: f64::from(outcome.ticks) / f64::from(options.tick_hz),
            particles: outcome.particles.into(),
            water: outcome.water,
            surfaces,
        }
    }
}

impl BakedSurface {
    pub(super) fn new(
        place: &Place,
        shape: &Shape,
        soaked: &Soaked,
        maps: &SurfaceMaps,
        texture_size: u32,
    ) -> Self {
        let mm3 = |units| maps.water.units().mm3(units);
        Self {
            name: place.name.clone(),
            node: place.node,
            mesh: place.mesh,
            primitive: place.primitive,
            tex_coord: shape.map_set(),
            unwrapped: shape.cut.is_some(),
            map_size: maps.size,
            texture_size,
            triangles: soaked.triangles,
            area_m2: soaked.area_m2,
            impacts: soaked.totals.impacts,
            received_mm3: soaked.totals.water_nl as f64 / 1000.0,
            film_mm3: mm3(maps.stock.film),
            absorbed_mm3: mm3(maps.stock.pores),
            evaporated_mm3: mm3(maps.stock.evaporated),
            dripped_mm3: mm3(maps.water.ledger().dripped),
            wet_fraction: maps.wet_fraction,
        }
    }
}
