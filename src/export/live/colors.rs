//! Colour maps on their way back from the GPU.

use std::sync::{Arc, Mutex, PoisonError};

use bevy::prelude::*;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};

use crate::overlay::{Overlays, SplatQueue, SplatStats, is_resizing};
use crate::replay::without_padding;
use crate::save::ColorMaps;

/// Colour maps of surfaces, by their entities.
#[derive(Debug, Clone, Default)]
pub struct SurfaceColors(pub Vec<(Entity, ColorMaps)>);

impl SurfaceColors {
    pub(super) fn of(&self, surface: Entity) -> Option<&ColorMaps> {
        self.0.iter().find(|(entity, _)| *entity == surface).map(|(_, colors)| colors)
    }
}

/// Maps of a surface, those that have come.
type Coming = (Entity, [Option<Vec<u8>>; 3]);

/// Reads the colour maps of all surfaces back. They come some frames later, if the app goes on; time should stand still
/// meanwhile, or colours are older than the water under them. Nothing is read in a world that paints on the CPU.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_weathering::export::{ColorReadback, Snapshot};
/// # fn export(app: &mut App) -> Result<(), Box<dyn std::error::Error>> {
/// let readback = ColorReadback::begin(app.world_mut());
/// while !readback.is_done() {
///     app.update();
/// }
/// let snapshot = Snapshot::take(app.world_mut(), "my scene", &readback.finish())?;
/// snapshot.bake(None)?.write("out".as_ref(), "scene")?;
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct ColorReadback(Arc<Mutex<Vec<Coming>>>);

impl ColorReadback {
    /// Whether all that fell on surfaces has been painted, and none of it is on its way to maps of another size; what is still to be
    /// would be missing, and what is [lost](SplatStats::lost) is. Without a renderer it always has.
    pub fn is_painted(world: &mut World) -> bool {
        let waiting = world.get_resource::<SplatStats>().map(|stats| stats.pending() + stats.moving());
        let Some(waiting) = waiting else { return true };
        let mut queues = world.query::<&SplatQueue>();
        waiting == 0 && queues.iter(world).all(|queue| queue.splats().is_empty()) && !is_resizing(world)
    }

    /// Asks for the maps as the next frames have them.
    pub fn begin(world: &mut World) -> Self {
        let mut query = world.query::<(Entity, &Overlays)>();
        // Of the others there is nothing.
        let painted: Vec<_> = query
            .iter(world)
            .filter(|(_, maps)| maps.has_colors)
            .map(|(entity, maps)| (entity, maps.clone()))
            .collect();
        let empty = painted.iter().map(|(entity, _)| (*entity, [const { None }; 3])).collect();
        let coming: Arc<Mutex<Vec<Coming>>> = Arc::new(Mutex::new(empty));
        for (number, (_, maps)) in painted.into_iter().enumerate() {
            let size = maps.size;
            for (map, image) in [maps.diffuse, maps.specular, maps.normal].into_iter().enumerate() {
                let coming = coming.clone();
                world.spawn(Readback::texture(image)).observe(
                    move |data: On<ReadbackComplete>, mut commands: Commands| {
                        // It would be read again every frame.
                        commands.entity(data.entity).try_despawn();
                        let mut coming = coming.lock().unwrap_or_else(PoisonError::into_inner);
                        if let Some((_, maps)) = coming.get_mut(number) {
                            maps[map].get_or_insert_with(|| without_padding(&data.data, size));
                        }
                    },
                );
            }
        }
        Self(coming)
    }

    /// Whether all have come.
    pub fn is_done(&self) -> bool {
        let coming = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        coming.iter().all(|(_, maps)| maps.iter().all(Option::is_some))
    }

    /// Those that have come; what has not is as if nothing had been painted.
    pub fn finish(&self) -> SurfaceColors {
        let coming = std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner));
        let colors = |[diffuse, specular, normal]: [Option<Vec<u8>>; 3]| ColorMaps {
            diffuse: diffuse.unwrap_or_default(),
            specular: specular.unwrap_or_default(),
            normal: normal.unwrap_or_default(),
        };
        SurfaceColors(coming.into_iter().map(|(entity, maps)| (entity, colors(maps))).collect())
    }
}
