//! From what a texel holds to what can be seen of it.
//!
//! What is seen of absorbed water is a sigmoid of the saturation of the uppermost matter: drying brightens it slowly, then
//! fast, then slowly (Sun et al. 2007, Lu et al. 2005). Its gloss goes well before that, exponentially. Both are functions
//! of the amount alone, so what is wetted again when half dry goes on from where it is.
//!
//! However fast the water, it takes `t_fill` from the first of it until it is seen: the wet map of Hnat et al., whose start
//! time real hits set. A texel remembers how far it was at its reference time.
//!
//! Twins of the same names are in `shaders/common/drying.wgsl`.

/// Steepness L of the sigmoid.
pub const SIGMOID_STEEPNESS: f64 = 10.0;

/// Part of the way from wet to dry over which gloss falls to 1/e.
pub const GLOSS_LIFE: f64 = 0.2;

/// How dry it looks when the part `u` of its water is gone: a sigmoid through (0, 0) and (1, 1), `u` clamped to there.
///
/// `A = (s(u) - s(0)) / (s(1) - s(0))`, `s(u) = 1 / (1 + exp(-L (u - 1/2)))`.
pub fn drying_sigmoid(u: f64) -> f64 {
    let s = |u: f64| 1.0 / (1.0 + (-SIGMOID_STEEPNESS * (u - 0.5)).exp());
    ((s(u.clamp(0.0, 1.0)) - s(0.0)) / (s(1.0) - s(0.0))).clamp(0.0, 1.0)
}

/// How much of its gloss is left when the part `u` of its water is gone: 1 to 0.
pub fn gloss_left(u: f64) -> f64 {
    let end = (-1.0 / GLOSS_LIFE).exp();
    ((-u.clamp(0.0, 1.0) / GLOSS_LIFE).exp() - end) / (1.0 - end)
}

/// How a texel looks.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WaterLook {
    /// How wet the matter looks, 0..=1: what darkens it.
    pub wetness: f64,
    /// How much of its pores mirrors, 0..=1.
    pub gloss: f64,
    /// How much of its film is to be seen, 0..=1.
    pub film: f64,
}

/// How absorbed water looks, and how much of a film. `visible_mm`: what looks fully wet, above 0; `shown`: how wet it looked
/// at its reference time and how much of its film was to be seen, 0..=1; `seconds` since then; `t_fill`: seconds that
/// it takes to be seen.
pub fn water_look(pores_mm: f64, visible_mm: f64, shown: [f64; 2], seconds: f64, t_fill: f64) -> WaterLook {
    let gone = 1.0 - (pores_mm / visible_mm).min(1.0);
    let [ramp, film] =
        shown.map(|shown| if seconds >= 0.0 { shown + seconds / t_fill.max(1e-6) } else { 0.0 });
    WaterLook {
        wetness: (1.0 - drying_sigmoid(gone)).min(ramp),
        gloss: gloss_left(gone).min(ramp),
        film: film.min(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_begin_and_end_where_they_should_and_gloss_goes_first() {
        assert_eq!([drying_sigmoid(0.0), drying_sigmoid(1.0)], [0.0, 1.0]);
        assert!((drying_sigmoid(0.5) - 0.5).abs() < 1e-12);
        assert!((gloss_left(0.0) - 1.0).abs() < 1e-12 && gloss_left(1.0).abs() < 1e-12);
        for step in 1..100 {
            let u = f64::from(step) / 100.0;
            assert!(drying_sigmoid(u) > drying_sigmoid(u - 0.01) && gloss_left(u) < gloss_left(u - 0.01));
            assert!(u > 0.83 || gloss_left(u) < 1.0 - drying_sigmoid(u), "{u}");
        }
    }

    #[test]
    fn it_takes_its_time_to_be_seen_and_goes_on_from_where_it_was() {
        let look = |shown, seconds| water_look(1.0, 0.1, [shown, 0.0], seconds, 2.0).wetness;
        assert_eq!([look(0.0, 0.0), look(0.0, 0.5), look(0.0, 2.0)], [0.0, 0.25, 1.0]);
        assert_eq!([look(0.4, 0.0), look(0.4, -1.0)], [0.4, 0.0]);
        assert_eq!(water_look(1.0, 0.1, [0.0; 2], 0.0, 0.0).wetness, 0.0);
        assert_eq!(water_look(1.0, 0.1, [0.0; 2], 0.1, 0.0).wetness, 1.0);
        assert_eq!(water_look(0.0, 0.1, [0.0, 0.5], 0.5, 2.0).film, 0.75);
    }
}
