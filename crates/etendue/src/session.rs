//! A scene that is opened once and rendered often.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use etendue_accel::{Accel, BuildOptions};
use etendue_geometry::Mesh;
use etendue_render::output::conventions::Manner;
use etendue_render::output::{ImageHash, Layer, Outputs, SOFTWARE};
use etendue_render::report::memory;
use etendue_render::{
    Checkpoint, Course, Film, FilmFile, FollowedFrame, Identity, Images, Plan, Prepared,
    RenderError, Rendered, Report, Seconds, Shard, plan,
};
use etendue_scene::escape::one_line;
use etendue_scene::file::{FileKind, FramesSpec, SceneFile};
use etendue_scene::memory::Budget;
use etendue_scene::{Cache, Frame, LoadOptions, Scene, SceneError, Start, Strictness};
use serde_json::Value;

use crate::changes;
use crate::neighbours::{self, Neighbour};
use crate::progress::Phase;
use crate::rendering::{certain_files, file_names};
use crate::structures::Structures;
use crate::words::{NOT_FOLLOWED, changed, fingerprints, header, in_words, not_finite};
use crate::{Error, FramePattern, Options, Progress, Prospect, Rendering, Shares, places};

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
    options: Options,
    cache: Cache,
    loaded: Option<Loaded>,
    structures: Structures,
    images: Arc<Images>,
    /// What was set since it was opened.
    settings: Vec<(String, String)>,
    /// What was done since the last render.
    seconds: Seconds,
    /// Where what there is of a render is kept.
    checkpoint: Option<Checkpoint>,
}

/// A scene, the structure over it, and its images.
pub(crate) type Ready = (Arc<Scene>, Arc<dyn Accel>, Arc<Images>);

/// The scene as it is now.
struct Loaded {
    scene: Arc<Scene>,
    plan: Plan,
    notes: Vec<String>,
    /// The structure over it, once it is built.
    accel: Option<Arc<dyn Accel>>,
    /// Other frames that it is compared with.
    neighbours: Vec<Neighbour>,
    /// Images are those of this scene.
    is_decoded: bool,
}

impl fmt::Debug for Session {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Session").field("file", &self.file.path()).finish_non_exhaustive()
    }
}

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
        let path = path.as_ref();
        let mut file = SceneFile::read(path, &options.settings)?;
        let says_nothing = file.spec.layers.is_empty() && file.spec.tracer.is_none();
        if file.kind() == FileKind::Model && says_nothing {
            // A bare model gets a picture and the two layers that most people come for.
            let mut settings = options.settings.clone();
            settings.push(("tracer".to_owned(), r#"{"type": "facing"}"#.to_owned()));
            settings.push(("layers".to_owned(), r#"["depth", "normal"]"#.to_owned()));
            file = SceneFile::read(path, &settings)?;
        }
        Ok(Self::of(file, options))
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
        let file = SceneFile::from_json(folder.as_ref(), scene)?;
        let file = if options.settings.is_empty() { file } else { file.with(&options.settings)? };
        Ok(Self::of(file, options))
    }

    fn of(file: SceneFile, options: Options) -> Self {
        Self {
            file,
            shown: None,
            frames: None,
            options,
            cache: Cache::default(),
            loaded: None,
            structures: Structures::default(),
            images: Arc::default(),
            settings: Vec::new(),
            seconds: Seconds::default(),
            checkpoint: None,
        }
    }

    /// Adds a mesh, or replaces it: objects whose `file` is `name` are made of it. Three coordinates a
    /// vertex (m) and three vertices a triangle, counter-clockwise from its front.
    ///
    /// # Errors
    ///
    /// When a triangle names a vertex that is not there, or has a corner that is not finite.
    pub fn insert_mesh(
        &mut self,
        name: &str,
        vertices: &[[f64; 3]],
        triangles: &[[u32; 3]],
    ) -> Result<(), Error> {
        let mesh = Mesh::from_arrays(name, vertices, triangles)
            .map_err(|why| Error::Refused(format!("mesh \"{name}\": {why}")))?;
        self.cache.insert_mesh(name, mesh);
        self.loaded = None;
        Ok(())
    }

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
        let settings: Vec<(String, String)> =
            values.map(|(path, value)| (path.to_owned(), value.to_string())).collect();
        self.file = self.file.with(&settings)?;
        // What was set before at the same path is of no effect any more.
        self.settings.retain(|(path, _)| settings.iter().all(|(other, _)| other != path));
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
            false => self.set_all(changes.iter().map(|(path, value)| (&**path, value.clone()))),
        }
    }

    /// Reads the scene's file again, with all that was set since, and at the next render the models and
    /// images that have changed on disk. When it is refused, the session is as it was.
    ///
    /// # Errors
    ///
    /// As [`Self::open`]; a scene that stands in no file is as it was.
    pub fn reload(&mut self) -> Result<(), Error> {
        if !self.file.is_in_memory() {
            let mut again = Self::open_with(self.file.path(), self.options.clone())?.file;
            if !self.settings.is_empty() {
                again = again.with(&self.settings)?;
            }
            self.file = again;
        }
        self.leave_frame();
        Ok(())
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

    /// The frames of the scene, in order; `None` when its file has no `frames` and is one picture.
    ///
    /// # Errors
    ///
    /// When they make no sense, or a trajectory's file is missing or broken; and as [`Self::scene`], for a
    /// path that begins where the scene's camera stands.
    pub fn frames(&mut self, progress: &Progress) -> Result<Option<Vec<Frame>>, Error> {
        self.leave_frame();
        // Of a path the camera's own place is wanted, which may depend on the models.
        if let Some(FramesSpec::Path(_)) = self.file.spec.frames {
            self.load(progress)?;
        }
        let start = || {
            let scene = self.loaded.as_ref().map(|loaded| &loaded.scene);
            scene.map(|scene| Start::of(scene)).ok_or(SceneError::Stopped)
        };
        let frames = self.file.frames(self.options.reach, start)?;
        self.frames = frames.as_deref().map(Arc::from);
        Ok(frames)
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

    fn leave_frame(&mut self) {
        self.shown = None;
        self.frames = None;
        self.loaded = None;
    }

    /// Whether `out` holds all files of frame `number`, named by `pattern`, as the scene is now.
    ///
    /// # Errors
    ///
    /// As [`Self::scene`].
    pub fn is_complete(
        &mut self,
        (out, pattern): (&Path, &FramePattern),
        number: usize,
        progress: &Progress,
    ) -> Result<bool, Error> {
        self.load(progress)?;
        let outputs = self.options.outputs;
        let Loaded { scene, plan, neighbours, .. } = self.loaded()?;
        let prints = fingerprints(scene, neighbours)?;
        let mut files = certain_files(plan.names(scene), outputs);
        files.extend(scene.sensor.as_ref().map(|_| "sensor.json".to_owned()));
        Ok(pattern.is_complete(out, number, &prints, &files))
    }

    /// What is known of the next render before it is begun; the scene is read when it is not.
    ///
    /// # Errors
    ///
    /// As [`Self::scene`].
    pub fn prospect(&mut self, progress: &Progress) -> Result<Prospect<'_>, Error> {
        self.load(progress)?;
        let Loaded { scene, plan, .. } = self.loaded()?;
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

    /// What a render will do, and why.
    ///
    /// # Errors
    ///
    /// As [`Self::scene`].
    pub fn plan(&mut self, progress: &Progress) -> Result<&Plan, Error> {
        self.load(progress)?;
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
        let layers = loaded.plan.names(&loaded.scene);
        if let Some([output, wanted]) = Manner::without_layer(outputs, &layers) {
            let why = format!(
                "outputs: `{output}` is a file of {wanted}, and the scene has no such layer; add it to \
                 `layers`, or leave `{output}` out"
            );
            return Err(Error::Refused(why));
        }
        let names = file_names(&loaded.scene, &loaded.plan, outputs);
        let names = names.into_iter().chain(also.iter().map(|&name| name.to_owned()));
        let results: Vec<PathBuf> = names.map(|name| folder.join(name)).collect();
        places::keep_apart(&loaded.scene.inputs, &results)?;
        Ok(results)
    }

    /// Renders the scene as it is now. When it is stopped while it renders and every pixel has samples, the
    /// picture of these is returned: see [`Rendering::partial`].
    ///
    /// # Errors
    ///
    /// As [`Self::prepare`], and when it is stopped before.
    pub fn render(&mut self, progress: &Progress) -> Result<Rendering, Error> {
        let clock = self.clock();
        let film = self.trace(None, &[], progress)?;
        self.conclude(film, clock, progress)
    }

    /// Renders a share of the picture's rows, or of its samples, and writes it to `path`, for [`merge`](Self::merge). `origin` goes
    /// with it, for whoever merges: [`Shares`](crate::Shares) reads it.
    ///
    /// # Errors
    ///
    /// As [`Self::render`], and when it is stopped at all.
    pub fn render_shard(
        &mut self,
        shard: Shard,
        path: &Path,
        origin: &Value,
        progress: &Progress,
    ) -> Result<(), Error> {
        let film = self.trace(Some(shard), &[], progress)?;
        let Loaded { scene, plan, .. } = self.loaded()?;
        if !film.is_complete() {
            return Err(RenderError::Stopped.into());
        }
        film.notes().iter().for_each(|note| progress.note(note));
        Ok(film.write(path, &self.identity(scene, plan)?, origin)?)
    }

    /// Puts the shares of a render together: the rendering that one machine would have made, to the bit when
    /// they are of its rows. Those of its samples are added as exactly as two f64 hold them.
    ///
    /// # Errors
    ///
    /// As [`Self::scene_and_accel`]; when a share is missing, given twice, or of another render.
    pub fn merge(&mut self, shares: &Shares, progress: &Progress) -> Result<Rendering, Error> {
        let clock = self.clock();
        self.prepare(progress)?;
        let film = if shares.are_of_samples() {
            self.trace(None, &shares.files, progress)?
        } else {
            let Loaded { scene, plan, .. } = self.loaded()?;
            Film::merged(scene, plan, &shares.files, &self.identity(scene, plan)?)?
        };
        self.conclude(film, clock, progress)
    }

    /// Keeps what there is of a render at `checkpoint` on the way, and goes on from there: after an
    /// interruption the same render takes up what was kept. The file stays until it is removed.
    pub fn keep_at(&mut self, checkpoint: Option<Checkpoint>) {
        self.checkpoint = checkpoint;
    }

    /// When a render began, and what was prepared before it: a part of its time, too.
    fn clock(&self) -> (Instant, f64) {
        (Instant::now(), self.seconds.load + self.seconds.build + self.seconds.decode)
    }

    /// Traces the scene, or a share of it, or puts shares of its samples together.
    fn trace(
        &mut self,
        shard: Option<Shard>,
        shares: &[FilmFile],
        progress: &Progress,
    ) -> Result<Film, Error> {
        self.prepare(progress)?;
        let Loaded { scene, plan, neighbours, .. } = self.loaded()?;
        let identity = match (&shard, &self.checkpoint) {
            (None, None) if shares.is_empty() => Identity::new(),
            _ => self.identity(scene, plan)?,
        };
        let course = Course { shard, shares, checkpoint: self.checkpoint.clone(), identity };
        let (accel, start) = (self.built()?, Instant::now());
        let header = header(scene, &fingerprints(scene, neighbours)?);
        let others: Vec<FollowedFrame<'_>> =
            neighbours.iter().filter_map(|other| other.followed(scene)).collect();
        let prepared = Prepared { accel, images: &self.images, others: &others };
        let film = etendue_render::trace(scene, plan, prepared, &header, &course, progress)?;
        self.seconds.render = start.elapsed().as_secs_f64();
        Ok(film)
    }

    /// What films must agree in to be of one picture.
    fn identity(&self, scene: &Scene, plan: &Plan) -> Result<Identity, Error> {
        let [width, height] = scene.camera.resolution();
        let layers: Vec<_> = plan.layers.iter().map(|layer| layer.row().name).collect();
        let own = [
            ("version", SOFTWARE.to_owned()),
            ("accelerator", self.built()?.report().backend),
            ("resolution", format!("{width} x {height}")),
            ("number of samples", plan.samples.to_string()),
            ("seed", scene.render.seed.to_string()),
            ("list of layers", layers.join(", ")),
            ("precision", format!("{:?}", plan.precision).to_lowercase()),
        ];
        let own = own.map(|(key, value)| (key.to_owned(), value));
        let prints = fingerprints(scene, &self.loaded()?.neighbours)?;
        let prints = prints.into_iter().map(|(key, value)| (key.replace('_', " "), value));
        Ok(own.into_iter().chain(prints).collect())
    }

    /// The rendering of a film, with its report.
    fn conclude(
        &mut self,
        film: Film,
        (start, before): (Instant, f64),
        progress: &Progress,
    ) -> Result<Rendering, Error> {
        let loaded = self.loaded()?;
        let (scene, plan, accel) = (Arc::clone(&loaded.scene), &loaded.plan, self.built()?);
        let structure = loaded.accel.clone();
        let fingerprints = fingerprints(&scene, &loaded.neighbours)?;
        let header = header(&scene, &fingerprints);
        let rendered = etendue_render::finish(&scene, plan, film, header, Some(accel))?;
        let mut seconds = self.seconds;
        seconds.total = start.elapsed().as_secs_f64() + before;
        let mut more = rendered.notes.clone();
        more.extend(not_finite(&rendered));
        more.extend(changed(&scene));
        let mut others = loaded.neighbours.iter().filter_map(|other| other.followed(&scene));
        if others.any(|other| other.loses_some()) {
            more.push(NOT_FOLLOWED.to_owned());
        }
        more.iter().for_each(|note| progress.note(note));
        let mut notes = loaded.notes.clone();
        notes.extend(self.images.faults.iter().cloned());
        notes.extend(more);
        let mut report = self.report(&scene, accel, &rendered, seconds)?;
        report.notes = notes;
        self.seconds = Seconds::default();
        let Rendered { picture, band_film, .. } = rendered;
        // The views of a light field are rendered when they are written.
        let traced = structure
            .filter(|_| scene.camera.light_field().is_some())
            .map(|accel| (accel, Arc::clone(&self.images)));
        Rendering::new(scene, (picture, band_film), traced, (report, fingerprints))
    }

    /// The scene, the structure over it and its images, once they are [prepared](Self::prepare).
    pub(crate) fn prepared(&self) -> Result<Ready, Error> {
        let Loaded { scene, accel, .. } = self.loaded()?;
        let accel = accel.clone().ok_or_else(not_built)?;
        Ok((Arc::clone(scene), accel, Arc::clone(&self.images)))
    }

    /// What is to be written of the pictures.
    pub(crate) fn outputs(&self) -> Outputs {
        self.options.outputs
    }

    fn loaded(&self) -> Result<&Loaded, Error> {
        self.loaded.as_ref().ok_or_else(|| Error::Refused("the scene is not loaded".to_owned()))
    }

    fn built(&self) -> Result<&dyn Accel, Error> {
        self.loaded()?.accel.as_deref().ok_or_else(not_built)
    }

    /// Loads the scene, if it is not, and the frames that it is compared with.
    fn load(&mut self, progress: &Progress) -> Result<(), Error> {
        if self.loaded.is_some() {
            return Ok(());
        }
        let start = Instant::now();
        let neighbours = self.load_neighbours(progress)?;
        let mut scene = self.load_file(self.file(), progress)?;
        neighbours::refuse_views(&scene)?;
        neighbours::leave_out(&mut scene, &neighbours);
        let notes: Vec<String> = scene.notes.iter().map(in_words).collect();
        notes.iter().for_each(|note| progress.note(note));
        let plan = Plan::new(&scene, self.options.outputs);
        let scene = Arc::new(scene);
        self.loaded =
            Some(Loaded { scene, plan, notes, accel: None, neighbours, is_decoded: false });
        self.seconds.load += start.elapsed().as_secs_f64();
        Ok(())
    }

    fn load_file(&self, file: &SceneFile, progress: &Progress) -> Result<Scene, Error> {
        let wanted = plan::wanted(&file.spec.all_layers());
        let share = |done: usize, total: usize| done as f64 / total.max(1) as f64;
        let goes_on = |step: etendue_scene::LoadProgress<'_>| {
            progress.goes_on(Phase::Load, share(step.done, step.total))
        };
        let options = LoadOptions {
            strictness: self.options.strictness,
            reach: self.options.reach,
            camera: self.options.camera.as_deref(),
            memory_limit: self.options.memory_limit,
            to_render: self.options.to_render,
            copy: self.options.copy,
            cache: Some(&self.cache),
            progress: Some(&goes_on),
        };
        Ok(file.load(wanted, &options)?)
    }

    fn load_neighbours(&self, progress: &Progress) -> Result<Vec<Neighbour>, Error> {
        let steps = neighbours::steps(&self.file().spec.all_layers());
        if steps.is_empty() {
            return Ok(Vec::new());
        }
        if self.file.spec.frames.is_none() {
            let path = self.file.path().display();
            return Err(Error::Refused(format!(
                "{path}: layers: flow, disparity and occlusion compare frames, and the scene has no `frames`"
            )));
        }
        // The scene by itself, when no frame is shown, has no neighbours.
        let (Some((number, _)), Some(frames)) = (&self.shown, &self.frames) else {
            return Ok(Vec::new());
        };
        let load = |(step, frame): (_, &Frame)| {
            let scene = Arc::new(self.load_file(&self.file.at(frame)?, progress)?);
            Ok(Neighbour { step, scene, accel: None })
        };
        neighbours::around(frames, *number, &steps).into_iter().map(load).collect()
    }

    /// Builds the structures, unless there are such over the same surfaces.
    fn build(&mut self, progress: &Progress) -> Result<(), Error> {
        self.load(progress)?;
        let start = Instant::now();
        let options = BuildOptions {
            threads: rayon::current_num_threads(),
            memory_limit: self.options.memory_limit,
            robust: self.options.robust,
            isa: self.options.isa.clone(),
            progress: Some(progress.of(Phase::Build)),
            ..BuildOptions::default()
        };
        let Some(loaded) = &mut self.loaded else { return Ok(()) };
        let Loaded { scene, plan, accel, neighbours, .. } = loaded;
        let structures = &mut self.structures;
        let mut is_new = false;
        // What is free now was judged when the structure was built; a limit holds for every picture.
        if self.options.memory_limit.is_some() {
            fits(scene, plan, self.options.memory_limit)?;
        }
        let others = neighbours.iter_mut().map(|other| (&other.scene, &mut other.accel));
        for (scene, accel) in std::iter::once((&*scene, accel)).chain(others) {
            if accel.is_none() {
                *accel = structures.over(scene, plan);
            }
            if accel.is_none() {
                fits(scene, plan, self.options.memory_limit)?;
                *accel = Some(structures.build(scene, plan, &options)?);
                is_new = true;
            }
        }
        let others = neighbours.iter().map(|other| &*other.scene);
        structures.keep(std::iter::once(&**scene).chain(others));
        if is_new {
            self.seconds.build += start.elapsed().as_secs_f64();
        }
        Ok(())
    }

    /// Decodes the images that the plan wants, unless they are.
    fn decode(&mut self, progress: &Progress) -> Result<(), Error> {
        let Loaded { scene, plan, is_decoded, .. } = self.loaded()?;
        if *is_decoded {
            return Ok(());
        }
        let start = Instant::now();
        let images = self.images.renewed(scene, plan, self.options.memory_limit)?;
        if let (Strictness::Strict, Some(fault)) = (self.options.strictness, images.faults.first())
        {
            return Err(Error::Refused(fault.clone()));
        }
        images.faults.iter().for_each(|fault| progress.note(fault));
        self.images = Arc::new(images);
        if let Some(loaded) = &mut self.loaded {
            loaded.is_decoded = true;
        }
        self.seconds.decode += start.elapsed().as_secs_f64();
        Ok(())
    }

    fn report(
        &self,
        scene: &Scene,
        accel: &dyn Accel,
        rendered: &Rendered,
        seconds: Seconds,
    ) -> Result<Report, Error> {
        let (built, counts) = (accel.report(), accel.counts());
        let (peak, private) = memory();
        let sizes = self.images.sizes(scene);
        Ok(Report {
            software: SOFTWARE,
            scene: scene.path.clone(),
            scene_hash: scene.hash()?.to_string(),
            image_hash: ImageHash::of(&rendered.picture).to_string(),
            resolution: scene.camera.resolution(),
            layers: rendered.picture.layers().iter().map(Layer::title).collect(),
            accel: built.backend,
            build_quality: format!("{:?}", built.quality).to_lowercase(),
            threads: rayon::current_num_threads(),
            seed: scene.render.seed,
            samples: rendered.samples,
            samples_wanted: rendered.samples_wanted,
            sample_counts: rendered.sample_counts,
            seconds,
            rays: rendered.rays,
            lens_rays: rendered.fates.total(),
            lens_losses: rendered.fates.losses(),
            mrays_per_second: rendered.rays as f64 / rendered.trace_time.as_secs_f64() / 1e6,
            rechecked: counts.rechecked,
            corrected: counts.corrected,
            triangles: scene.geometry.triangles(),
            triangles_unique: scene.geometry.triangles_unique(),
            placements: scene.geometry.placements.len() as u64,
            bvh_bytes: built.bytes,
            geometry_bytes_mapped: scene.stats.bytes_mapped,
            geometry_bytes_copied: scene.stats.bytes_copied + built.copied_bytes,
            image_bytes: sizes.iter().map(|size| size.bytes).sum(),
            images: sizes,
            not_finite: rendered.light.not_finite,
            peak_memory_bytes: peak,
            peak_private_bytes: private,
            notes: Vec::new(),
            files: Vec::new(),
        })
    }
}

fn not_built() -> Error {
    Error::Refused("the structure is not built".to_owned())
}

/// Refuses what will not fit into the memory that is allowed, or else free.
fn fits(scene: &Scene, plan: &Plan, limit: Option<u64>) -> Result<(), Error> {
    let memory = &plan.memory;
    let bytes = match limit {
        Some(_) => memory.total - memory.program,
        // What was loaded is no longer free.
        None => memory.to_come(),
    };
    let Err(error) = Budget::new(limit).take(bytes) else { return Ok(()) };
    let [width, height] = scene.camera.resolution();
    let images = scene.textures.iter().map(|texture| (texture.decoded_bytes(), &texture.name));
    let largest = match images.max() {
        Some((bytes, name)) if 2 * bytes > memory.total => {
            format!(" (most of it for the image {})", one_line(name))
        }
        _ => String::new(),
    };
    let path = scene.path.display();
    Err(Error::Refused(format!("{path}: a picture of {width} x {height} pixels{largest} {error}")))
}
