//! Water as a layer of its own above any model.
//!
//! Light meets the water's surface first. A few percent are mirrored there, more at a slant; the rest goes in, is
//! reflected by what lies below, and comes out again through the same surface. So everything below loses by the way in
//! and by the way out. Under water the matter's own highlight nearly vanishes, because its refractive index differs
//! little from water's. What leaves diffusely leaves in all directions, but less of it at a slant; nothing is lost
//! twice, so that what comes out is at most what went in.
//!
//! A thin film follows the relief of the surface, a deep one is level. How much of a point is covered and how level the
//! water lies are smooth functions of its depth, so that borders are soft without being drawn.
//!
//! Each function has a twin of the same name in `shaders/common/water_film.wgsl`.
//!
//! Not here: refraction of the view, the darkening by internal reflection, which belongs to the
//! [models](super::super::models), and where water stands.
//!
//! - Schlick 1994, *An inexpensive BRDF model for physically-based rendering*.
//! - Lagarde 2013, *Water drop 2b* and *3b*.

/// Reflectance of water at normal incidence, `((1.33 - 1) / (1.33 + 1))²`, rounded as usual.
pub const WATER_REFLECTANCE: f64 = 0.02;

/// Depth of water, in mm, that covers all but 1/e of a rough surface.
pub const COVERAGE_MM: f64 = 0.05;

/// Fresnel's reflectance in Schlick's approximation. `reflectance` at normal incidence, `cosine` to the normal or to the
/// half vector, clamped to `[0, 1]`.
pub fn fresnel(reflectance: f64, cosine: f64) -> f64 {
    reflectance + (1.0 - reflectance) * (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}

/// Mean of [`fresnel`] over the hemisphere, weighted by the cosine: `F0 + (1 - F0) / 21`.
pub fn mean_fresnel(reflectance: f64) -> f64 {
    reflectance + (1.0 - reflectance) / 21.0
}

/// Reflectance at normal incidence of matter under water, from that in air, `n = (1 + √F0) / (1 - √F0)`,
/// `((n - 1.33) / (n + 1.33))²`. `reflectance` in `[0, 1]`. Dielectrics lose most of it; metals, whose index is not
/// real, keep theirs: do not ask for them.
pub fn reflectance_under_water(reflectance: f64) -> f64 {
    const N_WATER: f64 = 1.33;
    let root = reflectance.clamp(0.0, 1.0).sqrt();
    // (n - w) / (n + w), multiplied by 1 - √F0, which may be 0.
    let (above, below) = (1.0 + root, N_WATER * (1.0 - root));
    let under = (above - below) / (above + below);
    under * under
}

/// Part of a point that `film_mm` of water covers, `1 - exp(-h / 0.05 mm)`.
pub fn film_coverage(film_mm: f64) -> f64 {
    1.0 - (-film_mm.max(0.0) / COVERAGE_MM).exp()
}

/// How level the water lies, `1 - exp(-h / levelling)`: 0 follows the relief, 1 is flat. Both in mm, `levelling_mm` > 0.
pub fn film_levelness(film_mm: f64, levelling_mm: f64) -> f64 {
    1.0 - (-film_mm.max(0.0) / levelling_mm).exp()
}

/// What gets through the water's surface at one cosine on the way in and another on the way out.
fn through(cos_in: f64, cos_out: f64) -> f64 {
    (1.0 - fresnel(WATER_REFLECTANCE, cos_in)) * (1.0 - fresnel(WATER_REFLECTANCE, cos_out))
}

/// What the water leaves of a highlight below it, `1 - c + c (1 - F)(1 - F)`. `coverage` is `c`: the uncovered part
/// loses nothing.
pub fn film_transmission(cos_in: f64, cos_out: f64, coverage: f64) -> f64 {
    1.0 - coverage + coverage * through(cos_in, cos_out)
}

/// The same of diffuse light, `1 - c + c (1 - F)(1 - F) / (1 - mean F)`: the way out is normalized by its mean, since
/// what is sent down again comes back up. Of the light that got in, all comes out but for what the matter absorbs.
pub fn film_diffuse_transmission(cos_in: f64, cos_out: f64, coverage: f64) -> f64 {
    1.0 - coverage + coverage * through(cos_in, cos_out) / (1.0 - mean_fresnel(WATER_REFLECTANCE))
}

/// What murky water leaves on the way down and up, `exp(-σ h (1 / cos' + 1 / cos'))`; cosines are refracted (Snell).
/// `absorption_per_mm` is `σ`.
pub fn murk(absorption_per_mm: f64, film_mm: f64, cos_in: f64, cos_out: f64) -> f64 {
    let refracted = |cosine: f64| {
        let cosine = cosine.clamp(0.0, 1.0);
        (1.0 - (1.0 - cosine * cosine) / (1.33 * 1.33)).sqrt()
    };
    (-absorption_per_mm * film_mm * (1.0 / refracted(cos_in) + 1.0 / refracted(cos_out))).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matter_loses_its_highlight_under_water() {
        assert!((reflectance_under_water(0.04) - 0.003608).abs() < 5e-7);
        // Water in water cannot be seen, up to the rounding of its reflectance; mirrors stay mirrors.
        assert!(reflectance_under_water(WATER_REFLECTANCE) < 1e-6);
        assert_eq!(reflectance_under_water(1.0), 1.0);
        assert!((reflectance_under_water(0.0) - (0.33f64 / 2.33).powi(2)).abs() < 1e-12);
    }

    #[test]
    fn the_mean_is_the_mean() {
        let steps = 100_000;
        // Equal steps of cos² weight by the cosine.
        let mean: f64 = (0..steps)
            .map(|i| fresnel(WATER_REFLECTANCE, ((f64::from(i) + 0.5) / f64::from(steps)).sqrt()))
            .sum::<f64>()
            / f64::from(steps);
        assert!((mean - mean_fresnel(WATER_REFLECTANCE)).abs() < 1e-6, "{mean}");
    }

    #[test]
    fn no_water_changes_nothing_and_more_covers_more() {
        assert_eq!(film_coverage(0.0), 0.0);
        assert_eq!(film_coverage(-1.0), 0.0);
        assert_eq!(film_levelness(0.0, 0.5), 0.0);
        assert_eq!(film_transmission(0.3, 0.9, 0.0), 1.0);
        assert_eq!(film_diffuse_transmission(0.3, 0.9, 0.0), 1.0);
        assert_eq!(murk(2.0, 0.0, 0.5, 0.5), 1.0);
        let depths = [0.0, 0.01, 0.1, 0.5, 2.0];
        assert!(depths.windows(2).all(|pair| film_coverage(pair[1]) > film_coverage(pair[0])));
        assert!(depths.windows(2).all(|pair| film_levelness(pair[1], 0.5) > film_levelness(pair[0], 0.5)));
        assert!(film_coverage(2.0) > 0.999);
    }

    /// Everything that comes back of light from one direction, over matter of one diffuse albedo.
    fn albedo_from(cos_in: f64, diffuse: f64, coverage: f64) -> f64 {
        let steps = 20_000;
        let cosines = (0..steps).map(|i| ((f64::from(i) + 0.5) / f64::from(steps)).sqrt());
        let out: f64 = cosines.map(|cos_out| film_diffuse_transmission(cos_in, cos_out, coverage)).sum();
        coverage * fresnel(WATER_REFLECTANCE, cos_in) + diffuse * out / f64::from(steps)
    }

    #[test]
    fn a_white_furnace_stays_white_and_never_gets_brighter() {
        for cos_in in [1.0, 0.7, 0.3, 0.05] {
            assert!((albedo_from(cos_in, 1.0, 1.0) - 1.0).abs() < 1e-6);
            for coverage in [0.0, 0.2, 0.5, 0.8, 1.0] {
                for diffuse in [0.0, 0.3, 1.0] {
                    let albedo = albedo_from(cos_in, diffuse, coverage);
                    assert!(albedo <= 1.0 + 1e-6, "{albedo} at {cos_in}, {diffuse}, {coverage}");
                }
            }
        }
    }

    #[test]
    fn light_and_viewer_may_be_exchanged() {
        for (a, b) in [(0.2, 0.9), (1.0, 0.01), (0.5, 0.6)] {
            assert_eq!(film_transmission(a, b, 0.7), film_transmission(b, a, 0.7));
            assert_eq!(film_diffuse_transmission(a, b, 0.7), film_diffuse_transmission(b, a, 0.7));
            assert_eq!(murk(0.3, 2.0, a, b), murk(0.3, 2.0, b, a));
        }
    }
}
