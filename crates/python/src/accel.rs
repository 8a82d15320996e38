//! The exact ray caster by itself.

use std::sync::Arc;

use etendue_accel::BuildOptions;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Detail, Geometry, HitBatch, Mesh, Placement, RayBatch, Transform};
use numpy::{IntoPyArray, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::{of_triples, refused, triples};

/// Rays in a batch: as many as stay in a core's cache.
const BATCH: usize = 1024;

/// An acceleration structure over one mesh.
#[pyclass(frozen)]
pub struct Accel {
    accel: Box<dyn etendue_accel::Accel>,
}

#[pymethods]
impl Accel {
    #[new]
    fn new(
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, u32>,
        backend: &str,
    ) -> PyResult<Self> {
        let (vertices, faces) = (triples("vertices", &vertices)?, triples("faces", &faces)?);
        let mesh = Mesh::from_arrays("mesh", &vertices, &faces).map_err(refused)?;
        let world_from_mesh = Transform::IDENTITY;
        let placement =
            Placement { mesh: 0, object: 0, instance: 0, node: 0, material: 0, world_from_mesh };
        let geometry = Arc::new(Geometry { meshes: vec![mesh], placements: vec![placement] });
        let options = BuildOptions::default();
        let built: Result<Box<dyn etendue_accel::Accel>, _> = py.detach(|| match backend {
            #[cfg(feature = "embree")]
            "embree" => Ok(Box::new(etendue_accel::Embree::build(geometry, &options)?) as _),
            "bvh" => Ok(Box::new(etendue_accel::Bvh::build(geometry, &options)?) as _),
            "exact" => Ok(Box::new(etendue_accel::Exact::build(geometry, &options)?) as _),
            other => Err(Unbuilt::Unknown(other.to_owned())),
        });
        Ok(Self { accel: built.map_err(|error: Unbuilt| refused(error.words()))? })
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
    ) -> PyResult<Bound<'py, PyDict>> {
        let rays = Rays::new(&origins, &directions, t_max.as_ref())?;
        let batches: Vec<HitBatch> = py.detach(|| {
            let hits = |rays: RayBatch| {
                let mut hits = HitBatch::new(Detail::Surface);
                self.accel.closest(&rays, &mut hits);
                hits
            };
            rays.batches(coherent).map(hits).collect()
        });
        let all = PyDict::new(py);
        macro_rules! joined {
            ($field:ident) => {{
                let mut all = Vec::with_capacity(rays.origins.len());
                batches.iter().for_each(|batch| all.extend_from_slice(&batch.$field));
                all
            }};
        }
        let mut t: Vec<f64> = joined!(t);
        t.iter_mut().enumerate().for_each(|(i, t)| *t /= rays.length(i).max(f64::MIN_POSITIVE));
        all.set_item("t", t.into_pyarray(py))?;
        all.set_item("u", joined!(u).into_pyarray(py))?;
        all.set_item("v", joined!(v).into_pyarray(py))?;
        // A miss is -1.
        let triangles: Vec<i64> = batches
            .iter()
            .flat_map(|b| (0..b.len()).map(|i| if b.is_hit(i) { b.triangle[i].into() } else { -1 }))
            .collect();
        all.set_item("triangle", triangles.into_pyarray(py))?;
        let normals = batches.iter().flat_map(|b| (0..b.len()).map(|i| b.normal(i).to_array()));
        all.set_item("normal", of_triples(py, normals.collect())?)?;
        Ok(all)
    }

    /// Whether anything is in the way of each ray, up to `t_max`.
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        origins: PyReadonlyArray2<'_, f64>,
        directions: PyReadonlyArray2<'_, f64>,
        t_max: Option<PyReadonlyArray1<'_, f64>>,
        coherent: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let rays = Rays::new(&origins, &directions, t_max.as_ref())?;
        let blocked: Vec<Vec<bool>> = py.detach(|| {
            let blocked = |rays: RayBatch| {
                let mut blocked = Vec::new();
                self.accel.occluded(&rays, &mut blocked);
                blocked
            };
            rays.batches(coherent).map(blocked).collect()
        });
        Ok(blocked.concat().into_pyarray(py).into_any())
    }
}

enum Unbuilt {
    Build(etendue_accel::BuildError),
    Unknown(String),
}

impl From<etendue_accel::BuildError> for Unbuilt {
    fn from(error: etendue_accel::BuildError) -> Self {
        Self::Build(error)
    }
}

impl Unbuilt {
    fn words(&self) -> String {
        match self {
            Self::Build(error) => error.to_string(),
            Self::Unknown(name) => format!("no accelerator \"{name}\"; known: embree, bvh, exact"),
        }
    }
}

/// Rays as they came, directions made unit vectors.
struct Rays {
    origins: Vec<[f64; 3]>,
    directions: Vec<[f64; 3]>,
    /// In lengths of the directions as they came.
    t_max: Option<Vec<f64>>,
}

impl Rays {
    fn new(
        origins: &PyReadonlyArray2<'_, f64>,
        directions: &PyReadonlyArray2<'_, f64>,
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

    fn length(&self, i: usize) -> f64 {
        DVec3::from(self.directions[i]).length()
    }

    /// Batches of rays in order. A ray that is not finite, or without direction, misses.
    fn batches(&self, coherent: bool) -> impl IndexedParallelIterator<Item = RayBatch> + '_ {
        let starts = self.origins.len().div_ceil(BATCH);
        (0..starts).into_par_iter().map(move |k| {
            let range = k * BATCH..((k + 1) * BATCH).min(self.origins.len());
            let mut rays = RayBatch::with_capacity(range.len()).with_coherence(coherent);
            for i in range {
                let origin = DVec3::from(self.origins[i]);
                let far = self.t_max.as_ref().map_or(f64::INFINITY, |t| t[i]) * self.length(i);
                match DVec3::from(self.directions[i]).try_normalize() {
                    Some(direction) if origin.is_finite() && far >= 0.0 => {
                        rays.push_between(origin, direction, 0.0, far);
                    }
                    // Ends before it starts.
                    _ => rays.push_between(DVec3::ZERO, DVec3::Z, 0.0, -1.0),
                }
            }
            rays
        })
    }
}
