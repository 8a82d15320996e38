//! Openings that are no circle, polygon or mask: rectangles, ellipses, outlines by their corners, rings, and rings
//! behind a spider. Rectangles, ellipses and outlines may be what is in the way instead of what is open.

use etendue_geometry::units::{Degrees, Millimetres};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Radius (mm) of the smallest opening that lets rays through beside each other: squares of smaller ones would
/// soon be no numbers.
pub(crate) const SMALLEST_RADIUS: f64 = 1e-9;

/// A rectangle, or an ellipse in one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxSpec {
    /// Width along x before it is turned (mm).
    pub width: Millimetres,
    /// Height along y before it is turned (mm).
    pub height: Millimetres,
    /// Turned about the axis from +x towards +y (degrees).
    #[serde(default, skip_serializing_if = "super::is_default")]
    pub rotation: Degrees,
    /// True if it is in the way: opaque inside, and open all around.
    #[serde(default, skip_serializing_if = "super::is_default")]
    pub obscures: bool,
}

/// An outline by its corners.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OutlineSpec {
    /// `[x, y]` of the corners in their order (mm), 3 to 1024; the last is joined to the first. Where the outline
    /// crosses itself, places are inside that a line from afar reaches by an odd number of crossings.
    pub corners: Vec<[Millimetres; 2]>,
    /// True if it is in the way: opaque inside, and open all around.
    #[serde(default, skip_serializing_if = "super::is_default")]
    pub obscures: bool,
}

/// A ring around a disk that is in the way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AnnularSpec {
    /// The radius of the disk (mm).
    pub inner_radius: Millimetres,
    /// The radius of the opening around it (mm). Unlimited when absent: the disk alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<Millimetres>,
}

/// A ring crossed by the arms that hold what is in its middle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpiderSpec {
    /// The number of arms, from the middle outwards, 1 or more.
    pub arms: u32,
    /// The width of an arm (mm).
    pub width: Millimetres,
    /// The direction of the first arm from +x towards +y (degrees).
    #[serde(default, skip_serializing_if = "super::is_default")]
    pub rotation: Degrees,
    /// The radius of the disk in the middle (mm); 0 when absent.
    #[serde(default, skip_serializing_if = "super::is_default")]
    pub inner_radius: Millimetres,
    /// The radius of the opening around it (mm). Unlimited when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<Millimetres>,
}

/// The most arms.
const MOST_ARMS: u32 = 64;

/// The fewest and the most corners.
const CORNERS: std::ops::RangeInclusive<usize> = 3..=1024;

/// An opening in its own plane (mm).
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    kind: ShapeKind,
    /// Cosine and sine of how far it is turned.
    turn: [f64; 2],
    /// Radius of the opening outside of what is in the way (mm), infinite when unlimited.
    outer: Option<f64>,
}

#[derive(Debug, Clone, PartialEq)]
enum ShapeKind {
    /// By half its sides.
    Rectangle([f64; 2]),
    /// By its half axes.
    Ellipse([f64; 2]),
    /// By its corners.
    Outline(Vec<[f64; 2]>),
    /// A ring, with the unit vectors along its arms and half their width.
    Ring { inner: f64, outer: f64, arms: Vec<[f64; 2]>, half_width: f64 },
}

fn length(key: &str, value: f64) -> Result<f64, String> {
    let sound = value >= SMALLEST_RADIUS && value.is_finite();
    sound.then_some(value).ok_or_else(|| {
        format!("{key} is {value} mm; it must be a length from {SMALLEST_RADIUS:e} mm on")
    })
}

fn turn(rotation: Degrees) -> [f64; 2] {
    let (sine, cosine) = rotation.0.to_radians().sin_cos();
    [cosine, sine]
}

impl BoxSpec {
    fn half(&self) -> Result<[f64; 2], String> {
        Ok([0.5 * length("width", self.width.0)?, 0.5 * length("height", self.height.0)?])
    }

    pub(super) fn rectangle(&self) -> Result<Shape, String> {
        self.shape(ShapeKind::Rectangle(self.half()?))
    }

    pub(super) fn ellipse(&self) -> Result<Shape, String> {
        self.shape(ShapeKind::Ellipse(self.half()?))
    }

    fn shape(&self, kind: ShapeKind) -> Result<Shape, String> {
        if !self.rotation.0.is_finite() {
            return Err("rotation must be finite".to_owned());
        }
        Ok(Shape { kind, turn: turn(self.rotation), outer: self.obscures.then_some(f64::INFINITY) })
    }
}

impl OutlineSpec {
    pub(super) fn build(&self) -> Result<Shape, String> {
        let count = self.corners.len();
        if !CORNERS.contains(&count) {
            let [fewest, most] = [CORNERS.start(), CORNERS.end()];
            return Err(format!("corners has {count}; an outline has {fewest} to {most}"));
        }
        let corners: Vec<[f64; 2]> =
            self.corners.iter().map(|corner| corner.map(|c| c.0)).collect();
        if let Some(i) = corners.iter().position(|c| !(c[0].is_finite() && c[1].is_finite())) {
            return Err(format!("corners[{i}] must be finite lengths"));
        }
        let kind = ShapeKind::Outline(corners);
        length("the distance of the farthest of corners", kind.radius())?;
        Ok(Shape { kind, turn: [1.0, 0.0], outer: self.obscures.then_some(f64::INFINITY) })
    }
}

fn ring(inner: f64, radius: Option<Millimetres>) -> Result<[f64; 2], String> {
    if !(inner >= 0.0 && inner.is_finite()) {
        return Err(format!("inner_radius is {inner} mm; it must be a length from 0 on"));
    }
    let outer = radius.map_or(Ok(f64::INFINITY), |radius| length("radius", radius.0))?;
    if inner >= outer {
        return Err(format!(
            "inner_radius is {inner} mm and radius {outer} mm: nothing is open between the two"
        ));
    }
    Ok([inner, outer])
}

impl AnnularSpec {
    pub(super) fn build(&self) -> Result<Shape, String> {
        let [inner, outer] = ring(self.inner_radius.0, self.radius)?;
        let kind = ShapeKind::Ring { inner, outer, arms: Vec::new(), half_width: 0.0 };
        Ok(Shape { kind, turn: [1.0, 0.0], outer: None })
    }
}

impl SpiderSpec {
    pub(super) fn build(&self) -> Result<Shape, String> {
        let [inner, outer] = ring(self.inner_radius.0, self.radius)?;
        if !(1..=MOST_ARMS).contains(&self.arms) {
            return Err(format!("arms is {}; it must be 1 to {MOST_ARMS}", self.arms));
        }
        let half_width = 0.5 * length("width", self.width.0)?;
        let step = std::f64::consts::TAU / f64::from(self.arms);
        let arm = |i: u32| {
            let (sine, cosine) = (step * f64::from(i)).sin_cos();
            [cosine, sine]
        };
        let arms = (0..self.arms).map(arm).collect();
        Ok(Shape {
            kind: ShapeKind::Ring { inner, outer, arms, half_width },
            turn: turn(self.rotation),
            outer: None,
        })
    }
}

/// Tests whether a point lies inside an outline, by the crossings of a line from there to afar
/// along x.
fn is_in_outline(corners: &[[f64; 2]], x: f64, y: f64) -> bool {
    let mut before = corners[corners.len() - 1];
    let mut is_inside = false;
    for &corner in corners {
        let ([u, v], [p, q]) = (before, corner);
        let is_crossed = (v > y) != (q > y) && x < u + (y - v) / (q - v) * (p - u);
        is_inside ^= is_crossed;
        before = corner;
    }
    is_inside
}

impl ShapeKind {
    fn holds(&self, x: f64, y: f64) -> bool {
        match self {
            Self::Rectangle([a, b]) => x.abs() <= *a && y.abs() <= *b,
            Self::Ellipse([a, b]) => (x / a).powi(2) + (y / b).powi(2) <= 1.0,
            Self::Outline(corners) => is_in_outline(corners, x, y),
            Self::Ring { inner, outer, arms, half_width } => {
                let square = x * x + y * y;
                let is_on =
                    |[u, v]: &[f64; 2]| x * u + y * v > 0.0 && (y * u - x * v).abs() < *half_width;
                square >= inner * inner && square <= outer * outer && !arms.iter().any(is_on)
            }
        }
    }

    fn radius(&self) -> f64 {
        match self {
            Self::Rectangle([a, b]) => a.hypot(*b),
            Self::Ellipse([a, b]) => a.max(*b),
            Self::Outline(corners) => {
                corners.iter().fold(0.0, |most, [x, y]| most.max(x.hypot(*y)))
            }
            Self::Ring { outer, .. } => *outer,
        }
    }
}

impl Shape {
    /// True if the point `x`, `y` (mm) is open.
    #[must_use]
    pub fn is_open(&self, x: f64, y: f64) -> bool {
        let [c, s] = self.turn;
        let (along, across) = (c * x + s * y, c * y - s * x);
        match self.outer {
            None => self.kind.holds(along, across),
            Some(outer) => !self.kind.holds(along, across) && x * x + y * y <= outer * outer,
        }
    }

    /// The radius of the circle around what is open (mm).
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.outer.unwrap_or_else(|| self.kind.radius())
    }

    /// Returns the shape scaled so that `radius` (mm) is that of the circle around it. A ring whose
    /// opening is not limited keeps its disk, and so does what is in the way.
    #[must_use]
    pub fn with_radius(&self, radius: f64) -> Self {
        if self.outer.is_some() {
            return Self { outer: Some(radius), ..self.clone() };
        }
        let scale = radius / self.radius();
        let kind = match &self.kind {
            ShapeKind::Rectangle(half) => ShapeKind::Rectangle(half.map(|half| half * scale)),
            ShapeKind::Ellipse(half) => ShapeKind::Ellipse(half.map(|half| half * scale)),
            ShapeKind::Outline(corners) => {
                ShapeKind::Outline(corners.iter().map(|corner| corner.map(|c| c * scale)).collect())
            }
            ShapeKind::Ring { inner, outer, arms, half_width } => {
                let scale = if outer.is_finite() && radius.is_finite() { scale } else { 1.0 };
                ShapeKind::Ring {
                    inner: inner * scale,
                    outer: radius,
                    arms: arms.clone(),
                    half_width: half_width * scale,
                }
            }
        };
        Self { kind, turn: self.turn, outer: None }
    }

    /// True if a turn about the axis changes nothing.
    #[must_use]
    pub fn is_round(&self) -> bool {
        matches!(&self.kind, ShapeKind::Ring { arms, .. } if arms.is_empty())
    }

    /// True if something blocks the middle of the opening.
    #[must_use]
    pub fn is_obscured(&self) -> bool {
        self.outer.is_some() || matches!(&self.kind, ShapeKind::Ring { inner, .. } if *inner > 0.0)
    }

    /// The radius up to which light passes around what is in the way (mm), infinite when unlimited; `None` where nothing
    /// is in the way.
    #[must_use]
    pub fn outer_radius(&self) -> Option<f64> {
        match self.kind {
            ShapeKind::Ring { outer, .. } => Some(outer),
            ShapeKind::Rectangle(_) | ShapeKind::Ellipse(_) | ShapeKind::Outline(_) => self.outer,
        }
    }

    /// Words on it.
    pub(super) fn words(&self) -> String {
        let prefix = if self.outer.is_some() { "around a " } else { "" };
        match &self.kind {
            ShapeKind::Rectangle([a, b]) => {
                format!("{prefix}rectangle of {} x {} mm", 2.0 * a, 2.0 * b)
            }
            ShapeKind::Ellipse([a, b]) => {
                format!("{prefix}ellipse of {} x {} mm", 2.0 * a, 2.0 * b)
            }
            ShapeKind::Outline(corners) => format!("{prefix}outline of {} corners", corners.len()),
            ShapeKind::Ring { inner, arms, .. } if arms.is_empty() => {
                format!("around a disk of radius {inner} mm")
            }
            ShapeKind::Ring { inner, arms, .. } => {
                format!("{} arms around a disk of radius {inner} mm", arms.len())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::ApertureSpec;

    fn shape(json: &str) -> Result<super::super::Opening, String> {
        let spec: ApertureSpec = serde_json::from_str(json).map_err(|e| e.to_string())?;
        spec.build(&|name: &str| Err(name.to_owned()))
    }

    /// The open share of the square of 4 mm a side, by 400 × 400 places: within a row of places along its outline.
    fn area(json: &str) -> f64 {
        let opening = shape(json).unwrap();
        let at = |i: u32| (f64::from(i) + 0.5) / 100.0 - 2.0;
        let places = (0..160_000).filter(|i| opening.transmission(at(i % 400), at(i / 400)) == 1.0);
        places.count() as f64 * 1e-4
    }

    #[test]
    fn areas_are_those_of_the_shapes() {
        let pi = std::f64::consts::PI;
        // Outlines of some 10 mm cross a thousand places of 1e-4 mm²; half of those next to it are miscounted at most.
        for (json, expected) in [
            (r#"{"shape": "rectangular", "width": 2, "height": 1, "rotation": 30}"#, 2.0),
            (r#"{"shape": "elliptical", "width": 2, "height": 1, "rotation": -20}"#, 0.5 * pi),
            (r#"{"shape": "annular", "radius": 1.5, "inner_radius": 0.5}"#, 2.0 * pi),
            // Three arms of 0.2 mm from 0.5 to 1.5 mm, less what their ends miss by being straight.
            (
                r#"{"shape": "spider", "arms": 3, "width": 0.2, "radius": 1.5, "inner_radius": 0.5, "rotation": 10}"#,
                2.0 * pi - 0.6,
            ),
            // An L of 3 mm², and a bow tie, whose two triangles of 1 mm² are both inside.
            (
                r#"{"shape": "outline", "corners": [[-1, -1], [1, -1], [1, 0], [0, 0], [0, 1], [-1, 1]]}"#,
                3.0,
            ),
            (r#"{"shape": "outline", "corners": [[-1, -1], [1, 1], [1, -1], [-1, 1]]}"#, 2.0),
            // What is in the way takes its area from the square.
            (
                r#"{"shape": "rectangular", "width": 2, "height": 1, "rotation": 30, "obscures": true}"#,
                14.0,
            ),
            (
                r#"{"shape": "elliptical", "width": 2, "height": 1, "obscures": true}"#,
                16.0 - 0.5 * pi,
            ),
            (
                r#"{"shape": "outline", "corners": [[0, 0], [1, 0], [0, 1]], "obscures": true}"#,
                15.5,
            ),
        ] {
            assert!((area(json) - expected).abs() < 0.01, "{json}: {} {expected}", area(json));
        }
    }

    #[test]
    fn turned_shapes_turn_from_x_towards_y() {
        let opening =
            shape(r#"{"shape": "rectangular", "width": 4, "height": 0.2, "rotation": 30}"#);
        let opening = opening.unwrap();
        let along = [30.0_f64.to_radians().cos(), 30.0_f64.to_radians().sin()];
        assert_eq!(opening.transmission(1.9 * along[0], 1.9 * along[1]), 1.0);
        assert_eq!(opening.transmission(1.9 * along[0], -1.9 * along[1]), 0.0);
        let spider =
            shape(r#"{"shape": "spider", "arms": 1, "width": 0.2, "rotation": 90}"#).unwrap();
        assert_eq!((spider.transmission(0.0, 5.0), spider.transmission(0.0, -5.0)), (0.0, 1.0));
    }

    #[test]
    fn what_is_no_opening_is_refused_in_words() {
        let error = |json: &str| shape(json).unwrap_err();
        assert!(
            error(r#"{"shape": "rectangular", "width": 0, "height": 1}"#).contains("width is 0")
        );
        assert!(
            error(r#"{"shape": "annular", "radius": 1, "inner_radius": 1}"#)
                .contains("nothing is open")
        );
        assert!(error(r#"{"shape": "spider", "arms": 0, "width": 1}"#).contains("arms is 0"));
        assert!(
            error(r#"{"shape": "outline", "corners": [[0, 0], [1, 0]]}"#).contains("corners has 2")
        );
        assert!(
            error(r#"{"shape": "outline", "corners": [[0, 0], [0, 0], [0, 0]]}"#)
                .contains("farthest of corners is 0 mm")
        );
        assert!(
            error(r#"{"shape": "annular", "inner_radius": -1}"#).contains("inner_radius is -1")
        );
    }
}
