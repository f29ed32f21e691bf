//! Where on its mesh an impact lies, and how the mesh stands in the world around it.
//!
//! Frames of texels are those of the mesh at rest. A surface that is posed is hit somewhere else: the place is carried back by its
//! barycentric weights on the triangle that was hit, and directions by what the pose has done to that triangle, turned and
//! stretched. So a mark is round in the world, as large as its effect says, in the pose in which it came to be; from then on it
//! moves and stretches with the surface.
//!
//! Around the triangle the mark goes on as if the surface were turned and stretched there as it is here. On a triangle that is
//! more than [`MOST_DISTORTION`] times as stretched in one direction as in the other, a mark is narrower than it should be:
//! what a fold has pressed together would smear it far over the surface at rest.

use bevy::math::{Affine3A, Mat2, Mat3, Mat3A};
use bevy::prelude::*;

use super::frames::Frames;
use crate::collision::{DeformingCollider, Impact};

/// A mark follows a triangle that is so much more stretched in one direction than in the other. The reach of a stamp, twice its
/// radius, has room for the square root of 4.
const MOST_DISTORTION: f32 = 3.0;

/// A surface that is stamped on where it is, not on its map, around a place.
pub(super) struct Site<'a> {
    pub(super) frames: &'a Frames,
    /// The place that was hit, in the space of the mesh at rest.
    pub(super) point: Vec3,
    /// Takes directions of the mesh at rest to the world.
    pub(super) world_from_mesh: Mat3A,
}

impl<'a> Site<'a> {
    /// Of an impact on a surface with this transform, in its pose if it has one. None where that cannot be told.
    pub(super) fn of(
        impact: &Impact,
        frames: &'a Frames,
        transform: &GlobalTransform,
        deforming: Option<&DeformingCollider>,
    ) -> Option<Self> {
        let Some((deforming, posed)) = deforming.and_then(|deforming| Some((deforming, deforming.posed()?)))
        else {
            return Some(Self::rigid(frames, &transform.affine(), impact.point));
        };
        let triangles = posed.triangles();
        // In the mesh's order, which is theirs.
        let index = triangles.source.binary_search(&impact.triangle).ok()?;
        let world_from_shape = deforming.world_from_shape(transform);
        let corners = posed.corners(index).map(|corner| world_from_shape.transform_point3(corner));
        let front = if impact.back { -impact.normal } else { impact.normal };
        Self::posed(frames, triangles.positions[index], corners, front, impact.point)
    }

    /// Of a place, in world space, on a mesh that stands in the world by this transform.
    pub(super) fn rigid(frames: &'a Frames, world_from_mesh: &Affine3A, point: Vec3) -> Self {
        let at_rest = world_from_mesh.inverse().transform_point3(point);
        Self { frames, point: at_rest, world_from_mesh: world_from_mesh.matrix3 }
    }

    /// Of a place on a triangle of which the corners are known at rest and as they are now, in world space. `front`: the unit
    /// normal of its front, now. None if the triangle has no area, then or now.
    pub(super) fn posed(
        frames: &'a Frames,
        rest: [Vec3; 3],
        posed: [Vec3; 3],
        front: Vec3,
        point: Vec3,
    ) -> Option<Self> {
        let [[ab, ac], [posed_ab, posed_ac]] = [rest, posed].map(|[a, b, c]| [b - a, c - a]);
        let (rest_basis, rest_edges) = plane([ab, ac], ab.cross(ac).normalize_or_zero());
        let (posed_basis, posed_edges) = plane([posed_ab, posed_ac], front);
        if rest_edges.determinant() == 0.0 {
            return None;
        }
        let (stretch, thickness) = evened(posed_edges * rest_edges.inverse());
        let [x, y] = [stretch.x_axis, stretch.y_axis].map(|axis| axis.extend(0.0));
        let world_from_mesh =
            posed_basis * Mat3::from_cols(x, y, Vec3::Z * thickness) * rest_basis.transpose();
        let cross = posed_ab.cross(posed_ac);
        let (from_a, area) = (point - posed[0], cross.length_squared());
        // As the uv of the hit is found.
        let to_b = (from_a.cross(posed_ac).dot(cross) / area).clamp(0.0, 1.0);
        let to_c = (posed_ab.cross(from_a).dot(cross) / area).clamp(0.0, 1.0);
        let at_rest = rest[0] + ab * to_b + ac * to_c;
        let is_sound = at_rest.is_finite() && world_from_mesh.is_finite() && thickness > 0.0;
        is_sound.then(|| Self { frames, point: at_rest, world_from_mesh: world_from_mesh.into() })
    }
}

/// A basis whose first two axes lie in the plane of two edges, the first along the first edge, and the edges in it.
fn plane([ab, ac]: [Vec3; 2], normal: Vec3) -> (Mat3, Mat2) {
    let along = ab.normalize_or_zero();
    let across = normal.cross(along);
    let flat = |edge: Vec3| Vec2::new(edge.dot(along), edge.dot(across));
    (Mat3::from_cols(along, across, normal), Mat2::from_cols(flat(ab), flat(ac)))
}

/// A map between planes whose lesser stretch is raised to a part of the greater, and the mean of both stretches.
///
/// Its stretches are its singular values: the greater is that along the longer axis of the ellipse that becomes a circle.
fn evened(map: Mat2) -> (Mat2, f32) {
    let (x, y) = (map.x_axis, map.y_axis);
    let angle = 0.5 * (2.0 * x.dot(y)).atan2(x.length_squared() - y.length_squared());
    let most = Vec2::from_angle(angle);
    let image = map * most;
    let (greater, area) = (image.length(), map.determinant());
    let lesser = (area / greater).abs();
    let raised = lesser.max(greater / MOST_DISTORTION);
    // What the other axis is taken to, and by how much farther it should be.
    let added = image.perp() / greater * area.signum() * (raised - lesser);
    let least = most.perp();
    (map + Mat2::from_cols(added * least.x, added * least.y), (greater * raised).sqrt())
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3A;

    use super::*;
    use crate::collision::MeshTriangles;
    use crate::overlay::Wrap;
    use crate::wetting::TexelGeometry;

    const REST: [Vec3; 3] = [Vec3::ZERO, Vec3::Z, Vec3::X];

    fn frames() -> Frames {
        let triangles = MeshTriangles::from_mesh(&Plane3d::new(Vec3::Y, Vec2::ONE).into()).unwrap();
        let wrap = [Wrap::Clamp; 2];
        let geometry = TexelGeometry::new(&triangles, &Affine3A::IDENTITY, Vec3::Y, 32, wrap);
        Frames::new(&triangles, &geometry, wrap)
    }

    fn front([a, b, c]: [Vec3; 3]) -> Vec3 {
        (b - a).cross(c - a).normalize_or_zero()
    }

    #[test]
    fn a_triangle_that_is_turned_moved_and_scaled_is_what_a_rigid_one_is() {
        let frames = frames();
        let turn = Quat::from_rotation_x(0.7) * Quat::from_rotation_z(2.0);
        let pose =
            Affine3A::from_scale_rotation_translation(Vec3::splat(0.4), turn, Vec3::new(3.0, 1.0, 9.0));
        let posed = REST.map(|corner| pose.transform_point3(corner));
        let point = pose.transform_point3(Vec3::new(0.5, 0.0, 0.2));
        let rigid = Site::rigid(&frames, &pose, point);
        let site = Site::posed(&frames, REST, posed, front(posed), point).unwrap();
        assert!(site.point.distance(rigid.point) < 1e-4, "{}", site.point);
        assert!(site.world_from_mesh.abs_diff_eq(rigid.world_from_mesh, 1e-4), "{}", site.world_from_mesh);
        // A mirror turns the winding round, and the front stays the front.
        let mirror = pose * Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        let posed = REST.map(|corner| mirror.transform_point3(corner));
        let site = Site::posed(&frames, REST, posed, -front(posed), posed[0]).unwrap();
        assert!(site.world_from_mesh.abs_diff_eq(mirror.matrix3, 1e-4), "{}", site.world_from_mesh);
    }

    #[test]
    fn what_is_stretched_is_followed_up_to_a_limit() {
        let frames = frames();
        let sheared = |along: f32, across: f32, by: f32| {
            let posed = [Vec3::ZERO, Vec3::Z * across, Vec3::X * along + Vec3::Z * by];
            let site = Site::posed(&frames, REST, posed, Vec3::Y, Vec3::ZERO).unwrap();
            [Vec3::X, Vec3::Z, Vec3::Y].map(|axis| Vec3::from(site.world_from_mesh * Vec3A::from(axis)))
        };
        let near = |a: Vec3, b: Vec3| a.distance(b) < 1e-4;
        let [x, z, y] = sheared(2.0, 1.0, 0.5);
        assert!(near(x, Vec3::new(2.0, 0.0, 0.5)) && near(z, Vec3::Z), "{x} {z}");
        assert!(near(y, Vec3::Y * 2f32.sqrt()), "{y}");
        // Ten times as long as wide, and pressed to a tenth.
        let [x, z, _] = sheared(10.0, 1.0, 0.0);
        assert!(near(x, Vec3::X * 10.0) && near(z, Vec3::Z * 10.0 / 3.0), "{x} {z}");
        let [x, z, _] = sheared(1.0, 0.1, 0.0);
        assert!(near(x, Vec3::X) && near(z, Vec3::Z / 3.0), "{x} {z}");
    }

    #[test]
    fn a_pose_that_is_none_has_no_site() {
        let frames = frames();
        let site = |posed: [Vec3; 3]| Site::posed(&frames, REST, posed, Vec3::Y, Vec3::ZERO).is_some();
        assert!(site(REST));
        assert!(!site([Vec3::ZERO, Vec3::NAN, Vec3::X]));
        assert!(!site([Vec3::ZERO; 3]) && !site([Vec3::ZERO, Vec3::Z, Vec3::Z * 2.0]));
        let line = [Vec3::ZERO, Vec3::Z, Vec3::Z * 2.0];
        assert!(Site::posed(&frames, line, REST, Vec3::Y, Vec3::ZERO).is_none());
    }
}
