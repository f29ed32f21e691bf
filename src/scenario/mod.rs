//! Scenes that run by themselves: what is there, what falls on it, for how long, seen from where.
//!
//! A [`Scenario`] is a RON file. [`Scenario::load`] reads and checks it before anything else happens; every error
//! names the file, the field and the value. [`ScenarioPlugin`] spawns it and moves its emitters and camera by the
//! weathering clock, so that a run depends on nothing but the file and the seed; [`Digest`] proves it.
//!
//! Paths in the file are relative to its *tree*: the folder of the file or, where that folder is called
//! `scenarios`, the one above, so that scenarios share `models/` and `textures/` beside them. Nothing outside the
//! tree is ever read.

mod content;
mod digest;
mod error;
mod gltf_uris;
mod load;
mod motion;
mod reset;
mod schema;
mod spawn;
mod validate;

pub use content::SurfaceMesh;
pub use digest::{Digest, amounts_digest};
pub use error::ScenarioError;
pub use load::LoadedScenario;
pub use motion::ScenarioCamera;
pub use reset::reset_scenario;
pub use schema::{
    CameraKey, CameraSpec, EmitterKey, EmitterSpec, EnvironmentSpec, MapBudgetSpec, MaterialSpec, MeshSpec,
    Scenario, SunSpec, SurfaceSpec, SurfaceTextureSpec, TextureSpec, WeatherSpec, WetMapSpec,
};
pub use spawn::{ScenarioPlugin, ScenarioStatus, ScenarioSurface};
pub(crate) use validate::check_weather;
