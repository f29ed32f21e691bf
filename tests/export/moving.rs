//! Scenes whose meshes move: skins, animations and morph targets stay what they were.

use bevy_weathering::export::{Export, bake};
use serde_json::{Value, json};

use super::bake::{options, primitive};
use super::rules::{Glb, count};
use super::scene::Builder;

/// Quads along the plank.
const LONG: u16 = 8;

/// A plank from 0 to 2 along x that faces up, some rows of vertices; its uvs lie in so many tiles.
struct Plank {
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    corners: Vec<u16>,
}

fn plank(tiles: f32) -> Plank {
    let (mut positions, mut uvs, mut corners) = (vec![], vec![], vec![]);
    for column in 0..=LONG {
        for row in 0..2u16 {
            let (u, v) = (f32::from(column) / f32::from(LONG), f32::from(row));
            positions.push([2.0 * u, 0.5, 0.5 * v]);
            uvs.push([u * tiles, v * tiles]);
        }
        if column < LONG {
            let here = 2 * column;
            corners.extend([here, here + 1, here + 2, here + 2, here + 1, here + 3]);
        }
    }
    Plank { positions, uvs, corners }
}

impl Plank {
    /// Vertices and corners of a primitive.
    fn push(&self, scene: &mut Builder) -> Value {
        json!({
            "attributes": {
                "POSITION": scene.vectors(&self.positions),
                "NORMAL": scene.vectors(&vec![[0.0f32, 1.0, 0.0]; self.positions.len()]),
                "TEXCOORD_0": scene.vectors(&self.uvs),
            },
            "indices": scene.corners(&self.corners),
        })
    }

    /// How far each vertex is along the plank, 0 to 1.
    fn along(&self) -> impl Iterator<Item = f32> {
        self.positions.iter().map(|position| position[0] / 2.0)
    }
}

/// The plank on two joints, of which an animation turns the second. Nodes: 0 plank, 1 and 2 joints.
fn skinned(tiles: f32) -> Builder {
    let plank = plank(tiles);
    let mut scene = Builder::new();
    let mut primitive = plank.push(&mut scene);
    let weights: Vec<[f32; 4]> = plank.along().map(|part| [1.0 - part, part, 0.0, 0.0]).collect();
    primitive["attributes"]["WEIGHTS_0"] = scene.vectors(&weights).into();
    primitive["attributes"]["JOINTS_0"] = scene.joints(&vec![[0, 1, 0, 0]; weights.len()]).into();
    scene.push("meshes", json!({ "name": "plank", "primitives": [primitive] }));
    // Column by column; the second undoes that its joint sits at x = 1.
    let at = |x: f32| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, 0.0, 1.0];
    let bind = scene.matrices(&[at(0.0), at(-1.0)]);
    let times = scene.scalars(&[0.0, 1.0]);
    let turns = scene.vectors(&[[0.0f32, 0.0, 0.0, 1.0], [0.0, 0.0, 0.5f32.sqrt(), 0.5f32.sqrt()]]);
    let json = &mut scene.json;
    json["skins"] = json!([{ "joints": [1, 2], "inverseBindMatrices": bind, "skeleton": 1 }]);
    json["nodes"] = json!([
        { "name": "plank", "mesh": 0, "skin": 0 },
        { "name": "root", "children": [2] },
        { "name": "second", "translation": [1.0, 0.0, 0.0] },
    ]);
    json["scenes"] = json!([{ "nodes": [0, 1] }]);
    json["animations"] = json!([{
        "name": "bend",
        "samplers": [{ "input": times, "output": turns, "interpolation": "LINEAR" }],
        "channels": [{ "sampler": 0, "target": { "node": 2, "path": "rotation" } }],
    }]);
    scene
}

/// The plank with two morph targets, which an animation blends. Node 0.
fn morphed(tiles: f32) -> Builder {
    let plank = plank(tiles);
    let mut scene = Builder::new();
    let mut primitive = plank.push(&mut scene);
    let lifted: Vec<[f32; 3]> = plank.along().map(|part| [0.0, part, 0.0]).collect();
    let leant: Vec<[f32; 3]> = plank.along().map(|part| [-0.25 * part, 0.0, 0.0]).collect();
    let longer: Vec<[f32; 3]> = plank.along().map(|part| [part, 0.0, 0.0]).collect();
    primitive["targets"] = json!([
        { "POSITION": scene.vectors(&lifted), "NORMAL": scene.vectors(&leant) },
        { "POSITION": scene.vectors(&longer) },
    ]);
    let mesh = json!({
        "name": "plank", "primitives": [primitive], "weights": [0.0, 0.25],
        "extras": { "targetNames": ["lifted", "longer"] },
    });
    scene.push("meshes", mesh);
    let (times, weights) = (scene.scalars(&[0.0, 1.0]), scene.scalars(&[0.0, 0.0, 1.0, 0.5]));
    scene.json["nodes"] = json!([{ "name": "plank", "mesh": 0, "weights": [0.5, 0.0] }]);
    scene.json["animations"] = json!([{
        "samplers": [{ "input": times, "output": weights }],
        "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
    }]);
    scene
}

/// What is written by these is also what `scripts/validate.sh` gives the validator of Khronos.
fn baked(name: &str, scene: &Builder) -> Export {
    let folder = tempfile::tempdir().unwrap();
    let export = bake(&scene.write(folder.path()), &options(), |_| {}).unwrap();
    super::keep(name, &scene.glb(), &export.glb);
    export
}

/// Values of a vertex attribute after the bake, and those of the vertices that they came from, found by place and uv.
fn follows(glb: &Glb, before: &Glb, now: &Value, then: &Value) {
    let values = |glb: &Glb, attributes: &Value, name: &str| glb.any(count(&attributes[name]));
    let keys = |glb: &Glb, attributes: &Value| -> Vec<Vec<f32>> {
        let (positions, uvs) =
            (glb.floats(count(&attributes["POSITION"])), glb.floats(count(&attributes["TEXCOORD_0"])));
        positions.into_iter().zip(uvs).map(|(position, uv)| [position, uv].concat()).collect()
    };
    let (new, old) = (keys(glb, &now["attributes"]), keys(before, &then["attributes"]));
    let vertex = |key: &Vec<f32>| old.iter().position(|other| other == key).expect("a vertex that there was");
    let came_from: Vec<usize> = new.iter().map(vertex).collect();
    let check = |now: &Value, then: &Value| {
        for name in then.as_object().unwrap().keys() {
            let (new, old) = (values(glb, now, name), values(before, then, name));
            let expected: Vec<_> = came_from.iter().map(|&vertex| old[vertex].clone()).collect();
            assert_eq!(new, expected, "{name}");
        }
    };
    check(&now["attributes"], &then["attributes"]);
    let targets = |primitive: &Value| primitive["targets"].as_array().cloned().unwrap_or_default();
    let (now, then) = (targets(now), targets(then));
    assert_eq!(now.len(), then.len());
    now.iter().zip(&then).for_each(|(now, then)| check(now, then));
}

#[test]
fn a_skinned_mesh_keeps_its_joints_weights_and_animation() {
    for (name, tiles) in [("skinned", 1.0), ("skinned_and_cut", 2.0)] {
        let scene = skinned(tiles);
        let export = baked(name, &scene);
        let (glb, before) = (Glb::parse(&export.glb), Glb::parse(&scene.glb()));
        before.check();
        glb.check();
        for field in ["skins", "animations", "nodes"] {
            assert_eq!(glb.json[field], before.json[field], "{name}: {field}");
        }
        let (now, then) = (primitive(&glb, 0), primitive(&before, 0));
        assert_eq!(export.report.surfaces[0].unwrapped, tiles > 1.0);
        follows(&glb, &before, now, then);
        assert!(export.report.surfaces[0].received_mm3 > 0.0);
        let document = gltf::Gltf::from_slice(&export.glb).unwrap();
        let skin = document.skins().next().unwrap();
        assert_eq!((skin.joints().count(), document.animations().count()), (2, 1));
        let bind = |glb: &Glb| glb.floats(count(&glb.list("skins")[0]["inverseBindMatrices"]));
        assert_eq!(bind(&glb), bind(&before));
    }
}

#[test]
fn a_morphed_mesh_keeps_its_targets_weights_and_animation() {
    for (name, tiles) in [("morphed", 1.0), ("morphed_and_cut", 2.0)] {
        let scene = morphed(tiles);
        let export = baked(name, &scene);
        let (glb, before) = (Glb::parse(&export.glb), Glb::parse(&scene.glb()));
        before.check();
        glb.check();
        for field in ["animations", "nodes"] {
            assert_eq!(glb.json[field], before.json[field], "{name}: {field}");
        }
        let (now, then) = (&glb.list("meshes")[0], &before.list("meshes")[0]);
        assert_eq!((&now["weights"], &now["extras"]), (&then["weights"], &then["extras"]));
        follows(&glb, &before, primitive(&glb, 0), primitive(&before, 0));
        assert!(export.report.surfaces[0].received_mm3 > 0.0);
    }
}
