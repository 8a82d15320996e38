//! Pictures of a lens and of what it does, as SVG that follows the reader's light or dark theme.
//!
//! | module | idea |
//! |---|---|
//! | [`layout`] | the lens cut along y and z, with fans of rays |
//! | [`Section`] | the same cut as lines in millimetres, for those who draw themselves |
//! | [`relative_illumination`] | illumination over the sensor, beside the cosine's fourth power |
//! | [`spots`] | spot diagrams: one box a field, one colour a wavelength, the same scale in all |

mod layout;
mod section;
#[cfg(test)]
mod tests;

use glam::DVec2;

use super::LensReport;
use crate::glass::GlassError;
use crate::train::analysis::{FieldIllumination, Spot, illumination, spot};
use crate::train::{FieldSpec, OpticalTrain};
use etendue_chart::{Axis, Canvas, Chart, Series, TextAnchor, Theme, round_length, short};

pub use layout::layout;
pub use section::{DrawnElement, Section};

/// Colours of fields and wavelengths before they begin again.
const COLOURS: usize = 5;

/// A lens' name for a title, with its focal length and f-number.
fn title(report: &LensReport) -> String {
    let mut words = vec![if report.name.is_empty() { "Lens" } else { &report.name }.to_owned()];
    if let Some(efl) = report.paraxial.efl {
        words.push(format!("f = {} mm", short(efl)));
    }
    if let Some(n) = report.paraxial.f_number {
        words.push(format!("f/{}", short((n * 100.0).round() / 100.0)));
    }
    words.join(" \u{b7} ")
}

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

/// A box's side and the gap between boxes (pixels).
const BOX: f64 = 190.0;
const GAP: f64 = 22.0;
const COLUMNS: usize = 5;
const HEAD: f64 = 76.0;
/// Room for a box's captions.
const CAPTION: f64 = 40.0;

/// The spots of a report's fields at its wavelengths, about the centroid of the main one, on the
/// sensor, with the RMS radius of all of them together. The dashed circle is the Airy disk, 1.22 λN in radius.
///
/// # Errors
///
/// When a glass has no index at one of the wavelengths.
pub fn spots(train: &OpticalTrain, report: &LensReport) -> Result<String, GlassError> {
    let boxes = boxes(train, report)?;
    let columns = boxes.len().clamp(1, COLUMNS);
    let rows = boxes.len().div_ceil(columns).max(1);
    let size = |count: usize, step: f64| f64::from(u32::try_from(count).unwrap_or(1)) * step;
    let width = (GAP + size(columns, BOX + GAP)).max(640.0);
    let height = HEAD + size(rows, BOX + CAPTION + GAP) + 14.0;
    let mut canvas = Canvas::new(width, height, &title(report));
    let reach = boxes.iter().map(SpotBox::reach).fold(1e-6, f64::max);
    let scale = 0.46 * BOX / reach;
    legend(&mut canvas, report, &boxes, scale, width);
    for (i, spots) in boxes.iter().enumerate() {
        let corner =
            [GAP + size(i % columns, BOX + GAP), HEAD + size(i / columns, BOX + CAPTION + GAP)];
        spots.draw(&mut canvas, corner, scale, report);
    }
    Ok(canvas.svg(Theme::Reader))
}

/// The spots of one field by wavelength.
struct SpotBox {
    field: f64,
    spots: Vec<Option<Spot>>,
    /// Of the main wavelength.
    main: Option<Spot>,
}

fn boxes(train: &OpticalTrain, report: &LensReport) -> Result<Vec<SpotBox>, GlassError> {
    let Some(z) = report.sensor_z else { return Ok(Vec::new()) };
    let wavelengths = drawn_wavelengths(report);
    let mut lenses = Vec::new();
    for &wavelength in &wavelengths {
        lenses.push(train.at(wavelength)?);
    }
    let of_field = |&field: &f64| SpotBox {
        field,
        spots: lenses.iter().map(|at| spot(train, at, &FieldSpec::at(field), z)).collect(),
        main: report.spots.iter().find(|spot| spot.field == field).cloned(),
    };
    Ok(report.fields.iter().map(of_field).collect())
}

/// The wavelengths that run differently: one for all where no glass disperses.
fn drawn_wavelengths(report: &LensReport) -> Vec<f64> {
    let differs = |row: &crate::train::report::ColourRow| row.paraxial.bfl != report.paraxial.bfl;
    if report.colour.iter().any(differs) {
        report.colour.iter().map(|row| row.wavelength).take(COLOURS).collect()
    } else {
        vec![report.wavelength]
    }
}

impl SpotBox {
    fn centre(&self) -> f64 {
        let any = self.main.as_ref().or_else(|| self.spots.iter().flatten().next());
        any.map_or(0.0, |spot| spot.centroid_y)
    }

    /// Points of a wavelength from the main one's centroid (mm).
    fn points<'a>(&'a self, spot: &'a Spot) -> impl Iterator<Item = DVec2> + 'a {
        let shift = DVec2::new(0.0, spot.centroid_y - self.centre());
        spot.points.iter().map(move |&point| point + shift)
    }

    /// The root mean square radius (mm) of all wavelengths' rays together, about their centroid.
    fn rms(&self) -> Option<f64> {
        let points: Vec<DVec2> =
            self.spots.iter().flatten().flat_map(|spot| self.points(spot)).collect();
        #[expect(clippy::cast_precision_loss, reason = "a few thousand rays")]
        let count = points.len() as f64;
        let centroid = points.iter().sum::<DVec2>() / count;
        let square: f64 = points.iter().map(|point| (*point - centroid).length_squared()).sum();
        (!points.is_empty()).then(|| (square / count).sqrt())
    }

    fn reach(&self) -> f64 {
        let points = self.spots.iter().flatten().flat_map(|spot| self.points(spot));
        points.map(|point| point.abs().max_element()).fold(0.0, f64::max)
    }

    fn draw(&self, canvas: &mut Canvas, [x, y]: [f64; 2], scale: f64, report: &LensReport) {
        let (right, bottom) = (x + BOX, y + BOX);
        canvas.path(&[[x, y], [right, y], [right, bottom], [x, bottom], [x, y]], "faint", 0.8);
        let middle = [x + 0.5 * BOX, y + 0.5 * BOX];
        for (i, spot) in self.spots.iter().enumerate() {
            let class = format!("f{}", i % COLOURS);
            for point in spot.iter().flat_map(|spot| self.points(spot)) {
                let at = [middle[0] + point.x * scale, middle[1] - point.y * scale];
                canvas.dot(at, 0.9, &class);
            }
        }
        // A ring of less than a pixel says nothing.
        let airy = airy_radius(report).map(|radius| radius * scale);
        if let Some(radius) = airy.filter(|radius| (1.0..0.5 * BOX).contains(radius)) {
            canvas.ring(middle, radius);
        }
        let caption = match self.rms() {
            Some(rms) => format!("RMS {} \u{b5}m", short(1e3 * rms)),
            None => "no light".to_owned(),
        };
        let field = format!("{}\u{b0}", short(self.field));
        canvas.text([x, bottom + 16.0], TextAnchor::Start, "", &field);
        canvas.text([right, bottom + 16.0], TextAnchor::End, "", &caption);
    }
}

/// 1.22 λN (mm).
fn airy_radius(report: &LensReport) -> Option<f64> {
    report.paraxial.f_number.map(|n| 1.22 * report.wavelength * 1e-6 * n)
}

fn legend(canvas: &mut Canvas, report: &LensReport, boxes: &[SpotBox], scale: f64, width: f64) {
    let y = 52.0;
    if boxes.is_empty() {
        canvas.text([16.0, y], TextAnchor::Start, "", "no image, no spots");
        return;
    }
    for (i, wavelength) in drawn_wavelengths(report).iter().enumerate() {
        let x = 22.0 + 110.0 * f64::from(u32::try_from(i).unwrap_or(0));
        canvas.dot([x, y - 4.0], 4.0, &format!("f{}", i % COLOURS));
        canvas.text([x + 9.0, y], TextAnchor::Start, "small", &format!("{wavelength} nm"));
    }
    if let Some(radius) = airy_radius(report) {
        let words =
            format!("dashed where it shows: Airy disk, radius {} \u{b5}m", short(1e3 * radius));
        canvas.text([16.0, y + 17.0], TextAnchor::Start, "small", &words);
    }
    let length = round_length(90.0 / scale);
    let right = width - GAP;
    let left = right - length * scale;
    canvas.path(&[[left, y - 4.0], [right, y - 4.0]], "ink", 2.0);
    let words = format!("{} \u{b5}m", short(1e3 * length));
    canvas.text([left - 8.0, y], TextAnchor::End, "small", &words);
}
