//! What surfaces hold, in false colours on them.
//!
//! Over each surface lies a cover: a child that shows the same mesh, without light, with a picture over the uvs of its maps. One
//! surface a frame is read anew, the one that was read longest ago, and none more often than it is worth.
//!
//! Surfaces that are posed get none.

use std::time::Instant;

use bevy::asset::RenderAssetUsages;
use bevy::camera::visibility::RenderLayers;
use bevy::image::{ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::light::NotShadowCaster;
use bevy::mesh::UvChannel;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_egui::egui;
use bevy_weathering::collision::{DeformingCollider, SurfaceCollider, UvSet};
use bevy_weathering::overlay::{Weatherable, Wrap};
use bevy_weathering::wetting::{SurfaceWater, WetGeometry, Wetness, WetnessQuery};

use super::settings::{Settings, Shade};
use super::{maps, sources};

/// Samples along each side.
const SIDE: u32 = 128;
/// Seconds between two readings of a surface.
const EVERY: f32 = 0.5;
/// Film that is shown in white, mm.
const MOST_FILM_MM: f32 = 0.5;
/// How much of the surface the cover hides, 0..=255.
const OPACITY: u8 = 225;
/// Pieces of the colours that are shown beside their meaning.
const STEPS: usize = 24;
/// So that it lies on its surface, and not in it.
const DEPTH_BIAS: f32 = 8.0;

/// A cover, on a child of its surface.
#[derive(Component)]
pub struct Cover {
    image: Handle<Image>,
    /// How what lies between two samples is seen. A picture that is shown keeps it.
    filter: ImageFilterMode,
    /// What was read into it, and when.
    read: Option<(Shade, Instant)>,
}

pub fn plugin(app: &mut App) {
    app.add_systems(Update, (lay, paint).chain());
}

/// What is shown, and what the colours stand for.
pub fn show(ui: &mut egui::Ui, world: &mut World) {
    ui.heading("On surfaces");
    let mut shade = world.resource::<Settings>().views.shade;
    ui.horizontal_wrapped(|ui| {
        for (kind, name, about) in [
            (Shade::Off, "their look", "As they look"),
            (Shade::Wetness, "wetness", "How wet they look"),
            (Shade::Film, "film", "Water that lies on them"),
            (Shade::Saturation, "saturation", "Part of their pores that is full"),
            (Shade::Source, "source", "Which emitter it was"),
        ] {
            ui.selectable_value(&mut shade, kind, name).on_hover_text(about);
        }
    });
    if world.resource::<Settings>().views.shade != shade {
        world.resource_mut::<Settings>().views.shade = shade;
    }
    legend(ui, world, shade);
}

fn legend(ui: &mut egui::Ui, world: &World, shade: Shade) {
    match shade {
        Shade::Off => {}
        Shade::Wetness | Shade::Saturation => ramp(ui, "0", "100 %"),
        Shade::Film => ramp(ui, "0", &format!("{MOST_FILM_MM} mm or more")),
        Shade::Source => sources::legend(ui, world),
    }
}

/// What the colours in the scene stand for, in its upper left corner: nobody has to know which panel has it.
pub fn show_key(context: &egui::Context, free: egui::Rect, world: &World) {
    let shade = world.resource::<Settings>().views.shade;
    let name = match shade {
        Shade::Off => return,
        Shade::Wetness => "how wet surfaces look",
        Shade::Film => "water on surfaces",
        Shade::Saturation => "how full pores are",
        Shade::Source => "where water came from",
    };
    let area = egui::Area::new("shades".into()).interactable(false).order(egui::Order::Middle);
    area.fixed_pos(free.left_top() + egui::vec2(10.0, 10.0)).show(context, |ui| {
        egui::Frame::popup(ui.style()).show(ui, |ui| {
            ui.set_max_width((free.width() - 40.0).max(120.0));
            ui.label(format!("false colours: {name} (V: next)"));
            legend(ui, world, shade);
        });
    });
}

/// The colours from nothing to all, between what the two ends are.
pub fn ramp(ui: &mut egui::Ui, least: &str, most: &str) {
    ui.horizontal(|ui| {
        ui.small(least);
        let (rect, _) = ui.allocate_exact_size(egui::vec2(96.0, 10.0), egui::Sense::hover());
        let step = rect.width() / STEPS as f32;
        for index in 0..STEPS {
            let left = rect.left() + step * index as f32;
            let piece =
                egui::Rect::from_min_size(egui::pos2(left, rect.top()), egui::vec2(step, rect.height()));
            let colour = maps::colour((index as f32 + 0.5) / STEPS as f32);
            ui.painter().rect_filled(piece, 0.0, colour);
        }
        let line = egui::Stroke::new(1.0, egui::Color32::GRAY);
        ui.painter().rect_stroke(rect, 0.0, line, egui::StrokeKind::Outside);
        ui.small(most);
    });
}

type Coverable =
    (Entity, &'static Weatherable, &'static Mesh3d, Option<&'static UvSet>, Option<&'static RenderLayers>);
type AtRest = (With<SurfaceCollider>, Without<DeformingCollider>);

/// Gives surfaces covers, and takes away those that are not wanted or do not fit any more.
fn lay(
    settings: Res<Settings>,
    mut commands: Commands,
    mut images: ResMut<Assets<Image>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    surfaces: Query<Coverable, AtRest>,
    covers: Query<(Entity, &Cover, &ChildOf, &Mesh3d)>,
    mut covered: Local<Vec<Entity>>,
) {
    let is_on = settings.views.shade != Shade::Off;
    let wanted = filter(settings.views.shade);
    covered.clear();
    for (entity, cover, surface, mesh) in &covers {
        let surface = surface.parent();
        let fits = surfaces.get(surface).is_ok_and(|(_, _, shown, ..)| shown.id() == mesh.id());
        if is_on && fits && cover.filter == wanted {
            covered.push(surface);
        } else {
            commands.entity(entity).try_despawn();
        }
    }
    if !is_on {
        return;
    }
    covered.sort_unstable();
    for (surface, maps, mesh, uvs, layers) in &surfaces {
        if covered.binary_search(&surface).is_ok() {
            continue;
        }
        let image = images.add(picture(maps.wrap(), wanted));
        let material = materials.add(StandardMaterial {
            base_color_texture: Some(image.clone()),
            base_color_channel: match uvs {
                Some(UvSet::Second) => UvChannel::Uv1,
                _ => UvChannel::Uv0,
            },
            unlit: true,
            alpha_mode: AlphaMode::Blend,
            cull_mode: None,
            depth_bias: DEPTH_BIAS,
            ..default()
        });
        let mut cover = commands.spawn((
            Cover { image, filter: wanted, read: None },
            Name::new("cover"),
            Mesh3d(mesh.0.clone()),
            MeshMaterial3d(material),
            Transform::IDENTITY,
            NotShadowCaster,
            ChildOf(surface),
        ));
        if let Some(layers) = layers {
            cover.insert(layers.clone());
        }
    }
}

/// An empty picture that is repeated as the maps are.
fn picture(wrap: [Wrap; 2], filter: ImageFilterMode) -> Image {
    let size = Extent3d { width: SIDE, height: SIDE, depth_or_array_layers: 1 };
    let format = TextureFormat::Rgba8UnormSrgb;
    let mut image =
        Image::new_fill(size, TextureDimension::D2, &[0; 4], format, RenderAssetUsages::default());
    let [address_mode_u, address_mode_v] = wrap.map(|wrap| match wrap {
        Wrap::Repeat => ImageAddressMode::Repeat,
        Wrap::Clamp => ImageAddressMode::ClampToEdge,
    });
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u,
        address_mode_v,
        mag_filter: filter,
        min_filter: filter,
        ..ImageSamplerDescriptor::linear()
    });
    image
}

/// How what lies between two samples is seen: a source is one or the other, of an amount there is something in between.
fn filter(shade: Shade) -> ImageFilterMode {
    if shade == Shade::Source { ImageFilterMode::Nearest } else { ImageFilterMode::Linear }
}

/// Reads a surface into the picture of its cover.
fn paint(
    settings: Res<Settings>,
    wetness: WetnessQuery,
    surfaces: Query<(&SurfaceWater, &WetGeometry)>,
    mut covers: Query<(&mut Cover, &ChildOf)>,
    mut images: ResMut<Assets<Image>>,
) {
    let shade = settings.views.shade;
    let when = |cover: &Cover| cover.read.filter(|(of, _)| *of == shade).map(|(_, when)| when);
    let is_due = |cover: &Cover| when(cover).is_none_or(|when| when.elapsed().as_secs_f32() >= EVERY);
    // One that holds nothing yet would be the next for ever.
    let can_be_read = |surface: &ChildOf| surfaces.contains(surface.parent());
    let due = covers.iter_mut().filter(|(cover, surface)| is_due(cover) && can_be_read(surface));
    let due = due.min_by_key(|(cover, _)| when(cover));
    let Some((mut cover, surface)) = due.filter(|_| shade != Shade::Off) else { return };
    let surface = surface.parent();
    let Ok((water, geometry)) = surfaces.get(surface) else { return };
    let Some(mut image) = images.get_mut(&cover.image) else { return };
    let Some(data) = &mut image.data else { return };
    for (pixel, index) in data.chunks_exact_mut(4).zip(0u32..) {
        let uv = (Vec2::new((index % SIDE) as f32, (index / SIDE) as f32) + 0.5) / SIDE as f32;
        let here = wetness.at_uv(surface, uv).unwrap_or_default();
        let color = match shade {
            Shade::Source => source_colour(water, geometry, &here, uv),
            _ => maps::colour(part(shade, &here)),
        };
        pixel.copy_from_slice(&[color.r(), color.g(), color.b(), OPACITY]);
    }
    cover.read = Some((shade, Instant::now()));
}

/// From 0, black, to 1, white.
fn part(shade: Shade, here: &Wetness) -> f32 {
    match shade {
        Shade::Film => here.film_mm / MOST_FILM_MM,
        Shade::Saturation => here.saturation,
        _ => here.wetness,
    }
}

fn source_colour(water: &SurfaceWater, geometry: &WetGeometry, here: &Wetness, uv: Vec2) -> egui::Color32 {
    if here.film_mm + here.absorbed_mm <= 0.0 {
        return egui::Color32::BLACK;
    }
    let origin = maps::texel_at(water.size(), &geometry.0, uv).and_then(|texel| water.origin(texel));
    sources::colour(origin.unwrap_or_default().source)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_is_brighter_and_a_picture_has_room_for_all_samples() {
        let wet = Wetness { wetness: 0.5, film_mm: 0.25, absorbed_mm: 1.0, saturation: 0.75 };
        assert_eq!(
            [Shade::Wetness, Shade::Film, Shade::Saturation].map(|shade| part(shade, &wet)),
            [0.5, 0.5, 0.75]
        );
        let image = picture([Wrap::Repeat, Wrap::Clamp], filter(Shade::Source));
        assert_eq!(image.data.map(|data| data.len()), Some(4 * (SIDE * SIDE) as usize));
        let ImageSampler::Descriptor(sampler) = image.sampler else { panic!("it has a sampler of its own") };
        assert!(matches!(sampler.address_mode_u, ImageAddressMode::Repeat));
        assert!(matches!(sampler.address_mode_v, ImageAddressMode::ClampToEdge));
        assert_eq!(sampler.mag_filter, ImageFilterMode::Nearest);
        assert_eq!(filter(Shade::Film), ImageFilterMode::Linear);
    }
}
