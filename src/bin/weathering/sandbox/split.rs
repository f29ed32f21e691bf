//! Two settings side by side: a copy of the scene, some way off, whose surfaces may be of other materials.
//!
//! A second camera looks at the copy from where the first one looks at the scene, and shows it on the right of a divider. What
//! falls on the scene falls on the copy, too: each emitter has one there, which follows it but draws lots of its own. Render
//! layers keep the two from seeing each other's surfaces.

mod copies;

use bevy::camera::Exposure;
use bevy::camera::visibility::RenderLayers;
use bevy::core_pipeline::prepass::DepthPrepass;
use bevy::light::{EnvironmentMapLight, Skybox};
use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::collision::CollisionScene;
use bevy_weathering::emitter::Emitter;
use bevy_weathering::particle::ParticleMesh;
use bevy_weathering::record::Recording;
use bevy_weathering::scenario::SceneEntity;

use super::camera::View;
use super::theme;
use super::ui::{AddPanel, Place};

/// What both cameras see is in both of these layers.
const LAYERS: [usize; 2] = [0, 1];
/// Added to the streams of emitters.
const STREAMS: u32 = 1 << 30;
/// Where the divider may be, in parts of the width that panels leave.
const DIVIDER: (f32, f32) = (0.1, 0.9);

/// The comparison, while there is one.
#[derive(Resource)]
pub struct Split {
    /// From the scene to its copy, metres.
    pub offset: Vec3,
    /// Bounds of the scene without its copy.
    bounds: (Vec3, Vec3),
    /// Of the divider, in parts of the width that panels leave.
    pub at: f32,
}

impl Split {
    /// The part of a line, from start to end, that may hit the scene, and not its copy.
    pub fn without_copy(&self, [start, end]: [Vec3; 2]) -> Option<[Vec3; 2]> {
        let (low, high) = self.bounds;
        // Half way between the two.
        let border = 0.5 * (low.x + high.x + self.offset.x);
        let crossing = start.lerp(end, (border - start.x) / (end.x - start.x));
        match [start, end].map(|place| place.x <= border) {
            [true, true] => Some([start, end]),
            [true, false] => Some([start, crossing]),
            [false, true] => Some([crossing, end]),
            [false, false] => None,
        }
    }
}

/// What stands for another entity in the copy.
#[derive(Component)]
pub struct CopyOf(Entity);

/// The camera that looks at the copy.
#[derive(Component)]
pub struct SecondCamera;

pub fn plugin(app: &mut App) {
    app.add_systems(PreUpdate, follow_emitters.run_if(resource_exists::<Split>))
        .add_systems(
            PostUpdate,
            (
                follow_camera.before(TransformSystems::Propagate),
                // Where everything is in this frame.
                copies::follow_poses.run_if(resource_exists::<Split>).after(TransformSystems::Propagate),
            ),
        )
        .add_panel(Place::Side, "Compare", show);
}

/// Smallest and largest corner of the scene, without its copy.
pub fn bounds(split: Option<&Split>, scene: &CollisionScene) -> (Vec3, Vec3) {
    split.map_or_else(|| scene.bounds(), |split| split.bounds)
}

/// How far off the copy is: out of the scene's way, but no farther, for the sake of what is measured in a grid over all of it.
fn offset((low, high): (Vec3, Vec3)) -> Vec3 {
    let size = high - low;
    Vec3::X * (2.0 * size.max_element().clamp(1.0, 1000.0) + 5.0)
}

fn begin(world: &mut World) {
    let scene = world.resource::<CollisionScene>();
    // A copy is no part of a scenario that is recorded.
    let is_recording = world.contains_resource::<Recording>();
    if scene.is_empty() || world.contains_resource::<Split>() || is_recording {
        return;
    }
    let bounds = scene.bounds();
    let offset = offset(bounds);
    copies::copy_surfaces(world, offset);
    let both = RenderLayers::from_layers(&LAYERS);
    let mut shared = world.query_filtered::<Entity, Or<(With<DirectionalLight>, With<ParticleMesh>)>>();
    for entity in shared.iter(world).collect::<Vec<_>>() {
        world.entity_mut(entity).insert(both.clone());
    }
    add_camera(world);
    world.insert_resource(Split { offset, bounds, at: 0.5 });
}

/// Takes the copy away. Also before another scene comes.
pub fn end(world: &mut World) {
    if world.remove_resource::<Split>().is_none() {
        return;
    }
    let mut copies = world.query_filtered::<Entity, Or<(With<CopyOf>, With<SecondCamera>)>>();
    for copy in copies.iter(world).collect::<Vec<_>>() {
        world.despawn(copy);
    }
}

/// A camera like the scene's.
fn add_camera(world: &mut World) {
    let mut cameras = world.query_filtered::<Entity, With<View>>();
    let Some(first) = cameras.iter(world).next() else { return };
    let of = world.entity(first);
    let projection = of.get::<Projection>().cloned().unwrap_or_default();
    let msaa = of.get::<Msaa>().copied().unwrap_or_default();
    let exposure = of.get::<Exposure>().copied().unwrap_or_default();
    let (light, sky) = (of.get::<EnvironmentMapLight>().cloned(), of.get::<Skybox>().cloned());
    let camera = Camera { order: 1, ..default() };
    let layers = RenderLayers::layer(LAYERS[1]);
    let mut second = world.spawn((
        SecondCamera,
        SceneEntity,
        Name::new("second camera"),
        Camera3d::default(),
        DepthPrepass,
        camera,
        projection,
        msaa,
        exposure,
        layers,
        Transform::default(),
    ));
    if let Some(light) = light {
        second.insert(light);
    }
    if let Some(sky) = sky {
        second.insert(sky);
    }
}

/// Emitters of the copy do what those of the scene do, and come and go with them.
fn follow_emitters(
    split: Res<Split>,
    mut commands: Commands,
    originals: Query<(Entity, &Emitter, &GlobalTransform), Without<CopyOf>>,
    mut copies: Query<(Entity, &CopyOf, &mut Emitter, &mut Transform, &mut GlobalTransform), With<CopyOf>>,
) {
    for (original, emitter, global) in &originals {
        if copies.iter().any(|(_, of, ..)| of.0 == original) {
            continue;
        }
        let mut transform = global.compute_transform();
        transform.translation += split.offset;
        let emitter = Emitter { stream: emitter.stream.wrapping_add(STREAMS), ..emitter.clone() };
        commands.spawn((CopyOf(original), SceneEntity, emitter, transform, GlobalTransform::from(transform)));
    }
    for (copy, of, mut emitter, mut transform, mut global) in &mut copies {
        let Ok((_, original, place)) = originals.get(of.0) else {
            commands.entity(copy).despawn();
            continue;
        };
        *emitter = Emitter { stream: emitter.stream, ..original.clone() };
        *transform = place.compute_transform();
        transform.translation += split.offset;
        *global = GlobalTransform::from(*transform);
    }
}

fn follow_camera(
    split: If<Res<Split>>,
    first: Query<&Transform, (With<View>, Without<SecondCamera>)>,
    mut second: Query<&mut Transform, With<SecondCamera>>,
) {
    let Some(first) = first.iter().next() else { return };
    for mut transform in &mut second {
        transform.set_if_neq(first.with_translation(first.translation + split.offset));
    }
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    ui.label("A copy of the scene on the right, of other materials; the same falls on both.");
    ui.label("The line between them can be dragged.");
    let is_on = world.contains_resource::<Split>();
    if !is_on {
        if world.contains_resource::<Recording>() {
            ui.label("End the recording first: a copy is no part of it.");
        } else if ui.button("Begin").clicked() {
            begin(world);
        }
        return;
    }
    if ui.button("End").clicked() {
        end(world);
        return;
    }
    ui.label("Materials of the right side: those whose surface begins with \"B\".");
    ui.label("Tools act on the left side; the hose wets both.");
}

/// The line between the two, which can be dragged. `free`: what panels leave of the window.
pub fn show_divider(context: &egui::Context, free: egui::Rect, world: &mut World) {
    let Some(mut split) = world.get_resource_mut::<Split>() else { return };
    let x = free.left() + free.width() * split.at;
    let area = egui::Area::new("divider".into()).order(egui::Order::Middle).movable(false);
    let area = area.fixed_pos(egui::pos2(x - 5.0, free.top())).constrain(false);
    area.show(context, |ui| {
        let size = egui::vec2(10.0, free.height());
        let (rect, line) = ui.allocate_exact_size(size, egui::Sense::drag());
        let color = if line.hovered() || line.dragged() { theme::ACCENT } else { egui::Color32::GRAY };
        let line_rect = egui::Rect::from_center_size(rect.center(), egui::vec2(2.0, rect.height()));
        ui.painter().rect_filled(line_rect, 0.0, color);
        if line.dragged() {
            let (least, most) = DIVIDER;
            split.at = (split.at + line.drag_delta().x / free.width().max(1.0)).clamp(least, most);
        }
        line.on_hover_cursor(egui::CursorIcon::ResizeHorizontal);
    });
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bevy::math::Affine3A;
    use bevy_weathering::collision::{MeshBvh, MeshTriangles};

    use super::super::probe;
    use super::*;

    #[test]
    fn the_copy_is_out_of_the_way() {
        for bounds in [(Vec3::ZERO, Vec3::ONE), (Vec3::splat(-40.0), Vec3::splat(60.0))] {
            assert!(offset(bounds).x > bounds.1.x - bounds.0.x);
        }
    }

    #[test]
    fn tools_act_on_the_scene_and_not_on_its_copy() {
        let mesh = Mesh::from(Cuboid::new(2.0, 2.0, 2.0));
        let cube = Arc::new(MeshBvh::build(MeshTriangles::from_mesh(&mesh).unwrap()));
        let bounds = (Vec3::NEG_ONE, Vec3::ONE);
        let offset = offset(bounds);
        let [original, copy] = [1, 2].map(|number| Entity::from_raw_u32(number).unwrap());
        let scene = CollisionScene::new([
            (original, Affine3A::IDENTITY, cube.clone()),
            (copy, Affine3A::from_translation(offset), cube),
        ]);
        let split = Split { offset, bounds, at: 0.5 };
        let found = |split: Option<&Split>, origin: Vec3, direction: Dir3| {
            probe::hit(&scene, split, Ray3d { origin, direction }).map(|hit| hit.surface)
        };
        let (above, beyond) = (Vec3::new(-3.0, 2.0, 0.0), offset * 2.0);
        for (origin, direction, alone, compared) in [
            // From before the scene, and past it.
            (Vec3::X * -3.0, Dir3::X, Some(original), Some(original)),
            (above, Dir3::new(offset - above).unwrap(), Some(copy), None),
            // From between the two, and from beyond the copy.
            (offset * 0.5 - Vec3::X, Dir3::X, Some(copy), None),
            (beyond, Dir3::NEG_X, Some(copy), Some(original)),
            (beyond, Dir3::X, None, None),
        ] {
            // Not where two triangles meet.
            let origin = origin.with_z(0.3);
            let surfaces = [None, Some(&split)].map(|split| found(split, origin, direction));
            assert_eq!(surfaces, [alone, compared], "from {origin} along {direction:?}");
        }
    }
}
