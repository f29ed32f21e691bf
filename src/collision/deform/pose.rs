//! Posing what has moved, tick by tick.

use bevy::ecs::batching::BatchingStrategy;
use bevy::ecs::query::QueryItem;
use bevy::math::Affine3A;
use bevy::mesh::morph::{MeshMorphWeights, MorphWeights};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::prelude::*;

use super::DeformingCollider;
use crate::clock::WeatheringClock;
use crate::collision::CollisionScene;

type Surface =
    (&'static mut DeformingCollider, Option<&'static SkinnedMesh>, Option<&'static MeshMorphWeights>);
type SurfaceItem<'w, 's> = QueryItem<'w, 's, Surface>;

/// Poses the surfaces whose joints or weights have changed. `update_collision_scene` has to follow: it puts them back into
/// the scene, which forgets them here, so that they can change in place.
pub(in crate::collision) fn pose_surfaces(
    clock: Res<WeatheringClock>,
    mut scene: ResMut<CollisionScene>,
    bind_poses: Res<Assets<SkinnedMeshInverseBindposes>>,
    transforms: Query<&GlobalTransform>,
    shared_weights: Query<&MorphWeights>,
    mut surfaces: Query<Surface>,
) {
    let mut stale = 0;
    for (mut collider, skin, weights) in &mut surfaces {
        let collider = collider.bypass_change_detection();
        let weights: &[f32] = match weights {
            None => &[],
            Some(MeshMorphWeights::Value { weights }) => weights.as_slice(),
            Some(MeshMorphWeights::Reference(entity)) => {
                shared_weights.get(*entity).map_or(&[][..], MorphWeights::weights)
            }
        };
        let changed = match skin.filter(|_| collider.is_skinned()) {
            None => collider.note(std::iter::empty(), weights),
            Some(skin) => {
                // Until they are loaded nobody knows its shape.
                let Some(bind_poses) = bind_poses.get(&skin.inverse_bindposes) else { continue };
                let joint = |(index, &joint): (usize, &Entity)| {
                    // A joint that is missing is the identity, as in Bevy.
                    match (transforms.get(joint), bind_poses.get(index)) {
                        (Ok(world_from_joint), Some(&joint_from_mesh)) => {
                            world_from_joint.affine() * Affine3A::from_mat4(joint_from_mesh)
                        }
                        _ => Affine3A::IDENTITY,
                    }
                };
                collider.note(skin.joints.iter().enumerate().map(joint), weights)
            }
        };
        stale += usize::from(changed);
    }
    if stale == 0 {
        return;
    }
    // Not a change to those who look at what does not deform.
    scene.bypass_change_detection().forget_deforming();
    let tick = clock.tick();
    if stale == 1 {
        surfaces.iter_mut().for_each(|surface| pose_if_stale(surface, tick));
    } else {
        let each = surfaces.par_iter_mut().batching_strategy(BatchingStrategy::fixed(1));
        each.for_each(|surface| pose_if_stale(surface, tick));
    }
}

fn pose_if_stale((mut collider, ..): SurfaceItem, tick: u32) {
    if collider.is_stale() {
        collider.take_pose(tick);
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;
    use std::sync::Arc;

    use bevy::ecs::change_detection::Tick;
    use bevy::mesh::morph::MorphAttributes;
    use bevy::tasks::ComputeTaskPool;

    use super::*;
    use crate::collision::deform::test_bar::{Bar, bent, check_hit, inverse_bind_poses, segment};
    use crate::collision::deform::{Deformer, PosedMesh, attach_deforming};
    use crate::collision::scene::update_collision_scene;
    use crate::collision::{MeshBvh, MeshTriangles, SceneHit, SurfaceCollider};
    use crate::test_random::Random;

    /// A world whose surfaces are followed when its schedule runs.
    struct Stage {
        world: World,
        schedule: Schedule,
    }

    impl Stage {
        fn new() -> Self {
            ComputeTaskPool::get_or_init(default);
            let mut world = World::new();
            world.init_resource::<CollisionScene>();
            world.insert_resource(WeatheringClock::new(60));
            world.init_resource::<Assets<SkinnedMeshInverseBindposes>>();
            let mut schedule = Schedule::default();
            schedule.add_systems((attach_deforming, pose_surfaces, update_collision_scene).chain());
            Self { world, schedule }
        }

        fn run(&mut self) {
            self.schedule.run(&mut self.world);
        }

        fn scene(&self) -> &CollisionScene {
            self.world.resource()
        }

        fn cast(&self, start: Vec3, end: Vec3) -> Option<SceneHit> {
            self.scene().cast(start, end)
        }

        /// A surface that shows this bar, with joints of its own. Its own transform should not matter.
        fn spawn_bar(&mut self, mesh: &Arc<MeshBvh>, joints: [Affine3A; 2]) -> Entity {
            let joints = joints.map(|joint| self.world.spawn(GlobalTransform::from(joint)).id());
            let bind_poses = SkinnedMeshInverseBindposes::from(inverse_bind_poses().to_vec());
            let inverse_bindposes =
                self.world.resource_mut::<Assets<SkinnedMeshInverseBindposes>>().add(bind_poses);
            let skin = SkinnedMesh { inverse_bindposes, joints: joints.to_vec() };
            let elsewhere = GlobalTransform::from_xyz(40.0, -3.0, 7.0);
            self.world.spawn((SurfaceCollider(mesh.clone()), skin, elsewhere)).id()
        }

        fn joints_of(&self, surface: Entity) -> Vec<Entity> {
            self.world.get::<SkinnedMesh>(surface).unwrap().joints.clone()
        }

        fn move_joint(&mut self, joint: Entity, to: Affine3A) {
            *self.world.get_mut::<GlobalTransform>(joint).unwrap() = to.into();
        }

        /// Address of the shape of a surface, and when it changed.
        fn shape(&self, surface: Entity) -> (*const PosedMesh, Tick) {
            let collider = self.world.entity(surface).get_ref::<DeformingCollider>().unwrap();
            (Arc::as_ptr(collider.posed().unwrap()), collider.last_changed())
        }
    }

    fn collider(mesh: &Mesh) -> Arc<MeshBvh> {
        let triangles = MeshTriangles::from_mesh(mesh).unwrap();
        let deformer = Deformer::from_mesh(mesh, &triangles);
        assert!(deformer.is_some());
        Arc::new(MeshBvh::build(triangles).with_deformer(deformer))
    }

    fn straight(start: Vec3) -> [Affine3A; 2] {
        [start, start + Vec3::X].map(Affine3A::from_translation)
    }

    #[test]
    fn a_bent_bar_is_hit_where_brute_force_says() {
        let (bar, mut stage) = (Bar::new(), Stage::new());
        let joints = bent(Vec3::new(0.3, -0.2, 0.1));
        let surface = stage.spawn_bar(&collider(&bar.to_mesh()), joints);
        stage.run();
        let triangles = bar.triangles(&joints);
        let mut random = Random(1);
        let mut hits = 0;
        for _ in 0..10_000 {
            let (start, end) = segment(&mut random, &triangles);
            let hit = stage.cast(start, end);
            assert!(hit.is_none_or(|hit| hit.surface == surface));
            check_hit(&triangles, hit.as_ref(), start, end);
            hits += u32::from(hit.is_some());
        }
        assert!(hits > 1000, "only {hits} hit anything: the comparison means little");
    }

    #[test]
    fn instances_have_poses_of_their_own_and_follow_their_joints() {
        let mut stage = Stage::new();
        let mesh = collider(&Bar::new().to_mesh());
        let up = stage.spawn_bar(&mesh, bent(Vec3::ZERO));
        let along = stage.spawn_bar(&mesh, straight(Vec3::Z * 2.0));
        stage.run();
        // Across the free ends: of the one that points up from x = 1, and of the one that goes on to x = 2.
        let across = |stage: &Stage, middle: Vec3| {
            stage.cast(middle + Vec3::Z * 0.5, middle - Vec3::Z * 0.5).map(|hit| hit.surface)
        };
        let ends = [Vec3::new(1.0, 0.9, 0.0), Vec3::new(1.9, 0.0, 0.0)];
        let at = |stage: &Stage, offset: Vec3| ends.map(|end| across(stage, end + offset));
        assert_eq!(at(&stage, Vec3::ZERO), [Some(up), None]);
        assert_eq!(at(&stage, Vec3::Z * 2.0), [None, Some(along)]);
        // One straightens, one bends the other way.
        let [_, first] = stage.joints_of(up)[..] else { panic!("two joints") };
        stage.move_joint(first, Affine3A::from_translation(Vec3::X));
        let [_, second] = stage.joints_of(along)[..] else { panic!("two joints") };
        let down =
            Affine3A::from_translation(Vec3::new(1.0, 0.0, 2.0)) * Affine3A::from_rotation_z(-FRAC_PI_2);
        stage.move_joint(second, down);
        stage.run();
        assert_eq!(at(&stage, Vec3::ZERO), [None, Some(up)]);
        assert_eq!(at(&stage, Vec3::Z * 2.0), [None, None]);
        assert_eq!(across(&stage, Vec3::new(1.0, -0.9, 2.0)), Some(along));
        // Where its entity is said to be, or where the mesh is at rest, there is nothing.
        assert_eq!(across(&stage, Vec3::new(41.0, -3.0, 7.0)), None);
    }

    #[test]
    fn a_surface_at_rest_is_not_posed_again_and_a_moving_one_keeps_its_memory() {
        let mut stage = Stage::new();
        let mesh = collider(&Bar::new().to_mesh());
        let surfaces = [0.0, 1.0].map(|z| stage.spawn_bar(&mesh, straight(Vec3::Z * z)));
        stage.run();
        let shapes = |stage: &Stage| surfaces.map(|surface| stage.shape(surface));
        let before = shapes(&stage);
        let joints = surfaces.map(|surface| stage.joints_of(surface)[1]);
        // Touched, not moved.
        let same = *stage.world.get::<GlobalTransform>(joints[0]).unwrap();
        *stage.world.get_mut::<GlobalTransform>(joints[0]).unwrap() = same;
        stage.run();
        assert_eq!(shapes(&stage), before);
        // One of the two, then both.
        stage.move_joint(joints[0], Affine3A::from_translation(Vec3::X * 1.1));
        stage.run();
        let after = shapes(&stage);
        assert_ne!(after[0].1, before[0].1);
        assert_eq!(after[1], before[1]);
        for joint in joints {
            stage.move_joint(joint, Affine3A::from_translation(Vec3::X * 1.2));
        }
        stage.run();
        let last = shapes(&stage);
        for surface in 0..2 {
            assert_ne!(last[surface].1, after[surface].1);
            assert_eq!(last[surface].0, before[surface].0, "a new copy of the shape");
        }
    }

    /// A square of 2 m on the ground that its first target raises by a metre and its second doubles along x.
    fn square() -> Arc<MeshBvh> {
        let mut mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
        let moved = |offset| MorphAttributes::new(offset, Vec3::ZERO, Vec3::ZERO);
        let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).unwrap().as_float3().unwrap();
        let raised = positions.iter().map(|_| moved(Vec3::Y));
        let wider = positions.iter().map(|position| moved(Vec3::X * position[0]));
        let targets = raised.chain(wider).collect();
        mesh.set_morph_targets(targets);
        collider(&mesh)
    }

    fn down(stage: &Stage, x: f32) -> Option<SceneHit> {
        stage.cast(Vec3::new(x, 5.0, 0.03), Vec3::new(x, -5.0, 0.03))
    }

    #[test]
    fn morph_targets_move_what_is_hit_in_mesh_space() {
        let mut stage = Stage::new();
        let at = GlobalTransform::from_xyz(10.0, 0.0, 0.0);
        let weights = MeshMorphWeights::Value { weights: vec![0.5, 0.0] };
        let surface = stage.world.spawn((SurfaceCollider(square()), weights, at)).id();
        stage.run();
        let hit = down(&stage, 10.5).unwrap();
        assert!((hit.point.y - 0.5).abs() < 1e-5 && (hit.uv.x - 0.75).abs() < 1e-5, "{hit:?}");
        assert!((hit.uv_per_metre - 0.5).length() < 1e-4, "{hit:?}");
        assert!(down(&stage, 11.5).is_none() && down(&stage, 0.5).is_none());
        let weights = MeshMorphWeights::Value { weights: vec![-1.0, 1.0] };
        stage.world.entity_mut(surface).insert(weights);
        stage.run();
        let hit = down(&stage, 11.5).unwrap();
        assert!((hit.point.y + 1.0).abs() < 1e-5 && (hit.uv.x - 0.875).abs() < 1e-5, "{hit:?}");
        // Twice as wide, so a metre is half as much of the map.
        assert!((hit.uv_per_metre - Vec2::new(0.25, 0.5)).length() < 1e-4, "{hit:?}");
        // Moved as a whole.
        *stage.world.get_mut::<GlobalTransform>(surface).unwrap() =
            GlobalTransform::from_xyz(-10.0, 0.0, 0.0);
        stage.run();
        assert!(down(&stage, 11.5).is_none());
        assert!(down(&stage, -8.5).is_some_and(|hit| (hit.point.y + 1.0).abs() < 1e-5));
    }

    #[test]
    fn places_move_as_fast_as_their_poses_until_these_rest_or_jump() {
        let mut stage = Stage::new();
        let at = GlobalTransform::from_xyz(10.0, 0.0, 0.0);
        let surface = stage
            .world
            .spawn((SurfaceCollider(square()), MeshMorphWeights::Value { weights: vec![0.0] }, at))
            .id();
        // Goes on by so many ticks, with a pose of its own in the last.
        let mut velocity = |ticks: u32, weights: Vec<f32>| {
            for _ in 0..ticks {
                stage.world.resource_mut::<WeatheringClock>().advance();
            }
            stage.world.entity_mut(surface).insert(MeshMorphWeights::Value { weights });
            stage.run();
            let collider = stage.world.get::<DeformingCollider>(surface).unwrap();
            collider.velocity(0, [0.25, 0.5], stage.world.resource())
        };
        let near = |velocity: Vec3, expected: Vec3| {
            assert!(velocity.distance(expected) < 1e-3, "{velocity} {expected}");
        };
        near(velocity(1, vec![0.25, 0.0]), Vec3::ZERO);
        // Frames of two ticks, and a centimetre in each.
        near(velocity(2, vec![0.26, 0.0]), Vec3::Y * 0.3);
        near(velocity(1, vec![0.26, 0.0]), Vec3::Y * 0.3);
        near(velocity(1, vec![0.26, 0.0]), Vec3::ZERO);
        // Frames of a tick again; the first movement after a rest is taken for as slow as it may have been.
        near(velocity(1, vec![0.27, 0.0]), Vec3::Y * 0.2);
        near(velocity(1, vec![0.28, 0.0]), Vec3::Y * 0.6);
        // It jumps, it is no number, and comes back from there.
        near(velocity(1, vec![100.0, 0.0]), Vec3::ZERO);
        near(velocity(1, vec![f32::NAN, 0.0]), Vec3::ZERO);
        near(velocity(1, vec![0.5, 0.0]), Vec3::ZERO);
        near(velocity(1, vec![0.51, 0.0]), Vec3::Y * 0.6);
        // A long rest.
        near(velocity(20, vec![0.52, 0.0]), Vec3::ZERO);
    }

    #[test]
    fn weights_of_another_entity_count_and_rigid_again_is_as_the_mesh() {
        let mut stage = Stage::new();
        let shared = stage.world.spawn(MorphWeights::new(vec![0.25, 0.0], None).unwrap()).id();
        let collider = SurfaceCollider(square());
        let reference = MeshMorphWeights::Reference(shared);
        let surface = stage.world.spawn((collider, reference, GlobalTransform::IDENTITY)).id();
        let height = |stage: &mut Stage| {
            stage.run();
            down(stage, 0.5).unwrap().point.y
        };
        assert!((height(&mut stage) - 0.25).abs() < 1e-5);
        stage.world.get_mut::<MorphWeights>(shared).unwrap().weights_mut()[0] = 0.75;
        assert!((height(&mut stage) - 0.75).abs() < 1e-5);
        stage.world.despawn(shared);
        assert!(height(&mut stage).abs() < 1e-5);
        stage.world.entity_mut(surface).insert(MeshMorphWeights::Value { weights: vec![1.0] });
        assert!((height(&mut stage) - 1.0).abs() < 1e-5);
        stage.world.entity_mut(surface).remove::<MeshMorphWeights>();
        assert!(height(&mut stage).abs() < 1e-5);
        assert!(stage.world.get::<DeformingCollider>(surface).is_none());
    }

    #[test]
    fn poses_that_are_unknown_or_nonsense_hit_nothing() {
        let mut stage = Stage::new();
        let mut bar = Bar::new();
        let mesh = collider(&bar.to_mesh());
        bar.weights.fill([0.0; 4]);
        let limp = stage.spawn_bar(&collider(&bar.to_mesh()), straight(Vec3::ZERO));
        let nan = Affine3A::from_translation(Vec3::NAN);
        stage.spawn_bar(&mesh, [nan; 2]);
        let unknown = stage.spawn_bar(&mesh, straight(Vec3::ZERO));
        stage.world.get_mut::<SkinnedMesh>(unknown).unwrap().inverse_bindposes = Handle::default();
        // The near half of this one is there.
        let half = stage.spawn_bar(&mesh, [Affine3A::IDENTITY, nan]);
        stage.run();
        let across = |stage: &Stage, x: f32| {
            stage.cast(Vec3::new(x, 1.0, 0.03), Vec3::new(x, -1.0, 0.03)).map(|hit| hit.surface)
        };
        assert_eq!(stage.scene().len(), 1);
        assert_eq!([0.52, 1.52].map(|x| across(&stage, x)), [Some(half), None]);
        // A second tick with the same nonsense, and one in which it is whole again.
        stage.run();
        assert_eq!([0.52, 1.52].map(|x| across(&stage, x)), [Some(half), None]);
        let joint = stage.joints_of(half)[1];
        stage.move_joint(joint, Affine3A::from_translation(Vec3::X));
        stage.run();
        assert_eq!([0.52, 1.52].map(|x| across(&stage, x)), [Some(half); 2]);
        assert_eq!(stage.scene().len(), 1);
        let limp = stage.world.get::<DeformingCollider>(limp).unwrap();
        assert_eq!(limp.posed().unwrap().bounds(), None);
        assert!(stage.world.get::<DeformingCollider>(unknown).unwrap().posed().is_none());
    }

    #[test]
    fn what_is_rigid_stays_in_the_scene_unchanged_while_others_move() {
        let mut stage = Stage::new();
        let ground = Arc::new(MeshBvh::build(
            MeshTriangles::from_mesh(&Mesh::from(Plane3d::new(Vec3::Y, Vec2::splat(9.0)))).unwrap(),
        ));
        let ground = stage.world.spawn((SurfaceCollider(ground), GlobalTransform::IDENTITY)).id();
        let bar = stage.spawn_bar(&collider(&Bar::new().to_mesh()), straight(Vec3::Y));
        stage.run();
        let changed =
            |stage: &Stage| stage.world.get_resource_ref::<CollisionScene>().unwrap().last_changed();
        let (joints, before) = (stage.joints_of(bar), changed(&stage));
        let hit = |stage: &Stage| down(stage, 1.5).map(|hit| hit.surface);
        assert_eq!(hit(&stage), Some(bar));
        // The far half goes up, below the ground, and in between.
        for (height, expected) in [(3.0, bar), (-2.0, ground), (0.5, bar)] {
            stage.move_joint(joints[1], Affine3A::from_translation(Vec3::new(1.0, height, 0.0)));
            stage.run();
            assert_eq!(hit(&stage), Some(expected));
        }
        assert_eq!(changed(&stage), before);
        stage.world.entity_mut(ground).insert(GlobalTransform::from_xyz(0.0, 2.0, 0.0));
        stage.run();
        assert_eq!(hit(&stage), Some(ground));
        assert_ne!(changed(&stage), before);
    }
}
