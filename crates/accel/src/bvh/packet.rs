//! Sixteen neighbouring rays at a time: through the tree as one bundle, through triangles side by
//! side.
//!
//! A bundle visits what any of its rays may visit. Its box test is that of a single ray
//! ([`BoxTest`](super::ray::BoxTest)), with reciprocals and offsets that bound those of all its rays, so a node costs the
//! bundle what it costs one ray (interval arithmetic, after S. Boulos et al., "Packet-based Whitted and
//! distribution ray tracing", 2007). For bounds to exist the rays must run towards the same octant;
//! a packet that does not is taken apart into bundles that do.

mod triangles;

use std::marker::PhantomData;

use etendue_geometry::RayBatch;
use etendue_geometry::glam::DVec3;
use pulp::NullaryFnOnce;

use self::triangles::PacketTriangles;
use super::bundle::{Bundle, EachRay, FEWEST, FrameRays, PACKET, bits};
use super::lanes::{Arithmetic, Lanes};
use super::single::{Search, Sink, Stacks, Visit};
use super::traverse::{Leaves, TraversalStack, traverse};
use super::wide::{Child, NodeChunk, instances_of};
use super::{Bvh, PlacedTriangles};
use crate::nearest::Query;
use crate::parts::PartInstance;

/// Sixteen rays and what has become of them.
pub(super) struct Packet<'a, S> {
    /// `[axis][ray]`, in the world.
    origin: [&'a [f64; PACKET]; 3],
    direction: [&'a [f64; PACKET]; 3],
    t_min: &'a [f64; PACKET],
    /// Distance up to which each ray looks.
    t_max: [f64; PACKET],
    sinks: [S; PACKET],
    /// A bit for every ray that may still hit something.
    active: u32,
    /// A bit for every ray that could at first.
    sound: u32,
}

impl<'a, S: Sink> Packet<'a, S> {
    /// The rays of a batch from `first` on; `None` when there are not enough.
    #[inline(always)]
    pub(super) fn of(rays: &'a RayBatch, first: usize) -> Option<Self> {
        let [x, y, z] = rays.origins();
        let origin = [chunk(x, first)?, chunk(y, first)?, chunk(z, first)?];
        let [x, y, z] = rays.directions();
        let direction = [chunk(x, first)?, chunk(y, first)?, chunk(z, first)?];
        let t_min = chunk(rays.t_min(), first)?;
        let t_max = *chunk(rays.t_max(), first)?;
        let sound = soundness(origin, direction, t_min, &t_max);
        let sinks = t_max.map(S::new);
        Some(Self { origin, direction, t_min, t_max, sinks, active: sound, sound })
    }

    #[inline(always)]
    pub(super) fn trace<L: Lanes>(&mut self, lanes: L, bvh: &Bvh, stacks: &mut Stacks) {
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

    /// Hands over the answers of all rays that could hit.
    #[inline(always)]
    pub(super) fn finish(self, mut sink: impl FnMut(usize, S)) {
        for (lane, answer) in self.sinks.into_iter().enumerate() {
            if self.sound & 1 << lane != 0 {
                sink(lane, answer);
            }
        }
    }

    #[inline(always)]
    fn in_frame(&self, instance: &PartInstance) -> FrameRays {
        let parallel = FrameRays::parallel(instance, self.origin, self.direction, self.t_min);
        parallel.unwrap_or_else(|| {
            FrameRays::new(&instance.rays(self.origin, self.direction), self.t_min)
        })
    }

    #[inline(always)]
    fn query(&self, lane: usize) -> Query {
        let at =
            |axes: [&[f64; PACKET]; 3]| DVec3::new(axes[0][lane], axes[1][lane], axes[2][lane]);
        Query {
            origin: at(self.origin),
            direction: at(self.direction),
            t_min: self.t_min[lane],
            t_max: self.t_max[lane],
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

    /// The farthest that any active ray of `group` looks.
    #[inline(always)]
    fn farthest<L: Lanes>(&self, lanes: L, rays: &FrameRays, group: u32) -> f32 {
        let l = lanes.sixteen();
        let far = lanes.load_sixteen(&rays.far(&self.t_max));
        l.greatest(l.select(group & self.active, far, l.splat(f32::NEG_INFINITY)))
    }
}

#[inline(always)]
fn chunk(numbers: &[f64], first: usize) -> Option<&[f64; PACKET]> {
    numbers.get(first..)?.first_chunk()
}

/// A bit for every ray that can hit something, as [`Query::of`] has it.
#[inline(always)]
fn soundness(
    origin: [&[f64; PACKET]; 3],
    direction: [&[f64; PACKET]; 3],
    t_min: &[f64; PACKET],
    t_max: &[f64; PACKET],
) -> u32 {
    let mut sound = 0;
    for i in 0..PACKET {
        // 0 unless one of them is not finite.
        let origin = origin[0][i] * 0.0 + origin[1][i] * 0.0 + origin[2][i] * 0.0;
        let [x, y, z] = [direction[0][i], direction[1][i], direction[2][i]];
        let is_finite = origin + (x * 0.0 + y * 0.0 + z * 0.0) == 0.0;
        let runs = (x != 0.0) | (y != 0.0) | (z != 0.0);
        sound |= u32::from(is_finite & runs & (t_min[i] <= t_max[i])) << i;
    }
    sound
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
pub(super) struct BatchTraversal<'a, L, S, F> {
    pub(super) lanes: L,
    pub(super) bvh: &'a Bvh,
    pub(super) rays: &'a RayBatch,
    /// Called with the number and the answer of every ray that can hit at all.
    pub(super) sink: F,
    pub(super) seen: PhantomData<S>,
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
