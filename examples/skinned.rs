//! A reed that sways in the rain: what is skinned gets wet where its pose is hit, and water runs down the pose.
//!
//! `cargo run --release --example skinned`

use bevy::camera::visibility::NoFrustumCulling;
use bevy::mesh::VertexAttributeValues;
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::prelude::*;
use bevy_weathering::prelude::*;

/// Length of the reed, metres. It bends in its middle.
const LENGTH: f32 = 2.0;

/// The upper of its two joints.
#[derive(Component)]
struct Upper;

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, WeatheringPlugins))
        .add_systems(Startup, setup)
        .add_systems(Update, sway)
        .run();
}

/// A capsule around the y axis, whose upper half hangs on the second joint.
fn reed() -> Mesh {
    let mesh = Mesh::from(Capsule3d::new(0.2, LENGTH).mesh().rings(32));
    let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(VertexAttributeValues::as_float3);
    let weights: Vec<[f32; 4]> = positions
        .unwrap_or_default()
        .iter()
        .map(|[_, y, _]| {
            let upper = (y / LENGTH + 0.5).clamp(0.0, 1.0);
            [1.0 - upper, upper, 0.0, 0.0]
        })
        .collect();
    let joints = VertexAttributeValues::Uint16x4(vec![[0, 1, 0, 0]; weights.len()]);
    mesh.with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_INDEX, joints)
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, weights)
}

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut bind_poses: ResMut<Assets<SkinnedMeshInverseBindposes>>,
) {
    // As a glTF scene would spawn it: a mesh, and joints that are animated. `Weatherable` is all that it takes.
    let lower = commands.spawn(Transform::default()).id();
    let upper = commands.spawn((Upper, Transform::default(), ChildOf(lower))).id();
    commands.spawn((
        Weatherable::default(),
        Mesh3d(meshes.add(reed())),
        MeshMaterial3d(materials.add(Color::linear_rgb(0.3, 0.35, 0.12))),
        SkinnedMesh {
            inverse_bindposes: bind_poses.add(vec![Mat4::IDENTITY; 2]),
            joints: vec![lower, upper],
        },
        // It leaves the box that it fills at rest.
        NoFrustumCulling,
    ));

    let rain = Emitter::rain(assets.load(WeatherEffect::RAIN), 60.0, Vec2::splat(1.5));
    commands.spawn((rain, Transform::from_xyz(0.0, 3.0, 0.0)));

    commands.spawn((
        DirectionalLight::default(),
        Transform::default().looking_to(Vec3::new(-1.0, -1.5, -1.0), Vec3::Y),
    ));
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.0, 5.0).looking_at(Vec3::ZERO, Vec3::Y)));
}

fn sway(time: Res<Time>, mut upper: Single<&mut Transform, With<Upper>>) {
    upper.rotation = Quat::from_rotation_z(0.9 * time.elapsed_secs().sin());
}
