//! Field points and wavelengths of a lens file: field points with the part of the pupil that
//! vignetting leaves, wavelengths with their weights.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::element::is_default;
use etendue_geometry::units::Degrees;

/// The most field points and wavelengths; designs have a dozen, and each is looked at with many rays.
pub(super) const MOST_FIELDS: usize = 100;
pub(super) const MOST_WAVELENGTHS: usize = 24;

/// A field point of a lens file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FieldSpec {
    /// The angle off the axis, in the plane of y and z (degrees).
    pub angle: Degrees,
    /// Its weight among the fields; kept for other programs, since nothing here takes a mean of fields.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub weight: f64,
    /// Vignetting of its pupil, as a designer states it; none when absent.
    #[serde(default, skip_serializing_if = "is_default")]
    pub vignetting: VignettingSpec,
}

/// Vignetting of a pupil: its unit circle is made smaller, moved, and then turned about its middle
/// (`OpticStudio`'s vignetting factors VDX, VDY, VCX, VCY and VAN).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct VignettingSpec {
    /// Displacement by x and y (radii of the pupil).
    #[serde(skip_serializing_if = "is_default")]
    pub decentre: [f64; 2],
    /// Share by which it is made smaller along x and y, below 1.
    #[serde(skip_serializing_if = "is_default")]
    pub compression: [f64; 2],
    /// Turn from +x towards +y (degrees).
    #[serde(skip_serializing_if = "is_default")]
    pub rotation: Degrees,
}

fn one() -> f64 {
    1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

impl FieldSpec {
    /// A field at an angle (degrees), of weight 1 and a whole pupil.
    #[must_use]
    pub fn at(angle: f64) -> Self {
        Self { angle: Degrees(angle), weight: 1.0, vignetting: VignettingSpec::default() }
    }

    pub(super) fn check(&self) -> Result<(), String> {
        let angle = self.angle.0;
        if angle.is_nan() || angle.abs() >= 180.0 {
            return Err(format!("angle is {angle} degrees; it must lie between -180 and 180"));
        }
        if !(self.weight >= 0.0 && self.weight.is_finite()) {
            return Err(format!("weight is {}; it must be a number from 0 on", self.weight));
        }
        let VignettingSpec { decentre, compression, rotation } = self.vignetting;
        let are_finite = decentre.iter().chain([&rotation.0]).all(|value| value.is_finite());
        if !are_finite {
            return Err("vignetting: decentre and rotation must be finite".to_owned());
        }
        match compression.iter().find(|share| !(share.is_finite() && **share < 1.0)) {
            Some(share) => Err(format!(
                "vignetting: compression has {share}; it must be below 1, where nothing of the pupil is left"
            )),
            None => Ok(()),
        }
    }
}

impl VignettingSpec {
    /// Maps a point of the whole unit circle to the pupil that vignetting leaves.
    #[must_use]
    pub fn place(&self, whole: DVec2) -> DVec2 {
        let left = DVec2::ONE - DVec2::from(self.compression);
        DVec2::from_angle(self.rotation.0.to_radians())
            .rotate(DVec2::from(self.decentre) + whole * left)
    }

    /// The share of the pupil's area that is left.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.compression.iter().map(|share| 1.0 - share).product::<f64>().abs()
    }
}
