//! Water on surfaces: what a tick costs while films run, and when nothing does.
//!
//! A wall of a square metre, upright, of glazed matter that keeps 0.05 mm, gets a film of 0.3 mm all over: every tile of its
//! map is busy. Timed is the schedule of a tick. Then the same walls at rest and wet, one of them and a hundred; the
//! baseline is the same world without a surface. Exposure: rays of the bake on the bunny, all cores, divided by them.
//! Memory: state, geometry and what the GPU holds, per texel.

use std::time::Instant;

use bevy::asset::AssetPlugin;
use bevy::math::Affine3A;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::collision::{CollisionScene, MeshBvh};
use bevy_weathering::overlay::CpuOverlayPlugin;
use bevy_weathering::prelude::*;
use bevy_weathering::replay::task_pools;
use bevy_weathering::scenes::meshes::ground;
use bevy_weathering::wetmap::accessibility;
use bevy_weathering::wetting::gpu::GpuTexelWater;
use bevy_weathering::wetting::{SurfaceWater, TexelWater, WetGeometry, WettingStats, surface_points};
use criterion::Criterion;

use crate::{glb, measure};

fn world() -> App {
    let mut app = App::new();
    app.add_plugins((
        MinimalPlugins.set(task_pools(None)),
        TransformPlugin,
        AssetPlugin::default(),
        MeshPlugin,
    ))
    .add_plugins(WeatheringPlugins)
    .add_plugins(CpuOverlayPlugin)
    .insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    app.finish();
    app.cleanup();
    app
}

/// Walls, measured.
fn walls(app: &mut App, count: usize, size: u32) -> Vec<Entity> {
    let mesh = ground(Vec2::ONE, UVec2::splat(8)).unwrap();
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh);
    let glazed = PorousMaterial { capacity_mm: 0.0, retained_mm: 0.05, ..default() };
    let walls: Vec<Entity> = (0..count)
        .map(|i| {
            let upright = Transform::from_xyz(2.0 * i as f32, 2.0, 0.0)
                .with_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
            let maps = Weatherable { map_size: size, wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, ..default() };
            let wall = (maps, glazed, Mesh3d(mesh.clone()), upright, GlobalTransform::from(upright));
            app.world_mut().spawn(wall).id()
        })
        .collect();
    while walls.iter().any(|&wall| app.world().get::<SurfaceWater>(wall).is_none()) {
        app.update();
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    walls
}

fn cover(app: &mut App, wall: Entity, film_mm: f32) {
    let geometry = app.world().get::<WetGeometry>(wall).unwrap().0.clone();
    app.world_mut().get_mut::<SurfaceWater>(wall).unwrap().cover(&geometry, film_mm, 0.0, 1);
}

/// Mean microseconds of a tick.
fn ticks(app: &mut App, count: u32) -> f64 {
    let begun = Instant::now();
    for _ in 0..count {
        app.world_mut().run_schedule(WeatheringTick);
    }
    begun.elapsed().as_secs_f64() * 1e6 / f64::from(count)
}

/// Runs the group.
pub fn bench(_: &mut Criterion) {
    if !measure::wanted("wetting") || !measure::measuring() {
        return;
    }
    let nothing = ticks(&mut world(), 2000);
    println!("wetting: a tick without surfaces {nothing:.2} us");
    for size in [512, 1024, 2048] {
        let mut app = world();
        let wall = walls(&mut app, 1, size)[0];
        let dry = ticks(&mut app, 500);
        cover(&mut app, wall, 0.3);
        ticks(&mut app, 4);
        let steps = |app: &App| app.world().resource::<WettingStats>().tiles_run();
        let before = steps(&app);
        let busy = ticks(&mut app, 60);
        let texels = (steps(&app) - before) as f64 * 256.0 / 60.0;
        println!(
            "wetting: {size} x {size}: all tiles busy {busy:.0} us a tick, {texels:.0} texel steps of {:.0} ns; dry {dry:.2} us",
            busy * 1000.0 / texels
        );
        // It would drain for minutes: another one, with less than what runs, is at rest at once.
        let mut app = world();
        let wall = walls(&mut app, 1, size)[0];
        cover(&mut app, wall, 0.02);
        ticks(&mut app, 200);
        assert!(app.world().get::<SurfaceWater>(wall).unwrap().is_at_rest());
        let idle = ticks(&mut app, 2000);
        let (water, geometry) =
            (app.world().get::<SurfaceWater>(wall).unwrap(), app.world().get::<WetGeometry>(wall).unwrap());
        let texels = (size * size) as f64;
        println!(
            "wetting: {size} x {size}: wet, at rest {idle:.2} us a tick; bytes a texel: state {:.2} of {}, geometry {:.1}, GPU {}",
            water.bytes() as f64 / texels,
            size_of::<TexelWater>(),
            geometry.0.bytes() as f64 / texels,
            size_of::<GpuTexelWater>()
        );
    }
    let mut app = world();
    let hundred = walls(&mut app, 100, 512);
    for &wall in &hundred {
        cover(&mut app, wall, 0.02);
    }
    ticks(&mut app, 200);
    let idle = ticks(&mut app, 2000);
    println!(
        "wetting: 100 wet surfaces at rest {idle:.2} us a tick, {:.3} us each",
        (idle - nothing) / 100.0
    );

    let bvh = std::sync::Arc::new(MeshBvh::build(glb::triangles(glb::BUNNY)));
    let wrap = [Wrap::Clamp; 2];
    let points = surface_points(bvh.triangles(), &Affine3A::IDENTITY, 256, wrap);
    let bunny = Entity::from_raw_u32(1).unwrap();
    let scene = CollisionScene::new([(bunny, Affine3A::IDENTITY, bvh)]);
    let begun = Instant::now();
    let open = accessibility(&scene, &points, 32, 0.5);
    let seconds = begun.elapsed().as_secs_f64();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let rays = points.len() as f64 * 32.0;
    let mean = open.iter().sum::<f32>() / open.len() as f32;
    println!(
        "wetting: exposure {:.2} million rays/s a core ({} points of 32 rays, {cores} cores, mean {mean:.2})",
        rays / seconds / cores as f64 / 1e6,
        points.len()
    );
}
