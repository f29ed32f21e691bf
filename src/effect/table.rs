//! Effects as rows of numbers, for loops over particles and impacts.

use bevy::prelude::*;

use super::WeatherEffect;
use super::drops::{SIZE_CLASSES, fall_speed};
use crate::stamps::StampSet;

/// Which row of the [`EffectTable`] a particle belongs to.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EffectIndex(pub u16);

/// The numbers of one effect that simulation reads per particle and per impact.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectRow {
    /// The asset the row mirrors.
    pub handle: Handle<WeatherEffect>,
    /// A copy of the asset; `None` until it is loaded.
    pub effect: Option<WeatherEffect>,
    /// Diameters of its drops by size class, mm.
    pub diameters_mm: [f32; SIZE_CLASSES],
    /// Numbers of its stamps in the [`StampAtlas`](crate::overlay::StampAtlas): the first, and how many
    /// variants there are.
    pub stamps: (u32, u32),
}

impl EffectRow {
    fn new(handle: Handle<WeatherEffect>) -> Self {
        Self { handle, effect: None, diameters_mm: [0.0; SIZE_CLASSES], stamps: (0, 0) }
    }

    fn set(&mut self, effect: WeatherEffect) {
        self.diameters_mm = effect.drops.diameters_mm();
        if self.effect.as_ref().is_none_or(|old| old.stamp_set != effect.stamp_set) {
            self.stamps = (0, 0);
        }
        self.effect = Some(effect);
    }

    /// Water of a particle of this volume, nanolitres.
    pub fn water_nl(&self, volume_nl: u32) -> u32 {
        self.effect.as_ref().map_or(0, |effect| effect.carries.parts_nl(volume_nl).0)
    }

    /// Speed at which drag balances gravity, m/s, for drops of a class; 0 is no drag.
    pub fn terminal_speed(&self, class: usize) -> f32 {
        let given = self.effect.as_ref().and_then(|effect| effect.terminal_speed);
        given.unwrap_or_else(|| fall_speed(f64::from(self.diameters_mm[class])) as f32)
    }
}

/// All effects in use, in the order of their first use. No row is removed while there are particles, so an index stays true.
#[derive(Resource, Debug, Default)]
pub struct EffectTable {
    rows: Vec<EffectRow>,
}

impl EffectTable {
    /// The row of `handle`, added when it is new. `None` when all 65,536 rows are taken.
    pub fn index_of(&mut self, handle: &Handle<WeatherEffect>) -> Option<EffectIndex> {
        if let Some(found) = self.rows.iter().position(|row| row.handle == *handle) {
            return Some(EffectIndex(found as u16));
        }
        let index = u16::try_from(self.rows.len()).ok()?;
        self.rows.push(EffectRow::new(handle.clone()));
        Some(EffectIndex(index))
    }

    /// The effect of a row, once its asset is loaded.
    pub fn get(&self, index: EffectIndex) -> Option<&WeatherEffect> {
        self.rows.get(usize::from(index.0))?.effect.as_ref()
    }

    /// A row, once its asset is loaded.
    pub fn row(&self, index: EffectIndex) -> Option<&EffectRow> {
        self.rows.get(usize::from(index.0)).filter(|row| row.effect.is_some())
    }

    /// Rows whose stamps have no numbers yet.
    pub(crate) fn without_stamps(&mut self) -> impl Iterator<Item = (&mut (u32, u32), &StampSet)> {
        self.rows.iter_mut().filter(|row| row.stamps.1 == 0).filter_map(|row| {
            let set = row.effect.as_ref()?.stamp_set.as_deref()?;
            Some((&mut row.stamps, set))
        })
    }

    /// All rows, in index order.
    pub fn rows(&self) -> &[EffectRow] {
        &self.rows
    }

    /// Registers an effect without an asset server, for tests and for worlds that build effects in code.
    pub fn insert(&mut self, handle: Handle<WeatherEffect>, effect: WeatherEffect) -> Option<EffectIndex> {
        let index = self.index_of(&handle)?;
        self.rows[usize::from(index.0)].set(effect);
        Some(index)
    }

    /// Forgets the rows behind the first `rows`: there must be no particle of theirs any more.
    pub(crate) fn truncate(&mut self, rows: usize) {
        self.rows.truncate(rows);
    }

    /// Copies what has been loaded or changed into the rows.
    pub fn refresh(&mut self, effects: &Assets<WeatherEffect>) {
        for row in &mut self.rows {
            let asset = effects.get(&row.handle);
            if let Some(asset) = asset
                && row.effect.as_ref() != Some(asset)
            {
                row.set(asset.clone());
            }
        }
    }
}

/// Keeps the rows equal to the assets; what reloads takes effect in the next frame.
pub fn refresh_effect_table(
    mut events: MessageReader<AssetEvent<WeatherEffect>>,
    effects: Res<Assets<WeatherEffect>>,
    mut table: ResMut<EffectTable>,
) {
    let unloaded = table.rows.iter().any(|row| row.effect.is_none());
    if events.read().count() > 0 || unloaded {
        table.refresh(&effects);
    }
}
