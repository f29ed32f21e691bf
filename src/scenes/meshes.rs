//! Meshes made from a few numbers: a ground grid, a UV sphere and a vase.
//!
//! Every mesh is an indexed triangle list with positions, unit normals, UVs and tangents, wound
//! counter-clockwise as seen from outside. A closed surface is cut open along one meridian: the vertices of
//! that column exist twice, with `u = 0` and `u = 1` at the same place. Seen from outside, `u` grows to the
//! right and `v` downwards, as glTF has it, so that a texture is not mirrored.
//!
//! The vase is a lathe. Its profile is a centripetal Catmull-Rom spline through a table of control points,
//! cut into short pieces at the lip and the foot and longer ones along the belly; its normals come from the
//! spline's tangent rather than from the triangles. A profile that met the axis would end in triangles
//! without area; this one stops short of it and leaves a hole of a fraction of a percent of the height at
//! either end.
//!
//! Catmull and Rom, "A class of local interpolating splines", 1974; the centripetal knots after Yuksel,
//! Schaefer and Keyser, "Parameterization and applications of Catmull-Rom curves", 2011.

use std::f32::consts::{PI, TAU};

use bevy::asset::RenderAssetUsages;
use bevy::math::{UVec2, Vec2, Vec3};
use bevy::mesh::{GenerateTangentsError, Indices, Mesh, PrimitiveTopology};
use thiserror::Error;

/// Why a mesh could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A length was zero, negative or not a number.
    #[error("{what} must be a positive number of metres, got {got}")]
    NotPositive {
        /// The argument's name.
        what: &'static str,
        /// What was passed.
        got: f32,
    },
    /// There are too few pieces to make the shape.
    #[error("{what} must be at least {least}, got {got}")]
    TooFew {
        /// The argument's name.
        what: &'static str,
        /// The smallest number that works.
        least: u32,
        /// What was passed.
        got: u32,
    },
    /// The vertices cannot be counted with 32 bits.
    #[error("a mesh of {columns} by {rows} pieces has more vertices than 32-bit indices can name")]
    TooMany {
        /// Pieces along `u`.
        columns: u32,
        /// Pieces along `v`.
        rows: u32,
    },
    /// The tangents could not be computed.
    #[error("the mesh has no tangents")]
    Tangents(#[from] GenerateTangentsError),
}

/// A horizontal grid at `y = 0`, centred on the origin and facing up.
///
/// `size` is the extent along x and z in metres, `cells` the number of quads along each; the mesh has
/// `2 * cells.x * cells.y` triangles. `u` runs from 0 to 1 with x, `v` from 0 to 1 with z.
///
/// # Errors
/// [`MeshError::NotPositive`] and [`MeshError::TooFew`] for a grid without area, [`MeshError::TooMany`].
pub fn ground(size: Vec2, cells: UVec2) -> Result<Mesh, MeshError> {
    positive("size.x", size.x)?;
    positive("size.y", size.y)?;
    at_least("cells.x", 1, cells.x)?;
    at_least("cells.y", 1, cells.y)?;
    let mut surface = Surface::with_lattice(cells.x, cells.y)?;
    for row in 0..=cells.y {
        for column in 0..=cells.x {
            let uv = Vec2::new(column as f32 / cells.x as f32, row as f32 / cells.y as f32);
            let at = (uv - 0.5) * size;
            surface.push(Vec3::new(at.x, 0.0, at.y), Vec3::Y, uv);
        }
    }
    surface.into_mesh()
}

/// A sphere around the origin, cut into `sectors` around and `stacks` from pole to pole.
///
/// `radius` is in metres. The poles are fans: the mesh has `2 * sectors * (stacks - 1)` triangles. A pole
/// has one vertex for each of its triangles, with `u` in the middle of that triangle. `v` is 0 at the top.
///
/// # Errors
/// [`MeshError::NotPositive`], [`MeshError::TooFew`] (3 sectors and 2 stacks make the smallest sphere),
/// [`MeshError::TooMany`].
pub fn uv_sphere(radius: f32, sectors: u32, stacks: u32) -> Result<Mesh, MeshError> {
    positive("radius", radius)?;
    at_least("sectors", 3, sectors)?;
    at_least("stacks", 2, stacks)?;
    // The lattice covers the bands between the poles: stacks - 1 rings, one row of quads fewer.
    let mut surface = Surface::with_lattice(sectors, stacks - 2)?;
    for ring in 1..stacks {
        let v = ring as f32 / stacks as f32;
        let (sin, cos) = (v * PI).sin_cos();
        for column in 0..=sectors {
            let normal = meridian(column, sectors) * sin + Vec3::Y * cos;
            surface.push(normal * radius, normal.normalize(), Vec2::new(column as f32 / sectors as f32, v));
        }
    }
    let last_ring = (stacks - 2) * (sectors + 1);
    for column in 0..sectors {
        let u = (column as f32 + 0.5) / sectors as f32;
        let top = surface.push(Vec3::Y * radius, Vec3::Y, Vec2::new(u, 0.0));
        surface.indices.extend([top, column, column + 1]);
        let bottom = surface.push(Vec3::NEG_Y * radius, Vec3::NEG_Y, Vec2::new(u, 1.0));
        surface.indices.extend([last_ring + column, bottom, last_ring + column + 1]);
    }
    surface.into_mesh()
}

/// A vase like a Greek amphora without its handles, standing on `y = 0` around the y axis.
///
/// `height` is in metres; the belly is 0.58 heights wide. Foot, belly, neck and flared lip are one surface
/// with the inner wall, which goes down past the belly to a floor, so the vase looks hollow. That surface
/// ends at a hole 0.6 % of the height in radius in the floor and in the underside, and nowhere else.
///
/// The mesh has `2 * segments * rings` triangles, `segments` around and `rings` along the profile. `u` runs
/// from 0 to 1 around; `v` is the arc length along the profile, 0 at the inner floor, 1 under the foot.
///
/// # Errors
/// [`MeshError::NotPositive`], [`MeshError::TooFew`] (3 segments; 24 rings, below which the lip is lost),
/// [`MeshError::TooMany`].
pub fn vase(height: f32, segments: u32, rings: u32) -> Result<Mesh, MeshError> {
    positive("height", height)?;
    at_least("segments", 3, segments)?;
    at_least("rings", 24, rings)?;
    let mut surface = Surface::with_lattice(segments, rings)?;
    for point in profile(rings) {
        // Walking down outside, the right-hand side of the tangent faces inwards: turn left.
        let out = Vec2::new(-point.tangent.y, point.tangent.x);
        for column in 0..=segments {
            let around = meridian(column, segments);
            surface.push(
                (around * point.at.x + Vec3::Y * point.at.y) * height,
                (around * out.x + Vec3::Y * out.y).normalize(),
                Vec2::new(column as f32 / segments as f32, point.arc),
            );
        }
    }
    surface.into_mesh()
}

/// The vase's profile, radius and height for a vase one unit tall, from the inner floor up to the lip and
/// down the outside to the middle of the underside. The spline's own extremes are scaled to 0 and 1.
const VASE_PROFILE: [[f32; 2]; 33] = [
    [0.006, 0.352], // inner floor, next to the axis
    [0.090, 0.356],
    [0.185, 0.390],
    [0.243, 0.460],
    [0.264, 0.548], // belly, inside
    [0.238, 0.640],
    [0.174, 0.711],
    [0.106, 0.760],
    [0.078, 0.815],
    [0.073, 0.870], // neck, inside
    [0.083, 0.925],
    [0.108, 0.965],
    [0.132, 0.990],
    [0.146, 1.000], // lip
    [0.155, 0.993],
    [0.150, 0.980],
    [0.128, 0.958],
    [0.103, 0.920],
    [0.093, 0.870], // neck
    [0.099, 0.820],
    [0.127, 0.775],
    [0.195, 0.725], // shoulder
    [0.262, 0.645],
    [0.289, 0.548], // belly
    [0.277, 0.440],
    [0.222, 0.285],
    [0.135, 0.145],
    [0.090, 0.076], // stem
    [0.104, 0.048],
    [0.146, 0.032], // foot
    [0.151, 0.010],
    [0.128, 0.000],
    [0.006, 0.010], // underside, next to the axis
];

/// A point of the profile: radius and height, the tangent in the direction of the walk, and the arc length
/// walked so far as a fraction of the whole.
#[derive(Clone, Copy)]
struct ProfilePoint {
    at: Vec2,
    tangent: Vec2,
    arc: f32,
}

/// `rings + 1` points along [`VASE_PROFILE`], closer to each other where it turns; unit tangents.
fn profile(rings: u32) -> Vec<ProfilePoint> {
    // Fine enough that a chord stands for its arc: a few hundredths of a percent of the height each.
    const STEPS_PER_SPAN: usize = 64;
    // In 1/heights. Added to the curvature, so that straight pieces do not go without rings.
    const LEAST_CURVATURE: f32 = 4.0;
    let control: Vec<Vec2> = VASE_PROFILE.iter().map(|&point| point.into()).collect();
    let spans = control.len() - 1;
    let knot: Vec<f32> = control.windows(2).map(|pair| pair[0].distance(pair[1]).sqrt()).collect();
    let slope: Vec<Vec2> = (0..spans).map(|i| (control[i + 1] - control[i]) / knot[i]).collect();
    let tangent = |i: usize| match i {
        0 => slope[0],
        i if i == spans => slope[spans - 1],
        i => (slope[i - 1] * knot[i] + slope[i] * knot[i - 1]) / (knot[i - 1] + knot[i]),
    };
    // The spline as a fine polyline of cubic Hermite spans.
    let fine: Vec<ProfilePoint> = (0..=spans * STEPS_PER_SPAN)
        .map(|step| {
            let span = (step / STEPS_PER_SPAN).min(spans - 1);
            let t = (step - span * STEPS_PER_SPAN) as f32 / STEPS_PER_SPAN as f32;
            let (p0, p1) = (control[span], control[span + 1]);
            let (m0, m1) = (tangent(span) * knot[span], tangent(span + 1) * knot[span]);
            let at = p0 * ((2.0 * t - 3.0) * t * t + 1.0)
                + p1 * ((3.0 - 2.0 * t) * t * t)
                + m0 * (((t - 2.0) * t + 1.0) * t)
                + m1 * ((t - 1.0) * t * t);
            let along = (p1 - p0) * (6.0 * t * (1.0 - t))
                + m0 * ((3.0 * t - 4.0) * t + 1.0)
                + m1 * ((3.0 * t - 2.0) * t);
            ProfilePoint { at, tangent: along, arc: 0.0 }
        })
        .collect();
    let (low, high) = fine
        .iter()
        .fold((f32::MAX, f32::MIN), |(low, high), point| (low.min(point.at.y), high.max(point.at.y)));
    let stretch = 1.0 / (high - low);
    // A chord stays equally close to its arc everywhere if rings are dense as the root of the curvature.
    let mut walked = vec![(0.0, 0.0)];
    let (mut length, mut rings_due) = (0.0f32, 0.0f32);
    for pair in fine.windows(2) {
        let step = pair[0].at.distance(pair[1].at);
        let turn = pair[0].tangent.angle_to(pair[1].tangent).abs();
        length += step;
        rings_due += ((LEAST_CURVATURE * step + turn) * step).sqrt();
        walked.push((rings_due, length));
    }
    (0..=rings)
        .map(|ring| {
            let wanted = rings_due * ring as f32 / rings as f32;
            let i = walked.partition_point(|&(due, _)| due < wanted).clamp(1, fine.len() - 1);
            let ((due_before, length_before), (due_after, length_after)) = (walked[i - 1], walked[i]);
            let t = ((wanted - due_before) / (due_after - due_before)).clamp(0.0, 1.0);
            let at = fine[i - 1].at.lerp(fine[i].at, t);
            let along = fine[i - 1].tangent.lerp(fine[i].tangent, t);
            ProfilePoint {
                at: Vec2::new(at.x, (at.y - low) * stretch),
                tangent: Vec2::new(along.x, along.y * stretch).normalize(),
                arc: ((length_before + (length_after - length_before) * t) / length).clamp(0.0, 1.0),
            }
        })
        .collect()
}

/// The horizontal unit vector of a column: +Z first, then towards +X, to the right as seen from outside.
/// The last column is the first one again, to the bit.
fn meridian(column: u32, columns: u32) -> Vec3 {
    let (sin, cos) = (TAU * (column % columns) as f32 / columns as f32).sin_cos();
    Vec3::new(sin, 0.0, cos)
}

fn positive(what: &'static str, got: f32) -> Result<(), MeshError> {
    if got > 0.0 && got.is_finite() { Ok(()) } else { Err(MeshError::NotPositive { what, got }) }
}

fn at_least(what: &'static str, least: u32, got: u32) -> Result<(), MeshError> {
    if got >= least { Ok(()) } else { Err(MeshError::TooFew { what, least, got }) }
}

/// Vertices and triangles on their way to a [`Mesh`].
#[derive(Default)]
struct Surface {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    indices: Vec<u32>,
}

impl Surface {
    /// The triangles of `columns` by `rows` quads, whose vertices are still to be pushed row by row, each
    /// row to the right and the next one below it as seen from outside.
    fn with_lattice(columns: u32, rows: u32) -> Result<Self, MeshError> {
        let too_many = MeshError::TooMany { columns, rows };
        let stride = columns.checked_add(1);
        // Two rows more, for the poles of a sphere.
        let vertices = rows.checked_add(3).zip(stride).and_then(|(rows, stride)| rows.checked_mul(stride));
        let (Some(stride), Some(_)) = (stride, vertices) else { return Err(too_many) };
        let mut surface = Self::default();
        for row in 0..rows {
            for column in 0..columns {
                let a = row * stride + column;
                let (b, c, d) = (a + 1, a + stride, a + stride + 1);
                surface.indices.extend([a, c, b, b, c, d]);
            }
        }
        Ok(surface)
    }

    fn push(&mut self, position: Vec3, normal: Vec3, uv: Vec2) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.uvs.push(uv);
        self.positions.len() as u32 - 1
    }

    fn into_mesh(self) -> Result<Mesh, MeshError> {
        let mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, self.positions)
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, self.normals)
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, self.uvs)
            .with_inserted_indices(Indices::U32(self.indices))
            .with_generated_tangents()?;
        Ok(mesh)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::mesh::VertexAttributeValues;

    struct Parts {
        positions: Vec<Vec3>,
        normals: Vec<Vec3>,
        uvs: Vec<Vec2>,
        triangles: Vec<[usize; 3]>,
    }

    fn parts(mesh: &Mesh) -> Parts {
        let vec3 = |attribute| match mesh.attribute(attribute) {
            Some(VertexAttributeValues::Float32x3(values)) => values.iter().map(|&v| v.into()).collect(),
            other => panic!("{other:?}"),
        };
        let Some(VertexAttributeValues::Float32x2(uvs)) = mesh.attribute(Mesh::ATTRIBUTE_UV_0) else {
            panic!("no uvs")
        };
        let indices: Vec<usize> = mesh.indices().expect("indexed").iter().collect();
        Parts {
            positions: vec3(Mesh::ATTRIBUTE_POSITION),
            normals: vec3(Mesh::ATTRIBUTE_NORMAL),
            uvs: uvs.iter().map(|&v| v.into()).collect(),
            triangles: indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        }
    }

    fn presets() -> [(&'static str, Mesh, usize); 3] {
        [
            ("ground", ground(Vec2::new(3.0, 4.0), UVec2::new(24, 33)).expect("valid"), 1584),
            ("sphere", uv_sphere(0.4, 26, 19).expect("valid"), 936),
            ("vase", vase(1.0, 64, 86).expect("valid"), 11_008),
        ]
    }

    #[test]
    fn every_mesh_has_its_triangles_and_all_of_them_face_outwards() {
        for (name, mesh, triangles) in presets() {
            let parts = parts(&mesh);
            assert_eq!(parts.triangles.len(), triangles, "{name}");
            for triangle in &parts.triangles {
                let [a, b, c] = triangle.map(|i| parts.positions[i]);
                let cross = (b - a).cross(c - a);
                assert!(cross.length() / 2.0 > 1e-12, "{name} {triangle:?} is degenerate");
                for &i in triangle {
                    assert!(cross.normalize().dot(parts.normals[i]) > 0.5, "{name} {triangle:?}");
                }
            }
        }
    }

    #[test]
    fn attributes_are_complete_and_in_range() {
        for (name, mesh, _) in presets() {
            let parts = parts(&mesh);
            let Some(VertexAttributeValues::Float32x4(tangents)) = mesh.attribute(Mesh::ATTRIBUTE_TANGENT)
            else {
                panic!("{name}: no tangents")
            };
            assert_eq!(tangents.len(), parts.positions.len(), "{name}");
            for (i, normal) in parts.normals.iter().enumerate() {
                assert!((normal.length() - 1.0).abs() < 1e-5, "{name} {i}: {normal}");
                let [x, y, z, sign] = tangents[i];
                let tangent = Vec3::new(x, y, z);
                assert!((tangent.length() - 1.0).abs() < 1e-4, "{name} {i}: {tangent}");
                assert!(tangent.dot(*normal).abs() < 1e-3 && sign.abs() == 1.0, "{name} {i}");
                let uv = parts.uvs[i];
                assert!(uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all(), "{name} {i}: {uv}");
            }
        }
    }

    #[test]
    fn textures_are_not_mirrored() {
        for (name, mesh, _) in presets() {
            let parts = parts(&mesh);
            for triangle in &parts.triangles {
                let [a, b, c] = triangle.map(|i| parts.uvs[i]);
                // Counter-clockwise outside is clockwise in an image whose rows go down.
                assert!((b - a).perp_dot(c - a) < 0.0, "{name} {triangle:?}");
            }
        }
    }

    #[test]
    fn the_seam_is_closed() {
        for (name, mesh, _) in presets().into_iter().skip(1) {
            let parts = parts(&mesh);
            let column = |u: f32| -> Vec<Vec3> {
                parts.uvs.iter().zip(&parts.positions).filter(|(uv, _)| uv.x == u).map(|(_, p)| *p).collect()
            };
            assert!(column(0.0).len() >= 18, "{name}");
            assert_eq!(column(0.0), column(1.0), "{name}");
        }
    }

    #[test]
    fn sphere_normals_are_radial() {
        let parts = parts(&uv_sphere(0.4, 26, 19).expect("valid"));
        for (position, normal) in parts.positions.iter().zip(&parts.normals) {
            assert!((position.length() - 0.4).abs() < 1e-6 && position.dot(*normal) > 0.4 - 1e-6);
        }
    }

    #[test]
    fn the_vase_stands_on_the_ground_and_never_meets_the_axis_or_itself() {
        let points = profile(86);
        let (low, high) = points.iter().fold((1.0f32, 0.0f32), |(l, h), p| (l.min(p.at.y), h.max(p.at.y)));
        assert!(low.abs() < 2e-3 && (high - 1.0).abs() < 2e-3, "{low} {high}");
        assert!(points.iter().all(|point| point.at.x > 0.005));
        let crosses = |a: Vec2, b: Vec2, c: Vec2, d: Vec2| {
            let side = |p: Vec2, q: Vec2, r: Vec2| (q - p).perp_dot(r - p);
            side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
        };
        for i in 0..86 {
            for j in i + 2..86 {
                let (a, b, c, d) = (points[i].at, points[i + 1].at, points[j].at, points[j + 1].at);
                assert!(!crosses(a, b, c, d), "pieces {i} and {j} cross");
            }
        }
    }

    #[test]
    fn the_smallest_shapes_have_area() {
        let ground = ground(Vec2::ONE, UVec2::ONE).expect("valid");
        let sphere = uv_sphere(1.0, 3, 2).expect("valid");
        let vase = vase(0.01, 3, 24).expect("valid");
        for (mesh, triangles) in [(ground, 2), (sphere, 6), (vase, 144)] {
            let parts = parts(&mesh);
            assert_eq!(parts.triangles.len(), triangles);
            for triangle in &parts.triangles {
                let [a, b, c] = triangle.map(|i| parts.positions[i]);
                assert!((b - a).cross(c - a).length() / 2.0 > 1e-12, "{triangle:?}");
            }
        }
    }

    #[test]
    fn bad_arguments_are_errors() {
        let not_positive = |result| matches!(result, Err(MeshError::NotPositive { .. }));
        assert!(not_positive(ground(Vec2::new(1.0, f32::NAN), UVec2::ONE)));
        assert!(not_positive(uv_sphere(-1.0, 26, 19)));
        assert!(not_positive(vase(f32::INFINITY, 64, 86)));
        assert!(matches!(ground(Vec2::ONE, UVec2::new(0, 1)), Err(MeshError::TooFew { .. })));
        assert!(matches!(vase(1.0, 64, 4), Err(MeshError::TooFew { .. })));
        assert!(matches!(ground(Vec2::ONE, UVec2::MAX), Err(MeshError::TooMany { .. })));
    }
}
