//! How the selected surface takes up water and looks with it: all parameters of the papers, and presets.

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::material::models::lagarde::gloss_from_roughness;
use bevy_weathering::material::{
    BaseBrdf, Coated, DryMaterial, Flood, Grains, PlayedWetMap, Playing, Pores, PorositySource,
    PorousMaterial, StandingWater, TextureMeaning, Tweaked, WetLook, WettingModel,
};
use bevy_weathering::record::Recording;

use super::selection::{Selected, choose_surface};
use super::ui::{AddPanel, Place};
use super::widgets::{color, number, parameter};

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
    // No event can say it, and it touches no water: a recording is of the scene as its file has it.
    let is_free = !world.contains_resource::<Recording>();
    ui.add_enabled_ui(is_free, |ui| {
        show_dry(ui, world, surface);
        show_played(ui, world, surface);
    });
}

/// The surface when dry: the material that it came with, which others may have, too.
fn show_dry(ui: &mut egui::Ui, world: &mut World, surface: Entity) {
    let Some(handle) = world.get::<DryMaterial>(surface).map(|dry| dry.0.clone()) else { return };
    let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
    let Some(before) = materials.get(&handle) else { return };
    let linear = before.base_color.to_linear();
    let mut k_d = [linear.red, linear.green, linear.blue];
    let mut numbers = [before.perceptual_roughness, before.reflectance, before.metallic];
    let shown = (k_d, numbers);
    ui.heading("Dry");
    ui.horizontal(|ui| {
        color(ui, &mut k_d);
        ui.label("colour k_d")
            .on_hover_text("Multiplies its texture. Surfaces of the same material share it");
    });
    let [roughness, reflectance, metalness] = &mut numbers;
    number(ui, "roughness", roughness, (0.0, 1.0), "Perceptual; multiplies its texture");
    ui.small(format!("gloss {:.2}", gloss_from_roughness(f64::from(*roughness))));
    number(ui, "reflectance", reflectance, (0.0, 1.0), "F0 = 0.16 reflectance^2; of what is no metal");
    ui.small(format!("F0 {:.3}", 0.16 * *reflectance * *reflectance));
    number(ui, "metalness", metalness, (0.0, 1.0), "Metal has no pores");
    if (k_d, numbers) != shown
        && let Some(mut material) = materials.get_mut(&handle)
    {
        let [red, green, blue] = k_d;
        material.base_color = LinearRgba { red, green, blue, ..linear }.into();
        [material.perceptual_roughness, material.reflectance, material.metallic] = numbers;
    }
}

/// A wet map that is played on the surface, if there is one.
fn show_played(ui: &mut egui::Ui, world: &mut World, surface: Entity) {
    let Some(before) = world.get::<PlayedWetMap>(surface).cloned() else { return };
    let mut played = before.clone();
    ui.heading("Wet map that is played");
    number(ui, "lasts, s", &mut played.seconds, (0.1, 600.0), "From dry to wet, or back");
    number(
        ui,
        "t_fill",
        &mut played.t_fill,
        (0.0, 1.0),
        "Of the whole: how soft the wet border is; 0 is hard",
    );
    ui.horizontal(|ui| {
        ui.selectable_value(&mut played.playing, Playing::Wetting, "gets wet");
        ui.selectable_value(&mut played.playing, Playing::Drying, "dries");
    });
    if played != before
        && let Ok(mut entity) = world.get_entity_mut(surface)
    {
        entity.insert(played);
    }
}

/// What a surface does with water.
fn show_pores(ui: &mut egui::Ui, of: &mut PorousMaterial) {
    ui.heading("Water");
    parameter(
        ui,
        "sorptivity S, mm/min^½",
        "sorptivity",
        &mut of.sorptivity,
        Some(10.0),
        "How fast a film is taken up",
    );
    parameter(ui, "capacity, mm", "capacity_mm", &mut of.capacity_mm, Some(20.0), "Water that fits into it");
    parameter(ui, "visible, mm", "visible_mm", &mut of.visible_mm, Some(5.0), "Absorbed, looks fully wet");
    parameter(
        ui,
        "pore volume θ_s",
        "pore_volume",
        &mut of.pore_volume,
        None,
        "Part of its volume that is pores",
    );
    parameter(ui, "film kept, mm", "retained_mm", &mut of.retained_mm, Some(2.0), "So much does not run");
    parameter(
        ui,
        "time to fill t_fill, s",
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
                color(ui, &mut look.color);
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
    parameter(ui, "pore area α_poro", "model.alpha_poro", &mut pores.alpha_poro, None, about);
    parameter(
        ui,
        "pore shape s_p",
        "model.s_p",
        &mut pores.s_p,
        None,
        "Shape of a pore: deep near 0, shallow at 1",
    );
    parameter(ui, "roughness m", "model.m", &mut pores.m, None, "RMS slope between pores");
    parameter(
        ui,
        "scatters back k_s",
        "model.k_s",
        &mut pores.k_s,
        None,
        "Light that is scattered back without entering",
    );
    parameter(
        ui,
        "water reflects k_w",
        "model.k_w",
        &mut pores.k_w,
        None,
        "Strength of the water's own reflection",
    );
    ui.checkbox(&mut pores.sqrt_k, "k = sqrt(2 m² / π)").on_hover_text("Schlick; else as printed");
}

fn show_coated(ui: &mut egui::Ui, film: &mut Coated) {
    parameter(ui, "porosity", "model.porosity", &mut film.porosity, None, "Part that takes the film");
    parameter(ui, "index n_solid", "model.n_solid", &mut film.n_solid, None, "Refractive index of the solid");
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_only_looked_at_stays_as_it_is() {
        let models = [
            WettingModel::Lagarde(Tweaked::default()),
            WettingModel::Authored(WetLook::default()),
            WettingModel::Hnat(Pores::default()),
        ];
        let others = models.map(|model| PorousMaterial { model, ..default() });
        for before in PorousMaterial::PRESETS.into_iter().map(|(_, preset)| preset).chain(others) {
            let mut material = before;
            egui::__run_test_ui(|ui| {
                show_pores(ui, &mut material);
                show_model(ui, &mut material);
            });
            assert_eq!(material, before);
        }
        for flood in [
            Flood::None,
            Flood::Accumulation { cracks: 0.3, puddles: 1.7 },
            Flood::Level { level_mm: 3.0, basin_mm: 20.0, relief_mm: 5.0 },
        ] {
            let before = StandingWater { flood, ..default() };
            let mut water = before;
            egui::__run_test_ui(|ui| show_standing(ui, &mut water));
            assert_eq!(water, before);
        }
    }

    #[test]
    fn the_dry_material_and_the_played_map_are_shown_and_not_touched() {
        let mut world = World::new();
        let mut materials = Assets::<StandardMaterial>::default();
        let base_color = Color::linear_rgb(0.42, 0.2, 0.13);
        let handle = materials.add(StandardMaterial { base_color, perceptual_roughness: 0.7, ..default() });
        world.insert_resource(materials);
        let played = PlayedWetMap { seconds: 12.0, t_fill: 0.3, ..default() };
        let surface = world.spawn((DryMaterial(handle.clone()), played.clone())).id();
        world.clear_trackers();
        egui::__run_test_ui(|ui| {
            show_dry(ui, &mut world, surface);
            show_played(ui, &mut world, surface);
        });
        let material = world.resource::<Assets<StandardMaterial>>().get(&handle).unwrap();
        assert_eq!((material.base_color, material.perceptual_roughness), (base_color, 0.7));
        assert_eq!(world.get::<PlayedWetMap>(surface), Some(&played));
        // A surface without either has nothing to show.
        let bare = world.spawn_empty().id();
        egui::__run_test_ui(|ui| {
            show_dry(ui, &mut world, bare);
            show_played(ui, &mut world, bare);
        });
    }
}
