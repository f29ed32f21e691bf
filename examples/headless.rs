//! No window and no graphics driver: two minutes of rain on a floor and a ball, as fast as the machine can. Every half a minute
//! of weather it prints how much water is on and in them, and ends.
//!
//! `cargo run --release --example headless`

use bevy::asset::AssetPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::prelude::*;

/// Weather time.
const SECONDS: u32 = 120;

fn main() -> AppExit {
    App::new()
        .add_plugins((MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin))
        // To keep marks in colour as well, put `overlay::CpuOverlayPlugin` in the place of `overlay::GpuOverlayPlugin`.
        .add_plugins(WeatheringPlugins)
        // Each frame holds one tick, however long it takes.
        .insert_resource(TimeUpdateStrategy::FixedTimesteps(1))
        .add_systems(Startup, setup)
        .add_systems(Update, begin)
        .add_systems(WeatheringTick, report.in_set(WeatheringSystems::Last))
        .run()
}

fn setup(mut commands: Commands, assets: Res<AssetServer>, mut meshes: ResMut<Assets<Mesh>>) {
    let floor = meshes.add(Plane3d::new(Vec3::Y, Vec2::splat(1.0)));
    let ball = meshes.add(Sphere::new(0.4).mesh().uv(32, 16));
    commands.spawn((Name::new("floor"), Weatherable::default(), Mesh3d(floor)));
    let small = Weatherable { map_size: 256, ..default() };
    commands.spawn((Name::new("ball"), small, Mesh3d(ball), Transform::from_xyz(0.0, 0.6, 0.0)));
    let rain = Emitter::rain(assets.load(WeatherEffect::RAIN), 10.0, Vec2::splat(1.0));
    commands.spawn((Emitter { rate: 2000.0, enabled: false, ..rain }, Transform::from_xyz(0.0, 3.0, 0.0)));
}

/// Meshes are measured and effects loaded in the background. What falls before that hits nothing.
fn begin(
    assets: Res<AssetServer>,
    surfaces: Query<(), With<Weatherable>>,
    mut ready: MessageReader<SurfaceReady>,
    mut count: Local<usize>,
    mut rain: Single<&mut Emitter>,
) {
    *count += ready.read().count();
    if !rain.enabled {
        rain.enabled = *count == surfaces.iter().count() && assets.is_loaded(&rain.effect);
    }
}

fn report(
    clock: Res<WeatheringClock>,
    rain: Single<&Emitter>,
    wetness: WetnessQuery,
    surfaces: Query<(Entity, &Name), With<Weatherable>>,
    mut ticks: Local<u32>,
    mut exit: MessageWriter<AppExit>,
) {
    *ticks += u32::from(rain.enabled);
    let (seconds, rest) = (*ticks / clock.hz(), *ticks % clock.hz());
    if seconds == 0 || rest != 0 || !seconds.is_multiple_of(30) {
        return;
    }
    for (surface, name) in &surfaces {
        let Some(over) = wetness.over(surface) else { continue };
        let (film, absorbed, wet) = (over.film_ml, over.absorbed_ml, 100.0 * over.wet_fraction);
        println!("{seconds:3} s, {name}: {film:.1} ml on it, {absorbed:.1} ml in it, {wet:.0} % wet");
    }
    if seconds >= SECONDS {
        exit.write(AppExit::Success);
    }
}
