//! Zernike polynomials on a unit circle.
//!
//! Z = R(ρ) cos mθ for m ≥ 0 and R(ρ) sin |m|θ for m < 0, θ from x to y, with
//! R = Σ (−1)ˢ (n − s)! / (s! ((n + m)/2 − s)! ((n − m)/2 − s)!) ρⁿ⁻²ˢ.
//!
//! # Sources
//!
//! Order and norm of Noll's: R. J. Noll, *J. Opt. Soc. Am.* 66, 207 (1976), Eqs. (1) to (4): root mean
//! square 1 over the circle. The Fringe set: J. C. Wyant and K. Creath, *Applied Optics and Optical
//! Engineering* XI, 28, Table III (1992): 37 terms of greatest value 1, the last of which is ρ¹².

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The numbering and norm of Zernike terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ZernikeOrder {
    /// 37 terms of greatest value 1.
    #[default]
    Fringe,
    /// Terms of root mean square 1.
    Noll,
}

/// Degree n and azimuthal order m of a term; m < 0 for sines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ZernikeTerm {
    /// Degree.
    pub n: u32,
    /// Azimuthal order.
    pub m: i32,
}

/// The terms of the Fringe set.
pub const FRINGE_TERMS: usize = 37;

impl ZernikeOrder {
    /// The first `count` terms of the order; of the Fringe set at most 37.
    #[must_use]
    pub fn terms(self, count: usize) -> Vec<ZernikeTerm> {
        let mut terms = Vec::with_capacity(count);
        match self {
            Self::Fringe => {
                // Groups of equal n + |m| = 2g: from |m| = g to 0, cosine before sine.
                for group in 0_u32..6 {
                    for m in (0..=group).rev() {
                        let n = 2 * group - m;
                        let order = i32::try_from(m).unwrap_or(0);
                        terms.push(ZernikeTerm { n, m: order });
                        if m > 0 {
                            terms.push(ZernikeTerm { n, m: -order });
                        }
                    }
                }
                terms.push(ZernikeTerm { n: 12, m: 0 });
            }
            Self::Noll => {
                let mut n = 0_u32;
                while terms.len() < count {
                    for m in (n % 2..=n).step_by(2) {
                        let order = i32::try_from(m).unwrap_or(0);
                        // Even numbers are cosines.
                        let even = (terms.len() + 1).is_multiple_of(2);
                        match (m, even) {
                            (0, _) => terms.push(ZernikeTerm { n, m: 0 }),
                            (_, true) => {
                                terms.extend([order, -order].map(|m| ZernikeTerm { n, m }));
                            }
                            (_, false) => {
                                terms.extend([-order, order].map(|m| ZernikeTerm { n, m }));
                            }
                        }
                    }
                    n += 1;
                }
            }
        }
        terms.truncate(count);
        terms
    }

    /// Factor of a term's coefficient in this norm.
    #[must_use]
    pub fn scale(self, term: ZernikeTerm) -> f64 {
        match self {
            Self::Fringe => 1.0,
            Self::Noll if term.m == 0 => f64::from(term.n + 1).sqrt(),
            Self::Noll => f64::from(2 * (term.n + 1)).sqrt(),
        }
    }
}

impl ZernikeTerm {
    /// Its value at a place of the unit circle, greatest 1.
    #[must_use]
    pub fn value(self, place: DVec2) -> f64 {
        Basis::new(&[self], ZernikeOrder::Fringe).at(place)[0]
    }

    /// R(ρ) over ρ to the azimuthal order, as coefficients of powers of ρ², the highest first; sums of them are exact
    /// to a few roundings up to n = 12, which is the most of the Fringe set.
    pub(crate) fn radial(self) -> Vec<f64> {
        let (n, m) = (self.n, self.m.unsigned_abs());
        let factorial = |k: u32| (1..=k).map(f64::from).product::<f64>();
        let coefficient = |s: u32| {
            let sign = if s.is_multiple_of(2) { 1.0 } else { -1.0 };
            let below = factorial(s) * factorial((n + m) / 2 - s) * factorial((n - m) / 2 - s);
            sign * factorial(n - s) / below
        };
        (0..=(n - m) / 2).map(coefficient).collect()
    }

    /// The term's name.
    #[must_use]
    pub fn name(self) -> String {
        let order = self.m.unsigned_abs();
        let rank = (self.n - order) / 2;
        let axis =
            |cosine: &'static str, sine: &'static str| if self.m < 0 { sine } else { cosine };
        let (kind, first) = match order {
            0 => match rank {
                0 => return "piston".to_owned(),
                1 => return "defocus".to_owned(),
                _ => ("spherical".to_owned(), 2),
            },
            1 if rank == 0 => return format!("tilt {}", axis("x", "y")),
            1 => (format!("coma {}", axis("x", "y")), 1),
            2 => (format!("astigmatism {}", axis("0\u{b0}", "45\u{b0}")), 0),
            3 => (format!("trefoil {}", axis("x", "y")), 0),
            4 => (format!("tetrafoil {}", axis("x", "y")), 0),
            5 => (format!("pentafoil {}", axis("x", "y")), 0),
            _ => (format!("{order}-foil {}", axis("x", "y")), 0),
        };
        let above = ["", "secondary ", "tertiary ", "quaternary ", "quinary ", "senary "];
        let rank = usize::try_from(rank - first).unwrap_or(0);
        match above.get(rank) {
            Some(word) => format!("{word}{kind}"),
            None => format!("{kind} of degree {}", self.n),
        }
    }
}

/// Terms that are evaluated together at many places.
pub(crate) struct Basis {
    /// Of each: azimuthal order, whether it is a sine, scale, and what [`ZernikeTerm::radial`] has.
    terms: Vec<(usize, bool, f64, Vec<f64>)>,
}

impl Basis {
    pub(crate) fn new(terms: &[ZernikeTerm], order: ZernikeOrder) -> Self {
        let of = |term: &ZernikeTerm| {
            (term.m.unsigned_abs() as usize, term.m < 0, order.scale(*term), term.radial())
        };
        Self { terms: terms.iter().map(of).collect() }
    }

    /// The terms at a place of the unit circle: ρᵐ cos mθ and ρᵐ sin mθ are the parts of (x + iy)ᵐ.
    pub(crate) fn at(&self, place: DVec2) -> Vec<f64> {
        let square = place.length_squared();
        let most = self.terms.iter().map(|term| term.0).max().unwrap_or(0);
        let mut powers = vec![DVec2::X; most + 1];
        for m in 1..=most {
            powers[m] = powers[m - 1].rotate(place);
        }
        let value = |(m, is_sine, scale, radial): &(usize, bool, f64, Vec<f64>)| {
            let along = radial.iter().fold(0.0, |sum, coefficient| sum * square + coefficient);
            scale * along * if *is_sine { powers[*m].y } else { powers[*m].x }
        };
        self.terms.iter().map(value).collect()
    }
}
