//! Configurations: values that a zoom lens has in each of its positions.
//!
//! `MNUM` has their number and the one that the file stands at, whose values the surfaces have. Each value
//! of each is a line of its own: the operand, its surface or field, the configuration from 1, the value.
//!
//! Field points, given as angles or heights, to field angles.
//!
//! Coordinate breaks: the axes that they turn and move, and where a surface stands in them.
//!
//! OpticStudio turns right-handed, by R = Rx Ry Rz from a surface's axes to those before. Our
//! surfaces are round about their own axis, so only where that axis points matters, and two tilts
//! say that.
//!
//! Bytes to text. OpticStudio writes UTF-16 with a byte order mark, older versions one byte a
//! character.

use glam::{DMat3, DVec3};

use super::ZemaxError;
use super::sheet::{Aperture, SheetLine, ZemaxSheet};
use crate::train::analysis::chief_height;
use crate::train::fields::MOST_FIELDS;
use crate::train::{FieldSpec, Focus, Isometry, OpticalTrain, VignettingSpec};
use etendue_geometry::units::Degrees;

/// Thicknesses from here on are infinite, as OpticStudio has it.
const INFINITE: f64 = 1e10;

/// Operands whose values are taken, and what others do to the light's way.
const TAKEN: [&str; 11] =
    ["THIC", "CRVT", "CONN", "SDIA", "APER", "XFIE", "YFIE", "GLSS", "WAVE", "WLWT", "FLWT"];
const NOT_TAKEN: [&str; 13] = [
    "STPS", "PRAM", "EDVA", "MABB", "MIND", "CADX", "CADY", "CATX", "CATY", "CATZ", "CAOR", "PRWV",
    "IGNR",
];

/// A value of one configuration.
#[derive(Debug, Clone)]
pub(super) struct ConfigurationValue {
    line: usize,
    operand: &'static str,
    /// Of the surface or field.
    index: usize,
    configuration: usize,
    value: String,
}

impl ConfigurationValue {
    /// The value in a line; `None` when it is none of an operand.
    pub(super) fn read(line: &SheetLine<'_>) -> Result<Option<Self>, ZemaxError> {
        let operand = TAKEN.iter().chain(&NOT_TAKEN).find(|operand| **operand == line.command);
        let Some(&operand) = operand else { return Ok(None) };
        let (Ok(index), Ok(configuration), Some(value)) =
            (line.index(0), line.index(1), line.word(2))
        else {
            return Err(line.error("expected a surface or field, a configuration, and a value"));
        };
        let value = value.to_owned();
        Ok(Some(Self { line: line.number, operand, index, configuration, value }))
    }

    fn error(&self, why: &str) -> ZemaxError {
        ZemaxError::new(self.line, format!("{}: {why}", self.operand))
    }

    fn number(&self) -> Result<f64, ZemaxError> {
        let number = self.value.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| self.error(&format!("`{}` is not a number", self.value)))
    }
}

impl ZemaxSheet {
    /// Puts the values of a configuration, from 1, in place of those that the file stands at.
    pub(super) fn choose(&mut self, configuration: usize) -> Result<(), ZemaxError> {
        if configuration == 0 || configuration > self.configurations {
            let why = format!(
                "there is no configuration {configuration}: the file has {}, from 1",
                self.configurations
            );
            return Err(ZemaxError::new(self.last_line, why));
        }
        let active = std::mem::replace(&mut self.configuration, configuration);
        if active == configuration {
            return Ok(());
        }
        let all = std::mem::take(&mut self.values);
        for value in all.iter().filter(|value| value.configuration == configuration) {
            let is_same = |other: &&ConfigurationValue| {
                (other.operand, other.index, other.configuration)
                    == (value.operand, value.index, active)
            };
            let stands = all.iter().find(is_same);
            if TAKEN.contains(&value.operand) {
                self.take(value)?;
            } else if stands.is_none_or(|stands| stands.value != value.value) {
                return Err(value.error(&format!(
                    "what configuration {configuration} changes here has no counterpart; open the file at that \
                     configuration in OpticStudio and save it"
                )));
            }
        }
        self.values = all;
        Ok(())
    }

    fn take(&mut self, value: &ConfigurationValue) -> Result<(), ZemaxError> {
        let missing = |what: &str| value.error(&format!("there is no {what} {}", value.index));
        if value.operand == "GLSS" {
            let row = self.rows.get_mut(value.index).ok_or_else(|| missing("surface"))?;
            return row.change_glass(value.line, &value.value);
        }
        let number = value.number()?;
        let slot = value.index.checked_sub(1);
        if value.operand == "WAVE" {
            let wavelength = slot.and_then(|slot| self.wavelengths.get_mut(slot));
            *wavelength.ok_or_else(|| missing("wavelength"))? = number;
            return Ok(());
        }
        if let "WLWT" | "FLWT" = value.operand {
            let (weights, count) = match value.operand {
                "WLWT" => (&mut self.wavelength_weights, self.wavelengths.len()),
                _ => (&mut self.fields.weights, self.fields.x.len().max(self.fields.y.len())),
            };
            weights.resize(weights.len().max(count), 1.0);
            let weight = slot.and_then(|slot| weights.get_mut(slot));
            *weight.ok_or_else(|| missing("wavelength or field"))? = number;
            return Ok(());
        }
        if value.operand == "APER" {
            self.aperture = match self.aperture {
                Some((line, Aperture::EntrancePupil(_))) => {
                    Some((line, Aperture::EntrancePupil(number)))
                }
                Some((line, Aperture::FNumber(_))) => Some((line, Aperture::FNumber(number))),
                Some((_, Aperture::AtObject(_))) | None => {
                    return Err(value.error("only the values of ENPD and FNUM can be changed"));
                }
            };
            return Ok(());
        }
        if let "XFIE" | "YFIE" = value.operand {
            let fields =
                if value.operand == "XFIE" { &mut self.fields.x } else { &mut self.fields.y };
            let field = value.index.checked_sub(1).and_then(|i| fields.get_mut(i));
            *field.ok_or_else(|| missing("field"))? = number;
            return Ok(());
        }
        let row = self.rows.get_mut(value.index).ok_or_else(|| missing("surface"))?;
        match value.operand {
            "THIC" => row.thickness = if number >= INFINITE { f64::INFINITY } else { number },
            "CRVT" => row.curvature = number,
            "CONN" => row.conic = number,
            _ => row.semi_diameter = Some(number).filter(|length| *length > 0.0),
        }
        Ok(())
    }
}

/// Elements times fields that are taken in the most, and fields that are taken in any case.
const MOST_WORK: usize = 10_000;
const FEWEST_FIELDS: usize = 10;

/// The field points of a file.
#[derive(Debug, Default)]
pub(super) struct Fields {
    /// 0 for angles, 1 for heights of the object, 2 and 3 for those of the paraxial and the real image.
    pub(super) kind: usize,
    pub(super) count: Option<usize>,
    /// Number of wavelengths in use, which stands in the same line.
    pub(super) wavelengths: Option<usize>,
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
    /// Weight of each field.
    pub(super) weights: Vec<f64>,
    /// Vignetting of the fields' pupils: VDX
    pub(super) vignetting: [Vec<f64>; 5],
}

impl Fields {
    /// Kind, normalisation, number of fields, number of wavelengths.
    pub(super) fn set_kind(&mut self, line: &SheetLine<'_>) -> Result<(), ZemaxError> {
        self.kind = line.index(0)?;
        self.count = line.word(2).map(|_| line.index(2)).transpose()?;
        self.wavelengths = line.word(3).map(|_| line.index(3)).transpose()?;
        Ok(())
    }

    /// The fields by the angles of their chief rays, without those that repeat, and sentences on fields that have
    /// none. `unit` is the file's length in millimetres; `object_z` is where the
    /// object stands in lens coordinates (mm).
    pub(super) fn angles(
        &self,
        unit: f64,
        train: &OpticalTrain,
        object_z: Option<f64>,
    ) -> (Vec<FieldSpec>, Vec<String>) {
        let affordable = MOST_WORK / train.elements().len().max(1);
        let most = affordable.clamp(FEWEST_FIELDS, MOST_FIELDS);
        let (mut fields, mut notes): (Vec<FieldSpec>, Vec<String>) = (Vec::new(), Vec::new());
        for (i, [x, y]) in self.points().take(most).enumerate() {
            let height = unit * if x == 0.0 { y } else { x.hypot(y) };
            // FTYP: angles, heights of the object, or heights of the paraxial or real image.
            let found = match self.kind {
                0 if x == 0.0 => Ok(y),
                0 => Ok(x.to_radians().tan().hypot(y.to_radians().tan()).atan().to_degrees()),
                1 => angle_of_object(train, object_z, height),
                2 | 3 => angle_of_image(train, height, self.kind == 3),
                kind => Err(format!("fields of kind {kind} are neither angles nor heights")),
            };
            match found {
                Ok(angle) if angle.abs() < 180.0 => {
                    if !fields.iter().any(|field| field.angle.0 == angle) {
                        fields.push(self.field(i, angle, [x, y]));
                    }
                }
                Ok(_) => {}
                Err(why) if notes.contains(&why) => {}
                Err(why) => notes.push(why),
            }
        }
        let mut notes: Vec<String> =
            notes.into_iter().map(|why| format!("fields left out: {why}")).collect();
        let count = self.points().count();
        if count > most {
            notes.push(format!("of {count} fields the first {most} are taken"));
        }
        (fields, notes)
    }

    /// Field `i` at an angle (degrees), with its weight and what vignetting leaves of its pupil, turned as its point
    /// is into the plane of y and z.
    fn field(&self, i: usize, angle: f64, [x, y]: [f64; 2]) -> FieldSpec {
        let weight = self.weights.get(i).copied().filter(|w| *w >= 0.0).unwrap_or(1.0);
        let factors: [f64; 5] =
            std::array::from_fn(|kind| self.vignetting[kind].get(i).copied().unwrap_or(0.0));
        let [vdx, vdy, vcx, vcy, van] = factors;
        let turned = if x == 0.0 { 0.0 } else { 90.0 - y.atan2(x).to_degrees() };
        let vignetting = match factors == [0.0; 5] {
            true => VignettingSpec::default(),
            false => VignettingSpec {
                decentre: [vdx, vdy],
                compression: [vcx, vcy],
                rotation: Degrees(van + turned),
            },
        };
        FieldSpec { weight, vignetting, ..FieldSpec::at(angle) }
    }

    fn points(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let longest = self.x.len().max(self.y.len());
        let count = self.count.unwrap_or(self.y.len()).min(longest);
        let at = |list: &[f64], i: usize| list.get(i).copied().unwrap_or(0.0);
        (0..count).map(move |i| [at(&self.x, i), at(&self.y, i)])
    }
}

/// The angle (degrees) at which the entrance pupil sees a point of the object `height` (mm) off the
/// axis; rays from above come down.
fn angle_of_object(
    train: &OpticalTrain,
    object_z: Option<f64>,
    height: f64,
) -> Result<f64, String> {
    let object = object_z.ok_or("heights of an object at infinity are none")?;
    let pupil = train.paraxial(train.wavelength()).ok().and_then(|p| p.entrance_pupil.z);
    let pupil = pupil.ok_or("heights seen from an entrance pupil at infinity have no angle")?;
    Ok((-height / (pupil - object)).atan().to_degrees())
}

/// The angle (degrees) whose chief ray lands at `height` (mm) on the sensor, through the whole lens
/// or as it does near the axis.
fn angle_of_image(train: &OpticalTrain, height: f64, real: bool) -> Result<f64, String> {
    const NEAR: f64 = 1e-6;
    let dark = || format!("no chief ray arrives at an image height of {height} mm");
    let sensor = train.sensor_z(Focus::AsWritten).map_err(|error| error.to_string())?;
    let lens = train.at(train.wavelength()).map_err(|error| error.to_string())?;
    let lands = |slope: f64| chief_height(train, &lens, slope.atan().to_degrees(), sensor);
    let scale = lands(NEAR).filter(|scale| *scale != 0.0).ok_or_else(dark)? / NEAR;
    let mut slope = height / scale;
    if !real || height == 0.0 {
        return Ok(slope.atan().to_degrees());
    }
    let (mut before, mut missed_before) = (0.0, -height);
    for _ in 0..50 {
        let missed = lands(slope).ok_or_else(dark)? - height;
        if missed.abs() <= 1e-10 * height.abs() {
            return Ok(slope.atan().to_degrees());
        }
        let next = slope - missed * (slope - before) / (missed - missed_before);
        (before, missed_before) = (slope, missed);
        slope = next;
    }
    Err(dark())
}

/// Tilts this small are the rounding of turns to and back (degrees).
const NO_TILT: f64 = 1e-12;

/// Lengths this small are the same (mm).
const NO_LENGTH: f64 = 1e-12;

/// A coordinate break, in mm and degrees.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Break {
    pub(super) decentre: [f64; 2],
    pub(super) tilt: [f64; 3],
    /// Turned first, in the order z, y, x, and moved then.
    pub(super) turned_first: bool,
}

/// The axes of the next surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axes {
    origin: DVec3,
    rotation: DMat3,
}

/// Placement of a surface, as a lens file states it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SheetPlace {
    pub(super) z: f64,
    pub(super) decentre: [f64; 2],
    pub(super) tilt: [f64; 2],
}

impl Default for Axes {
    fn default() -> Self {
        Self { origin: DVec3::ZERO, rotation: DMat3::IDENTITY }
    }
}

impl Axes {
    pub(super) fn new(origin: DVec3, rotation: DMat3) -> Self {
        Self { origin, rotation }
    }

    pub(super) fn rotation(&self) -> DMat3 {
        self.rotation
    }

    /// The thickness along this axis and the break behind it that lead to other axes.
    pub(super) fn to(&self, next: &Self) -> (f64, Break) {
        let back = self.rotation.transpose();
        let offset = back * (next.origin - self.origin);
        let turn = back * next.rotation;
        // R = Rx(a) Ry(b) Rz(c).
        let [about_x, about_y, about_z] = [
            (-turn.z_axis.y).atan2(turn.z_axis.z),
            turn.z_axis.x.atan2(turn.z_axis.y.hypot(turn.z_axis.z)),
            (-turn.y_axis.x).atan2(turn.x_axis.x),
        ];
        let clean = |value: f64, small: f64| if value.abs() <= small { 0.0 } else { value };
        let tilt = [about_x, about_y, about_z].map(|angle| clean(angle.to_degrees(), NO_TILT));
        let decentre = [offset.x, offset.y].map(|length| clean(length, NO_LENGTH));
        (offset.z, Break { decentre, tilt, turned_first: false })
    }

    pub(super) fn broken(self, by: &Break) -> Self {
        let [x, y, z] = by.tilt.map(f64::to_radians);
        let [x, y, z] =
            [DMat3::from_rotation_x(x), DMat3::from_rotation_y(y), DMat3::from_rotation_z(z)];
        let offset = DVec3::new(by.decentre[0], by.decentre[1], 0.0);
        if by.turned_first {
            let rotation = self.rotation * z * y * x;
            Self { origin: self.origin + rotation * offset, rotation }
        } else {
            Self {
                origin: self.origin + self.rotation * offset,
                rotation: self.rotation * x * y * z,
            }
        }
    }

    pub(super) fn advanced(self, thickness: f64) -> Self {
        Self { origin: self.origin + self.rotation.z_axis * thickness, ..self }
    }

    /// Returns the axes as they stand in an unfolded space, in which light that runs against the
    /// file's axis runs along +z.
    pub(super) fn unfolded(&self, space: &Isometry, sense: f64) -> Self {
        if *space == Isometry::ONE {
            return *self;
        }
        let flip = DMat3::from_diagonal(DVec3::new(1.0, 1.0, sense));
        let columns = [self.rotation.x_axis, self.rotation.y_axis, self.rotation.z_axis];
        let [x, y, z] = columns.map(|column| space.direction(column));
        Self { origin: space.place(self.origin), rotation: DMat3::from_cols(x, y, z) * flip }
    }

    /// Returns the axes moved across their own axis (mm).
    pub(super) fn shifted(&self, [x, y]: [f64; 2]) -> Self {
        Self { origin: self.origin + self.rotation * DVec3::new(x, y, 0.0), ..*self }
    }

    /// The axis.
    pub(super) fn axis(&self) -> DVec3 {
        self.rotation.z_axis
    }

    pub(super) fn origin(&self) -> DVec3 {
        self.origin
    }

    /// True if the frame is turned about its own axis, which two tilts cannot express.
    pub(super) fn is_turned(&self) -> bool {
        let [about_x, about_y] = self.placed().tilt.map(f64::to_radians);
        let two = DMat3::from_rotation_x(about_x) * DMat3::from_rotation_y(about_y);
        (two.x_axis - self.rotation.x_axis).length() > 1e-9
    }

    pub(super) fn placed(&self) -> SheetPlace {
        // Rx(a) Ry(b) takes z to (sin b, -sin a cos b, cos a cos b).
        let axis = self.rotation.z_axis;
        let about_x = (-axis.y).atan2(axis.z).to_degrees();
        let about_y = axis.x.atan2(axis.y.hypot(axis.z)).to_degrees();
        let clean = |value: f64, small: f64| if value.abs() <= small { 0.0 } else { value };
        SheetPlace {
            z: self.origin.z,
            decentre: [self.origin.x, self.origin.y].map(|length| clean(length, NO_LENGTH)),
            tilt: [about_x, about_y].map(|angle| clean(angle, NO_TILT)),
        }
    }
}

/// The text of a file in UTF-8 or UTF-16 of either order, by its byte order mark or, without one, by
/// where its zero bytes are. What is no UTF-8 is taken for Latin-1, as old versions write it.
pub(super) fn decode(bytes: &[u8]) -> Result<String, ZemaxError> {
    match bytes {
        [] => Err(ZemaxError::new(1, "the file is empty")),
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => utf8(rest),
        [first, 0, ..] if *first != 0 => utf16(bytes, u16::from_le_bytes),
        [0, second, ..] if *second != 0 => utf16(bytes, u16::from_be_bytes),
        _ => utf8(bytes),
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<String, ZemaxError> {
    let (pairs, odd) = bytes.as_chunks::<2>();
    let text: Result<String, _> =
        char::decode_utf16(pairs.iter().map(|&pair| unit(pair))).collect();
    match text {
        Ok(text) if odd.is_empty() => Ok(text),
        _ => Err(ZemaxError::new(1, "the file is broken UTF-16; save it again")),
    }
}

fn utf8(bytes: &[u8]) -> Result<String, ZemaxError> {
    if bytes.contains(&0) {
        return Err(ZemaxError::new(1, "the file is no text"));
    }
    Ok(match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::Frame;

    #[test]
    fn an_axis_is_where_two_tilts_put_it() {
        let by = Break { decentre: [1.0, -2.0], tilt: [20.0, -35.0, 70.0], turned_first: false };
        let placed = Axes::default().advanced(5.0).broken(&by).placed();
        let frame = Frame::placed(placed.z, placed.decentre, placed.tilt);
        let direct = DMat3::from_rotation_x(20_f64.to_radians())
            * DMat3::from_rotation_y(-35_f64.to_radians());
        assert_eq!(frame.vertex, DVec3::new(1.0, -2.0, 5.0));
        assert!((frame.rotation.z_axis - direct.z_axis).length() < 1e-15);
    }

    #[test]
    fn a_break_and_its_reverse_leave_no_trace() {
        let there = Break { decentre: [0.3, 0.7], tilt: [3.0, 4.0, 5.0], turned_first: false };
        let back = Break { decentre: [-0.3, -0.7], tilt: [-3.0, -4.0, -5.0], turned_first: true };
        let placed = Axes::default().broken(&there).broken(&back).placed();
        assert_eq!((placed.decentre, placed.tilt), ([0.0; 2], [0.0; 2]));
        assert!(placed.z.abs() < 1e-15);
    }
}
