//! The library as a Bevy app meets it: what is built in, what is told, where its documentation leads.

use std::any::TypeId;
use std::path::Path;

use bevy::app::PluginGroupBuilder;
use bevy::asset::{AssetPlugin, RenderAssetUsages};
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use bevy::reflect::serde::TypedReflectDeserializer;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::brush::BrushPlugin;
use bevy_weathering::collision::TriangleError;
use bevy_weathering::effect::ShippedEffect;
use bevy_weathering::emitter::{EmitterPlugin, EmitterState, NewParticles, NotEmitting};
use bevy_weathering::material::{DryMaterial, PorousMaterialPlugin};
use bevy_weathering::matter::{MatterPlugin, MatterQueue};
use bevy_weathering::overlay::{MapPool, Overlays, SurfaceTotals, TexelArea};
use bevy_weathering::overload::OverloadDiagnosticsPlugin;
use bevy_weathering::particle::{Lifespan, Particle, ParticleDrawPlugin, Particles, WaterCounts};
use bevy_weathering::prelude::*;
use bevy_weathering::unwrap::UnwrapPlugin;
use bevy_weathering::weather::WeatherPlugin;
use bevy_weathering::wetting::gpu::WaterUploadPlugin;
use bevy_weathering::wetting::{DripEffect, Refusal, SurfaceWater, WettingPlugin};
use serde::de::DeserializeSeed;

use crate::gpu::app::{bare_app, update, update_until};
use crate::wetting::scene::Scene;

fn update_for(scene: &mut Scene, frames: u32) {
    for _ in 0..frames {
        scene.0.update();
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

fn load(scene: &Scene, path: &'static str) -> Handle<WeatherEffect> {
    scene.0.world().resource::<AssetServer>().load(path)
}

/// Loads an effect that is there.
fn loaded(scene: &mut Scene, path: &'static str) -> Handle<WeatherEffect> {
    let handle = load(scene, path);
    scene.wait_until(path, |scene| scene.0.world().resource::<Assets<WeatherEffect>>().contains(&handle));
    handle
}

#[test]
fn shipped_effects_are_there_without_a_renderer_and_without_copies() {
    let mut scene = Scene::new(60);
    for shipped in ShippedEffect::ALL {
        let handle = loaded(&mut scene, shipped.path);
        let effects = scene.0.world().resource::<Assets<WeatherEffect>>();
        assert_eq!(effects.get(&handle), shipped.read().ok().as_ref(), "{}", shipped.name);
    }
}

/// 36 mm/h on 2 m by 2 m are 40 ml/s.
#[test]
fn rain_brings_as_much_as_it_says_and_the_floor_gets_it() {
    let mut scene = Scene::new(60);
    let plane = Plane3d::new(Vec3::Y, Vec2::splat(1.0));
    let floor = scene.surface(plane.into(), 128, PorousMaterial::SAND, Transform::IDENTITY);
    let rain = Emitter::rain(loaded(&mut scene, WeatherEffect::RAIN), 36.0, Vec2::splat(1.0));
    let sky = scene.0.world_mut().spawn((rain, Transform::from_xyz(0.0, 1.0, 0.0))).id();
    // It has a place in the world and a row among effects from the next frame on.
    scene.run(1);
    let emitted = |scene: &Scene| scene.0.world().resource::<WaterCounts>().emitted_nl as f64 * 1e-6;
    let before = emitted(&scene);
    scene.run(600);
    let fallen = emitted(&scene) - before;
    assert!((fallen / 400.0 - 1.0).abs() < 0.01, "{fallen} ml");

    scene.0.world_mut().entity_mut(sky).despawn();
    scene.run(180);
    let over = scene.over(floor);
    // Some of what is thrown up comes down beside it.
    let (got, sent) = (f64::from(over.film_ml + over.absorbed_ml), emitted(&scene));
    assert!(got > 0.85 * sent && got < 1.001 * sent, "{got} of {sent} ml");
}

/// Transforms are propagated at the end of the frame.
#[test]
fn an_emitter_that_comes_between_two_ticks_of_a_frame_sends_from_where_it_is() {
    let mut scene = Scene::new(60);
    let emitter = Emitter { effect: loaded(&mut scene, WeatherEffect::RAIN), rate: 6000.0, ..default() };
    let first = scene.0.world_mut().spawn(emitter.clone()).id();
    // Its effect has a row from then on.
    scene.run(1);
    scene.run(1);
    let world = scene.0.world_mut();
    world.entity_mut(first).despawn();
    assert!(!world.resource::<Particles>().is_empty());
    world.resource_mut::<Particles>().clear();

    let at = |x: f32| Transform::from_xyz(x, 0.0, 0.0);
    let parent = world.spawn(at(50.0)).id();
    world.spawn((emitter, at(20.0), ChildOf(parent)));
    world.run_schedule(WeatheringTick);
    let particles = world.resource::<Particles>();
    assert!(particles.len() > 50, "{}", particles.len());
    for position in particles.positions() {
        assert!(position.distance(Vec3::X * 70.0) < 1.0, "{position}");
    }
}

#[test]
fn an_emitter_whose_effect_cannot_be_had_is_marked_until_it_has_another() {
    let mut scene = Scene::new(60);
    // A file that is not there, and one that is no effect.
    for path in ["effects/none.effect.ron", "CREDITS.md"] {
        let effect = load(&scene, path);
        let id = effect.id();
        let emitter = scene.0.world_mut().spawn(Emitter { effect, ..default() }).id();
        scene.wait_for::<NotEmitting>(emitter);
        assert_eq!(scene.0.world().get::<NotEmitting>(emitter), Some(&NotEmitting(id)), "{path}");

        let mud = loaded(&mut scene, WeatherEffect::MUD);
        scene.0.world_mut().get_mut::<Emitter>(emitter).unwrap().effect = mud;
        scene.wait_until("no mark", |scene| scene.0.world().get::<NotEmitting>(emitter).is_none());
        scene.run(1);
        scene.run(60);
        assert!(scene.0.world().get::<EmitterState>(emitter).unwrap().emitted > 0, "{path}");
        scene.0.world_mut().entity_mut(emitter).despawn();
    }
}

/// What was told about surfaces.
#[derive(Resource, Default)]
struct Told {
    ready: Vec<Entity>,
    refused: Vec<SurfaceRefused>,
}

fn listen(
    mut ready: MessageReader<SurfaceReady>,
    mut refused: MessageReader<SurfaceRefused>,
    mut told: ResMut<Told>,
) {
    told.ready.extend(ready.read().map(|message| message.surface));
    told.refused.extend(refused.read());
}

fn listening() -> Scene {
    let mut scene = Scene::new(60);
    scene.0.init_resource::<Told>().add_systems(Update, listen);
    scene
}

fn spawn(scene: &mut Scene, mesh: Mesh) -> Entity {
    let mesh = scene.0.world_mut().resource_mut::<Assets<Mesh>>().add(mesh);
    let maps = Weatherable { map_size: 64, ..default() };
    scene.0.world_mut().spawn((maps, Mesh3d(mesh), Transform::default())).id()
}

fn plane() -> Mesh {
    Plane3d::new(Vec3::Y, Vec2::ONE).into()
}

#[test]
fn surfaces_tell_once_that_they_are_ready_or_refused() {
    let mut scene = listening();
    let floor = spawn(&mut scene, plane());
    let line = Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, vec![[0.0, 0.0], [1.0, 0.0]]);
    let line = spawn(&mut scene, line);
    scene.wait_until("messages", |scene| {
        let told = scene.0.world().resource::<Told>();
        !told.ready.is_empty() && !told.refused.is_empty()
    });
    // It turns, and is measured again.
    scene.0.world_mut().get_mut::<Transform>(floor).unwrap().rotate_x(0.7);
    update_for(&mut scene, 200);
    let told = scene.0.world().resource::<Told>();
    assert_eq!(told.ready, [floor]);
    let [refused] = told.refused[..] else { panic!("{:?}", told.refused) };
    assert_eq!(refused.surface, line);
    assert!(matches!(refused.reason, Refusal::Mesh(_)), "{}", refused.reason);

    // What it says is true: water stays.
    scene.pour(floor, Vec2::splat(0.5), 8, 40_000_000);
    scene.run(2);
    let over = scene.over(floor);
    assert!(over.film_ml + over.absorbed_ml > 35.0, "{over:?}");

    // One that is made weatherable again is ready again.
    scene.0.world_mut().entity_mut(floor).remove::<Weatherable>();
    scene.0.update();
    scene.0.world_mut().entity_mut(floor).insert(Weatherable { map_size: 64, ..default() });
    scene.wait_until("the second time", |scene| scene.0.world().resource::<Told>().ready == [floor, floor]);
}

#[test]
fn a_surface_without_room_for_its_maps_is_refused() {
    let mut scene = listening();
    scene.0.world_mut().resource_mut::<MapBudget>().bytes = 1;
    let floor = spawn(&mut scene, plane());
    scene.wait_until("a refusal", |scene| !scene.0.world().resource::<Told>().refused.is_empty());
    let told = scene.0.world().resource::<Told>();
    assert_eq!(told.refused[0], SurfaceRefused { surface: floor, reason: Refusal::NoRoom });
    assert!(told.ready.is_empty());
}

#[test]
fn a_surface_without_a_mesh_is_refused_and_takes_no_room_until_it_has_one() {
    let mut scene = listening();
    let maps = Weatherable { map_size: 64, ..default() };
    let root = scene.0.world_mut().spawn((maps, Transform::default())).id();
    let reserved = |scene: &Scene| scene.0.world().resource::<MapPool>().reserved;
    for _ in 0..5 {
        scene.0.update();
        assert_eq!(reserved(&scene), 0);
    }
    let refusal = SurfaceRefused { surface: root, reason: Refusal::Mesh(TriangleError::NoMesh) };
    assert_eq!(scene.0.world().resource::<Told>().refused, [refusal]);

    let mesh = Mesh3d(scene.0.world_mut().resource_mut::<Assets<Mesh>>().add(plane()));
    scene.0.world_mut().entity_mut(root).insert(mesh);
    scene.wait_until("a mesh", |scene| scene.0.world().resource::<Told>().ready == [root]);
    assert!(reserved(&scene) > 0);
    assert_eq!(scene.0.world().resource::<Told>().refused, [refusal]);
}

#[test]
fn a_mesh_that_comes_right_after_its_surface_is_no_refusal() {
    let mut scene = listening();
    // It has been running for a while.
    update_for(&mut scene, 3);
    let maps = Weatherable { map_size: 64, ..default() };
    let late = scene.0.world_mut().spawn((maps, Transform::default())).id();
    scene.0.update();
    let mesh = Mesh3d(scene.0.world_mut().resource_mut::<Assets<Mesh>>().add(plane()));
    scene.0.world_mut().entity_mut(late).insert(mesh);
    scene.wait_until("a mesh", |scene| scene.0.world().resource::<Told>().ready == [late]);
    assert!(scene.0.world().resource::<Told>().refused.is_empty());
}

/// Inspectors, scene files and remote protocols begin with the default, and set what they are told.
#[test]
fn what_can_be_reflected_has_a_default_or_is_nothing_without_its_values() {
    const WITHOUT: [&str; 24] = [
        // What the library tells, or notes on entities.
        "BecameWet",
        "Dried",
        "DryMaterial",
        "Impact",
        "MapSize",
        "NotEmitting",
        "Overlays",
        "SurfaceEvicted",
        "SurfaceImpact",
        "SurfaceReady",
        "SurfaceResized",
        "Understudy",
        "Unmapped",
        // What particles and shaders are made of.
        "EffectIndex",
        "Lifespan",
        "ModelKind",
        "PorousExtension",
        "PorousKey",
        "Sequence",
        // None of their kinds is more usual than another.
        "Brush",
        "BrushKind",
        "MatterKind",
        "StampKind",
        "Stroke",
    ];
    let scene = Scene::new(60);
    let registry = scene.0.world().resource::<AppTypeRegistry>().read();
    let lacking: Vec<&str> = registry
        .iter()
        .filter(|registration| !registration.contains::<ReflectDefault>())
        .map(|registration| registration.type_info().type_path())
        .filter(|path| path.starts_with("bevy_weathering::"))
        .filter(|path| path.rsplit("::").next().is_some_and(|name| !WITHOUT.contains(&name)))
        .collect();
    assert!(lacking.is_empty(), "{lacking:?}");

    let registration = registry.get(TypeId::of::<Weatherable>()).unwrap();
    let mut json = serde_json::Deserializer::from_str(r#"{"map_size": 256}"#);
    let told = TypedReflectDeserializer::new(registration, &registry).deserialize(&mut json).unwrap();
    assert_eq!(Weatherable::from_reflect(&*told), Some(Weatherable { map_size: 256, ..default() }));
}

/// Everything but one part.
fn all_but<P: Plugin>() -> PluginGroupBuilder {
    WeatheringPlugins.build().disable::<P>()
}

/// A drop that nobody emits, 10 cm above the origin.
fn let_fall(scene: &mut Scene) {
    let effect = scene.0.world().resource::<DripEffect>().rows.unwrap()[0];
    scene.0.world_mut().resource_mut::<NewParticles>().push(|sequence| Particle {
        position: Vec3::Y * 0.1,
        velocity: Vec3::NEG_Y,
        lifespan: Lifespan { ticks_left: 60, born_at: 0 },
        volume_nl: 25_000,
        sequence,
        effect,
        class: 0,
    });
}

#[test]
fn what_can_be_left_out_leaves_surfaces_that_get_wet() {
    for (without, parts) in [
        ("weather", all_but::<WeatherPlugin>()),
        ("emitters", all_but::<EmitterPlugin>()),
        ("unwrapping", all_but::<UnwrapPlugin>()),
        ("matter", all_but::<MatterPlugin>()),
        ("brushes", all_but::<BrushPlugin>()),
        ("diagnostics", all_but::<OverloadDiagnosticsPlugin>()),
    ] {
        let mut scene = Scene::with_parts(parts, AssetPlugin::default());
        let floor = scene.surface(plane(), 64, PorousMaterial::SAND, Transform::IDENTITY);
        scene.pour(floor, Vec2::splat(0.25), 8, 40_000_000);
        let_fall(&mut scene);
        scene.run(60);
        let over = scene.over(floor);
        assert!(over.film_ml + over.absorbed_ml > 35.0, "without {without}: {over:?}");
        assert!(scene.0.world().get::<SurfaceTotals>(floor).unwrap().impacts > 0, "without {without}");
        assert!(scene.0.world().resource::<Particles>().is_empty(), "without {without}");
    }
}

#[test]
fn without_water_nothing_waits_for_it() {
    let mut scene = Scene::with_parts(all_but::<WettingPlugin>(), AssetPlugin::default());
    let floor = spawn(&mut scene, plane());
    scene.wait_for::<TexelArea>(floor);
    let dust = loaded(&mut scene, WeatherEffect::DUST);
    let sky = Emitter::dust(dust, 10.0, Vec2::splat(0.5));
    scene.0.world_mut().spawn((sky, Transform::from_xyz(0.0, 0.2, 0.0)));
    scene.run(1);
    scene.run(300);
    let queued = scene.0.world().get::<MatterQueue>(floor).map_or(0, |queue| queue.0.len());
    assert!(scene.0.world().get::<SurfaceTotals>(floor).unwrap().impacts > 0);
    assert_eq!(queued, 0);
}

#[test]
fn what_can_be_left_out_is_not_needed_for_drawing() {
    let bare = WeatheringPlugins
        .build()
        .disable::<WeatherPlugin>()
        .disable::<EmitterPlugin>()
        .disable::<UnwrapPlugin>()
        .disable::<MatterPlugin>()
        .disable::<BrushPlugin>()
        .disable::<OverloadDiagnosticsPlugin>();
    for (parts, is_exchanged) in [
        (bare, true),
        (all_but::<WettingPlugin>(), true),
        (all_but::<WaterUploadPlugin>(), true),
        (all_but::<ParticleDrawPlugin>(), true),
        (all_but::<PorousMaterialPlugin>(), false),
    ] {
        let Some(mut app) = bare_app() else { return };
        app.add_plugins(parts).insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
        app.finish();
        app.cleanup();
        let world = app.world_mut();
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(Color::WHITE);
        let mesh = world.resource_mut::<Assets<Mesh>>().add(plane());
        let maps = Weatherable { map_size: 64, ..default() };
        let surface = world.spawn((Mesh3d(mesh), MeshMaterial3d(material), maps)).id();
        update_until(&mut app, "its maps", |world| {
            let is_wettable = world.get::<SurfaceWater>(surface).is_some();
            world.get::<Overlays>(surface).is_some()
                && (is_wettable || !world.contains_resource::<DripEffect>())
        });
        for _ in 0..3 {
            update(&mut app);
        }
        assert_eq!(app.world().get::<DryMaterial>(surface).is_some(), is_exchanged);
    }
}

/// Markdown's definitions of links: label and target.
fn definitions(text: &str) -> Vec<(&str, &str)> {
    let pairs = text.lines().filter_map(|line| line.strip_prefix('[')?.split_once("]: "));
    // Else it is a link with a colon behind it.
    pairs.filter(|(label, _)| !label.contains(']')).collect()
}

/// The README is the front page of the crate's documentation, from where a path in the repository leads nowhere.
#[test]
fn links_of_the_readme_lead_somewhere_from_anywhere() {
    const README: &str = include_str!("../README.md");
    const LIB: &str = include_str!("../src/lib.rs");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    // Only pictures stand inline: they are seen where the README is read as a file.
    let inline = README.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    for target in inline.filter(|target| !target.starts_with("http")) {
        let is_picture = target.starts_with("docs/pictures/") && root.join(target).is_file();
        assert!(is_picture, "{target} only leads somewhere from the repository");
    }
    let relative = definitions(README);
    let head = LIB.split("#![doc").next().unwrap_or_default().replace("//! ", "");
    let absolute = definitions(&head);
    assert!(relative.len() > 5);
    let labels = |all: &[(&str, &str)]| all.iter().map(|(label, _)| (*label).to_owned()).collect::<Vec<_>>();
    assert_eq!(labels(&relative), labels(&absolute));
    for ((label, file), (_, address)) in relative.iter().zip(&absolute) {
        assert!(README.contains(&format!("][{label}]")), "{label} is not used");
        assert!(root.join(file).is_file(), "{file}");
        assert!(address.starts_with("https://") && address.ends_with(&format!("/main/{file}")), "{address}");
    }
}

#[test]
fn every_asset_is_credited_and_nothing_else() {
    const CREDITS: &str = include_str!("../assets/CREDITS.md");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    let (mut folders, mut count) = (vec![root.clone()], 0);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let name = path.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
            if name != "CREDITS.md" {
                assert!(CREDITS.contains(&format!("| `{name}` |")), "{name}");
                count += 1;
            }
        }
    }
    let credited = CREDITS.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
    let credited: Vec<&str> = credited.collect();
    assert_eq!(credited.len(), count);
    for name in credited {
        assert!(root.join(name).is_file(), "{name}");
    }
}
