//! A small scene: a ground with a roof over it that is the same mesh, a wall whose uvs tile, a strip without any.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::{ImageFormat, Rgb, RgbImage};
use serde_json::{Value, json};

/// A glTF that is put together.
pub struct Builder {
    pub json: Value,
    bytes: Vec<u8>,
}

impl Builder {
    /// A glTF with an empty scene.
    pub fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0", "generator": "a test" },
            "extras": { "author": "somebody" },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "accessors": [], "bufferViews": [], "images": [], "textures": [], "materials": [], "meshes": [],
            "cameras": [{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }],
        });
        Self { json, bytes: Vec::new() }
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        self.bytes.extend(bytes);
        self.push("bufferViews", view)
    }

    pub fn push(&mut self, list: &str, entry: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(entry);
        list.len() - 1
    }

    pub fn vectors<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..N).map(|part| values.iter().map(|value| value[part]).reduce(pick).unwrap()).collect()
        };
        self.push(
            "accessors",
            json!({
                "bufferView": view, "componentType": 5126, "count": values.len(), "type": format!("VEC{N}"),
                "min": bound(f32::min), "max": bound(f32::max),
            }),
        )
    }

    /// Numbers by themselves.
    pub fn scalars(&mut self, values: &[f32]) -> usize {
        let all: Vec<[f32; 1]> = values.iter().map(|&value| [value]).collect();
        let accessor = self.vectors(&all);
        self.json["accessors"][accessor]["type"] = "SCALAR".into();
        accessor
    }

    /// Matrices, column by column.
    pub fn matrices(&mut self, values: &[[f32; 16]]) -> usize {
        let accessor = self.vectors(values);
        self.json["accessors"][accessor]["type"] = "MAT4".into();
        accessor
    }

    /// Joints of vertices.
    pub fn joints(&mut self, joints: &[[u8; 4]]) -> usize {
        let view = self.view(joints.as_flattened());
        let accessor =
            json!({ "bufferView": view, "componentType": 5121, "count": joints.len(), "type": "VEC4" });
        self.push("accessors", accessor)
    }

    pub fn corners(&mut self, corners: &[u16]) -> usize {
        let bytes: Vec<u8> = corners.iter().flat_map(|corner| corner.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let accessor =
            json!({ "bufferView": view, "componentType": 5123, "count": corners.len(), "type": "SCALAR" });
        self.push("accessors", accessor)
    }

    fn texture(&mut self, picture: &RgbImage) -> usize {
        let mut png = Cursor::new(Vec::new());
        picture.write_to(&mut png, ImageFormat::Png).unwrap();
        let view = self.view(png.get_ref());
        let image = self.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
        self.push("textures", json!({ "source": image }))
    }

    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bytes = self.bytes.clone();
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        let mut glb = b"glTF\x02\0\0\0".to_vec();
        glb.extend((28 + text.len() as u32 + bytes.len() as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", text), (b"BIN\0", bytes)] {
            glb.extend((chunk.len() as u32).to_le_bytes());
            glb.extend(kind);
            glb.extend(chunk);
        }
        glb
    }

    pub fn write(&self, folder: &Path) -> PathBuf {
        let path = folder.join("scene.glb");
        std::fs::write(&path, self.glb()).unwrap();
        path
    }
}

/// Nodes: 0 carries the others, 1 ground, 2 roof, 3 wall, 4 strip. Meshes: 0 ground and roof, 1 wall, 2 strip.
pub fn scene() -> Builder {
    let mut scene = Builder::new();
    let brick = scene.texture(&RgbImage::from_fn(8, 8, |x, y| {
        if (x + y) % 2 == 0 { Rgb([190, 110, 90]) } else { Rgb([150, 80, 60]) }
    }));
    let bumps = scene.texture(&RgbImage::from_fn(4, 4, |x, _| {
        if x < 2 { Rgb([190, 128, 235]) } else { Rgb([66, 128, 235]) }
    }));
    scene.json["materials"] = json!([
        {
            "name": "brick",
            "pbrMetallicRoughness": { "baseColorTexture": { "index": brick }, "metallicFactor": 0.0 },
        },
        {
            "name": "bumpy",
            "doubleSided": true,
            "normalTexture": { "index": bumps },
            "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.4, 0.3, 1.0], "metallicFactor": 0.0 },
        },
    ]);

    let level = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]];
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0f32]];
    let corners = scene.corners(&[0, 2, 1, 0, 3, 2]);
    let primitive = json!({
        "attributes": {
            "POSITION": scene.vectors(&level),
            "NORMAL": scene.vectors(&[[0.0, 1.0, 0.0]; 4]),
            "TEXCOORD_0": scene.vectors(&square),
        },
        "indices": corners, "material": 0,
    });
    scene.push("meshes", json!({ "name": "slab", "primitives": [primitive] }));

    let upright = [[-1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]];
    let tiled = square.map(|uv| uv.map(|part| part * 3.0));
    let primitive = json!({
        "attributes": {
            "POSITION": scene.vectors(&upright),
            "NORMAL": scene.vectors(&[[0.0, 0.0, 1.0]; 4]),
            "TEXCOORD_0": scene.vectors(&tiled),
            "COLOR_0": scene.vectors(&[[1.0, 1.0, 1.0]; 4]),
        },
        "indices": scene.corners(&[0, 2, 1, 0, 3, 2]), "material": 1,
    });
    scene.push("meshes", json!({ "name": "wall", "primitives": [primitive] }));

    let strip = [[4.0, 0.0, 0.0], [4.0, 0.0, 1.0], [5.0, 0.0, 0.0], [5.0, 0.0, 1.0f32]];
    let primitive = json!({ "attributes": { "POSITION": scene.vectors(&strip) }, "mode": 5 });
    scene.push("meshes", json!({ "primitives": [primitive] }));

    scene.json["nodes"] = json!([
        { "name": "all", "children": [1, 2, 3, 4] },
        { "name": "ground", "mesh": 0, "extras": { "kept": true } },
        { "name": "roof", "mesh": 0, "translation": [0.0, 1.0, 0.0], "scale": [0.5, 0.5, 0.5] },
        { "name": "wall", "mesh": 1 },
        { "name": "strip", "mesh": 2, "camera": 0 },
    ]);
    scene
}
