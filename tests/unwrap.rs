//! Meshes whose texture coordinates lie on each other: what falls on one place wets that place alone.

use std::fs;
use std::path::Path;
use std::process::Command;

use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;
use bevy_weathering::collision::{MeshTriangles, UvSet};
use bevy_weathering::prelude::*;
use bevy_weathering::unwrap::{UnwrappedFrom, measure_overlap};
use bevy_weathering::wetting::SurfaceWater;

use crate::wetting::scene::Scene;

const SIZE: u32 = 128;
/// Empty texels around every island, and to the edges.
const GUTTER: i32 = 2;

/// Every face over the whole map.
fn cube() -> Mesh {
    Cuboid::new(1.0, 1.0, 1.0).into()
}

/// Two metres of floor whose uvs tile four times along each side.
fn tiled_plane() -> Mesh {
    let plane = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
    let uvs = first_uvs(&plane).into_iter().map(|uv| uv.map(|part| part * 4.0)).collect::<Vec<_>>();
    plane.with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs)
}

fn first_uvs(mesh: &Mesh) -> Vec<[f32; 2]> {
    match mesh.attribute(Mesh::ATTRIBUTE_UV_0) {
        Some(VertexAttributeValues::Float32x2(uvs)) => uvs.clone(),
        other => panic!("{other:?}"),
    }
}

/// A surface on which nothing runs, in a world of its own, when its texels are measured; and its mesh.
fn surface(mesh: &Mesh, uv: OverlayUv) -> (Scene, Entity, Handle<Mesh>) {
    let mut scene = Scene::new(60);
    let world = scene.0.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh.clone());
    let maps = Weatherable { map_size: SIZE, uv, ..default() };
    let matter = PorousMaterial { capacity_mm: 0.0, retained_mm: 1000.0, ..default() };
    let surface = world.spawn((maps, matter, Mesh3d(mesh.clone()), Transform::default())).id();
    scene.wait_for::<SurfaceWater>(surface);
    (scene, surface, mesh)
}

/// The mesh that a surface shows.
fn shown(scene: &Scene, surface: Entity) -> Mesh {
    let shown = scene.0.world().get::<Mesh3d>(surface).unwrap();
    scene.0.world().resource::<Assets<Mesh>>().get(shown).unwrap().clone()
}

/// The triangles of that, with the uvs that its maps lie over.
fn triangles(scene: &Scene, surface: Entity) -> MeshTriangles {
    let set = scene.0.world().get::<UvSet>(surface).copied().unwrap_or_default();
    MeshTriangles::with_uvs(&shown(scene, surface), set).unwrap()
}

/// Where a point of a mesh lies on its map.
fn uv_at(triangles: &MeshTriangles, point: Vec3) -> Vec2 {
    let weights = |[a, b, c]: [Vec3; 3]| {
        let normal = (b - a).cross(c - a);
        let part =
            |from: Vec3, to: Vec3| (to - from).cross(point - from).dot(normal) / normal.length_squared();
        let weights = [part(b, c), part(c, a), part(a, b)];
        let off = (point - a).dot(normal.normalize()).abs();
        (off < 1e-4 && weights.iter().all(|&weight| weight > -1e-4)).then_some(weights)
    };
    let mut all = triangles.positions.iter().zip(&triangles.uvs);
    let (weights, uvs) = all.find_map(|(&corners, uvs)| Some((weights(corners)?, uvs))).unwrap();
    uvs.iter().zip(weights).map(|(&uv, weight)| uv * weight).sum()
}

/// The deepest film within a square of so many metres around a point of a face.
fn film_around(scene: &mut Scene, surface: Entity, middle: Vec3, normal: Vec3, width: f32) -> f32 {
    let triangles = triangles(scene, surface);
    let (right, up) = normal.any_orthonormal_pair();
    let mut deepest = 0.0f32;
    for step in 0..121 {
        let [x, y] = [step % 11, step / 11].map(|along| (along as f32 / 10.0 - 0.5) * width);
        let uv = uv_at(&triangles, middle + right * x + up * y);
        deepest = deepest.max(scene.at(surface, uv).film_mm);
    }
    deepest
}

/// Drops fall for some seconds, straight down, within so many metres of the middle of a place.
fn drip(scene: &mut Scene, middle: Vec3, within: f32) {
    let shape = EmitterShape::Sky { half_size: Vec2::splat(within) };
    let emitter = Emitter { rate: 60.0, shape, speed: 4.0, lifetime: 2.0, ..default() };
    let tap = scene.emit(emitter, 50.0, 0.02, middle + Vec3::Y * 0.5);
    // In the first tick it asks for its effect.
    scene.run(1);
    scene.run(120);
    scene.0.world_mut().despawn(tap);
    scene.run(60);
}

const FACES: [Vec3; 6] = [Vec3::Y, Vec3::NEG_Y, Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z];

fn films_on_the_faces_of_a_cube(uv: OverlayUv) -> [f32; 6] {
    let (mut scene, cube, _) = surface(&cube(), uv);
    drip(&mut scene, Vec3::Y * 0.5, 0.1);
    // Not to the edges: what splashes there may run round them.
    FACES.map(|face| film_around(&mut scene, cube, face * 0.5, face, 0.8))
}

#[test]
fn a_drop_on_one_face_of_a_cube_wets_that_face_alone() {
    for uv in [OverlayUv::Auto, OverlayUv::Unique] {
        let [top, others @ ..] = films_on_the_faces_of_a_cube(uv);
        assert!(top > 0.001, "{uv:?}: {top}");
        assert_eq!(others, [0.0; 5], "{uv:?}");
    }
    // With the uvs of the mesh it lies on all of them.
    let shared = films_on_the_faces_of_a_cube(OverlayUv::Mesh);
    assert!(shared.iter().all(|&film| film > 0.001), "{shared:?}");
}

#[test]
fn a_drop_on_a_tiled_floor_wets_one_tile() {
    // The middles of all tiles.
    let tiles: Vec<Vec3> = (0..16)
        .map(|tile| Vec3::new((tile % 4) as f32, 0.0, (tile / 4) as f32) * 0.5 - 0.75 * (Vec3::X + Vec3::Z))
        .collect();
    let films = |uv| {
        let (mut scene, floor, _) = surface(&tiled_plane(), uv);
        drip(&mut scene, tiles[5], 0.05);
        let film = |&tile: &Vec3| film_around(&mut scene, floor, tile, Vec3::Y, 0.1);
        tiles.iter().map(film).collect::<Vec<_>>()
    };
    let unique = films(OverlayUv::Auto);
    assert!(unique[5] > 0.001, "{unique:?}");
    // What splashes may come down next to it, but not everywhere.
    let far = [3, 7, 11, 12, 13, 14, 15];
    assert!(far.iter().all(|&tile| unique[tile] == 0.0), "{unique:?}");
    let shared = films(OverlayUv::Mesh);
    assert!(shared.iter().all(|&film| film > 0.001), "{shared:?}");
}

/// A number for each triangle, the same for those that vertices join.
fn islands(mesh: &Mesh) -> Vec<usize> {
    let corners: Vec<usize> = mesh.indices().unwrap().iter().collect();
    let mut islands: Vec<usize> = (0..mesh.count_vertices()).collect();
    // Each round carries the lowest number one triangle on.
    for _ in 0..corners.len() {
        for triangle in corners.chunks_exact(3) {
            let lowest = triangle.iter().map(|&corner| islands[corner]).min().unwrap();
            triangle.iter().for_each(|&corner| islands[corner] = lowest);
        }
    }
    corners.chunks_exact(3).map(|triangle| islands[triangle[0]]).collect()
}

/// Whose texels are whose: the islands of the triangles that cover their middles.
fn owners(triangles: &MeshTriangles, islands: &[usize]) -> Vec<Option<usize>> {
    let mut owners = vec![None; (SIZE * SIZE) as usize];
    for (uvs, &island) in triangles.uvs.iter().zip(islands) {
        let [a, b, c] = uvs.map(|uv| uv * SIZE as f32);
        for (index, owner) in owners.iter_mut().enumerate() {
            let middle = Vec2::new((index as u32 % SIZE) as f32, (index as u32 / SIZE) as f32) + 0.5;
            let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(middle - from));
            if sides.iter().all(|&side| side >= 0.0) || sides.iter().all(|&side| side <= 0.0) {
                *owner = Some(island);
            }
        }
    }
    owners
}

/// Whether all islands have their gutters.
fn have_gutters(owners: &[Option<usize>]) -> bool {
    let side = SIZE as i32;
    (0..side * side).all(|index| {
        let Some(own) = owners[index as usize] else { return true };
        let (x, y) = (index % side, index / side);
        let edge = x.min(y).min(side - 1 - x).min(side - 1 - y);
        let near = |along: i32| along - 2 * GUTTER..=along + 2 * GUTTER;
        let alone = near(y).all(|y| {
            near(x).all(|x| {
                let inside = (0..side).contains(&x) && (0..side).contains(&y);
                !inside || owners[(y * side + x) as usize].is_none_or(|other| other == own)
            })
        });
        edge >= GUTTER && alone
    })
}

#[test]
fn the_second_uvs_are_unique_and_have_gutters_and_the_first_stay() {
    for (name, mesh) in [("cube", cube()), ("plane", tiled_plane())] {
        let (scene, surface, original) = surface(&mesh, OverlayUv::Auto);
        let world = scene.0.world();
        assert_eq!(world.get::<UvSet>(surface), Some(&UvSet::Second), "{name}");
        assert_eq!(world.get::<UnwrappedFrom>(surface), Some(&UnwrappedFrom(original.clone())), "{name}");
        assert_eq!(world.resource::<Assets<Mesh>>().get(&original), Some(&mesh), "{name}");

        let shown = shown(&scene, surface);
        let by_corner = |mesh: &Mesh| first_uvs(&mesh.clone().with_duplicated_vertices());
        assert_eq!(by_corner(&shown), by_corner(&mesh), "{name}");

        let triangles = MeshTriangles::with_uvs(&shown, UvSet::Second).unwrap();
        let inside = |uv: &Vec2| uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all();
        assert!(triangles.uvs.iter().flatten().all(inside), "{name}");
        let overlap = measure_overlap(&triangles, 8 * SIZE);
        assert!(!overlap.outside && overlap.overlapping < 1e-4, "{name}: {overlap:?}");

        let islands = islands(&shown);
        let owners = owners(&triangles, &islands);
        assert!(owners.iter().flatten().count() > (SIZE * SIZE) as usize / 4, "{name}");
        assert!(have_gutters(&owners), "{name}");
    }
}

#[test]
fn what_is_unique_already_keeps_its_mesh() {
    let plane = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
    for uv in [OverlayUv::Auto, OverlayUv::Unique, OverlayUv::Mesh] {
        let (scene, surface, original) = surface(&plane, uv);
        let world = scene.0.world();
        assert_eq!(world.get::<Mesh3d>(surface).map(|shown| shown.id()), Some(original.id()), "{uv:?}");
        assert!(world.get::<UnwrappedFrom>(surface).is_none(), "{uv:?}");
        assert_eq!(world.resource::<Assets<Mesh>>().get(&original), Some(&plane), "{uv:?}");
    }
}

/// A glTF of triangles that touch nowhere and share their uvs, beside its numbers.
fn write_crowd(folder: &Path, triangles: usize) {
    let mut floats: Vec<f32> = Vec::new();
    for number in 0..triangles {
        let at = number as f32 * 2.0;
        floats.extend([at, 0.0, 0.0, at + 1.0, 0.0, 0.0, at, 0.0, -1.0]);
    }
    (0..triangles).for_each(|_| floats.extend([0.0, 0.0, 1.0, 0.0, 0.0, 1.0]));
    let bytes: Vec<u8> = floats.into_iter().flat_map(f32::to_le_bytes).collect();
    let (count, split) = (triangles * 3, triangles * 36);
    let gltf = serde_json::json!({
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "crowd.bin", "byteLength": bytes.len()}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": split},
            {"buffer": 0, "byteOffset": split, "byteLength": bytes.len() - split},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3",
                "min": [0.0, 0.0, -1.0], "max": [(triangles * 2 - 1) as f32, 0.0, 0.0]},
            {"bufferView": 1, "componentType": 5126, "count": count, "type": "VEC2"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}}]}],
    });
    fs::write(folder.join("crowd.bin"), bytes).unwrap();
    fs::write(folder.join("crowd.gltf"), gltf.to_string()).unwrap();
}

/// A run of the program on a crowd with some maps: its exit code and what it says.
fn replay(folder: &Path, maps: &str) -> (Option<i32>, String) {
    let scenario = format!(
        r#"(
            seconds: 0.1,
            camera: (keys: [(eye: (0.0, 1.5, 3.0), target: (0.0, 0.0, 0.0))]),
            materials: {{"clay": ()}},
            surfaces: [(name: "crowd", mesh: File("crowd.gltf"), material: "clay", maps: {maps})],
        )"#
    );
    fs::write(folder.join("scene.ron"), scenario).unwrap();
    let mut program = Command::new(env!("CARGO_BIN_EXE_weathering"));
    let output = program.args(["replay", "--no-render"]).arg(folder.join("scene.ron")).output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn a_scenario_says_which_surface_cannot_be_unwrapped() {
    let folder = tempfile::tempdir().unwrap();
    write_crowd(folder.path(), 400);
    let (code, message) = replay(folder.path(), "(map_size: 16, uv: Unique)");
    assert_eq!(code, Some(2), "{message}");
    for part in ["scene.ron", "surfaces[0].maps.uv", "crowd.gltf", "400 charts", "map_size"] {
        assert!(message.contains(part), "{part}: {message}");
    }
    // Without being asked it goes on with what there is, and on a larger map it can be done.
    for maps in ["(map_size: 16)", "(map_size: 256, uv: Unique)"] {
        let (code, message) = replay(folder.path(), maps);
        assert_eq!(code, Some(0), "{maps}: {message}");
    }
    let (code, message) = replay(folder.path(), "(map_size: 16, uv: Always)");
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("scene.ron") && message.contains("Always"), "{message}");
}
