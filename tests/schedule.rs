//! The whole schedule: nothing ambiguous, nothing that needs a renderer.

use bevy::asset::AssetPlugin;
use bevy::ecs::schedule::{InternedScheduleLabel, LogLevel, ScheduleBuildSettings, ScheduleLabel, Schedules};
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::collision::{SurfaceCollider, SurfaceImpact};
use bevy_weathering::overlay::{CpuMaps, CpuOverlayPlugin, SurfaceTotals};
use bevy_weathering::particle::ParticleCounts;
use bevy_weathering::prelude::*;

fn headless() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin))
        .add_plugins(WeatheringPlugins)
        .add_plugins(CpuOverlayPlugin);
    app
}

/// Turns ambiguities into panics, in every schedule that our systems are in.
fn refuse_ambiguities(app: &mut App) {
    let labels: [InternedScheduleLabel; 8] = [
        WeatheringTick.intern(),
        PreUpdate.intern(),
        Update.intern(),
        PostUpdate.intern(),
        FixedFirst.intern(),
        FixedPreUpdate.intern(),
        FixedUpdate.intern(),
        FixedPostUpdate.intern(),
    ];
    let mut schedules = app.world_mut().resource_mut::<Schedules>();
    for label in labels {
        schedules
            .entry(label)
            .set_build_settings(ScheduleBuildSettings { ambiguity_detection: LogLevel::Error, ..default() });
    }
}

#[test]
fn no_two_systems_are_ambiguous() {
    let mut app = headless();
    refuse_ambiguities(&mut app);
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    app.finish();
    app.cleanup();
    for _ in 0..3 {
        app.update();
    }
    assert!(app.world().resource::<WeatheringClock>().tick() >= 2, "the schedules ran");
}

#[test]
#[should_panic(expected = "ambigu")]
fn the_check_for_ambiguities_can_fail() {
    let mut app = headless();
    fn writes(_: ResMut<ParticleCounts>) {}
    fn writes_too(_: ResMut<ParticleCounts>) {}
    app.add_systems(WeatheringTick, (writes, writes_too).in_set(WeatheringSystems::Last));
    refuse_ambiguities(&mut app);
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    app.update();
    app.update();
}

#[test]
fn rain_wets_a_plane_without_a_renderer() {
    let mut app = headless();
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    app.finish();
    app.cleanup();
    let plane = Mesh::from(Plane3d::new(Vec3::Y, Vec2::splat(2.0)));
    let plane = app.world_mut().resource_mut::<Assets<Mesh>>().add(plane);
    let surface = app
        .world_mut()
        .spawn((
            Weatherable { map_size: 64, ..default() },
            ReportImpacts,
            Mesh3d(plane),
            Transform::default(),
        ))
        .id();
    while app.world().get::<SurfaceCollider>(surface).is_none() {
        app.update();
    }
    let effect = app.world_mut().resource_mut::<Assets<WeatherEffect>>().add(WeatherEffect::default());
    app.world_mut().spawn((
        Emitter {
            effect,
            rate: 600.0,
            shape: EmitterShape::Sky { half_size: Vec2::splat(1.5) },
            speed: 6.0,
            lifetime: 2.0,
            ..default()
        },
        Transform::from_xyz(0.0, 1.0, 0.0),
    ));
    let mut messages = 0;
    for _ in 0..90 {
        app.update();
        messages += app.world_mut().resource_mut::<Messages<SurfaceImpact>>().drain().count() as u64;
    }
    let counts = *app.world().resource::<ParticleCounts>();
    assert!(counts.hit > 500, "{counts:?}");
    assert_eq!(counts.emitted, counts.alive + counts.hit + counts.expired);
    let totals = *app.world().get::<SurfaceTotals>(surface).unwrap();
    assert_eq!((totals.impacts, messages), (counts.hit, counts.hit));
    let maps = app.world().get::<CpuMaps>(surface).unwrap();
    assert_eq!(maps.water_nl(), totals.water_nl);
}
