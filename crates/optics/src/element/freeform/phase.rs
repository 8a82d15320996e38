//! Phases that a surface adds to light: gratings, kinoforms, phase masks.
//!
//! Along the surface the wave vector gains the gradient of the phase: n' d' = n d + (m λ/2π) ∇φ in its tangent plane
//! (W. T. Welford, "A vector raytracing equation for hologram lenses of arbitrary shape", *Opt. Commun.* 14, 322
//! (1975)); on a flat grating of period d that is n' sin θ' = n sin θ + m λ/d. Orders that do not exist at a
//! wavelength are evanescent: their light goes nowhere and is counted as totally reflected.
//!
//! A kinoform that is blazed for λ₀ gives order m the share sinc²(λ₀/λ − m) of the light (G. J. Swanson, *Binary Optics
//! Technology*, MIT Lincoln Laboratory report 854, 1989, Eq. (24), without the glass' dispersion).

use etendue_geometry::units::{Millimetres, Nanometres};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::grid::HeightGrid;
use super::terms::{pairs, polynomial};
use crate::element::Resolve;
use crate::element::aperture::Picture;
use crate::element::real::Real;

/// A phase as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhaseSpec {
    /// Its pattern.
    pub pattern: PatternSpec,
    /// The order of diffraction; 1 when absent. Not that of a mask with a `design_wavelength`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order: Option<i32>,
    /// The wavelength (nm) for which a kinoform is blazed: orders then have the shares of light that follow. All light
    /// is in the order when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blaze_wavelength: Option<Nanometres>,
    /// The wavelength (nm) at which a relief without steps, as a cubic phase mask, has its phase; at others the path
    /// that it adds is the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub design_wavelength: Option<Nanometres>,
}

/// The pattern of a phase.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum PatternSpec {
    /// Straight lines: φ = 2π y/period, turned.
    Grating {
        /// From line to line (mm).
        period: Millimetres,
        /// The direction across the lines, from +y towards −x (degrees).
        #[serde(default)]
        rotation: f64,
    },
    /// Rings: φ = Σ aᵢ (r/R)²ⁱ, a₁ first (Zemax' Binary 2).
    Radial {
        /// R (mm).
        radius: Millimetres,
        /// a₁, a₂, … (rad).
        coefficients: Vec<f64>,
    },
    /// φ = Σ c (x/R)ⁱ (y/R)ʲ.
    Polynomial {
        /// R (mm).
        radius: Millimetres,
        /// `[i, j, c]` (rad).
        coefficients: Vec<(u32, u32, f64)>,
    },
    /// φ by a grey picture.
    Image {
        /// A grey PNG or EXR; row 0 is at the top and column 0 on the left as seen from the sensor.
        file: String,
        /// The picture's width (mm).
        width: Millimetres,
        /// The picture's height (mm); by square pixels when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        height: Option<Millimetres>,
        /// The phase of white, where black is 0 (rad).
        depth: f64,
    },
}

/// A phase, ready to be asked.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PhaseProfile {
    pattern: Pattern,
    order: f64,
    pub(super) blaze: Option<f64>,
    design: Option<f64>,
}

#[derive(Debug, Clone, PartialEq)]
enum Pattern {
    /// The gradient (rad/mm).
    Grating([f64; 2]),
    Radial {
        scale: f64,
        coefficients: Vec<f64>,
    },
    Polynomial {
        scale: f64,
        terms: Vec<(u32, u32, f64)>,
    },
    Image(HeightGrid),
}

fn length(key: &str, value: f64) -> Result<f64, String> {
    let sound = value >= 1e-9 && value.is_finite();
    let why = || format!("phase.{key} is {value} mm; it must be a length from 1e-9 mm on");
    sound.then_some(value).ok_or_else(why)
}

impl PhaseSpec {
    /// The phase.
    ///
    /// # Errors
    ///
    /// A sentence on the number or file that describes none, or on a picture too coarse for its phase.
    pub(super) fn build(&self, resolve: Resolve<'_>) -> Result<PhaseProfile, String> {
        let wavelength = |key: &str, nm: Option<Nanometres>| match nm {
            Some(nm) if !(nm.0 > 0.0 && nm.0.is_finite()) => {
                Err(format!("phase.{key} is {} nm; it must be positive", nm.0))
            }
            nm => Ok(nm.map(|nm| nm.0)),
        };
        let design = wavelength("design_wavelength", self.design_wavelength)?;
        let blaze = wavelength("blaze_wavelength", self.blaze_wavelength)?;
        if design.is_some() && (self.order.is_some() || blaze.is_some()) {
            return Err(
                "a phase has a design_wavelength, or an order with its blaze_wavelength, not both"
                    .to_owned(),
            );
        }
        if self.order.is_some_and(|order| order.unsigned_abs() > 1000) {
            return Err("phase.order must be within -1000 to 1000".to_owned());
        }
        Ok(PhaseProfile {
            pattern: self.pattern.build(resolve)?,
            order: f64::from(self.order.unwrap_or(1)),
            blaze,
            design,
        })
    }
}

impl PatternSpec {
    fn build(&self, resolve: Resolve<'_>) -> Result<Pattern, String> {
        let finite = |coefficients: &[f64]| {
            let sound = coefficients.iter().all(|c| c.is_finite()) && coefficients.len() <= 100;
            let why = || "phase.coefficients must be finite, and 100 at most".to_owned();
            sound.then_some(()).ok_or_else(why)
        };
        Ok(match self {
            Self::Grating { period, rotation } => {
                let density = std::f64::consts::TAU / length("period", period.0)?;
                if !rotation.is_finite() {
                    return Err("phase.rotation must be finite".to_owned());
                }
                let (sine, cosine) = rotation.to_radians().sin_cos();
                Pattern::Grating([-density * sine, density * cosine])
            }
            Self::Radial { radius, coefficients } => {
                finite(coefficients)?;
                let scale = 1.0 / length("radius", radius.0)?;
                Pattern::Radial { scale, coefficients: coefficients.clone() }
            }
            Self::Polynomial { radius, coefficients } => {
                pairs(coefficients).map_err(|why| format!("phase: {why}"))?;
                let scale = 1.0 / length("radius", radius.0)?;
                Pattern::Polynomial { scale, terms: coefficients.clone() }
            }
            Self::Image { file, width, height, depth } => {
                if !depth.is_finite() {
                    return Err("phase.depth must be finite".to_owned());
                }
                let height = height.map(|height| height.0);
                let grid = HeightGrid::new(Picture::read(file, width.0, height, resolve)?, *depth);
                let step = grid.greatest_step();
                if step > std::f64::consts::PI {
                    return Err(format!(
                        "phase.file {file} changes by {step:.3} rad from a pixel to the next, and beyond pi it is not \
                         known which way: give a finer picture, or one that is not wrapped"
                    ));
                }
                Pattern::Image(grid)
            }
        })
    }
}

impl PhaseProfile {
    /// The phase (rad) in the first order.
    pub(super) fn at<T: Real>(&self, [x, y]: [T; 2]) -> T {
        match &self.pattern {
            Pattern::Grating([a, b]) => x.times(*a) + y.times(*b),
            Pattern::Radial { scale, coefficients } => {
                let square = (x * x + y * y).times(scale * scale);
                let sum = coefficients.iter().rev();
                sum.fold(T::constant(0.0), |sum, &c| (sum + T::constant(c)) * square)
            }
            Pattern::Polynomial { scale, terms } => {
                polynomial([x.times(*scale), y.times(*scale)], terms)
            }
            Pattern::Image(grid) => grid.at([x, y]),
        }
    }

    /// The path (mm) that a radian adds at a wavelength (nm).
    pub(super) fn path_per_radian(&self, wavelength: f64) -> f64 {
        let turn = match self.design {
            Some(design) => design,
            None => self.order * wavelength,
        };
        turn * 1e-6 / std::f64::consts::TAU
    }

    /// The share of light in its order at a wavelength (nm).
    pub(super) fn efficiency(&self, wavelength: f64) -> f64 {
        let Some(blaze) = self.blaze else { return 1.0 };
        let off = std::f64::consts::PI * (blaze / wavelength - self.order);
        if off.abs() < 1e-9 { 1.0 } else { (off.sin() / off).powi(2) }
    }

    /// True if rays of different wavelengths are deflected differently.
    pub(super) fn is_dispersive(&self) -> bool {
        self.design.is_none()
    }

    /// True if a turn about the axis changes nothing.
    pub(super) fn is_round(&self) -> bool {
        matches!(self.pattern, Pattern::Radial { .. })
    }

    pub(super) fn half_size(&self) -> [f64; 2] {
        match &self.pattern {
            Pattern::Image(grid) => grid.half_size(),
            Pattern::Grating(_) | Pattern::Radial { .. } | Pattern::Polynomial { .. } => {
                [f64::INFINITY; 2]
            }
        }
    }

    /// A word on it.
    pub(super) fn word(&self) -> String {
        let pattern = match &self.pattern {
            Pattern::Grating(_) => "grating",
            Pattern::Radial { .. } => "phase by rings",
            Pattern::Polynomial { .. } => "phase by a polynomial",
            Pattern::Image(_) => "phase by a picture",
        };
        match self.design {
            Some(design) => format!("{pattern} at {design} nm"),
            None => format!("{pattern}, order {}", self.order),
        }
    }
}
