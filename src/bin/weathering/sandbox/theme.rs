//! How panels look: dark, calm, with text that can be read at 1280 x 720 and, by the zoom, on screens of any density.

use std::ops::RangeInclusive;

use bevy_egui::egui::style::NumberFormatter;
use bevy_egui::egui::{self, Color32, FontId, Stroke, TextStyle, Vec2, emath};

/// What stands out.
pub const ACCENT: Color32 = Color32::from_rgb(88, 166, 214);
/// What is wrong, or dangerous.
pub const WARNING: Color32 = Color32::from_rgb(236, 178, 96);

/// The smallest and the largest zoom of the panels.
pub const ZOOM: (f32, f32) = (0.6, 3.0);

/// Dresses a context. Once: it is kept from frame to frame.
pub fn apply(context: &egui::Context) {
    context.set_theme(egui::Theme::Dark);
    let formatter = NumberFormatter::new(without_sign_of_zero);
    context.all_styles_mut(|style| {
        style.number_formatter = formatter.clone();
        style.text_styles = [
            (TextStyle::Small, FontId::proportional(11.0)),
            (TextStyle::Body, FontId::proportional(13.5)),
            (TextStyle::Button, FontId::proportional(13.5)),
            (TextStyle::Monospace, FontId::monospace(12.5)),
            (TextStyle::Heading, FontId::proportional(16.5)),
        ]
        .into();
        let spacing = &mut style.spacing;
        spacing.item_spacing = Vec2::new(6.0, 5.0);
        spacing.button_padding = Vec2::new(7.0, 3.0);
        spacing.slider_width = 120.0;
        spacing.combo_width = 130.0;
        let visuals = &mut style.visuals;
        visuals.panel_fill = Color32::from_rgb(27, 30, 34);
        visuals.window_fill = Color32::from_rgb(31, 34, 39);
        visuals.extreme_bg_color = Color32::from_rgb(17, 19, 22);
        visuals.faint_bg_color = Color32::from_rgb(35, 39, 44);
        visuals.override_text_color = Some(Color32::from_rgb(222, 226, 230));
        visuals.hyperlink_color = ACCENT;
        visuals.warn_fg_color = WARNING;
        visuals.selection.bg_fill = Color32::from_rgb(38, 92, 130);
        visuals.selection.stroke = Stroke::new(1.0, Color32::WHITE);
    });
}

/// A number as egui writes it, but 0 where all digits are: angles of what points straight ahead come as -0, or as less than is
/// shown.
fn without_sign_of_zero(value: f64, decimals: RangeInclusive<usize>) -> String {
    let text = emath::format_with_decimals_in_range(value, decimals);
    match text.strip_prefix('-') {
        Some(digits) if digits.bytes().all(|byte| matches!(byte, b'0' | b'.')) => digits.to_owned(),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_has_no_sign_and_other_numbers_keep_theirs() {
        let context = egui::Context::default();
        apply(&context);
        let formatter = context.style_of(egui::Theme::Dark).number_formatter.clone();
        let shown = |value: f64, decimals| formatter.format(value, decimals);
        assert_eq!(shown(-0.0, 0..=2), "0");
        assert_eq!((shown(-1e-9, 1..=2), shown(-0.001, 1..=2)), ("0.0".into(), "0.00".into()));
        assert_eq!((shown(-0.25, 0..=2), shown(-10.0, 0..=2)), ("-0.25".into(), "-10".into()));
        assert_eq!((shown(0.0, 0..=2), shown(90.0, 0..=1)), ("0".into(), "90".into()));
    }

    /// WCAG's relative luminance.
    fn luminance(color: Color32) -> f32 {
        let linear = |byte: u8| {
            let value = f32::from(byte) / 255.0;
            if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * linear(color.r()) + 0.7152 * linear(color.g()) + 0.0722 * linear(color.b())
    }

    #[test]
    fn text_stands_out_from_what_it_is_on() {
        let context = egui::Context::default();
        apply(&context);
        let style = context.style_of(egui::Theme::Dark);
        let text = style.visuals.override_text_color.unwrap();
        for ground in [style.visuals.panel_fill, style.visuals.window_fill, style.visuals.selection.bg_fill] {
            let contrast = (luminance(text) + 0.05) / (luminance(ground) + 0.05);
            // WCAG's AA for text of this size.
            assert!(contrast > 4.5, "{ground:?}: {contrast}");
        }
        assert!(style.text_styles.values().all(|font| font.size >= 11.0));
    }
}
