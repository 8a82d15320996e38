//! The formulas that give a refractive index from a wavelength.
//!
//! # Sources
//!
//! W. Sellmeier, *Annalen der Physik* 219 (1871); A.-L. Cauchy, *Sur la réfraction et la réflexion
//! de la lumière* (1830); the power series is the one glass makers publish; M. Herzberger, *Optica
//! Acta* 6 (1959); P. N. Robb and R. I. Mercado, "Calculation of refractive indices using Buchdahl's
//! chromatic coordinate", *Applied Optics* 22 (1983).

// Two decimals, as lens data is written: a lens analysed at "587.56 nm" here and elsewhere is the same
// lens to the last digit, and `nd` is its index there.

/// Hydrogen's F line (nm).
pub const FRAUNHOFER_F: f64 = 486.13;
/// Helium's d line (nm), at which `nd` is measured.
pub const FRAUNHOFER_D: f64 = 587.56;
/// Hydrogen's C line (nm).
pub const FRAUNHOFER_C: f64 = 656.27;

/// The wavelength (µm) at which Buchdahl's coordinate is 0 in Robb and Mercado's tables.
const BUCHDAHL_ZERO: f64 = 0.574;

/// A dispersion formula; wavelengths inside it are in micrometres.
#[derive(Debug, Clone, PartialEq)]
pub enum Dispersion {
    /// Constant index at all wavelengths.
    Constant(f64),
    /// `[b, c]`: n² = 1 + Σ b λ²/(λ² − c).
    Sellmeier(Vec<[f64; 2]>),
    /// `[a, p]`: n² = Σ a λᵖ.
    Power(Vec<[f64; 2]>),
    /// `[a, p]`: n = Σ a λᵖ.
    Index(Vec<[f64; 2]>),
    /// n² = Σ a λᵖ + Σ b λ^q/(λ² − c).
    Poles {
        /// `[a, p]`.
        powers: Vec<[f64; 2]>,
        /// `[b, q, c]`.
        poles: Vec<[f64; 3]>,
    },
    /// n = A + B L + C L² + D λ² + E λ⁴ + F λ⁶ with L = 1/(λ² − 0.028).
    Herzberger([f64; 6]),
    /// `[a, p]`: n = Σ a ωᵖ with Buchdahl's chromatic coordinate ω = δ/(1 + 2.5 δ), δ = λ − 0.574.
    Buchdahl(Vec<[f64; 2]>),
}

impl Dispersion {
    /// n = A + B/λ² + C/λ⁴ + …
    #[must_use]
    pub fn cauchy(coefficients: &[f64]) -> Self {
        let powers = (0..).map(|i: i32| -2.0 * f64::from(i));
        Self::Index(coefficients.iter().zip(powers).map(|(&a, p)| [a, p]).collect())
    }

    /// The two-term Cauchy formula through `nd` at the d line whose difference between the F and C
    /// lines is (nd − 1)/vd.
    #[must_use]
    pub fn from_abbe(nd: f64, vd: f64) -> Self {
        let inverse_square = |nm: f64| (nm * 1e-3).powi(-2);
        let b = (nd - 1.0) / vd / (inverse_square(FRAUNHOFER_F) - inverse_square(FRAUNHOFER_C));
        Self::Index(vec![[nd - b * inverse_square(FRAUNHOFER_D), 0.0], [b, -2.0]])
    }

    /// The index at `wavelength` (nm); `None` when the formula gives no positive finite number.
    #[must_use]
    pub fn index(&self, wavelength: f64) -> Option<f64> {
        let l = wavelength * 1e-3;
        let series = |terms: &[[f64; 2]]| terms.iter().map(|&[a, p]| a * power(l, p)).sum::<f64>();
        let n = match self {
            Self::Constant(n) => *n,
            Self::Sellmeier(terms) => {
                let l2 = l * l;
                (1.0 + terms.iter().map(|&[b, c]| b * l2 / (l2 - c)).sum::<f64>()).sqrt()
            }
            Self::Power(terms) => series(terms).sqrt(),
            Self::Index(terms) => series(terms),
            Self::Poles { powers, poles } => {
                let pole = |&[b, q, c]: &[f64; 3]| b * power(l, q) / (l * l - c);
                (series(powers) + poles.iter().map(pole).sum::<f64>()).sqrt()
            }
            Self::Herzberger([a, b, c, d, e, f]) => {
                let l2 = l * l;
                let h = 1.0 / (l2 - 0.028);
                a + b * h + c * h * h + l2 * (d + l2 * (e + l2 * f))
            }
            Self::Buchdahl(terms) => {
                let delta = l - BUCHDAHL_ZERO;
                let omega = delta / (1.0 + 2.5 * delta);
                terms.iter().map(|&[a, p]| a * power(omega, p)).sum()
            }
        };
        (n > 0.0 && n.is_finite() && wavelength > 0.0).then_some(n)
    }

    /// True if the index depends on the wavelength.
    #[must_use]
    pub fn varies(&self) -> bool {
        match self {
            Self::Constant(_) => false,
            Self::Sellmeier(terms) => terms.iter().any(|&[b, c]| b != 0.0 && c != 0.0),
            Self::Power(terms) | Self::Index(terms) | Self::Buchdahl(terms) => {
                terms.iter().any(|&[a, p]| a != 0.0 && p != 0.0)
            }
            Self::Poles { powers, poles } => {
                let varies = |&[b, q, c]: &[f64; 3]| b != 0.0 && (q != 2.0 || c != 0.0);
                powers.iter().any(|&[a, p]| a != 0.0 && p != 0.0) || poles.iter().any(varies)
            }
            Self::Herzberger(terms) => terms[1..].iter().any(|&term| term != 0.0),
        }
    }
}

/// λᵖ; the published powers are whole, and multiplications round less than a logarithm.
fn power(l: f64, p: f64) -> f64 {
    #[expect(clippy::cast_possible_truncation, reason = "checked to be whole and small")]
    if p.fract() == 0.0 && p.abs() < 1e3 { l.powi(p as i32) } else { l.powf(p) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_abbe_form_meets_its_numbers_and_falls_with_wavelength() {
        let glass = Dispersion::from_abbe(1.62, 36.37);
        let at = |nm| glass.index(nm).unwrap();
        let vd = (at(FRAUNHOFER_D) - 1.0) / (at(FRAUNHOFER_F) - at(FRAUNHOFER_C));
        assert!((vd - 36.37).abs() < 1e-10, "two roundings in a difference of 0.017");
        assert!(at(450.0) > at(550.0) && at(550.0) > at(700.0));
        assert!(glass.varies() && !Dispersion::Constant(1.5).varies());
    }
}
