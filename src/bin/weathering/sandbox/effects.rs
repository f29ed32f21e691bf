//! What the hose in the hand and the rain over the scene send out: the effects that come with the project, whatever scenario
//! is open; and a panel to edit all that are in use.

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::effect::{
    Carries, DropSizes, EffectTable, ShippedEffect, Sprite, StampSource, StampTurn, WeatherEffect,
};
use bevy_weathering::emitter::Emitter;
use bevy_weathering::record::Recording;
use bevy_weathering::stamps::StampKind;

use super::theme;
use super::ui::{AddPanel, Place};
use super::widgets::{color, color_and_opacity, number};

/// The effects that come with the project, by name. Made when they are first asked for.
#[derive(Resource, Default)]
pub struct Shipped([Option<Handle<WeatherEffect>>; ShippedEffect::ALL.len()]);

/// Names of the effects that come with the project.
pub fn names() -> impl Iterator<Item = &'static str> {
    ShippedEffect::ALL.into_iter().map(|shipped| shipped.name)
}

/// The file of an effect that comes with the project.
pub fn text(name: &str) -> Option<&'static str> {
    ShippedEffect::named(name).map(|shipped| shipped.ron)
}

/// An effect that comes with the project.
pub fn shipped(world: &mut World, name: &str) -> Option<Handle<WeatherEffect>> {
    let index = names().position(|known| known == name)?;
    if let Some(handle) = &world.resource::<Shipped>().0[index] {
        return Some(handle.clone());
    }
    let effect = ShippedEffect::ALL[index].read().map_err(|error| error!("effect {name}: {error}")).ok()?;
    let handle = world.resource_mut::<Assets<WeatherEffect>>().add(effect);
    world.resource_mut::<Shipped>().0[index] = Some(handle.clone());
    Some(handle)
}

/// What an emitter can send out, by name: what comes with the project, and what else is in use.
pub fn choices(world: &mut World) -> Vec<String> {
    let mut all: Vec<String> = names().map(str::to_owned).collect();
    for (name, _) in in_use(world) {
        if !all.contains(&name) {
            all.push(name);
        }
    }
    all
}

/// The effect of this name among [`choices`].
pub fn named(world: &mut World, name: &str) -> Option<Handle<WeatherEffect>> {
    let own = shipped(world, name);
    own.or_else(|| in_use(world).into_iter().find(|(other, _)| other == name).map(|(_, handle)| handle))
}

/// An effect as it is now, with what was edited of it.
pub fn of(world: &World, handle: &Handle<WeatherEffect>) -> Option<WeatherEffect> {
    let asset = world.resource::<Assets<WeatherEffect>>().get(handle).cloned();
    let rows = world.resource::<EffectTable>().rows();
    asset.or_else(|| rows.iter().find(|row| row.handle == *handle)?.effect.clone())
}

/// The effect that is being edited.
#[derive(Resource, Default)]
struct Edited(Option<AssetId<WeatherEffect>>);

pub fn plugin(app: &mut App) {
    app.init_resource::<Shipped>().init_resource::<Edited>().add_panel(Place::Side, "Effects", show);
}

/// Effects in use, with a name to know them by.
fn in_use(world: &mut World) -> Vec<(String, Handle<WeatherEffect>)> {
    let mut emitters = world.query::<(&Emitter, Option<&Name>)>();
    let of_emitters: Vec<_> = emitters
        .iter(world)
        .map(|(emitter, name)| {
            let name = name.map_or_else(|| "emitter".to_owned(), ToString::to_string);
            (name, emitter.effect.clone())
        })
        .collect();
    let shipped = &world.resource::<Shipped>().0;
    let rows = world.resource::<EffectTable>().rows();
    let named = |handle: &Handle<WeatherEffect>| {
        let by_name = names().zip(shipped).find(|(_, known)| known.as_ref() == Some(handle));
        let by_emitter = of_emitters.iter().find(|(_, effect)| effect == handle);
        by_name.map(|(name, _)| name.to_owned()).or_else(|| by_emitter.map(|(name, _)| format!("of {name}")))
    };
    rows.iter()
        .enumerate()
        .map(|(index, row)| {
            let name = named(&row.handle).unwrap_or_else(|| match index {
                0 => "drips".into(),
                1 => "lumps of snow".into(),
                2 => "drips of mud".into(),
                _ => format!("effect {index}"),
            });
            (name, row.handle.clone())
        })
        .collect()
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    let all = in_use(world);
    let mut chosen = world.resource::<Edited>().0;
    if !all.iter().any(|(_, handle)| Some(handle.id()) == chosen) {
        // What somebody sends out, and only without that what surfaces shed.
        let mut emitters = world.query::<&Emitter>();
        let mut sent =
            |effect: &Handle<WeatherEffect>| emitters.iter(world).any(|emitter| emitter.effect == *effect);
        let first = all.iter().position(|(_, handle)| sent(handle)).unwrap_or(0);
        chosen = all.get(first).map(|(_, handle)| handle.id());
    }
    let Some((name, handle)) = all.iter().find(|(_, handle)| Some(handle.id()) == chosen) else {
        ui.label("Nothing is in use yet.");
        return;
    };
    egui::ComboBox::from_label("effect").selected_text(name.as_str()).show_ui(ui, |ui| {
        for (name, handle) in &all {
            ui.selectable_value(&mut chosen, Some(handle.id()), name.as_str());
        }
    });
    world.resource_mut::<Edited>().0 = chosen;
    let Some(before) = world.resource::<Assets<WeatherEffect>>().get(handle).cloned() else {
        ui.label("It is made in code and cannot be edited.");
        return;
    };
    if world.contains_resource::<Recording>() {
        let warning = "No event can say what is edited here: the recording would not replay as it was.";
        ui.colored_label(theme::WARNING, warning);
    }
    let mut effect = before.clone();
    edit(ui, &mut effect);
    if effect == before {
        return;
    }
    match effect.validate() {
        Ok(()) => {
            if let Some(mut asset) = world.resource_mut::<Assets<WeatherEffect>>().get_mut(handle) {
                *asset = effect;
            }
        }
        Err(error) => {
            ui.colored_label(theme::WARNING, error.to_string());
        }
    }
}

/// The numbers of an effect.
fn edit(ui: &mut egui::Ui, effect: &mut WeatherEffect) {
    ui.heading("What a particle carries");
    carries(ui, &mut effect.carries);
    number(
        ui,
        "volume, mm³",
        &mut effect.volume_mm3,
        (0.0, 10_000.0),
        "Of a particle, if its emitter has no flow of its own",
    );
    match &mut effect.drops {
        DropSizes::Same(mm) => number(ui, "drops, mm", mm, (0.01, 20.0), "Their diameter; all alike"),
        DropSizes::MarshallPalmer(rate) => {
            number(ui, "drops of rain, mm/h", rate, (0.1, 300.0), "Sizes after Marshall and Palmer")
        }
    }
    ui.heading("How it flies");
    let mut is_given = effect.terminal_speed.is_some();
    if ui.checkbox(&mut is_given, "own terminal speed").changed() {
        effect.terminal_speed = is_given.then_some(9.0);
    }
    if let Some(speed) = &mut effect.terminal_speed {
        number(
            ui,
            "terminal v_t, m/s",
            speed,
            (0.0, 100.0),
            "At which drag balances gravity; 0 is no drag, no wind",
        );
    }
    number(ui, "gravity", &mut effect.gravity_scale, (-2.0, 2.0), "Multiplies gravity");
    number(ui, "flutter, m/s", &mut effect.flutter, (0.0, 10.0), "Swaying in still air");
    ui.heading("The mark it leaves");
    stamps(ui, effect);
    let mut is_given = effect.stamp_radius.is_some();
    if ui.checkbox(&mut is_given, "own radius").changed() {
        effect.stamp_radius = is_given.then_some(0.02);
    }
    if let Some(radius) = &mut effect.stamp_radius {
        number(ui, "radius, m", radius, (0.001, 1.0), "Of a particle with the volume above");
        if matches!(effect.carries, Carries::Water | Carries::Mud(_)) {
            stamp_speed(ui, &mut effect.stamp_speed);
        }
    }
    number(ui, "jitter", &mut effect.stamp_radius_jitter, (0.0, 0.9), "Radius times 1 plus or minus this");
    number(ui, "stretch", &mut effect.stamp_stretch, (0.0, 7.0), "How much longer than wide, aslant");
    number(ui, "splash", &mut effect.splash, (0.0, 0.5), "Part of the water that is thrown up again");
    ui.checkbox(&mut effect.jet, "jet")
        .on_hover_text("Pushes the film aside where it hits, and sweeps along what is loose");
    number(ui, "bump", &mut effect.bump, (-1.0, 1.0), "Sine of the slope at its rim");
    for (label, paint) in [("colour", &mut effect.diffuse), ("gloss", &mut effect.specular)] {
        ui.horizontal(|ui| {
            color(ui, &mut paint.color);
            number(ui, label, &mut paint.opacity, (0.0, 1.0), "Opacity in its middle");
        });
    }
    ui.heading("How a particle looks");
    const SPRITES: [(Sprite, &str); 5] = [
        (Sprite::Streak, "streak"),
        (Sprite::Drop, "drop"),
        (Sprite::Flake, "flake"),
        (Sprite::Grain, "grain"),
        (Sprite::Clod, "clod"),
    ];
    choice(ui, &mut effect.look.sprite, &SPRITES);
    ui.horizontal(|ui| {
        color_and_opacity(ui, &mut effect.look.color);
        ui.label("colour, opacity");
    });
    number(ui, "width, m", &mut effect.look.width, (0.0, 0.1), "Of the streak");
    number(ui, "exposure, s", &mut effect.look.exposure, (0.0, 0.1), "How long the shutter is open");
    number(ui, "crown, m", &mut effect.look.splash, (0.0, 0.2), "Height of the splash");
}

/// At which speed marks are as large as the effect says.
fn stamp_speed(ui: &mut egui::Ui, speed: &mut Option<f32>) {
    let mut is_given = speed.is_some();
    if ui.checkbox(&mut is_given, "at a speed of its own").changed() {
        *speed = is_given.then_some(5.0);
    }
    if let Some(speed) = speed {
        let what =
            "Straight at the surface: at a quarter of it the radius is half; 0 is the same at any speed";
        number(ui, "at v, m/s", speed, (0.0, 100.0), what);
    }
}

/// One of some values, by their names.
fn choice<T: PartialEq + Copy>(ui: &mut egui::Ui, value: &mut T, all: &[(T, &str)]) {
    ui.horizontal_wrapped(|ui| {
        for &(other, name) in all {
            ui.selectable_value(value, other, name);
        }
    });
}

/// Shapes of the marks, and how they are turned.
fn stamps(ui: &mut egui::Ui, effect: &mut WeatherEffect) {
    let before = effect.stamps.clone();
    ui.horizontal_wrapped(|ui| {
        ui.selectable_value(&mut effect.stamps, StampSource::Dome, "dome");
        for kind in StampKind::ALL {
            ui.selectable_value(&mut effect.stamps, StampSource::Kind(kind), kind.name());
        }
        // What has been read from files can be left for another, but not come back to.
        if matches!(before, StampSource::Images { .. }) {
            ui.selectable_value(&mut effect.stamps, before.clone(), "images");
        }
    });
    if effect.stamps != before {
        // Those that it had are of the other shape; new ones are made where it is used.
        effect.stamp_set = None;
    }
    const TURNS: [(StampTurn, &str); 3] = [
        (StampTurn::Random, "turned at random"),
        (StampTurn::Flight, "along the flight"),
        (StampTurn::Downhill, "downhill"),
    ];
    choice(ui, &mut effect.stamp_turn, &TURNS);
}

fn carries(ui: &mut egui::Ui, carries: &mut Carries) {
    ui.horizontal_wrapped(|ui| {
        let is_mud = matches!(carries, Carries::Mud(_));
        for (kind, name) in [(Carries::Water, "water"), (Carries::Dust, "dust"), (Carries::Snow, "snow")] {
            ui.selectable_value(carries, kind, name);
        }
        if ui.selectable_label(is_mud, "mud").clicked() && !is_mud {
            *carries = Carries::Mud(0.4);
        }
    });
    if let Carries::Mud(water) = carries {
        ui.add(egui::Slider::new(water, 0.0..=1.0).text("water in it"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_with_the_project_can_be_used() {
        let mut world = World::new();
        world.init_resource::<Shipped>();
        world.init_resource::<Assets<WeatherEffect>>();
        for name in names() {
            let handle = shipped(&mut world, name).expect(name);
            assert_eq!(shipped(&mut world, name), Some(handle), "made twice");
        }
        assert_eq!(shipped(&mut world, "no such effect"), None);
    }

    #[test]
    fn an_effect_that_is_only_looked_at_stays_as_it_is() {
        for shipped in ShippedEffect::ALL {
            let before = shipped.read().unwrap();
            let mut effect = before.clone();
            egui::__run_test_ui(|ui| edit(ui, &mut effect));
            assert_eq!(effect, before, "{}", shipped.name);
        }
    }
}
