//! Opening of a session: from a file, from values, and again from its file.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use etendue_files::Opener;
use etendue_optics::glass::AgfCatalogue;
use etendue_render::Seconds;
use etendue_scene::file::{FileKind, SceneFile};
use etendue_scene::{Cache, SceneError, Setting};
use serde_json::Value;

use super::Session;
use crate::structures::Structures;
use crate::{Error, Options};

impl Session {
    /// Opens a scene (`.json`), or a model to frame by itself (`.gltf`, `.glb`, `.obj`, `.ply`). The text
    /// is read and checked; nothing that it names is opened yet.
    ///
    /// # Errors
    ///
    /// When it cannot be read or says something that the format does not know.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::open_with(path, Options::default())
    }

    /// As [`Self::open`], with options.
    ///
    /// # Errors
    ///
    /// As [`Self::open`].
    pub fn open_with(path: impl AsRef<Path>, options: Options) -> Result<Self, Error> {
        let opener = opener_of(&options);
        let file = read(&opener, path.as_ref(), &options)?;
        Self::of(file, opener, options)
    }

    /// A scene that stands in no file: `scene` in the words of the scene format, in which the file of an
    /// object may be the name of a mesh that [`insert_mesh`](Self::insert_mesh) brings. Other files that it
    /// names lie in `folder`.
    ///
    /// # Errors
    ///
    /// When the scene says something that the format does not know.
    pub fn from_json(folder: impl AsRef<Path>, scene: Value) -> Result<Self, Error> {
        Self::from_json_with(folder, scene, Options::default())
    }

    /// As [`Self::from_json`], with options.
    ///
    /// # Errors
    ///
    /// As [`Self::from_json`].
    pub fn from_json_with(
        folder: impl AsRef<Path>,
        scene: Value,
        options: Options,
    ) -> Result<Self, Error> {
        let opener = opener_of(&options);
        let file = SceneFile::from_json(&opener, folder.as_ref(), scene)?;
        let file = if options.settings.is_empty() { file } else { file.with(&options.settings)? };
        Self::of(file, opener, options)
    }

    /// A session of what [`origin`](Self::origin) gave of another one, be it in another process. With its
    /// options and [`meshes`](Self::meshes) its pictures are the same to the bit, and it writes over no file
    /// that the other one had read.
    ///
    /// # Errors
    ///
    /// When the scene says something that the format does not know.
    pub fn restore(
        path: impl AsRef<Path>,
        scene: Value,
        inputs: Vec<PathBuf>,
        options: Options,
    ) -> Result<Self, Error> {
        let opener = opener_of(&options);
        opener.record(inputs);
        Self::of(SceneFile::restore(&opener, path.as_ref(), scene)?, opener, options)
    }

    fn of(file: SceneFile, opener: Opener, mut options: Options) -> Result<Self, Error> {
        let glasses = read_glasses(&options.glass_catalogs)?;
        options.inputs.extend(options.glass_catalogs.iter().cloned());
        Ok(Self {
            file,
            shown: None,
            frames: None,
            frame_notes: Vec::new(),
            glasses,
            opener,
            options,
            cache: Cache::default(),
            loaded: None,
            structures: Structures::default(),
            images: Arc::default(),
            settings: Vec::new(),
            seconds: Seconds::default(),
            checkpoint: None,
            denoiser: None,
            metered: None,
        })
    }

    /// Reads the scene's file again, with all that was set since, and at the next render the models and
    /// images that have changed on disk. When it is refused, the session is as it was.
    ///
    /// # Errors
    ///
    /// As [`Self::open`]; a scene that stands in no file is as it was.
    pub fn reload(&mut self) -> Result<(), Error> {
        if !self.file.is_in_memory() {
            let mut again = read(&self.opener, self.file.path(), &self.options)?;
            if !self.settings.is_empty() {
                again = again.with(&self.settings)?;
            }
            self.file = again;
        }
        self.leave_frame();
        Ok(())
    }
}

/// Opener of all that a scene names, with what the caller has read for it.
fn opener_of(options: &Options) -> Opener {
    let opener = Opener::new(options.reach);
    opener.record(options.inputs.iter().chain(&options.glass_catalogs).cloned());
    opener
}

/// Reads a scene's file. A bare model gets a picture and the two layers that most people come for.
fn read(opener: &Opener, path: &Path, options: &Options) -> Result<SceneFile, SceneError> {
    let file = SceneFile::read_with(opener, path, &options.settings)?;
    let says_nothing = file.spec.layers.is_empty() && file.spec.tracer.is_none();
    if file.kind() == FileKind::Scene || !says_nothing {
        return Ok(file);
    }
    file.with(&[
        Setting::new("tracer", r#"{"type": "facing"}"#),
        Setting::new("layers", r#"["depth", "normal"]"#),
    ])
}

/// Opens catalogues of glasses.
///
/// # Errors
///
/// When one cannot be read, or is none; the error names it.
pub fn read_glasses(paths: &[PathBuf]) -> Result<Vec<AgfCatalogue>, Error> {
    let open = |path: &PathBuf| {
        AgfCatalogue::open(path).map_err(|error| {
            Error::Refused(format!("the glass catalogue {}: {error}", path.display()))
        })
    };
    paths.iter().map(open).collect()
}
