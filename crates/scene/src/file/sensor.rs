//! A sensor alone: what `etendue sensor` reads.

use std::path::Path;

use etendue_files::Opener;
use etendue_optics::train::remove_notes;
use etendue_sensor::{Sensor, SensorError, SensorSpec};
use serde_json::{Value, json};

use super::{WrittenPlaces, check, lenient, read_document, schema};
use crate::SceneError;
use crate::words::plain;

/// Where a scene keeps its sensor.
const IN_SCENE: &str = "camera.sensor";

/// A sensor that was read and checked: a scene's `camera.sensor`, or the same object in a file of
/// its own.
#[derive(Debug, Clone)]
pub struct SensorFile {
    /// What was written.
    pub spec: SensorSpec,
    /// The sensor of it.
    pub sensor: Sensor,
    written: WrittenPlaces,
    /// The path of the sensor's object; empty when the file is the sensor.
    place: &'static str,
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
    pub fn read(
        opener: &Opener,
        path: &Path,
        overrides: &[(String, String)],
    ) -> Result<Self, SceneError> {
        let (document, value) = read_document(path)?;
        Self::of(WrittenPlaces::new(opener, path, Some(document)), value, overrides)
    }

    /// A sensor given by its values, such as those of a preset; `name` stands for the file.
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    pub fn of_value(
        name: &Path,
        value: Value,
        overrides: &[(String, String)],
    ) -> Result<Self, SceneError> {
        Self::of(WrittenPlaces::new(&Opener::default(), name, None), value, overrides)
    }

    fn of(
        mut written: WrittenPlaces,
        mut value: Value,
        overrides: &[(String, String)],
    ) -> Result<Self, SceneError> {
        written.read_camera(&mut value)?;
        written.set(&mut value, overrides)?;
        remove_notes(&mut value);
        let in_scene = value.get("etendue").is_some() || value.get("camera").is_some();
        let place = if in_scene { IN_SCENE } else { "" };
        let resolution = inside(place, "resolution");
        lenient::read_resolution(&mut value, &resolution)
            .map_err(|why| written.fault(&resolution, why))?;
        let object = if in_scene { value.pointer("/camera/sensor") } else { Some(&value) };
        let object = object.ok_or_else(|| {
            let why = "the scene has no sensor; give it one, such as { \"type\": \"raw\", \
                       \"model\": \"imx183\" }";
            written.fault(IN_SCENE, why)
        })?;
        check::check(&schema::SENSOR, object)
            .map_err(|problem| written.fault(&inside(place, &problem.path), problem.reason))?;
        let (spec, sensor) = built(object, place, &written)?;
        Ok(Self { spec, sensor, written, place })
    }

    /// The error with the place in the file that it is about.
    #[must_use]
    pub fn fault(&self, error: &SensorError) -> SceneError {
        self.written.fault(&inside(self.place, error.at()), error.why())
    }
}

/// The sensor that `object`, which fits the schema, describes; it stands at `place`.
fn built(
    object: &Value,
    place: &str,
    written: &WrittenPlaces,
) -> Result<(SensorSpec, Sensor), SceneError> {
    let spec: SensorSpec = serde_path_to_error::deserialize(object).map_err(|error| {
        let path = inside(place, &error.path().to_string());
        written.fault(&path, plain(error.inner()))
    })?;
    let sensor = Sensor::new(&spec)
        .map_err(|error| written.fault(&inside(place, error.at()), error.why()))?;
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
    let (spec, sensor) = built(object, IN_SCENE, written)?;
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

fn inside(place: &str, key: &str) -> String {
    match (place, key) {
        (_, "" | ".") => place.to_owned(),
        ("", _) => key.to_owned(),
        _ => format!("{place}.{key}"),
    }
}
