//! The stop's opening: by the system's aperture, or by its own surface and those around it.

use super::ZemaxError;
use super::sheet::{Aperture, ZemaxSheet};
use crate::element::{GlassesAlone, PartSpec};
use crate::glass::AgfCatalogue;
use crate::train::{LensError, LensFile, OpticalTrain};
use etendue_geometry::units::Millimetres;

/// The stop's radius (mm) that makes the entrance pupil as wide as `radius` says, from its z (mm).
fn with_entrance_pupil(
    train: &OpticalTrain,
    command: &str,
    radius: impl FnOnce(f64) -> Result<f64, String>,
) -> Result<f64, String> {
    let paraxial = train.paraxial(train.wavelength()).ok();
    let found = paraxial.and_then(|p| Some((p.entrance_pupil.z?, p.stop_magnification?)));
    let (z, magnification) =
        found.ok_or_else(|| format!("{command}: the entrance pupil is at infinity"))?;
    Ok(radius(z)? * magnification.abs())
}

/// Sets the stop by the system's aperture, and gives the lens.
pub(super) fn open_stop(
    file: &mut LensFile,
    sheet: &ZemaxSheet,
    glasses: &[AgfCatalogue],
    object_z: Option<f64>,
    notes: &mut Vec<String>,
) -> Result<OpticalTrain, ZemaxError> {
    let build = |file: &LensFile| {
        file.build(&GlassesAlone(glasses))
            .map_err(|error| ZemaxError::new(sheet.last_line, error.to_string()))
    };
    let train = build(file)?;
    let Some((line, aperture)) = sheet.aperture else {
        return float_stop(file, train, sheet, notes, build);
    };
    let words = sheet.format.words();
    let index = train.stop();
    let written = train.stop_radius();
    let error = |error: LensError| ZemaxError::new(line, error.to_string());
    let stop_radius = match aperture {
        Aperture::EntrancePupil(diameter) => {
            with_entrance_pupil(&train, words.pupil, |_| Ok(0.5 * diameter * sheet.unit)).map(Some)
        }
        Aperture::AtObject(sine) => with_entrance_pupil(&train, words.object_aperture, |pupil| {
            let object = object_z.ok_or_else(|| {
                format!(
                    "{}: the object is at infinity; write {} or {}",
                    words.object_aperture, words.pupil, words.f_number
                )
            })?;
            Ok((pupil - object).abs() * sine.asin().tan())
        })
        .map(Some),
        Aperture::FNumber(_) => Ok(None),
    };
    let opened = match (stop_radius.map_err(|why| ZemaxError::new(line, why))?, aperture) {
        (Some(radius), _) => train.with_stop_radius(radius).map_err(error)?,
        (None, Aperture::FNumber(f_number)) => {
            // What the file says; whether a beam fills it is among the lens' notes.
            let radius = train.stop_radius_at(f_number).map_err(error)?;
            train.with_stop_radius(radius).map_err(error)?
        }
        (None, _) => train,
    };
    let radius = opened.stop_radius();
    if written.is_finite() && written > 0.0 && (radius - written).abs() > 0.01 * written {
        notes.push(format!(
            "{}: the system's aperture gives the stop a radius of {radius:.5} mm; its surface's is \
             {written:.5} mm",
            sheet.place(line)
        ));
    }
    let stop = &mut file.elements[index];
    stop.mount.stop = true;
    match &mut stop.part {
        PartSpec::Surface(surface) => surface.semi_diameter = Some(Millimetres(radius)),
        PartSpec::ThinLens(lens) => lens.semi_diameter = Some(Millimetres(radius)),
        PartSpec::Biconic(surface) => surface.semi_diameter = Some(Millimetres(radius)),
        PartSpec::Mirror(mirror) => mirror.semi_diameter = Some(Millimetres(radius)),
        PartSpec::Freeform(surface) => surface.semi_diameter = Some(Millimetres(radius)),
        part => *part = PartSpec::circular(radius),
    }
    build(file)
}

/// The lens whose stop is as large as its own surface says, and, where it says nothing, as the widest beam
/// that the other rims let through.
fn float_stop(
    file: &mut LensFile,
    train: OpticalTrain,
    sheet: &ZemaxSheet,
    notes: &mut Vec<String>,
    build: impl Fn(&LensFile) -> Result<OpticalTrain, ZemaxError>,
) -> Result<OpticalTrain, ZemaxError> {
    let index = train.stop();
    let is_closed = |part: &PartSpec| *part == PartSpec::circular(0.0);
    if !file.elements[index].mount.stop || !is_closed(&file.elements[index].part) {
        return Ok(train);
    }
    let row = sheet.rows.iter().find(|row| row.stop);
    let line = row.map_or(sheet.last_line, |row| row.line);
    let words = sheet.format.words();
    let widest = train.widest_opening().ok_or_else(|| {
        let why = format!(
            "the stop has no {0}, and no other surface limits the beam: write the stop's {0}, or the system's aperture \
             as {1} or {2}",
            words.semi_diameter, words.pupil, words.f_number
        );
        ZemaxError::new(line, why)
    })?;
    notes.push(format!(
        "{}: the stop has no {}; its radius is {:.5} mm, that of the widest beam on the axis that \
         the other surfaces let through",
        sheet.place(line),
        words.semi_diameter,
        widest.stop_radius
    ));
    file.elements[index].part = PartSpec::circular(widest.stop_radius);
    build(file)
}
