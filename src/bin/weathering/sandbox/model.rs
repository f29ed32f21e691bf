//! A glTF by itself: a scenario of nothing but it, and light in its shade.

use std::path::Path;

use bevy::prelude::*;

/// Whether a file is a model, by its name.
pub fn is_model(file: &Path) -> bool {
    let extension = file.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    ["glb", "gltf"].iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// Light in the shade: of a model by itself, which has nothing around it, or of a scene.
pub fn light_shade(world: &mut World, is_model: bool) {
    let scene = GlobalAmbientLight::default();
    let brightness = if is_model { 1500.0 } else { scene.brightness };
    world.insert_resource(GlobalAmbientLight { brightness, ..scene });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_known_by_their_names() {
        let is = |name: &str| is_model(Path::new(name));
        assert!(is("a/b.glb") && is("B.GLTF") && !is("c.ron") && !is("glb"));
    }
}
