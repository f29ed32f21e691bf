//! How much rain each texel of a surface gets, by rays.
//!
//! Rain falls with its own speed and drifts with the wind, so it comes from `-(wind - fall_speed * up)`,
//! spread around that direction a little or, for a drizzle from everywhere, over the whole sky; or it comes
//! from a plane above the object, as from the emissive plane that Hnat et al. baked in a modeller. Each texel
//! looks for it along a few dozen rays. What it sees counts by the cosine to its normal: a slope gets less
//! per area than a flat roof does. The sum is divided by what a texel would get that faces the rain in the
//! open, so 1 is the most, and 0 is sheltered or turned away.
//!
//! What this does not do: drops neither bounce nor run, and the wind does not go round corners.
//!
//! Hnat et al. 2006, *Real-time wetting of porous media*, for maps of exposure.

use std::f32::consts::FRAC_PI_2;

use bevy::math::{Vec2, Vec3};

use super::gutter::fill_gutter;
use super::rays::{Lobe, Rays, per_point, samples};
use super::{GreyMap, WetMapError, check_range, check_size};
use crate::collision::CollisionScene;
use crate::wetting::SurfacePoint;

/// Where rain comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RainSource {
    /// The sky, from all directions within `spread` of the one that rain comes from, more from near it: by
    /// the cosine of the angle. Nothing comes from below the horizon.
    Sky {
        /// Half-angle of the cone, radians, 0 (parallel) to a quarter turn (the whole sky).
        spread: f32,
    },
    /// A horizontal plane. It rains from each of its points by the cosine to the direction that rain comes
    /// from, and thins out by the square of the distance: what lies nearest is 1, so the plane should be some
    /// way above.
    Plane {
        /// Its middle, metres.
        center: Vec3,
        /// Half its size along x and z, metres.
        half_size: Vec2,
    },
}

/// How it rains on a scene, and how closely that is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExposureOptions {
    /// Where the rain comes from.
    pub source: RainSource,
    /// m/s, each axis -100 to 100.
    pub wind: Vec3,
    /// How fast drops fall in still air, m/s, .01 to 100.
    pub fall_speed: f32,
    /// Rays per texel, 1 to 65,536. One is enough for parallel rain.
    pub rays: u32,
}

impl Default for ExposureOptions {
    /// Drops of 2 mm in still air.
    fn default() -> Self {
        Self { source: RainSource::Sky { spread: 0.15 }, wind: Vec3::ZERO, fall_speed: 6.55, rays: 64 }
    }
}

/// How far values reach beyond the uv islands, texels.
const GUTTER: u32 = 8;

impl ExposureOptions {
    /// Unit vector towards where the rain comes from.
    pub fn towards_rain(&self) -> Vec3 {
        (Vec3::Y * self.fall_speed - self.wind).normalize_or(Vec3::Y)
    }

    /// That all are in range.
    fn validate(&self) -> Result<(), WetMapError> {
        check_range("rays", self.rays, 1..=65_536)?;
        check_range("fall_speed", self.fall_speed, 0.01..=100.0)?;
        for (name, speed) in ["wind.x", "wind.y", "wind.z"].into_iter().zip(self.wind.to_array()) {
            check_range(name, speed, -100.0..=100.0)?;
        }
        if self.wind.y >= self.fall_speed {
            let expected = "less than `fall_speed`, or nothing falls".into();
            let value = self.wind.y.to_string();
            return Err(WetMapError::Parameter { name: "wind.y", value, expected });
        }
        match self.source {
            RainSource::Sky { spread } => check_range("spread", spread, 0.0..=FRAC_PI_2),
            RainSource::Plane { center, half_size } => {
                for (name, place) in ["center.x", "center.y", "center.z"].into_iter().zip(center.to_array()) {
                    check_range(name, place, -1.0e6..=1.0e6)?;
                }
                check_range("half_size.x", half_size.x, 1.0e-3..=1.0e6)?;
                check_range("half_size.y", half_size.y, 1.0e-3..=1.0e6)
            }
        }
    }
}

/// The exposure of a surface to rain: a wet map of `size` by `size` texels.
///
/// `points` are the surface's, one or more to a texel, whose mean counts; `scene` is all that can be in the
/// way, the surface included. Beside the surface, values go on for a few texels, the rest is 0. `progress` is
/// told from any thread how many more points are done. The same on any number of cores.
///
/// # Errors
/// [`WetMapError::Parameter`]; [`WetMapError::Size`]; [`WetMapError::NoSurface`] if no point lies in the map.
pub fn exposure(
    scene: &CollisionScene,
    points: &[SurfacePoint],
    size: u32,
    options: &ExposureOptions,
    progress: impl Fn(u64) + Sync,
) -> Result<GreyMap, WetMapError> {
    check_size(size, size)?;
    options.validate()?;
    let exposed = match options.source {
        RainSource::Sky { spread } => from_sky(scene, points, options, spread, progress),
        RainSource::Plane { center, half_size } => {
            from_plane(scene, points, options, center, half_size, progress)
        }
    };
    let texels = size as usize * size as usize;
    let (mut values, mut counts) = (vec![0.0f32; texels], vec![0u32; texels]);
    for (point, value) in points.iter().zip(exposed) {
        let at = point.texel as usize;
        if let (Some(sum), Some(count)) = (values.get_mut(at), counts.get_mut(at)) {
            *sum += value;
            *count += 1;
        }
    }
    let mut known: Vec<bool> = counts.iter().map(|&count| count > 0).collect();
    if !known.contains(&true) {
        return Err(WetMapError::NoSurface);
    }
    for (value, count) in values.iter_mut().zip(counts) {
        *value = (*value / count.max(1) as f32).clamp(0.0, 1.0);
    }
    fill_gutter(&mut values, &mut known, size as usize, GUTTER);
    GreyMap::new(size, size, values)
}

/// What each point gets from the sky; at most about 1.
fn from_sky(
    scene: &CollisionScene,
    points: &[SurfacePoint],
    options: &ExposureOptions,
    spread: f32,
    progress: impl Fn(u64) + Sync,
) -> Vec<f32> {
    let rays = Rays::new(scene);
    let towards_rain = options.towards_rain();
    let lobe = Lobe::new(towards_rain, spread);
    let count = if spread == 0.0 { 1 } else { options.rays };
    let exposed = |point: &SurfacePoint| {
        let start = rays.start(point);
        let reach = rays.reach(start);
        let (mut received, mut open) = (0.0, 0.0);
        for sample in samples(count, point.texel) {
            let direction = lobe.direction(sample);
            if direction.y <= 0.0 {
                continue;
            }
            open += direction.dot(towards_rain);
            let facing = direction.dot(point.normal);
            if facing > 0.0 && rays.is_free(start, start + direction * reach) {
                received += facing;
            }
        }
        if open > 0.0 { received / open } else { 0.0 }
    };
    per_point(points, exposed, progress)
}

/// What each point gets from a plane, 1 being the most that any would get in the open.
fn from_plane(
    scene: &CollisionScene,
    points: &[SurfacePoint],
    options: &ExposureOptions,
    center: Vec3,
    half_size: Vec2,
    progress: impl Fn(u64) + Sync,
) -> Vec<f32> {
    let rays = Rays::new(scene);
    let towards_rain = options.towards_rain();
    let exposed = |point: &SurfacePoint| {
        let start = rays.start(point);
        let (mut received, mut open) = (0.0, 0.0);
        for sample in samples(options.rays, point.texel) {
            let across = (sample * 2.0 - 1.0) * half_size;
            let end = center + Vec3::new(across.x, 0.0, across.y);
            let away = end - start;
            let direction = away.normalize_or_zero();
            // What leaves the plane here: only downwards, and by the cosine.
            let leaving = direction.dot(towards_rain);
            if direction.y <= 0.0 || leaving <= 0.0 {
                continue;
            }
            let arriving = leaving / away.length_squared();
            open += arriving * leaving;
            let facing = direction.dot(point.normal);
            if facing > 0.0 && rays.is_free(start, end) {
                received += arriving * facing;
            }
        }
        [received, open]
    };
    let sums = per_point(points, exposed, progress);
    let most = sums.iter().map(|&[_, open]| open).fold(0.0, f32::max);
    sums.into_iter().map(|[received, _]| if most > 0.0 { received / most } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::super::rays::tests::{at, ground, squares};
    use super::*;

    const SIZE: u32 = 64;

    /// A ground of 8 m by 8 m, and a roof 1 m above its half at negative x.
    fn half_roofed() -> CollisionScene {
        squares(&[at(Vec3::ZERO, Vec2::splat(4.0)), at(Vec3::new(-2.0, 1.0, 0.0), Vec2::new(2.0, 8.0))])
    }

    fn place(texel: u32) -> f32 {
        (texel as f32 + 0.5) / SIZE as f32 * 4.0 - 2.0
    }

    fn exposed(scene: &CollisionScene, options: ExposureOptions) -> GreyMap {
        exposure(scene, &ground(SIZE), SIZE, &options, |_| {}).unwrap()
    }

    fn parallel(wind: Vec3) -> ExposureOptions {
        let source = RainSource::Sky { spread: 0.0 };
        ExposureOptions { source, wind, fall_speed: 4.0, ..ExposureOptions::default() }
    }

    #[test]
    fn a_roof_shelters_and_the_wind_moves_its_shelter() {
        for wind in [0.0, 2.0, -1.0] {
            let options = parallel(Vec3::X * wind);
            let map = exposed(&half_roofed(), options);
            // Height times wind over fall speed.
            let border = 1.0 * wind / 4.0;
            for y in [0, 20, SIZE - 1] {
                for x in (0..SIZE).filter(|&x| (place(x) - border).abs() > 0.01) {
                    let expected = if place(x) < border { 0.0 } else { options.towards_rain().y };
                    let value = map.get(x, y);
                    assert!((value - expected).abs() < 1e-4, "{wind} at {}: {value}", place(x));
                }
            }
        }
    }

    #[test]
    fn the_border_is_as_soft_as_the_rain_is_spread() {
        let source = RainSource::Sky { spread: 0.2 };
        let map = exposed(&half_roofed(), ExposureOptions { source, rays: 256, ..parallel(Vec3::ZERO) });
        let near = (map.get(31, 9) + map.get(32, 9)) / 2.0;
        assert!((near - 0.5).abs() < 0.05, "{near}");
        // The cone is .2 m wide at the height of the roof.
        for x in 0..SIZE {
            let value = map.get(x, 40);
            if place(x) < -0.22 {
                assert_eq!(value, 0.0, "{x}");
            } else if place(x) > 0.22 {
                assert!((value - 1.0).abs() < 1e-5, "{x}: {value}");
            }
        }
    }

    #[test]
    fn the_whole_sky_reaches_under_a_roof() {
        let source = RainSource::Sky { spread: FRAC_PI_2 };
        let map = exposed(&half_roofed(), ExposureOptions { source, rays: 256, ..parallel(Vec3::ZERO) });
        let near = (map.get(31, 32) + map.get(32, 32)) / 2.0;
        assert!((near - 0.5).abs() < 0.05, "{near}");
        let row: Vec<f32> = [4, 16, 28, 40, 60].into_iter().map(|x| map.get(x, 32)).collect();
        assert!(row.windows(2).all(|pair| pair[0] < pair[1]), "{row:?}");
        assert!(row[0] > 0.0 && row[4] > 0.9, "{row:?}");
    }

    #[test]
    fn slopes_get_less_and_what_faces_the_rain_gets_all() {
        let scene = squares(&[at(Vec3::ZERO, Vec2::splat(4.0))]);
        let options = parallel(Vec3::X * 3.0);
        let towards_rain = options.towards_rain();
        for (normal, expected) in
            [(towards_rain, 1.0), (Vec3::Y, 0.8), (Vec3::NEG_X, 0.6), (Vec3::X, 0.0), (Vec3::NEG_Y, 0.0)]
        {
            for spread in [0.0, 0.3] {
                let options = ExposureOptions { source: RainSource::Sky { spread }, ..options };
                let point = SurfacePoint { texel: 5, triangle: 0, position: Vec3::Y, normal };
                let value = exposure(&scene, &[point], 8, &options, |_| {}).unwrap().get(5, 0);
                assert!((value - expected).abs() < 0.03, "{normal} {spread}: {value}");
            }
        }
    }

    #[test]
    fn a_plane_rains_on_what_lies_below() {
        let source = RainSource::Plane { center: Vec3::Y * 3.0, half_size: Vec2::splat(2.0) };
        let options = ExposureOptions { source, ..parallel(Vec3::ZERO) };
        let open = exposed(&squares(&[at(Vec3::ZERO, Vec2::splat(4.0))]), options);
        let most = open.values.iter().copied().fold(0.0, f32::max);
        assert!((most - 1.0).abs() < 1e-4 && open.get(32, 32) > 0.9, "{most} {}", open.get(32, 32));
        assert!(open.get(0, 0) < 0.8 * open.get(32, 32), "{}", open.get(0, 0));
        let roofed = exposed(&half_roofed(), options);
        // From under the roof all of the plane is hidden here, and nothing of it there.
        assert_eq!(roofed.get(7, 32), 0.0);
        assert!((roofed.get(57, 32) - open.get(57, 32)).abs() < 1e-3);
        let below = RainSource::Plane { center: Vec3::NEG_Y, half_size: Vec2::ONE };
        let map = exposed(&half_roofed(), ExposureOptions { source: below, ..options });
        assert!(map.values.iter().all(|&value| value == 0.0));
    }

    #[test]
    fn texels_beside_the_surface_take_after_it_and_progress_is_told() {
        let points: Vec<SurfacePoint> = ground(SIZE).into_iter().filter(|p| p.texel % SIZE >= 32).collect();
        let done = AtomicU64::new(0);
        let tell = |more| {
            done.fetch_add(more, Ordering::Relaxed);
        };
        let map = exposure(&half_roofed(), &points, SIZE, &parallel(Vec3::ZERO), tell).unwrap();
        assert_eq!(done.into_inner(), points.len() as u64);
        assert_eq!((map.get(28, 5), map.get(32 - GUTTER, 5), map.get(20, 5)), (1.0, 1.0, 0.0));
    }

    #[test]
    fn nonsense_is_named() {
        let scene = half_roofed();
        let error = |options: ExposureOptions| {
            exposure(&scene, &ground(4), 4, &options, |_| {}).unwrap_err().to_string()
        };
        let good = ExposureOptions::default();
        for (options, named) in [
            (ExposureOptions { rays: 0, ..good }, "`rays` is 0"),
            (ExposureOptions { fall_speed: f32::NAN, ..good }, "`fall_speed` is NaN"),
            (ExposureOptions { wind: Vec3::new(0.0, 0.0, f32::INFINITY), ..good }, "`wind.z`"),
            (ExposureOptions { wind: Vec3::Y * 7.0, ..good }, "`wind.y`"),
            (ExposureOptions { source: RainSource::Sky { spread: 2.0 }, ..good }, "`spread`"),
        ] {
            assert!(error(options).contains(named), "{}", error(options));
        }
        let source = RainSource::Plane { center: Vec3::Y, half_size: Vec2::new(1.0, 0.0) };
        assert!(error(ExposureOptions { source, ..good }).contains("`half_size.y`"));
        assert!(matches!(exposure(&scene, &[], 4, &good, |_| {}), Err(WetMapError::NoSurface)));
        assert!(matches!(exposure(&scene, &[], 9000, &good, |_| {}), Err(WetMapError::Size { .. })));
    }
}
