//! Exchanging a `StandardMaterial` for its weathered form, and keeping the two in step.

use bevy::core_pipeline::prepass::DeferredPrepass;
use bevy::material::OpaqueRendererMethod;
use bevy::prelude::*;

use super::uniform::SurfaceLook;
use super::warm_up::{Rehearsed, ShaderChanges, Understudy, part_of, rehearse};
use super::{
    ClockBuffer, MatterUniform, PlayedWetMap, PorousExtension, PorousMaterial, StandingWater,
    WeatheredMaterial, WettingTextures,
};
use crate::clock::WeatheringClock;
use crate::collision::UvSet;
use crate::matter::MatterLook;
use crate::overlay::{MapSize, Overlays, SurfaceTraces, TexelArea, Weatherable};

/// The material a weathered entity had, in the place of its `MeshMaterial3d<StandardMaterial>`. Its asset may go on being edited:
/// the weathered form follows. It follows another handle, too, put here or inserted as a `MeshMaterial3d<StandardMaterial>`.
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(Component)]
pub struct DryMaterial(pub Handle<StandardMaterial>);

type Surface = (
    &'static Overlays,
    &'static SurfaceTraces,
    Option<&'static PorousMaterial>,
    Option<&'static StandingWater>,
    Option<&'static WettingTextures>,
    Option<&'static PlayedWetMap>,
    Option<&'static UvSet>,
);

/// What a surface may have, or not.
type Optional = (PorousMaterial, StandingWater, WettingTextures, PlayedWetMap);

/// What changes the constants of a surface.
type Edited = Or<(
    Changed<DryMaterial>,
    Changed<PorousMaterial>,
    Changed<StandingWater>,
    Changed<WettingTextures>,
    Changed<PlayedWetMap>,
    Changed<Overlays>,
    Changed<SurfaceTraces>,
    Changed<UvSet>,
)>;

/// Before its texels are measured nothing can hit a surface, so there is nothing to show on it.
type Hittable = (With<Weatherable>, With<TexelArea>);

fn extension(
    (maps, traces, porous, standing, textures, played, uvs): (
        &Overlays,
        &SurfaceTraces,
        Option<&PorousMaterial>,
        Option<&StandingWater>,
        Option<&WettingTextures>,
        Option<&PlayedWetMap>,
        Option<&UvSet>,
    ),
    buffer: &ClockBuffer,
    clock: &WeatheringClock,
    matter: &MatterLook,
) -> PorousExtension {
    let none = WettingTextures::default();
    let look = SurfaceLook {
        porous: porous.copied().unwrap_or_default(),
        standing: standing.copied(),
        textures: textures.unwrap_or(&none),
        maps,
        played,
        hz: clock.hz(),
        traces: *traces,
        uvs: uvs.copied().unwrap_or_default(),
    };
    let played = played.map(|played| played.map.clone());
    PorousExtension::new(look.key(), look.uniform(), maps, look.textures, played, buffer.0.clone(), matter)
}

/// The dry material as the weathered one needs it.
fn weathered_base(dry: &StandardMaterial, extension: &PorousExtension) -> StandardMaterial {
    let mut base = dry.clone();
    // Deferred lighting knows no pores. Forward surfaces are drawn beside deferred ones.
    base.opaque_render_method = OpaqueRendererMethod::Forward;
    if extension.params.wet_translucency > 0.0 {
        // Above 0 compiles the lighting of the far side in; how much of it is seen is the wetness's to say.
        base.diffuse_transmission = base.diffuse_transmission.max(f32::MIN_POSITIVE);
    }
    base
}

/// What tells whether a surface may be exchanged without being lost from sight.
type Rehearsal = (Option<&'static Rehearsed>, Option<&'static Children>, Has<DryMaterial>);

/// Exchanges the material of surfaces that have their maps; also of entities that a glTF scene spawns later. First the new shader is
/// compiled, unless another form of it is shown already.
pub(super) fn exchange_materials(
    mut commands: Commands,
    buffer: Res<ClockBuffer>,
    clock: Res<WeatheringClock>,
    matter: Res<MatterLook>,
    changes: Res<ShaderChanges>,
    deferred_cameras: Query<(), With<DeferredPrepass>>,
    standard: Res<Assets<StandardMaterial>>,
    mut weathered: ResMut<Assets<WeatheredMaterial>>,
    new: Query<(Entity, Surface, &MeshMaterial3d<StandardMaterial>, Rehearsal), Hittable>,
    understudies: Query<(), With<Understudy>>,
) {
    for (entity, surface, material, (rehearsed, children, is_weathered)) in &new {
        let Some(dry) = standard.get(material) else { continue };
        if dry.opaque_render_method != OpaqueRendererMethod::Forward && !deferred_cameras.is_empty() {
            info_once!("weathered surfaces are drawn forward, before cameras with a deferred prepass, too");
        }
        let extension = extension(surface, &buffer, &clock, &matter);
        let mut next = WeatheredMaterial { base: weathered_base(dry, &extension), extension };
        if let Some(Rehearsed(key)) = rehearsed {
            // What it has come to need meanwhile is rehearsed next.
            next.extension.key = *key;
        } else if *changes == ShaderChanges::WhenCompiled && !is_weathered {
            let is_rehearsing =
                |children: &Children| children.iter().any(|child| understudies.contains(child));
            if !children.is_some_and(is_rehearsing) {
                rehearse(&mut commands, entity, weathered.add(part_of(next)));
            }
            continue;
        }
        commands
            .entity(entity)
            .remove::<(MeshMaterial3d<StandardMaterial>, Rehearsed)>()
            .insert((MeshMaterial3d(weathered.add(next)), DryMaterial(material.0.clone())));
    }
}

/// Gives a surface that has no maps any more, or is not [`Weatherable`] any more, its dry material back: the weathered one
/// would keep its maps.
pub(super) fn release_surface(
    removed: On<Remove, MapSize>,
    mut commands: Commands,
    dry: Query<&DryMaterial>,
) {
    let Ok(material) = dry.get(removed.entity) else { return };
    commands
        .entity(removed.entity)
        // Given back while it still has the other: who watches for new materials can tell that this is none.
        .try_insert(MeshMaterial3d(material.0.clone()))
        .try_remove::<(MeshMaterial3d<WeatheredMaterial>, DryMaterial)>();
}

/// What is taken away is an edit, too.
pub(super) fn note_removed(removed: On<Remove, Optional>, mut surfaces: Query<&mut DryMaterial>) {
    if let Ok(mut dry) = surfaces.get_mut(removed.entity) {
        dry.set_changed();
    }
}

/// Copies edits of a dry material into the weathered ones made from it; of one that was waited for, too.
pub(super) fn follow_dry_materials(
    mut events: MessageReader<AssetEvent<StandardMaterial>>,
    standard: Res<Assets<StandardMaterial>>,
    mut weathered: ResMut<Assets<WeatheredMaterial>>,
    surfaces: Query<(&DryMaterial, &MeshMaterial3d<WeatheredMaterial>)>,
) {
    for event in events.read() {
        let (AssetEvent::Added { id } | AssetEvent::Modified { id }) = event else { continue };
        let Some(dry) = standard.get(*id) else { continue };
        for (_, material) in surfaces.iter().filter(|(material, _)| material.0.id() == *id) {
            if let Some(mut material) = weathered.get_mut(material) {
                material.base = weathered_base(dry, &material.extension);
            }
        }
    }
}

/// Copies what users edit, new maps, and the first water into the weathered material.
pub(super) fn follow_surfaces(
    mut commands: Commands,
    buffer: Res<ClockBuffer>,
    clock: Res<WeatheringClock>,
    matter: Res<MatterLook>,
    changes: Res<ShaderChanges>,
    standard: Res<Assets<StandardMaterial>>,
    mut weathered: ResMut<Assets<WeatheredMaterial>>,
    changed: Query<(Entity, Surface, &DryMaterial, &MeshMaterial3d<WeatheredMaterial>), Edited>,
    understudies: Query<(Entity, &ChildOf, &MeshMaterial3d<WeatheredMaterial>), With<Understudy>>,
) {
    for (entity, surface, dry, handle) in &changed {
        let Some(mut material) = weathered.get_mut(handle) else { continue };
        let extension = extension(surface, &buffer, &clock, &matter);
        if let Some(dry) = standard.get(&dry.0) {
            material.base = weathered_base(dry, &extension);
        }
        let old = material.extension.key;
        let next = WeatheredMaterial { base: material.base.clone(), extension: extension.clone() };
        material.extension = extension;
        if *changes == ShaderChanges::AtOnce {
            continue;
        }
        let waiting = understudies.iter().find(|(_, surface, _)| surface.parent() == entity);
        if next.extension.key == old {
            // What was to come has been taken back.
            if let Some((understudy, ..)) = waiting {
                commands.entity(understudy).despawn();
            }
            continue;
        }
        material.extension.key = old;
        drop(material);
        if let Some((understudy, _, shown)) = waiting {
            if let Some(mut shown) = weathered.get_mut(shown)
                && shown.extension.key == next.extension.key
            {
                // It rehearses on: of a surface whose constants change in every frame, none would ever come to an end.
                *shown = part_of(next);
                continue;
            }
            commands.entity(understudy).despawn();
        }
        let next = weathered.add(part_of(next));
        rehearse(&mut commands, entity, next);
    }
}

/// Copies another look of dust, mud and snow into all weathered materials, those that are rehearsed among them.
pub(super) fn follow_matter_look(
    matter: Res<MatterLook>,
    mut weathered: ResMut<Assets<WeatheredMaterial>>,
    shown: Query<&MeshMaterial3d<WeatheredMaterial>>,
) {
    if !matter.is_changed() {
        return;
    }
    let look = MatterUniform::from(&*matter);
    for handle in &shown {
        if let Some(mut material) = weathered.get_mut(handle)
            && material.extension.look != look
        {
            material.extension.look = look;
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::light::NotShadowCaster;

    use super::*;
    use crate::material::Flood;

    /// A surface on which nothing has fallen yet, and what follows it.
    struct Stage {
        world: World,
        follow: Schedule,
        surface: Entity,
    }

    impl Stage {
        fn new(dry: StandardMaterial) -> Self {
            let mut world = World::new();
            let maps = Overlays::bare(64);
            let (buffer, clock, matter) =
                (ClockBuffer(default()), WeatheringClock::new(60), MatterLook::default());
            let traces = SurfaceTraces::default();
            let extension =
                extension((&maps, &traces, None, None, None, None, None), &buffer, &clock, &matter);
            let mut weathered = Assets::<WeatheredMaterial>::default();
            let material = weathered.add(WeatheredMaterial { base: dry.clone(), extension });
            let mut standard = Assets::<StandardMaterial>::default();
            let dry = DryMaterial(standard.add(dry));
            world.insert_resource(buffer);
            world.insert_resource(clock);
            world.insert_resource(matter);
            world.insert_resource(ShaderChanges::WhenCompiled);
            world.insert_resource(weathered);
            world.insert_resource(standard);
            world.init_resource::<Messages<AssetEvent<StandardMaterial>>>();
            world.add_observer(note_removed);
            let surface =
                world.spawn((maps, traces, dry, MeshMaterial3d(material), Mesh3d(Handle::default()))).id();
            let mut follow = Schedule::default();
            follow.add_systems((follow_dry_materials, follow_surfaces, follow_matter_look).chain());
            follow.run(&mut world);
            Self { world, follow, surface }
        }

        /// Says whether water is on it, and follows.
        fn wet(&mut self, water: bool) {
            self.world.get_mut::<SurfaceTraces>(self.surface).unwrap().water = water;
            self.follow.run(&mut self.world);
        }

        fn understudies(&mut self) -> Vec<Entity> {
            let mut query = self.world.query_filtered::<Entity, With<Understudy>>();
            query.iter(&self.world).collect()
        }

        fn shown_by(&self, entity: Entity) -> &WeatheredMaterial {
            let handle = self.world.get::<MeshMaterial3d<WeatheredMaterial>>(entity).unwrap();
            self.world.resource::<Assets<WeatheredMaterial>>().get(handle).unwrap()
        }
    }

    #[test]
    fn a_change_that_is_taken_back_sends_its_understudy_away() {
        let mut stage = Stage::new(StandardMaterial::default());
        assert!(stage.understudies().is_empty());
        stage.wet(true);
        let &[understudy] = stage.understudies().as_slice() else { panic!("one understudy") };
        assert!(stage.shown_by(understudy).extension.key.water);
        assert!(!stage.shown_by(stage.surface).extension.key.water);
        // It would bring a shader that nobody wants any more.
        stage.wet(false);
        assert!(stage.understudies().is_empty());
    }

    #[test]
    fn constants_that_change_in_every_frame_do_not_keep_an_understudy_from_its_end() {
        let mut stage = Stage::new(StandardMaterial::default());
        stage.wet(true);
        let first = stage.understudies();
        for t_fill in [0.1, 0.2, 0.3] {
            stage.world.entity_mut(stage.surface).insert(PorousMaterial { t_fill, ..default() });
            stage.follow.run(&mut stage.world);
            assert_eq!(stage.understudies(), first);
            assert_eq!(stage.shown_by(first[0]).extension.params.t_fill, t_fill);
            assert_eq!(stage.shown_by(stage.surface).extension.params.t_fill, t_fill);
        }
    }

    /// What is seen of a surface changes with something that it gets, and is as before when that is taken away.
    fn comes_and_goes<C: Component>(component: C) {
        let mut stage = Stage::new(StandardMaterial::default());
        stage.world.insert_resource(ShaderChanges::AtOnce);
        let look = |stage: &Stage| {
            let extension = &stage.shown_by(stage.surface).extension;
            (extension.key, extension.params)
        };
        let bare = look(&stage);
        stage.world.entity_mut(stage.surface).insert(component);
        stage.follow.run(&mut stage.world);
        assert_ne!(look(&stage), bare);
        stage.world.entity_mut(stage.surface).remove::<C>();
        stage.follow.run(&mut stage.world);
        assert_eq!(look(&stage), bare);
    }

    #[test]
    fn what_is_taken_away_is_not_seen_any_more() {
        comes_and_goes(PorousMaterial { t_fill: 7.0, ..default() });
        let flood = Flood::Accumulation { cracks: 0.5, puddles: 0.5 };
        comes_and_goes(StandingWater { flood, ..default() });
        comes_and_goes(WettingTextures { surface: Some(Handle::default()), ..default() });
        comes_and_goes(PlayedWetMap::default());
    }

    #[test]
    fn another_dry_material_is_seen_once_it_is_there() {
        let mut stage = Stage::new(StandardMaterial::default());
        let [red, blue] = [Color::srgb(1.0, 0.0, 0.0), Color::srgb(0.0, 0.0, 1.0)];
        let show = |stage: &mut Stage, material: Handle<StandardMaterial>| {
            stage.world.get_mut::<DryMaterial>(stage.surface).unwrap().0 = material;
            stage.follow.run(&mut stage.world);
            stage.shown_by(stage.surface).base.base_color
        };
        let there = stage.world.resource_mut::<Assets<StandardMaterial>>().add(red);
        assert_eq!(show(&mut stage, there), red);
        let awaited = stage.world.resource::<Assets<StandardMaterial>>().reserve_handle();
        assert_eq!(show(&mut stage, awaited.clone()), red);
        let mut materials = stage.world.resource_mut::<Assets<StandardMaterial>>();
        materials.insert(&awaited, blue.into()).unwrap();
        stage.world.write_message(AssetEvent::Added { id: awaited.id() });
        stage.follow.run(&mut stage.world);
        assert_eq!(stage.shown_by(stage.surface).base.base_color, blue);
    }

    #[test]
    fn all_surfaces_take_another_look_of_dust_at_once() {
        let mut stage = Stage::new(StandardMaterial::default());
        stage.wet(true);
        stage.world.resource_mut::<MatterLook>().dust_color = [1.0, 0.0, 0.0];
        stage.follow.run(&mut stage.world);
        let understudy = stage.understudies()[0];
        for shown in [stage.surface, understudy] {
            assert_eq!(stage.shown_by(shown).extension.look.dust_color, Vec3::X);
        }
    }

    #[test]
    fn an_understudy_has_the_shadow_of_its_surface() {
        let mut stage = Stage::new(StandardMaterial::default());
        stage.wet(true);
        // Else the pipeline of the shadow would come too late, and the shadow be gone for a while.
        let first = stage.understudies()[0];
        assert!(!stage.world.entity(first).contains::<NotShadowCaster>());
        let mut stage = Stage::new(StandardMaterial::default());
        stage.world.entity_mut(stage.surface).insert(NotShadowCaster);
        stage.wet(true);
        let first = stage.understudies()[0];
        assert!(stage.world.entity(first).contains::<NotShadowCaster>());
    }

    #[test]
    fn nothing_is_blended_twice() {
        for (alpha_mode, expected) in
            [(AlphaMode::Blend, 0.0), (AlphaMode::Add, 0.0), (AlphaMode::Opaque, 1.0)]
        {
            let mut stage = Stage::new(StandardMaterial { alpha_mode, ..default() });
            stage.wet(true);
            let understudy = stage.understudies()[0];
            let shown = &stage.shown_by(understudy).base;
            assert_eq!((shown.base_color.alpha(), shown.alpha_mode), (expected, alpha_mode));
            assert_eq!(stage.shown_by(stage.surface).base.base_color.alpha(), 1.0);
        }
    }
}
