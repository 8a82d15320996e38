//! Terms added to a base surface: polynomials in x and y, of Zernike's, Chebyshev's and Forbes'
//! kinds, and height maps.
//!
//! # Sources
//!
//! Zernike's as in [`crate::zernike`]. Q polynomials: G. W. Forbes, "Shape specification for axially symmetric
//! optical surfaces", *Opt. Express* 15, 5218 (2007), Eqs. (2.2) and (3.6), and "Robust, efficient computational methods
//! for axially symmetric optical aspheres", *Opt. Express* 18, 19700 (2010), Eqs. (A.13) to (A.16).

use std::collections::BTreeMap;

use etendue_geometry::units::Millimetres;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::grid::{HeightGrid, HeightMapSpec};
use crate::element::Resolve;
use crate::element::real::{Real, power};
use crate::zernike::{FRINGE_TERMS, ZernikeOrder};

/// The most of any list of coefficients.
const MOST_TERMS: usize = 400;

/// The highest power or degree.
const HIGHEST: u32 = 40;

/// Term that is added to the sag of a base (mm), as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum SagSpec {
    /// Zernike's polynomials on a circle.
    Zernike {
        /// The radius of the circle (mm).
        radius: Millimetres,
        /// Their numbering and norm.
        #[serde(default)]
        order: ZernikeOrder,
        /// Coefficients (mm) by their number from 1, `{"4": 1e-3}`.
        coefficients: BTreeMap<String, f64>,
    },
    /// Σ c Tᵢ(x/a) Tⱼ(y/b), Chebyshev's polynomials of the first kind.
    Chebyshev {
        /// a and b (mm).
        half_size: [Millimetres; 2],
        /// `[i, j, c]` (mm).
        coefficients: Vec<(u32, u32, f64)>,
    },
    /// Σ c (x/R)ⁱ (y/R)ʲ.
    Polynomial {
        /// R (mm); 1 when absent.
        #[serde(default = "one")]
        radius: Millimetres,
        /// `[i, j, c]` (mm).
        coefficients: Vec<(u32, u32, f64)>,
    },
    /// Forbes' mild aspheres: u² (1 − u²)/√(1 − c² R² u²) Σ aₘ Qₘ(u²), u = r/R.
    QBfs {
        /// R (mm).
        radius: Millimetres,
        /// a₀, a₁, … (mm).
        coefficients: Vec<f64>,
    },
    /// Forbes' strong aspheres: u⁴ Σ aₘ Qₘ(u²), Qₘ(v) Jacobi's P of (0, 4) at 2v − 1.
    QCon {
        /// R (mm).
        radius: Millimetres,
        /// a₀, a₁, … (mm).
        coefficients: Vec<f64>,
    },
    /// Heights by a grey picture.
    HeightMap(HeightMapSpec),
}

fn one() -> Millimetres {
    Millimetres(1.0)
}

/// Term added to a base surface, ready for evaluation.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Term {
    /// Azimuthal order (sines below 0), and the radial polynomial over ρ to it in powers of ρ², the highest first.
    Zernike {
        scale: f64,
        terms: Vec<(i32, Vec<f64>)>,
    },
    /// Rows of coefficients by i, in them by j.
    Chebyshev {
        scale: [f64; 2],
        rows: Vec<Vec<f64>>,
    },
    Polynomial {
        scale: f64,
        terms: Vec<(u32, u32, f64)>,
    },
    QBfs {
        scale: f64,
        curvature: f64,
        coefficients: Vec<f64>,
    },
    QCon {
        scale: f64,
        coefficients: Vec<f64>,
    },
    Grid(HeightGrid),
}

fn positive(key: &str, length: Millimetres) -> Result<f64, String> {
    let sound = length.0 >= 1e-9 && length.0.is_finite();
    sound
        .then_some(1.0 / length.0)
        .ok_or_else(|| format!("{key} is {} mm; it must be a length from 1e-9 mm on", length.0))
}

fn sound(coefficients: impl IntoIterator<Item = f64>) -> Result<(), String> {
    let mut count = 0;
    for coefficient in coefficients {
        count += 1;
        if !coefficient.is_finite() {
            return Err("coefficients must be finite".to_owned());
        }
    }
    match count {
        0..=MOST_TERMS => Ok(()),
        _ => Err(format!("{count} coefficients; {MOST_TERMS} are the most")),
    }
}

pub(super) fn pairs(coefficients: &[(u32, u32, f64)]) -> Result<(), String> {
    sound(coefficients.iter().map(|term| term.2))?;
    match coefficients.iter().find(|term| term.0 > HIGHEST || term.1 > HIGHEST) {
        Some((i, j, _)) => Err(format!("the powers {i} and {j} are beyond {HIGHEST}")),
        None => Ok(()),
    }
}

impl SagSpec {
    /// Over a base of `curvature` (1/mm).
    pub(super) fn build(&self, curvature: f64, resolve: Resolve<'_>) -> Result<Term, String> {
        Ok(match self {
            Self::Zernike { radius, order, coefficients } => {
                sound(coefficients.values().copied())?;
                let scale = positive("radius", *radius)?;
                Term::Zernike { scale, terms: zernike(*order, coefficients)? }
            }
            Self::Chebyshev { half_size: [a, b], coefficients } => {
                pairs(coefficients)?;
                let scale = [positive("half_size", *a)?, positive("half_size", *b)?];
                let mut rows: Vec<Vec<f64>> = Vec::new();
                for &(i, j, c) in coefficients {
                    let (i, j) = (i as usize, j as usize);
                    rows.resize(rows.len().max(i + 1), Vec::new());
                    let row = &mut rows[i];
                    row.resize(row.len().max(j + 1), 0.0);
                    row[j] += c;
                }
                Term::Chebyshev { scale, rows }
            }
            Self::Polynomial { radius, coefficients } => {
                pairs(coefficients)?;
                let scale = positive("radius", *radius)?;
                Term::Polynomial { scale, terms: coefficients.clone() }
            }
            Self::QBfs { radius, coefficients } => {
                sound(coefficients.iter().copied())?;
                let scale = positive("radius", *radius)?;
                if curvature.abs() >= scale {
                    return Err(format!(
                        "radius is {} mm, beyond which a sphere of curvature {curvature} has no surface",
                        radius.0
                    ));
                }
                Term::QBfs { scale, curvature, coefficients: coefficients.clone() }
            }
            Self::QCon { radius, coefficients } => {
                sound(coefficients.iter().copied())?;
                let scale = positive("radius", *radius)?;
                Term::QCon { scale, coefficients: coefficients.clone() }
            }
            Self::HeightMap(spec) => Term::Grid(spec.build(resolve)?),
        })
    }
}

fn zernike(
    order: ZernikeOrder,
    coefficients: &BTreeMap<String, f64>,
) -> Result<Vec<(i32, Vec<f64>)>, String> {
    let most = match order {
        ZernikeOrder::Fringe => FRINGE_TERMS,
        ZernikeOrder::Noll => 231,
    };
    let table = order.terms(most);
    coefficients
        .iter()
        .map(|(key, &value)| {
            let number = key.parse::<usize>().ok().filter(|number| (1..=most).contains(number));
            let Some(number) = number else {
                return Err(format!(
                    "coefficients has the number \"{key}\"; terms count from 1 to {most}"
                ));
            };
            let term = table[number - 1];
            let factor = value * order.scale(term);
            Ok((term.m, term.radial().into_iter().map(|c| c * factor).collect()))
        })
        .collect()
}

impl Term {
    /// True if a turn about the axis changes nothing.
    pub(super) fn is_round(&self) -> bool {
        match self {
            Self::QBfs { .. } | Self::QCon { .. } => true,
            Self::Zernike { terms, .. } => terms.iter().all(|(m, _)| *m == 0),
            Self::Chebyshev { .. } | Self::Polynomial { .. } | Self::Grid(_) => false,
        }
    }

    /// A word on it.
    pub(super) fn word(&self) -> &'static str {
        match self {
            Self::Zernike { .. } => "Zernike terms",
            Self::Chebyshev { .. } => "Chebyshev terms",
            Self::Polynomial { .. } => "polynomial in x and y",
            Self::QBfs { .. } => "Q polynomials (Qbfs)",
            Self::QCon { .. } => "Q polynomials (Qcon)",
            Self::Grid(_) => "height map",
        }
    }

    /// The half size of the rectangle outside of which it is not known (mm).
    pub(super) fn half_size(&self) -> [f64; 2] {
        match self {
            Self::Grid(grid) => grid.half_size(),
            _ => [f64::INFINITY; 2],
        }
    }

    /// Its height (mm).
    pub(super) fn at<T: Real>(&self, [x, y]: [T; 2]) -> T {
        let zero = T::constant(0.0);
        match self {
            Self::Zernike { scale, terms } => {
                let (x, y) = (x.times(*scale), y.times(*scale));
                let square = x * x + y * y;
                terms.iter().fold(zero, |sum, (m, radial)| {
                    let radial = radial.iter().fold(zero, |value, &c| (value * square).plus(c));
                    // (x + iy)ᵐ.
                    let (mut cosine, mut sine) = (T::constant(1.0), zero);
                    for _ in 0..m.unsigned_abs() {
                        (cosine, sine) = (cosine * x - sine * y, cosine * y + sine * x);
                    }
                    sum + radial * if *m < 0 { sine } else { cosine }
                })
            }
            Self::Chebyshev { scale: [a, b], rows } => {
                let along_x = chebyshev(x.times(*a), rows.len());
                let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
                let along_y = chebyshev(y.times(*b), columns);
                rows.iter().zip(along_x).fold(zero, |sum, (row, tx)| {
                    let inner = row.iter().zip(&along_y);
                    sum + tx * inner.fold(zero, |sum, (&c, &ty)| sum + ty.times(c))
                })
            }
            Self::Polynomial { scale, terms } => {
                polynomial([x.times(*scale), y.times(*scale)], terms)
            }
            Self::QBfs { scale, curvature, coefficients } => {
                let square = (x * x + y * y).times(scale * scale);
                let bend = curvature / scale;
                let below = (T::constant(1.0) - square.times(bend * bend)).at_least(1e-12).root();
                square * (T::constant(1.0) - square) * q_bfs(coefficients, square) / below
            }
            Self::QCon { scale, coefficients } => {
                let square = (x * x + y * y).times(scale * scale);
                square * square * q_con(coefficients, square)
            }
            Self::Grid(grid) => grid.at([x, y]),
        }
    }
}

/// Σ c xⁱ yʲ.
pub(super) fn polynomial<T: Real>([x, y]: [T; 2], terms: &[(u32, u32, f64)]) -> T {
    terms
        .iter()
        .fold(T::constant(0.0), |sum, &(i, j, c)| sum + (power(x, i) * power(y, j)).times(c))
}

/// T₀ to T of `count` − 1: Tₙ₊₁ = 2x Tₙ − Tₙ₋₁.
fn chebyshev<T: Real>(x: T, count: usize) -> Vec<T> {
    let mut values = Vec::with_capacity(count.max(2));
    values.extend([T::constant(1.0), x]);
    while values.len() < count {
        let n = values.len();
        values.push(x.times(2.0) * values[n - 1] - values[n - 2]);
    }
    values.truncate(count);
    values
}

/// Σ aₘ Qₘ by the recurrence from the P of Eq. (A.13), with f, g and h of Eqs. (A.14) to (A.16).
fn q_bfs<T: Real>(coefficients: &[f64], v: T) -> T {
    let (mut p, mut p_next) = (T::constant(2.0), T::constant(6.0) - v.times(8.0));
    let (mut f, mut f_before) = (2.0_f64, 0.0_f64);
    let (mut q, mut q_before) = (T::constant(1.0), T::constant(0.0));
    let mut g = -0.5_f64;
    let mut sum = T::constant(0.0);
    for (m, &a) in coefficients.iter().enumerate() {
        if m > 0 {
            let m = f64::from(u32::try_from(m).unwrap_or(u32::MAX));
            // h of m − 2, g of m − 1, f of m.
            let h = if m > 1.0 { -m * (m - 1.0) / (2.0 * f_before) } else { 0.0 };
            if m > 1.0 {
                g = -(1.0 + g * h) / f;
            }
            let next_f = if m > 1.0 {
                (m * (m + 1.0) + 3.0 - g * g - h * h).sqrt()
            } else {
                0.5 * 19.0_f64.sqrt()
            };
            let next = (p_next - q.times(g) - q_before.times(h)).times(1.0 / next_f);
            (q_before, q) = (q, next);
            (f_before, f) = (f, next_f);
            let after = (T::constant(2.0) - v.times(4.0)) * p_next - p;
            (p, p_next) = (p_next, after);
        }
        sum = sum + q.times(a);
    }
    sum
}

/// Σ aₘ Pₘ of (0, 4) at 2v − 1 by Jacobi's recurrence (*NIST Handbook of Mathematical Functions*, 18.9.1 and 18.9.2).
fn q_con<T: Real>(coefficients: &[f64], v: T) -> T {
    const BETA: f64 = 4.0;
    let x = v.times(2.0).plus(-1.0);
    let (mut before, mut here) = (T::constant(0.0), T::constant(1.0));
    let mut sum = T::constant(0.0);
    for (m, &a) in coefficients.iter().enumerate() {
        if m > 0 {
            let n = f64::from(u32::try_from(m - 1).unwrap_or(u32::MAX));
            let twice = 2.0 * n + BETA;
            let next = if m == 1 {
                x.times(0.5 * (BETA + 2.0)).plus(-0.5 * BETA)
            } else {
                let below = 2.0 * (n + 1.0) * (n + 1.0 + BETA);
                let slope = (twice + 1.0) * (twice + 2.0) / below;
                let shift = -BETA * BETA * (twice + 1.0) / (below * twice);
                let last = 2.0 * n * (n + BETA) * (twice + 2.0) / (below * twice);
                x.times(slope).plus(shift) * here - before.times(last)
            };
            (before, here) = (here, next);
        }
        sum = sum + here.times(a);
    }
    sum
}
