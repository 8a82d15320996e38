//! The exact ray caster by itself.

use std::borrow::Cow;
use std::sync::Arc;

use etendue_accel::{AccelName, BuildOptions};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Detail, Geometry, HitBatch, Mesh, RayBatch, Transform};
use numpy::{IntoPyArray, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::{in_python, of_mesh, of_triples, refused, triples};
use crate::work::{StopSignal, interruptible, threads_for};

/// Rays in a batch: as many as stay in a core's cache.
const BATCH: usize = 1024;

/// An acceleration structure over one mesh.
#[pyclass(frozen)]
pub struct Accel {
    accel: Box<dyn etendue_accel::Accel>,
    geometry: Arc<Geometry>,
}

#[pymethods]
impl Accel {
    #[new]
    fn new(
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, u32>,
        backend: &str,
        threads: usize,
    ) -> PyResult<Self> {
        let (vertices, faces) = (triples("vertices", &vertices)?, triples("faces", &faces)?);
        let mesh = Mesh::from_arrays("mesh", &vertices, &faces).map_err(refused)?;
        let geometry = Arc::new(Geometry::alone(mesh, Transform::IDENTITY));
        let stop = StopSignal::default();
        let build = || {
            let options = BuildOptions {
                threads: rayon::current_num_threads(),
                progress: Some(stop.heeded()),
                ..BuildOptions::default()
            };
            let name = AccelName::named(backend).filter(|name| name.is_built());
            let name = name.ok_or_else(|| BuildFailure::Unknown(backend.to_owned()))?;
            Ok(name.build(Arc::clone(&geometry), &options)?)
        };
        let built = interruptible(py, threads, &stop, build)?;
        let accel = built.map_err(|error: BuildFailure| refused(error.words()))?;
        Ok(Self { accel, geometry })
    }

    /// Vertices and faces.
    fn mesh<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        of_mesh(py, &self.geometry.meshes[0])
    }

    fn report(&self) -> String {
        let report = self.accel.report();
        format!(
            "{}, {} bytes, built in {:.3} s",
            report.backend,
            report.bytes,
            report.time.as_secs_f64()
        )
    }

    /// The closest hits.
    fn closest<'py>(
        &self,
        py: Python<'py>,
        origins: PyReadonlyArray2<'_, f64>,
        directions: PyReadonlyArray2<'_, f64>,
        t_max: Option<PyReadonlyArray1<'_, f64>>,
        coherent: bool,
        threads: usize,
    ) -> PyResult<Bound<'py, PyDict>> {
        let rays = RayArrays::new(&origins, &directions, t_max.as_ref())?;
        let stop = StopSignal::default();
        let threads = threads_for(rays.len().div_ceil(BATCH), threads);
        let found = interruptible(py, threads, &stop, || self.found(&rays, coherent, &stop))?;
        let all = PyDict::new(py);
        all.set_item("t", found.t.into_pyarray(py))?;
        all.set_item("u", found.u.into_pyarray(py))?;
        all.set_item("v", found.v.into_pyarray(py))?;
        all.set_item("triangle", found.triangle.into_pyarray(py))?;
        all.set_item("normal", of_triples(py, found.normal)?)?;
        Ok(all)
    }

    /// True for each ray that has anything in its way, up to `t_max`.
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        origins: PyReadonlyArray2<'_, f64>,
        directions: PyReadonlyArray2<'_, f64>,
        t_max: Option<PyReadonlyArray1<'_, f64>>,
        coherent: bool,
        threads: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let rays = RayArrays::new(&origins, &directions, t_max.as_ref())?;
        let mut all = vec![false; rays.len()];
        let stop = StopSignal::default();
        let threads = threads_for(rays.len().div_ceil(BATCH), threads);
        interruptible(py, threads, &stop, || {
            all.par_chunks_mut(BATCH).enumerate().for_each_init(
                || (RayBatch::with_capacity(BATCH), Vec::with_capacity(BATCH), Vec::new()),
                |(batch, lengths, blocked), (k, out)| {
                    if stop.is_asked_for() {
                        return;
                    }
                    rays.fill(k, coherent, batch, lengths);
                    self.accel.occluded(batch, blocked);
                    out.copy_from_slice(blocked);
                },
            );
        })?;
        Ok(all.into_pyarray(py).into_any())
    }
}

/// Hits of the rays of a call.
struct HitArrays {
    /// In lengths of the directions as they came; `+inf` for a miss.
    t: Vec<f64>,
    u: Vec<f64>,
    v: Vec<f64>,
    /// −1 for a miss.
    triangle: Vec<i64>,
    normal: Vec<[f64; 3]>,
}

impl Accel {
    fn found(&self, rays: &RayArrays<'_>, coherent: bool, stop: &StopSignal) -> HitArrays {
        let count = rays.len();
        let numbers = || vec![0.0; count];
        let (t, u, v) = (numbers(), numbers(), numbers());
        let mut found =
            HitArrays { t, u, v, triangle: vec![0; count], normal: vec![[0.0; 3]; count] };
        let HitArrays { t, u, v, triangle, normal } = &mut found;
        let tuv = t.par_chunks_mut(BATCH).zip(u.par_chunks_mut(BATCH)).zip(v.par_chunks_mut(BATCH));
        let rest = triangle.par_chunks_mut(BATCH).zip(normal.par_chunks_mut(BATCH));
        tuv.zip(rest).enumerate().for_each_init(
            || {
                let hits = HitBatch::new(Detail::Surface);
                (RayBatch::with_capacity(BATCH), Vec::with_capacity(BATCH), hits)
            },
            |(batch, lengths, hits), (k, (((t, u), v), (triangle, normal)))| {
                if stop.is_asked_for() {
                    return;
                }
                rays.fill(k, coherent, batch, lengths);
                self.accel.closest(batch, hits);
                u.copy_from_slice(&hits.u);
                v.copy_from_slice(&hits.v);
                for i in 0..t.len() {
                    t[i] = hits.t[i] / lengths[i].max(f64::MIN_POSITIVE);
                    triangle[i] = if hits.is_hit(i) { hits.triangle[i].into() } else { -1 };
                    normal[i] = hits.normal(i).to_array();
                }
            },
        );
        found
    }
}

enum BuildFailure {
    Build(etendue_accel::BuildError),
    Unknown(String),
}

impl From<etendue_accel::BuildError> for BuildFailure {
    fn from(error: etendue_accel::BuildError) -> Self {
        Self::Build(error)
    }
}

impl BuildFailure {
    fn words(&self) -> String {
        match self {
            Self::Build(error) => in_python(&error.to_string()),
            Self::Unknown(name) => {
                let known: Vec<_> = AccelName::built().map(AccelName::name).collect();
                format!("no accelerator \"{name}\"; known: {}", known.join(", "))
            }
        }
    }
}

/// Rays as they came.
struct RayArrays<'a> {
    origins: Cow<'a, [[f64; 3]]>,
    directions: Cow<'a, [[f64; 3]]>,
    /// In lengths of the directions.
    t_max: Option<Vec<f64>>,
}

impl<'a> RayArrays<'a> {
    fn new(
        origins: &'a PyReadonlyArray2<'_, f64>,
        directions: &'a PyReadonlyArray2<'_, f64>,
        t_max: Option<&PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<Self> {
        let (origins, directions) =
            (triples("origins", origins)?, triples("directions", directions)?);
        let t_max: Option<Vec<f64>> = t_max.map(|t| t.as_array().iter().copied().collect());
        let others = [directions.len(), t_max.as_ref().map_or(directions.len(), Vec::len)];
        if others != [origins.len(); 2] {
            let (o, [d, t]) = (origins.len(), others);
            return Err(refused(format!(
                "{o} origins, {d} directions and {t} t_max; one each a ray"
            )));
        }
        Ok(Self { origins, directions, t_max })
    }

    fn len(&self) -> usize {
        self.origins.len()
    }

    /// Refills `batch` with the rays of batch `k`, of unit directions, and `lengths` with those that they came
    /// with. A ray that is not finite, or without direction, misses.
    fn fill(&self, k: usize, coherent: bool, batch: &mut RayBatch, lengths: &mut Vec<f64>) {
        batch.clear();
        lengths.clear();
        batch.coherent = coherent;
        let here = k * BATCH..((k + 1) * BATCH).min(self.len());
        let rays = self.origins[here.clone()].iter().zip(&self.directions[here.clone()]);
        for (i, (&origin, &direction)) in here.zip(rays) {
            let (origin, direction) = (DVec3::from(origin), DVec3::from(direction));
            let length = direction.length();
            lengths.push(length);
            let far = self.t_max.as_ref().map_or(f64::INFINITY, |t| t[i]) * length;
            let shrink = length.recip();
            if shrink.is_finite() && shrink > 0.0 && origin.is_finite() && far >= 0.0 {
                batch.push_between(origin, direction * shrink, 0.0, far);
            } else {
                // Ends before it starts.
                batch.push_between(DVec3::ZERO, DVec3::Z, 0.0, -1.0);
            }
        }
    }
}
