//! Wet versions of data, for use anywhere.

pub mod spectrum;
mod wet_texture;

pub use wet_texture::{TextureError, WetTexture, read_texture, wet_texture, write_texture};
