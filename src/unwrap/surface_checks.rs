//! What holds for surfaces whose meshes are unwrapped.

use bevy::asset::{AssetPlugin, RenderAssetUsages};
use bevy::mesh::{MeshPlugin, PrimitiveTopology, VertexAttributeValues};

use super::*;
use crate::collision::{CollisionPlugin, MeshColliders, SurfaceCollider};
use crate::overlay::StampSpace;

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin, UnwrapPlugin));
    app
}

fn add(app: &mut App, mesh: impl Into<Mesh>) -> Handle<Mesh> {
    app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh.into())
}

fn surface(uv: OverlayUv) -> Weatherable {
    Weatherable { map_size: 64, uv, ..default() }
}

fn spawn(app: &mut App, mesh: &Handle<Mesh>, uv: OverlayUv) -> Entity {
    app.world_mut().spawn((surface(uv), Mesh3d(mesh.clone()))).id()
}

fn update_until_done(app: &mut App) {
    app.update();
    while app.world().resource::<Unwraps>().working() > 0 {
        app.update();
    }
    app.update();
}

fn shown(app: &App, entity: Entity) -> AssetId<Mesh> {
    app.world().get::<Mesh3d>(entity).unwrap().id()
}

fn source(app: &App, entity: Entity) -> Option<AssetId<Mesh>> {
    app.world().get::<UnwrappedFrom>(entity).map(|from| from.0.id())
}

fn mesh(app: &App, id: AssetId<Mesh>) -> &Mesh {
    app.world().resource::<Assets<Mesh>>().get(id).unwrap()
}

/// Upper end of a mesh.
fn top(mesh: &Mesh) -> f32 {
    let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).unwrap().as_float3().unwrap();
    positions.iter().fold(f32::MIN, |top, position| top.max(position[1]))
}

#[test]
fn instances_share_one_copy_and_others_keep_the_mesh() {
    let mut app = app();
    let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
    let [one, two] = [OverlayUv::Unique; 2].map(|uv| spawn(&mut app, &cube, uv));
    let plain = spawn(&mut app, &cube, OverlayUv::Mesh);
    app.update();
    assert_eq!(app.world().resource::<Unwraps>().working(), 1);
    assert!(app.world().get::<AwaitsUvs>(one).is_some() && shown(&app, one) == cube.id());
    update_until_done(&mut app);

    let copy = shown(&app, one);
    assert!(copy != cube.id() && shown(&app, two) == copy && shown(&app, plain) == cube.id());
    assert_eq!([one, two, plain].map(|entity| source(&app, entity).is_some()), [true, true, false]);
    assert_eq!(source(&app, one), Some(cube.id()));
    assert!([one, two].iter().all(|&entity| app.world().get::<AwaitsUvs>(entity).is_none()));
    assert!(mesh(&app, copy).contains_attribute(Mesh::ATTRIBUTE_UV_1));
    assert!(!mesh(&app, cube.id()).contains_attribute(Mesh::ATTRIBUTE_UV_1));
    let unwraps = app.world().resource::<Unwraps>();
    assert!(unwraps.is_unwrapped(copy) && !unwraps.is_unwrapped(cube.id()));

    // One that comes later takes it as well, whichever of the two meshes it is given.
    let late = spawn(&mut app, &cube, OverlayUv::Unique);
    let handed = app.world().get::<Mesh3d>(one).unwrap().0.clone();
    let later = spawn(&mut app, &handed, OverlayUv::Unique);
    update_until_done(&mut app);
    assert!([late, later].iter().all(|&entity| shown(&app, entity) == copy));
    assert!([late, later].iter().all(|&entity| source(&app, entity) == Some(cube.id())));
    assert_eq!(app.world().resource::<Assets<Mesh>>().len(), 2);
}

#[test]
fn each_size_of_map_has_a_copy_of_its_own() {
    let mut app = app();
    let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
    let [small, large] = [OverlayUv::Unique; 2].map(|uv| spawn(&mut app, &cube, uv));
    app.world_mut().get_mut::<Weatherable>(large).unwrap().map_size = 256;
    update_until_done(&mut app);
    assert_ne!(shown(&app, small), shown(&app, large));
    let of_small = shown(&app, small);
    app.world_mut().get_mut::<Weatherable>(large).unwrap().map_size = 64;
    update_until_done(&mut app);
    assert_eq!(shown(&app, large), of_small);
    assert_eq!(source(&app, large), Some(cube.id()));
}

#[test]
fn a_surface_that_shows_another_mesh_gets_a_copy_of_that() {
    let mut app = app();
    let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
    let tower = add(&mut app, Cuboid::new(1.0, 6.0, 1.0));
    let surface = spawn(&mut app, &cube, OverlayUv::Unique);
    update_until_done(&mut app);
    app.world_mut().entity_mut(surface).insert(Mesh3d(tower.clone()));
    app.update();
    assert!(app.world().get::<AwaitsUvs>(surface).is_some());
    update_until_done(&mut app);
    assert!(app.world().get::<AwaitsUvs>(surface).is_none());
    assert_eq!(source(&app, surface), Some(tower.id()));
    assert_eq!(top(mesh(&app, shown(&app, surface))), 3.0);
}

#[test]
fn a_mesh_that_changes_changes_its_copy_in_place() {
    let mut app = app();
    let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
    let surface = spawn(&mut app, &cube, OverlayUv::Unique);
    update_until_done(&mut app);
    let copy = shown(&app, surface);
    let mut meshes = app.world_mut().resource_mut::<Assets<Mesh>>();
    meshes.insert(cube.id(), Cuboid::new(1.0, 6.0, 1.0).into()).unwrap();
    // The message is sent at the end of a frame.
    app.update();
    update_until_done(&mut app);
    assert_eq!((shown(&app, surface), source(&app, surface)), (copy, Some(cube.id())));
    assert_eq!(top(mesh(&app, copy)), 3.0);
}

#[test]
fn what_cannot_be_unwrapped_keeps_its_mesh_until_it_can() {
    let mut app = app();
    let lines = Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[0.0f32; 3]; 2]);
    let lines = add(&mut app, lines);
    let surface = spawn(&mut app, &lines, OverlayUv::Unique);
    update_until_done(&mut app);
    let refused = NotUnwrapped(UnwrapError::Topology(PrimitiveTopology::LineList));
    assert_eq!(app.world().get::<NotUnwrapped>(surface), Some(&refused));
    assert!(app.world().get::<AwaitsUvs>(surface).is_none());
    assert_eq!((shown(&app, surface), source(&app, surface)), (lines.id(), None));

    let mut meshes = app.world_mut().resource_mut::<Assets<Mesh>>();
    meshes.insert(lines.id(), Cuboid::new(1.0, 1.0, 1.0).into()).unwrap();
    app.update();
    update_until_done(&mut app);
    assert!(app.world().get::<NotUnwrapped>(surface).is_none());
    assert_eq!(source(&app, surface), Some(lines.id()));

    // And back: the copy is of a mesh that is not there any more.
    let gone = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default());
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(lines.id(), gone).unwrap();
    app.update();
    update_until_done(&mut app);
    let refused = NotUnwrapped(UnwrapError::NoPositions);
    assert_eq!(app.world().get::<NotUnwrapped>(surface), Some(&refused));
    assert_eq!((shown(&app, surface), source(&app, surface)), (lines.id(), None));
}

#[test]
fn a_surface_that_asks_no_more_shows_its_own_mesh() {
    let mut app = app();
    let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
    let [turned, released] = [OverlayUv::Unique; 2].map(|uv| spawn(&mut app, &cube, uv));
    update_until_done(&mut app);
    assert_ne!(shown(&app, turned), cube.id());
    app.world_mut().get_mut::<Weatherable>(turned).unwrap().uv = OverlayUv::Mesh;
    app.world_mut().entity_mut(released).remove::<Weatherable>();
    app.update();
    for entity in [turned, released] {
        assert_eq!((shown(&app, entity), source(&app, entity)), (cube.id(), None));
    }
}

#[test]
fn copies_go_with_the_last_surface_that_shows_them() {
    let mut app = app();
    let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
    let surface = spawn(&mut app, &cube, OverlayUv::Unique);
    drop(cube);
    update_until_done(&mut app);
    assert_eq!(app.world().resource::<Assets<Mesh>>().len(), 2);
    app.world_mut().despawn(surface);
    for _ in 0..4 {
        app.update();
    }
    let unwraps = app.world().resource::<Unwraps>();
    assert!(unwraps.jobs.is_empty() && unwraps.made.is_empty());
    assert!(app.world().resource::<Assets<Mesh>>().is_empty());
}

#[test]
fn a_surface_that_waits_is_not_hit() {
    let mut app = app();
    app.add_plugins((crate::clock::ClockPlugin::default(), crate::effect::EffectPlugin))
        .add_plugins((crate::particle::ParticlePlugin, CollisionPlugin));
    let cube = add(&mut app, Cuboid::new(1.0, 1.0, 1.0));
    let [surface, other] = [OverlayUv::Mesh; 2].map(|uv| spawn(&mut app, &cube, uv));
    let hit = |app: &App, entity| app.world().get::<SurfaceCollider>(entity).is_some();
    while !hit(&app, surface) {
        app.update();
    }
    // The collider of its old mesh is there, and another surface goes on using it.
    app.world_mut().get_mut::<Weatherable>(surface).unwrap().uv = OverlayUv::Unique;
    while source(&app, surface).is_none() {
        app.update();
        assert!(hit(&app, other));
        let waits = app.world().get::<AwaitsUvs>(surface).is_some();
        assert!(!waits || !hit(&app, surface));
    }
    while !hit(&app, surface) {
        app.update();
    }
    let bvh = |entity| app.world().get::<SurfaceCollider>(entity).unwrap().0.clone();
    let built = app.world().resource::<MeshColliders>().get(shown(&app, surface), UvSet::Second).unwrap();
    assert!(std::sync::Arc::ptr_eq(&bvh(surface), built));
    assert!(!std::sync::Arc::ptr_eq(&bvh(surface), &bvh(other)));
}

/// A plane with two sets of uvs, so many times as wide as the map.
fn plane(first: f32, second: Option<f32>) -> Mesh {
    let plane = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
    let uvs = plane.attribute(Mesh::ATTRIBUTE_UV_0).unwrap().clone();
    let VertexAttributeValues::Float32x2(uvs) = uvs else { unreachable!("planes have uvs") };
    let times = |by: f32| uvs.iter().map(|uv| uv.map(|part| part * by)).collect::<Vec<[f32; 2]>>();
    let plane = plane.with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, times(first));
    match second {
        Some(by) => plane.with_inserted_attribute(Mesh::ATTRIBUTE_UV_1, times(by)),
        None => plane,
    }
}

fn uvs(app: &App, entity: Entity) -> UvSet {
    app.world().get::<UvSet>(entity).copied().unwrap_or_default()
}

#[test]
fn without_being_asked_only_what_is_not_unique_is_unwrapped() {
    let mut app = app();
    let one = |app: &mut App, mesh: Mesh| {
        let mesh = add(app, mesh);
        (spawn(app, &mesh, OverlayUv::Auto), mesh)
    };
    let (whole, whole_mesh) = one(&mut app, plane(1.0, None));
    let (tiled, tiled_mesh) = one(&mut app, plane(5.0, None));
    let (lightmapped, lightmapped_mesh) = one(&mut app, plane(5.0, Some(0.5)));
    let (taken, taken_mesh) = one(&mut app, plane(5.0, Some(2.0)));
    // Tiles are what these stamps are for.
    let (on_map, on_map_mesh) = one(&mut app, plane(5.0, None));
    app.world_mut().get_mut::<Weatherable>(on_map).unwrap().stamps = StampSpace::Map;
    update_until_done(&mut app);

    for (entity, mesh, set) in [
        (whole, &whole_mesh, UvSet::First),
        (lightmapped, &lightmapped_mesh, UvSet::Second),
        (taken, &taken_mesh, UvSet::First),
        (on_map, &on_map_mesh, UvSet::First),
    ] {
        assert_eq!((shown(&app, entity), source(&app, entity)), (mesh.id(), None));
        assert_eq!(uvs(&app, entity), set);
    }
    assert_eq!((source(&app, tiled), uvs(&app, tiled)), (Some(tiled_mesh.id()), UvSet::Second));
    assert!(app.world().get::<AwaitsUvs>(tiled).is_none());
    let refused = |entity| app.world().get::<NotUnwrapped>(entity).cloned();
    assert_eq!(refused(taken), Some(NotUnwrapped(UnwrapError::SecondUvsTaken)));
    assert!([whole, tiled, lightmapped, on_map].iter().all(|&entity| refused(entity).is_none()));
}

#[test]
fn second_uvs_that_are_not_unique_are_replaced_on_demand() {
    let mut app = app();
    let taken = add(&mut app, plane(5.0, Some(2.0)));
    let surface = spawn(&mut app, &taken, OverlayUv::Unique);
    update_until_done(&mut app);
    assert_eq!((source(&app, surface), uvs(&app, surface)), (Some(taken.id()), UvSet::Second));
    assert!(app.world().get::<NotUnwrapped>(surface).is_none());
}

#[test]
fn a_mesh_that_is_known_to_be_unique_is_not_waited_for_again() {
    let mut app = app();
    let whole = add(&mut app, plane(1.0, None));
    let surface = spawn(&mut app, &whole, OverlayUv::Auto);
    update_until_done(&mut app);
    app.world_mut().get_mut::<Weatherable>(surface).unwrap().map_size = 128;
    let instance = spawn(&mut app, &whole, OverlayUv::Unique);
    app.update();
    assert_eq!(app.world().resource::<Unwraps>().working(), 0);
    assert!([surface, instance].iter().all(|&entity| app.world().get::<AwaitsUvs>(entity).is_none()));
}

#[test]
fn a_mesh_that_becomes_unique_is_shown_itself_again() {
    let mut app = app();
    let handle = add(&mut app, plane(5.0, None));
    let surface = spawn(&mut app, &handle, OverlayUv::Auto);
    update_until_done(&mut app);
    assert_ne!(shown(&app, surface), handle.id());
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(handle.id(), plane(1.0, None)).unwrap();
    app.update();
    update_until_done(&mut app);
    assert_eq!((shown(&app, surface), source(&app, surface)), (handle.id(), None));
    assert_eq!(uvs(&app, surface), UvSet::First);
}
