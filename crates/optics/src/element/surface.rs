//! A refracting surface: plane, sphere, conic or even asphere.
//!
//! With u = x² + y² the sag is
//! z = c u / (1 + √(1 − (1 + k) c² u)) + Σ Aₚ rᵖ, p even.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::real::Real;
use crate::glass::GlassSpec;
use etendue_geometry::units::Millimetres;

/// The highest power of r that an asphere may have.
const HIGHEST_POWER: u32 = 30;

/// The smallest radius of curvature and focal length (mm), far below light's wavelengths: powers of
/// what is smaller soon are no numbers.
pub(crate) const SMALLEST_RADIUS: f64 = 1e-9;

/// 1 over it (1/mm).
pub(crate) const LARGEST_CURVATURE: f64 = 1e9;

/// A surface as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceSpec {
    /// Radius of curvature (mm), positive when its centre lies on the sensor's side. A flat surface
    /// has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<Millimetres>,
    /// 1/radius (1/mm), instead of the radius; 0 is flat.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curvature: Option<f64>,
    /// Medium behind the surface, on the sensor's side; air when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub glass: Option<GlassSpec>,
    /// Half the clear diameter (mm): rays farther from the axis are stopped. Unlimited when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub semi_diameter: Option<Millimetres>,
    /// The conic constant: 0 a sphere, −1 a paraboloid.
    #[serde(skip_serializing_if = "is_zero")]
    pub conic: f64,
    /// Coefficients of the even asphere by their power of r, `{"4": 1e-6}` (mm to 1 − power).
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub aspheric: BTreeMap<String, f64>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// The shape of a surface in its own frame: the vertex at the origin, the axis along z (mm).
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// Curvature at the vertex without the aspheric terms (1/mm).
    pub curvature: f64,
    /// The conic constant k.
    pub conic: f64,
    /// Coefficients A₂, A₄, A₆, …
    pub aspheric: Vec<f64>,
    /// Half the clear diameter (mm); infinite when unlimited.
    pub semi_diameter: f64,
}

impl SurfaceSpec {
    /// The shape.
    ///
    /// # Errors
    ///
    /// A sentence on the first number that describes no surface.
    pub fn build(&self) -> Result<Surface, String> {
        let semi_diameter = checked_semi_diameter(self.semi_diameter)?;
        if !self.conic.is_finite() {
            return Err("conic must be finite".to_owned());
        }
        Ok(Surface {
            curvature: vertex_curvature(self.radius, self.curvature)?,
            conic: self.conic,
            aspheric: self.coefficients()?,
            semi_diameter,
        })
    }

    fn coefficients(&self) -> Result<Vec<f64>, String> {
        let mut coefficients = Vec::new();
        for (key, &value) in &self.aspheric {
            let power = key.parse::<u32>().ok().filter(|p| p % 2 == 0 && *p >= 2);
            let Some(power) = power.filter(|p| *p <= HIGHEST_POWER) else {
                return Err(format!(
                    "aspheric has the power \"{key}\"; powers are even numbers from 2 to \
                     {HIGHEST_POWER}"
                ));
            };
            if !value.is_finite() {
                return Err(format!("aspheric \"{key}\" must be finite"));
            }
            let slot = power as usize / 2 - 1;
            if coefficients.len() <= slot {
                coefficients.resize(slot + 1, 0.0);
            }
            coefficients[slot] = value;
        }
        while coefficients.last() == Some(&0.0) {
            coefficients.pop();
        }
        Ok(coefficients)
    }
}

/// A semi-diameter (mm) as a file writes it; infinite without one.
pub(super) fn checked_semi_diameter(written: Option<Millimetres>) -> Result<f64, String> {
    let semi_diameter = written.map_or(f64::INFINITY, |s| s.0);
    if semi_diameter.is_nan() || semi_diameter < 0.0 {
        return Err(format!("semi_diameter is {semi_diameter} mm; it must not be negative"));
    }
    Ok(semi_diameter)
}

/// The curvature (1/mm) by a radius or by itself; 0 when neither is given.
pub(super) fn vertex_curvature(
    radius: Option<Millimetres>,
    curvature: Option<f64>,
) -> Result<f64, String> {
    let curvature = match (radius, curvature) {
        (Some(_), Some(_)) => return Err("give either radius or curvature".to_owned()),
        (Some(Millimetres(0.0)), None) => {
            return Err("radius is 0; a flat surface has no radius".to_owned());
        }
        // An infinite radius is a plane: 1/∞ = 0.
        (Some(Millimetres(radius)), None) if radius.abs() < SMALLEST_RADIUS => {
            return Err(format!(
                "radius is {radius:e} mm; it must be at least {SMALLEST_RADIUS:e} mm, or absent for \
                 a flat surface"
            ));
        }
        (Some(Millimetres(radius)), None) => 1.0 / radius,
        (None, Some(curvature)) => curvature,
        (None, None) => 0.0,
    };
    if curvature.abs() <= LARGEST_CURVATURE {
        Ok(curvature)
    } else {
        Err(format!(
            "the curvature is {curvature:e} 1/mm; it must be at most {LARGEST_CURVATURE:e} 1/mm"
        ))
    }
}

impl Surface {
    /// A sphere, or a plane of curvature 0, without limits.
    #[must_use]
    pub fn sphere(curvature: f64) -> Self {
        Self { curvature, conic: 0.0, aspheric: Vec::new(), semi_diameter: f64::INFINITY }
    }

    /// Returns the surface as seen by light that runs against the axis.
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self {
            curvature: -self.curvature,
            aspheric: self.aspheric.iter().map(|a| -a).collect(),
            ..*self
        }
    }

    /// True if the surface is flat.
    #[must_use]
    pub fn is_plane(&self) -> bool {
        self.curvature == 0.0 && self.aspheric.is_empty()
    }

    /// Words on how it differs from a sphere.
    pub(crate) fn shape(&self) -> Vec<String> {
        let conic = (self.conic != 0.0).then(|| format!("conic {}", self.conic));
        let terms = self.aspheric.len();
        let aspheric = (terms > 0).then(|| format!("aspheric to r^{}", 2 * terms));
        conic.into_iter().chain(aspheric).collect()
    }

    /// The curvature at the vertex with the aspheric terms (1/mm), which is what the paraxial
    /// region sees: c + 2 A₂.
    #[must_use]
    pub fn paraxial_curvature(&self) -> f64 {
        self.curvature + 2.0 * self.aspheric.first().unwrap_or(&0.0)
    }

    /// The greatest distance from the axis at which the surface exists (mm); infinite for planes,
    /// paraboloids and hyperboloids.
    #[must_use]
    pub fn domain(&self) -> f64 {
        let limit = (1.0 + self.conic) * self.curvature * self.curvature;
        if limit > 0.0 { limit.sqrt().recip() } else { f64::INFINITY }
    }

    /// z at `r` from the axis (mm); `None` where the surface does not exist.
    #[must_use]
    pub fn sag(&self, r: f64) -> Option<f64> {
        let (sag, _) = self.profile(r * r);
        (r.abs() <= self.domain() && sag.is_finite()).then_some(sag)
    }

    #[inline(always)]
    fn conic_root<T: Real>(&self, u: T) -> T {
        let c = self.curvature;
        (T::constant(1.0) - u.times((1.0 + self.conic) * c * c)).at_least(0.0).root()
    }

    /// The sag of the conic underneath (mm) at u = r²; it rises or falls all the way.
    pub(super) fn conic_sag(&self, u: f64) -> f64 {
        self.curvature * u / (1.0 + self.conic_root(u))
    }

    /// Lower and upper bounds of (∂z/∂x)/x between two squared distances from the axis (mm²), the
    /// nearer first (1/mm).
    pub(super) fn slope_bounds(&self, squares: [f64; 2]) -> [f64; 2] {
        let conic = |root: f64| self.curvature / root.max(1e-12);
        self.derivative_bounds(squares, conic, |power| power)
    }

    /// Lower and upper bounds of the second derivative of the sag by the distance from the axis
    /// (1/mm).
    pub(super) fn bend_bounds(&self, squares: [f64; 2]) -> [f64; 2] {
        let conic = |root: f64| self.curvature / root.max(1e-12).powi(3);
        self.derivative_bounds(squares, conic, |power| power * (power - 1.0))
    }

    /// Bounds of what the conic underneath gives by its root, and Σ `factor`(p) Aₚ rᵖ⁻²: each term rises or falls
    /// all the way.
    fn derivative_bounds(
        &self,
        squares: [f64; 2],
        conic: impl Fn(f64) -> f64,
        factor: impl Fn(f64) -> f64,
    ) -> [f64; 2] {
        let [near, far] = squares.map(|u| {
            let mut terms = [0.0; 2];
            for (i, &a) in self.aspheric.iter().enumerate().rev() {
                let a = factor(2.0 * (i as f64 + 1.0)) * a;
                terms = [terms[0] * u + a.max(0.0), terms[1] * u + a.min(0.0)];
            }
            (conic(self.conic_root(u)), terms)
        });
        let (least, most) = (near.0.min(far.0), near.0.max(far.0));
        [least + near.1[0] + far.1[1], most + far.1[0] + near.1[1]]
    }

    /// The sag and its derivative by u/2, that is (∂z/∂x)/x, at u = r². Beyond the domain the conic
    /// goes on as if at its edge, which keeps an iteration going and is refused in the end.
    #[inline(always)]
    pub(crate) fn profile<T: Real>(&self, u: T) -> (T, T) {
        let (value, slope) = polynomial(&self.aspheric, u);
        self.with_conic(u, value, slope)
    }

    /// [`Self::profile`] by what [`polynomial`] has at u.
    #[inline(always)]
    pub(super) fn with_conic<T: Real>(&self, u: T, value: T, slope: T) -> (T, T) {
        let c = self.curvature;
        let root = self.conic_root(u);
        let sag = u.times(c) / root.plus(1.0) + value;
        (sag, T::constant(c) / root.at_least(1e-12) + slope.times(2.0))
    }
}

/// Σ Aᵢ uⁱ from i = 1, and its derivative by u (Horner).
#[inline(always)]
pub(crate) fn polynomial<T: Real>(coefficients: &[f64], u: T) -> (T, T) {
    let (mut value, mut slope) = (T::constant(0.0), T::constant(0.0));
    for &a in coefficients.iter().rev() {
        slope = slope * u + value;
        value = (value * u).plus(a);
    }
    (value * u, value + slope * u)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> Result<Surface, String> {
        serde_json::from_str::<SurfaceSpec>(json).map_err(|e| e.to_string())?.build()
    }

    #[test]
    fn sag_and_slope_are_those_of_the_formula() {
        let s = read(r#"{"radius": 20, "conic": -0.6, "aspheric": {"4": 1e-5, "6": -2e-8}}"#);
        let s = s.unwrap();
        let r: f64 = 7.0;
        let conic = 0.05 * 49.0 / (1.0 + (1.0 - 0.4 * 0.0025 * 49.0_f64).sqrt());
        let expected = conic + 1e-5 * r.powi(4) - 2e-8 * r.powi(6);
        assert!((s.sag(r).unwrap() - expected).abs() < 1e-15);
        // A central difference of 1e-5 mm is good to about (1e-5)² ≈ 1e-10.
        let difference = (s.sag(r + 1e-5).unwrap() - s.sag(r - 1e-5).unwrap()) / 2e-5;
        assert!((s.profile(r * r).1 * r - difference).abs() < 1e-9);
        assert!((s.domain() - 1000.0_f64.sqrt()).abs() < 1e-13, "r² = 1/((1 + k) c²)");
        assert_eq!(s.sag(32.0), None);
    }

    #[test]
    fn flat_surfaces_have_no_radius_or_an_infinite_one() {
        assert!(read("{}").unwrap().is_plane());
        assert!(read(r#"{"curvature": 0}"#).unwrap().is_plane());
        let infinite =
            SurfaceSpec { radius: Some(Millimetres(f64::NEG_INFINITY)), ..SurfaceSpec::default() };
        assert!(infinite.build().unwrap().is_plane());
        assert_eq!(read(r#"{"radius": "5 cm"}"#).unwrap().curvature, 0.02);
    }

    #[test]
    fn what_is_no_surface_is_refused_in_words() {
        let error = |json| read(json).unwrap_err();
        assert!(error(r#"{"radius": 0}"#).contains("has no radius"));
        assert!(error(r#"{"radius": 1e-300}"#).contains("at least 1e-9 mm"));
        assert!(error(r#"{"radius": -1e-10}"#).contains("at least 1e-9 mm"));
        assert!(error(r#"{"curvature": 1e300}"#).contains("at most 1e9 1/mm"));
        assert!(error(r#"{"radius": 5, "curvature": 0.2}"#).contains("either"));
        assert!(error(r#"{"aspheric": {"3": 1}}"#).contains("even numbers from 2"));
        assert!(error(r#"{"aspheric": {"four": 1}}"#).contains("\"four\""));
        assert!(error(r#"{"semi_diameter": -1}"#).contains("negative"));
        assert!(error(r#"{"radios": 1}"#).contains("unknown field `radios`"));
    }
}
