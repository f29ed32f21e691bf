//! Taking a surface's maps away: what is on them is entered in its accounts first.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::resize::resize_queues;
use super::{MapLoss, MapSize};
use crate::clock::WeatheringClock;
use crate::material::PorousMaterial;
use crate::matter::{MatterKind, MatterQueue, SurfaceMatter};
use crate::overlay::{SplatQueue, SurfaceTraces};
use crate::weather::DryingClock;
use crate::wetting::{DropQueue, Exposure, Now, Stock, SurfaceWater, WetGeometry};

type Contents = (
    (&'static mut MapLoss, &'static mut SplatQueue, &'static mut SurfaceTraces),
    (Option<&'static mut SurfaceMatter>, Option<&'static mut MatterQueue>, Option<&'static mut DropQueue>),
    (
        Option<&'static SurfaceWater>,
        Option<&'static WetGeometry>,
        Option<&'static Exposure>,
        Option<&'static PorousMaterial>,
    ),
);

/// What it takes to empty a surface.
#[derive(SystemParam)]
pub(super) struct Release<'w, 's> {
    clock: Option<Res<'w, WeatheringClock>>,
    drying: Option<Res<'w, DryingClock>>,
    surfaces: Query<'w, 's, Contents>,
}

impl Release<'_, '_> {
    /// The present tick, and how many there are in a second, 1 or more.
    pub(super) fn now(&self) -> (u32, u32) {
        self.clock.as_ref().map_or((0, 1), |clock| (clock.tick(), clock.hz().max(1)))
    }

    /// Brings what waits for a surface to its maps of another size.
    pub(super) fn resize_queues(&mut self, surface: Entity, from: u32, to: u32) {
        if let Ok(((_, mut splats, _), (_, mut deposits, mut drops), _)) = self.surfaces.get_mut(surface) {
            resize_queues(from, to, &mut splats, drops.as_deref_mut(), deposits.as_deref_mut());
        }
    }

    /// Empties a surface and takes its [`MapSize`], at which all that was made for it is dropped. Returns what there was.
    pub(super) fn release(&mut self, commands: &mut Commands, surface: Entity) -> MapLoss {
        commands.entity(surface).try_remove::<MapSize>();
        let mut lost = MapLoss::default();
        let Ok((
            (mut sum, mut splats, mut traces),
            (matter, deposits, drops),
            (water, geometry, exposure, material),
        )) = self.surfaces.get_mut(surface)
        else {
            return lost;
        };
        lost.unpainted = splats.splats().len() as u64;
        splats.clear();
        splats.restore_traces(SurfaceTraces::default());
        *traces = SurfaceTraces::default();
        if let Some(water) = water {
            let stock = match (&self.clock, &self.drying, geometry) {
                (Some(clock), Some(drying), Some(geometry)) if water.is_wet() => {
                    let default = PorousMaterial::default();
                    let material = material.unwrap_or(&default);
                    water.stock(&Now::new(clock.tick(), clock.hz(), drying, &geometry.0, exposure, material))
                }
                // What has dried since texels were last looked at counts as lost.
                _ => water.texels().iter().fold(
                    Stock { evaporated: water.ledger().evaporated, ..default() },
                    |sum, texel| Stock {
                        film: sum.film + u64::from(texel.film),
                        pores: sum.pores + u64::from(texel.pores),
                        ..sum
                    },
                ),
            };
            lost.enter_water(water.units(), stock, water.ledger());
            if let Some(mut matter) = matter {
                lost.enter_matter(water.units(), &matter);
                matter.reset();
            }
        }
        // What came and has not been put down yet.
        if let Some(mut drops) = drops {
            drops.0.drain(..).for_each(|drop| lost.turn_away(drop.water_nl, 0, 0));
        }
        if let Some(mut deposits) = deposits {
            for deposit in deposits.0.drain(..) {
                match deposit.kind {
                    MatterKind::Dust | MatterKind::Mud => lost.turn_away(0, deposit.volume_nl, 0),
                    MatterKind::Snow => lost.turn_away(0, 0, deposit.volume_nl),
                }
            }
        }
        sum.add(&lost);
        lost
    }
}
