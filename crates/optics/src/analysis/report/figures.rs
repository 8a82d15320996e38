//! Figures of a report, as SVG in the charts' manner, and the page of HTML with them in it.

use std::fmt::Write;

use etendue_chart::{Axis, Chart, Series, Stroke, Theme, short, side_by_side};

use super::text::units_of;
use super::{FieldWaves, WaveReport};

/// A figure: the name of its file, and its SVG.
pub type Figure = (&'static str, String);

/// All figures of a report.
#[must_use]
pub fn figures(report: &WaveReport) -> Vec<Figure> {
    let mut all = vec![
        ("mtf.svg", mtf(report)),
        ("through-focus.svg", through_focus(report)),
        ("encircled.svg", encircled(report)),
        ("line-spread.svg", lines(report)),
        ("ray-fans.svg", ray_fans(report)),
        ("opd-fans.svg", wave_fans(report)),
    ];
    if !report.foci.is_empty() {
        all.push(("field-curvature.svg", field_curvature(report)));
    }
    if !report.distortion_grid.is_empty() {
        all.push(("distortion.svg", distortion(report)));
    }
    all
}

fn curve(
    name: impl Into<String>,
    colour: usize,
    stroke: Stroke,
    points: impl IntoIterator<Item = [f64; 2]>,
) -> Series {
    Series { colour, stroke, ..Series::curve(name, points) }
}

fn chart(title: &str, note: &str, axes: [&str; 2], series: Vec<Series>) -> Chart {
    Chart {
        title: title.to_owned(),
        notes: if note.is_empty() { Vec::new() } else { vec![note.to_owned()] },
        axes: axes.map(Axis::linear),
        series,
        front: false,
    }
}

/// The unit of small lengths on the image.
fn small(report: &WaveReport) -> &'static str {
    if report.image_unit == "mrad" { "\u{b5}rad" } else { "\u{b5}m" }
}

const LINES: &str = "through: tangential; dashed: sagittal";

fn mtf(report: &WaveReport) -> String {
    let frequency = format!("frequency ({})", units_of(report)[0]);
    let by = |title: &str, values: [fn(&super::Modulation) -> f64; 2]| {
        let of = |(i, field): (usize, &FieldWaves)| {
            let strokes = [Stroke::Solid, Stroke::Dashed];
            let names = [field.name.clone(), String::new()];
            let all = values.into_iter().zip(strokes).zip(names);
            all.map(|((value, stroke), name)| {
                curve(name, i, stroke, field.mtf.iter().map(|m| [m.frequency, value(m)]))
            })
            .collect::<Vec<_>>()
        };
        let series = report.fields.iter().enumerate().flat_map(of).collect();
        chart(title, LINES, [&frequency, "modulation"], series)
    };
    let charts = [
        by("MTF by diffraction", [|m| m.tangential, |m| m.sagittal]),
        by("MTF by rays", [|m| m.geometric_tangential, |m| m.geometric_sagittal]),
    ];
    side_by_side(&charts, Theme::Reader)
}

fn through_focus(report: &WaveReport) -> String {
    let of = |(i, field): (usize, &FieldWaves)| {
        let axis = |axis: usize| {
            let planes = field.through_focus.planes.iter();
            planes.filter_map(move |(defocus, m)| m.map(|m| [*defocus, m[axis]]))
        };
        let frequency = short(field.through_focus.frequency);
        let name = format!("{}, {frequency} {}", field.name, units_of(report)[0]);
        [curve(name, i, Stroke::Solid, axis(0)), curve("", i, Stroke::Dashed, axis(1))]
    };
    let series = report.fields.iter().enumerate().flat_map(of).collect();
    chart("MTF through focus", LINES, ["defocus (mm)", "modulation"], series).svg(Theme::Reader)
}

fn encircled(report: &WaveReport) -> String {
    let of = |(i, field): (usize, &FieldWaves)| {
        let points = field.encircled.iter().map(|[r, share]| [1e3 * r, 100.0 * share]);
        curve(field.name.clone(), i, Stroke::Solid, points)
    };
    let series = report.fields.iter().enumerate().map(of).collect();
    let radius = format!("radius about the brightest point ({})", small(report));
    let axes = [&*radius, "share of light (%)"];
    chart("Encircled energy", "", axes, series).svg(Theme::Reader)
}

fn lines(report: &WaveReport) -> String {
    let of = |(i, field): (usize, &FieldWaves)| {
        let line = |k: usize| field.line_spread[k].iter().map(|[at, value]| [1e3 * at, *value]);
        [
            curve(field.name.clone(), i, Stroke::Solid, line(0)),
            curve("", i, Stroke::Dashed, line(1)),
        ]
    };
    let series = report.fields.iter().enumerate().flat_map(of).collect();
    let from = format!("from the chief ray ({})", small(report));
    let irradiance = format!("irradiance of a line of power 1 (1/{})", units_of(report)[1]);
    let axes = [&*from, &*irradiance];
    chart("Line spread", LINES, axes, series).svg(Theme::Reader)
}

fn fan_charts(
    report: &WaveReport,
    what: &str,
    upwards: &str,
    value: fn(&super::super::fans::FanRay, usize) -> f64,
) -> String {
    let of = |field: &FieldWaves| {
        let mut series = Vec::new();
        for (i, fans) in field.fans.iter().enumerate() {
            let name = format!("{} nm", fans.wavelength);
            let rays = [&fans.tangential, &fans.sagittal];
            for (axis, (fan, stroke)) in
                rays.into_iter().zip([Stroke::Solid, Stroke::Dashed]).enumerate()
            {
                let name = if axis == 0 { name.clone() } else { String::new() };
                let points = fan.iter().map(|ray| [ray.pupil, value(ray, axis)]);
                series.push(curve(name, i, stroke, points));
            }
        }
        chart(&format!("{what}, {}", field.name), LINES, ["pupil", upwards], series)
    };
    let charts: Vec<Chart> = report.fields.iter().map(of).collect();
    side_by_side(&charts, Theme::Reader)
}

fn ray_fans(report: &WaveReport) -> String {
    let value =
        |ray: &super::super::fans::FanRay, axis: usize| 1e3 * if axis == 0 { ray.y } else { ray.x };
    let from = format!("from the chief ray ({})", small(report));
    fan_charts(report, "Ray fan", &from, value)
}

fn wave_fans(report: &WaveReport) -> String {
    fan_charts(report, "Wave fan", "ahead of the sphere (waves)", |ray, _| ray.waves)
}

fn field_curvature(report: &WaveReport) -> String {
    let curve_of = |name: &str, colour: usize, stroke, value: fn(&_) -> Option<f64>| {
        let points = report.foci.iter().filter_map(move |foci| Some([value(foci)?, foci.height]));
        curve(name, colour, stroke, points)
    };
    use super::super::astigmatism::FieldFoci;
    let series = vec![
        curve_of("tangential", 0, Stroke::Solid, |foci: &FieldFoci| foci.tangential),
        curve_of("sagittal", 1, Stroke::Dashed, |foci: &FieldFoci| foci.sagittal),
    ];
    let height = format!("height on the image ({})", units_of(report)[1]);
    let axes = ["from the image plane to the focus (mm)", &height];
    chart("Field curvature and astigmatism", "", axes, series).svg(Theme::Reader)
}

fn distortion(report: &WaveReport) -> String {
    use etendue_chart::{Mark, Point};
    let series = |name: &str, colour, mark, value: fn(&super::GridPoint) -> [f64; 2]| {
        let points = report.distortion_grid.iter().map(|p| Point { at: value(p), mark }).collect();
        Series { name: name.to_owned(), colour, points, ..Series::default() }
    };
    let all = vec![
        series("without distortion", 7, Mark::Ring, |p| p.ideal),
        series("chief rays", 0, Mark::Dot, |p| p.real),
    ];
    let unit = units_of(report)[1];
    let most = report.distortion_grid.iter().map(|p| p.percent).fold(0.0, f64::max);
    let note = format!("at most {} %", short((most * 1e4).round() / 1e4));
    chart("Distortion", &note, [&*format!("x ({unit})"), &*format!("y ({unit})")], all)
        .svg(Theme::Reader)
}

/// Colours of page and letters in the reader's light and dark theme, as those of the charts.
const STYLE: &str = "body{font-family:sans-serif;max-width:1000px;margin:2em auto;padding:0 1em;\
color-scheme:light dark}pre{overflow-x:auto;font-size:12px}figure{margin:1.5em 0}\
svg{max-width:100%;height:auto}";

/// The page. `above` is text that stands before the waves, such as the lens' table, and `drawings` are
/// SVG documents of the lens.
#[must_use]
pub fn page(title: &str, above: &str, drawings: &[String], report: &WaveReport) -> String {
    let mut html = String::new();
    let title = escaped(title);
    let text = format!("{above}{report}");
    // A string takes all that is written to it.
    let _ = write!(
        html,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\
         <style>{STYLE}</style></head>\n<body><h1>{title}</h1>\n"
    );
    let own = figures(report);
    for svg in drawings.iter().chain(own.iter().map(|(_, svg)| svg)) {
        // Within a page an SVG element stands without a declaration of its own.
        let start = svg.find("<svg").unwrap_or(0);
        let _ = writeln!(html, "<figure>{}</figure>", &svg[start..]);
    }
    let _ = writeln!(html, "<pre>{}</pre>\n</body></html>", escaped(&text));
    html
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
