//! The scene at the end of a run, for other engines.

use bevy::prelude::*;

use super::{ReplayError, Run, SurfaceMaps};
use crate::export::{Export, ExportError, Snapshot, SurfaceColors};
use crate::save::ColorMaps;
use crate::scenario::ScenarioSurface;

impl From<ExportError> for ReplayError {
    fn from(error: ExportError) -> Self {
        Self::Export(Box::new(error))
    }
}

impl Run<'_> {
    /// The scene as it is now, if it is asked for. `maps`: those of now, in the order of the scenario.
    pub(super) fn export(&mut self, maps: &[SurfaceMaps]) -> Result<Option<Export>, ReplayError> {
        if self.options.export.is_none() {
            return Ok(None);
        }
        let name = self.options.scenario.file.file_name().unwrap_or_default().to_string_lossy();
        let world = self.app.world_mut();
        let mut colors = SurfaceColors::default();
        // Without a renderer they are found where they were painted.
        if self.options.render {
            let mut surfaces = world.query::<(Entity, &ScenarioSurface)>();
            colors.0.extend(surfaces.iter(world).filter_map(|(entity, surface)| {
                let maps = maps.get(surface.index as usize)?;
                let (diffuse, specular) = (maps.diffuse.clone(), maps.specular.clone());
                Some((entity, ColorMaps { diffuse, specular, normal: maps.normal.clone() }))
            }));
        }
        Ok(Some(Snapshot::take(world, &name, &colors)?.bake(None)?))
    }
}
