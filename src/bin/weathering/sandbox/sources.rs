//! Names and colours of where water came from.

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::emitter::{Source, TrackSources};

use super::selection::name_of;

/// What it is called.
pub fn name(world: &World, source: Source) -> String {
    let emitter = world.get_resource::<TrackSources>().and_then(|track| track.emitter(source));
    match emitter {
        Some(emitter) if world.get_entity(emitter).is_ok() => name_of(world, emitter),
        Some(_) => format!("an emitter that has gone ({})", source.0),
        None if source == Source::BY_HAND => "a brush".into(),
        None => "nobody knows".into(),
    }
}

/// A colour of its own; grey for what nobody knows.
pub fn colour(source: Source) -> egui::Color32 {
    match source {
        Source::UNKNOWN => egui::Color32::from_gray(120),
        Source::BY_HAND => egui::Color32::WHITE,
        Source(number) => {
            // Neighbours lie a golden angle apart.
            let hue = (f32::from(number) * 137.508) % 360.0;
            let [red, green, blue, _] = Color::hsl(hue, 0.8, 0.6).to_srgba().to_u8_array();
            egui::Color32::from_rgb(red, green, blue)
        }
    }
}

/// All that there may be, with their colours: emitters that are there still, brushes and the rest.
pub fn legend(ui: &mut egui::Ui, world: &World) {
    let emitters = world.get_resource::<TrackSources>().map_or(&[][..], TrackSources::emitters);
    let numbers = (1u16..).zip(emitters).filter(|(_, emitter)| world.get_entity(**emitter).is_ok());
    let numbers = numbers.map(|(number, _)| Source(number));
    for source in numbers.chain([Source::BY_HAND, Source::UNKNOWN]) {
        ui.colored_label(colour(source), name(world, source));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_sources_have_colours_of_their_own() {
        let colours: Vec<_> = (0..12).chain([u16::MAX]).map(|number| colour(Source(number))).collect();
        for (index, one) in colours.iter().enumerate() {
            assert!(colours[..index].iter().all(|other| other != one), "{index}");
        }
    }

    #[test]
    fn sources_have_names_also_without_emitters() {
        let world = World::new();
        assert_eq!(name(&world, Source::BY_HAND), "a brush");
        assert_eq!(name(&world, Source(3)), "nobody knows");
    }
}
