//! More than a machine can do, in whole apps without a renderer: what is cut, held or slowed down, and that nothing is lost.

use std::time::Duration;

use bevy::diagnostic::DiagnosticsStore;
use bevy::ecs::schedule::{LogLevel, ScheduleBuildSettings, ScheduleLabel, Schedules};
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::emitter::{EmissionDetail, EmitterState};
use bevy_weathering::overload::{LiveLoad, OverloadDiagnosticsPlugin};
use bevy_weathering::particle::{ParticleConfig, ParticleCounts, Particles, WaterCounts};
use bevy_weathering::prelude::*;
use bevy_weathering::scenes::meshes::ground;
use bevy_weathering::schedule::TickHold;
use bevy_weathering::wetting::SurfaceWater;

use crate::wetting::scene::Scene;

const HZ: u32 = 60;

/// A floor, which nothing leaves but by drying.
fn floor(scene: &mut Scene) -> Entity {
    let glazed = PorousMaterial { capacity_mm: 0.0, retained_mm: 1000.0, ..default() };
    scene.surface(ground(Vec2::splat(4.0), UVec2::splat(4)).unwrap(), 64, glazed, Transform::default())
}

/// Rain of 36 mm/h over a square metre of it, 10 ml/s, and a hose of 6 l/min, 100 ml/s; by so many particles a second each.
fn water(scene: &mut Scene, rate: f32) -> [Entity; 2] {
    let rain = Emitter {
        rate,
        flow: Flow::MmPerHour(36.0),
        shape: EmitterShape::Sky { half_size: Vec2::splat(0.5) },
        speed: 6.0,
        ..default()
    };
    let hose = Emitter { rate, stream: 1, flow: Flow::LitresPerMinute(6.0), ..default() };
    let rain = scene.emit(rain, 1.0, 0.02, Vec3::new(0.0, 1.0, 0.0));
    let hose = scene.emit(hose, 1.0, 0.02, Vec3::new(0.5, 1.0, 0.0));
    let down = Transform::from_xyz(0.5, 1.0, 0.0).looking_to(Vec3::NEG_Y, Vec3::X);
    scene.0.world_mut().entity_mut(hose).insert(down);
    settle(scene);
    [rain, hose]
}

/// A tick in which nothing is emitted yet: transforms find their places, and effects their rows.
fn settle(scene: &mut Scene) {
    // The first frame of an app takes no time.
    scene.0.update();
    scene.run(1);
    assert_eq!(scene.0.world().resource::<ParticleCounts>(), &ParticleCounts::default());
}

/// Nanolitres that were sent, that wait in emitters, and that are on the floor or in flight.
fn accounts(scene: &Scene, floor: Entity, emitters: [Entity; 2]) -> (u64, f64, u64) {
    let world = scene.0.world();
    let sent = world.resource::<WaterCounts>().emitted_nl;
    let held = emitters.map(|emitter| world.get::<EmitterState>(emitter).unwrap().held_mm3() * 1000.0);
    let flying = world.resource::<Particles>().volumes_nl().iter().copied().map(u64::from).sum::<u64>();
    let water = world.get::<SurfaceWater>(floor).unwrap();
    (sent, held.iter().sum(), flying + water.units().whole_nl(water.ledger().received))
}

#[test]
fn a_cap_on_particles_loses_no_water_of_a_flow() {
    let run = |max_alive: u32| {
        let mut scene = Scene::new(HZ);
        scene.0.insert_resource(ParticleConfig { max_alive });
        let floor = floor(&mut scene);
        let emitters = water(&mut scene, 3000.0);
        scene.run(10 * HZ);
        (accounts(&scene, floor, emitters), *scene.0.world().resource::<ParticleCounts>())
    };
    let ((sent, held, found), counts) = run(1_000_000);
    assert_eq!((sent, held, counts.merged, counts.refused), (found, 0.0, 0, 0));
    // 110 ml/s for ten seconds.
    assert!((sent as f64 / 1.1e9 - 1.0).abs() < 1e-5, "{sent}");
    // A hundredth of what wants to fly.
    let ((capped, held, found), counts) = run(10);
    assert_eq!(capped, found, "to the nanolitre");
    assert!(((capped as f64 + held) / sent as f64 - 1.0).abs() < 1e-5, "{capped} and {held} of {sent}");
    assert!(capped as f64 > 0.97 * sent as f64, "{capped} of {sent}");
    assert_eq!((counts.emitted + counts.merged, counts.refused), (60_000, 0));
    assert!(counts.alive <= 10 && counts.merged > 55_000, "{counts:?}");
}

#[test]
fn what_a_cap_cuts_from_a_plain_rate_is_counted() {
    let mut scene = Scene::new(HZ);
    scene.0.insert_resource(ParticleConfig { max_alive: 50 });
    floor(&mut scene);
    let emitter = Emitter { rate: 6000.0, lifetime: 1.0, ..default() };
    scene.emit(emitter, 1.0, 0.02, Vec3::new(0.0, 1.0, 0.0));
    settle(&mut scene);
    scene.run(2 * HZ);
    let counts = *scene.0.world().resource::<ParticleCounts>();
    assert_eq!(counts.emitted + counts.refused, 12_000);
    assert!(counts.refused > 11_000 && counts.alive <= 50 && counts.merged == 0, "{counts:?}");
    // Bevy's diagnostics say the same.
    let world = scene.0.world();
    let told = |path| world.resource::<DiagnosticsStore>().get(&path).and_then(|told| told.value());
    assert_eq!(told(OverloadDiagnosticsPlugin::REFUSED), Some(counts.refused as f64));
    assert_eq!(told(OverloadDiagnosticsPlugin::ALIVE), Some(counts.alive as f64));
    assert_eq!(told(OverloadDiagnosticsPlugin::DETAIL), Some(1.0));
}

#[test]
fn fewer_particles_bring_as_much_water() {
    let run = |factor: f32| {
        let mut scene = Scene::new(HZ);
        scene.0.world_mut().resource_mut::<EmissionDetail>().set_factor(factor);
        let floor = floor(&mut scene);
        let emitters = water(&mut scene, 3000.0);
        scene.run(5 * HZ);
        (accounts(&scene, floor, emitters), scene.0.world().resource::<ParticleCounts>().emitted)
    };
    let ((all, ..), _) = run(1.0);
    for factor in [0.3, 0.01] {
        let ((sent, held, found), emitted) = run(factor);
        assert_eq!(sent, found, "{factor}");
        assert!(
            ((sent as f64 + held) / all as f64 - 1.0).abs() < 1e-5,
            "{factor}: {sent} and {held} of {all}"
        );
        assert!((emitted as f64 - 30_000.0 * f64::from(factor)).abs() <= 1.0, "{factor}: {emitted}");
    }
}

#[test]
fn held_ticks_are_not_lost_time_but_no_time() {
    let run = |holds: bool| {
        let mut scene = Scene::new(HZ);
        let floor = floor(&mut scene);
        let emitters = water(&mut scene, 500.0);
        for part in 0..10 {
            scene.run(6);
            if holds && part % 3 == 0 {
                scene.0.world_mut().resource_mut::<TickHold>().is_held = true;
                scene.run(7);
                scene.0.world_mut().resource_mut::<TickHold>().is_held = false;
            }
        }
        let world = scene.0.world();
        let (tick, held) = (world.resource::<WeatheringClock>().tick(), world.resource::<TickHold>().ticks);
        let told = world.resource::<DiagnosticsStore>().get(&OverloadDiagnosticsPlugin::HELD);
        assert_eq!(told.and_then(|told| told.value()), Some(held as f64));
        let particles: Vec<_> = world.resource::<Particles>().iter().collect();
        (tick, held, particles, accounts(&scene, floor, emitters))
    };
    let (plain, held) = (run(false), run(true));
    assert_eq!((plain.1, held.1), (0, 28));
    assert_eq!(plain.0, held.0);
    assert!(plain.2 == held.2, "the same particles, to the bit");
    assert_eq!(plain.3, held.3);
}

/// Lets a scene be watched, on a machine that needs at least so long for each particle in flight.
fn watch(scene: &mut Scene, budget: LiveBudget, per_particle: Duration) {
    // Not by `add_plugins`: the app is finished.
    LiveBudgetPlugin.build(&mut scene.0);
    let work = move |particles: Res<Particles>| {
        let begun = std::time::Instant::now();
        let end = per_particle * particles.len() as u32;
        while begun.elapsed() < end {
            std::hint::spin_loop();
        }
    };
    scene.0.insert_resource(budget).add_systems(WeatheringTick, work.in_set(WeatheringSystems::Last));
}

#[test]
fn a_slow_machine_is_brought_into_its_budget_by_fewer_particles() {
    let mut scene = Scene::new(HZ);
    let floor = floor(&mut scene);
    // All ticks of a frame run, however long they take. Fifty particles are ten milliseconds; on a machine that is busy with other
    // things they are more, and what is asserted holds all the more.
    let budget = LiveBudget { frame_ms: f32::INFINITY, longest_ms: 3.6e6, ..default() };
    watch(&mut scene, budget, Duration::from_micros(200));
    let emitters = water(&mut scene, 5000.0);
    // More than 1,500 would be in flight, thirty times as many.
    scene.run(5 * HZ);
    let load = *scene.0.world().resource::<LiveLoad>();
    let counts = *scene.0.world().resource::<ParticleCounts>();
    assert!(load.governor.factor() < 0.3, "{load:?}");
    assert!(counts.alive < 300 && counts.merged > 10_000, "{counts:?}");
    assert_eq!(scene.0.world().resource::<EmissionDetail>().factor(), load.governor.factor());
    // And still all of its water.
    let (sent, held, found) = accounts(&scene, floor, emitters);
    assert_eq!(sent, found);
    assert!(((sent as f64 + held) / (5.0 * 1.1e8) - 1.0).abs() < 1e-4, "{sent} and {held}");
}

#[test]
fn a_frame_that_took_long_is_not_made_up_for() {
    let mut scene = Scene::new(HZ);
    // Particles that do not die: after three ticks they take more than 50 ms, so a frame has time for one tick, and not for the
    // 15 of a quarter of a second.
    watch(&mut scene, LiveBudget::default(), Duration::from_micros(500));
    let emitter = Emitter { rate: 3600.0, lifetime: 100.0, ..default() };
    scene.emit(emitter, 1.0, 0.02, Vec3::new(0.0, 1000.0, 0.0));
    settle(&mut scene);
    scene.run(3);
    let tick = |scene: &Scene| scene.0.world().resource::<WeatheringClock>().tick();
    let before = tick(&scene);
    scene.0.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(250)));
    scene.0.update();
    let (first, began) = (tick(&scene) - before, tick(&scene));
    for _ in 0..8 {
        scene.0.update();
    }
    let load = *scene.0.world().resource::<LiveLoad>();
    assert!(first <= 2, "{first} ticks, {load:?}");
    assert!(tick(&scene) - began <= 16, "{} ticks, {load:?}", tick(&scene) - began);
    assert!(load.speed < 0.6 && load.left_out > Duration::from_millis(500), "{load:?}");
}

#[test]
fn a_hundred_times_as_fast_is_as_fast_as_the_budget_lets_it_be() {
    let mut scene = Scene::new(HZ);
    LiveBudgetPlugin.build(&mut scene.0);
    let work = || std::thread::sleep(Duration::from_millis(10));
    scene
        .0
        .insert_resource(LiveBudget { frame_ms: 100.0, ..default() })
        .add_systems(WeatheringTick, work.in_set(WeatheringSystems::Last));
    // What a tick takes is known.
    scene.0.update();
    scene.run(3);
    scene.0.world_mut().resource_mut::<Time<Virtual>>().set_relative_speed(100.0);
    scene.0.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_micros(16_667)));
    let tick = |scene: &Scene| scene.0.world().resource::<WeatheringClock>().tick();
    let mut counts = Vec::new();
    for _ in 0..8 {
        let before = tick(&scene);
        scene.0.update();
        counts.push(tick(&scene) - before);
    }
    // Not the hundred that were asked for, and never none.
    assert!(counts.iter().all(|count| (1..=11).contains(count)), "{counts:?}");
    let load = *scene.0.world().resource::<LiveLoad>();
    assert!(load.speed < 0.6, "{load:?}");
    // Nobody else has slowed it down.
    assert_eq!(scene.0.world().resource::<Time<Virtual>>().relative_speed(), 100.0);
}

#[test]
fn what_watches_the_time_leaves_no_order_open() {
    let mut scene = Scene::new(HZ);
    LiveBudgetPlugin.build(&mut scene.0);
    let mut schedules = scene.0.world_mut().resource_mut::<Schedules>();
    for label in [FixedUpdate.intern(), WeatheringTick.intern()] {
        let settings = ScheduleBuildSettings { ambiguity_detection: LogLevel::Error, ..default() };
        schedules.entry(label).set_build_settings(settings);
    }
    scene.0.update();
    scene.run(3);
    assert_eq!(scene.0.world().resource::<WeatheringClock>().tick(), 3);
}
