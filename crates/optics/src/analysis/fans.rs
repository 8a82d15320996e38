//! Ray fans: where rays of two lines over the pupil land, and how far ahead their waves are; and
//! distortion over the field.

use glam::DVec2;
use schemars::JsonSchema;
use serde::Serialize;

use super::AnalysisError;
use super::object::{Beam, ObjectPoint};
use super::wavefront::{ReferenceSphere, chief_point};
use crate::train::{MonochromaticTrain, OpticalTrain};

/// A ray of a fan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct FanRay {
    /// Its place over half the paraxial entrance pupil, from the chief ray.
    pub pupil: f64,
    /// From the chief ray on the image plane in x (mm).
    pub x: f64,
    /// In y (mm).
    pub y: f64,
    /// Lead of its wave over the chief ray's on the reference sphere (waves).
    pub waves: f64,
    /// Excess of its place on the stop, along the fan, over that of a paraxial ray of the same place of the
    /// entrance pupil (percent of the stop's paraxial radius); `null` where that is none.
    pub pupil_aberration: Option<f64>,
}

/// Both fans of an object point at a wavelength.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Fans {
    /// The object point, in words.
    pub field: String,
    /// The wavelength (nm).
    pub wavelength: f64,
    /// Start of the chief ray (mm): a point of the plane in which rays from infinity start in step,
    /// or the object point.
    pub origin: [f64; 3],
    /// The chief ray's direction there.
    pub direction: [f64; 3],
    /// Half the paraxial entrance pupil, by which `pupil` is counted: mm on that plane, or a direction
    /// cosine at a near object.
    pub half_pupil: f64,
    /// Crossing of the chief ray with the plane of the paraxial entrance pupil, from its middle in x and in y
    /// (mm): it would be 0 without aberrations of the pupil. `null` where the pupil is at infinity.
    pub pupil_shift: Option<[f64; 2]>,
    /// Along y in the pupil: those rays that pass.
    pub tangential: Vec<FanRay>,
    /// Along x.
    pub sagittal: Vec<FanRay>,
}

/// Rays on either side of the chief ray.
const HALF: i32 = 32;

/// Reach of the search for a fan, in paraxial pupils: the pupil of a wide field is larger.
const BEYOND: f64 = 1.5;

/// The fans of an object point about where its chief ray meets the plane at `image_z` (mm), or about
/// `centre`, the chief ray's place of another wavelength there.
///
/// # Errors
///
/// When there is no chief ray or no sphere, or a glass has no index.
pub fn fans(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    object: ObjectPoint,
    image_z: f64,
    centre: Option<DVec2>,
) -> Result<Fans, AnalysisError> {
    let beam = Beam::new(train, at, object)?;
    let own = chief_point(&beam, image_z);
    let centre = centre.map_or(own, |centre| centre.extend(image_z));
    let sphere = ReferenceSphere::about(train, at, centre)?;
    let no_sphere = || AnalysisError::no_sphere(image_z);
    let (_, rest) = sphere.meet(&beam.chief_end).ok_or_else(no_sphere)?;
    let path = beam.chief_end.length + rest;
    let length = at.wavelength() * 1e-6;
    let pupil = train.paraxial(at.wavelength())?.entrance_pupil;
    let stop_radius = stop_radius(train, at, pupil.diameter)?;
    let fan = |along: DVec2| -> Vec<FanRay> {
        let ray = |k: i32| {
            let pupil = BEYOND * f64::from(k) / f64::from(HALF);
            let place = beam.chief + along * (pupil * beam.reach());
            if beam.throughput(place) <= 0.0 {
                return None;
            }
            let end = beam.run_on(place)?;
            let (_, rest) = sphere.meet(&end)?;
            let ray = end.ray;
            let slope = (image_z - ray.position[2]) / ray.direction[2];
            let [x, y] = [0, 1].map(|axis| ray.position[axis] + ray.direction[axis] * slope);
            let waves = (path - end.length - rest) / length;
            let stop = beam.crossing(train.stop(), place).map(|stop| stop.dot(along));
            let pupil_aberration = stop.zip(stop_radius).map(|(stop, radius)| {
                // Upside down where the stop is imaged so.
                100.0 * (stop - pupil * radius) / radius.abs()
            });
            Some(FanRay { pupil, x: x - centre.x, y: y - centre.y, waves, pupil_aberration })
        };
        (-HALF..=HALF).filter_map(ray).collect()
    };
    let start = beam.start().ok_or(AnalysisError::NoChiefRay { field: object.name() })?;
    Ok(Fans {
        field: object.name(),
        wavelength: at.wavelength(),
        origin: start.position,
        direction: start.direction,
        half_pupil: beam.reach(),
        pupil_shift: pupil.z.map(|z| {
            let way = (z - start.position[2]) / start.direction[2];
            [0, 1].map(|axis| start.position[axis] + way * start.direction[axis])
        }),
        tangential: fan(DVec2::Y),
        sagittal: fan(DVec2::X),
    })
}

/// Radius at which a paraxial ray at the rim of the entrance pupil crosses the stop (mm, negative
/// on the other side of the axis); `None` where the pupil has no size.
fn stop_radius(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    diameter: Option<f64>,
) -> Result<Option<f64>, AnalysisError> {
    let indices = train.indices(at.wavelength())?;
    let stop = train.stop();
    let to_stop = train.matrix(&indices, 0, stop).then(train.gap_before(&indices, stop));
    // All slopes from a point of the pupil meet in its image at the stop.
    Ok(diameter.map(|diameter| 0.5 * diameter * to_stop.a).filter(|radius| *radius != 0.0))
}

/// A point of a distortion grid (mm).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct GridPoint {
    /// Its place by a lens without distortion: focal length times the tangents of the angles, or
    /// magnification times the height.
    pub ideal: [f64; 2],
    /// Landing point of the chief ray.
    pub real: [f64; 2],
    /// Distance of the two over that of `ideal` from the axis (percent); 0 on the axis.
    pub percent: f64,
}

/// Distortion over a square of fields: `points` a side, the corners at `corner`'s distance from the
/// axis. `scale` is the focal length (mm) for an object at infinity, with light that goes up landing
/// above the axis, else the magnification. Points whose chief ray does not arrive are left out.
#[must_use]
pub fn distortion_grid(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    corner: &ObjectPoint,
    image_z: f64,
    scale: f64,
    points: u32,
) -> Vec<GridPoint> {
    let share = |k: u32| 2.0 * f64::from(k) / f64::from(points.max(2) - 1) - 1.0;
    let side = std::f64::consts::FRAC_1_SQRT_2;
    let mut grid = Vec::new();
    let land = |object: ObjectPoint| {
        let beam = Beam::new(train, at, object).ok()?;
        Some(chief_point(&beam, image_z).truncate())
    };
    let on_axis = match *corner {
        ObjectPoint::Infinity { .. } => ObjectPoint::field(0.0),
        ObjectPoint::Near { place } => {
            ObjectPoint::Near { place: glam::DVec3::new(0.0, 0.0, place.z) }
        }
    };
    let Some(middle) = land(on_axis) else { return grid };
    for row in 0..points {
        for column in 0..points {
            let at = DVec2::new(share(column), share(row)) * side;
            let (object, ideal) = match *corner {
                ObjectPoint::Infinity { angles } => {
                    let reach = angles[0].to_radians().tan().hypot(angles[1].to_radians().tan());
                    let slopes = at * reach;
                    let angles = [slopes.x, slopes.y].map(|slope| slope.atan().to_degrees());
                    (ObjectPoint::Infinity { angles }, slopes * scale)
                }
                ObjectPoint::Near { place } => {
                    let height = at * place.truncate().length();
                    (ObjectPoint::Near { place: height.extend(place.z) }, height * scale)
                }
            };
            let Some(real) = land(object) else { continue };
            let real = real - middle;
            let far = ideal.length();
            let percent = if far > 0.0 { 100.0 * (real - ideal).length() / far } else { 0.0 };
            grid.push(GridPoint { ideal: ideal.into(), real: real.into(), percent });
        }
    }
    grid
}
