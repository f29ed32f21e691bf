//! Maps of another size for a surface, with all that is on them.
//!
//! The new texels are measured in the background first, while everything goes on on the old ones. When that is done, or at the
//! tick at which it counts ([`MeasureTiming`](crate::wetting::MeasureTiming)), all of it moves over between two ticks: water and
//! matter to the unit, colour maps, exposure, and what has fallen and waits. On the GPU the painter does the same with what it
//! has painted, and the tiles of the water are sent anew. Rings of drops that just fell are left behind.

use std::sync::Arc;

use bevy::ecs::system::SystemParam;
use bevy::math::Mat3A;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task};

use super::{MapPool, MapSize, SurfaceResized, label};
use crate::clock::WeatheringClock;
use crate::collision::{MeshBvh, SurfaceCollider};
use crate::material::PorousMaterial;
use crate::matter::{MatterQueue, SurfaceMatter, bind_dried};
use crate::overlay::frames::Frames;
use crate::overlay::resample::is_reached;
use crate::overlay::splat::{resized_length, resized_stamp};
use crate::overlay::{CpuMaps, Lying, Overlays, SplatQueue, SurfaceFrames, TILE_SIZE, Weatherable, Wrap};
use crate::weather::DryingClock;
use crate::wetting::{
    DropQueue, Exposure, MeasureTimer, MeasureTiming, Measured, Now, Shares, SurfaceWater, TexelGeometry,
    WetGeometry,
};

/// A surface's way to maps of another size.
#[derive(Component)]
pub(super) struct Resizing {
    /// Texels along each side that it will have.
    pub(super) to: u32,
    wrap: [Wrap; 2],
    bvh: Arc<MeshBvh>,
    matrix: Mat3A,
    /// The tick in which `task` was begun.
    asked_at: u32,
    task: Option<Task<(TexelGeometry, Option<Frames>)>>,
}

impl Resizing {
    /// Begins to measure. `in_space`: whether stamps on it lie in the space of its mesh.
    pub(super) fn begin(
        to: u32,
        wrap: [Wrap; 2],
        collider: &SurfaceCollider,
        transform: &GlobalTransform,
        in_space: bool,
        tick: u32,
    ) -> Self {
        let (affine, bvh) = (transform.affine(), collider.0.clone());
        let of = bvh.clone();
        let task = AsyncComputeTaskPool::get().spawn(async move {
            let geometry = TexelGeometry::new(of.triangles(), &affine, Vec3::Y, to, wrap);
            let frames = in_space.then(|| Frames::new(of.triangles(), &geometry, wrap));
            (geometry, frames)
        });
        Self { to, wrap, bvh, matrix: affine.matrix3, asked_at: tick, task: Some(task) }
    }
}

/// Brings what waits for a surface to its new maps.
pub(super) fn resize_queues(
    from: u32,
    to: u32,
    splats: &mut SplatQueue,
    drops: Option<&mut DropQueue>,
    deposits: Option<&mut MatterQueue>,
) {
    splats.resize(from, to);
    for drop in drops.into_iter().flat_map(|drops| &mut drops.0) {
        (drop.center, drop.radius) = resized_stamp(drop.center, drop.radius, from, to);
        drop.jet = drop.jet.map(|jet| jet.map(|length| resized_length(length, from, to)));
    }
    for deposit in deposits.into_iter().flat_map(|deposits| &mut deposits.0) {
        if let Some(stamp) = &mut deposit.stamp {
            (_, stamp.radius) = resized_stamp(deposit.center, stamp.radius, from, to);
        }
        (deposit.center, deposit.radius) = resized_stamp(deposit.center, deposit.radius, from, to);
    }
}

type Resized = (
    (
        Entity,
        &'static Weatherable,
        &'static mut MapSize,
        &'static mut Resizing,
        Option<&'static SurfaceCollider>,
    ),
    (&'static mut SplatQueue, Option<&'static mut DropQueue>, Option<&'static mut MatterQueue>),
    (
        Option<(&'static mut SurfaceWater, &'static mut SurfaceMatter)>,
        Option<&'static mut WetGeometry>,
        Option<&'static mut Exposure>,
        Option<&'static mut Measured>,
        Option<&'static PorousMaterial>,
    ),
    (Option<&'static mut SurfaceFrames>, Option<&'static mut CpuMaps>),
);

/// The time, if there is one.
#[derive(SystemParam)]
pub(super) struct Times<'w> {
    clock: Option<Res<'w, WeatheringClock>>,
    drying: Option<Res<'w, DryingClock>>,
}

/// Moves surfaces whose new texels are measured over to them.
pub(super) fn finish_resizes(
    mut commands: Commands,
    timer: MeasureTimer,
    times: Times,
    mut pool: ResMut<MapPool>,
    mut resized: MessageWriter<SurfaceResized>,
    mut surfaces: Query<Resized>,
    names: Query<&Name>,
) {
    for (
        (entity, surface, mut size, mut resizing, collider),
        (mut splats, mut drops, mut deposits),
        (mut contents, geometry, exposure, measured, material),
        (frames, maps),
    ) in &mut surfaces
    {
        let asked_at = resizing.asked_at;
        let Some((new, new_frames)) = timer.take(&mut resizing.task, asked_at) else { continue };
        commands.entity(entity).try_remove::<Resizing>();
        let (from, to) = (size.texels, resizing.to);
        let is_the_same = collider.is_some_and(|collider| Arc::ptr_eq(&resizing.bvh, &collider.0))
            && resizing.wrap == surface.wrap();
        let Some(mut geometry) = geometry.filter(|geometry| is_the_same && geometry.0.size() == from) else {
            // It has got another shape meanwhile, or is about to; whether its maps change is decided again.
            continue;
        };
        if let Some((water, matter)) = &mut contents
            && water.size() == from
        {
            let default = PorousMaterial::default();
            if let (Some(clock), Some(drying)) = (&times.clock, &times.drying)
                && water.is_wet()
            {
                let material = material.unwrap_or(&default);
                let now =
                    Now::new(clock.tick(), clock.hz(), drying, &geometry.0, exposure.as_deref(), material);
                water.settle_all(&now);
            }
            bind_dried(water, matter);
            **matter = matter.resized(&Shares::new(from, &new));
            **water = water.resized(&geometry.0, &new);
        }
        if measured.as_ref().is_some_and(|measured| measured.is_of_new_shape()) {
            // It is that of the shape before.
            commands.entity(entity).try_remove::<Exposure>();
        } else if let Some(mut exposure) = exposure {
            *exposure = exposure.resized(from, to);
        }
        let lying = maps.as_ref().and(frames.as_deref()).map(Lying::new);
        if let Some(mut maps) = maps.filter(|maps| maps.size == from) {
            *maps = maps.resized(to, lying.as_ref());
        }
        match (frames, new_frames) {
            (Some(mut frames), Some(new_frames)) => *frames = SurfaceFrames::of(new_frames, &new),
            // Measured for the old maps meanwhile.
            (Some(_), None) => {
                commands.entity(entity).try_remove::<SurfaceFrames>();
            }
            (None, _) => {}
        }
        geometry.0 = Arc::new(new);
        if let Some(mut measured) = measured {
            *measured = Measured::elsewhere(to, resizing.wrap, resizing.bvh.clone(), resizing.matrix);
        }
        resize_queues(from, to, &mut splats, drops.as_deref_mut(), deposits.as_deref_mut());
        size.texels = to;
        pool.count_resize(from, to);
        tell(&mut size, from, || label(&names, entity));
        resized.write(SurfaceResized { surface: entity, from, to });
    }
}

/// Says so once for each surface that gives way.
pub(super) fn tell(size: &mut MapSize, from: u32, name: impl FnOnce() -> String) {
    let to = size.texels;
    if to < from && !size.told {
        size.told = true;
        info!(
            "{} was hit longest ago and makes room for others in the map budget: its maps of {from} x {from} texels are {to} x {to} \
             by now, with all that is on them. This is told once for each surface; `MapPool` counts on.",
            name()
        );
    }
}

/// A surface that is not resized any more: it has no maps, or is none.
pub(super) fn release_resizing(removed: On<Remove, MapSize>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<Resizing>();
}

/// Whether any surface is on its way to maps of another size, and may get there while time stands still.
pub(crate) fn is_resizing(world: &mut World) -> bool {
    // Else it gets there at its tick.
    let timing = world.get_resource::<MeasureTiming>().copied().unwrap_or_default();
    timing == MeasureTiming::WhenReady && world.query::<&Resizing>().iter(world).next().is_some()
}

/// To how many texels along each side a surface is on its way, and since which tick.
pub(crate) fn resizing_of(world: &World, surface: Entity) -> Option<(u32, u32)> {
    world.get::<Resizing>(surface).map(|resizing| (resizing.to, resizing.asked_at))
}

/// Whether a surface may be on its way from maps of one size to those of another. `from`, `to`: texels along each side.
pub(crate) fn can_resume_resizing(world: &World, surface: Entity, from: u32, to: u32) -> bool {
    let limit = world.get::<MapSize>(surface).map_or(0, |size| size.limit);
    let is_step = to != from && to <= 2 * from && is_reached(from, to);
    is_step && to.is_multiple_of(TILE_SIZE) && to <= limit
}

/// Sends a surface on its way to maps of another size, as if it had been since a tick: for a scene that is put back as it was.
pub(crate) fn resume_resizing(world: &mut World, surface: Entity, to: u32, since: u32) {
    let Ok(mut entity) = world.get_entity_mut(surface) else { return };
    let (Some(settings), Some(collider), Some(transform)) =
        (entity.get::<Weatherable>(), entity.get::<SurfaceCollider>(), entity.get::<GlobalTransform>())
    else {
        return;
    };
    let in_space = entity.contains::<SurfaceFrames>();
    let resizing = Resizing::begin(to, settings.wrap(), collider, transform, in_space, since);
    entity.insert(resizing);
}

/// Whether [`put_size`] can give a surface maps with so many texels along each side.
pub(crate) fn can_put_size(world: &World, surface: Entity, to: u32) -> bool {
    let (Some(size), Some(geometry)) = (world.get::<MapSize>(surface), world.get::<WetGeometry>(surface))
    else {
        return false;
    };
    let is_painted = world
        .get::<Overlays>(surface)
        .is_some_and(|maps| maps.has_colors || maps.has_rings || maps.has_room || maps.has_matter_room);
    let is_allowed = to.is_multiple_of(TILE_SIZE) && to <= size.limit && is_reached(size.texels, to);
    geometry.0.size() == size.texels && is_allowed && !is_painted
}

/// Gives a clean surface, whatever was to become of its maps, those of another size, at once: for a scene that is put back as it was.
/// Waits until its texels are measured. What is on it is gone. Nothing happens where [`can_put_size`] says no.
pub(crate) fn put_size(world: &mut World, surface: Entity, to: u32) {
    if !can_put_size(world, surface, to) {
        return;
    }
    let Ok(mut entity) = world.get_entity_mut(surface) else { return };
    entity.remove::<Resizing>();
    let Some(from) = entity.get::<MapSize>().map(MapSize::texels).filter(|&from| from != to) else { return };
    let (Some(collider), Some(transform)) =
        (entity.get::<SurfaceCollider>(), entity.get::<GlobalTransform>())
    else {
        return;
    };
    let (bvh, affine) = (collider.0.clone(), transform.affine());
    let Some(wrap) = entity.get::<Weatherable>().map(Weatherable::wrap) else { return };
    let in_space = entity.contains::<SurfaceFrames>();
    let geometry = TexelGeometry::new(bvh.triangles(), &affine, Vec3::Y, to, wrap);
    if in_space {
        let frames = Frames::new(bvh.triangles(), &geometry, wrap);
        entity.insert(SurfaceFrames::of(frames, &geometry));
    }
    if let Some(mut exposure) = entity.get_mut::<Exposure>() {
        *exposure = exposure.resized(from, to);
    }
    if let Some(mut water) = entity.get_mut::<SurfaceWater>() {
        *water = SurfaceWater::of_size(to, wrap, geometry.mean_mm2());
    }
    if let Some(mut matter) = entity.get_mut::<SurfaceMatter>() {
        matter.reset();
    }
    if let Some(mut maps) = entity.get_mut::<CpuMaps>() {
        *maps = CpuMaps::of_size(to, wrap);
    }
    if let Some(mut maps) = entity.get_mut::<Overlays>() {
        maps.size = to;
    }
    if let Some(mut size) = entity.get_mut::<MapSize>() {
        size.texels = to;
    }
    entity.insert((WetGeometry(Arc::new(geometry)), Measured::elsewhere(to, wrap, bvh, affine.matrix3)));
}

/// Gives a clean surface the maps back that it was given first, as [`put_size`] does. Its exposure is looked for anew: what it had has
/// become coarser on the way.
pub(crate) fn put_first_size(world: &mut World, surface: Entity) {
    let Ok(mut entity) = world.get_entity_mut(surface) else { return };
    entity.remove::<Resizing>();
    let Some(&size) = entity.get::<MapSize>() else { return };
    if size.texels != size.granted {
        put_size(world, surface, size.granted);
        world.entity_mut(surface).remove::<Exposure>();
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use bevy::math::Affine3A;

    use super::*;
    use crate::collision::MeshTriangles;
    use crate::matter::test_world::bump;
    use crate::matter::{Deposit, DepositStamp, MatterKind};

    #[test]
    fn matter_that_waits_is_as_large_and_at_the_same_place_on_other_maps_and_its_stamp_too() {
        let stamp = DepositStamp { number: 3, radius: [1024, 768], rows: [[1024, 0], [0, 1024]] };
        let deposit = Deposit { stamp: Some(stamp), ..bump(MatterKind::Dust, 7, [2048, 4096], [512; 2]) };
        let mut deposits = MatterQueue(vec![deposit]);
        resize_queues(64, 32, &mut SplatQueue::default(), None, Some(&mut deposits));
        let stamp = Some(DepositStamp { radius: [512, 384], ..stamp });
        assert_eq!(deposits.0, [Deposit { center: [1024, 2048], radius: [256; 2], stamp, ..deposit }]);
    }

    fn bvh() -> Arc<MeshBvh> {
        let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
        Arc::new(MeshBvh::build(MeshTriangles::from_mesh(&mesh).unwrap()))
    }

    /// A dry surface on its way from 64 to 32 texels along each side.
    fn resizing() -> (World, Entity) {
        AsyncComputeTaskPool::get_or_init(Default::default);
        let mut world = World::new();
        world.init_resource::<MapPool>();
        world.init_resource::<Messages<SurfaceResized>>();
        let settings = Weatherable { map_size: 64, ..default() };
        let (wrap, bvh) = (settings.wrap(), bvh());
        let geometry = TexelGeometry::new(bvh.triangles(), &Affine3A::IDENTITY, Vec3::Y, 64, wrap);
        let collider = SurfaceCollider(bvh);
        let resizing = Resizing::begin(32, wrap, &collider, &GlobalTransform::IDENTITY, false, 0);
        let maps = (settings, MapSize::whole(&settings), SplatQueue::default(), GlobalTransform::IDENTITY);
        let surface = world.spawn((maps, WetGeometry(Arc::new(geometry)), collider, resizing)).id();
        (world, surface)
    }

    /// Runs until it is resized no more. Texels along each side then, as they were granted and as they were measured, and how often
    /// maps became smaller.
    fn finished(world: &mut World, surface: Entity) -> (u32, u32, u64) {
        let mut schedule = Schedule::default();
        schedule.add_systems(finish_resizes);
        let begun = Instant::now();
        while world.get::<Resizing>(surface).is_some() {
            assert!(begun.elapsed() < Duration::from_secs(30), "never done");
            schedule.run(world);
            std::thread::sleep(Duration::from_millis(1));
        }
        let measured = world.get::<WetGeometry>(surface).unwrap().0.size();
        (world.get::<MapSize>(surface).unwrap().texels(), measured, world.resource::<MapPool>().shrinks)
    }

    #[test]
    fn a_surface_that_gets_another_mesh_meanwhile_keeps_its_maps_and_none_waits_for_it() {
        let (mut world, surface) = resizing();
        assert_eq!(finished(&mut world, surface), (32, 32, 1));
        let (mut world, surface) = resizing();
        world.entity_mut(surface).insert(SurfaceCollider(bvh()));
        assert_eq!(finished(&mut world, surface), (64, 64, 0));
        // It is not loaded yet, and may never be.
        let (mut world, surface) = resizing();
        world.entity_mut(surface).remove::<SurfaceCollider>();
        assert_eq!(finished(&mut world, surface), (64, 64, 0));
    }

    #[test]
    fn what_was_under_way_can_be_taken_up_again_if_it_leads_to_maps_that_there_may_be() {
        let (mut world, surface) = resizing();
        assert_eq!(resizing_of(&world, surface), Some((32, 0)));
        world.entity_mut(surface).remove::<Resizing>();
        assert_eq!(resizing_of(&world, surface), None);
        let can = |from, to| can_resume_resizing(&world, surface, from, to);
        assert!([(64, 32), (64, 16), (32, 64)].into_iter().all(|(from, to)| can(from, to)));
        let others = [(64, 0), (0, 32), (64, 64), (64, 48), (32, 8), (16, 64), (64, 128)];
        assert!(others.into_iter().all(|(from, to)| !can(from, to)));
        resume_resizing(&mut world, surface, 32, 0);
        assert_eq!(finished(&mut world, surface), (32, 32, 1));
    }
}
