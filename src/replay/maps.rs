//! The maps at the end of a run, wherever they were painted.

use std::io::Cursor;
use std::path::Path;
use std::time::Instant;

use bevy::prelude::*;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use super::{ReplayError, Run, give_up_after, write_atomic};
use crate::clock::WeatheringClock;
use crate::overlay::{CpuMaps, Overlays, SplatStats, SurfaceTotals, TexelAreas, TexelState, Weatherable};
use crate::scenario::ScenarioSurface;

/// All maps of one surface.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceMaps {
    /// The surface's name in the scenario.
    pub name: String,
    /// Texels along each side.
    pub size: u32,
    /// Colour over the surface's; premultiplied RGBA, row by row.
    pub diffuse: Vec<u8>,
    /// Reflectance, smoothness, unused, coverage; premultiplied.
    pub specular: Vec<u8>,
    /// Slope along u and v, unused, coverage; premultiplied.
    pub normal: Vec<u8>,
    /// Water and time.
    pub state: Vec<TexelState>,
    /// Mean area of a texel, mm².
    pub texel_mm2: f32,
    /// Ticks per second of [`TexelState::wet_since`].
    pub hz: u32,
}

/// What has been read back so far: (surface, map, bytes).
#[derive(Resource, Default)]
struct Received(Vec<(Entity, usize, Vec<u8>)>);

impl Run<'_> {
    /// The maps of all surfaces, in the order of the scenario.
    pub(super) fn read_maps(&mut self) -> Result<Vec<SurfaceMaps>, ReplayError> {
        if self.options.render {
            self.finish_painting()?;
        }
        let hz = self.app.world().resource::<WeatheringClock>().hz();
        let world = self.app.world_mut();
        let mut query = world.query::<(
            Entity,
            &ScenarioSurface,
            &Weatherable,
            &TexelAreas,
            Option<&CpuMaps>,
            Option<&Overlays>,
        )>();
        let mut surfaces = Vec::new();
        let mut requests = Vec::new();
        for (entity, surface, maps, areas, cpu, gpu) in query.iter(world) {
            let mut read = SurfaceMaps {
                name: surface.name.clone(),
                size: maps.texels(),
                diffuse: vec![],
                specular: vec![],
                normal: vec![],
                state: vec![],
                texel_mm2: areas.mean_mm2,
                hz,
            };
            if let Some(cpu) = cpu {
                read.diffuse = cpu.diffuse.as_flattened().to_vec();
                read.specular = cpu.specular.as_flattened().to_vec();
                read.normal = cpu.normal.as_flattened().to_vec();
                read.state = cpu.state.clone();
            } else if let Some(gpu) = gpu {
                requests.push((entity, 0, Readback::texture(gpu.diffuse.clone())));
                requests.push((entity, 1, Readback::texture(gpu.specular.clone())));
                requests.push((entity, 2, Readback::texture(gpu.normal.clone())));
                requests.push((entity, 3, Readback::buffer(gpu.state.clone())));
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
                2 => read.normal = without_padding(&bytes, read.size),
                _ => read.state = bytemuck::pod_collect_to_vec(&bytes),
            }
        }
        Ok(surfaces.into_iter().map(|(_, _, maps)| maps).collect())
    }

    /// Runs frames until the GPU has painted every impact.
    fn finish_painting(&mut self) -> Result<(), ReplayError> {
        let begun = Instant::now();
        loop {
            let world = self.app.world_mut();
            let mut totals = world.query::<&SurfaceTotals>();
            let impacts: u64 = totals.iter(world).map(|totals| totals.impacts).sum();
            if world.resource::<SplatStats>().splats() >= impacts {
                // The frame that painted them is done: `step` waits for the GPU.
                return Ok(());
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
fn without_padding(bytes: &[u8], size: u32) -> Vec<u8> {
    let row = size as usize * 4;
    let padded = bytes.len() / size as usize;
    bytes.chunks(padded.max(row)).flat_map(|padded| &padded[..row]).copied().collect()
}

/// What is written of each surface.
pub(super) const MAP_NAMES: [&str; 5] = ["diffuse", "specular", "normal", "water", "wet_since"];

/// Writes `<surface>_<map>.png` for each map: `diffuse`, `specular`, `normal` as they are, `water` as 16-bit
/// micrometres of film, `wet_since` as 16-bit hundredths of a second (0 is dry). Values too large stop at 65,535.
pub(super) fn write_maps(folder: &Path, surfaces: &[SurfaceMaps]) -> Result<(), ReplayError> {
    for surface in surfaces {
        let path = |map| folder.join(format!("{}_{map}.png", surface.name));
        let [diffuse, specular, normal, water, wet_since] = MAP_NAMES.map(path);
        for (path, texels) in
            [(diffuse, &surface.diffuse), (specular, &surface.specular), (normal, &surface.normal)]
        {
            write_map(&path, texels, surface.size, ExtendedColorType::Rgba8)?;
        }
        // 1 nl on 1 mm² is 1 µm.
        let film = |texel: &TexelState| texel.water_nl as f32 / surface.texel_mm2;
        write_grey(&water, surface, film)?;
        let since = |texel: &TexelState| texel.wet_since as f32 * 100.0 / surface.hz as f32;
        write_grey(&wet_since, surface, since)?;
    }
    Ok(())
}

fn write_grey(
    path: &Path,
    surface: &SurfaceMaps,
    value: impl Fn(&TexelState) -> f32,
) -> Result<(), ReplayError> {
    let texels: Vec<u16> =
        surface.state.iter().map(|texel| value(texel).round().clamp(0.0, 65_535.0) as u16).collect();
    write_map(path, bytemuck::cast_slice(&texels), surface.size, ExtendedColorType::L16)
}

fn write_map(path: &Path, bytes: &[u8], size: u32, color: ExtendedColorType) -> Result<(), ReplayError> {
    let mut file = Cursor::new(Vec::new());
    PngEncoder::new(&mut file)
        .write_image(bytes, size, size, color)
        .map_err(|source| ReplayError::Encode { path: path.into(), source })?;
    write_atomic(path, file.get_ref())
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
