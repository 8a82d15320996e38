//! Lenses by themselves.

use std::path::Path;

use etendue::Reach;
use etendue_optics::element::{Clip, Ray, RayStatus};
use etendue_optics::train::{Focus, OpticalTrain, Side};
use etendue_scene::file::read_lens;
use numpy::{IntoPyArray, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::{in_python, of_triples, raised, refused, triples};
use crate::work::{StopSignal, interruptible};

/// A lens of a lens file, a Zemax file or a scene.
#[pyclass(frozen)]
pub struct Lens {
    train: OpticalTrain,
    notes: Vec<String>,
}

#[pymethods]
impl Lens {
    #[new]
    fn new(
        py: Python<'_>,
        path: &str,
        f_number: Option<f64>,
        allow_outside: bool,
    ) -> PyResult<Self> {
        let reach = if allow_outside { Reach::Anywhere } else { Reach::OwnFolder };
        let read = read_lens(Path::new(path), reach, &[]).map_err(|error| raised(error.into()))?;
        let train = match f_number {
            // Measured again, on all processors.
            Some(f_number) => {
                let measure = || read.train.with_f_number(f_number);
                interruptible(py, 0, &StopSignal::default(), measure)?.map_err(refused)?
            }
            None => read.train,
        };
        let notes = read.notes.iter().chain(train.notes()).map(|note| in_python(note)).collect();
        Ok(Self { train, notes })
    }

    fn name(&self) -> &str {
        self.train.name()
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// The main wavelength (nm).
    fn wavelength(&self) -> f64 {
        self.train.wavelength()
    }

    fn paraxial<'py>(&self, py: Python<'py>, wavelength: f64) -> PyResult<Bound<'py, PyDict>> {
        let p = self.train.paraxial(wavelength).map_err(refused)?;
        let facts = PyDict::new(py);
        for (key, value) in [
            ("effective_focal_length", p.efl),
            ("back_focal_length", p.bfl),
            ("front_focal_length", p.ffl),
            ("image_z", p.image_z),
            ("front_principal_z", p.front_principal_z),
            ("rear_principal_z", p.rear_principal_z),
            ("entrance_pupil_z", p.entrance_pupil.z),
            ("entrance_pupil_diameter", p.entrance_pupil.diameter),
            ("exit_pupil_z", p.exit_pupil.z),
            ("exit_pupil_diameter", p.exit_pupil.diameter),
            ("f_number", p.f_number),
        ] {
            facts.set_item(key, value)?;
        }
        facts.set_item("last_vertex_z", self.train.last_vertex())?;
        facts.set_item("sensor_z_at_infinity", self.train.sensor_z(Focus::Infinity).ok())?;
        Ok(facts)
    }

    /// Takes rays through the lens: positions on the last element, directions behind it (NaN-free: rays
    /// that end keep where they ended), what is left of each, and how it ended.
    #[expect(clippy::type_complexity, reason = "the arrays of one call")]
    fn trace<'py>(
        &self,
        py: Python<'py>,
        origins: PyReadonlyArray2<'_, f64>,
        directions: PyReadonlyArray2<'_, f64>,
        wavelength: f64,
        manner: (bool, bool, usize),
    ) -> PyResult<(
        Bound<'py, PyAny>,
        Bound<'py, PyAny>,
        Bound<'py, PyAny>,
        Bound<'py, PyAny>,
        Bound<'py, PyAny>,
    )> {
        let (from_sensor, clip, threads) = manner;
        let (origins, directions) =
            (triples("origins", &origins)?, triples("directions", &directions)?);
        if origins.len() != directions.len() {
            let (o, d) = (origins.len(), directions.len());
            return Err(refused(format!("{o} origins for {d} directions")));
        }
        let rays: Vec<Ray> = origins
            .iter()
            .zip(directions.iter())
            .enumerate()
            .map(|(i, (o, d))| {
                Ray::new((*o).into(), (*d).into())
                    .ok_or_else(|| refused(format!("ray {i} from {o:?} along {d:?} is no ray")))
            })
            .collect::<PyResult<_>>()?;
        let at = self.train.at(wavelength).map_err(refused)?;
        let side = if from_sensor { Side::Sensor } else { Side::Object };
        let clip = if clip { Clip::On } else { Clip::Off };
        let stop = StopSignal::default();
        let trace = |&ray: &Ray| (!stop.is_asked_for()).then(|| at.run(side, clip, ray));
        let all = || rays.par_iter().map(trace).collect::<Option<Vec<_>>>();
        // None of them is left out unless it was stopped, which has raised.
        let ends = interruptible(py, threads, &stop, all)?.unwrap_or_default();
        let positions = ends.iter().map(|end| end.ray.position).collect();
        let turned = ends.iter().map(|end| end.ray.direction).collect();
        let throughput: Vec<f64> = ends.iter().map(|end| end.throughput).collect();
        let status: Vec<u8> = ends.iter().map(|end| code(end.status)).collect();
        let element =
            |status: RayStatus| status.element().and_then(|e| i32::try_from(e).ok()).unwrap_or(-1);
        let elements: Vec<i32> = ends.iter().map(|end| element(end.status)).collect();
        Ok((
            of_triples(py, positions)?,
            of_triples(py, turned)?,
            throughput.into_pyarray(py).into_any(),
            status.into_pyarray(py).into_any(),
            elements.into_pyarray(py).into_any(),
        ))
    }
}

fn code(status: RayStatus) -> u8 {
    match status {
        RayStatus::Exited => 0,
        RayStatus::Missed { .. } => 1,
        RayStatus::TotalInternalReflection { .. } => 2,
        RayStatus::Vignetted { .. } => 3,
    }
}
