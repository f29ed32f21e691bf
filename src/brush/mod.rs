//! Wetting, drying, dirtying and cleaning by hand.
//!
//! A [`Brush`] is a ball in space: what of a surface lies in it is touched, most in its middle and not at all at its rim
//! (`footprint`). It acts on the amounts of the texels, and everything it brings or takes is booked in the surface's ledgers:
//! accounts hold with brushes as they do without ([`Ledger::painted`], [`Ledger::wiped`], [`MatterLedger::wiped`]).
//!
//! Strokes wait in the [`BrushQueue`] and are painted at the start of a tick, in their order, so that a session that is
//! written down stroke by stroke and tick by tick comes out the same again.
//!
//! Not here: marks in colour, which are painted over the maps and stay; surfaces that are posed have their rest pose.
//!
//! [`Ledger::painted`]: crate::wetting::Ledger::painted
//! [`Ledger::wiped`]: crate::wetting::Ledger::wiped
//! [`MatterLedger::wiped`]: crate::matter::MatterLedger::wiped

mod footprint;
mod paint;

use bevy::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::material::OutOfRange;
use crate::schedule::{WeatheringSystems, WeatheringTick};
use crate::weather::{DryingClock, Weather};

pub use paint::{BrushSurfaces, paint_strokes};

/// What a brush does.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BrushKind {
    /// Brings water: fills the pores as far as they have room, and the rest lies as a film. Strength: its depth in the middle, mm.
    Wet,
    /// Takes water away, from the surface and out of the pores. Strength: the part of it in the middle, 0..=1.
    Dry,
    /// Brings dust, which is bound where it is wet. Strength: its depth in the middle, mm, without the pores between its
    /// grains.
    Dirty,
    /// Takes dust, mud and snow away. Strength: the part of them in the middle, 0..=1.
    Clean,
}

/// A touch of a surface.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
pub struct Brush {
    /// What it does.
    pub kind: BrushKind,
    /// Its middle; world space, metres.
    pub point: Vec3,
    /// Its radius, metres, [`Self::MIN_RADIUS`] to [`Self::MAX_RADIUS`]. It touches texels whose middle lies in it.
    pub radius: f32,
    /// How much it does in its middle; see [`BrushKind`]. 0 or more, to 1 or [`Self::MAX_DEPTH_MM`].
    pub strength: f32,
}

impl Brush {
    /// The smallest radius, metres.
    pub const MIN_RADIUS: f32 = 1.0e-4;
    /// The largest radius, metres.
    pub const MAX_RADIUS: f32 = 1000.0;
    /// The most water or dust, mm.
    pub const MAX_DEPTH_MM: f32 = 100.0;

    /// The first number that is out of its range.
    ///
    /// # Errors
    /// [`OutOfRange`].
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let most = match self.kind {
            BrushKind::Wet | BrushKind::Dirty => Self::MAX_DEPTH_MM,
            BrushKind::Dry | BrushKind::Clean => 1.0,
        };
        let far = 1.0e5;
        let ranges = [
            ("radius", self.radius, Self::MIN_RADIUS, Self::MAX_RADIUS),
            ("strength", self.strength, 0.0, most),
            ("point.x", self.point.x, -far, far),
            ("point.y", self.point.y, -far, far),
            ("point.z", self.point.z, -far, far),
        ];
        // Written so that NaN fails.
        let wrong = ranges.into_iter().find(|(_, value, least, most)| !(value >= least && value <= most));
        wrong.map_or(Ok(()), |(field, value, least, most)| Err(OutOfRange { field, value, least, most }))
    }

    /// How much of its strength acts at a distance from its middle, metres: `(1 - (d/r)²)²`, smooth at the rim, 0 beyond it.
    pub fn part_at(&self, distance: f32) -> f32 {
        let along = distance / self.radius;
        // Written so that NaN is nowhere.
        if along < 1.0 { (1.0 - along * along).powi(2) } else { 0.0 }
    }
}

/// A brush and what it may touch.
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    /// The touch.
    pub brush: Brush,
    /// The only surface that is touched; all within reach if `None`.
    pub surface: Option<Entity>,
}

/// Strokes that wait for the next tick, in their order. Those out of range are left out, with a warning.
#[derive(Resource, Debug, Default)]
pub struct BrushQueue(pub Vec<Stroke>);

/// Paints the strokes of the [`BrushQueue`] on the surfaces of [`WettingPlugin`](crate::wetting::WettingPlugin).
pub struct BrushPlugin;

impl Plugin for BrushPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<Brush>()
            .init_resource::<BrushQueue>()
            .init_resource::<DryingClock>()
            .init_resource::<Weather>()
            .add_systems(WeatheringTick, paint_strokes.in_set(WeatheringSystems::First));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BRUSH: Brush = Brush { kind: BrushKind::Wet, point: Vec3::ZERO, radius: 0.5, strength: 1.0 };

    #[test]
    fn a_brush_is_full_in_the_middle_and_nothing_at_its_rim() {
        assert_eq!([0.0, 0.5, 0.6, f32::NAN].map(|distance| BRUSH.part_at(distance)), [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(BRUSH.part_at(0.25), 0.5625);
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        assert_eq!(BRUSH.validate(), Ok(()));
        for (wrong, field) in [
            (Brush { radius: 0.0, ..BRUSH }, "radius"),
            (Brush { radius: f32::NAN, ..BRUSH }, "radius"),
            (Brush { strength: 101.0, ..BRUSH }, "strength"),
            (Brush { kind: BrushKind::Dry, strength: 1.5, ..BRUSH }, "strength"),
            (Brush { point: Vec3::Y * f32::INFINITY, ..BRUSH }, "point.x"),
        ] {
            let named = wrong.validate().unwrap_err().field;
            // Infinity times 0 is NaN, in x.
            assert_eq!(named, field, "{wrong:?}");
        }
    }
}
