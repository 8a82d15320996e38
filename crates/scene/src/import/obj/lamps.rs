//! Flat lamps at the rim of a model shine into it alone.
//!
//! MTL has no word for the side on which a surface shines, so `Ke` shines from both. A flat lamp right
//! under the ceiling then lights the slit behind it: the light goes to and fro there, comes out by a
//! gap that few paths find, and those few are white specks. Who draws such a lamp means its front.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Mesh};

use crate::import::Import;

/// How much less of the model lies behind a lamp than before it (as a share) when it shines to the
/// front alone.
const BEHIND: f64 = 0.02;

/// How far a model reaches before a lamp, as a share of the lamp's size, when the lamp is there to light
/// it.
const LEAST_BEFORE: f64 = 0.1;

/// How far from a plane its corners may lie, as a share of the size of what they span: files have six
/// digits.
const FLAT: f64 = 1e-5;

/// Leaves the backs of flat lamps dark that have next to nothing behind them.
pub(super) fn darken_backs(import: &mut Import) {
    if import.materials.iter().all(|material| material.emission.is_none()) {
        return;
    }
    let model = bounds(import.meshes.iter());
    for (number, material) in (0_u32..).zip(&mut import.materials) {
        let Some(emission) = &mut material.emission else { continue };
        let own = import.placements.iter().filter(|placement| placement.material == number);
        let meshes: Vec<&Mesh> = own.map(|own| &import.meshes[own.mesh as usize]).collect();
        if let Some(Sheet { normal, at, size }) = Sheet::of(&meshes) {
            let [behind, before] = extent(model, normal, at);
            // A lamp by itself has nothing before it, and shines wherever it is put.
            let lights_model = before > LEAST_BEFORE * size;
            emission.two_sided = !lights_model || behind > BEHIND * before;
        }
    }
}

fn bounds<'a>(meshes: impl Iterator<Item = &'a Mesh>) -> Bounds {
    let mut bounds = Bounds::default();
    for mesh in meshes {
        (0..mesh.triangles.len()).flat_map(|t| mesh.corners(t)).for_each(|at| bounds.include(at));
    }
    bounds
}

/// Triangles in one plane with their fronts to the same side.
struct Sheet {
    /// Unit normal of the fronts.
    normal: DVec3,
    /// How far along it they lie.
    at: f64,
    /// The diagonal of their box.
    size: f64,
}

impl Sheet {
    /// `None` where the triangles lie in no plane.
    fn of(meshes: &[&Mesh]) -> Option<Self> {
        let triangles = || meshes.iter().flat_map(|m| (0..m.triangles.len()).map(|t| m.corners(t)));
        let cross = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
        let normal = triangles().find_map(|corners| cross(corners).try_normalize())?;
        let at = normal.dot(triangles().next()?[0]);
        let size = bounds(meshes.iter().copied()).diagonal();
        let lies_in = |corners: [DVec3; 3]| {
            let near = |corner: DVec3| (normal.dot(corner) - at).abs() <= FLAT * size;
            corners.into_iter().all(near) && normal.dot(cross(corners)) >= 0.0
        };
        triangles().all(lies_in).then_some(Self { normal, at, size })
    }
}

/// How far `bounds` reach behind a plane and before it.
fn extent(bounds: Bounds, normal: DVec3, at: f64) -> [f64; 2] {
    let middle = normal.dot(bounds.centre()) - at;
    let reach = normal.abs().dot(0.5 * (bounds.max - bounds.min));
    [(reach - middle).max(0.0), (reach + middle).max(0.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_reaches_as_far_as_its_corners() {
        let bounds = Bounds { min: DVec3::ZERO, max: DVec3::new(1.0, 2.0, 4.0) };
        assert_eq!(extent(bounds, DVec3::NEG_Y, -1.5), [0.5, 1.5]);
        assert_eq!(extent(bounds, DVec3::Z, 5.0), [5.0, 0.0], "all is behind");
    }
}
