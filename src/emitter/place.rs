//! Emitters that come after transforms were propagated, and emit before they are again.

use bevy::prelude::*;

use super::Emitter;

/// Puts new emitters to where their transforms say. One that was spawned in [`FixedUpdate`] or in
/// [`WeatheringSystems::First`](crate::schedule::WeatheringSystems::First) is at the world's origin until the frame ends, and the tick
/// needs it now.
pub(super) fn place_new(
    transforms: TransformHelper,
    mut new: Query<(Entity, &mut GlobalTransform), Added<Emitter>>,
) {
    for (emitter, mut place) in &mut new {
        // Who has a place has been put there.
        if *place == GlobalTransform::IDENTITY
            && let Ok(global) = transforms.compute_global_transform(emitter)
        {
            place.set_if_neq(global);
        }
    }
}
