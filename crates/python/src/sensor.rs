//! Sensors by themselves.

use std::path::Path;

use etendue_files::Opener;
use etendue_scene::file::SensorFile;
use etendue_sensor::Exposure;
use numpy::{IntoPyArray, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{raised, refused, shaped};
use crate::work::{Stop, interruptible};

/// A sensor of the trade, or of a file.
#[pyclass(frozen)]
pub struct Sensor {
    pub(crate) file: SensorFile,
}

#[pymethods]
impl Sensor {
    #[new]
    fn new(name: &str, settings: Vec<(String, String)>) -> PyResult<Self> {
        let file = SensorFile::named(&Opener::default(), Path::new(name), &settings);
        Ok(Self { file: file.map_err(|error| raised(error.into()))? })
    }

    fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (s, facts) = (&self.file.sensor, PyDict::new(py));
        facts.set_item("resolution", s.resolution())?;
        facts.set_item("bit_depth", s.bit_depth())?;
        for (key, value) in [
            ("pixel_pitch", s.pixel_pitch()),
            ("system_gain", s.system_gain()),
            ("read_noise", s.read_noise()),
            ("dark_current", s.dark_current()),
            ("full_well", s.full_well()),
            ("saturation", s.saturation()),
            ("black_level", s.black_level()),
            ("white_level", s.white_level()),
        ] {
            facts.set_item(key, value)?;
        }
        Ok(facts)
    }

    /// Digital numbers of one exposure of so many photo-electrons a pixel on average.
    fn expose<'py>(
        &self,
        py: Python<'py>,
        electrons: PyReadonlyArray2<'_, f64>,
        exposure: f64,
        frame: u32,
        seed: u64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let array = electrons.as_array();
        let size = [array.ncols(), array.nrows()];
        let electrons: Vec<f64> = array.iter().copied().collect();
        let expose = || {
            self.file.sensor.expose_electrons(&electrons, size, Exposure { exposure, frame }, seed)
        };
        let image = interruptible(py, 0, &Stop::default(), expose)?.map_err(refused)?;
        shaped(image.values.into_pyarray(py).into_any(), [size[1], size[0], 1])
    }
}
