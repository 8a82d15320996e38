//! Rays one by one: through the tree over the instances, then through each instance's own.

use pulp::NullaryFnOnce;

use super::lanes::Lanes;
use super::ray::{BoxTest, NarrowRay, TriangleTest};
use super::traverse::{Leaves, TraversalStack, traverse};
use super::wide::{Child, NodeChunk, instances_of, leaf_numbers};
use super::{Bvh, PlacedTriangles};
use crate::nearest::{Nearest, Query, Triangle};
use crate::parts::PartInstance;
use crate::watertight;

/// Receiver of the hits of one ray.
pub(super) trait Sink {
    /// True if one hit is as good as another.
    const ANY_WILL_DO: bool;

    fn new(t_max: f64) -> Self;

    /// Takes a hit within the limits; answers how far to look on, or `None` to end.
    fn take(&mut self, hit: watertight::Hit, triangle: &Triangle) -> Option<f64>;
}

impl Sink for Nearest {
    const ANY_WILL_DO: bool = false;

    #[inline(always)]
    fn new(t_max: f64) -> Self {
        Self::none(t_max)
    }

    #[inline(always)]
    fn take(&mut self, hit: watertight::Hit, triangle: &Triangle) -> Option<f64> {
        self.offer(hit, triangle);
        Some(self.t)
    }
}

/// Receiver that records whether there is any hit.
pub(super) struct AnyHit {
    pub(super) found: bool,
}

impl Sink for AnyHit {
    const ANY_WILL_DO: bool = true;

    #[inline(always)]
    fn new(_: f64) -> Self {
        Self { found: false }
    }

    #[inline(always)]
    fn take(&mut self, _: watertight::Hit, _: &Triangle) -> Option<f64> {
        self.found = true;
        None
    }
}

/// The stacks of the tree over the instances and of the instances' own.
pub(super) struct Stacks {
    pub(super) outer: TraversalStack,
    pub(super) inner: TraversalStack,
}

impl Stacks {
    pub(super) fn new() -> Self {
        Self { outer: TraversalStack::new(), inner: TraversalStack::new() }
    }
}

/// One ray on its way through the scene.
pub(super) struct Search<'a, L, S> {
    pub(super) lanes: L,
    pub(super) bvh: &'a Bvh,
    pub(super) query: &'a Query,
    /// Distance up to which to look.
    pub(super) t_max: f64,
    pub(super) sink: &'a mut S,
    pub(super) stack: &'a mut TraversalStack,
}

impl<L: Lanes, S: Sink> Search<'_, L, S> {
    #[inline(always)]
    pub(super) fn run(&mut self, outer: &mut TraversalStack) {
        if let [instance] = &self.bvh.layout.instances[..] {
            self.lanes.run(Visit { search: self, instance });
        } else if !self.bvh.top.cells.is_empty() {
            let ray = NarrowRay::new(&self.bvh.layout.world, self.query);
            let test = BoxTest::new(self.lanes, &ray);
            let (cells, far) = (&self.bvh.top.cells, ray.far(self.t_max));
            let mut leaves = InstanceLeaves { search: self, ray };
            traverse(leaves.search.lanes, cells, &test, far, outer, &mut leaves);
        }
    }
}

/// Leaves of the tree over the instances.
struct InstanceLeaves<'a, 'b, L, S> {
    search: &'a mut Search<'b, L, S>,
    ray: NarrowRay,
}

impl<L: Lanes, S: Sink> Leaves for InstanceLeaves<'_, '_, L, S> {
    #[inline(always)]
    fn see(&mut self, leaf: Child, _: f32) -> Option<f32> {
        let bvh = self.search.bvh;
        for (number, ..) in instances_of(&bvh.top.cells, leaf)? {
            let instance = bvh.layout.instances.get(number)?;
            if !self.search.lanes.run(Visit { search: self.search, instance }) {
                return None;
            }
        }
        Some(self.ray.far(self.search.t_max))
    }
}

/// A ray's visit to one instance; answers whether to look on. Run by [`Lanes::run`], so that it need
/// not be inlined twice.
pub(super) struct Visit<'a, 'b, L, S> {
    pub(super) search: &'a mut Search<'b, L, S>,
    pub(super) instance: &'a PartInstance,
}

impl<L: Lanes, S: Sink> NullaryFnOnce for Visit<'_, '_, L, S> {
    type Output = bool;

    #[inline(always)]
    fn call(self) -> bool {
        let Self { search, instance } = self;
        let lanes = search.lanes;
        let shape = &search.bvh.parts[instance.part as usize];
        let ray = NarrowRay::new(instance, search.query);
        let boxes = BoxTest::new(lanes, &ray);
        let cells: &[NodeChunk] = &shape.tree.cells;
        let mut leaves = TriangleLeaves {
            cells,
            test: TriangleTest::new(lanes, &ray),
            lanes,
            triangles: PlacedTriangles::new(search.bvh, instance),
            query: search.query,
            ray,
            t_max: search.t_max,
            sink: &mut *search.sink,
            go_on: true,
        };
        let far = ray.far(search.t_max);
        traverse(lanes, cells, &boxes, far, search.stack, &mut leaves);
        search.t_max = leaves.t_max;
        leaves.go_on
    }
}

/// Leaves of a part.
struct TriangleLeaves<'a, L: Lanes, S> {
    lanes: L,
    cells: &'a [NodeChunk],
    triangles: PlacedTriangles<'a>,
    query: &'a Query,
    ray: NarrowRay,
    test: TriangleTest<L>,
    t_max: f64,
    sink: &'a mut S,
    go_on: bool,
}

impl<L: Lanes, S: Sink> Leaves for TriangleLeaves<'_, L, S> {
    #[inline(always)]
    fn see(&mut self, leaf: Child, far: f32) -> Option<f32> {
        let n = leaf.count();
        let numbers = leaf_numbers(self.cells, leaf)?;
        let mut maybe = self.test.maybe(self.lanes, numbers, n, far);
        if maybe == 0 {
            return Some(far);
        }
        while maybe != 0 {
            let i = maybe.trailing_zeros() as usize;
            maybe &= maybe - 1;
            let (placed, triangle) = self.triangles.get(numbers, n, i)?;
            if let Some(hit) = self.query.test(&placed.view, triangle.corners)
                && hit.t <= self.t_max
            {
                match self.sink.take(hit, &triangle) {
                    Some(limit) => self.t_max = limit,
                    None => {
                        self.go_on = false;
                        return None;
                    }
                }
            }
        }
        Some(self.ray.far(self.t_max))
    }
}
