//! The integration tests: one binary, so that Bevy is linked once.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

/// The real shaders on a real driver, against their twins.
mod gpu {
    /// Small apps that render without a window.
    mod app;
    /// Ticks and frames.
    mod frames;
    mod harness;
    /// The porous BRDF post-process.
    mod hnat;
    /// What must look the same, and what must not.
    mod images;
    /// Painting.
    mod splat;
}
/// What the parts are together: order, independence of a renderer.
mod schedule;
