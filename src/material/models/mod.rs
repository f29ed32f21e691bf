//! What water does to the look of matter: one file per model, each with a twin in `shaders/common/`.
//!
//! | model | says | for |
//! |---|---|---|
//! | [`hnat`] | filled pores give back no diffuse light and mirror instead, per light | stone, clay, brick |
//! | [`film_on_pores`] | the same, with a film over what is not pore | the same, drenched |
//! | [`lagarde`] | the more porous, the darker and the glossier | anything, tuned by eye |
//! | [`lekner_dorf`] | a film over rough matter traps light | asphalt, plaster, wood |
//! | [`twomey`] | water between grains makes light go deeper | sand, soil |
//! | [`authored`] | whatever was painted | the rest |
//!
//! Each is a way to darken; a material uses one of them, so that darkenings never stack by accident.

pub mod authored;
pub mod film_on_pores;
pub mod hnat;
#[cfg(test)]
mod hnat_checks;
pub mod lagarde;
pub mod lekner_dorf;
pub mod twomey;
