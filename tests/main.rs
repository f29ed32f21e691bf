//! The integration tests: one binary, so that Bevy is linked once.

/// The real shaders on a real driver, against their twins.
mod gpu {
    mod harness;
    mod hnat;
}
