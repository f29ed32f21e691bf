//! Weathering baked into a scene, for other engines.
//!
//! [`bake`] reads any glTF, lets it rain on all of its meshes as a replay without pictures does, and gives back the same scene
//! as one `.glb`: nodes, skins, animations and whatever is not understood as they were. Each primitive that a node shows has a
//! material of its own that is wet: base colour, roughness and normals with the water in them, by the models of
//! [`material`](crate::material). The dry material stays; `KHR_materials_variants` names both, and wet is what a
//! reader without variants shows.
//!
//! Maps lie over unique texture coordinates. Where a mesh has none, it is cut into charts
//! ([`unwrap`](crate::unwrap)) that become its next `TEXCOORD_`, and what the material's own textures show is drawn anew there;
//! those textures keep the uvs that they had. Instances of one mesh share their vertices, not their materials.
//!
//! [`Snapshot`] is the same for a running app: its surfaces as they are now, wherever their meshes come from.
//!
//! No graphics driver is needed, and nothing is written before all of it is made.
//!
//! # Limits
//! Skins stand in their bind pose and morph targets are not applied while it rains. Vertex colours are left to the reader, who
//! multiplies what is baked by them. Where a mesh was cut and its dry material has a normal map, the wet one has another frame
//! of tangents: none are stored then, and a reader should make them for the uvs of each map, as glTF says; one that makes them
//! for `TEXCOORD_0` alone (Bevy does) turns the wet normals. Textures must be PNG or JPEG; compressed meshes and GPU instances are
//! refused.
//!
//! Khronos Group 2021, *glTF 2.0 specification*; *KHR_materials_variants*; *KHR_texture_transform*.

mod accessor;
mod bake;
mod document;
mod error;
mod live;
mod look;
mod material;
mod options;
mod paint;
mod rain;
mod raster;
mod report;
mod scene;
mod shape;
mod simulate;
mod soaked;
mod texture;
mod write;

pub use bake::{Export, MAX_MAP_TEXELS, bake};
pub use error::ExportError;
pub use live::{ColorReadback, Snapshot, SurfaceColors};
pub use options::ExportOptions;
pub use report::{BakedSurface, ExportReport};
