//! Rain on the surfaces of a scene, without a renderer.
//!
//! The app is that of a replay without pictures: fixed ticks, as fast as they go, the same for any number of threads. Surfaces
//! come in one order, and no tick runs before all of them can be hit and know how open they lie.

use std::time::{Duration, Instant};

use bevy::asset::AssetPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;

use super::look::Held;
use super::{ExportError, ExportOptions};
use crate::clock::{ClockPlugin, WeatheringClock};
use crate::collision::{ColliderReport, MeshColliders, NotWeatherable, SurfaceCollider, TriangleError};
use crate::effect::drops::DropSizes;
use crate::effect::{EffectTable, WeatherEffect};
use crate::emitter::{EmissionSeed, Emitter, EmitterShape, Flow};
use crate::material::PorousMaterial;
use crate::matter::snow::RELATIVE_DENSITY;
use crate::matter::{SurfaceMatter, TexelMatter};
use crate::overlay::{
    CpuMaps, FramesWork, MapBudget, MapLoss, OverlayUv, SurfaceTotals, TexelArea, Weatherable,
};
use crate::particle::{Lifespan, ParticleCounts};
use crate::replay::{Progress, SurfaceMaps, WaterReport, headless, task_pools, water_of};
use crate::weather::DryingClock;
use crate::wetting::{Exposure, ExposureProgress, Now, SurfaceWater, WetGeometry};

/// Seconds of wall-clock time after which surfaces that are not ready are given up.
const PATIENCE_SECONDS: u64 = 600;
/// Rain begins so high above the scene, metres; with wind so much more, that it is on its way with it when it arrives.
const ABOVE: f32 = 1.0;
const GUST_RUN: f32 = 4.0;
/// Slow drops of rain fall no slower than this, m/s.
const SLOWEST: f32 = 3.0;
/// The most particles that are sent out a second, for a sky much larger than the scene.
const MOST_PER_SECOND: f32 = 100_000.0;

/// One surface, ready to be rained on.
pub(super) struct Exposed {
    pub(super) name: String,
    /// In the world, its first uvs unique.
    pub(super) mesh: Mesh,
    pub(super) material: PorousMaterial,
}

/// What has become of one surface.
pub(super) struct Soaked {
    pub(super) area_m2: f64,
    pub(super) triangles: u32,
    pub(super) totals: SurfaceTotals,
    /// Texel by texel, also beside the islands.
    pub(super) held: Vec<Held>,
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
    exposed: &[Exposed],
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

    let maps = Weatherable { map_size: options.map_size, uv: OverlayUv::Mesh, ..default() };
    for (number, surface) in exposed.iter().enumerate() {
        let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(surface.mesh.clone());
        app.world_mut().spawn((
            Name::new(surface.name.clone()),
            Number(number),
            maps,
            surface.material,
            Mesh3d(mesh),
            Transform::default(),
            GlobalTransform::default(),
        ));
    }
    wait_until_ready(&mut app, failed)?;
    add_rain(app.world_mut(), bounds(exposed), options);

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

type Unready = Or<(Without<SurfaceCollider>, Without<TexelArea>, Without<Exposure>)>;

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

/// Lowest and highest corner of all surfaces.
fn bounds(exposed: &[Exposed]) -> (Vec3, Vec3) {
    let positions = exposed.iter().filter_map(|surface| {
        surface.mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(|positions| positions.as_float3())
    });
    let points = positions.flatten().copied().map(Vec3::from_array).filter(|point| point.is_finite());
    let all = points.fold(None, |bounds: Option<(Vec3, Vec3)>, point| {
        let (low, high) = bounds.unwrap_or((point, point));
        Some((low.min(point), high.max(point)))
    });
    all.unwrap_or((Vec3::ZERO, Vec3::ZERO))
}

/// A sky over all of the scene, and over whatever the wind blows onto it.
fn add_rain(world: &mut World, (low, high): (Vec3, Vec3), options: &ExportOptions) {
    let mut effect = options.effect.clone();
    if let DropSizes::MarshallPalmer(_) = effect.drops {
        effect.drops = DropSizes::MarshallPalmer(options.rain_mm_per_h.clamp(0.1, 300.0));
    }
    let wind = Vec2::new(options.weather.wind.x, options.weather.wind.z);
    let above = if wind == Vec2::ZERO { ABOVE } else { ABOVE + GUST_RUN };
    let fall_seconds = (high.y - low.y + above) / SLOWEST;
    // Drops that are born up the wind are carried over the scene.
    let drift = -wind * fall_seconds;
    let (low_xz, high_xz) = (Vec2::new(low.x, low.z), Vec2::new(high.x, high.z));
    // Marks reach beyond what is hit, and a wall has no width.
    let margin = Vec2::splat(0.25);
    let (from, to) = (low_xz + drift.min(Vec2::ZERO) - margin, high_xz + drift.max(Vec2::ZERO) + margin);
    let (half_size, own) = ((to - from) / 2.0, (high_xz - low_xz) / 2.0 + margin);
    let middle = (from + to) / 2.0;
    let crowd = half_size.element_product() / own.element_product();
    let longest = f32::from(Lifespan::MAX_TICKS) / options.tick_hz as f32;
    let handle = world.resource_mut::<Assets<WeatherEffect>>().add(effect.clone());
    world.resource_mut::<EffectTable>().insert(handle.clone(), effect);
    world.spawn((
        Name::new("rain"),
        Emitter {
            effect: handle,
            rate: (options.particles_per_second * crowd).min(MOST_PER_SECOND),
            shape: EmitterShape::Sky { half_size },
            flow: Flow::MmPerHour(options.rain_mm_per_h),
            speed: 0.0,
            lifetime: (2.0 * fall_seconds + 1.0).min(longest),
            ..default()
        },
        Transform::from_xyz(middle.x, high.y + above, middle.y),
        GlobalTransform::from_xyz(middle.x, high.y + above, middle.y),
    ));
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
                let soaked = Soaked {
                    area_m2: geometry.0.area_mm2().iter().copied().map(f64::from).sum::<f64>() / 1e6,
                    triangles: collider.0.total,
                    totals: *totals,
                    held: held(water, matter, cpu, &now, size),
                };
                (
                    number.0,
                    (soaked, SurfaceMaps::new(name.to_string(), size, water, matter, *loss, cpu, &now)),
                )
            },
        )
        .collect();
    surfaces.sort_by_key(|(number, _)| *number);
    surfaces.into_iter().map(|(_, surface)| surface).collect()
}

/// What lies on each texel now, and how it looks.
fn held(
    water: &SurfaceWater,
    matter: &SurfaceMatter,
    cpu: Option<&CpuMaps>,
    now: &Now,
    size: u32,
) -> Vec<Held> {
    let channels = |map: &[[u8; 4]], texel: usize| {
        map.get(texel).map_or([0.0; 4], |texel| texel.map(|channel| f32::from(channel) / 255.0))
    };
    let one = |texel: u32| {
        // Beside an island, what lies at its border.
        let texel = now.geometry.stand_in(texel).unwrap_or(texel);
        let index = texel as usize;
        let mut held = Held::default();
        if let Some(state) = water.texels().get(index) {
            let amounts = now.amounts(&now.scale(water.units(), texel), texel, state);
            let look = now.look(&amounts, state);
            held.wetness = look.wetness as f32;
            held.gloss = look.gloss as f32;
            held.film_mm = (amounts.film_mm * look.film) as f32;
        }
        let unit_mm = now.geometry.unit_mm(water.units(), texel);
        let depth = |units: u32| (f64::from(units) * unit_mm) as f32;
        let TexelMatter { dust, mud, snow } = matter.texels().get(index).copied().unwrap_or_default();
        (held.dust_mm, held.mud_mm) = (depth(dust), depth(mud));
        held.snow_mm = depth(snow) / RELATIVE_DENSITY as f32;
        if let Some(cpu) = cpu {
            held.diffuse = channels(&cpu.diffuse, index);
            held.specular = channels(&cpu.specular, index);
            held.normal = channels(&cpu.normal, index);
        }
        held
    };
    (0..size * size).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sky_reaches_over_what_the_wind_blows_in() {
        let mut app =
            headless(task_pools(None), AssetPlugin { watch_for_changes_override: Some(false), ..default() });
        let mut options = ExportOptions::default();
        options.weather.wind = Vec3::new(3.0, 0.0, 0.0);
        add_rain(app.world_mut(), (Vec3::ZERO, Vec3::new(2.0, 1.0, 2.0)), &options);
        let world = app.world_mut();
        let mut query = world.query::<(&Emitter, &Transform)>();
        let (emitter, transform) = query.single(world).unwrap();
        let EmitterShape::Sky { half_size } = emitter.shape else { panic!("{:?}", emitter.shape) };
        let (west, east) = (transform.translation.x - half_size.x, transform.translation.x + half_size.x);
        // Six metres of fall at the slowest take two seconds.
        assert!((west + 6.25).abs() < 1e-4 && (east - 2.25).abs() < 1e-4, "{west} {east}");
        assert!((transform.translation.z - 1.0).abs() < 1e-4);
        assert!(emitter.rate > options.particles_per_second * 3.0);
    }
}
