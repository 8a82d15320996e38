//! Field points, given as angles or heights, to field angles.

use super::ZemaxError;
use super::line::SheetLine;
use crate::train::analysis::chief_height;
use crate::train::fields::MOST_FIELDS;
use crate::train::{FieldSpec, Focus, OpticalTrain, VignettingSpec};
use etendue_geometry::units::Degrees;

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
    /// Weight of each of them.
    pub(super) weights: Vec<f64>,
    /// Vignetting of their pupils: VDX, VDY, VCX, VCY, VAN.
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
    let sensor = train.sensor_z(Focus::AsWritten).map_err(|error| crate::sentence(&error))?;
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
