//! A medium whose index changes from place to place: a gradient-index (GRIN) rod or lens.
//!
//! The index is n(r, z), with r the distance from the lens' axis and z the distance from the vertex of the surface
//! where the medium begins, along the axis as the file counts it (mm). On the axis at z = 0 it is that of the glass,
//! which makes the dispersion; the coefficients are those of all wavelengths.
//!
//! [`path`] follows rays through it, and [`step`] takes them from the surface before it to that behind it.
//!
//! # Near the axis
//!
//! With y the height and ν = n u the reduced slope, y' = ν/n(0, z) and ν' = y ∂²n/∂y²: the matrix of a gap is that of a
//! gap of glass with cosines for ones where the index does not change along the axis (A. Gerrard and J. M. Burch,
//! *Introduction to Matrix Methods in Optics*, 1975, III.5), and integrated by the rule of Runge and Kutta otherwise.

pub(crate) mod medium;
pub(crate) mod path;
mod step;

use std::sync::Arc;

use etendue_geometry::units::Millimetres;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::element::Abcd;

/// Phase of a ray's swing per step of the numerical integration (radians). The rule's own error is
/// the fourth power of it over 120 of the phase: 10⁻¹⁰ of it. Not a setting: steps are laid when a lens is read, before
/// anything of a scene is known.
const PHASE_STEP: f64 = 0.01;

/// Steps that a gap is divided into at least.
const LEAST_STEPS: f64 = 100.0;

/// Steps along the gap itself that an integration may take.
const MOST_STEPS: f64 = 1e5;

/// The greatest index that a gradient may have: no medium of light has more, and what is far beyond it would be
/// followed in steps without number.
const MOST_INDEX: f64 = 10.0;

/// Places in each direction at which the index is looked at.
const LOOKS: u32 = 64;

/// A gradient as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum GradientSpec {
    /// A parabolic rod (SELFOC): n² = n₀² (1 − g² r²), n₀ the glass'. Rays are followed in closed form.
    Rod {
        /// g (1/mm): a ray repeats itself after a pitch of 2π/g.
        g: f64,
        /// Rays that get farther from the axis inside of it are stopped (mm); as far as the surface before it when
        /// absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        semi_diameter: Option<Millimetres>,
    },
    /// n = n₀ + a₂ r² + a₄ r⁴ + … + b₁ z + b₂ z² + …, as Zemax' Gradient 3 and 5 have it.
    Index(GradientTerms),
    /// n² = n₀² + a₂ r² + a₄ r⁴ + … + b₁ z + b₂ z² + …, as Zemax' Gradient 2 has it.
    SquaredIndex(GradientTerms),
}

/// The terms of a gradient.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GradientTerms {
    /// a₂, a₄, a₆, …: of r², r⁴, r⁶, … (mm⁻², mm⁻⁴, …).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub radial: Vec<f64>,
    /// b₁, b₂, b₃, …: of z, z², z³, … (mm⁻¹, mm⁻², …).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub axial: Vec<f64>,
    /// Rays that get farther from the axis inside of it are stopped (mm); as far as the surface before it when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub semi_diameter: Option<Millimetres>,
    /// A ray is followed in steps about this long (mm); by the gradient itself when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<Millimetres>,
}

/// A gradient in its own frame (mm): the vertex where it begins at the origin, the lens' axis along z.
#[derive(Debug, Clone, PartialEq)]
pub struct Gradient {
    law: Law,
    /// Rays farther from the axis are stopped (mm).
    pub(crate) semi_diameter: f64,
    /// The length of a step (mm).
    pub(crate) step: f64,
}

/// Law of the index in space.
#[derive(Debug, Clone, PartialEq)]
enum Law {
    /// n₀² (1 − g² r²).
    Rod { g: f64 },
    /// n or n² as a sum.
    Sum { squared: bool, radial: Vec<f64>, axial: Vec<f64> },
}

/// A gradient in the gap behind an element.
#[derive(Debug, Clone, PartialEq)]
pub struct GradedGap {
    /// Gradient of the index.
    pub(crate) gradient: Arc<Gradient>,
    /// z in the gradient at the element's vertex (mm).
    pub(crate) offset: f64,
    /// −1 where light runs against the axis.
    pub(crate) sense: f64,
}

/// The index and what bends rays at a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct IndexField {
    /// n².
    pub(crate) square: f64,
    /// (∂n²/∂x)/(2x) = (∂n²/∂y)/(2y) (mm⁻²).
    pub(crate) across: f64,
    /// (∂n²/∂z)/2 (1/mm).
    pub(crate) along: f64,
}

impl GradientSpec {
    /// The gradient behind a surface of the half clear diameter `rim` (mm), whose glass has the index `base` at the design
    /// wavelength, over a gap of `thickness` (mm, as the file counts it).
    ///
    /// # Errors
    ///
    /// A sentence on what makes none.
    pub(crate) fn build(&self, rim: f64, base: f64, thickness: f64) -> Result<Gradient, String> {
        let (law, semi_diameter, step) = match self {
            Self::Rod { g, semi_diameter } => {
                if !(*g > 0.0 && g.is_finite()) {
                    return Err(format!("gradient.g is {g}; it must be a positive number (1/mm)"));
                }
                (Law::Rod { g: *g }, semi_diameter, None)
            }
            Self::Index(terms) => (terms.law(false)?, &terms.semi_diameter, terms.step),
            Self::SquaredIndex(terms) => (terms.law(true)?, &terms.semi_diameter, terms.step),
        };
        let semi_diameter = semi_diameter.map_or(rim, |length| length.0);
        if !(semi_diameter > 0.0 && semi_diameter.is_finite()) {
            return Err(format!(
                "a gradient needs a rim, and has {semi_diameter} mm: write its semi_diameter, or that of the surface"
            ));
        }
        if thickness == 0.0 {
            return Err("a gradient needs a thickness behind its surface".to_owned());
        }
        let mut gradient = Gradient { law, semi_diameter, step: f64::INFINITY };
        gradient.check(base, thickness)?;
        let own = gradient.own_step(base, thickness);
        gradient.step = match step.map(|step| step.0) {
            None => own,
            Some(step) if step > 0.0 && step.is_finite() => step,
            Some(step) => {
                return Err(format!("gradient.step is {step} mm; it must be a positive length"));
            }
        };
        let steps = thickness.abs() / gradient.step;
        if steps > MOST_STEPS {
            let remedy = match step {
                Some(_) => "write a longer gradient.step",
                None => "lessen the thickness or the gradient",
            };
            return Err(format!(
                "a gradient over {thickness} mm takes more than {MOST_STEPS} steps of {:.3e} mm; {remedy}",
                gradient.step
            ));
        }
        Ok(gradient)
    }
}

impl GradientTerms {
    fn law(&self, squared: bool) -> Result<Law, String> {
        if self.radial.iter().chain(&self.axial).any(|term| !term.is_finite()) {
            return Err("gradient.radial and gradient.axial must be finite".to_owned());
        }
        Ok(Law::Sum { squared, radial: self.radial.clone(), axial: self.axial.clone() })
    }
}

impl Gradient {
    /// The index at a place (mm) where it is `base` on the axis at the start.
    #[inline]
    pub(crate) fn field(&self, base: f64, [x, y, z]: [f64; 3]) -> IndexField {
        let u = x * x + y * y;
        match &self.law {
            Law::Rod { g } => {
                let (n2, g2) = (base * base, g * g);
                IndexField { square: n2 * (1.0 - g2 * u), across: -n2 * g2, along: 0.0 }
            }
            Law::Sum { squared, radial, axial } => {
                let (across, by_u) = sum(radial, u);
                let (along, by_z) = sum(axial, z);
                match squared {
                    true => IndexField {
                        square: base * base + across + along,
                        across: by_u,
                        along: 0.5 * by_z,
                    },
                    false => {
                        let n = base + across + along;
                        // An index below 0 is none.
                        IndexField { square: n * n.abs(), across: 2.0 * n * by_u, along: n * by_z }
                    }
                }
            }
        }
    }

    /// Refuses an index that is not above 1 within the rim, or above [`MOST_INDEX`].
    fn check(&self, base: f64, thickness: f64) -> Result<(), String> {
        let places = (0..=LOOKS).flat_map(|i| (0..=LOOKS).map(move |k| [i, k]));
        let squares = places.map(|[i, k]| {
            let share = |at: u32| f64::from(at) / f64::from(LOOKS);
            let (r, z) = (self.semi_diameter * share(i), thickness * share(k));
            (self.field(base, [0.0, r, z]).square, r, z)
        });
        let is_index = |square: f64| square > 1.0 && square <= MOST_INDEX * MOST_INDEX;
        let wrong = squares.filter(|(square, ..)| !is_index(*square));
        let Some((square, r, z)) = wrong.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return Ok(());
        };
        let what = match square > 0.0 {
            true if square > 1.0 => format!("an index of {:.4e}", square.sqrt()),
            true => format!("an index of {:.4}", square.sqrt()),
            false => format!("a squared index of {square:.4}"),
        };
        Err(format!(
            "the gradient has {what} {r:.4} mm from the axis, {z:.4} mm behind its surface; it must exceed 1 within \
             the rim, and be at most {MOST_INDEX}: lessen its terms or its semi_diameter"
        ))
    }

    /// Steps that follow the fastest swing within the rim.
    fn own_step(&self, base: f64, thickness: f64) -> f64 {
        let of_gap = thickness.abs() / LEAST_STEPS;
        let swing = match &self.law {
            // In closed form: steps of a fifteenth of a pitch only find the surface and the rim.
            Law::Rod { g } => return (40.0 * PHASE_STEP / g).min(of_gap * 25.0),
            Law::Sum { .. } => (0..=LOOKS)
                .flat_map(|i| (0..=LOOKS).map(move |k| (i, k)))
                .map(|(i, k)| {
                    let r = self.semi_diameter * f64::from(i) / f64::from(LOOKS);
                    let z = thickness * f64::from(k) / f64::from(LOOKS);
                    let IndexField { square, across, .. } = self.field(base, [0.0, r, z]);
                    across.abs() / square
                })
                .fold(0.0, f64::max)
                .sqrt(),
        };
        (PHASE_STEP / swing).min(of_gap)
    }

    /// True if the index is the same all along the axis.
    fn is_even(&self) -> bool {
        match &self.law {
            Law::Rod { .. } => true,
            Law::Sum { axial, .. } => axial.iter().all(|b| *b == 0.0),
        }
    }
}

/// Σ cᵢ xⁱ from i = 1, and its derivative by x.
#[inline]
fn sum(terms: &[f64], x: f64) -> (f64, f64) {
    super::surface::polynomial(terms, x)
}

impl GradedGap {
    /// The index on the axis, `z` (mm along the way of light) behind the element's vertex.
    pub(crate) fn on_axis(&self, base: f64, z: f64) -> f64 {
        self.gradient.field(base, [0.0, 0.0, self.offset + self.sense * z]).square.max(0.0).sqrt()
    }

    /// Returns the gradient behind a sheet `gap` (mm) farther on.
    pub(crate) fn behind(&self, gap: f64) -> Self {
        Self { offset: self.offset + self.sense * gap, ..self.clone() }
    }

    /// The matrix of the gap of `length` (mm) behind the element.
    pub(crate) fn matrix(&self, base: f64, length: f64) -> Abcd {
        // The index on the axis, and what changes the reduced slope for height.
        let at = |z: f64| {
            let place = [0.0, 0.0, self.offset + self.sense * z];
            let IndexField { square, across, .. } = self.gradient.field(base, place);
            let n = square.max(f64::MIN_POSITIVE).sqrt();
            [n, across / n]
        };
        if self.gradient.is_even() {
            let [n, bend] = at(0.0);
            let k = (bend / n).abs().sqrt();
            let phase = k * length;
            return match bend {
                0.0 => Abcd::gap(length / n),
                bend if bend < 0.0 => {
                    let (sine, cosine) = phase.sin_cos();
                    Abcd { a: cosine, b: sine / (n * k), c: -n * k * sine, d: cosine }
                }
                _ => {
                    let (sine, cosine) = (phase.sinh(), phase.cosh());
                    Abcd { a: cosine, b: sine / (n * k), c: n * k * sine, d: cosine }
                }
            };
        }
        let steps = (length.abs() / self.gradient.step).ceil().clamp(200.0, MOST_STEPS);
        let h = length / steps;
        let ray = |start: [f64; 2]| {
            let change = |z: f64, [y, v]: [f64; 2]| {
                let [n, bend] = at(z);
                [v / n, bend * y]
            };
            let moved = |[y, v]: [f64; 2], [dy, dv]: [f64; 2], h: f64| [y + h * dy, v + h * dv];
            let (mut here, mut z) = (start, 0.0);
            let mut left = steps;
            while left > 0.5 {
                let k1 = change(z, here);
                let k2 = change(z + 0.5 * h, moved(here, k1, 0.5 * h));
                let k3 = change(z + 0.5 * h, moved(here, k2, 0.5 * h));
                let k4 = change(z + h, moved(here, k3, h));
                let mean = |i: usize| (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0;
                here = moved(here, [mean(0), mean(1)], h);
                z += h;
                left -= 1.0;
            }
            here
        };
        let ([a, c], [b, d]) = (ray([1.0, 0.0]), ray([0.0, 1.0]));
        Abcd { a, b, c, d }
    }
}
