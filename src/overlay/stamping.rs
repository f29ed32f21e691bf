//! The stamp an impact leaves: as large in metres as its effect says, wherever the uvs are wide or narrow.

use bevy::math::{Mat3A, Vec3A};
use bevy::prelude::*;
use bytemuck::Zeroable;

use super::frames::pack_axis;
use super::site::Site;
use super::splat::pack_unorm;
use super::{Splat, StampAtlas, Wrap};
use crate::collision::Impact;
use crate::effect::drops::{drop_mm3, spread_mm};
use crate::effect::{EffectRow, StampTurn, WeatherEffect};
use crate::material::film::ripples::pcg;
use crate::matter::DepositStamp;

/// A drop of diameter d spreads to `d We^1/4`; We grows with d, and d with the cube root of the volume.
const SPREAD_BY_VOLUME: f32 = 5.0 / 12.0;

/// Radius of the mark of an impact, metres, before it is drawn out.
fn radius(impact: &Impact, effect: &WeatherEffect, row: &EffectRow) -> f32 {
    let volume_mm3 = impact.volume_nl as f32 * 1e-3;
    let speed = impact.velocity.dot(impact.normal).abs();
    let own = match effect.stamp_radius {
        Some(radius) => {
            let part = volume_mm3 / effect.volume_mm3;
            // Most particles carry what the effect says, or more.
            let by_volume = if part < 1.0 { part.powf(SPREAD_BY_VOLUME) } else { 1.0 };
            radius * by_volume * row.width_by_speed(speed)
        }
        None => {
            let diameter = row.diameters_mm[usize::from(impact.class)];
            let drops = (volume_mm3 / drop_mm3(diameter)).max(1.0);
            0.5e-3 * spread_mm(diameter, speed) * drops.sqrt()
        }
    };
    own * (1.0 + effect.stamp_radius_jitter * signed_hash(impact.sequence.0))
}

/// How much longer than wide the mark of an impact is: what flies in aslant is drawn out along its flight.
fn stretch(impact: &Impact, effect: &WeatherEffect) -> f32 {
    let steepness = impact.velocity.normalize_or_zero().dot(impact.normal).abs();
    (1.0 / steepness.max(0.05)).min(1.0 + effect.stamp_stretch)
}

/// How large the mark of an impact is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mark {
    /// Radius before it is drawn out, metres.
    radius: f32,
    /// How much longer than wide, 1 or more.
    stretch: f32,
}

impl Mark {
    pub(super) fn of(impact: &Impact, row: &EffectRow, effect: &WeatherEffect) -> Self {
        Self { radius: radius(impact, effect, row), stretch: stretch(impact, effect) }
    }
}

/// Half the width and height, 1/256 texel, of the patch of a map with `size` texels along each side over which an impact's water,
/// dust or snow is shared out: of the box around its mark. The mark is an ellipse, the patch lies straight on the map: so it is
/// drawn out as the mark is where that lies along u or v, and wider than it in between.
pub(super) fn patch_radius(impact: &Impact, mark: Mark, size: u32) -> [i32; 2] {
    let own = mark.radius;
    let long = own * mark.stretch;
    let flight = impact.velocity.reject_from(impact.normal).normalize_or_zero();
    let reach = impact.along.map(|axis| {
        let along = flight.dot(axis).clamp(-1.0, 1.0).powi(2);
        (own * own * (1.0 - along) + long * long * along).sqrt()
    });
    Splat::radius_from_uv(impact.uv_per_metre * Vec2::from(reach), size)
}

/// Axes of a stamp on a surface: the first two lie in it, the third is the normal of its front.
struct Axes {
    s: Vec3,
    t: Vec3,
    n: Vec3,
}

impl Axes {
    fn new(impact: &Impact, turn: StampTurn, front: Vec3) -> Self {
        // What comes straight down has no direction on the surface, but for rounding.
        let along = |direction: Vec3| {
            let flat = direction.reject_from(front);
            (flat.length() > 1e-3 * direction.length()).then(|| flat.normalize())
        };
        let any = || front.any_orthonormal_vector();
        let t = match turn {
            StampTurn::Random => {
                let (sin, cos) = (std::f32::consts::PI * signed_hash(!impact.sequence.0)).sin_cos();
                let first = along(impact.along[0]).unwrap_or_else(any);
                first * cos + front.cross(first) * sin
            }
            StampTurn::Flight => along(impact.velocity).unwrap_or_else(any),
            StampTurn::Downhill => along(Vec3::NEG_Y).or_else(|| along(impact.velocity)).unwrap_or_else(any),
        };
        Self { s: t.cross(front), t, n: front }
    }

    /// Those that lie in the surface, for a mark that is longer than wide along its flight: across it is narrower.
    fn drawn_out(&self, impact: &Impact, stretch: f32) -> [Vec3; 2] {
        let flight = impact.velocity.reject_from(self.n).normalize_or_zero();
        [self.s, self.t].map(|axis| {
            let along = flight * axis.dot(flight);
            along + (axis - along) * stretch
        })
    }
}

/// The front of the surface, on which the map lies.
fn front(impact: &Impact) -> Vec3 {
    if impact.back { -impact.normal } else { impact.normal }
}

/// The number of the stamp of an impact, for a mark with this radius on the map; none of a dome.
fn stamp_number(impact: &Impact, row: &EffectRow, radius: [i32; 2], stretch: f32) -> Option<u32> {
    let (first, count @ 1..) = row.stamps else { return None };
    let variant = pcg(impact.sequence.0 ^ 0x5bd1_e995) % count;
    Some(StampAtlas::number(first, variant, radius, stretch))
}

/// An axis of a stamp on the map: along u and v, 1/1024.
fn row_on_map(axis: Vec3, impact: &Impact) -> [i32; 2] {
    impact.along.map(|along| (axis.dot(along) * 1024.0).round() as i32)
}

/// How the stamp of an impact lies on a map of this size, as if it were painted there: its matter is shared out by it. None of a
/// dome.
pub(super) fn deposit_stamp(
    impact: &Impact,
    row: &EffectRow,
    effect: &WeatherEffect,
    mark: Mark,
    size: u32,
) -> Option<DepositStamp> {
    let radius = Splat::radius_from_uv(impact.uv_per_metre * (mark.radius * mark.stretch), size);
    let number = stamp_number(impact, row, radius, mark.stretch)?;
    let axes = Axes::new(impact, effect.stamp_turn, front(impact));
    let rows = axes.drawn_out(impact, mark.stretch).map(|axis| row_on_map(axis, impact));
    Some(DepositStamp { number, radius, rows })
}

/// The stamp of an impact, on maps of this size with these edges.
pub(super) fn splat_from_impact(
    impact: &Impact,
    row: &EffectRow,
    effect: &WeatherEffect,
    mark: Mark,
    (size, wrap): (u32, [Wrap; 2]),
    site: Option<&Site>,
    (tick, water_nl): (u32, u32),
) -> Splat {
    let stretch = mark.stretch;
    let long = mark.radius * stretch;
    let [r, g, b] = effect.diffuse.color;
    let [reflectance, smoothness, unused] = effect.specular.color;
    let mut splat = Splat {
        center: Splat::center_from_uv(impact.uv, size, wrap),
        radius: Splat::radius_from_uv(impact.uv_per_metre * long, size),
        water_nl,
        tick,
        diffuse: pack_unorm([r, g, b, effect.diffuse.opacity]),
        specular: pack_unorm([reflectance, smoothness, unused, effect.specular.opacity]),
        bump: (effect.bump * 127.0).round() as i32,
        bump_opacity: if effect.bump == 0.0 { 0 } else { 255 },
        ..Zeroable::zeroed()
    };
    // Without paint it has no shape: it is only a place where a drop has fallen.
    if !effect.paints() {
        return splat;
    }
    splat.stamp = stamp_number(impact, row, splat.radius, stretch).unwrap_or(0);
    let axes = Axes::new(impact, effect.stamp_turn, front(impact));
    let [s, t] = axes.drawn_out(impact, stretch);
    match site {
        Some(site) => {
            // Never so small that it falls between texels.
            let pitch = 1.0 / (impact.uv_per_metre.min_element() * size as f32).max(1e-6);
            lay_in_space(&mut splat, site, [s, t, axes.n], &axes, long.max(0.75 * pitch));
        }
        None => {
            let row = |axis: Vec3| {
                let [along_u, along_v] = row_on_map(axis, impact);
                [along_u, along_v, 0]
            };
            (splat.row_s, splat.row_t) = (row(s), row(t));
        }
    }
    splat
}

/// Puts a stamp of this radius, metres, where it is on the surface. `rows`: its axes, drawn out; all in world space.
fn lay_in_space(splat: &mut Splat, site: &Site, rows: [Vec3; 3], axes: &Axes, radius: f32) {
    let (frames, matrix) = (site.frames, site.world_from_mesh);
    let step = frames.step();
    // From steps of the mesh to 1/256 radius.
    let scale = f64::from(step) * 256.0 / f64::from(radius) * 65_536.0;
    let in_mesh = |axis: Vec3| Vec3::from(matrix.transpose() * Vec3A::from(axis));
    let row = |axis: Vec3| in_mesh(axis).to_array().map(|part| (f64::from(part) * scale).round() as i32);
    [splat.row_s, splat.row_t, splat.row_n] = rows.map(row);
    let metres_per_step = step * least_stretch(matrix);
    splat.origin = frames.steps(site.point);
    let reach = (2.0 * radius / metres_per_step.max(1e-12)).ceil().clamp(2.0, 131_070.0);
    // `framed` adds up three products of a row with it.
    let largest = [splat.row_s, splat.row_t, splat.row_n].into_iter().flatten().map(i32::unsigned_abs).max();
    splat.reach =
        (reach as i32).min((i64::from(i32::MAX) / (3 * i64::from(largest.unwrap_or(1).max(1)))) as i32);
    let axis = |axis: Vec3| pack_axis(in_mesh(axis).normalize_or_zero());
    (splat.axis_s, splat.axis_t, splat.axis_n) = (axis(axes.s), axis(axes.t), axis(axes.n));
    splat.in_space = 1;
}

/// The length, in metres, of what is shortest in the world of all that has the length 1 in the mesh: the least singular value, or
/// up to 4 % less.
fn least_stretch(world_from_mesh: Mat3A) -> f32 {
    // The greatest eigenvalue of a symmetric matrix is no greater than its norm; its powers come ever nearer.
    let norm = |matrix: &Mat3A| {
        [matrix.x_axis, matrix.y_axis, matrix.z_axis]
            .map(|row| row.abs().element_sum())
            .into_iter()
            .fold(0.0, f32::max)
    };
    let inverse = (world_from_mesh.transpose() * world_from_mesh).inverse_or_zero();
    let first = norm(&inverse);
    let power = (0..3).fold(inverse * first.recip(), |power, _| power * power);
    let greatest = first * norm(&power).sqrt().sqrt().sqrt();
    let least = greatest.sqrt().recip();
    // Flat as a sheet of paper, or no matrix at all.
    if least.is_finite() && least > 0.0 { least } else { world_from_mesh.determinant().abs().cbrt() }
}

/// An even number in [0, 1).
pub(super) fn unit_hash(number: u32) -> f32 {
    (pcg(number) >> 8) as f32 / (1u32 << 24) as f32
}

/// An even number in [-1, 1).
fn signed_hash(number: u32) -> f32 {
    pcg(number) as f32 / (1u32 << 31) as f32 - 1.0
}

#[cfg(test)]
mod tests {
    use bevy::math::Affine3A;

    use super::super::frames::Frames;
    use super::*;
    use crate::collision::MeshTriangles;
    use crate::effect::{Carries, EffectIndex, EffectTable, Paint, ShippedEffect, StampSource};
    use crate::particle::Sequence;
    use crate::stamps::StampKind;
    use crate::wetting::TexelGeometry;

    fn impact(velocity: Vec3) -> Impact {
        Impact {
            sequence: Sequence(5),
            surface: Entity::PLACEHOLDER,
            triangle: 0,
            point: Vec3::new(0.5, 0.0, -0.25),
            normal: Vec3::Y,
            uv: Vec2::new(0.75, 0.375),
            uv_per_metre: Vec2::splat(0.5),
            along: [Vec3::X, Vec3::Z],
            back: false,
            velocity,
            effect: EffectIndex(0),
            class: 0,
            volume_nl: 4189,
        }
    }

    fn splat(impact: &Impact, effect: WeatherEffect, site: Option<&Site>) -> Splat {
        let mut table = EffectTable::default();
        table.insert(Handle::default(), effect);
        let row = &table.rows()[0];
        let effect = row.effect.as_ref().unwrap();
        let mark = Mark::of(impact, row, effect);
        splat_from_impact(impact, row, effect, mark, (64, [Wrap::Clamp; 2]), site, (1, impact.volume_nl))
    }

    fn paint(stamp_radius: f32) -> WeatherEffect {
        let diffuse = Paint { opacity: 1.0, ..default() };
        WeatherEffect { stamp_radius: Some(stamp_radius), stamp_speed: Some(0.0), diffuse, ..default() }
    }

    #[test]
    fn marks_are_as_large_as_the_effect_says_or_as_its_drops_spread() {
        let straight = impact(Vec3::NEG_Y * 6.55);
        assert_eq!(splat(&straight, paint(0.25), None).radius, [8 * 256; 2]);
        // A part of its drops' usual volume leaves a smaller mark, more a mark as ever.
        let with = |volume_nl: u32| splat(&Impact { volume_nl, ..straight }, paint(0.25), None).radius[0];
        assert_eq!(with(4189 * 1000), 8 * 256);
        let part = with(4189 / 8) as f32 / (8.0 * 256.0);
        assert!((part - 0.5f32.powf(1.25)).abs() < 0.01, "{part}");
        // A drop of 2 mm spreads to 11.8 mm: too small for these texels of 31 mm. Ten thousand of them are not.
        let drops = WeatherEffect { stamp_radius: None, ..paint(1.0) };
        assert_eq!(splat(&straight, drops.clone(), None).radius, [Splat::MIN_RADIUS; 2]);
        let many = Impact { volume_nl: 4189 * 10_000, ..straight };
        let radius = splat(&many, drops, None).radius[0] as f32 / 256.0 / 32.0;
        assert!((0.5..0.65).contains(&radius), "{radius} m");
    }

    #[test]
    fn at_a_quarter_of_the_speed_a_mark_of_as_much_water_is_half_as_wide() {
        let shipped = ShippedEffect::ALL.map(|shipped| (shipped.name, shipped.read().unwrap()));
        for (name, effect) in shipped.into_iter().chain([("as drops spread", WeatherEffect::default())]) {
            let spreads = matches!(effect.carries, Carries::Water | Carries::Mud(_));
            let volume_nl = (effect.volume_mm3 * 1000.0) as u32;
            let mut table = EffectTable::default();
            table.insert(Handle::default(), effect);
            let row = &table.rows()[0];
            let radius = |velocity: Vec3| {
                let impact = Impact { volume_nl, ..impact(velocity) };
                Mark::of(&impact, row, row.effect.as_ref().unwrap()).radius
            };
            // What lies along the surface does not count.
            let part = radius(Vec3::new(3.0, -1.5, 0.0)) / radius(Vec3::NEG_Y * 6.0);
            let expected = if spreads { 0.5 } else { 1.0 };
            assert!((part - expected).abs() < 1e-3, "{name}: {part}");
        }
    }

    #[test]
    fn shipped_marks_are_about_as_large_as_their_drops_spread() {
        // The hose's slugs are 2.7 drops of 4 mm, a drip is one of 3.6 mm.
        let hose = ShippedEffect::named("hose").unwrap().read().unwrap();
        for (effect, diameter) in [(hose, 4.0), (crate::wetting::drip_effect(), 3.63)] {
            let drops = effect.volume_mm3 / drop_mm3(diameter);
            let spread = 0.5e-3 * spread_mm(diameter, effect.stamp_speed.unwrap()) * drops.sqrt();
            let part = effect.stamp_radius.unwrap() / spread;
            assert!((part - 1.0).abs() < 0.06, "{part}");
        }
    }

    #[test]
    fn matter_is_shared_out_by_the_stamp_that_is_painted() {
        let aslant = impact(Vec3::new(3.0, -1.0, 0.5));
        let stamps = StampSource::Kind(StampKind::Splat);
        let painted = WeatherEffect { stamps, stamp_stretch: 1.0, ..paint(0.25) };
        let bare = WeatherEffect { diffuse: Paint::default(), ..painted.clone() };
        let mut atlas = StampAtlas::default();
        let mut both = |effect: WeatherEffect| {
            let mut table = EffectTable::default();
            table.insert(Handle::default(), effect);
            for (numbers, set) in table.without_stamps() {
                *numbers = (atlas.add(set).unwrap(), set.variants.len() as u32);
            }
            let row = &table.rows()[0];
            let effect = row.effect.as_ref().unwrap();
            let mark = Mark::of(&aslant, row, effect);
            let map = (64, [Wrap::Clamp; 2]);
            let splat = splat_from_impact(&aslant, row, effect, mark, map, None, (1, aslant.volume_nl));
            (splat, deposit_stamp(&aslant, row, effect, mark, 64))
        };
        let (splat, lies) = both(painted);
        let lies = lies.unwrap();
        assert!(splat.stamp > 0);
        assert_eq!((lies.number, lies.radius), (splat.stamp, splat.radius));
        assert_eq!(lies.rows, [splat.row_s, splat.row_t].map(|[along_u, along_v, _]| [along_u, along_v]));
        // What paints nothing has its shape, too, but painters are not told.
        let (splat, unpainted) = both(bare.clone());
        assert_eq!((splat.stamp, unpainted), (0, Some(lies)));
        let (_, dome) = both(WeatherEffect { stamps: StampSource::Dome, ..bare });
        assert_eq!(dome, None);
    }

    #[test]
    fn what_flies_in_aslant_is_drawn_out_along_its_flight() {
        let aslant = impact(Vec3::new(3.0, -1.0, 0.0));
        let effect = WeatherEffect { stamp_stretch: 1.0, stamp_turn: StampTurn::Flight, ..paint(0.25) };
        let long = splat(&aslant, effect, None);
        // Twice as long, and across that as wide as before: its v axis lies along +x, its u axis across.
        assert_eq!(long.radius, [16 * 256; 2]);
        assert_eq!(long.row_t, [1024, 0, 0]);
        assert_eq!((long.row_s[0], long.row_s[1].abs()), (0, 2048));
    }

    #[test]
    fn water_is_shared_out_over_a_patch_that_is_drawn_out_along_the_flight_and_no_wider() {
        let effect = WeatherEffect { stamp_stretch: 1.0, ..paint(0.25) };
        let mut table = EffectTable::default();
        table.insert(Handle::default(), effect);
        let row = &table.rows()[0];
        let patch = |velocity: Vec3| {
            let effect = row.effect.as_ref().unwrap();
            let impact = impact(velocity);
            patch_radius(&impact, Mark::of(&impact, row, effect), 64).map(|radius| radius as f32 / 256.0)
        };
        assert_eq!(patch(Vec3::NEG_Y), [8.0; 2]);
        assert_eq!(patch(Vec3::new(3.0, -1.0, 0.0)), [16.0, 8.0]);
        assert_eq!(patch(Vec3::new(0.0, -1.0, -3.0)), [8.0, 16.0]);
        // Between the axes: half of the squares of both, 12.6.
        let between = patch(Vec3::new(3.0, -1.0, 3.0));
        assert!(between.iter().all(|along| (along - 12.65).abs() < 0.02), "{between:?}");
    }

    #[test]
    fn in_space_the_same_point_of_the_stamp_lies_on_the_same_point_of_the_surface() {
        let plane = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
        let triangles = MeshTriangles::from_mesh(&plane).unwrap();
        let wrap = [Wrap::Clamp; 2];
        let geometry = TexelGeometry::new(&triangles, &Affine3A::IDENTITY, Vec3::Y, 64, wrap);
        let frames = Frames::new(&triangles, &geometry, wrap);
        // The plane in world space: twice as large, turned and moved.
        let turn = Quat::from_rotation_z(0.7);
        let world_from_mesh = Affine3A::from_scale_rotation_translation(Vec3::splat(2.0), turn, Vec3::ONE);
        let hit = Impact {
            point: world_from_mesh.transform_point3(Vec3::new(0.5, 0.0, -0.25)),
            normal: turn * Vec3::Y,
            along: [turn * Vec3::X, turn * Vec3::Z],
            uv_per_metre: Vec2::splat(0.25),
            velocity: turn * Vec3::NEG_Y,
            ..impact(Vec3::ZERO)
        };
        let site = Site::rigid(&frames, &world_from_mesh, hit.point);
        let splat = splat(&hit, WeatherEffect { stamp_turn: StampTurn::Flight, ..paint(0.5) }, Some(&site));
        assert_eq!(splat.in_space, 1);
        assert_eq!(splat.axis_n, frames.texels[0].normal);
        // Half a metre is a quarter in the mesh, an eighth of its width, and twice that is its reach.
        assert!((splat.reach - 65_536 / 4).abs() < 20, "{}", splat.reach);
        let away = |mesh: Vec3| {
            let at = frames.steps(mesh);
            let away = [0, 1, 2].map(|axis| at[axis] - splat.origin[axis]);
            [splat.row_s, splat.row_t, splat.row_n]
                .map(|row| super::super::kernel::framed(row, away, splat.reach))
        };
        assert!(away(Vec3::new(0.5, 0.0, -0.25)).iter().all(|part| part.abs() <= 1));
        for step in [Vec3::X, Vec3::Z] {
            let [s, t, n] = away(Vec3::new(0.5, 0.0, -0.25) + step * 0.125);
            let distance = ((s * s + t * t) as f32).sqrt();
            assert!((distance - 128.0).abs() < 2.0 && n.abs() <= 1, "{s} {t} {n}");
        }
    }

    #[test]
    fn on_a_surface_that_is_scaled_more_in_one_direction_a_stamp_is_round_and_whole() {
        let plane = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
        let triangles = MeshTriangles::from_mesh(&plane).unwrap();
        let wrap = [Wrap::Clamp; 2];
        let geometry = TexelGeometry::new(&triangles, &Affine3A::IDENTITY, Vec3::Y, 64, wrap);
        let frames = Frames::new(&triangles, &geometry, wrap);
        let scale = Vec3::new(1.0, 1.0, 0.125);
        let world_from_mesh = Affine3A::from_scale(scale);
        let hit = Impact { point: Vec3::ZERO, uv_per_metre: Vec2::new(0.5, 4.0), ..impact(Vec3::NEG_Y) };
        let site = Site::rigid(&frames, &world_from_mesh, hit.point);
        let splat = splat(&hit, WeatherEffect { stamp_turn: StampTurn::Flight, ..paint(0.1) }, Some(&site));
        let mut tiles = vec![];
        frames.tiles_near(splat.origin, splat.reach / 2, |tile| tiles.push(tile));
        let mut inside = 0;
        for (texel, frame) in (0u32..).zip(&frames.texels) {
            let Some(at) = frame.place() else { continue };
            let away = [0, 1, 2].map(|axis| at[axis] - splat.origin[axis]);
            let way = IVec3::from_array(away).as_vec3() * frames.step() * scale;
            let expected = way.length() / 0.1;
            let [s, t] = [splat.row_s, splat.row_t]
                .map(|row| super::super::kernel::framed(row, away, splat.reach) as f32 / 256.0);
            let part = s.hypot(t);
            if expected < 1.0 {
                inside += 1;
                assert!((part - expected).abs() < 0.03, "{texel}: {part} for {expected}");
                assert!(tiles.contains(&(texel / 64 / 16 * 4 + texel % 64 / 16)), "{texel}: {tiles:?}");
            } else {
                assert!(part > 0.97, "{texel}: {part} for {expected}");
            }
        }
        // An ellipse of 0.1 by 0.8 on a map of 2 by 2, 64 texels along each side.
        assert!((240..270).contains(&inside), "{inside}");
    }

    #[test]
    fn the_least_stretch_is_that_of_the_shortest_axis_however_it_is_turned() {
        for scale in
            [Vec3::splat(0.3), Vec3::new(2.0, 1.0, 5.0), Vec3::new(-0.1, 1.0, 1.0), Vec3::splat(1e-4)]
        {
            for turn in [Quat::IDENTITY, Quat::from_euler(EulerRot::XYZ, 0.4, 1.1, -0.8)] {
                let matrix =
                    Mat3A::from_quat(turn) * Mat3A::from_diagonal(scale) * Mat3A::from_quat(turn.inverse());
                let part = least_stretch(matrix) / scale.abs().min_element();
                assert!((0.96..1.001).contains(&part), "{scale} {turn}: {part}");
            }
        }
        assert!(!least_stretch(Mat3A::ZERO).is_nan());
    }

    #[test]
    fn jitter_is_even_and_within_bounds() {
        let mean: f32 = (0..10_000).map(signed_hash).inspect(|h| assert!(h.abs() <= 1.0)).sum::<f32>() / 1e4;
        assert!(mean.abs() < 0.02, "{mean}");
    }
}
