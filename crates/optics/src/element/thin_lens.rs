//! The ideal thin lens: every point is imaged to a point by 1/s' − 1/s = 1/f, at any angle.
//!
//! Such a lens takes straight lines to straight lines, so with slopes X = dx/dz, Y = dy/dz a ray
//! through (x, y) leaves with X − x/f, Y − y/f.

use etendue_geometry::units::Millimetres;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::rays::Ray;
use super::real::Real;
use super::refract::{RefractedRay, is_ahead, is_within};
use super::surface::{LARGEST_CURVATURE, SMALLEST_RADIUS, checked_semi_diameter};

/// A thin lens as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThinLensSpec {
    /// The focal length (mm), negative for a diverging lens. In a medium it is that in the medium.
    pub focal_length: Millimetres,
    /// Half the clear diameter (mm). Unlimited when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub semi_diameter: Option<Millimetres>,
}

/// A thin lens in its own frame (mm).
#[derive(Debug, Clone, PartialEq)]
pub struct ThinLens {
    /// 1/f (1/mm).
    pub power: f64,
    /// Half the clear diameter; infinite when unlimited.
    pub semi_diameter: f64,
}

impl ThinLensSpec {
    /// The lens.
    ///
    /// # Errors
    ///
    /// A sentence on the number that describes no lens.
    pub fn build(&self) -> Result<ThinLens, String> {
        let semi_diameter = checked_semi_diameter(self.semi_diameter)?;
        // An infinite focal length is a lens without power.
        let power = 1.0 / self.focal_length.0;
        if power.abs() <= LARGEST_CURVATURE {
            Ok(ThinLens { power, semi_diameter })
        } else {
            Err(format!(
                "focal_length is {} mm; it must be at least {SMALLEST_RADIUS:e} mm",
                self.focal_length.0
            ))
        }
    }
}

/// Light from the object meets `power`, light traced from the sensor `−power`.
#[inline(always)]
pub(crate) fn at_thin_lens<T: Real>(power: f64, ray: Ray<T>, clip2: f64) -> RefractedRay<T> {
    let w = ray.direction[2];
    let t = -ray.position[2] / w;
    let mut there = ray.advanced(t);
    there.position[2] = T::constant(0.0);
    let [x, y, _] = there.position;
    // (u/w − x/f, v/w − y/f, 1) times w.
    let (u, v) = (ray.direction[0] - x.times(power) * w, ray.direction[1] - y.times(power) * w);
    let length = (u * u + v * v + w * w).root();
    let one = T::constant(1.0);
    let scale = if power == 0.0 { one } else { one / length };
    there.direction = [u * scale, v * scale, w * scale];
    let hit = is_ahead(t) & (length.value() < f64::INFINITY);
    RefractedRay { ray: there, t, hit, clear: is_within(there, clip2), through: true }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_imaged_to_points_at_any_angle_both_ways() {
        let (f, s) = (50.0, -75.0);
        let image = 1.0 / (1.0 / f + 1.0 / s);
        let object = [4.0, -3.0, s];
        for (x, y) in [(0.0, 0.0), (20.0, 0.0), (-60.0, 70.0), (1.0, -300.0)] {
            let towards = [x - object[0], y - object[1], -object[2]];
            let ray = Ray::new(object.into(), towards.into()).unwrap();
            let out = at_thin_lens(1.0 / f, ray, f64::INFINITY);
            assert!(out.hit && out.clear && out.through);
            let t = image / out.ray.direction[2];
            let magnification = image / s;
            let at = out.ray.advanced(t).position;
            assert!((at[0] - object[0] * magnification).abs() < 1e-11, "{x} {y}: {at:?}");
            assert!((at[1] - object[1] * magnification).abs() < 1e-11, "{x} {y}: {at:?}");
            // Back from the image to the object.
            let mut back = out.ray.advanced(t);
            back.direction = back.direction.map(|c| -c);
            let home = at_thin_lens(-1.0 / f, back, f64::INFINITY).ray;
            let home = home.advanced((s - home.position[2]) / home.direction[2]);
            assert!((home.position[0] - object[0]).abs() < 1e-10);
            assert!((home.position[1] - object[1]).abs() < 1e-10);
        }
    }

    #[test]
    fn no_power_changes_nothing_and_no_focal_length_is_refused() {
        let spec = |f| ThinLensSpec { focal_length: Millimetres(f), semi_diameter: None };
        let flat = spec(f64::INFINITY).build().unwrap();
        let ray = Ray::new([1.0, 2.0, -3.0].into(), [0.1, 0.2, 1.0].into()).unwrap();
        assert_eq!(at_thin_lens(flat.power, ray, 1e9).ray.direction, ray.direction);
        assert!(spec(0.0).build().unwrap_err().contains("at least 1e-9 mm"));
    }
}
