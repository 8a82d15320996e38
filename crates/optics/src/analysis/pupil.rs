//! The field in the exit pupil, on a grid of square cells.
//!
//! Places are optical direction cosines n'α and n'β: of the way from a point of the reference sphere
//! to its centre. In them the pupil and the image are a Fourier pair without any paraxial step (H. H.
//! Hopkins, *Proc. Phys. Soc. B* 55, 116 (1943)), and an even grid stays even at any aperture.
//!
//! A cell at the pupil's edge counts by the share of it that is clear, so that sums over cells are
//! those over a pupil seen through one cell, and not those over a staircase.

use glam::{DVec2, DVec3};

/// The field of one point at one wavelength on the reference sphere.
#[derive(Debug, Clone, PartialEq)]
pub struct PupilField {
    /// The wavelength in vacuum (nm).
    pub wavelength: f64,
    /// Cells a side; arrays have `cells`² values, row by row, y upwards.
    pub cells: usize,
    /// A cell's side (optical direction cosines).
    pub step: f64,
    /// The middle of cell (`cells`/2, `cells`/2), that of the chief ray.
    pub middle: DVec2,
    /// The index of refraction before the image.
    pub index: f64,
    /// The chief ray's slopes dx/dz and dy/dz behind the lens.
    pub chief_slopes: DVec2,
    /// Transmission of each cell (0..=1).
    pub clear: Vec<f64>,
    /// From the middle of each cell to the middle of its clear part (optical direction cosines).
    pub lean: Vec<DVec2>,
    /// Amplitude: the root of what a cell's middle has of power, times the share that is clear.
    pub amplitude: Vec<f64>,
    /// Power of each cell.
    pub power: Vec<f64>,
    /// Lead of the wavefront over the sphere (waves), positive where its path is shorter.
    pub waves: Vec<f64>,
    /// Point where the ray of each cell meets the image plane, from the sphere's centre (mm).
    pub landing: Vec<DVec2>,
    /// Its slopes dx/dz and dy/dz.
    pub slopes: Vec<DVec2>,
}

/// Cells that stay dark beside the pupil on each side.
pub(crate) const RIM: f64 = 1.5;

impl PupilField {
    /// A pupil without light.
    #[must_use]
    pub fn dark(wavelength: f64, cells: usize, step: f64, middle: DVec2, index: f64) -> Self {
        let zeros = || vec![0.0; cells * cells];
        let places = || vec![DVec2::ZERO; cells * cells];
        Self {
            wavelength,
            cells,
            step,
            middle,
            index,
            chief_slopes: DVec2::ZERO,
            clear: zeros(),
            lean: places(),
            amplitude: zeros(),
            power: zeros(),
            waves: zeros(),
            landing: places(),
            slopes: places(),
        }
    }

    /// A pupil that is a function of places in a circle of radius 1, which stands for
    /// `numerical_aperture`: what passes (0 or 1), and waves. Even power, in air.
    #[must_use]
    pub fn from_fn(
        cells: usize,
        numerical_aperture: f64,
        wavelength: f64,
        passes: impl Fn(DVec2) -> bool,
        waves: impl Fn(DVec2) -> f64,
    ) -> Self {
        /// Places across a cell at the pupil's edge.
        const FINE: u32 = 16;
        let step = numerical_aperture / (0.5 * cells as f64 - RIM);
        let mut pupil = Self::dark(wavelength, cells, step, DVec2::ZERO, 1.0);
        for i in 0..cells * cells {
            let place = pupil.place(i) / numerical_aperture;
            let fine = step / numerical_aperture / f64::from(FINE);
            let offset = |k: u32| (f64::from(k) + 0.5 - 0.5 * f64::from(FINE)) * fine;
            let offsets = (0..FINE * FINE).map(|k| DVec2::new(offset(k % FINE), offset(k / FINE)));
            let lit: Vec<DVec2> = offsets.filter(|&offset| passes(place + offset)).collect();
            let clear = lit.len() as f64 / f64::from(FINE * FINE);
            if clear > 0.0 {
                pupil.lean[i] = lit.iter().sum::<DVec2>() / lit.len() as f64 * numerical_aperture;
            }
            (pupil.clear[i], pupil.amplitude[i], pupil.power[i]) = (clear, clear, clear);
            pupil.waves[i] = waves(place);
            let h = 1e-5;
            let slope = |d: DVec2| (waves(place + d * h) - waves(place - d * h)) / (2.0 * h);
            let gradient = DVec2::new(slope(DVec2::X), slope(DVec2::Y));
            pupil.landing[i] = gradient / numerical_aperture * wavelength * 1e-6;
            let p = pupil.place(i);
            pupil.slopes[i] = p / (1.0 - p.length_squared()).max(1e-12).sqrt();
        }
        pupil
    }

    /// The middle of a cell (optical direction cosines).
    #[must_use]
    pub fn place(&self, i: usize) -> DVec2 {
        let half = (self.cells / 2) as f64;
        let cell = DVec2::new((i % self.cells) as f64 - half, (i / self.cells) as f64 - half);
        self.middle + cell * self.step
    }

    /// The cells that pass light.
    pub fn lit(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.clear.len()).filter(|&i| self.clear[i] > 0.0)
    }

    /// The waves in the middle of a cell's clear part.
    pub(super) fn mean_waves(&self, i: usize) -> f64 {
        // ∂W/∂p is where the ray lands.
        self.waves[i] + self.landing[i].dot(self.lean[i]) / (self.wavelength * 1e-6)
    }

    /// All power.
    #[must_use]
    pub fn total_power(&self) -> f64 {
        self.power.iter().sum()
    }

    /// The circle about the chief ray that the lit cells just fit in: middle and radius.
    #[must_use]
    pub fn circle(&self) -> (DVec2, f64) {
        // An edge cell ends half of its clear width beyond the middle of its clear part: by a straight
        // edge at any angle to a few hundredths of a cell, if it is not a mere corner.
        const CORNER: f64 = 0.3;
        let reach = |i: usize| {
            let clear = self.clear[i].min(1.0);
            (self.place(i) + self.lean[i] - self.middle).length() + 0.5 * clear * self.step
        };
        let whole = self.lit().filter(|&i| self.clear[i] >= CORNER);
        (self.middle, whole.map(reach).fold(self.step, f64::max))
    }

    /// Mean and root mean square of the waves over the lit cells, and their range: (mean, rms about
    /// the mean, least, greatest).
    #[must_use]
    pub fn statistics(&self) -> WaveStatistics {
        let (mut weight, mut sum) = (0.0, 0.0);
        let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in self.lit() {
            weight += self.clear[i];
            sum += self.clear[i] * self.waves[i];
            if self.clear[i] >= 0.5 {
                least = least.min(self.waves[i]);
                greatest = greatest.max(self.waves[i]);
            }
        }
        let mean = sum / weight;
        let square: f64 = self.lit().map(|i| self.clear[i] * (self.waves[i] - mean).powi(2)).sum();
        let peak_to_valley = (greatest - least).max(0.0);
        WaveStatistics { mean, rms: (square / weight).sqrt(), peak_to_valley }
    }

    /// The greatest change of the wavefront from one lit cell to the next (waves).
    #[must_use]
    pub fn steepest(&self) -> f64 {
        let n = self.cells;
        let mut steepest = 0.0_f64;
        for i in self.lit().filter(|&i| self.clear[i] > 0.5) {
            for next in [(i % n + 1 < n).then_some(i + 1), (i + n < n * n).then_some(i + n)] {
                if let Some(next) = next.filter(|&next| self.clear[next] > 0.5) {
                    steepest = steepest.max((self.waves[next] - self.waves[i]).abs());
                }
            }
        }
        steepest
    }

    /// Cells a side of this pupil that would keep the wavefront's steps within `limit` waves.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "below 1e9")]
    pub fn needed_cells(&self, limit: f64) -> usize {
        let rim = 2.0 * RIM;
        let needed = (self.cells as f64 - rim) * self.steepest() / limit + rim;
        if needed < 1e9 { (needed.ceil() as usize).next_multiple_of(2) } else { usize::MAX }
    }

    /// Direction cosines of a place in three dimensions.
    fn direction(&self, place: DVec2) -> DVec3 {
        let rest = self.index * self.index - place.length_squared();
        place.extend(rest.max(0.0).sqrt())
    }

    /// The field about a centre that is moved by `shift` (mm): W − n' s·shift, with the waves of the
    /// chief ray kept.
    #[must_use]
    pub fn moved(mut self, shift: DVec3) -> Self {
        let waves = 1.0 / (self.wavelength * 1e-6);
        let chief = self.direction(self.middle);
        for i in 0..self.waves.len() {
            let direction = self.direction(self.place(i)) - chief;
            self.waves[i] -= direction.dot(shift) * waves;
            self.landing[i] += self.slopes[i] * shift.z - shift.truncate();
        }
        self
    }

    /// The field on the image plane `defocus` (mm) farther behind the lens, about the chief ray's
    /// point there.
    #[must_use]
    pub fn at_focus(&self, defocus: f64) -> Self {
        self.clone().moved((self.chief_slopes * defocus).extend(defocus))
    }
}

/// A wavefront's statistics over the lit pupil (waves).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WaveStatistics {
    /// Mean.
    pub mean: f64,
    /// Root mean square about the mean.
    pub rms: f64,
    /// From the least to the greatest, of cells that are at least half clear.
    pub peak_to_valley: f64,
}
