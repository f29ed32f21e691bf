//! The whole schedule: nothing ambiguous, nothing that needs a renderer.

use bevy::asset::AssetPlugin;
use bevy::ecs::schedule::{InternedScheduleLabel, LogLevel, ScheduleBuildSettings, ScheduleLabel, Schedules};
use bevy::mesh::MeshPlugin;
use bevy::pbr::MaterialPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::collision::SurfaceImpact;
use bevy_weathering::material::WeatheredMaterial;
use bevy_weathering::overlay::{CpuOverlayPlugin, SurfaceTotals};
use bevy_weathering::particle::{ParticleCounts, ParticleMaterial, Particles, integrate_particles};
use bevy_weathering::prelude::*;
use bevy_weathering::scenario::{Scenario, ScenarioPlugin};
use bevy_weathering::wetting::SurfaceWater;

fn headless() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin))
        .add_plugins(WeatheringPlugins)
        .add_plugins(CpuOverlayPlugin);
    app
}

/// Every schedule that our systems are in.
fn our_schedules() -> [InternedScheduleLabel; 9] {
    [
        WeatheringTick.intern(),
        Startup.intern(),
        PreUpdate.intern(),
        Update.intern(),
        PostUpdate.intern(),
        FixedFirst.intern(),
        FixedPreUpdate.intern(),
        FixedUpdate.intern(),
        FixedPostUpdate.intern(),
    ]
}

/// Turns ambiguities into panics.
fn refuse_ambiguities(app: &mut App) {
    let mut schedules = app.world_mut().resource_mut::<Schedules>();
    for label in our_schedules() {
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

/// Pairs of systems, by schedule, whose order nobody has settled, and what they disagree about.
fn ambiguities(app: &mut App) -> Vec<(InternedScheduleLabel, Vec<String>)> {
    // Conflicts are found when a schedule is built.
    let conflicts = |world: &mut World, schedule: &mut Schedule| {
        schedule.initialize(world).unwrap();
        let mut pairs: Vec<String> = schedule
            .graph()
            .conflicting_systems()
            .0
            .iter()
            .map(|(_, _, on)| {
                let info = |&id| world.components().get_info(id).and_then(|info| info.type_id());
                format!("{:?}", on.iter().map(info).collect::<Vec<_>>())
            })
            .collect();
        pairs.sort();
        pairs
    };
    // Not every app has all schedules.
    let of = |label| Some((label, app.world_mut().try_schedule_scope(label, conflicts).ok()?));
    our_schedules().into_iter().filter_map(of).collect()
}

/// Systems have no names in a build like this one, so what Bevy leaves open by itself is counted and taken off.
#[test]
fn no_system_is_ambiguous_beside_all_of_bevy() {
    let Some(mut bare) = crate::gpu::app::bare_app() else { return };
    // Bevy's systems for our materials are Bevy's.
    bare.add_plugins(MaterialPlugin::<WeatheredMaterial>::default());
    bare.add_plugins(MaterialPlugin::<ParticleMaterial>::default());
    bare.finish();
    bare.cleanup();
    let theirs = ambiguities(&mut bare);

    let mut app = crate::gpu::app::unfinished_app().unwrap();
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios/vase.ron");
    let scenario = Scenario::load(&file).unwrap();
    app.add_plugins(ScenarioPlugin::new(scenario, true).unwrap());
    app.finish();
    app.cleanup();
    let all = ambiguities(&mut app);
    assert!(all.len() > 5, "{}", all.len());
    for (label, pairs) in &all {
        let without_us = theirs.iter().find(|(other, _)| other == label).map_or(0, |(_, pairs)| pairs.len());
        assert_eq!(pairs.len(), without_us, "{label:?}: {pairs:#?}");
    }

    // The count does rise.
    fn pushes(_: ResMut<Particles>) {}
    app.add_systems(PostUpdate, (pushes, integrate_particles));
    let count = |all: &[(_, Vec<String>)]| all.iter().map(|(_, pairs)| pairs.len()).sum::<usize>();
    assert!(count(&ambiguities(&mut app)) > count(&all));
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
    while app.world().get::<SurfaceWater>(surface).is_none() {
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
    let water = app.world().get::<SurfaceWater>(surface).unwrap();
    assert_eq!(water.ledger().received, water.units().from_nl(totals.water_nl));
}
