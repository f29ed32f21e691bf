//! The scene at the end of a run, or on the way, for other engines.

use bevy::prelude::*;

use super::{ReplayError, ReplayOptions, Run, SurfaceMaps};
use crate::export::{Export, ExportError, Snapshot, SurfaceColors};
use crate::save::ColorMaps;
use crate::scenario::{ScenarioSurface, exports};

impl From<ExportError> for ReplayError {
    fn from(error: ExportError) -> Self {
        Self::Export(Box::new(error))
    }
}

impl ReplayOptions {
    /// Whether the scene is exported, at the end or on the way.
    pub(super) fn exports(&self) -> bool {
        self.export.is_some() || (self.out.is_some() && !exports(&self.scenario.scenario).is_empty())
    }

    /// How an exported scene begins its name.
    pub(super) fn stem(&self) -> String {
        self.scenario.file.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }
}

impl Run<'_> {
    /// Exports the scene as it is now into a folder in that of the run. That it fails is no reason to lose the rest: it is told at
    /// the end.
    pub(super) fn export_into(&mut self, folder: &str) -> Result<(), ReplayError> {
        let options = self.options;
        let Some(out) = &options.out else { return Ok(()) };
        let maps = self.read_maps()?;
        let written =
            self.export(&maps).and_then(|export| Ok(export.write(&out.join(folder), &options.stem())?));
        if let Err(error) = written {
            self.failed_export.get_or_insert(error);
        }
        Ok(())
    }

    /// The scene as it is now. `maps`: those of now, in the order of the scenario.
    pub(super) fn export(&mut self, maps: &[SurfaceMaps]) -> Result<Export, ReplayError> {
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
        Ok(Snapshot::take(world, &name, &colors)?.bake(None)?)
    }
}
