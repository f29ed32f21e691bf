//! Which texture coordinates of a mesh give each point of it a texel of its own.

use bevy::prelude::*;

use super::{UnwrapError, UnwrapOptions, shares_texels, unwrapped};
use crate::collision::{MeshTriangles, TriangleError, UvSet};
use crate::overlay::{OverlayUv, Weatherable};

/// Texels along each side of the map on which uvs are looked at. The same for all maps: whether they are unique is a matter
/// of the mesh.
const LOOK_SIZE: u32 = 512;

/// Where the unique uvs of a mesh are.
#[derive(Debug, Clone)]
pub enum UniqueUvs {
    /// The mesh has them.
    Given(UvSet),
    /// A copy of the mesh has them, as its second ones.
    Cut(Box<Mesh>),
}

/// Looks at the first uvs of a mesh, then at its second ones, and unwraps it if neither are unique.
///
/// # Errors
/// [`UnwrapError`] if it has to be unwrapped and cannot.
pub fn unique_uvs(mesh: &Mesh, options: &UnwrapOptions) -> Result<UniqueUvs, UnwrapError> {
    for set in [UvSet::First, UvSet::Second] {
        // One that is missing is not unique; what else is wrong is wrong with unwrapping, too.
        if MeshTriangles::with_uvs(mesh, set).is_ok_and(|triangles| !shares_texels(&triangles, LOOK_SIZE)) {
            return Ok(UniqueUvs::Given(set));
        }
    }
    Ok(UniqueUvs::Cut(Box::new(unwrapped(mesh, options)?)))
}

impl Weatherable {
    /// How the mesh of this surface is unwrapped, if it is.
    pub fn unwrap_options(&self) -> UnwrapOptions {
        let replace = self.wanted_uv() == OverlayUv::Unique;
        UnwrapOptions { map_size: self.texels(), replace, ..default() }
    }
}

/// Why there are no triangles to lay maps over.
#[derive(thiserror::Error, Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum MapTrianglesError {
    /// They cannot be hit.
    #[error(transparent)]
    Triangles(#[from] TriangleError),
    /// Their uvs are not unique, and have to be.
    #[error(transparent)]
    Unwrap(#[from] UnwrapError),
}

/// The triangles of a mesh with the uvs over which the maps of a surface lie, as [`UnwrapPlugin`](super::UnwrapPlugin) chooses
/// them; for tools that need no app.
///
/// # Errors
/// [`MapTrianglesError`] for a mesh that cannot be weathered, or not as the surface asks for.
pub fn map_triangles(mesh: &Mesh, surface: &Weatherable) -> Result<MeshTriangles, MapTrianglesError> {
    let wanted = surface.wanted_uv();
    if wanted == OverlayUv::Mesh {
        return Ok(MeshTriangles::from_mesh(mesh)?);
    }
    match unique_uvs(mesh, &surface.unwrap_options()) {
        Ok(UniqueUvs::Given(set)) => Ok(MeshTriangles::with_uvs(mesh, set)?),
        Ok(UniqueUvs::Cut(copy)) => Ok(MeshTriangles::with_uvs(&copy, UvSet::Second)?),
        Err(error) if wanted == OverlayUv::Unique => Err(error.into()),
        Err(_) => Ok(MeshTriangles::from_mesh(mesh)?),
    }
}

#[cfg(test)]
mod tests {
    use bevy::mesh::{PrimitiveTopology, VertexAttributeValues};

    use super::*;
    use crate::overlay::StampSpace;

    /// A plane whose uvs are so many times as wide.
    fn plane(tiles: f32) -> Mesh {
        with_uvs(Plane3d::new(Vec3::Y, Vec2::ONE).into(), UvSet::First, tiles)
    }

    fn with_uvs(mesh: Mesh, set: UvSet, tiles: f32) -> Mesh {
        let Some(VertexAttributeValues::Float32x2(uvs)) = mesh.attribute(Mesh::ATTRIBUTE_UV_0) else {
            unreachable!("planes have uvs");
        };
        let scaled: Vec<[f32; 2]> = uvs.iter().map(|uv| uv.map(|part| part * tiles)).collect();
        mesh.with_inserted_attribute(set.attribute(), scaled)
    }

    fn found(mesh: &Mesh) -> UniqueUvs {
        unique_uvs(mesh, &UnwrapOptions { map_size: 64, ..default() }).unwrap()
    }

    #[test]
    fn the_first_unique_set_is_taken_as_it_is() {
        assert!(matches!(found(&plane(1.0)), UniqueUvs::Given(UvSet::First)));
        let both = with_uvs(plane(0.25), UvSet::Second, 2.0);
        assert!(matches!(found(&both), UniqueUvs::Given(UvSet::First)));
        let second = with_uvs(plane(1.0), UvSet::Second, 0.5);
        let tiled_first = with_uvs(second, UvSet::First, 8.0);
        assert!(matches!(found(&tiled_first), UniqueUvs::Given(UvSet::Second)));
        let second_alone = tiled_first.with_removed_attribute(Mesh::ATTRIBUTE_UV_0);
        assert!(matches!(found(&second_alone), UniqueUvs::Given(UvSet::Second)));
    }

    #[test]
    fn what_is_not_unique_is_unwrapped() {
        let none = plane(1.0).with_removed_attribute(Mesh::ATTRIBUTE_UV_0);
        for mesh in [plane(3.0), Cuboid::new(1.0, 1.0, 1.0).into(), none] {
            let UniqueUvs::Cut(copy) = found(&mesh) else { panic!("it is given") };
            assert!(copy.contains_attribute(Mesh::ATTRIBUTE_UV_1));
        }
        let both = with_uvs(plane(3.0), UvSet::Second, 2.0);
        let with = |replace| unique_uvs(&both, &UnwrapOptions { map_size: 64, replace, ..default() });
        assert_eq!(with(false).unwrap_err(), UnwrapError::SecondUvsTaken);
        assert!(matches!(with(true), Ok(UniqueUvs::Cut(_))));
    }

    #[test]
    fn a_surface_gets_the_uvs_that_it_asks_for() {
        use OverlayUv::{Auto, Mesh as OfMesh, Unique};
        let surface = |uv, stamps| Weatherable { map_size: 64, uv, stamps, ..default() };
        let is_first = |mesh: &Mesh, surface: &Weatherable| {
            map_triangles(mesh, surface).unwrap() == MeshTriangles::from_mesh(mesh).unwrap()
        };
        let tiled = plane(4.0);
        for (uv, stamps, first) in [
            (Auto, StampSpace::Surface, false),
            (Auto, StampSpace::Map, true),
            (OfMesh, StampSpace::Surface, true),
            (Unique, StampSpace::Surface, false),
            (Unique, StampSpace::Map, false),
        ] {
            assert_eq!(is_first(&tiled, &surface(uv, stamps)), first, "{uv:?} {stamps:?}");
            assert!(is_first(&plane(1.0), &surface(uv, stamps)), "{uv:?} {stamps:?}");
        }
        // What may be drawn by second uvs goes on being so, unless they are to be replaced.
        let taken = with_uvs(plane(4.0), UvSet::Second, 2.0);
        assert!(is_first(&taken, &surface(Auto, StampSpace::Surface)));
        assert!(!is_first(&taken, &surface(Unique, StampSpace::Surface)));
    }

    #[test]
    fn what_cannot_be_is_an_error_only_if_it_must_be() {
        let small = |uv| Weatherable { map_size: 16, uv, ..default() };
        // A chart for each of many faces that touch nowhere.
        let mut corners: Vec<[f32; 3]> = Vec::new();
        for number in 0..400 {
            let at = number as f32 * 2.0;
            corners.extend([[at, 0.0, 0.0], [at + 1.0, 0.0, 0.0], [at, 1.0, 0.0]]);
        }
        let uvs = [[0.0f32, 0.0], [1.0, 0.0], [0.0, 1.0]].repeat(400);
        let crowd = Mesh::new(PrimitiveTopology::TriangleList, default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners)
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs);
        let error = map_triangles(&crowd, &small(OverlayUv::Unique)).unwrap_err();
        let expected = UnwrapError::DoesNotFit { charts: 400, map_size: 16 };
        assert_eq!(error, MapTrianglesError::Unwrap(expected));
        let triangles = map_triangles(&crowd, &small(OverlayUv::Auto)).unwrap();
        assert_eq!(triangles, MeshTriangles::from_mesh(&crowd).unwrap());
    }
}
