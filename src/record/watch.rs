//! What somebody changes between ticks: found by comparing, taken back, and done again by an event in the next tick.
//!
//! So nothing acts that is not written down, whoever changed it and by what way, and what acts does so in the set and in the
//! order in which a replay will do it.

use bevy::prelude::*;

use super::watched_emitter::WatchedEmitter;
use crate::emitter::Emitter;
use crate::material::{PorousMaterial, StandingWater};
use crate::overlay::Weatherable;
use crate::scenario::{
    Action, EmitterAdjustment, MaterialChange, ScenarioSurface, SceneEntity, WeatherChange,
};
use crate::weather::Weather;
use crate::wetting::put_matter;

/// A surface as events have made it, and what it is to become.
struct WatchedSurface {
    entity: Entity,
    porous: PorousMaterial,
    water: StandingWater,
    transform: GlobalTransform,
    wanted: MaterialChange,
}

/// All that is watched.
pub(super) struct Watched {
    weather: Weather,
    wanted: WeatherChange,
    /// In the order of the scenario.
    surfaces: Vec<WatchedSurface>,
    /// In the order of their streams.
    pub(super) emitters: Vec<WatchedEmitter>,
}

/// What cannot be written down.
#[derive(Default)]
pub(super) struct Complaints {
    /// It has been taken back.
    pub(super) refused: Vec<&'static str>,
    /// It stays, and a replay will differ.
    pub(super) flaws: Vec<&'static str>,
}

/// The new value, where it is another.
pub(super) fn note<T: PartialEq + Copy>(wanted: &mut Option<T>, now: T, was: T) {
    if now != was {
        *wanted = Some(now);
    }
}

impl Watched {
    /// What a scenario has spawned, as it is.
    pub(super) fn new(world: &mut World) -> Self {
        let mut query = world.query::<(
            Entity,
            &ScenarioSurface,
            Option<&PorousMaterial>,
            Option<&StandingWater>,
            &GlobalTransform,
        )>();
        let mut surfaces: Vec<_> = query
            .iter(world)
            .map(|(entity, surface, porous, water, transform)| {
                let watched = WatchedSurface {
                    entity,
                    porous: porous.copied().unwrap_or_default(),
                    water: water.copied().unwrap_or_default(),
                    transform: *transform,
                    wanted: nothing_of(&surface.name),
                };
                (surface.index, watched)
            })
            .collect();
        surfaces.sort_by_key(|(index, _)| *index);
        let mut query = world.query_filtered::<Entity, (With<SceneEntity>, With<Emitter>)>();
        let world: &World = world;
        let mut emitters: Vec<_> =
            query.iter(world).filter_map(|entity| WatchedEmitter::new(world, entity)).collect();
        emitters.sort_by_key(|watched| watched.emitter.stream);
        Self {
            weather: *world.resource::<Weather>(),
            wanted: WeatherChange::default(),
            surfaces: surfaces.into_iter().map(|(_, watched)| watched).collect(),
            emitters,
        }
    }

    /// Takes everything as it is now for what events have made of it.
    pub(super) fn look(&mut self, world: &World) {
        self.weather = *world.resource::<Weather>();
        for watched in &mut self.surfaces {
            let Ok(surface) = world.get_entity(watched.entity) else { continue };
            watched.porous = surface.get().copied().unwrap_or_default();
            watched.water = surface.get().copied().unwrap_or_default();
        }
        for watched in &mut self.emitters {
            let Ok(emitter) = world.get_entity(watched.entity) else { continue };
            if let (Some(now), Some(transform)) = (emitter.get::<Emitter>(), emitter.get::<Transform>()) {
                watched.emitter.clone_from(now);
                watched.transform = *transform;
            }
        }
    }

    /// Takes back what was changed since events last acted. `wants`: it is to happen in the next tick; `tick`: the last one.
    pub(super) fn take_back(
        &mut self,
        world: &mut World,
        wants: bool,
        tick: u32,
        complaints: &mut Complaints,
    ) {
        self.take_back_weather(world, wants, complaints);
        for watched in &mut self.surfaces {
            watched.take_back(world, wants, complaints);
        }
        for watched in &mut self.emitters {
            let is_there = watched.is_there(tick);
            watched.take_back(world, wants && is_there, complaints);
        }
    }

    fn take_back_weather(&mut self, world: &mut World, wants: bool, complaints: &mut Complaints) {
        let (now, was) = (*world.resource::<Weather>(), self.weather);
        if now == was {
            return;
        }
        *world.resource_mut::<Weather>() = was;
        if !wants {
            return;
        }
        let shines = |weather: &Weather| weather.sun_w_per_m2 > 0.0;
        if now.sun_direction != was.sun_direction || shines(&now) != shines(&was) {
            complaints.refused.push("the sun stays where it is, and on or off, while a session is recorded");
        }
        let wanted = &mut self.wanted;
        note(&mut wanted.wind, now.wind, was.wind);
        note(&mut wanted.temperature_c, now.temperature_c, was.temperature_c);
        note(&mut wanted.humidity, now.humidity, was.humidity);
        note(&mut wanted.drying_speed, now.drying_speed, was.drying_speed);
        if shines(&now) == shines(&was) {
            note(&mut wanted.sun_w_per_m2, now.sun_w_per_m2, was.sun_w_per_m2);
        }
    }

    /// What is wrong with the scene: it has what no scenario has.
    pub(super) fn look_for_strangers(&self, world: &mut World, complaints: &mut Complaints) {
        let mut emitters = world.query::<(Entity, &Emitter)>();
        let is_ours = |entity: Entity| self.emitters.iter().any(|watched| watched.entity == entity);
        if emitters.iter(world).any(|(entity, emitter)| emitter.enabled && !is_ours(entity)) {
            complaints.flaws.push("an emitter that is not the scenario's was on");
        }
        let mut surfaces = world.query_filtered::<(), (With<Weatherable>, Without<ScenarioSurface>)>();
        if surfaces.iter(world).next().is_some() {
            complaints.flaws.push("there was a surface that is not the scenario's");
        }
    }

    /// Whether an effect is that of an emitter.
    pub(super) fn uses(&self, effect: AssetId<crate::effect::WeatherEffect>) -> bool {
        self.emitters.iter().any(|watched| watched.emitter.effect.id() == effect)
    }

    /// The weather as events have made it.
    pub(super) fn weather(&self) -> &Weather {
        &self.weather
    }

    /// The weather that is wanted, if it is another.
    pub(super) fn take_weather(&mut self) -> Option<WeatherChange> {
        let wanted = std::mem::take(&mut self.wanted);
        (wanted != WeatherChange::default()).then_some(wanted)
    }

    /// What is to happen in a tick, but for the weather.
    pub(super) fn take_actions(&mut self, tick: u32, hz: u32, actions: &mut Vec<Action>) {
        for watched in &mut self.emitters {
            watched.take_actions(tick, hz, actions);
        }
        for watched in &mut self.surfaces {
            let nothing = nothing_of(&watched.wanted.surface);
            let wanted = std::mem::replace(&mut watched.wanted, nothing);
            if wanted.porous.is_some() || wanted.model.is_some() || wanted.water.is_some() {
                actions.push(Action::Material(wanted));
            }
        }
    }

    /// Nothing is wanted any more, and nothing has moved for long.
    pub(super) fn forget_wishes(&mut self) {
        self.wanted = WeatherChange::default();
        for watched in &mut self.surfaces {
            watched.wanted = nothing_of(&watched.wanted.surface);
        }
        for watched in &mut self.emitters {
            let emitter = std::mem::take(&mut watched.wanted.emitter);
            watched.wanted = EmitterAdjustment { emitter, ..default() };
            (watched.switch, watched.pose, watched.moved) = (None, None, 0);
        }
    }
}

/// A change of a surface that changes nothing.
fn nothing_of(surface: &str) -> MaterialChange {
    MaterialChange { surface: surface.into(), material: None, porous: None, model: None, water: None }
}

impl WatchedSurface {
    fn take_back(&mut self, world: &mut World, wants: bool, complaints: &mut Complaints) {
        let Ok(surface) = world.get_entity(self.entity) else {
            complaints.flaws.push("a surface was taken away");
            return;
        };
        let porous = surface.get::<PorousMaterial>().copied().unwrap_or_default();
        let water = surface.get::<StandingWater>().copied().unwrap_or_default();
        let transform = surface.get::<GlobalTransform>().copied().unwrap_or_default();
        if transform != self.transform {
            self.transform = transform;
            complaints.flaws.push("a surface was moved");
        }
        if porous != self.porous {
            // As if it had never been another.
            put_matter(world, self.entity, self.porous);
            if wants {
                let is_model = PorousMaterial { model: self.porous.model, ..porous } == self.porous;
                if is_model && self.wanted.porous.is_none() {
                    self.wanted.model = Some(porous.model);
                } else {
                    (self.wanted.porous, self.wanted.model) = (Some(porous), None);
                }
            }
        }
        if water != self.water {
            world.entity_mut(self.entity).insert(self.water);
            if wants {
                self.wanted.water = Some(water);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scene of an emitter and a surface, watched.
    fn scene() -> (World, Entity, Entity, Watched) {
        let mut world = World::new();
        world.init_resource::<Weather>();
        let emitter = world
            .spawn((
                SceneEntity,
                Name::new("tap"),
                Emitter { enabled: false, ..default() },
                Transform::IDENTITY,
            ))
            .id();
        let surface = ScenarioSurface { index: 0, name: "floor".into() };
        let materials = (PorousMaterial::default(), StandingWater::default());
        let surface = world.spawn((surface, materials, GlobalTransform::IDENTITY)).id();
        let watched = Watched::new(&mut world);
        (world, emitter, surface, watched)
    }

    /// What is to happen in a tick.
    fn actions(world: &mut World, watched: &mut Watched, tick: u32) -> Vec<Action> {
        let (mut complaints, mut actions) = (Complaints::default(), Vec::new());
        watched.take_back(world, true, tick, &mut complaints);
        watched.take_actions(tick, 60, &mut actions);
        assert!(complaints.flaws.is_empty() && complaints.refused.is_empty());
        actions
    }

    #[test]
    fn changes_are_taken_back_and_become_actions_once() {
        let (mut world, emitter, surface, mut watched) = scene();
        assert!(actions(&mut world, &mut watched, 1).is_empty());
        world.get_mut::<Emitter>(emitter).unwrap().enabled = true;
        world.get_mut::<Emitter>(emitter).unwrap().rate = 3.0;
        *world.get_mut::<Transform>(emitter).unwrap() = Transform::from_xyz(0.0, 1.0, 0.0);
        let porous = PorousMaterial { sorptivity: 0.3, ..default() };
        world.entity_mut(surface).insert(porous);
        let done = actions(&mut world, &mut watched, 2);
        let kinds: Vec<_> = done.iter().map(Action::kind).collect();
        assert_eq!(kinds, ["Adjust", "Move", "Start", "Material"]);
        let Action::Move(step) = &done[1] else { panic!("{done:?}") };
        assert_eq!((step.position, step.over), (Vec3::Y, 0.0));
        assert_eq!(world.get::<PorousMaterial>(surface), Some(&PorousMaterial::default()));
        assert!(!world.get::<Emitter>(emitter).unwrap().enabled);
        assert!(actions(&mut world, &mut watched, 3).is_empty());
        // The weather, by what of it was changed.
        world.resource_mut::<Weather>().humidity = 0.9;
        watched.take_back(&mut world, true, 3, &mut Complaints::default());
        world.resource_mut::<Weather>().wind = Vec3::X;
        watched.take_back(&mut world, true, 3, &mut Complaints::default());
        let expected = WeatherChange { humidity: Some(0.9), wind: Some(Vec3::X), ..default() };
        assert_eq!(watched.take_weather(), Some(expected));
        assert_eq!((watched.take_weather(), *world.resource::<Weather>()), (None, Weather::default()));
    }

    #[test]
    fn moves_are_few_and_models_are_by_themselves() {
        let (mut world, emitter, surface, mut watched) = scene();
        world.get_mut::<Emitter>(emitter).unwrap().enabled = true;
        watched.look(&world);
        let mut moves = 0;
        for tick in 100..160 {
            world.get_mut::<Transform>(emitter).unwrap().translation.x = tick as f32;
            moves += actions(&mut world, &mut watched, tick).len();
        }
        assert_eq!(moves, 15);
        let model = crate::material::WettingModel::Lagarde(default());
        world.entity_mut(surface).insert(PorousMaterial { model, ..default() });
        let done = actions(&mut world, &mut watched, 200);
        assert!(
            matches!(&done[..], [.., Action::Material(change)] if change.model == Some(model)),
            "{done:?}"
        );
    }

    #[test]
    fn what_cannot_be_written_down_is_refused_or_told() {
        let (mut world, _, surface, mut watched) = scene();
        world.resource_mut::<Weather>().sun_w_per_m2 = 500.0;
        let mut complaints = Complaints::default();
        watched.take_back(&mut world, true, 0, &mut complaints);
        assert_eq!(complaints.refused.len(), 1);
        assert_eq!(world.resource::<Weather>().sun_w_per_m2, 0.0);
        assert_eq!(watched.take_weather(), None);
        world.despawn(surface);
        world.spawn(Emitter::default());
        watched.take_back(&mut world, true, 0, &mut complaints);
        watched.look_for_strangers(&mut world, &mut complaints);
        assert_eq!(complaints.flaws.len(), 2);
    }
}
