//! Brute-force particle-mesh collision in the manner of 2007: the baseline that the BVH is measured against.
//!
//! Every tick each particle moves by one explicit Euler step, and the segment it travelled is tested against
//! every triangle of every object, in world space. The test asks three questions, cheapest first: do the old
//! and the new position lie on different sides of the triangle's plane; is the crossing nearer than the
//! nearest found so far; do its barycentric weights lie inside the triangle. The nearest crossing becomes a
//! hit with an interpolated uv, and the particle is gone. Cost: particles x triangles.
//!
//! # What is known of the source, and what is not
//!
//! Hoff 2007, *Interactive weathering of materials*. The text was **not at hand** when this was written and
//! no public copy was found. This is a reconstruction; call it so wherever its figures are quoted.
//!
//! Known, second hand:
//! - particles are emitted and collided with the triangles of the scene;
//! - a hit renders a splat into the texture maps of the object at the hit's uv, wrapping round their edges;
//! - its table counts triangles: ground 1,584, sphere about 936, bunny 1,000, vase about 11,008.
//!
//! Assumed, as a competent CPU implementation of that year would have it:
//! - explicit Euler; gravity and wind are accelerations, the same for all particles;
//! - no spatial hierarchy over the triangles. If the original had one it was faster than this;
//! - the segment-plane test with precomputed edge planes of Ericson 2005, *Real-Time Collision Detection*,
//!   section 5.3.6, here for both faces, as the library it is compared with tests both;
//! - a particle array, the dead compacted away in order; a hit absorbs its particle; one thread, no SIMD.
//!
//! In the baseline's favour: plane normals and edge planes are computed once, the planes lie in an array of
//! their own so that the scan reads 16 bytes a triangle, the uv is interpolated only for the nearest
//! crossing, and a tick allocates nothing. [`HoffReject::BoundingSphere`] skips an object whose sphere the
//! segment misses: the stronger baseline, though it never skips a ground, whose sphere holds the whole
//! scene. Whether the original did this is not known either. Quote both.
//!
//! What it does not do: splatting, moving objects, several threads.

use bevy::math::{Vec2, Vec3};

use crate::scene::Random;

/// Slack of the inside test, in barycentric weight: particles must not slip through the edge between two
/// triangles, whose planes round differently.
const EDGE_SLACK: f32 = 1e-5;

/// Whether whole objects are skipped before their triangles are tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HoffReject {
    /// Every triangle of every object is tested.
    Nothing,
    /// An object is skipped when the segment misses its bounding sphere.
    BoundingSphere,
}

/// Points with `normal . p = offset`.
#[derive(Clone, Copy, Debug)]
struct HoffPlane {
    normal: Vec3,
    offset: f32,
}

impl HoffPlane {
    /// Has every point on its front side: the plane of a triangle without area.
    const NEVER: Self = Self { normal: Vec3::ZERO, offset: -1.0 };

    fn through(point: Vec3, normal: Vec3) -> Self {
        Self { normal, offset: normal.dot(point) }
    }

    /// Signed distance in units of the normal's length.
    #[inline]
    fn distance(&self, point: Vec3) -> f32 {
        self.normal.dot(point) - self.offset
    }

    /// The same plane, scaled so that `distance(unit) == 1`.
    fn scaled_to(self, unit: Vec3) -> Self {
        let scale = self.distance(unit).recip();
        Self { normal: self.normal * scale, offset: self.offset * scale }
    }
}

/// What is needed of a triangle once its plane is crossed.
#[derive(Clone, Copy, Debug)]
pub struct HoffTriangle {
    /// Stands on the edge opposite corner 0; its distance is that corner's barycentric weight.
    weight_0: HoffPlane,
    /// The same for corner 1.
    weight_1: HoffPlane,
    uv: [Vec2; 3],
}

impl HoffTriangle {
    /// The plane of the triangle and the rest.
    fn new([a, b, c]: [Vec3; 3], uv: [Vec2; 3]) -> (HoffPlane, Self) {
        let Some(normal) = (b - a).cross(c - a).try_normalize() else {
            return (HoffPlane::NEVER, Self { weight_0: HoffPlane::NEVER, weight_1: HoffPlane::NEVER, uv });
        };
        let weight_0 = HoffPlane::through(b, normal.cross(c - b)).scaled_to(a);
        let weight_1 = HoffPlane::through(c, normal.cross(a - c)).scaled_to(b);
        (HoffPlane::through(a, normal), Self { weight_0, weight_1, uv })
    }

    /// Barycentric weights of a point in the plane, if it lies inside.
    #[inline]
    fn weights(&self, point: Vec3) -> Option<[f32; 3]> {
        let u = self.weight_0.distance(point);
        if u < -EDGE_SLACK {
            return None;
        }
        let v = self.weight_1.distance(point);
        if v < -EDGE_SLACK || u + v > 1.0 + EDGE_SLACK {
            return None;
        }
        Some([u, v, 1.0 - u - v])
    }
}

/// One mesh in world space.
#[derive(Clone, Debug)]
struct HoffObject {
    /// Parallel to `triangles`; apart, because the scan over all triangles reads nothing else.
    planes: Vec<HoffPlane>,
    triangles: Vec<HoffTriangle>,
    center: Vec3,
    radius_squared: f32,
}

impl HoffObject {
    fn new(corners: &[[Vec3; 3]], uvs: &[[Vec2; 3]]) -> Self {
        assert_eq!(corners.len(), uvs.len(), "an object needs one uv triple for each triangle");
        let (planes, triangles) = corners.iter().zip(uvs).map(|(&c, &uv)| HoffTriangle::new(c, uv)).unzip();
        let points = || corners.iter().flatten();
        let low = points().fold(Vec3::INFINITY, |low, &p| low.min(p));
        let high = points().fold(Vec3::NEG_INFINITY, |high, &p| high.max(p));
        let center = if corners.is_empty() { Vec3::ZERO } else { low.midpoint(high) };
        let radius = points().fold(0.0_f32, |radius, p| radius.max(p.distance(center)));
        // Rounding must not reject what the triangles would accept.
        let radius = radius * 1.0001 + center.abs().max_element() * 1e-6;
        Self { planes, triangles, center, radius_squared: radius * radius }
    }

    /// The nearest crossing before `limit`, a fraction of the segment.
    #[inline]
    fn trace(&self, segment: &Segment, mut limit: f32) -> Option<Crossing> {
        let mut nearest = None;
        for (triangle, plane) in self.planes.iter().enumerate() {
            let before = plane.distance(segment.start);
            let after = plane.distance(segment.end);
            // A point in the plane counts as in front, so that a particle that ends a tick there is not lost.
            if (before >= 0.0) == (after >= 0.0) {
                continue;
            }
            let fraction = before / (before - after);
            if fraction >= limit {
                continue;
            }
            let point = segment.start + segment.travel * fraction;
            if let Some(weights) = self.triangles[triangle].weights(point) {
                limit = fraction;
                nearest = Some(Crossing { fraction, triangle, weights });
            }
        }
        nearest
    }
}

/// What a particle travelled in one tick.
struct Segment {
    start: Vec3,
    end: Vec3,
    travel: Vec3,
    /// 1 / |travel|^2, 0 for a particle at rest.
    inverse_length_squared: f32,
}

impl Segment {
    #[inline]
    fn new(start: Vec3, end: Vec3) -> Self {
        let travel = end - start;
        let length_squared = travel.length_squared();
        let inverse_length_squared = if length_squared > 0.0 { length_squared.recip() } else { 0.0 };
        Self { start, end, travel, inverse_length_squared }
    }

    #[inline]
    fn distance_squared(&self, point: Vec3) -> f32 {
        let to_point = point - self.start;
        let fraction = (to_point.dot(self.travel) * self.inverse_length_squared).clamp(0.0, 1.0);
        (to_point - self.travel * fraction).length_squared()
    }
}

/// Where a segment goes through a triangle.
struct Crossing {
    fraction: f32,
    triangle: usize,
    weights: [f32; 3],
}

/// All triangles, object by object, in world space.
#[derive(Clone, Debug)]
pub struct HoffScene {
    objects: Vec<HoffObject>,
}

impl HoffScene {
    fn nearest_hit(&self, segment: &Segment, reject: HoffReject) -> Option<HoffHit> {
        let mut limit = f32::INFINITY;
        let mut nearest = None;
        for (index, object) in self.objects.iter().enumerate() {
            if reject == HoffReject::BoundingSphere
                && segment.distance_squared(object.center) > object.radius_squared
            {
                continue;
            }
            if let Some(crossing) = object.trace(segment, limit) {
                limit = crossing.fraction;
                nearest = Some((index, crossing));
            }
        }
        nearest.map(|(object, Crossing { fraction, triangle, weights: [u, v, w] })| {
            let uv = &self.objects[object].triangles[triangle].uv;
            HoffHit {
                object,
                triangle,
                point: segment.start + segment.travel * fraction,
                uv: uv[0] * u + uv[1] * v + uv[2] * w,
            }
        })
    }
}

#[derive(Clone, Copy, Debug)]
pub struct HoffParticle {
    /// m, world space.
    pub position: Vec3,
    /// m/s.
    pub velocity: Vec3,
    /// s since emission.
    pub age: f32,
}

/// Where a splat would be painted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoffHit {
    /// Index into the objects given to [`HoffSystem::new`].
    pub object: usize,
    /// Index into the triangles of that object.
    pub triangle: usize,
    /// m, world space.
    pub point: Vec3,
    /// Interpolated from the corners, not wrapped.
    pub uv: Vec2,
}

/// Particles, the scene they meet and the hits of the last tick.
#[derive(Clone, Debug)]
pub struct HoffSystem {
    scene: HoffScene,
    particles: Vec<HoffParticle>,
    hits: Vec<HoffHit>,
    reject: HoffReject,
    /// Acceleration beside gravity, m/s^2.
    pub wind: Vec3,
    /// Age at which a particle that hit nothing is retired, s.
    pub lifetime: f32,
}

impl HoffSystem {
    /// Precomputes the planes of `objects`, lists of world-space triangles in m, with one uv for each corner.
    /// Calm air and endless lifetime until told otherwise.
    ///
    /// # Panics
    /// If `objects` and `uvs` do not have the same shape.
    pub fn new(objects: &[Vec<[Vec3; 3]>], uvs: &[Vec<[Vec2; 3]>], reject: HoffReject) -> Self {
        assert_eq!(objects.len(), uvs.len(), "every object needs its uvs");
        let objects = objects.iter().zip(uvs).map(|(corners, uv)| HoffObject::new(corners, uv)).collect();
        Self {
            scene: HoffScene { objects },
            particles: Vec::new(),
            hits: Vec::new(),
            reject,
            wind: Vec3::ZERO,
            lifetime: f32::INFINITY,
        }
    }

    /// Adds `count` particles; `particle` is called with 0, 1, ... `count - 1`. Memory for the hits of all
    /// living particles is reserved here, so that [`tick`](Self::tick) allocates nothing.
    pub fn emit(&mut self, count: usize, particle: impl FnMut(usize) -> HoffParticle) {
        self.particles.extend((0..count).map(particle));
        self.hits.reserve(self.particles.len().saturating_sub(self.hits.len()));
    }

    /// Moves every particle by `dt` seconds and collides it; returns the number of hits.
    pub fn tick(&mut self, dt: f32, gravity: Vec3) -> usize {
        let Self { scene, particles, hits, reject, wind, lifetime } = self;
        let acceleration = gravity + *wind;
        hits.clear();
        particles.retain_mut(|particle| {
            let start = particle.position;
            particle.position += particle.velocity * dt;
            particle.velocity += acceleration * dt;
            particle.age += dt;
            let hit = scene.nearest_hit(&Segment::new(start, particle.position), *reject);
            hits.extend(hit);
            hit.is_none() && particle.age < *lifetime
        });
        hits.len()
    }

    /// Hits of the last tick, in the order of emission of their particles.
    pub fn hits(&self) -> &[HoffHit] {
        &self.hits
    }

    /// The living, in the order of emission.
    pub fn particles(&self) -> &[HoffParticle] {
        &self.particles
    }

    /// Forgets particles and hits, keeps their memory.
    pub fn clear(&mut self) {
        self.particles.clear();
        self.hits.clear();
    }
}

/// Shows that the baseline is right before it is timed: positions, uvs and the nearest of several hits by
/// hand, then a closed sphere against an independent intersection in float64.
///
/// # Panics
/// If it is wrong.
pub fn check() {
    for reject in [HoffReject::Nothing, HoffReject::BoundingSphere] {
        check_by_hand(reject);
        check_sphere(reject);
    }
}

fn check_by_hand(reject: HoffReject) {
    // Two floors, the upper one second; the triangle has its right angle at the origin of x and z.
    let floor = |y| vec![[Vec3::new(0.0, y, 0.0), Vec3::new(4.0, y, 0.0), Vec3::new(0.0, y, 4.0)]];
    let uvs = || vec![[Vec2::ZERO, Vec2::X, Vec2::Y]];
    let mut system = HoffSystem::new(&[floor(0.0), floor(1.0)], &[uvs(), uvs()], reject);

    let at = |x, y, vy| HoffParticle {
        position: Vec3::new(x, y, 2.0),
        velocity: Vec3::new(0.0, vy, 0.0),
        age: 0.0,
    };
    // Down through both, up through both, outside, and along the upper floor.
    let along = HoffParticle { position: Vec3::new(0.5, 1.0, 2.0), velocity: Vec3::X, age: 0.0 };
    let particles = [at(1.0, 1.5, -4.0), at(1.0, -0.5, 4.0), at(3.0, 1.5, -4.0), along];
    system.emit(4, |i| particles[i]);
    assert_eq!(system.tick(0.5, Vec3::ZERO), 2, "both faces are hit, beside and along them nothing is");
    let hit =
        |object, y| HoffHit { object, triangle: 0, point: Vec3::new(1.0, y, 2.0), uv: Vec2::new(0.25, 0.5) };
    for (got, expected) in system.hits().iter().zip([hit(1, 1.0), hit(0, 0.0)]) {
        assert_eq!((got.object, got.triangle), (expected.object, expected.triangle), "the nearest is kept");
        assert!(got.point.abs_diff_eq(expected.point, 1e-6), "{got:?} instead of {expected:?}");
        assert!(got.uv.abs_diff_eq(expected.uv, 1e-6), "{got:?} instead of {expected:?}");
    }
    assert_eq!(system.particles().len(), 2, "a hit absorbs its particle");

    system.clear();
    system.wind = Vec3::X;
    system.lifetime = 1.5;
    system.emit(1, |_| at(9.0, 9.0, 0.0));
    system.tick(1.0, Vec3::NEG_Y);
    let HoffParticle { position, velocity, .. } = system.particles()[0];
    assert_eq!((position, velocity), (Vec3::new(9.0, 9.0, 2.0), Vec3::new(1.0, -1.0, 0.0)), "explicit Euler");
    system.tick(1.0, Vec3::NEG_Y);
    assert!(system.particles().is_empty(), "the old are retired");
}

/// Shoots at a sphere of 936 triangles from outside, so that every shot hits, and past it.
fn check_sphere(reject: HoffReject) {
    const SLICES: usize = 26;
    const STACKS: usize = 19;
    const SHOTS: usize = 2000;
    let corner = |stack: usize, slice: usize| {
        let (sin, cos) = (std::f32::consts::PI * stack as f32 / STACKS as f32).sin_cos();
        let turn = std::f32::consts::TAU * (slice % SLICES) as f32 / SLICES as f32;
        if stack == STACKS { Vec3::NEG_Y } else { Vec3::new(sin * turn.cos(), cos, sin * turn.sin()) }
    };
    let mut triangles = Vec::new();
    for stack in 0..STACKS {
        for slice in 0..SLICES {
            let [a, b] = [corner(stack, slice), corner(stack, slice + 1)];
            let [c, d] = [corner(stack + 1, slice), corner(stack + 1, slice + 1)];
            if stack > 0 {
                triangles.push([a, b, d]);
            }
            if stack + 1 < STACKS {
                triangles.push([a, d, c]);
            }
        }
    }
    assert_eq!(triangles.len(), 936);
    let uvs = vec![[Vec2::ZERO, Vec2::X, Vec2::Y]; triangles.len()];
    let mut system = HoffSystem::new(std::slice::from_ref(&triangles), &[uvs], reject);

    let mut random = Random::new();
    let shots: Vec<_> = (0..SHOTS)
        .map(|i| {
            let start = random.vector().normalize_or(Vec3::X) * 3.0;
            // The first half aims well inside, the second anywhere, most of it past the sphere.
            let target = random.vector() * if i < SHOTS / 2 { 0.5 } else { 3.0 };
            HoffParticle { position: start, velocity: target - start, age: 0.0 }
        })
        .collect();

    let mut hits = 0;
    for (index, shot) in shots.iter().enumerate() {
        system.clear();
        system.emit(1, |_| *shot);
        system.tick(1.0, Vec3::ZERO);
        let expected = triangles.iter().filter_map(|corners| fraction_of_hit(shot, corners)).reduce(f64::min);
        let travelled = |hit: &HoffHit| hit.point.distance(shot.position) / shot.velocity.length();
        let got = system.hits().first().map(|hit| f64::from(travelled(hit)));
        match (got, expected) {
            (Some(got), Some(expected)) => {
                assert!((got - expected).abs() < 1e-5, "shot {index} hit at {got} instead of {expected}");
                hits += 1;
            }
            (None, None) => assert!(index >= SHOTS / 2, "shot {index} slipped through the closed sphere"),
            _ => panic!("shot {index}: got {got:?}, expected {expected:?}"),
        }
    }
    assert!(hits < SHOTS, "some of the shots have to miss");
}

/// Moller & Trumbore 1997 over the segment `position .. position + velocity`.
fn fraction_of_hit(shot: &HoffParticle, corners: &[Vec3; 3]) -> Option<f64> {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let (start, travel) = (shot.position.as_dvec3(), shot.velocity.as_dvec3());
    let (p, s) = (travel.cross(c - a), start - a);
    let determinant = (b - a).dot(p);
    let q = s.cross(b - a);
    let (u, v) = (s.dot(p) / determinant, travel.dot(q) / determinant);
    let fraction = (c - a).dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..1.0).contains(&fraction)).then_some(fraction)
}
