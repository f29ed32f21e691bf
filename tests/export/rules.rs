//! Rules of glTF 2.0 and `KHR_materials_variants` that a written scene must keep, checked without any code of the library.
//!
//! Khronos Group 2021, *glTF 2.0 specification*, sections 3 and 4.

use std::collections::BTreeSet;

use serde_json::Value;

/// A scene, taken apart.
pub struct Glb {
    pub json: Value,
    pub bytes: Vec<u8>,
}

impl Glb {
    /// Takes a `.glb` apart by its lengths.
    pub fn parse(glb: &[u8]) -> Self {
        let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&glb[..4], word(4), word(8)), (b"glTF".as_slice(), 2, glb.len()));
        let json = word(12);
        assert!(&glb[16..20] == b"JSON" && json % 4 == 0);
        let binary = word(20 + json);
        assert!(&glb[24 + json..28 + json] == b"BIN\0" && binary % 4 == 0);
        assert_eq!(28 + json + binary, glb.len());
        Self { json: serde_json::from_slice(&glb[20..20 + json]).unwrap(), bytes: glb[28 + json..].to_vec() }
    }

    pub fn list(&self, name: &str) -> &[Value] {
        self.json[name].as_array().map_or(&[], Vec::as_slice)
    }

    /// The bytes of a buffer view.
    pub fn view(&self, index: usize) -> &[u8] {
        let view = &self.list("bufferViews")[index];
        let offset = count(&view["byteOffset"]);
        &self.bytes[offset..offset + count(&view["byteLength"])]
    }

    /// The bytes of an image.
    pub fn image(&self, index: usize) -> &[u8] {
        self.view(count(&self.list("images")[index]["bufferView"]))
    }

    /// The floats of an accessor, element by element.
    pub fn floats(&self, index: usize) -> Vec<Vec<f32>> {
        let accessor = &self.list("accessors")[index];
        assert_eq!(accessor["componentType"], 5126);
        let float = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap());
        self.elements(accessor).into_iter().map(|element| element.chunks(4).map(float).collect()).collect()
    }

    /// The numbers of an accessor, element by element, of whatever kind.
    pub fn any(&self, index: usize) -> Vec<Vec<f32>> {
        let accessor = &self.list("accessors")[index];
        if accessor["componentType"] == 5126 {
            return self.floats(index);
        }
        let size = component(accessor);
        let whole =
            |bytes: &[u8]| bytes.iter().rev().fold(0, |whole, &byte| whole << 8 | u32::from(byte)) as f32;
        self.elements(accessor).into_iter().map(|element| element.chunks(size).map(whole).collect()).collect()
    }

    /// The whole numbers of an accessor.
    fn indices(&self, index: usize) -> Vec<u32> {
        let whole = |bytes: &[u8]| bytes.iter().rev().fold(0, |whole, &byte| whole << 8 | u32::from(byte));
        self.elements(&self.list("accessors")[index]).into_iter().map(whole).collect()
    }

    fn elements(&self, accessor: &Value) -> Vec<&[u8]> {
        let bytes = &self.view(count(&accessor["bufferView"]))[count(&accessor["byteOffset"])..];
        let view = &self.list("bufferViews")[count(&accessor["bufferView"])];
        let size = component(accessor) * parts(accessor);
        let stride = view["byteStride"].as_u64().map_or(size, |stride| stride as usize);
        (0..count(&accessor["count"])).map(|i| &bytes[i * stride..i * stride + size]).collect()
    }

    /// Panics at the first rule that is broken.
    pub fn check(&self) {
        self.check_buffers();
        for (index, accessor) in self.list("accessors").iter().enumerate() {
            self.check_accessor(index, accessor);
        }
        for (index, image) in self.list("images").iter().enumerate() {
            assert!(image["uri"].is_null() && image["bufferView"].is_u64(), "images[{index}]");
            let is_kind = match image["mimeType"].as_str() {
                Some("image/png") => self.image(index).starts_with(b"\x89PNG"),
                Some("image/jpeg") => self.image(index).starts_with(b"\xff\xd8\xff"),
                _ => false,
            };
            assert!(is_kind, "images[{index}]");
        }
        for texture in self.list("textures") {
            assert!(count(&texture["source"]) < self.list("images").len());
            assert!(texture["sampler"].is_null() || count(&texture["sampler"]) < self.list("samplers").len());
        }
        for node in self.list("nodes") {
            assert!(node["mesh"].is_null() || count(&node["mesh"]) < self.list("meshes").len());
        }
        for (index, mesh) in self.list("meshes").iter().enumerate() {
            for primitive in mesh["primitives"].as_array().unwrap() {
                self.check_primitive(index, primitive);
            }
        }
        for (index, skin) in self.list("skins").iter().enumerate() {
            self.check_skin(index, skin);
        }
        for (index, animation) in self.list("animations").iter().enumerate() {
            self.check_animation(index, animation);
        }
        for (index, node) in self.list("nodes").iter().enumerate() {
            self.check_posed(index, node);
        }
        let used: BTreeSet<&str> = self.list("extensionsUsed").iter().filter_map(Value::as_str).collect();
        assert_eq!(used.len(), self.list("extensionsUsed").len(), "an extension is named twice");
        for name in extensions(&self.json) {
            assert!(used.contains(name), "`{name}` is not in `extensionsUsed`");
        }
    }

    fn check_buffers(&self) {
        let [buffer] = self.list("buffers") else { panic!("{} buffers", self.list("buffers").len()) };
        let length = count(&buffer["byteLength"]);
        assert!(buffer["uri"].is_null() && (length..length + 4).contains(&self.bytes.len()));
        for (index, view) in self.list("bufferViews").iter().enumerate() {
            let field = format!("bufferViews[{index}]");
            assert_eq!(view["buffer"], 0, "{field}");
            let length_of_view = count(&view["byteLength"]);
            assert!(length_of_view > 0, "{field} is empty");
            assert!(count(&view["byteOffset"]) + length_of_view <= length, "{field}");
            if let Some(stride) = view["byteStride"].as_u64() {
                assert!((4..=252).contains(&stride) && stride % 4 == 0, "{field}");
                assert_eq!(view["target"], 34_962, "{field}: only vertices have a stride");
            }
        }
    }

    fn check_accessor(&self, index: usize, accessor: &Value) {
        let field = format!("accessors[{index}]");
        let view = &self.list("bufferViews")[count(&accessor["bufferView"])];
        let (component, offset) = (component(accessor), count(&accessor["byteOffset"]));
        assert!((count(&view["byteOffset"]) + offset).is_multiple_of(component), "{field} is not aligned");
        assert!(offset % component == 0 && count(&accessor["count"]) > 0, "{field}");
        // Slices beyond the view panic.
        let elements = self.elements(accessor);
        if accessor["componentType"] == 5126 {
            let floats = self.floats(index);
            assert!(floats.iter().flatten().all(|value| value.is_finite()), "{field}");
            let bounds: [(&str, fn(f32, f32) -> f32); 2] = [("min", f32::min), ("max", f32::max)];
            for (name, pick) in bounds {
                let Some(told) = accessor[name].as_array() else { continue };
                for (part, told) in told.iter().enumerate() {
                    let found = floats.iter().map(|value| value[part]).reduce(pick).unwrap();
                    assert_eq!(told.as_f64().unwrap(), f64::from(found), "{field}.{name}");
                }
            }
        }
        assert_eq!(elements.len(), count(&accessor["count"]));
    }

    fn check_skin(&self, index: usize, skin: &Value) {
        let field = format!("skins[{index}]");
        let joints = skin["joints"].as_array().unwrap();
        assert!(!joints.is_empty(), "{field}");
        assert!(joints.iter().all(|joint| count(joint) < self.list("nodes").len()), "{field}");
        if skin["inverseBindMatrices"].is_u64() {
            let matrices = &self.list("accessors")[count(&skin["inverseBindMatrices"])];
            assert_eq!(matrices["type"], "MAT4", "{field}");
            assert_eq!(matrices["componentType"], 5126, "{field}");
            assert!(count(&matrices["count"]) >= joints.len(), "{field}");
        }
    }

    fn check_animation(&self, index: usize, animation: &Value) {
        let field = format!("animations[{index}]");
        let samplers = animation["samplers"].as_array().unwrap();
        for channel in animation["channels"].as_array().unwrap() {
            let sampler = &samplers[count(&channel["sampler"])];
            assert!(count(&channel["target"]["node"]) < self.list("nodes").len(), "{field}");
            let times = self.floats(count(&sampler["input"]));
            assert!(times.is_sorted_by(|a, b| a[0] < b[0]) && times[0][0] >= 0.0, "{field}");
            let told = &self.list("accessors")[count(&sampler["input"])];
            assert!(told["min"].is_array() && told["max"].is_array(), "{field}");
            let values = count(&self.list("accessors")[count(&sampler["output"])]["count"]);
            assert!(values >= times.len() && values.is_multiple_of(times.len()), "{field}");
        }
    }

    /// What a node says about joints and morph targets fits the mesh that it shows.
    fn check_posed(&self, index: usize, node: &Value) {
        let field = format!("nodes[{index}]");
        if node["mesh"].is_null() {
            assert!(node["skin"].is_null() && node["weights"].is_null(), "{field}");
            return;
        }
        let mesh = &self.list("meshes")[count(&node["mesh"])];
        let primitives = mesh["primitives"].as_array().unwrap();
        let targets: Vec<usize> =
            primitives.iter().map(|primitive| primitive["targets"].as_array().map_or(0, Vec::len)).collect();
        assert!(targets.iter().all(|&number| number == targets[0]), "{field}: {targets:?}");
        for weights in [&node["weights"], &mesh["weights"]] {
            assert!(
                weights.as_array().is_none_or(|weights| weights.len() == targets[0]),
                "{field}: {weights}"
            );
        }
        let Some(skin) = node["skin"].as_u64() else { return };
        let joints = self.list("skins")[skin as usize]["joints"].as_array().unwrap().len();
        for primitive in primitives {
            let attributes = &primitive["attributes"];
            let weights = self.floats(count(&attributes["WEIGHTS_0"]));
            for weights in weights {
                assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-4, "{field}: {weights:?}");
            }
            let accessor = &self.list("accessors")[count(&attributes["JOINTS_0"])];
            assert_eq!(accessor["type"], "VEC4", "{field}");
            let size = component(accessor);
            for joint in self.elements(accessor).into_iter().flat_map(|element| element.chunks(size)) {
                let number = joint.iter().rev().fold(0, |whole, &byte| whole << 8 | usize::from(byte));
                assert!(number < joints, "{field}: joint {number}");
            }
        }
    }

    fn check_primitive(&self, mesh: usize, primitive: &Value) {
        let field = format!("meshes[{mesh}]");
        let attributes = primitive["attributes"].as_object().unwrap();
        let accessor = |index: &Value| &self.list("accessors")[count(index)];
        let vertices = count(&accessor(&attributes["POSITION"])["count"]);
        for (name, index) in attributes {
            let values = accessor(index);
            assert_eq!(count(&values["count"]), vertices, "{field}.{name}");
            let view = &self.list("bufferViews")[count(&values["bufferView"])];
            let stride =
                view["byteStride"].as_u64().map_or(component(values) * parts(values), |s| s as usize);
            assert!(stride.is_multiple_of(4), "{field}.{name}: vertices begin at whole words");
            assert!(view["target"].is_null() || view["target"] == 34_962, "{field}.{name}");
        }
        for target in primitive["targets"].as_array().into_iter().flatten() {
            for (name, index) in target.as_object().unwrap() {
                assert!(
                    attributes.contains_key(name),
                    "{field}: a target moves `{name}`, which is not there"
                );
                let values = accessor(index);
                assert_eq!(count(&values["count"]), vertices, "{field}.{name}");
                assert_eq!(values["type"], "VEC3", "{field}.{name}");
                let bounded = values["min"].is_array() && values["max"].is_array();
                assert!(bounded || name != "POSITION", "{field}: a target without bounds");
            }
        }
        let position = accessor(&attributes["POSITION"]);
        assert!(position["min"].is_array() && position["max"].is_array(), "{field}.POSITION has no bounds");
        let sets = (0..8).take_while(|set| attributes.contains_key(&format!("TEXCOORD_{set}"))).count();
        let all = attributes.keys().filter(|name| name.starts_with("TEXCOORD_")).count();
        assert_eq!(sets, all, "{field}: `TEXCOORD_` skip a number");
        if let Some(tangents) = attributes.get("TANGENT") {
            assert!(attributes.contains_key("NORMAL"), "{field}: tangents without normals");
            for tangent in self.floats(count(tangents)) {
                let length = tangent[..3].iter().map(|part| part * part).sum::<f32>().sqrt();
                assert!((length - 1.0).abs() < 5e-4 && tangent[3].abs() == 1.0, "{field}: {tangent:?}");
            }
        }
        if primitive["indices"].is_u64() {
            let corners = accessor(&primitive["indices"]);
            let view = &self.list("bufferViews")[count(&corners["bufferView"])];
            assert!(view["byteStride"].is_null(), "{field}.indices");
            assert!(view["target"].is_null() || view["target"] == 34_963, "{field}.indices");
            assert_eq!(corners["type"], "SCALAR");
            let indices = self.indices(count(&primitive["indices"]));
            let restart = u32::MAX >> (32 - 8 * component(corners));
            assert!(
                indices.iter().all(|&index| index < vertices as u32 && index != restart),
                "{field}.indices"
            );
            assert!(
                primitive["mode"].as_u64().unwrap_or(4) != 4 || indices.len().is_multiple_of(3),
                "{field}.indices"
            );
        }
        let mut materials: Vec<usize> =
            primitive["material"].as_u64().map(|m| m as usize).into_iter().collect();
        let extension = &primitive["extensions"]["KHR_materials_variants"];
        let variants = &self.json["extensions"]["KHR_materials_variants"]["variants"];
        let variants = variants.as_array().map_or(0, Vec::len);
        let mut seen = BTreeSet::new();
        for mapping in extension["mappings"].as_array().into_iter().flatten() {
            materials.push(count(&mapping["material"]));
            let named = mapping["variants"].as_array().unwrap();
            assert!(!named.is_empty(), "{field}: a mapping without variants");
            for variant in named {
                assert!(
                    count(variant) < variants && seen.insert(count(variant)),
                    "{field}: variant {variant}"
                );
            }
        }
        for material in materials {
            let mut sets_used = Vec::new();
            texture_sets(&self.list("materials")[material], self.list("textures").len(), &mut sets_used);
            assert!(sets_used.iter().all(|&set| set < sets), "{field}: material {material}: {sets_used:?}");
        }
    }
}

pub fn count(value: &Value) -> usize {
    if value.is_null() { 0 } else { value.as_u64().unwrap() as usize }
}

fn component(accessor: &Value) -> usize {
    match accessor["componentType"].as_u64().unwrap() {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        5125 | 5126 => 4,
        other => panic!("componentType {other}"),
    }
}

fn parts(accessor: &Value) -> usize {
    match accessor["type"].as_str().unwrap() {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        "MAT4" => 16,
        other => panic!("type {other}"),
    }
}

/// The uv sets of all textures that a material names, which are there.
fn texture_sets(value: &Value, textures: usize, sets: &mut Vec<usize>) {
    for (name, field) in value.as_object().into_iter().flatten().filter(|(name, _)| *name != "extras") {
        if name.ends_with("Texture") {
            assert!(count(&field["index"]) < textures, "{name}");
            sets.push(count(&field["texCoord"]));
        } else {
            texture_sets(field, textures, sets);
        }
    }
}

/// The names of all extensions that anything has.
fn extensions(value: &Value) -> BTreeSet<&str> {
    match value {
        Value::Array(all) => all.iter().flat_map(extensions).collect(),
        Value::Object(fields) => {
            let own = fields.get("extensions").and_then(Value::as_object);
            let own = own.into_iter().flat_map(|all| all.keys().map(String::as_str));
            let others = fields.iter().filter(|(name, _)| *name != "extras");
            own.chain(others.flat_map(|(_, field)| extensions(field))).collect()
        }
        _ => BTreeSet::new(),
    }
}
