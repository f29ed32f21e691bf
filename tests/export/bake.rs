//! Scenes as they come out, and what does not.

use std::path::Path;
use std::process::{Command, Output};

use bevy_weathering::export::{Export, ExportOptions, bake};
use serde_json::{Value, json};

use super::rules::{Glb, count};
use super::scene::scene;

/// Half a minute of heavy rain, as coarse as can be looked at: little runs.
pub fn options() -> ExportOptions {
    ExportOptions {
        rain_mm_per_h: 20.0,
        minutes: 0.5,
        map_size: 64,
        texture_size: Some(64),
        tick_hz: 10,
        ..Default::default()
    }
}

fn baked(json: impl FnOnce(&mut Value)) -> Export {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene();
    json(&mut scene.json);
    bake(&scene.write(folder.path()), &options(), |_| {}).unwrap()
}

/// The only primitive of the mesh that a node shows.
pub fn primitive(glb: &Glb, node: usize) -> &Value {
    let mesh = count(&glb.list("nodes")[node]["mesh"]);
    &glb.list("meshes")[mesh]["primitives"][0]
}

pub fn wet_material(glb: &Glb, node: usize) -> &Value {
    &glb.list("materials")[count(&primitive(glb, node)["material"])]
}

/// The texels of a texture of a material.
pub fn texels(glb: &Glb, info: &Value) -> image::RgbImage {
    let texture = &glb.list("textures")[count(&info["index"])];
    image::load_from_memory(glb.image(count(&texture["source"]))).unwrap().to_rgb8()
}

pub fn mean(picture: &image::RgbImage, channel: usize) -> f64 {
    let sum: f64 = picture.pixels().map(|pixel| f64::from(pixel[channel])).sum();
    sum / f64::from(picture.width() * picture.height())
}

#[test]
fn a_baked_scene_keeps_the_rules_and_all_that_it_had() {
    let export = baked(|_| {});
    super::keep("scene", &scene().glb(), &export.glb);
    let glb = Glb::parse(&export.glb);
    glb.check();
    let again = gltf::Gltf::from_slice(&export.glb).unwrap();
    assert_eq!((again.nodes().count(), again.cameras().count()), (5, 1));
    assert_eq!((again.meshes().count(), again.scenes().count()), (4, 1));

    let before = scene().json;
    for field in ["asset", "extras", "scene", "scenes", "cameras"] {
        assert_eq!(glb.json[field], before[field], "{field}");
    }
    for (after, before) in glb.list("nodes").iter().zip(before["nodes"].as_array().unwrap()) {
        let without_mesh = |node: &Value| {
            let mut node = node.clone();
            node.as_object_mut().unwrap().remove("mesh");
            node
        };
        assert_eq!(without_mesh(after), without_mesh(before));
    }
    assert_eq!(glb.list("materials")[..2], before["materials"].as_array().unwrap()[..]);
    assert_eq!(glb.json["extensionsUsed"], json!(["KHR_materials_variants"]));
    let variants = &glb.json["extensions"]["KHR_materials_variants"]["variants"];
    assert_eq!(*variants, json!([{ "name": "dry" }, { "name": "wet" }]));
    for (node, dry) in [(1, 0), (2, 0), (3, 1)] {
        let primitive = primitive(&glb, node);
        let mappings = &primitive["extensions"]["KHR_materials_variants"]["mappings"];
        assert_eq!(mappings[0], json!({ "material": dry, "variants": [0] }));
        assert_eq!(mappings[1], json!({ "material": primitive["material"], "variants": [1] }));
    }
    assert_eq!(wet_material(&glb, 3)["doubleSided"], true);
}

#[test]
fn a_report_is_not_of_an_earlier_export() {
    let export = baked(|_| {});
    let folder = tempfile::tempdir().unwrap();
    let [scene, report] = export.write(folder.path(), "scene").unwrap();
    assert!(scene.is_file() && report.is_file());
    // The next one fails at its first map.
    let maps = folder.path().join("maps");
    std::fs::remove_dir_all(&maps).unwrap();
    std::fs::write(&maps, "in the way").unwrap();
    assert!(export.write(folder.path(), "scene").is_err());
    assert!(scene.is_file() && !report.exists());
}

#[test]
fn instances_share_vertices_and_have_rain_of_their_own() {
    let export = baked(|_| {});
    let glb = Glb::parse(&export.glb);
    let (ground, roof) = (primitive(&glb, 1), primitive(&glb, 2));
    assert_eq!((&ground["attributes"], &ground["indices"]), (&roof["attributes"], &roof["indices"]));
    assert_ne!(ground["material"], roof["material"]);
    assert_eq!(ground["attributes"], scene().json["meshes"][0]["primitives"][0]["attributes"]);

    // What lies below the middle of the roof stays dry.
    let maps = &export.maps[0];
    assert_eq!((maps.name.as_str(), maps.size), ("ground", 64));
    let over = |from: usize, to: usize| {
        let sum: f32 = (from..to)
            .flat_map(|y| (from..to).map(move |x| y * 64 + x))
            .map(|t| maps.wetness[t].wetness)
            .sum();
        sum / ((to - from) * (to - from)) as f32
    };
    let (sheltered, open) = (over(26, 38), over(2, 12));
    assert!(sheltered < 0.3 && open > 0.6, "{sheltered} {open}");
    let color = texels(&glb, &wet_material(&glb, 1)["pbrMetallicRoughness"]["baseColorTexture"]);
    let surface = texels(&glb, &wet_material(&glb, 1)["pbrMetallicRoughness"]["metallicRoughnessTexture"]);
    let patch = |picture: &image::RgbImage, at: u32, channel| {
        mean(&image::imageops::crop_imm(picture, at, at, 8, 8).to_image(), channel)
    };
    for channel in 0..3 {
        assert!(patch(&color, 4, channel) < 0.9 * patch(&color, 28, channel), "{channel}");
    }
    assert!(patch(&surface, 4, 1) < patch(&surface, 28, 1) - 10.0);
    assert_eq!(patch(&surface, 4, 2), 0.0);
}

#[test]
fn tiled_and_missing_uvs_get_unique_ones_beside_them() {
    let export = baked(|_| {});
    let glb = Glb::parse(&export.glb);
    let wall = primitive(&glb, 3);
    let mut names: Vec<_> = wall["attributes"].as_object().unwrap().keys().map(String::as_str).collect();
    names.sort_unstable();
    // Two normal maps in two sets of uvs: tangents are the reader's to make.
    assert_eq!(names, ["COLOR_0", "NORMAL", "POSITION", "TEXCOORD_0", "TEXCOORD_1"]);
    let uvs = glb.floats(count(&wall["attributes"]["TEXCOORD_0"]));
    assert!(uvs.iter().any(|uv| uv[0] == 3.0));
    let unique = glb.floats(count(&wall["attributes"]["TEXCOORD_1"]));
    assert!(unique.iter().flatten().all(|part| (0.0..=1.0).contains(part)));
    let wet = wet_material(&glb, 3);
    let pbr = &wet["pbrMetallicRoughness"];
    for texture in [&pbr["baseColorTexture"], &pbr["metallicRoughnessTexture"], &wet["normalTexture"]] {
        assert_eq!(texture["texCoord"], 1);
    }
    // The bumps of three tiles are still there, as steep as they were.
    let normals = texels(&glb, &wet["normalTexture"]);
    let away = |normal: &image::Rgb<u8>| {
        let [x, y] = [normal[0], normal[1]].map(|part| f32::from(part) - 128.0);
        x.hypot(y)
    };
    let steep = normals.pixels().filter(|normal| (45.0..80.0).contains(&away(normal))).count();
    assert!(steep > 64 * 64 * 2 / 5, "{steep}");

    let strip = primitive(&glb, 4);
    assert_eq!((&strip["mode"], strip["attributes"]["TEXCOORD_0"].is_u64()), (&json!(4), true));
    assert!(strip["attributes"]["TANGENT"].is_null());
    let rows = &export.report.surfaces;
    let found: Vec<_> = rows.iter().map(|row| (row.name.as_str(), row.tex_coord, row.unwrapped)).collect();
    let expected = [("ground", 0, false), ("roof", 0, false), ("wall", 1, true), ("strip", 0, true)];
    assert_eq!(found, expected);
}

#[test]
fn all_water_is_accounted_for_and_the_same_rain_is_the_same_scene() {
    let (export, again) = (baked(|_| {}), baked(|_| {}));
    assert!(export.glb == again.glb);
    assert_eq!(export.report, again.report);
    let report = &export.report;
    assert_eq!((report.ticks, report.seconds), (300, 30.0));
    assert!(report.water.imbalance.abs() < 1e-6, "{:?}", report.water);
    let ground = &report.surfaces[0];
    assert!((ground.area_m2 - 4.0).abs() < 1e-3, "{}", ground.area_m2);
    // A sixth of a millimetre on four square metres, less what the roof keeps off.
    let litres = ground.received_mm3 / 1e6;
    assert!((0.3..0.8).contains(&litres), "{litres}");
    let texels: f64 = export.maps[0].wetness.iter().map(|texel| f64::from(texel.absorbed_mm)).sum();
    assert!((texels * 4e6 / 4096.0 - ground.absorbed_mm3).abs() < 0.02 * ground.absorbed_mm3);
    // The same amounts are in the file, for whoever looks for them.
    let glb = Glb::parse(&export.glb);
    let amounts = &wet_material(&glb, 1)["extras"]["weathering"];
    let film = image::load_from_memory(glb.image(count(&amounts["absorbed"]["image"]))).unwrap().to_luma16();
    let micrometres = (export.maps[0].wetness[0].absorbed_mm * 1000.0).round() as u16;
    assert_eq!((film.dimensions(), film[(0, 0)][0]), ((64, 64), micrometres));
}

#[test]
fn what_a_node_scales_to_nothing_stays_as_it_is() {
    let export = baked(|json| json["nodes"][2]["scale"] = json!([0.0, 0.0, 0.0]));
    let names: Vec<_> = export.report.surfaces.iter().map(|row| row.name.as_str()).collect();
    assert_eq!(names, ["ground", "wall", "strip"]);
    let glb = Glb::parse(&export.glb);
    glb.check();
    assert_eq!(*primitive(&glb, 2), scene().json["meshes"][0]["primitives"][0]);
    assert_eq!(wet_material(&glb, 1)["name"], "ground_wet");
}

#[test]
fn variants_that_there_were_stay() {
    let export = baked(|json| {
        json["extensionsUsed"] = json!(["KHR_materials_variants"]);
        json["extensions"] = json!({ "KHR_materials_variants": { "variants": [{ "name": "old" }] } });
        json["meshes"][1]["primitives"][0]["extensions"] =
            json!({ "KHR_materials_variants": { "mappings": [{ "material": 0, "variants": [0] }] } });
    });
    let glb = Glb::parse(&export.glb);
    glb.check();
    let mappings = &primitive(&glb, 3)["extensions"]["KHR_materials_variants"]["mappings"];
    assert_eq!(mappings[0], json!({ "material": 0, "variants": [0] }));
    assert_eq!((&mappings[1]["variants"], &mappings[2]["variants"]), (&json!([1]), &json!([2])));
}

fn weathering(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_weathering"));
    command.current_dir(folder).args(arguments.split_whitespace()).output().expect("the program runs")
}

#[test]
fn the_program_writes_scene_maps_and_report() {
    let folder = tempfile::tempdir().unwrap();
    scene().write(folder.path());
    let arguments = "bake scene.glb --rain 30 --wind 5,0,-2 --minutes 0.05 --size 32 --hz 10 --out out/a";
    let output = weathering(folder.path(), arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let out = folder.path().join("out/a");
    Glb::parse(&std::fs::read(out.join("scene_weathered.glb")).unwrap()).check();
    let report: Value = serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap();
    assert_eq!((&report["scene"], &report["wind"]), (&json!("scene.glb"), &json!([5.0, 0.0, -2.0])));
    for map in ["ground_wetness", "roof_film", "wall_absorbed", "strip_since"] {
        assert!(out.join(format!("maps/{map}.png")).is_file(), "{map}");
    }
    let hidden = std::fs::read_dir(&out)
        .unwrap()
        .filter(|entry| entry.as_ref().unwrap().file_name().to_string_lossy().starts_with('.'));
    assert_eq!(hidden.count(), 0);
}

#[test]
fn what_cannot_be_baked_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    type Edit = fn(&mut Value);
    let edits: [(&str, Edit, &str); 9] = [
        ("nothing.glb", |json| json["nodes"] = json!([{}]), "no mesh"),
        ("hidden.glb", |json| json["nodes"][0]["scale"] = json!([0.0, 0.0, 0.0]), "no mesh"),
        ("escapes.glb", |json| json["images"][0] = json!({ "uri": "../brick.png" }), "outside"),
        ("absolute.glb", |json| json["images"][0] = json!({ "uri": "/brick.png" }), "outside"),
        ("gone.glb", |json| json["images"][0] = json!({ "uri": "brick.png" }), "brick.png"),
        ("circle.glb", |json| json["nodes"][1]["children"] = json!([0]), "nodes[0]"),
        ("indices.glb", |json| json["accessors"][0]["count"] = 7.into(), "accessors[0]"),
        ("webp.glb", |json| json["images"][0]["mimeType"] = "image/webp".into(), "image/webp"),
        (
            "many.glb",
            |json| {
                let slab = json!({ "mesh": 0 });
                json["nodes"][0]["children"] = (1..1000).collect();
                json["nodes"].as_array_mut().unwrap().resize(1000, slab);
            },
            "texels",
        ),
    ];
    for (name, edit, named) in edits {
        let mut scene = scene();
        edit(&mut scene.json);
        std::fs::write(folder.path().join(name), scene.glb()).unwrap();
        refuse(folder.path(), name, named);
    }
    std::fs::write(folder.path().join("text.glb"), "no scene").unwrap();
    std::fs::write(folder.path().join("torn.glb"), &scene().glb()[..600]).unwrap();
    scene().write(folder.path());
    // A name that leaves no room for what is added to it.
    let long = format!("{}.glb", "x".repeat(245));
    std::fs::write(folder.path().join(&long), scene().glb()).unwrap();
    refuse(folder.path(), &long, "_weathered.glb");
    for (arguments, named) in [
        ("nowhere.glb", "nowhere.glb"),
        ("text.glb", "text.glb"),
        ("torn.glb", "torn.glb"),
        ("scene.glb --rain 0", "rain"),
        ("scene.glb --minutes NaN", "minutes"),
        ("scene.glb --size 100", "size"),
        ("scene.glb --wind 1,2", "3 numbers"),
    ] {
        refuse(folder.path(), arguments, named);
    }
}

fn refuse(folder: &Path, arguments: &str, named: &str) {
    // So short that a scene which is taken by mistake does not hold up the others.
    let short = if arguments.contains("--minutes") { "" } else { "--minutes 0.01" };
    let output = weathering(folder, &format!("bake {arguments} {short} --out out/b"));
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
    assert!(message.contains(named) && !message.contains("panicked"), "{arguments}: {message}");
    assert!(!folder.join("out").exists(), "{arguments}");
}
