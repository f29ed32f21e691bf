//! Wet by water between grains.
//!
//! Grains in water scatter light further forward than grains in air, since their refractive index differs less from what
//! is around them. It takes more scatterings to get out again, so more is absorbed. In the two-stream picture of a thick
//! layer, an albedo stands for a similarity parameter `s = sqrt((1 - ω) / (1 - ω g))`; water scales `1 - g` by one number.
//!
//! For finely divided matter such as sand and soil. Albedos are handled one channel at a time. The function has a twin of
//! the same name in `shaders/common/twomey.wgsl`.
//!
//! Twomey, Bohren, Mergenthaler 1986, *Reflectance and albedo differences between wet and dry surfaces*, in a two-stream
//! form.

/// How much less light is turned back at one scattering in water: `(1 - g_wet) / (1 - g_dry)` of mineral grains.
pub const WATER_BACKSCATTER: f64 = 0.5;

/// Albedo with water between the grains: `s = (1 - r) / (1 + r)`, `s_w = s / sqrt(b + s² (1 - b))`,
/// `(1 - s_w) / (1 + s_w)`. `albedo`: dry, in `[0, 1]`; `backscatter`: `b`, in `(0, 1]`, 1 changes nothing.
pub fn wet_albedo(albedo: f64, backscatter: f64) -> f64 {
    let r = albedo.clamp(0.0, 1.0);
    let s = (1.0 - r) / (1.0 + r);
    let wet = s / (backscatter + s * s * (1.0 - backscatter)).sqrt();
    (1.0 - wet) / (1.0 + wet)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_the_reference_vectors() {
        for (albedo, wet) in [(0.1, 0.0551), (0.3, 0.1973), (0.5, 0.3820), (0.7, 0.6054)] {
            let actual = wet_albedo(albedo, WATER_BACKSCATTER);
            assert!((actual - wet).abs() < 5e-5, "{actual} instead of {wet}");
        }
        // A half: s = 1/3, s_w = sqrt(1/5), and the albedo is (3 - sqrt 5) / 2.
        let golden = (3.0 - 5.0f64.sqrt()) / 2.0;
        assert!((wet_albedo(0.5, 0.5) - golden).abs() < 1e-12);
    }

    #[test]
    fn black_white_and_grains_in_air_stay() {
        for albedo in [0.0, 0.2, 0.6, 1.0] {
            assert!((wet_albedo(albedo, 1.0) - albedo).abs() < 1e-12);
        }
        assert_eq!(wet_albedo(0.0, 0.5), 0.0);
        assert_eq!(wet_albedo(1.0, 0.5), 1.0);
    }

    #[test]
    fn less_backscatter_is_darker() {
        for i in 1..20 {
            let albedo = f64::from(i) / 20.0;
            let wet = [1.0, 0.8, 0.5, 0.2].map(|backscatter| wet_albedo(albedo, backscatter));
            assert!(wet.windows(2).all(|pair| pair[1] < pair[0]), "{wet:?}");
        }
    }
}
