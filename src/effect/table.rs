//! Effects as rows of numbers, for loops over particles and impacts.

use std::sync::Arc;

use bevy::prelude::*;

use super::drops::SIZE_CLASSES;
use super::{Carries, WeatherEffect};
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
    /// How fast those fall in still air, m/s.
    terminal_speeds: [f32; SIZE_CLASSES],
    /// Speed along the normal at which its marks are as large as it says, m/s; 0 if speed does not count.
    stamp_speed: f32,
    /// Numbers of its stamps in the [`StampAtlas`](crate::overlay::StampAtlas): the first, and how many
    /// variants there are.
    pub stamps: (u32, u32),
    /// The effect's own, or made for it; none of domes.
    stamp_set: Option<Arc<StampSet>>,
}

impl EffectRow {
    fn new(handle: Handle<WeatherEffect>) -> Self {
        let none = [0.0; SIZE_CLASSES];
        Self {
            handle,
            effect: None,
            diameters_mm: none,
            terminal_speeds: none,
            stamp_speed: 0.0,
            stamps: (0, 0),
            stamp_set: None,
        }
    }

    fn set(&mut self, effect: WeatherEffect) {
        self.diameters_mm = effect.drops.diameters_mm();
        self.terminal_speeds = effect.terminal_speeds();
        self.stamp_speed = match effect.carries {
            // Of drops of many sizes: of those in their middle.
            Carries::Water | Carries::Mud(_) => {
                effect.stamp_speed.unwrap_or(self.terminal_speeds[SIZE_CLASSES / 2])
            }
            Carries::Dust | Carries::Snow => 0.0,
        };
        let source = |effect: &WeatherEffect| (effect.stamps.clone(), effect.stamp_set.clone());
        // Stamps are not made again with every other edit.
        if self.effect.as_ref().is_none_or(|old| source(old) != source(&effect)) {
            let set = effect.stamp_set.clone().or_else(|| effect.stamps.made());
            if self.stamp_set != set {
                (self.stamp_set, self.stamps) = (set, (0, 0));
            }
        }
        self.effect = Some(effect);
    }

    /// Water of a particle of this volume, nanolitres.
    pub fn water_nl(&self, volume_nl: u32) -> u32 {
        self.effect.as_ref().map_or(0, |effect| effect.carries.parts_nl(volume_nl).0)
    }

    /// Speed at which drag balances gravity, m/s, for drops of a class; 0 is no drag.
    pub fn terminal_speed(&self, class: usize) -> f32 {
        self.terminal_speeds[class]
    }

    /// How many times as wide as `stamp_radius` a mark is by its speed along the normal, m/s: the square root of that over
    /// `stamp_speed`, within bounds; 1 if speed does not count. With the volume it is all of We^(1/4).
    pub fn width_by_speed(&self, normal_speed: f32) -> f32 {
        if self.stamp_speed <= 0.0 {
            return 1.0;
        }
        (normal_speed / self.stamp_speed)
            .sqrt()
            .clamp(WeatherEffect::LEAST_BY_SPEED, WeatherEffect::MOST_BY_SPEED)
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

    /// Whether this effect is there.
    pub(crate) fn has(&self, handle: &Handle<WeatherEffect>) -> bool {
        self.rows.iter().any(|row| row.handle == *handle && row.effect.is_some())
    }

    /// Rows whose stamps have no numbers yet.
    pub(crate) fn without_stamps(&mut self) -> impl Iterator<Item = (&mut (u32, u32), &StampSet)> {
        self.rows.iter_mut().filter(|row| row.stamps.1 == 0).filter_map(|row| {
            let set = row.stamp_set.as_deref()?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{StampSource, StampTurn};
    use crate::stamps::StampKind;

    /// How many rows wait for numbers, which they get.
    fn numbered(table: &mut EffectTable) -> usize {
        let mut count = 0;
        for (numbers, set) in table.without_stamps() {
            *numbers = (1, set.variants.len() as u32);
            count += 1;
        }
        count
    }

    #[test]
    fn an_effect_made_in_code_has_the_stamps_of_its_kind() {
        let mut table = EffectTable::default();
        let of_kind =
            |kind| WeatherEffect { stamps: StampSource::Kind(kind), stamp_radius: Some(0.02), ..default() };
        let splat = of_kind(StampKind::Splat);
        assert!(splat.stamp_set.is_none());
        table.insert(Handle::default(), splat.clone()).unwrap();
        assert_eq!((numbered(&mut table), table.rows()[0].stamps), (1, (1, 4)));

        // Any other edit leaves them as they are, and so does asking for the same ones ahead.
        let turned = WeatherEffect { stamp_turn: StampTurn::Flight, ..splat };
        table.insert(Handle::default(), turned.clone());
        assert_eq!(numbered(&mut table), 0);
        table.insert(Handle::default(), turned.with_stamps().unwrap());
        assert_eq!(numbered(&mut table), 0);

        table.insert(Handle::default(), of_kind(StampKind::Drop));
        assert_eq!(numbered(&mut table), 1);
        table.insert(Handle::default(), WeatherEffect::default());
        assert_eq!((numbered(&mut table), table.rows()[0].stamps), (0, (0, 0)));
    }

    #[test]
    fn drops_and_grains_fall_by_laws_of_their_own_unless_a_speed_is_given() {
        use crate::effect::{DropSizes, ShippedEffect};

        let mut table = EffectTable::default();
        let mut speed = |effect: WeatherEffect| {
            table.insert(Handle::default(), effect).unwrap();
            table.rows()[0].terminal_speed(0)
        };
        let of = |carries, mm| WeatherEffect { carries, drops: DropSizes::Same(mm), ..default() };
        assert!((speed(of(Carries::Water, 2.0)) - 6.55).abs() < 0.01);
        let [fine, coarse] = [0.02, 0.1].map(|mm| speed(of(Carries::Dust, mm)));
        assert!((fine - 0.031).abs() < 0.001 && (coarse - 0.58).abs() < 0.01, "{fine} {coarse}");
        assert_eq!(speed(WeatherEffect { terminal_speed: Some(0.5), ..of(Carries::Dust, 0.1) }), 0.5);
        // Grains of 50 micrometres.
        let dust = speed(ShippedEffect::named("dust").unwrap().read().unwrap());
        assert!((dust - 0.18).abs() < 0.005, "{dust}");
    }

    #[test]
    fn a_mark_is_as_wide_as_the_root_of_its_speed_within_bounds_and_dust_does_not_spread() {
        let mut table = EffectTable::default();
        let mut at = |effect: WeatherEffect, speed: f32| {
            table.insert(Handle::default(), effect).unwrap();
            table.rows()[0].width_by_speed(speed)
        };
        let own = WeatherEffect { stamp_speed: Some(4.0), ..default() };
        assert_eq!([1.0, 4.0, 9.0].map(|speed| at(own.clone(), speed)), [0.5, 1.0, 1.5]);
        let (least, most) = (WeatherEffect::LEAST_BY_SPEED, WeatherEffect::MOST_BY_SPEED);
        assert_eq!([0.0, 0.1, 900.0].map(|speed| at(own.clone(), speed)), [least, least, most]);
        // Of the smallest number that is none.
        let tiny = WeatherEffect { stamp_speed: Some(f32::from_bits(1)), ..default() };
        assert_eq!([0.0, 1.0].map(|speed| at(tiny.clone(), speed)), [least, most]);
        // Not given it is that of the fall; what falls without drag has none.
        let fall = WeatherEffect { terminal_speed: Some(8.0), ..default() };
        assert_eq!((at(fall.clone(), 8.0), at(fall.clone(), 2.0)), (1.0, 0.5));
        let mud = WeatherEffect { carries: Carries::Mud(0.4), ..fall.clone() };
        assert_eq!(at(mud, 2.0), 0.5);
        assert_eq!(at(WeatherEffect { terminal_speed: Some(0.0), ..default() }, 2.0), 1.0);
        assert_eq!(at(WeatherEffect { stamp_speed: Some(0.0), ..fall.clone() }, 2.0), 1.0);
        for carries in [Carries::Dust, Carries::Snow] {
            assert_eq!(at(WeatherEffect { carries, ..own.clone() }, 1.0), 1.0, "{carries:?}");
        }
    }

    #[test]
    fn images_that_are_not_there_make_domes() {
        let mut table = EffectTable::default();
        let diffuse = Some("spots.png".into());
        let stamps = StampSource::Images { diffuse, specular: None, normal: None, variants: 1 };
        table.insert(Handle::default(), WeatherEffect { stamps, ..default() });
        assert_eq!((numbered(&mut table), table.rows()[0].stamps), (0, (0, 0)));
    }
}
