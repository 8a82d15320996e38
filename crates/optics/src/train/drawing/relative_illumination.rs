//! Relative illumination over the sensor, beside the cosine's fourth power.

use super::{Anchor, Canvas, round_length, short, title};
use crate::glass::GlassError;
use crate::train::analysis::illumination;
use crate::train::{LensReport, OpticalTrain};

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 440.0;
const LEFT: f64 = 64.0;
const RIGHT: f64 = 30.0;
const HEAD: f64 = 62.0;
const FOOT: f64 = 52.0;

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
    let mut canvas = Canvas::new(WIDTH, HEIGHT, &title(report));
    let curve = curve(train, report)?;
    let widest = curve.iter().map(|point| point.height).fold(0.0, f64::max);
    if curve.len() < 2 || widest <= 0.0 {
        canvas.text([16.0, HEAD], Anchor::Start, "", "no image, no illumination");
        return Ok(canvas.finish());
    }
    let most = curve.iter().map(|point| point.relative).fold(1.0, f64::max);
    let across = |height: f64| LEFT + height / widest * (WIDTH - LEFT - RIGHT);
    let up = |share: f64| HEIGHT - FOOT - share / most * (HEIGHT - HEAD - FOOT);
    let axes = Axes { widest, most, across: &across, up: &up };
    axes.draw(&mut canvas);
    let line = |value: fn(&Point) -> f64| -> Vec<[f64; 2]> {
        curve.iter().map(|point| [across(point.height), up(value(point))]).collect()
    };
    canvas.path(&line(|point| point.cosine4), "c4", 1.2);
    canvas.path(&line(|point| point.relative), "c0", 2.2);
    key(&mut canvas);
    Ok(canvas.finish())
}

struct Point {
    height: f64,
    relative: f64,
    /// cos⁴ of the field angle.
    cosine4: f64,
}

fn curve(train: &OpticalTrain, report: &LensReport) -> Result<Vec<Point>, GlassError> {
    let Some(z) = report.sensor_z else { return Ok(Vec::new()) };
    let named = report.fields.iter().fold(0.0_f64, |widest, field| widest.max(field.abs()));
    let widest = report.field_of_view.map_or(named, |full| 0.5 * full);
    let fields: Vec<f64> =
        (0..POINTS).map(|i| widest * f64::from(i) / f64::from(POINTS - 1)).collect();
    let at = train.at(train.wavelength())?;
    let points = illumination(train, &at, &fields, z);
    let point = |p: &crate::train::analysis::Illumination| Point {
        height: p.image_y.abs(),
        relative: p.relative,
        cosine4: p.field.to_radians().cos().max(0.0).powi(4),
    };
    Ok(points.iter().map(point).collect())
}

struct Axes<'a> {
    widest: f64,
    most: f64,
    across: &'a dyn Fn(f64) -> f64,
    up: &'a dyn Fn(f64) -> f64,
}

impl Axes<'_> {
    fn draw(&self, canvas: &mut Canvas) {
        let (left, right) = ((self.across)(0.0), (self.across)(self.widest));
        let (bottom, top) = ((self.up)(0.0), (self.up)(self.most));
        for tick in ticks(self.most, 5.0) {
            let y = (self.up)(tick);
            canvas.line([left, y], [right, y], "faint");
            let words = format!("{} %", short(100.0 * tick));
            canvas.text([left - 8.0, y + 4.0], Anchor::End, "small", &words);
        }
        for tick in ticks(self.widest, 8.0) {
            let x = (self.across)(tick);
            canvas.line([x, bottom], [x, bottom + 5.0], "ink");
            canvas.text([x, bottom + 19.0], Anchor::Middle, "small", &short(tick));
        }
        canvas.line([left, bottom], [right, bottom], "ink");
        canvas.line([left, bottom], [left, top], "ink");
        let middle = 0.5 * (left + right);
        let words = "height on the sensor (mm)";
        canvas.text([middle, bottom + 40.0], Anchor::Middle, "", words);
    }
}

/// Round numbers from 0 to `most`, about `count` of them.
fn ticks(most: f64, count: f64) -> impl Iterator<Item = f64> {
    let step = round_length(most / count).max(most / 20.0);
    (0..=20).map(move |i| f64::from(i) * step).take_while(move |tick| *tick <= most * (1.0 + 1e-9))
}

fn key(canvas: &mut Canvas) {
    let y = 48.0;
    canvas.path(&[[LEFT, y - 4.0], [LEFT + 24.0, y - 4.0]], "c0", 2.2);
    canvas.text([LEFT + 30.0, y], Anchor::Start, "small", "relative illumination");
    let x = LEFT + 190.0;
    canvas.path(&[[x, y - 4.0], [x + 24.0, y - 4.0]], "c4", 1.2);
    canvas.text([x + 30.0, y], Anchor::Start, "small", "cos\u{2074} of the field angle");
}
