//! A scene that is opened once and rendered often.

mod coarse;
mod loaded;
mod meshes;
mod opening;
mod prepare;
mod render;
mod serial;

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use etendue_accel::Accel;
use etendue_files::Opener;
use etendue_oidn::Denoiser;
use etendue_optics::glass::AgfCatalogue;
use etendue_render::annotations;
use etendue_render::expose::SPECTRUM;
use etendue_render::output::{LayerFile, Outputs};
use etendue_render::{Checkpoint, Images, Plan, Seconds, denoise};
use etendue_scene::file::{FramesSpec, SceneFile, texts_of};
use etendue_scene::{Cache, Frame, Frames, Scene, SceneError, ScenePath, Setting, Start};
use etendue_tracer::LayerSpec;
use serde_json::Value;

pub use meshes::MeshAttributes;
pub use opening::read_glasses;
pub use render::Shares;

use self::loaded::LoadedScene;
use crate::changes;
use crate::neighbours;
use crate::rendering::{certain_files, file_names};
use crate::structures::Structures;
use crate::words::{fingerprints, in_words};
use crate::{Dataset, Error, FramePattern, Options, Progress, places, rendering};

/// A scene that is opened once, changed by [`set`](Self::set) and rendered as often as one likes.
///
/// Models, images and the acceleration structure are made when they are first needed and kept. After a
/// change only what it touches is made anew: the camera, the sensor, the tracer and lights leave meshes
/// and structure as they are, and an object that is moved leaves the meshes. Pictures are the same, to
/// the bit, as those of a new session of the changed scene.
///
/// A render runs on the threads of the rayon pool that it is called in.
pub struct Session {
    /// The scene as it was opened and set.
    file: SceneFile,
    /// The frame of it that is shown, and its number.
    shown: Option<(usize, SceneFile)>,
    /// All frames, where layers compare them.
    frames: Option<Arc<[Frame]>>,
    /// Notes for the user on the file that the frames come from.
    frame_notes: Vec<String>,
    options: Options,
    /// The user's catalogues of glasses.
    glasses: Vec<AgfCatalogue>,
    /// Opens what the scene and its frames name, and knows what that was.
    opener: Opener,
    cache: Cache,
    loaded: Option<LoadedScene>,
    structures: Structures,
    images: Arc<Images>,
    /// Settings since the session was opened.
    settings: Vec<Setting>,
    /// Seconds of what was done since the last render.
    seconds: Seconds,
    /// Checkpoint in which what there is of a render is kept.
    checkpoint: Option<Checkpoint>,
    /// Denoiser of pictures, once it was asked for.
    denoiser: Option<Denoiser>,
    /// The exposure that was metered on the first frame (s), which all frames have.
    metered: Option<f64>,
}

/// Prospect of a render: what is known of a scene before it is rendered.
#[derive(Debug, Clone, Copy)]
pub struct Prospect<'a> {
    /// The loaded scene.
    pub scene: &'a Scene,
    /// Its plan.
    pub plan: &'a Plan,
    /// The files that are wanted.
    pub outputs: Outputs,
    /// Duration of loading (s).
    pub load: f64,
}

/// A scene, the structure over it, and its images.
pub(crate) struct PreparedScene {
    pub(crate) scene: Arc<Scene>,
    pub(crate) accel: Arc<dyn Accel>,
    pub(crate) images: Arc<Images>,
}

impl fmt::Debug for Session {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Session").field("file", &self.file.path()).finish_non_exhaustive()
    }
}

impl Session {
    /// Sets a value of the scene, at any path: `camera.f_number`, `objects[0].transform.translate`,
    /// `lights`. What is missing on the way is made. When it is refused, the session is as it was.
    ///
    /// # Errors
    ///
    /// When the path leads nowhere, or the format does not know the value; the message names both.
    pub fn set(&mut self, path: &str, value: impl Into<Value>) -> Result<(), Error> {
        self.set_all([(path, value.into())])
    }

    /// Sets several values at once, the later the stronger: for changes that make sense together alone.
    ///
    /// # Errors
    ///
    /// As [`Self::set`].
    pub fn set_all<'p>(
        &mut self,
        values: impl IntoIterator<Item = (&'p str, Value)>,
    ) -> Result<(), Error> {
        let values = values.into_iter();
        let settings: Vec<Setting> =
            values.map(|(path, value)| Setting::new(path, value.to_string())).collect();
        self.file = self.file.with(&settings)?;
        // What was set before at the same path is of no effect any more.
        self.settings.retain(|own| settings.iter().all(|other| other.path != own.path));
        self.settings.extend(settings);
        self.leave_frame();
        Ok(())
    }

    /// Makes the scene that which `values` say, in the words of the scene format: sets what differs from
    /// [`values`](Self::values), and nothing else. When it is refused, the session is as it was.
    ///
    /// # Errors
    ///
    /// As [`Self::set`].
    pub fn replace(&mut self, values: &Value) -> Result<(), Error> {
        self.set_changes(&self.file.value().clone(), values)
    }

    /// Sets what turns the scene `before` into `after`, both in the words of the scene format: edits of one
    /// version of a scene, made to this one.
    ///
    /// # Errors
    ///
    /// As [`Self::set`].
    pub fn set_changes(&mut self, before: &Value, after: &Value) -> Result<(), Error> {
        let changes = changes::between(before, after);
        match changes.is_empty() {
            true => Ok(()),
            false => {
                let texts = changes.iter().map(|(path, value)| (path.to_string(), value.clone()));
                let texts: Vec<(String, Value)> = texts.collect();
                self.set_all(texts.iter().map(|(path, value)| (&**path, value.clone())))
            }
        }
    }

    /// All values of the scene as they are now, in the words of the scene format.
    #[must_use]
    pub fn values(&self) -> &Value {
        self.file().value()
    }

    /// The scene file as it is now: of the frame that is shown, when one is.
    #[must_use]
    pub fn file(&self) -> &SceneFile {
        self.shown.as_ref().map_or(&self.file, |(_, shown)| shown)
    }

    /// Permission of where files that the scene names may be.
    pub(crate) fn reach(&self) -> etendue_files::Reach {
        self.options.reach
    }

    /// The scene file as it is now, whichever frame is shown.
    pub(crate) fn whole(&self) -> &SceneFile {
        &self.file
    }

    pub(crate) fn cache(&self) -> &Cache {
        &self.cache
    }

    /// The frames of the scene, in order; `None` when its file has no `frames` and is one picture. They are worked out
    /// once, until a value is [`set`](Self::set) or the file is read again ([`Self::reload`]).
    ///
    /// # Errors
    ///
    /// When they make no sense, or a trajectory's file is missing or broken; and as [`Self::scene`], for a
    /// path that begins where the scene's camera stands.
    pub fn frames(&mut self, progress: &Progress) -> Result<Option<Arc<[Frame]>>, Error> {
        if let Some(frames) = &self.frames {
            return Ok(Some(Arc::clone(frames)));
        }
        self.leave_frame();
        // Of a path the camera's own place is wanted, which may depend on the models.
        if let Some(FramesSpec::Path(_)) = self.file.spec.frames {
            self.load(progress)?;
        }
        let start = || {
            let scene = self.loaded.as_ref().map(|loaded| &loaded.scene);
            scene.map(|scene| Start::of(scene)).ok_or(SceneError::Stopped)
        };
        let Some(Frames { frames, notes }) = self.file.frames(&self.opener, start)? else {
            return Ok(None);
        };
        if let Some(camera) = &self.options.camera {
            let sets_camera = |(path, _): &&(String, Value)| {
                let path = ScenePath::of(path);
                path.root() == Some("camera") && path.inside(&"camera.sensor".into()).is_none()
            };
            if let Some((path, _)) =
                frames.iter().flat_map(|frame| &frame.settings).find(sets_camera)
            {
                return Err(Error::Refused(format!(
                    "--camera {camera}: frames set {path} of the scene's own camera, which it takes the place \
                     of\nhint: leave one of them out"
                )));
            }
        }
        let frames: Arc<[Frame]> = frames.into();
        self.frames = Some(Arc::clone(&frames));
        self.frame_notes = notes.iter().map(in_words).collect();
        self.frame_notes.iter().for_each(|note| progress.note(note));
        Ok(Some(frames))
    }

    /// Takes the scene to one of its [`frames`](Self::frames): what is rendered next is that picture, as if
    /// it stood in a file of its own. What is [`set`](Self::set) afterwards is of the whole scene again.
    ///
    /// # Errors
    ///
    /// When the format does not know what the frame sets; the message names the frame.
    pub fn show(&mut self, frame: &Frame) -> Result<(), Error> {
        let shown = self.file.at(frame)?;
        if self.frames.is_none() && !neighbours::steps(&shown.spec.all_layers()).is_empty() {
            self.frames(&Progress::none())?;
        }
        self.shown = Some((frame.number, shown));
        self.loaded = None;
        Ok(())
    }

    /// Checks that each kind of file that is wanted is one of a layer of the scene, or of some of its `frames`.
    ///
    /// # Errors
    ///
    /// When one is not.
    pub fn check_outputs(&self, frames: &[Frame]) -> Result<(), Error> {
        let mut layers = self.file.spec.all_layers();
        let sets_layers = |frame: &&Frame| frame.sets(&["layers"]);
        for frame in frames.iter().filter(sets_layers) {
            layers.extend(self.file.at(frame)?.spec.all_layers());
        }
        refuse_idle(self.options.outputs, &layers, self.file.value())
    }

    fn leave_frame(&mut self) {
        self.shown = None;
        self.frames = None;
        self.frame_notes.clear();
        self.loaded = None;
    }

    /// True if `out` holds all files of frame `number`, named by `pattern`, as the scene is now.
    ///
    /// # Errors
    ///
    /// As [`Self::scene`].
    pub fn is_complete(
        &mut self,
        out: &Path,
        pattern: &FramePattern,
        number: usize,
        progress: &Progress,
    ) -> Result<bool, Error> {
        self.load(progress)?;
        let outputs = self.options.outputs;
        let LoadedScene { scene, plan, neighbours, .. } = self.loaded()?;
        let mut prints = fingerprints(scene, neighbours)?;
        prints.extend(outputs.denoised.then(denoise::fingerprint));
        let mut files = certain_files(plan.names(scene), outputs);
        files.extend(scene.sensor.as_ref().map(|_| "sensor.json".to_owned()));
        Ok(pattern.is_complete(out, number, &prints, &files))
    }

    /// Prospect of the next render before it is begun; the scene is read when it is not.
    ///
    /// # Errors
    ///
    /// As [`Self::scene`].
    pub fn prospect(&mut self, progress: &Progress) -> Result<Prospect<'_>, Error> {
        self.load_as_rendered(progress)?;
        let LoadedScene { scene, plan, .. } = self.loaded()?;
        let (outputs, load) = (self.options.outputs, self.seconds.load);
        Ok(Prospect { scene, plan, outputs, load })
    }

    /// The loaded scene: read now when it is not, or has changed.
    ///
    /// # Errors
    ///
    /// When a value makes no sense, a file is missing or cannot be imported, there is too little memory, or
    /// it is stopped.
    pub fn scene(&mut self, progress: &Progress) -> Result<&Scene, Error> {
        self.load(progress)?;
        Ok(&self.loaded()?.scene)
    }

    /// Plan of a render: what it will do, and why. Of a scene with a tolerance, what is taken of it
    /// is found, which takes the structure and the images.
    ///
    /// # Errors
    ///
    /// As [`Self::scene`], and of a scene with a tolerance as [`Self::prepare`].
    pub fn plan(&mut self, progress: &Progress) -> Result<&Plan, Error> {
        self.load(progress)?;
        if self.loaded()?.scene.tolerance.is_some() {
            self.build_for_picture(progress)?;
            self.decode_for_picture(progress)?;
            self.take(progress)?;
        }
        Ok(&self.loaded()?.plan)
    }

    /// The scene and the acceleration structure over its geometry: built now when it is not.
    ///
    /// # Errors
    ///
    /// As [`Self::scene`]; when the structure cannot be built; when it is stopped.
    pub fn scene_and_accel(&mut self, progress: &Progress) -> Result<(&Scene, &dyn Accel), Error> {
        self.build(progress)?;
        Ok((&self.loaded()?.scene, self.built()?))
    }

    /// Loads, builds and decodes what the next render needs, with progress.
    ///
    /// # Errors
    ///
    /// As [`Self::scene_and_accel`]; when an image of the scene is broken and defects are not
    /// tolerated; when it is stopped.
    pub fn prepare(&mut self, progress: &Progress) -> Result<(), Error> {
        self.build(progress)?;
        self.decode(progress)
    }

    /// Checks, before the first of `frames` is rendered into `out`, that no file of any of them, nor of the data
    /// set that they make, takes the place of a file that the scene or a frame names. `also` judges the places
    /// of each in turn.
    ///
    /// # Errors
    ///
    /// When one does; the message names it. Those of `also`, and as [`Self::scene`].
    pub fn check_frames<E: From<Error>>(
        &mut self,
        out: &Path,
        pattern: &FramePattern,
        frames: &[Frame],
        progress: &Progress,
        also: impl Fn(&[PathBuf]) -> Result<(), E>,
    ) -> Result<(), E> {
        self.load(progress)?;
        // Any word that a frame sets may be a file's name; those that are none are not found.
        if let Ok(folder) = self.opener.folder(self.file.folder()) {
            let settings = frames.iter().flat_map(|frame| &frame.settings);
            let values = settings.filter(|(path, _)| path != POSE).map(|(_, value)| value);
            values.flat_map(texts_of).for_each(|word| drop(folder.find(word)));
        }
        let inputs = self.opener.found();
        let of_dataset: Vec<PathBuf> = Dataset::file_names().map(|name| out.join(name)).collect();
        places::keep_apart(&inputs, &of_dataset)?;
        also(&of_dataset)?;
        let (outputs, loaded) = (self.options.outputs, self.loaded()?);
        let common = file_names(&loaded.scene, &loaded.plan, outputs);
        for frame in frames {
            let mut names = common.clone();
            if frame.sets(&["layers", "tracer"]) {
                let shown = self.file.at(frame).map_err(Error::from)?;
                let layers = rendering::layer_names(&shown.spec);
                names.extend(layers.flat_map(|layer| rendering::layer_files(&layer, outputs)));
            }
            also(&pattern.keep_apart(out, frame.number, &inputs, &names)?)?;
        }
        Ok(())
    }

    /// Every file that was opened for the session so far, or that a user has told it to keep.
    #[must_use]
    pub fn inputs(&self) -> Vec<PathBuf> {
        self.opener.found()
    }

    /// Checks that results can be written into `folder`, which is made, without any file of the scene being
    /// overwritten. `also` are names of more files that the caller is to write there.
    ///
    /// # Errors
    ///
    /// When they cannot.
    pub fn check_place(
        &mut self,
        folder: &Path,
        also: &[&str],
        progress: &Progress,
    ) -> Result<Vec<PathBuf>, Error> {
        places::folder(folder)?;
        self.load(progress)?;
        let (outputs, loaded) = (self.options.outputs, self.loaded()?);
        // A frame may lack what others of its scene have: the last one has no flow.
        if self.shown.is_none() {
            refuse_idle(outputs, &self.file.spec.all_layers(), self.file.value())?;
        }
        if let Some(why) = annotations::refusal(&loaded.scene, outputs) {
            return Err(Error::Refused(why));
        }
        let names = file_names(&loaded.scene, &loaded.plan, outputs);
        let names = names.into_iter().chain(also.iter().map(|&name| name.to_owned()));
        let results: Vec<PathBuf> = names.map(|name| folder.join(name)).collect();
        places::keep_apart(&loaded.scene.inputs, &results)?;
        Ok(results)
    }
}

/// Path of the setting that frames of a path make, and nothing else.
const POSE: &str = "camera.pose";

/// Refuses files that none of `layers` is written as, nor the light of the `scene`'s sensor.
fn refuse_idle(outputs: Outputs, layers: &[LayerSpec], scene: &Value) -> Result<(), Error> {
    let mut names: Vec<String> =
        layers.iter().flat_map(|layer| layer.row().names_in_files()).collect();
    let sensor = |key: &str| scene.pointer("/camera/sensor")?.get(key);
    let has_bands = sensor("type").is_some_and(|kind| kind == "multispectral");
    names.extend((has_bands && sensor("bands").is_some()).then(|| SPECTRUM.to_owned()));
    match LayerFile::without_layer(outputs, &names) {
        None => Ok(()),
        Some([output, wanted]) => {
            let remedy = match output {
                "envi" => "give `camera.sensor` the `type` `multispectral` and `bands`",
                _ => "add it to `layers`",
            };
            Err(Error::Refused(format!(
                "outputs: `{output}` is a file of {wanted}, and the scene has no such layer\nhint: {remedy}, or \
                 leave `{output}` out"
            )))
        }
    }
}
