//! Boxes of BVHs: of each surface, level by level, and of all surfaces.
//!
//! Boxes of meshes at rest are found when the level or the surfaces change, those of posed ones in each frame. There may be more
//! than anybody could see, or draw: the selected surface comes first, and what is beyond [`MOST`] is left out.

use std::sync::Arc;

use bevy::math::bounding::Aabb3d;
use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::collision::{CollisionScene, DeformingCollider, MeshBvh, SurfaceCollider};

use super::selection::Selected;
use super::settings::Settings;

/// The most boxes that are drawn.
pub const MOST: usize = 2000;
/// The deepest level: a tree of a million triangles ends before it.
pub const DEEPEST: u32 = 10;
/// Levels of a binary tree that are about one of an eight-wide one.
const BINARY: u32 = 3;

/// Smallest and largest corner.
type Corners = (Vec3, Vec3);

/// What is drawn.
#[derive(Resource, Default)]
struct Boxes {
    level: u32,
    /// Rigid surfaces, the selected one first, and their boxes in the space of their mesh.
    rigid: Vec<(Entity, Arc<MeshBvh>, Vec<Corners>)>,
    /// How many there are in all.
    drawn: usize,
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Boxes>().add_systems(Update, draw);
}

/// The switch, the level, and how many there are.
pub fn show(ui: &mut egui::Ui, world: &mut World) {
    let drawn = world.resource::<Boxes>().drawn;
    let mut settings = world.resource_mut::<Settings>();
    let views = &mut settings.views;
    ui.checkbox(&mut views.boxes, "BVH boxes")
        .on_hover_text("What is looked through for hits: around each surface, and within it");
    if !views.boxes {
        return;
    }
    let level = ui.add(egui::Slider::new(&mut views.level, 0..=DEEPEST).text("level"));
    level.on_hover_text("0 is around a whole surface; each box holds up to eight of the next level");
    ui.small(format!("{drawn} boxes, of at most {MOST}; the selected surface comes first"));
}

type Surfaces<'w, 's> = Query<
    'w,
    's,
    (Entity, &'static GlobalTransform, &'static SurfaceCollider, Option<&'static DeformingCollider>),
>;

fn draw(
    settings: Res<Settings>,
    selected: Res<Selected>,
    scene: Res<CollisionScene>,
    surfaces: Surfaces,
    mut boxes: ResMut<Boxes>,
    mut order: Local<Vec<(Entity, Arc<MeshBvh>)>>,
    mut gizmos: Gizmos,
) {
    if !settings.views.boxes || scene.is_empty() {
        return;
    }
    let (level, boxes) = (settings.views.level, &mut *boxes);
    let is_posed = |deforming: Option<&DeformingCollider>| deforming.is_some_and(|it| it.posed().is_some());
    order.clear();
    order.extend(
        surfaces
            .iter()
            .filter(|(.., deforming)| !is_posed(*deforming))
            .map(|(entity, _, collider, _)| (entity, collider.0.clone())),
    );
    order.sort_unstable_by_key(|(entity, _)| (selected.0 != Some(*entity), *entity));
    let is_known = boxes.level == level
        && boxes.rigid.len() == order.len()
        && boxes
            .rigid
            .iter()
            .zip(order.iter())
            .all(|(known, now)| known.0 == now.0 && Arc::ptr_eq(&known.1, &now.1));
    if !is_known {
        boxes.level = level;
        boxes.rigid = within(MOST, order.drain(..), |mesh, most| mesh.boxes(level, most));
    }
    // They would keep meshes that have gone.
    order.clear();

    let color = Color::hsl(120.0 + 28.0 * level as f32, 0.75, 0.6);
    let mut drawn = 0;
    for (entity, _, of_surface) in &boxes.rigid {
        let Ok((_, transform, ..)) = surfaces.get(*entity) else { continue };
        for corners in of_surface {
            gizmos.aabb_3d(aabb(*corners), *transform, color);
        }
        drawn += of_surface.len();
    }
    for (_, transform, _, deforming) in &surfaces {
        let Some(posed) = deforming.and_then(DeformingCollider::posed) else { continue };
        let in_world = if posed.is_in_world() { GlobalTransform::IDENTITY } else { *transform };
        let of_surface = posed.boxes(level * BINARY, MOST.saturating_sub(drawn));
        for corners in &of_surface {
            gizmos.aabb_3d(aabb(*corners), in_world, color);
        }
        drawn += of_surface.len();
    }
    boxes.drawn = drawn;
    gizmos.aabb_3d(aabb(scene.bounds()), Transform::IDENTITY, Color::srgb(0.9, 0.9, 0.3));
}

/// Boxes of one surface after the other, until there are `most` of them.
fn within(
    most: usize,
    surfaces: impl Iterator<Item = (Entity, Arc<MeshBvh>)>,
    of: impl Fn(&MeshBvh, usize) -> Vec<Corners>,
) -> Vec<(Entity, Arc<MeshBvh>, Vec<Corners>)> {
    let mut left = most;
    surfaces
        .map(|(entity, mesh)| {
            let boxes = if left > 0 { of(&mesh, left) } else { Vec::new() };
            left = left.saturating_sub(boxes.len());
            (entity, mesh, boxes)
        })
        .collect()
}

fn aabb((min, max): Corners) -> Aabb3d {
    Aabb3d { min: min.into(), max: max.into() }
}

#[cfg(test)]
mod tests {
    use bevy_weathering::collision::MeshTriangles;

    use super::*;

    #[test]
    fn there_are_never_too_many_and_the_first_comes_first() {
        let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
        let mesh = Arc::new(MeshBvh::build(MeshTriangles::from_mesh(&mesh).unwrap()));
        let surfaces = [1, 2, 3].map(|index| (Entity::from_raw_u32(index).unwrap(), mesh.clone()));
        let some = |_: &MeshBvh, most: usize| vec![(Vec3::ZERO, Vec3::ONE); most.min(4)];
        let counts = |most| {
            let boxes = within(most, surfaces.clone().into_iter(), some);
            boxes.iter().map(|(_, _, boxes)| boxes.len()).collect::<Vec<_>>()
        };
        assert_eq!(counts(100), [4, 4, 4]);
        assert_eq!(counts(6), [4, 2, 0]);
        assert_eq!(counts(0), [0, 0, 0]);
        // With a real tree.
        let boxes = within(MOST, surfaces.into_iter(), |mesh, most| mesh.boxes(0, most));
        assert!(boxes.iter().all(|(_, mesh, boxes)| *boxes == [mesh.bounds()]));
    }
}
