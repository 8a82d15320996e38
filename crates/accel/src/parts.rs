//! Parts that a tree is built over, and the way of a ray into them.
//!
//! A *part* is a set of triangles in one frame: a mesh in its own frame, shared by all its
//! placements, or several placements *baked* into a frame that is parallel to the world's. An
//! *instance* is a part at a place. Every frame has its origin among its triangles and a power of
//! two as its scale, so that coordinates in it are at most about 1 and single precision is spent on
//! what matters.
//!
//! Rays reach a frame in f64, as seen from the instance, and know how far rounding may have moved
//! them against the triangles (see [`LocalRay::pad`]): boxes are widened by that, so nothing is
//! culled that the exact test would hit.

mod frame;
mod instance;
mod part;

use self::instance::{largest, norm};
use self::part::{MOST_TRIANGLES, index};
use crate::{BuildError, BuildOptions};
use etendue_geometry::{Bounds, Geometry, MISS, Placement};

pub(crate) use self::frame::{PartFrame, outward};
pub(crate) use self::instance::{LocalRay, LocalRays, PartInstance};
pub(crate) use self::part::{Blas, Members, MeshTriangles};

/// All parts and instances of a scene, and the frame of the tree over the instances.
#[derive(Debug)]
pub(crate) struct Layout {
    pub(crate) parts: Vec<Blas>,
    pub(crate) instances: Vec<PartInstance>,
    /// Instance of the whole scene, parallel to the world.
    pub(crate) world: PartInstance,
    pub(crate) world_frame: PartFrame,
}

/// The longest sides of scenes (m) that every accelerator takes: products of three of Embree's lengths stay in
/// single precision, and the trees' boxes, which are widened by what f64 rounds off at the scene's size, still
/// tell its parts from one another.
const LENGTHS: [f64; 2] = [1e-12, 1e12];

/// Refuses a scene within these bounds (m) that no accelerator tells the parts of.
///
/// # Errors
///
/// When its longest side is shorter than 1e-12 m or longer than 1e12 m.
pub fn check_scale(bounds: Bounds) -> Result<(), BuildError> {
    let extent = if bounds.is_empty() { 0.0 } else { (bounds.max - bounds.min).max_element() };
    let [least, most] = LENGTHS;
    if extent == 0.0 || (least..=most).contains(&extent) {
        return Ok(());
    }
    Err(BuildError::Scale { extent, least, most })
}

/// Choice of what is baked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Baking {
    /// Meshes used once that are not too fine for the scene's single precision, in one part.
    UsedOnce,
    /// Only what has no inverse.
    Singular,
}

/// A mesh is baked with others while its typical triangle is this much larger than what single
/// precision resolves in the scene's frame.
const BAKED_RESOLUTION: f64 = 64.0;

impl Layout {
    pub(crate) fn new(geometry: &Geometry, baking: Baking) -> Self {
        let world_frame = PartFrame::of(geometry.loose_bounds());
        let uses = geometry.uses();
        let mut layout = Self {
            parts: Vec::new(),
            instances: Vec::new(),
            world: PartInstance::parallel(MISS, world_frame, 0.0),
            world_frame,
        };
        // Meshes that are placed once are baked into the world; others are parts of their own.
        let mut part_of_mesh = vec![None; geometry.meshes.len()];
        let mut baked = Vec::new();
        for (i, placement) in geometry.placements.iter().enumerate() {
            let i = index(i);
            let mesh = geometry.mesh_of(placement);
            if !placement.world_from_mesh.is_finite() || !geometry.has_area(placement) {
                continue;
            }
            let once = baking == Baking::UsedOnce && uses[placement.mesh as usize] == 1;
            if once && is_coarse(geometry, placement, world_frame) {
                baked.push(i);
                continue;
            }
            let frame = PartFrame::of(mesh.bounds);
            let Some(instance) = PartInstance::placed(placement, i, frame, mesh.bounds) else {
                layout.bake(geometry, vec![i]);
                continue;
            };
            let part = *part_of_mesh[placement.mesh as usize].get_or_insert_with(|| {
                let members = Members::Mesh(placement.mesh);
                layout.parts.push(Blas { frame, members });
                index(layout.parts.len() - 1)
            });
            layout.instances.push(instance.of(part));
        }
        // The world's own instance, as far as what was baked into it reaches.
        layout.bake_together(geometry, baked);
        let reach = geometry.placements.iter().map(|p| baked_reach(geometry, p, world_frame));
        layout.world = PartInstance::parallel(MISS, world_frame, reach.fold(0.0, f64::max));
        layout
    }

    /// Triangles of all parts: each shared mesh once, and what is baked.
    pub(crate) fn triangles(&self, geometry: &Geometry) -> u64 {
        self.parts.iter().map(|part| part.len(geometry) as u64).sum()
    }

    /// Refuses what cannot be numbered or measured, and what would take more than the caller's memory limit
    /// at so many bytes a triangle and an instance.
    ///
    /// # Errors
    ///
    /// [`BuildError::Scale`], [`BuildError::TooLarge`] and [`BuildError::MemoryLimit`].
    pub(crate) fn check_size(
        &self,
        geometry: &Geometry,
        options: &BuildOptions,
        backend: &'static str,
        [per_triangle, per_instance]: [u64; 2],
    ) -> Result<(), BuildError> {
        check_scale(geometry.loose_bounds())?;
        for part in &self.parts {
            if part.len(geometry) > MOST_TRIANGLES {
                return Err(part.too_large(geometry, backend));
            }
        }
        let bytes = self
            .triangles(geometry)
            .saturating_mul(per_triangle)
            .saturating_add((self.instances.len() as u64).saturating_mul(per_instance));
        match options.memory_limit {
            Some(limit) if bytes > limit => Err(BuildError::MemoryLimit { backend, limit }),
            _ => Ok(()),
        }
    }

    /// A box around the box `local` of an instance's part, in the frame of the tree over the instances.
    pub(crate) fn bounds_of(
        &self,
        instance: &PartInstance,
        geometry: &Geometry,
        local: Bounds,
    ) -> Bounds {
        let part = &self.parts[instance.part as usize];
        let frame = self.world_frame;
        let mut bounds = Bounds::EMPTY;
        for corner in local.corners() {
            let corner = corner / part.frame.scale + part.frame.origin;
            let point = match geometry.placements.get(instance.placement as usize) {
                Some(placement) => placement.world_from_mesh.point_from(corner, frame.origin),
                None => corner - frame.origin,
            };
            bounds.include(point * frame.scale);
        }
        bounds
    }

    /// Adds parts for `placements`, as few as can be numbered.
    fn bake_together(&mut self, geometry: &Geometry, placements: Vec<u32>) {
        let mut together = Vec::new();
        let mut triangles = 0;
        for i in placements {
            let more = geometry.mesh_of(&geometry.placements[i as usize]).triangles.len();
            if triangles + more > MOST_TRIANGLES && !together.is_empty() {
                self.bake(geometry, std::mem::take(&mut together));
                triangles = 0;
            }
            together.push(i);
            triangles += more;
        }
        if !together.is_empty() {
            self.bake(geometry, together);
        }
    }

    /// Adds a part for `placements`, parallel to the world.
    fn bake(&mut self, geometry: &Geometry, placements: Vec<u32>) {
        let members = || placements.iter().map(|&i| &geometry.placements[i as usize]);
        let bounds = members().fold(Bounds::EMPTY, |all, p| all.union(geometry.loose_bounds_of(p)));
        let frame = PartFrame::of(bounds);
        let reach = members().map(|p| baked_reach(geometry, p, frame)).fold(0.0, f64::max);
        let part = index(self.parts.len());
        self.parts.push(Blas { frame, members: Members::Baked(placements) });
        self.instances.push(PartInstance::parallel(part, frame, reach));
    }
}

/// The magnitudes that a placement's corners are summed from in `frame`.
fn baked_reach(geometry: &Geometry, placement: &Placement, frame: PartFrame) -> f64 {
    let transform = &placement.world_from_mesh;
    let local = largest(geometry.mesh_of(placement).bounds);
    let offset = transform.offset_from(frame.origin).abs().max_element();
    (norm(&transform.linear) * local + offset) * frame.scale
}

/// True if a placed mesh's typical triangle is large against what f32 resolves in `frame`.
fn is_coarse(geometry: &Geometry, placement: &Placement, frame: PartFrame) -> bool {
    let triangles = geometry.mesh_of(placement).triangles.len() as f64;
    let size = geometry.loose_bounds_of(placement).diagonal() / triangles.sqrt();
    size * frame.scale > BAKED_RESOLUTION * f64::from(f32::EPSILON)
}
