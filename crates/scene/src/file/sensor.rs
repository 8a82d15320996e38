//! A sensor alone: what `etendue sensor` reads; and what of a scene's camera is its sensor.

use std::path::Path;

use serde_json::{Value, json};

use super::camera::read_document;
use super::overrides::Setting;
use super::path::ScenePath;
use super::written::WrittenPlaces;
use super::{check, spec, values};
use crate::SceneError;
use crate::error::not_found;
use etendue_camera::curve_files::{self, LONGEST_TABLE};
use etendue_files::Opener;
use etendue_image::Samples;
use etendue_optics::train::remove_notes;
use etendue_report::Refusal;
use etendue_sensor::{DefectMap, ListedDefect, Model, Sensor, SensorError, SensorSpec};
use etendue_spectrum::CurveFault;

impl WrittenPlaces {
    /// Puts curves in the place of the files that filters and sensors of the camera name: `{"file": "x.csv"}`.
    pub(super) fn read_curves(&self, scene: &mut Value) -> Result<(), SceneError> {
        let Some(camera) = scene.get_mut("camera") else { return Ok(()) };
        let read = &mut |written: &str| {
            let folder = self.opener.folder(self.folder()).map_err(|error| error.to_string())?;
            let path = folder.find(written).map_err(not_found)?.path;
            let bytes = etendue_files::read(&path, LONGEST_TABLE).map_err(|e| e.to_string())?;
            self.opener.record([path]);
            String::from_utf8(bytes).map_err(|_| "is no text".to_owned())
        };
        let read = curve_files::read_curves(camera, read);
        read.map_err(|CurveFault { key, why }| self.fault(ScenePath::of("camera").join(key), why))?;
        Ok(())
    }

    /// Puts the list of defects in the place of the picture of them that the sensor at `place` names.
    pub(super) fn read_defects(
        &self,
        value: &mut Value,
        sensor: &ScenePath,
    ) -> Result<(), SceneError> {
        let place = sensor.key("defect_map");
        let Some(map) = place.find(value) else { return Ok(()) };
        let Value::String(written) = &*map else { return Ok(()) };
        let (size, list) = self
            .defects_in(written)
            .map_err(|why| self.fault(&place, format!("\"{written}\" {why}")))?;
        *map = json!(list);
        // A map of other columns and rows belongs to another sensor.
        let sensor = sensor.get(value).unwrap_or(&Value::Null);
        let resolution = sensor.get("resolution").cloned().or_else(|| {
            let model: Model = serde_json::from_value(sensor.get("model")?.clone()).ok()?;
            Some(json!(model.preset().resolution.value))
        });
        let resolution = resolution.unwrap_or(json!([1024, 1024]));
        if resolution.is_array() && resolution != json!(size) {
            let why = format!(
                "has {} columns and {} rows, the sensor {resolution}: give a map of the sensor's own",
                size[0], size[1]
            );
            return Err(self.fault(place, why));
        }
        Ok(())
    }

    /// Columns and rows of a picture of defects, and the list of them.
    fn defects_in(&self, written: &str) -> Result<([usize; 2], Vec<ListedDefect>), String> {
        let folder = self.opener.folder(self.folder()).map_err(|error| error.to_string())?;
        let path = folder.find(written).map_err(not_found)?.path;
        let bytes = etendue_files::read(&path, LONGEST_MAP).map_err(|error| error.to_string())?;
        self.opener.record([path]);
        if bytes.starts_with(b"\x93NUMPY") {
            let is_plane = |shape: &[usize]| match shape {
                [_, _] => Ok(()),
                _ => Err(format!("has the shape {shape:?}, not [rows, columns]")),
            };
            let array = etendue_image::npy::read(&bytes, is_plane)?;
            let [rows, columns] = [array.shape[0], array.shape[1]];
            let list = DefectMap::of_numbers(array.numbers.into_iter(), columns)?;
            return Ok(([columns, rows], list));
        }
        let raster = etendue_image::decode(&bytes, etendue_image::Limits::default())
            .map_err(|error| format!("{error}\nhint: give a PNG or NPY"))?;
        let size @ [columns, _] = raster.size();
        if raster.channels() != 1 {
            return Err(format!("has {} channels\nhint: give a grey picture", raster.channels()));
        }
        let list = match raster.samples() {
            Samples::U8(all) => DefectMap::of_numbers(all.iter().map(|&n| f64::from(n)), columns),
            Samples::U16(all) => DefectMap::of_numbers(all.iter().map(|&n| f64::from(n)), columns),
            Samples::F16(_) | Samples::F32(_) => {
                Err("has no integers\nhint: give a PNG or NPY".into())
            }
        }?;
        Ok((size, list))
    }
}

/// The longest map of defects that is read (bytes).
const LONGEST_MAP: u64 = 1 << 30;

/// The place of a scene's sensor.
pub(super) fn place_in_scene() -> ScenePath {
    ScenePath::of("camera.sensor")
}

/// A sensor that was read and checked: a scene's `camera.sensor`, or the same object in a file of
/// its own.
#[derive(Debug, Clone)]
pub struct SensorFile {
    /// Sensor as it was written.
    pub spec: SensorSpec,
    /// The sensor of it.
    pub sensor: Sensor,
    written: WrittenPlaces,
    /// The path of the sensor's object; empty when the file is the sensor.
    place: ScenePath,
}

impl SensorFile {
    /// Reads the sensor at `path`. A file with a key `etendue` or `camera` is taken for a scene, of
    /// which nothing but the sensor is looked at. `overrides` are paths from the file's top and
    /// values, as in [`SceneFile::read`](super::SceneFile::read); `opener` opens the file of the
    /// scene's camera, where it has one.
    ///
    /// # Errors
    ///
    /// When the file is missing or not JSON, has no sensor, or its sensor is refused; the message
    /// names the file, the place and the remedy.
    pub fn read(opener: &Opener, path: &Path, overrides: &[Setting]) -> Result<Self, SceneError> {
        let (document, value) = read_document(path)?;
        Self::of(WrittenPlaces::new(opener, path, Some(document)), value, overrides)
    }

    /// The sensor of the file called `name` where there is one, else the preset of that name.
    ///
    /// # Errors
    ///
    /// As [`Self::read`], and when `name` is neither.
    pub fn named(opener: &Opener, name: &Path, overrides: &[Setting]) -> Result<Self, SceneError> {
        if name.exists() || name.extension().is_some_and(|ending| ending == "json") {
            return Self::read(opener, name, overrides);
        }
        let written = WrittenPlaces::new(opener, name, None);
        let model = name.to_str().and_then(Model::from_name).ok_or_else(|| {
            let known: Vec<&str> = Model::ALL.iter().map(|model| model.preset().name).collect();
            let known = known.join(", ");
            let why = format!(
                "neither a file nor a preset\nhint: name a scene, a sensor's JSON file, or one of {known}"
            );
            written.fault("", why)
        })?;
        Self::of_value(name, json!({ "type": "raw", "model": model }), overrides)
    }

    /// A sensor given by its values, such as those of a preset; `name` stands for the file.
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    pub fn of_value(name: &Path, value: Value, overrides: &[Setting]) -> Result<Self, SceneError> {
        Self::of(WrittenPlaces::new(&Opener::default(), name, None), value, overrides)
    }

    fn of(
        mut written: WrittenPlaces,
        mut value: Value,
        overrides: &[Setting],
    ) -> Result<Self, SceneError> {
        written.read_camera(&mut value)?;
        let in_scene = value.get("etendue").is_some() || value.get("camera").is_some();
        // What is set does not make a scene of a sensor.
        let is_of_scene = |set: &&Setting| set.path == "camera" || set.path.starts_with("camera.");
        let of_scene = overrides.iter().find(is_of_scene);
        if let (false, Some(Setting { path, value })) = (in_scene, of_scene) {
            let own = path.strip_prefix("camera.sensor.").unwrap_or("KEY");
            let refusal = Refusal::new("this is a sensor, not a scene that has one");
            let refusal = refusal.hint(format!("write `{own}={value}`"));
            return Err(refusal.at(format_args!("--set {path}={value}")).into());
        }
        written.set(&mut value, overrides)?;
        remove_notes(&mut value);
        let place = if in_scene { place_in_scene() } else { ScenePath::default() };
        let resolution = place.key("resolution");
        spec::read_resolution(&mut value, &resolution)
            .map_err(|why| written.fault(&resolution, why))?;
        written.read_defects(&mut value, &place)?;
        let object = place.get(&value);
        let object = object.ok_or_else(|| {
            let why = "the scene has no sensor\nhint: give it one, such as { \"type\": \"raw\", \
                       \"model\": \"imx183\" }";
            written.fault(&place, why)
        })?;
        check::check(&spec::SENSOR, object)
            .map_err(|problem| written.fault(place.join(problem.path), problem.reason))?;
        let (spec, sensor) = built(object, &place, &written)?;
        Ok(Self { spec, sensor, written, place })
    }

    /// The error with the place in the file that it is about.
    #[must_use]
    pub fn fault(&self, error: &SensorError) -> SceneError {
        self.written.fault(self.place.join(error.at()), error.why())
    }
}

/// The sensor that `object`, which fits the schema, describes; it stands at `place`.
fn built(
    object: &Value,
    place: &ScenePath,
    written: &WrittenPlaces,
) -> Result<(SensorSpec, Sensor), SceneError> {
    let spec: SensorSpec =
        values::read(object).map_err(|(path, why)| written.fault(place.join(path), why))?;
    let sensor =
        Sensor::new(&spec).map_err(|error| written.fault(place.join(error.at()), error.why()))?;
    Ok((spec, sensor))
}

/// Takes the sensor out of a scene that fits the schema, and leaves the camera its grid of pixels.
/// The sensor is `None` when it is no more than that grid.
pub(super) fn split(
    scene: &mut Value,
    written: &WrittenPlaces,
) -> Result<Option<Sensor>, SceneError> {
    let Some(object) = scene.pointer_mut("/camera/sensor").filter(|object| object.is_object())
    else {
        return Ok(None);
    };
    let (spec, sensor) = built(object, &place_in_scene(), written)?;
    let mut grid = json!({});
    if spec.resolution.is_some() || spec.model.is_some() {
        grid["resolution"] = json!(sensor.resolution());
    }
    if spec.pixel_pitch.is_some() || spec.model.is_some() {
        grid["pixel_pitch"] = json!(sensor.pixel_pitch());
    }
    *object = grid;
    Ok(spec.exposes().then_some(sensor))
}
