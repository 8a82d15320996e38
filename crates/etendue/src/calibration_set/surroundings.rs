//! A scene's camera before an even white surrounding.

use std::path::{Path, PathBuf};

use etendue_camera::Camera;
use etendue_files::Reach;
use etendue_render::expose::SensorLight;
use etendue_sensor::Exposure;
use serde_json::{Value, json};

use crate::{Error, Options, Progress, Session};

/// The scene's camera, and what stands before it.
pub(super) struct WhiteSurroundings {
    /// The scene's file.
    path: PathBuf,
    values: Value,
    reach: Reach,
    pub(super) camera: Camera,
    pub(super) inputs: Vec<PathBuf>,
}

impl WhiteSurroundings {
    /// Of a session's scene.
    pub(super) fn of(session: &mut Session, progress: &Progress) -> Result<Self, Error> {
        let (camera, inputs, spec) = {
            let scene = session.scene(progress)?;
            let spec = scene.sensor.as_ref().map(|sensor| sensor.spec().clone());
            (scene.camera.clone(), scene.inputs.clone(), spec)
        };
        let path = session.file().path().to_owned();
        let surroundings =
            Self { path, values: session.values().clone(), reach: session.reach(), camera, inputs };
        if surroundings.values.get("camera").is_none_or(Value::is_null) {
            return Err(surroundings
                .refused("camera: a calibration is of the scene's own camera, and it names none"));
        }
        let Some(spec) = spec else {
            return Err(surroundings.refused(
                "camera.sensor: an ideal grid of pixels has nothing to calibrate\nhint: give it a sensor, such as \
                 { \"type\": \"raw\", \"model\": \"imx183\" }",
            ));
        };
        let more = [
            ("auto_exposure", spec.auto_exposure.is_some()),
            ("exposures", spec.exposures.is_some_and(|times| times.len() > 1)),
            ("second_readout", spec.second_readout.is_some()),
            ("photodiodes", spec.photodiodes.is_some()),
        ];
        if let Some((key, _)) = more.into_iter().find(|(_, is_given)| *is_given) {
            return Err(surroundings.refused(&format!(
                "camera.sensor.{key}: a calibration is of one plain read-out at one exposure\nhint: leave it out, and give the \
                 `exposure` that it is for"
            )));
        }
        Ok(surroundings)
    }

    pub(super) fn refused(&self, why: &str) -> Error {
        Error::Refused(format!("{}: {why}", self.path.display()))
    }

    /// The light of these objects in an even white surrounding.
    pub(super) fn take(
        &self,
        objects: Vec<Value>,
        progress: &Progress,
    ) -> Result<SensorLight, Error> {
        let scene = json!({
            "etendue": 1,
            "camera": self.values["camera"],
            "tracer": { "type": "direct" },
            "lights": [{ "type": "environment", "radiance": [1, 1, 1] }],
            "materials": {
                "white": { "type": "matte", "color": [0.9, 0.9, 0.9] },
                "black": { "type": "matte", "color": [0.04, 0.04, 0.04] },
            },
            "objects": objects,
            "render": render_settings(&self.values),
        });
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let options = Options { reach: self.reach, ..Options::default() };
        let mut session = Session::from_json_with(folder, scene, options)?;
        let rendering = session.render(progress)?;
        let light = rendering.sensor_light().cloned();
        light.ok_or_else(|| self.refused("camera.sensor: exposes nothing"))
    }

    /// Factor by which `white` reaches a share of saturation.
    pub(super) fn factor(
        &self,
        white: &SensorLight,
        shot: Exposure,
        level: f64,
    ) -> Result<f64, Error> {
        let (sensor, brightest) = (white.sensor(), white.brightest(shot.exposure));
        let dark = sensor.dark_current() * shot.exposure;
        let wanted = level * sensor.saturation() - dark;
        match brightest > 0.0 && wanted > 0.0 {
            true => Ok(wanted / brightest),
            false => Err(self.refused(&format!(
                "camera.sensor: no light brings it to {level} of saturation at {} s: the dark signal alone is {dark:.0} e⁻ \
                 of {:.0}\nhint: set the sensor's `exposure` lower",
                shot.exposure,
                sensor.saturation()
            ))),
        }
    }
}

/// The scene's settings of sampling, without what belongs to its own picture.
fn render_settings(values: &Value) -> Value {
    let mut kept = json!({});
    for key in ["samples", "sampler", "seed", "accel", "frozen_noise"] {
        if let Some(value) = values.pointer(&format!("/render/{key}")) {
            kept[key] = value.clone();
        }
    }
    kept
}
