//! Other ray casters that are in use, each in the way its documentation shows, behind the same question: how far along segment
//! number n is the closest hit, if there is one?
//!
//! | who | how |
//! |---|---|
//! | [`Parry`] | parry3d: `TriMesh::cast_local_ray`, which is given the segment's length |
//! | [`BvhCrate::nearest_first`] | bvh: `nearest_traverse_iterator`, left when its next box is behind the best hit or the end |
//! | [`BvhCrate::limited`] | bvh: `traverse_iterator` with a query that takes boxes before the best hit or the end alone |
//! | [`BevyCaster`] | Bevy's `MeshRayCast` in a world with that one mesh; its rays have no end, so hits behind it do not count |
//! | [`BareMesh`] | `ray_mesh_intersection`, the loop in it, without a world around |
//!
//! Rays are made ready before anything is timed, as ours makes its own from a segment while it is. All test both faces: bvh's
//! own triangle test only knows one, so corners are put in the order in which the ray sees them, at the price of a product.
//! All are given the mesh with shared corners, as a loader would.

use std::cell::Cell;
use std::collections::HashMap;

use bevy::asset::RenderAssetUsages;
use bevy::camera::primitives::Aabb as MeshBox;
use bevy::ecs::system::SystemState;
use bevy::math::Affine3A;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_picking::mesh_picking::ray_cast::{
    Backfaces, MeshRayCast, MeshRayCastSettings, RayCastBackfaces, RayCastVisibility, ray_mesh_intersection,
};
use bevy_weathering::collision::MeshTriangles;
use bevy_weathering::replay::task_pools;
use bvh::aabb::{Aabb, Bounded, IntersectsAabb};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::{Bvh, BvhNode};
use bvh::ray::Ray;
use parry3d::math::Vector;
use parry3d::query::RayCast;
use parry3d::shape::TriMesh;

use crate::cast::LENGTH;

/// m; as far as distances may differ.
const TOLERANCE: f32 = 1e-4;

/// One segment of so many may be answered otherwise: where it meets an edge or a triangle on edge, roundings decide.
const MAY_DIFFER: usize = 1000;

/// Checks answers against ours, distances in m.
///
/// # Panics
/// If they differ.
pub fn check(name: &str, ours: &[Option<f32>], mut rival: impl FnMut(usize) -> Option<f32>) {
    let mut differ = 0;
    for (number, &ours) in ours.iter().enumerate() {
        differ += usize::from(match (ours, rival(number)) {
            (Some(ours), Some(theirs)) => (ours - theirs).abs() > TOLERANCE,
            (ours, theirs) => ours.is_some() != theirs.is_some(),
        });
    }
    println!("check {name}: {differ} of {} segments answered otherwise", ours.len());
    assert!(differ <= 1 + ours.len() / MAY_DIFFER, "{name} does not hit the same");
}

/// A mesh with shared corners.
pub struct Welded {
    corners: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Welded {
    /// Corners that are the same to the bit become one.
    pub fn new(triangles: &MeshTriangles) -> Self {
        let (mut corners, mut numbers) = (Vec::new(), HashMap::new());
        let mut number = |corner: Vec3| {
            *numbers.entry(corner.to_array().map(f32::to_bits)).or_insert_with(|| {
                corners.push(corner);
                corners.len() as u32 - 1
            })
        };
        let triangles = triangles.positions.iter().map(|&triangle| triangle.map(&mut number)).collect();
        Self { corners, triangles }
    }

    fn corners_of(&self, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|corner| self.corners[corner as usize])
    }

    fn positions(&self) -> Vec<[f32; 3]> {
        self.corners.iter().map(|corner| corner.to_array()).collect()
    }
}

/// Unit vector along a segment.
fn way((start, end): (Vec3, Vec3)) -> Vec3 {
    (end - start).normalize()
}

/// parry3d.
pub struct Parry {
    mesh: TriMesh,
    rays: Vec<parry3d::query::Ray>,
}

impl Parry {
    /// Builds its tree.
    pub fn new(mesh: &Welded, segments: &[(Vec3, Vec3)]) -> Self {
        let vector = |at: Vec3| Vector::new(at.x, at.y, at.z);
        let corners = mesh.corners.iter().map(|&corner| vector(corner)).collect();
        let mesh = TriMesh::new(corners, mesh.triangles.clone()).expect("it has triangles");
        let ray = |&segment: &(Vec3, Vec3)| parry3d::query::Ray::new(vector(segment.0), vector(way(segment)));
        Self { mesh, rays: segments.iter().map(ray).collect() }
    }

    /// Distance of the closest hit, m.
    pub fn cast(&self, number: usize) -> Option<f32> {
        self.mesh.cast_local_ray(&self.rays[number], LENGTH, true)
    }
}

/// A triangle as the crate bvh wants it.
struct Face {
    corners: [[f32; 3]; 3],
    /// Not of unit length.
    normal: Vec3,
    node: usize,
}

impl Bounded<f32, 3> for Face {
    fn aabb(&self) -> Aabb<f32, 3> {
        let [a, b, c] = self.corners.map(Vec3::from_array);
        Aabb::with_bounds(a.min(b).min(c).to_array().into(), a.max(b).max(c).to_array().into())
    }
}

impl BHShape<f32, 3> for Face {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// A ray, and its direction as ours.
struct FacedRay {
    ray: Ray<f32, 3>,
    way: Vec3,
}

impl Face {
    /// Infinite if it is missed.
    #[inline]
    fn distance(&self, ray: &FacedRay) -> f32 {
        let [a, b, c] = self.corners;
        let (b, c) = if ray.way.dot(self.normal) > 0.0 { (c, b) } else { (b, c) };
        ray.ray.intersects_triangle(&a.into(), &b.into(), &c.into()).distance
    }
}

/// Boxes that a ray enters before a limit.
struct Limited<'a> {
    ray: &'a Ray<f32, 3>,
    limit: Cell<f32>,
}

impl IntersectsAabb<f32, 3> for Limited<'_> {
    #[inline]
    fn intersects_aabb(&self, aabb: &Aabb<f32, 3>) -> bool {
        self.ray.intersection_slice_for_aabb(aabb).is_some_and(|(entry, _)| entry <= self.limit.get())
    }
}

/// The crate bvh.
pub struct BvhCrate {
    tree: Bvh<f32, 3>,
    faces: Vec<Face>,
    rays: Vec<FacedRay>,
}

/// The traversals of bvh hold so many nodes, and panic beyond.
const BVH_DEPTH: usize = 32;

impl BvhCrate {
    /// Builds its tree, on one core.
    ///
    /// # Panics
    /// If the tree is deeper than the crate can traverse.
    pub fn new(mesh: &Welded, segments: &[(Vec3, Vec3)]) -> Self {
        let face = |&triangle: &[u32; 3]| {
            let [a, b, c] = mesh.corners_of(triangle);
            Face { corners: [a, b, c].map(|at| at.to_array()), normal: (b - a).cross(c - a), node: 0 }
        };
        let mut faces: Vec<Face> = mesh.triangles.iter().map(face).collect();
        let tree: Bvh<f32, 3> = Bvh::build(&mut faces);
        assert!(depth(&tree) < BVH_DEPTH, "the tree is too deep for its own traversal");
        let ray = |&segment: &(Vec3, Vec3)| {
            let way = way(segment);
            FacedRay { ray: Ray::new(segment.0.to_array().into(), way.to_array().into()), way }
        };
        Self { tree, faces, rays: segments.iter().map(ray).collect() }
    }

    /// Distance of the closest hit, m.
    pub fn nearest_first(&self, number: usize) -> Option<f32> {
        let ray = &self.rays[number];
        let mut nearest = LENGTH;
        for face in self.tree.nearest_traverse_iterator(&ray.ray, &self.faces) {
            let entry = ray.ray.intersection_slice_for_aabb(&face.aabb()).map_or(0.0, |(entry, _)| entry);
            if entry > nearest {
                break;
            }
            nearest = nearest.min(face.distance(ray));
        }
        (nearest < LENGTH).then_some(nearest)
    }

    /// Distance of the closest hit, m.
    pub fn limited(&self, number: usize) -> Option<f32> {
        let ray = &self.rays[number];
        let query = Limited { ray: &ray.ray, limit: Cell::new(LENGTH) };
        for face in self.tree.traverse_iterator(&query, &self.faces) {
            query.limit.set(query.limit.get().min(face.distance(ray)));
        }
        let nearest = query.limit.get();
        (nearest < LENGTH).then_some(nearest)
    }
}

/// Nodes from the root to the deepest leaf.
fn depth(tree: &Bvh<f32, 3>) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0, 1)];
    while let Some((node, depth)) = open.pop() {
        deepest = deepest.max(depth);
        if let BvhNode::Node { child_l_index, child_r_index, .. } = tree.nodes[node] {
            open.extend([(child_l_index, depth + 1), (child_r_index, depth + 1)]);
        }
    }
    deepest
}

fn bevy_rays(segments: &[(Vec3, Vec3)]) -> Vec<Ray3d> {
    let ray = |&segment: &(Vec3, Vec3)| {
        Ray3d::new(segment.0, Dir3::new(way(segment)).expect("segments have a direction"))
    };
    segments.iter().map(ray).collect()
}

/// Bevy's `MeshRayCast`.
pub struct BevyCaster {
    world: World,
    state: SystemState<MeshRayCast<'static, 'static>>,
    rays: Vec<Ray3d>,
}

impl BevyCaster {
    /// A world with that one mesh.
    pub fn new(mesh: &Welded, segments: &[(Vec3, Vec3)]) -> Self {
        // It looks for boxes in parallel, and wants the pool.
        App::new().add_plugins(task_pools(None));
        let asset = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, mesh.positions())
            .with_inserted_indices(Indices::U32(mesh.triangles.as_flattened().to_vec()));
        let mut meshes = Assets::<Mesh>::default();
        let handle = meshes.add(asset);
        let mut world = World::new();
        world.insert_resource(meshes);
        let bounds = MeshBox::enclosing(&mesh.corners).expect("it has corners");
        world.spawn((
            Mesh3d(handle),
            bounds,
            GlobalTransform::IDENTITY,
            Visibility::default(),
            RayCastBackfaces,
        ));
        let state = SystemState::new(&mut world);
        Self { world, state, rays: bevy_rays(segments) }
    }

    /// Distance of the closest hit, m.
    pub fn cast(&mut self, number: usize) -> Option<f32> {
        let settings = MeshRayCastSettings::default().with_visibility(RayCastVisibility::Any);
        let mut caster = self.state.get_mut(&mut self.world).expect("all it needs is there");
        let (_, hit) = caster.cast_ray(self.rays[number], &settings).first()?;
        (hit.distance < LENGTH).then_some(hit.distance)
    }
}

/// What is left of that without a world.
pub struct BareMesh {
    positions: Vec<[f32; 3]>,
    indices: Vec<u32>,
    rays: Vec<Ray3d>,
}

impl BareMesh {
    /// Copies the mesh.
    pub fn new(mesh: &Welded, segments: &[(Vec3, Vec3)]) -> Self {
        let indices = mesh.triangles.as_flattened().to_vec();
        Self { positions: mesh.positions(), indices, rays: bevy_rays(segments) }
    }

    /// Distance of the closest hit, m.
    pub fn cast(&self, number: usize) -> Option<f32> {
        let (at, indices) = (Affine3A::IDENTITY, Some(self.indices.as_slice()));
        let ray = self.rays[number];
        let hit = ray_mesh_intersection(ray, &at, &self.positions, None, indices, None, Backfaces::Include)?;
        (hit.distance < LENGTH).then_some(hit.distance)
    }
}
