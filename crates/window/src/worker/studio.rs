//! The rendering thread's own side: a session, and what is done with it.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use etendue::{
    Error, Options, Outputs, Preview, Progress, Roughness, Screen, Session, ViewedFile, places,
};
use serde_json::Value;

use super::desk::{Kind, News, NewsSender, ScreenPicture, Task, Wish, WorkerState};
use crate::document::View;

/// Time that a first picture may take, so that it is on the screen within a tenth of a second, twenty in each: the
/// window is drawn twice meanwhile, by the same processor where there is no other.
const SOON: Duration = Duration::from_millis(30);

/// Pixels of a first picture when it is not known how long they take.
const FIRST_PIXELS: f64 = 40_000.0;

/// Progress is told this often.
const TELL: Duration = Duration::from_millis(60);

/// Interval at which files are looked at for changes when there is nothing else to do.
const WATCH: Duration = Duration::from_secs(1);

/// Stamp of a file when it was looked at last.
type Stamp = Option<(u64, SystemTime)>;

pub(super) struct PreviewRenderer {
    options: Options,
    sender: NewsSender,
    shared: Arc<WorkerState>,
    open: Option<OpenFile>,
    /// The image that is looked at instead, as it was.
    image: Option<(PathBuf, Stamp)>,
}

/// File that is open.
struct OpenFile {
    path: PathBuf,
    session: Session,
    /// Values of the file.
    base: Arc<Value>,
    /// The user's scene of the last wish.
    scene: Arc<Value>,
    /// The last wish that was followed.
    wish: Option<Wish>,
    /// Files of the scene as they were.
    files: Vec<(PathBuf, Stamp)>,
    /// Seconds that a pixel of the view took last.
    cost: Option<(View, f64)>,
}

/// Job that is next.
enum WorkerJob {
    Task(Task),
    Wish(Wish),
    Watch,
    Close,
}

impl PreviewRenderer {
    pub(super) fn new(options: Options, sender: NewsSender, shared: Arc<WorkerState>) -> Self {
        Self { options, sender, shared, open: None, image: None }
    }

    pub(super) fn work(&mut self) {
        loop {
            match self.next() {
                WorkerJob::Close => return,
                WorkerJob::Watch => self.look_for_changes(),
                WorkerJob::Task(task) => self.carry_out(task),
                WorkerJob::Wish(wish) => self.follow(wish),
            }
        }
    }

    fn next(&self) -> WorkerJob {
        let mut desk = self.shared.desk();
        (desk.refining, desk.working) = (None, None);
        let mut is_idle = false;
        loop {
            if desk.closes {
                return WorkerJob::Close;
            }
            if let Some(task) = desk.tasks.pop_front() {
                return WorkerJob::Task(task);
            }
            if let Some(wish) = desk.wish.take() {
                return WorkerJob::Wish(wish);
            }
            if !is_idle {
                self.sender.send(News::Idle);
                is_idle = true;
            }
            let waited = self.shared.bell.wait_timeout(desk, WATCH);
            let (back, timeout) = waited.unwrap_or_else(std::sync::PoisonError::into_inner);
            desk = back;
            if timeout.timed_out() && self.has_changes() {
                return WorkerJob::Watch;
            }
        }
    }

    /// A progress that tells the window; stopped by the user alone, or also for something newer.
    fn progress(&self, may_be_replaced: bool) -> Progress {
        let sender = self.sender.clone();
        let last = std::sync::Mutex::new(None::<Instant>);
        let progress = Progress::new(move |phase, share| {
            if let Ok(mut last) = last.try_lock()
                && last.is_none_or(|at| at.elapsed() > TELL)
            {
                *last = Some(Instant::now());
                sender.send(News::Busy(phase.name(), share));
            }
            true
        });
        let mut desk = self.shared.desk();
        if desk.closes || (may_be_replaced && (desk.wish.is_some() || !desk.tasks.is_empty())) {
            progress.cancel();
        }
        let place = if may_be_replaced { &mut desk.refining } else { &mut desk.working };
        *place = Some(progress.clone());
        progress
    }

    fn carry_out(&mut self, task: Task) {
        let done = match task {
            Task::Open(path) => self.open(path),
            Task::Begin(name, json) => self.begin(name, json),
            Task::Save(path, scene) => self.save(path, &scene),
            Task::Render(folder, scene, frame) => self.render(folder, &scene, frame),
        };
        if let Err(error) = done {
            self.sender.fault(&error);
        }
    }

    fn open(&mut self, path: PathBuf) -> Result<(), Error> {
        let files = vec![(path.clone(), stamp(&path))];
        let (kind, session) = match open_scene(&path, &self.options)? {
            Ok(scene) => scene,
            Err(image) => {
                (self.open, self.image) = (None, Some((path.clone(), stamp(&path))));
                self.sender.send(News::Looked(path, image));
                return Ok(());
            }
        };
        let base = Arc::new(session.values().clone());
        let scene = Arc::clone(&base);
        self.sender.send(News::Opened(path.clone(), kind, Arc::clone(&base)));
        self.image = None;
        self.open = Some(OpenFile { path, session, base, scene, wish: None, files, cost: None });
        Ok(())
    }

    /// Opens a scene that is in no file. Where it would be saved is the current folder.
    fn begin(&mut self, name: &str, json: &str) -> Result<(), Error> {
        let refused = |error: serde_json::Error| Error::Refused(error.to_string());
        let scene: Value = serde_json::from_str(json).map_err(refused)?;
        let session = Session::from_json_with(".", scene, self.options.clone())?;
        let base = Arc::new(session.values().clone());
        let (path, scene) = (PathBuf::from(name), Arc::clone(&base));
        self.sender.send(News::Opened(path.clone(), Kind::First, Arc::clone(&base)));
        self.image = None;
        let files = Vec::new();
        self.open = Some(OpenFile { path, session, base, scene, wish: None, files, cost: None });
        Ok(())
    }

    fn save(&mut self, path: PathBuf, scene: &Arc<Value>) -> Result<(), Error> {
        let Some(open) = &mut self.open else { return Ok(()) };
        open.session.replace(scene)?;
        open.session.save(&path)?;
        if open.path != path {
            // From now on it is that file's scene.
            self.open(path.clone())?;
        } else {
            open.base = Arc::clone(scene);
        }
        if let Some(open) = &mut self.open {
            open.files.iter_mut().for_each(|(path, was)| *was = stamp(path));
        }
        self.sender.send(News::Saved(path, Arc::clone(scene)));
        Ok(())
    }

    fn render(
        &mut self,
        folder: PathBuf,
        scene: &Value,
        frame: Option<usize>,
    ) -> Result<(), Error> {
        let progress = self.progress(false);
        let Some(open) = &mut self.open else { return Ok(()) };
        open.session.replace(scene)?;
        show_frame(&mut open.session, frame, &progress)?;
        places::folder(&folder)?;
        open.session.check_place(&folder, &[], &progress)?;
        let rendering = open.session.render(&progress)?;
        let written = rendering.write_with(&folder, Outputs::ALL, &progress)?;
        self.sender.send(News::Written(folder, written.files.len()));
        Ok(())
    }

    fn has_changes(&self) -> bool {
        let files = self.open.iter().flat_map(|open| &open.files).chain(&self.image);
        files.into_iter().any(|(path, was)| stamp(path) != *was)
    }

    fn look_for_changes(&mut self) {
        if let Some((path, was)) = &mut self.image {
            *was = stamp(path);
            let path = path.clone();
            return self.carry_out(Task::Open(path));
        }
        let Some(open) = &mut self.open else { return };
        open.files.iter_mut().for_each(|(path, was)| *was = stamp(path));
        match open.take_up(&self.options) {
            Ok(()) => {
                let (base, scene) = (Arc::clone(&open.base), Arc::clone(&open.scene));
                self.sender.send(News::TakenUp(base, Arc::clone(&scene)));
                if let Some(wish) = open.wish.clone() {
                    self.follow(Wish { scene, ..wish });
                }
            }
            // Often it is being written, and complete in a moment.
            Err(error) => self.sender.fault(&error),
        }
    }

    fn follow(&mut self, wish: Wish) {
        let number = wish.number;
        match self.follow_to_the_end(wish) {
            Ok(()) => {}
            Err(error) if error.is_stopped() => {}
            Err(error) => self.sender.send(News::Refused(number, error.message())),
        }
    }

    fn follow_to_the_end(&mut self, wish: Wish) -> Result<(), Error> {
        let patient = self.progress(false);
        let Some(open) = &mut self.open else { return Ok(()) };
        open.session.replace(&wish.view.of(&wish.scene))?;
        let frames = show_frame(&mut open.session, wish.frame, &patient)?;
        let inspector = open.session.inspector(&patient)?;
        let inputs = inspector.scene().inputs.iter();
        open.files = inputs.map(|path| (path.clone(), stamp(path))).collect();
        let samples = inspector.scene().render.samples.most();
        let pixels: f64 = inspector.scene().camera.resolution().map(f64::from).iter().product();
        open.scene = Arc::clone(&wish.scene);
        open.wish = Some(wish.clone());
        let scene = Arc::clone(&wish.scene);
        self.sender.send(News::Accepted(wish.number, scene, inspector, frames));
        let mut factor = self.first_factor(&wish.view, pixels);
        let mut progress = patient;
        // A single sample of the fine picture is of use where many are to follow.
        let finest = if samples > 4 { 1 } else { 2 };
        while factor >= finest {
            let rough = Roughness { factor, samples: Some(1) };
            let preview = self.preview(rough, &progress)?;
            let cost = preview.time().as_secs_f64() * f64::from(factor * factor) / pixels;
            if let Some(open) = &mut self.open {
                open.cost = Some((wish.view.clone(), cost));
            }
            self.show(&wish, preview, false)?;
            progress = self.progress(true);
            factor = if factor > 3 { factor / 3 } else { factor - 1 };
        }
        let progress = self.progress(true).with_looks(self.looks(&wish));
        let preview = self.preview(Roughness::NONE, &progress)?;
        let is_whole = !progress.is_cancelled();
        self.show(&wish, preview, is_whole)
    }

    fn preview(&mut self, rough: Roughness, progress: &Progress) -> Result<Preview, Error> {
        let open =
            self.open.as_mut().ok_or_else(|| Error::Refused("nothing is open".to_owned()))?;
        open.session.preview(rough, progress)
    }

    /// Pixels so large that a first picture is there soon.
    fn first_factor(&self, view: &View, pixels: f64) -> u32 {
        let known = self.open.as_ref().and_then(|open| open.cost.as_ref());
        let most = match known {
            Some((of, cost)) if of == view && *cost > 0.0 => SOON.as_secs_f64() / cost,
            _ => FIRST_PIXELS,
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let factor = (pixels / most.max(64.0)).sqrt().ceil().clamp(1.0, 64.0) as u32;
        factor
    }

    /// Shows the picture after each pass of samples.
    fn looks(&self, wish: &Wish) -> impl Fn(&etendue::SoFar<'_>) + Send + Sync + 'static {
        let (sender, number) = (self.sender.clone(), wish.number);
        let is_picture = wish.view == View::Picture;
        move |so_far| {
            if !is_picture {
                return;
            }
            let screen = so_far.picture().ok().and_then(|p| Screen::of_layer(&p, "").ok());
            if let Some(screen) = screen {
                sender.send(News::Shown(Box::new(ScreenPicture {
                    number,
                    screen,
                    factor: 1,
                    layer: String::new(),
                    layers: Vec::new(),
                    preview: None,
                    samples: Some(so_far.samples),
                    is_final: false,
                })));
            }
        }
    }

    fn show(&self, wish: &Wish, preview: Preview, is_final: bool) -> Result<(), Error> {
        let layers: Vec<String> = preview.layers().iter().map(|layer| layer.name.clone()).collect();
        let wanted = wish.part.clone();
        let layer = match &wish.view {
            View::Layer(_) => {
                wanted.filter(|name| layers.contains(name)).or(layers.first().cloned())
            }
            _ => Some(String::new()),
        };
        let layer = layer.unwrap_or_default();
        let screen = screen_of(&preview, &wish.view, &layer)?;
        let samples = match wish.view {
            View::Layer(_) => None,
            _ => Some(preview.samples()),
        };
        let factor = preview.factor();
        let preview = Some(Arc::new(preview));
        let number = wish.number;
        let shown =
            ScreenPicture { number, screen, factor, layer, layers, preview, samples, is_final };
        self.sender.send(News::Shown(Box::new(shown)));
        Ok(())
    }
}

/// Screen of a view of a preview.
pub(crate) fn screen_of(preview: &Preview, view: &View, layer: &str) -> Result<Screen, Error> {
    let none = || {
        let why =
            "the camera's sensor is ideal\nhint: give it a `type` or a `model` to see its numbers";
        Error::Refused(why.to_owned())
    };
    match view {
        View::Picture | View::Layer(_) => preview.screen(layer),
        View::Sensor | View::Numbers => {
            let light = preview.sensor_light().ok_or_else(none)?;
            let raw = preview.raw()?.ok_or_else(none)?;
            Ok(match view {
                View::Sensor => Screen::of_sensor(light.sensor(), raw),
                _ => Screen::of_numbers(light.sensor(), raw),
            })
        }
    }
}

impl OpenFile {
    /// Reads the file again, and sets anew what was edited and not saved.
    fn take_up(&mut self, options: &Options) -> Result<(), Error> {
        let (_, mut file) = open_scene(&self.path, options)?.map_err(|_| {
            let why = "is an image now, which has no scene";
            Error::Refused(format!("{}: {why}", self.path.display()))
        })?;
        let base = Arc::new(file.values().clone());
        file.set_changes(&self.base, &self.scene)?;
        let scene = Arc::new(file.values().clone());
        // Models and images that have changed are read again.
        self.session.reload()?;
        (self.base, self.scene) = (base, scene);
        Ok(())
    }
}

/// The scene of a file, or the image that it is.
fn open_scene(
    path: &Path,
    options: &Options,
) -> Result<Result<(Kind, Session), Arc<etendue::Still>>, Error> {
    Ok(match ViewedFile::open(path, options.clone())? {
        ViewedFile::Scene(session) => Ok((Kind::Scene, *session)),
        ViewedFile::Model(session) => Ok((Kind::Model, *session)),
        ViewedFile::Lens(session) => Ok((Kind::Lens, *session)),
        ViewedFile::Image(still) => Err(Arc::from(still)),
    })
}

/// Takes the session to a frame, and tells how many there are.
fn show_frame(
    session: &mut Session,
    frame: Option<usize>,
    progress: &Progress,
) -> Result<Option<usize>, Error> {
    if session.values().get("frames").is_none_or(Value::is_null) {
        return Ok(None);
    }
    let Some(frames) = session.frames(progress)? else { return Ok(None) };
    if let Some(frame) = frame.and_then(|frame| frames.get(frame)) {
        session.show(frame)?;
    }
    Ok(Some(frames.len()))
}

fn stamp(path: &Path) -> Stamp {
    let data = path.metadata().ok()?;
    Some((data.len(), data.modified().ok()?))
}
