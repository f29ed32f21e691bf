//! Wet as somebody painted it: a second set of parameters, interpolated by wetness.
//!
//! For matter that no formula fits, or when the wet look is known from measurements or photographs. The function has a
//! twin of the same name in `shaders/common/authored.wgsl`.
//!
//! Lagarde 2013, *Water drop 3b: physically based wet surfaces*, names it as the way with full control.

/// One parameter between its dry and its wet value; `w`: wetness in `[0, 1]`.
pub fn authored(dry: f64, wet: f64, w: f64) -> f64 {
    dry + (wet - dry) * w
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_from_dry_to_wet() {
        assert_eq!(authored(0.4, 0.1, 0.0), 0.4);
        assert_eq!(authored(0.4, 0.1, 0.5), 0.25);
        assert!((authored(0.4, 0.1, 1.0) - 0.1).abs() < 1e-15);
    }
}
