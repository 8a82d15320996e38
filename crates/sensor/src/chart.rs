//! Line charts with logarithmic axes, as SVG.

use std::fmt::Write as _;

/// A line of a chart.
pub(crate) struct Line<'a> {
    pub(crate) name: &'a str,
    pub(crate) colour: &'a str,
    /// SVG's `stroke-dasharray`; empty for a solid line.
    pub(crate) dashes: &'a str,
    /// Points; those that are not positive and finite are left out.
    pub(crate) points: Vec<[f64; 2]>,
}

/// A chart in a rectangle of an SVG.
pub(crate) struct Chart<'a> {
    pub(crate) title: &'a str,
    pub(crate) axes: [&'a str; 2],
    pub(crate) lines: Vec<Line<'a>>,
    /// Where its lines leave room for their names.
    pub(crate) legend: Corner,
}

/// A corner of a chart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Corner {
    TopLeft,
    TopRight,
    BottomRight,
}

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 360.0;
const LEFT: f64 = 64.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 48.0;
/// What a name in the legend may take, and its line's height.
const LEGEND: [f64; 2] = [160.0, 16.0];

/// Charts side by side.
pub(crate) fn svg(charts: &[Chart<'_>]) -> String {
    let width = WIDTH * charts.len() as f64;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{HEIGHT}\" viewBox=\"0 0 \
         {width} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
    );
    for (i, chart) in charts.iter().enumerate() {
        let _ = writeln!(out, "<g transform=\"translate({} 0)\">", WIDTH * i as f64);
        chart.draw(&mut out);
        out.push_str("</g>\n");
    }
    out.push_str("</svg>\n");
    out
}

/// A logarithmic axis from one power of ten to another.
struct Axis {
    decades: [i32; 2],
    pixels: [f64; 2],
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, pixels: [f64; 2]) -> Self {
        let [low, high] = values
            .fold([f64::INFINITY, 0.0f64], |[low, high], value| [low.min(value), high.max(value)]);
        let [low, high] = if low <= high { [low, high] } else { [1.0, 10.0] };
        #[expect(clippy::cast_possible_truncation, reason = "exponents of f64")]
        let [first, last] = [low.log10().floor() as i32, high.log10().ceil() as i32];
        Self { decades: [first, last.max(first + 1)], pixels }
    }

    fn at(&self, value: f64) -> f64 {
        let [first, last] = self.decades.map(f64::from);
        let part = (value.log10() - first) / (last - first);
        self.pixels[0] + part * (self.pixels[1] - self.pixels[0])
    }

    fn ticks(&self) -> impl Iterator<Item = (i32, f64)> + '_ {
        (self.decades[0]..=self.decades[1]).map(|decade| (decade, self.at(10f64.powi(decade))))
    }
}

impl Chart<'_> {
    fn draw(&self, out: &mut String) {
        let drawn = |point: &&[f64; 2]| point.iter().all(|v| *v > 0.0 && v.is_finite());
        let points = || self.lines.iter().flat_map(|line| &line.points).filter(drawn);
        let x = Axis::new(points().map(|point| point[0]), [LEFT, WIDTH - RIGHT]);
        let y = Axis::new(points().map(|point| point[1]), [HEIGHT - BOTTOM, TOP]);
        self.frame(out, &x, &y);
        for line in &self.lines {
            let places: Vec<String> = line
                .points
                .iter()
                .filter(drawn)
                .map(|point| format!("{:.1},{:.1}", x.at(point[0]), y.at(point[1])))
                .collect();
            let _ = writeln!(
                out,
                "<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\" stroke-dasharray=\"{}\" \
                 points=\"{}\"/>",
                line.colour,
                line.dashes,
                places.join(" ")
            );
        }
        let [wide, high] = LEGEND;
        let left = match self.legend {
            Corner::TopLeft => LEFT,
            Corner::TopRight | Corner::BottomRight => WIDTH - RIGHT - wide,
        };
        let top = match self.legend {
            Corner::TopLeft | Corner::TopRight => TOP,
            Corner::BottomRight => HEIGHT - BOTTOM - high * (self.lines.len() as f64 + 0.5),
        };
        for (i, line) in self.lines.iter().enumerate() {
            let at = top + high * (i as f64 + 1.0);
            let _ = writeln!(
                out,
                "<line x1=\"{0}\" x2=\"{1}\" y1=\"{2}\" y2=\"{2}\" stroke=\"{3}\" stroke-width=\"1.6\" \
                 stroke-dasharray=\"{4}\"/><text x=\"{5}\" y=\"{6}\">{7}</text>",
                left + 10.0,
                left + 36.0,
                at - 4.0,
                line.colour,
                line.dashes,
                left + 42.0,
                at,
                escaped(line.name)
            );
        }
    }

    fn frame(&self, out: &mut String, x: &Axis, y: &Axis) {
        let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
        let grid = "stroke=\"#dddddd\"";
        for (decade, at) in x.ticks() {
            let _ = writeln!(
                out,
                "<line x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{TOP}\" y2=\"{bottom}\" {grid}/>\
                 <text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                bottom + 16.0,
                power(decade)
            );
        }
        for (decade, at) in y.ticks() {
            let _ = writeln!(
                out,
                "<line x1=\"{LEFT}\" x2=\"{right}\" y1=\"{at:.1}\" y2=\"{at:.1}\" {grid}/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                LEFT - 6.0,
                at + 4.0,
                power(decade)
            );
        }
        let (middle_x, middle_y) = (0.5 * (LEFT + right), 0.5 * (TOP + bottom));
        let _ = writeln!(
            out,
            "<text x=\"{middle_x}\" y=\"20\" text-anchor=\"middle\" font-weight=\"bold\">{}</text>\
             <text x=\"{middle_x}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
             <text transform=\"translate(16 {middle_y}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            escaped(self.title),
            HEIGHT - 10.0,
            escaped(self.axes[0]),
            escaped(self.axes[1])
        );
    }
}

/// 10ⁿ, plain where that is short.
fn power(decade: i32) -> String {
    match decade {
        0..=3 => format!("{}", 10i32.pow(decade.unsigned_abs())),
        // Characters, not shifted text: programs that draw SVG disagree about where that goes.
        _ => format!("10{decade}").chars().enumerate().map(|(i, c)| raised(i, c)).collect(),
    }
}

/// A character of an exponent, which starts after `10`.
fn raised(place: usize, c: char) -> char {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    match (place, c) {
        (0 | 1, _) => c,
        (_, '-') => '⁻',
        _ => c.to_digit(10).map_or(c, |digit| DIGITS[digit as usize]),
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charts_hold_what_can_be_drawn() {
        let points = vec![[0.0, 1.0], [1.0, 1.0], [10.0, 100.0], [f64::NAN, 2.0], [100.0, -1.0]];
        let line = Line { name: "a < b", colour: "#000000", dashes: "", points };
        let empty = Line { name: "none", colour: "#ff0000", dashes: "4 2", points: Vec::new() };
        let chart = Chart {
            title: "t",
            axes: ["x", "y"],
            lines: vec![line, empty],
            legend: Corner::TopLeft,
        };
        let text = svg(&[chart]);
        // One decade wide and two high: its corners are the ends of the line.
        assert!(text.contains("points=\"64.0,312.0 444.0,34.0\""), "{text}");
        assert!(text.contains("a &lt; b") && !text.contains("NaN") && !text.contains("inf"));
        assert_eq!([power(-12), power(3), power(6)], ["10⁻¹²", "1000", "10⁶"]);
        assert!(text.starts_with("<svg") && text.ends_with("</svg>\n"));
    }
}
