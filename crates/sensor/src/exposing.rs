//! Exposures of a sensor, and a film in the course of one: what light, neighbours, rows and columns bring to each block of pixels.

use std::borrow::Cow;

use rayon::prelude::*;

use crate::chain::{self, BLOCK, BlockPlace, BlockValues, Chain};
use crate::chip::Effects;
use crate::film::{Exposure, Film, InvalidValues, Moments, RawImage};
use crate::normal::pair;
use crate::philox::{DrawUse, PhiloxKey, Site};
use crate::responsivity::Responsivity;
use crate::spec::{NoiseModel, Radiometry};
use crate::whole_frame::WholeFrame;
use crate::{Sensor, SensorError};

impl Sensor {
    /// Exposes a film. The result depends on the film, the shot, the seed and the serial number
    /// alone: not on threads, nor on other frames.
    ///
    /// # Errors
    ///
    /// When the film is not of the sensor's size and bands.
    pub fn expose(
        &self,
        film: Film<'_>,
        shot: Exposure,
        seed: u64,
    ) -> Result<RawImage, SensorError> {
        let (width, height, depth) = self.check(film)?;
        let exposing = Exposing::new(self, film, shot, seed);
        let mut values = vec![0; width * height * depth];
        let rows = values.par_chunks_mut(width * depth).enumerate();
        let invalid = rows
            .map(|(row, out)| exposing.row(row, out))
            .reduce(InvalidValues::default, InvalidValues::sum);
        Ok(RawImage { width, height, depth, values, invalid })
    }

    /// The expected value and the variance of every pixel over frames of this very sensor, fixed
    /// pattern included: of the law that [`Self::expose`] draws from, with the well, the rounding and
    /// both ends of the converter in it. Row and column offsets count as each pixel's own.
    ///
    /// # Errors
    ///
    /// As [`Self::expose`].
    pub fn moments(&self, film: Film<'_>, shot: Exposure) -> Result<Moments, SensorError> {
        let (width, height, depth) = self.check(film)?;
        let exposing = Exposing::new(self, film, shot, 0);
        let mut mean = vec![0.0; width * height * depth];
        let mut variance = vec![0.0; width * height * depth];
        let rows = mean.par_chunks_mut(width * depth).zip(variance.par_chunks_mut(width * depth));
        let invalid = rows
            .enumerate()
            .map(|(row, (mean, variance))| exposing.moments_of_row(row, mean, variance))
            .reduce(InvalidValues::default, InvalidValues::sum);
        Ok(Moments { width, height, depth, mean, variance, invalid })
    }

    fn check(&self, film: Film<'_>) -> Result<(usize, usize, usize), SensorError> {
        let [width, height] = self.settings.resolution.map(|side| side as usize);
        let bands = self.response.bands.count();
        if film.values.len() != width * height * bands {
            return Err(SensorError::film(film.values.len(), [width, height, bands]));
        }
        Ok((width, height, self.depth()))
    }
}

/// A film in the course of an exposure.
pub(crate) struct Exposing<'a> {
    sensor: &'a Sensor,
    film: Film<'a>,
    frame: u32,
    chain: Chain,
    /// Factor on the worth of bands: T in physical mode.
    factor: f64,
    /// Offset of each column (e⁻), in this frame and in all; empty when nothing.
    columns: Vec<f64>,
    fixed_columns: Vec<f64>,
    /// Mean photo-electrons of all pixels, `[channel][row][column]`, where those of a column are not each for itself;
    /// else empty.
    whole: Vec<WholeFrame>,
}

impl<'a> Exposing<'a> {
    pub(crate) fn new(sensor: &'a Sensor, film: Film<'a>, shot: Exposure, seed: u64) -> Self {
        let chain = sensor.chain(shot.exposure, seed);
        let factor = match sensor.settings.radiometry {
            Radiometry::Digital => 1.0,
            Radiometry::Physical => shot.exposure,
        };
        let mut exposing = Self {
            sensor,
            film,
            frame: shot.frame,
            factor,
            columns: Vec::new(),
            fixed_columns: Vec::new(),
            whole: Vec::new(),
            chain,
        };
        exposing.fixed_columns = exposing.offsets_of_columns(Lasting::Always);
        exposing.columns = exposing.offsets_of_columns(Lasting::OneFrame);
        let fixed = exposing.fixed_columns.iter();
        match exposing.columns.is_empty() {
            true => exposing.columns = fixed.copied().collect(),
            false => exposing.columns.iter_mut().zip(fixed).for_each(|(own, fixed)| *own += fixed),
        }
        exposing.whole = exposing.whole_frame();
        exposing
    }

    /// Mean photo-electrons with smear and blooming; nothing of sensors without.
    fn whole_frame(&self) -> Vec<WholeFrame> {
        let Effects { blooming, smear, .. } = *self.chain.effects;
        if blooming + smear <= 0.0 {
            return Vec::new();
        }
        let [width, height] = self.sensor.settings.resolution.map(|side| side as usize);
        let of_channel = |channel: usize| {
            let rows = (0..height).into_par_iter();
            let values = rows.flat_map_iter(|row| self.with_crosstalk(row, channel)).collect();
            let mut frame = WholeFrame { width, values };
            if smear > 0.0 {
                frame.smear(smear);
            }
            if blooming > 0.0 {
                frame.bloom(blooming, self.chain.full_well, self.chain.dark);
            }
            frame
        };
        (0..self.sensor.depth()).map(of_channel).collect()
    }

    /// Offset of each column (e⁻); empty when nothing.
    fn offsets_of_columns(&self, lasting: Lasting) -> Vec<f64> {
        let s = &self.sensor.settings;
        let sigma = match lasting {
            Lasting::OneFrame => s.column_noise,
            Lasting::Always => s.column_pattern,
        };
        if sigma <= 0.0 || self.chain.noise == NoiseModel::None {
            return Vec::new();
        }
        let (key, site) = self.key_and_site(0, lasting);
        (0..s.resolution[0])
            .map(|column| sigma * one_normal(key, site, column, DrawUse::Column))
            .collect()
    }

    /// By what numbers a row or column is drawn.
    fn key_and_site(&self, row: usize, lasting: Lasting) -> (&PhiloxKey, Site) {
        let site = self.site(row, 0);
        match lasting {
            Lasting::OneFrame => (self.chain.of_read_out(), site),
            Lasting::Always => (&self.chain.pattern, Site { frame: 0, ..site }),
        }
    }

    pub(crate) fn row(&self, row: usize, out: &mut [u16]) -> InvalidValues {
        let depth = self.sensor.depth();
        let of_row = Lasting::ALL.map(|lasting| self.row_offset(row, lasting)).iter().sum();
        let mut numbers = [0; BLOCK];
        self.blocks(row, |place, start, channel, count, mean| {
            let mut offset = with_columns(of_row, &self.columns, start);
            chain::expose(&self.chain, place, mean, &mut offset, &mut numbers);
            let out = out[start * depth + channel..].iter_mut().step_by(depth);
            out.zip(&numbers[..count]).for_each(|(out, number)| *out = *number);
        })
    }

    pub(crate) fn moments_of_row(
        &self,
        row: usize,
        mean_out: &mut [f32],
        variance_out: &mut [f32],
    ) -> InvalidValues {
        let depth = self.sensor.depth();
        let s = &self.sensor.settings;
        let shared = s.row_noise * s.row_noise + s.column_noise * s.column_noise;
        let of_row = self.row_offset(row, Lasting::Always);
        let mut variance = [0.0; BLOCK];
        self.blocks(row, |place, start, channel, count, mean| {
            let mut offset = with_columns(of_row, &self.fixed_columns, start);
            chain::moments(&self.chain, shared, place, count, mean, &mut offset, &mut variance);
            let at = start * depth + channel;
            #[expect(clippy::cast_possible_truncation, reason = "DN need not more than f32")]
            for i in 0..count {
                mean_out[at + i * depth] = mean[i] as f32;
                variance_out[at + i * depth] = variance[i] as f32;
            }
        })
    }

    /// Calls `each` with the mean photo-electrons of every block of a row: its place, first column,
    /// channel of the image and number of pixels.
    fn blocks(
        &self,
        row: usize,
        mut each: impl FnMut(BlockPlace, usize, usize, usize, &mut BlockValues),
    ) -> InvalidValues {
        let width = self.sensor.settings.resolution[0] as usize;
        let bands = self.sensor.response.bands.count();
        let film = &self.film.values[row * width * bands..][..width * bands];
        let responsivities: Vec<Responsivity> =
            (0..self.sensor.depth()).map(|channel| self.responsivity(row, channel)).collect();
        let share = self.sensor.settings.crosstalk;
        let mut invalid = InvalidValues::default();
        let mut mean = [0.0; BLOCK];
        for (channel, responsivity) in responsivities.iter().enumerate() {
            let mixed = match self.whole.get(channel) {
                Some(frame) => Some(Cow::Borrowed(&frame.values[row * width..][..width])),
                None => (share > 0.0).then(|| Cow::Owned(self.with_crosstalk(row, channel))),
            };
            for start in (0..width).step_by(BLOCK) {
                let count = BLOCK.min(width - start);
                let values = &film[start * bands..][..count * bands];
                let seen = responsivity.gather(values, start, &mut mean[..count]);
                if channel == 0 {
                    invalid = invalid.sum(seen);
                }
                if let Some(mixed) = &mixed {
                    mean[..count].copy_from_slice(&mixed[start..start + count]);
                }
                // What is left of a short block repeats its last pixel and is thrown away.
                let last = mean[count - 1];
                mean[count..].fill(last);
                let site = self.site(row, channel);
                #[expect(clippy::cast_possible_truncation, reason = "sides have 16 bits")]
                each(BlockPlace { site, column: start as u32 }, start, channel, count, &mut mean);
            }
        }
        invalid
    }

    /// Mean photo-electrons of a row's pixels, of which each of their four neighbours collects a share. Beyond an
    /// edge the picture goes on as it ends.
    fn with_crosstalk(&self, row: usize, channel: usize) -> Vec<f64> {
        let [width, height] = self.sensor.settings.resolution.map(|side| side as usize);
        let bands = self.sensor.response.bands.count();
        let of_row = |row: usize| {
            let mut mean = vec![0.0; width];
            let values = &self.film.values[row * width * bands..][..width * bands];
            self.responsivity(row, channel).gather(values, 0, &mut mean);
            mean
        };
        let own = of_row(row);
        if self.sensor.settings.crosstalk <= 0.0 {
            return own;
        }
        let [above, below] = [row.saturating_sub(1), (row + 1).min(height - 1)].map(of_row);
        let share = self.sensor.settings.crosstalk;
        let mixed = (0..width).map(|x| {
            let neighbours = own[x.saturating_sub(1)] + own[(x + 1).min(width - 1)];
            own[x] * (1.0 - 4.0 * share) + share * (neighbours + above[x] + below[x])
        });
        mixed.collect()
    }

    /// Worth of bands along a row: by the filters' turns, or in one channel of the image.
    fn responsivity(&self, row: usize, channel: usize) -> Responsivity {
        let response = &self.sensor.response;
        let channels = match &response.pattern {
            Some(pattern) => pattern[row % pattern.len()].as_slice(),
            None => &[channel],
        };
        let electrons = channels.iter().flat_map(|&channel| &response.channels[channel].electrons);
        let electrons = electrons.map(|electrons| electrons * self.factor).collect();
        Responsivity { bands: response.bands.count(), electrons }
    }

    #[expect(clippy::cast_possible_truncation, reason = "sides have 16 bits, channels 12")]
    fn site(&self, row: usize, channel: usize) -> Site {
        Site { row: row as u32, channel: channel as u16, frame: self.frame }
    }

    /// Offset of the row (e⁻).
    fn row_offset(&self, row: usize, lasting: Lasting) -> f64 {
        let s = &self.sensor.settings;
        let sigma = match lasting {
            Lasting::OneFrame => s.row_noise,
            Lasting::Always => s.row_pattern,
        };
        if sigma <= 0.0 || self.chain.noise == NoiseModel::None {
            return 0.0;
        }
        let (key, site) = self.key_and_site(row, lasting);
        sigma * one_normal(key, site, 0, DrawUse::Row)
    }
}

/// For how long an offset is what it is.
#[derive(Debug, Clone, Copy)]
enum Lasting {
    OneFrame,
    Always,
}

impl Lasting {
    const ALL: [Self; 2] = [Self::OneFrame, Self::Always];
}

/// Offsets of rows and columns for the pixels of a block from column `start` on.
fn with_columns(of_row: f64, columns: &[f64], start: usize) -> BlockValues {
    let mut offset = [of_row; BLOCK];
    for (offset, column) in offset.iter_mut().zip(columns.iter().skip(start)) {
        *offset += column;
    }
    offset
}

fn one_normal(key: &PhiloxKey, site: Site, column: u32, draw_use: DrawUse) -> f64 {
    let [a, b, c, _] = key.words(site.counter(column, draw_use, 0));
    pair([a, b, c])[0]
}
