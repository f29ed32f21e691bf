//! How large the pictures of a glTF are: Bevy decodes all of them, of whatever size. Only their headers are read here, and what
//! is no picture is left to whoever loads it.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::io::Cursor;
use std::path::Path;

use base64::prelude::{BASE64_STANDARD, Engine};
use image::ImageReader;
use serde_json::Value;

use super::{LoadedScenario, Scenario, ScenarioError};
use crate::input::read_file;
use crate::scenes::gltf_mesh::{MAX_FILE_BYTES, data_uri, percent_decoded};

impl LoadedScenario {
    /// Checks the size of every picture of a glTF. `bytes`: the file, whose JSON is `json`.
    pub(super) fn validate_gltf_images(
        &self,
        field: &str,
        value: &str,
        json: &Value,
        bytes: &[u8],
    ) -> Result<(), ScenarioError> {
        // Of those that pictures lie in.
        let mut buffers: BTreeMap<u64, Vec<u8>> = BTreeMap::new();
        for (index, image) in json["images"].as_array().into_iter().flatten().enumerate() {
            let field = format!("{field} -> images[{index}]");
            let size = if let Some(uri) = image["uri"].as_str() {
                size_of(&self.bytes_of_uri(&field, value, uri)?)
            } else if let Some(view) = image["bufferView"].as_u64() {
                let view = entry(&json["bufferViews"], view);
                let number = view["buffer"].as_u64().unwrap_or(0);
                let buffer = match buffers.entry(number) {
                    Entry::Occupied(read) => read.into_mut(),
                    Entry::Vacant(unread) => {
                        unread.insert(match entry(&json["buffers"], number)["uri"].as_str() {
                            Some(uri) => self.bytes_of_uri(&field, value, uri)?,
                            None => binary_chunk(bytes).unwrap_or_default().to_vec(),
                        })
                    }
                };
                part(view, buffer).and_then(size_of)
            } else {
                None
            };
            let max = Scenario::MAX_TEXTURE;
            if let Some((width, height)) = size
                && width.max(height) > max
            {
                let reason =
                    format!("a picture of {width} by {height} pixels: each side may have at most {max}");
                return Err(self.content_error(&field, value, reason));
            }
        }
        Ok(())
    }

    /// What a URI of the glTF `value` stands for; nothing if it is data that cannot be decoded.
    fn bytes_of_uri(&self, field: &str, value: &str, uri: &str) -> Result<Vec<u8>, ScenarioError> {
        let Some(decoded) = percent_decoded(uri) else { return Ok(Vec::new()) };
        if let Some((_, data)) = data_uri(&decoded) {
            return Ok(BASE64_STANDARD.decode(data).unwrap_or_default());
        }
        let folder = Path::new(value).parent().unwrap_or(Path::new(""));
        let path = self.resolve(field, &folder.join(&*decoded).to_string_lossy())?;
        read_file(&path, MAX_FILE_BYTES).map_err(|error| self.content_error(field, uri, error))
    }
}

/// An entry of a list, or null.
fn entry(list: &Value, index: u64) -> &Value {
    static NULL: Value = Value::Null;
    usize::try_from(index).ok().and_then(|index| list.get(index)).unwrap_or(&NULL)
}

/// Width and height of a picture of a known format.
fn size_of(picture: &[u8]) -> Option<(u32, u32)> {
    let mut reader = ImageReader::new(Cursor::new(picture)).with_guessed_format().ok()?;
    // One that is too large is to be known as such.
    reader.no_limits();
    reader.into_dimensions().ok()
}

/// The bytes of a buffer view.
fn part<'a>(view: &Value, buffer: &'a [u8]) -> Option<&'a [u8]> {
    let number = |field: &str| view[field].as_u64().and_then(|number| usize::try_from(number).ok());
    buffer.get(number("byteOffset").unwrap_or(0)..)?.get(..number("byteLength")?)
}

/// The second chunk of a binary glTF: behind 12 bytes of header and the first chunk, its length, its type and its content.
fn binary_chunk(bytes: &[u8]) -> Option<&[u8]> {
    let whole = |at: usize| {
        let length = bytes.get(at..at.checked_add(4)?)?;
        Some(u32::from_le_bytes(length.try_into().ok()?) as usize)
    };
    let first = bytes.starts_with(b"glTF").then(|| whole(12)).flatten()?;
    let second = first.checked_add(20)?;
    bytes.get(second.checked_add(8)?..)?.get(..whole(second)?)
}

#[cfg(test)]
mod tests {
    use image::{GrayImage, ImageFormat};
    use serde_json::json;

    use super::*;

    fn png(width: u32) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        GrayImage::new(width, 1).write_to(&mut bytes, ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    /// Why a scenario with this model is refused.
    fn refusal(model: &[u8]) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("mesh.glb"), model).unwrap();
        std::fs::write(folder.path().join("wide.png"), png(8193)).unwrap();
        let scenario = r#"(
            seconds: 1.0,
            camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
            materials: {"clay": ()},
            surfaces: [(name: "mesh", mesh: File("mesh.glb"), material: "clay")],
        )"#;
        let file = folder.path().join("scene.ron");
        std::fs::write(&file, scenario).unwrap();
        Scenario::load(&file).err().map(|error| error.to_string())
    }

    /// A binary glTF whose only picture begins at byte 4 of its binary chunk.
    fn glb(picture: &[u8]) -> Vec<u8> {
        let mut json = json!({
            "asset": { "version": "2.0" },
            "buffers": [{ "byteLength": picture.len() + 4 }],
            "bufferViews": [{ "buffer": 0, "byteOffset": 4, "byteLength": picture.len() }],
            "images": [{ "bufferView": 0, "mimeType": "image/png" }],
        })
        .to_string()
        .into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let numbers = [&[0u8; 4][..], picture].concat();
        let mut bytes = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        for (kind, chunk) in [(b"JSON", json), (b"BIN\0", numbers)] {
            bytes.extend((chunk.len() as u32).to_le_bytes());
            bytes.extend(kind);
            bytes.extend(chunk);
        }
        bytes
    }

    #[test]
    fn pictures_are_as_large_as_is_allowed_wherever_they_lie() {
        let of_uri = |uri: String| {
            json!({ "asset": { "version": "2.0" }, "images": [{ "uri": uri }] }).to_string().into_bytes()
        };
        let data = |width| format!("data:image/png;base64,{}", BASE64_STANDARD.encode(png(width)));
        for model in [glb(&png(8193)), of_uri(data(8193)), of_uri("wide.png".into())] {
            let message = refusal(&model).unwrap_or_default();
            assert!(message.contains("-> images[0]") && message.contains("8193 by 1"), "{message}");
        }
        for model in [glb(&png(16)), of_uri(data(16)), glb(b"no picture"), of_uri("data:x;base64,*".into())] {
            assert_eq!(refusal(&model), None);
        }
    }

    #[test]
    fn a_torn_file_has_no_second_chunk() {
        let whole = glb(&png(4));
        assert!(binary_chunk(&whole).is_some());
        for length in 0..whole.len() {
            assert_eq!(binary_chunk(&whole[..length]), None, "{length}");
        }
    }
}
