//! Materials of surfaces that are exchanged for weathered ones, and given back, in an app that weathers whatever comes.

use bevy::prelude::*;
use bevy_weathering::material::WeatheredMaterial;
use bevy_weathering::prelude::*;

use super::app::{app, update, update_until};

/// As in `docs/start.md`.
fn weather_all(
    added: On<Add, MeshMaterial3d<StandardMaterial>>,
    new: Query<(), (Without<Weatherable>, Without<DryMaterial>)>,
    mut commands: Commands,
) {
    if new.contains(added.entity) {
        commands.entity(added.entity).insert(Weatherable::default());
    }
}

#[test]
fn a_material_that_is_exchanged_or_given_back_is_no_new_surface() {
    let Some(mut app) = app() else { return };
    app.add_observer(weather_all);
    let world = app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::new(1.0, 1.0));
    let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
    let [first, second] =
        [Color::WHITE, Color::BLACK].map(|color| materials.add(StandardMaterial::from(color)));
    let maps = Weatherable { map_size: 64, ..default() };
    let surface = world.spawn((Mesh3d(mesh.clone()), MeshMaterial3d(first.clone()), maps)).id();
    let stranger = world.spawn((Mesh3d(mesh), MeshMaterial3d(first.clone()))).id();
    let is_shown = |world: &World, entity: Entity, material: &Handle<StandardMaterial>| {
        world.get::<DryMaterial>(entity).is_some_and(|dry| dry.0 == *material)
            && world.get::<MeshMaterial3d<WeatheredMaterial>>(entity).is_some()
    };
    update_until(&mut app, "the materials to be exchanged", |world| {
        is_shown(world, surface, &first) && is_shown(world, stranger, &first)
    });
    assert_eq!(app.world().get::<Weatherable>(surface), Some(&maps));
    assert_eq!(app.world().get::<Weatherable>(stranger), Some(&Weatherable::default()));

    app.world_mut().entity_mut(surface).insert(MeshMaterial3d(second.clone()));
    update(&mut app);
    assert!(is_shown(app.world(), surface, &second));
    assert_eq!(app.world().get::<Weatherable>(surface), Some(&maps));

    app.world_mut().entity_mut(surface).remove::<Weatherable>();
    update(&mut app);
    update(&mut app);
    let surface = app.world().entity(surface);
    assert!(!surface.contains::<Weatherable>() && !surface.contains::<DryMaterial>());
    assert!(!surface.contains::<MeshMaterial3d<WeatheredMaterial>>());
    let own = surface.get::<MeshMaterial3d<StandardMaterial>>();
    assert_eq!(own.map(|own| &own.0), Some(&second));
}
