//! The boxes of a tree, level by level, for those who want to see it.

use bevy::prelude::*;

use super::{DeformingBvh, MeshBvh, corners_of, wide};

/// What is below a node, with the corners of its box.
enum Child {
    /// It has children of its own.
    Inner(u32, (Vec3, Vec3)),
    /// It holds triangles.
    Leaf((Vec3, Vec3)),
}

impl MeshBvh {
    /// Boxes so many levels below the outermost one, which is level 0, and those that end above it: together they hold all
    /// triangles. Smallest and largest corner of each, mesh space; at most `most` of them, and those that end first come first.
    /// The tree is eight wide.
    pub fn boxes(&self, level: u32, most: usize) -> Vec<(Vec3, Vec3)> {
        let Some(root) = self.tree.bounds else { return Vec::new() };
        boxes(root, level, most, |index, found| {
            for (child, corners) in self.tree.children(index) {
                found(match child {
                    wide::Child::Inner(index) => Child::Inner(index, corners),
                    wide::Child::Leaf(_) => Child::Leaf(corners),
                });
            }
        })
    }
}

impl DeformingBvh {
    /// As [`MeshBvh::boxes`], of a binary tree.
    pub(in crate::collision) fn boxes(&self, level: u32, most: usize) -> Vec<(Vec3, Vec3)> {
        let nodes = self.nodes();
        let Some(root) = nodes.first() else { return Vec::new() };
        // It may be all there is.
        let level = if root.is_leaf() { 0 } else { level };
        boxes(corners_of(root.aabb()), level, most, |index, found| {
            let Some(node) = nodes.get(index as usize) else { return };
            for child in [node.first_index, node.first_index + 1] {
                let Some(below) = nodes.get(child as usize) else { continue };
                let corners = corners_of(below.aabb());
                found(if below.is_leaf() { Child::Leaf(corners) } else { Child::Inner(child, corners) });
            }
        })
    }
}

/// Walks a tree from its root, level by level. `children`: hands over those of a node.
fn boxes(
    root: (Vec3, Vec3),
    level: u32,
    most: usize,
    children: impl Fn(u32, &mut dyn FnMut(Child)),
) -> Vec<(Vec3, Vec3)> {
    let (mut inner, mut below) = (vec![(0, root)], Vec::new());
    let mut ended = Vec::new();
    for _ in 0..level {
        if inner.is_empty() || ended.len() >= most {
            break;
        }
        for &(index, _) in &inner {
            children(index, &mut |child| match child {
                Child::Inner(index, corners) => below.push((index, corners)),
                Child::Leaf(corners) => ended.push(corners),
            });
        }
        inner.clear();
        std::mem::swap(&mut inner, &mut below);
    }
    ended.extend(inner.iter().map(|&(_, corners)| corners));
    ended.truncate(most);
    ended
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::{MeshTriangles, PosedMesh};

    fn mesh() -> MeshBvh {
        let grid = crate::scenes::meshes::ground(Vec2::splat(4.0), UVec2::splat(30)).unwrap();
        MeshBvh::build(MeshTriangles::from_mesh(&grid).unwrap())
    }

    /// Whether each corner of each triangle is in one of the boxes.
    fn hold_all(boxes: &[(Vec3, Vec3)], triangles: &[[Vec3; 3]]) -> bool {
        let holds = |&(low, high): &(Vec3, Vec3), corner: Vec3| {
            low.cmple(corner + 1e-4).all() && high.cmpge(corner - 1e-4).all()
        };
        triangles
            .iter()
            .all(|triangle| boxes.iter().any(|aabb| triangle.iter().all(|&corner| holds(aabb, corner))))
    }

    #[test]
    fn every_level_holds_all_triangles_and_deeper_ones_are_finer() {
        let mesh = mesh();
        let triangles = &mesh.triangles().positions;
        assert_eq!(mesh.boxes(0, 100), [mesh.bounds()]);
        let mut before = 1;
        for level in 1..4 {
            let boxes = mesh.boxes(level, usize::MAX);
            assert!(hold_all(&boxes, triangles), "{level}");
            assert!(boxes.len() > before && boxes.len() <= 8usize.pow(level), "{level}: {}", boxes.len());
            before = boxes.len();
        }
        // Far below the last leaf; all of the leaves.
        let leaves = mesh.boxes(40, usize::MAX);
        assert!(hold_all(&leaves, triangles) && leaves.len() >= triangles.len() / 4);
        assert_eq!(mesh.boxes(40, 17).len(), 17);
    }

    #[test]
    fn a_posed_tree_has_levels_too() {
        let bar = crate::collision::deform::test_bar::Bar::new().to_mesh();
        let triangles = MeshTriangles::from_mesh(&bar).unwrap();
        let deformer = crate::collision::Deformer::from_mesh(&bar, &triangles);
        let mesh = std::sync::Arc::new(MeshBvh::build(triangles).with_deformer(deformer));
        let posed = PosedMesh::new(mesh.clone()).unwrap();
        for level in 0..6 {
            let boxes = posed.boxes(level, usize::MAX);
            assert!(hold_all(&boxes, &mesh.triangles().positions), "{level}");
            assert!(boxes.len() <= 2usize.pow(level) && !boxes.is_empty(), "{level}: {}", boxes.len());
        }
    }
}
