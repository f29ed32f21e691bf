//! The maps at the end of a run, wherever they were painted.

use std::path::Path;
use std::time::Instant;

use bevy::prelude::*;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use image::{ImageFormat, Luma, Rgba};

use super::{ReplayError, Run, give_up_after};
use crate::clock::WeatheringClock;
use crate::material::PorousMaterial;
use crate::matter::SurfaceMatter;
use crate::overlay::{CpuMaps, MapLoss, MapSize, Overlays, SplatQueue, SplatStats, TILE_SIZE, Weatherable};
use crate::picture::{square, write_picture};
use crate::scenario::ScenarioSurface;
use crate::weather::DryingClock;
use crate::wetting::query::{summary, wetness_of};
use crate::wetting::{Exposure, Now, Stock, SurfaceWater, WetGeometry, Wetness};

/// All maps of one surface.
#[derive(Debug, Clone)]
pub struct SurfaceMaps {
    /// The surface's name in the scenario.
    pub name: String,
    /// Texels along each side; 0 if it has no maps, for want of room. Then nothing lies on it, and there are no texels.
    pub size: u32,
    /// Colour over the surface's; premultiplied RGBA, row by row.
    pub diffuse: Vec<u8>,
    /// Reflectance, smoothness, unused, coverage; premultiplied.
    pub specular: Vec<u8>,
    /// Slope along u and v, unused, coverage; premultiplied.
    pub normal: Vec<u8>,
    /// How wet each texel is at the end, row by row.
    pub wetness: Vec<Wetness>,
    /// Reference tick of each texel, row by row; empty while it has never been wet.
    pub since: Vec<u32>,
    /// Part of its area that looks wet, 0..=1.
    pub wet_fraction: f64,
    /// All its water.
    pub water: SurfaceWater,
    /// Where that water is.
    pub stock: Stock,
    /// Its dust, mud and snow.
    pub matter: SurfaceMatter,
    /// What was lost with maps that were taken away, and for want of maps.
    pub loss: MapLoss,
    /// Ticks per second of `since`.
    pub hz: u32,
}

impl SurfaceMaps {
    /// Of a surface as it is now; without colour maps unless they are on the CPU.
    pub(crate) fn new(
        name: String,
        size: u32,
        water: &SurfaceWater,
        matter: &SurfaceMatter,
        loss: MapLoss,
        cpu: Option<&CpuMaps>,
        now: &Now,
    ) -> Self {
        let colors = |of: fn(&CpuMaps) -> &Vec<[u8; 4]>| {
            cpu.map(|cpu| of(cpu).as_flattened().to_vec()).unwrap_or_default()
        };
        Self {
            name,
            size,
            diffuse: colors(|cpu| &cpu.diffuse),
            specular: colors(|cpu| &cpu.specular),
            normal: colors(|cpu| &cpu.normal),
            wetness: (0..size.pow(2)).map(|texel| wetness_of(water, now, texel)).collect(),
            since: water.texels().iter().map(|texel| texel.tick).collect(),
            wet_fraction: f64::from(summary(water, now).wet_fraction),
            water: water.clone(),
            stock: water.stock(now),
            matter: matter.clone(),
            loss,
            hz: now.hz,
        }
    }

    /// Of a surface that has none.
    pub(crate) fn none(name: String, surface: &Weatherable, loss: MapLoss, hz: u32) -> Self {
        Self {
            name,
            size: 0,
            diffuse: vec![],
            specular: vec![],
            normal: vec![],
            wetness: vec![],
            since: vec![],
            wet_fraction: 0.0,
            water: SurfaceWater::of_size(TILE_SIZE, surface.wrap(), 1.0),
            stock: Stock::default(),
            matter: SurfaceMatter::default(),
            loss,
            hz,
        }
    }
}

/// What has been read back so far: (surface, map, bytes).
#[derive(Resource, Default)]
struct Received(Vec<(Entity, usize, Vec<u8>)>);

impl Run<'_> {
    /// The maps of all surfaces, in the order of the scenario.
    pub(super) fn read_maps(&mut self) -> Result<Vec<SurfaceMaps>, ReplayError> {
        // What is due at this tick takes effect before anything is read: not while maps come back from the GPU, and without one, too.
        self.step(0)?;
        if self.options.render {
            self.finish_painting()?;
        }
        let clock = *self.app.world().resource::<WeatheringClock>();
        let drying = self.app.world().resource::<DryingClock>().clone();
        let world = self.app.world_mut();
        let mut query = world.query::<(
            (Entity, &ScenarioSurface, &Weatherable, &MapLoss, &SurfaceMatter),
            (Option<&MapSize>, Option<&SurfaceWater>, Option<&WetGeometry>),
            (Option<&Exposure>, Option<&PorousMaterial>, Option<&CpuMaps>, Option<&Overlays>),
        )>();
        let mut surfaces = Vec::new();
        let mut requests = Vec::new();
        let default = PorousMaterial::default();
        for ((entity, surface, settings, loss, matter), measured, (exposure, material, cpu, gpu)) in
            query.iter(world)
        {
            let (Some(size), Some(water), Some(geometry)) = measured else {
                let read = SurfaceMaps::none(surface.name.clone(), settings, *loss, clock.hz());
                surfaces.push((surface.index, entity, read));
                continue;
            };
            let size = size.texels();
            let material = material.unwrap_or(&default);
            let now = Now::new(clock.tick(), clock.hz(), &drying, &geometry.0, exposure, material);
            let mut read = SurfaceMaps::new(surface.name.clone(), size, water, matter, *loss, cpu, &now);
            if cpu.is_some() {
                // All of it is here already.
            } else if let Some(gpu) = gpu.filter(|gpu| gpu.has_colors) {
                requests.push((entity, 0, Readback::texture(gpu.diffuse.clone())));
                requests.push((entity, 1, Readback::texture(gpu.specular.clone())));
                requests.push((entity, 2, Readback::texture(gpu.normal.clone())));
            } else {
                // Nothing has been painted.
                let empty = vec![0; size.pow(2) as usize * 4];
                (read.diffuse, read.specular, read.normal) = (empty.clone(), empty.clone(), empty);
            }
            surfaces.push((surface.index, entity, read));
        }
        surfaces.sort_by_key(|(index, ..)| *index);
        for (surface, map, bytes) in self.read_back(requests)? {
            let Some((_, _, read)) = surfaces.iter_mut().find(|(_, entity, _)| *entity == surface) else {
                continue;
            };
            match map {
                0 => read.diffuse = without_padding(&bytes, read.size),
                1 => read.specular = without_padding(&bytes, read.size),
                _ => read.normal = without_padding(&bytes, read.size),
            }
        }
        Ok(surfaces.into_iter().map(|(_, _, maps)| maps).collect())
    }

    /// Splats that are not painted yet, wherever they are, and surfaces whose paint is on its way to other maps. None are without a
    /// renderer: they are painted in their tick.
    pub(super) fn waiting(&mut self) -> u64 {
        let world = self.app.world_mut();
        let pending = world.get_resource::<SplatStats>().map(|stats| stats.pending() + stats.moving());
        let Some(pending) = pending else { return 0 };
        let mut queues = world.query::<&SplatQueue>();
        pending + queues.iter(world).map(|queue| queue.splats().len() as u64).sum::<u64>()
    }

    /// Runs frames until the GPU has painted every impact.
    pub(super) fn finish_painting(&mut self) -> Result<(), ReplayError> {
        let (mut begun, mut least) = (Instant::now(), u64::MAX);
        loop {
            let waiting = self.waiting();
            if waiting == 0 {
                // The frame that painted the last is done: `step` waits for the GPU.
                return Ok(());
            }
            if waiting < least {
                (begun, least) = (Instant::now(), waiting);
            }
            self.step(0)?;
            give_up_after(begun, "the last splats to be painted")?;
        }
    }

    fn read_back(
        &mut self,
        requests: Vec<(Entity, usize, Readback)>,
    ) -> Result<Vec<(Entity, usize, Vec<u8>)>, ReplayError> {
        let count = requests.len();
        self.app.init_resource::<Received>();
        for (surface, map, readback) in requests {
            self.app.world_mut().spawn(readback).observe(
                move |data: On<ReadbackComplete>, mut received: ResMut<Received>, mut commands: Commands| {
                    // It would be read again every frame.
                    commands.entity(data.entity).despawn();
                    if !received.0.iter().any(|(entity, number, _)| (*entity, *number) == (surface, map)) {
                        received.0.push((surface, map, data.data.clone()));
                    }
                },
            );
        }
        let begun = Instant::now();
        while self.app.world().resource::<Received>().0.len() < count {
            self.step(0)?;
            give_up_after(begun, "the maps")?;
        }
        Ok(std::mem::take(&mut self.app.world_mut().resource_mut::<Received>().0))
    }
}

/// Rows of RGBA texels without what aligns them to 256 bytes on the way.
pub fn without_padding(bytes: &[u8], size: u32) -> Vec<u8> {
    let row = size as usize * 4;
    let padded = bytes.len() / size as usize;
    bytes.chunks(padded.max(row)).flat_map(|padded| &padded[..row]).copied().collect()
}

/// What is written of each surface.
pub(super) const MAP_NAMES: [&str; 7] =
    ["diffuse", "specular", "normal", "film", "absorbed", "wetness", "since"];

/// Writes `<surface>_<map>.png` for each map of the surfaces that have any: `diffuse`, `specular`, `normal` as they are;
/// `film` and `absorbed` as 16-bit micrometres of water, `wetness` as 16-bit parts of full, `since` as 16-bit hundredths of
/// a second of the reference time (0 is never). Values too large stop at 65,535.
pub(crate) fn write_maps(folder: &Path, surfaces: &[SurfaceMaps]) -> Result<(), ReplayError> {
    for surface in surfaces.iter().filter(|surface| surface.size > 0) {
        let path = |map| folder.join(format!("{}_{map}.png", surface.name));
        let [diffuse, specular, normal, film, absorbed, wetness, since] = MAP_NAMES.map(path);
        for (path, texels) in
            [(diffuse, &surface.diffuse), (specular, &surface.specular), (normal, &surface.normal)]
        {
            let picture = square::<Rgba<u8>>(&path, surface.size, texels.clone())?;
            write_picture(&path, &picture, ImageFormat::Png)?;
        }
        let texels = || surface.wetness.iter();
        write_grey(&film, surface.size, texels().map(|texel| texel.film_mm * 1000.0))?;
        write_grey(&absorbed, surface.size, texels().map(|texel| texel.absorbed_mm * 1000.0))?;
        write_grey(&wetness, surface.size, texels().map(|texel| texel.wetness * 65_535.0))?;
        let ticks = (0..surface.wetness.len()).map(|texel| surface.since.get(texel).copied().unwrap_or(0));
        write_grey(&since, surface.size, ticks.map(|tick| tick as f32 * 100.0 / surface.hz as f32))?;
    }
    Ok(())
}

fn write_grey(path: &Path, size: u32, values: impl Iterator<Item = f32>) -> Result<(), ReplayError> {
    let texels = values.map(|value| value.round().clamp(0.0, 65_535.0) as u16).collect();
    let picture = square::<Luma<u16>>(path, size, texels)?;
    Ok(write_picture(path, &picture, ImageFormat::Png)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn padding_is_taken_off_and_its_absence_understood() {
        let texels: Vec<u8> = (0..16 * 16 * 4).map(|i| (i % 251) as u8).collect();
        let padded: Vec<u8> =
            texels.chunks(64).flat_map(|row| row.iter().copied().chain([0xee; 192])).collect();
        assert_eq!(without_padding(&padded, 16), texels);
        assert_eq!(without_padding(&texels, 16), texels);
    }
}
