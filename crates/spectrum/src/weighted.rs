//! Bands for a given light and a given sensor: wide, and yet they count its photons.
//!
//! A band of a plain band is a mean over its wavelengths, each counting alike, and stands for an
//! even spectrum. Both are wrong for a tungsten lamp before silicon, the more so the wider the band.
//! Here the mean is weighted by what the sensor makes of each wavelength, a reflectance's also by
//! the light that falls on it, and a band stands for a piece of that light. One light on a white
//! surface is then counted exactly however few the bands; how many there must be is decided by the
//! colours alone.

use crate::curve::{integral, known_everywhere, mean};
use crate::{Curve, Grid, Outside};

/// Consecutive bands whose means are weighted by a sensor and a light.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedBands {
    grid: Grid,
    sensitivity: Curve,
    light: Curve,
}

impl WeightedBands {
    /// The bands of `grid` for a sensor of this `sensitivity` to energy (to any factor, 0 outside of
    /// its range) under a `light` of this spectrum (likewise).
    #[must_use]
    pub fn new(grid: Grid, sensitivity: Curve, light: Curve) -> Self {
        Self { grid, sensitivity, light }
    }

    /// The bands.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The mean of `curve` over band `i`: of an emission weighted by the sensor, of a reflectance or
    /// transmission by the sensor and the light. Where the weights are all 0, the plain mean.
    pub(crate) fn mean(&self, i: usize, curve: &Curve, outside: Outside) -> f64 {
        let [from, to] = self.edges(i);
        let weights: &[&Curve] = match outside {
            Outside::Zero => &[&self.sensitivity],
            Outside::Held => &[&self.sensitivity, &self.light],
        };
        let total = integral(weights, from, to);
        if total <= 0.0 {
            return mean(curve, from, to, outside);
        }
        let known = known_everywhere(curve, from, to, outside);
        integral(&[&[&known], weights].concat(), from, to) / total
    }

    /// The spectrum that 1 in band `i` stands for: the light's own within the band.
    pub(crate) fn shape(&self, i: usize) -> Curve {
        let [from, to] = self.edges(i);
        let even = || Curve::trusted(vec![[from, 1.0], [to, 1.0]]);
        let seen = self.mean(i, &self.light, Outside::Zero);
        let [low, high] = self.light.range();
        let [low, high] = [low.max(from), high.min(to)];
        if self.light.as_flat().is_some() || seen <= 0.0 || low >= high {
            return even();
        }
        let inside = self.light.samples().iter().map(|s| s[0]).filter(|nm| *nm > low && *nm < high);
        let knots = std::iter::once(low).chain(inside).chain(std::iter::once(high));
        Curve::trusted(knots.map(|nm| [nm, self.light.held(nm) / seen]).collect())
    }

    /// Weight of a wavelength (nm) in the light that a sensor sees, to a factor.
    pub(crate) fn weight(&self, nm: f64) -> f64 {
        self.sensitivity.at(nm).unwrap_or(0.0) * self.light.at(nm).unwrap_or(0.0)
    }

    /// The wavelength that stands for band `i` (nm): the centroid of what the sensor sees of the
    /// light, or the middle where it sees nothing.
    pub(crate) fn centroid(&self, i: usize) -> f64 {
        let [from, to] = self.edges(i);
        let nm = Curve::trusted(vec![[from, from], [to, to]]);
        let weights = [&self.sensitivity, &self.light];
        let total = integral(&weights, from, to);
        match total > 0.0 {
            true => integral(&[&nm, weights[0], weights[1]], from, to) / total,
            false => 0.5 * (from + to),
        }
    }

    fn edges(&self, i: usize) -> [f64; 2] {
        [self.grid.edges()[i], self.grid.edges()[i + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Bands, Illuminant};

    #[test]
    fn one_band_counts_a_lamp_exactly() {
        let lamp = Illuminant::A.curve().unwrap();
        let silicon = Curve::sampled(vec![[400.0, 100.0], [550.0, 500.0], [900.0, 90.0]]).unwrap();
        let grid = Grid::from_edges(vec![400.0, 900.0]).unwrap();
        let bands = Bands::Weighted(WeightedBands::new(grid, silicon.clone(), lamp.clone()).into());
        let exact = integral(&[&lamp, &silicon], 400.0, 900.0);
        let light = bands.from_curve(&lamp, Outside::Zero).unwrap()[0];
        let counted = light * integral(&[&bands.shape(0), &silicon], 400.0, 900.0);
        // Two ways to add up the same polygons.
        assert!((counted / exact - 1.0).abs() < 1e-12, "{counted} {exact}");
        let red = &crate::rgb::PRIMARIES[0];
        let held = known_everywhere(red, 400.0, 900.0, Outside::Held);
        let through = bands.from_curve(red, Outside::Held).unwrap()[0];
        let expected = integral(&[&held, &lamp, &silicon], 400.0, 900.0) / exact;
        assert!((through - expected).abs() < 1e-12, "{through} {expected}");
        // White is 1 whatever the weights.
        let white: f64 = bands.from_rgb()[0].iter().sum();
        assert!((white - 1.0).abs() < 1e-14);
    }
}
