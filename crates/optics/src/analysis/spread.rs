//! Point spread functions.
//!
//! Of a pupil of amplitude a in optical direction cosines p, W waves ahead, the field at x from the
//! sphere's centre is U = ∫ a exp(2πi (W − p·x/λ)) dp, and the irradiance of a point of power 1 is
//! |U|²/(λ² ∫ a² dp): its integral over the plane is 1, by Parseval's theorem (M. Born and E. Wolf,
//! *Principles of Optics*, 7th ed., 8.6.3 and 9.1). By FFT the sum over cells is taken at all points of a
//! grid at once; Huygens' sum takes the true distance from every cell of the sphere to every point.
//!
//! # Sampling
//!
//! A pupil of N cells has an image of M ≥ 2N points: λ over M cells apart, which is at most half of
//! what the irradiance, whose highest frequency is the pupil's width over λ, has to have. The image
//! spans λ over one cell: rays that land outside would come in on the other side, and do not as long
//! as the wavefront changes by less than half a wave from cell to cell. The sum over cells sees the
//! pupil through one cell, so what it gives is divided by that cell's own transform.

use etendue_report::Refusal;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

use super::AnalysisError;
use super::pupil::PupilField;
use super::wavefront::{NYQUIST, ReferenceSphere};

/// Irradiance over a part of the image plane, of a point of power 1.
#[derive(Debug, Clone, PartialEq)]
pub struct PointSpread {
    /// Points a side; row by row, y upwards.
    pub size: usize,
    /// From one point to the next (mm).
    pub pitch: f64,
    /// Irradiance (1/mm²); the sphere's centre is point (`size`/2, `size`/2).
    pub values: Vec<f64>,
    /// Value at the centre for the same pupil without aberrations (1/mm²).
    pub perfect: f64,
}

/// Fields of one object point with their weights, which add up to 1.
#[derive(Debug, Clone)]
pub struct WeightedFields(Vec<(PupilField, f64)>);

/// Weights of so many wavelengths, as shares of their sum.
pub(super) fn shares(weights: &[f64], wavelengths: usize) -> Result<Vec<f64>, AnalysisError> {
    let sum: f64 = weights.iter().sum();
    let are_weights = weights.iter().all(|weight| *weight >= 0.0 && weight.is_finite());
    if weights.len() != wavelengths || !are_weights || sum <= 0.0 {
        let words: Vec<String> = weights.iter().map(f64::to_string).collect();
        let words = words.join(", ");
        let why = format!("the weights {words} for {wavelengths} wavelengths make no mean");
        let remedy = "give one number from 0 on for each wavelength, not all of them 0";
        return Err(Refusal::new(why).hint(remedy).into());
    }
    Ok(weights.iter().map(|weight| weight / sum).collect())
}

/// sin πx / πx.
pub(super) fn sinc(x: f64) -> f64 {
    let angle = std::f64::consts::PI * x;
    if angle.abs() < 1e-6 { 1.0 - angle * angle / 6.0 } else { angle.sin() / angle }
}

impl WeightedFields {
    /// Fields, one a wavelength, and what each counts for.
    ///
    /// # Errors
    ///
    /// When there are not as many weights as fields, one is negative or none, or they sum to nothing.
    pub fn new(fields: Vec<PupilField>, weights: &[f64]) -> Result<Self, AnalysisError> {
        let shares = shares(weights, fields.len())?;
        let weighted = fields.into_iter().zip(shares).filter(|(_, weight)| *weight > 0.0);
        Ok(Self(weighted.collect()))
    }

    /// One field alone.
    #[must_use]
    pub fn one(field: PupilField) -> Self {
        Self(vec![(field, 1.0)])
    }

    /// The fields and their weights.
    #[must_use]
    pub fn fields(&self) -> &[(PupilField, f64)] {
        &self.0
    }

    /// The fields on the image plane `defocus` (mm) farther behind the lens, about the point that the
    /// chief ray of the first has there.
    ///
    /// # Errors
    ///
    /// When the cells are too few there.
    pub fn at_focus(&self, defocus: f64) -> Result<Self, AnalysisError> {
        let slopes = self.0.first().map_or(DVec2::ZERO, |(field, _)| field.chief_slopes);
        let shift = (slopes * defocus).extend(defocus);
        let move_one = |(field, weight): &(PupilField, f64)| {
            let moved = field.clone().moved(shift);
            let steepest = moved.steepest();
            if steepest > NYQUIST {
                let needed = moved.needed_cells(0.5 * NYQUIST);
                return Err(AnalysisError::Coarse { cells: moved.cells, steepest, needed });
            }
            Ok((moved, *weight))
        };
        Ok(Self(self.0.iter().map(move_one).collect::<Result<_, _>>()?))
    }

    /// The irradiance (1/mm²) in the centre without aberrations.
    fn perfect(&self) -> f64 {
        let of_one = |(field, weight): &(PupilField, f64)| {
            let sum: f64 = field.amplitude.iter().sum();
            weight * sum * sum * norm(field)
        };
        self.0.iter().map(of_one).sum()
    }

    /// The irradiance (1/mm²) at places of the image plane from the sphere's centre (mm), by sums over
    /// cells.
    fn irradiance(&self) -> impl Fn(DVec2) -> f64 + '_ {
        let all: Vec<Vec<Complex64>> = self.0.iter().map(|(field, _)| amplitudes(field)).collect();
        move |place| {
            let of_one = |((field, weight), amplitudes): (&(PupilField, f64), &Vec<Complex64>)| {
                let n = field.cells;
                let cycles = place * (field.step / (field.wavelength * 1e-6));
                let wave = |cycles: f64, k: usize| {
                    Complex64::from_polar(1.0, -std::f64::consts::TAU * cycles * k as f64)
                };
                let across: Vec<Complex64> = (0..n).map(|k| wave(cycles.x, k)).collect();
                let row = |(k, row): (usize, &[Complex64])| -> Complex64 {
                    let sum: Complex64 = row.iter().zip(&across).map(|(a, wave)| a * wave).sum();
                    sum * wave(cycles.y, k)
                };
                let sum: Complex64 = amplitudes.chunks(n).enumerate().map(row).sum();
                weight * (sum / (sinc(cycles.x) * sinc(cycles.y))).norm_sqr() * norm(field)
            };
            self.0.iter().zip(&all).map(of_one).sum()
        }
    }
}

/// A exp(2πi W) of every cell.
pub(super) fn amplitudes(field: &PupilField) -> Vec<Complex64> {
    let mut amplitudes = vec![Complex64::ZERO; field.cells * field.cells];
    for i in field.lit() {
        let angle = std::f64::consts::TAU * field.mean_waves(i);
        amplitudes[i] = Complex64::from_polar(averaged(field, i), angle);
    }
    amplitudes
}

/// Factor that makes |Σ a|² the irradiance of a power of 1 (1/mm²).
pub(super) fn norm(field: &PupilField) -> f64 {
    let step = field.step / (field.wavelength * 1e-6);
    step * step / field.total_power()
}

/// The mean amplitude of a cell over which the wavefront is inclined.
pub(super) fn averaged(field: &PupilField, i: usize) -> f64 {
    let n = field.cells;
    let (row, column) = (i / n, i % n);
    // By the difference to the lit cells on both sides.
    let change = |before: Option<usize>, behind: Option<usize>| {
        let known = |at: &usize| field.clear[*at] > 0.0;
        match (before.filter(known), behind.filter(known)) {
            (Some(a), Some(b)) => 0.5 * (field.waves[b] - field.waves[a]),
            (Some(a), None) => field.waves[i] - field.waves[a],
            (None, Some(b)) => field.waves[b] - field.waves[i],
            (None, None) => 0.0,
        }
    };
    let across = change((column > 0).then(|| i - 1), (column + 1 < n).then_some(i + 1));
    let along = change((row > 0).then(|| i - n), (row + 1 < n).then_some(i + n));
    field.amplitude[i] * sinc(across) * sinc(along)
}

impl PointSpread {
    /// By FFT, with `fine` times as many points as the least: 1 holds all there is to know, more are
    /// for looking at.
    #[must_use]
    pub fn by_fft(fields: &WeightedFields, fine: usize) -> Self {
        let Some((first, _)) = fields.0.first() else {
            return Self { size: 0, pitch: 1.0, values: Vec::new(), perfect: 1.0 };
        };
        let size = 2 * first.cells * fine.max(1);
        let pitch = first.wavelength * 1e-6 / (size as f64 * first.step);
        let mut values = vec![0.0; size * size];
        for (field, weight) in &fields.0 {
            let amplitudes = spectrum(field, size);
            let scale = weight * norm(field);
            let half = (size / 2) as f64;
            for (i, value) in values.iter_mut().enumerate() {
                let cycles = |k: usize| (k as f64 - half) / size as f64;
                let through = sinc(cycles(i % size)) * sinc(cycles(i / size));
                *value += scale * amplitudes[i].norm_sqr() / (through * through);
            }
        }
        Self { size, pitch, values, perfect: fields.perfect() }
    }

    /// That of one wavelength by Huygens' sum, on `size` points a side, `pitch` (mm) apart.
    #[must_use]
    pub fn by_huygens(
        field: &PupilField,
        sphere: &ReferenceSphere,
        size: usize,
        pitch: f64,
    ) -> Self {
        let mut values = vec![0.0; size * size];
        let length = field.wavelength * 1e-6;
        let cells: Vec<(DVec3, f64, f64)> = field
            .lit()
            .map(|i| {
                let p = field.place(i) / field.index;
                let direction = p.extend((1.0 - p.length_squared()).max(0.0).sqrt());
                (direction, averaged(field, i), field.mean_waves(i))
            })
            .collect();
        let scale = norm(field);
        let sum: f64 = field.amplitude.iter().sum();
        let perfect = sum * sum * scale;
        values.par_iter_mut().enumerate().for_each(|(i, value)| {
            let at = |k: usize| (k as f64 - (size / 2) as f64) * pitch;
            let place = DVec3::new(at(i % size), at(i / size), 0.0);
            let mut field_there = Complex64::ZERO;
            for &(direction, amplitude, waves) in &cells {
                // The way from the sphere less its radius, without losing digits.
                let square = 2.0 * sphere.radius * direction.dot(place) + place.length_squared();
                let way = (sphere.radius * sphere.radius + square).max(0.0).sqrt();
                let rest = square / (way.copysign(sphere.radius) + sphere.radius);
                let phase = waves - field.index * rest / length;
                field_there += Complex64::from_polar(amplitude, std::f64::consts::TAU * phase);
            }
            let cycles = place.truncate() * (field.step / length);
            let through = sinc(cycles.x) * sinc(cycles.y);
            *value = scale * (field_there / through).norm_sqr();
        });
        Self { size, pitch, values, perfect }
    }

    /// The place of a point from the sphere's centre (mm).
    #[must_use]
    pub fn place(&self, i: usize) -> DVec2 {
        let half = (self.size / 2) as f64;
        DVec2::new((i % self.size) as f64 - half, (i / self.size) as f64 - half) * self.pitch
    }

    /// The brightest point.
    #[must_use]
    pub fn brightest(&self) -> (DVec2, f64) {
        let best = self.values.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        best.map_or((DVec2::ZERO, 0.0), |(i, value)| (self.place(i), *value))
    }

    /// Irradiance of a line along y (1/mm) against x from the centre (mm), and of one along x against
    /// y.
    #[must_use]
    pub fn lines(&self) -> [Vec<[f64; 2]>; 2] {
        let at = |k: usize| (k as f64 - (self.size / 2) as f64) * self.pitch;
        let value = |row: usize, column: usize| self.values[row * self.size + column];
        let sum = |k: usize, axis: usize| -> f64 {
            let of = |other: usize| if axis == 0 { value(other, k) } else { value(k, other) };
            (0..self.size).map(of).sum::<f64>() * self.pitch
        };
        [0, 1].map(|axis| (0..self.size).map(|k| [at(k), sum(k, axis)]).collect())
    }
}

/// The brightest place of the image (mm from the centre), and its share of the irradiance that the
/// same pupil would have without aberrations: Strehl's ratio.
#[must_use]
pub fn strehl(fields: &WeightedFields) -> (DVec2, f64) {
    strehl_of(fields, &PointSpread::by_fft(fields, 1))
}

/// Strehl ratio and its place, as [`strehl`], from a point spread function that is there already.
pub(super) fn strehl_of(fields: &WeightedFields, spread: &PointSpread) -> (DVec2, f64) {
    /// The search ends this small a share of a point's distance from the last place.
    const HALVINGS: u32 = 10;
    let irradiance = fields.irradiance();
    let (mut place, _) = spread.brightest();
    let mut best = irradiance(place);
    let mut step = 0.5 * spread.pitch;
    for _ in 0..HALVINGS {
        let places = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y].map(|d| place + d * step);
        let values = places.map(&irradiance);
        // The top of the parabola through three points, in x and in y.
        let top = |low: f64, high: f64| {
            let bend = low + high - 2.0 * best;
            if bend < 0.0 { (0.5 * (low - high) / bend).clamp(-1.0, 1.0) } else { 0.0 }
        };
        let next = place + DVec2::new(top(values[1], values[0]), top(values[3], values[2])) * step;
        let there = irradiance(next);
        if there > best {
            let gain = there - best;
            (place, best) = (next, there);
            if gain < 1e-9 * best {
                break;
            }
        }
        step *= 0.5;
    }
    (place, best / fields.perfect())
}

/// The transform of a pupil in `size`² points, the centre in the middle.
fn spectrum(field: &PupilField, size: usize) -> Vec<Complex64> {
    let mut grid = vec![Complex64::ZERO; size * size];
    let offset = size / 2 - field.cells / 2;
    for (row, values) in amplitudes(field).chunks(field.cells).enumerate() {
        grid[(row + offset) * size + offset..][..field.cells].copy_from_slice(values);
    }
    transform(&mut grid, size);
    grid
}

/// The two-dimensional transform with exponent −2πi, of a square whose middle is point `size`/2, to
/// one likewise.
pub(super) fn transform(grid: &mut Vec<Complex64>, size: usize) {
    let fft = FftPlanner::new().plan_fft_forward(size);
    for _ in 0..2 {
        grid.par_chunks_mut(size).for_each(|row| {
            // The middle to the front, and back.
            row.rotate_left(size / 2);
            fft.process(row);
            row.rotate_right(size / 2);
        });
        *grid = transposed(grid, size);
    }
}

fn transposed(grid: &[Complex64], size: usize) -> Vec<Complex64> {
    /// Squares of so many values a side stay in the nearest cache.
    const SQUARE: usize = 16;
    let mut turned = vec![Complex64::ZERO; grid.len()];
    turned.par_chunks_mut(SQUARE * size).enumerate().for_each(|(block, rows)| {
        for left in (0..size).step_by(SQUARE) {
            for (row, values) in rows.chunks_mut(size).enumerate() {
                let from = block * SQUARE + row;
                for column in left..(left + SQUARE).min(size) {
                    values[column] = grid[column * size + from];
                }
            }
        }
    });
    turned
}
