//! A break of the coordinates: from here on the axis runs elsewhere, for all that follows.
//!
//! It stops nothing and bends nothing. As behind a [mirror](super::Mirror), a train is traced in unfolded coordinates:
//! rays are written down anew where the axis breaks, so that what follows stands on an axis along z again, and
//! thicknesses count along it.
//!
//! With the decentre d and the turns by α, β and γ about x, y and z, what is at p behind the break is at
//! d + `R_x`(α) `R_y`(β) `R_z`(γ) p before it; with `tilt_first`, the order flag 1 of Zemax, at
//! `R_z`(γ) `R_y`(β) `R_x`(α) (d + p). All turns are right-handed, each about the axis as the ones before have left it.

use etendue_geometry::units::Degrees;
use glam::{DMat3, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::rays::{Block, LANES, Ray, RayStatus, Traversal, moved, turned};
use super::real::Real;

/// A break as a lens file writes it, beside the element's `tilt` (about x and y) and `decentre`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CoordinateBreakSpec {
    /// A turn about z (degrees, right-handed).
    #[serde(skip_serializing_if = "super::is_default")]
    pub rotation: Degrees,
    /// True if the axis is turned about z, then y, then x, and moved across itself then (Zemax' order flag 1); otherwise it
    /// is moved first, and turned about x, then y, then z.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub tilt_first: bool,
    /// Instead of turns and a decentre: the number of an element before it, from 0, at whose vertex the axis stands again,
    /// and as it stood there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub return_to: Option<usize>,
}

/// A break, in the frame of its plane before it (mm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoordinateBreak {
    /// From the frame behind it to that before it.
    pub(crate) turn: DMat3,
    /// Origin of the coordinates behind the break (mm).
    pub(crate) shift: DVec3,
}

impl CoordinateBreakSpec {
    /// The break with the element's tilt (degrees about x and y) and decentre (mm).
    pub(crate) fn build(&self, tilt: [f64; 2], decentre: [f64; 2]) -> CoordinateBreak {
        let [x, y, z] = [tilt[0], tilt[1], self.rotation.0].map(f64::to_radians);
        let [x, y, z] =
            [DMat3::from_rotation_x(x), DMat3::from_rotation_y(y), DMat3::from_rotation_z(z)];
        let decentre = DVec3::new(decentre[0], decentre[1], 0.0);
        match self.tilt_first {
            false => CoordinateBreak { turn: x * y * z, shift: decentre },
            true => {
                let turn = z * y * x;
                CoordinateBreak { turn, shift: turn * decentre }
            }
        }
    }
}

impl Default for CoordinateBreak {
    fn default() -> Self {
        Self { turn: DMat3::IDENTITY, shift: DVec3::ZERO }
    }
}

impl CoordinateBreak {
    /// As it takes light from behind to before.
    pub(super) fn reversed(&self) -> Self {
        let turn = self.turn.transpose();
        Self { turn, shift: -(turn * self.shift) }
    }

    /// A ray in the frame before it, written down in that behind it.
    #[inline(always)]
    pub(super) fn renewed<T: Real>(&self, ray: Ray<T>) -> Ray<T> {
        let back = self.turn.transpose();
        let place = moved(ray.position, -self.shift);
        Ray { position: turned(&back, place), direction: turned(&back, ray.direction) }
    }

    /// The rays of a block that are on their way, at z (mm).
    #[inline(always)]
    pub(super) fn renew(&self, block: &mut Block, z: f64) {
        for lane in 0..LANES {
            let old = block.ray(lane);
            let mut local = old;
            local.position[2] -= z;
            let mut new = self.renewed(local);
            new.position[2] += z;
            let alive = block.outcome[lane] == 0;
            let position = if alive { new.position } else { old.position };
            let direction = if alive { new.direction } else { old.direction };
            block.set_ray(lane, Ray { position, direction });
        }
    }

    /// Crossing of one ray with the break, and its point on the plane before the break.
    pub(super) fn renewed_one(&self, ray: Ray) -> Traversal {
        let t = -ray.position[2] / ray.direction[2];
        let point = Some(ray.advanced(t).position).filter(|p| p.iter().all(|x| x.is_finite()));
        let status = RayStatus::Exited;
        Traversal { status, ray: self.renewed(ray), point, transmission: 1.0 }
    }
}
