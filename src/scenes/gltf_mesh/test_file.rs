//! A small glTF for tests.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

/// Writes a glTF with a triangle as its only accessor, to which the primitives of `json` refer as 0; `edit` makes it another
/// file. Its buffer is `corners.bin` beside it.
pub(crate) fn write_with_triangle(file: &Path, mut json: Value, edit: impl FnOnce(&mut Value)) -> PathBuf {
    let corners = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    json["asset"] = json!({ "version": "2.0" });
    json["buffers"] = json!([{ "uri": "corners.bin", "byteLength": 36 }]);
    json["bufferViews"] = json!([{ "buffer": 0, "byteLength": 36 }]);
    json["accessors"] = json!([{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
        "min": [0.0, 0.0, 0.0], "max": [1.0, 1.0, 0.0] }]);
    edit(&mut json);
    std::fs::write(file.with_file_name("corners.bin"), corners.map(f32::to_le_bytes).as_flattened()).unwrap();
    std::fs::write(file, json.to_string()).unwrap();
    file.to_path_buf()
}
