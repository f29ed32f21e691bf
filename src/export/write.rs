//! The scene, with a wet form of each of its materials.
//!
//! `KHR_materials_variants` tells dry from wet. What reads no variants shows the wet form. A mesh that several nodes show becomes
//! as many meshes, since each has rain of its own; what their vertices are is there once.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Map, Value, json};

use super::ExportError;
use super::document::{Document, number};
use super::material::WetTextures;
use super::scene::Place;
use super::shape::Shape;

const VARIANTS: &str = "KHR_materials_variants";

/// Writes surfaces into a document.
pub(super) struct Writer {
    pub(super) document: Document,
    /// As they were in the file.
    meshes: Vec<Value>,
    /// The mesh of a node, once it has its own.
    of_nodes: BTreeMap<usize, usize>,
    /// Meshes that nobody else may take.
    taken: BTreeSet<usize>,
    /// Attributes and corners of primitives that were cut.
    cut: BTreeMap<(usize, usize), (Value, usize)>,
    /// For primitives that have none.
    plain_material: Option<usize>,
    pub(super) sampler: usize,
    /// Numbers of the dry and the wet variant.
    variants: [usize; 2],
}

impl Writer {
    /// Of surfaces at these places.
    pub(super) fn new(mut document: Document, places: &[&Place]) -> Self {
        let meshes = document.list("meshes").to_vec();
        let wet: BTreeSet<_> = places.iter().map(|place| place.node).collect();
        // A mesh that is also shown where no rain falls stays as it is.
        let nodes = document.list("nodes").iter().enumerate();
        let elsewhere = nodes.filter(|(node, _)| !wet.contains(node));
        let taken = elsewhere.filter_map(|(_, entry)| number(&entry["mesh"])).collect();
        let linear_mips = json!({ "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497 });
        let sampler = document.push("samplers", linear_mips);
        document.use_extension(VARIANTS);
        let first = add_variants(&mut document.json);
        Self {
            document,
            meshes,
            of_nodes: BTreeMap::new(),
            taken,
            cut: BTreeMap::new(),
            plain_material: None,
            sampler,
            variants: [first, first + 1],
        }
    }

    /// The dry material of a place.
    pub(super) fn dry_material(&mut self, place: &Place) -> usize {
        let primitive = &self.meshes[place.mesh]["primitives"][place.primitive];
        number(&primitive["material"]).unwrap_or_else(|| {
            let document = &mut self.document;
            *self.plain_material.get_or_insert_with(|| document.push("materials", json!({ "name": "plain" })))
        })
    }

    /// Gives a place its wet form.
    pub(super) fn add(
        &mut self,
        place: &Place,
        shape: &Shape,
        textures: WetTextures,
        amounts: Value,
    ) -> Result<(), ExportError> {
        let dry = self.dry_material(place);
        let set = shape.map_set();
        let wet = self.document.push_wet_material(dry, &place.name, textures, set, amounts)?;
        let cut = match &shape.cut {
            Some(_) => Some(self.cut_attributes(place, shape)?),
            None => None,
        };
        let keeps_tangents = textures.normal.is_none() || self.normal_set(dry) == set;
        let mesh = self.mesh_of(place);
        // The dry form needs none: they may serve the wet one.
        let own_tangents = cut.is_none()
            && !keeps_tangents
            && !self.has_dry_normals(&self.document.json["meshes"][mesh]["primitives"][place.primitive]);
        let tangents = own_tangents.then(|| shape.map_tangents()).flatten();
        let tangents = tangents.map(|tangents| self.document.push_floats(&tangents));
        let primitive = &mut self.document.json["meshes"][mesh]["primitives"][place.primitive];
        let Some(fields) = primitive.as_object_mut() else { return Ok(()) };
        if let Some((changed, corners)) = cut {
            for (name, value) in changed.as_object().into_iter().flatten() {
                fields.insert(name.clone(), value.clone());
            }
            fields.insert("indices".into(), corners.into());
            fields.insert("mode".into(), 4.into());
        } else if !keeps_tangents {
            forget_tangents(fields);
            if let Some(tangents) = tangents
                && let Some(attributes) = fields.get_mut("attributes").and_then(Value::as_object_mut)
            {
                attributes.insert("TANGENT".into(), tangents.into());
            }
        }
        fields.insert("material".into(), wet.into());
        let [dry_variant, wet_variant] = self.variants;
        let mappings = [
            json!({ "material": dry, "variants": [dry_variant] }),
            json!({ "material": wet, "variants": [wet_variant] }),
        ];
        let extension = object(fields, "extensions").and_then(|all| object(all, VARIANTS));
        if let Some(list) = extension.and_then(|extension| list(extension, "mappings")) {
            list.extend(mappings);
        }
        Ok(())
    }

    /// The mesh of a node, for itself.
    fn mesh_of(&mut self, place: &Place) -> usize {
        if let Some(&mesh) = self.of_nodes.get(&place.node) {
            return mesh;
        }
        let mesh = if self.taken.insert(place.mesh) {
            place.mesh
        } else {
            let mut copy = self.meshes[place.mesh].clone();
            if let Some(name) = copy["name"].as_str() {
                copy["name"] = format!("{name}_node{}", place.node).into();
            }
            let mesh = self.document.push("meshes", copy);
            self.document.json["nodes"][place.node]["mesh"] = mesh.into();
            mesh
        };
        self.of_nodes.insert(place.node, mesh);
        mesh
    }

    /// Attributes and morph targets of a primitive for the vertices that it was cut into, and its corners.
    fn cut_attributes(&mut self, place: &Place, shape: &Shape) -> Result<(Value, usize), ExportError> {
        let key = (place.mesh, place.primitive);
        if let Some(done) = self.cut.get(&key) {
            return Ok(done.clone());
        }
        let Some(cut) = &shape.cut else { return Ok((json!({}), 0)) };
        let primitive = self.meshes[place.mesh]["primitives"][place.primitive].clone();
        let field = format!("meshes[{}].primitives[{}]", place.mesh, place.primitive);
        let old_count = number(&primitive["attributes"]["POSITION"]);
        let old_count = old_count.map(|accessor| self.document.elements(accessor)).transpose()?;
        let old_count = old_count.map_or(0, |elements| elements.count);
        let mut gather =
            |attributes: &Value| gathered(&mut self.document, &field, attributes, &cut.vertices, old_count);
        let mut attributes = gather(&primitive["attributes"])?;
        let mut targets = Vec::new();
        for target in primitive["targets"].as_array().into_iter().flatten() {
            let mut target = gather(target)?;
            // It moves tangents that are not there any more.
            target.remove("TANGENT");
            targets.push(Value::from(target));
        }
        let uvs: Vec<[f32; 2]> = cut.uvs.iter().map(|uv| uv.to_array()).collect();
        let name = format!("TEXCOORD_{}", shape.map_set());
        attributes.insert(name, self.document.push_floats(&uvs).into());
        // One set of tangents cannot serve normal maps in two sets of uvs; then a viewer makes those that it needs.
        attributes.remove("TANGENT");
        if !self.has_dry_normals(&primitive)
            && let Some(tangents) = shape.map_tangents()
        {
            attributes.insert("TANGENT".into(), self.document.push_floats(&tangents).into());
        }
        let corners = self.document.push_corners(&shape.corners);
        let mut changed = json!({ "attributes": attributes });
        if !targets.is_empty() {
            changed["targets"] = targets.into();
        }
        self.cut.insert(key, (changed.clone(), corners));
        Ok((changed, corners))
    }

    /// The uvs for which a primitive with this material has tangents, if it has any.
    fn normal_set(&self, material: usize) -> usize {
        let material = self.document.list("materials").get(material).unwrap_or(&Value::Null);
        number(&material["normalTexture"]["texCoord"]).unwrap_or(0)
    }

    /// Whether any dry material that a primitive may show has a normal map.
    fn has_dry_normals(&self, primitive: &Value) -> bool {
        let mappings = primitive["extensions"][VARIANTS]["mappings"].as_array().into_iter().flatten();
        let others = mappings.map(|mapping| &mapping["material"]);
        let mut materials = others.chain([&primitive["material"]]).filter_map(number);
        materials.any(|material| {
            let material = self.document.list("materials").get(material).unwrap_or(&Value::Null);
            let coat = &material["extensions"]["KHR_materials_clearcoat"]["clearcoatNormalTexture"];
            material["normalTexture"].is_object() || coat.is_object()
        })
    }
}

/// Takes tangents out of a primitive: a reader makes them for the uvs of each normal map.
fn forget_tangents(primitive: &mut Map<String, Value>) {
    let targets = primitive.get_mut("targets").and_then(Value::as_array_mut);
    for target in targets.into_iter().flatten().filter_map(Value::as_object_mut) {
        target.remove("TANGENT");
    }
    if let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) {
        attributes.remove("TANGENT");
    }
}

/// Attributes for these vertices of `count`; the numbers of their new accessors.
fn gathered(
    document: &mut Document,
    field: &str,
    attributes: &Value,
    vertices: &[u32],
    count: usize,
) -> Result<Map<String, Value>, ExportError> {
    let mut gathered = Map::new();
    for (name, accessor) in attributes.as_object().into_iter().flatten() {
        let elements = number(accessor).map(|accessor| document.elements(accessor)).transpose()?;
        let Some(elements) = elements.filter(|elements| elements.count == count) else {
            return Err(document.content(field, format!("has not as many `{name}` as `POSITION`")));
        };
        let accessor = document.push_elements(&elements.gathered(vertices));
        gathered.insert(name.clone(), accessor.into());
    }
    Ok(gathered)
}

/// Adds a dry and a wet variant; the number of the dry one.
fn add_variants(root: &mut Value) -> usize {
    let extension = root.as_object_mut().and_then(|root| object(root, "extensions"));
    let extension = extension.and_then(|all| object(all, VARIANTS));
    let Some(variants) = extension.and_then(|all| list(all, "variants")) else { return 0 };
    variants.extend([json!({ "name": "dry" }), json!({ "name": "wet" })]);
    variants.len() - 2
}

/// A field that is an object, made one if it is none.
fn object<'v>(parent: &'v mut Map<String, Value>, key: &str) -> Option<&'v mut Map<String, Value>> {
    let field = parent.entry(key).or_insert(Value::Null);
    if !field.is_object() {
        *field = json!({});
    }
    field.as_object_mut()
}

/// A field that is a list, made one if it is none.
fn list<'v>(parent: &'v mut Map<String, Value>, key: &str) -> Option<&'v mut Vec<Value>> {
    let field = parent.entry(key).or_insert(Value::Null);
    if !field.is_array() {
        *field = json!([]);
    }
    field.as_array_mut()
}

#[cfg(test)]
mod tests {
    use bevy::math::Affine3A;

    use super::*;
    use crate::export::shape::tests::square;

    fn place(node: usize) -> Place {
        let name = format!("place{node}");
        Place { name, node, mesh: 0, primitive: 0, world_from_mesh: Affine3A::IDENTITY }
    }

    #[test]
    fn what_gets_no_rain_keeps_its_mesh_and_tangents_that_do_not_fit_go() {
        let json = json!({
            "nodes": [{ "mesh": 0 }, { "mesh": 0 }, { "mesh": 0 }],
            "materials": [{ "normalTexture": { "index": 0, "texCoord": 1 } }],
            "meshes": [{ "name": "slab", "primitives": [{
                "attributes": { "POSITION": 0, "TANGENT": 1 },
                "targets": [{ "POSITION": 2, "TANGENT": 3 }],
                "material": 0,
            }] }],
        });
        let document = Document { path: "scene.glb".into(), json, bytes: Vec::new() };
        let before = document.list("meshes")[0].clone();
        let places = [place(0), place(2)];
        let mut writer = Writer::new(document, &[&places[0], &places[1]]);
        let textures = |normal| WetTextures { color: 4, surface: 5, normal };
        // Maps lie over the first uvs, but the tangents are those of the second.
        writer.add(&places[0], &square(1.0), textures(Some(6)), json!({})).unwrap();
        writer.add(&places[1], &square(1.0), textures(None), json!({})).unwrap();
        let (nodes, meshes) = (writer.document.list("nodes"), writer.document.list("meshes"));
        assert_eq!(
            (&nodes[0]["mesh"], &nodes[1]["mesh"], &nodes[2]["mesh"]),
            (&json!(1), &json!(0), &json!(2))
        );
        assert_eq!((meshes.len(), &meshes[0], &meshes[1]["name"]), (3, &before, &json!("slab_node0")));
        let primitive = |mesh: usize| &meshes[mesh]["primitives"][0];
        assert_eq!(primitive(1)["attributes"], json!({ "POSITION": 0 }));
        assert_eq!(primitive(1)["targets"], json!([{ "POSITION": 2 }]));
        assert_eq!(primitive(2)["attributes"], before["primitives"][0]["attributes"]);
        assert_eq!((&primitive(1)["material"], &primitive(2)["material"]), (&json!(1), &json!(2)));
    }
}
