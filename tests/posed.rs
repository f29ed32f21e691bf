//! Surfaces that are posed, in whole apps without a renderer: where marks land and stay, where water runs and drips.

use std::f32::consts::FRAC_PI_2;
use std::time::Duration;

use bevy::asset::RenderAssetUsages;
use bevy::mesh::morph::{MeshMorphWeights, MorphAttributes};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use bevy_weathering::effect::Paint;
use bevy_weathering::overlay::{CpuMaps, SurfaceFrames};
use bevy_weathering::particle::Particles;
use bevy_weathering::prelude::*;
use bevy_weathering::wetting::{Exposure, Ledger, MeasureTiming, SurfaceWater, WetGeometry};

use crate::wetting::scene::Scene;

/// Texels along each side.
const SIZE: u32 = 256;
/// Of a mark, metres.
const RADIUS: f32 = 0.08;

/// Quads along and across a plank.
const CELLS: [u16; 2] = [40, 8];

/// A plank from 0 to 2 along x, 0.4 m wide, that faces up. u grows along x, v along z. Its second joint sits at x = 1 and bends
/// 0.4 m of it.
pub fn plank() -> Mesh {
    let [long, wide] = CELLS;
    let (mut positions, mut uvs, mut weights, mut indices) = (vec![], vec![], vec![], vec![]);
    for column in 0..=long {
        for row in 0..=wide {
            let uv = Vec2::new(f32::from(column) / f32::from(long), f32::from(row) / f32::from(wide));
            positions.push(at_rest(uv).to_array());
            uvs.push(uv.to_array());
            weights.push([1.0 - second_weight(uv), second_weight(uv), 0.0, 0.0]);
            if column < long && row < wide {
                let [here, along] = [column, column + 1].map(|column| column * (wide + 1) + row);
                indices.extend([here, here + 1, along, along, here + 1, along + 1]);
            }
        }
    }
    let joints = VertexAttributeValues::Uint16x4(vec![[0, 1, 0, 0]; positions.len()]);
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs)
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_INDEX, joints)
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, weights)
        .with_inserted_indices(Indices::U16(indices))
}

fn at_rest(uv: Vec2) -> Vec3 {
    Vec3::new(2.0 * uv.x, 0.0, 0.4 * (uv.y - 0.5))
}

fn second_weight(uv: Vec2) -> f32 {
    ((2.0 * uv.x - 0.8) / 0.4).clamp(0.0, 1.0)
}

/// Where a point of the plank is, with its first joint where `root` is and the second turned like this.
pub fn posed(uv: Vec2, [root, second]: [Transform; 2]) -> Vec3 {
    let (rest, weight) = (at_rest(uv), second_weight(uv));
    root.transform_point(rest) * (1.0 - weight) + second.transform_point(rest - Vec3::X) * weight
}

/// Joints of a plank that begins at `root` and hangs straight down from its middle on.
pub fn hanging(root: Vec3) -> [Transform; 2] {
    let second = Transform::from_translation(root + Vec3::X);
    [Transform::from_translation(root), second.with_rotation(Quat::from_rotation_z(-FRAC_PI_2))]
}

fn straight(root: Vec3) -> [Transform; 2] {
    [root, root + Vec3::X].map(Transform::from_translation)
}

/// Gives a surface joints, which it follows from now on.
pub fn skin(scene: &mut Scene, surface: Entity, joints: [Transform; 2]) -> [Entity; 2] {
    let world = scene.0.world_mut();
    let entities = joints.map(|joint| world.spawn((joint, GlobalTransform::from(joint))).id());
    let bind_poses = vec![Mat4::IDENTITY, Mat4::from_translation(Vec3::NEG_X)];
    let inverse_bindposes = world.resource_mut::<Assets<SkinnedMeshInverseBindposes>>().add(bind_poses);
    world.entity_mut(surface).insert(SkinnedMesh { inverse_bindposes, joints: entities.to_vec() });
    scene.run(1);
    entities
}

fn move_joints(scene: &mut Scene, joints: [Entity; 2], to: [Transform; 2]) {
    for (joint, to) in joints.into_iter().zip(to) {
        *scene.0.world_mut().get_mut::<Transform>(joint).unwrap() = to;
    }
    // The pose follows a frame later.
    scene.run(1);
    scene.run(1);
}

pub fn glazed() -> PorousMaterial {
    PorousMaterial { capacity_mm: 0.0, retained_mm: 0.05, ..default() }
}

/// Throws paint at a point of a surface, from half a metre away.
fn shoot(scene: &mut Scene, surface: Entity, at: Vec3, along: Vec3) {
    let effect = WeatherEffect {
        stamp_radius: Some(RADIUS),
        gravity_scale: 0.0,
        terminal_speed: Some(0.0),
        diffuse: Paint { color: [0.2, 0.5, 0.9], opacity: 1.0 },
        ..default()
    };
    let effect = scene.0.world_mut().resource_mut::<Assets<WeatherEffect>>().add(effect);
    let emitter = Emitter { effect, rate: 60.0, speed: 10.0, lifetime: 0.2, ..default() };
    let place = Transform::from_translation(at - along * 0.5).looking_at(at, Vec3::Z);
    let emitter = scene.0.world_mut().spawn((emitter, place)).id();
    // It asks for its effect; then the frames are measured.
    scene.run(1);
    scene.wait_for::<SurfaceFrames>(surface);
    scene.run(20);
    scene.0.world_mut().despawn(emitter);
    scene.run(20);
}

fn maps(scene: &Scene, surface: Entity) -> &CpuMaps {
    scene.0.world().get::<CpuMaps>(surface).unwrap()
}

fn coverage_at(maps: &CpuMaps, uv: Vec2) -> u8 {
    let [x, y] = (uv * SIZE as f32).to_array().map(|part| part as usize);
    maps.diffuse[y * SIZE as usize + x][3]
}

/// Middles of the texels that are painted, uv.
fn painted(maps: &CpuMaps) -> Vec<Vec2> {
    let middle = |texel: usize| {
        let [x, y] = [texel % SIZE as usize, texel / SIZE as usize].map(|at| (at as f32 + 0.5) / SIZE as f32);
        Vec2::new(x, y)
    };
    let covered = maps.diffuse.iter().enumerate().filter(|(_, color)| color[3] > 64);
    covered.map(|(texel, _)| middle(texel)).collect()
}

#[test]
fn a_mark_lands_where_it_hits_in_the_pose_is_round_there_and_stays_when_it_moves_on() {
    // On the half that hangs down, and in the middle of the bend, where the plank is pressed together.
    for (uv, tolerance) in [(Vec2::new(0.85, 0.55), 0.15), (Vec2::new(0.505, 0.55), 0.3)] {
        let mut scene = Scene::new(60);
        let surface = scene.surface(plank(), SIZE, glazed(), Transform::from_xyz(7.0, 3.0, -4.0));
        let pose = hanging(Vec3::new(0.0, 1.0, 0.5));
        let joints = skin(&mut scene, surface, pose);
        let step = Vec2::X * 0.005;
        let (at, along) = (posed(uv, pose), (posed(uv + step, pose) - posed(uv - step, pose)).normalize());
        // Against the front, which is up at rest.
        shoot(&mut scene, surface, at, along.cross(Vec3::Z));

        assert!(coverage_at(maps(&scene, surface), uv) > 200, "not on the triangle that was hit");
        let marked: Vec<Vec3> =
            painted(maps(&scene, surface)).into_iter().map(|uv| posed(uv, pose) - at).collect();
        for direction in [along, -along, Vec3::Z, Vec3::NEG_Z] {
            let reach = marked.iter().map(|away| away.dot(direction)).fold(0.0, f32::max);
            let part = reach / (0.92 * RADIUS);
            assert!((part - 1.0).abs() < tolerance, "{uv}: {part} of the radius towards {direction}");
        }
        let farthest = marked.iter().map(|away| away.length()).fold(0.0, f32::max);
        assert!(farthest < RADIUS * (1.0 + tolerance), "{uv}: {farthest}");

        let before = maps(&scene, surface).clone();
        move_joints(&mut scene, joints, straight(Vec3::new(-3.0, 0.5, 0.0)));
        scene.run(10);
        assert!(*maps(&scene, surface) == before, "the marks have moved on the surface");
        // Where it was there is nothing to be hit any more.
        shoot(&mut scene, surface, at, along.cross(Vec3::Z));
        assert!(*maps(&scene, surface) == before, "it was hit where it is not any more");
    }
}

#[test]
fn a_mark_lands_where_a_morphed_surface_is_and_stays_when_it_goes_back() {
    // Its target is a metre higher.
    let mesh = plank();
    let raised = MorphAttributes::new(Vec3::Y, Vec3::ZERO, Vec3::ZERO);
    let mesh = {
        let vertices = mesh.count_vertices();
        mesh.with_morph_targets(vec![raised; vertices])
    };
    let mut scene = Scene::new(60);
    let surface = scene.surface(mesh, SIZE, glazed(), Transform::default());
    let weigh = |scene: &mut Scene, weight: f32| {
        let weights = MeshMorphWeights::Value { weights: vec![weight] };
        scene.0.world_mut().entity_mut(surface).insert(weights);
        // The pose follows a frame later.
        scene.run(1);
        scene.run(1);
    };
    weigh(&mut scene, 0.5);
    let uv = Vec2::new(0.3, 0.55);
    // Aslant: at rest it would be hit half a metre, a quarter of its length, farther on.
    shoot(&mut scene, surface, at_rest(uv) + Vec3::Y * 0.5, Vec3::new(1.0, -1.0, 0.0).normalize());
    let marks = maps(&scene, surface).clone();
    assert!(coverage_at(&marks, uv) > 200, "not where it was hit");
    assert!(painted(&marks).iter().all(|at| (at.x - uv.x).abs() < 0.06), "and nowhere else");
    weigh(&mut scene, 0.0);
    scene.run(10);
    assert!(*maps(&scene, surface) == marks, "the marks have moved on the surface");
}

#[test]
fn two_surfaces_of_one_mesh_have_maps_and_poses_of_their_own() {
    let mut scene = Scene::new(60);
    let first = scene.surface(plank(), SIZE, glazed(), Transform::default());
    let world = scene.0.world_mut();
    let shared = (*world.get::<Weatherable>(first).unwrap(), world.get::<Mesh3d>(first).unwrap().clone());
    let second = world.spawn((shared, glazed(), Transform::default())).id();
    scene.wait_for::<SurfaceWater>(second);
    let poses = [hanging(Vec3::ZERO), straight(Vec3::Z * 2.0)];
    skin(&mut scene, first, poses[0]);
    skin(&mut scene, second, poses[1]);
    let (low, near) = (Vec2::new(0.85, 0.55), Vec2::new(0.65, 0.55));
    shoot(&mut scene, first, posed(low, poses[0]), Vec3::NEG_X);
    shoot(&mut scene, second, posed(near, poses[1]), Vec3::NEG_Y);
    let coverage = |surface: Entity| [low, near].map(|uv| coverage_at(maps(&scene, surface), uv) > 200);
    assert_eq!([first, second].map(coverage), [[true, false], [false, true]]);
}

/// A plank that hangs down, with water near its lower end, and slopes that know how it hangs.
fn wet_and_hanging(scene: &mut Scene) -> (Entity, [Entity; 2]) {
    let surface = scene.surface(plank(), SIZE, glazed(), Transform::default());
    let joints = skin(scene, surface, hanging(Vec3::ZERO));
    scene.pour(surface, Vec2::new(0.96, 0.5), 6, 2_000_000);
    scene.run(1);
    let texel = |uv: Vec2| {
        let [x, y] = (uv * SIZE as f32).to_array().map(|part| part as usize);
        y * SIZE as usize + x
    };
    scene.wait_until("slopes", |scene| {
        let heights = scene.0.world().get::<WetGeometry>(surface).unwrap().0.height();
        let fall = heights[texel(Vec2::new(0.1, 0.5))] - heights[texel(Vec2::new(0.95, 0.5))];
        (fall - 0.9).abs() < 0.02
    });
    (surface, joints)
}

#[test]
fn water_runs_down_the_pose_and_drips_from_its_edge() {
    let mut scene = Scene::new(60);
    wet_and_hanging(&mut scene);
    let mut seen = 0;
    for _ in 0..600 {
        scene.run(1);
        let drops = scene.0.world().resource::<Particles>().iter();
        // They have fallen for a tick; the end of the plank is a metre below its second joint.
        for position in drops.filter(|drop| drop.velocity.length() < 0.2).map(|drop| drop.position) {
            assert!((position.x - 1.0).abs() < 0.02, "{position}");
            assert!((-1.03..-0.97).contains(&position.y) && position.z.abs() < 0.21, "{position}");
            seen += 1;
        }
    }
    assert!(seen > 3, "{seen} drips");
}

/// How much lower the second end of a plank lies than its first, by its slopes, metres.
pub fn fall(world: &World, surface: Entity) -> f32 {
    let heights = world.get::<WetGeometry>(surface).unwrap().0.height();
    let row = SIZE as usize / 2 * SIZE as usize;
    heights[row + 25] - heights[row + 243]
}

#[test]
fn at_fixed_ticks_new_slopes_come_to_the_same_however_long_they_take() {
    let run = |pause: Duration| -> (Vec<[u32; 2]>, Ledger, u32) {
        let mut scene = Scene::new(60);
        scene.0.insert_resource(MeasureTiming::AfterTicks(10));
        let surface = scene.surface(plank(), SIZE, glazed(), Transform::default());
        scene.wait_for::<Exposure>(surface);
        skin(&mut scene, surface, hanging(Vec3::ZERO));
        scene.pour(surface, Vec2::new(0.9, 0.5), 6, 2_000_000);
        let mut changed = 0;
        for tick in 1..=90 {
            scene.run(1);
            if changed == 0 && fall(scene.0.world(), surface) > 0.5 {
                changed = tick;
            }
            std::thread::sleep(pause);
        }
        let water = scene.water(surface);
        let texels = water.texels().iter().map(|texel| [texel.film, texel.pores]).collect();
        (texels, water.ledger(), changed)
    };
    // In the first run they are done long before their time, in the second perhaps not.
    let (slow, fast) = (run(Duration::from_millis(20)), run(Duration::ZERO));
    assert!(slow.2 > 10, "{}", slow.2);
    assert_eq!((slow.1, slow.2), (fast.1, fast.2));
    assert!(slow.0 == fast.0, "the water lies elsewhere");
}

#[test]
fn poses_that_are_nonsense_lose_no_water_and_make_none_that_is_not_a_number() {
    let mut scene = Scene::new(60);
    let (surface, joints) = wet_and_hanging(&mut scene);
    let [root, second] = hanging(Vec3::ZERO);
    let poses = [
        [root, second.with_translation(Vec3::NAN)],
        [root.with_translation(Vec3::splat(f32::INFINITY)), second],
        [root, second.with_scale(Vec3::ZERO)],
        [root.with_scale(Vec3::ZERO), second.with_scale(Vec3::ZERO)],
        [root, second.with_scale(Vec3::splat(1.0e20))],
        [root, second],
    ];
    for pose in poses {
        move_joints(&mut scene, joints, pose);
        scene.pour(surface, Vec2::new(0.96, 0.5), 6, 1_000_000);
        for _ in 0..40 {
            scene.run(1);
            let particles = scene.0.world().resource::<Particles>();
            assert!(particles.positions().iter().all(|position| position.is_finite()), "{pose:?}");
            assert!(particles.velocities().iter().all(|velocity| velocity.is_finite()), "{pose:?}");
        }
    }
    let over = scene.over(surface);
    assert!(over.film_ml.is_finite() && over.absorbed_ml == 0.0);
    let (water, ledger) = (scene.water(surface), scene.water(surface).ledger());
    let held: u64 = water.texels().iter().map(|texel| u64::from(texel.film) + u64::from(texel.pores)).sum();
    assert_eq!(ledger.received, held + ledger.evaporated + ledger.dripped + ledger.spilled);
    assert!(ledger.dripped > 0);
}
