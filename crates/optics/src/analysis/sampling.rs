//! Wavefronts of beams, on as many cells as they need.

use glam::DVec3;

use super::aim::{self, PupilGrid};
use super::object::{Beam, ObjectPoint};
use super::wavefront::{COMFORTABLE, Cells, ReferenceSphere, USUAL_CELLS, Wavefront, chief_point};
use super::{AnalysisError, MOST_CELLS, quick_length};
use crate::train::{MonochromaticTrain, OpticalTrain};

impl Wavefront {
    /// The wavefront of an object point about the point where its chief ray meets the plane at
    /// `image_z` (mm).
    ///
    /// # Errors
    ///
    /// When there is no light or no sphere, or the cells are too few: the error says how many it
    /// needs.
    pub fn new(
        train: &OpticalTrain,
        at: &MonochromaticTrain,
        object: ObjectPoint,
        image_z: f64,
        cells: Cells,
    ) -> Result<Self, AnalysisError> {
        let beam = Beam::new(train, at, object)?;
        let centre = chief_point(&beam, image_z);
        Self::about(&beam, centre, cells)
    }

    /// The wavefront of a beam about a given point (mm).
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn about(beam: &Beam<'_>, centre: DVec3, cells: Cells) -> Result<Self, AnalysisError> {
        let sphere = ReferenceSphere::about(beam.train, beam.at, centre)?;
        let outline = aim::outline(beam, &sphere)?;
        let count = match cells {
            Cells::Given(count) => count,
            Cells::Needed => {
                let coarse = aim::field(beam, &sphere, &outline, PupilGrid::cells(64, &outline))?;
                let needed = coarse.needed_cells(COMFORTABLE).max(USUAL_CELLS);
                let needed = 2 * quick_length(needed.div_ceil(2));
                if needed > MOST_CELLS {
                    let waves = coarse.statistics().peak_to_valley;
                    return Err(AnalysisError::TooRough { needed, waves });
                }
                needed
            }
        };
        Self::sampled(beam, sphere, &outline, PupilGrid::cells(count, &outline))
    }

    /// The wavefront on a grid that is given.
    fn sampled(
        beam: &Beam<'_>,
        sphere: ReferenceSphere,
        outline: &aim::Outline,
        sampling: PupilGrid,
    ) -> Result<Self, AnalysisError> {
        let pupil = aim::field(beam, &sphere, outline, sampling)?;
        Self::resolved(beam.object, sphere, pupil)
    }
}
