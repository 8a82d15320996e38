//! Which placements are instances of a scene of their own, and which are baked into one.

use std::collections::HashSet;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Geometry, Placement, Transform};

/// What becomes of a placement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Nothing to see, or another stands in the same place.
    LeftOut,
    /// Its triangles are moved.
    Baked,
    /// Its mesh's own scene, moved.
    Instance,
}

/// What becomes of each placement, and which meshes get a scene of their own.
pub(super) struct Instanced {
    pub(super) placements: Vec<Kind>,
    pub(super) meshes: Vec<bool>,
}

/// Rays are moved into a worse conditioned placement with an error that single precision cannot bear.
const WORST_CONDITION: f64 = 1e3;

impl Instanced {
    pub(super) fn of(geometry: &Geometry) -> Self {
        let uses = geometry.uses();
        let mut seen = HashSet::new();
        let mut meshes = vec![false; geometry.meshes.len()];
        let kind = |placement: &Placement| {
            let (mesh, transform) = (placement.mesh as usize, &placement.world_from_mesh);
            if geometry.meshes[mesh].triangles.is_empty() || !transform.is_finite() {
                return Kind::LeftOut;
            }
            if uses[mesh] < 2 {
                return Kind::Baked;
            }
            // Of several in the very same place the first is the one that is seen.
            if !seen.insert((mesh, bits_of(transform))) {
                return Kind::LeftOut;
            }
            if !is_sound(&transform.linear) {
                return Kind::Baked;
            }
            meshes[mesh] = true;
            Kind::Instance
        };
        let placements = geometry.placements.iter().map(kind).collect();
        Self { placements, meshes }
    }
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
