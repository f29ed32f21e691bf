//! Posing a mesh on the CPU: morph targets, then linear blend skinning, as Bevy's vertex shader does it.

use std::sync::Arc;

use bevy::math::{Affine3A, Vec3A};
use bevy::mesh::morph::MorphAttributes;
use bevy::mesh::{Indices, MeshVertexAttribute, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use bevy::tasks::{ComputeTaskPool, ParallelSliceMut};

use crate::collision::MeshTriangles;

/// Above this many vertices other threads are worth waking.
const PARALLEL_VERTICES: usize = 16_384;
/// Vertices that a thread takes at a time.
const CHUNK: usize = 4096;

/// What is needed to pose a mesh: its vertices at rest, and how joints and morph targets move them.
///
/// Weights are used as the mesh has them, like in Bevy's shader: vertices whose weights are all 0 end up in the
/// world's origin.
pub struct Deformer {
    corners: Arc<[[u32; 3]]>,
    rest: Vec<Vec3>,
    /// One per vertex, or none if the mesh has no joints.
    skin: Vec<Influences>,
    morphs: Vec<MorphTarget>,
}

/// The joints that move a vertex.
#[derive(Clone, Copy)]
struct Influences {
    joints: [u16; 4],
    weights: [f32; 4],
}

/// Where a morph target moves the vertices that it does move; ascending by vertex.
struct MorphTarget(Vec<(u32, Vec3)>);

impl Deformer {
    /// Reads a mesh; `triangles` are those of the same mesh. `None` if it has neither joints nor morph targets, or not
    /// one entry for each vertex.
    pub fn from_mesh(mesh: &Mesh, triangles: &MeshTriangles) -> Option<Self> {
        let VertexAttributeValues::Float32x3(positions) = attribute(mesh, Mesh::ATTRIBUTE_POSITION)? else {
            return None;
        };
        let rest: Vec<Vec3> = positions.iter().map(|&position| Vec3::from_array(position)).collect();
        let skin = read_skin(mesh, rest.len());
        let morphs = read_morphs(mesh, rest.len());
        if skin.is_empty() && morphs.is_empty() {
            return None;
        }
        let corners: Option<Vec<[u32; 3]>> =
            triangles.source.iter().map(|&number| vertices_of(mesh, number)).collect();
        let corners = corners.filter(|all| all.as_flattened().iter().all(|&i| (i as usize) < rest.len()))?;
        Some(Self { corners: corners.into(), rest, skin, morphs })
    }

    /// Vertices of each triangle, in the order of the mesh's [`MeshTriangles`].
    pub fn corners(&self) -> &Arc<[[u32; 3]]> {
        &self.corners
    }

    /// The vertices as the mesh has them.
    pub fn rest(&self) -> &[Vec3] {
        &self.rest
    }

    /// Whether joints move it.
    pub fn is_skinned(&self) -> bool {
        !self.skin.is_empty()
    }

    /// Whether it has morph targets.
    pub fn is_morphed(&self) -> bool {
        !self.morphs.is_empty()
    }

    /// Writes the posed vertices to `out`.
    ///
    /// With joints (one matrix each, `world_from_joint * inverse_bind_pose`; one that is missing counts as the identity)
    /// vertices are in world space, wherever the mesh's entity may be. Without, or if the mesh is not skinned, they stay
    /// in mesh space. Weights that are missing are 0.
    pub fn pose(&self, joints: &[Affine3A], morph_weights: &[f32], out: &mut Vec<Vec3>) {
        out.resize(self.rest.len(), Vec3::ZERO);
        match ComputeTaskPool::try_get() {
            // Vertices do not see each other: who poses them does not matter.
            Some(pool) if out.len() > PARALLEL_VERTICES && pool.thread_num() > 1 => {
                out.par_chunk_map_mut(pool, CHUNK, |index, chunk| {
                    self.pose_from(index * CHUNK, joints, morph_weights, chunk);
                });
            }
            _ => self.pose_from(0, joints, morph_weights, out),
        }
    }

    /// Poses the vertices from `first` on.
    fn pose_from(&self, first: usize, joints: &[Affine3A], morph_weights: &[f32], out: &mut [Vec3]) {
        let end = first + out.len();
        out.copy_from_slice(&self.rest[first..end]);
        for (target, &weight) in self.morphs.iter().zip(morph_weights) {
            if weight == 0.0 {
                continue;
            }
            for &(vertex, offset) in target.within(first, end) {
                out[vertex as usize - first] += offset * weight;
            }
        }
        if self.is_skinned() && !joints.is_empty() {
            for (position, influences) in out.iter_mut().zip(&self.skin[first..end]) {
                *position = influences.blend(joints, (*position).into()).into();
            }
        }
    }
}

impl Influences {
    #[inline]
    fn blend(&self, joints: &[Affine3A], position: Vec3A) -> Vec3A {
        let mut blended = Vec3A::ZERO;
        for (&joint, &weight) in self.joints.iter().zip(&self.weights) {
            // Most vertices hang on one joint or two.
            if weight != 0.0 {
                let world_from_mesh = joints.get(usize::from(joint)).unwrap_or(&Affine3A::IDENTITY);
                blended += world_from_mesh.transform_point3a(position) * weight;
            }
        }
        blended
    }
}

impl MorphTarget {
    /// What it does to the vertices from `first` to before `end`.
    fn within(&self, first: usize, end: usize) -> &[(u32, Vec3)] {
        let before = |limit: usize| self.0.partition_point(|&(vertex, _)| (vertex as usize) < limit);
        &self.0[before(first)..before(end)]
    }
}

fn attribute(mesh: &Mesh, attribute: MeshVertexAttribute) -> Option<&VertexAttributeValues> {
    mesh.try_attribute_option(attribute).ok().flatten()
}

/// The joints of each vertex; empty if there are none, or not as many as vertices.
fn read_skin(mesh: &Mesh, vertices: usize) -> Vec<Influences> {
    match (attribute(mesh, Mesh::ATTRIBUTE_JOINT_INDEX), attribute(mesh, Mesh::ATTRIBUTE_JOINT_WEIGHT)) {
        (Some(VertexAttributeValues::Uint16x4(joints)), Some(VertexAttributeValues::Float32x4(weights)))
            if joints.len() == vertices && weights.len() == vertices =>
        {
            joints.iter().zip(weights).map(|(&joints, &weights)| Influences { joints, weights }).collect()
        }
        _ => Vec::new(),
    }
}

/// The morph targets, which Bevy keeps one after the other, each with an entry for every vertex.
fn read_morphs(mesh: &Mesh, vertices: usize) -> Vec<MorphTarget> {
    let Ok(targets) = mesh.try_morph_targets() else { return Vec::new() };
    if vertices == 0 || !targets.len().is_multiple_of(vertices) {
        return Vec::new();
    }
    let moved = |target: &[MorphAttributes]| {
        let offsets = (0u32..).zip(target.iter().map(|vertex| vertex.position));
        MorphTarget(offsets.filter(|&(_, offset)| offset != Vec3::ZERO).collect())
    };
    targets.chunks_exact(vertices).map(moved).collect()
}

/// The vertices of a triangle by its number in the mesh, wound as [`MeshTriangles::from_mesh`] has it.
fn vertices_of(mesh: &Mesh, triangle: u32) -> Option<[u32; 3]> {
    let indices = mesh.try_indices_option().ok()?;
    let vertex = |corner: u32| match indices {
        None => Some(corner),
        Some(Indices::U16(indices)) => indices.get(corner as usize).map(|&vertex| u32::from(vertex)),
        Some(Indices::U32(indices)) => indices.get(corner as usize).copied(),
    };
    let [a, b, c] = match mesh.primitive_topology() {
        PrimitiveTopology::TriangleList => [0, 1, 2].map(|corner| 3 * triangle + corner),
        PrimitiveTopology::TriangleStrip if triangle.is_multiple_of(2) => {
            [0, 1, 2].map(|next| triangle + next)
        }
        PrimitiveTopology::TriangleStrip => [0, 2, 1].map(|next| triangle + next),
        _ => return None,
    };
    Some([vertex(a)?, vertex(b)?, vertex(c)?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::deform::test_bar::{Bar, bent, matrices};
    use crate::collision::triangles::tests::mesh;

    fn deformer(mesh: &Mesh) -> Deformer {
        Deformer::from_mesh(mesh, &MeshTriangles::from_mesh(mesh).unwrap()).unwrap()
    }

    fn moved(offset: Vec3) -> MorphAttributes {
        MorphAttributes::new(offset, Vec3::ZERO, Vec3::ZERO)
    }

    #[test]
    fn corners_are_those_of_the_triangles_that_can_be_hit() {
        use PrimitiveTopology::{TriangleList, TriangleStrip};
        let nan = [f32::NAN, 0.0, 0.0];
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.5], nan, [0.0, 0.0, 2.0]];
        // Good triangles between degenerate ones, ones that are not finite, and ones out of range.
        let list = vec![0, 1, 2, 0, 0, 1, 2, 1, 3, 0, 1, 4, 0, 1, 99, 3, 2, 5];
        let short = [0, 1, 2, 0, 0, 1, 2, 1, 3].to_vec();
        let unrolled: Vec<[f32; 3]> = [0, 1, 2, 0, 0, 1, 2, 1, 3].map(|i: usize| points[i]).to_vec();
        for mut mesh in [
            mesh(TriangleList, &unrolled, None),
            mesh(TriangleList, &points, Some(Indices::U32(list))),
            mesh(TriangleList, &points, Some(Indices::U16(short))),
            mesh(TriangleStrip, &points[..4], None),
            mesh(TriangleStrip, &points, Some(Indices::U16(vec![0, 1, 1, 2, 3, 5, 0]))),
        ] {
            mesh.set_morph_targets(vec![moved(Vec3::Y); mesh.count_vertices()]);
            let triangles = MeshTriangles::from_mesh(&mesh).unwrap();
            let deformer = deformer(&mesh);
            assert!(triangles.positions.len() >= 2);
            let read =
                deformer.corners().iter().map(|vertices| vertices.map(|v| deformer.rest()[v as usize]));
            assert_eq!(read.collect::<Vec<_>>(), triangles.positions);
        }
    }

    #[test]
    fn a_mesh_that_nothing_moves_has_no_deformer() {
        let plain = Mesh::from(Sphere::new(1.0));
        assert!(Deformer::from_mesh(&plain, &MeshTriangles::from_mesh(&plain).unwrap()).is_none());
        // One entry short of two targets.
        let mut short = plain.clone();
        short.set_morph_targets(vec![moved(Vec3::X); 2 * plain.count_vertices() - 1]);
        assert!(Deformer::from_mesh(&short, &MeshTriangles::from_mesh(&short).unwrap()).is_none());
    }

    #[test]
    fn skinned_vertices_are_where_double_precision_says() {
        let bar = Bar::new();
        let joints = bent(Vec3::new(3.0, -1.0, 2.0));
        let mut posed = Vec::new();
        deformer(&bar.to_mesh()).pose(&matrices(&joints), &[], &mut posed);
        for (posed, exact) in posed.iter().zip(bar.posed(&joints)) {
            assert!((posed.as_dvec3() - exact).length() < 2e-6, "{posed} {exact}");
        }
        // The far end points up now: from (2, -0.1, -0.1) to a metre beside and above where the bar begins.
        let end = posed[posed.len() - 1];
        assert!((end - Vec3::new(4.1, 0.0, 1.9)).length() < 1e-5, "{end}");
    }

    #[test]
    fn morph_targets_add_up_and_skinning_comes_after() {
        let bar = Bar::new();
        let mut mesh = bar.to_mesh();
        let vertices = mesh.count_vertices();
        let first = (0..vertices).map(|vertex| moved(Vec3::X * (vertex % 2) as f32));
        let second = (0..vertices).map(|_| moved(Vec3::Z));
        mesh.set_morph_targets(first.chain(second).collect());
        let deformer = deformer(&mesh);
        let (mut still, mut morphed) = (Vec::new(), Vec::new());
        deformer.pose(&[], &[], &mut still);
        assert_eq!(still, deformer.rest());
        // A weight too many is nobody's.
        deformer.pose(&[], &[2.0, -0.5, 7.0], &mut morphed);
        for (vertex, (after, before)) in morphed.iter().zip(&still).enumerate() {
            let offset = Vec3::new(2.0 * (vertex % 2) as f32, 0.0, -0.5);
            assert!((*after - *before - offset).length() < 1e-6);
        }
        // Turned by a quarter about y, what was moved along z is moved along x.
        let turned = [Affine3A::from_rotation_y(std::f32::consts::FRAC_PI_2); 2];
        deformer.pose(&turned, &[], &mut still);
        deformer.pose(&turned, &[0.0, 1.0], &mut morphed);
        for (after, before) in morphed.iter().zip(&still) {
            assert!((*after - *before - Vec3::X).length() < 1e-6);
        }
    }

    #[test]
    fn threads_pose_what_one_would() {
        ComputeTaskPool::get_or_init(default);
        let mut mesh = crate::scenes::meshes::ground(Vec2::splat(4.0), UVec2::splat(160)).unwrap();
        let vertices = mesh.count_vertices();
        assert!(vertices > PARALLEL_VERTICES && !vertices.is_multiple_of(CHUNK));
        let wave = |vertex: usize| moved(Vec3::Y * ((vertex % 97) as f32 * 0.01));
        mesh.set_morph_targets((0..vertices).map(wave).collect());
        let joints: Vec<[u16; 4]> = (0..vertices).map(|vertex| [(vertex % 3) as u16, 1, 0, 0]).collect();
        mesh.insert_attribute(Mesh::ATTRIBUTE_JOINT_INDEX, VertexAttributeValues::Uint16x4(joints));
        mesh.insert_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, vec![[0.7_f32, 0.3, 0.0, 0.0]; vertices]);
        let deformer = deformer(&mesh);
        let joints = [0.1, 0.2, 0.3].map(Affine3A::from_rotation_x);
        let mut by_many = Vec::new();
        deformer.pose(&joints, &[0.4], &mut by_many);
        let mut by_one = vec![Vec3::ZERO; vertices];
        deformer.pose_from(0, &joints, &[0.4], &mut by_one);
        assert_eq!(by_many, by_one);
    }

    #[test]
    fn nonsense_moves_vertices_and_nothing_else() {
        let mut bar = Bar::new();
        let mut posed = Vec::new();
        // Joints that are not there are the identity.
        bar.joints.fill([77, 1, 0, 0]);
        bar.weights.fill([1.0, 0.0, 0.0, 0.0]);
        deformer(&bar.to_mesh()).pose(&[Affine3A::IDENTITY], &[], &mut posed);
        assert_eq!(posed, deformer(&bar.to_mesh()).rest());
        // A joint that is not a number spoils nobody who does not hang on it.
        bar.joints.fill([0, 1, 1, 1]);
        let nan = Affine3A::from_translation(Vec3::NAN);
        deformer(&bar.to_mesh()).pose(&[Affine3A::IDENTITY, nan], &[], &mut posed);
        assert!(posed.iter().all(|position| position.is_finite()));
        bar.weights.fill([0.0; 4]);
        deformer(&bar.to_mesh()).pose(&[Affine3A::from_translation(Vec3::ONE)], &[], &mut posed);
        assert!(posed.iter().all(|&position| position == Vec3::ZERO));
    }
}
