//! Where weathered surfaces can be: under every kind of light and camera, on meshes that bend.
//!
//! In each place, matter without pores that got water is lit by our own loop and must look as Bevy's `StandardMaterial`
//! does; porous matter that got as much must not.

use bevy::anti_alias::taa::TemporalAntiAliasing;
use bevy::asset::RenderAssetUsages;
use bevy::camera::RenderTarget;
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass, NormalPrepass};
use bevy::light::{EnvironmentMapLight, IrradianceVolume, LightProbe};
use bevy::material::OpaqueRendererMethod;
use bevy::mesh::morph::{MeshMorphWeights, MorphAttributes};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{Mesh, VertexAttributeValues};
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::material::{DryMaterial, Pores, PorousMaterial, WettingModel};
use bevy_weathering::overlay::{Overlays, Weatherable, Wrap};
use image::RgbImage;

use super::app::{app, cover, picture, still, update, update_until};
use super::images::{difference, keep, stage};

const SIZE: UVec2 = UVec2::new(80, 60);

/// Something that the scene can be, besides a ball on a floor in the sun.
struct Place {
    name: &'static str,
    /// Changes the material.
    material: fn(&mut StandardMaterial, &mut Assets<Image>),
    /// Changes the ball's mesh.
    mesh: fn(Mesh) -> Mesh,
    /// Changes camera, ball, and what is around them.
    scene: fn(&mut World, camera: Entity, ball: Entity),
    /// Largest mean difference, of 255, that counts as the same.
    tolerance: f64,
}

const PLAIN: Place =
    Place { name: "plain", material: |_, _| {}, mesh: |mesh| mesh, scene: |_, _, _| {}, tolerance: 0.05 };

fn draw(place: &Place, porous: Option<f32>) -> Option<RgbImage> {
    let mut app = app()?;
    let world = app.world_mut();
    let (stage, camera) = stage(world, SIZE);
    let mut material = StandardMaterial {
        base_color: Color::linear_rgb(0.5, 0.3, 0.2),
        perceptual_roughness: 0.6,
        ..default()
    };
    (place.material)(&mut material, &mut world.resource_mut::<Assets<Image>>());
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
    let ball_mesh = (place.mesh)(Sphere::new(0.5).mesh().uv(24, 16));
    let ball_mesh = world.resource_mut::<Assets<Mesh>>().add(ball_mesh);
    let floor_mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::splat(2.0)));
    let floor_mesh = world.resource_mut::<Assets<Mesh>>().add(floor_mesh);
    let ball = world
        .spawn((Mesh3d(ball_mesh), MeshMaterial3d(material.clone()), Transform::from_xyz(0.0, 0.5, 0.0)))
        .id();
    let floor = world.spawn((Mesh3d(floor_mesh), MeshMaterial3d(material))).id();
    (place.scene)(world, camera, ball);
    if let Some(alpha_poro) = porous {
        let maps = Weatherable { map_size: 64, wrap_u: Wrap::Repeat, wrap_v: Wrap::Clamp, ..default() };
        let model = WettingModel::Hnat(Pores { alpha_poro, ..default() });
        for surface in [ball, floor] {
            // All that falls goes into the pores: no film.
            let porous = PorousMaterial { model, ..still(1.0) };
            app.world_mut().entity_mut(surface).insert((maps, porous));
        }
        update_until(&mut app, "the maps and materials", |world| {
            [ball, floor].iter().all(|&entity| {
                world.get::<Overlays>(entity).is_some() && world.get::<DryMaterial>(entity).is_some()
            })
        });
        for surface in [ball, floor] {
            cover(&mut app, surface, 0.0, 1.0);
        }
    }
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    // As many in all for both, where frames are blended with those before.
    for _ in 0..24 {
        update(&mut app);
    }
    Some(picture(&mut app, &stage.target))
}

fn check(place: &Place) {
    let Some(standard) = draw(place, None) else { return };
    let glazed = draw(place, Some(0.0)).unwrap();
    let (average, largest) = difference(&glazed, &standard);
    if average > place.tolerance {
        keep(place.name, &[("glazed", &glazed), ("standard", &standard)]);
        panic!("{}: differs by {average:.3} on average, {largest} at most (of 255)", place.name);
    }
    let wet = draw(place, Some(0.6)).unwrap();
    let (average, _) = difference(&wet, &standard);
    // By more than what counts as the same.
    if average < f64::max(0.3, 2.0 * place.tolerance) {
        keep(place.name, &[("wet", &wet), ("standard", &standard)]);
        panic!("{}: porous and wet differs by only {average:.3}", place.name);
    }
}

#[test]
fn in_fog() {
    let fog = |world: &mut World, camera: Entity, _: Entity| {
        let falloff = FogFalloff::Linear { start: 1.0, end: 6.0 };
        world.entity_mut(camera).insert(DistanceFog { color: Color::WHITE, falloff, ..default() });
    };
    check(&Place { name: "fog", scene: fog, ..PLAIN });
}

#[test]
fn under_point_and_spot_lights_with_shadows() {
    let lights = |world: &mut World, _: Entity, _: Entity| {
        world.spawn((
            PointLight { intensity: 60_000.0, shadow_maps_enabled: true, ..default() },
            Transform::from_xyz(-1.2, 1.0, 0.8),
        ));
        world.spawn((
            SpotLight { intensity: 300_000.0, shadow_maps_enabled: true, outer_angle: 0.4, ..default() },
            Transform::from_xyz(1.0, 2.0, 1.0).looking_at(Vec3::new(0.3, 0.0, 0.3), Vec3::Y),
        ));
    };
    check(&Place { name: "lamps", scene: lights, ..PLAIN });
}

#[test]
fn in_an_irradiance_volume() {
    let volume = |world: &mut World, _: Entity, _: Entity| {
        // One voxel: a cube of six colours, as 1 x 2 x 3 texels.
        let colors =
            [[0.9f32, 0.2, 0.1], [0.1, 0.8, 0.2], [0.2, 0.2, 0.9], [0.9, 0.9, 0.1], [0.4; 3], [0.7; 3]];
        let texels = colors.iter().flat_map(|&[r, g, b]| [r, g, b, 1.0]).map(half::f16::from_f32);
        let voxels = Image::new(
            Extent3d { width: 1, height: 2, depth_or_array_layers: 3 },
            TextureDimension::D3,
            texels.flat_map(half::f16::to_le_bytes).collect(),
            TextureFormat::Rgba16Float,
            RenderAssetUsages::RENDER_WORLD,
        );
        let voxels = world.resource_mut::<Assets<Image>>().add(voxels);
        world.spawn((
            LightProbe::default(),
            IrradianceVolume { voxels, intensity: 900.0, ..default() },
            Transform::from_scale(Vec3::splat(8.0)),
        ));
    };
    check(&Place { name: "irradiance_volume", scene: volume, ..PLAIN });
}

#[test]
fn with_prepasses_and_many_samples() {
    let camera = |world: &mut World, camera: Entity, _: Entity| {
        world.entity_mut(camera).insert((DepthPrepass, NormalPrepass, Msaa::Sample4));
    };
    check(&Place { name: "prepass_msaa", scene: camera, ..PLAIN });
}

#[test]
fn with_temporal_anti_aliasing() {
    let camera = |world: &mut World, camera: Entity, _: Entity| {
        world.entity_mut(camera).insert(TemporalAntiAliasing::default());
    };
    // The jitter is where the number of the frame puts it.
    check(&Place { name: "taa", scene: camera, tolerance: 0.6, ..PLAIN });
}

#[test]
fn beside_deferred_surfaces() {
    let camera = |world: &mut World, camera: Entity, _: Entity| {
        world.entity_mut(camera).insert((DepthPrepass, DeferredPrepass));
    };
    let material = |material: &mut StandardMaterial, _: &mut Assets<Image>| {
        material.opaque_render_method = OpaqueRendererMethod::Deferred;
    };
    // A G-buffer rounds.
    check(&Place { name: "deferred", scene: camera, material, tolerance: 1.0, ..PLAIN });
}

#[test]
fn cut_out_by_a_mask() {
    let material = |material: &mut StandardMaterial, images: &mut Assets<Image>| {
        let texels = (0..64u32).flat_map(|i| [255, 255, 255, if (i + i / 8) % 2 == 0 { 255 } else { 0 }]);
        let extent = Extent3d { width: 8, height: 8, depth_or_array_layers: 1 };
        let mask = Image::new(
            extent,
            TextureDimension::D2,
            texels.collect(),
            TextureFormat::Rgba8UnormSrgb,
            RenderAssetUsages::RENDER_WORLD,
        );
        material.base_color_texture = Some(images.add(mask));
        material.alpha_mode = AlphaMode::Mask(0.5);
    };
    check(&Place { name: "mask", material, ..PLAIN });
}

#[test]
fn lacquered_and_translucent() {
    let material = |material: &mut StandardMaterial, _: &mut Assets<Image>| {
        material.clearcoat = 0.8;
        material.diffuse_transmission = 0.4;
        material.emissive = LinearRgba::rgb(0.2, 0.05, 0.0);
    };
    check(&Place { name: "lacquered", material, ..PLAIN });
}

#[test]
fn on_skinned_meshes() {
    let mesh = |mesh: Mesh| {
        let count = mesh.count_vertices();
        mesh.with_inserted_attribute(
            Mesh::ATTRIBUTE_JOINT_INDEX,
            VertexAttributeValues::Uint16x4(vec![[0, 0, 0, 0]; count]),
        )
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, vec![[1.0f32, 0.0, 0.0, 0.0]; count])
    };
    let scene = |world: &mut World, _: Entity, ball: Entity| {
        let joint =
            world.spawn(Transform::from_xyz(-0.3, 0.6, 0.0).with_scale(Vec3::new(0.6, 1.2, 0.6))).id();
        let poses = SkinnedMeshInverseBindposes::from(vec![Mat4::IDENTITY]);
        let inverse_bindposes = world.resource_mut::<Assets<SkinnedMeshInverseBindposes>>().add(poses);
        world.entity_mut(ball).insert(SkinnedMesh { inverse_bindposes, joints: vec![joint] });
    };
    check(&Place { name: "skinned", mesh, scene, ..PLAIN });
}

#[test]
fn on_morphed_meshes() {
    let mesh = |mesh: Mesh| {
        let VertexAttributeValues::Float32x3(positions) = mesh.attribute(Mesh::ATTRIBUTE_POSITION).unwrap()
        else {
            unreachable!("positions are vectors")
        };
        let narrow = |&[x, _, z]: &[f32; 3]| {
            MorphAttributes::new(Vec3::new(-0.5 * x, 0.0, -0.5 * z), Vec3::ZERO, Vec3::ZERO)
        };
        let targets = positions.iter().map(narrow).collect();
        mesh.with_morph_targets(targets)
    };
    let scene = |world: &mut World, _: Entity, ball: Entity| {
        world.entity_mut(ball).insert(MeshMorphWeights::Value { weights: vec![0.8] });
    };
    check(&Place { name: "morphed", mesh, scene, ..PLAIN });
}

#[test]
fn for_several_cameras() {
    // The last camera that draws into the picture is another one, with other settings.
    let scene = |world: &mut World, first: Entity, _: Entity| {
        let target = world.get::<RenderTarget>(first).unwrap().clone();
        let environment = world.get::<EnvironmentMapLight>(first).unwrap().clone();
        world.spawn((
            Camera3d::default(),
            Camera {
                order: 1,
                viewport: Some(bevy::camera::Viewport {
                    physical_position: UVec2::new(SIZE.x / 2, 0),
                    physical_size: UVec2::new(SIZE.x / 2, SIZE.y),
                    ..default()
                }),
                clear_color: ClearColorConfig::None,
                ..default()
            },
            Msaa::Off,
            target,
            environment,
            Projection::from(OrthographicProjection {
                scaling_mode: bevy::camera::ScalingMode::FixedVertical { viewport_height: 2.0 },
                ..OrthographicProjection::default_3d()
            }),
            Transform::from_xyz(-1.5, 1.0, 2.0).looking_at(Vec3::new(0.0, 0.4, 0.0), Vec3::Y),
        ));
    };
    check(&Place { name: "cameras", scene, ..PLAIN });
}
