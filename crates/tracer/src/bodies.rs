//! Bodies of glass and liquids: which placements enclose a medium, and which medium wins where several do.
//!
//! A path keeps the set of bodies that it is in, by what surfaces it crossed, and the medium around it is the body of
//! highest rank: the interfaces of the others are not there (Schmidt and Budge, "Simple Nested Dielectrics in Ray
//! Traced Images", JGT 2002). Their priorities are given by hand; here the body of the smaller volume ranks higher,
//! which is the inner one wherever one holds another, and the vessel's thin wall before what is filled into it. Rank
//! does not depend on the way a path goes, so light sees the same media in both directions.

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Bounds, Geometry, Mesh};

use crate::{Ior, Material};

/// The largest share of a mesh's area that its oriented triangles may lack of a closed surface's, of which they cancel:
/// what the rounding of coordinates to f32 leaves, and far less than a face that is missing.
const LEAST_OPENING: f64 = 1e-4;

/// Bodies up to which each is held against each; more are taken to touch one another.
const MOST_COMPARED: usize = 4096;

/// A placement that encloses a medium.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Body {
    /// Rank: where several bodies are, the medium is that of the highest.
    pub(crate) rank: u32,
    /// Some of its boundary may not be there: its box meets that of another body, or its index is that of air.
    pub(crate) may_vanish: bool,
    /// The box around it (m).
    pub(crate) bounds: Bounds,
}

/// A volume that a placement encloses.
struct EnclosedVolume {
    /// Its size (m³).
    volume: f64,
    /// Number of the placement.
    placement: usize,
    bounds: Bounds,
}

/// The bodies among the placements of a scene.
pub(crate) fn bodies(geometry: &Geometry, materials: &[Material]) -> Vec<Option<Body>> {
    let mut enclosed: Vec<Option<Option<f64>>> = vec![None; geometry.meshes.len()];
    // Those that enclose something, the largest first.
    let mut found: Vec<EnclosedVolume> = Vec::new();
    for (i, placement) in geometry.placements.iter().enumerate() {
        let material = materials.get(placement.material as usize);
        if !material.is_some_and(|material| material.scattering.is_body()) {
            continue;
        }
        let volume = enclosed[placement.mesh as usize]
            .get_or_insert_with(|| volume(geometry.mesh_of(placement)));
        let Some(volume) = *volume else { continue };
        let linear: &DMat3 = &placement.world_from_mesh.linear;
        let bounds = geometry.loose_bounds_of(placement);
        let volume = volume * linear.determinant().abs();
        found.push(EnclosedVolume { volume, placement: i, bounds });
    }
    found.sort_by(|a, b| b.volume.total_cmp(&a.volume).then(a.placement.cmp(&b.placement)));
    let nested = nested(&found);
    let mut bodies = vec![None; geometry.placements.len()];
    let is_air = |placement: usize| {
        let material = materials.get(geometry.placements[placement].material as usize);
        let glass = material.and_then(|material| material.scattering.glass());
        glass.is_some_and(|glass| glass.ior == Ior::Constant(1.0))
    };
    for ((rank, own), is_nested) in (0..).zip(&found).zip(nested) {
        let EnclosedVolume { placement, bounds, .. } = *own;
        let may_vanish = is_nested || is_air(placement);
        bodies[placement] = Some(Body { rank, may_vanish, bounds });
    }
    bodies
}

/// Tests, for each of them, whether its box meets that of another.
fn nested(found: &[EnclosedVolume]) -> Vec<bool> {
    if found.len() > MOST_COMPARED {
        return vec![true; found.len()];
    }
    let meets = |a: &Bounds, b: &Bounds| a.min.cmple(b.max).all() && b.min.cmple(a.max).all();
    let mut nested = vec![false; found.len()];
    for i in 0..found.len() {
        for k in i + 1..found.len() {
            if meets(&found[i].bounds, &found[k].bounds) {
                (nested[i], nested[k]) = (true, true);
            }
        }
    }
    nested
}

/// The volume (m³) that a mesh encloses; `None` for one that is open. Of a closed surface the oriented areas cancel.
fn volume(mesh: &Mesh) -> Option<f64> {
    let centre = mesh.bounds.centre();
    let (mut oriented, mut area, mut volume) = (DVec3::ZERO, 0.0, 0.0);
    for i in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(i).map(|corner| corner - centre);
        let twice = (b - a).cross(c - a);
        oriented += twice;
        area += twice.length();
        volume += a.dot(twice);
    }
    let volume = volume.abs() / 6.0;
    (oriented.length() <= LEAST_OPENING * area && volume > 0.0).then_some(volume)
}
