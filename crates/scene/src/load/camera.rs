//! The camera of a scene: its files, its default view, and what is odd about its lens.

use std::cell::{Cell, RefCell};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::cache::{self, Cache, KeptCamera};
use crate::cameras::{CameraOrigin, SceneCamera, pick};
use crate::error::not_found;
use crate::file::{SamplesSpec, SceneFile, ScenePath, lens_of_text};
use crate::import::{Note, NoteKind, Strictness};
use crate::scene::{LoadContext, LoadOptions, LoadProgress};
use crate::world_vertices::WorldVertices;
use crate::{SceneError, facing};
use etendue_camera::{Camera, CameraError, CameraResources, CameraSpec};
use etendue_files::InputFolder;
use etendue_geometry::{Bounds, Geometry};
use etendue_optics::element::{LensResources, Resolve};
use etendue_optics::glass::AgfCatalogue;
use etendue_optics::train::OpticalTrain;
use etendue_report::Refusal;
use etendue_sensor::{Sensor, SensorSpec};
use etendue_spectrum::Bands;
use etendue_tracer::LayerSpec;

impl SceneFile {
    pub(crate) fn camera_spec(&self) -> CameraSpec {
        self.timed_camera(self.spec.camera.clone().unwrap_or_default())
    }

    pub(crate) fn camera_fault(&self, error: &CameraError) -> SceneError {
        self.fault(ScenePath::of("camera").join(&error.at), error.why.as_str())
    }

    /// The camera as far as it is known before the models are.
    pub(super) fn camera_ahead(
        &self,
        folder: &InputFolder,
        options: &LoadOptions<'_>,
        kept: &Cache,
    ) -> Result<CameraAhead, SceneError> {
        if let Some(known) = kept.camera(&self.camera_words(options)) {
            return Ok(CameraAhead { camera: known.camera, files: None });
        }
        let (files, asks_for_models) =
            (CameraFiles::new(folder, options.glasses), Cell::new(options.camera.is_some()));
        let subject = || {
            asks_for_models.set(true);
            Bounds::default()
        };
        let spec = self.camera_spec();
        let camera = spec.build(subject, &files).map_err(|error| self.camera_fault(&error))?;
        let is_whole = spec.has_pose() && !asks_for_models.get();
        Ok(CameraAhead { camera, files: is_whole.then(|| files.found.into_inner()) })
    }

    /// All that makes the camera but the geometry.
    pub(super) fn camera_words(&self, options: &LoadOptions<'_>) -> String {
        let camera = self.value().get("camera").unwrap_or_default();
        let timed = self.has_clock().then(|| self.spec.render.time());
        let clock = timed.map(|time| format!("{time} s ")).unwrap_or_default();
        format!("{clock}{:?} {:?} {camera}", options.camera, self.spec.plan.dispersion)
    }

    /// The camera over `geometry`; the one before when nothing has changed that it depends on.
    pub(super) fn kept_camera(
        &self,
        geometry: Geometry,
        cameras: &[SceneCamera],
        LoadContext { folder, options, kept, .. }: LoadContext<'_>,
        ahead: CameraAhead,
    ) -> Result<KeptCamera, SceneError> {
        let words = self.camera_words(options);
        let known = kept.camera(&words);
        let geometry = match &known {
            Some(known) if known.geometry.is_same(&geometry) => Arc::clone(&known.geometry),
            _ => Arc::new(geometry),
        };
        if let Some(known) = known
            && (Arc::ptr_eq(&known.geometry, &geometry) && options.camera.is_none()
                || known.origin == CameraOrigin::Scene)
        {
            let same = KeptCamera { geometry, ..known };
            kept.keep_camera(same.clone());
            return Ok(same);
        }
        let (camera, origin, files) = match ahead.files {
            Some(files) => (self.with_its_dispersion(ahead.camera), CameraOrigin::Scene, files),
            None => {
                let files = CameraFiles::new(folder, options.glasses);
                let (camera, origin) = self.camera(&geometry, cameras, &files, options)?;
                (camera, origin, files.found.into_inner())
            }
        };
        let files = cache::stamped(&files);
        let built = KeptCamera { words, geometry, camera, origin, files };
        kept.keep_camera(built.clone());
        Ok(built)
    }

    pub(super) fn camera(
        &self,
        geometry: &Geometry,
        cameras: &[SceneCamera],
        files: &CameraFiles<'_>,
        options: &LoadOptions<'_>,
    ) -> Result<(Camera, CameraOrigin), SceneError> {
        let own = self.camera_spec();
        // A camera of the model, with the scene's own sensor when it has one; else the scene's.
        let (spec, origin) = match options.camera {
            Some(wanted) => {
                let (index, camera) = pick(cameras, wanted)
                    .map_err(|reason| Refusal::new(reason).at(format_args!("--camera {wanted}")))?;
                let mut spec = camera.spec.clone();
                let given = |key| self.value().pointer("/camera/sensor")?.get(key);
                if given("resolution").or_else(|| given("model")).is_some() {
                    *spec.sensor_mut() = own.sensor().clone();
                }
                let name = match &camera.name {
                    name if name.is_empty() => index.to_string(),
                    name => name.clone(),
                };
                (spec, CameraOrigin::Model(name))
            }
            None if own.has_pose() => (own, CameraOrigin::Scene),
            None => (own, CameraOrigin::Framed),
        };
        // Without a pose it frames what is there.
        let stopped = AtomicBool::new(false);
        let go_on = || {
            let step = LoadProgress { name: "camera", done: 1, total: 1 };
            if options.progress.is_some_and(|progress| !progress(step)) {
                stopped.store(true, Ordering::Relaxed);
            }
            !stopped.load(Ordering::Relaxed)
        };
        let vertices = WorldVertices { geometry, go_on: &go_on };
        let built = spec.build(|| facing::subject(&vertices), files);
        // A place that was found in part is none, nor is what may be wrong with it.
        if stopped.load(Ordering::Relaxed) {
            return Err(SceneError::Stopped);
        }
        let camera = built.map_err(|error| self.camera_fault(&error))?;
        Ok((self.with_its_dispersion(camera), origin))
    }

    /// A camera whose lens disperses, unless the scene says otherwise.
    fn with_its_dispersion(&self, camera: Camera) -> Camera {
        match self.spec.plan.dispersion {
            Some(false) => camera.without_dispersion(),
            Some(true) | None => camera,
        }
    }

    /// Notes on oddities of the camera's lens. Glasses and filters that are not known at a
    /// wavelength that is traced are an error when strict.
    pub(super) fn lens_notes(
        &self,
        camera: &Camera,
        strictness: Strictness,
    ) -> Result<Vec<Note>, SceneError> {
        let Some(lens) = camera.lens() else { return Ok(Vec::new()) };
        let guesses = lens.out_of_range(&Bands::Rgb);
        if let (Strictness::Strict, Some(guess)) = (strictness, guesses.first()) {
            return Err(self.fault("camera", guess.as_str()));
        }
        let train = lens.focused().train();
        let subject = if train.name().is_empty() { "the camera's lens" } else { train.name() };
        let note = |message: &String| Note {
            kind: NoteKind::Irregular,
            subject: subject.to_owned(),
            message: message.clone(),
            count: 1,
        };
        let implausible = lens.implausible();
        Ok(train.notes().iter().chain(&implausible).chain(&guesses).map(note).collect())
    }

    /// The sensor with the pixels that the camera gives it.
    /// Refuses parts of the pupil's light where the camera has none.
    fn check_pupil_parts(&self, camera: &Camera) -> Result<(), SceneError> {
        let has_lenslets = camera.light_field().is_some();
        let photodiodes = self.sensor.as_ref().and_then(|sensor| sensor.spec().photodiodes);
        let parts = self.spec.layers.iter().position(|layer| layer.pupil_part().is_some());
        if let Some(number) = parts {
            let key = match photodiodes {
                Some(_) => "camera.sensor.photodiodes".to_owned(),
                None => format!("layers[{number}]"),
            };
            let why = if !camera.has_pupil() || has_lenslets {
                "parts of the pupil want a camera with one lens\nhint: take a `thin_lens`, `real_lens` or `lens`, or \
                 leave this out"
            } else if camera.diffracts() {
                "light that is spread as waves are came through all of the pupil\nhint: leave out `diffraction`"
            } else if camera.motion().is_some() {
                "the pupil moves with the camera\nhint: leave out its `motion`"
            } else if self.spec.picture() != Some(LayerSpec::Radiance) {
                "base colours come through no pupil\nhint: give the scene a `tracer` of light, such as \
                 {\"type\": \"path\"}"
            } else {
                ""
            };
            if !why.is_empty() {
                return Err(self.fault(&key, why));
            }
        }
        Ok(())
    }

    /// Refuses angles and diffusion where the camera cannot have them, and read-outs by whose noise no samples are judged.
    fn check_sensor_behind(&self, sensor: &SensorSpec, camera: &Camera) -> Result<(), SceneError> {
        let refused = |key: &str, why: &str| Err(self.fault(format!("camera.sensor.{key}"), why));
        let has_lenslets = camera.light_field().is_some();
        let more = [
            ("auto_exposure", sensor.auto_exposure.is_some()),
            ("second_readout", sensor.second_readout.is_some()),
            ("photodiodes", sensor.photodiodes.is_some()),
        ];
        if let SamplesSpec::SensorNoise(_) = self.spec.render.samples
            && let Some((key, _)) = more.into_iter().find(|(_, is_given)| *is_given)
        {
            let why = "`render.samples` until the sensor's noise goes by one plain read-out at an exposure that is known \
                       beforehand\nhint: give it a number of samples or a `relative_error`, or leave this out";
            return refused(key, why);
        }
        if sensor.angular_response.is_some() && has_lenslets {
            return refused(
                "angular_response",
                "behind lenslets a pixel has no chief ray of its own\nhint: leave this out, or take a camera without \
                 microlenses",
            );
        }
        if sensor.carrier_diffusion.is_some_and(|way| way.0 > 0.0) {
            if camera.diffracts() {
                let why = "light that is spread as waves are is traced along chief rays\nhint: leave out `diffraction`, or \
                           this";
                return refused("carrier_diffusion", why);
            }
            if camera.shutter().is_some() {
                let why = "a shutter looks at rows of the light, and carriers come from beside them\nhint: leave out \
                           `shutter`, or this";
                return refused("carrier_diffusion", why);
            }
        }
        Ok(())
    }

    pub(super) fn sensor_behind(&self, camera: &Camera) -> Result<Option<Sensor>, SceneError> {
        self.check_pupil_parts(camera)?;
        let Some(sensor) = &self.sensor else { return Ok(None) };
        let sized = match camera.pixel_pitch() {
            Some(pitch) if pitch != sensor.pixel_pitch() => sensor.with_pixel_pitch(pitch),
            _ => Ok(sensor.clone()),
        };
        let sized = sized.map_err(|error| self.fault("camera.sensor", error.why()))?;
        self.check_sensor_behind(sized.spec(), camera)?;
        Ok(Some(sized.with_resolution(camera.resolution())))
    }
}

/// A camera that was built before the models were read.
pub(super) struct CameraAhead {
    pub(super) camera: Camera,
    /// The files that it names, where it is the scene's whatever the models are: then it need not be built again.
    files: Option<Vec<PathBuf>>,
}

/// The files that a camera names, lenses and masks, and the user's glasses.
pub(crate) struct CameraFiles<'a> {
    folder: &'a InputFolder,
    glasses: &'a [AgfCatalogue],
    /// Those that were asked for and are there.
    found: RefCell<Vec<PathBuf>>,
}

impl<'a> CameraFiles<'a> {
    pub(crate) fn new(folder: &'a InputFolder, glasses: &'a [AgfCatalogue]) -> Self {
        Self { folder, glasses, found: RefCell::default() }
    }
}

impl LensResources for CameraFiles<'_> {
    fn path(&self, written: &str) -> Result<PathBuf, String> {
        let path = self.folder.find(written).map_err(not_found)?.path;
        let mut found = self.found.borrow_mut();
        if !found.contains(&path) {
            found.push(path.clone());
        }
        Ok(path)
    }

    fn glasses(&self) -> &[AgfCatalogue] {
        self.glasses
    }
}

impl CameraResources for CameraFiles<'_> {
    fn lens(&self, name: &str, text: &str, files: Resolve<'_>) -> Result<OpticalTrain, String> {
        let lens = lens_of_text(name.as_ref(), text.to_owned(), files);
        lens.map(|(_, train)| train).map_err(|fault| fault.to_string())
    }
}
