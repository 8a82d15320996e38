//! A batch of rays, packet by packet: each through the tree over the instances, and to those it meets.

use std::marker::PhantomData;

use etendue_geometry::RayBatch;
use pulp::NullaryFnOnce;

use super::Packet;
use super::triangles::PacketTriangles;
use crate::bvh::bundle::{Bundle, EachRay, FEWEST, FrameRays, PACKET, bits};
use crate::bvh::lanes::Lanes;
use crate::bvh::single::{Search, Sink, Stacks, Visit};
use crate::bvh::traverse::{Leaves, TraversalStack, traverse};
use crate::bvh::wide::{Child, NodeChunk, instances_of};
use crate::bvh::{Bvh, PlacedTriangles};
use crate::nearest::Query;
use crate::parts::PartInstance;

impl<S: Sink> Packet<'_, S> {
    #[inline(always)]
    fn trace<L: Lanes>(&mut self, lanes: L, bvh: &Bvh, stacks: &mut Stacks) {
        if self.active == 0 {
            return;
        }
        if let [instance] = &bvh.layout.instances[..] {
            let (group, stack) = (self.active, &mut stacks.inner);
            lanes.run(VisitTogether { lanes, bvh, packet: self, instance, group, stack });
        } else if !bvh.top.cells.is_empty() {
            let rays = self.in_frame(&bvh.layout.world);
            let mut rest = self.active;
            while rest != 0 {
                let group = rays.same_octant(rest);
                rest &= !group;
                self.trace_instances(lanes, bvh, &rays, group, stacks);
            }
        }
    }

    #[inline(always)]
    fn trace_instances<L: Lanes>(
        &mut self,
        lanes: L,
        bvh: &Bvh,
        rays: &FrameRays,
        group: u32,
        stacks: &mut Stacks,
    ) {
        let Some(bundle) = Bundle::new(lanes, rays, group) else {
            for lane in bits(group) {
                let query = self.query(lane);
                self.search(lanes, bvh, lane, &query, &mut stacks.inner).run(&mut stacks.outer);
            }
            return;
        };
        let stack = &mut stacks.inner;
        let far = self.farthest(lanes, rays, group);
        let each = EachRay::new(lanes, rays, group);
        let mut leaves = PacketInstances { lanes, bvh, packet: self, rays, each, group, stack };
        traverse(lanes, &bvh.top.cells, &bundle.boxes, far, &mut stacks.outer, &mut leaves);
    }

    #[inline(always)]
    fn search<'b, L: Lanes>(
        &'b mut self,
        lanes: L,
        bvh: &'b Bvh,
        lane: usize,
        query: &'b Query,
        stack: &'b mut TraversalStack,
    ) -> Search<'b, L, S> {
        let t_max = self.t_max[lane];
        Search { lanes, bvh, query, t_max, sink: &mut self.sinks[lane], stack }
    }

    /// Takes the rays of `group` to one instance.
    #[inline(always)]
    fn visit<L: Lanes>(
        &mut self,
        lanes: L,
        bvh: &Bvh,
        instance: &PartInstance,
        group: u32,
        stack: &mut TraversalStack,
    ) {
        if group.count_ones() < FEWEST {
            self.visit_alone(lanes, bvh, instance, group, stack);
        } else {
            lanes.run(VisitTogether { lanes, bvh, packet: self, instance, group, stack });
        }
    }

    #[inline(always)]
    fn visit_alone<L: Lanes>(
        &mut self,
        lanes: L,
        bvh: &Bvh,
        instance: &PartInstance,
        group: u32,
        stack: &mut TraversalStack,
    ) {
        for lane in bits(group) {
            let query = self.query(lane);
            let mut search = self.search(lanes, bvh, lane, &query, stack);
            let go_on = lanes.run(Visit { search: &mut search, instance });
            self.t_max[lane] = search.t_max;
            if !go_on {
                self.active &= !(1 << lane);
            }
        }
    }
}

/// Leaves of the tree over the instances.
struct PacketInstances<'a, 'b, L: Lanes, S> {
    lanes: L,
    bvh: &'a Bvh,
    packet: &'a mut Packet<'b, S>,
    rays: &'a FrameRays,
    each: EachRay<L::Sixteen>,
    group: u32,
    stack: &'a mut TraversalStack,
}

impl<L: Lanes, S: Sink> Leaves for PacketInstances<'_, '_, L, S> {
    #[inline(always)]
    fn see(&mut self, leaf: Child, _: f32) -> Option<f32> {
        let (lanes, bvh) = (self.lanes, self.bvh);
        for (number, lo, hi) in instances_of(&bvh.top.cells, leaf)? {
            let instance = bvh.layout.instances.get(number)?;
            // The bundle as a whole meets the box; over many small instances few of its rays do.
            let far = lanes.load_sixteen(&self.rays.far(&self.packet.t_max));
            let meets = self.each.meet(lanes.sixteen(), [lo, hi], far);
            let group = self.group & self.packet.active & meets;
            self.packet.visit(lanes, bvh, instance, group, self.stack);
        }
        if self.group & self.packet.active == 0 {
            return None;
        }
        Some(self.packet.farthest(self.lanes, self.rays, self.group))
    }
}

/// The visit of the rays of `group` to one instance.
struct VisitTogether<'a, 'b, L, S> {
    lanes: L,
    bvh: &'a Bvh,
    packet: &'a mut Packet<'b, S>,
    instance: &'a PartInstance,
    group: u32,
    stack: &'a mut TraversalStack,
}

impl<L: Lanes, S: Sink> NullaryFnOnce for VisitTogether<'_, '_, L, S> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lanes, bvh, packet, instance, mut group, stack } = self;
        let rays = packet.in_frame(instance);
        while group != 0 {
            let together = rays.same_octant(group);
            group &= !together;
            if let Some(bundle) = Bundle::new(lanes, &rays, together) {
                let cells: &[NodeChunk] = &bvh.parts[instance.part as usize].tree.cells;
                let triangles = PlacedTriangles::new(bvh, instance);
                let mut leaves =
                    PacketTriangles::new(lanes, cells, triangles, packet, &rays, together, &bundle);
                let far = leaves.farthest();
                traverse(lanes, cells, &bundle.boxes, far, stack, &mut leaves);
                leaves.measure_pending();
                continue;
            }
            packet.visit_alone(lanes, bvh, instance, together, stack);
        }
    }
}

/// A batch of rays, with the instruction set to trace it by.
pub(in crate::bvh) struct BatchTraversal<'a, L, S, F> {
    pub(in crate::bvh) lanes: L,
    pub(in crate::bvh) bvh: &'a Bvh,
    pub(in crate::bvh) rays: &'a RayBatch,
    /// Called with the number and the answer of every ray that can hit at all.
    pub(in crate::bvh) sink: F,
    pub(in crate::bvh) seen: PhantomData<S>,
}

impl<L: Lanes, S: Sink, F: FnMut(usize, S)> NullaryFnOnce for BatchTraversal<'_, L, S, F> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let mut stacks = Stacks::new();
        // A packet goes on until its last ray has found something; rays for which any hit will do are
        // done sooner alone.
        let together = self.rays.coherent && !S::ANY_WILL_DO;
        let alone = if together { self.packets(&mut stacks) } else { 0 };
        for i in alone..self.rays.len() {
            if let Some(query) = Query::of(self.rays, i) {
                let mut sink = S::new(query.t_max);
                let mut search = Search {
                    lanes: self.lanes,
                    bvh: self.bvh,
                    query: &query,
                    t_max: query.t_max,
                    sink: &mut sink,
                    stack: &mut stacks.inner,
                };
                search.run(&mut stacks.outer);
                (self.sink)(i, sink);
            }
        }
    }
}

impl<L: Lanes, S: Sink, F: FnMut(usize, S)> BatchTraversal<'_, L, S, F> {
    /// Traces as many whole packets as there are; answers how many rays that were.
    #[inline(always)]
    fn packets(&mut self, stacks: &mut Stacks) -> usize {
        let mut first = 0;
        while let Some(mut packet) = Packet::<S>::of(self.rays, first) {
            packet.trace(self.lanes, self.bvh, stacks);
            packet.finish(|lane, sink| (self.sink)(first + lane, sink));
            first += PACKET;
        }
        first
    }
}
