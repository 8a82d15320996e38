//! Arrays of lenslets in one plane: thin lenslets, or one curved face of thick ones.
//!
//! A thin lenslet takes a ray through (x, y) from its centre to the slopes X − x/f, Y − y/f, as a thin
//! lens does. A curved face is a conic in each cell, its vertex in the array's plane, with a medium
//! behind it as behind a surface: thick lenslets are two faces with their glass between, or a face and a
//! flat surface. A ray that leaves its cell on the way from the plane to the face meets the face of the
//! cell that it gets to.

use std::sync::Arc;

use etendue_spectrum::Curve;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::lattice::{Grid, Lattice, regular};
use super::surface::{LARGEST_CURVATURE, SMALLEST_RADIUS, Surface};
use crate::glass::GlassSpec;
use etendue_geometry::units::{Degrees, Millimetres};

/// The most rows and columns of an array: cells must be told apart by their numbers.
const MOST_CELLS: f64 = 1e6;

/// An array as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MicrolensArraySpec {
    /// Width and height of the array (mm), around its vertex; opaque beyond.
    pub size: [Millimetres; 2],
    /// From a lenslet's centre to its next neighbour's (mm).
    pub pitch: Millimetres,
    /// Packing of the lenslets: square when absent.
    #[serde(default)]
    pub grid: Grid,
    /// Turn of the rows about the axis from +x towards +y (degrees).
    #[serde(default)]
    pub rotation: Degrees,
    /// Centre of lenslet (0, 0) (mm); in the middle of the array when absent.
    #[serde(default)]
    pub offset: [Millimetres; 2],
    /// The shape of a lenslet's opening: that of a cell when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aperture: Option<LensletShape>,
    /// The width of a lenslet's opening from flat to flat, or its diameter, as a share of the pitch.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub fill: f64,
    /// Gaps between openings: opaque when absent.
    #[serde(default)]
    pub gaps: Gaps,
    /// The focal length of thin lenslets (mm), negative for diverging ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focal_length: Option<Millimetres>,
    /// Instead: the radius of curvature of a face (mm), positive when its centre lies on the sensor's
    /// side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<Millimetres>,
    /// The conic constant of a face: 0 a sphere.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub conic: f64,
    /// Medium behind a face, on the sensor's side; air when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub glass: Option<GlassSpec>,
    /// A filter on each lenslet: the share of light that passes (0..=1) by wavelength.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transmission: Option<Curve>,
    /// Lenslets of several types: what differs of each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub types: Vec<LensletSpec>,
    /// Types by place: rows of numbers of `types`, repeated over the grid from lenslet (0, 0)
    /// on. When absent the type of lenslet (i, j) is i − j modulo their number, which no neighbour has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pattern: Vec<Vec<u32>>,
}

/// Values of a type of lenslets; the array's when absent.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LensletSpec {
    /// The focal length of thin lenslets (mm).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal_length: Option<Millimetres>,
    /// The radius of curvature of a face (mm).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<Millimetres>,
    /// The share of light that passes (0..=1) by wavelength.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmission: Option<Curve>,
}

/// The shape of a lenslet's opening.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LensletShape {
    /// A square along the rows.
    Square,
    /// A hexagon with two edges across the rows.
    Hexagonal,
    /// A circle.
    Round,
}

/// Gaps between the openings of lenslets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Gaps {
    /// Nothing passes.
    #[default]
    Opaque,
    /// Light passes as through a flat sheet.
    Clear,
}

fn one() -> f64 {
    1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// Optical model of a lenslet.
#[derive(Debug, Clone, PartialEq)]
pub enum Lenslet {
    /// A thin lens of this power (1/mm).
    Thin(f64),
    /// A face between the media before and behind the array, around the cell's centre.
    Face(Surface),
}

/// An array in its own frame (mm).
#[derive(Debug, Clone, PartialEq)]
pub struct MicrolensArray {
    /// Half its width and height.
    pub half_size: [f64; 2],
    /// The grid.
    pub lattice: Lattice,
    /// The shape of the openings.
    pub shape: LensletShape,
    /// Half the width of an opening, from flat to flat.
    pub reach: f64,
    /// Treatment of light between the openings.
    pub gaps: Gaps,
    /// The types of lenslets.
    pub types: Vec<Lenslet>,
    /// The filter of each type; none when empty.
    pub curves: Vec<Curve>,
    /// Lenslet types by cell; i − j modulo the number of types when empty.
    pattern: Vec<Vec<u32>>,
}

impl MicrolensArraySpec {
    /// The array.
    ///
    /// # Errors
    ///
    /// A sentence on the number that describes no array.
    pub fn build(&self) -> Result<MicrolensArray, String> {
        // Its size against its pitch.
        let [width, height] = self.size.map(|side| side.0);
        let pitch = self.pitch.0;
        if !(width > 0.0 && height > 0.0 && width.is_finite() && height.is_finite()) {
            return Err(format!("size is {width} x {height} mm; both must be above zero"));
        }
        if !(pitch > 0.0 && pitch.is_finite()) {
            return Err(format!("pitch is {pitch} mm; it must be above zero"));
        }
        if pitch > width.min(height) {
            return Err(format!(
                "pitch is {pitch} mm, and the array is {width} x {height} mm: not one lenslet fits; \
                 give a smaller pitch or a larger size"
            ));
        }
        if width.max(height) / pitch > MOST_CELLS {
            return Err(format!("pitch is {pitch} mm: over a million lenslets a side"));
        }
        // The grid, and the openings in it.
        let offset = self.offset.map(|length| length.0);
        if !offset.iter().all(|x| x.abs() <= 1e6 * pitch) {
            return Err("offset must be finite, and at most a million pitches".to_owned());
        }
        if !(-360.0..=360.0).contains(&self.rotation.0) {
            let degrees = self.rotation.0;
            return Err(format!("rotation is {degrees} degrees; it must be -360 to 360, a turn"));
        }
        if !(self.fill > 0.0 && self.fill <= 1.0) {
            return Err(format!("fill is {}; it must be above 0 and at most 1", self.fill));
        }
        let (s, c) = self.rotation.0.to_radians().sin_cos();
        let shape = self.aperture.unwrap_or(match self.grid {
            Grid::Square => LensletShape::Square,
            Grid::Hexagonal => LensletShape::Hexagonal,
        });
        self.check_pattern()?;
        Ok(MicrolensArray {
            half_size: [0.5 * width, 0.5 * height],
            lattice: Lattice { grid: self.grid, pitch, turn: [c, s], offset },
            shape,
            reach: 0.5 * pitch * self.fill,
            gaps: self.gaps,
            types: self.lenslets()?,
            curves: self.filters()?,
            pattern: self.pattern.clone(),
        })
    }

    /// True if the lenslets are faces between two media rather than thin lenses.
    #[must_use]
    pub fn has_faces(&self) -> bool {
        self.radius.is_some() || self.types.iter().any(|one| one.radius.is_some())
    }

    fn lenslets(&self) -> Result<Vec<Lenslet>, String> {
        if self.types.is_empty() {
            return Ok(vec![self.lenslet(&LensletSpec::default())?]);
        }
        let lenslet = |(i, own): (usize, &LensletSpec)| {
            self.lenslet(own).map_err(|why| format!("types[{i}]: {why}"))
        };
        let lenslets = self.types.iter().enumerate().map(lenslet).collect::<Result<Vec<_>, _>>()?;
        let faces = lenslets.iter().filter(|one| matches!(one, Lenslet::Face(_))).count();
        if faces != 0 && faces != lenslets.len() {
            return Err("types: either all have a focal_length, or all a radius".to_owned());
        }
        Ok(lenslets)
    }

    fn lenslet(&self, own: &LensletSpec) -> Result<Lenslet, String> {
        // The type's own shape, or that of all.
        let (focal_length, radius) = match (own.focal_length, own.radius) {
            (None, None) => (self.focal_length, self.radius),
            own => own,
        };
        match (focal_length, radius) {
            (Some(Millimetres(f)), None) => {
                if self.glass.is_some() || self.conic != 0.0 {
                    return Err(
                        "glass and conic belong to a radius, not to a focal_length".to_owned()
                    );
                }
                let power = 1.0 / f;
                (power.abs() <= LARGEST_CURVATURE).then_some(Lenslet::Thin(power)).ok_or_else(
                    || {
                        format!(
                            "focal_length is {f} mm; it must be at least {SMALLEST_RADIUS:e} mm"
                        )
                    },
                )
            }
            (None, Some(Millimetres(radius))) => self.face(radius).map(Lenslet::Face),
            (Some(_), Some(_)) => Err("give either focal_length or radius".to_owned()),
            (None, None) => {
                Err("give the lenslets a focal_length, or a radius for one face of thick \
                                 ones"
                    .to_owned())
            }
        }
    }

    fn face(&self, radius: f64) -> Result<Surface, String> {
        let curvature = 1.0 / radius;
        if !(curvature.abs() <= LARGEST_CURVATURE && self.conic.is_finite()) {
            return Err(format!(
                "radius is {radius} mm; it must be at least {SMALLEST_RADIUS:e} mm, and conic finite"
            ));
        }
        let face = Surface { conic: self.conic, ..Surface::sphere(curvature) };
        let farthest = std::f64::consts::FRAC_1_SQRT_2 * self.pitch.0 * self.fill;
        if face.sag(farthest).is_none() {
            return Err(format!(
                "radius is {radius} mm: the face ends {:.4} mm from a lenslet's centre, and its \
                 corners are up to {farthest:.4} mm away",
                face.domain()
            ));
        }
        Ok(face)
    }

    fn filters(&self) -> Result<Vec<Curve>, String> {
        let filters = self.transmissions()?;
        let is_opaque = |curve: &Curve| curve.extent()[1] <= 0.0;
        if !filters.is_empty() && filters.iter().all(is_opaque) {
            return Err("transmission is 0: no light gets through any lenslet".to_owned());
        }
        Ok(filters)
    }

    fn transmissions(&self) -> Result<Vec<Curve>, String> {
        let own = self.types.iter().any(|one| one.transmission.is_some());
        if self.transmission.is_none() && !own {
            return Ok(Vec::new());
        }
        let sound = |curve: &Curve| curve.clone().within(0.0, 1.0).map_err(|e| e.to_string());
        let clear = || Curve::flat(1.0).map_err(|e| e.to_string());
        let all = self.transmission.clone().map_or_else(clear, Ok)?;
        if self.types.is_empty() {
            return Ok(vec![sound(&all)?]);
        }
        self.types.iter().map(|one| sound(one.transmission.as_ref().unwrap_or(&all))).collect()
    }

    fn check_pattern(&self) -> Result<(), String> {
        let columns = self.pattern.first().map_or(0, Vec::len);
        if !self.pattern.is_empty() && (columns == 0 || self.types.is_empty()) {
            return Err("pattern has rows of numbers of types\nhint: give both".to_owned());
        }
        for (j, row) in self.pattern.iter().enumerate() {
            if row.len() != columns {
                return Err(format!(
                    "pattern[{j}] has {} numbers, and pattern[0] has {columns}",
                    row.len()
                ));
            }
            if let Some(number) = row.iter().find(|n| **n as usize >= self.types.len()) {
                let last = self.types.len() - 1;
                return Err(format!("pattern[{j}] names type {number}; there are 0 to {last}"));
            }
        }
        Ok(())
    }
}

impl MicrolensArray {
    /// The radius of the circle around it (mm).
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.half_size[0].hypot(self.half_size[1])
    }

    /// Index of the lenslet type in cell `[i, j]`.
    #[must_use]
    pub fn type_at(&self, [i, j]: [f64; 2]) -> usize {
        if self.types.len() == 1 {
            return 0;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "a remainder, which is less than the number of types"
        )]
        let modulo = |x: f64, n: usize| x.rem_euclid(n as f64) as usize % n;
        match self.pattern.first() {
            None => modulo(i - j, self.types.len()),
            Some(first) => {
                let row = &self.pattern[modulo(j, self.pattern.len())];
                row[modulo(i, first.len())] as usize
            }
        }
    }

    /// True if a point (mm) is within the array's border.
    #[inline(always)]
    #[must_use]
    pub fn is_inside(&self, x: f64, y: f64) -> bool {
        (x.abs() <= self.half_size[0]) & (y.abs() <= self.half_size[1])
    }

    /// True if a point of a cell, given along and across the rows, is in its lenslet's opening.
    #[must_use]
    pub fn is_open(&self, local: [f64; 2]) -> bool {
        self.is_open_as(self.shape, local)
    }

    /// Variant of [`Self::is_open`] with a shape that the compiler knows.
    #[inline(always)]
    pub(crate) fn is_open_as(&self, shape: LensletShape, [u, v]: [f64; 2]) -> bool {
        // Within a rounding of the cell's own edge: there are no gaps between full cells.
        let reach = self.reach * (1.0 + 1e-12);
        match shape {
            LensletShape::Square => (u.abs() <= reach) & (v.abs() <= reach),
            LensletShape::Round => u * u + v * v <= reach * reach,
            LensletShape::Hexagonal => {
                let (a, b) = (0.5 * u, 0.866_025_403_784_438_6 * v);
                (u.abs() <= reach) & ((a + b).abs() <= reach) & ((a - b).abs() <= reach)
            }
        }
    }

    /// The corners of a convex polygon that just holds the opening of a lenslet, around its centre, along
    /// and across the rows (mm).
    #[must_use]
    pub fn opening_corners(&self) -> Vec<[f64; 2]> {
        let opening = match self.shape {
            LensletShape::Square => regular(4, self.reach, 0.0),
            LensletShape::Hexagonal => regular(6, self.reach, 0.0),
            LensletShape::Round => regular(24, self.reach, 0.0),
        };
        let same = match (self.shape, self.lattice.grid) {
            (LensletShape::Round, _)
            | (LensletShape::Square, Grid::Square)
            | (LensletShape::Hexagonal, Grid::Hexagonal) => true,
            (LensletShape::Square | LensletShape::Hexagonal, _) => false,
        };
        if same { opening } else { clipped(&opening, &self.lattice.cell_corners()) }
    }

    /// Area of a cell between its opening and its border, around its centre, along and across the
    /// rows (mm): convex pieces, which beside openings that are no part of the border hold a little
    /// more.
    #[must_use]
    pub fn gap_pieces(&self) -> Vec<[[f64; 2]; 4]> {
        // All corners of squares and hexagons lie at multiples of 15°.
        let step = std::f64::consts::TAU / 24.0;
        let at = |k: u32| {
            let (sine, cosine) = (f64::from(k) * step).sin_cos();
            let cell = match self.lattice.grid {
                Grid::Square => LensletShape::Square,
                Grid::Hexagonal => LensletShape::Hexagonal,
            };
            let inner = self.reach * cell_radius(self.shape, [cosine, sine]);
            let outer = 0.5 * self.lattice.pitch * cell_radius(cell, [cosine, sine]);
            [inner, outer.max(inner)].map(|radius| [radius * cosine, radius * sine])
        };
        (0..24)
            .map(|k| {
                let ([a, b], [d, c]) = (at(k), at(k + 1));
                [a, b, c, d]
            })
            .collect()
    }

    /// Returns the array as seen by light that runs against the axis.
    #[must_use]
    pub fn flipped(&self) -> Self {
        let types = self.types.iter().map(|lenslet| match lenslet {
            Lenslet::Thin(power) => Lenslet::Thin(*power),
            Lenslet::Face(surface) => Lenslet::Face(surface.flipped()),
        });
        Self { types: types.collect(), ..self.clone() }
    }

    /// Returns the array without its filters, so that it dims nothing.
    #[must_use]
    pub fn without_filters(self: &Arc<Self>) -> Arc<Self> {
        if self.curves.is_empty() {
            return Arc::clone(self);
        }
        Arc::new(Self { curves: Vec::new(), ..(**self).clone() })
    }
}

/// Radius, in a direction, of a shape whose half width is 1.
fn cell_radius(shape: LensletShape, [x, y]: [f64; 2]) -> f64 {
    let (a, b) = (0.5 * x, 0.75_f64.sqrt() * y);
    match shape {
        LensletShape::Round => 1.0,
        LensletShape::Square => 1.0 / x.abs().max(y.abs()),
        LensletShape::Hexagonal => 1.0 / x.abs().max((a + b).abs()).max((a - b).abs()),
    }
}

/// The part of a convex polygon inside another one, both turning from +x towards +y (I. Sutherland and
/// G. Hodgman, "Reentrant polygon clipping", 1974).
#[must_use]
pub fn clipped(polygon: &[[f64; 2]], by: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut rest = Vec::with_capacity(polygon.len() + by.len());
    rest.extend_from_slice(polygon);
    let (mut kept, mut sides) = (Vec::with_capacity(rest.capacity()), Vec::new());
    for (k, &a) in by.iter().enumerate() {
        let b = by[(k + 1) % by.len()];
        let side = |p: &[f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
        sides.clear();
        sides.extend(rest.iter().map(side));
        if sides.iter().all(|&side| side >= 0.0) {
            continue;
        }
        kept.clear();
        for (i, &p) in rest.iter().enumerate() {
            let next = if i + 1 < rest.len() { i + 1 } else { 0 };
            let (q, from, to): ([f64; 2], f64, f64) = (rest[next], sides[i], sides[next]);
            if from >= 0.0 {
                kept.push(p);
            }
            if (from < 0.0) != (to < 0.0) {
                let t = from / (from - to);
                kept.push([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]);
            }
        }
        std::mem::swap(&mut rest, &mut kept);
    }
    rest
}
