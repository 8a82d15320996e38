//! Pictures of light from elsewhere, and what sensors make of them.

use std::path::Path;

use etendue::{ExposeOptions, LightUnit, Outputs, PixelLight, Progress};
use etendue_image::npy::Array;
use numpy::{IntoPyArray, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{in_python, raised, refused, shaped};
use crate::sensor::Sensor;
use crate::work::{StopSignal, interruptible};

/// A picture of light.
#[pyclass(frozen)]
pub struct LightImage {
    image: etendue::LightImage,
}

#[pymethods]
impl LightImage {
    #[staticmethod]
    fn open(py: Python<'_>, path: &str, wavelengths: Option<Vec<f64>>) -> PyResult<Self> {
        let path = Path::new(path);
        if !path.exists() {
            let why = format!("{}: there is no such file", path.display());
            return Err(pyo3::exceptions::PyFileNotFoundError::new_err(why));
        }
        let open = || etendue::LightImage::open(path, wavelengths.as_deref(), None);
        let image = interruptible(py, 0, &StopSignal::default(), open)?.map_err(raised)?;
        Ok(Self { image })
    }

    #[staticmethod]
    fn from_array(
        values: PyReadonlyArrayDyn<'_, f64>,
        wavelengths: Option<Vec<f64>>,
    ) -> PyResult<Self> {
        let values = values.as_array();
        let array =
            Array { shape: values.shape().to_vec(), numbers: values.iter().copied().collect() };
        let name = Path::new("the array");
        let image = etendue::LightImage::from_array(name, array, wavelengths.as_deref());
        Ok(Self { image: image.map_err(raised)? })
    }

    /// float32 of rows, columns and bands, or red, green and blue.
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let [width, height] = self.image.size();
        let (values, depth) = match self.image.light() {
            PixelLight::Bands(film) => (film.values.clone(), film.bands.count()),
            PixelLight::Colors(planes) => {
                let pixel = |i: usize| planes.iter().map(move |plane| plane[i]);
                ((0..width * height).flat_map(pixel).collect(), planes.len())
            }
        };
        let flat = values.into_pyarray(py).into_any();
        flat.call_method1("reshape", ((height, width, depth),))
    }

    /// The edges of the bands (nm); `None` of red, green and blue.
    fn edges(&self) -> Option<Vec<f64>> {
        match self.image.light() {
            PixelLight::Bands(film) => film.bands.grid().map(|grid| grid.edges().to_vec()),
            PixelLight::Colors(_) => None,
        }
    }

    fn unit(&self) -> Option<String> {
        self.image.unit().map(str::to_owned)
    }

    fn notes(&self) -> Vec<String> {
        self.image.notes().iter().map(|note| in_python(note)).collect()
    }

    #[expect(clippy::too_many_arguments, reason = "Python names them")]
    fn expose(
        &self,
        py: Python<'_>,
        sensor: &Sensor,
        unit: Option<&str>,
        f_number: Option<f64>,
        magnification: f64,
        seed: Option<u64>,
        frame: u32,
    ) -> PyResult<ExposedImage> {
        let unit = unit.map(LightUnit::parse).transpose().map_err(refused)?;
        let options = ExposeOptions { unit, f_number, magnification, seed, frame, memory: None };
        let expose = || self.image.clone().on(&sensor.file, &options);
        let exposed = interruptible(py, 0, &StopSignal::default(), expose)?.map_err(raised)?;
        Ok(ExposedImage { exposed })
    }
}

/// A picture of light on a sensor.
#[pyclass(frozen)]
pub struct ExposedImage {
    exposed: etendue::ExposedImage,
}

#[pymethods]
impl ExposedImage {
    /// Exposure times (s) and frames.
    fn exposures(&self) -> Vec<(f64, u32)> {
        self.exposed.exposures().map(|e| (e.exposure, e.frame)).collect()
    }

    /// The digital numbers of an exposure.
    fn raw<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyAny>> {
        let exposure = self.exposed.exposures().nth(index).ok_or_else(|| {
            let count = self.exposed.exposures().count();
            pyo3::exceptions::PyIndexError::new_err(format!("{index}: there are {count} exposures"))
        })?;
        let raw = || self.exposed.raw(exposure);
        let image = interruptible(py, 0, &StopSignal::default(), raw)?.map_err(raised)?;
        let size = [image.height, image.width, image.depth];
        shaped(image.values.into_pyarray(py).into_any(), size)
    }

    fn notes(&self) -> Vec<String> {
        self.exposed.notes().map(in_python).collect()
    }

    fn write(&self, py: Python<'_>, folder: &str, outputs: &str) -> PyResult<Vec<String>> {
        let outputs = Outputs::from_list(outputs).map_err(refused)?;
        let stop = StopSignal::default();
        let progress: Progress = stop.progress(None);
        let write = || self.exposed.write(folder.as_ref(), outputs, &progress);
        let written = interruptible(py, 0, &stop, write)?.map_err(raised)?;
        Ok(written.files.iter().map(|path| path.display().to_string()).collect())
    }
}
