//! Numbers of `accuracy`, and settings, that decide nothing in a scene, as it has none of what they are of.

use etendue_accel::AccelName;
use etendue_camera::LensCamera;
use etendue_optics::element::Opening;
use etendue_report::Decision;
use etendue_sensor::{NoiseModel, Sensor};
use etendue_spectrum::Bands;
use etendue_tracer::{EnvironmentImage, Ior, LayerSpec, Material};

use crate::Scene;
use crate::file::{AccuracySetting, AccuracyUse, LightRow, SamplesSpec, SceneFile};
use crate::import::{Note, NoteKind};

const NO_LENS: &str = "the camera has no lens";
const NO_LIGHT: &str = "the picture is of no light";

impl Scene {
    /// Reason why a number of that use decides nothing in this scene; `None` where it may.
    ///
    /// It may wherever more than the scene decides it: mattes are asked for by `--outputs`.
    #[must_use]
    pub fn why_idle(&self, used_for: AccuracyUse) -> Option<&'static str> {
        match used_for {
            AccuracyUse::Bands => self.idle_bands(),
            AccuracyUse::LightPrecision => self.idle_precision(),
            AccuracyUse::SharedPaths => self.idle_sharing(),
            AccuracyUse::Roulette => match self.light() {
                None => Some(NO_LIGHT),
                Some(light) => light.rules.roulette.is_none().then_some("the tracer is not `path`"),
            },
            AccuracyUse::DispersingGlass => match self.light() {
                None => Some(NO_LIGHT),
                Some(_) => (!self.materials.iter().any(disperses))
                    .then_some("no material is glass that disperses"),
            },
            AccuracyUse::Stopping | AccuracyUse::StoppingWithoutNoise => {
                self.idle_stopping(used_for)
            }
            AccuracyUse::Views => {
                self.camera.light_field().is_none().then_some("the camera takes no light field")
            }
            AccuracyUse::Pupils
            | AccuracyUse::UnevenPupils
            | AccuracyUse::ImageCircles
            | AccuracyUse::Masks
            | AccuracyUse::Lenslets
            | AccuracyUse::Fits => match self.camera.lens() {
                None => Some(NO_LENS),
                Some(lens) => idle_in(lens, used_for),
            },
            AccuracyUse::Waves => match self.light() {
                _ if !self.camera.diffracts() => {
                    Some("no light is spread as waves (`camera.diffraction`)")
                }
                light => light.is_none().then_some(NO_LIGHT),
            },
            AccuracyUse::Tolerance | AccuracyUse::LensTolerance => match self.camera.lens() {
                _ if self.tolerance.is_none() => Some("the scene has no `tolerance`"),
                None if used_for == AccuracyUse::LensTolerance => Some(NO_LENS),
                _ => None,
            },
            AccuracyUse::Shapes => (!self.geometry.meshes.iter().any(|mesh| mesh.steps.is_some()))
                .then_some("no mesh changes its shape while the shutter is open"),
            AccuracyUse::Images => match self.camera.pixel_extent() {
                _ if self.textures.is_empty() => Some("no image is looked up"),
                extent => {
                    extent.is_none().then_some("the camera does not tell what a pixel covers")
                }
            },
            AccuracyUse::Skies => self.idle_sky(),
            AccuracyUse::Mattes => None,
        }
    }

    /// Rows of the plan on the numbers that the scene sets.
    #[must_use]
    pub fn accuracy_decisions(&self) -> Vec<Decision> {
        let row = |setting: AccuracySetting| {
            let decision = setting.decision();
            match self.why_idle(setting.used_for) {
                Some(why) => {
                    let reason = format!("{}; decides nothing here: {why}", decision.reason);
                    Decision { reason, ..decision }
                }
                None => decision,
            }
        };
        self.accuracy.set().map(row).collect()
    }

    /// The light that the picture is of.
    fn light(&self) -> Option<LightRow> {
        let is_lit = self.picture == Some(LayerSpec::Radiance);
        self.tracer.filter(|_| is_lit)?.row().light
    }

    fn idle_bands(&self) -> Option<&'static str> {
        match &self.sensor {
            _ if self.light().is_none() => Some(NO_LIGHT),
            None => Some("the camera has no sensor that exposes the picture"),
            Some(sensor) => (!sensor.chooses_bands())
                .then_some("the sensor is `digital`, of bands that it takes as they are"),
        }
    }

    fn idle_precision(&self) -> Option<&'static str> {
        let is_sampled = |layer: &LayerSpec| layer.is_light() || layer.is_averaged();
        if !self.layers.iter().any(is_sampled) {
            return Some("no light is traced, and no colour is averaged");
        }
        let accel = self.render.accel.unwrap_or_else(AccelName::best);
        (!accel.has_single()).then_some("the accelerator works in f64 alone")
    }

    fn idle_sharing(&self) -> Option<&'static str> {
        match self.camera.lens() {
            _ if self.light().is_none() => Some(NO_LIGHT),
            None => Some(NO_LENS),
            Some(lens) => (!tells_bands_apart(lens))
                .then_some("the camera's lens sends the light of all bands the same way"),
        }
    }

    fn idle_stopping(&self, used_for: AccuracyUse) -> Option<&'static str> {
        match (used_for, self.render.samples) {
            (_, samples) if !samples.is_adaptive() => {
                Some("`render.samples` is not to go on until an error is reached")
            }
            (AccuracyUse::StoppingWithoutNoise, SamplesSpec::SensorNoise(_)) => {
                let noise = self.sensor.as_ref().map(Sensor::noise);
                noise
                    .is_some_and(|noise| noise != NoiseModel::None)
                    .then_some("the sensor has noise, at which samples stop")
            }
            (AccuracyUse::StoppingWithoutNoise, _) => {
                Some("`render.samples` is not to stop at a sensor's noise")
            }
            _ => None,
        }
    }

    fn idle_sky(&self) -> Option<&'static str> {
        let is_clear =
            |light| matches!(EnvironmentImage::of(light), Some(EnvironmentImage::ClearSky(_)));
        match self.light() {
            None => Some(NO_LIGHT),
            Some(_) => (!self.lights.iter().any(is_clear)).then_some("no light is a clear sky"),
        }
    }
}

impl SceneFile {
    /// Notes on the numbers of `accuracy` that the file writes, and on `plan.shared_paths`, where they decide nothing
    /// in `scene`, which was made of it.
    pub(crate) fn idle_settings(&self, scene: &Scene) -> Vec<Note> {
        let note = |path: &str, why: &str| Note {
            kind: NoteKind::Unused,
            subject: format!("`{path}`"),
            message: format!("decides nothing here: {why}; leave it out"),
            count: 1,
        };
        let of_number = |setting: AccuracySetting| {
            scene.why_idle(setting.used_for).map(|why| note(setting.path, why))
        };
        let sharing = scene.plan.shared_paths.and_then(|_| scene.idle_sharing());
        let sharing = sharing.map(|why| note("plan.shared_paths", why));
        scene.accuracy.written(self.value()).filter_map(of_number).chain(sharing).collect()
    }
}

/// True if the lens sends some bands of light another way than others, or lets other shares of them pass.
pub(crate) fn tells_bands_apart(lens: &LensCamera) -> bool {
    lens.band_groups(&Bands::Rgb).len() > 1
}

/// Reason why a number of that use decides nothing behind the lens.
fn idle_in(lens: &LensCamera, used_for: AccuracyUse) -> Option<&'static str> {
    let train = lens.focused().train();
    let has_array = train.first_array().is_some();
    match used_for {
        AccuracyUse::Pupils | AccuracyUse::UnevenPupils if !has_array && lens.has_round_pupil() => {
            Some("the pupil of the camera's lens is a disk, which is known exactly")
        }
        AccuracyUse::UnevenPupils => (!has_array && train.is_rotationally_symmetric())
            .then_some("the camera's lens is round"),
        AccuracyUse::Masks => {
            let is_mask = |opening: Option<&Opening>| matches!(opening, Some(Opening::Image(_)));
            (!train.elements().iter().any(|element| is_mask(element.part.opening())))
                .then_some("the camera's lens has no coded aperture")
        }
        AccuracyUse::Lenslets => (!has_array).then_some("the camera has no microlenses"),
        _ => None,
    }
}

/// True if a material is glass of another index at each wavelength.
fn disperses(material: &Material) -> bool {
    let glass = material.scattering.glass();
    glass.is_some_and(|glass| matches!(glass.ior, Ior::Dispersive(_)))
}
