//! Benches: what a tick costs, against the brute force of 2007, against other ray casters and against bare loops.
//!
//! | group | measures | against |
//! |---|---|---|
//! | [`bytes`] | memory of a particle in flight | - |
//! | [`tick`] | a tick of scenes 1 and 2 in the steady state, 100 to 1,000 particles/s | [`hoff`], every particle against every triangle |
//! | [`live`] | the highest emission that leaves a 60 Hz tick inside its 16.67 ms | the budget |
//! | [`far`] | a particle with nothing near it | a loop over two arrays |
//! | [`cast`] | closest hits of short segments, from 1,000 to 1,000,000 triangles | [`hoff`]; parry3d, bvh and `MeshRayCast`, in [`rivals`] |
//! | [`growth`] | a tick by triangles, by surfaces and by particles | - |
//! | [`shading`] | a frame full of a weathered surface | the same frame of a `StandardMaterial` |
//! | [`wetting`] | water that runs, and surfaces at rest | a tick without surfaces |
//! | [`splat`] | painting on the CPU, and sorting for the GPU | each other |
//! | [`overlap`] | 100,000 stamps in a frame on the GPU | [`quads`]: instanced, and a draw for each |
//! | [`drawing`] | a frame with up to 200,000 particles in sight | the same frame without, and as many plain instances |
//!
//! `cargo bench --bench main` runs all of them, `cargo bench --bench main -- cast` one. Results, predictions
//! and limits are in `benches/NOTES.md`.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a bench that cannot measure stops")]

mod bytes;
mod cast;
mod drawing;
mod far;
mod glb;
mod growth;
mod headless;
mod hoff;
mod live;
mod measure;
mod overlap;
mod quads;
mod rivals;
mod scene;
mod shading;
mod sim;
mod splat;
mod tick;
mod wetting;

use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};

/// Small samples: the ratios come from [`measure::means`], and the whole run should take minutes.
fn config() -> Criterion {
    Criterion::default()
        .without_plots()
        .sample_size(10)
        .nresamples(10_000)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
}

/// A baseline that is wrong must not be timed.
fn baseline_is_right(_: &mut Criterion) {
    hoff::check();
}

criterion_group! {
    name = benches;
    config = config();
    // Memory first, while nothing has been given back to the allocator that it could hand out again.
    targets = bytes::bench, baseline_is_right, tick::bench, live::bench, far::bench, cast::bench,
        splat::bench, wetting::bench, growth::bench, shading::bench, overlap::bench,
        drawing::bench
}
criterion_main!(benches);
