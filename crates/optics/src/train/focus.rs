//! Placement of the sensor: focusing.

use etendue_report::Refusal;

use super::{Element, OpticalTrain, Part, SensorMount};
use crate::element::Frame;
use crate::glass::GlassError;

/// Focus setting of a lens.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Focus {
    /// The sensor stands where the file puts it, by the last element's thickness; at the image of
    /// infinity when that is 0.
    #[default]
    AsWritten,
    /// At the paraxial image of infinity.
    Infinity,
    /// At the paraxial image of a plane this far (m) in front of the entrance pupil.
    Distance(f64),
    /// This far (mm) behind the last element's vertex.
    Sensor(f64),
}

/// Error of a lens that gives no place for the sensor.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FocusError {
    /// An afocal lens and an object at infinity.
    #[error("the lens is afocal: it images infinity to infinity\nhint: give sensor_distance")]
    Afocal,
    /// A distance that is none, an object without a real image behind the lens, a broken axis, or a glass without index.
    #[error(transparent)]
    Refused(#[from] Refusal),
}

impl FocusError {
    /// A quantity that is not above zero.
    fn not_positive(what: &str, value: f64) -> Self {
        Refusal::new(format!("the {what} is {value}; it must be a positive number")).into()
    }

    /// An object at `distance` (m) at the front focal point, at `least` (m), or so near it that the image is farther
    /// than any camera.
    pub(crate) fn at_focal_point(distance: f64, least: f64) -> Self {
        let why = format!(
            "an object at {distance} m is at the front focal point: its image is at infinity; the focus distance must \
             exceed {least} m"
        );
        Refusal::new(why).into()
    }

    /// A virtual image at z = `image` (mm) of an object at `distance` (m; infinite for infinity): it is inside the focal
    /// length, or the lens diverges.
    pub(crate) fn virtual_image(distance: f64, image: f64) -> Self {
        let place = match distance.is_finite() {
            true => format!("{distance} m"),
            false => "infinity".to_owned(),
        };
        let why = format!(
            "an object at {place} has no real image behind the lens: it would be at z = {image} mm"
        );
        Refusal::new(why).into()
    }

    /// An image at z = `image` (mm) in front of `element`, the last one, which breaks the axis.
    fn broken_axis(element: usize, image: f64) -> Self {
        let why = format!(
            "the image is at z = {image} mm, in front of elements[{element}], a coordinate_break behind which the \
             sensor would stand"
        );
        let remedy = "break the axis nearer to the lens, or put the sensor where it is to be by the last thickness";
        Refusal::new(why).hint(remedy).into()
    }
}

impl From<FocusError> for Refusal {
    fn from(error: FocusError) -> Self {
        Self::of(&error)
    }
}

impl From<GlassError> for FocusError {
    fn from(error: GlassError) -> Self {
        Self::Refused(error.into())
    }
}

/// Images farther behind the lens than this many focal lengths are said to be at infinity.
const FARTHEST: f64 = 1e9;

impl OpticalTrain {
    /// z of the sensor (mm), at the design wavelength.
    ///
    /// # Errors
    ///
    /// When there is no image to stand at.
    pub fn sensor_z(&self, focus: Focus) -> Result<f64, FocusError> {
        let last = self.last_vertex();
        match focus {
            Focus::AsWritten if self.end > last => Ok(self.end),
            Focus::AsWritten | Focus::Infinity => self.image_of_infinity(),
            Focus::Sensor(distance) if distance > 0.0 && distance.is_finite() => {
                Ok(last + distance)
            }
            Focus::Sensor(value) => Err(FocusError::not_positive("sensor_distance (mm)", value)),
            Focus::Distance(distance) if distance == f64::INFINITY => self.image_of_infinity(),
            Focus::Distance(distance) if distance > 0.0 => self.image_of(distance),
            Focus::Distance(value) => Err(FocusError::not_positive("focus_distance (m)", value)),
        }
    }

    fn image_of_infinity(&self) -> Result<f64, FocusError> {
        let paraxial = self.paraxial(self.wavelength)?;
        let image = paraxial.image_z.ok_or(FocusError::Afocal)?;
        if image <= self.last_vertex() {
            return Err(self.no_image(f64::INFINITY, image));
        }
        Ok(image)
    }

    /// Reason why an image in front of the last vertex, at z (mm), of an object at a distance (m)
    /// is none for a sensor.
    fn no_image(&self, distance: f64, image: f64) -> FocusError {
        let is_break = |element: &Element| matches!(element.part, Part::CoordinateBreak(_));
        let lens = self.elements.iter().rposition(|element| !is_break(element));
        let is_real = lens.is_some_and(|i| image > self.elements[i].frame.vertex.z);
        match (self.elements.len(), is_real) {
            (count, true) if lens != Some(count - 1) => FocusError::broken_axis(count - 1, image),
            _ => FocusError::virtual_image(distance, image),
        }
    }

    fn image_of(&self, distance: f64) -> Result<f64, FocusError> {
        let indices = self.indices(self.wavelength)?;
        let all = self.matrix(&indices, 0, self.elements.len());
        let (before, behind) = (indices[0], indices[indices.len() - 1]);
        let paraxial = self.paraxial(self.wavelength)?;
        // A lens that is telecentric towards the object has no finite entrance pupil; its front
        // vertex stands in.
        let pupil = paraxial.entrance_pupil.z.unwrap_or(0.0);
        let object = distance * 1e3 - pupil;
        if object <= 0.0 {
            let why = format!(
                "focus_distance {distance} m lies inside the lens: its entrance pupil is {pupil} mm behind the front"
            );
            return Err(Refusal::new(why).into());
        }
        let (height, slope) = (all.a * object + all.b * before, all.c * object + all.d * before);
        let image = -behind * height / slope;
        let reach = paraxial.efl.map_or(f64::INFINITY, |efl| FARTHEST * efl.abs());
        if !image.is_finite() || image.abs() > reach {
            let least = (pupil - paraxial.ffl.unwrap_or(0.0)) * 1e-3;
            return Err(FocusError::at_focal_point(distance, least));
        }
        if image <= 0.0 {
            return Err(self.no_image(distance, self.last_vertex() + image));
        }
        Ok(self.last_vertex() + image)
    }

    /// The sensor's frame with its centre at `z` (mm), tilted and decentred as the file says.
    #[must_use]
    pub fn sensor_frame(&self, z: f64) -> Frame {
        let SensorMount { tilt, decentre } = self.sensor;
        Frame::placed(z, decentre.map(|length| length.0), tilt.map(|angle| angle.0))
    }
}
