//! What a scenario may ask for, how deep a file may nest, and that nothing leads out of its folder.

use std::path::Path;

use bevy_weathering::effect::WeatherEffect;
use bevy_weathering::scenario::Scenario;

use super::harness::fuzz;
use super::scenarios::{SMALL, tree};
use super::write;

/// Why [`SMALL`] with one thing changed is refused.
fn refusal(tree: &Path, from: &str, to: &str) -> String {
    assert!(SMALL.contains(from), "{from}");
    let file = tree.join("scenarios/spoilt.ron");
    write(&file, SMALL.replacen(from, to, 1));
    match Scenario::load(&file).and_then(|loaded| loaded.check_content()) {
        Ok(_) => panic!("{to:.100} is accepted"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn what_is_too_much_is_refused_with_what_is_allowed() {
    let tree = tree();
    let tree = tree.path();
    let ground = "Ground(size: (1.0, 1.0), cells: (2, 2))";
    let surface = |mesh: &str, number: usize, size: u32| {
        format!("(name: \"s{number}\", mesh: {mesh}, material: \"glaze\", maps: (map_size: {size})),")
    };
    let surfaces = |count, mesh: &str, size| -> String {
        (0..count).map(|number| surface(mesh, number, size)).collect()
    };
    let materials: String = (0..300).map(|number| format!("\"m{number}\": (),")).collect();
    let large = "Ground(size: (1.0, 1.0), cells: (3000, 3000))";
    // Of its triangles 64 bits hold all but 2^64: 18,657,454, which would be allowed.
    let absurd = "Ground(size: (1.0, 1.0), cells: (2147516345, 4294901903))";
    let cases: &[(&str, &str, &[&str])] = &[
        ("max_particles: 500", "max_particles: 10000001", &["`max_particles`", "10000000"]),
        ("seconds: 2.0", "seconds: 86401.0", &["`seconds`", "86400"]),
        ("map_size: 32", "map_size: 4096", &["`surfaces[0].maps.map_size`", "2048"]),
        ("rate: 60.0", "rate: 1e8", &["`emitters[0].rate`", "10000000"]),
        (ground, "Ground(size: (1.0, 1.0), cells: (4000, 4000))", &["`surfaces[0].mesh`", "MAX_TRIANGLES"]),
        (ground, absurd, &["`surfaces[0].mesh`", "MAX_TRIANGLES"]),
        (ground, "Vase(height: 1.0, segments: 4294967295, rings: 4294967295)", &["MAX_TRIANGLES"]),
        (
            "surfaces: [",
            &format!("surfaces: [{}", surfaces(6, large, 32)),
            &["`surfaces`", "MAX_ALL_TRIANGLES"],
        ),
        (
            "surfaces: [",
            &format!("surfaces: [{}", surfaces(300, ground, 2048)),
            &["`surfaces`", "MAX_TEXELS"],
        ),
        (
            "surfaces: [",
            &format!("surfaces: [{}", surfaces(10_000, ground, 16)),
            &["`surfaces`", "MAX_SURFACES"],
        ),
        (
            "surfaces: [",
            &format!("materials: {{{materials}}}, surfaces: ["),
            &["`materials`", "MAX_MATERIALS"],
        ),
    ];
    for (from, to, named) in cases {
        let message = refusal(tree, from, to);
        assert!(message.contains("spoilt.ron"), "{message:.300}");
        for name in *named {
            assert!(message.contains(name), "no {name} in: {message:.300}");
        }
    }
    let file = tree.join("scenarios/spoilt.ron");
    write(&file, SMALL);
    Scenario::load(&file).expect("it is whole").check_content().expect("it is whole");
    write(&file, " ".repeat(Scenario::MAX_FILE_BYTES as usize + 1));
    assert!(Scenario::load(&file).expect_err("it is too large").to_string().contains("MAX_FILE_BYTES"));
    let effect = WeatherEffect::from_ron(" ".repeat(WeatherEffect::MAX_FILE_BYTES as usize + 1).as_bytes());
    assert!(effect.expect_err("it is too large").to_string().contains("MAX_FILE_BYTES"));
}

#[test]
fn textures_are_as_large_as_is_allowed() {
    let tree = tree();
    let tree = tree.path();
    let wide = image::GrayImage::new(Scenario::MAX_TEXTURE + 1, 1);
    wide.save(tree.join("wide.png")).expect("it can be written");
    for (from, to) in [
        ("{\"tap\": (lifetime: 1.5)}", "{}, materials: {\"photo\": (texture: Photo(\"wide.png\"))}"),
        ("map_size: 32)),", "map_size: 32), wet_map: (map: \"wide.png\", seconds: 1.0)),"),
    ] {
        let message = refusal(tree, from, to);
        assert!(message.contains("wide.png") && message.contains("at most 8192"), "{message}");
    }
}

#[test]
fn deep_files_are_refused_and_the_stack_holds() {
    let tree = tree();
    let file = tree.path().join("scenarios/spoilt.ron");
    let depths = [20, 60, 128, 1000, 100_000];
    let tally = fuzz("deep files", 2 * depths.len(), move |number, _| {
        let _ = &tree;
        let depth = depths[number / 2];
        let (open, close) =
            [("(variants: {\"a\": ", "})"), ("(events: [(at: 0.0, what: Brush(", ")])")][number % 2];
        write(&file, format!("{}(){}", open.repeat(depth), close.repeat(depth)));
        Scenario::load(&file).map(drop).map_err(|error| error.to_string())
    });
    assert_eq!(tally.accepted, 0, "{tally:?}");
}

/// Every field that names a file, as a change of [`SMALL`]; `PATH` stands for what it names.
static PATHS: [(&str, &str, &str); 8] = [
    ("\"effects/rain.effect.ron\"", "\"PATH\"", "emitters[0].effect"),
    ("Ground(size: (1.0, 1.0), cells: (2, 2))", "File(\"PATH\")", "surfaces[0].mesh"),
    ("\"parts/materials.ron\"", "\"parts/materials.ron\", \"PATH\"", "include[1]"),
    (
        "{\"tap\": (lifetime: 1.5)}",
        "{}, materials: {\"a\": (texture: Photo(\"PATH\"))}",
        "materials.a.texture",
    ),
    (
        "{\"tap\": (lifetime: 1.5)}",
        "{}, materials: {\"a\": (surface: File(\"PATH\"))}",
        "materials.a.surface",
    ),
    ("{\"tap\": (lifetime: 1.5)}", "{}, materials: {\"a\": (wet_color: \"PATH\")}", "materials.a.wet_color"),
    ("map_size: 32)),", "map_size: 32), wet_map: (map: \"PATH\", seconds: 1.0)),", "surfaces[1].wet_map.map"),
    ("seed: 3,", "seed: 3, environment: (map: \"PATH\"),", "environment.map"),
];

#[test]
fn no_path_leads_out_of_the_tree_and_no_device_is_opened() {
    let home = tempfile::tempdir().expect("a temporary folder");
    let tree = tree();
    write(&home.path().join("secret.bin"), "secret");
    let secret = home.path().join("secret.bin").canonicalize().expect("it is there");
    let absolute = secret.display().to_string();
    let up = format!("{}{}", "../".repeat(40), absolute.trim_start_matches('/'));
    let through = format!("effects/{up}");
    let mut ways =
        vec![absolute, up, through, "effects/../../x".into(), String::new(), "/".into(), "..".into()];
    // No way out, but no file either.
    let mut odd = vec!["effects", ".", "a\\\\..\\\\b", "\\u{0}", "//effects/rain.effect.ron"];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&secret, tree.path().join("link")).expect("a new link");
        std::os::unix::fs::symlink(home.path(), tree.path().join("folder")).expect("a new link");
        std::os::unix::fs::symlink(tree.path().join("link"), tree.path().join("chain")).expect("a new link");
        ways.extend(["link", "chain", "folder/secret.bin", "./folder/./secret.bin"].map(String::from));
        let pipe = tree.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(pipe).status().expect("mkfifo runs");
        assert!(made.success());
        odd.push("pipe");
    }
    let cases: Vec<_> = PATHS
        .iter()
        .flat_map(|path| {
            let out = ways.iter().map(move |way| (path, way.clone(), true));
            out.chain(odd.iter().map(move |way| (path, (*way).to_owned(), false)))
        })
        .collect();
    let count = cases.len();
    let tally = fuzz("paths", count, move |number, _| {
        let _ = &home;
        let ((from, to, field), way, is_outside) = &cases[number];
        let message = refusal(tree.path(), from, &to.replace("PATH", way));
        assert!(message.contains(&format!("`{field}`")), "{way}: {message}");
        assert!(!is_outside || message.contains("outside"), "{way}: {message}");
        Err(message)
    });
    assert_eq!(tally.refused, count, "{tally:?}");
}

#[test]
#[cfg(unix)]
fn files_that_files_name_stay_inside_too() {
    let home = tempfile::tempdir().expect("a temporary folder");
    let tree = tree();
    write(&home.path().join("secret.bin"), "secret");
    std::os::unix::fs::symlink(home.path(), tree.path().join("models/folder")).expect("a new link");
    std::os::unix::fs::symlink(home.path(), tree.path().join("effects/folder")).expect("a new link");
    for way in ["../../secret.bin", "/etc/hostname", "folder/secret.bin", "%2e%2e/%2e%2e/secret.bin"] {
        for list in ["buffers", "images"] {
            let gltf = format!(
                r#"{{"asset": {{"version": "2.0"}}, "{list}": [{{"uri": "{way}", "byteLength": 6}}]}}"#
            );
            write(&tree.path().join("models/reaching.gltf"), gltf);
            let message = refusal(tree.path(), PATHS[1].0, "File(\"models/reaching.gltf\")");
            assert!(message.contains("outside") && message.contains(list), "{way}: {message}");
        }
        if way.contains('%') {
            continue;
        }
        let effect =
            format!("(stamps: Images(diffuse: \"{way}\", specular: None, normal: None, variants: 1))");
        write(&tree.path().join("effects/reaching.effect.ron"), effect);
        let message = refusal(tree.path(), PATHS[0].0, "\"effects/reaching.effect.ron\"");
        assert!(message.contains("outside"), "{way}: {message}");
    }
}
