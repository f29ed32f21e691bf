//! How much what a picture shows on the one side of an edge of a mesh differs from what it shows on the other.
//!
//! Every edge whose two triangles face the eye is looked at in a few points, unless something hides them: a little to either side,
//! as far from it on both, and on the edge itself. What is laid on a surface varies, so both sides differ at any edge, and
//! more where the surface is folded. So borders of uv islands are compared with edges that are none and are folded as much: a seam
//! is to be seen where they differ by more than those do.
//!
//! Not here: lines narrower than a pixel, and edges that the eye sees under less than a quarter of a right angle.

use std::f32::consts::TAU;

use bevy::prelude::*;
use bevy_weathering::collision::{MeshBvh, MeshTriangles};
use image::RgbImage;

use crate::seams::{Border, edges, is_seam};

/// Pixels along each side of a picture.
pub const SIDE: u32 = 512;

/// What a picture shows, along each side, metres: all of the bunny, seen from anywhere.
pub const SPAN: f32 = 1.4;

/// Metres from the middle of the mesh to the eye; as far behind it nothing is seen any more.
pub const DISTANCE: f32 = 2.0;

/// Width of a pixel, metres.
const PIXEL: f32 = SPAN / SIDE as f32;

/// How far from the edge, pixels of a surface that squarely faces the eye. As far on both sides.
const ASIDE: f32 = 2.5;

/// The same at most, in parts of the height of the lower of both triangles above the edge.
const MOST_OF_HEIGHT: f32 = 0.6;

/// Cosine of the angle between the normal of a triangle and the way to the eye from which on it is looked at.
const LEAST_FACING: f32 = 0.4;

/// Where along an edge it is looked at, from the one end to the other.
const PARTS: [f32; 3] = [0.25, 0.5, 0.75];

/// How much nearer or farther the surface may be than a place, metres: beside a skewed triangle the place is a little off it.
const SAME_DEPTH: f32 = 0.003;

/// How much nearer or farther the surface may be a pixel away, metres: more is another part of it.
const MOST_DEPTH: f32 = 0.012;

/// Edges that a point of a seam is compared with: those with the nearest folds.
const LIKE_IT: usize = 5;

/// The part of all differences that is below a high one.
const HIGH: f32 = 0.95;

/// Eyes all around the middle of a mesh: five from above, five from below between these, one straight from each.
pub fn views(middle: Vec3) -> Vec<Transform> {
    let ring = |height: f32, turn: f32| {
        (0u8..5).map(move |step| {
            let angle = TAU * (f32::from(step) + turn) / 5.0;
            Vec3::new(angle.cos(), height, angle.sin()).normalize()
        })
    };
    let around = ring(0.5, 0.0).chain(ring(-0.5, 0.5)).map(|towards| (towards, Vec3::Y));
    around
        .chain([(Vec3::Y, Vec3::Z), (Vec3::NEG_Y, Vec3::Z)])
        .map(|(towards, up)| Transform::from_translation(middle + towards * DISTANCE).looking_at(middle, up))
        .collect()
}

/// An edge and the triangles on both sides of it.
struct Edge {
    normals: [Vec3; 2],
    ends: [Vec3; 2],
    /// From the edge to where it is looked at, square to it, in the plane of each triangle.
    aside: [Vec3; 2],
    is_seam: bool,
}

impl Edge {
    fn new(sides: &[Border; 2], triangles: &MeshTriangles) -> Self {
        let ends = sides[0].in_space;
        let numbers = [sides[0].triangle, sides[1].triangle];
        let corners = numbers.map(|triangle| triangles.positions[triangle]);
        let normals = corners.map(|[a, b, c]| (b - a).cross(c - a).normalize());
        // Of the third corner: the others lie on the edge.
        let heights = corners.map(|corners| {
            let ways = corners.map(|corner| (corner - ends[0]).reject_from(ends[1] - ends[0]));
            ways.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared())).unwrap()
        });
        let far = (ASIDE * PIXEL).min(MOST_OF_HEIGHT * heights[0].length().min(heights[1].length()));
        let aside = heights.map(|height| height.normalize() * far);
        Self { normals, ends, aside, is_seam: is_seam(sides) }
    }

    /// Radians; 0 if both triangles lie in a plane.
    fn fold(&self) -> f32 {
        self.normals[0].angle_between(self.normals[1])
    }
}

/// A point of an edge in a picture.
struct Glance {
    /// Number of the picture.
    view: usize,
    fold: f32,
    is_seam: bool,
    /// Pixels: on the edge, and to either side of it.
    edge: Vec2,
    sides: [Vec2; 2],
}

/// What can be seen of the edges of a mesh.
pub struct Sight {
    glances: Vec<Glance>,
    /// Seams, and those that no eye sees.
    pub seams: usize,
    pub unseen: usize,
}

impl Sight {
    /// Of a mesh around which these eyes stand.
    pub fn new(triangles: &MeshTriangles, views: &[Transform]) -> Self {
        let edges: Vec<Edge> = edges(triangles).iter().map(|sides| Edge::new(sides, triangles)).collect();
        let mesh = MeshBvh::build(triangles.clone());
        let mut is_seen = vec![false; edges.len()];
        let mut glances = Vec::new();
        for (view, eye) in views.iter().enumerate() {
            for (edge, is_seen) in edges.iter().zip(&mut is_seen) {
                let back = *eye.back();
                if edge.normals.iter().any(|normal| normal.dot(back) < LEAST_FACING) {
                    continue;
                }
                for part in PARTS {
                    let at = edge.ends[0].lerp(edge.ends[1], part);
                    let sides = edge.aside.map(|aside| at + aside);
                    if sides.iter().all(|&side| is_shown(&mesh, eye, side)) {
                        let (edge_at, sides) = (pixel(eye, at), sides.map(|side| pixel(eye, side)));
                        let (fold, is_seam) = (edge.fold(), edge.is_seam);
                        glances.push(Glance { view, fold, is_seam, edge: edge_at, sides });
                        *is_seen = true;
                    }
                }
            }
        }
        let seams = edges.iter().filter(|edge| edge.is_seam).count();
        let unseen = edges.iter().zip(&is_seen).filter(|(edge, is_seen)| edge.is_seam && !**is_seen).count();
        Self { glances, seams, unseen }
    }

    /// What pictures from all eyes show, in their order.
    pub fn compare(&self, pictures: &[RgbImage]) -> Comparison {
        let (mut seams, mut others) = (Vec::new(), Vec::new());
        for glance in &self.glances {
            let picture = &pictures[glance.view];
            let [one, other] = glance.sides.map(|side| brightness(picture, side));
            let apart = (one - other).abs();
            let line = (brightness(picture, glance.edge) - 0.5 * (one + other)).abs();
            let of = if glance.is_seam { &mut seams } else { &mut others };
            of.push(Difference { fold: glance.fold, apart, line });
        }
        others.sort_by(|a, b| a.fold.total_cmp(&b.fold));
        assert!(others.len() >= LIKE_IT, "only {} points of edges are to be seen", others.len());
        let like_seams = seams.iter().flat_map(|seam| {
            let behind = others.partition_point(|other| other.fold < seam.fold);
            let first = behind.saturating_sub(LIKE_IT / 2).min(others.len() - LIKE_IT);
            others[first..first + LIKE_IT].iter().copied()
        });
        let others = Differences::of(&like_seams.collect::<Vec<_>>());
        Comparison { points: seams.len(), seams: Differences::of(&seams), others }
    }

    /// The same pictures with a hair along each seam, a pixel wide and darker by so much where it is looked at.
    pub fn with_hairs(&self, pictures: &[RgbImage], darker: u8) -> Vec<RgbImage> {
        let mut pictures = pictures.to_vec();
        for glance in self.glances.iter().filter(|glance| glance.is_seam) {
            let (x, y) = (glance.edge.x as u32, glance.edge.y as u32);
            let pixel = &mut pictures[glance.view][(x, y)].0;
            *pixel = (*pixel).map(|channel| channel.saturating_sub(darker));
        }
        pictures
    }
}

/// Whether an eye sees the surface at a place of it, and nothing much nearer or farther a pixel beside that.
fn is_shown(mesh: &MeshBvh, eye: &Transform, place: Vec3) -> bool {
    let (right, up, back) = (*eye.right() * PIXEL, *eye.up() * PIXEL, *eye.back() * DISTANCE);
    let shows = |beside: Vec3, depth: f32| {
        let hit = mesh.cast(place + beside + back, place + beside - back);
        hit.is_some_and(|hit| (2.0 * hit.fraction - 1.0).abs() * DISTANCE < depth)
    };
    let corners = [right + up, right - up, -right + up, -right - up];
    shows(Vec3::ZERO, SAME_DEPTH) && corners.into_iter().all(|beside| shows(beside, MOST_DEPTH))
}

/// Where in its picture an eye sees a place, pixels from the upper left corner.
fn pixel(eye: &Transform, place: Vec3) -> Vec2 {
    let from_eye = place - eye.translation;
    Vec2::new(from_eye.dot(*eye.right()), -from_eye.dot(*eye.up())) / PIXEL + 0.5 * SIDE as f32
}

/// Mean of the channels between pixels, 0..=255.
fn brightness(picture: &RgbImage, at: Vec2) -> f32 {
    let corner = (at - 0.5).floor();
    let part = at - 0.5 - corner;
    let of = |x: f32, y: f32| {
        let [x, y] = [corner.x + x, corner.y + y].map(|along| along.clamp(0.0, (SIDE - 1) as f32) as u32);
        picture[(x, y)].0.map(f32::from).into_iter().sum::<f32>() / 3.0
    };
    let row = |y: f32| of(0.0, y) + (of(1.0, y) - of(0.0, y)) * part.x;
    row(0.0) + (row(1.0) - row(0.0)) * part.y
}

/// What is seen at a point of an edge.
#[derive(Clone, Copy)]
struct Difference {
    fold: f32,
    /// Of the one side from the other, of 255.
    apart: f32,
    /// Of the edge from the mean of its sides, of 255.
    line: f32,
}

/// Differences at many points, of 255.
#[derive(Debug, Clone, Copy)]
pub struct Differences {
    /// Of the one side from the other.
    pub apart: Measure,
    /// Of the edge from the mean of its sides.
    pub line: Measure,
}

/// Mean, and what all but one of twenty are below; of 255.
#[derive(Debug, Clone, Copy)]
pub struct Measure {
    pub mean: f32,
    pub high: f32,
}

impl Differences {
    fn of(points: &[Difference]) -> Self {
        let measure = |value: fn(&Difference) -> f32| {
            let mut values: Vec<f32> = points.iter().map(value).collect();
            values.sort_by(f32::total_cmp);
            let mean = values.iter().sum::<f32>() / values.len().max(1) as f32;
            let high = (values.len() as f32 * HIGH) as usize;
            Measure { mean, high: values.get(high).copied().unwrap_or_default() }
        };
        Self { apart: measure(|point| point.apart), line: measure(|point| point.line) }
    }
}

/// Seams, and other edges that are folded as they are.
#[derive(Debug, Clone, Copy)]
pub struct Comparison {
    /// Points of seams that were looked at.
    pub points: usize,
    pub seams: Differences,
    pub others: Differences,
}

impl Comparison {
    /// By how much more seams differ than other edges; below 0 where they differ by less.
    pub fn beyond_others(&self) -> Differences {
        let beyond = |seams: Measure, others: Measure| Measure {
            mean: seams.mean - others.mean,
            high: seams.high - others.high,
        };
        Differences {
            apart: beyond(self.seams.apart, self.others.apart),
            line: beyond(self.seams.line, self.others.line),
        }
    }
}

impl Measure {
    /// Whether it is no more than another, in the mean and when high.
    pub fn is_within(self, most: Self) -> bool {
        self.mean <= most.mean && self.high <= most.high
    }

    /// Whether it is more than so many times another, in the mean and when high.
    pub fn exceeds(self, times: f32, other: Self) -> bool {
        self.mean > times * other.mean && self.high > times * other.high
    }
}
