//! Scenarios that are exported at their end, and on the way there.

use std::fs;
use std::path::{Path, PathBuf};

use image::{Rgb, RgbImage};
use serde_json::Value;

use super::rules::Glb;
use crate::replay::{HOSE, read_report, replay, run};

/// A shape that code makes and one from a file, with a photo, a stone that is grown, and a change of what one is made of.
const SCENARIO: &str = r#"(
    seconds: 1.0,
    tick_hz: 30,
    camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.3, 0.0))]),
    materials: {
        "paving": (texture: Photo("paving.png"), tiles: (4.0, 4.0), porous: (t_fill: 0.0)),
        "stone": (texture: Stone(kind: Sandstone, size: 64, seed: 1), reflectance: 0.35),
        "clay": (color: (0.5, 0.2, 0.1)),
    },
    surfaces: [
        (name: "ground", mesh: Ground(size: (2.0, 2.0), cells: (2, 2)), material: "paving", maps: (map_size: 128)),
        (name: "bunny", mesh: File("bunny.glb"), material: "clay", maps: (map_size: 128)),
    ],
    emitters: [(name: "hose", effect: "hose.effect.ron", rate: 300.0, shape: Cone(radius: 0.01), speed: 6.0,
        spread_deg: 12.0, keys: [(position: (0.3, 1.2, 1.5), target: (0.0, 0.2, 0.0))])],
    events: [(at: 0.5, what: Material(surface: "bunny", material: "stone"))],
)"#;

/// Writes the scenario with all that it names.
fn garden(folder: &Path) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    fs::copy(root.join("models/bunny_1000.glb"), folder.join("bunny.glb")).unwrap();
    fs::copy(root.join("effects/hose.effect.ron"), folder.join("hose.effect.ron")).unwrap();
    let texel = |x: u32, y: u32| {
        if (x / 4 + y / 4).is_multiple_of(2) { Rgb([150, 140, 130]) } else { Rgb([90, 85, 80]) }
    };
    RgbImage::from_fn(16, 16, texel).save(folder.join("paving.png")).unwrap();
    let file = folder.join("garden.ron");
    fs::write(&file, SCENARIO).unwrap();
    file
}

#[test]
fn a_scenario_at_its_end_is_a_scene_with_or_without_a_renderer() {
    let folder = tempfile::tempdir().unwrap();
    let file = garden(folder.path());
    let [plain, drawn, out] = ["plain", "drawn", "out"].map(|name| folder.path().join(name));
    let mut without = replay(&file, "--no-render");
    run(without.arg("--export").arg(&plain).arg("--out").arg(&out)).assert_success();
    let bytes = fs::read(plain.join("garden_weathered.glb")).unwrap();
    super::keep("garden", &bytes, &bytes);
    let glb = Glb::parse(&bytes);
    glb.check();
    let dry = |node: usize| {
        let mappings =
            &super::bake::primitive(&glb, node)["extensions"]["KHR_materials_variants"]["mappings"];
        glb.list("materials")[super::rules::count(&mappings[0]["material"])].clone()
    };
    let [paving, stone] = [dry(0), dry(1)];
    assert!(
        paving["normalTexture"].is_null() && paving["pbrMetallicRoughness"]["baseColorTexture"].is_object()
    );
    // What it is made of by then; its bumps are not drawn, since its file has no tangents.
    assert!(
        stone["normalTexture"].is_null() && stone["extensions"]["KHR_materials_ior"].is_object(),
        "{stone}"
    );

    let (report, replayed) = (read_report(&plain), read_report(&out));
    let rows = |report: &Value, field: &str| -> Vec<Value> {
        report["surfaces"].as_array().unwrap().iter().map(|surface| surface[field].clone()).collect()
    };
    for field in ["name", "received_mm3", "film_mm3", "absorbed_mm3", "wet_fraction", "impacts"] {
        assert_eq!(rows(&report, field), rows(&replayed, field), "{field}");
    }
    assert!(rows(&report, "impacts").iter().all(|impacts| impacts.as_u64() > Some(0)), "{report}");
    assert_eq!(report["water"], replayed["water"]);
    assert!(report["rain_mm_per_h"].is_null() && report["scene"] == "garden.ron");
    for name in ["ground", "bunny"] {
        let map = format!("maps/{name}_wetness.png");
        assert_eq!(fs::read(plain.join(&map)).unwrap(), fs::read(out.join(&map)).unwrap(), "{map}");
    }

    if crate::common::skips_gpu() {
        return;
    }
    // What was painted on the GPU and drawn is the same scene, to the byte.
    let mut with = replay(&file, "--size 64x48 --fps 1");
    run(with.arg("--export").arg(&drawn).env("XDG_RUNTIME_DIR", folder.path())).assert_success();
    assert_eq!(read_report(&drawn), report);
    assert!(fs::read(drawn.join("garden_weathered.glb")).unwrap() == bytes);
}

#[test]
fn a_scene_on_the_way_is_what_a_run_until_then_ends_with() {
    let folder = tempfile::tempdir().unwrap();
    let file = garden(folder.path());
    let events = r#"events: [(at: 0.5, what: Export("half")), (at: 1.0, what: Export("end")), "#;
    fs::write(&file, SCENARIO.replace("events: [", events)).unwrap();
    let [until, end, out] = ["until", "end", "out"].map(|name| folder.path().join(name));
    // Of an earlier run.
    fs::create_dir_all(out.join("export_old")).unwrap();
    fs::write(out.join("export_old/garden_weathered.glb"), "old").unwrap();
    let mut whole = replay(&file, "--no-render");
    run(whole.arg("--export").arg(&end).arg("--out").arg(&out)).assert_success();
    let mut half = replay(&file, "--no-render --seconds 0.5");
    run(half.arg("--export").arg(&until)).assert_success();
    for (name, alone) in [("export_half", &until), ("export_end", &end)] {
        let on_the_way = out.join(name);
        assert_eq!(read_report(&on_the_way), read_report(alone), "{name}");
        for file in ["garden_weathered.glb", "maps/ground_film.png", "maps/bunny_wetness.png"] {
            assert!(
                fs::read(on_the_way.join(file)).unwrap() == fs::read(alone.join(file)).unwrap(),
                "{name}: {file}"
            );
        }
    }
    let glb = |name: &str| fs::read(out.join(name).join("garden_weathered.glb")).unwrap();
    assert!(glb("export_half") != glb("export_end"), "time has gone on");
    assert!(!out.join("export_old").exists());
    // Looking changes nothing, and without a folder there is nothing to look for.
    let digest = |report: &Value| report["digest"].as_str().unwrap().to_owned();
    let without = run(&mut replay(&file, "--no-render")).report();
    fs::write(&file, SCENARIO).unwrap();
    let plain = run(&mut replay(&file, "--no-render")).report();
    assert_eq!(digest(&without), digest(&plain));
    assert_eq!(digest(&read_report(&out)), digest(&plain));
}

#[test]
fn folders_that_are_in_use_and_batches_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [out, state] = ["out", "state"].map(|name| folder.path().join(name));
    let mut same = replay(HOSE, "--no-render --seconds 1");
    run(same.arg("--export").arg(&out).arg("--out").arg(&out)).assert_refused(&["`export`"], &out);
    let mut inside = replay(HOSE, "--no-render --seconds 1");
    inside.arg("--export").arg(state.join("scene")).arg("--save-state").arg(&state);
    run(&mut inside).assert_refused(&["`export`"], &state);
    let mut batch = replay(HOSE, "--no-render --jobs 2");
    run(batch.arg("--export").arg(&state).arg("--out").arg(&out)).assert_refused(&["--export"], &out);
    // A file where the folder should be is found before the run.
    let file = folder.path().join("file");
    fs::write(&file, "mine").unwrap();
    let mut taken = replay(HOSE, "--no-render --seconds 1");
    run(taken.arg("--export").arg(file.join("scene")).arg("--out").arg(&out)).assert_refused(&["file"], &out);
}
