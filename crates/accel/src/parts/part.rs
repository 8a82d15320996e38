//! Triangles in one frame, one at a time and as what trees are built from.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{AreaTest, Geometry, MISS, Positions, Transform};
use rayon::prelude::*;

use super::frame::{PartFrame, outward};
use crate::BuildError;
use crate::tree::Ref;

/// Whose triangles a part holds.
#[derive(Debug, Clone)]
pub(crate) enum Members {
    /// One mesh, in its own frame, for any number of placements.
    Mesh(u32),
    /// These placements, parallel to the world.
    Baked(Vec<u32>),
}

/// A set of triangles in one frame.
#[derive(Debug, Clone)]
pub(crate) struct Blas {
    pub(crate) frame: PartFrame,
    pub(crate) members: Members,
}

/// Triangles of one part that a tree can certainly number: the fast backend has 2²⁸ cells, of which
/// a triangle takes two to three.
pub(super) const MOST_TRIANGLES: usize = 90_000_000;

impl Blas {
    /// The number of triangles, those without area included.
    pub(crate) fn len(&self, geometry: &Geometry) -> usize {
        match &self.members {
            Members::Mesh(mesh) => geometry.meshes[*mesh as usize].triangles.len(),
            Members::Baked(placements) => {
                let mesh = |&i: &u32| geometry.mesh_of(&geometry.placements[i as usize]);
                placements.iter().map(|i| mesh(i).triangles.len()).sum()
            }
        }
    }

    /// The error that says so.
    pub(crate) fn too_large(&self, geometry: &Geometry, backend: &'static str) -> BuildError {
        BuildError::TooLarge {
            mesh: self.name(geometry).to_owned(),
            what: format!("its number of triangles, {},", self.len(geometry)),
            backend,
            limit: MOST_TRIANGLES as u64,
        }
    }

    /// The name of the (first) mesh, for messages.
    fn name<'a>(&self, geometry: &'a Geometry) -> &'a str {
        let mesh = match &self.members {
            Members::Mesh(mesh) => Some(*mesh),
            Members::Baked(list) => list.first().map(|&i| geometry.placements[i as usize].mesh),
        };
        mesh.map_or("", |mesh| &geometry.meshes[mesh as usize].name)
    }

    /// The corners of a triangle in this part's frame.
    pub(crate) fn corners(&self, geometry: &Geometry, placement: u32, triangle: u32) -> [DVec3; 3] {
        match &self.members {
            Members::Mesh(mesh) => {
                let corners = geometry.meshes[*mesh as usize].corners(triangle as usize);
                corners.map(|corner| self.frame.local(corner))
            }
            Members::Baked(_) => {
                let placement = &geometry.placements[placement as usize];
                let corners = geometry.mesh_of(placement).corners(triangle as usize);
                corners.map(|corner| self.frame.baked(&placement.world_from_mesh, corner))
            }
        }
    }

    /// Triangles of one of this part's meshes.
    pub(crate) fn source<'a>(&self, geometry: &'a Geometry, placement: u32) -> MeshTriangles<'a> {
        let (mesh, transform) = match &self.members {
            Members::Mesh(mesh) => (*mesh, None),
            Members::Baked(_) => {
                let placement = &geometry.placements[placement as usize];
                let transform = &placement.world_from_mesh;
                (placement.mesh, (!transform.is_identity()).then_some(transform))
            }
        };
        let mesh = &geometry.meshes[mesh as usize];
        MeshTriangles {
            frame: self.frame,
            transform,
            triangles: &mesh.triangles,
            positions: match &mesh.positions {
                Positions::F32(vertices) => Slice::F32(vertices.floats(), vertices.stride()),
                Positions::F64(vertices) => Slice::F64(vertices),
            },
        }
    }

    /// True if all corners go into this part's frame without being turned or stretched.
    pub(crate) fn is_unturned(&self, geometry: &Geometry) -> bool {
        match &self.members {
            Members::Mesh(_) => true,
            Members::Baked(placements) => placements
                .iter()
                .all(|&i| geometry.placements[i as usize].world_from_mesh.is_identity()),
        }
    }

    /// Tells which triangles of one of this part's meshes have an area in this frame.
    fn area_test<'a>(&self, geometry: &'a Geometry, placement: u32) -> AreaTest<'a> {
        match &self.members {
            Members::Mesh(mesh) => AreaTest::of(&geometry.meshes[*mesh as usize]),
            Members::Baked(_) => {
                let placement = &geometry.placements[placement as usize];
                let linear = &placement.world_from_mesh.linear;
                AreaTest::under(geometry.mesh_of(placement), linear)
            }
        }
    }

    /// A ref for every triangle that has an area: its box in this frame, its placement ([`MISS`]
    /// for a shared mesh) and its number.
    pub(crate) fn refs(&self, geometry: &Geometry) -> Vec<Ref> {
        let mut refs = Vec::with_capacity(self.len(geometry));
        let mut append = |placement: u32| {
            let source = self.source(geometry, placement);
            let count = index(source.triangles.len());
            let triangles = (0..count).into_par_iter().with_min_len(1 << 12);
            let make = |triangle| {
                let (lo, hi) = outward(source.corners(triangle));
                Ref { lo, first: placement, hi, second: triangle }
            };
            let test = self.area_test(geometry, placement);
            if test.keeps_all() {
                refs.par_extend(triangles.map(make));
            } else {
                let kept = triangles.filter(|&triangle| test.keeps(triangle as usize));
                refs.par_extend(kept.map(make));
            }
        };
        match &self.members {
            Members::Mesh(_) => append(MISS),
            Members::Baked(placements) => placements.iter().copied().for_each(append),
        }
        refs
    }
}

/// The triangles of one mesh on their way into a frame, for loops over many.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MeshTriangles<'a> {
    frame: PartFrame,
    /// `None` when it changes nothing, or when the frame is the mesh's own.
    transform: Option<&'a Transform>,
    triangles: &'a [[u32; 3]],
    positions: Slice<'a>,
}

#[derive(Debug, Clone, Copy)]
enum Slice<'a> {
    F32(&'a [f32], usize),
    F64(&'a [[f64; 3]]),
}

impl MeshTriangles<'_> {
    /// The corners of a triangle in the mesh's frame.
    #[inline(always)]
    pub(crate) fn local_corners(&self, triangle: u32) -> [DVec3; 3] {
        let [a, b, c] = self.triangles[triangle as usize];
        [self.position(a), self.position(b), self.position(c)]
    }

    /// The corners of a triangle in the part's frame.
    #[inline(always)]
    pub(crate) fn corners(&self, triangle: u32) -> [DVec3; 3] {
        let [a, b, c] = self.local_corners(triangle);
        match self.transform {
            None => [self.frame.local(a), self.frame.local(b), self.frame.local(c)],
            Some(t) => [self.frame.baked(t, a), self.frame.baked(t, b), self.frame.baked(t, c)],
        }
    }

    #[inline(always)]
    fn position(&self, i: u32) -> DVec3 {
        match self.positions {
            Slice::F32(floats, stride) => {
                let start = i as usize * stride;
                let p = &floats[start..start + 3];
                DVec3::new(p[0].into(), p[1].into(), p[2].into())
            }
            Slice::F64(positions) => positions[i as usize].into(),
        }
    }
}

/// Placements, parts and triangles are counted in u32 by the contract.
#[expect(clippy::cast_possible_truncation, reason = "counted in u32 by the contract")]
pub(super) fn index(i: usize) -> u32 {
    i as u32
}
