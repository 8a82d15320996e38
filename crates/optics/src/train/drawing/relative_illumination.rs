//! Relative illumination over the sensor, beside the cosine's fourth power.

use etendue_chart::{Axis, Chart, Series, Theme};

use super::title;
use crate::glass::GlassError;
use crate::train::analysis::{FieldIllumination, illumination};
use crate::train::{LensReport, OpticalTrain};

/// Fields on the curve.
const POINTS: u32 = 28;

/// Relative illumination against the height on the sensor, up to the image circle or the widest
/// field.
///
/// # Errors
///
/// When a glass has no index at the lens' wavelength.
pub fn relative_illumination(
    train: &OpticalTrain,
    report: &LensReport,
) -> Result<String, GlassError> {
    let curve = curve(train, report)?;
    let line = |name: &str, colour: usize, value: fn(&FieldIllumination) -> f64| Series {
        colour,
        ..Series::curve(name, curve.iter().map(|p| [p.image_y.abs(), 100.0 * value(p)]))
    };
    // cos⁴ of the field angle.
    let cosine4 = |p: &FieldIllumination| p.field.to_radians().cos().max(0.0).powi(4);
    let chart = Chart {
        title: title(report),
        notes: curve
            .is_empty()
            .then(|| "no image, no illumination".to_owned())
            .into_iter()
            .collect(),
        axes: [
            Axis::linear("height on the sensor (mm)"),
            Axis::linear("share of that on the axis (%)"),
        ],
        series: vec![
            line("relative illumination", 0, |p| p.relative),
            line("cos\u{2074} of the field angle", 4, cosine4),
        ],
        front: false,
    };
    Ok(chart.svg(Theme::Reader))
}

/// The illumination up to the image circle or the widest field; empty without an image.
fn curve(train: &OpticalTrain, report: &LensReport) -> Result<Vec<FieldIllumination>, GlassError> {
    let Some(z) = report.sensor_z else { return Ok(Vec::new()) };
    let named = report.fields.iter().fold(0.0_f64, |widest, field| widest.max(field.abs()));
    let widest = report.field_of_view.map_or(named, |full| 0.5 * full);
    let fields: Vec<f64> =
        (0..POINTS).map(|i| widest * f64::from(i) / f64::from(POINTS - 1)).collect();
    let at = train.at(train.wavelength())?;
    let mut curve = illumination(train, &at, &fields, z);
    if curve.iter().all(|point| point.image_y == 0.0) {
        curve.clear();
    }
    Ok(curve)
}
