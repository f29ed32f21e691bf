//! Checking every value, and naming the first that is wrong.

use std::collections::BTreeSet;
use std::fmt::Display;

use bevy::math::{Vec2, Vec3};

use super::{
    EmitterSpec, LoadedScenario, MapBudgetSpec, MaterialSpec, MeshSpec, Scenario, ScenarioError, SceneSpec,
    SurfaceSpec, SurfaceTextureSpec, TextureSpec,
};
use crate::clock::WeatheringClock;
use crate::emitter::{EmitterShape, Flow};
use crate::material::OutOfRange;
use crate::overlay::{TILE_SIZE, Weatherable};
use crate::particle::Lifespan;
use crate::weather::Weather;

/// The strongest wind, m/s.
const FASTEST: f32 = 1000.0;

/// The farthest coordinate: beyond it an f32 is coarser than a drop.
pub(super) const FAR: f32 = 1.0e5;

/// The first number of the weather that is out of its range.
pub(crate) fn check_weather(weather: &Weather) -> Result<(), OutOfRange> {
    let Weather { temperature_c, humidity, wind, sun_direction, sun_w_per_m2, drying_speed } = *weather;
    let ranges = [
        ("temperature_c", temperature_c, -40.0, 60.0),
        ("humidity", humidity, 0.0, 1.0),
        ("sun_w_per_m2", sun_w_per_m2, 0.0, 1400.0),
        ("drying_speed", drying_speed, 0.0, 1.0e5),
        ("wind.x", wind.x, -FASTEST, FASTEST),
        ("wind.y", wind.y, -FASTEST, FASTEST),
        ("wind.z", wind.z, -FASTEST, FASTEST),
        ("sun_direction.x", sun_direction.x, -FAR, FAR),
        ("sun_direction.y", sun_direction.y, -FAR, FAR),
        ("sun_direction.z", sun_direction.z, -FAR, FAR),
    ];
    // Written so that NaN fails.
    let wrong = ranges.into_iter().find(|(_, value, least, most)| !(value >= least && value <= most));
    match wrong {
        Some((field, value, least, most)) => Err(OutOfRange { field, value, least, most }),
        None => Ok(()),
    }
}

/// A product of absurd counts is as large as can be, not small.
fn product(factors: [u64; 4]) -> u64 {
    factors.into_iter().fold(1, u64::saturating_mul)
}

impl LoadedScenario {
    /// Checks every value and that every named file exists.
    ///
    /// # Errors
    /// [`ScenarioError`] for the first thing wrong.
    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        let scenario = &self.scenario;
        self.range("tick_hz", f64::from(scenario.tick_hz), 1.0, f64::from(WeatheringClock::MAX_HZ))?;
        self.positive("seconds", scenario.seconds, Scenario::MAX_SECONDS)?;
        self.vector("gravity", scenario.gravity, 1000.0)?;
        self.vector("wind", scenario.wind, FASTEST)?;
        let most = f64::from(Scenario::MAX_PARTICLES);
        self.range("max_particles", f64::from(scenario.max_particles), 1.0, most)?;
        if let Some(MapBudgetSpec { mib, texel_mm }) = scenario.map_budget {
            self.positive("map_budget.mib", mib, MapBudgetSpec::MAX_MIB)?;
            if let Some(texel_mm) = texel_mm {
                self.positive("map_budget.texel_mm", texel_mm, MapBudgetSpec::MAX_TEXEL_MM)?;
            }
        }
        self.validate_view()?;
        // Wind and direction of the sun have been checked by their own names.
        check_weather(&scenario.weather()).map_err(|wrong| self.out_of_range("weather", wrong))?;
        if scenario.materials.len() > Scenario::MAX_MATERIALS {
            let expected = format!("at most {} (MAX_MATERIALS)", Scenario::MAX_MATERIALS);
            return Err(self.value("materials", scenario.materials.len(), expected));
        }
        for (name, material) in &scenario.materials {
            self.validate_material(&format!("materials.{name}"), material)?;
        }
        if scenario.surfaces.len() > Scenario::MAX_SURFACES {
            let expected = format!("at most {} (MAX_SURFACES)", Scenario::MAX_SURFACES);
            return Err(self.value("surfaces", scenario.surfaces.len(), expected));
        }
        let mut names = BTreeSet::new();
        let (mut triangles, mut texels) = (0, 0);
        for (index, surface) in scenario.surfaces.iter().enumerate() {
            let field = format!("surfaces[{index}]");
            triangles += self.validate_surface(&field, surface)?;
            texels += u64::from(surface.maps.texels()).pow(2);
            if let Some(map) = &surface.wet_map {
                self.resolve(&format!("{field}.wet_map.map"), &map.map)?;
                self.positive(&format!("{field}.wet_map.seconds"), map.seconds, Scenario::MAX_SECONDS)?;
                self.not_negative(&format!("{field}.wet_map.t_fill"), map.t_fill, 1.0)?;
                self.not_negative(&format!("{field}.wet_map.start"), map.start, Scenario::MAX_SECONDS)?;
            }
            if !names.insert(&surface.name) {
                return Err(self.value(format!("{field}.name"), &surface.name, "unique"));
            }
        }
        // Names of scenes, which end where a dot is, and so those of their surfaces, are unique.
        for (index, scene) in scenario.scenes.iter().enumerate() {
            self.validate_scene(&format!("scenes[{index}]"), scene)?;
            texels += scene.parts().map(|(_, maps)| u64::from(maps.texels()).pow(2)).sum::<u64>();
        }
        if triangles > Scenario::MAX_ALL_TRIANGLES {
            let expected = format!("at most {} (MAX_ALL_TRIANGLES)", Scenario::MAX_ALL_TRIANGLES);
            return Err(self.value("surfaces", format!("of {triangles} triangles"), expected));
        }
        if texels > Scenario::MAX_TEXELS {
            let expected = format!("at most {} (MAX_TEXELS)", Scenario::MAX_TEXELS);
            return Err(self.value("surfaces", format!("of {texels} texels"), expected));
        }
        if scenario.emitters.len() > Scenario::MAX_EMITTERS {
            let expected = format!("at most {} (MAX_EMITTERS)", Scenario::MAX_EMITTERS);
            return Err(self.value("emitters", scenario.emitters.len(), expected));
        }
        for (index, emitter) in scenario.emitters.iter().enumerate() {
            self.validate_emitter(&format!("emitters[{index}]"), emitter)?;
        }
        self.validate_events()
    }

    fn validate_view(&self) -> Result<(), ScenarioError> {
        let Scenario { camera, sun, environment, .. } = &self.scenario;
        self.range("camera.fov_deg", f64::from(camera.fov_deg), 1.0, 170.0)?;
        self.range("camera.ev100", f64::from(camera.ev100), -10.0, 30.0)?;
        self.times("camera.keys", camera.keys.iter().map(|key| key.t))?;
        for (index, key) in camera.keys.iter().enumerate() {
            self.look(&format!("camera.keys[{index}]"), "eye", key.eye, key.target)?;
        }
        self.vector("sun.direction", sun.direction, FAR)?;
        if sun.direction.length() < 1.0e-6 {
            return Err(self.value("sun.direction", sun.direction, "longer than 0"));
        }
        self.not_negative("sun.illuminance", sun.illuminance, 1.0e6)?;
        self.color("sun.color", sun.color)?;
        if let Some(environment) = environment {
            self.resolve("environment.map", &environment.map)?;
            self.not_negative("environment.intensity", environment.intensity, 1.0e6)?;
            self.range("environment.turn_deg", f64::from(environment.turn_deg), -3600.0, 3600.0)?;
        }
        Ok(())
    }

    fn validate_material(&self, field: &str, material: &MaterialSpec) -> Result<(), ScenarioError> {
        self.color(&format!("{field}.color"), material.color)?;
        for (name, value) in [
            ("roughness", material.roughness),
            ("reflectance", material.reflectance),
            ("metallic", material.metallic),
            ("translucency", material.translucency),
        ] {
            self.not_negative(&format!("{field}.{name}"), value, 1.0)?;
        }
        for (name, checked) in [("porous", material.porous.validate()), ("water", material.water.validate())]
        {
            checked.map_err(|wrong| self.out_of_range(&format!("{field}.{name}"), wrong))?;
        }
        self.positive(&format!("{field}.tiles.x"), material.tiles.x, 1.0e4)?;
        self.positive(&format!("{field}.tiles.y"), material.tiles.y, 1.0e4)?;
        if let SurfaceTextureSpec::File(path) = &material.surface {
            self.resolve(&format!("{field}.surface"), path)?;
        }
        if material.surface == SurfaceTextureSpec::Relief
            && !matches!(material.texture, TextureSpec::Stone { .. })
        {
            return Err(self.value(format!("{field}.surface"), "Relief", "of a `texture` that is `Stone`"));
        }
        if let Some(path) = &material.wet_color {
            self.resolve(&format!("{field}.wet_color"), path)?;
        }
        match &material.texture {
            TextureSpec::Plain => {}
            TextureSpec::Photo(path) => {
                self.resolve(&format!("{field}.texture"), path)?;
            }
            TextureSpec::Stone { size, .. } => {
                self.range(&format!("{field}.texture.size"), f64::from(*size), 16.0, 4096.0)?;
            }
        }
        Ok(())
    }

    /// Also how many triangles it is made of; 0 if they come from a file.
    fn validate_surface(&self, field: &str, surface: &SurfaceSpec) -> Result<u64, ScenarioError> {
        // It becomes part of file names.
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if surface.name.is_empty() || surface.name.len() > 64 || !surface.name.chars().all(plain) {
            let expected = "1 to 64 letters, digits, `_` or `-`";
            return Err(self.value(format!("{field}.name"), &surface.name, expected));
        }
        if !self.scenario.materials.contains_key(&surface.material) {
            let expected = "the name of a material";
            return Err(self.value(format!("{field}.material"), &surface.material, expected));
        }
        self.vector(&format!("{field}.position"), surface.position, FAR)?;
        self.vector(&format!("{field}.rotation_deg"), surface.rotation_deg, 3600.0)?;
        self.vector(&format!("{field}.scale"), surface.scale, FAR)?;
        if surface.scale.abs().min_element() < 1.0e-6 {
            return Err(self.value(format!("{field}.scale"), surface.scale, "at least 0.000001 per axis"));
        }
        self.validate_maps(field, &surface.maps)?;
        let triangles = match &surface.mesh {
            MeshSpec::Ground { size, cells }
            | MeshSpec::Road { size, cells, .. }
            | MeshSpec::Cloth { size, cells } => {
                self.positive(&format!("{field}.mesh.size.x"), size.x, FAR)?;
                self.positive(&format!("{field}.mesh.size.y"), size.y, FAR)?;
                product([2, u64::from(cells.x), u64::from(cells.y), 1])
            }
            MeshSpec::Sphere { radius, sectors, stacks } | MeshSpec::Rock { radius, sectors, stacks, .. } => {
                self.positive(&format!("{field}.mesh.radius"), *radius, FAR)?;
                product([2, u64::from(*sectors), u64::from(*stacks), 1])
            }
            MeshSpec::BasRelief { size, depth, cells, .. } => {
                self.positive(&format!("{field}.mesh.size.x"), size.x, FAR)?;
                self.positive(&format!("{field}.mesh.size.y"), size.y, FAR)?;
                self.positive(&format!("{field}.mesh.depth"), *depth, FAR)?;
                product([1, 2, u64::from(cells.x) + 12, u64::from(cells.y) + 12])
            }
            MeshSpec::Stair { width, steps, rise, going, hollow, cells, .. } => {
                for (name, value) in [("width", width), ("rise", rise), ("going", going)] {
                    self.positive(&format!("{field}.mesh.{name}"), *value, FAR)?;
                }
                self.positive(&format!("{field}.mesh.hollow"), *hollow, rise / 4.0)?;
                let rows = u64::from(cells.y) + u64::from(cells.y.div_ceil(2)) + 9;
                product([2, u64::from(*steps), u64::from(cells.x) + 2, rows])
            }
            MeshSpec::Roof { size, pitch_deg, tiles, cells } => {
                self.positive(&format!("{field}.mesh.size.x"), size.x, FAR)?;
                self.positive(&format!("{field}.mesh.size.y"), size.y, FAR)?;
                self.positive(&format!("{field}.mesh.pitch_deg"), *pitch_deg, 59.99)?;
                let rows = u64::from(tiles.y) * (u64::from(*cells) + 1);
                product([4, u64::from(tiles.x), u64::from(*cells) + 4, rows + 4])
            }
            MeshSpec::Car { length, cells } => {
                self.positive(&format!("{field}.mesh.length"), *length, FAR)?;
                product([28, u64::from(*cells), u64::from(*cells), 1])
            }
            MeshSpec::Vase { height, segments, rings } | MeshSpec::Flowerpot { height, segments, rings } => {
                self.positive(&format!("{field}.mesh.height"), *height, FAR)?;
                product([2, u64::from(*segments), u64::from(*rings), 1])
            }
            MeshSpec::File(path) => {
                self.validate_gltf(&format!("{field}.mesh"), path)?;
                return Ok(0);
            }
        };
        if triangles == 0 || triangles > Scenario::MAX_TRIANGLES {
            let expected = format!("1 to {} triangles (MAX_TRIANGLES)", Scenario::MAX_TRIANGLES);
            return Err(self.value(format!("{field}.mesh"), format!("{triangles} triangles"), expected));
        }
        Ok(triangles)
    }

    fn validate_maps(&self, field: &str, maps: &Weatherable) -> Result<(), ScenarioError> {
        let size = maps.map_size;
        if size == maps.texels() {
            return Ok(());
        }
        let expected =
            format!("a multiple of {TILE_SIZE} up to {} (MAX_MAP_SIZE)", Weatherable::MAX_MAP_SIZE);
        Err(self.value(format!("{field}.maps.map_size"), size, expected))
    }

    /// But for its name and its file, which have been read.
    fn validate_scene(&self, field: &str, scene: &SceneSpec) -> Result<(), ScenarioError> {
        self.vector(&format!("{field}.position"), scene.position, FAR)?;
        self.vector(&format!("{field}.rotation_deg"), scene.rotation_deg, 3600.0)?;
        for (axis, scale) in ["x", "y", "z"].into_iter().zip(scene.scale.to_array()) {
            self.range(&format!("{field}.scale.{axis}"), f64::from(scale), 1.0e-6, f64::from(FAR))?;
        }
        if let Some(porous) = &scene.porous {
            porous.validate().map_err(|wrong| self.out_of_range(&format!("{field}.porous"), wrong))?;
        }
        scene.maps.as_ref().map_or(Ok(()), |maps| self.validate_maps(field, maps))
    }

    /// Checks an emitter by itself.
    ///
    /// # Errors
    /// [`ScenarioError`] for the first thing wrong.
    pub(crate) fn validate_emitter(&self, field: &str, emitter: &EmitterSpec) -> Result<(), ScenarioError> {
        self.resolve(&format!("{field}.effect"), &emitter.effect)?;
        self.not_negative(&format!("{field}.rate"), emitter.rate, Scenario::MAX_RATE)?;
        self.not_negative(&format!("{field}.speed"), emitter.initial_speed(), 1000.0)?;
        let hose =
            matches!((emitter.flow, emitter.shape), (Flow::LitresPerMinute(_), EmitterShape::Cone { .. }));
        if emitter.speed.is_none() && !hose && !matches!(emitter.shape, EmitterShape::Sky { .. }) {
            let expected = "given, but for a Sky, or a Cone with LitresPerMinute".to_owned();
            return Err(self.value(format!("{field}.speed"), "not given", expected));
        }
        match emitter.flow {
            Flow::Effect => {}
            Flow::MmPerHour(rate) => self.positive(&format!("{field}.flow"), rate, 10_000.0)?,
            Flow::LitresPerMinute(litres) => self.positive(&format!("{field}.flow"), litres, 10_000.0)?,
        }
        if matches!(emitter.flow, Flow::MmPerHour(_)) && !matches!(emitter.shape, EmitterShape::Sky { .. }) {
            let expected = "a shape of Sky with it".to_owned();
            return Err(self.value(format!("{field}.flow"), "MmPerHour", expected));
        }
        self.not_negative(&format!("{field}.spread_deg"), emitter.spread_deg, 180.0)?;
        let longest = f32::from(Lifespan::MAX_TICKS) / self.scenario.tick_hz as f32;
        self.positive(&format!("{field}.lifetime"), emitter.lifetime, longest.min(3600.0))?;
        self.not_negative(&format!("{field}.start"), emitter.start, Scenario::MAX_SECONDS)?;
        if let Some(stop) = emitter.stop {
            self.not_negative(&format!("{field}.stop"), stop, Scenario::MAX_SECONDS)?;
        }
        match emitter.shape {
            EmitterShape::Point => {}
            EmitterShape::Cone { radius } | EmitterShape::Disc { radius } => {
                self.not_negative(&format!("{field}.shape.radius"), radius, FAR)?;
            }
            EmitterShape::Box { half_size } => {
                self.vector(&format!("{field}.shape.half_size"), half_size, FAR)?;
            }
            EmitterShape::Sky { half_size: Vec2 { x, y } } => {
                self.not_negative(&format!("{field}.shape.half_size.x"), x, FAR)?;
                self.not_negative(&format!("{field}.shape.half_size.y"), y, FAR)?;
            }
        }
        self.times(&format!("{field}.keys"), emitter.keys.iter().map(|key| key.t))?;
        for (index, key) in emitter.keys.iter().enumerate() {
            self.look(&format!("{field}.keys[{index}]"), "position", key.position, key.target)?;
        }
        Ok(())
    }

    /// At least one key, in order of time.
    fn times(&self, field: &str, times: impl ExactSizeIterator<Item = f32>) -> Result<(), ScenarioError> {
        if times.len() == 0 {
            return Err(self.value(field, "empty", "at least one key"));
        }
        let mut before = 0.0;
        for (index, t) in times.enumerate() {
            let field = format!("{field}[{index}].t");
            self.not_negative(&field, t, Scenario::MAX_SECONDS)?;
            if t < before {
                return Err(self.value(field, t, format!("{before} or later: keys are in order of time")));
            }
            before = t;
        }
        Ok(())
    }

    pub(super) fn look(&self, field: &str, from: &str, eye: Vec3, target: Vec3) -> Result<(), ScenarioError> {
        self.vector(&format!("{field}.{from}"), eye, FAR)?;
        self.vector(&format!("{field}.target"), target, FAR)?;
        if eye.distance(target) < 1.0e-6 {
            return Err(self.value(
                format!("{field}.target"),
                target,
                format!("another point than `{from}`"),
            ));
        }
        Ok(())
    }

    fn color(&self, field: &str, color: [f32; 3]) -> Result<(), ScenarioError> {
        color.into_iter().try_for_each(|channel| self.not_negative(field, channel, 1.0))
    }

    pub(super) fn vector(&self, field: &str, vector: Vec3, most: f32) -> Result<(), ScenarioError> {
        for (axis, value) in ["x", "y", "z"].into_iter().zip(vector.to_array()) {
            self.range(&format!("{field}.{axis}"), f64::from(value), f64::from(-most), f64::from(most))?;
        }
        Ok(())
    }

    pub(super) fn not_negative(&self, field: &str, value: f32, most: f32) -> Result<(), ScenarioError> {
        self.range(field, f64::from(value), 0.0, f64::from(most))
    }

    pub(super) fn positive(&self, field: &str, value: f32, most: f32) -> Result<(), ScenarioError> {
        // Written so that NaN fails.
        if value > 0.0 && value <= most {
            Ok(())
        } else {
            Err(self.value(field, value, format!("above 0 and at most {most}")))
        }
    }

    pub(super) fn range(&self, field: &str, value: f64, least: f64, most: f64) -> Result<(), ScenarioError> {
        // Written so that NaN fails.
        if value >= least && value <= most {
            Ok(())
        } else {
            Err(self.value(field, value, format!("{least} to {most}")))
        }
    }

    pub(super) fn out_of_range(&self, field: &str, wrong: OutOfRange) -> ScenarioError {
        let OutOfRange { field: inner, value, least, most } = wrong;
        self.value(format!("{field}.{inner}"), value, format!("{least} to {most}"))
    }

    pub(super) fn value(
        &self,
        field: impl Into<String>,
        value: impl Display,
        expected: impl Into<String>,
    ) -> ScenarioError {
        let field: String = field.into();
        let (file, field) = self.written(&field);
        ScenarioError::Value { file, field, value: value.to_string(), expected: expected.into() }
    }
}
