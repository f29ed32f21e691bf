//! Vessels turned on a lathe: their profile, taken around the y axis.
//!
//! The normals come from the tangent of the profile's spline rather than from the triangles. A profile that
//! met the axis would end in triangles without area; these stop short of it and leave a hole of a fraction
//! of a percent of the height at either end.

use bevy::math::{Vec2, Vec3};
use bevy::mesh::Mesh;

use super::profile::Profile;
use super::{MeshError, Surface, at_least, meridian, positive};

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
    turn(&VASE, height, segments, rings)
}

/// The common terracotta flowerpot, standing on `y = 0` around the y axis.
///
/// `height` is in metres; the rim is 1.1 heights wide. A straight wall widens upwards to a band around the
/// topmost fifth, which stands out from it in a step; the pot is open and hollow down to a floor. Its edges
/// are as round as worn clay, about 1 % of the height, and the walls between them straight. The surface ends
/// at a hole 0.6 % of the height in radius in the floor and in the underside, and nowhere else.
///
/// The mesh has `2 * segments * rings` triangles, `segments` around and `rings` along the profile, most of
/// them at the edges. `u` runs from 0 to 1 around; `v` is the arc length along the profile, 0 at the inner
/// floor, 1 under the foot.
///
/// # Errors
/// [`MeshError::NotPositive`], [`MeshError::TooFew`] (3 segments; 40 rings, below which the edges are lost),
/// [`MeshError::TooMany`].
pub fn flowerpot(height: f32, segments: u32, rings: u32) -> Result<Mesh, MeshError> {
    turn(&FLOWERPOT, height, segments, rings)
}

fn turn(profile: &Profile, height: f32, segments: u32, rings: u32) -> Result<Mesh, MeshError> {
    positive("height", height)?;
    at_least("segments", 3, segments)?;
    at_least("rings", profile.least_rings, rings)?;
    let mut surface = Surface::with_lattice(segments, rings)?;
    for point in profile.points(rings) {
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

/// From the inner floor up to the lip and down the outside to the middle of the underside.
const VASE: Profile = Profile {
    control: &[
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
    ],
    least_curvature: 4.0,
    least_rings: 24,
};

/// From the inner floor up to the lip and down the outside to the middle of the underside. An edge is two
/// points; those without a note are the second of their pair.
const FLOWERPOT: Profile = Profile {
    control: &[
        [0.0060, 0.066], // inner floor, next to the axis
        [0.1200, 0.068],
        [0.2400, 0.072],
        [0.2870, 0.082], // where the floor meets the wall, rounded
        [0.3050, 0.112],
        [0.3235, 0.200], // inner wall
        [0.4733, 0.972], // inner wall, below the lip
        [0.4770, 0.991], // inner edge of the lip
        [0.4860, 1.000],
        [0.5000, 1.000], // lip
        [0.5300, 1.000], // lip
        [0.5440, 1.000], // outer edge of the lip
        [0.5510, 0.994],
        [0.5495, 0.976], // band
        [0.5365, 0.826], // band
        [0.5350, 0.806], // lower edge of the band
        [0.5290, 0.800],
        [0.5150, 0.800], // step
        [0.5000, 0.800], // step
        [0.4860, 0.800], // where the step meets the wall
        [0.4805, 0.795],
        [0.4775, 0.778], // wall, below the step
        [0.3425, 0.030], // wall, above the foot
        [0.3390, 0.011], // edge of the foot
        [0.3290, 0.000],
        [0.3050, 0.000], // foot, what the pot stands on
        [0.2900, 0.000],
        [0.2500, 0.008], // underside, hollowed
        [0.0060, 0.012], // underside, next to the axis
    ],
    least_curvature: 0.25,
    least_rings: 40,
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::meshes::checks::parts;
    use crate::scenes::meshes::profile::ProfilePoint;

    #[test]
    fn vessels_stand_on_the_ground_and_never_meet_the_axis_or_themselves() {
        for (name, profile) in [("vase", VASE), ("flowerpot", FLOWERPOT)] {
            let points = profile.points(86);
            let (low, high) =
                points.iter().fold((1.0f32, 0.0f32), |(l, h), p| (l.min(p.at.y), h.max(p.at.y)));
            assert!(low.abs() < 2e-3 && (high - 1.0).abs() < 2e-3, "{name}: {low} {high}");
            assert!(points.iter().all(|point| point.at.x > 0.005), "{name}");
            let crosses = |a: Vec2, b: Vec2, c: Vec2, d: Vec2| {
                let side = |p: Vec2, q: Vec2, r: Vec2| (q - p).perp_dot(r - p);
                side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
            };
            for i in 0..points.len() - 1 {
                for j in i + 2..points.len() - 1 {
                    let (a, b, c, d) = (points[i].at, points[i + 1].at, points[j].at, points[j + 1].at);
                    assert!(!crosses(a, b, c, d), "{name}: pieces {i} and {j} cross");
                }
            }
        }
    }

    #[test]
    fn the_flowerpot_is_hollow_and_its_rim_is_a_step() {
        let parts = parts(&flowerpot(0.3, 64, 86).expect("valid"));
        let widest = |from: f32, to: f32| {
            let between = parts.positions.iter().filter(|at| (from..to).contains(&(at.y / 0.3)));
            between.map(|at| at.x.hypot(at.z) / 0.3).fold(0.0, f32::max)
        };
        assert!((widest(-0.1, 1.1) * 2.0 - 1.1).abs() < 0.02);
        assert!(widest(0.82, 1.1) > widest(0.6, 0.79) + 0.05, "the band stands out");
        assert!(widest(0.6, 0.79) > widest(-0.1, 0.1) + 0.08, "the wall is tapered");
        let faces = |up: f32, from: f32, to: f32| {
            let vertices = parts.positions.iter().zip(&parts.normals);
            vertices.filter(|(at, normal)| normal.y * up > 0.99 && (from..to).contains(&(at.y / 0.3))).count()
        };
        assert!(faces(1.0, 0.99, 1.1) > 0, "the lip faces up");
        assert!(faces(-1.0, 0.79, 0.81) > 0, "the step faces down");
        assert!(faces(1.0, 0.05, 0.1) > 0, "the floor faces up");
    }

    #[test]
    fn the_walls_of_the_flowerpot_are_straight_up_to_crisp_edges() {
        for rings in [64, 86, 200] {
            let points = FLOWERPOT.points(rings);
            let wall = |low: f32, high: f32, up: f32| -> Vec<&ProfilePoint> {
                let on_it = |p: &&ProfilePoint| (low..high).contains(&p.at.y) && p.tangent.y * up > 0.7;
                points.iter().filter(on_it).collect()
            };
            for wall in [wall(0.25, 0.96, 1.0), wall(0.04, 0.77, -1.0), wall(0.83, 0.97, -1.0)] {
                assert!(!wall.is_empty(), "{rings} rings");
                for point in &wall {
                    assert!(point.tangent.dot(wall[0].tangent) > 0.999, "{rings} rings at {}", point.at);
                }
            }
        }
    }
}
