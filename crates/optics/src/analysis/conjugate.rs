//! Position of the object, and what follows from it: by its distance, by the magnification, or by
//! the numerical aperture of its light.

use glam::DVec3;
use schemars::JsonSchema;
use serde::Serialize;

use super::AnalysisError;
use super::object::ObjectPoint;
use crate::train::{Focus, FocusError, OpticalTrain};

/// Position of the object.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Conjugate {
    /// At infinity.
    #[default]
    Infinity,
    /// In a plane this far in front of the first vertex (mm).
    Distance(f64),
    /// Object where the image is this many times as large, negative when it is inverted.
    Magnification(f64),
}

/// The planes that a lens is analysed between.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Planes {
    /// z of the object (mm); `null` at infinity.
    pub object_z: Option<f64>,
    /// z of the image plane (mm).
    pub image_z: f64,
    /// The paraxial magnification; `null` for an object at infinity.
    pub magnification: Option<f64>,
    /// True if the beams' middles run along the axis on the object's side.
    pub is_object_telecentric: bool,
    /// True if they do on the image's side.
    pub is_image_telecentric: bool,
}

impl Conjugate {
    /// The planes: the image plane is where the focus says, and with a near object and the focus as
    /// written the object's paraxial image.
    ///
    /// # Errors
    ///
    /// When there is no such object or no image; a lens without power has no image of infinity.
    pub fn planes(self, train: &OpticalTrain, focus: Focus) -> Result<Planes, AnalysisError> {
        let indices = train.indices(train.wavelength())?;
        let all = train.matrix(&indices, 0, train.elements().len());
        let (before, behind) = (indices[0], indices[indices.len() - 1]);
        let paraxial = train.paraxial(train.wavelength())?;
        let distance = match self {
            Self::Infinity => None,
            Self::Distance(distance) if distance > 0.0 && distance.is_finite() => Some(distance),
            Self::Distance(distance) => {
                let why = format!("{distance} mm is no distance in front of the lens");
                return Err(AnalysisError::object("object-distance", &why));
            }
            Self::Magnification(m) if !(m.is_finite() && m != 0.0) => {
                let why = "it must be a number other than 0";
                return Err(AnalysisError::object("magnification", why));
            }
            Self::Magnification(_) if paraxial.efl.is_none() => {
                let why = "the lens is afocal: it has one magnification at all distances\n\
                           hint: give --object-distance";
                return Err(AnalysisError::object("magnification", why));
            }
            Self::Magnification(m) => {
                // With the object d in front, the lower right number of the matrix is 1/m.
                let distance = before * (1.0 / m - all.d) / all.c;
                if distance <= 0.0 {
                    let why = format!(
                        "at {m} the object would stand {} mm behind the first vertex; a real image \
                         has a negative magnification",
                        -distance
                    );
                    return Err(AnalysisError::object("magnification", &why));
                }
                Some(distance)
            }
        };
        let is_telecentric = |z: Option<f64>| {
            z.is_none_or(|z| z.abs() > 1e6 * paraxial.efl.map_or(1.0, f64::abs).max(1.0))
        };
        let image_z = match (distance, focus) {
            (Some(distance), Focus::AsWritten) => {
                let (height, slope) =
                    (all.a * distance + all.b * before, all.c * distance + all.d * before);
                let image = -behind * height / slope;
                let z = train.last_vertex() + image;
                if !image.is_finite() || image.abs() > 1e9 {
                    let least = -paraxial.ffl.unwrap_or(0.0) * 1e-3;
                    let distance = distance * 1e-3;
                    return Err(FocusError::at_focal_point(distance, least).into());
                }
                if image <= 0.0 {
                    let distance = distance * 1e-3;
                    return Err(FocusError::virtual_image(distance, z).into());
                }
                z
            }
            (_, focus) => train.sensor_z(focus)?,
        };
        let magnification = distance.map(|d| 1.0 / (all.c * d / before + all.d));
        Ok(Planes {
            object_z: distance.map(|distance| -distance),
            image_z,
            magnification,
            is_object_telecentric: is_telecentric(paraxial.entrance_pupil.z),
            is_image_telecentric: is_telecentric(paraxial.exit_pupil.z),
        })
    }
}

impl Planes {
    /// A point of the object: a field angle (degrees) at infinity, else a height (mm).
    #[must_use]
    pub fn point(&self, field: f64) -> ObjectPoint {
        match self.object_z {
            None => ObjectPoint::field(field),
            Some(z) => ObjectPoint::Near { place: DVec3::new(0.0, field, z) },
        }
    }
}

/// The lens with its stop set so that the light of the object's middle that just passes has a
/// numerical aperture, in air, on the object's side.
///
/// # Errors
///
/// When it is none, the object is at infinity, or the rims do not let such a beam through.
pub fn with_numerical_aperture(
    train: OpticalTrain,
    planes: &Planes,
    numerical_aperture: f64,
) -> Result<OpticalTrain, AnalysisError> {
    let none = |why: &str| AnalysisError::object("numerical-aperture", why);
    let Some(z) = planes.object_z else {
        let why = "an object at infinity has none\nhint: give --object-distance or --f-number";
        return Err(none(why));
    };
    if !(numerical_aperture > 0.0 && numerical_aperture < 1.0) {
        return Err(none("it must lie between 0 and 1"));
    }
    // Where the real ray of that slope crosses the stop, whatever the rims are.
    let at = train.at(train.wavelength())?;
    let direction = DVec3::new(0.0, numerical_aperture, (1.0 - numerical_aperture.powi(2)).sqrt());
    let ray = crate::element::Ray::new(DVec3::new(0.0, 0.0, z), direction);
    let crossing = ray.and_then(|ray| at.crossing(crate::train::Side::Object, train.stop(), ray));
    let Some([x, y]) = crossing else {
        return Err(none("a ray of that slope does not reach the stop"));
    };
    train.with_stop_radius(x.hypot(y)).map_err(|error| none(&error.to_string()))
}
