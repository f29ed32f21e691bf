//! Surfaces learn their shape, texel by texel, in the background.

use std::sync::Arc;

use bevy::ecs::system::SystemParam;
use bevy::math::Mat3A;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task};

use super::posed::PosedSlopes;
use super::{Dripping, DropQueue, Exposure, Ledger, MeasureTiming, Now, SurfaceWater, TexelGeometry, Units};
use crate::clock::WeatheringClock;
use crate::collision::{DeformingCollider, MeshBvh, SurfaceCollider};
use crate::material::PorousMaterial;
use crate::matter::{FallingSnow, MatterQueue, SurfaceMatter};
use crate::overlay::{MapSize, TexelArea, Weatherable, Wrap};
use crate::weather::DryingClock;

/// The shape of a surface's texels, and which lie beside each other. Comes some frames after its collider.
#[derive(Component, Clone)]
pub struct WetGeometry(pub Arc<TexelGeometry>);

/// How many surfaces are being measured.
#[derive(Resource, Debug, Default)]
pub struct MeasureProgress {
    surfaces: usize,
}

impl MeasureProgress {
    /// Whether any surface is being measured.
    pub fn is_busy(&self) -> bool {
        self.surfaces > 0
    }
}

/// What a geometry was, or is being, measured from.
#[derive(Component)]
pub(crate) struct Measured {
    size: u32,
    wrap: [Wrap; 2],
    bvh: Arc<MeshBvh>,
    /// Turn and scale; where it stands does not matter.
    matrix: Mat3A,
    /// It is another mesh, or another map, than before.
    reshaped: bool,
    task: Option<Task<TexelGeometry>>,
    /// The tick in which `task` was begun.
    asked_at: u32,
}

impl Measured {
    /// Of what was measured elsewhere, and is in use by now: for a map of `size` texels along each side, of a mesh that stood with
    /// this turn and scale.
    pub(crate) fn elsewhere(size: u32, wrap: [Wrap; 2], bvh: Arc<MeshBvh>, matrix: Mat3A) -> Self {
        Self { size, wrap, bvh, matrix, reshaped: false, task: None, asked_at: 0 }
    }

    /// Whether it is being measured since it has got another mesh, or another map: what is known of it is of the one before.
    pub(crate) fn is_of_new_shape(&self) -> bool {
        self.reshaped && self.task.is_some()
    }

    fn is_of(
        &self,
        map: (u32, [Wrap; 2]),
        collider: &SurfaceCollider,
        transform: &GlobalTransform,
        is_posed: bool,
    ) -> bool {
        let matrix = transform.affine().matrix3;
        let scale = self.matrix.determinant().abs().cbrt().max(1e-12);
        let change = |axis: usize| {
            let (before, now) = (self.matrix.col(axis), matrix.col(axis));
            // What is posed has slopes of its own, which follow when it turns.
            if is_posed { (before.length() - now.length()).abs() } else { (before - now).length() }
        };
        // A degree or two of turning changes nothing worth measuring again.
        let turned = (0..3).any(|axis| change(axis) > 0.03 * scale);
        !turned && (self.size, self.wrap) == map && Arc::ptr_eq(&self.bvh, &collider.0)
    }
}

type Measurable = (
    Entity,
    (Ref<'static, Weatherable>, Ref<'static, MapSize>),
    Ref<'static, SurfaceCollider>,
    &'static TexelArea,
    Ref<'static, GlobalTransform>,
    Option<&'static mut Measured>,
    Option<&'static mut SurfaceWater>,
    Past,
    Option<&'static DeformingCollider>,
);

/// By what the water of a surface has dried until now.
type Past = (Option<&'static WetGeometry>, Option<&'static Exposure>, Option<&'static PorousMaterial>);

/// Measures new surfaces, and those that change their shape, map size or how they stand.
pub(super) fn measure_surfaces(
    mut commands: Commands,
    clock: Res<WeatheringClock>,
    drying: Res<DryingClock>,
    timing: Res<MeasureTiming>,
    mut progress: ResMut<MeasureProgress>,
    mut surfaces: Query<Measurable>,
) {
    progress.surfaces = 0;
    for (entity, (surface, map), collider, texel, transform, mut measured, mut water, past, deforming) in
        &mut surfaces
    {
        let is_posed = deforming.is_some_and(|deforming| deforming.posed().is_some());
        let changed =
            surface.is_changed() || map.is_changed() || collider.is_changed() || transform.is_changed();
        let (size, wrap) = (map.texels(), surface.wrap());
        let is_of = |old: &Measured| old.is_of((size, wrap), &collider, &transform, is_posed);
        let stale = match &mut measured {
            None => true,
            Some(old) if old.task.is_none() => changed && !is_of(old),
            // What is being measured is finished first: a surface that keeps turning is measured as fast as that goes.
            Some(old) => {
                let asked_at = old.asked_at;
                let Some(geometry) = timing.take(&mut old.task, asked_at, clock.tick()) else {
                    progress.surfaces += 1;
                    continue;
                };
                if (old.size, old.wrap) == (size, wrap) && Arc::ptr_eq(&old.bvh, &collider.0) {
                    if let (Some(water), (Some(former), exposure, material)) = (&mut water, past)
                        && water.is_wet()
                    {
                        // What has dried until now has dried by the old one.
                        let material = material.copied().unwrap_or_default();
                        let now = Now::new(clock.tick(), clock.hz(), &drying, &former.0, exposure, &material);
                        water.settle_all(&now);
                    }
                    if let Some(water) = &mut water {
                        choose_units(water, geometry.mean_mm2());
                    }
                    let mut entity = commands.entity(entity);
                    entity.insert(WetGeometry(Arc::new(geometry)));
                    if old.reshaped {
                        entity.remove::<Exposure>();
                    }
                    if water.is_none() {
                        let (.., material) = past;
                        let former = FormerMaterial(material.copied().unwrap_or_default());
                        entity.insert((SurfaceWater::of_size(size, wrap, texel.mean_mm2), former));
                    }
                }
                // It may have changed in the meantime.
                !is_of(old)
            }
        };
        if !stale {
            continue;
        }
        if let Some(water) = &mut water
            && (water.size, water.wrap) != (size, wrap)
        {
            // What was on the old maps is gone with them.
            **water = SurfaceWater::of_size(size, wrap, texel.mean_mm2);
            commands.entity(entity).remove::<(WetGeometry, Exposure)>();
        }
        let (affine, bvh) = (transform.affine(), collider.0.clone());
        let triangles = bvh.clone();
        let task = AsyncComputeTaskPool::get()
            .spawn(async move { TexelGeometry::new(triangles.triangles(), &affine, Vec3::Y, size, wrap) });
        let matrix = affine.matrix3;
        let reshaped = measured
            .as_ref()
            .is_none_or(|old| (old.size, old.wrap) != (size, wrap) || !Arc::ptr_eq(&old.bvh, &bvh));
        let (task, asked_at) = (Some(task), clock.tick());
        commands.entity(entity).insert(Measured { size, wrap, bvh, matrix, reshaped, task, asked_at });
        progress.surfaces += 1;
    }
}

/// Gives water units that fit texels of this mean area, mm², if those that it has do not: the surface has been scaled since. Only
/// while nothing has ever come; what lies there is counted in the units it came in.
fn choose_units(water: &mut SurfaceWater, mean_mm2: f32) {
    let units = Units::for_area(mean_mm2);
    let is_fresh = !water.is_wet() && water.ledger == Ledger::default();
    // One step more or less is how the mean was measured.
    if is_fresh && units.shift.abs_diff(water.units.shift) > 1 {
        water.units = units;
    }
}

/// By what the water of a surface has been absorbed and has dried so far. Comes and goes with that water.
#[derive(Component)]
pub(super) struct FormerMaterial(PorousMaterial);

type Remade = (
    &'static mut SurfaceWater,
    &'static WetGeometry,
    Option<&'static Exposure>,
    Option<&'static PorousMaterial>,
    &'static mut FormerMaterial,
);

/// Water of a surface that becomes other matter has been absorbed and dried, until now, as in the former. Compares all of them in
/// every frame: what was made of none, or is made of none any more, is of the default, and no change tells that.
pub(super) fn settle_before_new_material(
    clock: Res<WeatheringClock>,
    drying: Res<DryingClock>,
    mut surfaces: Query<Remade>,
) {
    for (mut water, geometry, exposure, material, mut former) in &mut surfaces {
        let material = material.copied().unwrap_or_default();
        if former.0 == material {
            continue;
        }
        let former = std::mem::replace(&mut former.0, material);
        if water.is_wet() {
            water.settle_all(&Now::new(clock.tick(), clock.hz(), &drying, &geometry.0, exposure, &former));
        }
    }
}

type Exchanged = (
    &'static mut PorousMaterial,
    Option<&'static mut FormerMaterial>,
    Option<(&'static mut SurfaceWater, &'static WetGeometry, Option<&'static Exposure>)>,
);

/// Makes surfaces of other matter within a tick. What is exchanged between ticks is settled in the next frame, and so may
/// depend on how ticks fall into frames; this does not.
#[derive(SystemParam)]
pub(crate) struct ExchangeMatter<'w, 's> {
    clock: Res<'w, WeatheringClock>,
    drying: Res<'w, DryingClock>,
    surfaces: Query<'w, 's, Exchanged>,
}

impl ExchangeMatter<'_, '_> {
    /// The surface is of this matter from the start of the tick that is under way; until then it absorbed and dried as what
    /// it was.
    pub(crate) fn exchange(&mut self, surface: Entity, material: PorousMaterial) {
        let Ok((mut current, former, water)) = self.surfaces.get_mut(surface) else { return };
        if let Some((mut water, geometry, exposure)) = water
            && water.is_wet()
        {
            let before = self.clock.tick().saturating_sub(1);
            let now = Now::new(before, self.clock.hz(), &self.drying, &geometry.0, exposure, &current);
            water.settle_all(&now);
        }
        *current = material;
        if let Some(mut former) = former {
            former.0 = material;
        }
    }
}

/// Makes a surface of other matter without settling its water: it has been this matter all along.
pub(crate) fn put_matter(world: &mut World, surface: Entity, material: PorousMaterial) {
    if let Ok(mut entity) = world.get_entity_mut(surface) {
        entity.insert((material, FormerMaterial(material)));
    }
}

/// Water, and what it needs: both go with the maps.
type OnMaps = (WetGeometry, Measured, PosedSlopes, SurfaceWater, Exposure, FormerMaterial);

/// A surface without maps has no water any more. What is queued for it, and what is falling off it, stays.
pub(super) fn release_maps(removed: On<Remove, MapSize>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<OnMaps>();
}

/// A surface that is not [`Weatherable`] any more is not wet any more.
pub(super) fn release_surface(removed: On<Remove, Weatherable>, mut commands: Commands) {
    commands
        .entity(removed.entity)
        .try_remove::<(OnMaps, DropQueue, Dripping, SurfaceMatter, MatterQueue, FallingSnow)>();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dry_surface_that_was_scaled_counts_in_units_of_its_size_and_a_wet_one_keeps_its_own() {
        let mut water = SurfaceWater::of_size(16, [Wrap::Clamp; 2], 1.0);
        let fine = water.units();
        choose_units(&mut water, 2.5);
        assert_eq!(water.units(), fine);
        choose_units(&mut water, 900.0);
        assert_eq!(water.units(), Units::for_area(900.0));
        water.wake(false);
        choose_units(&mut water, 1.0);
        assert_eq!(water.units(), Units::for_area(900.0));
    }
}
