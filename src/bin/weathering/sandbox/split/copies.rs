//! The surfaces of the copy, and how they follow those of the scene.
//!
//! A skinned surface is where its joints are, so each of these has a copy, too: a place and nothing else, as far off as all is.
//! Weights of morphed surfaces are the same on both sides.

use bevy::camera::visibility::{NoFrustumCulling, RenderLayers};
use bevy::ecs::entity::EntityHashMap;
use bevy::math::Vec3A;
use bevy::mesh::morph::MeshMorphWeights;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::prelude::*;
use bevy_weathering::material::{DryMaterial, PorousMaterial, StandingWater, WettingTextures};
use bevy_weathering::overlay::Weatherable;
use bevy_weathering::scenario::SceneEntity;

use super::{CopyOf, LAYERS, Split};

/// What stands for a joint in the copy.
#[derive(Component)]
pub(super) struct CopiedJoint;

/// Copies all surfaces of the scene.
pub(super) fn copy_surfaces(world: &mut World, offset: Vec3) {
    let mut surfaces = world.query_filtered::<Entity, (With<Weatherable>, Without<CopyOf>)>();
    let mut joints = EntityHashMap::default();
    for original in surfaces.iter(world).collect::<Vec<_>>() {
        copy_surface(world, original, offset, &mut joints);
    }
}

/// `joints`: the copies of those that have one already; surfaces may share them.
fn copy_surface(world: &mut World, original: Entity, offset: Vec3, joints: &mut EntityHashMap<Entity>) {
    let of = world.entity(original);
    let (Some(surface), Some(mesh), Some(place)) =
        (of.get::<Weatherable>(), of.get::<Mesh3d>(), of.get::<GlobalTransform>())
    else {
        return;
    };
    // As it was before it was exchanged for its weathered form.
    let dry = of.get::<DryMaterial>().map(|dry| dry.0.clone());
    let dry = dry.or_else(|| of.get::<MeshMaterial3d<StandardMaterial>>().map(|own| own.0.clone()));
    let Some(dry) = dry else { return };
    let transform = moved(place, offset).compute_transform();
    let name = of.get::<Name>().map_or_else(|| original.to_string(), ToString::to_string);
    let copy = (
        CopyOf(original),
        SceneEntity,
        Name::new(format!("B: {name}")),
        *surface,
        mesh.clone(),
        MeshMaterial3d(dry),
        of.get::<PorousMaterial>().copied().unwrap_or_default(),
        of.get::<StandingWater>().copied().unwrap_or_default(),
        of.get::<WettingTextures>().cloned().unwrap_or_default(),
        transform,
        GlobalTransform::from(transform),
        RenderLayers::layer(LAYERS[1]),
    );
    let (skin, weights) = (of.get::<SkinnedMesh>().cloned(), of.get::<MeshMorphWeights>().cloned());
    let copy = world.spawn(copy).id();
    if let Some(skin) = skin {
        let joints = skin.joints.iter().map(|&joint| copy_joint(world, joint, offset, joints)).collect();
        world.entity_mut(copy).insert((SkinnedMesh { joints, ..skin }, NoFrustumCulling));
    }
    if let Some(weights) = weights {
        world.entity_mut(copy).insert((weights, NoFrustumCulling));
    }
}

fn copy_joint(world: &mut World, joint: Entity, offset: Vec3, copies: &mut EntityHashMap<Entity>) -> Entity {
    if let Some(copy) = copies.get(&joint) {
        return *copy;
    }
    // One that is missing is so on both sides.
    let Some(place) = world.get::<GlobalTransform>(joint).copied() else { return joint };
    // Without a transform of its own, so that nothing but what it follows says where it is.
    let copy = world.spawn((CopyOf(joint), CopiedJoint, SceneEntity, moved(&place, offset))).id();
    copies.insert(joint, copy);
    copy
}

/// The same place in the copy.
fn moved(place: &GlobalTransform, offset: Vec3) -> GlobalTransform {
    let mut affine = place.affine();
    affine.translation += Vec3A::from(offset);
    affine.into()
}

/// Copies are where what they are copies of is, and in its pose.
pub(super) fn follow_poses(
    split: Res<Split>,
    originals: Query<(&GlobalTransform, Option<Ref<MeshMorphWeights>>), Without<CopyOf>>,
    mut joints: Query<(&CopyOf, &mut GlobalTransform), With<CopiedJoint>>,
    mut surfaces: Query<
        (&CopyOf, &mut Transform, &mut GlobalTransform, Option<&mut MeshMorphWeights>),
        (With<Weatherable>, Without<CopiedJoint>),
    >,
) {
    for (of, mut global) in &mut joints {
        if let Ok((place, _)) = originals.get(of.0) {
            global.set_if_neq(moved(place, split.offset));
        }
    }
    for (of, mut transform, mut global, weights) in &mut surfaces {
        let Ok((place, now)) = originals.get(of.0) else { continue };
        // What propagation will make of it.
        let stands = moved(place, split.offset).compute_transform();
        transform.set_if_neq(stands);
        global.set_if_neq(GlobalTransform::from(stands));
        if let (Some(mut weights), Some(now)) = (weights, now)
            && now.is_changed()
        {
            weights.clone_from(&now);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OFFSET: Vec3 = Vec3::new(10.0, 0.0, 0.0);

    fn at(place: Vec3) -> (Transform, GlobalTransform) {
        let transform = Transform::from_translation(place);
        (transform, GlobalTransform::from(transform))
    }

    fn place(world: &World, entity: Entity) -> Vec3 {
        world.get::<GlobalTransform>(entity).unwrap().translation()
    }

    /// The copy of an entity.
    fn copy_of(world: &mut World, original: Entity) -> Entity {
        let mut copies = world.query::<(Entity, &CopyOf)>();
        copies.iter(world).find(|(_, of)| of.0 == original).unwrap().0
    }

    fn weights(world: &World, entity: Entity) -> Vec<f32> {
        match world.get::<MeshMorphWeights>(entity) {
            Some(MeshMorphWeights::Value { weights }) => weights.clone(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn posed_surfaces_are_copied_and_their_copies_take_their_poses() {
        let mut world = World::new();
        world.insert_resource(Split { offset: OFFSET, bounds: (Vec3::ZERO, Vec3::ONE), at: 0.5 });
        let joint = world.spawn(at(Vec3::Y)).id();
        let skin = SkinnedMesh { inverse_bindposes: Handle::default(), joints: vec![joint, joint] };
        let surface = || {
            let material = MeshMaterial3d::<StandardMaterial>(Handle::default());
            (Weatherable::default(), Mesh3d(Handle::default()), material, at(Vec3::ZERO))
        };
        let skinned = world.spawn((surface(), skin)).id();
        let morphed = world.spawn((surface(), MeshMorphWeights::Value { weights: vec![0.25] })).id();
        copy_surfaces(&mut world, OFFSET);

        let copy = copy_of(&mut world, skinned);
        let joints = world.get::<SkinnedMesh>(copy).unwrap().joints.clone();
        assert!(joints.len() == 2 && joints[0] == joints[1] && joints[0] != joint);
        assert_eq!(place(&world, joints[0]), Vec3::Y + OFFSET);
        assert_eq!(place(&world, copy), OFFSET);
        let copy_of_morphed = copy_of(&mut world, morphed);
        assert_eq!(weights(&world, copy_of_morphed), [0.25]);

        // They move, and so do their copies.
        world.entity_mut(joint).insert(at(Vec3::Z));
        world.entity_mut(morphed).insert((at(Vec3::X), MeshMorphWeights::Value { weights: vec![0.75] }));
        let mut schedule = Schedule::default();
        schedule.add_systems(follow_poses);
        schedule.run(&mut world);
        assert_eq!(place(&world, joints[0]), Vec3::Z + OFFSET);
        assert_eq!(place(&world, copy_of_morphed), Vec3::X + OFFSET);
        assert_eq!(world.get::<Transform>(copy_of_morphed).unwrap().translation, Vec3::X + OFFSET);
        assert_eq!(weights(&world, copy_of_morphed), [0.75]);
        // What does not move is left alone.
        world.clear_trackers();
        schedule.run(&mut world);
        let is_changed = world.entity(joints[0]).get_ref::<GlobalTransform>().unwrap().is_changed();
        assert!(!is_changed);
    }
}
