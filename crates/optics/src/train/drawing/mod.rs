//! Pictures of a lens and of what it does, as SVG that follows the reader's light or dark theme.
//!
//! | module | idea |
//! |---|---|
//! | [`layout`] | the lens cut along y and z, with fans of rays |
//! | [`Section`] | the same cut as lines in millimetres, for those who draw themselves |
//! | [`spots`] | spot diagrams by field and wavelength |
//! | [`relative_illumination`] | relative illumination over the sensor |

mod layout;
mod relative_illumination;
mod section;
mod spots;

use super::LensReport;
use svg::node::element::path::Data;
use svg::node::element::{Circle, Line, Path, Rectangle, Style, Text};
use svg::{Document, Node};

pub use layout::layout;
pub use relative_illumination::relative_illumination;
pub use section::{DrawnElement, Section};
pub use spots::spots;

/// Colours by theme. A program that knows no themes shows the light one.
const STYLE: &str = "\
text { font: 13px sans-serif; fill: #24292f; }
.small { font-size: 11px; }
.title { font-size: 16px; font-weight: bold; }
.paper { fill: #ffffff; }
.ink { stroke: #24292f; fill: none; }
.faint { stroke: #8c959f; fill: none; stroke-width: 0.8; }
.glass { fill: #b6d7f2; fill-opacity: 0.55; stroke: none; }
.c0 { stroke: #0550ae; fill: none; } .c1 { stroke: #1a7f37; fill: none; }
.c2 { stroke: #cf222e; fill: none; } .c3 { stroke: #8250df; fill: none; }
.c4 { stroke: #bc4c00; fill: none; }
circle { fill-opacity: 0.7; }
.f0 { fill: #0550ae; } .f1 { fill: #1a7f37; } .f2 { fill: #cf222e; }
.f3 { fill: #8250df; } .f4 { fill: #bc4c00; }
@media (prefers-color-scheme: dark) {
text { fill: #e6edf3; } .paper { fill: #0d1117; } .ink { stroke: #e6edf3; }
.faint { stroke: #7d8590; } .glass { fill: #2f6f9f; }
.c0 { stroke: #79c0ff; } .c1 { stroke: #56d364; } .c2 { stroke: #ff7b72; }
.c3 { stroke: #d2a8ff; } .c4 { stroke: #ffa657; }
.f0 { fill: #79c0ff; } .f1 { fill: #56d364; } .f2 { fill: #ff7b72; }
.f3 { fill: #d2a8ff; } .f4 { fill: #ffa657; }
}";

/// Colours that the style has.
const COLOURS: usize = 5;

/// Where a text stands against its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Anchor {
    Start,
    Middle,
    End,
}

/// A drawing in pixels, y downwards.
#[derive(Debug)]
struct Canvas {
    document: Document,
}

impl Canvas {
    fn new(width: f64, height: f64, title: &str) -> Self {
        let paper = Rectangle::new()
            .set("class", "paper")
            .set("width", rounded(width))
            .set("height", rounded(height));
        let document = Document::new()
            .set("viewBox", (0, 0, rounded(width), rounded(height)))
            .set("width", rounded(width))
            .set("height", rounded(height))
            .add(Style::new(STYLE))
            .add(paper);
        let mut canvas = Self { document };
        canvas.text([16.0, 26.0], Anchor::Start, "title", title);
        canvas
    }

    fn add(&mut self, node: impl Into<Box<dyn Node>>) {
        self.document.append(node);
    }

    fn text(&mut self, at: [f64; 2], anchor: Anchor, class: &str, words: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let text = Text::new(words)
            .set("x", rounded(at[0]))
            .set("y", rounded(at[1]))
            .set("text-anchor", anchor)
            .set("class", class);
        self.add(text);
    }

    fn line(&mut self, from: [f64; 2], to: [f64; 2], class: &str) {
        let line = Line::new()
            .set("x1", rounded(from[0]))
            .set("y1", rounded(from[1]))
            .set("x2", rounded(to[0]))
            .set("y2", rounded(to[1]))
            .set("class", class);
        self.add(line);
    }

    fn dashed(&mut self, from: [f64; 2], to: [f64; 2], dashes: &str) {
        let line = Line::new()
            .set("x1", rounded(from[0]))
            .set("y1", rounded(from[1]))
            .set("x2", rounded(to[0]))
            .set("y2", rounded(to[1]))
            .set("class", "faint")
            .set("stroke-dasharray", dashes);
        self.add(line);
    }

    /// A polyline; closed when its class fills it.
    fn path(&mut self, points: &[[f64; 2]], class: &str, width: f64) {
        let [first, rest @ ..] = points else { return };
        let pair = |point: &[f64; 2]| (rounded(point[0]), rounded(point[1]));
        let mut data = Data::new().move_to(pair(first));
        for point in rest {
            data = data.line_to(pair(point));
        }
        if class == "glass" {
            data = data.close();
        }
        self.add(Path::new().set("class", class).set("stroke-width", width).set("d", data));
    }

    fn circle(&mut self, at: [f64; 2], radius: f64, class: &str) {
        let circle = Circle::new()
            .set("cx", rounded(at[0]))
            .set("cy", rounded(at[1]))
            .set("r", rounded(radius))
            .set("class", class);
        self.add(circle);
    }

    /// Paper over what was drawn before.
    fn cover(&mut self, corner: [f64; 2], size: [f64; 2]) {
        let paper = Rectangle::new()
            .set("class", "paper")
            .set("x", rounded(corner[0]))
            .set("y", rounded(corner[1]))
            .set("width", rounded(size[0]))
            .set("height", rounded(size[1]));
        self.add(paper);
    }

    fn finish(self) -> String {
        self.document.to_string()
    }
}

/// A hundredth of a pixel is more than enough; files stay small.
fn rounded(pixels: f64) -> f64 {
    (pixels * 100.0).round() / 100.0
}

/// 1, 2 or 5 times a power of ten, not above `most`.
fn round_length(most: f64) -> f64 {
    if !(most > 0.0 && most.is_finite()) {
        return 1.0;
    }
    let decade = 10_f64.powf(most.log10().floor());
    [5.0, 2.0, 1.0]
        .into_iter()
        .map(|step| step * decade)
        .find(|step| *step <= most)
        .unwrap_or(decade)
}

/// A number as people write it: at most four significant digits.
fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let text = format!("{value:.3e}");
    text.parse::<f64>().map_or(text, |rounded| rounded.to_string())
}

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

#[cfg(test)]
mod tests;
