//! Wavelengths that the rays of all bands are traced at, and polynomials between them.

use etendue_optics::analysis::least_squares::LeastSquares;
use etendue_optics::train::OpticalTrain;
use glam::{DVec2, DVec3};

/// The most wavelengths that a ray is traced at.
pub(super) const MOST_NODES: usize = 8;

/// Limits within which the rays of bands are interpolated between those of some wavelengths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharingLimits {
    /// The greatest distance of an interpolated place from the traced one (pixels).
    pub places: f64,
    /// The greatest difference of what the lens passes (share of the light), where it takes some.
    pub shares: f64,
}

impl SharingLimits {
    /// Those of a scene that does not say.
    pub const DEFAULT: Self = Self { places: 0.01, shares: 1e-4 };
}

/// A wavelength between nodes.
#[derive(Debug, Clone, Copy)]
pub(super) struct NodeWeights {
    /// Weight of each node.
    pub(super) weights: [f64; MOST_NODES],
    /// Weight of the [`NextTerm`].
    pub(super) next: f64,
    /// Transmission of the filters.
    pub(super) filters: f64,
}

/// Variable in which places are polynomials.
pub(super) struct Variable<'a> {
    train: &'a OpticalTrain,
}

impl<'a> Variable<'a> {
    pub(super) fn of(train: &'a OpticalTrain) -> Self {
        Self { train }
    }

    /// The mean index of the dispersive media at a wavelength (nm); by the wavelength itself where there are
    /// none.
    fn at(&self, nm: f64) -> f64 {
        let media = self.train.media().iter();
        let indices = media.filter(|glass| glass.is_dispersive());
        let indices: Vec<f64> = indices.filter_map(|glass| glass.index(nm).ok()).collect();
        match indices.len() {
            0 => 1e-3 * nm,
            count => indices.iter().sum::<f64>() / count as f64,
        }
    }

    /// `count` nodes among ascending wavelengths and between them: those of Chebyshev with both ends.
    pub(super) fn nodes(&self, wavelengths: &[f64], count: usize) -> Vec<f64> {
        let last = wavelengths.len() - 1;
        let (from, to) = (wavelengths[0], wavelengths[last]);
        if count > last {
            return wavelengths.to_vec();
        }
        if count == 1 {
            return vec![wavelengths[last / 2]];
        }
        let fine = |k: u32| from + (to - from) * f64::from(k) / 256.0;
        let ends = [self.at(from), self.at(to)];
        let node = |k: usize| {
            let cosine = (std::f64::consts::PI * k as f64 / (count - 1) as f64).cos();
            let wanted = 0.5 * (ends[0] + ends[1]) + 0.5 * cosine * (ends[0] - ends[1]);
            let off = |nm: &f64| (self.at(*nm) - wanted).abs();
            let inner = (1..256).map(fine).min_by(|a, b| off(a).total_cmp(&off(b)));
            match k {
                0 => from,
                _ if k == count - 1 => to,
                _ => inner.unwrap_or(from),
            }
        };
        (0..count).map(node).collect()
    }

    /// The wavelength (nm) between the nodes at which the product of the distances from all of them is greatest: there
    /// [`Self::next_weight`] is 1.
    pub(super) fn farthest(&self, nodes: &[f64]) -> f64 {
        let (from, to) = (nodes[0], nodes[nodes.len() - 1]);
        let fine = (1..256).map(|k| from + (to - from) * f64::from(k) / 256.0);
        let off = |nm: &f64| self.off(nodes, *nm).abs();
        fine.max_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(from)
    }

    /// The product of the distances from all nodes.
    fn off(&self, nodes: &[f64], nm: f64) -> f64 {
        nodes.iter().map(|&node| self.at(nm) - self.at(node)).product()
    }

    /// Weight of the [`NextTerm`] at a wavelength (nm), whose greatest between the nodes is 1.
    pub(super) fn next_weight(&self, nodes: &[f64], nm: f64) -> f64 {
        let greatest = self.off(nodes, self.farthest(nodes));
        if greatest == 0.0 { 0.0 } else { self.off(nodes, nm) / greatest }
    }

    /// Weight of each node at a wavelength (nm): Lagrange's polynomials.
    pub(super) fn weights(&self, nodes: &[f64], nm: f64) -> [f64; MOST_NODES] {
        let x = self.at(nm);
        let at: Vec<f64> = nodes.iter().map(|&node| self.at(node)).collect();
        let mut weights = [0.0; MOST_NODES];
        for (j, weight) in weights.iter_mut().enumerate().take(nodes.len()) {
            let others = (0..nodes.len()).filter(|&k| k != j);
            *weight = others.map(|k| (x - at[k]) / (at[j] - at[k])).product();
        }
        weights
    }
}

/// The next term of Newton's polynomial through the nodes, for which a ray would have to be traced once more: by how much
/// places are off in between (pixels), as a straight line in where a ray lands and where it leaves the lens. That is
/// what secondary spectra are in the third order: longitudinal as the pupil's point, lateral as the field's.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct NextTerm {
    /// Of columns and rows.
    factors: [[f64; TERMS]; 2],
}

const TERMS: usize = 5;

/// A ray that is off in between the nodes.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayOff {
    /// Landing point (pixels).
    pub(super) place: DVec2,
    /// Point where it leaves the lens (mm).
    pub(super) point: DVec3,
    /// By how much it is off (pixels).
    pub(super) off: DVec2,
}

impl NextTerm {
    /// By least squares of `rays`; zero where these do not tell it.
    pub(super) fn fitted(rays: impl Iterator<Item = RayOff>) -> Self {
        let mut fits = [LeastSquares::new(TERMS), LeastSquares::new(TERMS)];
        for RayOff { place, point, off } in rays {
            let row = terms(place.into(), point);
            fits[0].add(&row, off.x, 1.0);
            fits[1].add(&row, off.y, 1.0);
        }
        let factors = fits.map(|fit| fit.solve().and_then(|found| found.try_into().ok()));
        match factors {
            [Some(columns), Some(rows)] => Self { factors: [columns, rows] },
            _ => Self::default(),
        }
    }

    /// That of a ray (pixels).
    #[inline(always)]
    pub(super) fn at(&self, place: [f64; 2], point: DVec3) -> [f64; 2] {
        let terms = terms(place, point);
        let sum = |factors: &[f64; TERMS]| {
            let [a, b, c, d, e] = *factors;
            a * terms[0] + b * terms[1] + c * terms[2] + d * terms[3] + e * terms[4]
        };
        [sum(&self.factors[0]), sum(&self.factors[1])]
    }
}

#[inline(always)]
fn terms([column, row]: [f64; 2], point: DVec3) -> [f64; TERMS] {
    [1.0, column, row, point.x, point.y]
}
