//! The integration tests: one binary, so that Bevy is linked once.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

/// What a Bevy app meets: what is built in, what is told, where links lead.
mod api;
/// Closest hits against brute force.
mod collision;
/// Random numbers and meshes for the other modules.
mod common;
/// Scenes with the weathering baked in.
mod export {
    mod bake;
    /// The present state of running apps.
    mod live;
    /// Skins, animations and morph targets.
    mod moving;
    /// Scenarios at their end.
    mod replay;
    /// The rules of the format.
    mod rules;
    mod scene;

    /// Writes a scene, before and after, into the folder that `WEATHERING_EXPORTS` names, for validators of others.
    fn keep(name: &str, before: &[u8], after: &[u8]) {
        let Some(folder) = std::env::var_os("WEATHERING_EXPORTS") else { return };
        let folder = std::path::PathBuf::from(folder);
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join(format!("{name}_dry.glb")), before).unwrap();
        std::fs::write(folder.join(format!("{name}_weathered.glb")), after).unwrap();
    }
}
/// The same numbers however they are computed.
mod digests;
/// What goes wrong around the program: it is killed, the disk is full, nothing can be drawn.
mod faults;
/// Ten thousand spoilt files.
mod fuzz;
/// The real shaders on a real driver, against their twins.
mod gpu {
    /// Small apps that render without a window.
    pub mod app;
    /// Shaders that do not compile.
    mod broken;
    /// What a picture shows on either side of each edge of a mesh.
    mod edges;
    /// Materials that are exchanged and given back.
    mod exchange;
    /// Exported scenes in a renderer that knows nothing of weathering.
    mod exported;
    /// Ticks and frames.
    mod frames;
    /// No light out of nothing.
    mod furnace;
    mod harness;
    /// The porous BRDF post-process.
    mod hnat;
    /// What must look the same, and what must not.
    mod images;
    /// Islands of a map from afar.
    mod islands;
    /// A device that is lost.
    mod lost;
    /// What lies on a surface, and what is painted on it.
    mod matter;
    /// Maps from afar.
    mod mips;
    /// What hangs in the air.
    mod particles;
    /// Lights, cameras, meshes.
    mod places;
    /// Maps of another size.
    mod resize;
    /// Borders of uv islands, as they are drawn.
    mod seams;
    /// Painting.
    mod splat;
    /// Floods, ripples, light through cloth.
    mod standing;
    /// Every other function of the shaders.
    mod twins;
    /// Shaders that change.
    mod understudy;
    /// Meshes that show an unwrapped copy.
    mod unwrapped;
    /// Water as it is drawn.
    mod water;
}
/// Structs that Rust and WGSL share.
mod layout;
/// Dust, mud and snow.
mod matter;
/// What a replay makes of its numbers and pictures, and many replays at once.
mod outputs;
/// More than a machine can do.
mod overload;
/// One budget for the maps of all surfaces.
mod pool;
/// Skinned meshes in their pose.
mod posed;
/// Sessions that are recorded, gone back in and replayed.
mod record;
/// What they refuse.
mod refusals;
/// Files of effects that change while they are in use.
mod reload;
/// The program as its users run it: output, errors, exit codes.
mod replay;
/// Starting over, and what is measured meanwhile.
mod resets;
/// Scenes that are saved and gone on with, and accounts of all water.
mod save;
/// Whole glTFs in scenarios, and models by themselves.
mod scenes;
/// What the parts are together: order, independence of a renderer.
mod schedule;
/// Marks across the borders of uv islands.
mod seams;
/// Which emitter wetted what.
mod sources;
/// Events of scenarios, includes, variants, checks.
mod timeline;
/// The smaller tools of the program.
mod tools;
/// Meshes whose texture coordinates lie on each other.
mod unwrap;
/// Videos by the ffmpeg of this machine.
mod video;
/// Wet maps, made as their users make them.
mod wetmap;
/// Water in and on surfaces.
mod wetting;
/// The sandbox in a real window, with real keys.
mod window {
    /// What is seen from where, and beside what.
    mod camera;
    /// Files that are dropped on it.
    mod drop;
    /// Keys and mouse.
    mod keys;
    /// Leaving while a scene is saved.
    mod leave;
    /// Other scenes.
    mod open;
    /// More particles than the machine can do.
    mod overload;
    /// What panels look like.
    mod panels;
    /// Recordings, and recordings of these.
    mod record;
    /// A virtual screen, and a program on it.
    mod screen;
    /// The first picture, and files that change.
    mod start;
    /// Ticks, speeds, sequences.
    mod time;
    /// Probe, brush and maps.
    mod tools;
}
