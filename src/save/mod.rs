//! Keeping a scene: all its maps, and all else that its future depends on, in one folder.
//!
//! [`SavedScene::capture`] takes what a running scenario holds, [`SavedScene::write`] puts it into a folder of its own, and
//! a run that [restores](SavedScene::restore) it goes on to the same digest as one that was never interrupted. It fits the
//! scenario it was saved from: the same `.ron` file, to the byte. Effects, meshes and textures that the file names are not
//! compared.
//!
//! | file | holds |
//! |---|---|
//! | `state.ron` | version, time, weather, emitters, particles in flight, accounts; [materials](SavedScene::with_materials) and [what emitters are](SavedScene::with_emitters), if they were asked for |
//! | `<surface>_film.png`, `_pores.png`, `_since.png` | a texel's words, the lowest byte in red, the highest in alpha |
//! | `<surface>_look.png` | how wet it looked, reserve, how much of its film was seen, nearness to a rim |
//! | `<surface>_efflorescence.png`, `_tide.png` | bits of `f32`, as above; if the material leaves marks |
//! | `<surface>_tiles.png` | flags and patience of its tiles |
//! | `<surface>_diffuse.png`, `_specular.png`, `_normal.png` | colour maps, premultiplied |
//!
//! Not kept: rings of drops, which live for less than a second.

mod effects;
mod emitters;
mod error;
mod leftovers;
mod maps;
mod restore;

use std::path::Path;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::clock::WeatheringClock;
use crate::emitter::{EmissionSeed, Emitter, EmitterState, NewParticles};
use crate::material::{PorousMaterial, StandingWater};
use crate::matter::{MatterLedger, SurfaceMatter, bind_dried};
use crate::overlay::{MapLoss, MapSize, SurfaceTotals, SurfaceTraces, TILE_SIZE, Wrap, resizing_of};
use crate::particle::{ParticleCounts, Particles, SavedParticle, WaterCounts};
use crate::scenario::{Digest, LoadedScenario, ScenarioSurface};
use crate::weather::{DryingClock, DryingPoint, Weather};
use crate::wetting::{Ledger, SurfaceWater};

use emitters::EmitterSettings;
pub use emitters::{AddedEmitter, RemovedEmitter};
pub use error::SaveError;
pub use maps::ColorMaps;

/// The version that is written. Others are refused.
pub const VERSION: u32 = 3;

/// A scene at a moment between two ticks.
#[derive(Debug, Clone)]
pub struct SavedScene {
    pub(super) state: SceneState,
    /// In the order of the scenario.
    pub(super) surfaces: Vec<SavedSurface>,
}

/// What `state.ron` says.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneState {
    pub(super) version: u32,
    /// Hash of the scenario's `.ron` file.
    pub(super) scenario: String,
    pub(super) seed: u64,
    pub(super) tick: u32,
    pub(super) hz: u32,
    /// Of the impacts so far.
    pub(super) digest: [u8; 32],
    pub(super) weather: Weather,
    pub(super) drying: Vec<DryingPoint>,
    pub(super) counts: ParticleCounts,
    pub(super) water: WaterCounts,
    pub(super) next_sequence: u32,
    /// In the order of their streams.
    pub(super) emitters: Vec<EmitterState>,
    /// In flight, in the order of their numbers.
    pub(super) particles: Vec<SavedParticle>,
    /// To be born in the next tick.
    pub(super) waiting: Vec<SavedParticle>,
    pub(super) surfaces: Vec<SurfaceState>,
    /// What emitters are set to, and those that were added; left out where that is for the scenario to say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) settings: Option<EmitterSettings>,
}

/// What `state.ron` says of a surface.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct SurfaceState {
    pub(super) name: String,
    /// Texels along each side; 0 for a surface without maps.
    pub(super) size: u32,
    /// Units to a nanolitre, as a power of two.
    pub(super) shift: u32,
    /// It has been wet: there are maps of its water.
    pub(super) wet: bool,
    /// There are maps of its marks.
    pub(super) marks: bool,
    /// There are maps of its dust, mud and snow.
    pub(super) matter: bool,
    /// And of what floats of its dust.
    #[serde(default)]
    pub(super) stirred: bool,
    pub(super) matter_ledger: MatterLedger,
    pub(super) ledger: Ledger,
    pub(super) rained_at: u32,
    pub(super) totals: SurfaceTotals,
    pub(super) traces: SurfaceTraces,
    /// What was lost with maps.
    #[serde(default)]
    pub(super) loss: MapLoss,
    /// Maps of another size that it is on its way to: texels along each side, and the tick since which it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) resizing: Option<(u32, u32)>,
    /// What it is made of, and water that stands on it; left out where that is for the scenario to say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) materials: Option<(PorousMaterial, StandingWater)>,
}

/// The maps of a surface.
#[derive(Debug, Clone)]
pub(super) struct SavedSurface {
    pub(super) water: SurfaceWater,
    pub(super) matter: SurfaceMatter,
    pub(super) colors: ColorMaps,
}

/// A scenario's emitters, in the order of their streams.
pub(super) fn emitters_in_order(world: &mut World) -> Vec<Entity> {
    let mut emitters = world.query::<(Entity, &Emitter)>();
    let mut order: Vec<_> = emitters.iter(world).map(|(entity, emitter)| (emitter.stream, entity)).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, entity)| entity).collect()
}

/// A scenario's surfaces, in its order.
pub(super) fn surfaces_in_order(world: &mut World) -> Vec<(Entity, String)> {
    let mut surfaces = world.query::<(Entity, &ScenarioSurface)>();
    let mut order: Vec<_> =
        surfaces.iter(world).map(|(entity, surface)| (surface.index, entity, surface.name.clone())).collect();
    order.sort_unstable_by_key(|(index, ..)| *index);
    order.into_iter().map(|(_, entity, name)| (entity, name)).collect()
}

impl SavedScene {
    /// Takes the state of a scenario. `colors`: the colour maps of its surfaces, in its order.
    pub fn capture(world: &mut World, scenario: &LoadedScenario, colors: Vec<ColorMaps>) -> Self {
        let mut particles: Vec<SavedParticle> =
            world.resource::<Particles>().iter().map(SavedParticle::from).collect();
        particles.sort_unstable_by_key(|particle| particle.sequence);
        let emitters = emitters_in_order(world)
            .into_iter()
            .filter_map(|entity| world.get::<EmitterState>(entity).cloned())
            .collect();
        let order = surfaces_in_order(world);
        let (mut states, mut surfaces) = (Vec::new(), Vec::new());
        for ((entity, name), colors) in order.into_iter().zip(colors) {
            let mut wet = world.query::<(&mut SurfaceWater, &mut SurfaceMatter)>();
            if let Ok((mut water, mut matter)) = wet.get_mut(world, entity) {
                // What the next tick would begin with.
                bind_dried(water.bypass_change_detection(), matter.bypass_change_detection());
            }
            let water = world.get::<SurfaceWater>(entity).cloned();
            let water = water.unwrap_or_else(|| SurfaceWater::of_size(TILE_SIZE, [Wrap::Clamp; 2], 1.0));
            let matter = world.get::<SurfaceMatter>(entity).cloned().unwrap_or_default();
            let of = |entity: Entity| world.get::<SurfaceTotals>(entity).copied().unwrap_or_default();
            states.push(SurfaceState {
                name,
                size: world.get::<MapSize>(entity).map_or(0, MapSize::texels),
                shift: water.units().shift,
                wet: water.is_wet(),
                marks: !water.marks().is_empty(),
                matter: !matter.is_empty(),
                stirred: !matter.stirred().is_empty(),
                matter_ledger: matter.ledger(),
                ledger: water.ledger(),
                rained_at: water.rained_at,
                totals: of(entity),
                traces: world.get::<SurfaceTraces>(entity).copied().unwrap_or_default(),
                loss: world.get::<MapLoss>(entity).copied().unwrap_or_default(),
                resizing: resizing_of(world, entity),
                materials: None,
            });
            surfaces.push(SavedSurface { water, matter, colors });
        }
        let clock = *world.resource::<WeatheringClock>();
        let new = world.resource::<NewParticles>();
        let state = SceneState {
            version: VERSION,
            scenario: scenario.hash.clone(),
            seed: world.resource::<EmissionSeed>().0,
            tick: clock.tick(),
            hz: clock.hz(),
            digest: world.resource::<Digest>().0,
            weather: *world.resource::<Weather>(),
            drying: world.resource::<DryingClock>().points().to_vec(),
            counts: *world.resource::<ParticleCounts>(),
            water: world.resource::<WaterCounts>().clone(),
            next_sequence: new.next_sequence(),
            emitters,
            particles,
            waiting: new.waiting().iter().copied().map(SavedParticle::from).collect(),
            surfaces: states,
            settings: None,
        };
        Self { state, surfaces }
    }

    /// Keeps what surfaces are made of, too, as it is now. A scenario says that itself, and when it changes; this is for apps in
    /// which somebody may have changed it.
    #[must_use]
    pub fn with_materials(mut self, world: &mut World) -> Self {
        let order = surfaces_in_order(world);
        for (state, (entity, _)) in self.state.surfaces.iter_mut().zip(order) {
            let porous = world.get::<PorousMaterial>(entity).copied().unwrap_or_default();
            let water = world.get::<StandingWater>(entity).copied().unwrap_or_default();
            state.materials = Some((porous, water));
        }
        self
    }

    /// Keeps what emitters are set to, too, as it is now: where somebody has put them, whether they are in
    /// [somebody's hand](crate::scenario::ByHand), [removed](RemovedEmitter) or [added](AddedEmitter), and effects that are none of the
    /// scenario's or are not as in its files. A scenario says that itself, and when it changes; this is for apps in which somebody may have changed it. Right
    /// after [`Self::capture`].
    ///
    /// # Errors
    /// [`SaveError`] for an effect that is none of the scenario's and is not loaded, or names pictures.
    pub fn with_emitters(mut self, world: &mut World) -> Result<Self, SaveError> {
        emitters::take(world, &mut self.state)?;
        Ok(self)
    }

    /// Whether it says what emitters are set to, and has those that were added.
    pub fn has_emitters(&self) -> bool {
        self.state.settings.is_some()
    }

    /// Keeps what another scene has kept, which this world has gone on from.
    ///
    /// # Errors
    /// As [`Self::with_emitters`].
    pub(crate) fn with_all_of(self, world: &mut World, other: &Self) -> Result<Self, SaveError> {
        let has_materials = other.state.surfaces.iter().any(|surface| surface.materials.is_some());
        let scene = if has_materials { self.with_materials(world) } else { self };
        if other.has_emitters() { scene.with_emitters(world) } else { Ok(scene) }
    }

    /// That a scene can be saved into this folder: better before a long run than after it. Makes the folder that it lies
    /// in.
    ///
    /// # Errors
    /// [`SaveError::Write`] if it holds anything but a saved scene, is the folder that the program runs in or a mount point,
    /// or cannot be written.
    pub fn check_folder(folder: &Path) -> Result<(), SaveError> {
        maps::check(folder).map(drop)
    }

    /// Writes the folder, in place of one that was saved there before. Everything is written beside it first, then that
    /// one is moved aside, and back again if the new one cannot take its place. There is never half a scene in the folder;
    /// between two renames there is none. If the program is killed just then, whoever reads or writes the folder next moves the
    /// new one there.
    ///
    /// # Errors
    /// [`SaveError`] with the file; as [`Self::check_folder`], too.
    pub fn write(&self, folder: &Path) -> Result<(), SaveError> {
        maps::write(self, folder)
    }

    /// Reads a folder.
    ///
    /// # Errors
    /// [`SaveError`] with file and field, also for maps that do not fit the state.
    pub fn read(folder: &Path) -> Result<Self, SaveError> {
        maps::read(folder)
    }

    /// Fits a scenario of so many emitters: those more have sent nothing yet.
    pub(crate) fn resize_emitters(&mut self, count: usize) {
        self.state.emitters.resize(count, EmitterState::default());
    }

    /// Ticks that had run.
    pub fn tick(&self) -> u32 {
        self.state.tick
    }

    /// Bytes that it takes in memory, about.
    pub fn bytes(&self) -> usize {
        let of = |ColorMaps { diffuse, specular, normal }: &ColorMaps| {
            diffuse.len() + specular.len() + normal.len()
        };
        let surfaces = self.surfaces.iter();
        let maps: usize = surfaces
            .map(|surface| surface.water.bytes() + surface.matter.bytes() + of(&surface.colors))
            .sum();
        let particles = self.state.particles.len() + self.state.waiting.len();
        maps + particles * size_of::<SavedParticle>()
    }
}
