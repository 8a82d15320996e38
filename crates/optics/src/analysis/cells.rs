//! Point spread functions as shares of light on square cells, such as pixels or parts of them.
//!
//! # Sampling
//!
//! The irradiance of a pupil has no finer detail than λN, its wavelength times its f-number. Cells of
//! at most λN/3 take the irradiance in their middles: sums over them are then those of all of it
//! (the sampling theorem). Larger cells take the mean over points in them, sharpened by a 24th of its
//! second differences, so that a picture of such cells, each the mean over itself, is not blurred
//! twice: what is left of a cell's own transform is 1 − O(u⁴) at u cycles a cell.
//!
//! Beyond where rays land, light is added up as waves for 40 λN. What diffraction sends farther, about
//! half a percent of a round pupil's, is spread over a ring half as wide again, by the third power of the
//! distance as behind a round pupil: no light is lost.

use glam::DVec2;
use rustfft::num_complex::Complex64;

use super::between::{FARTHEST_WAVES, airy_unit, landing_reach};
use super::pupil::PupilField;
use super::spread::{averaged, norm, sinc};

/// How far beyond the rays' landings light is added up as waves (wavelengths times the f-number).
const REACH: f64 = 40.0;

/// The ring that holds what goes farther ends at this many times that distance.
const RING: f64 = 1.5;

/// Cells of this share of λN or less take the irradiance in their middle.
const FINE: f64 = 1.0 / 3.0;

/// Points in larger cells are this share of λN apart, at most.
const FINER: f64 = 1.0 / 6.0;

/// On cells of more λN, all light lands where rays do.
const COARSE: f64 = 4.0;

/// Where cells lie: how a step to the right and one down in the picture run on the image plane.
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
        let points = match grid.pitch <= FINE * least {
            true => 1,
            false => (grid.pitch / (FINER * least)).ceil() as usize,
        };
        // One more on each side to take differences by.
        let margin = usize::from(points > 1);
        let wide = 2 * (core + margin) + 1;
        let mut means = vec![0.0; wide * wide];
        for field in fields {
            add_waves(field, grid, core + margin, points, &mut means);
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

/// Adds a field's light, as waves, to cells up to `half` from the middle: the mean over `points`
/// squared points of each.
fn add_waves(field: &PupilField, grid: &CellGrid, half: usize, points: usize, cells: &mut [f64]) {
    let side = 2 * half + 1;
    let count = side * points;
    let n = field.cells;
    let length = field.wavelength * 1e-6;
    let fine = grid.pitch / points as f64;
    // From the middle to a point, in the picture (mm).
    let place = |k: usize| ((k as f64 + 0.5) / points as f64 - 0.5 - half as f64) * grid.pitch;
    let pupil = |k: usize| (k as f64 - (n / 2) as f64) * field.step;
    let wave = |cosine: f64, at: f64| {
        Complex64::from_polar(1.0, -std::f64::consts::TAU * cosine * at / length)
    };
    // The sum over columns of cells first, for all columns of points, and then that over rows.
    let (right, down) = (grid.turn, -grid.turn);
    let by_column: Vec<Complex64> =
        (0..n).flat_map(|i| (0..count).map(move |c| wave(pupil(i), right * place(c)))).collect();
    let mut rows: Vec<(usize, Vec<Complex64>)> = Vec::new();
    for j in 0..n {
        let lit: Vec<usize> = (0..n).filter(|i| field.amplitude[j * n + i] > 0.0).collect();
        if lit.is_empty() {
            continue;
        }
        let mut sums = vec![Complex64::ZERO; count];
        for i in lit {
            let angle = std::f64::consts::TAU * field.mean_waves(j * n + i);
            let amplitude = Complex64::from_polar(averaged(field, j * n + i), angle);
            let waves = &by_column[i * count..(i + 1) * count];
            sums.iter_mut().zip(waves).for_each(|(sum, wave)| *sum += amplitude * wave);
        }
        rows.push((j, sums));
    }
    let scale = norm(field) * fine * fine;
    let mut sums = vec![Complex64::ZERO; count];
    // What the sum over cells takes away at a distance: the transform of one cell.
    let through: Vec<f64> =
        (0..count).map(|k| sinc(place(k) * field.step / length).powi(2).max(1e-3)).collect();
    for r in 0..count {
        sums.fill(Complex64::ZERO);
        for (j, own) in &rows {
            let turn = wave(pupil(*j), down * place(r));
            sums.iter_mut().zip(own).for_each(|(sum, own)| *sum += turn * own);
        }
        let line = &mut cells[r / points * side..(r / points + 1) * side];
        for (c, sum) in sums.iter().enumerate() {
            line[c / points] += scale * sum.norm_sqr() / (through[r] * through[c]);
        }
    }
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
