//! Asking a place how wet it is, since when, and from which emitter. The panel shows it as it changes; what a click has found is
//! in the log, too.

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::collision::{CollisionScene, SceneHit};
use bevy_weathering::matter::SurfaceMatter;
use bevy_weathering::overlay::{Splat, Weatherable};
use bevy_weathering::wetting::{Origin, SurfaceWater, WetGeometry, Wetness, WetnessQuery};

use super::hose::Pointed;
use super::selection::{Selected, name_of};
use super::settings::{Settings, Tool};
use super::sources;
use super::split::Split;
use super::ui::{AddPanel, Place};

/// The farthest place that can be asked, metres.
const REACH: f32 = 10_000.0;

/// The place that was asked last.
#[derive(Resource, Default)]
pub struct Probed(pub Option<SceneHit>);

/// What is there.
#[derive(Resource, Default)]
struct Reading(Option<Texel>);

/// What a texel holds.
struct Texel {
    wetness: Wetness,
    /// Column and row.
    at: [u32; 2],
    /// Seconds since its water was last moved.
    moved: Option<f64>,
    /// If it is wet and that is known: where its water came from, and seconds since it was dry.
    origin: Option<(Origin, Option<f64>)>,
    /// Dust, mud and snow, mm.
    matter_mm: [f64; 3],
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Probed>()
        .init_resource::<Reading>()
        .add_systems(Update, (ask, read, tell.run_if(is_clicked)).chain())
        .add_panel(Place::Maps, "probe", show);
}

/// What lies below the cursor: nothing of a copy, which nobody sees there.
pub fn hit(scene: &CollisionScene, split: Option<&Split>, ray: Ray3d) -> Option<SceneHit> {
    let line = [ray.origin, ray.origin + ray.direction * REACH];
    let [start, end] = split.map_or(Some(line), |split| split.without_copy(line))?;
    scene.cast(start, end)
}

fn ask(
    pointed: Res<Pointed>,
    mut settings: ResMut<Settings>,
    scene: Res<CollisionScene>,
    split: Option<Res<Split>>,
    mut probed: ResMut<Probed>,
    mut selected: ResMut<Selected>,
) {
    if settings.tool != Tool::Probe || !pointed.held {
        return;
    }
    let Some(hit) = pointed.ray.and_then(|ray| hit(&scene, split.as_deref(), ray)) else { return };
    selected.0 = Some(hit.surface);
    probed.0 = Some(hit);
    // What was asked for is to be seen.
    settings.maps = true;
}

type Asked =
    (&'static Weatherable, &'static SurfaceWater, &'static WetGeometry, Option<&'static SurfaceMatter>);

fn read(
    clock: Res<WeatheringClock>,
    wetness: WetnessQuery,
    surfaces: Query<Asked>,
    probed: Res<Probed>,
    mut reading: ResMut<Reading>,
) {
    reading.0 = probed.0.and_then(|hit| {
        let (surface, water, geometry, matter) = surfaces.get(hit.surface).ok()?;
        // Of the maps that it has: where the budget is short, they are smaller than it wishes for.
        let size = water.size();
        let at = Splat::center_from_uv(hit.uv, size, surface.wrap()).map(|middle| (middle >> 8) as u32);
        let texel = at[1] * size + at[0];
        // Maps of another size are on their way.
        if geometry.0.size() != size {
            return None;
        }
        let texel = geometry.0.stand_in(texel).unwrap_or(texel);
        let tick = water.texels().get(texel as usize).map_or(0, |state| state.tick);
        let ago = |tick: u32| f64::from(clock.tick().saturating_sub(tick)) / f64::from(clock.hz());
        let since = |tick: u32| (tick > 0).then(|| ago(tick));
        let moved = since(tick);
        let wetness = wetness.at_uv(hit.surface, hit.uv)?;
        let is_wet = wetness.film_mm + wetness.absorbed_mm > 0.0;
        let origin = water.origin(texel).filter(|_| is_wet).map(|origin| (origin, since(origin.since)));
        let unit_mm = geometry.0.unit_mm(water.units(), texel);
        let held = matter.and_then(|matter| matter.texels().get(texel as usize)).copied().unwrap_or_default();
        let matter_mm = [held.dust, held.mud, held.snow].map(|units| f64::from(units) * unit_mm);
        Some(Texel { wetness, at, moved, origin, matter_mm })
    });
}

/// Whether a place was asked by a click in this frame; not while the button is held.
fn is_clicked(pointed: Res<Pointed>, probed: Res<Probed>) -> bool {
    pointed.pressed && probed.is_changed()
}

/// For whoever keeps what was found, or cannot read the panel.
fn tell(world: &World) {
    let found = world.resource::<Probed>().0.zip(world.resource::<Reading>().0.as_ref());
    if let Some((hit, texel)) = found {
        let rows = rows(world, &hit, texel);
        let rows: Vec<String> = rows.iter().map(|(label, value)| format!("{label} {value}")).collect();
        info!("probe: {}", rows.join("; "));
    }
}

/// All that there is to say of a place.
fn rows(world: &World, hit: &SceneHit, texel: &Texel) -> Vec<(&'static str, String)> {
    let Wetness { wetness, film_mm, absorbed_mm, saturation } = texel.wetness;
    let ago = |seconds: f64| format!("{seconds:.1} s ago");
    let mut rows = vec![
        ("surface", name_of(world, hit.surface)),
        ("texel", format!("{} {}", texel.at[0], texel.at[1])),
        ("uv", format!("{:.4} {:.4}", hit.uv.x, hit.uv.y)),
        ("place, m", format!("{:.3} {:.3} {:.3}", hit.point.x, hit.point.y, hit.point.z)),
        ("looks wet", format!("{:.0} %", wetness * 100.0)),
        ("film", format!("{film_mm:.4} mm")),
        ("absorbed", format!("{absorbed_mm:.4} mm")),
        ("pores full", format!("{:.0} %", saturation * 100.0)),
        ("last moved", texel.moved.map_or_else(|| "never wet".to_owned(), ago)),
    ];
    if let Some((origin, since)) = texel.origin {
        rows.push(("wet since", since.map_or_else(|| "longer than is known".to_owned(), ago)));
        rows.push(("water from", sources::name(world, origin.source)));
    }
    let [dust, mud, snow] = texel.matter_mm;
    rows.push(("dust", format!("{dust:.4} mm")));
    rows.push(("mud", format!("{mud:.4} mm")));
    rows.push(("snow, as water", format!("{snow:.4} mm")));
    rows
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    ui.heading("Probe");
    let Some(hit) = world.resource::<Probed>().0 else {
        ui.label("Choose the probe (I) and click into the scene.");
        return;
    };
    let Some(texel) = &world.resource::<Reading>().0 else {
        ui.label("The place has gone.");
        return;
    };
    egui::Grid::new("probe").num_columns(2).striped(true).show(ui, |ui| {
        for (label, value) in rows(world, &hit, texel) {
            ui.label(label);
            ui.monospace(value);
            ui.end_row();
        }
    });
}

#[cfg(test)]
mod tests {
    use bevy_weathering::emitter::Source;

    use super::*;

    #[test]
    fn whose_water_it_is_is_said_of_what_is_wet() {
        let mut world = World::new();
        let hit = SceneHit {
            surface: world.spawn(Name::new("wall")).id(),
            fraction: 0.5,
            triangle: 0,
            point: Vec3::new(1.0, 2.0, 3.0),
            normal: Vec3::Y,
            uv: Vec2::splat(0.25),
            uv_per_metre: Vec2::ONE,
            along: [Vec3::X, Vec3::Z],
            back: false,
        };
        let mut texel = Texel {
            wetness: Wetness::default(),
            at: [3, 4],
            moved: None,
            origin: None,
            matter_mm: [0.0, 0.5, 0.0],
        };
        let says = |texel: &Texel, label: &str| {
            let rows = rows(&world, &hit, texel);
            rows.into_iter().find_map(|(other, value)| (other == label).then_some(value))
        };
        assert_eq!(says(&texel, "surface").as_deref(), Some("wall"));
        assert_eq!(says(&texel, "place, m").as_deref(), Some("1.000 2.000 3.000"));
        assert_eq!(says(&texel, "mud").as_deref(), Some("0.5000 mm"));
        assert_eq!(says(&texel, "last moved").as_deref(), Some("never wet"));
        assert_eq!((says(&texel, "wet since"), says(&texel, "water from")), (None, None));
        texel.moved = Some(1.0);
        texel.origin = Some((Origin { source: Source::BY_HAND, since: 60 }, Some(2.0)));
        assert_eq!(says(&texel, "last moved").as_deref(), Some("1.0 s ago"));
        assert_eq!(says(&texel, "wet since").as_deref(), Some("2.0 s ago"));
        assert_eq!(says(&texel, "water from").as_deref(), Some("a brush"));
    }
}
