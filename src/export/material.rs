//! Materials of a scene: read when they are dry, written when they are wet.

use std::path::Path;

use image::{DynamicImage, ImageFormat, Luma, Rgb, Rgba};
use serde_json::{Map, Value, json};

use super::ExportError;
use super::document::Document;
use super::paint::{Baked, Source};
use super::scene::vector;
use super::texture::Pictures;
use crate::picture::{PictureError, square};
use crate::replay::SurfaceMaps;

/// Says what a material is like in another way.
const GLOSS: &str = "KHR_materials_pbrSpecularGlossiness";

/// Numbers of textures: colour, roughness and metallic, normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WetTextures {
    pub(super) color: usize,
    pub(super) surface: usize,
    pub(super) normal: Option<usize>,
}

impl Document {
    /// What a material is like; without one, what the format says. Textures that a plain metallic-roughness renderer does
    /// not read are left alone, but for the diffuse one of a material that is given by specular and glossiness alone.
    pub(super) fn source(
        &self,
        material: Option<usize>,
        pictures: &mut Pictures,
    ) -> Result<Source, ExportError> {
        let material = match material {
            Some(material) => self.entry("materials", material)?,
            None => &Value::Null,
        };
        let factor = |value: &Value| value.as_f64().unwrap_or(1.0) as f32;
        let normal_map = pictures.texture(self, &material["normalTexture"])?;
        let normal_scale = factor(&material["normalTexture"]["scale"]);
        let pbr = &material["pbrMetallicRoughness"];
        let gloss = &material["extensions"][GLOSS];
        // What is there for those who do not know the extension says more of what is read here.
        if gloss.is_object() && pbr.as_object().is_none_or(Map::is_empty) {
            return Ok(Source {
                color: vector(&gloss["diffuseFactor"]).unwrap_or([1.0; 4]),
                color_map: pictures.texture(self, &gloss["diffuseTexture"])?,
                roughness: 1.0 - factor(&gloss["glossinessFactor"]),
                metallic: 0.0,
                surface_map: None,
                normal_map,
                normal_scale,
            });
        }
        Ok(Source {
            color: vector(&pbr["baseColorFactor"]).unwrap_or([1.0; 4]),
            color_map: pictures.texture(self, &pbr["baseColorTexture"])?,
            roughness: factor(&pbr["roughnessFactor"]),
            metallic: factor(&pbr["metallicFactor"]),
            surface_map: pictures.texture(self, &pbr["metallicRoughnessTexture"])?,
            normal_map,
            normal_scale,
        })
    }

    /// Adds the textures of a surface.
    pub(super) fn push_textures(
        &mut self,
        name: &str,
        baked: &Baked,
        sampler: usize,
    ) -> Result<WetTextures, ExportError> {
        let Baked { size, color, surface, normal } = baked;
        let opaque = color.iter().skip(3).step_by(4).all(|&alpha| alpha == 255);
        let path = |kind: &str| format!("{name}_{kind}");
        let color_path = path("color");
        let colors = if opaque {
            let rgb = color.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect();
            square::<Rgb<u8>>(Path::new(&color_path), *size, rgb)?
        } else {
            square::<Rgba<u8>>(Path::new(&color_path), *size, color.clone())?
        };
        let color = self.push_texture(&color_path, &colors, sampler)?;
        let surface_path = path("surface");
        let surfaces = square::<Rgb<u8>>(Path::new(&surface_path), *size, surface.clone())?;
        let surface = self.push_texture(&surface_path, &surfaces, sampler)?;
        let normal = match normal {
            None => None,
            Some(normal) => {
                let path = path("normal");
                let normals = square::<Rgb<u8>>(Path::new(&path), *size, normal.clone())?;
                Some(self.push_texture(&path, &normals, sampler)?)
            }
        };
        Ok(WetTextures { color, surface, normal })
    }

    /// Adds a texture; its number.
    pub(super) fn push_texture(
        &mut self,
        name: &str,
        picture: &DynamicImage,
        sampler: usize,
    ) -> Result<usize, ExportError> {
        let image = self.push_image(name, picture)?;
        Ok(self.push("textures", json!({ "name": name, "source": image, "sampler": sampler })))
    }

    fn push_image(&mut self, name: &str, picture: &DynamicImage) -> Result<usize, ExportError> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture
            .write_to(&mut bytes, ImageFormat::Png)
            .map_err(|source| PictureError::Image { path: name.into(), source })?;
        let view = self.push_view(bytes.get_ref(), None, None);
        let image = json!({ "name": name, "bufferView": view, "mimeType": "image/png" });
        Ok(self.push("images", image))
    }

    /// Adds what lies on a surface as pictures that nothing draws; what a material's `extras` say about them. 16-bit grey:
    /// wetness in parts of full, film and absorbed water in micrometres.
    pub(super) fn push_amounts(&mut self, maps: &SurfaceMaps) -> Result<Value, ExportError> {
        let mut amounts = json!({});
        for (kind, unit) in [("wetness", "1/65535"), ("film", "um"), ("absorbed", "um")] {
            let values = maps.wetness.iter().map(|texel| match kind {
                "wetness" => texel.wetness * 65_535.0,
                "film" => texel.film_mm * 1000.0,
                _ => texel.absorbed_mm * 1000.0,
            });
            let name = format!("{}_{kind}", maps.name);
            let texels = values.map(|value| value.round().clamp(0.0, 65_535.0) as u16).collect();
            let picture = square::<Luma<u16>>(Path::new(&name), maps.size, texels)?;
            amounts[kind] = json!({ "image": self.push_image(&name, &picture)?, "unit": unit });
        }
        Ok(amounts)
    }

    /// Adds the wet form of a material: all that the dry one says, with other textures in these uvs.
    pub(super) fn push_wet_material(
        &mut self,
        dry: usize,
        name: &str,
        textures: WetTextures,
        set: usize,
        amounts: Value,
    ) -> Result<usize, ExportError> {
        let mut wet = self.entry("materials", dry)?.clone();
        let texture = |index: usize| json!({ "index": index, "texCoord": set });
        wet["name"] = format!("{name}_wet").into();
        // Factors are in the textures.
        wet["pbrMetallicRoughness"] = json!({
            "baseColorTexture": texture(textures.color),
            "metallicRoughnessTexture": texture(textures.surface),
        });
        match textures.normal {
            Some(normal) => wet["normalTexture"] = texture(normal),
            None => remove(&mut wet, "normalTexture"),
        }
        // It says the same in another way, which would win.
        if let Some(extensions) = wet["extensions"].as_object_mut() {
            extensions.remove(GLOSS);
        }
        if wet["extensions"].as_object().is_none_or(|extensions| extensions.is_empty()) {
            remove(&mut wet, "extensions");
        }
        if wet["extras"].is_object() || wet["extras"].is_null() {
            wet["extras"]["weathering"] = amounts;
        }
        Ok(self.push("materials", wet))
    }
}

fn remove(object: &mut Value, field: &str) {
    if let Some(fields) = object.as_object_mut() {
        fields.remove(field);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document() -> Document {
        let json = json!({ "materials": [{
            "doubleSided": true,
            "normalTexture": { "index": 7 },
            "extras": { "own": 1 },
            "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 0.125, 1.0], "metallicFactor": 0.0 },
        }] });
        Document { path: "scene.gltf".into(), json, bytes: Vec::new() }
    }

    #[test]
    fn a_wet_material_keeps_what_is_not_baked() {
        let mut document = document();
        let baked = Baked { size: 1, color: vec![1, 2, 3, 255], surface: vec![255, 9, 0], normal: None };
        let sampler = document.push("samplers", json!({}));
        let textures = document.push_textures("wall", &baked, sampler).unwrap();
        let wet = document.push_wet_material(0, "wall", textures, 1, json!({ "film": 5 })).unwrap();
        let wet = document.entry("materials", wet).unwrap();
        let expected = json!({
            "name": "wall_wet",
            "doubleSided": true,
            "extras": { "own": 1, "weathering": { "film": 5 } },
            "pbrMetallicRoughness": {
                "baseColorTexture": { "index": 0, "texCoord": 1 },
                "metallicRoughnessTexture": { "index": 1, "texCoord": 1 },
            },
        });
        assert_eq!(*wet, expected);
        let again = document.source(Some(1), &mut Pictures::default()).unwrap();
        let (color, surface) = (again.color_map.unwrap(), again.surface_map.unwrap());
        assert_eq!((color.set, surface.picture.width, again.roughness), (1, 1, 1.0));
    }

    #[test]
    fn specular_and_glossiness_are_no_metal() {
        let mut document = document();
        let gloss = json!({ "diffuseFactor": [0.5, 0.25, 0.125, 1.0], "glossinessFactor": 0.25 });
        document.json["materials"][0] = json!({ "extensions": { GLOSS: gloss } });
        let look = |document: &Document| {
            let source = document.source(Some(0), &mut Pictures::default()).unwrap();
            (source.color, source.roughness, source.metallic)
        };
        assert_eq!(look(&document), ([0.5, 0.25, 0.125, 1.0], 0.75, 0.0));
        // A form without the extension is the one that is read.
        document.json["materials"][0]["pbrMetallicRoughness"] = json!({ "roughnessFactor": 0.5 });
        assert_eq!(look(&document), ([1.0; 4], 0.5, 1.0));
    }

    #[test]
    fn without_a_material_it_is_what_the_format_says() {
        let none = document().source(None, &mut Pictures::default()).unwrap();
        assert_eq!((none.color, none.roughness, none.metallic), ([1.0; 4], 1.0, 1.0));
        let Err(error) = document().source(Some(0), &mut Pictures::default()) else { panic!("no texture 7") };
        assert!(error.to_string().contains("textures[7]"), "{error}");
        assert!(document().source(Some(9), &mut Pictures::default()).is_err());
    }
}
