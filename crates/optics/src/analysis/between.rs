//! Fields of one direction at a few depths and wavelengths, and those between them.
//!
//! The path difference of a cell of the pupil changes smoothly with the wavelength, and with the
//! nearness of the object, 1 over its distance, in which defocus is linear. So polynomials through
//! two or three of each have all between, as long as the cells are the same: the reference sphere
//! and the grid over it are those of the place where the light lands, whatever sends it.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::aim::{self, PupilGrid};
use super::object::Beam;
use super::pupil::PupilField;
use super::{AnalysisError, MOST_CELLS, ObjectPoint, ReferenceSphere, smooth};
use crate::train::{MonochromaticTrain, OpticalTrain};

/// Cells a side that a grid has in the least.
const USUAL: usize = 128;

/// The greatest distance from the chief ray at which rays land that are added up as waves, in
/// wavelengths times the f-number; beyond, diffraction changes nothing that a picture shows.
pub const FARTHEST_WAVES: f64 = 60.0;

/// Wavelengths times the f-number of the image that a grid has to hold beside where rays land.
const IMAGE_MARGIN: f64 = 42.0;

/// Greatest difference of a wavefront from the polynomial that stands for it (waves) where nothing else is said: a
/// picture's irradiance changes by a few thousandths of its peak per hundredth of a wave.
pub const WAVEFRONT_ERROR: f64 = 2e-3;

/// Fields at all of some wavelengths and nearnesses.
#[derive(Debug, Clone)]
pub struct FieldsBetween {
    /// Wavelengths (nm).
    wavelengths: Vec<f64>,
    /// Nearnesses (1/mm).
    nearness: Vec<f64>,
    /// Each wavelength's at all nearnesses.
    fields: Vec<PupilField>,
}

/// Inputs of pupil fields: the lens, the nearnesses of the object (1/mm), and the point of the
/// image that the fields are about.
#[derive(Clone, Copy)]
#[allow(missing_debug_implementations, reason = "holds a function")]
pub struct FieldSource<'a> {
    /// The lens.
    pub train: &'a OpticalTrain,
    /// The lens at each of the wavelengths.
    pub lenses: &'a [MonochromaticTrain],
    /// Nearnesses (1/mm), ascending.
    pub nearness: &'a [f64],
    /// The point of a nearness.
    pub object: &'a (dyn Fn(f64) -> ObjectPoint + Sync),
    /// The point of the image (mm) that the fields are about.
    pub image: DVec3,
    /// Greatest difference of a wavefront from the polynomial that stands for it (waves).
    pub error: f64,
}

impl FieldsBetween {
    /// Bytes of a field at one wavelength and nearness, on the usual grid.
    pub const FIELD_BYTES: usize = USUAL * USUAL * (4 * size_of::<f64>() + 3 * size_of::<DVec2>());

    /// Traces the fields. The grid has as many cells as their own image needs.
    ///
    /// # Errors
    ///
    /// When there is no light, no chief ray or no sphere, or the wavefront is too rough for the most
    /// cells.
    pub fn new(source: &FieldSource<'_>) -> Result<Self, AnalysisError> {
        let FieldSource { train, lenses, nearness, object, image, error } = *source;
        let all: Vec<_> =
            lenses.iter().flat_map(|lens| nearness.iter().map(move |&near| (lens, near))).collect();
        let part = |(lens, near)| {
            let beam = Beam::new(train, lens, object(near))?;
            let sphere = ReferenceSphere::about(train, lens, image)?;
            let outline = aim::outline(&beam, &sphere)?;
            Ok((beam, sphere, outline))
        };
        let parts: Vec<_> = all.into_par_iter().map(part).collect();
        // The first in order fails, however threads run.
        let parts = parts.into_iter().collect::<Result<Vec<_>, AnalysisError>>()?;
        // One grid over all of them.
        let middle = parts.get(parts.len() / 2).map_or(DVec2::ZERO, |part| part.2.middle);
        let reach =
            |outline: &aim::Outline| outline.half + (outline.middle - middle).abs().max_element();
        let half = parts.iter().map(|part| reach(&part.2)).fold(0.0, f64::max);
        let traced = |cells: usize| -> Result<Vec<PupilField>, AnalysisError> {
            let step = half / (0.5 * cells as f64 - super::pupil::RIM);
            let sampling = PupilGrid { cells, step, middle };
            let field = |(beam, sphere, outline): &(Beam<'_>, ReferenceSphere, aim::Outline)| {
                smooth::field(beam, sphere, outline, sampling, error)
                    .map_or_else(|| aim::field(beam, sphere, outline, sampling), Ok)
            };
            let fields: Vec<_> = parts.par_iter().map(field).collect();
            fields.into_iter().collect()
        };
        let mut fields = traced(USUAL)?;
        // Where rays land, in wavelengths times the f-number.
        let far = fields.iter().map(landing_reach).filter(|far| *far <= FARTHEST_WAVES);
        let far = far.fold(0.0, f64::max);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a small count"
        )]
        let needed = ((2.0 * (far + IMAGE_MARGIN)).ceil() as usize).next_multiple_of(4);
        if needed > MOST_CELLS {
            return Err(AnalysisError::TooRough { needed, waves: far });
        }
        if needed > USUAL {
            fields = traced(needed)?;
        }
        let wavelengths = lenses.iter().map(MonochromaticTrain::wavelength).collect();
        Ok(Self { wavelengths, nearness: nearness.to_vec(), fields })
    }

    /// The field at a wavelength (nm) and a nearness (1/mm).
    #[must_use]
    pub fn at(&self, wavelength: f64, nearness: f64) -> PupilField {
        let by_wavelength = lagrange(&self.wavelengths, wavelength);
        let by_nearness = lagrange(&self.nearness, nearness);
        let depths = self.nearness.len();
        let weight = |k: usize| by_wavelength[k / depths] * by_nearness[k % depths];
        let weighted: Vec<(f64, f64, &PupilField)> = self
            .fields
            .iter()
            .enumerate()
            // As a path, which is nearly the same for all wavelengths.
            .map(|(k, own)| (weight(k), weight(k) * own.wavelength / wavelength, own))
            .collect();
        // The openings are those of the field next to it.
        let (nearest, depth) =
            (closest(&self.wavelengths, wavelength), closest(&self.nearness, nearness));
        let mut field = self.fields[nearest * depths + depth].clone();
        for i in 0..field.clear.len() {
            if field.clear[i] <= 0.0 {
                continue;
            }
            let mut waves = 0.0;
            let mut landing = DVec2::ZERO;
            for &(by_landing, by_waves, own) in &weighted {
                // No ray of that depth or wavelength crosses the cell.
                if own.clear[i] <= 0.0 && own.slopes[i] == DVec2::ZERO {
                    field.clear[i] = 0.0;
                }
                waves += by_waves * own.waves[i];
                landing += by_landing * own.landing[i];
            }
            if field.clear[i] <= 0.0 {
                (field.amplitude[i], field.power[i]) = (0.0, 0.0);
            }
            (field.waves[i], field.landing[i]) = (waves, landing);
        }
        field.wavelength = wavelength;
        field
    }
}

/// Greatest distance of the landing points from the reference sphere's centre, in wavelengths times
/// the f-number.
#[must_use]
pub fn landing_reach(field: &PupilField) -> f64 {
    let open = field.lit().filter(|&i| field.clear[i] > 0.5);
    let reach = open.map(|i| field.landing[i].length()).fold(0.0, f64::max);
    reach / airy_unit(field)
}

/// The wavelength times the f-number (mm), by the circle that the pupil fits in.
#[must_use]
pub fn airy_unit(field: &PupilField) -> f64 {
    field.wavelength * 1e-6 / (2.0 * field.circle().1)
}

/// Lagrange weights of the nodes at a place: the factor of each node in the polynomial through all.
fn lagrange(nodes: &[f64], at: f64) -> Vec<f64> {
    let weight = |k: usize| {
        let others = (0..nodes.len()).filter(|&other| other != k);
        others.map(|other| (at - nodes[other]) / (nodes[k] - nodes[other])).product()
    };
    (0..nodes.len()).map(weight).collect()
}

/// Index of the node nearest to a place.
fn closest(nodes: &[f64], at: f64) -> usize {
    let by_distance =
        |a: &usize, b: &usize| (nodes[*a] - at).abs().total_cmp(&(nodes[*b] - at).abs());
    (0..nodes.len()).min_by(by_distance).unwrap_or(0)
}
