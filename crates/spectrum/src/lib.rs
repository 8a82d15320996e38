#![forbid(unsafe_code)]
//! Light as a function of wavelength: curves, bands, illuminants, and the way from RGB to spectra
//! and back.
//!
//! # Conventions
//!
//! * Wavelengths are nanometres in air, photopic light lies in 380..=780.
//! * A curve says where it is known. What lies outside is not guessed: the caller chooses whether
//!   it is nothing, or held at the curve's end.
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`curve`] | a function of wavelength, given by samples |
//! | [`grid`] | consecutive bands of wavelengths |

pub mod curve;
pub mod grid;

pub use curve::{Curve, CurveError};
pub use grid::{Band, Grid, GridError};
