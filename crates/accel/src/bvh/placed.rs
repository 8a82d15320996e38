//! From a place in a leaf to a triangle's corners in its mesh's frame, for the exact test.

use etendue_geometry::Mesh;

use super::wide::{LeafNumbers, LeafUnits};
use super::{Bvh, Owner};
use crate::nearest::{PlacementView, Triangle};
use crate::parts::Instance;

/// A placement with what the exact test needs of it.
#[derive(Clone, Copy)]
pub(super) struct Placed<'a> {
    pub(super) placement: u32,
    pub(super) view: PlacementView<'a>,
    mesh: &'a Mesh,
}

impl<'a> Placed<'a> {
    #[inline(always)]
    fn new(bvh: &'a Bvh, placement: u32) -> Self {
        let place = &bvh.geometry.placements[placement as usize];
        let view = PlacementView::new(&place.world_from_mesh);
        Self { placement, view, mesh: bvh.geometry.mesh_of(place) }
    }
}

/// The triangles of an instance.
pub(super) struct PlacedTriangles<'a> {
    bvh: &'a Bvh,
    /// The placement, where there is but one.
    only: Option<Placed<'a>>,
    units: Option<LeafUnits>,
}

impl<'a> PlacedTriangles<'a> {
    #[inline(always)]
    pub(super) fn new(bvh: &'a Bvh, instance: &Instance) -> Self {
        let shape = &bvh.parts[instance.part as usize];
        let only = match shape.owner {
            Owner::Placement(placement) => Some(Placed::new(bvh, placement)),
            Owner::Instance => Some(Placed::new(bvh, instance.placement)),
            Owner::Leaf => None,
        };
        Self { bvh, only, units: shape.units }
    }

    /// Triangle `i` of the `n` in a leaf with these numbers, and its placement.
    #[inline(always)]
    pub(super) fn get(
        &self,
        numbers: &LeafNumbers,
        n: usize,
        i: usize,
    ) -> Option<(Placed<'a>, Triangle)> {
        let number = numbers.get(9 * n + i)?.to_bits();
        let placed = match self.only {
            Some(placed) => placed,
            None => Placed::new(self.bvh, numbers.get(10 * n + i)?.to_bits()),
        };
        let corners = match self.units {
            Some(units) => units.corners(numbers, n, i),
            None => placed.mesh.corners(number as usize),
        };
        Some((placed, Triangle { placement: placed.placement, number, corners }))
    }
}
