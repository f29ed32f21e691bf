//! How wet is the floor? The title of the window says it of its middle, at every moment; the log says when a fifth of it is
//! wet, and when it is dry again. A shower comes every half a minute.
//!
//! `cargo run --release --example query_wetness`

use bevy::prelude::*;
use bevy_weathering::prelude::*;

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, WeatheringPlugins))
        // Hours in half a minute.
        .insert_resource(Weather { drying_speed: 200.0, ..default() })
        .add_systems(Startup, setup)
        .add_systems(Update, (rain_now_and_then, show_the_middle, tell))
        .run();
}

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    commands.spawn((
        Weatherable { map_size: 256, ..default() },
        // Asks for messages.
        WatchWetness::default(),
        Mesh3d(meshes.add(Plane3d::new(Vec3::Y, Vec2::splat(1.0)))),
        MeshMaterial3d(materials.add(Color::linear_rgb(0.5, 0.23, 0.13))),
    ));
    let rain = Emitter::rain(assets.load(WeatherEffect::RAIN), 100.0, Vec2::splat(1.0));
    commands.spawn((rain, Transform::from_xyz(0.0, 2.0, 0.0)));
    commands.spawn((
        DirectionalLight::default(),
        Transform::default().looking_to(Vec3::new(-0.5, -1.0, -0.5), Vec3::Y),
    ));
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 2.0, 2.5).looking_at(Vec3::ZERO, Vec3::Y)));
}

/// Showers of five seconds, every half a minute.
fn rain_now_and_then(time: Res<Time>, mut rain: Single<&mut Emitter>) {
    rain.enabled = time.elapsed_secs() % 30.0 < 5.0;
}

fn show_the_middle(
    wetness: WetnessQuery,
    floor: Single<Entity, With<Weatherable>>,
    mut window: Single<&mut Window>,
) {
    // None until the floor has been measured.
    if let Some(here) = wetness.at_point(*floor, Vec3::ZERO) {
        let (looks, film, absorbed) = (here.wetness, here.film_mm, here.absorbed_mm);
        window.title = format!("looks {looks:.2} wet: {film:.2} mm on it, {absorbed:.2} mm in it");
    }
}

fn tell(mut wet: MessageReader<BecameWet>, mut dried: MessageReader<Dried>) {
    for message in wet.read() {
        info!("wet: {:.0} % of the floor", 100.0 * message.wet_fraction);
    }
    for message in dried.read() {
        info!("dry, but for {:.0} % of the floor", 100.0 * message.wet_fraction);
    }
}
