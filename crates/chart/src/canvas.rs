//! Lines, bodies, dots and letters in the colours of a theme, and a page for drawings that are no
//! charts: pixels, y downwards.

use svg::node::element::path::Data;
use svg::node::element::{Circle, Group, Line, Path, Rectangle, Style, Text};
use svg::{Document, Node};

/// A drawing in pixels, y downwards. Its classes are those of the style: `ink` and `faint` for lines,
/// `glass` for bodies, `s0` to `s7` for lines and `f0` to `f7` for dots in the colours of charts.
#[derive(Debug)]
pub struct Canvas {
    size: [f64; 2],
    group: Group,
}

impl Canvas {
    /// An empty page of this width and height under a title.
    #[must_use]
    pub fn new(width: f64, height: f64, title: &str) -> Self {
        let mut canvas = Self { size: [width, height], group: Group::new() };
        canvas.text([16.0, 26.0], TextAnchor::Start, "title", title);
        canvas
    }

    /// Words beside a place.
    pub fn text(&mut self, at: [f64; 2], anchor: TextAnchor, class: &str, words: &str) {
        text(&mut self.group, at, anchor, class, words);
    }

    /// A thin line in dashes and gaps of these lengths.
    pub fn dashed(&mut self, from: [f64; 2], to: [f64; 2], dashes: &str) {
        dashed(&mut self.group, from, to, dashes);
    }

    /// A line through `points`.
    pub fn path(&mut self, points: &[[f64; 2]], class: &str, width: f64) {
        if let Some(path) = polyline(points, false) {
            let path = path.set("class", class).set("fill", "none");
            self.group.append(path.set("stroke-width", width));
        }
    }

    /// A body of glass.
    pub fn glass(&mut self, outline: &[[f64; 2]]) {
        if let Some(body) = polyline(outline, true) {
            self.group.append(body.set("class", "glass"));
        }
    }

    /// A dot in the colour of its class.
    pub fn dot(&mut self, at: [f64; 2], radius: f64, class: &str) {
        self.group.append(circle(at, radius).set("class", format!("dot {class}")));
    }

    /// A circle in dashes.
    pub fn ring(&mut self, at: [f64; 2], radius: f64) {
        let ring = circle(at, radius).set("class", "ink").set("stroke-dasharray", "4 3");
        self.group.append(ring);
    }

    /// Paper over what was drawn before.
    pub fn cover(&mut self, corner: [f64; 2], size: [f64; 2]) {
        let paper = Rectangle::new()
            .set("class", "paper")
            .set("x", rounded(corner[0]))
            .set("y", rounded(corner[1]))
            .set("width", rounded(size[0]))
            .set("height", rounded(size[1]));
        self.group.append(paper);
    }

    /// The drawing as an SVG document.
    #[must_use]
    pub fn svg(self, theme: Theme) -> String {
        document(self.size, theme).add(self.group).to_string()
    }
}

fn circle(at: [f64; 2], radius: f64) -> Circle {
    Circle::new().set("cx", rounded(at[0])).set("cy", rounded(at[1])).set("r", rounded(radius))
}

/// Colours by theme.
const LIGHT: &str = "\
text { font-family: sans-serif; font-size: 12px; fill: #24292f; }
.title { font-size: 16px; } .small { font-size: 11px; fill: #57606a; }
.paper { fill: #ffffff; } .halo { fill: #ffffff; fill-opacity: 0.82; }
.ink { stroke: #57606a; fill: none; } .faint { stroke: #d8dee4; fill: none; }
.front { stroke: #57606a; stroke-opacity: 0.3; fill: none; stroke-width: 7px; }
.ring { fill: #ffffff; } .dot { fill-opacity: 0.7; }
.glass { fill: #b6d7f2; fill-opacity: 0.55; }
.s0 { stroke: #0550ae; } .s1 { stroke: #1a7f37; } .s2 { stroke: #cf222e; }
.s3 { stroke: #8250df; } .s4 { stroke: #bc4c00; } .s5 { stroke: #0b7285; }
.s6 { stroke: #bf3989; } .s7 { stroke: #57606a; }
.f0 { fill: #0550ae; } .f1 { fill: #1a7f37; } .f2 { fill: #cf222e; }
.f3 { fill: #8250df; } .f4 { fill: #bc4c00; } .f5 { fill: #0b7285; }
.f6 { fill: #bf3989; } .f7 { fill: #57606a; }
";

const DARK: &str = "\
@media (prefers-color-scheme: dark) {
text { fill: #e6edf3; } .small { fill: #9198a1; }
.paper { fill: #0d1117; } .halo { fill: #0d1117; } .ring { fill: #0d1117; }
.glass { fill: #2f6f9f; }
.ink { stroke: #9198a1; } .faint { stroke: #30363d; } .front { stroke: #9198a1; }
.s0 { stroke: #79c0ff; } .s1 { stroke: #56d364; } .s2 { stroke: #ff7b72; }
.s3 { stroke: #d2a8ff; } .s4 { stroke: #ffa657; } .s5 { stroke: #66d9e8; }
.s6 { stroke: #ff9bce; } .s7 { stroke: #b1bac4; }
.f0 { fill: #79c0ff; } .f1 { fill: #56d364; } .f2 { fill: #ff7b72; }
.f3 { fill: #d2a8ff; } .f4 { fill: #ffa657; } .f5 { fill: #66d9e8; }
.f6 { fill: #ff9bce; } .f7 { fill: #b1bac4; }
}
";

/// A document of one size (pixels): the style's sheet, and paper.
pub(crate) fn document([width, height]: [f64; 2], theme: Theme) -> Document {
    let style = match theme {
        Theme::Reader => format!("{LIGHT}{DARK}"),
        Theme::Light => LIGHT.to_owned(),
    };
    let (width, height) = (rounded(width), rounded(height));
    let paper = Rectangle::new().set("class", "paper").set("width", width).set("height", height);
    Document::new()
        .set("viewBox", (0, 0, width, height))
        .set("width", width)
        .set("height", height)
        .add(Style::new(style))
        .add(paper)
}

/// Colours that the style has.
pub(crate) const COLOURS: usize = 8;

/// Alignment of a text with its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextAnchor {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

pub(crate) fn text(
    document: &mut Group,
    at: [f64; 2],
    anchor: TextAnchor,
    class: &str,
    words: &str,
) {
    let anchor = match anchor {
        TextAnchor::Start => "start",
        TextAnchor::Middle => "middle",
        TextAnchor::End => "end",
    };
    let text = Text::new(words)
        .set("x", rounded(at[0]))
        .set("y", rounded(at[1]))
        .set("text-anchor", anchor);
    document.append(if class.is_empty() { text } else { text.set("class", class) });
}

pub(crate) fn straight(from: [f64; 2], to: [f64; 2]) -> Line {
    Line::new()
        .set("x1", rounded(from[0]))
        .set("y1", rounded(from[1]))
        .set("x2", rounded(to[0]))
        .set("y2", rounded(to[1]))
}

pub(crate) fn line(document: &mut Group, from: [f64; 2], to: [f64; 2], class: &str) {
    document.append(straight(from, to).set("class", class));
}

pub(crate) fn dashed(document: &mut Group, from: [f64; 2], to: [f64; 2], dashes: &str) {
    document.append(straight(from, to).set("class", "ink").set("stroke-dasharray", dashes));
}

pub(crate) fn path(document: &mut Group, points: &[[f64; 2]], class: &str, stroke: Stroke) {
    let Some(path) = polyline(points, false) else { return };
    let mut path = path.set("class", class).set("fill", "none");
    if class != "front" {
        path = path.set("stroke-width", 1.6);
    }
    match stroke {
        Stroke::Solid => {}
        Stroke::Dashed => path = path.set("stroke-dasharray", "5 4"),
        Stroke::Dotted => path = path.set("stroke-dasharray", "2 3"),
    }
    document.append(path);
}

/// A line through `points`, and back to the first of them when it is closed; none without points.
pub(crate) fn polyline(points: &[[f64; 2]], closed: bool) -> Option<Path> {
    let [first, rest @ ..] = points else { return None };
    let pair = |point: &[f64; 2]| (rounded(point[0]), rounded(point[1]));
    let open =
        rest.iter().fold(Data::new().move_to(pair(first)), |d, point| d.line_to(pair(point)));
    Some(Path::new().set("d", if closed { open.close() } else { open }))
}

/// A hundredth of a pixel is more than enough; files stay small.
pub(crate) fn rounded(pixels: f64) -> f64 {
    (pixels * 100.0).round() / 100.0
}

/// For whom the colours are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Theme {
    /// The reader's own, light or dark.
    #[default]
    Reader,
    /// Light, for programs that know no themes.
    Light,
}

/// Stroke of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Stroke {
    /// Through.
    #[default]
    Solid,
    /// In dashes.
    Dashed,
    /// In dots, which show on top of dashes.
    Dotted,
}
