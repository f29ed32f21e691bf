//! Scenarios that name whole glTFs, and models by themselves: replayed, saved and gone on with, recorded, exported.

use std::fs;
use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::brush::{Brush, BrushKind, BrushQueue, Stroke};
use bevy_weathering::material::PorousMaterial;
use bevy_weathering::record::{Beginning, ExtraEmitter, Recording, begin, colors_at_hand, prepare, save};
use bevy_weathering::save::SavedScene;
use bevy_weathering::scenario::{EmitterKey, EmitterSpec, LoadedScenario, Scenario, scene_digest};
use serde_json::{Value, json};

use super::common::{scenario_app, scenario_surface, wait_until_ready};
use super::replay::{files_below, read_report, replay, run, surfaces};

/// What the surfaces of [`write_yard`] are called in a scene of this name.
const NAMES: [&str; 3] = ["yard.left", "yard.right", "yard.shelf"];

/// A floor of two instances of a slab, and above it a turned shelf without texture coordinates, smaller by its node.
fn write_yard(folder: &Path) -> PathBuf {
    let corners = [[-0.5f32, 0.0, -0.5], [0.5, 0.0, -0.5], [0.5, 0.0, 0.5], [-0.5, 0.0, 0.5]];
    let uvs = [[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let indices = [0u16, 2, 1, 0, 3, 2];
    let mut bytes: Vec<u8> = corners.as_flattened().iter().flat_map(|number| number.to_le_bytes()).collect();
    bytes.extend(uvs.as_flattened().iter().flat_map(|number| number.to_le_bytes()));
    bytes.extend(indices.iter().flat_map(|index| index.to_le_bytes()));
    fs::write(folder.join("yard.bin"), &bytes).unwrap();
    let yard = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 3] }],
        "nodes": [
            { "name": "floor", "children": [1, 2], "translation": [0.0, -0.1, 0.0] },
            { "name": "left", "mesh": 0, "translation": [-0.5, 0.0, 0.0] },
            { "name": "right", "mesh": 0, "translation": [0.5, 0.0, 0.0] },
            { "name": "shelf", "mesh": 1, "translation": [0.0, 0.3, 0.0], "scale": [0.3, 1.0, 0.3],
              "rotation": [0.0, 0.0, 0.17364818, 0.98480775] },
        ],
        "meshes": [
            { "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2, "material": 0 }] },
            { "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 2, "material": 1 }] },
        ],
        "materials": [
            { "name": "slab", "pbrMetallicRoughness": {
                "baseColorFactor": [0.25, 0.5, 0.75, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.7 } },
            { "name": "wood", "pbrMetallicRoughness": {
                "baseColorFactor": [0.5, 0.25, 0.125, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.4 } },
        ],
        "buffers": [{ "uri": "yard.bin", "byteLength": bytes.len() }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 32 },
            { "buffer": 0, "byteOffset": 80, "byteLength": 12 },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
              "min": [-0.5, 0.0, -0.5], "max": [0.5, 0.0, 0.5] },
            { "bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2" },
            { "bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR" },
        ],
    });
    let file = folder.join("yard.gltf");
    fs::write(&file, yard.to_string()).unwrap();
    file
}

const TAP: &str = "(volume_mm3: 40.0, stamp_radius: 0.05, diffuse: (color: (0.3, 0.2, 0.1), opacity: 0.5))";

/// Two seconds under a tap, in which one of the instances is touched and becomes another material.
fn write_scenario(folder: &Path) -> PathBuf {
    write_yard(folder);
    fs::write(folder.join("tap.effect.ron"), TAP).unwrap();
    let scenario = r#"(
        seconds: 2.0,
        tick_hz: 20,
        camera: (keys: [(eye: (0.0, 1.5, 2.5), target: (0.0, 0.0, 0.0))]),
        materials: {"clay": (porous: (sorptivity: 0.5))},
        scenes: [(name: "yard", file: "yard.gltf", rotation_deg: (0.0, 20.0, 0.0), porous: (capacity_mm: 1.0),
                  maps: (map_size: 64, wrap_u: Clamp, wrap_v: Clamp))],
        emitters: [(name: "tap", effect: "tap.effect.ron", rate: 300.0, speed: 2.0, spread_deg: 25.0,
                    keys: [(position: (0.0, 1.2, 0.0), target: (0.0, 0.0, 0.0))])],
        events: [
            (at: 0.5, what: Brush(kind: Wet, point: (0.5, -0.1, 0.0), radius: 0.3, strength: 0.4, surface: "yard.right")),
            (at: 1.0, what: Material(surface: "yard.right", material: "clay")),
            (at: 2.0, what: Expect(quantity: WaterMl, surface: "yard.shelf", above: 0.001)),
        ],
    )"#;
    let file = folder.join("scene.ron");
    fs::write(&file, scenario).unwrap();
    file
}

fn names(report: &Value) -> Vec<&str> {
    surfaces(report).iter().map(|surface| surface["name"].as_str().unwrap()).collect()
}

#[test]
fn a_scene_of_instances_is_wetted_and_its_digest_repeats() {
    let folder = tempfile::tempdir().unwrap();
    let file = write_scenario(folder.path());
    let out = folder.path().join("out");
    let mut first = replay(&file, "--no-render --threads 1 --out");
    run(first.arg(&out)).assert_success();
    let report = read_report(&out);
    assert_eq!(names(&report), NAMES);
    for surface in surfaces(&report) {
        assert!(surface["impacts"].as_u64() > Some(5) && surface["map_size"] == 64, "{surface}");
        assert_eq!(surface["triangles"], 2, "{surface}");
    }
    let columns = fs::read_to_string(out.join("series.csv")).unwrap();
    let maps = files_below(&out.join("maps"));
    for name in NAMES {
        assert!(columns.lines().next().unwrap().contains(&format!("{name}.film_ml")), "{columns}");
        assert!(maps.contains(&format!("{name}_wetness.png")), "{maps:?}");
    }
    for threads in ["1", "2"] {
        let again = run(&mut replay(&file, &format!("--no-render --threads {threads}"))).report();
        for field in ["digest", "surfaces", "particles", "water"] {
            assert_eq!(again[field], report[field], "{field} with {threads}");
        }
    }
}

#[test]
fn a_scene_that_was_saved_goes_on_to_the_same_digest() {
    let folder = tempfile::tempdir().unwrap();
    let file = write_scenario(folder.path());
    let kept = folder.path().join("kept");
    let whole = run(&mut replay(&file, "--no-render")).report();
    run(replay(&file, "--no-render --seconds 1.2 --save-state").arg(&kept)).assert_success();
    let resumed = run(replay(&file, "--no-render --resume").arg(&kept)).report();
    for field in ["digest", "surfaces", "particles", "water", "ticks"] {
        assert_eq!(resumed[field], whole[field], "{field}");
    }
}

/// The JSON of a binary glTF.
fn json_of(glb: &Path) -> Value {
    let bytes = fs::read(glb).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&bytes[20..20 + length]).unwrap()
}

#[test]
fn what_is_exported_has_the_materials_of_the_file_with_and_without_a_renderer() {
    let folder = tempfile::tempdir().unwrap();
    let file = write_scenario(folder.path());
    let render = !std::env::var("WEATHERING_SKIP_GPU").is_ok_and(|value| value == "1");
    let options = ["--no-render", "--size 32x32 --fps 1"];
    for (number, options) in options.into_iter().take(1 + usize::from(render)).enumerate() {
        let out = folder.path().join(number.to_string());
        // Before the material of the scenario takes the place of that of the file.
        let mut command = replay(&file, &format!("{options} --seconds 0.5 --export"));
        let outcome = run(command.arg(&out).env("XDG_RUNTIME_DIR", folder.path()));
        // What is expected of the end need not hold in the middle.
        assert!(matches!(outcome.code, Some(0 | 1)), "{}", outcome.stderr);
        let scene = json_of(&out.join("scene_weathered.glb"));
        let nodes = scene["nodes"].as_array().unwrap();
        assert_eq!(nodes.iter().filter(|node| node["mesh"].is_u64()).count(), 3, "{options}: {scene}");
        let colors: Vec<&Value> = scene["materials"]
            .as_array()
            .unwrap()
            .iter()
            .map(|material| &material["pbrMetallicRoughness"]["baseColorFactor"])
            .collect();
        for color in [json!([0.25, 0.5, 0.75, 1.0]), json!([0.5, 0.25, 0.125, 1.0])] {
            assert!(colors.contains(&&color), "{options}: {color} in {colors:?}");
        }
    }
    if !render {
        eprintln!("skipped with a renderer: needs a GPU, and WEATHERING_SKIP_GPU=1");
    }
}

#[test]
fn broken_files_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let file = write_scenario(folder.path());
    let out = folder.path().join("out");
    let model = folder.path().join("yard.gltf");
    let whole = fs::read_to_string(&model).unwrap();
    for (was, is, named) in [
        ("\"mesh\":0", "\"mesh\":7", "`scenes[0].file`"),
        ("yard.bin", "../yard.bin", "scenes[0].file -> buffers"),
        ("\"nodes\":[0,3]", "\"nodes\":[]", "show no mesh"),
    ] {
        assert!(whole.contains(was), "{was} in {whole}");
        fs::write(&model, whole.replacen(was, is, 1)).unwrap();
        let mut command = replay(&file, "--no-render --out");
        run(command.arg(&out)).assert_refused(&["scene.ron", named], &out);
    }
    fs::write(&model, &whole).unwrap();
    fs::remove_file(folder.path().join("yard.bin")).unwrap();
    let mut command = replay(&file, "--no-render --out");
    run(command.arg(&out)).assert_refused(&["scene.ron", "yard.bin"], &out);
}

fn run_ticks(app: &mut App, ticks: u32) {
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    for _ in 0..ticks {
        app.update();
    }
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
}

fn paint(app: &mut App, name: &str, x: f32) {
    let surface = Some(scenario_surface(app.world_mut(), name));
    let brush = Brush { kind: BrushKind::Wet, point: Vec3::new(x, -0.1, 0.1), radius: 0.3, strength: 0.4 };
    app.world_mut().resource_mut::<BrushQueue>().0.push(Stroke { brush, surface });
}

/// A tap over the scene, as the hose in the hand of the sandbox.
fn hose() -> ExtraEmitter {
    let key = EmitterKey { t: 0.0, position: Vec3::new(0.1, 1.2, 0.0), target: Vec3::ZERO };
    let spec = EmitterSpec {
        name: "hose".into(),
        effect: String::new(),
        rate: 200.0,
        shape: default(),
        flow: default(),
        speed: Some(2.0),
        spread_deg: 20.0,
        lifetime: 2.0,
        start: 0.0,
        stop: None,
        keys: vec![key],
    };
    ExtraEmitter { spec, effect: TAP.into(), is_on: true }
}

#[test]
fn a_model_by_itself_is_recorded_and_replays_to_the_same_digest() {
    let folder = tempfile::tempdir().unwrap();
    let model = write_yard(folder.path());
    let loaded = LoadedScenario::of_model(&model).unwrap();
    // In another folder, with all that it takes.
    let recorded = folder.path().join("recorded");
    let beginning = Beginning { emitters: vec![hose()], ..default() };
    let base = prepare(&loaded, beginning, &recorded).unwrap();
    assert!(recorded.join("yard.gltf").is_file() && recorded.join("yard.bin").is_file());
    let mut app = scenario_app(base.clone());
    begin(app.world_mut(), base);
    wait_until_ready(&mut app);
    run_ticks(&mut app, 30);
    paint(&mut app, "yard.right", 0.5);
    run_ticks(&mut app, 20);
    let left = scenario_surface(app.world_mut(), "yard.left");
    app.world_mut().get_mut::<PorousMaterial>(left).unwrap().sorptivity = 0.4;
    run_ticks(&mut app, 40);
    let (digest, file) = (scene_digest(app.world_mut()), save(app.world_mut()).unwrap());
    assert_eq!(app.world().resource::<Recording>().flaws().count(), 0);
    assert!(file.starts_with(&recorded), "{}", file.display());
    // The folder that it came from is not needed.
    fs::remove_file(&model).unwrap();
    let report = run(&mut replay(&file, "--no-render")).report();
    assert_eq!(report["digest"].as_str(), Some(digest.as_str()));
    assert!(surfaces(&report).iter().all(|surface| surface["impacts"].as_u64() > Some(0)), "{report}");
    // What is recorded is a scenario like others.
    let again = Scenario::load(&file).unwrap();
    assert!(again.scenario.surface_names().eq(NAMES) && again.check_content().unwrap() == 6);
}

#[test]
fn a_model_by_itself_is_saved_and_gone_on_with() {
    let folder = tempfile::tempdir().unwrap();
    let loaded = LoadedScenario::of_model(&write_yard(folder.path())).unwrap();
    let kept = folder.path().join("kept");
    let mut first = scenario_app(loaded.clone());
    wait_until_ready(&mut first);
    paint(&mut first, "yard.left", -0.5);
    run_ticks(&mut first, 30);
    let colors = colors_at_hand(first.world_mut()).unwrap();
    SavedScene::capture(first.world_mut(), &loaded, colors).write(&kept).unwrap();
    run_ticks(&mut first, 30);

    let mut second = scenario_app(loaded.clone());
    wait_until_ready(&mut second);
    SavedScene::read(&kept).unwrap().restore(second.world_mut(), &loaded, &kept).unwrap();
    run_ticks(&mut second, 30);
    assert_eq!(scene_digest(second.world_mut()), scene_digest(first.world_mut()));
    // Of another model it is not.
    let other = folder.path().join("other.gltf");
    fs::copy(folder.path().join("yard.gltf"), &other).unwrap();
    let stranger = LoadedScenario::of_model(&other).unwrap();
    let refused = SavedScene::read(&kept).unwrap().restore(second.world_mut(), &stranger, &kept);
    assert!(refused.unwrap_err().to_string().contains("`scenario`"));
}
