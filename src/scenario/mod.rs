//! Scenes that run by themselves: what is there, what falls on it, for how long, seen from where.
//!
//! A [`Scenario`] is a RON file. [`Scenario::load`] reads and checks it before anything else happens; every error
//! names the file, the field and the value. [`ScenarioPlugin`] spawns it and moves its emitters and camera by the
//! weathering clock, so that a run depends on nothing but the file and the seed; [`Digest`] proves it.
//!
//! A file may include others and have variants ([`ScenarioPart`]); what happens when is a list of events ([`EventSpec`]),
//! which also take pictures and say what has to be true ([`Expectations`]). All fields, with units and defaults, are in
//! `docs/scenarios.md`; [`schema_json`] is the same for programs.
//!
//! What can get wet are meshes with materials of the scenario's own ([`SurfaceSpec`]) and whole glTFs with theirs ([`SceneSpec`]).
//! [`LoadedScenario::of_model`] is a scenario of nothing but one of these, which so can be all that a scenario can.
//!
//! Paths in the file are relative to its *tree*: the folder of the file or, where that folder is called
//! `scenarios`, the one above, so that scenarios share `models/` and `textures/` beside them. Nothing outside the
//! tree is ever read.

mod content;
mod digest;
mod error;
mod files;
mod follow;
mod gltf_images;
mod gltf_limits;
mod gltf_uris;
mod load;
mod merge;
mod model;
mod motion;
mod reset;
mod scene_spawn;
mod scenes;
mod schema;
mod spawn;
mod switch;
#[cfg(test)]
mod test_app;
mod timeline;
mod validate;

pub use content::SurfaceMesh;
pub use digest::{Digest, amounts_digest, scene_digest};
pub use error::ScenarioError;
pub use load::LoadedScenario;
pub(crate) use load::ron_options;
pub use motion::{ByHand, ScenarioCamera};
pub use reset::reset_scenario;
pub(crate) use scenes::MadeOf;
pub use schema::schema_json;
pub use schema::{
    CameraKey, CameraSpec, EmitterChange, EmitterKey, EmitterSpec, EnvironmentSpec, MapBudgetSpec,
    MaterialSpec, MeshSpec, Scenario, ScenarioPart, SceneSpec, SunSpec, SurfaceSpec, SurfaceTextureSpec,
    TextureSpec, WeatherPart, WeatherSpec, WetMapSpec,
};
pub use spawn::{AssetTree, ScenarioPlugin, ScenarioStatus, ScenarioSurface, SceneEntity};
pub(crate) use spawn::{OwnEffect, spawn_emitter};
pub use switch::{PreparedScenario, switch_scenario};
pub use timeline::{
    Action, BrushEvent, CameraMove, EmitterAdjustment, EmitterMove, EventSpec, Expectation,
    ExpectationOutcome, Expectations, MaterialChange, Quantity, WeatherChange,
};
pub(crate) use timeline::{
    append_events, beginning_of, captures, exchange_events, exports, rewind, tick_from, ticks_in,
    weather_is_changing,
};
pub(crate) use validate::check_weather;
