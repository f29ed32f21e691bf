//! What the URIs of a glTF stand for.

use std::borrow::Cow;
use std::path::{Component, Path};

use base64::prelude::{BASE64_STANDARD, Engine};
use percent_encoding::percent_decode_str;

use super::{GltfMeshError, MAX_FILE_BYTES};
use crate::input::require_file;

/// A file of at most [`MAX_FILE_BYTES`].
pub(crate) fn read_capped(path: &Path) -> Result<Vec<u8>, GltfMeshError> {
    let read = |source| GltfMeshError::Read { path: path.into(), source };
    require_file(path).map_err(read)?;
    let size = std::fs::metadata(path).map_err(read)?.len();
    if size > MAX_FILE_BYTES {
        return Err(GltfMeshError::TooLarge { path: path.into(), size, max: MAX_FILE_BYTES });
    }
    std::fs::read(path).map_err(read)
}

/// The bytes that a URI stands for.
pub(crate) fn read_uri(path: &Path, field: &str, uri: &str) -> Result<Vec<u8>, GltfMeshError> {
    let content = |reason: &str| GltfMeshError::Content {
        path: path.into(),
        field: field.into(),
        reason: reason.into(),
    };
    let decoded =
        percent_decoded(uri).ok_or_else(|| content("has a `uri` whose escapes stand for no text"))?;
    if let Some((kind, data)) = data_uri(&decoded) {
        let bytes = kind.ends_with(";base64").then(|| BASE64_STANDARD.decode(data).ok()).flatten();
        return bytes.ok_or_else(|| content("has a `data:` URI that is not base64"));
    }
    let outside =
        || GltfMeshError::Outside { path: path.into(), field: format!("{field}.uri"), uri: uri.into() };
    let relative = Path::new(&*decoded);
    let plain = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
    if decoded.is_empty() || !relative.components().all(plain) {
        return Err(outside());
    }
    let read = |path: &Path, source| GltfMeshError::Read { path: path.into(), source };
    let file = path.canonicalize().map_err(|source| read(path, source))?;
    let folder = file.parent().unwrap_or(Path::new("/"));
    let named = folder.join(relative);
    let buffer = named.canonicalize().map_err(|source| read(&named, source))?;
    // A link may lead anywhere.
    if buffer.starts_with(folder) { read_capped(&buffer) } else { Err(outside()) }
}

/// A URI without its `%XX`; `None` if what they stand for is no text.
pub(crate) fn percent_decoded(uri: &str) -> Option<Cow<'_, str>> {
    percent_decode_str(uri).decode_utf8().ok()
}

/// Kind and content of a decoded `data:` URI. `None` for anything that Bevy would take for a path: also one without a
/// comma.
pub(crate) fn data_uri(decoded: &str) -> Option<(&str, &str)> {
    decoded.strip_prefix("data:")?.split_once(',')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_are_seen_through() {
        assert_eq!(percent_decoded("a%20b%2e%2E%2Fc").as_deref(), Some("a b../c"));
        assert_eq!(percent_decoded("100%+1%2").as_deref(), Some("100%+1%2"));
        assert_eq!(percent_decoded("%ff"), None);
    }

    #[test]
    fn data_is_told_from_paths_after_its_escapes_are_decoded() {
        let path = Path::new("scene.gltf");
        for uri in ["data:x;base64,Zm8=", "data%3Ax%3Bbase64%2CZm8%3D", "data:;base64,Zm8="] {
            assert_eq!(read_uri(path, "buffers[0]", uri).unwrap(), b"fo", "{uri}");
        }
        let error = |uri| read_uri(path, "buffers[0]", uri).unwrap_err().to_string();
        for uri in ["data:x;base64,Zm8", "data:x;base64,Zm9v!", "data:x,Zm9v"] {
            assert!(
                error(uri).contains("`buffers[0]`") && error(uri).contains("not base64"),
                "{}",
                error(uri)
            );
        }
        assert!(error("a%ff.bin").contains("escapes"), "{}", error("a%ff.bin"));
        assert!(error("data:/../../a.bin").contains("outside"), "{}", error("data:/../../a.bin"));
    }
}
