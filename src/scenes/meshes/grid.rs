//! Grids of quads that are put side by side: what the meshes of several faces are made of.

use bevy::math::{Vec2, Vec3};

use super::{MeshError, Surface};

/// Free space around islands of a uv square, in uv: 8 texels of a map of 1024, 4 of one of 512. A stamp
/// that ends in it does not reach the next island.
pub(super) const GUTTER: f32 = 8.0 / 1024.0;

/// Adds `columns` by `rows` quads to `surface`.
///
/// `place` tells the position and the uv of the vertex in a column and a row, columns to the right and rows
/// downwards as seen from outside. A normal is the mean of those of the quads around it, of this grid only:
/// the grid is smooth in itself and has an edge where it meets another one, even in the same positions.
pub(super) fn push_grid(
    surface: &mut Surface,
    columns: u32,
    rows: u32,
    place: impl Fn(u32, u32) -> (Vec3, Vec2),
) {
    let stride = columns + 1;
    let first = surface.positions.len() as u32;
    for row in 0..=rows {
        for column in 0..=columns {
            let (position, uv) = place(column, row);
            surface.push(position, Vec3::ZERO, uv);
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let a = first + row * stride + column;
            let (b, c, d) = (a + 1, a + stride, a + stride + 1);
            let [p, q, r, s] = [a, b, c, d].map(|corner| surface.positions[corner as usize]);
            let normal = (s - p).cross(q - r).normalize_or_zero();
            for corner in [a, b, c, d] {
                surface.normals[corner as usize] += normal;
            }
            surface.indices.extend([a, c, b, b, c, d]);
        }
    }
    for normal in &mut surface.normals[first as usize..] {
        *normal = normal.normalize_or(Vec3::Y);
    }
}

/// Refuses what 32-bit indices cannot name.
///
/// # Errors
/// [`MeshError::TooMany`] if `columns + more_columns` by `rows + more_rows` quads have too many vertices.
pub(super) fn countable(columns: u32, more_columns: u64, rows: u64, more_rows: u64) -> Result<(), MeshError> {
    let stride = u64::from(columns) + more_columns + 1;
    let vertices = rows.checked_add(more_rows + 1).and_then(|rows| rows.checked_mul(stride));
    let named = vertices.is_some_and(|vertices| vertices <= u64::from(u32::MAX));
    let rows = u32::try_from(rows).unwrap_or(u32::MAX);
    if named { Ok(()) } else { Err(MeshError::TooMany { columns, rows }) }
}

#[cfg(test)]
pub(super) mod checks {
    //! What holds for meshes of several faces.

    use std::collections::BTreeMap;

    use bevy::math::{DVec2, Vec2, Vec3};

    use crate::scenes::meshes::checks::Parts;

    /// Finite, of area, facing outwards, with unit normals, uvs inside the map that overlap nowhere and
    /// islands that keep apart.
    pub(in crate::scenes::meshes) fn check(name: &str, parts: &Parts) {
        for (i, at) in parts.positions.iter().enumerate() {
            let (normal, uv) = (parts.normals[i], parts.uvs[i]);
            assert!(at.is_finite() && (normal.length() - 1.0).abs() < 1e-5, "{name} {i}: {at} {normal}");
            assert!(uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all(), "{name} {i}: {uv}");
        }
        for triangle in &parts.triangles {
            let [a, b, c] = triangle.map(|i| parts.positions[i]);
            let cross = (b - a).cross(c - a);
            assert!(cross.length() / 2.0 > 1e-12, "{name}: {a} {b} {c} has no area");
            for &i in triangle {
                let cos = cross.normalize().dot(parts.normals[i]);
                assert!(cos > 0.5, "{name}: {a} {b} {c} is {cos} from its normal");
            }
            let [a, b, c] = triangle.map(|i| parts.uvs[i]);
            assert!((b - a).perp_dot(c - a) < 0.0, "{name}: {a} {b} {c} is mirrored");
        }
        covered_once(name, parts);
        let islands = islands(parts);
        for (i, (low, high)) in islands.iter().enumerate() {
            for (other_low, other_high) in &islands[i + 1..] {
                let gap = (*low - *other_high).max(*other_low - *high).max_element();
                assert!(gap >= 3.0 / 1024.0, "{name}: islands are {gap} apart");
            }
        }
    }

    /// No middle of a texel of 512 lies in two triangles.
    fn covered_once(name: &str, parts: &Parts) {
        const SIDE: usize = 512;
        // Along shared edges rounding decides; what lies so near to an edge does not count.
        const SHY: f64 = 1e-4;
        let mut covered = vec![0u8; SIDE * SIDE];
        for triangle in &parts.triangles {
            let [a, b, c] = triangle.map(|i| parts.uvs[i].as_dvec2() * SIDE as f64);
            let (low, high) = (a.min(b).min(c).floor(), a.max(b).max(c).ceil());
            for y in low.y as usize..(high.y as usize).min(SIDE) {
                for x in low.x as usize..(high.x as usize).min(SIDE) {
                    let middle = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                    let sides = [(a, c), (c, b), (b, a)];
                    if sides.iter().all(|&(p, q)| (q - p).perp_dot(middle - p) > SHY * p.distance(q)) {
                        covered[y * SIDE + x] += 1;
                        assert_eq!(covered[y * SIDE + x], 1, "{name}: texel {x}, {y}");
                    }
                }
            }
        }
        let count = covered.iter().filter(|&&count| count > 0).count();
        assert!(count > SIDE * SIDE / 3, "{name}: only {count} texels are used");
    }

    /// The bounds in the map of what hangs together there.
    pub(in crate::scenes::meshes) fn islands(parts: &Parts) -> Vec<(Vec2, Vec2)> {
        let mut vertices = BTreeMap::new();
        let vertex: Vec<usize> = parts
            .uvs
            .iter()
            .map(|uv| {
                let next = vertices.len();
                *vertices.entry(uv.to_array().map(|v| (v + 0.0).to_bits())).or_insert(next)
            })
            .collect();
        let mut parent: Vec<usize> = (0..vertices.len()).collect();
        fn root(parent: &mut [usize], mut i: usize) -> usize {
            while parent[i] != i {
                parent[i] = parent[parent[i]];
                i = parent[i];
            }
            i
        }
        for &[a, b, c] in &parts.triangles {
            for (from, to) in [(a, b), (b, c)] {
                let (from, to) = (root(&mut parent, vertex[from]), root(&mut parent, vertex[to]));
                parent[from] = to;
            }
        }
        let mut bounds = BTreeMap::new();
        for (uv, &i) in parts.uvs.iter().zip(&vertex) {
            let (low, high) = bounds.entry(root(&mut parent, i)).or_insert((*uv, *uv));
            (*low, *high) = (low.min(*uv), high.max(*uv));
        }
        bounds.into_values().collect()
    }

    /// Edges that belong to one triangle only, by the positions of their ends; more than two fail.
    pub(in crate::scenes::meshes) fn open_edges(parts: &Parts) -> Vec<[Vec3; 2]> {
        let key = |at: Vec3| at.to_array().map(|v| (v + 0.0).to_bits());
        let mut edges: BTreeMap<_, (i32, u32, [Vec3; 2])> = BTreeMap::new();
        for triangle in &parts.triangles {
            let corners = triangle.map(|i| parts.positions[i]);
            for i in 0..3 {
                let (from, to) = (corners[i], corners[(i + 1) % 3]);
                let (low, high) = (key(from).min(key(to)), key(from).max(key(to)));
                let edge = edges.entry((low, high)).or_insert((0, 0, [from, to]));
                edge.0 += if key(from) == low { 1 } else { -1 };
                edge.1 += 1;
            }
        }
        // Two triangles that face the same way walk their edge both ways.
        assert!(edges.values().all(|&(sum, count, _)| count == 1 || (count == 2 && sum == 0)));
        edges.into_values().filter(|&(_, count, _)| count == 1).map(|(_, _, ends)| ends).collect()
    }
}
