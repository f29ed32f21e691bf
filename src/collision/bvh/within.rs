//! The triangles in a part of space.

use bevy::prelude::*;
use obvhs::aabb::Aabb;

use super::MeshBvh;

impl MeshBvh {
    /// The triangles whose boxes overlap this one, given by its smallest and largest corner, mesh space; ascending, each once. Some
    /// beside it are among them, since boxes in the tree are rounded outwards; a corner that is not a number bounds nothing.
    /// `found`: emptied before.
    pub(crate) fn triangles_within(&self, (low, high): (Vec3, Vec3), found: &mut Vec<u32>) {
        found.clear();
        let wanted = Aabb { min: low.to_array().into(), max: high.to_array().into() };
        let mut waiting = vec![0];
        while let Some(index) = waiting.pop() {
            let Some(node) = self.bvh.nodes.get(index as usize) else { continue };
            for child in (0..8).filter(|&child| !node.is_child_empty(child)) {
                if !node.child_aabb(child).intersect_aabb(&wanted) {
                    continue;
                }
                if node.is_leaf(child) {
                    let (first, count) = node.child_primitives(child);
                    let leaf = first as usize..(first + count) as usize;
                    found.extend(self.bvh.primitive_indices.get(leaf).unwrap_or_default());
                } else {
                    waiting.push(node.child_node_index(child));
                }
            }
        }
        found.sort_unstable();
        // A tree may hold a triangle in two leaves.
        found.dedup();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::MeshTriangles;

    #[test]
    fn no_triangle_in_the_box_is_missed_and_most_others_are_left_out() {
        let ball = MeshTriangles::from_mesh(&Sphere::new(1.0).into()).unwrap();
        let mesh = MeshBvh::build(ball);
        let positions = &mesh.triangles().positions;
        let mut found = Vec::new();
        for middle in [Vec3::X, Vec3::new(0.6, -0.6, 0.5), Vec3::NEG_Y, Vec3::splat(9.0)] {
            let (low, high) = (middle - 0.2, middle + 0.2);
            mesh.triangles_within((low, high), &mut found);
            assert!(found.is_sorted_by(|one, other| one < other), "{found:?}");
            let mut expected = 0;
            for (number, [a, b, c]) in (0u32..).zip(positions) {
                let (least, most) = (a.min(*b).min(*c), a.max(*b).max(*c));
                if least.cmple(high).all() && most.cmpge(low).all() {
                    expected += 1;
                    assert!(found.binary_search(&number).is_ok(), "{number} at {middle}");
                }
            }
            assert!(found.len() <= 4 * expected + 16 && found.len() < positions.len() / 4, "{}", found.len());
        }
        for everywhere in [(Vec3::NEG_INFINITY, Vec3::INFINITY), (Vec3::NAN, Vec3::NAN)] {
            mesh.triangles_within(everywhere, &mut found);
            assert_eq!(found.len(), positions.len());
        }
    }

    #[test]
    fn one_triangle_is_a_mesh() {
        let one = MeshTriangles {
            positions: vec![[Vec3::ZERO, Vec3::X, Vec3::Z]],
            uvs: vec![[Vec2::ZERO, Vec2::X, Vec2::Y]],
            source: vec![0],
            ..default()
        };
        let mut found = vec![7];
        MeshBvh::build(one).triangles_within((Vec3::ZERO, Vec3::ONE), &mut found);
        assert_eq!(found, [0]);
    }
}
