//! Scenes and their pictures.

use std::path::PathBuf;
use std::sync::Arc;

use etendue::{Error, MeshAttributes, Options, Outputs, Progress, Reach, Setting, Strictness};
use etendue_files::Transaction;
use etendue_render::output::{png, sidecar};
use numpy::{IntoPyArray, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::Value;

use crate::arrays::{
    in_python, of_layer, of_mesh, of_vertices, raised, refused, rows, shaped, triples,
};
use crate::work::{StopSignal, interruptible};

/// Name, vertices, faces, and what is known at the vertices: texture coordinates, normals and colours.
type NamedMesh<'py> = (String, Bound<'py, PyAny>, Bound<'py, PyAny>, AtVertices<'py>);

/// Texture coordinates, normals and colours.
type AtVertices<'py> =
    (Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>);

/// The same as arrays that are given.
type GivenAtVertices<'py> = (
    Option<PyReadonlyArray2<'py, f32>>,
    Option<PyReadonlyArray2<'py, f32>>,
    Option<PyReadonlyArray2<'py, f32>>,
);

/// A scene that is opened once, changed and rendered often.
#[pyclass]
pub struct Session {
    session: etendue::Session,
    frames: Arc<[etendue::Frame]>,
}

impl Session {
    fn of(session: etendue::Session) -> Self {
        Self { session, frames: Arc::default() }
    }

    /// The session that `begin` makes of a scene's JSON.
    fn of_json(
        scene: &str,
        begin: impl FnOnce(Value) -> Result<etendue::Session, Error>,
    ) -> PyResult<Self> {
        let scene = serde_json::from_str(scene).map_err(refused)?;
        Ok(Self::of(begin(scene).map_err(raised)?))
    }

    /// Work on the session that tells `callback` how far it is.
    fn work<T: Send>(
        &mut self,
        py: Python<'_>,
        threads: usize,
        callback: Option<Py<PyAny>>,
        work: impl FnOnce(&mut etendue::Session, &Progress) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        let stop = StopSignal::default();
        let (session, progress) = (&mut self.session, stop.progress(callback));
        interruptible(py, threads, &stop, || work(session, &progress))?.map_err(raised)
    }
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
        let settings = settings.into_iter().map(|(path, value)| Setting { path, value }).collect();
        let options = options(settings, strict, allow_outside, memory_limit);
        Ok(Self::of(etendue::Session::open_with(path, options).map_err(raised)?))
    }

    #[staticmethod]
    fn from_json(
        scene: &str,
        folder: &str,
        strict: bool,
        allow_outside: bool,
        memory_limit: Option<u64>,
    ) -> PyResult<Self> {
        let options = options(Vec::new(), strict, allow_outside, memory_limit);
        let begin = |scene| etendue::Session::from_json_with(folder, scene, options);
        Self::of_json(scene, begin)
    }

    /// A session that `origin` and `insert_mesh` describe.
    #[staticmethod]
    fn restore(
        path: &str,
        scene: &str,
        inputs: Vec<PathBuf>,
        strict: bool,
        allow_outside: bool,
        memory_limit: Option<u64>,
    ) -> PyResult<Self> {
        let options = options(Vec::new(), strict, allow_outside, memory_limit);
        Self::of_json(scene, |scene| etendue::Session::restore(path, scene, inputs, options))
    }

    /// The scene's path, the values of the whole scene as JSON, and the files that were read for it.
    fn origin(&self) -> (String, String, Vec<PathBuf>) {
        let (path, values, inputs) = self.session.origin();
        (path.display().to_string(), values.to_string(), inputs)
    }

    /// Names, vertices and faces of the meshes that `insert_mesh` brought.
    fn meshes<'py>(&self, py: Python<'py>) -> PyResult<Vec<NamedMesh<'py>>> {
        let meshes = self.session.meshes().map(|(name, mesh)| {
            let (vertices, faces) = of_mesh(py, mesh)?;
            let uvs = of_vertices(py, mesh.uvs.first())?;
            let normals = of_vertices(py, mesh.normals.as_ref())?;
            let colors = of_vertices(py, mesh.colors.as_ref())?;
            Ok((name.to_owned(), vertices, faces, (uvs, normals, colors)))
        });
        meshes.collect()
    }

    fn insert_mesh(
        &mut self,
        name: &str,
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, u32>,
        at_vertices: GivenAtVertices<'_>,
    ) -> PyResult<()> {
        let (vertices, faces) = (triples("vertices", &vertices)?, triples("faces", &faces)?);
        let (uvs, normals, colors) = at_vertices;
        let (uvs, normals, colors) =
            (rows("uvs", uvs)?, rows("normals", normals)?, rows("colors", colors)?);
        let attributes = MeshAttributes {
            uvs: uvs.as_deref(),
            normals: normals.as_deref(),
            colors: colors.as_deref(),
        };
        self.session.insert_mesh_with(name, &vertices, &faces, attributes).map_err(raised)
    }

    /// Makes the scene that which `json` says.
    fn replace(&mut self, json: &str) -> PyResult<()> {
        let values: Value = serde_json::from_str(json).map_err(refused)?;
        self.session.replace(&values).map_err(raised)
    }

    fn set(&mut self, path: &str, json: &str) -> PyResult<()> {
        let value: Value = serde_json::from_str(json).map_err(refused)?;
        self.session.set(path, value).map_err(raised)
    }

    fn values(&self) -> String {
        self.session.values().to_string()
    }

    fn plan(&mut self, py: Python<'_>, threads: usize) -> PyResult<String> {
        let plan = |session: &mut etendue::Session, progress: &Progress| {
            session.plan(progress).map(ToString::to_string)
        };
        self.work(py, threads, None, plan).map(|plan| in_python(&plan))
    }

    /// The number of frames; 0 for one picture.
    fn load_frames(&mut self, py: Python<'_>, threads: usize) -> PyResult<usize> {
        let frames = self.work(py, threads, None, etendue::Session::frames)?;
        self.frames = frames.unwrap_or_default();
        Ok(self.frames.len())
    }

    fn show(&mut self, py: Python<'_>, frame: usize, threads: usize) -> PyResult<()> {
        let frame = self.frames.get(frame).cloned().ok_or_else(|| refused("no such frame"))?;
        self.work(py, threads, None, |session, _| session.show(&frame))
    }

    /// Renders without Python's lock; `callback` is called with the phase and the share done now and then.
    fn render(
        &mut self,
        py: Python<'_>,
        callback: Option<Py<PyAny>>,
        threads: usize,
        denoise: bool,
    ) -> PyResult<Rendering> {
        self.session.set_denoised(denoise);
        let rendering = self.work(py, threads, callback, etendue::Session::render)?;
        Ok(Rendering { rendering, threads })
    }
}

fn options(
    settings: Vec<Setting>,
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

/// A rendered picture with its layers.
#[pyclass(frozen)]
pub struct Rendering {
    rendering: etendue::Rendering,
    threads: usize,
}

impl Rendering {
    fn work<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&etendue::Rendering, &Progress) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        let stop = StopSignal::default();
        let progress = stop.progress(None);
        let work = || work(&self.rendering, &progress);
        interruptible(py, self.threads, &stop, work)?.map_err(raised)
    }
}

impl Rendering {
    /// Files by themselves, which are none of the scene's.
    fn alone(&self) -> Transaction {
        Transaction::at_once().keeping(&self.rendering.scene().inputs)
    }
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

    /// Meaning of a layer, as `layers.json` has it.
    fn meaning(&self, name: &str) -> Vec<(String, String)> {
        let meaning = self.rendering.layer(name).map(|layer| layer.meaning.clone());
        meaning.into_iter().flatten().map(|entry| (entry.key, entry.text)).collect()
    }

    /// Exposure times (s) and frames.
    fn exposures(&self) -> Vec<(f64, u32)> {
        self.rendering.exposures().map(|e| (e.exposure, e.frame)).collect()
    }

    /// The digital numbers of an exposure.
    fn raw<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(exposure) = self.rendering.exposures().nth(index) else { return Ok(None) };
        let image = self.work(py, |rendering, _| rendering.raw(exposure))?;
        let Some(image) = image else { return Ok(None) };
        let (width, height, depth) = (image.width, image.height, image.depth);
        shaped(image.values.into_pyarray(py).into_any(), [height, width, depth]).map(Some)
    }

    fn report(&self) -> PyResult<String> {
        let mut report = self.rendering.report().clone();
        report.notes = report.notes.iter().map(|note| in_python(note)).collect();
        serde_json::to_string(&report).map_err(refused)
    }

    /// `camera.json`.
    fn camera(&self) -> PyResult<String> {
        serde_json::to_string(&self.rendering.scene().camera.opencv()).map_err(refused)
    }

    fn write(&self, py: Python<'_>, folder: &str, outputs: &str) -> PyResult<Vec<String>> {
        let outputs = Outputs::from_list(outputs).map_err(refused)?;
        let written = self.work(py, |rendering, progress| {
            etendue::places::folder(folder.as_ref())?;
            rendering.write_with(folder.as_ref(), outputs, progress)
        })?;
        Ok(written.files.iter().map(|path| path.display().to_string()).collect())
    }

    /// Writes one layer as a picture.
    fn write_png(&self, py: Python<'_>, path: &str, name: &str) -> PyResult<()> {
        self.work(py, |rendering, _| {
            Ok(png::write(
                &self.alone(),
                path.as_ref(),
                rendering.picture(),
                name,
                png::Bits::Eight,
            )?)
        })
    }

    /// Writes what the layers mean.
    fn write_meaning(&self, path: &str) -> PyResult<()> {
        sidecar::write(&self.alone(), path.as_ref(), self.rendering.picture())
            .map_err(|e| raised(e.into()))
    }

    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counts = PyDict::new(py);
        let report = self.rendering.report();
        counts.set_item("rays", report.rays)?;
        counts.set_item("samples", report.samples)?;
        Ok(counts)
    }
}
