//! A page for drawings that are no charts: lines, bodies, dots and words in pixels, y downwards.

use svg::Node;
use svg::node::element::{Circle, Group, Rectangle};

use crate::chart::Theme;
use crate::ink::{self, TextAnchor, polyline, rounded};

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
        ink::text(&mut self.group, at, anchor, class, words);
    }

    /// A thin line in dashes and gaps of these lengths.
    pub fn dashed(&mut self, from: [f64; 2], to: [f64; 2], dashes: &str) {
        ink::dashed(&mut self.group, from, to, dashes);
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
        ink::document(self.size, theme).add(self.group).to_string()
    }
}

fn circle(at: [f64; 2], radius: f64) -> Circle {
    Circle::new().set("cx", rounded(at[0])).set("cy", rounded(at[1])).set("r", rounded(radius))
}
