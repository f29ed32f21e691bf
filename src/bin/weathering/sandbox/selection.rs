//! Which surface the panels are about.

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::overlay::Weatherable;

/// The surface that materials, maps and views are about.
#[derive(Resource, Default)]
pub struct Selected(pub Option<Entity>);

pub fn plugin(app: &mut App) {
    app.init_resource::<Selected>().add_systems(PreUpdate, keep_one_selected);
}

/// The first, where the last one has gone.
fn keep_one_selected(mut selected: ResMut<Selected>, surfaces: Query<Entity, With<Weatherable>>) {
    if selected.0.is_none_or(|surface| !surfaces.contains(surface)) {
        let first = surfaces.iter().min();
        if selected.0 != first {
            selected.0 = first;
        }
    }
}

/// What a surface is called.
pub fn name_of(world: &World, surface: Entity) -> String {
    world.get::<Name>(surface).map_or_else(|| surface.to_string(), ToString::to_string)
}

/// A list of all surfaces, to choose from.
pub fn choose_surface(ui: &mut egui::Ui, world: &mut World) {
    let mut query = world.query_filtered::<Entity, With<Weatherable>>();
    let mut surfaces: Vec<Entity> = query.iter(world).collect();
    surfaces.sort_unstable();
    let mut chosen = world.resource::<Selected>().0;
    let Some(now) = chosen else {
        ui.label("There is no surface.");
        return;
    };
    egui::ComboBox::from_label("surface").selected_text(name_of(world, now)).show_ui(ui, |ui| {
        for surface in surfaces {
            ui.selectable_value(&mut chosen, Some(surface), name_of(world, surface));
        }
    });
    if world.resource::<Selected>().0 != chosen {
        world.resource_mut::<Selected>().0 = chosen;
    }
}
