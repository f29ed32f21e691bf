//! Rain over a scene.

use bevy::prelude::*;

use super::{ExportError, ExportOptions};
use crate::collision::MeshTriangles;
use crate::effect::{DropSizes, EffectTable, WeatherEffect};
use crate::emitter::{Emitter, EmitterShape, Flow};
use crate::particle::Lifespan;

/// Rain begins so high above the scene, metres; with wind so much more, that it is on its way with it when it arrives.
const ABOVE: f32 = 1.0;
const GUST_RUN: f32 = 4.0;
/// Slow drops of rain fall no slower than this, m/s.
const SLOWEST: f32 = 3.0;
/// The most particles that are sent out a second, for a sky much larger than the scene.
const MOST_PER_SECOND: f32 = 100_000.0;
/// How often each place is hit, if it takes wider marks to come to that: rain leaves no spots that are dry.
const HITS: f32 = 8.0;

/// Lowest and highest corner of all that can be hit; other vertices may lie anywhere.
pub(super) fn bounds<'a>(meshes: impl Iterator<Item = &'a Mesh>) -> (Vec3, Vec3) {
    let triangles = meshes.filter_map(|mesh| MeshTriangles::from_mesh(mesh).ok());
    let points = triangles.flat_map(|triangles| triangles.positions).flatten();
    let all = points.fold(None, |bounds: Option<(Vec3, Vec3)>, point| {
        let (low, high) = bounds.unwrap_or((point, point));
        Some((low.min(point), high.max(point)))
    });
    all.unwrap_or((Vec3::ZERO, Vec3::ZERO))
}

/// A sky over all of the scene, and over whatever the wind blows onto it. An error if it is so large that particles would not
/// carry all of its rain.
pub(super) fn add_rain(
    world: &mut World,
    (low, high): (Vec3, Vec3),
    options: &ExportOptions,
) -> Result<(), ExportError> {
    let mut effect = options.effect.clone();
    if let DropSizes::MarshallPalmer(_) = effect.drops {
        effect.drops = DropSizes::MarshallPalmer(options.rain_mm_per_h.clamp(0.1, 300.0));
    }
    let wind = Vec2::new(options.weather.wind.x, options.weather.wind.z);
    let above = if wind == Vec2::ZERO { ABOVE } else { ABOVE + GUST_RUN };
    let fall_seconds = (high.y - low.y + above) / SLOWEST;
    // Drops that are born up the wind are carried over the scene.
    let drift = -wind * fall_seconds;
    let (low_xz, high_xz) = (Vec2::new(low.x, low.z), Vec2::new(high.x, high.z));
    // Marks reach beyond what is hit, and a wall has no width.
    let margin = Vec2::splat(0.25);
    let (from, to) = (low_xz + drift.min(Vec2::ZERO) - margin, high_xz + drift.max(Vec2::ZERO) + margin);
    let (half_size, own) = ((to - from) / 2.0, (high_xz - low_xz) / 2.0 + margin);
    let middle = (from + to) / 2.0;
    let crowd = half_size.element_product() / own.element_product();
    let longest = f32::from(Lifespan::MAX_TICKS) / options.tick_hz as f32;
    let area = 4.0 * half_size.element_product();
    // No particle holds more, so a large scene takes more of them.
    let least = options.rain_mm_per_h * area * 1.0e6 / 3600.0 / WeatherEffect::MAX_VOLUME_MM3;
    if least > MOST_PER_SECOND {
        let most = options.rain_mm_per_h * (MOST_PER_SECOND / least);
        return Err(ExportError::Option {
            option: "rain",
            value: options.rain_mm_per_h.to_string(),
            expected: format!("at most {most:.3} under a sky of {area:.0} m² (lengths of a glTF are metres)"),
        });
    }
    let mut emitter = Emitter {
        rate: (options.particles_per_second * crowd).max(least).min(MOST_PER_SECOND),
        shape: EmitterShape::Sky { half_size },
        flow: Flow::MmPerHour(options.rain_mm_per_h),
        speed: 0.0,
        lifetime: (2.0 * fall_seconds + 1.0).min(longest),
        ..default()
    };
    let particles = emitter.rate * options.minutes * 60.0;
    let wide = (HITS * area / (std::f32::consts::PI * particles)).sqrt().min(100.0);
    if effect.stamp_radius.is_some_and(|radius| radius < wide) {
        // Marks are that wide for particles of so much water.
        effect.volume_mm3 = emitter.particle_mm3(&effect);
        effect.stamp_radius = Some(wide);
        // They stand for drops all over that area, however far each of those spreads.
        effect.stamp_speed = Some(0.0);
    }
    emitter.effect = world.resource_mut::<Assets<WeatherEffect>>().add(effect.clone());
    world.resource_mut::<EffectTable>().insert(emitter.effect.clone(), effect);
    let place = Vec3::new(middle.x, high.y + above, middle.y);
    world.spawn((
        Name::new("rain"),
        emitter,
        Transform::from_translation(place),
        GlobalTransform::from_translation(place),
    ));
    Ok(())
}

#[cfg(test)]
mod tests {
    use bevy::asset::{AssetPlugin, RenderAssetUsages};
    use bevy::mesh::{Indices, PrimitiveTopology};

    use super::*;
    use crate::replay::{headless, task_pools};

    #[test]
    fn it_rains_on_what_can_be_hit() {
        let far = [1.0e5f32; 3];
        let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.5, 1.0], [0.0, 0.5, 1.0], far];
        let mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, points)
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, vec![[0.0f32; 2]; 5])
            // The last one has no area.
            .with_inserted_indices(Indices::U32(vec![0, 1, 2, 0, 2, 3, 4, 4, 4]));
        assert_eq!(bounds([&mesh].into_iter()), (Vec3::ZERO, Vec3::new(1.0, 0.5, 1.0)));
        assert_eq!(bounds(std::iter::empty()), (Vec3::ZERO, Vec3::ZERO));
    }

    #[test]
    fn the_sky_reaches_over_what_the_wind_blows_in() {
        let mut app =
            headless(task_pools(None), AssetPlugin { watch_for_changes_override: Some(false), ..default() });
        let mut options = ExportOptions::default();
        options.weather.wind = Vec3::new(3.0, 0.0, 0.0);
        add_rain(app.world_mut(), (Vec3::ZERO, Vec3::new(2.0, 1.0, 2.0)), &options).unwrap();
        let world = app.world_mut();
        let mut query = world.query::<(&Emitter, &Transform)>();
        let (emitter, transform) = query.single(world).unwrap();
        let EmitterShape::Sky { half_size } = emitter.shape else { panic!("{:?}", emitter.shape) };
        let (west, east) = (transform.translation.x - half_size.x, transform.translation.x + half_size.x);
        // Six metres of fall at the slowest take two seconds.
        assert!((west + 6.25).abs() < 1e-4 && (east - 2.25).abs() < 1e-4, "{west} {east}");
        assert!((transform.translation.z - 1.0).abs() < 1e-4);
        assert!(emitter.rate > options.particles_per_second * 3.0);
        let rain = emitter.particle_mm3(&options.effect) * emitter.rate;
        let asked = options.rain_mm_per_h * 1.0e6 / 3600.0 * 4.0 * half_size.element_product();
        assert!((rain / asked - 1.0).abs() < 1e-4, "{rain} {asked}");
    }

    #[test]
    fn few_particles_leave_wide_marks_and_a_large_scene_gets_all_its_rain() {
        let mut app =
            headless(task_pools(None), AssetPlugin { watch_for_changes_override: Some(false), ..default() });
        let options = ExportOptions { minutes: 30.0, ..ExportOptions::default() };
        add_rain(app.world_mut(), (Vec3::ZERO, Vec3::new(1000.0, 10.0, 1000.0)), &options).unwrap();
        let world = app.world_mut();
        let mut query = world.query::<&Emitter>();
        let emitter = query.single(world).unwrap().clone();
        let effect = world.resource::<Assets<WeatherEffect>>().get(&emitter.effect).unwrap();
        assert!(emitter.particle_mm3(effect) <= WeatherEffect::MAX_VOLUME_MM3);
        let hits = emitter.rate * 1800.0 * std::f32::consts::PI * effect.stamp_radius.unwrap().powi(2)
            / 1000.5f32.powi(2);
        assert!((hits - HITS).abs() < 0.1, "{hits}");
        // However slowly it comes.
        assert_eq!(effect.stamp_speed, Some(0.0));
        let rain = emitter.particle_mm3(effect) * emitter.rate / 1000.5f32.powi(2);
        assert!((rain - 1.0e7 / 3600.0).abs() < 3.0, "{rain}");
    }

    #[test]
    fn more_rain_than_particles_carry_is_refused() {
        let mut app =
            headless(task_pools(None), AssetPlugin { watch_for_changes_override: Some(false), ..default() });
        let scene = (Vec3::ZERO, Vec3::new(20_000.0, 10.0, 20_000.0));
        let mut options = ExportOptions { rain_mm_per_h: 100.0, ..ExportOptions::default() };
        let error = add_rain(app.world_mut(), scene, &options).unwrap_err().to_string();
        assert!(error.contains("`rain`") && error.contains("at most 0.900"), "{error}");
        options.rain_mm_per_h = 0.89;
        add_rain(app.world_mut(), scene, &options).unwrap();
    }
}
