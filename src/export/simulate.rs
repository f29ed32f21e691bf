//! Rain on the surfaces of a scene, without a renderer.
//!
//! The app is that of a replay without pictures: fixed ticks, as fast as they go, the same for any number of threads. Surfaces
//! come in one order, and no tick runs before all of them can be hit and know how open they lie.

use std::time::{Duration, Instant};

use bevy::asset::AssetPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;

use super::rain::{add_rain, bounds};
use super::soaked::Soaked;
use super::{ExportError, ExportOptions};
use crate::clock::{ClockPlugin, WeatheringClock};
use crate::collision::{ColliderReport, MeshColliders, NotWeatherable, SurfaceCollider, TriangleError};
use crate::emitter::EmissionSeed;
use crate::material::PorousMaterial;
use crate::matter::SurfaceMatter;
use crate::overlay::{
    CpuMaps, FramesWork, MapBudget, MapLoss, OverlayUv, SurfaceTotals, TexelArea, Weatherable,
};
use crate::particle::ParticleCounts;
use crate::replay::{Progress, SurfaceMaps, WaterReport, headless, task_pools, water_of};
use crate::weather::DryingClock;
use crate::wetting::{Exposure, ExposureProgress, MeasureProgress, Now, SurfaceWater, WetGeometry};

/// Seconds of wall-clock time after which surfaces that are not ready are given up.
const PATIENCE_SECONDS: u64 = 600;

/// One surface, ready to be rained on.
pub(super) struct Exposed {
    pub(super) name: String,
    /// In the world, its first uvs unique.
    pub(super) mesh: Mesh,
    pub(super) material: PorousMaterial,
}

/// What has become of all.
pub(super) struct Outcome {
    pub(super) surfaces: Vec<Soaked>,
    /// Theirs, in the same order.
    pub(super) maps: Vec<SurfaceMaps>,
    pub(super) water: WaterReport,
    pub(super) particles: ParticleCounts,
    pub(super) ticks: u32,
}

/// Which of the surfaces it is.
#[derive(Component, Clone, Copy)]
struct Number(usize);

/// Lets it rain.
pub(super) fn simulate(
    exposed: Vec<Exposed>,
    options: &ExportOptions,
    failed: impl Fn(usize, TriangleError) -> ExportError,
    mut progress: impl FnMut(Progress),
) -> Result<Outcome, ExportError> {
    let assets = AssetPlugin { watch_for_changes_override: Some(false), ..default() };
    let mut app = headless(task_pools(options.threads), assets);
    ClockPlugin { hz: options.tick_hz }.insert_clock(app.world_mut());
    app.insert_resource(EmissionSeed(options.seed)).insert_resource(options.weather);
    // Nothing goes to a GPU, and how many texels there may be has been looked at.
    app.insert_resource(MapBudget { bytes: 1 << 50, texel: None });
    // A frame may be as long as it likes.
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::from_secs(86_400));
    app.finish();
    app.cleanup();

    let scene = bounds(exposed.iter().map(|surface| &surface.mesh));
    let maps = Weatherable { map_size: options.map_size, uv: OverlayUv::Mesh, ..default() };
    for (number, Exposed { name, mesh, material }) in exposed.into_iter().enumerate() {
        let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh);
        app.world_mut().spawn((
            Name::new(name),
            Number(number),
            maps,
            material,
            Mesh3d(mesh),
            Transform::default(),
            GlobalTransform::default(),
        ));
    }
    wait_until_ready(&mut app, failed)?;
    add_rain(app.world_mut(), scene, options)?;

    let ticks = options.ticks();
    let mut tick = 0;
    while tick < ticks {
        // A quarter of a second at a time, so that progress can be told.
        let step = (options.tick_hz / 4).clamp(1, ticks - tick);
        run(&mut app, step);
        tick += step;
        progress(Progress { tick, ticks });
    }
    let (surfaces, maps): (Vec<_>, Vec<_>) = read(app.world_mut()).into_iter().unzip();
    let water = water_of(app.world(), &maps);
    let particles = *app.world().resource::<ParticleCounts>();
    Ok(Outcome { surfaces, maps, water, particles, ticks })
}

/// One frame of so many ticks.
fn run(app: &mut App, ticks: u32) {
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(ticks));
    app.update();
}

type Unready = Or<(Without<SurfaceCollider>, Without<TexelArea>, Without<SurfaceWater>, Without<Exposure>)>;

fn wait_until_ready(
    app: &mut App,
    failed: impl Fn(usize, TriangleError) -> ExportError,
) -> Result<(), ExportError> {
    let begun = Instant::now();
    loop {
        run(app, 0);
        let world = app.world_mut();
        let mut refused = world.query::<(&Number, &NotWeatherable)>();
        if let Some((number, refused)) = refused.iter(world).min_by_key(|(number, _)| number.0) {
            return Err(failed(number.0, refused.0));
        }
        let mut unready = world.query_filtered::<(), (With<Number>, Unready)>();
        let waits = unready.iter(world).next().is_some()
            || world.resource::<MeshColliders>().building() > 0
            || world.resource::<MeasureProgress>().is_busy()
            || world.resource::<ExposureProgress>().is_busy()
            || world.resource::<FramesWork>().is_busy();
        if !waits {
            return Ok(());
        }
        if begun.elapsed().as_secs() >= PATIENCE_SECONDS {
            return Err(ExportError::TimedOut { what: "the surfaces", seconds: PATIENCE_SECONDS });
        }
        // Measuring goes on in other threads.
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// What has become of the surfaces, in their order.
fn read(world: &mut World) -> Vec<(Soaked, SurfaceMaps)> {
    let clock = *world.resource::<WeatheringClock>();
    let drying = world.resource::<DryingClock>().clone();
    let mut query = world.query::<(
        (&Number, &Name, &Weatherable, &PorousMaterial, &ColliderReport, &SurfaceTotals, &MapLoss),
        (&SurfaceWater, &SurfaceMatter, &WetGeometry, Option<&Exposure>, Option<&CpuMaps>),
    )>();
    let mut surfaces: Vec<_> = query
        .iter(world)
        .map(
            |(
                (number, name, maps, material, collider, totals, loss),
                (water, matter, geometry, exposure, cpu),
            )| {
                let size = maps.texels();
                let now = Now::new(clock.tick(), clock.hz(), &drying, &geometry.0, exposure, material);
                let maps = SurfaceMaps::new(name.to_string(), size, water, matter, *loss, cpu, &now);
                (number.0, (Soaked::new(&maps, &now, *totals, collider.0.total), maps))
            },
        )
        .collect();
    surfaces.sort_by_key(|(number, _)| *number);
    surfaces.into_iter().map(|(_, surface)| surface).collect()
}
