//! Effects as rows of numbers, for loops over particles and impacts.

use bevy::prelude::*;

use super::WeatherEffect;

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
}

/// All effects in use, in the order of their first use. Rows are never removed, so an index stays true.
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
        self.rows.push(EffectRow { handle: handle.clone(), effect: None });
        Some(EffectIndex(index))
    }

    /// The effect of a row, once its asset is loaded.
    pub fn get(&self, index: EffectIndex) -> Option<&WeatherEffect> {
        self.rows.get(usize::from(index.0))?.effect.as_ref()
    }

    /// All rows, in index order.
    pub fn rows(&self) -> &[EffectRow] {
        &self.rows
    }

    /// Registers an effect without an asset server, for tests and for worlds that build effects in code.
    pub fn insert(&mut self, handle: Handle<WeatherEffect>, effect: WeatherEffect) -> Option<EffectIndex> {
        let index = self.index_of(&handle)?;
        self.rows[usize::from(index.0)].effect = Some(effect);
        Some(index)
    }

    /// Copies what has been loaded or changed into the rows.
    pub fn refresh(&mut self, effects: &Assets<WeatherEffect>) {
        for row in &mut self.rows {
            let asset = effects.get(&row.handle);
            if asset.is_some() && asset != row.effect.as_ref() {
                row.effect = asset.cloned();
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
