//! The first drops of a shower: points and short lines.
//!
//! A drop is a round spot or, where it runs, a line that leads down the map (towards higher v), a little
//! aslant. Either is 1 in its middle and falls to its rim, so that it dries from there. Where drops overlap,
//! the higher counts, and what leaves the map at one edge comes in at the other.
//!
//! Laid over another map, `wet.add(&drops)` is the paper's `saturate(wet + drops)`. What a drop is like depends
//! on its number and the seed alone, so a shower goes on with more of them.
//!
//! Hnat et al. 2006, *Real-time wetting of porous media*, on rain.

use bevy::math::Vec2;
use rand_pcg::Pcg32;
use rand_pcg::rand_core::Rng;

use super::{GreyMap, WetMapError, check_range};
use crate::scenes::noise::unit;

/// What drops are like. Lengths in texels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DropsOptions {
    /// Texels along each side, 8 to [`GreyMap::MAX_SIZE`].
    pub size: u32,
    /// Another one, other drops.
    pub seed: u64,
    /// How many there are in the end, up to 1,000,000.
    pub drops: u32,
    /// Part of them that run, 0..=1.
    pub lines: f32,
    /// Least and greatest radius, texels, 0.75 to a quarter of the size; small ones are more frequent.
    pub radius: [f32; 2],
    /// The longest line, texels, up to the size.
    pub line_length: f32,
}

impl Default for DropsOptions {
    fn default() -> Self {
        Self { size: 512, seed: 0, drops: 600, lines: 0.2, radius: [1.5, 5.0], line_length: 40.0 }
    }
}

/// A line is this much narrower than a spot.
const LINE_WIDTH: f32 = 0.6;

/// How far a line leads aside, for its length down, at most.
const LEAN: f32 = 0.15;

/// All drops in one map.
///
/// # Errors
/// [`WetMapError::Parameter`].
pub fn drops(options: &DropsOptions) -> Result<GreyMap, WetMapError> {
    let mut painter = DropsPainter::new(options)?;
    painter.paint(options.drops);
    Ok(painter.map)
}

/// Paints drops, one after the other.
struct DropsPainter {
    options: DropsOptions,
    rng: Pcg32,
    map: GreyMap,
}

impl DropsPainter {
    /// An empty map.
    fn new(options: &DropsOptions) -> Result<Self, WetMapError> {
        let size = options.size;
        check_range("size", size, 8..=GreyMap::MAX_SIZE)?;
        check_range("drops", options.drops, 0..=1_000_000)?;
        check_range("lines", options.lines, 0.0..=1.0)?;
        let [least, most] = options.radius;
        check_range("radius.max", most, 0.75..=size as f32 / 4.0)?;
        check_range("radius.min", least, 0.75..=most)?;
        check_range("line_length", options.line_length, 0.0..=size as f32)?;
        Ok(Self {
            options: *options,
            rng: Pcg32::new(options.seed, 0),
            map: GreyMap::new(size, size, vec![0.0; size as usize * size as usize])?,
        })
    }

    fn paint(&mut self, count: u32) {
        let DropsOptions { size, lines, radius: [least, most], line_length, .. } = self.options;
        for _ in 0..count {
            // Always as many numbers, so that no drop depends on what others are like.
            let [x, y, wide, runs, long, lean] = std::array::from_fn(|_| unit(self.rng.next_u32()));
            let start = Vec2::new(x, y) * size as f32;
            let radius = least + (most - least) * wide * wide;
            if runs < lines {
                let down = Vec2::new((2.0 * lean - 1.0) * LEAN, 1.0).normalize();
                let run = down * line_length * (0.3 + 0.7 * long);
                self.stamp(start, run, (radius * LINE_WIDTH).max(0.75));
            } else {
                self.stamp(start, Vec2::ZERO, radius);
            }
        }
    }

    /// Paints all that lies within `radius` of the line from `start` along `run`.
    fn stamp(&mut self, start: Vec2, run: Vec2, radius: f32) {
        let size = self.map.width as i32;
        let (low, high) = (start.min(start + run) - radius, start.max(start + run) + radius);
        let length_squared = run.length_squared();
        for y in low.y.floor() as i32..=high.y.floor() as i32 {
            for x in low.x.floor() as i32..=high.x.floor() as i32 {
                let from_start = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) - start;
                let along = if length_squared > 0.0 { from_start.dot(run) / length_squared } else { 0.0 };
                let away = (from_start - run * along.clamp(0.0, 1.0)).length() / radius;
                let at = y.rem_euclid(size) * size + x.rem_euclid(size);
                let texel = &mut self.map.values[at as usize];
                *texel = texel.max(1.0 - away * away);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> DropsOptions {
        DropsOptions { size: 64, drops: 40, line_length: 20.0, ..DropsOptions::default() }
    }

    #[test]
    fn all_at_once_or_one_after_the_other_they_are_the_same() {
        let mut painter = DropsPainter::new(&small()).unwrap();
        for count in [1, 0, 9, 30] {
            let before = painter.map.clone();
            painter.paint(count);
            assert!(painter.map.values.iter().zip(&before.values).all(|(after, before)| after >= before));
            assert_eq!(painter.map != before, count > 0, "{count}");
        }
        assert_eq!(painter.map, drops(&small()).unwrap());
    }

    #[test]
    fn spots_are_round_and_go_on_round_the_edges() {
        let mut painter = DropsPainter::new(&small()).unwrap();
        painter.stamp(Vec2::new(63.5, 0.5), Vec2::ZERO, 4.0);
        let map = painter.map;
        assert_eq!(map.get(63, 0), 1.0);
        for (x, y) in [(0, 0), (62, 0), (63, 1), (63, 63)] {
            assert!((map.get(x, y) - 15.0 / 16.0).abs() < 1e-6, "{x} {y}: {}", map.get(x, y));
        }
        let painted = map.values.iter().filter(|&&value| value > 0.0).count();
        assert!((40..=52).contains(&painted), "{painted}");
    }

    #[test]
    fn lines_lead_down() {
        let options = DropsOptions { drops: 1, lines: 1.0, radius: [2.0, 2.0], ..small() };
        for seed in 0..20 {
            let map = drops(&DropsOptions { seed, ..options }).unwrap();
            let rows = (0..64).filter(|&y| (0..64).any(|x| map.get(x, y) > 0.0)).count();
            let columns = (0..64).filter(|&x| (0..64).any(|y| map.get(x, y) > 0.0)).count();
            assert!((7..=24).contains(&rows) && columns <= 7, "{seed}: {rows} {columns}");
            assert!(rows > columns || rows <= 9, "{seed}: {rows} {columns}");
        }
    }

    #[test]
    fn more_drops_leave_those_that_fell_as_they_are() {
        let few = drops(&small()).unwrap();
        let more = drops(&DropsOptions { drops: 80, ..small() }).unwrap();
        assert!(few.values.iter().zip(&more.values).all(|(few, more)| few <= more));
        assert_ne!(few, more);
        assert_ne!(few, drops(&DropsOptions { seed: 1, ..small() }).unwrap());
        let none = drops(&DropsOptions { drops: 0, ..small() }).unwrap();
        assert!(none.values.iter().all(|&value| value == 0.0));
        assert!(more.values.iter().all(|value| (0.0..=1.0).contains(value)));
    }

    #[test]
    fn nonsense_is_named() {
        let error = |options: DropsOptions| drops(&options).unwrap_err().to_string();
        assert!(error(DropsOptions { size: 7, ..small() }).contains("`size` is 7"));
        assert!(error(DropsOptions { size: 9000, ..small() }).contains("8192"));
        assert!(error(DropsOptions { drops: 2_000_000, ..small() }).contains("`drops`"));
        assert!(error(DropsOptions { lines: f32::NAN, ..small() }).contains("`lines` is NaN"));
        assert!(error(DropsOptions { radius: [1.0, 17.0], ..small() }).contains("`radius.max` is 17"));
        assert!(error(DropsOptions { radius: [3.0, 2.0], ..small() }).contains("`radius.min` is 3"));
        assert!(error(DropsOptions { line_length: -1.0, ..small() }).contains("`line_length`"));
    }
}
