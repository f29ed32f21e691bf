//! How the selected surface takes up water and looks with it: all parameters of the papers, and presets.

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::material::{
    BaseBrdf, Coated, Flood, Grains, Pores, PorositySource, PorousMaterial, StandingWater, TextureMeaning,
    Tweaked, WetLook, WettingModel,
};

use super::selection::{Selected, choose_surface};
use super::ui::{AddPanel, Place};
use super::widgets::parameter;

pub fn plugin(app: &mut App) {
    app.add_panel(Place::Side, "Materials", show);
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    choose_surface(ui, world);
    let Some(surface) = world.resource::<Selected>().0 else { return };
    let before = world.get::<PorousMaterial>(surface).copied().unwrap_or_default();
    let mut material = before;
    ui.horizontal_wrapped(|ui| {
        for (name, preset) in PorousMaterial::PRESETS {
            if ui.selectable_label(material == preset, name).clicked() {
                material = preset;
            }
        }
    });
    ui.separator();
    show_pores(ui, &mut material);
    ui.heading("Look");
    show_model(ui, &mut material);
    if material != before
        && let Ok(mut entity) = world.get_entity_mut(surface)
    {
        entity.insert(material);
    }
    let before = world.get::<StandingWater>(surface).copied().unwrap_or_default();
    let mut water = before;
    ui.heading("Water that stands");
    show_standing(ui, &mut water);
    if water != before
        && let Ok(mut entity) = world.get_entity_mut(surface)
    {
        entity.insert(water);
    }
}

/// What a surface does with water.
fn show_pores(ui: &mut egui::Ui, of: &mut PorousMaterial) {
    ui.heading("Water");
    parameter(
        ui,
        "S, mm/min^1/2",
        "sorptivity",
        &mut of.sorptivity,
        Some(10.0),
        "How fast a film is taken up",
    );
    parameter(ui, "capacity, mm", "capacity_mm", &mut of.capacity_mm, Some(20.0), "Water that fits into it");
    parameter(ui, "visible, mm", "visible_mm", &mut of.visible_mm, Some(5.0), "Absorbed, looks fully wet");
    parameter(ui, "theta_s", "pore_volume", &mut of.pore_volume, None, "Part of its volume that is pores");
    parameter(ui, "film kept, mm", "retained_mm", &mut of.retained_mm, Some(2.0), "Does not run");
    parameter(
        ui,
        "t_fill, s",
        "t_fill",
        &mut of.t_fill,
        Some(30.0),
        "From the first water until it looks wet",
    );
    ui.heading("Drying");
    let about = "How much longer the middle of a patch stays wet than its rim";
    parameter(ui, "rim delay", "rim_delay", &mut of.rim_delay, Some(10.0), about);
    parameter(ui, "salts", "efflorescence", &mut of.efflorescence, None, "White, where it has dried");
    parameter(ui, "tide marks", "tide_mark", &mut of.tide_mark, None, "Dark, along the rims of patches");
    let about = "Part of the light that comes through when soaked";
    parameter(ui, "translucency", "wet_translucency", &mut of.wet_translucency, None, about);
}

/// What wetness does to the look.
fn show_model(ui: &mut egui::Ui, material: &mut PorousMaterial) {
    let pores = material.model.pores().copied().unwrap_or_default();
    let models = [
        ("Hnat", WettingModel::Hnat(pores)),
        ("Hnat + Lekner-Dorf", WettingModel::HnatLeknerDorf(pores, Coated::default())),
        ("Lagarde", WettingModel::Lagarde(Tweaked::default())),
        ("Lekner-Dorf", WettingModel::LeknerDorf(Coated::default())),
        ("Twomey", WettingModel::Twomey(Grains::default())),
        ("as painted", WettingModel::Authored(WetLook::default())),
    ];
    let is = |model: &WettingModel| std::mem::discriminant(model) == std::mem::discriminant(&material.model);
    let now = models.iter().find(|(_, model)| is(model)).map_or("", |(name, _)| *name);
    let mut chosen = None;
    egui::ComboBox::from_label("model").selected_text(now).show_ui(ui, |ui| {
        for (name, model) in models {
            if ui.selectable_label(is(&model), name).clicked() && !is(&model) {
                chosen = Some(model);
            }
        }
    });
    if let Some(model) = chosen {
        material.model = model;
    }
    match &mut material.model {
        WettingModel::Hnat(of) => show_hnat(ui, of),
        WettingModel::HnatLeknerDorf(pores, film) => {
            show_hnat(ui, pores);
            show_coated(ui, film);
        }
        WettingModel::LeknerDorf(film) => show_coated(ui, film),
        WettingModel::Lagarde(tweaked) => {
            parameter(ui, "porosity", "model.porosity", &mut tweaked.porosity, None, "0 is glazed");
            for (source, name) in [
                (PorositySource::Scalar, "everywhere"),
                (PorositySource::Texture, "by texture"),
                (PorositySource::MaskAndGloss, "by mask and gloss"),
                (PorositySource::Gloss, "by gloss"),
            ] {
                ui.radio_value(&mut tweaked.source, source, name);
            }
            ui.checkbox(&mut tweaked.metalness_from_specular, "metal by its specular colour");
        }
        WettingModel::Twomey(grains) => {
            parameter(ui, "porosity", "model.porosity", &mut grains.porosity, None, "Part that is grains");
            let about = "Less light turned back in water, 1 is none less";
            parameter(ui, "backscatter", "model.backscatter", &mut grains.backscatter, None, about);
        }
        WettingModel::Authored(look) => {
            ui.horizontal(|ui| {
                ui.color_edit_button_rgb(&mut look.color);
                ui.label("colour when wet");
            });
            parameter(ui, "roughness", "model.roughness", &mut look.roughness, None, "When wet");
            parameter(ui, "reflectance", "model.reflectance", &mut look.reflectance, None, "When wet");
        }
    }
    ui.horizontal(|ui| {
        ui.label("texture shows");
        ui.selectable_value(&mut material.texture, TextureMeaning::DryLook, "the dry surface");
        ui.selectable_value(&mut material.texture, TextureMeaning::Solid, "the solid");
    });
    ui.horizontal(|ui| {
        ui.label("BRDF");
        ui.selectable_value(&mut material.brdf, BaseBrdf::Ggx, "GGX");
        ui.selectable_value(&mut material.brdf, BaseBrdf::BlinnPhong, "Blinn-Phong");
    });
}

fn show_hnat(ui: &mut egui::Ui, pores: &mut Pores) {
    let about = "Part of the surface that is pores";
    parameter(ui, "alpha_poro", "model.alpha_poro", &mut pores.alpha_poro, None, about);
    parameter(ui, "s_p", "model.s_p", &mut pores.s_p, None, "Shape of a pore: deep near 0, shallow at 1");
    parameter(ui, "m", "model.m", &mut pores.m, None, "RMS slope between pores");
    parameter(ui, "k_s", "model.k_s", &mut pores.k_s, None, "Light that is scattered back without entering");
    parameter(ui, "k_w", "model.k_w", &mut pores.k_w, None, "Strength of the water's own reflection");
    ui.checkbox(&mut pores.sqrt_k, "k = sqrt(2 m^2 / pi)").on_hover_text("Schlick; else as printed");
}

fn show_coated(ui: &mut egui::Ui, film: &mut Coated) {
    parameter(ui, "porosity", "model.porosity", &mut film.porosity, None, "Part that takes the film");
    parameter(ui, "n_solid", "model.n_solid", &mut film.n_solid, None, "Refractive index of the solid");
}

fn show_standing(ui: &mut egui::Ui, water: &mut StandingWater) {
    let floods = [
        ("none", Flood::None),
        ("accumulation", Flood::Accumulation { cracks: 0.5, puddles: 0.5 }),
        ("level", Flood::Level { level_mm: 5.0, basin_mm: 20.0, relief_mm: 5.0 }),
    ];
    ui.horizontal(|ui| {
        for (name, flood) in floods {
            let is = std::mem::discriminant(&flood) == std::mem::discriminant(&water.flood);
            if ui.selectable_label(is, name).clicked() && !is {
                water.flood = flood;
            }
        }
    });
    match &mut water.flood {
        Flood::None => {}
        Flood::Accumulation { cracks, puddles } => {
            parameter(ui, "cracks", "flood.cracks", cracks, None, "Fills low texels");
            parameter(ui, "puddles", "flood.puddles", puddles, None, "Fills painted vertices");
        }
        Flood::Level { level_mm, basin_mm, relief_mm } => {
            parameter(ui, "level, mm", "flood.level_mm", level_mm, Some(500.0), "Above the lowest point");
            parameter(ui, "basin, mm", "flood.basin_mm", basin_mm, Some(500.0), "What the paint spans");
            parameter(ui, "relief, mm", "flood.relief_mm", relief_mm, Some(100.0), "What the height spans");
        }
    }
    parameter(
        ui,
        "levelling, mm",
        "levelling_mm",
        &mut water.levelling_mm,
        Some(10.0),
        "Gets level over this",
    );
    let about = "Rain whose drops are not simulated: ripples";
    parameter(ui, "ripples, mm/h", "rain_mm_per_h", &mut water.rain_mm_per_h, Some(50.0), about);
    parameter(
        ui,
        "ripple cell, m",
        "ripple_cell",
        &mut water.ripple_cell,
        Some(2.0),
        "A drop after the other",
    );
    for (value, symbol) in water.absorption_per_mm.iter_mut().zip(["red, 1/mm", "green, 1/mm", "blue, 1/mm"])
    {
        parameter(ui, symbol, "absorption_per_mm", value, Some(1.0), "What murky water takes away");
    }
}
