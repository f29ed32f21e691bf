//! Water in and on surfaces, in whole apps without a renderer: arrival, run-off, drips, drying, queries, accounts.

pub mod scene;

use bevy::prelude::*;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::particle::ParticleCounts;
use bevy_weathering::prelude::*;
use bevy_weathering::scenes::meshes::ground;
use bevy_weathering::weather::Weather;
use bevy_weathering::wetting::{
    BecameWet, Dried, SurfaceWater, WatchWetness, WetGeometry, WetnessQuery, WettingStats,
};

use self::scene::{RunOnce, Scene};

/// Takes up nothing.
fn glazed() -> PorousMaterial {
    PorousMaterial { capacity_mm: 0.0, ..default() }
}

fn brick() -> PorousMaterial {
    PorousMaterial { capacity_mm: 3.0, sorptivity: 2.0, retained_mm: 1000.0, rim_delay: 0.0, ..default() }
}

/// A metre square of floor whose uvs are scaled about their middle.
fn slab(uv_scale: Vec2) -> Mesh {
    let mut mesh = ground(Vec2::ONE, UVec2::splat(4)).unwrap();
    let Some(bevy::mesh::VertexAttributeValues::Float32x2(uvs)) = mesh.attribute_mut(Mesh::ATTRIBUTE_UV_0)
    else {
        panic!("it has uvs");
    };
    for uv in uvs {
        *uv = ((Vec2::from_array(*uv) - 0.5) * uv_scale + 0.5).to_array();
    }
    mesh
}

#[test]
fn six_minutes_of_ten_millimetres_an_hour_are_a_millimetre_whatever_the_drops_and_the_map() {
    for (rate, size, uv_scale) in [
        (50.0, 64, Vec2::ONE),
        (400.0, 64, Vec2::ONE),
        (50.0, 256, Vec2::ONE),
        (50.0, 128, Vec2::new(0.5, 0.9)),
        (50.0, 128, Vec2::splat(0.3)),
    ] {
        let mut scene = Scene::new(10);
        let slab = scene.surface(slab(uv_scale), size, glazed(), Transform::default());
        // A millimetre on a square metre, in 360 s.
        let water_mm3 = 1.0e6 / 360.0 / rate;
        let shape = EmitterShape::Sky { half_size: Vec2::splat(0.5) };
        let emitter = Emitter { rate, shape, speed: 6.0, lifetime: 2.0, ..default() };
        let rain = scene.emit(emitter, water_mm3, 0.02, Vec3::Y);
        // In the first tick it asks for its effect.
        scene.run(1);
        scene.run(3600);
        scene.0.world_mut().despawn(rain);
        scene.run(30);
        let over = scene.over(slab);
        let depth_mm = over.film_ml / 1000.0 / over.area_m2;
        assert!((depth_mm - 1.0).abs() < 0.01, "{rate}/s, {size}, {uv_scale}: {depth_mm} mm");
        let middle = scene.at(slab, Vec2::splat(0.5));
        assert!((0.3..2.0).contains(&middle.film_mm) && middle.absorbed_mm == 0.0, "{middle:?}");
    }
}

#[test]
fn a_film_goes_into_brick_by_the_root_of_time_and_stays_on_glaze() {
    let mut scene = Scene::new(60);
    let mesh = || ground(Vec2::ONE, UVec2::splat(2)).unwrap();
    let brick = scene.surface(mesh(), 16, brick(), Transform::default());
    let glazed = scene.surface(mesh(), 16, glazed(), Transform::from_xyz(5.0, 0.0, 0.0));
    for surface in [brick, glazed] {
        let geometry = scene.0.world().get::<WetGeometry>(surface).unwrap().0.clone();
        scene.0.world_mut().get_mut::<SurfaceWater>(surface).unwrap().cover(&geometry, 0.5, 0.0, 1);
    }
    scene.run(1);
    for expected in [0.258199, 0.365148, 0.447214, 0.5] {
        scene.run(60);
        let here = scene.at(brick, Vec2::splat(0.4));
        assert!((here.absorbed_mm - expected).abs() < 2e-5, "{here:?} {expected}");
        assert!((here.film_mm + here.absorbed_mm - 0.5).abs() < 2e-5);
        let glaze = scene.at(glazed, Vec2::splat(0.4));
        assert!((glaze.film_mm - 0.5).abs() < 1e-5 && glaze.absorbed_mm == 0.0 && glaze.wetness > 0.999);
    }
}

#[test]
fn a_film_on_what_becomes_of_other_matter_for_the_first_time_goes_into_it_from_then_on() {
    let mut scene = Scene::new(60);
    let mut covered = |x: f32| {
        let mesh = ground(Vec2::ONE, UVec2::splat(2)).unwrap();
        let surface = scene.surface(mesh, 16, glazed(), Transform::from_xyz(x, 0.0, 0.0));
        let geometry = scene.0.world().get::<WetGeometry>(surface).unwrap().0.clone();
        scene.0.world_mut().get_mut::<SurfaceWater>(surface).unwrap().cover(&geometry, 0.5, 0.0, 1);
        surface
    };
    let (remade, bared) = (covered(0.0), covered(5.0));
    scene.run(241);
    scene.0.world_mut().entity_mut(remade).insert(brick());
    // What is made of nothing in particular is terracotta, which soon is full.
    scene.0.world_mut().entity_mut(bared).remove::<PorousMaterial>();
    scene.run(1);
    for surface in [remade, bared] {
        let here = scene.at(surface, Vec2::splat(0.4));
        assert!((here.absorbed_mm - 1.0 / 30.0).abs() < 1e-3, "{here:?}");
    }
    scene.run(59);
    let here = scene.at(remade, Vec2::splat(0.4));
    assert!((here.absorbed_mm - 0.2582).abs() < 1e-3, "{here:?}");
}

#[test]
fn film_dries_before_pores_gloss_and_the_rim_before_the_middle_and_puddles_last() {
    let mut scene = Scene::new(60);
    let material =
        PorousMaterial { capacity_mm: 0.2, visible_mm: 0.2, rim_delay: 1.0, retained_mm: 5.0, ..default() };
    let wall =
        scene.surface(ground(Vec2::ONE, UVec2::splat(2)).unwrap(), 128, material, Transform::default());
    // A patch with full pores and a puddle in its middle.
    for _ in 0..3 {
        scene.pour(wall, Vec2::splat(0.5), 30, 30_000_000);
    }
    scene.pour(wall, Vec2::splat(0.5), 6, 12_000_000);
    scene.run(120);
    let start = scene.at(wall, Vec2::splat(0.5));
    assert!(start.film_mm > 1.0 && start.saturation > 0.99, "{start:?}");
    scene.0.world_mut().resource_mut::<Weather>().drying_speed = 600.0;
    // The first time at which a place looks half dry.
    let places = [Vec2::new(0.5, 0.5), Vec2::new(0.5, 0.56), Vec2::new(0.5, 0.62), Vec2::new(0.5, 0.655)];
    let mut dry_at = [None; 4];
    let mut film_gone = None;
    for second in 0..600 {
        for (place, dry_at) in places.iter().zip(&mut dry_at) {
            let here = scene.at(wall, *place);
            if here.wetness < 0.5 {
                dry_at.get_or_insert(second);
            }
        }
        let middle = scene.at(wall, places[1]);
        if middle.film_mm == 0.0 {
            film_gone.get_or_insert((second, middle.saturation));
        }
        scene.run(60);
    }
    let dry_at = dry_at.map(|second| second.expect("it dries"));
    assert!(dry_at[0] > dry_at[1] + 5 && dry_at[1] > dry_at[2] && dry_at[2] > dry_at[3], "{dry_at:?}");
    let (film_gone, saturation) = film_gone.unwrap();
    assert!(film_gone < dry_at[1] && saturation > 0.9, "{film_gone} {saturation}");
}

#[test]
fn what_is_wetted_again_when_half_dry_goes_on_without_a_jump() {
    let mut scene = Scene::new(60);
    let material =
        PorousMaterial { capacity_mm: 0.2, visible_mm: 0.2, t_fill: 1.0, rim_delay: 0.0, ..default() };
    let wall = scene.surface(ground(Vec2::ONE, UVec2::splat(2)).unwrap(), 32, material, Transform::default());
    let geometry = scene.0.world().get::<WetGeometry>(wall).unwrap().0.clone();
    scene.0.world_mut().get_mut::<SurfaceWater>(wall).unwrap().cover(&geometry, 0.0, 0.2, 1);
    scene.0.world_mut().resource_mut::<Weather>().drying_speed = 600.0;
    let middle = Vec2::splat(0.5);
    let mut before = scene.at(wall, middle);
    let (mut least, mut most_after) = (1.0f32, 0.0f32);
    for tick in 0..1200 {
        if before.wetness < 0.5 && least > before.wetness && tick < 900 {
            least = least.min(before.wetness);
            if least < 0.45 {
                scene.pour(wall, middle, 12, 6_000_000);
            }
        }
        scene.run(1);
        let now = scene.at(wall, middle);
        assert!((now.wetness - before.wetness).abs() < 0.03, "{tick}: {before:?} {now:?}");
        if least < 0.45 {
            most_after = most_after.max(now.wetness);
        }
        before = now;
    }
    assert!(least < 0.45 && most_after > 0.9, "{least} {most_after}");
}

#[test]
fn a_surface_at_rest_costs_nothing() {
    let mut scene = Scene::new(60);
    let wall = scene.surface(ground(Vec2::ONE, UVec2::splat(2)).unwrap(), 128, brick(), Transform::default());
    scene.pour(wall, Vec2::splat(0.5), 10, 5_000_000);
    scene.run(60 * 600);
    assert!(scene.water(wall).is_at_rest());
    let counters = |scene: &Scene| {
        let stats = scene.0.world().resource::<WettingStats>();
        [stats.drops(), stats.tiles_run(), stats.tiles_spread(), stats.rims()]
    };
    let (before, texels) = (counters(&scene), scene.water(wall).texels().to_vec());
    assert!(before[0] == 1 && before[2] > 0, "{before:?}");
    scene.0.world_mut().resource_mut::<Weather>().drying_speed = 50.0;
    let wet = scene.over(wall);
    scene.run(6000);
    // It has dried in the meantime, without a step, and without a change to what it holds.
    assert!(scene.over(wall).absorbed_ml < wet.absorbed_ml);
    assert_eq!((counters(&scene), scene.water(wall).texels()), (before, texels.as_slice()));
}

#[test]
fn water_runs_down_a_wall_drips_from_its_edge_and_wets_what_is_below() {
    let mut scene = Scene::new(60);
    let smooth = PorousMaterial { capacity_mm: 0.0, retained_mm: 0.05, ..default() };
    let upright =
        Transform::from_xyz(0.0, 1.5, 0.0).with_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
    let wall = scene.surface(ground(Vec2::ONE, UVec2::splat(3)).unwrap(), 128, smooth, upright);
    let floor = scene.surface(
        ground(Vec2::splat(3.0), UVec2::splat(3)).unwrap(),
        128,
        glazed(),
        Transform::default(),
    );
    // 40 ml near the upper edge; v runs down.
    for _ in 0..20 {
        scene.pour(wall, Vec2::new(0.5, 0.1), 5, 2_000_000);
        scene.run(10);
    }
    let upper = scene.at(wall, Vec2::new(0.5, 0.1)).film_mm;
    assert!(scene.at(wall, Vec2::new(0.5, 0.9)).film_mm < upper);
    scene.run(60 * 40);
    assert!(scene.at(wall, Vec2::new(0.5, 0.1)).film_mm < 0.15, "it has run down");
    let (wall_ledger, floor_ledger) = (scene.water(wall).ledger(), scene.water(floor).ledger());
    assert!(wall_ledger.dripped > wall_ledger.received / 4, "{wall_ledger:?}");
    let nl = |surface: Entity, units: u64| scene.water(surface).units().whole_nl(units);
    // All drips land on the floor, but for those that are still falling.
    let (landed, dripped) = (nl(floor, floor_ledger.received), nl(wall, wall_ledger.dripped));
    assert!(landed <= dripped && dripped - landed < 100_000, "{landed} of {dripped}");
    // Right below the wall, not beside it.
    assert!(
        scene.at(floor, Vec2::new(0.5, 0.5)).film_mm > 0.0
            || scene.at(floor, Vec2::new(0.5, 0.51)).film_mm > 0.0
    );
    assert_eq!(scene.at(floor, Vec2::new(0.9, 0.5)).film_mm, 0.0);
    let counts = *scene.0.world().resource::<ParticleCounts>();
    assert!(counts.hit > 0 && counts.expired == 0, "{counts:?}");
}

#[test]
fn water_collects_in_hollows_and_stands_level() {
    let mut scene = Scene::new(60);
    // A bowl: 10 mm deep in the middle.
    let mut mesh = ground(Vec2::ONE, UVec2::splat(40)).unwrap();
    let Some(bevy::mesh::VertexAttributeValues::Float32x3(positions)) =
        mesh.attribute_mut(Mesh::ATTRIBUTE_POSITION)
    else {
        panic!("it has positions");
    };
    for position in positions {
        let distance = (position[0] * position[0] + position[2] * position[2]).sqrt();
        position[1] = 0.02 * distance;
    }
    let smooth = PorousMaterial { capacity_mm: 0.0, retained_mm: 0.05, ..default() };
    let bowl = scene.surface(mesh, 64, smooth, Transform::default());
    scene.pour(bowl, Vec2::new(0.5, 0.2), 6, 100_000_000);
    scene.run(60 * 60);
    let depth = |scene: &mut Scene, u: f32, v: f32| scene.at(bowl, Vec2::new(u, v)).film_mm;
    let (middle, slope) = (depth(&mut scene, 0.5, 0.5), depth(&mut scene, 0.5, 0.3));
    assert!(middle > 1.5 && slope < 0.3, "{middle} {slope}");
    // Level: deeper by as much as the ground is lower.
    let off = 0.06;
    let aside = depth(&mut scene, 0.5 + off, 0.5);
    assert!((middle - aside - 20.0 * off).abs() < 0.5, "{middle} {aside}");
    assert!(scene.rests(bowl, 1800), "a pool that is level is at rest");
}

#[test]
fn wet_patches_spread_in_the_pores_and_stop() {
    let mut scene = Scene::new(60);
    let material = PorousMaterial { retained_mm: 1000.0, capacity_mm: 0.3, visible_mm: 0.1, ..brick() };
    let wall =
        scene.surface(ground(Vec2::splat(0.2), UVec2::splat(2)).unwrap(), 64, material, Transform::default());
    for _ in 0..4 {
        scene.pour(wall, Vec2::splat(0.5), 8, 100_000);
    }
    scene.run(30);
    let before = scene.over(wall);
    scene.run(60 * 30);
    let after = scene.over(wall);
    assert!(after.wet_fraction > 1.08 * before.wet_fraction, "{before:?} {after:?}");
    assert!((after.absorbed_ml + after.film_ml - before.absorbed_ml - before.film_ml).abs() < 1e-5);
    assert!(scene.rests(wall, 3600), "{:?}", scene.over(wall));
}

/// Messages that came, of each kind.
#[derive(Resource, Default)]
struct Told((u32, u32));

fn listen(mut wet: MessageReader<BecameWet>, mut dried: MessageReader<Dried>, mut told: ResMut<Told>) {
    told.0.0 += wet.read().count() as u32;
    told.0.1 += dried.read().count() as u32;
}

#[test]
fn games_can_ask_and_are_told() {
    let mut scene = Scene::new(60);
    let material = PorousMaterial { capacity_mm: 0.1, visible_mm: 0.1, rim_delay: 0.0, ..default() };
    let floor = scene.surface(
        ground(Vec2::ONE, UVec2::splat(2)).unwrap(),
        64,
        material,
        Transform::from_xyz(0.0, 1.0, 0.0).with_scale(Vec3::splat(2.0)),
    );
    scene.0.world_mut().entity_mut(floor).insert(WatchWetness::default());
    let nobody = scene.0.world_mut().spawn_empty().id();
    let ask = move |query: WetnessQuery| {
        (
            query.at_point(floor, Vec3::new(0.02, 1.05, 0.03)),
            query.at_point(floor, Vec3::new(0.9, 0.95, 0.9)),
            query.at_point(floor, Vec3::new(0.0, 3.0, 0.0)),
            query.at_uv(nobody, Vec2::splat(0.5)),
        )
    };
    scene.0.init_resource::<Told>().add_systems(WeatheringTick, listen.in_set(WeatheringSystems::Last));
    let told = |scene: &mut Scene| std::mem::take(&mut *scene.0.world_mut().resource_mut::<Told>()).0;
    assert_eq!(told(&mut scene), (0, 0));
    scene.pour(floor, Vec2::splat(0.5), 28, 400_000_000);
    scene.run(60);
    let (middle, corner, far, none) = scene.0.world_mut().run_system_once_with_nothing(ask);
    assert!(middle.unwrap().wetness > 0.9 && corner.unwrap().wetness < 0.1, "{middle:?} {corner:?}");
    assert_eq!((far, none), (None, None));
    assert_eq!(told(&mut scene), (1, 0));
    let over = scene.over(floor);
    assert!((over.area_m2 - 4.0).abs() < 1e-3 && over.wet_fraction > 0.2, "{over:?}");
    assert!((over.film_ml + over.absorbed_ml - 400.0).abs() < 0.1, "{over:?}");
    scene.0.world_mut().resource_mut::<Weather>().drying_speed = 3000.0;
    scene.run(60 * 60);
    assert_eq!(told(&mut scene), (0, 1));
}

#[test]
fn a_floor_can_be_asked_below_a_rug() {
    let mut scene = Scene::new(60);
    let mesh = |side: f32| ground(Vec2::splat(side), UVec2::splat(2)).unwrap();
    let floor = scene.surface(mesh(1.0), 16, glazed(), Transform::default());
    let rug = scene.surface(mesh(2.0), 16, glazed(), Transform::from_xyz(0.0, 0.05, 0.0));
    let geometry = scene.0.world().get::<WetGeometry>(floor).unwrap().0.clone();
    scene.0.world_mut().get_mut::<SurfaceWater>(floor).unwrap().cover(&geometry, 0.5, 0.0, 1);
    scene.run(1);
    let point = Vec3::new(0.0, 0.1, 0.0);
    let ask = move |query: WetnessQuery| [floor, rug].map(|surface| query.at_point(surface, point));
    let [floor, rug] = scene.0.world_mut().run_system_once_with_nothing(ask);
    assert!(floor.is_some_and(|here| (here.film_mm - 0.5).abs() < 1e-3), "{floor:?}");
    assert!(rug.is_some_and(|here| here.film_mm == 0.0), "{rug:?}");
}

/// A slope of 20 degrees that ends in a wall below it: two islands of uv, turned against each other, with one edge in
/// common.
fn slope_and_wall() -> Mesh {
    use bevy::asset::RenderAssetUsages;
    use bevy::mesh::{Indices, PrimitiveTopology};
    let (rise, run) = 20f32.to_radians().sin_cos();
    let positions: Vec<[f32; 3]> = vec![
        // The slope: upper edge, then the edge in common.
        [-0.5, 0.5 + rise, 0.5 - run],
        [0.5, 0.5 + rise, 0.5 - run],
        [-0.5, 0.5, 0.5],
        [0.5, 0.5, 0.5],
        // The wall: the edge in common, then the lower edge.
        [-0.5, 0.5, 0.5],
        [0.5, 0.5, 0.5],
        [-0.5, -0.5, 0.5],
        [0.5, -0.5, 0.5],
    ];
    let uvs: Vec<[f32; 2]> = vec![
        // v runs down the slope ...
        [0.05, 0.05],
        [0.45, 0.05],
        [0.05, 0.45],
        [0.45, 0.45],
        // ... and u down the wall.
        [0.55, 0.95],
        [0.55, 0.55],
        [0.95, 0.95],
        [0.95, 0.55],
    ];
    let normals: Vec<[f32; 3]> = [[0.0, run, rise]; 4].into_iter().chain([[0.0, 0.0, 1.0]; 4]).collect();
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs)
        .with_inserted_indices(Indices::U32(vec![0, 2, 1, 1, 2, 3, 4, 6, 5, 5, 6, 7]))
}

#[test]
fn water_runs_over_a_seam_from_a_slope_to_a_wall_and_to_nowhere_else() {
    let mut scene = Scene::new(60);
    let smooth = PorousMaterial { capacity_mm: 0.0, retained_mm: 0.05, ..default() };
    let body = scene.surface(slope_and_wall(), 128, smooth, Transform::from_xyz(0.0, 2.0, 0.0));
    for _ in 0..20 {
        scene.pour(body, Vec2::new(0.25, 0.15), 4, 2_000_000);
        scene.run(10);
    }
    scene.run(60 * 20);
    let film = |scene: &mut Scene, u: f32, v: f32| scene.at(body, Vec2::new(u, v)).film_mm;
    // Straight down: the middle of the slope's width is the middle of the wall's.
    assert!(film(&mut scene, 0.25, 0.43) > 0.02, "down the slope");
    assert!(film(&mut scene, 0.58, 0.75) > 0.02, "over the edge");
    assert!(film(&mut scene, 0.9, 0.75) > 0.02, "down the wall");
    for (u, v) in [(0.07, 0.3), (0.43, 0.3), (0.7, 0.58), (0.7, 0.93)] {
        assert_eq!(film(&mut scene, u, v), 0.0, "{u} {v}");
    }
    // All of it left at the lower edge or is still there: none at the upper end, nor at the seam.
    let ledger = scene.water(body).ledger();
    let held: u64 = scene.water(body).texels().iter().map(|texel| texel.total()).sum();
    assert_eq!(ledger.received, held + ledger.dripped);
    assert!(ledger.dripped > ledger.received / 4, "{ledger:?} {held}");
}

#[test]
fn sun_wind_and_open_places_dry_first() {
    let mut scene = Scene::new(60);
    let material =
        PorousMaterial { capacity_mm: 0.2, visible_mm: 0.2, rim_delay: 0.0, sorptivity: 0.0, ..default() };
    let sunny = Weather {
        sun_w_per_m2: 800.0,
        sun_direction: Vec3::new(0.2, -1.0, 0.0),
        drying_speed: 0.0,
        ..default()
    };
    scene.0.insert_resource(sunny);
    // A floor with a wall on it, and half of it under a low roof.
    let floor =
        scene.surface(ground(Vec2::splat(2.0), UVec2::splat(4)).unwrap(), 64, material, Transform::default());
    let upright =
        Transform::from_xyz(0.5, 0.5, 0.0).with_rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_2));
    scene.surface(ground(Vec2::new(1.0, 2.0), UVec2::splat(2)).unwrap(), 16, glazed(), upright);
    let roof = Transform::from_xyz(-0.6, 0.8, 0.0);
    scene.surface(ground(Vec2::new(0.8, 2.4), UVec2::splat(2)).unwrap(), 16, glazed(), roof);
    // Until rays have been cast against all three.
    for _ in 0..300 {
        scene.0.update();
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(!scene.0.world().resource::<bevy_weathering::wetting::ExposureProgress>().is_busy());
    let geometry = scene.0.world().get::<WetGeometry>(floor).unwrap().0.clone();
    let wet = |scene: &mut Scene| {
        let tick = scene.0.world().resource::<WeatheringClock>().tick();
        let mut water = scene.0.world_mut().get_mut::<SurfaceWater>(floor).unwrap();
        water.cover(&geometry, 0.0, 0.2, tick);
    };
    wet(&mut scene);
    let left = |scene: &mut Scene, u: f32| scene.at(floor, Vec2::new(u, 0.5)).absorbed_mm;
    scene.0.world_mut().resource_mut::<Weather>().drying_speed = 100.0;
    scene.run(60 * 4);
    // u grows with x: under the roof, in the open, and close to the wall, on the side that the sun shines on.
    let (under, open, corner) = (left(&mut scene, 0.2), left(&mut scene, 0.52), left(&mut scene, 0.735));
    assert!(open < 0.9 * under, "sun: {open} {under}");
    assert!(open < corner - 0.001, "an open place dries before a corner: {open} {corner}");
    // The same with wind.
    let still = 0.2 - under;
    scene.0.world_mut().resource_mut::<Weather>().wind = Vec3::X * 6.0;
    let before = under;
    scene.run(60 * 4);
    let windy = before - left(&mut scene, 0.2);
    assert!(windy > 2.0 * still, "wind: {still} {windy}");
}
