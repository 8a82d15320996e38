//! One object point at several wavelengths, on grids that have one pitch in the image.

use glam::DVec3;
use rayon::prelude::*;

use super::aim::{self, PupilGrid};
use super::object::{Beam, ObjectPoint};
use super::pupil::RIM;
use super::wavefront::{COMFORTABLE, Cells, ReferenceSphere, USUAL_CELLS, Wavefront, chief_point};
use super::{AnalysisError, LEAST_CELLS, MOST_CELLS, quick_length, smooth};
use crate::train::{MonochromaticTrain, OpticalTrain};

/// Cells a side of the grid that says how many are needed.
const COARSE: usize = 64;

/// Greatest difference of a wavefront from the polynomial that stands for it (waves): less than
/// what tables show.
const SMOOTH: f64 = 2e-5;

/// The wavefronts of a point at each of the wavelengths of `lenses`, all about the place where the
/// chief ray of the first meets the plane at `image_z` (mm): lateral colour is in them. As many cells a
/// side as the roughest of them needs; a cell's side over the wavelength is the same in all.
///
/// # Errors
///
/// When there is no light or no sphere, or the cells are too few.
pub fn wavefronts(
    train: &OpticalTrain,
    lenses: &[MonochromaticTrain],
    object: ObjectPoint,
    image_z: f64,
    cells: Cells,
) -> Result<Vec<Wavefront>, AnalysisError> {
    let mut beams = Vec::with_capacity(lenses.len());
    for at in lenses {
        beams.push(Beam::new(train, at, object)?);
    }
    let Some(first) = beams.first() else { return Ok(Vec::new()) };
    let centre: DVec3 = chief_point(first, image_z);
    // What each lights, and how rough it is.
    let field = |(beam, sphere, outline): (&Beam<'_>, &ReferenceSphere, &aim::Outline),
                 sampling| {
        smooth::field(beam, sphere, outline, sampling, SMOOTH)
            .map_or_else(|| aim::field(beam, sphere, outline, sampling), Ok)
    };
    let part = |i: usize| {
        let beam = &beams[i];
        let sphere = ReferenceSphere::about(train, beam.at, centre)?;
        let outline = aim::outline(beam, &sphere)?;
        let mut count = 0;
        if cells == Cells::Needed {
            let coarse = field((beam, &sphere, &outline), PupilGrid::cells(COARSE, &outline))?;
            count = coarse.needed_cells(COMFORTABLE);
            if count > MOST_CELLS {
                let waves = coarse.statistics().peak_to_valley;
                return Err(AnalysisError::TooRough { needed: count, waves });
            }
        }
        Ok(((beam, sphere, outline), count))
    };
    let parts: Vec<_> = (0..beams.len()).into_par_iter().map(part).collect();
    // The first in order fails, however threads run.
    let parts = parts.into_iter().collect::<Result<Vec<_>, _>>()?;
    let (parts, counts): (Vec<_>, Vec<usize>) = parts.into_iter().unzip();
    let over = |(beam, _, outline): &(&Beam<'_>, ReferenceSphere, aim::Outline)| {
        outline.half / beam.at.wavelength()
    };
    let widest = parts.iter().map(over).fold(0.0, f64::max);
    // The pupil of a long wavelength has fewer of the cells than that of a short one.
    let scaled = counts.iter().zip(&parts).map(|(count, part)| *count as f64 * widest / over(part));
    let needed = scaled.fold(USUAL_CELLS as f64, f64::max);
    let count = match cells {
        Cells::Needed if needed > MOST_CELLS as f64 => MOST_CELLS,
        #[expect(clippy::cast_possible_truncation, reason = "at most 1024")]
        Cells::Needed => (2 * quick_length((0.5 * needed).ceil() as usize)).min(MOST_CELLS),
        Cells::Given(count) if !(LEAST_CELLS..=MOST_CELLS).contains(&count) => {
            return Err(AnalysisError::out_of_range(count));
        }
        Cells::Given(count) => count,
    };
    let widest = widest / (0.5 * count as f64 - RIM);
    let wavefront = |(beam, sphere, outline): (&Beam<'_>, ReferenceSphere, aim::Outline)| {
        let step = widest * beam.at.wavelength();
        let sampling = PupilGrid { cells: count, step, middle: outline.middle };
        let pupil = field((beam, &sphere, &outline), sampling)?;
        Wavefront::resolved(beam.object, sphere, pupil)
    };
    let wavefronts: Vec<_> = parts.into_par_iter().map(wavefront).collect();
    wavefronts.into_iter().collect()
}
