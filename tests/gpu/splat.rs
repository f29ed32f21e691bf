//! The compute pass against the plain loop: not one bit may differ.

use bevy::diagnostic::DiagnosticsStore;
use bevy::prelude::*;
use bevy::render::gpu_readback::Readback;
use bevy_weathering::collision::MeshTriangles;
use bevy_weathering::effect::StampSource;
use bevy_weathering::overlay::{
    CpuMaps, Overlays, RainRing, Splat, SplatBudget, SplatQueue, SplatStats, StampAtlas, SurfaceFrames,
    Weatherable, Wrap,
};
use bevy_weathering::overload::OverloadDiagnosticsPlugin;
use bevy_weathering::stamps::StampKind;

use super::app::{app, read_back, update, update_until};
use crate::common::Random;

pub(super) const SIZE: u32 = 128;

/// Splats all over the map, many across its edges, of all sizes up to the map's.
pub(super) fn random_splats(count: u32, seed: u64) -> Vec<Splat> {
    let mut random = Random(seed);
    let mut next = |below: u32| random.below(below as usize) as u32;
    (0..count)
        .map(|number| {
            let end = SIZE * 256;
            let edge = number % 3 == 0;
            let center =
                |random: u32| (if edge { (random % 2048 + end - 1024) % end } else { random }) as i32;
            let largest = if number % 17 == 0 { (SIZE - 1) * 128 } else { 256 * 9 };
            Splat {
                center: [center(next(end)), center(next(end))],
                radius: [(128 + next(largest - 128)) as i32, (128 + next(largest - 128)) as i32],
                water_nl: if number % 11 == 0 { u32::MAX - number } else { next(2_000_000) },
                tick: 1 + number / 4,
                diffuse: next(u32::MAX),
                specular: next(u32::MAX),
                bump: next(255) as i32 - 127,
                bump_opacity: next(256),
                ..bytemuck::Zeroable::zeroed()
            }
        })
        .collect()
}

pub(super) fn spawn_surface(app: &mut App, surface: Weatherable) -> Entity {
    // Who has no mesh gets no maps. This one never comes.
    app.world_mut().spawn((surface, Mesh3d::default())).id()
}

pub(super) fn push(app: &mut App, entity: Entity, splats: &[Splat]) {
    let mut queue = app.world_mut().get_mut::<SplatQueue>(entity).unwrap();
    splats.iter().for_each(|&splat| queue.push(splat));
}

/// The maps of a surface, read back.
pub(super) fn maps_of(app: &mut App, entity: Entity, surface: &Weatherable) -> CpuMaps {
    let overlays = app.world().get::<Overlays>(entity).unwrap().clone();
    let read = read_back(
        app,
        vec![
            Readback::texture(overlays.diffuse),
            Readback::texture(overlays.specular),
            Readback::texture(overlays.normal),
        ],
    );
    let colors = |bytes: &[u8]| bytes.as_chunks::<4>().0.to_vec();
    CpuMaps {
        diffuse: colors(&read[0]),
        specular: colors(&read[1]),
        normal: colors(&read[2]),
        ..CpuMaps::new(surface)
    }
}

pub(super) fn painted(app: &mut App, splats: u64) {
    update_until(app, "the splats to be painted", |world| world.resource::<SplatStats>().splats() >= splats);
}

/// Texels that have got colour.
fn painted_texels(maps: &CpuMaps) -> usize {
    maps.diffuse.iter().filter(|texel| texel[3] > 0).count()
}

#[test]
fn gpu_and_cpu_agree_to_the_bit_for_every_edge_behaviour() {
    let Some(mut app) = app() else { return };
    let mut all = 0;
    for (wrap_u, wrap_v) in [
        (Wrap::Repeat, Wrap::Repeat),
        (Wrap::Clamp, Wrap::Repeat),
        (Wrap::Repeat, Wrap::Clamp),
        (Wrap::Clamp, Wrap::Clamp),
    ] {
        let surface = Weatherable { map_size: SIZE, wrap_u, wrap_v, ..default() };
        let entity = spawn_surface(&mut app, surface);
        let splats = random_splats(600, 42);
        let mut reference = CpuMaps::new(&surface);
        // In two batches, so that a pass begins on maps that are not empty.
        for batch in splats.chunks(350) {
            push(&mut app, entity, batch);
            reference.paint(batch, &StampAtlas::default(), None);
            all += batch.len() as u64;
            painted(&mut app, all);
        }
        let maps = maps_of(&mut app, entity, &surface);
        assert!(painted_texels(&reference) > (SIZE * SIZE / 4) as usize);
        assert_eq!(maps.diffuse, reference.diffuse, "{surface:?}");
        assert_eq!(maps.specular, reference.specular, "{surface:?}");
        assert_eq!(maps.normal, reference.normal, "{surface:?}");
    }
}

/// The stamps of mud and of flakes, in the app and by themselves.
fn add_stamps(app: &mut App) -> StampAtlas {
    for stamps in [StampSource::Kind(StampKind::Splat), StampSource::Kind(StampKind::Flakes)] {
        let set = stamps.read(&Default::default()).unwrap().unwrap();
        app.world_mut().resource_mut::<StampAtlas>().add(&set).unwrap();
    }
    app.world().resource::<StampAtlas>().clone()
}

#[test]
fn stamps_that_are_turned_and_stamps_in_space_are_the_same_to_the_bit() {
    let Some(mut app) = app() else { return };
    let atlas = add_stamps(&mut app);
    let wrap = [Wrap::Repeat, Wrap::Clamp];
    let surface = Weatherable { map_size: SIZE, wrap_u: wrap[0], wrap_v: wrap[1], ..default() };
    let triangles = MeshTriangles::from_mesh(&Sphere::new(1.0).mesh().uv(24, 16)).unwrap();
    let frames = SurfaceFrames::new(&triangles, SIZE, wrap);
    let mut random = Random(77);
    let mut next = |below: i32| random.below(below as usize) as i32;
    let mut splats = random_splats(400, 5);
    for (number, splat) in splats.iter_mut().enumerate() {
        splat.stamp = [0, 1 + number as u32 % atlas.len(), 4_000_000]
            [if number % 40 == 0 { 2 } else { number % 3 % 2 }];
        splat.row_s = [next(4000) - 2000, next(4000) - 2000, 0];
        splat.row_t = [next(4000) - 2000, next(4000) - 2000, 0];
        if number % 2 == 0 {
            continue;
        }
        // Anywhere on the sphere, turned any way.
        let at = frames.texels()[next((SIZE * SIZE) as i32) as usize].place().unwrap_or([9, 9, 9]);
        let radius = 1500 + next(9000);
        let turn = Quat::from_euler(EulerRot::XYZ, next(628) as f32 / 100.0, next(628) as f32 / 100.0, 0.0);
        let axes = [turn * Vec3::X, turn * Vec3::Y, turn * Vec3::Z];
        let scale = 256.0 / radius as f32 * 65_536.0;
        let row = |axis: Vec3| (axis * scale).round().as_ivec3().to_array();
        let packed = |axis: Vec3| {
            let [x, y, z] = (axis * 127.0).round().to_array().map(|part| part as i8 as u8);
            u32::from_le_bytes([x, y, z, 0])
        };
        [splat.row_s, splat.row_t, splat.row_n] = axes.map(row);
        [splat.axis_s, splat.axis_t, splat.axis_n] = axes.map(packed);
        (splat.origin, splat.reach, splat.in_space) = (at, 2 * radius, 1);
    }
    let differing = |a: &[[u8; 4]], b: &[[u8; 4]]| a.iter().zip(b).filter(|(a, b)| a != b).count();
    let mut all = 0;
    for (in_space, textured) in [(0, false), (0, true), (1, false), (1, true)] {
        let kind = |splat: &&Splat| splat.in_space == in_space && (splat.stamp > 0) == textured;
        let splats: Vec<Splat> = splats.iter().filter(kind).copied().collect();
        let entity = spawn_surface(&mut app, surface);
        app.world_mut().entity_mut(entity).insert(frames.clone());
        let mut reference = CpuMaps::new(&surface);
        reference.paint(&splats, &atlas, Some(&frames));
        push(&mut app, entity, &splats);
        all += splats.len() as u64;
        painted(&mut app, all);
        let maps = maps_of(&mut app, entity, &surface);
        let differ = [
            differing(&maps.diffuse, &reference.diffuse),
            differing(&maps.specular, &reference.specular),
            differing(&maps.normal, &reference.normal),
        ];
        assert_eq!(differ, [0; 3], "in space {in_space}, textured {textured}");
        let empty = CpuMaps::new(&surface);
        assert!(differing(&empty.diffuse, &maps.diffuse) > 2000, "in space {in_space}, textured {textured}");
    }
}

#[test]
fn a_stamp_in_the_corner_deposits_what_one_in_the_middle_does() {
    let Some(mut app) = app() else { return };
    let surface = Weatherable { map_size: SIZE, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, ..default() };
    let (corner, middle) = (spawn_surface(&mut app, surface), spawn_surface(&mut app, surface));
    let opaque = Splat { diffuse: 0xff20_80c0, specular: 0xff00_4020, ..random_splats(1, 9)[0] };
    let mut splat = Splat { center: [40, 200], ..opaque };
    (splat.radius, splat.water_nl) = ([1700, 2300], 4_188_790);
    push(&mut app, corner, &[splat]);
    let half = SIZE as i32 * 128;
    push(&mut app, middle, &[Splat { center: [40 + half, 200 + half], ..splat }]);
    painted(&mut app, 2);
    let (corner, middle) = (maps_of(&mut app, corner, &surface), maps_of(&mut app, middle, &surface));
    let mut untouched = 0;
    for y in 0..SIZE {
        for x in 0..SIZE {
            let here = (y * SIZE + x) as usize;
            let there = ((y + SIZE / 2) % SIZE * SIZE + (x + SIZE / 2) % SIZE) as usize;
            assert_eq!(corner.diffuse[here], middle.diffuse[there]);
            assert_eq!(corner.specular[here], middle.specular[there]);
            assert_eq!(corner.normal[here], middle.normal[there]);
            // Out of reach of a stamp of 6.6 by 9 texels around (64.2, 64.8).
            let far = |at: u32, middle: f32, radius: f32| (at as f32 + 0.5 - middle).abs() > radius + 1.0;
            if far((x + SIZE / 2) % SIZE, 64.2, 6.7) || far((y + SIZE / 2) % SIZE, 64.8, 9.0) {
                assert_eq!([corner.diffuse[here], corner.specular[here], corner.normal[here]], [[0; 4]; 3]);
                untouched += 1;
            }
        }
    }
    assert!(untouched > SIZE * SIZE * 9 / 10);
    // Of the 187 texels of its disc all but those at the rim.
    assert!(painted_texels(&corner) > 120);
}

#[test]
fn tiles_remember_their_last_drops_the_newest_first() {
    let Some(mut app) = app() else { return };
    let surface = Weatherable { map_size: SIZE, ..default() };
    let entity = spawn_surface(&mut app, surface);
    let drop = |tick: u32, x: i32| Splat {
        center: [x * 256, 5 * 256],
        radius: [512; 2],
        water_nl: 100 * tick,
        tick,
        ..bytemuck::Zeroable::zeroed()
    };
    // Into the second tile: six drops in two batches, one without water, and one over the edge from the first tile.
    let dust = Splat { water_nl: 0, ..drop(9, 20) };
    for batch in
        [vec![drop(1, 18), drop(2, 19), drop(3, 15)], vec![drop(4, 20), dust, drop(5, 21), drop(6, 22)]]
    {
        let before = app.world().resource::<SplatStats>().splats();
        push(&mut app, entity, &batch);
        painted(&mut app, before + batch.len() as u64);
    }
    let rings = app.world().get::<Overlays>(entity).unwrap().rings.clone();
    let bytes = read_back(&mut app, vec![Readback::buffer(rings)]);
    let rings: Vec<RainRing> = bytemuck::pod_collect_to_vec(&bytes[0]);
    let ring = |tick: u32, x: i32| RainRing { center: [x * 256, 5 * 256], tick, water_nl: 100 * tick };
    let nothing = RainRing::default();
    assert_eq!(rings[0..4], [ring(3, 15), nothing, nothing, nothing]);
    assert_eq!(rings[4..8], [ring(6, 22), ring(5, 21), ring(4, 20), ring(2, 19)]);
    assert!(rings[8..].iter().all(|ring| *ring == nothing));
}

#[test]
fn a_map_at_rest_costs_no_dispatch() {
    let Some(mut app) = app() else { return };
    let surface = Weatherable { map_size: SIZE, ..default() };
    let entity = spawn_surface(&mut app, surface);
    spawn_surface(&mut app, surface);
    push(&mut app, entity, &random_splats(5, 1));
    painted(&mut app, 5);
    let stats = app.world().resource::<SplatStats>().clone();
    assert_eq!(stats.dispatches(), 1, "only the surface that was hit");
    for _ in 0..10 {
        update(&mut app);
    }
    assert_eq!((stats.dispatches(), stats.splats()), (1, 5));
}

#[test]
fn what_is_beyond_the_budget_is_painted_in_the_next_frames_and_in_order() {
    let Some(mut app) = app() else { return };
    let surface = Weatherable { map_size: SIZE, ..default() };
    let mut references = [(); 2].map(|()| (spawn_surface(&mut app, surface), CpuMaps::new(&surface)));
    let stats = app.world().resource::<SplatStats>().clone();
    let mut all = 0;
    // The first waits for the pipeline. Of 112 bytes each, 27 begin within 3,000.
    for (budget, most) in [
        (SplatBudget::default(), 1000),
        (SplatBudget { per_frame: 50, ..default() }, 50),
        (SplatBudget { upload_bytes: 3000, ..default() }, 27),
    ] {
        app.insert_resource(budget);
        let carried = stats.carried();
        for ((entity, reference), count) in references.iter_mut().zip([400, 30]) {
            let splats = random_splats(count, all);
            push(&mut app, *entity, &splats);
            reference.paint(&splats, &StampAtlas::default(), None);
            all += u64::from(count);
        }
        let mut before = stats.splats();
        update_until(&mut app, "the splats to be painted", |_| {
            let painted = stats.splats() - before;
            assert!(painted <= most, "{painted} in a frame with {budget:?}");
            before = stats.splats();
            before >= all
        });
        assert_eq!((stats.splats(), stats.pending()), (all, 0));
        let is_cut = most < 430;
        assert_eq!(stats.carried() > carried, is_cut);
        // Each waits once, and all but those of the first frame do.
        assert!(stats.carried() - carried <= 430 && (!is_cut || stats.carried() - carried >= 430 - most));
    }
    // Bevy's diagnostics say the same.
    update(&mut app);
    let told = |path| app.world().resource::<DiagnosticsStore>().get(&path).and_then(|told| told.value());
    assert_eq!(told(OverloadDiagnosticsPlugin::CARRIED), Some(stats.carried() as f64));
    assert_eq!(told(OverloadDiagnosticsPlugin::PENDING), Some(0.0));
    for (entity, reference) in &references {
        let maps = maps_of(&mut app, *entity, &surface);
        assert!(maps == *reference);
    }
}
