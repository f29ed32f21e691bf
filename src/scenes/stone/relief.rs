//! What follows from the height alone: occlusion, normals and how much relief there is.

use bevy::math::Vec3;

/// How much of the sky's light reaches each texel, `0..=1`: less, the further it lies below its
/// surroundings, within a 500th of the tile and within a 130th.
pub(super) fn occlusion(height: &[f32], width: usize) -> Vec<f32> {
    let near = blurred(height, width, width.div_ceil(500));
    let far = blurred(height, width, (3 * width).div_ceil(400));
    let light = |i: usize| {
        let below = (near[i] - height[i]).max(0.0) * 0.35 + (far[i] - height[i]).max(0.0) * 0.22;
        1.0 / (1.0 + below)
    };
    (0..height.len()).map(light).collect()
}

/// The mean over a square of `2 * radius + 1` texels, round the edges; `radius` is below `width`.
fn blurred(values: &[f32], width: usize, radius: usize) -> Vec<f32> {
    // One axis at a time: blur along rows and write as columns, twice.
    let pass = |values: &[f32]| {
        let mut out = vec![0.0; values.len()];
        for (y, row) in values.chunks_exact(width).enumerate() {
            let wrapped: Vec<f32> =
                [&row[width - radius..], row, &row[..radius]].into_iter().flatten().copied().collect();
            for (x, window) in wrapped.windows(2 * radius + 1).enumerate() {
                out[x * width + y] = window.iter().sum::<f32>() / window.len() as f32;
            }
        }
        out
    };
    pass(&pass(values))
}

/// Unit normals of a height field in millimetres, `tile_mm` wide: x to the right, y to the top, by central differences
/// round the edges.
pub(super) fn normals(height: &[f32], width: usize, tile_mm: f32) -> Vec<Vec3> {
    let two_texels_mm = 2.0 * tile_mm / width as f32;
    let at = |x: usize, y: usize| height[(y % width) * width + x % width];
    let normal = |(x, y): (usize, usize)| {
        let right = (at(x + 1, y) - at(x + width - 1, y)) / two_texels_mm;
        // Rows go down, y goes up.
        let up = (at(x, y + width - 1) - at(x, y + 1)) / two_texels_mm;
        Vec3::new(-right, -up, 1.0).normalize()
    };
    (0..width * width).map(|i| normal((i % width, i / width))).collect()
}

/// The heights that a hundredth of the texels lie below and above: the relief without its few extremes.
pub(super) fn span_mm(height: &[f32]) -> (f32, f32) {
    let mut heights = height.to_vec();
    let last = height.len() - 1;
    let mut ranked = |rank: usize| *heights.select_nth_unstable_by(rank, f32::total_cmp).1;
    (ranked(last / 100), ranked(last - last / 100))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_span_leaves_out_a_hundredth_at_either_end() {
        // 0 to 1000 in a shuffled order, with a spike and a hole.
        let mut height: Vec<f32> = (0..=1000).map(|i| (i * 400 % 1001) as f32).collect();
        assert_eq!(span_mm(&height), (10.0, 990.0));
        for value in &mut height {
            if *value == 0.0 || *value == 1000.0 {
                *value = 1e3 * (*value - 500.0);
            }
        }
        assert_eq!(span_mm(&height), (10.0, 990.0));
    }

    #[test]
    fn normals_lean_away_from_the_summit() {
        let summit = |axis: usize| -> Vec<f32> {
            let place = |i: usize| [i % 16, i / 16][axis] as f32 / 16.0;
            (0..256).map(|i| 5.0 * (std::f32::consts::TAU * (place(i) - 0.5)).cos()).collect()
        };
        let columns = normals(&summit(0), 16, 400.0);
        assert!(columns[12].x > 0.05 && columns[4].x < -0.05 && columns[12].y.abs() < 1e-6);
        // Rows count downwards: above the summit the surface faces the top, +Y.
        let rows = normals(&summit(1), 16, 400.0);
        assert!(rows[4 * 16].y > 0.05 && rows[12 * 16].y < -0.05 && rows[4 * 16].x.abs() < 1e-6);
    }
}
