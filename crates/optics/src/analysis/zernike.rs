//! Fits of Zernike polynomials to a wavefront.

use glam::DVec2;
use schemars::JsonSchema;
use serde::Serialize;

use super::AnalysisError;
use super::least_squares::LeastSquares;
use super::pupil::PupilField;
use crate::zernike::{Basis, ZernikeOrder};

/// A coefficient of a fit.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ZernikeCoefficient {
    /// Its number in the order, from 1.
    pub index: usize,
    /// Degree.
    pub n: u32,
    /// Azimuthal order; negative for sines.
    pub m: i32,
    /// Its name.
    pub name: String,
    /// Waves.
    pub waves: f64,
}

/// A wavefront as a sum of Zernike terms.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ZernikeFit {
    /// Numbering and norm.
    pub order: ZernikeOrder,
    /// Middle of the unit circle in optical direction cosines.
    pub centre: [f64; 2],
    /// Radius of the unit circle in optical direction cosines: the lit pupil just fits in.
    pub radius: f64,
    /// The terms.
    pub coefficients: Vec<ZernikeCoefficient>,
    /// Root mean square of what the terms leave (waves).
    pub residual: f64,
}

impl ZernikeFit {
    /// Fits `count` terms to the lit cells of a pupil, each weighted by how much of it is lit.
    ///
    /// # Errors
    ///
    /// When the pupil does not tell the terms apart.
    pub fn new(
        pupil: &PupilField,
        order: ZernikeOrder,
        count: usize,
    ) -> Result<Self, AnalysisError> {
        let terms = order.terms(count);
        let (centre, radius) = pupil.circle();
        let all = Basis::new(&terms, order);
        let basis = |place: DVec2| all.at((place - centre) / radius);
        let mut fit = LeastSquares::new(terms.len());
        let lit: Vec<usize> = pupil.lit().collect();
        for &i in &lit {
            fit.add(&basis(pupil.place(i)), pupil.waves[i], pupil.clear[i]);
        }
        let singular = AnalysisError::Singular { terms: terms.len(), rays: lit.len() };
        let values = fit.solve().ok_or(singular)?;
        let (mut sum, mut weight) = (0.0, 0.0);
        for &i in &lit {
            let model: f64 =
                basis(pupil.place(i)).iter().zip(&values).map(|(z, value)| z * value).sum();
            sum += pupil.clear[i] * (pupil.waves[i] - model).powi(2);
            weight += pupil.clear[i];
        }
        let coefficients = terms.iter().zip(values).enumerate().map(|(i, (term, waves))| {
            let (n, m) = (term.n, term.m);
            ZernikeCoefficient { index: i + 1, n, m, name: term.name(), waves }
        });
        Ok(Self {
            order,
            centre: centre.into(),
            radius,
            coefficients: coefficients.collect(),
            residual: (sum / weight).sqrt(),
        })
    }
}
