//! A glTF as its JSON and one buffer, to which things are added.
//!
//! What is not understood is kept as it is. All buffers become one, behind each other, and pictures in files or `data:` URIs
//! come in, so that the result is a single `.glb`. Only numbers that say where bytes are change.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::ExportError;
use crate::scenes::gltf_mesh::{GltfMeshError, read_capped, read_uri};

/// What a buffer view is for: vertices.
pub(super) const ARRAY_BUFFER: u32 = 34_962;
/// What a buffer view is for: indices.
pub(super) const ELEMENT_ARRAY_BUFFER: u32 = 34_963;

/// Extensions that change how geometry or pictures are stored, which are not understood here.
const NOT_READ: [&str; 4] = [
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "EXT_mesh_gpu_instancing",
];

/// A glTF with all its bytes.
#[derive(Debug, Clone)]
pub(super) struct Document {
    pub(super) path: PathBuf,
    pub(super) json: Value,
    /// The one buffer.
    pub(super) bytes: Vec<u8>,
}

impl Document {
    /// Reads a `.glb` or `.gltf` with all that it names in its folder.
    pub(super) fn open(path: &Path) -> Result<Self, ExportError> {
        let bytes = read_capped(path)?;
        let parse = |reason: String| GltfMeshError::Parse { path: path.into(), reason };
        let (text, chunk) = chunks(&bytes).map_err(|reason| parse(reason.into()))?;
        let json: Value = serde_json::from_slice(text).map_err(|error| parse(error.to_string()))?;
        let version = json["asset"]["version"].as_str().unwrap_or_default();
        if !version.starts_with("2.") {
            return Err(parse(format!("its version is `{version}`, not 2")).into());
        }
        let mut document = Self { path: path.into(), json, bytes: Vec::new() };
        for list in ["extensionsUsed", "extensionsRequired"] {
            let mut names = document.list(list).iter().filter_map(Value::as_str);
            if let Some(name) = names.find(|name| NOT_READ.contains(name)) {
                return Err(document.content(list, format!("has `{name}`, which is not read here")));
            }
        }
        document.gather_buffers(chunk)?;
        document.gather_images()?;
        Ok(document)
    }

    /// An error about a field.
    pub(super) fn content(&self, field: impl Into<String>, reason: impl Into<String>) -> ExportError {
        GltfMeshError::Content { path: self.path.clone(), field: field.into(), reason: reason.into() }.into()
    }

    /// A list of the root; empty if there is none.
    pub(super) fn list(&self, name: &str) -> &[Value] {
        self.json[name].as_array().map_or(&[], Vec::as_slice)
    }

    /// An entry of a list of the root.
    pub(super) fn entry(&self, list: &str, index: usize) -> Result<&Value, ExportError> {
        let entry = self.list(list).get(index).filter(|entry| entry.is_object());
        entry.ok_or_else(|| self.content(format!("{list}[{index}]"), "is not there"))
    }

    /// Adds an entry to a list of the root; its number.
    pub(super) fn push(&mut self, list: &str, entry: Value) -> usize {
        if !self.json[list].is_array() {
            self.json[list] = json!([]);
        }
        let entries = self.json[list].as_array_mut();
        entries.map_or(0, |entries| {
            entries.push(entry);
            entries.len() - 1
        })
    }

    /// Adds bytes as a buffer view; its number. `target`: what they are for, if vertices or indices; `stride`: bytes from one
    /// vertex to the next.
    pub(super) fn push_view(&mut self, bytes: &[u8], target: Option<u32>, stride: Option<usize>) -> usize {
        let offset = self.append(bytes);
        let mut view = json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        if let Some(stride) = stride {
            view["byteStride"] = stride.into();
        }
        self.push("bufferViews", view)
    }

    /// The bytes of a buffer view.
    pub(super) fn view_bytes(&self, view: &Value) -> Option<&[u8]> {
        let (offset, length) = (number(&view["byteOffset"]).unwrap_or(0), number(&view["byteLength"])?);
        self.bytes.get(offset..offset.checked_add(length)?)
    }

    /// Says that an extension is used.
    pub(super) fn use_extension(&mut self, name: &str) {
        if !self.list("extensionsUsed").iter().any(|used| used == name) {
            self.push("extensionsUsed", name.into());
        }
    }

    /// The whole as a `.glb`.
    pub(super) fn to_glb(&self) -> Result<Vec<u8>, ExportError> {
        let mut json = self.json.clone();
        if !self.bytes.is_empty() {
            // Whatever the first buffer said about itself beside its length and place stays.
            let mut buffer = json["buffers"].get(0).filter(|buffer| buffer.is_object()).cloned();
            let buffer = buffer.get_or_insert_with(|| json!({}));
            if let Some(fields) = buffer.as_object_mut() {
                fields.remove("uri");
            }
            buffer["byteLength"] = self.bytes.len().into();
            json["buffers"] = json!([buffer]);
        }
        let mut text = serde_json::to_vec(&json)?;
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bytes = self.bytes.clone();
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        let binary = if bytes.is_empty() { 0 } else { 8 + bytes.len() };
        let length = 12 + 8 + text.len() + binary;
        let Ok(whole) = u32::try_from(length) else {
            let (value, max) = (length as u64, u32::MAX.into());
            return Err(ExportError::TooMany { path: self.path.clone(), what: "bytes", value, max });
        };
        let mut glb = Vec::with_capacity(length);
        glb.extend(b"glTF");
        glb.extend([2u32.to_le_bytes(), whole.to_le_bytes()].as_flattened());
        // Both are below the whole, which fits.
        for (kind, chunk) in [(b"JSON", text), (b"BIN\0", bytes)] {
            if !chunk.is_empty() {
                glb.extend((chunk.len() as u32).to_le_bytes());
                glb.extend(kind);
                glb.extend(chunk);
            }
        }
        Ok(glb)
    }

    /// Puts bytes at the end of the buffer, where any kind of number may begin; where that is.
    fn append(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bytes.len().next_multiple_of(4);
        self.bytes.resize(offset, 0);
        self.bytes.extend(bytes);
        offset
    }

    /// Lays all buffers behind each other.
    fn gather_buffers(&mut self, chunk: Option<&[u8]>) -> Result<(), ExportError> {
        let buffers = self.list("buffers").to_vec();
        let mut starts = Vec::new();
        for (index, buffer) in buffers.iter().enumerate() {
            let field = format!("buffers[{index}]");
            let length = number(&buffer["byteLength"]);
            let length = length.ok_or_else(|| self.content(&*field, "has no `byteLength`"))?;
            let read;
            let bytes = match (buffer["uri"].as_str(), chunk) {
                (Some(uri), _) => {
                    read = read_uri(&self.path, &field, uri)?;
                    read.as_slice()
                }
                (None, Some(chunk)) if index == 0 => chunk,
                _ => return Err(self.content(field, "has no `uri`, and there is no binary chunk for it")),
            };
            let bytes = bytes.get(..length).ok_or_else(|| self.content(field, "is longer than its data"))?;
            starts.push((self.append(bytes), length));
        }
        for index in 0..self.list("bufferViews").len() {
            let field = format!("bufferViews[{index}]");
            let view = &self.json["bufferViews"][index];
            let start = number(&view["buffer"]).and_then(|buffer| starts.get(buffer)).copied();
            let (offset, length) = (number(&view["byteOffset"]).unwrap_or(0), number(&view["byteLength"]));
            let inside = |(_, buffer): &(usize, usize)| {
                length.and_then(|length| offset.checked_add(length)).is_some_and(|end| end <= *buffer)
            };
            let Some((start, _)) = start.filter(inside) else {
                return Err(self.content(field, "does not lie in a buffer"));
            };
            let view = &mut self.json["bufferViews"][index];
            (view["buffer"], view["byteOffset"]) = (0.into(), (start + offset).into());
        }
        Ok(())
    }

    /// Takes pictures in.
    fn gather_images(&mut self) -> Result<(), ExportError> {
        for index in 0..self.list("images").len() {
            let image = self.entry("images", index)?.clone();
            let Some(uri) = image["uri"].as_str() else { continue };
            let field = format!("images[{index}]");
            let bytes = read_uri(&self.path, &field, uri)?;
            let Some(kind) = image["mimeType"].as_str().or_else(|| kind_of(&bytes)) else {
                return Err(self.content(field, "is no picture of a kind that is known"));
            };
            let kind = Value::from(kind);
            let view = self.push_view(&bytes, None, None);
            let image = &mut self.json["images"][index];
            if let Some(fields) = image.as_object_mut() {
                fields.remove("uri");
            }
            (image["bufferView"], image["mimeType"]) = (view.into(), kind);
        }
        Ok(())
    }
}

/// A number that says how many, or which.
pub(super) fn number(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|number| usize::try_from(number).ok())
}

/// What kind of picture bytes are, by how they begin.
fn kind_of(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => Some("image/png"),
        [0xff, 0xd8, 0xff, ..] => Some("image/jpeg"),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Some("image/webp"),
        [0xab, b'K', b'T', b'X', b' ', b'2', b'0', ..] => Some("image/ktx2"),
        _ => None,
    }
}

/// JSON and binary chunk of a `.glb`; of a `.gltf` all of it is JSON.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), &'static str> {
    let Some(rest) = bytes.strip_prefix(b"glTF") else { return Ok((bytes, None)) };
    let word = |at: usize| -> Option<usize> {
        let bytes: [u8; 4] = rest.get(at..at + 4)?.try_into().ok()?;
        Some(u32::from_le_bytes(bytes) as usize)
    };
    if word(0) != Some(2) {
        return Err("it is no binary glTF of version 2");
    }
    // The chunks, from behind the header on.
    let chunk = |at: usize, kind: &[u8]| -> Option<&[u8]> {
        let length = word(at)?;
        let content = at.checked_add(8)?;
        let is_kind = rest.get(at + 4..content)? == kind;
        is_kind.then(|| rest.get(content..content.checked_add(length)?)).flatten()
    };
    let json = chunk(8, b"JSON").ok_or("its JSON chunk is not whole")?;
    Ok((json, chunk(16 + json.len().next_multiple_of(4), b"BIN\0")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(json: &Value) -> Result<Document, ExportError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.gltf");
        std::fs::write(folder.path().join("a.bin"), [1, 2, 3, 4, 5, 6]).unwrap();
        std::fs::write(&path, json.to_string()).unwrap();
        Document::open(&path)
    }

    fn two_buffers() -> Value {
        json!({
            "asset": { "version": "2.0" },
            "extras": { "kept": [1.5] },
            "buffers": [
                { "uri": "a.bin", "byteLength": 5 },
                { "uri": "data:application/octet-stream;base64,CQgH", "byteLength": 3 },
            ],
            "bufferViews": [
                { "buffer": 0, "byteOffset": 1, "byteLength": 4 },
                { "buffer": 1, "byteLength": 3 },
            ],
        })
    }

    #[test]
    fn buffers_become_one_and_a_glb_comes_back() {
        let mut document = open(&two_buffers()).unwrap();
        document.push_view(&[42], None, None);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.glb");
        std::fs::write(&path, document.to_glb().unwrap()).unwrap();
        let again = Document::open(&path).unwrap();
        let bytes: Vec<_> =
            again.list("bufferViews").iter().map(|view| again.view_bytes(view).unwrap()).collect();
        assert_eq!(bytes, [[2, 3, 4, 5].as_slice(), &[9, 8, 7], &[42]]);
        assert_eq!(again.json["extras"], json!({ "kept": [1.5] }));
        assert_eq!(again.list("buffers").len(), 1);
    }

    #[test]
    fn what_is_wrong_is_named() {
        type Edit = fn(&mut Value);
        let edits: [(Edit, &str); 8] = [
            (|json| json["asset"]["version"] = "1.0".into(), "version"),
            (|json| json["buffers"][0]["uri"] = "../a.bin".into(), "outside"),
            (|json| json["buffers"][0]["uri"] = "/etc/hostname".into(), "outside"),
            (|json| json["buffers"][0]["uri"] = "gone.bin".into(), "gone.bin"),
            (|json| json["buffers"][0]["byteLength"] = 7.into(), "longer than its data"),
            (|json| json["bufferViews"][0]["byteLength"] = u64::MAX.into(), "bufferViews[0]"),
            (|json| json["images"] = json!([{ "uri": "a.bin" }]), "images[0]"),
            (|json| json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]), "draco"),
        ];
        for (edit, named) in edits {
            let mut json = two_buffers();
            edit(&mut json);
            let error = open(&json).unwrap_err().to_string();
            assert!(error.contains(named), "{named}: {error}");
        }
    }

    #[test]
    fn torn_files_are_errors() {
        for torn in [b"glTF".as_slice(), b"glTF\x02\0\0\0", b"glTF\x02\0\0\0\xff\0\0\0\xff\xff\xff\xffJSON{}"]
        {
            assert!(chunks(torn).is_err());
        }
    }
}
