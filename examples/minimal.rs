//! The five lines that make a Bevy scene wet.

use bevy::prelude::*;
use bevy_weathering::prelude::*;

fn main() {
    App::new().add_plugins((DefaultPlugins, WeatheringPlugins)).add_systems(Startup, setup).run();
}

fn setup(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut effects: ResMut<Assets<WeatherEffect>>,
) {
    // A scene as any other. What is `Weatherable` gets wet where it is hit.
    let clay = materials.add(Color::linear_rgb(0.5, 0.23, 0.13));
    commands.spawn((Weatherable::default(), Mesh3d(meshes.add(Sphere::new(1.0))), MeshMaterial3d(clay)));

    // A hose that points at it. Its water is a `WeatherEffect`: load one, or make one.
    commands.spawn((
        Emitter {
            effect: effects.add(WeatherEffect { stamp_radius: Some(0.05), volume_mm3: 500.0, ..default() }),
            shape: EmitterShape::Cone { radius: 0.01 },
            spread: 0.05,
            ..default()
        },
        Transform::from_xyz(2.0, 1.5, 3.0).looking_at(Vec3::Y, Vec3::Y),
    ));

    commands.spawn((
        DirectionalLight::default(),
        Transform::default().looking_to(Vec3::new(-1.0, -1.5, -1.0), Vec3::Y),
    ));
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.0, 4.5).looking_at(Vec3::ZERO, Vec3::Y)));
}
