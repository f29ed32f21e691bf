//! A bar with two joints for tests, and brute force over its triangles in double precision.
//!
//! Single precision may see the edge of a triangle, or the end of a segment, a little beside where it is, and the more
//! so the narrower the triangle is and the more the segment grazes it. Each crossing knows how far that may be.

use std::f32::consts::FRAC_PI_2;

use bevy::asset::RenderAssetUsages;
use bevy::math::{Affine3A, DMat4, DVec2, DVec3};
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;

use crate::collision::SceneHit;
use crate::test_random::Random;

const RINGS: u16 = 24;

/// A square tube along x, from 0 to 2 and 0.2 across, closed nowhere. Its first joint sits in the origin, the second at
/// x = 1. u grows along x, v goes round.
pub(in crate::collision) struct Bar {
    pub(in crate::collision) positions: Vec<[f32; 3]>,
    pub(in crate::collision) uvs: Vec<[f32; 2]>,
    pub(in crate::collision) joints: Vec<[u16; 4]>,
    pub(in crate::collision) weights: Vec<[f32; 4]>,
    pub(in crate::collision) indices: Vec<u16>,
}

impl Bar {
    pub(in crate::collision) fn new() -> Self {
        let (mut positions, mut uvs, mut weights, mut indices) = (vec![], vec![], vec![], vec![]);
        for ring in 0..=RINGS {
            let along = f32::from(ring) / f32::from(RINGS);
            let x = 2.0 * along;
            // The joint bends 0.4 m of it.
            let second = ((x - 0.8) / 0.4).clamp(0.0, 1.0);
            for (side, [y, z]) in
                [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1]].into_iter().enumerate()
            {
                positions.push([x, y, z]);
                uvs.push([along, side as f32 / 4.0]);
                weights.push([1.0 - second, second, 0.0, 0.0]);
                if ring < RINGS && side < 4 {
                    let a = ring * 5 + side as u16;
                    indices.extend([a, a + 5, a + 1, a + 1, a + 5, a + 6]);
                }
            }
        }
        let joints = vec![[0, 1, 0, 0]; positions.len()];
        Self { positions, uvs, joints, weights, indices }
    }

    pub(in crate::collision) fn to_mesh(&self) -> Mesh {
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, self.positions.clone())
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, self.uvs.clone())
            .with_inserted_attribute(
                Mesh::ATTRIBUTE_JOINT_INDEX,
                VertexAttributeValues::Uint16x4(self.joints.clone()),
            )
            .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, self.weights.clone())
            .with_inserted_indices(Indices::U16(self.indices.clone()))
    }

    /// Where the vertices are, in double precision: matrices blended as Bevy's shader does.
    pub(in crate::collision) fn posed(&self, joints: &[Affine3A; 2]) -> Vec<DVec3> {
        let world_from_mesh =
            |joint: usize| DMat4::from(joints[joint].as_daffine3()) * inverse_bind_poses()[joint].as_dmat4();
        let matrices = [world_from_mesh(0), world_from_mesh(1)];
        let posed = |vertex: usize| {
            let terms = self.joints[vertex].into_iter().zip(self.weights[vertex]);
            let blended = terms.fold(DMat4::ZERO, |sum, (joint, weight)| {
                sum + matrices[usize::from(joint)] * f64::from(weight)
            });
            let [x, y, z] = self.positions[vertex].map(f64::from);
            (blended * DVec3::new(x, y, z).extend(1.0)).truncate()
        };
        (0..self.positions.len()).map(posed).collect()
    }

    /// The posed triangles, for brute force.
    pub(in crate::collision) fn triangles(&self, joints: &[Affine3A; 2]) -> Vec<Triangle> {
        let posed = self.posed(joints);
        let triangle = |vertices: &[u16]| {
            let vertices = [0, 1, 2].map(|corner| usize::from(vertices[corner]));
            Triangle {
                corners: vertices.map(|vertex| posed[vertex]),
                uvs: vertices.map(|vertex| Vec2::from_array(self.uvs[vertex]).as_dvec2()),
            }
        };
        self.indices.chunks_exact(3).map(triangle).collect()
    }
}

pub(in crate::collision) fn inverse_bind_poses() -> [Mat4; 2] {
    [Mat4::IDENTITY, Mat4::from_translation(Vec3::NEG_X)]
}

/// The joints of a bar that begins at `start` and points along x, and up from its middle on.
pub(in crate::collision) fn bent(start: Vec3) -> [Affine3A; 2] {
    let first = Affine3A::from_translation(start);
    [first, first * Affine3A::from_translation(Vec3::X) * Affine3A::from_rotation_z(FRAC_PI_2)]
}

/// What the deformer is given for these joints.
pub(in crate::collision) fn matrices(joints: &[Affine3A; 2]) -> [Affine3A; 2] {
    let [first, second] = inverse_bind_poses().map(Affine3A::from_mat4);
    [joints[0] * first, joints[1] * second]
}

/// A segment through all of the neighbourhood of these triangles, or a short one near one of them.
pub(in crate::collision) fn segment(random: &mut Random, triangles: &[Triangle]) -> (Vec3, Vec3) {
    let triangle = &triangles[(random.unit() * triangles.len() as f32) as usize];
    let middle = (triangle.corners.iter().sum::<DVec3>() / 3.0).as_vec3();
    let reach = if random.unit() < 0.5 { 1.5 } else { 0.1 };
    (middle + random.in_cube(reach), middle + random.in_cube(reach))
}

/// A triangle in world space.
pub(in crate::collision) struct Triangle {
    corners: [DVec3; 3],
    uvs: [DVec2; 3],
}

/// Where a segment crosses a triangle, or nearly does.
struct Crossing {
    fraction: f64,
    weights: [f64; 3],
    normal: DVec3,
    /// Cosine between segment and normal.
    facing: f64,
    /// Shortest height, metres.
    width: f64,
    /// How far single precision may be off in the barycentric coordinates.
    doubt: f64,
    /// And in the fraction.
    fraction_doubt: f64,
}

impl Triangle {
    /// Möller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997.
    fn cross(&self, start: DVec3, end: DVec3) -> Option<Crossing> {
        let [a, b, c] = self.corners;
        let (ab, ac, along) = (b - a, c - a, end - start);
        let p = along.cross(ac);
        let determinant = ab.dot(p);
        let from_a = start - a;
        let q = from_a.cross(ab);
        let (weight_b, weight_c) = (from_a.dot(p) / determinant, along.dot(q) / determinant);
        let twice_area = ab.cross(ac).length();
        let normal = ab.cross(ac) / twice_area;
        let edge = ab.length().max(ac.length()).max((c - b).length());
        let (width, length) = (twice_area / edge, along.length());
        let facing = (normal.dot(along) / length).abs();
        let reach = 1.0 + from_a.length().max((end - a).length());
        let crossing = Crossing {
            fraction: ac.dot(q) / determinant,
            weights: [1.0 - weight_b - weight_c, weight_b, weight_c],
            normal: normal * -normal.dot(along).signum(),
            facing,
            width,
            doubt: 2e-6 * reach / (width * facing),
            fraction_doubt: 2e-6 * (reach + edge * edge / width) / (length * facing),
        };
        crossing.is_within(-1.0).then_some(crossing)
    }
}

impl Crossing {
    /// Whether it is inside triangle and segment by this many doubts.
    fn is_within(&self, doubts: f64) -> bool {
        let margin = doubts * self.fraction_doubt;
        self.weights.iter().all(|&weight| weight >= doubts * self.doubt)
            && self.fraction >= margin
            && self.fraction <= 1.0 - margin
    }
}

/// Fails unless the closest hit on the segment is what brute force says.
pub(in crate::collision) fn check_hit(
    triangles: &[Triangle],
    hit: Option<&SceneHit>,
    start: Vec3,
    end: Vec3,
) {
    let what = format!("{hit:?} from {start} to {end}");
    let (from, to) = (start.as_dvec3(), end.as_dvec3());
    let certain = triangles.iter().filter_map(|triangle| triangle.cross(from, to));
    let certain = certain.filter(|crossing| crossing.is_within(1.0));
    let nearest = certain.min_by(|a, b| a.fraction.total_cmp(&b.fraction));
    let Some(hit) = hit else {
        assert!(nearest.is_none(), "{what}: it passes a triangle");
        return;
    };
    let triangle = &triangles[hit.triangle as usize];
    let crossing = triangle.cross(from, to);
    let crossing = crossing.unwrap_or_else(|| panic!("{what}: it does not touch that triangle"));
    let off = (f64::from(hit.fraction) - crossing.fraction).abs();
    assert!(off <= crossing.fraction_doubt, "{what}: the fraction is {}", crossing.fraction);
    if let Some(nearest) = nearest {
        let doubt = crossing.fraction_doubt + nearest.fraction_doubt;
        assert!(crossing.fraction <= nearest.fraction + doubt, "{what}: {} is nearer", nearest.fraction);
    }
    // Neither uv nor normal of a triangle that is nearly a line, or nearly seen from the side, say much.
    if crossing.width > 0.01 && crossing.facing > 0.01 {
        let uv: DVec2 = triangle.uvs.iter().zip(crossing.weights).map(|(&uv, weight)| uv * weight).sum();
        assert!(hit.uv.as_dvec2().distance(uv) < 1e-3, "{what}: the uv is {uv}");
        assert!(hit.normal.as_dvec3().distance(crossing.normal) < 1e-3, "{what}: not the normal");
        assert!(hit.point.distance(start.lerp(end, hit.fraction)) < 1e-5, "{what}: not the point");
    }
}
