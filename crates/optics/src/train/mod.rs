//! Elements one behind the other: a lens.
//!
//! | module | idea |
//! |---|---|
//! | [`file`](mod@file) | the lens file; given rays, point by point |
//! | [`trace`] | rays through the train, in batches or one by one |
//! | [`lenslets`] | arrays of lenslets: the lens without them, and the lens as each lenslet sees it |
//! | [`paraxial`] | focal lengths, principal planes and pupils |
//! | [`focus`] | where the sensor goes |
//! | [`folds`] | mirrors: the built lens, and what is in the way of its light |
//! | [`opening`] | the widest beam that the rims let through |
//! | [`aim`] | chief rays: aimed at the stop's centre |
//! | [`analysis`] | spots, distortion, relative illumination, colour |
//! | [`optical_path`] | optical path lengths along rays |
//! | [`pupil`] | the exit pupil as seen from the sensor, and samples of it |
//! | [`report`] | all of it in one piece |
//! | `behind` | gradients of a lens file's glass, and axes that break |
//! | [`drawing`] | pictures of it |
//! | [`zemax`] | lenses from Zemax files |

pub mod aim;
pub mod analysis;
mod behind;
pub mod differential;
pub mod drawing;
mod error;
pub mod fields;
pub mod file;
mod file_fields;
pub mod focus;
pub mod folds;
pub mod lenslets;
pub mod opening;
pub mod optical_path;
pub mod paraxial;
pub mod pupil;
pub mod report;
pub mod trace;
pub mod zemax;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::element::shapes::SMALLEST_RADIUS;
use crate::element::{Frame, GradedGap, LossesSpec, Symbol, ThinLens};
use crate::glass::{Glass, GlassError};
use etendue_geometry::units::{Degrees, Millimetres};

pub use crate::element::Part;
pub use aim::ChiefRay;
pub use differential::RayDifferential;
pub use error::{LensError, MOST_ELEMENTS};
pub use fields::{FieldSpec, VignettingSpec};
pub use file::{GivenRay, LensFile, RayError, RaysFile, TracedRays};
pub use focus::{Focus, FocusError};
pub use folds::Isometry;
pub use lenslets::BehindLenslets;
pub use opening::WidestOpening;
pub use paraxial::{Paraxial, Pupil};
pub use pupil::{ExitPupil, PupilSample};
pub use report::{Inquiry, LensReport, NOTES, remove_notes};
pub use trace::{MonochromaticTrain, RayPath, Registers, RimTrace, Side};
pub use zemax::{LensFormat, ZemaxError, ZemaxLens};

/// A part at its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    /// Kind of the element, with its data.
    pub part: Part,
    /// Position and rotation in lens coordinates (mm).
    pub frame: Frame,
}

/// Mount of a sensor in its lens.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensorMount {
    /// Turns about the x axis and then about the sensor's own y axis (degrees), right-handed.
    pub tilt: [Degrees; 2],
    /// Moved across the axis by x and y (mm).
    pub decentre: [Millimetres; 2],
}

/// A lens. Lengths are millimetres, z = 0 is the first element's vertex and +z runs from the object
/// to the sensor; elements count from 0 on the object side.
#[derive(Debug, Clone, PartialEq)]
pub struct OpticalTrain {
    pub(crate) name: String,
    pub(crate) source: String,
    pub(crate) elements: Vec<Element>,
    /// One more than elements: `media[i]` is before element `i`.
    pub(crate) media: Vec<Glass>,
    /// Change of the index of each of them from place to place.
    pub(crate) gradients: Vec<Option<GradedGap>>,
    pub(crate) stop: usize,
    pub(crate) wavelength: f64,
    pub(crate) end: f64,
    pub(crate) sensor: SensorMount,
    pub(crate) losses: LossesSpec,
    pub(crate) notes: Vec<String>,
}

impl OpticalTrain {
    /// Name of the lens; empty when the file does not give one.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Source of the numbers; empty when the file does not give one.
    #[must_use]
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The elements.
    #[must_use]
    pub fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// The medium before element `i`; `media()[elements().len()]` is before the sensor.
    #[must_use]
    pub fn media(&self) -> &[Glass] {
        &self.media
    }

    /// The index of the aperture stop.
    #[must_use]
    pub fn stop(&self) -> usize {
        self.stop
    }

    /// The wavelength at which the lens is focused and its stop is set (nm).
    #[must_use]
    pub fn wavelength(&self) -> f64 {
        self.wavelength
    }

    /// Notes on oddities of the lens, as sentences: glasses with namesakes, elements that cross,
    /// parts that the paraxial analysis leaves out.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// z of the last element's vertex (mm).
    #[must_use]
    pub fn last_vertex(&self) -> f64 {
        self.elements.last().map_or(0.0, |e| e.frame.vertex.z)
    }

    /// True if a turn about the axis changes nothing: everything centred, untilted and round.
    #[must_use]
    pub fn is_rotationally_symmetric(&self) -> bool {
        self.sensor == SensorMount::default() && self.elements.iter().all(Element::is_symmetric)
    }

    /// True if nothing in the train has aberrations: thing in it aberrates: thin lenses and sheets,
    /// centred and square to the axis.
    #[must_use]
    pub fn is_ideal(&self) -> bool {
        let is_ideal = |e: &Element| e.frame.is_axial() && e.part.is_ideal();
        self.sensor.tilt == SensorMount::default().tilt && self.elements.iter().all(is_ideal)
    }

    /// Returns the lens with an ideal lens behind it, at whose focal length (mm) the sensor stands:
    /// angles become lengths, and images at infinity are near.
    #[must_use]
    pub fn with_eyepiece(mut self, focal_length: f64) -> Self {
        let z = self.last_vertex();
        let part =
            Part::ThinLens(ThinLens { power: 1.0 / focal_length, semi_diameter: f64::INFINITY });
        self.elements.push(Element { part, frame: Frame::on_axis(z) });
        self.media.extend(self.media.last().cloned());
        self.gradients.extend(self.gradients.last().cloned());
        self.end = z + focal_length;
        self
    }

    /// Losses of light in the glass and at its surfaces.
    #[must_use]
    pub fn losses(&self) -> &LossesSpec {
        &self.losses
    }

    /// True if rays of different wavelengths take different paths.
    #[must_use]
    pub fn is_dispersive(&self) -> bool {
        let diffracts =
            |element: &Element| matches!(&element.part, Part::Freeform(f) if f.is_dispersive());
        self.media.iter().any(Glass::is_dispersive) || self.elements.iter().any(diffracts)
    }

    /// Sentences on glasses and filters that are not known at some of `wavelengths` (nm), one for
    /// each: what is traced there is their formula or their last value held.
    #[must_use]
    pub fn outside_of_range(&self, wavelengths: &[f64]) -> Vec<String> {
        let mut notes = Vec::new();
        let mut tell = |known: String, [from, to]: [f64; 2]| {
            // The wavelengths that lie outside, in few words.
            let mut outside: Vec<f64> = wavelengths.to_vec();
            outside.retain(|nm| !(*nm >= from && *nm <= to));
            outside.sort_by(f64::total_cmp);
            outside.dedup();
            let those = match outside[..] {
                [] => return,
                [one] => format!("{one} nm lies"),
                [one, other] => format!("{one} and {other} nm lie"),
                [first, .., last] => {
                    format!("{} wavelengths from {first} to {last} nm lie", outside.len())
                }
            };
            let note = format!("{known} from {from} to {to} nm, and {those} outside");
            if !notes.contains(&note) {
                notes.push(note);
            }
        };
        // Of all glasses and filters.
        for glass in &self.media {
            match glass.states_range() {
                true => tell(format!("glass {} is known", glass.name), glass.range),
                false => {
                    let known = format!("glass {} states no range, others are known", glass.name);
                    tell(known, Glass::RANGE_OF_ALL);
                }
            }
        }
        for (i, element) in self.elements.iter().enumerate() {
            match &element.part {
                Part::Filter(filter) => {
                    tell(format!("the filter elements[{i}] is known"), filter.range());
                }
                part => {
                    for curve in part.curves() {
                        let known = match part {
                            Part::Mirror(_) => {
                                format!("what the mirror elements[{i}] reflects is known")
                            }
                            _ => format!("a filter of the lenslets elements[{i}] is known"),
                        };
                        tell(known, curve.range());
                    }
                }
            }
        }
        notes
    }

    /// The radius of the stop's opening (mm): of the circle around it when it is not round;
    /// infinite when nothing limits it.
    #[must_use]
    pub fn stop_radius(&self) -> f64 {
        self.elements[self.stop].clear_radius()
    }

    /// Opens or closes the stop to `radius` (mm). An iris stays the polygon that it is.
    ///
    /// # Errors
    ///
    /// When the radius is negative, or the stop is a mask.
    pub fn with_stop_radius(mut self, radius: f64) -> Result<Self, LensError> {
        let index = self.stop;
        let error = |why: &str| LensError::Stop { index, why: why.to_owned() };
        if !(radius >= 0.0 && radius.is_finite()) {
            return Err(error("the radius must be a length from 0 on"));
        }
        self.elements[index].part.set_clear_radius(radius).map_err(error)?;
        Ok(self)
    }

    /// Sets the stop so that the paraxial f-number at the design wavelength is `f_number`: focal
    /// length over the entrance pupil's diameter.
    ///
    /// # Errors
    ///
    /// When the lens has no focal length or no finite entrance pupil, when its other rims cut a beam
    /// that wide ([`Self::widest_opening`]), or as [`Self::with_stop_radius`].
    pub fn with_f_number(self, f_number: f64) -> Result<Self, LensError> {
        let radius = self.stop_radius_at(f_number)?;
        self.check_opening(radius)?;
        let stopped = self.with_stop_radius(radius)?;
        stopped.check_obscuration()?;
        Ok(stopped)
    }

    /// The stop's radius (mm) at a paraxial f-number.
    pub(crate) fn stop_radius_at(&self, f_number: f64) -> Result<f64, LensError> {
        let error = |why: &str| LensError::Stop { index: self.stop, why: why.to_owned() };
        let paraxial = self.paraxial(self.wavelength).map_err(|e| error(&e.to_string()))?;
        let (Some(efl), Some(magnification)) = (paraxial.efl, paraxial.stop_magnification) else {
            return Err(error("a lens without focal length or entrance pupil has no f-number"));
        };
        if !(f_number > 0.0 && f_number.is_finite()) {
            return Err(error("the f-number must be positive"));
        }
        let radius = 0.5 * efl.abs() / f_number * magnification.abs();
        if radius < SMALLEST_RADIUS {
            let why = format!("f/{f_number} would leave an opening of {radius:.1e} mm");
            return Err(error(&why));
        }
        Ok(radius)
    }

    /// Sets the design wavelength (nm), at which the lens is analysed, focused and its stop set.
    ///
    /// # Errors
    ///
    /// When it is no wavelength.
    pub fn with_wavelength(mut self, wavelength: f64) -> Result<Self, LensError> {
        if !(wavelength > 0.0 && wavelength.is_finite()) {
            return Err(LensError::Wavelength(wavelength));
        }
        self.wavelength = wavelength;
        Ok(self)
    }

    /// Sets the losses of light in the glass and at its surfaces.
    #[must_use]
    pub fn with_losses(mut self, losses: LossesSpec) -> Self {
        self.losses = losses;
        self
    }

    /// Replaces the mounting of the sensor, if one is given.
    #[must_use]
    pub fn with_sensor(mut self, mount: Option<SensorMount>) -> Self {
        self.sensor = mount.unwrap_or(self.sensor);
        self
    }

    /// Sets the stop, or finds the element that limits the beam from infinity on the axis, and
    /// gathers the notes.
    pub(crate) fn with_stop(mut self, stop: Option<usize>) -> Result<Self, LensError> {
        self.stop = match stop {
            Some(stop) => stop,
            None => self
                .limiting_element()
                .map_err(|(index, source)| LensError::Glass { index, source })?,
        };
        self.notes = self.oddities();
        Ok(self)
    }

    /// The element whose clear radius is the least share of the height at which a paraxial ray
    /// from infinity passes.
    fn limiting_element(&self) -> Result<usize, (usize, GlassError)> {
        let heights = self.heights_from_infinity(self.wavelength)?;
        let share = |i: usize| self.elements[i].clear_radius() / heights[i].abs();
        Ok((0..self.elements.len()).min_by(|&a, &b| share(a).total_cmp(&share(b))).unwrap_or(0))
    }

    pub(crate) fn oddities(&self) -> Vec<String> {
        let mut notes = Vec::new();
        // Glasses that several makers have.
        for glass in self.media.iter().filter(|g| !g.namesakes.is_empty()) {
            let others = glass.namesakes.join(" and ");
            let note = format!(
                "glass {} is taken from {}; {others} also make one (write \"{}:{}\")",
                glass.name, glass.source, glass.namesakes[0], glass.name
            );
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        for (i, element) in self.elements.iter().enumerate() {
            let (rim, domain) = (element.clear_radius(), element.part.domain());
            if rim.is_finite() && rim > domain {
                notes.push(format!(
                    "elements[{i}] has a semi_diameter of {rim} mm, and its surface ends {domain} mm \
                     from the axis: rays beyond miss it"
                ));
            }
        }
        // Elements that run into one another, and a stop that is not filled.
        notes.extend(self.crossings());
        notes.extend(self.unfilled_stop());
        notes.extend(self.sensor_in_the_light());
        if self.is_folded() {
            notes.push(
                "the lens has mirrors: places and directions are unfolded, z counts along the way of light"
                    .to_owned(),
            );
        }
        if self.elements.iter().any(|e| matches!(e.part, Part::CoordinateBreak(_))) {
            notes.push(
                "the axis breaks: places and directions behind a coordinate_break are told along the new axis"
                    .to_owned(),
            );
        }
        if !self.elements.iter().all(|e| e.frame.is_axial()) {
            notes.push(
                "the paraxial analysis leaves tilts and decentrings out; rays do not".to_owned(),
            );
        }
        notes
    }

    /// Neighbouring surfaces that cut through each other inside their clear apertures.
    fn crossings(&self) -> Vec<String> {
        /// As many are named one by one.
        const NAMED: usize = 3;
        let all: Vec<(usize, f64)> =
            (1..self.elements.len()).filter_map(|i| Some((i - 1, self.crossing(i - 1)?))).collect();
        let named = all.iter().take(NAMED).map(|&(i, r)| {
            format!(
                "elements[{i}] and elements[{}] cut through each other {r:.3} mm from the axis: rays \
                 beyond miss the second",
                i + 1
            )
        });
        let others = all.len().saturating_sub(NAMED);
        let others = (others > 0).then(|| match others {
            1 => "another pair of neighbours does so, too".to_owned(),
            _ => format!("{others} more pairs of neighbours do so, too"),
        });
        named.chain(others).collect()
    }

    /// Distance from the axis (mm) at which element `i` and the next cut through each other, if
    /// they do.
    fn crossing(&self, i: usize) -> Option<f64> {
        let pair = self.elements.get(i..i + 2)?;
        let [a, b] = [&pair[0].part, &pair[1].part];
        let reach = a.clear_radius().min(b.clear_radius());
        let of_glass =
            [a, b].iter().all(|part| part.symbol() == Symbol::Surface && part.mirror().is_none());
        if !of_glass || !reach.is_finite() || !pair.iter().all(|e| e.frame.is_axial()) {
            return None;
        }
        let thickness = pair[1].frame.vertex.z - pair[0].frame.vertex.z;
        let gap = |place| Some(thickness + b.sag(place)? - a.sag(place)?);
        let is_cut = |place| gap(place).is_some_and(|gap| gap < 0.0);
        let mut heights = (0..=64).map(|step| reach * f64::from(step) / 64.0);
        heights.find(|&r| is_cut([0.0, r]) || is_cut([r, 0.0]))
    }
}

impl Element {
    /// Radius around its axis within which the element passes light (mm); infinite when unlimited.
    #[must_use]
    pub fn clear_radius(&self) -> f64 {
        self.part.clear_radius()
    }

    fn is_symmetric(&self) -> bool {
        self.part.is_round() && self.frame.is_axial()
    }
}
