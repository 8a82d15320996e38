//! Chromatic shifts against the design wavelength.

use schemars::JsonSchema;
use serde::Serialize;

use super::distortion::chief_height;
use crate::glass::GlassError;
use crate::train::OpticalTrain;

/// How the image of one wavelength stands to that of the design wavelength.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ColourShift {
    /// The wavelength (nm).
    pub wavelength: f64,
    /// Longitudinal: its back focal length less that of the design wavelength (mm); `null` for an
    /// afocal lens.
    pub longitudinal: Option<f64>,
    /// Lateral: its chief ray's height on the reference plane less that of the design wavelength
    /// (mm), one for each field angle; `null` where a chief ray does not arrive.
    pub lateral: Vec<Option<f64>>,
}

/// Shifts at `wavelengths` (nm) and `fields` (degrees) on the plane at `reference_z` (mm).
///
/// # Errors
///
/// When a glass has no index at one of the wavelengths.
pub fn colour_shifts(
    train: &OpticalTrain,
    wavelengths: &[f64],
    fields: &[f64],
    reference_z: f64,
) -> Result<Vec<ColourShift>, GlassError> {
    let heights = |wavelength: f64| -> Result<Vec<Option<f64>>, GlassError> {
        let at = train.at(wavelength)?;
        Ok(fields.iter().map(|&field| chief_height(train, &at, field, reference_z)).collect())
    };
    let design = train.wavelength();
    let (focus, reference) = (train.paraxial(design)?.bfl, heights(design)?);
    let mut shifts = Vec::with_capacity(wavelengths.len());
    for &wavelength in wavelengths {
        let own = train.paraxial(wavelength)?.bfl;
        let difference = |(own, reference): (Option<f64>, &Option<f64>)| Some(own? - (*reference)?);
        shifts.push(ColourShift {
            wavelength,
            longitudinal: difference((own, &focus)),
            lateral: heights(wavelength)?.into_iter().zip(&reference).map(difference).collect(),
        });
    }
    Ok(shifts)
}
