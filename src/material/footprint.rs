//! Which texels of a map without mip maps a pixel reads.
//!
//! Water and matter are evaluated at the moment they are drawn, from state that has no mip maps. Near by, a pixel lies between
//! four texels and reads them bilinearly. From afar it covers many: then it still reads four, but those in the middles of the
//! quarters of what it covers, with equal weights. So it costs the same, there is no jump from one to the other, and wet
//! spots flicker less as they get smaller than a pixel. Of the four, those beside the mesh and its gutter do not count: islands
//! would pale along their borders. It is no mean of all: that would take a pass over the state in every frame, since it changes
//! with time by itself.
//!
//! The function has a twin of the same name in `shaders/common/footprint.wgsl`.

/// Two texels along an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taps {
    /// The first.
    pub low: i32,
    /// The second.
    pub high: i32,
    /// The weight of the second, 0..=1; the first has the rest.
    pub part: f64,
}

/// `floor(p -+ s/2)` with `s = max(1, f/2)`; the weight goes from `fract(p - 1/2)` to `1/2` as `f` goes from 1 to 2.
///
/// `middle`: p, of the pixel, in texels; `covered`: f, texels that it covers along the axis, 0 or more.
pub fn axis_taps(middle: f64, covered: f64) -> Taps {
    let away = 0.5 * (0.5 * covered).max(1.0);
    let between = (middle - 0.5) - (middle - 0.5).floor();
    let part = between + (0.5 - between) * (covered - 1.0).clamp(0.0, 1.0);
    Taps { low: (middle - away).floor() as i32, high: (middle + away).floor() as i32, part }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a pixel reads of a row of texels.
    fn read(row: impl Fn(i32) -> f64, middle: f64, covered: f64) -> f64 {
        let taps = axis_taps(middle, covered);
        row(taps.low) * (1.0 - taps.part) + row(taps.high) * taps.part
    }

    #[test]
    fn near_by_it_is_bilinear() {
        let ramp = |texel: i32| f64::from(texel) + 0.5;
        for middle in [-3.2, 0.0, 0.5, 7.49, 7.5, 100.9] {
            for covered in [0.0, 0.3, 1.0] {
                assert!((read(ramp, middle, covered) - middle).abs() < 1e-9, "{middle} {covered}");
            }
        }
    }

    #[test]
    fn from_afar_it_is_the_mean_of_two_that_stand_for_half_of_it_each() {
        for covered in [2.0, 4.0, 9.0, 64.0] {
            for middle in [3.1, 40.0, 77.7] {
                let taps = axis_taps(middle, covered);
                assert_eq!(taps.part, 0.5);
                let inside = |texel: i32| (f64::from(texel) + 0.5 - middle).abs() <= covered / 2.0;
                assert!(taps.low < taps.high && inside(taps.low) && inside(taps.high), "{taps:?}");
                // A slope is read as it is, to the side of a texel.
                let ramp = |texel: i32| f64::from(texel) + 0.5;
                assert!((read(ramp, middle, covered) - middle).abs() <= 0.5);
            }
        }
    }

    #[test]
    fn there_is_no_jump_on_the_way() {
        let row = |texel: i32| f64::from(texel.rem_euclid(7) * texel.rem_euclid(3));
        for step in 0..100 {
            let covered = 0.02 * f64::from(step);
            let (here, next) = (read(row, 5.3, covered), read(row, 5.3, covered + 0.02));
            assert!((here - next).abs() < 0.2, "{covered}: {here} {next}");
        }
    }
}
