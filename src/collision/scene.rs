//! All surfaces with their transforms, under two BVHs: one over those that are rigid, one over those that deform.
//!
//! What deforms moves in most frames. It has a part of its own, so that the rest need not be put together anew.

use bevy::math::{Affine3A, Vec3A};
use bevy::prelude::*;

use super::bvh::{BoxBvh, Segment};
use super::triangles::FARTHEST;
use super::{DeformingCollider, LocalHit, Shape, SurfaceCollider};

/// Every surface that can be hit, where it is now. Its change detection is about the rigid ones.
#[derive(Resource, Default)]
pub struct CollisionScene {
    rigid: Part,
    deforming: Part,
}

/// Some of the surfaces, under one BVH.
struct Part {
    instances: Vec<Instance>,
    top: BoxBvh,
    bounds: (Vec3, Vec3),
}

#[derive(Clone)]
struct Instance {
    surface: Entity,
    world_from_mesh: Affine3A,
    mesh_from_world: Affine3A,
    shape: Shape,
}

/// The closest hit of a segment in the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneHit {
    /// The surface.
    pub surface: Entity,
    /// 0 at the start of the segment, 1 at its end.
    pub fraction: f32,
    /// Triangle of the surface's mesh, in the mesh's order.
    pub triangle: u32,
    /// World space, metres.
    pub point: Vec3,
    /// Unit normal of the triangle on the side the segment came from; world space.
    pub normal: Vec3,
    /// Texture coordinates of the point.
    pub uv: Vec2,
    /// Change of u and v for one metre on the surface along their own directions. 0 where uv does not vary.
    pub uv_per_metre: Vec2,
    /// Unit directions on the surface in which u and v grow; world space, 0 where they do not.
    pub along: [Vec3; 2],
    /// It was hit from behind: where its corners go round clockwise.
    pub back: bool,
}

impl CollisionScene {
    /// A scene of these surfaces. Order matters for nothing but ties. What cannot be inverted (a scale of 0), is not
    /// finite, is farther than 1e9 m from the origin, or has nothing that can be hit is left out.
    pub fn new<S: Into<Shape>>(surfaces: impl IntoIterator<Item = (Entity, Affine3A, S)>) -> Self {
        let surfaces = surfaces.into_iter().map(|(surface, at, shape)| (surface, at, shape.into()));
        let (deforming, rigid): (Vec<_>, Vec<_>) =
            surfaces.partition(|(.., shape)| matches!(shape, Shape::Deforming(_)));
        Self { rigid: Part::new(rigid), deforming: Part::new(deforming) }
    }

    /// Number of surfaces.
    pub fn len(&self) -> usize {
        self.rigid.instances.len() + self.deforming.instances.len()
    }

    /// Whether there is nothing to hit.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Smallest and largest corner of everything that can be hit; infinite, the wrong way round, if there is nothing.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let ((low, high), (other_low, other_high)) = (self.rigid.bounds, self.deforming.bounds);
        (low.min(other_low), high.max(other_high))
    }

    /// Few boxes that together hold everything that can be hit: the surfaces', if there are few.
    pub(super) fn first_boxes(&self) -> impl Iterator<Item = (Vec3, Vec3)> {
        self.rigid.top.first_boxes().chain(self.deforming.top.first_boxes())
    }

    /// The closest hit on the segment from `start` to `end`, seen from either side.
    #[inline]
    pub fn cast(&self, start: Vec3, end: Vec3) -> Option<SceneHit> {
        // Most particles are in the air: this is all they cost.
        let (from, to) = (Vec3A::from(start), Vec3A::from(end));
        let rigid = segment_near_box(from, to, self.rigid.bounds);
        let deforming = segment_near_box(from, to, self.deforming.bounds);
        if !(rigid || deforming) {
            return None;
        }
        self.cast_near(start, end, rigid, deforming)
    }

    /// The closest hit on one surface, whatever lies before it.
    pub fn cast_on(&self, surface: Entity, start: Vec3, end: Vec3) -> Option<SceneHit> {
        let segment = Segment::new(start, end)?;
        let is_it = |instance: &Instance| instance.surface == surface;
        let mut closest: Option<(&Instance, LocalHit)> = None;
        for part in [&self.rigid, &self.deforming] {
            let within = closest.map_or(1.0, |(_, hit)| hit.fraction);
            closest = part.cast(segment, start, end, within, is_it).or(closest);
        }
        let (instance, hit) = closest?;
        Some(instance.resolve(start, end, hit))
    }

    /// Lets go of the surfaces that deform, so that their shapes can change in place.
    pub(super) fn forget_deforming(&mut self) {
        self.deforming = Part::default();
    }

    fn cast_near(&self, start: Vec3, end: Vec3, rigid: bool, deforming: bool) -> Option<SceneHit> {
        let segment = Segment::new(start, end)?;
        let mut closest: Option<(&Instance, LocalHit)> = None;
        for (part, is_near) in [(&self.rigid, rigid), (&self.deforming, deforming)] {
            if is_near {
                let within = closest.map_or(1.0, |(_, hit)| hit.fraction);
                closest = part.cast(segment, start, end, within, |_| true).or(closest);
            }
        }
        let (instance, hit) = closest?;
        Some(instance.resolve(start, end, hit))
    }
}

impl Default for Part {
    fn default() -> Self {
        Self::new(Vec::new())
    }
}

impl Part {
    fn new(surfaces: Vec<(Entity, Affine3A, Shape)>) -> Self {
        let (mut instances, mut boxes) = (Vec::new(), Vec::new());
        for (surface, world_from_mesh, shape) in surfaces {
            let volume = world_from_mesh.matrix3.determinant();
            let is_placed = world_from_mesh.is_finite() && volume.is_finite() && volume != 0.0;
            let bounds = shape.bounds().map(|bounds| bounds_in_world(bounds, &world_from_mesh));
            // Boxes whose areas overflow make no tree.
            let is_near = |(low, high): &(Vec3, Vec3)| low.abs().max(high.abs()).max_element() <= FARTHEST;
            if let Some(bounds) = bounds.filter(is_near)
                && is_placed
            {
                boxes.push(bounds);
                let mesh_from_world = world_from_mesh.inverse();
                instances.push(Instance { surface, world_from_mesh, mesh_from_world, shape });
            }
        }
        let top = BoxBvh::build(&boxes);
        let bounds = top.bounds();
        Self { instances, top, bounds }
    }

    /// The closest hit on this fraction of the segment, on those that are meant.
    fn cast(
        &self,
        segment: Segment,
        start: Vec3,
        end: Vec3,
        within: f32,
        is_meant: impl Fn(&Instance) -> bool,
    ) -> Option<(&Instance, LocalHit)> {
        let mut closest: Option<(&Instance, LocalHit)> = None;
        self.top.visit(segment, |index, fraction| {
            let instance = &self.instances[index as usize];
            if !is_meant(instance) {
                return None;
            }
            let to_mesh = |point| instance.mesh_from_world.transform_point3(point);
            let segment = Segment::new(to_mesh(start), to_mesh(end))?;
            let hit = instance.shape.cast_within(segment, fraction.min(within))?;
            closest = Some((instance, hit));
            Some(hit.fraction)
        });
        closest
    }
}

/// Box around the eight corners of a mesh's box, in world space.
fn bounds_in_world((min, max): (Vec3, Vec3), world_from_mesh: &Affine3A) -> (Vec3, Vec3) {
    let corner = |i: u32| {
        let pick = |axis: u32, low: f32, high: f32| if i >> axis & 1 == 0 { low } else { high };
        let corner = Vec3::new(pick(0, min.x, max.x), pick(1, min.y, max.y), pick(2, min.z, max.z));
        world_from_mesh.transform_point3(corner)
    };
    (0..8)
        .map(corner)
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), corner| (low.min(corner), high.max(corner)))
}

impl Instance {
    /// Point, normal and uv of a hit.
    fn resolve(&self, start: Vec3, end: Vec3, hit: LocalHit) -> SceneHit {
        let triangles = self.shape.triangles();
        let index = hit.triangle as usize;
        let [a, b, c] = self.shape.corners(index).map(|corner| self.world_from_mesh.transform_point3(corner));
        let [uv_a, uv_b, uv_c] = triangles.uvs[index];
        let point = start.lerp(end, hit.fraction);
        let (ab, ac) = (b - a, c - a);
        let cross = ab.cross(ac);
        let twice_area_squared = cross.length_squared();
        // Barycentric coordinates as ratios of areas; clamped, since the point is only as good as its fraction.
        let weight_b = (point - a).cross(ac).dot(cross) / twice_area_squared;
        let weight_c = ab.cross(point - a).dot(cross) / twice_area_squared;
        let (weight_b, weight_c) = (weight_b.clamp(0.0, 1.0), weight_c.clamp(0.0, 1.0));
        let facing = cross.normalize_or(Vec3::Y);
        let (uv_per_metre, along) = uv_directions([ab, ac], [uv_b - uv_a, uv_c - uv_a]);
        // A mirror turns the winding round, but not the side that is the front.
        let behind = facing.dot(end - start) > 0.0;
        let mirrored = self.world_from_mesh.matrix3.determinant() < 0.0;
        SceneHit {
            surface: self.surface,
            fraction: hit.fraction,
            triangle: triangles.source[index],
            point,
            normal: if behind { -facing } else { facing },
            uv: uv_a + (uv_b - uv_a) * weight_b + (uv_c - uv_a) * weight_c,
            uv_per_metre,
            along,
            back: behind != mirrored,
        }
    }
}

/// How fast u and v change along a triangle with these two edges, in space and in uv, 1/|dP/du| and 1/|dP/dv|; and the unit
/// directions in which they grow.
fn uv_directions([ab, ac]: [Vec3; 2], [uv_ab, uv_ac]: [Vec2; 2]) -> (Vec2, [Vec3; 2]) {
    let area = uv_ab.perp_dot(uv_ac);
    let along_u = (ab * uv_ac.y - ac * uv_ab.y) * area.signum();
    let along_v = (ac * uv_ab.x - ab * uv_ac.x) * area.signum();
    let ratio = |length: f32| if length > 0.0 { (area / length).abs() } else { 0.0 };
    let per_metre = Vec2::new(ratio(along_u.length()), ratio(along_v.length()));
    (per_metre, [along_u.normalize_or_zero(), along_v.normalize_or_zero()])
}

/// Whether the box around the segment touches the box. Never false for a segment that does.
#[inline]
fn segment_near_box(start: Vec3A, end: Vec3A, (min, max): (Vec3, Vec3)) -> bool {
    (start.min(end).cmple(max.into()) & start.max(end).cmpge(min.into())).all()
}

/// Follows surfaces that appear, move, deform or go. Costs nothing while none does.
pub(super) fn update_collision_scene(
    mut scene: ResMut<CollisionScene>,
    rigid: Query<(Entity, &GlobalTransform, &SurfaceCollider), Without<DeformingCollider>>,
    deforming: Query<(Entity, &GlobalTransform, &DeformingCollider), With<SurfaceCollider>>,
    moved: Query<
        (),
        (
            With<SurfaceCollider>,
            Without<DeformingCollider>,
            Or<(Changed<GlobalTransform>, Changed<SurfaceCollider>)>,
        ),
    >,
    deformed: Query<
        (),
        (
            With<SurfaceCollider>,
            With<DeformingCollider>,
            Or<(Changed<GlobalTransform>, Changed<DeformingCollider>)>,
        ),
    >,
    joined: Query<(), (With<SurfaceCollider>, Added<DeformingCollider>)>,
    mut known: Local<[usize; 2]>,
) {
    // By number, because news of a removal last two frames, and frames without a tick come in any number. Who comes in
    // place of who went has changed.
    let count = [rigid.iter().len(), deforming.iter().len()];
    let others = count != *known || !joined.is_empty();
    *known = count;
    if others || !moved.is_empty() {
        let mut surfaces: Vec<_> = rigid
            .iter()
            .map(|(entity, transform, collider)| {
                (entity, transform.affine(), Shape::from(collider.0.clone()))
            })
            .collect();
        surfaces.sort_unstable_by_key(|(entity, ..)| *entity);
        scene.rigid = Part::new(surfaces);
    }
    if others || !deformed.is_empty() {
        let placed = |(entity, transform, collider): (Entity, &GlobalTransform, &DeformingCollider)| {
            let (at, posed) = collider.placed(transform)?;
            Some((entity, at, Shape::from(posed)))
        };
        let mut surfaces: Vec<_> = deforming.iter().filter_map(placed).collect();
        surfaces.sort_unstable_by_key(|(entity, ..)| *entity);
        // Nothing that is rigid has changed.
        scene.bypass_change_detection().deforming = Part::new(surfaces);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bevy::math::Quat;

    use super::*;
    use crate::collision::{MeshBvh, MeshTriangles};

    fn square() -> Arc<MeshBvh> {
        let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
        Arc::new(MeshBvh::build(MeshTriangles::from_mesh(&mesh).unwrap()))
    }

    #[test]
    fn scaled_turned_and_mirrored_instances_are_hit_where_they_are() {
        let turned = Affine3A::from_scale_rotation_translation(
            Vec3::new(3.0, 1.0, -0.5),
            Quat::from_rotation_z(std::f32::consts::FRAC_PI_2),
            Vec3::new(5.0, 0.0, 0.0),
        );
        let upright = Entity::from_raw_u32(2).unwrap();
        let flat = Entity::from_raw_u32(1).unwrap();
        let scene = CollisionScene::new([(flat, Affine3A::IDENTITY, square()), (upright, turned, square())]);
        // The square stands at x = 5 now, 3 m up and down and half a metre to the sides.
        let hit = scene.cast(Vec3::new(4.0, 2.9, 0.4), Vec3::new(6.0, 2.9, 0.4)).unwrap();
        assert_eq!(hit.surface, upright);
        assert!((hit.fraction - 0.5).abs() < 1e-5 && (hit.point.x - 5.0).abs() < 1e-5, "{hit:?}");
        assert!((hit.normal - Vec3::NEG_X).length() < 1e-5);
        assert!((hit.uv_per_metre - Vec2::new(0.5 / 3.0, 1.0)).length() < 1e-4, "{}", hit.uv_per_metre);
        assert!(scene.cast(Vec3::new(4.0, 2.9, 0.6), Vec3::new(6.0, 2.9, 0.6)).is_none());
    }

    #[test]
    fn the_closer_of_two_surfaces_is_hit() {
        let raised = Affine3A::from_translation(Vec3::Y * 0.5);
        let ids = [1, 2].map(|id| Entity::from_raw_u32(id).unwrap());
        let scene = CollisionScene::new([(ids[0], Affine3A::IDENTITY, square()), (ids[1], raised, square())]);
        let cast = |from: f32, to: f32| scene.cast(Vec3::Y * from, Vec3::Y * to).map(|hit| hit.surface);
        assert_eq!(cast(1.0, -1.0), Some(ids[1]));
        assert_eq!(cast(-1.0, 1.0), Some(ids[0]));
        assert_eq!(cast(0.4, 0.1), None);
        // The one that is asked for, from either side.
        let cast_on =
            |id, from: f32, to: f32| scene.cast_on(id, Vec3::Y * from, Vec3::Y * to).map(|hit| hit.surface);
        assert_eq!(cast_on(ids[0], 1.0, -1.0), Some(ids[0]));
        assert_eq!(cast_on(ids[1], -1.0, 1.0), Some(ids[1]));
        assert_eq!(cast_on(ids[0], 1.0, 0.1), None);
        assert_eq!(cast_on(Entity::from_raw_u32(3).unwrap(), 1.0, -1.0), None);
        assert_eq!(cast_on(ids[0], f32::NAN, -1.0), None);
    }

    #[test]
    fn what_cannot_be_inverted_is_left_out_and_nonsense_hits_nothing() {
        let id = Entity::from_raw_u32(1).unwrap();
        let flat = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
        let nan = Affine3A::from_translation(Vec3::NAN);
        assert!(CollisionScene::new([(id, flat, square()), (id, nan, square())]).is_empty());
        let scene = CollisionScene::new([(id, Affine3A::IDENTITY, square())]);
        assert!(scene.cast(Vec3::NAN, Vec3::NEG_Y).is_none());
        assert!(scene.cast(Vec3::ZERO, Vec3::ZERO).is_none());
        assert!(scene.cast(Vec3::Y, Vec3::NEG_Y * f32::INFINITY).is_none());
        assert!(CollisionScene::default().cast(Vec3::Y, Vec3::NEG_Y).is_none());
    }

    #[test]
    fn the_scene_follows_its_surfaces() {
        let mut world = World::new();
        world.init_resource::<CollisionScene>();
        let mut schedule = Schedule::default();
        schedule.add_systems(update_collision_scene);
        let surface = world.spawn((GlobalTransform::default(), SurfaceCollider(square()))).id();
        let mut hits_at = |world: &mut World, height: f32| {
            schedule.run(world);
            let (above, below) = (Vec3::Y * (height + 0.1), Vec3::Y * (height - 0.1));
            world.resource::<CollisionScene>().cast(above, below).is_some()
        };
        assert!(hits_at(&mut world, 0.0));
        *world.get_mut::<GlobalTransform>(surface).unwrap() = GlobalTransform::from_xyz(0.0, 3.0, 0.0);
        assert!(!hits_at(&mut world, 0.0));
        assert!(hits_at(&mut world, 3.0));
        world.despawn(surface);
        // Frames without a tick.
        for _ in 0..5 {
            world.clear_trackers();
        }
        assert!(!hits_at(&mut world, 3.0));
    }
}
