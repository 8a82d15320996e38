//! Falloff of the light of a pinhole from its axis, as calibrations of lenses describe it.
//!
//! # Source
//!
//! D. B. Goldman and J.-H. Chen, "Vignette and exposure calibration and compensation", ICCV 2005: an even polynomial
//! of the sixth order in the distance from the principal point.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{CameraError, Intrinsics};

/// The relative light of a pixel: `axis (1 + a1 r² + a2 r⁴ + a3 r⁶)`, r its distance from the principal point in focal
/// lengths. Samples of pictures count by it; data layers do not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FalloffSpec {
    /// At the principal point.
    pub axis: f64,
    /// Of r².
    pub a1: f64,
    /// Of r⁴.
    pub a2: f64,
    /// Of r⁶.
    pub a3: f64,
}

impl Default for FalloffSpec {
    fn default() -> Self {
        Self { axis: 1.0, a1: 0.0, a2: 0.0, a3: 0.0 }
    }
}

/// A place of a picture (column and row, pixels from the corner) with its light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LitPlace {
    /// The place.
    pub at: [f64; 2],
    /// Its light.
    pub light: f64,
}

impl FalloffSpec {
    /// The relative light at a square of the distance; 0 where the polynomial is below.
    #[must_use]
    pub fn at(&self, square: f64) -> f64 {
        let Self { axis, a1, a2, a3 } = self;
        (axis * (1.0 + square * (a1 + square * (a2 + square * a3)))).max(0.0)
    }

    /// That of places of a pinhole's picture, by least squares; `None` of places that do not tell it.
    #[must_use]
    pub fn fitted(k: &Intrinsics, lit: &[LitPlace]) -> Option<Self> {
        // In the largest square, so that all columns of the equations are of about 1.
        let most = lit.iter().map(|place| square_of(k, place.at)).fold(0.0, f64::max);
        if !(most > 0.0 && most.is_finite()) {
            return None;
        }
        let mut equations = [[0.0; 5]; 4];
        for LitPlace { at, light } in lit {
            let u = square_of(k, *at) / most;
            let row = [1.0, u, u * u, u * u * u, *light];
            for (i, sums) in equations.iter_mut().enumerate() {
                sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += row[i] * value);
            }
        }
        let [axis, b, c, d] = solved(equations)?;
        let of_axis = |x: f64, power: i32| x / axis / most.powi(power);
        let fit = Self { axis, a1: of_axis(b, 1), a2: of_axis(c, 2), a3: of_axis(d, 3) };
        (axis > 0.0 && [fit.a1, fit.a2, fit.a3].iter().all(|a| a.is_finite())).then_some(fit)
    }

    /// Refuses what is no light.
    pub(crate) fn check(&self) -> Result<(), CameraError> {
        let Self { axis, a1, a2, a3 } = *self;
        let keys = [("axis", axis), ("a1", a1), ("a2", a2), ("a3", a3)];
        if let Some((key, value)) = keys.into_iter().find(|(_, value)| !value.is_finite()) {
            return Err(CameraError::new(
                format!("falloff.{key}"),
                format!("{value} is not finite"),
            ));
        }
        if axis <= 0.0 {
            let why = format!(
                "is {axis}: the picture would be black\nhint: give the light on the axis, such as 1"
            );
            return Err(CameraError::new("falloff.axis", why));
        }
        Ok(())
    }
}

/// The square of the distance of a place from the principal point (focal lengths).
pub(crate) fn square_of(k: &Intrinsics, [column, row]: [f64; 2]) -> f64 {
    let [x, y] = k.tangents(column, row);
    x * x + y * y
}

/// The solution of four equations, by elimination with the largest pivot; `None` where there is not one.
fn solved(mut rows: [[f64; 5]; 4]) -> Option<[f64; 4]> {
    for column in 0..4 {
        let pivot =
            (column..4).max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))?;
        rows.swap(column, pivot);
        let lead = rows[column];
        if lead[column].abs() < 1e-12 {
            return None;
        }
        for (number, row) in rows.iter_mut().enumerate() {
            let share = row[column] / lead[column];
            if number != column {
                row.iter_mut().zip(lead).for_each(|(value, lead)| *value -= share * lead);
            }
        }
    }
    Some(std::array::from_fn(|i| rows[i][4] / rows[i][i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraSpec, PinholeSpec, Projection, SensorSpec};
    use etendue_geometry::Bounds;

    #[test]
    fn a_fit_finds_the_polynomial_that_its_places_are_of() {
        let spec = PinholeSpec { sensor: SensorSpec::new([60, 40]), ..PinholeSpec::default() };
        let camera =
            CameraSpec::Pinhole(spec).build(|| Bounds::EMPTY, &|name: &str| Err(name.into()));
        let camera = camera.unwrap();
        let Projection::Pinhole(pinhole) = camera.projection() else { panic!("no pinhole") };
        let k = pinhole.intrinsics();
        let wanted = FalloffSpec { axis: 0.9, a1: -1.3, a2: 0.8, a3: -0.1 };
        let place = |i: u32| [f64::from(i % 8) * 60.0 / 7.0, f64::from(i / 8) * 40.0 / 7.0];
        let lit = |at| LitPlace { at, light: wanted.at(square_of(&k, at)) };
        let lit: Vec<LitPlace> = (0..64).map(|i| lit(place(i))).collect();
        let found = FalloffSpec::fitted(&k, &lit).unwrap();
        // Four numbers of 64 places in f64, whose equations are conditioned to some 10⁵.
        for (found, wanted) in [
            (found.axis, wanted.axis),
            (found.a1, wanted.a1),
            (found.a2, wanted.a2),
            (found.a3, wanted.a3),
        ] {
            assert!((found - wanted).abs() < 1e-8, "{found} {wanted}");
        }
        assert!(FalloffSpec::fitted(&k, &lit[..1]).is_none());
        assert!(FalloffSpec { axis: 0.0, ..wanted }.check().is_err());
        assert!(FalloffSpec { a2: f64::NAN, ..wanted }.check().is_err());
    }
}
