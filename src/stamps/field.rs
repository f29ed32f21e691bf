//! From the shape of a mark to its three maps.
//!
//! A shape says what lies at a point. Each texel takes the mean over a few points: heights and coverage by area,
//! everything else by coverage. Slopes are central differences of the heights of texels, so a stamp's relief and
//! its slopes are one and the same surface, at any size.

use bevy::math::Vec2;

/// What lies at a point of a mark.
#[derive(Debug, Clone, Copy)]
pub(super) struct Matter {
    /// Above the surface, in radii of the stamp.
    pub(super) height: f32,
    /// How much of the surface it hides, 0..=1.
    pub(super) cover: f32,
    /// Linear RGB, 0..=1.
    pub(super) tint: [f32; 3],
    /// As in Bevy's `StandardMaterial`, 0..=1.
    pub(super) reflectance: f32,
    /// 1 - perceptual roughness, 0..=1.
    pub(super) smoothness: f32,
}

impl Matter {
    pub(super) const NOTHING: Self =
        Self { height: 0.0, cover: 0.0, tint: [1.0; 3], reflectance: 0.5, smoothness: 0.5 };
}

/// A mark within the square from -1 to 1, with +u to the right and +v down.
pub(super) trait Shape {
    fn at(&self, point: Vec2) -> Matter;
}

/// Points along each side of a texel.
const FINE: u32 = 3;

/// Part of the stamp that its shape may fill: two texels are left free along each edge.
fn fit(size: u32) -> f32 {
    1.0 - 4.0 / size as f32
}

/// 1.2 texels in the shape's units: over so much a rim should fade.
pub(super) fn soft_rim(size: u32) -> f32 {
    1.2 * 2.0 / (size as f32 * fit(size))
}

/// A shape as texels.
pub(super) struct Field {
    size: u32,
    relief: f32,
    texels: Vec<Matter>,
}

impl Field {
    /// Heights stop at `relief`.
    pub(super) fn new(shape: &dyn Shape, size: u32, relief: f32) -> Self {
        let texel = |i: u32| mean(shape, size, [i % size, i / size], relief);
        Self { size, relief, texels: (0..size * size).map(texel).collect() }
    }

    /// The texel's diffuse, specular and normal map, as [`super`] describes them.
    pub(super) fn maps(&self, x: u32, y: u32) -> [[u8; 4]; 3] {
        let Matter { height, cover, tint: [r, g, b], reflectance, smoothness } =
            self.texels[(y * self.size + x) as usize];
        let [x, y] = [x as i32, y as i32];
        let [along_u, along_v] = [self.slope([x - 1, y], [x + 1, y]), self.slope([x, y - 1], [x, y + 1])];
        let alpha = byte(cover);
        [
            [byte(r), byte(g), byte(b), alpha],
            [byte(reflectance), byte(smoothness), 0, alpha],
            [slope_byte(along_u), slope_byte(along_v), byte(height / self.relief), alpha],
        ]
    }

    /// How steeply it falls from one texel to the next but one.
    fn slope(&self, before: [i32; 2], after: [i32; 2]) -> f32 {
        let distance = 2.0 * 2.0 / self.size as f32;
        (self.height(before) - self.height(after)) / distance
    }

    fn height(&self, [x, y]: [i32; 2]) -> f32 {
        let inside = 0..self.size as i32;
        if inside.contains(&x) && inside.contains(&y) {
            self.texels[(y * self.size as i32 + x) as usize].height
        } else {
            0.0
        }
    }
}

/// The mean over a texel.
fn mean(shape: &dyn Shape, size: u32, texel: [u32; 2], relief: f32) -> Matter {
    let fit = fit(size);
    let along =
        |texel: u32, fine: u32| ((texel * FINE + fine) as f32 + 0.5) / (size * FINE) as f32 * 2.0 - 1.0;
    let mut sum = Matter { tint: [0.0; 3], reflectance: 0.0, smoothness: 0.0, ..Matter::NOTHING };
    for i in 0..FINE * FINE {
        let point = Vec2::new(along(texel[0], i % FINE), along(texel[1], i / FINE)) / fit;
        if point.abs().max_element() >= 1.0 {
            continue;
        }
        let matter = shape.at(point);
        let cover = matter.cover.clamp(0.0, 1.0);
        sum.height += matter.height.max(0.0) * fit;
        sum.cover += cover;
        for (sum, tint) in sum.tint.iter_mut().zip(matter.tint) {
            *sum += tint * cover;
        }
        sum.reflectance += matter.reflectance * cover;
        sum.smoothness += matter.smoothness * cover;
    }
    let points = (FINE * FINE) as f32;
    let height = (sum.height / points).min(relief);
    if sum.cover == 0.0 {
        return Matter { height, ..Matter::NOTHING };
    }
    Matter {
        height,
        cover: sum.cover / points,
        tint: sum.tint.map(|tint| tint / sum.cover),
        reflectance: sum.reflectance / sum.cover,
        smoothness: sum.smoothness / sum.cover,
    }
}

fn byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// A slope as a colour, 128 is flat; see `slope_color` in [`kernel`](crate::overlay::kernel).
fn slope_byte(slope: f32) -> u8 {
    (128.0 + (slope.clamp(-1.0, 1.0) * 127.0).round()) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::overlay::kernel::slope_color;

    /// A round hill, 0.2 high at its middle.
    struct Hill;

    impl Shape for Hill {
        fn at(&self, point: Vec2) -> Matter {
            let height = 0.2 * (1.0 - point.length_squared()).max(0.0);
            Matter { height, cover: f32::from(u8::from(height > 0.0)), ..Matter::NOTHING }
        }
    }

    #[test]
    fn slopes_lean_as_those_of_a_dome_do() {
        let field = Field::new(&Hill, 64, 0.25);
        let [left, middle, right] = [16, 32, 48].map(|x| field.maps(x, 32)[2]);
        assert!(left[0] < 128 && right[0] > 128, "{left:?} {right:?}");
        assert_eq!(
            (left[0] < 128, right[0] > 128),
            (slope_color(60, -128) < 128, slope_color(60, 128) > 128)
        );
        assert!(middle[0].abs_diff(128) <= 1 && middle[2] > left[2], "{middle:?}");
        let [above, below] = [16, 48].map(|y| field.maps(32, y)[2]);
        assert!(above[1] < 128 && below[1] > 128, "{above:?} {below:?}");
    }

    #[test]
    fn a_hill_is_as_high_and_as_steep_as_it_is_at_any_size() {
        for size in [16, 64, 256] {
            let field = Field::new(&Hill, size, 0.25);
            let top = field.maps(size / 2, size / 2)[2];
            // Height shrinks with the shape, so that slopes stay.
            let expected = 0.2 * fit(size) / 0.25 * 255.0;
            assert!((f32::from(top[2]) - expected).abs() < 4.0, "{size}: {top:?} for {expected}");
            // Half-way to its rim it falls by 0.2.
            let x = (size as f32 * (0.5 + 0.25 * fit(size))) as u32;
            let slope = f32::from(field.maps(x, size / 2)[2][0]) - 128.0;
            assert!((slope / 127.0 - 0.2).abs() < 0.05, "{size}: {slope}");
        }
    }

    #[test]
    fn a_texel_half_covered_keeps_its_colour() {
        struct Half;
        impl Shape for Half {
            fn at(&self, point: Vec2) -> Matter {
                let cover = f32::from(u8::from(point.x < 0.0));
                Matter { cover, tint: [0.4, 0.2, 0.6], ..Matter::NOTHING }
            }
        }
        // An odd size has a texel across the middle.
        let [diffuse, ..] = Field::new(&Half, 17, 1.0).maps(8, 8);
        assert_eq!(diffuse[..3], [102, 51, 153]);
        assert!((80..=175).contains(&diffuse[3]), "{diffuse:?}");
    }
}
