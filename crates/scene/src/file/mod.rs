//! The JSON scene format, version 1: read, changed by settings from the command line, checked.

mod accuracy;
mod camera;
mod check;
mod document;
mod frames;
mod imu;
mod lens;
mod object;
mod overrides;
mod path;
mod samples;
mod sensor;
mod settings;
mod spec;
mod tolerance;
mod values;
mod written;

use std::path::Path;

use etendue_files::Opener;
use etendue_optics::train::remove_notes;
use etendue_report::Refusal;
use etendue_sensor::{Photodiodes, Sensor, SensorKind};
use etendue_tracer::LayerSpec;
use serde_json::{Value, json};

pub use accuracy::{AccuracySetting, AccuracySpec, AccuracyUse};
pub use document::{Origin, Place};
pub use frames::{
    CameraPath, FramesSpec, PixelsSpec, RigCameraSpec, SlotSpec, TrajectoryFormat, texts_of,
};
pub use imu::ImuSpec;
pub(crate) use lens::lens_of_text;
pub use lens::{ReadLens, is_lens, lens_schema, rays_schema, read_lens, read_lens_at, trace_rays};
pub use object::{
    AnimationSpec, InstancesSpec, ObjectMotionSpec, ObjectSpec, Scale, Source, TransformSpec, Up,
};
pub use overrides::Setting;
pub use path::{PathStep, ScenePath};
pub use samples::{
    LEAST_SAMPLES, RelativeErrorSpec, SETS, SamplesSpec, SensorNoiseSpec, TimeSpec, Until,
};
pub use sensor::SensorFile;
pub use settings::{
    Auto, BuildQuality, Exposure, LightPrecision, LightRow, PlanSpec, RenderSpec, ToneMap,
    TracerRow, TracerSpec,
};
pub use spec::{FormatVersion, SceneSpec, scene_schema};
pub use tolerance::{DisplacementSpec, ShareSpec, ToleranceSpec};

pub(crate) use document::{JsonDocument, JsonFault};
pub(crate) use values::read as read_value;

use crate::SceneError;
use camera::read_document;
use written::WrittenPlaces;

/// The endings of models that may stand in for a scene file.
const MODELS: [&str; 4] = ["gltf", "glb", "obj", "ply"];

/// Name, in messages, of a scene that stands in no file.
const IN_MEMORY: &str = "scene in memory";

/// A scene file, read and checked for itself; nothing it names has been opened.
#[derive(Debug, Clone)]
pub struct SceneFile {
    written: WrittenPlaces,
    kind: FileKind,
    /// All values with the settings applied.
    value: Value,
    /// Content of the file; of the sensor the camera's part.
    pub spec: SceneSpec,
    /// The camera's sensor, when the file says more of it than its grid of pixels.
    pub sensor: Option<Sensor>,
}

/// Kind of file that stands for the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// A JSON scene.
    Scene,
    /// A model, rendered as a scene of its own.
    Model,
}

impl SceneFile {
    /// Reads the scene at `path`, or makes a scene of the model there (`.gltf`, `.glb`, `.obj`,
    /// `.ply`), and applies `overrides`, the later the stronger. The camera's file, where the scene names one, is in the
    /// scene's folder.
    ///
    /// # Errors
    ///
    /// When the file is missing, not JSON, or says something that the format does not know; the
    /// message names the place.
    pub fn read(path: &Path, overrides: &[Setting]) -> Result<Self, SceneError> {
        Self::read_with(&Opener::default(), path, overrides)
    }

    /// As [`Self::read`], with the camera's file where `opener` reaches.
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    pub fn read_with(
        opener: &Opener,
        path: &Path,
        overrides: &[Setting],
    ) -> Result<Self, SceneError> {
        let kind = if is_model(path) { FileKind::Model } else { FileKind::Scene };
        let (document, mut value) = match kind {
            FileKind::Model => {
                // Only the name: the model's own folder is the scene's.
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                (None, json!({ "etendue": 1, "objects": [{ "file": name }] }))
            }
            FileKind::Scene => {
                let (document, value) = read_document(path)?;
                (Some(document), value)
            }
        };
        // A camera that nobody describes is this one, and settings may go on from it.
        if let Value::Object(members) = &mut value {
            members.entry("camera").or_insert_with(|| json!({ "type": "pinhole" }));
        }
        Self::of(WrittenPlaces::new(opener, path, document), kind, value, overrides)
    }

    /// The scene that `value` describes, which stands in no file. What it names lies in `folder`, or where
    /// `opener` reaches.
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    pub fn from_json(opener: &Opener, folder: &Path, mut value: Value) -> Result<Self, SceneError> {
        if let Value::Object(members) = &mut value {
            members.entry("etendue").or_insert_with(|| json!(1));
            members.entry("camera").or_insert_with(|| json!({ "type": "pinhole" }));
        }
        let written = WrittenPlaces::new(opener, &folder.join(IN_MEMORY), None);
        Self::of(written, FileKind::Scene, value, &[])
    }

    /// The scene at `path`, or in memory, whose values with all settings are `value`; the file is not read.
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    pub fn restore(opener: &Opener, path: &Path, value: Value) -> Result<Self, SceneError> {
        let kind = if is_model(path) { FileKind::Model } else { FileKind::Scene };
        Self::of(WrittenPlaces::new(opener, path, None), kind, value, &[])
    }

    /// The scene with settings on top of those that it has, as in [`Self::read`]. The file is not read
    /// again.
    ///
    /// # Errors
    ///
    /// When the format does not know what they say; the message names the setting.
    pub fn with(&self, overrides: &[Setting]) -> Result<Self, SceneError> {
        Self::of(self.written.clone(), self.kind, self.value.clone(), overrides)
    }

    fn of(
        mut written: WrittenPlaces,
        kind: FileKind,
        mut value: Value,
        overrides: &[Setting],
    ) -> Result<Self, SceneError> {
        written.read_camera(&mut value)?;
        written.set(&mut value, overrides)?;
        if let Value::Object(members) = &mut value {
            // A key of the scene that was set to null is as if it were not written.
            let is_unset = |key: &str| overrides.iter().any(|setting| setting.path == key);
            members.retain(|key, value| !(value.is_null() && is_unset(key)));
        }
        remove_notes(&mut value);
        written.read_curves(&mut value)?;
        let sensor = sensor::place_in_scene();
        let resolution = sensor.key("resolution");
        spec::read_resolution(&mut value, &resolution)
            .map_err(|why| written.fault(resolution, why))?;
        written.read_defects(&mut value, &sensor)?;
        let mut file = Self { written, kind, value, spec: SceneSpec::default(), sensor: None };
        (file.spec, file.sensor) = file.check()?;
        let spec = &file.spec;
        let (samples, sampler) = (spec.render.samples, spec.render.sampler);
        let fault = samples::fault(samples, sampler, &spec.sampling_layers(), &file.value)
            .or_else(|| spec.layer_fault())
            .or_else(|| {
                let (key, why) = spec.plan.contradiction(spec.render.accel)?;
                Some((format!("plan.{key}"), why))
            })
            .or_else(|| {
                let has_bands = file.has_given_bands();
                let (path, why) =
                    spec.accuracy.contradiction(&file.value, &spec.plan, has_bands)?;
                Some((path.to_owned(), why))
            })
            .or_else(|| {
                let has_slots = !spec.serial.is_empty();
                spec.tolerance?;
                let (path, why) = ToleranceSpec::contradiction(&spec.plan, has_slots)?;
                Some((path.to_owned(), why))
            });
        match fault {
            Some((path, why)) => Err(file.fault(path, why)),
            None => {
                file.check_times()?;
                file.check_serial()?;
                // Parts of pixels see parts of the light.
                let photodiodes = file.sensor.as_ref().and_then(|sensor| sensor.spec().photodiodes);
                for layer in photodiodes.map_or(&[][..], layers_of) {
                    if !file.spec.layers.contains(layer) {
                        file.spec.layers.push(*layer);
                    }
                }
                Ok(file)
            }
        }
    }

    /// True if the sensor's bands are given as they are to be taken.
    fn has_given_bands(&self) -> bool {
        let spec = self.sensor.as_ref().map(Sensor::spec);
        spec.is_some_and(|spec| spec.bands.is_some() && spec.kind != SensorKind::Multispectral)
    }

    /// The scene without its `frames`.
    pub(crate) fn without_frames(&self) -> Result<Self, SceneError> {
        let mut value = self.value.clone();
        if let Value::Object(members) = &mut value {
            members.remove("frames");
        }
        Self::of(self.written.clone(), self.kind, value, &[])
    }

    /// Returns the file with its further settings counted as those of a frame.
    pub(crate) fn of_frame(mut self, number: usize) -> Self {
        self.written.frame = Some(number);
        self
    }

    /// True if the scene is in no file.
    #[must_use]
    pub fn is_in_memory(&self) -> bool {
        self.written.document.is_none() && self.path().ends_with(IN_MEMORY)
    }

    fn check(&self) -> Result<(SceneSpec, Option<Sensor>), SceneError> {
        check::check(&spec::SCENE, &self.value).map_err(|problem| {
            let hint = self.hint(&problem.path).unwrap_or_default();
            self.fault(problem.path, problem.reason + &hint)
        })?;
        let mut value = self.value.clone();
        let sensor = sensor::split(&mut value, &self.written)?;
        let spec = values::read(&value).map_err(|(path, why)| self.fault(path, why))?;
        Ok((spec, sensor))
    }

    /// Hint on what was probably meant by the value at `path`, when that belongs elsewhere.
    fn hint(&self, path: &ScenePath) -> Option<String> {
        let tracer = self.value.get("tracer").filter(|_| path.root() == Some("tracer"))?;
        let word = tracer.get("type").unwrap_or(tracer).as_str()?;
        LayerSpec::NAMES.contains(&word).then(|| {
            format!("\nhint: `{word}` is a layer, beside the picture or in its place: \"layers\": [\"{word}\"]")
        })
    }

    /// The error that the value at `path` is wrong because of `why`.
    pub(crate) fn fault(&self, path: impl Into<ScenePath>, why: impl Into<Refusal>) -> SceneError {
        self.written.fault(path, why)
    }

    /// The refusal with the file, and the line there, of what its place names, where that is a key of the scene; as it is
    /// where it has another place, such as an option, or none.
    #[must_use]
    pub fn placed(&self, why: Refusal) -> SceneError {
        let place = why.place().to_owned();
        let (key, inside) = place.split_once(": ").unwrap_or((place.as_str(), ""));
        let path = ScenePath::of(key);
        let is_key = path.root().is_some_and(|key| spec::SCENE["properties"].get(key).is_some());
        if !is_key || place.starts_with(&*self.path().to_string_lossy()) {
            return why.into();
        }
        self.fault(path, why.without_place().at(inside))
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.written.path
    }

    /// The folder that the file's own paths start at.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.written.folder()
    }

    /// Kind of the file: a JSON scene or a model.
    #[must_use]
    pub fn kind(&self) -> FileKind {
        self.kind
    }

    /// All values, with the settings applied.
    #[must_use]
    pub fn value(&self) -> &Value {
        &self.value
    }
}

/// The layers of the light that a sensor's photodiodes see.
fn layers_of(photodiodes: Photodiodes) -> &'static [LayerSpec] {
    match photodiodes {
        Photodiodes::Dual => &[LayerSpec::LeftPupil, LayerSpec::RightPupil],
        Photodiodes::Quad => &[
            LayerSpec::TopLeftPupil,
            LayerSpec::TopRightPupil,
            LayerSpec::BottomLeftPupil,
            LayerSpec::BottomRightPupil,
        ],
    }
}

fn is_model(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    MODELS.iter().any(|model| ending.eq_ignore_ascii_case(model))
}
