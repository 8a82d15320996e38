//! Lenses of ISET's toolboxes as JSON to the rows of the lens data sheet.
//!
//! Two forms: `surfaces` with `radius`, `thickness`, `ior` (of what follows), `semi_aperture` and, of pbrt's *omni* camera,
//! `conic_constant`, as one number or as two for x and y; and `surfaceArray` as `lensC` saves it, with `sRadius`,
//! `sCenter`, `apertureD`, `n` by `wave`, and `subtype` `diaphragm` for the stop. Lengths are millimetres.
//!
//! # Sources
//!
//! `data/lens` of the public repository isetlens, and the reader of lens files of pbrt-v3-spectral's `omni` camera.

use serde_json::Value;

use super::ZemaxError;
use super::format::LensFormat;
use super::pbrt::Interface;
use super::sheet::ZemaxSheet;
use crate::glass::GlassSpec;

/// Greatest error of an index on a fitted curve: the fifth decimal, that makers give.
const INDEX_MISSED: f64 = 1e-4;

/// Keys that would change the light's way and have no counterpart.
const NOT_TAKEN: [&str; 4] = ["transform", "zernike", "aspheric_coefficients", "lookuptable"];

/// Keys of a file that are read, or that say what it is for.
const KNOWN: [&str; 6] = ["name", "description", "type", "surfaces", "surfaceArray", "units"];

impl ZemaxSheet {
    /// Reads the text of a lens of ISET.
    pub(super) fn read_iset(text: &str) -> Result<Self, ZemaxError> {
        let value: Value = serde_json::from_str(text)
            .map_err(|error| ZemaxError::new(error.line(), format!("broken JSON: {error}")))?;
        let mut sheet = Self::of_camera(LensFormat::Iset);
        value["name"].as_str().unwrap_or_default().clone_into(&mut sheet.name);
        if let Some(units) = value["units"].as_str().filter(|units| *units != "mm") {
            let why = format!("units: \"{units}\"; only millimetres (\"mm\") are read");
            return Err(ZemaxError::new(0, why));
        }
        if value.get("microlens").is_some_and(|lenslets| !lenslets.is_null()) {
            let why = "microlens: lenslets are not imported\nhint: take the key out, and put them in front of the sensor of the \
                       scene (\"type\": \"light_field\")";
            return Err(ZemaxError::new(0, why));
        }
        let is_table = value.get("surfaces").is_some();
        let key = if is_table { "surfaces" } else { "surfaceArray" };
        let Some(surfaces) = value[key].as_array() else {
            return Err(ZemaxError::new(0, format!("{key}: expected a list of surfaces")));
        };
        let read = if is_table { of_table } else { of_spheres };
        let read = |(i, surface): (usize, &Value)| {
            read(i + 1, surface).map_err(|why| ZemaxError::new(0, format!("{key}[{i}].{why}")))
        };
        let mut interfaces =
            surfaces.iter().enumerate().map(read).collect::<Result<Vec<_>, _>>()?;
        if !is_table {
            spread(&mut interfaces);
            narrow(&mut interfaces, &value);
        }
        for other in value.as_object().into_iter().flatten().map(|(key, _)| key) {
            if !KNOWN.contains(&other.as_str()) {
                sheet.leave_out(other, 0);
            }
        }
        let added = sheet.add_interfaces(&interfaces);
        // Surfaces have no lines.
        added.map_err(|error| match error.line {
            0 => error,
            line => ZemaxError::new(0, format!("{key}[{}]: {}", line - 1, error.why)),
        })?;
        Ok(sheet)
    }
}

/// A row of `surfaces`; an error begins with the key.
fn of_table(line: usize, surface: &Value) -> Result<Interface, String> {
    for key in NOT_TAKEN {
        // One that changes nothing.
        let is_plain = key == "transform"
            && surface[key] == serde_json::json!([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]]);
        if surface.get(key).is_some_and(|value| !value.is_null()) && !is_plain {
            return Err(format!(
                "{key}: has no counterpart here\nhint: take it out, or write the surface into a lens file"
            ));
        }
    }
    let radius = pair(surface, "radius")?.ok_or("radius: a number is missing")?;
    let [semi_x, semi_y] = pair(surface, "semi_aperture")?.unwrap_or([0.0; 2]);
    if semi_x != semi_y {
        return Err(
            "semi_aperture: rims that are no circles have no counterpart here\nhint: give one number"
                .to_owned(),
        );
    }
    let is_stop = radius == [0.0; 2];
    Ok(Interface {
        line,
        radius,
        conic: pair(surface, "conic_constant")?.unwrap_or([0.0; 2]),
        thickness: number(surface, "thickness")?,
        glass: if is_stop {
            None
        } else {
            index(&surface["ior"], None).map_err(|why| format!("ior: {why}"))?
        },
        semi_aperture: semi_x,
        is_stop,
    })
}

/// A row of `surfaceArray`, its vertex as its thickness.
fn of_spheres(line: usize, surface: &Value) -> Result<Interface, String> {
    let radius = number(surface, "sRadius")?;
    let centre = surface["sCenter"].as_array().and_then(|place| place.get(2)?.as_f64());
    let centre = centre.ok_or("sCenter: expected [x, y, z] (mm)")?;
    let is_stop = radius == 0.0 || surface["subtype"] == "diaphragm";
    let glass = match is_stop {
        true => None,
        false => index(&surface["n"], Some(&surface["wave"])).map_err(|why| format!("n: {why}"))?,
    };
    Ok(Interface {
        line,
        radius: [if is_stop { 0.0 } else { radius }; 2],
        conic: [surface["asphericity"].as_f64().unwrap_or(0.0); 2],
        thickness: centre - if is_stop { 0.0 } else { radius },
        glass,
        semi_aperture: 0.5 * number(surface, "apertureD")?,
        is_stop,
    })
}

/// Vertices to thicknesses; the last is 0.
fn spread(interfaces: &mut [Interface]) {
    for i in 0..interfaces.len() {
        let next = interfaces.get(i + 1).map(|next| next.thickness);
        interfaces[i].thickness = next.map_or(0.0, |next| next - interfaces[i].thickness);
    }
}

/// The diaphragm closed as the whole lens says.
fn narrow(interfaces: &mut [Interface], lens: &Value) {
    let Some(diameter) = lens["apertureMiddleD"].as_f64().filter(|diameter| *diameter > 0.0) else {
        return;
    };
    for interface in interfaces.iter_mut().filter(|interface| interface.is_stop) {
        interface.semi_aperture = interface.semi_aperture.min(0.5 * diameter);
    }
}

fn number(surface: &Value, key: &str) -> Result<f64, String> {
    surface[key].as_f64().ok_or_else(|| format!("{key}: expected a number"))
}

/// One number for both, or two; `None` where the key is missing.
fn pair(surface: &Value, key: &str) -> Result<Option<[f64; 2]>, String> {
    let error = || format!("{key}: expected a number, or two for x and y");
    match &surface[key] {
        Value::Null => Ok(None),
        Value::Array(both) => match both[..] {
            [ref x, ref y] => {
                Ok(Some([x.as_f64().ok_or_else(error)?, y.as_f64().ok_or_else(error)?]))
            }
            _ => Err(error()),
        },
        value => value.as_f64().map(|both| Some([both; 2])).ok_or_else(error),
    }
}

/// An index as one number, as [wavelengths, values], or as values at `wave` (nm); `None` for air.
fn index(written: &Value, wave: Option<&Value>) -> Result<Option<GlassSpec>, String> {
    if let Some(n) = written.as_f64() {
        return Ok((n != 1.0 && n != 0.0).then_some(GlassSpec::Constant(n)));
    }
    let list = |value: &Value| -> Option<Vec<f64>> {
        value.as_array()?.iter().map(Value::as_f64).collect()
    };
    let (wavelengths, values) = match wave {
        Some(wave) => (list(wave), list(written)),
        None => (list(&written[0]), list(&written[1])),
    };
    let (Some(wavelengths), Some(values)) = (wavelengths, values) else {
        return Err("expected a number, or wavelengths (nm) and as many indices".to_owned());
    };
    if values.is_empty() || values.len() != wavelengths.len() {
        return Err(format!("{} wavelengths (nm) and {} indices", wavelengths.len(), values.len()));
    }
    let micrometres: Vec<f64> = wavelengths.iter().map(|nm| nm * 1e-3).collect();
    glass_through(&micrometres, &values)
        .map(Some)
        .map(|glass| glass.filter(|glass| *glass != GlassSpec::Constant(1.0)))
}

/// The glass that has given indices at given wavelengths (µm): the same everywhere, or Cauchy's formula of as many
/// terms as there are, three at most, by least squares.
pub(super) fn glass_through(micrometres: &[f64], indices: &[f64]) -> Result<GlassSpec, String> {
    let all = || micrometres.iter().zip(indices);
    if all().any(|(um, n)| !(*um > 0.0 && um.is_finite() && *n >= 1.0 && n.is_finite())) {
        return Err("wavelengths must be positive, and indices numbers from 1 on".to_owned());
    }
    let Some(&first) = indices.first() else { return Err("no index is given".to_owned()) };
    if indices.iter().all(|n| *n == first) {
        return Ok(GlassSpec::Constant(first));
    }
    let terms = cauchy(micrometres, indices).ok_or("indices at the same wavelength")?;
    let value = |um: f64| terms.iter().rev().fold(0.0, |sum, term| sum / (um * um) + term);
    let missed = all().map(|(um, n)| (value(*um) - n).abs()).fold(0.0, f64::max);
    if missed > INDEX_MISSED {
        return Err(format!(
            "Cauchy's formula of {} terms misses the indices by {missed:.1e}; write a glass of a catalogue",
            terms.len()
        ));
    }
    Ok(GlassSpec::Cauchy(terms))
}

/// Least squares of n = A + B/λ² + C/λ⁴ by Gauss' elimination; `None` where wavelengths repeat.
fn cauchy(micrometres: &[f64], indices: &[f64]) -> Option<Vec<f64>> {
    let count = indices.len().min(3);
    let mut rows = vec![vec![0.0; count + 1]; count];
    for (um, n) in micrometres.iter().zip(indices) {
        let power = |i: usize| um.powi(-2 * i32::try_from(i).unwrap_or(0));
        for (i, row) in rows.iter_mut().enumerate() {
            for (k, cell) in row.iter_mut().take(count).enumerate() {
                *cell += power(i) * power(k);
            }
            row[count] += power(i) * n;
        }
    }
    for i in 0..count {
        let pivot = (i..count).max_by(|&a, &b| rows[a][i].abs().total_cmp(&rows[b][i].abs()))?;
        rows.swap(i, pivot);
        if rows[i][i].abs() < 1e-12 {
            return None;
        }
        for k in (0..count).filter(|&k| k != i) {
            let share = rows[k][i] / rows[i][i];
            let pivot = rows[i].clone();
            for (own, of_pivot) in rows[k].iter_mut().zip(&pivot).skip(i) {
                *own -= share * of_pivot;
            }
        }
    }
    Some((0..count).map(|i| rows[i][count] / rows[i][i]).collect())
}
