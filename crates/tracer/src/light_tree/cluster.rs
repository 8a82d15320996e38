//! Lights that are asked together: where they are, and where they shine.

use std::f64::consts::{FRAC_PI_2, PI};

use etendue_geometry::Bounds;
use etendue_geometry::glam::DVec3;

/// Lights that are near to each other, or one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cluster {
    pub(crate) bounds: Bounds,
    /// About which they shine.
    pub(crate) axis: DVec3,
    /// Half-angle of the cone within which their own axes lie (radians).
    pub(crate) cone: f64,
    /// Angle beyond the cone up to which they shine (radians).
    pub(crate) reach: f64,
    /// The sum of their intensities (W/sr) along their axes.
    pub(crate) intensity: f64,
}

/// A light by its number, as a cluster.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NumberedCluster {
    pub(crate) number: u32,
    pub(crate) cluster: Cluster,
}

impl Cluster {
    /// Of no light.
    pub(super) const DARK: Self =
        Self { bounds: Bounds::EMPTY, axis: DVec3::ZERO, cone: 0.0, reach: 0.0, intensity: 0.0 };

    /// Tests whether it is a point that shines to all sides.
    pub(super) fn is_point(&self) -> bool {
        self.cone >= PI && self.bounds.diagonal() == 0.0
    }

    /// Both together.
    pub(super) fn union(&self, other: &Self) -> Self {
        if self.intensity <= 0.0 || other.intensity <= 0.0 {
            return if self.intensity > 0.0 { *self } else { *other };
        }
        let (axis, cone) = cone_around([self.axis, other.axis], [self.cone, other.cone]);
        Self {
            bounds: self.bounds.union(other.bounds),
            axis,
            cone,
            reach: self.reach.max(other.reach),
            intensity: self.intensity + other.intensity,
        }
    }

    /// Cost of having these lights in one node, to a factor: equation 2 of the source.
    pub(super) fn cost(&self) -> f64 {
        let extent = self.bounds.max - self.bounds.min;
        let area = extent.x * extent.y + extent.y * extent.z + extent.z * extent.x;
        let (cone, wide) = (self.cone, (self.cone + self.reach).min(PI));
        let angle = 2.0 * PI * (1.0 - cone.cos())
            + FRAC_PI_2
                * (2.0 * wide * cone.sin() - (cone - 2.0 * wide).cos() - 2.0 * cone * cone.sin()
                    + cone.cos());
        self.intensity * area * angle
    }
}

/// The cone around two cones: its axis and half-angle.
fn cone_around([a, b]: [DVec3; 2], [of_a, of_b]: [f64; 2]) -> (DVec3, f64) {
    let between = a.angle_between(b);
    if (between + of_b).min(PI) <= of_a {
        return (a, of_a);
    }
    if (between + of_a).min(PI) <= of_b {
        return (b, of_b);
    }
    let half = 0.5 * (of_a + between + of_b);
    let turn = a.cross(b).try_normalize().filter(|_| half < PI);
    match turn {
        // Rodrigues' rotation of `a` towards `b`.
        Some(turn) => {
            let (sin, cos) = (half - of_a).sin_cos();
            (a * cos + turn.cross(a) * sin, half)
        }
        None => (a, PI),
    }
}
