//! glTF scenes of a scenario: what is in their files is read with the scenario, so that names, numbers and order of all surfaces
//! are known before anything is loaded.
//!
//! Surfaces of a scenario are numbered: first its own, then those of its scenes, scene by scene, in the order of
//! [`SceneLayout::parts`].

use std::sync::Arc;

use bevy::math::Vec3;

use super::{LoadedScenario, Scenario, ScenarioError, SceneSpec, SurfaceMesh};
use crate::collision::MeshTriangles;
use crate::material::{PorousMaterial, StandingWater};
use crate::overlay::Weatherable;
use crate::scenes::gltf_mesh::{SceneLayout, ScenePart, read_layout, read_parts};
use crate::unwrap::{MapTrianglesError, map_triangles};

/// Texels of a map per metre of the size of what it lies on, before they are rounded.
const TEXELS_PER_METRE: f32 = 256.0;

/// The smallest and the largest map of a part whose scene does not say how large maps are.
const MAP_SIZES: [u32; 2] = [128, 1024];

/// What a surface is made of at first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MadeOf {
    /// Number of the material of the scenario; `None` if its material comes from its file.
    pub(crate) material: Option<usize>,
    pub(crate) porous: PorousMaterial,
    pub(crate) water: StandingWater,
}

impl SceneSpec {
    /// Its surfaces with their maps, in order.
    pub(super) fn parts(&self) -> impl Iterator<Item = (&ScenePart, Weatherable)> {
        self.layout.parts.iter().zip(self.part_maps.iter().copied())
    }

    /// Takes what is in its file.
    fn fill(&mut self, layout: SceneLayout) {
        let size = |part: &ScenePart| {
            let corners = layout.box_of(part).map(|corner| corner * self.scale);
            let far = |corner: Vec3| corners.iter().map(|other| other.distance(corner)).fold(0.0, f32::max);
            // Its longest diagonal, however it is turned and sheared.
            texels(corners.iter().map(|&corner| far(corner)).fold(0.0, f32::max))
        };
        self.part_maps = match self.maps {
            Some(maps) => layout.parts.iter().map(|_| maps).collect(),
            None => {
                let sizes: Vec<u32> = layout.parts.iter().map(size).collect();
                let most = largest_that_fits(&sizes);
                let maps = |size: &u32| Weatherable { map_size: (*size).min(most), ..Weatherable::default() };
                sizes.iter().map(maps).collect()
            }
        };
        self.layout = Arc::new(layout);
    }
}

/// A power of two, by the size of a surface, metres.
fn texels(metres: f32) -> u32 {
    let [least, most] = MAP_SIZES;
    // The conversion takes NaN for 0.
    ((metres * TEXELS_PER_METRE).clamp(0.0, most as f32) as u32).next_power_of_two().clamp(least, most)
}

/// The size to which larger maps are cut, so that those of one scene leave room for others.
fn largest_that_fits(sizes: &[u32]) -> u32 {
    let [least, mut most] = MAP_SIZES;
    let sum = |most: u32| sizes.iter().map(|&size| u64::from(size.min(most)).pow(2)).sum::<u64>();
    while most > least && sum(most) > Scenario::MAX_TEXELS / 4 {
        most /= 2;
    }
    most
}

impl Scenario {
    /// The names of all surfaces, by their numbers.
    pub fn surface_names(&self) -> impl Iterator<Item = &str> {
        let of_scenes = self.scenes.iter().flat_map(|scene| &scene.layout.parts);
        let own = self.surfaces.iter().map(|surface| surface.name.as_str());
        own.chain(of_scenes.map(|part| part.name.as_str()))
    }

    /// How many surfaces there are, those of scenes among them.
    pub fn surface_count(&self) -> usize {
        self.surfaces.len() + self.scenes.iter().map(|scene| scene.layout.parts.len()).sum::<usize>()
    }

    /// The number of a surface.
    pub(crate) fn surface_number(&self, name: &str) -> Option<u32> {
        self.surface_names().position(|other| other == name).map(|number| number as u32)
    }

    /// The number of the scene that a surface is of; `None` if it is of none.
    pub(super) fn scene_of(&self, surface: u32) -> Option<usize> {
        let mut first = self.surfaces.len();
        let surface = surface as usize;
        if surface < first {
            return None;
        }
        self.scenes.iter().position(|scene| {
            first += scene.layout.parts.len();
            surface < first
        })
    }

    /// What a surface is made of at first.
    pub(crate) fn made_of(&self, surface: u32) -> Option<MadeOf> {
        let Some(spec) = self.surfaces.get(surface as usize) else {
            let scene = &self.scenes[self.scene_of(surface)?];
            let (porous, water) = (scene.porous.unwrap_or_default(), StandingWater::default());
            return Some(MadeOf { material: None, porous, water });
        };
        let material = self.materials.keys().position(|name| *name == spec.material)?;
        let of = self.materials.get(&spec.material)?;
        Some(MadeOf { material: Some(material), porous: of.porous, water: of.water })
    }
}

impl LoadedScenario {
    /// Reads what is in the files of its scenes.
    pub(super) fn read_scenes(&mut self) -> Result<(), ScenarioError> {
        let count = self.scenario.scenes.len();
        if count > Scenario::MAX_SCENES {
            let expected = format!("at most {} (MAX_SCENES)", Scenario::MAX_SCENES);
            return Err(self.value("scenes", count, expected));
        }
        for index in 0..count {
            let layout = self.read_scene(index)?;
            self.scenario.scenes[index].fill(layout);
            let surfaces = self.scenario.surface_count();
            if surfaces > Scenario::MAX_SURFACES {
                let expected =
                    format!("of at most {} with all others (MAX_SURFACES)", Scenario::MAX_SURFACES);
                return Err(self.value(
                    format!("scenes[{index}]"),
                    format!("of {surfaces} surfaces"),
                    expected,
                ));
            }
        }
        Ok(())
    }

    fn read_scene(&self, index: usize) -> Result<SceneLayout, ScenarioError> {
        let spec = &self.scenario.scenes[index];
        let name = format!("scenes[{index}].name");
        self.file_name(&name, &spec.name)?;
        if self.scenario.scenes[..index].iter().any(|other| other.name == spec.name) {
            return Err(self.value(name, &spec.name, "unique"));
        }
        let field = format!("scenes[{index}].file");
        self.validate_gltf(&field, &spec.file)?;
        let path = self.resolve(&field, &spec.file)?;
        let layout = read_layout(&path).map_err(|error| self.content_error(&field, &spec.file, error));
        let mut layout = layout?;
        for part in &mut layout.parts {
            part.name = format!("{}.{}", spec.name, part.name);
        }
        Ok(layout)
    }

    /// The shapes of the surfaces of all scenes, as [`Self::surface_meshes`] has them.
    pub(super) fn scene_meshes(&self) -> Result<Vec<SurfaceMesh>, ScenarioError> {
        let mut meshes = Vec::new();
        for (index, spec) in self.scenario.scenes.iter().enumerate() {
            let field = format!("scenes[{index}].file");
            let path = self.resolve(&field, &spec.file)?;
            let read = read_parts(&path, &spec.layout.parts);
            let read = read.map_err(|error| self.content_error(&field, &spec.file, error))?;
            for ((part, maps), mesh) in spec.parts().zip(read) {
                let triangles: MeshTriangles = map_triangles(&mesh, &maps).map_err(|error| {
                    let (field, value) = match error {
                        MapTrianglesError::Unwrap(_) => (format!("scenes[{index}].maps.uv"), "Unique"),
                        _ => (field.clone(), spec.file.as_str()),
                    };
                    self.content_error(&field, value, format!("{}: {error}", part.name))
                })?;
                let place = spec.transform().compute_affine() * spec.layout.scene_from_node(part.node);
                meshes.push((part.name.clone(), triangles, place, maps));
            }
        }
        Ok(meshes)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use serde_json::{Value, json};
    use tempfile::TempDir;

    use super::*;
    use crate::scenes::gltf_mesh::test_file::write_with_triangle;

    /// A file with two meshes and an instance of one of them; `edit` makes it another one.
    fn write_model(folder: &Path, edit: impl FnOnce(&mut Value)) {
        let json = json!({
            "scenes": [{ "nodes": [0, 1, 2] }],
            "nodes": [
                { "name": "left", "mesh": 0, "translation": [-2.0, 0.0, 0.0] },
                { "name": "right", "mesh": 0, "translation": [2.0, 0.0, 0.0] },
                { "name": "both", "mesh": 1 },
            ],
            "meshes": [
                { "primitives": [{ "attributes": { "POSITION": 0 } }] },
                { "primitives": [{ "attributes": { "POSITION": 0 } }, { "attributes": { "POSITION": 0 } }] },
            ],
        });
        write_with_triangle(&folder.join("model.gltf"), json, edit);
    }

    fn load_with(
        scenes: &str,
        events: &str,
        edit: impl FnOnce(&mut Value),
    ) -> Result<(LoadedScenario, TempDir), String> {
        let folder = tempfile::tempdir().unwrap();
        write_model(folder.path(), edit);
        let text = format!(
            r#"(
                seconds: 1.0,
                camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
                materials: {{"clay": ()}},
                surfaces: [(name: "ground", mesh: Ground(size: (1.0, 1.0), cells: (1, 1)), material: "clay")],
                scenes: [{scenes}],
                events: [{events}],
            )"#
        );
        let file = folder.path().join("scene.ron");
        std::fs::write(&file, text).unwrap();
        let loaded = Scenario::load(&file).map_err(|error| error.to_string())?;
        // Tools read the same.
        let meshes = loaded.surface_meshes().map_err(|error| error.to_string())?;
        assert!(meshes.iter().map(|(name, ..)| name.as_str()).eq(loaded.scenario.surface_names()));
        assert_eq!(loaded.named_files().unwrap().len(), 2);
        Ok((loaded, folder))
    }

    fn load(scenes: &str) -> Result<(LoadedScenario, TempDir), String> {
        load_with(scenes, "", |_| {})
    }

    #[test]
    fn surfaces_of_scenes_come_behind_the_others_by_their_nodes() {
        let (loaded, _folder) = load(
            r#"(name: "a", file: "model.gltf"),
            (name: "b", file: "model.gltf", position: (0.0, 0.0, 3.0), scale: (2.0, 2.0, 2.0),
             porous: (sorptivity: 0.25), maps: (map_size: 64))"#,
        )
        .unwrap();
        let scenario = &loaded.scenario;
        let names: Vec<_> = scenario.surface_names().collect();
        let expected = [
            "ground", "a.left", "a.right", "a.both.0", "a.both.1", "b.left", "b.right", "b.both.0",
            "b.both.1",
        ];
        assert_eq!(names, expected);
        assert_eq!((scenario.surface_count(), scenario.surface_number("b.right")), (9, Some(6)));
        let scenes: Vec<_> = (0..10).map(|surface| scenario.scene_of(surface)).collect();
        let expected = [[None].as_slice(), &[Some(0); 4], &[Some(1); 4], &[None]].concat();
        assert_eq!(scenes, expected);
        assert_eq!(scenario.made_of(0).unwrap().material, Some(0));
        assert_eq!(scenario.made_of(1).unwrap().porous, PorousMaterial::default());
        let made_of = scenario.made_of(5).unwrap();
        assert_eq!((made_of.material, made_of.porous.sorptivity), (None, 0.25));
        assert_eq!(scenario.made_of(9), None);

        let meshes = loaded.surface_meshes().unwrap();
        let (_, triangles, place, maps) = &meshes[5];
        assert_eq!((triangles.positions.len(), maps.map_size), (1, 64));
        assert_eq!(place.transform_point3(Vec3::X), Vec3::new(-2.0, 0.0, 3.0));
        // By its size.
        assert_eq!(meshes[1].3.map_size, 512);
    }

    #[test]
    fn events_name_them_and_what_is_not_there_is_refused() {
        let scene = r#"(name: "a", file: "model.gltf")"#;
        let event = |name: &str| {
            format!(r#"(at: 0.5, what: Material(surface: "{name}", porous: (sorptivity: 0.5)))"#)
        };
        load_with(scene, &event("a.both.1"), |_| {}).unwrap();
        let error = load_with(scene, &event("a.both"), |_| {}).unwrap_err();
        assert!(error.contains("events[0]") && error.contains("a.both"), "{error}");
    }

    #[test]
    fn what_is_wrong_is_told_by_file_and_field() {
        for (scenes, named) in [
            (r#"(name: "a", file: "gone.gltf")"#, ["`scenes[0].file`", "gone.gltf"]),
            (r#"(name: "a", file: "../model.gltf")"#, ["`scenes[0].file`", "outside"]),
            (r#"(name: "a", file: "corners.bin")"#, ["`scenes[0].file`", "not a glTF"]),
            (r#"(name: "a.b", file: "model.gltf")"#, ["`scenes[0].name`", "a.b"]),
            (
                r#"(name: "a", file: "model.gltf"), (name: "a", file: "model.gltf")"#,
                ["`scenes[1].name`", "unique"],
            ),
            (r#"(name: "a", file: "model.gltf", scale: (1.0, -1.0, 1.0))"#, ["`scenes[0].scale.y`", "-1"]),
            (r#"(name: "a", file: "model.gltf", maps: (map_size: 17))"#, ["`scenes[0].maps.map_size`", "17"]),
            (r#"(name: "a", file: "model.gltf", porous: (pore_volume: 7.0))"#, ["`scenes[0].porous.", "7"]),
            (
                r#"(name: "a", file: "model.gltf", position: (1e9, 0.0, 0.0))"#,
                ["`scenes[0].position.x`", "1"],
            ),
        ] {
            let error = load(scenes).unwrap_err();
            assert!(error.contains("scene.ron") && named.iter().all(|name| error.contains(name)), "{error}");
        }
        let scene = r#"(name: "a", file: "model.gltf")"#;
        type Edit = fn(&mut Value);
        let edits: [(Edit, &str); 3] = [
            (|json| json["nodes"] = json!([{}, {}, {}]), "no mesh"),
            (|json| json["buffers"][0]["byteLength"] = 40.into(), "longer than its data"),
            (
                |json| {
                    json["nodes"][1]["name"] = "left".into();
                    json["nodes"][2] = json!({ "name": "left-n1", "mesh": 0 });
                },
                "left-n1",
            ),
        ];
        for (edit, named) in edits {
            let error = load_with(scene, "", edit).unwrap_err();
            assert!(error.contains("`scenes[0].file`") && error.contains(named), "{error}");
        }
    }

    #[test]
    fn the_schema_has_what_files_may_say_of_scenes() {
        let schema = crate::scenario::schema_json();
        assert_eq!(schema["properties"]["scenes"]["items"]["$ref"], "#/$defs/SceneSpec", "{schema}");
        let fields: Vec<&String> =
            schema["$defs"]["SceneSpec"]["properties"].as_object().unwrap().keys().collect();
        let mut expected = ["name", "file", "position", "rotation_deg", "scale", "porous", "maps"];
        expected.sort_unstable();
        let mut fields: Vec<&str> = fields.into_iter().map(String::as_str).collect();
        fields.sort_unstable();
        assert_eq!(fields, expected);
    }

    #[test]
    fn maps_are_as_large_as_the_mesh_asks_for_and_leave_room_for_others() {
        assert_eq!(
            [0.0, 0.6, 1.5, 100.0, f32::NAN, f32::NEG_INFINITY].map(texels),
            [128, 256, 512, 1024, 128, 128]
        );
        assert_eq!(largest_that_fits(&[1024; 256]), 1024);
        assert_eq!(largest_that_fits(&[1024; 257]), 512);
        assert_eq!(largest_that_fits(&[1024; 10_000]), 128);
    }
}
