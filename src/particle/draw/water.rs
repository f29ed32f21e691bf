//! Drops, and the streaks they leave on film.
//!
//! A falling drop is flattened below, the more the larger it is (Beard and Chuang 1987), and swings between flat and tall.
//! While the shutter is open, that writes a pattern of bright and dark along its streak (Garg and Nayar 2006,
//! *Photorealistic rendering of rain streaks*).

use std::f32::consts::TAU;

use bevy::math::Vec2;

use super::sprites::{Texel, random, smoothstep};

/// A drop that moves upwards on its tile.
pub(super) fn drop(variant: u32, at: Vec2) -> Texel {
    let flat = 0.02 + 0.16 * random(variant, 11);
    let lean = 0.08 * (random(variant, 12) - 0.5);
    // The front is flatter than the back.
    let tall = 1.0 - flat * if at.y > 0.0 { 1.5 } else { 0.5 };
    let at = Vec2::new(at.x - lean * at.y, at.y / tall);
    if at.length_squared() >= 1.0 {
        return Texel::NONE;
    }
    Texel { slope: at, shade: 0.5, cover: 1.0 }
}

/// Where a drop was, from the tail, below, to the head.
pub(super) fn streak(variant: u32, at: Vec2) -> Texel {
    // Periods of its swing within the exposure.
    let cycles = 0.8 + 2.4 * random(variant, 21);
    let phase = random(variant, 22);
    let swing = |cycles: f32| (TAU * (cycles * 0.5 * at.y + phase)).cos();
    let wide = 0.92 + 0.08 * swing(cycles);
    let across = at.x / wide;
    if across.abs() >= 1.0 || at.y.abs() >= 1.0 {
        return Texel::NONE;
    }
    let thick = (1.0 - across * across).sqrt();
    let ends = smoothstep(1.0, 0.9, at.y) * smoothstep(-1.0, 0.1, at.y);
    // The sky's mirror image wanders over the drop and is narrow; two overtones make it irregular.
    let glint_at = 0.45 * swing(cycles) * (random(variant, 23) - 0.3);
    let glint = (-((across - glint_at) / 0.22).powi(2)).exp();
    let pattern = 0.5 + 0.16 * swing(2.0 * cycles) + 0.08 * swing(5.0 * cycles);
    Texel {
        slope: Vec2::new(0.95 * across, 0.0),
        shade: (pattern * (0.8 + 0.6 * glint)).clamp(0.0, 1.0),
        cover: (thick * ends * (0.75 + 0.25 * glint)).clamp(0.0, 1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drop_is_flatter_in_front_and_its_normals_point_outwards() {
        for variant in 0..8 {
            let reach = |up: f32| {
                (0..200)
                    .map(|i| i as f32 / 200.0)
                    .filter(|r| drop(variant, Vec2::Y * up * *r).cover > 0.0)
                    .count()
            };
            assert!(reach(1.0) < reach(-1.0), "{variant}");
            assert!(drop(variant, Vec2::X * 0.6).slope.x > 0.5, "{variant}");
            assert!(drop(variant, Vec2::NEG_Y * 0.6).slope.y < -0.5, "{variant}");
        }
    }

    #[test]
    fn a_streak_fades_towards_its_tail() {
        for variant in 0..8 {
            let cover = |y: f32| streak(variant, Vec2::new(0.0, y)).cover;
            assert!(cover(-0.95) < 0.05 && cover(-0.5) < cover(0.5), "{variant}");
            assert!(cover(0.999) < 0.05 && cover(0.5) > 0.5, "{variant}");
        }
    }
}
