//! The bunny is drawn from all around with marks and with water on it, and no seam between its uv islands is to be seen: what
//! lies on either side of one differs no more than on either side of any other edge. All seams are looked at. Seams that
//! are made on purpose are found by the same measure.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use bevy::camera::ScalingMode;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::EnvironmentMapLight;
use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::collision::MeshTriangles;
use bevy_weathering::effect::Paint;
use bevy_weathering::material::{DryMaterial, Tweaked};
use bevy_weathering::overlay::{Overlays, SurfaceFrames, SurfaceTotals};
use bevy_weathering::prelude::*;
use bevy_weathering::wetting::{TexelGeometry, WetGeometry};
use image::RgbImage;

use super::app::{add_target, app, camera, picture, still, update, update_until};
use super::edges::{Comparison, DISTANCE, Differences, Measure, SIDE, SPAN, Sight, views};
use super::images::keep;
use super::splat::painted;
use crate::seams::{MIDDLE, SIZE, bunny, edges, is_seam, mesh_of, throw};

/// By how much seams may differ more than other edges, of 255, under marks in colour.
const MOST_PAINTED: Differences =
    Differences { apart: Measure { mean: 2.0, high: 6.0 }, line: Measure { mean: 1.0, high: 3.0 } };

/// The same under water. Texels on either side of a border between turned islands lie askew to each other, and each holds an amount
/// of its own: that is in `line`.
const MOST_WET: Differences =
    Differences { apart: Measure { mean: 2.0, high: 6.0 }, line: Measure { mean: 2.0, high: 6.0 } };

/// A seam that is there on purpose differs by so many times as much as one may.
const FOUND: f32 = 2.0;

/// How much other edges differ at least in the mean, of 255: less, and next to nothing is to be seen.
const LEAST_TO_BE_SEEN: f32 = 3.0;

/// Points of seams that are looked at, at least.
const LEAST_POINTS: usize = 5000;

/// The part of all seams that may be hidden from all eyes.
const MOST_UNSEEN: f32 = 0.005;

/// How much darker a hair along all seams is, of 255.
const HAIR: u8 = 24;

/// Where the two bunnies of a picture stand: none is where anything flies by the other.
const PLACES: [Vec3; 2] = [Vec3::ZERO, Vec3::new(7.0, 5.0, 9.0)];

/// Where what is thrown at them comes from.
const SIDES: [Vec3; 6] = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];

/// Ticks for which it is thrown, four seconds.
const TICKS: u32 = 240;

/// Ticks until all that missed is gone: more than an emitter's particles live.
const TICKS_TO_CLEAR: u32 = 320;

/// All eyes, and what they see of the edges of a bunny at the origin.
fn sight() -> &'static (Vec<Transform>, Sight) {
    static SIGHT: OnceLock<(Vec<Transform>, Sight)> = OnceLock::new();
    SIGHT.get_or_init(|| {
        let eyes = views(MIDDLE);
        let sight = Sight::new(&bunny(), &eyes);
        (eyes, sight)
    })
}

/// Two white bunnies in white light from everywhere, by which no shape is to be seen.
struct Studio {
    app: App,
    target: Handle<Image>,
    eye: Entity,
    bunnies: [Entity; 2],
}

impl Studio {
    /// With stamps that lie on each of the bunnies in this way.
    fn new(stamps: [StampSpace; 2], porous: PorousMaterial) -> Option<Self> {
        let mut app = app()?;
        let target = add_target(&mut app, UVec2::splat(SIDE));
        let world = app.world_mut();
        world.resource_mut::<Weather>().drying_speed = 0.0;
        let sky = EnvironmentMapLight {
            intensity: 1000.0,
            ..EnvironmentMapLight::solid_color(&mut world.resource_mut::<Assets<Image>>(), Color::WHITE)
        };
        let eye = (
            camera(&target, Vec3::Z, Vec3::ZERO),
            Tonemapping::None,
            Projection::from(OrthographicProjection {
                scaling_mode: ScalingMode::Fixed { width: SPAN, height: SPAN },
                far: 2.0 * DISTANCE,
                ..OrthographicProjection::default_3d()
            }),
            sky,
        );
        let eye = world.spawn(eye).id();
        let triangles = bunny();
        let mesh = mesh_of(&triangles).with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals(&triangles));
        let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
            base_color: Color::linear_rgb(0.8, 0.8, 0.8),
            perceptual_roughness: 1.0,
            reflectance: 0.0,
            ..default()
        });
        let bunnies = [0, 1].map(|number: usize| {
            let maps = Weatherable {
                map_size: SIZE,
                wrap_u: Wrap::Clamp,
                wrap_v: Wrap::Clamp,
                stamps: stamps[number],
                ..default()
            };
            let look = (Mesh3d(mesh.clone()), MeshMaterial3d(material.clone()));
            world.spawn((look, Transform::from_translation(PLACES[number]), maps, porous)).id()
        });
        let mut studio = Self { app, target, eye, bunnies };
        studio.open_eye(false);
        update_until(&mut studio.app, "the maps and materials", |world| {
            bunnies.iter().all(|&bunny| {
                world.get::<Overlays>(bunny).is_some()
                    && world.get::<DryMaterial>(bunny).is_some()
                    && world.get::<WetGeometry>(bunny).is_some()
            })
        });
        Some(studio)
    }

    /// Frames that nobody looks at are not drawn.
    fn open_eye(&mut self, is_active: bool) {
        self.app.world_mut().get_mut::<Camera>(self.eye).unwrap().is_active = is_active;
    }

    fn run(&mut self, mut ticks: u32) {
        while ticks > 0 {
            // Time would be cut short in longer frames.
            let in_frame = ticks.min(10);
            self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(in_frame));
            update(&mut self.app);
            ticks -= in_frame;
        }
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    }

    /// Throws the same at both bunnies from all sides, so many particles a second from each, and waits until all has come to rest.
    fn throw(&mut self, effect: WeatherEffect, rate: f32) {
        let paints = effect.paints();
        let world = self.app.world_mut();
        let effect = world.resource_mut::<Assets<WeatherEffect>>().add(effect);
        for at in PLACES {
            throw(world, &SIDES, at + MIDDLE, &effect, rate);
        }
        // The effect is asked for in the first tick; then the frames are measured.
        self.run(1);
        let first = self.bunnies[0];
        update_until(&mut self.app, "the frames", |world| {
            !paints || world.get::<SurfaceFrames>(first).is_some()
        });
        self.run(TICKS);
        let world = self.app.world_mut();
        world.query::<&mut Emitter>().iter_mut(world).for_each(|mut emitter| emitter.enabled = false);
        self.run(TICKS_TO_CLEAR);
        let world = self.app.world();
        let impacts = self.bunnies.map(|bunny| world.get::<SurfaceTotals>(bunny).unwrap().impacts);
        assert!(impacts.iter().all(|&impacts| impacts > 200), "{impacts:?} impacts");
        if paints {
            painted(&mut self.app, impacts.iter().sum());
        }
    }

    /// One of the bunnies, from all eyes.
    fn pictures(&mut self, number: usize) -> Vec<RgbImage> {
        self.open_eye(true);
        let mut pictures = Vec::new();
        for (view, eye) in sight().0.iter().enumerate() {
            *self.app.world_mut().get_mut::<Transform>(self.eye).unwrap() =
                eye.with_translation(eye.translation + PLACES[number]);
            if view == 0 {
                // What has never been drawn comes with the first frames.
                (0..3).for_each(|_| update(&mut self.app));
            }
            pictures.push(picture(&mut self.app, &self.target));
        }
        self.open_eye(false);
        pictures
    }
}

/// Normals at the vertices of [`mesh_of`]: means of the triangles around each point, whatever their islands, so that no shading tells
/// seams from other edges.
fn normals(triangles: &MeshTriangles) -> Vec<[f32; 3]> {
    let bits = |corner: Vec3| (corner + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut around = BTreeMap::<[u32; 3], Vec3>::new();
    for corners in &triangles.positions {
        let [a, b, c] = *corners;
        for &corner in corners {
            *around.entry(bits(corner)).or_default() += (b - a).cross(c - a);
        }
    }
    let normal = |&corner: &Vec3| around[&bits(corner)].normalize_or(Vec3::Y).to_array();
    triangles.positions.iter().flatten().map(normal).collect()
}

/// The bunny with its uv islands torn apart in space, so that none has a neighbour.
fn torn(triangles: &MeshTriangles) -> MeshTriangles {
    let pairs = edges(triangles).into_iter().filter(|sides| !is_seam(sides));
    let pairs: Vec<[usize; 2]> = pairs.map(|[a, b]| [a.triangle, b.triangle]).collect();
    // The least number of all triangles that hang together.
    let mut islands: Vec<usize> = (0..triangles.positions.len()).collect();
    loop {
        let before = islands.clone();
        for &[a, b] in &pairs {
            let least = islands[a].min(islands[b]);
            (islands[a], islands[b]) = (least, least);
        }
        if islands == before {
            break;
        }
    }
    let mut firsts = islands.clone();
    firsts.sort_unstable();
    firsts.dedup();
    let mut torn = triangles.clone();
    for (corners, island) in torn.positions.iter_mut().zip(islands) {
        let number = firsts.partition_point(|&first| first < island);
        corners.iter_mut().for_each(|corner| corner.x += 2.0 * number as f32);
    }
    torn
}

/// That no seam is to be seen on one bunny, and that those on the other, and hairs along those of the first, are found.
fn check(name: &str, right: &[RgbImage], wrong: &[RgbImage], most: &Differences) {
    let (_, sight) = sight();
    let hairy = sight.with_hairs(right, HAIR);
    let all = [("seamless", right), ("with seams", wrong), ("with hairs", &hairy[..])];
    let seen = all.map(|(_, pictures)| sight.compare(pictures));
    for ((which, _), seen) in all.iter().zip(&seen) {
        println!("{name}, {which}: {seen:?}");
    }
    let [seamless, seams, hairs] = seen.map(|seen| seen.beyond_others());
    let is_shown =
        |seen: &Comparison| seen.points >= LEAST_POINTS && seen.others.apart.mean >= LEAST_TO_BE_SEEN;
    let is_anything_shown = seen[..2].iter().all(is_shown);
    let is_seamless = seamless.apart.is_within(most.apart) && seamless.line.is_within(most.line);
    let are_found = seams.apart.exceeds(FOUND, most.apart) && hairs.line.exceeds(1.0, most.line);
    if !(is_anything_shown && is_seamless && are_found) {
        keep(name, &[("seamless", &right[0]), ("with_seams", &wrong[0])]);
        panic!(
            "{name}: beyond other edges, seams differ by {seamless:#?} and may by {most:#?}; those made on purpose by \
             {seams:#?}, hairs by {hairs:#?}; all that was measured, in this order: {seen:#?}"
        );
    }
}

#[test]
fn every_seam_is_looked_at() {
    let (_, sight) = sight();
    let part = sight.unseen as f32 / sight.seams as f32;
    println!("{} seams, {} unseen", sight.seams, sight.unseen);
    assert!(sight.seams > 1000, "{} seams", sight.seams);
    assert!(part <= MOST_UNSEEN, "{} of {} seams are never seen: {part}", sight.unseen, sight.seams);
}

#[test]
fn marks_show_no_seam_but_where_they_lie_on_the_map() {
    let stamps = [StampSpace::Surface, StampSpace::Map];
    let Some(mut studio) = Studio::new(stamps, PorousMaterial::default()) else { return };
    let mud = WeatherEffect {
        stamp_radius: Some(0.1),
        gravity_scale: 0.0,
        terminal_speed: Some(0.0),
        // A nanolitre, of which nothing is to be seen.
        volume_mm3: 1.0e-3,
        diffuse: Paint { color: [0.02; 3], opacity: 0.5 },
        ..default()
    };
    studio.throw(mud, 25.0);
    let [right, wrong] = [0, 1].map(|number| studio.pictures(number));
    check("marks", &right, &wrong, &MOST_PAINTED);
}

#[test]
fn water_shows_no_seam_but_where_islands_have_no_neighbours() {
    // Takes up nothing, and lets nothing run: what is seen is the film, where it fell.
    let glazed = PorousMaterial { model: WettingModel::Lagarde(Tweaked::default()), ..still(0.0) };
    let Some(mut studio) = Studio::new([StampSpace::Surface; 2], glazed) else { return };
    let (wrap, torn) = ([Wrap::Clamp; 2], torn(&bunny()));
    let geometry = TexelGeometry::new(&torn, &Affine3A::IDENTITY, Vec3::Y, SIZE, wrap);
    let second = studio.bunnies[1];
    studio.app.world_mut().entity_mut(second).insert(WetGeometry(Arc::new(geometry)));
    let water = WeatherEffect {
        stamp_radius: Some(0.05),
        gravity_scale: 0.0,
        terminal_speed: Some(0.0),
        volume_mm3: 50.0,
        ..default()
    };
    studio.throw(water, 100.0);
    let [right, wrong] = [0, 1].map(|number| studio.pictures(number));
    check("water", &right, &wrong, &MOST_WET);
}
