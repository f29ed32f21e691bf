//! Where the texels of a map lie in the world.

use bevy::math::{Affine3A, DVec3, Vec3};

use super::grid::Grid;
use super::ownership::Ownership;
use crate::collision::MeshTriangles;
use crate::overlay::Wrap;

/// A texel's place on the surface it stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The texel, row by row from v = 0.
    pub texel: u32,
    /// The triangle it lies on, an index into the lists of [`MeshTriangles`].
    pub triangle: u32,
    /// World space, metres.
    pub position: Vec3,
    /// Unit normal of the triangle's front; world space.
    pub normal: Vec3,
}

/// One point for each texel on which a triangle lies, ascending by texel; world space.
///
/// A texel belongs to the first triangle that covers its middle, and that is where its point lies. A triangle
/// too small to cover any middle has the texel it lies in if nobody else does; the point is then the
/// triangle's closest to the middle, on the map. Where uvs are tiled, the point lies in one of the tiles.
///
/// Normals follow the winding of the triangles, and turn and shear with `world_from_mesh`, mirrored or not.
pub fn surface_points(
    triangles: &MeshTriangles,
    world_from_mesh: &Affine3A,
    size: u32,
    wrap: [Wrap; 2],
) -> Vec<SurfacePoint> {
    let normals = front_normals(triangles, world_from_mesh);
    let owners = Ownership::new(triangles, Grid { size, wrap });
    let owned = (0u32..).zip(owners.triangle.iter().zip(&owners.weights));
    owned
        .filter_map(|(texel, (&triangle, &[second, third]))| {
            // No index of a triangle is that of nobody.
            let &[a, b, c] = triangles.positions.get(triangle as usize)?;
            let position = world_from_mesh.transform_point3(a + (b - a) * second + (c - a) * third);
            Some(SurfacePoint { texel, triangle, position, normal: normals[triangle as usize] })
        })
        .collect()
}

/// Unit normal of each triangle's front, by its winding in the mesh; world space.
pub(super) fn front_normals(triangles: &MeshTriangles, world_from_mesh: &Affine3A) -> Vec<Vec3> {
    // A mirror turns the winding round, but not the side that is the front.
    let mirrored = if world_from_mesh.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
    let normal = |&[a, b, c]: &[Vec3; 3]| {
        let [ab, ac] = [b - a, c - a].map(|edge| world_from_mesh.transform_vector3(edge).as_dvec3());
        (ab.cross(ac) * mirrored).normalize_or(DVec3::Y).as_vec3()
    };
    triangles.positions.iter().map(normal).collect()
}

#[cfg(test)]
mod tests {
    use super::super::test_meshes::{floor, joined, sheet, turned_round};
    use super::*;
    use bevy::math::Vec2;

    const REPEAT: [Wrap; 2] = [Wrap::Repeat; 2];

    #[test]
    fn points_lie_where_their_texels_do() {
        let mesh = sheet(3, |point| floor(point) * 2.0, |point| point);
        let raised = Affine3A::from_translation(Vec3::new(10.0, 5.0, 0.0));
        let points = surface_points(&mesh, &raised, 16, REPEAT);
        assert_eq!(points.len(), 256);
        for (texel, point) in points.iter().enumerate() {
            assert_eq!(point.texel as usize, texel);
            let [u, v] = [texel % 16, texel / 16].map(|number| (number as f32 + 0.5) / 16.0);
            let expected = Vec3::new(10.0 + 2.0 * u, 5.0, 2.0 * v);
            assert!(point.position.distance(expected) < 1e-5, "{point:?}");
            assert_eq!(point.normal, Vec3::NEG_Y);
        }
    }

    #[test]
    fn normals_stay_on_the_front_under_mirrors_and_scales() {
        let mesh = turned_round(sheet(2, |point| Vec3::new(point.x, point.y, point.y), |point| point));
        let normal = |world_from_mesh: Affine3A| {
            let points = surface_points(&mesh, &world_from_mesh, 16, REPEAT);
            assert!(points.windows(2).all(|pair| pair[0].normal == pair[1].normal));
            points[0].normal
        };
        let front = Vec3::new(0.0, 1.0, -1.0).normalize();
        assert!(normal(Affine3A::IDENTITY).distance(front) < 1e-6);
        // Mirrors that do not change the slope: the front is where it was.
        assert!(normal(Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0))).distance(front) < 1e-6);
        // Upside down, and steeper.
        let flipped = normal(Affine3A::from_scale(Vec3::new(1.0, -2.0, 1.0)));
        assert!(flipped.distance(Vec3::new(0.0, -1.0, -2.0).normalize()) < 1e-6, "{flipped}");
    }

    #[test]
    fn small_triangles_have_what_is_left() {
        // 0.2 texels wide, in texels (2, 1) and (9, 9), both away from the middle; the second is covered by a
        // larger.
        let small = |x: f32, y: f32| {
            sheet(
                1,
                move |point| floor(point) + Vec3::new(x, 1.0, y),
                move |point| (Vec2::new(x, y) + point * 0.2) / 16.0,
            )
        };
        let large = sheet(1, floor, |point| Vec2::splat(0.5) + point * 0.25);
        let points = surface_points(
            &joined([small(2.6, 1.7), small(9.1, 9.1), large]),
            &Affine3A::IDENTITY,
            16,
            REPEAT,
        );
        assert_eq!(points.len(), 1 + 16);
        let first = points[0];
        assert_eq!((first.texel, first.triangle), (16 + 2, 0));
        // The corner closest to the middle, at (2.5, 1.5).
        assert!(first.position.distance(Vec3::new(2.6, 1.0, 1.7)) < 1e-4, "{first:?}");
        assert!(points[1..].iter().all(|point| point.triangle >= 4));
    }

    #[test]
    fn tiled_and_clamped_uvs_own_each_texel_once() {
        let tiled = sheet(1, floor, |point| point * 3.0);
        assert_eq!(surface_points(&tiled, &Affine3A::IDENTITY, 16, REPEAT).len(), 256);
        let beyond = sheet(4, floor, |point| point + Vec2::new(0.75, 0.0));
        let points = surface_points(&beyond, &Affine3A::IDENTITY, 16, [Wrap::Clamp; 2]);
        assert_eq!(points.len(), 4 * 16);
        // Texels of the edge lie where they would without what is beyond.
        assert!(points.iter().all(|point| point.position.x < 0.25), "{points:?}");
    }

    #[test]
    fn nonsense_ends() {
        let sizes = [1e9, -3e9, 3e38, 1e-38];
        let huge = sizes.map(|size| sheet(8, floor, move |point| point * size));
        let far = sheet(2, floor, |point| point + Vec2::splat(1e9));
        let point = sheet(2, floor, |_| Vec2::splat(0.5));
        let line = sheet(2, floor, |point| Vec2::splat(point.x));
        let needle = sheet(2, floor, |point| Vec2::new(point.x * 1e9, point.y * 1e-9));
        let mesh = joined(huge.into_iter().chain([far, point, line, needle]));
        for wrap in [REPEAT, [Wrap::Clamp; 2], [Wrap::Clamp, Wrap::Repeat]] {
            let points = surface_points(&mesh, &Affine3A::IDENTITY, 64, wrap);
            assert!(points.len() <= 64 * 64);
            assert!(points.iter().all(|point| point.position.is_finite() && point.normal == Vec3::NEG_Y));
        }
    }
}
