//! Expectations: measured at the end of their tick, and told in the report.

use bevy::prelude::*;
use serde::Serialize;

use super::{Action, Expectation, Quantity, due, in_order, seen_at};
use crate::clock::WeatheringClock;
use crate::matter::SurfaceMatter;
use crate::matter::wash::GRAIN_DENSITY;
use crate::particle::ParticleCounts;
use crate::scenario::{Scenario, ScenarioSurface};
use crate::wetting::{SurfaceWater, WetnessQuery};

/// What became of an expectation.
#[derive(Serialize, Debug, Clone, PartialEq)]
pub struct ExpectationOutcome {
    /// Number of its event in the scenario.
    pub event: usize,
    /// Seconds.
    pub at: f64,
    /// What was expected.
    pub expectation: Expectation,
    /// What was measured; nothing before its time, nor after it if the run began later.
    pub value: Option<f64>,
    /// Whether it held; nothing as long as it has not been looked at.
    pub holds: Option<bool>,
}

/// The expectations of the running scenario, in the order of their times.
#[derive(Resource, Debug, Clone, Default)]
pub struct Expectations {
    /// By the tick at whose end it is looked at.
    ticks: Vec<u32>,
    surfaces: Vec<Option<u32>>,
    outcomes: Vec<ExpectationOutcome>,
}

impl Expectations {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let mut all = Self::default();
        for (event, spec) in in_order(scenario) {
            let Action::Expect(expectation) = &spec.what else { continue };
            // Before the first tick there is nothing to see.
            all.ticks.push(seen_at(spec.at, scenario).max(1));
            let surface = expectation.surface.as_deref();
            all.surfaces.push(surface.and_then(|name| scenario.surface_number(name)));
            let expectation = expectation.clone();
            all.outcomes.push(ExpectationOutcome {
                event,
                at: spec.at,
                expectation,
                value: None,
                holds: None,
            });
        }
        all
    }

    /// What became of them.
    pub fn outcomes(&self) -> &[ExpectationOutcome] {
        &self.outcomes
    }

    /// As if none had been looked at.
    pub(super) fn forget(&mut self) {
        for outcome in &mut self.outcomes {
            (outcome.value, outcome.holds) = (None, None);
        }
    }
}

/// Looks at what is due in this tick.
pub(super) fn look(
    clock: Res<WeatheringClock>,
    wetness: WetnessQuery,
    surfaces: Query<(Entity, &ScenarioSurface, &SurfaceWater, &SurfaceMatter)>,
    particles: Res<ParticleCounts>,
    mut expectations: ResMut<Expectations>,
) {
    let Expectations { ticks, surfaces: numbers, outcomes } = &mut *expectations.bypass_change_detection();
    let first = ticks.partition_point(|tick| *tick < clock.tick());
    let count = due(ticks, clock.tick(), |tick| *tick).len();
    let range = first..first + count;
    for (outcome, number) in outcomes[range.clone()].iter_mut().zip(&numbers[range]) {
        let quantity = outcome.expectation.quantity;
        outcome.value = match *number {
            None => (quantity == Quantity::Particles).then_some(particles.alive as f64),
            Some(number) => {
                let found = surfaces.iter().find(|(_, surface, ..)| surface.index == number);
                found
                    .and_then(|(entity, _, water, matter)| measure(quantity, &wetness, entity, water, matter))
            }
        };
        // What cannot be measured is not as expected.
        outcome.holds = Some(outcome.value.is_some_and(|value| outcome.expectation.holds(value)));
    }
}

/// A quantity of a surface; `None` of what it does not have, or before it is measured.
fn measure(
    quantity: Quantity,
    wetness: &WetnessQuery,
    surface: Entity,
    water: &SurfaceWater,
    matter: &SurfaceMatter,
) -> Option<f64> {
    let over = wetness.over(surface)?;
    // A litre on a square metre is a millimetre.
    let mean_mm = |ml: f64| if over.area_m2 > 0.0 { ml / 1000.0 / f64::from(over.area_m2) } else { 0.0 };
    let (film_ml, absorbed_ml) = (f64::from(over.film_ml), f64::from(over.absorbed_ml));
    let stock = matter.stock();
    let ml = |units: u64| water.units().mm3(units) / 1000.0;
    // kg/m³ is mg/ml.
    let soil_g = |units: u64| ml(units) * GRAIN_DENSITY / 1000.0;
    Some(match quantity {
        Quantity::WetFraction => f64::from(over.wet_fraction),
        Quantity::FilmMm => mean_mm(film_ml),
        Quantity::AbsorbedMm => mean_mm(absorbed_ml),
        Quantity::WaterMl => film_ml + absorbed_ml,
        Quantity::DustG => soil_g(stock.dust),
        Quantity::MudG => soil_g(stock.mud),
        Quantity::SnowMm => mean_mm(ml(stock.snow)),
        // A millilitre of water is a gram.
        Quantity::SnowG => ml(stock.snow),
        Quantity::Particles => return None,
    })
}
