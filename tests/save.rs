//! The program again: scenes that are saved and gone on with, and where all the water is in the end.

use std::any::TypeId;
use std::fs;
use std::path::Path;

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::effect::WeatherEffect;
use bevy_weathering::emitter::{Emitter, EmitterShape, EmitterState};
use bevy_weathering::material::{PorousMaterial, StandingWater};
use bevy_weathering::particle::Particles;
use bevy_weathering::record::colors_at_hand;
use bevy_weathering::save::{AddedEmitter, RemovedEmitter, SavedScene};
use bevy_weathering::scenario::{ByHand, LoadedScenario, Scenario, ScenarioSurface, scene_digest};
use serde_json::Value;

use super::record::ready;
use super::replay::{files_below, number, read_report, replay, run};

/// Ten minutes of rain on a roof over a wall and a floor, in wind, with sun.
const TEN_MINUTES: &str = r#"(
    seconds: 600.0,
    tick_hz: 20,
    wind: (0.4, 0.0, -0.6),
    weather: (temperature_c: 24.0, humidity: 0.3, sun_w_per_m2: 700.0, drying_speed: 3.0),
    camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
    materials: {
        "tile": (porous: (capacity_mm: 0.1, sorptivity: 0.2, retained_mm: 0.05, efflorescence: 0.5, tide_mark: 0.5)),
        "brick": (porous: (capacity_mm: 1.0, sorptivity: 2.0)),
    },
    surfaces: [
        (
            name: "roof",
            mesh: Ground(size: (1.0, 1.0), cells: (3, 3)),
            material: "tile",
            position: (0.0, 1.0, 0.8),
            rotation_deg: (25.0, 0.0, 0.0),
            maps: (map_size: 64, wrap_u: Clamp, wrap_v: Clamp),
        ),
        (
            name: "floor",
            mesh: Ground(size: (2.0, 2.0), cells: (3, 3)),
            material: "brick",
            maps: (map_size: 64, wrap_u: Clamp, wrap_v: Clamp),
        ),
    ],
    emitters: [
        (
            name: "rain",
            effect: "rain.effect.ron",
            rate: 160.0,
            shape: Sky(half_size: (1.0, 1.0)),
            speed: 6.0,
            lifetime: 2.0,
            stop: 420.0,
            keys: [(position: (-0.1, 2.0, 0.2), target: (-0.1, 0.0, 0.2))],
        ),
    ],
)"#;

/// Paints, too, and leaves dents.
const RAIN: &str = "(
    volume_mm3: 99.9,
    terminal_speed: 6.5,
    stamp_radius: 0.03,
    stamp_radius_jitter: 0.4,
    diffuse: (color: (0.3, 0.2, 0.1), opacity: 0.5),
    specular: (color: (0.5, 0.6, 0.0), opacity: 0.4),
    bump: -0.3,
)";

/// The scenario in a folder of its own.
fn ten_minutes(folder: &Path) -> std::path::PathBuf {
    fs::write(folder.join("rain.effect.ron"), RAIN).unwrap();
    let file = folder.join("rain.ron");
    fs::write(&file, TEN_MINUTES).unwrap();
    file
}

/// What of a report a run that was interrupted must share with one that was not.
fn outcome(report: &Value) -> [&Value; 5] {
    ["digest", "surfaces", "particles", "water", "ticks"].map(|field| &report[field])
}

#[test]
fn all_water_is_accounted_for_after_ten_minutes_of_rain() {
    let folder = tempfile::tempdir().unwrap();
    let report = run(&mut replay(ten_minutes(folder.path()), "--no-render")).report();
    let water = &report["water"];
    let part = |name: &str| number(&water[name]);
    assert!(part("emitted_mm3") > 5_000_000.0, "{water}");
    for name in ["on_surfaces_mm3", "evaporated_mm3", "run_off_mm3", "missed_mm3"] {
        assert!(part(name) > 0.001 * part("emitted_mm3"), "{name} of {water}");
    }
    let found = part("on_surfaces_mm3")
        + part("evaporated_mm3")
        + part("run_off_mm3")
        + part("missed_mm3")
        + part("in_flight_mm3");
    assert!((found / part("emitted_mm3") - 1.0).abs() < 1e-6, "{water}");
    assert!(part("imbalance").abs() < 1e-6, "{water}");
    // The roof has dripped, over the edge of the floor.
    assert!(number(&report["surfaces"][0]["dripped_mm3"]) > 0.0, "{report}");
}

#[test]
fn a_run_that_was_saved_goes_on_to_the_same_digest() {
    let folder = tempfile::tempdir().unwrap();
    let file = ten_minutes(folder.path());
    let [kept, again, whole, resumed] =
        ["kept", "again", "whole", "resumed"].map(|name| folder.path().join(name));
    run(replay(&file, "--no-render --seconds 90 --out").arg(&whole)).assert_success();
    run(replay(&file, "--no-render --seconds 50 --save-state").arg(&kept)).assert_success();
    let mut command = replay(&file, "--no-render --seconds 90 --resume");
    run(command.arg(&kept).arg("--out").arg(&resumed)).assert_success();
    assert_eq!(outcome(&read_report(&resumed)), outcome(&read_report(&whole)));
    // It was painted before, and goes on to the same pictures.
    for map in ["diffuse", "specular", "normal"] {
        let texels = image::open(kept.join(format!("floor_{map}.png"))).unwrap().into_bytes();
        assert!(texels.iter().any(|&byte| byte > 0), "{map}");
    }
    let (whole, resumed) = (whole.join("maps"), resumed.join("maps"));
    let names = files_below(&whole);
    assert_eq!(files_below(&resumed), names);
    for name in names {
        assert!(fs::read(whole.join(&name)).unwrap() == fs::read(resumed.join(&name)).unwrap(), "{name}");
    }
    // What is restored and saved at once is the same to the byte.
    let mut twice = replay(&file, "--no-render --seconds 50");
    run(twice.arg("--resume").arg(&kept).arg("--save-state").arg(&again)).assert_success();
    let names = files_below(&kept);
    assert!(names.contains("roof_film.png") && names.contains("floor_tiles.png"), "{names:?}");
    assert!(names.contains("roof_tide.png") && names.contains("state.ron"), "{names:?}");
    assert_eq!(files_below(&again), names);
    for name in names {
        assert_eq!(fs::read(kept.join(&name)).unwrap(), fs::read(again.join(&name)).unwrap(), "{name}");
    }
}

fn floor(world: &mut World) -> Entity {
    let mut surfaces = world.query::<(Entity, &ScenarioSurface)>();
    surfaces.iter(world).find(|(_, surface)| surface.name == "floor").unwrap().0
}

#[test]
fn what_somebody_has_made_of_a_surface_is_kept_if_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = Scenario::load(&ten_minutes(folder.path())).unwrap();
    let porous = PorousMaterial { sorptivity: 0.7, capacity_mm: 3.0, ..PorousMaterial::CONCRETE };
    let standing = StandingWater { levelling_mm: 0.9, ..default() };
    let mut edited = ready(scenario.clone());
    let surface = floor(edited.world_mut());
    edited.world_mut().entity_mut(surface).insert((porous, standing));
    edited.insert_resource(TimeUpdateStrategy::FixedTimesteps(20));
    edited.update();
    let world = edited.world_mut();
    let colors = colors_at_hand(world).unwrap();
    let plain = SavedScene::capture(world, &scenario, colors);
    let to = folder.path().join("kept");
    for (scene, is_kept) in [(plain.clone(), false), (plain.with_materials(world), true)] {
        scene.write(&to).unwrap();
        let mut other = ready(scenario.clone());
        let world = other.world_mut();
        SavedScene::read(&to).unwrap().restore(world, &scenario, &to).unwrap();
        let surface = floor(world);
        assert_eq!(world.get::<PorousMaterial>(surface) == Some(&porous), is_kept);
        assert_eq!(world.get::<StandingWater>(surface) == Some(&standing), is_kept);
    }
    // What no material can be is refused.
    let state = to.join("state.ron");
    let text = fs::read_to_string(&state).unwrap();
    assert!(text.contains("levelling_mm: 0.9"), "{text}");
    fs::write(&state, text.replace("levelling_mm: 0.9", "levelling_mm: -1.0")).unwrap();
    let mut other = ready(scenario.clone());
    let refused = SavedScene::read(&to).unwrap().restore(other.world_mut(), &scenario, &to).unwrap_err();
    assert!(refused.to_string().contains("materials of floor: levelling_mm"), "{refused}");
}

/// So many frames of so many ticks.
fn go_on(app: &mut App, frames: u32, ticks: u32) {
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(ticks));
    (0..frames).for_each(|_| app.update());
}

fn emitter(world: &mut World, name: &str) -> Entity {
    let mut emitters = world.query_filtered::<(Entity, &Name), With<Emitter>>();
    emitters.iter(world).find(|(_, other)| other.as_str() == name).unwrap().0
}

/// What the tap has sent so far.
fn sent(world: &mut World) -> u64 {
    let tap = emitter(world, "tap");
    world.get::<EmitterState>(tap).unwrap().emitted
}

/// The scene with all that was made of emitters.
fn with_emitters(world: &mut World, scenario: &LoadedScenario) -> SavedScene {
    let colors = colors_at_hand(world).unwrap();
    SavedScene::capture(world, scenario, colors).with_emitters(world).unwrap()
}

/// The scenario of ten minutes with the rain in somebody's hand, and a tap that was added, after some seconds.
fn with_a_tap(scenario: &LoadedScenario) -> App {
    let mut app = ready(scenario.clone());
    let world = app.world_mut();
    let rain = emitter(world, "rain");
    let mut edited = world.get_mut::<Emitter>(rain).unwrap();
    (edited.rate, edited.speed, edited.enabled) = (40.0, 2.5, true);
    edited.shape = EmitterShape::Sky { half_size: Vec2::new(0.25, 0.5) };
    let place = Transform::from_xyz(0.1, 1.5, 0.2);
    world.entity_mut(rain).insert((ByHand, place, GlobalTransform::from(place)));
    // Of an effect that the scenario has not.
    let effect = WeatherEffect { volume_mm3: 500.0, stamp_radius: Some(0.02), ..default() };
    let effect = world.resource_mut::<Assets<WeatherEffect>>().add(effect);
    let place = Transform::from_xyz(0.2, 3.0, -0.3).looking_to(Vec3::NEG_Y, Vec3::X);
    let tap = Emitter { effect, rate: 30.0, speed: 0.5, stream: 1 << 29, ..default() };
    world.spawn((AddedEmitter, Name::new("tap"), tap, place, GlobalTransform::from(place)));
    go_on(&mut app, 3, 20);
    app
}

#[test]
fn what_somebody_has_made_of_emitters_is_kept_if_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let file = ten_minutes(folder.path());
    let scenario = Scenario::load(&file).unwrap();
    let mut edited = with_a_tap(&scenario);
    let (kept, again) = (folder.path().join("kept"), folder.path().join("again"));
    let world = edited.world_mut();
    assert!(sent(world) > 10 && !world.resource::<Particles>().is_empty());
    with_emitters(world, &scenario).write(&kept).unwrap();
    // Without them it does not fit: there is one that the scenario has not.
    let colors = colors_at_hand(world).unwrap();
    let plain = SavedScene::capture(world, &scenario, colors);
    let mut other = ready(scenario.clone());
    let refused = plain.restore(other.world_mut(), &scenario, &kept).unwrap_err().to_string();
    assert!(refused.contains("`emitters` is 2"), "{refused}");

    let scene = SavedScene::read(&kept).unwrap();
    assert!(scene.has_emitters() && !plain.has_emitters());
    let world = other.world_mut();
    scene.restore(world, &scenario, &kept).unwrap();
    let (rain, tap) = (emitter(world, "rain"), emitter(world, "tap"));
    let of = |emitter: Entity| {
        let emitter = world.get::<Emitter>(emitter).unwrap();
        (emitter.rate, emitter.speed, emitter.shape, emitter.stream)
    };
    let sky = EmitterShape::Sky { half_size: Vec2::new(0.25, 0.5) };
    assert_eq!(of(rain), (40.0, 2.5, sky, 0));
    assert_eq!(of(tap), (30.0, 0.5, EmitterShape::Point, 1 << 29));
    assert!(world.get::<ByHand>(rain).is_some() && world.get::<AddedEmitter>(tap).is_some());
    assert_eq!(world.get::<Transform>(rain).unwrap().translation, Vec3::new(0.1, 1.5, 0.2));
    // What is restored and saved at once is the same.
    with_emitters(world, &scenario).write(&again).unwrap();
    let state = |folder: &Path| fs::read_to_string(folder.join("state.ron")).unwrap();
    assert!(state(&kept) == state(&again));
    // Both go on alike, with what is in flight.
    go_on(&mut other, 3, 0);
    let [one, two] = [&mut edited, &mut other].map(|app| {
        go_on(app, 2, 20);
        (scene_digest(app.world_mut()), sent(app.world_mut()))
    });
    assert_eq!(one, two);
    // A second time in the same world: what was there makes room.
    go_on(&mut other, 1, 0);
    let world = other.world_mut();
    scene.restore(world, &scenario, &kept).unwrap();
    let mut added = world.query_filtered::<(), With<AddedEmitter>>();
    assert_eq!(added.iter(world).count(), 1);

    // The program goes on with it, and saves it again.
    let mut command = replay(&file, "--no-render --seconds 4 --resume");
    run(command.arg(&kept).arg("--save-state").arg(&again)).assert_success();
    assert!(SavedScene::read(&again).unwrap().has_emitters() && state(&again).contains("\"tap\""));
}

#[test]
fn an_emitter_that_was_removed_stays_so_in_what_is_saved() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = Scenario::load(&ten_minutes(folder.path())).unwrap();
    let mut edited = ready(scenario.clone());
    let world = edited.world_mut();
    let rain = emitter(world, "rain");
    world.entity_mut(rain).insert(RemovedEmitter);
    let scene = with_emitters(world, &scenario);
    let mut other = ready(scenario.clone());
    scene.restore(other.world_mut(), &scenario, folder.path()).unwrap();
    go_on(&mut other, 2, 20);
    let world = other.world_mut();
    let rain = emitter(world, "rain");
    assert!(world.get::<RemovedEmitter>(rain).is_some() && !world.get::<Emitter>(rain).unwrap().enabled);
    assert_eq!(world.get::<EmitterState>(rain).unwrap().emitted, 0);
    // Editors can show them.
    let types = world.resource::<AppTypeRegistry>().read();
    assert!(types.contains(TypeId::of::<AddedEmitter>()) && types.contains(TypeId::of::<RemovedEmitter>()));
}

/// That a saved scene can be read but not gone on from if the first `was` after `part` of its state is an `is`: `named` tells.
fn assert_refused(
    app: &mut App,
    scenario: &LoadedScenario,
    kept: &Path,
    part: &str,
    changes: &[(&str, &str, &str)],
) {
    let state = kept.join("state.ron");
    let text = fs::read_to_string(&state).unwrap();
    let (before, after) = text.split_once(part).unwrap();
    for &(was, is, named) in changes {
        assert!(after.contains(was), "{was} is not in {after}");
        fs::write(&state, format!("{before}{part}{}", after.replacen(was, is, 1))).unwrap();
        let scene = SavedScene::read(kept).unwrap();
        let refused = scene.restore(app.world_mut(), scenario, kept).unwrap_err().to_string();
        assert!(refused.contains(named), "{was}: {refused}");
    }
}

#[test]
fn effects_of_the_scenario_that_were_edited_are_kept_and_others_are_as_in_their_files() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = Scenario::load(&ten_minutes(folder.path())).unwrap();
    let volume = |app: &mut App, edit: Option<f32>| {
        let world = app.world_mut();
        let rain = emitter(world, "rain");
        let effect = world.get::<Emitter>(rain).unwrap().effect.clone();
        let mut effects = world.resource_mut::<Assets<WeatherEffect>>();
        if let Some(volume_mm3) = edit {
            effects.get_mut(&effect).unwrap().volume_mm3 = volume_mm3;
        }
        effects.get(&effect).unwrap().volume_mm3
    };
    let mut edited = ready(scenario.clone());
    let before = with_emitters(edited.world_mut(), &scenario);
    let in_file = volume(&mut edited, None);
    assert_ne!(volume(&mut edited, Some(123.5)), in_file);
    let kept = folder.path().join("kept");
    with_emitters(edited.world_mut(), &scenario).write(&kept).unwrap();

    let mut other = ready(scenario.clone());
    SavedScene::read(&kept).unwrap().restore(other.world_mut(), &scenario, &kept).unwrap();
    assert_eq!(volume(&mut other, None), 123.5);
    before.restore(other.world_mut(), &scenario, &kept).unwrap();
    assert_eq!(volume(&mut other, None), in_file);
    let changes = [
        ("volume_mm3:123.5", "volume_mm3:-1.0", "`settings.edited[0].text`"),
        ("stream: 0", "stream: 7", "`settings.edited[0].stream` is 7"),
    ];
    assert_refused(&mut other, &scenario, &kept, "edited:", &changes);
    assert_eq!(volume(&mut other, None), in_file);
}

#[test]
fn emitters_that_cannot_be_are_refused_by_field() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = Scenario::load(&ten_minutes(folder.path())).unwrap();
    let mut edited = with_a_tap(&scenario);
    let kept = folder.path().join("kept");
    with_emitters(edited.world_mut(), &scenario).write(&kept).unwrap();
    let mut other = ready(scenario.clone());
    let changes = [
        ("rate: 40.0", "rate: -1.0", "`settings.emitters[0].rate` is -1"),
        ("rate: 30.0", "rate: NaN", "`settings.emitters[1].rate` is NaN"),
        ("role: ByHand", "role: Added", "`settings.emitters"),
        ("role: Added", "role: Scripted", "`settings.emitters"),
        ("stream: 536870912", "stream: 0", "`settings.emitters[1].stream` is 0"),
        ("volume_mm3:500.0", "volume_mm3:-5.0", "`settings.effects[0]`"),
    ];
    assert_refused(&mut other, &scenario, &kept, "settings:", &changes);
    // Nothing has come of that.
    let world = other.world_mut();
    let mut added = world.query_filtered::<(), With<AddedEmitter>>();
    assert_eq!(added.iter(world).count(), 0);
}

#[test]
fn a_picture_does_not_change_what_is_saved_and_gone_on_with() {
    if crate::common::skips_gpu() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = ten_minutes(folder.path());
    let (numbers, drawn) = (folder.path().join("numbers"), folder.path().join("drawn"));
    run(replay(&file, "--no-render --seconds 8 --save-state").arg(&numbers)).assert_success();
    let mut command = replay(&file, "--fps 1 --size 32x32 --seconds 8 --save-state");
    run(command.arg(&drawn)).assert_success();
    for name in files_below(&numbers) {
        assert_eq!(fs::read(numbers.join(&name)).unwrap(), fs::read(drawn.join(&name)).unwrap(), "{name}");
    }
    let whole = run(&mut replay(&file, "--no-render --seconds 12")).report();
    let resumed = run(replay(&file, "--fps 1 --size 32x32 --seconds 12 --resume").arg(&drawn)).report();
    assert_eq!(outcome(&resumed), outcome(&whole));
}

#[test]
fn saved_scenes_that_do_not_fit_are_refused_by_file_and_field() {
    let folder = tempfile::tempdir().unwrap();
    let file = ten_minutes(folder.path());
    let kept = folder.path().join("kept");
    run(replay(&file, "--no-render --seconds 10 --save-state").arg(&kept)).assert_success();
    let out = folder.path().join("out");
    let refused = |named: &[&str]| {
        let mut command = replay(&file, "--no-render --seconds 20");
        run(command.arg("--resume").arg(&kept).arg("--out").arg(&out)).assert_refused(named, &out);
    };
    let state = kept.join("state.ron");
    let text = fs::read_to_string(&state).unwrap();
    for (was, is, named) in [
        ("version: 3", "version: 9", "`version` is 9"),
        ("hz: 20", "hz: 60", "`hz` is 60"),
        ("name: \"roof\"", "name: \"../roof\"", "`surfaces[0].name`"),
        ("size: 64", "size: 65", "`surfaces[0].size`"),
        ("seed: 0", "seeds: 0", "seeds"),
        ("alive: ", "alive: 1", "`counts.alive`"),
        ("humidity: 0.3", "humidity: 7.5", "`weather.humidity` is 7.5"),
        ("temperature_c: 24.0", "temperature_c: NaN", "`weather.temperature_c` is NaN"),
    ] {
        assert!(text.contains(was), "{was}");
        fs::write(&state, text.replacen(was, is, 1)).unwrap();
        refused(&["state.ron", named]);
    }
    fs::write(&state, &text).unwrap();
    let map = kept.join("floor_film.png");
    let bytes = fs::read(&map).unwrap();
    fs::write(&map, &bytes[..bytes.len() / 2]).unwrap();
    refused(&["floor_film.png"]);
    fs::remove_file(&map).unwrap();
    refused(&["floor_film.png"]);
    fs::write(&map, &bytes).unwrap();
    // Not so long.
    let mut command = replay(&file, "--no-render --seconds 9.9");
    run(command.arg("--resume").arg(&kept).arg("--out").arg(&out))
        .assert_refused(&["`seconds` is 9.9", "at least 10"], &out);
    // It has a seed.
    let mut command = replay(&file, "--no-render --seed 7");
    run(command.arg("--resume").arg(&kept).arg("--out").arg(&out)).assert_refused(&["--seed"], &out);
    // Another scenario.
    fs::write(&file, TEN_MINUTES.replace("rate: 160.0", "rate: 161.0")).unwrap();
    refused(&["state.ron", "`scenario`"]);
}

#[test]
fn folders_that_no_scene_can_be_saved_into_are_refused_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let file = ten_minutes(folder.path());
    let [kept, other, out] = ["kept", "other", "out"].map(|name| folder.path().join(name));
    run(replay(&file, "--no-render --seconds 1 --save-state").arg(&kept)).assert_success();
    let state = fs::read(kept.join("state.ron")).unwrap();
    fs::create_dir(&other).unwrap();
    fs::write(other.join("thesis.txt"), "mine").unwrap();
    let refused = |from: &Path, save: &Path, named: &[&str]| {
        let mut command = replay(&file, "--no-render --seconds 2");
        command.current_dir(from).arg("--save-state").arg(save).arg("--out").arg(&out);
        run(&mut command).assert_refused(named, &out);
    };
    refused(folder.path(), &other, &["other", "thesis.txt"]);
    refused(folder.path(), Path::new("other/../other/."), &["thesis.txt"]);
    refused(&kept, Path::new("."), &["cannot write .", "runs in"]);
    for save in [out.as_path(), &out.join("maps"), folder.path()] {
        refused(folder.path(), save, &["`save`", "of its own"]);
    }
    assert_eq!(fs::read_to_string(other.join("thesis.txt")).unwrap(), "mine");
    assert_eq!(fs::read(kept.join("state.ron")).unwrap(), state);
    // By another name of its own it is saved over.
    run(replay(&file, "--no-render --seconds 2 --save-state").arg(kept.join("."))).assert_success();
    assert_ne!(fs::read(kept.join("state.ron")).unwrap(), state);
    assert_eq!(files_below(folder.path()).iter().filter(|name| name.contains("saving")).count(), 0);
}

#[test]
fn pictures_of_before_it_was_saved_stay() {
    let folder = tempfile::tempdir().unwrap();
    let file = ten_minutes(folder.path());
    let (kept, out) = (folder.path().join("kept"), folder.path().join("out"));
    run(replay(&file, "--no-render --seconds 3 --save-state").arg(&kept)).assert_success();
    let frame = |number: u32| out.join(format!("frame_{number:05}.png"));
    fs::create_dir(&out).unwrap();
    for number in [0, 5, 6, 40] {
        fs::write(frame(number), "drawn").unwrap();
    }
    let mut command = replay(&file, "--no-render --fps 2 --seconds 4 --resume");
    run(command.arg(&kept).arg("--out").arg(&out)).assert_success();
    assert_eq!([0, 5, 6, 40].map(|number| frame(number).exists()), [true, true, false, false]);
    assert_eq!(read_report(&out)["timing"]["frames"], 0);
    // Without a scene to go on from it is another run.
    run(replay(&file, "--no-render --fps 2 --seconds 1 --out").arg(&out)).assert_success();
    assert!(!frame(0).exists() && !frame(5).exists());
}
