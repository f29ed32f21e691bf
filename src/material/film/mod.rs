//! Water above the matter: a layer of its own, over any [model](super::models).

pub mod flood;
pub mod layer;
pub mod ripples;
