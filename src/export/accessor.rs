//! Reading the numbers of a glTF, and adding some.
//!
//! Every offset, stride and count is held against the bytes that are there. Elements are kept as bytes, of whatever kind: what
//! is only moved to another vertex does not change.

use serde_json::{Value, json};

use super::ExportError;
use super::document::{ARRAY_BUFFER, Document, ELEMENT_ARRAY_BUFFER, number};

/// The most elements that are read.
const MAX_ELEMENTS: usize = 20_000_000;

/// What an accessor holds, element behind element without gaps.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Elements {
    /// `componentType`: 5120 to 5126.
    kind: u64,
    normalized: bool,
    /// `type`: `SCALAR`, `VEC3`, ...
    shape: String,
    parts: usize,
    pub(super) count: usize,
    bytes: Vec<u8>,
    /// Least and greatest values were told.
    bounded: bool,
}

fn kind_size(kind: u64) -> Option<usize> {
    match kind {
        5120 | 5121 => Some(1),
        5122 | 5123 => Some(2),
        5125 | 5126 => Some(4),
        _ => None,
    }
}

impl Document {
    /// What an accessor holds, sparse or not. Matrices are read as floats alone.
    pub(super) fn elements(&self, index: usize) -> Result<Elements, ExportError> {
        let accessor = self.entry("accessors", index)?;
        self.read(accessor).map_err(|reason| self.content(format!("accessors[{index}]"), reason))
    }

    fn read(&self, accessor: &Value) -> Result<Elements, String> {
        let kind = accessor["componentType"].as_u64().unwrap_or(0);
        let size = kind_size(kind).ok_or("has no `componentType` that is known")?;
        let shape = accessor["type"].as_str().unwrap_or_default();
        let parts = match shape {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" | "MAT2" => 4,
            "MAT3" => 9,
            "MAT4" => 16,
            _ => return Err("has no `type` that is known".into()),
        };
        if shape.starts_with("MAT") && size != 4 {
            return Err("holds matrices that are not of floats".into());
        }
        let count = number(&accessor["count"]).ok_or("has no `count`")?;
        if count > MAX_ELEMENTS {
            return Err(format!("has {count} elements; at most {MAX_ELEMENTS} are read"));
        }
        let element = size * parts;
        let mut bytes = match number(&accessor["bufferView"]) {
            Some(view) => {
                let offset = number(&accessor["byteOffset"]).unwrap_or(0);
                self.strided(view, offset, element, count)?
            }
            // Zeros, but for what is sparse.
            None => vec![0; element * count],
        };
        let sparse = &accessor["sparse"];
        if sparse.is_object() {
            let some = number(&sparse["count"]).filter(|&some| some <= count);
            let some = some.ok_or("has a sparse part without a `count` that fits")?;
            let part = |name: &str, size: usize| -> Result<Vec<u8>, String> {
                let part = &sparse[name];
                let view = number(&part["bufferView"]).ok_or("has a sparse part without a `bufferView`")?;
                self.strided(view, number(&part["byteOffset"]).unwrap_or(0), size, some)
            };
            let place_kind = sparse["indices"]["componentType"].as_u64().unwrap_or(0);
            let place_size = kind_size(place_kind).ok_or("has a sparse part of a kind that is not known")?;
            let places = part("indices", place_size)?;
            let values = part("values", element)?;
            for (place, value) in places.chunks_exact(place_size).zip(values.chunks_exact(element)) {
                let at = (whole(place_kind, place) as usize).saturating_mul(element);
                let there = bytes.get_mut(at..at.saturating_add(element));
                there.ok_or("has a sparse part that points beyond its end")?.copy_from_slice(value);
            }
        }
        let normalized = accessor["normalized"].as_bool().unwrap_or(false);
        let bounded = accessor["min"].is_array() || accessor["max"].is_array();
        Ok(Elements { kind, normalized, shape: shape.into(), parts, count, bytes, bounded })
    }

    /// `count` elements of a buffer view, without what lies between them.
    fn strided(&self, view: usize, offset: usize, size: usize, count: usize) -> Result<Vec<u8>, String> {
        let view = self.list("bufferViews").get(view).ok_or("is of a `bufferView` that is not there")?;
        let stride = number(&view["byteStride"]).unwrap_or(size);
        let torn = "does not fit into its buffer view, or that not into its buffer";
        let bytes = self.view_bytes(view).and_then(|bytes| bytes.get(offset..)).ok_or(torn)?;
        let last = count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size));
        if stride < size || last.is_none_or(|end| end > bytes.len()) {
            return Err(torn.into());
        }
        let mut all = Vec::with_capacity(size * count);
        (0..count).for_each(|i| all.extend(&bytes[i * stride..i * stride + size]));
        Ok(all)
    }

    /// Adds values of vertices; the number of their accessor.
    pub(super) fn push_elements(&mut self, elements: &Elements) -> usize {
        let tight = elements.element_size();
        let stride = tight.next_multiple_of(4);
        let mut bytes = Vec::with_capacity(stride * elements.count);
        for element in elements.bytes.chunks_exact(tight) {
            bytes.extend(element);
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
        let view = self.push_view(&bytes, Some(ARRAY_BUFFER), (stride != tight).then_some(stride));
        let mut accessor = json!({
            "bufferView": view, "componentType": elements.kind, "count": elements.count, "type": elements.shape,
        });
        if elements.normalized {
            accessor["normalized"] = true.into();
        }
        if elements.bounded {
            let (least, most) = elements.bounds();
            (accessor["min"], accessor["max"]) = (json!(least), json!(most));
        }
        self.push("accessors", accessor)
    }

    /// Adds vectors of floats for vertices; the number of their accessor.
    pub(super) fn push_floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        self.push_vectors(values, false)
    }

    /// The same of positions, whose bounds a reader is told.
    pub(super) fn push_points(&mut self, values: &[[f32; 3]]) -> usize {
        self.push_vectors(values, true)
    }

    fn push_vectors<const N: usize>(&mut self, values: &[[f32; N]], bounded: bool) -> usize {
        self.push_elements(&Elements {
            kind: 5126,
            normalized: false,
            shape: format!("VEC{N}"),
            parts: N,
            count: values.len(),
            bytes: values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect(),
            bounded,
        })
    }

    /// Adds the corners of triangles; the number of their accessor.
    pub(super) fn push_corners(&mut self, corners: &[[u32; 3]]) -> usize {
        let flat = corners.as_flattened();
        // The greatest index of a kind may stand for a new strip.
        let short = flat.iter().all(|&corner| corner < u32::from(u16::MAX));
        let (kind, bytes): (u64, Vec<u8>) = if short {
            (5123, flat.iter().flat_map(|&corner| (corner as u16).to_le_bytes()).collect())
        } else {
            (5125, flat.iter().flat_map(|corner| corner.to_le_bytes()).collect())
        };
        let view = self.push_view(&bytes, Some(ELEMENT_ARRAY_BUFFER), None);
        self.push(
            "accessors",
            json!({ "bufferView": view, "componentType": kind, "count": flat.len(), "type": "SCALAR" }),
        )
    }
}

impl Elements {
    fn element_size(&self) -> usize {
        kind_size(self.kind).unwrap_or(1) * self.parts
    }

    /// Vectors of floats; `None` if they have not so many parts.
    pub(super) fn floats<const N: usize>(&self) -> Option<Vec<[f32; N]>> {
        let size = kind_size(self.kind)?;
        let one = |bytes: &[u8]| {
            let number = |i: usize| decoded(self.kind, self.normalized, &bytes[i * size..]) as f32;
            std::array::from_fn(number)
        };
        (self.parts == N).then(|| self.bytes.chunks_exact(size * N).map(one).collect())
    }

    /// Whole numbers; `None` if they are none.
    pub(super) fn indices(&self) -> Option<Vec<u32>> {
        let size = kind_size(self.kind)?;
        let fits = self.parts == 1 && matches!(self.kind, 5121 | 5123 | 5125);
        fits.then(|| self.bytes.chunks_exact(size).map(|bytes| whole(self.kind, bytes)).collect())
    }

    /// The elements at these places, which are there.
    pub(super) fn gathered(&self, places: &[u32]) -> Self {
        let size = self.element_size();
        let element = |&place: &u32| &self.bytes[place as usize * size..][..size];
        Self {
            count: places.len(),
            bytes: places.iter().flat_map(element).copied().collect(),
            shape: self.shape.clone(),
            ..*self
        }
    }

    /// Least and greatest value of each part, as they are stored.
    fn bounds(&self) -> (Vec<f64>, Vec<f64>) {
        let size = kind_size(self.kind).unwrap_or(1);
        let mut bounds = (vec![f64::INFINITY; self.parts], vec![f64::NEG_INFINITY; self.parts]);
        for (at, bytes) in self.bytes.chunks_exact(size).enumerate() {
            let (part, value) = (at % self.parts, decoded(self.kind, false, bytes));
            bounds.0[part] = bounds.0[part].min(value);
            bounds.1[part] = bounds.1[part].max(value);
        }
        bounds
    }
}

/// A number of at least as many bytes as its kind has.
fn decoded(kind: u64, normalized: bool, bytes: &[u8]) -> f64 {
    let (value, most) = match kind {
        5120 => (f64::from(bytes[0] as i8), 127.0),
        5122 => (f64::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32_767.0),
        5121 => (f64::from(bytes[0]), 255.0),
        5123 => (f64::from(whole(kind, bytes)), 65_535.0),
        5126 => return f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]).into(),
        _ => return whole(kind, bytes).into(),
    };
    if normalized { (value / most).max(-1.0) } else { value }
}

/// A whole number of at least as many bytes as its kind has; 0 for kinds that are not.
fn whole(kind: u64, bytes: &[u8]) -> u32 {
    match kind {
        5121 => bytes[0].into(),
        5123 => u16::from_le_bytes([bytes[0], bytes[1]]).into(),
        5125 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    fn document() -> Document {
        Document { path: PathBuf::from("scene.gltf"), json: json!({}), bytes: Vec::new() }
    }

    #[test]
    fn what_is_added_is_read_again_and_moved() {
        let mut document = document();
        let values = [[1.0f32, -2.0, 3.5], [4.0, 5.0, 6.0], [7.0, 8.0, -9.0]];
        let floats = document.push_floats(&values);
        let corners = document.push_corners(&[[2, 0, 1]]);
        let elements = document.elements(floats).unwrap();
        assert_eq!(elements.floats::<3>().unwrap(), values);
        assert!(elements.floats::<2>().is_none() && elements.indices().is_none());
        assert_eq!(document.elements(corners).unwrap().indices().unwrap(), [2, 0, 1]);
        let moved = elements.gathered(&[2, 2, 0]);
        assert_eq!(moved.floats::<3>().unwrap(), [values[2], values[2], values[0]]);
        assert_eq!(moved.bounds(), (vec![1.0, -2.0, -9.0], vec![7.0, 8.0, 3.5]));
    }

    #[test]
    fn bytes_are_padded_to_words_with_a_stride_and_sparse_parts_are_laid_over() {
        let mut document = document();
        let view = document.push_view(&[1, 2, 3, 9, 4, 5, 6, 9], None, Some(4));
        let places = document.push_view(&[1], None, None);
        let values = document.push_view(&[255, 0, 51], None, None);
        let accessor = json!({
            "bufferView": view, "componentType": 5121, "normalized": true, "count": 2, "type": "VEC3",
            "min": [1, 0, 3], "max": [255, 2, 51],
            "sparse": {
                "count": 1,
                "indices": { "bufferView": places, "componentType": 5121 },
                "values": { "bufferView": values },
            },
        });
        let index = document.push("accessors", accessor);
        let elements = document.elements(index).unwrap();
        assert_eq!(elements.floats::<3>().unwrap()[1], [1.0, 0.0, 0.2]);
        let pushed = document.push_elements(&elements);
        assert_eq!(document.elements(pushed).unwrap(), elements);
        let accessor = document.entry("accessors", pushed).unwrap().clone();
        assert_eq!(
            (&accessor["min"], &accessor["max"]),
            (&json!([1.0, 0.0, 3.0]), &json!([255.0, 2.0, 51.0]))
        );
        let view = &document.list("bufferViews")[number(&accessor["bufferView"]).unwrap()];
        assert_eq!((&view["byteStride"], &view["byteLength"]), (&json!(4), &json!(8)));
        document.json["accessors"][index]["count"] = 3.into();
        assert!(document.elements(index).is_err());
    }
}
