//! Values of a whole lens of optiland: wavelengths, aperture and fields. Its text is JSON as Python writes it, with
//! words for infinite numbers and for none.

use serde_json::Value;

use super::sheet::{Aperture, ZemaxSheet};

pub(super) fn put_wavelengths(group: &Value, sheet: &mut ZemaxSheet) -> Result<(), String> {
    let all = group["wavelengths"].as_array().map_or(&[][..], Vec::as_slice);
    let (mut micrometres, mut weights) = (Vec::new(), Vec::new());
    for (i, wavelength) in all.iter().enumerate() {
        let error = |why: &str| format!("wavelengths.wavelengths[{i}].{why}");
        let value = number(&wavelength["value"]).filter(|value| *value > 0.0 && value.is_finite());
        let value = value.ok_or_else(|| error("value: expected a positive number"))?;
        let scale = match wavelength["unit"].as_str().unwrap_or("um") {
            "um" | "µm" | "micron" | "microns" => 1.0,
            "nm" => 1e-3,
            "mm" => 1e3,
            _ => return Err(error("unit: known are um, nm, mm")),
        };
        micrometres.push(value * scale);
        weights.push(number(&wavelength["weight"]).unwrap_or(1.0));
        if wavelength["is_primary"].as_bool().unwrap_or(false) {
            sheet.set_primary(i + 1);
        }
    }
    if !micrometres.is_empty() {
        sheet.set_wavelengths(micrometres);
        sheet.wavelength_weights = weights;
    }
    Ok(())
}

pub(super) fn put_aperture(aperture: &Value, sheet: &mut ZemaxSheet) -> Result<(), String> {
    if aperture.is_null() {
        return Ok(());
    }
    let value = number(&aperture["value"]).filter(|value| *value > 0.0 && value.is_finite());
    let value = value.ok_or("aperture.value: expected a positive number")?;
    sheet.aperture = match aperture["type"].as_str().unwrap_or_default() {
        "EPD" => Some((0, Aperture::EntrancePupil(value))),
        "imageFNO" | "paraxialImageFNO" => Some((0, Aperture::FNumber(value))),
        "objectNA" if value < 1.0 => Some((0, Aperture::AtObject(value))),
        "objectNA" => return Err(format!("aperture.value: {value} must be below 1 in air")),
        // The stop's own diameter.
        "float_by_stop_size" => {
            if let Some(stop) = sheet.rows.iter_mut().find(|row| row.stop) {
                stop.set_clear(0.5 * value);
            }
            None
        }
        other => {
            return Err(format!(
                "aperture.type: `{other}` has no counterpart here; known: EPD, imageFNO, objectNA, float_by_stop_size"
            ));
        }
    };
    Ok(())
}

pub(super) fn put_fields(group: &Value, sheet: &mut ZemaxSheet) -> Result<(), String> {
    let all = group["fields"].as_array().map_or(&[][..], Vec::as_slice);
    for (i, field) in all.iter().enumerate() {
        let value =
            |key: &str| finite(field, key).map_err(|why| format!("fields.fields[{i}].{why}"));
        sheet.fields.x.push(value("x")?);
        sheet.fields.y.push(value("y")?);
        if value("vx")? != 0.0 || value("vy")? != 0.0 {
            sheet.leave_out("fields.vx, vy", 0);
        }
    }
    let named = |value: &Value| value.as_str().map(str::to_owned);
    let kind = named(&group["field_definition"]["field_type"])
        .or_else(|| named(&group["field_type"]))
        .or_else(|| named(&all.first()?["field_type"]))
        .unwrap_or_else(|| "angle".to_owned());
    sheet.fields.kind = match kind.as_str() {
        "AngleField" | "angle" => 0,
        "ObjectHeightField" | "object_height" => 1,
        "ParaxialImageHeightField" | "paraxial_image_height" => 2,
        "RealImageHeightField" | "real_image_height" => 3,
        other => {
            return Err(format!(
                "fields: the kind {other} has no counterpart here; known: angles, heights of the object, the paraxial and \
                 the real image"
            ));
        }
    };
    Ok(())
}

/// The most numbers of a list.
const MOST_TERMS: usize = 10_000;

/// Python's words for infinite numbers and for none as texts.
pub(super) fn as_json(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let (mut quoted, mut escaped) = (false, false);
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let word = ["-Infinity", "Infinity", "NaN"]
            .into_iter()
            .find(|word| !quoted && rest.starts_with(word));
        if let Some(word) = word {
            out.extend(['"'].into_iter().chain(word.chars()).chain(['"']));
            rest = &rest[word.len()..];
            continue;
        }
        match c {
            '"' if !escaped => quoted = !quoted,
            _ => {}
        }
        escaped = quoted && c == '\\' && !escaped;
        out.push(c);
        rest = &rest[c.len_utf8()..];
    }
    out
}

/// A number, infinite ones too, also as the only one of a list.
pub(super) fn number(value: &Value) -> Option<f64> {
    match value {
        Value::String(word) if word == "Infinity" => Some(f64::INFINITY),
        Value::String(word) if word == "-Infinity" => Some(f64::NEG_INFINITY),
        Value::Array(list) => match &list[..] {
            [one] if !one.is_array() => number(one),
            _ => None,
        },
        value => value.as_f64(),
    }
}

/// The finite number of a key, or 0 where it is missing.
pub(super) fn finite(value: &Value, key: &str) -> Result<f64, String> {
    match &value[key] {
        Value::Null => Ok(0.0),
        written => number(written)
            .filter(|number| number.is_finite())
            .ok_or_else(|| format!("{key}: expected a finite number")),
    }
}

pub(super) fn list(value: &Value, key: &str) -> Result<Vec<f64>, String> {
    let error = || format!("{key}: expected a list of finite numbers");
    let list = match &value[key] {
        Value::Null => return Ok(Vec::new()),
        written => written.as_array().ok_or_else(error)?,
    };
    if list.len() > MOST_TERMS {
        return Err(format!("{key}: more than {MOST_TERMS} numbers"));
    }
    let finite =
        |value: &Value| number(value).filter(|number| number.is_finite()).ok_or_else(error);
    list.iter().map(finite).collect()
}
