//! The present state of running apps, as scenes.

use bevy::asset::RenderAssetUsages;
use bevy::image::{ImageAddressMode, ImageSampler, ImageSamplerDescriptor};
use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_weathering::export::{Export, ExportError, Snapshot, SurfaceColors};
use bevy_weathering::prelude::*;
use bevy_weathering::wetting::SurfaceWater;

use super::bake::{mean, primitive, texels, wet_material};
use super::rules::{Glb, count};
use crate::posed::{glazed, hanging, plank, posed, skin};
use crate::wetting::scene::Scene;

/// Bricks, 8 by 8 texels.
fn bricks() -> Image {
    let texel =
        |number: usize| if number.is_multiple_of(3) { [90, 50, 40, 255] } else { [200, 120, 100, 255] };
    let size = Extent3d { width: 8, height: 8, depth_or_array_layers: 1 };
    let texels = (0..64).flat_map(texel).collect();
    let format = TextureFormat::Rgba8UnormSrgb;
    let mut image = Image::new(size, TextureDimension::D2, texels, format, RenderAssetUsages::default());
    // Bevy's own sampler repeats the edge.
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: ImageAddressMode::Repeat,
        address_mode_v: ImageAddressMode::Repeat,
        ..ImageSamplerDescriptor::linear()
    });
    image
}

fn scene() -> Scene {
    let mut scene = Scene::new(60);
    scene.0.init_asset::<Image>().init_asset::<StandardMaterial>();
    scene
}

fn add<A: Asset>(scene: &mut Scene, asset: A) -> Handle<A> {
    scene.0.world_mut().resource_mut::<Assets<A>>().add(asset)
}

/// Two by two metres that face up, their uvs in so many tiles.
fn ground(tiles: f32) -> Mesh {
    let mut mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
    if let Some(VertexAttributeValues::Float32x2(uvs)) = mesh.attribute_mut(Mesh::ATTRIBUTE_UV_0) {
        uvs.iter_mut().for_each(|uv| *uv = uv.map(|part| part * tiles));
    }
    mesh
}

fn porous() -> PorousMaterial {
    // What is poured stays where it is.
    PorousMaterial { t_fill: 0.0, retained_mm: 1000.0, ..default() }
}

/// A surface of a name and with a material of its own.
fn surface(scene: &mut Scene, name: &'static str, mesh: Mesh, look: StandardMaterial) -> Entity {
    let entity = scene.surface(mesh, 64, porous(), Transform::default());
    let look = add(scene, look);
    scene.0.world_mut().entity_mut(entity).insert((Name::new(name), MeshMaterial3d(look)));
    entity
}

fn take(scene: &mut Scene) -> Result<Snapshot, ExportError> {
    Snapshot::take(scene.0.world_mut(), "room", &SurfaceColors::default())
}

fn exported(scene: &mut Scene) -> Export {
    take(scene).unwrap().bake(Some(64)).unwrap()
}

#[test]
fn a_world_without_the_plugins_is_an_error() {
    let mut world = World::new();
    world.spawn((Weatherable::default(), Mesh3d::default(), GlobalTransform::default()));
    let error = Snapshot::take(&mut world, "room", &SurfaceColors::default()).unwrap_err();
    assert!(matches!(error, ExportError::NoSurface { .. }), "{error}");
}

#[test]
fn what_an_app_shows_is_a_scene_with_its_water() {
    let mut scene = scene();
    let texture = add(&mut scene, bricks());
    let look = StandardMaterial {
        base_color_texture: Some(texture),
        uv_transform: bevy::math::Affine2::from_scale(Vec2::splat(4.0)),
        perceptual_roughness: 0.9,
        ..default()
    };
    let floor = surface(&mut scene, "floor", ground(1.0), look.clone());
    // Another of the same mesh, above it, in a frame that no node has.
    let mesh = scene.0.world().get::<Mesh3d>(floor).unwrap().clone();
    let stretched = Transform::from_xyz(0.0, 3.0, 0.0).with_scale(Vec3::new(1.0, 4.0, 1.0));
    let parent = scene.0.world_mut().spawn((stretched, GlobalTransform::default())).id();
    let maps = *scene.0.world().get::<Weatherable>(floor).unwrap();
    let tilted = Transform::from_rotation(Quat::from_rotation_z(0.6));
    let shelf =
        scene.0.world_mut().spawn((Name::new("shelf"), maps, porous(), mesh, tilted, ChildOf(parent))).id();
    scene.wait_for::<SurfaceWater>(shelf);
    // Uvs that tile: the app has given it others.
    let wall = surface(&mut scene, "wall", ground(3.0), look);
    scene.pour(floor, Vec2::splat(0.25), 12, 400_000_000);
    scene.pour(wall, Vec2::splat(0.5), 12, 400_000_000);
    scene.run(120);

    let export = exported(&mut scene);
    super::keep("app", &export.glb, &export.glb);
    let glb = Glb::parse(&export.glb);
    glb.check();
    let document = gltf::Gltf::from_slice(&export.glb).unwrap();
    let node = |name: &str| document.nodes().position(|node| node.name() == Some(name)).expect("a node");

    // Wet where it is wet; the bricks are the same in both places.
    let of_floor = node("floor");
    let color = texels(&glb, &wet_material(&glb, of_floor)["pbrMetallicRoughness"]["baseColorTexture"]);
    let patch = |at: u32| mean(&image::imageops::crop_imm(&color, at, at, 8, 8).to_image(), 0);
    assert!(patch(16) < 0.9 * patch(48), "{} {}", patch(16), patch(48));
    // The bricks tile four times over the floor, as its material says, and eight texels of them lie on sixteen.
    let mappings = &primitive(&glb, of_floor)["extensions"]["KHR_materials_variants"]["mappings"];
    let dry = &glb.list("materials")[count(&mappings[0]["material"])];
    let transform = &dry["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"];
    assert_eq!(transform["scale"], serde_json::json!([4.0, 4.0]));
    assert!(color[(48, 48)] != color[(50, 48)] || color[(50, 48)] != color[(52, 48)], "no bricks");

    // The shelf stands as it is sheared.
    let world_from_shelf = *scene.0.world().get::<GlobalTransform>(shelf).unwrap();
    let corners = glb.floats(count(&primitive(&glb, node("shelf"))["attributes"]["POSITION"]));
    let expected = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
        .map(|[x, z]| world_from_shelf.transform_point(Vec3::new(x, 0.0, z)));
    for corner in &corners {
        let corner = Vec3::from_slice(corner);
        assert!(expected.iter().any(|at| at.abs_diff_eq(corner, 1e-4)), "{corner} of {expected:?}");
    }

    let mut rows = export.report.surfaces.clone();
    rows.sort_by(|a, b| a.name.cmp(&b.name));
    let found: Vec<_> = rows.iter().map(|row| (row.name.as_str(), row.tex_coord, row.map_size)).collect();
    assert_eq!(found, [("floor", 0, 64), ("shelf", 0, 64), ("wall", 1, 64)]);
    assert!(rows[0].absorbed_mm3 + rows[0].film_mm3 > 100_000.0 && rows[1].wet_fraction == 0.0, "{rows:?}");
    assert_eq!((export.report.ticks, export.report.scene.as_str()), (120, "room"));
    // The same moment is the same scene.
    assert!(exported(&mut scene).glb == export.glb);
}

#[test]
fn what_joints_pose_stands_in_its_pose() {
    let mut scene = scene();
    let surface = scene.surface(plank(), 64, glazed(), Transform::from_xyz(7.0, 3.0, -4.0));
    let pose = hanging(Vec3::new(0.0, 1.0, 0.5));
    skin(&mut scene, surface, pose);
    scene.run(2);
    let export = exported(&mut scene);
    let glb = Glb::parse(&export.glb);
    glb.check();
    assert!(glb.list("skins").is_empty());
    let attributes = &primitive(&glb, 0)["attributes"];
    let read = |name: &str| glb.floats(count(&attributes[name]));
    for (position, uv) in read("POSITION").into_iter().zip(read("TEXCOORD_0")) {
        let expected = posed(Vec2::from_slice(&uv), pose);
        assert!(Vec3::from_slice(&position).abs_diff_eq(expected, 1e-4), "{position:?} {expected}");
    }
    let node = &glb.list("nodes")[0];
    assert_eq!(node["translation"], serde_json::json!([0.0, 0.0, 0.0]));
}

#[test]
fn what_cannot_be_exported_is_named() {
    let named = |result: Result<Export, ExportError>, words: [&str; 2]| {
        let Err(error) = result else { panic!("{words:?} was exported") };
        let error = error.to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{words:?}: {error}");
    };
    let mut scene = scene();
    assert!(matches!(take(&mut scene), Err(ExportError::NoSurface { .. })));

    let mut gpu_only = bricks();
    gpu_only.data = None;
    let texture = add(&mut scene, gpu_only);
    let look = StandardMaterial { base_color_texture: Some(texture), ..default() };
    let floor = surface(&mut scene, "floor", ground(1.0), look);
    named(take(&mut scene).and_then(|taken| taken.bake(None)), ["`floor`", "MAIN_WORLD"]);
    scene.0.world_mut().despawn(floor);

    let mesh = add(&mut scene, ground(3.0));
    let maps = Weatherable { map_size: 64, uv: OverlayUv::Mesh, ..default() };
    let tiled = (Name::new("tiled"), maps, porous(), Mesh3d(mesh), Transform::default());
    let tiled = scene.0.world_mut().spawn(tiled).id();
    scene.wait_for::<SurfaceWater>(tiled);
    named(take(&mut scene).and_then(|taken| taken.bake(None)), ["`tiled`", "repeat"]);
    named(take(&mut scene).and_then(|taken| taken.bake(Some(3))), ["`texture-size`", "3"]);
    scene.0.world_mut().entity_mut(tiled).insert(GlobalTransform::from_xyz(f32::NAN, 0.0, 0.0));
    named(take(&mut scene).and_then(|taken| taken.bake(None)), ["`tiled`", "not finite"]);
}
