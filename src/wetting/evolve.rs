//! What becomes of the water in a texel while nothing comes and nothing runs: a closed form of time.
//!
//! Three phases follow each other. The matter takes up the film by its sorptivity, `I = sqrt(I0² + S² t)`, until it is
//! full, while the film evaporates; what is left of the film evaporates; then the pores dry, at the full rate down to a
//! saturation of .3, and exponentially from there. Before its pores begin to dry, a texel inside a wet patch is spared
//! for a while by the damp air of its neighbours: its [reserve](Amounts::reserve_mm).
//!
//! The demand of the weather is thought to be even over the time asked for. What is asked for at once and what is asked
//! for in steps is then the same.
//!
//! The function has a twin of the same name in `shaders/common/drying.wgsl`.
//!
//! Sources: Hall and Hoff 2012 for the sorptivity; the critical saturation of drying, e.g. Scherer 1990.

/// Saturation below which water comes to the surface too slowly to keep up with the weather.
pub const CRITICAL_SATURATION: f64 = 0.3;

/// What the matter below a texel does with water.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matter {
    /// The square of the sorptivity, mm²/s.
    pub sorptivity_squared: f64,
    /// What its pores hold, mm of water; 0 is glazed.
    pub capacity_mm: f64,
}

impl Matter {
    /// From a sorptivity in mm/√min, the unit of tables.
    pub fn new(sorptivity: f64, capacity_mm: f64) -> Self {
        Self { sorptivity_squared: sorptivity * sorptivity / 60.0, capacity_mm }
    }
}

/// Water in and on a texel, as depths.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Amounts {
    /// Film on the surface, mm.
    pub film_mm: f64,
    /// Absorbed, mm.
    pub pores_mm: f64,
    /// Demand that goes by before the pores begin to dry, mm.
    pub reserve_mm: f64,
}

/// The amounts `seconds` later, if the weather demands `demand_mm` during that time. Both 0 or more.
pub fn evolve(before: Amounts, matter: Matter, seconds: f64, demand_mm: f64) -> Amounts {
    let Amounts { film_mm: film, pores_mm: pores, reserve_mm: reserve } = before;
    let full = full_mm(pores, matter);
    let squared = matter.sorptivity_squared;
    let soaked = taken_up(pores, matter, seconds);
    let left = film - (soaked - pores) - demand_mm;
    if left >= 0.0 {
        return Amounts { film_mm: left, pores_mm: soaked, reserve_mm: reserve };
    }
    if film <= 0.0 {
        return dry_pores(pores, reserve, matter.capacity_mm, demand_mm);
    }
    // The film is gone after a part of the time.
    let supply = film + pores;
    let (rate, part) =
        (demand_mm / seconds.max(1e-9), film_part(film, pores, full, squared, seconds, demand_mm));
    let soaked = (supply - rate * part * seconds).clamp(pores, full);
    dry_pores(soaked, reserve, matter.capacity_mm, demand_mm * (1.0 - part))
}

/// The film of [`evolve`] alone: the same to the bit, for less. All in mm.
pub(crate) fn film_left(film: f64, pores: f64, matter: Matter, seconds: f64, demand_mm: f64) -> f64 {
    // Not a number is no film.
    (film - (taken_up(pores, matter, seconds) - pores) - demand_mm).max(0.0)
}

/// What the pores hold when they are full, mm. They may hold more than their capacity: when the material was exchanged.
fn full_mm(pores: f64, matter: Matter) -> f64 {
    matter.capacity_mm.max(pores)
}

/// What the pores hold after a time under a film that lasts, mm.
fn taken_up(pores: f64, matter: Matter, seconds: f64) -> f64 {
    let full = full_mm(pores, matter);
    if pores < full { (pores * pores + matter.sorptivity_squared * seconds).sqrt().min(full) } else { full }
}

/// The part of the time after which a film that does not last is gone: the root of
/// `sqrt(I0² + S² t) = I0 + h - E t` or, where the matter is full before, of `h - (I_max - I0) = E t`.
fn film_part(film: f64, pores: f64, full: f64, squared: f64, seconds: f64, demand_mm: f64) -> f64 {
    let rate = demand_mm / seconds.max(1e-9);
    let supply = film + pores;
    let room = full - pores;
    // While it is taking up water: solved so that it holds for a rate of 0, too.
    let b = 2.0 * supply * rate + squared;
    let c = supply * supply - pores * pores;
    let root = (b * b - 4.0 * rate * rate * c).max(0.0).sqrt();
    let taking_up = 2.0 * c / (b + root).max(1e-30);
    let until_full = (full * full - pores * pores) / squared.max(1e-30);
    let when =
        if room > 0.0 && taking_up <= until_full { taking_up } else { (film - room) / rate.max(1e-30) };
    (when / seconds.max(1e-9)).clamp(0.0, 1.0)
}

/// Pores that dry: first the reserve goes by, then they lose `E min(1, s/.3)`.
fn dry_pores(pores: f64, reserve: f64, capacity_mm: f64, demand_mm: f64) -> Amounts {
    let spared = reserve.min(demand_mm);
    let demand = demand_mm - spared;
    let critical = CRITICAL_SATURATION * capacity_mm;
    let even = (pores - critical).clamp(0.0, demand);
    let rest = if critical > 0.0 { (-(demand - even) / critical).exp() } else { 0.0 };
    Amounts { film_mm: 0.0, pores_mm: (pores - even) * rest, reserve_mm: reserve - spared }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(film_mm: f64) -> Amounts {
        Amounts { film_mm, ..Default::default() }
    }

    const BRICK: Matter = Matter { sorptivity_squared: 4.0 / 60.0, capacity_mm: 3.0 };

    #[test]
    fn a_film_is_taken_up_by_the_root_of_time() {
        let mut now = film(0.5);
        for expected in [0.258199, 0.365148, 0.447214, 0.5, 0.5] {
            now = evolve(now, BRICK, 1.0, 0.0);
            assert!((now.pores_mm - expected).abs() < 1e-6, "{now:?}");
            assert!((now.film_mm + now.pores_mm - 0.5).abs() < 1e-12);
        }
        // Exact for any step.
        for steps in [1, 7, 240] {
            let mut now = film(0.5);
            (0..steps).for_each(|_| now = evolve(now, BRICK, 3.0 / f64::from(steps), 0.0));
            assert!((now.pores_mm - 0.447214).abs() < 1e-6, "{steps} {now:?}");
        }
    }

    #[test]
    fn what_is_full_or_glazed_keeps_the_rest_as_a_film() {
        let full = evolve(film(5.0), BRICK, 1e6, 0.0);
        assert_eq!((full.pores_mm, full.film_mm), (3.0, 2.0));
        for glazed in [Matter::new(2.0, 0.0), Matter::new(0.0, 3.0)] {
            let kept = evolve(film(0.3), glazed, 3600.0, 0.1);
            assert!((kept.film_mm - 0.2).abs() < 1e-12 && kept.pores_mm == 0.0, "{kept:?}");
            assert_eq!(evolve(film(0.3), glazed, 3600.0, 0.4), Amounts::default());
        }
    }

    #[test]
    fn steps_of_any_length_lead_to_the_same() {
        for matter in [BRICK, Matter::new(0.15, 0.4), Matter::new(2.0, 0.06), Matter::new(0.0, 0.0)] {
            for (h, i, reserve) in [(0.5, 0.0, 0.0), (0.02, 0.3, 0.05), (0.0, 0.06, 0.02), (1.0, 0.01, 0.0)] {
                for rate in [0.0, 1e-4, 2e-3, 0.05] {
                    let start = Amounts { film_mm: h, pores_mm: i, reserve_mm: reserve };
                    let at_once = evolve(start, matter, 100.0, rate * 100.0);
                    let mut stepped = start;
                    (0..400).for_each(|_| stepped = evolve(stepped, matter, 0.25, rate * 0.25));
                    for (a, b) in [
                        (at_once.film_mm, stepped.film_mm),
                        (at_once.pores_mm, stepped.pores_mm),
                        (at_once.reserve_mm, stepped.reserve_mm),
                    ] {
                        assert!((a - b).abs() < 1e-6, "{matter:?} {start:?} {rate}: {at_once:?} {stepped:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn film_goes_first_then_the_reserve_then_the_pores_ever_slower() {
        let start = Amounts { film_mm: 0.2, pores_mm: 3.0, reserve_mm: 0.1 };
        let hours = |demand| evolve(start, BRICK, 3600.0, demand);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(near(hours(0.1).film_mm, 0.1) && hours(0.1).pores_mm == 3.0);
        assert!(near(hours(0.25).reserve_mm, 0.05) && hours(0.25).pores_mm == 3.0);
        assert!(near(hours(1.3).pores_mm, 2.0));
        assert!(near(hours(2.4).pores_mm, 0.9));
        assert!(near(hours(3.3).pores_mm, 0.9 / std::f64::consts::E));
        assert!(hours(60.0).pores_mm > 0.0);
    }

    #[test]
    fn water_is_never_made_and_nothing_is_ever_negative() {
        for i in 0..4000u32 {
            let x =
                |k: u32| f64::from((i.wrapping_mul(2_654_435_761).wrapping_add(k * 97_531)) % 1000) / 1000.0;
            let start = Amounts { film_mm: x(1).powi(3), pores_mm: x(2) * 2.0, reserve_mm: x(3) * 0.1 };
            let matter = Matter::new(x(4) * 3.0, (x(5) - 0.2).max(0.0) * 3.0);
            let after = evolve(start, matter, x(6).powi(4) * 1e4, x(7).powi(4) * 3.0);
            let (before, now) = (start.film_mm + start.pores_mm, after.film_mm + after.pores_mm);
            assert!(now <= before + 1e-12 && after.film_mm >= 0.0 && after.pores_mm >= 0.0, "{i} {after:?}");
            assert!(after.film_mm <= start.film_mm && after.reserve_mm >= 0.0, "{i} {start:?} {after:?}");
        }
    }
}
