//! A part at a place, and rays as they reach it: in f64, with what rounding may have done to them.

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Bounds, MISS, Placement};

use super::frame::{PartFrame, reciprocal_power};

/// A part at a place.
#[derive(Debug, Clone)]
pub(crate) struct PartInstance {
    pub(crate) part: u32,
    /// The placement, or [`MISS`] for a baked part, which knows its triangles' placements.
    pub(crate) placement: u32,
    /// The frame's scale where the frame is parallel to the world, else 0.
    pub(crate) parallel_scale: f64,
    /// From world directions to the part's frame, with its scale.
    linear: DMat3,
    translation: DVec3,
    translation_low: DVec3,
    /// The frame's origin in its own scaled units: what is left to subtract.
    origin: DVec3,
    pad: f64,
    pad_per_distance: f64,
}

/// A ray in a part's frame. It has the same distances as in the world: its direction is not unit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LocalRay {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    /// Distance by which f64 rounding may have moved the ray against any triangle near it, along an axis.
    pub(crate) pad: f64,
}

/// As [`LocalRay`], many.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LocalRays<const N: usize> {
    pub(crate) origin: [[f64; N]; 3],
    pub(crate) direction: [[f64; N]; 3],
    pub(crate) pad: [f64; N],
}

/// Half the distance from 1 to the next f64.
const ROUNDING: f64 = f64::EPSILON / 2.0;

/// Roundings, each of at most one [`ROUNDING`] of the magnitudes involved, that box tests allow for.
/// On a ray's or a corner's way into a frame there are about fifty:
/// inverting a 3 × 3 matrix (about 14 per condition number), applying it twice
/// (4 each), the sums of the offset (3), and the box test itself (4). The rest is for a distance
/// that [`crate::watertight::intersect`] rounds to before its box begins.
const ROUNDINGS: f64 = 1024.0;

/// A worse conditioned placement is baked: its inverse would eat into single precision's slack.
const WORST_CONDITION: f64 = 1e5;

impl PartInstance {
    /// A frame parallel to the world.
    pub(super) fn parallel(part: u32, frame: PartFrame, reach: f64) -> Self {
        Self {
            part,
            placement: MISS,
            parallel_scale: frame.scale,
            linear: DMat3::from_diagonal(DVec3::splat(frame.scale)),
            translation: frame.origin,
            translation_low: DVec3::ZERO,
            origin: DVec3::ZERO,
            pad: ROUNDINGS * ROUNDING * (1.0 + reach),
            pad_per_distance: ROUNDINGS * ROUNDING * frame.scale,
        }
    }

    /// The mesh's own frame at `placement`, as yet of no part (see [`Self::of`]); `None` when that
    /// has no good inverse.
    pub(super) fn placed(
        placement: &Placement,
        i: u32,
        frame: PartFrame,
        bounds: Bounds,
    ) -> Option<Self> {
        let transform = &placement.world_from_mesh;
        // At unit scale, so that a determinant of 10⁻³⁰⁰ is not mistaken for 0.
        let unit = reciprocal_power(norm(&transform.linear));
        let scaled = transform.linear * unit;
        if scaled.determinant() == 0.0 {
            return None;
        }
        let inverse = scaled.inverse();
        let condition = norm(&scaled) * norm(&inverse);
        let linear = inverse * (unit * frame.scale);
        if !(condition <= WORST_CONDITION && linear.is_finite() && transform.is_finite()) {
            return None;
        }
        let error = ROUNDINGS * ROUNDING * condition;
        Some(Self {
            part: MISS,
            placement: i,
            parallel_scale: 0.0,
            linear,
            translation: transform.translation,
            translation_low: transform.translation_low,
            origin: frame.origin * frame.scale,
            pad: error * (1.0 + largest(bounds) * frame.scale),
            pad_per_distance: error * norm(&linear),
        })
    }

    /// Returns the instance for the part of that number.
    pub(super) fn of(self, part: u32) -> Self {
        Self { part, ..self }
    }

    /// A world ray in the part's frame.
    #[inline(always)]
    pub(crate) fn ray(&self, origin: DVec3, direction: DVec3) -> LocalRay {
        let offset = (self.translation - origin) + self.translation_low;
        let distance = offset.abs();
        let pad = self.pad_at(distance.x + distance.y + distance.z);
        if self.parallel_scale > 0.0 {
            let scale = self.parallel_scale;
            return LocalRay { origin: -offset * scale, direction: direction * scale, pad };
        }
        let origin = -(self.linear * offset) - self.origin;
        LocalRay { origin, direction: self.linear * direction, pad }
    }

    /// The frame's translation as seen from a place in the world.
    #[inline(always)]
    pub(crate) fn offset(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let (high, low) = (self.translation, self.translation_low);
        [(high.x - x) + low.x, (high.y - y) + low.y, (high.z - z) + low.z]
    }

    /// The pad of a ray that begins at an offset whose components' sizes sum up to `distance`.
    #[inline(always)]
    pub(crate) fn pad_at(&self, distance: f64) -> f64 {
        self.pad + self.pad_per_distance * distance
    }

    /// World rays in the part's frame, as [`Self::ray`] has them, side by side.
    #[inline(always)]
    pub(crate) fn rays<const N: usize>(
        &self,
        origin: [&[f64; N]; 3],
        direction: [&[f64; N]; 3],
    ) -> LocalRays<N> {
        let zero = [0.0; N];
        let mut rays = LocalRays { origin: [zero; 3], direction: [zero; 3], pad: zero };
        let [lx, ly, lz] = [self.linear.x_axis, self.linear.y_axis, self.linear.z_axis];
        for i in 0..N {
            let [x, y, z] = self.offset([origin[0][i], origin[1][i], origin[2][i]]);
            rays.origin[0][i] = -(lx.x * x + ly.x * y + lz.x * z) - self.origin.x;
            rays.origin[1][i] = -(lx.y * x + ly.y * y + lz.y * z) - self.origin.y;
            rays.origin[2][i] = -(lx.z * x + ly.z * y + lz.z * z) - self.origin.z;
            rays.pad[i] = self.pad_at(x.abs() + y.abs() + z.abs());
            let (x, y, z) = (direction[0][i], direction[1][i], direction[2][i]);
            rays.direction[0][i] = lx.x * x + ly.x * y + lz.x * z;
            rays.direction[1][i] = lx.y * x + ly.y * y + lz.y * z;
            rays.direction[2][i] = lx.z * x + ly.z * y + lz.z * z;
        }
        rays
    }
}

pub(super) fn largest(bounds: Bounds) -> f64 {
    if bounds.is_empty() { 0.0 } else { bounds.min.abs().max(bounds.max.abs()).max_element() }
}

/// The Frobenius norm.
pub(super) fn norm(matrix: &DMat3) -> f64 {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    (x.length_squared() + y.length_squared() + z.length_squared()).sqrt()
}
