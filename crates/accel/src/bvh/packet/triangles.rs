//! The triangles of leaves against a bundle of rays.
//!
//! Where single precision is sure that a ray passes inside a triangle, and that the triangle lies
//! wholly before all others so far, the hit is *pending*: it is measured in f64 at the end, with those
//! of the other rays side by side. Whatever it is not sure of goes through the exact test at once.

use etendue_geometry::glam::DVec3;

use super::Packet;
use crate::bvh::PlacedTriangles;
use crate::bvh::bundle::{Bundle, FrameRays, PACKET, bits};
use crate::bvh::lanes::{Arithmetic, Lanes};
use crate::bvh::ray::{BoxTest, LeafCorners, TriangleTest, meet_triangles};
use crate::bvh::single::Sink;
use crate::bvh::traverse::Leaves;
use crate::bvh::wide::{Child, LeafNumbers, NodeChunk, leaf_numbers};
use crate::nearest::Triangle;
use crate::watertight::{self, Lines};

/// Leaves of a part, for a bundle of rays.
pub(super) struct PacketTriangles<'a, 'b, L: Lanes, S> {
    lanes: L,
    cells: &'a [NodeChunk],
    triangles: PlacedTriangles<'a>,
    packet: &'a mut Packet<'b, S>,
    rays: &'a FrameRays,
    group: u32,
    boxes: BoxTest<L>,
    test: TriangleTest<L::Sixteen>,
    /// Distances from which on limits are certainly kept.
    surely_near: Wide<L>,
    /// Distance up to which each ray looks in this frame; −∞ for rays of no concern.
    far: Wide<L>,
    /// Triangles that end before this come before all others.
    surely_first: Wide<L>,
    /// Rays with a hit that is still to be measured,
    pending: u32,
    /// and where: the bits of the [`Child`] and of the place in it.
    leaf: Wide<L>,
    place: Wide<L>,
}

type Wide<L> = <<L as Lanes>::Sixteen as Arithmetic>::F;

impl<'a, 'b, L: Lanes, S: Sink> PacketTriangles<'a, 'b, L, S> {
    #[inline(always)]
    pub(super) fn new(
        lanes: L,
        cells: &'a [NodeChunk],
        triangles: PlacedTriangles<'a>,
        packet: &'a mut Packet<'b, S>,
        rays: &'a FrameRays,
        group: u32,
        bundle: &Bundle<L>,
    ) -> Self {
        let l = lanes.sixteen();
        let far = lanes.load_sixteen(&rays.far(&packet.t_max));
        let zero = l.splat(0.0);
        Self {
            lanes,
            cells,
            triangles,
            rays,
            group,
            boxes: bundle.boxes,
            test: bundle.triangles,
            surely_near: lanes.load_sixteen(&rays.surely_near(packet.t_min)),
            far: l.select(group & packet.active, far, l.splat(f32::NEG_INFINITY)),
            surely_first: lanes.load_sixteen(&rays.surely_far(&packet.t_max)),
            pending: 0,
            leaf: zero,
            place: zero,
            packet,
        }
    }

    #[inline(always)]
    pub(super) fn farthest(&self) -> f32 {
        self.lanes.sixteen().greatest(self.far)
    }

    /// The exact test of triangle `i` of the `n` of a leaf for the rays of `maybe`.
    #[inline(never)]
    fn test_exactly(&mut self, numbers: &LeafNumbers, n: usize, i: usize, maybe: u32) {
        let mut far = self.lanes.store_sixteen(self.far);
        let mut surely_first = self.lanes.store_sixteen(self.surely_first);
        for lane in bits(maybe) {
            if self.pending & 1 << lane != 0 {
                self.pending &= !(1 << lane);
                let leaf = Child(self.lanes.store_sixteen(self.leaf)[lane].to_bits());
                let place = self.lanes.store_sixteen(self.place)[lane].to_bits();
                if let Some(numbers) = leaf_numbers(self.cells, leaf) {
                    self.test_one(numbers, leaf.count(), place as usize, lane);
                }
            }
            self.test_one(numbers, n, i, lane);
            let t_max = self.packet.t_max[lane];
            let is_active = self.packet.active & 1 << lane != 0;
            far[lane] = if is_active { self.rays.far_one(lane, t_max) } else { f32::NEG_INFINITY };
            surely_first[lane] = self.rays.surely_far_one(lane, t_max);
        }
        self.far = self.lanes.load_sixteen(&far);
        self.surely_first = self.lanes.load_sixteen(&surely_first);
    }

    fn test_one(&mut self, numbers: &LeafNumbers, n: usize, i: usize, lane: usize) {
        let Some((placed, triangle)) = self.triangles.get(numbers, n, i) else { return };
        let query = self.packet.query(lane);
        let Some(hit) = query.test(&placed.view, triangle.corners) else { return };
        match self.packet.sinks[lane].take(hit, &triangle) {
            Some(limit) => self.packet.t_max[lane] = limit,
            None => self.packet.active &= !(1 << lane),
        }
    }

    /// Works out all pending hits.
    #[inline(always)]
    pub(super) fn measure_pending(&mut self) {
        if self.pending == 0 {
            return;
        }
        let (leaf, place) =
            (self.lanes.store_sixteen(self.leaf), self.lanes.store_sixteen(self.place));
        // The triangle that each ray has found, as it is seen from the ray's origin.
        let zero = [0.0; PACKET];
        let mut lines =
            Lines { corners: [[zero; 3]; 3], direction: self.packet.direction.map(|d| *d) };
        let nothing = Triangle { placement: 0, number: 0, corners: [DVec3::ZERO; 3] };
        let mut triangles = [nothing; PACKET];
        for lane in bits(self.pending) {
            let leaf = Child(leaf[lane].to_bits());
            let place = place[lane].to_bits() as usize;
            let Some((placed, triangle)) = leaf_numbers(self.cells, leaf)
                .and_then(|numbers| self.triangles.get(numbers, leaf.count(), place))
            else {
                continue;
            };
            let origin = self.packet.origin;
            let origin = DVec3::new(origin[0][lane], origin[1][lane], origin[2][lane]);
            let corners = placed.view.seen_from(origin, triangle.corners);
            for (k, corner) in corners.into_iter().enumerate() {
                lines.corners[k][0][lane] = corner.x;
                lines.corners[k][1][lane] = corner.y;
                lines.corners[k][2][lane] = corner.z;
            }
            triangles[lane] = triangle;
        }
        // Measured side by side, and told to each ray.
        let [t, u, v] = watertight::locate_many(&lines, self.pending);
        for lane in bits(self.pending) {
            let hit = watertight::Hit { t: t[lane], u: u[lane], v: v[lane], front: true };
            if let Some(limit) = self.packet.sinks[lane].take(hit, &triangles[lane]) {
                self.packet.t_max[lane] = limit;
            }
        }
    }
}

impl<L: Lanes, S: Sink> Leaves for PacketTriangles<'_, '_, L, S> {
    #[inline(always)]
    fn see(&mut self, leaf: Child, far: f32) -> Option<f32> {
        let l = self.lanes.sixteen();
        let n = leaf.count();
        let numbers = leaf_numbers(self.cells, leaf)?;
        let runs = LeafCorners::new(numbers, n, self.test.axes)?;
        let mut any = 0;
        for i in bits(meet_triangles(self.lanes, numbers, n, &self.boxes, far)) {
            let i = i.min(n - 1);
            let look = self.test.look(l, &runs, i, self.far);
            if look.maybe == 0 {
                continue;
            }
            any |= look.maybe;
            // Rays that surely hit it, before anything else so far, are measured later and
            // together.
            let sure = look.maybe
                & look.inside
                & l.le(self.surely_near, look.closest)
                & l.le(look.farthest, self.surely_first);
            self.pending |= sure;
            self.far = l.select(sure, look.farthest, self.far);
            self.surely_first = l.select(sure, look.closest, self.surely_first);
            self.leaf = l.select(sure, l.splat(f32::from_bits(leaf.0)), self.leaf);
            let place = f32::from_bits(u32::from(i.to_le_bytes()[0]));
            self.place = l.select(sure, l.splat(place), self.place);
            // The others are decided now.
            if look.maybe != sure {
                self.test_exactly(numbers, n, i, look.maybe & !sure);
            }
        }
        if any == 0 {
            return Some(far);
        }
        if self.group & self.packet.active == 0 {
            return None;
        }
        Some(self.farthest())
    }
}
