//! The present state of a running app, as a scene for other engines.
//!
//! [`Snapshot::take`] reads all surfaces of a world: the meshes they show, their dry materials with their textures, what
//! lies on them. That is quick, and the app may go on; [`Snapshot::bake`] makes a glTF of it, on any thread, and gives it the
//! wet forms of its materials in the same way as [`bake`](fn@super::bake) does with a file. Meshes that code has made and
//! meshes from files are the same here.
//!
//! Colour maps that are on the GPU have to be read back first ([`ColorReadback`]); those of apps without a renderer are found.
//!
//! What it does not take is told at [`Snapshot`].

mod colors;
mod material;
mod mesh;
mod pictures;
mod take;

use std::path::PathBuf;
use std::sync::Arc;

use serde_json::{Value, json};

use super::bake::{Surface, texture_size, write_wet};
use super::document::{Document, number};
use super::look::WetModel;
use super::soaked::Soaked;
use super::texture::Pictures;
use super::write::Writer;
use super::{Export, ExportError, ExportOptions, ExportReport};
use crate::material::PorousMaterial;
use crate::matter::MatterLook;
use crate::replay::SurfaceMaps;
use material::Looks;
use mesh::LiveMesh;

pub use colors::{ColorReadback, SurfaceColors};

/// All surfaces of a world at a moment.
///
/// They stand where they are. What joints or morph targets pose keeps its pose of the moment, as a rigid mesh: skins and
/// animations stay in the file that the mesh came from, and [`bake`](fn@super::bake) keeps them.
///
/// # Limits
/// Only surfaces come along, not what stands around them; lights and cameras neither. Of a `StandardMaterial`: colour,
/// roughness, metallic, normals, occlusion, emission, reflectance, alpha, both sides, the transform of its uvs; other
/// materials count as plain white. Textures must be 8-bit RGBA or red alone, with their data in main memory. Played wet maps,
/// floods, ripples and salts are not baked.
#[derive(Debug, Clone)]
pub struct Snapshot {
    /// What errors call it.
    path: PathBuf,
    looks: Looks,
    meshes: Vec<LiveMesh>,
    surfaces: Vec<Shown>,
    matter: MatterLook,
    /// All but its surfaces.
    report: ExportReport,
}

/// A surface that is shown.
#[derive(Debug, Clone)]
struct Shown {
    name: String,
    /// Numbers of its mesh and of its dry material.
    mesh: usize,
    material: usize,
    /// Where it stands: fields of its node.
    node: Value,
    /// The uvs that its maps lie over.
    set: usize,
    porous: PorousMaterial,
    /// `None` without maps: it stays dry.
    state: Option<(Soaked, SurfaceMaps)>,
}

impl Snapshot {
    /// Makes the scene. `size`: texels along each side of the baked textures, 16 to [`ExportOptions::MAX_TEXTURE_SIZE`];
    /// without, as many as the largest texture of the material has, but from those of the maps to 2048.
    ///
    /// # Errors
    /// [`ExportError`]: a size out of range, maps that lie over uvs that repeat, pictures that cannot be made.
    pub fn bake(&self, size: Option<u32>) -> Result<Export, ExportError> {
        ExportOptions::check_texture_size(size)?;
        let document = self.document()?;
        let places = document.places()?;
        let (mut pictures, mut wet) = (Pictures::default(), Vec::new());
        for (place, shown) in places.into_iter().zip(&self.surfaces) {
            let Some((soaked, maps)) = &shown.state else { continue };
            let shape = document.shape_over(&place, shown.set)?;
            if shape.repeats() {
                let reason = "has maps over texture coordinates that repeat, so they cannot be a texture; give it \
                              unique ones (`uv: Unique`)";
                return Err(self.unwritable(&shown.name, reason));
            }
            let primitive = &document.entry("meshes", place.mesh)?["primitives"][place.primitive];
            let source = document.source(number(&primitive["material"]), &mut pictures)?;
            wet.push((Surface { place, shape: Arc::new(shape), source }, shown, soaked, maps));
        }
        let places: Vec<_> = wet.iter().map(|(surface, ..)| &surface.place).collect();
        let mut writer = Writer::new(document, &places);
        let (mut rows, mut all_maps) = (Vec::new(), Vec::new());
        for (surface, shown, soaked, maps) in &wet {
            let model = WetModel::new(&shown.porous, self.matter);
            let size = texture_size(&surface.source, size, maps.size);
            // Files are called as the surface is in the scene: names of entities need not differ.
            let maps = SurfaceMaps { name: surface.place.name.clone(), ..(*maps).clone() };
            rows.push(write_wet(&mut writer, surface, &model, soaked, &maps, size)?);
            all_maps.push(maps);
        }
        let report = ExportReport { surfaces: rows, ..self.report.clone() };
        Ok(Export { glb: writer.document.to_glb()?, maps: all_maps, report })
    }

    /// The scene as it is when it is dry: a node, a mesh and a primitive for each surface, in their order.
    fn document(&self) -> Result<Document, ExportError> {
        let asset =
            json!({ "version": "2.0", "generator": concat!("bevy_weathering ", env!("CARGO_PKG_VERSION")) });
        let roots: Vec<usize> = (0..self.surfaces.len()).collect();
        let mut document = Document {
            path: self.path.clone(),
            json: json!({ "asset": asset, "scene": 0, "scenes": [{ "nodes": roots }] }),
            bytes: Vec::new(),
        };
        self.looks.push(&mut document)?;
        let primitives: Vec<Value> = self.meshes.iter().map(|mesh| mesh.push(&mut document)).collect();
        for shown in &self.surfaces {
            // Vertices are there once; the material is the surface's own.
            let mut primitive = primitives.get(shown.mesh).cloned().unwrap_or_default();
            primitive["material"] = shown.material.into();
            let mesh = document.push("meshes", json!({ "name": shown.name, "primitives": [primitive] }));
            let mut node = shown.node.clone();
            (node["name"], node["mesh"]) = (shown.name.clone().into(), mesh.into());
            document.push("nodes", node);
        }
        Ok(document)
    }

    fn unwritable(&self, surface: &str, reason: impl Into<String>) -> ExportError {
        ExportError::Look { path: self.path.clone(), surface: surface.into(), reason: reason.into() }
    }
}
