//! Colours as spectra, to see what water does to each wavelength.
//!
//! A linear RGB colour becomes the smoothest spectrum that Smits' table makes of it, in ten bins; wetness is done there;
//! the result goes back through the CIE's colour matching functions. White comes back as white exactly, other colours to
//! within a percent or so.
//!
//! The experiment: a wet spectrum is the dry one, shifted down and drawn a little towards the reflectance of water. A
//! shift takes the same from every bin, so it takes relatively most from the dark ones: saturation rises, and the hue
//! turns towards the strongest bin.
//!
//! - Smits 1999, *An RGB to spectrum conversion for reflectances*.
//! - Wyman, Sloan, Shirley 2013, *Simple analytic approximations to the CIE XYZ color matching functions*.
//! - Lagarde 2013, *Water drop 3b: physically based wet surfaces*, for the experiment.

/// Bins of a spectrum: 34 nm each from 380 nm on.
pub const BINS: usize = 10;

/// Reflectance of water at normal incidence.
const WATER: f64 = 0.02;

/// A reflectance per bin.
pub type Spectrum = [f64; BINS];

const WHITE: Spectrum = [1.0, 1.0, 0.9999, 0.9993, 0.9992, 0.9998, 1.0, 1.0, 1.0, 1.0];
const CYAN: Spectrum = [0.9710, 0.9426, 1.0007, 1.0007, 1.0007, 1.0007, 0.1564, 0.0, 0.0, 0.0];
const MAGENTA: Spectrum = [1.0, 1.0, 0.9685, 0.2229, 0.0, 0.0458, 0.8369, 1.0, 1.0, 0.9959];
const YELLOW: Spectrum = [0.0001, 0.0, 0.1088, 0.6651, 1.0, 1.0, 0.9996, 0.9586, 0.9685, 0.9840];
const RED: Spectrum = [0.1012, 0.0515, 0.0, 0.0, 0.0, 0.0, 0.8325, 1.0149, 1.0149, 1.0149];
const GREEN: Spectrum = [0.0, 0.0, 0.0273, 0.7937, 1.0, 0.9418, 0.1719, 0.0, 0.0, 0.0025];
const BLUE: Spectrum = [1.0, 1.0, 0.8916, 0.3323, 0.0, 0.0, 0.0003, 0.0369, 0.0483, 0.0496];

/// A spectrum of a linear RGB colour, each channel in `[0, 1]`: white up to the least channel, the complement of the
/// least up to the middle one, the strongest primary for the rest. Smits 1999.
pub fn spectrum_from_rgb(rgb: [f64; 3]) -> Spectrum {
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| rgb[a].total_cmp(&rgb[b]));
    let [least, middle, most] = order;
    let secondary = [CYAN, MAGENTA, YELLOW][least];
    let primary = [RED, GREEN, BLUE][most];
    std::array::from_fn(|i| {
        WHITE[i] * rgb[least]
            + secondary[i] * (rgb[middle] - rgb[least])
            + primary[i] * (rgb[most] - rgb[middle])
    })
}

/// From spectra back to linear sRGB; made once.
#[derive(Debug, Clone)]
pub struct Observer {
    /// Weight of each bin in each channel.
    weights: [Spectrum; 3],
}

impl Default for Observer {
    fn default() -> Self {
        Self::new()
    }
}

impl Observer {
    /// The CIE's standard observer of 1931 under a light of equal energy, sRGB primaries, scaled so that a spectrum of
    /// ones is white.
    pub fn new() -> Self {
        // IEC 61966-2-1.
        const RGB_FROM_XYZ: [[f64; 3]; 3] = [
            [3.240_454_2, -1.537_138_5, -0.498_531_4],
            [-0.969_266_0, 1.876_010_8, 0.041_556_0],
            [0.055_643_4, -0.204_025_9, 1.057_225_2],
        ];
        let bins: [[f64; 3]; BINS] = std::array::from_fn(|bin| {
            let middles = (0..34).map(|nm| 380.5 + f64::from(34 * bin as u32 + nm));
            middles.map(color_matching).fold([0.0; 3], |sum, xyz| std::array::from_fn(|i| sum[i] + xyz[i]))
        });
        let weights = RGB_FROM_XYZ.map(|row| {
            let raw: Spectrum = std::array::from_fn(|bin| {
                row.iter().zip(bins[bin]).map(|(factor, value)| factor * value).sum()
            });
            let white: f64 = raw.iter().sum();
            raw.map(|weight| weight / white)
        });
        Self { weights }
    }

    /// Linear sRGB of a spectrum; saturated ones may leave `[0, 1]`.
    pub fn rgb_from_spectrum(&self, spectrum: &Spectrum) -> [f64; 3] {
        self.weights.map(|row| row.iter().zip(spectrum).map(|(weight, value)| weight * value).sum())
    }
}

/// The CIE's colour matching functions at a wavelength in nm, as sums of lopsided bells. Wyman et al. 2013.
fn color_matching(nm: f64) -> [f64; 3] {
    let bell = |middle: f64, below: f64, above: f64| {
        let t = (nm - middle) / if nm < middle { below } else { above };
        (-0.5 * t * t).exp()
    };
    [
        1.056 * bell(599.8, 37.9, 31.0) + 0.362 * bell(442.0, 16.0, 26.7) - 0.065 * bell(501.1, 20.4, 26.2),
        0.821 * bell(568.8, 46.9, 40.5) + 0.286 * bell(530.9, 16.3, 31.1),
        1.217 * bell(437.0, 11.8, 36.0) + 0.681 * bell(459.0, 26.0, 13.8),
    ]
}

/// The wet spectrum of a dry one: each bin less `shift`, not below 0, and by `lerp` of the way towards water.
pub fn wet_spectrum(dry: &Spectrum, shift: f64, lerp: f64) -> Spectrum {
    dry.map(|bin| {
        let shifted = (bin - shift).max(0.0);
        shifted + (WATER - shifted) * lerp
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_the_reference_vector() {
        let wet = wet_spectrum(&spectrum_from_rgb([0.45, 0.22, 0.15]), 0.05, 0.025);
        let rgb = Observer::new().rgb_from_spectrum(&wet);
        for (actual, expected) in rgb.into_iter().zip([0.388, 0.167, 0.098]) {
            assert!((actual - expected).abs() < 6e-4, "{rgb:?}");
        }
    }

    #[test]
    fn colours_come_back() {
        let observer = Observer::new();
        for white in [1.0, 0.5, 0.0] {
            let rgb = observer.rgb_from_spectrum(&spectrum_from_rgb([white; 3]));
            assert!(rgb.iter().all(|channel| (channel - white).abs() < 1e-3), "{rgb:?}");
        }
        for color in [[0.45, 0.22, 0.15], [0.2, 0.5, 0.3], [0.1, 0.2, 0.4], [0.4, 0.4, 0.1], [0.3, 0.1, 0.35]]
        {
            let rgb = observer.rgb_from_spectrum(&spectrum_from_rgb(color));
            for (back, channel) in rgb.into_iter().zip(color) {
                assert!((back - channel).abs() < 0.02, "{color:?} comes back as {rgb:?}");
            }
        }
    }

    #[test]
    fn a_shift_saturates() {
        let observer = Observer::new();
        let saturation = |rgb: [f64; 3]| {
            let (least, most) = rgb.iter().fold((1.0f64, 0.0f64), |(a, b), &c| (a.min(c), b.max(c)));
            1.0 - least / most
        };
        let dry = spectrum_from_rgb([0.45, 0.22, 0.15]);
        let saturations = [0.0, 0.03, 0.06, 0.09]
            .map(|shift| saturation(observer.rgb_from_spectrum(&wet_spectrum(&dry, shift, 0.0))));
        assert!(saturations.windows(2).all(|pair| pair[1] > pair[0]), "{saturations:?}");
        assert_eq!(wet_spectrum(&dry, 0.0, 0.0), dry);
        assert!(wet_spectrum(&dry, 2.0, 0.0).iter().all(|&bin| bin == 0.0));
        assert!(wet_spectrum(&dry, 0.0, 1.0).iter().all(|&bin| (bin - WATER).abs() < 1e-12));
    }
}
