//! Which placements are instances of a scene of their own, and which are baked into one.

use std::collections::HashSet;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Bounds, Geometry, Placement, Transform};

/// What becomes of a placement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum InstanceKind {
    /// Nothing to see, or another stands in the same place.
    LeftOut,
    /// Its triangles are moved.
    Baked,
    /// Its mesh's own scene, moved.
    Instance,
}

/// What becomes of each placement, and which meshes get a scene of their own.
pub(super) struct Instanced {
    pub(super) placements: Vec<InstanceKind>,
    pub(super) meshes: Vec<bool>,
}

/// Rays are moved into a worse conditioned placement with an error that single precision cannot bear.
const WORST_CONDITION: f64 = 1e3;

/// An instance whose box is fewer of single precision's steps long is baked: Debian 12's Embree ends
/// the process when it has to part instances whose boxes are one point
/// (`heuristic_openmerge_array.h`, at low quality). Under half a step there is nothing to hit.
const LEAST_STEPS: f64 = 4.0;

/// Triangles from which a mesh is worth a scene of its own when things move: below it, building takes a
/// few milliseconds.
const LARGE: usize = 10_000;

impl Instanced {
    /// For coordinates relative to `origin`. Where things `move`, large meshes that are used once are
    /// instances, too: what has not changed is then not built again.
    pub(super) fn of(geometry: &Geometry, origin: DVec3, moves: bool) -> Self {
        let uses = geometry.uses();
        let is_large = |mesh: usize| geometry.meshes[mesh].triangles.len() >= LARGE;
        let mut seen = HashSet::new();
        let mut meshes = vec![false; geometry.meshes.len()];
        let kind = |placement: &Placement| {
            let (mesh, transform) = (placement.mesh as usize, &placement.world_from_mesh);
            if !transform.is_finite() || !geometry.has_area(placement) {
                return InstanceKind::LeftOut;
            }
            if uses[mesh] < 2 && !(moves && is_large(mesh)) {
                return InstanceKind::Baked;
            }
            // Of several in the very same place the first is the one that is seen.
            if !seen.insert((mesh, bits_of(transform))) {
                return InstanceKind::LeftOut;
            }
            if !is_sound(&transform.linear) {
                return InstanceKind::Baked;
            }
            let steps = steps_of_f32(geometry.meshes[mesh].bounds, transform, origin);
            if steps < LEAST_STEPS {
                return if steps < 0.5 { InstanceKind::LeftOut } else { InstanceKind::Baked };
            }
            meshes[mesh] = true;
            InstanceKind::Instance
        };
        let placements = geometry.placements.iter().map(kind).collect();
        Self { placements, meshes }
    }
}

/// How many steps of single precision the box of a mesh is long where `transform` places it, seen from
/// `origin`, on the axis on which it is most.
fn steps_of_f32(bounds: Bounds, transform: &Transform, origin: DVec3) -> f64 {
    let l = &transform.linear;
    let size = bounds.max - bounds.min;
    let extent = l.x_axis.abs() * size.x + l.y_axis.abs() * size.y + l.z_axis.abs() * size.z;
    let place = transform.point_from(bounds.centre(), origin).abs() + extent;
    let steps = extent / (place * f64::from(f32::EPSILON));
    // 0 over 0 is NaN, which `max` passes over.
    0.0_f64.max(steps.x).max(steps.y).max(steps.z)
}

fn bits_of(transform: &Transform) -> [u64; 15] {
    let mut bits = [0; 15];
    let [x, y, z] = [transform.linear.x_axis, transform.linear.y_axis, transform.linear.z_axis];
    let columns = [x, y, z, transform.translation, transform.translation_low];
    for (k, column) in columns.into_iter().enumerate() {
        // Adding zero turns −0 into 0.
        bits[3 * k..3 * k + 3].copy_from_slice(&(column + 0.0).to_array().map(f64::to_bits));
    }
    bits
}

/// Whether single precision can invert `linear`.
fn is_sound(linear: &DMat3) -> bool {
    let norm = |m: &DMat3| {
        let squares = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length_squared);
        squares.into_iter().sum::<f64>().sqrt()
    };
    let size = norm(linear);
    // At unit scale, so that a small determinant is not mistaken for 0; Embree works out f32's.
    let unit = *linear * (1.0 / size);
    (1e-12..1e12).contains(&size)
        && unit.determinant() != 0.0
        && norm(&unit.inverse()) <= WORST_CONDITION
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placements_that_single_precision_cannot_invert_are_baked() {
        let sound = |x: f64, y: f64, z: f64| is_sound(&DMat3::from_diagonal(DVec3::new(x, y, z)));
        assert!(sound(1.0, 1.0, 1.0) && sound(-1e-6, 1e-6, 2e-6) && sound(1e5, -1e5, 1e5));
        assert!(!sound(1.0, 1.0, 0.0) && !sound(0.0, 0.0, 0.0) && !sound(1e-7, 1.0, 1.0));
        assert!(!sound(f64::NAN, 1.0, 1.0));
    }
}
