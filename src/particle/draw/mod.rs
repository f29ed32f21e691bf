//! Particles on the screen, by the hundred thousand.
//!
//! All particles are one mesh, of quads that never change. In every frame the columns of [`Particles`] are written as
//! [`GpuParticle`] rows, moved into the render world and copied into the buffer the shader pulls from; the buffer stays
//! what it is, and with it every binding, until more are in flight than it has room for. The shader turns each quad to
//! the eye: along what its particle flies in the [exposure](crate::effect::ParticleLook::exposure) of its effect, or, of
//! what stands still, round itself. It shows a sprite that was made in code, lit by the first directional
//! light, through it or from its side, and by what is all around. Quads thinner than a pixel are widened and made as
//! much fainter, so that they do not flicker. For a camera with a
//! [`DepthPrepass`](bevy::core_pipeline::prepass::DepthPrepass) they fade into what is close behind them, over half their
//! width, in place of ending there in a hard edge. Behind the particles come the [`Splashes`] of those that hit.
//!
//! Not here: shadows of and on particles, point lights, and an order from back to front.

mod crown;
mod flake;
mod material;
mod rows;
mod splash;
mod sprites;
mod stone;
mod water;

use bevy::asset::{AssetEventSystems, RenderAssetUsages, embedded_asset};
use bevy::camera::visibility::{NoFrustumCulling, VisibilitySystems};
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::pbr::MaterialPlugin;
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::renderer::RenderQueue;
use bevy::render::storage::{GpuShaderBuffer, ShaderBuffer};
use bevy::render::{ExtractSchedule, MainWorld, Render, RenderApp, RenderSystems};

use super::Particles;
use crate::clock::WeatheringClock;
use crate::collision::Impacts;
use crate::effect::EffectTable;
use crate::schedule::{WeatheringSystems, WeatheringTick};
use crate::wetting::gpu::WaterUploadSystems;

use self::material::quads;
use self::rows::{ParticleRows, splash_rows};

pub use material::ParticleMaterial;
pub use rows::{GpuFrame, GpuLook, GpuParticle};
use splash::add_splashes;
pub use splash::{Splash, SplashConfig, Splashes};

/// The entity whose mesh holds all particles.
#[derive(Component, Debug, Default)]
pub struct ParticleMesh;

/// Draws particles and splashes. Does nothing without a render app.
pub struct ParticleDrawPlugin;

impl Plugin for ParticleDrawPlugin {
    fn build(&self, app: &mut App) {
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        embedded_asset!(app, "../../../shaders/particles.wgsl");
        app.add_plugins(MaterialPlugin::<ParticleMaterial>::default())
            .register_type::<SplashConfig>()
            .init_resource::<SplashConfig>()
            .init_resource::<Splashes>()
            .init_resource::<Impacts>()
            .init_resource::<ParticleRows>()
            .add_systems(WeatheringTick, add_splashes.in_set(WeatheringSystems::Last))
            .add_systems(Startup, spawn_particle_mesh)
            .add_systems(
                PostUpdate,
                draw_particles
                    // Both add buffers.
                    .after(WaterUploadSystems)
                    // What is hidden or shown here is so in this frame, and what grows is drawn in it.
                    .before(VisibilitySystems::VisibilityPropagate)
                    .before(AssetEventSystems),
            );
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app
            .init_resource::<ParticleRows>()
            .add_systems(ExtractSchedule, extract_rows)
            .add_systems(Render, write_rows.in_set(RenderSystems::PrepareResources));
    }
}

/// How much the mesh and the buffers can hold.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
struct Room {
    rows: usize,
    looks: usize,
}

impl Room {
    const FIRST: Self = Self { rows: 4096, looks: 64 };

    /// Room for so many: the same if that is enough, else as much as the next power of two.
    fn fit(self, rows: usize, looks: usize) -> Self {
        let fit = |has: usize, needed: usize| if needed > has { needed.next_power_of_two() } else { has };
        Self { rows: fit(self.rows, rows), looks: fit(self.looks, looks) }
    }

    fn row_buffer(self) -> ShaderBuffer {
        buffer("particles", self.rows * size_of::<GpuParticle>())
    }

    fn frame_buffer(self) -> ShaderBuffer {
        buffer("particle looks", size_of::<GpuFrame>() + self.looks * size_of::<GpuLook>())
    }
}

fn buffer(label: &'static str, bytes: usize) -> ShaderBuffer {
    let mut buffer = ShaderBuffer::with_size(bytes, RenderAssetUsages::RENDER_WORLD);
    buffer.buffer_description.label = Some(label);
    buffer
}

fn spawn_particle_mesh(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<ParticleMaterial>>,
    mut buffers: ResMut<Assets<ShaderBuffer>>,
    mut images: ResMut<Assets<Image>>,
) {
    let room = Room::FIRST;
    let material = ParticleMaterial {
        rows: buffers.add(room.row_buffer()),
        frame: buffers.add(room.frame_buffer()),
        sprites: images.add(sprites::sprite_atlas()),
    };
    commands.spawn((
        ParticleMesh,
        room,
        Name::new("particles"),
        Mesh3d(meshes.add(quads(room.rows as u32))),
        MeshMaterial3d(materials.add(material)),
        Visibility::Hidden,
        // They are everywhere.
        NoFrustumCulling,
        NotShadowCaster,
        NotShadowReceiver,
    ));
}

/// Writes the rows of this frame, and makes room for them where there is too little.
fn draw_particles(
    particles: Res<Particles>,
    splashes: Res<Splashes>,
    config: Res<SplashConfig>,
    effects: Res<EffectTable>,
    clock: Res<WeatheringClock>,
    mut rows: ResMut<ParticleRows>,
    mut target: Query<
        (&Mesh3d, &MeshMaterial3d<ParticleMaterial>, &mut Room, &mut Visibility),
        With<ParticleMesh>,
    >,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<ParticleMaterial>>,
    mut buffers: ResMut<Assets<ShaderBuffer>>,
) {
    let Ok((mesh, material, mut room, mut visibility)) = target.single_mut() else { return };
    let rows = rows.bypass_change_detection();
    rows.write(&particles, splash_rows(&splashes, &config, &clock), &effects, &clock);
    visibility.set_if_neq(if rows.rows.is_empty() { Visibility::Hidden } else { Visibility::Inherited });

    let wanted = room.fit(rows.rows.len(), rows.looks.len());
    if wanted != *room
        && let Some(mut material) = materials.get_mut(material)
    {
        // New buffers, not larger ones in the place of the old: the material waits for those it does not know yet, and
        // is drawn with the old ones until then. The shader does not read beyond their end.
        if wanted.rows > room.rows {
            material.rows = buffers.add(wanted.row_buffer());
            let _ = meshes.insert(mesh.id(), quads(wanted.rows as u32));
        }
        if wanted.looks > room.looks {
            material.frame = buffers.add(wanted.frame_buffer());
        }
        *room = wanted;
    }
    rows.buffers = materials.get(material).map(|material| [material.rows.id(), material.frame.id()]);
}

/// Takes what the main world wrote, and leaves it the memory of the frame before.
fn extract_rows(mut main_world: ResMut<MainWorld>, mut rows: ResMut<ParticleRows>) {
    if let Some(mut written) = main_world.get_resource_mut::<ParticleRows>() {
        std::mem::swap(written.bypass_change_detection(), rows.bypass_change_detection());
    }
}

/// Writes into the buffers themselves: their assets, and so the bind group, stay as they are.
fn write_rows(rows: Res<ParticleRows>, buffers: Res<RenderAssets<GpuShaderBuffer>>, queue: Res<RenderQueue>) {
    let Some([row_buffer, frame_buffer]) = rows.buffers else { return };
    let (Some(row_buffer), Some(frame_buffer)) = (buffers.get(row_buffer), buffers.get(frame_buffer)) else {
        return;
    };
    if !rows.rows.is_empty() {
        queue.write_buffer(&row_buffer.buffer, 0, bytemuck::cast_slice(&rows.rows));
    }
    queue.write_buffer(&frame_buffer.buffer, 0, bytemuck::bytes_of(&rows.frame));
    if !rows.looks.is_empty() {
        let header = size_of::<GpuFrame>() as u64;
        queue.write_buffer(&frame_buffer.buffer, header, bytemuck::cast_slice(&rows.looks));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_grows_by_powers_of_two_and_stays() {
        let first = Room::FIRST;
        assert_eq!(first.fit(0, 0), first);
        assert_eq!(first.fit(4096, 64), first);
        let grown = first.fit(4097, 3);
        assert_eq!(grown, Room { rows: 8192, looks: 64 });
        assert_eq!(grown.fit(10, 65), Room { rows: 8192, looks: 128 });
        let all = ParticleRows::MOST;
        assert_eq!(first.fit(all, 1).rows, all, "the most that fits is a power of two");
    }

    #[test]
    fn what_is_written_is_moved_each_frame_and_memory_is_used_again() {
        let mut main = MainWorld::default();
        main.insert_resource(ParticleRows::default());
        let mut render = World::new();
        render.insert_resource(main);
        render.init_resource::<ParticleRows>();
        let mut schedule = Schedule::default();
        schedule.add_systems(extract_rows);
        let mut places = Vec::new();
        for frame in 1..=4 {
            let mut main = render.resource_mut::<MainWorld>();
            let mut written = main.resource_mut::<ParticleRows>();
            written.rows.clear();
            written.rows.extend(std::iter::repeat_n(GpuParticle { kind: frame, ..default() }, 100));
            schedule.run(&mut render);
            let taken = &render.resource::<ParticleRows>().rows;
            assert!(taken.len() == 100 && taken.iter().all(|row| row.kind == frame), "{frame}");
            places.push(taken.as_ptr());
        }
        assert_eq!((places[0], places[1]), (places[2], places[3]));
    }
}
