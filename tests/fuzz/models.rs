//! glTF files: their container, their JSON, their numbers.

use std::path::Path;

use bevy_weathering::scenario::Scenario;
use bevy_weathering::scenes::gltf_mesh::{read_first_primitive, read_meshes};

use super::harness::fuzz;
use super::{assets, mutate, run, write};
use crate::common::Random;

/// A square of two triangles that two nodes show, and one of a strip; one accessor is sparse.
const JSON: &str = r#"{
    "asset": {"version": "2.0"},
    "scene": 0,
    "scenes": [{"nodes": [0, 2]}],
    "nodes": [
        {"name": "a", "children": [1], "translation": [0.0, 1.0, 0.0]},
        {"name": "b", "mesh": 0, "scale": [2.0, 2.0, 2.0], "rotation": [0.0, 0.0, 0.0, 1.0]},
        {"mesh": 1, "matrix": [1.0,0.0,0.0,0.0, 0.0,1.0,0.0,0.0, 0.0,0.0,1.0,0.0, 0.0,0.0,0.0,1.0]}
    ],
    "meshes": [
        {"name": "square", "primitives": [
            {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
        ]},
        {"primitives": [{"attributes": {"POSITION": 3, "TEXCOORD_0": 1}, "mode": 5}]}
    ],
    "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1.0], "roughnessFactor": 0.5}}],
    "buffers": [{"byteLength": 136}],
    "bufferViews": [
        {"buffer": 0, "byteOffset": 0, "byteLength": 48},
        {"buffer": 0, "byteOffset": 48, "byteLength": 32, "byteStride": 8},
        {"buffer": 0, "byteOffset": 80, "byteLength": 12},
        {"buffer": 0, "byteOffset": 92, "byteLength": 4},
        {"buffer": 0, "byteOffset": 96, "byteLength": 12}
    ],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
         "min": [0.0, 0.0, 0.0], "max": [1.0, 0.0, 1.0]},
        {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
        {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
         "min": [0.0, 0.0, 0.0], "max": [1.0, 1.0, 1.0],
         "sparse": {"count": 1, "indices": {"bufferView": 3, "componentType": 5125}, "values": {"bufferView": 4}}}
    ]
}"#;

/// The numbers of [`JSON`].
fn numbers() -> Vec<u8> {
    let mut bytes = Vec::new();
    let floats = |bytes: &mut Vec<u8>, values: &[f32]| {
        values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    };
    floats(&mut bytes, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
    floats(&mut bytes, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    [0u16, 2, 1, 1, 2, 3].iter().for_each(|index| bytes.extend(index.to_le_bytes()));
    bytes.extend(1u32.to_le_bytes());
    floats(&mut bytes, &[1.0, 0.5, 0.0]);
    bytes.resize(136, 0);
    bytes
}

/// A binary glTF; its JSON need not be any.
fn glb(json: &[u8], numbers: &[u8]) -> Vec<u8> {
    let chunk = |kind: &[u8; 4], content: &[u8], fill: u8| {
        let mut padded = content.to_vec();
        padded.resize(content.len().next_multiple_of(4), fill);
        let mut chunk = (padded.len() as u32).to_le_bytes().to_vec();
        chunk.extend(kind);
        chunk.extend(padded);
        chunk
    };
    let chunks = [chunk(b"JSON", json, b' '), chunk(b"BIN\0", numbers, 0)].concat();
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((chunks.len() as u32 + 12).to_le_bytes());
    file.extend(chunks);
    file
}

/// A spoilt model.
fn spoilt(random: &mut Random, bunny: &[u8]) -> Vec<u8> {
    match random.below(8) {
        0 => {
            let mut bytes = bunny.to_vec();
            mutate::bytes(random, &mut bytes);
            bytes
        }
        1 => {
            let mut bytes = glb(JSON.as_bytes(), &numbers());
            mutate::bytes(random, &mut bytes);
            bytes
        }
        2 | 3 => {
            let mut bytes = numbers();
            mutate::bytes(random, &mut bytes);
            bytes.resize(136, 0);
            glb(JSON.as_bytes(), &bytes)
        }
        _ => glb(&mutate::text(random, JSON, &[]), &numbers()),
    }
}

const SCENE: &str = r#"(
    seconds: 1.0,
    tick_hz: 20,
    camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
    materials: {"clay": ()},
    surfaces: [(name: "mesh", mesh: File("models/spoilt.glb"), material: "clay", maps: (map_size: 32))],
    emitters: [(name: "rain", effect: "rain.effect.ron", rate: 60.0, shape: Sky(half_size: (1.0, 1.0)), lifetime: 2.0,
                keys: [(position: (0.5, 2.0, 0.5), target: (0.5, 0.0, 0.5))])],
)"#;

/// All of the model, as a scene.
const WHOLE: &str = r#"(
    seconds: 1.0,
    tick_hz: 20,
    camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
    scenes: [(name: "whole", file: "models/spoilt.glb", maps: (map_size: 32))],
    emitters: [(name: "rain", effect: "rain.effect.ron", rate: 60.0, shape: Sky(half_size: (1.0, 1.0)), lifetime: 2.0,
                keys: [(position: (0.5, 4.0, 0.5), target: (0.5, 0.0, 0.5))])],
)"#;

/// All that is read of a model without an app. A refusal names its file.
fn read(file: &Path) -> Result<(), String> {
    let named = |error: &dyn std::error::Error| {
        let message = error.to_string();
        assert!(message.contains("spoilt.glb"), "no file is named: {message}");
        message
    };
    // One may be damaged where the other does not look.
    if let Ok(triangles) = read_first_primitive(file) {
        let uvs = triangles.uvs.iter().flatten();
        assert!(triangles.positions.iter().flatten().all(|position| position.is_finite()));
        assert!(uvs.into_iter().all(|uv| uv.is_finite()));
    }
    for mesh in read_meshes(file).map_err(|error| named(&error))? {
        assert!(mesh.transform.is_finite(), "{}", mesh.name);
    }
    Ok(())
}

#[test]
fn spoilt_models_are_read_or_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = folder.path().join("scene.ron");
    write(&scene, SCENE);
    write(&folder.path().join("rain.effect.ron"), "(volume_mm3: 20.0)");
    let whole = folder.path().join("whole.ron");
    write(&whole, WHOLE);
    let file = folder.path().join("models/spoilt.glb");
    write(&file, glb(JSON.as_bytes(), &numbers()));
    read(&file).expect("it is whole");
    run(Scenario::load(&scene).expect("it is whole"), 0.25, None).expect("it runs");
    run(Scenario::load(&whole).expect("it is whole"), 0.25, None).expect("it runs");
    let bunny = std::fs::read(assets().join("models/bunny_1000.glb")).expect("it is in the repository");
    let tally = fuzz("models", 1000, move |_, random| {
        write(&file, spoilt(random, &bunny));
        let meshes = read(&file);
        match Scenario::load(&whole) {
            Ok(loaded) if random.below(5) == 0 => drop(loaded.check_content()),
            Ok(loaded) => assert!(loaded.scenario.surface_count() > 0),
            Err(error) => assert!(error.to_string().contains("spoilt.glb"), "no file is named: {error}"),
        }
        let loaded = Scenario::load(&scene).map_err(|error| error.to_string())?;
        if random.below(5) == 0 {
            loaded.check_content().map_err(|error| error.to_string())?;
        }
        if random.below(30) == 0 {
            run(loaded, 0.1, None)?;
        }
        meshes
    });
    assert!(tally.accepted > 50 && tally.refused > 200, "{tally:?}");
}
