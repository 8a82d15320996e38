//! A biconic surface: a conic section along x and another along y, as toric and cylindrical lenses
//! and anamorphs have.
//!
//! `z = (cₓ x² + c_y y²) / (1 + √(1 − (1 + kₓ) cₓ² x² − (1 + k_y) c_y² y²))`: the biconic of Zemax'
//! OpticStudio (*User Manual*, "Biconic"; `BICONICX` in its files). With equal sections it is the
//! conic.
//!
//! Rays are met by [Newton's method](super::newton) from where they meet the vertex' plane.
//!
//! Walls of aspheres.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::newton::Profile;
use super::rays::Ray;
use super::real::Real;
use super::refract::IndexPair;
use super::surface::{Surface, checked_semi_diameter, vertex_curvature};
use crate::glass::GlassSpec;
use etendue_geometry::units::Millimetres;

/// A biconic surface as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BiconicSpec {
    /// Radius of curvature along y (mm), positive when its centre lies on the sensor's side. Flat
    /// along y without.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<Millimetres>,
    /// The conic constant along y.
    #[serde(skip_serializing_if = "is_zero")]
    pub conic: f64,
    /// Radius of curvature along x (mm). Flat along x without.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_x: Option<Millimetres>,
    /// The conic constant along x.
    #[serde(skip_serializing_if = "is_zero")]
    pub conic_x: f64,
    /// Medium behind the surface, on the sensor's side; air when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub glass: Option<GlassSpec>,
    /// Half the clear diameter (mm): rays farther from the axis are stopped. Unlimited when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub semi_diameter: Option<Millimetres>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// A biconic surface in its own frame: the vertex at the origin, the axis along z (mm).
#[derive(Debug, Clone, PartialEq)]
pub struct Biconic {
    /// Curvatures at the vertex along x and y (1/mm).
    pub curvature: [f64; 2],
    /// The conic constants along x and y.
    pub conic: [f64; 2],
    /// Half the clear diameter (mm); infinite when unlimited.
    pub semi_diameter: f64,
}

impl BiconicSpec {
    /// The shape.
    ///
    /// # Errors
    ///
    /// A sentence on the first number that describes no surface.
    pub fn build(&self) -> Result<Biconic, String> {
        let semi_diameter = checked_semi_diameter(self.semi_diameter)?;
        for (key, conic) in [("conic", self.conic), ("conic_x", self.conic_x)] {
            if !conic.is_finite() {
                return Err(format!("{key} must be finite"));
            }
        }
        let along_x = vertex_curvature(self.radius_x, None).map_err(|why| format!("x: {why}"))?;
        let along_y = vertex_curvature(self.radius, None)?;
        Ok(Biconic {
            curvature: [along_x, along_y],
            conic: [self.conic_x, self.conic],
            semi_diameter,
        })
    }
}

impl Biconic {
    /// (1 + k) c² along x and y.
    #[inline(always)]
    fn limits(&self) -> [f64; 2] {
        std::array::from_fn(|i| (1.0 + self.conic[i]) * self.curvature[i] * self.curvature[i])
    }

    /// The distance from the axis up to which it exists all around (mm).
    #[must_use]
    pub fn domain(&self) -> f64 {
        let limit = self.limits().into_iter().fold(0.0, f64::max);
        limit.sqrt().recip()
    }

    /// Returns the surface as seen by light that runs against the axis.
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self { curvature: self.curvature.map(|c| -c), ..*self }
    }

    /// True if a turn about its axis changes nothing.
    #[must_use]
    pub fn is_round(&self) -> bool {
        self.curvature[0] == self.curvature[1] && self.conic[0] == self.conic[1]
    }

    /// z at a place across the axis (mm); `None` where the surface does not exist.
    #[must_use]
    pub fn sag(&self, place: [f64; 2]) -> Option<f64> {
        self.exists(place).then(|| self.profile(place).0).filter(|sag| sag.is_finite())
    }

    /// Words on how it differs from a sphere.
    pub(crate) fn shape(&self) -> Vec<String> {
        let [x, y] = self.curvature.map(|curvature| match curvature {
            0.0 => "flat".to_owned(),
            curvature => format!("radius {}", 1.0 / curvature),
        });
        let along_x = format!("{x} along x");
        let conics = (self.conic != [0.0; 2])
            .then(|| format!("conics {} along x, {} along y", self.conic[0], self.conic[1]));
        std::iter::once(format!("{along_x}, {y} along y")).chain(conics).collect()
    }

    /// The sag, and its derivatives by x and y.
    #[inline(always)]
    fn profile<T: Real>(&self, [x, y]: [T; 2]) -> (T, [T; 2]) {
        let [a, b] = self.limits();
        let [c, d] = self.curvature;
        let rise = x.times(c) * x + y.times(d) * y;
        let root = (T::constant(1.0) - x.times(a) * x - y.times(b) * y).at_least(0.0).root();
        let below = root.plus(1.0);
        // d/dx of rise/below: the root's own derivative is −a x/root.
        let bend = rise / (below * below * root.at_least(1e-12));
        let slope = |x: T, c: f64, a: f64| x * (T::constant(2.0 * c) / below + bend.times(a));
        (rise / below, [slope(x, c, a), slope(y, d, b)])
    }
}

impl Biconic {
    /// Upper bound of the slope within a squared distance from the axis (mm²).
    pub(super) fn steepest(&self, square: f64) -> f64 {
        let [a, b] = self.limits();
        let root = (1.0 - a.max(b).max(0.0) * square).max(0.0).sqrt();
        let bent = self.curvature.into_iter().fold(0.0, |most: f64, c| most.max(c.abs()));
        let below = 1.0 + root;
        let bend = bent * square / (below * below * root.max(1e-12));
        square.sqrt() * (2.0 * bent / below + a.abs().max(b.abs()) * bend)
    }

    /// Bounds of [`Self::profile`] over a rectangle of places, from where to where along x and along y.
    fn bounds(&self, places: [[f64; 2]; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
        let limits = self.limits();
        let squares = places.map(square);
        let weighted = |weights: [f64; 2]| {
            let [along_x, along_y] = [0, 1].map(|i| product(squares[i], [weights[i], weights[i]]));
            add(along_x, along_y)
        };
        let rise = weighted(self.curvature);
        // The root falls as the weighted squares rise.
        let [high, low] = weighted(limits).map(|share| (1.0 - share).max(0.0).sqrt());
        let root = [low, high];
        let below = root.map(|root| 1.0 + root);
        let divided = below.map(f64::recip);
        let sag = product(rise, [divided[1], divided[0]]);
        let steepness = [1, 0].map(|i| 1.0 / (below[i] * below[i] * root[i].max(1e-12)));
        let bend = product(rise, steepness);
        let slopes = [0, 1].map(|i| {
            let (twice, limit) = (2.0 * self.curvature[i], limits[i]);
            let straight = product([twice; 2], [divided[1], divided[0]]);
            product(places[i], add(straight, product([limit; 2], bend)))
        });
        (sag, slopes)
    }
}

impl Profile for Biconic {
    /// ∂z/∂x and ∂z/∂y.
    type Slope<T: Real> = [T; 2];

    #[inline(always)]
    fn begin(&self, ray: Ray) -> (Ray, f64) {
        let travel = -ray.position[2] / ray.direction[2];
        (ray.advanced(travel), travel)
    }

    #[inline(always)]
    fn sag_and_slope<T: Real>(&self, at: Ray<T>) -> (T, [T; 2]) {
        let [x, y, _] = at.position;
        self.profile([x, y])
    }

    #[inline(always)]
    fn slope_at(&self, root: Ray, _slope: [f64; 2]) -> [f64; 2] {
        self.sag_and_slope(root).1
    }

    #[inline(always)]
    fn along<T: Real>(&self, at: Ray<T>, [along_x, along_y]: [T; 2]) -> T {
        let [u, v, w] = at.direction;
        w - along_x * u - along_y * v
    }

    #[inline(always)]
    fn exists(&self, [x, y]: [f64; 2]) -> bool {
        let [a, b] = self.limits();
        a * x * x + b * y * y <= 1.0
    }

    #[inline(always)]
    fn refract<T: Real>(
        &self,
        media: IndexPair,
        at: Ray<T>,
        [along_x, along_y]: [T; 2],
    ) -> (Ray<T>, bool) {
        let (one, [u, v, w]) = (T::constant(1.0), at.direction);
        let normal = [-along_x, -along_y, one];
        let along = u * normal[0] + v * normal[1] + w;
        let length2 = one + along_x * along_x + along_y * along_y;
        media.refract(at, normal, length2, along * along, along)
    }

    fn extent(&self) -> [f64; 2] {
        let ends = self.limits().into_iter().filter(|limit| *limit > 0.0);
        let end = ends.fold(f64::INFINITY, f64::min).sqrt().recip();
        let radii = self.curvature.iter().filter(|c| **c != 0.0).map(|c| (2.0 / c).abs());
        [if end > 0.0 { end } else { f64::INFINITY }, radii.fold(0.0, f64::max).max(10.0)]
    }

    fn clear_radius(&self) -> f64 {
        self.semi_diameter
    }

    fn sag_range(&self, reach: f64) -> [f64; 2] {
        self.bounds([[-reach, reach]; 2]).0
    }

    fn sag_bounds(&self, ray: Ray, part: [f64; 2]) -> [f64; 2] {
        self.bounds(places_along(ray, part)).0
    }

    fn along_bounds(&self, ray: Ray, part: [f64; 2]) -> [f64; 2] {
        let [u, v, w] = ray.direction;
        let (_, [along_x, along_y]) = self.bounds(places_along(ray, part));
        let across = add(product(along_x, [u, u]), product(along_y, [v, v]));
        [w - across[1], w - across[0]]
    }
}

/// Ends of a part of a ray along x and along y.
fn places_along(ray: Ray, part: [f64; 2]) -> [[f64; 2]; 2] {
    std::array::from_fn(|axis| {
        let ends = part.map(|t| ray.position[axis] + t * ray.direction[axis]);
        [ends[0].min(ends[1]), ends[0].max(ends[1])]
    })
}

/// The least and the greatest of a sum of two intervals.
fn add(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

/// Least and greatest value of a product of two intervals.
fn product(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    let ends = [a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]];
    ends.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], e| [l.min(e), h.max(e)])
}

/// Least and greatest value of the square of an interval.
fn square([low, high]: [f64; 2]) -> [f64; 2] {
    let most = low.abs().max(high.abs()).powi(2);
    let least = if low <= 0.0 && high >= 0.0 { 0.0 } else { low.abs().min(high.abs()).powi(2) };
    [least, most]
}

/// The slope of a wall: no lens that was built has one as steep (72°) within its clear aperture.
const WALL: f64 = 3.0;

impl Surface {
    /// True if an asphere has a wall somewhere within its clear aperture, at which rays take long
    /// to be traced.
    pub(super) fn has_wall(&self) -> bool {
        let reach = self.semi_diameter.min(self.extent().into_iter().fold(f64::INFINITY, f64::min));
        let slope = |i: u32| {
            let r = reach * f64::from(i) / 64.0;
            self.profile(r * r).1 * r
        };
        !self.aspheric.is_empty() && (1..64).any(|i| slope(i).abs() > WALL)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::SurfaceSpec;
    use crate::element::newton::cross;
    use crate::element::refraction::Refraction;

    fn read(json: &str) -> Result<Biconic, String> {
        serde_json::from_str::<BiconicSpec>(json).map_err(|e| e.to_string())?.build()
    }

    fn ray(position: [f64; 3], direction: [f64; 3]) -> Ray {
        Ray::new(position.into(), direction.into()).unwrap()
    }

    #[test]
    fn equal_sections_are_the_conic() {
        let biconic =
            read(r#"{"radius": 20, "radius_x": 20, "conic": -0.6, "conic_x": -0.6}"#).unwrap();
        let spec =
            SurfaceSpec { radius: Some(Millimetres(20.0)), conic: -0.6, ..SurfaceSpec::default() };
        let conic = Refraction::new(spec.build().unwrap(), 1.0, 1.5);
        assert!(biconic.is_round());
        let domain = conic.surface.domain();
        assert!((biconic.domain() / domain - 1.0).abs() < 1e-15);
        for (x, y) in [(0.0, 0.0), (3.0, -4.0), (-12.0, 9.0)] {
            let start = ray([x, y, -30.0], [0.1, -0.05, 1.0]);
            let ours = cross(&biconic, conic.media, start, 1e9);
            let theirs = conic.exactly(start, 1e9);
            assert!(ours.hit && ours.through);
            for axis in 0..3 {
                // Newton leaves about (1e-10)² of curvature; rounding of 30 mm is 4e-15.
                assert!((ours.ray.position[axis] - theirs.ray.position[axis]).abs() < 1e-13);
                assert!((ours.ray.direction[axis] - theirs.ray.direction[axis]).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn slopes_are_those_of_the_sag() {
        let s = read(r#"{"radius": 20, "radius_x": -35, "conic": -0.6, "conic_x": 1.5}"#).unwrap();
        for [x, y] in [[3.0, 7.0], [-8.0, 2.0], [0.0, 11.0]] {
            let (_, slopes) = s.profile([x, y]);
            let by = |h: [f64; 2]| {
                let at = |sign: f64| s.sag([x + sign * h[0], y + sign * h[1]]).unwrap();
                (at(1.0) - at(-1.0)) / 2e-5
            };
            // A central difference of 1e-5 mm is good to about (1e-5)² ≈ 1e-10.
            assert!((slopes[0] - by([1e-5, 0.0])).abs() < 1e-9);
            assert!((slopes[1] - by([0.0, 1e-5])).abs() < 1e-9);
        }
    }

    #[test]
    fn each_meridian_focuses_as_its_own_ellipse_does() {
        // k = −1/n² brings a parallel beam in air to a point at n R/(n − 1) inside the glass, at any
        // height; along each axis the rays stay in its plane.
        let n: f64 = 1.5;
        let conic = -1.0 / (n * n);
        let s = Biconic {
            curvature: [1.0 / 30.0, 1.0 / 20.0],
            conic: [conic; 2],
            semi_diameter: f64::INFINITY,
        };
        for (axis, radius) in [(0, 30.0), (1, 20.0)] {
            let focus = n * radius / (n - 1.0);
            for height in [0.1, 3.0, 9.0, 14.0] {
                let mut start = [0.0, 0.0, -3.0];
                start[axis] = height;
                let media = IndexPair::new(1.0, n);
                let out = cross(&s, media, ray(start, [0.0, 0.0, 1.0]), 1e9).ray;
                let t = -out.position[axis] / out.direction[axis];
                assert!((out.position[2] + t * out.direction[2] - focus).abs() < 1e-11, "{height}");
                assert_eq!(out.direction[1 - axis], 0.0);
            }
        }
    }

    #[test]
    fn a_cylinder_bends_along_one_axis_alone_and_is_met_beside_its_domain() {
        let s = read(r#"{"radius_x": 10}"#).unwrap();
        let media = IndexPair::new(1.0, 1.5);
        let out = cross(&s, media, ray([3.0, 50.0, -5.0], [0.0, 0.2, 1.0]), 1e9);
        assert!(out.hit && (out.ray.position[2] - (10.0 - 91.0_f64.sqrt())).abs() < 1e-14);
        // Snell along the cylinder: the component of n d along its axis is kept.
        let along = 0.2 / (1.0_f64 + 0.04).sqrt();
        assert!((out.ray.direction[1] - along / 1.5).abs() < 1e-15);
        assert!(!cross(&s, media, ray([11.0, 0.0, -5.0], [0.0, 0.0, 1.0]), 1e9).hit);
        assert_eq!((s.sag([11.0, 0.0]), s.sag([0.0, 99.0])), (None, Some(0.0)));
    }

    #[test]
    fn what_is_found_lies_on_the_surface_and_steep_rays_are_no_nonsense() {
        let s = read(r#"{"radius": 12, "radius_x": -15, "conic": 0.5}"#).unwrap();
        let media = IndexPair::new(1.0, 1.5);
        let mut hits = 0;
        for i in -20..20 {
            for j in -20..20 {
                let start = ray(
                    [f64::from(i), f64::from(j), -20.0],
                    [0.08 * f64::from(j), 0.05 * f64::from(i), 1.0],
                );
                let at = cross(&s, media, start, 1e9);
                let [x, y, z] = at.ray.position;
                if at.hit {
                    hits += 1;
                    assert!((z - s.sag([x, y]).unwrap()).abs() < 1e-9, "{x} {y}");
                    assert!(at.ray.direction.iter().all(|d| d.is_finite()) || !at.through);
                }
            }
        }
        assert!(hits > 200, "{hits}");
    }

    #[test]
    fn what_is_no_surface_is_refused_in_words() {
        let error = |json| read(json).unwrap_err();
        assert!(error(r#"{"radius_x": 0}"#).contains("x: radius is 0"));
        assert!(error(r#"{"radius": 1e-300}"#).contains("at least 1e-9 mm"));
        assert!(error(r#"{"semi_diameter": -1}"#).contains("negative"));
        assert!(error(r#"{"radius_y": 1}"#).contains("unknown field `radius_y`"));
        assert!(read("{}").unwrap().sag([3.0, 4.0]) == Some(0.0), "a plane");
    }
}
