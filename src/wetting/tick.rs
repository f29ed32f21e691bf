//! One tick of all water, surface by surface.

use std::sync::atomic::{AtomicU64, Ordering};

use bevy::prelude::*;
use bevy::utils::Parallel;

use super::rim::{RimScratch, measure_rims};
use super::run_off::{RunScratch, run_off};
use super::soak::{SoakScratch, soak};
use super::spread::{SpreadScratch, spread};
use super::{Dripping, DropQueue, Exposure, Now, SurfaceWater, WetGeometry};
use crate::clock::WeatheringClock;
use crate::material::PorousMaterial;
use crate::matter::{
    FallingSnow, MatterQueue, MatterScratch, SurfaceMatter, advance_matter, deposit, is_at_rest,
};
use crate::overlay::StampAtlas;
use crate::particle::for_each_chunk;
use crate::weather::{DryingClock, Weather};

/// What the water has cost so far. Surfaces at rest add nothing.
#[derive(Resource, Debug, Default)]
pub struct WettingStats {
    drops: AtomicU64,
    tiles_run: AtomicU64,
    tiles_spread: AtomicU64,
    rims: AtomicU64,
    deposits: AtomicU64,
    tiles_matter: AtomicU64,
}

impl WettingStats {
    /// Drops soaked up.
    pub fn drops(&self) -> u64 {
        self.drops.load(Ordering::Relaxed)
    }

    /// Steps of tiles with films that run.
    pub fn tiles_run(&self) -> u64 {
        self.tiles_run.load(Ordering::Relaxed)
    }

    /// Steps of tiles whose pores share water.
    pub fn tiles_spread(&self) -> u64 {
        self.tiles_spread.load(Ordering::Relaxed)
    }

    /// Dust, mud and snow put down.
    pub fn deposits(&self) -> u64 {
        self.deposits.load(Ordering::Relaxed)
    }

    /// Steps of tiles whose snow slides or melts.
    pub fn tiles_matter(&self) -> u64 {
        self.tiles_matter.load(Ordering::Relaxed)
    }

    /// Surfaces whose rims were measured.
    pub fn rims(&self) -> u64 {
        self.rims.load(Ordering::Relaxed)
    }
}

/// Tiles with films that may run, from which on a surface is worth several threads.
const MANY_TILES: usize = 64;

/// Buffers of one thread.
#[derive(Default)]
pub(super) struct Scratch {
    soak: SoakScratch,
    run: RunScratch,
    spread: SpreadScratch,
    rim: RimScratch,
    matter: MatterScratch,
}

type Surface = (
    &'static mut SurfaceWater,
    &'static mut DropQueue,
    &'static mut Dripping,
    &'static mut SurfaceMatter,
    &'static mut MatterQueue,
    &'static mut FallingSnow,
    &'static WetGeometry,
    Option<&'static Exposure>,
    Option<&'static PorousMaterial>,
);

/// Soaks up what came, runs, spreads, and measures rims, on all surfaces that have something to do. Surfaces do not share
/// texels, so they take their turns in parallel; where one of them is large, its tiles do.
pub(super) fn advance_water(
    clock: Res<WeatheringClock>,
    drying: Res<DryingClock>,
    weather: Res<Weather>,
    stats: Res<WettingStats>,
    atlas: Option<Res<StampAtlas>>,
    scratch: Local<Parallel<Scratch>>,
    mut memory: Local<Vec<SurfaceItem<'static, 'static>>>,
    mut surfaces: Query<Surface>,
) {
    let is_busy = |(water, drops, _, matter, deposits, ..): &SurfaceItem| {
        !drops.0.is_empty()
            || !deposits.0.is_empty()
            || !water.is_at_rest()
            || water.rained_at != 0
            || !is_at_rest(water, matter, &weather)
    };
    let mut busy: Vec<SurfaceItem> = reused(std::mem::take(&mut *memory));
    busy.extend(surfaces.iter_mut().filter(is_busy));
    let default = PorousMaterial::default();
    let stamps = atlas.as_deref();
    let advance = |scratch: &mut Scratch,
                   (
        mut water,
        mut drops,
        mut drips,
        mut matter,
        mut deposits,
        mut falling,
        geometry,
        exposure,
        material,
    ): SurfaceItem| {
        // Change detection is for those who draw it, and looks at its dirty tiles.
        let (water, drops) = (&mut *water, drops.bypass_change_detection());
        let (matter, deposits) = (&mut *matter, deposits.bypass_change_detection());
        let size = water.size;
        let material = material.unwrap_or(&default);
        let now = Now::new(clock.tick(), clock.hz(), &drying, &geometry.0, exposure, material);
        if !drops.0.is_empty() {
            water.wake(material.leaves_marks());
        }
        // Dust first: what falls on dry ground in a tick is wetted by the drops of that tick, whatever their order.
        for matter_of_impact in &deposits.0 {
            deposit(water, matter, &now, &weather, matter_of_impact, stamps, &mut scratch.matter);
        }
        stats.deposits.fetch_add(deposits.0.len() as u64, Ordering::Relaxed);
        deposits.0.clear();
        soak(water, &now, &drops.0, &mut scratch.soak, matter.awake(size), &weather);
        stats.drops.fetch_add(drops.0.len() as u64, Ordering::Relaxed);
        drops.0.clear();
        let drips = &mut drips.bypass_change_detection().0;
        let tiles = run_off(water, &now, &mut scratch.run, drips, matter.awake(size));
        stats.tiles_run.fetch_add(u64::from(tiles), Ordering::Relaxed);
        let tiles = spread(water, &now, &mut scratch.spread);
        stats.tiles_spread.fetch_add(u64::from(tiles), Ordering::Relaxed);
        let tiles = advance_matter(water, matter, &now, &weather, &mut scratch.matter);
        stats.tiles_matter.fetch_add(u64::from(tiles), Ordering::Relaxed);
        falling.bypass_change_detection().0.append(&mut scratch.matter.falls);
        let measured = measure_rims(water, &now, &mut scratch.rim);
        stats.rims.fetch_add(u64::from(measured), Ordering::Relaxed);
    };
    let scratch = &*scratch;
    // A single large one would keep one thread busy and leave the others idle: its tiles are shared out instead. It comes to the
    // same water.
    let is_large = |(water, ..): &SurfaceItem| water.tiles.running.len() >= MANY_TILES;
    let mut large = busy.iter().enumerate().filter(|&(_, item)| is_large(item)).map(|(index, _)| index);
    if let (Some(only), None) = (large.next(), large.next()) {
        let item = busy.swap_remove(only);
        let mut own = scratch.borrow_local_mut();
        own.run.has_helpers = true;
        advance(&mut own, item);
        own.run.has_helpers = false;
    }
    for_each_chunk(busy.drain(..), |item| advance(&mut scratch.borrow_local_mut(), item));
    *memory = reused(busy);
}

/// The memory of a list for items of another lifetime. Collecting in place, as `Vec` does from a `Vec` of the same layout, takes
/// none anew.
fn reused<A, B>(mut list: Vec<A>) -> Vec<B> {
    list.clear();
    list.into_iter().filter_map(|_| None).collect()
}

type SurfaceItem<'w, 's> = bevy::ecs::query::QueryItem<'w, 's, Surface>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_keep_their_memory_from_tick_to_tick() {
        let text = String::from("as long as this function");
        let mut list: Vec<&str> = reused(Vec::<&'static str>::with_capacity(100));
        list.push(&text);
        let memory = list.as_ptr();
        let list: Vec<&'static str> = reused(list);
        assert!(list.is_empty() && list.capacity() >= 100);
        assert_eq!(list.as_ptr(), memory);
    }
}
