//! From what a texel holds to what can be seen of it.
//!
//! Matter takes up water until it is full, and looks the wetter the more it has; what comes on top lies on it as a film.
//! Whatever the amount, it takes `t_fill` from the first drop until it is seen: the wet map of Hnat et al., whose start
//! time real hits set.
//!
//! The function has a twin of the same name in `shaders/common/held_water.wgsl`.

use super::super::models::hnat::wet_tau;

/// How wet a texel looks that holds `water_nl` nanolitres, in `[0, 1]`, and the film on it in mm.
///
/// `seconds`: since the first of it came; `capacity_nl`, `capacity_mm`: what the matter takes up, in both units, above 0;
/// `t_fill`: seconds until it looks wet.
pub fn water_look(
    water_nl: u32,
    seconds: f64,
    capacity_nl: f64,
    capacity_mm: f64,
    t_fill: f64,
) -> (f64, f64) {
    if water_nl == 0 {
        return (0.0, 0.0);
    }
    let filled = f64::from(water_nl) / capacity_nl;
    (filled.min(1.0) * wet_tau(seconds, 0.0, t_fill), (filled - 1.0).max(0.0) * capacity_mm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matter_fills_first_and_the_rest_lies_on_it() {
        let look = |water_nl, seconds| water_look(water_nl, seconds, 100.0, 0.5, 2.0);
        assert_eq!(look(0, 9.0), (0.0, 0.0));
        assert_eq!(look(50, 9.0), (0.5, 0.0));
        assert_eq!(look(100, 9.0), (1.0, 0.0));
        assert_eq!(look(300, 9.0), (1.0, 1.0));
        assert_eq!(look(100, 0.5), (0.25, 0.0));
        assert_eq!(look(100, 0.0), (0.0, 0.0));
        assert_eq!(water_look(100, 0.0, 100.0, 0.5, 0.0), (1.0, 0.0));
    }
}
