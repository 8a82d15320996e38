//! Places where the values of a file were written: its text, the file of its camera, the command line.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use etendue_files::Opener;
use etendue_report::Refusal;
use serde_json::Value;

use super::camera::CameraDocument;
use super::document::{JsonDocument, Origin};
use super::overrides::{self, Setting};
use super::path::ScenePath;
use crate::SceneError;

/// Places where the values of a file were written, to say where something is wrong.
#[derive(Debug, Clone)]
pub(super) struct WrittenPlaces {
    pub(super) path: PathBuf,
    /// The text; none for a model.
    pub(super) document: Option<JsonDocument>,
    /// Opens the camera's file, where the scene names one.
    pub(super) opener: Opener,
    /// That file, once it is read.
    camera: Option<CameraDocument>,
    /// Paths that the command line set, and how each was written there.
    settings: BTreeMap<ScenePath, String>,
    /// Of which frame they are; none for the command line's.
    pub(super) frame: Option<usize>,
}

impl WrittenPlaces {
    pub(super) fn new(opener: &Opener, path: &Path, document: Option<JsonDocument>) -> Self {
        Self {
            path: path.to_owned(),
            document,
            opener: opener.clone(),
            camera: None,
            settings: BTreeMap::new(),
            frame: None,
        }
    }

    pub(super) fn folder(&self) -> &Path {
        match self.path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        }
    }

    /// Puts the camera in the place of the name of its file.
    pub(super) fn read_camera(&mut self, scene: &mut Value) -> Result<(), SceneError> {
        let Some(place) = scene.get_mut("camera") else { return Ok(()) };
        let Value::String(written) = &*place else { return Ok(()) };
        let folder = self.folder();
        let folder =
            self.opener.folder(folder).map_err(|why| SceneError::unreadable(folder, &why))?;
        let (file, camera) =
            CameraDocument::read(&folder, written)?.map_err(|why| self.fault("camera", why))?;
        *place = camera;
        // What it says stands there, not where it is named.
        self.settings.remove(&ScenePath::of("camera"));
        self.camera = Some(file);
        Ok(())
    }

    /// Applies settings of the command line to the file's values, the later the stronger.
    pub(super) fn set(&mut self, value: &mut Value, all: &[Setting]) -> Result<(), SceneError> {
        for Setting { path: key, value: text } in all {
            let setting = format!("{key}={text}");
            let applied = overrides::apply(value, key, text)
                .map_err(|why| why.at(format_args!("--set {setting}")))?;
            let is_camera = applied == ScenePath::of("camera");
            self.settings.insert(applied, setting);
            if is_camera {
                self.camera = None;
                self.read_camera(value)?;
            }
        }
        Ok(())
    }

    /// The error that the value at `path` is wrong because of `why`.
    pub(super) fn fault(&self, path: impl Into<ScenePath>, why: impl Into<Refusal>) -> SceneError {
        let path = path.into();
        let place = self.place(&path);
        let file = self.camera.as_ref().zip(CameraDocument::own_path(&path));
        // A setting is named as it was written, from the scene's top.
        let file = file.filter(|_| !matches!(place, Origin::Setting(_)));
        let (file, path) = match file {
            Some((camera, own)) => (camera.path.clone(), own),
            None => (self.path.clone(), path),
        };
        SceneError::Invalid { file, path, place, why: why.into() }
    }

    /// Place where the value at `path`, or the nearest that holds it, was written.
    fn place(&self, path: &ScenePath) -> Origin {
        // A setting replaces all that the text has below it.
        if let Some(setting) = path.holders().find_map(|path| self.settings.get(&path)) {
            return Origin::Setting(match self.frame {
                Some(number) => format!("frames[{number}]: {setting}"),
                None => format!("--set {setting}"),
            });
        }
        let place = match self.camera.as_ref().zip(CameraDocument::own_path(path)) {
            Some((camera, own)) => camera.document.near(&own),
            None => self.document.as_ref().and_then(|document| document.near(path)),
        };
        place.map_or(Origin::Nowhere, Origin::Text)
    }
}
