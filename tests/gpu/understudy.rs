//! A surface whose shader changes is never out of sight.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::material::{DryMaterial, PorousMaterial, Understudy, WeatheredMaterial, WettingModel};
use bevy_weathering::overlay::{Overlays, Weatherable};

use super::app::{add_target, app_that_compiles_in_the_background, camera, cover, picture, still, update};
use super::images::keep;

const SIZE: UVec2 = UVec2::new(64, 64);

/// Whether the middle of the picture shows the red surface and not the black behind it.
fn seen(app: &mut App, target: &Handle<Image>) -> bool {
    let picture = picture(app, target);
    let middle = picture[(SIZE.x / 2, SIZE.y / 2)].0;
    if middle[0] < 20 {
        keep("understudy", &[("gone", &picture)]);
    }
    middle[0] >= 20
}

#[test]
fn surfaces_stay_in_sight_when_they_are_exchanged_when_the_first_water_comes_and_when_the_model_changes() {
    let Some(mut app) = app_that_compiles_in_the_background() else { return };
    let target = add_target(&mut app, SIZE);
    let world = app.world_mut();
    world.insert_resource(ClearColor(Color::BLACK));
    world.spawn(camera(&target, Vec3::Z * 2.0, Vec3::ZERO));
    world.spawn((DirectionalLight::default(), Transform::default().looking_to(Vec3::NEG_Z, Vec3::Y)));
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(Color::srgb(0.9, 0.1, 0.1));
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::new(3.0, 3.0));
    let surface = world.spawn((Mesh3d(mesh), MeshMaterial3d(material))).id();
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    // Bevy's own material has no one to stand in for it.
    let mut frames = 0;
    while picture(&mut app, &target)[(SIZE.x / 2, SIZE.y / 2)].0[0] < 20 {
        frames += 1;
        assert!(frames < 2000, "never drawn");
    }

    let maps = Weatherable { map_size: 64, ..default() };
    app.world_mut().entity_mut(surface).insert((maps, still(1.0)));
    let is_exchanged = |world: &World| world.get::<DryMaterial>(surface).is_some();
    let mut frames = 0;
    while !is_exchanged(app.world()) || app.world().get::<Overlays>(surface).is_none() {
        frames += 1;
        assert!(frames < 2000, "never exchanged");
        assert!(seen(&mut app, &target), "the surface is gone before it is exchanged");
    }
    for _ in 0..30 {
        assert!(seen(&mut app, &target), "the surface is gone since it was exchanged");
    }

    let model_of = |app: &App| {
        let material = app.world().get::<MeshMaterial3d<WeatheredMaterial>>(surface).unwrap();
        app.world().resource::<Assets<WeatheredMaterial>>().get(material).unwrap().extension.key
    };
    let until_changed = |app: &mut App| {
        let before = model_of(app);
        for _ in 0..600 {
            update(app);
            let mut understudies = app.world_mut().query::<&Understudy>();
            assert!(understudies.iter(app.world()).count() <= 1);
            assert!(seen(app, &target), "the surface is gone");
            if model_of(app) != before {
                let mut understudies = app.world_mut().query::<&Understudy>();
                assert_eq!(understudies.iter(app.world()).count(), 0);
                return;
            }
        }
        panic!("the shader was never exchanged");
    };
    cover(&mut app, surface, 0.0, 1.0);
    until_changed(&mut app);
    assert!(model_of(&app).water);
    for model in [WettingModel::Twomey(default()), WettingModel::Lagarde(default())] {
        app.world_mut().get_mut::<PorousMaterial>(surface).unwrap().model = model;
        until_changed(&mut app);
    }
}
