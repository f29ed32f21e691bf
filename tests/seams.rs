//! Marks go on over the borders of uv islands: along all seams of the bunny, both sides show the same.

use std::collections::BTreeMap;

use bevy::asset::RenderAssetUsages;
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use bevy_weathering::collision::MeshTriangles;
use bevy_weathering::effect::{Paint, StampSource};
use bevy_weathering::overlay::{CpuMaps, StampSpace, SurfaceFrames};
use bevy_weathering::prelude::*;
use bevy_weathering::scenes::gltf_mesh::read_first_primitive;
use bevy_weathering::stamps::StampKind;

use crate::wetting::scene::Scene;

const SIZE: u32 = 512;

fn bunny() -> MeshTriangles {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/bunny.glb");
    read_first_primitive(&file).unwrap()
}

fn mesh_of(triangles: &MeshTriangles) -> Mesh {
    let positions: Vec<[f32; 3]> = triangles.positions.iter().flatten().map(|at| at.to_array()).collect();
    let uvs: Vec<[f32; 2]> = triangles.uvs.iter().flatten().map(|uv| uv.to_array()).collect();
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs)
}

/// The bunny's diffuse map after mud has been thrown at it from all sides.
fn muddy(stamps: StampSpace, kind: StampSource) -> CpuMaps {
    let mut scene = Scene::new(60);
    let world = scene.0.world_mut();
    let effect = WeatherEffect {
        stamps: kind,
        stamp_radius: Some(0.05),
        gravity_scale: 0.0,
        terminal_speed: Some(0.0),
        diffuse: Paint { color: [0.2, 0.5, 0.9], opacity: 1.0 },
        ..default()
    };
    let effect = world.resource_mut::<Assets<WeatherEffect>>().add(effect.with_stamps().unwrap());
    for (stream, from) in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::Z, Vec3::NEG_Z].into_iter().enumerate() {
        let place = Transform::from_translation(Vec3::Y * 0.45 + from * 2.0);
        let up = if from.y == 0.0 { Vec3::Y } else { Vec3::X };
        let emitter = Emitter {
            effect: effect.clone(),
            rate: 60.0,
            shape: EmitterShape::Disc { radius: 0.5 },
            speed: 10.0,
            stream: stream as u32,
            ..default()
        };
        world.spawn((emitter, place.looking_at(Vec3::Y * 0.45, up)));
    }
    let surface = scene.surface(mesh_of(&bunny()), SIZE, PorousMaterial::default(), Transform::default());
    scene.0.world_mut().get_mut::<Weatherable>(surface).unwrap().stamps = stamps;
    // The effect is asked for in the first tick; then the frames are measured.
    scene.run(1);
    while stamps == StampSpace::Surface && scene.0.world().get::<SurfaceFrames>(surface).is_none() {
        scene.0.update();
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    scene.run(240);
    scene.0.world().get::<CpuMaps>(surface).unwrap().clone()
}

/// Coverage at a uv, between texels; 0..=255.
fn coverage(maps: &CpuMaps, uv: Vec2) -> f32 {
    let at = uv * SIZE as f32 - 0.5;
    let (corner, part) = (at.floor().as_ivec2(), at - at.floor());
    let texel = |x: i32, y: i32| {
        let inside = |along: i32| along.clamp(0, SIZE as i32 - 1) as usize;
        f32::from(maps.diffuse[inside(corner.y + y) * SIZE as usize + inside(corner.x + x)][3])
    };
    let row = |y: i32| texel(0, y) + (texel(1, y) - texel(0, y)) * part.x;
    row(0) + (row(1) - row(0)) * part.y
}

/// Edges that two triangles share in space, and not on the map: the uvs of their ends, as each of both has them.
fn seams(triangles: &MeshTriangles) -> Vec<[[Vec2; 2]; 2]> {
    let mut edges: BTreeMap<[[u32; 3]; 2], Vec<[Vec2; 2]>> = BTreeMap::new();
    for (corners, uvs) in triangles.positions.iter().zip(&triangles.uvs) {
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            let bits = |corner: usize| (corners[corner] + Vec3::ZERO).to_array().map(f32::to_bits);
            let (mut ends, mut on_map) = ([bits(from), bits(to)], [uvs[from], uvs[to]]);
            if ends[0] > ends[1] {
                ends.reverse();
                on_map.reverse();
            }
            edges.entry(ends).or_default().push(on_map);
        }
    }
    edges.into_values().filter_map(|sides| <[_; 2]>::try_from(sides).ok()).filter(|[a, b]| a != b).collect()
}

/// Mean difference of coverage over all seams, and the part of their points with a difference that can be seen.
fn across_seams(maps: &CpuMaps) -> (f32, f32, usize) {
    let triangles = bunny();
    let (mut sum, mut seen, mut count, mut covered) = (0.0, 0, 0, 0);
    for sides in seams(&triangles) {
        for step in 0..8 {
            let part = (step as f32 + 0.5) / 8.0;
            let [a, b] = sides.map(|[from, to]| coverage(maps, from.lerp(to, part)));
            sum += (a - b).abs();
            seen += usize::from((a - b).abs() > 64.0);
            covered += usize::from(a.max(b) > 32.0);
            count += 1;
        }
    }
    (sum / count as f32, seen as f32 / count as f32, covered)
}

#[test]
fn the_bunny_shows_no_seam() {
    // Fingers of a splat are as wide as the texels, of 3 mm, and have sharp rims.
    for (kind, most, most_seen) in
        [(StampSource::Dome, 5.0, 0.02), (StampSource::Kind(StampKind::Splat), 14.0, 0.04)]
    {
        let (mean, seen, covered) = across_seams(&muddy(StampSpace::Surface, kind.clone()));
        println!("{kind:?} in space: mean {mean}, seen {seen}, {covered} points covered");
        assert!(covered > 500, "{covered}");
        assert!(mean < most && seen < most_seen, "{kind:?}: mean {mean}, seen {seen}");
        // On the map a stamp ends at every border.
        let (mean_on_map, seen_on_map, _) = across_seams(&muddy(StampSpace::Map, kind.clone()));
        println!("{kind:?} on the map: mean {mean_on_map}, seen {seen_on_map}");
        assert!(mean_on_map > 4.0 * mean && seen_on_map > 0.1, "{mean_on_map} {seen_on_map}");
    }
}
