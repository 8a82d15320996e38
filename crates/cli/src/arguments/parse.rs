//! Values of arguments from their words, or what would have been one.

use clap::builder::{PossibleValue, PossibleValuesParser};
use etendue::Setting;
use etendue_accel::AccelName;
use etendue_bench::tolerance::Tolerance;
use etendue_geometry::units::Dimension;
use etendue_optics::train::Focus;
use etendue_tracer::LayerSpec;

/// More threads than any machine has cores only make a machine unusable.
const MOST_THREADS: usize = 1024;

pub(super) fn setting(text: &str) -> Result<Setting, String> {
    match text.split_once('=') {
        Some((path, value)) if !path.trim().is_empty() => Ok(Setting::new(path.trim(), value)),
        _ => Err("expected PATH=VALUE, such as camera.fov=30".to_owned()),
    }
}

/// A key and the values that it takes in turn; none where the key stands alone.
#[derive(Debug, Clone)]
pub(crate) struct Sweep {
    pub(crate) key: String,
    pub(crate) values: Vec<String>,
}

pub(super) fn sweep(text: &str) -> Result<Sweep, String> {
    let Ok(Setting { path: key, value }) = setting(text) else {
        return match text.contains('=') {
            true => Err("expected KEY=VALUES, such as accuracy.path_noise=0.1,1".to_owned()),
            false => Ok(Sweep { key: text.trim().to_owned(), values: Vec::new() }),
        };
    };
    let values = value.split(',').map(|value| value.trim().to_owned()).collect();
    Ok(Sweep { key, values })
}

/// A share from a number of hundredths, such as 1%.
pub(super) fn share(text: &str) -> Result<f64, String> {
    let percent = text.trim().strip_suffix('%').map(str::trim);
    let share = percent
        .map_or_else(|| text.trim().parse(), |number| number.parse().map(|p: f64| p / 100.0));
    match share {
        Ok(share) if share > 0.0 && share < 1.0 => Ok(share),
        _ => Err("expected a share above 0 and below 1, such as 1% or 0.01".to_owned()),
    }
}

pub(super) fn wavelength(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(nanometres) if nanometres > 0.0 && f64::is_finite(nanometres) => Ok(nanometres),
        _ => Err("expected nanometres, such as 525".to_owned()),
    }
}

pub(super) fn layer(name: &str) -> Result<String, String> {
    match LayerSpec::from_name(name) {
        Some(_) => Ok(name.to_owned()),
        None => Err(format!("known layers: {}", LayerSpec::NAMES.join(", "))),
    }
}

/// The accelerators' names, with what each is.
pub(super) fn accelerators() -> PossibleValuesParser {
    PossibleValuesParser::new(
        AccelName::ALL.map(|own| PossibleValue::new(own.name()).help(own.description())),
    )
}

pub(super) fn threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(threads) if threads <= MOST_THREADS => Ok(threads),
        _ => Err(format!("expected a whole number from 0 to {MOST_THREADS}")),
    }
}

pub(super) fn some_threads(text: &str) -> Result<usize, String> {
    count(text, MOST_THREADS)
}

pub(super) fn rounds(text: &str) -> Result<usize, String> {
    count(text, 1000)
}

pub(super) fn rays(text: &str) -> Result<usize, String> {
    count(text, 1 << 30)
}

pub(super) fn samples(text: &str) -> Result<u32, String> {
    // The converged picture has sixteen times as many.
    let count = count(text, 1 << 16)?;
    u32::try_from(count).map_err(|error| error.to_string())
}

pub(super) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if seconds > 0.0 && f64::is_finite(seconds) => Ok(seconds),
        _ => Err("expected seconds, such as 60".to_owned()),
    }
}

pub(super) fn batch(text: &str) -> Result<usize, String> {
    count(text, 1 << 16)
}

fn count(text: &str, most: usize) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(count) if (1..=most).contains(&count) => Ok(count),
        _ => Err(format!("expected a whole number from 1 to {most}")),
    }
}

pub(super) fn bytes(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let shift = match text[digits.len()..].to_ascii_uppercase().trim_end_matches("IB") {
        "" | "B" => 0,
        "K" | "KB" => 10,
        "M" | "MB" => 20,
        "G" | "GB" => 30,
        "T" | "TB" => 40,
        unit => return Err(format!("unknown unit \"{unit}\"; known: K, M, G, T")),
    };
    let number: f64 =
        digits.trim().parse().map_err(|_| "expected a number of bytes, such as 4G")?;
    let bytes = number * f64::from(2u32).powi(shift);
    if !(0.0..=9e18).contains(&bytes) {
        return Err("not a number of bytes".to_owned());
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "in range, and a fraction of a byte does not matter"
    )]
    Ok(bytes as u64)
}

pub(super) fn frames(text: &str) -> Result<std::ops::Range<usize>, String> {
    let range = text.split_once("..").and_then(|(from, to)| {
        let from = if from.is_empty() { 0 } else { from.parse().ok()? };
        Some(from..to.parse().ok()?)
    });
    match range {
        Some(range) if !range.is_empty() => Ok(range),
        _ => Err("expected a range such as 10..20, without the last".to_owned()),
    }
}

/// `0.5 px`, or a plain number of pixels.
pub(super) fn pixels(text: &str) -> Result<f64, String> {
    let number = text.trim().strip_suffix("px").unwrap_or(text).trim();
    positive(number).ok_or_else(|| "expected pixels above 0, such as \"0.5 px\"".to_owned())
}

/// `1536x1024`.
pub(super) fn resolution(text: &str) -> Result<[u32; 2], String> {
    let sides: Option<Vec<u32>> =
        text.split(['x', 'X', '×', ',']).map(|side| side.trim().parse().ok()).collect();
    match sides.as_deref() {
        Some(&[columns, rows]) if columns > 0 && rows > 0 => Ok([columns, rows]),
        _ => Err("expected columns and rows of one pixel and more, such as 1536x1024".to_owned()),
    }
}

/// `4 um`, or a plain number of micrometres.
pub(super) fn pitch(text: &str) -> Result<f64, String> {
    let micrometres = match text.trim().parse() {
        Ok(number) => number,
        Err(_) => Dimension::Length.parse(text, "um").map_err(|error| error.to_string())?,
    };
    match micrometres > 0.0 && f64::is_finite(micrometres) {
        true => Ok(micrometres),
        false => Err("expected a length above 0, such as \"4 um\"".to_owned()),
    }
}

/// `25 mm`, or a plain number of metres.
pub(super) fn length(text: &str) -> Result<f64, String> {
    let metres = match text.trim().parse() {
        Ok(number) => number,
        Err(_) => Dimension::Length.parse(text, "m").map_err(|error| error.to_string())?,
    };
    match metres > 0.0 && f64::is_finite(metres) {
        true => Ok(metres),
        false => Err("expected a length above 0, such as \"25 mm\"".to_owned()),
    }
}

/// `40,60,200,240`.
pub(super) fn region(text: &str) -> Result<[usize; 4], String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, width, height]) if width > 0 && height > 0 => Ok([x, y, width, height]),
        _ => Err("expected the left column, the top row, width and height, such as 40,60,200,240"
            .to_owned()),
    }
}

/// `0,1`.
pub(super) fn mosaic(text: &str) -> Result<[usize; 2], String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[column @ 0..=1, row @ 0..=1]) => Ok([column, row]),
        _ => Err("expected a column and a row of 0 or 1, such as 0,1".to_owned()),
    }
}

/// `2.8`.
pub(super) fn f_number(text: &str) -> Result<f64, String> {
    positive(text).ok_or_else(|| "expected an f-number above 0, such as 2.8".to_owned())
}

fn positive(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number| *number > 0.0 && f64::is_finite(*number))
}

/// `0.5 px`, or with a share of the light `0.5 px,5 %`.
pub(super) fn tolerance(text: &str) -> Result<Tolerance, String> {
    let Some((places, light)) = text.split_once(',') else {
        return Ok(Tolerance { pixels: pixels(text)?, light: None });
    };
    let wrong = || "expected pixels and a share of the light, such as \"0.5 px,5 %\"".to_owned();
    let light = light.trim().strip_suffix('%').ok_or_else(wrong)?;
    let percent = positive(light.trim()).ok_or_else(wrong)?;
    Ok(Tolerance { pixels: pixels(places)?, light: Some(percent / 100.0) })
}

/// `1.2 m`, a plain number of metres, or `infinity`.
pub(super) fn focus(text: &str) -> Result<Focus, String> {
    let text = text.trim();
    if ["infinity", "inf"].contains(&text) {
        return Ok(Focus::Infinity);
    }
    let metres = match text.parse::<f64>() {
        Ok(number) => number,
        Err(_) => Dimension::Length.parse(text, "m").map_err(|error| error.to_string())?,
    };
    if metres > 0.0 && metres.is_finite() {
        Ok(Focus::Distance(metres))
    } else {
        Err("expected a distance above 0, such as \"1.2 m\", or infinity".to_owned())
    }
}
