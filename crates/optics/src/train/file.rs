//! The lens file: elements from the object side to the sensor, in millimetres.
//!
//! Rays given one by one, and their way through a lens point by point: what is compared with other
//! optical software.

use std::borrow::Cow;
use std::fmt;

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    Element, FieldSpec, LensError, MOST_ELEMENTS, MonochromaticTrain, OpticalTrain, RayPath,
    SensorMount, Side, remove_notes,
};
use crate::element::{
    Clip, ElementSpec, Frame, GradedGap, LossesSpec, Part, PartSpec, RayStatus, Resolve,
};
use crate::glass::{AgfCatalogue, FRAUNHOFER_D, Glass, GlassError};
use etendue_geometry::units::{Degrees, Nanometres};

/// A lens as its file writes it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LensFile {
    /// Name of the lens.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Source of the numbers.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub source: String,
    /// The parts from the object side to the sensor.
    pub elements: Vec<ElementSpec>,
    /// The wavelength at which the lens is focused and its stop is set (nm); helium's d line when
    /// absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelength: Option<Nanometres>,
    /// The field points that it is looked at by `etendue lens`; shares of the field of view when absent.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fields: Vec<FieldSpec>,
    /// The wavelengths that it is looked at (nm), the main one first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub wavelengths: Vec<Nanometres>,
    /// Weight of each of those; alike when absent.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub weights: Vec<f64>,
    /// Mount of the sensor: tilted for Scheimpflug's rule, decentred for shift.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor: Option<SensorMount>,
    /// Catalogues of glasses in Zemax' AGF format, by their paths from the lens file's folder; the last
    /// is asked first, the built-in catalogue last.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub glass_catalogs: Vec<String>,
}

impl LensFile {
    /// A lens of the given elements.
    #[must_use]
    pub fn new(elements: Vec<ElementSpec>) -> Self {
        Self { elements, ..Self::default() }
    }

    /// Reads a lens file's text.
    ///
    /// # Errors
    ///
    /// [`LensError::Json`], with line and column of a file without notes.
    pub fn from_json(text: &str) -> Result<Self, LensError> {
        let json = |error: serde_json::Error| LensError::Json(error.to_string());
        // As it stands, so that an error has its line, unless notes are to be left out.
        serde_json::from_str(text).or_else(|error| {
            let mut value = serde_json::from_str(text).map_err(json)?;
            let file = match remove_notes(&mut value) {
                true => serde_json::from_value(value),
                false => Err(error),
            };
            file.map_err(json)
        })
    }

    /// The lens, ready to be traced. `resolve` turns the names of the lens file's own files (masks)
    /// into paths.
    ///
    /// # Errors
    ///
    /// When an element or a glass is not one; the error names the element.
    pub fn build(&self, resolve: Resolve<'_>) -> Result<OpticalTrain, LensError> {
        if self.elements.is_empty() {
            return Err(LensError::Empty);
        }
        if self.elements.len() > MOST_ELEMENTS {
            return Err(LensError::TooMany(self.elements.len()));
        }
        self.check_fields()?;
        let main = self.wavelength.or(self.wavelengths.first().copied());
        let wavelength = main.map_or(FRAUNHOFER_D, |nm| nm.0);
        if !(wavelength > 0.0 && wavelength.is_finite()) {
            return Err(LensError::Wavelength(wavelength));
        }
        // Elements one after the other, each with the medium behind it.
        // The lens file's own catalogues before those of its user.
        let own = self.catalogues(resolve)?;
        let catalogues = match own.is_empty() {
            true => Cow::Borrowed(resolve.glasses()),
            false => Cow::Owned([resolve.glasses(), &own].concat()),
        };
        let (mut media, mut gradients) = (vec![Glass::air()], vec![None::<GradedGap>]);
        let mut elements = Vec::with_capacity(self.elements.len());
        // Files count along the axis as it is built, trains along the way of light.
        let (mut z, mut sense) = (0.0, 1.0);
        for (index, spec) in self.elements.iter().enumerate() {
            let error = |why| LensError::Element { index, why };
            let mut element = place(spec, z, sense, resolve).map_err(error)?;
            if let PartSpec::CoordinateBreak(broken) = &spec.part {
                let turn = self.axis_behind(index, broken, z, sense, &elements).map_err(error)?;
                element = Element { part: Part::CoordinateBreak(turn), frame: Frame::on_axis(z) };
            }
            if element.part.mirror().is_some() {
                sense = -sense;
                check_gap(spec.mount.thickness.0, sense).map_err(error)?;
            }
            elements.push(element);
            let mut medium = behind(spec, index, &media, &catalogues)?;
            // A sheet stands in what began farther in front.
            let mut graded = match spec.part.medium_behind() {
                None => gradients[index].clone(),
                Some(_) => None,
            };
            if index > 0 {
                let gap = z - elements[index - 1].frame.vertex.z;
                graded = graded.map(|gradient| gradient.behind(gap));
            }
            if let Some(gradient) = self.gradient(index, &medium, wavelength)? {
                graded = Some(GradedGap { gradient: gradient.into(), offset: 0.0, sense });
                medium.name.push_str(", graded");
            }
            media.push(medium);
            gradients.push(graded);
            z += sense * spec.mount.thickness.0;
        }
        let sensor = self.sensor.unwrap_or_default();
        let sensor =
            SensorMount { tilt: sensor.tilt.map(|angle| Degrees(along(sense, angle.0))), ..sensor };
        let train = OpticalTrain {
            name: self.name.clone(),
            source: self.source.clone(),
            elements,
            media,
            gradients,
            stop: 0,
            wavelength,
            end: z,
            sensor,
            losses: LossesSpec::default(),
            notes: Vec::new(),
        };
        train.with_stop(self.stop()?)
    }

    fn catalogues(&self, resolve: Resolve<'_>) -> Result<Vec<AgfCatalogue>, LensError> {
        let read = |(index, name): (usize, &String)| {
            resolve
                .path(name)
                .and_then(|path| {
                    AgfCatalogue::open(&path).map_err(|error| format!("{name}: {error}"))
                })
                .map_err(|why| LensError::Key { key: format!("glass_catalogs[{index}]"), why })
        };
        self.glass_catalogs.iter().enumerate().map(read).collect()
    }

    /// The element marked as the stop, or the only aperture.
    fn stop(&self) -> Result<Option<usize>, LensError> {
        let indices = |wanted: &dyn Fn(&ElementSpec) -> bool| -> Vec<usize> {
            (0..self.elements.len()).filter(|&i| wanted(&self.elements[i])).collect()
        };
        let marked = indices(&|e| e.mount.stop);
        let apertures = indices(&|e| matches!(e.part, PartSpec::Aperture(_)));
        match (marked.as_slice(), apertures.as_slice()) {
            (&[first, second, ..], _) => Err(LensError::Stops { first, second }),
            (&[stop], _) | (&[], &[stop]) => Ok(Some(stop)),
            _ => Ok(None),
        }
    }
}

/// A number that changes its sign where light runs against the axis; 0 keeps its own.
pub(super) fn along(sense: f64, value: f64) -> f64 {
    if value == 0.0 { value } else { sense * value }
}

/// Refuses a gap behind a mirror that light does not run along.
fn check_gap(thickness: f64, sense: f64) -> Result<(), String> {
    if thickness * sense >= 0.0 {
        return Ok(());
    }
    let way = if sense < 0.0 { "towards smaller z" } else { "towards greater z" };
    Err(format!(
        "thickness is {thickness} mm, and behind this mirror light runs {way}: write {}",
        -thickness
    ))
}

/// An element where `sense` is −1 if light runs against the axis there.
fn place(spec: &ElementSpec, z: f64, sense: f64, resolve: Resolve<'_>) -> Result<Element, String> {
    let part = spec.part.build(resolve)?;
    let part = if sense < 0.0 { part.flipped() } else { part };
    let tilt = spec.mount.tilt.map(|angle| along(sense, angle.0));
    let decentre = spec.mount.decentre.map(|length| length.0);
    let numbers = [spec.mount.thickness.0, tilt[0], tilt[1], decentre[0], decentre[1]];
    if numbers.iter().any(|number| !number.is_finite()) {
        return Err("thickness, tilt and decentre must be finite".to_owned());
    }
    if let Some(angle) = tilt.iter().find(|angle| angle.abs() > WHOLE_TURN) {
        return Err(format!("tilt has {angle} degrees; an angle lies between -360 and 360"));
    }
    Ok(Element { part, frame: Frame::placed(z, decentre, tilt) })
}

/// The medium behind an element: a surface's glass or air, and what was there for a sheet. Faces of
/// lenslets are surfaces.
fn behind(
    spec: &ElementSpec,
    index: usize,
    media: &[Glass],
    catalogues: &[AgfCatalogue],
) -> Result<Glass, LensError> {
    match spec.part.medium_behind() {
        Some(Some(glass)) => {
            glass.resolve_in(catalogues).map_err(|source| LensError::Glass { index, source })
        }
        Some(None) => Ok(Glass::air()),
        None => Ok(media[index].clone()),
    }
}

/// Angles beyond one turn (degrees) are slips: of great ones no digit is left of where they point.
pub(super) const WHOLE_TURN: f64 = 360.0;

/// The farthest that a ray may start (mm). A double's steps are a tenth of a millimetre there.
const FARTHEST: f64 = 1e15;

/// The most sentences on wavelengths out of range.
const MOST_NOTED: usize = 20;

/// Rays as their file writes them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RaysFile {
    /// The side of the lens that the rays come from.
    pub from: Side,
    /// True if semi-diameters, apertures and opaque filters stop rays.
    pub clip: bool,
    /// The rays.
    pub rays: Vec<GivenRay>,
}

/// One ray.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GivenRay {
    /// Its start, in lens coordinates (mm).
    pub origin: [f64; 3],
    /// Its direction, of any length but 0.
    pub direction: [f64; 3],
    /// Its wavelength in air (nm).
    pub wavelength: f64,
}

/// Outcomes of rays, in their order.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TracedRays {
    /// One for each ray.
    pub rays: Vec<TracedRay>,
    /// Glasses and filters that are not stated for one of the rays' wavelengths, in sentences.
    #[serde(skip)]
    pub out_of_range: Vec<String>,
}

/// Outcome of one ray.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TracedRay {
    /// Its status.
    pub status: StatusName,
    /// The element at which it ended, from 0 on the object side; `null` when it exited.
    pub element: Option<usize>,
    /// Its intersections with the elements that it reached (mm), in their order along it.
    pub points: Vec<[f64; 3]>,
    /// Its unit direction behind the last element; `null` unless it exited.
    pub direction: Option<[f64; 3]>,
}

/// A status without its element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StatusName {
    /// It left the lens.
    Exited,
    /// It does not meet the element.
    Missed,
    /// It met the element from the denser side at too small an angle.
    TotalInternalReflection,
    /// It met the element where that is opaque.
    Vignetted,
}

/// A ray that cannot be traced.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("rays[{index}].{key}: {why}")]
pub struct RayError {
    /// Index of the ray, from 0.
    pub index: usize,
    /// Its key.
    pub key: &'static str,
    /// Description of the error, and of what is valid.
    pub why: String,
}

impl OpticalTrain {
    /// Traces each ray of a file.
    ///
    /// # Errors
    ///
    /// When a ray has no direction, no finite place or no wavelength, or a glass has no index at its
    /// wavelength.
    pub fn trace_file(&self, file: &RaysFile) -> Result<TracedRays, RayError> {
        let clip = if file.clip { Clip::On } else { Clip::Off };
        let mut rays = Vec::with_capacity(file.rays.len());
        let mut lens: Option<MonochromaticTrain> = None;
        let mut wavelengths: Vec<f64> = Vec::new();
        for (index, ray) in file.rays.iter().enumerate() {
            let error = |(key, why)| RayError { index, key, why };
            let [origin, direction] = ray.checked().map_err(error)?;
            // Files are mostly sorted by wavelength.
            let known = lens.take().filter(|at| at.wavelength() == ray.wavelength);
            let at = match known {
                Some(at) => at,
                None => {
                    if wavelengths.len() < MOST_NOTED && !wavelengths.contains(&ray.wavelength) {
                        wavelengths.push(ray.wavelength);
                    }
                    self.at(ray.wavelength)
                        .map_err(|why: GlassError| error(("wavelength", why.to_string())))?
                }
            };
            rays.push(at.path(file.from, clip, origin, direction).into());
            lens = Some(at);
        }
        Ok(TracedRays { rays, out_of_range: self.outside_of_range(&wavelengths) })
    }
}

impl GivenRay {
    /// Its origin and direction, or its key that is wrong and why.
    fn checked(&self) -> Result<[DVec3; 2], (&'static str, String)> {
        let [origin, direction] = [self.origin, self.direction].map(DVec3::from);
        if !origin.abs().cmple(DVec3::splat(FARTHEST)).all() {
            let why = format!(
                "{:?} is farther than {FARTHEST:e} mm; start the ray nearer to the lens",
                self.origin
            );
            return Err(("origin", why));
        }
        if !direction.is_finite() || direction == DVec3::ZERO {
            let why = format!("{:?} is no direction; it must be finite and not 0", self.direction);
            return Err(("direction", why));
        }
        if !(self.wavelength > 0.0 && self.wavelength.is_finite()) {
            let why = format!("{} nm is no wavelength; it must be positive", self.wavelength);
            return Err(("wavelength", why));
        }
        Ok([origin, direction])
    }
}

impl From<RayPath> for TracedRay {
    fn from(path: RayPath) -> Self {
        let status = match path.status {
            RayStatus::Exited => StatusName::Exited,
            RayStatus::Missed { .. } => StatusName::Missed,
            RayStatus::TotalInternalReflection { .. } => StatusName::TotalInternalReflection,
            RayStatus::Vignetted { .. } => StatusName::Vignetted,
        };
        Self {
            status,
            element: path.status.element(),
            points: path.points.iter().map(DVec3::to_array).collect(),
            direction: path.direction.map(|d| d.to_array()),
        }
    }
}

impl fmt::Display for TracedRays {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = |[x, y, z]: [f64; 3]| format!("({x}, {y}, {z})");
        for (i, ray) in self.rays.iter().enumerate() {
            match ray.element {
                None => writeln!(f, "ray {i}: {}", ray.status)?,
                Some(element) => writeln!(f, "ray {i}: {} element {element}", ray.status)?,
            }
            for point in &ray.points {
                writeln!(f, "  at {}", place(*point))?;
            }
            if let Some(direction) = ray.direction {
                writeln!(f, "  towards {}", place(direction))?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for StatusName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Exited => "exited",
            Self::Missed => "missed",
            Self::TotalInternalReflection => "totally reflected at",
            Self::Vignetted => "vignetted at",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::LensFile;

    fn lens() -> OpticalTrain {
        let file = LensFile::from_json(
            r#"{"elements": [
            {"type": "surface", "radius": 20, "thickness": 4, "glass": "N-BK7",
             "semi_diameter": 8},
            {"type": "surface"}]}"#,
        );
        file.unwrap().build(&|name: &str| Err(name.to_owned())).unwrap()
    }

    fn rays(json: &str) -> RaysFile {
        serde_json::from_str(json).unwrap()
    }

    #[test]
    fn fates_points_and_directions_are_those_of_the_format() {
        let file = rays(
            r#"{"from": "object", "clip": true, "rays": [
            {"origin": [0, 0, -5], "direction": [0, 0, 9], "wavelength": 587.56},
            {"origin": [0, 9, -5], "direction": [0, 0, 1], "wavelength": 486.13},
            {"origin": [0, 25, -5], "direction": [0, 0, 1], "wavelength": 486.13}]}"#,
        );
        let traced = serde_json::to_value(lens().trace_file(&file).unwrap()).unwrap();
        let sag = 20.0 - 319.0_f64.sqrt();
        assert_eq!(traced["rays"][0]["status"], "exited");
        assert_eq!(traced["rays"][0]["element"], serde_json::Value::Null);
        assert_eq!(
            traced["rays"][0]["points"],
            serde_json::json!([[0.0, 0.0, 0.0], [0.0, 0.0, 4.0]])
        );
        assert_eq!(traced["rays"][0]["direction"], serde_json::json!([0.0, 0.0, 1.0]));
        assert_eq!(traced["rays"][1]["status"], "vignetted");
        assert_eq!(traced["rays"][1]["element"], 0);
        let z = traced["rays"][1]["points"][0][2].as_f64().unwrap();
        assert!((z - sag).abs() < 1e-14, "two roundings of a number near 20: {z}");
        assert_eq!(traced["rays"][1]["direction"], serde_json::Value::Null);
        assert_eq!(traced["rays"][2]["status"], "missed");
        assert_eq!(traced["rays"][2]["points"], serde_json::json!([]));
    }

    #[test]
    fn what_is_no_ray_is_refused_by_its_index_and_key() {
        let error = |origin: [f64; 3], direction: [f64; 3], wavelength: f64| {
            let ray = GivenRay { origin, direction, wavelength };
            let file = RaysFile { from: Side::Sensor, clip: false, rays: vec![ray] };
            lens().trace_file(&file).unwrap_err().to_string()
        };
        let (start, along) = ([0.0, 0.0, 9.0], [0.0, 0.0, -1.0]);
        assert!(error([0.0, f64::NAN, 0.0], along, 500.0).starts_with("rays[0].origin"));
        assert!(error([0.0, 1e16, 0.0], along, 500.0).contains("nearer"));
        assert!(error(start, [0.0; 3], 500.0).starts_with("rays[0].direction"));
        assert!(error(start, [0.0, f64::INFINITY, 1.0], 500.0).contains("finite"));
        assert!(error(start, along, 0.0).starts_with("rays[0].wavelength"));
        // On N-BK7's resonance in the infrared.
        assert!(error(start, along, 10_170.0).contains("N-BK7"));
    }
}
