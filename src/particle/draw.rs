//! Particles on the screen: streaks in one mesh.
//!
//! Every frame the particles in flight are written into a mesh of camera-facing quads, each as long as its particle
//! flies in the [exposure](crate::effect::ParticleLook::exposure) of its effect. Enough for tens of thousands; the CPU
//! writes 4 vertices each.

use bevy::asset::{AssetEventSystems, RenderAssetUsages};
use bevy::camera::visibility::{NoFrustumCulling, VisibilitySystems};
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy::render::RenderApp;

use super::Particles;
use crate::effect::{EffectTable, ParticleLook};

/// The entity whose mesh holds all particles.
#[derive(Component, Debug, Default)]
pub struct ParticleMesh;

/// Draws particles. Does nothing without a render app.
pub struct ParticleDrawPlugin;

impl Plugin for ParticleDrawPlugin {
    fn build(&self, app: &mut App) {
        if app.get_sub_app(RenderApp).is_some() {
            app.add_systems(Startup, spawn_particle_mesh).add_systems(
                PostUpdate,
                draw_particles
                    // Streaks face the cameras where they are in this frame, and are drawn in it.
                    .after(TransformSystems::Propagate)
                    .before(VisibilitySystems::VisibilityPropagate)
                    .before(AssetEventSystems),
            );
        }
    }
}

fn spawn_particle_mesh(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let material = StandardMaterial {
        base_color: Color::WHITE,
        unlit: true,
        alpha_mode: AlphaMode::Blend,
        cull_mode: None,
        double_sided: true,
        ..default()
    };
    commands.spawn((
        ParticleMesh,
        Name::new("particles"),
        Mesh3d(meshes.add(Streaks::default().into_mesh())),
        MeshMaterial3d(materials.add(material)),
        // Its box would have to be computed anew every frame.
        NoFrustumCulling,
        NotShadowCaster,
        NotShadowReceiver,
    ));
}

/// Quads of one frame.
#[derive(Default)]
struct Streaks {
    positions: Vec<[f32; 3]>,
    colors: Vec<[f32; 4]>,
    indices: Vec<u32>,
}

impl Streaks {
    /// A quad from `head` back along the path, across the line of sight.
    fn push(&mut self, head: Vec3, velocity: Vec3, eye: Vec3, look: &ParticleLook) {
        let sight = (head - eye).normalize_or(Vec3::NEG_Z);
        let along = velocity * look.exposure;
        let along =
            if along.length() > look.width { along } else { sight.any_orthonormal_vector() * look.width };
        let across = along.cross(sight).normalize_or(sight.any_orthonormal_vector()) * (look.width * 0.5);
        let first = self.positions.len() as u32;
        let tail = head - along;
        self.positions.extend(
            [head + across, head - across, tail - across, tail + across].map(|corner| corner.to_array()),
        );
        let [r, g, b, a] = look.color;
        // The tail is where the drop was at the start of the exposure: it fades.
        self.colors.extend([[r, g, b, a], [r, g, b, a], [r, g, b, 0.0], [r, g, b, 0.0]]);
        self.indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
    }

    fn into_mesh(self) -> Mesh {
        let mut streaks = self;
        if streaks.positions.is_empty() {
            // An empty vertex buffer cannot be bound; one invisible point can.
            streaks.positions.push([0.0; 3]);
            streaks.colors.push([0.0; 4]);
            streaks.indices.extend([0, 0, 0]);
        }
        let normals = vec![[0.0, 1.0, 0.0]; streaks.positions.len()];
        // Kept in the main world, too: replaced twice within a frame, it would otherwise be gone the second time.
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, streaks.positions)
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
            .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, streaks.colors)
            .with_inserted_indices(Indices::U32(streaks.indices))
    }
}

fn draw_particles(
    effects: Res<EffectTable>,
    particles: Res<Particles>,
    cameras: Query<(&Camera, &GlobalTransform)>,
    mut target: Query<(&Mesh3d, &mut Visibility), With<ParticleMesh>>,
    mut meshes: ResMut<Assets<Mesh>>,
) {
    let Ok((mesh, mut visibility)) = target.single_mut() else { return };
    let count = particles.len();
    visibility.set_if_neq(if count > 0 { Visibility::Inherited } else { Visibility::Hidden });
    if count == 0 {
        return;
    }
    let active = cameras.iter().find(|(camera, _)| camera.is_active);
    let eye = active.map_or(Vec3::ZERO, |(_, transform)| transform.translation());
    let mut streaks = Streaks::default();
    for particle in particles.iter() {
        if let Some(effect) = effects.get(particle.effect) {
            streaks.push(particle.position, particle.velocity, eye, &effect.look);
        }
    }
    let _ = meshes.insert(mesh.id(), streaks.into_mesh());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_streak_lies_on_the_path_and_faces_the_eye() {
        let look = ParticleLook { exposure: 0.1, width: 0.02, ..default() };
        let mut streaks = Streaks::default();
        streaks.push(Vec3::ZERO, Vec3::NEG_Y * 5.0, Vec3::Z * 10.0, &look);
        let corners: Vec<Vec3> = streaks.positions.iter().map(|&p| Vec3::from_array(p)).collect();
        let middle = corners.iter().sum::<Vec3>() / 4.0;
        assert!((middle - Vec3::Y * 0.25).length() < 1e-5, "{middle}");
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        assert!(normal.z.abs() > 0.999, "{normal}");
        assert!((corners[1] - corners[0]).length() - 0.02 < 1e-6);
    }
}
