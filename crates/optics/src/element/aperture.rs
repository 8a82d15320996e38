//! Thin opaque sheets with an opening: circles, blades, coded masks.
//!
//! A sheet does not bend a ray. It is asked where the ray's straight line crosses its plane, also
//! when that is a little before the last surface or behind the next one, so that a stop may be drawn
//! at the vertex of a lens whose rim curves past it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::picture::Picture;
use super::resources::Resolve;
use etendue_geometry::units::{Degrees, Millimetres};

/// An aperture as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "snake_case")]
pub enum ApertureSpec {
    /// A round hole.
    Circular(CircularSpec),
    /// The regular polygon between the blades of an iris.
    Polygon(PolygonSpec),
    /// A mask: white passes light, black stops it, grey dims it.
    Image(MaskSpec),
}

/// A round hole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CircularSpec {
    /// The hole's radius (mm).
    pub radius: Millimetres,
}

/// A regular polygon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PolygonSpec {
    /// From the centre to a corner (mm).
    pub radius: Millimetres,
    /// The number of corners, 3 or more.
    pub blades: u32,
    /// How far the corners are turned about the axis from +x towards +y (degrees).
    #[serde(default)]
    pub rotation: Degrees,
}

/// A picture as a mask.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaskSpec {
    /// A grey PNG or EXR; row 0 is at the top and column 0 on the left as seen from the sensor.
    pub file: String,
    /// The picture's width (mm).
    pub width: Millimetres,
    /// The picture's height (mm); by square pixels when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<Millimetres>,
}

/// The most blades; a real iris has about 20.
const MOST_BLADES: u32 = 1024;

/// Radius (mm) of the smallest opening that lets rays through beside each other: squares of smaller ones would
/// soon be no numbers.
pub(crate) const SMALLEST_RADIUS: f64 = 1e-9;

/// An opening in its own plane (mm).
#[derive(Debug, Clone, PartialEq)]
pub enum Opening {
    /// A circle.
    Circle {
        /// Its radius.
        radius: f64,
    },
    /// A regular polygon.
    Polygon {
        /// From the centre to a corner.
        radius: f64,
        /// Unit vectors square to its edges.
        normals: Vec<[f64; 2]>,
        /// From the centre to an edge.
        apothem: f64,
    },
    /// A mask.
    Image(Picture),
}

impl ApertureSpec {
    /// The opening.
    ///
    /// # Errors
    ///
    /// A sentence on the number or file that describes no opening.
    pub fn build(&self, resolve: Resolve<'_>) -> Result<Opening, String> {
        let radius = |radius: Millimetres| {
            let sound = radius.0 == 0.0 || radius.0 >= SMALLEST_RADIUS && radius.0.is_finite();
            let why = || format!("radius must be 0, or a length from {SMALLEST_RADIUS:e} mm on");
            sound.then_some(radius.0).ok_or_else(why)
        };
        match self {
            Self::Circular(spec) => Ok(Opening::Circle { radius: radius(spec.radius)? }),
            Self::Polygon(spec) if !(3..=MOST_BLADES).contains(&spec.blades) => {
                Err(format!("blades is {}; it must be 3 to {MOST_BLADES}", spec.blades))
            }
            Self::Polygon(spec) => {
                Ok(Opening::polygon(radius(spec.radius)?, spec.blades, spec.rotation.0))
            }
            Self::Image(spec) => {
                let height = spec.height.map(|h| h.0);
                Picture::read(&spec.file, spec.width.0, height, resolve).map(Opening::Image)
            }
        }
    }
}

impl Opening {
    /// A regular polygon of 3 or more corners, turned by `rotation` (degrees).
    #[must_use]
    pub fn polygon(radius: f64, blades: u32, rotation: f64) -> Self {
        let step = std::f64::consts::TAU / f64::from(blades);
        let normals = (0..blades)
            .map(|i| rotation.to_radians() + (f64::from(i) + 0.5) * step)
            .map(|angle| [angle.cos(), angle.sin()])
            .collect();
        Self::Polygon { radius, normals, apothem: radius * (0.5 * step).cos() }
    }

    /// The same with another radius (mm); `None` for a mask.
    #[must_use]
    pub fn with_radius(&self, radius: f64) -> Option<Self> {
        match self {
            Self::Circle { .. } => Some(Self::Circle { radius }),
            Self::Polygon { normals, radius: old, apothem } => {
                let shape = if *old > 0.0 {
                    apothem / old
                } else {
                    // A closed iris keeps its blades: half the angle between two of them.
                    #[expect(clippy::cast_precision_loss, reason = "at most 1024 blades")]
                    (std::f64::consts::PI / normals.len() as f64).cos()
                };
                let normals = normals.clone();
                Some(Self::Polygon { normals, radius, apothem: radius * shape })
            }
            Self::Image(_) => None,
        }
    }

    /// The share of light that passes at `x`, `y` (mm).
    #[must_use]
    pub fn transmission(&self, x: f64, y: f64) -> f64 {
        let open = match self {
            Self::Circle { radius } => in_circle(*radius, x, y),
            Self::Polygon { normals, apothem, .. } => in_polygon(normals, *apothem, x, y),
            Self::Image(picture) => return picture.value(x, y),
        };
        f64::from(u8::from(open))
    }

    /// The radius of the circle around the opening (mm).
    #[must_use]
    pub fn radius(&self) -> f64 {
        match self {
            Self::Circle { radius } | Self::Polygon { radius, .. } => *radius,
            Self::Image(picture) => picture.radius(),
        }
    }

    /// A word on how it differs from a round hole.
    pub(crate) fn shape(&self) -> Option<String> {
        match self {
            Self::Circle { .. } => None,
            Self::Polygon { normals, .. } => Some(format!("{} blades", normals.len())),
            Self::Image(Picture { pixels: [width, height], .. }) => {
                Some(format!("mask of {width} x {height} pixels"))
            }
        }
    }

    /// Whether a turn about the axis changes nothing.
    #[must_use]
    pub fn is_round(&self) -> bool {
        matches!(self, Self::Circle { .. })
    }
}

/// Whether a place (mm) lies inside of a circle.
#[inline(always)]
pub(super) fn in_circle(radius: f64, x: f64, y: f64) -> bool {
    x * x + y * y <= radius * radius
}

/// Whether a place (mm) lies inside of a regular polygon; without branches, so that loops vectorise.
#[inline(always)]
pub(super) fn in_polygon(normals: &[[f64; 2]], apothem: f64, x: f64, y: f64) -> bool {
    let beyond = |n: &[f64; 2]| x * n[0] + y * n[1] - apothem;
    normals.iter().fold(f64::NEG_INFINITY, |worst, n| worst.max(beyond(n))) <= 0.0
}

#[cfg(test)]
mod tests {
    use super::super::picture::tests::grey;
    use super::*;

    fn build(json: &str) -> Result<Opening, String> {
        let spec: ApertureSpec = serde_json::from_str(json).map_err(|e| e.to_string())?;
        spec.build(&|name: &str| Err(format!("{name}: no files here")))
    }

    #[test]
    fn a_hexagon_has_its_corners_where_the_rotation_puts_them() {
        let hexagon = build(r#"{"shape": "polygon", "radius": 2, "blades": 6}"#).unwrap();
        assert_eq!(hexagon.transmission(1.999, 0.0), 1.0);
        assert_eq!(hexagon.transmission(0.0, 1.999), 0.0);
        assert_eq!(hexagon.transmission(0.0, 3.0_f64.sqrt() - 1e-9), 1.0);
        let turned =
            build(r#"{"shape": "polygon", "radius": 2, "blades": 6, "rotation": 30}"#).unwrap();
        assert_eq!(turned.transmission(0.0, 1.999), 1.0);
        assert_eq!(turned.transmission(1.999, 0.0), 0.0);
        // By area: a grid of 400 × 400 finds 3√3/2 r² to the length of the rim times a cell.
        let cell = 0.01;
        let inside: f64 = (0..160_000)
            .map(|i| {
                (-2.0 + cell * (f64::from(i % 400) + 0.5), -2.0 + cell * (f64::from(i / 400) + 0.5))
            })
            .map(|(x, y)| hexagon.transmission(x, y) * cell * cell)
            .sum();
        assert!((inside - 1.5 * 3.0_f64.sqrt() * 4.0).abs() < 12.0 * cell);
    }

    #[test]
    fn a_hole_of_radius_0_passes_its_centre_alone() {
        let hole = build(r#"{"shape": "circular", "radius": 0}"#).unwrap();
        assert_eq!(hole.transmission(0.0, 0.0), 1.0);
        assert_eq!(hole.transmission(1e-9, 0.0), 0.0);
        assert_eq!(hole.transmission(f64::NAN, 0.0), 0.0);
    }

    #[test]
    fn a_mask_dims() {
        let mask = Opening::Image(grey(2, 1, &[255, 51], 4.0));
        assert_eq!((mask.transmission(-1.0, 0.0), mask.transmission(1.0, 0.0)), (1.0, 0.2));
        assert_eq!(mask.radius(), 5.0_f64.sqrt());
    }

    #[test]
    fn what_is_no_opening_is_refused_in_words() {
        let error = |json| build(json).unwrap_err();
        assert!(
            error(r#"{"shape": "circular", "radius": -1}"#).contains("a length from 1e-9 mm on")
        );
        assert!(error(r#"{"shape": "polygon", "radius": 1, "blades": 2}"#).contains("3 to"));
        assert!(error(r#"{"shape": "star", "radius": 1}"#).contains("unknown variant `star`"));
        assert!(error(r#"{"shape": "circular", "radius": 1, "blades": 5}"#).contains("blades"));
        let mask = r#"{"shape": "image", "file": "m.png", "width": 1}"#;
        assert!(error(mask).contains("m.png"));
    }
}
