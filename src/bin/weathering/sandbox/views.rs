//! What is drawn over the scene: seams of uvs, emitters, the wind and the probe; and the panel for these and for what has a file
//! of its own ([`shades`], [`boxes`], [`heat`]).

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use bevy_egui::egui;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::collision::{CollisionScene, MeshBvh, MeshTriangles, SurfaceCollider};
use bevy_weathering::emitter::{Emitter, EmitterShape};
use bevy_weathering::save::RemovedEmitter;
use bevy_weathering::scenario::ByHand;
use bevy_weathering::weather::Weather;

use super::added::{self, Stay};
use super::probe::Probed;
use super::selection::Selected;
use super::settings::{Settings, Tool};
use super::ui::{AddPanel, Place};
use super::{boxes, heat, shades};

/// The most edges that are drawn.
const MOST_EDGES: usize = 20_000;

/// Edges at which uvs break, of the selected surface.
#[derive(Resource, Default)]
struct Seams {
    of: Option<Arc<MeshBvh>>,
    /// In the space of the mesh.
    edges: Vec<[Vec3; 2]>,
    /// They are being looked for: a large mesh takes seconds.
    task: Option<Task<Vec<[Vec3; 2]>>>,
}

pub fn plugin(app: &mut App) {
    app.add_plugins((shades::plugin, boxes::plugin, heat::plugin))
        .init_resource::<Seams>()
        .add_systems(Update, (draw_seams, draw_emitters, draw_wind, draw_probe))
        .add_panel(Place::Side, "Views", show);
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    shades::show(ui, world);
    ui.heading("Over the scene");
    boxes::show(ui, world);
    heat::show(ui, world);
    let seams = world.resource::<Seams>();
    let (edges, is_looking) = (seams.edges.len(), seams.task.is_some());
    let mut settings = world.resource_mut::<Settings>();
    let views = &mut settings.views;
    ui.checkbox(&mut views.seams, "uv seams").on_hover_text("Where the uvs of the selected surface break");
    if views.seams {
        let text = match (is_looking, edges > MOST_EDGES) {
            (true, _) => "being looked for".to_owned(),
            (false, false) => format!("{edges} edges"),
            (false, true) => format!("{edges} edges, of which {MOST_EDGES} are drawn"),
        };
        ui.small(text);
    }
    ui.checkbox(&mut views.emitters, "emitters").on_hover_text("Where they are and which way they point");
    ui.checkbox(&mut views.wind, "wind").on_hover_text("An arrow as long as it goes in a second");
}

fn draw_seams(
    settings: Res<Settings>,
    selected: Res<Selected>,
    surfaces: Query<(&GlobalTransform, &SurfaceCollider)>,
    mut seams: ResMut<Seams>,
    mut gizmos: Gizmos,
) {
    if !settings.views.seams {
        return;
    }
    let Some((transform, collider)) = selected.0.and_then(|surface| surfaces.get(surface).ok()) else {
        return;
    };
    if !seams.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, &collider.0)) {
        let mesh = collider.0.clone();
        let task = AsyncComputeTaskPool::get().spawn(async move { find_seams(mesh.triangles()) });
        *seams = Seams { of: Some(collider.0.clone()), edges: Vec::new(), task: Some(task) };
    }
    if let Some(edges) = seams.task.as_mut().and_then(check_ready) {
        (seams.edges, seams.task) = (edges, None);
    }
    for edge in seams.edges.iter().take(MOST_EDGES) {
        let [start, end] = edge.map(|corner| transform.transform_point(corner));
        gizmos.line(start, end, Color::srgb(1.0, 0.35, 0.1));
    }
}

/// Edges of one triangle only, and those whose two triangles have other uvs there.
fn find_seams(triangles: &MeshTriangles) -> Vec<[Vec3; 2]> {
    // Both zeros are one place.
    let key = |point: Vec3| (point + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut edges: BTreeMap<[[u32; 3]; 2], ([Vec3; 2], [Vec2; 2], u32, bool)> = BTreeMap::new();
    for (corners, uvs) in triangles.positions.iter().zip(&triangles.uvs) {
        for side in 0..3 {
            let (mut from, mut to) = (side, (side + 1) % 3);
            if key(corners[from]) > key(corners[to]) {
                (from, to) = (to, from);
            }
            let (ends, there) = ([corners[from], corners[to]], [uvs[from], uvs[to]]);
            let edge = edges.entry(ends.map(key)).or_insert((ends, there, 0, false));
            edge.2 += 1;
            edge.3 |= edge.1 != there;
        }
    }
    edges
        .into_values()
        .filter(|(_, _, count, breaks)| *count == 1 || *breaks)
        .map(|(ends, ..)| ends)
        .collect()
}

fn draw_emitters(
    settings: Res<Settings>,
    clock: Res<WeatheringClock>,
    emitters: Query<(&Emitter, &GlobalTransform, Option<&Stay>, Has<ByHand>), Without<RemovedEmitter>>,
    mut gizmos: Gizmos,
) {
    if !settings.views.emitters {
        return;
    }
    for (emitter, global, stay, is_by_hand) in &emitters {
        if !added::is_there(stay, is_by_hand, clock.tick()) {
            continue;
        }
        let transform = global.compute_transform();
        let color = if emitter.enabled { Color::srgb(0.3, 0.75, 1.0) } else { Color::srgb(0.45, 0.45, 0.5) };
        let (place, turn) = (transform.translation, transform.rotation);
        let mut way = transform.forward().as_vec3();
        match emitter.shape {
            EmitterShape::Sky { half_size } => {
                way = Vec3::NEG_Y;
                let lying = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
                gizmos.rect(Isometry3d::new(place, lying), half_size * 2.0, color);
            }
            EmitterShape::Box { half_size } => {
                gizmos.cube(global.mul_transform(Transform::from_scale(half_size * 2.0)), color);
            }
            EmitterShape::Cone { radius } | EmitterShape::Disc { radius } => {
                gizmos.circle(Isometry3d::new(place, turn), radius.max(0.01), color);
            }
            EmitterShape::Point => {
                gizmos.circle(Isometry3d::new(place, turn), 0.02, color);
            }
        }
        gizmos.arrow(place, place + way * 0.4, color);
    }
}

fn draw_wind(settings: Res<Settings>, weather: Res<Weather>, scene: Res<CollisionScene>, mut gizmos: Gizmos) {
    if !settings.views.wind || weather.wind == Vec3::ZERO || scene.is_empty() {
        return;
    }
    let (low, high) = scene.bounds();
    let start = ((low + high) * 0.5).with_y(high.y + 0.3);
    gizmos.arrow(start, start + weather.wind, Color::srgb(0.85, 0.6, 1.0));
}

fn draw_probe(settings: Res<Settings>, probed: Res<Probed>, mut gizmos: Gizmos) {
    let Some(hit) = probed.0.filter(|_| settings.tool == Tool::Probe) else { return };
    let turn = Quat::from_rotation_arc(Vec3::Z, hit.normal);
    let place = hit.point + hit.normal * 0.002;
    gizmos.circle(Isometry3d::new(place, turn), 0.02, Color::srgb(1.0, 0.9, 0.2));
    gizmos.line(place, place + hit.normal * 0.06, Color::srgb(1.0, 0.9, 0.2));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles of a square.
    fn square(second: [Vec2; 3]) -> MeshTriangles {
        let [a, b, c, d] = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 0.0, 1.0), Vec3::Z];
        MeshTriangles {
            positions: vec![[a, b, c], [a, c, d]],
            uvs: vec![[Vec2::ZERO, Vec2::X, Vec2::ONE], second],
            source: vec![0, 1],
            ..default()
        }
    }

    #[test]
    fn seams_are_where_uvs_break_and_where_the_mesh_ends() {
        // The rim of a square.
        assert_eq!(find_seams(&square([Vec2::ZERO, Vec2::ONE, Vec2::Y])).len(), 4);
        // Its diagonal, too.
        let far = [Vec2::ZERO, Vec2::ONE, Vec2::Y].map(|uv| uv + 3.0);
        assert_eq!(find_seams(&square(far)).len(), 5);
        assert!(find_seams(&MeshTriangles::default()).is_empty());
    }
}
