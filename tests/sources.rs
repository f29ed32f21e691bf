//! Which emitter it was, through flight, run-off and drips, in whole apps without a renderer.

use bevy::prelude::*;
use bevy_weathering::emitter::{Source, TrackSources};
use bevy_weathering::prelude::*;
use bevy_weathering::scenes::meshes::ground;
use bevy_weathering::wetting::{Origin, TexelWater};

use crate::wetting::scene::Scene;

const HZ: u32 = 60;
/// Texels along each side of the floor, and how long that is, metres.
const FLOOR: (u32, f32) = (128, 3.0);

/// A hose wets a wall, from which water drips onto a floor; beside it rain falls on the floor, and a brush wets it elsewhere.
struct Yard {
    scene: Scene,
    wall: Entity,
    floor: Entity,
    emitters: [Entity; 2],
}

impl Yard {
    fn new(is_tracked: bool) -> Self {
        let mut scene = Scene::new(HZ);
        if is_tracked {
            scene.0.init_resource::<TrackSources>();
        }
        let upright = Transform::from_xyz(0.0, 1.5, 0.0)
            .with_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
        let smooth = PorousMaterial { capacity_mm: 0.0, retained_mm: 0.05, ..default() };
        let wall = scene.surface(ground(Vec2::ONE, UVec2::splat(3)).unwrap(), 128, smooth, upright);
        // What is on it stays where it is.
        let still = PorousMaterial { capacity_mm: 0.0, retained_mm: 1000.0, ..default() };
        let (size, side) = FLOOR;
        let mesh = ground(Vec2::splat(side), UVec2::splat(3)).unwrap();
        let floor = scene.surface(mesh, size, still, Transform::default());
        let hose = Emitter { rate: 200.0, speed: 6.0, stream: 1, ..default() };
        let hose = scene.emit(hose, 20.0, 0.02, Vec3::new(0.0, 2.0, 1.0));
        let sky = EmitterShape::Sky { half_size: Vec2::splat(0.2) };
        let rain = Emitter { rate: 200.0, shape: sky, stream: 2, ..default() };
        let rain = scene.emit(rain, 5.0, 0.02, Vec3::new(1.1, 1.0, 0.0));
        Self { scene, wall, floor, emitters: [hose, rain] }
    }

    /// The hose and the rain for five seconds, and twenty more for the rest to run down.
    fn run(&mut self) {
        self.scene.run(5 * HZ);
        for emitter in self.emitters {
            self.scene.0.world_mut().get_mut::<Emitter>(emitter).unwrap().enabled = false;
        }
        self.scene.run(20 * HZ);
    }

    /// Column, row and origin of all that has been wetted.
    fn origins(&self, surface: Entity) -> Vec<([u32; 2], Origin)> {
        let water = self.scene.water(surface);
        let size = water.size();
        let origin = |texel| Some(([texel % size, texel / size], water.origin(texel)?));
        (0..size * size).filter_map(origin).filter(|(_, origin)| origin.since > 0).collect()
    }

    fn texels(&self) -> [Vec<TexelWater>; 2] {
        [self.wall, self.floor].map(|surface| self.scene.water(surface).texels().to_vec())
    }
}

/// The middle of a column of the floor, metres.
fn across(column: u32) -> f32 {
    let (size, side) = FLOOR;
    ((column as f32 + 0.5) / size as f32 - 0.5) * side
}

#[test]
fn water_is_of_the_emitter_it_came_from_also_after_it_has_run_and_dripped() {
    let mut yard = Yard::new(true);
    // The very first water on the floor.
    let brush = Brush { kind: BrushKind::Wet, point: Vec3::new(-1.1, 0.0, 0.0), radius: 0.2, strength: 1.0 };
    yard.scene.0.world_mut().resource_mut::<BrushQueue>().0.push(Stroke { brush, surface: None });
    yard.run();
    let track = yard.scene.0.world().resource::<TrackSources>().clone();
    assert_eq!(track.emitters(), yard.emitters);
    assert_eq!(track.emitter(Source(2)), Some(yard.emitters[1]));

    let wall = yard.origins(yard.wall);
    assert!(wall.iter().all(|(_, origin)| origin.source == Source(1)));
    // It has run down to the lower edge, where it came later.
    let since = |wanted: fn(&u32) -> bool| {
        let rows = wall.iter().filter(|([_, row], _)| wanted(row));
        rows.map(|(_, origin)| origin.since).min()
    };
    let (upper, lower) = (since(|&row| row < 32).unwrap(), since(|&row| row > 120).unwrap());
    assert!(upper + 10 < lower, "{upper} {lower}");

    let floor = yard.origins(yard.floor);
    let expected = |column: u32| match across(column) {
        x if x < -0.6 => Source::BY_HAND,
        x if x > 0.6 => Source(2),
        _ => Source(1),
    };
    for ([column, row], origin) in &floor {
        assert_eq!(origin.source, expected(*column), "{column} {row}");
    }
    for source in [Source::BY_HAND, Source(1), Source(2)] {
        let count = floor.iter().filter(|(_, origin)| origin.source == source).count();
        assert!(count > 2, "{source:?}: {count}");
    }
}

#[test]
fn nothing_depends_on_whether_somebody_asks() {
    let (mut ignored, mut asked) = (Yard::new(false), Yard::new(true));
    ignored.run();
    asked.run();
    assert!(ignored.origins(ignored.wall).is_empty() && !asked.origins(asked.wall).is_empty());
    assert!(ignored.texels() == asked.texels(), "not a unit is elsewhere");

    // Nobody asks any more.
    asked.scene.0.world_mut().remove_resource::<TrackSources>();
    asked.scene.run(1);
    assert_eq!(asked.scene.water(asked.wall).origin(0), None);
}

#[test]
fn the_last_water_counts_and_a_second_run_tells_the_same() {
    let run = || {
        let mut yard = Yard::new(true);
        yard.run();
        // The rain goes on where the drips fell.
        let [_, rain] = yard.emitters;
        let over_drips = Transform::from_xyz(0.0, 0.8, 0.0);
        let world = yard.scene.0.world_mut();
        world.entity_mut(rain).insert((over_drips, GlobalTransform::from(over_drips)));
        world.get_mut::<Emitter>(rain).unwrap().enabled = true;
        yard.scene.run(10 * HZ);
        yard.origins(yard.floor)
    };
    let origins = run();
    let near = origins.iter().filter(|([column, row], _)| across(*column).hypot(across(*row)) < 0.1);
    let sources: Vec<Source> = near.map(|(_, origin)| origin.source).collect();
    let of_rain = sources.iter().filter(|source| **source == Source(2)).count();
    // The last drips may still fall.
    assert!(of_rain * 10 > sources.len() * 7 && of_rain > 10, "{of_rain} of {}", sources.len());
    assert_eq!(origins, run());
}
