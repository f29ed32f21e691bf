//! The maps of the selected surface: what is painted on it, as it is on the GPU, and what it holds, read anew every half second.

use std::time::Instant;

use bevy::prelude::*;
use bevy_egui::{EguiTextureHandle, EguiUserTextures, egui};
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::emitter::Source;
use bevy_weathering::matter::SurfaceMatter;
use bevy_weathering::overlay::Overlays;
use bevy_weathering::wetting::{Exposure, SurfaceWater, TexelGeometry, WetGeometry, Wetness, WetnessQuery};

use super::selection::{Selected, choose_surface};
use super::settings::Settings;
use super::ui::{AddPanel, Place};
use super::{shades, sources};

/// Samples along each side.
const SIDE: usize = 128;
/// Seconds between two readings.
const EVERY: f32 = 0.5;

/// In place of the source of water where there is none.
const DRY: f32 = -1.0;

/// What is shown of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Channel {
    Wetness,
    Film,
    Absorbed,
    Saturation,
    Since,
    Source,
    Dust,
    Mud,
    Snow,
    Air,
    Sun,
    Colour,
    Gloss,
    Normal,
}

impl Channel {
    /// With their names, and what is seen in them.
    const ALL: [(Self, &'static str, &'static str); 14] = [
        (Self::Wetness, "looks wet", "How wet it looks: 0 is dry, 1 is soaked"),
        (Self::Film, "film", "Water that lies on it, mm"),
        (Self::Absorbed, "absorbed", "Water in its pores, mm"),
        (Self::Saturation, "pores full", "Part of its pores that is full of water"),
        (Self::Since, "wet for", "Seconds since it was dry"),
        (Self::Source, "source", "Which emitter its water came from"),
        (Self::Dust, "dust", "mm"),
        (Self::Mud, "mud", "mm"),
        (Self::Snow, "snow", "As much water as it melts to, mm"),
        (Self::Air, "air", "How well air gets there, and dries: 1 is an even surface in the open"),
        (Self::Sun, "sun", "How much of the sun gets there, and dries"),
        (Self::Colour, "colour", "What marks have painted: colour"),
        (Self::Gloss, "gloss", "What marks have painted: reflectance and smoothness"),
        (Self::Normal, "normal", "What marks have painted: slopes"),
    ];

    /// The image on the GPU, for those that are painted.
    fn image(self, overlays: &Overlays) -> Option<&Handle<Image>> {
        match self {
            Self::Colour => Some(&overlays.diffuse),
            Self::Gloss => Some(&overlays.specular),
            Self::Normal => Some(&overlays.normal),
            _ => None,
        }
    }

    /// What red, green and blue of a painted map say.
    fn colours(self) -> [&'static str; 3] {
        match self {
            Self::Gloss => ["reflectance", "smoothness", "nothing"],
            Self::Normal => ["slope along u", "slope along v", "nothing"],
            _ => ["red", "green", "blue"],
        }
    }

    /// Whether it is a part of a whole.
    fn is_part(self) -> bool {
        matches!(self, Self::Wetness | Self::Saturation | Self::Sun)
    }

    /// Behind its numbers.
    fn unit(self) -> &'static str {
        match self {
            Self::Since => " s",
            // Of what an even surface in the open gets; more on what stands out.
            Self::Air => "",
            _ if self.is_part() => "",
            _ => " mm",
        }
    }

    fn of_water(self, wetness: &Wetness) -> f32 {
        match self {
            Self::Film => wetness.film_mm,
            Self::Absorbed => wetness.absorbed_mm,
            Self::Saturation => wetness.saturation,
            _ => wetness.wetness,
        }
    }
}

/// What is shown, and what of it has been read.
#[derive(Resource)]
struct MapView {
    channel: Channel,
    /// Of a painted map, whether red, green and blue are shown.
    shown: [bool; 3],
    /// Row by row from v = 0; empty until it has been read.
    values: Vec<f32>,
    /// Of what, and when.
    read: Option<(Entity, Channel, Instant)>,
    is_new: bool,
    texture: Option<egui::TextureHandle>,
}

impl Default for MapView {
    fn default() -> Self {
        Self {
            channel: Channel::Wetness,
            shown: [true; 3],
            values: Vec::new(),
            read: None,
            is_new: false,
            texture: None,
        }
    }
}

pub fn plugin(app: &mut App) {
    app.init_resource::<MapView>().add_systems(Update, sample).add_panel(Place::Maps, "maps", show);
}

fn sample(
    settings: Res<Settings>,
    selected: Res<Selected>,
    clock: Res<WeatheringClock>,
    wetness: WetnessQuery,
    surfaces: Query<(&SurfaceWater, &WetGeometry, Option<&SurfaceMatter>, Option<&Exposure>)>,
    mut view: ResMut<MapView>,
) {
    let Some(surface) = selected.0.filter(|_| settings.maps && settings.panels) else { return };
    let channel = view.channel;
    let is_fresh = view.read.is_some_and(|(of, what, when)| {
        (of, what) == (surface, channel) && when.elapsed().as_secs_f32() < EVERY
    });
    if is_fresh || matches!(channel, Channel::Colour | Channel::Gloss | Channel::Normal) {
        return;
    }
    let Ok((water, geometry, matter, exposure)) = surfaces.get(surface) else { return };
    let of_matter = |uv: Vec2| {
        let texel = texel_at(water.size(), &geometry.0, uv)?;
        let held = matter?.texels().get(texel as usize)?;
        let units = match channel {
            Channel::Dust => held.dust,
            Channel::Mud => held.mud,
            _ => held.snow,
        };
        Some((f64::from(units) * geometry.0.unit_mm(water.units(), texel)) as f32)
    };
    let wet_from = |uv: Vec2| {
        let here = wetness.at_uv(surface, uv)?;
        let texel = texel_at(water.size(), &geometry.0, uv)?;
        (here.film_mm + here.absorbed_mm > 0.0).then(|| water.origin(texel).unwrap_or_default())
    };
    let middle = |index: usize| (index as f32 + 0.5) / SIDE as f32;
    let value = |index: usize| {
        let uv = Vec2::new(middle(index % SIDE), middle(index / SIDE));
        match channel {
            Channel::Dust | Channel::Mud | Channel::Snow => of_matter(uv).unwrap_or(0.0),
            Channel::Since => wet_from(uv).map_or(0.0, |origin| seconds_since(&clock, origin.since)),
            Channel::Air | Channel::Sun => {
                let texel = texel_at(water.size(), &geometry.0, uv);
                let parts = exposure.zip(texel).and_then(|(exposure, texel)| exposure.get(texel));
                // What is used while it is not known.
                let (air, sun) = parts.unwrap_or((1.0, 0.0));
                (if channel == Channel::Air { air } else { sun }) as f32
            }
            Channel::Source => wet_from(uv).map_or(DRY, |origin| f32::from(origin.source.0)),
            _ => wetness.at_uv(surface, uv).map_or(0.0, |wetness| channel.of_water(&wetness)),
        }
    };
    view.values.clear();
    view.values.extend((0..SIDE * SIDE).map(value));
    view.read = Some((surface, channel, Instant::now()));
    view.is_new = true;
}

/// Seconds of weather from a tick until now.
fn seconds_since(clock: &WeatheringClock, tick: u32) -> f32 {
    (f64::from(clock.tick().saturating_sub(tick)) / f64::from(clock.hz())) as f32
}

/// The texel below a uv of 0..=1, of a map with so many along each side.
fn texel_under(size: u32, uv: Vec2) -> u32 {
    let [x, y] = [uv.x, uv.y].map(|along| ((along * size as f32) as u32).min(size.saturating_sub(1)));
    y * size + x
}

/// The texel in which the water and the matter of a place are; `None` while the map is measured anew.
pub fn texel_at(size: u32, geometry: &TexelGeometry, uv: Vec2) -> Option<u32> {
    let under = texel_under(size, uv);
    (geometry.size() == size).then(|| geometry.stand_in(under).unwrap_or(under))
}

/// What the brightest colour stands for.
fn most(values: &[f32], channel: Channel) -> f32 {
    if channel.is_part() { 1.0 } else { values.iter().copied().fold(1e-3, f32::max) }
}

/// What leaves only some of red, green and blue of a picture.
fn tint([red, green, blue]: [bool; 3]) -> egui::Color32 {
    let part = |is_shown: bool| if is_shown { 255 } else { 0 };
    egui::Color32::from_rgb(part(red), part(green), part(blue))
}

/// From black over blue to white.
pub fn colour(part: f32) -> egui::Color32 {
    let byte = |from: f32, to: f32| (((part - from) / (to - from)).clamp(0.0, 1.0) * 255.0) as u8;
    egui::Color32::from_rgb(byte(0.6, 1.0), byte(0.25, 0.9), byte(0.0, 0.6))
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    ui.separator();
    ui.heading("Maps");
    choose_surface(ui, world);
    let Some(surface) = world.resource::<Selected>().0 else { return };
    let mut channel = world.resource::<MapView>().channel;
    ui.horizontal_wrapped(|ui| {
        for (other, name, about) in Channel::ALL {
            ui.selectable_value(&mut channel, other, name).on_hover_text(about);
        }
    });
    world.resource_mut::<MapView>().channel = channel;
    let side = ui.available_width().clamp(64.0, 512.0);
    let size = egui::Vec2::splat(side);
    let Some(overlays) = world.get::<Overlays>(surface) else { return };
    if let Some(image) = channel.image(overlays).cloned() {
        ui.small(format!("{0} x {0} texels, premultiplied", overlays.size));
        let mut shown = world.resource::<MapView>().shown;
        ui.horizontal_wrapped(|ui| {
            for (is_shown, name) in shown.iter_mut().zip(channel.colours()) {
                ui.toggle_value(is_shown, name);
            }
        });
        world.resource_mut::<MapView>().shown = shown;
        // Does not keep the map of a surface that has gone.
        let handle = EguiTextureHandle::Weak(image.id());
        let texture = world.resource_mut::<EguiUserTextures>().add_image(handle);
        ui.add(egui::Image::new((texture, size)).bg_fill(egui::Color32::BLACK).tint(tint(shown)));
        return;
    }
    let mut view = world.resource_mut::<MapView>();
    if !view.read.is_some_and(|(of, what, _)| (of, what) == (surface, channel)) {
        ui.spinner();
        return;
    }
    let most = most(&view.values, channel);
    if view.is_new || view.texture.is_none() {
        view.is_new = false;
        let of_source = |value: f32| {
            if value == DRY { egui::Color32::BLACK } else { sources::colour(Source(value as u16)) }
        };
        let is_source = channel == Channel::Source;
        let pixel = |value: &f32| if is_source { of_source(*value) } else { colour(value / most) };
        let pixels = view.values.iter().map(pixel).collect();
        let image = egui::ColorImage::new([SIDE, SIDE], pixels);
        let options = egui::TextureOptions::NEAREST;
        match &mut view.texture {
            Some(texture) => texture.set(image, options),
            None => view.texture = Some(ui.ctx().load_texture("map", image, options)),
        }
    }
    let Some(texture) = &view.texture else { return };
    let shown = ui.add(egui::Image::new((texture.id(), size)).sense(egui::Sense::hover()));
    let hovered = shown.hover_pos().and_then(|at| {
        let part = (at - shown.rect.min) / shown.rect.size();
        let [x, y] = [part.x, part.y].map(|part| ((part * SIDE as f32) as usize).min(SIDE - 1));
        Some((part, *view.values.get(y * SIDE + x)?))
    });
    if channel == Channel::Source {
        if let Some((part, value)) = hovered {
            let name = if value == DRY { "dry".into() } else { sources::name(world, Source(value as u16)) };
            ui.label(format!("uv {:.3} {:.3}: {name}", part.x, part.y));
        }
        sources::legend(ui, world);
        return;
    }
    let unit = channel.unit();
    shades::ramp(ui, "0", &format!("{most:.3}{unit}"));
    if let Some((part, value)) = hovered {
        ui.label(format!("uv {:.3} {:.3}: {value:.4}{unit}", part.x, part.y));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_is_brighter_and_nothing_is_black() {
        let sum = |part| colour(part).to_array()[..3].iter().map(|&byte| u32::from(byte)).sum::<u32>();
        assert_eq!((sum(0.0), sum(1.0)), (0, 3 * 255));
        assert!((1..=10).all(|step| sum(step as f32 / 10.0) > sum((step - 1) as f32 / 10.0)));
        assert_eq!(sum(f32::NAN), 0);
        assert_eq!(most(&[0.0, 3.0, 2.0], Channel::Film), 3.0);
        assert_eq!(most(&[0.0, 0.2], Channel::Wetness), 1.0);
        assert!(most(&[], Channel::Dust) > 0.0);
    }

    #[test]
    fn every_map_has_a_name_and_a_unit() {
        let names: std::collections::BTreeSet<_> = Channel::ALL.iter().map(|(_, name, _)| name).collect();
        assert_eq!(names.len(), Channel::ALL.len());
        let units = [Channel::Since, Channel::Film, Channel::Sun].map(Channel::unit);
        assert_eq!(units, [" s", " mm", ""]);
        assert_eq!(tint([true; 3]), egui::Color32::WHITE);
        assert_eq!(tint([false, true, false]).to_array(), [0, 255, 0, 255]);
    }
}
