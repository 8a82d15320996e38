//! Point spread functions as shares of light on square cells, such as pixels or parts of them.
//!
//! # Sampling
//!
//! The irradiance of a pupil has no finer detail than λN, its wavelength times its f-number. Cells of
//! at most λN/3 take the irradiance in their middles: sums over them are then those of all of it
//! (the sampling theorem). Larger cells take the mean over them, sharpened by a 24th of its
//! second differences, so that a picture of such cells, each the mean over itself, is not blurred
//! twice: what is left of a cell's own transform is 1 − O(u⁴) at u cycles a cell.
//!
//! Beyond where rays land, light is added up as waves for 40 λN. What diffraction sends farther, about
//! half a percent of a round pupil's, is spread over a ring half as wide again, by the third power of the
//! distance as behind a round pupil: no light is lost.

use glam::DVec2;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

use super::between::{FARTHEST_WAVES, airy_unit, landing_reach};
use super::pupil::PupilField;
use super::quick_length;
use super::spread::{amplitudes, norm, sinc};

/// Margin beyond the rays' landings within which light is added up as waves (wavelengths times the
/// f-number). Not a setting: what goes farther is half a percent, which is not lost, and grids of the pupil are chosen
/// for it.
const REACH: f64 = 40.0;

/// The ring that holds what goes farther ends at this many times that distance.
const RING: f64 = 1.5;

/// Cells of this share of λN or less take the irradiance in their middle.
const FINE: f64 = 1.0 / 3.0;

/// On cells of more λN, all light lands where rays do.
const COARSE: f64 = 4.0;

/// Cell grid on the image plane: how a step to the right and one down in the picture run there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellGrid {
    /// A cell's side (mm).
    pub pitch: f64,
    /// 1 where columns run along x and rows against y; −1 where both are turned.
    pub turn: f64,
    /// Cells from the middle that there are at most: of a picture smaller than the spread.
    pub most: usize,
}

/// Shares of a point's light by cell.
#[derive(Debug, Clone, PartialEq)]
pub struct CellSpread {
    /// Cells on each side of the middle one, which the point's image is in the middle of.
    pub half: usize,
    /// Row by row as in the picture, (2 `half` + 1)² of them; their sum is 1.
    pub shares: Vec<f64>,
}

impl CellSpread {
    /// All light in the middle.
    #[must_use]
    pub fn point() -> Self {
        Self { half: 0, shares: vec![1.0] }
    }

    /// Cells on each side of the middle one of what lands near it, where λN is so many cells and there are `most`.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts of cells")]
    pub fn half_of_sharp(unit: f64, most: usize) -> usize {
        ((REACH * RING * unit).ceil().max(1.0) as usize).min(most.max(1))
    }

    /// The share of the cell in a column and row, of what is seen in a mirror along x or y.
    #[must_use]
    pub fn share(&self, [column, row]: [usize; 2], mirrored: [bool; 2]) -> f64 {
        let last = 2 * self.half;
        let [x, y] = [(column, mirrored[0]), (row, mirrored[1])]
            .map(|(k, mirrored)| if mirrored { last - k } else { k });
        self.shares[y * (last + 1) + x]
    }

    /// Sum of the absolute differences of the two spreads' shares: twice the share of light that
    /// `other` has elsewhere. No difference of their transfer functions exceeds it.
    #[must_use]
    pub fn difference(&self, other: &Self) -> f64 {
        let half = self.half.max(other.half);
        let side = 2 * half + 1;
        let share = |spread: &Self, i: usize| {
            let own = 2 * spread.half + 1;
            let from = |k: usize| (k + spread.half).checked_sub(half).filter(|&k| k < own);
            match (from(i / side), from(i % side)) {
                (Some(row), Some(column)) => spread.shares[row * own + column],
                _ => 0.0,
            }
        };
        (0..side * side).map(|i| (share(self, i) - share(other, i)).abs()).sum()
    }

    /// The spread of fields about one centre, which count alike.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts of cells")]
    pub fn of(fields: &[PupilField], grid: &CellGrid) -> Self {
        let cells = |mm: f64| ((mm / grid.pitch).ceil().max(1.0) as usize).min(grid.most.max(1));
        let unit = fields.iter().map(airy_unit).fold(0.0, f64::max);
        let least = fields.iter().map(airy_unit).fold(f64::INFINITY, f64::min);
        let far = fields.iter().map(landing_reach).fold(0.0, f64::max);
        let is_of_rays = far > FARTHEST_WAVES || grid.pitch > COARSE * unit;
        let core = match is_of_rays {
            true => cells((far + 2.0) * unit),
            false => cells((far + REACH) * unit),
        };
        let half = if is_of_rays { core } else { cells(core as f64 * grid.pitch * RING) };
        let side = 2 * half + 1;
        let mut shares = vec![0.0; side * side];
        if fields.is_empty() {
            return Self::point();
        }
        if is_of_rays {
            for field in fields {
                add_rays(field, grid, half, &mut shares);
            }
            return Self { half, shares }.normalised();
        }
        let light = match grid.pitch <= FINE * least {
            true => CellLight::Middle,
            false => CellLight::Mean,
        };
        // One more on each side to take differences by.
        let margin = usize::from(light == CellLight::Mean);
        let wide = 2 * (core + margin) + 1;
        let mut means = vec![0.0; wide * wide];
        for field in fields {
            add_waves(field, grid, core + margin, light, &mut means);
        }
        let count = fields.len() as f64;
        for row in 0..2 * core + 1 {
            for column in 0..2 * core + 1 {
                let at = (row + margin) * wide + column + margin;
                let own = means[at];
                let value = match margin {
                    0 => own,
                    _ => {
                        let neighbours =
                            means[at - 1] + means[at + 1] + means[at - wide] + means[at + wide];
                        (own - (neighbours - 4.0 * own) / 24.0).max(0.0)
                    }
                };
                let from = |k: usize| k as f64 - core as f64;
                if from(row).hypot(from(column)) <= core as f64 + 0.5 {
                    let shift = half - core;
                    shares[(row + shift) * side + column + shift] = value / count;
                }
            }
        }
        Self { half, shares }.with_ring(core)
    }

    /// The shares with what is missing of 1 in the ring around the core.
    fn with_ring(mut self, core: usize) -> Self {
        let rest = 1.0 - self.shares.iter().sum::<f64>();
        let side = 2 * self.half + 1;
        let distance = |i: usize| {
            let from = |k: usize| k as f64 - self.half as f64;
            from(i / side).hypot(from(i % side))
        };
        let ring: Vec<(usize, f64)> = (0..side * side)
            .map(|i| (i, distance(i)))
            .filter(|(_, r)| *r > core as f64 + 0.5 && *r <= self.half as f64 + 0.5)
            .map(|(i, r)| (i, r.powi(-3)))
            .collect();
        let sum: f64 = ring.iter().map(|(_, share)| share).sum();
        if rest > 0.0 && sum > 0.0 {
            for (i, share) in ring {
                self.shares[i] = rest * share / sum;
            }
        }
        self.normalised()
    }

    fn normalised(mut self) -> Self {
        let sum: f64 = self.shares.iter().sum();
        if !(sum > 0.0 && sum.is_finite()) {
            return Self::point();
        }
        self.shares.iter_mut().for_each(|share| *share /= sum);
        self
    }
}

/// Sampling of the irradiance within a cell, before it is multiplied by the cell's area.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CellLight {
    /// That in its middle.
    Middle,
    /// The mean.
    Mean,
}

/// Adds a field's light, as waves, to cells up to `half` from the middle.
///
/// The irradiance is a sum of waves whose amplitudes are the pupil's autocorrelation R: Σ R exp(−2πi ν·x),
/// where ν are whole numbers of a cell of the pupil over the wavelength; the mean of each over a square is known.
/// R of −ν is the conjugate of R of ν, so half of them will do, and sums of x are those of −x with the
/// sines' sign changed.
fn add_waves(
    field: &PupilField,
    grid: &CellGrid,
    half: usize,
    light: CellLight,
    cells: &mut [f64],
) {
    let side = 2 * half + 1;
    let n = field.cells;
    let cycles = field.step / (field.wavelength * 1e-6) * grid.pitch;
    let mean = |k: usize| match light {
        CellLight::Middle => 1.0,
        CellLight::Mean => sinc(k as f64 * cycles),
    };
    // Of every frequency, at every distance from the middle.
    let table = |wave: fn(f64) -> f64| -> Vec<f64> {
        let turn = |k: usize, j: usize| std::f64::consts::TAU * (k * j) as f64 * cycles;
        (0..n).flat_map(|k| (0..=half).map(move |j| mean(k) * wave(turn(k, j)))).collect()
    };
    let (cosines, sines) = (table(f64::cos), table(f64::sin));
    let of = |k: usize| k * (half + 1)..(k + 1) * (half + 1);
    let correlation = autocorrelation(field);
    let scale = norm(field) * grid.pitch * grid.pitch;
    let length = field.wavelength * 1e-6;
    // What the sum over the pupil's cells takes away at a distance: the transform of one.
    let through: Vec<f64> = (0..=half)
        .map(|j| sinc(j as f64 * grid.pitch * field.step / length).powi(2).max(1e-3))
        .collect();
    // Sums over the frequencies along x at places x, real and imaginary: even and odd parts.
    let mut even = [vec![0.0; half + 1], vec![0.0; half + 1]];
    let mut odd = even.clone();
    // For each frequency along y, both parts at all places x.
    let mut lines: Vec<[Vec<f64>; 2]> = Vec::with_capacity(n);
    for along_y in 0..n {
        even.iter_mut().chain(&mut odd).for_each(|sums| sums.fill(0.0));
        for k in 0..n {
            let [ahead, behind] = [correlation.at(k, along_y), correlation.at_minus(k, along_y)];
            let (sum, difference) = match k {
                0 => (ahead, Complex64::ZERO),
                _ => (ahead + behind, ahead - behind),
            };
            if sum == Complex64::ZERO && difference == Complex64::ZERO {
                continue;
            }
            let (cos, sin) = (&cosines[of(k)], &sines[of(k)]);
            add_scaled(&mut even[0], sum.re, cos);
            add_scaled(&mut even[1], sum.im, cos);
            add_scaled(&mut odd[0], difference.re, sin);
            add_scaled(&mut odd[1], difference.im, sin);
        }
        // exp(−iφ): even − i odd.
        let mut line = [vec![0.0; side], vec![0.0; side]];
        let double = if along_y == 0 { scale } else { 2.0 * scale };
        for j in 0..=half {
            let [right, left] = match grid.turn > 0.0 {
                true => [half + j, half - j],
                false => [half - j, half + j],
            };
            let scale = double / through[j];
            line[0][right] = scale * (even[0][j] + odd[1][j]);
            line[1][right] = scale * (even[1][j] - odd[0][j]);
            line[0][left] = scale * (even[0][j] - odd[1][j]);
            line[1][left] = scale * (even[1][j] + odd[0][j]);
        }
        lines.push(line);
    }
    let (mut even, mut odd) = (vec![0.0; side], vec![0.0; side]);
    for j in 0..=half {
        even.fill(0.0);
        odd.fill(0.0);
        for (k, [re, im]) in lines.iter().enumerate() {
            add_scaled(&mut even, cosines[k * (half + 1) + j], re);
            add_scaled(&mut odd, sines[k * (half + 1) + j], im);
        }
        // Rows go down, against y.
        let [up, down] = match grid.turn > 0.0 {
            true => [half - j, half + j],
            false => [half + j, half - j],
        };
        let over = 1.0 / through[j];
        let mut add = |row: usize, sign: f64| {
            let cells = &mut cells[row * side..(row + 1) * side];
            for (cell, (even, odd)) in cells.iter_mut().zip(even.iter().zip(&odd)) {
                *cell += over * (even + sign * odd);
            }
        };
        add(up, 1.0);
        if j > 0 {
            add(down, -1.0);
        }
    }
}

/// Adds values times a number.
fn add_scaled(sums: &mut [f64], by: f64, values: &[f64]) {
    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += by * value);
}

/// A pupil's autocorrelation, of shifts up in y and both ways in x.
struct Autocorrelation {
    /// Shifts in y, and points of the transform in x.
    size: [usize; 2],
    /// Row by row of a shift in y each; shifts to the left come last.
    values: Vec<Complex64>,
}

impl Autocorrelation {
    /// That of a shift by so many cells to the right and up.
    fn at(&self, right: usize, up: usize) -> Complex64 {
        self.values[up * self.size[1] + right]
    }

    /// That of a shift to the left and up.
    fn at_minus(&self, left: usize, up: usize) -> Complex64 {
        self.values[up * self.size[1] + (self.size[1] - left) % self.size[1]]
    }
}

/// Σ A(p + s) A*(p) over cells, by its transform |FFT A|² on a grid on which shifts do not come round.
fn autocorrelation(field: &PupilField) -> Autocorrelation {
    let n = field.cells;
    let size = quick_length(2 * n - 1);
    let mut planner = FftPlanner::new();
    let (forward, inverse) = (planner.plan_fft_forward(size), planner.plan_fft_inverse(size));
    let mut rows = vec![Complex64::ZERO; n * size];
    for (row, values) in amplitudes(field).chunks(n).enumerate() {
        rows[row * size..][..n].copy_from_slice(values);
    }
    forward.process(&mut rows);
    // Columns, as rows that are longer than the pupil.
    let mut columns = vec![Complex64::ZERO; size * size];
    for (y, row) in rows.chunks(size).enumerate() {
        for (x, value) in row.iter().enumerate() {
            columns[x * size + y] = *value;
        }
    }
    forward.process(&mut columns);
    columns.iter_mut().for_each(|value| *value = Complex64::from(value.norm_sqr()));
    inverse.process(&mut columns);
    let scale = 1.0 / (size * size) as f64;
    let mut values = vec![Complex64::ZERO; n * size];
    for (up, row) in values.chunks_mut(size).enumerate() {
        for (x, value) in row.iter_mut().enumerate() {
            *value = columns[x * size + up] * scale;
        }
    }
    inverse.process(&mut values);
    Autocorrelation { size: [n, size], values }
}

/// Adds where a field's rays land to cells up to `half` from the middle: each cell of the pupil lights
/// a square as wide as the distance to the next one's.
fn add_rays(field: &PupilField, grid: &CellGrid, half: usize, cells: &mut [f64]) {
    let side = 2 * half + 1;
    let lit: Vec<usize> = field.lit().collect();
    let reach = lit.iter().map(|&i| field.landing[i].length()).fold(0.0, f64::max);
    let across = 2.0 * field.circle().1 / field.step;
    let width = (2.4 * reach / across / grid.pitch).max(1.0);
    let total = field.total_power();
    for i in lit {
        let DVec2 { x, y } = field.landing[i] * (grid.turn / grid.pitch);
        let middle = [x + half as f64 + 0.5, half as f64 + 0.5 - y];
        let spans = middle.map(|at| overlaps(at, width, side));
        for &(row, by_row) in &spans[1] {
            for &(column, by_column) in &spans[0] {
                cells[row * side + column] += field.power[i] / total * by_row * by_column;
            }
        }
    }
}

/// The cells that a span about a place overlaps, each with its share of the span.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the grid")]
fn overlaps(at: f64, width: f64, side: usize) -> Vec<(usize, f64)> {
    let (from, to) = (at - 0.5 * width, at + 0.5 * width);
    let first = from.floor().clamp(0.0, side as f64) as usize;
    let last = to.ceil().clamp(0.0, side as f64) as usize;
    let share = |k: usize| (to.min(k as f64 + 1.0) - from.max(k as f64)).max(0.0) / width;
    (first..last).map(|k| (k, share(k))).collect()
}
