//! `weathering wetmap`, run as its users run it.

use std::f32::consts::TAU;
use std::path::Path;
use std::process::{Command, Output};

use bevy_weathering::wetmap::{GreyMap, read_map};
use image::{Rgb, RgbImage};

fn wetmap(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_weathering"));
    command.current_dir(folder).arg("wetmap").args(arguments.split_whitespace());
    command.output().expect("the program runs")
}

/// The map that these arguments write.
fn map(folder: &Path, arguments: &str, out: &str) -> GreyMap {
    let output = wetmap(folder, &format!("{arguments} --out {out}"));
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).ends_with(&format!("{out}\n")), "{arguments}");
    read_map(&folder.join(out)).unwrap()
}

/// Part of the texels above 0.
fn coverage(map: &GreyMap) -> f32 {
    map.values.iter().filter(|&&value| value > 0.0).count() as f32 / map.values.len() as f32
}

/// A tiled floor of 96 by 64 pixels, and the same with a disc of radius 20 in its middle darker by half.
fn photos(folder: &Path) {
    let picture = |wet: bool| {
        RgbImage::from_fn(96, 64, |x, y| {
            let tile = if (x / 8 + y / 8) % 2 == 0 { 200.0 } else { 150.0 };
            let grain = 12.0 * (f32::from((x * 7 + y * 13) as u16 % 11) / 11.0 * TAU).sin();
            let in_disc = (x as f32 - 47.5).hypot(y as f32 - 31.5) < 20.0;
            // In sRGB: about half the light.
            let seen = (tile + grain) * if wet && in_disc { 0.73 } else { 1.0 };
            Rgb([seen as u8, (0.8 * seen) as u8, (0.6 * seen) as u8])
        })
    };
    picture(false).save(folder.join("dry.png")).unwrap();
    picture(true).save(folder.join("wet.png")).unwrap();
}

#[test]
fn photographs_become_spots_that_dry_from_their_rims() {
    let folder = tempfile::tempdir().unwrap();
    photos(folder.path());
    for out in ["map.png", "deep/map.exr"] {
        let map = map(folder.path(), "from-photo dry.png wet.png", out);
        assert_eq!((map.width, map.height), (96, 64));
        let disc = 20.0f32.powi(2) * std::f32::consts::PI / (96.0 * 64.0);
        assert!((coverage(&map) / disc - 1.0).abs() < 0.06, "{} {disc}", coverage(&map));
        assert!(map.get(47, 31) > 0.95 && map.get(30, 31) < 0.25 && map.get(10, 10) == 0.0);
        assert!((map.get(38, 31) - 0.5).abs() < 0.1, "{}", map.get(38, 31));
    }
    let flat = map(folder.path(), "from-photo dry.png wet.png --gradient 0", "flat.png");
    assert!(flat.values.iter().all(|&value| value == 0.0 || value == 1.0));
    let none = map(folder.path(), "from-photo dry.png dry.png", "none.png");
    assert_eq!(coverage(&none), 0.0);
    let all = map(folder.path(), "from-photo dry.png dry.png --threshold 1.5", "all.png");
    assert_eq!(coverage(&all), 1.0);
}

#[test]
fn noise_covers_what_it_should_and_repeats() {
    let folder = tempfile::tempdir().unwrap();
    let some = map(folder.path(), "perlin --size 96 --coverage 0.4 --seed 5 --cycles 4 --octaves 3", "a.png");
    assert_eq!((some.width, some.height), (96, 96));
    assert!((coverage(&some) - 0.4).abs() < 1e-3);
    let again =
        map(folder.path(), "perlin --size 96 --coverage 0.4 --seed 5 --cycles 4 --octaves 3", "b.png");
    assert_eq!(some, again);
    assert_eq!(map(folder.path(), "perlin", "c.exr").width, 512);
}

#[test]
fn drops_fall_on_what_is_wet_already() {
    let folder = tempfile::tempdir().unwrap();
    let drops = map(folder.path(), "drops --size 64 --drops 30 --radius 1,3 --line-length 12", "drops.exr");
    assert!(coverage(&drops) > 0.02 && coverage(&drops) < 0.6, "{}", coverage(&drops));
    let below = map(folder.path(), "perlin --size 64 --coverage 0.5", "below.exr");
    let options = "drops --drops 30 --radius 1,3 --line-length 12 --over below.exr";
    assert_eq!(map(folder.path(), options, "both.exr"), below.add(&drops).unwrap());
}

/// A ground of 4 m by 4 m with its uv square along x and z, and a roof 1 m above its half at negative x.
fn shelter(folder: &Path) {
    let quad = |low: [f32; 2], high: [f32; 2], y: f32| {
        let [p, q, r, s] =
            [[low[0], y, low[1]], [high[0], y, low[1]], [high[0], y, high[1]], [low[0], y, high[1]]];
        // Counter-clockwise from above.
        [p, r, q, p, s, r]
    };
    let mut bytes: Vec<u8> = Vec::new();
    let mut put = |value: f32| bytes.extend(value.to_le_bytes());
    let (ground, roof) = (quad([-2.0; 2], [2.0; 2], 0.0), quad([-6.0; 2], [0.0, 6.0], 0.0));
    ground.iter().chain(&roof).flatten().for_each(|&value| put(value));
    for [x, _, z] in ground {
        put((x + 2.0) / 4.0);
        put((z + 2.0) / 4.0);
    }
    std::fs::write(folder.join("shelter.bin"), &bytes).unwrap();
    let json = serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [
            { "name": "ground", "mesh": 0 },
            { "name": "roof", "mesh": 1, "translation": [0.0, 1.0, 0.0] },
        ],
        "meshes": [
            { "name": "square", "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 2 } }] },
            { "primitives": [{ "attributes": { "POSITION": 1 } }] },
        ],
        "buffers": [{ "uri": "shelter.bin", "byteLength": bytes.len() }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 72 },
            { "buffer": 0, "byteOffset": 72, "byteLength": 72 },
            { "buffer": 0, "byteOffset": 144, "byteLength": 48 },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3",
              "min": [-2.0, 0.0, -2.0], "max": [2.0, 0.0, 2.0] },
            { "bufferView": 1, "componentType": 5126, "count": 6, "type": "VEC3",
              "min": [-6.0, 0.0, -6.0], "max": [0.0, 0.0, 6.0] },
            { "bufferView": 2, "componentType": 5126, "count": 6, "type": "VEC2" },
        ],
    });
    std::fs::write(folder.join("shelter.gltf"), json.to_string()).unwrap();
}

/// Parallel rain on a ground from -2 to 2 along u: the border of the shelter, and what lies beyond, in every
/// row.
fn assert_border(map: &GreyMap, border: f32, open: f32) {
    for y in 0..map.height {
        for x in 0..map.width {
            let place = (x as f32 + 0.5) / map.width as f32 * 4.0 - 2.0;
            if (place - border).abs() > 0.04 {
                let expected = if place < border { 0.0 } else { open };
                let value = map.get(x, y);
                assert!((value - expected).abs() < 1e-3, "{value}, not {expected}, at {place} in row {y}");
            }
        }
    }
}

#[test]
fn a_roof_shelters_half_and_the_wind_moves_the_border() {
    let folder = tempfile::tempdir().unwrap();
    shelter(folder.path());
    let scene = "exposure shelter.gltf --size 64 --spread-deg 0 --fall-speed 4";
    assert_border(&map(folder.path(), scene, "still.exr"), 0.0, 1.0);
    // Height times wind over fall speed; open, it is the cosine of how far the rain leans.
    let lean = |wind: f32| 4.0 / wind.hypot(4.0);
    assert_border(&map(folder.path(), &format!("{scene} --wind 2,0,0"), "wind.exr"), 0.5, lean(2.0));
    let other = format!("{scene} --surface square --wind -1,0,0");
    assert_border(&map(folder.path(), &other, "other.exr"), -0.25, lean(1.0));
    let plane = "exposure shelter.gltf --surface ground --size 16 --rays 16 --plane 0,3,0,2,2";
    let below = map(folder.path(), plane, "plane.png");
    assert!(below.get(2, 8) == 0.0 && below.get(10, 8) > 0.5, "{} {}", below.get(2, 8), below.get(10, 8));
}

#[test]
fn scenarios_have_their_own_wind_and_sizes() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = r#"(
        seconds: 1.0,
        wind: (2.0, 0.0, 0.0),
        camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
        materials: {"plain": ()},
        surfaces: [
            (
                name: "roof",
                mesh: Ground(size: (6.0, 12.0), cells: (1, 1)),
                material: "plain",
                position: (-3.0, 1.0, 0.0),
            ),
            (
                name: "ground",
                mesh: Ground(size: (4.0, 4.0), cells: (2, 2)),
                material: "plain",
                maps: (map_size: 96, wrap_u: Clamp, wrap_v: Clamp),
            ),
        ],
    )"#;
    std::fs::write(folder.path().join("shelter.ron"), scenario).unwrap();
    let options = "exposure shelter.ron --surface ground --spread-deg 0 --fall-speed 4";
    let blown = map(folder.path(), options, "blown.exr");
    assert_eq!((blown.width, blown.height), (96, 96));
    assert_border(&blown, 0.5, 4.0 / 2.0f32.hypot(4.0));
    let still = map(folder.path(), &format!("{options} --wind 0,0,0 --size 32"), "still.exr");
    assert_eq!(still.width, 32);
    assert_border(&still, 0.0, 1.0);
}

#[test]
fn nonsense_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    photos(folder.path());
    shelter(folder.path());
    RgbImage::new(9, 64).save(folder.path().join("narrow.png")).unwrap();
    RgbImage::new(96, 64).save(folder.path().join("black.png")).unwrap();
    std::fs::write(folder.path().join("text.png"), "no picture").unwrap();
    std::fs::write(folder.path().join("text.gltf"), "no glTF").unwrap();
    std::fs::write(folder.path().join("text.ron"), "no scenario").unwrap();
    image::GrayImage::new(8193, 1).save(folder.path().join("wide.png")).unwrap();
    image::Rgb32FImage::from_pixel(8, 8, Rgb([f32::NAN; 3])).save(folder.path().join("nan.exr")).unwrap();
    for (arguments, named) in [
        ("from-photo dry.png nowhere.png", "nowhere.png"),
        ("from-photo dry.png text.png", "text.png"),
        ("from-photo dry.png wide.png", "8192"),
        ("from-photo dry.png narrow.png", "narrow.png"),
        ("from-photo dry.png black.png", "compared"),
        ("from-photo nan.exr nan.exr", "compared"),
        ("from-photo dry.png shelter.gltf", ".png or .exr"),
        ("from-photo dry.png wet.png --gradient 2", "gradient"),
        ("from-photo dry.png wet.png --threshold NaN", "threshold"),
        ("perlin --size 8193", "8192"),
        ("perlin --size 0", "MAX_SIZE"),
        ("perlin --coverage NaN", "coverage"),
        ("perlin --octaves 99", "octaves"),
        ("drops --radius 1", "--radius"),
        ("drops --radius 3,2", "radius.min"),
        ("drops --drops 99999999", "drops"),
        ("drops --over nan.exr", "nan.exr"),
        ("drops --over dry.png --size 64", "dry.png"),
        ("exposure nowhere.glb", "nowhere.glb"),
        ("exposure text.gltf", "text.gltf"),
        ("exposure text.ron", "text.ron"),
        ("exposure shelter.gltf --surface cellar", "`ground`"),
        ("exposure shelter.gltf --surface roof", "texture coordinates"),
        ("exposure shelter.gltf --size 8193", "8192"),
        ("exposure shelter.gltf --rays 0", "rays"),
        ("exposure shelter.gltf --wind 1,2", "--wind"),
        ("exposure shelter.gltf --wind 0,9,0", "wind.y"),
        ("exposure shelter.gltf --fall-speed 0", "fall_speed"),
        ("exposure shelter.gltf --plane 0,3,0,0,1", "half_size.x"),
        ("exposure shelter.gltf --plane 0,3,0,1,1 --spread-deg 4", "--plane"),
    ] {
        let output = wetmap(folder.path(), &format!("{arguments} --out out/map.png"));
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(message.contains(named) && !message.contains("panicked"), "{arguments}: {message}");
        assert!(!folder.path().join("out").exists(), "{arguments}");
    }
    let output = wetmap(folder.path(), "perlin --out out/map.jpg");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("map.jpg"));
    assert!(!folder.path().join("out").exists());
}
