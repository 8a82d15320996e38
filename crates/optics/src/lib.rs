#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]
//!
//! # Conventions
//!
//! Lengths are millimetres, z = 0 is the first element's vertex and +z runs from the object to the
//! sensor, as lens designers write it. A radius is positive when its centre lies at greater z than
//! its vertex. Wavelengths are nanometres.
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`analysis`] | lenses in waves: wavefronts, Zernike terms, point spread and transfer functions |
//! | [`element`] | surfaces, apertures, filters, thin lenses, and how rays pass them |
//! | [`glass`] | the catalogue and the formulas of dispersion |
//! | [`train`] | elements in a row: focus, pupils, paraxial and real-ray analysis, Zemax files, drawings |
//! | [`zernike`] | Zernike polynomials, Fringe and Noll |
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests set their stage by hand"))]

pub mod analysis;
pub mod element;
pub mod glass;
pub mod train;
pub mod zernike;

/// Text of an error in one sentence, as notes have it: its remedy stands behind a semicolon.
fn sentence(error: &dyn std::error::Error) -> String {
    let refusal = etendue_report::Refusal::of(error);
    match refusal.remedy() {
        Some(remedy) => format!("{}; {remedy}", refusal.why()),
        None => refusal.why().to_owned(),
    }
}
