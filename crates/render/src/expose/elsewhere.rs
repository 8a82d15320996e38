//! Light that no scene made, as it falls on a sensor.

use etendue_sensor::{Sensor, SensorError};
use etendue_spectrum::{Bands, Grid};
use rayon::prelude::*;

use super::{BandFilm, ExposeError, SensorLight};
use crate::forecast::bytes_exposed;
use crate::memory::filled;
use crate::output::HeaderEntry;

/// A picture of light from anywhere.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureLight {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Light of each pixel.
    pub light: PixelLight,
}

/// The light of a picture's pixels, by rows.
#[derive(Debug, Clone, PartialEq)]
pub enum PixelLight {
    /// Red, green and blue, linear with sRGB's primaries: a plane each.
    Colors([Vec<f32>; 3]),
    /// The means over bands of wavelengths.
    Bands(BandFilm),
}

impl PictureLight {
    /// Values of a pixel.
    #[must_use]
    pub fn depth(&self) -> usize {
        match &self.light {
            PixelLight::Colors(planes) => planes.len(),
            PixelLight::Bands(film) => film.bands.count(),
        }
    }
}

/// The smallest share of a sensor's response to white light that it is told of when it is lost.
const TOLD: f64 = 1e-3;

impl SensorLight {
    /// Bytes that exposing `picture` takes, the picture itself included: it is held as it was read and in the sensor's
    /// bands.
    #[must_use]
    pub fn bytes_of(sensor: &Sensor, picture: &PictureLight) -> u64 {
        let bands = picture.depth() as u64;
        let [columns, rows] = picture.size.map(|side| side as u64);
        columns.saturating_mul(rows).saturating_mul(bytes_exposed(sensor, bands, bands))
    }

    /// `picture` as it falls on `sensor`, which takes the picture's size: its values times `factor`, which makes
    /// irradiance (W·m⁻²·nm⁻¹) of them, or 1 in digital radiometry. `seeds` are of the samples and of temporal noise,
    /// `header` goes into the files.
    ///
    /// Colours are brought into the sensor's bands as those of a scene are. Light in bands is even
    /// over each of them, and there is none beyond.
    ///
    /// # Errors
    ///
    /// When a channel of the sensor sees none of the bands, or there is no memory for the light.
    pub fn from_picture(
        sensor: &Sensor,
        picture: PictureLight,
        factor: f64,
        seeds: [u64; 2],
        header: Vec<HeaderEntry>,
    ) -> Result<Self, ExposeError> {
        #[expect(clippy::cast_possible_truncation, reason = "a side of an image")]
        let sensor = sensor.clone().with_resolution(picture.size.map(|side| side as u32));
        let mut notes = sensor.notes().to_vec();
        let (sensor, film) = match picture.light {
            PixelLight::Colors(colors) => {
                let sensor = sensor.clone().in_bands(Bands::Rgb).unwrap_or(sensor);
                let planes = colors.each_ref().map(Vec::as_slice);
                let film = BandFilm::from_rgb(sensor.bands().clone(), &planes)?;
                (sensor, film)
            }
            PixelLight::Bands(film) => {
                let film = divided(film, &sensor)?;
                notes.extend(beyond(&sensor, &film.bands));
                (sensor.in_bands(film.bands.clone())?, film)
            }
        };
        let film = film.times(factor);
        let white = sensor.white_under(&vec![1.0; sensor.bands().count()]);
        let light = Self {
            sensor,
            film,
            seeds,
            white,
            header,
            notes,
            metered: None,
            f_number: None,
            solid_angle: None,
        };
        Ok(light.metered_by_itself())
    }
}

/// `film` with its bands divided at the edges of the channels of a multispectral sensor.
fn divided(film: BandFilm, sensor: &Sensor) -> Result<BandFilm, ExposeError> {
    let (Some(grid), Some(own)) = (film.bands.grid(), sensor.spec().bands.as_ref()) else {
        return Ok(film);
    };
    let [from, to] = grid.range();
    if let Some(band) = own.bands().position(|band| band.to <= from || band.from >= to) {
        let channel = Bands::Spectral(own.clone()).names()[band].clone();
        return Err(SensorError::blind("bands", &channel, [from, to]).into());
    }
    let mut edges: Vec<f64> = grid.edges().to_vec();
    for &edge in own.edges() {
        // Edges that agree to rounding are one.
        if !edges.iter().any(|known| (known - edge).abs() <= 1e-9 * edge) {
            edges.push(edge);
        }
    }
    edges.sort_by(f64::total_cmp);
    if edges.len() == grid.edges().len() {
        return Ok(film);
    }
    let Ok(finer) = Grid::from_edges(edges) else { return Ok(film) };
    // The band that each finer one lies in; none beyond the picture's.
    let band_of = |nm: f64| grid.bands().position(|band| band.from <= nm && nm < band.to);
    let parts: Vec<Option<usize>> = finer.centres().map(band_of).collect();
    let count = grid.len();
    let mut values = filled(0.0, film.values.len() / count * parts.len())?;
    let pixels = values.par_chunks_mut(parts.len()).zip(film.values.par_chunks(count));
    pixels.for_each(|(out, light)| {
        for (value, part) in out.iter_mut().zip(&parts) {
            *value = part.map_or(0.0, |band| light[band]);
        }
    });
    Ok(BandFilm { bands: Bands::Spectral(finer), values, parts: Vec::new() })
}

/// A sentence on what of white light the sensor would see beyond `bands`.
fn beyond(sensor: &Sensor, bands: &Bands) -> Option<String> {
    let ([low, high], [from, to]) = (sensor.bands().range(), bands.range());
    // In bands of a nanometre, with edges where the picture ends.
    let mut edges = vec![low.min(from)];
    while edges.last().is_some_and(|edge| edge + 1.0 < high.max(to)) {
        edges.extend(edges.last().map(|edge| edge + 1.0));
    }
    edges.extend([from, to, high.max(to)]);
    edges.sort_by(f64::total_cmp);
    edges.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
    let grid = Grid::from_edges(edges).ok()?;
    let fine = sensor.clone().in_bands(Bands::Spectral(grid.clone())).ok()?;
    let inside: Vec<bool> = grid.centres().map(|middle| (from..to).contains(&middle)).collect();
    let lost = |channel: usize| {
        let electrons = fine.electrons_per_unit(channel).iter();
        let all: f64 = electrons.clone().sum();
        let seen: f64 = electrons.zip(&inside).filter(|(_, inside)| **inside).map(|(e, _)| e).sum();
        1.0 - seen / all
    };
    let names: Vec<String> = fine.channels().map(str::to_owned).collect();
    let worst = (0..names.len()).map(|channel| (lost(channel), channel));
    let (share, channel) = worst.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (share > TOLD).then(|| {
        format!(
            "the picture's bands reach from {from} to {to} nm and the sensor sees {low} to {high} nm: of white \
             light {:.1} % of what channel {} sees are beyond them and count as none",
            100.0 * share,
            names[channel]
        )
    })
}
