//! Wave analysis of a camera's lens, for curves: fans and modulation at a few fields of the plane in focus.

use etendue_geometry::glam::DVec3;
use etendue_optics::analysis::colours::wavefronts;
use etendue_optics::analysis::fans::{Fans, fans};
use etendue_optics::analysis::spread::WeightedFields;
use etendue_optics::analysis::wavefront::Cells;
use etendue_optics::analysis::{AnalysisError, ObjectPoint, Transfer};

use crate::lens_view::LensView;
use crate::{Error, lens_view};

/// Frequencies of a curve of modulation.
const FREQUENCIES: u32 = 60;

/// Curves of a lens at its design wavelength.
#[derive(Debug, Clone)]
pub struct LensWaves {
    /// The wavelength (nm).
    pub wavelength: f64,
    /// From where on the first field has no modulation (cycles/mm).
    pub limit: f64,
    /// Fields that light reaches.
    pub fields: Vec<FieldCurves>,
}

/// Curves of a field.
#[derive(Debug, Clone)]
pub struct FieldCurves {
    /// Its angle, in words.
    pub name: String,
    /// Rays along two lines of the pupil.
    pub fans: Fans,
    /// Frequency (cycles/mm) and modulation by diffraction of waves along y and along x; empty where the
    /// wavefront is too rough for the most cells.
    pub modulation: Vec<[f64; 3]>,
}

impl LensView {
    /// The lens in waves: of points of the plane in focus, at the angles of its report's fields. It takes a tenth of a
    /// second and more.
    ///
    /// # Errors
    ///
    /// When no field has light, or a glass no index.
    pub fn waves(&self) -> Result<LensWaves, Error> {
        let refused = |error: AnalysisError| Error::Refused(format!("camera.lens: {error}"));
        let lens_view::FocusedTrain { train, origin, distance, image_z } = &self.in_focus;
        let at = train.at(train.wavelength()).map_err(|error| refused(error.into()))?;
        let mut found = LensWaves { wavelength: at.wavelength(), limit: 0.0, fields: Vec::new() };
        let mut dark = None;
        for &field in &self.report.fields {
            let object = match distance.is_finite() {
                false => ObjectPoint::field(field),
                true => {
                    let height = -1e3 * distance * field.to_radians().tan();
                    ObjectPoint::Near { place: DVec3::new(0.0, height, origin - 1e3 * distance) }
                }
            };
            let fans = match fans(train, &at, object, *image_z, None) {
                Ok(fans) if !fans.tangential.is_empty() => fans,
                Ok(_) => continue,
                Err(error @ AnalysisError::Glass(_)) => return Err(refused(error)),
                Err(error) => {
                    dark = Some(error);
                    continue;
                }
            };
            let lenses = std::slice::from_ref(&at);
            let waves = wavefronts(train, lenses, object, *image_z, Cells::Needed);
            let pupil = waves.ok().and_then(|waves| waves.into_iter().next()).map(|one| one.pupil);
            let transfer = pupil.map(|pupil| Transfer::diffraction(&WeightedFields::one(pupil)));
            let modulation = transfer.map_or_else(Vec::new, |transfer| {
                if found.limit == 0.0 {
                    found.limit = transfer.limit;
                }
                let step = found.limit / f64::from(FREQUENCIES);
                let at = |k: u32| {
                    let frequency = step * f64::from(k);
                    let [y, x] = transfer.modulation(frequency);
                    [frequency, y, x]
                };
                (0..=FREQUENCIES).map(at).collect()
            });
            let name = format!("{field}\u{b0}");
            found.fields.push(FieldCurves { name, fans, modulation });
        }
        match (found.fields.is_empty(), dark) {
            (true, Some(error)) => Err(refused(error)),
            _ => Ok(found),
        }
    }
}
