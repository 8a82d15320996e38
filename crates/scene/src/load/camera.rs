//! The camera of a scene: its files, its default view, and what is odd about its lens.

use std::cell::RefCell;
use std::path::PathBuf;
use std::sync::Arc;

use etendue_camera::{Camera, CameraError, CameraSpec};
use etendue_files::InputFolder;
use etendue_geometry::Geometry;
use etendue_optics::element::LensResources;
use etendue_optics::glass::AgfCatalogue;
use etendue_sensor::Sensor;
use etendue_spectrum::Bands;

use crate::bounds::WorldVertices;
use crate::cache::{self, KeptCamera};
use crate::cameras::{self, CameraOrigin, SceneCamera};
use crate::error::not_found;
use crate::file::SceneFile;
use crate::import::{Note, NoteKind, Strictness};
use crate::scene::LoadOptions;
use crate::{Cache, SceneError, facing};

impl SceneFile {
    pub(super) fn camera_spec(&self) -> CameraSpec {
        self.spec.camera.clone().unwrap_or_default()
    }

    pub(super) fn camera_fault(&self, error: &CameraError) -> SceneError {
        let dot = if error.at.is_empty() { "" } else { "." };
        self.fault(&format!("camera{dot}{}", error.at), error.why.as_str())
    }

    /// The picture's columns and rows, known without the models.
    pub(super) fn resolution(
        &self,
        folder: &InputFolder,
        options: &LoadOptions<'_>,
        kept: &Cache,
    ) -> Result<[u32; 2], SceneError> {
        match kept.camera(&self.camera_words(options)) {
            Some(known) => Ok(known.camera.resolution()),
            None => Ok(self.camera_alone(folder, options.glasses)?.resolution()),
        }
    }

    /// All that makes the camera but the geometry.
    pub(super) fn camera_words(&self, options: &LoadOptions<'_>) -> String {
        let camera = self.value().get("camera").unwrap_or_default();
        format!("{:?} {:?} {camera}", options.camera, self.spec.plan.dispersion)
    }

    /// The camera over `geometry`; the one before when nothing has changed that it depends on.
    pub(super) fn kept_camera(
        &self,
        geometry: Geometry,
        cameras: &[SceneCamera],
        (folder, options): (&InputFolder, &LoadOptions<'_>),
        kept: &Cache,
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
        let files = CameraFiles::new(folder, options.glasses);
        let (camera, origin) = self.camera(&geometry, cameras, &files, options)?;
        let files = cache::stamps(&files.found.into_inner());
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
                let (index, camera) = cameras::pick(cameras, wanted).map_err(|reason| {
                    SceneError::NoSuchCamera { wanted: wanted.to_owned(), reason }
                })?;
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
        let vertices = WorldVertices(geometry);
        let camera = spec
            .build(|| facing::subject(&vertices), files)
            .map_err(|error| self.camera_fault(&error))?;
        let camera = match self.spec.plan.dispersion {
            Some(false) => camera.without_dispersion(),
            Some(true) | None => camera,
        };
        Ok((camera, origin))
    }

    /// What is odd about the camera's lens. Glasses and filters that are not known at a wavelength
    /// that is traced are an error when strict.
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
    pub(super) fn sensor_behind(&self, camera: &Camera) -> Result<Option<Sensor>, SceneError> {
        let Some(sensor) = &self.sensor else { return Ok(None) };
        let sized = match camera.pixel_pitch() {
            Some(pitch) if pitch != sensor.pixel_pitch() => sensor.with_pixel_pitch(pitch),
            _ => Ok(sensor.clone()),
        };
        let sized = sized.map_err(|error| self.fault("camera.sensor", error.why()))?;
        Ok(Some(sized.with_resolution(camera.resolution())))
    }
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
