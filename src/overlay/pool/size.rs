//! Giving surfaces the size of their maps, and taking maps away when there is no room for all.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::plan::{MapNeed, Wish, fit};
use super::release::Release;
use super::{MapBudget, MapLoss, MapPool, MapSize, SurfaceEvicted, SurfaceOrder, Unmapped};
use crate::collision::{DeformingCollider, NotWeatherable, SurfaceCollider};
use crate::effect::{Carries, EffectTable, WeatherEffect};
use crate::overlay::{StampSpace, SurfaceTotals, TexelArea, Weatherable};
use crate::wetting::DripEffect;

/// What may fall by the effects that there are.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Falling {
    /// Something that leaves marks.
    paint: bool,
    /// Dust, mud or snow.
    solids: bool,
}

impl Falling {
    /// By effects that are in use, and by those that are loaded and may come into use.
    fn new(table: &EffectTable, loaded: Option<&Assets<WeatherEffect>>, drips: Option<&DripEffect>) -> Self {
        // Lumps of snow and muddy drips fall only where snow and soil have come.
        let is_shed = |effect: AssetId<WeatherEffect>| {
            drips.is_some_and(|drips| drips.handles[1..].iter().any(|handle| handle.id() == effect))
        };
        let in_use = table.rows().iter().filter_map(|row| Some((row.handle.id(), row.effect.as_ref()?)));
        let mut falling = Self::default();
        for (id, effect) in in_use.chain(loaded.into_iter().flat_map(|loaded| loaded.iter())) {
            if !is_shed(id) {
                falling.paint |= effect.paints();
                falling.solids |= effect.carries != Carries::Water;
            }
        }
        falling
    }

    /// What a surface may come to hold.
    pub(super) fn need(self, surface: &Weatherable, is_posed: bool) -> MapNeed {
        let frames = self.paint && surface.stamps == StampSpace::Surface && !is_posed;
        MapNeed { colors: true, water: true, matter: self.solids, frames }
    }
}

type Found = (
    (Entity, &'static Weatherable, &'static SurfaceOrder, &'static SurfaceTotals),
    (Option<&'static MapSize>, Has<Unmapped>),
    (Option<&'static SurfaceCollider>, Option<&'static GlobalTransform>, Has<Mesh3d>, Has<DeformingCollider>),
);

/// A surface that has maps.
struct Mapped {
    entity: Entity,
    /// Tick of the last impact, then the order of spawning.
    age: (u32, u64),
    bytes: u64,
}

/// A surface that has none.
#[derive(Clone, Copy)]
struct Waiting {
    entity: Entity,
    wish: Wish,
    /// Its shape is there, or none will come.
    has_shape: bool,
    /// It had to go without before.
    again: bool,
}

/// What is left of the budget, and who can be asked for more.
struct Room {
    /// Bytes; below 0 if more are taken than there are.
    free: i128,
    /// Who was hit longest ago comes first.
    candidates: vec::IntoIter<Mapped>,
}

impl Room {
    fn bytes(&self) -> u64 {
        u64::try_from(self.free).unwrap_or(0)
    }
}

/// All that a decision is made from, and written to.
#[derive(SystemParam)]
pub(super) struct Sizing<'w, 's> {
    commands: Commands<'w, 's>,
    budget: Res<'w, MapBudget>,
    pool: ResMut<'w, MapPool>,
    evicted: MessageWriter<'w, SurfaceEvicted>,
    release: Release<'w, 's>,
    surfaces: Query<'w, 's, Found, Without<NotWeatherable>>,
    names: Query<'w, 's, &'static Name>,
}

/// Surfaces about which nothing has been decided.
type New = (With<Weatherable>, Without<MapSize>, Without<Unmapped>, Without<NotWeatherable>);

/// Decides about surfaces that are new, were edited or go without. Does nothing while there are none.
pub(super) fn size_surfaces(
    effects: Res<EffectTable>,
    loaded: Option<Res<Assets<WeatherEffect>>>,
    drips: Option<Res<DripEffect>>,
    new: Query<(), New>,
    edited: Query<(), (With<MapSize>, Changed<Weatherable>)>,
    mut sizing: Sizing,
) {
    let falling = Falling::new(&effects, loaded.as_deref(), drips.as_deref());
    let MapPool { unmapped, reserved, next_bytes, .. } = *sizing.pool;
    let room_again = unmapped > 0 && reserved.saturating_add(next_bytes) <= sizing.budget.bytes;
    let unchanged = falling == sizing.pool.falling && !sizing.budget.is_changed();
    if unchanged && new.is_empty() && edited.is_empty() && !room_again {
        return;
    }
    sizing.pool.falling = falling;
    let (mut mapped, mut waiting) = sizing.sort_out();
    let taken: i128 = mapped.iter().map(|mapped| i128::from(mapped.bytes)).sum();
    mapped.sort_unstable_by_key(|mapped| mapped.age);
    waiting.sort_unstable_by_key(|waiting| waiting.wish.order);
    let mut room = Room { free: i128::from(sizing.budget.bytes) - taken, candidates: mapped.into_iter() };
    let turned_out = (sizing.pool.evictions, sizing.pool.refusals);
    sizing.make_room(&mut room, 0);
    let (again, new): (Vec<Waiting>, Vec<Waiting>) = waiting.into_iter().partition(|waiting| waiting.again);
    let is_complete = sizing.map_new(&mut room, &new);
    // Who went without is served when everybody else is.
    let next = if is_complete { sizing.map_again(&mut room, &again) } else { None };
    let is_settled = turned_out == (sizing.pool.evictions, sizing.pool.refusals);
    sizing.pool.next_bytes = next.filter(|_| is_settled).unwrap_or(0);
}

impl Sizing<'_, '_> {
    /// Those with maps and those without. Who was edited so that other maps are needed is emptied, and is one of the latter.
    fn sort_out(&mut self) -> (Vec<Mapped>, Vec<Waiting>) {
        let falling = self.pool.falling;
        let (mut mapped, mut waiting) = (Vec::new(), Vec::new());
        for ((entity, surface, order, totals), (size, again), (collider, _, has_mesh, is_posed)) in
            &self.surfaces
        {
            let need = falling.need(surface, is_posed);
            if let Some(size) = size {
                if size.is_for(surface) {
                    let age = (totals.last_tick, order.0);
                    mapped.push(Mapped { entity, age, bytes: need.bytes(size.texels()) });
                    continue;
                }
                let lost = self.release.release(&mut self.commands, entity);
                if lost.is_lost() {
                    info!("{} gets new maps; what was on the old ones is gone", label(&self.names, entity));
                }
            }
            let wish = Wish { order: order.0, limit: surface.texels(), extent: 0.0, need };
            waiting.push(Waiting { entity, wish, has_shape: collider.is_some() || !has_mesh, again });
        }
        (mapped, waiting)
    }

    /// Takes maps away until so many bytes are free. Whether they are.
    fn make_room(&mut self, room: &mut Room, bytes: u64) -> bool {
        while room.free < i128::from(bytes)
            && let Some(Mapped { entity: surface, bytes, .. }) = room.candidates.next()
        {
            let lost = self.release.release(&mut self.commands, surface);
            self.commands.entity(surface).insert(Unmapped::Evicted);
            room.free += i128::from(bytes);
            self.pool.evictions += 1;
            warn!(
                "{} has lost its maps, for which the budget of {} bytes has no room any more, and with them its marks, {:.1} \
                 mm³ of water, {:.1} mm³ of dust and mud, {:.1} mm³ of snow",
                label(&self.names, surface),
                self.budget.bytes,
                MapLoss::mm3(lost.water),
                MapLoss::mm3(lost.soil),
                MapLoss::mm3(lost.snow)
            );
            self.evicted.write(SurfaceEvicted { surface, lost });
        }
        room.free >= i128::from(bytes)
    }

    /// Maps for surfaces that are new, in the order in which they were spawned. Whether nobody waits any more.
    fn map_new(&mut self, room: &mut Room, new: &[Waiting]) -> bool {
        let texel = self.budget.texel;
        let most: i128 = new.iter().map(|new| i128::from(new.wish.need.bytes(new.wish.limit))).sum();
        // Where all get what they wish for, it does not matter who comes first. Else everybody has to be there.
        let plenty = most <= room.free;
        let by_shape = !plenty || texel.is_some();
        let all_there = new.iter().all(|new| new.has_shape);
        if !plenty && !all_there {
            return false;
        }
        let ready: Vec<Waiting> = new.iter().filter(|new| new.has_shape || !by_shape).copied().collect();
        let sides = fit(&self.wishes(&ready, by_shape), texel, room.bytes());
        for (surface, side) in ready.iter().zip(sides) {
            let bytes = surface.wish.need.bytes(side);
            if self.make_room(room, bytes) {
                room.free -= i128::from(bytes);
                self.grant(surface.entity, side);
            } else {
                self.commands.entity(surface.entity).insert(Unmapped::Refused);
                self.pool.refusals += 1;
                error!(
                    "{} stays unweathered: a budget of {} bytes has no room for its maps, {side} x {side} texels",
                    label(&self.names, surface.entity),
                    self.budget.bytes
                );
            }
        }
        ready.len() == new.len()
    }

    /// Maps for those who went without, as far as there is room by itself. How many bytes the next of them needs.
    fn map_again(&mut self, room: &mut Room, again: &[Waiting]) -> Option<u64> {
        let smallest = |surface: &Waiting| surface.wish.need.bytes(surface.wish.smallest());
        let mut needed = 0;
        let fits = |&&surface: &&Waiting| {
            needed += i128::from(smallest(&surface));
            surface.has_shape && needed <= room.free
        };
        let served = again.iter().take_while(fits).count();
        let (served, left) = again.split_at(served);
        let sides = fit(&self.wishes(served, true), self.budget.texel, room.bytes());
        for (surface, side) in served.iter().zip(sides) {
            room.free -= i128::from(surface.wish.need.bytes(side));
            info!("{} has maps again, {side} x {side} texels", label(&self.names, surface.entity));
            self.grant(surface.entity, side);
        }
        left.first().map(smallest)
    }

    fn grant(&mut self, surface: Entity, side: u32) {
        let Ok(((_, settings, ..), ..)) = self.surfaces.get(surface) else { return };
        let size = MapSize::reduced(settings, side);
        self.commands.entity(surface).remove::<Unmapped>().insert(size);
    }

    /// The wishes of surfaces; `by_shape`: with how large they are in the world.
    fn wishes(&self, surfaces: &[Waiting], by_shape: bool) -> Vec<Wish> {
        let wish = |waiting: &Waiting| {
            let mut wish = waiting.wish;
            if by_shape && let Ok((.., (Some(collider), transform, ..))) = self.surfaces.get(waiting.entity) {
                wish.extent = extent(collider, transform);
            }
            wish
        };
        surfaces.iter().map(wish).collect()
    }
}

/// Length of a map's side in the world, metres: of a square of as many texels as the surface's islands leave of it, so that
/// a surface with much waste on its map has texels as wide as others.
fn extent(collider: &SurfaceCollider, transform: Option<&GlobalTransform>) -> f64 {
    let world_from_mesh = transform.copied().unwrap_or_default().affine();
    let side = Weatherable::MAX_MAP_SIZE;
    let area = TexelArea::new(collider.0.triangles(), &world_from_mesh, side);
    f64::from(area.mean_mm2).sqrt() * 1e-3 * f64::from(side)
}

fn label(names: &Query<&Name>, entity: Entity) -> String {
    names.get(entity).map_or_else(|_| entity.to_string(), ToString::to_string)
}
