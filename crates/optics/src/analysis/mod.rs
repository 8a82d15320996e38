//! Lenses in waves: what an optical bench measures.
//!
//! | module | idea |
//! |---|---|
//! | [`object`] | points of the object, their chief rays, and rays over the pupil |
//! | [`pupil`] | the field in the exit pupil on a grid of cells: amplitude, power and waves |
//! | [`aim`](mod@aim) | rays to the middles of those cells, and how much of each cell is clear |
//! | `smooth` | the same of smooth wavefronts, by a polynomial through few rays |
//! | [`wavefront`] | optical path differences against a reference sphere, and their statistics |
//! | [`colours`] | one point at several wavelengths |
//! | `sampling` | how many cells a wavefront needs |
//! | [`zernike`] | fits of Zernike polynomials to a wavefront |
//! | [`least_squares`] | a small linear fit |
//! | [`spread`] | point spread functions by FFT and by Huygens' sum, encircled energy, lines |
//! | [`between`] | fields at a few depths and wavelengths, and those between them |
//! | [`cells`] | point spread functions as shares of light on square cells, such as pixels |
//! | [`fans`] | transverse and longitudinal aberrations along two lines of the pupil |
//! | [`astigmatism`] | sagittal and tangential foci by Coddington's equations |
//! | [`seidel`](mod@seidel) | Seidel's and the chromatic sums by surface |
//! | [`conjugate`] | where the object is: by distance, magnification, numerical aperture |
//! | [`report`] | all of it in one piece; its tables, figures and page |
//! | [`transfer`] | modulation transfer, by diffraction and by rays |

pub mod aim;
pub mod astigmatism;
pub mod between;
pub mod cells;
pub mod colours;
pub mod conjugate;
pub mod fans;
pub mod least_squares;
pub mod object;
pub mod pupil;
pub mod report;
mod sampling;
pub mod seidel;
mod smooth;
pub mod spread;
pub mod transfer;
pub mod wavefront;
pub mod zernike;

use etendue_report::Refusal;

use crate::glass::GlassError;
use crate::train::FocusError;

pub use between::FieldsBetween;
pub use cells::{CellGrid, CellSpread};
pub use object::ObjectPoint;
pub use pupil::PupilField;
pub use spread::PointSpread;
pub use transfer::Transfer;
pub use wavefront::{ReferenceSphere, Wavefront};
pub use zernike::ZernikeFit;

/// Error of a lens that cannot be analysed in waves.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AnalysisError {
    /// A glass without index.
    #[error(transparent)]
    Glass(#[from] GlassError),
    /// No place for the sensor.
    #[error(transparent)]
    Focus(#[from] FocusError),
    /// No chief ray.
    #[error(
        "no ray of the object point at {field} passes the middle of the stop: the field is beyond \
         the image circle"
    )]
    NoChiefRay {
        /// The object point, in words.
        field: String,
    },
    /// No light.
    #[error(
        "no light of the object point at {field} passes the lens: the field is beyond the image circle\n\
         hint: give a smaller one"
    )]
    Dark {
        /// The object point, in words.
        field: String,
    },
    /// A grid too coarse for the wavefront.
    #[error(
        "{cells} x {cells} cells over the pupil are too few: the wavefront changes by {steepest:.2} \
         waves from one cell to the next, and half a wave is the most; it needs {needed} cells a side{}",
        if *needed > MOST_CELLS {
            format!(", and {MOST_CELLS} are the most\nhint: {CALMER}")
        } else {
            String::new()
        }
    )]
    Coarse {
        /// Cells a side.
        cells: usize,
        /// The greatest change from cell to cell (waves).
        steepest: f64,
        /// Cells a side that would do.
        needed: usize,
    },
    /// More cells than there may be.
    #[error(
        "the wavefront needs {needed} x {needed} cells over the pupil, and {MOST_CELLS} a side are \
         the most: it is {waves:.0} waves from its sphere\nhint: {CALMER}"
    )]
    TooRough {
        /// Cells a side that would do.
        needed: usize,
        /// Peak to valley (waves).
        waves: f64,
    },
    /// Too many terms for the pupil.
    #[error("{terms} Zernike terms cannot be told apart on the {rays} lit cells of the pupil")]
    Singular {
        /// Terms.
        terms: usize,
        /// Lit cells.
        rays: usize,
    },
    /// Any other: what the lens, its object, its weights or its cells do not allow.
    #[error(transparent)]
    Refused(#[from] Refusal),
}

/// Remedy of a wavefront that bends too much.
const CALMER: &str = "refocus, stop down or take a smaller field";

impl AnalysisError {
    /// A lens without an end to its light.
    fn unlimited() -> Self {
        let remedy = "give the stop a radius, or a surface a semi_diameter";
        Refusal::new("nothing limits the beam").hint(remedy).into()
    }

    /// An image in a plane at `z` (mm), which the exit pupil lies in.
    fn no_sphere(z: f64) -> Self {
        let why = format!(
            "the reference sphere has no radius: the exit pupil lies in the plane of the image (z = {z} mm)"
        );
        Refusal::new(why).hint("move the sensor").into()
    }

    /// A number of cells a side that is out of range.
    fn out_of_range(cells: usize) -> Self {
        let remedy = format!("take from {LEAST_CELLS} to {MOST_CELLS}");
        Refusal::new(format!("{cells} cells over the pupil")).hint(remedy).into()
    }

    /// No such object, by the option or key that asks for it.
    fn object(key: &str, why: &str) -> Self {
        Refusal::new(why).at(key).into()
    }

    /// True if the error is one of this field alone, so that others can do without it: no light
    /// arrives, or too rough.
    fn is_of_the_field(&self) -> bool {
        matches!(self, Self::Dark { .. } | Self::NoChiefRay { .. } | Self::TooRough { .. })
    }
}

/// The least number of cells over the pupil.
pub const LEAST_CELLS: usize = 16;

/// The greatest number of cells over the pupil.
pub const MOST_CELLS: usize = 1024;

/// The least length from `least` on that a transform is quick for: of no prime factors but 2, 3 and 5.
#[must_use]
pub fn quick_length(least: usize) -> usize {
    let is_quick = |mut length: usize| {
        for factor in [2, 3, 5] {
            while length.is_multiple_of(factor) {
                length /= factor;
            }
        }
        length == 1
    };
    (least.max(1)..).find(|&length| is_quick(length)).unwrap_or(least)
}
