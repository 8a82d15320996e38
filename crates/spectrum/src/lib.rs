#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]
//!
//! # Conventions
//!
//! * Wavelengths are nanometres.
//! * A curve says where it is known. What lies outside is not guessed: the caller chooses whether
//!   it is nothing, or held at the curve's end.
//! * RGB is linear sRGB. Its white, (1, 1, 1), is the flat spectrum, for lights and surfaces alike:
//!   radiance 1 in every wavelength is radiance 1 in every band of every sensor.
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`curve`] | a function of wavelength, given by samples |
//! | [`input`] | curves as scene files write them |
//! | [`table`] | measured curves in files |
//! | [`grid`] | consecutive bands of wavelengths |
//! | [`illuminant`] | lights by name, and Planck's law |
//! | [`colour`] | the CIE 1931 observer and sRGB |
//! | [`colorchecker`] | the 24 patches that cameras are calibrated by |
//! | [`summary`] | what a curve is to the eye, as a colour and as photons |
//! | [`metal`] | metals by name
//! | [`rgb`] | from a colour to a spectrum and back |
//! | [`bands`] | the numbers that a ray of a render carries |
//! | [`weighted`] | bands for a given light and sensor |
//! | [`spread`] | wavelengths that stand for a wide band |

pub mod bands;
mod cie;
mod cie_fine;
pub mod colorchecker;
pub mod colour;
pub mod curve;
pub mod grid;
pub mod illuminant;
pub mod input;
mod lamps;
pub mod metal;
pub mod rgb;
pub mod spread;
pub mod summary;
pub mod table;
pub mod weighted;

pub use bands::{Bands, NoOverlap, VISIBLE};
pub use curve::{Curve, CurveError, Outside, integral};
pub use grid::{Band, Grid, GridError};
pub use illuminant::{Illuminant, IlluminantError};
pub use input::{CurveFault, CurveSpec};
pub use metal::Metal;
pub use spread::Spread;
pub use summary::Summary;
pub use weighted::WeightedBands;

/// Planck's constant (J·s), exact in the SI.
pub const PLANCK: f64 = 6.626_070_15e-34;

/// The speed of light in vacuum (m/s), exact in the SI.
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// Boltzmann's constant (J/K), exact in the SI.
pub const BOLTZMANN: f64 = 1.380_649e-23;
