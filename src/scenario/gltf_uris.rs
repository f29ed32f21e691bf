//! The files that a glTF names in turn: they must lie inside the tree, too.

use std::path::Path;

use serde_json::Value;

use super::{LoadedScenario, ScenarioError};
use crate::scenes::gltf_mesh::percent_decoded;

impl LoadedScenario {
    /// Checks that a glTF and every buffer and image it refers to exist inside the tree.
    pub(super) fn validate_gltf(&self, field: &str, value: &str) -> Result<(), ScenarioError> {
        let file = self.resolve(field, value)?;
        let bytes = std::fs::read(&file).map_err(|error| self.content_error(field, value, error))?;
        let json = match json_chunk(&bytes) {
            Some(json) => serde_json::from_slice::<Value>(json),
            None => serde_json::from_slice::<Value>(&bytes),
        };
        let json = json.map_err(|error| self.content_error(field, value, format!("not a glTF: {error}")))?;
        let folder = Path::new(value).parent().unwrap_or(Path::new(""));
        for list in ["buffers", "images"] {
            for uri in json[list].as_array().into_iter().flatten().filter_map(|entry| entry["uri"].as_str()) {
                if !uri.starts_with("data:") {
                    let decoded = percent_decoded(uri);
                    let inside = folder.join(decoded.as_ref().map_or(uri, |decoded| decoded));
                    self.resolve(&format!("{field} -> {list}"), &inside.to_string_lossy())?;
                }
            }
        }
        Ok(())
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

    #[test]
    fn escapes_are_seen_through() {
        assert_eq!(percent_decoded("a%20b%2e%2E%2Fc").as_deref(), Some("a b../c"));
        assert_eq!(percent_decoded("100%").as_deref(), Some("100%"));
        assert_eq!(percent_decoded("%ff"), None);
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
