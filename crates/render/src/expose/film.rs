//! The light of a picture in the bands of a sensor.

use etendue_scene::Scene;
use etendue_sensor::{Photodiodes, Radiometry, Sensor, SensorKind};
use etendue_spectrum::{Bands, Grid};
use etendue_tracer::LayerSpec;
use rayon::prelude::*;

use super::LightUnit;
use crate::film::FilmLayer;
use crate::memory::{NoMemory, filled};
use crate::output::{Channel, HeaderEntry, Layer, Look, Picture, SPECTRUM, Values};

/// Light in spectral bands, as a sensor is given it.
#[derive(Debug, Clone, PartialEq)]
pub struct BandFilm {
    /// Bands of the film.
    pub bands: Bands,
    /// `[row][column][band]`.
    pub values: Vec<f32>,
    /// Values, likewise, of the light that came through parts of the pupil, where it is told apart.
    pub parts: Vec<(LayerSpec, Vec<f32>)>,
}

impl BandFilm {
    /// One plane a band, woven together.
    ///
    /// # Errors
    ///
    /// When there is no memory for it.
    pub fn woven(bands: Bands, planes: &[&[f32]]) -> Result<Self, NoMemory> {
        let pixels = planes.first().map_or(0, |plane| plane.len());
        let mut values = filled(0.0, pixels * planes.len())?;
        values.par_chunks_mut(planes.len().max(1)).enumerate().for_each(|(i, pixel)| {
            for (value, plane) in pixel.iter_mut().zip(planes) {
                *value = plane[i];
            }
        });
        Ok(Self { bands, values, parts: Vec::new() })
    }

    /// The light of a layer of the film in its bands, whose place red, green and blue take; `None` when they are the bands
    /// already.
    pub(crate) fn taken_from(
        light: &mut FilmLayer,
        bands: &Bands,
    ) -> Result<Option<Self>, NoMemory> {
        if !light.spec.is_light() || *bands == Bands::Rgb {
            return Ok(None);
        }
        let planes = light.planes.iter().filter_map(|plane| match plane {
            Values::F32(values) => Some(values.as_slice()),
            Values::F64(_) | Values::U16(_) | Values::U32(_) => None,
        });
        let film = Self::woven(bands.clone(), &planes.collect::<Vec<_>>())?;
        // Bands are not kept twice while colours are made of them.
        light.planes.clear();
        light.names = ["R", "G", "B"].map(str::to_owned).into();
        light.planes = film.colors()?.map(Values::F32).into();
        Ok(Some(film))
    }

    /// One plane a band of `grid`: the plain mean of the light over its wavelengths.
    fn means_over(&self, grid: &Grid) -> Vec<Vec<f32>> {
        let count = self.bands.count();
        let plane = |parts: &Vec<(usize, f64)>| {
            let pixels = self.values.par_chunks(count);
            let mean = |bands: &[f32]| -> f64 {
                parts.iter().map(|&(band, weight)| weight * f64::from(bands[band])).sum()
            };
            #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
            let plane: Vec<f32> = pixels.map(|bands| mean(bands) as f32).collect();
            plane
        };
        self.bands.means_over(grid).iter().map(plane).collect()
    }

    /// The colours of the light, for looking: red, green and blue planes.
    ///
    /// # Errors
    ///
    /// When there is no memory for them.
    pub fn colors(&self) -> Result<[Vec<f32>; 3], NoMemory> {
        let rows = self.bands.to_rgb();
        let count = rows.len();
        let plane = |k: usize| {
            let mix = |bands: &[f32]| -> f64 {
                bands.iter().zip(&rows).map(|(band, row)| f64::from(*band) * row[k]).sum()
            };
            let mut plane = filled(0.0, self.values.len() / count.max(1))?;
            let pixels = plane.par_iter_mut().zip(self.values.par_chunks(count));
            #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
            pixels.for_each(|(value, bands)| *value = mix(bands) as f32);
            Ok(plane)
        };
        Ok([plane(0)?, plane(1)?, plane(2)?])
    }

    /// Film of the irradiance on the sensor: in physical mode the light of a lens camera is
    /// radiance (W·m⁻²·sr⁻¹·nm⁻¹), and the projected solid angle of its pupil makes irradiance
    /// (W·m⁻²·nm⁻¹) of it. Cameras without an aperture give irradiance as it is.
    #[must_use]
    pub(super) fn on_sensor(self, scene: &Scene, sensor: &Sensor) -> Self {
        self.times(light_factor(scene, sensor))
    }

    /// All values times `factor`.
    #[must_use]
    pub(super) fn times(mut self, factor: f64) -> Self {
        if factor != 1.0 {
            #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
            let factor = factor as f32;
            for values in
                std::iter::once(&mut self.values).chain(self.parts.iter_mut().map(|p| &mut p.1))
            {
                values.par_iter_mut().for_each(|value| *value *= factor);
            }
        }
        self
    }

    /// All values of each pixel times what `factor` says of its column and row.
    #[must_use]
    pub(super) fn times_by_pixel(
        mut self,
        columns: usize,
        factor: impl Fn([usize; 2]) -> f32 + Sync,
    ) -> Self {
        let bands = self.bands.count();
        for values in
            std::iter::once(&mut self.values).chain(self.parts.iter_mut().map(|p| &mut p.1))
        {
            values.par_chunks_mut(columns * bands).enumerate().for_each(|(row, values)| {
                for (column, pixel) in values.chunks_exact_mut(bands).enumerate() {
                    let factor = factor([column, row]);
                    pixel.iter_mut().for_each(|value| *value *= factor);
                }
            });
        }
        self
    }

    /// Adds the parts of the light of a picture in red, green and blue, where a sensor asks for them.
    ///
    /// # Errors
    ///
    /// When there is no memory for them.
    pub(super) fn with_parts_of(
        mut self,
        sensor: &Sensor,
        picture: &Picture,
    ) -> Result<Self, NoMemory> {
        for (layer, _) in photodiodes(sensor) {
            let name = layer.row().name;
            let found = picture.layers().iter().find(|other| other.name == name);
            let Some(planes) = found.and_then(three_planes) else { continue };
            let film = Self::from_rgb(self.bands.clone(), &planes)?;
            self.parts.push((*layer, film.values));
        }
        Ok(self)
    }

    /// Replaces the light by the sum of its parts, to the bit, where it has some.
    #[must_use]
    pub(super) fn summed(mut self) -> Self {
        let Some(((_, first), others)) = self.parts.split_first() else { return self };
        self.values.clone_from(first);
        for (_, other) in others {
            self.values.par_iter_mut().zip(other).for_each(|(sum, part)| *sum += part);
        }
        self
    }

    /// A picture's linear sRGB in other bands. Exact for colours that were not mixed by light on
    /// their way: a band is linear in the colour.
    ///
    /// # Errors
    ///
    /// When there is no memory for them.
    pub fn from_rgb(bands: Bands, colors: &[&[f32]; 3]) -> Result<Self, NoMemory> {
        if bands == Bands::Rgb {
            return Self::woven(bands, colors);
        }
        let rows = bands.from_rgb();
        let mut values = filled(0.0, colors[0].len() * rows.len())?;
        values.par_chunks_mut(rows.len().max(1)).enumerate().for_each(|(i, pixel)| {
            let color = colors.map(|plane| f64::from(plane[i]));
            for (value, row) in pixel.iter_mut().zip(&rows) {
                #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
                let band = row.iter().zip(color).map(|(w, c)| w * c).sum::<f64>() as f32;
                *value = band;
            }
        });
        Ok(Self { bands, values, parts: Vec::new() })
    }
}

/// Factor from a unit of the picture's light to what falls on the sensor.
pub(super) fn light_factor(scene: &Scene, sensor: &Sensor) -> f64 {
    match sensor.radiometry() {
        Radiometry::Physical => scene.camera.pupil_solid_angle().unwrap_or(1.0),
        Radiometry::Digital => 1.0,
    }
}

/// The planes of a picture's linear sRGB.
pub(super) fn colors(layers: &[Layer]) -> Option<[&[f32]; 3]> {
    three_planes(layers.iter().find(|layer| layer.name.is_empty())?)
}

/// The planes of a layer of three channels in f32.
pub(crate) fn three_planes(layer: &Layer) -> Option<[&[f32]; 3]> {
    match layer.channels.as_slice() {
        [r, g, b] => match (&r.values, &g.values, &b.values) {
            (Values::F32(r), Values::F32(g), Values::F32(b)) => Some([r, g, b]),
            _ => None,
        },
        _ => None,
    }
}

/// True if the picture has a hyperspectral cube.
pub(crate) fn has_spectrum(scene: &Scene) -> bool {
    scene.sensor.as_ref().is_some_and(|sensor| {
        sensor.spec().kind == SensorKind::Multispectral && sensor.bands().grid().is_some()
    })
}

/// The hyperspectral cube of a multispectral sensor's picture, channels named by wavelength: its own
/// bands where it has some, however finely they were rendered, else the bands.
pub(crate) fn spectrum(
    scene: &Scene,
    layers: &[Layer],
    band_film: Option<&BandFilm>,
) -> Result<Option<Layer>, NoMemory> {
    let Some(sensor) = scene.sensor.as_ref().filter(|_| has_spectrum(scene)) else {
        return Ok(None);
    };
    let from_colors;
    let film = match band_film.filter(|film| film.bands.grid().is_some()) {
        Some(film) => film,
        None => {
            let Some(colors) = colors(layers) else { return Ok(None) };
            from_colors = BandFilm::from_rgb(sensor.bands().clone(), &colors)?;
            &from_colors
        }
    };
    let Some(grid) = sensor.spec().bands.as_ref().or(film.bands.grid()) else { return Ok(None) };
    Ok(Some(cube(grid, film.means_over(grid), LightUnit::of(scene))))
}

/// A layer of one plane a band.
fn cube(grid: &Grid, planes: Vec<Vec<f32>>, unit: LightUnit) -> Layer {
    let channels = Bands::Spectral(grid.clone())
        .names()
        .iter()
        .zip(planes)
        .map(|(name, plane)| Channel { name: plain(name), values: Values::F32(plane) })
        .collect();
    let (edges, unit) = (format!("{:?}", grid.edges()), unit.to_string());
    let meaning = [
        ("definition", "mean light of each band of wavelengths, over the pixel's samples"),
        ("unit", unit.as_str()),
        ("band edges nm", edges.as_str()),
    ];
    let meaning = meaning.map(|(key, text)| HeaderEntry::new(key, text)).into();
    Layer { name: SPECTRUM.to_owned(), look: Look::Cube, channels, meaning }
}

/// The photodiodes that a sensor divides its pixels into: the layer of the light of each, and the name of its files.
pub(crate) fn photodiodes(sensor: &Sensor) -> &'static [(LayerSpec, &'static str)] {
    match sensor.spec().photodiodes {
        None => &[],
        Some(Photodiodes::Dual) => {
            &[(LayerSpec::LeftPupil, "raw_left"), (LayerSpec::RightPupil, "raw_right")]
        }
        Some(Photodiodes::Quad) => &[
            (LayerSpec::TopLeftPupil, "raw_top_left"),
            (LayerSpec::TopRightPupil, "raw_top_right"),
            (LayerSpec::BottomLeftPupil, "raw_bottom_left"),
            (LayerSpec::BottomRightPupil, "raw_bottom_right"),
        ],
    }
}

/// A name fit for all formats: `452.5nm` becomes `452_5nm`.
pub(super) fn plain(name: &str) -> String {
    let fit = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    name.chars().map(fit).collect()
}
