//! A device that is lost while an app runs: nothing panics, and the app ends with an error unless it wants to stay.

use bevy::prelude::*;
use bevy::render::error_handler::{ErrorType, RenderErrorHandler, RenderErrorPolicy};
use bevy::render::render_resource::PollType;
use bevy::render::renderer::RenderDevice;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::overlay::SurfaceTotals;
use bevy_weathering::prelude::*;
use bevy_weathering::scenes::meshes::ground;

use super::app::{add_target, app, camera, still, update, update_until};

/// A wall that is hosed down, drawn for so long that all of it is there.
fn hosed() -> Option<(App, Entity)> {
    let mut app = app()?;
    let target = add_target(&mut app, UVec2::splat(64));
    let world = app.world_mut();
    world.spawn(camera(&target, Vec3::new(0.0, 2.0, 0.1), Vec3::ZERO));
    world.spawn((PointLight::default(), Transform::from_xyz(1.0, 2.0, 1.0)));
    let mesh = world.resource_mut::<Assets<Mesh>>().add(ground(Vec2::ONE, UVec2::splat(2)).unwrap());
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
    let maps = Weatherable { map_size: 64, ..default() };
    let surface = world.spawn((Mesh3d(mesh), MeshMaterial3d(material), maps, still(0.5))).id();
    let effect = WeatherEffect {
        volume_mm3: 50.0,
        stamp_radius: Some(0.05),
        diffuse: bevy_weathering::effect::Paint { color: [0.2; 3], opacity: 0.5 },
        ..default()
    };
    let effect = world.resource_mut::<Assets<WeatherEffect>>().add(effect);
    let down = Transform::from_xyz(0.0, 0.5, 0.0).looking_to(Vec3::NEG_Y, Vec3::X);
    world.spawn((Emitter { effect, rate: 300.0, ..default() }, down));
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    update_until(&mut app, "impacts", |world| impacts(world, surface) > 50);
    Some((app, surface))
}

fn impacts(world: &World, surface: Entity) -> u64 {
    world.get::<SurfaceTotals>(surface).map_or(0, |totals| totals.impacts)
}

fn lose_device(app: &App) {
    let device = app.world().resource::<RenderDevice>().wgpu_device();
    device.destroy();
    // It is lost when it has nothing to do any more.
    device.poll(PollType::Wait { submission_index: None, timeout: None }).unwrap();
}

#[test]
fn an_app_ends_with_an_error_when_its_device_is_lost() {
    let Some((mut app, _)) = hosed() else { return };
    update(&mut app);
    assert_eq!(app.should_exit(), None);
    lose_device(&app);
    app.update();
    assert!(app.should_exit().is_some_and(|exit| exit.is_error()));
}

#[derive(Resource)]
struct Told(ErrorType);

#[test]
fn an_app_that_wants_to_stay_goes_on_without_pictures() {
    let Some((mut app, surface)) = hosed() else { return };
    app.insert_resource(RenderErrorHandler(|error, main_world, _| {
        main_world.insert_resource(Told(error.ty));
        RenderErrorPolicy::StopRendering
    }));
    lose_device(&app);
    let (tick, hits) = (app.world().resource::<WeatheringClock>().tick(), impacts(app.world(), surface));
    for _ in 0..60 {
        app.update();
    }
    assert_eq!(app.world().resource::<Told>().0, ErrorType::DeviceLost);
    assert_eq!(app.should_exit(), None);
    assert_eq!(app.world().resource::<WeatheringClock>().tick(), tick + 60);
    assert!(impacts(app.world(), surface) > hits + 200);
}
