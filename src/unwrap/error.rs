//! What can be wrong with a mesh that is to be unwrapped.

use bevy::mesh::PrimitiveTopology;

/// Why a mesh could not be unwrapped.
#[derive(thiserror::Error, Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum UnwrapError {
    /// Its asset could not be loaded.
    #[error("the mesh could not be loaded")]
    NotLoaded,
    /// Only the GPU has the data.
    #[error("the mesh's data is only on the GPU; load it with `RenderAssetUsages::MAIN_WORLD` too")]
    NotOnCpu,
    /// No positions, or not as three floats.
    #[error("the mesh has no `POSITION` of three floats")]
    NoPositions,
    /// Points or lines.
    #[error("the mesh is made of {0:?}, not of triangles")]
    Topology(PrimitiveTopology),
    /// An attribute that has not one value for each vertex.
    #[error("the mesh has {found} values of {name} for {vertices} vertices; give it one for each")]
    AttributeLength {
        /// Of the attribute.
        name: &'static str,
        /// Its values.
        found: usize,
        /// Positions of the mesh.
        vertices: usize,
    },
    /// Morph targets that have not one row for each vertex.
    #[error("the mesh's morph targets have {found} rows, which is no multiple of its {vertices} vertices")]
    MorphTargets {
        /// Rows of all targets.
        found: usize,
        /// Positions of the mesh.
        vertices: usize,
    },
    /// No triangle, or none with an area.
    #[error("none of the mesh's triangles has an area")]
    Empty,
    /// What the charts cannot be made of: an index beyond the vertices, a position that is not finite.
    #[error("{0}; repair the mesh where it comes from")]
    BadMesh(String),
    /// There is a second set already, which is not unique.
    #[error(
        "the mesh has a `UV_1` already, which is not unique; `OverlayUv::Unique` replaces it, `Mesh` goes without"
    )]
    SecondUvsTaken,
    /// The gutters leave no room.
    #[error("a map of {map_size} texels has no room inside gutters of {gutter}; raise `map_size`")]
    MapTooSmall {
        /// Texels along each side.
        map_size: u32,
        /// Texels around each chart.
        gutter: u32,
    },
    /// Too many charts for the map.
    #[error("the mesh falls into {charts} charts, too many for a map of {map_size} texels; raise `map_size`")]
    DoesNotFit {
        /// Pieces of the surface.
        charts: u32,
        /// Texels along each side.
        map_size: u32,
    },
}

impl UnwrapError {
    /// Whether such a mesh cannot be hit either, which is then reported for its collider.
    pub(super) fn spoils_collider(&self) -> bool {
        matches!(self, Self::NotLoaded | Self::NotOnCpu | Self::NoPositions | Self::Topology(_) | Self::Empty)
    }
}
