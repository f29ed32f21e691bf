//! The files that a glTF names in turn: they must lie inside the tree, too.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{LoadedScenario, ScenarioError};
use crate::scenes::gltf_mesh::{data_uri, percent_decoded};

impl LoadedScenario {
    /// Checks that a glTF and every buffer and image it refers to exist inside the tree. `value` is its path there, `field`
    /// what messages call it.
    ///
    /// # Errors
    /// [`ScenarioError`] for what is missing, outside the tree, or no glTF.
    pub fn validate_gltf(&self, field: &str, value: &str) -> Result<(), ScenarioError> {
        self.gltf_files(field, value).map(drop)
    }

    /// A glTF and every buffer and image it refers to; all of them exist inside the tree.
    pub(super) fn gltf_files(&self, field: &str, value: &str) -> Result<Vec<PathBuf>, ScenarioError> {
        let file = self.resolve(field, value)?;
        let bytes = std::fs::read(&file).map_err(|error| self.content_error(field, value, error))?;
        let json = match json_chunk(&bytes) {
            Some(json) => serde_json::from_slice::<Value>(json),
            None => serde_json::from_slice::<Value>(&bytes),
        };
        let json = json.map_err(|error| self.content_error(field, value, format!("not a glTF: {error}")))?;
        let folder = Path::new(value).parent().unwrap_or(Path::new(""));
        let mut files = vec![file];
        for list in ["buffers", "images"] {
            for uri in json[list].as_array().into_iter().flatten().filter_map(|entry| entry["uri"].as_str()) {
                let field = format!("{field} -> {list}");
                let no_text = || self.content_error(&field, uri, "its escapes stand for no text");
                let decoded = percent_decoded(uri).ok_or_else(no_text)?;
                if data_uri(&decoded).is_none() {
                    files.push(self.resolve(&field, &folder.join(&*decoded).to_string_lossy())?);
                }
            }
        }
        Ok(files)
    }
}

/// The JSON of a binary glTF (.glb): 12 bytes of header, then length, type and content of the first chunk.
fn json_chunk(bytes: &[u8]) -> Option<&[u8]> {
    let bytes = bytes.strip_prefix(b"glTF")?;
    let length = u32::from_le_bytes(bytes.get(8..12)?.try_into().ok()?);
    bytes.get(16..)?.get(..length as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    /// A scenario whose mesh has its buffer here.
    fn load(uri: &str) -> Result<LoadedScenario, ScenarioError> {
        let folder = tempfile::tempdir().unwrap();
        let gltf = serde_json::json!({
            "asset": { "version": "2.0" },
            "buffers": [{ "uri": uri, "byteLength": 3 }],
        });
        std::fs::write(folder.path().join("mesh.gltf"), gltf.to_string()).unwrap();
        let scenario = r#"(
            seconds: 1.0,
            camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
            materials: {"clay": ()},
            surfaces: [(name: "mesh", mesh: File("mesh.gltf"), material: "clay")],
        )"#;
        let file = folder.path().join("scene.ron");
        std::fs::write(&file, scenario).unwrap();
        Scenario::load(&file)
    }

    #[test]
    fn uris_are_what_bevy_takes_them_for() {
        load("data:application/octet-stream;base64,AAAA").unwrap();
        load("data%3Aapplication/octet-stream;base64,AAAA").unwrap();
        let error = |uri| load(uri).unwrap_err().to_string();
        for (uri, named) in [
            ("a%ff.bin", "escapes"),
            ("a%20b.bin", "a b.bin"),
            ("%2e%2e/a.bin", "outside"),
            // Without a comma it is a path.
            ("data:/../../a.bin", "outside"),
        ] {
            let error = error(uri);
            assert!(error.contains("surfaces[0].mesh -> buffers") && error.contains(named), "{uri}: {error}");
        }
    }

    #[test]
    fn the_json_of_a_glb_is_found_and_a_torn_one_is_not() {
        let mut glb = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        glb.extend([2, 0, 0, 0]);
        glb.extend(b"JSON{}rest");
        assert_eq!(json_chunk(&glb), Some(&b"{}"[..]));
        glb[12] = 200;
        assert_eq!(json_chunk(&glb), None);
        assert_eq!(json_chunk(b"{}"), None);
    }
}
