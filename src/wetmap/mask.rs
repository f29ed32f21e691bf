//! The shape of what got wet: connected spots, tidied up, with gradients from rim to middle.

use bevy::math::Vec2;

use super::distance::distances;
use super::{GreyMap, WetMapError, check_range, check_size};

/// Which pixels got wet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WetMask {
    /// Pixels along a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row by row from the top.
    pub wet: Vec<bool>,
}

/// Wet pixels that touch each other, be it at a corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Pixels.
    pub area: u32,
    /// Mean of the middles of its pixels, in pixels from the upper left corner.
    pub middle: Vec2,
}

impl WetMask {
    /// A mask of these pixels, row by row from the top.
    ///
    /// # Errors
    /// [`WetMapError::Size`]; [`WetMapError::Count`] if they are not `width * height`.
    pub fn new(width: u32, height: u32, wet: Vec<bool>) -> Result<Self, WetMapError> {
        check_size(width, height)?;
        let needed = width as usize * height as usize;
        if wet.len() != needed {
            return Err(WetMapError::Count { width, height, needed, got: wet.len() });
        }
        Ok(Self { width, height, wet })
    }

    /// The spots, in the order of their first pixels.
    pub fn spots(&self) -> Vec<Spot> {
        let width = self.width.max(1) as usize;
        let regions = Regions::new(&self.wet, width, true);
        let mut sums = vec![[0.0f64; 2]; regions.areas.len()];
        for (at, &label) in regions.labels.iter().enumerate() {
            if let Some([x, y]) = sums.get_mut(label as usize) {
                *x += (at % width) as f64 + 0.5;
                *y += (at / width) as f64 + 0.5;
            }
        }
        let spot = |(&area, [x, y]): (&u32, [f64; 2])| {
            let mean = |sum: f64| (sum / f64::from(area)) as f32;
            Spot { area, middle: Vec2::new(mean(x), mean(y)) }
        };
        regions.areas.iter().zip(sums).map(spot).collect()
    }

    /// Part of the pixels that are wet, 0..=1.
    pub fn coverage(&self) -> f32 {
        let wet = self.wet.iter().filter(|&&wet| wet).count();
        (wet as f64 / self.wet.len().max(1) as f64) as f32
    }

    /// A wet map of the spots: each rises from its rim to where it is widest, so that the rim dries first.
    /// The value is the distance to the rim, 1 where it is greatest in this spot; `gradient` 0..=1 is how
    /// much of that is shown: with 0 all of a spot is 1.
    ///
    /// # Errors
    /// [`WetMapError::Parameter`]; those of [`Self::new`], if the mask was changed since.
    pub fn gradients(&self, gradient: f32) -> Result<GreyMap, WetMapError> {
        check_range("gradient", gradient, 0.0..=1.0)?;
        let Self { width, height, wet } = Self::new(self.width, self.height, self.wet.clone())?;
        let depths = distances(&wet, width as usize);
        let regions = Regions::new(&wet, width as usize, true);
        let mut deepest = vec![0.0f32; regions.areas.len()];
        for (&label, &depth) in regions.labels.iter().zip(&depths) {
            if let Some(deepest) = deepest.get_mut(label as usize) {
                *deepest = deepest.max(depth);
            }
        }
        let value = |(&label, &depth): (&u32, &f32)| match deepest.get(label as usize) {
            // Without any rim it is the middle everywhere.
            Some(&deepest) if deepest.is_finite() => 1.0 - gradient * (1.0 - depth / deepest),
            Some(_) => 1.0,
            None => 0.0,
        };
        let values = regions.labels.iter().zip(&depths).map(value).collect();
        GreyMap::new(width, height, values)
    }

    /// Takes spots of fewer pixels away.
    pub(super) fn drop_specks(&mut self, least_pixels: u32) {
        let regions = Regions::new(&self.wet, self.width as usize, true);
        for (wet, &label) in self.wet.iter_mut().zip(&regions.labels) {
            *wet = regions.areas.get(label as usize).is_some_and(|&area| area >= least_pixels);
        }
    }

    /// Fills holes of up to this many pixels. What is open to the edge of the picture is no hole.
    pub(super) fn fill_holes(&mut self, most_pixels: u32) {
        let width = self.width as usize;
        let dry: Vec<bool> = self.wet.iter().map(|wet| !wet).collect();
        let regions = Regions::new(&dry, width, false);
        let mut fill: Vec<bool> = regions.areas.iter().map(|&area| area <= most_pixels).collect();
        let last_row = self.height.saturating_sub(1) as usize;
        for (at, &label) in regions.labels.iter().enumerate() {
            let (x, y) = (at % width, at / width);
            let at_edge = x == 0 || x == width - 1 || y == 0 || y == last_row;
            if at_edge && let Some(fill) = fill.get_mut(label as usize) {
                *fill = false;
            }
        }
        for (wet, &label) in self.wet.iter_mut().zip(&regions.labels) {
            *wet |= fill.get(label as usize).copied().unwrap_or(false);
        }
    }

    /// Fills highlights: dry pixels in and around those that are `glossy`, where wet ones surround them for
    /// the most part. Water mirrors the light, so a wet place may look brighter than a dry one, and between a
    /// dark wet place and its bright highlight there is a seam that looks as if it were dry.
    pub(super) fn fill_highlights(&mut self, glossy: &[bool]) {
        /// Width of the seam, pixels.
        const SEAM: f32 = 3.0;
        let width = self.width as usize;
        let matt: Vec<bool> = glossy.iter().map(|glossy| !glossy).collect();
        let away = distances(&matt, width);
        let unsure: Vec<bool> = self.wet.iter().zip(away).map(|(wet, away)| !wet && away <= SEAM).collect();
        let regions = Regions::new(&unsure, width, false);
        // How many pixels next to it are wet, how many dry for sure, and whether it is a highlight at all.
        let mut edges = vec![(0u32, 0u32, false); regions.areas.len()];
        for (at, &label) in regions.labels.iter().enumerate() {
            let Some((wet, dry, is_glossy)) = edges.get_mut(label as usize) else { continue };
            *is_glossy |= glossy[at];
            for next in neighbours(at, width, self.wet.len(), false).filter(|&next| !unsure[next]) {
                if self.wet[next] {
                    *wet += 1;
                } else {
                    *dry += 1;
                }
            }
        }
        for (wet, &label) in self.wet.iter_mut().zip(&regions.labels) {
            let surrounded = edges.get(label as usize).is_some_and(|&(wet, dry, glossy)| glossy && wet > dry);
            *wet |= surrounded;
        }
    }
}

/// Texels that hang together.
struct Regions {
    /// The region of each texel; `u32::MAX` for those of none, which is beyond `areas`.
    labels: Vec<u32>,
    /// Texels of each region; in the order of their first texels.
    areas: Vec<u32>,
}

impl Regions {
    /// Of the texels that are `part`; `diagonal` if it is enough to touch at a corner.
    fn new(part: &[bool], width: usize, diagonal: bool) -> Self {
        const NONE: u32 = u32::MAX;
        let mut labels = vec![NONE; part.len()];
        let mut areas = Vec::new();
        let mut waiting: Vec<u32> = Vec::new();
        for (seed, &is_part) in part.iter().enumerate() {
            if !is_part || labels[seed] != NONE {
                continue;
            }
            let label = areas.len() as u32;
            let mut area = 0;
            labels[seed] = label;
            waiting.push(seed as u32);
            while let Some(at) = waiting.pop() {
                area += 1;
                for next in neighbours(at as usize, width, part.len(), diagonal) {
                    if part[next] && labels[next] == NONE {
                        labels[next] = label;
                        waiting.push(next as u32);
                    }
                }
            }
            areas.push(area);
        }
        Self { labels, areas }
    }
}

/// The four or eight texels around one, less those beyond the edges.
fn neighbours(at: usize, width: usize, count: usize, diagonal: bool) -> impl Iterator<Item = usize> {
    const AROUND: [(isize, isize); 8] =
        [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)];
    let (x, y) = ((at % width) as isize, (at / width) as isize);
    let (columns, rows) = (width as isize, (count / width) as isize);
    AROUND
        .into_iter()
        .take(if diagonal { 8 } else { 4 })
        .map(move |(dx, dy)| (x + dx, y + dy))
        .filter(move |&(x, y)| (0..columns).contains(&x) && (0..rows).contains(&y))
        .map(move |(x, y)| (y * columns + x) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `#` is wet.
    fn mask(rows: &[&str]) -> WetMask {
        let wet = rows.iter().flat_map(|row| row.bytes().map(|byte| byte == b'#')).collect();
        WetMask::new(rows[0].len() as u32, rows.len() as u32, wet).unwrap()
    }

    const HOLES: [&str; 7] = [
        "..........", //
        ".#####....",
        ".#...#..#.",
        ".#.#.#....",
        ".#...#.##.",
        ".#####.#.#",
        ".......###",
    ];

    #[test]
    fn spots_are_what_hangs_together() {
        let spots = mask(&HOLES).spots();
        let found: Vec<u32> = spots.iter().map(|spot| spot.area).collect();
        assert_eq!(found, [16, 1, 1, 7]);
        assert_eq!(spots[0].middle, Vec2::new(3.5, 3.5));
        assert_eq!(spots[1].middle, Vec2::new(8.5, 2.5));
    }

    #[test]
    fn specks_go_and_holes_are_filled() {
        let mut tidy = mask(&HOLES);
        tidy.drop_specks(2);
        assert_eq!(tidy.spots().len(), 2);
        tidy.fill_holes(8);
        let found: Vec<u32> = tidy.spots().iter().map(|spot| spot.area).collect();
        // The hook is open at no side, only at a corner; the hole in the ring is one larger than that.
        assert_eq!(found, [16, 8]);
        tidy.fill_holes(9);
        let found: Vec<u32> = tidy.spots().iter().map(|spot| spot.area).collect();
        assert_eq!(found, [25, 8]);
        let mut open = mask(&["####", "#..#", "#...", "####"]);
        open.fill_holes(9);
        assert_eq!(open, mask(&["####", "#..#", "#...", "####"]));
    }

    #[test]
    fn highlights_are_filled_where_it_is_wet_around_them() {
        let glossy = |mask: &WetMask, x0: u32, x1: u32| -> Vec<bool> {
            (0..mask.wet.len() as u32)
                .map(|i| {
                    let (x, y) = (i % mask.width, i / mask.width);
                    (x0..x1).contains(&x) && (14..20).contains(&y)
                })
                .collect()
        };
        let disc = |x: f32, y: f32| (x - 20.0).hypot(y - 17.0) < 12.0;
        let full: Vec<bool> = (0..48 * 34).map(|i| disc((i % 48) as f32, (i / 48) as f32)).collect();
        let full = WetMask::new(48, 34, full).unwrap();
        // In the middle of the spot, over its rim, and far from it.
        for (x0, x1, filled) in [(17, 23, true), (20, 32, true), (40, 44, false)] {
            let glossy = glossy(&full, x0, x1);
            let mut torn = full.clone();
            torn.wet.iter_mut().zip(&glossy).for_each(|(wet, glossy)| *wet &= !glossy);
            torn.fill_highlights(&glossy);
            let missing = full.wet.iter().zip(&torn.wet).filter(|(full, torn)| **full && !**torn).count();
            let added = full.wet.iter().zip(&torn.wet).filter(|(full, torn)| !**full && **torn).count();
            assert_eq!(missing, 0, "{x0}");
            assert!(added <= if filled { 60 } else { 0 }, "{x0}: {added}");
        }
    }

    #[test]
    fn spots_rise_from_their_rims() {
        let side = 61;
        let radius = |i: usize, x: f32| ((i % side) as f32 - x).hypot((i / side) as f32 - 30.0);
        let spot = |i: usize| radius(i, 18.0) < 15.0 || radius(i, 48.0) < 8.0;
        let wet = (0..side * side).map(spot).collect();
        let mask = WetMask::new(side as u32, side as u32, wet).unwrap();
        let map = mask.gradients(1.0).unwrap();
        assert_eq!((map.get(18, 30), map.get(48, 30)), (1.0, 1.0));
        for (i, &value) in map.values.iter().enumerate() {
            assert_eq!(value > 0.0, mask.wet[i]);
            // A cone, but for the steps of its rim.
            let cone = (1.0 - radius(i, 18.0) / 15.0).max(1.0 - radius(i, 48.0) / 8.0).max(0.0);
            assert!((value - cone).abs() < 0.2, "{i}: {value}, not {cone}");
        }
        let flat = mask.gradients(0.0).unwrap();
        assert!(flat.values.iter().zip(&mask.wet).all(|(&value, &wet)| value == f32::from(u8::from(wet))));
        assert!(mask.gradients(f32::NAN).is_err());
        let full = WetMask::new(3, 3, vec![true; 9]).unwrap().gradients(1.0).unwrap();
        assert_eq!(full.values, [1.0; 9]);
    }
}
