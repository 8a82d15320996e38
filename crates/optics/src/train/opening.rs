//! The widest opening of a lens: how large a beam on the axis its rims let through.

use glam::{DVec2, DVec3};

use super::aim::towards_lens;
use super::pupil::without_dimming;
use super::{Focus, LensError, MonochromaticTrain, OpticalTrain, Part, Side};
use crate::element::{Clip, Opening, Ray, RayStatus};

/// Directions across the axis in which a lens without rotational symmetry is looked at. Not a setting, as [`RAYS`]: a
/// lens is closed down while its camera is read, before anything of a scene is known.
const AZIMUTHS: u32 = 16;

/// Rays among which a beam's edge is looked for before it is bisected.
const RAYS: u32 = 128;

/// Excess (share) of a stated f-number's beam over the lens that is tolerated: f-numbers are
/// written with two or three digits, and half a percent changes the light by one.
const NOMINAL: f64 = 5e-3;

/// Ratio of a stop's stated width to the beam's up to which the stop still counts as filled: two
/// percent of the light, as rims are often written as wide as the beam, to three digits.
const FILLED: f64 = 1.01;

/// The widest beam from infinity on the axis that passes a lens when its stop is open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WidestOpening {
    /// Focal length over the diameter of that beam's entrance pupil.
    pub f_number: f64,
    /// The stop's radius that passes just that beam (mm).
    pub stop_radius: f64,
    /// The element that ends the rays beyond.
    pub element: usize,
}

/// Edge of a beam.
#[derive(Debug, Clone, Copy)]
enum RimEdge {
    /// Not before the last ray that was looked at.
    Open,
    /// At a place of the stop.
    At {
        /// From the stop's centre (mm).
        stop_radius: f64,
        /// Element that ends the next ray.
        element: usize,
    },
}

impl OpticalTrain {
    /// The widest opening of the lens at its design wavelength: real rays from infinity on the axis,
    /// and from the middle of their image, that all other rims let through. A stop that is an iris opens without end, the rim of a glass
    /// does not; masks count as the rectangle that holds them.
    ///
    /// `None` when the lens has no f-number, nothing limits the beam, or the axis is dark.
    #[must_use]
    pub fn widest_opening(&self) -> Option<WidestOpening> {
        let paraxial = self.paraxial(self.wavelength).ok()?;
        let (efl, magnification) = (paraxial.efl?, paraxial.stop_magnification?);
        let mut open = without_dimming(self).without_arrays();
        // What stands in a beam is no rim that ends it.
        for element in &mut open.elements {
            if let Part::Aperture(opening) = &element.part
                && let Opening::Shaped(shape) = &**opening
                && let Some(radius) = shape.outer_radius()
            {
                element.part = Part::Aperture(Opening::Circle { radius }.into());
            }
        }
        if matches!(self.elements[self.stop].part, Part::Aperture(_)) {
            open.elements[self.stop].part.set_clear_radius(f64::INFINITY).ok()?;
        }
        let azimuths = if open.is_rotationally_symmetric() { 1 } else { AZIMUTHS };
        let turn = |i: u32| std::f64::consts::TAU * f64::from(i) / f64::from(azimuths);
        let edges = (0..azimuths).map(|i| open.edge_of_axial_beam(DVec2::from_angle(turn(i))));
        let edges: Option<Vec<(f64, usize)>> = edges.collect();
        let (stop_radius, element) = edges?.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        let f_number = 0.5 * (efl * magnification / stop_radius).abs();
        f_number.is_finite().then_some(WidestOpening { f_number, stop_radius, element })
    }

    /// Distance from the stop's centre at which the outermost ray of the axial beam passes in one
    /// direction (mm), and the element that ends the next one: of the beam from infinity and of
    /// that which the image's middle on the sensor gathers, the narrower.
    fn edge_of_axial_beam(&self, azimuth: DVec2) -> Option<(f64, usize)> {
        let at = self.at(self.wavelength).ok()?;
        let z = -self.far_in_front(0.0);
        let parallel = |height: f64| ((azimuth * height).extend(z), DVec3::Z);
        let from_object =
            self.edge_of_rays(&at, Side::Object, parallel, 1.5 * self.lateral_scale())?;
        let image = self.sensor_z(Focus::Infinity).ok();
        let from_sensor = image.and_then(|image| {
            let converging =
                |slope: f64| (DVec3::new(0.0, 0.0, image), towards_lens(azimuth * slope));
            let depth = (image - self.last_vertex()).abs().max(1e-3);
            let widest = 1.5 * self.lateral_scale() / depth;
            self.edge_of_rays(&at, Side::Sensor, converging, widest)
        });
        let edges = [from_object, from_sensor.unwrap_or(RimEdge::Open)].into_iter();
        let ended = edges.filter_map(|edge| match edge {
            RimEdge::Open => None,
            RimEdge::At { stop_radius, element } => Some((stop_radius, element)),
        });
        ended.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The outermost of the rays 0 to `limit` of a family that passes; `None` when the first one ends.
    fn edge_of_rays(
        &self,
        at: &MonochromaticTrain,
        from: Side,
        ray: impl Fn(f64) -> (DVec3, DVec3),
        limit: f64,
    ) -> Option<RimEdge> {
        let ended = |i: f64| {
            let (position, direction) = ray(i);
            match at.path(from, Clip::On, position, direction).status {
                RayStatus::Exited => None,
                RayStatus::Missed { element }
                | RayStatus::TotalInternalReflection { element }
                | RayStatus::Vignetted { element } => Some(element),
            }
        };
        // What stands in the middle leaves the beam around it.
        let step = limit / f64::from(RAYS);
        let begin = match ended(0.0) {
            None => 0,
            Some(_) if self.is_obscured() => {
                (1..=RAYS).find(|&i| ended(step * f64::from(i)).is_none())?
            }
            Some(_) => return None,
        };
        // The first step that ends, and then by halves of it.
        let Some(first) =
            (begin + 1..=RAYS).map(|i| step * f64::from(i)).find(|&i| ended(i).is_some())
        else {
            return Some(RimEdge::Open);
        };
        let (mut low, mut high) = (first - step, first);
        let mut element = ended(high)?;
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            match ended(middle) {
                None => low = middle,
                Some(at) => (high, element) = (middle, at),
            }
        }
        // Where the last ray to pass crosses the stop.
        let (position, direction) = ray(low);
        let [x, y] = at.crossing(from, self.stop, Ray::new(position, direction)?)?;
        let stop_radius = x.hypot(y);
        (stop_radius > 0.0).then_some(RimEdge::At { stop_radius, element })
    }

    /// Refuses a radius of the stop (mm) that no beam on the axis fills. What the lens itself has, as
    /// its file writes it, is none that is refused.
    pub(super) fn check_opening(&self, stop_radius: f64) -> Result<(), LensError> {
        let Some(widest) = self.widest_opening() else { return Ok(()) };
        let written = self.stop_radius();
        let is_filled = written <= widest.stop_radius * FILLED;
        let most = if is_filled { written.max(widest.stop_radius) } else { widest.stop_radius };
        if stop_radius > most * (1.0 + NOMINAL) {
            return Err(LensError::Stop { index: self.stop, why: widest.to_string() });
        }
        Ok(())
    }

    /// Refuses a stop that what stands in the middle of the beam covers.
    pub(super) fn check_obscuration(&self) -> Result<(), LensError> {
        /// Rays across the beam, in each direction.
        const RAYS: u32 = 1024;
        let radius = self.paraxial(self.wavelength).ok().and_then(|p| p.entrance_pupil.diameter);
        let (Some(diameter), true, Ok(at)) = (radius, self.is_obscured(), self.at(self.wavelength))
        else {
            return Ok(());
        };
        let z = -self.far_in_front(0.0);
        let passes = |i: u32, k: u32| {
            // Between the arms of a spider, whichever way it is turned.
            let turn = DVec2::from_angle(0.1 + std::f64::consts::TAU * f64::from(k) / 7.0);
            let height = 0.5 * diameter * f64::from(i) / f64::from(RAYS);
            let path = at.path(Side::Object, Clip::On, (turn * height).extend(z), DVec3::Z);
            path.status == RayStatus::Exited
        };
        if (0..7).any(|k| (0..=RAYS).any(|i| passes(i, k))) {
            return Ok(());
        }
        let why = format!(
            "nothing passes a beam of {:.4} mm, whose middle is covered: open the lens wider",
            diameter
        );
        Err(LensError::Stop { index: self.stop, why })
    }

    /// A sentence on a stop that is open wider than any beam on the axis; `None` when the beam fills
    /// it.
    pub(super) fn unfilled_stop(&self) -> Option<String> {
        let paper = self.paraxial(self.wavelength).ok()?.f_number?;
        let widest = self.widest_opening()?;
        (self.stop_radius() > widest.stop_radius * FILLED).then(|| {
            format!("the stop is open to f/{paper:.2} on paper, but {widest}: the f-number is that on paper")
        })
    }
}

impl std::fmt::Display for WidestOpening {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Rounded up, so that the number can be asked for; f/2 but for rounding is f/2.
        let f_number = (100.0 * self.f_number * (1.0 - 1e-6)).ceil() / 100.0;
        let element = self.element;
        write!(
            f,
            "the lens opens to f/{f_number} at most: elements[{element}] ends wider beams on the axis"
        )
    }
}
