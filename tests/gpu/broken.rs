//! Shaders that do not compile: what they would have painted is lost and counted, and time goes on.

use bevy::prelude::*;
use bevy_weathering::overlay::{SplatBudget, SplatStats, Weatherable};
use bevy_weathering::schedule::TickHold;

use super::app::{app, update, update_until};
use super::splat::{SIZE, painted, push, random_splats, spawn_surface};

/// Puts another shader in the place of the one of this file; returns the former.
fn exchange(app: &mut App, file: &str, edit: impl Fn(&Shader) -> Shader) -> Shader {
    let mut shaders = app.world_mut().resource_mut::<Assets<Shader>>();
    let found = shaders.iter().find(|(_, shader)| shader.path.ends_with(file));
    let (id, former) = found.map(|(id, shader)| (id, shader.clone())).expect("the shader is loaded");
    shaders.insert(id, edit(&former)).unwrap();
    // Until the renderer has taken it over.
    (0..3).for_each(|_| update(app));
    former
}

#[test]
fn splats_that_can_never_be_painted_are_counted_and_stop_no_time() {
    let Some(mut app) = app() else { return };
    let surface = spawn_surface(&mut app, Weatherable { map_size: SIZE, ..default() });
    app.insert_resource(SplatBudget { most_waiting: 1, ..default() });
    let stats = app.world().resource::<SplatStats>().clone();
    push(&mut app, surface, &random_splats(5, 1));
    painted(&mut app, 5);
    for (round, file) in (1..).zip(["/splat.wgsl", "/mips.wgsl"]) {
        let broken =
            |shader: &Shader| Shader::from_wgsl("fn nothing { this is no shader", shader.path.clone());
        let former = exchange(&mut app, file, broken);
        push(&mut app, surface, &random_splats(7, 2));
        update_until(&mut app, "the splats to be given up", |_| stats.lost() == 7 * round);
        update(&mut app);
        assert_eq!((stats.splats(), stats.pending()), (5 * round, 0), "{file}");
        assert!(!app.world().resource::<TickHold>().is_held, "{file}");

        // Mended, as in hot reload.
        exchange(&mut app, file, |_| former.clone());
        push(&mut app, surface, &random_splats(5, 3));
        painted(&mut app, 5 * (round + 1));
        assert_eq!(stats.lost(), 7 * round, "{file}");
    }
}
