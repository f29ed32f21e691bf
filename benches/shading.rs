//! What a pixel of a weathered surface costs, against the same pixel of a `StandardMaterial`.
//!
//! A wall fills a picture of 1280 by 1024, lit by one sun without shadows and an environment map, with colour, normal
//! and roughness textures. One app holds a wall of each kind; every round shows each of them for some frames. A frame is
//! timed until the GPU is done with it; a frame that shows nothing tells what is not shading.

use std::time::Instant;

use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::material::{DryMaterial, PorousMaterial, WettingModel};
use bevy_weathering::offscreen::Stage;
use bevy_weathering::overlay::Weatherable;
use bevy_weathering::scenes::stone::{Stone, stone_maps};
use bevy_weathering::schedule::WeatheringTick;
use bevy_weathering::wetting::{SurfaceWater, WetGeometry};
use criterion::Criterion;

use crate::headless;
use crate::measure;

const SIZE: UVec2 = UVec2::new(1280, 1024);
const MAP_SIZE: u32 = 256;
const ROUNDS: u32 = 6;
const FRAMES: u32 = 2;

/// One wall.
struct Wall {
    name: &'static str,
    /// `None` is a `StandardMaterial`.
    porous: Option<PorousMaterial>,
    /// Water on all of it, mm.
    water_mm: f32,
}

fn walls() -> Vec<Wall> {
    let with = |model| Some(PorousMaterial { model, t_fill: 0.0, ..default() });
    let hnat = with(WettingModel::default());
    let wall = |name, porous, water_mm| Wall { name, porous, water_mm };
    // The matter takes up .05 mm. Stamps leave up to twice the mean, so .02 is wet without a film.
    let (wet, drenched) = (0.02, 0.4);
    vec![
        wall("standard", None, 0.0),
        wall("dry", hnat, 0.0),
        wall("hnat", hnat, wet),
        wall("hnat, drenched", hnat, drenched),
        wall(
            "hnat + lekner-dorf, drenched",
            with(WettingModel::HnatLeknerDorf(default(), default())),
            drenched,
        ),
        wall("lagarde", with(WettingModel::Lagarde(default())), wet),
        wall("lekner-dorf", with(WettingModel::LeknerDorf(default())), wet),
        wall("twomey", with(WettingModel::Twomey(default())), wet),
        wall("authored", with(WettingModel::Authored(default())), wet),
    ]
}

/// Spawns a wall on a layer of its own.
fn spawn_wall(
    app: &mut App,
    wall: &Wall,
    layer: usize,
    mesh: &Handle<Mesh>,
    dry: &StandardMaterial,
) -> Entity {
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(dry.clone());
    let looks = (Mesh3d(mesh.clone()), MeshMaterial3d(material), RenderLayers::layer(layer));
    let mut entity = app.world_mut().spawn(looks);
    if let Some(porous) = wall.porous {
        entity.insert((porous, Weatherable { map_size: MAP_SIZE, ..default() }));
    }
    entity.id()
}

/// Lays water on all of a wall: what its pores take up is in them, the rest on top.
fn wet(app: &mut App, entity: Entity, water_mm: f32) {
    while app.world().get::<WetGeometry>(entity).is_none() {
        app.update();
    }
    let geometry = app.world().get::<WetGeometry>(entity).unwrap().0.clone();
    let capacity = app.world().get::<PorousMaterial>(entity).unwrap().capacity_mm;
    let mut water = app.world_mut().get_mut::<SurfaceWater>(entity).unwrap();
    water.cover(&geometry, (water_mm - capacity).max(0.0), water_mm.min(capacity), 1);
}

/// Runs the group.
pub fn bench(_: &mut Criterion) {
    if !measure::wanted("shading") || !measure::measuring() {
        return;
    }
    let walls = walls();
    let mut app = headless::app();
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    let world = app.world_mut();
    let sun = DirectionalLight { illuminance: 5000.0, ..default() };
    let stage = Stage::new(world, SIZE, sun, Vec3::NEG_ONE);
    let mut images = world.resource_mut::<Assets<Image>>();
    let stone = stone_maps(Stone::Brick, 512, 1);
    let roughness = images.add(stone.roughness);
    let dry = StandardMaterial {
        base_color_texture: Some(images.add(stone.albedo)),
        normal_map_texture: Some(images.add(stone.normal)),
        metallic_roughness_texture: Some(roughness),
        perceptual_roughness: 1.0,
        ..default()
    };
    let size = Vec2::new(5.0, 4.0);
    let wall_mesh = Mesh::from(Rectangle::from_size(size)).with_generated_tangents().unwrap();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(wall_mesh);
    let all = RenderLayers::from_layers(&(0..walls.len() + 1).collect::<Vec<_>>());
    world.entity_mut(stage.sun).insert(all);
    let eye = Transform::from_xyz(0.6, 0.3, 2.0).looking_at(Vec3::new(0.2, 0.0, 0.0), Vec3::Y);
    let camera = world.spawn(stage.camera(eye)).id();
    let mut entities = Vec::new();
    for (layer, wall) in walls.iter().enumerate() {
        entities.push(spawn_wall(&mut app, wall, layer, &mesh, &dry));
    }
    let weathered: Vec<_> = (0..walls.len()).filter(|&i| walls[i].porous.is_some()).collect();
    while !weathered.iter().all(|&i| app.world().get::<DryMaterial>(entities[i]).is_some()) {
        headless::frame(&mut app);
    }
    for (wall, &entity) in walls.iter().zip(&entities) {
        if wall.water_mm > 0.0 {
            wet(&mut app, entity, wall.water_mm);
        }
    }
    // Water that has just come is seen from its tick on.
    app.world_mut().run_schedule(WeatheringTick);
    // The last layer is empty.
    let mut seconds = vec![Vec::new(); walls.len() + 1];
    for round in 0..=ROUNDS {
        for (layer, seconds) in seconds.iter_mut().enumerate() {
            app.world_mut().entity_mut(camera).insert(RenderLayers::layer(layer));
            headless::frame(&mut app);
            let begun = Instant::now();
            for _ in 0..FRAMES {
                headless::frame(&mut app);
            }
            // The first round makes pipelines.
            if round > 0 {
                seconds.push(begun.elapsed().as_secs_f64() / f64::from(FRAMES));
            }
        }
    }
    let medians: Vec<_> = seconds
        .iter_mut()
        .map(|seconds| {
            seconds.sort_by(f64::total_cmp);
            seconds[seconds.len() / 2]
        })
        .collect();
    let (standard, empty) = (medians[0], medians[walls.len()]);
    println!("shading: empty frame {:.1} ms; median of {ROUNDS} rounds of {FRAMES} frames", empty * 1e3);
    println!("| | ms a frame | of the standard frame | without the empty frame |\n|---|---|---|---|");
    for (wall, &median) in walls.iter().zip(&medians) {
        let (whole, bare) = (median / standard, (median - empty) / (standard - empty));
        println!("| `{}` | {:.1} | {whole:.3} | {bare:.3} |", wall.name, median * 1e3);
    }
}
