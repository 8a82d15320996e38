//! Distortion: how far the chief ray lands from where a lens of its focal length would put it.

use schemars::JsonSchema;
use serde::Serialize;

use crate::element::Clip;
use crate::train::{MonochromaticTrain, OpticalTrain, Side};

/// Distortion at one field angle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct FieldDistortion {
    /// The angle off the axis (degrees).
    pub field: f64,
    /// Height at which the real chief ray meets the reference plane (mm).
    pub y_real: f64,
    /// efl · tan(field) (mm).
    pub y_paraxial: f64,
    /// (real − paraxial)/paraxial (percent), real counted from where the chief ray of field 0 lands,
    /// which tilts and decentrings move; 0 on the axis.
    pub percent: f64,
}

/// Distortion at `field` degrees on the plane at `reference_z` (mm). Vignetting is left out.
///
/// `None` when no chief ray arrives, the lens is afocal, or the field is 90° or more.
#[must_use]
pub fn distortion(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    field: f64,
    reference_z: f64,
) -> Option<FieldDistortion> {
    let y_real = chief_height(train, at, field, reference_z)?;
    let efl = train.paraxial(at.wavelength()).ok()?.efl?;
    if field.abs() >= 90.0 {
        return None;
    }
    let y_paraxial = efl * field.to_radians().tan();
    let centre = match train.is_rotationally_symmetric() {
        true => 0.0,
        false => chief_height(train, at, 0.0, reference_z)?,
    };
    let percent = match y_paraxial == 0.0 {
        true => 0.0,
        false => 100.0 * (y_real - centre - y_paraxial) / y_paraxial,
    };
    Some(FieldDistortion { field, y_real, y_paraxial, percent })
}

/// The height (mm) at which the chief ray of a field angle (degrees) meets the plane at
/// `reference_z`, through the lens without clipping.
pub fn chief_height(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    field: f64,
    reference_z: f64,
) -> Option<f64> {
    let chief = train.chief_ray(at, field)?;
    let path = at.path(Side::Object, Clip::Off, chief.position, chief.direction);
    let (last, direction) = (*path.points.last()?, path.direction?);
    let height = last.y + direction.y / direction.z * (reference_z - last.z);
    height.is_finite().then_some(height)
}
