//! Dry materials of a running app, as a glTF has them.

use std::collections::{BTreeMap, BTreeSet};

use bevy::math::Affine2;
use bevy::mesh::UvChannel;
use bevy::prelude::*;
use serde_json::{Value, json};

use super::pictures::{LiveTextures, Meaning};
use crate::export::ExportError;
use crate::export::document::Document;

/// Materials, each once, and their textures.
#[derive(Debug, Clone, Default)]
pub(super) struct Looks {
    textures: LiveTextures,
    /// Of `None`: what has no material. Whether its normal map is drawn makes two of one.
    numbers: BTreeMap<(Option<AssetId<StandardMaterial>>, bool), usize>,
    materials: Vec<Look>,
    extensions: BTreeSet<&'static str>,
}

#[derive(Debug, Clone)]
struct Look {
    json: Value,
    uv_sets: usize,
}

impl Looks {
    /// Takes a material in; its number. `has_tangents`: of the mesh that shows it. Bevy draws no normal map without them, while
    /// readers of a glTF make those that are missing.
    ///
    /// # Errors
    /// Why it cannot be written.
    pub(super) fn add(
        &mut self,
        world: &World,
        handle: Option<&Handle<StandardMaterial>>,
        has_tangents: bool,
    ) -> Result<usize, String> {
        let materials = world.get_resource::<Assets<StandardMaterial>>();
        let plain = StandardMaterial::default();
        let material = match handle {
            None => &plain,
            Some(handle) => {
                materials.and_then(|all| all.get(handle)).ok_or("has a material that is not loaded")?
            }
        };
        let has_normal_map = has_tangents && material.normal_map_texture.is_some();
        let key = (handle.map(Handle::id), has_normal_map);
        if let Some(&number) = self.numbers.get(&key) {
            return Ok(number);
        }
        let look = self.look(world.get_resource::<Assets<Image>>(), material, has_normal_map)?;
        self.materials.push(look);
        let number = self.materials.len() - 1;
        self.numbers.insert(key, number);
        Ok(number)
    }

    /// How many sets of uvs the textures of a material lie in.
    pub(super) fn uv_sets(&self, material: usize) -> usize {
        self.materials.get(material).map_or(0, |look| look.uv_sets)
    }

    /// Writes all, in their order, into a document that has none.
    pub(super) fn push(&self, document: &mut Document) -> Result<(), ExportError> {
        self.textures.push(document)?;
        for (number, look) in self.materials.iter().enumerate() {
            let mut material = look.json.clone();
            material["name"] = format!("material{number}").into();
            document.push("materials", material);
        }
        self.extensions.iter().for_each(|name| document.use_extension(name));
        Ok(())
    }

    fn look(
        &mut self,
        images: Option<&Assets<Image>>,
        of: &StandardMaterial,
        has_normal_map: bool,
    ) -> Result<Look, String> {
        let transform = self.transform(&of.uv_transform)?;
        let normals = if of.flip_normal_map_y { Meaning::FlippedNormals } else { Meaning::Data };
        let mut uv_sets = 0;
        let mut texture = |handle: &Option<Handle<Image>>,
                           channel: &UvChannel,
                           meaning: Meaning,
                           what: &str|
         -> Result<Value, String> {
            let Some(handle) = handle else { return Ok(Value::Null) };
            let added = self.textures.add(images, handle, meaning);
            let number = added.map_err(|reason| format!("has a {what} texture that {reason}"))?;
            let set = match channel {
                UvChannel::Uv0 => 0,
                UvChannel::Uv1 => 1,
            };
            uv_sets = uv_sets.max(set + 1);
            let mut info = json!({ "index": number, "texCoord": set });
            if let Some(transform) = &transform {
                info["extensions"] = json!({ TRANSFORM: transform });
            }
            Ok(info)
        };
        let color = texture(&of.base_color_texture, &of.base_color_channel, Meaning::Color, "colour")?;
        let surface = texture(
            &of.metallic_roughness_texture,
            &of.metallic_roughness_channel,
            Meaning::Data,
            "roughness",
        )?;
        let normal = if has_normal_map {
            texture(&of.normal_map_texture, &of.normal_map_channel, normals, "normal")?
        } else {
            Value::Null
        };
        let occlusion = texture(&of.occlusion_texture, &of.occlusion_channel, Meaning::Data, "occlusion")?;
        let glows = of.emissive.red.max(of.emissive.green).max(of.emissive.blue) > 0.0;
        let emissive = if glows {
            texture(&of.emissive_texture, &of.emissive_channel, Meaning::Color, "emissive")?
        } else {
            Value::Null
        };

        let tint = of.base_color.to_linear();
        let tint = [tint.red, tint.green, tint.blue, tint.alpha].map(unit);
        let mut json = json!({
            "pbrMetallicRoughness": {
                "baseColorFactor": tint,
                "roughnessFactor": unit(of.perceptual_roughness),
                "metallicFactor": unit(of.metallic),
            },
        });
        let pbr = &mut json["pbrMetallicRoughness"];
        set(pbr, "baseColorTexture", color);
        set(pbr, "metallicRoughnessTexture", surface);
        set(&mut json, "normalTexture", normal);
        set(&mut json, "occlusionTexture", occlusion);
        set(&mut json, "emissiveTexture", emissive);
        if of.double_sided {
            json["doubleSided"] = true.into();
        }
        match of.alpha_mode {
            AlphaMode::Opaque => {}
            AlphaMode::Mask(cutoff) => {
                (json["alphaMode"], json["alphaCutoff"]) = ("MASK".into(), json!(unit(cutoff)));
            }
            // The others are ways to blend, of which the format knows one.
            _ => json["alphaMode"] = "BLEND".into(),
        }
        if glows {
            self.glow(&mut json, of.emissive);
        }
        if of.unlit {
            self.extend(&mut json, "KHR_materials_unlit", json!({}));
        }
        // Half is the reflectance that the format has.
        if (of.reflectance - 0.5).abs() > 1e-3 {
            self.extend(&mut json, "KHR_materials_ior", json!({ "ior": ior(of.reflectance) }));
        }
        Ok(Look { json, uv_sets })
    }

    fn extend(&mut self, material: &mut Value, name: &'static str, extension: Value) {
        material["extensions"][name] = extension;
        self.extensions.insert(name);
    }

    fn glow(&mut self, material: &mut Value, LinearRgba { red, green, blue, .. }: LinearRgba) {
        let strength = red.max(green).max(blue).clamp(1.0, f32::MAX);
        let factor = [red, green, blue].map(|part| unit(part / strength));
        material["emissiveFactor"] = json!(factor);
        if strength > 1.0 {
            let extension = json!({ "emissiveStrength": strength });
            self.extend(material, "KHR_materials_emissive_strength", extension);
        }
    }

    /// A transform of uvs, if it does anything.
    fn transform(&mut self, uv_transform: &Affine2) -> Result<Option<Value>, String> {
        if *uv_transform == Affine2::IDENTITY {
            return Ok(None);
        }
        let refused = || "has a `uv_transform` that is sheared, flat or not finite".to_owned();
        let area = uv_transform.matrix2.determinant();
        if !uv_transform.is_finite() || area == 0.0 {
            return Err(refused());
        }
        let (scale, angle, offset) = uv_transform.to_scale_angle_translation();
        let again = Affine2::from_scale_angle_translation(scale, angle, offset);
        let tolerance = 1e-4 * scale.abs().max_element();
        if !again.abs_diff_eq(*uv_transform, tolerance) {
            return Err(refused());
        }
        self.extensions.insert(TRANSFORM);
        // The format turns the other way, since v grows downwards.
        Ok(Some(json!({
            "offset": offset.to_array(), "rotation": -angle, "scale": scale.to_array(),
        })))
    }
}

const TRANSFORM: &str = "KHR_texture_transform";

/// Sets a field to what is there.
fn set(object: &mut Value, field: &str, value: Value) {
    if !value.is_null() {
        object[field] = value;
    }
}

/// A factor of the format; what is no number would be `null`, and is 0.
fn unit(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }
}

/// The index of refraction with Bevy's reflectance: what mirrors at normal incidence is `0.16 reflectance²` there and
/// `((n - 1) / (n + 1))²` here.
fn ior(reflectance: f32) -> f32 {
    let root = 0.4 * reflectance.clamp(0.0, 1.0);
    (1.0 + root) / (1.0 - root)
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use bevy::asset::RenderAssetUsages;
    use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};

    use super::*;
    use crate::export::texture::Pictures;

    fn look(material: StandardMaterial) -> Result<(Value, BTreeSet<&'static str>), String> {
        let mut looks = Looks::default();
        let Look { json, .. } = looks.look(None, &material, true)?;
        Ok((json, looks.extensions))
    }

    #[test]
    fn factors_and_extensions_are_those_of_the_material() {
        let (json, extensions) = look(StandardMaterial {
            base_color: Color::linear_rgba(0.5, 0.25, 0.125, 0.75),
            perceptual_roughness: 0.625,
            metallic: 0.0,
            reflectance: 1.0,
            emissive: LinearRgba::rgb(4.0, 2.0, 0.0),
            alpha_mode: AlphaMode::Mask(0.25),
            double_sided: true,
            ..default()
        })
        .unwrap();
        let expected = json!({
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.5, 0.25, 0.125, 0.75], "roughnessFactor": 0.625, "metallicFactor": 0.0,
            },
            "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25, "emissiveFactor": [1.0, 0.5, 0.0],
        });
        for (field, value) in expected.as_object().unwrap() {
            assert_eq!(json[field], *value, "{field}");
        }
        assert_eq!(json["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 4.0);
        // Mirrors 0.16 of what comes along the normal.
        let ior = json["extensions"]["KHR_materials_ior"]["ior"].as_f64().unwrap();
        assert!((((ior - 1.0) / (ior + 1.0)).powi(2) - 0.16).abs() < 1e-6, "{ior}");
        let used: Vec<_> = extensions.into_iter().collect();
        assert_eq!(used, ["KHR_materials_emissive_strength", "KHR_materials_ior"]);
        assert!(look(default()).unwrap().0["extensions"].is_null());
    }

    #[test]
    fn what_is_no_number_does_not_get_into_the_file() {
        let (json, _) = look(StandardMaterial {
            base_color: Color::linear_rgba(f32::NAN, 2.0, -1.0, 1.0),
            perceptual_roughness: f32::NAN,
            metallic: f32::NEG_INFINITY,
            reflectance: f32::NAN,
            emissive: LinearRgba::rgb(f32::INFINITY, f32::NAN, 1.0),
            ..default()
        })
        .unwrap();
        let pbr = &json["pbrMetallicRoughness"];
        assert_eq!(pbr["baseColorFactor"], json!([0.0, 1.0, 0.0, 1.0]));
        assert_eq!([&pbr["roughnessFactor"], &pbr["metallicFactor"]], [&json!(0.0), &json!(0.0)]);
        assert!(json["emissiveFactor"].as_array().unwrap().iter().all(Value::is_number), "{json}");
        let extensions = &json["extensions"];
        assert!(extensions["KHR_materials_emissive_strength"]["emissiveStrength"].is_number(), "{json}");
        assert!(extensions["KHR_materials_ior"].is_null(), "{json}");
    }

    #[test]
    fn a_texture_lies_where_it_lay() {
        let mut images = Assets::<Image>::default();
        let size = Extent3d { width: 1, height: 1, depth_or_array_layers: 1 };
        let usage = RenderAssetUsages::default();
        let format = TextureFormat::Rgba8UnormSrgb;
        let image = images.add(Image::new(size, TextureDimension::D2, vec![90, 8, 7, 255], format, usage));
        let uv_transform =
            Affine2::from_scale_angle_translation(Vec2::new(2.0, 3.0), FRAC_PI_2, Vec2::new(0.25, 0.5));
        let material = StandardMaterial { base_color_texture: Some(image), uv_transform, ..default() };
        let mut looks = Looks::default();
        let look = looks.look(Some(&images), &material, true).unwrap();
        assert_eq!(look.uv_sets, 1);
        let mut document = Document { path: "scene".into(), json: json!({}), bytes: Vec::new() };
        looks.materials.push(look);
        looks.push(&mut document).unwrap();
        assert_eq!(document.json["extensionsUsed"], json!(["KHR_texture_transform"]));
        let texture = document.source(Some(0), &mut Pictures::default()).unwrap().color_map.unwrap();
        let found = texture.texture_from_uv;
        assert!(found.abs_diff_eq(uv_transform, 1e-5), "{found:?} {uv_transform:?}");
    }

    #[test]
    fn a_normal_map_that_is_not_drawn_is_left_out() {
        let mut world = World::new();
        let mut images = Assets::<Image>::default();
        let size = Extent3d { width: 1, height: 1, depth_or_array_layers: 1 };
        let (usage, format) = (RenderAssetUsages::default(), TextureFormat::Rgba8Unorm);
        let image =
            images.add(Image::new(size, TextureDimension::D2, vec![90, 128, 250, 255], format, usage));
        let mut materials = Assets::<StandardMaterial>::default();
        let bumpy = materials.add(StandardMaterial { normal_map_texture: Some(image), ..default() });
        let smooth = materials.add(StandardMaterial::default());
        world.insert_resource(images);
        world.insert_resource(materials);
        let mut looks = Looks::default();
        let mut add =
            |of: &Handle<StandardMaterial>, tangents: bool| looks.add(&world, Some(of), tangents).unwrap();
        // Meshes with tangents and without may show the same material.
        assert_eq!([add(&bumpy, true), add(&bumpy, false), add(&bumpy, true)], [0, 1, 0]);
        assert_eq!([add(&smooth, true), add(&smooth, false)], [2, 2]);
        let normals = |number: usize| looks.materials[number].json["normalTexture"].is_object();
        assert_eq!([0, 1, 2].map(normals), [true, false, false]);
        assert_eq!([looks.uv_sets(0), looks.uv_sets(1)], [1, 0]);
    }

    #[test]
    fn what_the_format_cannot_say_is_named() {
        let sheared = Affine2 { matrix2: Mat2::from_cols(Vec2::X, Vec2::ONE), translation: Vec2::ZERO };
        let error = look(StandardMaterial { uv_transform: sheared, ..default() }).unwrap_err();
        assert!(error.contains("uv_transform"), "{error}");
        let gone = StandardMaterial { normal_map_texture: Some(Handle::default()), ..default() };
        let error = look(gone).unwrap_err();
        assert!(error.contains("normal texture that is not loaded"), "{error}");
    }
}
