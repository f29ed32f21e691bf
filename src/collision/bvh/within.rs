//! The triangles in a part of space.

use bevy::prelude::*;

use super::MeshBvh;
use super::wide::Child;

impl MeshBvh {
    /// The triangles whose boxes overlap this one, given by its smallest and largest corner, mesh space; ascending, each once. Some
    /// beside it are among them, since up to four share a box in the tree; a corner that is not a number bounds nothing.
    /// `found`: emptied before.
    pub(crate) fn triangles_within(&self, (low, high): (Vec3, Vec3), found: &mut Vec<u32>) {
        found.clear();
        let mut waiting = vec![0];
        while let Some(node) = waiting.pop() {
            for (child, (child_low, child_high)) in self.tree.children(node) {
                // Written so that NaN overlaps.
                if child_low.cmpgt(high).any() || child_high.cmplt(low).any() {
                    continue;
                }
                match child {
                    Child::Inner(index) => waiting.push(index),
                    Child::Leaf(pack) => found.extend(self.packs[pack as usize].numbers()),
                }
            }
        }
        found.sort_unstable();
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
