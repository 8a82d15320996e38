#![forbid(unsafe_code)]
//! Lens design: optical elements, glasses and the trains that they make, traced and analysed. The
//! library knows no scene, no camera and no pixels.
//!
//! ```
//! use etendue_optics::train::LensFile;
//!
//! let file: LensFile = serde_json::from_str(
//!     r#"{ "elements": [
//!         { "type": "surface", "radius": 100, "thickness": 4, "glass": "N-BK7", "semi_diameter": 10 },
//!         { "type": "surface", "radius": -100, "semi_diameter": 10 } ] }"#,
//! )?;
//! assert_eq!(file.elements.len(), 2);
//! # Ok::<(), serde_json::Error>(())
//! ```
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
//! | [`element`] | surfaces, apertures, filters, thin lenses, and how rays pass them |
//! | [`glass`] | the catalogue and the formulas of dispersion |
//! | [`train`] | elements in a row: focus, pupils, paraxial and real-ray analysis, Zemax files, drawings |

pub mod element;
pub mod glass;
pub mod train;
