//! Sensors by themselves.

use std::path::Path;

use etendue_files::Opener;
use etendue_scene::Setting;
use etendue_scene::file::SensorFile;
use etendue_sensor::Exposure;
use numpy::{IntoPyArray, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::Value;

use crate::arrays::{raised, refused, shaped};
use crate::work::{StopSignal, interruptible};

fn text(letters: &[u8]) -> String {
    String::from_utf8_lossy(letters).into_owned()
}

/// A sensor of the trade, or of a file.
#[pyclass(frozen)]
pub struct Sensor {
    pub(crate) file: SensorFile,
}

#[pymethods]
impl Sensor {
    #[new]
    fn new(name: &str, settings: Vec<(String, String)>) -> PyResult<Self> {
        let settings: Vec<Setting> =
            settings.into_iter().map(|(path, value)| Setting { path, value }).collect();
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
        // Its letters row by row; nothing of a sensor without one.
        let cfa = s.cfa().map(serde_json::to_value).transpose().map_err(refused)?;
        let rows: Option<Vec<String>> = cfa.map(|cfa| match cfa {
            Value::Array(rows) => {
                rows.iter().filter_map(Value::as_str).map(str::to_owned).collect()
            }
            word => word.as_str().unwrap_or_default().as_bytes().chunks(2).map(text).collect(),
        });
        facts.set_item("cfa", rows)?;
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
        let image = interruptible(py, 0, &StopSignal::default(), expose)?.map_err(refused)?;
        shaped(image.values.into_pyarray(py).into_any(), [size[1], size[0], 1])
    }
}
