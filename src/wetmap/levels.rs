//! Which ratios of two photographs mean dry, and which wet.
//!
//! The logarithm of wet over dry has a peak where nothing changed, not at 0 if the light did, and another one
//! below it where water darkened the surface. Above there may be anything: highlights on wet places, of any
//! strength. So the dry level is looked for first, as the uppermost peak that is a real one; what is above it
//! counts as dry, and Otsu's threshold splits the rest. Where few pixels are wet, that split cuts noise in
//! two. This shows, because then the halves lie hardly further apart than either is wide; wet is then what
//! lies far outside the noise, if anything does.

/// Width of a bin of the histogram.
const BIN: f32 = 0.005;

/// The histogram reaches from -LIMIT to LIMIT.
const LIMIT: f32 = 8.0;

const BINS: usize = (2.0 * LIMIT / BIN) as usize;

/// Water that darkens less than this (about a tenth) is not told from nothing.
pub(super) const LEAST_CONTRAST: f32 = 0.1;

/// How many standard deviations of the noise apart dry and wet must be where both are plenty,
const APART: f32 = 4.0;

/// and where wet is what lies outside the noise.
const FAR_APART: f32 = 6.0;

/// A peak as low as this part of the highest one is no peak, but part of the highlights.
const LEAST_PEAK: f32 = 0.05;

/// What the logarithm of wet over dry is like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Levels {
    /// Where nothing got wet.
    pub(super) dry: f32,
    /// Standard deviation there.
    pub(super) noise: f32,
    /// Where it did; `None` if it did nowhere.
    pub(super) wet: Option<f32>,
}

impl Levels {
    /// From the logarithm of each pixel, NaN where it is not known; `None` if it is known nowhere. Fewer than
    /// `least_pixels` are never wet.
    pub(super) fn new(log_ratios: &[f32], least_pixels: u64) -> Option<Self> {
        let histogram = Histogram::new(log_ratios);
        let dry = histogram.upper_peak()?;
        let split = histogram.otsu(dry);
        let noise = histogram.spread_below(dry, split);
        if let Some(wet) = histogram.median(0, split)
            && value(dry) - value(wet) >= LEAST_CONTRAST.max(APART * noise)
            && histogram.count(0, split) >= least_pixels
        {
            return Some(Self { dry: value(dry), noise, wet: Some(value(wet)) });
        }
        let noise = histogram.spread_below(dry, 0);
        let outside = bin(value(dry) - LEAST_CONTRAST.max(FAR_APART * noise));
        let enough = histogram.count(0, outside) >= least_pixels.max(1);
        let wet = histogram.median(0, outside).filter(|_| enough).map(value);
        Some(Self { dry: value(dry), noise, wet })
    }

    /// The logarithm below which a pixel is wet: halfway between the two in light, not in its logarithm,
    /// because a pixel that is half covered by a spot shows the mean of both.
    pub(super) fn threshold(&self) -> Option<f32> {
        self.wet.map(|wet| ((self.dry.exp() + wet.exp()) / 2.0).ln())
    }
}

/// How many pixels have which logarithm.
struct Histogram(Vec<u64>);

fn bin(value: f32) -> usize {
    // A cast saturates, so what lies outside is counted at the ends.
    (((value + LIMIT) / BIN) as usize).min(BINS - 1)
}

/// The middle of a bin.
fn value(bin: usize) -> f32 {
    (bin as f32 + 0.5) * BIN - LIMIT
}

impl Histogram {
    fn new(values: &[f32]) -> Self {
        let mut bins = vec![0; BINS];
        values.iter().filter(|value| value.is_finite()).for_each(|&value| bins[bin(value)] += 1);
        Self(bins)
    }

    /// Pixels in the bins from `first` up to, but not including, `end`.
    fn count(&self, first: usize, end: usize) -> u64 {
        self.0[first..end.max(first)].iter().sum()
    }

    /// The bin of the median of those in the bins from `first` up to `end`.
    fn median(&self, first: usize, end: usize) -> Option<usize> {
        let half = self.count(first, end).div_ceil(2);
        let mut below = 0;
        (first..end).find(|&bin| {
            below += self.0[bin];
            half > 0 && below >= half
        })
    }

    /// Standard deviation of noise around `peak`, from those between `first` and the peak: half of them lie
    /// within 0.6745 standard deviations. Their number does not matter, so neither do highlights above.
    fn spread_below(&self, peak: usize, first: usize) -> f32 {
        let median = self.median(first.min(peak), peak + 1).unwrap_or(peak);
        ((value(peak) - value(median)) / 0.6745).max(BIN)
    }

    /// The uppermost peak. `None` if there is nothing at all.
    fn upper_peak(&self) -> Option<usize> {
        let density = smoothed(&smoothed(&self.0));
        let highest = density.iter().copied().max().filter(|&highest| highest > 0)?;
        let mut at = density.iter().rposition(|&d| d as f32 >= LEAST_PEAK * highest as f32)?;
        // From its upper flank to its top, over what noise there is on it.
        let reach = (LEAST_CONTRAST / BIN) as usize;
        loop {
            let top = (at.saturating_sub(reach)..=at).max_by_key(|&bin| density[bin])?;
            if top == at {
                return Some(at);
            }
            at = top;
        }
    }

    /// The first bin of the upper class of Otsu 1979: where the variance between the two classes is greatest.
    /// All that lies above `dry` counts as `dry`.
    fn otsu(&self, dry: usize) -> usize {
        let number = |bin: usize| {
            let pixels = if bin < dry { self.0[bin] } else { self.count(dry, BINS) };
            pixels as f64
        };
        let total: f64 = (0..=dry).map(number).sum();
        let sum: f64 = (0..=dry).map(|bin| number(bin) * bin as f64).sum();
        let (mut below, mut sum_below) = (0.0, 0.0);
        let mut best = (0.0, 0);
        for bin in 0..dry {
            below += number(bin);
            sum_below += number(bin) * bin as f64;
            let above = total - below;
            if below > 0.0 && above > 0.0 {
                let apart = (sum - sum_below) / above - sum_below / below;
                let between = below * above * apart * apart;
                if between > best.0 {
                    best = (between, bin + 1);
                }
            }
        }
        best.1
    }
}

/// Sums over nine bins.
fn smoothed(bins: &[u64]) -> Vec<u64> {
    const RADIUS: usize = 4;
    let around = |bin: usize| bin.saturating_sub(RADIUS)..(bin + RADIUS + 1).min(bins.len());
    (0..bins.len()).map(|bin| bins[around(bin)].iter().sum()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::noise::{hash, unit};

    /// Numbers around 0 with this standard deviation: sums of twelve even ones.
    fn noise(seed: u32, count: u32, deviation: f32) -> impl Iterator<Item = f32> {
        (0..count).map(move |i| ((0..12).map(|j| unit(hash([seed, i, j]))).sum::<f32>() - 6.0) * deviation)
    }

    fn mixture(dry: u32, wet: u32, light: f32) -> Vec<f32> {
        let dry = noise(1, dry, 0.03).map(|value| value + light);
        dry.chain(noise(2, wet, 0.03).map(|value| value + light - 0.5)).collect()
    }

    #[test]
    fn both_levels_are_found_whichever_prevails_and_whatever_the_light() {
        for (dry, wet) in [(9000, 1000), (5000, 5000), (1500, 8500), (20_000, 60)] {
            for light in [0.0, -0.4, 0.7] {
                let levels = Levels::new(&mixture(dry, wet, light), 24).unwrap();
                assert!((levels.dry - light).abs() < 0.02, "{dry} {wet} {light}: {levels:?}");
                let found = levels.wet.unwrap_or(f32::NAN);
                assert!((found - light + 0.5).abs() < 0.03, "{dry} {wet} {light}: {levels:?}");
                let threshold = levels.threshold().unwrap() - light;
                assert!((threshold - ((1.0 + (-0.5f32).exp()) / 2.0).ln()).abs() < 0.03, "{threshold}");
            }
        }
    }

    #[test]
    fn highlights_do_not_move_the_levels() {
        let mut values = mixture(8000, 1500, 0.0);
        values.extend((0..800).map(|i| 0.1 + 2.0 * unit(hash([i, 5, 5]))));
        let levels = Levels::new(&values, 24).unwrap();
        assert!(levels.dry.abs() < 0.02 && (levels.wet.unwrap() + 0.5).abs() < 0.03, "{levels:?}");
    }

    #[test]
    fn noise_alone_is_dry() {
        for deviation in [0.0, 0.005, 0.02, 0.1] {
            for light in [0.0, -0.3] {
                let values: Vec<f32> = noise(7, 50_000, deviation).map(|value| value + light).collect();
                let levels = Levels::new(&values, 24).unwrap();
                assert_eq!(levels.wet, None, "{deviation} {light}: {levels:?}");
                assert!((levels.dry - light).abs() < 0.01 + deviation / 2.0, "{deviation}: {levels:?}");
            }
        }
    }

    #[test]
    fn nothing_known_gives_nothing() {
        assert_eq!(Levels::new(&[], 1), None);
        assert_eq!(Levels::new(&[f32::NAN; 9], 1), None);
        // Beyond the histogram they are at its ends.
        assert!(Levels::new(&[-90.0, f32::INFINITY, 90.0, 90.0], 1).is_some());
    }
}
