//! A garden hose that points where the mouse does, and runs while the left button is held: water darkens a brick wall, runs
//! down, and drips on the floor.
//!
//! `cargo run --release --example hose`

use bevy::prelude::*;
use bevy_weathering::prelude::*;

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, WeatheringPlugins))
        .add_systems(Startup, setup)
        .add_systems(Update, aim)
        .run();
}

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let brick = StandardMaterial {
        base_color: Color::linear_rgb(0.42, 0.2, 0.13),
        perceptual_roughness: 0.9,
        ..default()
    };
    commands.spawn((
        Weatherable::default(),
        Mesh3d(meshes.add(Plane3d::new(Vec3::Z, Vec2::new(2.0, 1.2)))),
        MeshMaterial3d(materials.add(brick)),
        Transform::from_xyz(0.0, 1.25, 0.0),
    ));
    // What runs off the wall drips on it.
    commands.spawn((
        Weatherable::default(),
        Mesh3d(meshes.add(Plane3d::new(Vec3::Y, Vec2::splat(2.0)))),
        MeshMaterial3d(materials.add(Color::linear_rgb(0.4, 0.38, 0.35))),
        Transform::from_xyz(0.0, 0.0, 1.0),
    ));

    // 15 litres a minute through a nozzle of 6 mm leave it at 8.8 m/s, in 1500 slugs a second.
    let water = assets.load(WeatherEffect::HOSE);
    commands.spawn((
        Emitter { rate: 1500.0, spread: 0.03, enabled: false, ..Emitter::hose(water, 15.0, 0.006) },
        Transform::from_xyz(0.6, 1.3, 2.2),
    ));

    commands.spawn((
        DirectionalLight::default(),
        Transform::default().looking_to(Vec3::new(-0.6, -1.0, -1.0), Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        Transform::from_xyz(0.0, 1.6, 3.6).looking_at(Vec3::new(0.0, 1.0, 0.0), Vec3::Y),
    ));
}

fn aim(
    camera: Single<(&Camera, &GlobalTransform)>,
    window: Single<&Window>,
    buttons: Res<ButtonInput<MouseButton>>,
    hose: Single<(&mut Transform, &mut Emitter)>,
) {
    let (mut place, mut emitter) = hose.into_inner();
    emitter.enabled = buttons.pressed(MouseButton::Left);
    let (camera, camera_place) = *camera;
    if let Some(cursor) = window.cursor_position()
        && let Ok(ray) = camera.viewport_to_world(camera_place, cursor)
        && let Some(point) = ray.plane_intersection_point(Vec3::ZERO, InfinitePlane3d::new(Vec3::Z))
    {
        place.look_at(point, Vec3::Y);
    }
}
