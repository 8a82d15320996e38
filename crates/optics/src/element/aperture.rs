//! Thin opaque sheets with an opening: circles, blades, coded masks.
//!
//! A sheet does not bend a ray. It is asked where the ray's straight line crosses its plane, also
//! when that is a little before the last surface or behind the next one, so that a stop may be drawn
//! at the vertex of a lens whose rim curves past it.
//!
//! Grey pictures of a stated physical size: coded apertures and filter maps.

use std::path::{Path, PathBuf};

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Resolve;
use super::shapes::{AnnularSpec, BoxSpec, OutlineSpec, SMALLEST_RADIUS, Shape, SpiderSpec};
use etendue_geometry::units::{Degrees, Millimetres};
use etendue_image::{Limits, Samples};

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
    /// A rectangle.
    Rectangular(BoxSpec),
    /// An ellipse.
    Elliptical(BoxSpec),
    /// A ring around a disk that is in the way.
    Annular(AnnularSpec),
    /// A ring crossed by arms.
    Spider(SpiderSpec),
    /// An outline by its corners.
    Outline(OutlineSpec),
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
    /// Turn of the corners about the axis from +x towards +y (degrees).
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
    /// Another shape.
    Shaped(Shape),
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
            Self::Rectangular(spec) => spec.rectangle().map(Opening::Shaped),
            Self::Elliptical(spec) => spec.ellipse().map(Opening::Shaped),
            Self::Annular(spec) => spec.build().map(Opening::Shaped),
            Self::Spider(spec) => spec.build().map(Opening::Shaped),
            Self::Outline(spec) => spec.build().map(Opening::Shaped),
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

    /// Returns the opening with another radius (mm); `None` for a mask.
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
            Self::Shaped(shape) => Some(Self::Shaped(shape.with_radius(radius))),
        }
    }

    /// The share of light that passes at `x`, `y` (mm).
    #[must_use]
    pub fn transmission(&self, x: f64, y: f64) -> f64 {
        let open = match self {
            Self::Circle { radius } => in_circle(*radius, x, y),
            Self::Polygon { normals, apothem, .. } => in_polygon(normals, *apothem, x, y),
            Self::Image(picture) => return picture.value(x, y),
            Self::Shaped(shape) => shape.is_open(x, y),
        };
        f64::from(u8::from(open))
    }

    /// The radius of the circle around the opening (mm).
    #[must_use]
    pub fn radius(&self) -> f64 {
        match self {
            Self::Circle { radius } | Self::Polygon { radius, .. } => *radius,
            Self::Image(picture) => picture.radius(),
            Self::Shaped(shape) => shape.radius(),
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
            Self::Shaped(shape) => Some(shape.words()),
        }
    }

    /// True if a turn about the axis changes nothing.
    #[must_use]
    pub fn is_round(&self) -> bool {
        match self {
            Self::Circle { .. } => true,
            Self::Shaped(shape) => shape.is_round(),
            Self::Polygon { .. } | Self::Image(_) => false,
        }
    }

    /// True if a disk closes the middle.
    #[must_use]
    pub fn is_obscured(&self) -> bool {
        matches!(self, Self::Shaped(shape) if shape.is_obscured())
    }
}

/// Tests whether a point (mm) lies inside a circle about the axis.
#[inline(always)]
pub(super) fn in_circle(radius: f64, x: f64, y: f64) -> bool {
    x * x + y * y <= radius * radius
}

/// Tests whether a point (mm) lies inside a regular polygon; without branches, so that loops
/// vectorise.
#[inline(always)]
pub(super) fn in_polygon(normals: &[[f64; 2]], apothem: f64, x: f64, y: f64) -> bool {
    let beyond = |n: &[f64; 2]| x * n[0] + y * n[1] - apothem;
    normals.iter().fold(f64::NEG_INFINITY, |worst, n| worst.max(beyond(n))) <= 0.0
}

/// The most bytes that a picture may take when it is decoded: a coded aperture has thousands of
/// pixels, and this is 8192 × 8192 in 16-bit RGBA.
const MOST_BYTES: u64 = 1 << 29;

/// The most pixels of one: their values take 0.5 GiB.
const MOST_PIXELS: usize = 1 << 26;

/// The longest file of a picture that is read (bytes).
const LONGEST: u64 = 1 << 30;

/// A grey picture centred on an element's axis. Row 0 is at the top (+y) and column 0 at −x, as seen
/// from the sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// The file that it was read from.
    pub file: PathBuf,
    /// Width and height (mm).
    pub size: [f64; 2],
    /// Columns and rows.
    pub pixels: [usize; 2],
    /// Grey values by rows, 1 at full scale.
    pub values: Vec<f64>,
    /// Grey levels from black to white: 255 or 65535; 1 for floats.
    pub levels: f64,
}

impl Picture {
    /// Reads a PNG (values over full scale, without gamma) or an EXR (values as they are). `height`
    /// follows from square pixels when not given.
    ///
    /// # Errors
    ///
    /// A sentence that names the file: it cannot be read, is coloured or transparent, or its size
    /// is not positive.
    pub fn read(
        file: &str,
        width: f64,
        height: Option<f64>,
        resolve: Resolve<'_>,
    ) -> Result<Self, String> {
        let path = resolve.path(file)?;
        let (pixels, values, levels) = read(&path).map_err(|why| format!("{file}: {why}"))?;
        #[expect(clippy::cast_precision_loss, reason = "far fewer pixels than 2⁵³")]
        let height = height.unwrap_or(width * pixels[1] as f64 / pixels[0] as f64);
        let good = |length: f64| length > 0.0 && length.is_finite();
        if !good(width) || !good(height) {
            return Err(format!("{file}: width and height must be positive lengths"));
        }
        Ok(Self { file: path, size: [width, height], pixels, values, levels })
    }

    /// A white picture of the same size.
    #[must_use]
    pub fn blank(&self) -> Self {
        Self { pixels: [1, 1], values: vec![1.0], levels: 1.0, ..self.clone() }
    }

    /// The index of the pixel that covers the point `x`, `y` (mm); `None` outside of the picture.
    #[must_use]
    pub fn pixel(&self, x: f64, y: f64) -> Option<usize> {
        let across = x / self.size[0] + 0.5;
        let down = 0.5 - y / self.size[1];
        let at = |share: f64, count: usize| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                clippy::cast_precision_loss,
                reason = "a share in 0..=1 of a count"
            )]
            (0.0..=1.0).contains(&share).then(|| ((share * count as f64) as usize).min(count - 1))
        };
        Some(at(down, self.pixels[1])? * self.pixels[0] + at(across, self.pixels[0])?)
    }

    /// The lower left and the upper right corner of pixel `i` (mm).
    pub(crate) fn bounds_of(&self, i: usize) -> [DVec2; 2] {
        #[expect(clippy::cast_precision_loss, reason = "far fewer pixels than 2⁵³")]
        let corner = |column: usize, row: usize| {
            DVec2::new(
                (column as f64 / self.pixels[0] as f64 - 0.5) * self.size[0],
                (0.5 - row as f64 / self.pixels[1] as f64) * self.size[1],
            )
        };
        let [column, row] = [i % self.pixels[0], i / self.pixels[0]];
        [corner(column, row + 1), corner(column + 1, row)]
    }

    /// The grey value at a point (mm); 0 outside of the picture.
    #[must_use]
    pub fn value(&self, x: f64, y: f64) -> f64 {
        self.pixel(x, y).map_or(0.0, |i| self.values[i])
    }

    /// The radius of the circle around the picture (mm).
    #[must_use]
    pub fn radius(&self) -> f64 {
        0.5 * self.size[0].hypot(self.size[1])
    }
}

/// The columns and rows of a grey picture file (PNG, EXR), and its values, which lie in 0 to 1, from the top left on.
///
/// # Errors
///
/// When there is none, it is coloured or transparent, or a value is beyond: the sentence goes on after the file's name.
pub fn grey_picture(path: &Path) -> Result<([usize; 2], Vec<f64>), String> {
    read(path).map(|(size, values, _)| (size, values))
}

type Pixels = ([usize; 2], Vec<f64>, f64);

fn read(path: &Path) -> Result<Pixels, String> {
    let bytes = etendue_files::read(path, LONGEST).map_err(|e| format!("cannot be read: {e}"))?;
    let limits = Limits::within(Some(MOST_BYTES));
    let raster = etendue_image::decode(&bytes, limits)
        .map_err(|e| format!("is not a picture that can be read: {e}"))?;
    if raster.len() > MOST_PIXELS {
        let [width, height] = raster.size();
        return Err(format!(
            "has {width} x {height} texels, and a mask has {MOST_PIXELS} at most: make it smaller"
        ));
    }
    let mut values = etendue_image::room(raster.len()).map_err(|_| "does not fit into memory")?;
    for [red, green, blue, alpha] in (0..raster.len()).map(|i| raster.texel(i)) {
        if red != green || red != blue {
            return Err("is coloured; a mask must be grey".to_owned());
        }
        // The alpha of EXR files has never counted: masks are written with and without.
        if alpha != 1.0 && !raster.is_float() {
            return Err("is transparent in places; a mask must be grey without alpha".to_owned());
        }
        if !(0.0..=1.0).contains(&red) {
            return Err(format!("has the value {red}; a mask's values lie in 0..=1"));
        }
        values.push(red);
    }
    let levels = match raster.samples() {
        Samples::U8(_) => 255.0,
        Samples::U16(_) => 65_535.0,
        Samples::F16(_) | Samples::F32(_) => 1.0,
    };
    Ok((raster.size(), values, levels))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Writes a grey PNG into a fresh folder and reads it back as `width` mm wide.
    pub(crate) fn grey(columns: u32, rows: u32, values: &[u8], width: f64) -> Picture {
        let folder = tempfile::tempdir().unwrap();
        let image = image::GrayImage::from_raw(columns, rows, values.to_vec()).unwrap();
        image.save(folder.path().join("mask.png")).unwrap();
        let resolve = |name: &str| Ok(folder.path().join(name));
        Picture::read("mask.png", width, None, &resolve).unwrap()
    }

    #[test]
    fn the_top_left_of_the_picture_is_at_minus_x_plus_y() {
        let picture = grey(3, 2, &[255, 51, 0, 0, 0, 102], 6.0);
        assert_eq!(picture.size, [6.0, 4.0]);
        assert_eq!(picture.value(-2.5, 1.5), 1.0);
        assert_eq!(picture.value(0.0, 0.5), 0.2);
        assert_eq!(picture.value(2.9, -1.9), 0.4);
        assert_eq!(picture.value(3.0, -2.0), 0.4, "the rim belongs to the picture");
        assert_eq!(picture.value(3.001, 0.0), 0.0);
        assert_eq!(picture.value(f64::NAN, 0.0), 0.0);
    }

    #[test]
    fn a_picture_of_one_pixel_is_a_rectangle_of_one_grey() {
        let picture = grey(1, 1, &[51], 2.0);
        assert_eq!(picture.value(0.99, -0.99), 0.2);
        assert_eq!(picture.value(1.01, 0.0), 0.0);
    }

    #[test]
    fn exr_masks_are_read_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mask.exr");
        exr::prelude::write_rgb_file(&path, 2, 1, |x, _| {
            let grey = 0.25 + 0.5 * x as f32;
            (grey, grey, grey)
        })
        .unwrap();
        let picture =
            Picture::read("mask.exr", 2.0, Some(1.0), &|_: &str| Ok(path.clone())).unwrap();
        assert_eq!((picture.value(-0.5, 0.0), picture.value(0.5, 0.0)), (0.25, 0.75));
    }

    #[test]
    fn what_is_no_mask_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let read =
            |width| Picture::read("a.png", width, None, &|_: &str| Ok(path.clone())).unwrap_err();
        assert!(read(1.0).contains("a.png: cannot be read"), "{}", read(1.0));
        std::fs::write(&path, b"no picture").unwrap();
        assert!(read(1.0).contains("not a picture"), "{}", read(1.0));
        image::RgbImage::from_raw(1, 1, vec![1, 2, 3]).unwrap().save(&path).unwrap();
        assert!(read(1.0).contains("coloured"));
        image::GrayImage::from_raw(1, 1, vec![9]).unwrap().save(&path).unwrap();
        assert!(read(0.0).contains("positive"));
    }

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
