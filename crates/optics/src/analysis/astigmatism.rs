//! Field curvature and astigmatism by Coddington's equations along the chief ray.
//!
//! With s and t the distances of the sagittal and the tangential focus along the ray, I the angle of
//! incidence and κ the surface's curvatures across and along the section at the chief ray:
//! n'/s' = n/s + κₛ (n' cos I' − n cos I), n' cos²I'/t' = n cos²I/t + κₜ (n' cos I' − n cos I)
//! (W. T. Welford, *Aberrations of Optical Systems*, 1986, 9.4; H. Coddington, 1829).

use glam::DVec3;
use schemars::JsonSchema;
use serde::Serialize;

use super::AnalysisError;
use super::object::{Beam, ObjectPoint};
use super::wavefront::chief_point;
use crate::element::{Clip, Part};
use crate::train::{MonochromaticTrain, OpticalTrain};

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

/// The foci of an object point, in a lens that is round about its axis.
///
/// `None` when it is not, or has a gradient.
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
    if train.is_graded() {
        return Ok(None);
    }
    let beam = Beam::new(train, at, object)?;
    let Some(mut ray) = beam.start() else { return Ok(None) };
    // 1/s and 1/t at the ray's place.
    let mut vergence = match object {
        ObjectPoint::Infinity { .. } => [0.0; 2],
        ObjectPoint::Near { .. } => [f64::NEG_INFINITY; 2],
    };
    for step in at.forward_steps() {
        let element = &train.elements()[step.element];
        let traversal = step.run_one(ray, Clip::Off);
        let bends = match &element.part {
            Part::Aperture(_) | Part::Filter(_) => continue,
            _ if !element.frame.is_axial() => return Ok(None),
            Part::Surface(_) | Part::ThinLens(_) | Part::Mirror(_) => true,
            Part::Biconic(_)
            | Part::MicrolensArray(_)
            | Part::Freeform(_)
            | Part::CoordinateBreak(_) => false,
        };
        let Some(point) = traversal.point.filter(|_| bends) else { return Ok(None) };
        let way = DVec3::from(point) - DVec3::from(ray.position);
        let [before, behind] = [ray.direction, traversal.ray.direction].map(DVec3::from);
        let distance = way.dot(before);
        for v in &mut vergence {
            *v = match v.is_infinite() {
                true => -1.0 / distance,
                false => *v / (1.0 - distance * *v),
            };
        }
        let [n, n1] = [at.index_before(step.element), at.index_behind(step.element)];
        match &element.part {
            Part::ThinLens(lens) => {
                // Planes to planes: along the axis 1/z' = 1/z + 1/f, for both fans.
                for v in &mut vergence {
                    *v = (*v / before.z + lens.power) * behind.z;
                }
            }
            part => {
                let local = DVec3::from(point) - element.frame.vertex;
                let Some((normal, [across, along])) = shape(part, local) else { return Ok(None) };
                let cos = before.dot(normal).abs();
                // Light is reflected as by the index −n, and unfolded.
                let (cos1, power) = match element.part.mirror() {
                    Some(_) => (cos, -2.0 * n * cos),
                    None => {
                        let cos1 = behind.dot(normal).abs();
                        (cos1, n1 * cos1 - n * cos)
                    }
                };
                vergence = [
                    (n * vergence[0] + across * power) / n1,
                    (n * cos * cos * vergence[1] + along * power) / (n1 * cos1 * cos1),
                ];
            }
        }
        ray = traversal.ray;
    }
    let direction = DVec3::from(ray.direction);
    let focus = |v: f64| {
        let z = ray.position[2] + direction.z / v - image_z;
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

/// The unit normal of a round surface at a place on it, and its curvatures across and along the
/// section through the axis, positive as the vertex' (1/mm).
fn shape(part: &Part, at: DVec3) -> Option<(DVec3, [f64; 2])> {
    let surface = match part {
        Part::Surface(surface) => surface,
        Part::Mirror(mirror) => &mirror.surface,
        _ => return None,
    };
    let r = at.truncate().length();
    // (∂z/∂r)/r, and by its change the second derivative.
    let slope = |r: f64| surface.profile(r * r).1;
    let by_r = slope(r);
    let tilt = by_r * r;
    let h = 1e-4 * (1.0 + r);
    // z'' = s + r ds/dr; a difference of fourth order.
    let near = |k: f64| slope(r + k * h);
    let change = (8.0 * (near(1.0) - near(-1.0)) - (near(2.0) - near(-2.0))) / (12.0 * h);
    let bend = by_r + r * change;
    let length = (1.0 + tilt * tilt).sqrt();
    let normal = DVec3::new(-by_r * at.x, -by_r * at.y, 1.0) / length;
    Some((normal, [by_r / length, bend / length.powi(3)]))
}
