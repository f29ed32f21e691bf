//! Sliders and the like, all alike.

use bevy_egui::egui::{self, Response, Ui};
use bevy_weathering::material::range_of;

/// Whether the small numbers of a range would be but a few pixels of its slider.
fn is_wide(least: f32, most: f32) -> bool {
    least >= 0.0 && (most > 50.0 * least.max(1.0) || (least > 0.0 && most > 500.0 * least))
}

/// A number within a range. Wide ranges are logarithmic. What is out of it already stays so until somebody edits it.
pub fn number(ui: &mut Ui, label: &str, value: &mut f32, (least, most): (f32, f32), about: &str) {
    let slider = egui::Slider::new(value, least..=most)
        .logarithmic(is_wide(least, most))
        .smallest_positive(1e-3)
        .clamping(egui::SliderClamping::Edits)
        .text(label);
    let slider = ui.add(slider);
    if !about.is_empty() {
        slider.on_hover_text(format!("{about}\n{least} to {most}"));
    }
}

/// A number of a material, by the name of its field. `symbol`: as papers have it; `most`: what a slider reaches up to, if the
/// allowed range is far wider; more can be typed.
pub fn parameter(ui: &mut Ui, symbol: &str, field: &str, value: &mut f32, most: Option<f32>, about: &str) {
    let Some((least, allowed)) = range_of(field) else { return };
    let most = most.unwrap_or(allowed).min(allowed);
    let slider = egui::Slider::new(value, least..=most)
        .logarithmic(is_wide(least, most))
        .smallest_positive(1e-3)
        .clamping(egui::SliderClamping::Never)
        .text(symbol);
    ui.add(slider).on_hover_text(format!("{field}: {about}\n{least} to {allowed}"));
    // What is typed may be anything.
    if !(*value >= least && *value <= allowed) {
        *value = if value.is_nan() { least } else { value.clamp(least, allowed) };
    }
}

/// A colour, linear RGB. It stays as it is to the bit until somebody chooses another: the way to its hue and back rounds, and
/// what is rounded would count as edited.
pub fn color(ui: &mut Ui, rgb: &mut [f32; 3]) -> Response {
    let mut chosen = *rgb;
    let button = ui.color_edit_button_rgb(&mut chosen);
    if button.changed() {
        *rgb = chosen;
    }
    button
}

/// The same with opacity, not premultiplied.
pub fn color_and_opacity(ui: &mut Ui, rgba: &mut [f32; 4]) -> Response {
    let mut chosen = *rgba;
    let button = ui.color_edit_button_rgba_unmultiplied(&mut chosen);
    if button.changed() {
        *rgba = chosen;
    }
    button
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_over_several_powers_of_ten_are_wide() {
        // Metres of a brush, litres of a hose, mm/h of rain.
        assert!([(0.005, 5.0), (0.1, 100.0), (0.0, 200.0)].iter().all(|&(least, most)| is_wide(least, most)));
        // Parts, degrees, and strengths.
        assert!(
            [(0.0, 1.0), (-180.0, 180.0), (0.01, 1.0)].iter().all(|&(least, most)| !is_wide(least, most))
        );
    }

    #[test]
    fn colours_that_are_only_looked_at_stay_to_the_bit() {
        for value in [0.1, 0.3, 0.7, 0.82] {
            let (rgb, rgba) = ([value, 0.45, 0.9], [0.75, value, 0.9, 0.35]);
            let (mut one, mut other) = (rgb, rgba);
            egui::__run_test_ui(|ui| {
                color(ui, &mut one);
                color_and_opacity(ui, &mut other);
            });
            assert_eq!((one, other), (rgb, rgba));
        }
    }
}
