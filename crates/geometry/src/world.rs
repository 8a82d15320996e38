//! Meshes and where they stand: the geometry of a scene, without light or colour.

use glam::DVec3;

use crate::{AreaTest, Bounds, Mesh, Transform};

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
    /// From the mesh's frame to the world (m).
    pub world_from_mesh: Transform,
}

impl Placement {
    /// A mesh at a place: of the first object, node and material.
    #[must_use]
    pub fn of(mesh: u32, world_from_mesh: Transform) -> Self {
        Self { mesh, object: 0, instance: 0, node: 0, material: 0, world_from_mesh }
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

    /// Whether a ray meets the same triangles in the same places as in `other`, whose meshes are the same
    /// in memory.
    #[must_use]
    pub fn has_surfaces_of(&self, other: &Self) -> bool {
        let stands = |p: &Placement| (p.mesh, p.world_from_mesh);
        self.meshes.len() == other.meshes.len()
            && self.meshes.iter().zip(&other.meshes).all(|(own, other)| own.has_surface_of(other))
            && self.placements.iter().map(stands).eq(other.placements.iter().map(stands))
    }

    /// Whether all is as in `other`, whose meshes are the same in memory.
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

    /// How often each mesh is placed.
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

    /// The same box around one placement (m); empty where nothing has an area.
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
