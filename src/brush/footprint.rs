//! Which texels lie under a brush.
//!
//! A texel belongs to one triangle at most, so walking the triangles near the brush and, on each, the texels that it owns
//! meets every texel once, across uv seams and islands. The mesh's BVH tells which triangles are near.

use bevy::math::{Affine3A, Vec3};

use super::Brush;
use crate::collision::MeshBvh;
use crate::overlay::Wrap;
use crate::wetting::TexelGeometry;

/// The columns, or rows, from one uv to another, in a map of so many texels.
fn cells(from: f32, to: f32, size: u32, wrap: Wrap) -> impl Iterator<Item = u32> + Clone {
    // The conversion saturates, and takes NaN for 0.
    let [first, last] = [from, to].map(|uv| (uv * size as f32).floor() as i32);
    wrap.cells(first, last, size)
}

/// Whether a ball reaches the box around three points.
fn reaches(brush: &Brush, corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = *corners;
    let nearest = brush.point.clamp(a.min(b).min(c), a.max(b).max(c));
    nearest.distance_squared(brush.point) < brush.radius * brush.radius
}

/// What lies under a brush, and memory to find it in. Public, since the state of a public system parameter is made of it.
#[derive(Default)]
pub struct Touched {
    /// Texels whose middle lies in the brush, and the part of its strength that acts on each: above 0, up to 1. In the order of
    /// their triangles.
    pub(super) texels: Vec<(u32, f32)>,
    /// Triangles that may be near.
    near: Vec<u32>,
}

/// The box around a ball, given in world space, in the space of a mesh. Larger than it is by more than what is rounded; bounds
/// nothing where the mesh is flattened to nothing.
fn box_around(brush: &Brush, world_from_mesh: &Affine3A) -> (Vec3, Vec3) {
    if world_from_mesh.matrix3.determinant() == 0.0 {
        return (Vec3::NEG_INFINITY, Vec3::INFINITY);
    }
    let mesh_from_world = world_from_mesh.inverse();
    let middle = mesh_from_world.transform_point3(brush.point);
    // Numbers far from the origin are coarser.
    let rounded = 1.0e-5 * (brush.point.length() + world_from_mesh.translation.length());
    let radius = 1.001 * brush.radius + rounded;
    // The ball is an ellipsoid there, which reaches along an axis as far as the row of that axis is long.
    let matrix = mesh_from_world.matrix3;
    let half = Vec3::new(matrix.row(0).length(), matrix.row(1).length(), matrix.row(2).length()) * radius;
    (middle - half, middle + half)
}

impl Touched {
    /// Finds what lies under a brush. `mesh`: what the geometry was made of; `world_from_mesh`: where it is now.
    pub(super) fn find(
        &mut self,
        brush: &Brush,
        geometry: &TexelGeometry,
        mesh: &MeshBvh,
        world_from_mesh: &Affine3A,
        wrap: [Wrap; 2],
    ) {
        let Self { texels, near } = self;
        mesh.triangles_within(box_around(brush, world_from_mesh), near);
        texels.clear();
        let triangles = mesh.triangles();
        let size = geometry.size();
        for &triangle in near.iter() {
            let (corners, uvs) = (&triangles.positions[triangle as usize], &triangles.uvs[triangle as usize]);
            if !reaches(brush, &corners.map(|corner| world_from_mesh.transform_point3(corner))) {
                continue;
            }
            let [a, b, c] = *uvs;
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let columns = cells(low.x, high.x, size, wrap[0]);
            for row in cells(low.y, high.y, size, wrap[1]) {
                for column in columns.clone() {
                    let texel = row * size + column;
                    if geometry.owner(texel) != Some(triangle) {
                        continue;
                    }
                    let Some((point, _)) = geometry.point(texel, triangles, world_from_mesh) else {
                        continue;
                    };
                    let part = brush.part_at(point.distance(brush.point));
                    if part > 0.0 {
                        texels.push((texel, part));
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::BrushKind;
    use super::*;
    use crate::collision::MeshTriangles;
    use bevy::math::{EulerRot, Quat, Vec2};
    use bevy::mesh::Mesh;
    use bevy::prelude::Sphere;

    /// A floor of a square metre, twice as large in uvs as its map.
    fn floor(uv_scale: f32) -> MeshBvh {
        let at = |uv: Vec2| Vec3::new(uv.x, 0.0, uv.y);
        let [a, b, c, d] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        let corners = [[a, c, b], [a, d, c]];
        MeshBvh::build(MeshTriangles {
            positions: corners.map(|corners| corners.map(at)).to_vec(),
            uvs: corners.map(|corners| corners.map(|uv| uv * uv_scale)).to_vec(),
            source: vec![0, 1],
            ..Default::default()
        })
    }

    #[test]
    fn every_texel_in_the_ball_is_found_once_and_no_other() {
        let mesh = floor(1.0);
        let mut touched = Touched::default();
        for wrap in [[Wrap::Repeat; 2], [Wrap::Clamp; 2]] {
            let geometry = TexelGeometry::new(mesh.triangles(), &Affine3A::IDENTITY, Vec3::Y, 32, wrap);
            for point in [Vec3::new(0.5, 0.0, 0.5), Vec3::ZERO, Vec3::new(0.9, 0.1, 0.2), Vec3::Y] {
                let brush = Brush { kind: BrushKind::Wet, point, radius: 0.3, strength: 1.0 };
                touched.find(&brush, &geometry, &mesh, &Affine3A::IDENTITY, wrap);
                let found = &mut touched.texels;
                found.sort_unstable_by_key(|&(texel, _)| texel);
                let expected: Vec<u32> = (0..32 * 32)
                    .filter(|texel| {
                        let middle = |number: u32| (number as f32 + 0.5) / 32.0;
                        let place = Vec3::new(middle(texel % 32), 0.0, middle(texel / 32));
                        place.distance(point) < 0.3
                    })
                    .collect();
                assert_eq!(found.iter().map(|(texel, _)| *texel).collect::<Vec<_>>(), expected, "{point}");
            }
        }
    }

    #[test]
    fn tiled_uvs_and_nonsense_end() {
        let mut touched = Touched::default();
        for scale in [3.0, -5.0, 1.0e9, 0.0] {
            let mesh = floor(scale);
            let wrap = [Wrap::Repeat; 2];
            let geometry = TexelGeometry::new(mesh.triangles(), &Affine3A::IDENTITY, Vec3::Y, 16, wrap);
            let brush = Brush { kind: BrushKind::Wet, point: Vec3::ZERO, radius: 9.0, strength: 1.0 };
            touched.find(&brush, &geometry, &mesh, &Affine3A::IDENTITY, wrap);
            let found = &mut touched.texels;
            found.sort_unstable_by_key(|&(texel, _)| texel);
            assert!(found.windows(2).all(|pair| pair[0].0 < pair[1].0), "{scale}: a texel came twice");
        }
    }

    /// By asking every texel.
    fn brute_force(
        brush: &Brush,
        geometry: &TexelGeometry,
        mesh: &MeshBvh,
        world_from_mesh: &Affine3A,
    ) -> Vec<(u32, f32)> {
        let mut found: Vec<(u32, u32, f32)> = (0..geometry.size() * geometry.size())
            .filter_map(|texel| {
                let (point, _) = geometry.point(texel, mesh.triangles(), world_from_mesh)?;
                let part = brush.part_at(point.distance(brush.point));
                (part > 0.0).then_some((geometry.owner(texel)?, texel, part))
            })
            .collect();
        found.sort_by_key(|&(triangle, texel, _)| (triangle, texel));
        found.into_iter().map(|(_, texel, part)| (texel, part)).collect()
    }

    #[test]
    fn the_tree_leaves_nothing_out_wherever_the_mesh_is() {
        let mesh = MeshBvh::build(MeshTriangles::from_mesh(&Mesh::from(Sphere::new(0.5))).unwrap());
        let wrap = [Wrap::Clamp; 2];
        let geometry = TexelGeometry::new(mesh.triangles(), &Affine3A::IDENTITY, Vec3::Y, 64, wrap);
        let turn = Quat::from_euler(EulerRot::XYZ, 0.7, -1.9, 0.3);
        let place = |scale: Vec3, at: Vec3| Affine3A::from_scale_rotation_translation(scale, turn, at);
        let (mut touched, mut most, mut few) = (Touched::default(), 0, 0);
        for world_from_mesh in [
            Affine3A::IDENTITY,
            place(Vec3::ONE, Vec3::new(3.0, -2.0, 1.0)),
            place(Vec3::new(0.01, 4.0, 1.0), Vec3::Y),
            place(Vec3::new(-2.0, 1.0, 1.0), Vec3::new(900.0, 0.0, -700.0)),
            // Flat, and a point.
            place(Vec3::new(1.0, 0.0, 1.0), Vec3::X),
            place(Vec3::ZERO, Vec3::X),
        ] {
            for on_mesh in [Vec3::X, Vec3::NEG_Y, Vec3::new(0.5, 0.6, -0.6), Vec3::ZERO, Vec3::splat(9.0)] {
                let point = world_from_mesh.transform_point3(on_mesh * 0.5);
                for radius in [1.0e-4, 0.07, 0.4, 3.0] {
                    let brush = Brush { kind: BrushKind::Wet, point, radius, strength: 1.0 };
                    touched.find(&brush, &geometry, &mesh, &world_from_mesh, wrap);
                    let mut found = std::mem::take(&mut touched.texels);
                    // On each triangle they come row by row.
                    found.sort_by_key(|&(texel, _)| (geometry.owner(texel), texel));
                    let expected = brute_force(&brush, &geometry, &mesh, &world_from_mesh);
                    assert_eq!(found, expected, "{world_from_mesh} {point} {radius}");
                    most = most.max(found.len());
                    few += u32::from(touched.near.len() < mesh.triangles().positions.len() / 4);
                }
            }
        }
        assert!(most > 2000, "{most}");
        assert!(few > 30, "only {few} times few triangles were looked at");
    }
}
