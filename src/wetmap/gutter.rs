//! Values for the texels beside a surface.

/// Gives texels without a value the mean of their eight neighbours that have one, `rings` times, so that
/// filtering at the edge of a uv island finds what lies inside. Goes on round the edges of the map, which
/// harms no map that does not repeat: what has a value keeps it.
pub(super) fn fill_gutter(values: &mut [f32], known: &mut [bool], size: usize, rings: u32) {
    for _ in 0..rings {
        let mut found = Vec::new();
        for at in (0..values.len()).filter(|&at| !known[at]) {
            let (x, y) = (at % size, at / size);
            let (mut sum, mut count) = (0.0, 0u32);
            for down in [size - 1, 0, 1] {
                for right in [size - 1, 0, 1] {
                    let next = (y + down) % size * size + (x + right) % size;
                    if known[next] {
                        sum += values[next];
                        count += 1;
                    }
                }
            }
            if count > 0 {
                found.push((at, sum / count as f32));
            }
        }
        // After the loop: what a ring finds must not depend on the way it went.
        for &(at, value) in &found {
            (values[at], known[at]) = (value, true);
        }
        if found.is_empty() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn islands_grow_by_rings_and_keep_what_they_have() {
        let size = 16;
        let mut values = vec![0.0; 256];
        let mut known = vec![false; 256];
        for (x, y, value) in [(8, 8, 1.0), (9, 8, 0.5)] {
            (values[y * size + x], known[y * size + x]) = (value, true);
        }
        fill_gutter(&mut values, &mut known, size, 4);
        assert_eq!((values[8 * size + 8], values[8 * size + 9]), (1.0, 0.5));
        assert_eq!((values[8 * size + 7], values[9 * size + 8]), (1.0, 0.75));
        let reached = known.iter().filter(|&&known| known).count();
        assert_eq!(reached, 10 * 9);
        assert!(known[4 * size + 4] && !known[3 * size + 4]);
    }

    #[test]
    fn an_island_at_the_edge_grows_round_it() {
        let mut values = vec![0.0; 64];
        let mut known = vec![false; 64];
        (values[0], known[0]) = (0.25, true);
        fill_gutter(&mut values, &mut known, 8, 1);
        for at in [7, 56, 63, 1, 8, 9] {
            assert!(known[at] && values[at] == 0.25, "{at}");
        }
        assert_eq!(known.iter().filter(|&&known| known).count(), 9);
        fill_gutter(&mut [], &mut [], 1, 3);
    }
}
