//! Ripples on standing water.
//!
//! A drop sends out one ring, a short packet of waves that widens, rises quickly and dies away. Rings are added as
//! slopes, which is what a normal needs. Real drops leave their place and time behind (see
//! [`RainRing`](crate::overlay::RainRing)). Rain that nobody simulates is drawn from four layers of cells: each cell
//! repeats a drop at its own pace, at a place that changes from drop to drop; heavier rain has more layers.
//!
//! Each function has a twin of the same name in `shaders/common/ripples.wgsl`.
//!
//! Lagarde 2013, *Water drop 2b: dynamic rain and its effects*, for the layers; his loop over a texture is replaced by
//! rings in closed form.

use std::f64::consts::TAU;

/// Seconds that a ring lives.
pub const RING_SECONDS: f64 = 0.5;

/// Waves in half a ring's width.
const WAVES: f64 = 1.0;

/// Steepest slope of a fresh ring.
pub const RING_SLOPE: f64 = 0.35;

/// How far a ring gets, as a part of the side of a cell; with its width it stays inside its cell.
pub const RING_REACH: f64 = 0.2;

/// Half the width of a ring, as a part of the side of a cell.
pub const RING_WIDTH: f64 = 0.08;

/// Drops per second in a cell of each layer.
pub const LAYER_RATES: [f64; 4] = [1.0, 0.85, 0.93, 1.13];

/// Rain, in mm/h, at which all four layers are full.
pub const FULL_RAIN_MM_PER_H: f64 = 25.0;

/// Slope away from the middle of a ring, at a `distance`, at an age of `t` times its life. `reach` and `width` (half of
/// it) in the unit of the distance. 0 outside the ring, when it begins and when it ends.
pub fn ring_slope(distance: f64, t: f64, reach: f64, width: f64) -> f64 {
    let phase = (distance - reach * t) / width;
    if !(0.0..1.0).contains(&t) || phase.abs() >= 1.0 {
        return 0.0;
    }
    // Rises to 1 at a third of its life.
    let strength = 6.75 * t * (1.0 - t) * (1.0 - t);
    let window = 1.0 - phase * phase;
    RING_SLOPE * strength * window * window * (TAU * WAVES * phase).sin()
}

/// How much of each layer shows: one after the other as rain gets heavier.
pub fn layer_weights(rain_mm_per_h: f64) -> [f64; 4] {
    let intensity = (rain_mm_per_h / FULL_RAIN_MM_PER_H).clamp(0.0, 1.0);
    [0.0, 0.25, 0.5, 0.75].map(|start| (4.0 * (intensity - start)).clamp(0.0, 1.0))
}

/// 32 bits that look random (PCG: Jarzynski and Olano 2020, *Hash functions for GPU rendering*).
pub fn pcg(x: u32) -> u32 {
    let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// Slopes along both axes of one layer of rain at a place in units of cells, at a `time` in seconds.
pub fn layer_slopes(place: [f64; 2], time: f64, layer: u32) -> [f64; 2] {
    let offset = 0.37 * f64::from(layer);
    let (x, y) = (place[0] + offset, place[1] - offset);
    let (cell_x, cell_y) = (x.floor(), y.floor());
    let seed = pcg(cell_x as i32 as u32 ^ pcg(cell_y as i32 as u32 ^ pcg(layer)));
    let beat = time * LAYER_RATES[layer as usize] + f64::from(seed >> 16) / 65_536.0;
    let drop = pcg(seed ^ beat.floor() as i32 as u32);
    // The middle keeps its ring inside the cell.
    let margin = RING_REACH + RING_WIDTH;
    let middle = |bits: u32| margin + (1.0 - 2.0 * margin) * f64::from(bits & 0xffff) / 65_536.0;
    let (dx, dy) = (x - cell_x - middle(drop), y - cell_y - middle(drop >> 16));
    let distance = dx.hypot(dy);
    let seconds = (beat - beat.floor()) / LAYER_RATES[layer as usize];
    let slope = ring_slope(distance, seconds / RING_SECONDS, RING_REACH, RING_WIDTH);
    if distance > 0.0 { [slope * dx / distance, slope * dy / distance] } else { [0.0; 2] }
}

/// Slopes along both axes of rain that is not simulated; see [`layer_slopes`].
pub fn rain_slopes(place: [f64; 2], time: f64, rain_mm_per_h: f64) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for (layer, weight) in layer_weights(rain_mm_per_h).into_iter().enumerate() {
        let slopes = layer_slopes(place, time, layer as u32);
        sum = [sum[0] + weight * slopes[0], sum[1] + weight * slopes[1]];
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_widens_and_dies() {
        let energy = |t: f64, from: f64, to: f64| -> f64 {
            (0..1000)
                .map(|i| ring_slope(from + (to - from) * f64::from(i) / 1000.0, t, 0.2, 0.05).abs())
                .sum()
        };
        assert_eq!(energy(0.0, 0.0, 0.3), 0.0);
        assert_eq!(energy(1.0, 0.0, 0.3), 0.0);
        assert!(energy(0.999, 0.0, 0.3) < 1e-3);
        // At half its life the ring is half way, and nothing is outside it.
        assert!(energy(0.5, 0.05, 0.15) > 1.0);
        assert!(energy(0.5, 0.0, 0.05) + energy(0.5, 0.15, 0.3) < 1e-9);
        assert!(energy(0.9, 0.0, 0.3) < 0.2 * energy(0.33, 0.0, 0.3));
    }

    #[test]
    fn it_swings_up_and_down_alike() {
        let sum: f64 = (0..2001).map(|i| ring_slope(f64::from(i) / 2000.0 * 0.2, 0.5, 0.2, 0.05)).sum();
        assert!(sum.abs() < 1e-9, "{sum}");
    }

    #[test]
    fn layers_come_one_after_the_other() {
        assert_eq!(layer_weights(0.0), [0.0; 4]);
        assert_eq!(layer_weights(FULL_RAIN_MM_PER_H), [1.0; 4]);
        assert_eq!(layer_weights(1e9), [1.0; 4]);
        assert_eq!(layer_weights(0.375 * FULL_RAIN_MM_PER_H), [1.0, 0.5, 0.0, 0.0]);
    }

    #[test]
    fn more_rain_is_rougher_water() {
        let roughness = |rain| -> f64 {
            let sum: f64 = (0..4000u32)
                .map(|i| {
                    let place = [f64::from(i % 61) * 0.173, f64::from(i / 61) * 0.191];
                    let [x, y] = rain_slopes(place, 3.7, rain);
                    x * x + y * y
                })
                .sum();
            (sum / 4000.0).sqrt()
        };
        let steps = [0.0, 5.0, 10.0, 25.0].map(roughness);
        assert_eq!(steps[0], 0.0);
        assert!(steps.windows(2).all(|pair| pair[1] > pair[0]), "{steps:?}");
        assert!(steps[3] < RING_SLOPE, "{steps:?}");
    }

    #[test]
    fn water_has_no_steps_at_the_edges_of_cells_and_drops() {
        let at = |x: f64, t: f64| rain_slopes([x, 0.4], t, 25.0);
        for i in -40..40 {
            let edge = f64::from(i) - 0.37 * 2.0;
            let (a, b) = (at(edge - 1e-9, 1.3), at(edge + 1e-9, 1.3));
            assert!((a[0] - b[0]).abs() < 1e-5 && (a[1] - b[1]).abs() < 1e-5);
        }
        let mut before = at(0.3, 0.0);
        for i in 1..20_000 {
            let now = at(0.3, f64::from(i) * 2e-4);
            assert!((now[0] - before[0]).abs() < 0.01, "{i}");
            before = now;
        }
    }
}
