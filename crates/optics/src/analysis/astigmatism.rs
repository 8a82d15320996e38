//! Field curvature and astigmatism: the foci of narrow fans about the chief ray, by its derivatives.
//!
//! A pencil about a ray has two focal lines: with A and B the changes of the ray's place and direction across it by two
//! changes of where it begins, they are where det(A + t B) = 0 along it. In lenses that are round about their axis these
//! are the foci of Coddington's equations (H. Coddington, 1829; W. T. Welford, *Aberrations of Optical Systems*, 1986,
//! 9.4); nothing else here needs one.

use glam::{DMat2, DVec3};
use schemars::JsonSchema;
use serde::Serialize;

use super::AnalysisError;
use super::object::{Beam, ObjectPoint};
use super::wavefront::chief_point;
use crate::train::{MonochromaticTrain, OpticalTrain, RayDifferential, Side};

/// Foci of narrow fans about one chief ray.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FieldFoci {
    /// The object point, in words.
    pub field: String,
    /// The chief ray's height on the image plane (mm).
    pub height: f64,
    /// From the image plane to the tangential focus along the axis (mm); `null` at infinity.
    pub tangential: Option<f64>,
    /// From the image plane to the sagittal focus along the axis (mm); `null` at infinity.
    pub sagittal: Option<f64>,
    /// The angle between the chief ray and the axis at the image (degrees).
    pub chief_angle: f64,
}

/// The foci of an object point.
///
/// `None` in a lens with a gradient or lenslets.
///
/// # Errors
///
/// When there is no chief ray, or a glass has no index.
pub fn foci(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    object: ObjectPoint,
    image_z: f64,
) -> Result<Option<FieldFoci>, AnalysisError> {
    let beam = Beam::new(train, at, object)?;
    let Some(chief) = beam.start() else { return Ok(None) };
    let [place, direction] = [chief.position, chief.direction].map(DVec3::from);
    // Across the ray: out of the plane of the axis, and in it.
    let across = DVec3::Y.cross(direction).normalize();
    let fans = [across, direction.cross(across)];
    let changes = match object {
        ObjectPoint::Infinity { .. } => fans.map(|fan| [fan, DVec3::ZERO]),
        ObjectPoint::Near { .. } => fans.map(|fan| [DVec3::ZERO, fan]),
    };
    let start = RayDifferential { ray: [place, direction], changes };
    let Some(end) = at.differential(Side::Object, start) else { return Ok(None) };
    let [place, direction] = end.ray;
    let vergence = focal_lines(&end);
    let focus = |v: f64| {
        let z = place.z + direction.z / v - image_z;
        (z.abs() < 1e9).then_some(z)
    };
    Ok(Some(FieldFoci {
        field: object.name(),
        height: chief_point(&beam, image_z)
            .truncate()
            .length()
            .copysign(chief_point(&beam, image_z).y),
        tangential: focus(vergence[1]),
        sagittal: focus(vergence[0]),
        chief_angle: direction.truncate().length().atan2(direction.z).to_degrees(),
    }))
}

/// 1 over how far along a ray its sagittal and its tangential focal line are (1/mm).
fn focal_lines(end: &RayDifferential) -> [f64; 2] {
    let direction = end.ray[1];
    let sagittal = DVec3::Y.cross(direction).normalize();
    let axes = [sagittal, direction.cross(sagittal)];
    let across = |part: usize| {
        let by = |fan: usize| axes.map(|axis| end.changes[fan][part].dot(axis));
        DMat2::from_cols(by(0).into(), by(1).into())
    };
    // A v + B loses a direction at v = 1/t: −v is an eigenvalue of A⁻¹ B.
    let bent = across(0).inverse() * across(1);
    let [sagittal, tangential] = [bent.x_axis.x, bent.y_axis.y];
    let (mean, half) = (0.5 * (sagittal + tangential), 0.5 * (sagittal - tangential));
    let apart = (half * half + bent.x_axis.y * bent.y_axis.x).max(0.0).sqrt().copysign(half);
    [-(mean + apart), -(mean - apart)]
}
