//! Whole scenes from files.

use std::sync::Arc;

use bevy::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::surface::{default_scale, placed};
use crate::material::PorousMaterial;
use crate::overlay::Weatherable;
use crate::scenes::gltf_mesh::SceneLayout;

/// A glTF: all meshes of its default scene, each a surface, with the materials of the file.
///
/// Skins and morph targets stand as their nodes and weights have them. Animations do not play, and lights and cameras of the file
/// are left out.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct SceneSpec {
    /// Unique; the names of its surfaces begin with it: `NAME.NODE` or, of a node that shows several primitives,
    /// `NAME.NODE.NUMBER`.
    pub name: String,
    /// `.glb` or `.gltf`.
    pub file: String,
    /// Position of its origin, metres.
    #[serde(default)]
    #[schemars(with = "[f32; 3]")]
    pub position: Vec3,
    /// Turns around Y, then X, then Z, degrees.
    #[serde(default)]
    #[schemars(with = "[f32; 3]")]
    pub rotation_deg: Vec3,
    /// Times as large, per axis; above 0.
    #[serde(default = "default_scale")]
    #[schemars(with = "[f32; 3]")]
    pub scale: Vec3,
    /// How its surfaces get wet; as unknown materials do if left out.
    #[serde(default)]
    pub porous: Option<PorousMaterial>,
    /// The maps of each of its surfaces; as large as the surface asks for if left out.
    #[serde(default)]
    pub maps: Option<Weatherable>,
    /// What is in the file, once it has been read; names are those of surfaces then.
    #[serde(skip)]
    pub(in crate::scenario) layout: Arc<SceneLayout>,
    /// The maps of its parts.
    #[serde(skip)]
    pub(in crate::scenario) part_maps: Arc<[Weatherable]>,
}

impl SceneSpec {
    /// A scene as its file has it.
    pub fn new(name: impl Into<String>, file: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            file: file.into(),
            position: Vec3::ZERO,
            rotation_deg: Vec3::ZERO,
            scale: Vec3::ONE,
            porous: None,
            maps: None,
            layout: Arc::default(),
            part_maps: Arc::default(),
        }
    }

    /// Where it stands.
    pub fn transform(&self) -> Transform {
        placed(self.position, self.rotation_deg, self.scale)
    }
}
