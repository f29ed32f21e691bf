//! Which texels lie under a brush.
//!
//! A texel belongs to one triangle at most, so walking the triangles near the brush and, on each, the texels that it owns
//! meets every texel once, across uv seams and islands.

use bevy::math::{Affine3A, Vec3};

use super::Brush;
use crate::collision::MeshTriangles;
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

/// Collects the texels whose middle lies in a brush, and the part of its strength that acts on each: above 0, up to 1. In the
/// order of the triangles. `triangles` and `world_from_mesh`: what the geometry was made of, where it is now.
pub(super) fn texels_under(
    brush: &Brush,
    geometry: &TexelGeometry,
    triangles: &MeshTriangles,
    world_from_mesh: &Affine3A,
    wrap: [Wrap; 2],
    found: &mut Vec<(u32, f32)>,
) {
    found.clear();
    let size = geometry.size();
    for (triangle, (corners, uvs)) in (0u32..).zip(triangles.positions.iter().zip(&triangles.uvs)) {
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
                let Some((point, _)) = geometry.point(texel, triangles, world_from_mesh) else { continue };
                let part = brush.part_at(point.distance(brush.point));
                if part > 0.0 {
                    found.push((texel, part));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::BrushKind;
    use super::*;
    use bevy::math::Vec2;

    /// A floor of a square metre, twice as large in uvs as its map.
    fn floor(uv_scale: f32) -> MeshTriangles {
        let at = |uv: Vec2| Vec3::new(uv.x, 0.0, uv.y);
        let [a, b, c, d] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        let corners = [[a, c, b], [a, d, c]];
        MeshTriangles {
            positions: corners.map(|corners| corners.map(at)).to_vec(),
            uvs: corners.map(|corners| corners.map(|uv| uv * uv_scale)).to_vec(),
            source: vec![0, 1],
            ..Default::default()
        }
    }

    #[test]
    fn every_texel_in_the_ball_is_found_once_and_no_other() {
        let mesh = floor(1.0);
        for wrap in [[Wrap::Repeat; 2], [Wrap::Clamp; 2]] {
            let geometry = TexelGeometry::new(&mesh, &Affine3A::IDENTITY, Vec3::Y, 32, wrap);
            for point in [Vec3::new(0.5, 0.0, 0.5), Vec3::ZERO, Vec3::new(0.9, 0.1, 0.2), Vec3::Y] {
                let brush = Brush { kind: BrushKind::Wet, point, radius: 0.3, strength: 1.0 };
                let mut found = Vec::new();
                texels_under(&brush, &geometry, &mesh, &Affine3A::IDENTITY, wrap, &mut found);
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
        for scale in [3.0, -5.0, 1.0e9, 0.0] {
            let mesh = floor(scale);
            let wrap = [Wrap::Repeat; 2];
            let geometry = TexelGeometry::new(&mesh, &Affine3A::IDENTITY, Vec3::Y, 16, wrap);
            let brush = Brush { kind: BrushKind::Wet, point: Vec3::ZERO, radius: 9.0, strength: 1.0 };
            let mut found = Vec::new();
            texels_under(&brush, &geometry, &mesh, &Affine3A::IDENTITY, wrap, &mut found);
            found.sort_unstable_by_key(|&(texel, _)| texel);
            assert!(found.windows(2).all(|pair| pair[0].0 < pair[1].0), "{scale}: a texel came twice");
        }
    }
}
