//! Meshes and where they stand: the geometry of a scene, without light or colour; and its axis-aligned
//! boxes.
//!
//! Triangles without an area are points or lines: no ray hits them, and builders of trees need not bear
//! them, so accelerators leave them out ([`AreaTest`]).

use std::sync::Arc;

use glam::{DMat3, DVec3};

use crate::{Mesh, Motion, Transform};

/// One mesh at one place. A mesh placed twice is stored once.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// Index into [`Geometry::meshes`].
    pub mesh: u32,
    /// Index of the scene's object that this belongs to. Of this number and the next two, the layer
    /// `ids` writes each one more.
    pub object: u32,
    /// Index of the copy that this belongs to, counted through all objects.
    pub instance: u32,
    /// Index of the model's node that this belongs to, counted through all objects.
    pub node: u32,
    /// Index into the scene's materials.
    pub material: u32,
    /// From the mesh's frame to the world (m), at the frame's time.
    pub world_from_mesh: Transform,
    /// Motion of the placement at other times; `None` for what stands still. A mesh that changes
    /// its shape has one where it is placed, also where that goes nowhere.
    pub motion: Option<Arc<Motion>>,
}

impl Placement {
    /// A mesh at a place: of the first object, node and material.
    #[must_use]
    pub fn of(mesh: u32, world_from_mesh: Transform) -> Self {
        Self { mesh, object: 0, instance: 0, node: 0, material: 0, world_from_mesh, motion: None }
    }

    /// From the mesh's frame to the world (m) at `time` (s from the frame's time).
    #[must_use]
    #[inline]
    pub fn world_from_mesh_at(&self, time: f64) -> Transform {
        match &self.motion {
            None => self.world_from_mesh,
            Some(motion) => motion.at(time),
        }
    }
}

/// All meshes and placements of a scene.
#[derive(Debug, Clone, Default)]
pub struct Geometry {
    /// Each mesh once.
    pub meshes: Vec<Mesh>,
    /// Each place of each mesh.
    pub placements: Vec<Placement>,
}

impl Geometry {
    /// One mesh at one place.
    #[must_use]
    pub fn alone(mesh: Mesh, world_from_mesh: Transform) -> Self {
        Self { meshes: vec![mesh], placements: vec![Placement::of(0, world_from_mesh)] }
    }

    /// True if a ray meets the same triangles in the same places as in `other`, whose meshes are the same in memory.
    #[must_use]
    pub fn has_surfaces_of(&self, other: &Self) -> bool {
        let stands = |p: &Placement| (p.mesh, p.world_from_mesh);
        let moves = |p: &Placement| p.motion.clone();
        self.meshes.len() == other.meshes.len()
            && self.meshes.iter().zip(&other.meshes).all(|(own, other)| own.has_surface_of(other))
            && self.placements.iter().map(stands).eq(other.placements.iter().map(stands))
            && self.placements.iter().map(moves).eq(other.placements.iter().map(moves))
    }

    /// True if all is as in `other`, whose meshes are the same in memory.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        self.meshes.len() == other.meshes.len()
            && self.meshes.iter().zip(&other.meshes).all(|(own, other)| own.is_same(other))
            && self.placements == other.placements
    }

    /// Triangles, each stored one once.
    #[must_use]
    pub fn triangles_unique(&self) -> u64 {
        self.meshes.iter().map(|mesh| mesh.triangles.len() as u64).sum()
    }

    /// Triangles as often as they are placed.
    #[must_use]
    pub fn triangles(&self) -> u64 {
        self.placements.iter().map(|p| self.mesh_of(p).triangles.len() as u64).sum()
    }

    /// The mesh that `placement` places.
    #[must_use]
    pub fn mesh_of(&self, placement: &Placement) -> &Mesh {
        &self.meshes[placement.mesh as usize]
    }

    /// True if any placement has a motion, as all have whose mesh changes its shape.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.placements.iter().any(|placement| placement.motion.is_some())
    }

    /// The placements that move between the times of `exposure` (s from the frame's time, first and last), by their
    /// numbers: those that are carried and those whose mesh changes its shape.
    pub fn moving_within(&self, exposure: [f64; 2]) -> impl Iterator<Item = (usize, &Arc<Motion>)> {
        let all = self.placements.iter().enumerate();
        let motions = all.filter_map(|(i, placement)| Some((i, placement.motion.as_ref()?)));
        motions.filter(move |(i, motion)| {
            let deforms = || self.mesh_of(&self.placements[*i]).steps.is_some();
            exposure[0] < exposure[1] && (motion.moves_within(exposure) || deforms())
        })
    }

    /// Number of placements of each mesh.
    #[must_use]
    pub fn uses(&self) -> Vec<u32> {
        let mut uses = vec![0; self.meshes.len()];
        for placement in &self.placements {
            uses[placement.mesh as usize] += 1;
        }
        uses
    }

    /// A box around all placements in world space (m): around the eight corners of each mesh's
    /// own box, so it is loose where a placement turns its mesh.
    #[must_use]
    pub fn loose_bounds(&self) -> Bounds {
        let boxes = self.placements.iter().map(|placement| self.loose_bounds_of(placement));
        boxes.fold(Bounds::EMPTY, Bounds::union)
    }

    /// Box as [`Self::loose_bounds`], with all places of what moves between the times of `exposure`
    /// (s from the frame's time, first and last).
    #[must_use]
    pub fn loose_bounds_within(&self, exposure: [f64; 2]) -> Bounds {
        let swept = |(i, motion): (usize, &Arc<Motion>)| {
            motion.swept(self.mesh_of(&self.placements[i]).bounds_at_all_times(), exposure)
        };
        self.moving_within(exposure).map(swept).fold(self.loose_bounds(), Bounds::union)
    }

    /// Loose box around one placement (m); empty where nothing has an area.
    #[must_use]
    pub fn loose_bounds_of(&self, placement: &Placement) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        let local = self.mesh_of(placement).bounds;
        if !local.is_empty() && self.has_area(placement) {
            for corner in local.corners() {
                bounds.include(placement.world_from_mesh.point(corner));
            }
        }
        bounds
    }

    /// The tight box around all triangles with an area in world space (m). Visits every corner.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for placement in &self.placements {
            let mesh = self.mesh_of(placement);
            if placement.world_from_mesh.is_identity() {
                bounds = bounds.union(mesh.bounds);
                continue;
            }
            let test = AreaTest::under(mesh, &placement.world_from_mesh.linear);
            for i in (0..mesh.triangles.len()).filter(|&i| test.keeps(i)) {
                let corners: [DVec3; 3] = mesh.corners(i);
                for corner in corners {
                    bounds.include(placement.world_from_mesh.point(corner));
                }
            }
        }
        bounds
    }
}

/// True if a triangle is a point or a line.
///
/// Decided without rounding from the differences of its corners, so that no needle, however thin, is
/// taken for a line: products are compared by their rounded value and by what rounding took from it
/// (Dekker's exact product, *A floating-point technique for extending the available precision*, 1971).
#[must_use]
#[inline]
pub fn is_degenerate([a, b, c]: [DVec3; 3]) -> bool {
    let (e, f) = (b - a, c - a);
    e.cross(f) == DVec3::ZERO && are_parallel(e, f)
}

/// True if two vectors are parallel, or one of them is 0.
#[cold]
fn are_parallel(e: DVec3, f: DVec3) -> bool {
    let (Some(e), Some(f)) = (near_one(e), near_one(f)) else { return true };
    let is_same = |a: f64, b: f64, c: f64, d: f64| {
        let (p, q) = (a * b, c * d);
        p == q && a.mul_add(b, -p) == c.mul_add(d, -q)
    };
    is_same(e.x, f.y, e.y, f.x) && is_same(e.y, f.z, e.z, f.y) && is_same(e.z, f.x, e.x, f.z)
}

/// Scales a vector by a power of two so that its largest component is about 1; `None` for 0.
fn near_one(v: DVec3) -> Option<DVec3> {
    let size = v.abs().max_element();
    if size == 0.0 {
        return None;
    }
    // In two steps, because the reciprocal of the least numbers is none.
    let half = 2f64.powf(-(size.log2() / 2.0).round());
    Some(v * half * half)
}

/// Tells the triangles of a mesh under a linear map apart: those with an area and those without.
#[derive(Debug, Clone, Copy)]
pub struct AreaTest<'a> {
    mesh: &'a Mesh,
    /// `None` where the map has an inverse, which keeps what has an area.
    linear: Option<&'a DMat3>,
}

impl<'a> AreaTest<'a> {
    /// For the mesh in its own frame.
    #[must_use]
    pub fn of(mesh: &'a Mesh) -> Self {
        Self { mesh, linear: None }
    }

    /// For the mesh as `linear` turns and stretches it.
    #[must_use]
    pub fn under(mesh: &'a Mesh, linear: &'a DMat3) -> Self {
        Self { mesh, linear: (linear.determinant() == 0.0).then_some(linear) }
    }

    /// True if all triangles are known to have an area, without a look at each.
    #[must_use]
    pub fn keeps_all(&self) -> bool {
        self.linear.is_none() && self.mesh.degenerate == 0
    }

    /// True if triangle `i` has an area.
    #[must_use]
    #[inline]
    pub fn keeps(&self, i: usize) -> bool {
        let [a, b, c] = self.mesh.corners(i);
        match self.linear {
            None => !is_degenerate([a, b, c]),
            Some(linear) => !is_degenerate([DVec3::ZERO, *linear * (b - a), *linear * (c - a)]),
        }
    }
}

impl Placement {
    /// True if the placement leaves anything an area: not when it scales two of three axes to 0, as files hide objects.
    #[must_use]
    pub fn has_extent(&self) -> bool {
        let [x, y, z] = {
            let m = &self.world_from_mesh.linear;
            [m.x_axis, m.y_axis, m.z_axis]
        };
        [(x, y), (y, z), (z, x)].into_iter().any(|(a, b)| !is_degenerate([DVec3::ZERO, a, b]))
    }
}

impl Geometry {
    /// True if any triangle of `placement` has an area where it stands.
    #[must_use]
    pub fn has_area(&self, placement: &Placement) -> bool {
        let mesh = self.mesh_of(placement);
        let count = mesh.triangles.len();
        if mesh.degenerate >= count as u64 || !placement.has_extent() {
            return false;
        }
        let linear = &placement.world_from_mesh.linear;
        // With an inverse, some triangle keeps its area.
        linear.determinant() != 0.0 || {
            let test = AreaTest::under(mesh, linear);
            (0..count).any(|i| test.keeps(i))
        }
    }
}

/// An axis-aligned box (m). Empty when `min` exceeds `max`, as a new one does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The lower corner.
    pub min: DVec3,
    /// The upper corner.
    pub max: DVec3,
}

impl Bounds {
    /// The box of nothing: `+inf` to `−inf`, neutral in [`Self::union`].
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The box of some points (m).
    #[must_use]
    pub fn of_points(points: impl IntoIterator<Item = DVec3>) -> Self {
        let mut bounds = Self::EMPTY;
        points.into_iter().for_each(|point| bounds.include(point));
        bounds
    }

    /// True if the box holds no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Grows the box to hold `point`. NaN coordinates are passed over.
    pub fn include(&mut self, point: DVec3) {
        self.min = self.min.min(point);
        self.max = self.max.max(point);
    }

    /// The smallest box that holds both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The centre (m); the origin for an empty box.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.min + (self.max - self.min) * 0.5 }
    }

    /// The length of the diagonal (m); 0 for an empty box.
    #[must_use]
    pub fn diagonal(&self) -> f64 {
        if self.is_empty() { 0.0 } else { (self.max - self.min).length() }
    }

    /// The eight corners.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            DVec3::new(
                if i & 1 == 0 { self.min.x } else { self.max.x },
                if i & 2 == 0 { self.min.y } else { self.max.y },
                if i & 4 == 0 { self.min.z } else { self.max.z },
            )
        })
    }
}

impl Default for Bounds {
    fn default() -> Self {
        Self::EMPTY
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_lines_have_no_area_and_needles_have() {
        let x = DVec3::new;
        let tiny = f64::EPSILON / 2.0;
        for (corners, expected) in [
            ([x(1.0, 2.0, 3.0); 3], true),
            ([DVec3::ZERO, DVec3::X, DVec3::X], true),
            ([DVec3::ZERO, x(1.0, 1.0, 1.0), x(3.0, 3.0, 3.0)], true),
            // In parts of f64's least numbers products vanish, and are no sign of a line.
            ([DVec3::ZERO, DVec3::X * 1e-300, DVec3::Y * 1e-300], false),
            ([DVec3::ZERO, DVec3::X * 5e-324, DVec3::Y * 5e-324], false),
            ([DVec3::ZERO, DVec3::X * 1e300, DVec3::Y * 1e300], false),
            // Both products of the cross product round to 1 + 4ε: (1 + 3ε)(1 + ε) and (1 + 2ε)².
            (
                [
                    DVec3::ZERO,
                    x(1.0 + 6.0 * tiny, 1.0 + 4.0 * tiny, 0.0),
                    x(1.0 + 4.0 * tiny, 1.0 + 2.0 * tiny, 0.0),
                ],
                false,
            ),
        ] {
            assert_eq!(is_degenerate(corners), expected, "{corners:?}");
        }
    }
}
