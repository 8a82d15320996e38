//! Scenes and their pictures.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use etendue::{Options, Outputs, Progress, Reach, Strictness};
use etendue_render::output::{png, sidecar};
use numpy::{IntoPyArray, PyReadonlyArray2};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::Value;

use crate::arrays::{of_layer, raised, refused, shaped, triples};

/// How often Python is asked whether Ctrl-C was pressed, and shown progress (ms).
const LOOK: u64 = 50;

/// A scene that is opened once, changed and rendered often.
#[pyclass]
pub struct Session {
    session: etendue::Session,
    frames: Vec<etendue::Frame>,
}

#[pymethods]
impl Session {
    #[staticmethod]
    fn open(
        path: &str,
        settings: Vec<(String, String)>,
        strict: bool,
        allow_outside: bool,
        memory_limit: Option<u64>,
    ) -> PyResult<Self> {
        let options = options(settings, strict, allow_outside, memory_limit);
        let session = etendue::Session::open_with(path, options).map_err(raised)?;
        Ok(Self { session, frames: Vec::new() })
    }

    #[staticmethod]
    fn from_json(
        scene: &str,
        folder: &str,
        strict: bool,
        allow_outside: bool,
        memory_limit: Option<u64>,
    ) -> PyResult<Self> {
        let scene: Value = serde_json::from_str(scene).map_err(refused)?;
        let options = options(Vec::new(), strict, allow_outside, memory_limit);
        let session = etendue::Session::from_json_with(folder, scene, options).map_err(raised)?;
        Ok(Self { session, frames: Vec::new() })
    }

    fn insert_mesh(
        &mut self,
        name: &str,
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, u32>,
    ) -> PyResult<()> {
        let (vertices, faces) = (triples("vertices", &vertices)?, triples("faces", &faces)?);
        self.session.insert_mesh(name, &vertices, &faces).map_err(raised)
    }

    fn set(&mut self, path: &str, json: &str) -> PyResult<()> {
        let value: Value = serde_json::from_str(json).map_err(refused)?;
        self.session.set(path, value).map_err(raised)
    }

    fn values(&self) -> String {
        self.session.values().to_string()
    }

    fn plan(&mut self, py: Python<'_>) -> PyResult<String> {
        py.detach(|| self.session.plan(&Progress::none()).map(ToString::to_string)).map_err(raised)
    }

    /// The number of frames; 0 for one picture.
    fn load_frames(&mut self, py: Python<'_>) -> PyResult<usize> {
        let frames = py.detach(|| self.session.frames(&Progress::none())).map_err(raised)?;
        self.frames = frames.unwrap_or_default();
        Ok(self.frames.len())
    }

    fn show(&mut self, frame: usize) -> PyResult<()> {
        let frame = self.frames.get(frame).ok_or_else(|| refused("no such frame"))?;
        self.session.show(frame).map_err(raised)
    }

    /// Renders without Python's lock; `told` is called with the stage and the share done now and then.
    fn render(&mut self, py: Python<'_>, told: Option<Py<PyAny>>) -> PyResult<Rendering> {
        let progress = watched(told);
        let session = &mut self.session;
        let rendering = interruptible(py, &progress, || session.render(&progress))?;
        Ok(Rendering { rendering })
    }
}

fn options(
    settings: Vec<(String, String)>,
    strict: bool,
    allow_outside: bool,
    memory_limit: Option<u64>,
) -> Options {
    Options {
        settings,
        strictness: if strict { Strictness::Strict } else { Strictness::Tolerant },
        reach: if allow_outside { Reach::Anywhere } else { Reach::OwnFolder },
        memory_limit,
        ..Options::default()
    }
}

/// Progress that shows itself to Python and stops when Python is interrupted.
fn watched(told: Option<Py<PyAny>>) -> Progress {
    let start = Instant::now();
    let next = Arc::new(AtomicU64::new(0));
    Progress::new(move |stage, share| {
        let now = u64::try_from(start.elapsed().as_millis()).unwrap_or(u64::MAX);
        let due = next.load(Ordering::Relaxed);
        let later = now + LOOK;
        let is_mine = now >= due
            && next.compare_exchange(due, later, Ordering::Relaxed, Ordering::Relaxed).is_ok();
        if !is_mine {
            return true;
        }
        let Some(told) = &told else { return true };
        // What a callback raises stops the work.
        Python::attach(|py| told.call1(py, (stage.name(), share)).is_ok())
    })
}

/// Does `work` in a thread of its own, without Python's lock, while this one asks whether Ctrl-C was pressed:
/// Python tells no other thread. Then the work is stopped, and what it left is dropped.
fn interruptible<T: Send>(
    py: Python<'_>,
    progress: &Progress,
    work: impl FnOnce() -> Result<T, etendue::Error> + Send,
) -> PyResult<T> {
    let mut interrupted = None;
    let done = py.detach(|| {
        std::thread::scope(|scope| {
            let (sender, receiver) = mpsc::channel();
            scope.spawn(move || sender.send(work()));
            loop {
                match receiver.recv_timeout(Duration::from_millis(LOOK)) {
                    Ok(done) => return Some(done),
                    // The work panicked, which was told.
                    Err(mpsc::RecvTimeoutError::Disconnected) => return None,
                    Err(mpsc::RecvTimeoutError::Timeout) => {
                        if let Err(raised) = Python::attach(|py| py.check_signals()) {
                            interrupted = Some(raised);
                            progress.cancel();
                        }
                    }
                }
            }
        })
    });
    match (interrupted, done) {
        (Some(raised), _) => Err(raised),
        (None, Some(done)) => done.map_err(raised),
        (None, None) => Err(PyRuntimeError::new_err("a fault of etendue; see the message above")),
    }
}

/// A rendered picture with its layers.
#[pyclass(frozen)]
pub struct Rendering {
    rendering: etendue::Rendering,
}

#[pymethods]
impl Rendering {
    /// The names of the layers; the picture's is empty.
    fn layers(&self) -> Vec<String> {
        self.rendering.layers().iter().map(|layer| layer.name.clone()).collect()
    }

    fn layer<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let layer = self.rendering.layer(name);
        layer.map(|layer| of_layer(py, layer, self.rendering.resolution())).transpose()
    }

    /// What each layer means, as `layers.json` has it.
    fn meaning(&self, name: &str) -> Vec<(String, String)> {
        self.rendering.layer(name).map(|layer| layer.meaning.clone()).unwrap_or_default()
    }

    /// Exposure times (s) and frames.
    fn exposures(&self) -> Vec<(f64, u32)> {
        self.rendering.exposures().map(|e| (e.exposure, e.frame)).collect()
    }

    /// The digital numbers of an exposure.
    fn raw<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(exposure) = self.rendering.exposures().nth(index) else { return Ok(None) };
        let image = py.detach(|| self.rendering.raw(exposure)).map_err(raised)?;
        let Some(image) = image else { return Ok(None) };
        let (width, height, depth) = (image.width, image.height, image.depth);
        shaped(image.values.into_pyarray(py).into_any(), [height, width, depth]).map(Some)
    }

    fn report(&self) -> PyResult<String> {
        serde_json::to_string(self.rendering.report()).map_err(refused)
    }

    /// `camera.json`.
    fn camera(&self) -> PyResult<String> {
        serde_json::to_string(&self.rendering.scene().camera.opencv()).map_err(refused)
    }

    fn write(&self, py: Python<'_>, folder: &str, outputs: &str) -> PyResult<Vec<String>> {
        let outputs = Outputs::from_list(outputs).map_err(refused)?;
        let progress = watched(None);
        let written = interruptible(py, &progress, || {
            etendue::places::folder(folder.as_ref())?;
            self.rendering.write_with(folder.as_ref(), outputs, &progress)
        })?;
        Ok(written.files.iter().map(|path| path.display().to_string()).collect())
    }

    /// Writes one layer as a picture.
    fn write_png(&self, path: &str, name: &str) -> PyResult<()> {
        png::write(path.as_ref(), self.rendering.picture(), name, png::Bits::Eight).map_err(refused)
    }

    /// Writes what the layers mean.
    fn write_meaning(&self, path: &str) -> PyResult<()> {
        sidecar::write(path.as_ref(), self.rendering.picture()).map_err(refused)
    }

    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counts = PyDict::new(py);
        let report = self.rendering.report();
        counts.set_item("rays", report.rays)?;
        counts.set_item("samples", report.samples)?;
        Ok(counts)
    }
}
