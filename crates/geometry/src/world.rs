//! Meshes and where they stand: the geometry of a scene, without light or colour.
//!
//! Triangles without an area are points or lines: no ray hits them, and builders of trees need not bear
//! them, so accelerators leave them out ([`AreaTest`]).

use std::sync::Arc;

use glam::{DMat3, DVec3};

use crate::{Bounds, Mesh, Motion, Transform, is_degenerate};

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
