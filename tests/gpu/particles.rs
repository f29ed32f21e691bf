//! Particles as they are drawn: before and behind things, fading into them, as long as they are fast, lit; and splashes.
//!
//! No tick runs, so they hang in the air.

use bevy::core_pipeline::prepass::DepthPrepass;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::effect::{EffectIndex, EffectTable, ParticleLook, Sprite, WeatherEffect};
use bevy_weathering::particle::{Lifespan, Particle, Particles, Sequence, Splash, SplashConfig, Splashes};
use image::RgbImage;

use super::app::{add_target, app, camera, picture, update};
use super::images::keep;

const SIZE: UVec2 = UVec2::new(96, 72);

/// How often a picture is taken until what should be on it has been loaded.
const PATIENCE: usize = 200;

/// What an eye at the origin that looks along -z sees.
struct Air {
    app: App,
    target: Handle<Image>,
    effect: EffectIndex,
    born: u32,
}

impl Air {
    /// Under a sun behind the eye. Particles look like this, and are of this colour and width.
    fn new(look: ParticleLook) -> Option<Self> {
        Self::seen_by((), look)
    }

    /// The same through a camera that has something more.
    fn seen_by(camera_has: impl Bundle, look: ParticleLook) -> Option<Self> {
        let mut app = app()?;
        let target = add_target(&mut app, SIZE);
        let world = app.world_mut();
        world.spawn((camera(&target, Vec3::ZERO, Vec3::NEG_Z), Tonemapping::None, camera_has));
        world.spawn((
            DirectionalLight { illuminance: 5000.0, ..default() },
            Transform::default().looking_to(Vec3::NEG_Z, Vec3::Y),
        ));
        let effect = WeatherEffect { look, ..default() };
        let handle = world.resource_mut::<Assets<WeatherEffect>>().add(effect.clone());
        let effect = world.resource_mut::<EffectTable>().insert(handle, effect).unwrap();
        // The mesh that all particles are drawn on comes with the first frame.
        update(&mut app);
        Some(Self { app, target, effect, born: 0 })
    }

    fn add(&mut self, position: Vec3, velocity: Vec3) {
        let lifespan = Lifespan { ticks_left: Lifespan::MAX_TICKS, born_at: 0 };
        let (sequence, effect) = (Sequence(self.born), self.effect);
        let volume_nl = 4190;
        let particle = Particle { position, velocity, lifespan, volume_nl, sequence, effect, class: 0 };
        self.app.world_mut().resource_mut::<Particles>().spawn([particle].into_iter());
        self.born += 1;
    }

    /// A blue wall across all that is seen, so far away.
    fn wall(&mut self, distance: f32) -> Entity {
        let world = self.app.world_mut();
        let paint =
            StandardMaterial { unlit: true, base_color: Color::linear_rgb(0.0, 0.0, 1.0), ..default() };
        let paint = world.resource_mut::<Assets<StandardMaterial>>().add(paint);
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::new(40.0, 40.0));
        world.spawn((Mesh3d(mesh), MeshMaterial3d(paint), Transform::from_xyz(0.0, 0.0, -distance))).id()
    }

    /// The first picture of which something is true.
    fn picture_when(&mut self, what: &str, is_so: impl Fn(&RgbImage) -> bool) -> RgbImage {
        for _ in 0..PATIENCE {
            update(&mut self.app);
            let picture = picture(&mut self.app, &self.target);
            if is_so(&picture) {
                return picture;
            }
        }
        let last = picture(&mut self.app, &self.target);
        keep("particles", &[("last", &last)]);
        panic!("never seen: {what}");
    }
}

/// Where a place is seen.
fn pixel(at: Vec3) -> (u32, u32) {
    let half = at.z.abs() * (0.5 * PerspectiveProjection::default().fov).tan();
    let aspect = SIZE.x as f32 / SIZE.y as f32;
    let [x, y] = [0.5 + 0.5 * at.x / (half * aspect), 0.5 - 0.5 * at.y / half];
    ((x * SIZE.x as f32) as u32, (y * SIZE.y as f32) as u32)
}

fn at(picture: &RgbImage, place: Vec3) -> [u8; 3] {
    picture[pixel(place)].0
}

fn is_red([red, _, blue]: [u8; 3]) -> bool {
    red > 60 && red > blue.saturating_mul(2)
}

fn is_blue([red, _, blue]: [u8; 3]) -> bool {
    blue > 60 && blue > red.saturating_mul(2)
}

/// Red grains, three quarters of a metre wide.
const GRAIN: ParticleLook = ParticleLook {
    color: [1.0, 0.0, 0.0, 1.0],
    width: 0.75,
    exposure: 0.0,
    sprite: Sprite::Grain,
    splash: 0.0,
};

/// The corner shows the wall, and no particle.
fn shows_wall(picture: &RgbImage) -> bool {
    is_blue(picture[(0, 0)].0)
}

#[test]
fn what_is_nearer_hides_them_and_they_hide_what_is_farther() {
    let Some(mut air) = Air::new(GRAIN) else { return };
    let (far, near) = (Vec3::new(-1.0, 0.0, -6.0), Vec3::new(0.8, 0.0, -3.0));
    air.add(far, Vec3::ZERO);
    air.add(near, Vec3::ZERO);
    let wall = air.wall(4.5);
    let seen =
        air.picture_when("a grain before a wall", |picture| shows_wall(picture) && is_red(at(picture, near)));
    assert!(is_blue(at(&seen, far)), "behind the wall: {:?}", at(&seen, far));
    air.app.world_mut().get_mut::<Transform>(wall).unwrap().translation.z = -9.0;
    air.picture_when("both grains before the wall", |picture| {
        shows_wall(picture) && is_red(at(picture, near)) && is_red(at(picture, far))
    });
}

#[test]
fn they_fade_into_what_is_close_behind_them_if_the_camera_knows_how_far_that_is() {
    let red = |soft: bool, before_wall: f32| -> Option<u8> {
        let mut air = if soft { Air::seen_by(DepthPrepass, GRAIN) } else { Air::new(GRAIN) }?;
        air.wall(4.0);
        let (place, far_from_it) = (Vec3::NEG_Z * (4.0 - before_wall), Vec3::new(0.9, 0.0, -2.5));
        air.add(place, Vec3::ZERO);
        air.add(far_from_it, Vec3::ZERO);
        let seen = air.picture_when("a grain far before the wall", |picture| {
            shows_wall(picture) && is_red(at(picture, far_from_it))
        });
        Some(at(&seen, place)[0])
    };
    // It fades over half of its width.
    let Some(hard) = red(false, 0.015) else { return };
    let [soft, clear] = [0.015, 1.0].map(|before_wall| red(true, before_wall).unwrap());
    assert!(hard > 60 && clear > 60, "{hard} {clear}");
    assert!(soft < hard / 2, "{soft} is not much less than {hard}");
}

/// How many columns and rows of two pictures differ.
fn extent(a: &RgbImage, b: &RgbImage) -> (usize, usize) {
    let differs = |x: u32, y: u32| a[(x, y)].0.iter().zip(b[(x, y)].0).any(|(a, b)| a.abs_diff(b) > 8);
    let columns = (0..SIZE.x).filter(|&x| (0..SIZE.y).any(|y| differs(x, y))).count();
    let rows = (0..SIZE.y).filter(|&y| (0..SIZE.x).any(|x| differs(x, y))).count();
    (columns, rows)
}

#[test]
fn streaks_are_as_long_as_what_they_fly_while_the_shutter_is_open() {
    let look = ParticleLook {
        color: [1.0; 4],
        width: 0.15,
        exposure: 0.1,
        sprite: Sprite::Streak,
        ..ParticleLook::default()
    };
    let seen = |velocity: Vec3| -> Option<(usize, usize)> {
        let mut air = Air::new(look)?;
        update(&mut air.app);
        let nothing = picture(&mut air.app, &air.target);
        // In the middle of its way it is in the middle of the picture.
        air.add(Vec3::NEG_Z * 4.0 + velocity * 0.05, velocity);
        let with = air.picture_when("a streak", |picture| extent(picture, &nothing) != (0, 0));
        Some(extent(&with, &nothing))
    };
    let Some((slow_columns, slow_rows)) = seen(Vec3::NEG_Y * 3.0) else { return };
    let (fast_columns, fast_rows) = seen(Vec3::NEG_Y * 12.0).unwrap();
    // 1.2 m and 0.3 m: in a picture that is 3.3 m high there, 26 and 7 rows, less what fades at the ends.
    assert!(fast_rows > 2 * slow_rows && fast_rows > 12, "{fast_rows} and {slow_rows} rows");
    assert!(fast_columns <= slow_columns + 2, "{fast_columns} and {slow_columns} columns");
    let (columns, rows) = seen(Vec3::X * 12.0).unwrap();
    assert!(columns > 12 && rows <= slow_columns + 2, "{columns} columns, {rows} rows");
}

#[test]
fn the_sun_lights_them() {
    let Some(mut air) = Air::new(GRAIN) else { return };
    let place = Vec3::NEG_Z * 3.0;
    air.add(place, Vec3::ZERO);
    let lit = at(&air.picture_when("a grain", |picture| is_red(at(picture, place))), place)[0];
    let world = air.app.world_mut();
    world.query::<&mut DirectionalLight>().single_mut(world).unwrap().illuminance = 0.0;
    (0..3).for_each(|_| update(&mut air.app));
    let unlit = at(&picture(&mut air.app, &air.target), place)[0];
    assert!(unlit < lit / 2, "{unlit} without the sun, {lit} in it");
}

#[test]
fn a_splash_stands_on_what_was_hit() {
    let look = ParticleLook { color: [1.0; 4], splash: 1.0, ..ParticleLook::default() };
    let Some(mut air) = Air::new(look) else { return };
    let nothing = picture(&mut air.app, &air.target);
    let (point, effect) = (Vec3::new(0.0, -0.2, -3.0), air.effect);
    let splash = Splash { point, normal: Vec3::Y, size: 1.0, effect, sequence: Sequence(0), tick: 0 };
    air.app.world_mut().resource_mut::<Splashes>().push(splash, SplashConfig::MOST);
    // It is largest when half of its 0.15 s are over.
    air.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(4));
    update(&mut air.app);
    air.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    let seen = air.picture_when("a splash", |picture| extent(picture, &nothing) != (0, 0));
    let foot = pixel(point).1;
    let changed = |rows: std::ops::Range<u32>| {
        rows.flat_map(|y| (0..SIZE.x).map(move |x| (x, y)))
            .filter(|&at| seen[at].0.iter().zip(nothing[at].0).any(|(a, b)| a.abs_diff(b) > 8))
            .count()
    };
    let (above, below) = (changed(0..foot), changed(foot + 2..SIZE.y));
    if above < 10 || below > above / 10 {
        keep("splash", &[("before", &nothing), ("with", &seen)]);
        panic!("{above} pixels above the place that was hit, {below} below it");
    }
}
