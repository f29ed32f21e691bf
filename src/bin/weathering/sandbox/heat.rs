//! How many particles are where: a grid of cells around them, from blue, few, to red, many.
//!
//! Cells have sizes that are powers of two, so that they stay where they are while the cloud changes a little. Of very many
//! particles only some are counted, and stand for the others.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::particle::Particles;

use super::settings::Settings;

/// Cells along the longest side of the cloud, at most.
const CELLS: f32 = 16.0;
/// The smallest cell, metres.
const SMALLEST: f32 = 1.0 / 16.0;
/// The most particles that are looked at in a frame.
const COUNTED: usize = 100_000;

/// What was counted last.
#[derive(Resource, Default)]
struct Heat {
    /// Side of a cell, metres.
    cell: f32,
    counts: BTreeMap<[i32; 3], u32>,
    /// The highest count.
    most: u32,
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Heat>().add_systems(Update, draw);
}

/// The switch, and what the colours stand for.
pub fn show(ui: &mut egui::Ui, world: &mut World) {
    let &Heat { cell, most, .. } = world.resource::<Heat>();
    let mut settings = world.resource_mut::<Settings>();
    let views = &mut settings.views;
    ui.checkbox(&mut views.particles, "particle count").on_hover_text("From blue, few, to red, many");
    if views.particles && most > 0 {
        ui.small(format!("red is {most} in a cell, whose side is {cell} m"));
    }
}

/// A cell for a cloud with this longest side.
fn cell_for(extent: f32) -> f32 {
    let cell = (extent / CELLS).log2().ceil().exp2();
    if cell.is_finite() { cell.max(SMALLEST) } else { SMALLEST }
}

impl Heat {
    fn count(&mut self, places: &[Vec3]) {
        self.counts.clear();
        let step = places.len().div_ceil(COUNTED).max(1);
        let counted = || places.iter().step_by(step).filter(|place| place.is_finite());
        let (low, high) = counted().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), place| {
            (low.min(*place), high.max(*place))
        });
        self.cell = cell_for((high - low).max_element());
        for place in counted() {
            let cell = (*place / self.cell).floor().as_ivec3().to_array();
            *self.counts.entry(cell).or_default() += step as u32;
        }
        self.most = self.counts.values().copied().max().unwrap_or(0);
    }
}

fn draw(settings: Res<Settings>, particles: Res<Particles>, mut heat: ResMut<Heat>, mut gizmos: Gizmos) {
    if !settings.views.particles {
        return;
    }
    heat.count(particles.positions());
    let most = (heat.most.max(2) as f32).ln();
    for (index, count) in &heat.counts {
        let middle = (IVec3::from_array(*index).as_vec3() + 0.5) * heat.cell;
        let part = (*count as f32).ln() / most;
        let color = Color::hsl(240.0 * (1.0 - part), 0.9, 0.55);
        gizmos.cube(Transform::from_translation(middle).with_scale(Vec3::splat(heat.cell * 0.95)), color);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_particle_is_in_a_cell_and_cells_keep_their_size() {
        let mut heat = Heat::default();
        let cloud: Vec<Vec3> = (0..1000).map(|number| Vec3::new((number % 10) as f32, 0.3, 0.0)).collect();
        heat.count(&cloud);
        assert_eq!((heat.cell, heat.most, heat.counts.values().sum::<u32>()), (1.0, 100, 1000));
        // A little wider or narrower.
        assert_eq!([8.1, 10.0, 15.9].map(cell_for), [1.0; 3]);
        assert_eq!([0.0, f32::NAN, f32::NEG_INFINITY, f32::INFINITY].map(cell_for), [SMALLEST; 4]);
        heat.count(&[]);
        assert_eq!((heat.most, heat.counts.len()), (0, 0));
        heat.count(&[Vec3::NAN, Vec3::ZERO]);
        assert_eq!((heat.most, heat.counts.len()), (1, 1));
    }

    #[test]
    fn of_very_many_some_stand_for_all() {
        let mut heat = Heat::default();
        heat.count(&vec![Vec3::ONE; 10 * COUNTED]);
        assert_eq!(heat.most as usize, 10 * COUNTED);
    }
}
