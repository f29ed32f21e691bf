//! What a replay refuses, and how it says so: by file, field and value, and with nothing written.

use std::fs;
use std::process::Command;

use super::replay::{EFFECT, HOSE, MESH, Tree, VASE, files_below, replay, run};

#[test]
fn bad_scenarios_are_refused_by_file_field_and_value() {
    let tree = Tree::new();
    let out = tree.path("out");
    let absolute = format!("{:?}", tree.path("outside/tap.effect.ron"));
    let inside = tree.path("tree/effects/tap.effect.ron");
    let absolute_inside = format!("{inside:?}");
    let cases: &[(&str, &str, &[&str])] = &[
        // Shape.
        ("speed: 1.0", "speed 1.0", &[":20:", "colon"]),
        ("seconds: 1.0", "seconds: 1.0, wetness: 0.5", &[":2:", "`wetness`"]),
        ("speed: 1.0,", "", &["`emitters[0].speed`", "not given"]),
        ("rate: 200.0", "rate: \"many\"", &[":19:", "float"]),
        ("max_particles: 1000", "max_particles: 99999999999", &[":3:", "out of bounds"]),
        // Numbers.
        ("rate: 200.0", "rate: NaN", &["`emitters[0].rate`", "NaN"]),
        ("rate: 200.0", "rate: -5.0", &["`emitters[0].rate`", "-5"]),
        ("speed: 1.0", "speed: inf", &["`emitters[0].speed`", "inf"]),
        ("seconds: 1.0", "seconds: inf", &["`seconds`", "inf"]),
        ("seconds: 1.0", "seconds: -1.0", &["`seconds`", "-1"]),
        ("seconds: 1.0", "seconds: 1.0, tick_hz: 0", &["`tick_hz`", "0"]),
        ("max_particles: 1000", "max_particles: 10000001", &["`max_particles`", "10000001"]),
        ("scale: (1.0, 1.0, 1.0)", "scale: (1.0, 0.0, 1.0)", &["`surfaces[0].scale`", "[1, 0, 1]"]),
        ("scale: (1.0, 1.0, 1.0)", "scale: (1.0, NaN, 1.0)", &["`surfaces[0].scale.y`", "NaN"]),
        ("map_size: 256", "map_size: 100000", &["`surfaces[0].maps.map_size`", "100000"]),
        ("seconds: 1.0", "seconds: 1.0, map_budget: (mib: 0.0)", &["`map_budget.mib`", "above 0"]),
        ("seconds: 1.0", "seconds: 1.0, map_budget: (mib: 70000.0)", &["`map_budget.mib`", "70000"]),
        ("seconds: 1.0", "seconds: 1.0, map_budget: (texel_mm: NaN)", &["`map_budget.texel_mm`", "NaN"]),
        ("seconds: 1.0", "seconds: 1.0, map_budget: (bytes: 3)", &[":2:", "`bytes`"]),
        ("map_size: 256", "map_size: 100", &["`surfaces[0].maps.map_size`", "100"]),
        ("(2, 2)", "(0, 2)", &["`surfaces[0].mesh`", "0 triangles"]),
        ("(2, 2)", "(100000, 100000)", &["`surfaces[0].mesh`", "20000000000 triangles"]),
        ("(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))", "", &["`camera.keys`", "empty"]),
        ("(0.0, 0.2, 0.0)", "(0.0, 0.0, 0.0)", &["`emitters[0].keys[0].target`", "[0, 0, 0]"]),
        // Names.
        ("\"ground\"", "\"../ground\"", &["`surfaces[0].name`", "../ground"]),
        ("material: \"plain\"", "material: \"gold\"", &["`surfaces[0].material`", "gold"]),
        // Files.
        (MESH, "File(\"models/none.glb\")", &["`surfaces[0].mesh`", "models/none.glb", "no such file"]),
        (MESH, "File(\"models/text.glb\")", &["`surfaces[0].mesh`", "models/text.glb"]),
        (MESH, "File(\"models/cut.glb\")", &["`surfaces[0].mesh`", "models/cut.glb"]),
        (MESH, "File(\"models\")", &["`surfaces[0].mesh`", "\"models\""]),
        (EFFECT, "\"effects/none.effect.ron\"", &["`emitters[0].effect`", "effects/none.effect.ron"]),
        (EFFECT, "\"effects/unknown.effect.ron\"", &["effects/unknown.effect.ron", " 2:", "`wetness`"]),
        (EFFECT, "\"effects/nan.effect.ron\"", &["effects/nan.effect.ron", "`bump`", "NaN"]),
        // Ways out.
        (EFFECT, "\"../../etc/passwd\"", &["`emitters[0].effect`", "../../etc/passwd", "outside"]),
        (EFFECT, "\"../outside/tap.effect.ron\"", &["`emitters[0].effect`", "../outside/tap", "outside"]),
        (EFFECT, &absolute, &["`emitters[0].effect`", &absolute, "outside"]),
        (EFFECT, &absolute_inside, &["`emitters[0].effect`", &absolute_inside, "outside"]),
        (MESH, "File(\"/etc/passwd\")", &["`surfaces[0].mesh`", "/etc/passwd", "outside"]),
        #[cfg(unix)]
        (EFFECT, "\"effects/link.effect.ron\"", &["`emitters[0].effect`", "link.effect.ron", "outside"]),
    ];
    for &(from, to, named) in cases {
        let file = tree.spoilt(from, to);
        let outcome = run(replay(&file, "--no-render --out").arg(&out));
        let message = format!("error: {}:", file.display());
        outcome.assert_refused(&[&[message.as_str()], named].concat(), &out);
    }
    // Without the fault it runs.
    run(replay(tree.tap(), "--no-render --out").arg(&out)).assert_success();
    assert!(out.exists());
}

#[test]
fn what_is_no_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for file in [folder.path().join("none.ron"), folder.path().to_owned()] {
        let outcome = run(replay(&file, "--no-render --out").arg(&out));
        outcome.assert_refused(&[&file.display().to_string(), "cannot be read"], &out);
    }
}

#[test]
fn options_out_of_range_are_refused_by_name_and_value() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for (options, named) in [
        ("--seconds NaN", ["`seconds`", "NaN"]),
        ("--seconds inf", ["`seconds`", "inf"]),
        ("--seconds 0", ["`seconds`", "0"]),
        ("--threads 0", ["`threads`", "0"]),
        ("--fps 0", ["`fps`", "0"]),
        ("--size 0x64", ["`size`", "0x64"]),
        ("--size 96x100000", ["`size`", "96x100000"]),
        ("--size 96", ["--size", "96"]),
    ] {
        let outcome = run(replay(VASE, "--no-render --out").arg(&out).args(options.split_whitespace()));
        outcome.assert_refused(&named, &out);
    }
}

#[test]
fn without_a_driver_it_says_what_to_install() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut command = replay(HOSE, "--seconds 1 --out");
    let command = command
        .arg(&out)
        .env("XDG_RUNTIME_DIR", folder.path())
        .env("WGPU_BACKEND", "vulkan")
        // The old and the new name of the variable.
        .env("VK_ICD_FILENAMES", "/nonexistent")
        .env("VK_DRIVER_FILES", "/nonexistent");
    run(command).assert_refused(&["mesa-vulkan-drivers", "--no-render"], &out);
}

#[test]
fn a_folder_that_cannot_be_made_is_named() {
    let tree = Tree::new();
    let file = tree.path("file");
    fs::write(&file, "mine").unwrap();
    let out = file.join("out");
    let before = files_below(tree.0.path());
    let outcome = run(replay(tree.tap(), "--no-render --out").arg(&out));
    outcome.assert_refused(&["cannot write", &out.display().to_string()], &out);
    assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
    assert_eq!(files_below(tree.0.path()), before);
}

/// A glTF may name further files; those must stay inside, too.
#[test]
fn a_gltf_cannot_reach_out_of_the_tree() {
    let outside = tempfile::tempdir().unwrap();
    let tree = outside.path().join("tree");
    fs::create_dir_all(&tree).unwrap();
    fs::write(outside.path().join("secret.bin"), [0; 64]).unwrap();
    let scenario = r#"(
        seconds: 0.1,
        camera: (keys: [(eye: (0.0, 1.5, 3.0), target: (0.0, 0.0, 0.0))]),
        materials: {"clay": ()},
        surfaces: [(name: "mesh", mesh: File("mesh.gltf"), material: "clay")],
    )"#;
    fs::write(tree.join("scene.ron"), scenario).unwrap();
    for uri in ["../secret.bin", "%2e%2e/secret.bin", "/etc/hostname"] {
        let gltf = format!(
            r#"{{"asset": {{"version": "2.0"}}, "buffers": [{{"uri": "{uri}", "byteLength": 64}}]}}"#
        );
        fs::write(tree.join("mesh.gltf"), gltf).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_weathering"))
            .args(["replay", "--no-render"])
            .arg(tree.join("scene.ron"))
            .output()
            .unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{uri}: {message}");
        assert!(message.contains("outside the scenario's tree") && message.contains("buffers"), "{message}");
    }
}
