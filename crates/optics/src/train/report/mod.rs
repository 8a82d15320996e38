//! Everything that is known about a lens, in one piece: for tables, JSON and drawings.
//!
//! What people and editors write beside the format of lens and scene files.

mod table;

use etendue_report::Refusal;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::analysis::{
    FieldDistortion, FieldIllumination, Spot, colour_shifts, distortion, half_field, illumination,
    image_circle, spot,
};
use super::{FieldSpec, Focus, MonochromaticTrain, OpticalTrain, Paraxial, VignettingSpec};
use crate::glass::{FRAUNHOFER_C, FRAUNHOFER_D, FRAUNHOFER_F};

/// Field angles of a lens whose image circle has no end (degrees).
const FIELDS: [f64; 5] = [0.0, 5.0, 10.0, 15.0, 20.0];

/// Shares of the field of view at which a lens is looked at. On its edge there is no light left.
const SHARES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 0.9];

/// Field angles from here on come from behind (degrees).
const WIDEST: f64 = 180.0;

/// Inputs of a lens report.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Inquiry {
    /// Wavelengths of the chromatic shifts (nm); the F, d and C lines, where the glasses have an
    /// index, and the design wavelength when absent.
    pub wavelengths: Option<Vec<f64>>,
    /// Field angles (degrees); shares of the field of view when absent.
    pub fields: Option<Vec<f64>>,
    /// Fields as the lens' file states them: those whose pupil vignetting makes smaller are looked at over that, too.
    pub stated: Vec<FieldSpec>,
    /// Focus setting, which places the sensor.
    pub focus: Focus,
}

/// Report of what is known about a lens.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LensReport {
    /// Name of the lens; empty when its file does not say.
    pub name: String,
    /// Source of its numbers; empty when its file does not say.
    pub source: String,
    /// The units of all that follows.
    pub units: ReportUnits,
    /// The wavelength of all that names no other (nm).
    pub wavelength: f64,
    /// The elements from the object side.
    pub elements: Vec<ElementRow>,
    /// The index of the aperture stop.
    pub stop: usize,
    /// First-order data.
    pub paraxial: Paraxial,
    /// z of the plane of the spots, distortion and illumination: the sensor's, square to the axis
    /// (mm); `null` when there is no image.
    pub sensor_z: Option<f64>,
    /// Diameter of the circle on the sensor that light reaches (mm); `null` when it has no end.
    pub image_circle: Option<f64>,
    /// Full angle of the light that reaches the image circle's edge (degrees); `null` as above.
    pub field_of_view: Option<f64>,
    /// Field angles (degrees).
    pub fields: Vec<f64>,
    /// Spots at those fields that light reaches.
    pub spots: Vec<Spot>,
    /// Spots over what the file's vignetting factors leave of the pupil, at the fields that have such factors. Rims end
    /// rays here as well.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub vignetted: Vec<VignettedSpot>,
    /// Distortion at those fields whose chief ray arrives.
    pub distortion: Vec<FieldDistortion>,
    /// Relative illumination at those fields whose chief ray arrives.
    pub relative_illumination: Vec<FieldIllumination>,
    /// Each wavelength against the design's.
    pub colour: Vec<ColourRow>,
    /// Glasses and filters that are not stated for one of the wavelengths, in sentences.
    pub out_of_range: Vec<String>,
    /// Notes on what else is odd about the lens, in sentences.
    pub notes: Vec<String>,
}

/// Units of a report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ReportUnits {
    length: &'static str,
    wavelength: &'static str,
    angle: &'static str,
    distortion: &'static str,
    projected_solid_angle: &'static str,
}

const UNITS: ReportUnits = ReportUnits {
    length: "mm",
    wavelength: "nm",
    angle: "degree",
    distortion: "percent",
    projected_solid_angle: "sr",
};

/// An element in a report.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ElementRow {
    /// Its kind, as in a lens file.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// z of its vertex (mm).
    pub z: f64,
    /// Its radius of curvature (mm), for a thin lens its focal length; `null` when flat.
    pub radius: Option<f64>,
    /// Its differences from a centred sphere or a round hole, in words; empty when there are none.
    pub shape: String,
    /// To the next element's vertex, behind the last one to the sensor when there is an image (mm).
    pub thickness: Option<f64>,
    /// Name of the medium behind it.
    pub medium: String,
    /// The index of that at the report's wavelength.
    pub index: f64,
    /// Distance from its axis up to which it lets light pass (mm); `null` when unlimited.
    pub semi_diameter: Option<f64>,
}

/// A spot over what vignetting factors leave of a pupil.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct VignettedSpot {
    /// The share of the whole pupil's area that the factors leave.
    pub stated: f64,
    /// The share of the whole pupil's rays that the rims let through.
    pub passed: f64,
    /// The spot.
    #[serde(flatten)]
    pub spot: Spot,
}

/// A wavelength against the design's.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ColourRow {
    /// The wavelength (nm).
    pub wavelength: f64,
    /// Its back focal length less that of the design wavelength (mm).
    pub longitudinal: Option<f64>,
    /// Its chief ray's height less that of the design wavelength (mm), one for each of the report's
    /// fields; `null` where a chief ray does not arrive.
    pub lateral: Vec<Option<f64>>,
    /// First-order data.
    pub paraxial: Paraxial,
}

impl LensReport {
    /// Looks at a lens from all sides.
    ///
    /// # Errors
    ///
    /// When a wavelength or field is none, a focus asked for cannot be had, or a glass has no index
    /// at a wavelength asked for. A lens without image is no error: `notes` say what is missing.
    pub fn new(train: &OpticalTrain, inquiry: &Inquiry) -> Result<Self, Refusal> {
        let at = train.at(train.wavelength())?;
        let paraxial = train.paraxial(train.wavelength())?;
        let wavelengths = inquiry.wavelengths(train)?;
        let mut notes = train.notes().to_vec();
        notes.extend(train.first_array().map(|array| {
            format!(
                "elements[{array}] is a microlens array: paraxial data are those of the lens without \
                 it; rays do meet its lenslets"
            )
        }));
        // Where the sensor stands; a lens as written may go without.
        let sensor_z = match (train.sensor_z(inquiry.focus), inquiry.focus) {
            (Ok(z), _) => Some(z),
            (Err(error), Focus::AsWritten) => {
                let why = crate::sentence(&error);
                notes.push(format!("no spots, distortion or illumination: {why}"));
                None
            }
            (Err(error), _) => return Err(error.into()),
        };
        // What of the field reaches the sensor, and the fields to look at.
        let circle = sensor_z.and_then(|z| image_circle(train, &at, z, farthest(train, z)));
        let half_field = sensor_z.zip(circle).and_then(|(z, r)| half_field(train, &at, z, r));
        let fields = inquiry.fields(half_field)?;
        // The lens by itself, and then what arrives on the sensor.
        let mut report = Self {
            name: train.name().to_owned(),
            source: train.source().to_owned(),
            units: UNITS,
            wavelength: train.wavelength(),
            elements: rows(train, &at, sensor_z),
            stop: train.stop(),
            paraxial,
            sensor_z,
            image_circle: circle.map(|radius| 2.0 * radius),
            field_of_view: half_field.map(|half| 2.0 * half),
            colour: colour(train, &wavelengths, &fields, sensor_z)?,
            fields,
            spots: Vec::new(),
            vignetted: Vec::new(),
            distortion: Vec::new(),
            relative_illumination: Vec::new(),
            out_of_range: out_of_range(train, &wavelengths),
            notes,
        };
        if let Some(z) = sensor_z {
            report.look_at_fields(train, &at, &inquiry.stated, z);
        }
        report.note_missing_spots();
        Ok(report)
    }

    fn look_at_fields(
        &mut self,
        train: &OpticalTrain,
        at: &MonochromaticTrain,
        stated: &[FieldSpec],
        z: f64,
    ) {
        for &field in &self.fields {
            let whole = spot(train, at, &FieldSpec::at(field), z);
            let is_vignetted = |own: &&FieldSpec| {
                own.angle.0 == field && own.vignetting != VignettingSpec::default()
            };
            if let Some(own) = stated.iter().find(is_vignetted) {
                let passed = whole.as_ref().map_or(0.0, Spot::passed);
                let stated = own.vignetting.area();
                let spot = spot(train, at, own, z);
                self.vignetted.extend(spot.map(|spot| VignettedSpot { stated, passed, spot }));
            }
            self.spots.extend(whole);
            self.distortion.extend(distortion(train, at, field, z));
        }
        self.relative_illumination = illumination(train, at, &self.fields, z);
    }

    fn note_missing_spots(&mut self) {
        if self.paraxial.entrance_pupil.diameter == Some(0.0) {
            self.notes.push(format!(
                "the stop elements[{}] is closed: no light passes the lens, so there are no spots \
                 and no f-number",
                self.stop
            ));
        }
        if self.paraxial.entrance_pupil.diameter.is_none() && self.sensor_z.is_some() {
            self.notes.push(match self.paraxial.entrance_pupil.z {
                Some(_) => "no spots: nothing limits the beam; give the stop a radius, or a \
                            surface a semi_diameter"
                    .to_owned(),
                None => "no spots: the entrance pupil is at infinity, and they are taken over its \
                         plane"
                    .to_owned(),
            });
        }
    }
}

impl Inquiry {
    fn wavelengths(&self, train: &OpticalTrain) -> Result<Vec<f64>, Refusal> {
        let design = train.wavelength();
        let Some(wavelengths) = &self.wavelengths else {
            let has_index = |nm: f64| train.media().iter().all(|glass| glass.index(nm).is_ok());
            let mut lines = vec![FRAUNHOFER_F, FRAUNHOFER_D, FRAUNHOFER_C];
            if !lines.contains(&design) {
                lines.push(design);
            }
            lines.retain(|&nm| has_index(nm));
            lines.sort_by(f64::total_cmp);
            return Ok(lines);
        };
        match wavelengths.iter().find(|nm| !(**nm > 0.0 && nm.is_finite())) {
            Some(&wrong) => {
                Err(format!("the wavelength {wrong} nm is none; it must be positive").into())
            }
            None => Ok(wavelengths.clone()),
        }
    }

    fn fields(&self, half_field: Option<f64>) -> Result<Vec<f64>, Refusal> {
        let Some(fields) = &self.fields else {
            return Ok(match half_field {
                Some(half) => SHARES.map(|share| rounded(share * half)).to_vec(),
                None => FIELDS.to_vec(),
            });
        };
        match fields.iter().find(|field| field.is_nan() || field.abs() >= WIDEST) {
            Some(&wrong) => {
                let why = format!("the field angle {wrong} degrees must lie between -180 and 180");
                Err(why.into())
            }
            None => Ok(fields.clone()),
        }
    }
}

/// Three significant digits: angles that are chosen need no more.
fn rounded(angle: f64) -> f64 {
    format!("{angle:.2e}").parse().unwrap_or(angle)
}

/// A radius on the sensor that no sensible image circle has (mm).
fn farthest(train: &OpticalTrain, sensor_z: f64) -> f64 {
    let behind = (sensor_z - train.last_vertex()).abs();
    4.0 * (behind + train.last_vertex().abs() + train.lateral_scale())
}

/// Notes on glasses whose index is not stated for the design wavelength, or for another one.
fn out_of_range(train: &OpticalTrain, wavelengths: &[f64]) -> Vec<String> {
    train.outside_of_range(&[&[train.wavelength()], wavelengths].concat())
}

fn colour(
    train: &OpticalTrain,
    wavelengths: &[f64],
    fields: &[f64],
    sensor_z: Option<f64>,
) -> Result<Vec<ColourRow>, Refusal> {
    let (seen, z) = match sensor_z {
        Some(z) => (fields, z),
        None => (&[][..], 0.0),
    };
    let shifts = colour_shifts(train, wavelengths, seen, z)?;
    let row = |shift: super::analysis::ColourShift| {
        Ok(ColourRow {
            wavelength: shift.wavelength,
            longitudinal: shift.longitudinal,
            lateral: shift.lateral,
            paraxial: train.paraxial(shift.wavelength)?,
        })
    };
    shifts.into_iter().map(row).collect()
}

fn rows(train: &OpticalTrain, at: &MonochromaticTrain, sensor_z: Option<f64>) -> Vec<ElementRow> {
    let finite = |length: f64| length.is_finite().then_some(length);
    let elements = train.elements();
    let row = |(i, element): (usize, &super::Element)| {
        let z = element.frame.vertex.z;
        let next = elements.get(i + 1).map(|next| next.frame.vertex.z).or(sensor_z);
        ElementRow {
            kind: element.part.type_name(),
            z,
            radius: finite(element.part.radius()),
            shape: shape_of(element),
            thickness: next.map(|next| next - z),
            medium: train.media()[i + 1].name.clone(),
            index: at.index_behind(i),
            semi_diameter: finite(element.clear_radius()),
        }
    };
    elements.iter().enumerate().map(row).collect()
}

/// A word on how an element differs from a centred sphere or a round hole; empty when it does not.
fn shape_of(element: &super::Element) -> String {
    let mut words = element.part.shape();
    if !element.frame.is_axial() {
        words.push("tilted or decentred".to_owned());
    }
    words.join(", ")
}

/// Keys that mean nothing, anywhere: what an editor completes by, and what a person remarks.
pub const NOTES: [&str; 2] = ["$schema", "comment"];

/// The one object whose keys are other people's words and whose values are strings: the materials of a model
/// that an object of a scene replaces.
const FOREIGN: &str = "materials";

/// Takes the keys of [`NOTES`] out of all objects, where their values are text or lists of text. Returns
/// whether there were any.
pub fn remove_notes(value: &mut Value) -> bool {
    match value {
        Value::Object(members) => {
            let count = members.len();
            members.retain(|key, member| !(NOTES.contains(&key.as_str()) && is_text(member)));
            let mut is_changed = members.len() < count;
            for (key, member) in members {
                if !(key == FOREIGN && has_only_text(member)) {
                    is_changed |= remove_notes(member);
                }
            }
            is_changed
        }
        Value::Array(elements) => elements
            .iter_mut()
            .fold(false, |is_changed, element| remove_notes(element) | is_changed),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => false,
    }
}

fn is_text(value: &Value) -> bool {
    match value {
        Value::String(_) => true,
        Value::Array(lines) => lines.iter().all(Value::is_string),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::Object(_) => false,
    }
}

fn has_only_text(value: &Value) -> bool {
    value.as_object().is_some_and(|members| members.values().all(Value::is_string))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn remarks_go_and_names_stay() {
        let mut value = json!({
            "$schema": "scene.schema.json", "comment": ["two", "lines"],
            "camera": {"comment": "mine", "fov": 3},
            "objects": [{"comment": "x", "materials": {"comment": "clay"}}],
            "materials": {"comment": {"type": "matte"}, "clay": {"comment": "y", "type": "matte"}}
        });
        assert!(remove_notes(&mut value));
        assert_eq!(
            value,
            json!({
                "camera": {"fov": 3},
                "objects": [{"materials": {"comment": "clay"}}],
                "materials": {"comment": {"type": "matte"}, "clay": {"type": "matte"}}
            })
        );
        assert!(!remove_notes(&mut value));
    }
}
