//! How far each texel of a shape lies from what is outside: the exact Euclidean distance transform.
//!
//! Along the rows it is enough to count from the nearest texel outside. Down the columns, each texel hangs a
//! parabola at the square of its row's distance, and the lower envelope of all parabolas is the square of the
//! distance in the plane. Squares of whole numbers are whole, so nothing is rounded but the root at the end.
//!
//! Felzenszwalb, Huttenlocher 2012, *Distance transforms of sampled functions*.

/// A square that nothing is as far as: there is nothing outside in this row or column.
const FAR: u32 = u32::MAX;

/// Distance in texels, from middle to middle, of each texel inside to the nearest one outside; 0 for those
/// outside, infinite if there are none. Beyond the edges of the map there is nothing. `width` is 1 to 8192,
/// and so is the number of rows.
pub(super) fn distances(inside: &[bool], width: usize) -> Vec<f32> {
    let height = inside.len() / width;
    let mut squares: Vec<u32> = Vec::with_capacity(inside.len());
    for row in inside.chunks_exact(width) {
        squares.extend(squares_along(row));
    }
    let mut envelope = Envelope::default();
    let (mut column, mut out) = (vec![0; height], vec![0; height]);
    for x in 0..width {
        for (y, square) in column.iter_mut().enumerate() {
            *square = squares[y * width + x];
        }
        envelope.lower(&column, &mut out);
        for (y, &square) in out.iter().enumerate() {
            squares[y * width + x] = square;
        }
    }
    let root = |square| if square == FAR { f32::INFINITY } else { f64::from(square).sqrt() as f32 };
    squares.into_iter().map(root).collect()
}

/// Square of the distance to the nearest texel outside in the same row.
fn squares_along(row: &[bool]) -> Vec<u32> {
    let mut steps = vec![FAR; row.len()];
    let mut since = FAR;
    for (step, &inside) in steps.iter_mut().zip(row) {
        since = if inside { since.saturating_add(1) } else { 0 };
        *step = since;
    }
    let mut since = FAR;
    for (step, &inside) in steps.iter_mut().zip(row).rev() {
        since = if inside { since.saturating_add(1) } else { 0 };
        *step = since.min(*step);
    }
    // What is further than any row is long was counted from `FAR`.
    steps.into_iter().map(|step| step.checked_mul(step).unwrap_or(FAR)).collect()
}

/// The lower envelope of parabolas, with its buffers.
#[derive(Default)]
struct Envelope {
    /// Where the parabolas that show have their lowest points, from left to right.
    apexes: Vec<usize>,
    /// Where each of them begins to show.
    starts: Vec<f64>,
}

impl Envelope {
    /// For each whole `x` the least `(x - i)² + heights[i]`; `FAR` if all heights are.
    fn lower(&mut self, heights: &[u32], out: &mut [u32]) {
        self.apexes.clear();
        self.starts.clear();
        for (i, &height) in heights.iter().enumerate() {
            if height == FAR {
                continue;
            }
            let mut start = f64::NEG_INFINITY;
            while let (Some(&apex), Some(&shown_from)) = (self.apexes.last(), self.starts.last()) {
                start = crossing(heights, apex, i);
                if start > shown_from {
                    break;
                }
                // The new one is lower already where this one would begin to show.
                self.apexes.pop();
                self.starts.pop();
            }
            self.apexes.push(i);
            self.starts.push(start);
        }
        if self.apexes.is_empty() {
            out.fill(FAR);
            return;
        }
        let mut shown = 0;
        for (x, least) in out.iter_mut().enumerate() {
            while self.starts.get(shown + 1).is_some_and(|&start| start < x as f64) {
                shown += 1;
            }
            let apex = self.apexes[shown];
            let away = x.abs_diff(apex) as u32;
            *least = away * away + heights[apex];
        }
    }
}

/// Where the parabola over `right` becomes lower than the one over `left`.
fn crossing(heights: &[u32], left: usize, right: usize) -> f64 {
    let raised = |i: usize| f64::from(heights[i]) + (i * i) as f64;
    (raised(right) - raised(left)) / (2 * (right - left)) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::noise::{hash, unit};

    fn brute_force(inside: &[bool], width: usize) -> Vec<f32> {
        let away = |i: usize, j: usize| {
            let (dx, dy) = ((i % width).abs_diff(j % width), (i / width).abs_diff(j / width));
            ((dx * dx + dy * dy) as f64).sqrt() as f32
        };
        let nearest = |i: usize| {
            let outside = (0..inside.len()).filter(|&j| !inside[j]);
            outside.map(|j| away(i, j)).fold(f32::INFINITY, f32::min)
        };
        (0..inside.len()).map(nearest).collect()
    }

    #[test]
    fn distances_are_those_of_brute_force() {
        for (width, height) in [(1, 1), (1, 17), (23, 1), (16, 16), (31, 20), (9, 40)] {
            for share in [0.0, 0.02, 0.2, 0.8, 1.0] {
                let outside = |i: u32| unit(hash([i, width, height])) < share;
                let inside: Vec<bool> = (0..width * height).map(|i| !outside(i)).collect();
                let expected = brute_force(&inside, width as usize);
                assert_eq!(distances(&inside, width as usize), expected, "{width} x {height}, {share}");
            }
        }
    }

    #[test]
    fn a_disc_is_a_cone() {
        let width = 101;
        let radius = |i: usize| ((i % width) as f32 - 50.0).hypot((i / width) as f32 - 50.0);
        let inside: Vec<bool> = (0..width * width).map(|i| radius(i) < 40.0).collect();
        for (i, distance) in distances(&inside, width).into_iter().enumerate() {
            let expected = (40.0 - radius(i)).max(0.0);
            assert!((distance - expected).abs() < 1.5, "{i}: {distance}, not {expected}");
        }
    }
}
