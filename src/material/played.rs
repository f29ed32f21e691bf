//! Wet maps that are played: wetting and drying without a drop of water.

use bevy::prelude::*;

/// Plays a wet map on a surface, as Hnat et al. do: a grey `g` looks wet from the time `(1 - g)(1 - t_fill)` on and takes
/// `t_fill` for it, 0 never does; the whole lasts `seconds`. Drying runs that backwards. On an entity with
/// [`Weatherable`](crate::overlay::Weatherable), in the uvs of its maps; water that really fell is shown, too.
///
/// Nothing is computed but in the shader, so it is free but for being drawn, and can be scrubbed like any time.
/// Maps are made by [`wetmap`](crate::wetmap).
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[reflect(Component, Default)]
pub struct PlayedWetMap {
    /// Linear; red counts.
    pub map: Handle<Image>,
    /// Seconds from dry to wet or back, above 0.
    pub seconds: f32,
    /// Softness of the wet border, 0..=1 of the whole; 0 is a hard edge. .1 to .5 looks right.
    pub t_fill: f32,
    /// Tick of the [`WeatheringClock`](crate::clock::WeatheringClock) at which it begins.
    pub from_tick: u32,
    /// Which way.
    pub playing: Playing,
}

/// Which way a wet map is played.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Default)]
pub enum Playing {
    /// From dry to wet.
    #[default]
    Wetting,
    /// From wet to dry: what wets first dries last.
    Drying,
}

impl Default for PlayedWetMap {
    fn default() -> Self {
        Self { map: Handle::default(), seconds: 10.0, t_fill: 0.2, from_tick: 0, playing: Playing::Wetting }
    }
}
