//! Accounts of what is lost with maps, or for want of them.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::matter::SurfaceMatter;
use crate::wetting::{Ledger, Stock, Units};

/// What became of the water and the matter of a surface whose maps are gone, and of what fell on it while it had none. In the
/// [finest units](MapLoss::UNITS), so that nothing is rounded.
///
/// `received + melted + painted = water + evaporated + dripped + spilled + wiped`, and for matter as in
/// [`MatterLedger`](crate::matter::MatterLedger) with `soil` and `snow` in place of what lies on the surface.
#[derive(Component, Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Component, Default)]
pub struct MapLoss {
    /// Impacts on it while it had no maps, and splats that still waited when it lost them.
    pub unpainted: u64,
    /// Water that had come with particles.
    pub received: u64,
    /// Water that is lost: film, absorbed, and what fell on the surface without maps.
    pub water: u64,
    /// Water that had evaporated.
    pub evaporated: u64,
    /// Water that had left as drips.
    pub dripped: u64,
    /// Water that had run off.
    pub spilled: u64,
    /// Water that brushes had brought.
    pub painted: u64,
    /// Water that brushes had taken.
    pub wiped: u64,
    /// Dust and mud that had come.
    pub received_soil: u64,
    /// Dust and mud that is lost.
    pub soil: u64,
    /// Dust and mud that had left with water.
    pub washed_off: u64,
    /// Dust and mud that brushes had taken.
    pub wiped_soil: u64,
    /// Snow that had come.
    pub received_snow: u64,
    /// Snow that is lost.
    pub snow: u64,
    /// Snow that had become water.
    pub melted: u64,
    /// Snow that had slid off.
    pub slid_off: u64,
    /// Snow that brushes had taken.
    pub wiped_snow: u64,
}

impl MapLoss {
    /// What its numbers are in.
    pub const UNITS: Units = Units { shift: Units::MAX_SHIFT };

    /// mm³ of one of its numbers.
    pub fn mm3(amount: u64) -> f64 {
        Self::UNITS.mm3(amount)
    }

    /// Whether anything that was there is gone.
    pub fn is_lost(&self) -> bool {
        self.water > 0 || self.soil > 0 || self.snow > 0
    }

    /// Enters water that is lost with a map. `stock` of its texels, `ledger` of its past.
    pub(super) fn enter_water(&mut self, units: Units, stock: Stock, ledger: Ledger) {
        let finest = |amount: u64| finest(units, amount);
        self.received += finest(ledger.received);
        self.water += finest(stock.film + stock.pores);
        self.evaporated += finest(stock.evaporated);
        self.dripped += finest(ledger.dripped);
        self.spilled += finest(ledger.spilled);
        self.painted += finest(ledger.painted);
        self.wiped += finest(ledger.wiped);
    }

    /// Enters matter that is lost with a map.
    pub(super) fn enter_matter(&mut self, units: Units, matter: &SurfaceMatter) {
        let finest = |amount: u64| finest(units, amount);
        let (stock, ledger) = (matter.stock(), matter.ledger());
        self.received_soil += finest(ledger.received_dust + ledger.received_mud);
        self.soil += finest(stock.dust + stock.mud);
        self.washed_off += finest(ledger.washed_off);
        self.wiped_soil += finest(ledger.wiped);
        self.received_snow += finest(ledger.received_snow);
        self.snow += finest(stock.snow);
        self.melted += finest(ledger.melted);
        self.slid_off += finest(ledger.slid_off);
        self.wiped_snow += finest(ledger.wiped_snow);
    }

    /// Enters what an impact brought, in nanolitres, that finds no map.
    pub(crate) fn turn_away_impact(&mut self, water_nl: u32, soil_nl: u32, snow_nl: u32) {
        self.unpainted += 1;
        self.turn_away(water_nl, soil_nl, snow_nl);
    }

    /// Enters what came, in nanolitres, and finds no map.
    pub(super) fn turn_away(&mut self, water_nl: u32, soil_nl: u32, snow_nl: u32) {
        let [water, soil, snow] = [water_nl, soil_nl, snow_nl].map(|nl| Self::UNITS.from_nl(u64::from(nl)));
        self.received += water;
        self.water += water;
        self.received_soil += soil;
        self.soil += soil;
        self.received_snow += snow;
        self.snow += snow;
    }

    /// Adds another's numbers.
    pub(super) fn add(&mut self, other: &Self) {
        let Self {
            unpainted,
            received,
            water,
            evaporated,
            dripped,
            spilled,
            painted,
            wiped,
            received_soil,
            soil,
            washed_off,
            wiped_soil,
            received_snow,
            snow,
            melted,
            slid_off,
            wiped_snow,
        } = other;
        for (sum, part) in [
            (&mut self.unpainted, unpainted),
            (&mut self.received, received),
            (&mut self.water, water),
            (&mut self.evaporated, evaporated),
            (&mut self.dripped, dripped),
            (&mut self.spilled, spilled),
            (&mut self.painted, painted),
            (&mut self.wiped, wiped),
            (&mut self.received_soil, received_soil),
            (&mut self.soil, soil),
            (&mut self.washed_off, washed_off),
            (&mut self.wiped_soil, wiped_soil),
            (&mut self.received_snow, received_snow),
            (&mut self.snow, snow),
            (&mut self.melted, melted),
            (&mut self.slid_off, slid_off),
            (&mut self.wiped_snow, wiped_snow),
        ] {
            *sum += part;
        }
    }
}

/// Units of a surface as the finest ones.
fn finest(units: Units, amount: u64) -> u64 {
    amount << (MapLoss::UNITS.shift - units.shift.min(MapLoss::UNITS.shift))
}
