//! Optical transfer functions: by diffraction, the Fourier transform of the point spread function; by
//! rays, the mean of exp(−2πi ν·x) over where they land. Both on one grid of rays.
//!
//! Encircled energy within r is r ∫∫ OTF(ν) J₁(2πνr)/ν d²ν (J. W. Goodman, *Introduction to Fourier
//! Optics*, with the transform of a disc): so it needs no more than the transfer function, and nothing
//! of it is cut off at the edge of a picture.

use glam::DVec2;
use rustfft::num_complex::Complex64;

use super::spread::{PointSpread, WeightedFields, amplitudes, sinc, transform};

/// A transfer function on a grid of frequencies.
#[derive(Debug, Clone)]
pub struct Transfer {
    /// Frequencies a side.
    size: usize,
    /// From one frequency to the next (cycles/mm).
    pub step: f64,
    /// Limits from which on it is 0 in x and in y (cycles/mm): what the widest pupil over the shortest
    /// wavelength passes.
    pub limit: f64,
    values: Vec<Complex64>,
}

impl Transfer {
    /// Of a point spread function with all of its points.
    #[must_use]
    pub fn of(spread: &PointSpread) -> Self {
        let size = spread.size;
        let area = spread.pitch * spread.pitch;
        // The irradiance has been divided by the transform of a cell, which makes too much of what the
        // grid's neighbours leave at its edges. What the smoothing by a cell takes of the transfer
        // function is a twelfth of its second differences.
        let half = (size / 2) as f64;
        let through: Vec<[f64; 2]> = (0..size)
            .map(|k| {
                let cycles = (k as f64 - half) / size as f64;
                [sinc(cycles).powi(2), (1.0 - (std::f64::consts::TAU * cycles).cos()) / 6.0]
            })
            .collect();
        let mut values: Vec<Complex64> = (0..size * size)
            .map(|i| {
                let [[a, x], [b, y]] = [through[i % size], through[i / size]];
                Complex64::from(spread.values[i] * area * a * b * (1.0 + x + y))
            })
            .collect();
        transform(&mut values, size);
        sharpen(&mut values, size);
        let step = 1.0 / (size as f64 * spread.pitch);
        Self { size, step, limit: 0.5 / spread.pitch, values }
    }

    /// By diffraction.
    #[must_use]
    pub fn diffraction(fields: &WeightedFields) -> Self {
        Self::of(&PointSpread::by_fft(fields, 1))
    }

    /// The function at a frequency (cycles/mm in x and y), about the sphere's centre.
    #[must_use]
    pub fn at(&self, frequency: DVec2) -> Complex64 {
        let cells = frequency / self.step;
        let far = cells.length();
        // It has a peak at 0, and is smooth along a line from there; across it only beyond.
        if cells.x == 0.0 || cells.y == 0.0 || far >= 1.0 {
            return self.between(cells);
        }
        let there = self.between(cells / far);
        Complex64::ONE + (there - 1.0) * far
    }

    /// A polynomial through the six nearest frequencies in x and in y, none of which lies beyond 0.
    fn between(&self, cells: DVec2) -> Complex64 {
        let half = self.size as f64 / 2.0;
        if cells.abs().max_element() >= half - 4.0 {
            return Complex64::ZERO;
        }
        let [columns, rows] = [cells.x, cells.y].map(nodes);
        let mut sum = Complex64::ZERO;
        for (row, by_row) in rows.into_iter().filter(|node| node.1 != 0.0) {
            for (column, by_column) in columns.into_iter().filter(|node| node.1 != 0.0) {
                sum += self.node(column, row) * (by_row * by_column);
            }
        }
        sum
    }

    fn node(&self, column: i64, row: i64) -> Complex64 {
        let half = (self.size / 2) as i64;
        let index = (row + half) * self.size as i64 + column + half;
        usize::try_from(index).ok().and_then(|i| self.values.get(i)).copied().unwrap_or_default()
    }

    /// Modulation at a frequency (cycles/mm) of waves along y, which a field in y calls tangential, and
    /// along x, sagittal.
    #[must_use]
    pub fn modulation(&self, frequency: f64) -> [f64; 2] {
        [DVec2::Y, DVec2::X].map(|along| self.at(along * frequency).norm())
    }

    /// The share of light within each of the radii (mm) about a place (mm from the sphere's centre).
    #[must_use]
    pub fn encircled(&self, about: DVec2, radii: &[f64]) -> Vec<f64> {
        const ANGLES: u32 = 96;
        let count = (self.size / 2).saturating_sub(5);
        // The mean over all directions at each frequency, with two of them in a step.
        let rings: Vec<f64> = (0..2 * count)
            .map(|k| {
                let frequency = 0.5 * k as f64 * self.step;
                let mean = (0..ANGLES).map(|i| {
                    let angle = std::f64::consts::TAU * (f64::from(i) + 0.5) / f64::from(ANGLES);
                    let along = DVec2::from_angle(angle) * frequency;
                    let turn = std::f64::consts::TAU * along.dot(about);
                    (self.at(along) * Complex64::from_polar(1.0, turn)).re
                });
                mean.sum::<f64>() / f64::from(ANGLES)
            })
            .collect();
        let step = 0.5 * self.step;
        let within = |&radius: &f64| {
            let value = |k: usize| {
                let frequency = k as f64 * step;
                rings[k] * libm::j1(std::f64::consts::TAU * frequency * radius)
            };
            // Simpson's rule; there is nothing left at the last frequency.
            let sum: f64 =
                (0..rings.len()).map(|k| value(k) * if k % 2 == 0 { 2.0 } else { 4.0 }).sum();
            (std::f64::consts::TAU * radius * sum * step / 3.0).clamp(0.0, 1.0)
        };
        radii.iter().map(within).collect()
    }
}

/// Nodes of an interpolation.
const NODES: usize = 6;

/// The nodes about a place, and what each counts for in Lagrange's polynomial. Left and right of 0
/// they are taken from one side, for the function has a peak there.
#[expect(clippy::cast_possible_truncation, reason = "nodes of a grid of at most a few thousand")]
fn nodes(at: f64) -> [(i64, f64); NODES] {
    let side = if at < 0.0 { -1.0 } else { 1.0 };
    let far = at.abs();
    let first = (far.floor() - 2.0).max(0.0);
    let t = far - first;
    std::array::from_fn(|k| {
        let others = (0..NODES).filter(|&other| other != k);
        let weight = others.map(|other| (t - other as f64) / (k as f64 - other as f64)).product();
        ((side * (first + k as f64)) as i64, weight)
    })
}

/// Takes out of the values next to 0 what a sum over cells leaves there.
///
/// The peak of the function is a cone 1 − k|ν|, whatever the aberrations: k is the pupil's width over
/// its area. Smoothed by cells, and sharpened by a twelfth of the second differences, it is off by a
/// few hundredths of k from one frequency to the next. What the smoothing leaves of the value at 0,
/// which is 1, says how large k is.
fn sharpen(values: &mut [Complex64], size: usize) {
    const REACH: i64 = 4;
    let middle = (size / 2) as i64;
    let index = |x: i64, y: i64| usize::try_from((middle + y) * size as i64 + middle + x).ok();
    let at_peak = sharpened_cone(0, 0);
    let Some(peak) = index(0, 0).filter(|&peak| peak < values.len()) else { return };
    let slope = (1.0 - values[peak].re) / at_peak;
    for y in -REACH..=REACH {
        for x in -REACH..=REACH {
            let left = sharpened_cone(x, y) - (x as f64).hypot(y as f64);
            if let Some(value) = index(x, y).and_then(|i| values.get_mut(i)) {
                *value += slope * left;
            }
        }
    }
    values[peak] = Complex64::ONE;
}

/// The cone |ν| at a node, smoothed by a cell twice.
fn smoothed_cone(x: i64, y: i64) -> f64 {
    const FINE: i64 = 24;
    let offset = |k: i64| (k as f64 + 0.5) / FINE as f64 - 1.0;
    let (mut sum, mut weight) = (0.0, 0.0);
    for k in 0..2 * FINE {
        for l in 0..2 * FINE {
            let (dx, dy) = (offset(k), offset(l));
            let share = (1.0 - dx.abs()) * (1.0 - dy.abs());
            sum += share * (x as f64 + dx).hypot(y as f64 + dy);
            weight += share;
        }
    }
    sum / weight
}

/// Smoothed cone less a twelfth of its second differences.
fn sharpened_cone(x: i64, y: i64) -> f64 {
    let own = smoothed_cone(x, y);
    let neighbours = smoothed_cone(x + 1, y)
        + smoothed_cone(x - 1, y)
        + smoothed_cone(x, y + 1)
        + smoothed_cone(x, y - 1);
    own - (neighbours - 4.0 * own) / 12.0
}

/// Modulation by diffraction at one frequency (cycles/mm) alone, of waves along y and along x: the few values of the
/// pupil's autocorrelation that [`Transfer::modulation`] takes there, without the transform that has all. Not for the
/// lowest frequencies, whose peak is sharpened there.
#[must_use]
pub fn modulation_at(fields: &WeightedFields, frequency: f64) -> [f64; 2] {
    let all: Vec<_> = fields.fields().iter().map(|(field, _)| amplitudes(field)).collect();
    [[0, 1], [1, 0]].map(|[x, y]: [i64; 2]| {
        let mut sum = Complex64::ZERO;
        for ((field, weight), amplitudes) in fields.fields().iter().zip(&all) {
            let step = field.step / (field.wavelength * 1e-6);
            let nodes = nodes(frequency / step);
            if nodes[0].0 + NODES as i64 >= field.cells as i64 {
                continue;
            }
            let scale = weight / field.total_power();
            // Along the line, and on both sides of it.
            let at = |along: i64, across: i64| {
                let shift = [along * x + across * y, along * y + across * x];
                autocorrelation(amplitudes, field.cells, shift)
            };
            let line: Vec<Complex64> = (-1..=NODES as i64).map(|k| at(nodes[0].0 + k, 0)).collect();
            for (k, (node, by)) in nodes.into_iter().enumerate() {
                let neighbours = line[k] + line[k + 2] + at(node, 1) + at(node, -1);
                sum += (line[k + 1] * (4.0 / 3.0) - neighbours / 12.0) * (scale * by);
            }
        }
        sum.norm()
    })
}

/// Σ A(p + s) A*(p) over cells, for a shift of so many to the right and up.
fn autocorrelation(amplitudes: &[Complex64], cells: usize, [right, up]: [i64; 2]) -> Complex64 {
    if up < 0 {
        return autocorrelation(amplitudes, cells, [-right, -up]).conj();
    }
    let far = |shift: i64| usize::try_from(shift.unsigned_abs()).unwrap_or(cells).min(cells);
    let (shift, width) = (far(right), cells - far(right));
    let rows = amplitudes.chunks(cells).zip(amplitudes.chunks(cells).skip(far(up)));
    rows.map(|(low, high)| {
        let (low, high) = match right < 0 {
            true => (&low[shift..], &high[..width]),
            false => (&low[..width], &high[shift..]),
        };
        high.iter().zip(low).map(|(high, low)| high * low.conj()).sum::<Complex64>()
    })
    .sum()
}

/// Modulation by rays alone, of waves along y and along x, at even frequencies from 0 on.
#[must_use]
pub fn geometric_modulations(fields: &WeightedFields, step: f64, count: usize) -> Vec<[f64; 2]> {
    let mut sums = vec![[Complex64::ZERO; 2]; count];
    for (field, weight) in fields.fields() {
        let total = field.total_power();
        for i in field.lit() {
            let share = weight * field.power[i] / total;
            let turns = [field.landing[i].y, field.landing[i].x]
                .map(|at| Complex64::from_polar(1.0, -std::f64::consts::TAU * step * at));
            let mut waves = [Complex64::from(share); 2];
            for sums in &mut sums {
                for axis in 0..2 {
                    sums[axis] += waves[axis];
                    waves[axis] *= turns[axis];
                }
            }
        }
    }
    sums.into_iter().map(|sums| sums.map(Complex64::norm)).collect()
}

/// Modulation by rays alone, of waves along y and along x.
#[must_use]
pub fn geometric_modulation(fields: &WeightedFields, frequency: f64) -> [f64; 2] {
    [DVec2::Y, DVec2::X].map(|along| {
        let mut sum = Complex64::ZERO;
        for (field, weight) in fields.fields() {
            let total = field.total_power();
            for i in field.lit() {
                let angle = -std::f64::consts::TAU * frequency * along.dot(field.landing[i]);
                sum += Complex64::from_polar(weight * field.power[i] / total, angle);
            }
        }
        sum.norm()
    })
}
