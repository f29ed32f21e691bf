//! What the URIs of a glTF stand for.

use std::path::{Component, Path};

use super::{GltfMeshError, MAX_FILE_BYTES};

pub(super) fn read_capped(path: &Path) -> Result<Vec<u8>, GltfMeshError> {
    let read = |source| GltfMeshError::Read { path: path.into(), source };
    let size = std::fs::metadata(path).map_err(read)?.len();
    if size > MAX_FILE_BYTES {
        return Err(GltfMeshError::TooLarge { path: path.into(), size, max: MAX_FILE_BYTES });
    }
    std::fs::read(path).map_err(read)
}

/// The bytes that a URI stands for.
pub(super) fn read_uri(path: &Path, field: &str, uri: &str) -> Result<Vec<u8>, GltfMeshError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let bytes = data.split_once(";base64,").and_then(|(_, encoded)| base64_decoded(encoded));
        let reason = "has a `data:` URI that is not base64".into();
        return bytes.ok_or(GltfMeshError::Content { path: path.into(), field: field.into(), reason });
    }
    let outside =
        || GltfMeshError::Outside { path: path.into(), field: format!("{field}.uri"), uri: uri.into() };
    let decoded = percent_decoded(uri).ok_or_else(outside)?;
    let relative = Path::new(&decoded);
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
pub(crate) fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        let hex = (*first == b'%').then(|| std::str::from_utf8(tail.get(..2)?).ok()).flatten();
        if let Some(byte) = hex.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            bytes.push(byte);
            rest = &tail[2..];
        } else {
            bytes.push(*first);
            rest = tail;
        }
    }
    String::from_utf8(bytes).ok()
}

/// RFC 4648, with or without padding; `None` if a letter is none of its.
fn base64_decoded(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0u32, 0u32);
    for letter in text.trim_end_matches('=').bytes() {
        let value = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = (bits << 6) | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_escapes_are_decoded() {
        let cases: [(&str, &[u8]); 5] =
            [("", b""), ("Zg==", b"f"), ("Zm8=", b"fo"), ("Zm9v", b"foo"), ("+/8", b"\xfb\xff")];
        for (text, bytes) in cases {
            assert_eq!(base64_decoded(text).as_deref(), Some(bytes), "{text}");
        }
        assert_eq!(base64_decoded("Zm9v!"), None);
        assert_eq!(percent_decoded("a%20b%2Fc%").as_deref(), Some("a b/c%"));
    }
}
