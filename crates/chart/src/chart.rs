//! What a chart shows.

use crate::draw;

/// The colour of what is no contestant: limits and models.
pub const GREY: usize = 7;

/// A chart: points and lines over two axes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chart {
    /// The first line.
    pub title: String,
    /// What else has to be said, one line each.
    pub notes: Vec<String>,
    /// Across, and upwards.
    pub axes: [Axis; 2],
    /// Whatever is measured.
    pub series: Vec<Series>,
    /// Whether to draw the Pareto front: small values are good on both axes.
    pub front: bool,
}

/// An axis, logarithmic unless it is said to be linear.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Axis {
    /// What is measured, with its unit.
    pub label: String,
    /// What a value of exactly zero is called. With it, zeros have a place of their own below all
    /// other values; without it, they are left out.
    pub zero: Option<String>,
    /// Whether it ends where the values do, and not at the next power of ten.
    pub fits: bool,
    /// Whether it is linear, from 0 on.
    pub linear: bool,
}

/// Points of one name and colour.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Series {
    /// The name, which stands beside one of the points; none when empty.
    pub name: String,
    /// The points. Those that are not finite are left out, and those that a logarithmic axis has no
    /// place for.
    pub points: Vec<Point>,
    /// Whether a line joins them, in their order.
    pub joined: bool,
    /// How that line is drawn.
    pub stroke: Stroke,
    /// Which of the colours; series of one number look alike.
    pub colour: usize,
    /// Whether the points count for the Pareto front.
    pub contends: bool,
}

/// A point of a chart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Its values.
    pub at: [f64; 2],
    /// How it is drawn.
    pub mark: Mark,
}

/// How a point is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mark {
    /// A disk, beside which the name may stand.
    #[default]
    Disk,
    /// A ring.
    Ring,
    /// A small disk.
    Dot,
    /// Nothing but its line.
    None,
}

/// How a line is drawn.
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

/// For whom the colours are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Theme {
    /// The reader's own, light or dark.
    #[default]
    Reader,
    /// Light, for programs that know no themes.
    Light,
}

impl Axis {
    /// A logarithmic axis whose zeros are left out.
    #[must_use]
    pub fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// A linear axis from 0 on.
    #[must_use]
    pub fn linear(label: impl Into<String>) -> Self {
        Self { linear: true, ..Self::new(label) }
    }

    /// The same, ending where the values do.
    #[must_use]
    pub fn fitted(self) -> Self {
        Self { fits: true, ..self }
    }

    /// The same with a place for zeros, called `name`.
    #[must_use]
    pub fn with_zero(self, name: impl Into<String>) -> Self {
        Self { zero: Some(name.into()), ..self }
    }
}

impl Series {
    /// A line through `points`, marked by disks.
    #[must_use]
    pub fn line(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self::joined(name, points, Mark::Disk)
    }

    /// A line through `points`, which are not marked.
    #[must_use]
    pub fn curve(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self::joined(name, points, Mark::None)
    }

    fn joined(
        name: impl Into<String>,
        points: impl IntoIterator<Item = [f64; 2]>,
        mark: Mark,
    ) -> Self {
        let points = points.into_iter().map(|at| Point { at, mark }).collect();
        Self { name: name.into(), points, joined: true, ..Self::default() }
    }
}

impl Chart {
    /// The chart as an SVG document. Its fonts are the reader's sans-serif.
    #[must_use]
    pub fn svg(&self, theme: Theme) -> String {
        draw::single(self, theme)
    }
}

/// Smaller charts beside each other, two a row, as one SVG document.
#[must_use]
pub fn side_by_side(charts: &[Chart], theme: Theme) -> String {
    draw::rows(charts, theme)
}
