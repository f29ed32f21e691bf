//! Dust, mud and snow on surfaces, and what water, slopes and warmth do to them.
//!
//! Each texel holds three amounts beside its water ([`TexelMatter`]), in the same whole units. Impacts leave [`Deposit`]s,
//! shared out by the coverage of their stamps (`settle`). From then on:
//!
//! - water takes soil along: drops lift and loosen it, films carry what is loose, drips take it off the surface, and a film that
//!   dries up leaves a crust ([`wash`]); a jet sweeps it aside ([`jet`]);
//! - snow lies where it is cold ([`snow`]), slides where it is steep, and piles up below ([`slide`]);
//! - what melts is water on the same texel, to the unit.
//!
//! Only tiles that have something to do take steps: those where snow may slide and, in a thaw, those where it lies. Dust and
//! mud at rest cost nothing, in any weather. What came is on the surface or in the [`MatterLedger`], exactly.
//!
//! In the tick, where the water is; what is drawn goes with the water's tiles ([`look`]).
//!
//! Not here: wind that lifts dust or drifts snow; ice; layers, so that snow is drawn over soil, whichever came first.

mod advance;
pub mod jet;
pub mod look;
mod resize;
mod settle;
mod shares;
pub mod slide;
pub mod snow;
mod surface;
#[cfg(test)]
pub(crate) mod test_world;
mod texel;
pub mod wash;

use bevy::prelude::*;

pub(crate) use look::pack_matter;
pub use look::{GpuTexelMatter, MatterLook};
pub use settle::{Deposit, DepositStamp};
pub use slide::SnowFall;
pub use surface::{MatterLedger, MatterStock, SurfaceMatter};
pub use texel::{MatterKind, TexelMatter};

pub(crate) use advance::{MatterScratch, advance_matter, is_at_rest};
pub(crate) use settle::{deposit, put, wake};
pub(crate) use surface::MatterTiles;
pub(crate) use wash::bind_dried;

/// Matter that waits to be put on one surface, in the order of its impacts.
#[derive(Component, Debug, Default)]
pub struct MatterQueue(pub Vec<Deposit>);

/// Snow that fell off one surface in this tick.
#[derive(Component, Debug, Default)]
pub struct FallingSnow(pub Vec<SnowFall>);

/// Lets dust, mud and snow look as you say ([`MatterLook`]). What gives surfaces room for them, and moves them, is part of the
/// tick of [`WettingPlugin`](crate::wetting::WettingPlugin).
pub struct MatterPlugin;

impl Plugin for MatterPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<MatterLook>().init_resource::<MatterLook>();
    }
}
