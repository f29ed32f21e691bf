//! Which texture coordinates of its mesh a surface is hit in.

use bevy::mesh::MeshVertexAttribute;
use bevy::prelude::*;

/// The texture coordinates of a surface's mesh over which its maps lie. Set by [`unwrap`](crate::unwrap), for surfaces that
/// want others than the first; a surface without it has the first.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[reflect(Component, Default)]
pub enum UvSet {
    /// [`Mesh::ATTRIBUTE_UV_0`].
    #[default]
    First,
    /// [`Mesh::ATTRIBUTE_UV_1`].
    Second,
}

impl UvSet {
    /// Where a mesh has them.
    pub fn attribute(self) -> MeshVertexAttribute {
        match self {
            Self::First => Mesh::ATTRIBUTE_UV_0,
            Self::Second => Mesh::ATTRIBUTE_UV_1,
        }
    }
}

/// It is not known yet over which texture coordinates the maps of this surface lie. Until then it gets no collider: what fell
/// on it would lie in the wrong place.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub struct AwaitsUvs;
