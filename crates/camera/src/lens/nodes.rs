//! Wavelengths that the rays of all bands are traced at, and polynomials between them.

use etendue_optics::train::OpticalTrain;

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
    /// What each node counts.
    pub(super) weights: [f64; MOST_NODES],
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
